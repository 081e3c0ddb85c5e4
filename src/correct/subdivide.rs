//! Extra targets where the correction bends between neighbours.
//!
//! The controller interpolates the correction linearly between targets; the error of that is the correction's
//! curvature. A stretch is halved while the correction at its middle is off the mean of its ends.

use super::line::Inserts;
use super::solve::Wish;
use super::spread::Spread;
use super::{Point, Prepared, frames};
use crate::cell::Cell;
use crate::program::{Insert, Motion, Program, Role};
use crate::robot::{Joints, Pose};
use nalgebra::{Rotation3, Translation3, Vector3};
use std::sync::Arc;

/// Halvings of one stretch at most: 2⁶ − 1 inserted points.
const DEEPEST: usize = 6;

/// Where a stretch begins: a target as it was solved.
#[derive(Clone, Debug)]
pub(super) struct Start {
    point: Point,
    motor: Joints,
    wish: Wish,
    tool: Arc<str>,
    wobj: Arc<str>,
}

/// A program, or a piece of one, with its commands.
pub(super) struct Solved<'a> {
    pub(super) program: &'a Program,
    pub(super) cell: &'a Cell,
    pub(super) prepared: &'a Prepared,
    pub(super) motors: &'a [Joints],
    pub(super) wishes: &'a [Wish],
}

impl Solved<'_> {
    /// Target `i` as the start of the stretch behind it.
    fn start(&self, i: usize) -> Start {
        let target = &self.program.targets[i];
        Start {
            point: self.prepared.points[i].clone(),
            motor: self.motors[i],
            wish: self.wishes[i],
            tool: Arc::clone(&self.program.tools[usize::from(target.tool)].name),
            wobj: Arc::clone(&self.program.wobjs[usize::from(target.wobj)].name),
        }
    }

    /// The last target, where there is one.
    pub(super) fn last(&self) -> Option<Start> {
        self.program.targets.len().checked_sub(1).map(|last| self.start(last))
    }

    /// Points to insert so that the correction is linear to `tolerance` (m) between neighbours; `before` is the last target
    /// of the pieces before.
    pub(super) fn inserts(&self, before: Option<&Start>, tolerance: f64, spread: Spread) -> Inserts {
        let stretches = spread.map(self.program.targets.len(), |i| {
            let own = i.checked_sub(1).map(|before| self.start(before));
            let mut found = Vec::new();
            if let Some(from) = own.as_ref().or(before).filter(|from| self.is_straight(from, i)) {
                let stretch = Stretch { cell: self.cell, prepared: self.prepared, from: &from.point, i, tolerance };
                let ends = (stretch.corrected(&from.motor, 0.0), stretch.corrected(&self.motors[i], 1.0));
                if let (Some(from), Some(to)) = ends {
                    stretch.halve((0.0, &from), (1.0, &to), DEEPEST, &mut found);
                }
            }
            found
        });
        stretches.into_iter().flatten().collect()
    }

    /// Whether the way to target `i` is one that points can be put into.
    fn is_straight(&self, from: &Start, i: usize) -> bool {
        let to = &self.program.targets[i];
        to.motion == Motion::Linear
            && to.role == Role::End
            && from.wobj.eq_ignore_ascii_case(&self.program.wobjs[usize::from(to.wobj)].name)
            && from.tool.eq_ignore_ascii_case(&self.program.tools[usize::from(to.tool)].name)
            && self.wishes[i] == Wish::Pose
            && from.wish != Wish::Keep
    }
}

/// A corrected point of a stretch.
struct Corrected {
    motor: Joints,
    programmed: Pose,
    commanded: Pose,
}

impl Corrected {
    fn shift(&self) -> Vector3<f64> {
        self.commanded.translation.vector - self.programmed.translation.vector
    }
}

struct Stretch<'a> {
    cell: &'a Cell,
    prepared: &'a Prepared,
    from: &'a Point,
    i: usize,
    tolerance: f64,
}

impl Stretch<'_> {
    /// The correction at a share of the way, cut and tool as at the stretch's end.
    fn corrected(&self, near: &Joints, share: f64) -> Option<Corrected> {
        let (from, to) = (self.from, &self.prepared.points[self.i]);
        let (a, b) = (&from.wobj_from_tcp, &to.wobj_from_tcp);
        let way = Rotation3::from_scaled_axis(share * crate::robot::turn_between(&a.rotation, &b.rotation));
        let programmed = Pose::from_parts(
            Translation3::from(a.translation.vector.lerp(&b.translation.vector, share)),
            way * a.rotation,
        );
        let mut situation = self.prepared.situation(self.i);
        situation.wobj_from_tcp = programmed;
        let command = self.cell.arm.command(&situation, &programmed, near, &to.travel).ok()?;
        let motor = command.commanded(&to.travel);
        let base_from_tcp = self.cell.arm.robot.forward(&motor) * self.prepared.tool(self.i).flange_from_tcp;
        Some(Corrected { motor, programmed, commanded: self.prepared.base_from_wobj(self.i).inv_mul(&base_from_tcp) })
    }

    fn halve(&self, from: (f64, &Corrected), to: (f64, &Corrected), depth: usize, found: &mut Inserts) {
        let share = 0.5 * (from.0 + to.0);
        let Some(middle) = self.corrected(&from.1.motor, share).filter(|_| depth > 0) else { return };
        if (middle.shift() - 0.5 * (from.1.shift() + to.1.shift())).norm() <= self.tolerance {
            return;
        }
        self.halve(from, (share, &middle), depth - 1, found);
        let (position_mm, quat) = frames::millimetres(&middle.commanded);
        found.push(Insert { before: self.i, position_mm, quat });
        self.halve((share, &middle), to, depth - 1, found);
    }
}
