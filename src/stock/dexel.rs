//! Lines of material through the blank, and the sweeps that own their ends.

use super::blank::Blank;
use super::history::{History, Moment};
use super::line::{BLANK, Line};
use super::solid::Solid;
use super::sweep::{Sweep, ToolPose};
use nalgebra::Vector3;
use smallvec::SmallVec;

/// Turn of the lattice about z: cosine and sine of the angle whose tangent is the golden section.
const TURN: (f64, f64) = (0.850_650_808_352_04, 0.525_731_112_119_133_6);

/// Lines along an edge of a tile.
pub(super) const TILE: usize = 16;

/// What a cutter has touched is no material: a pose that it comes to again has nothing left to cut. Above the rounding of a
/// distance, m.
const TOUCH: f64 = 2e-7;

/// Lines of a square of the lattice, made when the first of them changes.
type Tile = Option<Box<[Line]>>;

/// The stock: blank less what has been swept.
#[derive(Debug)]
pub struct Stock {
    pub(super) blank: Blank,
    pub(super) spacing: f64,
    /// Lower corner of the lattice, in its turned axes, and lowest height, m.
    pub(super) origin: [f64; 3],
    /// Lines along the lattice's axes, and tiles.
    lines: [usize; 2],
    tiles: [usize; 2],
    pub(super) grid: Vec<Tile>,
    sweeps: Vec<Sweep>,
    pub(super) history: History,
    removed: f64,
}

/// To the lattice's axes.
#[inline]
pub(super) fn turned(x: f64, y: f64) -> [f64; 2] {
    let (cos, sin) = TURN;
    [cos * x + sin * y, cos * y - sin * x]
}

/// And back.
#[inline]
fn turned_back(u: f64, v: f64) -> [f64; 2] {
    let (cos, sin) = TURN;
    [cos * u - sin * v, sin * u + cos * v]
}

impl Stock {
    /// A blank that nothing has cut, with lines at a spacing (m).
    #[must_use]
    pub fn new(blank: Blank, spacing: f64) -> Self {
        let [low, high] = blank.bounds();
        let corners = [[low.x, low.y], [high.x, low.y], [low.x, high.y], [high.x, high.y]].map(|[x, y]| turned(x, y));
        let least = |k: usize| corners.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min);
        let most = |k: usize| corners.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max);
        let lines = [0, 1].map(|k| ((most(k) - least(k)) / spacing).ceil() as usize + 1);
        let tiles = lines.map(|lines| lines.div_ceil(TILE));
        Self {
            spacing,
            origin: [least(0), least(1), low.z],
            lines,
            tiles,
            grid: vec![None; tiles[0] * tiles[1]],
            sweeps: Vec::new(),
            history: History::default(),
            removed: 0.0,
            blank,
        }
    }

    /// The blank.
    #[must_use]
    pub fn blank(&self) -> &Blank {
        &self.blank
    }

    /// Spacing of the lines, m.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Volume that has been removed, m³.
    #[must_use]
    pub fn removed(&self) -> f64 {
        self.removed
    }

    /// Volume of what is left, m³, summed over all lines.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let mut sum = 0.0;
        for j in 0..self.lines[1] {
            for i in 0..self.lines[0] {
                sum += match self.line(i, j) {
                    Some(line) => line.length(),
                    None => Line::of(&self.blank, self.place(i, j), self.origin[2]).length(),
                };
            }
        }
        sum * self.spacing * self.spacing
    }

    /// Memory of lines and sweeps, bytes, about.
    #[must_use]
    pub fn memory(&self) -> usize {
        let tiles = self.grid.iter().flatten().count() * TILE * TILE * size_of::<Line>();
        tiles + self.grid.len() * size_of::<Tile>() + self.sweeps.len() * size_of::<Sweep>()
    }

    /// Where a line stands.
    pub(super) fn place(&self, i: usize, j: usize) -> [f64; 2] {
        turned_back(self.origin[0] + (i as f64 + 0.5) * self.spacing, self.origin[1] + (j as f64 + 0.5) * self.spacing)
    }

    pub(super) fn tile_of(&self, i: usize, j: usize) -> (usize, usize) {
        ((j / TILE) * self.tiles[0] + i / TILE, (j % TILE) * TILE + i % TILE)
    }

    /// A line, where it has been touched.
    #[inline]
    pub(super) fn line(&self, i: usize, j: usize) -> Option<&Line> {
        let (tile, at) = self.tile_of(i, j);
        self.grid[tile].as_ref().map(|lines| &lines[at])
    }

    /// A line to be changed.
    #[inline]
    pub(super) fn line_mut(&mut self, i: usize, j: usize) -> (&mut Line, &mut History) {
        let (tile, at) = self.tile_of(i, j);
        if self.grid[tile].is_none() {
            self.make(i / TILE, j / TILE);
        }
        match &mut self.grid[tile] {
            Some(lines) => (&mut lines[at], &mut self.history),
            None => unreachable!("the tile was made"),
        }
    }

    #[cold]
    pub(super) fn make(&mut self, ti: usize, tj: usize) {
        let lines = (0..TILE * TILE)
            .map(|at| {
                let place = self.place(ti * TILE + at % TILE, tj * TILE + at / TILE);
                Line::of(&self.blank, place, self.origin[2])
            })
            .collect();
        self.grid[tj * self.tiles[0] + ti] = Some(lines);
    }

    /// Signed depth of a point in the material, m: above zero inside. Near a surface it is the distance from it.
    #[must_use]
    pub fn depth(&self, point: &Vector3<f64>) -> f64 {
        self.depth_at(&Moment::LATEST, point, BLANK).0
    }

    /// Keeps from now on what is needed to tell what the stock was at each [moment](Stock::now), and forgets all before.
    pub fn keep_history(&mut self) {
        self.history.begin();
    }

    /// Keeps no history any more.
    pub fn drop_history(&mut self) {
        self.history.end();
    }

    /// This moment.
    #[must_use]
    pub fn now(&self) -> Moment {
        let sweeps = u32::try_from(self.sweeps.len()).unwrap_or(u32::MAX);
        Moment { cuts: self.history.cuts, sweeps, last: self.sweeps.last().copied() }
    }

    /// [`Stock::depth`] at a moment as if one sweep had not been, and whose surface it is from: a sweep's number, 0 the blank.
    #[inline]
    pub(super) fn depth_at(&self, moment: &Moment, point: &Vector3<f64>, without: u32) -> (f64, u32) {
        let (mut depth, mut whose) = (self.blank.depth(point), BLANK);
        if depth <= 0.0 {
            return (depth, whose);
        }
        let [u, v] = turned(point.x, point.y);
        let column = |at: f64, k: usize| ((at - self.origin[k]) / self.spacing - 0.5) as usize;
        let (i, j) = (column(u, 0), column(v, 1));
        let height = point.z - self.origin[2];
        let mut owners = Owners::default();
        let mut material = false;
        for (i, j) in [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)] {
            if i >= self.lines[0] || j >= self.lines[1] {
                continue;
            }
            let Some(line) = self.line(i, j) else {
                material = true;
                continue;
            };
            let line = self.history.at(line, moment.cuts);
            owners.add(line.near_by);
            for span in &line.spans {
                owners.add(span.high_by);
                owners.add(span.low_by);
                material |= span.high > span.low
                    && (f64::from(span.low) - self.spacing..=f64::from(span.high) + self.spacing).contains(&height);
            }
        }
        for by in owners.iter().filter(|by| *by != without) {
            let sweep = if by == moment.sweeps { &moment.last } else { &None };
            let distance = sweep.as_ref().unwrap_or(&self.sweeps[by as usize - 1]).distance(point) - TOUCH;
            if distance < depth {
                (depth, whose) = (distance, by);
            }
        }
        // None of the lines about it has material there: what took it has no end left.
        if depth > 0.0 && !material { (-depth.min(self.spacing), whose) } else { (depth, whose) }
    }

    /// Removes what a cutter meets on its straight way between two poses; the volume, m³.
    pub fn remove(&mut self, solid: Solid, start: &ToolPose, end: &ToolPose) -> f64 {
        let [low, high] = self.blank.bounds();
        let count = Sweep::count(start, end, (high.z - low.z).max(solid.radius));
        let mut length = 0.0;
        let mut from = *start;
        for k in 1..=count {
            let to = if k == count { *end } else { start.between(end, k as f64 / count as f64) };
            length += self.remove_sweep(Sweep::new(solid, from, to));
            from = to;
        }
        let volume = length * self.spacing * self.spacing;
        self.removed += volume;
        volume
    }

    /// Length on the lines that a sweep removes, m.
    fn remove_sweep(&mut self, sweep: Sweep) -> f64 {
        let [low, high] = self.blank.bounds();
        let spine = sweep.spine(high.z);
        let margin = sweep.solid.radius + self.spacing;
        let over = |k: usize| {
            let (least, most) = spine
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), p| (least.min(p[k]), most.max(p[k])));
            least - margin < high[k] && most + margin > low[k]
        };
        if !(over(0) && over(1) && over(2)) {
            return 0.0;
        }
        let range = |k: usize| {
            let (least, most) = spine.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), p| {
                let at = turned(p.x, p.y)[k];
                (least.min(at), most.max(at))
            });
            let line = |at: f64| ((at - self.origin[k]) / self.spacing - 0.5).clamp(0.0, self.lines[k] as f64);
            line(least - margin).ceil() as usize..line(most + margin).floor() as usize + 1
        };
        self.history.cuts += 1;
        let (columns, rows) = (range(0), range(1));
        let (columns, rows) = (columns.start..columns.end.min(self.lines[0]), rows.start..rows.end.min(self.lines[1]));
        let continues = self.sweeps.last().is_some_and(|last| last.solid == sweep.solid && last.end == sweep.start);
        let extended = self.sweeps.last_mut().is_some_and(|last| last.extend(sweep.solid, &sweep.start, &sweep.end));
        if !extended {
            self.sweeps.push(sweep);
        }
        let by = u32::try_from(self.sweeps.len()).unwrap_or(u32::MAX);
        if sweep.upright {
            self.cut_upright(&sweep, by, (columns, rows), continues)
        } else {
            self.cut_any(&sweep, by, (columns, rows), continues)
        }
    }
}

/// The few sweeps about a point, each once.
#[derive(Default)]
struct Owners {
    owners: SmallVec<[u32; 16]>,
}

impl Owners {
    #[inline]
    fn add(&mut self, by: u32) {
        if by != BLANK && !self.owners.contains(&by) {
            self.owners.push(by);
        }
    }

    fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.owners.iter().copied()
    }
}
