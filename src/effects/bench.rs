//! A bench for hand-solved cases: the IRB 6660 at zero angles, a straight 200 mm tool, one effect.
//!
//! There the flange is at (1.393, 0, 1.7945) m with x down, y along base y and z along base x; the TCP is at
//! (1.593, 0, 1.7945) m. The work object lies in the base.

use super::{Cutting, Distortion, Load, Situation, State, ToolFrame, kind};
use crate::robot::{BUILTIN, Joints, Pose};
use nalgebra::{Translation3, Vector3};

pub(super) struct Bench {
    pub(super) motor: Joints,
    pub(super) stiffness: Joints,
    pub(super) force: Vector3<f64>,
    pub(super) situation: Situation<'static>,
}

impl Default for Bench {
    fn default() -> Self {
        Self {
            motor: Joints::zeros(),
            stiffness: Joints::repeat(1e6),
            force: Vector3::zeros(),
            situation: Situation {
                base_from_wobj: Pose::identity(),
                wobj_from_tcp: Pose::identity(),
                tool: ToolFrame {
                    flange_from_tcp: Pose::from_parts(
                        Translation3::new(0.0, 0.0, 0.2),
                        nalgebra::Rotation3::identity(),
                    ),
                    mass: 0.0,
                    cog: Vector3::zeros(),
                },
                cutting: Cutting::Air,
                normal: Vector3::z(),
                velocity: Vector3::zeros(),
                cut_length: 0.0,
                time: 0.0,
                temperature: None,
                payload: 0.0,
            },
        }
    }
}

impl Bench {
    pub(super) fn pushed(x: f64, y: f64, z: f64) -> Self {
        Self { force: Vector3::new(x, y, z), ..Self::default() }
    }

    /// Loads and distortion of one effect, given as its `[[effect]]` table.
    pub(super) fn run(&self, effect: &str) -> (Load, Distortion) {
        let mut table: toml::Table = effect.parse().unwrap();
        let name = table.remove("kind").unwrap();
        let effect = (kind(name.as_str().unwrap()).unwrap().read)(table).unwrap();
        let robot = BUILTIN.iter().find(|robot| robot.model == "irb6660-205-1.9").unwrap().robot();
        let frames = robot.frames(&self.motor);
        let base_from_tcp = frames.base_from_flange() * self.situation.tool.flange_from_tcp;
        let state = State {
            robot: &robot,
            stiffness: Some(&self.stiffness),
            motor_commanded: &self.motor,
            motor: &self.motor,
            frames: &frames,
            base_from_tcp: &base_from_tcp,
            gravity: Vector3::new(0.0, 0.0, -10.0),
            situation: &self.situation,
        };
        let mut load = Load { cut: self.force, ..Load::default() };
        effect.load(&state, &mut load);
        load.fill_torque(&robot, &frames, &base_from_tcp.translation.vector);
        let mut out = Distortion::default();
        effect.distort(&state, &load, &mut out);
        (load, out)
    }
}
