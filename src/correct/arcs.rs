//! What corrected arcs miss between their points.
//!
//! A `MoveC` is given by three points, and these are corrected; the controller draws the circle through them. In the middle
//! of each half the correction that would be needed is solved, and held against that circle.

use super::Prepared;
use crate::cell::Cell;
use crate::program::{Change, Language, Program, Role};
use crate::robot::{Joints, Pose};
use crate::text::{Diagnostic, Severity};
use nalgebra::{Rotation3, Translation3, Unit, Vector3};

/// Less is below what is printed of a position, m.
const SAID_FROM: f64 = 1e-6;

/// A note on the arc that misses most, where any does.
pub(super) fn note(
    program: &Program,
    cell: &Cell,
    prepared: &Prepared,
    motors: &[Joints],
    changes: &[Option<Change>],
    written: &[([f64; 3], [f64; 4])],
) -> Option<Diagnostic> {
    let corrected = |via: usize| {
        let [before, arc, end] = [via - 1, via, via + 1].map(|i| program.targets.get(i));
        let (before, arc, end) = (before?, arc?, end?);
        let one = arc.role == Role::Via && before.wobj == arc.wobj && before.tool == arc.tool;
        let changed = changes[via].is_some() && changes[via + 1].is_some();
        (one && changed && program.language == Language::Rapid && arc.ordinal == end.ordinal).then_some(via)
    };
    let arcs: Vec<usize> = (1..program.targets.len()).filter_map(corrected).collect();
    let missed = |&via: &usize| Some((miss(cell, prepared, motors, written, via)?, via));
    let (most, via) = arcs.iter().filter_map(missed).max_by(|a, b| a.0.total_cmp(&b.0)).filter(|m| m.0 > SAID_FROM)?;
    let target = &program.targets[via];
    let count = if arcs.len() == 1 { "the arc is".to_owned() } else { format!("{} arcs are", arcs.len()) };
    let message =
        format!("{count} corrected at circle point and end; between them up to {:.4} mm are left", 1e3 * most);
    let note = Diagnostic::error("correct.arc", "", message).severity(Severity::Note);
    let source = &program.sources[usize::from(target.source)];
    Some(note.on_line(source, target.span, target.line).help("where that matters, have shorter arcs or lines posted"))
}

/// Largest distance of the path needed from the circle through the written points, in the middle of the halves, m.
fn miss(
    cell: &Cell,
    prepared: &Prepared,
    motors: &[Joints],
    written: &[([f64; 3], [f64; 4])],
    via: usize,
) -> Option<f64> {
    let places = [via - 1, via, via + 1];
    let programmed = Circle::through(places.map(|i| prepared.points[i].wobj_from_tcp.translation.vector))?;
    let commanded = Circle::through(places.map(|i| 1e-3 * Vector3::from(written[i].0)))?;
    let half = |to: usize| {
        let (from, point) = (&prepared.points[to - 1].wobj_from_tcp, &prepared.points[to]);
        let middle = programmed.between(&from.translation.vector, &point.wobj_from_tcp.translation.vector);
        let way = crate::robot::turn_between(&from.rotation, &point.wobj_from_tcp.rotation);
        let pose = Pose::from_parts(Translation3::from(middle), Rotation3::from_scaled_axis(0.5 * way) * from.rotation);
        // Cut and tool as at the half's end: the chord, along which they are, lies as the arc does in its middle.
        let mut situation = prepared.situation(to);
        situation.wobj_from_tcp = pose;
        let command = cell.arm.command(&situation, &pose, &motors[to], &point.travel).ok()?;
        let base_from_tcp =
            cell.arm.robot.forward(&command.commanded(&point.travel)) * prepared.tool(to).flange_from_tcp;
        let needed = prepared.base_from_wobj(to).inv_mul(&base_from_tcp);
        Some(commanded.distance(&needed.translation.vector))
    };
    Some(half(via)?.max(half(via + 1)?))
}

/// A circle in space, m.
struct Circle {
    centre: Vector3<f64>,
    /// The points that it was made of follow each other counterclockwise about it.
    axis: Unit<Vector3<f64>>,
    radius: f64,
}

impl Circle {
    /// `None` for points on a line.
    fn through([a, b, c]: [Vector3<f64>; 3]) -> Option<Self> {
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(&ac);
        let axis = Unit::try_new(normal, 1e-12)?;
        // Circumcentre of a triangle from a corner.
        let to_centre = (ac.norm_squared() * normal.cross(&ab) + ab.norm_squared() * ac.cross(&normal))
            / (2.0 * normal.norm_squared());
        Some(Self { centre: a + to_centre, axis, radius: to_centre.norm() })
    }

    /// The middle of the way from one of its points to another, counterclockwise.
    fn between(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
        let (a, b) = (from - self.centre, to - self.centre);
        let angle = a.cross(&b).dot(&self.axis).atan2(a.dot(&b)).rem_euclid(std::f64::consts::TAU);
        self.centre + Rotation3::from_axis_angle(&self.axis, 0.5 * angle) * a
    }

    fn distance(&self, point: &Vector3<f64>) -> f64 {
        let from_centre = point - self.centre;
        let above = from_centre.dot(&self.axis);
        let out = (from_centre - above * self.axis.into_inner()).norm() - self.radius;
        out.hypot(above)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_circle_by_hand() {
        // Radius 5 about (1, 2) in the plane z = 3: east, north, west.
        let at = |x: f64, y: f64| Vector3::new(1.0 + x, 2.0 + y, 3.0);
        let circle = Circle::through([at(5.0, 0.0), at(0.0, 5.0), at(-5.0, 0.0)]).expect("no line");
        assert_relative_eq!(circle.centre, at(0.0, 0.0), epsilon = 1e-12);
        let diagonal = 5.0 * std::f64::consts::FRAC_1_SQRT_2;
        assert_relative_eq!(circle.between(&at(5.0, 0.0), &at(0.0, 5.0)), at(diagonal, diagonal), epsilon = 1e-12);
        // More than half way round.
        assert_relative_eq!(circle.between(&at(0.0, 5.0), &at(5.0, 0.0)), at(-diagonal, -diagonal), epsilon = 1e-12);
        assert_relative_eq!(circle.distance(&at(8.0, 0.0)), 3.0, epsilon = 1e-12);
        assert_relative_eq!(circle.distance(&(at(0.0, 2.0) + Vector3::new(0.0, 0.0, 4.0))), 5.0, epsilon = 1e-12);
        assert!(Circle::through([at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0)]).is_none());
    }
}
