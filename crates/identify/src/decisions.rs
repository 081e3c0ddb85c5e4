//! The numbers that decide what an identification names and corrects, in one place. Those by which a table is refused
//! as faulty are in `plausibility` and `poses`.
//!
//! Evidence is counted in nats: the natural logarithm of how probable the measured rows are. Two sets of effects whose
//! evidence differs by 3 nats differ in probability by a factor of 20. Numbers that describe physics or an instrument
//! (sizes, spreads, step widths) stand where they are used. The *blind tables* are those of
//! `docs/blind-identification.md` (`examples/blind_table.rs` on cells of `samples/plant/generate.py` and
//! `samples/plant/shop.py`), the *second plant* is that of `docs/real-arm.md` (`samples/plant/judge.py`).

/// Probability from which on an effect is named outright; below it, the answer lists what it may be instead. The
/// interface of `identify` sets it. On the blind tables and the second plant, names of this probability are right in
/// more than 95 % of the cases.
pub(super) const NAMED: f64 = 0.9;

/// Probability from which on a rival is listed.
pub(super) const MENTIONED: f64 = 0.03;

/// Highest probability of a name if the rows support another name of the same error as much.
pub(super) const EVEN: f64 = 0.5;

/// Gain that a further effect, or heavy tails of the noise, must have, nats: 3 for itself (odds of 20 to 1), and 3
/// because about twenty kinds are tried (ln 20). The other 2 have no derivation.
pub(super) const PRICE: f64 = 8.0;

/// Gain that a change of the numbers of a declared effect must have, nats: odds of 20 to 1. The effect is known, so
/// that no choice between kinds is added.
pub(super) const MOVED: f64 = 3.0;

/// Gain that curves must have in addition, nats, because they can imitate any smooth effect.
pub(super) const FLEXIBLE: f64 = 10.0;

/// Gain that an effect in no list must have to be reported in addition to the named effects, nats. It has no name and
/// only casts doubt on the others. It gains 18 nats where it acts on the shop cells; of 84 runs without it, none is
/// called unexplained.
pub(super) const UNLISTED: f64 = 13.0;

/// Share by which a further explanation must improve on the others; less is an imperfection of the others. It is the
/// share of what they explain for a second law of a spring and for a map at places near which no row was fitted, and the
/// share of what they leave of the mean square error on unseen rows for a fault of the table in addition to the final
/// model.
///
/// Of 48 cells with springs of other laws (quadratic, tanh, three slopes) none gets two laws; of five cells with both
/// laws three do. The share of a map is below 0.02 on three cells with a faint drag or a warming hall, where the map
/// holds for its own rows alone. It is above 0.4 on two cells of the second plant, where the map also holds elsewhere.
pub(super) const MATERIAL: f64 = 0.1;

/// Whitened residuals of more standard deviations than this are outliers. By chance one in 1.7 million normal numbers
/// is.
pub(super) const OUTLIER: f64 = 5.0;

/// Share of the evidence of all members that a fault of the table must gain; less is an imperfection of their laws. On
/// six cells with turned, swapped or late columns the fault gains 7 % and more. On seeds 1, 4, 9 and 701 of the kind
/// `most` (samples/plant/judge.py), whose sensors are sound, the best fault gains 0.1 to 0.4 %.
pub(super) const FAULT_GAIN: f64 = 0.02;

/// Largest variance of the drift of an arm, relative to the white noise. More is a drift of the instrument or an effect
/// in no list.
pub(super) const MOST_WANDER: f64 = 2.0;

/// Nats for each scalar that a member must gain over the whole robot: it removes 0.3 % of the variance of the residual.
pub(super) const GAIN_A_SCALAR: f64 = 0.0015;

/// Share of the variance of the times that the place explains from which on the arm never returns, so that the rows
/// cannot distinguish time and place. Rasters have 0.98 and more, shuffled rows less than one half.
pub(super) const NEVER_RETURNS: f64 = 0.9;

/// Share of the variance of a curve that one harmonic explains from which on the rows cannot distinguish the two.
pub(super) const IS_A_WAVE: f64 = 0.98;

/// Number of nats that count as one in a posterior from this number of scalars. No model is exact, so that the evidence
/// is too certain, and more so the more rows repeat the same error of the model.
pub(super) fn caution(scalars: usize) -> f64 {
    /// Number of scalars from which on evidence counts half, calibrated on tables of 300 rows and of 24.
    const HALF_BELIEVED: f64 = 400.0;
    1.0 + (scalars as f64 / HALF_BELIEVED).min(1.0)
}
