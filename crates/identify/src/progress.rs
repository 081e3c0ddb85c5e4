//! The share of the work that is done at the end of each step.

use super::input::Progress;
use deflex_text::Diagnostic;

/// The rows are solved.
pub(super) const SOLVED: f64 = 0.05;
/// The gear harmonics are found.
pub(super) const SOUGHT: f64 = 0.3;
/// The set is chosen.
pub(super) const CHOSEN: f64 = 0.85;
/// The set is judged.
pub(super) const JUDGED: f64 = 0.95;

/// Reports the progress.
///
/// # Errors
/// `run.called-off` if the run is cancelled.
pub(super) fn reached(progress: &Progress<'_>, share: f64) -> Result<(), Vec<Diagnostic>> {
    if progress(share) {
        return Ok(());
    }
    Err(Diagnostic::error("run.called-off", "", "the run was cancelled").into())
}

/// The share of the work that is done before a round, if all rounds take the work from share `from` to share `to`.
pub(super) fn within(from: f64, to: f64, round: usize, rounds: usize) -> f64 {
    from + (to - from) * round as f64 / rounds as f64
}
