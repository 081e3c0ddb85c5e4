//! The curve of the TCP between two poses: a line or an arc, with the turn of the tool along it.
//!
//! Positions are metres in the work object of the pose at the end of the curve.

use super::ArcTurn;
use deflex_robot::{Pose, turn_between};
use nalgebra::{Rotation3, Translation3, Unit, Vector3};

/// A tool that turns along an arc by less than this keeps its orientation, rad: the rounding of a turn of the path that the tool undoes.
const NO_TURN: f64 = 1e-12;

/// A curve from one pose to another; its parameter is the share of its length from the start.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct Track {
    from: Pose,
    to: Pose,
    curve: Curve,
}

/// A curve, with the rotation vectors of the tool on it, rad.
#[derive(Clone, Debug)]
enum Curve {
    /// A line, on which the tool turns evenly by this vector.
    Line(Vector3<f64>),
    Arc {
        circle: Circle,
        /// From the start to the end, counterclockwise about the circle's axis, rad.
        angle: f64,
        /// Share of the circle point.
        via: f64,
        turn: TurnOnArc,
    },
}

#[derive(Clone, Debug)]
enum TurnOnArc {
    /// Evenly by this vector.
    Even(Vector3<f64>),
    /// Evenly by this vector, while the path carries the tool along with it.
    Carried(Vector3<f64>),
    /// Evenly to the orientation of the circle point, and evenly from there to the end.
    Through { at_via: Rotation3<f64>, to_via: Vector3<f64>, to_end: Vector3<f64> },
}

impl Track {
    /// A line (`MoveL`).
    pub fn line(from: &Pose, to: &Pose) -> Self {
        Self { from: *from, to: *to, curve: Curve::Line(turn_between(&from.rotation, &to.rotation)) }
    }

    /// An arc through a circle point (`MoveC`); the line where the three points lie on one.
    ///
    /// Unless the tool turns through the orientation of the circle point, that orientation only chooses between the shorter and the longer
    /// turn (RAPID reference manual, `MoveC`). That of the end has no effect on a tool that is fixed to the path.
    pub fn arc(from: &Pose, via: &Pose, to: &Pose, arc_turn: ArcTurn) -> Self {
        let [a, b, c] = [from, via, to].map(|pose| pose.translation.vector);
        let Some(circle) = Circle::through([a, b, c]) else { return Self::line(from, to) };
        let angle = circle.angle(&a, &c);
        let share = circle.angle(&a, &b) / angle;
        // By how much the path turns up to a share of it.
        let carried = |share: f64| match arc_turn {
            ArcTurn::Even | ArcTurn::ThroughCirclePoint => Rotation3::identity(),
            ArcTurn::WithPath | ArcTurn::Fixed => Rotation3::from_axis_angle(&circle.axis, share * angle),
        };
        let shorter = turn_between(&from.rotation, &(carried(1.0).inverse() * to.rotation));
        let longer = shorter.try_normalize(0.0).map_or(shorter, |axis| shorter - std::f64::consts::TAU * axis);
        let off = |turn: &Vector3<f64>| {
            let there = carried(share) * Rotation3::from_scaled_axis(share * turn) * from.rotation;
            turn_between(&there, &via.rotation).norm()
        };
        let own = if off(&longer) < off(&shorter) { longer } else { shorter };
        let turn = match arc_turn {
            ArcTurn::Even => TurnOnArc::Even(own),
            ArcTurn::WithPath if (own + angle * circle.axis.into_inner()).norm() < NO_TURN => {
                TurnOnArc::Even(Vector3::zeros())
            }
            ArcTurn::WithPath => TurnOnArc::Carried(own),
            ArcTurn::Fixed => TurnOnArc::Carried(Vector3::zeros()),
            ArcTurn::ThroughCirclePoint => {
                let [to_via, to_end] = [[from, via], [via, to]].map(|[a, b]| turn_between(&a.rotation, &b.rotation));
                match to_via == Vector3::zeros() && to_end == Vector3::zeros() {
                    true => TurnOnArc::Even(Vector3::zeros()),
                    false => TurnOnArc::Through { at_via: via.rotation, to_via, to_end },
                }
            }
        };
        Self { from: *from, to: *to, curve: Curve::Arc { circle, angle, via: share, turn } }
    }

    /// The same where the orientation of the circle point chooses nothing: the tool takes the shorter turn.
    pub fn by_shorter_turn(mut self) -> Self {
        if let Curve::Arc { turn: TurnOnArc::Even(turn) | TurnOnArc::Carried(turn), .. } = &mut self.curve
            && turn.norm() > std::f64::consts::PI
        {
            *turn -= std::f64::consts::TAU * turn.normalize();
        }
        self
    }

    /// Its length, m.
    pub fn length(&self) -> f64 {
        match &self.curve {
            Curve::Line(_) => (self.to.translation.vector - self.from.translation.vector).norm(),
            Curve::Arc { circle, angle, .. } => circle.radius * angle,
        }
    }

    /// The angle of an arc, rad; 0 for a line.
    pub fn angle(&self) -> f64 {
        match &self.curve {
            Curve::Line(_) => 0.0,
            Curve::Arc { angle, .. } => *angle,
        }
    }

    /// Angle by which the orientation turns, rad; if it turns unevenly, as if all of it turned as fast as the faster part.
    pub fn turn(&self) -> f64 {
        match &self.curve {
            Curve::Line(turn) | Curve::Arc { turn: TurnOnArc::Even(turn), .. } => turn.norm(),
            // The rate of both turns together is the same all along the arc.
            Curve::Arc { circle, angle, turn: TurnOnArc::Carried(own), .. } => {
                (own + *angle * circle.axis.into_inner()).norm()
            }
            Curve::Arc { via, turn: TurnOnArc::Through { to_via, to_end, .. }, .. } => {
                (to_via.norm() / via).max(to_end.norm() / (1.0 - via))
            }
        }
    }

    /// Share of an arc's circle point.
    pub fn via(&self) -> Option<f64> {
        match &self.curve {
            Curve::Line(_) => None,
            Curve::Arc { via, .. } => Some(*via),
        }
    }

    pub fn is_arc(&self) -> bool {
        matches!(self.curve, Curve::Arc { .. })
    }

    /// The position at a share of the length, m.
    pub(crate) fn place(&self, share: f64) -> Vector3<f64> {
        let (a, b) = (self.from.translation.vector, self.to.translation.vector);
        match &self.curve {
            Curve::Line(_) => a.lerp(&b, share),
            Curve::Arc { circle, angle, .. } => circle.turned(&a, share * angle),
        }
    }

    /// The pose at a share of the length.
    pub fn pose(&self, share: f64) -> Pose {
        let start = &self.from.rotation;
        let turned = |turn: &Vector3<f64>, share: f64, from| Rotation3::from_scaled_axis(share * turn) * from;
        let rotation = match &self.curve {
            _ if self.keeps_orientation() => self.to.rotation,
            Curve::Line(turn) | Curve::Arc { turn: TurnOnArc::Even(turn), .. } => turned(turn, share, start),
            Curve::Arc { circle, angle, turn: TurnOnArc::Carried(own), .. } => {
                Rotation3::from_axis_angle(&circle.axis, share * angle) * turned(own, share, start)
            }
            Curve::Arc { via, turn: TurnOnArc::Through { at_via, to_via, to_end }, .. } => match share <= *via {
                true => turned(to_via, share / via, start),
                false => turned(to_end, (share - via) / (1.0 - via), at_via),
            },
        };
        Pose::from_parts(Translation3::from(self.place(share)), rotation)
    }

    /// The share of the length at which the curve is nearest to a position.
    pub fn nearest(&self, place: &Vector3<f64>) -> f64 {
        let (a, b) = (self.from.translation.vector, self.to.translation.vector);
        match &self.curve {
            Curve::Line(_) => {
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
    pub fn tangent(&self, share: f64) -> Option<Vector3<f64>> {
        let (a, b) = (self.from.translation.vector, self.to.translation.vector);
        match &self.curve {
            Curve::Line(_) => (b - a).try_normalize(0.0),
            Curve::Arc { circle, angle, .. } => {
                let out = circle.turned(&a, share * angle) - circle.centre;
                circle.axis.cross(&out).try_normalize(0.0)
            }
        }
    }

    /// Whether the orientation stays as it is at the end.
    pub fn keeps_orientation(&self) -> bool {
        match &self.curve {
            Curve::Line(turn) | Curve::Arc { turn: TurnOnArc::Even(turn), .. } => *turn == Vector3::zeros(),
            Curve::Arc { .. } => false,
        }
    }

    /// The part of a shift from the curve that is across the curve, at a share of its length: that far is the nearest point of the curve.
    pub fn across(&self, share: f64, shift: &Vector3<f64>) -> Vector3<f64> {
        self.tangent(share).map_or(*shift, |tangent| shift - tangent * tangent.dot(shift))
    }

    /// The same at the start of a curve that begins with a corner: before the start there is no curve.
    pub fn across_start(&self, shift: &Vector3<f64>) -> Vector3<f64> {
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
        let arc = Track::arc(&on(5.0, 0.0), &on(0.0, 5.0), &on(-5.0, 0.0), ArcTurn::Even);
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
        let far = Track::arc(&on(0.0, 5.0), &on(-5.0, 0.0), &on(5.0, 0.0), ArcTurn::Even);
        assert_relative_eq!(far.pose(0.5), on(-diagonal, -diagonal), epsilon = 1e-12);
        let on_line = Track::arc(&at(0.0, 0.0, 0.0), &at(1.0, 0.0, 0.0), &at(2.0, 0.0, 0.0), ArcTurn::WithPath);
        assert!(!on_line.is_arc());
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
            let [start, via, end] =
                [(0.0, 0.0), (2.0, via_turn), (3.0, end_turn)].map(|(n, turn)| on(n * quarter, turn));
            Track::arc(&start, &via, &end, ArcTurn::Even)
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

    /// Three points on the unit circle at these angles, with these orientations.
    fn turned(angles: [f64; 3], rotations: [Rotation3<f64>; 3], turn: ArcTurn) -> Track {
        let at = |n: usize| {
            let place = Translation3::new(angles[n].cos(), angles[n].sin(), 0.0);
            Pose::from_parts(place, rotations[n])
        };
        Track::arc(&at(0), &at(1), &at(2), turn)
    }

    #[test]
    fn a_tool_turns_with_the_path() {
        // A quarter of a circle, on which the tool tilts by 0.2 rad in the axes of the path.
        let quarter = std::f64::consts::FRAC_PI_2;
        let about_z = |angle: f64| Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
        let tilted = |angle: f64| Rotation3::from_axis_angle(&Vector3::x_axis(), angle);
        let rotations = [Rotation3::identity(), Rotation3::identity(), about_z(quarter) * tilted(0.2)];
        let arc = turned([0.0, 0.5 * quarter, quarter], rotations, ArcTurn::WithPath);
        assert_relative_eq!(arc.pose(0.25).rotation, about_z(0.25 * quarter) * tilted(0.05), epsilon = 1e-12);
        assert_relative_eq!(arc.pose(1.0).rotation, rotations[2], epsilon = 1e-12);
        // Both turns are at right angles to each other.
        assert_relative_eq!(arc.turn(), quarter.hypot(0.2), epsilon = 1e-12);
        // Evenly, the tool would be elsewhere in the middle.
        let even = turned([0.0, 0.5 * quarter, quarter], rotations, ArcTurn::Even);
        assert!(turn_between(&even.pose(0.5).rotation, &arc.pose(0.5).rotation).norm() > 0.01);
    }

    #[test]
    fn a_tool_that_keeps_its_orientation_keeps_it_on_any_arc() {
        let still = [Rotation3::from_euler_angles(0.3, -0.2, 0.1); 3];
        for end in [1.0, 3.0, 4.5, 6.0] {
            for (_, turn) in ArcTurn::WORDS {
                let arc = turned([0.0, 0.4 * end, end], still, turn);
                assert!(arc.keeps_orientation() && arc.turn() == 0.0, "{end} {turn:?}");
                assert_relative_eq!(arc.pose(0.7).rotation, still[0], epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn a_tool_turns_through_the_circle_point() {
        let about = |angle: f64| Rotation3::from_axis_angle(&Vector3::y_axis(), angle);
        let arc = turned([0.0, 0.5, 2.0], [about(0.0), about(0.4), about(0.1)], ArcTurn::ThroughCirclePoint);
        assert_relative_eq!(arc.pose(0.125).rotation, about(0.2), epsilon = 1e-12);
        assert_relative_eq!(arc.pose(0.25).rotation, about(0.4), epsilon = 1e-12);
        assert_relative_eq!(arc.pose(0.625).rotation, about(0.25), epsilon = 1e-12);
        // As if all of it turned as fast as up to the circle point: by 0.4 in a quarter of the way.
        assert_relative_eq!(arc.turn(), 1.6, epsilon = 1e-12);
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
