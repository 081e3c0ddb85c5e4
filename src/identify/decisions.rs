//! The numbers that decide what an identification names and corrects, in one place. Those by which a table is refused as faulty stand in
//! `questioned` and `poses`.
//!
//! Evidence is counted in nats: the natural logarithm of how probable the measured rows are. Two sets of effects whose evidence
//! differs by 3 nats differ in probability by a factor of 20. Numbers that describe physics or an instrument (sizes, spreads, step widths)
//! stand where they are used. The *blind tables* are those of `docs/blind-identification.md` (`examples/blind_table.rs` on cells of
//! `samples/plant/generate.py` and `samples/plant/shop.py`), the *second plant* is that of `docs/real-arm.md` (`samples/plant/judge.py`).

/// Probability from which on an effect is named outright; below it, the answer lists what it may be instead. The interface of `identify`
/// sets it. On the blind tables and the second plant, names of this probability are right in more than 95 % of the cases.
pub(super) const NAMED: f64 = 0.9;

/// Probability from which on a rival is listed.
pub(super) const MENTIONED: f64 = 0.03;

/// Highest probability of a name for which the rows show another one as well: two names for one thing.
pub(super) const EVEN: f64 = 0.5;

/// What a further effect must gain, nats, and heavy tails of the noise: 3 for itself (odds of 20 to 1), and 3 because some twenty kinds are
/// tried (ln 20). The other 2 have no derivation.
pub(super) const PRICE: f64 = 8.0;

/// What the numbers of a declared effect must gain by moving, nats: odds of 20 to 1, and nothing to name.
pub(super) const MOVED: f64 = 3.0;

/// What curves, harmonics and maps must gain in addition, nats, for they can stand for any smooth effect.
pub(super) const FLEXIBLE: f64 = 10.0;

/// What something that is in no list must gain to be reported in addition to the named effects, nats: it has no name, and only casts
/// doubt on the others. It gains 18 nats where it acts on the shop cells; of 84 runs without it, none is called unexplained.
pub(super) const UNLISTED: f64 = 13.0;

/// Share of what the other members explain that a further explanation must explain in addition: less is an imperfection of theirs. It
/// holds for a second law of a spring, a fault of the table over the whole arm, and a map where no row near was fitted.
///
/// Of 48 cells with springs of other laws (quadratic, tanh, three slopes) none is given two laws, of five with both laws three are. On three
/// cells with a faint drag or a warming hall, the share of a map that holds for the rows alone is below 0.02, on two of the second plant
/// whose map holds elsewhere above 0.4.
pub(super) const MATERIAL: f64 = 0.1;

/// Share of a declared effect that rows may still show if the controller corrects it.
pub(super) const GONE: f64 = 0.3;

/// Gain on unseen blocks in standard errors that could be chance.
pub(super) const CHANCE: f64 = 1.0;

/// Whitened residuals of more standard deviations are outliers: one in 1.7 million by chance.
pub(super) const OUTLIER: f64 = 5.0;

/// Variance of a drift over the white noise that an arm can have; more is a drift of the instrument or an effect in no list.
pub(super) const MOST_WANDER: f64 = 2.0;

/// Odds from which on another effect replaces the chosen one once all rows are evidence: nearer to even, noise decides.
pub(super) const LIKELIER: f64 = 1.5;

/// Nats a row that a member must gain over the whole robot: half a percent of what is left.
pub(super) const GAIN_A_ROW: f64 = 0.0015;

/// Share of the scatter of times that the place explains from which on the arm never comes back: time and place are then one cause.
/// Rasters have 0.98 and more, shuffled rows less than a half.
pub(super) const NEVER_RETURNS: f64 = 0.9;

/// Share of a curve's variance that one harmonic explains from which on the two are one thing.
pub(super) const IS_A_WAVE: f64 = 0.98;

/// Nats that count as one in a posterior of so many scalars: models are never quite true, and evidence is surer than it should be, the
/// more so the more rows repeat what is not true.
pub(super) fn caution(scalars: usize) -> f64 {
    /// Scalars from which on half of the evidence is believed: calibrated on tables of 300 rows and of 24.
    const HALF_BELIEVED: f64 = 400.0;
    1.0 + (scalars as f64 / HALF_BELIEVED).min(1.0)
}
