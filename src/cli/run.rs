//! `compensate` and `predict`: programs through the forward line, in parallel, and what comes out in order.

use super::args::{Compensate, Corrected as What, Model, Predict, Reports};
use super::foresee::{self, Foreseen};
use super::input::{self, CellFile, Context, ForceFile, Job};
use super::output::{Outputs, cannot_write, is_stdout};
use super::report::{self, Rows};
use super::stream::{self, Piped};
use super::{Answer, Outcome, message, progress};
use deflex::cell::examples_left;
use deflex::correct::{self, Correct, Corrected, Options, PostOptions, compensate, predict};
use deflex::program::{Language, Program};
use deflex::report::FileSummary;
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::text::{Diagnostic, apply};
use indicatif::ProgressBar;
use rayon::prelude::*;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Cell, forces and options of a run.
pub(super) struct Setup {
    pub(super) cell: CellFile,
    pub(super) forces: Option<ForceFile>,
    pub(super) context: Context,
    pub(super) options: Options,
}

impl Setup {
    pub(super) fn read(
        model: &Model,
        context: Context,
        what: What,
        reports: &Reports,
    ) -> Result<Self, Vec<Diagnostic>> {
        let cell = CellFile::read(&model.cell);
        let forces = model.forces.as_deref().map(ForceFile::read).transpose();
        let (cell, forces) = match (cell, forces) {
            (Ok(cell), Ok(forces)) => (cell, forces),
            (cell, forces) => return Err([cell.err(), forces.err()].into_iter().flatten().flatten().collect()),
        };
        let (rows, forces) = forces.unzip();
        let options = Options {
            correct: match what {
                What::Pose => Correct::Pose,
                What::Position => Correct::Position,
            },
            forces,
            tool: model.tool.clone(),
            stiffness: reports.html.is_some(),
            ..Options::default()
        };
        Ok(Self { cell, forces: rows, context, options })
    }

    /// Parses a program and checks that the table of forces is its own.
    pub(super) fn program(&self, job: Job) -> Result<Program, Vec<Diagnostic>> {
        let program = input::program(job, &self.context, &self.cell, self.options.tool.as_deref())?;
        self.forces.as_ref().map_or(Ok(()), |forces| forces.check(&program))?;
        Ok(program)
    }

    /// What a run says about the cell, once.
    pub(super) fn notes(&self) -> Vec<Diagnostic> {
        let cell = &self.cell.cell;
        let covered = cell.arm.effects.iter().find(|effect| effect.covered_by().is_some());
        let silent = covered.filter(|_| !cell.controller.declared).map(|effect| {
            let message = format!(
                "the cell corrects `{}` and does not say what the controller corrects by itself: nothing is assumed",
                effect.kind()
            );
            Diagnostic::error("cell.controller", &self.cell.name, message)
                .severity(deflex::text::Severity::Note)
                .help("add `[controller] compensates = []`, or name \"gravity\" or \"geometry\"")
        });
        examples_left(&self.cell.source).into_iter().chain(silent).collect()
    }
}

/// One program, done.
pub(super) struct Done {
    /// What it wrote, staged.
    pub(super) outputs: Outputs,
    /// For the `--report` of all programs; `None` where none is wanted, or it is staged already.
    pub(super) rows: Option<Rows>,
    pub(super) summary: FileSummary,
    pub(super) line: String,
    pub(super) notes: Vec<Diagnostic>,
    /// For `--html`.
    pub(super) path: Option<PathTrace>,
}

impl Done {
    fn new(
        name: &str,
        program: &Program,
        corrected: Corrected,
        outputs: Outputs,
        mut path: Option<PathTrace>,
    ) -> Result<Self, Vec<Diagnostic>> {
        if !corrected.failures.is_empty() {
            return Err(corrected.failures);
        }
        let summary = FileSummary::new(name, program, &corrected);
        let line = report::line(&summary, corrected.rewritten.is_some() || !corrected.posted.is_empty());
        if let Some(path) = &mut path {
            path.extend(&corrected.rows);
            path.quote(|target, _| program.line_of(target));
        }
        let rows = Some(Rows::new(program, &corrected.rows));
        Ok(Self { outputs, rows, summary, line, notes: corrected.notes, path })
    }

    /// A program that was predicted a piece at a time.
    fn streamed(name: &str, foreseen: Foreseen) -> Result<Self, Vec<Diagnostic>> {
        let Foreseen { streamed, outputs, rows, path, .. } = foreseen;
        if !streamed.failures.is_empty() {
            return Err(streamed.failures);
        }
        let summary = FileSummary::of(name, &streamed.summary, &[]);
        let line = report::line(&summary, false);
        Ok(Self { outputs, rows, summary, line, notes: streamed.notes, path })
    }
}

/// Runs every program; all that fail are told.
pub(super) fn each<T: Send>(
    jobs: Vec<Job>,
    quiet: bool,
    one: impl Fn(Job, &ProgressBar) -> Result<T, Vec<Diagnostic>> + Sync,
) -> Result<Vec<T>, Vec<Diagnostic>> {
    let bar = progress::bar(jobs.len(), quiet);
    let done: Vec<_> = jobs
        .into_par_iter()
        .map(|job| {
            bar.set_message(job.name.clone());
            let done = one(job, &bar);
            bar.inc(1);
            done
        })
        .collect();
    bar.finish_and_clear();
    input::all(done)
}

/// Gathers what the programs came to, writes it, and says so.
fn finish(
    mut outputs: Outputs,
    setup: &Setup,
    kind: PathKind,
    done: Vec<Done>,
    reports: &Reports,
    quiet: bool,
) -> Outcome {
    let mut notes = setup.notes();
    let (mut rows, mut summaries, mut lines, mut paths) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for program in done {
        outputs.append(program.outputs)?;
        notes.extend(program.notes.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
        rows.extend(program.rows);
        paths.extend(program.path.map(|path| (program.summary.clone(), path)));
        summaries.push(program.summary);
        lines.push(program.line);
    }
    if let Some(path) = reports.report.as_ref().filter(|_| !rows.is_empty()) {
        report::joined(&mut outputs, path, &rows)?;
    }
    if let Some(path) = &reports.json {
        report::json(&mut outputs, path, &summaries)?;
    }
    if let Some(path) = &reports.html {
        let page = PathPage { kind, cell: &setup.cell.name, programs: &paths };
        outputs.add_report(path, page.html().as_bytes())?;
    }
    outputs.commit()?;
    message::print(&setup.cell.own(notes), quiet);
    if !quiet {
        message::say(&lines);
    }
    Ok(Answer::Yes)
}

pub(super) fn run_compensate(args: &Compensate) -> Outcome {
    let setup = Setup::read(&args.model, Context::read(&args.reading)?, args.correct, &args.reports);
    let piped = Piped::new(&args.inputs)?;
    let jobs = stream::jobs(piped.as_ref(), &args.inputs, args.reading.format);
    let (mut setup, jobs) = both(setup, jobs)?;
    setup.options.subdivide = args.subdivide.map(|mm| 1e-3 * mm);
    setup.options.allow_clones = args.allow_clones;
    one_stdout(args, &jobs)?;
    let outputs = outputs(args, &jobs);
    let batch = Batch {
        args,
        setup: &setup,
        outputs: &outputs,
        path: args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Compensate, jobs.len())),
        programs: jobs.len(),
    };
    let done = each(jobs, args.common.quiet, |job, bar| match stream::compensate(&batch, &job, bar)? {
        Some(done) => Ok(done),
        None => batch.whole(job),
    })?;
    finish(outputs, &setup, PathKind::Compensate, done, &args.reports, args.common.quiet)
}

/// What all programs of a `compensate` have in common.
pub(super) struct Batch<'a> {
    pub(super) args: &'a Compensate,
    pub(super) setup: &'a Setup,
    /// What none may write over.
    pub(super) outputs: &'a Outputs,
    /// An empty path, for `--html`.
    pub(super) path: Option<PathTrace>,
    /// How many they are.
    pub(super) programs: usize,
}

impl Batch<'_> {
    /// Corrects a program that is held whole.
    fn whole(&self, job: Job) -> Result<Done, Vec<Diagnostic>> {
        let (args, setup) = (self.args, self.setup);
        let (name, files, companions) = (job.name.clone(), job.files.clone(), job.companions.clone());
        let program = setup.program(job)?;
        let corrected = compensate(&program, &setup.cell.cell, &setup.options).map_err(|e| setup.cell.own(e))?;
        if !corrected.failures.is_empty() {
            return Err(corrected.failures);
        }
        let mut outputs = self.outputs.sibling();
        let mut notes = Vec::new();
        let written = match program.language {
            Language::Rapid => edited(&program, &corrected, &files),
            Language::Cl => {
                let options = post_options(args, &files[0]);
                let posted = correct::post(&program, &setup.cell.cell, &corrected, &options)?;
                notes = posted.notes;
                posted.files.into_iter().map(|(name, bytes)| (PathBuf::from(name), bytes)).collect()
            }
        };
        let stem = written.first().map_or_else(PathBuf::new, |(file, _)| file.clone());
        place(args, &mut outputs, written.into_iter().chain(companions))?;
        let mut done = Done::new(&name, &program, corrected, outputs, self.path.clone())?;
        done.notes.extend(notes);
        if let (Some(path), Some(rows)) = (report_beside(args, &stem), &done.rows) {
            let mut file = done.outputs.open_report(&path)?;
            rows.write(&mut file).and_then(|()| file.flush()).map_err(|error| cannot_write(&path, &error))?;
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

/// Where a program's report goes that no `--report` names: beside the program, unless that goes to stdout.
pub(super) fn report_beside(args: &Compensate, file: &Path) -> Option<PathBuf> {
    match (&args.out_dir, &args.output) {
        (Some(dir), _) => Some(dir.join(file.with_extension("report.csv"))),
        (None, Some(output)) if args.reports.report.is_none() && !is_stdout(output) => {
            Some(output.with_extension("report.csv"))
        }
        _ => None,
    }
}

/// Outputs that take no input's place.
fn outputs(args: &Compensate, jobs: &[Job]) -> Outputs {
    let read = args.inputs.iter().chain(&args.reading.context).chain([&args.model.cell]).chain(&args.model.forces);
    let listed: Vec<PathBuf> = jobs.iter().flat_map(|job| &job.texts).map(|text| PathBuf::from(text.name())).collect();
    Outputs::new(read.chain(&listed))
}

/// Bytes of each corrected source.
fn edited(program: &Program, corrected: &Corrected, files: &[PathBuf]) -> Vec<(PathBuf, Vec<u8>)> {
    let none = Vec::new();
    let edits = corrected.rewritten.as_ref().map_or(&[][..], |rewritten| &rewritten.edits[..]);
    let write = |(i, (source, file)): (usize, (&deflex::text::Source, &PathBuf))| {
        let mut bytes = Vec::with_capacity(source.bytes.len());
        // Writing to a Vec cannot fail.
        let _ = apply(&source.bytes, edits.get(i).unwrap_or(&none), &mut bytes);
        (file.clone(), bytes)
    };
    program.sources.iter().take(program.written).zip(files).enumerate().map(write).collect()
}

/// What the RAPID program made of CL input has that CL data do not say.
pub(super) fn post_options(args: &Compensate, file: &Path) -> PostOptions {
    let named = args.output.as_deref().filter(|path| !is_stdout(path)).unwrap_or(file);
    let stem = named.file_stem().unwrap_or(named.as_os_str()).to_string_lossy().into_owned();
    PostOptions {
        name: if stem == "-" { "program".to_owned() } else { stem },
        title: vec![format!("posted by deflex {} from {}", env!("CARGO_PKG_VERSION"), file.display())],
        max_targets: args.max_targets.map(|most| most as usize),
        rapid_mm_s: args.rapid_speed,
        feed_mm_s: args.feed,
    }
}

/// Puts the files of one program where they belong.
fn place(
    args: &Compensate,
    outputs: &mut Outputs,
    written: impl Iterator<Item = (PathBuf, Vec<u8>)>,
) -> Result<(), Vec<Diagnostic>> {
    let written: Vec<_> = written.collect();
    in_one_file(args, written.len())?;
    for (file, bytes) in &written {
        match &args.out_dir {
            Some(dir) => outputs.add(&dir.join(file), bytes)?,
            None => outputs.add(args.output.as_deref().unwrap_or(Path::new("-")), bytes)?,
        }
    }
    Ok(())
}

/// A program of several files needs a folder.
pub(super) fn in_one_file(args: &Compensate, files: usize) -> Result<(), Vec<Diagnostic>> {
    if args.out_dir.is_none() && files > 1 {
        let message = format!("the program is written as {files} files, which need a folder");
        return Err(vec![Diagnostic::error("usage.out-dir", "", message).help("give --out-dir DIR")]);
    }
    Ok(())
}

/// Only one thing goes to stdout, and several programs go to a folder.
fn one_stdout(args: &Compensate, jobs: &[Job]) -> Result<(), Vec<Diagnostic>> {
    if args.out_dir.is_none() && (jobs.len() > 1 || jobs.iter().any(|job| job.texts.len() > 1)) {
        let message = format!("{} inputs are several files, which need a folder", args.inputs.len());
        return Err(vec![Diagnostic::error("usage.out-dir", "", message).help("give --out-dir DIR")]);
    }
    let program = args.out_dir.is_none() && args.output.as_deref().is_none_or(is_stdout);
    one_thing(usize::from(program) + args.reports.to_stdout())
}

/// Stdout carries one result.
pub(super) fn one_thing(count: usize) -> Result<(), Vec<Diagnostic>> {
    if count > 1 {
        let message = "more than one result would go to stdout";
        return Err(vec![
            Diagnostic::error("usage.stdout", "", message).help("give -o, --report, --json or --html a file"),
        ]);
    }
    Ok(())
}

pub(super) fn run_predict(args: &Predict) -> Outcome {
    let setup = Setup::read(&args.model, Context::read(&args.reading)?, args.correct, &args.reports);
    let piped = Piped::new(&args.inputs)?;
    let (setup, jobs) = both(setup, stream::jobs(piped.as_ref(), &args.inputs, args.reading.format))?;
    let mut reports = args.reports.clone();
    if reports.report.is_none() && reports.to_stdout() == 0 {
        reports.report = Some(PathBuf::from("-"));
    }
    one_thing(reports.to_stdout())?;
    let originals = Originals::new(args.against.as_deref(), &jobs, args.reading.format)?;
    let read = args.inputs.iter().chain(&args.reading.context).chain([&args.model.cell]).chain(&args.model.forces);
    let outputs = Outputs::new(read.chain(&args.against));
    let batch = foresee::Batch {
        setup: &setup,
        originals: &originals,
        outputs: &outputs,
        report: reports.report.as_deref(),
        path: args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Predict, jobs.len())),
        programs: jobs.len(),
    };
    let done = each(jobs, args.common.quiet, |job, bar| match foresee::streamed(&batch, &job, bar, None)? {
        Some(foreseen) => Done::streamed(&job.name, foreseen),
        None => batch.predicted(job),
    })?;
    finish(outputs, &setup, PathKind::Predict, done, &reports, args.common.quiet)
}

impl foresee::Batch<'_> {
    /// Predicts what becomes of a program that is held whole.
    fn predicted(&self, job: Job) -> Result<Done, Vec<Diagnostic>> {
        let (name, setup) = (job.name.clone(), self.setup);
        let original = self.originals.of(&job, setup)?;
        let program = setup.program(job)?;
        let predicted = predict(&program, &setup.cell.cell, &setup.options, original.as_ref());
        let predicted = predicted.map_err(|e| setup.cell.own(e))?;
        let mut done = Done::new(&name, &program, predicted, self.outputs.sibling(), self.path.clone())?;
        done.rows = self.rows(done.rows)?;
        Ok(done)
    }

    /// Rows as the run's report needs them.
    pub(super) fn rows(&self, rows: Option<Rows>) -> Result<Option<Rows>, Vec<Diagnostic>> {
        let (Some(mut rows), Some(path)) = (rows, self.report) else { return Ok(None) };
        if self.programs > 1 {
            rows.spool().map_err(|error| cannot_write(path, &error))?;
        }
        Ok(Some(rows))
    }
}

/// Both values, or the errors of both.
pub(super) fn both<A, B>(
    a: Result<A, Vec<Diagnostic>>,
    b: Result<B, Vec<Diagnostic>>,
) -> Result<(A, B), Vec<Diagnostic>> {
    match (a, b) {
        (Ok(a), Ok(b)) => Ok((a, b)),
        (a, b) => Err([a.err(), b.err()].into_iter().flatten().flatten().collect()),
    }
}

/// `--against`: one original, or a folder with an original of each program's name.
pub(super) struct Originals<'a> {
    against: Option<&'a Path>,
    format: Option<super::args::Format>,
}

impl<'a> Originals<'a> {
    pub(super) fn new(
        against: Option<&'a Path>,
        jobs: &[Job],
        format: Option<super::args::Format>,
    ) -> Result<Self, Vec<Diagnostic>> {
        if against.is_some_and(|path| !path.is_dir()) && jobs.len() > 1 {
            let message = "--against is one program, but there are several inputs";
            let help = "give the folder of originals, with the same file names";
            return Err(vec![Diagnostic::error("usage.against", "", message).help(help)]);
        }
        Ok(Self { against, format })
    }

    /// The original of a program.
    pub(super) fn of(&self, job: &Job, setup: &Setup) -> Result<Option<Program>, Vec<Diagnostic>> {
        self.job(job)?.map(|original| setup.program(original)).transpose()
    }

    /// The same, not yet parsed.
    pub(super) fn job(&self, job: &Job) -> Result<Option<Job>, Vec<Diagnostic>> {
        let Some(path) = self.against else { return Ok(None) };
        if path.is_dir() {
            let files: Vec<PathBuf> = job.files.iter().map(|file| path.join(file)).collect();
            return Ok(input::jobs(&files, self.format)?.into_iter().next());
        }
        input::job(path, self.format).map(Some)
    }
}
