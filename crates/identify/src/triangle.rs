//! Loops over triangular matrices and vectors. They are inlined into functions that are compiled for the widest registers
//! of the processor.

/// Replaces the lower triangle of a symmetric matrix, column by column, by its Cholesky factor. Returns whether the
/// matrix is positive definite.
#[inline(always)]
pub(super) fn factorize(matrix: &mut [f64], size: usize) -> bool {
    for j in 0..size {
        let (before, rest) = matrix.split_at_mut(j * size);
        let own = &mut rest[j..size];
        for k in 0..j {
            let column = &before[k * size + j..(k + 1) * size];
            subtract(own, column[0], column);
        }
        let square = own[0];
        if square.is_nan() || square <= 0.0 {
            return false;
        }
        let inverse = square.sqrt().recip();
        for i in 0..own.len() {
            own[i] *= inverse;
        }
    }
    true
}

/// Replaces a vector by the inverse of a lower triangle, column by column, times the vector.
#[inline(always)]
pub(super) fn substitute(triangle: &[f64], right: &mut [f64]) {
    let size = right.len();
    for k in 0..size {
        let column = &triangle[k * size + k..(k + 1) * size];
        let (first, rest) = right[k..].split_at_mut(1);
        first[0] /= column[0];
        subtract(rest, first[0], &column[1..]);
    }
}

/// Subtracts a multiple of one vector from another.
#[inline(always)]
fn subtract(from: &mut [f64], scale: f64, vector: &[f64]) {
    for i in 0..from.len().min(vector.len()) {
        from[i] -= scale * vector[i];
    }
}

/// Scalar product of two vectors. It adds in the same order on every processor. Its loops use indices, because
/// iterators are not inlined in functions that are compiled for wider vector registers.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    const TOGETHER: usize = 8;
    let ((left, a), (right, b)) = (a.as_chunks::<TOGETHER>(), b.as_chunks::<TOGETHER>());
    let (mut sums, mut sum, mut rest) = ([0.0; TOGETHER], 0.0, 0.0);
    for n in 0..left.len().min(right.len()) {
        for k in 0..TOGETHER {
            sums[k] += left[n][k] * right[n][k];
        }
    }
    for k in 0..a.len().min(b.len()) {
        rest += a[k] * b[k];
    }
    for k in 0..TOGETHER {
        sum += sums[k];
    }
    rest + sum
}
