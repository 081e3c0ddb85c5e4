//! Makes the answer from the chosen effects: errors, intervals, rivals, unexplained errors, and advice.

use super::advice::{advice, faint_effects, slipped_or_soft, worse_on_held_out};
use super::cancelled;
use super::candidate::{Candidate, Home};
use super::contributions::{Contribution, Uncertain};
use super::controller;
use super::data::{Extent, Observation};
use super::decisions::{MOST_WANDER, NAMED};
use super::engine::Engine;
use super::found::{Elsewhere, Findings, Linearised, MAP, Ranking, Refused};
use super::noise;
use super::outcome::{
    Added, Advice, Correlate, Coverage, Errors, FittedParameter, Identification, Ranked, ResidualRow, Unexplained,
};
use super::pattern::{Consequence, Pattern, TYPICAL_MM};
use super::returns::never_returns;
use super::score::posterior;
use super::search::Search;
use super::separability::{self, Trace};
use super::ties;
use deflex_cell::NewEffect;
use deflex_effects::{ParameterOwner, Shape};
use nalgebra::DVector;

impl Engine {
    /// Every kind of effect alone with its best variant, the best kind first, and how well pairs of kinds can be
    /// distinguished.
    pub(super) fn ranking(&self, search: &Search, linear: &Linearised) -> Ranking {
        let none = search.objective(&[]);
        let mut best: Vec<(String, f64, usize)> = Vec::new();
        for (c, candidate) in self.candidates.iter().enumerate().filter(|(_, c)| !c.is_pattern()) {
            let gain = search.objective(&[c]) - none;
            match best.iter_mut().find(|(kind, ..)| *kind == candidate.kind) {
                Some(known) if known.1 < gain => (known.1, known.2) = (gain, c),
                Some(_) => {}
                None => best.push((candidate.kind.clone(), gain, c)),
            }
        }
        best.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut ranking = Ranking::default();
        let mut traces = Vec::new();
        let frames = linear.always.len();
        for (kind, gain, c) in best {
            let score = search.full(&[c]);
            let columns = search.columns(&[c]);
            let mut left = linear.data.clone();
            let mut own = DVector::zeros(linear.data.len());
            let mut numbers = DVector::zeros(self.candidates[c].values.len());
            if let Some((mean, _)) = posterior(&linear.moments[score.shape], &columns, score.sigma) {
                let numbered =
                    || columns.list.iter().zip(mean.iter()).map(|(column, value)| (column.0, value * column.1));
                linear.design.add(numbered().map(|(column, number)| (column, -number)), &mut left);
                linear.design.add(numbered().skip(frames), &mut own);
                numbers.iter_mut().zip(numbered().skip(frames)).for_each(|(number, (_, value))| *number = value);
            }
            let rms_mm = self.errors(&own, |row| !row.held_out).rms_mm;
            traces.push((Trace { candidate: &self.candidates[c], numbers }, rms_mm));
            let held_out_rms_mm = self.errors(&left, |row| row.held_out).rms_mm;
            ranking.kinds.push(Ranked { kind, held_out_rms_mm, delta_bic: -2.0 * gain });
        }
        let score = search.full(&[]);
        let frame = self.candidates.iter().find(|c| c.law().is_some_and(|law| law.like_device_frame));
        let nuisance: Vec<usize> =
            linear.always.iter().copied().chain(frame.into_iter().flat_map(Candidate::columns)).collect();
        // The noise is estimated with the best kind, because the residual of the declared cell contains the effect.
        let sigma = traces.first().map_or(score.sigma, |(trace, _)| {
            let c = self.candidates.iter().position(|c| std::ptr::eq(c, trace.candidate)).unwrap_or(0);
            search.full(&[c]).sigma
        });
        ranking.separability = separability::pairs(&traces, &nuisance, &linear.moments[0], sigma);
        ranking
    }

    /// Errors over the rows that `keep` accepts, without outliers and without rows that have no equilibrium.
    pub(super) fn errors(&self, residual: &DVector<f64>, keep: impl Fn(&Observation) -> bool) -> Errors {
        let norms: Vec<f64> = self
            .problem
            .rows
            .iter()
            .filter(|row| !row.outlier && keep(row))
            .map(|row| residual.rows(row.offset, row.reading.len()).norm())
            // Without one of its effects the arm may have no equilibrium at some rows.
            .filter(|norm| norm.is_finite())
            .collect();
        errors_of(&norms)
    }

    /// The answer. `before` and `after` are the residuals of the declared and of the extended cell, mm; `after` is
    /// without the clampings. `doubt` is a sentence about a possible fault of the table.
    pub(super) fn outcome(
        &mut self,
        before: &DVector<f64>,
        after: &DVector<f64>,
        findings: Findings,
        doubt: Option<Advice>,
        data_hash: &str,
    ) -> Identification {
        let Findings { mut posteriors, ranking, unexplained, stages, elsewhere, refused } = findings;
        let held_out = |row: &Observation| row.held_out;
        let left_before = self.left_by_declared_as_found(before);
        // The drift of the run is in no cell, and so it is subtracted from both errors.
        let run_drift = self.run_drift(after);
        let left_after = after - &run_drift;
        let errors_before = self.errors(&(left_before - &run_drift), held_out);
        let errors_after = self.errors(&left_after, held_out);
        let mut provenance = toml::Table::new();
        let rows = i64::try_from(self.problem.rows.len()).unwrap_or(i64::MAX);
        provenance.insert("by".into(), concat!("deflex ", env!("CARGO_PKG_VERSION"), " identify").into());
        provenance.insert("data".into(), data_hash.into());
        provenance.insert("rows".into(), rows.into());
        provenance.insert("held_out_rms_before_mm".into(), errors_before.rms_mm.into());
        provenance.insert("held_out_rms_after_mm".into(), errors_after.rms_mm.into());
        let elsewhere = elsewhere.unwrap_or(Elsewhere { extended: errors_after, wider: 1.0 });
        let unlisted = self.is_unlisted();
        let explained = self.explained(&posteriors, &stages, after, errors_after.rms_mm);
        let residuals = self.residual_rows(before, after);
        let after_rms_ci95_mm = self.bootstrap(&left_after);
        let run_drift_rms_mm = Some(self.errors(&run_drift, held_out).rms_mm).filter(|rms_mm| *rms_mm > 0.0);
        let coverage = self.coverage();
        let noise_mm = self.sigma * self.tail_factor();
        let wander_mm = self.wander_mm();
        let shown: usize = self.problem.rows.iter().map(|row| row.reading.count()).sum();
        let axes = shown as f64 / self.problem.rows.len().max(1) as f64;
        let orientation_noise_deg = self.orientation_noise_deg();
        let outliers = self.problem.rows.iter().filter(|row| row.outlier).map(|row| row.line).collect();
        let held_out_rows = self.problem.rows.iter().filter(|row| row.held_out).count();
        self.take_all_rows(&mut posteriors);
        let noise_floor_rms_mm = (axes * (noise_mm * noise_mm + wander_mm * wander_mm)).sqrt();
        // The model does not know the error that it leaves on rows of other places, postures and loads.
        let left_mm = ((elsewhere.extended.rms_mm.powi(2) - noise_floor_rms_mm.powi(2)).max(0.0) / axes).sqrt();
        let transfer_sigma_mm = match self.problem.extent {
            // The held-out rows are spread over the whole robot, so that they represent another program.
            Extent::Robot => left_mm,
            Extent::Part => self.transfer_sigma_mm(elsewhere.wider).hypot(left_mm),
        };
        let uncertain = Uncertain { wider: elsewhere.wider, unlisted };
        let contributions = self.contributions(explained, &posteriors, uncertain, &provenance);
        let effects = contributions.iter().map(Contribution::in_model).collect();
        let extended: Vec<NewEffect> = contributions.iter().map(|contribution| contribution.entry.clone()).collect();
        let replaced: Vec<Advice> = contributions.iter().filter_map(Contribution::replaced).collect();
        let named = contributions.into_iter().filter(|contribution| self.is_named(&contribution.added));
        let (mut added, tables): (Vec<Added>, Vec<NewEffect>) = named.map(|named| (named.added, named.entry)).unzip();
        ties::add(&mut added, &tables, never_returns(&self.problem));
        let mut advice = advice(&added, &unexplained, &ranking.separability, &self.problem, noise_mm);
        if !extended.is_empty() && errors_after.rms_mm > errors_before.rms_mm {
            advice.insert(
                0,
                "the extended cell is worse than the declared one on the held-out rows, which the fit has not seen: they are unlike the \
                 fitted rows. Measure again before you use this cell"
                    .to_owned(),
            );
        }
        if self.is_whole_arm() && transfer_sigma_mm > 0.0 {
            advice.push(format!(
                "for the same program next to its place, also turned, the standard uncertainty is {transfer_sigma_mm:.3} mm per axis: rows in \
                 other places, postures and loads make it smaller; more rows of this program do not"
            ));
        }
        advice.extend(replaced);
        advice.extend(doubt);
        advice.extend(refused.as_ref().map(Refused::advice));
        advice.extend(controller::corrected_twice(&self.declared, &self.problem, before));
        advice.extend(cancelled::cancelled(&mut self.problem, &self.declared, &self.candidates));
        let mut found = Identification {
            rows: self.problem.rows.len(),
            held_out_rows,
            noise_mm,
            wander_mm,
            orientation_noise_deg,
            noise_floor_rms_mm,
            before: errors_before,
            after: errors_after,
            after_rms_ci95_mm,
            after_other_places: elsewhere.extended,
            transfer_sigma_mm,
            run_drift_rms_mm,
            added,
            effects,
            sets: std::mem::take(&mut self.sets),
            ranking: ranking.kinds,
            separability: ranking.separability,
            coverage,
            unexplained,
            advice,
            outliers,
            extended,
            residuals,
        };
        found.advice.extend(slipped_or_soft(&found));
        found.advice.extend(faint_effects(&found));
        found.advice.extend(worse_on_held_out(&found));
        found
    }

    /// Whether an effect of the extended cell is named. In the model of the whole arm it is only if the others together
    /// cannot replace it. A map is not a name.
    fn is_named(&self, added: &Added) -> bool {
        if self.is_whole_arm() { added.posterior >= NAMED } else { added.kind != MAP }
    }

    /// Standard deviation of the drift of the noise for each axis, mm.
    fn wander_mm(&self) -> f64 {
        self.sigma * self.shape.drift.sqrt()
    }

    /// Factor by which the standard deviation of the noise exceeds σ because of heavy tails: σ is that of the residuals
    /// after each is divided by the width of its row.
    fn tail_factor(&self) -> f64 {
        let whitened = self.whitened(&(self.residual() - self.shifted_by(|_| true)));
        let fitted = self.problem.rows.iter().filter(|row| !row.held_out && !row.outlier);
        let (wide, all) = fitted.fold((0.0, 0.0), |(wide, all), row| {
            let square = whitened.rows(row.offset, row.reading.len()).norm_squared();
            (wide + square * row.tail * row.tail, all + square)
        });
        if all > 0.0 { (wide / all).sqrt() } else { 1.0 }
    }

    /// Standard deviation of the white noise of measured orientations for each axis, degrees; `None` if no orientation
    /// is fitted.
    fn orientation_noise_deg(&self) -> Option<f64> {
        let any = self.problem.rows.iter().any(|row| row.turned.is_some());
        any.then(|| (1e-3 * self.problem.turn_weight * self.sigma).to_degrees())
    }

    /// The patterns of the chosen set, and further signs that the rows contain more than the listed effects and noise.
    pub(super) fn unexplained(&mut self) -> Unexplained {
        let left = &self.left_by_cell();
        let chosen = self.patterns();
        let linear = self.linearise(&chosen, &[]);
        let mut correlates = Vec::new();
        let mut first = 0;
        for &c in &self.chosen {
            let at = first;
            first += self.candidates[c].values.len();
            let Home::Pattern(pattern) = self.candidates[c].home else { continue };
            if pattern.consequence() == Consequence::Nuisance {
                continue;
            }
            let candidate = &self.candidates[c];
            let mut part = DVector::zeros(self.problem.scalars);
            linear.design.add(candidate.pattern_numbers(), &mut part);
            let share = (part.dot(left) / (part.norm() * left.norm()).max(1e-12)).clamp(-1.0, 1.0);
            let fault = (pattern.consequence() == Consequence::Fault).then(|| pattern.name());
            let parameters = match pattern {
                Pattern::Jump { .. } => self.slipped(candidate, at),
                _ => Vec::new(),
            };
            correlates.push(Correlate { with: pattern.words(&self.problem), r: share, fault, parameters });
        }
        if let Some(field) = self.shape.field {
            let series = self.problem.series(|row| !row.held_out);
            let part = noise::field_of(left, &series, self.shape, field);
            let fitted = DVector::from_iterator(
                part.len(),
                part.iter().zip(left.iter()).map(|(p, r)| if *p == 0.0 { 0.0 } else { *r }),
            );
            let r = part.dot(&fitted) / (part.norm() * fitted.norm()).max(1e-12);
            let with = match field.over {
                noise::Over::Place => "place in the work object",
                noise::Over::Wrist => "the wrist's posture",
                noise::Over::Force => "cutting force",
                noise::Over::Everything(_) => "place, posture and force together",
            };
            correlates.push(Correlate { with: with.to_owned(), r, fault: None, parameters: Vec::new() });
        }
        if self.shape.drift > MOST_WANDER {
            let with = "time, slowly: far beyond an arm's drift".to_owned();
            correlates.push(Correlate { with, r: 1.0, fault: None, parameters: Vec::new() });
        }
        if let Some(declared) = self.problem.declared_sigma_mm.filter(|_| self.scatters_more()) {
            let with = format!(
                "no known quantity: the rows scatter by {:.4} mm, and their sigma_mm states {declared:.4}",
                self.sigma
            );
            correlates.push(Correlate { with, r: 1.0, fault: None, parameters: Vec::new() });
        }
        correlates.sort_by(|a, b| b.r.abs().total_cmp(&a.r.abs()));
        Unexplained { significant: !correlates.is_empty(), correlates }
    }

    /// The size of a slip, whose numbers begin at `first` in the posterior.
    fn slipped(&self, candidate: &Candidate, first: usize) -> Vec<FittedParameter> {
        let covariance = self.wider_covariance(1.0);
        let of = |k: usize| {
            let value = candidate.values[k] / candidate.typical[k] * TYPICAL_MM;
            let variance = covariance.get((first + k, first + k)).copied().unwrap_or(f64::INFINITY);
            let half = 1.96 * TYPICAL_MM * variance.max(0.0).sqrt();
            let name = format!("shift_mm[{k}]");
            let owner = ParameterOwner::Effect;
            FittedParameter { name, value, unit: "mm", ci95: [value - half, value + half], neutral: 0.0, owner }
        };
        (0..candidate.values.len()).map(of).collect()
    }

    /// The held-out rows outside the joint ranges of the fitted rows, if a curve is chosen.
    pub(super) fn coverage(&self) -> Coverage {
        let mut coverage = Coverage::default();
        if !self.chosen.iter().any(|&c| self.candidates[c].law().is_some_and(|law| law.shape == Shape::Curve)) {
            return coverage;
        }
        let seen = |joint: usize| {
            let fitted = self.problem.rows.iter().filter(|row| !row.held_out).map(move |row| row.motor[joint]);
            fitted.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ranges: Vec<(f64, f64)> = (0..6).map(seen).collect();
        for row in self.problem.rows.iter().filter(|row| row.held_out) {
            let outside: Vec<usize> =
                (0..6).filter(|&j| row.motor[j] < ranges[j].0 || row.motor[j] > ranges[j].1).collect();
            coverage.rows_outside += usize::from(!outside.is_empty());
            coverage.joints_outside.extend(outside.iter().map(|j| j + 1));
        }
        coverage.joints_outside.sort_unstable();
        coverage.joints_outside.dedup();
        coverage
    }

    /// 95 % interval of the rms error of the held-out rows, mm, by a bootstrap over blocks.
    pub(super) fn bootstrap(&self, after: &DVector<f64>) -> [f64; 2] {
        const DRAWS: usize = 400;
        let mut blocks: std::collections::BTreeMap<(usize, usize), Vec<f64>> = std::collections::BTreeMap::new();
        for row in self.problem.rows.iter().filter(|row| row.held_out && !row.outlier) {
            let size = after.rows(row.offset, row.reading.len()).norm_squared();
            blocks.entry((row.run, row.block)).or_default().push(size);
        }
        let blocks: Vec<Vec<f64>> = blocks.into_values().collect();
        // A linear congruential generator with the constants of Knuth's MMIX and a fixed seed: the same data give the
        // same interval.
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        let mut draw = |n: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            #[allow(clippy::cast_possible_truncation)]
            let index = ((state >> 33) as usize) % n.max(1);
            index
        };
        if blocks.is_empty() {
            return [0.0; 2];
        }
        let mut all: Vec<f64> = (0..DRAWS)
            .map(|_| {
                let (sum, count) = (0..blocks.len()).fold((0.0, 0usize), |(sum, count), _| {
                    let block = &blocks[draw(blocks.len())];
                    (sum + block.iter().sum::<f64>(), count + block.len())
                });
                (sum / count.max(1) as f64).sqrt()
            })
            .collect();
        all.sort_by(f64::total_cmp);
        [all[DRAWS / 40], all[DRAWS - 1 - DRAWS / 40]]
    }

    /// The residuals of every row before and after, for `--report`.
    pub(super) fn residual_rows(&self, before: &DVector<f64>, after: &DVector<f64>) -> Vec<ResidualRow> {
        let whitened = self.whitened(after);
        let three = |v: &DVector<f64>, row: &Observation, scale: f64| {
            // Axes that were not measured have no residual.
            let shows = |k: usize| k < row.reading.len() && row.reading.has(k);
            std::array::from_fn(|k| if shows(k) { v[row.offset + k] * scale } else { f64::NAN })
        };
        self.problem
            .rows
            .iter()
            .map(|row| ResidualRow {
                run: row.run + 1,
                target: row.target,
                line: row.line,
                block: row.block,
                held_out: row.held_out,
                outlier: row.outlier,
                place_mm: self.problem.place_mm(row).into(),
                prefit_mm: three(before, row, 1.0),
                postfit_mm: three(after, row, 1.0),
                whitened: three(&whitened, row, 1.0 / self.sigma),
            })
            .collect()
    }
}

/// Root mean square, mean and maximum of some lengths, mm.
fn errors_of(norms: &[f64]) -> Errors {
    let n = norms.len().max(1) as f64;
    Errors {
        rms_mm: (norms.iter().map(|v| v * v).sum::<f64>() / n).sqrt(),
        mean_mm: norms.iter().sum::<f64>() / n,
        max_mm: norms.iter().copied().fold(0.0, f64::max),
    }
}
