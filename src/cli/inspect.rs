//! `inspect`: shows what deflex understands of programs.

use super::args::Inspect;
use super::{Answer, Outcome, progress};
use crate::session::output::{Outputs, is_stdout};
use crate::session::{inspect, programs_in};
use deflex::text::printable_line;

pub(super) fn run(args: &Inspect) -> Outcome {
    let paths = programs_in(&args.inputs)?;
    let bar = progress::bar(paths.len(), args.common.quiet);
    let found = inspect(&paths, &args.reading.context, args.reading.format, &|path, done| {
        bar.set_message(printable_line(&path.display().to_string()).into_owned());
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    let found = found?;
    let mut outputs = Outputs::default();
    outputs.add_report(args.json.as_ref(), || found.json())?;
    if !args.json.as_deref().is_some_and(is_stdout) {
        outputs.add_summary(&found.text());
    }
    outputs.commit()?;
    // The table lists refused files with their reasons.
    found.understood().map(|()| Answer::Yes)
}
