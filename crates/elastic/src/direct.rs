//! The coarsest grid is solved directly, by a Cholesky factorisation within the band.

use crate::level::{LANES, Level, Vector};
use crate::widest::widest;
use rayon::prelude::*;

/// Number of loads that one task solves.
const TOGETHER: usize = 8;

/// The lower factor L, row by row, beginning with the first column of the band. Displacements that nothing holds stay zero.
pub(crate) struct Band {
    width: usize,
    rows: Vec<f64>,
    /// The position of each node in the order of elimination.
    order: Vec<u32>,
}

/// A pivot below this share of its diagonal belongs to a motion without stiffness.
const SINGULAR: f64 = 1e-13;

/// Number of operations of a factorisation in a band. [`Band::new`] is meant for grids with about 10⁹ at most.
pub(crate) fn cost(unknowns: usize, width: usize) -> f64 {
    unknowns as f64 * (width as f64).powi(2)
}

/// The nodes in the order of the planes across the longest axis of the grid, and the width of the band in this order.
pub(crate) fn ordered(level: &Level) -> (Vec<u32>, usize) {
    let counts = level.counts;
    let mut axes = [0, 1, 2];
    axes.sort_by_key(|k| std::cmp::Reverse(counts[*k]));
    let key = |node: &u32| {
        let at = crate::solid::unravel(counts, *node as usize);
        axes.map(|k| at[k])
    };
    let mut by_key: Vec<usize> = (0..level.len()).collect();
    by_key.sort_by_key(|n| key(&level.node[*n]));
    let mut order = vec![0; level.len()];
    for (place, n) in by_key.into_iter().enumerate() {
        order[n] = place as u32;
    }
    let reach = |n: usize| level.row(n).map(|(m, _)| order[n].abs_diff(order[m])).max().unwrap_or(0);
    let reach = (0..level.len()).map(reach).max().unwrap_or(0) as usize;
    (order, 3 * (reach + 1))
}

impl Band {
    pub(crate) fn new(level: &Level) -> Self {
        let (order, width) = ordered(level);
        let n = 3 * level.len();
        // Row i holds columns i − width + 1 … i.
        let mut rows = vec![0.0; n * width];
        for node in 0..level.len() {
            for (other, block) in level.row(node) {
                for r in 0..3 {
                    for c in 0..3 {
                        let (i, j) = (3 * order[node] as usize + r, 3 * order[other] as usize + c);
                        if j <= i {
                            rows[i * width + (j + width - 1 - i)] = block[3 * r + c];
                        }
                    }
                }
            }
        }
        for i in 0..n {
            let (above, own) = rows.split_at_mut(i * width);
            let own = &mut own[..width];
            let diagonal = own[width - 1];
            widest!(<'a> _simd: S; (above: &'a [f64] = above, own: &'a mut [f64] = own, i: usize = i, width: usize = width) -> () {
                let first = i.saturating_sub(width - 1);
                for j in first..i {
                    // L(i, j) = (A(i, j) − Σ L(i, k) L(j, k)) / L(j, j) over k ≥ first.
                    let row = &above[j * width..(j + 1) * width];
                    let shift = i - j;
                    let at = j + width - 1 - i;
                    let from = first.max(j.saturating_sub(width - 1));
                    let start = from + width - 1 - i;
                    let sum = product(&own[start..at], &row[start + shift..at + shift]);
                    let pivot = row[width - 1];
                    own[at] = if pivot > 0.0 { (own[at] - sum) / pivot } else { 0.0 };
                }
            });
            let square: f64 = own[..width - 1].iter().map(|l| l * l).sum();
            let pivot = diagonal - square;
            own[width - 1] = if pivot > SINGULAR * diagonal { pivot.sqrt() } else { 0.0 };
        }
        Self { width, rows, order }
    }

    /// Solves all loads, several at once.
    pub(crate) fn solve(&self, b: &Vector, x: &mut Vector) {
        let halves: Vec<Vec<[f64; TOGETHER]>> =
            (0..LANES / TOGETHER).into_par_iter().map(|part| self.solve_part(b, part * TOGETHER)).collect();
        for (node, place) in self.order.iter().enumerate() {
            for k in 0..3 {
                for (part, y) in halves.iter().enumerate() {
                    let y = &y[3 * *place as usize + k];
                    for l in 0..TOGETHER {
                        x[node][k][part * TOGETHER + l] = y[l] as f32;
                    }
                }
            }
        }
    }

    /// The solutions for the loads from `first` on, in the order of elimination.
    fn solve_part(&self, b: &Vector, first: usize) -> Vec<[f64; TOGETHER]> {
        let n = 3 * self.order.len();
        let width = self.width;
        let mut y = vec![[0.0; TOGETHER]; n];
        for (node, place) in self.order.iter().enumerate() {
            for k in 0..3 {
                y[3 * *place as usize + k] = std::array::from_fn(|l| f64::from(b[node][k][first + l]));
            }
        }
        widest!(<'a> _simd: S; (rows: &'a [f64] = &self.rows, width: usize = width, y: &'a mut [[f64; TOGETHER]] = &mut y) -> () {
            let n = y.len();
            for i in 0..n {
                let row = &rows[i * width..(i + 1) * width];
                let first = i.saturating_sub(width - 1);
                let mut sum = y[i];
                for (l, y) in row[first + width - 1 - i..width - 1].iter().zip(&y[first..i]) {
                    for lane in 0..TOGETHER {
                        sum[lane] -= l * y[lane];
                    }
                }
                let pivot = row[width - 1];
                y[i] = sum.map(|v| if pivot > 0.0 { v / pivot } else { 0.0 });
            }
            for i in (0..n).rev() {
                let row = &rows[i * width..(i + 1) * width];
                let first = i.saturating_sub(width - 1);
                let pivot = row[width - 1];
                let value = y[i].map(|v| if pivot > 0.0 { v / pivot } else { 0.0 });
                y[i] = value;
                for (l, y) in row[first + width - 1 - i..width - 1].iter().zip(&mut y[first..i]) {
                    for lane in 0..TOGETHER {
                        y[lane] -= l * value[lane];
                    }
                }
            }
        });
        y
    }
}

#[inline(always)]
fn product(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_chunks, b_chunks) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum::<f64>() + rest
}
