//! Rows in running order: where, how fast, under which load; and what every effect would show at them.

use super::Frames;
use super::pool::Spot;
use crate::cell::{Instrument, PlanSection};
use crate::correct::{Point, Prepared};
use crate::equilibrium::Arm;
use crate::identify::candidate::Candidate;
use crate::identify::data::{Blocks, Problem};
use crate::identify::design::Design;
use crate::identify::device::Device;
use crate::identify::differences::Reuse;
use crate::identify::pattern::{self, Pattern};
use crate::identify::seen::Seen;
use crate::measured::MeasuredRow;
use crate::robot::Joints;
use nalgebra::{DMatrix, Vector3};

/// Time that the arm stands at a row, s: it settles and is read.
pub(super) const DWELL_S: f64 = 10.0;
/// Time that a change of the load takes, s.
const CHANGE_S: f64 = 120.0;

/// One row of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Row {
    /// Index into the spots.
    pub(super) spot: usize,
    /// Speed into it, m/s.
    pub(super) speed: f64,
}

/// Rows and the load of each.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    pub(super) rows: Vec<Row>,
    /// Indices into the loads: one a row.
    pub(super) loads: Vec<usize>,
}

/// What rows are made with.
pub(super) struct Bench<'a> {
    pub(super) section: &'a PlanSection,
    pub(super) arm: &'a Arm,
    pub(super) frames: Frames,
    pub(super) spots: Vec<Spot>,
    /// Where the arm stands before the first row, where the cell says: rad.
    pub(super) start: Option<Joints>,
}

impl Bench<'_> {
    /// The points of a sheet in running order, as a program of them would be prepared.
    pub(super) fn points(&self, sheet: &Sheet) -> Vec<Point> {
        let place = |row: &Row| self.spots[row.spot].wobj_from_tcp;
        let chord =
            |i: usize, j: usize| place(&sheet.rows[j]).translation.vector - place(&sheet.rows[i]).translation.vector;
        let mut points: Vec<Point> = Vec::with_capacity(sheet.rows.len());
        let mut previous = None;
        let (mut time, mut cut) = (0.0, 0.0);
        for (i, row) in sheet.rows.iter().enumerate() {
            let motor = self.spots[row.spot].motor;
            let travel = self.arm.go_on(motor, &mut previous).travel;
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
            // As many digits as are written.
            point.time = (time * 10.0).round() / 10.0;
            point.cut_length = cut;
            points.push(point);
        }
        points
    }

    /// The rows `which` of a sheet as a problem: measured where they are programmed.
    pub(super) fn problem(&self, sheet: &Sheet, which: &[usize]) -> Problem {
        let points = self.points(sheet);
        let blocks = Blocks::of(&vec![None; points.len()]);
        let mut problem = Problem::empty(false);
        for &i in which {
            let point = &points[i];
            let place_mm = point.wobj_from_tcp.translation.vector * 1e3;
            let seen = match (self.section.instrument, self.section.from) {
                (Instrument::Normal, _) => Seen::Normal(0.0),
                (Instrument::Distance, Some(from)) => Seen::Distance((place_mm - from * 1e3).norm()),
                _ => Seen::Position(place_mm),
            };
            problem.push(0, i, i, &MeasuredRow::default(), point.motor, point.travel, seen, &blocks);
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

    /// What each number of the candidates, then each unknown of the instrument, would show at the rows `which`, mm per
    /// typical size: scalars of the rows below one another.
    pub(super) fn columns(&self, candidates: &mut [Candidate], sheet: &Sheet, which: &[usize]) -> DMatrix<f64> {
        let problem = self.problem(sheet, which);
        let base = problem.residual(self.arm);
        let wanted: Vec<usize> = (0..candidates.len()).collect();
        let (design, _) = Design::new(self.arm, &problem, candidates, &[], &wanted, &base, &mut Reuse::of(0));
        design.kept().clone()
    }

    /// What an instrument that drifts would show at all rows, mm per prior size.
    pub(super) fn drifts(&self, sheet: &Sheet) -> DMatrix<f64> {
        let all: Vec<usize> = (0..sheet.rows.len()).collect();
        DMatrix::from_columns(&pattern::shifts(&self.problem(sheet, &all), Pattern::Drift { settles: None }))
    }

    /// Scalars that a row has.
    pub(super) fn axes(&self) -> usize {
        match self.section.instrument {
            Instrument::Position => 3,
            Instrument::Normal | Instrument::Distance => 1,
        }
    }

    /// Whether the arm goes from one spot to another as commanded, whatever rule the controller has for the branch.
    pub(super) fn follows(&self, before: Option<&Spot>, next: &Spot) -> bool {
        /// rad: the same angles, but for rounding.
        const SAME: f64 = 1e-6;
        let Some(near) = before.map(|spot| &spot.motor).or(self.start.as_ref()) else { return true };
        let flange = self.frames.base_from_flange(&next.wobj_from_tcp);
        let still = before.is_some() && (next.motor - near).amax() < SAME;
        !still && self.arm.robot.inverse_near(&flange, near).is_ok_and(|motor| (motor - next.motor).amax() < SAME)
    }
}

impl Bench<'_> {
    /// Whether the arm goes the straight way from one spot to another in one sweep: within limits, off singular wrists, no
    /// axis turning back, so that every axis arrives from the side from which it came.
    pub(super) fn is_straight(&self, from: &Spot, to: &Spot) -> bool {
        /// Places on the way that are looked at.
        const STEPS: usize = 12;
        /// rad: an axis that hardly moves has no direction.
        const STILL: f64 = 1e-5;
        /// rad
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
