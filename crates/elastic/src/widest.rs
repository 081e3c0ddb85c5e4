//! Loops that use the widest registers of the processor.

/// Runs a block that is compiled for each width of registers, in the version for this processor. The block gets the token of the
/// crate pulp for that width. It is a method that is always inlined, because the compiler would build a large closure for the
/// narrow registers of the whole program. Products and sums stay separate operations, so that the results are the same for each
/// width.
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
