use super::{DhRow, Jacobian, Joints, Pose, Robot};
use nalgebra::{Matrix3, Rotation3, Translation3, Vector3};

/// Where each link is: `base_from_link[i]` for links 1 to 6 (index 0 to 5); link 6 ends in the flange.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    /// Modified-DH frames of the links in the base frame, m.
    pub base_from_link: [Pose; 6],
    /// Joint axes in base axes. They are the links' z axes, but for the share of a link's tilt that
    /// lies behind its own joint.
    pub axes: [Vector3<f64>; 6],
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
        let mut base_from_link = [Pose::identity(); 6];
        let mut axes = [Vector3::zeros(); 6];
        let mut rotation = Matrix3::identity();
        let mut origin = Vector3::zeros();
        for (i, (row, &(sa, ca))) in self.rows.iter().zip(&self.twists).enumerate() {
            let (st, ct) = (row.theta + serial[i]).sin_cos();
            origin += rotation * Vector3::new(row.a, -row.d * sa, row.d * ca);
            rotation *= Matrix3::new(ct, -st, 0.0, st * ca, ct * ca, -sa, st * sa, ct * sa, ca);
            axes[i] = rotation.column(2).into();
            if let Some(tilt) = tilt {
                rotation *= Rotation3::from_scaled_axis(Vector3::new(tilt[i][0], tilt[i][1], 0.0)).into_inner();
            }
            base_from_link[i] =
                Pose::from_parts(Translation3::from(origin), Rotation3::from_matrix_unchecked(rotation));
        }
        Frames { base_from_link, axes }
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
