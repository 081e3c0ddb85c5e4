//! Arms with an explicit inverse, eight targets at once: the chain and the inverse of [`forward`](super::forward) and
//! [`inverse`](super::inverse), on sines and cosines instead of angles.

use super::inverse::ClosedForm;
use super::{Joints, Limits, Pose, Robot, turn_between, turns_between};
use crate::lanes::{Frame, Lanes, Mask, ROUND, Turn, Vector, six, widest};
use nalgebra::{Rotation3, Vector3};
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
        all.set(lane, *one);
    }
}

/// One target's.
#[inline(always)]
pub(crate) fn one(all: &EightJoints, lane: usize) -> Joints {
    Joints::from(six!(i => all[i].lane(lane)))
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

/// Eight targets, and what they come to.
#[derive(Default)]
pub(crate) struct EightFound {
    base_from_wobj: Frame,
    flange_from_tcp: Frame,
    position_mm: Vector,
    quat: [Lanes; 4],
    near: EightJoints,
    /// Where the program sends the TCP, m.
    pub(crate) wobj_from_tcp: Frame,
    /// Motor angles that reach it, rad.
    motor: EightJoints,
    /// From closer than this they are surely the nearest, square of rad; 0 where another way has to be asked.
    reach: Lanes,
    from: Frame,
    turn: Vector,
    small: Mask,
}

impl EightFound {
    fn set<'p>(&mut self, count: usize, place: &impl Fn(usize) -> Place<'p>) {
        let first = place(0);
        // Tool and work object seldom change.
        self.base_from_wobj = Frame::of(first.base_from_wobj);
        self.flange_from_tcp = Frame::of(first.flange_from_tcp);
        for lane in 0..count {
            let Place { base_from_wobj, position_mm, quat, flange_from_tcp, near } = place(lane);
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
    fn inverse(&mut self, robot: &Eight<'_>) {
        let base_from_flange = self.base_from_wobj.then(&self.wobj_from_tcp).without(&self.flange_from_tcp);
        (self.motor, self.reach) = robot.inverse(&base_from_flange, &self.near);
    }

    /// Finds by how much the targets are turned from orientations in the work object.
    pub(crate) fn turn_from<'p>(&mut self, count: usize, from: impl Fn(usize) -> &'p Rotation3<f64>) {
        for lane in 0..count {
            self.from.set_axes(lane, from(lane));
        }
        widest!(<'a> (found: &'a mut EightFound = self) {
            (found.turn, found.small) = turns_between(&found.from, &found.wobj_from_tcp);
        });
    }

    /// Rotation vector from that orientation, rad.
    #[inline(always)]
    pub(crate) fn turn(&self, lane: usize) -> Vector3<f64> {
        turn_of(lane, (&self.turn, self.small), &self.from, &self.wobj_from_tcp)
    }

    /// A target's motor angles, where they are surely the nearest to others (rad).
    pub(crate) fn nearest(&self, lane: usize, near: &Joints) -> Option<Joints> {
        let motor = one(&self.motor, lane);
        ((motor - near).norm_squared() < self.reach.lane(lane)).then_some(motor)
    }
}

/// Rotation vector of a lane from one orientation to another, rad, given those of all lanes and where they are right.
#[inline(always)]
pub(crate) fn turn_of(lane: usize, (turn, right): (&Vector, Mask), from: &Frame, to: &Frame) -> Vector3<f64> {
    // In numbers: as a whole it would be put in memory and read again.
    let [x, y, z] = if right.lane(lane) {
        [turn.x.lane(lane), turn.y.lane(lane), turn.z.lane(lane)]
    } else {
        turn_between(&from.rotation(lane), &to.rotation(lane)).into()
    };
    Vector3::new(x, y, z)
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

    /// What the first `count` of eight targets come to.
    pub(crate) fn find<'p>(&self, count: usize, place: impl Fn(usize) -> Place<'p>, found: &mut EightFound) {
        if count == 0 {
            return;
        }
        found.set(count, &place);
        widest!(<'a> (robot: &'a Eight<'a> = self, found: &'a mut EightFound = found) {
            found.wobj_from_tcp = Frame::of_quaternion(found.position_mm * 1e-3, found.quat);
            found.inverse(robot);
        });
    }

    /// The same where the poses are known already, in one work object, with one tool, near the same motor angles (rad).
    pub(crate) fn find_posed(
        &self,
        (base_from_wobj, flange_from_tcp): (&Pose, &Pose),
        near: &Joints,
        found: &mut EightFound,
    ) {
        (found.base_from_wobj, found.flange_from_tcp) = (Frame::of(base_from_wobj), Frame::of(flange_from_tcp));
        found.near = six!(i => Lanes::of(near[i]));
        widest!(<'a> (robot: &'a Eight<'a> = self, found: &'a mut EightFound = found) {
            found.inverse(robot);
        });
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

    /// Frames of the links in the base, of an arm with this inverse: axis 1 is upright, axes 2 and 3 are side by side across
    /// it, and the last three meet.
    #[inline(always)]
    pub(crate) fn chain(&self, turns: &EightTurns) -> [Frame; 6] {
        let (a, d, [q1, q2, q3, q4, q5, q6]) = (self.a, self.d, *turns);
        let ahead = Vector::new(q1.cos, q1.sin, Lanes::ZERO);
        let side = Vector::new(-q1.sin, q1.cos, Lanes::ZERO);
        let first = Frame {
            x: ahead,
            y: side,
            z: Vector::of(&Vector3::z()),
            origin: Vector::new(Lanes::ZERO, Lanes::ZERO, Lanes::of(d[0])),
        };
        let (along, across) = (Lanes::of(a[1]), Lanes::of(d[1]));
        let shoulder = Vector::new(q1.cos * along - q1.sin * across, q1.sin * along + q1.cos * across, first.origin.z);
        let second = upright(q1, q2, shoulder);
        let third = upright(q1, q2.plus(q3), shoulder + second.x * a[2] + side * d[2]);
        let wrist = third.origin + third.x * a[3] + third.y * d[3];
        let fourth = link(&third, third.z * -1.0, third.y, q4, wrist);
        let fifth = link(&fourth, fourth.z, fourth.y * -1.0, q5, wrist);
        let sixth = link(&fifth, fifth.z * -1.0, fifth.y, q6, wrist + fifth.y * d[5]);
        [first, second, third, fourth, fifth, sixth]
    }

    /// Motor angles at flange poses near others, rad, and where they are surely the nearest.
    #[inline(always)]
    pub(crate) fn nearest(&self, base_from_flange: &Frame, near: &EightJoints) -> (EightJoints, Mask) {
        let (motor, reach) = self.inverse(base_from_flange, near);
        let [a, b, c, d, e, f] = six!(i => (motor[i] - near[i]) * (motor[i] - near[i]));
        (motor, (a + b + c + d + e + f).lt(reach))
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
        let gamma = Turn::same(form.sin_gamma, form.cos_gamma);
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

/// A link of the arm's upright plane, which axis 1 turns: its x stands `turn` below the horizontal.
#[inline(always)]
fn upright(q1: Turn, turn: Turn, origin: Vector) -> Frame {
    Frame {
        x: Vector::new(q1.cos * turn.cos, q1.sin * turn.cos, -turn.sin),
        y: Vector::new(-(q1.cos * turn.sin), -(q1.sin * turn.sin), -turn.cos),
        z: Vector::new(-q1.sin, q1.cos, Lanes::ZERO),
        origin,
    }
}

/// A link about `axis`: the x of the one `before`, and what is square to both, turned about it.
#[inline(always)]
fn link(before: &Frame, across: Vector, axis: Vector, Turn { sin, cos }: Turn, origin: Vector) -> Frame {
    Frame { x: before.x * cos + across * sin, y: across * cos - before.x * sin, z: axis, origin }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::WIDTH;
    use crate::robot::BUILTIN;
    use nalgebra::Translation3;
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
            let (mut all, mut again) = (EightFound::default(), EightFound::default());
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
                // Who asks from where the arm is gets an answer wherever no branch is close.
                let sine = |angle: f64| angle.sin().abs();
                let (serial, form) = (robot.serial_from_motor(&motors[i]), robot.closed_form().unwrap());
                let wrist = robot.frames(&motors[i]).origin(4);
                let easy = robot.limit_violation(&motors[i]).is_none() && sine(serial[4]) > 0.3 && sine(serial[2] + eight.theta[2] + form.gamma) > 0.3 && wrist.xy().norm() > 0.4;
                eight.find(1, |_| Place { near: &motors[i], ..places[i] }, &mut again);
                let again = again.nearest(0, &motors[i]);
                prop_assert!(!easy || again.is_some(), "{}", motors[i]);
            }
        }
    }
}
