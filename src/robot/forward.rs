use super::kinematics::{Chain, Rows};
use super::{DhRow, Jacobian, Joints, Pose, Robot};
use crate::lanes::{Real, SinCos, six};
use nalgebra::Vector3;

/// The frames of links 1 to 6 (index 0 to 5); link 6 ends in the flange.
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

/// Up to this angle, rad, the series for the sum of angles is exact to rounding.
pub(crate) const NUDGE: f64 = 0.01;

impl Robot {
    /// Frames of all links at motor angles (rad) of the nominal geometry.
    #[must_use]
    pub fn frames(&self, motor: &Joints) -> Frames {
        self.links.chain(&self.serial_from_motor(motor))
    }

    /// Flange pose (tool0 in the base) at motor angles (rad) of the nominal geometry.
    ///
    /// # Examples
    /// ```
    /// # use deflex::robot::Builtin;
    /// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// let flange = robot.forward(&robot.motor_from_axes_deg(&[0.0; 6]));
    /// assert!((flange.translation.x - 1.393).abs() < 1e-9 && (flange.translation.z - 1.7945).abs() < 1e-9); // m
    /// ```
    #[must_use]
    pub fn forward(&self, motor: &Joints) -> Pose {
        *self.frames(motor).base_from_flange()
    }

    /// Exact geometric Jacobian of a point fixed to the flange, with respect to the **motor** angles.
    ///
    /// Rows (vx, vy, vz, wx, wy, wz) in base axes, m/rad and rad/rad. `point` is in the base frame, m.
    /// `J = J_serial B` with `B` of [`Robot::serial_from_motor`]: column 2 of a parallelogram arm has no angular part.
    ///
    /// # Examples
    /// ```
    /// # use deflex::{nalgebra::Vector3, robot::Builtin};
    /// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// let frames = robot.frames(&robot.motor_from_axes_deg(&[0.0; 6]));
    /// let jacobian = robot.jacobian(&frames, &Vector3::new(1.393, 0.0, 1.7945)); // at the flange
    /// assert!((jacobian[(1, 0)] - 1.393).abs() < 1e-9); // axis 1 moves it along y with its distance from the axis, m/rad
    /// ```
    #[must_use]
    pub fn jacobian(&self, frames: &Frames, point: &Vector3<f64>) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for i in 0..6 {
            let axis = frames.axis(i);
            jacobian.fixed_view_mut::<3, 1>(0, i).copy_from(&axis.cross(&(point - frames.origin(i))));
            jacobian.fixed_view_mut::<3, 1>(3, i).copy_from(&axis);
        }
        if self.axes.parallelogram {
            let forearm = jacobian.column(2).into_owned();
            jacobian.column_mut(1).axpy(-1.0, &forearm, 1.0);
        }
        for (i, sign) in self.axes.sign.into_iter().enumerate() {
            jacobian.column_mut(i).scale_mut(sign);
        }
        jacobian
    }
}
