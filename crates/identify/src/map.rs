//! Makes an effect of the discrepancy: an error that no law describes is corrected near the rows that determine it, and
//! only there.
//!
//! The residual of the chosen effects is modelled as a Gaussian process over place, posture and force, with three
//! independent axes of the same covariance. A row measures it along the directions of its instrument: all three axes,
//! one of them, or the surface normal of a finished part. The mean of the process is written as an `empirical` effect
//! if the evidence supports a process, and if the mean does not increase the error of blocks that its fit has not seen.
//! A cell file cannot have a thousand centres, so that the mean is a sum of bells at a few centres that are spread over
//! the rows (subset of regressors; Quiñonero-Candela and Rasmussen 2005, section 4).

use super::data::Observation;
use super::decisions::{MATERIAL, NAMED};
use super::engine::Engine;
use super::found::{LeavingOut, Map, Posterior};
use super::noise::{self, Field, Over, Places, Sample, Series, whiten};
use super::pattern::Consequence;
use super::reading::Reading;
use super::statistics::in_standard_errors;
use super::whole_arm::VARIANCES;
use deflex_effects::{Bell, BellSizes, Effect, discrepancy};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};
use rayon::prelude::*;
use statrs::function::erf::erf;
use std::collections::BTreeMap;

/// Largest number of centres. On the cells of `samples/plant/truer`, 50, 100 and 200 centres leave 0.020, 0.017 and
/// 0.0165 mm. With 200 centres bells that cover a twentieth of the area still overlap.
const CENTRES: usize = 200;
/// Length scales that are tried, in standard deviations of the coordinates.
const REACHES: [f64; 6] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0];
/// Share of the largest diagonal element that is added to the diagonal of a matrix, so that it stays positive definite
/// when centres are close to one another.
const RIDGE: f64 = 1e-9;

/// The residual of one measured scalar.
struct Scalar {
    run: usize,
    order: usize,
    /// Index of the scalar in its row.
    axis: usize,
    /// The blocks in which it is left out of a fit: that of successive rows, and that of rows near one another in
    /// place, posture and load.
    blocks: [(usize, usize); 2],
    /// Standard deviation relative to σ.
    weight: f64,
    places: Places,
    /// Direction in which it was measured, base axes.
    along: Vector3<f64>,
    /// Index of the first scalar of its row in stacked vectors.
    offset: usize,
    /// Its weights of the scalars of its row, which may be measured along other axes.
    weights: [f64; 3],
    /// The residual, mm.
    error: f64,
}

impl Scalar {
    /// Its value in a stacked vector over the scalars of all rows.
    fn of(&self, stacked: &DVector<f64>) -> f64 {
        let own = self.weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
        own.map(|(k, weight)| weight * stacked[self.offset + k]).sum()
    }
}

/// The residuals of some rows.
struct Residuals<'a> {
    scalars: Vec<&'a Scalar>,
    /// Whether each row has three scalars, along the axes of the base. The three axes of the process are then three
    /// independent problems with the same matrices.
    whole: bool,
}

impl Residuals<'_> {
    /// Number of scalars that share a row of the matrices.
    fn scalars_each_row(&self) -> usize {
        if self.whole { 3 } else { 1 }
    }

    /// Number of columns of each centre.
    fn columns_each_centre(&self) -> usize {
        if self.whole { 1 } else { 3 }
    }
}

impl Map {
    /// Rotates a factor of the covariance of the chosen numbers, so that its first columns change the map most, and
    /// returns the rows of the heights in the same columns. Later columns, which hardly change the map, are left out
    /// there.
    pub(super) fn rows_of_factor(&self, factor: &mut DMatrix<f64>) -> DMatrix<f64> {
        /// Root mean square of all changes of the map at its centres that are left out together, mm: a tenth of the
        /// noise of a laser tracker, to keep the cell file short.
        const LEFT_OUT_MM: f64 = 1e-3;
        let heights = &self.response * &*factor;
        if factor.is_empty() {
            return heights;
        }
        let axis = |axis: usize| heights.rows_with_step(axis, self.alike.nrows(), 2);
        let square = |at: usize| {
            let shifts = &self.alike * axis(at);
            shifts.tr_mul(&shifts)
        };
        let eigen = (square(0) + square(1) + square(2)).symmetric_eigen();
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let mut budget = LEFT_OUT_MM.powi(2) * heights.nrows() as f64;
        let is_left_out = |k: &&usize| {
            budget -= eigen.eigenvalues[**k].max(0.0);
            budget > 0.0
        };
        let kept = order.len() - order.iter().rev().take_while(is_left_out).count();
        let rotation = eigen.eigenvectors.select_columns(&order);
        *factor *= &rotation;
        heights * rotation.columns(0, kept)
    }
}

/// A process over some of the coordinates, with the centres of its bells.
struct Process {
    field: Field,
    spreads: [f64; 3],
    centres: Vec<Places>,
}

impl Process {
    /// Correlations of the process at its centres.
    fn correlations(&self) -> DMatrix<f64> {
        let count = self.centres.len();
        DMatrix::from_fn(count, count, |i, j| self.field.similarity(&self.centres[i], &self.centres[j]))
    }
}

impl Engine {
    /// The mean of the discrepancy as an effect, if the evidence supports it and it does not increase the error of
    /// blocks that its fit has not seen.
    pub(super) fn field_map(&mut self, posteriors: &[Posterior]) -> Option<Map> {
        let (scalars, whole) = self.residuals()?;
        let all = Residuals { scalars: scalars.iter().collect(), whole };
        let (process, products) = self.best_process(&all)?;
        let gain_of = |way: usize, block: &(usize, usize)| {
            let (own, others): (Vec<&Scalar>, Vec<&Scalar>) =
                scalars.iter().partition(|scalar| scalar.blocks[way] == *block);
            let heights = self
                .products_of_errors(&Residuals { scalars: others, whole }, &process)
                .heights(process.field.share)?;
            let gain = |scalar: &&Scalar| {
                let bells = process.centres.iter().zip(&heights);
                let there: Vector3<f64> =
                    bells.map(|(at, height)| height * process.field.similarity(at, &scalar.places)).sum();
                scalar.error.powi(2) - (scalar.error - scalar.along.dot(&there)).powi(2)
            };
            Some(own.iter().map(gain).sum::<f64>())
        };
        let gains = |way: usize| {
            let mut blocks: Vec<(usize, usize)> = scalars.iter().map(|scalar| scalar.blocks[way]).collect();
            blocks.sort_unstable();
            blocks.dedup();
            let gains: Vec<f64> = blocks.par_iter().map(|block| gain_of(way, block)).collect::<Option<_>>()?;
            Some(gains)
        };
        let in_time = gains(0)?;
        let total = |gains: &[f64]| gains.iter().sum::<f64>();
        // Another program reaches these places in other postures and under other loads. Effects that are named hold for
        // it too. A map without them must also hold for rows that are left out by place, posture and load, except the
        // map of a finished part, which corrects the same part again.
        let alone = posteriors.iter().all(|(_, (share, _))| *share < NAMED);
        if alone && self.problem.read_in_order && total(&gains(1)?) < MATERIAL * total(&in_time) {
            return None;
        }
        let gain = in_standard_errors(&in_time);
        let likely = 0.5 * (1.0 + erf(gain / std::f64::consts::SQRT_2));
        (gain > 0.0).then(|| self.map_of(&all, &process, &products, likely)).flatten()
    }

    /// An accepted map, fitted again to the present rows.
    pub(super) fn renewed_map(&mut self, map: Map) -> Option<Map> {
        let (scalars, whole) = self.residuals()?;
        let all = Residuals { scalars: scalars.iter().collect(), whole };
        let (process, products) = self.best_process(&all)?;
        self.map_of(&all, &process, &products, map.likely)
    }

    fn map_of(&mut self, residuals: &Residuals, process: &Process, products: &Products, likely: f64) -> Option<Map> {
        let effect = products.mean(process, self.sigma)?;
        let response = self.response(residuals, process)?;
        Some(Map { effect, response, alike: process.correlations(), likely })
    }

    /// Change of the heights of the bells, base axes, mm, when a chosen number grows by its typical size: a row for
    /// each axis of each bell, and a column for each number, in the order of the covariance. The process describes what
    /// the numbers leave, so that near the measured rows it makes up for an error of a number.
    fn response(&mut self, residuals: &Residuals, process: &Process) -> Option<DMatrix<f64>> {
        let design = self.linearise(&self.chosen.clone(), &[]).design;
        let in_residual = |&&c: &&usize| self.candidates[c].consequence() != Some(Consequence::Unlisted);
        let columns = self.chosen.iter().flat_map(|c| {
            let numbers = self.candidates[*c].columns();
            numbers.map(move |column| (column, in_residual(&c)))
        });
        let change = |(column, in_residual): (usize, bool)| {
            let mut change = DVector::zeros(self.problem.scalars);
            if in_residual {
                design.add([(column, -1.0)], &mut change);
            }
            residuals.scalars.iter().map(|scalar| scalar.of(&change)).collect::<Vec<f64>>()
        };
        let changes: Vec<Vec<f64>> = columns.map(change).collect();
        let heights = self.products(residuals, process, &changes).heights(process.field.share)?;
        let bells = process.centres.len();
        Some(DMatrix::from_fn(3 * bells, changes.len(), |i, k| heights[k * bells + i / 3][i % 3]))
    }

    /// The process of most evidence, over place, posture and force or over the place alone, with its products; `None`
    /// if the evidence is for no process. No process has the same prior probability as all processes that are tried
    /// together.
    fn best_process(&self, residuals: &Residuals) -> Option<(Process, Products)> {
        let spreads = self.spreads();
        let tried = [spreads, [spreads[0], 0.0, 0.0]].into_iter().flat_map(|spreads| {
            let field = Field { over: Over::Everything(spreads), share: 1.0, reach: 1.0 };
            let centres = spread_centres(residuals, &field);
            REACHES.map(|reach| Process { field: Field { reach, ..field }, spreads, centres: centres.clone() })
        });
        let of_size = |process: Process| {
            let products = self.products_of_errors(residuals, &process);
            let weighed = VARIANCES.into_iter().filter_map(|share| Some((products.evidence(share)?, share)));
            let (evidence, share) = weighed.max_by(|a, b| a.0.total_cmp(&b.0))?;
            Some((evidence, (Process { field: Field { share, ..process.field }, ..process }, products)))
        };
        let tried: Vec<Process> = tried.collect();
        let price = ((tried.len() * VARIANCES.len()) as f64).ln();
        let weighed: Vec<(f64, (Process, Products))> = tried.into_par_iter().filter_map(of_size).collect();
        let (evidence, best) = weighed.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
        (evidence - price > best.1.evidence_of_none()).then_some(best)
    }

    /// The residuals of the fitted rows without the chosen effects, clampings and faults, and whether all rows are
    /// whole positions; `None` if lengths were measured, or if the robot itself probed all rows.
    fn residuals(&self) -> Option<(Vec<Scalar>, bool)> {
        let residual = self.residual() - self.shifted_by(|pattern| pattern.consequence() != Consequence::Unlisted);
        // Rows that the robot itself probed are left out: their residual depends on two places and postures.
        let fitted = |row: &&Observation| !row.held_out && !row.outlier && row.probing.is_none();
        let rows: Vec<&Observation> = self.problem.rows.iter().filter(fitted).collect();
        if rows.is_empty() {
            return None;
        }
        let whole = rows
            .iter()
            .all(|row| matches!(row.reading, Reading::Position(_)) && row.reading.count() == row.reading.len());
        let groups = self.groups(LeavingOut::Places);
        let mut scalars = Vec::new();
        for row in rows {
            let run = &self.problem.runs[row.run];
            let turn = run.base_from_wobj(row.point).rotation;
            let unit = |k: usize| Vector3::ith(k, 1.0);
            let lines: Vec<(usize, Vector3<f64>, Vector3<f64>)> = match row.reading {
                Reading::Distance(_) => return None,
                Reading::Normal(_) => vec![(0, turn * run.points[row.point].normal, unit(0))],
                Reading::Position(_) if whole => (0..3).map(|k| (k, unit(k), turn.inverse() * unit(k))).collect(),
                Reading::Position(_) => {
                    (0..3).filter(|&k| row.reading.has(k)).map(|k| (k, turn * unit(k), unit(k))).collect()
                }
            };
            let of = |(axis, along, weights): (usize, Vector3<f64>, Vector3<f64>)| Scalar {
                run: row.run,
                order: row.order,
                axis,
                blocks: [self.problem.validation_block(row), (0, groups[&row.offset])],
                weight: row.weight * row.tail,
                places: self.problem.places(row),
                along,
                offset: row.offset,
                weights: weights.into(),
                error: 0.0,
            };
            let read = |scalar: Scalar| Scalar { error: scalar.of(&residual), ..scalar };
            scalars.extend(lines.into_iter().map(of).map(read));
        }
        Some((scalars, whole))
    }

    /// Products of the bells with one another and with the residuals.
    fn products_of_errors(&self, residuals: &Residuals, process: &Process) -> Products {
        self.products(residuals, process, &[residuals.scalars.iter().map(|scalar| scalar.error).collect()])
    }

    /// Products of the bells with one another and with some vectors, each of which has a value for every scalar,
    /// whitened by the noise and the drift of the fit.
    fn products(&self, residuals: &Residuals, process: &Process, vectors: &[Vec<f64>]) -> Products {
        let Process { field, centres, .. } = process;
        let (together, each) = (residuals.scalars_each_row(), residuals.columns_each_centre());
        let columns = each * centres.len();
        let rows: Vec<&[&Scalar]> = residuals.scalars.chunks_exact(together).collect();
        let width = columns + together * vectors.len();
        let stacked = DMatrix::from_fn(rows.len(), width, |i, j| match j.checked_sub(columns) {
            None if each == 1 => field.similarity(&rows[i][0].places, &centres[j]),
            None => field.similarity(&rows[i][0].places, &centres[j / 3]) * rows[i][0].along[j % 3],
            Some(other) => vectors[other / together][together * i + other % together],
        });
        let mut series: BTreeMap<(usize, usize), Vec<Sample>> = BTreeMap::new();
        for (i, row) in rows.iter().enumerate() {
            series.entry((row[0].run, row[0].axis)).or_default().push((i, row[0].order, row[0].weight));
        }
        let series: Vec<Series> = series.into_values().map(|samples| Series { samples, places: [].into() }).collect();
        let whitened = whiten(&stacked, &series, noise::Shape { field: None, ..self.shape }).columns;
        let (bells, errors) = (whitened.columns(0, columns), whitened.columns(columns, width - columns));
        let alike = process.correlations();
        Products {
            gram: bells.tr_mul(&bells),
            cross: bells.tr_mul(&errors),
            square: errors.norm_squared(),
            scalars: residuals.scalars.len(),
            together,
            informative: bells.norm_squared() / stacked.columns(0, columns).norm_squared(),
            prior: DMatrix::from_fn(columns, columns, |i, j| {
                if i % each == j % each { alike[(i / each, j / each)] } else { 0.0 }
            }),
        }
    }
}

/// Products of N, the whitened bells at the rows, and of e, the whitened residuals, with K, the correlations of the
/// process at its centres.
struct Products {
    /// Nᵀ N.
    gram: DMatrix<f64>,
    /// Nᵀ e for each vector e: one column for each axis if the rows are whole positions, and one column otherwise.
    cross: DMatrix<f64>,
    /// eᵀ e.
    square: f64,
    scalars: usize,
    /// Number of scalars that share a row of N: see [`Residuals::scalars_each_row`].
    together: usize,
    /// Squares of the whitened bells, relative to those of the bells themselves: how much a row says about the process,
    /// relative to a row with white noise alone.
    informative: f64,
    /// K.
    prior: DMatrix<f64>,
}

impl Products {
    /// Cholesky factors of K / share and of K / share + Nᵀ N; `None` if one of them is not positive definite.
    fn factors(&self, share: f64) -> Option<[Cholesky<f64, Dyn>; 2]> {
        let (mut prior, mut sum) = (&self.prior / share, &self.prior / share + &self.gram);
        for matrix in [&mut prior, &mut sum] {
            let ridge = RIDGE * matrix.diagonal().max();
            (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += ridge);
        }
        Some([prior.cholesky()?, sum.cholesky()?])
    }

    /// Heights of the bells, base axes, mm, for each vector in turn: (K / share + Nᵀ N)⁻¹ Nᵀ e.
    fn heights(&self, share: f64) -> Option<Vec<Vector3<f64>>> {
        let [_, sum] = self.factors(share)?;
        let heights = sum.solve(&self.cross);
        if self.together == 1 {
            // The three axes of a centre are three successive elements of the column of a vector.
            return Some(heights.as_slice().chunks_exact(3).map(Vector3::from_column_slice).collect());
        }
        let bell = |n: usize| {
            let (vector, bell) = (n / heights.nrows(), n % heights.nrows());
            Vector3::from_fn(|axis, _| heights[(bell, 3 * vector + axis)])
        };
        Some((0..heights.len() / 3).map(bell).collect())
    }

    /// The mean of the process as an effect.
    fn mean(&self, process: &Process, sigma_mm: f64) -> Option<Box<dyn Effect>> {
        let heights = self.heights(process.field.share)?;
        let bell = |(&[at, wrist, force], &shift): (&Places, &Vector3<f64>)| Bell { at, wrist, force, shift };
        let bells: Vec<Bell> = process.centres.iter().zip(&heights).map(bell).collect();
        let Field { reach, share, .. } = process.field;
        // Each centre stands for an equal part of the rows, which count less where their noise drifts.
        let rows = self.informative * self.scalars as f64 / 3.0;
        let noise_mm = sigma_mm * (bells.len() as f64 / rows).sqrt();
        let sizes = BellSizes { reach, spreads: process.spreads, sigma_mm: sigma_mm * share.sqrt(), noise_mm };
        Some(discrepancy(sizes, &bells))
    }

    /// Log evidence with the best σ except for a constant, nats.
    fn evidence(&self, share: f64) -> Option<f64> {
        let [prior, sum] = self.factors(share)?;
        let square = self.square - self.cross.dot(&sum.solve(&self.cross));
        let log_det = |factor: &Cholesky<f64, Dyn>| factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let copies = self.cross.ncols() as f64;
        Some(self.evidence_of_square(square) - copies * (log_det(&sum) - log_det(&prior)))
    }

    /// Log evidence of no process except for the same constant, nats.
    fn evidence_of_none(&self) -> f64 {
        self.evidence_of_square(self.square)
    }

    /// Maximum over σ of `−n ln σ − ½ square/σ²`, except for a constant, nats.
    fn evidence_of_square(&self, square: f64) -> f64 {
        let count = self.scalars as f64;
        -0.5 * count * (square / count).ln()
    }
}

/// Centres at rows that are far from one another: the first row, then always the row that is farthest from all centres
/// so far (Gonzalez 1985).
fn spread_centres(residuals: &Residuals, field: &Field) -> Vec<Places> {
    let rows: Vec<&Places> =
        residuals.scalars.chunks_exact(residuals.scalars_each_row()).map(|row| &row[0].places).collect();
    let mut centres: Vec<Places> = Vec::new();
    let mut alike = vec![0.0; rows.len()];
    let mut next = 0;
    while centres.len() < CENTRES.min(rows.len()) {
        centres.push(*rows[next]);
        for (alike, row) in alike.iter_mut().zip(&rows) {
            *alike = field.similarity(row, &centres[centres.len() - 1]).max(*alike);
        }
        next = (0..rows.len()).min_by(|&a, &b| alike[a].total_cmp(&alike[b])).unwrap_or(0);
        // The centres are complete when every row is at the place of a centre; several scalars of a row have one place.
        if alike.get(next).is_none_or(|alike| *alike >= 1.0) {
            break;
        }
    }
    centres
}
