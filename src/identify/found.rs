//! What the steps of an identification hand to one another.

use super::design::Design;
use super::moments::Moments;
use super::outcome::{Errors, Ranked, Separation, Unexplained};
use crate::effects::Effect;
use nalgebra::DVector;

/// A chosen candidate, its posterior, and the kinds that could stand in its place with theirs.
pub(super) type Posterior = (usize, (f64, Vec<(String, f64)>));

/// What the search has found out before the answer is put together.
pub(super) struct Findings {
    pub(super) posteriors: Vec<Posterior>,
    pub(super) ranking: Ranking,
    pub(super) unexplained: Unexplained,
    /// Held-out error before and after each chosen effect, over the whole robot.
    pub(super) stages: Vec<(f64, f64)>,
    /// Whether what is written is fitted to all rows.
    pub(super) refit: bool,
    /// Errors where nothing was measured; `None` over the whole robot.
    pub(super) elsewhere: Option<Elsewhere>,
}

/// Moments, search and columns of one linearisation.
pub(super) struct Linearised {
    pub(super) moments: Vec<Moments>,
    pub(super) always: Vec<usize>,
    pub(super) design: Design,
    /// Pseudo-data: what the residual would be with every number at neutral.
    pub(super) data: DVector<f64>,
}

/// Candidates of the whole arm.
pub(super) struct Members {
    /// Those that the search found, at their own sizes.
    pub(super) found: Vec<usize>,
    /// One of every other family, at a common share of the typical sizes.
    pub(super) others: Vec<usize>,
}

impl Members {
    pub(super) fn all(&self) -> Vec<usize> {
        [&self.found[..], &self.others].concat()
    }
}

/// What was chosen: candidates, the noise, and which of its shapes.
pub(super) struct Choice {
    pub(super) set: Vec<usize>,
    pub(super) sigma: f64,
    pub(super) shape: usize,
}

/// Which fitted rows are left out together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LeavingOut {
    /// Stretches of a run, or whole runs where there are several.
    Stretches,
    /// Rows near one another in place, posture and load, whenever they were measured.
    Places,
}

/// Errors on rows that were left out, of the extended cell.
pub(super) struct Elsewhere {
    pub(super) extended: Errors,
    /// Variance that was found over the one that was promised.
    pub(super) wider: f64,
}

/// Why effects that were found are not added: the error with them, and the declared cell's, mm rms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refused {
    /// Which fitted rows were left out of the fit.
    pub(super) leaving_out: LeavingOut,
    pub(super) extended_mm: f64,
    pub(super) declared_mm: f64,
}

/// Every kind alone, and how far apart they are.
#[derive(Default)]
pub(super) struct Ranking {
    pub(super) kinds: Vec<Ranked>,
    pub(super) separability: Vec<Separation>,
}

/// The kind that names nothing.
pub(super) const MAP: &str = "empirical";

/// A field that holds.
pub(super) struct Map {
    pub(super) effect: Box<dyn Effect>,
    /// How likely its gain is one.
    pub(super) likely: f64,
}
