use super::point::Point;
use super::{KeptCount, KeptReason, PathDeviation};
use deflex_equilibrium::PredictedPose;
use deflex_program::{Editable, Goal, Target, UnknownMotion};
use deflex_robot::External;
use nalgebra::Vector3;
use serde::Serialize;
use std::sync::Arc;

/// The result of a target.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// use deflex_correct::Status;
///
/// assert!(corrected.rows.iter().all(|row| row.status == Status::Ok)); // every target cuts
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Status {
    /// A cutting force acts; the target is corrected if the run corrects.
    Ok,
    /// No cutting force.
    #[default]
    Air,
    /// Not changed, for this reason.
    Kept(KeptReason),
}

/// Names that many rows share, as the program has them.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// let names = corrected.rows[0].names.as_ref().expect("names of tool and work object");
/// println!("{} in {}", names.tool, names.wobj);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RowNames {
    /// File of the motion.
    pub file: Arc<str>,
    /// Tool.
    pub tool: Arc<str>,
    /// Work object.
    pub wobj: Arc<str>,
}

/// One row of the report: a target, its predicted error, its correction and what remains.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// let row = &corrected.rows[10];
/// println!("line {}: error {:?} mm, correction {:?} mm", row.line, row.error_mm, row.correction_mm);
/// assert!(row.is_solved() && row.reason() == ""); // it is not kept
/// assert!((row.error_norm_mm() - 0.14).abs() < 0.01 && row.correction_norm_mm() > 0.0);
/// assert!(row.remaining_norm_mm() < 1e-4 && row.remaining_path_mm().is_some_and(|mm| mm < 0.001));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Ordinal of the motion, from 1.
    pub target: u32,
    /// Line of the instruction.
    pub line: u32,
    /// Name of the declared robtarget.
    pub name: Option<Arc<str>>,
    /// The result.
    pub status: Status,
    /// Programmed position, work object axes, mm.
    pub position_mm: [f64; 3],
    /// Predicted error without correction, work object axes, mm.
    pub error_mm: [f64; 3],
    /// Its rotation vector, degrees.
    pub error_deg: [f64; 3],
    /// The error along the surface normal at the contact point, positive out of the material, mm.
    pub error_normal_mm: f64,
    /// Commanded minus programmed, mm.
    pub correction_mm: [f64; 3],
    /// Its rotation vector, degrees.
    pub correction_deg: [f64; 3],
    /// Whether the target cuts nothing and changes with the numbers that it shares with a motion that cuts.
    pub goes_along: bool,
    /// Whether the motion cuts nothing in a cell with a cutting force, and is no farther from its original than a correction may be. Its error
    /// leaves no mark on the part.
    pub is_through_air: bool,
    /// Error that remains, predicted from the numbers as written by the forward model, work object axes, mm.
    pub remaining_mm: [f64; 3],
    /// Force on the tool, work object axes, N.
    pub force_n: [f64; 3],
    /// Standard uncertainty of the predicted error, per axis, mm.
    pub sigma_mm: Option<f64>,
    /// The remaining error on the segment to the target, by the forward model on the numbers as written. `None` if it is unknown: the target
    /// is not solved, or the segment has a point without an equilibrium.
    pub path: Option<PathDeviation>,
    /// Axial depth of the cutter in the stock, mm; `Some` if the engagement follows from a stock.
    pub depth_mm: Option<f64>,
    /// Arc of engagement at half that depth, degrees.
    pub engaged_deg: Option<f64>,
    /// Volume removed on the segment to the target, mm³.
    pub removed_mm3: Option<f64>,
    /// Turn about the tool axis, from the work object's x axis seen along the tool, degrees; `Some` if it was chosen.
    pub spin_deg: Option<f64>,
    /// Commanded axis angles as the pendant shows them, degrees: those of the corrected numbers if the target is corrected. `None` if the
    /// target is not solved.
    pub joints_deg: Option<[f64; 6]>,
    /// Programmed speed of the TCP, mm/s; `None` if the text does not state it.
    pub feed_mm_s: Option<f64>,
    /// Displacement of the part under the force at the uncorrected target, mm: its share of the predicted error. `None` if no effect
    /// describes how the part yields.
    pub error_part_mm: Option<f64>,
    /// Names of file, tool and work object.
    pub names: Option<Arc<RowNames>>,
    /// Stiffness of the TCP; `Some` with [`Options::stiffness`](super::Options::stiffness).
    pub stiffness: Option<Stiffness>,
    /// Posture of the arm; `Some` with [`Options::stance`](super::Options::stance).
    pub stance: Option<Arc<Stance>>,
}

/// The posture of the arm at a target, as programmed.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// use deflex_correct::{Options, compensate};
///
/// let rows = compensate(&program, &cell, &Options { stance: true, ..Options::default() })?.rows;
/// let stance = rows[0].stance.as_ref().expect("a target that is solved");
/// println!("{:.1} degrees from the nearest limit", stance.limit_margin_deg);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Stance {
    /// Axes as the controller counts them, degrees.
    pub axes_deg: [f64; 6],
    /// Distance from the nearest axis limit, degrees; negative beyond it.
    pub limit_margin_deg: f64,
    /// Distance of axis 5 from where axes 4 and 6 line up, degrees.
    pub singular_margin_deg: f64,
    /// The base in the work object: position, mm, and rotation vector, degrees.
    pub base: [f64; 6],
    /// External axes, mm or degrees; NaN where one is not in use.
    pub external: External,
    /// The unit that carries the work object, in the work object: a point of its axis, mm, and the direction of the axis.
    pub table: Option<[f64; 6]>,
    /// Circle point of the arc that leads to the target, work object axes, mm.
    pub circle_point: Option<[f64; 3]>,
}

/// Stiffness of the TCP against a force on the tool, N/mm, at the force that acts there.
///
/// C is the derivative of the TCP's position in the work object with respect to that force, through every effect of the cell.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// use deflex_correct::{Options, compensate};
///
/// let rows = compensate(&program, &cell, &Options { stiffness: true, ..Options::default() })?.rows;
/// let stiffness = rows[0].stiffness.expect("a target that is solved");
/// assert!(stiffness.least_n_per_mm < stiffness.most_n_per_mm);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness {
    /// Along the surface normal n: 1/(nᵀCn).
    pub normal_n_per_mm: f64,
    /// In the softest direction: 1 over the largest eigenvalue of C's symmetric part.
    pub least_n_per_mm: f64,
    /// In the stiffest direction: 1 over the smallest one.
    pub most_n_per_mm: f64,
}

impl Row {
    /// Size of the predicted error, mm.
    #[must_use]
    pub fn error_norm_mm(&self) -> f64 {
        Vector3::from(self.error_mm).norm()
    }

    /// Size of the correction, mm.
    #[must_use]
    pub fn correction_norm_mm(&self) -> f64 {
        Vector3::from(self.correction_mm).norm()
    }

    /// Size of the error that remains, mm.
    #[must_use]
    pub fn remaining_norm_mm(&self) -> f64 {
        Vector3::from(self.remaining_mm).norm()
    }

    /// Largest distance of the tip from the programmed path on the segment to the target, mm.
    #[must_use]
    pub fn remaining_path_mm(&self) -> Option<f64> {
        self.path.map(|path| path.max_mm)
    }

    /// Whether a cutting force acts.
    fn cuts(&self) -> bool {
        self.status == Status::Ok || self.force_n.iter().any(|force| force.abs() > 0.0)
    }

    /// The row of a target that is kept because its pose is unknown.
    pub(super) fn unsolved(target: &Target, why: KeptReason) -> Self {
        let position_mm = match target.goal {
            Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => position_mm,
            Goal::Joints { .. } => [f64::NAN; 3],
        };
        Self {
            name: target.name.clone(),
            position_mm,
            feed_mm_s: target.feed_mm_s,
            ..Self::without_errors(target.ordinal, target.line, why)
        }
    }

    /// The row of a motion whose target is known only at run time.
    pub(super) fn unknown(motion: &UnknownMotion) -> Self {
        Self::without_errors(motion.ordinal, motion.line, motion.reason.into())
    }

    /// The row of a target that is kept for a reason: its position and its errors are unknown (NaN).
    fn without_errors(target: u32, line: u32, why: KeptReason) -> Self {
        let none = [f64::NAN; 3];
        Self {
            target,
            line,
            status: Status::Kept(why),
            position_mm: none,
            error_mm: none,
            error_deg: none,
            error_normal_mm: f64::NAN,
            remaining_mm: none,
            force_n: none,
            ..Self::default()
        }
    }

    /// Why the target is kept or not judged; empty for others.
    #[must_use]
    pub fn reason(&self) -> &'static str {
        if let Status::Kept(reason) = self.status { reason.text() } else { "" }
    }

    /// Whether its numbers changed by more than the rounding of printing.
    #[must_use]
    pub(crate) fn is_corrected(&self) -> bool {
        MOVED.exceeds(self.correction_mm, self.error_mm) || TURNED.exceeds(self.correction_deg, self.error_deg)
    }

    /// Whether its errors are known: the target was solved.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        !self.error_normal_mm.is_nan()
    }

    /// Fills a blank row with the predicted error and without a correction.
    pub(super) fn fill(&mut self, target: &Target, point: &Point, there: &PredictedPose, error_normal: f64) {
        let error_mm = (1e3 * there.shift).into();
        self.target = target.ordinal;
        self.line = target.line;
        self.name.clone_from(&target.name);
        self.status = match target.editable {
            Editable::No(reason) => Status::Kept(reason.into()),
            _ if point.cuts() => Status::Ok,
            _ => Status::Air,
        };
        self.position_mm = (point.wobj_from_tcp.translation.vector * 1e3).into();
        self.error_mm = error_mm;
        self.error_deg = there.turn.map(f64::to_degrees).into();
        self.error_normal_mm = 1e3 * error_normal;
        self.remaining_mm = error_mm;
        self.force_n = there.cut.into();
        self.feed_mm_s = target.feed_mm_s;
        self.error_part_mm = there.part.map(|part| 1e3 * part);
        if let Some(milled) = &point.milled {
            self.depth_mm = milled.engaged.map(|[depth, _]| 1e3 * depth);
            self.engaged_deg = milled.engaged.map(|[_, arc]| arc.to_degrees());
            self.removed_mm3 = Some(1e9 * milled.removed);
        }
    }
}

/// Counts and sizes over a program, for the summary. `targets` is the sum of `corrected`, `unchanged`, `air`, `inserted` and the kept
/// targets.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// let summary = deflex_correct::Summary::of(&corrected.rows);
/// assert_eq!(summary.targets, summary.corrected + summary.unchanged + summary.air);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// Executed motions, including inserted ones.
    pub targets: usize,
    /// Targets whose numbers changed.
    pub corrected: usize,
    /// Targets that cut, may change, and whose numbers did not change; in a prediction, all that cut.
    pub unchanged: usize,
    /// Targets without cutting force whose numbers did not change, or changed with the numbers of others.
    pub air: usize,
    /// Those of `air` that share numbers with motions that cut, and go where these numbers lead them.
    pub along: usize,
    /// Targets that `--subdivide` inserted.
    pub inserted: usize,
    /// Kept targets by reason, in the order of first occurrence.
    pub kept: Vec<KeptCount>,
    /// Kept targets that were not judged because their pose is unknown, by reason.
    pub unjudged: Vec<KeptCount>,
    /// Largest predicted error without correction, mm.
    pub max_error_mm: f64,
    /// Root mean square of the predicted error over targets that cut, including kept ones, mm; over all if none cuts.
    pub rms_error_mm: f64,
    /// Largest correction, mm.
    pub max_correction_mm: f64,
    /// Largest distance to which `along` targets go from their programmed positions, mm.
    pub max_along_mm: f64,
    /// Largest remaining error of a target that cuts and is not kept, mm.
    pub max_remaining_mm: f64,
    /// Largest error of a kept target, which remains, mm.
    pub max_kept_mm: f64,
    /// Largest distance of the tip from the programmed path on segments to targets that cut, mm; to all if none cuts.
    pub remaining_path_max_mm: f64,
    /// Root mean square of that distance over their length, mm.
    pub remaining_path_rms_mm: f64,
    /// Number of targets whose segment could not be judged.
    #[serde(skip)]
    pub paths_unknown: usize,
    /// Largest standard uncertainty of a predicted error, for each axis, mm; 0 if the cell states no covariance.
    #[serde(skip)]
    pub max_sigma_mm: f64,
}

impl Summary {
    /// Counts rows.
    #[must_use]
    pub fn of(rows: &[Row]) -> Self {
        let mut tally = Tally::default();
        tally.add(rows);
        tally.summary()
    }

    /// The same with targets that were inserted.
    #[must_use]
    #[doc(hidden)]
    pub fn with_inserted(self, inserted: usize) -> Self {
        Self { targets: self.targets + inserted, inserted: self.inserted + inserted, ..self }
    }
}

/// Counts a reason, in the order of first occurrence.
fn count_in(counts: &mut Vec<KeptCount>, reason: KeptReason) {
    match counts.iter_mut().find(|known| known.reason == reason) {
        Some(known) => known.count += 1,
        None => counts.push(KeptCount { reason, count: 1 }),
    }
}

/// By how much printing changes a number of a target.
struct Rounding {
    /// Largest change in a language that prints many decimals.
    fine: f64,
    /// Largest change in a language that prints three decimals.
    coarse: f64,
}

/// Fine: four decimals of a millimetre in single precision. Coarse: half of the last of three decimals in x, y and z.
const MOVED: Rounding = Rounding { fine: 0.9e-4, coarse: 0.9e-3 };
/// Fine: eight decimals of a quaternion. Coarse: half of the last of three decimals in each of three angles.
const TURNED: Rounding = Rounding { fine: 2e-5, coarse: 0.9e-3 };

impl Rounding {
    /// Whether a correction is more than rounding. A posted program prints each number anew, so a small correction that
    /// is more than twice the error is rounding: it moves the target away by more than it corrects.
    fn exceeds(&self, correction: [f64; 3], error: [f64; 3]) -> bool {
        let (size, needed) = (Vector3::from(correction).norm(), Vector3::from(error).norm());
        size > self.coarse || size > self.fine && size <= 2.0 * needed
    }
}

/// Collects a [`Summary`] row by row in running order.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    /// Counts; sizes are computed at the end.
    sum: Summary,
    most: Most,
    cutting: MeanSquare,
    all: MeanSquare,
    /// Deviations on segments to targets that cut, and to all.
    cutting_path: PathDeviation,
    path: PathDeviation,
}

/// Squares of the largest sizes, mm².
#[derive(Clone, Copy, Debug, Default)]
struct Most {
    error: f64,
    correction: f64,
    along: f64,
    remaining: f64,
    kept: f64,
}

/// Collects a root mean square.
#[derive(Clone, Copy, Debug, Default)]
struct MeanSquare {
    sum: f64,
    count: usize,
}

impl MeanSquare {
    fn add(&mut self, square: f64) {
        self.sum += square;
        self.count += 1;
    }

    fn root(self) -> f64 {
        if self.count > 0 { (self.sum / self.count as f64).sqrt() } else { 0.0 }
    }
}

impl Tally {
    pub(super) fn add(&mut self, rows: &[Row]) {
        let square = |size: [f64; 3]| Vector3::from(size).norm_squared();
        let (sum, most) = (&mut self.sum, &mut self.most);
        sum.targets += rows.len();
        for row in rows {
            let (error, correction) = (square(row.error_mm), square(row.correction_mm));
            if !row.is_solved() {
                if let Status::Kept(reason) = row.status {
                    count_in(&mut sum.kept, reason);
                    count_in(&mut sum.unjudged, reason);
                }
                continue;
            }
            self.all.add(error);
            sum.max_sigma_mm = sum.max_sigma_mm.max(row.sigma_mm.unwrap_or(0.0));
            match row.path {
                Some(path) => {
                    self.path = self.path.and(path);
                    if row.cuts() {
                        self.cutting_path = self.cutting_path.and(path);
                    }
                }
                None => sum.paths_unknown += 1,
            }
            match row.status {
                Status::Ok => {
                    most.remaining = most.remaining.max(square(row.remaining_mm));
                    self.cutting.add(error);
                    *(if row.is_corrected() { &mut sum.corrected } else { &mut sum.unchanged }) += 1;
                }
                Status::Air if row.goes_along => {
                    most.along = most.along.max(correction);
                    (sum.air, sum.along) = (sum.air + 1, sum.along + 1);
                }
                Status::Air => *(if row.is_corrected() { &mut sum.corrected } else { &mut sum.air }) += 1,
                Status::Kept(reason) => {
                    most.kept = most.kept.max(error);
                    if row.cuts() {
                        self.cutting.add(error);
                    }
                    count_in(&mut sum.kept, reason);
                }
            }
            if !row.is_through_air {
                most.error = most.error.max(error);
            }
            most.correction = most.correction.max(correction);
        }
    }

    /// Counts inserted targets.
    pub(super) fn insert(&mut self, inserted: usize) {
        self.sum.targets += inserted;
        self.sum.inserted += inserted;
    }

    pub(super) fn summary(self) -> Summary {
        let cuts = self.cutting.count > 0;
        let (mean, path) = if cuts { (self.cutting, self.cutting_path) } else { (self.all, self.path) };
        Summary {
            max_error_mm: self.most.error.sqrt(),
            rms_error_mm: mean.root(),
            max_correction_mm: self.most.correction.sqrt(),
            max_along_mm: self.most.along.sqrt(),
            max_remaining_mm: self.most.remaining.sqrt(),
            max_kept_mm: self.most.kept.sqrt(),
            remaining_path_max_mm: path.max_mm,
            remaining_path_rms_mm: path.mean_square_mm2.sqrt(),
            ..self.sum
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn row(status: Status, error: f64, force: f64) -> Row {
        Row {
            status,
            error_mm: [0.0, error, 0.0],
            error_normal_mm: error,
            remaining_mm: [0.0, 0.1 * error, 0.0],
            force_n: [force, 0.0, 0.0],
            ..Row::default()
        }
    }

    #[test]
    fn the_mean_is_over_what_cuts_corrected_or_kept() {
        let (ok, air, kept) =
            (row(Status::Ok, 3.0, 9.0), row(Status::Air, 8.0, 0.0), row(Status::Kept(KeptReason::Misfit), 4.0, 9.0));
        let sum = Summary::of(&[ok, air.clone(), kept.clone()]);
        assert_relative_eq!(sum.rms_error_mm, 12.5_f64.sqrt());
        assert_relative_eq!(sum.max_error_mm, 8.0);
        assert_relative_eq!(sum.max_kept_mm, 4.0);
        assert_relative_eq!(Summary::of(&[kept]).rms_error_mm, 4.0);
        // Nothing cuts: the error of the arm in the air is reported all the same.
        assert_relative_eq!(Summary::of(&[air]).rms_error_mm, 8.0);
    }

    /// FANUC and Yaskawa positions have three decimals, so a posted program changes numbers that need no correction.
    #[test]
    fn a_target_that_is_only_rounded_is_not_corrected() {
        let target = |error: f64, correction: f64, turned: f64| {
            let mut row = row(Status::Air, error, 0.0);
            row.correction_mm = [0.0, -correction, 0.0];
            row.correction_deg = [0.0, 0.0, turned];
            row.is_corrected()
        };
        assert!(!target(0.0, 4e-4, 4e-4) && !target(1e-4, 4e-4, 0.0) && !target(0.0, 0.0, 0.0));
        // A correction of the same size for an error, a larger one, and a turn that was chosen.
        assert!(target(4e-4, 4e-4, 0.0) && target(0.2, 0.2, 0.0) && target(0.0, 0.01, 0.0) && target(0.0, 0.0, 5.0));
    }
}
