use super::real::{Mask, Real, dispatch};
use std::ops::{Add, BitAnd, Div, Mul, Neg, Sub};

/// An array with one element for each lane. Loops and closures would give the same code, after a compilation that takes several times as
/// long: kernels have thousands of these operations, and the compiler would unroll each.
macro_rules! lanes {
    ($i:ident => $of:expr) => {
        [
            lanes!(@ $i 0 $of),
            lanes!(@ $i 1 $of),
            lanes!(@ $i 2 $of),
            lanes!(@ $i 3 $of),
            lanes!(@ $i 4 $of),
            lanes!(@ $i 5 $of),
            lanes!(@ $i 6 $of),
            lanes!(@ $i 7 $of),
        ]
    };
    (@ $i:ident $n:literal $of:expr) => {{
        const $i: usize = $n;
        $of
    }};
}

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
        Self(lanes!(I => self.0[I].sqrt()))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(lanes!(I => self.0[I].abs()))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(lanes!(I => self.0[I].floor()))
    }

    #[inline(always)]
    fn lt(self, other: impl Into<Self>) -> LaneMask {
        let other = other.into();
        LaneMask(lanes!(I => all_bits(self.0[I] < other.0[I])))
    }

    #[inline(always)]
    #[allow(clippy::float_cmp)] // the very number is meant
    fn eq(self, other: impl Into<Self>) -> LaneMask {
        let other = other.into();
        LaneMask(lanes!(I => all_bits(self.0[I] == other.0[I])))
    }

    #[inline(always)]
    fn ge(self, other: impl Into<Self>) -> LaneMask {
        let other = other.into();
        LaneMask(lanes!(I => all_bits(self.0[I] >= other.0[I])))
    }

    #[inline(always)]
    fn bit(self, bit: u32) -> LaneMask {
        LaneMask(lanes!(I => (self.0[I].to_bits() >> bit & 1).wrapping_neg()))
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

/// A lane of a mask.
#[inline(always)]
fn all_bits(set: bool) -> u64 {
    if set { u64::MAX } else { 0 }
}

impl Mask<Lanes> for LaneMask {
    #[inline(always)]
    fn of(mut wanted: impl FnMut(usize) -> bool) -> Self {
        Self(lanes!(I => all_bits(wanted(I))))
    }

    fn next(self) -> Option<usize> {
        self.0.iter().position(|lane| *lane != 0)
    }

    #[inline(always)]
    fn select(self, yes: Lanes, no: Lanes) -> Lanes {
        Lanes(lanes!(I => f64::from_bits(yes.0[I].to_bits() & self.0[I] | no.0[I].to_bits() & !self.0[I])))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(lanes!(I => self.0[I] | other.0[I]))
    }

    #[inline(always)]
    fn not(self) -> Self {
        Self(lanes!(I => !self.0[I]))
    }

    #[inline(always)]
    fn any(self) -> bool {
        let [a, b, c, d, e, f, g, h] = self.0;
        a | b | c | d | e | f | g | h != 0
    }

    #[inline(always)]
    fn lane(&self, lane: usize) -> bool {
        debug_assert!(lane < WIDTH);
        self.0[lane % WIDTH] != 0
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, value: bool) {
        debug_assert!(lane < WIDTH);
        self.0[lane % WIDTH] = all_bits(value);
    }

    #[inline(always)]
    fn negate(self, value: Lanes) -> Lanes {
        const SIGN: u64 = 1 << 63;
        Lanes(lanes!(I => f64::from_bits(value.0[I].to_bits() ^ self.0[I] & SIGN)))
    }
}

impl BitAnd for LaneMask {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(lanes!(I => self.0[I] & other.0[I]))
    }
}

macro_rules! arithmetic {
    ($($operation:ident $name:ident $sign:tt),*) => {$(
        impl $operation for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(lanes!(I => self.0[I] $sign other.0[I]))
            }
        }

        impl $operation<f64> for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: f64) -> Self {
                Self(lanes!(I => self.0[I] $sign other))
            }
        }
    )*};
}

arithmetic!(Add add +, Sub sub -, Mul mul *, Div div /);

impl Neg for Lanes {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(lanes!(I => -self.0[I]))
    }
}
