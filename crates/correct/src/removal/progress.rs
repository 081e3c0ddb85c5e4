//! The receiver of the progress of a cut.

use std::fmt;
use std::sync::Arc;

type Receiver = dyn Fn(f64) -> bool + Send + Sync;

/// Receives the share of a cut that is done, 0 to 1, from time to time, and cancels the run with `false`; by default there is no receiver.
///
/// # Examples
/// ```
/// use deflex_correct::{CutProgress, Options};
///
/// let options = Options { cut_progress: CutProgress::new(|share| share < 0.5), ..Options::default() }; // stops halfway
/// ```
#[derive(Clone, Default)]
pub struct CutProgress(Option<Arc<Receiver>>);

impl CutProgress {
    /// A receiver that calls this function.
    pub fn new(receiver: impl Fn(f64) -> bool + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(receiver)))
    }

    /// Reports the number of points that are done. Returns whether the cut goes on.
    pub(super) fn goes_on(&self, done: usize, points: usize) -> bool {
        self.0.as_ref().is_none_or(|receiver| receiver(done as f64 / points.max(1) as f64))
    }
}

impl fmt::Debug for CutProgress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("CutProgress").field(&self.0.as_ref().map(|_| "receiver")).finish()
    }
}
