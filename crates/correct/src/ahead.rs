//! A look-ahead of the ordered pass, eight targets at once: everything that does not depend on the decisions of the pass.

use super::carried::{Carried, SettingAndTool};
use super::mount::Stand;
use super::point::Point;
use super::spin;
use super::travel::CHORD;
use deflex_cell::{Cell, Spin};
use deflex_cutting::Lean;
use deflex_equilibrium::Setting;
use deflex_lanes::{Frame, LaneMask, Lanes, Mask, Real, Vector, WIDTH, widest};
use deflex_program::{Goal, Target};
use deflex_robot::{BatchArm, BatchSolutions, Joints, Pose, WrittenTarget};
use nalgebra::{Rotation3, Unit, Vector3};

/// The results for up to eight targets before the pass reaches them.
pub(super) struct Ahead {
    /// The spin rule of CL targets.
    spin: Spin,
    /// Poses, and motor angles where they were found.
    found: BatchSolutions,
    /// The poses, target by target. Like the motor angles and the feed frames, they are separated at once, so that none is read right after
    /// it was written to memory.
    poses: [Pose; WIDTH],
    posed: bool,
    /// For CL targets, the last direction that the rule gave x; see [`spin::pose`].
    held: [Option<Vector3<f64>>; WIDTH],
    /// The chords to the targets, if all are poses in the work object of the point before them.
    chords: Chords,
    stretch: bool,
}

/// Lanes of [`Approach`].
#[derive(Default)]
struct Chords {
    /// Their starts, m.
    from: Vector,
    chord: Vector,
    size: Lanes,
    direction: Vector,
    feed_frame: Frame,
    feed_frames: [Rotation3<f64>; WIDTH],
    fed: LaneMask,
}

/// The chord to a target, or from it for the first target, work object axes.
pub(super) struct Approach<'a> {
    /// Its length, m.
    pub(super) size: f64,
    /// Its unit direction; `None` if it is too short for one.
    pub(super) direction: Option<Vector3<f64>>,
    pub(super) feed_frame: Option<&'a Rotation3<f64>>,
}

impl Ahead {
    pub(super) fn new(cell: &Cell) -> Self {
        Self {
            spin: cell.cl.as_ref().map_or(spin::NONE, |cl| cl.spin),
            found: BatchSolutions::default(),
            poses: [Pose::identity(); WIDTH],
            posed: false,
            held: [None; WIDTH],
            chords: Chords::default(),
            stretch: false,
        }
    }

    /// Computes poses, motor angles and chords of targets, with their settings and units, after the point before them.
    pub(super) fn look(
        &mut self,
        robot: Option<&BatchArm<'_>>,
        (targets, settings, stands): (&[Target], &[SettingAndTool], &[Stand]),
        carried: &Carried<'_>,
        before: Option<&Point>,
    ) {
        (self.posed, self.stretch) = (false, false);
        // With a stationary tool they are computed one by one.
        let setting = |lane: usize| stands[lane].setting(&carried.settings[settings[lane].setting as usize]);
        let robot = robot.filter(|_| (0..targets.len()).all(|lane| !setting(lane).held));
        let Some(robot) = robot else { return };
        let near = carried.near.unwrap_or_else(Joints::zeros);
        let first = settings[0];
        let before = before.filter(|before| before.setting == first.setting && settings.iter().all(|s| *s == first));
        let before = before.filter(|before| before.is_located());
        let before = before.filter(|_| stands.iter().all(|stand| stand.unsolved.is_none() && !stand.apart));
        let is_pose = |target: &Target| matches!(target.goal, Goal::Pose { .. });
        if targets.iter().any(is_pose) {
            let place = |lane: usize| place(&targets[lane], setting(lane), &near);
            robot.find(targets.len(), place, &mut self.found);
            for (lane, pose) in self.poses.iter_mut().enumerate() {
                *pose = self.found.wobj_from_tcp.lane(lane);
            }
            self.posed = true;
            self.stretch = before.is_some() && targets.iter().all(is_pose);
        } else if let Some(before) = before
            && (1..targets.len()).all(|lane| setting(lane) == setting(0))
            && self.turn(targets, before, carried.spun).is_some()
        {
            let Setting { base_from_wobj, tool, .. } = setting(0);
            robot.find_posed((base_from_wobj, &tool.flange_from_tcp), &near, &mut self.found);
            (self.posed, self.stretch) = (true, true);
        }
        if let Some(before) = before.filter(|_| self.stretch) {
            let lean = carried.laws.lean(first.tool);
            self.chords.find(&before.wobj_from_tcp.translation.vector, &self.found.wobj_from_tcp, lean);
        }
    }

    /// Poses of CL targets after a point in the same work object; `None` if one has another goal or no direction.
    fn turn(&mut self, targets: &[Target], before: &Point, mut held: Option<Vector3<f64>>) -> Option<()> {
        let mut from = before.wobj_from_tcp.translation.vector;
        for (lane, target) in targets.iter().enumerate() {
            let Goal::Axis { position_mm, axis, .. } = target.goal else { return None };
            let here = Vector3::from(position_mm) * 1e-3;
            let pose = spin::pose(&self.spin, position_mm, axis, here - from, &mut held)?;
            self.found.wobj_from_tcp.set(lane, &pose);
            (self.poses[lane], self.held[lane], from) = (pose, held, here);
        }
        Some(())
    }

    /// Discards the chords that follow: a target was refused, from which they would begin.
    pub(super) fn forget_approaches(&mut self) {
        self.stretch = false;
    }

    /// The spin rule of the cell.
    pub(super) fn spin(&self) -> &Spin {
        &self.spin
    }

    /// Pose of a CL target, and the last direction of the rule then.
    pub(super) fn turned(&self, lane: usize) -> Option<(Pose, Option<Vector3<f64>>)> {
        self.stretch.then(|| (self.poses[lane], self.held[lane]))
    }

    pub(super) fn pose(&self, lane: usize) -> Option<Pose> {
        self.posed.then(|| self.poses[lane])
    }

    /// Motor angles, if they are surely the nearest to `near` (rad).
    pub(super) fn motor(&self, lane: usize, near: &Joints) -> Option<Joints> {
        self.found.nearest(lane, near).filter(|_| self.posed)
    }

    /// Whether the chords are known; otherwise they are set one by one.
    pub(super) fn knows_approaches(&self) -> bool {
        self.stretch
    }

    /// Sets the chord to a target, m.
    pub(super) fn set_chord(&mut self, lane: usize, chord: &Vector3<f64>) {
        self.chords.chord.set(lane, chord);
    }

    /// Computes the other values of the approach, with the tool axis, tip to spindle.
    pub(super) fn set_approach(&mut self, lane: usize, axis: &Unit<Vector3<f64>>, lean: &Lean) {
        self.chords.set(lane, axis, lean);
    }

    /// Chord to a target, m.
    pub(super) fn chord(&self, lane: usize) -> Vector3<f64> {
        self.chords.chord.lane(lane)
    }

    pub(super) fn approach(&self, lane: usize) -> Approach<'_> {
        self.chords.lane(lane)
    }
}

fn place<'t>(
    target: &'t Target,
    Setting { base_from_wobj, tool, .. }: &'t Setting,
    near: &'t Joints,
) -> WrittenTarget<'t> {
    let (position_mm, quat) = match &target.goal {
        Goal::Pose { position_mm, quat, .. } => (position_mm, quat),
        Goal::Axis { .. } | Goal::Joints { .. } => (&[0.0; 3], &[1.0, 0.0, 0.0, 0.0]),
    };
    WrittenTarget { base_from_wobj, position_mm, quat, flange_from_tcp: &tool.flange_from_tcp, near }
}

impl Chords {
    /// Computes the approaches of consecutive poses; `before` is the position (m) before the first.
    fn find(&mut self, before: &Vector3<f64>, poses: &Frame, lean: &Lean) {
        self.from = poses.origin.shifted(before);
        widest!(<'a> (chords: &'a mut Chords = self, poses: &'a Frame = poses, lean: &'a Lean = lean) {
            chords.chord = poses.origin - chords.from;
            chords.size = chords.chord.dot(chords.chord).sqrt();
            chords.direction = chords.chord * (Lanes::of(1.0) / chords.size);
            (chords.feed_frame, chords.fed) = lean.feed_frames(-poses.z, chords.direction);
        });
        for (lane, feed_frame) in self.feed_frames.iter_mut().enumerate() {
            *feed_frame = self.feed_frame.rotation(lane);
        }
    }

    /// Computes the approach for one chord.
    fn set(&mut self, lane: usize, axis: &Unit<Vector3<f64>>, lean: &Lean) {
        let chord = self.chord.lane(lane);
        let size = chord.norm();
        let direction = chord * (1.0 / size);
        let feed_frame = if size > CHORD { lean.feed_frame(axis, &direction) } else { None };
        self.size.set(lane, size);
        self.direction.set(lane, &direction);
        self.fed.set(lane, feed_frame.is_some());
        if let Some(feed_frame) = feed_frame {
            self.feed_frames[lane] = feed_frame;
        }
    }

    fn lane(&self, lane: usize) -> Approach<'_> {
        let size = self.size.lane(lane);
        let far = size > CHORD;
        Approach {
            size,
            direction: far.then(|| self.direction.lane(lane)),
            feed_frame: (far && self.fed.lane(lane)).then(|| &self.feed_frames[lane]),
        }
    }
}
