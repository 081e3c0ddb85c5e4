//! Parses files into programs, cells and tables.

use super::context::Context;
use super::job::Job;
use super::read::{self, all, source};
use super::text::Text;
use deflex::cell::Cell;
use deflex::program::cl::{ClOptions, Units};
use deflex::program::jbi::take_speeds_in;
use deflex::program::{Language, ModuleNames, Program, ReadOptions, detect, read};
use deflex::report::Origin;
use deflex::text::{Diagnostic, Severity, Source};
use std::hash::{Hash, Hasher};
use std::path::Path;

/// How CL data are read without a cell: only for results that depend on neither units nor tools.
fn without_cell() -> ClOptions {
    ClOptions { units: Some(Units::Millimetre), any_tool: true, ..ClOptions::default() }
}

/// Parses a program for a run with a cell.
pub(crate) fn program(
    job: Job,
    reading: &Context,
    cell: &CellFile,
    tool: Option<&str>,
) -> Result<Program, Vec<Diagnostic>> {
    let context = reading.with(&job.context, job.language, Some(&cell.cell))?.into_owned();
    if job.language.is_edited() {
        let mut program = parse(job, context, &ReadOptions { cl: &ClOptions::default(), look: false })?;
        take_speeds_in(&mut program, cell.cell.controller.speed_unit);
        return Ok(program);
    }
    let Some(options) = cell.cl_options(tool) else {
        let message =
            format!("[cl] is missing: {} is CL data, whose tool, work object and spin only the cell knows", job.name);
        return Err(Diagnostic::error("cell.no-cl", &cell.name, message)
            .help("add [cl] with tool, wobj, units, point and spin")
            .into());
    };
    parse(job, context, &ReadOptions { cl: &options, look: false })
}

/// Parses a program without a cell: `inspect` and `diff` write no program.
pub(crate) fn program_alone(job: Job, reading: &Context) -> Result<Program, Vec<Diagnostic>> {
    let context = reading.with(&job.context, job.language, None)?.into_owned();
    parse(job, context, &ReadOptions { cl: &without_cell(), look: true })
}

fn parse(job: Job, context: Vec<Source>, options: &ReadOptions<'_>) -> Result<Program, Vec<Diagnostic>> {
    let (name, sources) = (job.name, all(job.texts.into_iter().map(Text::read))?);
    let caller = job.caller.or_else(|| caller_among(&context, job.language, sources.first()?));
    let called = caller.map(|caller| called_alone(&sources[0].name, &caller));
    let refused = || vec![Diagnostic::error("program.refused", &name, "the program cannot be read")];
    let read = read(job.language, sources, context, options);
    let mut program = read.map_err(|errors| if errors.is_empty() { refused() } else { errors })?;
    program.diagnostics.extend(called);
    Ok(program)
}

/// The name of a file that calls the program of another file.
fn caller_among(context: &[Source], language: Language, called: &Source) -> Option<String> {
    let names = |source: &Source| {
        let mut names = ModuleNames::new(language);
        names.read(&source.bytes[..]).ok().map(|()| names)
    };
    let own = names(called)?;
    let caller = context.iter().find(|source| names(source).is_some_and(|names| names.calls(&own)))?;
    Some(caller.name.clone())
}

/// The warning about a program that is read as one of its own, although another one calls it.
fn called_alone(name: &str, caller: &str) -> Diagnostic {
    let message = format!(
        "{caller} calls it: the program is corrected as if it started alone, with the frames of the cell and without what the caller sets before"
    );
    let help = "if the caller changes frames, tools, shifts, speeds or registers that this program uses, set them in this program, or declare \
                them in the cell as they are at the call";
    Diagnostic::error("program.called-alone", name, message).severity(Severity::Warning).help(help)
}

/// Parses a corrected text again, for the round trip of `inspect`.
pub(crate) fn reread(
    language: Language,
    written: Vec<Source>,
    context: Vec<Source>,
) -> Result<Program, Vec<Diagnostic>> {
    read(language, written, context, &ReadOptions { cl: &without_cell(), look: true })
}

/// A cell, and the file from which it was read.
///
/// # Examples
/// ```
/// use deflex::session::CellFile;
///
/// let cell = CellFile::read("samples/slot/cell.toml".as_ref())?;
/// assert!(cell.cell().arm.robot.model.starts_with("irb6660"));
/// assert_eq!(cell, CellFile::parse(cell.source().clone())?);
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Debug)]
pub struct CellFile {
    /// Path as the user typed it.
    pub(crate) name: String,
    /// Text of the file.
    pub(crate) source: Source,
    /// The checked cell.
    pub(crate) cell: Cell,
}

/// Two cell files are equal if their names and texts are.
impl PartialEq for CellFile {
    fn eq(&self, other: &Self) -> bool {
        (&self.source.name, &self.source.bytes) == (&other.source.name, &other.source.bytes)
    }
}

impl Eq for CellFile {}

impl Hash for CellFile {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (&self.source.name, &self.source.bytes).hash(state);
    }
}

impl CellFile {
    /// Reads and checks the cell file at a path; `-` is stdin.
    ///
    /// # Errors
    /// The file cannot be read, or is not a valid cell: see [`Cell::read`].
    pub fn read(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        Self::parse(source(path)?)
    }

    /// Checks the text of a cell file, and reads the meshes that it names. Their paths are relative to the cell file.
    ///
    /// # Errors
    /// The text is not a valid cell (see [`Cell::read`]), or a mesh cannot be read or is not a closed solid.
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
        cell.take_meshes(|name| read::source(&folder.join(name)))?;
        Ok(Self { name: source.name.clone(), cell, source })
    }

    /// The checked cell.
    #[must_use]
    pub fn cell(&self) -> &Cell {
        &self.cell
    }

    /// Text of the cell file.
    #[must_use]
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Name and hash of the file, which results made from it state.
    pub(crate) fn origin(&self) -> Origin {
        Origin::of(&self.name, &self.source.bytes)
    }

    /// How CL data are read, with the tool that `--tool` names; `None` if the cell has no `[cl]` table.
    pub(crate) fn cl_options(&self, tool: Option<&str>) -> Option<ClOptions> {
        let mut options = self.cell.cl.as_ref()?.options.clone();
        if let Some(tool) = tool {
            options.tool = Some(tool.to_owned());
            options.any_tool = true;
        }
        Some(options)
    }

    /// Adds the name of the cell file to messages that lack it.
    pub(crate) fn own(&self, diagnostics: Vec<Diagnostic>) -> Vec<Diagnostic> {
        own(&self.name, diagnostics)
    }
}

/// Adds the name `name` of a cell file to messages that lack it.
pub(crate) fn own(name: &str, mut diagnostics: Vec<Diagnostic>) -> Vec<Diagnostic> {
    for diagnostic in &mut diagnostics {
        if diagnostic.file.is_empty() && diagnostic.code.starts_with("cell.") {
            name.clone_into(&mut diagnostic.file);
        }
    }
    diagnostics
}
