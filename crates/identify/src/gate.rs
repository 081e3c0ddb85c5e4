//! Checks whether the chosen effects explain the rows: it looks for outliers, heavy tails, jumps, unlisted patterns,
//! and a field over place, posture or force. It also withdraws effects that do not hold.

use super::candidate::{Candidate, Home, same_pattern};
use super::candidates;
use super::columns::Columns;
use super::data::Observation;
use super::decisions::{MOST_WANDER, OUTLIER, PRICE, UNLISTED};
use super::engine::{Engine, stacked};
use super::found::{Linearised, Posterior};
use super::moments::Moments;
use super::noise;
use super::pattern::{self, Consequence, Pattern};
use super::score::score;
use super::search::Search;
use super::statistics::{TO_SIGMA, median};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::function::gamma::ln_gamma;

/// Limit of whitened residuals of held-out rows, in their own standard deviations. It is far out, so that only blunders
/// of the instrument are left out: without the rows that are predicted badly, the reported error would be too small.
const BLUNDER: f64 = 2.0 * OUTLIER;

impl Engine {
    /// The test of goodness of fit: the shape of the noise with the best field over place, posture or force, if the
    /// evidence with it exceeds the objective of the set without it by the price of a field.
    pub(super) fn field(&self, search: &Search, linear: &Linearised, set: &[usize]) -> Option<noise::Shape> {
        let (value, set_price) = (search.objective(set), search.prices(set));
        let fields = noise::fields(self.problem.extents());
        let price = UNLISTED + (fields.len() as f64).ln();
        let series = self.problem.series(|row| !row.held_out);
        let columns = search.columns(set);
        let kept = linear.design.kept().select_columns(columns.list.iter().map(|column| &column.0));
        let (stacked, renumbered) = (stacked(&kept, &linear.data), columns.numbered());
        // The field replaces the drift that was found, or is added to it.
        let mut drifts = vec![noise::Shape { drift: 0.0, correlation: 0.0, field: None }];
        if self.shape.drift > 0.0 {
            drifts.push(self.shape);
        }
        let with = |&field: &noise::Field| {
            drifts.iter().map(move |&shape| (noise::Shape { field: Some(field), ..shape }, field)).collect::<Vec<_>>()
        };
        let alike = |a: &noise::Field, b: &noise::Field| a.over == b.over && a.reach.total_cmp(&b.reach).is_eq();
        let groups: Vec<Vec<(noise::Shape, noise::Field)>> =
            fields.chunk_by(alike).map(|fields| fields.iter().flat_map(with).collect()).collect();
        let declared = self.problem.declared_sigma_mm;
        let gains: Vec<f64> = groups
            .par_iter()
            .flat_map_iter(|group| Moments::under_fields(&stacked, &series, group))
            .map(|moments| {
                let moments = [Moments { declared, ..moments }];
                let alone = score(&moments, &Columns::default(), None).evidence;
                let with_set = score(&moments, &renumbered, None).evidence - set_price;
                alone.max(with_set) - price - value
            })
            .collect();
        let shapes: Vec<noise::Shape> = groups.into_iter().flatten().map(|(shape, _)| shape).collect();
        let best = (0..shapes.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]))?;
        (gains[best] > 0.0).then_some(shapes[best])
    }

    /// Adds a pattern to the candidates: of those that describe an unlisted effect the one that gains most, in addition
    /// to the chosen set, in place of one of its members, or in place of all. Returns whether one gains.
    pub(super) fn add_unlisted(&mut self) -> bool {
        let survey = candidates::survey(&self.declared, &self.problem);
        let known = |new: &Candidate| self.candidates.iter().any(|c| same_pattern(c, new));
        let new: Vec<Candidate> =
            candidates::unlisted(&survey, &self.problem).into_iter().filter(|new| !known(new)).collect();
        let first = self.candidates.len();
        self.candidates.extend(new);
        let set = self.chosen.clone();
        let wanted: Vec<usize> = set.iter().copied().chain(first..self.candidates.len()).collect();
        let mut shapes = vec![noise::Shape { drift: 0.0, correlation: 0.0, field: None }];
        if self.shape.drift > 0.0 {
            shapes.push(self.shape);
        }
        let linear = self.linearise(&wanted, &shapes);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let own = search.objective(&set);
        let mut best: Option<(f64, usize)> = None;
        let without = |out: &usize| set.iter().copied().filter(|o| o != out).collect::<Vec<_>>();
        for others in set.iter().map(without).chain([vec![], set.clone()]) {
            for c in first..self.candidates.len() {
                let value = search.objective(&[&others[..], &[c]].concat());
                if value > own && best.is_none_or(|(most, _)| value > most) {
                    best = Some((value, c));
                }
            }
        }
        let kept = best.map(|(_, c)| self.candidates[c].clone());
        self.candidates.truncate(first);
        self.candidates.extend(kept.clone());
        kept.is_some()
    }

    /// Adds candidates for a jump at the row of each run where the residual, without the chosen jumps, jumps most.
    /// Returns whether there is a new candidate.
    pub(super) fn add_jumps(&mut self) -> bool {
        let is_jump = |pattern: Pattern| matches!(pattern, Pattern::Jump { .. });
        let left = self.residual() - self.shifted_by(|pattern| !is_jump(pattern));
        let mut found = Vec::new();
        for run in 0..self.problem.runs.len() {
            found.extend(
                self.jumps_of(run, &left).into_iter().flat_map(|order| candidates::jumps(&self.problem, run, order)),
            );
        }
        found.retain(|new| !self.candidates.iter().any(|c| same_pattern(c, new)));
        let any = !found.is_empty();
        self.candidates.extend(found);
        any
    }

    /// The order of the row at which the residual of one run jumps most, if a step of its mean there is significant.
    fn jumps_of(&self, run: usize, left: &DVector<f64>) -> Option<usize> {
        let noise::Shape { drift, correlation, .. } = self.shape;
        // The mean of rows with a drift scatters more than that of as many independent rows.
        let inflated = if drift > 0.0 { drift * (1.0 + correlation) / (1.0 - correlation) } else { 0.0 };
        let variance = self.sigma * self.sigma * (1.0 + inflated);
        let fitted = |row: &&Observation| row.run == run && !row.held_out && !row.outlier;
        let rows: Vec<&Observation> = self.problem.rows.iter().filter(fitted).collect();
        let axes = rows.iter().map(|row| row.reading.len()).max()?;
        // For each axis the sums of the weights and of the weighted residuals of all rows before each row.
        let mut sums = vec![[[0.0; 2]; 3]];
        for row in &rows {
            let mut next = *sums.last()?;
            for (k, sum) in next.iter_mut().enumerate().take(row.reading.len()).filter(|(k, _)| row.reading.has(*k)) {
                let weight = (row.weight * row.tail).powi(-2);
                sum[0] += weight;
                sum[1] += weight * left[row.offset + k];
            }
            sums.push(next);
        }
        let all = *sums.last()?;
        let gain = |at: usize| -> f64 {
            (0..axes)
                .map(|k| {
                    let ([w, s], [total, sum]) = (sums[at][k], all[k]);
                    let rest = total - w;
                    if w <= 0.0 || rest <= 0.0 {
                        return 0.0;
                    }
                    0.5 * (s / w - (sum - s) / rest).powi(2) * w * rest / total / variance
                })
                .sum()
        };
        /// Smallest number of rows before and after a jump.
        const FEWEST_ROWS: usize = 4;
        let best = (FEWEST_ROWS..rows.len().saturating_sub(FEWEST_ROWS))
            .map(|at| (gain(at), at))
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        (best.0 > PRICE + (rows.len() as f64).ln()).then(|| rows[best.1].order)
    }

    /// The part of the residual, mm, that the chosen patterns which `keep` accepts describe, without those of the
    /// force.
    pub(super) fn shifted_by(&self, keep: impl Fn(Pattern) -> bool) -> DVector<f64> {
        let mut sum = DVector::zeros(self.problem.scalars);
        for &c in &self.chosen {
            let candidate = &self.candidates[c];
            let Home::Pattern(pattern) = candidate.home else { continue };
            if pattern.is_of_force() || !keep(pattern) {
                continue;
            }
            for (column, number) in pattern::shifts(&self.problem, pattern).iter().zip(candidate.pattern_numbers()) {
                sum.axpy(number.1, column, 1.0);
            }
        }
        sum
    }

    /// The residual of the extended cell without the fitted clampings of the runs, mm.
    pub(super) fn left_by_cell(&self) -> DVector<f64> {
        self.residual() - self.shifted_by(|pattern| pattern.consequence() == Consequence::Nuisance)
    }

    /// The residual of the declared cell without the clampings that were fitted with the extended cell, mm, so that
    /// neither error contains the position of the clamped parts.
    pub(super) fn left_by_declared_as_found(&self, before: &DVector<f64>) -> DVector<f64> {
        before - self.shifted_by(|pattern| pattern.consequence() == Consequence::Nuisance)
    }

    /// Widens the rows with large residuals if Student's t describes the residuals better than the normal distribution,
    /// by the weights of its fit (Lange, Little and Taylor 1989). Returns whether the widths of more than one percent
    /// of the rows change clearly.
    pub(super) fn widen_tails(&mut self) -> bool {
        /// Degrees of freedom that are tried. Above the last one the distribution is almost normal.
        const FREEDOMS: [f64; 4] = [2.0, 3.0, 5.0, 10.0];
        /// Share of the rows whose width must change for another round.
        const MUCH: f64 = 0.01;
        let before: Vec<f64> = self.problem.rows.iter().map(|row| row.tail).collect();
        self.problem.rows.iter_mut().for_each(|row| row.tail = 1.0);
        let left = self.residual() - self.shifted_by(|_| true);
        let whitened = self.whitened(&left);
        let sizes: Vec<(f64, f64)> = self
            .problem
            .rows
            .iter()
            .map(|row| (whitened.rows(row.offset, row.reading.len()).norm_squared(), row.reading.count() as f64))
            .collect();
        let fitted: Vec<(f64, f64)> = self
            .problem
            .rows
            .iter()
            .zip(&sizes)
            .filter(|(row, _)| !row.held_out && !row.outlier)
            .map(|(_, s)| *s)
            .collect();
        let normal = student(&fitted, f64::INFINITY);
        let best = FREEDOMS.iter().map(|&freedom| (freedom, student(&fitted, freedom)));
        let best = best.max_by(|a, b| a.1.1.total_cmp(&b.1.1));
        if let Some((freedom, (scale, _))) = best.filter(|best| best.1.1 > normal.1 + PRICE) {
            for (row, (square, _)) in self.problem.rows.iter_mut().zip(&sizes) {
                row.tail = (1.0 + square / (freedom * scale)).sqrt();
            }
        }
        let changed =
            self.problem.rows.iter().zip(&before).filter(|(row, before)| (row.tail / **before).ln().abs() > 0.2);
        changed.count() as f64 > MUCH * before.len() as f64
    }

    /// Whether an error remains that neither a listed effect nor a fault of the measurement explains.
    pub(super) fn is_unlisted(&self) -> bool {
        // In the model of the whole arm the discrepancy describes all unlisted effects.
        !self.is_whole_arm()
            && (self.shape.field.is_some()
                || self.shape.drift > MOST_WANDER
                || self.has_chosen(Consequence::Unlisted)
                || self.scatters_more())
    }

    /// Whether a chosen pattern has this consequence.
    fn has_chosen(&self, consequence: Consequence) -> bool {
        self.chosen.iter().any(|&c| self.candidates[c].consequence() == Some(consequence))
    }

    /// Whether the variance of the noise with the drift exceeds the variance that the table declares by more than the
    /// drift of an arm can.
    pub(super) fn scatters_more(&self) -> bool {
        let variance = self.sigma * self.sigma * (1.0 + self.shape.drift);
        self.problem.declared_sigma_mm.is_some_and(|declared| variance > (1.0 + MOST_WANDER) * declared * declared)
    }

    /// Whether a fault of the forces is chosen: the forces of the table are not those that acted.
    pub(super) fn forces_are_wrong(&self) -> bool {
        self.chosen.iter().any(|&c| self.is_of_force(c))
    }

    /// Whether a candidate is a fault of the forces.
    pub(super) fn is_of_force(&self, candidate: usize) -> bool {
        matches!(self.candidates[candidate].home, Home::Pattern(pattern) if pattern.is_of_force())
    }

    /// Withdraws the members for which `holds` is false, given their probability and those of their rivals.
    pub(super) fn withdraw_unless(
        &mut self,
        posteriors: &mut Vec<Posterior>,
        holds: impl Fn(usize, f64, &[(String, f64)]) -> bool,
    ) {
        let before = posteriors.len();
        posteriors.retain(|(c, (share, rivals))| holds(*c, *share, rivals));
        if posteriors.len() < before {
            let named = |c: &usize| posteriors.iter().any(|(p, _)| p == c);
            self.choose(self.chosen.iter().copied().filter(|c| self.candidates[*c].is_pattern() || named(c)).collect());
        }
    }

    /// Removes every effect, the map included, and keeps the patterns.
    pub(super) fn remove_all_effects(&mut self) {
        self.map = None;
        self.choose(self.patterns());
    }

    /// Estimates again how much measured orientations scatter compared with positions. Returns whether the change is
    /// large enough to matter for the fit.
    pub(super) fn weigh_turns(&mut self) -> bool {
        let residual = self.residual();
        self.problem.weigh_turns(&residual, self.sigma * (1.0 + self.shape.drift).sqrt())
    }

    /// Marks as outliers the rows whose whitened residual is too large for noise, and returns how many are new. It
    /// marks none if so many rows would be left out that they are rather an effect.
    pub(super) fn mark_outliers(&mut self) -> usize {
        // The widths of heavy tails are undone: each row is judged by the noise of the others.
        let mut whitened = self.whitened(&(self.residual() - self.shifted_by(|_| true)));
        for row in &self.problem.rows {
            row.scalars().for_each(|k| whitened[k] *= row.tail);
        }
        // The residuals of held-out rows also contain the uncertainty of the prediction, so that their own median sets
        // their scale.
        let held_out = |row: &&Observation| row.held_out && !row.outlier;
        let seen = self.problem.rows.iter().filter(held_out);
        let sizes = seen
            .flat_map(|row| {
                (0..row.reading.len()).filter(|&k| row.reading.has(k)).map(|k| whitened[row.offset + k].abs())
            })
            .collect();
        let unseen = (TO_SIGMA * median(sizes)).max(self.sigma);
        let limit = |row: &Observation| if row.held_out { BLUNDER * unseen } else { OUTLIER * self.sigma };
        let far: Vec<usize> = (0..self.problem.rows.len())
            .filter(|&i| {
                let row = &self.problem.rows[i];
                !row.outlier && row.scalars().any(|k| whitened[k].abs() > limit(row))
            })
            .collect();
        // A row is alone if the row before it or the row after it is good. Many successive bad rows are an effect and
        // not outliers.
        let alone = |i: usize| {
            let run = self.problem.rows[i].run;
            let bad =
                |o: usize| self.problem.rows.get(o).is_some_and(|row| row.run == run) && far.binary_search(&o).is_ok();
            !(i.checked_sub(1).is_some_and(bad) && bad(i + 1))
        };
        /// Shares of the rows up to which they may be left out: in any case, and if most of them are alone.
        const FEW: [f64; 2] = [0.05, 0.25];
        /// Share of the rows to be left out that must be alone.
        const ALONE: f64 = 0.7;
        let left_out = self.problem.rows.iter().filter(|row| row.outlier).count() + far.len();
        let share = left_out as f64 / self.problem.rows.len().max(1) as f64;
        let lonely = far.iter().filter(|&&i| alone(i)).count() as f64;
        if share > FEW[0] && (share > FEW[1] || lonely < ALONE * far.len() as f64) {
            return 0;
        }
        for &i in &far {
            self.problem.rows[i].outlier = true;
        }
        far.len()
    }

    /// A residual whitened along all rows, held-out ones included, mm. Scalars that were not measured and outliers are
    /// left as they are.
    pub(super) fn whitened(&self, residual: &DVector<f64>) -> DVector<f64> {
        let series = self.problem.series(|_| true);
        let stacked = DMatrix::from_columns(std::slice::from_ref(residual));
        noise::whiten(&stacked, &series, self.shape).columns.column(0).into_owned()
    }
}

/// Squared scale and log likelihood of rows, each a squared norm and a number of components, under Student's t with
/// `freedom` degrees of freedom; the normal distribution if `freedom` is infinite.
fn student(rows: &[(f64, f64)], freedom: f64) -> (f64, f64) {
    /// Number of iterations after which the scale changes by less than a thousandth.
    const STEPS: usize = 30;
    let count: f64 = rows.iter().map(|row| row.1).sum();
    let mut scale = rows.iter().map(|row| row.0).sum::<f64>() / count.max(1.0);
    let log_scale = |scale: f64| 0.5 * count * scale.max(f64::MIN_POSITIVE).ln();
    if freedom.is_infinite() {
        // At the best scale Σ r²/s² is the count. The term with 2π is part of the normal density.
        return (scale, -log_scale(scale) - 0.5 * count * (1.0 + std::f64::consts::TAU.ln()));
    }
    for _ in 0..STEPS {
        let weighted = rows.iter().map(|(square, size)| square * (freedom + size) / (freedom + square / scale));
        scale = (weighted.sum::<f64>() / count.max(1.0)).max(f64::MIN_POSITIVE);
    }
    let of_row = |(square, size): &(f64, f64)| {
        ln_gamma(0.5 * (freedom + size))
            - ln_gamma(0.5 * freedom)
            - 0.5 * size * (freedom * std::f64::consts::PI).ln()
            - 0.5 * (freedom + size) * (square / (freedom * scale)).ln_1p()
    };
    (scale, rows.iter().map(of_row).sum::<f64>() - log_scale(scale))
}
