use super::real::{Mask, Real, dispatch};
use std::ops::{Add, BitAnd, Div, Mul, Neg, Sub};

/// Numbers in one value: two registers of AVX2, or one of AVX-512.
pub const WIDTH: usize = 8;

/// One number for each of eight targets.
///
/// # Examples
/// ```
/// use deflex_lanes::{Lanes, Real};
///
/// let twice = Lanes([1.0, 4.0, 9.0, 16.0, 25.0, 36.0, 49.0, 64.0]).sqrt() * 2.0;
/// assert_eq!(twice.lane(7), 16.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes(pub [f64; WIDTH]);

/// A Boolean for each lane, as all bits set or none.
///
/// # Examples
/// ```
/// use deflex_lanes::{LaneMask, Mask};
///
/// let first_two = LaneMask::first(2);
/// assert_eq!((first_two.lane(1), first_two.lane(2)), (true, false));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(align(64))]
pub struct LaneMask([u64; WIDTH]);

impl Default for Lanes {
    #[inline(always)]
    fn default() -> Self {
        Self::ZERO
    }
}

impl Lanes {
    #[inline(always)]
    pub(super) fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = self;
        for lane in &mut out.0 {
            *lane = f(*lane);
        }
        out
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = self;
        for (lane, other) in out.0.iter_mut().zip(other.0) {
            *lane = f(*lane, other);
        }
        out
    }

    #[inline(always)]
    pub(super) fn test(self, other: Self, f: impl Fn(f64, f64) -> bool) -> LaneMask {
        let mut out = [0; WIDTH];
        for i in 0..WIDTH {
            out[i] = if f(self.0[i], other.0[i]) { u64::MAX } else { 0 };
        }
        LaneMask(out)
    }
}

impl Real for Lanes {
    type Mask = LaneMask;
    const WIDTH: usize = WIDTH;
    const ZERO: Self = Self([0.0; WIDTH]);

    #[inline(always)]
    fn of(value: f64) -> Self {
        Self([value; WIDTH])
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        debug_assert!(lane < WIDTH);
        // The remainder shows the compiler that the index is in bounds.
        self.0[lane % WIDTH]
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, value: f64) {
        debug_assert!(lane < WIDTH);
        self.0[lane % WIDTH] = value;
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }

    #[inline(always)]
    fn floor(self) -> Self {
        self.map(f64::floor)
    }

    #[inline(always)]
    fn lt(self, other: impl Into<Self>) -> LaneMask {
        self.test(other.into(), |a, b| a < b)
    }

    #[inline(always)]
    #[allow(clippy::float_cmp)] // the very number is meant
    fn eq(self, other: impl Into<Self>) -> LaneMask {
        self.test(other.into(), |a, b| a == b)
    }

    #[inline(always)]
    fn ge(self, other: impl Into<Self>) -> LaneMask {
        self.test(other.into(), |a, b| a >= b)
    }

    #[inline(always)]
    fn bit(self, bit: u32) -> LaneMask {
        LaneMask::of_bits(self, bit)
    }

    #[inline(always)]
    fn dispatch<W: pulp::NullaryFnOnce<Output = ()>>(work: W) {
        dispatch(work);
    }
}

impl From<f64> for Lanes {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Self::of(value)
    }
}

impl LaneMask {
    /// Lanes in which a bit of the number's binary representation is set.
    #[inline(always)]
    pub(super) fn of_bits(numbers: Lanes, bit: u32) -> Self {
        let mut out = [0; WIDTH];
        for (out, number) in out.iter_mut().zip(numbers.0) {
            *out = (number.to_bits() >> bit & 1).wrapping_neg();
        }
        Self(out)
    }
}

impl Mask<Lanes> for LaneMask {
    #[inline(always)]
    fn of(mut wanted: impl FnMut(usize) -> bool) -> Self {
        let mut out = [0; WIDTH];
        for (lane, out) in out.iter_mut().enumerate() {
            *out = if wanted(lane) { u64::MAX } else { 0 };
        }
        Self(out)
    }

    fn next(self) -> Option<usize> {
        self.0.iter().position(|lane| *lane != 0)
    }

    #[inline(always)]
    fn select(self, yes: Lanes, no: Lanes) -> Lanes {
        let mut out = no;
        for i in 0..WIDTH {
            out.0[i] = f64::from_bits(yes.0[i].to_bits() & self.0[i] | no.0[i].to_bits() & !self.0[i]);
        }
        out
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        let mut out = self;
        for i in 0..WIDTH {
            out.0[i] |= other.0[i];
        }
        out
    }

    #[inline(always)]
    fn not(self) -> Self {
        let mut out = self;
        for lane in &mut out.0 {
            *lane = !*lane;
        }
        out
    }

    #[inline(always)]
    fn any(self) -> bool {
        let mut any = 0;
        for lane in self.0 {
            any |= lane;
        }
        any != 0
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> bool {
        debug_assert!(lane < WIDTH);
        self.0[lane % WIDTH] != 0
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, value: bool) {
        debug_assert!(lane < WIDTH);
        self.0[lane % WIDTH] = if value { u64::MAX } else { 0 };
    }

    #[inline(always)]
    fn negate(self, value: Lanes) -> Lanes {
        const SIGN: u64 = 1 << 63;
        let mut out = value;
        for i in 0..WIDTH {
            out.0[i] = f64::from_bits(value.0[i].to_bits() ^ self.0[i] & SIGN);
        }
        out
    }
}

impl BitAnd for LaneMask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        let mut out = self;
        for i in 0..WIDTH {
            out.0[i] &= other.0[i];
        }
        out
    }
}

macro_rules! arithmetic {
    ($($operation:ident $name:ident $sign:tt),*) => {$(
        impl $operation for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.zip(other, |a, b| a $sign b)
            }
        }

        impl $operation<f64> for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: f64) -> Self {
                self.map(|a| a $sign other)
            }
        }
    )*};
}

arithmetic!(Add add +, Sub sub -, Mul mul *, Div div /);

impl Neg for Lanes {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}
