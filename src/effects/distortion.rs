use crate::robot::{DhRow, Joints, Pose};
use nalgebra::{Rotation3, Translation3, Vector3};

/// A small motion: shift (m) and rotation vector (rad), exact for finite ones too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// Shift, m.
    pub shift: Vector3<f64>,
    /// Rotation vector, rad.
    pub turn: Vector3<f64>,
}

impl Default for Twist {
    fn default() -> Self {
        Self { shift: Vector3::zeros(), turn: Vector3::zeros() }
    }
}

impl std::ops::AddAssign for Twist {
    fn add_assign(&mut self, other: Self) {
        self.shift += other.shift;
        self.turn += other.turn;
    }
}

impl Twist {
    /// Shift in mm and rotation vector in rad, as cells have them.
    pub(super) fn of_mm(shift_mm: [f64; 3], turn: [f64; 3]) -> Self {
        Self { shift: 1e-3 * Vector3::from(shift_mm), turn: Vector3::from(turn) }
    }

    /// Whether it moves nothing.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.shift == Vector3::zeros() && self.turn == Vector3::zeros()
    }

    /// `from · pose`, without the arithmetic where nothing moves.
    pub(crate) fn after(&self, from: &Pose) -> Pose {
        if self.is_zero() { *from } else { from * self.pose() }
    }

    /// The motion as a pose: turn, then shift, in the axes it is given in.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose::from_parts(Translation3::from(self.shift), Rotation3::from_scaled_axis(self.turn))
    }
}

/// Everything by which the real arm differs from the nominal one at one target; effects add to it.
///
/// ```text
/// base_from_tcp = T(lag) · base · chain(rows, actual joints, tilt) · flange · flange_from_tcp · tcp
/// seen          = (base_from_wobj · wobj)⁻¹ · T(part)⁻¹ · base_from_tcp
/// actual joints = commanded + joints − travel ∘ lost
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Actual minus commanded motor angles, but for lost motion, rad.
    pub joints: Joints,
    /// Lost motion: half of what the joint gives when its travel turns, rad, not negative.
    pub lost: Joints,
    /// Added to the modified-DH rows (rad, m).
    pub rows: [DhRow; 6],
    /// Turn of each link about x and y of its own frame, rad.
    pub tilt: [[f64; 2]; 6],
    /// Motion of the base, in base axes about the base origin.
    pub base: Twist,
    /// Motion at the flange, in the flange frame.
    pub flange: Twist,
    /// Motion of the TCP, in the TCP frame.
    pub tcp: Twist,
    /// Work object: actual frame in the declared one.
    pub wobj: Twist,
    /// Shift of the TCP whatever the arm does, base axes, m.
    pub lag: Vector3<f64>,
    /// Shift of the workpiece, base axes, m.
    pub part: Vector3<f64>,
}

impl Distortion {
    /// Whether the chain's links themselves differ: the explicit inverse then is a seed only.
    #[must_use]
    pub fn bends_links(&self) -> bool {
        let rows = self.rows.iter().fold(0, |any, row| any | bits([row.alpha, row.a, row.d, row.theta]));
        self.tilt.iter().fold(rows, |any, tilt| any | bits(*tilt)) != 0
    }

    /// Whether only joint angles differ: the nominal inverse is then exact.
    #[must_use]
    pub fn joints_only(&self) -> bool {
        let twists = [&self.base, &self.flange, &self.tcp, &self.wobj];
        let shifts = twists.map(|twist| bits(twist.shift.into()) | bits(twist.turn.into()));
        let any = shifts.iter().fold(bits(self.lag.into()) | bits(self.part.into()), |any, shift| any | shift);
        any == 0 && !self.bends_links()
    }

    /// Which parts are not zero.
    pub(crate) fn parts(&self) -> Parts {
        if self.joints_only() { Parts::Joints } else { Parts::All }
    }

    /// Goes a share of the way to another distortion.
    pub(crate) fn go_towards(&mut self, other: &Self, share: f64, parts: Parts) {
        self.merge(other, parts, |a, b| a + share * (b - a));
    }

    /// Becomes the difference of two others.
    pub(crate) fn set_difference(&mut self, a: &Self, b: &Self, parts: Parts) {
        self.set(a, parts);
        self.merge(b, parts, |a, b| a - b);
    }

    /// Becomes another, of which this has no part that is not looked at.
    pub(crate) fn set(&mut self, other: &Self, parts: Parts) {
        match parts {
            Parts::Joints => (self.joints, self.lost) = (other.joints, other.lost),
            Parts::All => self.clone_from(other),
        }
    }

    /// Sum of products, rad and m alike: an arm is some metres long.
    pub(crate) fn dot(&self, other: &Self, parts: Parts) -> f64 {
        let joints = self.joints.dot(&other.joints) + self.lost.dot(&other.lost);
        if parts == Parts::Joints {
            return joints;
        }
        let twist = |a: &Twist, b: &Twist| a.shift.dot(&b.shift) + a.turn.dot(&b.turn);
        let row = |(a, b): (&DhRow, &DhRow)| a.alpha * b.alpha + a.a * b.a + a.d * b.d + a.theta * b.theta;
        let tilt = |(a, b): (&[f64; 2], &[f64; 2])| a[0] * b[0] + a[1] * b[1];
        joints
            + self.rows.iter().zip(&other.rows).map(row).sum::<f64>()
            + self.tilt.iter().zip(&other.tilt).map(tilt).sum::<f64>()
            + twist(&self.base, &other.base)
            + twist(&self.flange, &other.flange)
            + twist(&self.tcp, &other.tcp)
            + twist(&self.wobj, &other.wobj)
            + self.lag.dot(&other.lag)
            + self.part.dot(&other.part)
    }

    /// Takes in another number by number.
    fn merge(&mut self, other: &Self, parts: Parts, mix: impl Fn(f64, f64) -> f64 + Copy) {
        let merge = |a: &mut f64, b: f64| *a = mix(*a, b);
        self.joints.zip_apply(&other.joints, merge);
        self.lost.zip_apply(&other.lost, merge);
        if parts == Parts::Joints {
            return;
        }
        for (row, with) in self.rows.iter_mut().zip(&other.rows) {
            merge(&mut row.alpha, with.alpha);
            merge(&mut row.a, with.a);
            merge(&mut row.d, with.d);
            merge(&mut row.theta, with.theta);
        }
        for (tilt, with) in self.tilt.iter_mut().flatten().zip(other.tilt.iter().flatten()) {
            merge(tilt, *with);
        }
        let twists = [(&mut self.base, &other.base), (&mut self.flange, &other.flange)];
        for (twist, with) in twists.into_iter().chain([(&mut self.tcp, &other.tcp), (&mut self.wobj, &other.wobj)]) {
            twist.shift.zip_apply(&with.shift, merge);
            twist.turn.zip_apply(&with.turn, merge);
        }
        self.lag.zip_apply(&other.lag, merge);
        self.part.zip_apply(&other.part, merge);
    }
}

/// What of a [`Distortion`] is looked at: where only joints yield, the other seventy numbers are zeros.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Parts {
    #[default]
    Joints,
    All,
}

impl Parts {
    /// What is not zero in either of two.
    pub(crate) fn or(self, other: Self) -> Self {
        if self == Self::Joints { other } else { self }
    }
}

/// Zero where all numbers are, without a branch for each.
fn bits<const N: usize>(values: [f64; N]) -> u64 {
    values.iter().fold(0, |any, value| any | value.abs().to_bits())
}
