//! Progress on a terminal; nothing elsewhere.

use indicatif::{ProgressBar, ProgressStyle};
use std::time::Duration;

/// A bar over programs, or a spinner for one; hidden where stderr is no terminal.
pub(super) fn bar(programs: usize, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let (bar, form) = if programs > 1 {
        (ProgressBar::new(programs as u64), "{bar:30} {pos}/{len} programs {elapsed} (eta {eta})")
    } else {
        (ProgressBar::new_spinner(), "{spinner} {msg} {elapsed}")
    };
    if let Ok(style) = ProgressStyle::with_template(form) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}
