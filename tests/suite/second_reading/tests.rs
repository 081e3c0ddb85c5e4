use super::cl;
use super::cl_table::CUTS;
use super::compare::spread;
use super::compare::{Bench, Verdict};
use super::generate::program;
use super::known::{CL_REFUSED, CL_WRONG, LEFT, WRONG, WRONG_PROGRAMS};
use super::table::cases;
use deflex::correct::Options;

/// Choices of inputs for each construct.
const INPUTS: std::ops::Range<u64> = 0..8;

#[test]
fn constructs_are_corrected_or_left_and_said_to_be() {
    let bench = Bench::new();
    let all: Vec<_> = cases().collect();
    let surprises: Vec<String> = spread(&all, |case| {
        let verdict = bench.judge(&[case.text()], INPUTS, &Options::default());
        let (wrong, left) = match &verdict {
            Verdict::Right { corrected, .. } => (false, *corrected < case.least),
            Verdict::Refused(_) => (false, case.least > 0),
            Verdict::Wrong(_) => (true, false),
            Verdict::Invalid(why) => panic!("{}: {why}", case.name),
        };
        let expected = (WRONG.contains(&case.name), LEFT.contains(&case.name));
        let mended = if (wrong, left) == (false, false) { "mended, take it off the list" } else { "is new" };
        ((wrong, left) != expected).then(|| format!("{} {mended}: {verdict:?}", case.name))
    })
    .into_iter()
    .flatten()
    .collect();
    assert!(surprises.is_empty(), "{} of {}:\n{}", surprises.len(), all.len(), surprises.join("\n"));
    let unknown: Vec<_> = WRONG.iter().chain(LEFT).filter(|name| !all.iter().any(|case| case.name == **name)).collect();
    assert!(unknown.is_empty(), "no such construct: {unknown:?}");
}

/// Ten thousand times as many: `cargo run --release --example second_reading -- random 100000`.
#[test]
fn generated_programs_are_corrected_or_left_and_said_to_be() {
    const PROGRAMS: u64 = 1000;
    let bench = Bench::new();
    let seeds: Vec<u64> = (0..PROGRAMS).collect();
    let verdicts = spread(&seeds, |&seed| {
        let options = Options { allow_clones: seed % 4 == 3, ..Options::default() };
        bench.judge(&program(seed), 0..2, &options)
    });
    let (mut wrong, mut corrected, mut refused) = (Vec::new(), 0, 0);
    for (seed, verdict) in seeds.iter().zip(verdicts) {
        match verdict {
            Verdict::Wrong(why) => wrong.push(format!("{seed}: {why}")),
            Verdict::Right { corrected: some, .. } => corrected += usize::from(some > 0),
            Verdict::Refused(_) => refused += 1,
            Verdict::Invalid(why) => panic!("{seed} is no program: {why}"),
        }
    }
    assert!(
        wrong.len() <= WRONG_PROGRAMS,
        "{} are wrong, known are {WRONG_PROGRAMS}:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    // Leaving everything alone is no answer.
    assert!(corrected > 700, "only {corrected} of {PROGRAMS} have a motion corrected, {refused} are refused");
}

#[test]
fn cl_constructs_are_read_by_their_meaning_or_refused() {
    let surprise = |cut: &super::cl_table::Cut| {
        let verdict = cl::judge(cut);
        let (wrong, refused) = match &verdict {
            Verdict::Right { .. } => (false, false),
            Verdict::Refused(_) => (false, true),
            Verdict::Wrong(_) | Verdict::Invalid(_) => (true, false),
        };
        let expected = (CL_WRONG.contains(&cut.name), CL_REFUSED.contains(&cut.name));
        let mended = if (wrong, refused) == (false, false) { "mended, take it off the list" } else { "is new" };
        ((wrong, refused) != expected).then(|| format!("{} {mended}: {verdict:?}", cut.name))
    };
    let surprises: Vec<String> = spread(CUTS, surprise).into_iter().flatten().collect();
    assert!(surprises.is_empty(), "{} of {}:\n{}", surprises.len(), CUTS.len(), surprises.join("\n"));
    let unknown: Vec<_> = CL_WRONG.iter().chain(CL_REFUSED).filter(|n| !CUTS.iter().any(|c| c.name == **n)).collect();
    assert!(unknown.is_empty(), "no such construct: {unknown:?}");
}
