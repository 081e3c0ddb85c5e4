//! `compensate`: writes programs with the correction in them.

use super::args::Compensate;
use super::batch::{self, Batch, in_one_file, post_options, shared_names};
use super::piped::{Piped, jobs};
use super::report::joined;
use super::run::{Done, each, finish, origins};
use super::setup::setup;
use super::{Outcome, progress, stream};
use crate::session::context::Context;
use crate::session::job::Job;
use crate::session::output::{Outputs, cannot_write, is_stdout, one_thing};
use crate::session::read::{both, other_ending};
use crate::session::written::{Edited, Written, written};
use deflex::correct::RAPID_MM_S;
use deflex::program::Language;
use deflex::report::html::{PathKind, PathTrace};
use deflex::text::{Diagnostic, Severity};
use indicatif::ProgressBar;
use std::path::PathBuf;

pub(super) fn run(args: &Compensate) -> Outcome {
    let context = Context::read(&args.reading.context)?;
    let piped = Piped::new(&args.inputs)?;
    let jobs = jobs(piped.as_ref(), &args.inputs, args.reading.format, args.reports.keep_going, &context);
    let setup = setup(&args.model, context, args.correct, &args.reports);
    let (mut setup, (jobs, failed)) = both(setup, jobs)?;
    setup.options.subdivide = args.subdivide.map(|mm| 1e-3 * mm);
    setup.options.allow_clones = args.allow_clones;
    setup.options.post = Some(args.post);
    one_stdout(args, &jobs)?;
    only_for_cl(args, &jobs)?;
    let outputs = Outputs::default();
    let batch = Batch {
        args,
        setup: &setup,
        outputs: &outputs,
        path: args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Compensate, jobs.len())),
        programs: jobs.len(),
        shared: shared_names(&jobs),
    };
    let done = each(jobs, (args.common.quiet, args.reports.keep_going), failed, |job, bar| {
        job.marked()?;
        let named_otherwise = named_otherwise(args, &job)?;
        let origins = origins(&job, &args.reports)?;
        // The driven path can be corrected only with the whole program in memory.
        let streamed = if args.max_path_error.is_none() { stream::compensate(&batch, &job, bar)? } else { None };
        let mut done = match streamed {
            Some(done) => done,
            None => batch.whole(job, bar)?,
        };
        done.notes.extend(named_otherwise);
        Ok(done.made_from(origins))
    });
    let done = done.map_err(|errors| setup.failed(errors))?;
    finish(outputs, &setup, PathKind::Compensate, done, &args.reports, args.common.quiet)
}

impl Batch<'_> {
    /// Corrects a program that is held as a whole.
    fn whole(&self, job: Job, bar: &ProgressBar) -> Result<Done, Vec<Diagnostic>> {
        let (args, setup) = (self.args, self.setup);
        let (name, files, companions) = (job.name.clone(), job.files.clone(), job.companions.clone());
        let noticed = self.noticed(&job);
        let program = setup.program(job)?;
        let options = setup.options_followed(progress::of_one(bar, self.programs).map(progress::cutting));
        let cell = &setup.cell.cell;
        let tolerance = args.max_path_error.map(|mm| 1e-3 * mm);
        let edited = Edited::new(&program, cell, &options, tolerance);
        let Edited { shaped, corrected } = edited.map_err(|errors| setup.cell.own(errors))?;
        let mut outputs = self.outputs.sibling();
        let post = || post_options(args, &files[0]);
        let Written { files: written, notes } =
            written(shaped.as_ref().unwrap_or(&program), &corrected, cell, &files, post)?;
        // Reports are named after the first module that has motions: the others only declare names.
        let moving = corrected
            .rows
            .first()
            .and_then(|row| row.names.as_deref())
            .and_then(|names| program.sources.iter().position(|source| *source.name == *names.file));
        let main = moving.filter(|_| program.language.is_edited()).unwrap_or_default();
        let stem = written.get(main).or(written.first()).map_or_else(PathBuf::new, |(file, _)| file.clone());
        place(args, &mut outputs, written.into_iter().chain(companions))?;
        let mut done =
            Done::new((&name, PathKind::Compensate), &program, corrected, outputs, self.path.clone(), noticed)?;
        done.notes.extend(notes);
        if let (Some(path), Some(rows)) = (self.default_report(&stem), &done.rows) {
            joined(&mut done.outputs, &path, std::slice::from_ref(rows))?;
        }
        match (&args.reports.report, &mut done.rows) {
            (Some(path), Some(rows)) if self.programs > 1 => {
                rows.spool().map_err(|error| cannot_write(path, &error))?
            }
            (Some(_), _) => {}
            (None, rows) => *rows = None,
        }
        Ok(done)
    }
}

/// An error if an option for CL data is given, and no input has any.
fn only_for_cl(args: &Compensate, jobs: &[Job]) -> Result<(), Vec<Diagnostic>> {
    if jobs.is_empty() || jobs.iter().any(|job| job.language == Language::Cl) {
        return Ok(());
    }
    let given = [
        ("--post", args.post != Language::Rapid),
        ("--max-targets", args.max_targets.is_some()),
        ("--feed", args.feed.is_some()),
        ("--rapid-speed", args.rapid_speed.total_cmp(&RAPID_MM_S).is_ne()),
    ];
    let Some((option, _)) = given.into_iter().find(|(_, is_given)| *is_given) else { return Ok(()) };
    let message = format!("{option} is for CL data, and none are given");
    let help = "leave it out: a robot program is corrected in its own language";
    Err(vec![Diagnostic::error("usage.cl", "", message).help(help)])
}

/// An error if two results would go to stdout, or if several programs have no output folder.
fn one_stdout(args: &Compensate, jobs: &[Job]) -> Result<(), Vec<Diagnostic>> {
    let files: usize = jobs.iter().map(|job| job.texts.len()).sum();
    if args.out_dir.is_none() && files > 1 {
        let message = format!("{files} files will be written, which need a folder");
        return Err(vec![Diagnostic::error("usage.out-dir", "", message).help("give --out-dir DIR")]);
    }
    let program = args.out_dir.is_none() && args.output.as_deref().is_none_or(is_stdout);
    one_thing(usize::from(program) + args.reports.to_stdout())
}

/// A warning if the name of the corrected program has the ending of another language.
///
/// # Errors
/// CL data were given, and the file of the posted program is named like CL data: the next program that opens it would
/// read it as CL data.
fn named_otherwise(args: &Compensate, job: &Job) -> Result<Option<Diagnostic>, Vec<Diagnostic>> {
    let Some(output) = args.output.as_deref().filter(|path| !is_stdout(path)) else { return Ok(None) };
    let written = if job.language == Language::Cl { args.post } else { job.language };
    match other_ending(output, written) {
        Some((Language::Cl, warning)) if job.language == Language::Cl => Err(vec![warning.severity(Severity::Error)]),
        other => Ok(other.map(|(_, warning)| warning)),
    }
}

/// Writes the files of one program to their paths.
fn place(
    args: &Compensate,
    outputs: &mut Outputs,
    written: impl Iterator<Item = (PathBuf, Vec<u8>)>,
) -> Result<(), Vec<Diagnostic>> {
    let written: Vec<_> = written.collect();
    in_one_file(args, written.len())?;
    written.iter().try_for_each(|(file, bytes)| outputs.add(&batch::place(args, file), bytes))
}
