//! Searches for gear harmonics in the residual: one term, which is a joint and an order, after another, and then each
//! term again together with the others.
//!
//! Orders are continuous, so that not every order can be a candidate. If a joint moves over a small part of a turn,
//! neighbouring orders look alike; the grid of orders is as coarse as that allows, and is refined near the terms that
//! are found.

use super::candidate::{Candidate, Home, Shape};
use super::data::Problem;
use super::decisions::PRICE;
use super::moments::ColumnSource;
use super::noise::{self, Sample, Series, Step};
use deflex_effects::gear_harmonic;
use deflex_lanes::{Lanes, SinCos, WIDTH, widest};
use deflex_robot::Joints;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Largest number of harmonics: the error of a gear that needs more is not made of a few harmonics.
const MOST_HARMONICS: usize = 4;
/// Finest step of orders. The stages of a reducer have whole or half orders, and the rows do not resolve quarters.
const FINEST: f64 = 0.25;
/// Number of periods that a joint must pass through. Over fewer a harmonic looks like a smooth curve, which makes the
/// weaker claim.
const LEAST_PERIODS: f64 = 1.7;
/// Largest number of harmonics of one joint.
const MOST_OF_JOINT: usize = 2;
/// Lowest order of the grid, periods for each turn; curves describe lower orders.
const LEAST_ORDER: f64 = 8.0;
/// Highest order of the grid, periods for each turn: the range has the numbers of teeth, pins and lobes of reducers.
const LARGEST_ORDER: f64 = 160.0;
/// Phase between neighbouring orders at the ends of the range of a joint, rad. An order between them loses less than an
/// eighth of its gain.
const PHASE: f64 = 0.35;
/// Half of the smallest range of a joint that can show a harmonic, rad.
const STILL: f64 = 1e-3;
/// Prior size of a harmonic in the search, rad.
const TYPICAL_RAD: f64 = 5e-5;
/// Number of times that every term is searched again together with the others.
const SWEEPS: usize = 2;

/// A harmonic: the index of its joint, from 0, and its order, periods for each turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Term {
    pub(super) joint: usize,
    pub(super) order: f64,
}

/// The whitened columns of every harmonic on the grid. They are kept from one search to the next while the noise and
/// the rows are the same.
pub(super) struct Grid {
    key: Key,
    terms: Vec<Term>,
    columns: Vec<Pair>,
    /// Products of the two columns of each term with one another, mm².
    grams: Vec<Matrix2<f64>>,
}

/// The cosine and the sine column of a term. They are in single precision because they are most of the memory of a
/// search, and because the terms that they propose are fitted again in double precision.
type Pair = [Box<[f32]>; 2];

/// All that the whitened columns depend on: the shape of the noise, the number of scalars, and a checksum of their
/// standard deviations.
type Key = (noise::Shape, usize, u64);

/// The search for harmonics in the fitted rows under one noise.
pub(super) struct Comb<'a> {
    grid: Option<Grid>,
    pub(super) problem: &'a Problem,
    /// Change of each scalar for an error of `TYPICAL_RAD` of each joint, mm.
    along: [DVector<f64>; 6],
    series: Vec<Series>,
    /// The steps of the Kalman filter that whitens each series.
    steps: Vec<Vec<Step>>,
    /// Index of the row of each scalar.
    row: Vec<usize>,
    /// 1/σ², mm⁻².
    precision: f64,
    /// Half of the range of each joint over the fitted rows, rad.
    half: Joints,
}

impl<'a> Comb<'a> {
    /// A search over the rows of a problem. `zero` is the candidate of the joints' zeros, whose columns in `design`
    /// give the change of each scalar with each joint angle. `known` is the grid of the last search.
    pub(super) fn new(
        problem: &'a Problem,
        design: &DMatrix<f64>,
        zero: &Candidate,
        (shape, sigma): (noise::Shape, f64),
        known: Option<Grid>,
    ) -> Self {
        let series = problem.series(|row| !row.held_out);
        let steps: Vec<Vec<Step>> = series.iter().map(|series| noise::steps(series, shape)).collect();
        let mut row = vec![0; problem.scalars];
        problem.rows.iter().enumerate().for_each(|(i, own)| row[own.scalars()].fill(i));
        let along = std::array::from_fn(|j| design.column(zero.first + j) * (TYPICAL_RAD / zero.typical[j]));
        let mut range = (Joints::repeat(f64::INFINITY), Joints::repeat(f64::NEG_INFINITY));
        for row in problem.rows.iter().filter(|row| !row.held_out) {
            range = (range.0.inf(&row.motor), range.1.sup(&row.motor));
        }
        let widths = series.iter().flat_map(|s| s.samples.iter().map(|&(row, _, width)| width * (1 + row) as f64));
        let key = (shape, steps.iter().map(Vec::len).sum(), widths.sum::<f64>().to_bits());
        let half = 0.5 * (range.1 - range.0);
        let mut comb = Self { grid: None, problem, along, series, steps, row, precision: sigma.powi(-2), half };
        comb.grid = Some(known.filter(|grid| grid.key == key).unwrap_or_else(|| comb.whitened_grid(key)));
        comb
    }

    /// The grid over all joints that move, with its whitened columns.
    fn whitened_grid(&self, key: Key) -> Grid {
        let terms = self.grid();
        let of = |columns: DMatrix<f64>| {
            #[allow(clippy::cast_possible_truncation)] // `Pair` says why single precision is enough.
            let single = |k: usize| columns.column(k).iter().map(|value| *value as f32).collect();
            let gram = Matrix2::from_fn(|i, j| columns.column(i).dot(&columns.column(j)));
            ([single(0), single(1)], gram)
        };
        let (columns, grams) = terms.par_chunks(4 * WIDTH).flat_map_iter(|terms| self.columns(terms)).map(of).unzip();
        Grid { key, terms, columns, grams }
    }

    /// The grid, for the next search.
    pub(super) fn into_grid(self) -> Option<Grid> {
        self.grid
    }

    /// The term of the grid that gains most in the residual of the terms that are found, and its gain, nats. The found
    /// terms keep their fitted numbers.
    fn best_of_grid(&self, crosses: &mut Crosses, found: &Fitted) -> Option<(Term, f64)> {
        let grid = self.grid.as_ref()?;
        let open = |term: &Term| found.terms.iter().filter(|other| other.joint == term.joint).count() < MOST_OF_JOINT;
        let taken: Vec<usize> = found.terms.iter().map(|&term| crosses.of(self, grid, term)).collect();
        let gain = |at: usize| {
            let mut cross = crosses.data[at];
            for (k, &of) in taken.iter().enumerate() {
                cross -= crosses.terms[of].1[at] * found.mean.fixed_rows::<2>(2 * k);
            }
            let cross = cross * self.precision;
            let matrix = Matrix2::identity() + grid.grams[at] * self.precision;
            matrix
                .try_inverse()
                .map_or(0.0, |inverse| 0.5 * (cross.dot(&(inverse * cross)) - matrix.determinant().ln()))
        };
        let gains = (0..grid.terms.len()).filter(|&at| open(&grid.terms[at])).map(|at| (gain(at), at));
        gains.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(gain, at)| (grid.terms[at], gain))
    }

    /// The whitened cosine and sine column of each term, over the fitted rows.
    fn columns(&self, terms: &[Term]) -> Vec<DMatrix<f64>> {
        let of_joints = terms.chunk_by(|a, b| a.joint == b.joint);
        let groups: Vec<&[Term]> = of_joints.flat_map(|terms| terms.chunks(WIDTH)).collect();
        let orders: Vec<(usize, Lanes)> = groups.iter().map(|terms| (terms[0].joint, orders(terms))).collect();
        let fill = |samples: &[Sample], block: &mut [f64]| {
            widest!(<'a, 'b> (
                comb: &'a Comb<'b> = self,
                orders: &'a [(usize, Lanes)] = &orders,
                samples: &'a [Sample] = samples,
                block: &'a mut [f64] = block,
            ) {
                for t in 0..samples.len() {
                    let scalar = samples[t].0;
                    let row = &comb.problem.rows[comb.row[scalar]];
                    for n in 0..orders.len() {
                        let (joint, order) = orders[n];
                        let (turned, along) = (SinCos::of(order * row.motor[joint]), comb.along[joint][scalar]);
                        let (cos, sin) = (turned.cos * along, turned.sin * along);
                        let from = 2 * WIDTH * (t * orders.len() + n);
                        for k in 0..WIDTH {
                            (block[from + k], block[from + WIDTH + k]) = (cos.0[k], sin.0[k]);
                        }
                    }
                }
            });
        };
        let white = self.white(&ColumnSource::new(2 * WIDTH * orders.len(), fill));
        let of_group = |(n, terms): (usize, &&[Term])| {
            let pair = |k: usize| white.select_columns(&[2 * WIDTH * n + k, 2 * WIDTH * n + WIDTH + k]);
            (0..terms.len()).map(pair).collect::<Vec<_>>()
        };
        groups.iter().enumerate().flat_map(of_group).collect()
    }

    /// The whitened columns of a source over the fitted rows, one series after another.
    fn white(&self, columns: &ColumnSource) -> DMatrix<f64> {
        let mut white = DMatrix::zeros(self.steps.iter().map(Vec::len).sum(), columns.width);
        let mut from = 0;
        for (series, steps) in self.series.iter().zip(&self.steps) {
            columns.whitened(series, std::slice::from_ref(steps), |_, block| {
                white.rows_mut(from, block.ncols()).tr_copy_from(block);
                from += block.ncols();
            });
        }
        white
    }

    /// Log evidence that the columns add to none, nats, and their fitted numbers, in prior sizes.
    fn fitted(&self, columns: &DMatrix<f64>, data: &DMatrix<f64>) -> (f64, DVector<f64>) {
        let size = columns.ncols();
        let gram = DMatrix::identity(size, size) + columns.tr_mul(columns) * self.precision;
        let cross = columns.tr_mul(data) * self.precision;
        let Some(factor) = gram.cholesky() else { return (0.0, DVector::zeros(size)) };
        let mean = factor.solve(&cross);
        let half_log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        (0.5 * cross.dot(&mean) - half_log_det, mean.column(0).into_owned())
    }

    /// Step of the orders of a joint on the grid.
    fn step(&self, joint: usize) -> f64 {
        (PHASE / self.half[joint]).clamp(FINEST, 4.0)
    }

    /// Lowest order of which a joint passes through enough periods.
    fn lowest_order(&self, joint: usize) -> f64 {
        (LEAST_PERIODS * TAU / (2.0 * self.half[joint])).max(LEAST_ORDER)
    }

    /// The terms of the grid for all joints that move.
    fn grid(&self) -> Vec<Term> {
        let of_joint = |joint: usize| {
            let step = self.step(joint);
            std::iter::successors(Some(self.lowest_order(joint)), move |order| Some(order + step))
                .take_while(|order| *order <= LARGEST_ORDER)
                .map(move |order| Term { joint, order })
        };
        (0..6).filter(|joint| self.half[*joint] > STILL).flat_map(of_joint).collect()
    }

    /// The term that gains most in a residual, and its gain, nats.
    fn best(&self, terms: &[Term], left: &DMatrix<f64>) -> Option<(Term, f64)> {
        let gains: Vec<f64> = self.columns(terms).iter().map(|columns| self.fitted(columns, left).0).collect();
        let at = (0..terms.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]))?;
        Some((terms[at], gains[at]))
    }

    /// The term with the order near that of `term` that gains most in a residual.
    fn refined(&self, term: Term, left: &DMatrix<f64>) -> Term {
        let (step, least) = (self.step(term.joint), self.lowest_order(term.joint));
        let near = |k: i32| Term { order: (term.order + f64::from(k) * step / 4.0).max(least), ..term };
        let near: Vec<Term> = (-6..=6).map(near).collect();
        let coarse = self.best(&near, left).map_or(term, |best| best.0);
        // The last step tries multiples of a quarter, because the numbers of teeth of gears are whole.
        let quarter = (coarse.order / FINEST).round() * FINEST;
        let fine = |k: i32| Term { order: (quarter + f64::from(k) * FINEST).max(least), ..term };
        let fine: Vec<Term> = (-3..=3).map(fine).collect();
        self.best(&fine, left).map_or(coarse, |best| best.0)
    }

    /// The terms without the one at `but`, fitted to data: the log evidence that they add to none, nats, their
    /// residual, and their numbers.
    fn without(&self, terms: &[Term], but: Option<usize>, data: &DMatrix<f64>) -> (f64, DMatrix<f64>, Fitted) {
        let terms: Vec<Term> =
            terms.iter().enumerate().filter(|(i, _)| Some(*i) != but).map(|(_, &term)| term).collect();
        let parts: Vec<DVector<f64>> = terms
            .iter()
            .flat_map(|&term| self.columns(&[term]))
            .flat_map(|pair| [pair.column(0).into_owned(), pair.column(1).into_owned()])
            .collect();
        if parts.is_empty() {
            return (0.0, data.clone(), Fitted { terms, mean: DVector::zeros(0) });
        }
        let columns = DMatrix::from_columns(&parts);
        let (value, mean) = self.fitted(&columns, data);
        let mut left = data.clone();
        left.column_mut(0).gemv(-1.0, &columns, &mean, 1.0);
        (value, left, Fitted { terms, mean })
    }

    /// The terms that gain enough in a residual, in the order in which they were found, and the number of terms of the
    /// grid, from which each was chosen.
    pub(super) fn terms(&self, residual: &DVector<f64>) -> (Vec<Term>, f64) {
        let data = self.white(&ColumnSource::stacked(&DMatrix::from_columns(std::slice::from_ref(residual))));
        let looked_at = self.grid.as_ref().map_or(1, |grid| grid.terms.len().max(1)) as f64;
        let price = PRICE + looked_at.ln();
        let mut crosses = Crosses::new(self.grid.as_ref(), &data);
        let mut found = Fitted { terms: Vec::new(), mean: DVector::zeros(0) };
        let (mut value, mut left) = (0.0, data.clone());
        while found.terms.len() < MOST_HARMONICS {
            let Some((next, gain)) = self.best_of_grid(&mut crosses, &found) else { break };
            if gain < 0.5 * price {
                break;
            }
            let mut more = [&found.terms[..], &[self.refined(next, &left)]].concat();
            for _ in 0..SWEEPS {
                for i in 0..more.len() {
                    let (_, rest, others) = self.without(&more, Some(i), &data);
                    // The term may be an alias of one that was not found before, so that the whole grid is searched
                    // again.
                    let again = self.best_of_grid(&mut crosses, &others).map_or(more[i], |best| best.0);
                    let again = self.refined(again, &rest);
                    let [mine, other] =
                        [more[i], again].map(|term| self.best(&[term], &rest).map_or(0.0, |best| best.1));
                    if other > mine + 1e-6 {
                        more[i] = again;
                    }
                }
            }
            let (now, rest, fitted) = self.without(&more, None, &data);
            if now - value < price {
                break;
            }
            (value, left, found) = (now, rest, fitted);
        }
        (found.terms, looked_at)
    }
}

/// Terms with their fitted numbers, two for each term, in prior sizes.
struct Fitted {
    terms: Vec<Term>,
    mean: DVector<f64>,
}

/// Products of the columns of the grid with the data and with the terms that were found. With them the gains of the
/// whole grid in the residual of any of these terms need no pass over the rows.
struct Crosses {
    data: Vec<Vector2<f64>>,
    terms: Vec<(Term, Vec<Matrix2<f64>>)>,
}

impl Crosses {
    fn new(grid: Option<&Grid>, data: &DMatrix<f64>) -> Self {
        let cross = |columns: &Pair| Vector2::from_fn(|i, _| dot_of_single(&columns[i], data.as_slice()));
        Self {
            data: grid.map_or_else(Vec::new, |grid| grid.columns.par_iter().map(cross).collect()),
            terms: Vec::new(),
        }
    }

    /// Index of the products of a term, which are computed if they are not known.
    fn of(&mut self, comb: &Comb, grid: &Grid, term: Term) -> usize {
        self.terms.iter().position(|(known, _)| *known == term).unwrap_or_else(|| {
            let own = comb.columns(&[term]).swap_remove(0);
            let own = [0, 1].map(|j| own.column(j).into_owned());
            let cross = |columns: &Pair| Matrix2::from_fn(|i, j| dot_of_single(&columns[i], own[j].as_slice()));
            self.terms.push((term, grid.columns.par_iter().map(cross).collect()));
            self.terms.len() - 1
        })
    }
}

/// The orders of up to [`WIDTH`] terms as lanes; the last order fills the remaining lanes.
fn orders(terms: &[Term]) -> Lanes {
    Lanes(std::array::from_fn(|k| terms[k.min(terms.len() - 1)].order))
}

/// Scalar product of a vector in single precision and one in double precision. It adds in the same order on every
/// processor.
fn dot_of_single(a: &[f32], b: &[f64]) -> f64 {
    let mut sums = [0.0; WIDTH];
    let ((left, a), (right, b)) = (a.as_chunks::<WIDTH>(), b.as_chunks::<WIDTH>());
    widest!(<'a> (
        sums: &'a mut [f64; WIDTH] = &mut sums,
        left: &'a [[f32; WIDTH]] = left,
        right: &'a [[f64; WIDTH]] = right,
    ) {
        for n in 0..left.len().min(right.len()) {
            for k in 0..WIDTH {
                sums[k] += left[n][k] as f64 * right[n][k];
            }
        }
    });
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * b).sum::<f64>() + sums.iter().sum::<f64>()
}

/// The candidate of these terms, each of which was chosen from `looked_at` terms.
pub(super) fn candidate(terms: &[Term], looked_at: f64) -> Candidate {
    let named: Vec<(usize, f64)> = terms.iter().map(|term| (term.joint + 1, term.order)).collect();
    let effect = gear_harmonic(&named);
    let home = Home::New(Shape(effect.clone_box()));
    let variants = looked_at.powi(i32::try_from(terms.len()).unwrap_or(1));
    Candidate::new(effect.as_ref(), home, variants)
}

/// The terms of a gear candidate.
pub(super) fn terms_of(candidate: &Candidate) -> Vec<Term> {
    let Home::New(shape) = &candidate.home else { return Vec::new() };
    let table = shape.0.to_table();
    let number =
        |term: &toml::Value, key: &str| term.get(key).and_then(|v| v.as_float().or(v.as_integer().map(|i| i as f64)));
    let all = table.get("terms").and_then(toml::Value::as_array).into_iter().flatten();
    all.filter_map(|term| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // joints are 1 to 6
        Some(Term { joint: number(term, "joint")? as usize - 1, order: number(term, "order")? })
    })
    .collect()
}
