use crate::effects::{Cutting, Distortion, Effect, Load, Parts, Situation, State};
use crate::robot::{Frames, Joints, Links, Pose, Robot, Turns};
use nalgebra::{Translation3, Vector3};

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;

/// The arm of a cell: what the controller believes in, and the effects that make it differ.
#[derive(Debug)]
pub struct Arm {
    /// Nominal geometry: what the controller computes with.
    pub robot: Robot,
    /// Declared joint stiffness at the motors, N·m/rad.
    pub stiffness: Option<Joints>,
    /// In the order of the cell file.
    pub effects: Vec<Box<dyn Effect>>,
}

/// What is known of an equilibrium close by: it saves rounds and decides nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    /// Actual minus commanded motor angles but for lost motion, rad.
    pub(crate) deflection: Joints,
    pub(crate) turns: Turns,
    /// The secant's way back, zero where none was found (see `predict`).
    pub(crate) share: f64,
}

/// The arm looked at in one state: where it is, what acts on it, what that does to it.
#[derive(Clone, Debug)]
pub(super) struct Look {
    pub(super) frames: Frames,
    pub(super) load: Load,
    pub(super) distortion: Distortion,
    /// The TCP as seen from the actual work object, under the distortion that was put in.
    pub(super) seen: Pose,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            frames: Frames::default(),
            load: Load::default(),
            distortion: Distortion::default(),
            seen: Pose::identity(),
        }
    }
}

impl Arm {
    /// Whether any effect depends on the commanded angles themselves.
    #[must_use]
    pub fn follows_command(&self) -> bool {
        self.effects.iter().any(|effect| effect.follows_command())
    }

    /// Gravity, base axes, m/s².
    pub(super) fn gravity(&self) -> Vector3<f64> {
        self.robot.world_from_base.rotation.inverse_transform_vector(&Vector3::new(0.0, 0.0, -GRAVITY))
    }

    /// Frames of the links under a distortion, at actual motor angles near those of `near`.
    fn frames(&self, near: &Turns, motor: &Joints, distortion: &Distortion, frames: &mut Frames) {
        let serial = self.robot.serial_from_motor(motor);
        if distortion.bends_links() {
            self.bent_links(distortion).chain_near(near, &serial, Some(&distortion.tilt), frames);
        } else {
            self.robot.links.chain_near(near, &serial, None, frames);
        }
        if !distortion.base.is_zero() {
            let base = distortion.base.pose();
            for i in 0..6 {
                frames.base_from_link[i] = base * frames.base_from_link[i];
                frames.axes[i] = base.rotation * frames.axes[i];
            }
        }
    }

    /// The links with a distortion added.
    pub(super) fn bent_links(&self, distortion: &Distortion) -> Links {
        Links::new(std::array::from_fn(|i| {
            let (row, add) = (self.robot.links.rows()[i], distortion.rows[i]);
            crate::robot::DhRow {
                alpha: row.alpha + add.alpha,
                a: row.a + add.a,
                d: row.d + add.d,
                theta: row.theta + add.theta,
            }
        }))
    }

    /// A start for equilibria that put the arm near actual motor angles (rad), which differ from the commanded ones by
    /// `deflection` but for lost motion.
    pub(crate) fn near(&self, motor: &Joints, deflection: Joints) -> Near {
        Near { deflection, turns: self.turns(motor), share: 0.0 }
    }

    /// The TCP in the work object where only joints yield, at actual motor angles (rad).
    pub(super) fn seen_near(&self, situation: &Situation, near: &Turns, motor: &Joints, frames: &mut Frames) -> Pose {
        self.robot.links.chain_near(near, &self.robot.serial_from_motor(motor), None, frames);
        situation.base_from_wobj.inv_mul(&(frames.base_from_flange() * situation.tool.flange_from_tcp))
    }

    /// The turns at motor angles, near which the arm is looked at.
    pub(super) fn turns(&self, motor: &Joints) -> Turns {
        self.robot.links.turns(&self.robot.serial_from_motor(motor))
    }

    /// Looks at the arm at commanded and actual motor angles (rad), with the geometry of `distortion`, whose `parts` are all
    /// that is not zero: into a place that is used again, since a look is two kilobytes and taken many times.
    #[allow(clippy::too_many_arguments)] // a look is what all of these come to
    pub(super) fn look(
        &self,
        situation: &Situation,
        motor_commanded: &Joints,
        near: &Turns,
        motor: &Joints,
        distortion: &Distortion,
        parts: Parts,
        look: &mut Look,
    ) {
        let Look { frames, load, seen, .. } = look;
        let base_from_tcp = match parts {
            Parts::Joints => {
                self.robot.links.chain_near(near, &self.robot.serial_from_motor(motor), None, frames);
                let base_from_tcp = frames.base_from_flange() * situation.tool.flange_from_tcp;
                *seen = situation.base_from_wobj.inv_mul(&base_from_tcp);
                base_from_tcp
            }
            Parts::All => {
                self.frames(near, motor, distortion, frames);
                let at_flange = distortion.flange.after(frames.base_from_flange());
                let mut base_from_tcp = distortion.tcp.after(&(at_flange * situation.tool.flange_from_tcp));
                base_from_tcp.translation.vector += distortion.lag;
                let base_from_wobj = distortion.wobj.after(&situation.base_from_wobj);
                let mut in_part = base_from_tcp;
                in_part.translation.vector -= distortion.part;
                *seen = base_from_wobj.inv_mul(&in_part);
                base_from_tcp
            }
        };
        let state = State {
            robot: &self.robot,
            stiffness: self.stiffness.as_ref(),
            motor_commanded,
            motor,
            frames,
            base_from_tcp: &base_from_tcp,
            gravity: self.gravity(),
            situation,
        };
        *load = Load { cut: cutting_force(situation, seen), ..Load::default() };
        for effect in &self.effects {
            effect.load(&state, load);
        }
        load.fill_torque(&self.robot, frames, &base_from_tcp.translation.vector);
        look.distortion = Distortion::default();
        for effect in &self.effects {
            effect.distort(&state, load, &mut look.distortion);
        }
    }

    /// The chain pose (base to link 6, base motion taken off) that puts the TCP on `wobj_from_tcp` under a
    /// distortion: the inverse of the composition in [`Distortion`].
    pub(super) fn chain_pose(&self, situation: &Situation, wobj_from_tcp: &Pose, distortion: &Distortion) -> Pose {
        let mut base_from_tcp = distortion.wobj.after(&situation.base_from_wobj) * wobj_from_tcp;
        base_from_tcp.translation =
            Translation3::from(base_from_tcp.translation.vector + distortion.part - distortion.lag);
        let mut flange_from_tcp = distortion.tcp.after(&situation.tool.flange_from_tcp);
        if !distortion.flange.is_zero() {
            flange_from_tcp = distortion.flange.pose() * flange_from_tcp;
        }
        let base_from_last = base_from_tcp * flange_from_tcp.inverse();
        if distortion.base.is_zero() { base_from_last } else { distortion.base.pose().inv_mul(&base_from_last) }
    }
}

/// Cutting force on the tool where the TCP is seen, base axes, N.
fn cutting_force(situation: &Situation, seen: &Pose) -> Vector3<f64> {
    let in_wobj = match &situation.cutting {
        Cutting::Air => return Vector3::zeros(),
        Cutting::Constant(force) => *force,
        Cutting::Law { law, wobj_from_feed } => {
            let shift = seen.translation.vector - situation.wobj_from_tcp.translation.vector;
            // The tool axis, tip to spindle, is −z of the TCP frame.
            let axis = -(seen.rotation * Vector3::z());
            let into_feed = wobj_from_feed.inverse();
            wobj_from_feed * law.force(&(into_feed * shift), &(into_feed * axis))
        }
    };
    situation.base_from_wobj.rotation * in_wobj
}
