//! Looking ahead of the ordered pass, eight targets at once: all that does not depend on what the pass decides.

use super::path::{CHORD, Carried, Point};
use crate::cutting::Lean;
use crate::equilibrium::Setting;
use crate::lanes::{Frame, Lanes, Mask, Vector, widest};
use crate::program::{Goal, Target};
use crate::robot::{Eight, EightFound, Joints, Place, Pose};
use nalgebra::{Rotation3, Unit, Vector3};

/// What is known of up to eight targets before each is looked at.
#[derive(Default)]
pub(super) struct Ahead {
    /// Poses and, most likely, motor angles.
    found: EightFound,
    posed: bool,
    /// The ways into the targets, where they are all poses in the work object of the point before them.
    chords: Chords,
    stretch: bool,
}

/// Eight of [`Way`].
#[derive(Default)]
struct Chords {
    /// Where they begin, m.
    from: Vector,
    chord: Vector,
    size: Lanes,
    direction: Vector,
    feed_frame: Frame,
    fed: Mask,
}

/// The way into a target, work object axes; out of it at the first.
pub(super) struct Way {
    /// m
    pub(super) chord: Vector3<f64>,
    /// Its length, m.
    pub(super) size: f64,
    /// Where it is long enough for one.
    pub(super) direction: Option<Vector3<f64>>,
    pub(super) feed_frame: Option<Rotation3<f64>>,
}

impl Way {
    /// Along a chord, m, with the tool axis, tip to spindle.
    pub(super) fn along(chord: Vector3<f64>, axis: &Unit<Vector3<f64>>, lean: &Lean) -> Self {
        let size = chord.norm();
        let direction = (size > CHORD).then(|| chord * (1.0 / size));
        let feed_frame = direction.and_then(|direction| lean.feed_frame(axis, &direction));
        Self { chord, size, direction, feed_frame }
    }
}

impl Ahead {
    /// Looks at targets, with their settings, and the point before them.
    pub(super) fn look(
        &mut self,
        robot: Option<&Eight<'_>>,
        (targets, settings): (&[Target], &[u32]),
        carried: &Carried<'_>,
        before: Option<&Point>,
    ) {
        let is_pose = |target: &Target| matches!(target.goal, Goal::Pose { .. });
        (self.posed, self.stretch) = (false, false);
        // Of tool axes (CL data) the pose is not known yet.
        let Some(robot) = robot.filter(|_| targets.iter().any(is_pose)) else { return };
        self.posed = true;
        let near = carried.near.unwrap_or_else(Joints::zeros);
        let place = |lane: usize| place(&targets[lane], &carried.settings[settings[lane] as usize], &near);
        robot.find(targets.len(), place, &mut self.found);

        let Some(before) = before else { return };
        let mut all = targets.iter().zip(settings);
        if all.all(|(target, setting)| is_pose(target) && *setting == before.setting) {
            self.stretch = true;
            self.chords.find(&before.wobj_from_tcp.translation.vector, &self.found.wobj_from_tcp, carried.laws.lean());
        }
    }

    pub(super) fn pose(&self, lane: usize) -> Option<Pose> {
        self.posed.then(|| self.found.wobj_from_tcp.lane(lane))
    }

    /// Motor angles, where they are surely the nearest to others (rad).
    pub(super) fn motor(&self, lane: usize, near: &Joints) -> Option<Joints> {
        self.found.nearest(lane, near).filter(|_| self.posed)
    }

    pub(super) fn way(&self, lane: usize) -> Option<Way> {
        self.stretch.then(|| self.chords.lane(lane))
    }
}

fn place<'t>(target: &'t Target, Setting { base_from_wobj, tool }: &'t Setting, near: &'t Joints) -> Place<'t> {
    let (position_mm, quat) = match &target.goal {
        Goal::Pose { position_mm, quat, .. } => (position_mm, quat),
        Goal::Axis { .. } | Goal::Joints { .. } => (&[0.0; 3], &[1.0, 0.0, 0.0, 0.0]),
    };
    Place { base_from_wobj, position_mm, quat, flange_from_tcp: &tool.flange_from_tcp, near }
}

impl Chords {
    /// Of poses one after the other, `before` being the place (m) before the first.
    fn find(&mut self, before: &Vector3<f64>, poses: &Frame, lean: &Lean) {
        self.from = poses.origin.behind(before);
        widest!(<'a> (chords: &'a mut Chords = self, poses: &'a Frame = poses, lean: &'a Lean = lean) {
            chords.chord = poses.origin - chords.from;
            chords.size = chords.chord.dot(chords.chord).sqrt();
            chords.direction = chords.chord * (Lanes::of(1.0) / chords.size);
            (chords.feed_frame, chords.fed) = lean.feed_frames(poses.z * -1.0, chords.direction);
        });
    }

    fn lane(&self, lane: usize) -> Way {
        let size = self.size.lane(lane);
        let far = size > CHORD;
        Way {
            chord: self.chord.lane(lane),
            size,
            direction: far.then(|| self.direction.lane(lane)),
            feed_frame: (far && self.fed.lane(lane)).then(|| self.feed_frame.rotation(lane)),
        }
    }
}
