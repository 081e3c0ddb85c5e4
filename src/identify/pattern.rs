//! What no effect of the cell describes: where each run is clamped, faults of the measurement, and patterns that stand
//! for anything unlisted.

use super::data::{Observation, Parts, Problem};
use super::seen::Seen;
use crate::equilibrium::Arm;
use nalgebra::{DVector, Matrix3, Vector3};

/// Something that measured rows may follow and that is never written to a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pattern {
    /// Each run's part is clamped anew: a small shift and turn a run.
    Clamping,
    /// The instrument drifts: each run's positions follow its time.
    Drift {
        /// How it bends: coming to rest with this of [`SETTLES`], or as a parabola.
        settles: Option<usize>,
    },
    /// Something slips: from this row of a run on positions are shifted.
    Jump {
        /// Index of the run.
        run: usize,
        /// First row after it.
        order: usize,
        /// What slips.
        slips: Slips,
    },
    /// The columns of the force are mixed up, as [`MIXED`] has it.
    MixedForce(usize),
    /// Each axis of the force sensor shows something of the others.
    Crosstalk,
    /// Forces stand in the rows so many before or after those in which they acted.
    LateForce(isize),
    /// One joint's angle.
    Joint(usize),
    /// Time, however it goes.
    Time,
    /// The force, not as a spring does.
    Force,
    /// The directions in which the axes travel.
    Direction,
}

/// What slips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slips {
    /// The part as a whole, or the instrument.
    All,
    /// A clamp of the part, by its index: the others hold the part, which is strained. What a clamp gives way by goes back with the
    /// force; this does not.
    Clamp(usize),
}

/// What follows from a pattern in a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// It is always to be expected, and taken off before errors are counted.
    Nuisance,
    /// Something is wrong with the measurement, and it can be said what.
    Fault,
    /// Something acts that no listed effect explains.
    Unlisted,
}

/// How the columns of a force may be mixed up: in words, and what is really there of what was read.
pub(super) const MIXED: [(&str, [[f64; 3]; 3]); 9] = [
    ("fx_n with its sign turned", [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    ("fy_n with its sign turned", [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]),
    ("fz_n with its sign turned", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]),
    ("fx_n, fy_n, fz_n with their signs turned", [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]),
    ("fx_n and fy_n swapped", [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    ("fy_n and fz_n swapped", [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
    ("fx_n and fz_n swapped", [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    ("fx_n, fy_n, fz_n in the order y, z, x", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    ("fx_n, fy_n, fz_n in the order z, x, y", [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
];

/// What a set has where a clamp of the part slipped.
pub(super) const CLAMP_SLIP: &str = "clamp_slip";

/// Orders of the waves that stand for any function of a joint's angle.
const ORDERS: [f64; 5] = [1.0, 2.0, 3.0, 5.0, 8.0];
/// Waves that stand for any function of time.
const WAVES: usize = 14;
/// Numbers of a clamping: three shifts, three turns.
const CLAMPING: usize = 6;
/// Functions of time that a drift is made of: straight, and bent.
const DRIFTS: usize = 2;
/// Time constants with which a drift comes to rest, as shares of the run's length.
pub(super) const SETTLES: [f64; 4] = [0.1, 0.2, 0.4, 0.8];
/// Products of a force's components, first and second order.
const PRODUCTS: usize = 9;
/// Pairs of different axes.
const PAIRS: usize = 6;
/// Sizes that are looked for, mm: of a drift, a jump, and of whatever is unlisted.
pub(super) const TYPICAL_MM: f64 = 0.05;
/// Sizes of a clamping, mm and rad: what a stop and a probe leave.
const CLAMPED: (f64, f64) = (0.2, 4e-4);
/// How far the share of forces that are mixed up may be from one: the arm yields otherwise than declared, and no force is
/// mixed up by halves, which would stand for any factor of it.
pub(super) const MIXED_SPREAD: f64 = 0.15;
/// How far the joints' springs may be from what is declared, where forces are mixed up: their effects are columns under the
/// forces as they were read.
const SPRINGS: f64 = 0.3;
/// Springs of an arm.
const JOINTS: usize = 6;
/// What a force sensor's axis shows of another.
const CROSSTALK: f64 = 0.15;

impl Pattern {
    pub(super) fn standing(self) -> Standing {
        match self {
            Self::Clamping => Standing::Nuisance,
            Self::Drift { .. } | Self::Jump { .. } | Self::MixedForce(_) | Self::Crosstalk | Self::LateForce(_) => {
                Standing::Fault
            }
            Self::Joint(_) | Self::Time | Self::Force | Self::Direction => Standing::Unlisted,
        }
    }

    /// Whether the forces of the table cannot be right.
    pub(super) fn is_of_force(self) -> bool {
        matches!(self, Self::MixedForce(_) | Self::Crosstalk | Self::LateForce(_))
    }

    /// What stands where a set has the names of those that could be meant.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Clamping => "clamping",
            Self::Drift { .. } => "instrument_drift",
            Self::Jump { slips: Slips::All, .. } => "fixture_slip",
            Self::Jump { slips: Slips::Clamp(_), .. } => CLAMP_SLIP,
            Self::MixedForce(_) | Self::Crosstalk | Self::LateForce(_) => "force_readings",
            Self::Joint(_) | Self::Time | Self::Force | Self::Direction => "",
        }
    }

    /// Of patterns of one family a set has one.
    pub(super) fn family(self) -> String {
        match self {
            Self::MixedForce(_) | Self::Crosstalk | Self::LateForce(_) => "force readings".to_owned(),
            Self::Drift { .. } => "drift".to_owned(),
            _ => format!("pattern {self:?}"),
        }
    }

    /// What the remainder follows, in words.
    pub(super) fn words(self, problem: &Problem) -> String {
        let of_run = |run: usize| if problem.runs.len() > 1 { format!(" of run {}", run + 1) } else { String::new() };
        match self {
            Self::Clamping => "where each run is clamped".to_owned(),
            Self::Drift { .. } => "time, as a drifting instrument or a warming robot does".to_owned(),
            Self::Jump { run, order, slips } => {
                let line =
                    problem.rows.iter().find(|row| row.run == run && row.order >= order).map_or(0, |row| row.line);
                match slips {
                    Slips::All => format!("a jump at line {line}{}: the part or the instrument slipped", of_run(run)),
                    Slips::Clamp(clamp) if order == 0 => {
                        format!("a strain of the part{}: clamp {} slipped before line {line}", of_run(run), clamp + 1)
                    }
                    Slips::Clamp(clamp) => {
                        format!(
                            "a strain of the part from line {line} on{}: clamp {} slipped there",
                            of_run(run),
                            clamp + 1
                        )
                    }
                }
            }
            Self::MixedForce(which) => {
                format!("the force, if {} are meant", MIXED[which].0).replace("turned are", "turned is")
            }
            Self::Crosstalk => "the force, if each axis of the sensor shows something of the others".to_owned(),
            Self::LateForce(by) if by > 0 => "the force, if each row has that of the row before it".to_owned(),
            Self::LateForce(_) => "the force, if each row has that of the row after it".to_owned(),
            Self::Joint(joint) => format!("sin(k·q{0}), cos(k·q{0})", joint + 1),
            Self::Time => "time".to_owned(),
            Self::Force => "cutting force".to_owned(),
            Self::Direction => "direction of travel".to_owned(),
        }
    }

    pub(super) fn size(self, problem: &Problem) -> usize {
        match self {
            Self::Clamping => CLAMPING * problem.runs.len(),
            Self::Drift { .. } => 3 * DRIFTS * problem.runs.len(),
            Self::Jump { .. } => 3,
            Self::MixedForce(_) => 1 + JOINTS,
            Self::LateForce(_) => 1,
            Self::Crosstalk => PAIRS,
            Self::Joint(_) => 3 * 2 * ORDERS.len(),
            Self::Time => 3 * WAVES,
            Self::Force => 3 * PRODUCTS,
            Self::Direction => 3 * 6,
        }
    }

    /// What the prior of number `k` is about: columns that are mixed up are so once, and not by halves.
    pub(super) fn expected(self, k: usize) -> f64 {
        if k == 0 && matches!(self, Self::MixedForce(_) | Self::LateForce(_)) { 1.0 } else { 0.0 }
    }
}

/// What a pattern's columns are made with.
pub(super) struct About<'a> {
    pub(super) problem: &'a Problem,
    pub(super) arm: &'a Arm,
    /// Its residual.
    pub(super) base: &'a DVector<f64>,
}

/// The columns of a pattern: what it adds to the residual, mm per prior size.
pub(super) fn columns(about: &About, pattern: Pattern) -> Vec<DVector<f64>> {
    let problem = about.problem;
    let with_forces = |force: &(dyn Fn(usize, Vector3<f64>) -> Vector3<f64> + Sync)| {
        let moved = problem.residual_under(about.arm, force);
        let mut column = about.base - moved;
        column.iter_mut().for_each(|v| *v = if v.is_finite() { *v } else { 0.0 });
        column
    };
    match pattern {
        Pattern::MixedForce(which) => {
            let rows = MIXED[which].1;
            let matrix = Matrix3::from_fn(|i, j| rows[i][j]);
            let springs = (0..JOINTS).map(|joint| yielding(about, joint, &matrix));
            std::iter::once(with_forces(&|_, force| matrix * force)).chain(springs).collect()
        }
        Pattern::Crosstalk => {
            let pairs = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];
            let of = |(to, from): (usize, usize)| {
                let mut matrix = Matrix3::identity();
                matrix[(to, from)] = CROSSTALK;
                with_forces(&|_, force| matrix * force)
            };
            pairs.map(of).into()
        }
        Pattern::LateForce(by) => {
            // What acted stands so many rows further on.
            let acted = |i: usize, read: Vector3<f64>| {
                let row = |i: usize| problem.rows.get(i).filter(|other| other.run == problem.rows[i].run);
                i.checked_add_signed(by).and_then(row).map_or(read, |row| problem.force(row))
            };
            vec![with_forces(&acted)]
        }
        _ => shifts(problem, pattern),
    }
}

/// What a joint's spring that yields by [`SPRINGS`] more than declared adds under forces that are mixed up, mm per prior size.
fn yielding(about: &About, joint: usize, mixed: &Matrix3<f64>) -> DVector<f64> {
    let problem = about.problem;
    let (robot, stiffness) = (&about.arm.robot, about.arm.stiffness.map_or(f64::INFINITY, |k| k[joint]));
    let of = |row: &Observation| {
        let run = &problem.runs[row.run];
        let base_from_wobj = run.base_from_wobj(row.point);
        let tcp = base_from_wobj.transform_point(&run.points[row.point].reference.translation.vector.into()).coords;
        let jacobian = robot.jacobian(&robot.frames(&row.motor), &tcp);
        let lever = base_from_wobj.rotation.inverse() * jacobian.fixed_view::<3, 1>(0, joint);
        let turn = lever.dot(&(mixed * problem.force(row))) / stiffness;
        project(problem, row, lever * (1e3 * turn * SPRINGS / MIXED_SPREAD))
    };
    problem.stacked(problem.rows.iter().map(of))
}

/// The columns of a pattern that shifts what is measured.
pub(super) fn shifts(problem: &Problem, pattern: Pattern) -> Vec<DVector<f64>> {
    let spans: Vec<Span> = (0..problem.runs.len()).map(|run| Span::of(problem, run)).collect();
    let force_size = problem.rows.iter().map(|row| problem.force(row).norm()).fold(1.0, f64::max);
    let size = pattern.size(problem);
    let of_column = |index: usize| {
        let of = |row: &Observation| project(problem, row, shift(problem, pattern, index, row, &spans, force_size));
        problem.stacked(problem.rows.iter().map(of))
    };
    (0..size).map(of_column).collect()
}

/// When and where a run was measured.
struct Span {
    from: f64,
    to: f64,
    centre_mm: Vector3<f64>,
}

impl Span {
    fn of(problem: &Problem, run: usize) -> Self {
        let mut span = Self { from: f64::INFINITY, to: f64::NEG_INFINITY, centre_mm: Vector3::zeros() };
        let mut count = 0.0;
        for row in problem.rows.iter().filter(|row| row.run == run) {
            let point = &problem.runs[run].points[row.point];
            (span.from, span.to) = (span.from.min(point.time), span.to.max(point.time));
            span.centre_mm += 1e3 * point.reference.translation.vector;
            count += 1.0;
        }
        span.centre_mm /= f64::max(count, 1.0);
        span
    }

    /// 0 to 1.
    fn along(&self, time: f64) -> f64 {
        ((time - self.from) / (self.to - self.from).max(1e-9)).clamp(0.0, 1.0)
    }
}

/// What number `index` of a pattern shifts a row by, work object axes, mm per prior size.
fn shift(
    problem: &Problem,
    pattern: Pattern,
    index: usize,
    row: &Observation,
    spans: &[Span],
    force_size: f64,
) -> Vector3<f64> {
    use std::f64::consts::PI;
    let point = &problem.runs[row.run].points[row.point];
    let along = spans[row.run].along(point.time);
    // Functions of the row, each along the three axes.
    let (which, axis) = (index / 3, Vector3::ith(index % 3, TYPICAL_MM));
    let value = match pattern {
        Pattern::Clamping if row.run != index / CLAMPING => 0.0,
        Pattern::Clamping => {
            let unit = Vector3::ith(index % 3, 1.0);
            if index % CLAMPING < 3 {
                return CLAMPED.0 * unit;
            }
            let place = 1e3 * point.reference.translation.vector - spans[row.run].centre_mm;
            return CLAMPED.1 * unit.cross(&place);
        }
        Pattern::Drift { .. } if row.run != which / DRIFTS => 0.0,
        Pattern::Drift { .. } if which % DRIFTS == 0 => along,
        Pattern::Drift { settles: None } => 2.0 * along * (1.0 - along),
        Pattern::Drift { settles: Some(n) } => 1.0 - (-along / SETTLES[n]).exp(),
        Pattern::Jump { run, order, .. } if row.run != run || row.order < order => 0.0,
        Pattern::Jump { slips: Slips::Clamp(clamp), .. } => {
            // The part goes with its clamp, and the tip seen from the part the other way.
            let place = point.clamp_motion(clamp, index).unwrap_or_else(Vector3::zeros);
            return -TYPICAL_MM * place;
        }
        Pattern::Jump { .. } => 1.0,
        Pattern::Joint(joint) => {
            let angle = ORDERS[which / 2] * row.motor[joint];
            if which.is_multiple_of(2) { angle.cos() } else { angle.sin() }
        }
        Pattern::Time => (PI * (which + 1) as f64 * along).cos(),
        Pattern::Force => {
            let f = problem.force(row) / force_size;
            [f.x, f.y, f.z, f.x * f.x, f.y * f.y, f.z * f.z, f.x * f.y, f.y * f.z, f.x * f.z][which]
        }
        Pattern::Direction => row.travel[which],
        Pattern::MixedForce(_) | Pattern::Crosstalk | Pattern::LateForce(_) => 0.0,
    };
    value * axis
}

/// What a row's instrument shows of a shift, work object axes, mm.
fn project(problem: &Problem, row: &Observation, shift: Vector3<f64>) -> Parts {
    let shown = match row.seen {
        Seen::Position(_) => shift.into(),
        Seen::Normal(_) => [shift.dot(&problem.runs[row.run].points[row.point].normal), 0.0, 0.0],
        Seen::Distance(_) => [shift.x, 0.0, 0.0],
    };
    [shown, [0.0; 3]]
}
