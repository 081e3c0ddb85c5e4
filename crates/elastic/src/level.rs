//! One grid of the hierarchy: cells with a stiffness each, and the equations of their nodes.

use crate::element::{CORNERS, Matrix, SIZE};
use crate::solid::{ravel, unravel};
use nalgebra::Matrix3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Loads that are solved for at once.
pub(crate) const LANES: usize = 8;
/// A displacement or a force of a node, for each load: axes x, y, z.
pub(crate) type Node = [[f64; LANES]; 3];
/// Of all nodes, and one more that is zero: a neighbour that does not exist.
pub(crate) type Vector = Vec<Node>;
pub(crate) const ZERO: Node = [[0.0; LANES]; 3];

/// No matrix: a cell without material.
pub(crate) const NONE: u32 = u32::MAX;
/// The matrix that all full cells of a level share.
pub(crate) const SHARED: u32 = 0;

/// The 3 × 3 blocks of a node's equations, by neighbour (x running fastest), rows first.
type Stencil = [[f64; 9]; 27];

/// Nodes that a task takes at once: the same sums for any number of threads.
const CHUNK: usize = 2048;

/// Cells of a grid by the index of their stiffness.
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
    stencils: Vec<Stencil>,
    stencil: Vec<u32>,
    inverse_diagonal: Vec<[f64; 9]>,
    /// Bound on the eigenvalues of the inverse diagonal times the matrix, about.
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
        // Nodes among full cells share what they have by which of the eight cells there are.
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
        let stencils: Vec<Stencil> = own.par_iter().map(|about| assemble(about, &cells.matrices)).collect();
        let inverses: Vec<[f64; 9]> =
            stencils.par_iter().map(|stencil| inverse(&stencil[neighbour_of([0; 3])])).collect();
        let inverse_diagonal = stencil.iter().map(|stencil| inverses[*stencil as usize]).collect();
        let mut level = Self { number, node, counts, neighbours, stencils, stencil, inverse_diagonal, largest: 0.0 };
        level.largest = level.largest_eigenvalue();
        level
    }

    /// Number of nodes with material.
    pub(crate) fn len(&self) -> usize {
        self.node.len()
    }

    pub(crate) fn zeros(&self) -> Vector {
        vec![ZERO; self.len() + 1]
    }

    /// The block of a node's equations for a neighbour, and that neighbour's number, of those that exist.
    pub(crate) fn row(&self, node: usize) -> impl Iterator<Item = (usize, &[f64; 9])> {
        let stencil = &self.stencils[self.stencil[node] as usize];
        let present = |(n, block): (&u32, _)| ((*n as usize) < self.len()).then_some((*n as usize, block));
        self.neighbours[node].iter().zip(stencil).filter_map(present)
    }

    /// Calls `work` for the chunks of a vector in parallel, each with the number of its first node.
    fn each(&self, out: &mut Vector, work: impl Fn(usize, &mut [Node]) + Sync) {
        let nodes = self.len();
        let arch = pulp::Arch::new();
        out[..nodes].par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            arch.dispatch(|| work(chunk * CHUNK, out));
        });
    }

    /// out = A x.
    pub(crate) fn apply(&self, x: &Vector, out: &mut Vector) {
        self.each(out, |first, out| {
            for (i, out) in out.iter_mut().enumerate() {
                *out = self.product(first + i, x);
            }
        });
    }

    /// out = b − A x.
    pub(crate) fn residual(&self, b: &Vector, x: &Vector, out: &mut Vector) {
        self.each(out, |first, out| {
            for (i, out) in out.iter_mut().enumerate() {
                let product = self.product(first + i, x);
                let b = &b[first + i];
                for k in 0..3 {
                    for l in 0..LANES {
                        out[k][l] = b[k][l] - product[k][l];
                    }
                }
            }
        });
    }

    #[inline(always)]
    fn product(&self, node: usize, x: &Vector) -> Node {
        let stencil = &self.stencils[self.stencil[node] as usize];
        let neighbours = &self.neighbours[node];
        let mut sum = ZERO;
        for (block, n) in stencil.iter().zip(neighbours) {
            add_block(block, &x[*n as usize], &mut sum);
        }
        sum
    }

    /// Two steps of Chebyshev's iteration towards A x = b, from x = 0 or on from what x is.
    ///
    /// `work` are two vectors to work in.
    pub(crate) fn smooth(&self, b: &Vector, x: &mut Vector, from: From, work: &mut [Vector; 2]) {
        // The part of the spectrum that coarser grids do not see.
        let (high, low) = (1.1 * self.largest, self.largest / 6.0);
        let (middle, half) = (0.5 * (high + low), 0.5 * (high - low));
        let [residual, step] = work;
        let mut rho = half / middle;
        for round in 0..2 {
            let starts = round == 0 && from == From::Zero;
            if !starts {
                self.residual(b, x, residual);
            }
            let now = if starts { b } else { &*residual };
            let (keep, take) = if round == 0 {
                (0.0, 1.0 / middle)
            } else {
                let next = 1.0 / (2.0 * middle / half - rho);
                let factors = (next * rho, 2.0 * next / half);
                rho = next;
                factors
            };
            self.each(step, |first, step| {
                for (i, step) in step.iter_mut().enumerate() {
                    let mut scaled = ZERO;
                    add_block(&self.inverse_diagonal[first + i], &now[first + i], &mut scaled);
                    for k in 0..3 {
                        for l in 0..LANES {
                            step[k][l] = keep * step[k][l] + take * scaled[k][l];
                        }
                    }
                }
            });
            let step = &*step;
            self.each(x, |first, x| {
                for (x, step) in x.iter_mut().zip(&step[first..]) {
                    for k in 0..3 {
                        for l in 0..LANES {
                            x[k][l] = if starts { step[k][l] } else { x[k][l] + step[k][l] };
                        }
                    }
                }
            });
        }
    }

    /// Largest eigenvalue of D⁻¹ A by the power method, from eight starts at once.
    fn largest_eigenvalue(&self) -> f64 {
        let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
        let mut random = || {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let (mut x, mut y) = (self.zeros(), self.zeros());
        for node in &mut x[..self.len()] {
            *node = std::array::from_fn(|_| std::array::from_fn(|_| random()));
        }
        let mut largest = 0.0_f64;
        for _ in 0..12 {
            self.apply(&x, &mut y);
            let mut z = self.zeros();
            self.each(&mut z, |first, z| {
                for (i, z) in z.iter_mut().enumerate() {
                    add_block(&self.inverse_diagonal[first + i], &y[first + i], z);
                }
            });
            // Rayleigh's quotient in the norm of A's diagonal is near (D⁻¹A z, A z)/(z, A z).
            let (top, bottom) = (dot(&z, &y), dot(&x, &y));
            largest = (0..LANES).filter(|l| bottom[*l] > 0.0).map(|l| top[l] / bottom[l]).fold(0.0, f64::max);
            let size = dot(&z, &z).map(|square| if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 });
            self.each(&mut x, |first, x| {
                for (x, z) in x.iter_mut().zip(&z[first..]) {
                    for k in 0..3 {
                        for l in 0..LANES {
                            x[k][l] = z[k][l] * size[l];
                        }
                    }
                }
            });
        }
        largest.max(f64::MIN_POSITIVE)
    }
}

/// Where an iteration starts.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum From {
    Zero,
    Here,
}

#[inline(always)]
fn add_block(block: &[f64; 9], x: &Node, sum: &mut Node) {
    for row in 0..3 {
        for column in 0..3 {
            let a = block[3 * row + column];
            for l in 0..LANES {
                sum[row][l] += a * x[column][l];
            }
        }
    }
}

/// Sums of products of two vectors, one for each load: chunk by chunk, always in the same order.
pub(crate) fn dot(a: &Vector, b: &Vector) -> [f64; LANES] {
    let arch = pulp::Arch::new();
    let parts: Vec<[f64; LANES]> = a
        .par_chunks(CHUNK)
        .zip(b.par_chunks(CHUNK))
        .map(|(a, b)| {
            arch.dispatch(|| {
                let mut sum = [0.0; LANES];
                for (a, b) in a.iter().zip(b) {
                    for k in 0..3 {
                        for l in 0..LANES {
                            sum[l] += a[k][l] * b[k][l];
                        }
                    }
                }
                sum
            })
        })
        .collect();
    let mut sum = [0.0; LANES];
    for part in parts {
        for l in 0..LANES {
            sum[l] += part[l];
        }
    }
    sum
}

/// y += factor · x for each load.
pub(crate) fn add_scaled(y: &mut Vector, factor: &[f64; LANES], x: &Vector) {
    let arch = pulp::Arch::new();
    y.par_chunks_mut(CHUNK).zip(x.par_chunks(CHUNK)).for_each(|(y, x)| {
        arch.dispatch(|| {
            for (y, x) in y.iter_mut().zip(x) {
                for k in 0..3 {
                    for l in 0..LANES {
                        y[k][l] += factor[l] * x[k][l];
                    }
                }
            }
        });
    });
}

/// p = z + factor · p for each load.
pub(crate) fn turn_towards(p: &mut Vector, factor: &[f64; LANES], z: &Vector) {
    let arch = pulp::Arch::new();
    p.par_chunks_mut(CHUNK).zip(z.par_chunks(CHUNK)).for_each(|(p, z)| {
        arch.dispatch(|| {
            for (p, z) in p.iter_mut().zip(z) {
                for k in 0..3 {
                    for l in 0..LANES {
                        p[k][l] = z[k][l] + factor[l] * p[k][l];
                    }
                }
            }
        });
    });
}

fn assemble(about: &[u32; CORNERS], matrices: &[Matrix]) -> Stencil {
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

/// Inverse of a block of the diagonal; axes that are held, whose row is zero, stay zero.
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

/// Weights of a coarse cell's two nodes along an axis, for the two nodes of a fine cell in it.
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

/// What a coarse cell's corners contribute to a fine cell's, at one of eight positions in it.
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

/// Which axes the next grid halves.
pub(crate) fn halved(counts: [usize; 3]) -> [bool; 3] {
    counts.map(|cells| cells > 1)
}

/// The cells of a grid that is half as fine, with the energy that the fine cells have in its displacements.
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

/// What takes vectors of a grid to the next coarser one and back.
pub(crate) struct Transfer {
    /// Numbers and weights of the coarse nodes about each fine one.
    coarse: Vec<[(u32, f64); CORNERS]>,
    /// Numbers and weights of the fine nodes about each coarse one.
    fine: Vec<[(u32, f64); 27]>,
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
                        weight *= 1.0 - c[k] as f64;
                        at[k] / 2
                    }
                    (false, _) => {
                        weight *= 1.0 - c[k] as f64;
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

    /// The coarse forces that do the same work as fine ones.
    pub(crate) fn restrict(&self, fine: &Vector, level: &Level, out: &mut Vector) {
        level.each(out, |first, out| {
            for (out, from) in out.iter_mut().zip(&self.fine[first..]) {
                *out = ZERO;
                for (n, weight) in from.iter().filter(|(_, weight)| *weight > 0.0) {
                    add_weighted(out, *weight, &fine[*n as usize]);
                }
            }
        });
    }

    /// Adds coarse displacements to fine ones.
    pub(crate) fn prolong(&self, coarse: &Vector, level: &Level, out: &mut Vector) {
        level.each(out, |first, out| {
            for (out, from) in out.iter_mut().zip(&self.coarse[first..]) {
                for (n, weight) in from.iter().filter(|(_, weight)| *weight > 0.0) {
                    add_weighted(out, *weight, &coarse[*n as usize]);
                }
            }
        });
    }
}

#[inline(always)]
fn add_weighted(out: &mut Node, weight: f64, from: &Node) {
    for k in 0..3 {
        for l in 0..LANES {
            out[k][l] += weight * from[k][l];
        }
    }
}
