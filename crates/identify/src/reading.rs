//! The reading of an instrument for one row.

use deflex_measured::MeasuredRow;
use nalgebra::Vector3;

/// Distance from its target, mm, from which on a measured point does not belong to it.
pub(super) const ELSEWHERE_MM: f64 = 50.0;

/// The reading of an instrument for one row.
#[derive(Clone, Copy, Debug)]
pub(super) enum Reading {
    /// Position of the TCP in the work object of the target, or in the frame of the device, mm; axes that were not
    /// measured are NaN.
    Position(Vector3<f64>),
    /// Error along the surface normal, mm.
    Normal(f64),
    /// Length from the instrument's fixed point, mm.
    Distance(f64),
}

impl Reading {
    /// The reading of a row: its position, or else its normal error, or else its length; `None` if it has none.
    pub(super) fn of(row: &MeasuredRow) -> Option<Self> {
        let some = row.axes_mm.iter().any(Option::is_some);
        let axes = || Vector3::from(row.axes_mm.map(|axis| axis.unwrap_or(f64::NAN)));
        let position = row.position_mm.map(Vector3::from).or_else(|| some.then(axes)).map(Self::Position);
        position.or(row.normal_mm.map(Self::Normal)).or(row.distance_mm.map(Self::Distance))
    }

    /// Number of its scalars in stacked vectors, measured or not.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Position(_) => 3,
            Self::Normal(_) | Self::Distance(_) => 1,
        }
    }

    /// Whether scalar `k` was measured.
    pub(super) fn has(&self, k: usize) -> bool {
        match self {
            Self::Position(measured) => !measured[k].is_nan(),
            Self::Normal(_) | Self::Distance(_) => true,
        }
    }

    /// Number of scalars that were measured.
    pub(super) fn count(&self) -> usize {
        (0..self.len()).filter(|&k| self.has(k)).count()
    }
}
