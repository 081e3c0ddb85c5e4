//! How well rows compare effects apart, before anything is measured.
//!
//! The trace of an effect of the wanted size, less all that a rival, the frame of the part, the instrument and its drift
//! could imitate under their priors, over the noise, is d′: what is left of `yᵀ(σ²I + U Λ Uᵀ)⁻¹y` (Atkinson and Fedorov 1975,
//! T-optimality, with the priors of `identify`). With the price of each rival's numbers it is the evidence that `identify` will
//! have for the effect over the rival: the mean is known and its standard deviation is d′. Rows are the better the more
//! effects it will probably name outright.

use super::draws::Draws;
use crate::identify::candidate::Candidate;
use crate::identify::decisions::{NAMED, PRICE, caution};
use crate::identify::search::contains;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// What every pair counts in addition to the share of effects that will be named: pairs that are hopeless so far are not given up.
const EACH_PAIR: f64 = 0.02;
/// Draws of an effect's numbers.
const DRAWS: usize = 4;
/// Shares of the typical sizes that a rival's prior may have.
const SCALES: [f64; 3] = [1.0, 0.3, 0.08];
/// What held-out rows count for compared with fitted ones: they judge, and choose nothing.
const HELD_OUT: f64 = 0.3;

/// One effect as it might be.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    /// Index into the kinds.
    pub(super) kind: usize,
    /// Column of the design and number, in typical sizes.
    pub(super) numbers: Vec<(usize, f64)>,
}

impl Truth {
    /// What it shows, from the columns of the candidates, mm.
    pub(super) fn shown(&self, columns: &DMatrix<f64>) -> DVector<f64> {
        let mut sum = DVector::zeros(columns.nrows());
        self.numbers.iter().for_each(|&(column, number)| sum.axpy(number, &columns.column(column), 1.0));
        sum
    }
}

/// What a rival may move.
#[derive(Clone, Debug)]
struct Rival {
    /// Index into the kinds; one past the last for none.
    kind: usize,
    columns: Vec<usize>,
    /// What its name must gain, nats.
    price: f64,
}

/// What rows say of each truth (rows) against each kind (columns, none last).
pub(super) struct Discrimination {
    /// d′; infinite from itself.
    pub(super) distance: DMatrix<f64>,
    /// Mean evidence of each kind, less its price, nats.
    evidence: DMatrix<f64>,
    /// Rows times what each shows.
    scalars: usize,
}

/// Effects with their rivals, and how much each pair counts.
pub(super) struct Criterion {
    /// Kinds of the candidates.
    pub(super) kinds: Vec<String>,
    pub(super) truths: Vec<Truth>,
    rivals: Vec<Rival>,
    frame: Vec<usize>,
    /// Columns of the instrument's unknowns and of its drift.
    instrument: Vec<usize>,
    /// Truth's kind, rival's kind (none last).
    weights: DMatrix<f64>,
    noise_mm: f64,
    axes: usize,
}

/// Numbers of effects of the wanted size as the priors have them, drawn the same on every run.
pub(super) fn truths(candidates: &[Candidate], kinds: &[String], seed: u64, draws: usize) -> Vec<Truth> {
    let mut all = Vec::new();
    for (kind, name) in kinds.iter().enumerate() {
        let variants: Vec<&Candidate> = candidates.iter().filter(|candidate| candidate.kind == *name).collect();
        let mut sequence = Draws::of(seed + kind as u64);
        for draw in 0..draws {
            let candidate = variants[draw % variants.len()];
            let size = candidate.values.len();
            // A few numbers, or all of them: lost motion is in one gear, a bad calibration everywhere.
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

/// Makes every truth as large as wanted over rows of so many scalars, mm rms a row.
pub(super) fn scale(truths: &mut [Truth], columns: &DMatrix<f64>, axes: usize, rms_mm: f64) {
    let rows = (columns.nrows() / axes.max(1)) as f64;
    for truth in truths {
        let shown = (truth.shown(columns).norm_squared() / rows).sqrt();
        if shown > 0.0 {
            truth.numbers.iter_mut().for_each(|(_, number)| *number *= rms_mm / shown);
        }
    }
}

impl Criterion {
    /// Of candidates whose columns are numbered, and the columns of what is unknown of the instrument. `named` are the kinds
    /// that must be detected; noise in mm, and the number of scalars a row.
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

    /// Counts pairs that can be distinguished: of kinds that are not undecided little.
    pub(super) fn settle(&mut self, undecided: &[(String, String)]) {
        /// What other pairs count for.
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

    /// Makes every truth as large as wanted over some rows, mm rms a row.
    pub(super) fn scale(&mut self, columns: &DMatrix<f64>, rms_mm: f64) {
        scale(&mut self.truths, columns, self.axes, rms_mm);
    }

    /// d′ of a kind from none: quadratic mean over the draws.
    pub(super) fn distance_from_none(&self, distances: &DMatrix<f64>, kind: usize) -> f64 {
        self.mean(distances, kind, self.kinds.len())
    }

    fn mean(&self, distances: &DMatrix<f64>, a: usize, b: usize) -> f64 {
        let of = (0..self.truths.len()).filter(|&t| self.truths[t].kind == a).map(|t| distances[(t, b)]);
        let of: Vec<f64> = of.filter(|d_prime| d_prime.is_finite()).collect();
        (of.iter().map(|d| d * d).sum::<f64>() / of.len().max(1) as f64).sqrt()
    }

    /// What rows say. `columns` are those of all rows, those of the instrument among them; `weight` is what each row counts
    /// for.
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
        let Some(instrument) = Beside::new(&gram, &self.instrument, &self.truths) else { return discrimination };
        let Some(both) = Beside::new(&gram, &[&self.instrument[..], &self.frame[..]].concat(), &self.truths) else {
            return discrimination;
        };
        for rival in &self.rivals {
            // A frame that is the effect itself is no nuisance to it, nor one that is the rival.
            let beside = if rival.columns.iter().any(in_frame) { &instrument } else { &both };
            self.compare(rival, &instrument, &of_frame, &mut discrimination);
            self.compare(rival, beside, &others, &mut discrimination);
        }
        discrimination
    }

    /// What rows say of some truths against a rival, under each size of its prior.
    fn compare(&self, rival: &Rival, beside: &Beside, concerned: &[usize], discrimination: &mut Discrimination) {
        let own = &rival.columns;
        let inner = DMatrix::from_fn(own.len(), own.len(), |i, j| beside.gram[(own[i], own[j])]);
        let cross = DMatrix::from_fn(own.len(), concerned.len(), |i, t| beside.crosses[(own[i], concerned[t])]);
        let scales = if own.is_empty() { &SCALES[..1] } else { &SCALES[..] };
        for &scale in scales {
            let scaled = &inner * (scale * scale) + DMatrix::identity(own.len(), own.len());
            let Some(factor) = scaled.cholesky() else { continue };
            let occam = beside.occam + occam(&factor);
            let mut cross = &cross * scale;
            factor.l_dirty().solve_lower_triangular_mut(&mut cross);
            for (cross, &t) in cross.column_iter().zip(concerned) {
                let square = (beside.squares[t] - cross.norm_squared()).max(0.0);
                let at = (t, rival.kind);
                discrimination.evidence[at] = discrimination.evidence[at].max(-0.5 * square - occam - rival.price);
                if self.truths[t].kind != rival.kind {
                    discrimination.distance[at] = discrimination.distance[at].min(square.sqrt());
                }
            }
        }
    }

    /// What rows count for: those that `identify` will hold out count less.
    pub(super) fn row_weights(held_out: impl Iterator<Item = bool>) -> Vec<f64> {
        held_out.map(|held_out| if held_out { HELD_OUT } else { 1.0 }).collect()
    }

    /// Share of the truths that will not be named outright, by a normal approximation over their rivals; a little of what each
    /// pair adds to it. Less is better.
    pub(super) fn confusion(&self, discrimination: &Discrimination) -> f64 {
        let (mut missed, mut each) = (0.0, 0.0);
        // Evidence over a rival that a name needs, nats.
        let caution = caution(discrimination.scalars);
        let needed = (NAMED / (1.0 - NAMED)).ln() * caution;
        for (t, truth) in self.truths.iter().enumerate() {
            let mut named = 1.0;
            for kind in (0..=self.kinds.len()).filter(|&kind| kind != truth.kind) {
                let gain = discrimination.evidence[(t, truth.kind)] - discrimination.evidence[(t, kind)];
                let spread = discrimination.distance[(t, kind)].clamp(1.0, 1e3);
                let nested = self.kinds.get(kind).is_some_and(|kind| contains(kind, &self.kinds[truth.kind]));
                let needed = needed + if nested { caution } else { 0.0 };
                let taken = self.weights[(truth.kind, kind)] * normal_tail((gain - needed) / spread);
                named *= 1.0 - taken;
                each += taken;
            }
            missed += 1.0 - named;
        }
        (missed + EACH_PAIR * each) / self.truths.len().max(1) as f64
    }

    /// d′ of each pair of kinds: quadratic mean over the draws, the lesser of both ways.
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

/// ½ ln det of a precision, less what the noise in the data is fitted away (its trace, by the pivots).
fn occam(factor: &Cholesky<f64, Dyn>) -> f64 {
    factor.l_dirty().diagonal().iter().map(|d| d.ln() - 0.5 * (1.0 - 1.0 / (d * d))).sum()
}

/// What is left of everything beside some columns that may move under their priors: every rival stands beside the same few.
struct Beside {
    /// Products of the columns.
    gram: DMatrix<f64>,
    /// Products of each column with what each truth shows.
    crosses: DMatrix<f64>,
    /// Squared size of what each truth shows.
    squares: Vec<f64>,
    occam: f64,
}

impl Beside {
    /// Of a gram matrix over the noise: what is left of it by the Schur complement.
    fn new(gram: &DMatrix<f64>, moved: &[usize], truths: &[Truth]) -> Option<Self> {
        let mut inner = gram.select_columns(moved).select_rows(moved);
        (0..moved.len()).for_each(|i| inner[(i, i)] += 1.0);
        let factor = inner.cholesky()?;
        let mut taken = gram.select_rows(moved);
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

/// Share of a normal distribution beyond `at` standard deviations, by a logistic curve (within 0.01): its tail keeps a slope
/// that a search can follow.
fn normal_tail(at: f64) -> f64 {
    1.0 / (1.0 + (1.702 * at).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_rival_can_imitate_under_its_prior_is_taken_off() {
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
        // Shown (2, 2), over the noise (4, 4); the rival's column (2, 0): 32 − 8² / (1 + 4) is left.
        let columns = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 0.0]);
        let found = criterion.discrimination(&columns, &[1.0, 1.0]).distance;
        assert!((found[(0, 2)] - 32_f64.sqrt()).abs() < 1e-12);
        assert!((found[(0, 1)] - 19.2_f64.sqrt()).abs() < 1e-12);
        assert!(found[(0, 0)].is_infinite());
        // Half the weight is half the information.
        assert!((criterion.discrimination(&columns, &[0.5, 0.5]).distance[(0, 2)] - 4.0).abs() < 1e-12);
    }
}
