//! Extra targets where the correction bends between neighbours.
//!
//! The controller interpolates the correction linearly between targets; the error of that is the correction's
//! curvature. A stretch is halved while the correction at its middle is off the mean of its ends.

use super::line::Inserts;
use super::solve::Wish;
use super::{Prepared, frames};
use crate::cell::Cell;
use crate::program::{Insert, Motion, Program, Role};
use crate::robot::{Joints, Pose};
use nalgebra::{Rotation3, Translation3, Vector3};
use rayon::prelude::*;

/// Halvings of one stretch at most: 2⁶ − 1 inserted points.
const DEEPEST: usize = 6;

/// Points to insert so that the correction is linear to `tolerance` (m) between neighbours.
pub(super) fn inserts(
    program: &Program,
    cell: &Cell,
    prepared: &Prepared,
    motors: &[Joints],
    wishes: &[Wish],
    tolerance: f64,
) -> Inserts {
    let straight = |i: usize| {
        let (from, to) = (&program.targets[i - 1], &program.targets[i]);
        to.motion == Motion::Linear
            && to.role == Role::End
            && from.wobj == to.wobj
            && from.tool == to.tool
            && wishes[i] == Wish::Pose
            && wishes[i - 1] != Wish::Keep
    };
    let stretches: Vec<Inserts> = (1..program.targets.len())
        .into_par_iter()
        .map(|i| {
            let mut found = Vec::new();
            if straight(i) {
                let stretch = Stretch { cell, prepared, i, tolerance };
                let ends = (stretch.corrected(&motors[i - 1], 0.0), stretch.corrected(&motors[i], 1.0));
                if let (Some(from), Some(to)) = ends {
                    stretch.halve((0.0, &from), (1.0, &to), DEEPEST, &mut found);
                }
            }
            found
        })
        .collect();
    stretches.into_iter().flatten().collect()
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
    i: usize,
    tolerance: f64,
}

impl Stretch<'_> {
    /// The correction at a share of the way, cut and tool as at the stretch's end.
    fn corrected(&self, near: &Joints, share: f64) -> Option<Corrected> {
        let (from, to) = (&self.prepared.points[self.i - 1], &self.prepared.points[self.i]);
        let (a, b) = (&from.wobj_from_tcp, &to.wobj_from_tcp);
        let way =
            Rotation3::from_scaled_axis(share * crate::robot::rotation_vector(&(b.rotation * a.rotation.inverse())));
        let programmed = Pose::from_parts(
            Translation3::from(a.translation.vector.lerp(&b.translation.vector, share)),
            way * a.rotation,
        );
        let mut situation = self.prepared.situation(self.i);
        situation.wobj_from_tcp = programmed;
        let command = self.cell.arm.command(&situation, &programmed, near, &to.travel).ok()?;
        let motor = command.commanded(&to.travel);
        let base_from_tcp = self.cell.arm.robot.forward(&motor) * to.tool.flange_from_tcp;
        Some(Corrected { motor, programmed, commanded: to.base_from_wobj.inv_mul(&base_from_tcp) })
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
