use super::decisions::{MENTIONED, NAMED};
use crate::cell::NewEffect;
use crate::effects::ParameterOwner;
use serde::Serialize;

/// The answer (`docs/reference.md`, `identify --json`).
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Identification {
    /// Rows fitted and held out.
    pub rows: usize,
    /// Rows that no fit has seen.
    pub held_out_rows: usize,
    /// White noise, per axis, mm.
    pub noise_mm: f64,
    /// Wander of the noise, per axis, mm.
    pub wander_mm: f64,
    /// White noise of measured orientations, per axis, degrees; `None` where none were fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation_noise_deg: Option<f64>,
    /// 3-D noise floor with the drift in it, mm.
    pub noise_floor_rms_mm: f64,
    /// Declared cell, on held-out rows.
    pub before: Errors,
    /// Extended cell, on held-out rows.
    pub after: Errors,
    /// 95 % interval of `after.rms_mm` by bootstrap over blocks, mm.
    pub after_rms_ci95_mm: [f64; 2],
    /// The drift of the run at held-out rows, rms, mm, estimated from neighbouring fitted rows. It is subtracted from `before` and `after`,
    /// for it is in no cell. `None` for parts, and where the noise has no drift.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run_drift_rms_mm: Option<f64>,
    /// Extended cell, on rows left out by place, posture and load instead of by time.
    pub after_other_places: Errors,
    /// Standard deviation, for each axis, of what the prediction of the same programs would be off next to where they were measured, mm:
    /// what another program may expect. Zero where the arm reaches no such place, or nothing is added.
    pub transfer_sigma_mm: f64,
    /// Effects added.
    pub added: Vec<Added>,
    /// Every effect of the written model, named or not, in the order of the cell.
    pub effects: Vec<InModel>,
    /// Sets of effects and faults that the rows leave open, most likely first; empty over the whole robot (`--poses`).
    pub sets: Vec<SetShare>,
    /// Every kind of effect alone, best first.
    pub ranking: Vec<Ranked>,
    /// Pairs of effects that these rows do not hold well apart, closest first.
    pub separability: Vec<Separation>,
    /// Rows that a fitted curve does not cover.
    pub coverage: Coverage,
    /// What is left over.
    pub unexplained: Unexplained,
    /// What to measure next, and why.
    pub advice: Vec<Advice>,
    /// Lines of the measured file whose rows were left out as outliers.
    pub outliers: Vec<u64>,
    /// The tables for the extended cell.
    #[serde(skip)]
    pub extended: Vec<NewEffect>,
    /// Residuals, row by row.
    #[serde(skip)]
    pub residuals: Vec<ResidualRow>,
}

/// One chunk of advice, as a sentence.
pub type Advice = String;

/// Sizes of the 3-D error, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Errors {
    /// Root mean square.
    pub rms_mm: f64,
    /// Mean.
    pub mean_mm: f64,
    /// Largest.
    pub max_mm: f64,
}

/// An effect that was added.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Added {
    /// Kind.
    pub kind: String,
    /// Posterior against everything that could stand in its place, on all rows once `before` and `after` are found.
    pub posterior: f64,
    /// Held-out error without it, the others kept, mm; over the whole robot (`--poses`) that of the stage before it: the
    /// effects above it alone, fitted afresh.
    pub held_out_rms_before_mm: f64,
    /// Held-out error with it, mm; over the whole robot that of its stage.
    pub held_out_rms_after_mm: f64,
    /// Its numbers.
    pub parameters: Vec<FittedParameter>,
    /// Kinds that explain the data nearly as well in its place.
    pub not_told_apart_from: Vec<String>,
}

/// An effect of the written model.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct InModel {
    /// Kind.
    pub kind: String,
    /// How likely it acts, all others free to stand in for it.
    pub probability: f64,
    /// Its part in the prediction on the held-out rows, mm rms.
    pub share_rms_mm: f64,
    /// Its numbers.
    pub parameters: Vec<FittedParameter>,
}

/// A set of effects that the rows leave open.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SetShare {
    /// Kinds of its effects; `instrument_drift`, `fixture_slip`, `clamp_slip` and `force_readings` are faults of the measurement.
    pub kinds: Vec<String>,
    /// Its posterior probability among the sets about the one that was chosen.
    pub probability: f64,
}

impl Identification {
    /// Whether everything is taken to be a little off: the model has effects that are too small, or too much alike, to be named.
    #[must_use]
    pub fn is_whole_arm(&self) -> bool {
        self.effects.iter().any(|effect| effect.probability < NAMED) && self.effects.len() > self.added.len()
    }

    /// What may act where nothing is added and nothing unexplained is said: sets of effects, most likely first, where nothing
    /// at all is not as likely as a name must be.
    #[must_use]
    pub fn faint(&self) -> Vec<&SetShare> {
        let nothing: f64 = self.sets.iter().filter(|set| set.kinds.is_empty()).map(|set| set.probability).sum();
        if !self.added.is_empty() || self.unexplained.significant || self.sets.is_empty() || nothing >= NAMED {
            return Vec::new();
        }
        self.sets.iter().filter(|set| !set.kinds.is_empty() && set.probability >= MENTIONED).collect()
    }
}

/// A fitted number.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FittedParameter {
    /// As in the cell file.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
    /// 95 % interval.
    pub ci95: [f64; 2],
    /// The value at which the effect does nothing.
    #[serde(skip)]
    pub neutral: f64,
    /// What the number belongs to.
    #[serde(skip)]
    pub owner: ParameterOwner,
}

/// One kind alone.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Ranked {
    /// Kind.
    pub kind: String,
    /// Held-out error with it alone added, linearised, mm.
    pub held_out_rms_mm: f64,
    /// −2 × log evidence against the declared cell: negative is better.
    pub delta_bic: f64,
}

/// How far one effect is from what another could imitate.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Separation {
    /// The effect that is there, at 0.03 mm rms.
    pub of: String,
    /// The effect that may be taken for it.
    pub from: String,
    /// What is left of its trace, over the noise: above 5 the two can be distinguished, below 3 they cannot.
    pub d_prime: f64,
}

/// Rows outside what was seen.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Coverage {
    /// Held-out rows outside the range that a curve was fitted on.
    pub rows_outside: usize,
    /// Their joints, from 1.
    pub joints_outside: Vec<usize>,
}

/// What no effect explains.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Unexplained {
    /// Whether it is more than noise.
    pub significant: bool,
    /// What it follows.
    pub correlates: Vec<Correlate>,
}

/// Something that the remainder follows.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Correlate {
    /// In words or as a formula.
    pub with: String,
    /// Share of the remainder's size that it describes.
    pub r: f64,
    /// The fault of the measurement that it would be: `instrument_drift`, `fixture_slip`, `clamp_slip` or `force_readings`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<&'static str>,
    /// By how much something slipped: along the axes of the work object, or where it is a clamp along those of the stock.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<FittedParameter>,
}

/// One residual, for `--report`.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct ResidualRow {
    /// Index of the run, from 1.
    pub run: usize,
    /// Ordinal of the target that it was measured at; `None` between targets, and where no program was run.
    pub target: Option<u32>,
    /// Line of the measured file.
    pub line: u64,
    /// Block.
    pub block: usize,
    /// Whether held out.
    pub held_out: bool,
    /// Whether left out as an outlier.
    pub outlier: bool,
    /// Where it was to be measured, base axes, mm.
    pub place_mm: [f64; 3],
    /// Measured minus predicted by the declared cell, mm.
    pub prefit_mm: [f64; 3],
    /// By the extended cell, mm.
    pub postfit_mm: [f64; 3],
    /// Whitened postfit residual, in standard deviations.
    pub whitened: [f64; 3],
}
