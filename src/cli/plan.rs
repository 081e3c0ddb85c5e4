//! `plan`: what to measure, so that effects can be distinguished.

use super::args::Plan as Arguments;
use super::files::{all, both, source};
use super::input::{CellFile, Context};
use super::job::Job;
use super::output::{Outputs, is_stdout, one_thing};
use super::session::{self, ProgramFiles};
use super::{Answer, Outcome, message, progress};
use deflex::identify::PlanProgram;
use deflex::program::Language;
use deflex::report::plan_text;
use deflex::text::{Diagnostic, Severity};
use std::path::Path;

pub(super) fn run(args: &Arguments) -> Outcome {
    let written = [Some(&args.output), args.measured.as_ref(), args.json.as_ref(), args.html.as_ref()];
    let printed = written.into_iter().flatten().filter(|path| is_stdout(path)).count();
    one_thing(printed)?;
    let (cell, context) = both(CellFile::read(&args.cell), Context::read(&args.reading))?;
    let pool = all(args.pool.iter().map(|path| {
        let job = Job::of(path, args.reading.format);
        job.and_then(|job| ProgramFiles::of(job, context.clone()))
    }))?;
    let after = args.after.as_deref().map(source).transpose()?;
    let stem = args.output.file_stem().filter(|_| !is_stdout(&args.output));
    let name = stem.map_or_else(|| "plan".into(), |stem| stem.to_string_lossy().into_owned());
    let bar = progress::shares("planning", args.common.quiet);
    let tell = |share: f64| progress::reached(&bar, share);
    let language = args.post.or(cell.cell.language).unwrap_or(Language::Rapid);
    let program = PlanProgram { name: &name, language, ask: args.ask.unwrap_or_default().into() };
    let done = session::plan(&cell, usize::from(args.rows), &pool, after.as_ref(), program, &tell);
    bar.finish_and_clear();
    let done = done?;
    let found = &done.found;

    let mut outputs = Outputs::default();
    outputs.add(&args.output, found.program.as_bytes())?;
    if let Some(path) = &args.measured {
        outputs.add(path, found.table.as_bytes())?;
    }
    if let Some(path) = &args.json {
        outputs.add_report(path, done.json()?.as_bytes())?;
    }
    if let Some(path) = &args.html {
        outputs.add_report(path, done.page().as_bytes())?;
    }
    let text = plan_text(found);
    if printed == 0 {
        outputs.add_summary(&text);
    } else if !args.common.quiet {
        message::say(&[text]);
    }
    outputs.commit()?;
    message::print(&[other_ending(&args.output, language), cell.cell.notes.clone()].concat(), args.common.quiet);
    Ok(Answer::Yes)
}

/// A note where the name of the program has another language's ending: the controller would not load it.
fn other_ending(path: &Path, language: Language) -> Vec<Diagnostic> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let other = |ending: &String| Language::ALL.iter().any(|known| known.endings().contains(&&ending[..]));
    let wrong = ending.filter(|ending| !language.endings().contains(&&ending[..]) && other(ending));
    let note = wrong.map(|ending| {
        let message = format!("the program is {}, and the file is named .{ending}", language.name());
        let help = format!("name it .{}, or give the language with --post", language.endings()[0]);
        Diagnostic::error("plan.ending", &path.display().to_string(), message).severity(Severity::Note).help(help)
    });
    note.into_iter().collect()
}
