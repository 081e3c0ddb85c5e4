use super::{DhRow, Joints, LimitViolation, Links, Pose, Robot, turn_between};
use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// One of the eight solutions of the explicit inverse, by its three signs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Branch {
    /// Wrist centre behind axis 1.
    pub rear: bool,
    /// Wrist centre behind the lower arm.
    pub behind: bool,
    /// Axis 5 negative.
    pub flipped: bool,
}

impl Branch {
    /// All eight, in the order of cfx.
    pub const ALL: [Self; 8] = {
        let mut all = [Self { rear: false, behind: false, flipped: false }; 8];
        let mut i = 0;
        while i < 8 {
            all[i] = Self { rear: i & 4 != 0, behind: i & 2 != 0, flipped: i & 1 != 0 };
            i += 1;
        }
        all
    };

    /// cfx of RAPID confdata: also the index into [`Branch::ALL`].
    #[must_use]
    pub fn cfx(self) -> usize {
        4 * usize::from(self.rear) + 2 * usize::from(self.behind) + usize::from(self.flipped)
    }
}

/// Motor angles of each branch (index: [`Branch::cfx`]), rad, within ±π; `None` if the branch does not reach the pose.
pub type Solutions = [Option<Joints>; 8];

/// Why no motor angles reach a pose.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
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

/// Below this |sin q5| the wrist is singular: axes 4 and 6 are parallel, and q4 keeps its value. With q4 kept, the
/// orientation is missed by at most this angle, which moves a point at a distance of 0.3 m by 0.03 µm, far less than a
/// printed digit.
const SINGULAR_WRIST: f64 = 1e-7;

/// Angles (rad) and lengths (m) that differ by less than this from a special value are taken to be that value. Cells
/// declare them to 1e-9 at best.
const SAME: f64 = 1e-9;

/// The explicit inverse of an arm with parallel axes 2 and 3 and a spherical wrist.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClosedForm {
    pub(super) a1: f64,
    pub(super) a2: f64,
    pub(super) d1: f64,
    /// Lateral offset of the arm plane from axis 1.
    pub(super) b: f64,
    /// Length of the forearm from elbow to wrist centre.
    pub(super) l3: f64,
    /// Angle between the forearm and x of link 3.
    pub(super) gamma: f64,
    pub(super) sin_gamma: f64,
    pub(super) cos_gamma: f64,
    pub(super) d6: f64,
    pub(super) theta: [f64; 6],
}

impl ClosedForm {
    /// The explicit inverse for these rows; `None` if they have none.
    pub(super) fn of(rows: &[DhRow; 6]) -> Option<Self> {
        const TWISTS: [f64; 6] = [0.0, -FRAC_PI_2, 0.0, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2];
        let same = |a: f64, b: f64| (a - b).abs() < SAME;
        let twists = rows.iter().zip(TWISTS).all(|(row, twist)| same(row.alpha, twist));
        let wrist = same(rows[0].a, 0.0) && same(rows[4].a, 0.0) && same(rows[5].a, 0.0) && same(rows[4].d, 0.0);
        let (a3, d4) = (rows[3].a, rows[3].d);
        (twists && wrist && rows[2].a > 0.0 && a3.hypot(d4) > 0.0).then(|| Self {
            a1: rows[1].a,
            a2: rows[2].a,
            d1: rows[0].d,
            b: rows[1].d + rows[2].d,
            l3: a3.hypot(d4),
            gamma: d4.atan2(a3),
            sin_gamma: d4 / d4.hypot(a3),
            cos_gamma: a3 / d4.hypot(a3),
            d6: rows[5].d,
            theta: rows.map(|row| row.theta),
        })
    }

    /// [`Robot::posture`] at serial joint angles, rad.
    fn posture(&self, serial: &Joints) -> (bool, bool) {
        let (upper, elbow) = (serial[1] + self.theta[1], serial[2] + self.theta[2] + self.gamma);
        let ahead = self.a1 + self.a2 * upper.cos() + self.l3 * (upper + elbow).cos();
        (ahead < 0.0, wrap(elbow) < 0.0)
    }

    /// All branches as serial joint angles. A singular wrist keeps `q4` (rad). If no branch reaches the pose, the error
    /// is the distance of the wrist centre from the reach of the arm, m.
    fn solve(&self, base_from_flange: &Pose, q4: f64) -> Result<Solutions, f64> {
        let flange = base_from_flange.rotation.matrix();
        let wrist = base_from_flange.translation.vector - flange.column(2) * self.d6;
        let mut solutions = [None; 8];
        let mut out_of_reach = f64::INFINITY;
        let planar = wrist.x * wrist.x + wrist.y * wrist.y - self.b * self.b;
        if planar < 0.0 {
            return Err(self.b.abs() - wrist.x.hypot(wrist.y));
        }
        for rear in [false, true] {
            let forward = if rear { -planar.sqrt() } else { planar.sqrt() };
            let theta1 = self.theta1(&wrist, forward);
            let (r, s) = (forward - self.a1, wrist.z - self.d1);
            let rho = r.hypot(s);
            let cosine = (rho * rho + self.a2 * self.a2 - self.l3 * self.l3) / (2.0 * self.a2 * rho);
            if !(-1.0..=1.0).contains(&cosine) {
                let by = (rho - (self.a2 + self.l3)).max((self.a2 - self.l3).abs() - rho);
                out_of_reach = out_of_reach.min(by.max(0.0));
                continue;
            }
            for behind in [false, true] {
                let lift = if behind { -cosine.acos() } else { cosine.acos() };
                let (e2, e3) = self.elevations(r, s, lift);
                let wrist = Wrist::new(flange, theta1, e3);
                for flipped in [false, true] {
                    let serial = self.serial(theta1, e2, e3, wrist.angles(flipped, q4 + self.theta[3]));
                    solutions[Branch { rear, behind, flipped }.cfx()] = Some(serial);
                }
            }
        }
        if solutions.iter().all(Option::is_none) { Err(out_of_reach) } else { Ok(solutions) }
    }

    /// Distance of the wrist centre from the reach of the arm that points forward, or to the rear, m.
    fn out_of_reach(&self, base_from_flange: &Pose, rear: bool) -> f64 {
        let wrist = base_from_flange.translation.vector - base_from_flange.rotation.matrix().column(2) * self.d6;
        let planar = (wrist.x * wrist.x + wrist.y * wrist.y - self.b * self.b).max(0.0).sqrt();
        let rho = (if rear { -planar } else { planar } - self.a1).hypot(wrist.z - self.d1);
        (rho - (self.a2 + self.l3)).max((self.a2 - self.l3).abs() - rho).max(0.0)
    }

    fn theta1(&self, wrist: &Vector3<f64>, forward: f64) -> f64 {
        wrist.y.atan2(wrist.x) - self.b.atan2(forward)
    }

    /// Elevations of lower arm and link 3 for a wrist centre at (r, s) from the shoulder.
    fn elevations(&self, r: f64, s: f64, lift: f64) -> (f64, f64) {
        let e2 = s.atan2(r) + lift;
        let (sin, cos) = e2.sin_cos();
        let forearm = (s - self.a2 * sin).atan2(r - self.a2 * cos);
        (e2, forearm + self.gamma)
    }

    fn serial(&self, theta1: f64, e2: f64, e3: f64, [theta4, theta5, theta6]: [f64; 3]) -> Joints {
        let theta = [theta1, -e2, e2 - e3, theta4, theta5, theta6];
        Vector6::from_fn(|i, _| theta[i] - self.theta[i])
    }

    /// The solution in the branch of the serial angles `near`, equal to that of [`ClosedForm::solve`], and the distance
    /// (rad) from them up to which it is certainly nearer than any other; `None` where branches meet.
    fn branch_of(&self, base_from_flange: &Pose, near: &Joints) -> Option<(Joints, f64)> {
        let flange = base_from_flange.rotation.matrix();
        let wrist = base_from_flange.translation.vector - flange.column(2) * self.d6;
        let planar = wrist.x * wrist.x + wrist.y * wrist.y - self.b * self.b;
        // Here the solutions in front and to the rear can differ by less than a quarter turn of axis 1.
        if planar <= self.b * self.b {
            return None;
        }
        let dh = near + Vector6::from(self.theta);
        let front = self.theta1(&wrist, planar.sqrt());
        let rear = wrap(dh[0] - front).abs() > FRAC_PI_2;
        let forward = if rear { -planar.sqrt() } else { planar.sqrt() };
        let theta1 = if rear { self.theta1(&wrist, forward) } else { front };
        let (r, s) = (forward - self.a1, wrist.z - self.d1);
        let rho = r.hypot(s);
        let cosine = (rho * rho + self.a2 * self.a2 - self.l3 * self.l3) / (2.0 * self.a2 * rho);
        if !(-1.0..=1.0).contains(&cosine) {
            return None;
        }
        let lift = cosine.acos();
        // The wrist centre is behind the lower arm, or in front of it.
        let behind = wrap(dh[2] + self.gamma) < 0.0;
        let (e2, e3) = self.elevations(r, s, if behind { -lift } else { lift });
        let wrist = Wrist::new(flange, theta1, e3);
        if wrist.sine < SINGULAR_WRIST {
            return None;
        }
        let serial = self.serial(theta1, e2, e3, wrist.angles(wrap(dh[4]) < 0.0, 0.0));
        // In other branches, axis 1 differs by a quarter turn at least, axis 2 by twice the lift, or axis 4 by half a
        // turn.
        Some((serial, lift.min(PI - lift).min(FRAC_PI_4)))
    }
}

/// The part of a pose that the wrist produces: `link3ᵀ · flange · Rx(90°) = Ry(θ4) Rz(θ5) Ry(θ6)`.
struct Wrist {
    turn: Matrix3<f64>,
    /// |sin θ5|.
    sine: f64,
}

impl Wrist {
    fn new(flange: &Matrix3<f64>, theta1: f64, e3: f64) -> Self {
        let (s1, c1) = theta1.sin_cos();
        let (se, ce) = e3.sin_cos();
        // Link 3 in the base frame: x points along the elevation e3 in the plane of the arm, z is perpendicular to this
        // plane.
        let link3 = Matrix3::new(c1 * ce, c1 * se, -s1, s1 * ce, s1 * se, c1, se, -ce, 0.0);
        let m = link3.transpose() * flange;
        let turn = Matrix3::from_columns(&[m.column(0).into_owned(), m.column(2).into_owned(), -m.column(1)]);
        Self { turn, sine: turn[(0, 1)].hypot(turn[(2, 1)]) }
    }

    /// DH angles of axes 4, 5 and 6. A singular wrist keeps `theta4`.
    fn angles(&self, flipped: bool, theta4: f64) -> [f64; 3] {
        let (m, sign) = (&self.turn, if flipped { -1.0 } else { 1.0 });
        let theta5 = (sign * self.sine).atan2(m[(1, 1)]);
        if self.sine < SINGULAR_WRIST {
            let rest = (Rotation3::from_axis_angle(&Vector3::y_axis(), theta4)
                * Rotation3::from_axis_angle(&Vector3::z_axis(), theta5))
            .inverse()
                * m;
            return [theta4, theta5, rest[(0, 2)].atan2(rest[(0, 0)])];
        }
        let theta4 = (sign * m[(2, 1)]).atan2(-sign * m[(0, 1)]);
        [theta4, theta5, (sign * m[(1, 2)]).atan2(sign * m[(1, 0)])]
    }
}

/// An angle reduced to ±π, rad.
pub(crate) fn wrap(angle: f64) -> f64 {
    // Written without `round`, which is a function call on processors without that instruction.
    if angle.abs() < 3.0 { angle } else { angle - (angle / TAU).round() * TAU }
}

impl Robot {
    /// Motor angles of every branch that reaches a flange pose, rad, without regard to axis limits. A singular wrist
    /// keeps q4 of `near`. For robots without an explicit inverse, the result is the single solution that Newton's
    /// method finds from `near`, at the index of its posture.
    ///
    /// # Errors
    /// The pose is out of reach.
    ///
    /// # Examples
    /// ```
    /// # use deflex::robot::{Builtin, Joints};
    /// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// let motor = Joints::new(0.1, 0.2, 0.3, 0.4, 0.5, 0.6);
    /// let branches = robot.inverse(&robot.forward(&motor), &motor).expect("within reach");
    /// assert!(branches.iter().flatten().any(|found| (found - motor).amax() < 1e-9));
    /// ```
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
    ///
    /// # Examples
    /// ```
    /// # use deflex::robot::{Builtin, Joints};
    /// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// let motor = Joints::new(0.1, 0.2, 0.3, 0.4, 0.5, 0.6);
    /// let found = robot.inverse_near(&robot.forward(&motor), &motor.add_scalar(0.01)).expect("within reach");
    /// assert!((found - motor).amax() < 1e-9);
    /// ```
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

    /// Index of the branch of motor angles (rad), which is their [cfx](Branch::cfx); `None` without an explicit
    /// inverse.
    pub(crate) fn branch(&self, motor: &Joints) -> Option<usize> {
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
    pub(crate) fn inverse_in(
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
    use crate::robot::BUILTIN;

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
                    assert_eq!(crate::robot::confdata_of(&robot, motor).cfx as usize, cfx);
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
