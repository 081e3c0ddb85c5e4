//! `plan`: chooses what to measure, so that effects can be distinguished.

use super::args::Plan as Arguments;
use super::{Answer, Outcome, message, progress};
use crate::session::context::Context;
use crate::session::input::CellFile;
use crate::session::job::Job;
use crate::session::output::{Outputs, is_stdout, one_thing, to_stdout};
use crate::session::read::{all, both, other_ending, source};
use crate::session::{self, ProgramFiles};
use deflex::identify::PlanProgram;
use deflex::program::Language;
use deflex::report::plan_text;
use deflex::text::Diagnostic;

pub(super) fn run(args: &Arguments) -> Outcome {
    let printed = to_stdout([Some(&args.output), args.measured.as_ref(), args.json.as_ref(), args.html.as_ref()]);
    one_thing(printed)?;
    let (cell, context) = both(CellFile::read(&args.cell), Context::read(&args.reading.context))?;
    let pool = all(args.pool.iter().map(|path| {
        let job = Job::of(path, args.reading.format);
        job.and_then(|job| ProgramFiles::of(job, context.clone()))
    }))?;
    let after = args.after.as_deref().map(source).transpose()?;
    let stem = args.output.file_stem().filter(|_| !is_stdout(&args.output));
    let name = stem.map_or_else(|| "plan".into(), |stem| stem.to_string_lossy().into_owned());
    let bar = progress::shares("planning", args.common.quiet);
    let reached = |share: f64| progress::reached(&bar, share);
    let language = args.post.or(cell.cell.language).unwrap_or(Language::Rapid);
    let program = PlanProgram { name: &name, language, ask: args.ask.unwrap_or_default().into() };
    let done = session::plan(&cell, usize::from(args.rows), &pool, after.as_ref(), program, &reached);
    bar.finish_and_clear();
    let done = done?;
    let found = &done.found;

    let mut outputs = Outputs::default();
    outputs.add(&args.output, found.program.as_bytes())?;
    if let Some(path) = &args.measured {
        outputs.add(path, found.table.as_bytes())?;
    }
    outputs.add_report(args.json.as_ref(), || done.json())?;
    outputs.add_report(args.html.as_ref(), || Ok(done.page()))?;
    let text = plan_text(found);
    if printed == 0 {
        outputs.add_summary(&text);
    } else if !args.common.quiet {
        message::print_lines(&[text]);
    }
    outputs.commit()?;
    let warning = other_ending(&args.output, language).map(|(_, warning)| warning);
    let notes: Vec<Diagnostic> = warning.into_iter().chain(cell.cell.notes.iter().cloned()).collect();
    message::print(&notes, args.common.quiet);
    Ok(Answer::Yes)
}
