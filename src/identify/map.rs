//! The discrepancy as an effect: what no law describes is corrected where the data hold it, and only there.
//!
//! The whole arm has a Gaussian process over place, posture and force in the covariance of its rows (`whole_arm`). Its mean is written
//! as an `empirical` effect, if it lowers the error of blocks that its fit has not seen. It is the mean that few centres spread over
//! the rows can show (subset of regressors; Quiñonero-Candela and Rasmussen 2005, section 4): a cell file is not made of a thousand.

use super::data::{Observation, Seen};
use super::engine::Engine;
use super::found::Map;
use super::noise::{self, Field, Over, Places, Series, whiten};
use super::pattern::Standing;
use super::score::in_standard_errors;
use super::whole_arm::VARIANCES;
use crate::effects::{Bell, Effect, discrepancy};
use nalgebra::{Cholesky, DMatrix, Dyn, Vector3};
use rayon::prelude::*;
use statrs::function::erf::erf;
use std::collections::BTreeSet;

/// Gain on unseen blocks, in standard errors, below which a map is worse than none there. It need not gain: it corrects the places that
/// were measured, and what is left out may be far from all others.
const WORSE: f64 = -1.0;
/// Centres of bells. On the cells of `samples/plant/truer` 50, 100 and 200 leave 0.020, 0.017 and 0.0165 mm; with 200, bells of a
/// twentieth of the area hold together.
const CENTRES: usize = 200;
/// Reaches that are tried, in spreads.
const REACHES: [f64; 6] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0];
/// Share of the largest number of a matrix that is added to its diagonal, so that centres close to one another can be distinguished.
const RIDGE: f64 = 1e-9;

/// What is left at a row, base axes, mm.
struct Left {
    run: usize,
    order: usize,
    /// What is left out together.
    block: (usize, usize),
    weight: f64,
    places: Places,
    error: Vector3<f64>,
}

/// A process over some of the coordinates, with where its bells stand.
struct Process {
    field: Field,
    spreads: [f64; 3],
    centres: Vec<Places>,
}

impl Engine {
    /// The mean of the discrepancy, unless it is worse than nothing on blocks that its fit has not seen.
    pub(super) fn field_map(&self) -> Option<Map> {
        let left = self.left()?;
        let rows: Vec<&Left> = left.iter().collect();
        let (process, products) = self.likeliest(&rows)?;
        let mut blocks: Vec<(usize, usize)> = left.iter().map(|left| left.block).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let gain = |block: &(usize, usize)| {
            let (own, others): (Vec<&Left>, Vec<&Left>) = left.iter().partition(|left| left.block == *block);
            let heights = self.products(&others, &process).heights(&process)?;
            let gain = |left: &&Left| {
                let bells = process.centres.iter().zip(&heights);
                let there: Vector3<f64> =
                    bells.map(|(at, height)| height * process.field.similarity(at, &left.places)).sum();
                left.error.norm_squared() - (left.error - there).norm_squared()
            };
            Some(own.iter().map(gain).sum::<f64>())
        };
        let gains: Vec<f64> = blocks.par_iter().map(gain).collect::<Option<_>>()?;
        let gain = in_standard_errors(&gains);
        let effect = products.mean(&process)?;
        (gain > WORSE).then(|| Map { effect, likely: 0.5 * (1.0 + erf(gain / std::f64::consts::SQRT_2)) })
    }

    /// A map that holds, of the rows that are fitted to now.
    pub(super) fn renewed_map(&self, map: Map) -> Option<Map> {
        let left = self.left()?;
        let rows: Vec<&Left> = left.iter().collect();
        let (process, products) = self.likeliest(&rows)?;
        Some(Map { effect: products.mean(&process)?, ..map })
    }

    /// The process of most evidence, with its products: over place, posture and force, or over the place alone.
    fn likeliest(&self, rows: &[&Left]) -> Option<(Process, Products)> {
        let Field { over: Over::Everything(spreads), .. } = self.shape.field? else { return None };
        let tried = [spreads, [spreads[0], 0.0, 0.0]].into_iter().flat_map(|spreads| {
            let field = Field { over: Over::Everything(spreads), share: 1.0, reach: 1.0 };
            let centres = spread_out(rows, &field);
            REACHES.map(|reach| Process { field: Field { reach, ..field }, spreads, centres: centres.clone() })
        });
        let of_size = |process: Process| {
            let products = self.products(rows, &process);
            let weighed = VARIANCES.into_iter().filter_map(|share| Some((products.evidence(share)?, share)));
            let (evidence, share) = weighed.max_by(|a, b| a.0.total_cmp(&b.0))?;
            Some((evidence, (Process { field: Field { share, ..process.field }, ..process }, products)))
        };
        let tried: Vec<Process> = tried.collect();
        let weighed: Vec<(f64, (Process, Products))> = tried.into_par_iter().filter_map(of_size).collect();
        weighed.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, likeliest)| likeliest)
    }

    /// What the chosen effects leave of the fitted rows; `None` where rows are no positions.
    fn left(&self) -> Option<Vec<Left>> {
        let residual = self.residual() - self.shifted_by(|pattern| pattern.standing() != Standing::Unlisted);
        let fitted = |row: &&Observation| !row.held_out && !row.outlier;
        let rows: Vec<&Observation> = self.problem.rows.iter().filter(fitted).collect();
        let of = |row: &&Observation| {
            let error = Vector3::from_iterator(residual.rows(row.offset, row.seen.len()).iter().copied());
            let base_from_wobj = self.problem.runs[row.run].base_from_wobj(row.point);
            Left {
                run: row.run,
                order: row.order,
                block: self.problem.validation_block(row),
                weight: row.weight * row.tail,
                places: self.problem.places(row),
                error: base_from_wobj.rotation * error,
            }
        };
        let whole = |row: &&Observation| matches!(row.seen, Seen::Position(_)) && row.seen.count() == row.seen.len();
        rows.iter().all(whole).then(|| rows.iter().map(of).collect())
    }

    /// Products of the bells with one another and with what is left, under the wander and the noise of the fit.
    fn products(&self, rows: &[&Left], Process { field, centres, .. }: &Process) -> Products {
        let count = centres.len();
        let stacked = DMatrix::from_fn(rows.len(), count + 3, |i, j| match j.checked_sub(count) {
            None => field.similarity(&rows[i].places, &centres[j]),
            Some(axis) => rows[i].error[axis],
        });
        let runs: BTreeSet<usize> = rows.iter().map(|left| left.run).collect();
        let of_run = |run: usize| {
            let own = rows.iter().enumerate().filter(|(_, left)| left.run == run);
            Series { samples: own.map(|(i, left)| (i, left.order, left.weight)).collect(), places: [].into() }
        };
        let series: Vec<Series> = runs.into_iter().map(of_run).collect();
        let whitened = whiten(&stacked, &series, noise::Shape { field: None, ..self.shape }).columns;
        let (bells, errors) = (whitened.columns(0, count), whitened.columns(count, 3));
        Products {
            gram: bells.tr_mul(&bells),
            cross: bells.tr_mul(&errors),
            square: errors.norm_squared(),
            scalars: 3 * rows.len(),
            prior: DMatrix::from_fn(count, count, |i, j| field.similarity(&centres[i], &centres[j])),
        }
    }
}

/// With N the whitened bells at the rows, e what is left there, and K the correlations of the process at its centres.
struct Products {
    /// Nᵀ N.
    gram: DMatrix<f64>,
    /// Nᵀ e, an axis a column.
    cross: DMatrix<f64>,
    /// eᵀ e.
    square: f64,
    scalars: usize,
    /// K.
    prior: DMatrix<f64>,
}

impl Products {
    /// Factors of K / share, and of that with Nᵀ N.
    fn factors(&self, share: f64) -> Option<[Cholesky<f64, Dyn>; 2]> {
        let (mut prior, mut sum) = (&self.prior / share, &self.prior / share + &self.gram);
        for matrix in [&mut prior, &mut sum] {
            let ridge = RIDGE * matrix.diagonal().max();
            (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += ridge);
        }
        Some([prior.cholesky()?, sum.cholesky()?])
    }

    /// Heights of the bells, base axes, mm: (K / share + Nᵀ N)⁻¹ Nᵀ e.
    fn heights(&self, process: &Process) -> Option<Vec<Vector3<f64>>> {
        let [_, sum] = self.factors(process.field.share)?;
        let heights = sum.solve(&self.cross);
        Some(heights.row_iter().map(|row| Vector3::new(row[0], row[1], row[2])).collect())
    }

    /// The effect that is the mean of the process.
    fn mean(&self, process: &Process) -> Option<Box<dyn Effect>> {
        let heights = self.heights(process)?;
        let bell = |(&[at, wrist, force], &shift): (&Places, &Vector3<f64>)| Bell { at, wrist, force, shift };
        let bells: Vec<Bell> = process.centres.iter().zip(&heights).map(bell).collect();
        Some(discrepancy(process.field.reach, process.spreads, &bells))
    }

    /// Log evidence but for a constant, σ at its best, nats.
    fn evidence(&self, share: f64) -> Option<f64> {
        let [prior, sum] = self.factors(share)?;
        let left = self.square - self.cross.dot(&sum.solve(&self.cross));
        let log_det = |factor: &Cholesky<f64, Dyn>| factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let count = self.scalars as f64;
        Some(-0.5 * count * (left / count).ln() - 3.0 * (log_det(&sum) - log_det(&prior)))
    }
}

/// Rows as far from one another as can be, the first among them: each next one is the farthest from those before (Gonzalez 1985).
fn spread_out(left: &[&Left], field: &Field) -> Vec<Places> {
    let mut centres: Vec<Places> = Vec::new();
    let mut alike = vec![0.0; left.len()];
    let mut next = 0;
    while centres.len() < CENTRES.min(left.len()) {
        centres.push(left[next].places);
        for (alike, left) in alike.iter_mut().zip(left) {
            *alike = field.similarity(&left.places, &centres[centres.len() - 1]).max(*alike);
        }
        next = (0..left.len()).min_by(|&a, &b| alike[a].total_cmp(&alike[b])).unwrap_or(0);
    }
    centres
}
