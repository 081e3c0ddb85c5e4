use super::closed_form::{Branch, Solutions, wrap};
use super::{Joints, LimitViolation, Links, Pose, Robot, turn_between};
use nalgebra::{Rotation3, Vector3, Vector6};
use std::f64::consts::TAU;

/// Why no motor angles reach a pose.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// use nalgebra::Translation3;
/// use deflex_robot::{Joints, Pose, Unreachable};
///
/// let far = Pose::from_parts(Translation3::new(9.0, 0.0, 0.0), Default::default()); // m
/// assert!(matches!(robot.inverse(&far, &Joints::zeros()), Err(Unreachable::OutOfReach { .. })));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Unreachable {
    /// The wrist centre is out of reach of the arm.
    #[error("the wrist centre is {by_mm:.3} mm out of the arm's reach")]
    OutOfReach {
        /// How far, mm.
        by_mm: f64,
    },
    /// Newton's method did not converge from the start that was given.
    #[error("no motor angles near the previous ones reach it; {left_mm:.3} mm are left")]
    NotConverged {
        /// Distance left, mm.
        left_mm: f64,
    },
    /// The pose can be reached only beyond an axis limit.
    #[error(transparent)]
    Limit(#[from] LimitViolation),
}

/// Whether no axis turns by more than a 32nd of a turn between two sets of motor angles (rad). Away from singular postures, other solutions
/// are farther away, so that the nearest one is the one that the arm reaches.
#[must_use]
#[doc(hidden)]
pub fn is_close(motor: &Joints, near: &Joints) -> bool {
    (motor - near).amax() < TAU / 32.0
}

impl Robot {
    /// Motor angles of every branch that reaches a flange pose, rad, without regard to axis limits. A singular wrist
    /// keeps q4 of `near`. For robots without an explicit inverse, the result is the single solution that Newton's
    /// method finds from `near`, at the index of its posture.
    ///
    /// # Errors
    /// The pose is out of reach.
    pub fn inverse(&self, base_from_flange: &Pose, near: &Joints) -> Result<Solutions, Unreachable> {
        if let Some(closed) = self.closed_form() {
            return match closed.solve(base_from_flange, near[3]) {
                // Serial joint 3 is wrapped before it becomes a motor angle: motor 3 = serial 3 + motor 2.
                Ok(serial) => Ok(serial.map(|s| s.map(|s| self.motor_from_serial(&s.map(wrap))))),
                Err(by) => Err(Unreachable::OutOfReach { by_mm: 1e3 * by }),
            };
        }
        let serial = polish(&self.links, base_from_flange, &self.serial_from_motor(near))?;
        let motor = self.motor_from_serial(&serial);
        let (rear, behind) = self.posture(&motor);
        let mut solutions = [None; 8];
        solutions[Branch { rear, behind, flipped: serial[4] < 0.0 }.cfx()] = Some(motor);
        Ok(solutions)
    }

    /// The motor angles (rad) nearest to `near` that reach a flange pose, as on a linear motion.
    ///
    /// # Errors
    /// The pose is out of reach, or the solution exceeds an axis limit.
    pub fn inverse_near(&self, base_from_flange: &Pose, near: &Joints) -> Result<Joints, Unreachable> {
        let motor = self.inverse_near_unlimited(base_from_flange, near)?;
        self.limit_violation(&motor).map_or(Ok(motor), |violation| Err(violation.into()))
    }

    /// [`Robot::inverse_near`] without regard to axis limits.
    ///
    /// # Errors
    /// The pose is out of reach.
    pub fn inverse_near_unlimited(&self, base_from_flange: &Pose, near: &Joints) -> Result<Joints, Unreachable> {
        // On a path the branch stays the same. The other seven branches are computed only if one of them could be
        // nearer.
        let same =
            self.closed_form().and_then(|closed| closed.branch_of(base_from_flange, &self.serial_from_motor(near)));
        if let Some((serial, reach)) = same {
            let motor = self.nearest_turns(&self.motor_from_serial(&serial.map(wrap)), near);
            if (motor - near).norm_squared() < reach * reach {
                return Ok(motor);
            }
        }
        let solutions = self.inverse(base_from_flange, near)?;
        solutions
            .iter()
            .flatten()
            .map(|motor| self.nearest_turns(motor, near))
            .min_by(|a, b| (a - near).norm_squared().total_cmp(&(b - near).norm_squared()))
            .ok_or(Unreachable::OutOfReach { by_mm: 0.0 })
    }

    /// The motor angles (rad) that a linear motion of the TCP from `near` ends at. Of several solutions it is the one that the arm reaches
    /// on the line: if an axis turns far on the way, another solution may be nearer to `near`. Where the arm cannot follow the line, or the
    /// line ends beyond an axis limit, it is [`Robot::inverse_near`].
    ///
    /// # Errors
    /// The pose is out of reach, or the solution exceeds an axis limit.
    pub fn inverse_along(
        &self,
        flange_from_tcp: &Pose,
        base_from_flange: &Pose,
        near: &Joints,
    ) -> Result<Joints, Unreachable> {
        /// Share of the line below which its steps are not halved: there the arm passes a singular posture.
        const SHORTEST: f64 = 1.0 / 1024.0;
        let nearest = self.inverse_near(base_from_flange, near);
        if nearest.is_ok_and(|motor| is_close(&motor, near)) {
            return nearest;
        }
        let [from, to] = [&self.forward(near), base_from_flange].map(|flange| flange * flange_from_tcp);
        let (shift, turn) =
            (to.translation.vector - from.translation.vector, turn_between(&from.rotation, &to.rotation));
        let flange = |share: f64| {
            let rotation = Rotation3::new(turn * share) * from.rotation;
            Pose::from_parts((from.translation.vector + shift * share).into(), rotation) * flange_from_tcp.inverse()
        };
        let (mut motor, mut at, mut step) = (*near, 0.0, 0.5);
        while at < 1.0 {
            let next = f64::min(at + step, 1.0);
            match self.inverse_near_unlimited(&flange(next), &motor) {
                Ok(found) if is_close(&found, &motor) || step < SHORTEST => {
                    (motor, at, step) = (found, next, 2.0 * step)
                }
                Err(_) if step < SHORTEST => return nearest,
                _ => step *= 0.5,
            }
        }
        if self.limit_violation(&motor).is_some() { nearest } else { Ok(motor) }
    }

    /// Index of the branch of motor angles (rad), which is their [cfx](Branch::cfx); `None` without an explicit
    /// inverse.
    #[doc(hidden)]
    pub fn branch(&self, motor: &Joints) -> Option<usize> {
        let form = self.closed_form()?;
        let serial = self.serial_from_motor(motor);
        let (rear, behind) = form.posture(&serial);
        let flipped = wrap(serial[4] + form.theta[4]) < 0.0;
        Some(Branch { rear, behind, flipped }.cfx())
    }

    /// The motor angles of a branch that reach a flange pose, in the turns nearest to `near` (rad), without regard to
    /// axis limits: a linear motion keeps its branch and turns its axes on, even beyond their limits. Without a branch
    /// it is [`Robot::inverse_near_unlimited`].
    ///
    /// # Errors
    /// The branch does not reach the pose.
    #[doc(hidden)]
    pub fn inverse_in(
        &self,
        branch: Option<usize>,
        base_from_flange: &Pose,
        near: &Joints,
    ) -> Result<Joints, Unreachable> {
        let (Some(branch), Some(form)) = (branch, self.closed_form()) else {
            return self.inverse_near_unlimited(base_from_flange, near);
        };
        let solution = self.inverse(base_from_flange, near)?[branch];
        let by_mm = || 1e3 * form.out_of_reach(base_from_flange, Branch::ALL[branch].rear);
        let turned = |motor: Joints| motor.zip_map(near, |own, near| own + ((near - own) / TAU).round() * TAU);
        solution.map(turned).ok_or_else(|| Unreachable::OutOfReach { by_mm: by_mm() })
    }

    /// Posture at motor angles: whether the wrist centre is behind axis 1, and whether it is behind the lower arm.
    #[must_use]
    #[doc(hidden)]
    pub fn posture(&self, motor: &Joints) -> (bool, bool) {
        match self.closed_form() {
            Some(form) => form.posture(&self.serial_from_motor(motor)),
            None => self.posture_plain(motor),
        }
    }

    /// The reference for [`Robot::posture`], computed in space.
    fn posture_plain(&self, motor: &Joints) -> (bool, bool) {
        let frames = self.frames(motor);
        let wrist = frames.origin(4);
        let shoulder = frames.origin(1);
        // x of link 1 points to the front of the arm at axis 1 = 0.
        let ahead = frames.base_from_link[0].rotation * Vector3::x();
        let up = frames.base_from_link[0].rotation * Vector3::z();
        let plane = |v: Vector3<f64>| (v.dot(&ahead), v.dot(&up));
        let (arm_x, arm_z) = plane(frames.origin(2) - shoulder);
        let (to_x, to_z) = plane(wrist - shoulder);
        (wrist.dot(&ahead) < 0.0, arm_z * to_x - arm_x * to_z < 0.0)
    }
}

/// Solves serial joint angles (rad) for a pose of the last link by Newton's method, for chains without an explicit
/// inverse.
///
/// # Errors
/// The method did not converge: the seed is too far from a solution, or the pose is out of reach.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// use deflex_robot::Joints;
///
/// let serial = Joints::new(0.1, 0.2, 0.3, 0.4, 0.5, 0.6);
/// let pose = *robot.links.chain(&serial).base_from_flange();
/// let found = deflex_robot::polish(&robot.links, &pose, &serial.add_scalar(0.01)).expect("within reach");
/// assert!((found - serial).amax() < 1e-9);
/// ```
pub fn polish(links: &Links, base_from_last: &Pose, seed: &Joints) -> Result<Joints, Unreachable> {
    // Newton's method doubles the digits in each step, so 50 steps are reached only if it does not converge.
    const NEWTON_STEPS: usize = 50;
    // m and rad: 100 times the rounding error of an arm with a reach of 4 m, and a ten-thousandth of a printed digit.
    const DONE: f64 = 1e-13;
    const GOOD_ENOUGH: f64 = 1e-10;
    // Largest step of a joint, rad. It keeps Newton's method within its range of convergence.
    const STRIDE: f64 = 0.5;
    let mut joints = *seed;
    let mut best = (f64::INFINITY, joints);
    for _ in 0..NEWTON_STEPS {
        let frames = links.chain(&joints);
        let gap = pose_gap(frames.base_from_flange(), base_from_last);
        let size = gap.norm();
        if !size.is_finite() {
            break;
        }
        let stalled = best.0 < GOOD_ENOUGH && size >= 0.5 * best.0;
        if size < best.0 {
            best = (size, joints);
        }
        if size < DONE || stalled {
            break;
        }
        let mut jacobian = nalgebra::Matrix6::zeros();
        for i in 0..6 {
            let axis = frames.axis(i);
            let arm = frames.base_from_flange().translation.vector - frames.origin(i);
            jacobian.fixed_view_mut::<3, 1>(0, i).copy_from(&axis.cross(&arm));
            jacobian.fixed_view_mut::<3, 1>(3, i).copy_from(&axis);
        }
        // Damped least squares near singular poses. The damping needs more steps, but does not reduce the accuracy.
        let damping = 1e-12 + 1e-6 * size * size;
        let normal = jacobian.transpose() * jacobian + nalgebra::Matrix6::identity() * damping;
        let Some(step) = normal.cholesky().map(|c| c.solve(&(jacobian.transpose() * gap))) else { break };
        let scale = (STRIDE / step.amax()).min(1.0);
        joints += step * scale;
    }
    if best.0 < GOOD_ENOUGH { Ok(best.1) } else { Err(Unreachable::NotConverged { left_mm: 1e3 * best.0 }) }
}

/// The motion from one pose to another: displacement and rotation vector in base axes, m and rad.
#[must_use]
pub(crate) fn pose_gap(from: &Pose, to: &Pose) -> Vector6<f64> {
    let shift = to.translation.vector - from.translation.vector;
    let turn = turn_between(&from.rotation, &to.rotation);
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BUILTIN;

    fn deg(values: [f64; 6]) -> Joints {
        Vector6::from(values.map(f64::to_radians))
    }

    #[test]
    fn every_branch_reaches_the_pose_and_one_is_the_start() {
        let robot = BUILTIN[0].robot();
        for motor in [deg([10.0, 20.0, 15.0, 30.0, 40.0, -60.0]), deg([-35.0, -20.0, 35.0, -110.0, 75.0, 120.0])] {
            let pose = robot.forward(&motor);
            let solutions = robot.inverse(&pose, &motor).unwrap();
            for solution in solutions.iter().flatten() {
                assert!(pose_gap(&robot.forward(solution), &pose).norm() < 1e-12);
            }
            assert!((robot.inverse_near(&pose, &motor).unwrap() - motor).norm() < 1e-12);
            for (cfx, solution) in solutions.iter().enumerate() {
                if let Some(motor) = solution {
                    assert_eq!(crate::confdata_of(&robot, motor).cfx as usize, cfx);
                }
            }
        }
    }

    proptest::proptest! {
        #[test]
        fn the_posture_in_the_arm_s_plane_is_that_in_space(
            robot in 0..BUILTIN.len(),
            shares in proptest::array::uniform6(0.0_f64..1.0),
        ) {
            let robot = BUILTIN[robot].robot();
            let motor = Joints::from_fn(|i, _| robot.limits.min[i] + shares[i] * (robot.limits.max[i] - robot.limits.min[i]));
            proptest::prop_assert_eq!(robot.posture(&motor), robot.posture_plain(&motor));
        }
    }

    proptest::proptest! {
        #[test]
        fn the_end_of_a_line_is_that_of_small_steps(
            shares in proptest::array::uniform12(0.1_f64..0.9),
            tip in proptest::array::uniform3(-0.3_f64..0.3),
        ) {
            const STEPS: u16 = 2000;
            let robot = BUILTIN[0].robot();
            let limits = &robot.limits;
            let joints = |k: usize| Joints::from_fn(|i, _| limits.min[i] + shares[k + i] * (limits.max[i] - limits.min[i]));
            let flange_from_tcp = Pose::from_parts(Vector3::from(tip).into(), Rotation3::identity());
            let [from, to] = [0, 6].map(|k| robot.forward(&joints(k)) * flange_from_tcp);
            let turn = turn_between(&from.rotation, &to.rotation);
            let mut motor = joints(0);
            for step in 1..=STEPS {
                let share = f64::from(step) / f64::from(STEPS);
                let at = from.translation.vector.lerp(&to.translation.vector, share);
                let pose = Pose::from_parts(at.into(), Rotation3::new(turn * share) * from.rotation);
                let Ok(next) = robot.inverse_near_unlimited(&(pose * flange_from_tcp.inverse()), &motor) else {
                    return Err(proptest::test_runner::TestCaseError::reject("the line leaves the reach of the arm"));
                };
                // Otherwise the line passes a singular posture.
                proptest::prop_assume!((next - motor).amax() < 0.02);
                motor = next;
            }
            proptest::prop_assume!(robot.limit_violation(&motor).is_none());
            let found = robot.inverse_along(&flange_from_tcp, &robot.forward(&motor), &joints(0)).unwrap();
            proptest::prop_assert!((found - motor).amax() < 1e-6, "{found} instead of {motor}");
        }
    }

    #[test]
    fn a_joint_motion_of_an_arm_without_a_closed_form_goes_to_the_nearest_of_all_solutions() {
        let robot = crate::Builtin::named("ur10e").unwrap().robot();
        let motor = deg([11.4, -100.0, 113.3, -40.0, 60.0, 20.0]);
        let pose = robot.forward(&motor);
        let mut differs = 0;
        for k in 0..40 {
            let near = Joints::from_fn(|i, _| motor[i] + 1.6 * f64::from((7 * k + 11 * i as i32) % 21 - 10) / 10.0);
            let found = robot.inverse_conf(&pose, None, &near).unwrap();
            let far = |motor: &Joints| (robot.nearest_turns(motor, &near) - near).norm();
            let least = robot.inverse_all(&pose).unwrap().iter().map(far).fold(f64::INFINITY, f64::min);
            assert!(far(&found) < least + 1e-6, "{found} {least}");
            differs += usize::from(robot.inverse_near(&pose, &near).is_ok_and(|newton| far(&newton) > least + 1e-3));
        }
        assert!(differs > 0);
    }

    #[test]
    fn the_independent_solver_agrees_at_p2() {
        // tests/vectors, inverse of P2 with tool A: second shoulder-front, elbow-down solution.
        let robot = BUILTIN[0].robot();
        let motor = deg([10.0, 20.0, 15.0, 30.0, 40.0, -60.0]);
        let other = robot.inverse(&robot.forward(&motor), &motor).unwrap()[2].unwrap();
        let expected = [10.0, 98.616_001_962_803, -41.566_382_672_018, 18.764_813_870_298, 92.435_078_487_965];
        for (i, want) in expected.into_iter().enumerate() {
            assert!((other[i].to_degrees() - want).abs() < 1e-9, "axis {}: {}", i + 1, other[i].to_degrees());
        }
    }
}
