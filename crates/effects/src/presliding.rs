//! The angles over which friction builds up after a joint has reversed.

use serde::{Deserialize, Serialize};

/// The presliding angle of each joint, rad; 0 for all joints if friction acts at once.
///
/// The cell file gives one number for all joints, or six.
///
/// # Examples
/// ```
/// use deflex_effects::Presliding;
///
/// let angles = Presliding::alike(1e-3).with(1, 2e-3);
/// assert_eq!((angles.of(0), angles.of(1)), (1e-3, 2e-3)); // rad
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Written", into = "Written")]
pub struct Presliding([f64; 6]);

/// The value of the key `presliding_rad`.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "`presliding_rad` is a number, or six numbers")]
enum Written {
    OfAll(f64),
    OfEach([f64; 6]),
}

impl Presliding {
    /// The same angle, rad, for all joints.
    pub const fn alike(angle_rad: f64) -> Self {
        Self([angle_rad; 6])
    }

    /// The same angles, except for that of one joint, counted from 0.
    #[must_use]
    pub fn with(mut self, joint: usize, angle_rad: f64) -> Self {
        self.0[joint] = angle_rad;
        self
    }

    /// The angle of a joint, counted from 0, rad.
    pub fn of(&self, joint: usize) -> f64 {
        self.0[joint]
    }

    /// Whether friction acts at once after a reversal.
    #[doc(hidden)]
    pub fn is_sharp(&self) -> bool {
        self.0.iter().all(|angle| *angle <= 0.0)
    }

    /// Whether all angles are finite, and either all are 0 or all are above 0. An arm that is sharp in some joints only
    /// would need two kinds of travel at once.
    pub(super) fn is_valid(&self) -> bool {
        let in_order = |angle: &f64| angle.is_finite() && *angle >= 0.0;
        self.0.iter().all(in_order) && (self.is_sharp() || self.0.iter().all(|angle| *angle > 0.0))
    }
}

impl From<Written> for Presliding {
    fn from(written: Written) -> Self {
        match written {
            Written::OfAll(angle) => Self::alike(angle),
            Written::OfEach(angles) => Self(angles),
        }
    }
}

impl From<Presliding> for Written {
    fn from(Presliding(angles): Presliding) -> Self {
        let is_one = angles.iter().all(|angle| angle.to_bits() == angles[0].to_bits());
        if is_one { Self::OfAll(angles[0]) } else { Self::OfEach(angles) }
    }
}

impl std::fmt::Display for Presliding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match Written::from(*self) {
            Written::OfAll(angle) => write!(f, "{angle}"),
            Written::OfEach(angles) => write!(f, "{angles:?}"),
        }
    }
}
