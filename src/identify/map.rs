//! The discrepancy as an effect: what no law describes is corrected where the data hold it, and only there.
//!
//! What the effects leave is taken for a Gaussian process over place, posture and force, whose three axes are alike and independent. A
//! row shows it along the directions that its instrument measures: all three axes, one of them, or the surface normal of a finished
//! part. The mean of the process is written as an `empirical` effect where the evidence is for a process, and where the mean does not
//! raise the error of blocks that its fit has not seen. A cell file cannot have a thousand centres: the mean is the one that few centres
//! spread over the rows can show (subset of regressors; Quiñonero-Candela and Rasmussen 2005, section 4).

use super::data::Observation;
use super::decisions::{CHANCE, MATERIAL, NAMED};
use super::engine::Engine;
use super::found::{LeavingOut, Map, Posterior};
use super::noise::{self, Field, Over, Places, Sample, Series, whiten};
use super::pattern::Standing;
use super::score::in_standard_errors;
use super::seen::Seen;
use super::whole_arm::VARIANCES;
use crate::effects::{Bell, Effect, discrepancy};
use nalgebra::{Cholesky, DMatrix, Dyn, Vector3};
use rayon::prelude::*;
use statrs::function::erf::erf;
use std::collections::BTreeMap;

/// Centres of bells. On the cells of `samples/plant/truer` 50, 100 and 200 leave 0.020, 0.017 and 0.0165 mm; with 200, bells of a
/// twentieth of the area hold together.
const CENTRES: usize = 200;
/// Reaches that are tried, in spreads.
const REACHES: [f64; 6] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0];
/// Share of the largest number of a matrix that is added to its diagonal, so that centres close to one another can be distinguished.
const RIDGE: f64 = 1e-9;

/// What is left of one measured scalar.
struct Scalar {
    run: usize,
    order: usize,
    /// Which scalar of its row it is.
    axis: usize,
    /// What is left out together: of rows that follow one another, and of rows near one another in place, posture and load.
    blocks: [(usize, usize); 2],
    weight: f64,
    places: Places,
    /// Direction that it was measured along, base axes.
    along: Vector3<f64>,
    /// mm.
    error: f64,
}

/// What is left of some rows.
struct Left<'a> {
    scalars: Vec<&'a Scalar>,
    /// Whether each row has three scalars, along the axes of the base. The axes of the process then part into three problems with the
    /// same matrices.
    whole: bool,
}

impl Left<'_> {
    /// Scalars that share a row of the matrices.
    fn together(&self) -> usize {
        if self.whole { 3 } else { 1 }
    }

    /// Columns of each centre.
    fn columns_each(&self) -> usize {
        if self.whole { 1 } else { 3 }
    }
}

/// A process over some of the coordinates, with where its bells stand.
struct Process {
    field: Field,
    spreads: [f64; 3],
    centres: Vec<Places>,
}

impl Engine {
    /// The mean of the discrepancy, if the rows speak for it and it is not worse than nothing on blocks that its fit has not seen.
    pub(super) fn field_map(&self, posteriors: &[Posterior]) -> Option<Map> {
        let (scalars, whole) = self.left()?;
        let all = Left { scalars: scalars.iter().collect(), whole };
        let (process, products) = self.likeliest(&all)?;
        let gain_of = |way: usize, block: &(usize, usize)| {
            let (own, others): (Vec<&Scalar>, Vec<&Scalar>) =
                scalars.iter().partition(|left| left.blocks[way] == *block);
            let heights = self.products(&Left { scalars: others, whole }, &process).heights(process.field.share)?;
            let gain = |left: &&Scalar| {
                let bells = process.centres.iter().zip(&heights);
                let there: Vector3<f64> =
                    bells.map(|(at, height)| height * process.field.similarity(at, &left.places)).sum();
                left.error.powi(2) - (left.error - left.along.dot(&there)).powi(2)
            };
            Some(own.iter().map(gain).sum::<f64>())
        };
        let gains = |way: usize| {
            let mut blocks: Vec<(usize, usize)> = scalars.iter().map(|left| left.blocks[way]).collect();
            blocks.sort_unstable();
            blocks.dedup();
            let gains: Vec<f64> = blocks.par_iter().map(|block| gain_of(way, block)).collect::<Option<_>>()?;
            Some(gains)
        };
        let in_time = gains(0)?;
        let total = |gains: &[f64]| gains.iter().sum::<f64>();
        // Other programs do not pass these places as this one does. Effects hold for them too; a map alone has to, but for that of a
        // part, by which the same part is cut again.
        let alone = posteriors.iter().all(|(_, (share, _))| *share < NAMED);
        if alone && self.problem.read_in_order && total(&gains(1)?) < MATERIAL * total(&in_time) {
            return None;
        }
        let gain = in_standard_errors(&in_time);
        let effect = products.mean(&process)?;
        (gain > -CHANCE).then(|| Map { effect, likely: 0.5 * (1.0 + erf(gain / std::f64::consts::SQRT_2)) })
    }

    /// A map that holds, of the rows that are fitted to now.
    pub(super) fn renewed_map(&self, map: Map) -> Option<Map> {
        let (scalars, whole) = self.left()?;
        let (process, products) = self.likeliest(&Left { scalars: scalars.iter().collect(), whole })?;
        Some(Map { effect: products.mean(&process)?, ..map })
    }

    /// The process of most evidence, with its products: over place, posture and force, or over the place alone; `None` where the rows
    /// speak for none. That there is none is as likely beforehand as all processes that are tried together.
    fn likeliest(&self, left: &Left) -> Option<(Process, Products)> {
        let spreads = self.spreads();
        let tried = [spreads, [spreads[0], 0.0, 0.0]].into_iter().flat_map(|spreads| {
            let field = Field { over: Over::Everything(spreads), share: 1.0, reach: 1.0 };
            let centres = spread_out(left, &field);
            REACHES.map(|reach| Process { field: Field { reach, ..field }, spreads, centres: centres.clone() })
        });
        let of_size = |process: Process| {
            let products = self.products(left, &process);
            let weighed = VARIANCES.into_iter().filter_map(|share| Some((products.evidence(share)?, share)));
            let (evidence, share) = weighed.max_by(|a, b| a.0.total_cmp(&b.0))?;
            Some((evidence, (Process { field: Field { share, ..process.field }, ..process }, products)))
        };
        let tried: Vec<Process> = tried.collect();
        let price = ((tried.len() * VARIANCES.len()) as f64).ln();
        let weighed: Vec<(f64, (Process, Products))> = tried.into_par_iter().filter_map(of_size).collect();
        let (evidence, likeliest) = weighed.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
        (evidence - price > likeliest.1.evidence_of_none()).then_some(likeliest)
    }

    /// What the chosen effects leave of the fitted rows, and whether all of them are whole positions;
    /// `None` where lengths were measured, or the robot itself probed all rows.
    fn left(&self) -> Option<(Vec<Scalar>, bool)> {
        let residual = self.residual() - self.shifted_by(|pattern| pattern.standing() != Standing::Unlisted);
        // Where the robot itself probed, what is left is a difference of two places and postures.
        let fitted = |row: &&Observation| !row.held_out && !row.outlier && row.probing.is_none();
        let rows: Vec<&Observation> = self.problem.rows.iter().filter(fitted).collect();
        if rows.is_empty() {
            return None;
        }
        let whole = rows.iter().all(|row| matches!(row.seen, Seen::Position(_)) && row.seen.count() == row.seen.len());
        let groups = self.groups(LeavingOut::Places);
        let mut scalars = Vec::new();
        for row in rows {
            let run = &self.problem.runs[row.run];
            let turn = run.base_from_wobj(row.point).rotation;
            let shown = |k: usize| row.seen.shows(k).then(|| residual[row.offset + k]);
            let lines: Vec<(usize, Vector3<f64>, f64)> = match row.seen {
                Seen::Distance(_) => return None,
                Seen::Normal(_) => vec![(0, turn * run.points[row.point].normal, residual[row.offset])],
                Seen::Position(_) if whole => {
                    let error = turn * Vector3::from_fn(|k, _| residual[row.offset + k]);
                    (0..3).map(|k| (k, Vector3::ith(k, 1.0), error[k])).collect()
                }
                Seen::Position(_) => (0..3).filter_map(|k| Some((k, turn * Vector3::ith(k, 1.0), shown(k)?))).collect(),
            };
            let of = |(axis, along, error)| Scalar {
                run: row.run,
                order: row.order,
                axis,
                blocks: [self.problem.validation_block(row), (0, groups[&row.offset])],
                weight: row.weight * row.tail,
                places: self.problem.places(row),
                along,
                error,
            };
            scalars.extend(lines.into_iter().map(of));
        }
        Some((scalars, whole))
    }

    /// Products of the bells with one another and with what is left, under the wander and the noise of the fit.
    fn products(&self, left: &Left, Process { field, centres, .. }: &Process) -> Products {
        let (together, each) = (left.together(), left.columns_each());
        let columns = each * centres.len();
        let rows: Vec<&[&Scalar]> = left.scalars.chunks_exact(together).collect();
        let stacked = DMatrix::from_fn(rows.len(), columns + together, |i, j| match j.checked_sub(columns) {
            None if each == 1 => field.similarity(&rows[i][0].places, &centres[j]),
            None => field.similarity(&rows[i][0].places, &centres[j / 3]) * rows[i][0].along[j % 3],
            Some(axis) => rows[i][axis].error,
        });
        let mut series: BTreeMap<(usize, usize), Vec<Sample>> = BTreeMap::new();
        for (i, row) in rows.iter().enumerate() {
            series.entry((row[0].run, row[0].axis)).or_default().push((i, row[0].order, row[0].weight));
        }
        let series: Vec<Series> = series.into_values().map(|samples| Series { samples, places: [].into() }).collect();
        let whitened = whiten(&stacked, &series, noise::Shape { field: None, ..self.shape }).columns;
        let (bells, errors) = (whitened.columns(0, columns), whitened.columns(columns, together));
        let alike = |i: usize, j: usize| field.similarity(&centres[i / each], &centres[j / each]);
        Products {
            gram: bells.tr_mul(&bells),
            cross: bells.tr_mul(&errors),
            square: errors.norm_squared(),
            scalars: left.scalars.len(),
            prior: DMatrix::from_fn(columns, columns, |i, j| if i % each == j % each { alike(i, j) } else { 0.0 }),
        }
    }
}

/// With N the whitened bells at the rows, e what is left there, and K the correlations of the process at its centres.
struct Products {
    /// Nᵀ N.
    gram: DMatrix<f64>,
    /// Nᵀ e: an axis a column where rows are whole positions, else one column.
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
    fn heights(&self, share: f64) -> Option<Vec<Vector3<f64>>> {
        let [_, sum] = self.factors(share)?;
        let heights = sum.solve(&self.cross);
        // A centre's three axes stand side by side, or one below the other.
        let axes = if heights.ncols() == 1 { heights.data.into() } else { heights.transpose().data.into() };
        let axes: Vec<f64> = axes;
        Some(axes.chunks_exact(3).map(Vector3::from_column_slice).collect())
    }

    /// The effect that is the mean of the process.
    fn mean(&self, process: &Process) -> Option<Box<dyn Effect>> {
        let heights = self.heights(process.field.share)?;
        let bell = |(&[at, wrist, force], &shift): (&Places, &Vector3<f64>)| Bell { at, wrist, force, shift };
        let bells: Vec<Bell> = process.centres.iter().zip(&heights).map(bell).collect();
        Some(discrepancy(process.field.reach, process.spreads, &bells))
    }

    /// Log evidence but for a constant, σ at its best, nats.
    fn evidence(&self, share: f64) -> Option<f64> {
        let [prior, sum] = self.factors(share)?;
        let left = self.square - self.cross.dot(&sum.solve(&self.cross));
        let log_det = |factor: &Cholesky<f64, Dyn>| factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let copies = self.cross.ncols() as f64;
        Some(self.evidence_of_left(left) - copies * (log_det(&sum) - log_det(&prior)))
    }

    /// Log evidence of no process, but for the same constant, nats.
    fn evidence_of_none(&self) -> f64 {
        self.evidence_of_left(self.square)
    }

    fn evidence_of_left(&self, square: f64) -> f64 {
        let count = self.scalars as f64;
        -0.5 * count * (square / count).ln()
    }
}

/// Rows as far from one another as can be, the first among them: each next one is the farthest from those before (Gonzalez 1985).
fn spread_out(left: &Left, field: &Field) -> Vec<Places> {
    let rows: Vec<&Places> = left.scalars.chunks_exact(left.together()).map(|row| &row[0].places).collect();
    let mut centres: Vec<Places> = Vec::new();
    let mut alike = vec![0.0; rows.len()];
    let mut next = 0;
    while centres.len() < CENTRES.min(rows.len()) {
        centres.push(*rows[next]);
        for (alike, row) in alike.iter_mut().zip(&rows) {
            *alike = field.similarity(row, &centres[centres.len() - 1]).max(*alike);
        }
        next = (0..rows.len()).min_by(|&a, &b| alike[a].total_cmp(&alike[b])).unwrap_or(0);
        // Several scalars of a row are at one place.
        if alike.get(next).is_none_or(|alike| *alike >= 1.0) {
            break;
        }
    }
    centres
}
