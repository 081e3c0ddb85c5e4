//! A bench for hand-solved cases: the IRB 6660 at zero angles, a straight 200 mm tool, one effect.
//!
//! There the flange is at (1.393, 0, 1.7945) m with x down, y along base y and z along base x; the TCP is at
//! (1.593, 0, 1.7945) m. The work object lies in the base.

use super::physics::{PartSite, RowOffset, Twist};
use super::{Deflection, Load, Offset, PartAt, PartYield, Site, Situation, State, ToolFrame, kind};
use deflex_lanes::{Frame, Vector};
use deflex_robot::kinematics::Chain;
use deflex_robot::{BUILTIN, Joints, Pose};
use nalgebra::{Translation3, Vector3};

pub(super) struct Bench {
    pub(super) motor: Joints,
    pub(super) stiffness: Joints,
    pub(super) force: Vector3<f64>,
    pub(super) part: Option<PartYield>,
    pub(super) situation: Situation<'static>,
}

impl Default for Bench {
    fn default() -> Self {
        let flange_from_tcp = Pose::from_parts(Translation3::new(0.0, 0.0, 0.2), nalgebra::Rotation3::identity());
        let tool = ToolFrame { flange_from_tcp, mass: 0.0, cog: Vector3::zeros() };
        Self {
            motor: Joints::zeros(),
            stiffness: Joints::repeat(1e6),
            force: Vector3::zeros(),
            part: None,
            situation: Situation {
                gravity: Vector3::new(0.0, 0.0, -10.0),
                ..Situation::in_air(tool, Pose::identity())
            },
        }
    }
}

impl Bench {
    pub(super) fn pushed(x: f64, y: f64, z: f64) -> Self {
        Self { force: Vector3::new(x, y, z), ..Self::default() }
    }

    /// Loads and motion by one effect, given as its kind and the other keys of its `[[effect]]` table.
    pub(super) fn run(&self, name: &str, keys: &str) -> (Loads, Moved) {
        let effect = (kind(name).unwrap().read)(keys.parse().unwrap()).unwrap();
        let law = effect.law();
        let robot = BUILTIN.iter().find(|robot| robot.model == "irb6660-205-1.9").unwrap().robot();
        let situation = &self.situation;
        let mut part = PartSite::default();
        part.set(0, self.part.as_ref().map(PartAt::in_wobj).as_ref());
        let mut site = Site {
            commanded: self.motor.into(),
            base_from_wobj: Frame::of(&situation.base_from_wobj),
            gravity: Vector::of(&situation.gravity),
            wanted: Vector::of(&situation.wobj_from_tcp.translation.vector),
            normal: Vector::of(&situation.normal),
            velocity: Vector::of(&situation.velocity),
            cut_length: situation.cut_length,
            time: situation.time,
            temperature: situation.temperature.unwrap_or(f64::NAN),
            payload: situation.payload,
            units: Default::default(),
            tool_mass: situation.tool.mass,
            tool_cog: Vector::of(&situation.tool.cog),
            part,
            delayed: Default::default(),
        };
        site.set_torque(0, situation.torque);
        let rows = robot.rows::<f64>();
        let mut chain = Chain::default();
        rows.chain(&robot.joints(&rows.theta, &site.commanded), None, &mut chain);
        let base_from_tcp = chain.links[5].then(&Frame::of(&situation.tool.flange_from_tcp));
        let state =
            State { stiffness: Some(&self.stiffness), chain: &chain, base_from_tcp: &base_from_tcp, site: &site };
        let mut load = Load::default();
        load.start(Vector::of(&self.force), law.parts());
        law.load(&state, &mut load);
        load.fill_torque(&robot, &chain, base_from_tcp.origin);
        let (mut offset, mut deflection) = (Offset::default(), Deflection::default());
        law.offset(&site, &mut offset);
        law.deflect(&state, &load, &mut deflection);
        let vector = |v: Vector<f64>| v.lane(0);
        let twist = |t: Twist<f64>| Motion { shift: vector(t.shift), turn: vector(t.turn) };
        let moved = Moved {
            joints: Joints::from(offset.joints) + Joints::from(deflection.joints),
            lost: Joints::from(offset.lost) + Joints::from(deflection.lost),
            rows: offset.rows,
            tilt: deflection.tilt,
            base: twist(deflection.base),
            flange: Motion { shift: Vector3::zeros(), turn: vector(deflection.flange) },
            tcp: Motion { shift: vector(offset.tcp.shift + deflection.tip), turn: vector(offset.tcp.turn) },
            wobj: twist(offset.wobj),
            lag: vector(offset.lag),
            part: vector(deflection.part),
        };
        (Loads { cut: vector(load.cut), torque: load.torque.into() }, moved)
    }
}

/// The loads: cutting force, N, base axes; torques at the motors, N·m.
pub(super) struct Loads {
    pub(super) cut: Vector3<f64>,
    pub(super) torque: Joints,
}

/// The motion of the arm: offsets and deflections together.
pub(super) struct Moved {
    pub(super) joints: Joints,
    pub(super) lost: Joints,
    pub(super) rows: [RowOffset<f64>; 6],
    pub(super) tilt: [[f64; 2]; 6],
    pub(super) base: Motion,
    pub(super) flange: Motion,
    pub(super) tcp: Motion,
    pub(super) wobj: Motion,
    pub(super) lag: Vector3<f64>,
    pub(super) part: Vector3<f64>,
}

/// Shift, m, and rotation vector, rad.
pub(super) struct Motion {
    pub(super) shift: Vector3<f64>,
    pub(super) turn: Vector3<f64>,
}
