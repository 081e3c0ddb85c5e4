//! Log evidence of sets of columns, maximised over the standard deviation σ of the noise.
//!
//! With θ ~ N(0, τ²) about neutral and Gaussian noise, the log marginal likelihood of n scalars y is, except for a
//! constant, `−n ln σ − ½ yᵀy/σ² + ½ (b/σ²)ᵀ(I + G/σ²)⁻¹(b/σ²) − ½ ln det(I + G/σ²)`, where G = XᵀX and b = Xᵀy are
//! scaled by the prior sizes τ. Each σ needs a Cholesky factor. The sets that a search compares differ only in their
//! last member, so the rows of the factor that belong to the other members are kept for every σ that is needed. σ lies
//! on a grid. Between its nodes two smooth quantities are interpolated: the sum of squares that the columns explain,
//! mm², and the log determinant.

use super::columns::Columns;
use super::factor::{ColumnBlock, Factor, evidence_of_bounds, most_of_bounds};
use super::moments::Moments;
use std::collections::BTreeMap;

/// Smallest standard deviation of the noise, mm: no instrument measures a robot to a tenth of a micrometre.
pub(super) const LEAST_SIGMA: f64 = 1e-4;

/// Prior standard deviation of ln σ about the logarithm of the σ that the table declares.
const DECLARED_SPREAD: f64 = 0.15;

/// Spacing of the grid's nodes in ln σ. On 1,584 sets of one cell of the plant the error of the evidence is at most
/// 0.035 nats, and less than 0.0005 nats for half of them.
const STEP: f64 = 0.05;

/// Log evidence of columns under one shape of the noise, nats, and the σ that maximises it, mm. The search begins at
/// `guess` if there is one.
pub(super) fn profiled(moments: &Moments, columns: &Columns, guess: Option<f64>) -> (f64, f64) {
    let (shared, none) = (Columns::default(), Factor::default());
    let (evidence, block) = (LogEvidence::new(moments, &shared, columns), ColumnBlock::new(moments, &shared, columns));
    let sigma = match Maximum::of(&mut Factors::new(), &evidence, &block, guess) {
        Ok(maximum) => maximum.sigma(),
        Err(sigma) => sigma,
    };
    // No other set shares this factor, so a factor at σ itself costs no more than one at a node and needs no
    // interpolation.
    let Some(factor) = none.extended(&block, sigma.powi(-2)) else { return (f64::NEG_INFINITY, sigma) };
    let value = evidence.value(sigma.ln(), evidence.explained(factor.square(), sigma), factor.half_log_det);
    (value + evidence_of_bounds(&none, &shared, &factor, columns), sigma)
}

/// Evidence of sets that share their first columns, under one shape of the noise.
pub(super) struct Profile {
    columns: Columns,
    /// Factors of these columns.
    factors: Factors,
}

/// Cholesky factors by node; `None` where the matrix is not positive definite.
type Factors = BTreeMap<i32, Option<Factor>>;

/// The terms of the evidence of a set at one node.
struct NodeTerms {
    /// The part of yᵀy that the columns explain, mm².
    explained: f64,
    /// Half the log determinant of the posterior precision.
    half_log_det: f64,
    /// Rows of the columns that follow the shared ones.
    factor: Factor,
}

impl Profile {
    pub(super) fn new(columns: Columns) -> Self {
        Self { columns, factors: BTreeMap::new() }
    }

    /// Approximate log evidence of the shared columns together with `more`, nats. It is that of the node at which σ
    /// equals the standard deviation of the residual, and it leaves out the bounds of the numbers.
    pub(super) fn approximate_evidence_with(&mut self, moments: &Moments, more: &Columns, guess: Option<f64>) -> f64 {
        let Self { columns, factors } = self;
        let (evidence, block) = (LogEvidence::new(moments, columns, more), ColumnBlock::new(moments, columns, more));
        let mut nodes = BTreeMap::new();
        let Ok(node) = settled_node(factors, &evidence, &block, &mut nodes, guess) else { return f64::NEG_INFINITY };
        let of = |terms: &NodeTerms| evidence.value(f64::from(node) * STEP, terms.explained, terms.half_log_det);
        nodes.get(&node).and_then(Option::as_ref).map_or(f64::NEG_INFINITY, of)
    }

    /// Log evidence of the shared columns together with `more`, nats, and the σ that maximises it without the bounds of
    /// the numbers, mm. The evidence is `None` if it is at most `least`. Every call must have the same moments, because
    /// the factors of the shared columns are kept.
    pub(super) fn evidence_above(
        &mut self,
        moments: &Moments,
        more: &Columns,
        guess: Option<f64>,
        least: f64,
    ) -> (Option<f64>, f64) {
        let Self { columns, factors } = self;
        let (evidence, block) = (LogEvidence::new(moments, columns, more), ColumnBlock::new(moments, columns, more));
        let maximum = match Maximum::of(factors, &evidence, &block, guess) {
            Ok(maximum) => maximum,
            Err(sigma) => return (None, sigma),
        };
        let sigma = maximum.sigma();
        if maximum.evidence + most_of_bounds(columns, more) <= least {
            return (None, sigma);
        }
        let bounds = |node: &i32, terms: &NodeTerms| {
            let factor = factors.get(node).and_then(Option::as_ref);
            factor.map_or(0.0, |factor| evidence_of_bounds(factor, columns, &terms.factor, more))
        };
        let of_bounds = maximum.between.as_ref().map_or(0.0, |[(low, below), (high, above)]| {
            let (below, above) = (bounds(low, below), bounds(high, above));
            below + (maximum.at - f64::from(*low)) * (above - below)
        });
        (Some(maximum.evidence + of_bounds).filter(|evidence| *evidence > least), sigma)
    }
}

/// The maximum of the evidence over σ, without the bounds of the numbers.
struct Maximum {
    /// Its place on the grid, in nodes.
    at: f64,
    /// Log evidence there, nats.
    evidence: f64,
    /// The nodes between which it is; `None` if it is the value of one node alone.
    between: Option<[(i32, NodeTerms); 2]>,
}

impl Maximum {
    /// The maximum for the columns of a block and those that precede it. An error is the σ, mm, at which their matrix is not positive
    /// definite.
    fn of(
        factors: &mut Factors,
        log_evidence: &LogEvidence,
        block: &ColumnBlock,
        guess: Option<f64>,
    ) -> Result<Self, f64> {
        /// Largest number of steps to the maximum. It can be far from the residual's σ where the declared σ contradicts
        /// the data.
        const STEPS: usize = 200;
        let mut nodes: BTreeMap<i32, Option<NodeTerms>> = BTreeMap::new();
        let least = node_of(LEAST_SIGMA);
        let mut node = settled_node(factors, log_evidence, block, &mut nodes, guess).map_err(sigma_of)?;
        let mut value = |node: i32| {
            let terms = nodes.entry(node).or_insert_with(|| node_terms(factors, log_evidence, block, node));
            let of =
                |terms: &NodeTerms| log_evidence.value(f64::from(node) * STEP, terms.explained, terms.half_log_det);
            terms.as_ref().map_or(f64::NEG_INFINITY, of)
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
        let [Some(left), Some(middle), Some(right)] =
            [node - 1, node, node + 1].map(|node| nodes.remove(&node).flatten())
        else {
            // Next to a node of a matrix that rounding makes indefinite, nothing can be interpolated.
            return if here.is_finite() {
                Ok(Self { at: f64::from(node), evidence: here, between: None })
            } else {
                Err(sigma_of(node))
            };
        };
        let around = [left, middle, right];
        let explained = Parabola::through(around.each_ref().map(|node| node.explained));
        let half_log_det = Parabola::through(around.each_ref().map(|node| node.half_log_det));
        let off = log_evidence.maximum(node, &explained, &half_log_det);
        let at = f64::from(node) + off;
        let evidence = log_evidence.value(at * STEP, explained.value(off), half_log_det.value(off));
        let [left, middle, right] = around;
        let between = if off < 0.0 { [(node - 1, left), (node, middle)] } else { [(node, middle), (node + 1, right)] };
        Ok(Self { at, evidence, between: Some(between) })
    }

    fn sigma(&self) -> f64 {
        (self.at * STEP).exp().max(LEAST_SIGMA)
    }
}

/// The node at which σ equals the standard deviation of the residual, by fixed-point iteration. An error holds the node
/// whose matrix is not positive definite.
fn settled_node(
    factors: &mut Factors,
    evidence: &LogEvidence,
    block: &ColumnBlock,
    nodes: &mut BTreeMap<i32, Option<NodeTerms>>,
    guess: Option<f64>,
) -> Result<i32, i32> {
    const JUMPS: usize = 20;
    let least = node_of(LEAST_SIGMA);
    let mut node = node_of(guess.unwrap_or_else(|| evidence.residual_sigma(0.0))).max(least);
    for _ in 0..JUMPS {
        let terms = nodes.entry(node).or_insert_with(|| node_terms(factors, evidence, block, node));
        let next = node_of(evidence.residual_sigma(terms.as_ref().ok_or(node)?.explained)).max(least);
        if (next - node).abs() <= 1 {
            return Ok(node);
        }
        node = next;
    }
    nodes.entry(node).or_insert_with(|| node_terms(factors, evidence, block, node)).as_ref().map(|_| node).ok_or(node)
}

/// The terms of the evidence at a node, for the columns of a block and those that precede it. The factor of the
/// preceding columns is kept in `factors`.
fn node_terms(factors: &mut Factors, evidence: &LogEvidence, block: &ColumnBlock, node: i32) -> Option<NodeTerms> {
    let (none, precision) = (Columns::default(), sigma_of(node).powi(-2));
    let shared = || Factor::default().extended(&ColumnBlock::new(evidence.moments, &none, block.preceding), precision);
    let shared = factors.entry(node).or_insert_with(shared).as_ref()?;
    let factor = shared.extended(block, precision)?;
    let explained = evidence.explained(shared.square() + factor.square(), sigma_of(node));
    Some(NodeTerms { explained, half_log_det: shared.half_log_det + factor.half_log_det, factor })
}

/// The node nearest to a σ, mm.
#[allow(clippy::cast_possible_truncation)] // The logarithm of an f64 is below 710.
fn node_of(sigma: f64) -> i32 {
    (sigma.max(f64::MIN_POSITIVE).ln() / STEP).round() as i32
}

/// The σ of a node, mm.
fn sigma_of(node: i32) -> f64 {
    (f64::from(node) * STEP).exp()
}

/// The log evidence of a set as a function of ln σ, of the explained sum of squares and of the log determinant.
struct LogEvidence<'a> {
    moments: &'a Moments,
    /// Half the log determinant of the prior precision.
    prior_half_log_det: f64,
    /// Sum of the squared prior means, in prior sizes.
    prior_mean_square: f64,
}

impl<'a> LogEvidence<'a> {
    fn new(moments: &'a Moments, columns: &Columns, more: &Columns) -> Self {
        let prior_mean_square = columns.means.iter().chain(&more.means).map(|(_, mean)| mean * mean).sum();
        Self { moments, prior_half_log_det: columns.half_log_det() + more.half_log_det(), prior_mean_square }
    }

    /// The part of yᵀy that the columns explain, mm², from the squared norm of L⁻¹ times the right-hand side.
    fn explained(&self, square: f64, sigma: f64) -> f64 {
        (square - self.prior_mean_square) * sigma * sigma
    }

    /// The log evidence, nats.
    fn value(&self, log_sigma: f64, explained: f64, half_log_det: f64) -> f64 {
        let Moments { square, count, log_scale, shape, declared, .. } = self.moments;
        let off = |declared: f64| (log_sigma - declared.ln()) / DECLARED_SPREAD;
        let declared = declared.map_or(0.0, |declared| -0.5 * off(declared).powi(2));
        let residual = 0.5 * (square - explained) * (-2.0 * log_sigma).exp();
        -(*count as f64) * log_sigma - residual - half_log_det - log_scale
            + shape.log_prior()
            + declared
            + self.prior_half_log_det
    }

    /// Standard deviation of the residual, mm.
    fn residual_sigma(&self, explained: f64) -> f64 {
        let variance = (self.moments.square - explained) / (self.moments.count as f64).max(1.0);
        variance.max(LEAST_SIGMA * LEAST_SIGMA).sqrt()
    }

    /// Offset from a node to the maximum of the evidence near it, in nodes and at most one, by Newton's method in ln σ.
    fn maximum(&self, node: i32, explained: &Parabola, half_log_det: &Parabola) -> f64 {
        const NEWTON_STEPS: usize = 6;
        let (n, mut at) = (self.moments.count as f64, 0.0f64);
        for _ in 0..NEWTON_STEPS {
            let log_sigma = (f64::from(node) + at) * STEP;
            let precision = (-2.0 * log_sigma).exp();
            let residual = self.moments.square - explained.value(at);
            let (explained_slope, log_det_slope) = (explained.slope(at), half_log_det.slope(at));
            let off =
                self.moments.declared.map_or(0.0, |declared| (log_sigma - declared.ln()) / DECLARED_SPREAD.powi(2));
            let slope = -n + (residual + 0.5 * explained_slope) * precision - log_det_slope - off;
            let curvature = (0.5 * explained.curvature() - 2.0 * explained_slope - 2.0 * residual) * precision
                - half_log_det.curvature()
                - self.moments.declared.map_or(0.0, |_| DECLARED_SPREAD.powi(-2));
            if curvature >= 0.0 {
                break;
            }
            at = (at - slope / curvature / STEP).clamp(-1.0, 1.0);
        }
        at.max(LEAST_SIGMA.ln() / STEP - f64::from(node))
    }
}

/// A parabola through the values at a node and its two neighbours. Its argument counts nodes; its derivatives are by ln
/// σ.
struct Parabola {
    middle: f64,
    linear: f64,
    square: f64,
}

impl Parabola {
    fn through([left, middle, right]: [f64; 3]) -> Self {
        Self { middle, linear: 0.5 * (right - left), square: 0.5 * (right + left) - middle }
    }

    fn value(&self, at: f64) -> f64 {
        self.middle + at * (self.linear + at * self.square)
    }

    fn slope(&self, at: f64) -> f64 {
        (self.linear + 2.0 * at * self.square) / STEP
    }

    fn curvature(&self) -> f64 {
        2.0 * self.square / (STEP * STEP)
    }
}

#[cfg(test)]
mod tests {
    use super::super::bounds::{Normals, Range};
    use super::super::noise::{Series, Shape};
    use super::super::score::posterior;
    use super::*;
    use nalgebra::{DMatrix, DVector, Vector3};

    const WHITE: Shape = Shape { drift: 0.0, correlation: 0.0, field: None };

    /// Evidence at a given σ, directly from the equation of the module.
    fn formula(moments: &Moments, columns: &Columns, sigma: f64) -> f64 {
        let (p, size) = (sigma.powi(-2), columns.list.len());
        let matrix = DMatrix::identity(size, size) + columns.gram(moments) * p;
        let b: DVector<f64> = columns.cross(moments) * p;
        let explained = b.dot(&(matrix.clone().try_inverse().unwrap() * &b));
        let (mean, covariance) = posterior(moments, columns, sigma).unwrap();
        let ranges: Vec<Range> = columns.limits.iter().map(|&(_, low, high)| Range { low, high }).collect();
        let prior: f64 = ranges.iter().map(|range| range.log_probability()).sum();
        let number = |k: usize| columns.limits[k].0;
        let within = Normals {
            ranges,
            means: columns.limits.iter().map(|limit| mean[limit.0]).collect(),
            covariance: &|i, j| covariance[(number(i), number(j))],
        };
        -(moments.count as f64) * sigma.ln() - 0.5 * moments.square * p + 0.5 * explained
            - 0.5 * matrix.determinant().ln()
            + within.log_probability()
            - prior
    }

    #[test]
    fn evidence_with_shared_columns_is_that_of_all_columns_together() {
        let rows = 240;
        let rough = |i: usize| {
            let x = (i as f64 * 12.9898).sin() * 43_758.545;
            x - x.floor() - 0.5
        };
        // The last column is the data: a sum of the first, third and fifth columns, and noise.
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
            // A guess that is far off leads to the same maximum.
            for guess in [None, Some(1e-3), Some(3.0)] {
                let more_columns = list(&more, bounds.clone());
                let (evidence, sigma) = profile.evidence_above(&moments, &more_columns, guess, f64::NEG_INFINITY);
                let evidence = evidence.unwrap();
                for (least, above) in [(evidence - 1e-6, Some(evidence)), (evidence, None)] {
                    assert_eq!(profile.evidence_above(&moments, &more_columns, guess, least), (above, sigma));
                }
                let all = [&[0, 1, 2][..], &more].concat();
                let shifted = bounds.iter().map(|&(k, low, high)| (k + 3, low, high));
                let all = list(&all, profile.columns.limits.iter().copied().chain(shifted).collect());
                assert!((evidence - formula(&moments, &all, sigma)).abs() < 1e-3, "{more:?} {guess:?}");
                // Without the bounds, whose part varies slowly with σ, this σ is the maximum.
                let free = Columns { limits: Vec::new(), ..all.clone() };
                let here = formula(&moments, &free, sigma);
                assert!([0.98, 1.02].iter().all(|off| formula(&moments, &free, off * sigma) < here));
                let (alone, there) = profiled(&moments, &all, guess);
                assert!((alone - formula(&moments, &all, there)).abs() < 1e-9 && (there / sigma - 1.0).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn columns_that_are_not_finite_have_no_factor() {
        let moments = Moments::of(
            &DMatrix::from_element(1, 2, f64::NAN),
            &[Series { samples: vec![(0, 0, 1.0)], places: [[Vector3::zeros(); 3]].into() }],
            WHITE,
        );
        assert!(profiled(&moments, &Columns::independent(vec![(0, 1.0)]), Some(0.1)).0.is_infinite());
    }

    #[test]
    fn a_prior_with_mean_one_is_a_prior_about_zero_on_shifted_data() {
        // Two scalars of 1.4 and 0.3 on the column (1, 0). The prior N(1, 0.5²) and σ = 0.5 weigh the same: the
        // posterior mean is 1.2.
        let stacked = DMatrix::from_row_slice(2, 2, &[1.0, 1.4, 0.0, 0.3]);
        let series = [Series { samples: vec![(0, 0, 1.0), (1, 1, 1.0)], places: [[Vector3::zeros(); 3]; 2].into() }];
        let shape = Shape { drift: 0.0, correlation: 0.0, field: None };
        let moments = Moments::of(&stacked, &series, shape);
        let about_one = Columns { means: vec![(0, 2.0)], ..Columns::independent(vec![(0, 0.5)]) };
        let (mean, _) = posterior(&moments, &about_one, 0.5).unwrap();
        assert!((0.5 * mean[0] - 1.2).abs() < 1e-12);
        // The evidence is that of 0.4 in place of 1.4, with a prior about zero.
        let shifted = Moments::of(&DMatrix::from_row_slice(2, 2, &[1.0, 0.4, 0.0, 0.3]), &series, shape);
        let about_zero = Columns::independent(vec![(0, 0.5)]);
        let evidence = |moments: &Moments, columns: &Columns| profiled(moments, columns, Some(0.3)).0;
        assert!((evidence(&moments, &about_one) - evidence(&shifted, &about_zero)).abs() < 1e-6);
    }
}
