//! Arithmetic on one number or on eight numbers at once, with the widest registers of the processor.
//!
//! A formula is written once, over a [`Real`]. A lane does not depend on other lanes, so the result for a target is the
//! same whichever targets are computed with it, and also if it is computed alone. Operations are neither fused nor
//! reordered, so every processor gives the same bits.

mod frame;
mod number;
mod real;
mod trigonometry;

pub use frame::Pose;
pub(crate) use frame::{Frame, Vector};
pub(crate) use number::{LaneMask, Lanes, WIDTH};
pub(crate) use real::{Mask, Real, dispatch};
pub(crate) use trigonometry::{ROUND, SinCos};

/// An array with one element for each joint. `std::array::from_fn` would be compiled as a call outside of the widest
/// lanes.
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

/// Runs arithmetic on references with the widest lanes of the processor. The operands must be complete in memory: if
/// numbers were written lane by lane just before, or are carried around a loop, the compiler splits them into scalars.
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
    // The same for formulas over a [`Real`]: a single number needs no lanes.
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
