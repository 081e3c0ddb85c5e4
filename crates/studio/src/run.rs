//! The runs that the window offers: a list of commands with typed options, from which this module builds the arguments. The
//! browser never sends a command line.

use crate::name::Name;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::num::NonZeroU32;

/// A number for an option, as it was typed: finite and above zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Positive(String);

impl TryFrom<String> for Positive {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() && value > 0.0 => Ok(Self(text.trim().to_owned())),
            _ => Err(format!("{text:?} is not a number above 0")),
        }
    }
}

impl fmt::Display for Positive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A word of the cell or of an option: a tool, a model, a language.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Word(String);

/// Longest word, bytes.
const LONGEST_WORD: usize = 400;

impl TryFrom<String> for Word {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        if text.is_empty() || text.len() > LONGEST_WORD || text.starts_with('-') || text.chars().any(char::is_control) {
            return Err(format!(
                "{text:?} cannot be given to a command: expected 1 to {LONGEST_WORD} characters, no hyphen at the start"
            ));
        }
        Ok(Self(text))
    }
}

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// The source of a new cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Origin {
    /// A built-in robot.
    Robot(Word),
    /// A robot description.
    Urdf(Name),
    /// The folder of a controller's backup.
    Backup(Name),
}

/// The destination of corrected programs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Destination {
    /// One program into one file.
    File(Name),
    /// Several files into a folder.
    Folder(Name),
}

/// A program and the rows that were measured on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Measured {
    program: Name,
    table: Name,
}

/// How `predict`, `check`, `compensate` and `simulate` read programs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) struct Reading {
    /// Files that declare names.
    context: Vec<Name>,
    /// A table of forces.
    forces: Option<Name>,
    /// A tool of the cell for every target.
    tool: Option<Word>,
    /// Choose the turn about the tool axis.
    free_spin: bool,
}

/// How CL data are posted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) struct Posting {
    language: Option<Word>,
    /// Largest number of targets in a module.
    max_targets: Option<NonZeroU32>,
    /// Speed of rapid travel, mm/s.
    rapid_speed: Option<Positive>,
    /// Speed of moves without a feed, mm/s.
    feed: Option<Positive>,
}

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", rename_all_fields = "kebab-case", deny_unknown_fields)]
pub(crate) enum Run {
    /// Shows what deflex understands of programs; writes nothing.
    Inspect { programs: Vec<Name> },
    /// Reads a cell to report its errors; writes nothing.
    Pose { cell: Name },
    /// Writes a cell to start from.
    Init {
        origin: Origin,
        output: Name,
        /// The last link of a robot description.
        tip: Option<Word>,
    },
    /// Predicts the errors of programs.
    Predict {
        programs: Vec<Name>,
        cell: Name,
        #[serde(default)]
        reading: Reading,
        against: Option<Name>,
        /// Write the driven path.
        #[serde(default)]
        path: bool,
        /// A name of its own for the results.
        results: Option<Word>,
    },
    /// Corrects programs.
    Compensate {
        programs: Vec<Name>,
        cell: Name,
        #[serde(default)]
        reading: Reading,
        output: Destination,
        subdivide: Option<Positive>,
        max_path_error: Option<Positive>,
        /// Correct the position alone.
        #[serde(default)]
        position: bool,
        #[serde(default)]
        posting: Posting,
        /// Correct a corrected program once more.
        #[serde(default)]
        again: bool,
        /// Give a target that is used with different corrections a clone for each.
        #[serde(default)]
        allow_clones: bool,
    },
    /// Checks programs.
    Check {
        programs: Vec<Name>,
        cell: Name,
        #[serde(default)]
        reading: Reading,
        against: Option<Name>,
        max_error: Positive,
        max_path_error: Option<Positive>,
        max_jump: Option<Positive>,
        max_correction: Option<Positive>,
        /// Judge the targets, and not the paths between them.
        #[serde(default)]
        at_targets: bool,
        #[serde(default)]
        allow_unjudged: bool,
    },
    /// Simulates the part as it will be cut.
    Simulate {
        programs: Vec<Name>,
        cell: Name,
        #[serde(default)]
        reading: Reading,
        against: Option<Name>,
        /// Nominal points at which the deviation is computed.
        probe: Option<Name>,
    },
    /// Compares two programs.
    Diff { original: Name, corrected: Name },
    /// Finds the effect that the cell lacks.
    Identify {
        #[serde(default)]
        runs: Vec<Measured>,
        #[serde(default)]
        poses: Vec<Name>,
        /// At least two programs, each with the log of the controller's axes.
        #[serde(default)]
        logs: Vec<Measured>,
        cell: Name,
        output: Name,
        columns: Option<Word>,
        /// How far from the path a row with nominal coordinates may lie, mm.
        match_mm: Option<Positive>,
        tool: Option<Word>,
        #[serde(default)]
        context: Vec<Name>,
        #[serde(default)]
        sparse: bool,
    },
    /// Plans a measurement.
    Plan {
        cell: Name,
        rows: u16,
        output: Name,
        after: Option<Name>,
        /// Programs whose targets are the places to choose from.
        #[serde(default)]
        pool: Vec<Name>,
        #[serde(default)]
        context: Vec<Name>,
        post: Option<Word>,
        /// When the program stops for the operator.
        ask: Option<Word>,
    },
}

/// The arguments of a run, and the files that it writes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Call {
    /// After the program's own name.
    pub(crate) arguments: Vec<String>,
    /// Files that are written; of a folder, the folder.
    pub(crate) writes: Vec<Name>,
    /// Figures of the run as JSON, among them.
    pub(crate) figures: Option<Name>,
    /// Its page, among them.
    pub(crate) page: Option<Name>,
    /// Folders that the run needs.
    #[serde(skip)]
    pub(crate) reads: Vec<Name>,
}

impl Call {
    fn of(command: &str) -> Self {
        Self { arguments: vec![command.to_owned()], ..Self::default() }
    }

    /// A command on programs and a cell.
    fn on(command: &str, programs: &[Name], cell: &Name, reading: &Reading) -> Self {
        let mut call = Self::of(command);
        call.inputs(programs);
        call.input("--cell", cell);
        call.reading(reading);
        call
    }

    fn inputs(&mut self, names: &[Name]) {
        for name in names {
            self.arguments.push(name.to_string());
            self.reads.push(name.clone());
        }
    }

    fn input(&mut self, option: &str, name: &Name) {
        self.arguments.push(option.to_owned());
        self.inputs(std::slice::from_ref(name));
    }

    fn option(&mut self, option: &str, value: impl Into<String>) {
        self.arguments.extend([option.to_owned(), value.into()]);
    }

    /// An option that a run may be without.
    fn optional<T: ToString>(&mut self, option: &str, value: Option<&T>) {
        if let Some(value) = value {
            self.option(option, value.to_string());
        }
    }

    /// A file that a run may be without.
    fn optional_input(&mut self, option: &str, name: Option<&Name>) {
        if let Some(name) = name {
            self.input(option, name);
        }
    }

    fn flag(&mut self, option: &str, is_given: bool) {
        if is_given {
            self.arguments.push(option.to_owned());
        }
    }

    fn writes(&mut self, option: &str, name: &Name) {
        self.option(option, name.to_string());
        self.writes.push(name.clone());
    }

    /// The report, the figures and the page under one name.
    fn results(&mut self, name: &Name, what: &str, reports: Reports) -> Result<(), String> {
        if reports == Reports::All {
            self.writes("--report", &name.with_ending(&format!("{what}.csv"))?);
        }
        let figures = name.with_ending(&format!("{what}.json"))?;
        self.writes("--json", &figures);
        self.figures = Some(figures);
        if reports != Reports::Figures {
            let page = name.with_ending(&format!("{what}.html"))?;
            self.writes("--html", &page);
            self.page = Some(page);
        }
        Ok(())
    }

    fn reading(&mut self, reading: &Reading) {
        self.optional_input("--forces", reading.forces.as_ref());
        self.optional("--tool", reading.tool.as_ref());
        self.flag("--free-spin", reading.free_spin);
        self.context(&reading.context);
    }

    fn context(&mut self, context: &[Name]) {
        for name in context {
            self.input("--context", name);
        }
    }
}

/// What a run is to report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reports {
    /// The table, the figures and the page.
    All,
    /// The figures and the page; the table goes elsewhere.
    FiguresAndPage,
    /// The figures.
    Figures,
}

impl Run {
    /// The arguments.
    ///
    /// # Errors
    /// A sentence for the user where a run has no program, or a name of a result cannot be one.
    pub(crate) fn call(&self) -> Result<Call, String> {
        let first = |programs: &[Name]| programs.first().cloned().ok_or("choose a program first");
        match self {
            Self::Inspect { programs } => {
                first(programs)?;
                let mut call = Call::of("inspect");
                call.inputs(programs);
                call.flag("--json", true);
                Ok(call)
            }
            Self::Pose { cell } => {
                let mut call = Call::of("pose");
                call.input("--cell", cell);
                call.option("--joints", "0,0,0,0,0,0");
                Ok(call)
            }
            Self::Init { origin, output, tip } => {
                let mut call = Call::of("init");
                match origin {
                    Origin::Robot(model) => call.option("--robot", model.0.clone()),
                    Origin::Urdf(file) => call.input("--urdf", file),
                    Origin::Backup(folder) => call.input("--backup", folder),
                }
                call.optional("--tip", tip.as_ref());
                call.writes("-o", output);
                Ok(call)
            }
            Self::Predict { programs, cell, reading, against, path, results } => {
                let name = first(programs)?;
                let mut call = Call::on("predict", programs, cell, reading);
                call.optional_input("--against", against.as_ref());
                let what = results.as_ref().map_or("predict", |word| &word.0);
                if *path {
                    call.writes("--path", &name.with_ending(&format!("{what}.path.csv"))?);
                }
                call.results(&name, what, Reports::All)?;
                Ok(call)
            }
            Self::Compensate {
                programs,
                cell,
                reading,
                output,
                subdivide,
                max_path_error,
                position,
                posting,
                again,
                allow_clones,
            } => {
                let name = first(programs)?;
                let mut call = Call::on("compensate", programs, cell, reading);
                call.flag("--again", *again);
                call.flag("--allow-clones", *allow_clones);
                if *position {
                    call.option("--correct", "position");
                }
                call.optional("--subdivide", subdivide.as_ref());
                call.optional("--max-path-error", max_path_error.as_ref());
                call.optional("--post", posting.language.as_ref());
                call.optional("--max-targets", posting.max_targets.as_ref());
                call.optional("--rapid-speed", posting.rapid_speed.as_ref());
                call.optional("--feed", posting.feed.as_ref());
                let reports = match output {
                    Destination::File(file) => {
                        call.writes("-o", file);
                        Reports::All
                    }
                    Destination::Folder(folder) => {
                        call.writes("--out-dir", folder);
                        Reports::FiguresAndPage
                    }
                };
                call.results(&name, "compensate", reports)?;
                Ok(call)
            }
            Self::Check {
                programs,
                cell,
                reading,
                against,
                max_error,
                max_path_error,
                max_jump,
                max_correction,
                at_targets,
                allow_unjudged,
            } => {
                let name = first(programs)?;
                let mut call = Call::on("check", programs, cell, reading);
                call.optional_input("--against", against.as_ref());
                call.option("--max-error", max_error.0.clone());
                call.optional("--max-path-error", max_path_error.as_ref());
                call.optional("--max-jump", max_jump.as_ref());
                call.optional("--max-correction", max_correction.as_ref());
                call.flag("--at-targets", *at_targets);
                call.flag("--allow-unjudged", *allow_unjudged);
                call.results(&name, "check", Reports::All)?;
                Ok(call)
            }
            Self::Simulate { programs, cell, reading, against, probe } => {
                let name = first(programs)?;
                let mut call = Call::on("simulate", programs, cell, reading);
                call.optional_input("--against", against.as_ref());
                call.optional_input("--probe", probe.as_ref());
                call.writes("--stl", &name.with_ending("simulate.stl")?);
                call.results(&name, "simulate", Reports::All)?;
                Ok(call)
            }
            Self::Diff { original, corrected } => {
                let mut call = Call::of("diff");
                call.inputs(&[original.clone(), corrected.clone()]);
                call.results(corrected, "diff", Reports::All)?;
                Ok(call)
            }
            Self::Identify { runs, poses, logs, cell, output, columns, match_mm, tool, context, sparse } => {
                let pairs = |all: &[Measured]| all.iter().map(|run| run.table.clone()).collect::<Vec<_>>();
                let tables = [pairs(runs), poses.clone(), pairs(logs)].concat();
                let name = tables.first().cloned().ok_or("choose a measured table first")?;
                let mut call = Call::of("identify");
                for (option, all) in [("--run", runs), ("--log", logs)] {
                    for Measured { program, table } in all {
                        call.input(option, program);
                        call.inputs(std::slice::from_ref(table));
                    }
                }
                for poses in poses {
                    call.input("--poses", poses);
                }
                call.input("--cell", cell);
                call.optional("--columns", columns.as_ref());
                call.optional("--match-mm", match_mm.as_ref());
                call.optional("--tool", tool.as_ref());
                call.context(context);
                call.flag("--sparse", *sparse);
                call.writes("-o", output);
                // Logs alone have no rows to show.
                let has_rows = !runs.is_empty() || !poses.is_empty();
                call.results(&name, "identify", if has_rows { Reports::All } else { Reports::Figures })?;
                Ok(call)
            }
            Self::Plan { cell, rows, output, after, pool, context, post, ask } => {
                let mut call = Call::of("plan");
                call.input("--cell", cell);
                call.option("--rows", rows.to_string());
                call.optional_input("--after", after.as_ref());
                if !pool.is_empty() {
                    call.arguments.push("--pool".to_owned());
                    call.inputs(pool);
                }
                call.context(context);
                call.optional("--post", post.as_ref());
                call.optional("--ask", ask.as_ref());
                call.writes("-o", output);
                call.writes("--measured", &output.with_ending("csv")?);
                call.results(output, "plan", Reports::FiguresAndPage)?;
                Ok(call)
            }
        }
    }
}

/// A command line that does the same in a shell of this system.
pub(crate) fn command_line(arguments: &[String]) -> String {
    let quoted: Vec<String> = arguments.iter().map(|argument| quoted(argument)).collect();
    format!("deflex {}", quoted.join(" "))
}

fn quoted(argument: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./,=+:@".contains(c);
    if !argument.is_empty() && argument.chars().all(is_plain) {
        return argument.to_owned();
    }
    // PowerShell takes a text between single quotes as it is, with a quote in it written twice; so does a POSIX shell, but for the
    // quote.
    let quote = if cfg!(windows) { "''" } else { "'\\''" };
    format!("'{}'", argument.replace('\'', quote))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failure is a failed test

    use super::{Run, command_line, quoted};

    fn line(json: &str) -> String {
        let run: Run = serde_json::from_str(json).unwrap();
        command_line(&run.call().unwrap().arguments)
    }

    #[test]
    fn arguments_are_those_that_a_user_would_type() {
        assert_eq!(
            line(r#"{"command":"predict","programs":["part.mod"],"cell":"cell.toml"}"#),
            "deflex predict part.mod --cell cell.toml --report part.predict.csv --json part.predict.json --html part.predict.html"
        );
        assert_eq!(
            line(
                r#"{"command":"compensate","programs":["my part.src","b.src"],"cell":"cell.toml","output":{"folder":"out"},"subdivide":" 0.05 "}"#
            ),
            "deflex compensate 'my part.src' b.src --cell cell.toml --subdivide 0.05 --out-dir out --json 'my part.compensate.json' --html 'my part.compensate.html'"
        );
        assert_eq!(
            line(
                r#"{"command":"compensate","programs":["a.cls"],"cell":"c.toml","output":{"file":"a.src"},"posting":{"language":"krl","max-targets":500,"rapid-speed":"150","feed":"20"},"reading":{"tool":"tMill","free-spin":true,"context":["b.mod"]},"allow-clones":true}"#
            ),
            "deflex compensate a.cls --cell c.toml --tool tMill --free-spin --context b.mod --allow-clones --post krl --max-targets 500 --rapid-speed 150 --feed 20 -o a.src --report a.compensate.csv --json a.compensate.json --html a.compensate.html"
        );
        assert_eq!(
            line(
                r#"{"command":"check","programs":["a.mod"],"cell":"c.toml","max-error":"0.1","max-correction":"2","at-targets":true}"#
            ),
            "deflex check a.mod --cell c.toml --max-error 0.1 --max-correction 2 --at-targets --report a.check.csv --json a.check.json --html a.check.html"
        );
        assert_eq!(
            line(
                r#"{"command":"plan","cell":"c.toml","rows":24,"output":"p.mod","pool":["a.mod","b.mod"],"post":"krl","ask":"target"}"#
            ),
            "deflex plan --cell c.toml --rows 24 --pool a.mod b.mod --post krl --ask target -o p.mod --measured p.csv --json p.plan.json --html p.plan.html"
        );
        assert_eq!(
            line(
                r#"{"command":"identify","logs":[{"program":"a.mod","table":"a.csv"},{"program":"b.mod","table":"b.csv"}],"cell":"c.toml","output":"d.toml","match-mm":"3","tool":"tMill"}"#
            ),
            "deflex identify --log a.mod a.csv --log b.mod b.csv --cell c.toml --match-mm 3 --tool tMill -o d.toml --json a.identify.json"
        );
        assert_eq!(
            line(
                r#"{"command":"identify","runs":[{"program":"p.mod","table":"m.csv"}],"cell":"c.toml","output":"c2.toml","columns":"target=Punkt Nr"}"#
            ),
            "deflex identify --run p.mod m.csv --cell c.toml --columns 'target=Punkt Nr' -o c2.toml --report m.identify.csv --json m.identify.json --html m.identify.html"
        );
    }

    #[test]
    fn what_is_no_run_is_refused() {
        for json in [
            r#"{"command":"generate","what":"man"}"#,
            r#"{"command":"inspect","programs":["../x"]}"#,
            r#"{"command":"inspect","programs":["-"]}"#,
            r#"{"command":"inspect","programs":["a"],"arguments":["--html","x"]}"#,
            r#"{"command":"check","programs":["a"],"cell":"c","max-error":"-1"}"#,
            r#"{"command":"check","programs":["a"],"cell":"c","max-error":"nan"}"#,
            r#"{"command":"init","origin":{"robot":"--list"},"output":"c.toml"}"#,
        ] {
            assert!(serde_json::from_str::<Run>(json).is_err(), "{json}");
        }
        let none: Run = serde_json::from_str(r#"{"command":"inspect","programs":[]}"#).unwrap();
        assert_eq!(none.call().unwrap_err(), "choose a program first");
    }

    #[test]
    #[cfg(not(windows))]
    fn a_shell_reads_what_is_quoted() {
        assert_eq!(quoted("it's $HOME"), "'it'\\''s $HOME'");
        assert_eq!(quoted(""), "''");
    }
}
