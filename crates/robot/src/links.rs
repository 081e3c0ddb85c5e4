//! The links of an arm as Denavit-Hartenberg rows, and their frames.

use super::kinematics::{Chain, Rows};
use super::{Joints, Pose};
use deflex_lanes::{Real, SinCos, six};
use nalgebra::Vector3;

/// One modified Denavit-Hartenberg row (Craig): `Rx(alpha) Tx(a) Rz(theta + joint) Tz(d)`.
///
/// # Examples
/// ```
/// use deflex_robot::DhRow;
///
/// // The first row of an IRB 6660, rad and m.
/// let row = DhRow { alpha: 0.0, a: 0.0, d: 0.8145, theta: 0.0 };
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DhRow {
    /// Twist about the previous x axis, rad.
    pub alpha: f64,
    /// Length along the previous x axis, m.
    pub a: f64,
    /// Length along the joint axis, m.
    pub d: f64,
    /// Angle added to the joint, rad.
    pub theta: f64,
}

/// The frames of links 1 to 6 (index 0 to 5); link 6 ends in the flange.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let motor = robot.motor_from_axes_deg(&[0.0; 6]);
/// let frames = robot.frames(&motor);
/// assert_eq!(*frames.base_from_flange(), robot.forward(&motor));
/// println!("the axis of joint 2 passes through {} (m)", frames.origin(1));
/// assert!((frames.axis(0).z - 1.0).abs() < 1e-12); // axis 1 is upright
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    /// Modified-DH frames of the links in the base frame, m.
    pub base_from_link: [Pose; 6],
    /// Directions of the joint axes in base axes: the z axes of the links, without the tilt of a link that acts after its own joint.
    pub axes: [Vector3<f64>; 6],
}

impl Default for Frames {
    fn default() -> Self {
        Self { base_from_link: [Pose::identity(); 6], axes: [Vector3::zeros(); 6] }
    }
}

impl Frames {
    /// The flange frame (tool0).
    #[must_use]
    pub fn base_from_flange(&self) -> &Pose {
        &self.base_from_link[5]
    }

    /// Axis of serial joint `i` (0 to 5) in base axes.
    #[must_use]
    pub fn axis(&self, i: usize) -> Vector3<f64> {
        self.axes[i]
    }

    /// A point on the axis of serial joint `i`, base frame, m.
    #[must_use]
    pub fn origin(&self, i: usize) -> Vector3<f64> {
        self.base_from_link[i].translation.vector
    }
}

/// Modified-DH rows with the sines and cosines of their twists, for chains that are evaluated many times.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let links = deflex_robot::Links::new(*robot.links.rows());
/// let motor = robot.motor_from_axes_deg(&[0.0; 6]);
/// assert_eq!(*links.chain(&robot.serial_from_motor(&motor)).base_from_flange(), robot.forward(&motor));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Links {
    rows: [DhRow; 6],
    /// Sines and cosines of the twists.
    alpha: [SinCos<f64>; 6],
}

impl Links {
    /// The links of these rows.
    #[must_use]
    pub fn new(rows: [DhRow; 6]) -> Self {
        Self { rows, alpha: rows.map(|row| SinCos::of(row.alpha)) }
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &[DhRow; 6] {
        &self.rows
    }

    /// The chain at **serial** joint angles, rad.
    #[must_use]
    pub fn chain(&self, serial: &Joints) -> Frames {
        let rows = self.numbers::<f64>();
        let joints = six!(i => SinCos::of(self.rows[i].theta + serial[i]));
        let mut chain = Chain::default();
        rows.chain(&joints, None, &mut chain);
        Frames { base_from_link: six!(i => chain.links[i].lane(0)), axes: six!(i => chain.axes[i].lane(0)) }
    }

    /// The rows, over any [`Real`].
    #[inline(always)]
    pub(crate) fn numbers<R: Real>(&self) -> Rows<R> {
        let (rows, alpha) = (&self.rows, &self.alpha);
        Rows {
            a: six!(i => R::of(rows[i].a)),
            d: six!(i => R::of(rows[i].d)),
            theta: six!(i => R::of(rows[i].theta)),
            alpha: six!(i => SinCos { sin: R::of(alpha[i].sin), cos: R::of(alpha[i].cos) }),
        }
    }
}
