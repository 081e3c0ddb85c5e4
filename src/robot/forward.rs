use super::{DhRow, Jacobian, Joints, Pose, Robot};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Where each link is: `base_from_link[i]` for links 1 to 6 (index 0 to 5); link 6 ends in the flange.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    /// Modified-DH frames of the links in the base frame, m.
    pub base_from_link: [Pose; 6],
    /// Joint axes in base axes. They are the links' z axes, but for the share of a link's tilt that
    /// lies behind its own joint.
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

/// Modified-DH rows with the sines of their twists: a chain that is gone through many times.
#[derive(Clone, Copy, Debug)]
pub struct Links {
    rows: [DhRow; 6],
    /// Sine and cosine of alpha.
    twists: [(f64, f64); 6],
}

impl Links {
    /// The links of these rows.
    #[must_use]
    pub fn new(rows: [DhRow; 6]) -> Self {
        Self { rows, twists: rows.map(|row| row.alpha.sin_cos()) }
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &[DhRow; 6] {
        &self.rows
    }

    /// The chain at **serial** joint angles; `tilt`, where given, turns each link by a rotation vector about x and y of
    /// its own frame (bearings that yield), rad.
    #[must_use]
    pub fn chain(&self, serial: &Joints, tilt: Option<&[[f64; 2]; 6]>) -> Frames {
        let mut frames = Frames::default();
        self.turned(&Turns::of(&self.angles(serial)), tilt, &mut frames);
        frames
    }

    /// The chain close to where `near` was taken: the same to rounding, without a sine. Into a place that is used again,
    /// since frames are looked at many times.
    pub fn chain_near(&self, near: &Turns, serial: &Joints, tilt: Option<&[[f64; 2]; 6]>, frames: &mut Frames) {
        self.turned(&near.nudged(&self.angles(serial)), tilt, frames);
    }

    /// The turns at serial joint angles, for [`Links::chain_near`].
    #[must_use]
    pub fn turns(&self, serial: &Joints) -> Turns {
        Turns::of(&self.angles(serial))
    }

    fn angles(&self, serial: &Joints) -> Joints {
        Joints::from_fn(|i, _| self.rows[i].theta + serial[i])
    }

    fn turned(&self, turns: &Turns, tilt: Option<&[[f64; 2]; 6]>, frames: &mut Frames) {
        let (mut x, mut y, mut z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let mut origin = Vector3::zeros();
        for (i, (row, &(sa, ca))) in self.rows.iter().zip(&self.twists).enumerate() {
            let (st, ct) = turns.sines[i];
            // Rx(alpha) Tx(a) Rz(theta) Tz(d), column by column.
            let across = y * ca + z * sa;
            z = z * ca - y * sa;
            origin += x * row.a + z * row.d;
            (x, y) = (x * ct + across * st, across * ct - x * st);
            frames.axes[i] = z;
            if let Some(tilt) = tilt {
                let turn = Rotation3::from_scaled_axis(Vector3::new(tilt[i][0], tilt[i][1], 0.0)).into_inner();
                let turned = Matrix3::from_columns(&[x, y, z]) * turn;
                (x, y, z) = (turned.column(0).into(), turned.column(1).into(), turned.column(2).into());
            }
            let link = &mut frames.base_from_link[i];
            link.translation.vector = origin;
            link.rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
        }
    }
}

/// Up to here the series of a sum of angles are exact to rounding, rad.
pub(crate) const NUDGE: f64 = 0.01;

/// DH angles with their sines and cosines.
#[derive(Clone, Copy, Debug)]
pub struct Turns {
    angles: Joints,
    sines: [(f64, f64); 6],
}

impl Turns {
    fn of(angles: &Joints) -> Self {
        Self { angles: *angles, sines: std::array::from_fn(|i| angles[i].sin_cos()) }
    }

    /// Those at angles close by, by the sum of angles; a deflection is some 1e-4 rad.
    fn nudged(&self, angles: &Joints) -> Self {
        let step = angles - self.angles;
        let sine = |i: usize| {
            let (d, (s, c)) = (step[i], self.sines[i]);
            if d.is_nan() || d.abs() > NUDGE {
                return angles[i].sin_cos();
            }
            let dd = d * d;
            let sin = d * (1.0 - dd * (1.0 / 6.0 - dd / 120.0));
            let less = dd * (0.5 - dd * (1.0 / 24.0 - dd / 720.0));
            (s + (c * sin - s * less), c - (s * sin + c * less))
        };
        Self { angles: *angles, sines: std::array::from_fn(sine) }
    }
}

impl Robot {
    /// Frames of all links at motor angles (rad) of the nominal geometry.
    #[must_use]
    pub fn frames(&self, motor: &Joints) -> Frames {
        self.links.chain(&self.serial_from_motor(motor), None)
    }

    /// Flange pose (tool0 in the base) at motor angles (rad) of the nominal geometry.
    #[must_use]
    pub fn forward(&self, motor: &Joints) -> Pose {
        *self.frames(motor).base_from_flange()
    }

    /// Exact geometric Jacobian of a point fixed to the flange, with respect to the **motor** angles.
    ///
    /// Rows (vx, vy, vz, wx, wy, wz) in base axes, m/rad and rad/rad. `point` is in the base frame, m.
    /// On a parallelogram arm column 2 has no angular part (`J = J_serial B`, `B[3,2] = −1`).
    #[must_use]
    pub fn jacobian(&self, frames: &Frames, point: &Vector3<f64>) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for i in 0..6 {
            let axis = frames.axis(i);
            jacobian.fixed_view_mut::<3, 1>(0, i).copy_from(&axis.cross(&(point - frames.origin(i))));
            jacobian.fixed_view_mut::<3, 1>(3, i).copy_from(&axis);
        }
        if self.parallelogram {
            let forearm = jacobian.column(2).into_owned();
            jacobian.column_mut(1).axpy(-1.0, &forearm, 1.0);
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::BUILTIN;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_chain_close_by_is_the_chain(
            at in proptest::array::uniform6(-3.0_f64..3.0),
            step in proptest::array::uniform6(-0.011_f64..0.011),
        ) {
            let (links, at) = (&BUILTIN[0].robot().links, Joints::from(at));
            let serial = at + Joints::from(step);
            let (mut near, plain) = (Frames::default(), links.chain(&serial, None));
            links.chain_near(&links.turns(&at), &serial, None, &mut near);
            let (near, plain) = (near.base_from_flange(), plain.base_from_flange());
            prop_assert!((near.translation.vector - plain.translation.vector).norm() < 4e-15);
            prop_assert!((near.rotation.matrix() - plain.rotation.matrix()).norm() < 4e-15);
        }
    }
}
