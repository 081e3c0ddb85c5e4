//! What becomes of CL data: posted, the posted program run, its path compared with what the manuals say of the statements.

use super::cl_table::{Cut, Expect};
use super::compare::Verdict;
use super::machine::{Goal, Machine};
use super::oracle::Oracle;
use super::syntax;
use super::value::Frame;
use deflex::cell::Cell;
use deflex::correct::{self, Options, PostOptions};
use deflex::program::{Language, cl};
use deflex::text::{Diagnostic, Source};

/// Positions are posted to 4 decimals.
const TOLERANCE_MM: f64 = 2e-4;
/// Arcs are posted as chords that keep within this.
const ARC_MM: f64 = 0.02;
/// Axes in the table have five digits.
const TOLERANCE_AXIS: f64 = 1e-4;
const TOLERANCE_FEED: f64 = 0.01;

const CELL: &str = r#"
[robot]
model = "irb6700-150-3.20"
start_deg = [0, 0, 0, 0, 60, 0]
[robot.stiffness]
joint_nm_per_rad = [6e5, 5e5, 4e5, 9e4, 8e4, 5e4]
[controller]
compensates = []
[tools.t1]
tcp_mm = [0.0, 0.0, 200.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 5.0
cog_mm = [0.0, 0.0, 80.0]
[wobjs.w1]
uframe_mm = [1200.0, 100.0, 600.0]
uframe_quat = [1.0, 0.0, 0.0, 0.0]
oframe_mm = [0.0, 0.0, 0.0]
oframe_quat = [1.0, 0.0, 0.0, 0.0]
[cl]
tool = "t1"
wobj = "w1"
spin = "fixed"
spin_deg = 180.0
[cut]
force = "none"
"#;

/// A move that the posted program makes.
#[derive(Clone, Debug)]
struct Go {
    at: [f64; 3],
    axis: [f64; 3],
    joint: bool,
    feed: Option<f64>,
}

/// The file's text: its unit and a feed, then the statements.
pub fn text(cut: &Cut) -> String {
    format!("UNITS/MM\nFEDRAT/600,MMPM\n{}\n", cut.text)
}

pub fn judge(cut: &Cut) -> Verdict {
    let judged = std::panic::catch_unwind(|| judged(cut));
    judged.unwrap_or_else(|_| Verdict::Wrong("panics".into()))
}

fn judged(cut: &Cut) -> Verdict {
    let first = |errors: Vec<Diagnostic>| errors.first().map_or_else(String::new, ToString::to_string);
    let posted = match posted(&text(cut)) {
        Ok(posted) => posted,
        Err(errors) => {
            let why = first(errors);
            return match cut.expect {
                Expect::Path(_) | Expect::Listed(..) => Verdict::Refused(why),
                _ => Verdict::Right { corrected: 1, left: Vec::new() },
            };
        }
    };
    let right = match cut.expect {
        Expect::Refused => Err(format!("is not refused: {}", brief(&posted.path))),
        Expect::Path(path) | Expect::Either(path) => same(path, &posted.path),
        Expect::Listed(path, lines) => same(path, &posted.path).and_then(|()| {
            let unsaid = lines.iter().find(|line| !posted.said.contains(line));
            unsaid.map_or(Ok(()), |line| Err(format!("nothing says what becomes of line {line}")))
        }),
        Expect::Holes(holes) => drilled(holes, &posted.path),
    };
    match right {
        Ok(()) => Verdict::Right { corrected: 1, left: Vec::new() },
        Err(why) => Verdict::Wrong(why),
    }
}

struct Posted {
    path: Vec<Go>,
    /// Lines of the file that something is said about.
    said: Vec<u32>,
}

fn posted(text: &str) -> Result<Posted, Vec<Diagnostic>> {
    let cell = Cell::read(&Source::new("cell.toml", CELL.as_bytes()))?;
    let options = cell.cl.as_ref().map(|cl| cl.options.clone()).unwrap_or_default();
    let program = cl::read(Source::new("part.cl", text.as_bytes()), &options)?;
    let faults = program.faults();
    if !faults.is_empty() {
        return Err(faults);
    }
    let corrected = correct::compensate(&program, &cell, &Options::default())?;
    if !corrected.failures.is_empty() {
        return Err(corrected.failures);
    }
    let options = PostOptions {
        name: "P".into(),
        title: Vec::new(),
        max_targets: None,
        rapid_mm_s: 200.0,
        feed_mm_s: None,
        language: Language::Rapid,
    };
    let files = correct::post(&program, &cell, &corrected, &options)?;
    let mut said: Vec<u32> = program.kept.iter().map(|kept| kept.line as u32).collect();
    let notes = program.diagnostics.iter().chain(&corrected.notes).chain(&files.notes);
    said.extend(notes.filter(|note| note.file == "part.cl").map(|note| note.line as u32));
    let broken = |why: String| vec![Diagnostic::error("posted", "", why)];
    let rapid = String::from_utf8_lossy(&files.files[0].1).into_owned();
    let module = [syntax::module(&rapid).map_err(broken)?];
    let mut machine = Machine::new(&module, &[], Oracle::new(0));
    if let Some(why) = machine.run() {
        return Err(broken(why));
    }
    let go = |motion: &super::machine::Motion| {
        let Goal::Poses(poses, ..) = &motion.goal else { return Err(broken("joint target".into())) };
        let pose: Frame = poses[poses.len() - 1];
        let axis = pose.rotate([0.0, 0.0, -1.0]);
        Ok(Go { at: pose.p, axis, joint: motion.kind == "MOVEJ", feed: motion.speed })
    };
    let path = machine.motions.iter().map(go).collect::<Result<_, _>>()?;
    Ok(Posted { path, said })
}

fn brief(path: &[Go]) -> String {
    path.iter().take(6).map(|go| format!("{:?} ", go.at)).collect()
}

fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn numbers<const N: usize>(text: &str) -> [f64; N] {
    let all: Vec<f64> = text.split(',').map(|n| n.parse().unwrap()).collect();
    all.try_into().unwrap()
}

/// Compares a path with the table's.
fn same(expected: &str, path: &[Go]) -> Result<(), String> {
    let mut rest = path.iter();
    let mut before: Option<[f64; 3]> = None;
    for expected in expected.split(';') {
        let mut words = expected.split_whitespace();
        let at: [f64; 3] = numbers(words.next().unwrap());
        let words: Vec<&str> = words.collect();
        let arc = words.iter().find_map(|word| word.strip_prefix("arc=")).map(numbers::<4>);
        let go = match (arc, before) {
            (Some(arc), Some(from)) => on_arc(arc, from, at, &mut rest)?,
            _ => rest.next().ok_or_else(|| format!("{expected} is missing"))?.clone(),
        };
        if apart(go.at, at) > TOLERANCE_MM {
            return Err(format!("expected {expected}, found {:?}", go.at));
        }
        let rapid = words.contains(&"r");
        for word in words {
            if let Some(feed) = word.strip_prefix("f=") {
                let feed: f64 = feed.parse().unwrap();
                if go.joint || go.feed.is_none_or(|found| (found - feed).abs() > TOLERANCE_FEED * feed) {
                    return Err(format!("expected {expected}, found feed {:?}", go.feed));
                }
            } else if word.contains(',') && !word.contains('=') && apart(numbers(word), go.axis) > TOLERANCE_AXIS {
                return Err(format!("expected {expected}, found axis {:?}", go.axis));
            }
        }
        if rapid && go.feed.is_none_or(|feed| feed < 100.0) {
            return Err(format!("expected {expected}, found no rapid travel: {go:?}"));
        }
        before = Some(at);
    }
    rest.next().map_or(Ok(()), |more| Err(format!("{:?} is left over", more.at)))
}

/// Follows chords along an arc to its end.
fn on_arc<'a>(
    [x, y, z, turn]: [f64; 4],
    from: [f64; 3],
    to: [f64; 3],
    rest: &mut impl Iterator<Item = &'a Go>,
) -> Result<Go, String> {
    let radius = apart(from, [x, y, z]);
    let angle = |p: [f64; 3]| (p[1] - y).atan2(p[0] - x).to_degrees();
    let (mut gone, mut last) = (0.0_f64, angle(from));
    loop {
        let go = rest.next().ok_or_else(|| "an arc without its end".to_owned())?;
        let step = (angle(go.at) - last).rem_euclid(360.0);
        let step = if step > 180.0 { step - 360.0 } else { step };
        // Half a turn in one chord has no sense; chords are short.
        if step * turn < 0.0 && step.abs() > 1e-3
            || (apart(go.at, [x, y, z]) - radius).abs() > ARC_MM
            || step.abs() > 60.0
        {
            return Err(format!("off the arc of {turn} degrees at {:?}", go.at));
        }
        gone += step;
        last = angle(go.at);
        if apart(go.at, to) < TOLERANCE_MM && (gone - turn).abs() < 1.0 {
            return Ok(go.clone());
        }
    }
}

/// Whether holes are drilled in their order, with nothing sideways below their mouths.
fn drilled(holes: &[[f64; 4]], path: &[Go]) -> Result<(), String> {
    let mut next = holes.iter().peekable();
    for pair in path.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        let sideways = (a.at[0] - b.at[0]).hypot(a.at[1] - b.at[1]) > TOLERANCE_MM;
        let mouth = holes.iter().map(|hole| hole[2]).fold(f64::MIN, f64::max);
        if sideways && a.at[2].min(b.at[2]) <= mouth {
            return Err(format!("travels from {:?} to {:?}", a.at, b.at));
        }
        if b.joint && b.at[2] < mouth {
            return Err(format!("rapid travel into the hole at {:?}", b.at));
        }
        if next.peek().is_some_and(|hole| apart(b.at, [hole[0], hole[1], hole[3]]) < TOLERANCE_MM) {
            next.next();
        }
    }
    let lowest = path.iter().map(|go| go.at[2]).fold(f64::MAX, f64::min);
    let bottom = holes.iter().map(|hole| hole[3]).fold(f64::MAX, f64::min);
    if lowest < bottom - TOLERANCE_MM {
        return Err(format!("goes down to {lowest}"));
    }
    next.next().map_or(Ok(()), |hole| Err(format!("does not drill {hole:?}: {}", brief(path))))
}
