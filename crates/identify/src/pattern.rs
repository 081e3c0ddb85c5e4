//! Patterns that the rows can follow and that are no effect of a cell: the clamping of each run, faults of the
//! measurement, and errors of effects that are in no list.

use super::data::{Observation, Parts, Problem};
use super::reading::Reading;
use deflex_equilibrium::Arm;
use nalgebra::{DVector, Matrix3, Vector3};

/// A pattern that measured rows can follow. It is never written to a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pattern {
    /// Each run has its own clamping of the part: a small shift and a small turn.
    Clamping,
    /// The instrument drifts: the positions of each run follow its time, linearly and with one further function of
    /// time.
    Drift {
        /// The further function: it settles with this time constant of [`SETTLES`], or is a parabola.
        settles: Option<usize>,
    },
    /// A slip: from one row of a run on the positions are shifted.
    Jump {
        /// Index of the run.
        run: usize,
        /// Order of the first row after the slip.
        order: usize,
        /// The thing that slips.
        slips: Slips,
    },
    /// The columns of the force are in another order or have other signs, as in this entry of [`MIXED`].
    MixedForce(usize),
    /// Each axis of the force sensor reads a part of the other axes.
    Crosstalk,
    /// The forces are shifted: each row has the force that acted so many rows before it.
    LateForce(isize),
    /// A function of the angle of one joint.
    Joint(usize),
    /// A smooth function of time.
    Time,
    /// A function of the force that differs from that of a spring.
    Force,
    /// The directions in which the axes travel.
    Direction,
}

/// The thing that slips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slips {
    /// The part as a whole, or the instrument.
    All,
    /// The clamp of the part with this index. The other clamps hold the part, so that it is strained. Unlike the motion
    /// of a compliant clamp, a slip remains when the force ends.
    Clamp(usize),
}

/// The consequence of a pattern in the chosen set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Consequence {
    /// The pattern is always expected, and is subtracted before errors are computed.
    Nuisance,
    /// The measurement has the fault that the pattern names.
    Fault,
    /// An error remains that no listed effect explains.
    Unlisted,
}

/// Permutations and signs of the columns of the force that are tried: in words, and the matrix that makes the force
/// that acted from the one that was read.
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

/// The name of a slip of one clamp of the part.
pub(super) const CLAMP_SLIP: &str = "clamp_slip";

/// Orders of the waves whose sum describes a function of a joint's angle.
const ORDERS: [f64; 5] = [1.0, 2.0, 3.0, 5.0, 8.0];
/// Number of waves whose sum describes a function of time.
const WAVES: usize = 14;
/// Numbers of a clamping: three shifts and three turns.
const CLAMPING: usize = 6;
/// Functions of time whose sum is a drift: a linear one and a curved one.
const DRIFTS: usize = 2;
/// Time constants with which a drift settles, as shares of the duration of the run.
pub(super) const SETTLES: [f64; 4] = [0.1, 0.2, 0.4, 0.8];
/// Number of products of the components of a force of first and second order.
const PRODUCTS: usize = 9;
/// Number of ordered pairs of different axes.
const PAIRS: usize = 6;
/// Prior size of drifts, jumps and unlisted patterns, mm.
pub(super) const TYPICAL_MM: f64 = 0.05;
/// Prior sizes of a clamping, mm and rad: the position errors of stops and probes.
const CLAMPED: (f64, f64) = (0.2, 4e-4);
/// Prior standard deviation, about one, of the factor of a mixed or late force. It is not zero because the arm can be
/// more or less stiff than declared. It is small because a factor near one half would describe any wrong size of the
/// force.
pub(super) const MIXED_SPREAD: f64 = 0.15;
/// Prior standard deviation of the relative error of the joints' springs where forces are mixed. The pattern has
/// columns of its own for them, because the columns of the compliance effects hold for the forces as they were read.
const SPRINGS: f64 = 0.3;
/// Number of springs of an arm.
const JOINTS: usize = 6;
/// Prior size of the crosstalk between two axes of a force sensor.
const CROSSTALK: f64 = 0.15;

impl Pattern {
    /// The consequence of the pattern in the chosen set.
    pub(super) fn consequence(self) -> Consequence {
        match self {
            Self::Clamping => Consequence::Nuisance,
            Self::Drift { .. } | Self::Jump { .. } | Self::MixedForce(_) | Self::Crosstalk | Self::LateForce(_) => {
                Consequence::Fault
            }
            Self::Joint(_) | Self::Time | Self::Force | Self::Direction => Consequence::Unlisted,
        }
    }

    /// Whether the pattern is a fault of the forces.
    pub(super) fn is_of_force(self) -> bool {
        matches!(self, Self::MixedForce(_) | Self::Crosstalk | Self::LateForce(_))
    }

    /// The name in a list of effects and faults; empty for unlisted patterns.
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

    /// The family, of which a set has at most one member.
    pub(super) fn family(self) -> String {
        match self {
            Self::MixedForce(_) | Self::Crosstalk | Self::LateForce(_) => "force readings".to_owned(),
            Self::Drift { .. } => "drift".to_owned(),
            _ => format!("pattern {self:?}"),
        }
    }

    /// The quantity that the residual follows, in words.
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
            Self::LateForce(by) => {
                let (side, rows) = (if by > 0 { "before" } else { "after" }, by.unsigned_abs());
                let rows = if rows == 1 { "the row".to_owned() } else { format!("{rows} rows") };
                format!("the force, if each row has that of {rows} {side} it")
            }
            Self::Joint(joint) => format!("sin(k·q{0}), cos(k·q{0})", joint + 1),
            Self::Time => "time".to_owned(),
            Self::Force => "cutting force".to_owned(),
            Self::Direction => "direction of travel".to_owned(),
        }
    }

    /// Number of its numbers.
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

    /// Prior mean of number `k`: one for the factor of a mixed or late force, which acts fully or not at all, and zero
    /// for all other numbers.
    pub(super) fn expected(self, k: usize) -> f64 {
        if k == 0 && matches!(self, Self::MixedForce(_) | Self::LateForce(_)) { 1.0 } else { 0.0 }
    }
}

/// All that the columns of a pattern depend on.
pub(super) struct Context<'a> {
    pub(super) problem: &'a Problem,
    pub(super) arm: &'a Arm,
    /// The residual of the arm, mm.
    pub(super) base: &'a DVector<f64>,
}

/// The columns of a pattern: what each of its numbers adds to the residual, mm for each typical size.
pub(super) fn columns(context: &Context, pattern: Pattern) -> Vec<DVector<f64>> {
    let problem = context.problem;
    let with_forces = |force: &(dyn Fn(usize, Vector3<f64>) -> Vector3<f64> + Sync)| {
        let moved = problem.residual_under(context.arm, force);
        let mut column = context.base - moved;
        column.iter_mut().for_each(|v| *v = if v.is_finite() { *v } else { 0.0 });
        column
    };
    match pattern {
        Pattern::MixedForce(which) => {
            let rows = MIXED[which].1;
            let matrix = Matrix3::from_fn(|i, j| rows[i][j]);
            let springs = (0..JOINTS).map(|joint| softer_spring(context, joint, &matrix));
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
            // The force that acted at a row is in the row that comes `by` rows later.
            let acted = |i: usize, read: Vector3<f64>| {
                let row = |i: usize| problem.rows.get(i).filter(|other| other.run == problem.rows[i].run);
                i.checked_add_signed(by).and_then(row).map_or(read, |row| problem.force(row))
            };
            vec![with_forces(&acted)]
        }
        _ => shifts(problem, pattern),
    }
}

/// What a spring of a joint that yields by [`SPRINGS`] more than declared adds to the residual under mixed forces, mm.
/// It is divided by [`MIXED_SPREAD`], which is the prior size of all numbers of the pattern.
fn softer_spring(context: &Context, joint: usize, mixed: &Matrix3<f64>) -> DVector<f64> {
    let problem = context.problem;
    let (robot, stiffness) = (&context.arm.robot, context.arm.stiffness.map_or(f64::INFINITY, |k| k[joint]));
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

/// The columns of a pattern that shifts the measured positions, mm for each typical size.
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

/// Time and place of a run.
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

    /// The share of the duration of the run that has passed, from 0 to 1.
    fn along(&self, time: f64) -> f64 {
        ((time - self.from) / (self.to - self.from).max(1e-9)).clamp(0.0, 1.0)
    }
}

/// The shift of a row by number `index` of a pattern, work object axes, mm for each typical size.
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
    // Most patterns are functions of the row, each of which shifts along the three axes.
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
            // The part moves with its clamp, so that the tip moves the other way when it is measured on the part.
            let place = point.clamp_motion(clamp, index).unwrap_or_else(Vector3::zeros);
            return -TYPICAL_MM * place;
        }
        // The work object was taught before the run, so that the rows after a slip are those that moved.
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

/// The scalars that the instrument of a row measures of a shift in work object axes, mm.
fn project(problem: &Problem, row: &Observation, shift: Vector3<f64>) -> Parts {
    let shown = match row.reading {
        Reading::Position(_) => shift.into(),
        Reading::Normal(_) => [shift.dot(&problem.runs[row.run].points[row.point].normal), 0.0, 0.0],
        Reading::Distance(_) => [shift.x, 0.0, 0.0],
    };
    [shown, [0.0; 3]]
}
