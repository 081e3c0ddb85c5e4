//! The effects of the extended cell: what each explains, its numbers with their uncertainty, and its table.

use super::candidate::{Home, fitted};
use super::data::Observation;
use super::decisions::{EVEN, MENTIONED, NAMED};
use super::engine::Engine;
use super::found::{MAP, Posterior};
use super::outcome::{Added, Advice, FittedParameter, InModel};
use super::pattern::Consequence;
use super::search::Search;
use deflex_cell::{NewEffect, Uncertainty};
use deflex_effects::{Shape, kind};
use nalgebra::{DMatrix, DVector};

/// Factor of the variances of fitted numbers, because no model is exact and the shape of the noise is fitted too. It is
/// calibrated on cells of the shop table so that 95 % of the 95 % intervals contain the true number.
const WIDER: f64 = 1.5;
/// The rival of every name while an error remains that is in no list.
const UNLISTED: &str = "unlisted";

/// What an effect explains of the held-out rows, by the fit without them.
pub(super) struct Explained {
    kind: String,
    /// Error with the other effects and without it, mm rms; over the whole robot that of the stage before.
    without_mm: f64,
    /// Error with it, mm rms; over the whole robot that of its stage.
    with_mm: f64,
    /// Its contribution to the prediction, mm rms.
    share_mm: f64,
}

/// An effect of the extended cell.
pub(super) struct Contribution {
    pub(super) added: Added,
    /// Its entry of the cell file.
    pub(super) entry: NewEffect,
    /// What it explains of the held-out rows, under the kind that the fitted rows alone favour.
    explained: Explained,
}

/// How uncertain the effects are.
#[derive(Clone, Copy)]
pub(super) struct Uncertain {
    /// Variance that left-out rows show, relative to the variance that the fit predicts.
    pub(super) wider: f64,
    /// Whether an error remains that no effect explains.
    pub(super) unlisted: bool,
}

impl Contribution {
    pub(super) fn in_model(&self) -> InModel {
        InModel {
            kind: self.added.kind.clone(),
            probability: self.added.posterior,
            share_rms_mm: self.explained.share_mm,
            parameters: self.added.parameters.clone(),
        }
    }

    /// A sentence about the effect, if all rows favour another kind than the fitted ones alone.
    pub(super) fn replaced(&self) -> Option<Advice> {
        let (kind, before) = (&self.added.kind, &self.explained.kind);
        (kind != before).then(|| {
            format!(
                "all rows together favour `{kind}`, and the fitted rows alone `{before}`. The extended cell has the first, and the errors \
                 above are those of `{before}`. Measure once more before you rely on this cell"
            )
        })
    }

    fn is_curve(&self) -> bool {
        kind(&self.added.kind).is_some_and(|kind| kind.shape == Shape::Curve)
    }
}

/// An effect of the extended cell with its present numbers.
struct Fitted {
    kind: String,
    posterior: f64,
    not_told_apart_from: Vec<String>,
    parameters: Vec<FittedParameter>,
    /// Its table of the cell file.
    table: toml::Table,
    uncertainty: Option<Uncertainty>,
}

impl Engine {
    /// What each effect of the extended cell explains, in the order of the chosen set. The map, if there is one, is the
    /// last. `stages` has the errors before and after each member over the whole robot, `after` is the residual of the
    /// extended cell, and `with_all_mm` its error.
    pub(super) fn explained(
        &mut self,
        posteriors: &[Posterior],
        stages: &[(f64, f64)],
        after: &DVector<f64>,
        with_all_mm: f64,
    ) -> Vec<Explained> {
        let held_out = |row: &Observation| row.held_out;
        let clampings = self.shifted_by(|pattern| pattern.consequence() == Consequence::Nuisance);
        let mut all = Vec::new();
        for (n, &c) in self.chosen.iter().enumerate() {
            if !posteriors.iter().any(|(p, _)| *p == c) {
                continue;
            }
            let others = self.chosen.iter().filter(|&&o| o != c).map(|&o| &self.candidates[o]);
            let others: Vec<(&Home, &[f64])> = others.map(|other| (&other.home, &other.values[..])).collect();
            // The map stays, because `after` has it too.
            let without = self.problem.residual(&self.arm_of(&others)) - &clampings;
            let alone = (self.errors(&without, held_out).rms_mm, with_all_mm);
            let (without_mm, with_mm) = stages.get(n).copied().unwrap_or(alone);
            let share_mm = self.errors(&(&without - after), held_out).rms_mm;
            all.push(Explained { kind: self.candidates[c].kind.clone(), without_mm, with_mm, share_mm });
        }
        if let Some(map) = self.map.take() {
            let without = self.left_by_cell();
            all.push(Explained {
                kind: MAP.to_owned(),
                without_mm: self.errors(&without, held_out).rms_mm,
                with_mm: with_all_mm,
                share_mm: self.errors(&(&without - after), held_out).rms_mm,
            });
            self.map = Some(map);
        }
        all
    }

    /// The effects of the extended cell with their present numbers, in the order of [`Engine::explained`].
    pub(super) fn contributions(
        &self,
        explained: Vec<Explained>,
        posteriors: &[Posterior],
        uncertain: Uncertain,
        provenance: &toml::Table,
    ) -> Vec<Contribution> {
        let all = self.fitted_effects(posteriors, uncertain).into_iter().zip(explained);
        let all = all.map(|(fitted, explained)| Contribution {
            added: Added {
                kind: fitted.kind,
                posterior: fitted.posterior,
                held_out_rms_before_mm: explained.without_mm,
                held_out_rms_after_mm: explained.with_mm,
                parameters: fitted.parameters,
                not_told_apart_from: fitted.not_told_apart_from,
            },
            entry: NewEffect { table: fitted.table, uncertainty: fitted.uncertainty, provenance: provenance.clone() },
            explained,
        });
        with_curves_joined(all.collect())
    }

    /// The effects of the extended cell with their uncertainty, in the order of the chosen set, and the map.
    fn fitted_effects(&self, posteriors: &[Posterior], Uncertain { wider, unlisted }: Uncertain) -> Vec<Fitted> {
        let mut at = 0;
        let mut all = Vec::new();
        let covariance = self.wider_covariance(wider);
        let typical: Vec<f64> = self.chosen.iter().flat_map(|&c| self.candidates[c].typical.iter().copied()).collect();
        let scaled =
            DMatrix::from_fn(typical.len(), typical.len(), |i, j| covariance[(i, j)] * typical[i] * typical[j]);
        // The errors of several effects partly cancel, so that only their joint covariance gives the uncertainty of a
        // prediction. The covariance is factored in typical sizes, because the units of the numbers differ by orders of
        // magnitude.
        let is_joint = posteriors.len() > 1 || self.map.is_some();
        let mut factor = covariance.clone().cholesky().filter(|_| is_joint).map(|factor| factor.l());
        let of_map = self.map.as_ref().zip(factor.as_mut()).map(|(map, factor)| map.rows_of_factor(factor));
        for &c in &self.chosen {
            let candidate = &self.candidates[c];
            let size = candidate.values.len();
            let own = at..at + size;
            at += size;
            let Some(effect) = fitted(&self.declared, candidate) else { continue };
            let Some((_, (posterior, rivals))) = posteriors.iter().find(|(p, _)| *p == c) else { continue };
            // No name is certain while an error remains that no effect explains.
            let posterior = if unlisted { posterior.min(EVEN) } else { *posterior };
            let is_sure = posterior >= NAMED || self.is_whole_arm();
            let mentioned = rivals.iter().filter(|(_, share)| !is_sure && *share >= MENTIONED);
            let rivals = mentioned.map(|(kind, _)| kind.clone());
            let parameter = |(k, p): (usize, deflex_effects::Parameter)| {
                let half = 1.96 * scaled[(own.start + k, own.start + k)].max(0.0).sqrt();
                let ci95 = [(p.value - half).max(p.bounds.0), (p.value + half).min(p.bounds.1)];
                FittedParameter { name: p.name, value: p.value, unit: p.unit, ci95, neutral: p.neutral, owner: p.owner }
            };
            let parameters = effect.parameters().into_iter().enumerate().map(parameter).collect();
            let uncertainty = match &factor {
                Some(factor) => {
                    let row = |i: usize| (factor.row(i) * typical[i]).iter().copied().collect();
                    Uncertainty::Joint(own.map(row).collect())
                }
                None => Uncertainty::Own(own.clone().map(|i| own.clone().map(|j| scaled[(i, j)]).collect()).collect()),
            };
            all.push(Fitted {
                kind: candidate.kind.clone(),
                posterior,
                not_told_apart_from: rivals.chain(unlisted.then(|| UNLISTED.to_owned())).collect(),
                parameters,
                table: effect.to_table(),
                uncertainty: Some(uncertainty),
            });
        }
        let rows = |heights: DMatrix<f64>| heights.row_iter().map(|row| row.iter().copied().collect()).collect();
        all.extend(self.map.iter().map(|map| Fitted {
            kind: MAP.to_owned(),
            posterior: map.likely,
            not_told_apart_from: Vec::new(),
            parameters: Vec::new(),
            table: map.effect.to_table(),
            uncertainty: of_map.clone().map(|heights| Uncertainty::Joint(rows(heights))),
        }));
        all
    }

    /// Posterior covariance of the chosen columns, in typical sizes, if the variance of the data is larger by the
    /// factor `wider`. Directions that the data do not determine keep the width of their prior.
    pub(super) fn wider_covariance(&self, wider: f64) -> DMatrix<f64> {
        // Over the whole robot (`--poses`) there are many rows, and no posterior over sets.
        if self.problem.is_of_robot() || self.chosen.is_empty() {
            return self.covariance.clone();
        }
        let wider = if self.is_whole_arm() { wider.max(1.0) } else { wider.max(self.spread * WIDER) };
        let prior = Search::new(&self.candidates, &[], &[]).columns(&self.chosen).full_size().precision();
        let known = self.covariance.clone().cholesky().map(|factor| factor.inverse());
        let precision = known.map(|known| prior * (1.0 - 1.0 / wider) + known / wider);
        let covariance = precision.and_then(DMatrix::cholesky).map(|factor| factor.inverse());
        covariance.unwrap_or_else(|| &self.covariance * wider)
    }
}

/// The effects with the curves of single joints joined to one effect with several curves, as the cell file has it.
fn with_curves_joined(all: Vec<Contribution>) -> Vec<Contribution> {
    let mut joined: Vec<Contribution> = Vec::new();
    let mut curves = 0;
    for next in all {
        if !next.is_curve() {
            joined.push(next);
            continue;
        }
        match joined.iter_mut().find(|other| other.is_curve()) {
            Some(first) => join_curve(first, next, curves),
            None => joined.push(next),
        }
        curves += 1;
    }
    joined
}

/// Adds the curve of a further joint to an effect that has `curves` curves.
fn join_curve(first: &mut Contribution, other: Contribution, curves: usize) {
    let name = |p: &FittedParameter| p.name.replacen("curves[0]", &format!("curves[{curves}]"), 1);
    let renamed = other.added.parameters.into_iter().map(|p| FittedParameter { name: name(&p), ..p });
    first.added.parameters.extend(renamed);
    first.added.posterior = first.added.posterior.min(other.added.posterior);
    let (before, after) = (&mut first.added.held_out_rms_before_mm, &mut first.added.held_out_rms_after_mm);
    *before = before.max(other.added.held_out_rms_before_mm);
    *after = after.min(other.added.held_out_rms_after_mm);
    first.explained.share_mm = first.explained.share_mm.hypot(other.explained.share_mm);
    if let (Some(toml::Value::Array(into)), Some(toml::Value::Array(from))) =
        (first.entry.table.get_mut("curves"), other.entry.table.get("curves"))
    {
        into.extend(from.iter().cloned());
    }
    match (&mut first.entry.uncertainty, other.entry.uncertainty) {
        (Some(Uncertainty::Own(into)), Some(Uncertainty::Own(from))) => {
            let (a, b) = (into.len(), from.len());
            into.iter_mut().for_each(|row| row.extend(std::iter::repeat_n(0.0, b)));
            into.extend(from.into_iter().map(|row| std::iter::repeat_n(0.0, a).chain(row).collect()));
        }
        (Some(Uncertainty::Joint(into)), Some(Uncertainty::Joint(from))) => into.extend(from),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deflex_effects::ParameterOwner;

    /// An effect of a kind with one number and this error without it, mm.
    fn contribution(kind: &str, name: &str, without_mm: f64) -> Contribution {
        let owner = ParameterOwner::Effect;
        let parameter =
            FittedParameter { name: name.to_owned(), value: 1.0, unit: "rad", ci95: [0.0, 2.0], neutral: 0.0, owner };
        let mut table = toml::Table::new();
        table.insert("curves".to_owned(), toml::Value::Array(vec![name.into()]));
        Contribution {
            added: Added {
                kind: kind.to_owned(),
                posterior: 1.0 - without_mm,
                held_out_rms_before_mm: without_mm,
                held_out_rms_after_mm: without_mm / 2.0,
                parameters: vec![parameter],
                not_told_apart_from: Vec::new(),
            },
            entry: NewEffect {
                table,
                uncertainty: Some(Uncertainty::Own(vec![vec![without_mm]])),
                provenance: toml::Table::new(),
            },
            explained: Explained { kind: kind.to_owned(), without_mm, with_mm: 0.0, share_mm: without_mm },
        }
    }

    #[test]
    fn curves_of_several_joints_are_one_effect_at_the_place_of_the_first() {
        let [a, b, c] = [0.3, 0.4, 0.5].map(|mm| contribution("joint_error_curve", "curves[0].error_rad[0]", mm));
        let other = contribution("zero_offset", "offset_rad[0]", 0.2);
        let joined = with_curves_joined(vec![a, other, b, c]);
        assert_eq!(
            joined.iter().map(|one| &one.added.kind[..]).collect::<Vec<_>>(),
            ["joint_error_curve", "zero_offset"]
        );
        let Added { posterior, held_out_rms_before_mm, held_out_rms_after_mm, parameters, .. } = &joined[0].added;
        assert_eq!((*posterior, *held_out_rms_before_mm, *held_out_rms_after_mm), (0.5, 0.5, 0.15));
        let names: Vec<&str> = parameters.iter().map(|p| &p.name[..]).collect();
        assert_eq!(names, ["curves[0].error_rad[0]", "curves[1].error_rad[0]", "curves[2].error_rad[0]"]);
        // The covariance of independent curves has a block for each.
        let Some(Uncertainty::Own(rows)) = &joined[0].entry.uncertainty else { panic!("no covariance") };
        assert_eq!(*rows, [vec![0.3, 0.0, 0.0], vec![0.0, 0.4, 0.0], vec![0.0, 0.0, 0.5]]);
        assert_eq!(joined[0].entry.table["curves"].as_array().map(Vec::len), Some(3));
        // Shares of independent curves add as squares: 0.09 + 0.16 + 0.25.
        assert!((joined[0].explained.share_mm - 0.5f64.sqrt()).abs() < 1e-12);
    }
}
