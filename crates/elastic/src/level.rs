//! One grid of the hierarchy: cells with a stiffness each, and the equations of their nodes.

use crate::element::{CORNERS, Matrix, SIZE};
use crate::solid::{ravel, unravel};
use crate::widest::widest;
use nalgebra::Matrix3;
use pulp::Simd;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Number of loads that are solved at once.
pub(crate) const LANES: usize = 16;
/// A displacement or a force of a node along x, y and z, for each load. Single precision is enough for storage: rounding a force
/// adds a ten-millionth of it, and rounding a displacement changes the energy by the square of that. Only the product with the
/// stiffness has to be exact, because its terms cancel. [`Level::apply`] adds them in double precision.
pub(crate) type Node = [[f32; LANES]; 3];
/// The values of all nodes, and one more that is zero. It stands for neighbours that do not exist.
pub(crate) type Vector = Vec<Node>;
pub(crate) const ZERO: Node = [[0.0; LANES]; 3];

/// The index of a cell without material, which has no matrix.
pub(crate) const NONE: u32 = u32::MAX;
/// The matrix that all full cells of a level share.
pub(crate) const SHARED: u32 = 0;

/// The 3 × 3 blocks of a node's equations, by neighbour (x running fastest), rows first.
type Stencil<T> = [[T; 9]; 27];

/// Number of nodes in one task. It is fixed, so that sums are the same for any number of threads.
const CHUNK: usize = 2048;

/// The cells of a grid, each with the index of its stiffness.
pub(crate) struct Cells {
    pub(crate) counts: [usize; 3],
    pub(crate) matrix: Vec<u32>,
    pub(crate) matrices: Vec<Matrix>,
}

/// The equations of a grid.
pub(crate) struct Level {
    /// Number of each node of the whole grid among those with material, or [`NONE`].
    pub(crate) number: Vec<u32>,
    /// Node of the whole grid, by number.
    pub(crate) node: Vec<u32>,
    /// Nodes of the whole grid along each axis.
    pub(crate) counts: [usize; 3],
    neighbours: Vec<[u32; 27]>,
    /// The stencils in double precision; only the finest and the coarsest grid keep them.
    exact: Vec<Stencil<f64>>,
    stencils: Vec<Stencil<f32>>,
    inverse_diagonals: Vec<[f32; 9]>,
    stencil: Vec<u32>,
    /// Approximate largest eigenvalue of the inverse diagonal times the matrix.
    largest: f64,
}

/// Index of a neighbour from offsets −1, 0, 1.
fn neighbour_of(offset: [i64; 3]) -> usize {
    (9 * (offset[2] + 1) + 3 * (offset[1] + 1) + offset[0] + 1) as usize
}

fn corner(a: usize) -> [usize; 3] {
    [a & 1, a >> 1 & 1, a >> 2 & 1]
}

impl Level {
    pub(crate) fn new(cells: &Cells) -> Self {
        let counts = cells.counts.map(|cells| cells + 1);
        let all: usize = counts.iter().product();
        let about = |node: usize| -> [u32; CORNERS] {
            let node = unravel(counts, node);
            // The cell at whose corner `a` the node is.
            std::array::from_fn(|a| {
                let cell: [usize; 3] = std::array::from_fn(|k| node[k].wrapping_sub(corner(a)[k]));
                if (0..3).all(|k| cell[k] < cells.counts[k]) { cells.matrix[ravel(cells.counts, cell)] } else { NONE }
            })
        };
        let mut number = vec![NONE; all];
        let mut node = Vec::new();
        for at in 0..all {
            if about(at).iter().any(|matrix| *matrix != NONE) {
                number[at] = node.len() as u32;
                node.push(at as u32);
            }
        }
        let absent = node.len() as u32;
        let neighbours: Vec<[u32; 27]> = node
            .par_iter()
            .map(|at| {
                let at = unravel(counts, *at as usize);
                std::array::from_fn(|n| {
                    let offset = unravel([3; 3], n);
                    let next: [usize; 3] = std::array::from_fn(|k| (at[k] + offset[k]).wrapping_sub(1));
                    let inside = (0..3).all(|k| next[k] < counts[k]);
                    if inside {
                        Some(number[ravel(counts, next)]).filter(|n| *n != NONE).unwrap_or(absent)
                    } else {
                        absent
                    }
                })
            })
            .collect();
        // Nodes whose cells are all full share a stencil if the same of their eight cells exist.
        let mut shared = BTreeMap::new();
        let mut own = Vec::new();
        let mut stencil = Vec::with_capacity(node.len());
        for at in &node {
            let matrices = about(*at as usize);
            if matrices.iter().all(|matrix| *matrix == NONE || *matrix == SHARED) {
                let present = matrices.map(|matrix| matrix != NONE);
                stencil.push(*shared.entry(present).or_insert_with(|| {
                    own.push(matrices);
                    (own.len() - 1) as u32
                }));
            } else {
                stencil.push(own.len() as u32);
                own.push(matrices);
            }
        }
        let exact: Vec<Stencil<f64>> = own.par_iter().map(|about| assemble(about, &cells.matrices)).collect();
        let single = |stencil: &Stencil<f64>| stencil.map(|block| block.map(|v| v as f32));
        let stencils = exact.par_iter().map(single).collect();
        let diagonal = |stencil: &Stencil<f64>| inverse(&stencil[neighbour_of([0; 3])]).map(|v| v as f32);
        let inverse_diagonals = exact.par_iter().map(diagonal).collect();
        let mut level =
            Self { number, node, counts, neighbours, exact, stencils, inverse_diagonals, stencil, largest: 1.0 };
        level.largest = level.largest_eigenvalue();
        level
    }

    /// Drops the stiffness in double precision, which only the finest and the coarsest grid need.
    pub(crate) fn forget_exact(&mut self) {
        self.exact = Vec::new();
    }

    /// Number of nodes with material.
    pub(crate) fn len(&self) -> usize {
        self.node.len()
    }

    pub(crate) fn zeros(&self) -> Vector {
        vec![ZERO; self.len() + 1]
    }

    /// The existing neighbours of a node, with the blocks of its equations.
    pub(crate) fn row(&self, node: usize) -> impl Iterator<Item = (usize, &[f64; 9])> {
        let stencil = &self.exact[self.stencil[node] as usize];
        let present = |(n, block): (&u32, _)| ((*n as usize) < self.len()).then_some((*n as usize, block));
        self.neighbours[node].iter().zip(stencil).filter_map(present)
    }

    /// out = A x, and the product of both for each load.
    pub(crate) fn apply(&self, x: &Vector, out: &mut Vector) -> [f64; LANES] {
        let nodes = self.len();
        let work = |(chunk, out): (usize, &mut [Node])| {
            widest!(<'a> simd: S; (level: &'a Level = self, x: &'a [Node] = x, first: usize = chunk * CHUNK, out: &'a mut [Node] = out) -> [f64; LANES] {
                let mut energy = [0.0; LANES];
                for (i, out) in out.iter_mut().enumerate() {
                    let product = level.product(simd, first + i, x);
                    let x = &x[first + i];
                    for k in 0..3 {
                        for l in 0..LANES {
                            energy[l] += product[k][l] * f64::from(x[k][l]);
                            out[k][l] = product[k][l] as f32;
                        }
                    }
                }
                energy
            })
        };
        in_order(&out[..nodes].par_chunks_mut(CHUNK).enumerate().map(work).collect::<Vec<_>>())
    }

    /// A x at a node, added up in double precision.
    #[inline(always)]
    fn product<S: Simd>(&self, simd: S, node: usize, x: &[Node]) -> [[f64; LANES]; 3] {
        let stencil = &self.exact[self.stencil[node] as usize];
        let parts = LANES / S::F64_LANES;
        // Enough sums for the narrowest registers.
        let mut sums = [[simd.splat_f64s(0.0); 3]; LANES];
        for (block, n) in stencil.iter().zip(&self.neighbours[node]) {
            let single = &x[*n as usize];
            let mut x = [[0.0; LANES]; 3];
            for k in 0..3 {
                for l in 0..LANES {
                    x[k][l] = f64::from(single[k][l]);
                }
            }
            for (part, sums) in sums[..parts].iter_mut().enumerate() {
                for column in 0..3 {
                    let x = S::as_simd_f64s(&x[column]).0[part];
                    for row in 0..3 {
                        let term = simd.mul_f64s(simd.splat_f64s(block[3 * row + column]), x);
                        sums[row] = simd.add_f64s(sums[row], term);
                    }
                }
            }
        }
        let mut product = [[0.0; LANES]; 3];
        for (part, sums) in sums[..parts].iter().enumerate() {
            for row in 0..3 {
                S::as_mut_simd_f64s(&mut product[row]).0[part] = sums[row];
            }
        }
        product
    }

    /// Computes a sweep at each node.
    pub(crate) fn sweep(&self, sweep: Sweep<'_>, out: &mut Vector) {
        let nodes = self.len();
        let factors = self.chebyshev();
        out[..nodes].par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            widest!(<'a> simd: S; (level: &'a Level = self, sweep: Sweep<'a> = sweep, factors: Chebyshev = factors, first: usize = chunk * CHUNK, out: &'a mut [Node] = out) -> () {
                for (i, out) in out.iter_mut().enumerate() {
                    for part in 0..LANES / S::F32_LANES {
                        let swept = level.swept(simd, sweep, &factors, first + i, part);
                        for row in 0..3 {
                            S::as_mut_simd_f32s(&mut out[row]).0[part] = swept[row];
                        }
                    }
                }
            });
        });
    }

    /// The factors for the part of the spectrum that coarser grids cannot represent.
    fn chebyshev(&self) -> Chebyshev {
        let (high, low) = (1.1 * self.largest, self.largest / 6.0);
        let (middle, half) = (0.5 * (high + low), 0.5 * (high - low));
        let rho = half / middle;
        let next = 1.0 / (2.0 * middle / half - rho);
        Chebyshev { first: (1.0 / middle) as f32, keep: (next * rho) as f32, second: (2.0 * next / half) as f32 }
    }

    /// The result of a sweep at a node, for the loads of one register.
    #[inline(always)]
    fn swept<S: Simd>(&self, simd: S, sweep: Sweep<'_>, factors: &Chebyshev, node: usize, part: usize) -> [S::f32s; 3] {
        match sweep {
            Sweep::Residual { b, x } => self.left(simd, node, part, b, x),
            Sweep::FirstFromZero { b } => self.scaled(simd, node, &rows::<S>(&b[node], part), factors.first),
            Sweep::First { b, x } => {
                let left = self.left(simd, node, part, b, x);
                self.scaled(simd, node, &left, factors.first)
            }
            Sweep::Second { b, x, step } => {
                let left = self.left(simd, node, part, b, x);
                let scaled = self.scaled(simd, node, &left, factors.second);
                let (x, step) = (rows::<S>(&x[node], part), rows::<S>(&step[node], part));
                let keep = simd.splat_f32s(factors.keep);
                let mut out = scaled;
                for k in 0..3 {
                    out[k] = simd.add_f32s(simd.add_f32s(x[k], simd.mul_f32s(keep, step[k])), scaled[k]);
                }
                out
            }
        }
    }

    /// b − A x at a node.
    #[inline(always)]
    fn left<S: Simd>(&self, simd: S, node: usize, part: usize, b: &[Node], x: &[Node]) -> [S::f32s; 3] {
        let stencil = &self.stencils[self.stencil[node] as usize];
        let mut left = rows::<S>(&b[node], part);
        for (block, n) in stencil.iter().zip(&self.neighbours[node]) {
            let x = rows::<S>(&x[*n as usize], part);
            for column in 0..3 {
                for row in 0..3 {
                    let term = simd.mul_f32s(simd.splat_f32s(block[3 * row + column]), x[column]);
                    left[row] = simd.sub_f32s(left[row], term);
                }
            }
        }
        left
    }

    /// D⁻¹ r at a node, times a factor.
    #[inline(always)]
    fn scaled<S: Simd>(&self, simd: S, node: usize, r: &[S::f32s; 3], factor: f32) -> [S::f32s; 3] {
        let inverse = &self.inverse_diagonals[self.stencil[node] as usize];
        let mut scaled = [simd.splat_f32s(0.0); 3];
        for row in 0..3 {
            for column in 0..3 {
                let term = simd.mul_f32s(simd.splat_f32s(factor * inverse[3 * row + column]), r[column]);
                scaled[row] = simd.add_f32s(scaled[row], term);
            }
        }
        scaled
    }

    /// Largest eigenvalue of D⁻¹ A by the power method, with a random start in each lane.
    fn largest_eigenvalue(&self) -> f64 {
        let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
        let mut random = || {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed >> 40) as f32 / (1_u64 << 24) as f32 - 0.5
        };
        let (mut x, mut y, mut z) = (self.zeros(), self.zeros(), self.zeros());
        for node in &mut x[..self.len()] {
            *node = std::array::from_fn(|_| std::array::from_fn(|_| random()));
        }
        let none = self.zeros();
        let mut largest = 0.0_f64;
        for _ in 0..12 {
            // y = −A x, z = −D⁻¹ A x.
            self.sweep(Sweep::Residual { b: &none, x: &x }, &mut y);
            self.sweep(Sweep::FirstFromZero { b: &y }, &mut z);
            // Rayleigh's quotient in the norm of A's diagonal is near (D⁻¹A z, A z)/(z, A z).
            let (top, bottom) = (dot(&z, &y), dot(&x, &y).map(|v| -v));
            largest = (0..LANES).filter(|l| bottom[*l] > 0.0).map(|l| top[l] / bottom[l]).fold(0.0, f64::max);
            // The sweep has multiplied by the factor for `self.largest`, which is still 1.
            largest /= f64::from(self.chebyshev().first);
            let size = dot(&z, &z).map(|square| if square > 0.0 { -1.0 / square.sqrt() } else { 0.0 });
            x.fill(ZERO);
            add_scaled(&mut x, &size, &z);
        }
        largest.max(f64::MIN_POSITIVE)
    }
}

/// Factors of two steps of a Chebyshev iteration. `first` is that of D⁻¹ r in the first step, `keep` that of the first step in
/// the second one, and `second` that of D⁻¹ r in the second one.
#[derive(Clone, Copy)]
struct Chebyshev {
    first: f32,
    keep: f32,
    second: f32,
}

/// What a sweep computes at each node, to solve b − A x = 0.
#[derive(Clone, Copy)]
pub(crate) enum Sweep<'a> {
    /// b − A x.
    Residual { b: &'a [Node], x: &'a [Node] },
    /// The first of two steps of the Chebyshev iteration, from x = 0.
    FirstFromZero { b: &'a [Node] },
    /// The first step from x.
    First { b: &'a [Node], x: &'a [Node] },
    /// The result of the second step; x is the result of the first one.
    Second { b: &'a [Node], x: &'a [Node], step: &'a [Node] },
}

/// The values of a node for the loads of one register. A function and no closure, which the compiler would not inline.
#[inline(always)]
pub(crate) fn rows<S: Simd>(node: &Node, part: usize) -> [S::f32s; 3] {
    let [x, y, z] = node;
    [S::as_simd_f32s(x).0[part], S::as_simd_f32s(y).0[part], S::as_simd_f32s(z).0[part]]
}

/// Sums over chunks, always in the same order.
fn in_order(parts: &[[f64; LANES]]) -> [f64; LANES] {
    let mut sum = [0.0; LANES];
    for part in parts {
        for l in 0..LANES {
            sum[l] += part[l];
        }
    }
    sum
}

/// Sums of products of two vectors, one for each load.
pub(crate) fn dot(a: &Vector, b: &Vector) -> [f64; LANES] {
    let work = |(a, b): (&[Node], &[Node])| {
        let mut sum = [0.0; LANES];
        for (a, b) in a.iter().zip(b) {
            for k in 0..3 {
                for l in 0..LANES {
                    sum[l] += f64::from(a[k][l]) * f64::from(b[k][l]);
                }
            }
        }
        sum
    };
    in_order(&a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(work).collect::<Vec<_>>())
}

/// Changes each value of a vector by a function of it, of the value of another vector, and of the factor of the load.
fn combine(y: &mut Vector, factor: &[f64; LANES], x: &Vector, of: impl Fn(f32, f32, f32) -> f32 + Sync) {
    let factor = factor.map(|v| v as f32);
    y.par_iter_mut().zip(x).with_min_len(CHUNK).for_each(|(y, x)| {
        for k in 0..3 {
            for l in 0..LANES {
                y[k][l] = of(y[k][l], x[k][l], factor[l]);
            }
        }
    });
}

/// y += factor · x for each load.
pub(crate) fn add_scaled(y: &mut Vector, factor: &[f64; LANES], x: &Vector) {
    combine(y, factor, x, |y, x, factor| y + factor * x);
}

/// p = z + factor · p for each load.
pub(crate) fn turn_towards(p: &mut Vector, factor: &[f64; LANES], z: &Vector) {
    combine(p, factor, z, |p, z, factor| z + factor * p);
}

fn assemble(about: &[u32; CORNERS], matrices: &[Matrix]) -> Stencil<f64> {
    let mut stencil = [[0.0; 9]; 27];
    for (a, matrix) in about.iter().enumerate() {
        if *matrix == NONE {
            continue;
        }
        let k = &matrices[*matrix as usize];
        for b in 0..CORNERS {
            let offset = std::array::from_fn(|axis| corner(b)[axis] as i64 - corner(a)[axis] as i64);
            let block = &mut stencil[neighbour_of(offset)];
            for row in 0..3 {
                for column in 0..3 {
                    block[3 * row + column] += k[(3 * a + row, 3 * b + column)];
                }
            }
        }
    }
    stencil
}

/// Inverse of a block of the diagonal. Axes that are held have a row of zeros and stay zero.
fn inverse(block: &[f64; 9]) -> [f64; 9] {
    let mut matrix = Matrix3::from_row_slice(block);
    let held: [bool; 3] = std::array::from_fn(|k| matrix[(k, k)] <= 0.0);
    for k in 0..3 {
        if held[k] {
            matrix[(k, k)] = 1.0;
        }
    }
    let mut inverse = matrix.try_inverse().unwrap_or_else(Matrix3::zeros);
    for k in 0..3 {
        if held[k] {
            inverse[(k, k)] = 0.0;
        }
    }
    std::array::from_fn(|n| inverse[(n / 3, n % 3)])
}

/// Weights of the two nodes of a coarse cell along an axis, for the two nodes of a fine cell in it.
fn along(halved: bool, position: usize) -> [[f64; 2]; 2] {
    if halved {
        std::array::from_fn(|t| {
            let share = 0.5 * (position + t) as f64;
            [1.0 - share, share]
        })
    } else {
        [[1.0, 0.0], [0.0, 1.0]]
    }
}

/// Contribution of the corners of a coarse cell to those of a fine cell, at one of the eight positions in it.
fn weights(halved: [bool; 3], position: usize) -> [[f64; CORNERS]; CORNERS] {
    let along: [[[f64; 2]; 2]; 3] = std::array::from_fn(|k| along(halved[k], corner(position)[k]));
    std::array::from_fn(|fine| {
        std::array::from_fn(|coarse| (0..3).map(|k| along[k][corner(fine)[k]][corner(coarse)[k]]).product())
    })
}

/// Adds Wᵀ K W of a fine cell to a coarse one's matrix.
fn add_galerkin(k: &Matrix, w: &[[f64; CORNERS]; CORNERS], sum: &mut Matrix) {
    // K W by corners, then Wᵀ of it.
    let mut half = Matrix::zeros();
    for fine in 0..CORNERS {
        for coarse in 0..CORNERS {
            let weight = w[fine][coarse];
            if weight > 0.0 {
                for axis in 0..3 {
                    for row in 0..SIZE {
                        half[(row, 3 * coarse + axis)] += weight * k[(row, 3 * fine + axis)];
                    }
                }
            }
        }
    }
    for fine in 0..CORNERS {
        for coarse in 0..CORNERS {
            let weight = w[fine][coarse];
            if weight > 0.0 {
                for column in 0..SIZE {
                    for axis in 0..3 {
                        sum[(3 * coarse + axis, column)] += weight * half[(3 * fine + axis, column)];
                    }
                }
            }
        }
    }
}

/// Along which axes the next grid has half as many cells.
pub(crate) fn halved(counts: [usize; 3]) -> [bool; 3] {
    counts.map(|cells| cells > 1)
}

/// The cells of a grid that is half as fine. They have the energy of the fine cells under the same displacements.
pub(crate) fn coarser(fine: &Cells) -> Cells {
    let halved = halved(fine.counts);
    let counts: [usize; 3] =
        std::array::from_fn(|k| if halved[k] { fine.counts[k].div_ceil(2) } else { fine.counts[k] });
    let weights: Vec<_> = (0..CORNERS).map(|position| weights(halved, position)).collect();
    let children = |coarse: usize| -> [u32; CORNERS] {
        let at = unravel(counts, coarse);
        std::array::from_fn(|position| {
            let p = corner(position);
            let cell: [usize; 3] = std::array::from_fn(|k| if halved[k] { 2 * at[k] + p[k] } else { at[k] });
            let exists = (0..3).all(|k| cell[k] < fine.counts[k] && (halved[k] || p[k] == 0));
            if exists { fine.matrix[ravel(fine.counts, cell)] } else { NONE }
        })
    };
    let galerkin = |children: &[u32; CORNERS]| {
        let mut sum = Matrix::zeros();
        for (child, w) in children.iter().zip(&weights) {
            if *child != NONE {
                add_galerkin(&fine.matrices[*child as usize], w, &mut sum);
            }
        }
        sum
    };
    let full: [u32; CORNERS] = std::array::from_fn(|position| {
        let exists = (0..3).all(|k| halved[k] || corner(position)[k] == 0);
        if exists { SHARED } else { NONE }
    });
    let (mut matrix, mut own) = (Vec::with_capacity(counts.iter().product()), vec![full]);
    for coarse in 0..counts.iter().product() {
        let children = children(coarse);
        if children.iter().all(|child| *child == NONE) {
            matrix.push(NONE);
        } else if children == full {
            matrix.push(SHARED);
        } else {
            matrix.push(own.len() as u32);
            own.push(children);
        }
    }
    let matrices = own.par_iter().map(galerkin).collect();
    Cells { counts, matrix, matrices }
}

/// Transfers vectors from a grid to the next coarser one and back.
pub(crate) struct Transfer {
    /// Numbers and weights of the coarse nodes around each fine one.
    coarse: Vec<[(u32, f32); CORNERS]>,
    /// Numbers and weights of the fine nodes around each coarse one.
    fine: Vec<[(u32, f32); 27]>,
}

impl Transfer {
    pub(crate) fn between(fine: &Level, coarse: &Level, halved: [bool; 3]) -> Self {
        let to_coarse = |node: &u32| {
            let at = unravel(fine.counts, *node as usize);
            std::array::from_fn(|corner_number| {
                let c = corner(corner_number);
                let mut weight = 1.0;
                let next: [usize; 3] = std::array::from_fn(|k| match (halved[k], at[k] % 2 == 1) {
                    (true, true) => {
                        weight *= 0.5;
                        at[k] / 2 + c[k]
                    }
                    (true, false) => {
                        weight *= 1.0 - c[k] as f32;
                        at[k] / 2
                    }
                    (false, _) => {
                        weight *= 1.0 - c[k] as f32;
                        at[k]
                    }
                });
                let number = if weight > 0.0 { coarse.number[ravel(coarse.counts, next)] } else { NONE };
                if number == NONE { (coarse.len() as u32, 0.0) } else { (number, weight) }
            })
        };
        let to_fine = |node: &u32| {
            let at = unravel(coarse.counts, *node as usize);
            std::array::from_fn(|n| {
                let offset = unravel([3; 3], n);
                let mut weight = 1.0;
                let next: [usize; 3] = std::array::from_fn(|k| {
                    let middle = offset[k] == 1;
                    if halved[k] {
                        weight *= if middle { 1.0 } else { 0.5 };
                        (2 * at[k] + offset[k]).wrapping_sub(1)
                    } else {
                        weight *= if middle { 1.0 } else { 0.0 };
                        at[k]
                    }
                });
                let inside = weight > 0.0 && (0..3).all(|k| next[k] < fine.counts[k]);
                let number = if inside { fine.number[ravel(fine.counts, next)] } else { NONE };
                if number == NONE { (fine.len() as u32, 0.0) } else { (number, weight) }
            })
        };
        Self {
            coarse: fine.node.par_iter().map(to_coarse).collect(),
            fine: coarse.node.par_iter().map(to_fine).collect(),
        }
    }

    /// The coarse forces that do the same work as the fine ones.
    pub(crate) fn restrict(&self, fine: &Vector, out: &mut Vector) {
        out.par_iter_mut().zip(&self.fine).with_min_len(CHUNK).for_each(|(out, from)| {
            *out = ZERO;
            add_weighted(out, from, fine);
        });
    }

    /// Adds coarse displacements to fine ones.
    pub(crate) fn prolong(&self, coarse: &Vector, out: &mut Vector) {
        out.par_iter_mut()
            .zip(&self.coarse)
            .with_min_len(CHUNK)
            .for_each(|(out, from)| add_weighted(out, from, coarse));
    }
}

fn add_weighted(out: &mut Node, from: &[(u32, f32)], x: &Vector) {
    for (n, weight) in from.iter().filter(|(_, weight)| *weight > 0.0) {
        let x = &x[*n as usize];
        for k in 0..3 {
            for l in 0..LANES {
                out[k][l] += weight * x[k][l];
            }
        }
    }
}
