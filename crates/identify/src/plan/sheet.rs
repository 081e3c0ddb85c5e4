//! The rows of a plan in running order, with their spots, speeds and loads, and the changes that every effect would
//! make to them.

use super::Frames;
use super::pool::Spot;
use crate::candidate::Candidate;
use crate::data::{Blocks, Extent, Problem};
use crate::design::Design;
use crate::device::Device;
use crate::differences::Reuse;
use crate::pattern::{self, Pattern};
use crate::reading::Reading;
use deflex_cell::{Instrument, PlanSection};
use deflex_correct::{Point, Prepared};
use deflex_equilibrium::Arm;
use deflex_measured::MeasuredRow;
use deflex_program::jbi::SpeedUnit;
use deflex_robot::Joints;
use nalgebra::{DMatrix, Vector3};

/// Time for which the arm stands at a row until it has settled and is measured, s.
pub(super) const DWELL_S: f64 = 10.0;
/// Time that a change of the load takes, s.
const CHANGE_S: f64 = 120.0;

/// One row of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Row {
    /// Index into the spots.
    pub(super) spot: usize,
    /// Speed of the motion to it, m/s.
    pub(super) speed: f64,
}

/// Rows and the load of each.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    pub(super) rows: Vec<Row>,
    /// Index into the loads of `[plan]` for each row.
    pub(super) loads: Vec<usize>,
}

/// All that the rows of a plan depend on.
pub(super) struct Bench<'a> {
    pub(super) section: &'a PlanSection,
    pub(super) arm: &'a Arm,
    pub(super) frames: Frames,
    pub(super) spots: Vec<Spot>,
    /// Motor angles before the first row, rad, if the cell declares them.
    pub(super) start: Option<Joints>,
    /// The unit of speeds in INFORM.
    pub(super) speed_unit: SpeedUnit,
}

impl Bench<'_> {
    /// The points of a sheet in running order, as they would be prepared from its program.
    pub(super) fn points(&self, sheet: &Sheet) -> Vec<Point> {
        let place = |row: &Row| self.spots[row.spot].wobj_from_tcp;
        let chord =
            |i: usize, j: usize| place(&sheet.rows[j]).translation.vector - place(&sheet.rows[i]).translation.vector;
        let mut points: Vec<Point> = Vec::with_capacity(sheet.rows.len());
        let mut previous = None;
        let (mut time, mut cut) = (0.0, 0.0);
        for (i, row) in sheet.rows.iter().enumerate() {
            let motor = self.spots[row.spot].motor;
            let travel = self.arm.go_on(motor, Joints::zeros(), &mut previous).travel;
            let load = self.section.loads[sheet.loads[i]];
            let mut point = Point::measured(place(row), motor, travel);
            let way = if i > 0 { chord(i - 1, i) } else { chord(0, 1.min(sheet.rows.len() - 1)) };
            if let Some(direction) = way.try_normalize(1e-6) {
                point.velocity = direction * row.speed;
            }
            if load != Vector3::zeros() {
                point.set_force(load);
                cut += if i > 0 { way.norm() } else { 0.0 };
            }
            if i > 0 {
                time += way.norm() / row.speed + DWELL_S;
                time += if sheet.loads[i] == sheet.loads[i - 1] { 0.0 } else { CHANGE_S };
            }
            // The time is rounded to the digits that the table has.
            point.time = (time * 10.0).round() / 10.0;
            point.cut_length = cut;
            points.push(point);
        }
        points
    }

    /// The rows `which` of a sheet as a problem whose rows are measured at their programmed places.
    pub(super) fn problem(&self, sheet: &Sheet, which: &[usize]) -> Problem {
        let points = self.points(sheet);
        let blocks = Blocks::of(&vec![None; points.len()]);
        let mut problem = Problem::empty(Extent::Part);
        for &i in which {
            let point = &points[i];
            let place_mm = point.wobj_from_tcp.translation.vector * 1e3;
            let reading = match (self.section.instrument, self.section.from) {
                (Instrument::Normal, _) => Reading::Normal(0.0),
                (Instrument::Distance, Some(from)) => Reading::Distance((place_mm - from * 1e3).norm()),
                _ => Reading::Position(place_mm),
            };
            problem.push(0, i, i, &MeasuredRow::default(), point.motor, point.travel, reading, &blocks);
        }
        problem.runs.push(Prepared::of_points_in(
            self.frames.base_from_wobj,
            points,
            &self.arm.robot,
            self.frames.tool,
        ));
        problem.devices.push(match (self.section.instrument, self.section.from) {
            (Instrument::Distance, Some(from)) => Device::Point(from * 1e3),
            _ => Device::Known,
        });
        problem
    }

    /// The change that each number of the candidates, then each unknown number of the instrument, makes to the scalars
    /// of the rows `which`, mm for each typical size.
    pub(super) fn columns(&self, candidates: &mut [Candidate], sheet: &Sheet, which: &[usize]) -> DMatrix<f64> {
        let problem = self.problem(sheet, which);
        let base = problem.residual(self.arm);
        let wanted: Vec<usize> = (0..candidates.len()).collect();
        let (design, _) = Design::new(self.arm, &problem, candidates, &[], &wanted, &base, &mut Reuse::of(0));
        design.kept().clone()
    }

    /// The change that a drift of the instrument makes to the scalars of all rows, mm for each prior size.
    pub(super) fn drifts(&self, sheet: &Sheet) -> DMatrix<f64> {
        let all: Vec<usize> = (0..sheet.rows.len()).collect();
        DMatrix::from_columns(&pattern::shifts(&self.problem(sheet, &all), Pattern::Drift { settles: None }))
    }

    /// Number of scalars of a row.
    pub(super) fn axes(&self) -> usize {
        match self.section.instrument {
            Instrument::Position => 3,
            Instrument::Normal | Instrument::Distance => 1,
        }
    }

    /// Whether the arm moves from one spot to another, and takes the branch of the other spot under any rule that
    /// controllers have for the branch. The first spot is reached from the start of the cell.
    pub(super) fn follows(&self, before: Option<&Spot>, next: &Spot) -> bool {
        /// Largest difference of equal angles by rounding, rad.
        const SAME: f64 = 1e-6;
        let Some(near) = before.map(|spot| &spot.motor).or(self.start.as_ref()) else { return true };
        let flange = self.frames.base_from_flange(&next.wobj_from_tcp);
        let still = before.is_some() && (next.motor - near).amax() < SAME;
        !still && self.arm.robot.inverse_near(&flange, near).is_ok_and(|motor| (motor - next.motor).amax() < SAME)
    }
}

impl Bench<'_> {
    /// Whether the arm can move in a straight line from one spot to another within the axis limits, away from singular
    /// wrists, and without reversing an axis. Every axis then arrives in the direction in which it set out.
    pub(super) fn is_straight(&self, from: &Spot, to: &Spot) -> bool {
        /// Number of poses on the line that are checked.
        const STEPS: usize = 12;
        /// Motions of an axis below this have no direction, rad.
        const STILL: f64 = 1e-5;
        /// Smallest angle of axis 5 from zero, rad.
        const SINGULAR: f64 = 0.1;
        let robot = &self.arm.robot;
        let whole = to.motor - from.motor;
        let mut near = from.motor;
        for step in 1..=STEPS {
            let share = step as f64 / STEPS as f64;
            let Some(pose) = from.wobj_from_tcp.try_lerp_slerp(&to.wobj_from_tcp, share, 1e-9) else { return false };
            let Ok(motor) = robot.inverse_near(&self.frames.base_from_flange(&pose), &near) else { return false };
            let back = (0..6).any(|j| (motor[j] - near[j]) * whole[j].signum() < -STILL);
            if back || motor[4].abs() < SINGULAR {
                return false;
            }
            near = motor;
        }
        (near - to.motor).amax() < STILL
    }
}
