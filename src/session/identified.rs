use super::{CellFile, ProgramFiles};
use crate::session::input;
use crate::session::read::{all, both};
use crate::session::report::pretty;
use deflex::cell::extended;
use deflex::correct::{Course, Options, Prepared};
use deflex::drive::{DriveError, FittedLaw, Log, LogError, PathLaw, WayOfTurning, Waypoint, arc_turn, fit_law};
use deflex::identify::{self, Identification, Input, MeasuredRun, Progress, Written};
use deflex::measured::{ColumnNames, Forces, Table};
use deflex::program::{ArcTurn, Program, Role};
use deflex::report::html::identification_page;
use deflex::report::{Origin, VERSION};
use deflex::text::{Diagnostic, Source};
use std::path::Path;

/// A measured file, read and not yet parsed.
///
/// # Examples
/// ```
/// use deflex::measured::ColumnNames;
/// use deflex::session::MeasuredFile;
/// use deflex::text::Source;
///
/// let measured = MeasuredFile::read("samples/closed-loop/measured.csv".as_ref())?;
/// let names = ColumnNames::parse("target=Point,normal_mm=Deviation")?;
/// let probed = MeasuredFile::of(Source::new("probe", "Point;Deviation\n1;0,12\n")).read_as(Some(names), 5.0);
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct MeasuredFile {
    source: Source,
    names: Option<ColumnNames>,
    match_mm: Option<f64>,
}

impl MeasuredFile {
    /// Reads the file at a path; `-` is stdin.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        crate::session::read::source(path).map(Self::of)
    }

    /// Uses a table that is already in memory.
    #[must_use]
    pub fn of(table: Source) -> Self {
        Self { source: table, names: None, match_mm: None }
    }

    /// Sets the names of the columns (`--columns`) and the largest distance from the path, in mm, of a row that names
    /// no target (`--match-mm`).
    #[must_use]
    pub fn read_as(self, names: Option<ColumnNames>, match_mm: f64) -> Self {
        Self { names, match_mm: Some(match_mm), ..self }
    }

    /// Parses the table. Names of columns that were given here replace those of the cell.
    fn table(&self, cell: &CellFile) -> Result<Table, Vec<Diagnostic>> {
        let table = Table::read_named(&self.source, self.names.as_ref().or(cell.cell.columns.as_ref()))?;
        Ok(Table { match_mm: self.match_mm, ..table })
    }
}

/// A program with what was measured on it, not yet parsed.
///
/// # Examples
/// ```
/// use deflex::session::{MeasuredFile, MeasuredRunFiles, ProgramFiles};
///
/// let run = MeasuredRunFiles {
///     program: ProgramFiles::read(&["samples/closed-loop/part.mod".into()], &[], None)?,
///     original: None,
///     measured: MeasuredFile::read("samples/closed-loop/measured.csv".as_ref())?,
/// };
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct MeasuredRunFiles {
    /// The program that ran.
    pub program: ProgramFiles,
    /// The program from which it was corrected, if it was: the value of `--against`.
    pub original: Option<ProgramFiles>,
    /// The measured rows.
    pub measured: MeasuredFile,
}

impl MeasuredRunFiles {
    fn parse(&self, cell: &CellFile, tool: Option<&str>) -> Result<MeasuredRun, Vec<Diagnostic>> {
        let original = self.original.as_ref().map(|original| original.parse(cell, tool)).transpose();
        let ((program, original), table) =
            both(both(self.program.parse(cell, tool), original), self.measured.table(cell))?;
        Ok(MeasuredRun { program, original, table })
    }

    fn sources(&self) -> impl Iterator<Item = &Source> {
        let programs = [&self.program].into_iter().chain(&self.original);
        programs.flat_map(|program| program.sources()).chain([&self.measured.source])
    }
}

/// The result of an identification, and the inputs that its reports name.
///
/// # Examples
/// ```
/// use deflex::session::Identified;
/// use deflex::text::Diagnostics;
///
/// /// Writes the extended cell, the answer for other programs, and the page.
/// fn write(identified: &Identified) -> Result<(), Diagnostics> {
///     std::fs::write("extended.toml", identified.cell()?)?;
///     std::fs::write("answer.json", identified.json(None)?)?;
///     Ok(std::fs::write("answer.html", identified.page())?)
/// }
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Identified {
    /// The effects that were found, and the fit before and after.
    pub found: Identification,
    /// Warnings and notes about the measured files.
    pub notes: Vec<Diagnostic>,
    cell: Origin,
    data: Vec<Origin>,
    cell_text: String,
    cell_name: String,
}

impl Identified {
    /// The user's cell file, with its comments, extended by the effects that were found.
    ///
    /// # Errors
    /// The cell file cannot be extended.
    pub fn cell(&self) -> Result<String, Vec<Diagnostic>> {
        let text = extended(&self.cell_text, &self.found.extended);
        text.map_err(|errors| input::own(&self.cell_name, errors))
    }

    /// The text that `--json` writes. `path` is the law of the controller's path that was fitted to logs, if there were
    /// any.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn json(&self, path: Option<&FittedLaw>) -> Result<String, Vec<Diagnostic>> {
        #[derive(serde::Serialize)]
        struct Json<'a> {
            #[serde(flatten)]
            found: &'a Identification,
            #[serde(skip_serializing_if = "Option::is_none")]
            path: Option<&'a FittedLaw>,
            deflex: &'static str,
            cell: &'a Origin,
            sources: &'a [Origin],
        }
        pretty(&Json { found: &self.found, path, deflex: VERSION, cell: &self.cell, sources: &self.data })
    }

    /// The page that `--html` writes.
    #[must_use]
    pub fn page(&self) -> String {
        identification_page(&self.found, &self.cell, &self.data)
    }
}

/// Finds the effects that a cell lacks, as `deflex identify` does. `runs` are programs with the points measured on
/// them; `poses` are measured rows with their own motor angles. `tool` is the value of `--tool`, and `written` says
/// which effects go into the cell. `progress` receives the share of the work that is done, 0 to 1, and cancels the run
/// by returning `false`.
///
/// # Errors
/// Every error for which the command ends with exit code 2, and `run.called-off` after a cancellation.
///
/// # Examples
/// ```no_run
/// use deflex::session::{CellFile, MeasuredFile, MeasuredRunFiles, ProgramFiles, identify};
/// use deflex::identify::Written;
///
/// let cell = CellFile::read("samples/closed-loop/cell.toml".as_ref())?;
/// let run = MeasuredRunFiles {
///     program: ProgramFiles::read(&["samples/closed-loop/part.mod".into()], &[], None)?,
///     original: None,
///     measured: MeasuredFile::read("samples/closed-loop/measured.csv".as_ref())?,
/// };
/// let answer = identify(&cell, &[run], &[], None, Written::WholeModel, &|_| true)?;
/// std::fs::write("extended.toml", answer.cell()?)?;
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn identify(
    cell: &CellFile,
    runs: &[MeasuredRunFiles],
    poses: &[MeasuredFile],
    tool: Option<&str>,
    written: Written,
    progress: &Progress<'_>,
) -> Result<Identified, Vec<Diagnostic>> {
    if let Some(tool) = tool.filter(|_| poses.is_empty() && runs.iter().all(|run| run.program.language().is_edited())) {
        let message = format!("--tool {tool} has no effect: it is for --poses and for CL data, and none are given");
        return Err(Diagnostic::error("usage.tool", "", message)
            .help("leave it out: the program names its tools")
            .into());
    }
    let parsed = all(runs.iter().map(|run| run.parse(cell, tool)));
    let (parsed, tables) = both(parsed, all(poses.iter().map(|poses| poses.table(cell))))?;
    let read = parsed.iter().map(|run| &run.table).chain(&tables);
    let notes = read.flat_map(|table| table.notes.iter().cloned()).collect();
    let data: Vec<&Source> =
        runs.iter().flat_map(MeasuredRunFiles::sources).chain(poses.iter().map(|table| &table.source)).collect();
    let hash = hash(data.iter().copied().chain([&cell.source]));
    let input = Input { cell: &cell.cell, runs: parsed, poses: tables, tool, data_hash: &hash, written, progress };
    let found = identify::identify(input).map_err(|errors| cell.own(errors))?;
    Ok(Identified {
        found,
        notes,
        cell: cell.origin(),
        data: data.into_iter().map(|source| Origin::of(&source.name, &source.bytes)).collect(),
        cell_text: String::from_utf8_lossy(&cell.source.bytes).into_owned(),
        cell_name: cell.name.clone(),
    })
}

/// Fits the law of the controller's path to logs of its axes, as `deflex identify --log` does.
///
/// # Errors
/// Every error for which the command ends with exit code 2.
///
/// # Examples
/// ```no_run
/// use deflex::session::{CellFile, MeasuredFile, ProgramFiles, identify_path};
///
/// let cell = CellFile::read("cell.toml".as_ref())?;
/// let log = |program: &str, log: &str| {
///     Ok::<_, deflex::text::Diagnostics>((
///         ProgramFiles::read(&[program.into()], &[], None)?,
///         MeasuredFile::read(log.as_ref())?,
///     ))
/// };
/// let law = identify_path(&cell, &[log("a.mod", "a.csv")?, log("b.mod", "b.csv")?], None)?;
/// println!("{:.3} mm rms from the path of the law", law.after.rms_mm);
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn identify_path(
    cell: &CellFile,
    logs: &[(ProgramFiles, MeasuredFile)],
    tool: Option<&str>,
) -> Result<FittedLaw, Vec<Diagnostic>> {
    let robot = &cell.cell.arm.robot;
    let read = |(program, table): &(ProgramFiles, MeasuredFile)| {
        both(program.parse(cell, tool), table.table(cell)?.log(robot))
    };
    // The log has the angles of the motors. Forces deflect the arm, but do not change the path along which the
    // controller leads the motors.
    let options = Options { tool: tool.map(str::to_owned), forces: Some(Forces::none()), ..Options::default() };
    if let Some((_, twice)) = logs
        .iter()
        .enumerate()
        .find(|(i, (_, log))| logs[..*i].iter().any(|(_, other)| other.source.bytes == log.source.bytes))
    {
        let message = "this log is given twice: the second would judge a law that was fitted to it".to_owned();
        let error = Diagnostic::error("log.program", &twice.1.source.name, message);
        return Err(error.help("give each log once").into());
    }
    let mut read = all(logs.iter().map(read))?;
    let course = |(program, _): &(Program, Log)| {
        let prepared = Prepared::new(program, &cell.cell, &options).map_err(|errors| cell.own(errors))?;
        Course::with_assumed_zone(program, &cell.cell, &prepared, ASSUMED_ZONE).map_err(|errors| cell.own(errors))
    };
    let fault = |error: LogError| vec![log_error(error, logs)];
    let mut turn = None;
    // The logs decide how the tool turns on arcs, unless the cell or a program states it.
    let targets = || read.iter().flat_map(|(program, _)| &program.targets);
    let is_stated = cell.cell.controller.arc_turn.is_some() || targets().any(|target| target.arc_turn.is_some());
    if !is_stated && targets().any(|target| target.role == Role::Via) {
        let turned = |read: &mut [(Program, Log)], turn: Option<ArcTurn>| {
            read.iter_mut().flat_map(|(program, _)| &mut program.targets).for_each(|target| target.arc_turn = turn);
        };
        // The way decides the orientation at circle points, with which the arm may not reach them.
        let mut ways = Vec::new();
        for (_, turn) in ArcTurn::WORDS {
            turned(&mut read, Some(turn));
            ways.extend(all(read.iter().map(course)).ok().map(|courses| (turn, courses)));
        }
        let ways: Vec<_> =
            ways.iter().map(|(turn, courses)| WayOfTurning { turn: *turn, logs: runs(courses, &read) }).collect();
        turn = arc_turn(robot, &ways).map_err(fault)?;
        turned(&mut read, turn);
    }
    let courses = all(read.iter().map(course))?;
    let is_assumed = courses.iter().any(|course| course.unstated > 0);
    let declared = cell.cell.controller.path.map_or(PathLaw::TYPICAL, |path| path.law);
    let mut found = fit_law(robot, &runs(&courses, &read), &declared.axis_acceleration).map_err(fault)?;
    found.arc_turn = turn;
    found.assumed_zone = is_assumed.then_some(ASSUMED_ZONE);
    Ok(found)
}

/// Radius with which zones count while a law is fitted, if neither the program nor the cell states one (FANUC `CNT`, `C_DIS` without
/// `$APO`), m. Only its product with the zone share, which is fitted, has an influence.
const ASSUMED_ZONE: f64 = 1e-3;

/// The waypoints of each program with its log.
fn runs<'a>(courses: &'a [Course], read: &'a [(Program, Log)]) -> Vec<(&'a [Waypoint], &'a Log)> {
    courses.iter().zip(read).map(|(course, (_, log))| (&course.waypoints[..], log)).collect()
}

/// The message for a log that cannot be used.
fn log_error(error: LogError, logs: &[(ProgramFiles, MeasuredFile)]) -> Diagnostic {
    let file = |i: usize| logs.get(i).map_or("", |(_, log)| &log.source.name);
    let message = match &error {
        LogError::OneLog => "one log cannot be judged: the law is fitted to some logs and tested on others".to_owned(),
        LogError::OtherProgram(i) => {
            format!("the axes do not pass the first and the last point of `{}`", logs[*i].0.name())
        }
        LogError::Path(i, DriveError::Unreachable { waypoint }) => {
            format!(
                "the arm does not reach every position on the path to point {} of `{}`",
                waypoint + 1,
                logs[*i].0.name()
            )
        }
        LogError::Path(i, DriveError::TooLong) => format!("`{}` runs for more than a day", logs[*i].0.name()),
        LogError::Slow { log, share } => format!(
            "the robot drives at {:.0} % of the speed in `{}`, and takes longer than any acceleration explains",
            100.0 * share,
            logs[*log].0.name()
        ),
    };
    let (at, help) = match error {
        LogError::OneLog => (0, "give a second log: --log PROGRAM LOG.csv --log PROGRAM LOG2.csv"),
        LogError::OtherProgram(i) => {
            (i, "check that the log is of this program, of this robot, and in degrees as the pendant shows them")
        }
        LogError::Path(i, _) => (i, "check the cell's robot, tool and work object"),
        LogError::Slow { log, .. } => (
            log,
            "record the axes with the speed override at 100 %; for FANUC, use CNT100: below, the robot brakes before each corner",
        ),
    };
    Diagnostic::error("log.program", file(at), message).help(help)
}

/// FNV-1a hash over all files on which the result depends. It distinguishes data, but does not protect against forgery.
fn hash<'a>(sources: impl Iterator<Item = &'a Source>) -> String {
    let bytes = sources.flat_map(|source| &source.bytes);
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    format!("fnv1a:{hash:016x}")
}
