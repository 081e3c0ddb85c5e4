//! How far apart two effects are on these rows, before anything is fitted: d′ of each pair.
//!
//! The trace that one effect of a fixed size leaves, less all that the other one and the frame of the part could imitate,
//! over the noise: from 5 on they can be distinguished, below 3 they cannot, whatever is measured more of the same.

use super::candidate::Candidate;
use super::moments::Moments;
use super::outcome::Separation;
use nalgebra::{DMatrix, DVector};

/// Size of the effect whose trace is taken, mm rms: what a milling cell is corrected for.
const SIZE_MM: f64 = 0.03;
/// Pairs above this are as good as apart, and are not listed.
const APART: f64 = 10.0;
/// Share of a column's own size below which nothing of it is left.
const RIDGE: f64 = 1e-9;

/// One kind with the numbers that stand for it, in prior sizes.
pub(super) struct Trace<'a> {
    pub(super) candidate: &'a Candidate,
    pub(super) numbers: DVector<f64>,
}

/// d′ of every pair that is not well apart, closest first; `sigma` in mm, `rms_mm` of each trace as given.
pub(super) fn pairs(traces: &[(Trace<'_>, f64)], nuisance: &[usize], moments: &Moments, sigma: f64) -> Vec<Separation> {
    let mut found = Vec::new();
    for (truth, rms_mm) in traces.iter().filter(|(_, rms_mm)| *rms_mm > 0.0) {
        for (other, _) in traces.iter().filter(|(other, _)| other.candidate.family != truth.candidate.family) {
            let imitating: Vec<usize> = {
                // A frame that is the effect itself is no nuisance to it.
                let beside = nuisance.iter().copied().filter(|column| !truth.candidate.columns().contains(column));
                other.candidate.columns().chain(beside).collect()
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

/// Squared whitened norm of a trace outside the span of some columns.
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
    fn what_another_spans_is_taken_off() {
        // Columns (1, 0, 0), (1, 1, 0), (0, 0, 1): of the first, half of its square is outside the second.
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
