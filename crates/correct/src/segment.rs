//! A segment is the motion of the controller between two targets; the force on it is a law over its length.
//!
//! The cut of a segment is the same over all of its length, also at its start, where the target before has the correction of
//! *its own* cut. [`Segment::at`] alone gives the point anywhere on the segment: the programmed pose, and the load there
//! ([`Segment::load`]). A force that changes along the segment, such as that of a stock, has its value at that point.

use super::Prepared;
use super::laws::Law;
use super::load::{Follows, PointLoad};
use super::loads_before::torque_between;
use super::mount::{Mount, Moved};
use super::point::{Point, tool_axis};
use deflex_cutting::Lean;
use deflex_drive::Track;
use deflex_equilibrium::{Dragged, Setting};
use deflex_program::{ArcTurn, Motion, Program, Role};
use deflex_robot::{Joints, Pose};
use nalgebra::{Unit, Vector3};
use std::sync::Arc;

/// The start of a segment: a solved target.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub(super) point: Point,
    pub(super) setting: Setting,
    /// Commanded pose.
    pub(super) commanded: Pose,
    /// Motor angles there, rad.
    pub(super) motor: Joints,
    /// Travel of the joints there.
    pub(super) travel: Joints,
    /// Unit vector along the path that ends there, base axes; `None` if no path does.
    pub(super) tangent: Option<Vector3<f64>>,
    /// Error of the tip there, m; 0 if it is unknown.
    pub(super) left: f64,
}

/// A segment that is a line or an arc.
#[derive(Clone, Debug)]
pub(super) struct Segment<'p> {
    /// Index of the target that it ends at.
    pub(super) end: usize,
    /// The programmed curve.
    pub(super) track: Track,
    from: &'p Point,
    to: &'p Point,
    mount: &'p Mount,
    laws: &'p [Law],
    /// Whether the path has a corner at the start of the segment, or begins there.
    pub(super) corner: bool,
}

/// Cosine of the turn beyond which a path has a corner (5°).
pub(super) const SMOOTH: f64 = 0.996;

impl Start {
    /// The joints there.
    pub(super) fn dragged(&self) -> Dragged {
        Dragged { motor: self.motor, twist: self.point.twist(), travel: self.travel }
    }

    /// A pose of this target with the tool and the work object of target `i`, at the same joints and units; `None` if the position of that
    /// work object was unknown.
    pub(super) fn seen(&self, pose: &Pose, prepared: &Prepared, i: usize) -> Option<Pose> {
        let setting = if prepared.points[i].setting == self.point.setting {
            return self.fits(prepared, i).then_some(*pose);
        } else {
            prepared.mount(i).at(self.point.moved.as_ref())?
        };
        if setting == self.setting {
            return Some(*pose);
        }
        Some(setting.wobj_from_tcp(&self.setting.base_from_flange(pose)))
    }

    /// Whether the positions of base and work object of target `i` are known here.
    fn fits(&self, prepared: &Prepared, i: usize) -> bool {
        prepared.points[i].moved.is_none() || prepared.mount(i).at(self.point.moved.as_ref()).is_some()
    }
}

/// The kind of the segment to a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Line,
    /// An arc through the circle point before.
    Arc,
    /// A joint motion: no path is programmed.
    Joint,
    /// A circle point, which has no segment of its own.
    Point,
}

impl Kind {
    pub(super) fn of(program: &Program, i: usize) -> Self {
        let target = &program.targets[i];
        let via = || i.checked_sub(1).map(|via| &program.targets[via]).filter(|via| via.role == Role::Via);
        match (target.role, target.motion) {
            (Role::Via, _) => Self::Point,
            _ if target.external.as_ref().is_some_and(|external| external.moved_alone) => Self::Joint,
            (_, Motion::Joint | Motion::AbsoluteJoint) => Self::Joint,
            (_, Motion::Circular) if via().is_some_and(|via| via.ordinal == target.ordinal) => Self::Arc,
            // Chords of an arc are lines.
            _ => Self::Line,
        }
    }
}

/// Indices of the targets that are [waypoints](super::course::Course::waypoints): all except the circle points of arcs.
pub(super) fn waypoint_targets(program: &Program) -> Vec<usize> {
    (0..program.targets.len()).filter(|i| Kind::of(program, *i) != Kind::Point).collect()
}

impl<'p> Segment<'p> {
    /// The segment to target `i` from `start`; `None` if it is neither a line nor an arc.
    pub(super) fn into(program: &Program, prepared: &'p Prepared, i: usize, start: &'p Start) -> Option<Self> {
        let to = &prepared.points[i];
        let track = Self::track(program, prepared, i, &start.seen(&start.point.reference, prepared, i)?)?;
        let (mount, laws) = (prepared.mount(i), &prepared.shared.laws);
        let mut segment = Self { end: i, track, from: &start.point, to, mount, laws, corner: true };
        let rotation = segment.setting(0.0).base_from_wobj.rotation;
        let leaving = segment.track.tangent(0.0).map(|tangent| rotation * tangent);
        segment.corner = !start.tangent.zip(leaving).is_some_and(|(a, b)| a.dot(&b) > SMOOTH);
        Some(segment)
    }

    /// The segment of a known kind between two points in work objects that stand still; `None` if it is neither a line nor an arc.
    pub(super) fn between(kind: Kind, prepared: &'p Prepared, begin: usize, end: usize) -> Option<Self> {
        let (from, to) = (&prepared.points[begin], &prepared.points[end]);
        let [was, is] = [begin, end].map(|i| prepared.setting(i));
        let start = match was == is {
            true => from.reference,
            false => is.wobj_from_tcp(&was.base_from_flange(&from.reference)),
        };
        let track = Self::track_of_kind(kind, prepared, end, &start)?;
        let (mount, laws) = (prepared.mount(end), &prepared.shared.laws);
        Some(Self { end, track, from, to, mount, laws, corner: true })
    }

    /// The programmed curve to target `i` from a pose.
    pub(super) fn track(program: &Program, prepared: &Prepared, i: usize, from: &Pose) -> Option<Track> {
        Self::track_of_kind(Kind::of(program, i), prepared, i, from)
    }

    fn track_of_kind(kind: Kind, prepared: &Prepared, i: usize, from: &Pose) -> Option<Track> {
        let to = &prepared.points[i].reference;
        match kind {
            Kind::Joint | Kind::Point => None,
            Kind::Line => Some(Track::line(from, to)),
            Kind::Arc => Some(Track::arc(from, &prepared.points[i - 1].reference, to, prepared.points[i].arc_turn)),
        }
    }

    /// How the controller turns the tool on the segment if it is an arc.
    pub(super) fn arc_turn(&self) -> ArcTurn {
        self.to.arc_turn
    }

    /// Positions of units at a share of the segment.
    pub(super) fn moved(&self, share: f64) -> Option<Arc<Moved>> {
        self.mount.between(self.from.moved.as_ref(), self.to.moved.as_ref(), share)
    }

    /// The setting at a share of the segment.
    pub(super) fn setting(&self, share: f64) -> Setting {
        self.moved(share).map_or(self.mount.setting, |moved| moved.setting)
    }

    /// The point at a share of the segment, with the command at the programmed pose and at the programmed speed. Motor angles and direction
    /// of travel are those of the end.
    pub(super) fn at(&self, share: f64) -> Point {
        self.at_speed(share, 1.0)
    }

    /// The same at a share of the programmed speed, on which the force of a cut from stock depends.
    pub(super) fn at_speed(&self, share: f64, speed: f64) -> Point {
        let wobj_from_tcp = self.track.pose(share);
        let tangent = self.track.tangent(share);
        let (from, to) = (self.from, self.to);
        let milled = self.to.milled.as_ref().and_then(|milled| milled.at(share)).map(|force| force.at(speed));
        let load = match milled {
            Some(force) => PointLoad::of_stock(force),
            None => self.load(&wobj_from_tcp, tangent.as_ref()),
        };
        let normal = match load {
            PointLoad::Law { wobj_from_feed, .. } => wobj_from_feed.matrix().column(2).into(),
            // The normal at the end, turned with the tool.
            _ if self.track.keeps_orientation() => to.normal,
            _ => wobj_from_tcp.rotation * to.reference.rotation.inverse_transform_vector(&to.normal),
        };
        let between = |a: f64, b: f64| a + share * (b - a);
        let speed = to.velocity.norm();
        let moved = self.moved(share);
        // Seen from the arm, units move too.
        let along = tangent.filter(|_| to.moved.is_none());
        Point {
            moved,
            wobj_from_tcp,
            reference: wobj_from_tcp,
            normal,
            velocity: along.map_or(to.velocity, |tangent| tangent * speed),
            cut_length: if to.cuts() { between(from.cut_length, to.cut_length) } else { to.cut_length },
            time: between(from.time, to.time),
            load,
            part: from.part_between(to, share),
            torque: torque_between(from, to, share),
            ..to.clone()
        }
    }

    /// The load at a programmed pose where the path has the direction `tangent`.
    fn load(&self, pose: &Pose, tangent: Option<&Vector3<f64>>) -> PointLoad {
        let straight = self.track.keeps_orientation() && !self.track.is_arc();
        let feed_frame = |lean: &Lean, axis: Vector3<f64>, tangent: Option<&Vector3<f64>>| {
            tangent.and_then(|tangent| lean.feed_frame(&Unit::new_unchecked(axis), tangent))
        };
        match self.to.load {
            PointLoad::Law { law, .. } if !straight => {
                let frame = feed_frame(&self.laws[law].lean, tool_axis(pose), tangent);
                frame.map_or(self.to.load, |wobj_from_feed| PointLoad::Law { law, wobj_from_feed, leaned: true })
            }
            PointLoad::Constant { force, follows: Follows::Tool } if !straight => PointLoad::Constant {
                force: pose.rotation * self.to.reference.rotation.inverse_transform_vector(&force),
                follows: Follows::Tool,
            },
            PointLoad::Constant { force, follows: Follows::Feed(in_feed) } if !straight => {
                let frame = feed_frame(&Lean::new(0.0, 0.0), tool_axis(pose), tangent);
                let force = frame.map_or(force, |frame| frame * in_feed);
                PointLoad::Constant { force, follows: Follows::Feed(in_feed) }
            }
            load => load,
        }
    }
}

/// Turns the force of arcs with the path: their points get the force for the direction of the arc there, as when the arc is divided into
/// many, instead of the direction of the chord from the point before.
pub(super) fn follow_arcs(program: &Program, prepared: &mut Prepared) {
    for i in (0..prepared.points.len()).filter(|i| Kind::of(program, *i) == Kind::Arc) {
        let before = (0..i).rev().find(|before| Kind::of(program, *before) != Kind::Point);
        let before = before.map(|before| &prepared.points[before]).or(prepared.before.as_ref());
        let Some(from) = before.filter(|before| before.setting == prepared.points[i].setting) else { continue };
        let Some(track) = Segment::track(program, prepared, i, &from.reference) else { continue };
        let Some(via) = track.via() else { continue };
        let (to, mount, laws) = (&prepared.points[i], prepared.mount(i), &prepared.shared.laws);
        let segment = Segment { end: i, track, from, to, mount, laws, corner: false };
        let [at_via, at_end] = [via, 1.0].map(|share| segment.at(share));
        for (i, there) in [(i - 1, at_via), (i, at_end)] {
            if prepared.points[i].cuts() {
                (prepared.points[i].load, prepared.points[i].normal) = (there.load, there.normal);
            }
        }
    }
}
