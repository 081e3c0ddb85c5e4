//! Files to ready objects: programs, cells, tables.

use super::args::{Format, Reading};
use deflex::cell::Cell;
use deflex::correct::Forces;
use deflex::measured::{Table, TargetRef};
use deflex::program::cl::{self, ClOptions, Point, Units};
use deflex::program::{Language, Program, detect, group_modules, rapid};
use deflex::text::{Diagnostic, Source, Span};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Files that are one program, read and not yet parsed.
#[derive(Clone, Debug)]
pub(super) struct Job {
    /// Name for messages and reports: the files as the user typed them.
    pub(super) name: String,
    /// Sources that are corrected.
    pub(super) sources: Vec<Source>,
    /// Names of the sources in an output folder.
    pub(super) files: Vec<PathBuf>,
    /// What else belongs into the output folder, as it is: the `.pgf` list.
    pub(super) companions: Vec<(PathBuf, Vec<u8>)>,
    /// Language of all sources.
    pub(super) language: Language,
    /// Whether the program comes from a list: it is one even if its modules do not use each other.
    listed: bool,
}

/// Reads one file, `-` being stdin.
pub(super) fn source(path: &Path) -> Result<Source, Vec<Diagnostic>> {
    let name = path.display().to_string();
    let read = if name == "-" {
        let mut bytes = Vec::new();
        std::io::stdin().lock().read_to_end(&mut bytes).map(|_| bytes)
    } else {
        std::fs::read(path)
    };
    read.map(|bytes| Source::new(name.clone(), bytes)).map_err(|error| {
        let help = if path.is_dir() { "give the files in it, for example FOLDER/*.mod" } else { "check the path" };
        Diagnostic::error("io.read", &name, format!("cannot be read: {error}")).help(help).into()
    })
}

/// Reads every file; all that cannot be read are named.
pub(super) fn sources(paths: &[PathBuf]) -> Result<Vec<Source>, Vec<Diagnostic>> {
    all(paths.iter().map(|path| source(path)))
}

/// Every value, or every error.
pub(super) fn all<T>(results: impl IntoIterator<Item = Result<T, Vec<Diagnostic>>>) -> Result<Vec<T>, Vec<Diagnostic>> {
    let (mut values, mut errors) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(value) => values.push(value),
            Err(more) => errors.extend(more),
        }
    }
    if errors.is_empty() { Ok(values) } else { Err(errors) }
}

/// Reads inputs and finds out which belong to one program.
pub(super) fn jobs(inputs: &[PathBuf], format: Option<Format>) -> Result<Vec<Job>, Vec<Diagnostic>> {
    let jobs = all(inputs.iter().map(|path| job(path, format)))?;
    if jobs.len() == 1 {
        return Ok(jobs);
    }
    let is_single = |job: &Job| job.language == Language::Rapid && !job.listed;
    let (modules, others): (Vec<_>, Vec<_>) = jobs.into_iter().enumerate().partition(|(_, job)| is_single(job));
    let texts: Vec<Source> = modules.iter().map(|(_, job)| job.sources[0].clone()).collect();
    let mut out = others;
    for group in group_modules(&texts) {
        let mut members = group.into_iter().map(|i| modules[i].clone());
        let Some((place, mut job)) = members.next() else { continue };
        for (_, more) in members {
            job.name = format!("{} + {}", job.name, more.name);
            job.sources.extend(more.sources);
            job.files.extend(more.files);
        }
        out.push((place, job));
    }
    out.sort_by_key(|(place, _)| *place);
    Ok(out.into_iter().map(|(_, job)| job).collect())
}

/// Reads one input.
pub(super) fn job(path: &Path, format: Option<Format>) -> Result<Job, Vec<Diagnostic>> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pgf")) {
        return listed(path);
    }
    job_of(source(path)?, path, format)
}

/// One input that is read already.
pub(super) fn job_of(source: Source, path: &Path, format: Option<Format>) -> Result<Job, Vec<Diagnostic>> {
    if source.bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(unknown_language(&source));
    }
    let language = match format {
        Some(Format::Rapid) => Language::Rapid,
        Some(Format::Cl) => Language::Cl,
        None => detect(&source.name, &source.bytes).ok_or_else(|| unknown_language(&source))?,
    };
    let file = PathBuf::from(path.file_name().unwrap_or(path.as_os_str()));
    Ok(Job {
        name: source.name.clone(),
        sources: vec![source],
        files: vec![file],
        companions: Vec::new(),
        language,
        listed: false,
    })
}

fn unknown_language(source: &Source) -> Vec<Diagnostic> {
    let what = if source.bytes.iter().all(u8::is_ascii_whitespace) {
        "the file is empty"
    } else {
        "neither RAPID nor CL/APT was recognised"
    };
    Diagnostic::error("program.language", &source.name, format!("{what}: expected a RAPID MODULE or GOTO/ records"))
        .at(source, Span::new(0, 0))
        .help("say what it is with --format rapid or --format cl")
        .into()
}

/// A `.pgf`: an XML list of modules, beside it.
fn listed(path: &Path) -> Result<Job, Vec<Diagnostic>> {
    let list = source(path)?;
    let text = String::from_utf8_lossy(&list.bytes);
    let folder = path.parent().unwrap_or(Path::new(""));
    let names = text.split("<Module>").skip(1).filter_map(|rest| rest.split("</Module>").next());
    let files: Vec<PathBuf> = names.map(|name| PathBuf::from(name.trim().replace('\\', "/"))).collect();
    let outside = |file: &PathBuf| {
        file.is_absolute() || file.components().any(|part| matches!(part, std::path::Component::ParentDir))
    };
    if files.is_empty() || files.iter().any(outside) {
        let message = "expected a list of <Module>NAME.mod</Module> beside the .pgf";
        return Err(vec![
            Diagnostic::error("program.pgf", &list.name, message).help("give the modules themselves instead"),
        ]);
    }
    let paths: Vec<PathBuf> = files.iter().map(|file| folder.join(file)).collect();
    let missing: Vec<String> = paths
        .iter()
        .zip(&files)
        .filter(|(path, _)| !path.is_file())
        .map(|(_, file)| file.display().to_string())
        .collect();
    if !missing.is_empty() {
        let message = format!("the list names modules that are not beside it: {}", missing.join(", "));
        return Err(vec![
            Diagnostic::error("program.pgf", &list.name, message)
                .help("copy them there, or give the modules themselves"),
        ]);
    }
    Ok(Job {
        name: list.name.clone(),
        sources: sources(&paths)?,
        files,
        companions: vec![(PathBuf::from(path.file_name().unwrap_or(path.as_os_str())), list.bytes)],
        language: Language::Rapid,
        listed: true,
    })
}

/// How CL is read where no cell says it: only what is independent of it is asked for then.
fn without_cell() -> ClOptions {
    ClOptions {
        tool: "tool0".to_owned(),
        wobj: "wobj0".to_owned(),
        units: Some(Units::Millimetre),
        point: Point::Tip,
        corner_radius_mm: None,
        arc_tolerance_mm: 0.005,
    }
}

/// Parses a program for a run with a cell.
pub(super) fn program(
    job: Job,
    reading: &Context,
    cell: &CellFile,
    tool: Option<&str>,
) -> Result<Program, Vec<Diagnostic>> {
    if job.language == Language::Rapid {
        return parse(job, reading, None);
    }
    let Some(options) = cell.cl_options(tool) else {
        let message =
            format!("[cl] is missing: {} is CL data, whose tool, work object and spin only the cell knows", job.name);
        return Err(vec![
            Diagnostic::error("cell.no-cl", &cell.name, message)
                .help("add [cl] with tool, wobj, units, point and spin"),
        ]);
    };
    parse(job, reading, Some(&options))
}

/// Parses a program where no cell is known.
pub(super) fn program_alone(job: Job, reading: &Context) -> Result<Program, Vec<Diagnostic>> {
    parse(job, reading, Some(&without_cell()))
}

fn parse(job: Job, reading: &Context, options: Option<&ClOptions>) -> Result<Program, Vec<Diagnostic>> {
    let name = job.name;
    let program = match (job.language, options) {
        (Language::Cl, Some(options)) => job.sources.into_iter().map(|source| cl::read(source, options)).next(),
        // Without a cell nothing is written: a file that is cut off may be looked at.
        (_, Some(_)) => Some(rapid::look(job.sources, reading.sources.clone())),
        (_, None) => Some(rapid::read(job.sources, reading.sources.clone())),
    };
    let refused = || Diagnostic::error("program.refused", &name, "the program cannot be read");
    match program {
        Some(Err(errors)) if !errors.is_empty() => Err(errors),
        Some(Ok(program)) => Ok(program),
        _ => Err(vec![refused()]),
    }
}

/// Reads a program again, for the round trip of `inspect`.
pub(super) fn reread(
    language: Language,
    mut written: Vec<Source>,
    context: Vec<Source>,
) -> Result<Program, Vec<Diagnostic>> {
    match (language, written.pop()) {
        (Language::Cl, Some(source)) => cl::read(source, &without_cell()),
        (_, last) => {
            written.extend(last);
            rapid::look(written, context)
        }
    }
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
}

/// A cell with the file that it comes from.
#[derive(Debug)]
pub(super) struct CellFile {
    /// As the user typed it.
    pub(super) name: String,
    /// Its text.
    pub(super) source: Source,
    /// Read and checked.
    pub(super) cell: Cell,
}

impl CellFile {
    pub(super) fn read(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        let source = source(path)?;
        let cell = Cell::read(&source).map_err(|errors| match detect("", &source.bytes) {
            Some(_) => {
                Diagnostic::error("cell.syntax", &source.name, "this is a program, where the cell file is expected")
                    .help("give --cell a TOML file; `deflex init --robot MODEL` prints one to start from")
                    .into()
            }
            None => errors,
        })?;
        Ok(Self { name: source.name.clone(), cell, source })
    }

    /// How CL input is read, with a tool given besides; `None` where the cell does not say.
    pub(super) fn cl_options(&self, tool: Option<&str>) -> Option<ClOptions> {
        let mut options = self.cell.cl.as_ref()?.options.clone();
        if let Some(tool) = tool {
            tool.clone_into(&mut options.tool);
        }
        Some(options)
    }

    /// Messages about the cell that do not know its file.
    pub(super) fn own(&self, mut diagnostics: Vec<Diagnostic>) -> Vec<Diagnostic> {
        for diagnostic in &mut diagnostics {
            if diagnostic.file.is_empty() && diagnostic.code.starts_with("cell.") {
                diagnostic.file.clone_from(&self.name);
            }
        }
        diagnostics
    }
}

/// A table of forces with its file.
#[derive(Debug)]
pub(super) struct ForceFile {
    table: Table,
    pub(super) forces: Forces,
}

impl ForceFile {
    pub(super) fn read(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        let table = table(path)?;
        if table.rows.iter().all(|row| row.target.is_none()) {
            let message = "no row names a target: expected a column `target` with ordinals or names";
            return Err(vec![
                Diagnostic::error("forces.target", &table.file, message).help("number the motion targets from 1"),
            ]);
        }
        Ok(Self { forces: table.forces(), table })
    }

    /// Rows that belong to no target of a program: the table is another program's.
    pub(super) fn check(&self, program: &Program) -> Result<(), Vec<Diagnostic>> {
        const MOST: usize = 10; // a wrong table is wrong in every row
        let last = program.targets.last().map_or(0, |target| target.ordinal);
        let named = |name: &str| {
            program.targets.iter().any(|t| t.name.as_ref().is_some_and(|known| known.eq_ignore_ascii_case(name)))
        };
        let wrong = self.table.rows.iter().filter_map(|row| {
            let message = match row.target.as_ref()? {
                TargetRef::Ordinal(ordinal) if *ordinal > last => {
                    format!("target {ordinal} is not in the program, which has {last} motion targets")
                }
                TargetRef::Name(name) if !named(name) => format!("target `{name}` is not in the program"),
                _ => return None,
            };
            let mut diagnostic = Diagnostic::error("forces.target", &self.table.file, message)
                .help("targets are counted from 1 in the order they run, or named as declared");
            (diagnostic.line, diagnostic.column) = (usize::try_from(row.line).unwrap_or(0), 1);
            Some(diagnostic)
        });
        let wrong: Vec<Diagnostic> = wrong.take(MOST).collect();
        if wrong.is_empty() { Ok(()) } else { Err(wrong) }
    }
}

/// Reads a measured table.
pub(super) fn table(path: &Path) -> Result<Table, Vec<Diagnostic>> {
    Table::read(&source(path)?)
}
