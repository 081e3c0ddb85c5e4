//! Which set of effects the data speak for.
//!
//! Every candidate's columns are in one set of moments, so that the evidence of any set is a small problem. A set
//! pays for each member what a name must gain, and for the variants that were tried. Sets are searched by adding,
//! swapping and removing, from nothing and from the best pairs; what could stand in a member's place with nearly the
//! same evidence is what it cannot be distinguished from.

use super::candidate::{Candidate, Home, SPRING};
use super::columns::Columns;
use super::decisions::{FLEXIBLE, MOVED, PRICE, UNLISTED, caution};
use super::moments::Moments;
use super::pattern::Standing;
use super::profile::Profile;
use super::score::{Score, score};
use crate::effects::kind;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Whether every effect of the second kind is one of the first too.
pub(super) fn contains(whole: &str, part: &str) -> bool {
    kind(part).is_some_and(|kind| kind.nested_in.contains(&whole))
}

/// Sets of more members than this are not what one table shows (a curve a joint is a member).
pub(super) const MOST_MEMBERS: usize = 12;

/// Searches over sets of candidates.
pub(super) struct Search<'a> {
    pub(super) candidates: &'a [Candidate],
    pub(super) moments: &'a [Moments],
    /// Columns that are in every set (the device's frame).
    pub(super) always: &'a [usize],
    /// Noise shapes worth trying, most promising first.
    active: RefCell<Vec<usize>>,
    /// Of each set what it gains less its price, nats, and its best shape.
    known: RefCell<BTreeMap<Vec<usize>, (f64, usize)>>,
    /// Last σ of each shape: where the next profile starts.
    sigmas: RefCell<Vec<Option<f64>>>,
    /// Members that the last sets began with, and the profile of each shape with them.
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

    pub(super) fn columns(&self, set: &[usize]) -> Columns {
        self.joined(Columns::independent(self.always.iter().map(|&column| (column, 1.0)).collect()), set)
    }

    /// Columns, then those of a set.
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

    fn caution(&self) -> f64 {
        caution(self.moments.first().map_or(0, |moments| moments.count))
    }

    /// Evidence of a set over all noise shapes.
    pub(super) fn full(&self, set: &[usize]) -> Score {
        score(self.moments, &self.columns(set), None)
    }

    /// Evidence of a set over all noise shapes, σ searched from a guess where there is one.
    pub(super) fn near(&self, set: &[usize], guess: Option<f64>) -> Score {
        score(self.moments, &self.columns(set), guess)
    }

    /// Evidence of a set less its price, nats, over the shapes worth trying.
    pub(super) fn objective(&self, set: &[usize]) -> f64 {
        self.weighed(set).0
    }

    /// The same, and the best shape.
    fn weighed(&self, set: &[usize]) -> (f64, usize) {
        let key = sorted(set);
        if let Some(known) = self.known.borrow().get(&key) {
            return *known;
        }
        let more = self.beyond_shared(set);
        let mut best = (f64::NEG_INFINITY, 0);
        for &shape in self.active.borrow().iter() {
            let evidence = self.profile(shape, &more);
            if evidence > best.0 {
                best = (evidence, shape);
            }
        }
        best.0 -= self.prices(&key);
        self.known.borrow_mut().insert(key, best);
        best
    }

    /// Whether a set is far from another's value, nats, as the other's best shape tells: then its own does not matter.
    fn is_far_below(&self, (value, shape): (f64, usize), set: &[usize]) -> bool {
        /// What other shapes, bounds and σ at its best can add, nats.
        const FAR: f64 = 30.0;
        if self.known.borrow().contains_key(&sorted(set)) {
            return false;
        }
        let more = self.beyond_shared(set);
        let guess = self.sigmas.borrow()[shape];
        let roughly = self.shared.borrow_mut().1[shape].roughly(&self.moments[shape], &more, guess);
        roughly - self.prices(set) < value - FAR
    }

    /// Columns of a set beyond the shared ones, which are all but its last member's: the sets that are compared differ in that one.
    fn beyond_shared(&self, set: &[usize]) -> Columns {
        let first = set.len().saturating_sub(1);
        let known = [set, &set[..first]].into_iter().find(|begin| *begin == self.shared.borrow().0);
        let begin = known.unwrap_or_else(|| {
            self.share(&set[..first]);
            &set[..first]
        });
        self.joined(Columns::default(), &set[begin.len()..])
    }

    fn share(&self, set: &[usize]) {
        let columns = self.columns(set);
        *self.shared.borrow_mut() =
            (set.to_vec(), self.moments.iter().map(|_| Profile::new(columns.clone())).collect());
    }

    /// Evidence of columns in addition to the shared ones, under one shape.
    fn profile(&self, shape: usize, more: &Columns) -> f64 {
        let guess = self.sigmas.borrow()[shape];
        let (evidence, sigma) = self.shared.borrow_mut().1[shape].beside(&self.moments[shape], more, guess);
        self.sigmas.borrow_mut()[shape] = Some(sigma);
        evidence
    }

    /// What a set must gain over none, nats.
    pub(super) fn prices(&self, set: &[usize]) -> f64 {
        set.iter().map(|&c| self.price(c)).sum()
    }

    /// What a member must gain: more for its variants, and for what could stand for anything.
    pub(super) fn price(&self, c: usize) -> f64 {
        let candidate = &self.candidates[c];
        let price = match candidate.standing() {
            Some(Standing::Unlisted) => UNLISTED,
            // That parts are clamped anew, or that a known effect is known better, is no discovery.
            Some(Standing::Nuisance) => 0.0,
            _ if candidate.known.is_some() => MOVED,
            _ => PRICE,
        };
        // What passes for much; what is unlisted has that in its own price.
        let bent = candidate.is_flexible() && candidate.standing() != Some(Standing::Unlisted);
        let price = if bent { price + FLEXIBLE } else { price };
        price + candidate.variants.ln()
    }

    /// Whether a candidate may join a set: one variant of a kind.
    pub(super) fn joins(&self, set: &[usize], c: usize) -> bool {
        let new = &self.candidates[c];
        set.iter().all(|&s| {
            let member = &self.candidates[s];
            // A spring may be off and bent at once.
            let both = new.family == SPRING && new.kind != member.kind;
            s != c && (member.family != new.family || both)
        })
    }

    /// The best set among candidates that `allowed` lets in, from a starting set.
    pub(super) fn best(&self, start: &[usize], allowed: &dyn Fn(&Candidate) -> bool) -> Vec<usize> {
        let pool: Vec<usize> = (0..self.candidates.len()).filter(|&c| allowed(&self.candidates[c])).collect();
        self.narrow(&pool);
        self.best_of(start, &pool)
    }

    /// The best set of some candidates, from a starting set, over the shapes worth trying.
    pub(super) fn best_of(&self, start: &[usize], pool: &[usize]) -> Vec<usize> {
        let mut best = self.climb(start.to_vec(), pool);
        // A pair can beat what single steps find: two effects whose sum a third imitates.
        let mut singles: Vec<(f64, usize)> = pool.iter().map(|&c| (self.objective(&[c]), c)).collect();
        singles.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Of a kind's many variants the best: a climb goes on to the others.
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
        let beside = self.beside_faults(&[], &|c| pool.contains(&c));
        pairs.extend(beside.into_iter().map(|(_, pair)| (self.objective(&pair), pair)));
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, pair) in pairs.into_iter().take(3) {
            let climbed = self.climb(pair, pool);
            if self.objective(&climbed) > self.objective(&best) {
                best = climbed;
            }
        }
        best
    }

    /// Keeps the noise shapes that are best for something.
    pub(super) fn narrow(&self, pool: &[usize]) {
        let mut votes = vec![f64::NEG_INFINITY; self.moments.len()];
        let mut wanted = Vec::new();
        for set in std::iter::once(vec![]).chain(pool.iter().map(|&c| vec![c])) {
            let more = self.beyond_shared(&set);
            let each: Vec<f64> = (0..self.moments.len()).map(|s| self.profile(s, &more)).collect();
            let best = (0..each.len()).max_by(|&a, &b| each[a].total_cmp(&each[b])).unwrap_or(0);
            votes[best] = votes[best].max(each[best]);
        }
        let mut order: Vec<usize> = (0..votes.len()).filter(|&s| votes[s].is_finite()).collect();
        order.sort_by(|&a, &b| votes[b].total_cmp(&votes[a]));
        wanted.extend(order.into_iter().take(2));
        // White noise is always one of the questions.
        if !wanted.contains(&0) {
            wanted.push(0);
        }
        *self.active.borrow_mut() = wanted;
        self.known.borrow_mut().clear();
    }

    /// Noise shapes worth trying, in their order.
    pub(super) fn active(&self) -> Vec<usize> {
        let mut active = self.active.borrow().clone();
        active.sort_unstable();
        active
    }

    fn climb(&self, start: Vec<usize>, pool: &[usize]) -> Vec<usize> {
        let mut set = start;
        let mut own = self.weighed(&set);
        // Each round gains.
        for _ in 0..3 * MOST_MEMBERS {
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
            let near = moves.into_iter().filter(|set| !self.is_far_below(own, set));
            let best = near.map(|set| (self.weighed(&set), set)).max_by(|a, b| a.0.0.total_cmp(&b.0.0));
            match best {
                Some((better, chosen)) if better.0 > own.0 + 1e-9 => (own, set) = (better, chosen),
                _ => break,
            }
        }
        set
    }

    /// A set with each kind's best variant and a fault of the measurement, the best drift and the best slip in turn, and that
    /// variant: whatever explains the rows stands with the fault that suits it, not with one that suited another.
    fn beside_faults(&self, set: &[usize], allowed: &dyn Fn(usize) -> bool) -> Vec<(usize, Vec<usize>)> {
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
        let is_fault = |candidate: &Candidate| match candidate.home {
            Home::Pattern(pattern) => pattern.standing() == Standing::Fault && !pattern.is_of_force(),
            Home::Declared(_) | Home::New(_) => false,
        };
        let (kinds, faults) = (best_of_each(&|candidate| !candidate.is_pattern()), best_of_each(&is_fault));
        let with = |f: usize| kinds.iter().map(move |&c| (c, [set, &[f, c]].concat())).collect::<Vec<_>>();
        faults.into_iter().flat_map(with).collect()
    }

    /// Posterior over the sets about one: itself, without each member, with each swapped for another, with each further
    /// one; by what they name, most likely first, with the best set of those names.
    pub(super) fn sets(&self, set: &[usize]) -> Vec<(f64, Vec<usize>)> {
        /// Sets of a lower probability are not reported.
        const TOLD: f64 = 0.005;
        let (own, caution) = (self.weighed(set), self.caution());
        let mut moves = vec![set.to_vec()];
        let further = |set: &[usize]| {
            let joins = |c: &usize| self.candidates[*c].is_named() && self.joins(set, *c);
            (0..self.candidates.len()).filter(joins).map(|c| [set, &[c]].concat()).collect::<Vec<_>>()
        };
        moves.extend(further(set));
        for &member in set.iter().filter(|&&c| self.candidates[c].is_named()) {
            let without: Vec<usize> = set.iter().copied().filter(|&c| c != member).collect();
            moves.extend(further(&without));
            moves.extend(self.beside_faults(&without, &|_| true).into_iter().map(|(_, set)| set));
            moves.push(without);
        }
        let mut by_names: BTreeMap<Vec<&str>, (f64, f64, Vec<usize>)> = BTreeMap::new();
        let mut total = 0.0;
        for set in moves {
            if self.is_far_below(own, &set) {
                continue;
            }
            let value = self.objective(&set);
            let weight = ((value - own.0) / caution).min(50.0).exp();
            total += weight;
            let entry = by_names.entry(self.names(&set)).or_insert((0.0, f64::NEG_INFINITY, Vec::new()));
            entry.0 += weight;
            if value > entry.1 {
                (entry.1, entry.2) = (value, set);
            }
        }
        let mut all: Vec<(f64, Vec<usize>)> =
            by_names.into_values().map(|(weight, _, set)| (weight / total, set)).collect();
        all.retain(|(share, _)| *share >= TOLD);
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        all
    }

    /// The best set of those names about a set that are likeliest over all of their variants: of a kind with many, such as
    /// time constants, none may stand out where all together do.
    pub(super) fn likeliest(&self, set: Vec<usize>) -> Vec<usize> {
        match self.sets(&set).into_iter().next() {
            Some((_, best)) if self.names(&best) != self.names(&set) => best,
            _ => set,
        }
    }

    /// What a set names, in order.
    pub(super) fn names(&self, set: &[usize]) -> Vec<&str> {
        let mut names: Vec<&str> =
            set.iter().filter(|&&c| self.candidates[c].is_named()).map(|&c| &self.candidates[c].kind[..]).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// The best set of each allowed kind that could join one in a member's place, with its value, nats, as that member's rival.
    pub(super) fn in_place_of(
        &self,
        member: usize,
        without: &[usize],
        allowed: &dyn Fn(&Candidate) -> bool,
    ) -> BTreeMap<&str, (f64, Vec<usize>)> {
        let own = &self.candidates[member].kind;
        let joins = |c: &usize| {
            let candidate = &self.candidates[*c];
            candidate.is_named() && allowed(candidate) && self.joins(without, *c)
        };
        let alone = (0..self.candidates.len()).filter(joins).map(|c| (c, [without, &[c]].concat()));
        let beside = self.beside_faults(without, &|c| self.candidates[c].is_pattern() || allowed(&self.candidates[c]));
        let mut best: BTreeMap<&str, (f64, Vec<usize>)> = BTreeMap::new();
        for (c, set) in alone.chain(beside) {
            let kind = &self.candidates[c].kind[..];
            let nested = if contains(kind, own) { self.caution() } else { 0.0 };
            let value = self.objective(&set) + nested;
            if best.get(kind).is_none_or(|(most, _)| value > *most) {
                best.insert(kind, (value, set));
            }
        }
        best
    }

    /// Posterior of a member against everything that could stand in its place, and those kinds, most likely first.
    pub(super) fn rivals(
        &self,
        set: &[usize],
        member: usize,
        allowed: &dyn Fn(&Candidate) -> bool,
    ) -> (f64, Vec<(String, f64)>) {
        let without: Vec<usize> = set.iter().copied().filter(|&c| c != member).collect();
        let (own, caution) = (self.weighed(set), self.caution());
        let mut weights: BTreeMap<String, f64> = BTreeMap::new();
        let mut total = 1.0;
        // Nats that a set is given beyond its evidence.
        let share = |set: &[usize], more: f64| {
            let far = self.is_far_below(own, set);
            if far { 0.0 } else { ((self.objective(set) + more - own.0) / caution).min(50.0).exp() }
        };
        total += share(&without, 0.0);
        // What other variants of its kind add is its own.
        let mut of_kind = 1.0;
        for (c, candidate) in self.candidates.iter().enumerate() {
            if c == member || !allowed(candidate) || !self.joins(&without, c) {
                continue;
            }
            let set = [&without[..], &[c]].concat();
            if candidate.kind == self.candidates[member].kind {
                let weight = share(&set, 0.0);
                of_kind += weight;
                total += weight;
                continue;
            }
            let nested = if contains(&candidate.kind, &self.candidates[member].kind) { caution } else { 0.0 };
            let weight = share(&set, nested);
            total += weight;
            *weights.entry(candidate.kind.clone()).or_default() += weight;
        }
        for (c, set) in self.beside_faults(&without, &|c| c != member) {
            let kind = &self.candidates[c].kind;
            let weight = share(&set, 0.0);
            total += weight;
            if *kind == self.candidates[member].kind {
                of_kind += weight;
            } else {
                *weights.entry(kind.clone()).or_default() += weight;
            }
        }
        let mut rivals: Vec<(String, f64)> = weights.into_iter().map(|(kind, w)| (kind, w / total)).collect();
        rivals.sort_by(|a, b| b.1.total_cmp(&a.1));
        (of_kind / total, rivals)
    }
}

/// Members of a set in order.
pub(super) fn sorted(set: &[usize]) -> Vec<usize> {
    let mut sorted = set.to_vec();
    sorted.sort_unstable();
    sorted
}
