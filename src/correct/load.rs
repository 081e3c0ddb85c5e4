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

impl PointLoad {
    /// Whether a load differs from another by so little that what it makes of the arm runs straight from one to the other: by a fiftieth of
    /// the force, of which the second order is 0.02 %.
    pub(super) fn is_near(&self, other: &Self) -> bool {
        const SHARE: f64 = 0.02;
        match (self, other) {
            (Self::Air, Self::Air) => true,
            (Self::Constant { force: a, .. }, Self::Constant { force: b, .. }) => {
                (a - b).norm() <= SHARE * a.norm().max(b.norm())
            }
            (
                Self::Law { law: a, wobj_from_feed: frame, leaned },
                Self::Law { law: b, wobj_from_feed: other, leaned: leans },
            ) => {
                // Both axes turn by less than the share, rad.
                let turns = |axis: usize| (frame.matrix().column(axis) - other.matrix().column(axis)).norm() > SHARE;
                a == b && leaned == leans && !turns(0) && !turns(2)
            }
            _ => false,
        }
    }
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
