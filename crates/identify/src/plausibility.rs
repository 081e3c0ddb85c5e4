//! Checks a table before anything is fitted: whether its points can belong to the targets that its rows name, and
//! whether an instrument can have measured them on a robot.
//!
//! A clear mistake is refused with a message that says how to correct it. The program corrects no table itself.

use super::data::Problem;
use super::engine::Engine;
use super::outcome::Advice;
use super::reading::{ELSEWHERE_MM, Reading};
use super::statistics::{TO_SIGMA, median};
use deflex_correct::Prepared;
use deflex_measured::{MeasuredRow, Table};
use deflex_text::Diagnostic;
use nalgebra::{DVector, Vector3};

/// Median distance of points from their targets below which no other interpretation is tried, mm: an error of the work
/// object of this size is common.
const NEAR_MM: f64 = 2.0;
/// Share to which another interpretation must reduce the distances to be the one that was meant.
const CLEARLY: f64 = 0.1;
/// Distance from the other rows from which on rows are in another frame or unit, mm, and in medians of the others. No
/// arm bends so far.
const APART: (f64, f64) = (10.0, 20.0);
/// Smallest number of successive rows that are a stretch; fewer are outliers.
const STRETCH: usize = 4;
/// Largest number of points that are compared with all others.
const COMPARED: usize = 200;
/// Shifts of the ordinals that are tried.
const SHIFTS: [isize; 4] = [-1, 1, -2, 2];
/// Scatter from row to row for each axis that no robot exceeds, mm.
const MOST_NOISE_MM: f64 = 1.0;

/// Another interpretation of measured points.
struct Interpretation {
    what: &'static str,
    help: &'static str,
    change: fn(&Vector3<f64>) -> Vector3<f64>,
}

const RENAME: &str = "name the columns rightly, in the header or with --columns";
const TURN: &str = "turn the sign of the column";

/// The interpretations of points that are tried.
const INTERPRETATIONS: [Interpretation; 11] = [
    Interpretation { what: "the numbers are inches", help: "multiply them by 25.4", change: |v| v * 25.4 },
    Interpretation { what: "the numbers are metres", help: "multiply them by 1000", change: |v| v * 1e3 },
    Interpretation { what: "x and y are swapped", help: RENAME, change: |v| Vector3::new(v.y, v.x, v.z) },
    Interpretation { what: "y and z are swapped", help: RENAME, change: |v| Vector3::new(v.x, v.z, v.y) },
    Interpretation { what: "x and z are swapped", help: RENAME, change: |v| Vector3::new(v.z, v.y, v.x) },
    Interpretation { what: "x has the wrong sign", help: TURN, change: |v| Vector3::new(-v.x, v.y, v.z) },
    Interpretation { what: "y has the wrong sign", help: TURN, change: |v| Vector3::new(v.x, -v.y, v.z) },
    Interpretation { what: "z has the wrong sign", help: TURN, change: |v| Vector3::new(v.x, v.y, -v.z) },
    Interpretation { what: "x and y have the wrong sign", help: TURN, change: |v| Vector3::new(-v.x, -v.y, v.z) },
    Interpretation { what: "the columns are y, z, x", help: RENAME, change: |v| Vector3::new(v.z, v.x, v.y) },
    Interpretation { what: "the columns are z, x, y", help: RENAME, change: |v| Vector3::new(v.y, v.z, v.x) },
];

/// A measured position of three axes, mm, with the row and the index of its target.
struct Pair<'a> {
    row: &'a MeasuredRow,
    point: usize,
    measured: Vector3<f64>,
}

/// A row with the index of its point in the program and its reading.
pub(super) type MatchedRow<'a> = (usize, &'a MeasuredRow, Reading);

/// A fault of a table: its first line, or 0 if it concerns the whole table, with how to correct it.
struct Fault {
    line: u64,
    message: String,
    help: String,
}

/// What is wrong with points, and how to correct it.
struct Meaning {
    what: String,
    help: String,
}

/// Adds an error if the points of a table are not those of its targets, or cannot be measurements.
pub(super) fn check_points(prepared: &Prepared, table: &Table, taken: &[MatchedRow], errors: &mut Vec<Diagnostic>) {
    let pair = |&(point, row, reading): &MatchedRow<'_>| match reading {
        Reading::Position(measured) if measured.iter().all(|v| v.is_finite()) => Some((point, row.line, measured)),
        Reading::Position(_) | Reading::Normal(_) | Reading::Distance(_) => None,
    };
    let pairs: Vec<Pair> = taken
        .iter()
        .filter_map(|taken| pair(taken).map(|(point, _, measured)| Pair { row: taken.1, point, measured }))
        .collect();
    let points = MeasuredPoints { prepared, pairs: &pairs };
    let fault = doubled(taken).or_else(|| points.stuck()).or_else(|| points.elsewhere()).or_else(|| points.stretch());
    errors.extend(fault.map(|fault| table.row_error(fault.line, fault.message).help(fault.help)));
}

/// The measured points of a table with their targets.
struct MeasuredPoints<'a> {
    prepared: &'a Prepared,
    pairs: &'a [Pair<'a>],
}

impl MeasuredPoints<'_> {
    /// Position of the target `shift` targets after a point, mm.
    fn target(&self, point: usize, shift: isize) -> Option<Vector3<f64>> {
        let there = self.prepared.points.get(point.checked_add_signed(shift)?)?;
        Some(there.wobj_from_tcp.translation.vector * 1e3)
    }

    /// Median distance, mm, of the points that `keep` accepts, changed by an interpretation, from the targets `shift`
    /// targets after theirs.
    fn off(&self, change: impl Fn(&Vector3<f64>) -> Vector3<f64>, shift: isize, keep: impl Fn(usize) -> bool) -> f64 {
        let of = |(i, pair): (usize, &Pair)| {
            let target = self.target(pair.point, shift).filter(|_| keep(i))?;
            Some((change(&pair.measured) - target).norm())
        };
        median(self.pairs.iter().enumerate().filter_map(of).collect())
    }

    /// Vector from the target of a point to the point, mm.
    fn gap(&self, pair: &Pair) -> Vector3<f64> {
        self.target(pair.point, 0).map_or_else(Vector3::zeros, |target| pair.measured - target)
    }

    /// The vector from target to point, mm, near which the vectors of most points are.
    fn middle(&self) -> Vector3<f64> {
        let gaps: Vec<Vector3<f64>> = self.pairs.iter().map(|pair| self.gap(pair)).collect();
        let every = gaps.len().div_ceil(COMPARED).max(1);
        let alike = |gap: &Vector3<f64>| gaps.iter().filter(|other| (*other - gap).norm() < APART.0).count();
        gaps.iter().step_by(every).max_by_key(|gap| alike(gap)).copied().unwrap_or_default()
    }

    /// The interpretation or shift that brings the points which `keep` accepts clearly nearer to their targets than
    /// `off`, mm.
    fn meant(&self, off: f64, keep: &dyn Fn(usize) -> bool) -> Option<Meaning> {
        let found = INTERPRETATIONS.iter().find(|other| self.off(other.change, 0, keep) < CLEARLY * off);
        found.map(|other| Meaning { what: other.what.to_owned(), help: other.help.to_owned() }).or_else(|| {
            let shift = SHIFTS.into_iter().find(|&shift| self.off(|v| *v, shift, keep) < CLEARLY * off)?;
            let (side, change) = if shift > 0 { ("after", "add") } else { ("before", "subtract") };
            let by = shift.unsigned_abs();
            Some(Meaning {
                what: format!("each point belongs to the target {by} {side} the one that its row names"),
                help: format!("{change} {by} in the column `target`"),
            })
        })
    }

    /// A fault if the points as a whole are not at their targets.
    fn elsewhere(&self) -> Option<Fault> {
        let off = self.off(|v| *v, 0, |_| true);
        if off < NEAR_MM {
            return None;
        }
        let meaning = self.meant(off, &|_| true).or_else(|| self.shuffled(off)).or_else(|| {
            (off >= ELSEWHERE_MM).then(|| Meaning {
                what: "they are not in the work object's frame, or belong to another program".to_owned(),
                help: "check the work object of the points, and that this is the table of this program".to_owned(),
            })
        })?;
        let message = format!("measured points lie {off:.1} mm (median) from their targets: {}", meaning.what);
        Some(Fault { line: 0, message, help: meaning.help })
    }

    /// The meaning of points that lie at other targets of the same path than theirs.
    fn shuffled(&self, off: f64) -> Option<Meaning> {
        let places: Vec<Vector3<f64>> = self.pairs.iter().filter_map(|pair| self.target(pair.point, 0)).collect();
        let every = self.pairs.len().div_ceil(COMPARED).max(1);
        let nearest =
            |pair: &Pair| places.iter().map(|place| (pair.measured - place).norm()).fold(f64::INFINITY, f64::min);
        let nearest = median(self.pairs.iter().step_by(every).map(nearest).collect());
        (nearest < CLEARLY * off).then(|| Meaning {
            what: "each point lies at another target of the path, so the rows are out of order".to_owned(),
            help: "give each row the target that was measured, in the column `target`".to_owned(),
        })
    }

    /// A fault if a stretch of rows lies apart from the others.
    fn stretch(&self) -> Option<Fault> {
        let middle = self.middle();
        let gaps: Vec<f64> = self.pairs.iter().map(|pair| (self.gap(pair) - middle).norm()).collect();
        let together = median(gaps.iter().copied().filter(|gap| *gap < APART.0).collect());
        let limit = APART.0.max(APART.1 * together);
        let far = |i: usize| gaps[i] > limit;
        let mut from = 0;
        while from < gaps.len() {
            let count = (from..gaps.len()).take_while(|&i| far(i)).count();
            if count >= STRETCH {
                let within = |i: usize| (from..from + count).contains(&i);
                let off = self.off(|v| *v, 0, within);
                let meaning = self.meant(off, &within).unwrap_or_else(|| Meaning {
                    what: "the part or the instrument was moved".to_owned(),
                    help: "give these rows a `run` of their own, or delete them".to_owned(),
                });
                let (first, last) = (self.pairs[from].row.line, self.pairs[from + count - 1].row.line);
                let what = meaning.what;
                let message = format!(
                    "lines {first} to {last} lie {off:.1} mm from their targets, and the other lines do not: {what}"
                );
                return Some(Fault { line: first, message, help: meaning.help });
            }
            from += count.max(1);
        }
        None
    }

    /// A fault if successive rows repeat one reading although their targets are apart.
    fn stuck(&self) -> Option<Fault> {
        /// Distance of targets from which on their readings must differ, mm.
        const APART_MM: f64 = 1.0;
        let same = |a: &Pair, b: &Pair| {
            let (a_target, b_target) = (self.target(a.point, 0), self.target(b.point, 0));
            let apart = a_target.zip(b_target).is_some_and(|(a, b)| (a - b).norm() > APART_MM);
            apart && a.measured == b.measured
        };
        let rows = self.pairs.chunk_by(same).find(|rows| rows.len() >= 3)?;
        let (from, to) = (rows.first()?.row.line, rows.last()?.row.line);
        let message = format!(
            "lines {from} to {to} have the same reading at different targets: the instrument repeated its last value"
        );
        Some(Fault { line: from, message, help: "delete these rows".to_owned() })
    }
}

/// A fault if two rows of one target repeat each other number by number. Rows without a time count only if most of the
/// repeated targets have such rows.
fn doubled(taken: &[MatchedRow]) -> Option<Fault> {
    let mut order: Vec<&MatchedRow> = taken.iter().collect();
    order.sort_by_key(|(point, row, _)| (*point, row.line));
    let again = || order.windows(2).filter(|rows| rows[0].0 == rows[1].0);
    let same = |rows: &&[&MatchedRow]| {
        let (a, b) = (rows[0].1, rows[1].1);
        let numbers = |row: &MeasuredRow| (row.axes_mm, row.normal_mm, row.distance_mm);
        numbers(a) == numbers(b) && (a.force_n, a.time_s, &a.run) == (b.force_n, b.time_s, &b.run)
    };
    let found = again().find(same)?;
    let timed = found[0].1.time_s.is_some();
    // Coarse readings of a target that was measured twice can be equal.
    let is_copied = timed || 2 * again().filter(same).count() > again().count();
    let others = again().filter(same).count() - 1;
    let also = if others > 0 { format!("; {others} more rows repeat another one") } else { String::new() };
    is_copied.then(|| Fault {
        line: found[1].1.line,
        message: format!("the row repeats line {} number by number{also}", found[0].1.line),
        help: "delete the rows that are there twice, or export the table again".to_owned(),
    })
}

/// The step of which all readings are multiples, mm; `None` if it is too fine to be seen.
pub(super) fn steps_mm<'a>(rows: impl Iterator<Item = &'a MeasuredRow> + Clone) -> Option<f64> {
    const STEPS_MM: [f64; 8] = [1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005];
    /// Tolerance for rounding, in steps.
    const ROUNDING: f64 = 1e-6;
    let readings =
        || rows.clone().flat_map(|row| row.axes_mm.into_iter().chain([row.normal_mm, row.distance_mm]).flatten());
    let whole = |step: &f64| readings().all(|reading| (reading / step - (reading / step).round()).abs() < ROUNDING);
    STEPS_MM.into_iter().find(whole)
}

impl Engine {
    /// Refuses residuals of the declared cell that no robot has. Returns a sentence for the advice if the forces look
    /// wrong, but not certainly.
    pub(super) fn check_plausibility(&self, before: &DVector<f64>) -> Result<Option<Advice>, Vec<Diagnostic>> {
        let noise_mm = row_to_row_mm(&self.problem, before);
        if noise_mm > MOST_NOISE_MM {
            let message = format!(
                "the rows scatter by {noise_mm:.2} mm per axis from one row to the next, more than any robot does"
            );
            let help = "check the unit, the instrument, and whether the rows belong to this program";
            return Err(vec![Diagnostic::error("identify.noise", "", message).help(help)]);
        }
        let mut unloaded = self.problem.residual_under(&self.declared, |_, _| Vector3::zeros());
        let mut bent = &unloaded - before;
        // Under a constant load another position of the part looks like a spring that yields more. Forces that look
        // wrong are therefore only a suspicion, unless they also look wrong after the means are subtracted.
        let possible = self.misread_forces(&unloaded, &bent);
        self.problem.without_means(&mut unloaded);
        self.problem.without_means(&mut bent);
        let bends_as_if = |what: &str| format!("the arm bends as if the forces of the table {what}");
        if let Some((what, help)) = self.misread_forces(&unloaded, &bent) {
            return Err(vec![Diagnostic::error("identify.forces", "", bends_as_if(what)).help(help)]);
        }
        Ok(possible.map(|(what, help)| {
            format!("{}, or the part lies elsewhere than declared. If the forces are wrong: {help}. A row measured in air would decide", bends_as_if(what))
        }))
    }

    /// What the forces of the table are if they are clearly not the forces on the tool in newtons, and how to correct
    /// them. `unloaded` is the residual without forces, and `bent` the change of the prediction by the forces, both mm.
    fn misread_forces(&self, unloaded: &DVector<f64>, bent: &DVector<f64>) -> Option<(&'static str, &'static str)> {
        const UNITS: [(f64, &str); 4] = [
            (1e3, "were kilonewtons"),
            (9.806_65, "were kilograms or decanewtons"),
            (4.448, "were pounds"),
            (1e-3, "were millinewtons"),
        ];
        /// Largest relative difference between a factor and that of a unit.
        const CLOSE: f64 = 0.2;
        /// Smallest share of the residual that the forces must explain.
        const MOST_OF_IT: f64 = 0.8;
        /// Share of the residual below which the change by the forces is only rounding.
        const ROUNDING: f64 = 1e-6;
        /// Factor below which the sign of the forces is wrong: no spring yields against its load, and noise does not
        /// make the factor so negative.
        const AGAINST: f64 = -0.3;
        self.declared.stiffness?;
        let (both, own) = (unloaded.dot(bent), bent.norm_squared());
        let (factor, share) = (both / own, both * both / (own * unloaded.norm_squared()));
        // Forces that follow from a law are no readings. They act in both residuals, so that only rounding is left of
        // them here.
        if share.is_nan() || share < MOST_OF_IT || own.sqrt() < ROUNDING * unloaded.norm() {
            return None;
        }
        if factor < AGAINST {
            return Some((
                "had the opposite sign",
                "fx_n, fy_n, fz_n act on the tool: turn their signs, unless those of the measured errors are wrong",
            ));
        }
        let unit = UNITS.iter().find(|(unit, _)| (factor / unit - 1.0).abs() < CLOSE);
        unit.map(|(_, words)| (*words, "fx_n, fy_n, fz_n are newtons: convert them"))
    }
}

/// Standard deviation of the white noise of all axes, mm, from the second differences of successive rows.
fn row_to_row_mm(problem: &Problem, residual: &DVector<f64>) -> f64 {
    let mut sizes = Vec::new();
    for series in problem.series(|_| true) {
        let at = |k: usize| residual[series.samples[k].0] / series.samples[k].2;
        let seconds = (2..series.samples.len()).map(|k| at(k) - 2.0 * at(k - 1) + at(k - 2));
        sizes.extend(seconds.map(f64::abs));
    }
    // The variance of second differences of white noise is six times that of the noise.
    TO_SIGMA * median(sizes) / 6f64.sqrt()
}
