//! What changed between two programs, target by target.

use super::pairs::{InsertedTarget, Pairs, compare, settings};
use super::summary::{counted, grouped};
use deflex_program::{Change, Conf, Config, Goal, Program, RewriteOptions, StatusAndTurn};
use deflex_text::{applied, number};
use nalgebra::Vector3;
use serde::Serialize;
use std::fmt::Write;

/// Differences below this, mm and degrees, are rounding: the same printed numbers read twice.
const SAME: f64 = 1e-9;

/// The differences of two programs.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// let difference = deflex_report::difference(&program, &program);
/// assert!(difference.is_empty() && difference.max_mm == 0.0);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Difference {
    /// Executed motions of the first program.
    pub targets: usize,
    /// Targets that moved.
    pub moved: Vec<MovedTarget>,
    /// Largest shift, mm.
    pub max_mm: f64,
    /// Mean shift of the moved targets, mm.
    pub mean_mm: f64,
    /// Largest turn, degrees.
    pub max_deg: f64,
    /// Largest difference between the shifts of neighbours, mm.
    pub max_step_mm: f64,
    /// Targets that were inserted into the second program.
    pub inserted: Vec<InsertedTarget>,
    /// Differences that are not a number of a target.
    pub other: Vec<OtherDifference>,
}

/// A target that moved.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// for moved in deflex_report::difference(&program, &program).moved {
///     println!("target {}: {:?} mm", moved.target, moved.shift_mm);
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct MovedTarget {
    /// Index into the first program's targets.
    #[serde(skip)]
    pub index: usize,
    /// Ordinal.
    pub target: u32,
    /// Line in the first program.
    pub line: u32,
    /// Position in the second program minus that in the first, mm.
    pub shift_mm: [f64; 3],
    /// Length of the shift, mm.
    pub mm: f64,
    /// Turn, degrees.
    pub deg: f64,
    /// Difference from the shift of the previous target, mm.
    pub step_mm: f64,
    /// confdata before and after, where changed.
    pub conf: Option<([i32; 4], [i32; 4])>,
}

/// Something other than a number.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// for other in deflex_report::difference(&program, &program).other {
///     println!("line {}: {}", other.line, other.what);
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct OtherDifference {
    /// Line in the first program, 0 where the whole file is meant.
    pub line: usize,
    /// What is different.
    pub what: String,
}

impl Difference {
    /// Whether the programs are the same.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.moved.is_empty() && self.inserted.is_empty() && self.other.is_empty()
    }
}

/// Compares two programs. Quaternions of opposite sign are the same orientation.
///
/// # Examples
/// ```
/// use deflex_program::rapid;
/// use deflex_report::difference;
/// use deflex_text::Source;
///
/// let text = String::from_utf8_lossy(&std::fs::read("../../samples/slot/slot.mod")?).into_owned();
/// let read = |text: &str| rapid::read(vec![Source::new("slot.mod", text)], vec![]);
/// let found = difference(&read(&text)?, &read(&text.replace("[[3.0000,", "[[3.0500,"))?);
/// assert!(found.moved.len() == 1 && (found.max_mm - 0.05).abs() < 1e-9);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[must_use]
pub fn difference(first: &Program, second: &Program) -> Difference {
    let mut out = Difference { targets: first.targets.len(), ..Difference::default() };
    let pairs = if second.targets.len() > first.targets.len() { Pairs::subdivided(first, second) } else { None };
    let pairs = pairs.unwrap_or_else(|| {
        if first.targets.len() != second.targets.len() {
            let what = format!("{} targets became {}", first.targets.len(), second.targets.len());
            out.other.push(OtherDifference { line: 0, what });
        }
        Pairs::in_order(first, second)
    });
    out.inserted = pairs.inserted.iter().map(|(inserted, _)| inserted.clone()).collect();
    let mut last = Vector3::zeros();
    for &(i, k, is_same_place) in &pairs.same {
        let (a, b) = (&first.targets[i], &second.targets[k]);
        if !is_same_place {
            continue;
        }
        let (shift, deg, conf) = compare(&a.goal, &b.goal);
        let step = if i == 0 { 0.0 } else { (shift - last).norm() };
        last = shift;
        let mm = shift.norm();
        out.max_step_mm = out.max_step_mm.max(step);
        if mm > SAME || deg > SAME || conf.is_some() {
            (out.max_mm, out.max_deg) = (out.max_mm.max(mm), out.max_deg.max(deg));
            let conf = conf.map(|(a, b)| (list(a), list(b)));
            let moved = MovedTarget {
                index: i,
                target: a.ordinal,
                line: a.line,
                shift_mm: shift.into(),
                mm,
                deg,
                step_mm: step,
                conf,
            };
            out.moved.push(moved);
        }
        if first.language == second.language {
            let line = a.line as usize;
            let what = settings(first, a, second, b).into_iter();
            let what = what.map(|what| format!("target {}: {what} is different", a.ordinal));
            out.other.extend(what.map(|what| OtherDifference { line, what }));
        }
    }
    if !out.moved.is_empty() {
        out.mean_mm = out.moved.iter().map(|m| m.mm).sum::<f64>() / out.moved.len() as f64;
    }
    if first.language == second.language {
        other_text(first, second, &pairs, &mut out.other);
    }
    out
}

/// Turns of axes 1, 4, 6, quarters or whole ones, and the posture.
fn list(conf: Conf) -> [i32; 4] {
    match conf {
        Conf::Quarters(conf) => [conf.cf1, conf.cf4, conf.cf6, conf.cfx],
        Conf::Turns(Config { turns: [one, four, six], posture }) => [one, four, six, posture],
        Conf::Status(StatusAndTurn { status, turn }) => [turn & 1, turn >> 3 & 1, turn >> 5 & 1, status],
        Conf::Near([one, _, _, four, _, six]) => [one, four, six, 0].map(|angle| angle / 10_000),
    }
}

/// Text outside of the targets' numbers: `first` rewritten to the targets of `second` must read as `second` does.
fn other_text(first: &Program, second: &Program, pairs: &Pairs, out: &mut Vec<OtherDifference>) {
    // A few lines show what is different; a list of all lines of another file would not help.
    const MOST_COMPARED: usize = 50;
    let as_second = if pairs.same.len() == first.targets.len() {
        let wanted = pairs.same.iter().map(|(i, k, _)| change(&first.targets[*i].goal, &second.targets[*k].goal));
        // A target without numbers of its own is where those of others lead it.
        let air = vec![true; first.targets.len()];
        let options = RewriteOptions { air: &air, ..RewriteOptions::default() };
        first.rewrite(&wanted.collect::<Vec<_>>(), &[], &options).edits
    } else {
        Vec::new()
    };
    for (i, (a, b)) in first.sources.iter().zip(&*second.sources).take(first.written).enumerate() {
        let bytes = applied(&a.bytes, as_second.get(i).map_or(&[][..], Vec::as_slice));
        let rest = applied(&b.bytes, &pairs.insertions(second, i));
        let (mut left, mut right) = (skeleton(&bytes), skeleton(&rest));
        loop {
            match (left.next(), right.next()) {
                (None, None) => break,
                (Some((line, x, _)), Some((_, y, _))) if x != y => {
                    out.push(OtherDifference { line, what: format!("text is different: `{}`", y.trim()) });
                }
                (Some((line, _, x)), Some((_, _, y))) => {
                    if let Some((x, y)) = x.iter().zip(&y).find(|(x, y)| !same_number(**x, **y)) {
                        out.push(OtherDifference { line, what: format!("a number is different: {x} became {y}") });
                    }
                }
                (Some((line, ..)), None) => {
                    out.push(OtherDifference { line, what: "lines are missing from here on".to_owned() });
                    break;
                }
                (None, Some((line, ..))) => {
                    out.push(OtherDifference { line, what: "lines are added from here on".to_owned() });
                    break;
                }
            }
            if out.len() > MOST_COMPARED {
                return;
            }
        }
    }
}

/// The changes with which a rewrite turns one goal into another.
fn change(from: &Goal, to: &Goal) -> Option<Change> {
    match (from, to) {
        (Goal::Pose { quat: before, conf: c, .. }, Goal::Pose { position_mm, quat, conf }) => Some(Change {
            position_mm: *position_mm,
            quat: before.iter().zip(quat).any(|(a, b)| (a - b).abs() > 0.0).then_some(*quat),
            conf: conf.filter(|_| c != conf),
            external: None,
        }),
        (Goal::Axis { .. }, Goal::Axis { position_mm, .. }) => {
            Some(Change { position_mm: *position_mm, quat: None, conf: None, external: None })
        }
        _ => None,
    }
}

/// Whether two numbers differ only by rounding to printed digits. All components of a quaternion may have the opposite
/// sign.
fn same_number(a: f64, b: f64) -> bool {
    // Half of the last printed digit of the rewritten number, and as much for the number that was read.
    const PRINTED: f64 = 1e-4;
    let flipped = a.abs() <= 1.0 && (a + b).abs() <= PRINTED;
    (a - b).abs() <= PRINTED || (a - b).abs() <= 1e-12 * a.abs() || flipped
}

/// Lines with every number replaced by `#`, and the numbers.
fn skeleton(bytes: &[u8]) -> impl Iterator<Item = (usize, String, Vec<f64>)> + '_ {
    bytes.split(|&b| b == b'\n').enumerate().map(|(i, line)| {
        let mut out = String::with_capacity(line.len());
        let mut numbers = Vec::new();
        let mut at = 0;
        while at < line.len() {
            let word = at > 0 && (line[at - 1].is_ascii_alphanumeric() || line[at - 1] == b'_');
            let sign =
                matches!(line[at], b'-' | b'+') && line.get(at + 1).is_some_and(|b| b.is_ascii_digit() || *b == b'.');
            let point = line[at] == b'.' && line.get(at + 1).is_some_and(u8::is_ascii_digit);
            if !word && (line[at].is_ascii_digit() || sign || point) {
                let start = at;
                at += 1;
                while at < line.len() && (line[at].is_ascii_digit() || matches!(line[at], b'.' | b'E' | b'e'))
                    || at < line.len() && matches!(line[at], b'+' | b'-') && matches!(line[at - 1], b'E' | b'e')
                {
                    at += 1;
                }
                match number::read(&line[start..at]) {
                    Some(value) => {
                        out.push('#');
                        numbers.push(value);
                    }
                    // Part of a version or an address: not a number.
                    None => out.extend(line[start..at].iter().map(|&b| char::from(b))),
                }
            } else {
                out.push(line[at] as char);
                at += 1;
            }
        }
        (i + 1, out, numbers)
    })
}

/// The differences as text: a line for each target, all other differences, and a summary.
#[must_use]
#[doc(hidden)]
pub fn diff_text(found: &Difference) -> String {
    text_of(found, &found.moved.iter().collect::<Vec<_>>(), found.other.len())
}

/// [`diff_text`] with only the targets that moved farthest.
#[must_use]
#[doc(hidden)]
pub fn diff_summary(found: &Difference) -> String {
    /// How many targets and other differences are listed.
    const MOST_NAMED: usize = 10;
    let mut moved: Vec<&MovedTarget> = found.moved.iter().collect();
    moved.sort_by(|a, b| b.mm.total_cmp(&a.mm));
    moved.truncate(MOST_NAMED);
    let mut text = text_of(found, &moved, found.other.len().min(MOST_NAMED));
    if found.moved.len() > MOST_NAMED || found.other.len() > MOST_NAMED {
        text += "the largest are listed: --report CSV has every target\n";
    }
    text
}

fn text_of(found: &Difference, moved: &[&MovedTarget], others: usize) -> String {
    if found.is_empty() {
        return format!("{}: the programs are the same\n", counted(found.targets, "target"));
    }
    let mut out = String::new();
    // Writing to a String cannot fail.
    if !moved.is_empty() {
        let _ = writeln!(
            out,
            "{:>7} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
            "target", "line", "dx_mm", "dy_mm", "dz_mm", "mm", "deg", "step_mm"
        );
    }
    for m in moved {
        let [x, y, z] = m.shift_mm.map(short);
        let (mm, deg, step) = (short(m.mm), short(m.deg), short(m.step_mm));
        let _ = write!(out, "{:>7} {:>6} {x:>9} {y:>9} {z:>9} {mm:>9} {deg:>9} {step:>9}", m.target, m.line);
        if let Some((before, after)) = m.conf {
            let _ = write!(out, "  confdata {before:?} became {after:?}");
        }
        out.push('\n');
    }
    for other in &found.other[..others] {
        let place = if other.line > 0 { format!("line {}: ", other.line) } else { String::new() };
        let _ = writeln!(out, "{place}{}", other.what);
    }
    let turned = found.moved.iter().filter(|m| m.conf.is_some()).count();
    let _ = writeln!(
        out,
        "{} of {} changed\n  shift                       mean {} mm, largest {} mm\n  turn                        largest {}°\n  \
         step between neighbours     largest {} mm\n  with another configuration  {}\n  inserted targets            {}\n  \
         other differences           {}",
        grouped(found.moved.len()),
        counted(found.targets, "target"),
        short(found.mean_mm),
        short(found.max_mm),
        short(found.max_deg),
        short(found.max_step_mm),
        grouped(turned),
        grouped(found.inserted.len()),
        grouped(found.other.len()),
    );
    out
}

/// The targets that moved, as CSV.
#[must_use]
#[doc(hidden)]
pub fn diff_csv(found: &Difference) -> String {
    let mut out =
        "target,line,shift_x_mm,shift_y_mm,shift_z_mm,shift_mm,turn_deg,step_mm,conf_before,conf_after\n".to_owned();
    for m in &found.moved {
        let numbers =
            [m.shift_mm[0], m.shift_mm[1], m.shift_mm[2], m.mm, m.deg, m.step_mm].map(|value| number::fixed(value, 6));
        let conf = |list: Option<[i32; 4]>| list.map_or_else(String::new, |list| list.map(|c| c.to_string()).join(" "));
        let (before, after) = (conf(m.conf.map(|c| c.0)), conf(m.conf.map(|c| c.1)));
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{},{},{},{before},{after}", m.target, m.line, numbers.join(","));
    }
    out
}

/// Four decimals, as programs are written.
fn short(value: f64) -> String {
    number::fixed(value, 4)
}
