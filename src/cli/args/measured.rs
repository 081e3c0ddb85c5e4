//! Commands on measured data.

use super::groups::{Common, Reading, positive};
use clap::{ArgGroup, Args, ValueEnum, ValueHint};
use deflex::identify::Ask;
use deflex::program::Language;
use std::path::PathBuf;

#[derive(Debug, Args)]
#[command(group = ArgGroup::new("rows").args(["run", "poses", "log"]).required(true).multiple(true))]
pub(in crate::cli) struct Identify {
    /// A program and the points measured on it; may be given several times
    #[arg(long, num_args = 2, value_names = ["PROGRAM", "MEASURED"], conflicts_with = "poses", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) run: Vec<PathBuf>,
    /// The program that the one of --run was corrected from: normal_mm and nominal places are counted from its path; of
    /// several, the folder with originals of the same file names
    #[arg(long, value_name = "ORIGINAL", requires = "run", value_hint = ValueHint::AnyPath)]
    pub(in crate::cli) against: Option<PathBuf>,
    /// Measured rows with motor angles, without a program; may be given several times
    #[arg(long, value_name = "MEASURED", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) poses: Vec<PathBuf>,
    /// A program and the controller's log of its axes while it ran (time_s, q1_deg … q6_deg); give at least two
    #[arg(long, num_args = 2, value_names = ["PROGRAM", "LOG"], value_hint = ValueHint::FilePath)]
    pub(in crate::cli) log: Vec<PathBuf>,
    /// Names of the columns in the file, where they differ: "target=Punkt Nr,x_mm=X Ist"; other columns are then ignored
    #[arg(long, value_name = "NAME=COLUMN,…")]
    pub(in crate::cli) columns: Option<String>,
    /// How far from the path a row with nominal_x_mm, nominal_y_mm, nominal_z_mm and no target may lie
    #[arg(long, value_name = "MM", default_value_t = deflex::measured::MATCH_MM, value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) match_mm: f64,
    /// Cell file
    #[arg(long, value_name = "CELL", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) cell: PathBuf,
    /// The cell file with the effects found; `-` for stdout
    #[arg(long, short, value_name = "CELL2", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) output: Option<PathBuf>,
    /// Write only the effects that are named, fitted without the others
    #[arg(long)]
    pub(in crate::cli) sparse: bool,
    /// Tool of the cell with which the rows were measured
    #[arg(long, value_name = "NAME")]
    pub(in crate::cli) tool: Option<String>,
    /// Residuals row by row: before, after, whitened, block, outlier
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) report: Option<PathBuf>,
    /// The answer as JSON; `-` or nothing for stdout
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) json: Option<PathBuf>,
    /// Page with residuals before and after, the ranking and what remains, complete in one file; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) html: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reading: Reading,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct Plan {
    /// Cell file with [plan]
    #[arg(long, value_name = "CELL", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) cell: PathBuf,
    /// Rows to measure
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(8..=500))]
    pub(in crate::cli) rows: u16,
    /// The program, in the language of the cell's controller: each motion ends where a row is measured; `-` for stdout
    #[arg(long, short, value_name = "PROGRAM", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) output: PathBuf,
    /// The table to fill in: target, load and time of each row, measured columns empty; `-` for stdout
    #[arg(long, value_name = "PLAN.csv", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) measured: Option<PathBuf>,
    /// What the rows can distinguish, as JSON: d' of each pair of effects, chance of the right name; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) json: Option<PathBuf>,
    /// The same as a page, complete in one file; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) html: Option<PathBuf>,
    /// Programs whose targets are the places to choose from, instead of the box of [plan]
    #[arg(long, value_name = "PROGRAM", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub(in crate::cli) pool: Vec<PathBuf>,
    /// Language of the program; left out, that of the cell's controller, and RAPID where the cell does not show it
    #[arg(long, value_name = "LANGUAGE", value_parser = posted)]
    pub(in crate::cli) post: Option<Language>,
    /// Stop with a message until the operator lets the program go on: at each change of the load, or at each target too;
    /// without it the arm waits ten seconds at each target
    #[arg(long, value_name = "WHEN")]
    pub(in crate::cli) ask: Option<AskWhen>,
    /// JSON of an identification: the rows are to decide what it left open
    #[arg(long, value_name = "ID.json", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) after: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reading: Reading,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

/// When the program of a plan waits for the operator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum AskWhen {
    /// Never
    #[default]
    Never,
    /// At each change of the load
    Load,
    /// At each target, and at each change of the load
    Target,
}

impl From<AskWhen> for Ask {
    fn from(when: AskWhen) -> Self {
        match when {
            AskWhen::Never => Self::Never,
            AskWhen::Load => Self::Load,
            AskWhen::Target => Self::Target,
        }
    }
}

/// A language of controllers.
fn posted(word: &str) -> Result<Language, String> {
    let known: Vec<Language> = Language::ALL.into_iter().filter(|language| language.is_edited()).collect();
    let words = || known.iter().map(|language| language.word()).collect::<Vec<_>>().join(", ");
    known.iter().copied().find(|language| language.word() == word).ok_or_else(|| format!("expected one of {}", words()))
}
