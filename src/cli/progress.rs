//! Shows progress on a terminal, or as JSON lines for a program that reads stderr, and nowhere else.

use super::message::FOR_A_PROGRAM;
use deflex::correct::CutProgress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, TermLike};
use serde_json::json;
use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// A bar that counts programs, or a spinner for a single one; hidden if stderr is not a terminal.
pub(super) fn bar(programs: usize, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let (bar, form) = if programs > 1 {
        (ProgressBar::new(programs as u64), "{bar:30} {pos}/{len} programs {elapsed} (eta {eta})")
    } else {
        (ProgressBar::new_spinner(), "{spinner} {msg} {elapsed}")
    };
    drawn_as(&bar, form);
    if *FOR_A_PROGRAM {
        bar.set_draw_target(ProgressDrawTarget::term_like_with_hz(Box::<Lines>::default(), LINES_A_SECOND));
    }
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

/// The bar if it is that of one program: in a batch it counts programs.
pub(super) fn of_one(bar: &ProgressBar, programs: usize) -> Option<&ProgressBar> {
    Some(bar).filter(|_| programs == 1)
}

fn drawn_as(bar: &ProgressBar, form: &str) {
    let for_a_program = if bar.length().is_some() { "{percent}|{msg}" } else { "|{msg}" };
    if let Ok(style) = ProgressStyle::with_template(if *FOR_A_PROGRAM { for_a_program } else { form }) {
        bar.set_style(style);
    }
}

/// Number of progress lines per second: more are not useful to a person.
const LINES_A_SECOND: u8 = 5;

/// A terminal that prints each new state of the bar as one JSON line.
#[derive(Debug, Default)]
struct Lines {
    last: Mutex<String>,
}

impl TermLike for Lines {
    fn width(&self) -> u16 {
        u16::MAX
    }

    fn move_cursor_up(&self, _: usize) -> io::Result<()> {
        Ok(())
    }

    fn move_cursor_down(&self, _: usize) -> io::Result<()> {
        Ok(())
    }

    fn move_cursor_right(&self, _: usize) -> io::Result<()> {
        Ok(())
    }

    fn move_cursor_left(&self, _: usize) -> io::Result<()> {
        Ok(())
    }

    fn write_line(&self, text: &str) -> io::Result<()> {
        self.write_str(text)
    }

    fn write_str(&self, text: &str) -> io::Result<()> {
        let text = text.trim_end();
        // The bar also writes spaces up to the end of the line, which are left out.
        let Some((percent, message)) = text.split_once('|') else { return Ok(()) };
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if *last == text {
            return Ok(());
        }
        text.clone_into(&mut last);
        let percent = percent.trim().parse::<u8>().ok();
        writeln!(io::stderr().lock(), "{}", json!({ "progress": percent, "message": message }))
    }

    fn clear_line(&self) -> io::Result<()> {
        Ok(())
    }

    fn flush(&self) -> io::Result<()> {
        Ok(())
    }
}

/// Number of steps into which a bar divides its task.
const PARTS: u64 = 1000;

/// A bar for one task that reports its progress; hidden if stderr is not a terminal.
pub(super) fn shares(what: &'static str, quiet: bool) -> ProgressBar {
    let bar = bar(1, quiet);
    bytes(&bar, PARTS);
    bar.set_message(what);
    bar
}

/// Sets the bar to a share of the task, 0 to 1.
pub(super) fn reached(bar: &ProgressBar, share: f64) {
    bar.set_position((share * PARTS as f64) as u64);
}

/// Makes the bar show the cuts of one program. Each cut runs from 0 to 100 %.
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
    drawn_as(bar, "{bar:30} {percent}% {msg} {elapsed} (eta {eta})");
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
