//! Converts tables of poses on all threads. Axis angles are in degrees as the controller counts them; poses are
//! matrices in millimetres.

use super::{Joints, Pose, Robot, Unreachable};
use nalgebra::{Matrix3, Matrix6, Rotation3, Translation3, Vector3, Vector6};
use rayon::prelude::*;

/// A pose in a table: a homogeneous matrix, row by row, with the position in mm.
pub type PoseMatrix = [[f64; 4]; 4];

/// Smallest number of rows that a thread takes at a time: some tenths of a millisecond of work.
const AT_LEAST: usize = 1024;

/// Largest error of the elements of a rotation matrix. A matrix that was stored in single precision has smaller errors
/// (1e-7), a scaled or mirrored one larger.
const ROTATION: f64 = 1e-5;

/// A pose as a matrix.
///
/// # Examples
/// ```
/// use deflex_robot::{Pose, pose_matrix};
///
/// assert_eq!(pose_matrix(&Pose::identity())[3], [0.0, 0.0, 0.0, 1.0]);
/// ```
#[must_use]
pub fn pose_matrix(pose: &Pose) -> PoseMatrix {
    let (r, p) = (pose.rotation.matrix(), pose.translation.vector * 1e3);
    let row = |i: usize| [r[(i, 0)], r[(i, 1)], r[(i, 2)], p[i]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

/// The pose of a matrix; `None` if the matrix is not a rigid motion, not finite, or has another last row.
///
/// # Examples
/// ```
/// use deflex_robot::{Pose, pose_matrix, pose_of_matrix};
///
/// let matrix = pose_matrix(&Pose::translation(0.0, 0.0, 0.31)); // m
/// assert_eq!(matrix[2][3], 310.0); // mm
/// assert_eq!(pose_of_matrix(&matrix), Some(Pose::translation(0.0, 0.0, 0.31)));
/// ```
#[must_use]
pub fn pose_of_matrix(matrix: &PoseMatrix) -> Option<Pose> {
    let rotation = Matrix3::from_fn(|i, j| matrix[i][j]);
    let off = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    let last = [0.0, 0.0, 0.0, 1.0].iter().zip(matrix[3]).all(|(wanted, found)| (wanted - found).abs() < ROTATION);
    let position = Vector3::from_fn(|i, _| 1e-3 * matrix[i][3]);
    let finite = position.iter().all(|value| value.is_finite());
    let is_pose = off < ROTATION && rotation.determinant() > 0.0 && last && finite;
    is_pose.then(|| Pose::from_parts(Translation3::from(position), Rotation3::from_matrix_unchecked(rotation)))
}

impl Robot {
    /// Poses, in the robot base, of a frame that is fixed to the flange, for many axis angles (degrees).
    ///
    /// # Examples
    /// ```
    /// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// use deflex_robot::Pose;
    ///
    /// let poses = robot.forward_table(&[[0.0; 6], [10.0, 0.0, 0.0, 0.0, 0.0, 0.0]], &Pose::identity());
    /// assert_eq!(poses.len(), 2);
    /// ```
    #[must_use]
    pub fn forward_table(&self, axes_deg: &[[f64; 6]], flange_from_tcp: &Pose) -> Vec<PoseMatrix> {
        let tcp = |deg: &[f64; 6]| pose_matrix(&(self.forward(&self.motor_from_axes_deg(deg)) * flange_from_tcp));
        axes_deg.par_iter().with_min_len(AT_LEAST).map(tcp).collect()
    }

    /// Axis angles (degrees) that reach poses of that frame in the robot base. Each solution is the nearest to the
    /// angles of the same row in `near_deg`: see [`Robot::inverse_near`].
    ///
    /// # Examples
    /// ```
    /// # use deflex_robot::{Builtin, Pose, pose_of_matrix};
    /// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// let (axes_deg, tool) = ([[10.0, 20.0, 15.0, 30.0, 40.0, -60.0]], Pose::translation(0.0, 0.0, 0.31));
    /// let poses: Vec<Pose> = robot.forward_table(&axes_deg, &tool).iter().filter_map(pose_of_matrix).collect();
    /// let found = robot.inverse_table(&poses, &tool, &axes_deg);
    /// assert!((found[0].expect("within reach")[5] + 60.0).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn inverse_table(
        &self,
        base_from_tcp: &[Pose],
        flange_from_tcp: &Pose,
        near_deg: &[[f64; 6]],
    ) -> Vec<Result<[f64; 6], Unreachable>> {
        let tcp_from_flange = flange_from_tcp.inverse();
        let reach = |(pose, near): (&Pose, &[f64; 6])| {
            let motor = self.inverse_near(&(pose * tcp_from_flange), &self.motor_from_axes_deg(near))?;
            Ok(self.axes_deg_from_motor(&motor))
        };
        base_from_tcp.par_iter().zip(near_deg).with_min_len(AT_LEAST).map(reach).collect()
    }

    /// Axis angles along a path: each solution is the nearest to the one before, the first to `start_deg`. Poses that
    /// are not reached are skipped.
    ///
    /// # Examples
    /// ```
    /// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// use deflex_robot::Pose;
    ///
    /// let start = [0.0, 0.0, 0.0, 0.0, 30.0, 0.0];
    /// let pose = robot.forward(&robot.motor_from_axes_deg(&start));
    /// let axes = robot.inverse_path(&[pose], &Pose::identity(), &start);
    /// assert!(axes[0].as_ref().is_ok_and(|deg| (deg[4] - 30.0).abs() < 1e-9));
    /// ```
    #[must_use]
    pub fn inverse_path(
        &self,
        base_from_tcp: &[Pose],
        flange_from_tcp: &Pose,
        start_deg: &[f64; 6],
    ) -> Vec<Result<[f64; 6], Unreachable>> {
        let (tcp_from_flange, mut near) = (flange_from_tcp.inverse(), self.motor_from_axes_deg(start_deg));
        let reach = |pose: &Pose| {
            near = self.inverse_near(&(pose * tcp_from_flange), &near)?;
            Ok(self.axes_deg_from_motor(&near))
        };
        base_from_tcp.iter().map(reach).collect()
    }

    /// Jacobians of that frame's origin, row by row: (vx, vy, vz) in mm/rad and (wx, wy, wz) in rad/rad, base axes,
    /// with respect to the motor angles.
    ///
    /// # Examples
    /// ```
    /// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// use deflex_robot::Pose;
    ///
    /// let jacobians = robot.jacobian_table(&[[0.0; 6]], &Pose::identity());
    /// assert!((jacobians[0][1][0] - 1393.0).abs() < 1e-6); // axis 1 moves the flange along y, mm/rad
    /// ```
    #[must_use]
    pub fn jacobian_table(&self, axes_deg: &[[f64; 6]], flange_from_tcp: &Pose) -> Vec<[[f64; 6]; 6]> {
        let jacobian = |deg: &[f64; 6]| rows(&self.jacobian_mm(deg, flange_from_tcp));
        axes_deg.par_iter().with_min_len(AT_LEAST).map(jacobian).collect()
    }

    /// Stiffness of that frame for loads at its origin, J⁻ᵀ K J⁻¹ (Salisbury 1980), row by row: force (N) and moment
    /// (N·mm) for a displacement (mm) and a turn (rad), base axes. NaN if the arm is singular. `stiffness` is that of
    /// the joints at the motors, N·m/rad.
    ///
    /// # Examples
    /// ```
    /// # use deflex_robot::{Builtin, Joints, Pose};
    /// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// let springs = Joints::new(8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4); // N·m/rad
    /// let stiffness = robot.stiffness_table(&[[0.0, 20.0, 15.0, 0.0, 40.0, 0.0]], &Pose::identity(), &springs);
    /// assert!(stiffness[0][2][2] > 100.0); // N/mm along z of the base
    /// ```
    #[must_use]
    pub fn stiffness_table(
        &self,
        axes_deg: &[[f64; 6]],
        flange_from_tcp: &Pose,
        stiffness: &Joints,
    ) -> Vec<[[f64; 6]; 6]> {
        let springs = Matrix6::from_diagonal(&(1e3 * stiffness));
        let of = |deg: &[f64; 6]| match self.jacobian_mm(deg, flange_from_tcp).try_inverse() {
            Some(inverse) => rows(&(inverse.transpose() * springs * inverse)),
            None => [[f64::NAN; 6]; 6],
        };
        axes_deg.par_iter().with_min_len(AT_LEAST).map(of).collect()
    }

    fn jacobian_mm(&self, axes_deg: &[f64; 6], flange_from_tcp: &Pose) -> Matrix6<f64> {
        let frames = self.frames(&self.motor_from_axes_deg(axes_deg));
        let tcp = frames.base_from_flange() * flange_from_tcp;
        let to_mm = Matrix6::from_diagonal(&Vector6::new(1e3, 1e3, 1e3, 1.0, 1.0, 1.0));
        to_mm * self.jacobian(&frames, &tcp.translation.vector)
    }
}

fn rows(matrix: &Matrix6<f64>) -> [[f64; 6]; 6] {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BUILTIN;

    /// Elbow and wrist are bent, because a straight arm is at the end of its reach.
    const POSTURES: [[f64; 6]; 3] = [
        [0.0, 10.0, 40.0, 10.0, 30.0, 0.0],
        [10.0, 20.0, -35.0, 30.0, 40.0, -50.0],
        [-40.0, 35.0, 30.0, -60.0, -50.0, 170.0],
    ];

    #[test]
    fn a_solution_reaches_its_pose() {
        let tcp = Pose::from_parts(Translation3::new(0.01, -0.02, 0.3), Rotation3::from_euler_angles(0.2, 0.1, -0.4));
        for builtin in BUILTIN.iter() {
            let robot = builtin.robot();
            let inside = |deg: &&[f64; 6]| robot.limit_violation(&robot.motor_from_axes_deg(deg)).is_none();
            let postures: Vec<[f64; 6]> = POSTURES.iter().filter(inside).copied().collect();
            let table = robot.forward_table(&postures, &tcp);
            let poses: Vec<Pose> = table.iter().map(|matrix| pose_of_matrix(matrix).unwrap()).collect();
            let near: Vec<[f64; 6]> = postures.iter().map(|deg| deg.map(|angle| angle + 0.5)).collect();
            for (found, wanted) in robot.inverse_table(&poses, &tcp, &near).iter().zip(&postures) {
                let found = found.unwrap();
                assert!((0..6).all(|i| (found[i] - wanted[i]).abs() < 1e-6), "{}: {found:?} {wanted:?}", robot.model);
            }
        }
    }

    #[test]
    fn stiffness_undoes_the_compliance() {
        let robot = BUILTIN[0].robot();
        let springs = Joints::from([8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]);
        let tcp = Pose::identity();
        let stiffness = Matrix6::from_fn(|i, j| robot.stiffness_table(&POSTURES[1..2], &tcp, &springs)[0][i][j]);
        let jacobian = Matrix6::from_fn(|i, j| robot.jacobian_table(&POSTURES[1..2], &tcp)[0][i][j]);
        // N·m/rad of the joints are 1e3 N·mm/rad.
        let compliance = jacobian * Matrix6::from_diagonal(&springs.map(|k| 1e-3 / k)) * jacobian.transpose();
        assert!((stiffness * compliance - Matrix6::identity()).amax() < 1e-8);
    }

    #[test]
    fn a_matrix_that_is_not_a_pose_has_none() {
        let mut matrix = pose_matrix(&Pose::identity());
        assert!(pose_of_matrix(&matrix).is_some());
        matrix[0][0] = -1.0;
        assert!(pose_of_matrix(&matrix).is_none(), "a mirror is not a rotation");
        matrix[0][0] = f64::NAN;
        assert!(pose_of_matrix(&matrix).is_none());
    }
}
