//! The positions on the segment to a target at which the cut of the tool is computed.

use super::super::Prepared;
use super::super::driven::DrivenPoint;
use super::super::segment::Kind;
use super::{Cuts, Walk};
use deflex_drive::Track;
use deflex_robot::Pose;

/// Largest distance between two computed forces on a segment, m: the engagement changes within a fraction of a cutter.
const ENGAGEMENT_STEP: f64 = 2e-3;
/// Share of that distance that the rounding of a program's digits may add.
const PRINTED: f64 = 1e-3;
/// Most positions on a segment.
const MOST_PLACES: usize = 500;
/// Length of the chords of an arc, m: 5 µm off a radius of 6 mm.
const CHORD_OF_ARC: f64 = 0.5e-3;
/// Steps of a turn of the tool, rad.
const TURN: f64 = 0.05;
/// Steps of a joint motion, rad: a centimetre at a metre.
const JOINT_STEP: f64 = 0.01;

/// Largest distance of the driven path from the line between two positions, m: below the digits in which the part is reported.
pub(super) const BEND: f64 = 1e-6;
/// Largest change of its speed, as a share of the programmed one: below the accuracy of the coefficients of a material.
const SPEED: f64 = 1.0 / 16.0;

/// A position on the segment to a target.
pub(super) struct Place {
    pub(super) share: f64,
    /// The pose of the unloaded TCP, in the work object of the target.
    pub(super) pose: Pose,
    /// The driven point, if it is on a driven path.
    pub(super) driven: Option<Box<DrivenPoint>>,
}

impl Place {
    fn programmed(share: f64, pose: Pose) -> Self {
        Self { share, pose, driven: None }
    }
}

impl Walk<'_> {
    /// The positions on the driven segment to target `i`, after its start, and its length, m; `None` if the commanded path is used.
    pub(super) fn driven_places(&mut self, prepared: &mut Prepared, i: usize) -> Option<(Vec<Place>, f64)> {
        let motion = self.motion.as_mut()?;
        let samples = motion.range_before(i)?;
        let setting = *prepared.setting(i);
        // The first segment begins with its first sample.
        let first = samples.start.saturating_sub(1);
        let poses: Vec<Pose> = (first..samples.end).map(|sample| motion.pose(&setting, sample)).collect();
        let at = |sample: usize| poses[sample - first].translation.vector;
        let fits = |from: usize, to: usize| {
            let displacement = at(to) - at(from);
            let square = displacement.norm_squared();
            let aside = |sample: usize| {
                let off = at(sample) - at(from);
                let share = if square > 0.0 { (off.dot(&displacement) / square).clamp(0.0, 1.0) } else { 0.0 };
                (off - displacement * share).norm()
            };
            square <= ENGAGEMENT_STEP.powi(2)
                && (motion.speed(to) - motion.speed(from)).abs() <= SPEED
                && poses[from - first].rotation.angle_to(&poses[to - first].rotation) <= TURN
                && (from + 1..to).all(|sample| aside(sample) <= BEND)
        };
        let mut kept = Vec::new();
        let mut from = first;
        for sample in samples.clone() {
            let is_last = sample + 1 == samples.end;
            if is_last || !fits(from, sample + 1) {
                kept.push(sample);
                from = sample;
            }
        }
        let points = motion.points(prepared, &kept);
        let begin = poses.first().map(|pose| Place::programmed(0.0, *pose));
        let place = |(sample, driven): (&usize, DrivenPoint)| Place {
            share: motion.share(*sample),
            pose: poses[*sample - first],
            driven: Some(Box::new(driven)),
        };
        let places: Vec<Place> = begin.into_iter().chain(kept.iter().zip(points).map(place)).collect();
        let step = |pair: &[Place]| (pair[1].pose.translation.vector - pair[0].pose.translation.vector).norm();
        let length = places.windows(2).map(step).sum();
        Some((places, length))
    }

    /// The positions on the segment to target `i`, of which the last is the target, and the length of a line or an arc, m.
    pub(super) fn places(&self, prepared: &Prepared, i: usize, needs_engagement: bool) -> (Vec<Place>, f64) {
        let point = &prepared.points[i];
        let goal = self.goal(point);
        let end = Place::programmed(1.0, goal);
        let kind = Kind::of(self.program, i);
        let before = match kind {
            Kind::Arc => i.checked_sub(2),
            _ => i.checked_sub(1),
        };
        let Some(before) = before else { return (vec![end], 0.0) };
        let from = &prepared.points[before];
        if from.unsolved.is_some() || point.unsolved.is_some() {
            return (vec![end], 0.0);
        }
        let (setting, mount) = (prepared.setting(before), prepared.mount(i));
        if kind == Kind::Joint {
            let displacement = point.motor - from.motor;
            let n = ((displacement.amax() / JOINT_STEP).ceil() as usize).clamp(1, 4 * MOST_PLACES);
            let place = |k: usize| {
                let share = k as f64 / n as f64;
                let motor = from.motor + displacement * share;
                let moved = mount.between(from.moved.as_ref(), point.moved.as_ref(), share);
                let own = moved.as_ref().map_or(&mount.setting, |moved| &moved.setting);
                let base_from_tcp = self.arm.robot.forward(&motor) * own.tool.flange_from_tcp;
                Place::programmed(share, own.base_from_wobj.inv_mul(&base_from_tcp))
            };
            let places = (0..n).map(place).chain([end]).collect();
            return (places, 0.0);
        }
        // The same flange, with this target's tool and work object.
        let base_from_flange = setting.base_from_wobj * self.goal(from) * setting.tool.flange_from_tcp.inverse();
        let own = mount.at(from.moved.as_ref());
        let start = if from.setting == point.setting || own.as_ref() == Some(setting) {
            self.goal(from)
        } else {
            let Some(own) = own else { return (vec![end], 0.0) };
            own.base_from_wobj.inv_mul(&(base_from_flange * own.tool.flange_from_tcp))
        };
        let track = match kind {
            Kind::Arc => Track::arc(&start, &self.goal(&prepared.points[i - 1]), &goal, point.arc_turn),
            _ => Track::line(&start, &goal),
        };
        let length = track.length();
        let turn = start.rotation.angle_to(&goal.rotation);
        let mut n = (turn / TURN).ceil().max(1.0);
        if track.is_arc() {
            n = n.max(length / CHORD_OF_ARC).min(20_000.0);
        } else if needs_engagement || self.cuts != Cuts::Programmed {
            // Steps of exactly that length, as printed, are not halved.
            n = n.max((length / ENGAGEMENT_STEP - PRINTED).min(MOST_PLACES as f64));
        }
        let n = n.ceil() as usize;
        let place = |k: usize| {
            let share = k as f64 / n as f64;
            Place::programmed(share, track.pose(share))
        };
        let places = (0..n).map(place).chain([end]).collect();
        (places, length)
    }
}
