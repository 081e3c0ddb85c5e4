use super::cl;
use super::cl_table::CUTS;
use super::compare::{Bench, Verdict, options_for, spread};
use super::generate::program;
use super::known::LEFT;
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
        let left = match &verdict {
            Verdict::Right { corrected, .. } => *corrected < case.least,
            Verdict::Refused(_) => case.least > 0,
            Verdict::Wrong(why) => return Some(format!("{} is wrong: {why}", case.name)),
            Verdict::Invalid(why) => panic!("{}: {why}", case.name),
        };
        match (left, LEFT.contains(&case.name)) {
            (true, false) => Some(format!("{} is left: {verdict:?}", case.name)),
            (false, true) => Some(format!("{} is corrected now: take it off the list", case.name)),
            _ => None,
        }
    })
    .into_iter()
    .flatten()
    .collect();
    assert!(surprises.is_empty(), "{} of {}:\n{}", surprises.len(), all.len(), surprises.join("\n"));
    let unknown: Vec<_> = LEFT.iter().filter(|name| !all.iter().any(|case| case.name == **name)).collect();
    assert!(unknown.is_empty(), "no such construct: {unknown:?}");
}

/// A hundred times as many: `cargo run --release --example second_reading -- random 100000`.
#[test]
fn generated_programs_are_corrected_or_left_and_said_to_be() {
    const PROGRAMS: u64 = 1000;
    let bench = Bench::new();
    let seeds: Vec<u64> = (0..PROGRAMS).collect();
    let verdicts = spread(&seeds, |&seed| {
        let modules = program(seed);
        bench.judge(&modules, 0..2, &options_for(&modules, seed))
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
    assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong.join("\n"));
    // Leaving everything alone is no answer.
    assert!(corrected > 700, "only {corrected} of {PROGRAMS} have a motion corrected, {refused} are refused");
}

#[test]
fn cl_constructs_are_read_by_their_meaning_or_refused() {
    let misread = |cut: &super::cl_table::Cut| match cl::judge(cut) {
        Verdict::Right { .. } => None,
        verdict => Some(format!("{}: {verdict:?}", cut.name)),
    };
    let misread: Vec<String> = spread(CUTS, misread).into_iter().flatten().collect();
    assert!(misread.is_empty(), "{} of {}:\n{}", misread.len(), CUTS.len(), misread.join("\n"));
}
