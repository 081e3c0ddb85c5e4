//! Lines of material through the blank, and the sweeps that own their ends.

use super::blank::Blank;
use super::solid::Solid;
use super::sweep::{Distance, Sweep, ToolPose};
use nalgebra::Vector3;
use smallvec::{SmallVec, smallvec};

/// Turn of the lattice about z: cosine and sine of the angle whose tangent is the golden section.
const TURN: (f64, f64) = (0.850_650_808_352_04, 0.525_731_112_119_133_6);

/// Lines along an edge of a tile.
const TILE: usize = 16;

/// Owner of the ends that nothing has cut.
const BLANK: u32 = 0;

/// What a cutter has touched is no material: a pose that it comes to again has nothing left to cut. Above the rounding of a
/// distance, m.
const TOUCH: f64 = 2e-7;

/// Less than this on a line is no cut, m: what rounding to single precision leaves of a floor that is passed twice.
const LEAST_CUT: f64 = 1e-7;

/// An interval of material, m above the lowest point of the blank, and who made its ends: 0 the blank, else the number of the
/// sweep, from 1. Where nothing is left of a line an empty one stays, for its owner.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    low: f32,
    high: f32,
    low_by: u32,
    high_by: u32,
}

/// A line: its material from below, and the sweep that has come nearest to its top since that was cut.
#[derive(Clone, Debug)]
struct Line {
    spans: SmallVec<[Span; 1]>,
    near_by: u32,
    near: f32,
}

/// Lines of a square of the lattice, made when the first of them changes.
type Tile = Option<Box<[Line]>>;

/// The stock: blank less what has been swept.
#[derive(Debug)]
pub struct Stock {
    blank: Blank,
    spacing: f64,
    /// Lower corner of the lattice, in its turned axes, and lowest height, m.
    origin: [f64; 3],
    /// Lines along the lattice's axes, and tiles.
    lines: [usize; 2],
    tiles: [usize; 2],
    grid: Vec<Tile>,
    sweeps: Vec<Sweep>,
    removed: f64,
}

/// To the lattice's axes.
#[inline]
fn turned(x: f64, y: f64) -> [f64; 2] {
    let (cos, sin) = TURN;
    [cos * x + sin * y, cos * y - sin * x]
}

/// And back.
#[inline]
fn turned_back(u: f64, v: f64) -> [f64; 2] {
    let (cos, sin) = TURN;
    [cos * u - sin * v, sin * u + cos * v]
}

impl Line {
    fn of(blank: &Blank, [x, y]: [f64; 2], bottom: f64) -> Self {
        let mut line = Self { spans: SmallVec::new(), near_by: BLANK, near: f32::INFINITY };
        blank.spans(x, y, |low, high| {
            let (low, high) = (single(low - bottom), single(high - bottom));
            line.spans.push(Span { low, high, low_by: BLANK, high_by: BLANK });
        });
        line
    }

    /// Length of material, m.
    fn length(&self) -> f64 {
        self.spans.iter().map(|span| f64::from(span.high) - f64::from(span.low)).sum()
    }

    fn top(&self) -> Option<f64> {
        self.spans.last().filter(|span| span.high > span.low).map(|span| f64::from(span.high))
    }

    /// Takes an interval out; the length that was material, m.
    fn cut(&mut self, low: f64, high: f64, by: u32) -> f64 {
        let mut removed = 0.0;
        let mut i = 0;
        while i < self.spans.len() {
            let span = self.spans[i];
            let (bottom, top) = (f64::from(span.low), f64::from(span.high));
            if high.min(top) - low.max(bottom) <= LEAST_CUT {
                i += 1;
                continue;
            }
            let below = (low > bottom + LEAST_CUT).then(|| Span { high: single(low), high_by: by, ..span });
            let above = (high < top - LEAST_CUT).then(|| Span { low: single(high), low_by: by, ..span });
            let left = |part: &Option<Span>| part.map_or(0.0, |s| f64::from(s.high) - f64::from(s.low));
            removed += top - bottom - left(&below) - left(&above);
            match (below, above) {
                (Some(below), Some(above)) => {
                    self.spans[i] = below;
                    self.spans.insert(i + 1, above);
                    i += 2;
                }
                (Some(part), None) | (None, Some(part)) => {
                    self.spans[i] = part;
                    i += 1;
                }
                (None, None) => {
                    self.spans.remove(i);
                    if self.spans.is_empty() {
                        self.spans = smallvec![Span { low: span.low, high: span.low, low_by: by, high_by: by }];
                        i = 1;
                    }
                }
            }
        }
        if removed > 0.0 {
            (self.near_by, self.near) = (BLANK, f32::INFINITY);
        }
        removed
    }

    /// Remembers a sweep that came near the top.
    #[inline]
    fn pass(&mut self, distance: f64, by: u32) {
        if distance < f64::from(self.near) {
            (self.near_by, self.near) = (by, single(distance));
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "lines are kept in single precision: 0.00004 mm at 600 mm")]
fn single(value: f64) -> f32 {
    value as f32
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
    fn place(&self, i: usize, j: usize) -> [f64; 2] {
        turned_back(self.origin[0] + (i as f64 + 0.5) * self.spacing, self.origin[1] + (j as f64 + 0.5) * self.spacing)
    }

    fn tile_of(&self, i: usize, j: usize) -> (usize, usize) {
        ((j / TILE) * self.tiles[0] + i / TILE, (j % TILE) * TILE + i % TILE)
    }

    /// A line, where it has been touched.
    #[inline]
    fn line(&self, i: usize, j: usize) -> Option<&Line> {
        let (tile, at) = self.tile_of(i, j);
        self.grid[tile].as_ref().map(|lines| &lines[at])
    }

    /// A line to be changed.
    #[inline]
    fn line_mut(&mut self, i: usize, j: usize) -> &mut Line {
        let (tile, at) = self.tile_of(i, j);
        if self.grid[tile].is_none() {
            self.make(i / TILE, j / TILE);
        }
        match &mut self.grid[tile] {
            Some(lines) => &mut lines[at],
            None => unreachable!("the tile was made"),
        }
    }

    #[cold]
    fn make(&mut self, ti: usize, tj: usize) {
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
        self.depth_but(point, BLANK).0
    }

    /// The number of the last sweep, where a way (m) goes straight on from it to a tip: no point of a cutter's front there is in
    /// it, and those on the silhouette need not be asked whether they are.
    pub(super) fn before(&self, tip: &Vector3<f64>, way: &Vector3<f64>) -> u32 {
        let last = self.sweeps.last().filter(|last| last.leads_to(tip, way));
        last.map_or(BLANK, |_| u32::try_from(self.sweeps.len()).unwrap_or(BLANK))
    }

    /// [`Stock::depth`] as if one sweep had not been, and whose surface it is from: a sweep's number, 0 the blank.
    #[inline]
    pub(super) fn depth_but(&self, point: &Vector3<f64>, without: u32) -> (f64, u32) {
        let (mut depth, mut whose) = (self.blank.depth(point), BLANK);
        if depth <= 0.0 {
            return (depth, whose);
        }
        let [u, v] = turned(point.x, point.y);
        let column = |at: f64, k: usize| ((at - self.origin[k]) / self.spacing - 0.5).floor().max(0.0) as usize;
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
            owners.add(line.near_by);
            for span in &line.spans {
                owners.add(span.high_by);
                owners.add(span.low_by);
                material |= span.high > span.low
                    && (f64::from(span.low) - self.spacing..=f64::from(span.high) + self.spacing).contains(&height);
            }
        }
        for by in owners.iter().filter(|by| *by != without) {
            let distance = self.sweeps[by as usize - 1].distance(point) - TOUCH;
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

    /// A cutter along the lines.
    fn cut_upright(
        &mut self,
        sweep: &Sweep,
        by: u32,
        (columns, rows): (std::ops::Range<usize>, std::ops::Range<usize>),
        goes_on: bool,
    ) -> f64 {
        let (solid, spacing) = (sweep.solid, self.spacing);
        let [u, v] = turned(sweep.start.tip.x, sweep.start.tip.y);
        let way = sweep.end.tip - sweep.start.tip;
        let [du, dv] = turned(way.x, way.y);
        let square = du * du + dv * dv;
        let per_square = if square > 0.0 { 1.0 / square } else { 0.0 };
        let reach = (solid.radius + spacing) * (solid.radius + spacing);
        let tip = sweep.start.tip.z - self.origin[2];
        let rise = sweep.end.tip.z - sweep.start.tip.z;
        // Going down, the bottom cuts behind the plane of the tip too.
        let ahead = (goes_on && rise >= 0.0).then_some([du, dv]);
        let blank_top = self.blank.bounds()[1].z - self.origin[2];
        let mut removed = 0.0;
        for j in rows {
            let from_v = self.origin[1] + (j as f64 + 0.5) * spacing - v;
            for i in self.ahead_in_row(&columns, ahead, from_v, u) {
                let from_u = self.origin[0] + (i as f64 + 0.5) * spacing - u;
                let share = (from_u * du + from_v * dv) * per_square;
                // Nearest to where it starts: the sweep before has been there.
                if ahead.is_some() && share <= 0.0 {
                    continue;
                }
                let share = share.clamp(0.0, 1.0);
                let (ru, rv) = (from_u - share * du, from_v - share * dv);
                let nearest = ru * ru + rv * rv;
                if nearest >= reach {
                    continue;
                }
                let across = nearest.sqrt();
                let meets = across < solid.radius;
                // No lower than its lower end where it passes nearest.
                let least = if meets { tip + rise.min(0.0) + solid.height(across) } else { f64::INFINITY };
                if least > blank_top + spacing && meets {
                    continue;
                }
                let (tile, at) = self.tile_of(i, j);
                if self.grid[tile].is_none() {
                    self.make(i / TILE, j / TILE);
                }
                let Some(lines) = &mut self.grid[tile] else { continue };
                let line = &mut lines[at];
                let Some(top) = line.top() else { continue };
                let (share, across) = if rise == 0.0 || !meets || least >= top - LEAST_CUT {
                    (share, across)
                } else {
                    lowest_of_ramp(&solid, [from_u, from_v], [du, dv], rise, share)
                };
                let tip = tip + share * rise;
                let low = if across < solid.radius { tip + solid.height(across) } else { f64::INFINITY };
                if low < top - LEAST_CUT {
                    removed += line.cut(low, f64::INFINITY, by);
                } else if tip < top + spacing && line.near > 0.0 {
                    let distance = solid.distance(across, top - tip);
                    if distance < spacing {
                        line.pass(distance, by);
                    }
                }
            }
        }
        removed
    }

    /// The columns of a row that are ahead of a plane through a place at `u`: behind it the sweep before has been. The row is
    /// `from_v` away from the place.
    fn ahead_in_row(
        &self,
        columns: &std::ops::Range<usize>,
        way: Option<[f64; 2]>,
        from_v: f64,
        u: f64,
    ) -> std::ops::Range<usize> {
        let Some([du, dv]) = way else { return columns.clone() };
        if du.abs() <= 1e-6 * dv.abs() {
            return if from_v * dv < -self.spacing * dv.abs() { 0..0 } else { columns.clone() };
        }
        // from_u·du + from_v·dv = 0, and a line more for the rounding.
        let edge = (u - from_v * dv / du - self.origin[0]) / self.spacing - 0.5;
        if du > 0.0 {
            columns.start.max((edge - 1.0).max(0.0) as usize)..columns.end
        } else {
            columns.start..columns.end.min((edge + 2.0).max(0.0) as usize)
        }
    }

    /// Any cutter on any way.
    fn cut_any(
        &mut self,
        sweep: &Sweep,
        by: u32,
        (columns, rows): (std::ops::Range<usize>, std::ops::Range<usize>),
        continues: bool,
    ) -> f64 {
        let bottom = self.origin[2];
        let spine = sweep.spine(self.blank.bounds()[1].z);
        let lowest = spine.iter().fold(f64::INFINITY, |z, p| z.min(p.z)) - 1.01 * sweep.solid.radius;
        let lowest = lowest - 1e-3;
        let ahead = sweep.ahead().filter(|_| continues);
        let tip = sweep.start.tip;
        // Seen from above: a line behind the plane at every height is left out with its row, and so is what is out of reach.
        let plane = ahead.map(|ahead| {
            let over = [lowest, self.blank.bounds()[1].z].map(|z| ahead.z * (z - tip.z));
            let way = turned(ahead.x, ahead.y);
            let back = over[0].max(over[1]) / (way[0] * way[0] + way[1] * way[1]).max(f64::MIN_POSITIVE);
            let [u, v] = turned(tip.x, tip.y);
            (way, [u - way[0] * back, v - way[1] * back])
        });
        let centre = spine.iter().fold(Vector3::zeros(), |sum, point| sum + point / spine.len() as f64);
        let beside = |point: &Vector3<f64>| (point.x - centre.x).hypot(point.y - centre.y);
        let reach = spine.iter().map(beside).fold(0.0, f64::max) + sweep.solid.radius + self.spacing;
        let [centre_u, centre_v] = turned(centre.x, centre.y);
        let mut removed = 0.0;
        for j in rows {
            let v = self.origin[1] + (j as f64 + 0.5) * self.spacing;
            let half = (reach * reach - (v - centre_v).powi(2)).max(0.0).sqrt();
            let column = |u: f64| ((u - self.origin[0]) / self.spacing - 0.5).max(0.0);
            let first = columns.start.max(column(centre_u - half).floor() as usize);
            let end = columns.end.min(column(centre_u + half).ceil() as usize + 1);
            let columns = match &plane {
                Some((way, [plane_u, plane_v])) => self.ahead_in_row(&(first..end), Some(*way), v - plane_v, *plane_u),
                None => first..end,
            };
            // Where the line before was entered: the next one is entered nearby.
            let mut last: Option<f64> = None;
            for i in columns {
                let [x, y] = self.place(i, j);
                let top = match self.line(i, j) {
                    Some(line) => line.top(),
                    None => Line::of(&self.blank, [x, y], bottom).top(),
                };
                let Some(top) = top else { continue };
                if let Some(ahead) = &ahead {
                    let side = |z: f64| ahead.dot(&(Vector3::new(x, y, z) - sweep.start.tip));
                    if side(top + bottom) < 0.0 && side(lowest) < 0.0 {
                        continue;
                    }
                }
                let at_top = sweep.distance_along_z(&Vector3::new(x, y, top + bottom));
                if at_top.value > 0.0 {
                    if at_top.value < self.spacing {
                        self.line_mut(i, j).pass(at_top.value, by);
                    }
                    // The cutter is above the top, or beside the line.
                    if at_top.slope <= 0.0 {
                        continue;
                    }
                }
                // From the top first: most lines beside a leaning cutter pass it by, and that is soon told.
                let high = if at_top.value <= 0.0 {
                    f64::INFINITY
                } else {
                    match enter(sweep, [x, y], top + bottom, -1.0) {
                        Some(high) => high - bottom,
                        None => continue,
                    }
                };
                let near = last.map(|z| z - self.spacing).filter(|z| *z > lowest);
                let near = near.filter(|z| sweep.distance_along_z(&Vector3::new(x, y, *z)).value > 0.0);
                let Some(low) = enter(sweep, [x, y], near.unwrap_or(lowest), 1.0) else { continue };
                last = Some(low);
                removed += self.line_mut(i, j).cut(low - bottom, high, by);
            }
        }
        removed
    }
}

/// Where on a ramp an upright cutter is lowest over a place, at which it is nearest at a share of the way: that share, and how
/// far the axis is then, m.
///
/// The height is convex along the way: its derivative's change of sign, by false position, halving where that creeps.
fn lowest_of_ramp(solid: &Solid, from: [f64; 2], way: [f64; 2], rise: f64, nearest: f64) -> (f64, f64) {
    let across = |share: f64| (from[0] - share * way[0]).hypot(from[1] - share * way[1]);
    let flat = solid.flat();
    let slope = |share: f64| {
        let rho = across(share);
        let out = rho - flat;
        if out <= 0.0 {
            return rise;
        }
        let towards = -((from[0] - share * way[0]) * way[0] + (from[1] - share * way[1]) * way[1]) / rho;
        let under = solid.corner * solid.corner - out * out;
        // At the cylinder the surface stands upright.
        if under <= 0.0 { 1e6 * towards } else { rise + out / under.sqrt() * towards }
    };
    // Downhill from the nearest place, where the cutter's own height is least.
    let mut low = nearest;
    let mut high = if rise < 0.0 { 1.0 } else { 0.0 };
    let mut at_low = slope(low) * (high - low);
    let at_high = slope(high) * (high - low);
    if at_low >= 0.0 {
        return (low, across(low));
    }
    if at_high <= 0.0 {
        return (high, across(high));
    }
    let mut at_high = at_high;
    const ROUNDS: usize = 12;
    for round in 0..ROUNDS {
        let share = if round % 2 == 1 { 0.5 } else { (at_low / (at_low - at_high)).clamp(0.01, 0.99) };
        let middle = low + (high - low) * share;
        let at = slope(middle) * (high - low);
        if at < 0.0 {
            (low, at_low) = (middle, at);
        } else {
            (high, at_high) = (middle, at);
        }
    }
    let there = 0.5 * (low + high);
    (there, across(there))
}

/// Height at which a line along z enters a sweep, coming from a height outside; `None` where it passes by.
///
/// The distance is convex along the line, so that Newton's steps come to the first place from outside and never pass it.
fn enter(sweep: &Sweep, [x, y]: [f64; 2], from: f64, upwards: f64) -> Option<f64> {
    const ROUNDS: usize = 40;
    /// Nearer than this is there, m.
    const THERE: f64 = 1e-9;
    let mut z = from;
    for _ in 0..ROUNDS {
        let Distance { value, slope } = sweep.distance_along_z(&Vector3::new(x, y, z));
        if value <= THERE {
            return Some(z);
        }
        // Getting no nearer.
        if slope * upwards >= -1e-6 {
            return None;
        }
        z -= value / slope;
    }
    None
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
