//! The clamps of a body, and whether they hold it.

use crate::element::CORNERS;
use crate::solid::{Filling, Solid, ravel, unravel};
use nalgebra::{Matrix3, SMatrix, Vector3};
use std::collections::BTreeMap;

/// A clamp. It holds the material in its box.
///
/// # Examples
/// ```
/// use deflex_elastic::Clamp;
///
/// // It holds the face x = 0 rigidly along x and y, and lets it slide along z.
/// let clamp = Clamp { bounds: [[0.0; 3], [0.0, 4.0, 4.0]], stiffness: [f64::INFINITY, f64::INFINITY, 0.0] };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clamp {
    /// Lower and upper corner, mm. Nodes less than half a cell outside belong to the clamp too, so that a box without thickness
    /// can clamp a face.
    pub bounds: [[f64; 3]; 2],
    /// Stiffness of the whole clamp along x, y and z, N/mm, spread evenly over its nodes: infinite if it is rigid, zero if it
    /// slides.
    pub stiffness: [f64; 3],
}

/// Why a body cannot be loaded.
///
/// # Examples
/// ```
/// use deflex_elastic::{Body, Grid, HoldError, Material, Solid};
///
/// let bar = Solid::of(Grid::over([0.0; 3], [8.0, 4.0, 4.0], 1.0), |_| 1.0);
/// let held = Body::new(&bar, Material { e: 71_000.0, nu: 0.33 }, &[]);
/// assert!(matches!(held, Err(HoldError::Free { turns: false }))); // it has no clamp
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HoldError {
    /// No cell has material.
    #[error("there is no material")]
    Empty,
    /// No node of the body is in the box of a clamp. The index is that of the clamp.
    #[error("clamp {} touches no material", .0 + 1)]
    Untouched(usize),
    /// The clamps leave the body free to move or to turn.
    #[error("the clamps leave the part free to {}", if *turns { "turn" } else { "move" })]
    Free {
        /// Whether it is free to turn, and not to move.
        turns: bool,
    },
}

/// The nodes of a grid that clamps hold.
pub(crate) struct Holds {
    pub(crate) rigid: Vec<Rigid>,
    pub(crate) springs: Vec<Spring>,
}

/// A node that a clamp holds rigidly along some axes.
#[derive(Clone, Copy)]
pub(crate) struct Rigid {
    /// Number of the node in the whole grid.
    pub(crate) node: u32,
    pub(crate) clamp: usize,
    pub(crate) axes: [bool; 3],
}

/// A node that a clamp holds by a spring.
#[derive(Clone, Copy)]
pub(crate) struct Spring {
    /// Number of the node in the whole grid.
    pub(crate) node: u32,
    pub(crate) clamp: usize,
    /// Stiffness along each axis, N/mm.
    pub(crate) stiffness: [f64; 3],
}

/// The cells that are joined to a held node, face to face. All others carry nothing and are left out.
pub(crate) struct Held {
    pub(crate) cells: Vec<Filling>,
    pub(crate) holds: Holds,
}

/// The body is held if its softest motion as a rigid body is stiffer than this share of the stiffest one. Rounding leaves about
/// 1e-16 of it.
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
    // If several clamps hold a node rigidly, it belongs to the first one.
    let mut taken: BTreeMap<u32, [bool; 3]> = BTreeMap::new();
    for (number, clamp) in clamps.iter().enumerate() {
        let mut range = [[0; 2]; 3];
        for k in 0..3 {
            // A little less than half a cell, so that a box that ends at nodes holds no nodes beyond them.
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

/// Checks that the body cannot move as a whole.
fn is_held(solid: &Solid, holds: &Holds) -> Result<(), HoldError> {
    let (grid, nodes) = (&solid.grid, solid.grid.nodes());
    let middle = grid.place(grid.cells.map(|cells| cells / 2));
    let reach: f64 = (0..3).map(|k| grid.size[k] * grid.cells[k] as f64).fold(0.0, f64::max);
    // Every hold counts with the same stiffness, because only the directions matter.
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
