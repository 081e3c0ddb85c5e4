//! What `compensate`, `predict` and `check` have in common: a cell and options, programs in parallel, and what comes out
//! in order.

use super::args::{Corrected as What, Model, Reports};
use super::forces::ForceFile;
use super::foresee::Foreseen;
use super::input::{self, CellFile, Context, both};
use super::job::Job;
use super::output::Outputs;
use super::report::{self, Rows};
use super::{Answer, Outcome, message, progress};
use deflex::cell::examples_left;
use deflex::correct::{Correct, Corrected, Options};
use deflex::program::Program;
use deflex::report::FileSummary;
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::text::Diagnostic;
use indicatif::ProgressBar;
use rayon::prelude::*;

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
        let forces = model.forces.as_deref().map(ForceFile::read).transpose();
        let (cell, forces) = both(CellFile::read(&model.cell), forces)?;
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
    pub(super) fn new(
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
    pub(super) fn streamed(name: &str, foreseen: Foreseen) -> Result<Self, Vec<Diagnostic>> {
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
pub(super) fn finish(
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
