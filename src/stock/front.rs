//! The part of a cutter's front that is in material, and the mean force on it.

use super::dexel::Stock;
use super::mask::engaged_parts;
use super::solid::Solid;
use super::sweep::ToolPose;
use crate::cutting::{Coefficients, Cutter, ForceParts};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Cells of the mask around the axis and along the corner's profile: at most, at least, and how large they are wanted, as a
/// share of the diameter.
const AROUND: (usize, usize) = (64, 48);
const ALONG: (usize, usize) = (16, 5);
const CELL: f64 = 0.05;

/// How closely the rims of the engagement are followed.
#[derive(Clone, Copy)]
struct Fineness {
    /// A cell is halved up to so many times.
    halvings: u32,
    /// How far the depth at a cell's middle may be off the mean of its corners, a share of the cell's size, before it is halved.
    straight: f64,
    /// Cells are halved too where the depth only bulges between corners that are all in material, or all out of it.
    bulges: bool,
}

/// Enough where rims are short beside what they enclose.
const COARSE: Fineness = Fineness { halvings: 4, straight: 0.03, bulges: false };
/// For what is narrow, or cut at a flat angle: 0.5 % of its force.
const FINE: Fineness = Fineness { halvings: 6, straight: 0.004, bulges: true };

/// Share of the force that rims may put off before they are followed finely.
const ROUGH: f64 = 0.02;

/// Below this sine of its angle to the feed the tool plunges: φ is counted from anywhere.
const PLUNGE: f64 = 1e-6;

/// A cutter with its coefficients, and the force integrals over the cells of its mask.
#[derive(Clone, Debug)]
pub struct Front {
    solid: Solid,
    coefficients: Coefficients,
    teeth_per_angle: f64,
    around: usize,
    along: usize,
    /// Height of a cell of the cylinder, m.
    rise: f64,
    /// Cosine and sine of φ at the columns' edges.
    edges: Vec<(f64, f64)>,
    /// Rows of the corner and one of the cylinder; in each the columns.
    cells: Vec<Vec<Cell>>,
}

/// Mean force on the tool of a cell that is wholly engaged, cutter frame: edge force (N) and cutting force over feed per
/// tooth (N/m), the latter by the feed's components along x and z of the cutter frame.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    edge: Vector3<f64>,
    across: Vector3<f64>,
    along: Vector3<f64>,
    /// What it clears on each metre of feed, m², by the same components.
    clears: [f64; 2],
}

/// What of a cutter is engaged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Engaged {
    /// Mean force on the tool, linear in the feed per tooth, stock's axes.
    pub force: ForceParts,
    /// How far the mask's rim may put it off, the same parts as sizes: N, N/m.
    pub bound: [f64; 2],
    /// Extent of the engaged part along the tool axis, m.
    pub depth: f64,
    /// Angle about the axis that is engaged at half that depth, rad.
    pub arc: f64,
    /// Volume cut on each metre of feed, m².
    pub section: f64,
    /// The flat bottom is pressed into material, on which the force model has no say.
    pub bottom: bool,
}

/// A point of the cutter's profile: sine and cosine of κ, distance from the axis, height, m.
#[derive(Clone, Copy)]
struct Ring {
    sin: f64,
    cos: f64,
    across: f64,
    up: f64,
}

impl Front {
    /// Tables for a cutter and its coefficients.
    #[must_use]
    pub fn new(cutter: &Cutter, coefficients: &Coefficients) -> Self {
        let solid = Solid::of(cutter);
        let size = CELL * cutter.diameter;
        let cells = |length: f64, (most, least): (usize, usize)| ((length / size).ceil() as usize).clamp(least, most);
        let around = cells(TAU * solid.radius, AROUND).next_multiple_of(4);
        let along = if solid.corner > 0.0 { cells(FRAC_PI_2 * solid.corner, ALONG) } else { 0 };
        let mut front = Self {
            solid,
            coefficients: *coefficients,
            teeth_per_angle: f64::from(cutter.teeth) / TAU,
            around,
            along,
            rise: size,
            edges: (0..=around).map(|i| (TAU * i as f64 / around as f64).sin_cos()).map(|(s, c)| (c, s)).collect(),
            cells: Vec::new(),
        };
        front.cells = (0..=along).map(|row| (0..around).map(|i| front.whole(row, i)).collect()).collect();
        front
    }

    /// The cutter's body.
    #[must_use]
    pub fn solid(&self) -> Solid {
        self.solid
    }

    /// Profile at a place counted in rows from the tip.
    fn ring(&self, row: f64) -> Ring {
        let along = self.along as f64;
        if row >= along {
            let up = self.solid.corner + (row - along) * self.rise;
            return Ring { sin: 1.0, cos: 0.0, across: self.solid.radius, up };
        }
        let (sin, cos) = (FRAC_PI_2 * row / along).sin_cos();
        Ring { sin, cos, across: self.solid.flat() + self.solid.corner * sin, up: self.solid.corner * (1.0 - cos) }
    }

    /// Length of a row along the profile, m.
    fn length(&self, row: f64) -> f64 {
        if row < self.along as f64 { FRAC_PI_2 * self.solid.corner / self.along as f64 } else { self.rise }
    }

    /// Integrals over a whole cell: the integrand is a polynomial of third degree in sines and cosines of angles far below one.
    fn whole(&self, row: usize, column: usize) -> Cell {
        const GAUSS: [(f64, f64); 3] =
            [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
        let mut sum = Cell::default();
        for (along, weight) in GAUSS {
            for (about, other) in GAUSS {
                let ring = self.ring(row as f64 + along);
                let (sin, cos) = (TAU * (column as f64 + about) / self.around as f64).sin_cos();
                let part = self.density(&ring, (cos, sin));
                let share = weight * other * self.length(row as f64) * TAU / self.around as f64;
                sum.edge += part.edge * share;
                sum.across += part.across * share;
                sum.along += part.along * share;
                sum.clears = [0, 1].map(|k| sum.clears[k] + part.clears[k] * share);
            }
        }
        sum
    }

    /// Integrands a unit of profile and angle (Tang et al. Eq. 6, mean over a revolution).
    #[inline]
    fn density(&self, ring: &Ring, (cos, sin): (f64, f64)) -> Cell {
        let k = &self.coefficients;
        let force = |kt: f64, kr: f64, ka: f64| {
            let inward = kr * ring.sin + ka * ring.cos;
            Vector3::new(-kt * sin - inward * cos, kt * cos - inward * sin, kr * ring.cos - ka * ring.sin)
                * self.teeth_per_angle
        };
        let cutting = force(k.ktc, k.krc, k.kac);
        Cell {
            edge: force(k.kte, k.kre, k.kae),
            across: cutting * (ring.sin * cos),
            along: cutting * -ring.cos,
            clears: [ring.across * ring.sin * cos, -ring.across * ring.cos],
        }
    }

    /// What is in the material of a cutter at a pose, `way` (m) being the way into it, whose direction is the feed.
    ///
    /// To be asked before that move is removed: on a straight move no point of the front has been there.
    #[must_use]
    pub fn engaged(&self, stock: &Stock, pose: &ToolPose, way: &Vector3<f64>) -> Engaged {
        let size = way.norm();
        if size == 0.0 {
            return Engaged::default();
        }
        let mut view = View::new(self, stock, pose, way, size);
        let [low, high] = stock.blank().bounds();
        let reach = |k: usize| {
            let axis = pose.axis[k];
            axis * if axis > 0.0 { high[k] - pose.tip[k] } else { low[k] - pose.tip[k] }
        };
        // Highest point of the blank along the axis, seen from the tip; no farther than where the whole of a ring is over it.
        let axis = pose.axis;
        let over_top = high.z - pose.tip.z + self.solid.radius * axis.x.hypot(axis.y);
        let rings = if axis.z > 0.0 { over_top / axis.z } else { f64::INFINITY };
        let highest = (reach(0) + reach(1) + reach(2)).min(rings);
        if highest <= 0.0 {
            return Engaged::default();
        }
        let over = (highest - self.solid.corner).max(0.0);
        let rows = self.along + (over / self.rise).ceil() as usize;
        let mut sum = self.sum(&view, rows);
        if sum.bound[1] > ROUGH * sum.cutting.norm() {
            view.fineness = FINE;
            sum = self.sum(&view, rows);
        }
        view.finish(sum)
    }

    /// Over the lowest rows of the mask.
    fn sum(&self, view: &View<'_>, rows: usize) -> Sum {
        let mut sum = Sum::default();
        let fill = |nodes: &mut Vec<Node>, row: usize| {
            let ring = self.ring(row as f64);
            nodes.clear();
            nodes.extend(self.edges.iter().map(|angle| Node { chip: view.chip(&ring, *angle), depth: None }));
            ring
        };
        let (mut below, mut above) = (Vec::with_capacity(self.around + 1), Vec::with_capacity(self.around + 1));
        let mut lower = fill(&mut below, 0);
        for row in 0..rows {
            let upper = fill(&mut above, row + 1);
            for column in 0..self.around {
                let chips = [below[column].chip, below[column + 1].chip, above[column + 1].chip, above[column].chip];
                if chips.iter().all(|chip| *chip <= 0.0) {
                    continue;
                }
                let depth = |nodes: &mut [Node], ring: &Ring, column: usize| {
                    let node = &mut nodes[column];
                    *node.depth.get_or_insert_with(|| view.depth(ring, self.edges[column]))
                };
                let depths = [
                    depth(&mut below, &lower, column),
                    depth(&mut below, &lower, column + 1),
                    depth(&mut above, &upper, column + 1),
                    depth(&mut above, &upper, column),
                ];
                view.cell(&mut sum, [column as f64, row as f64], 1.0, [chips, depths], 0);
            }
            std::mem::swap(&mut below, &mut above);
            lower = upper;
        }
        sum
    }
}

/// A node of the mask: share of the feed that goes into the surface there, and depth in the material, m, once asked for.
#[derive(Clone, Copy)]
struct Node {
    chip: f64,
    depth: Option<f64>,
}

/// Sums over the mask, cutter frame.
#[derive(Default)]
struct Sum {
    edge: Vector3<f64>,
    cutting: Vector3<f64>,
    bound: [f64; 2],
    section: f64,
    /// Lowest and highest engaged row.
    rows: Option<[f64; 2]>,
}

/// A cutter in the stock.
struct View<'a> {
    front: &'a Front,
    stock: &'a Stock,
    pose: &'a ToolPose,
    x: Vector3<f64>,
    y: Vector3<f64>,
    /// The feed across the axis, and along it.
    feed: [f64; 2],
    /// What a chip counts beside a depth, m.
    scale: f64,
    /// The sweep that leads here.
    before: u32,
    fineness: Fineness,
}

impl<'a> View<'a> {
    fn new(front: &'a Front, stock: &'a Stock, pose: &'a ToolPose, way: &Vector3<f64>, size: f64) -> Self {
        let feed = way / size;
        let along = feed.dot(&pose.axis);
        let across = feed - pose.axis.into_inner() * along;
        let sine = across.norm();
        let x = if sine > PLUNGE {
            across / sine
        } else {
            let helper = if pose.axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
            pose.axis.cross(&helper).normalize()
        };
        let feed = [if sine > PLUNGE { sine } else { 0.0 }, along];
        let before = stock.before(&pose.tip, way);
        // About as far as a point is from the silhouette; where the way bends, the depth over what the move before has left
        // goes as chip times way.
        let scale = if before > 0 { front.solid.radius } else { size.min(front.solid.radius) };
        Self { front, stock, pose, x, y: pose.axis.cross(&x), feed, scale, before, fineness: COARSE }
    }

    fn point(&self, across: f64, up: f64, (cos, sin): (f64, f64)) -> Vector3<f64> {
        self.pose.tip + (self.x * cos + self.y * sin) * across + self.pose.axis.into_inner() * up
    }

    /// Share of the feed that goes into the surface.
    fn chip(&self, ring: &Ring, angle: (f64, f64)) -> f64 {
        let chip = self.feed[0] * ring.sin * angle.0 - self.feed[1] * ring.cos;
        // On grid lines that are the silhouette rounding is not to decide.
        if chip.abs() < 1e-12 { 0.0 } else { chip }
    }

    /// How deep a point is in material, m.
    fn depth(&self, ring: &Ring, angle: (f64, f64)) -> f64 {
        self.stock.depth_but(&self.point(ring.across, ring.up, angle), self.before)
    }

    /// Above zero where there is material and a chip of it.
    fn level(&self, chip: f64, depth: f64) -> f64 {
        depth.min(chip * self.scale)
    }

    fn angle(&self, column: f64) -> (f64, f64) {
        let (sin, cos) = (TAU * column / self.front.around as f64).sin_cos();
        (cos, sin)
    }

    /// Adds a cell, or its four quarters: `at` its lower corner and `size` in columns and rows; chips and depths at its corners.
    fn cell(&self, sum: &mut Sum, at: [f64; 2], size: f64, nodes: [[f64; 4]; 2], halvings: u32) {
        let front = self.front;
        let [chips, depths] = nodes;
        if chips.iter().all(|chip| *chip <= 0.0) {
            return;
        }
        let (ring, angle) = (front.ring(at[1] + 0.5 * size), self.angle(at[0] + 0.5 * size));
        let lengths = [size * TAU * ring.across / front.around as f64, size * front.length(at[1])];
        let larger = lengths[0].max(lengths[1]);
        // Depths change no faster than by one: what is farther than this from all corners and yet in the cell is a sliver.
        let far = 0.4 * larger;
        let least = depths.iter().fold(f64::INFINITY, |a, b| a.min(*b));
        let most = depths.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        if most < -far {
            return;
        }
        let faces = chips.iter().all(|chip| *chip >= 0.0);
        let chip = self.chip(&ring, angle);
        if least > far {
            return if faces {
                self.add_whole(sum, at, size, halvings);
            } else {
                self.add_parts(sum, at, size, chips, chip);
            };
        }
        let middle = self.depth(&ring, angle);
        let mean = 0.25 * depths.iter().sum::<f64>();
        let off = (middle - mean).abs();
        // Where the depth bulges out between the corners hardly a rim can hide, on either side of one.
        let bulges = (least >= 0.0 && middle >= mean) || (most <= 0.0 && middle <= mean);
        let Fineness { halvings: most_halvings, straight, .. } = self.fineness;
        if (self.fineness.bulges || !bulges) && off > straight * larger && halvings < most_halvings {
            let node = |dx: f64, dy: f64| {
                let (ring, angle) = (front.ring(at[1] + dy * size), self.angle(at[0] + dx * size));
                (self.chip(&ring, angle), self.depth(&ring, angle))
            };
            let (south, east, north, west) = (node(0.5, 0.0), node(1.0, 0.5), node(0.5, 1.0), node(0.0, 0.5));
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| (chips[k], depths[k]));
            let (half, centre) = (0.5 * size, (chip, middle));
            for (dx, dy, nodes) in [
                (0.0, 0.0, [a, south, centre, west]),
                (half, 0.0, [south, b, east, centre]),
                (half, half, [centre, east, c, north]),
                (0.0, half, [west, centre, north, d]),
            ] {
                let nodes = [nodes.map(|node| node.0), nodes.map(|node| node.1)];
                self.cell(sum, [at[0] + dx, at[1] + dy], half, nodes, halvings + 1);
            }
            return;
        }
        if faces && least >= 0.0 && most > 0.0 && middle > 0.0 {
            return self.add_whole(sum, at, size, halvings);
        }
        if most <= 0.0 && middle <= 0.0 {
            return;
        }
        if faces {
            self.add_parts(sum, at, size, depths, middle);
        } else {
            let levels = [0, 1, 2, 3].map(|k| self.level(chips[k], depths[k]));
            self.add_parts(sum, at, size, levels, self.level(chip, middle));
        }
        // The rim is off by so much along the larger side.
        let area = lengths[1] * size * TAU / front.around as f64;
        let density = front.density(&ring, angle);
        let share = (off / lengths[0].min(lengths[1])).min(1.0) * area;
        sum.bound[0] += density.edge.norm() * share;
        sum.bound[1] += (density.across * self.feed[0] + density.along * self.feed[1]).norm() * share;
    }

    /// Adds the parts of a cell where a level is above zero.
    fn add_parts(&self, sum: &mut Sum, at: [f64; 2], size: f64, levels: [f64; 4], middle: f64) {
        let front = self.front;
        let area = size * front.length(at[1] + 0.5 * size) * size * TAU / front.around as f64;
        engaged_parts(levels, middle, |part| {
            let [column, row] = [0, 1].map(|k| at[k] + part.centroid[k] * size);
            let density = front.density(&front.ring(row), self.angle(column));
            self.add(sum, &density, part.share * area);
            sum.reach(at[1] + part.low * size, at[1] + part.high * size);
        });
    }

    fn add_whole(&self, sum: &mut Sum, at: [f64; 2], size: f64, halvings: u32) {
        let front = self.front;
        if halvings == 0 {
            let (column, row) = (at[0] as usize, at[1] as usize);
            self.add(sum, &front.cells[row.min(front.along)][column], 1.0);
        } else {
            let row = at[1] + 0.5 * size;
            let density = front.density(&front.ring(row), self.angle(at[0] + 0.5 * size));
            self.add(sum, &density, size * size * front.length(row) * TAU / front.around as f64);
        }
        sum.reach(at[1], at[1] + size);
    }

    fn add(&self, sum: &mut Sum, cell: &Cell, share: f64) {
        sum.edge += cell.edge * share;
        sum.cutting += (cell.across * self.feed[0] + cell.along * self.feed[1]) * share;
        sum.section += (cell.clears[0] * self.feed[0] + cell.clears[1] * self.feed[1]) * share;
    }

    fn finish(&self, sum: Sum) -> Engaged {
        let world = |v: Vector3<f64>| self.x * v.x + self.y * v.y + self.pose.axis.into_inner() * v.z;
        let force = ForceParts { edge: world(sum.edge), cutting: world(sum.cutting) };
        let (mut depth, mut arc) = (0.0, 0.0);
        if let Some([low, high]) = sum.rows {
            let [low, high] = [low, high].map(|row| self.front.ring(row).up);
            depth = high - low;
            arc = self.arc(0.5 * (low + high));
        }
        Engaged { force, bound: sum.bound, depth, arc, section: sum.section, bottom: self.bottom() }
    }

    /// Angle that is engaged at a height, rad.
    fn arc(&self, up: f64) -> f64 {
        let solid = self.front.solid;
        let ring = if up < solid.corner {
            let cos = 1.0 - up / solid.corner;
            let sin = (1.0 - cos * cos).sqrt();
            Ring { sin, cos, across: solid.flat() + solid.corner * sin, up }
        } else {
            Ring { sin: 1.0, cos: 0.0, across: solid.radius, up }
        };
        let step = TAU / self.front.around as f64;
        let level = |angle: &(f64, f64)| match self.chip(&ring, *angle) {
            chip if chip <= 0.0 => chip,
            chip => self.level(chip, self.depth(&ring, *angle)),
        };
        let depths: Vec<f64> = self.front.edges[..self.front.around].iter().map(level).collect();
        let share = |a: f64, b: f64| match (a > 0.0, b > 0.0) {
            (true, true) => 1.0,
            (false, false) => 0.0,
            (true, false) => a / (a - b),
            (false, true) => b / (b - a),
        };
        (0..depths.len()).map(|i| share(depths[i], depths[(i + 1) % depths.len()])).sum::<f64>() * step
    }

    /// Whether the flat bottom goes down into material.
    fn bottom(&self) -> bool {
        let flat = self.front.solid.flat();
        if flat <= 0.0 || self.feed[1] > -PLUNGE_OF_BOTTOM {
            return false;
        }
        let inside = |across: f64, angle| self.stock.depth(&self.point(across, 0.0, angle)) > 0.0;
        [0.3, 0.6, 0.95]
            .iter()
            .any(|share| (0..8).any(|k| inside(share * flat, self.angle(k as f64 * self.front.around as f64 / 8.0))))
    }
}

/// Sine of a ramp from which the flat bottom counts as cutting: half a degree.
const PLUNGE_OF_BOTTOM: f64 = 0.01;

impl Sum {
    fn reach(&mut self, low: f64, high: f64) {
        self.rows = Some(self.rows.map_or([low, high], |[a, b]| [a.min(low), b.max(high)]));
    }
}
