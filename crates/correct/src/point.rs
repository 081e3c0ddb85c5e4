//! The data of one target before its equilibrium, and the situation that the arm and its effects get from them.

use super::KeptReason;
use super::laws::Law;
use super::load::{Follows, PointLoad, Through};
use super::mount::Moved;
use deflex_cutting::ForceParts;
use deflex_effects::{Cutting, CuttingTorque, PartAt, PartYield, Situation, ToolFrame, UnitAt};
use deflex_equilibrium::{Dragged, PredictedPose, Setting, Site};
use deflex_program::ArcTurn;
use deflex_robot::{Joints, Pose};
use nalgebra::{Rotation3, Unit, Vector3};
use std::sync::Arc;

/// The data of one target before its equilibrium.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let prepared = deflex_correct::Prepared::new(&program, &cell, &Default::default())?;
/// let point = &prepared.points[0];
/// println!("{:.1} s, {:.3} m/s", point.time, point.velocity.norm());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct Point {
    /// Index into the mounts: tool and work object.
    pub(super) setting: u32,
    /// External axes, if there are any, and the setting at their positions.
    pub(super) moved: Option<Arc<Moved>>,
    /// Why the pose of the target is unknown; the target is then not solved.
    pub(super) unsolved: Option<KeptReason>,
    /// Programmed pose of the TCP.
    pub wobj_from_tcp: Pose,
    /// The pose from which errors count, and which defines depth and force: the programmed one, except with `--against`.
    pub reference: Pose,
    /// Nominal motor angles at `wobj_from_tcp`, rad.
    pub motor: Joints,
    /// Direction of travel into the target with the joints as programmed, −1, 0, 1.
    pub travel: Joints,
    /// Surface normal, out of the material, work object axes.
    pub normal: Vector3<f64>,
    /// Programmed velocity, m/s, work object axes.
    pub velocity: Vector3<f64>,
    /// Length that is cut up to here, m.
    pub cut_length: f64,
    /// Time since the start, s.
    pub time: f64,
    /// Temperature, °C.
    pub temperature: Option<f64>,
    /// Payload in addition to the tool, kg.
    pub payload: f64,
    /// The cut.
    pub(super) load: PointLoad,
    /// How the controller turns the tool on the arc to it.
    pub(super) arc_turn: ArcTurn,
    /// Whether its orientation is that of the turn on the arc, whatever the text says: a circle point.
    pub(super) turned_by_arc: bool,
    /// Whether it is cut along the tool axis, for which there is no feed frame, although the force is given in one.
    pub(super) plunges: bool,
    /// The cutter of the motion to it, if it moves through a stock.
    pub(super) through: Option<Through>,
    /// The result of that cut.
    pub(super) milled: Option<Box<Milled>>,
    /// Compliance of the clamped part where it is cut, work object axes.
    pub(super) part: Option<Arc<PartYield>>,
    /// What this and earlier cutting forces do to the gears; see [`Prepared::follow_loads`](super::Prepared::follow_loads).
    pub(super) torque: Option<Arc<CuttingTorque>>,
}

/// The cut of the segment to a target.
#[derive(Clone, Debug, Default)]
pub(super) struct Milled {
    /// Axial depth (m) and arc of engagement (rad) at the target, if the force follows from the stock.
    pub(super) engaged: Option<[f64; 2]>,
    /// Vector from the tip to where it cuts, m, stock's axes.
    pub(super) cut: Vector3<f64>,
    /// Vector from the tip to the face that it leaves, m, stock's axes.
    pub(super) left: Vector3<f64>,
    /// Volume removed on the segment, m³.
    pub(super) removed: f64,
    /// Shares of the segment, rising from 0 to 1, and the force there.
    pub(super) forces: Arc<[(f64, FedForce)]>,
}

/// The force of a cut from stock, N, work object axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FedForce {
    /// At the programmed feed.
    pub(super) programmed: Vector3<f64>,
    /// The part in proportion to the feed; the rest is the force of the edges.
    fed: Vector3<f64>,
}

impl FedForce {
    /// The mean force of an engaged front at a programmed feed per tooth (m), turned from stock to work object axes.
    pub(super) fn new(wobj_from_stock: &Rotation3<f64>, force: &ForceParts, feed_per_tooth: f64) -> Self {
        Self {
            programmed: wobj_from_stock * force.at(feed_per_tooth),
            fed: wobj_from_stock * (force.cutting * feed_per_tooth),
        }
    }

    /// The force at a share of the programmed speed, N: a slower tooth cuts a thinner chip.
    pub(super) fn at(&self, speed: f64) -> Vector3<f64> {
        if speed < 1.0 { self.programmed - self.fed * (1.0 - speed) } else { self.programmed }
    }

    fn lerp(&self, to: &Self, share: f64) -> Self {
        Self { programmed: self.programmed.lerp(&to.programmed, share), fed: self.fed.lerp(&to.fed, share) }
    }
}

impl Milled {
    /// The cut of the part of the segment between two shares of it.
    pub(super) fn between(&self, from: f64, to: f64) -> Self {
        if (from, to) == (0.0, 1.0) {
            return self.clone();
        }
        // None of them is inside if the two shares are the same, so that nothing is divided by zero.
        let inner = self.forces.iter().filter(|(at, _)| from < *at && *at < to);
        let inner = inner.map(|(at, force)| ((at - from) / (to - from), *force));
        let ends = [(from, 0.0), (to, 1.0)].map(|(at, share)| self.at(at).map(|force| (share, force)));
        let forces: Vec<_> = ends[0].into_iter().chain(inner).chain(ends[1]).collect();
        // The engagement is known at the end of the segment alone.
        let engaged = self.engaged.filter(|_| to >= 1.0);
        Self { engaged, removed: self.removed * (to - from), forces: forces.into(), ..self.clone() }
    }

    /// The force at a share of the segment; `None` if it does not follow from the stock.
    pub(super) fn at(&self, share: f64) -> Option<FedForce> {
        let after = self.forces.partition_point(|(at, _)| *at < share);
        let next = self.forces.get(after).or(self.forces.last())?;
        let Some(before) = after.checked_sub(1).map(|i| &self.forces[i]) else { return Some(next.1) };
        let span = next.0 - before.0;
        Some(if span > 0.0 { before.1.lerp(&next.1, (share - before.0) / span) } else { next.1 })
    }
}

impl Point {
    fn cutting<'a>(&self, laws: &'a [Law]) -> Cutting<'a> {
        match self.load {
            PointLoad::Air => Cutting::Air,
            PointLoad::Constant { force, .. } => Cutting::Constant(force),
            PointLoad::Law { law, wobj_from_feed, .. } => Cutting::Law { law: &laws[law], wobj_from_feed },
        }
    }

    /// Nominal motor angles and the direction of travel into them.
    pub(super) fn as_programmed(&self) -> (&Joints, &Joints) {
        (&self.motor, &self.travel)
    }

    /// The joints after the motion as programmed.
    pub(super) fn step(&self) -> Dragged {
        Dragged { motor: self.motor, twist: self.twist(), travel: self.travel }
    }

    /// Twists of the gears under the cutting force, rad.
    #[doc(hidden)]
    pub fn twist(&self) -> Joints {
        self.torque.as_ref().map_or_else(Joints::zeros, |torque| torque.twist_rad)
    }

    pub(super) fn site<'a>(&'a self, setting: &'a Setting, laws: &'a [Law]) -> Site<'a> {
        let leaned = matches!(self.load, PointLoad::Law { leaned: true, .. });
        Site {
            setting,
            wobj_from_tcp: &self.reference,
            cutting: self.cutting(laws),
            leaned,
            normal: self.normal,
            velocity: self.velocity,
            cut_length: self.cut_length,
            time: self.time,
            temperature: self.temperature,
            payload: self.payload,
            units: self.units(),
            part: self.part.as_deref().map(PartAt::in_wobj),
            torque: self.torque.as_deref(),
        }
    }

    fn units(&self) -> &[UnitAt] {
        self.moved.as_ref().map_or(&[], |moved| &moved.units)
    }

    pub(super) fn situation<'a>(&'a self, setting: &Setting, laws: &'a [Law]) -> Situation<'a> {
        if setting.held {
            return self.mirrored(setting, laws);
        }
        Situation {
            base_from_wobj: setting.base_from_wobj,
            gravity: setting.gravity,
            wobj_from_tcp: self.reference,
            tool: setting.tool,
            cutting: self.cutting(laws),
            normal: self.normal,
            velocity: self.velocity,
            cut_length: self.cut_length,
            time: self.time,
            temperature: self.temperature,
            payload: self.payload,
            units: self.units(),
            part: self.part.as_deref().map(PartAt::in_wobj),
            torque: self.torque.as_deref(),
        }
    }

    /// The situation of a part that the robot holds against a stationary tool: the point of the part that is at the tool takes the role of
    /// the TCP, the tool takes that of the work object, and forces, normals and velocities change their signs.
    fn mirrored<'a>(&'a self, setting: &Setting, laws: &'a [Law]) -> Situation<'a> {
        let tool_from_wobj = self.reference.rotation.inverse();
        let flange_from_tcp = setting.tool.flange_from_tcp * self.reference;
        let cutting = match self.cutting(laws) {
            Cutting::Constant(force) => Cutting::Constant(-(tool_from_wobj * force)),
            Cutting::Law { wobj_from_feed, .. } => {
                let PointLoad::Law { law, .. } = self.load else { unreachable!("only a force law gives Cutting::Law") };
                Cutting::Law { law: &laws[law].mirrored, wobj_from_feed: tool_from_wobj * wobj_from_feed }
            }
            Cutting::Air => Cutting::Air,
        };
        Situation {
            wobj_from_tcp: Pose::identity(),
            tool: ToolFrame { flange_from_tcp, ..setting.tool },
            cutting,
            normal: -(tool_from_wobj * self.normal),
            velocity: -(tool_from_wobj * self.velocity),
            part: self.part.as_deref().map(|yields| PartAt { yields, wobj_from_part: tool_from_wobj }),
            ..self.situation(&Setting { held: false, ..*setting }, laws)
        }
    }

    /// The TCP in the work object, from the TCP in the work object of [`Point::situation`].
    pub(super) fn seen(&self, setting: &Setting, pose: Pose) -> Pose {
        if setting.held { self.reference * pose.inverse() } else { pose }
    }

    /// The same for a predicted pose with its sensitivities.
    pub(super) fn seen_from_wobj(&self, setting: &Setting, there: PredictedPose) -> PredictedPose {
        if !setting.held {
            return there;
        }
        let (wobj_from_tool, back) = (self.reference.rotation, Rotation3::from_scaled_axis(-there.turn));
        PredictedPose {
            shift: -(wobj_from_tool * (back * there.shift)),
            turn: -(wobj_from_tool * there.turn),
            axis: -(wobj_from_tool * (back * Vector3::z())),
            cut: -(wobj_from_tool * there.cut),
            ..there
        }
    }

    /// A point that was measured with its motor angles, without a program, in the base; see [`Prepared::of_points`].
    #[doc(hidden)]
    pub fn measured(base_from_tcp: Pose, motor: Joints, travel: Joints) -> Self {
        Self {
            setting: 0,
            moved: None,
            unsolved: None,
            wobj_from_tcp: base_from_tcp,
            reference: base_from_tcp,
            motor,
            travel,
            normal: tool_axis(&base_from_tcp),
            velocity: Vector3::zeros(),
            cut_length: 0.0,
            time: 0.0,
            temperature: None,
            payload: 0.0,
            load: PointLoad::Air,
            arc_turn: ArcTurn::default(),
            turned_by_arc: false,
            through: None,
            plunges: false,
            milled: None,
            part: None,
            torque: None,
        }
    }

    /// A target whose pose is unknown, after another point. The arm is approximately at these motor angles (rad), with this travel.
    pub(super) fn unsolved(
        why: KeptReason,
        at: Pose,
        Dragged { motor, travel, .. }: Dragged,
        setting: u32,
        previous: Option<&Self>,
    ) -> Self {
        Self {
            setting,
            unsolved: Some(why),
            cut_length: previous.map_or(0.0, |previous| previous.cut_length),
            time: previous.map_or(0.0, |previous| previous.time),
            ..Self::measured(at, motor, travel)
        }
    }

    /// Whether the pose of the target is known.
    pub(super) fn is_located(&self) -> bool {
        self.unsolved.is_none_or(|why| matches!(why, KeptReason::PredecessorUnknown | KeptReason::CutUnknown))
    }

    /// Sets a measured force, N, in base axes while the point's work object is the base.
    #[doc(hidden)]
    pub fn set_force(&mut self, force: Vector3<f64>) {
        self.load = PointLoad::Constant { force, follows: Follows::WorkObject };
    }

    /// Turns a measured force from other axes into those of the work object.
    pub(super) fn turn_measured_force(&mut self, wobj_from_other: &Rotation3<f64>) {
        if let PointLoad::Constant { force, follows: Follows::WorkObject } = &mut self.load {
            *force = wobj_from_other * *force;
        }
    }

    /// Compliance of the part at a share of the segment from this point to another one.
    pub(super) fn part_between(&self, to: &Self, share: f64) -> Option<Arc<PartYield>> {
        match (&self.part, &to.part) {
            (Some(before), Some(after)) if self.setting == to.setting => {
                Some(Arc::new(PartYield::mixed([(&**before, 1.0 - share), (&**after, share)])))
            }
            (before, after) => after.clone().or_else(|| before.clone()),
        }
    }

    /// Compliance of the part; `None` if it is not cut here or its compliance is unknown.
    #[doc(hidden)]
    pub fn yielding_part(&self) -> Option<&PartYield> {
        self.part.as_deref().filter(|_| self.cuts())
    }

    /// Number of clamps of the part; 0 if its compliance is unknown.
    #[doc(hidden)]
    pub fn clamps(&self) -> usize {
        self.part.as_ref().map_or(0, |part| part.clamps())
    }

    /// Displacement of the point on the part for a unit motion of a clamp along x, y or z (0 to 2) of the stock, work object axes; `None` if
    /// unknown.
    #[doc(hidden)]
    pub fn clamp_motion(&self, clamp: usize, axis: usize) -> Option<Vector3<f64>> {
        self.part.as_ref()?.motions.get(3 * clamp + axis).copied()
    }

    /// Whether a cutting force acts.
    #[must_use]
    #[doc(hidden)]
    pub fn cuts(&self) -> bool {
        !matches!(self.load, PointLoad::Air)
    }

    /// Error at the contact point along the surface normal, m (Tang et al., Eq. 15), for the TCP's shift and the actual tool
    /// axis.
    pub(super) fn normal_error(&self, laws: &[Law], shift: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
        let mut error = shift.dot(&self.normal);
        if let PointLoad::Law { law, wobj_from_feed, leaned } = &self.load {
            let law = &laws[*law];
            let height = |axis: &Vector3<f64>| {
                let axis = wobj_from_feed.inverse_transform_vector(axis);
                law.milling.contact_height(&Unit::new_unchecked(axis))
            };
            let wanted = if *leaned { law.height } else { height(&tool_axis(&self.reference)) };
            if let (Some(now), Some(wanted)) = (height(axis), wanted) {
                error += now - wanted;
            }
        }
        error
    }
}

/// Tool axis, tip to spindle: −z of the TCP frame.
pub(super) fn tool_axis(pose: &Pose) -> Vector3<f64> {
    -pose.rotation.matrix().column(2)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp)] // the numbers are exact in binary

    use super::{FedForce, Milled};
    use nalgebra::Vector3;

    #[test]
    fn a_part_of_a_segment_has_the_forces_at_its_own_shares() {
        let force = |n: f64| FedForce { programmed: Vector3::new(n, 0.0, 0.0), fed: Vector3::zeros() };
        let forces = [(0.0, force(0.0)), (0.5, force(50.0)), (1.0, force(300.0))].into();
        let whole = Milled { removed: 8.0, engaged: Some([0.002, 1.0]), forces, ..Milled::default() };
        let at = |milled: &Milled, share: f64| milled.at(share).unwrap().programmed.x;
        // From 25 N, over 50 N half way, to the middle between 50 and 300 N.
        let middle = whole.between(0.25, 0.75);
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(|share| at(&middle, share)), [25.0, 37.5, 50.0, 175.0]);
        assert_eq!((middle.removed, middle.engaged), (4.0, None));
        assert_eq!(whole.between(0.75, 1.0).engaged, Some([0.002, 1.0]));
        // Two points at the same place.
        let none = whole.between(0.5, 0.5);
        assert_eq!([0.0, 1.0].map(|share| at(&none, share)), [50.0, 50.0]);
        assert_eq!(none.removed, 0.0);
    }
}
