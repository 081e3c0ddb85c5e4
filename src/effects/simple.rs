use super::Twist;
use crate::robot::Joints;
use nalgebra::Vector3;

/// An effect that is one of these at every target, whatever the command: equilibria under nothing else are solved many
/// at once.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Simple {
    /// Joints yield to their motor torques.
    Springs {
        /// Compliance at the motors, rad/(N·m).
        compliance: Joints,
    },
    /// Joints stand elsewhere.
    Offset {
        /// Actual minus commanded motor angles, rad.
        joints: Joints,
    },
    /// The cutting force is off by a factor.
    ForceFactor(f64),
    /// It grows by this share with the length cut, 1/m.
    ForceGrowth(f64),
    /// Weights on the links.
    Weights(Weights),
    /// Joints trail their motors.
    LostMotion {
        /// Half of what a joint loses when its motor turns back, rad.
        half_gap: Joints,
    },
    /// Where the actual TCP is in the declared one.
    Tool(Twist),
    /// Where the actual work object is in the declared one.
    WorkObject(Twist),
}

/// Weights on the links.
#[derive(Clone, Debug)]
pub struct Weights {
    /// Mass of each link, kg.
    pub mass: [f64; 6],
    /// Mass times centre of gravity of each link, in the link's frame, kg·m.
    pub first_moment: [Vector3<f64>; 6],
    /// Whether the tool's mass counts; payloads always do.
    pub tool: bool,
}
