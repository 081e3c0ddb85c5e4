use std::fmt::Debug;
use std::ops::{Add, BitAnd, Div, Mul, Neg, Sub};

/// A number of one target, or one number for each of several targets. Formulas are written over this trait.
pub trait Real:
    Copy
    + Default
    + Debug
    + Send
    + Sync
    + 'static
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
{
    /// The result of a comparison.
    type Mask: Mask<Self>;
    /// Number of targets.
    const WIDTH: usize;
    const ZERO: Self;

    /// The same number for every target.
    fn of(value: f64) -> Self;
    /// The number of one target. `lane` must be less than [`Real::WIDTH`].
    fn lane(&self, lane: usize) -> f64;
    fn set(&mut self, lane: usize, value: f64);
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn floor(self) -> Self;
    /// Like all comparisons, false if one of the numbers is NaN.
    fn lt(self, other: impl Into<Self>) -> Self::Mask;
    fn eq(self, other: impl Into<Self>) -> Self::Mask;
    fn ge(self, other: impl Into<Self>) -> Self::Mask;
    /// Lanes in which a bit of the number's binary representation is set.
    fn bit(self, bit: u32) -> Self::Mask;
    /// Runs work with the widest lanes of the processor, if the number has lanes.
    fn dispatch<W: pulp::NullaryFnOnce<Output = ()>>(work: W);

    /// Applies a scalar function target by target, for functions that are not arithmetic.
    #[inline(always)]
    fn each(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = self;
        for lane in 0..Self::WIDTH {
            out.set(lane, f(self.lane(lane)));
        }
        out
    }
}

/// A Boolean for each target of a [`Real`]. It replaces `if`.
pub trait Mask<R>: Copy + Default + Debug + Send + Sync + 'static + BitAnd<Output = Self> {
    /// Computes the Boolean of each target.
    fn of(wanted: impl FnMut(usize) -> bool) -> Self;
    /// `yes` where the mask is set, `no` elsewhere.
    fn select(self, yes: R, no: R) -> R;
    fn or(self, other: Self) -> Self;
    fn not(self) -> Self;
    fn any(self) -> bool;
    fn lane(&self, lane: usize) -> bool;
    fn set(&mut self, lane: usize, value: bool);
    /// Changes the sign where the mask is set.
    fn negate(self, value: R) -> R;
    /// Index of the first target for which the mask is set.
    fn next(self) -> Option<usize>;

    /// A mask that is set for the first `count` targets.
    fn first(count: usize) -> Self {
        Self::of(|lane| lane < count)
    }
}

impl Real for f64 {
    type Mask = bool;
    const WIDTH: usize = 1;
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }

    #[inline(always)]
    fn set(&mut self, _: usize, value: f64) {
        *self = value;
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }

    #[inline(always)]
    fn floor(self) -> Self {
        f64::floor(self)
    }

    #[inline(always)]
    fn lt(self, other: impl Into<Self>) -> bool {
        self < other.into()
    }

    #[inline(always)]
    #[allow(clippy::float_cmp)] // the very number is meant
    fn eq(self, other: impl Into<Self>) -> bool {
        self == other.into()
    }

    #[inline(always)]
    fn ge(self, other: impl Into<Self>) -> bool {
        self >= other.into()
    }

    #[inline(always)]
    fn bit(self, bit: u32) -> bool {
        self.to_bits() >> bit & 1 == 1
    }

    #[inline(always)]
    fn dispatch<W: pulp::NullaryFnOnce<Output = ()>>(work: W) {
        work.call();
    }
}

impl Mask<f64> for bool {
    #[inline(always)]
    fn of(mut wanted: impl FnMut(usize) -> bool) -> Self {
        wanted(0)
    }

    #[inline(always)]
    fn select(self, yes: f64, no: f64) -> f64 {
        if self { yes } else { no }
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self | other
    }

    #[inline(always)]
    fn not(self) -> Self {
        !self
    }

    #[inline(always)]
    fn any(self) -> bool {
        self
    }

    #[inline(always)]
    fn lane(&self, _: usize) -> bool {
        *self
    }

    #[inline(always)]
    fn set(&mut self, _: usize, value: bool) {
        *self = value;
    }

    #[inline(always)]
    fn negate(self, value: f64) -> f64 {
        if self { -value } else { value }
    }

    #[inline(always)]
    fn next(self) -> Option<usize> {
        self.then_some(0)
    }
}

/// Runs work with the widest lanes that the processor has. Never inlined: without optimisation, work takes hundreds of
/// kilobytes of stack, which callers must not take too.
#[inline(never)]
pub(crate) fn dispatch<W: pulp::NullaryFnOnce<Output = ()>>(work: W) {
    pulp::Arch::new().dispatch(work);
}
