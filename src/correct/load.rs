//! The cut of a target.

use nalgebra::{Rotation3, Vector3};

/// The cut of a [`Point`](super::Point), without borrowing.
#[derive(Clone, Copy, Debug)]
pub(super) enum PointLoad {
    Air,
    /// The same force, whatever the deflection.
    Constant {
        /// N, work object axes.
        force: Vector3<f64>,
        /// What it turns with on the way into the point.
        follows: Follows,
    },
    Law {
        /// Index into the laws.
        law: usize,
        /// The feed frame.
        wobj_from_feed: Rotation3<f64>,
        /// Whether that was found for this point's own tool axis, so that the tool leans against it as the law has it.
        leaned: bool,
    },
}

/// Axes that a constant force keeps to along a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Follows {
    WorkObject,
    Tool,
    /// The force in the feed frame, N.
    Feed(Vector3<f64>),
}

/// A cutter on its way through the stock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Through {
    /// Index into the fronts.
    pub(super) front: u32,
    /// Whether the move may cut: a rapid move may not.
    pub(super) cuts: bool,
    /// m, where the force follows from the stock.
    pub(super) feed_per_tooth: Option<f64>,
}
