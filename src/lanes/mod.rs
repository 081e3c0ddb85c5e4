//! Arithmetic on one number or on eight at once, in as many lanes as the processor has.
//!
//! A formula is written once, over a [`Real`]. A lane never sees another: what a target comes to does not depend on which
//! others are computed with it, nor on whether it is alone. Nothing is contracted or reordered, so that every processor gives the
//! same bits.

mod frame;
mod number;
mod real;
mod trigonometry;

pub use frame::Pose;
pub(crate) use frame::{Frame, Vector};
pub(crate) use number::{LaneMask, Lanes, WIDTH};
pub(crate) use real::{Mask, Real, dispatch};
pub(crate) use trigonometry::{ROUND, SinCos};

/// An array of six, one for each joint: `std::array::from_fn` would be a call, which leaves the widest lanes.
macro_rules! six {
    ($i:ident => $of:expr) => {
        [six!(@ $i 0 $of), six!(@ $i 1 $of), six!(@ $i 2 $of), six!(@ $i 3 $of), six!(@ $i 4 $of), six!(@ $i 5 $of)]
    };
    (@ $i:ident $n:literal $of:expr) => {{
        let $i: usize = $n;
        $of
    }};
}
pub(crate) use six;

/// Arithmetic on references, run with the widest lanes that the processor has. What it works on has to stand in memory whole:
/// numbers that were put in lane by lane just before, or that go round a loop, the compiler takes apart.
macro_rules! widest {
    (<$($life:lifetime),*> ($($name:ident: $type:ty = $value:expr),* $(,)?) $work:block) => {{
        struct Work<$($life),*> {
            $($name: $type),*
        }
        impl<$($life),*> pulp::NullaryFnOnce for Work<$($life),*> {
            type Output = ();

            #[inline(always)]
            fn call(self) {
                let Self { $($name),* } = self;
                $work
            }
        }
        $crate::lanes::dispatch(Work { $($name: $value),* })
    }};
    // The same for formulas over a number: one number needs no lanes.
    (<$real:ident: $bound:path; $($life:lifetime),*> ($($name:ident: $type:ty = $value:expr),* $(,)?) $work:block) => {{
        struct Work<$($life,)* $real: $bound> {
            $($name: $type),*
        }
        impl<$($life,)* $real: $bound> pulp::NullaryFnOnce for Work<$($life,)* $real> {
            type Output = ();

            #[inline(always)]
            fn call(self) {
                let Self { $($name),* } = self;
                $work
            }
        }
        <$real as $crate::lanes::Real>::dispatch(Work::<$real> { $($name: $value),* })
    }};
}
pub(crate) use widest;
