//! `check`: is each target within tolerance, reachable and convergent?

use super::against::Originals;
use super::args::{Check, CheckFormat, Form};
use super::piped::{Piped, jobs};
use super::predicted::{self, Batch, Passed, Predicted};
use super::report;
use super::run::each;
use super::setup::setup;
use super::{Answer, Outcome, message, progress};
use crate::session::checked::{add_notes, answer_json, limited};
use crate::session::context::Context;
use crate::session::job::Job;
use crate::session::output::{Outputs, one_thing};
use crate::session::read::both;
use crate::session::report::{Rows, pretty};
use crate::session::tolerances::{Chunks, Found, Programs};
use deflex::program::Language;
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::report::{CheckFile, check_text, junit, sarif};
use deflex::text::Diagnostic;
use indicatif::ProgressBar;

pub(super) fn run(args: &Check) -> Outcome {
    let (form, kind) = formats(args)?;
    let context = Context::read(&args.context)?;
    let piped = Piped::new(&args.inputs)?;
    let jobs = jobs(piped.as_ref(), &args.inputs, kind, args.reports.keep_going, &context);
    let (mut setup, (jobs, failed)) = both(setup(&args.model, context, args.correct, &args.reports), jobs)?;
    setup.cell = limited(&setup.cell, &args.tolerances(), args.against.is_some())?;
    // The verdicts in words make room for a report on stdout.
    let has_report = args.reports.to_stdout() > 0;
    one_thing(args.reports.to_stdout() + usize::from(!has_report || form != Form::Text))?;
    let originals = Originals::new(args.against.as_deref(), &jobs, kind)?;
    let mut outputs = Outputs::default();
    let batch = Batch {
        setup: &setup,
        originals: &originals,
        outputs: &outputs,
        report: args.reports.report.as_deref(),
        path: args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Check, jobs.len())),
        programs: jobs.len(),
    };
    let (checked, failed) =
        each(jobs, (args.common.quiet, args.reports.keep_going), failed, |job, bar| one(args, &batch, job, bar))
            .map_err(|errors| setup.failed(errors))?;
    let (mut files, mut rows, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    let mut printed = setup.notes();
    for Checked { found, outputs: staged, rows: report } in checked {
        add_notes(&mut printed, found.notes);
        outputs.append(staged, &found.file.path)?;
        files.push(found.file);
        rows.extend(report);
        paths.extend(found.path);
    }

    let cell = setup.cell.origin();
    let text = match form {
        Form::Json => pretty(&answer_json(&cell, &files))?,
        Form::Junit => junit(&files),
        Form::Sarif => pretty(&sarif(&files))?,
        Form::Text => check_text(&files),
    };
    if !has_report {
        outputs.add_summary(&text);
    }
    outputs.add_report(args.reports.json.as_ref(), || pretty(&answer_json(&cell, &files)))?;
    if let Some(path) = args.reports.report.as_ref().filter(|_| !rows.is_empty()) {
        report::joined(&mut outputs, path, &rows)?;
    }
    let (scene, tolerance_mm) = (Some(&setup.cell.cell), Some(args.max_error));
    let page = PathPage { kind: PathKind::Check, cell: &cell, programs: &paths, scene, tolerance_mm };
    outputs.add_report(args.reports.html.as_ref(), || Ok(page.html()))?;
    outputs.commit()?;
    message::print(&setup.cell.own(printed), args.common.quiet);
    if has_report && !args.common.quiet {
        message::print_lines(&[text]);
    }
    if !failed.is_empty() {
        return Err(failed);
    }
    Ok(if files.iter().all(CheckFile::passed) { Answer::Yes } else { Answer::No })
}

/// Form of the answer and language of the input. `--format` is an old option that can set either.
fn formats(args: &Check) -> Result<(Form, Option<Language>), Vec<Diagnostic>> {
    let (mut form, mut input) = (args.output_format, args.input_format);
    for format in &args.format {
        let taken = match format {
            CheckFormat::Input(language) => input.replace(*language).is_some(),
            CheckFormat::Form(of) => form.replace(*of).is_some(),
        };
        if taken {
            return Err(Diagnostic::error(
                "usage.format",
                "",
                "the form of the answer, or the kind of the input, is given twice",
            )
            .help("give --output-format once and --input-format once")
            .into());
        }
    }
    Ok((form.unwrap_or_default(), input))
}

/// Result of checking one program.
struct Checked {
    found: Found,
    /// Output files that are already staged.
    outputs: Outputs,
    /// Rows for the common report; `None` if no report is wanted, or if it is staged already.
    rows: Option<Rows>,
}

fn one(args: &Check, batch: &Batch<'_>, job: Job, bar: &ProgressBar) -> Result<Checked, Vec<Diagnostic>> {
    let tolerances = args.tolerances();
    let named = args.reports.json.is_some() || args.reports.html.is_some() || formats(args)?.0 == Form::Json;
    let origins = if named { job.origins()? } else { Vec::new() };
    job.marked()?;
    let (mut found, outputs, rows) = match predicted::streamed(batch, &job, bar, Some(&tolerances))? {
        Some(Predicted { passed: Passed { streamed, digest, outputs, rows, path }, listed }) => {
            let chunks = Chunks { name: &job.name, streamed, digest, listed, path };
            (tolerances.streamed(chunks, &batch.setup.cell)?, outputs, rows)
        }
        None => {
            let (name, setup) = (job.name.clone(), batch.setup);
            let original = batch.originals.of(&job, setup)?;
            let program = setup.program(job)?;
            let options = setup.options_followed(progress::of_one(bar, batch.programs).map(progress::cutting));
            let programs = Programs { name: &name, program: &program, original: original.as_ref() };
            let mut found = tolerances.whole(&programs, setup, &options, batch.path.clone())?;
            let rows = batch.rows(found.rows.take())?;
            (found, batch.outputs.sibling(), rows)
        }
    };
    if let Some((summary, _)) = &mut found.path {
        summary.sources.clone_from(&origins);
    }
    found.file.sources = origins;
    Ok(Checked { found, outputs, rows })
}
