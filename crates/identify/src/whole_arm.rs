//! The model of the whole arm: all effects at once, with small prior sizes, and a discrepancy that no law describes.
//!
//! On a real arm not one effect is missing: springs, zeros, links, gears and weights all have small errors, and every
//! law is only approximately correct. The observation model is then
//!
//! `y = Σ_g X_g θ_g + f(place, posture, force) + wander + noise`
//!
//! with the columns X of every effect in the registry, their numbers θ about neutral, and a Gaussian process f, the
//! discrepancy, which describes the errors of the laws. The prior standard deviations of all θ are one common share of
//! their typical sizes. The share, the variance of f and its length scale are those of most evidence (type-II maximum
//! likelihood; Rasmussen and Williams 2006, chapter 5). Because f is part of the covariance of the rows, more rows at the
//! same places do not make a law that is only approximately correct look certain.

use super::candidate::Candidate;
use super::columns::Columns;
use super::decisions::caution;
use super::engine::{Engine, stacked};
use super::found::Posterior;
use super::moments::Moments;
use super::noise::{self, Field, Over};
use super::pattern::Consequence;
use super::score::score;
use super::search::Search;
use deflex_effects::Shape;
use nalgebra::Vector3;

/// Common prior sizes that are tried, as shares of the typical sizes.
pub(super) const SHARES: [f64; 5] = [0.05, 0.125, 0.25, 0.5, 1.0];
/// Length scales of the discrepancy that are tried, in standard deviations of place, posture and force over the table.
const REACHES: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Variances of the discrepancy that are tried, relative to that of the white noise: standard deviations from one half
/// to eight times.
pub(super) const VARIANCES: [f64; 5] = [0.25, 1.0, 4.0, 16.0, 64.0];

/// The columns of all members with a common share of their typical sizes, and their price, nats.
pub(super) struct Trial {
    pub(super) share: f64,
    pub(super) columns: Columns,
    pub(super) price: f64,
}

/// The share, the discrepancy and the noise of most evidence.
struct Sizes {
    share: f64,
    shape: noise::Shape,
    sigma: f64,
    evidence: f64,
}

impl Engine {
    /// One candidate of every family of effects that a set lacks: the variant with the largest objective together with
    /// the set.
    fn all_others(&self, search: &Search, set: &[usize]) -> Vec<usize> {
        let mut best: Vec<(&str, f64, usize)> = Vec::new();
        for (c, candidate) in self.candidates.iter().enumerate() {
            let names_effect = candidate.law().is_some_and(|law| law.shape != Shape::Map);
            if !names_effect || !candidate.is_typical_size() || candidate.curve.is_some() || !search.joins(set, c) {
                continue;
            }
            let known = best.iter().position(|(family, ..)| *family == candidate.family);
            let value = search.objective(&[set, &[c]].concat());
            match known {
                Some(i) if best[i].1 < value => best[i] = (&candidate.family, value, c),
                Some(_) => {}
                None => best.push((&candidate.family, value, c)),
            }
        }
        best.into_iter().map(|(.., c)| c).collect()
    }

    /// The candidates, of which the members have a common share of their typical sizes. Effects whose numbers have a
    /// covariance from an earlier identification keep that prior.
    fn shrunk(&self, members: &[usize], share: f64) -> Vec<Candidate> {
        let mut candidates = self.candidates.clone();
        let sized = members.iter().filter(|&&c| !self.candidates[c].is_pattern() && self.candidates[c].known.is_none());
        sized.for_each(|&c| candidates[c].scale = share);
        candidates
    }

    /// Whether the present model is that of the whole arm, which alone has a discrepancy over all coordinates.
    pub(super) fn is_whole_arm(&self) -> bool {
        self.shape.field.is_some_and(|field| matches!(field.over, Over::Everything(_)))
    }

    /// Standard deviation of the white noise with which the numbers are fitted, mm. In the model of the whole arm the
    /// nats of the rows count as in a posterior (see [`caution`]), because its discrepancy describes only the smooth
    /// part of the errors of the laws.
    pub(super) fn sigma_of_fit(&self) -> f64 {
        if !self.is_whole_arm() {
            return self.sigma;
        }
        let fitted = self.problem.rows.iter().filter(|row| !row.held_out);
        self.sigma * caution(fitted.map(|row| row.reading.len()).sum()).sqrt()
    }

    /// The members of the model of the whole arm: those of a set, without unlisted patterns and faults, and one of
    /// every other family.
    pub(super) fn members_of_whole_arm(&self, search: &Search, set: &[usize]) -> Vec<usize> {
        let stays =
            |c: &usize| !matches!(self.candidates[*c].consequence(), Some(Consequence::Unlisted | Consequence::Fault));
        let mut members: Vec<usize> = set.iter().copied().filter(stays).collect();
        members.extend(self.all_others(search, &members));
        members
    }

    /// The columns of all members with a common share of their typical sizes, and their price. The members are in the
    /// model without a choice, and pay only for the choice of a variant of their family.
    pub(super) fn trial(&self, members: &[usize], share: f64, always: &[usize]) -> Trial {
        let candidates = self.shrunk(members, share);
        let columns = Search::new(&candidates, &[], always).columns(members);
        Trial { share, columns, price: members.iter().map(|&c| self.variants(c).ln()).sum() }
    }

    /// Number of variants with the typical prior sizes among which a member was chosen; for harmonics the number of
    /// those that were searched.
    fn variants(&self, c: usize) -> f64 {
        let own = &self.candidates[c];
        match own.law() {
            None => 1.0,
            Some(law) if law.shape == Shape::Periodic => own.variants,
            Some(_) => {
                let same = |other: &&Candidate| other.family == own.family && other.is_typical_size();
                self.candidates.iter().filter(same).count().max(1) as f64
            }
        }
    }

    /// Whether the model of the whole arm, still without its discrepancy, has larger evidence than a set, less the
    /// prices of both. Both have the moments of the search, so that this costs little.
    pub(super) fn gains_on(&self, search: &Search, set: &[usize], members: &[usize]) -> bool {
        let value = search.objective(set);
        SHARES.iter().any(|&share| {
            let trial = self.trial(members, share, search.always);
            score(search.moments, &trial.columns, Some(self.sigma)).evidence - trial.price > value
        })
    }

    /// The prior sizes, the discrepancy and the noise of most evidence about the present fit.
    fn sizes(&mut self, members: &[usize]) -> Option<Sizes> {
        let linear = self.linearise(members, &[]);
        let stacked = stacked(linear.design.kept(), &linear.data);
        let series = self.problem.series(|row| !row.held_out);
        let declared = self.problem.declared_sigma_mm;
        let spreads = self.spreads();
        let mut best: Option<Sizes> = None;
        let mut weigh = |drift: noise::Shape, reach: f64, tried: &[Trial]| {
            let field = |share| Field { over: Over::Everything(spreads), share, reach };
            let of = |share| (noise::Shape { field: Some(field(share)), ..drift }, field(share));
            let shapes = VARIANCES.map(of);
            for (moments, (shape, _)) in Moments::under_fields(&stacked, &series, &shapes).into_iter().zip(shapes) {
                let moments = [Moments { declared, ..moments }];
                for Trial { share, columns, price } in tried {
                    let score = score(&moments, columns, best.as_ref().map(|best| best.sigma));
                    let evidence = score.evidence - price;
                    if best.as_ref().is_none_or(|best| evidence > best.evidence) {
                        best = Some(Sizes { share: *share, shape, sigma: score.sigma, evidence });
                    }
                }
            }
            best.as_ref().map(|best| best.shape)
        };
        // The wander that the search chose may be an error of the other effects. It is chosen again first, with a
        // middle share and length scale.
        let middle = [self.trial(members, SHARES[2], &linear.always)];
        let mut drift = None;
        for shape in noise::few().into_iter().chain([noise::Shape { field: None, ..self.shape }]) {
            drift = weigh(shape, REACHES[2], &middle);
        }
        let drift = noise::Shape { field: None, ..drift? };
        let tried: Vec<Trial> = SHARES.iter().map(|&share| self.trial(members, share, &linear.always)).collect();
        for reach in REACHES {
            weigh(drift, reach, &tried);
        }
        best
    }

    /// Standard deviations of place, mm, posture, rad, and force, N, over the fitted rows.
    pub(super) fn spreads(&self) -> [f64; noise::OVER.len()] {
        let places: Vec<noise::Places> =
            self.problem.rows.iter().filter(|row| !row.held_out).map(|row| self.problem.places(row)).collect();
        let count = places.len().max(1) as f64;
        std::array::from_fn(|k| {
            let mean = places.iter().map(|place| place[k]).sum::<Vector3<f64>>() / count;
            (places.iter().map(|place| (place[k] - mean).norm_squared()).sum::<f64>() / count).sqrt()
        })
    }

    /// Replaces the set that the search found by the model of the whole arm, and returns the probability of each
    /// effect.
    pub(super) fn take_whole_arm(&mut self, members: Vec<usize>) -> Vec<Posterior> {
        // Outliers and heavy tails are judged again, because the other effects may explain these rows.
        self.problem.rows.iter_mut().for_each(|row| (row.tail, row.outlier) = (1.0, false));
        let Some(sizes) = self.sizes(&members) else { return Vec::new() };
        (self.shape, self.sigma) = (sizes.shape, sizes.sigma);
        self.candidates = self.shrunk(&members, sizes.share);
        self.choose(members);
        self.add_fault();
        if self.mark_outliers() > 0 {
            self.refit();
        }
        self.probabilities()
    }

    /// The probability that each effect of the model acts, computed against the model without it, in which all others
    /// can replace it.
    fn probabilities(&mut self) -> Vec<Posterior> {
        let chosen = self.chosen.clone();
        let linear = self.linearise(&chosen, &[self.shape]);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let value = search.near(&chosen, Some(self.sigma)).evidence;
        let count = linear.moments.first().map_or(0, |moments| moments.count);
        let effects = chosen.iter().copied().filter(|&c| !self.candidates[c].is_pattern());
        effects
            .map(|c| {
                let without: Vec<usize> = chosen.iter().copied().filter(|&o| o != c).collect();
                let gain = value - search.near(&without, Some(self.sigma)).evidence - search.price(c);
                (c, (1.0 / (1.0 + (-gain / caution(count)).exp()), Vec::new()))
            })
            .collect()
    }
}
