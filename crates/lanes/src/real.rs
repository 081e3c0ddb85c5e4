use std::fmt::Debug;
use std::ops::{Add, BitAnd, Div, Mul, Neg, Sub};

/// A number of one target, or one number for each of several targets. Formulas are written over this trait.
///
/// # Examples
/// ```
/// use deflex_lanes::{Lanes, Real};
///
/// /// The distance from the origin.
/// fn distance<R: Real>(x: R, y: R) -> R {
///     (x * x + y * y).sqrt()
/// }
/// assert_eq!(distance(3.0, 4.0), 5.0);
/// assert_eq!(distance(Lanes([3.0; 8]), Lanes([4.0; 8])), Lanes([5.0; 8]));
/// ```
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
    /// Zero for every target.
    const ZERO: Self;

    /// The same number for every target.
    fn of(value: f64) -> Self;
    /// The number of one target. `lane` must be less than [`Real::WIDTH`].
    fn lane(&self, lane: usize) -> f64;
    /// Sets the number of one target. `lane` must be less than [`Real::WIDTH`].
    fn set(&mut self, lane: usize, value: f64);
    /// Square root; NaN for negative numbers.
    fn sqrt(self) -> Self;
    /// The number without its sign.
    fn abs(self) -> Self;
    /// The largest integer that is not greater.
    fn floor(self) -> Self;
    /// Less than. Like all comparisons, false if one of the numbers is NaN.
    fn lt(self, other: impl Into<Self>) -> Self::Mask;
    /// Equal.
    fn eq(self, other: impl Into<Self>) -> Self::Mask;
    /// Greater or equal.
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
///
/// # Examples
/// ```
/// use deflex_lanes::{Mask, Real};
///
/// /// The number, or zero if it is negative.
/// fn not_negative<R: Real>(number: R) -> R {
///     number.lt(0.0).select(R::ZERO, number)
/// }
/// assert_eq!(not_negative(-3.0), 0.0);
/// ```
pub trait Mask<R>: Copy + Default + Debug + Send + Sync + 'static + BitAnd<Output = Self> {
    /// Computes the Boolean of each target.
    fn of(wanted: impl FnMut(usize) -> bool) -> Self;
    /// `yes` where the mask is set, `no` elsewhere.
    fn select(self, yes: R, no: R) -> R;
    /// Set where one of both is set.
    fn or(self, other: Self) -> Self;
    /// Set where this one is not set.
    fn not(self) -> Self;
    /// Whether the mask is set for a target.
    fn any(self) -> bool;
    /// The Boolean of one target.
    fn lane(&self, lane: usize) -> bool;
    /// Sets the Boolean of one target.
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
///
/// # Examples
/// ```
/// use deflex_lanes::{Lanes, dispatch, pulp::NullaryFnOnce};
///
/// struct Twice<'a>(&'a mut Lanes);
/// impl NullaryFnOnce for Twice<'_> {
///     type Output = ();
///
///     #[inline(always)]
///     fn call(self) {
///         *self.0 = *self.0 * 2.0;
///     }
/// }
/// let mut numbers = Lanes([3.0; 8]);
/// dispatch(Twice(&mut numbers));
/// assert_eq!(numbers, Lanes([6.0; 8]));
/// ```
#[inline(never)]
pub fn dispatch<W: pulp::NullaryFnOnce<Output = ()>>(work: W) {
    pulp::Arch::new().dispatch(work);
}
