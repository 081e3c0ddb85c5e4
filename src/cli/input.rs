//! Files to ready objects: programs, cells, tables.

use super::args::Reading;
use super::files::{self, all, source, sources};
use super::job::Job;
use super::text::Text;
use deflex::cell::Cell;
use deflex::program::cl::{ClOptions, Units};
use deflex::program::{Language, Program, ReadOptions, detect, read};
use deflex::report::Origin;
use deflex::text::{Diagnostic, Source};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// How CL is read where no cell says it: only what does not depend on it is computed then.
fn without_cell() -> ClOptions {
    ClOptions { units: Some(Units::Millimetre), any_tool: true, ..ClOptions::default() }
}

/// Parses a program for a run with a cell.
pub(super) fn program(
    job: Job,
    reading: &Context,
    cell: &CellFile,
    tool: Option<&str>,
) -> Result<Program, Vec<Diagnostic>> {
    let context = reading.knowing(&cell.cell, job.language).into_owned();
    if job.language.is_edited() {
        return parse(job, context, &ReadOptions { cl: &ClOptions::default(), look: false });
    }
    let Some(options) = cell.cl_options(tool) else {
        let message =
            format!("[cl] is missing: {} is CL data, whose tool, work object and spin only the cell knows", job.name);
        return Err(vec![
            Diagnostic::error("cell.no-cl", &cell.name, message)
                .help("add [cl] with tool, wobj, units, point and spin"),
        ]);
    };
    parse(job, context, &ReadOptions { cl: &options, look: false })
}

/// Parses a program where no cell is known: nothing will be written.
pub(super) fn program_alone(job: Job, reading: &Context) -> Result<Program, Vec<Diagnostic>> {
    parse(job, reading.sources.clone(), &ReadOptions { cl: &without_cell(), look: true })
}

fn parse(job: Job, context: Vec<Source>, options: &ReadOptions<'_>) -> Result<Program, Vec<Diagnostic>> {
    let (name, sources) = (job.name, all(job.texts.into_iter().map(Text::read))?);
    let refused = || vec![Diagnostic::error("program.refused", &name, "the program cannot be read")];
    let read = read(job.language, sources, context, options);
    read.map_err(|errors| if errors.is_empty() { refused() } else { errors })
}

/// Reads a program again, for the round trip of `inspect`.
pub(super) fn reread(
    language: Language,
    written: Vec<Source>,
    context: Vec<Source>,
) -> Result<Program, Vec<Diagnostic>> {
    read(language, written, context, &ReadOptions { cl: &without_cell(), look: true })
}

/// Context modules, read once for all programs.
#[derive(Clone, Debug, Default)]
pub(super) struct Context {
    sources: Vec<Source>,
}

impl Context {
    pub(super) fn read(reading: &Reading) -> Result<Self, Vec<Diagnostic>> {
        Self::of(&reading.context)
    }

    pub(super) fn of(paths: &[PathBuf]) -> Result<Self, Vec<Diagnostic>> {
        Ok(Self { sources: sources(paths)? })
    }

    /// As they were given.
    pub(super) fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// With the routines that a cell vouches for.
    pub(super) fn knowing(&self, cell: &Cell, language: Language) -> Cow<'_, [Source]> {
        let more = cell.controller.declarations(language);
        if more.is_empty() { Cow::Borrowed(&self.sources) } else { Cow::Owned([self.sources.clone(), more].concat()) }
    }
}

/// A cell with the file that it comes from.
#[derive(Debug)]
pub struct CellFile {
    /// As the user typed it.
    pub(super) name: String,
    /// Its text.
    pub(super) source: Source,
    /// Read and checked.
    pub(super) cell: Cell,
}

impl CellFile {
    /// Reads and checks the cell file at a path, `-` being stdin.
    ///
    /// # Errors
    /// The file cannot be read, or is no cell: see [`Cell::read`].
    pub fn read(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        Self::parse(source(path)?)
    }

    /// Checks the text of a cell file, and reads the meshes that it names, relative to its path.
    ///
    /// # Errors
    /// It is no cell: see [`Cell::read`]; a mesh cannot be read, or is no solid.
    pub fn parse(source: Source) -> Result<Self, Vec<Diagnostic>> {
        let mut cell = Cell::read(&source).map_err(|errors| match detect("", &source.bytes) {
            Some(_) => {
                Diagnostic::error("cell.syntax", &source.name, "this is a program, where the cell file is expected")
                    .help("give --cell a TOML file; `deflex init --robot MODEL` prints one to start from")
                    .into()
            }
            None => errors,
        })?;
        // Meshes are named relative to the cell file.
        let folder = Path::new(&source.name).parent().unwrap_or(Path::new(""));
        cell.take_meshes(|name| files::source(&folder.join(name)))?;
        Ok(Self { name: source.name.clone(), cell, source })
    }

    /// The cell.
    #[must_use]
    pub fn cell(&self) -> &Cell {
        &self.cell
    }

    /// The text that it was read from.
    #[must_use]
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The file itself, for what is made from it.
    pub(super) fn origin(&self) -> Origin {
        Origin::of(&self.name, &self.source.bytes)
    }

    /// How CL input is read, with a tool given besides; `None` where the cell does not say.
    pub(super) fn cl_options(&self, tool: Option<&str>) -> Option<ClOptions> {
        let mut options = self.cell.cl.as_ref()?.options.clone();
        if let Some(tool) = tool {
            options.tool = Some(tool.to_owned());
            options.any_tool = true;
        }
        Some(options)
    }

    /// Messages about the cell that do not know its file.
    pub(super) fn own(&self, diagnostics: Vec<Diagnostic>) -> Vec<Diagnostic> {
        own(&self.name, diagnostics)
    }
}

/// The same for the cell file of this name.
pub(super) fn own(name: &str, mut diagnostics: Vec<Diagnostic>) -> Vec<Diagnostic> {
    for diagnostic in &mut diagnostics {
        if diagnostic.file.is_empty() && diagnostic.code.starts_with("cell.") {
            name.clone_into(&mut diagnostic.file);
        }
    }
    diagnostics
}
