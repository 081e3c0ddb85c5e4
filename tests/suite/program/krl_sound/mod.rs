//! A second reading of KRL: random programs run by an interpreter of their own, before and after their correction.
//!
//! [`syntax`], [`machine`] and [`expression`] are written from KUKA's manuals and share nothing with `crates/program/src`. The correction
//! is one that depends on all that it may depend on (base, tool, point, external axis), so that one computed under other
//! frames is another. `DEFLEX_KRL_PROGRAMS=10000` runs more of them.

mod expression;
mod generate;
mod machine;
mod syntax;
mod value;

use deflex::program::{Change, Editable, Goal, Motion as Path, Program, Reason, RewriteOptions, krl};
use deflex::text::{Source, applied};
use machine::{FIRST_BASE, FIRST_TOOL, Machine, Motion, TABLE};
use std::collections::{BTreeMap, BTreeSet};
use value::{Matrix, matrix, of_quat, times, turn};

/// Half a digit of three decimals, in single precision at 1 m.
const TOLERANCE_MM: f64 = 7e-4;
/// Five decimals of a degree, in radians, three of them.
const TOLERANCE_RAD: f64 = 5e-7;

/// What a correction depends on: where base and tool are and how they are turned, the point, the external axis.
fn shift(base: ([f64; 3], Matrix), tool: ([f64; 3], Matrix), at: [f64; 3], e1: f64) -> [f64; 3] {
    let frame = |(p, m): ([f64; 3], Matrix), k: f64| {
        let [x, y, z] = turn(&m, [1.0, 2.0, 3.0]);
        k * (p[0] + 1.3 * p[1] + 1.7 * p[2]) / 50.0 + 3.0 * x + 5.0 * y + 7.0 * z
    };
    let all = frame(base, 1.0) + frame(tool, 0.77) + e1 / 40.0 + at[0] / 30.0 + at[1] / 41.0 + at[2] / 53.0;
    std::array::from_fn(|i| 2.0 + (all + 1.1 * i as f64).sin())
}

/// The turn of a correction: about z, y and x, degrees.
fn tilt(shift: [f64; 3]) -> Matrix {
    matrix([0.0, 0.0, 0.0, 0.3 * shift[0], 0.2 * shift[1], 0.1 * shift[2]])
}

/// Quaternion of a matrix near another whose quaternion is known: of `tilt · q`.
fn turned(q: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 4] {
    let about = |axis: usize, deg: f64| {
        let (sin, cos) = (deg.to_radians() / 2.0).sin_cos();
        let mut q = [cos, 0.0, 0.0, 0.0];
        q[axis + 1] = sin;
        q
    };
    let product = |a: [f64; 4], b: [f64; 4]| {
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    };
    let tilt = product(product(about(2, 0.3 * x), about(1, 0.2 * y)), about(0, 0.1 * z));
    product(tilt, q)
}

/// What the reading says a frame is.
fn frame_of(name: &str, data: Option<([f64; 3], [f64; 4])>) -> ([f64; 3], Matrix) {
    let six = |six: [f64; 6]| ([six[0], six[1], six[2]], matrix(six));
    match (data, name) {
        (Some((p, q)), _) => (p, of_quat(q)),
        (None, "$BASE") => six(FIRST_BASE),
        (None, "$TOOL") => six(FIRST_TOOL),
        (None, name) => {
            let number = name.split('[').nth(1).and_then(|rest| rest.trim_end_matches(']').parse::<usize>().ok());
            six(TABLE[number.unwrap_or_else(|| panic!("{name} is no frame of the controller"))])
        }
    }
}

fn changes(program: &Program) -> Vec<Option<Change>> {
    let change = |target: &deflex::program::Target| {
        let Goal::Pose { position_mm, quat, .. } = target.goal else { return None };
        let (Editable::Pose | Editable::Position) = target.editable else { return None };
        let (wobj, tool) = (&program.wobjs[usize::from(target.wobj)], &program.tools[usize::from(target.tool)]);
        let base = frame_of(&wobj.name, wobj.data.map(|d| (d.uframe_mm, d.uframe_quat)));
        let tool = frame_of(&tool.name, tool.data.map(|d| (d.tcp_mm, d.tcp_quat)));
        let e1 = target.external.as_ref().and_then(|axes| axes.written[0]);
        // An axis whose position is not stated is refused if the cell declares its unit.
        let e1 = match (&target.external, e1) {
            (Some(axes), None) if !axes.at_rest[0] => return None,
            (_, e1) => e1.unwrap_or(0.0),
        };
        let by = shift(base, tool, position_mm, e1);
        let quat = (target.editable == Editable::Pose).then(|| turned(quat, by));
        Some(Change { position_mm: std::array::from_fn(|i| position_mm[i] + by[i]), quat, conf: None, external: None })
    };
    program.targets.iter().map(change).collect()
}

fn apart(a: &Matrix, b: &Matrix) -> f64 {
    (0..3).flat_map(|r| (0..3).map(move |c| (r, c))).map(|(r, c)| (a[r][c] - b[r][c]).abs()).fold(0.0, f64::max)
}

/// What is said to stay, by file and line, and of which files lines nothing at all is known.
fn said(program: &Program, changes: &[Option<Change>], kept: &[(usize, Reason)]) -> BTreeSet<(usize, u32)> {
    let place = |i: usize| (usize::from(program.targets[i].source), program.targets[i].line);
    let whole = program.kept.iter().map(|kept| (kept.source, kept.line as u32));
    let unchanged = (0..changes.len()).filter(|i| changes[*i].is_none()).map(place);
    whole.chain(unchanged).chain(kept.iter().map(|(i, _)| place(*i))).collect()
}

/// Where a motion goes that cuts nothing and shares numbers with one that cuts.
struct Went {
    by_mm: [f64; 3],
    turned: Matrix,
}

/// How many motions of the runs are corrected, or what is wrong.
fn judge(texts: &[(String, String)]) -> Result<usize, String> {
    let sources = texts.iter().map(|(name, text)| Source::new(name.clone(), text.clone())).collect();
    let program = krl::read(sources, Vec::new()).map_err(|errors| format!("refused: {}", errors[0]))?;
    // In every second program, joint motions cut nothing.
    let is_even = texts.iter().map(|(_, text)| text.len()).sum::<usize>() % 2 == 0;
    let air: Vec<bool> = program.targets.iter().map(|target| is_even && target.motion == Path::Joint).collect();
    let mut changes = changes(&program);
    changes.iter_mut().zip(&air).filter(|(_, air)| **air).for_each(|(change, _)| *change = None);
    let rewritten = program.rewrite(&changes, &[], &RewriteOptions { air: &air, ..RewriteOptions::default() });
    let mut along: BTreeMap<(usize, u32), Vec<Went>> = BTreeMap::new();
    for &i in &rewritten.along {
        let (target, (to, quat)) = (&program.targets[i], rewritten.written[i]);
        let Goal::Pose { position_mm, .. } = target.goal else { return Err("what is no point goes along".into()) };
        let went = Went { by_mm: std::array::from_fn(|i| to[i] - position_mm[i]), turned: of_quat(quat) };
        along.entry((usize::from(target.source), target.line)).or_default().push(went);
    }
    let said = said(&program, &changes, &rewritten.kept);
    let write = |i: usize| {
        let out = applied(&program.sources[i].bytes, &rewritten.edits[i]);
        String::from_utf8(out).unwrap()
    };
    let written: Vec<String> = (0..texts.len()).map(write).collect();
    let read = |texts: Vec<&str>| texts.iter().enumerate().map(|(i, text)| syntax::file(text, i)).collect::<Vec<_>>();
    let before = read(texts.iter().map(|(_, text)| &**text).collect());
    let after = read(written.iter().map(|text| &**text).collect());
    let all = texts.iter().map(|(_, text)| &**text).collect::<String>();
    let assigned = |name: &str| {
        let upper = all.to_uppercase();
        upper.contains(&format!("{name} = ")) || upper.contains(&format!("FOR {name}"))
    };
    let mut corrected = 0;
    for seed in 0..6 {
        for root in ["A", "B"] {
            if root == "B" && all.contains("b()") {
                continue;
            }
            let run = |files: &[syntax::File]| {
                let mut machine = Machine::new(files, seed).unwrap_or_else(|why| panic!("no program: {why}"));
                // An axis that is at zero in all of the program is not there.
                machine.e1 *= f64::from(u8::from(
                    program
                        .targets
                        .iter()
                        .any(|target| target.external.as_ref().is_some_and(|axes| !axes.is_at_rest())),
                ));
                machine.leave_over(assigned);
                let ended = machine.run(root);
                (machine.motions, ended)
            };
            let ((old, ended), (new, ended_now)) = (run(&before), run(&after));
            if old.len() != new.len() || ended != ended_now {
                return Err(format!("runs differently: {} {ended:?}, now {} {ended_now:?}", old.len(), new.len()));
            }
            for (old, new) in old.iter().zip(&new) {
                let (is_said, along) = (said.contains(&(old.file, old.line)), along.get(&(old.file, old.line)));
                corrected += usize::from(
                    compare(old, new, is_said, along.map_or(&[], Vec::as_slice))
                        .map_err(|why| format!("{} {}: {why}", texts[old.file].0, old.line))?,
                );
            }
        }
    }
    Ok(corrected)
}

/// Whether a motion is corrected; an error where it is neither that nor left and said to be.
fn compare(old: &Motion, new: &Motion, is_said: bool, along: &[Went]) -> Result<bool, String> {
    let same = (old.file, old.line, &old.kind, old.base, old.tool, old.holds_part, old.e1)
        == (new.file, new.line, &new.kind, new.base, new.tool, new.holds_part, new.e1);
    if !same {
        return Err(format!("goes elsewhere: {old:?}, now {new:?}"));
    }
    let (machine::Goal::Pose { via, end, own, loose }, machine::Goal::Pose { via: new_via, end: new_end, .. }) =
        (&old.goal, &new.goal)
    else {
        let axes = old.kind.ends_with("PTP");
        return match old.goal == new.goal {
            true if is_said || axes => Ok(false),
            true => Err("is left and nothing says so".into()),
            false => Err(format!("what is not a point is another: {old:?}, now {new:?}")),
        };
    };
    #[allow(clippy::float_cmp)] // the very numbers
    let untouched = via == new_via && (0..6).all(|i| end[i] == new_end[i] || *loose && !own[i]);
    if untouched {
        return if is_said { Ok(false) } else { Err("is not corrected, and nothing says so".into()) };
    }
    if *loose || old.holds_part {
        return Err(format!("is edited: {old:?}, now {new:?}"));
    }
    if !along.is_empty() {
        let is = |went: &Went| {
            let by = (0..3).all(|i| (new_end[i] - end[i] - went.by_mm[i]).abs() < TOLERANCE_MM);
            by && apart(&matrix(*new_end), &went.turned) < TOLERANCE_RAD
        };
        return match via.is_none() && along.iter().any(is) {
            true => Ok(false),
            false => Err(format!("goes along, and not where it is said to: {old:?}, now {new:?}")),
        };
    }
    let frame = |six: [f64; 6]| ([six[0], six[1], six[2]], matrix(six));
    let by = |at: [f64; 3]| shift(frame(old.base), frame(old.tool), at, old.e1);
    let there = |at: [f64; 3], now: [f64; 3]| {
        let by = by(at);
        (0..3).all(|i| (at[i] + by[i] - now[i]).abs() < TOLERANCE_MM)
    };
    let (at, now) = ([end[0], end[1], end[2]], [new_end[0], new_end[1], new_end[2]]);
    let wanted = times(&tilt(by(at)), &matrix(*end));
    let angles = apart(&wanted, &matrix(*new_end)) < TOLERANCE_RAD || end[3..] == new_end[3..];
    let arc = via.zip(*new_via).is_none_or(|(via, now)| there(via, now));
    if there(at, now) && angles && arc {
        return Ok(true);
    }
    Err(format!("is elsewhere than its correction {:?}: {old:?}, now {new:?}", by(at)))
}

/// Fewer lines that are wrong for the same cause, as far as that shows.
fn minimised(texts: &[(String, String)]) -> Vec<(String, String)> {
    let wrong = |texts: &[(String, String)]| {
        let judged = std::panic::catch_unwind(|| judge(texts));
        judged.is_ok_and(|judged| judged.is_err_and(|why| !why.starts_with("refused")))
    };
    let mut best = texts.to_vec();
    loop {
        let mut smaller = false;
        for file in 0..best.len() {
            for size in [12, 6, 3, 2, 1] {
                let mut at = 0;
                while at + size <= best[file].1.lines().count() {
                    let mut tried = best.clone();
                    let mut lines: Vec<&str> = best[file].1.lines().collect();
                    lines.drain(at..at + size);
                    tried[file].1 = lines.join("\n") + "\n";
                    if wrong(&tried) { (best, smaller) = (tried, true) } else { at += 1 }
                }
            }
        }
        if !smaller {
            return best;
        }
    }
}

/// More of them, in hundreds, with `DEFLEX_KRL_PROGRAMS`; `DEFLEX_KRL_FIRST` is the first seed.
#[test]
fn generated_programs_are_corrected_or_left_and_said_to_be() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number")))
    };
    let (count, first) = (number("DEFLEX_KRL_PROGRAMS", 600), number("DEFLEX_KRL_FIRST", 0));
    let (mut wrong, mut corrected, mut refused) = (Vec::new(), 0, 0);
    for seed in first..first + count {
        let texts = generate::program(seed);
        match judge(&texts) {
            Ok(some) => corrected += u64::from(some > 0),
            Err(why) if why.starts_with("refused") => refused += 1,
            Err(why) => wrong.push((seed, why)),
        }
    }
    let shown: String = wrong.iter().map(|(seed, why)| format!("{seed}: {:.90}\n", why)).take(12).collect();
    // The lines that it takes, of a few.
    let least = |(seed, _): &(u64, String)| {
        let least = minimised(&generate::program(*seed));
        let why = judge(&least);
        least.iter().map(|(name, text)| format!("-- {name}\n{text}")).collect::<String>() + &format!("{why:?}\n\n")
    };
    let first: String = wrong.iter().step_by(wrong.len().div_ceil(4).max(1)).map(least).collect();
    assert!(wrong.is_empty(), "{} of {count} are wrong:\n{shown}\n{first}", wrong.len());
    // Leaving everything alone is no answer.
    assert!(corrected * 4 > count * 3, "only {corrected} of {count} have a motion corrected, {refused} are refused");
}
