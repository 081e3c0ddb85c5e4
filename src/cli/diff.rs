//! `diff`: what changed between two programs.

use super::args::Diff;
use super::files::both;
use super::input::{self, Context};
use super::job::Job;
use super::output::{Outputs, is_stdout, one_thing};
use super::report::pretty;
use super::{Answer, Outcome};
use deflex::report::html::diff_page;
use deflex::report::{diff_csv, diff_summary, diff_text, difference};
use std::io::{IsTerminal, stdout};
use std::path::Path;

pub(super) fn run(args: &Diff) -> Outcome {
    let context = Context::read(&args.reading)?;
    let read = |path: &Path| input::program_alone(Job::of(path, args.reading.format)?, &context);
    let (original, corrected) = both(read(&args.original), read(&args.corrected))?;
    let found = difference(&original, &corrected);
    let printed = [&args.report, &args.json, &args.html].into_iter().flatten().filter(|path| is_stdout(path)).count();
    one_thing(printed)?;

    let mut outputs = Outputs::default();
    if printed == 0 && !args.quiet {
        let text = if stdout().is_terminal() { diff_summary(&found) } else { diff_text(&found) };
        outputs.add_summary(&text);
    }
    if let Some(path) = &args.report {
        outputs.add_report(path, diff_csv(&found).as_bytes())?;
    }
    if let Some(path) = &args.json {
        outputs.add_report(path, pretty(&found)?.as_bytes())?;
    }
    if let Some(path) = &args.html {
        let page = diff_page(&original, &args.corrected.display().to_string(), &found);
        outputs.add_report(path, page.as_bytes())?;
    }
    outputs.commit()?;
    Ok(if found.is_empty() { Answer::Yes } else { Answer::No })
}
