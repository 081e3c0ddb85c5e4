//! Both questions for eight targets at once, where effects are [`Simple`] and the inverse explicit: rounds like those of
//! [`predict`](super::predict) and [`command`](super::command), which stay the reference and answer what is left open here. From
//! the look at a wanted pose it is foreseen how the cut feeds back close by, which saves rounds and decides nothing.

mod block;
mod look;
mod rounds;

pub(crate) use block::{Cut, Setting, Site};

use super::arm::Arm;
use super::command::{Aim, Feedback};
use super::predict::{Foreseen, Landing};
use crate::effects::{Simple, Twist, Weights};
use crate::lanes::{Frame, Lanes, Mask, WIDTH, six, widest};
use crate::robot::eight::{one, set};
use crate::robot::{Eight, EightFound, EightJoints, Joints, Pose};
use block::{Block, Frames};
use look::{EightFeedback, Look};
use nalgebra::Vector3;
use rounds::{EightLanding, Rounds, dot};

/// An arm under simple effects.
#[derive(Debug)]
pub(crate) struct EightArm<'a> {
    robot: Eight<'a>,
    /// rad/(N·m) at the motors.
    compliance: [f64; 6],
    half_gap: Joints,
    /// rad
    offset: [f64; 6],
    force_factor: f64,
    /// 1/m
    force_growth: Vec<f64>,
    weights: Vec<Weights>,
    /// Where the actual TCP and work object are in the declared ones.
    tcp: Twist,
    work_object: Twist,
    /// Base axes, m/s².
    gravity: Vector3<f64>,
}

/// A command whose pose is sought.
pub(crate) struct Given<'a, 'b> {
    pub(crate) site: Site<'a>,
    /// Commanded motor angles, rad.
    pub(crate) motor: &'b Joints,
    /// Direction of travel into them.
    pub(crate) travel: &'b Joints,
    pub(crate) near: Foreseen,
}

/// Room to work in, some kilobytes that are used again.
#[derive(Default)]
pub(crate) struct Room<'a> {
    block: Block<'a>,
    /// rad
    motor: EightJoints,
    free: EightJoints,
    look: Look,
    feedback: EightFeedback,
    rounds: Rounds,
    /// The nominal arm's TCP in the work object, and where it is known.
    nominal: Frame,
    known: Mask,
    /// Where the command is one.
    sure: Mask,
    landings: EightLanding,
    pub(crate) found: EightFound,
    /// For those that have to be solved one by one.
    pub(crate) plain: super::Rounds,
}

impl<'a> EightArm<'a> {
    /// The arm in lanes, where all that acts on it is simple.
    pub(crate) fn of(arm: &'a Arm) -> Option<Self> {
        let mut eight = Self {
            robot: Eight::of(&arm.robot)?,
            compliance: [0.0; 6],
            half_gap: Joints::zeros(),
            offset: [0.0; 6],
            force_factor: 1.0,
            force_growth: Vec::new(),
            tcp: Twist::default(),
            work_object: Twist::default(),
            weights: Vec::new(),
            gravity: arm.gravity(),
        };
        for effect in &arm.effects {
            match effect.simple(arm.stiffness.as_ref())? {
                Simple::Springs { compliance } => {
                    eight.compliance = six!(i => eight.compliance[i] + compliance[i]);
                }
                Simple::Offset { joints } => eight.offset = six!(i => eight.offset[i] + joints[i]),
                Simple::ForceFactor(factor) => eight.force_factor *= factor,
                Simple::ForceGrowth(per_m) => eight.force_growth.push(per_m),
                Simple::Tool(twist) => eight.tcp += twist,
                Simple::WorkObject(twist) => eight.work_object += twist,
                Simple::Weights(weights) => eight.weights.push(weights),
                Simple::LostMotion { half_gap } => eight.half_gap += half_gap,
            }
        }
        Some(eight)
    }

    /// Of the cutting force on its law's, where so much (m) was cut.
    #[inline]
    fn force_factor(&self, cut_length: f64) -> f64 {
        self.force_growth.iter().fold(self.force_factor, |factor, per_m| factor * (1.0 + per_m * cut_length))
    }

    /// [`Arm::command_from`] of up to eight targets, at the nominal arm's motor angles (rad) there; where the TCP of the nominal
    /// arm is at the command, if that does not depend on the travel; and where the targets end up uncorrected, with the
    /// direction of travel into them, see [`Arm::land`].
    pub(crate) fn aim<'s, 'm>(
        &self,
        room: &mut Room<'s>,
        count: usize,
        wanted: impl Fn(usize) -> (Site<'s>, &'m Joints, &'m Joints),
        mut put: impl FnMut(usize, Aim, Option<Pose>, Landing),
    ) {
        let Room { block, look, feedback, motor, free, nominal, known, sure, rounds, landings, .. } = room;
        let lost = self.half_gap != Joints::zeros();
        for lane in 0..count {
            let (site, at, _) = wanted(lane);
            block.set(self, lane, &site);
            set(&mut rounds.motor, lane, at);
            landings.wanted.set_axes(lane, &site.wobj_from_tcp.rotation);
        }
        block.first(count);
        (*motor, *sure) = (rounds.motor, Mask::first(count));
        let aside = !(self.tcp.is_zero() && self.work_object.is_zero());
        if aside {
            widest!(<'a, 'b> (
                arm: &'a EightArm<'b> = self,
                block: &'a Block<'b> = block,
                wanted: &'a Frame = &landings.wanted,
                motor: &'a mut EightJoints = motor,
                sure: &'a mut Mask = sure,
            ) {
                let Frames { base_from_wobj, flange_from_tcp } = &block.actual;
                let wanted = Frame { origin: block.wanted, ..*wanted };
                let base_from_flange = base_from_wobj.then(&wanted).without(flange_from_tcp);
                let (actual, near) = arm.robot.nearest(&base_from_flange, motor);
                (*motor, *sure) = (actual, *sure & near);
            });
        }
        look.at(self, block, motor);
        widest!(<'a, 'b> (
            arm: &'a EightArm<'b> = self,
            block: &'a Block<'b> = block,
            look: &'a Look = look,
            feedback: &'a mut EightFeedback = feedback,
            motor: &'a EightJoints = motor,
            free: &'a mut EightJoints = free,
            rounds: &'a mut Rounds = rounds,
            nominal: &'a mut Frame = nominal,
            known: &'a mut Mask = known,
            sure: &'a mut Mask = sure,
            aside: bool = aside,
        ) {
            *feedback = look.feedback(arm, block, &six!(i => rounds.motor[i] - motor[i]));
            *free = six!(i => motor[i] - look.give[i]);
            let [a, b, c, d, e, f] = six!(i => free[i].abs().lt(f64::INFINITY));
            *sure = *sure & a & b & c & d & e & f;
            (*nominal, *known) = look.relieved(arm, block);
            rounds.begin_at(motor, &look.turns);
            rounds.bend = six!(i => look.give[i] + feedback.yielding[i] * feedback.lift);
            let bent = six!(i => look.give[i] - arm.offset[i]);
            // A look from aside is none of the rounds'.
            let left = if aside { Lanes::ZERO } else { dot(&bent, &bent) };
            (rounds.share, rounds.left, rounds.gain) = (feedback.share, left, Lanes::of(1.0));
        });
        for lane in (0..count).filter(|_| lost) {
            let (_, at, travel) = wanted(lane);
            set(&mut rounds.motor, lane, &(at - travel.component_mul(&self.half_gap)));
        }
        rounds.run(self, block, look, *sure);
        rounds.land(self, block, look, landings);
        for lane in 0..count {
            let feedback = Feedback {
                yielding: one(&feedback.yielding, lane),
                share: feedback.share.lane(lane),
                lift: feedback.lift.lane(lane),
            };
            let (motor, free) = (one(motor, lane), one(free, lane));
            if let Some(landing) = rounds.landing(landings, lane).filter(|_| sure.lane(lane)) {
                let nominal = (!lost && known.lane(lane)).then(|| nominal.lane(lane));
                put(lane, Aim { motor, free, lost: self.half_gap, feedback }, nominal, landing);
            }
        }
    }

    /// The TCP in the work object, of the nominal arm, at up to eight motor angles (rad), where they are known.
    pub(crate) fn nominal<'s>(
        &self,
        room: &mut Room<'s>,
        count: usize,
        given: impl Fn(usize) -> Option<(&'s Setting, Joints)>,
        mut put: impl FnMut(usize, Joints, Pose),
    ) {
        let Room { block, look, nominal, motor, .. } = room;
        let mut known = [false; WIDTH];
        for lane in 0..count {
            if let Some((setting, at)) = given(lane) {
                block.run_with(self, lane, setting);
                set(motor, lane, &at);
                known[lane] = true;
            }
        }
        widest!(<'a, 'b> (
            arm: &'a EightArm<'b> = self,
            block: &'a Block<'b> = block,
            motor: &'a EightJoints = motor,
            look: &'a mut Look = look,
            nominal: &'a mut Frame = nominal,
        ) {
            look.turns = arm.robot.turns(motor);
            *nominal = look.seen(arm, &block.declared);
        });
        for lane in (0..count).filter(|lane| known[*lane]) {
            put(lane, one(motor, lane), nominal.lane(lane));
        }
    }

    /// [`Arm::land`] of up to eight commands.
    pub(crate) fn land<'s, 'm>(
        &self,
        room: &mut Room<'s>,
        count: usize,
        given: impl Fn(usize) -> Given<'s, 'm>,
        mut put: impl FnMut(usize, Landing),
    ) {
        let Room { block, look, rounds, landings, .. } = room;
        for lane in 0..count {
            let Given { site, motor, travel, near } = given(lane);
            block.set(self, lane, &site);
            landings.wanted.set_axes(lane, &site.wobj_from_tcp.rotation);
            set(&mut rounds.motor, lane, &(motor - travel.component_mul(&self.half_gap)));
            set(&mut rounds.bend, lane, &near.deflection);
            rounds.share.set(lane, near.share);
            rounds.left.set(lane, near.left);
            rounds.gain.set(lane, near.gain);
        }
        block.first(count);
        rounds.begin(self);
        rounds.run(self, block, look, Mask::first(count));
        rounds.land(self, block, look, landings);
        for lane in 0..count {
            if let Some(landing) = rounds.landing(landings, lane) {
                put(lane, landing);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Cutting, ForceLaw, Situation, ToolFrame, declared_springs, kind};
    use crate::equilibrium::{EquilibriumError, Start};
    use crate::robot::BUILTIN;
    use nalgebra::{Rotation3, Translation3};
    use proptest::prelude::*;

    /// A tenth of a printed digit, m.
    const SAME_PLACE: f64 = 1e-10;
    /// The force is that of the last look, a step before the last: less than a printed digit, N.
    const SAME_FORCE: f64 = 5e-4;
    /// Commands are explicit in both ways, rad.
    const SAME_COMMAND: f64 = 1e-13;
    /// Where a pose is solved for, both lose digits where branches come near each other, rad.
    const SAME_FOUND: f64 = 1e-11;

    /// A cut that grows with depth, so that it feeds back; the tool may lean as it has it.
    struct Deeper {
        depth: f64,
        lean: Option<Vector3<f64>>,
    }

    impl ForceLaw for Deeper {
        fn force(&self, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
            let depth = self.depth - shift.z;
            Vector3::new(-1.0, 0.7, 0.4 + axis.x) * (2e4 * depth)
        }

        fn slope(&self) -> Vector3<f64> {
            Vector3::new(-1.0, 0.7, 0.4) * -2e4
        }

        fn rest(&self) -> Option<Vector3<f64>> {
            self.lean.map(|axis| self.force(&Vector3::zeros(), &axis))
        }
    }

    fn effect(text: &str) -> Box<dyn crate::effects::Effect> {
        let mut table: toml::Table = text.parse().unwrap();
        let name = table.remove("kind").unwrap();
        (kind(name.as_str().unwrap()).unwrap().read)(table).unwrap()
    }

    /// Springs, and weights, lost motion, zeros and a force that are off, or frames that are.
    fn arm(robot: usize, weights: bool, gap: bool, off: bool, aside: bool) -> Arm {
        let mut effects = vec![declared_springs()];
        if weights {
            effects.push(effect(
                "kind = \"gravity\"\nmass_kg = [120, 60, 70, 15, 8, 12]\ntool = true\nfirst_moment_kg_m = \
                 [[6, 0, -24], [20, 0, 1.2], [3.5, 2.1, 0], [0.1, 0, -5.9], [0, 0.16, 0], [0, 0, 0.42]]",
            ));
        }
        if gap {
            effects.push(effect("kind = \"backlash\"\nhalf_gap_rad = [1e-4, 5e-5, 0, 2e-4, 0, 3e-5]"));
        }
        if off {
            effects.push(effect("kind = \"zero_offset\"\noffset_rad = [5e-4, -1e-3, 0, 2e-3, 0, -3e-4]"));
            effects.push(effect("kind = \"force_scale\"\nfactor = 1.2"));
            effects.push(effect("kind = \"tool_wear\"\nper_m = 0.3"));
        }
        if aside {
            effects.push(effect("kind = \"tool_frame\"\nd_mm = [0.3, -0.2, 0.5]\nd_rad = [0, 1e-3, -2e-3]"));
            effects.push(effect("kind = \"work_object_frame\"\nd_mm = [-0.4, 1, 0.2]\nd_rad = [5e-4, 0, 1e-3]"));
            effects.push(effect("kind = \"work_object_frame\"\nd_mm = [0, 0, -0.3]"));
        }
        let stiffness = Some(Joints::from([8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]));
        Arm { robot: BUILTIN[robot].robot(), stiffness, effects }
    }

    proptest! {
        #[test]
        fn eight_at_once_are_each_by_itself(
            robot in 0..BUILTIN.len(),
            weights: bool,
            gap: bool,
            off: bool,
            aside: bool,
            joints in prop::array::uniform8(prop::array::uniform6(-0.9_f64..0.9)),
            cuts in prop::array::uniform8(0..3_usize),
            leaned: bool,
            travel in prop::array::uniform6(prop::sample::select(vec![-1.0, 0.0, 1.0])),
            count in 1..=WIDTH,
            payload in 0.0..40.0_f64,
        ) {
            let arm = arm(robot, weights, gap, off, aside);
            let Some(eight) = EightArm::of(&arm) else { return Ok(()) };
            let tool = ToolFrame {
                flange_from_tcp: Pose::from_parts(Translation3::new(0.06, -0.02, 0.31), Rotation3::from_euler_angles(0.1, 0.4, -0.2)),
                mass: 18.0,
                cog: Vector3::new(0.0, 0.0, 0.12),
            };
            let wobj = Pose::from_parts(Translation3::new(1.0, -0.4, 0.7), Rotation3::from_euler_angles(0.0, 0.02, 0.3));
            let motors: Vec<Joints> = joints[..count].iter().map(|joints| Joints::from(*joints)).collect();
            let wobj_from_feed = Rotation3::from_euler_angles(0.1, 0.2, 0.3);
            // One for all of a depth, or one for each, which leans as the tool does there.
            let laws: Vec<Deeper> = motors.iter().map(|motor| {
                let axis = wobj.rotation.inverse() * (arm.robot.forward(motor).rotation * (tool.flange_from_tcp.rotation * -Vector3::z()));
                Deeper { depth: if motor[0] > 0.0 { 1e-3 } else { 3e-3 }, lean: leaned.then(|| wobj_from_feed.inverse() * axis) }
            }).collect();
            let law_of = |i: usize| laws.iter().position(|law| !leaned && law.depth.total_cmp(&laws[i].depth).is_eq()).unwrap_or(i);
            let situations: Vec<Situation<'_>> = motors.iter().enumerate().zip(cuts).map(|((i, motor), cut)| Situation {
                base_from_wobj: wobj,
                wobj_from_tcp: wobj.inv_mul(&(arm.robot.forward(motor) * tool.flange_from_tcp)),
                tool,
                cutting: match cut {
                    0 => Cutting::Air,
                    1 => Cutting::Constant(Vector3::new(300.0, -200.0, 90.0)),
                    _ => Cutting::Law { law: &laws[law_of(i)], wobj_from_feed },
                },
                normal: Vector3::z(),
                velocity: Vector3::zeros(),
                cut_length: 0.7,
                time: 0.0,
                temperature: None,
                payload,
            }).collect();
            let setting = Setting { base_from_wobj: wobj, tool };
            let sites: Vec<Site<'_>> = situations.iter().map(|s| Site {
                setting: &setting, wobj_from_tcp: &s.wobj_from_tcp, payload, cut_length: s.cut_length, leaned,
                cut: match &s.cutting {
                    Cutting::Air => Cut::Air,
                    Cutting::Constant(force) => Cut::Constant(force),
                    Cutting::Law { law, wobj_from_feed } => Cut::Law { law: *law, wobj_from_feed },
                },
            }).collect();
            let (mut room, travel) = (Room::default(), Joints::from(travel));

            let (mut aims, mut soon, mut uncorrected) = ([const { None }; WIDTH], [None; WIDTH], [const { None }; WIDTH]);
            eight.aim(&mut room, count, |lane| (sites[lane], &motors[lane], &travel), |lane, aim, nominal, landing| {
                (aims[lane], soon[lane], uncorrected[lane]) = (Some(aim), nominal, Some(landing));
            });
            // Where frames are aside, branches that meet are left to the plain way.
            prop_assert!(aside || aims.iter().flatten().count() == count);
            let mut commands = Vec::new();
            for i in 0..count {
                let plain = arm.command_from(&situations[i], &situations[i].wobj_from_tcp, Start::At(&motors[i]), &travel).unwrap();
                let plain = plain.commanded(&travel);
                let command = aims[i].as_ref().map_or(plain, |aim| aim.commanded(&travel));
                prop_assert!((command - plain).amax() < if aside { SAME_FOUND } else { SAME_COMMAND }, "{}", (command - plain).amax());
                commands.push(command);
            }

            let mut poses = [const { None }; WIDTH];
            eight.nominal(&mut room, count, |lane| Some((sites[lane].setting, commands[lane])), |lane, _, pose| poses[lane] = Some(pose));
            for i in 0..count {
                let plain = wobj.inv_mul(&(arm.robot.forward(&commands[i]) * tool.flange_from_tcp));
                prop_assert!((poses[i].unwrap().to_homogeneous() - plain.to_homogeneous()).norm() < SAME_PLACE);
                prop_assert_eq!(soon[i].is_none(), gap || aims[i].is_none());
                if let Some(soon) = soon[i] {
                    prop_assert!((soon.to_homogeneous() - plain.to_homogeneous()).norm() < SAME_PLACE);
                }
            }

            // From nothing; without correction; with the command as it was rounded.
            let rounded: Vec<Joints> = commands.iter().map(|motor| motor.map(|angle| (angle * 3e7).round() / 3e7)).collect();
            let mut landed = [const { None }; WIDTH];
            for (motors, known) in [(&commands, 0), (&motors, 1), (&rounded, 2)] {
                let before = std::mem::replace(&mut landed, [const { None }; WIDTH]);
                let given = |i: usize| Given {
                    site: sites[i],
                    motor: &motors[i],
                    travel: &travel,
                    near: match (known, &aims[i], &before[i]) {
                        (1, Some(aim), _) => aim.uncorrected(),
                        (2, Some(aim), Some(uncorrected)) => {
                            let tip = wobj.inv_mul(&(arm.robot.forward(&rounded[i]) * tool.flange_from_tcp)).translation.vector;
                            let normal = wobj_from_feed * Vector3::z();
                            aim.corrected(normal.dot(&(tip - poses[i].unwrap().translation.vector)), uncorrected)
                        }
                        _ => Foreseen::default(),
                    },
                };
                eight.land(&mut room, count, given, |lane, landing| landed[lane] = Some(landing));
                for i in 0..count {
                    match (&landed[i], arm.predict(&situations[i], &motors[i], &travel)) {
                        (Some(landed), Ok(plain)) => {
                            let wanted = sites[i].wobj_from_tcp;
                            let seen = Pose::from_parts(
                                (wanted.translation.vector + landed.shift).into(),
                                Rotation3::from_scaled_axis(landed.turn) * wanted.rotation,
                            );
                            let gap = seen.to_homogeneous() - plain.wobj_from_tcp.to_homogeneous();
                            prop_assert!(gap.norm() < SAME_PLACE, "{gap}");
                            prop_assert!((seen.rotation * -Vector3::z() - landed.axis).norm() < SAME_PLACE);
                            prop_assert!((wobj.rotation * landed.cut - plain.load.cut).norm() < SAME_FORCE);
                        }
                        (Some(_), Err(error)) => prop_assert!(false, "{error}"),
                        // What runs away, or is far from where it began, is left to the plain way.
                        (None, Err(EquilibriumError::NoEquilibrium { .. })) => {}
                        (None, plain) => {
                            let far = plain.unwrap().distortion.joints.amax() > 0.5 * crate::robot::NUDGE;
                            prop_assert!(far, "no answer");
                        }
                    }
                }
            }
        }
    }
}
