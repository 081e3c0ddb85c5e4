//! What an instrument says about a row.

use crate::measured::MeasuredRow;
use nalgebra::Vector3;

/// A measured point this far from its target does not belong to it, mm.
pub(super) const ELSEWHERE_MM: f64 = 50.0;

/// What an instrument said about one row.
#[derive(Clone, Copy, Debug)]
pub(super) enum Seen {
    /// TCP in the target's work object (or in the device's frame), mm; axes that were not measured are NaN.
    Position(Vector3<f64>),
    /// Error along the surface normal, mm.
    Normal(f64),
    /// Length from the instrument's fixed point, mm.
    Distance(f64),
}

impl Seen {
    pub(super) fn of(row: &MeasuredRow) -> Option<Self> {
        let some = row.axes_mm.iter().any(Option::is_some);
        let axes = || Vector3::from(row.axes_mm.map(|axis| axis.unwrap_or(f64::NAN)));
        let position = row.position_mm.map(Vector3::from).or_else(|| some.then(axes)).map(Self::Position);
        position.or(row.normal_mm.map(Self::Normal)).or(row.distance_mm.map(Self::Distance))
    }

    /// Scalars that it has in stacked vectors, measured or not.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Position(_) => 3,
            Self::Normal(_) | Self::Distance(_) => 1,
        }
    }

    /// Whether scalar `k` was measured.
    pub(super) fn shows(&self, k: usize) -> bool {
        match self {
            Self::Position(seen) => !seen[k].is_nan(),
            Self::Normal(_) | Self::Distance(_) => true,
        }
    }

    /// Scalars that were measured.
    pub(super) fn count(&self) -> usize {
        (0..self.len()).filter(|&k| self.shows(k)).count()
    }
}
