//! Where a body is held, and whether that holds it.

use crate::element::CORNERS;
use crate::solid::{Filling, Solid, ravel, unravel};
use nalgebra::{Matrix3, SMatrix, Vector3};
use std::collections::BTreeMap;

/// A clamp: what is in its box is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clamp {
    /// Lower and upper corner, mm. Nodes less than half a cell outside of it belong to it too, so that a face can be clamped by
    /// a box without thickness.
    pub bounds: [[f64; 3]; 2],
    /// Stiffness of the clamp as a whole along x, y and z, N/mm, spread evenly over its nodes; infinite where it is rigid, zero
    /// where it slides.
    pub stiffness: [f64; 3],
}

/// Why a body cannot be loaded.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HoldError {
    /// No cell has material.
    #[error("there is no material")]
    Empty,
    /// A clamp has no node of the body in its box; the index is that of the clamp.
    #[error("clamp {} touches no material", .0 + 1)]
    Untouched(usize),
    /// The clamps leave the body free to move or to turn.
    #[error("the clamps leave the part free to {}", if *turns { "turn" } else { "move" })]
    Free {
        /// Whether it turns, rather than moves.
        turns: bool,
    },
}

/// What holds each node of a grid.
pub(crate) struct Holds {
    pub(crate) rigid: Vec<Rigid>,
    pub(crate) springs: Vec<Spring>,
}

/// A node that a clamp holds along some axes.
#[derive(Clone, Copy)]
pub(crate) struct Rigid {
    /// Of the whole grid.
    pub(crate) node: u32,
    pub(crate) clamp: usize,
    pub(crate) axes: [bool; 3],
}

/// A node that a clamp holds by a spring.
#[derive(Clone, Copy)]
pub(crate) struct Spring {
    /// Of the whole grid.
    pub(crate) node: u32,
    pub(crate) clamp: usize,
    /// N/mm.
    pub(crate) stiffness: [f64; 3],
}

/// Cells that are joined to what is held, face to face: all others carry nothing, and are left out.
pub(crate) struct Held {
    pub(crate) cells: Vec<Filling>,
    pub(crate) holds: Holds,
}

/// A direction in which the least stiff motion of the rigid body is stiffer than this share of the stiffest one is held.
/// Rounding leaves some 1e-16 of it.
const FREE: f64 = 1e-10;

pub(crate) fn hold(solid: &Solid, clamps: &[Clamp]) -> Result<Held, HoldError> {
    let grid = &solid.grid;
    let nodes = grid.nodes();
    if solid.elements() == 0 {
        return Err(HoldError::Empty);
    }
    let has_material = |node: [usize; 3]| {
        (0..CORNERS).any(|a| {
            let cell: [usize; 3] = std::array::from_fn(|k| node[k].wrapping_sub(a >> k & 1));
            (0..3).all(|k| cell[k] < grid.cells[k]) && solid.cells[ravel(grid.cells, cell)] != Filling::Empty
        })
    };
    let mut holds = Holds { rigid: Vec::new(), springs: Vec::new() };
    // What the first of several clamps has made rigid is its own.
    let mut taken: BTreeMap<u32, [bool; 3]> = BTreeMap::new();
    for (number, clamp) in clamps.iter().enumerate() {
        let mut range = [[0; 2]; 3];
        for k in 0..3 {
            // A little less than half a cell, so that a box that ends on nodes holds no more than these.
            let reach = 0.499 * grid.size[k];
            let first = ((clamp.bounds[0][k] - reach - grid.low[k]) / grid.size[k]).ceil().max(0.0);
            let last = ((clamp.bounds[1][k] + reach - grid.low[k]) / grid.size[k]).floor().min(grid.cells[k] as f64);
            range[k] = if last < first { [1, 0] } else { [first as usize, last as usize] };
        }
        let [x, y, z] = range.map(|[first, last]| first..=last);
        let held: Vec<u32> = z
            .flat_map(|k| y.clone().map(move |j| (j, k)))
            .flat_map(|(j, k)| x.clone().map(move |i| [i, j, k]))
            .filter(|node| has_material(*node))
            .map(|node| ravel(nodes, node) as u32)
            .collect();
        if held.is_empty() {
            return Err(HoldError::Untouched(number));
        }
        let rigid = clamp.stiffness.map(f64::is_infinite);
        let spring = clamp.stiffness.map(|all| if all.is_finite() { all / held.len() as f64 } else { 0.0 });
        for node in held {
            let taken = taken.entry(node).or_default();
            let axes: [bool; 3] = std::array::from_fn(|k| rigid[k] && !taken[k]);
            (0..3).for_each(|k| taken[k] |= rigid[k]);
            if axes.contains(&true) {
                holds.rigid.push(Rigid { node, clamp: number, axes });
            }
            if spring.iter().any(|spring| *spring > 0.0) {
                holds.springs.push(Spring { node, clamp: number, stiffness: spring });
            }
        }
    }
    let cells = joined(solid, &holds);
    is_held(solid, &holds)?;
    Ok(Held { cells, holds })
}

/// The cells that are joined face to face to a held node.
fn joined(solid: &Solid, holds: &Holds) -> Vec<Filling> {
    let counts = solid.grid.cells;
    let mut reached = vec![false; solid.cells.len()];
    let mut open = Vec::new();
    let held = holds.rigid.iter().map(|held| held.node).chain(holds.springs.iter().map(|held| held.node));
    for node in held {
        let node = unravel(solid.grid.nodes(), node as usize);
        for a in 0..CORNERS {
            let cell: [usize; 3] = std::array::from_fn(|k| node[k].wrapping_sub(a >> k & 1));
            if (0..3).all(|k| cell[k] < counts[k]) {
                open.push(ravel(counts, cell));
            }
        }
    }
    while let Some(number) = open.pop() {
        if solid.cells[number] == Filling::Empty || std::mem::replace(&mut reached[number], true) {
            continue;
        }
        let cell = unravel(counts, number);
        for k in 0..3 {
            let mut next = cell;
            if cell[k] > 0 {
                next[k] = cell[k] - 1;
                open.push(ravel(counts, next));
            }
            if cell[k] + 1 < counts[k] {
                next[k] = cell[k] + 1;
                open.push(ravel(counts, next));
            }
        }
    }
    solid.cells.iter().zip(reached).map(|(filling, reached)| if reached { *filling } else { Filling::Empty }).collect()
}

/// Whether the holds leave the body no motion as a whole.
fn is_held(solid: &Solid, holds: &Holds) -> Result<(), HoldError> {
    let (grid, nodes) = (&solid.grid, solid.grid.nodes());
    let middle = grid.place(grid.cells.map(|cells| cells / 2));
    let reach: f64 = (0..3).map(|k| grid.size[k] * grid.cells[k] as f64).fold(0.0, f64::max);
    // As stiff as the stiffest spring, whatever that is: only whether it holds counts.
    let mut stiffness = SMatrix::<f64, 6, 6>::zeros();
    let rigid = holds.rigid.iter().map(|held| (held.node, held.axes.map(|rigid| f64::from(u8::from(rigid)))));
    let springs = holds.springs.iter().map(|held| (held.node, held.stiffness.map(|k| f64::from(u8::from(k > 0.0)))));
    for (node, held) in rigid.chain(springs) {
        let place = grid.place(unravel(nodes, node as usize));
        let arm = Vector3::from_fn(|k, _| (place[k] - middle[k]) / reach);
        for k in 0..3 {
            if held[k] > 0.0 {
                let mut axis = Vector3::zeros();
                axis[k] = 1.0;
                let turn = arm.cross(&axis);
                let motion = SMatrix::<f64, 6, 1>::from_fn(|row, _| if row < 3 { axis[row] } else { turn[row - 3] });
                stiffness += motion * motion.transpose();
            }
        }
    }
    let shifts: Matrix3<f64> = stiffness.fixed_view::<3, 3>(0, 0).into_owned();
    let most = stiffness.trace();
    if shifts.symmetric_eigenvalues().min() <= FREE * most {
        return Err(HoldError::Free { turns: false });
    }
    if stiffness.symmetric_eigenvalues().min() <= FREE * most {
        return Err(HoldError::Free { turns: true });
    }
    Ok(())
}
