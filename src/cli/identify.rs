//! `identify`: which effect the cell lacks, and the cell with it.

use super::args::Identify;
use super::files::{all, both};
use super::held::{self, MeasuredFile, ProgramFiles};
use super::input::{CellFile, Context};
use super::job::Job;
use super::output::{Outputs, is_stdout, one_thing};
use super::{Answer, Outcome, message, progress};
use deflex::cell::examples_left;
use deflex::measured::ColumnNames;
use deflex::report::{identify_text, residual_csv};
use deflex::text::Diagnostic;
use std::path::Path;

pub(super) fn run(args: &Identify) -> Outcome {
    let printed = [&args.output, &args.report, &args.json, &args.html]
        .into_iter()
        .flatten()
        .filter(|path| is_stdout(path))
        .count();
    one_thing(printed)?;
    let (cell, context) = both(CellFile::read(&args.cell), Context::read(&args.reading))?;
    let names = args.columns.as_deref().map(ColumnNames::parse).transpose()?;
    let table = |path: &Path| Ok(MeasuredFile::read(path)?.read_as(names.clone(), args.match_mm));
    let runs = all(args.run.chunks_exact(2).map(|pair| run_of(args, &context, &pair[0], table(&pair[1]))));
    let (runs, poses) = both(runs, all(args.poses.iter().map(|path| table(path))))?;

    let bar = progress::shares("identifying", args.common.quiet);
    let tell = |share: f64| {
        progress::reached(&bar, share);
        true
    };
    let done = held::identify(&cell, &runs, &poses, args.tool.as_deref(), &tell);
    bar.finish_and_clear();
    let done = done?;
    let found = &done.found;

    let mut outputs = Outputs::default();
    if let Some(path) = &args.output {
        outputs.add(path, done.cell()?.as_bytes())?;
    }
    if let Some(path) = &args.json {
        outputs.add_report(path, done.json()?.as_bytes())?;
    }
    if let Some(path) = &args.report {
        outputs.add_report(path, residual_csv(&found.residuals).as_bytes())?;
    }
    if let Some(path) = &args.html {
        outputs.add_report(path, done.page().as_bytes())?;
    }
    if printed == 0 {
        outputs.add(Path::new("-"), identify_text(found).as_bytes())?;
    } else if !args.common.quiet {
        message::say(&[identify_text(found)]);
    }
    outputs.commit()?;
    let notes: Vec<Diagnostic> =
        examples_left(&cell.source).into_iter().chain(cell.cell.notes.clone()).chain(done.notes.clone()).collect();
    message::print(&notes, args.common.quiet);
    Ok(Answer::Yes)
}

/// A program and what was measured on it.
fn run_of(
    args: &Identify,
    context: &Context,
    program: &Path,
    measured: Result<MeasuredFile, Vec<Diagnostic>>,
) -> Result<(ProgramFiles, MeasuredFile), Vec<Diagnostic>> {
    let job = Job::of(program, args.reading.format);
    both(job.and_then(|job| ProgramFiles::of(job, context.clone())), measured)
}
