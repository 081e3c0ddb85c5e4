//! The settings that all programs of a run share: the cell, forces, context and options.

use super::context::Context;
use super::forces::ForceFile;
use super::input::{self, CellFile};
use super::job::{Job, Long};
use super::read::cannot_write;
use deflex::cell::examples_left;
use deflex::correct::{CutProgress, LoadedPath, Options, StreamError, Streamed, holds_whole, loaded_path};
use deflex::program::Program;
use deflex::program::cl::ClOptions;
use deflex::text::{Diagnostic, cannot_read};
use std::borrow::Cow;
use std::sync::Arc;

/// Cell, forces and options of a run.
#[derive(Clone)]
pub(crate) struct Setup {
    pub(crate) cell: Arc<CellFile>,
    pub(crate) forces: Option<ForceFile>,
    pub(crate) context: Context,
    pub(crate) options: Options,
}

impl Setup {
    /// How CL data are read, with the tool that `--tool` names.
    pub(crate) fn cl_options(&self) -> Option<ClOptions> {
        self.cell.cl_options(self.options.tool.as_deref())
    }

    /// The program as one text that can be read in chunks; `None` if it must be held as a whole.
    pub(crate) fn long<'a>(&'a self, job: &'a Job) -> Option<Long<'a>> {
        if holds_whole(&self.cell.cell) {
            return None;
        }
        job.long(self.context.with(&job.context, job.language, Some(&self.cell.cell)).ok()?, self.cl_options())
    }

    /// The result of a run in chunks; `None` if the program can be understood only as a whole.
    pub(crate) fn through<T>(&self, name: &str, done: Result<T, StreamError>) -> Result<Option<T>, Vec<Diagnostic>> {
        match done {
            Ok(done) => Ok(Some(done)),
            Err(StreamError::NotStreamable) => Ok(None),
            Err(StreamError::Refused(errors)) => Err(self.cell.own(errors)),
            Err(StreamError::Read(error)) => Err(cannot_read(name, &error)),
            Err(StreamError::Write(error)) => Err(cannot_write(&error)),
        }
    }

    /// Refuses forces for targets that a long program does not have.
    pub(crate) fn check_forces(&self, streamed: &Streamed) -> Result<(), Vec<Diagnostic>> {
        let Some(forces) = &self.forces else { return Ok(()) };
        forces.check_targets(streamed.last, |name| streamed.has_target(name))
    }

    /// The options for a program that is held as a whole, which report the progress of the cut if the cell has a stock.
    pub(crate) fn options_followed(&self, cut_progress: Option<CutProgress>) -> Cow<'_, Options> {
        match cut_progress.filter(|_| self.cell.cell.stock.is_some()) {
            Some(cut_progress) => Cow::Owned(Options { cut_progress, ..self.options.clone() }),
            None => Cow::Borrowed(&self.options),
        }
    }

    /// Parses a program and checks that the table of forces belongs to it.
    pub(crate) fn program(&self, job: Job) -> Result<Program, Vec<Diagnostic>> {
        let program = input::program(job, &self.context, &self.cell, self.options.tool.as_deref())?;
        self.forces.as_ref().map_or(Ok(()), |forces| forces.check(&program))?;
        Ok(program)
    }

    /// The path that the controller drives and the loaded arm takes.
    pub(crate) fn driven_path(&self, program: &Program) -> Result<LoadedPath, Vec<Diagnostic>> {
        loaded_path(program, &self.cell.cell, &self.options).map_err(|errors| self.cell.own(errors))
    }

    /// The errors of a run, after warnings about the forces, which are often the cause.
    pub(crate) fn failed(&self, errors: Vec<Diagnostic>) -> Vec<Diagnostic> {
        let doubt = self.forces.iter().flat_map(ForceFile::doubts);
        self.cell.cell.notes.iter().cloned().chain(doubt).chain(errors).collect()
    }

    /// Notes of a run about the cell and the forces.
    pub(crate) fn notes(&self) -> Vec<Diagnostic> {
        let cell = &self.cell.cell;
        let covered = cell.arm.effects.iter().find(|effect| effect.covered_by().is_some());
        let silent = covered.filter(|_| !cell.controller.declared).map(|effect| {
            let message = format!(
                "the cell has the effect `{}`, but does not state which effects the controller compensates: deflex assumes none",
                effect.kind()
            );
            Diagnostic::error("cell.controller", &self.cell.name, message)
                .severity(deflex::text::Severity::Note)
                .help("add `[controller] compensates = []`, or name \"gravity\" or \"geometry\"")
        });
        let doubt = self.forces.iter().flat_map(ForceFile::doubts);
        let notes = examples_left(&self.cell.source).into_iter().chain(silent).chain(doubt);
        notes.chain(cell.notes.iter().cloned()).collect()
    }
}
