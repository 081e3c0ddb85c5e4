//! The curve of the TCP between two poses: a line or an arc, on which the orientation turns evenly.
//!
//! Positions are metres in the work object of the pose at the end of the curve.

use crate::robot::{Pose, turn_between};
use nalgebra::{Rotation3, Translation3, Unit, Vector3};

/// A curve from one pose to another; its parameter is the share of its length from the start.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    from: Pose,
    to: Pose,
    curve: Curve,
    /// Rotation vector by which the orientation turns evenly from the start to the end, rad.
    turn: Vector3<f64>,
}

#[derive(Clone, Debug)]
enum Curve {
    Line,
    Arc {
        circle: Circle,
        /// From the start to the end, counterclockwise about the circle's axis, rad.
        angle: f64,
        /// Share of the circle point.
        via: f64,
    },
}

impl Track {
    /// A line (`MoveL`).
    pub(crate) fn line(from: &Pose, to: &Pose) -> Self {
        Self { from: *from, to: *to, curve: Curve::Line, turn: turn_between(&from.rotation, &to.rotation) }
    }

    /// An arc through a circle point (`MoveC`); the line where the three points lie on one.
    ///
    /// The orientation turns evenly from the start to the end. That of the circle point only chooses between the shorter and the longer way
    /// (RAPID reference manual, `MoveC`): an IRB 6640 keeps the even turn to 0.001° where the orientation of the circle point is 11° off it
    /// (`movec_30_car` and `movec_30_ori` of github.com/hehonglu123/ABB_Primitive_Study).
    pub(crate) fn arc(from: &Pose, via: &Pose, to: &Pose) -> Self {
        let [a, b, c] = [from, via, to].map(|pose| pose.translation.vector);
        let Some(circle) = Circle::through([a, b, c]) else { return Self::line(from, to) };
        let (angle, share) = (circle.angle(&a, &c), circle.angle(&a, &b));
        let share = share / angle;
        let shorter = turn_between(&from.rotation, &to.rotation);
        let longer = shorter.try_normalize(0.0).map_or(shorter, |axis| shorter - std::f64::consts::TAU * axis);
        let off = |turn: &Vector3<f64>| {
            let there = Rotation3::from_scaled_axis(share * turn) * from.rotation;
            turn_between(&there, &via.rotation).norm()
        };
        let turn = if off(&longer) < off(&shorter) { longer } else { shorter };
        Self { from: *from, to: *to, curve: Curve::Arc { circle, angle, via: share }, turn }
    }

    /// Its length, m.
    pub(crate) fn length(&self) -> f64 {
        match &self.curve {
            Curve::Line => (self.to.translation.vector - self.from.translation.vector).norm(),
            Curve::Arc { circle, angle, .. } => circle.radius * angle,
        }
    }

    /// The angle of an arc, rad; 0 for a line.
    pub(crate) fn angle(&self) -> f64 {
        match &self.curve {
            Curve::Line => 0.0,
            Curve::Arc { angle, .. } => *angle,
        }
    }

    /// Angle by which the orientation turns, rad.
    pub(crate) fn turn(&self) -> f64 {
        self.turn.norm()
    }

    /// Share of an arc's circle point.
    pub(crate) fn via(&self) -> Option<f64> {
        match &self.curve {
            Curve::Line => None,
            Curve::Arc { via, .. } => Some(*via),
        }
    }

    pub(crate) fn is_arc(&self) -> bool {
        matches!(self.curve, Curve::Arc { .. })
    }

    /// The position at a share of the length, m.
    pub(crate) fn place(&self, share: f64) -> Vector3<f64> {
        let (a, b) = (self.from.translation.vector, self.to.translation.vector);
        match &self.curve {
            Curve::Line => a.lerp(&b, share),
            Curve::Arc { circle, angle, .. } => circle.turned(&a, share * angle),
        }
    }

    /// The pose at a share of the length.
    pub(crate) fn pose(&self, share: f64) -> Pose {
        let at = self.place(share);
        let rotation = match self.keeps_orientation() {
            true => self.to.rotation,
            false => Rotation3::from_scaled_axis(share * self.turn) * self.from.rotation,
        };
        Pose::from_parts(Translation3::from(at), rotation)
    }

    /// The share of the length at which the curve is nearest to a position.
    pub(crate) fn nearest(&self, place: &Vector3<f64>) -> f64 {
        let (a, b) = (self.from.translation.vector, self.to.translation.vector);
        match &self.curve {
            Curve::Line => {
                let way = b - a;
                let square = way.norm_squared();
                if square > 0.0 { ((place - a).dot(&way) / square).clamp(0.0, 1.0) } else { 1.0 }
            }
            Curve::Arc { circle, angle, .. } => {
                let turned = circle.angle(&a, place);
                let past_end = turned - angle;
                match () {
                    () if past_end <= 0.0 => turned / angle,
                    // Outside the angle of the arc, the end that is nearer.
                    () if past_end < std::f64::consts::TAU - turned => 1.0,
                    () => 0.0,
                }
            }
        }
    }

    /// Unit vector along the curve at a share of its length; `None` where it has no length.
    pub(crate) fn tangent(&self, share: f64) -> Option<Vector3<f64>> {
        let (a, b) = (self.from.translation.vector, self.to.translation.vector);
        match &self.curve {
            Curve::Line => (b - a).try_normalize(0.0),
            Curve::Arc { circle, angle, .. } => {
                let out = circle.turned(&a, share * angle) - circle.centre;
                circle.axis.cross(&out).try_normalize(0.0)
            }
        }
    }

    /// Whether the orientation stays as it is at the end.
    pub(crate) fn keeps_orientation(&self) -> bool {
        self.turn == Vector3::zeros()
    }

    /// The part of a shift from the curve that is across the curve, at a share of its length: that far is the nearest point of the curve.
    pub(crate) fn across(&self, share: f64, shift: &Vector3<f64>) -> Vector3<f64> {
        self.tangent(share).map_or(*shift, |tangent| shift - tangent * tangent.dot(shift))
    }

    /// The same at the start of a curve that begins with a corner: before the start there is no curve.
    pub(crate) fn across_start(&self, shift: &Vector3<f64>) -> Vector3<f64> {
        self.tangent(0.0).map_or(*shift, |tangent| shift - tangent * tangent.dot(shift).max(0.0))
    }
}

/// A circle in space, m.
#[derive(Clone, Debug)]
struct Circle {
    centre: Vector3<f64>,
    /// The points that define the circle follow one another counterclockwise about it.
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

    /// The angle from one of its points to another, counterclockwise, rad.
    fn angle(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let (a, b) = (from - self.centre, to - self.centre);
        a.cross(&b).dot(&self.axis).atan2(a.dot(&b)).rem_euclid(std::f64::consts::TAU)
    }

    /// The point an angle (rad) counterclockwise of another.
    fn turned(&self, from: &Vector3<f64>, angle: f64) -> Vector3<f64> {
        self.centre + Rotation3::from_axis_angle(&self.axis, angle) * (from - self.centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn at(x: f64, y: f64, z: f64) -> Pose {
        Pose::from_parts(Translation3::new(x, y, z), Rotation3::identity())
    }

    #[test]
    fn an_arc_by_hand() {
        // Radius 5 about (1, 2) in the plane z = 3: east, north, west.
        let on = |x: f64, y: f64| at(1.0 + x, 2.0 + y, 3.0);
        let arc = Track::arc(&on(5.0, 0.0), &on(0.0, 5.0), &on(-5.0, 0.0));
        assert!(arc.is_arc());
        assert_relative_eq!(arc.length(), 5.0 * std::f64::consts::PI, epsilon = 1e-12);
        let diagonal = 5.0 * std::f64::consts::FRAC_1_SQRT_2;
        assert_relative_eq!(arc.pose(0.25), on(diagonal, diagonal), epsilon = 1e-12);
        assert_relative_eq!(arc.tangent(0.5).unwrap(), -Vector3::x(), epsilon = 1e-12);
        let off = arc.across(0.5, &Vector3::new(0.3, 0.4, -0.1));
        assert_relative_eq!(off, Vector3::new(0.0, 0.4, -0.1), epsilon = 1e-12);
        // To one side of it, and beyond both its ends.
        let near = |x: f64, y: f64| arc.nearest(&Vector3::new(1.0 + x, 2.0 + y, 3.3));
        assert_relative_eq!(near(3.0, 3.0), 0.25, epsilon = 1e-12);
        assert_relative_eq!(near(5.0, -0.1), 0.0);
        assert_relative_eq!(near(-5.0, -0.1), 1.0);
        // More than half way round, and on a line.
        let far = Track::arc(&on(0.0, 5.0), &on(-5.0, 0.0), &on(5.0, 0.0));
        assert_relative_eq!(far.pose(0.5), on(-diagonal, -diagonal), epsilon = 1e-12);
        assert!(!Track::arc(&at(0.0, 0.0, 0.0), &at(1.0, 0.0, 0.0), &at(2.0, 0.0, 0.0)).is_arc());
    }

    #[test]
    fn the_orientation_of_a_circle_point_only_chooses_the_way() {
        // Three quarters of a circle, counterclockwise from the east. The circle point is in the west.
        let on = |angle: f64, turn: f64| {
            let place = Translation3::new(angle.cos(), angle.sin(), 0.0);
            Pose::from_parts(place, Rotation3::from_axis_angle(&Vector3::z_axis(), turn))
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        let to_end = |via_turn: f64, end_turn: f64| {
            Track::arc(&on(0.0, 0.0), &on(2.0 * quarter, via_turn), &on(3.0 * quarter, end_turn))
        };
        // Two thirds of the arc: two thirds of a turn by 0.6 rad, whichever orientation the circle point has.
        for via_turn in [0.0, 0.4, 0.6] {
            assert_relative_eq!(to_end(via_turn, 0.6).pose(2.0 / 3.0), on(2.0 * quarter, 0.4), epsilon = 1e-12);
        }
        // A tool that follows the path turns by three quarters, and not back by one.
        let followed = to_end(2.0 * quarter, 3.0 * quarter);
        assert_relative_eq!(followed.pose(1.0 / 3.0), on(quarter, quarter), epsilon = 1e-12);
        assert_relative_eq!(followed.turn(), 3.0 * quarter, epsilon = 1e-12);
    }

    #[test]
    fn an_orientation_turns_evenly() {
        let turned = |x: f64, angle: f64| {
            Pose::from_parts(Translation3::new(x, 0.0, 0.0), Rotation3::from_axis_angle(&Vector3::y_axis(), angle))
        };
        let line = Track::line(&turned(0.0, 0.2), &turned(4.0, 1.0));
        assert_relative_eq!(line.pose(0.75), turned(3.0, 0.8), epsilon = 1e-12);
        assert_relative_eq!(line.nearest(&Vector3::new(3.0, 0.4, -0.2)), 0.75, epsilon = 1e-12);
        assert_relative_eq!(line.nearest(&Vector3::new(-0.3, 0.4, 0.0)), 0.0);
        let corner = line.across_start(&Vector3::new(-0.3, 0.4, 0.0));
        assert_relative_eq!(corner, Vector3::new(-0.3, 0.4, 0.0), epsilon = 1e-12);
        assert_relative_eq!(
            line.across_start(&Vector3::new(0.3, 0.4, 0.0)),
            Vector3::new(0.0, 0.4, 0.0),
            epsilon = 1e-12
        );
    }
}
