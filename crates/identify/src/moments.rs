//! Sums of products of whitened columns. They are all that the evidence needs, so that its cost does not grow with the
//! number of rows.

use super::design::{Design, gather};
use super::noise::{Field, Sample, Series, Shape, Step, Whitened, products_under_fields, steps, whiten};
use deflex_lanes::widest;
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Sums of products of the whitened columns X of a design and of the whitened data y, mm², under one shape of the
/// noise.
#[derive(Clone, Debug)]
pub(super) struct Moments {
    /// Xᵀ X; a column is the change for one typical size.
    pub(super) gram: DMatrix<f64>,
    /// Xᵀ y.
    pub(super) cross: DVector<f64>,
    /// yᵀ y.
    pub(super) square: f64,
    /// Number of scalars.
    pub(super) count: usize,
    /// Half the log determinant of the covariance of the noise at σ = 1.
    pub(super) log_scale: f64,
    /// The shape of the noise that whitened the columns.
    pub(super) shape: Shape,
    /// Standard deviation of the noise that the table declares, mm.
    pub(super) declared: Option<f64>,
}

impl Moments {
    /// Moments of the data, which are the last column of `stacked`, on the other columns.
    pub(super) fn of(stacked: &DMatrix<f64>, series: &[Series], shape: Shape) -> Self {
        let (full, log_scale) = if shape.field.is_some() {
            let Whitened { columns, log_scale } = whiten(stacked, series, shape);
            let used: Vec<usize> = series.iter().flat_map(|s| s.samples.iter().map(|&(row, _, _)| row)).collect();
            let columns = columns.select_rows(&used);
            (columns.transpose() * &columns, log_scale)
        } else {
            products(&ColumnSource::stacked(stacked), series, &[shape], None).swap_remove(0)
        };
        Self::from_products(full, log_scale, series, shape)
    }

    /// The same under several shapes of the noise, whose fields differ only in their variance.
    pub(super) fn under_fields(stacked: &DMatrix<f64>, series: &[Series], shapes: &[(Shape, Field)]) -> Vec<Self> {
        let all = products_under_fields(stacked, series, shapes);
        let of = |((full, log_scale), &(shape, _))| Self::from_products(full, log_scale, series, shape);
        all.into_iter().zip(shapes).map(of).collect()
    }

    /// Moments of data on the columns of a design, under each of several shapes of the noise that have no field. With
    /// `own` the products of columns of two different ranges are not computed, and are zero.
    pub(super) fn on(
        design: &Design,
        data: &DVector<f64>,
        series: &[Series],
        shapes: &[Shape],
        own: Option<&[Range<usize>]>,
    ) -> Vec<Self> {
        let all = products(&ColumnSource::of(design, data), series, shapes, own);
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

    /// The moments of other data on the same columns, whose products with one another are kept. The shape must have no
    /// field.
    pub(super) fn with_data(self, design: &Design, data: &DVector<f64>, series: &[Series]) -> Self {
        let columns = ColumnSource::of(design, data);
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

/// For each shape of the noise the products of all whitened columns, the data being the last one, and half the log
/// determinant of the covariance of the noise. With `own` a column is multiplied only by those of its range and by the
/// data.
fn products(
    columns: &ColumnSource,
    series: &[Series],
    shapes: &[Shape],
    own: Option<&[Range<usize>]>,
) -> Vec<(DMatrix<f64>, f64)> {
    /// Number of shapes for which one thread whitens a block of columns, so that the block is filled once for all of
    /// them.
    const TOGETHER: usize = 4;
    let width = columns.width;
    let of_series = |(shapes, series): (&[Shape], &Series)| {
        let steps: Vec<Vec<Step>> = shapes.iter().map(|&shape| steps(series, shape)).collect();
        let mut sums: Vec<Sums> = shapes.iter().map(|_| Sums::new(width, own)).collect();
        columns.whitened(series, &steps, |shape, block| sums[shape].add(block));
        let log_scales = steps.iter().map(|steps| steps.iter().map(|step| 0.5 * step.variance.ln()).sum::<f64>());
        sums.into_iter().zip(log_scales).collect::<Vec<_>>()
    };
    let tasks: Vec<(&[Shape], &Series)> =
        shapes.chunks(TOGETHER).flat_map(|shapes| series.iter().map(move |series| (shapes, series))).collect();
    let parts: Vec<Vec<(Sums, f64)>> = tasks.into_par_iter().map(of_series).collect();
    let mut parts = parts.into_iter();
    let mut all = Vec::new();
    for shapes in shapes.chunks(TOGETHER) {
        let mut sums: Vec<(Sums, f64)> = shapes.iter().map(|_| (Sums::new(width, own), 0.0)).collect();
        for part in parts.by_ref().take(series.len()) {
            for ((sum, log_scale), (own, of_own)) in sums.iter_mut().zip(part) {
                sum.values.iter_mut().zip(own.values).for_each(|(sum, value)| *sum += value);
                *log_scale += of_own;
            }
        }
        all.extend(sums.into_iter().map(|(sum, log_scale)| (sum.full(), log_scale)));
    }
    all
}

/// Sums of products of columns, the data being the last one: of every pair, or of the pairs within some ranges and of
/// all with the data.
struct Sums<'a> {
    width: usize,
    own: Option<&'a [Range<usize>]>,
    /// Without ranges, the lower triangle of a matrix, column by column. With ranges, the square of each range, then
    /// the products of all columns with the data.
    values: Vec<f64>,
}

impl<'a> Sums<'a> {
    /// Sums of zero for columns of this number, the data among them.
    fn new(width: usize, own: Option<&'a [Range<usize>]>) -> Self {
        let size = own.map_or(width * width, |own| own.iter().map(|range| range.len().pow(2)).sum::<usize>() + width);
        Self { width, own, values: vec![0.0; size] }
    }

    /// Adds the products over a block of samples, each of which is one column of the block.
    fn add(&mut self, block: &DMatrix<f64>) {
        let width = self.width;
        match self.own {
            Some(own) => widest!(<'a> (
                width: usize = width,
                values: &'a mut [f64] = &mut self.values,
                block: &'a [f64] = block.as_slice(),
                own: &'a [Range<usize>] = own,
            ) {
                for t in 0..block.len() / width {
                    let sample = &block[t * width..(t + 1) * width];
                    let mut at = 0;
                    for n in 0..own.len() {
                        let range = &sample[own[n].start..own[n].end];
                        for i in 0..range.len() {
                            add_times(range[i], range, &mut values[at..at + range.len()]);
                            at += range.len();
                        }
                    }
                    add_times(sample[width - 1], sample, &mut values[at..at + width]);
                }
            }),
            None => add_square(&mut DMatrixViewMut::from_slice(&mut self.values, width, width), block),
        }
    }

    /// The symmetric matrix of all products; those that were not computed are zero.
    fn full(self) -> DMatrix<f64> {
        let width = self.width;
        let Some(own) = self.own else {
            let mut full = DMatrix::from_vec(width, width, self.values);
            full.fill_upper_triangle_with_lower_triangle();
            return full;
        };
        let mut full = DMatrix::zeros(width, width);
        let mut rest = &self.values[..];
        for range in own {
            let (square, others) = rest.split_at(range.len() * range.len());
            full.view_mut((range.start, range.start), (range.len(), range.len())).copy_from_slice(square);
            rest = others;
        }
        full.row_mut(width - 1).copy_from_slice(rest);
        full.column_mut(width - 1).copy_from_slice(rest);
        full
    }
}

/// Adds a multiple of some values.
#[inline(always)]
fn add_times(factor: f64, values: &[f64], into: &mut [f64]) {
    for k in 0..values.len().min(into.len()) {
        into[k] += factor * values[k];
    }
}

/// Adds the lower triangle of a block times its transpose. It goes by groups of columns, so that the products are
/// matrix products and little of the upper triangle is computed.
fn add_square(full: &mut DMatrixViewMut<f64>, block: &DMatrix<f64>) {
    const COLUMNS: usize = 64;
    let (width, samples) = block.shape();
    let transposed = DMatrixView::from_slice_with_strides(block.as_slice(), samples, width, width, 1);
    for at in (0..width).step_by(COLUMNS) {
        let (below, wide) = (width - at, COLUMNS.min(width - at));
        let mut part = full.view_mut((at, at), (below, wide));
        part.gemm(1.0, &block.rows(at, below), &transposed.columns(at, wide), 1.0);
    }
}

/// Writes the values of all columns at some samples, sample by sample.
type Fill<'a> = dyn Fn(&[Sample], &mut [f64]) + Sync + 'a;

/// Columns that are computed and whitened for a few hundred samples at a time, so that a long table is never held as a
/// matrix. The data are usually the last column.
pub(super) struct ColumnSource<'a> {
    /// Number of columns.
    pub(super) width: usize,
    fill: Box<Fill<'a>>,
}

impl<'a> ColumnSource<'a> {
    pub(super) fn new(width: usize, fill: impl Fn(&[Sample], &mut [f64]) + Sync + 'a) -> Self {
        Self { width, fill: Box::new(fill) }
    }

    /// The columns of a design, then the data.
    fn of(design: &'a Design, data: &'a DVector<f64>) -> Self {
        let width = design.width() + 1;
        let fill = move |samples: &[Sample], block: &mut [f64]| {
            design.fill(samples, width, block);
            for (&(scalar, ..), block) in samples.iter().zip(block.chunks_exact_mut(width)) {
                block[width - 1] = data[scalar];
            }
        };
        Self::new(width, fill)
    }

    /// The columns of a matrix over all scalars.
    pub(super) fn stacked(stacked: &'a DMatrix<f64>) -> Self {
        let width = stacked.ncols();
        let fill = move |samples: &[Sample], block: &mut [f64]| {
            gather(stacked, samples, width, block);
        };
        Self::new(width, fill)
    }

    /// Whitens all columns along a series with the Kalman steps of each of several shapes. `take` receives the index of
    /// the shape and one block after another, whose columns are samples; memory does not grow with the number of rows.
    pub(super) fn whitened(&self, series: &Series, steps: &[Vec<Step>], mut take: impl FnMut(usize, &DMatrix<f64>)) {
        const ROWS: usize = 512;
        let width = self.width;
        let mut drifts = vec![vec![0.0; width]; steps.len()];
        for (n, samples) in series.samples.chunks(ROWS).enumerate() {
            let mut filled = DMatrix::zeros(width, samples.len());
            (self.fill)(samples, filled.as_mut_slice());
            let mut block = DMatrix::zeros(width, samples.len());
            for (shape, (steps, drift)) in steps.iter().zip(&mut drifts).enumerate() {
                widest!(<'a> (
                    width: usize = width,
                    steps: &'a [Step] = &steps[n * ROWS..],
                    drift: &'a mut [f64] = drift,
                    filled: &'a [f64] = filled.as_slice(),
                    block: &'a mut [f64] = block.as_mut_slice(),
                ) {
                    let drift = &mut drift[..width];
                    for t in 0..filled.len() / width {
                        let Step { decay, gain, variance } = steps[t];
                        let precision = 1.0 / variance.sqrt();
                        let values = &filled[t * width..(t + 1) * width];
                        let out = &mut block[t * width..(t + 1) * width];
                        for k in 0..width {
                            let before = drift[k] * decay;
                            let innovation = values[k] - before;
                            drift[k] = before + gain * innovation;
                            out[k] = innovation * precision;
                        }
                    }
                });
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
    fn products_by_blocks_of_rows_are_those_of_the_whole_matrix() {
        let shape = Shape { drift: 0.4, correlation: 0.9, field: None };
        let samples = (0..1300).map(|t| (t, t + t / 100, 1.0 + 0.1 * (t % 3) as f64)).collect();
        let series = [Series { samples, places: [[Vector3::zeros(); 3]; 1300].into() }];
        let stacked = DMatrix::from_fn(1300, 3, |i, j| ((i * (j + 2)) as f64 * 0.37).sin());
        let whole = whiten(&stacked, &series, shape);
        let (full, log_scale) = products(&ColumnSource::stacked(&stacked), &series, &[shape], None).swap_remove(0);
        assert!((whole.columns.transpose() * &whole.columns - full).amax() < 1e-9);
        assert!((whole.log_scale - log_scale).abs() < 1e-9);
    }

    #[test]
    fn products_within_ranges_equal_the_full_products_under_each_shape() {
        let shapes = [0.0, 0.2, 0.4, 0.8, 1.6].map(|drift| Shape { drift, correlation: 0.9, field: None });
        let samples = |from: usize| (0..700).map(|t| (from + t, t, 1.0)).collect();
        let series =
            [0, 700].map(|from| Series { samples: samples(from), places: [[Vector3::zeros(); 3]; 700].into() });
        let stacked = DMatrix::from_fn(1400, 6, |i, j| ((i * (j + 2)) as f64 * 0.37).sin());
        let columns = ColumnSource::stacked(&stacked);
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
