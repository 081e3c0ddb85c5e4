//! `diff`: what changed between two programs.

use super::args::Diff;
use super::{Answer, Outcome};
use crate::session::input::{self, Context};
use crate::session::job::Job;
use crate::session::output::{Outputs, one_thing, to_stdout};
use crate::session::read::both;
use crate::session::report::pretty;
use deflex::report::html::diff_page;
use deflex::report::{diff_csv, diff_summary, diff_text, difference};
use std::io::{IsTerminal, stdout};
use std::path::Path;

pub(super) fn run(args: &Diff) -> Outcome {
    let context = Context::of(&args.reading.context)?;
    let read = |path: &Path| input::program_alone(Job::of(path, args.reading.format)?, &context);
    let (original, corrected) = both(read(&args.original), read(&args.corrected))?;
    let found = difference(&original, &corrected);
    let printed = to_stdout([&args.report, &args.json, &args.html].map(Option::as_ref));
    one_thing(printed)?;

    let mut outputs = Outputs::default();
    if printed == 0 && !args.quiet {
        let text = if stdout().is_terminal() { diff_summary(&found) } else { diff_text(&found) };
        outputs.add_summary(&text);
    }
    outputs.add_report(args.report.as_ref(), || Ok(diff_csv(&found)))?;
    outputs.add_report(args.json.as_ref(), || pretty(&found))?;
    let page = || Ok(diff_page(&original, &args.corrected.display().to_string(), &found));
    outputs.add_report(args.html.as_ref(), page)?;
    outputs.commit()?;
    Ok(if found.is_empty() { Answer::Yes } else { Answer::No })
}
