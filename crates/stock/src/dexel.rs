//! Lines of material through the blank, and the sweeps that own their ends.

use super::band::{Band, TILE};
use super::blank::Blank;
use super::history::Moment;
use super::lattice::{Lattice, lines_over, turned};
use super::line::{BLANK, Line};
use super::solid::Solid;
use super::sweep::{Cut, Sweep, ToolPose};
use nalgebra::Vector3;
use rayon::prelude::*;
use smallvec::SmallVec;
use std::ops::Range;

/// A point this near to a sweep counts as cut, m: a pose to which the cutter returns has nothing left to cut. Above the rounding of a
/// distance.
const TOUCH: f64 = 2e-7;

/// The stock: blank less what has been swept.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_stock::{Blank, Solid, Stock, ToolPose};
///
/// let mut block = Stock::new(Blank::Box([Vector3::zeros(), Vector3::new(0.1, 0.1, 0.05)]), 1e-3);
/// assert_eq!(block.blank().bounds()[1].z, 0.05); // m
/// assert!(block.depth(&Vector3::new(0.05, 0.05, 0.04)) > 0.0); // inside
/// println!("{} triangles", block.surface(2e-3).triangles.len());
/// block.keep_history();
/// let before = block.now();
/// // A flat end mill of 10 mm, 2 mm deep, across the block.
/// let (mill, slot) = (Solid { radius: 5e-3, corner: 0.0 }, 0.1 * 0.01 * 0.002); // m³
/// let at = |x: f64, y: f64| ToolPose { tip: Vector3::new(x, y, 0.048), axis: Vector3::z_axis() };
/// assert!((block.remove(mill, &at(-0.02, 0.05), &at(0.12, 0.05)) - slot).abs() < 1e-7);
/// block.defer(mill, &at(-0.02, 0.08), &at(0.12, 0.08));
/// assert!((block.settle().iter().sum::<f64>() - slot).abs() < 1e-7);
/// println!("{:.0} mm³ since {before:?}, {:.0} mm³ remain", 1e9 * block.removed(), 1e9 * block.volume());
/// ```
#[derive(Debug)]
pub struct Stock {
    lattice: Lattice,
    bands: Vec<Band>,
    sweeps: Vec<Sweep>,
    /// Number of cuts up to now; those that are not yet taken from the lines; the number of their moves.
    cuts: u32,
    deferred: Vec<Cut>,
    moves: usize,
    removed: f64,
}

impl Stock {
    /// Number of lines of a blank at a spacing (m), before memory is allocated: `deflex_text::limits` bounds it.
    #[must_use]
    #[doc(hidden)]
    pub fn lines_over(blank: &Blank, spacing: f64) -> f64 {
        lines_over(blank, spacing)
    }

    /// A blank that nothing has cut, with lines at a spacing (m).
    #[must_use]
    pub fn new(blank: Blank, spacing: f64) -> Self {
        let lattice = Lattice::new(blank, spacing);
        let bands = (0..lattice.lines[1].div_ceil(TILE)).map(|number| Band::new(number, &lattice)).collect();
        Self { lattice, bands, sweeps: Vec::new(), cuts: 0, deferred: Vec::new(), moves: 0, removed: 0.0 }
    }

    /// The blank.
    #[must_use]
    pub fn blank(&self) -> &Blank {
        &self.lattice.blank
    }

    /// Spacing of the lines, m.
    #[must_use]
    #[doc(hidden)]
    pub fn spacing(&self) -> f64 {
        self.lattice.spacing
    }

    /// Volume that has been removed, m³.
    #[must_use]
    pub fn removed(&self) -> f64 {
        self.removed
    }

    /// Volume of the remaining material, m³, summed over all lines.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let [columns, rows] = self.lattice.lines;
        let length = |i, j| self.line(i, j).map_or_else(|| self.lattice.uncut(i, j).length(), Line::length);
        let sum: f64 = (0..rows).flat_map(|j| (0..columns).map(move |i| length(i, j))).sum();
        sum * self.lattice.spacing * self.lattice.spacing
    }

    pub(super) fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// A line; `None` if nothing has touched its tile.
    #[inline]
    pub(super) fn line(&self, i: usize, j: usize) -> Option<&Line> {
        self.bands[j / TILE].line(i, j)
    }

    /// Signed depth of a point in the material, m: positive inside. Near a surface it is the distance from the surface.
    #[must_use]
    pub fn depth(&self, point: &Vector3<f64>) -> f64 {
        self.depth_at(&Moment::LATEST, point, BLANK).0
    }

    /// Keeps from now on the states of the stock at each [moment](Stock::now), and forgets all before.
    pub fn keep_history(&mut self) {
        let settled = self.cuts - self.deferred.len() as u32;
        self.bands.iter_mut().for_each(|band| band.history.begin(settled));
    }

    /// Stops keeping the history.
    #[doc(hidden)]
    pub fn drop_history(&mut self) {
        self.bands.iter_mut().for_each(|band| band.history.end());
    }

    /// The present moment.
    #[must_use]
    pub fn now(&self) -> Moment {
        let sweeps = u32::try_from(self.sweeps.len()).unwrap_or(u32::MAX);
        Moment { cuts: self.cuts, sweeps, last: self.sweeps.last().copied() }
    }

    /// [`Stock::depth`] at a moment as if one sweep had not been, and the owner of the surface: the number of a sweep, or 0 for the blank.
    #[inline]
    pub(super) fn depth_at(&self, moment: &Moment, point: &Vector3<f64>, without: u32) -> (f64, u32) {
        let (mut depth, mut whose) = (self.lattice.blank.depth(point), BLANK);
        if depth <= 0.0 {
            return (depth, whose);
        }
        let [u, v] = turned(point.x, point.y);
        let Lattice { origin, spacing, .. } = &self.lattice;
        let per_spacing = 1.0 / spacing;
        let column = |at: f64, k: usize| ((at - origin[k]) * per_spacing - 0.5) as usize;
        let (i, j) = (column(u, 0), column(v, 1));
        let height = point.z - origin[2];
        let (about, untouched) = self.about(i, j, moment.cuts);
        let mut owners = Owners::default();
        for line in about.iter().flatten() {
            owners.add(line.near_by);
            for span in &line.spans {
                owners.add(span.high_by);
                owners.add(span.low_by);
            }
        }
        for by in owners.iter().filter(|by| *by != without) {
            let distance = self.depth_of(moment, by, point);
            if distance < depth {
                (depth, whose) = (distance, by);
            }
        }
        // No line around the point has material there: the sweep that removed it owns no end any more.
        if depth > 0.0 && !untouched && !about.iter().flatten().any(|line| line.has_material(height, *spacing)) {
            depth = -depth.min(*spacing);
        }
        (depth, whose)
    }

    /// The four lines at the corners of a square of the lattice, from the first one on, as they were after `cuts` cuts, and whether one of
    /// them has never been touched.
    #[inline]
    fn about(&self, i: usize, j: usize, cuts: u32) -> ([Option<&Line>; 4], bool) {
        let band = &self.bands[(j / TILE).min(self.bands.len() - 1)];
        // Mostly they are in one tile.
        if i % TILE + 1 < TILE
            && j % TILE + 1 < TILE
            && let Some(tile) = band.tile(i / TILE)
        {
            let first = (j % TILE) * TILE + i % TILE;
            let at = |at: usize| Some(band.history.at(&tile[at], cuts));
            return ([at(first), at(first + 1), at(first + TILE), at(first + TILE + 1)], false);
        }
        let (mut about, mut untouched) = ([None; 4], false);
        for (line, (i, j)) in about.iter_mut().zip([(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)]) {
            if i < self.lattice.lines[0] && j < self.lattice.lines[1] {
                let band = &self.bands[j / TILE];
                *line = band.line(i, j).map(|line| band.history.at(line, cuts));
                untouched |= line.is_none();
            }
        }
        (about, untouched)
    }

    /// Depth of a point in the material that one sweep alone, or the blank, leaves at a moment, m.
    #[inline]
    pub(super) fn depth_of(&self, moment: &Moment, whose: u32, point: &Vector3<f64>) -> f64 {
        if whose == BLANK {
            return self.lattice.blank.depth(point);
        }
        let grown = moment.last.as_ref().filter(|_| whose == moment.sweeps);
        grown.unwrap_or_else(|| &self.sweeps[whose as usize - 1]).distance(point) - TOUCH
    }

    /// Removes what a cutter meets on its straight motion between two poses, and what was deferred before. Returns the volume, m³.
    pub fn remove(&mut self, solid: Solid, start: &ToolPose, end: &ToolPose) -> f64 {
        self.defer(solid, start, end);
        self.settle().pop().unwrap_or(0.0)
    }

    /// Adds a cutter's straight motion between two poses, and leaves the removal to [`Stock::settle`]. The cut counts as later than every
    /// moment before, so that only [later moments](Stock::now) may be read from then on.
    pub fn defer(&mut self, solid: Solid, start: &ToolPose, end: &ToolPose) {
        let [low, high] = self.lattice.blank.bounds();
        let count = Sweep::count(start, end, (high.z - low.z).max(solid.radius));
        let mut from = *start;
        for k in 1..=count {
            let to = if k == count { *end } else { start.between(end, k as f64 / count as f64) };
            self.take_in(Sweep::new(solid, from, to));
            from = to;
        }
        self.moves += 1;
    }

    /// Removes what was deferred, with the bands in parallel. Returns the volume of each of these moves, m³.
    pub fn settle(&mut self) -> Vec<f64> {
        let cuts = std::mem::take(&mut self.deferred);
        let first = cuts.iter().map(|cut| cut.rows.start).min().unwrap_or(0) / TILE;
        let end = cuts.iter().map(|cut| cut.rows.end).max().unwrap_or(0).div_ceil(TILE);
        let (lattice, bands) = (&self.lattice, &mut self.bands[first..end]);
        let take = |band: &mut Band| -> Vec<f64> { cuts.iter().map(|cut| band.take(lattice, cut)).collect() };
        let lengths: Vec<Vec<f64>> = match cuts.len() {
            1 => bands.iter_mut().map(take).collect(),
            _ => bands.par_iter_mut().map(take).collect(),
        };
        let mut volumes = vec![0.0; std::mem::take(&mut self.moves)];
        for (n, cut) in cuts.iter().enumerate() {
            let length: f64 = lengths.iter().map(|band| band[n]).sum();
            volumes[cut.of] += length * self.lattice.spacing * self.lattice.spacing;
        }
        self.removed += volumes.iter().sum::<f64>();
        volumes
    }

    /// Adds a sweep, whose cut is deferred.
    fn take_in(&mut self, sweep: Sweep) {
        let Lattice { origin, spacing, lines, .. } = self.lattice;
        let [low, high] = self.lattice.blank.bounds();
        let spine = sweep.spine(high.z);
        let margin = sweep.solid.radius + spacing;
        let over = |k: usize| {
            let (least, most) = spine
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), p| (least.min(p[k]), most.max(p[k])));
            least - margin < high[k] && most + margin > low[k]
        };
        if !(over(0) && over(1) && over(2)) {
            return;
        }
        let range = |k: usize| -> Range<usize> {
            let (least, most) = spine.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), p| {
                let at = turned(p.x, p.y)[k];
                (least.min(at), most.max(at))
            });
            let line = |at: f64| ((at - origin[k]) / spacing - 0.5).clamp(0.0, lines[k] as f64);
            line(least - margin).ceil() as usize..(line(most + margin).floor() as usize + 1).min(lines[k])
        };
        self.cuts += 1;
        let continues = self.sweeps.last().is_some_and(|last| last.solid == sweep.solid && last.end == sweep.start);
        let extended = self.sweeps.last_mut().is_some_and(|last| last.extend(sweep.solid, &sweep.start, &sweep.end));
        if !extended {
            self.sweeps.push(sweep);
        }
        let by = u32::try_from(self.sweeps.len()).unwrap_or(u32::MAX);
        let (columns, rows) = (range(0), range(1));
        self.deferred.push(Cut { sweep, of: self.moves, number: self.cuts, by, columns, rows, continues });
    }
}

/// The few sweeps near a point, each once.
#[derive(Default)]
struct Owners {
    owners: SmallVec<[u32; 16]>,
    last: [u32; 2],
}

impl Owners {
    #[inline]
    fn add(&mut self, by: u32) {
        // Most lines near a point were cut by one sweep, and the next one has passed over them.
        if by == BLANK || self.last.contains(&by) {
            return;
        }
        self.last = [by, self.last[0]];
        if !self.owners.contains(&by) {
            self.owners.push(by);
        }
    }

    fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.owners.iter().copied()
    }
}
