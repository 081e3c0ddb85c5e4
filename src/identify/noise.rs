//! Noise of measured rows: white plus a slow wander, as real robots show.
//!
//! Each axis of each run is `y_t = w_t + e_t`, e white with variance σ², w a first-order autoregression with
//! stationary variance λσ² and correlation ρ from row to row. A Kalman filter whitens data and columns in one pass;
//! rows that are not fitted are missing observations to it, so that blocks can be left out anywhere.

use nalgebra::{DMatrix, DVector};

/// Shape of the noise; its size σ is profiled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    /// Variance of the wander over that of the white part.
    pub(super) wander: f64,
    /// Correlation of the wander from one row to the next.
    pub(super) correlation: f64,
}

/// Shapes that are tried: none, then from faint to dominant and from three rows to fifty.
pub(super) fn shapes() -> Vec<Shape> {
    let mut all = vec![Shape { wander: 0.0, correlation: 0.0 }];
    for wander in [0.06, 0.2, 0.5, 1.2, 3.0] {
        for correlation in [0.8, 0.9, 0.95] {
            all.push(Shape { wander, correlation });
        }
    }
    all
}

/// White, and a few wanders of the usual length.
#[allow(clippy::float_cmp)] // shapes come from one list
pub(super) fn few() -> Vec<Shape> {
    shapes().into_iter().filter(|s| s.wander == 0.0 || s.correlation == 0.9 && s.wander < 1.0).collect()
}

/// Shapes near one, and white.
#[allow(clippy::float_cmp)] // shapes come from one list
pub(super) fn near(shape: Shape) -> Vec<Shape> {
    let close = |s: &Shape| {
        s.wander == 0.0
            || *s == shape
            || s.correlation == shape.correlation && (s.wander / shape.wander).ln().abs() < 1.3
    };
    shapes().into_iter().filter(close).collect()
}

impl Shape {
    /// Log prior of a shape, nats: wanders of a real arm are rather smaller than its white noise, and a much
    /// larger one is an effect that nobody modelled.
    pub(super) fn log_prior(self) -> f64 {
        const USUAL: f64 = 0.5;
        const SPREAD: f64 = 0.4;
        if self.wander <= USUAL { 0.0 } else { -0.5 * ((self.wander / USUAL).ln() / SPREAD).powi(2) }
    }
}

/// One series of scalars in the order in which they were measured.
#[derive(Clone, Debug, Default)]
pub(super) struct Series {
    /// (row of the stacked design, time index, standard deviation relative to σ).
    pub(super) samples: Vec<(usize, usize, f64)>,
}

/// Whitened columns and the log determinant of the whitening (Σ ½ ln S_t, at σ = 1).
pub(super) struct Whitened {
    pub(super) columns: DMatrix<f64>,
    pub(super) log_scale: f64,
}

/// Whitens every column of `stacked` along the series.
pub(super) fn whiten(stacked: &DMatrix<f64>, series: &[Series], shape: Shape) -> Whitened {
    let gains: Vec<Vec<Step>> = series.iter().map(|series| steps(series, shape)).collect();
    let log_scale = gains.iter().flatten().map(|step| 0.5 * step.variance.ln()).sum();
    let mut columns = stacked.clone();
    for mut column in columns.column_iter_mut() {
        for (series, gains) in series.iter().zip(&gains) {
            let mut wander = 0.0;
            for ((row, _, _), step) in series.samples.iter().zip(gains) {
                wander *= step.decay;
                let innovation = column[*row] - wander;
                wander += step.gain * innovation;
                column[*row] = innovation / step.variance.sqrt();
            }
        }
    }
    Whitened { columns, log_scale }
}

struct Step {
    decay: f64,
    gain: f64,
    variance: f64,
}

fn steps(series: &Series, shape: Shape) -> Vec<Step> {
    let mut uncertainty = shape.wander;
    let mut last = None;
    series
        .samples
        .iter()
        .map(|&(_, time, relative)| {
            let gap = last.map_or(0, |last: usize| time.saturating_sub(last));
            last = Some(time);
            #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
            let decay = shape.correlation.powi(gap as i32);
            uncertainty = decay * decay * uncertainty + (1.0 - decay * decay) * shape.wander;
            let variance = uncertainty + relative * relative;
            let gain = uncertainty / variance;
            uncertainty *= 1.0 - gain;
            Step { decay, gain, variance }
        })
        .collect()
}

/// Sums of products of whitened columns: all that evidence needs, whatever the number of rows.
#[derive(Clone, Debug)]
pub(super) struct Moments {
    /// Xᵀ X over the prior sizes.
    pub(super) gram: DMatrix<f64>,
    /// Xᵀ y.
    pub(super) cross: DVector<f64>,
    /// yᵀ y.
    pub(super) square: f64,
    /// Number of scalars.
    pub(super) count: usize,
    /// Σ ½ ln S_t at σ = 1.
    pub(super) log_scale: f64,
    pub(super) shape: Shape,
}

impl Moments {
    /// Moments of `y` (last column of `stacked`) on the columns before it.
    pub(super) fn of(stacked: &DMatrix<f64>, series: &[Series], shape: Shape) -> Self {
        let Whitened { columns, log_scale } = whiten(stacked, series, shape);
        let used: Vec<usize> = series.iter().flat_map(|s| s.samples.iter().map(|&(row, _, _)| row)).collect();
        let columns = if used.len() == columns.nrows() { columns } else { columns.select_rows(&used) };
        let width = columns.ncols() - 1;
        let full = columns.tr_mul(&columns);
        Self {
            gram: full.view((0, 0), (width, width)).into_owned(),
            cross: full.view((0, width), (width, 1)).column(0).into_owned(),
            square: full[(width, width)],
            count: used.len(),
            log_scale,
            shape,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whitening_is_the_inverse_square_root_of_the_covariance() {
        let shape = Shape { wander: 0.8, correlation: 0.9 };
        let times = [0usize, 1, 2, 5, 6];
        let series = [Series { samples: times.iter().enumerate().map(|(row, &t)| (row, t, 1.0)).collect() }];
        let covariance = DMatrix::from_fn(5, 5, |i, j| {
            let lag = times[i].abs_diff(times[j]);
            shape.wander * shape.correlation.powi(lag as i32) + f64::from(u8::from(i == j))
        });
        let whitened = whiten(&DMatrix::identity(5, 5), &series, shape);
        let product = &whitened.columns * covariance.clone() * whitened.columns.transpose();
        assert!((product - DMatrix::identity(5, 5)).amax() < 1e-12);
        let half_log_det = 0.5 * covariance.determinant().ln();
        assert!((whitened.log_scale - half_log_det).abs() < 1e-12);
    }
}
