//! Whether the chosen effects are all there is: outliers, a field over the place, and what holds beside them.

use super::data::Observation;
use super::engine::{Engine, Linearised, Posterior};
use super::moments::Moments;
use super::noise;
use super::score::{Columns, posterior, score};
use super::search::{self, Search};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Whitened residuals beyond this are outliers, standard deviations: one in 1.7 million by chance.
const OUTLIER: f64 = 5.0;
/// Standard deviation of normal numbers over the median of their sizes.
const TO_SIGMA: f64 = 1.4826;
/// Held-out rows are scored as they are, but for an instrument's blunders: leaving out what is predicted badly would flatter.
const BLUNDER: f64 = 2.0 * OUTLIER;

impl Engine {
    /// The goodness-of-fit gate: noise with a field over the place that explains more than the chosen set without it.
    pub(super) fn field(&self, search: &Search, linear: &Linearised, set: &[usize]) -> Option<noise::Shape> {
        let (value, set_price) = (search.objective(set), search.prices(set));
        let fields = noise::fields(self.problem.extent_mm());
        let price = search::FIELD + (fields.len() as f64).ln();
        let series = self.problem.series(|row| !row.held_out);
        let columns = search.columns(set);
        let mut stacked = linear.design.kept().select_columns(columns.list.iter().map(|column| &column.0));
        let renumbered = numbered(&columns);
        stacked = stacked.insert_column(columns.list.len(), 0.0);
        stacked.set_column(columns.list.len(), &linear.data);
        let shapes: Vec<noise::Shape> = fields
            .iter()
            .flat_map(|&field| noise::few().into_iter().map(move |shape| noise::Shape { field: Some(field), ..shape }))
            .collect();
        let gains: Vec<f64> = shapes
            .par_iter()
            .map(|&shape| {
                let moments = [Moments::of(&stacked, &series, shape)];
                let alone = score(&moments, &Columns::default(), None).evidence;
                let beside = score(&moments, &renumbered, None).evidence - set_price;
                alone.max(beside) - price - value
            })
            .collect();
        let best = (0..shapes.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]))?;
        (gains[best] > 0.0).then_some(shapes[best])
    }

    /// Whether something is left that no effect explains.
    pub(super) fn is_unexplained(&self) -> bool {
        self.shape.field.is_some()
            || self.shape.wander > noise::MOST_WANDER
            || self.chosen.iter().any(|&c| self.candidates[c].is_pattern())
    }

    /// Beside something unexplained, withdraws effects that do not hold on blocks that their fit has not seen.
    ///
    /// Patterns take part in the fits and not in the predictions: they are not in the cell. An effect stays if it lowers
    /// the error of the blocks by more than one standard error. What is periodic or bent by a joint's angle passes for
    /// anything, and is withdrawn in any case.
    pub(super) fn withdraw(&mut self, linear: &Linearised, posteriors: &mut Vec<Posterior>) {
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let named = |&c: &usize| !self.candidates[c].is_pattern();
        let bent = |&c: &usize| ["gear_harmonic", "joint_error_curve"].contains(&self.candidates[c].kind.as_str());
        let mut set: Vec<usize> = self.chosen.iter().copied().filter(|c| !(named(c) && bent(c))).collect();
        loop {
            let with = self.block_errors(linear, &search.columns(&set));
            let worst = set
                .iter()
                .copied()
                .filter(named)
                .map(|c| {
                    let less: Vec<usize> = set.iter().copied().filter(|&o| o != c).collect();
                    let without = self.block_errors(linear, &search.columns(&less));
                    let gains: Vec<f64> = without.iter().zip(&with).map(|(without, with)| without - with).collect();
                    (c, in_standard_errors(&gains))
                })
                .min_by(|a, b| a.1.total_cmp(&b.1));
            match worst {
                Some((c, gain)) if gain < 1.0 => set.retain(|&o| o != c),
                _ => break,
            }
        }
        posteriors.retain(|(c, _)| set.contains(c));
        self.choose(set);
    }

    /// Sums of squares of each fitted block, predicted by columns that were fitted to the others.
    pub(super) fn block_errors(&self, linear: &Linearised, columns: &Columns) -> Vec<f64> {
        let mut blocks: Vec<(usize, usize)> =
            self.problem.rows.iter().filter(|row| !row.held_out).map(|row| (row.run, row.block)).collect();
        blocks.dedup();
        let mut stacked = linear.design.kept().select_columns(columns.list.iter().map(|column| &column.0));
        stacked = stacked.insert_column(columns.list.len(), 0.0);
        stacked.set_column(columns.list.len(), &linear.data);
        let local = numbered(columns);
        let in_cell: Vec<bool> = columns
            .list
            .iter()
            .map(|&(column, _)| {
                !self
                    .chosen
                    .iter()
                    .any(|&c| self.candidates[c].is_pattern() && self.candidates[c].columns().contains(&column))
            })
            .collect();
        let of_block = |&block: &(usize, usize)| {
            let series = self.problem.series(|row| !row.held_out && (row.run, row.block) != block);
            let moments = Moments::of(&stacked, &series, self.shape);
            let mut left = linear.data.clone();
            if let Some((mean, _)) = posterior(&moments, &local, self.sigma) {
                let numbers = columns.list.iter().enumerate().filter(|(k, _)| in_cell[*k]);
                linear.design.add(numbers.map(|(k, &(column, scale))| (column, -mean[k] * scale)), &mut left);
            }
            let rows = self.problem.rows.iter().filter(|row| !row.outlier && (row.run, row.block) == block);
            rows.map(|row| left.rows(row.offset, row.seen.len()).norm_squared()).sum()
        };
        blocks.par_iter().map(of_block).collect()
    }

    /// Takes everything back that makes the held-out rows worse than the declared cell does; whether it had to.
    ///
    /// Held-out rows choose nothing, but nobody wants a cell that is worse on them: the fitted rows are then not like them.
    pub(super) fn gains_nothing(&mut self, before: &DVector<f64>) -> bool {
        let held_out = |row: &Observation| row.held_out;
        let error_mm = self.errors(&self.residual(), held_out).rms_mm;
        let worse = error_mm > self.errors(before, held_out).rms_mm;
        if worse {
            let any = self.map.take().is_some() || self.chosen.iter().any(|&c| !self.candidates[c].is_pattern());
            self.refused_mm = any.then_some(error_mm);
            for c in std::mem::take(&mut self.chosen) {
                let candidate = &mut self.candidates[c];
                candidate.values.clone_from(&candidate.start);
            }
        }
        worse
    }

    /// Finds anew how much measured turns scatter beside positions; whether that matters to what is fitted.
    pub(super) fn weigh_turns(&mut self) -> bool {
        let residual = self.residual();
        self.problem.weigh_turns(&residual, self.sigma * (1.0 + self.shape.wander).sqrt())
    }

    /// Marks rows whose whitened residual no noise makes; how many are new.
    pub(super) fn mark_outliers(&mut self) -> usize {
        let whitened = self.whitened(&self.residual());
        // Rows that no fit has seen also carry what the fit does not know of them: their own scale says how much.
        let held_out = |row: &&Observation| row.held_out && !row.outlier;
        let seen = self.problem.rows.iter().filter(held_out);
        let mut sizes: Vec<f64> = seen
            .flat_map(|row| whitened.rows(row.offset, row.seen.len()).iter().map(|v| v.abs()).collect::<Vec<_>>())
            .collect();
        sizes.sort_by(f64::total_cmp);
        let unseen = (TO_SIGMA * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)).max(self.sigma);
        let limit = |row: &Observation| if row.held_out { BLUNDER * unseen } else { OUTLIER * self.sigma };
        let far: Vec<usize> = (0..self.problem.rows.len())
            .filter(|&i| {
                let row = &self.problem.rows[i];
                !row.outlier && row.scalars().any(|k| whitened[k].abs() > limit(row))
            })
            .collect();
        // A tenth of the rows are not outliers but an effect.
        if far.len() * 20 > self.problem.rows.len() {
            return 0;
        }
        for &i in &far {
            self.problem.rows[i].outlier = true;
        }
        far.len()
    }

    pub(super) fn whitened(&self, residual: &DVector<f64>) -> DVector<f64> {
        let series = self.problem.series(|_| true);
        let stacked = DMatrix::from_columns(std::slice::from_ref(residual));
        noise::whiten(&stacked, &series, self.shape).columns.column(0).into_owned()
    }
}

/// The same columns as the first ones of a design of their own.
fn numbered(columns: &Columns) -> Columns {
    let list = columns.list.iter().enumerate().map(|(i, column)| (i, column.1)).collect();
    Columns { list, curves: columns.curves.clone() }
}

/// Mean of some gains over its standard error.
pub(super) fn in_standard_errors(gains: &[f64]) -> f64 {
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)).max(1.0);
    mean / variance.sqrt().max(f64::MIN_POSITIVE)
}
