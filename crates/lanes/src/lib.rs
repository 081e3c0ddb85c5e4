//! Arithmetic on one number or on eight numbers at once, with the widest registers of the processor.
//!
//! A formula is written once, over a [`Real`]. A lane does not depend on other lanes, so the result for a target is the
//! same whichever targets are computed with it, and also if it is computed alone. Operations are neither fused nor
//! reordered, so every processor gives the same bits.

/// The crate that finds the widest registers; the macros name it.
pub use pulp;

mod frame;
mod number;
mod real;
mod trigonometry;

pub use frame::{Frame, Pose, Vector};
pub use number::{LaneMask, Lanes, WIDTH};
pub use real::{Mask, Real, dispatch};
pub use trigonometry::{ROUND, SinCos};

/// An array with one element for each joint. `std::array::from_fn` would be compiled as a call outside of the widest
/// lanes.
#[macro_export]
macro_rules! six {
    ($i:ident => $of:expr) => {
        [
            $crate::six!(@ $i 0 $of),
            $crate::six!(@ $i 1 $of),
            $crate::six!(@ $i 2 $of),
            $crate::six!(@ $i 3 $of),
            $crate::six!(@ $i 4 $of),
            $crate::six!(@ $i 5 $of),
        ]
    };
    (@ $i:ident $n:literal $of:expr) => {{
        let $i: usize = $n;
        $of
    }};
}

/// Runs arithmetic on references with the widest lanes of the processor. The operands must be complete in memory: if
/// numbers were written lane by lane just before, or are carried around a loop, the compiler splits them into scalars.
#[macro_export]
macro_rules! widest {
    (<$($life:lifetime),*> ($($name:ident: $type:ty = $value:expr),* $(,)?) $work:block) => {{
        struct Work<$($life),*> {
            $($name: $type),*
        }
        impl<$($life),*> $crate::pulp::NullaryFnOnce for Work<$($life),*> {
            type Output = ();

            #[inline(always)]
            fn call(self) {
                let Self { $($name),* } = self;
                $work
            }
        }
        $crate::dispatch(Work { $($name: $value),* })
    }};
    // The same for formulas over a [`Real`]: a single number needs no lanes.
    (<$real:ident: $bound:path; $($life:lifetime),*> ($($name:ident: $type:ty = $value:expr),* $(,)?) $work:block) => {{
        struct Work<$($life,)* $real: $bound> {
            $($name: $type),*
        }
        impl<$($life,)* $real: $bound> $crate::pulp::NullaryFnOnce for Work<$($life,)* $real> {
            type Output = ();

            #[inline(always)]
            fn call(self) {
                let Self { $($name),* } = self;
                $work
            }
        }
        <$real as $crate::Real>::dispatch(Work::<$real> { $($name: $value),* })
    }};
}
