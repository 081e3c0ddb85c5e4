//! What the steps of an identification hand to one another.

use super::design::Design;
use super::moments::Moments;
use super::outcome::{Ranked, Separation, Unexplained};
use super::whole_arm::Elsewhere;
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

/// What was chosen: candidates, the noise, and which of its shapes.
pub(super) struct Choice {
    pub(super) set: Vec<usize>,
    pub(super) sigma: f64,
    pub(super) shape: usize,
}

/// The error of effects that were found and not added, mm rms: more than the declared cell's.
#[derive(Clone, Copy, Debug)]
pub(super) enum Refused {
    /// On held-out rows.
    HeldOut(f64),
    /// On rows that are left out by place, posture and load.
    Elsewhere(f64),
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
