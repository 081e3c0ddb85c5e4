//! How well the rows distinguish two effects, before anything is fitted: d′ of each pair.
//!
//! The trace of an effect is the change that it makes to the rows. d′ is the norm of the part of the trace that the
//! other effect and the frame of the part cannot imitate, over the noise, for an effect of a fixed size. From 5 on the
//! two can be distinguished. Below 3 they cannot, and more rows of the same kind do not help.

use super::candidate::Candidate;
use super::moments::Moments;
use super::outcome::Separation;
use nalgebra::{DMatrix, DVector};

/// Size of the effect, mm rms: errors of this size are worth correcting in a milling cell.
const SIZE_MM: f64 = 0.03;
/// d′ from which on a pair is not listed.
const APART: f64 = 10.0;
/// Share of the square of a column that is added to it, so that linearly dependent columns can be eliminated.
const RIDGE: f64 = 1e-9;

/// A candidate of one kind with its fitted numbers, in typical sizes.
pub(super) struct Trace<'a> {
    pub(super) candidate: &'a Candidate,
    pub(super) numbers: DVector<f64>,
}

/// d′ of every pair that is not distinguished well, the hardest first. Each trace is given with its rms, mm; `nuisance`
/// has the columns that can imitate any effect, and `sigma` is the noise, mm.
pub(super) fn pairs(traces: &[(Trace<'_>, f64)], nuisance: &[usize], moments: &Moments, sigma: f64) -> Vec<Separation> {
    let mut found = Vec::new();
    for (truth, rms_mm) in traces.iter().filter(|(_, rms_mm)| *rms_mm > 0.0) {
        for (other, _) in traces.iter().filter(|(other, _)| other.candidate.family != truth.candidate.family) {
            let imitating: Vec<usize> = {
                // The frame is a nuisance except where it is the effect itself.
                let nuisance = nuisance.iter().copied().filter(|column| !truth.candidate.columns().contains(column));
                other.candidate.columns().chain(nuisance).collect()
            };
            let left = outside(moments, truth.candidate.columns().collect(), &truth.numbers, &imitating);
            let d_prime = left.sqrt() / sigma * (SIZE_MM / rms_mm);
            if d_prime < APART {
                let (of, from) = (truth.candidate.kind.clone(), other.candidate.kind.clone());
                found.push(Separation { of, from, d_prime });
            }
        }
    }
    found.sort_by(|a, b| a.d_prime.total_cmp(&b.d_prime));
    found
}

/// Squared norm, mm², of the part of a whitened trace that is orthogonal to the columns `imitating`. The trace has the
/// columns `own` with these numbers.
fn outside(moments: &Moments, own: Vec<usize>, numbers: &DVector<f64>, imitating: &[usize]) -> f64 {
    let gram = |rows: &[usize], columns: &[usize]| {
        DMatrix::from_fn(rows.len(), columns.len(), |i, j| moments.gram[(rows[i], columns[j])])
    };
    let cross = gram(imitating, &own) * numbers;
    let mut inner = gram(imitating, imitating);
    for i in 0..imitating.len() {
        inner[(i, i)] += RIDGE * inner[(i, i)] + f64::MIN_POSITIVE;
    }
    let whole = numbers.dot(&(gram(&own, &own) * numbers));
    let Some(factor) = inner.cholesky() else { return whole };
    (whole - cross.dot(&factor.solve(&cross))).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::noise::{Series, Shape};
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn the_part_in_the_span_of_other_columns_is_subtracted() {
        // Of the square of the column (1, 0, 0), half is orthogonal to (1, 1, 0), and all of it to (0, 0, 1).
        let stacked = DMatrix::from_row_slice(3, 4, &[1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let series =
            [Series { samples: (0..3).map(|t| (t, t, 1.0)).collect(), places: [[Vector3::zeros(); 3]; 3].into() }];
        let moments = Moments::of(&stacked, &series, Shape { drift: 0.0, correlation: 0.0, field: None });
        let one = DVector::from_element(1, 2.0);
        assert!((outside(&moments, vec![0], &one, &[1]) - 2.0).abs() < 1e-6);
        assert!((outside(&moments, vec![0], &one, &[2]) - 4.0).abs() < 1e-6);
        assert!(outside(&moments, vec![0], &one, &[0]) < 1e-6);
    }
}
