//! Everything a little off at once: every effect shrunk by one size, over a discrepancy that sizes itself.
//!
//! On a real arm no single effect is missing: springs, zeros, links, gears and weights are all a little off, and each law is only nearly
//! right. The observation model is then
//!
//! `y = Σ_g X_g θ_g + f(place, posture, force) + wander + noise`
//!
//! with the columns X of every effect in the registry, θ about neutral, and f a Gaussian process that stands for what no law describes.
//! All θ have one common share of their typical sizes as standard deviations; or those that the search found keep the sizes that it
//! found them with, and the others have the share. Which of the two, the share, and the size and reach of f are those of most evidence (type-II maximum likelihood; Rasmussen and Williams 2006, chapter 5). Because f is in the covariance of
//! the rows, more rows of the same places do not make a law that is nearly right look certain.

use super::candidate::Candidate;
use super::columns::Columns;
use super::decisions::{MATERIAL, UNLISTED, caution};
use super::engine::{Engine, stacked};
use super::found::{Members, Posterior};
use super::moments::Moments;
use super::noise::{self, Field, Over};
use super::pattern::Standing;
use super::score::score;
use super::search::Search;
use crate::effects::Shape;
use nalgebra::Vector3;

/// Common sizes of effects that are tried, as shares of their typical sizes.
const SHARES: [f64; 5] = [0.05, 0.125, 0.25, 0.5, 1.0];
/// Reaches of the discrepancy, in standard deviations of place, posture and force over the table.
const REACHES: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Its variance over that of the white noise: from half of its size to eight times.
pub(super) const VARIANCES: [f64; 5] = [0.25, 1.0, 4.0, 16.0, 64.0];

/// Sizes of effects as shares of their typical ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    /// Of those that the search found; `None`: as found.
    found: Option<f64>,
    others: f64,
}

impl Shares {
    /// All effects alike.
    pub(super) fn common() -> impl Iterator<Item = Self> {
        SHARES.into_iter().map(|share| Self { found: Some(share), others: share })
    }

    /// All effects alike, or those that were found as they were and the others smaller.
    fn all() -> impl Iterator<Item = Self> {
        SHARES.into_iter().flat_map(|others| [Some(others), None].map(|found| Self { found, others }))
    }
}

/// Columns of all members at some sizes, and what these must gain for having been looked for, nats.
pub(super) struct Trial {
    pub(super) shares: Shares,
    pub(super) columns: Columns,
    pub(super) price: f64,
}

/// The shares, the discrepancy and the noise that the rows speak for.
struct Sizes {
    shares: Shares,
    shape: noise::Shape,
    sigma: f64,
    evidence: f64,
}

impl Engine {
    /// One candidate of every family of effects that a set lacks: of several variants the one that gains most with the set.
    fn all_others(&self, search: &Search, set: &[usize]) -> Vec<usize> {
        let mut best: Vec<(&str, f64, usize)> = Vec::new();
        for (c, candidate) in self.candidates.iter().enumerate() {
            let names_effect = candidate.law().is_some_and(|law| law.shape != Shape::Map);
            if !names_effect || !candidate.is_full_size() || candidate.curve.is_some() || !search.joins(set, c) {
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

    /// Candidates with all members at a share of their typical sizes, or all but those that were found. Numbers that an identification
    /// before has left with a covariance have a size of their own.
    fn shrunk(&self, members: &Members, Shares { found, others }: Shares) -> Vec<Candidate> {
        let mut candidates = self.candidates.clone();
        let mut shrink = |set: &[usize], share: f64| {
            let sized = set.iter().filter(|&&c| !self.candidates[c].is_pattern() && self.candidates[c].known.is_none());
            sized.for_each(|&c| candidates[c].scale = share);
        };
        shrink(&members.others, others);
        if let Some(found) = found {
            shrink(&members.found, found);
        }
        candidates
    }

    /// Whether everything is taken to be a little off: the discrepancy over all coordinates is of that model alone.
    pub(super) fn is_whole_arm(&self) -> bool {
        self.shape.field.is_some_and(|field| matches!(field.over, Over::Everything(_)))
    }

    /// The members of the whole arm, a set among them: patterns that stand for something unlisted, and faults, are left out.
    pub(super) fn members_of_whole_arm(&self, search: &Search, set: &[usize]) -> Members {
        let stays = |c: &usize| !matches!(self.candidates[*c].standing(), Some(Standing::Unlisted | Standing::Fault));
        let found: Vec<usize> = set.iter().copied().filter(stays).collect();
        let others = self.all_others(search, &found);
        Members { found, others }
    }

    /// The columns of all members at some sizes. Of members that stand out each must gain by itself; of all that are alike it counts that
    /// one of their family's variants was taken.
    pub(super) fn trial(&self, members: &Members, shares: Shares, always: &[usize]) -> Trial {
        let candidates = self.shrunk(members, shares);
        let search = Search::new(&candidates, &[], always);
        let alike = |set: &[usize]| set.iter().map(|&c| self.variants(c).ln()).sum::<f64>();
        let found = if shares.found.is_none() { search.prices(&members.found) } else { alike(&members.found) };
        Trial { shares, columns: search.columns(&members.all()), price: found + alike(&members.others) }
    }

    /// Variants of full size that a member was chosen from: of waves along a joint as many as were looked at.
    fn variants(&self, c: usize) -> f64 {
        let own = &self.candidates[c];
        match own.law() {
            None => 1.0,
            Some(law) if law.shape == Shape::Periodic => own.variants,
            Some(_) => {
                let same = |other: &&Candidate| other.family == own.family && other.is_full_size();
                self.candidates.iter().filter(same).count().max(1) as f64
            }
        }
    }

    /// Whether the whole arm gains on a set, both under the noise of its search: this costs little to compute.
    pub(super) fn gains_on(&self, search: &Search, set: &[usize], members: &Members) -> bool {
        let value = search.objective(set);
        Shares::all().any(|shares| {
            let trial = self.trial(members, shares, search.always);
            score(search.moments, &trial.columns, None).evidence - trial.price > value + UNLISTED
        })
    }

    /// The sizes of most evidence about the present fit.
    fn sizes(&mut self, members: &Members) -> Option<Sizes> {
        let all = members.all();
        let linear = self.linearise(&all, &[]);
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
                for Trial { shares, columns, price } in tried {
                    let score = score(&moments, columns, best.as_ref().map(|best| best.sigma));
                    let evidence = score.evidence - price;
                    if best.as_ref().is_none_or(|best| evidence > best.evidence) {
                        best = Some(Sizes { shares: *shares, shape, sigma: score.sigma, evidence });
                    }
                }
            }
            best.as_ref().map(|best| best.shape)
        };
        // The wander that a few sharp laws left may be what the other effects do: it is chosen first, at sizes in the middle.
        let middle = Shares { found: Some(SHARES[2]), others: SHARES[2] };
        let middle = [self.trial(members, middle, &linear.always)];
        let mut drift = None;
        for shape in noise::few().into_iter().chain([noise::Shape { field: None, ..self.shape }]) {
            drift = weigh(shape, REACHES[2], &middle);
        }
        let drift = noise::Shape { field: None, ..drift? };
        let tried: Vec<Trial> = Shares::all().map(|shares| self.trial(members, shares, &linear.always)).collect();
        for reach in REACHES {
            weigh(drift, reach, &tried);
        }
        best
    }

    /// Standard deviations of place, posture and force over the fitted rows.
    pub(super) fn spreads(&self) -> [f64; noise::OVER.len()] {
        let places: Vec<noise::Places> =
            self.problem.rows.iter().filter(|row| !row.held_out).map(|row| self.problem.places(row)).collect();
        let count = places.len().max(1) as f64;
        std::array::from_fn(|k| {
            let mean = places.iter().map(|place| place[k]).sum::<Vector3<f64>>() / count;
            (places.iter().map(|place| (place[k] - mean).norm_squared()).sum::<f64>() / count).sqrt()
        })
    }

    /// Takes the whole arm in place of the set that the search found, with the probability of each effect.
    pub(super) fn take_whole_arm(&mut self, members: &Members) -> Vec<Posterior> {
        // Rows that stood out from a few sharp laws may follow the other effects.
        self.problem.rows.iter_mut().for_each(|row| (row.tail, row.outlier) = (1.0, false));
        let Some(sizes) = self.sizes(members) else { return Vec::new() };
        (self.shape, self.sigma) = (sizes.shape, sizes.sigma);
        self.candidates = self.shrunk(members, sizes.shares);
        let mut all = members.all();
        self.choose(all.clone());
        if let Some(fault) = self.fault_beyond(&all) {
            all.push(fault);
            self.choose(all);
        }
        if self.mark_outliers() > 0 {
            self.refit();
        }
        self.probabilities()
    }

    /// The fault of the table that explains what the whole arm does not, if one does.
    fn fault_beyond(&mut self, members: &[usize]) -> Option<usize> {
        let is_fault = |c: &usize| self.candidates[*c].standing() == Some(Standing::Fault);
        let faults: Vec<usize> = (0..self.candidates.len()).filter(is_fault).collect();
        let linear = self.linearise(&[members, &faults].concat(), &[self.shape]);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let evidence = |set: &[usize]| search.near(set, Some(self.sigma)).evidence;
        let (value, none) = (evidence(members), evidence(&[]));
        let gain = |&c: &usize| (evidence(&[members, &[c]].concat()) - value - search.price(c), c);
        let best = faults.iter().map(gain).max_by(|a, b| a.0.total_cmp(&b.0));
        // No force acts with a tiny share of what was read, nor with many times that: the forces that were read are then not those that
        // acted, whatever else explains the rows.
        let scaled_away =
            |gain: f64, fault: usize| gain > 0.0 && self.is_of_force(fault) && self.force_is_scaled_away();
        best.filter(|&(gain, c)| gain > MATERIAL * (value - none) || scaled_away(gain, c)).map(|(_, c)| c)
    }

    /// Whether the fitted factor of the cutting force is at an end of the range that it may have.
    fn force_is_scaled_away(&self) -> bool {
        let at_end = |candidate: &Candidate| {
            // A fit ends on a bound up to rounding.
            let ends = |(value, (low, high)): (&f64, &(f64, f64))| *value < low * 1.001 || *value > high / 1.001;
            candidate.kind == "force_scale" && candidate.values.iter().zip(&candidate.bounds).any(ends)
        };
        self.chosen.iter().any(|&c| at_end(&self.candidates[c]))
    }

    /// How likely each effect of the whole arm acts, all others free to stand in for it.
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
