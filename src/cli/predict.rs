//! `predict`: reports the errors of programs without correcting them.

use super::against::Originals;
use super::args::Predict;
use super::piped::{Piped, jobs};
use super::predicted::{self, Batch};
use super::run::{Done, each, finish, origins};
use super::setup::setup;
use super::{Outcome, message, progress};
use crate::session::context::Context;
use crate::session::job::Job;
use crate::session::output::{Outputs, one_thing, to_stdout};
use crate::session::read::both;
use crate::session::report::Noticed;
use crate::session::setup::Setup;
use deflex::correct;
use deflex::report::digest_text;
use deflex::report::html::{PathKind, PathTrace};
use deflex::report::path_csv;
use deflex::text::{Diagnostic, printable};
use indicatif::ProgressBar;
use std::io::{IsTerminal, stdout};
use std::path::PathBuf;

pub(super) fn run(args: &Predict) -> Outcome {
    let context = Context::read(&args.reading.context)?;
    let piped = Piped::new(&args.inputs)?;
    let jobs = jobs(piped.as_ref(), &args.inputs, args.reading.format, args.reports.keep_going, &context);
    let setup = setup(&args.model, context, args.correct, &args.reports);
    let (setup, (jobs, failed)) = both(setup, jobs)?;
    let mut reports = args.reports.clone();
    let path_to_stdout = to_stdout([args.path.as_ref()]);
    // A table of rows is for files and pipes. On a terminal a person sees only the worst rows.
    let is_wanted = reports.report.is_some() || reports.to_stdout() + path_to_stdout > 0;
    let is_read = !is_wanted && stdout().is_terminal();
    if !is_wanted && !is_read {
        reports.report = Some(PathBuf::from("-"));
    }
    one_thing(reports.to_stdout() + path_to_stdout)?;
    let originals = Originals::new(args.against.as_deref(), &jobs, args.reading.format)?;
    let mut outputs = Outputs::default();
    outputs.add_report(args.path.as_ref(), || driven_path(&setup, &jobs, args.common.quiet))?;
    let batch = Batch {
        setup: &setup,
        originals: &originals,
        outputs: &outputs,
        report: reports.report.as_deref(),
        path: args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Predict, jobs.len())),
        programs: jobs.len(),
    };
    let done = each(jobs, (args.common.quiet, args.reports.keep_going), failed, |job, bar| {
        job.marked()?;
        let origins = origins(&job, &args.reports)?;
        let done = match predicted::streamed(&batch, &job, bar, None)? {
            Some(predicted) => Done::streamed(&job.name, PathKind::Predict, predicted.passed),
            None => whole(&batch, job, bar)?,
        };
        Ok(done.made_from(origins))
    });
    let mut done = done.map_err(|errors| setup.failed(errors))?;
    if is_read {
        for done in &mut done.0 {
            done.text.clear();
            outputs.add_summary(&printable(&digest_text(&done.summary, &done.digest)));
        }
    }
    finish(outputs, &setup, PathKind::Predict, done, &reports, args.common.quiet)
}

/// Predicts a program that is held as a whole.
fn whole(batch: &Batch<'_>, job: Job, bar: &ProgressBar) -> Result<Done, Vec<Diagnostic>> {
    let (name, setup) = (job.name.clone(), batch.setup);
    let original = batch.originals.of(&job, setup)?;
    let program = setup.program(job)?;
    let options = setup.options_followed(progress::of_one(bar, batch.programs).map(progress::cutting));
    let predicted = correct::predict(&program, &setup.cell.cell, &options, original.as_ref());
    let predicted = predicted.map_err(|e| setup.cell.own(e))?;
    let noticed = Noticed::new(setup.options.forces.as_ref(), None);
    let mut done = Done::new(
        (&name, PathKind::Predict),
        &program,
        predicted,
        batch.outputs.sibling(),
        batch.path.clone(),
        noticed,
    )?;
    done.rows = batch.rows(done.rows)?;
    Ok(done)
}

/// The path of the single program, as the controller drives it and the loaded arm takes it, as CSV.
fn driven_path(setup: &Setup, jobs: &[Job], quiet: bool) -> Result<Vec<u8>, Vec<Diagnostic>> {
    let [job] = jobs else {
        let message = format!("--path samples the path of one program, and {} are given", jobs.len());
        return Err(vec![Diagnostic::error("usage.path", "", message).help("give the programs one at a time")]);
    };
    let path = setup.driven_path(&setup.program(job.clone().held()?)?)?;
    // With a law, the prediction follows the path too, and has the same notes.
    if setup.cell.cell.controller.path.is_none() {
        message::print(&path.notes, quiet);
    }
    Ok(path_csv(&path.samples))
}
