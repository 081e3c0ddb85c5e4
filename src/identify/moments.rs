//! Products of whitened columns: all that evidence needs, whatever the number of rows.

use super::design::Design;
use super::noise::{Sample, Series, Shape, Step, Whitened, steps, whiten};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

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
    /// Standard deviation of the noise as the table declares it, mm.
    pub(super) declared: Option<f64>,
}

impl Moments {
    /// Moments of `y` (last column of `stacked`) on the columns before it.
    pub(super) fn of(stacked: &DMatrix<f64>, series: &[Series], shape: Shape) -> Self {
        let (full, log_scale) = if shape.field.is_some() {
            let Whitened { columns, log_scale } = whiten(stacked, series, shape);
            let used: Vec<usize> = series.iter().flat_map(|s| s.samples.iter().map(|&(row, _, _)| row)).collect();
            let columns = columns.select_rows(&used);
            (columns.transpose() * &columns, log_scale)
        } else {
            products(&Columns::stacked(stacked), series, shape)
        };
        Self::from_products(full, log_scale, series, shape)
    }

    /// Moments of data on the columns of a design, under noise without a field.
    pub(super) fn on(design: &Design, data: &DVector<f64>, series: &[Series], shape: Shape) -> Self {
        let (full, log_scale) = products(&Columns::of(design, data), series, shape);
        Self::from_products(full, log_scale, series, shape)
    }

    fn from_products(full: DMatrix<f64>, log_scale: f64, series: &[Series], shape: Shape) -> Self {
        let width = full.ncols() - 1;
        Self {
            gram: full.view((0, 0), (width, width)).into_owned(),
            cross: full.view((0, width), (width, 1)).column(0).into_owned(),
            square: full[(width, width)],
            count: series.iter().map(|series| series.samples.len()).sum(),
            log_scale,
            shape,
            declared: None,
        }
    }

    /// The same columns with other data: their own products serve again.
    pub(super) fn with_data(self, design: &Design, data: &DVector<f64>, series: &[Series]) -> Self {
        let columns = Columns::of(design, data);
        let last = columns.width - 1;
        let of_series = |series: &Series| {
            let (mut cross, mut square) = (DVector::zeros(last), 0.0);
            columns.whitened(series, &steps(series, self.shape), |block| {
                let y = block.row(last).transpose();
                cross.gemv(1.0, &block.rows(0, last), &y, 1.0);
                square += y.norm_squared();
            });
            (cross, square)
        };
        let parts: Vec<_> = series.par_iter().map(of_series).collect();
        let none = (DVector::zeros(last), 0.0);
        let (cross, square) = parts.into_iter().fold(none, |sum, part| (sum.0 + part.0, sum.1 + part.1));
        Self { cross, square, ..self }
    }
}

/// Products of all whitened columns, data last.
fn products(columns: &Columns, series: &[Series], shape: Shape) -> (DMatrix<f64>, f64) {
    let width = columns.width;
    let of_series = |series: &Series| {
        let steps = steps(series, shape);
        let mut full = DMatrix::zeros(width, width);
        columns.whitened(series, &steps, |block| add_square(&mut full, block));
        (full, steps.iter().map(|step| 0.5 * step.variance.ln()).sum::<f64>())
    };
    let parts: Vec<_> = series.par_iter().map(of_series).collect();
    let none = (DMatrix::zeros(width, width), 0.0);
    let (mut full, log_scale) = parts.into_iter().fold(none, |sum, part| (sum.0 + part.0, sum.1 + part.1));
    full.fill_upper_triangle_with_lower_triangle();
    (full, log_scale)
}

/// Adds the lower triangle of a block times its transpose, some columns at a time: the upper one is its mirror.
fn add_square(full: &mut DMatrix<f64>, block: &DMatrix<f64>) {
    const COLUMNS: usize = 64;
    let (width, transposed) = (block.nrows(), block.transpose());
    for at in (0..width).step_by(COLUMNS) {
        let (below, wide) = (width - at, COLUMNS.min(width - at));
        let mut part = full.view_mut((at, at), (below, wide));
        part.gemm(1.0, &block.rows(at, below), &transposed.columns(at, wide), 1.0);
    }
}

/// Writes the values of some samples, each sample's together.
type Fill<'a> = dyn Fn(&[Sample], &mut [f64]) + Sync + 'a;

/// Columns that are whitened some rows at a time, data last.
struct Columns<'a> {
    width: usize,
    fill: Box<Fill<'a>>,
}

impl<'a> Columns<'a> {
    fn of(design: &'a Design, data: &'a DVector<f64>) -> Self {
        let width = design.width() + 1;
        let fill = move |samples: &[Sample], block: &mut [f64]| {
            design.fill(samples, width, block);
            for (&(scalar, ..), block) in samples.iter().zip(block.chunks_exact_mut(width)) {
                block[width - 1] = data[scalar];
            }
        };
        Self { width, fill: Box::new(fill) }
    }

    fn stacked(stacked: &'a DMatrix<f64>) -> Self {
        let width = stacked.ncols();
        let fill = move |samples: &[Sample], block: &mut [f64]| {
            for (&(scalar, ..), block) in samples.iter().zip(block.chunks_exact_mut(width)) {
                block.iter_mut().zip(stacked.column_iter()).for_each(|(value, column)| *value = column[scalar]);
            }
        };
        Self { width, fill: Box::new(fill) }
    }

    /// Whitens all columns along a series, a block of samples (its columns) at a time: memory does not grow with the rows.
    fn whitened(&self, series: &Series, steps: &[Step], mut take: impl FnMut(&DMatrix<f64>)) {
        const ROWS: usize = 512;
        let mut drift = vec![0.0; self.width];
        for (samples, steps) in series.samples.chunks(ROWS).zip(steps.chunks(ROWS)) {
            let mut block = DMatrix::zeros(self.width, samples.len());
            (self.fill)(samples, block.as_mut_slice());
            for (values, step) in block.as_mut_slice().chunks_exact_mut(self.width).zip(steps) {
                let root = step.variance.sqrt();
                for (value, drift) in values.iter_mut().zip(&mut drift) {
                    *drift *= step.decay;
                    let innovation = *value - *drift;
                    *drift += step.gain * innovation;
                    *value = innovation / root;
                }
            }
            take(&block);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::noise::whiten;
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn products_some_rows_at_a_time_are_those_of_the_whole() {
        let shape = Shape { drift: 0.4, correlation: 0.9, field: None };
        let samples = (0..1300).map(|t| (t, t + t / 100, 1.0 + 0.1 * (t % 3) as f64)).collect();
        let series = [Series { samples, places: vec![[Vector3::zeros(); 3]; 1300] }];
        let stacked = DMatrix::from_fn(1300, 3, |i, j| ((i * (j + 2)) as f64 * 0.37).sin());
        let whole = whiten(&stacked, &series, shape);
        let (full, log_scale) = products(&Columns::stacked(&stacked), &series, shape);
        assert!((whole.columns.transpose() * &whole.columns - full).amax() < 1e-9);
        assert!((whole.log_scale - log_scale).abs() < 1e-9);
    }
}
