//! Points on segments that are added to a program's points, where something was measured.

use super::context::Context;
use super::load::PointLoad;
use super::loads_before::torque_between;
use super::point::Point;
use super::removal::{self, Cuts};
use super::{Options, Prepared};
use deflex_cell::Cell;
use deflex_effects::PartYield;
use deflex_equilibrium::Arm;
use deflex_program::Program;
use deflex_robot::Pose;
use deflex_text::Diagnostic;
use std::sync::Arc;

/// A position on the segment to a target.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct Between {
    /// Index of the target's point.
    pub target: usize,
    /// Share of the segment, 1 at the target.
    pub share: f64,
}

impl Prepared {
    /// Whether any force follows from the stock.
    #[doc(hidden)]
    pub fn follows_stock(&self) -> bool {
        self.points.iter().any(|point| point.through.is_some_and(|through| through.feed_per_tooth.is_some()))
    }

    /// Cuts the cell's stock with the poses of an arm: the forces at all points become those that act on this arm, as in a prediction.
    ///
    /// # Errors
    /// As [`Prepared::new`].
    #[doc(hidden)]
    pub fn cut_by(&mut self, arm: &Arm, program: &Program, cell: &Cell) -> Result<(), Vec<Diagnostic>> {
        let mut added = self.points.split_off(program.targets.len());
        let between = std::mem::take(&mut self.between);
        removal::run(Context::whole(program, cell, &Options::default()), self, Cuts::Deflected, arm)?;
        for (point, place) in added.iter_mut().zip(&between) {
            self.take_load(point, *place);
        }
        self.points.append(&mut added);
        self.between = between;
        Ok(())
    }

    /// Adds the point at a position: on the straight line, with an even turn, and the joints nearest to those before. Returns its index.
    #[doc(hidden)]
    pub fn add_between(&mut self, cell: &Cell, place: Between) -> Result<usize, String> {
        let mut point = self.between(cell, place)?;
        self.take_load(&mut point, place);
        self.between.push(place);
        self.points.push(point);
        Ok(self.points.len() - 1)
    }

    fn between(&self, cell: &Cell, Between { target, share }: Between) -> Result<Point, String> {
        let end = &self.points[target];
        let mut point = end.clone();
        let Some(before) = target.checked_sub(1).map(|before| &self.points[before]).filter(|_| share < 1.0) else {
            return Ok(point);
        };
        let between = |from: &Pose, to: &Pose| {
            from.try_lerp_slerp(to, share, 1e-9).ok_or(
                "the tool turns by half a turn on the path there, so that the orientation in the middle is not defined",
            )
        };
        point.wobj_from_tcp = between(&before.wobj_from_tcp, &end.wobj_from_tcp)?;
        point.reference = between(&before.reference, &end.reference)?;
        let flange = self.base_from_wobj(target) * point.wobj_from_tcp * self.tool(target).flange_from_tcp.inverse();
        point.motor = cell.arm.robot.inverse_near(&flange, &before.motor).map_err(|error| error.to_string())?;
        point.torque = torque_between(before, end, share);
        point.travel = cell.arm.travel(&before.step(), &point.motor, &point.twist());
        let mix = |a: f64, b: f64| a + (b - a) * share;
        point.normal = before.normal.lerp(&end.normal, share).try_normalize(1e-9).unwrap_or(end.normal);
        point.time = mix(before.time, end.time);
        point.cut_length = mix(before.cut_length, end.cut_length);
        if let (Some(before), Some(end)) = (&before.part, &end.part) {
            point.part = Some(Arc::new(PartYield::mixed([(&**before, 1.0 - share), (&**end, share)])));
        }
        Ok(point)
    }

    /// Gives an added point the force that follows from the stock at its position, and the torques there.
    fn take_load(&self, point: &mut Point, Between { target, share }: Between) {
        let force = self.points[target].milled.as_ref().and_then(|milled| milled.at(share));
        if let Some(force) = force {
            point.load = PointLoad::of_stock(force.programmed);
        }
        if let Some(before) = target.checked_sub(1) {
            point.torque = torque_between(&self.points[before], &self.points[target], share);
        }
    }
}
