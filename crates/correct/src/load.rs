//! The cut of a target.

use nalgebra::{Rotation3, Vector3};

/// The cut of a [`Point`](super::Point), without borrowing.
#[derive(Clone, Copy, Debug)]
pub(super) enum PointLoad {
    Air,
    /// A force that does not depend on the deflection.
    Constant {
        /// The force, N, work object axes.
        force: Vector3<f64>,
        /// The axes with which it turns along the segment.
        follows: Follows,
    },
    Law {
        /// Index into the laws.
        law: usize,
        /// The feed frame.
        wobj_from_feed: Rotation3<f64>,
        /// Whether the frame was computed for this point's own tool axis, so that the tool leans against it as in the law.
        leaned: bool,
    },
}

impl PointLoad {
    /// The load of a force that follows from the stock, N, work object axes.
    pub(super) fn of_stock(force: Vector3<f64>) -> Self {
        if force == Vector3::zeros() { Self::Air } else { Self::Constant { force, follows: Follows::WorkObject } }
    }

    /// Whether the force turns with the feed direction.
    pub(super) fn turns_with_feed(&self) -> bool {
        matches!(self, Self::Law { .. } | Self::Constant { follows: Follows::Feed(_), .. })
    }

    /// Whether a load differs so little from another that the deflection between them can be interpolated: by a fiftieth of the force, for
    /// which the second order is 0.02 %.
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
                // Whether an axis turns by more than the share, rad.
                let turns = |axis: usize| (frame.matrix().column(axis) - other.matrix().column(axis)).norm() > SHARE;
                a == b && leaned == leans && !turns(0) && !turns(2)
            }
            _ => false,
        }
    }
}

/// The axes with which a constant force turns along a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Follows {
    WorkObject,
    Tool,
    /// The force in the feed frame, N.
    Feed(Vector3<f64>),
}

/// A cutter that moves through the stock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Through {
    /// Index into the fronts.
    pub(super) front: u32,
    /// Whether the motion may cut: rapid travel may not.
    pub(super) cuts: bool,
    /// Feed per tooth, m; `Some` if the force follows from the stock.
    pub(super) feed_per_tooth: Option<f64>,
}
