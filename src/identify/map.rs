//! The discrepancy as an effect: what no law describes is corrected where the data hold it, and only there.
//!
//! The whole arm has a Gaussian process over place, posture and force in the covariance of its rows (`whole_arm`). Its mean is written
//! as an `empirical` effect, if it lowers the error of blocks that its fit has not seen. It is the mean that few centres spread over
//! the rows can show (subset of regressors; Quiñonero-Candela and Rasmussen 2005, section 4): a cell file is not made of a thousand.

use super::data::{Observation, Seen};
use super::engine::Engine;
use super::found::Map;
use super::noise::{self, Field, OVER, Over, Places, Series, whiten};
use super::pattern::Standing;
use super::score::in_standard_errors;
use crate::effects::{Bell, Effect, discrepancy};
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use statrs::function::erf::erf;
use std::collections::BTreeSet;

/// Gain on unseen blocks, in standard errors, below which a map is worse than none there. It need not gain: it corrects the places that
/// were measured, and what is left out may be far from all others.
const WORSE: f64 = -1.0;
/// Centres of bells. On the cells of `samples/plant/truer` 50, 100 and 200 leave 0.020, 0.017 and 0.0165 mm.
const CENTRES: usize = 100;
/// Share of the largest number of a matrix that is added to its diagonal, so that centres close to one another can be told apart.
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

impl Engine {
    /// The mean of the discrepancy, unless it is worse than nothing on blocks that its fit has not seen.
    pub(super) fn field_map(&self) -> Option<Map> {
        let (field, spreads) = self.discrepancy()?;
        let left = self.left()?;
        let centres = spread_out(&left, &field);
        let mut blocks: Vec<(usize, usize)> = left.iter().map(|left| left.block).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let gain = |block: &(usize, usize)| {
            let (own, others): (Vec<&Left>, Vec<&Left>) = left.iter().partition(|left| left.block == *block);
            let heights = self.heights(&others, &centres, &field)?;
            let gain = |left: &&Left| {
                let bells = centres.iter().zip(&heights);
                let there: Vector3<f64> = bells.map(|(at, height)| height * field.similarity(at, &left.places)).sum();
                left.error.norm_squared() - (left.error - there).norm_squared()
            };
            Some(own.iter().map(gain).sum::<f64>())
        };
        let gains: Vec<f64> = blocks.par_iter().map(gain).collect::<Option<_>>()?;
        let gain = in_standard_errors(&gains);
        let rows: Vec<&Left> = left.iter().collect();
        let heights = self.heights(&rows, &centres, &field)?;
        (gain > WORSE).then(|| Map {
            effect: effect(&field, spreads, &centres, &heights),
            likely: 0.5 * (1.0 + erf(gain / std::f64::consts::SQRT_2)),
        })
    }

    /// A map that holds, of the rows that are fitted to now.
    pub(super) fn renewed_map(&self, map: Map) -> Option<Map> {
        let (field, spreads) = self.discrepancy()?;
        let left = self.left()?;
        let centres = spread_out(&left, &field);
        let heights = self.heights(&left.iter().collect::<Vec<_>>(), &centres, &field)?;
        Some(Map { effect: effect(&field, spreads, &centres, &heights), ..map })
    }

    /// The process of the whole arm, with the spreads of its coordinates.
    fn discrepancy(&self) -> Option<(Field, [f64; OVER.len()])> {
        let field = self.shape.field?;
        match field.over {
            Over::Everything(spreads) => Some((field, spreads)),
            Over::Place | Over::Wrist | Over::Force => None,
        }
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

    /// Heights of the bells at the centres, base axes, mm: with K the process at the centres, N the bells at the rows, and S the
    /// covariance of wander and noise, (K + Nᵀ S⁻¹ N)⁻¹ Nᵀ S⁻¹ times what is left.
    fn heights(&self, rows: &[&Left], centres: &[Places], field: &Field) -> Option<Vec<Vector3<f64>>> {
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
        let mut normal = bells.tr_mul(&bells);
        for (i, a) in centres.iter().enumerate() {
            for (j, b) in centres.iter().enumerate() {
                normal[(i, j)] += field.similarity(a, b) / field.share;
            }
        }
        let ridge = RIDGE * normal.diagonal().max();
        (0..count).for_each(|i| normal[(i, i)] += ridge);
        let heights = normal.cholesky()?.solve(&bells.tr_mul(&errors));
        Some(heights.row_iter().map(|row| Vector3::new(row[0], row[1], row[2])).collect())
    }
}

/// The effect whose bells have these heights.
fn effect(field: &Field, spreads: [f64; 3], centres: &[Places], heights: &[Vector3<f64>]) -> Box<dyn Effect> {
    let bell = |(&[at, wrist, force], &shift): (&Places, &Vector3<f64>)| Bell { at, wrist, force, shift };
    discrepancy(field.reach, spreads, &centres.iter().zip(heights).map(bell).collect::<Vec<_>>())
}

/// Rows as far from one another as can be, the first among them: each next one is the farthest from those before (Gonzalez 1985).
fn spread_out(left: &[Left], field: &Field) -> Vec<Places> {
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
