//! Progress on a terminal; nothing elsewhere.

use deflex::correct::CutProgress;
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

/// Parts that the share of a work is shown in.
const PARTS: u64 = 1000;

/// A bar over one work that tells its share; hidden where stderr is no terminal.
pub(super) fn shares(what: &'static str, quiet: bool) -> ProgressBar {
    let bar = bar(1, quiet);
    bytes(&bar, PARTS);
    bar.set_message(what);
    bar
}

/// Moves it to a share.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a share of the parts
pub(super) fn reached(bar: &ProgressBar, share: f64) {
    bar.set_position((share * PARTS as f64) as u64);
}

/// Makes it a bar over the cuts of one program, each from none to all.
pub(super) fn cutting(bar: &ProgressBar) -> CutProgress {
    bytes(bar, PARTS);
    bar.set_message("cutting the stock");
    let bar = bar.clone();
    CutProgress::new(move |share| {
        reached(&bar, share);
        if share >= 1.0 {
            bar.set_message("cut, solving");
        }
        true
    })
}

/// Makes it a bar over the bytes of one long program.
pub(super) fn bytes(bar: &ProgressBar, total: u64) {
    bar.set_length(total);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent}% {msg} {elapsed} (eta {eta})") {
        bar.set_style(style);
    }
}

/// Moves it to where a program is.
pub(super) fn at(bar: &ProgressBar, targets: usize, bytes: u64) {
    show(bar, targets, bytes, "targets");
}

/// The same while a program is only looked through.
pub(super) fn read(bar: &ProgressBar, targets: usize, bytes: u64) {
    show(bar, targets, bytes, "targets read");
}

fn show(bar: &ProgressBar, targets: usize, bytes: u64, what: &str) {
    bar.set_position(bytes);
    if !bar.is_hidden() {
        let seconds = bar.elapsed().as_secs_f64().max(1e-3);
        bar.set_message(format!("{targets} {what}, {:.0} a second", targets as f64 / seconds));
    }
}
