//! `predict`: what becomes of programs as they stand.

use super::Outcome;
use super::against::Originals;
use super::args::Predict;
use super::foresee::{self, Batch};
use super::input::{Context, both};
use super::job::Job;
use super::output::{Outputs, one_thing};
use super::piped::{Piped, jobs};
use super::run::{Done, Setup, each, finish};
use deflex::correct;
use deflex::report::html::{PathKind, PathTrace};
use deflex::text::Diagnostic;
use std::path::PathBuf;

pub(super) fn run(args: &Predict) -> Outcome {
    let setup = Setup::read(&args.model, Context::read(&args.reading)?, args.correct, &args.reports);
    let piped = Piped::new(&args.inputs)?;
    let (setup, jobs) = both(setup, jobs(piped.as_ref(), &args.inputs, args.reading.format))?;
    let mut reports = args.reports.clone();
    if reports.report.is_none() && reports.to_stdout() == 0 {
        reports.report = Some(PathBuf::from("-"));
    }
    one_thing(reports.to_stdout())?;
    let originals = Originals::new(args.against.as_deref(), &jobs, args.reading.format)?;
    let read = args.inputs.iter().chain(&args.reading.context).chain([&args.model.cell]).chain(&args.model.forces);
    let outputs = Outputs::new(read.chain(&args.against));
    let batch = Batch {
        setup: &setup,
        originals: &originals,
        outputs: &outputs,
        report: reports.report.as_deref(),
        path: args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Predict, jobs.len())),
        programs: jobs.len(),
    };
    let done = each(jobs, args.common.quiet, |job, bar| match foresee::streamed(&batch, &job, bar, None)? {
        Some(foreseen) => Done::streamed(&job.name, foreseen),
        None => whole(&batch, job),
    })?;
    finish(outputs, &setup, PathKind::Predict, done, &reports, args.common.quiet)
}

/// Predicts what becomes of a program that is held whole.
fn whole(batch: &Batch<'_>, job: Job) -> Result<Done, Vec<Diagnostic>> {
    let (name, setup) = (job.name.clone(), batch.setup);
    let original = batch.originals.of(&job, setup)?;
    let program = setup.program(job)?;
    let predicted = correct::predict(&program, &setup.cell.cell, &setup.options, original.as_ref());
    let predicted = predicted.map_err(|e| setup.cell.own(e))?;
    let mut done = Done::new(&name, &program, predicted, batch.outputs.sibling(), batch.path.clone())?;
    done.rows = batch.rows(done.rows)?;
    Ok(done)
}
