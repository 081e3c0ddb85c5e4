//! Evidence of columns, σ profiled, where many sets begin with the same ones.
//!
//! With θ ~ N(0, τ²) about neutral and Gaussian noise, the marginal likelihood of the data is
//! `−n ln σ − ½ yᵀy/σ² + ½ (b/σ²)ᵀ(I + G/σ²)⁻¹(b/σ²) − ½ ln det(I + G/σ²)`, G and b over the prior sizes. It takes a Cholesky
//! factor for each σ. Sets that a search compares differ in their last member: the others' rows of the factor are the same, and
//! are kept for every σ that is needed. σ is taken on a grid; between its nodes only what hardly changes is
//! interpolated: what the columns explain, mm², and the log determinant.

use super::columns::Columns;
use super::factor::{Factor, Part, within_limits};
use super::moments::Moments;
use std::collections::BTreeMap;

/// Noise below this is not believed, mm: no instrument measures a robot to a tenth of a micrometre.
pub(super) const LEAST_SIGMA: f64 = 1e-4;

/// How well an instrument's declared standard deviation is known, as a share of it.
const DECLARED: f64 = 0.15;

/// Distance of the grid's nodes in ln σ: of 1,584 sets of a plant's cell none is off by more than 0.035 nats, half by less than 0.0005.
const STEP: f64 = 0.05;

/// Evidence of columns for one shape with σ at its best, searched from a guess where there is one, and that σ.
pub(super) fn profiled(moments: &Moments, columns: &Columns, guess: Option<f64>) -> (f64, f64) {
    let mut profile = Profile::new(Columns::default());
    let (_, sigma) = profile.beside(moments, columns, guess);
    // Where no other set is to share it, the factor of σ itself is as cheap as a node's.
    let part = Part::new(moments, &profile.columns, columns);
    let none = Factor::default();
    let Some(factor) = none.extended(&part, sigma.powi(-2)) else { return (f64::NEG_INFINITY, sigma) };
    let level = Level::new(moments, &profile.columns, columns);
    let value = level.at(sigma.ln(), level.explained(factor.square(), sigma), factor.half_log_det);
    (value + within_limits(&none, &profile.columns, &factor, columns), sigma)
}

/// Evidence of sets that begin with the same columns, for one shape of the noise.
pub(super) struct Profile {
    columns: Columns,
    /// Of these columns.
    factors: Factors,
}

/// By node; `None` where there is none.
type Factors = BTreeMap<i32, Option<Factor>>;

/// What a node knows of columns in addition to those of a profile.
struct Node {
    /// Of the data's square, mm².
    explained: f64,
    half_log_det: f64,
    /// Rows of the further columns.
    factor: Factor,
}

impl Profile {
    pub(super) fn new(columns: Columns) -> Self {
        Self { columns, factors: BTreeMap::new() }
    }

    /// Evidence with further columns after its own where the noise that is left settles, bounds left out.
    pub(super) fn roughly(&mut self, moments: &Moments, more: &Columns, guess: Option<f64>) -> f64 {
        let Self { columns, factors } = self;
        let (level, part) = (Level::new(moments, columns, more), Part::new(moments, columns, more));
        let mut nodes = BTreeMap::new();
        let Ok(node) = settled(factors, &level, &part, &mut nodes, guess) else { return f64::NEG_INFINITY };
        let of = |asked: &Node| level.at(f64::from(node) * STEP, asked.explained, asked.half_log_det);
        nodes.get(&node).and_then(Option::as_ref).map_or(f64::NEG_INFINITY, of)
    }

    /// Evidence with further columns after its own and σ at its best, and that σ; the moments are always the same.
    pub(super) fn beside(&mut self, moments: &Moments, more: &Columns, guess: Option<f64>) -> (f64, f64) {
        /// Steps to the top at most: where a declared noise holds against the data, it may be far.
        const STEPS: usize = 200;
        let Self { columns, factors } = self;
        let columns = &*columns;
        let level = Level::new(moments, columns, more);
        let part = Part::new(moments, columns, more);
        let mut nodes: BTreeMap<i32, Option<Node>> = BTreeMap::new();
        let least = node_of(LEAST_SIGMA);
        let mut node = match settled(factors, &level, &part, &mut nodes, guess) {
            Ok(node) => node,
            Err(node) => return (f64::NEG_INFINITY, sigma_of(node)),
        };
        let mut value = |node: i32| {
            let asked = nodes.entry(node).or_insert_with(|| new_node(factors, &level, &part, node));
            let of = |asked: &Node| level.at(f64::from(node) * STEP, asked.explained, asked.half_log_det);
            asked.as_ref().map_or(f64::NEG_INFINITY, of)
        };
        for _ in 0..STEPS {
            let (left, here, right) = (value(node - 1), value(node), value(node + 1));
            if right > here && right >= left {
                node += 1;
            } else if left > here && node > least {
                node -= 1;
            } else {
                break;
            }
        }
        let here = value(node);
        let around = [node - 1, node, node + 1].map(|node| nodes.get(&node).and_then(Option::as_ref));
        let [Some(left), Some(middle), Some(right)] = around else { return (here, sigma_of(node)) };
        let explained = Parabola::through([left, middle, right].map(|node| node.explained));
        let half_log_det = Parabola::through([left, middle, right].map(|node| node.half_log_det));
        let at = level.top(node, &explained, &half_log_det);
        let log_sigma = (f64::from(node) + at) * STEP;
        let evidence = level.at(log_sigma, explained.at(at), half_log_det.at(at));
        let (from, low, high) = if at < 0.0 { (node - 1, left, middle) } else { (node, middle, right) };
        let limits = |node: i32, asked: &Node| {
            let factor = factors.get(&node).and_then(Option::as_ref);
            factor.map_or(0.0, |factor| within_limits(factor, columns, &asked.factor, more))
        };
        let (low, high) = (limits(from, low), limits(from + 1, high));
        let share = f64::from(node - from) + at;
        (evidence + low + share * (high - low), log_sigma.exp().max(LEAST_SIGMA))
    }
}

/// The node at which the noise that is left settles; where there is none, the one that has no factor.
fn settled(
    factors: &mut Factors,
    level: &Level,
    part: &Part,
    nodes: &mut BTreeMap<i32, Option<Node>>,
    guess: Option<f64>,
) -> Result<i32, i32> {
    const JUMPS: usize = 20;
    let least = node_of(LEAST_SIGMA);
    let mut node = node_of(guess.unwrap_or_else(|| level.left(0.0))).max(least);
    for _ in 0..JUMPS {
        let asked = nodes.entry(node).or_insert_with(|| new_node(factors, level, part, node));
        let next = node_of(level.left(asked.as_ref().ok_or(node)?.explained)).max(least);
        if (next - node).abs() <= 1 {
            return Ok(node);
        }
        node = next;
    }
    nodes.entry(node).or_insert_with(|| new_node(factors, level, part, node)).as_ref().map(|_| node).ok_or(node)
}

/// What a node knows of the part's columns in addition to those before it, whose factors are kept.
fn new_node(factors: &mut Factors, level: &Level, part: &Part, node: i32) -> Option<Node> {
    let (none, precision) = (Columns::default(), sigma_of(node).powi(-2));
    let own = || Factor::default().extended(&Part::new(level.moments, &none, part.before), precision);
    let own = factors.entry(node).or_insert_with(own).as_ref()?;
    let factor = own.extended(part, precision)?;
    let explained = level.explained(own.square() + factor.square(), sigma_of(node));
    Some(Node { explained, half_log_det: own.half_log_det + factor.half_log_det, factor })
}

#[allow(clippy::cast_possible_truncation)] // logarithms of numbers
fn node_of(sigma: f64) -> i32 {
    (sigma.max(f64::MIN_POSITIVE).ln() / STEP).round() as i32
}

fn sigma_of(node: i32) -> f64 {
    (f64::from(node) * STEP).exp()
}

/// What evidence is made of but for the columns' own.
struct Level<'a> {
    moments: &'a Moments,
    /// Of the prior's precision.
    half_log_det: f64,
    /// Square of the priors' means.
    expected: f64,
}

impl<'a> Level<'a> {
    fn new(moments: &'a Moments, columns: &Columns, more: &Columns) -> Self {
        let expected = columns.means.iter().chain(&more.means).map(|(_, mean)| mean * mean).sum();
        Self { moments, half_log_det: columns.half_log_det() + more.half_log_det(), expected }
    }

    /// What columns explain of the data's square, mm², by the square of L⁻¹ of the right side.
    fn explained(&self, square: f64, sigma: f64) -> f64 {
        (square - self.expected) * sigma * sigma
    }

    fn at(&self, log_sigma: f64, explained: f64, half_log_det: f64) -> f64 {
        let Moments { square, count, log_scale, shape, declared, .. } = self.moments;
        let off = |declared: f64| (log_sigma - declared.ln()) / DECLARED;
        let declared = declared.map_or(0.0, |declared| -0.5 * off(declared).powi(2));
        let left = 0.5 * (square - explained) * (-2.0 * log_sigma).exp();
        -(*count as f64) * log_sigma - left - half_log_det - log_scale
            + shape.log_prior()
            + declared
            + self.half_log_det
    }

    /// Standard deviation of what is left, mm.
    fn left(&self, explained: f64) -> f64 {
        let variance = (self.moments.square - explained) / (self.moments.count as f64).max(1.0);
        variance.max(LEAST_SIGMA * LEAST_SIGMA).sqrt()
    }

    /// Where the evidence is most about a node, nodes from it (Newton's method).
    fn top(&self, node: i32, explained: &Parabola, half_log_det: &Parabola) -> f64 {
        const NEWTON_STEPS: usize = 6;
        let (n, mut at) = (self.moments.count as f64, 0.0f64);
        for _ in 0..NEWTON_STEPS {
            let log_sigma = (f64::from(node) + at) * STEP;
            let precision = (-2.0 * log_sigma).exp();
            let left = self.moments.square - explained.at(at);
            let (gained, turned) = (explained.slope(at), half_log_det.slope(at));
            let off = self.moments.declared.map_or(0.0, |declared| (log_sigma - declared.ln()) / DECLARED.powi(2));
            let slope = -n + (left + 0.5 * gained) * precision - turned - off;
            let bend = (0.5 * explained.bend() - 2.0 * gained - 2.0 * left) * precision
                - half_log_det.bend()
                - self.moments.declared.map_or(0.0, |_| DECLARED.powi(-2));
            if bend >= 0.0 {
                break;
            }
            at = (at - slope / bend / STEP).clamp(-1.0, 1.0);
        }
        at.max(LEAST_SIGMA.ln() / STEP - f64::from(node))
    }
}

/// A parabola through values at a node and its neighbours; derivatives are by ln σ.
struct Parabola {
    middle: f64,
    linear: f64,
    square: f64,
}

impl Parabola {
    fn through([left, middle, right]: [f64; 3]) -> Self {
        Self { middle, linear: 0.5 * (right - left), square: 0.5 * (right + left) - middle }
    }

    fn at(&self, at: f64) -> f64 {
        self.middle + at * (self.linear + at * self.square)
    }

    fn slope(&self, at: f64) -> f64 {
        (self.linear + 2.0 * at * self.square) / STEP
    }

    fn bend(&self) -> f64 {
        2.0 * self.square / (STEP * STEP)
    }
}

#[cfg(test)]
mod tests {
    use super::super::factor::log_normal_between;
    use super::super::noise::{Series, Shape};
    use super::super::score::posterior;
    use super::*;
    use nalgebra::{DMatrix, DVector, Vector3};

    const WHITE: Shape = Shape { drift: 0.0, correlation: 0.0, field: None };

    /// Evidence at a σ from the formula itself.
    fn formula(moments: &Moments, columns: &Columns, sigma: f64) -> f64 {
        let (p, size) = (sigma.powi(-2), columns.list.len());
        let matrix = DMatrix::identity(size, size) + columns.gram(moments) * p;
        let b: DVector<f64> = columns.cross(moments) * p;
        let explained = b.dot(&(matrix.clone().try_inverse().unwrap() * &b));
        let (mean, covariance) = posterior(moments, columns, sigma).unwrap();
        let of = |&(i, low, high): &(usize, f64, f64)| {
            let spread = covariance[(i, i)].sqrt();
            log_normal_between((low - mean[i]) / spread, (high - mean[i]) / spread) - log_normal_between(low, high)
        };
        -(moments.count as f64) * sigma.ln() - 0.5 * moments.square * p + 0.5 * explained
            - 0.5 * matrix.determinant().ln()
            + columns.limits.iter().map(of).sum::<f64>()
    }

    #[test]
    fn evidence_beside_shared_columns_is_that_of_all() {
        let rows = 240;
        let rough = |i: usize| {
            let x = (i as f64 * 12.9898).sin() * 43_758.545;
            x - x.floor() - 0.5
        };
        // The last column is the data: some of the first, third and fifth, and what is rough.
        let stacked = DMatrix::from_fn(rows, 8, |i, j| {
            let column = |j: usize| (0.07 * (i * (j + 1)) as f64).sin() + 0.4 * rough(i + 97 * j);
            if j < 7 { column(j) } else { column(0) - 0.3 * column(2) + 0.05 * column(4) + 0.3 * rough(i + 1_000) }
        });
        let samples = (0..rows).map(|t| (t, t, 1.0)).collect();
        let series = [Series { samples, places: vec![[Vector3::zeros(); 3]; rows].into() }];
        let moments = Moments::of(&stacked, &series, WHITE);
        let list = |columns: &[usize], limits: Vec<(usize, f64, f64)>| {
            let list = columns.iter().map(|&c| (c, 0.5 + 0.1 * c as f64)).collect();
            Columns { limits, ..Columns::independent(list) }
        };
        let mut profile = Profile::new(list(&[0, 1, 2], vec![(1, 0.0, f64::INFINITY), (2, f64::NEG_INFINITY, 0.0)]));
        for more in [vec![], vec![3], vec![4, 5, 6]] {
            let bounds: Vec<_> = more.iter().enumerate().map(|(k, _)| (k, -0.2, 0.1)).collect();
            // The same from a guess far off.
            for guess in [None, Some(1e-3), Some(3.0)] {
                let (evidence, sigma) = profile.beside(&moments, &list(&more, bounds.clone()), guess);
                let all = [&[0, 1, 2][..], &more].concat();
                let behind = bounds.iter().map(|&(k, low, high)| (k + 3, low, high));
                let all = list(&all, profile.columns.limits.iter().copied().chain(behind).collect());
                assert!((evidence - formula(&moments, &all, sigma)).abs() < 1e-3, "{more:?} {guess:?}");
                // At the top but for the bounds' share.
                let free = Columns { limits: Vec::new(), ..all.clone() };
                let here = formula(&moments, &free, sigma);
                assert!([0.98, 1.02].iter().all(|off| formula(&moments, &free, off * sigma) < here));
                let (alone, there) = profiled(&moments, &all, guess);
                assert!((alone - formula(&moments, &all, there)).abs() < 1e-9 && (there / sigma - 1.0).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn columns_that_hold_nothing_have_no_factor() {
        let moments = Moments::of(
            &DMatrix::from_element(1, 2, f64::NAN),
            &[Series { samples: vec![(0, 0, 1.0)], places: [[Vector3::zeros(); 3]].into() }],
            WHITE,
        );
        assert!(profiled(&moments, &Columns::independent(vec![(0, 1.0)]), Some(0.1)).0.is_infinite());
    }

    #[test]
    fn a_prior_about_one_draws_there_and_its_evidence_is_that_of_the_data_about_it() {
        // Two scalars of 1.4 and 0.3 on the column (1, 0): about 1 with a spread of 0.5, σ = 0.5, the mean is halfway, 1.2.
        let stacked = DMatrix::from_row_slice(2, 2, &[1.0, 1.4, 0.0, 0.3]);
        let series = [Series { samples: vec![(0, 0, 1.0), (1, 1, 1.0)], places: [[Vector3::zeros(); 3]; 2].into() }];
        let shape = Shape { drift: 0.0, correlation: 0.0, field: None };
        let moments = Moments::of(&stacked, &series, shape);
        let about_one = Columns { means: vec![(0, 2.0)], ..Columns::independent(vec![(0, 0.5)]) };
        let (mean, _) = posterior(&moments, &about_one, 0.5).unwrap();
        assert!((0.5 * mean[0] - 1.2).abs() < 1e-12);
        // The same as data of 0.4 with a prior about zero.
        let shifted = Moments::of(&DMatrix::from_row_slice(2, 2, &[1.0, 0.4, 0.0, 0.3]), &series, shape);
        let about_zero = Columns::independent(vec![(0, 0.5)]);
        let evidence = |moments: &Moments, columns: &Columns| profiled(moments, columns, Some(0.3)).0;
        assert!((evidence(&moments, &about_one) - evidence(&shifted, &about_zero)).abs() < 1e-6);
    }
}
