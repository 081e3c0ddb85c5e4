//! The sum over the mask. Cells through which the rim of the engagement may run are quartered, the worst first, until the rim can
//! change the force only a little.

use super::front::{Cell, Ring};
use super::mask::engaged_parts;
use super::rim::Levels;
use super::solid::HypotFast;
use super::view::View;
use nalgebra::Vector3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

/// The error of a rim elsewhere in a cell may be this many times that at the middle.
const SAFETY: f64 = 2.0;

/// The rim is followed until it can change the force by at most this share of it,
const ENOUGH: f64 = 0.01;

/// or by at most this share of the force on the whole leading half of the cutter's corner: some tenths of a newton of some hundreds.
const NOTHING: f64 = 2e-4;

/// Most times that a cell is quartered.
const HALVINGS: u32 = 7;

/// Most cells that are quartered.
const MOST_CELLS: usize = 2000;

/// Sums over the mask, cutter frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    pub(super) edge: Vector3<f64>,
    pub(super) cutting: Vector3<f64>,
    /// Bounds of the errors of both because of the rim.
    pub(super) bound: [f64; 2],
    pub(super) section: f64,
    /// Lowest and highest engaged row.
    pub(super) rows: Option<[f64; 2]>,
}

/// A node of the mask: its position in the stock, m; the share of the feed that goes into the surface there; its depth in the material,
/// m, and the owner of the surface from which that depth counts.
#[derive(Clone, Copy)]
struct Node {
    point: Vector3<f64>,
    chip: f64,
    depth: f64,
    whose: u32,
}

impl Node {
    fn at(view: &View<'_>, ring: &Ring, angle: (f64, f64)) -> Self {
        let point = view.point(ring.across, ring.up, angle);
        let (depth, whose) = view.depth(&point);
        Self { point, chip: view.chip(ring, angle), depth, whose }
    }
}

/// The position of a cell of the mask: its lower corner, in columns and rows, and its size.
struct CellAt {
    at: [f64; 2],
    size: f64,
}

/// A cell of the mask through which the rim may run.
struct Leaf {
    /// Lower corner, in columns and rows, and size.
    at: [f64; 2],
    size: f64,
    halvings: u32,
    /// The corners, from the lower one around.
    corners: [Node; 4],
    middle: Node,
    sum: Sum,
    whole: bool,
}

/// A leaf, ordered by the error that it may cause.
struct Worst {
    error: f64,
    leaf: usize,
}

impl PartialEq for Worst {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Worst {}

impl PartialOrd for Worst {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Worst {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then(other.leaf.cmp(&self.leaf))
    }
}

/// The sum over the lowest rows of the mask.
pub(super) fn sum(view: &View<'_>, rows: usize) -> Sum {
    let mut cells = Cells::new(view);
    cells.grid(rows);
    cells.refine();
    let Cells { mut sure, leaves, .. } = cells;
    // Not the running sums: they have the rounding of what was subtracted.
    leaves.iter().filter(|leaf| leaf.whole).for_each(|leaf| sure.add(&leaf.sum));
    sure
}

struct Cells<'a, 'b> {
    view: &'a View<'b>,
    /// The sum over cells through which the rim does not run.
    sure: Sum,
    leaves: Vec<Leaf>,
    queue: BinaryHeap<Worst>,
    /// Running sums over all cells, and the errors that their rims may cause, as shares of the leading half.
    edge: Vector3<f64>,
    cutting: Vector3<f64>,
    error: f64,
}

impl<'a, 'b> Cells<'a, 'b> {
    fn new(view: &'a View<'b>) -> Self {
        let (sure, leaves, queue) = (Sum::default(), Vec::with_capacity(256), BinaryHeap::with_capacity(256));
        Self { view, sure, leaves, queue, edge: Vector3::zeros(), cutting: Vector3::zeros(), error: 0.0 }
    }

    /// A size in edge force and in cutting force, as a share of the leading half.
    fn share(&self, [edge, cutting]: [f64; 2]) -> f64 {
        let of = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        let [whole_edge, whole_cutting] = self.view.front.leading;
        of(edge, whole_edge) + of(cutting, whole_cutting)
    }

    /// The cells of the mask, row by row.
    fn grid(&mut self, rows: usize) {
        let (view, front) = (self.view, self.view.front);
        let fill = |nodes: &mut Vec<(f64, Option<Node>)>, row: usize| {
            let ring = front.ring(row as f64);
            nodes.clear();
            nodes.extend(front.edges.iter().map(|angle| (view.chip(&ring, *angle), None)));
            ring
        };
        let (mut below, mut above) = (Vec::with_capacity(front.around + 1), Vec::with_capacity(front.around + 1));
        let mut lower = fill(&mut below, 0);
        for row in 0..rows {
            let upper = fill(&mut above, row + 1);
            for column in 0..front.around {
                if [&below, &above].iter().all(|row| row[column].0 <= 0.0 && row[column + 1].0 <= 0.0) {
                    continue;
                }
                let node = |nodes: &mut [(f64, Option<Node>)], ring: &Ring, column: usize| {
                    *nodes[column].1.get_or_insert_with(|| Node::at(view, ring, front.edges[column]))
                };
                let corners = [
                    node(&mut below, &lower, column),
                    node(&mut below, &lower, column + 1),
                    node(&mut above, &upper, column + 1),
                    node(&mut above, &upper, column),
                ];
                self.take([column as f64, row as f64], 1.0, 0, corners);
            }
            std::mem::swap(&mut below, &mut above);
            lower = upper;
        }
        (self.edge, self.cutting) = (self.edge + self.sure.edge, self.cutting + self.sure.cutting);
    }

    /// Adds a cell: to the sum, or to the queue if the rim may run through it.
    fn take(&mut self, at: [f64; 2], size: f64, halvings: u32, corners: [Node; 4]) {
        let (view, front) = (self.view, self.view.front);
        if corners.iter().all(|node| node.chip <= 0.0) {
            return;
        }
        let ring = front.ring(at[1] + 0.5 * size);
        let lengths = [size * TAU * ring.across / front.around as f64, size * front.length(at[1])];
        // A depth changes by at most the distance: a feature farther than this from all corners is a sliver within the cell.
        let far = 0.4 * lengths[0].max(lengths[1]);
        let across = lengths[0].hypot_fast(lengths[1]);
        let least = corners.iter().fold(f64::INFINITY, |a, b| a.min(b.depth));
        let most = corners.iter().fold(f64::NEG_INFINITY, |a, b| a.max(b.depth));
        if most < -far || (most <= 0.0 && least < -across) {
            return;
        }
        let faces = corners.iter().all(|node| node.chip >= 0.0);
        let angle = view.angle(at[0] + 0.5 * size);
        let chip = view.chip(&ring, angle);
        if least > far {
            if faces {
                view.add_whole(&mut self.sure, at, size, halvings);
            } else {
                view.add_parts(&mut self.sure, at, size, corners.map(|node| node.chip), chip);
            }
            return;
        }
        let middle = Node::at(view, &ring, angle);
        if most <= 0.0 && middle.depth < -0.5 * across {
            return;
        }
        let depths = Levels { corners: corners.map(|node| node.depth), middle: middle.depth };
        let empty = depths.highest() <= 0.0;
        let full = !empty && depths.lowest() >= 0.0;
        let levels = if faces {
            depths
        } else if full {
            // The cell is in material: only the silhouette is a rim.
            Levels { corners: corners.map(|node| node.chip), middle: chip }.times(front.solid.radius)
        } else {
            let level = |node: Node| view.level(node.chip, node.depth);
            Levels { corners: corners.map(level), middle: level(middle) }
        };
        let (inside, outside) = (levels.lowest() >= 0.0, levels.highest() <= 0.0);
        let mut sum = Sum::default();
        if inside && faces && !empty {
            view.add_whole(&mut sum, at, size, halvings);
        } else if !outside {
            view.add_parts(&mut sum, at, size, levels.corners, levels.middle);
        }
        let [a, b, c, d] = corners;
        let (cell, nodes) = (CellAt { at, size }, [a, b, c, d, middle]);
        let of_depths = match (empty, full) {
            (true, _) => self.material_unseen(&cell, &nodes, &depths),
            (_, true) => self.gap_unseen(&cell, &nodes, &depths),
            _ => 0.0,
        };
        let off = match (empty || full, inside || outside) {
            (true, true) => of_depths,
            (true, false) => of_depths.max(levels.bulge().abs()),
            (false, true) => levels.kink(),
            (false, false) => levels.bulge().abs(),
        };
        let area = lengths[1] * size * TAU / front.around as f64;
        let share = (SAFETY * off / lengths[0].min(lengths[1])).clamp(0.0, 1.0) * area;
        let density = front.density(&ring, angle);
        let cutting = density.across * view.feed[0] + density.along * view.feed[1];
        sum.bound = [density.edge.norm() * share, cutting.norm() * share];
        let error = self.share(sum.bound);
        if error <= 0.0 || halvings >= HALVINGS {
            return self.sure.add(&sum);
        }
        (self.edge, self.cutting, self.error) = (self.edge + sum.edge, self.cutting + sum.cutting, self.error + error);
        self.queue.push(Worst { error, leaf: self.leaves.len() });
        self.leaves.push(Leaf { at, size, halvings, corners, middle, sum, whole: true });
    }

    /// Upper bound of the depth of material in a cell that has none at its nodes, m: material is no higher than a single sweep, such as
    /// that near the middle, has left it.
    fn material_unseen(&self, cell: &CellAt, nodes: &[Node; 5], depths: &Levels) -> f64 {
        let whose = nodes[4].whose;
        let highest = self.left_by(whose, nodes).highest_between(|to| self.left_at(whose, cell, to)).max(0.0);
        if nodes.iter().all(|node| node.whose == whose) { highest } else { highest.min(depths.kink()) }
    }

    /// Upper bound of the depth of a gap in a cell that is material at its nodes, m: no deeper than one of the sweeps near them has cut.
    fn gap_unseen(&self, cell: &CellAt, nodes: &[Node; 5], depths: &Levels) -> f64 {
        let mut deepest = 0.0_f64;
        for (n, whose) in nodes.iter().map(|node| node.whose).enumerate() {
            if nodes[..n].iter().all(|before| before.whose != whose) && nodes.iter().any(|node| node.whose != whose) {
                let left = self.left_by(whose, nodes).times(-1.0);
                deepest = deepest.max(left.highest_between(|to| -self.left_at(whose, cell, to)));
            }
        }
        deepest.min(depths.kink())
    }

    /// Depths of the nodes of a cell in the material that one sweep leaves.
    fn left_by(&self, whose: u32, nodes: &[Node; 5]) -> Levels {
        let depth = |node: &Node| match node.whose == whose {
            true => node.depth,
            false => self.view.depth_of(whose, &node.point),
        };
        Levels { corners: [0, 1, 2, 3].map(|k| depth(&nodes[k])), middle: depth(&nodes[4]) }
    }

    /// The same at a point of the cell, in coordinates of the unit square.
    fn left_at(&self, whose: u32, cell: &CellAt, to: [f64; 2]) -> f64 {
        let [column, row] = [0, 1].map(|k| cell.at[k] + to[k] * cell.size);
        let ring = self.view.front.ring(row);
        self.view.depth_of(whose, &self.view.point(ring.across, ring.up, self.view.angle(column)))
    }

    /// Quarters the worst cells until the others can change the force only a little.
    fn refine(&mut self) {
        for _ in 0..MOST_CELLS {
            let enough = ENOUGH * self.share([self.edge.norm(), self.cutting.norm()]) + NOTHING;
            if self.error <= enough {
                return;
            }
            let Some(Worst { error, leaf }) = self.queue.pop() else { return };
            let leaf = &mut self.leaves[leaf];
            leaf.whole = false;
            self.error -= error;
            let Leaf { at, size, halvings, corners: [a, b, c, d], middle, sum, .. } = *leaf;
            (self.edge, self.cutting) = (self.edge - sum.edge, self.cutting - sum.cutting);
            let (view, front) = (self.view, self.view.front);
            let node = |dx: f64, dy: f64| Node::at(view, &front.ring(at[1] + dy * size), view.angle(at[0] + dx * size));
            let (south, east, north, west) = (node(0.5, 0.0), node(1.0, 0.5), node(0.5, 1.0), node(0.0, 0.5));
            let before = (self.sure.edge, self.sure.cutting);
            let half = 0.5 * size;
            for (dx, dy, corners) in [
                (0.0, 0.0, [a, south, middle, west]),
                (half, 0.0, [south, b, east, middle]),
                (half, half, [middle, east, c, north]),
                (0.0, half, [west, middle, north, d]),
            ] {
                self.take([at[0] + dx, at[1] + dy], half, halvings + 1, corners);
            }
            self.edge += self.sure.edge - before.0;
            self.cutting += self.sure.cutting - before.1;
        }
    }
}

impl View<'_> {
    /// Adds the parts of a cell in which a level is positive.
    fn add_parts(&self, sum: &mut Sum, at: [f64; 2], size: f64, levels: [f64; 4], middle: f64) {
        let front = self.front;
        let area = size * front.length(at[1] + 0.5 * size) * size * TAU / front.around as f64;
        engaged_parts(levels, middle, |part| {
            let [column, row] = [0, 1].map(|k| at[k] + part.centroid[k] * size);
            let density = front.density(&front.ring(row), self.angle(column));
            self.add(sum, row, &density, part.share * area);
            sum.reach(at[1] + part.low * size, at[1] + part.high * size);
        });
    }

    fn add_whole(&self, sum: &mut Sum, at: [f64; 2], size: f64, halvings: u32) {
        let front = self.front;
        if halvings == 0 {
            let (column, row) = (at[0] as usize, at[1] as usize);
            self.add(sum, at[1], &front.cells[row.min(front.along)][column], 1.0);
        } else {
            let row = at[1] + 0.5 * size;
            let density = front.density(&front.ring(row), self.angle(at[0] + 0.5 * size));
            self.add(sum, row, &density, size * size * front.length(row) * TAU / front.around as f64);
        }
        sum.reach(at[1], at[1] + size);
    }

    fn add(&self, sum: &mut Sum, row: f64, cell: &Cell, share: f64) {
        let presses = if row >= self.front.along as f64 { self.side } else { 1.0 };
        sum.edge += cell.edge * (share * presses);
        sum.cutting += (cell.across * self.feed[0] + cell.along * self.feed[1]) * share;
        sum.section += (cell.clears[0] * self.feed[0] + cell.clears[1] * self.feed[1]) * share;
    }
}

impl Sum {
    fn add(&mut self, other: &Self) {
        self.edge += other.edge;
        self.cutting += other.cutting;
        self.section += other.section;
        self.bound = [0, 1].map(|k| self.bound[k] + other.bound[k]);
        if let Some([low, high]) = other.rows {
            self.reach(low, high);
        }
    }

    fn reach(&mut self, low: f64, high: f64) {
        self.rows = Some(self.rows.map_or([low, high], |[a, b]| [a.min(low), b.max(high)]));
    }
}
