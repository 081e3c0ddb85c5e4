//! Solves arms with an explicit inverse for eight targets at once: the chain and the inverse of
//! [`Robot::forward`](super::Robot::forward) and of the inverse, computed with sines and cosines instead of angles.

use super::closed_form::ClosedForm;
use super::kinematics::{Six, one, set};
use super::{Joints, Pose, Robot, turn_between, turns_between};
use deflex_lanes::{Frame, LaneMask, Lanes, Mask, ROUND, Real, SinCos, Vector, WIDTH, six, widest};
use nalgebra::{Rotation3, Vector3};
use std::f64::consts::{FRAC_PI_4, TAU};

/// An arm with an explicit inverse, solved for a batch of targets.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct BatchArm<'a> {
    robot: &'a Robot,
    form: &'a ClosedForm,
}

/// Below this sine of the angle between upper arm and forearm, or of axis 5, digits are lost and branches meet. The
/// scalar inverse solves such targets.
const CLOSE: f64 = 0.05;

/// A target as the program states it.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct WrittenTarget<'a> {
    pub base_from_wobj: &'a Pose,
    pub position_mm: &'a [f64; 3],
    /// The orientation, scalar first, of any length.
    pub quat: &'a [f64; 4],
    pub flange_from_tcp: &'a Pose,
    /// Motor angles nearby, which choose the branch, rad.
    pub near: &'a Joints,
}

/// Targets of a batch, and the inverse solution of each.
#[derive(Default)]
#[doc(hidden)]
pub struct BatchSolutions {
    base_from_wobj: Frame,
    flange_from_tcp: Frame,
    position_mm: Vector,
    quat: [Lanes; 4],
    near: Six<Lanes>,
    /// Pose of the TCP in the work object as programmed, m.
    pub wobj_from_tcp: Frame,
    /// Motor angles that reach this pose, rad.
    motor: Six<Lanes>,
    /// The same, target by target: separated at once, so that none is read right after it was written to memory.
    motors: [Joints; WIDTH],
    /// Squared distance, rad², within which these motor angles are certainly the nearest solution; 0 if the scalar inverse has to decide.
    reach: Lanes,
    from: Frame,
    turn: Vector,
    small: LaneMask,
}

impl BatchSolutions {
    fn set<'p>(&mut self, count: usize, place: &impl Fn(usize) -> WrittenTarget<'p>) {
        let first = place(0);
        // Successive targets mostly have the same tool and work object.
        self.base_from_wobj = Frame::of(first.base_from_wobj);
        self.flange_from_tcp = Frame::of(first.flange_from_tcp);
        for lane in 0..count {
            let WrittenTarget { base_from_wobj, position_mm, quat, flange_from_tcp, near } = place(lane);
            if !std::ptr::eq(base_from_wobj, first.base_from_wobj) {
                self.base_from_wobj.set(lane, base_from_wobj);
            }
            if !std::ptr::eq(flange_from_tcp, first.flange_from_tcp) {
                self.flange_from_tcp.set(lane, flange_from_tcp);
            }
            self.position_mm.set(lane, &Vector3::from(*position_mm));
            for (all, one) in self.quat.iter_mut().zip(quat) {
                all.set(lane, *one);
            }
            set(&mut self.near, lane, near);
        }
    }

    #[inline(always)]
    fn inverse(&mut self, robot: &BatchArm<'_>) {
        let base_from_flange = self.base_from_wobj.then(&self.wobj_from_tcp).without(&self.flange_from_tcp);
        (self.motor, self.reach) = robot.inverse(&base_from_flange, &self.near);
    }

    fn separate(&mut self) {
        for (lane, motor) in self.motors.iter_mut().enumerate() {
            *motor = one(&self.motor, lane);
        }
    }

    /// Computes the rotations of the targets relative to orientations in the work object.
    pub fn turn_from<'p>(&mut self, count: usize, from: impl Fn(usize) -> &'p Rotation3<f64>) {
        for lane in 0..count {
            self.from.set_axes(lane, from(lane));
        }
        self.compute_turns();
    }

    /// The computation of [`BatchSolutions::turn_from`]. It has no type parameters, so it is compiled here alone, and not again in each crate
    /// that gives a closure.
    fn compute_turns(&mut self) {
        widest!(<'a> (found: &'a mut BatchSolutions = self) {
            (found.turn, found.small) = turns_between(&found.from, &found.wobj_from_tcp);
        });
    }

    /// Rotation vector from that orientation, rad.
    #[inline(always)]
    pub fn turn(&self, lane: usize) -> Vector3<f64> {
        turn_of(lane, (&self.turn, self.small), &self.from, &self.wobj_from_tcp)
    }

    /// The motor angles of a target; `None` unless they are certainly the solution nearest to the given ones, rad.
    pub fn nearest(&self, lane: usize, near: &Joints) -> Option<Joints> {
        let motor = &self.motors[lane];
        ((motor - near).norm_squared() < self.reach.lane(lane)).then_some(*motor)
    }
}

/// Rotation vector of a lane from one orientation to another, rad, given those of all lanes and where they are right.
#[inline(always)]
#[doc(hidden)]
pub fn turn_of<R: Real>(
    lane: usize,
    (turn, right): (&Vector<R>, R::Mask),
    from: &Frame<R>,
    to: &Frame<R>,
) -> Vector3<f64> {
    // Element by element: the whole matrix would be written to memory and read again.
    let [x, y, z] = if right.lane(lane) {
        [turn.x.lane(lane), turn.y.lane(lane), turn.z.lane(lane)]
    } else {
        turn_between(&from.rotation(lane), &to.rotation(lane)).into()
    };
    Vector3::new(x, y, z)
}

impl<'a> BatchArm<'a> {
    /// The arm for several lanes; `None` if it has no explicit inverse.
    pub fn of(robot: &'a Robot) -> Option<Self> {
        Some(Self { robot, form: robot.closed_form()? })
    }

    /// Solves the first `count` of eight targets.
    pub fn find<'p>(&self, count: usize, place: impl Fn(usize) -> WrittenTarget<'p>, found: &mut BatchSolutions) {
        if count == 0 {
            return;
        }
        found.set(count, &place);
        self.solve_written(found);
    }

    /// The computation of [`BatchArm::find`], compiled here alone.
    fn solve_written(&self, found: &mut BatchSolutions) {
        widest!(<'a> (robot: &'a BatchArm<'a> = self, found: &'a mut BatchSolutions = found) {
            found.wobj_from_tcp = Frame::of_quaternion(found.position_mm * Lanes::of(1e-3), found.quat);
            found.inverse(robot);
        });
        found.separate();
    }

    /// Solves targets whose poses are known, in one work object, with one tool, and near the same motor angles (rad).
    pub fn find_posed(
        &self,
        (base_from_wobj, flange_from_tcp): (&Pose, &Pose),
        near: &Joints,
        found: &mut BatchSolutions,
    ) {
        (found.base_from_wobj, found.flange_from_tcp) = (Frame::of(base_from_wobj), Frame::of(flange_from_tcp));
        found.near = six!(i => Lanes::of(near[i]));
        widest!(<'a> (robot: &'a BatchArm<'a> = self, found: &'a mut BatchSolutions = found) {
            found.inverse(robot);
        });
        found.separate();
    }

    /// Motor angles that reach flange poses in the branch of the angles `near`, rad, and the lanes in which they are
    /// certainly the nearest solution.
    #[inline(always)]
    pub fn nearest<R: Real>(&self, base_from_flange: &Frame<R>, near: &Six<R>) -> (Six<R>, R::Mask) {
        let (motor, reach) = self.inverse(base_from_flange, near);
        let [a, b, c, d, e, f] = six!(i => (motor[i] - near[i]) * (motor[i] - near[i]));
        (motor, (a + b + c + d + e + f).lt(reach))
    }

    /// Motor angles that reach flange poses in the branch of the angles `near`, in the turn nearest to them, rad; and
    /// the squared distance, rad², up to which they are certainly the nearest of all solutions. It is 0 if limits are
    /// exceeded or digits are lost.
    #[inline(always)]
    fn inverse<R: Real>(&self, base_from_flange: &Frame<R>, near: &Six<R>) -> (Six<R>, R) {
        let motor_near = near;
        let theta = six!(i => R::of(self.robot.links.rows()[i].theta));
        let near = self.robot.joints(&theta, near);
        let form = self.form;
        let wrist = base_from_flange.origin - base_from_flange.z * R::of(form.d6);
        let reach = wrist.x * wrist.x + wrist.y * wrist.y;
        let planar = reach - form.b * form.b;
        // Where this holds, the solutions in front and to the rear differ by at least a quarter turn of axis 1.
        let apart = R::of(form.b * form.b).lt(planar);
        let forward = planar.sqrt();
        let shoulder = |forward: R| SinCos {
            sin: (wrist.y * forward - wrist.x * form.b) / reach,
            cos: (wrist.x * forward + wrist.y * form.b) / reach,
        };
        let front = shoulder(forward);
        let rear = front.minus(near[0]).cos.lt(0.0);
        let forward = rear.negate(forward);
        let other = shoulder(forward);
        let q1 = SinCos { sin: rear.select(other.sin, front.sin), cos: rear.select(other.cos, front.cos) };

        // Elevations of upper arm and link 3 above the horizontal.
        let (r, s) = (forward - form.a1, wrist.z - form.d1);
        let square = r * r + s * s;
        let rho = square.sqrt();
        let cosine = (square + (form.a2 * form.a2 - form.l3 * form.l3)) / (rho * (2.0 * form.a2));
        let sine = (R::of(1.0) - cosine * cosine).sqrt();
        let bent = sine.ge(CLOSE);
        let gamma = SinCos { sin: R::of(form.sin_gamma), cos: R::of(form.cos_gamma) };
        // The wrist centre is behind the lower arm, or in front of it.
        let behind = near[2].plus(gamma).sin.lt(0.0);
        let to_wrist = SinCos { sin: s / rho, cos: r / rho };
        let upper = to_wrist.plus(SinCos { sin: behind.negate(sine), cos: cosine });
        let forearm = SinCos {
            sin: (s - upper.sin * form.a2) * (1.0 / form.l3),
            cos: (r - upper.cos * form.a2) * (1.0 / form.l3),
        };
        let link3 = forearm.plus(gamma);
        let q2 = SinCos { sin: -upper.sin, cos: upper.cos };
        let q3 = upper.minus(link3);

        // The wrist: link3ᵀ · flange · Rx(90°) = Ry(θ4) Rz(θ5) Ry(θ6), see `Wrist`.
        let ahead = Vector::new(q1.cos * link3.cos, q1.sin * link3.cos, link3.sin);
        let up = Vector::new(q1.cos * link3.sin, q1.sin * link3.sin, -link3.cos);
        let side = Vector::new(-q1.sin, q1.cos, R::ZERO);
        let Frame { x, y, z, .. } = *base_from_flange;
        let (m01, m11, m21) = (ahead.dot(z), up.dot(z), side.dot(z));
        let (m10, m12) = (up.dot(x), -up.dot(y));
        let sin5 = (m01 * m01 + m21 * m21).sqrt();
        let straight = sin5.ge(CLOSE);
        let flipped = near[4].sin.lt(0.0);
        let q5 = SinCos { sin: flipped.negate(sin5), cos: m11 };
        let q4 = SinCos { sin: flipped.negate(m21) / sin5, cos: flipped.negate(-m01) / sin5 };
        let q6 = SinCos { sin: flipped.negate(m12) / sin5, cos: flipped.negate(m10) / sin5 };

        let turns = [q1, q2, q3, q4, q5, q6];
        let motor = self.robot.motor(&six!(i => turns[i].angle() - theta[i]));
        let motor = six!(i => motor[i] + (((motor_near[i] - motor[i]) * (1.0 / TAU) + ROUND) - ROUND) * TAU);
        let mut valid = apart & bent & straight;
        let limits = &self.robot.limits;
        let counted = motor[2] + motor[1] * self.robot.axes.counted_23();
        for (i, axis) in [motor[0], motor[1], counted, motor[3], motor[4], motor[5]].into_iter().enumerate() {
            valid = valid & self.inside(axis, limits.min[i], limits.max[i]);
        }
        if let Some((min, max)) = limits.elbow {
            valid = valid & self.inside(motor[2] + motor[1] * self.robot.axes.elbow_of_second(), min, max);
        }
        // In other branches, axis 1 differs by a quarter turn at least, axis 2 by twice the lift, or axis 4 by half a
        // turn.
        let (far, lift) = (FRAC_PI_4 * FRAC_PI_4, sine * sine);
        (motor, valid.select(lift.lt(far).select(lift, R::of(far)), R::ZERO))
    }

    #[inline(always)]
    fn inside<R: Real>(&self, angle: R, min: f64, max: f64) -> R::Mask {
        angle.ge(min) & R::of(max).ge(angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BUILTIN;
    use nalgebra::Translation3;
    use proptest::prelude::*;

    /// Rounding for an arm of some metres.
    const SAME: f64 = 1e-11;
    /// Error of angles near singular postures, where digits are lost, rad.
    const SAME_ANGLE: f64 = 1e-8;

    proptest! {
        #[test]
        fn what_is_found_is_what_the_plain_inverse_finds(
            robot in 0..BUILTIN.len(),
            shares in prop::array::uniform8(prop::array::uniform6(0.01_f64..0.99)),
            step in prop::array::uniform6(-0.3_f64..0.3),
            length in prop::array::uniform4(0.2_f64..3.0),
        ) {
            let robot = BUILTIN[robot].robot();
            let Some(eight) = BatchArm::of(&robot) else { return Ok(()) };
            let tool = Pose::from_parts(Translation3::new(0.1, -0.02, 0.3), Rotation3::from_euler_angles(0.2, 0.9, -0.4));
            let wobj = Pose::from_parts(Translation3::new(1.0, 0.4, -0.3), Rotation3::from_euler_angles(0.0, 0.1, 0.7));
            let motors = shares.map(|shares| {
                Joints::from_fn(|i, _| robot.limits.min[i] + shares[i] * (robot.limits.max[i] - robot.limits.min[i]))
            });
            let nears = motors.map(|motor| motor + Joints::from(step));
            let poses = motors.map(|motor| wobj.inv_mul(&(robot.forward(&motor) * tool)));
            let written: Vec<([f64; 3], [f64; 4])> = poses
                .iter()
                .enumerate()
                .map(|(i, pose)| {
                    let quat = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.rotation);
                    let (size, v) = (length[i % 4], pose.translation.vector * 1e3);
                    ([v.x, v.y, v.z], [quat.w * size, quat.i * size, quat.j * size, quat.k * size])
                })
                .collect();
            let places: Vec<WrittenTarget<'_>> = written
                .iter()
                .zip(&nears)
                .map(|((position_mm, quat), near)| {
                    WrittenTarget { base_from_wobj: &wobj, position_mm, quat, flange_from_tcp: &tool, near }
                })
                .collect();
            let (mut all, mut again) = (BatchSolutions::default(), BatchSolutions::default());
            eight.find(places.len(), |lane| places[lane], &mut all);
            for i in 0..WIDTH {
                let off = all.wobj_from_tcp.lane(i).inverse() * poses[i];
                prop_assert!(off.translation.vector.norm() < SAME && (off.rotation.matrix() - nalgebra::Matrix3::identity()).norm() < SAME);
                let flange = robot.forward(&motors[i]);
                let plain = robot.inverse_near(&flange, &nears[i]);
                if let Some(motor) = all.nearest(i, &nears[i]) {
                    prop_assert!((motor - plain.unwrap()).amax() < SAME_ANGLE, "{motor} {:?}", plain);
                    let reached = robot.forward(&motor).to_homogeneous() - flange.to_homogeneous();
                    prop_assert!(reached.norm() < SAME, "{reached}");
                }
                // Starting at the solution itself, the batch must find it unless another branch is near.
                let sine = |angle: f64| angle.sin().abs();
                let (serial, form) = (robot.serial_from_motor(&motors[i]), robot.closed_form().unwrap());
                let wrist = robot.frames(&motors[i]).origin(4);
                let easy = robot.limit_violation(&motors[i]).is_none() && sine(serial[4] + form.theta[4]) > 0.3 && sine(serial[2] + robot.links.rows()[2].theta + form.gamma) > 0.3 && wrist.xy().norm() > 0.4;
                eight.find(1, |_| WrittenTarget { near: &motors[i], ..places[i] }, &mut again);
                let again = again.nearest(0, &motors[i]);
                prop_assert!(!easy || again.is_some(), "{}", motors[i]);
            }
        }
    }
}
