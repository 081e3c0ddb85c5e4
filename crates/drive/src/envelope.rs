//! Normal equations of points along a path, in symmetric blocks. Each row begins with the first point that is coupled to it.

use nalgebra::{Matrix3, Vector3};

/// A symmetric, positive matrix of 3 by 3 blocks. Each row is stored from its first block to the diagonal; the Cholesky factor has the
/// same first blocks.
pub(super) struct Envelope {
    rows: Vec<Row>,
}

struct Row {
    first: usize,
    blocks: Vec<Matrix3<f64>>,
}

impl Envelope {
    /// Zero, with the first block of each row.
    pub(super) fn new(firsts: &[usize]) -> Self {
        let row = |(i, first): (usize, &usize)| Row { first: *first, blocks: vec![Matrix3::zeros(); i + 1 - first] };
        Self { rows: firsts.iter().enumerate().map(row).collect() }
    }

    /// Adds to the block at row `i` and column `j`, which is between the row's first block and the diagonal.
    pub(super) fn add(&mut self, i: usize, j: usize, block: &Matrix3<f64>) {
        let row = &mut self.rows[i];
        if let Some(at) = j.checked_sub(row.first) {
            row.blocks[at] += block;
        }
    }

    /// Adds to the diagonal a share of each point's own weight, so that no direction is left without any.
    pub(super) fn damp(&mut self, share: f64) {
        for row in &mut self.rows {
            if let Some(diagonal) = row.blocks.last_mut() {
                let weight = share * diagonal.trace() / 3.0;
                *diagonal += Matrix3::identity() * f64::max(weight, f64::MIN_POSITIVE.sqrt());
            }
        }
    }

    /// Solves the equations for the right sides; points whose block is not positive stay at zero.
    pub(super) fn solve(mut self, mut right: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
        let count = self.rows.len();
        // Inverse of each diagonal block of the factor.
        let mut inverses = Vec::with_capacity(count);
        for i in 0..count {
            let first = self.rows[i].first;
            for j in first..=i {
                let other = &self.rows[j];
                let begins = first.max(other.first);
                let mut block = self.rows[i].blocks[j - first];
                for k in begins..j {
                    block -= self.rows[i].blocks[k - first] * other.blocks[k - other.first].transpose();
                }
                if j < i {
                    let inverse: &Matrix3<f64> = &inverses[j];
                    self.rows[i].blocks[j - first] = block * inverse.transpose();
                } else {
                    let factor = block.cholesky().map_or_else(Matrix3::zeros, |factor| factor.l());
                    inverses.push(factor.try_inverse().unwrap_or_else(Matrix3::zeros));
                    self.rows[i].blocks[j - first] = factor;
                }
            }
            let mut sum = right[i];
            for k in first..i {
                sum -= self.rows[i].blocks[k - first] * right[k];
            }
            right[i] = inverses[i] * sum;
        }
        for i in (0..count).rev() {
            let solved = inverses[i].transpose() * right[i];
            right[i] = solved;
            let row = &self.rows[i];
            for k in row.first..i {
                right[k] -= row.blocks[k - row.first].transpose() * solved;
            }
        }
        right
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn an_envelope_is_solved_as_the_whole_matrix_is() {
        // Four points; the third is not coupled to the first, and the fourth only to the third.
        let firsts = [0, 0, 1, 2];
        let block = |i: usize, j: usize| {
            Matrix3::from_fn(
                |r, c| if i == j && r == c { 9.0 } else { 0.3 * f64::sin((i * 7 + j * 5 + r * 3 + c) as f64) },
            )
        };
        let mut envelope = Envelope::new(&firsts);
        let mut whole = DMatrix::zeros(12, 12);
        for (i, first) in firsts.iter().enumerate() {
            for j in *first..=i {
                let block = if i == j { 0.5 * (block(i, i) + block(i, i).transpose()) } else { block(i, j) };
                envelope.add(i, j, &block);
                whole.view_mut((3 * i, 3 * j), (3, 3)).copy_from(&block);
                whole.view_mut((3 * j, 3 * i), (3, 3)).copy_from(&block.transpose());
            }
        }
        let right: Vec<Vector3<f64>> = (0..4).map(|i| Vector3::new(1.0, -2.0, f64::from(i))).collect();
        let flat = DVector::from_iterator(12, right.iter().flat_map(|r| r.iter().copied().collect::<Vec<_>>()));
        let expected = whole.lu().solve(&flat).unwrap();
        for (i, solved) in envelope.solve(right).into_iter().enumerate() {
            assert_relative_eq!(solved, expected.fixed_rows::<3>(3 * i).into_owned(), epsilon = 1e-12);
        }
    }
}
