//! Arms with an explicit inverse, eight targets at once: the chain and the inverse of [`forward`](super::forward) and
//! [`inverse`](super::inverse), on sines and cosines instead of angles.

use super::inverse::ClosedForm;
use super::{Joints, Limits, Pose, Robot};
use crate::lanes::{Frame, Lanes, Mask, ROUND, Turn, Vector, WIDTH, six, widest};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_4, TAU};

/// Such an arm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Eight<'a> {
    form: &'a ClosedForm,
    limits: &'a Limits,
    parallelogram: bool,
    a: [f64; 6],
    d: [f64; 6],
    theta: [f64; 6],
}

/// Motor angles, rad, or what goes with them.
pub(crate) type EightJoints = [Lanes; 6];

/// Puts one target's into a lane.
#[inline(always)]
pub(crate) fn set(all: &mut EightJoints, lane: usize, one: &Joints) {
    for (all, one) in all.iter_mut().zip(one.iter()) {
        all.0[lane] = *one;
    }
}

/// One target's.
#[inline(always)]
pub(crate) fn one(all: &EightJoints, lane: usize) -> Joints {
    let mut one = Joints::zeros();
    for (one, all) in one.iter_mut().zip(all) {
        *one = all.0[lane];
    }
    one
}

/// Denavit-Hartenberg angles (joint plus offset) of each joint.
pub(crate) type EightTurns = [Turn; 6];

/// Below this sine between upper arm and forearm, or of axis 5, digits are lost and branches meet: not here.
const CLOSE: f64 = 0.05;

/// A target as a program writes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<'a> {
    pub(crate) base_from_wobj: &'a Pose,
    pub(crate) position_mm: &'a [f64; 3],
    /// Scalar first, of any length.
    pub(crate) quat: &'a [f64; 4],
    pub(crate) flange_from_tcp: &'a Pose,
    /// Motor angles close by, which choose the branch, rad.
    pub(crate) near: &'a Joints,
}

/// What a target comes to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    /// Where the program sends the TCP, m.
    pub(crate) wobj_from_tcp: Pose,
    /// Motor angles that reach it, rad.
    motor: Joints,
    /// From closer than this they are surely the nearest, square of rad; 0 where another way has to be asked.
    reach: f64,
}

impl Found {
    /// The motor angles, where they are surely the nearest to others (rad).
    pub(crate) fn nearest(&self, near: &Joints) -> Option<Joints> {
        ((self.motor - near).norm_squared() < self.reach).then_some(self.motor)
    }
}

impl<'a> Eight<'a> {
    /// The arm in lanes, where it has an explicit inverse.
    pub(crate) fn of(robot: &'a Robot) -> Option<Self> {
        let rows = robot.links.rows();
        Some(Self {
            form: robot.closed_form()?,
            limits: &robot.limits,
            parallelogram: robot.parallelogram,
            a: rows.map(|row| row.a),
            d: rows.map(|row| row.d),
            theta: rows.map(|row| row.theta),
        })
    }

    /// What up to eight targets come to.
    pub(crate) fn find<'p>(&self, count: usize, place: impl Fn(usize) -> Place<'p>, mut put: impl FnMut(usize, Found)) {
        let (mut wobj, mut tool) = (Frame::default(), Frame::default());
        let (mut position, mut quat) = (Vector::default(), [Lanes::ZERO; 4]);
        let mut near = EightJoints::default();
        for lane in 0..count.min(WIDTH) {
            let place = place(lane);
            wobj.set(lane, place.base_from_wobj);
            tool.set(lane, place.flange_from_tcp);
            position.set(lane, &Vector3::from(*place.position_mm));
            for (all, one) in quat.iter_mut().zip(place.quat) {
                all.0[lane] = *one;
            }
            set(&mut near, lane, place.near);
        }
        let (mut pose, mut motor, mut reach) = (Frame::default(), EightJoints::default(), Lanes::ZERO);
        widest!(<'a> (
            robot: &'a Eight<'a> = self,
            wobj: &'a Frame = &wobj,
            tool: &'a Frame = &tool,
            position: &'a Vector = &position,
            quat: &'a [Lanes; 4] = &quat,
            near: &'a EightJoints = &near,
            pose: &'a mut Frame = &mut pose,
            motor: &'a mut EightJoints = &mut motor,
            reach: &'a mut Lanes = &mut reach,
        ) {
            *pose = Frame::of_quaternion(*position * 1e-3, *quat);
            (*motor, *reach) = robot.inverse(&wobj.then(pose).without(tool), near);
        });
        for lane in 0..count.min(WIDTH) {
            put(lane, Found { wobj_from_tcp: pose.lane(lane), motor: one(&motor, lane), reach: reach.0[lane] });
        }
    }

    /// Changes of serial joint angles from those of motor angles, rad.
    #[inline(always)]
    pub(crate) fn serial_from_motor(&self, motor: &EightJoints) -> EightJoints {
        let mut serial = *motor;
        if self.parallelogram {
            serial[2] = serial[2] - motor[1];
        }
        serial
    }

    #[inline(always)]
    fn motor_from_serial(&self, serial: &EightJoints) -> EightJoints {
        let mut motor = *serial;
        if self.parallelogram {
            motor[2] = motor[2] + serial[1];
        }
        motor
    }

    /// Torques at the motors, N·m.
    #[inline(always)]
    pub(crate) fn motor_torque_from_serial(&self, serial: &EightJoints) -> EightJoints {
        let mut motor = *serial;
        if self.parallelogram {
            motor[1] = motor[1] - serial[2];
        }
        motor
    }

    /// Denavit-Hartenberg angles at motor angles, rad.
    #[inline(always)]
    pub(crate) fn angles(&self, motor: &EightJoints) -> EightJoints {
        let serial = self.serial_from_motor(motor);
        six!(i => serial[i] + self.theta[i])
    }

    /// Their sines and cosines.
    #[inline(always)]
    pub(crate) fn turns(&self, motor: &EightJoints) -> EightTurns {
        let angles = self.angles(motor);
        six!(i => Turn::of(angles[i]))
    }

    /// Frames of the links in the base. The twists are those of every arm with this inverse: 0, −90, 0, −90, 90, −90°.
    #[inline(always)]
    pub(crate) fn chain(&self, turns: &EightTurns) -> [Frame; 6] {
        let one = |v: Vector3<f64>| Vector::of(&v);
        let base =
            Frame { x: one(Vector3::x()), y: one(Vector3::y()), z: one(Vector3::z()), origin: Vector::default() };
        let first = self.link(0, &base, base.y, base.z, turns);
        let second = self.link(1, &first, first.z * -1.0, first.y, turns);
        let third = self.link(2, &second, second.y, second.z, turns);
        let fourth = self.link(3, &third, third.z * -1.0, third.y, turns);
        let fifth = self.link(4, &fourth, fourth.z, fourth.y * -1.0, turns);
        let sixth = self.link(5, &fifth, fifth.z * -1.0, fifth.y, turns);
        [first, second, third, fourth, fifth, sixth]
    }

    /// Link `i`, with y and z of the one before turned by the twist between them.
    #[inline(always)]
    fn link(&self, i: usize, before: &Frame, across: Vector, axis: Vector, turns: &EightTurns) -> Frame {
        let Turn { sin, cos } = turns[i];
        Frame {
            x: before.x * cos + across * sin,
            y: across * cos - before.x * sin,
            z: axis,
            origin: before.origin + before.x * self.a[i] + axis * self.d[i],
        }
    }

    /// Motor angles at flange poses in the branch that others are in, rad: which turn of an axis is nearest to these too. And
    /// from how close they are surely the nearest of all, square of rad; 0 where limits are passed or digits lost.
    #[inline(always)]
    fn inverse(&self, base_from_flange: &Frame, near: &EightJoints) -> (EightJoints, Lanes) {
        let motor_near = near;
        let near = self.turns(near);
        let form = self.form;
        let wrist = base_from_flange.origin - base_from_flange.z * form.d6;
        let reach = wrist.x * wrist.x + wrist.y * wrist.y;
        let planar = reach - form.b * form.b;
        // Beyond, front and rear are a quarter turn of axis 1 apart at least.
        let apart = Lanes::of(form.b * form.b).lt(planar);
        let forward = planar.sqrt();
        let shoulder = |forward: Lanes| Turn {
            sin: (wrist.y * forward - wrist.x * form.b) / reach,
            cos: (wrist.x * forward + wrist.y * form.b) / reach,
        };
        let front = shoulder(forward);
        let rear = front.minus(near[0]).cos.lt(0.0);
        let forward = rear.negate(forward);
        let other = shoulder(forward);
        let q1 = Turn { sin: rear.select(other.sin, front.sin), cos: rear.select(other.cos, front.cos) };

        // Elevations of upper arm and link 3 over the horizontal.
        let (r, s) = (forward - form.a1, wrist.z - form.d1);
        let square = r * r + s * s;
        let rho = square.sqrt();
        let cosine = (square + (form.a2 * form.a2 - form.l3 * form.l3)) / (rho * (2.0 * form.a2));
        let sine = (Lanes::of(1.0) - cosine * cosine).sqrt();
        let bent = sine.ge(CLOSE);
        let (sin_gamma, cos_gamma) = form.gamma.sin_cos();
        let gamma = Turn::same(sin_gamma, cos_gamma);
        // Lower arm over forearm, or under it.
        let behind = near[2].plus(gamma).sin.lt(0.0);
        let to_wrist = Turn { sin: s / rho, cos: r / rho };
        let upper = to_wrist.plus(Turn { sin: behind.negate(sine), cos: cosine });
        let forearm =
            Turn { sin: (s - upper.sin * form.a2) * (1.0 / form.l3), cos: (r - upper.cos * form.a2) * (1.0 / form.l3) };
        let link3 = forearm.plus(gamma);
        let q2 = Turn { sin: -upper.sin, cos: upper.cos };
        let q3 = upper.minus(link3);

        // The wrist: link3ᵀ · flange · Rx(90°) = Ry(θ4) Rz(θ5) Ry(θ6), see `Wrist`.
        let ahead = Vector::new(q1.cos * link3.cos, q1.sin * link3.cos, link3.sin);
        let up = Vector::new(q1.cos * link3.sin, q1.sin * link3.sin, -link3.cos);
        let side = Vector::new(-q1.sin, q1.cos, Lanes::ZERO);
        let Frame { x, y, z, .. } = *base_from_flange;
        let (m01, m11, m21) = (ahead.dot(z), up.dot(z), side.dot(z));
        let (m10, m12) = (up.dot(x), -up.dot(y));
        let sin5 = (m01 * m01 + m21 * m21).sqrt();
        let straight = sin5.ge(CLOSE);
        let flipped = near[4].sin.lt(0.0);
        let q5 = Turn { sin: flipped.negate(sin5), cos: m11 };
        let q4 = Turn { sin: flipped.negate(m21) / sin5, cos: flipped.negate(-m01) / sin5 };
        let q6 = Turn { sin: flipped.negate(m12) / sin5, cos: flipped.negate(m10) / sin5 };

        let turns = [q1, q2, q3, q4, q5, q6];
        let motor = self.motor_from_serial(&six!(i => turns[i].angle() - self.theta[i]));
        let motor = six!(i => motor[i] + (((motor_near[i] - motor[i]) * (1.0 / TAU) + ROUND) - ROUND) * TAU);
        let mut sure = apart & bent & straight;
        for i in 0..6 {
            sure = sure & self.inside(motor[i], self.limits.min[i], self.limits.max[i]);
        }
        if let (true, Some((min, max))) = (self.parallelogram, self.limits.elbow) {
            sure = sure & self.inside(motor[2] - motor[1], min, max);
        }
        // Of the others, axis 1 is a quarter turn off, axis 2 twice the lift, or axis 4 half a turn.
        let (far, lift) = (FRAC_PI_4 * FRAC_PI_4, sine * sine);
        (motor, sure.select(lift.lt(far).select(lift, Lanes::of(far)), Lanes::ZERO))
    }

    #[inline(always)]
    fn inside(&self, angle: Lanes, min: f64, max: f64) -> Mask {
        angle.ge(min) & Lanes::of(max).ge(angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::BUILTIN;
    use nalgebra::{Rotation3, Translation3};
    use proptest::prelude::*;

    /// Rounding over an arm of some metres, where digits are lost.
    const SAME: f64 = 1e-11;
    /// What it makes of angles close to where digits are lost, rad.
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
            let Some(eight) = Eight::of(&robot) else { return Ok(()) };
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
            let places: Vec<Place<'_>> = written
                .iter()
                .zip(&nears)
                .map(|((position_mm, quat), near)| {
                    Place { base_from_wobj: &wobj, position_mm, quat, flange_from_tcp: &tool, near }
                })
                .collect();
            let mut found = [None; WIDTH];
            eight.find(places.len(), |lane| places[lane], |lane, this| found[lane] = Some(this));
            for (i, found) in found.iter().flatten().enumerate() {
                let off = found.wobj_from_tcp.inverse() * poses[i];
                prop_assert!(off.translation.vector.norm() < SAME && (off.rotation.matrix() - nalgebra::Matrix3::identity()).norm() < SAME);
                let flange = robot.forward(&motors[i]);
                let plain = robot.inverse_near(&flange, &nears[i]);
                if let Some(motor) = found.nearest(&nears[i]) {
                    prop_assert!((motor - plain.unwrap()).amax() < SAME_ANGLE, "{motor} {:?}", plain);
                    let reached = robot.forward(&motor).to_homogeneous() - flange.to_homogeneous();
                    prop_assert!(reached.norm() < SAME, "{reached}");
                }
                // Who asks from where the arm is gets an answer wherever no branch is close.
                let sine = |angle: f64| angle.sin().abs();
                let (serial, form) = (robot.serial_from_motor(&motors[i]), robot.closed_form().unwrap());
                let wrist = robot.frames(&motors[i]).origin(4);
                let easy = robot.limit_violation(&motors[i]).is_none() && sine(serial[4]) > 0.3 && sine(serial[2] + eight.theta[2] + form.gamma) > 0.3 && wrist.xy().norm() > 0.4;
                let mut again = None;
                eight.find(1, |_| Place { near: &motors[i], ..places[i] }, |_, found| again = found.nearest(&motors[i]));
                prop_assert!(!easy || again.is_some(), "{}", motors[i]);
            }
        }
    }
}
