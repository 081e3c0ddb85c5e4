//! Options that several commands have.

use crate::session::output::to_stdout;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum, ValueHint};
use deflex::program::Language;
use std::path::PathBuf;

/// Reads the word of a language.
pub(in crate::cli) fn language() -> impl TypedValueParser<Value = Language> {
    let of = |word: String| Language::ALL.into_iter().find(|language| language.word() == word);
    PossibleValuesParser::new(Language::ALL.map(Language::word)).try_map(move |word| of(word).ok_or("no language"))
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum Corrected {
    /// Position and orientation
    #[default]
    Pose,
    /// Position only: the TCP goes to its programmed position, and the numbers of the orientation stay as they are
    Position,
}

/// How inputs are read.
#[derive(Clone, Debug, Args)]
pub(in crate::cli) struct Reading {
    /// Modules that declare tools, work objects and targets; never written
    #[arg(long, value_name = "FILE", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub(in crate::cli) context: Vec<PathBuf>,
    /// Language of the input, where neither its content nor its ending shows it
    #[arg(long = "input-format", alias = "format", value_parser = language(), value_name = "KIND")]
    pub(in crate::cli) format: Option<Language>,
}

/// Options that every run has.
#[derive(Clone, Debug, Args)]
pub(in crate::cli) struct Common {
    /// Number of threads; without it one for each core
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(in crate::cli) jobs: Option<u16>,
    /// No progress, notes or summary on stderr
    #[arg(long, short)]
    pub(in crate::cli) quiet: bool,
}

/// The options of a run that concern the cell and the cut.
#[derive(Clone, Debug, Args)]
pub(in crate::cli) struct Model {
    /// Cell file
    #[arg(long, value_name = "CELL", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) cell: PathBuf,
    /// Forces by target (fx_n, fy_n, fz_n; also time_s, temperature_c, payload_kg); overrides [cut]
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) forces: Option<PathBuf>,
    /// Tool of the cell for every target, instead of the program's
    #[arg(long, value_name = "NAME")]
    pub(in crate::cli) tool: Option<String>,
    /// Choose the turn about the tool axis of RAPID targets for the smallest predicted error (CL: `[cl] spin = "stiffest"`)
    #[arg(long)]
    pub(in crate::cli) free_spin: bool,
}

/// Where reports go.
#[derive(Clone, Debug, Args)]
pub(in crate::cli) struct Reports {
    /// Report, one row per target; `-` for stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) report: Option<PathBuf>,
    /// Summary as JSON; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) json: Option<PathBuf>,
    /// Page with the toolpath in 3-D and the errors along it, complete in one file; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) html: Option<PathBuf>,
    /// Several programs: do those that can be done, list the others, and end with exit code 2 if there are any
    #[arg(long)]
    pub(in crate::cli) keep_going: bool,
}

impl Reports {
    /// How many of them go to stdout.
    pub(in crate::cli) fn to_stdout(&self) -> usize {
        to_stdout([&self.report, &self.json, &self.html].map(Option::as_ref))
    }
}

/// A finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}
