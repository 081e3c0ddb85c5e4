//! The noise of measured rows: white noise and a slow drift, which real robots have.
//!
//! The noise of each axis of each run is `y_t = w_t + e_t`, where e is white with variance σ², and w is a first-order
//! autoregression with stationary variance λσ² and correlation ρ from one row to the next. A Kalman filter whitens the
//! data and the columns in one pass. Rows that are not fitted are missing observations of the filter, so that any block
//! can be left out.
//!
//! The error of an unmodelled effect depends on place, posture or force, and is the same again when the arm returns. A
//! Gaussian field over these coordinates describes it. A field is not noise, and a set that needs one does not explain
//! the rows. Because the field is part of the covariance, its error is attributed neither to a drift nor to the effects
//! that are named with it.

use nalgebra::{DMatrix, DVector, Vector3};
use std::sync::Arc;

/// The covariance of the noise relative to σ². The evidence is maximised over σ for each shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    /// Variance λ of the drift relative to that of the white noise.
    pub(super) drift: f64,
    /// Correlation ρ of the drift from one row to the next.
    pub(super) correlation: f64,
    /// The field that describes the error of unmodelled effects.
    pub(super) field: Option<Field>,
}

/// A Gaussian field with squared-exponential covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Field {
    /// The coordinates that the field depends on.
    pub(super) over: Over,
    /// Its variance relative to that of the white noise.
    pub(super) share: f64,
    /// Its length scale: mm for the place, rad for the posture, N for the force, standard deviations for all together.
    pub(super) reach: f64,
}

/// The coordinates that a field depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Over {
    /// The place in the base frame, mm.
    Place,
    /// The wrist's three motor angles, rad.
    Wrist,
    /// The force on the tool, N.
    Force,
    /// All three together. Each is divided by its standard deviation in the table, so that distances have no unit; a
    /// coordinate whose standard deviation is zero is left out.
    Everything([f64; 3]),
}

/// The choices of a single coordinate.
pub(super) const OVER: [Over; 3] = [Over::Place, Over::Wrist, Over::Force];

/// The coordinates of a row, in the order of [`OVER`].
pub(super) type Places = [Vector3<f64>; OVER.len()];

impl Field {
    /// Squared-exponential correlation of two values of one coordinate.
    fn correlation(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        (-0.5 * (a - b).norm_squared() / (self.reach * self.reach)).exp()
    }

    /// Covariance of the field at the coordinates of two rows, relative to σ².
    fn covariance(&self, a: &Places, b: &Places) -> f64 {
        self.share * self.similarity(a, b)
    }

    /// Correlation of the field at the coordinates of two rows.
    pub(super) fn similarity(&self, a: &Places, b: &Places) -> f64 {
        match self.over {
            Over::Place => self.correlation(&a[0], &b[0]),
            Over::Wrist => self.correlation(&a[1], &b[1]),
            Over::Force => self.correlation(&a[2], &b[2]),
            Over::Everything(spreads) => {
                let apart = |k: usize| (a[k] - b[k]).norm_squared() / (spreads[k] * spreads[k]);
                (-0.5 * (0..spreads.len()).filter(|&k| spreads[k] > 0.0).map(apart).sum::<f64>() / self.reach.powi(2))
                    .exp()
            }
        }
    }

    /// Correlations of the field at all places with one another, as a lower triangle.
    fn correlations(&self, places: &[Places]) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(places.len(), places.len());
        for (j, b) in places.iter().enumerate() {
            for (i, a) in places.iter().enumerate().skip(j) {
                matrix[(i, j)] = self.similarity(a, b);
            }
        }
        matrix
    }
}

/// The fields that are tried, for coordinates with these extents in the units of [`Over`]. Coordinates without an
/// extent have none.
pub(super) fn fields(extents: [f64; OVER.len()]) -> Vec<Field> {
    let mut all = Vec::new();
    for (over, extent) in OVER.into_iter().zip(extents).filter(|(_, extent)| *extent > 0.0) {
        // Rows fill the plane of a part, so that short length scales are determined; there are few postures and forces.
        let parts: &[f64] = if over == Over::Place { &[4.0, 8.0, 16.0, 32.0] } else { &[2.0, 4.0, 8.0] };
        for part in parts {
            all.extend([0.5, 2.0, 8.0].map(|share| Field { over, share, reach: extent / part }));
        }
    }
    all
}

/// The shapes that are tried without a field: white noise first, then drifts with up to three times the variance of the
/// white noise, whose correlation falls to 1/e within 4 to 20 rows.
pub(super) fn shapes() -> Vec<Shape> {
    let mut all = vec![Shape { drift: 0.0, correlation: 0.0, field: None }];
    for drift in [0.06, 0.2, 0.5, 1.2, 3.0] {
        for correlation in [0.8, 0.9, 0.95] {
            all.push(Shape { drift, correlation, field: None });
        }
    }
    all
}

/// White noise, and the drifts with a correlation of 0.9 and a variance below that of the white noise.
#[allow(clippy::float_cmp)] // The numbers are those of the list, unchanged.
pub(super) fn few() -> Vec<Shape> {
    shapes().into_iter().filter(|s| s.drift == 0.0 || s.correlation == 0.9 && s.drift < 1.0).collect()
}

/// White noise, and one drift of the usual size: for poses over the whole robot, whose effects are much larger than the
/// noise.
pub(super) fn coarse() -> Vec<Shape> {
    vec![Shape { drift: 0.0, correlation: 0.0, field: None }, Shape { drift: 0.5, correlation: 0.9, field: None }]
}

/// White noise, the given shape, and the shapes with the same correlation and a similar variance.
#[allow(clippy::float_cmp)] // The numbers are those of the list, unchanged.
pub(super) fn near(shape: Shape) -> Vec<Shape> {
    let close = |s: &Shape| {
        s.drift == 0.0 || *s == shape || s.correlation == shape.correlation && (s.drift / shape.drift).ln().abs() < 1.3
    };
    shapes().into_iter().filter(close).collect()
}

impl Shape {
    /// Covariance of the drift of two rows that are `lag` rows apart, relative to σ².
    pub(super) fn drifting(self, lag: usize) -> f64 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
        let lag = lag as i32;
        if self.drift > 0.0 { self.drift * self.correlation.powi(lag) } else { 0.0 }
    }

    /// Log prior density of the shape except for a constant, nats. The drift of a real arm is usually smaller than its
    /// white noise; a much larger one is an effect that is not modelled.
    pub(super) fn log_prior(self) -> f64 {
        /// Variance of the drift, relative to that of the white noise, up to which the density is constant.
        const USUAL: f64 = 0.5;
        /// Standard deviation of the logarithm of a larger variance.
        const SPREAD: f64 = 0.4;
        if self.drift <= USUAL { 0.0 } else { -0.5 * ((self.drift / USUAL).ln() / SPREAD).powi(2) }
    }
}

/// One scalar: its row in the stacked design, its time index, and its standard deviation relative to σ.
pub(super) type Sample = (usize, usize, f64);

/// The scalars of one axis of a run, in the order in which they were measured.
#[derive(Clone, Debug, Default)]
pub(super) struct Series {
    pub(super) samples: Vec<Sample>,
    /// The coordinates at which each sample was taken.
    pub(super) places: Arc<[Places]>,
}

/// Whitened columns, and half the log determinant of the covariance of the noise at σ = 1.
pub(super) struct Whitened {
    pub(super) columns: DMatrix<f64>,
    pub(super) log_scale: f64,
}

/// Whitens every column of `stacked` along the series. Rows that are in no series are left as they are.
pub(super) fn whiten(stacked: &DMatrix<f64>, series: &[Series], shape: Shape) -> Whitened {
    if let Some(field) = shape.field {
        return whiten_field(stacked, series, shape, field);
    }
    let gains: Vec<Vec<Step>> = series.iter().map(|series| steps(series, shape)).collect();
    let log_scale = gains.iter().flatten().map(|step| 0.5 * step.variance.ln()).sum();
    let mut columns = stacked.clone();
    for mut column in columns.column_iter_mut() {
        for (series, gains) in series.iter().zip(&gains) {
            let mut drift = 0.0;
            for ((row, _, _), step) in series.samples.iter().zip(gains) {
                drift *= step.decay;
                let innovation = column[*row] - drift;
                drift += step.gain * innovation;
                column[*row] = innovation / step.variance.sqrt();
            }
        }
    }
    Whitened { columns, log_scale }
}

/// Largest number of successive samples of a series whose field has a common covariance. The field of two chunks of a
/// long run is taken as independent, because the work of a factor grows as the cube of its size.
const TOGETHER: usize = 300;

/// Whitens every column with the Cholesky factor of the full covariance, chunk by chunk. A chunk whose covariance is
/// not positive definite is left as it is.
fn whiten_field(stacked: &DMatrix<f64>, series: &[Series], shape: Shape, field: Field) -> Whitened {
    let mut columns = stacked.clone();
    let mut log_scale = 0.0;
    let mut factors = Factors::new(shape, field);
    for (samples, places) in chunks(series) {
        let Some(factor) = factors.of(samples, places) else { continue };
        log_scale += factor.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let rows: Vec<usize> = samples.iter().map(|sample| sample.0).collect();
        let mut part = stacked.select_rows(&rows);
        factor.solve_lower_triangular_mut(&mut part);
        for (from, &to) in rows.iter().enumerate() {
            columns.set_row(to, &part.row(from));
        }
    }
    Whitened { columns, log_scale }
}

/// For each of several shapes, whose fields differ only in their variance, the products of the whitened columns and
/// half the log determinant of the covariance of the noise at σ = 1.
pub(super) fn products_under_fields(
    stacked: &DMatrix<f64>,
    series: &[Series],
    shapes: &[(Shape, Field)],
) -> Vec<(DMatrix<f64>, f64)> {
    let width = stacked.ncols();
    let mut all = vec![(DMatrix::zeros(width, width), 0.0); shapes.len()];
    let (mut last, mut factors): (Vec<Spacing>, Vec<Option<DMatrix<f64>>>) = (Vec::new(), Vec::new());
    for (samples, places) in chunks(series) {
        let spacing = spacing(samples, places);
        if last != spacing {
            let correlations = shapes.first().map(|(_, field)| field.correlations(places));
            let factor = |&(shape, field): &(Shape, Field)| {
                factored(covariance(samples, shape, correlations.as_ref()? * field.share))
            };
            (last, factors) = (spacing, shapes.iter().map(factor).collect());
        }
        let rows: Vec<usize> = samples.iter().map(|sample| sample.0).collect();
        let part = stacked.select_rows(&rows);
        for ((full, log_scale), factor) in all.iter_mut().zip(&factors) {
            let Some(factor) = factor else { continue };
            *log_scale += factor.diagonal().iter().map(|d| d.ln()).sum::<f64>();
            let mut part = part.clone();
            solve_below(factor, &mut part);
            full.gemm(1.0, &part.transpose(), &part, 1.0);
        }
    }
    all
}

/// The chunks of all series, each with at most [`TOGETHER`] samples and their places. The same chunk of all series
/// comes before the next chunk, so that the axes of a run, which have the same covariance, follow one another.
fn chunks(series: &[Series]) -> impl Iterator<Item = (&[Sample], &[Places])> {
    let most = series.iter().map(|series| series.samples.len().div_ceil(TOGETHER)).max().unwrap_or(0);
    (0..most).flat_map(move |n| {
        let part = move |length: usize| n * TOGETHER..length.min((n + 1) * TOGETHER);
        let reaches = move |series: &&Series| series.samples.len() > n * TOGETHER;
        let of = move |series: &'_ Series| part(series.samples.len());
        series.iter().filter(reaches).map(move |s| (&s.samples[of(s)], &s.places[of(s)]))
    })
}

/// All of a sample that its covariance depends on: time index, relative standard deviation, and coordinates.
type Spacing = ((usize, f64), Places);

fn spacing(samples: &[Sample], places: &[Places]) -> Vec<Spacing> {
    samples.iter().map(|sample| (sample.1, sample.2)).zip(places.iter().copied()).collect()
}

/// Cholesky factors of the covariance of chunks. The axes of a run share a factor, and so only the last one is kept.
struct Factors {
    shape: Shape,
    field: Field,
    /// The spacing of the last chunk, and its factor.
    last: Option<(Vec<Spacing>, DMatrix<f64>)>,
}

impl Factors {
    fn new(shape: Shape, field: Field) -> Self {
        Self { shape, field, last: None }
    }

    /// The factor of a chunk; `None` if its covariance is not positive definite.
    fn of(&mut self, samples: &[Sample], places: &[Places]) -> Option<&DMatrix<f64>> {
        let spacing = spacing(samples, places);
        if self.last.as_ref().is_none_or(|last| last.0 != spacing) {
            let field = self.field.correlations(places) * self.field.share;
            self.last = Some((spacing, factored(covariance(samples, self.shape, field))?));
        }
        self.last.as_ref().map(|last| &last.1)
    }
}

/// Cholesky factor of a matrix whose lower triangle is given, by blocks of columns: products of matrices are much
/// faster than single columns. `None` if the matrix is not positive definite.
fn factored(mut matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    const COLUMNS: usize = 48;
    let size = matrix.nrows();
    for at in (0..size).step_by(COLUMNS) {
        let wide = COLUMNS.min(size - at);
        let end = at + wide;
        let inner = matrix.view((at, at), (wide, wide)).into_owned().cholesky()?.unpack();
        matrix.view_mut((at, at), (wide, wide)).copy_from(&inner);
        // The rows below the block are solved as the columns of their transpose.
        let mut below = matrix.view((end, at), (size - end, wide)).transpose();
        inner.solve_lower_triangular_mut(&mut below);
        matrix.view_mut((end, at), (size - end, wide)).tr_copy_from(&below);
        let rows = below.transpose();
        for column in (end..size).step_by(COLUMNS) {
            let count = COLUMNS.min(size - column);
            let mut rest = matrix.view_mut((column, column), (size - column, count));
            let (left, right) = (rows.rows(column - end, size - column), below.columns(column - end, count));
            rest.gemm(-1.0, &left, &right, 1.0);
        }
    }
    matrix.fill_upper_triangle(0.0, 1);
    Some(matrix)
}

/// Replaces columns by L⁻¹ times them, by blocks as in [`factored`].
fn solve_below(factor: &DMatrix<f64>, columns: &mut DMatrix<f64>) {
    const ROWS: usize = 48;
    let size = factor.nrows();
    for at in (0..size).step_by(ROWS) {
        let end = (at + ROWS).min(size);
        let mut solved = columns.rows_range(at..end).into_owned();
        factor.view((at, at), (end - at, end - at)).solve_lower_triangular_mut(&mut solved);
        columns.rows_range_mut(at..end).copy_from(&solved);
        let below = factor.view((end, at), (size - end, end - at));
        columns.rows_range_mut(end..).gemm(-1.0, &below, &solved, 1.0);
    }
}

/// Covariance of samples relative to σ², as a lower triangle: white noise and drift are added to the covariance of the
/// field.
fn covariance(samples: &[Sample], shape: Shape, mut field: DMatrix<f64>) -> DMatrix<f64> {
    for (j, &(_, time, relative)) in samples.iter().enumerate() {
        if shape.drift > 0.0 {
            for i in j..samples.len() {
                field[(i, j)] += shape.drifting(samples[i].1.abs_diff(time));
            }
        }
        field[(j, j)] += relative.powi(2);
    }
    field
}

/// Posterior mean of the field given a residual, mm, at the samples of the series; zero at all other scalars.
pub(super) fn field_of(residual: &DVector<f64>, series: &[Series], shape: Shape, field: Field) -> DVector<f64> {
    let mut mean = DVector::zeros(residual.len());
    for (samples, places) in chunks(series) {
        let rows: Vec<usize> = samples.iter().map(|sample| sample.0).collect();
        let correlations = field.correlations(places) * field.share;
        let Some(factor) = covariance(samples, shape, correlations).cholesky() else { continue };
        let weights = factor.solve(&residual.select_rows(&rows));
        for (i, &row) in rows.iter().enumerate() {
            mean[row] = (0..rows.len()).map(|j| field.covariance(&places[i], &places[j]) * weights[j]).sum();
        }
    }
    mean
}

/// One step of the Kalman filter for the drift.
pub(super) struct Step {
    /// Correlation of the drift with that of the sample before.
    pub(super) decay: f64,
    /// Kalman gain.
    pub(super) gain: f64,
    /// Variance of the innovation, relative to σ².
    pub(super) variance: f64,
}

/// The steps of the Kalman filter along a series. They depend on the shape, except for its field, and not on the data.
pub(super) fn steps(series: &Series, shape: Shape) -> Vec<Step> {
    let mut uncertainty = shape.drift;
    let mut last = None;
    series
        .samples
        .iter()
        .map(|&(_, time, relative)| {
            let gap = last.map_or(0, |last: usize| time.saturating_sub(last));
            last = Some(time);
            #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
            let decay = shape.correlation.powi(gap as i32);
            uncertainty = decay * decay * uncertainty + (1.0 - decay * decay) * shape.drift;
            let variance = uncertainty + relative * relative;
            let gain = uncertainty / variance;
            uncertainty *= 1.0 - gain;
            Step { decay, gain, variance }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whitening_is_the_inverse_square_root_of_the_covariance() {
        let shape = Shape { drift: 0.8, correlation: 0.9, field: None };
        let times = [0usize, 1, 2, 5, 6];
        let samples = times.iter().enumerate().map(|(row, &t)| (row, t, 1.0)).collect();
        let series = [Series { samples, places: vec![[Vector3::zeros(); 3]; 5].into() }];
        let covariance = DMatrix::from_fn(5, 5, |i, j| {
            let lag = times[i].abs_diff(times[j]);
            shape.drift * shape.correlation.powi(lag as i32) + f64::from(u8::from(i == j))
        });
        let whitened = whiten(&DMatrix::identity(5, 5), &series, shape);
        let product = &whitened.columns * covariance.clone() * whitened.columns.transpose();
        assert!((product - DMatrix::identity(5, 5)).amax() < 1e-12);
        let half_log_det = 0.5 * covariance.determinant().ln();
        assert!((whitened.log_scale - half_log_det).abs() < 1e-12);
    }

    #[test]
    fn factors_by_blocks_are_those_of_the_whole() {
        // An exponential covariance plus a positive diagonal is positive definite.
        let matrix = DMatrix::from_fn(131, 131, |i, j| {
            let near = (-0.1 * i.abs_diff(j) as f64).exp();
            if i == j { 2.0 + 0.01 * i as f64 } else { near }
        });
        let whole = matrix.clone().cholesky().unwrap().l();
        let factor = factored(matrix.clone()).unwrap();
        assert!((&factor - whole).amax() < 1e-12);
        let mut solved = matrix.columns(3, 5).into_owned();
        solve_below(&factor, &mut solved);
        assert!((&factor * solved - matrix.columns(3, 5)).amax() < 1e-12);
        assert!(factored(-matrix).is_none());
    }

    #[test]
    fn a_field_without_variance_whitens_as_no_field() {
        let shape = Shape { drift: 0.5, correlation: 0.8, field: None };
        let samples = (0..7).map(|t| (t, t, 1.0 + 0.1 * t as f64)).collect();
        let places = (0..7).map(|t| [Vector3::repeat(f64::from(t)); 3]).collect();
        let series = [Series { samples, places }];
        let plain = whiten(&DMatrix::identity(7, 7), &series, shape);
        let none = Shape { field: Some(Field { over: Over::Place, share: 1e-15, reach: 10.0 }), ..shape };
        let field = whiten(&DMatrix::identity(7, 7), &series, none);
        assert!((plain.columns - field.columns).amax() < 1e-9);
        assert!((plain.log_scale - field.log_scale).abs() < 1e-9);
    }
}
