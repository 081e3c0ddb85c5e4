//! The results that the steps of an identification pass to one another.

use super::design::Design;
use super::moments::Moments;
use super::outcome::{Advice, Errors, Ranked, Separation, Unexplained};
use deflex_effects::Effect;
use nalgebra::{DMatrix, DVector};

/// The index of a chosen candidate, its posterior probability, and the kinds that could replace it with their
/// probabilities.
pub(super) type Posterior = (usize, (f64, Vec<(String, f64)>));

/// The effects that were found; they are chosen and fitted.
pub(super) struct Model {
    /// In the order of the chosen set.
    pub(super) posteriors: Vec<Posterior>,
    pub(super) ranking: Ranking,
}

/// The results of the search from which the answer is made.
pub(super) struct Findings {
    pub(super) posteriors: Vec<Posterior>,
    pub(super) ranking: Ranking,
    pub(super) unexplained: Unexplained,
    /// Error of the held-out rows before and after each chosen effect, mm rms; empty except over the whole robot.
    pub(super) stages: Vec<(f64, f64)>,
    /// Errors at places, postures and loads that the fit has not seen; `None` over the whole robot.
    pub(super) elsewhere: Option<Elsewhere>,
    /// Why the effects that were found are not added, if they are not.
    pub(super) refused: Option<Refused>,
}

/// The columns of candidates about the present fit, and their moments.
pub(super) struct Linearised {
    /// The moments under each shape of the noise.
    pub(super) moments: Vec<Moments>,
    /// The columns of the instruments, which are in every set.
    pub(super) always: Vec<usize>,
    pub(super) design: Design,
    /// Pseudo-data, mm: the residual plus the linear contribution of the chosen numbers, as if each had its start
    /// value.
    pub(super) data: DVector<f64>,
}

/// A chosen set, with σ, mm, and the index of the shape of the noise.
pub(super) struct Choice {
    pub(super) set: Vec<usize>,
    pub(super) sigma: f64,
    pub(super) shape: usize,
}

/// How the fitted rows are divided into groups, each of which is left out of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LeavingOut {
    /// Stretches of a run, or whole runs where there are several.
    Stretches,
    /// Rows that are near one another in place, posture and load, whenever they were measured.
    Places,
}

/// Errors of the extended cell on rows that were left out of its fit.
pub(super) struct Elsewhere {
    pub(super) extended: Errors,
    /// Variance of the errors on these rows, relative to the variance that the fit predicts.
    pub(super) wider: f64,
}

/// Why the effects that were found are not added: the error with them and the error of the declared cell, mm rms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refused {
    /// Which fitted rows were left out of the fit.
    pub(super) leaving_out: LeavingOut,
    pub(super) extended_mm: f64,
    pub(super) declared_mm: f64,
}

impl Refused {
    pub(super) fn advice(&self) -> Advice {
        let rows = match self.leaving_out {
            LeavingOut::Stretches => "rows of stretches left out of the fit",
            LeavingOut::Places => "rows at places, postures and loads left out of the fit",
        };
        format!(
            "no effect is added: with those that were found, the error on {rows} would be {:.4} mm instead of {:.4}. The fitted rows are \
             too few, or unlike the others: measure more rows over the same area",
            self.extended_mm, self.declared_mm
        )
    }
}

/// Every kind of effect alone, and how well pairs of kinds can be distinguished.
#[derive(Default)]
pub(super) struct Ranking {
    pub(super) kinds: Vec<Ranked>,
    pub(super) separability: Vec<Separation>,
}

/// The kind of a map, which describes an error without naming its cause.
pub(super) const MAP: &str = "empirical";

/// The discrepancy as an effect.
pub(super) struct Map {
    pub(super) effect: Box<dyn Effect>,
    /// Change of its heights, mm, when a chosen number grows by its typical size: a row for each axis of each bell, and
    /// a column for each number.
    pub(super) response: DMatrix<f64>,
    /// Correlations of the process at the centres of its bells.
    pub(super) alike: DMatrix<f64>,
    /// Probability that it reduces the error on blocks that its fit has not seen.
    pub(super) likely: f64,
}
