//! Loops with the widest registers that the processor has.

/// Runs a block, compiled for each width of registers that processors have, with the one that this processor has; it gets what
/// pulp knows that width by. The block is a method that is always inlined: a closure of some size the compiler would leave as
/// narrow as the whole program is built. Products and sums stay apart, so that the numbers are the same for each width.
macro_rules! widest {
    (<$($life:lifetime),*> $simd:ident: $width:ident;
     ($($name:ident: $type:ty = $value:expr),* $(,)?) -> $output:ty $work:block) => {{
        struct Work<$($life),*> {
            $($name: $type),*
        }
        impl<$($life),*> pulp::WithSimd for Work<$($life),*> {
            type Output = $output;

            #[inline(always)]
            fn with_simd<$width: pulp::Simd>(self, $simd: $width) -> $output {
                let Self { $($name),* } = self;
                $work
            }
        }
        pulp::Arch::new().dispatch(Work { $($name: $value),* })
    }};
}
pub(crate) use widest;
