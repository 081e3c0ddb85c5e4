//! Estimates the drift of the instrument or the arm at each row from neighbouring rows of the run. The drift belongs to
//! no cell, so that it is subtracted from the errors before and after.

use super::engine::Engine;
use super::noise::{Sample, Shape};
use nalgebra::DVector;

impl Engine {
    /// The drift of the run at every scalar, mm and mrad, for poses over the whole robot. It is estimated from the
    /// fitted rows alone, also at held-out rows. It is zero for parts, and if the noise has no drift.
    pub(super) fn run_drift(&self, left: &DVector<f64>) -> DVector<f64> {
        let mut drift = DVector::zeros(left.len());
        if !self.problem.is_of_robot() || self.shape.drift <= 0.0 {
            return drift;
        }
        let mut fitted = vec![false; left.len()];
        for row in self.problem.rows.iter().filter(|row| !row.held_out) {
            row.scalars().for_each(|scalar| fitted[scalar] = true);
        }
        for series in self.problem.series(|_| true) {
            let seen = |&(scalar, ..): &Sample| fitted[scalar].then(|| left[scalar]);
            let smoothed = smoothed(&series.samples, self.shape, seen);
            series.samples.iter().zip(smoothed).for_each(|(&(scalar, ..), mean)| drift[scalar] = mean);
        }
        drift
    }
}

/// Posterior mean of a first-order autoregression at each sample, given the samples for which `seen` returns a value: a
/// Kalman filter, then the backward recursion of Rauch, Tung and Striebel (1965).
fn smoothed(samples: &[Sample], shape: Shape, seen: impl Fn(&Sample) -> Option<f64>) -> Vec<f64> {
    /// The filter at one sample: the correlation with the sample before, and mean and variance without and with the
    /// value of the sample.
    struct Filtered {
        decay: f64,
        predicted: (f64, f64),
        known: (f64, f64),
    }
    let mut filtered: Vec<Filtered> = Vec::with_capacity(samples.len());
    let (mut known, mut last) = ((0.0, shape.drift), None);
    for sample in samples {
        let gap = last.map_or(0, |last: usize| sample.1.abs_diff(last));
        last = Some(sample.1);
        let decay = if gap == 0 { 1.0 } else { shape.drifting(gap) / shape.drift };
        let predicted = (decay * known.0, decay * decay * known.1 + (1.0 - decay * decay) * shape.drift);
        known = seen(sample).map_or(predicted, |value| {
            let gain = predicted.1 / (predicted.1 + sample.2 * sample.2);
            (predicted.0 + gain * (value - predicted.0), (1.0 - gain) * predicted.1)
        });
        filtered.push(Filtered { decay, predicted, known });
    }
    let mut means: Vec<f64> = filtered.iter().map(|f| f.known.0).collect();
    for k in (1..filtered.len()).rev() {
        let Filtered { decay, predicted, .. } = filtered[k];
        let back = filtered[k - 1].known.1 * decay / predicted.1;
        means[k - 1] += back * (means[k] - predicted.0);
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn a_sample_that_was_not_seen_has_the_conditional_mean_given_its_neighbours() {
        let shape = Shape { drift: 0.5, correlation: 0.9, field: None };
        let times = [0usize, 1, 2, 4, 7];
        let values = [1.0, 0.4, 99.0, -0.3, 0.2];
        let samples: Vec<Sample> = times.iter().enumerate().map(|(row, &time)| (row, time, 1.0)).collect();
        let found = smoothed(&samples, shape, |&(row, ..)| (row != 2).then(|| values[row]));
        // The conditional mean is K* (K + I)⁻¹ y over the four samples that were seen.
        let seen = [0, 1, 3, 4];
        let wander = |i: usize, j: usize| 0.5 * 0.9f64.powi(i32::try_from(times[i].abs_diff(times[j])).unwrap());
        let matrix = DMatrix::from_fn(4, 4, |i, j| wander(seen[i], seen[j]) + f64::from(u8::from(i == j)));
        let weights = matrix.cholesky().unwrap().solve(&DVector::from_fn(4, |i, _| values[seen[i]]));
        for (k, found) in found.iter().enumerate() {
            let expected: f64 = (0..4).map(|j| wander(k, seen[j]) * weights[j]).sum();
            assert!((found - expected).abs() < 1e-12, "{k}: {found} {expected}");
        }
    }
}
