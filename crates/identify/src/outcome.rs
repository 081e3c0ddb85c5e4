//! The answer of an identification, with the units of its numbers.

use super::decisions::{MENTIONED, NAMED};
use deflex_cell::NewEffect;
use deflex_effects::ParameterOwner;
use serde::Serialize;

/// The answer of an identification (`docs/reference.md`, `identify --json`).
///
/// # Examples
/// ```
/// # let (cell, program, table) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/closed_loop.rs"));
/// # use deflex_identify::{Input, Written, identify};
/// # let input = Input { cell: &cell, runs: vec![(program, table).into()], poses: vec![], tool: None, data_hash: "", written: Written::WholeModel, progress: &|_| true };
/// # let found = identify(input)?;
/// assert!(found.after.rms_mm < found.before.rms_mm);
/// println!("whole arm: {}, faint sets: {}", found.is_whole_arm(), found.faint().len());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Identification {
    /// Rows fitted and held out.
    pub rows: usize,
    /// Rows that no fit has seen.
    pub held_out_rows: usize,
    /// Standard deviation of the white noise for each axis, mm.
    pub noise_mm: f64,
    /// Standard deviation of the wander for each axis, mm.
    pub wander_mm: f64,
    /// Standard deviation of the white noise of measured orientations for each axis, degrees; `None` if none were
    /// fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation_noise_deg: Option<f64>,
    /// Noise floor: rms length of the vector of noise and wander, mm.
    pub noise_floor_rms_mm: f64,
    /// Errors of the declared cell on held-out rows.
    pub before: Errors,
    /// Errors of the extended cell on held-out rows.
    pub after: Errors,
    /// 95 % interval of `after.rms_mm` by bootstrap over blocks, mm.
    pub after_rms_ci95_mm: [f64; 2],
    /// The drift of the run at held-out rows, rms, mm, estimated from neighbouring fitted rows. It is subtracted from
    /// `before` and `after`, because it is in no cell. `None` for parts, and if the noise has no drift.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run_drift_rms_mm: Option<f64>,
    /// Errors of the extended cell on rows that were left out by place, posture and load instead of by time.
    pub after_other_places: Errors,
    /// Standard deviation for each axis of the error of the prediction if the same programs run next to their place, turned
    /// or not, mm: the uncertainty for another program. The error that remains beyond the noise is part of it.
    pub transfer_sigma_mm: f64,
    /// Effects added.
    pub added: Vec<Added>,
    /// Every effect of the written model, named or not, in the order of the cell.
    pub effects: Vec<InModel>,
    /// Sets of effects and faults that the rows leave open, most likely first; empty over the whole robot (`--poses`).
    pub sets: Vec<SetShare>,
    /// Every kind of effect alone, best first.
    pub ranking: Vec<Ranked>,
    /// Pairs of effects that these rows do not distinguish well, hardest first.
    pub separability: Vec<Separation>,
    /// Rows that a fitted curve does not cover.
    pub coverage: Coverage,
    /// Errors that no effect explains.
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

/// One piece of advice: a sentence, or several without the last full stop.
pub type Advice = String;

/// Lengths of the error vector over some rows, mm.
///
/// # Examples
/// ```
/// let none = deflex_identify::Errors::default();
/// assert_eq!((none.rms_mm, none.max_mm), (0.0, 0.0));
/// ```
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
///
/// # Examples
/// ```
/// use deflex_identify::Identification;
///
/// /// The effects that were added, with their probabilities.
/// fn names(found: &Identification) -> Vec<String> {
///     found.added.iter().map(|added| format!("{} ({:.0} %)", added.kind, 100.0 * added.posterior)).collect()
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
pub struct Added {
    /// Kind.
    pub kind: String,
    /// Posterior probability against all that could replace it. It is computed from all rows after `before` and
    /// `after`.
    pub posterior: f64,
    /// Error of the held-out rows without it and with the other effects, mm rms. Over the whole robot (`--poses`) it is
    /// the error of the stage before it, for which only the effects that precede it are fitted.
    pub held_out_rms_before_mm: f64,
    /// Error of the held-out rows with it, mm rms; over the whole robot that of its stage.
    pub held_out_rms_after_mm: f64,
    /// Its numbers.
    pub parameters: Vec<FittedParameter>,
    /// Kinds that explain the rows nearly as well in its place.
    pub not_told_apart_from: Vec<String>,
}

/// An effect of the written model.
///
/// # Examples
/// ```
/// use deflex_identify::Identification;
///
/// /// The effect that contributes most to the prediction.
/// fn largest(found: &Identification) -> Option<&str> {
///     let largest = found.effects.iter().max_by(|a, b| a.share_rms_mm.total_cmp(&b.share_rms_mm))?;
///     Some(&largest.kind)
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct InModel {
    /// Kind.
    pub kind: String,
    /// Probability that it acts, if all other effects can replace it.
    pub probability: f64,
    /// Its contribution to the prediction at the held-out rows, mm rms.
    pub share_rms_mm: f64,
    /// Its numbers.
    pub parameters: Vec<FittedParameter>,
}

/// A set of effects and faults that the rows do not exclude.
///
/// # Examples
/// ```
/// use deflex_identify::Identification;
///
/// /// The most likely set of effects.
/// fn likeliest(found: &Identification) -> Option<&[String]> {
///     Some(&found.sets.first()?.kinds)
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SetShare {
    /// Kinds of its effects; `instrument_drift`, `fixture_slip`, `clamp_slip` and `force_readings` are faults of the
    /// measurement.
    pub kinds: Vec<String>,
    /// Its posterior probability among the sets near the chosen one.
    pub probability: f64,
}

impl Identification {
    /// Whether the answer is the model of the whole arm, which also has effects that are too small, or too much alike,
    /// to be named.
    #[must_use]
    pub fn is_whole_arm(&self) -> bool {
        self.effects.iter().any(|effect| effect.probability < NAMED) && self.effects.len() > self.added.len()
    }

    /// The sets of effects that may act although none is added and no error is unexplained, most likely first. There
    /// are none if the probability of no effect is high enough for a name.
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
///
/// # Examples
/// ```
/// use deflex_identify::FittedParameter;
///
/// /// Whether a number differs from the value at which the effect does nothing, with 95 % probability.
/// fn acts(parameter: &FittedParameter) -> bool {
///     let [low, high] = parameter.ci95;
///     parameter.neutral < low || parameter.neutral > high
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
pub struct FittedParameter {
    /// Name as in the cell file.
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
    /// The thing that the number belongs to.
    #[serde(skip)]
    #[doc(hidden)]
    pub owner: ParameterOwner,
}

/// One kind of effect alone.
///
/// # Examples
/// ```
/// use deflex_identify::Identification;
///
/// /// The kind that explains the rows best if it acts alone.
/// fn best(found: &Identification) -> Option<&str> {
///     Some(&found.ranking.first()?.kind)
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Ranked {
    /// Kind.
    pub kind: String,
    /// Error of the held-out rows if it alone is added, in a linear model, mm rms.
    pub held_out_rms_mm: f64,
    /// −2 times the gain in log evidence over the declared cell, less its price: negative is better.
    pub delta_bic: f64,
}

/// How well the rows distinguish one effect from another.
///
/// # Examples
/// ```
/// use deflex_identify::Separation;
///
/// /// Whether the rows distinguish the two effects.
/// fn is_clear(separation: &Separation) -> bool {
///     separation.d_prime > 5.0
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Separation {
    /// The effect that acts, with 0.03 mm rms.
    pub of: String,
    /// The effect that may be named in its place.
    pub from: String,
    /// The part of the trace of `of` that `from` cannot imitate, over the noise: above 5 the two can be distinguished,
    /// below 3 they cannot.
    pub d_prime: f64,
}

/// Rows outside the range of the fitted rows.
///
/// # Examples
/// ```
/// let coverage = deflex_identify::Coverage::default();
/// assert_eq!(coverage.rows_outside, 0);
/// ```
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Coverage {
    /// Held-out rows outside the range that a curve was fitted on.
    pub rows_outside: usize,
    /// Their joints, from 1.
    pub joints_outside: Vec<usize>,
}

/// Errors that no effect explains.
///
/// # Examples
/// ```
/// let unexplained = deflex_identify::Unexplained::default();
/// assert!(!unexplained.significant && unexplained.correlates.is_empty());
/// ```
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Unexplained {
    /// Whether they are more than noise.
    pub significant: bool,
    /// The quantities that they follow.
    pub correlates: Vec<Correlate>,
}

/// A quantity that the unexplained error follows.
///
/// # Examples
/// ```
/// use deflex_identify::Unexplained;
///
/// /// The faults of the measurement that the rows show.
/// fn faults(unexplained: &Unexplained) -> Vec<&str> {
///     unexplained.correlates.iter().filter_map(|correlate| correlate.fault).collect()
/// }
/// assert!(faults(&Unexplained::default()).is_empty());
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Correlate {
    /// The quantity in words or as a formula.
    pub with: String,
    /// Correlation of the error that it describes with the unexplained error, from −1 to 1.
    pub r: f64,
    /// The fault of the measurement that it describes: `instrument_drift`, `fixture_slip`, `clamp_slip` or
    /// `force_readings`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<&'static str>,
    /// The size of a slip: along the axes of the work object, or along those of the stock if a clamp slipped.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<FittedParameter>,
}

/// One residual, for `--report`.
///
/// # Examples
/// ```
/// use deflex_identify::ResidualRow;
///
/// /// Whether a row tests the extended cell.
/// fn tests(row: &ResidualRow) -> bool {
///     row.held_out && !row.outlier
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct ResidualRow {
    /// Index of the run, from 1.
    pub run: usize,
    /// Ordinal of the target that it was measured at; `None` between targets, and where no program was run.
    pub target: Option<u32>,
    /// Line of the measured file.
    pub line: u64,
    /// Index of the block in the run.
    pub block: usize,
    /// Whether the row is held out.
    pub held_out: bool,
    /// Whether the row is left out as an outlier.
    pub outlier: bool,
    /// Programmed place of the row, base axes, mm.
    pub place_mm: [f64; 3],
    /// Measured minus predicted by the declared cell, mm.
    pub prefit_mm: [f64; 3],
    /// Measured minus predicted by the extended cell, mm.
    pub postfit_mm: [f64; 3],
    /// Whitened postfit residual, in standard deviations.
    pub whitened: [f64; 3],
}
