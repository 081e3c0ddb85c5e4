//! What changed between two programs, target by target.

use crate::program::{Conf, Goal, Language, Program};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::Serialize;

/// Moves below this are none, mm and degrees: the same printed numbers read twice.
const SAME: f64 = 1e-9;

/// The differences of two programs.
#[derive(Clone, Debug, Default, Serialize)]
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
    /// Anything other than a number of a target: lines of the first program, and what is different.
    pub other: Vec<OtherDifference>,
}

/// A target that moved.
#[derive(Clone, Debug, Serialize)]
pub struct MovedTarget {
    /// Ordinal.
    pub target: u32,
    /// Line in the first program.
    pub line: u32,
    /// Second minus first, mm.
    pub shift_mm: [f64; 3],
    /// Its size, mm.
    pub mm: f64,
    /// Turn, degrees.
    pub deg: f64,
    /// Difference to the neighbour before, mm.
    pub step_mm: f64,
    /// confdata before and after, where changed.
    pub conf: Option<([i32; 4], [i32; 4])>,
}

/// Something other than a number.
#[derive(Clone, Debug, Serialize)]
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
        self.moved.is_empty() && self.other.is_empty()
    }
}

/// Compares two programs. Quaternions of opposite sign are the same orientation.
#[must_use]
pub fn difference(first: &Program, second: &Program) -> Difference {
    let mut out = Difference { targets: first.targets.len(), ..Difference::default() };
    if first.targets.len() != second.targets.len() {
        let what = format!("{} targets became {}", first.targets.len(), second.targets.len());
        out.other.push(OtherDifference { line: 0, what });
    }
    let mut last = Vector3::zeros();
    for (i, (a, b)) in first.targets.iter().zip(&second.targets).enumerate() {
        let (shift, deg, conf) = compare(&a.goal, &b.goal);
        let step = if i == 0 { 0.0 } else { (shift - last).norm() };
        last = shift;
        let mm = shift.norm();
        out.max_step_mm = out.max_step_mm.max(step);
        if mm > SAME || deg > SAME || conf.is_some() {
            (out.max_mm, out.max_deg) = (out.max_mm.max(mm), out.max_deg.max(deg));
            let conf = conf.map(|(a, b)| (list(a), list(b)));
            let moved =
                MovedTarget { target: a.ordinal, line: a.line, shift_mm: shift.into(), mm, deg, step_mm: step, conf };
            out.moved.push(moved);
        }
        if a.feed_mm_s != b.feed_mm_s || first.tools[usize::from(a.tool)] != second.tools[usize::from(b.tool)] {
            let what = format!("target {}: speed or tool is different", a.ordinal);
            out.other.push(OtherDifference { line: a.line as usize, what });
        }
    }
    if !out.moved.is_empty() {
        out.mean_mm = out.moved.iter().map(|m| m.mm).sum::<f64>() / out.moved.len() as f64;
    }
    if first.language == Language::Rapid && second.language == Language::Rapid {
        other_text(first, second, &mut out.other);
    }
    out
}

fn list(conf: Conf) -> [i32; 4] {
    [conf.cf1, conf.cf4, conf.cf6, conf.cfx]
}

type Compared = (Vector3<f64>, f64, Option<(Conf, Conf)>);

fn compare(a: &Goal, b: &Goal) -> Compared {
    let turn = |q: &[f64; 4]| UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
    match (a, b) {
        (Goal::Pose { position_mm: p, quat: q, conf: c }, Goal::Pose { position_mm: p2, quat: q2, conf: c2 }) => {
            let deg = turn(q).angle_to(&turn(q2)).to_degrees();
            let conf = c.zip(*c2).filter(|(c, c2)| c != c2);
            (Vector3::from(*p2) - Vector3::from(*p), deg, conf)
        }
        (Goal::Axis { position_mm: p, axis }, Goal::Axis { position_mm: p2, axis: axis2 }) => {
            let deg = Vector3::from(*axis).angle(&Vector3::from(*axis2)).to_degrees();
            (Vector3::from(*p2) - Vector3::from(*p), deg, None)
        }
        (Goal::Joints { deg: a }, Goal::Joints { deg: b }) => {
            let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            (Vector3::zeros(), worst, None)
        }
        _ => (Vector3::zeros(), 180.0, None),
    }
}

/// Lines that differ in more than their numbers.
fn other_text(first: &Program, second: &Program, out: &mut Vec<OtherDifference>) {
    // A few lines tell; a wholly different file needs no list.
    const MOST: usize = 50;
    for (a, b) in first.sources.iter().zip(&second.sources).take(first.written) {
        let (mut left, mut right) = (skeleton(&a.bytes), skeleton(&b.bytes));
        loop {
            let (x, y) = (left.next(), right.next());
            match (x, y) {
                (None, None) => break,
                (Some((line, x)), Some((_, y))) if x != y => {
                    out.push(OtherDifference { line, what: format!("text is different: `{y}`") });
                }
                (Some((line, _)), None) => {
                    out.push(OtherDifference { line, what: "lines are missing from here on".to_owned() });
                    break;
                }
                (None, Some((line, _))) => {
                    out.push(OtherDifference { line, what: "lines are added from here on".to_owned() });
                    break;
                }
                _ => {}
            }
            if out.len() > MOST {
                return;
            }
        }
    }
}

/// Lines with every number replaced by `#`.
fn skeleton(bytes: &[u8]) -> impl Iterator<Item = (usize, String)> + '_ {
    bytes.split(|&b| b == b'\n').enumerate().map(|(i, line)| {
        let mut out = String::with_capacity(line.len());
        let mut at = 0;
        while at < line.len() {
            let word = at > 0 && (line[at - 1].is_ascii_alphanumeric() || line[at - 1] == b'_');
            let sign =
                matches!(line[at], b'-' | b'+') && line.get(at + 1).is_some_and(|b| b.is_ascii_digit() || *b == b'.');
            if !word && (line[at].is_ascii_digit() || sign) {
                at += 1;
                while at < line.len() && (line[at].is_ascii_digit() || matches!(line[at], b'.' | b'E' | b'e'))
                    || at < line.len() && matches!(line[at], b'+' | b'-') && matches!(line[at - 1], b'E' | b'e')
                {
                    at += 1;
                }
                out.push('#');
            } else {
                out.push(line[at] as char);
                at += 1;
            }
        }
        (i + 1, out)
    })
}
