use super::kinematics::{Rows, Six};
use super::{Frames, Jacobian, Joints, Pose, Robot};
use deflex_lanes::{Real, SinCos, six};
use nalgebra::Vector3;
use std::ops::{Neg, Sub};

/// Up to this angle, rad, the series for the sum of angles is exact to rounding.
#[doc(hidden)]
pub const NUDGE: f64 = 0.01;

impl Robot {
    /// Frames of all links at motor angles (rad) of the nominal geometry.
    #[must_use]
    pub fn frames(&self, motor: &Joints) -> Frames {
        self.links.chain(&self.serial_from_motor(motor))
    }

    /// Flange pose (tool0 in the base) at motor angles (rad) of the nominal geometry.
    #[must_use]
    pub fn forward(&self, motor: &Joints) -> Pose {
        *self.frames(motor).base_from_flange()
    }

    /// Exact geometric Jacobian of a point fixed to the flange, with respect to the **motor** angles.
    ///
    /// Rows (vx, vy, vz, wx, wy, wz) in base axes, m/rad and rad/rad. `point` is in the base frame, m.
    /// `J = J_serial B` with `B` of [`Robot::serial_from_motor`]: column 2 of a parallelogram arm has no angular part.
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

impl Robot {
    /// The nominal rows.
    #[inline(always)]
    #[doc(hidden)]
    pub fn rows<R: Real>(&self) -> Rows<R> {
        self.links.numbers()
    }

    /// Serial joint angles, or changes of them, from those of motor angles, rad.
    #[inline(always)]
    #[doc(hidden)]
    pub fn serial<R: Real>(&self, motor: &Six<R>) -> Six<R> {
        let mut serial = six!(i => motor[i] * self.axes.sign[i]);
        if self.axes.parallelogram {
            serial[2] = serial[2] - serial[1];
        }
        serial
    }

    /// Motor angles from serial joint angles, rad.
    #[inline(always)]
    pub(crate) fn motor<R: Real>(&self, serial: &Six<R>) -> Six<R> {
        let mut motor = *serial;
        if self.axes.parallelogram {
            motor[2] = motor[2] + serial[1];
        }
        six!(i => motor[i] * self.axes.sign[i])
    }

    /// Torques (N·m), or derivatives with respect to angles, of the motors from those of the serial joints: the power is the same in both.
    #[inline(always)]
    #[doc(hidden)]
    pub fn by_motor<T: Copy + Sub<Output = T> + Neg<Output = T>>(&self, serial: &[T; 6]) -> [T; 6] {
        let mut motor = *serial;
        if self.axes.parallelogram {
            motor[1] = motor[1] - serial[2];
        }
        six!(i => if self.axes.sign[i] < 0.0 { -motor[i] } else { motor[i] })
    }

    /// Sines and cosines of the Denavit-Hartenberg angles (joint plus theta) at motor angles, rad.
    #[inline(always)]
    #[doc(hidden)]
    pub fn joints<R: Real>(&self, theta: &Six<R>, motor: &Six<R>) -> [SinCos<R>; 6] {
        let serial = self.serial(motor);
        six!(i => SinCos::of(serial[i] + theta[i]))
    }
}
