//! A band of the lattice: rows of lines that are cut independently of all others.

use super::history::History;
use super::lattice::Lattice;
use super::line::Line;
use std::ops::Range;

/// Lines along an edge of a tile, and rows of a band.
pub(super) const TILE: usize = 16;

/// Lines of a square of the lattice, allocated when the first of them changes.
type Tile = Option<Box<[Line]>>;

/// A row of tiles, with the history of its lines.
#[derive(Debug)]
pub(super) struct Band {
    /// Its first row of lines.
    first: usize,
    tiles: Vec<Tile>,
    pub(super) history: History,
}

impl Band {
    /// The band with a number, which nothing has cut.
    pub(super) fn new(number: usize, lattice: &Lattice) -> Self {
        let tiles = vec![None; lattice.lines[0].div_ceil(TILE)];
        Self { first: number * TILE, tiles, history: History::default() }
    }

    /// Its rows of lines.
    pub(super) fn rows(&self) -> Range<usize> {
        self.first..self.first + TILE
    }

    /// The lines of a tile; `None` if nothing has touched them.
    #[inline]
    pub(super) fn tile(&self, number: usize) -> Option<&[Line]> {
        self.tiles.get(number)?.as_deref()
    }

    /// A line; `None` if nothing has touched its tile.
    #[inline]
    pub(super) fn line(&self, i: usize, j: usize) -> Option<&Line> {
        self.tile(i / TILE).map(|lines| &lines[(j % TILE) * TILE + i % TILE])
    }

    /// A line that will be changed, and the history.
    #[inline]
    pub(super) fn line_mut(&mut self, lattice: &Lattice, i: usize, j: usize) -> (&mut Line, &mut History) {
        let first = self.first;
        let tile = self.tiles[i / TILE].get_or_insert_with(|| made(lattice, i / TILE * TILE, first));
        (&mut tile[(j % TILE) * TILE + i % TILE], &mut self.history)
    }
}

/// The lines of a tile from its first on.
#[cold]
fn made(lattice: &Lattice, i: usize, j: usize) -> Box<[Line]> {
    (0..TILE * TILE).map(|at| lattice.uncut(i + at % TILE, j + at / TILE)).collect()
}
