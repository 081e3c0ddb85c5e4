//! A clamped body, and its displacements under forces.

use crate::direct::{Band, cost, ordered};
use crate::element::{CORNERS, Element, Matrix, Rule, SIZE, shape};
use crate::level::{
    Cells, LANES, Level, NONE, SHARED, Sweep, Transfer, Vector, add_scaled, coarser, dot, halved, turn_towards,
};
use crate::solid::{Filling, Solid, ravel, unravel};
use crate::support::{Clamp, Held, HoldError, Holds, Rigid, Spring, hold};
use nalgebra::{DMatrix, Matrix3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// An isotropic material.
///
/// # Examples
/// ```
/// use deflex_elastic::Material;
///
/// let aluminium = Material { e: 71_000.0, nu: 0.33 }; // N/mm²
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus, N/mm².
    pub e: f64,
    /// Poisson's ratio, from 0 to below 0.5.
    pub nu: f64,
}

/// Largest number of operations for the direct solution of the coarsest grid: about a second, once for each body.
const DIRECT: f64 = 1.5e9;
/// Largest number of values in it: each round of the iteration reads all of them.
const DIRECT_SIZE: usize = 1_500_000;
/// Largest number of grids in the hierarchy: each is half as fine as the one before.
const LEVELS: usize = 16;
/// Largest number of rounds of conjugate gradients. The result is used as it is then.
const ROUNDS: usize = 300;
/// Number of last rounds whose progress decides whether the iteration ends.
const LATEST: usize = 2;
/// The iteration for a single compliance ends when these rounds added less than this share of the energy.
const SETTLED: f64 = 3e-4;
/// Number of cells to each side over which a [map](crate::ComplianceMap) spreads a force. This keeps the local dent small, for
/// which the grid is too coarse.
const SPREAD: f64 = 2.0;
/// A cell with less than this share of material carries no force itself: the nearest cell with more material carries it.
const CARRIES: f64 = 0.05;

/// A clamped part, ready to be loaded.
///
/// # Examples
/// ```
/// # use deflex_elastic::{Body, Clamp, Grid, Material, Solid};
/// # let bar = Solid::of(Grid::over([0.0; 3], [40.0, 4.0, 4.0], 1.0), |_| 1.0);
/// # let end = Clamp { bounds: [[0.0; 3], [0.0, 4.0, 4.0]], stiffness: [f64::INFINITY; 3] };
/// # let body = Body::new(&bar, Material { e: 71_000.0, nu: 0.33 }, &[end])?;
/// assert_eq!(body.elements(), 40 * 4 * 4);
/// let tip = body.compliance(&[[40.0, 2.0, 2.0]])[0]; // mm/N
/// let face = body.compliance_of(&[vec![([40.0, 1.0, 2.0], 0.5), ([40.0, 3.0, 2.0], 0.5)]])[0];
/// assert!(face[(2, 2)] < 1.1 * tip[(2, 2)]);
/// # Ok::<(), deflex_elastic::HoldError>(())
/// ```
pub struct Body {
    levels: Vec<Level>,
    transfers: Vec<Transfer>,
    coarsest: Band,
    /// The nodes that clamps hold rigidly.
    rigid: Vec<Rigid>,
    pub(crate) grid: crate::Grid,
    cells: Vec<Filling>,
    shares: Vec<f64>,
    pub(crate) pulled: Pulled,
}

/// The forces of a motion of a clamp by 1 mm along an axis while all free nodes stay where they are. The motion has the number
/// 3·clamp + axis.
pub(crate) struct Pulled {
    /// Forces on the free nodes (of the whole grid), N.
    pub(crate) loads: Vec<BTreeMap<u32, Vector3<f64>>>,
    /// Forces at each clamp, N/mm.
    pub(crate) at_clamps: DMatrix<f64>,
}

/// The place of a force: the numbers of the nodes that carry it, and the share of each.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spot(pub(crate) Vec<(u32, f64)>);

/// Forces on nodes: the number of the node, and the force by axis.
pub(crate) type Load = Vec<(u32, Vector3<f64>)>;

impl Spot {
    /// The load of a force at this spot.
    pub(crate) fn under(&self, force: &Vector3<f64>) -> Load {
        self.0.iter().map(|(number, share)| (*number, force * *share)).collect()
    }
}

/// The result of the iteration.
pub(crate) struct Solved {
    /// Displacements to be added to those from which the iteration started.
    pub(crate) change: Vector,
    /// Residual forces.
    pub(crate) left: Vector,
    /// Work that the change adds for each load, N·mm. For unit forces this is the compliance.
    pub(crate) won: [f64; LANES],
    /// Number of rounds.
    pub(crate) rounds: usize,
}

/// The vectors that the iteration needs for one grid, and those for the next coarser one.
struct Work {
    step: Vector,
    next: Vector,
    coarse_b: Vector,
    coarse_x: Vector,
}

impl Body {
    /// Holds a solid by clamps.
    ///
    /// # Errors
    /// No material, a clamp that touches none, or a body that is free to move.
    pub fn new(solid: &Solid, material: Material, clamps: &[Clamp]) -> Result<Self, HoldError> {
        let Held { cells, holds } = hold(solid, clamps)?;
        let Stiffnesses { cells: fine, shares, pulled } = stiffnesses(solid, material, &cells, &holds, clamps.len());
        let mut levels = vec![Level::new(&fine)];
        let mut transfers = Vec::new();
        let mut cells_of_level = fine;
        while levels.len() < LEVELS {
            let last = &levels[levels.len() - 1];
            let (_, width) = ordered(last);
            let unknowns = 3 * last.len();
            let small = cost(unknowns, width) < DIRECT && unknowns * width < DIRECT_SIZE;
            if small || cells_of_level.counts == [1; 3] {
                break;
            }
            let axes = halved(cells_of_level.counts);
            cells_of_level = coarser(&cells_of_level);
            let next = Level::new(&cells_of_level);
            transfers.push(Transfer::between(last, &next, axes));
            if let Some(middle) = levels.iter_mut().skip(1).last() {
                middle.forget_exact();
            }
            levels.push(next);
        }
        let coarsest = Band::new(&levels[levels.len() - 1]);
        let rigid = holds.rigid.iter().map(|held| Rigid { node: levels[0].number[held.node as usize], ..*held });
        let rigid = rigid.filter(|held| held.node != NONE).collect();
        Ok(Self { levels, transfers, coarsest, rigid, grid: solid.grid, cells, shares, pulled })
    }

    /// Number of cells with material that is joined to a clamp.
    #[must_use]
    pub fn elements(&self) -> usize {
        self.cells.iter().filter(|filling| **filling != Filling::Empty).count()
    }

    /// Compliance (mm/N) at places on the surface (mm): the displacement there by axis (rows) under a unit force by axis
    /// (columns). A force is spread over the nodes of the cell on which it acts, and the compliance includes its local dent.
    ///
    /// The result is accurate to about a thousandth. A place outside of the body is moved to the nearest cell of the body.
    #[must_use]
    pub fn compliance(&self, places: &[[f64; 3]]) -> Vec<Matrix3<f64>> {
        self.compliance_of(&places.iter().map(|place| vec![(*place, 1.0)]).collect::<Vec<_>>())
    }

    /// The same for forces that are spread over several places by shares: the mean displacement with these shares, under shares
    /// of a unit force.
    #[must_use]
    pub fn compliance_of(&self, patches: &[Vec<([f64; 3], f64)>]) -> Vec<Matrix3<f64>> {
        let spread = |patch: &Vec<([f64; 3], f64)>| {
            let at = |(place, share): &([f64; 3], f64)| {
                self.point(*place).0.into_iter().map(|(number, own)| (number, own * share)).collect::<Vec<_>>()
            };
            Spot(patch.iter().flat_map(at).collect())
        };
        self.compliance_at(&patches.iter().map(spread).collect::<Vec<_>>())
    }

    /// The compliance at spots.
    pub(crate) fn compliance_at(&self, spots: &[Spot]) -> Vec<Matrix3<f64>> {
        let mut all = vec![Matrix3::zeros(); spots.len()];
        let loads: Vec<(usize, usize)> = (0..spots.len()).flat_map(|n| (0..3).map(move |k| (n, k))).collect();
        for batch in loads.chunks(LANES) {
            let forces: Vec<Load> = batch.iter().map(|(n, k)| spots[*n].under(&unit(*k))).collect();
            let solved = self.solve(self.loaded(&forces), |_, won, latest| latest <= SETTLED * won);
            for (lane, (n, k)) in batch.iter().enumerate() {
                all[*n].set_column(*k, &self.sample(&solved.change, lane, &spots[*n]));
            }
        }
        all.into_iter().map(|c| (c + c.transpose()) * 0.5).collect()
    }

    /// The nodes that carry a force at a place: those of the cell that contains it, or of the nearest cell.
    fn point(&self, place: [f64; 3]) -> Spot {
        let (cell, at) = self.nearest(place);
        let nodes = self.grid.nodes();
        let corner = |a: usize| ravel(nodes, std::array::from_fn(|k| cell[k] + (a >> k & 1)));
        let shares = shape(at);
        Spot((0..CORNERS).filter_map(|a| Some((self.number(corner(a))?, shares[a]))).collect())
    }

    /// The nodes that carry a force that is spread around a place: those less than [`SPREAD`] cells from it along each axis.
    /// Their shares depend on their distance and on the material in the cells around them.
    pub(crate) fn spread(&self, place: [f64; 3]) -> Spot {
        let (cell, at) = self.nearest(place);
        let grid = &self.grid;
        let nodes = grid.nodes();
        let middle: [f64; 3] = std::array::from_fn(|k| cell[k] as f64 + at[k]);
        let range = |k: usize| {
            let first = (middle[k] - SPREAD).max(0.0).ceil() as usize;
            first..=((middle[k] + SPREAD).floor() as usize).min(grid.cells[k])
        };
        let mut shares = Vec::new();
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    let node = [i, j, k];
                    let Some(number) = self.number(ravel(nodes, node)) else { continue };
                    let near: f64 = (0..3).map(|k| 1.0 - (node[k] as f64 - middle[k]).abs() / SPREAD).product();
                    let material: f64 = (0..CORNERS)
                        .map(|a| {
                            let cell: [usize; 3] = std::array::from_fn(|k| node[k].wrapping_sub(a >> k & 1));
                            let inside = (0..3).all(|k| cell[k] < grid.cells[k]);
                            if inside { self.shares[ravel(grid.cells, cell)] } else { 0.0 }
                        })
                        .sum();
                    if near > 0.0 && material > 0.0 {
                        shares.push((number, near * material));
                    }
                }
            }
        }
        let sum: f64 = shares.iter().map(|(_, share)| share).sum();
        if sum <= 0.0 {
            return self.point(place);
        }
        shares.iter_mut().for_each(|(_, share)| *share /= sum);
        Spot(shares)
    }

    /// The nearest cell with enough material to carry a force at a place, and the position in the cell (0 to 1).
    fn nearest(&self, place: [f64; 3]) -> ([usize; 3], [f64; 3]) {
        let grid = &self.grid;
        let home: [i64; 3] = std::array::from_fn(|k| {
            (((place[k] - grid.low[k]) / grid.size[k]).floor() as i64).clamp(0, grid.cells[k] as i64 - 1)
        });
        let most = *grid.cells.iter().max().unwrap_or(&1) as i64;
        let mut best: Option<(f64, [usize; 3], [f64; 3])> = None;
        let mut found_at = None;
        for ring in 0..=most {
            // One ring more than the first one with such a cell, because the corners of a ring are farther away than the faces of
            // the next one.
            if found_at.is_some_and(|found| ring > found + 1) {
                break;
            }
            let range = |k: usize| (home[k] - ring).max(0)..=(home[k] + ring).min(grid.cells[k] as i64 - 1);
            for k in range(2) {
                for j in range(1) {
                    for i in range(0) {
                        let cell = [i, j, k];
                        if (0..3).map(|k| (cell[k] - home[k]).abs()).max() != Some(ring) {
                            continue;
                        }
                        let cell = cell.map(|c| c as usize);
                        let number = ravel(grid.cells, cell);
                        if self.cells[number] == Filling::Empty || self.shares[number] < CARRIES {
                            continue;
                        }
                        let low = grid.place(cell);
                        let at: [f64; 3] =
                            std::array::from_fn(|k| ((place[k] - low[k]) / grid.size[k]).clamp(0.0, 1.0));
                        let distance: f64 = (0..3).map(|k| (low[k] + at[k] * grid.size[k] - place[k]).powi(2)).sum();
                        if best.is_none_or(|(least, ..)| distance < least) {
                            best = Some((distance, cell, at));
                            found_at = found_at.or(Some(ring));
                        }
                    }
                }
            }
        }
        best.map_or(([0; 3], [0.5; 3]), |(_, cell, at)| (cell, at))
    }

    /// Displacement of one load at a spot, mm.
    pub(crate) fn sample(&self, x: &Vector, lane: usize, spot: &Spot) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (number, share) in &spot.0 {
            sum += Vector3::from_fn(|k, _| share * f64::from(x[*number as usize][k][lane]));
        }
        sum
    }

    /// Number of a node of the whole grid; `None` for a node without material.
    pub(crate) fn number(&self, node: usize) -> Option<u32> {
        Some(self.levels[0].number[node]).filter(|number| *number != NONE)
    }

    pub(crate) fn zeros(&self) -> Vector {
        self.levels[0].zeros()
    }

    pub(crate) fn fine(&self) -> &Level {
        &self.levels[0]
    }

    /// Sets the displacements of rigid nodes to zero.
    pub(crate) fn hold(&self, x: &mut Vector) {
        for Rigid { node, axes, .. } in &self.rigid {
            for k in 0..3 {
                if axes[k] {
                    x[*node as usize][k] = [0.0; LANES];
                }
            }
        }
    }

    /// Moves the rigid nodes of a clamp by 1 mm with it (motion 3·clamp + axis).
    pub(crate) fn move_held(&self, motion: usize, field: &mut [[f32; 3]]) {
        let axis = motion % 3;
        for held in self.rigid.iter().filter(|held| held.clamp == motion / 3 && held.axes[axis]) {
            field[held.node as usize][axis] = 1.0;
        }
    }

    /// The forces of loads, each in its own lane.
    pub(crate) fn loaded(&self, loads: &[Load]) -> Vector {
        let mut b = self.zeros();
        for (lane, load) in loads.iter().enumerate() {
            for (number, force) in load {
                for k in 0..3 {
                    b[*number as usize][k][lane] += force[k] as f32;
                }
            }
        }
        self.hold(&mut b);
        b
    }

    /// Displacements under forces, for each load by itself. The iteration ends when `settled` is true for every load; it receives
    /// the lane, the work so far, and the work that the last rounds added.
    pub(crate) fn solve(&self, forces: Vector, settled: impl Fn(usize, f64, f64) -> bool) -> Solved {
        let fine = &self.levels[0];
        let mut r = forces;
        let (mut x, mut q, mut z) = (fine.zeros(), fine.zeros(), fine.zeros());
        let mut work = self.work();
        self.cycle(0, &r, &mut z, &mut work);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let mut gains: Vec<[f64; LANES]> = Vec::new();
        let mut won = [0.0; LANES];
        let mut rounds = 0;
        while rounds < ROUNDS {
            rounds += 1;
            let pq = fine.apply(&p, &mut q);
            let alpha: [f64; LANES] = std::array::from_fn(|l| if pq[l] > 0.0 { rz[l] / pq[l] } else { 0.0 });
            add_scaled(&mut x, &alpha, &p);
            add_scaled(&mut r, &alpha.map(|a| -a), &q);
            let gain: [f64; LANES] = std::array::from_fn(|l| alpha[l] * rz[l]);
            for l in 0..LANES {
                won[l] += gain[l];
            }
            gains.push(gain);
            let latest = |l: usize| gains.iter().rev().take(LATEST).map(|gain| gain[l]).sum::<f64>();
            if gains.len() >= LATEST && (0..LANES).all(|l| settled(l, won[l], latest(l))) {
                break;
            }
            self.cycle(0, &r, &mut z, &mut work);
            let next = dot(&r, &z);
            let beta: [f64; LANES] = std::array::from_fn(|l| if rz[l] > 0.0 { next[l] / rz[l] } else { 0.0 });
            rz = next;
            turn_towards(&mut p, &beta, &z);
        }
        self.hold(&mut x);
        Solved { change: x, left: r, won, rounds }
    }

    fn work(&self) -> Vec<Work> {
        let of = |pair: &[Level]| Work {
            step: pair[0].zeros(),
            next: pair[0].zeros(),
            coarse_b: pair[1].zeros(),
            coarse_x: pair[1].zeros(),
        };
        self.levels.windows(2).map(of).collect()
    }

    /// x = M⁻¹ b: one cycle of multigrid, from this grid to the coarsest one and back.
    fn cycle(&self, at: usize, b: &Vector, x: &mut Vector, work: &mut [Work]) {
        let (level, [own, rest @ ..]) = (&self.levels[at], work) else {
            self.coarsest.solve(b, x);
            return;
        };
        let transfer = &self.transfers[at];
        level.sweep(Sweep::FirstFromZero { b }, &mut own.step);
        level.sweep(Sweep::Second { b, x: &own.step, step: &own.step }, x);
        level.sweep(Sweep::Residual { b, x }, &mut own.next);
        transfer.restrict(&own.next, &mut own.coarse_b);
        self.cycle(at + 1, &own.coarse_b, &mut own.coarse_x, rest);
        transfer.prolong(&own.coarse_x, x);
        level.sweep(Sweep::First { b, x }, &mut own.step);
        add_scaled(x, &[1.0; LANES], &own.step);
        level.sweep(Sweep::Second { b, x, step: &own.step }, &mut own.next);
        std::mem::swap(x, &mut own.next);
    }
}

pub(crate) fn unit(axis: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 })
}

struct Stiffnesses {
    /// The stiffness of each cell. The spring of a node is added to one of the cells around it, and the rows of rigid nodes are
    /// removed.
    cells: Cells,
    /// The share of each cell that is material.
    shares: Vec<f64>,
    pulled: Pulled,
}

fn stiffnesses(solid: &Solid, material: Material, fillings: &[Filling], holds: &Holds, clamps: usize) -> Stiffnesses {
    let grid = &solid.grid;
    let element = Element::new(grid.size, material.e, material.nu);
    let nodes = grid.nodes();
    // The clamp that holds each axis of a node.
    let mut rigid_of = vec![[None; 3]; nodes.iter().product()];
    for Rigid { node, clamp, axes } in &holds.rigid {
        for k in 0..3 {
            if axes[k] {
                rigid_of[*node as usize][k] = Some(*clamp);
            }
        }
    }
    let corner = |cell: usize, a: usize| {
        let cell = unravel(grid.cells, cell);
        ravel(nodes, std::array::from_fn(|k| cell[k] + (a >> k & 1)))
    };
    // Springs, sorted by their cell.
    let mut sprung: Vec<(usize, usize, [f64; 3])> = Vec::new();
    for Spring { node, stiffness, .. } in &holds.springs {
        let at = unravel(nodes, *node as usize);
        let cell = (0..CORNERS).find_map(|a| {
            let cell: [usize; 3] = std::array::from_fn(|k| at[k].wrapping_sub(a >> k & 1));
            let number = (0..3).all(|k| cell[k] < grid.cells[k]).then(|| ravel(grid.cells, cell))?;
            (fillings[number] != Filling::Empty).then_some((number, a))
        });
        if let Some((cell, a)) = cell {
            sprung.push((cell, a, *stiffness));
        }
    }
    sprung.sort_by_key(|(cell, ..)| *cell);
    enum Own {
        Plain(Option<u32>),
        Held(usize),
    }
    let mut own: Vec<Own> = vec![Own::Plain(None)];
    let matrix: Vec<u32> = (0..grid.len())
        .map(|cell| {
            if fillings[cell] == Filling::Empty {
                return NONE;
            }
            let held = sprung.binary_search_by_key(&cell, |(cell, ..)| *cell).is_ok()
                || (0..CORNERS).any(|a| rigid_of[corner(cell, a)] != [None; 3]);
            match fillings[cell] {
                Filling::Full if !held => SHARED,
                Filling::Cut(rule) if !held => {
                    own.push(Own::Plain(Some(rule)));
                    own.len() as u32 - 1
                }
                _ => {
                    own.push(Own::Held(cell));
                    own.len() as u32 - 1
                }
            }
        })
        .collect();
    let stiffness = |filling: Filling| match filling {
        Filling::Cut(rule) => element.stiffness(&solid.rules[rule as usize]),
        _ => element.stiffness(&Rule::full()),
    };
    let full = stiffness(Filling::Full);
    let of = |own: &Own| -> Matrix {
        let cell = match own {
            Own::Plain(None) => return full,
            Own::Plain(Some(rule)) => return stiffness(Filling::Cut(*rule)),
            Own::Held(cell) => *cell,
        };
        let mut k = if fillings[cell] == Filling::Full { full } else { stiffness(fillings[cell]) };
        let first = sprung.partition_point(|(of, ..)| *of < cell);
        for (_, a, spring) in sprung[first..].iter().take_while(|(of, ..)| *of == cell) {
            for axis in 0..3 {
                k[(3 * a + axis, 3 * a + axis)] += spring[axis];
            }
        }
        for a in 0..CORNERS {
            for axis in 0..3 {
                if rigid_of[corner(cell, a)][axis].is_some() {
                    k.row_mut(3 * a + axis).fill(0.0);
                    k.column_mut(3 * a + axis).fill(0.0);
                }
            }
        }
        k
    };
    let matrices = own.par_iter().map(of).collect();
    let shares = fillings.iter().map(|filling| solid.share(*filling)).collect();
    let mut pulled =
        Pulled { loads: vec![BTreeMap::new(); 3 * clamps], at_clamps: DMatrix::zeros(3 * clamps, 3 * clamps) };
    for own in &own {
        let Own::Held(cell) = *own else { continue };
        let k = if fillings[cell] == Filling::Full { full } else { stiffness(fillings[cell]) };
        let held = |row: usize| rigid_of[corner(cell, row / 3)][row % 3].map(|clamp: usize| 3 * clamp + row % 3);
        for column in 0..SIZE {
            let Some(motion) = held(column) else { continue };
            for row in 0..SIZE {
                if let Some(other) = held(row) {
                    pulled.at_clamps[(other, motion)] += k[(row, column)];
                } else {
                    let node = corner(cell, row / 3) as u32;
                    pulled.loads[motion].entry(node).or_insert_with(Vector3::zeros)[row % 3] -= k[(row, column)];
                }
            }
        }
    }
    for Spring { node, clamp, stiffness } in &holds.springs {
        for k in 0..3 {
            if stiffness[k] > 0.0 && rigid_of[*node as usize][k].is_none() {
                let motion = 3 * clamp + k;
                pulled.loads[motion].entry(*node).or_insert_with(Vector3::zeros)[k] += stiffness[k];
                pulled.at_clamps[(motion, motion)] += stiffness[k];
            }
        }
    }
    Stiffnesses { cells: Cells { counts: grid.cells, matrix, matrices }, shares, pulled }
}
