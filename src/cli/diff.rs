//! `diff`: what changed between two programs.

use super::args::Diff;
use super::{Answer, Outcome};
use crate::session::context::Context;
use crate::session::job::Job;
use crate::session::output::{Outputs, one_thing, to_stdout};
use crate::session::read::both;
use crate::session::{ProgramFiles, diff};
use std::io::{IsTerminal, stdout};
use std::path::Path;

pub(super) fn run(args: &Diff) -> Outcome {
    let context = Context::read(&args.reading.context)?;
    let read = |path: &Path| ProgramFiles::of(Job::of(path, args.reading.format)?, context.clone());
    let (original, corrected) = both(read(&args.original), read(&args.corrected))?;
    let compared = diff(&original, &corrected)?;
    let printed = to_stdout([&args.report, &args.json, &args.html].map(Option::as_ref));
    one_thing(printed)?;

    let mut outputs = Outputs::default();
    if printed == 0 && !args.quiet {
        outputs.add_summary(&if stdout().is_terminal() { compared.summary() } else { compared.text() });
    }
    outputs.add_report(args.report.as_ref(), || Ok(compared.csv()))?;
    outputs.add_report(args.json.as_ref(), || compared.json())?;
    outputs.add_report(args.html.as_ref(), || Ok(compared.page()))?;
    outputs.commit()?;
    Ok(if compared.found.is_empty() { Answer::Yes } else { Answer::No })
}
