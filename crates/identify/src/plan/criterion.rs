//! How well rows can distinguish effects, computed before anything is measured.
//!
//! The trace y of an effect is the change that it makes to the rows. A rival, the frame of the part, the instrument and
//! its drift can imitate a part of it under their priors; U has their columns and Λ their prior covariance. Then `d′² =
//! yᵀ(σ²I + U Λ Uᵀ)⁻¹y` (T-optimality, Atkinson and Fedorov 1975, with the priors of `identify`). Together with the
//! price of the rival's numbers this gives the log evidence that `identify` will have for the effect over the rival:
//! its mean is known, and its standard deviation is d′. The criterion of a plan is the expected share of effects that
//! `identify` will not name outright.

use super::draws::Draws;
use crate::candidate::Candidate;
use crate::decisions::{NAMED, PRICE, caution};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Weight of each pair in addition to the share of effects that will be named. With it a search also improves pairs
/// that are far from being decided.
const EACH_PAIR: f64 = 0.02;
/// Number of draws of the numbers of each kind.
const DRAWS: usize = 4;
/// Prior sizes of a rival that are tried, as shares of the typical sizes.
const SCALES: [f64; 3] = [1.0, 0.3, 0.08];
/// Weight of held-out rows relative to fitted ones: they judge the answer, but do not choose the effects.
const HELD_OUT: f64 = 0.3;

/// An effect with drawn numbers.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    /// Index into the kinds.
    pub(super) kind: usize,
    /// Indices of columns of the design with the number of each, in typical sizes.
    pub(super) numbers: Vec<(usize, f64)>,
}

impl Truth {
    /// Its trace: the change of every scalar, mm, from the columns of the candidates.
    pub(super) fn trace(&self, columns: &DMatrix<f64>) -> DVector<f64> {
        let mut sum = DVector::zeros(columns.nrows());
        self.numbers.iter().for_each(|&(column, number)| sum.axpy(number, &columns.column(column), 1.0));
        sum
    }
}

/// The columns with which a rival can imitate an effect.
#[derive(Clone, Debug)]
struct Rival {
    /// Index into the kinds; their number if the rival is no effect.
    kind: usize,
    columns: Vec<usize>,
    /// The gain that its name requires, nats.
    price: f64,
}

/// How well rows distinguish each truth (a row of the matrices) from each kind (a column; the last one is no effect).
pub(super) struct Discrimination {
    /// d′; infinite for the truth's own kind.
    pub(super) distance: DMatrix<f64>,
    /// Mean log evidence of each kind, less its price, nats.
    evidence: DMatrix<f64>,
    /// Number of scalars of all rows.
    scalars: usize,
}

/// Effects with their rivals, and the weight of each pair.
pub(super) struct Criterion {
    /// Kinds of the candidates.
    pub(super) kinds: Vec<String>,
    pub(super) truths: Vec<Truth>,
    rivals: Vec<Rival>,
    /// Columns of the frame of the part.
    frame: Vec<usize>,
    /// Columns of the unknown numbers of the instrument and of its drift.
    instrument: Vec<usize>,
    /// Weight of each pair: the row is the kind of the truth, the column that of the rival, the last one no effect.
    weights: DMatrix<f64>,
    /// Standard deviation of the noise, mm.
    noise_mm: f64,
    /// Number of scalars of each row.
    axes: usize,
}

/// Effects of each kind with numbers drawn from their priors, the same on every run. [`scale`] gives them the wanted
/// size.
pub(super) fn truths(candidates: &[Candidate], kinds: &[String], seed: u64, draws: usize) -> Vec<Truth> {
    let mut all = Vec::new();
    for (kind, name) in kinds.iter().enumerate() {
        let variants: Vec<&Candidate> = candidates.iter().filter(|candidate| candidate.kind == *name).collect();
        let mut sequence = Draws::of(seed + kind as u64);
        for draw in 0..draws {
            let candidate = variants[draw % variants.len()];
            let size = candidate.values.len();
            // In turns a few numbers and all of them are drawn: backlash can be in one gear, a bad calibration is in
            // all joints.
            let few = draw % 2 == 0 && size > 3;
            let only: Vec<usize> =
                if few { (0..2).map(|_| sequence.index(size)).collect() } else { (0..size).collect() };
            let numbers = only.into_iter().map(|k| {
                let value = sequence.normal();
                let room = |end: f64| ((end - candidate.start[k]) / candidate.typical[k]).abs() > 1e-9;
                let (below, above) = candidate.bounds[k];
                let value = if !room(below) {
                    value.abs()
                } else if !room(above) {
                    -value.abs()
                } else {
                    value
                };
                (candidate.first + k, value)
            });
            all.push(Truth { kind, numbers: numbers.collect() });
        }
    }
    all
}

/// Scales the numbers of every truth so that its trace is `rms_mm` rms over the rows, each of which has `axes` scalars.
pub(super) fn scale(truths: &mut [Truth], columns: &DMatrix<f64>, axes: usize, rms_mm: f64) {
    let rows = (columns.nrows() / axes.max(1)) as f64;
    for truth in truths {
        let size = (truth.trace(columns).norm_squared() / rows).sqrt();
        if size > 0.0 {
            truth.numbers.iter_mut().for_each(|(_, number)| *number *= rms_mm / size);
        }
    }
}

impl Criterion {
    /// The criterion for candidates whose columns are numbered. `named` are the kinds that must be distinguished.
    /// `instrument` has the columns of the instrument's unknown numbers and of its drift. The last argument is the
    /// noise, mm, and the number of scalars of each row.
    pub(super) fn new(
        candidates: &[Candidate],
        named: &[String],
        instrument: Vec<usize>,
        (noise_mm, axes): (f64, usize),
    ) -> Self {
        let mut kinds: Vec<String> = named.to_vec();
        kinds.extend(candidates.iter().map(|c| c.kind.clone()).filter(|kind| !named.contains(kind)));
        let mut seen = Vec::new();
        kinds.retain(|kind| {
            !seen.contains(kind) && {
                seen.push(kind.clone());
                true
            }
        });
        let truths = truths(candidates, &kinds[..named.len()], 1, DRAWS);
        let of = |candidate: &Candidate| Rival {
            kind: kinds.iter().position(|kind| *kind == candidate.kind).unwrap_or(kinds.len()),
            columns: candidate.columns().collect(),
            price: PRICE + candidate.variants.ln(),
        };
        let none = Rival { kind: kinds.len(), columns: Vec::new(), price: 0.0 };
        let rivals = std::iter::once(none).chain(candidates.iter().map(of)).collect();
        let is_frame = |c: &&Candidate| c.law().is_some_and(|law| law.like_device_frame);
        let frame = candidates.iter().find(is_frame).into_iter().flat_map(Candidate::columns).collect();
        let weights = DMatrix::from_element(kinds.len(), kinds.len() + 1, 1.0);
        Self { kinds, truths, rivals, frame, instrument, weights, noise_mm, axes }
    }

    /// Gives a small weight to all pairs except the undecided ones and their kinds against no effect.
    pub(super) fn favour_undecided(&mut self, undecided: &[(String, String)]) {
        /// Weight of the other pairs.
        const OTHERS: f64 = 0.05;
        let at = |kind: &String| self.kinds.iter().position(|known| known == kind);
        self.weights.fill(OTHERS);
        for (a, b) in undecided {
            if let (Some(a), Some(b)) = (at(a), at(b)) {
                (self.weights[(a, b)], self.weights[(b, a)]) = (1.0, 1.0);
                let none = self.kinds.len();
                (self.weights[(a, none)], self.weights[(b, none)]) = (1.0, 1.0);
            }
        }
    }

    /// Scales the numbers of every truth so that its trace is `rms_mm` rms over the rows of the columns.
    pub(super) fn scale(&mut self, columns: &DMatrix<f64>, rms_mm: f64) {
        scale(&mut self.truths, columns, self.axes, rms_mm);
    }

    /// d′ of a kind from no effect: the root mean square over its draws.
    pub(super) fn distance_from_none(&self, distances: &DMatrix<f64>, kind: usize) -> f64 {
        self.mean(distances, kind, self.kinds.len())
    }

    /// Root mean square of d′ of kind `a` from kind `b` over the draws of `a`.
    fn mean(&self, distances: &DMatrix<f64>, a: usize, b: usize) -> f64 {
        let of = (0..self.truths.len()).filter(|&t| self.truths[t].kind == a).map(|t| distances[(t, b)]);
        let of: Vec<f64> = of.filter(|d_prime| d_prime.is_finite()).collect();
        (of.iter().map(|d| d * d).sum::<f64>() / of.len().max(1) as f64).sqrt()
    }

    /// How well rows distinguish the truths. `columns` are those of the candidates and of the instrument, over all
    /// rows; `weight` has the weight of each row.
    pub(super) fn discrimination(&self, columns: &DMatrix<f64>, weight: &[f64]) -> Discrimination {
        let mut whitened = columns.clone() / self.noise_mm;
        for (row, weight) in weight.iter().enumerate() {
            whitened.rows_mut(row * self.axes, self.axes).scale_mut(weight.sqrt());
        }
        let gram = whitened.transpose() * &whitened;
        let size = (self.truths.len(), self.kinds.len() + 1);
        let mut discrimination = Discrimination {
            distance: DMatrix::from_element(size.0, size.1, f64::INFINITY),
            evidence: DMatrix::from_element(size.0, size.1, f64::NEG_INFINITY),
            scalars: columns.nrows(),
        };
        let in_frame = |column: &usize| self.frame.contains(column);
        let is_frame = |truth: &Truth| truth.numbers.iter().any(|(column, _)| in_frame(column));
        let concerned = |of_frame: bool| (0..size.0).filter(move |&t| is_frame(&self.truths[t]) == of_frame).collect();
        let (of_frame, others): (Vec<usize>, Vec<usize>) = (concerned(true), concerned(false));
        let Some(instrument) = GivenNuisance::new(&gram, &self.instrument, &self.truths) else { return discrimination };
        let Some(both) = GivenNuisance::new(&gram, &[&self.instrument[..], &self.frame[..]].concat(), &self.truths)
        else {
            return discrimination;
        };
        for rival in &self.rivals {
            // The frame of the part is a nuisance, except where it is the effect itself or the rival.
            let nuisance = if rival.columns.iter().any(in_frame) { &instrument } else { &both };
            self.compare(rival, &instrument, &of_frame, &mut discrimination);
            self.compare(rival, nuisance, &others, &mut discrimination);
        }
        discrimination
    }

    /// Compares the `concerned` truths with a rival, given the nuisance columns, under each prior size of the rival.
    /// The prior size that imitates a truth best counts.
    fn compare(&self, rival: &Rival, given: &GivenNuisance, concerned: &[usize], discrimination: &mut Discrimination) {
        let own = &rival.columns;
        let inner = DMatrix::from_fn(own.len(), own.len(), |i, j| given.gram[(own[i], own[j])]);
        let cross = DMatrix::from_fn(own.len(), concerned.len(), |i, t| given.crosses[(own[i], concerned[t])]);
        let scales = if own.is_empty() { &SCALES[..1] } else { &SCALES[..] };
        for &scale in scales {
            let scaled = &inner * (scale * scale) + DMatrix::identity(own.len(), own.len());
            let Some(factor) = scaled.cholesky() else { continue };
            let occam = given.occam + occam(&factor);
            let mut cross = &cross * scale;
            factor.l_dirty().solve_lower_triangular_mut(&mut cross);
            for (cross, &t) in cross.column_iter().zip(concerned) {
                let square = (given.squares[t] - cross.norm_squared()).max(0.0);
                let at = (t, rival.kind);
                discrimination.evidence[at] = discrimination.evidence[at].max(-0.5 * square - occam - rival.price);
                if self.truths[t].kind != rival.kind {
                    discrimination.distance[at] = discrimination.distance[at].min(square.sqrt());
                }
            }
        }
    }

    /// The weight of each row: those that `identify` will hold out count less.
    pub(super) fn row_weights(held_out: impl Iterator<Item = bool>) -> Vec<f64> {
        held_out.map(|held_out| if held_out { HELD_OUT } else { 1.0 }).collect()
    }

    /// The criterion, which a search minimises: the expected share of the truths that will not be named outright, by a
    /// normal approximation for each rival, plus a small multiple of the sum of the probabilities of all rivals.
    pub(super) fn confusion(&self, discrimination: &Discrimination) -> f64 {
        let (mut missed, mut each) = (0.0, 0.0);
        // The log evidence over a rival that a name requires, nats.
        let needed = (NAMED / (1.0 - NAMED)).ln() * caution(discrimination.scalars);
        for (t, truth) in self.truths.iter().enumerate() {
            let mut named = 1.0;
            for kind in (0..=self.kinds.len()).filter(|&kind| kind != truth.kind) {
                let gain = discrimination.evidence[(t, truth.kind)] - discrimination.evidence[(t, kind)];
                let spread = discrimination.distance[(t, kind)].clamp(1.0, 1e3);
                let taken = self.weights[(truth.kind, kind)] * normal_tail((gain - needed) / spread);
                named *= 1.0 - taken;
                each += taken;
            }
            missed += 1.0 - named;
        }
        (missed + EACH_PAIR * each) / self.truths.len().max(1) as f64
    }

    /// d′ of each pair of the first `named` kinds, smallest first: the root mean square over the draws, for the truth
    /// of the pair whose d′ is smaller.
    pub(super) fn pairs(&self, distances: &DMatrix<f64>, named: usize) -> Vec<(usize, usize, f64)> {
        let mut all = Vec::new();
        for a in 0..named {
            for b in a + 1..named {
                let (forth, back) = (self.mean(distances, a, b), self.mean(distances, b, a));
                all.push(if forth <= back { (a, b, forth) } else { (b, a, back) });
            }
        }
        all.sort_by(|a, b| a.2.total_cmp(&b.2));
        all
    }
}

/// ½ ln det of a posterior precision A, less the expected gain from fitting the noise, ½ trace(I − A⁻¹). The pivots of
/// the factor replace the eigenvalues of A in the trace.
fn occam(factor: &Cholesky<f64, Dyn>) -> f64 {
    factor.l_dirty().diagonal().iter().map(|d| d.ln() - 0.5 * (1.0 - 1.0 / (d * d))).sum()
}

/// Products of the columns and of the traces, conditional on the nuisance columns. All rivals have the same nuisance
/// columns, so that these are eliminated once.
struct GivenNuisance {
    /// Products of the columns with one another.
    gram: DMatrix<f64>,
    /// Products of each column (row) with the trace of each truth (column).
    crosses: DMatrix<f64>,
    /// Squared norm of the trace of each truth.
    squares: Vec<f64>,
    /// Occam term of the nuisance columns: see [`occam`].
    occam: f64,
}

impl GivenNuisance {
    /// The Schur complement of the nuisance columns, under their priors, in the products of all columns over σ²; `None`
    /// if their posterior precision is not positive definite.
    fn new(gram: &DMatrix<f64>, nuisance: &[usize], truths: &[Truth]) -> Option<Self> {
        let mut inner = gram.select_columns(nuisance).select_rows(nuisance);
        (0..nuisance.len()).for_each(|i| inner[(i, i)] += 1.0);
        let factor = inner.cholesky()?;
        let mut taken = gram.select_rows(nuisance);
        factor.l_dirty().solve_lower_triangular_mut(&mut taken);
        let gram = gram - taken.transpose() * &taken;
        let mut crosses = DMatrix::zeros(gram.nrows(), truths.len());
        let mut squares = Vec::with_capacity(truths.len());
        for (truth, mut cross) in truths.iter().zip(crosses.column_iter_mut()) {
            truth.numbers.iter().for_each(|&(column, number)| cross.axpy(number, &gram.column(column), 1.0));
            squares.push(truth.numbers.iter().map(|&(column, number)| number * cross[column]).sum());
        }
        Some(Self { gram, crosses, squares, occam: occam(&factor) })
    }
}

/// Probability that a standard normal number exceeds `at`, approximated within 0.01 by a logistic curve. Its tail falls
/// more slowly, so that a search still finds a slope there.
fn normal_tail(at: f64) -> f64 {
    1.0 / (1.0 + (1.702 * at).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_that_a_rival_imitates_under_its_prior_is_subtracted() {
        let truth = Truth { kind: 0, numbers: vec![(0, 2.0)] };
        let rival = Rival { kind: 1, columns: vec![1], price: 0.0 };
        let none = Rival { kind: 2, columns: Vec::new(), price: 0.0 };
        let criterion = Criterion {
            kinds: vec!["a".into(), "b".into()],
            truths: vec![truth],
            rivals: vec![none, rival],
            frame: Vec::new(),
            instrument: Vec::new(),
            weights: DMatrix::from_element(2, 3, 1.0),
            noise_mm: 0.5,
            axes: 1,
        };
        // The trace (2, 2) is (4, 4) over the noise, and the rival's column is (2, 0): d′² = 32 − 8² / (1 + 4).
        let columns = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 0.0]);
        let found = criterion.discrimination(&columns, &[1.0, 1.0]).distance;
        assert!((found[(0, 2)] - 32_f64.sqrt()).abs() < 1e-12);
        assert!((found[(0, 1)] - 19.2_f64.sqrt()).abs() < 1e-12);
        assert!(found[(0, 0)].is_infinite());
        // With half the weight of all rows d′² is halved.
        assert!((criterion.discrimination(&columns, &[0.5, 0.5]).distance[(0, 2)] - 4.0).abs() < 1e-12);
    }
}
