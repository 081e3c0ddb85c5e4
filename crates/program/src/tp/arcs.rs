//! Arcs: the points of an arc are edited together or not at all. `A` motions have one point each, and form arcs with their neighbours.
//!
//! The first of consecutive `A` motions is a line. The second and the third follow the circle through the first three points, and each
//! later one the circle through its own point and the two before. At least three are needed. Source: FANUC, R-30iB Operator's Manual (Basic
//! Operation), circle arc motion; robot-forum.com, thread 43838.

use super::builder::{Between, Builder, EditablePosition, Visit, are_in_one_frame, refuse};
use crate::orientation::halfway;
use crate::{Editable, Goal, Motion as Path, Reason, Role, Target};
use deflex_lang::tp::{Code, StatementKind};
use nalgebra::{Unit, Vector3};
use std::collections::BTreeSet;
use std::ops::Range;

/// Least number of consecutive `A` motions that form an arc.
const FEWEST_MOTIONS: usize = 3;

/// Consecutive `A` motions, as ranges of statements; only remarks may be between them.
pub(super) fn rows(code: &Code<'_>) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    let mut open = false;
    for (at, (line, kind)) in code.lines.iter().zip(&code.kinds).enumerate() {
        let remark =
            || [&b"!"[..], b"//", b"--"].iter().any(|sign| line.text.starts_with(sign)) || line.text.is_empty();
        match kind {
            StatementKind::Motion(motion) if motion.is_arc => match found.last_mut().filter(|_| open) {
                Some(row) => row.end = at + 1,
                None => found.push(at..at + 1),
            },
            _ if remark() => continue,
            _ => {}
        }
        open = matches!(kind, StatementKind::Motion(motion) if motion.is_arc);
    }
    found
}

/// The middle of the arc from the first to the second of three points, or from the second to the third; the middle of the chord if the
/// points are on a line.
pub(super) fn middle([a, b, c]: [[f64; 3]; 3], first_half: bool) -> [f64; 3] {
    let [a, b, c] = [a, b, c].map(Vector3::from);
    let (from, to) = if first_half { (a, b) } else { (b, c) };
    let chord = (from + to) / 2.0;
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(&ac);
    // Angles at a corner below 1e-9 rad are none: the circle of printed digits could be anywhere.
    let Some(axis) = Unit::try_new(normal, 1e-9 * ab.norm() * ac.norm()).filter(|_| normal != Vector3::zeros()) else {
        return chord.into();
    };
    // Circumcentre of a triangle from a corner.
    let to_centre =
        (ac.norm_squared() * normal.cross(&ab) + ab.norm_squared() * ac.cross(&normal)) / (2.0 * normal.norm_squared());
    let centre = a + to_centre;
    let (u, v) = (from - centre, to - centre);
    let angle = u.cross(&v).dot(&axis).atan2(u.dot(&v)).rem_euclid(std::f64::consts::TAU);
    (centre + nalgebra::Rotation3::from_axis_angle(&axis, angle / 2.0) * u).into()
}

impl<'a> Builder<'a> {
    /// Adds the consecutive `A` motions at the beginning of `visits`. Returns how many of them run.
    pub(super) fn row(&mut self, visits: &[Visit<'a>], row: Range<usize>) -> usize {
        let on = |two: &&[Visit<'a>]| row.contains(&two[1].at) && two[1].at > two[0].at;
        let run = 1 + visits.windows(2).take_while(on).count();
        let kinds = &self.code.kinds;
        let motions =
            || kinds[row.clone()].iter().filter(|kind| matches!(kind, StatementKind::Motion(motion) if motion.is_arc));
        let (count, mut points) = (motions().count(), Vec::with_capacity(run));
        for visit in &visits[..run] {
            self.built.motions += 1;
            match self.point(visit, Role::End) {
                Ok(point) => points.push((*visit, point)),
                Err(why) => self.lose(visit, why),
            }
        }
        let own: Vec<(Target, EditablePosition)> = points.iter().map(|(_, point)| point.clone()).collect();
        let poses: Option<Vec<_>> = own
            .iter()
            .map(|(target, _)| match target.goal {
                Goal::Pose { position_mm, quat, .. } => Some((position_mm, quat)),
                _ => None,
            })
            .collect();
        match poses.filter(|poses| poses.len() == count && count >= FEWEST_MOTIONS && are_in_one_frame(&own)) {
            Some(poses) => self.arc(points, &poses),
            None => {
                let why = if count < FEWEST_MOTIONS { Reason::FewArcs } else { Reason::Arc };
                for (visit, (mut target, site)) in points {
                    refuse(&mut target, why);
                    self.push(&visit, (target, site));
                }
            }
        }
        run
    }

    /// Targets of consecutive `A` motions whose points are all known, with a circle point on the path to each except the first.
    fn arc(&mut self, points: Vec<(Visit<'a>, (Target, EditablePosition))>, poses: &[([f64; 3], [f64; 4])]) {
        let first = self.built.targets.len();
        // There is a circle point between two points.
        let index = |k: usize| first + 2 * k;
        for (k, (visit, (mut target, site))) in points.into_iter().enumerate() {
            if let Some(before) = k.checked_sub(1) {
                let start = before.saturating_sub(1);
                let first_half = k == 1;
                let position_mm = middle([start, start + 1, start + 2].map(|k| poses[k].0), first_half);
                let goal = Goal::Pose { position_mm, quat: halfway(poses[before].1, poses[k].1), conf: None };
                self.built.between.push(Between {
                    target: index(k) - 1,
                    circle: [start, start + 1, start + 2].map(index),
                    first_half,
                });
                target.motion = Path::Circular;
                self.built.arcs += 1;
                let via = Target { role: Role::Via, goal, name: None, ..target.clone() };
                self.push(&visit, (via, None));
            }
            self.push(&visit, (target, site));
        }
        self.built.points.push(first..self.built.targets.len());
    }

    /// Keeps all points of an arc if one of them must stay, and with them every arc that shares one of these positions.
    pub(super) fn keep_halves_of_arcs(&mut self) {
        let built = &mut self.built;
        loop {
            let mut held = BTreeSet::new();
            for points in &built.points {
                let stays = |i: usize| matches!(built.targets[i].editable, Editable::No(_));
                if points.clone().any(stays) && !points.clone().all(stays) {
                    held.extend(points.clone().filter_map(|i| built.sites[i]));
                    points.clone().for_each(|i| refuse(&mut built.targets[i], Reason::Arc));
                }
            }
            if held.is_empty() {
                return;
            }
            for (target, site) in built.targets.iter_mut().zip(&built.sites) {
                if site.is_some_and(|site| held.contains(&site)) {
                    refuse(target, Reason::Arc);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_middle_is_on_the_way() {
        // Radius 2 about (1, 0, 5): east, north, west; and on from there over the south.
        let [east, north, west] = [[3.0, 0.0, 5.0], [1.0, 2.0, 5.0], [-1.0, 0.0, 5.0]];
        let on = |x: f64, y: f64| [1.0 + 2.0 * x, 2.0 * y, 5.0];
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (points, first_half, wanted) in [
            ([east, north, west], true, on(half, half)),
            ([east, north, west], false, on(-half, half)),
            ([north, west, east], false, on(0.0, -1.0)),
            ([west, north, east], true, on(-half, half)),
        ] {
            for (found, wanted) in middle(points, first_half).into_iter().zip(wanted) {
                assert_relative_eq!(found, wanted, epsilon = 1e-12);
            }
        }
        assert_eq!(middle([[0.0; 3], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]], false).to_vec(), [2.0, 0.0, 0.0]);
        assert_eq!(middle([[1.0; 3]; 3], true).to_vec(), [1.0; 3]);
    }
}
