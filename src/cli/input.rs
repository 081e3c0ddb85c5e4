//! Files to ready objects: programs, cells, tables.

use super::args::{Format, Reading};
use deflex::cell::Cell;
use deflex::correct::Forces;
use deflex::measured::{Rows, Table, TargetRef};
use deflex::program::cl::{self, ClOptions, Units};
use deflex::program::{Language, ModuleNames, Program, detect, group_modules, rapid};
use deflex::text::{Diagnostic, Source, Span};
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// Files that are one program, not yet parsed.
#[derive(Clone, Debug)]
pub(super) struct Job {
    /// Name for messages and reports: the files as the user typed them.
    pub(super) name: String,
    /// Texts that are corrected.
    pub(super) texts: Vec<Text>,
    /// Names of the sources in an output folder.
    pub(super) files: Vec<PathBuf>,
    /// What else belongs into the output folder, as it is: the `.pgf` list.
    pub(super) companions: Vec<(PathBuf, Vec<u8>)>,
    /// Language of all sources.
    pub(super) language: Language,
    /// Whether the program comes from a list: it is one even if its modules do not use each other.
    listed: bool,
}

/// The text of a program: a long file is read when its turn comes, so that a batch is never held as a whole.
#[derive(Clone, Debug)]
pub(super) enum Text {
    Held(Source),
    File {
        /// As the user typed it.
        name: String,
        path: PathBuf,
    },
}

/// Files up to this are read at once; as much of longer ones tells their language.
const HEAD: u64 = 64 * 1024;

impl Text {
    fn of(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        let long = |metadata: std::fs::Metadata| metadata.is_file() && metadata.len() > HEAD;
        if std::fs::metadata(path).is_ok_and(long) {
            return Ok(Self::File { name: path.display().to_string(), path: path.to_owned() });
        }
        source(path).map(Self::Held)
    }

    pub(super) fn name(&self) -> &str {
        match self {
            Self::Held(source) => &source.name,
            Self::File { name, .. } => name,
        }
    }

    pub(super) fn read(self) -> Result<Source, Vec<Diagnostic>> {
        match self {
            Self::Held(source) => Ok(source),
            Self::File { name, path } => {
                let bytes = std::fs::read(path).map_err(|error| cannot_read(&name, &error))?;
                Ok(Source::new(name, bytes))
            }
        }
    }

    /// The bytes that tell the language.
    fn head(&self) -> Result<Vec<u8>, Vec<Diagnostic>> {
        match self {
            Self::Held(source) => Ok(source.bytes.clone()),
            Self::File { name, path } => {
                let mut head = Vec::new();
                let read = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
                read.map(|_| head).map_err(|error| cannot_read(name, &error))
            }
        }
    }

    fn names(&self) -> Result<ModuleNames, Vec<Diagnostic>> {
        let names = match self {
            Self::Held(source) => ModuleNames::read(&source.bytes[..]),
            Self::File { path, .. } => File::open(path).and_then(|file| ModuleNames::read(BufReader::new(file))),
        };
        names.map_err(|error| cannot_read(self.name(), &error))
    }
}

pub(super) fn cannot_read(name: &str, error: &std::io::Error) -> Vec<Diagnostic> {
    let folder = Path::new(name).is_dir();
    let help = if folder { "give the files in it, for example FOLDER/*.mod" } else { "check the path" };
    Diagnostic::error("io.read", name, format!("cannot be read: {error}")).help(help).into()
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
    read.map(|bytes| Source::new(name.clone(), bytes)).map_err(|error| cannot_read(&name, &error))
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

/// Looks into inputs and finds out which belong to one program.
pub(super) fn jobs(inputs: &[PathBuf], format: Option<Format>) -> Result<Vec<Job>, Vec<Diagnostic>> {
    let jobs = all(inputs.iter().map(|path| job(path, format)))?;
    if jobs.len() == 1 {
        return Ok(jobs);
    }
    let is_single = |job: &Job| job.language == Language::Rapid && !job.listed;
    let (modules, others): (Vec<_>, Vec<_>) = jobs.into_iter().enumerate().partition(|(_, job)| is_single(job));
    let names = all(modules.par_iter().map(|(_, job)| job.texts[0].names()).collect::<Vec<_>>())?;
    let mut out = others;
    for group in group_modules(&names) {
        let mut members = group.into_iter().map(|i| modules[i].clone());
        let Some((place, mut job)) = members.next() else { continue };
        for (_, more) in members {
            job.name = format!("{} + {}", job.name, more.name);
            job.texts.extend(more.texts);
            job.files.extend(more.files);
        }
        out.push((place, job));
    }
    out.sort_by_key(|(place, _)| *place);
    Ok(out.into_iter().map(|(_, job)| job).collect())
}

/// Looks into one input.
pub(super) fn job(path: &Path, format: Option<Format>) -> Result<Job, Vec<Diagnostic>> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pgf")) {
        return listed(path);
    }
    job_of(Text::of(path)?, path, format)
}

/// One input whose text is at hand.
pub(super) fn job_of(text: Text, path: &Path, format: Option<Format>) -> Result<Job, Vec<Diagnostic>> {
    let head = text.head()?;
    let unknown = || unknown_language(&Source::new(text.name(), head.clone()));
    if head.iter().all(u8::is_ascii_whitespace) {
        return Err(unknown());
    }
    let language = match format {
        Some(Format::Rapid) => Language::Rapid,
        Some(Format::Cl) => Language::Cl,
        None => detect(text.name(), &head).ok_or_else(unknown)?,
    };
    let file = PathBuf::from(path.file_name().unwrap_or(path.as_os_str()));
    Ok(Job {
        name: text.name().to_owned(),
        texts: vec![text],
        files: vec![file],
        companions: Vec::new(),
        language,
        listed: false,
    })
}

fn unknown_language(head: &Source) -> Vec<Diagnostic> {
    let what = if head.bytes.iter().all(u8::is_ascii_whitespace) {
        "the file is empty"
    } else {
        "neither RAPID nor CL/APT was recognised"
    };
    Diagnostic::error("program.language", "", format!("{what}: expected a RAPID MODULE or GOTO/ records"))
        .at(head, Span::new(0, 0))
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
        texts: all(paths.iter().map(|path| Text::of(path)))?,
        files,
        companions: vec![(PathBuf::from(path.file_name().unwrap_or(path.as_os_str())), list.bytes)],
        language: Language::Rapid,
        listed: true,
    })
}

/// How CL is read where no cell says it: only what is independent of it is asked for then.
fn without_cell() -> ClOptions {
    ClOptions { units: Some(Units::Millimetre), ..ClOptions::default() }
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
    let (name, sources) = (job.name, all(job.texts.into_iter().map(Text::read))?);
    let program = match (job.language, options) {
        (Language::Cl, Some(options)) => sources.into_iter().map(|source| cl::read(source, options)).next(),
        // Without a cell nothing is written: a file that is cut off may be looked at.
        (_, Some(_)) => Some(rapid::look(sources, reading.sources.clone())),
        (_, None) => Some(rapid::read(sources, reading.sources.clone())),
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

    pub(super) fn sources(&self) -> &[Source] {
        &self.sources
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

/// Rows of a table of forces in its file: which target each names, and its line.
#[derive(Debug)]
pub(super) struct ForceFile {
    file: String,
    /// As many as the program has targets.
    ordinals: Vec<(u32, u32)>,
    names: Vec<(String, u32)>,
}

impl ForceFile {
    /// What the table says of targets, and what is needed to tell whether it is a program's own.
    pub(super) fn read(path: &Path) -> Result<(Self, Forces), Vec<Diagnostic>> {
        let file = path.display().to_string();
        let input: Box<dyn Read> = if file == "-" {
            Box::new(std::io::stdin().lock())
        } else {
            Box::new(File::open(path).map_err(|error| cannot_read(&file, &error))?)
        };
        let (mut errors, mut ordinals, mut names) = (Vec::new(), Vec::new(), Vec::new());
        let forces = Rows::new(&file, input)?.filter_map(|row| match row {
            Ok(row) => {
                let line = u32::try_from(row.line).unwrap_or(u32::MAX);
                match row.target.as_ref()? {
                    TargetRef::Ordinal(ordinal) => ordinals.push((*ordinal, line)),
                    TargetRef::Name(name) => names.push((name.clone(), line)),
                    _ => return None,
                }
                let force = row.force();
                Some((row.target?, force))
            }
            Err(error) => {
                errors.push(error);
                None
            }
        });
        let forces: Forces = forces.collect();
        if errors.is_empty() && ordinals.is_empty() && names.is_empty() {
            let message = "no row names a target: expected a column `target` with ordinals or names";
            errors.push(Diagnostic::error("forces.target", &file, message).help("number the motion targets from 1"));
        }
        if errors.is_empty() { Ok((Self { file, ordinals, names }, forces)) } else { Err(errors) }
    }

    /// Rows that belong to no target of a program: the table is another program's.
    pub(super) fn check(&self, program: &Program) -> Result<(), Vec<Diagnostic>> {
        let last = program.targets.last().map_or(0, |target| target.ordinal);
        self.check_targets(last, |name| {
            program.targets.iter().any(|t| t.name.as_ref().is_some_and(|known| known.eq_ignore_ascii_case(name)))
        })
    }

    /// The same for a program with this last target, and targets of these names.
    pub(super) fn check_targets(&self, last: u32, named: impl Fn(&str) -> bool) -> Result<(), Vec<Diagnostic>> {
        const MOST: usize = 10; // a wrong table is wrong in every row
        let wrong = |line: u32, message: String| {
            let mut diagnostic = Diagnostic::error("forces.target", &self.file, message)
                .help("targets are counted from 1 in the order they run, or named as declared");
            (diagnostic.line, diagnostic.column) = (line as usize, 1);
            diagnostic
        };
        let ordinals = self.ordinals.iter().filter(|(ordinal, _)| *ordinal > last).take(MOST).map(|(ordinal, line)| {
            wrong(*line, format!("target {ordinal} is not in the program, which has {last} motion targets"))
        });
        let names = self.names.iter().filter(|(name, _)| !named(name)).take(MOST);
        let names = names.map(|(name, line)| wrong(*line, format!("target `{name}` is not in the program")));
        let mut wrong: Vec<Diagnostic> = ordinals.chain(names).collect();
        wrong.sort_by_key(|diagnostic| diagnostic.line);
        wrong.truncate(MOST);
        if wrong.is_empty() { Ok(()) } else { Err(wrong) }
    }
}

/// Reads a measured table.
pub(super) fn table(path: &Path) -> Result<Table, Vec<Diagnostic>> {
    Table::read(&source(path)?)
}
