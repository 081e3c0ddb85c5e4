//! Products of whitened columns: all that evidence needs, whatever the number of rows.

use super::design::Design;
use super::noise::{Field, Sample, Series, Shape, Step, Whitened, products_under_fields, steps, whiten};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

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
            products(&Columns::stacked(stacked), series, &[shape], None).swap_remove(0)
        };
        Self::from_products(full, log_scale, series, shape)
    }

    /// Moments of `y` (last column of `stacked`) on the columns before it, under noises whose fields differ in size alone.
    pub(super) fn under_fields(stacked: &DMatrix<f64>, series: &[Series], shapes: &[(Shape, Field)]) -> Vec<Self> {
        let all = products_under_fields(stacked, series, shapes);
        let of = |((full, log_scale), &(shape, _))| Self::from_products(full, log_scale, series, shape);
        all.into_iter().zip(shapes).map(of).collect()
    }

    /// Moments of data on the columns of a design, under each of some noises without a field; with `own`, of columns only with
    /// those of the same range, and zero elsewhere.
    pub(super) fn on(
        design: &Design,
        data: &DVector<f64>,
        series: &[Series],
        shapes: &[Shape],
        own: Option<&[Range<usize>]>,
    ) -> Vec<Self> {
        let all = products(&Columns::of(design, data), series, shapes, own);
        let of = |((full, log_scale), &shape)| Self::from_products(full, log_scale, series, shape);
        all.into_iter().zip(shapes).map(of).collect()
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
            columns.whitened(series, &[steps(series, self.shape)], |_, block| {
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

/// Products of all whitened columns, data last, and half the log determinant of the whitening, for each shape; with `own`, of
/// columns only with those of the same range and with the data.
fn products(
    columns: &Columns,
    series: &[Series],
    shapes: &[Shape],
    own: Option<&[Range<usize>]>,
) -> Vec<(DMatrix<f64>, f64)> {
    /// Shapes that one thread whitens the same columns for.
    const TOGETHER: usize = 4;
    let width = columns.width;
    let of_series = |(shapes, series): (&[Shape], &Series)| {
        let steps: Vec<Vec<Step>> = shapes.iter().map(|&shape| steps(series, shape)).collect();
        let mut full = vec![DMatrix::zeros(width, width); shapes.len()];
        columns.whitened(series, &steps, |shape, block| match own {
            Some(own) => add_own_squares(&mut full[shape], block, own),
            None => add_square(&mut full[shape], block),
        });
        let log_scales = steps.iter().map(|steps| steps.iter().map(|step| 0.5 * step.variance.ln()).sum::<f64>());
        full.into_iter().zip(log_scales).collect::<Vec<_>>()
    };
    let tasks: Vec<(&[Shape], &Series)> =
        shapes.chunks(TOGETHER).flat_map(|shapes| series.iter().map(move |series| (shapes, series))).collect();
    let parts: Vec<Vec<(DMatrix<f64>, f64)>> = tasks.into_par_iter().map(of_series).collect();
    let mut parts = parts.into_iter();
    let sum = |shapes: &[Shape]| {
        let none = vec![(DMatrix::zeros(width, width), 0.0); shapes.len()];
        parts.by_ref().take(series.len()).fold(none, |sum, part| {
            sum.into_iter().zip(part).map(|(sum, part)| (sum.0 + part.0, sum.1 + part.1)).collect()
        })
    };
    let mut all: Vec<(DMatrix<f64>, f64)> = shapes.chunks(TOGETHER).flat_map(sum).collect();
    all.iter_mut().for_each(|(full, _)| full.fill_upper_triangle_with_lower_triangle());
    all
}

/// Adds the products of some ranges' columns with their own, and of all with the data, which are last: the lower triangle.
fn add_own_squares(full: &mut DMatrix<f64>, block: &DMatrix<f64>, own: &[Range<usize>]) {
    let width = block.nrows();
    let full = full.as_mut_slice();
    for values in block.as_slice().chunks_exact(width) {
        for range in own {
            for j in range.clone() {
                let (from, value) = (j * width, values[j]);
                let below = full[from + j..from + range.end].iter_mut().zip(&values[j..range.end]);
                below.for_each(|(sum, other)| *sum += value * other);
            }
        }
        let data = values[width - 1];
        full.iter_mut().skip(width - 1).step_by(width).zip(values).for_each(|(sum, value)| *sum += data * value);
    }
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

    /// Whitens all columns along a series by each of some steps, a block of samples (its columns) at a time: memory does not grow
    /// with the rows.
    fn whitened(&self, series: &Series, steps: &[Vec<Step>], mut take: impl FnMut(usize, &DMatrix<f64>)) {
        const ROWS: usize = 512;
        let mut drifts = vec![vec![0.0; self.width]; steps.len()];
        for (n, samples) in series.samples.chunks(ROWS).enumerate() {
            let mut filled = DMatrix::zeros(self.width, samples.len());
            (self.fill)(samples, filled.as_mut_slice());
            for (shape, (steps, drift)) in steps.iter().zip(&mut drifts).enumerate() {
                let mut block = filled.clone();
                for (values, step) in block.as_mut_slice().chunks_exact_mut(self.width).zip(&steps[n * ROWS..]) {
                    let root = step.variance.sqrt();
                    for (value, drift) in values.iter_mut().zip(drift.iter_mut()) {
                        *drift *= step.decay;
                        let innovation = *value - *drift;
                        *drift += step.gain * innovation;
                        *value = innovation / root;
                    }
                }
                take(shape, &block);
            }
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
        let series = [Series { samples, places: [[Vector3::zeros(); 3]; 1300].into() }];
        let stacked = DMatrix::from_fn(1300, 3, |i, j| ((i * (j + 2)) as f64 * 0.37).sin());
        let whole = whiten(&stacked, &series, shape);
        let (full, log_scale) = products(&Columns::stacked(&stacked), &series, &[shape], None).swap_remove(0);
        assert!((whole.columns.transpose() * &whole.columns - full).amax() < 1e-9);
        assert!((whole.log_scale - log_scale).abs() < 1e-9);
    }

    #[test]
    fn products_of_own_ranges_are_those_of_all_there_and_of_each_shape_its_own() {
        let shapes = [0.0, 0.2, 0.4, 0.8, 1.6].map(|drift| Shape { drift, correlation: 0.9, field: None });
        let samples = |from: usize| (0..700).map(|t| (from + t, t, 1.0)).collect();
        let series =
            [0, 700].map(|from| Series { samples: samples(from), places: [[Vector3::zeros(); 3]; 700].into() });
        let stacked = DMatrix::from_fn(1400, 6, |i, j| ((i * (j + 2)) as f64 * 0.37).sin());
        let columns = Columns::stacked(&stacked);
        let all = products(&columns, &series, &shapes, None);
        let own = products(&columns, &series, &shapes, Some(&[0..2, 2..5]));
        for (n, &shape) in shapes.iter().enumerate() {
            let (alone, log_scale) = products(&columns, &series, &[shape], None).swap_remove(0);
            assert!((&all[n].0 - alone).amax() < 1e-9 && (all[n].1 - log_scale).abs() < 1e-12);
            for (i, j) in [(0, 0), (1, 0), (1, 1), (3, 2), (4, 4), (5, 0), (5, 4), (5, 5)] {
                assert!((all[n].0[(i, j)] - own[n].0[(i, j)]).abs() < 1e-9, "{i} {j}");
            }
            assert!(own[n].0[(3, 1)].abs() < f64::MIN_POSITIVE);
        }
    }
}
