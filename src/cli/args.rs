//! What was typed.

use clap::{Args, Parser, Subcommand, ValueEnum, ValueHint};
use deflex::program::Language;
use std::path::PathBuf;

/// Makes a robot mill where the program says, and finds out why it does not.
#[derive(Debug, Parser)]
#[command(name = "deflex", version, propagate_version = true, max_term_width = 100, after_help = EXAMPLES, disable_help_subcommand = true)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub(super) command: Command,
}

const EXAMPLES: &str = "\
Examples:
  deflex init --robot irb6660-205-1.9 > cell.toml          a cell file to start from
  deflex inspect part.mod                                  what is understood of a program
  deflex predict part.mod --cell cell.toml                 the error that the cell would cut
  deflex compensate part.mod --cell cell.toml -o out.mod   the program that cuts true
  deflex diff part.mod out.mod                             what changed
  deflex plan --cell cell.toml --rows 24 -o plan.mod --measured plan.csv
                                                           what to measure to find that out
  deflex identify --run part.mod measured.csv --cell cell.toml -o cell2.toml
                                                           which effect the cell lacks

Exit codes: 0 done; 1 done, and the answer is no (check, diff); 2 could not do it, nothing was written.";

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Correct programs so that the loaded tool lands where they say
    #[command(after_help = COMPENSATE)]
    Compensate(Compensate),
    /// Report what the cell would cut, without a correction
    #[command(after_help = PREDICT)]
    Predict(Predict),
    /// Cut the stock with the poses that the loaded arm takes: the part before it is cut, and its deviation
    #[command(after_help = SIMULATE)]
    Simulate(Simulate),
    /// Say what changed between two programs, target by target
    #[command(
        after_help = "Exit code 1 where anything differs. Quaternions of opposite sign are the same orientation."
    )]
    Diff(Diff),
    /// For CI: is each target within tolerance, reachable and convergent?
    #[command(after_help = CHECK)]
    Check(Check),
    /// Find the effect that the cell lacks from measured data, and extend the cell with it
    #[command(after_help = IDENTIFY)]
    Identify(Identify),
    /// Plan what to measure, so that effects can be told apart: the program and the table to fill in
    #[command(after_help = PLAN)]
    Plan(Plan),
    /// Say what is understood of programs; no cell needed
    #[command(after_help = INSPECT)]
    Inspect(Inspect),
    /// Print a commented cell file to start from
    #[command(
        after_help = "Put your own values in where `# <<` stands behind one; as long as one is left, each run says so."
    )]
    Init(Init),
    /// Joints to TCP and back: a check of the cell's robot against the pendant
    #[command(after_help = POSE)]
    Pose(Pose),
    /// Completions for a shell, and manual pages
    #[command(after_help = GENERATE)]
    Generate(Generate),
}

const COMPENSATE: &str = "\
Examples:
  deflex compensate part.mod --cell cell.toml -o out.mod --report out.csv
  deflex compensate blade.apt --cell cell.toml -o blade.mod     CL in, RAPID out
  deflex compensate *.mod --cell cell.toml --out-dir corrected  modules that use each other are one program
  cat part.mod | deflex compensate - --cell cell.toml > out.mod

Nothing is written unless every target is solved and within the cell's [limits].";

const PREDICT: &str = "\
Examples:
  deflex predict part.mod --cell cell.toml                       report on stdout
  deflex predict out.mod --cell cell.toml --against part.mod     judges a corrected program";

const SIMULATE: &str = "\
Examples:
  deflex simulate part.mod --cell cell.toml --html part.html                    where the part will be off
  deflex simulate out.mod --cell cell.toml --against part.mod --html part.html  before and after a correction
  deflex simulate part.mod --cell cell.toml --probe points.csv                  a virtual CMM

The cell needs [stock], and a cutter for each tool that cuts it. Points are in the axes of the stock's work object.";

const CHECK: &str = "\
Examples:
  deflex check part.mod --cell cell.toml --max-error 0.1
  deflex check corrected/*.mod --cell cell.toml --against original --max-error 0.02 --format sarif > check.sarif

Exit code 1 where a target is out of tolerance, not reached, over a limit or without equilibrium.";

const IDENTIFY: &str = "\
Examples:
  deflex identify --run part.mod measured.csv --cell cell.toml -o cell2.toml
  deflex identify --run a.mod a.csv --run b.mod b.csv --cell cell.toml --json found.json
  deflex identify --poses tracker.csv --cell cell.toml           rows with their own motor angles

Errors before and after are those of held-out rows, which no fit has seen.";

const PLAN: &str = "\
Examples:
  deflex plan --cell cell.toml --rows 24 -o plan.mod --measured plan.csv      then run, measure, fill in, and
  deflex identify --run plan.mod plan.csv --cell cell.toml
  deflex plan --cell cell.toml --rows 12 -o part.mod --pool production.mod    places of a production program only
  deflex plan --cell cell.toml --rows 12 -o next.mod --after found.json       what an identification left undecided

The cell's [plan] says where the tool may go, which loads can be applied and what is measured with (docs/formats.md).";

const INSPECT: &str = "\
Examples:
  deflex inspect part.mod
  deflex inspect programs/ --json found.json     every program of a folder
  deflex inspect part.mod --json                 JSON on stdout";

const POSE: &str = "\
Examples:
  deflex pose --cell cell.toml --joints 0,0,0,0,30,0 --tool tMill
  deflex pose --cell cell.toml --target 1200,0,900,0,0,1,0 --tool tMill   every way to reach it
  deflex pose --cell cell.toml --target 1200,0,900,90,0,180               x, y, z, A, B, C as KUKA counts them

Angles are those of the pendant (axis signs and couplings of the maker), poses those of the TCP in the world, or in --wobj.";

const GENERATE: &str = "\
Where shells and man look (make the folders first):
  deflex generate completions bash > ~/.local/share/bash-completion/completions/deflex
  deflex generate completions zsh > ~/.zfunc/_deflex
  deflex generate completions fish > ~/.config/fish/completions/deflex.fish
  deflex generate man ~/.local/share/man/man1

For zsh, ~/.zshrc says `fpath+=~/.zfunc` before `compinit`. Then: man deflex-compensate";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    Rapid,
    Cl,
    Krl,
    Ls,
}

impl From<Format> for Language {
    fn from(format: Format) -> Self {
        match format {
            Format::Rapid => Self::Rapid,
            Format::Cl => Self::Cl,
            Format::Krl => Self::Krl,
            Format::Ls => Self::Ls,
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Corrected {
    /// Position and orientation
    #[default]
    Pose,
    /// Position only: orientation tokens stay, and the TCP is landed all the same
    Position,
}

/// How inputs are read.
#[derive(Clone, Debug, Args)]
pub(super) struct Reading {
    /// Modules that declare tools, work objects and targets; never written
    #[arg(long, value_name = "FILE", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub(super) context: Vec<PathBuf>,
    /// Kind of the input, where content and ending do not tell
    #[arg(long, value_enum, value_name = "KIND")]
    pub(super) format: Option<Format>,
}

/// Options that every run has.
#[derive(Clone, Debug, Args)]
pub(super) struct Common {
    /// Threads; all cores without it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) jobs: Option<u16>,
    /// No progress, notes or summary on stderr
    #[arg(long, short)]
    pub(super) quiet: bool,
}

/// What of the cell and the cut a run takes.
#[derive(Clone, Debug, Args)]
pub(super) struct Model {
    /// Cell file
    #[arg(long, value_name = "CELL", value_hint = ValueHint::FilePath)]
    pub(super) cell: PathBuf,
    /// Forces by target (fx_n, fy_n, fz_n; also time_s, temperature_c, payload_kg); overrides [cut]
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(super) forces: Option<PathBuf>,
    /// Tool of the cell for every target, instead of the program's
    #[arg(long, value_name = "NAME")]
    pub(super) tool: Option<String>,
    /// Choose the turn about the tool axis of RAPID targets for the least predicted error (CL: `[cl] spin = "stiffest"`)
    #[arg(long)]
    pub(super) free_spin: bool,
}

/// Where reports go.
#[derive(Clone, Debug, Args)]
pub(super) struct Reports {
    /// Report, one row a target; `-` for stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(super) report: Option<PathBuf>,
    /// Summary as JSON; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) json: Option<PathBuf>,
    /// Page with the toolpath in 3-D and the errors along it, complete in one file; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) html: Option<PathBuf>,
    /// Several programs: do those that can be done, name the others, and end with exit code 2 where there is one
    #[arg(long)]
    pub(super) keep_going: bool,
}

impl Reports {
    /// How many of them go to stdout.
    pub(super) fn to_stdout(&self) -> usize {
        [&self.report, &self.json, &self.html].into_iter().flatten().filter(|path| path.as_os_str() == "-").count()
    }
}

/// Rapid travel of posted programs: as fast as a milling robot is let go near a part.
pub(super) const RAPID_MM_S: f64 = 200.0;

/// What CL data are posted in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum PostIn {
    /// ABB RAPID
    #[default]
    Rapid,
    /// KUKA KRL
    Krl,
    /// FANUC TP: tools and work objects are those of the numbers in their names
    Ls,
    /// The same CL data with corrected points and tool axes, for a post of your own
    Cl,
}

impl From<PostIn> for Language {
    fn from(post: PostIn) -> Self {
        match post {
            PostIn::Rapid => Self::Rapid,
            PostIn::Krl => Self::Krl,
            PostIn::Ls => Self::Ls,
            PostIn::Cl => Self::Cl,
        }
    }
}

#[derive(Debug, Args)]
pub(super) struct Compensate {
    /// Programs: RAPID modules, .pgf lists, KRL, FANUC TP, CL/APT files; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(super) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) model: Model,
    /// Corrected program; `-` or nothing for stdout
    #[arg(long, short, value_name = "FILE", conflicts_with = "out_dir", value_hint = ValueHint::FilePath)]
    pub(super) output: Option<PathBuf>,
    /// Folder for corrected programs and their reports (NAME.report.csv); made where missing
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub(super) out_dir: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reports: Reports,
    /// What is corrected
    #[arg(long, value_enum, default_value_t, value_name = "WHAT")]
    pub(super) correct: Corrected,
    /// Insert targets until no more than this is left on the way between two
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) subdivide: Option<f64>,
    /// Give a declared target that is used with different corrections a clone for each
    #[arg(long)]
    pub(super) allow_clones: bool,
    /// Correct a program that `compensate` has written once more; without it, such a program is refused
    #[arg(long)]
    pub(super) again: bool,
    /// CL input: language of the corrected program
    #[arg(long, value_enum, default_value_t, value_name = "LANGUAGE")]
    pub(super) post: PostIn,
    /// CL input: split into modules of at most this many targets, loaded one after the other
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) max_targets: Option<u32>,
    /// CL input: speed of rapid travel in the posted program
    #[arg(long, value_name = "MM_S", default_value_t = RAPID_MM_S, value_parser = positive)]
    pub(super) rapid_speed: f64,
    /// CL input without a feed: speed of its moves
    #[arg(long, value_name = "MM_S", value_parser = positive)]
    pub(super) feed: Option<f64>,
    #[command(flatten)]
    pub(super) reading: Reading,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(Debug, Args)]
pub(super) struct Predict {
    /// Programs: RAPID modules, .pgf lists, KRL, FANUC TP, CL/APT files; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(super) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) model: Model,
    /// The original of a corrected program (or the folder of originals): errors are counted from its targets
    #[arg(long, value_name = "ORIGINAL", value_hint = ValueHint::AnyPath)]
    pub(super) against: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reports: Reports,
    #[command(flatten)]
    pub(super) reading: Reading,
    #[command(flatten)]
    pub(super) common: Common,
    /// Taken for the sake of scripts that share options; a prediction corrects nothing
    #[arg(long, value_enum, default_value_t, hide = true)]
    pub(super) correct: Corrected,
}

#[derive(Debug, Args)]
pub(super) struct Simulate {
    /// Programs: RAPID modules, .pgf lists, KRL, FANUC TP, CL/APT files; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(super) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) model: Model,
    /// The original of a corrected program (or the folder of originals): the part is held against what it programs
    #[arg(long, value_name = "ORIGINAL", value_hint = ValueHint::AnyPath)]
    pub(super) against: Option<PathBuf>,
    /// The part as it will be cut, as binary STL; `-` for stdout
    #[arg(long, value_name = "OUT.stl", value_hint = ValueHint::FilePath)]
    pub(super) stl: Option<PathBuf>,
    /// Page with the part in 3-D, coloured by its deviation, complete in one file; `-` for stdout
    #[arg(long, value_name = "OUT.html", value_hint = ValueHint::FilePath)]
    pub(super) html: Option<PathBuf>,
    /// Points of the surface with their deviation; `-` for stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(super) report: Option<PathBuf>,
    /// Figures as JSON; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) json: Option<PathBuf>,
    /// Nominal points (x_mm, y_mm, z_mm; nx, ny, nz for their normals) to tell the deviation at, in --report or on stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(super) probe: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reading: Reading,
    #[command(flatten)]
    pub(super) common: Common,
}

impl Simulate {
    /// None of them is one row a target.
    pub(super) fn reports(&self) -> Reports {
        Reports { report: None, json: None, html: None, keep_going: false }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum CheckFormat {
    #[default]
    Text,
    Json,
    Junit,
    Sarif,
    /// Programs are RAPID, as in other commands; the answer is text
    #[value(hide = true)]
    Rapid,
    /// Programs are CL, as in other commands; the answer is text
    #[value(hide = true)]
    Cl,
    /// Programs are KRL, as in other commands; the answer is text
    #[value(hide = true)]
    Krl,
    /// Programs are FANUC TP, as in other commands; the answer is text
    #[value(hide = true)]
    Ls,
}

#[derive(Debug, Args)]
pub(super) struct Check {
    /// Programs: RAPID modules, .pgf lists, KRL, FANUC TP, CL/APT files; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(super) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) model: Model,
    /// Largest error of a target, and of the way into it
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) max_error: f64,
    /// Judge the targets alone, not the ways between them
    #[arg(long)]
    pub(super) at_targets: bool,
    /// Largest correction of a target
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) max_correction: Option<f64>,
    /// The original of a corrected program (or the folder of originals): errors are counted from its targets
    #[arg(long, value_name = "ORIGINAL", value_hint = ValueHint::AnyPath)]
    pub(super) against: Option<PathBuf>,
    /// Form of the answer on stdout: text, json, junit, sarif (rapid, cl, krl, ls: kind of the input)
    #[arg(long, value_enum, value_name = "FORM", action = clap::ArgAction::Append)]
    pub(super) format: Vec<CheckFormat>,
    /// Modules that declare tools, work objects and targets
    #[arg(long, value_name = "FILE", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub(super) context: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) reports: Reports,
    #[command(flatten)]
    pub(super) common: Common,
    /// What a correction would change, for --max-correction
    #[arg(long, value_enum, default_value_t, value_name = "WHAT")]
    pub(super) correct: Corrected,
}

#[derive(Debug, Args)]
pub(super) struct Diff {
    /// Program before
    #[arg(value_hint = ValueHint::FilePath)]
    pub(super) original: PathBuf,
    /// Program after
    #[arg(value_hint = ValueHint::FilePath)]
    pub(super) corrected: PathBuf,
    /// Every target that moved as CSV; `-` for stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(super) report: Option<PathBuf>,
    /// All of it as JSON; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) json: Option<PathBuf>,
    /// Page with the toolpath in 3-D and the shifts along it, complete in one file; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) html: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reading: Reading,
    /// Only the exit code tells
    #[arg(long, short)]
    pub(super) quiet: bool,
}

#[derive(Debug, Args)]
pub(super) struct Identify {
    /// A program and what was measured on it; any number
    #[arg(long, num_args = 2, value_names = ["PROGRAM", "MEASURED"], required_unless_present = "poses", conflicts_with = "poses", value_hint = ValueHint::FilePath)]
    pub(super) run: Vec<PathBuf>,
    /// Measured rows that carry their own motor angles; any number, no program needed
    #[arg(long, value_name = "MEASURED", value_hint = ValueHint::FilePath)]
    pub(super) poses: Vec<PathBuf>,
    /// How the file calls its columns, where otherwise; others are then not looked at: "target=Punkt Nr,x_mm=X Ist"
    #[arg(long, value_name = "NAME=COLUMN,…")]
    pub(super) columns: Option<String>,
    /// How far from the path a row with nominal_x_mm, nominal_y_mm, nominal_z_mm and no target may lie
    #[arg(long, value_name = "MM", default_value_t = deflex::measured::MATCH_MM, value_parser = positive)]
    pub(super) match_mm: f64,
    /// Cell file
    #[arg(long, value_name = "CELL", value_hint = ValueHint::FilePath)]
    pub(super) cell: PathBuf,
    /// The cell file with the effects found; `-` for stdout
    #[arg(long, short, value_name = "CELL2", value_hint = ValueHint::FilePath)]
    pub(super) output: Option<PathBuf>,
    /// Tool of the cell that the rows are about
    #[arg(long, value_name = "NAME")]
    pub(super) tool: Option<String>,
    /// Residuals row by row: before, after, whitened, block, outlier
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(super) report: Option<PathBuf>,
    /// The answer as JSON; `-` or nothing for stdout
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-", value_hint = ValueHint::FilePath)]
    pub(super) json: Option<PathBuf>,
    /// Page with residuals before and after, the ranking and what is left, complete in one file; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) html: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reading: Reading,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(Debug, Args)]
pub(super) struct Plan {
    /// Cell file with [plan]
    #[arg(long, value_name = "CELL", value_hint = ValueHint::FilePath)]
    pub(super) cell: PathBuf,
    /// Rows to measure
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(8..=500))]
    pub(super) rows: u16,
    /// The program: each motion ends where a row is measured; `-` for stdout
    #[arg(long, short, value_name = "PLAN.mod", value_hint = ValueHint::FilePath)]
    pub(super) output: PathBuf,
    /// The table to fill in: target, load and time of each row, measured columns empty; `-` for stdout
    #[arg(long, value_name = "PLAN.csv", value_hint = ValueHint::FilePath)]
    pub(super) measured: Option<PathBuf>,
    /// What the rows will tell as JSON: d' of each pair of effects, the chance to be named rightly; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) json: Option<PathBuf>,
    /// The same as a page, complete in one file; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) html: Option<PathBuf>,
    /// Programs whose targets are the places to choose from, instead of the box of [plan]
    #[arg(long, value_name = "PROGRAM", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub(super) pool: Vec<PathBuf>,
    /// JSON of an identification: the rows are to settle what it left undecided
    #[arg(long, value_name = "ID.json", value_hint = ValueHint::FilePath)]
    pub(super) after: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reading: Reading,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(Debug, Args)]
pub(super) struct Inspect {
    /// Programs or folders of programs; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::AnyPath)]
    pub(super) inputs: Vec<PathBuf>,
    /// What was found as JSON; `-` or nothing for stdout
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-", value_hint = ValueHint::FilePath)]
    pub(super) json: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reading: Reading,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(Debug, Args)]
pub(super) struct Init {
    /// Built-in robot to start from
    #[arg(long, value_name = "MODEL", conflicts_with = "urdf")]
    pub(super) robot: Option<String>,
    /// Robot description to take the kinematics from (xacro expanded)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) urdf: Option<PathBuf>,
    /// Backup of an ABB controller: robot, base, axis limits, mechanical units, tools and work objects
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, conflicts_with = "urdf")]
    pub(super) backup: Option<PathBuf>,
    /// Its last link; without it `tool0`, `flange`, or the end of the only chain of six joints
    #[arg(long, value_name = "LINK", requires = "urdf")]
    pub(super) tip: Option<String>,
    /// Name the built-in robots
    #[arg(long)]
    pub(super) list: bool,
    /// Where to; stdout without it
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(super) output: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("which").required(true).args(["joints", "target"]))]
pub(super) struct Pose {
    /// Cell file
    #[arg(long, value_name = "CELL", value_hint = ValueHint::FilePath)]
    pub(super) cell: PathBuf,
    /// Axis angles, degrees: prints the TCP
    #[arg(long, value_name = "J1,…,J6", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    pub(super) joints: Vec<f64>,
    /// TCP as x,y,z,q1,q2,q3,q4 or x,y,z,A,B,C (mm, degrees): prints all axis angles that reach it
    #[arg(long, value_name = "X,Y,Z,…", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    pub(super) target: Vec<f64>,
    /// Where the cell's mechanical units stand: positions of eax_a, eax_b, … (mm, degrees); 0 without it
    #[arg(long, value_name = "E1,…", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    pub(super) external: Vec<f64>,
    /// Tool of the cell; without it the flange
    #[arg(long, value_name = "NAME")]
    pub(super) tool: Option<String>,
    /// Work object of the cell in which the TCP counts; without it the world
    #[arg(long, value_name = "NAME")]
    pub(super) wobj: Option<String>,
    /// The answer as JSON; `-` or nothing for stdout
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-", value_hint = ValueHint::FilePath)]
    pub(super) json: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct Generate {
    /// What to make
    #[command(subcommand)]
    pub(super) what: Generated,
}

#[derive(Debug, Subcommand)]
pub(super) enum Generated {
    /// Completions for a shell, on stdout
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Manual pages, one a command, into a folder
    Man {
        /// Where to
        #[arg(value_hint = ValueHint::DirPath)]
        dir: PathBuf,
    },
}

/// A finite number above 0.
fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}
