//! What is unmodelled, as a map: only if it holds on blocks that its fit has not seen.
//!
//! First a field over the place (kriging: a Gaussian process whose reach and size are those of most evidence), then
//! polynomials over the place or the joints. Either is `empirical` in the cell and claims no cause.

use super::candidate::{Candidate, Home, Shape};
use super::candidates;
use super::data::{Observation, Seen};
use super::engine::Engine;
use super::found::{MAP, Map, Posterior};
use super::noise::{self, Field, Over};
use super::pattern::Standing;
use super::score::in_standard_errors;
use super::search::Search;
use crate::effects::{FieldPlace, empirical_field, fade};
use nalgebra::{Cholesky, DMatrix, Dyn, Vector3};
use rayon::prelude::*;
use statrs::function::erf::erf;

/// Standard errors that a map must gain on unseen blocks: it will be used, and claims nothing else.
const HOLDS: f64 = 2.0;
/// Places that a field is made of at most: the work grows as their cube.
const MOST: usize = 600;
/// Reaches of a field, as parts of the area's diagonal.
const PARTS: [f64; 9] = [2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0];
/// Variances of a field over that of the white noise.
const SHARES: [f64; 4] = [0.5, 2.0, 8.0, 32.0];

/// What is left at a place, base axes, mm.
#[derive(Clone, Copy)]
struct Left {
    run: usize,
    order: usize,
    /// What is left out together.
    block: (usize, usize),
    weight: f64,
    place: FieldPlace,
    error: Vector3<f64>,
}

/// A field over some places, conditioned on what is left there.
struct Kriged<'a> {
    field: Field,
    left: &'a [Left],
    /// Of each place's bell, mm.
    shifts: Vec<Vector3<f64>>,
    /// Log evidence but for a constant, σ at its best, nats.
    evidence: f64,
}

impl Engine {
    /// Beside something unexplained, adds the map that holds on blocks that its fit has not seen, if one does.
    pub(super) fn add_map(&mut self, posteriors: &mut Vec<Posterior>) {
        // What goes with time is at no place: a map of it would be of the path as it was walked.
        if self.shape.drift > noise::MOST_WANDER {
            return;
        }
        self.map = self.field_map();
        if self.map.is_none() {
            self.add_polynomial(posteriors);
        }
    }

    /// The field over the place, if it holds.
    pub(super) fn field_map(&self) -> Option<Map> {
        let left = self.left()?;
        let [extent, ..] = self.problem.extents();
        let of = |part: &f64| SHARES.map(|share| Field { over: Over::Place, share, reach: extent / part });
        let fields: Vec<Field> = PARTS.iter().flat_map(of).collect();
        let tried: Vec<Kriged> = fields.par_iter().filter_map(|&field| self.kriged(&left, field)).collect();
        let best = tried.iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence))?;
        let mut blocks: Vec<(usize, usize)> = left.iter().map(|left| left.block).collect();
        blocks.dedup();
        let split = |block: &(usize, usize)| -> (Vec<Left>, Vec<Left>) { left.iter().partition(|l| l.block == *block) };
        // What is told of a block that was not seen holds as far from seen places as its own rows are.
        let apart = |block: &(usize, usize)| {
            let (own, others) = split(block);
            own.iter().map(|l| nearest(&others, &l.place)).collect::<Vec<_>>()
        };
        let mut distances: Vec<f64> = blocks.par_iter().flat_map_iter(apart).collect();
        distances.sort_by(f64::total_cmp);
        let within =
            distances.get(distances.len() / 2).copied().filter(|within| within.is_finite() && *within > 0.0)?;
        let gain = |block: &(usize, usize)| {
            let (own, others) = split(block);
            let kriged = self.kriged(&others, best.field);
            let gain = |l: &Left| {
                let there = kriged.as_ref().map_or_else(Vector3::zeros, |kriged| kriged.at(&l.place));
                let there = there * fade(nearest(&others, &l.place) / within);
                l.error.norm_squared() - (l.error - there).norm_squared()
            };
            own.iter().map(gain).sum::<f64>()
        };
        let gains: Vec<f64> = blocks.par_iter().map(gain).collect();
        let gain = in_standard_errors(&gains);
        /// Nats below the best at which a reach is ruled out: two standard deviations.
        const RULED_OUT: f64 = 2.0;
        let reaches = tried.iter().filter(|t| t.evidence > best.evidence - RULED_OUT).map(|t| t.field.reach);
        let bells: Vec<_> = best.left.iter().map(|left| left.place).zip(best.shifts.iter().copied()).collect();
        (gain > HOLDS).then(|| Map {
            effect: empirical_field(best.field.reach, within, &bells),
            reach_mm: best.field.reach,
            reaches_mm: reaches.fold([f64::INFINITY, 0.0], |[a, b], reach| [a.min(reach), b.max(reach)]),
            likely: likely(gain),
        })
    }

    /// What the chosen effects leave of the fitted rows, thinned; `None` where rows are no positions.
    fn left(&self) -> Option<Vec<Left>> {
        let residual = self.residual() - self.shifted_by(|pattern| pattern.standing() != Standing::Unlisted);
        let fitted = |row: &&Observation| !row.held_out && !row.outlier;
        let rows: Vec<&Observation> = self.problem.rows.iter().filter(fitted).collect();
        let of = |row: &&Observation| {
            let error = Vector3::from_iterator(residual.rows(row.offset, row.seen.len()).iter().copied());
            let base_from_wobj = self.problem.runs[row.run].base_from_wobj(row.point);
            Left {
                run: row.run,
                order: row.order,
                block: self.problem.validation_block(row),
                weight: row.weight * row.tail,
                place: self.problem.place_of(row),
                error: base_from_wobj.rotation * error,
            }
        };
        let whole = |row: &&Observation| matches!(row.seen, Seen::Position(_)) && row.seen.count() == row.seen.len();
        let positions = rows.iter().all(whole);
        positions.then(|| rows.iter().step_by(rows.len().div_ceil(MOST).max(1)).map(of).collect())
    }

    /// A field conditioned on what is left, beside the noise as it was found.
    fn kriged<'a>(&self, left: &'a [Left], field: Field) -> Option<Kriged<'a>> {
        let covariance = DMatrix::from_fn(left.len(), left.len(), |i, j| {
            let (a, b) = (&left[i], &left[j]);
            let white = if i == j { a.weight * a.weight } else { 0.0 };
            let drift = if a.run == b.run { self.shape.drifting(a.order.abs_diff(b.order)) } else { 0.0 };
            white + drift + field.covariance(&a.place.at, &b.place.at)
        });
        let factor: Cholesky<f64, Dyn> = covariance.cholesky()?;
        let errors = DMatrix::from_fn(left.len(), 3, |i, k| left[i].error[k]);
        let solved = factor.solve(&errors);
        let count = 3.0 * left.len() as f64;
        let log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let evidence = -0.5 * count * (errors.dot(&solved) / count).ln() - 3.0 * log_det;
        let shifts = solved.row_iter().map(|row| field.share * row.transpose().fixed_rows::<3>(0)).collect();
        Some(Kriged { field, left, shifts, evidence })
    }

    /// The polynomial that holds, if one does.
    fn add_polynomial(&mut self, posteriors: &mut Vec<Posterior>) {
        let survey = candidates::survey(&self.declared, &self.problem);
        let maps = crate::effects::kind(MAP).map_or_else(Vec::new, |kind| (kind.candidates)(&survey));
        let first = self.candidates.len();
        self.candidates.extend(
            maps.iter().map(|map| Candidate::new(map.as_ref(), Home::New(Shape(map.clone_box())), maps.len() as f64)),
        );
        let wanted: Vec<usize> = self.chosen.iter().copied().chain(first..self.candidates.len()).collect();
        let linear = self.linearise(&wanted, &[self.shape]);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let without = self.block_errors(&linear, &search.columns(&self.chosen));
        let gain = |c: usize| {
            let with = self.block_errors(&linear, &search.columns(&[&self.chosen[..], &[c]].concat()));
            let gains: Vec<f64> = without.iter().zip(&with).map(|(without, with)| without - with).collect();
            (in_standard_errors(&gains), c)
        };
        let best = (first..self.candidates.len()).map(gain).max_by(|a, b| a.0.total_cmp(&b.0));
        match best.filter(|(gain, _)| *gain > HOLDS) {
            Some((gain, c)) => {
                posteriors.push((c, (likely(gain), Vec::new())));
                self.choose([&self.chosen[..], &[c]].concat());
            }
            None => self.candidates.truncate(first),
        }
    }
}

impl Kriged<'_> {
    /// The field's mean, mm.
    fn at(&self, place: &FieldPlace) -> Vector3<f64> {
        let bell = |(left, shift): (&Left, &Vector3<f64>)| {
            shift * self.field.covariance(&place.at, &left.place.at) / self.field.share
        };
        self.left.iter().zip(&self.shifts).map(bell).sum()
    }
}

/// Distance to the nearest place, mm.
fn nearest(left: &[Left], place: &FieldPlace) -> f64 {
    left.iter().map(|l| l.place.apart(place)).fold(f64::INFINITY, f64::min)
}

/// How likely a gain of so many standard errors is one: of a name there is no question.
fn likely(gain: f64) -> f64 {
    0.5 * (1.0 + erf(gain / std::f64::consts::SQRT_2))
}
