//! Searches for the set of effects with the largest objective: its evidence less the price of its members.
//!
//! The columns of all candidates are in the same moments, so that the evidence of any set is a small problem. The price
//! of a member is the gain that its name requires, plus the logarithm of the number of its variants. The search adds,
//! swaps and removes members, beginning with a given set and with the best pairs. A kind that replaces a member with
//! nearly the same evidence is a rival, from which the rows cannot distinguish it.

use super::candidate::{Candidate, SPRING};
use super::columns::Columns;
use super::decisions::{FLEXIBLE, MOVED, PRICE, UNLISTED, caution};
use super::moments::Moments;
use super::pattern::Consequence;
use super::profile::Profile;
use super::score::{Score, score};
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Largest number of members of a set, where each joint's curve is a member: one table does not show more.
pub(super) const MOST_MEMBERS: usize = 12;

/// Margin for what the approximation of an objective leaves out, nats: the other shapes, the bounds, and the best σ.
const FAR: f64 = 30.0;

/// Searches over sets of candidates.
pub(super) struct Search<'a> {
    pub(super) candidates: &'a [Candidate],
    pub(super) moments: &'a [Moments],
    /// Columns of the unknown numbers of the instruments, which are in every set.
    pub(super) always: &'a [usize],
    /// Indices of the noise shapes that are tried, most promising first.
    active: RefCell<Vec<usize>>,
    /// The objective, nats, and the best shape of each set that was computed, by its sorted members.
    known: RefCell<BTreeMap<Vec<usize>, (f64, usize)>>,
    /// The last σ of each shape, mm, at which the next search for σ begins.
    sigmas: RefCell<Vec<Option<f64>>>,
    /// First members that the last sets shared, and the profile of these members under each shape.
    shared: RefCell<(Vec<usize>, Vec<Profile>)>,
}

impl<'a> Search<'a> {
    pub(super) fn new(candidates: &'a [Candidate], moments: &'a [Moments], always: &'a [usize]) -> Self {
        let all = (0..moments.len()).collect();
        let sigmas = RefCell::new(vec![None; moments.len()]);
        let (active, known) = (RefCell::new(all), RefCell::default());
        let search = Self { candidates, moments, always, active, known, sigmas, shared: RefCell::default() };
        search.share(&[]);
        search
    }

    /// The columns of the instruments, then those of a set.
    pub(super) fn columns(&self, set: &[usize]) -> Columns {
        self.joined(Columns::independent(self.always.iter().map(|&column| (column, 1.0)).collect()), set)
    }

    /// The columns `all`, then those of a set.
    fn joined(&self, mut all: Columns, set: &[usize]) -> Columns {
        for candidate in set.iter().map(|&c| &self.candidates[c]) {
            if let Some(prior) = candidate.precision() {
                all.curves.push((all.list.len(), Arc::clone(prior)));
            }
            let first = all.list.len();
            let expected = (0..candidate.values.len()).map(|k| (first + k, candidate.expected(k) / candidate.scale));
            all.means.extend(expected.filter(|(_, expected)| *expected > 0.0));
            if candidate.precision().is_none() {
                let within = candidate.within();
                all.limits.extend(within.map(|(k, low, high)| (all.list.len() + k, low, high)));
            }
            all.list.extend(candidate.columns().map(|column| (column, candidate.scale)));
        }
        all
    }

    /// Nats that count as one in a posterior: see [`caution`].
    fn caution(&self) -> f64 {
        caution(self.moments.first().map_or(0, |moments| moments.count))
    }

    /// Evidence of a set under the best of all noise shapes.
    pub(super) fn full(&self, set: &[usize]) -> Score {
        self.near(set, None)
    }

    /// The same; the search for σ begins at `guess`, mm, if there is one.
    pub(super) fn near(&self, set: &[usize], guess: Option<f64>) -> Score {
        score(self.moments, &self.columns(set), guess)
    }

    /// The objective: evidence of a set under the best of the active shapes, less its price, nats.
    pub(super) fn objective(&self, set: &[usize]) -> f64 {
        self.objective_and_shape(set).0
    }

    /// The objective, and the index of the best shape.
    fn objective_and_shape(&self, set: &[usize]) -> (f64, usize) {
        self.objective_above(set, f64::NEG_INFINITY).unwrap_or((f64::NEG_INFINITY, 0))
    }

    /// The objective, and the index of the best shape; `None` if the objective is at most `least`, nats.
    fn objective_above(&self, set: &[usize], least: f64) -> Option<(f64, usize)> {
        let key = sorted(set);
        if let Some(known) = self.known.borrow().get(&key) {
            return Some(*known).filter(|known| known.0 > least);
        }
        let (more, price) = (self.columns_after_shared(set), self.prices(&key));
        let (evidence, shape) = self.best_shape(&self.active.borrow(), &more, least + price)?;
        let own = (evidence - price, shape);
        self.known.borrow_mut().insert(key, own);
        Some(own)
    }

    /// The largest evidence of the shared columns together with `more` under one of these shapes, nats, and its shape;
    /// `None` if no evidence is above `least`.
    fn best_shape(&self, shapes: &[usize], more: &Columns, least: f64) -> Option<(f64, usize)> {
        let mut best = None;
        for &shape in shapes {
            let (least, guess) = (best.map_or(least, |(evidence, _)| evidence), self.sigmas.borrow()[shape]);
            let mut shared = self.shared.borrow_mut();
            let (evidence, sigma) = shared.1[shape].evidence_above(&self.moments[shape], more, guess, least);
            self.sigmas.borrow_mut()[shape] = Some(sigma);
            best = evidence.map(|evidence| (evidence, shape)).or(best);
        }
        best
    }

    /// The objective of a set, nats: an approximation under one shape, unless the objective itself is known.
    fn approximate_objective(&self, set: &[usize], shape: usize) -> f64 {
        if let Some((known, _)) = self.known.borrow().get(&sorted(set)) {
            return *known;
        }
        let more = self.columns_after_shared(set);
        let guess = self.sigmas.borrow()[shape];
        let evidence = self.shared.borrow_mut().1[shape].approximate_evidence_with(&self.moments[shape], &more, guess);
        evidence - self.prices(set)
    }

    /// Whether the objective of a set is so far below `value`, nats, that it need not be computed: an approximation
    /// under one shape decides.
    fn is_far_below(&self, (value, shape): (f64, usize), set: &[usize]) -> bool {
        self.approximate_objective(set, shape) < value - FAR
    }

    /// The set with the largest objective, nats, with the objective and its shape; `None` if no objective is above
    /// `known`, which is the objective of another set with its shape. Sets whose approximation under that shape is far
    /// below the best objective so far are left out. The set with the best approximation is computed first, and then
    /// the others in their order, because neighbouring sets share their first members.
    fn best_above(&self, known: (f64, usize), sets: &[Vec<usize>]) -> Option<((f64, usize), Vec<usize>)> {
        let approximate: Vec<f64> = sets.iter().map(|set| self.approximate_objective(set, known.1)).collect();
        let first = (0..sets.len()).max_by(|&a, &b| approximate[a].total_cmp(&approximate[b]));
        let mut best = (known, None);
        for n in first.into_iter().chain((0..sets.len()).filter(|&n| Some(n) != first)) {
            if approximate[n] >= best.0.0 - FAR
                && let Some(own) = self.objective_above(&sets[n], best.0.0)
            {
                best = (own, Some(n));
            }
        }
        let (own, chosen) = best;
        chosen.map(|n| (own, sets[n].clone()))
    }

    /// The columns of a set that follow the shared ones. If the set does not begin with the shared members, all its
    /// members except the last one become the shared ones: the sets that a search compares differ in the last.
    fn columns_after_shared(&self, set: &[usize]) -> Columns {
        let first = set.len().saturating_sub(1);
        let known = [set, &set[..first]].into_iter().find(|begin| *begin == self.shared.borrow().0);
        let begin = known.unwrap_or_else(|| {
            self.share(&set[..first]);
            &set[..first]
        });
        self.joined(Columns::default(), &set[begin.len()..])
    }

    /// Makes these members the shared ones.
    fn share(&self, set: &[usize]) {
        let columns = self.columns(set);
        *self.shared.borrow_mut() =
            (set.to_vec(), self.moments.iter().map(|_| Profile::new(columns.clone())).collect());
    }

    /// The price of a set: the gain over the empty set that its members require, nats.
    pub(super) fn prices(&self, set: &[usize]) -> f64 {
        set.iter().map(|&c| self.price(c)).sum()
    }

    /// The price of a member, nats. It grows with the number of its variants, and is higher for candidates that can
    /// imitate others.
    pub(super) fn price(&self, c: usize) -> f64 {
        let candidate = &self.candidates[c];
        let price = match candidate.consequence() {
            Some(Consequence::Unlisted) => UNLISTED,
            // Every run has a clamping of its own, so that it is not a discovery.
            Some(Consequence::Nuisance) => 0.0,
            _ if candidate.known.is_some() => MOVED,
            _ => PRICE,
        };
        // The price of unlisted patterns already accounts for their flexibility.
        let pays_flexibility = candidate.is_flexible() && candidate.consequence() != Some(Consequence::Unlisted);
        let price = if pays_flexibility { price + FLEXIBLE } else { price };
        price + candidate.variants.ln()
    }

    /// Whether a candidate may join a set: a set has at most one member of a family, except that it may have two laws
    /// of the springs of different kinds.
    pub(super) fn joins(&self, set: &[usize], c: usize) -> bool {
        let new = &self.candidates[c];
        set.iter().all(|&s| {
            let member = &self.candidates[s];
            // The stiffness of a spring can be wrong and its law not linear at the same time.
            let both = new.family == SPRING && new.kind != member.kind;
            s != c && (member.family != new.family || both)
        })
    }

    /// The best set of the candidates that `allowed` accepts. The search begins at `start`, under the shapes that are
    /// best for a candidate alone.
    pub(super) fn best(&self, start: &[usize], allowed: &dyn Fn(&Candidate) -> bool) -> Vec<usize> {
        let pool: Vec<usize> = (0..self.candidates.len()).filter(|&c| allowed(&self.candidates[c])).collect();
        self.narrow(&pool);
        self.best_of(start, &pool)
    }

    /// The best set of the candidates of `pool` under the active shapes. The search begins at `start`.
    pub(super) fn best_of(&self, start: &[usize], pool: &[usize]) -> Vec<usize> {
        let mut visited = BTreeSet::new();
        let mut best = self.climb(start.to_vec(), pool, &mut visited);
        // Single steps can miss the best pair if a third effect imitates the sum of its two effects.
        let mut singles: Vec<(f64, usize)> = pool.iter().map(|&c| (self.objective(&[c]), c)).collect();
        singles.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Only the best variant of each kind is paired; the climb that follows reaches the other variants.
        let mut seen = BTreeSet::new();
        singles.retain(|&(_, c)| seen.insert((&self.candidates[c].family, &self.candidates[c].kind)));
        const PAIRED: usize = 10;
        let mut pairs = Vec::new();
        for (i, &(_, a)) in singles.iter().take(PAIRED).enumerate() {
            for &(_, b) in singles.iter().take(PAIRED).skip(i + 1) {
                if self.joins(&[a], b) {
                    pairs.push((self.objective(&[a, b]), vec![a, b]));
                }
            }
        }
        let with_faults = self.with_faults(&[], &|c| pool.contains(&c));
        pairs.extend(with_faults.into_iter().map(|(_, pair)| (self.objective(&pair), pair)));
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, pair) in pairs.into_iter().take(3) {
            let climbed = self.climb(pair, pool, &mut visited);
            if self.objective(&climbed) > self.objective(&best) {
                best = climbed;
            }
        }
        best
    }

    /// Makes active the shapes that are best for the empty set or for one candidate of `pool`: the two of them with the
    /// largest evidence, and white noise, which is shape 0.
    pub(super) fn narrow(&self, pool: &[usize]) {
        let all: Vec<usize> = (0..self.moments.len()).collect();
        let mut votes = vec![f64::NEG_INFINITY; self.moments.len()];
        let mut wanted = Vec::new();
        let mut computed = Vec::new();
        for set in std::iter::once(vec![]).chain(pool.iter().map(|&c| vec![c])) {
            let more = self.columns_after_shared(&set);
            if let Some((evidence, shape)) = self.best_shape(&all, &more, f64::NEG_INFINITY) {
                votes[shape] = votes[shape].max(evidence);
                let objective = evidence - self.prices(&set);
                computed.push((set, (objective, shape)));
            }
        }
        let mut order: Vec<usize> = (0..votes.len()).filter(|&s| votes[s].is_finite()).collect();
        order.sort_by(|&a, &b| votes[b].total_cmp(&votes[a]));
        wanted.extend(order.into_iter().take(2));
        if !wanted.contains(&0) {
            wanted.push(0);
        }
        // The best of all shapes is also the best of the active ones if it is active.
        *self.known.borrow_mut() = computed.into_iter().filter(|(_, (_, shape))| wanted.contains(shape)).collect();
        *self.active.borrow_mut() = wanted;
    }

    /// Indices of the active noise shapes, in ascending order.
    pub(super) fn active(&self) -> Vec<usize> {
        let mut active = self.active.borrow().clone();
        active.sort_unstable();
        active
    }

    /// Adds, swaps or removes one member of a set at a time, always with the largest gain, until no such step gains, or
    /// until it reaches a set of `visited`, from which an earlier climb has gone on. Adds the sets that it reaches to
    /// `visited`.
    fn climb(&self, start: Vec<usize>, pool: &[usize], visited: &mut BTreeSet<Vec<usize>>) -> Vec<usize> {
        let mut set = start;
        let mut own = self.objective_and_shape(&set);
        for _ in 0..3 * MOST_MEMBERS {
            if !visited.insert(sorted(&set)) {
                break;
            }
            let mut moves: Vec<Vec<usize>> = Vec::new();
            if set.len() < MOST_MEMBERS {
                moves.extend(pool.iter().filter(|&&c| self.joins(&set, c)).map(|&c| [&set[..], &[c]].concat()));
            }
            for i in 0..set.len() {
                let mut without = set.clone();
                without.remove(i);
                moves.extend(
                    pool.iter()
                        .filter(|&&c| c != set[i] && self.joins(&without, c))
                        .map(|&c| [&without[..], &[c]].concat()),
                );
                moves.push(without);
            }
            match self.best_above(own, &moves) {
                Some((better, chosen)) if better.0 > own.0 + 1e-9 => (own, set) = (better, chosen),
                _ => break,
            }
        }
        set
    }

    /// The best variant of each kind of effect, with the set of it, the members of `set` and one fault of the
    /// measurement. The faults are in turn the best of each kind, so that every kind is compared together with the
    /// fault that suits it.
    fn with_faults(&self, set: &[usize], allowed: &dyn Fn(usize) -> bool) -> Vec<(usize, Vec<usize>)> {
        let best_of_each = |wanted: &dyn Fn(&Candidate) -> bool| {
            let mut best: BTreeMap<&str, (f64, usize)> = BTreeMap::new();
            for (c, candidate) in self.candidates.iter().enumerate() {
                if wanted(candidate) && allowed(c) && self.joins(set, c) {
                    let value = self.objective(&[set, &[c]].concat());
                    let known = best.entry(&candidate.kind).or_insert((value, c));
                    if value > known.0 {
                        *known = (value, c);
                    }
                }
            }
            best.into_values().map(|(_, c)| c).collect::<Vec<_>>()
        };
        let is_fault = |candidate: &Candidate| candidate.consequence() == Some(Consequence::Fault);
        let (kinds, faults) = (best_of_each(&|candidate| !candidate.is_pattern()), best_of_each(&is_fault));
        let with = |f: usize| kinds.iter().map(move |&c| (c, [set, &[f, c]].concat())).collect::<Vec<_>>();
        faults.into_iter().flat_map(with).collect()
    }

    /// Posterior probabilities of the sets near `set`: itself, and those with one member removed, swapped or added.
    /// Sets that name the same kinds are one entry, with the best of them. The most likely entry is the first.
    pub(super) fn sets(&self, set: &[usize]) -> Vec<(f64, Vec<usize>)> {
        /// Sets of a lower probability are not reported.
        const REPORTED: f64 = 0.005;
        let (own, caution) = (self.objective_and_shape(set), self.caution());
        let mut moves = vec![set.to_vec()];
        let further = |set: &[usize]| {
            let joins = |c: &usize| self.candidates[*c].is_named() && self.joins(set, *c);
            (0..self.candidates.len()).filter(joins).map(|c| [set, &[c]].concat()).collect::<Vec<_>>()
        };
        moves.extend(further(set));
        for &member in set.iter().filter(|&&c| self.candidates[c].is_named()) {
            let without: Vec<usize> = set.iter().copied().filter(|&c| c != member).collect();
            moves.extend(further(&without));
            moves.extend(self.with_faults(&without, &|_| true).into_iter().map(|(_, set)| set));
            moves.push(without);
        }
        moves.retain(|set| !self.is_far_below(own, set));
        let weighed: Vec<(f64, Vec<usize>)> = moves.into_iter().map(|set| (self.objective(&set), set)).collect();
        // Weights are relative to the most probable set: `set` itself may be far below it.
        let most = weighed.iter().fold(f64::NEG_INFINITY, |most, (value, _)| most.max(*value));
        let mut by_names: BTreeMap<Vec<&str>, (f64, f64, Vec<usize>)> = BTreeMap::new();
        let mut total = 0.0;
        for (value, set) in weighed {
            let weight = ((value - most) / caution).exp();
            total += weight;
            let entry = by_names.entry(self.names(&set)).or_insert((0.0, f64::NEG_INFINITY, Vec::new()));
            entry.0 += weight;
            if value > entry.1 {
                (entry.1, entry.2) = (value, set);
            }
        }
        let mut all: Vec<(f64, Vec<usize>)> =
            by_names.into_values().map(|(weight, _, set)| (weight / total, set)).collect();
        all.retain(|(share, _)| *share >= REPORTED);
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        all
    }

    /// The kinds that a set names, sorted and without repetition.
    pub(super) fn names(&self, set: &[usize]) -> Vec<&str> {
        let mut names: Vec<&str> =
            set.iter().filter(|&&c| self.candidates[c].is_named()).map(|&c| &self.candidates[c].kind[..]).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// For each allowed kind the best set that has it in place of a member, alone or with a fault of the measurement,
    /// and the objective of the set, nats. `without` is the set without the member.
    pub(super) fn in_place_of(
        &self,
        without: &[usize],
        allowed: &dyn Fn(&Candidate) -> bool,
    ) -> BTreeMap<&str, (f64, Vec<usize>)> {
        let joins = |c: &usize| {
            let candidate = &self.candidates[*c];
            candidate.is_named() && allowed(candidate) && self.joins(without, *c)
        };
        let alone = (0..self.candidates.len()).filter(joins).map(|c| (c, [without, &[c]].concat()));
        let with_faults =
            self.with_faults(without, &|c| self.candidates[c].is_pattern() || allowed(&self.candidates[c]));
        let mut best: BTreeMap<&str, (f64, Vec<usize>)> = BTreeMap::new();
        for (c, set) in alone.chain(with_faults) {
            let kind = &self.candidates[c].kind[..];
            let value = self.objective(&set);
            if best.get(kind).is_none_or(|(most, _)| value > *most) {
                best.insert(kind, (value, set));
            }
        }
        best
    }

    /// Posterior probability of a member against all that could replace it, and the probabilities of the kinds that
    /// could, most likely first.
    pub(super) fn rivals(&self, set: &[usize], member: usize) -> (f64, Vec<(String, f64)>) {
        let without: Vec<usize> = set.iter().copied().filter(|&c| c != member).collect();
        let (own, caution) = (self.objective_and_shape(set), self.caution());
        let weight = |set: &[usize]| {
            let far = self.is_far_below(own, set);
            if far { 0.0 } else { ((self.objective(set) - own.0) / caution).min(50.0).exp() }
        };
        let kind = &self.candidates[member].kind;
        let in_place = |&c: &usize| (c == member || self.candidates[c].is_named()) && self.joins(&without, c);
        let alone = (0..self.candidates.len()).filter(in_place).map(|c| (c, [&without[..], &[c]].concat()));
        let with_faults = self.with_faults(&without, &|c| c != member);
        let mut weights: BTreeMap<&String, f64> = BTreeMap::new();
        // The weights of the other variants of its kind count for the member.
        for (c, set) in alone.chain(with_faults) {
            *weights.entry(&self.candidates[c].kind).or_default() += weight(&set);
        }
        let total = weight(&without) + weights.values().sum::<f64>();
        let of_kind = weights.remove(kind).unwrap_or_default();
        let mut rivals: Vec<(String, f64)> =
            weights.into_iter().map(|(kind, weight)| (kind.clone(), weight / total)).collect();
        rivals.sort_by(|a, b| b.1.total_cmp(&a.1));
        (of_kind / total, rivals)
    }
}

/// The members of a set in ascending order.
pub(super) fn sorted(set: &[usize]) -> Vec<usize> {
    let mut sorted = set.to_vec();
    sorted.sort_unstable();
    sorted
}
