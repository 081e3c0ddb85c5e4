//! The lattice of lines through the blank.

use super::blank::Blank;
use super::line::Line;

/// Turn of the lattice about z: cosine and sine of the angle whose tangent is the golden section.
const TURN: (f64, f64) = (0.850_650_808_352_04, 0.525_731_112_119_133_6);

/// The positions of the lines: parallel to z, on a turned square lattice.
#[derive(Debug)]
pub(super) struct Lattice {
    pub(super) blank: Blank,
    pub(super) spacing: f64,
    /// Lower corner of the lattice, in its turned axes, and lowest height, m.
    pub(super) origin: [f64; 3],
    /// Number of lines along the lattice's axes.
    pub(super) lines: [usize; 2],
}

/// Turns a position into the lattice's axes.
#[inline]
pub(super) fn turned(x: f64, y: f64) -> [f64; 2] {
    let (cos, sin) = TURN;
    [cos * x + sin * y, cos * y - sin * x]
}

/// Turns a position in the lattice's axes back.
#[inline]
fn turned_back(u: f64, v: f64) -> [f64; 2] {
    let (cos, sin) = TURN;
    [cos * u - sin * v, sin * u + cos * v]
}

/// Lower and upper corner of a blank in the lattice's axes, m.
fn extent(blank: &Blank) -> [[f64; 2]; 2] {
    let [low, high] = blank.bounds();
    let corners = [[low.x, low.y], [high.x, low.y], [low.x, high.y], [high.x, high.y]].map(|[x, y]| turned(x, y));
    let least = |k: usize| corners.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min);
    let most = |k: usize| corners.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max);
    [[least(0), least(1)], [most(0), most(1)]]
}

/// Number of lines over a blank at a spacing (m), as a number that may exceed any memory.
pub(super) fn lines_over(blank: &Blank, spacing: f64) -> f64 {
    let [low, high] = extent(blank);
    (0..2).map(|k| ((high[k] - low[k]) / spacing).ceil() + 1.0).product()
}

impl Lattice {
    /// The lattice over a blank, with lines at a spacing (m).
    pub(super) fn new(blank: Blank, spacing: f64) -> Self {
        let [low, high] = extent(&blank);
        let lines = [0, 1].map(|k| ((high[k] - low[k]) / spacing).ceil() as usize + 1);
        Self { spacing, origin: [low[0], low[1], blank.bounds()[0].z], lines, blank }
    }

    /// The position of a line, m.
    pub(super) fn place(&self, i: usize, j: usize) -> [f64; 2] {
        turned_back(self.origin[0] + (i as f64 + 0.5) * self.spacing, self.origin[1] + (j as f64 + 0.5) * self.spacing)
    }

    /// A line that nothing has cut.
    pub(super) fn uncut(&self, i: usize, j: usize) -> Line {
        Line::of(&self.blank, self.place(i, j), self.origin[2])
    }
}
