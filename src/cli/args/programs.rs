//! Arguments of the commands on programs.

use super::groups::{Common, Corrected, Model, Reading, Reports, language, positive};
use crate::session::Tolerances;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum, ValueHint};
use deflex::correct::RAPID_MM_S;
use deflex::program::Language;
use std::path::PathBuf;
use std::sync::LazyLock;

#[derive(Debug, Args)]
pub(in crate::cli) struct Compensate {
    /// Programs: RAPID modules, .pgf lists, KRL, FANUC TP, URScript, INFORM, CL/APT files; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) model: Model,
    /// Corrected program; `-` or nothing for stdout
    #[arg(long, short, value_name = "FILE", conflicts_with = "out_dir", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) output: Option<PathBuf>,
    /// Folder for corrected programs and their reports (NAME.report.csv); created if missing
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub(in crate::cli) out_dir: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reports: Reports,
    /// What is corrected
    #[arg(long, value_enum, default_value_t, value_name = "WHAT")]
    pub(in crate::cli) correct: Corrected,
    /// Insert targets until at most this error remains between two of them
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) subdivide: Option<f64>,
    /// Keep the driven, loaded path within this distance of the programmed one; needs [controller.path] in the cell, and adds
    /// targets where --subdivide is given
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) max_path_error: Option<f64>,
    /// Where several motions use one declared target and need different corrections: declare a copy for each
    #[arg(long)]
    pub(in crate::cli) allow_clones: bool,
    /// Correct a program that `compensate` has written once more; without it, such a program is refused
    #[arg(long)]
    pub(in crate::cli) again: bool,
    /// CL input: language of the corrected program; `cl` keeps CL data for your own post-processor, `ls` needs frames with numbers in their names
    #[arg(long, value_parser = language(), default_value = Language::Rapid.word(), value_name = "LANGUAGE")]
    pub(in crate::cli) post: Language,
    /// CL input: split into modules of at most this many targets, loaded one after the other
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(in crate::cli) max_targets: Option<u32>,
    /// CL input: speed of rapid travel in the posted program
    #[arg(long, value_name = "MM_S", default_value_t = RAPID_MM_S, value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) rapid_speed: f64,
    /// CL input without a feed: feed of its moves
    #[arg(long, value_name = "MM_S", value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) feed: Option<f64>,
    #[command(flatten)]
    pub(in crate::cli) reading: Reading,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct Predict {
    /// Programs: RAPID modules, .pgf lists, KRL, FANUC TP, URScript, INFORM, CL/APT files; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) model: Model,
    /// The original of a corrected program (or the folder of originals): errors are counted from its targets
    #[arg(long, value_name = "ORIGINAL", value_hint = ValueHint::AnyPath)]
    pub(in crate::cli) against: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reports: Reports,
    /// The path that the controller drives and the loaded arm takes, sampled every 4 ms, in the work object; `-` for stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) path: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reading: Reading,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
    /// Taken for the sake of scripts that share options; a prediction corrects nothing
    #[arg(long, value_enum, default_value_t, hide = true)]
    pub(in crate::cli) correct: Corrected,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct Simulate {
    /// Programs: RAPID modules, .pgf lists, KRL, FANUC TP, URScript, INFORM, CL/APT files; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) model: Model,
    /// The original of a corrected program (or the folder of originals): the part is compared with its programmed shape
    #[arg(long, value_name = "ORIGINAL", value_hint = ValueHint::AnyPath)]
    pub(in crate::cli) against: Option<PathBuf>,
    /// The part as it will be cut, as binary STL; `-` for stdout
    #[arg(long, value_name = "OUT.stl", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) stl: Option<PathBuf>,
    /// Page with the part in 3-D, coloured by its deviation, complete in one file; `-` for stdout
    #[arg(long, value_name = "OUT.html", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) html: Option<PathBuf>,
    /// Points of the surface with their deviation; `-` for stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) report: Option<PathBuf>,
    /// Figures as JSON; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) json: Option<PathBuf>,
    /// Nominal points (x_mm, y_mm, z_mm; nx, ny, nz for their normals) whose deviation goes to --report or stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) probe: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reading: Reading,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}

impl Simulate {
    /// `simulate` writes other reports than the other commands, so the common ones are all off.
    pub(in crate::cli) fn reports(&self) -> Reports {
        Reports { report: None, json: None, html: None, keep_going: false }
    }
}

/// Form of the answer of `check`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum Form {
    #[default]
    Text,
    Json,
    Junit,
    Sarif,
}

/// `--format` of `check`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::cli) enum CheckFormat {
    /// Form of the answer.
    Form(Form),
    /// Kind of the input, as in other commands.
    Input(Language),
}

impl ValueEnum for CheckFormat {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<CheckFormat>> = LazyLock::new(|| {
            let forms = Form::value_variants().iter().map(|form| CheckFormat::Form(*form));
            forms.chain(Language::ALL.map(CheckFormat::Input)).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self {
            Self::Form(form) => form.to_possible_value(),
            Self::Input(language) => Some(PossibleValue::new(language.word()).hide(true)),
        }
    }
}

#[derive(Debug, Args)]
pub(in crate::cli) struct Check {
    /// Programs: RAPID modules, .pgf lists, KRL, FANUC TP, URScript, INFORM, CL/APT files; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) model: Model,
    /// Largest error of a target, and of the path to it unless --max-path-error gives another
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) max_error: f64,
    /// Largest distance from the programmed path between targets (`compensate --subdivide` makes it smaller)
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) max_path_error: Option<f64>,
    /// Largest jump of the tip where the force sets in, ends or turns at once; without it jumps are reported and not judged
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) max_jump: Option<f64>,
    /// Judge only the targets, not the path between them
    #[arg(long, conflicts_with_all = ["max_path_error", "max_jump"])]
    pub(in crate::cli) at_targets: bool,
    /// Pass even if targets cannot be judged
    #[arg(long)]
    pub(in crate::cli) allow_unjudged: bool,
    /// Largest correction of a target
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(in crate::cli) max_correction: Option<f64>,
    /// The original of a corrected program (or the folder of originals): errors are counted from its targets
    #[arg(long, value_name = "ORIGINAL", value_hint = ValueHint::AnyPath)]
    pub(in crate::cli) against: Option<PathBuf>,
    /// Form of the answer on stdout
    #[arg(long, value_enum, value_name = "FORM")]
    pub(in crate::cli) output_format: Option<Form>,
    /// Language of the input, where neither its content nor its ending shows it
    #[arg(long, value_parser = language(), value_name = "KIND")]
    pub(in crate::cli) input_format: Option<Language>,
    /// An old spelling of both
    #[arg(long, value_enum, value_name = "FORM", action = clap::ArgAction::Append, hide = true)]
    pub(in crate::cli) format: Vec<CheckFormat>,
    /// Modules that declare tools, work objects and targets
    #[arg(long, value_name = "FILE", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub(in crate::cli) context: Vec<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reports: Reports,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
    /// What a correction would change, for --max-correction
    #[arg(long, value_enum, default_value_t, value_name = "WHAT")]
    pub(in crate::cli) correct: Corrected,
}

impl Check {
    pub(in crate::cli) fn tolerances(&self) -> Tolerances {
        let &Self { max_error, max_path_error, max_jump, max_correction, at_targets, allow_unjudged, .. } = self;
        Tolerances { max_error, max_path_error, max_jump, max_correction, at_targets, allow_unjudged }
    }
}

#[derive(Debug, Args)]
pub(in crate::cli) struct Diff {
    /// Program before
    #[arg(value_hint = ValueHint::FilePath)]
    pub(in crate::cli) original: PathBuf,
    /// Program after
    #[arg(value_hint = ValueHint::FilePath)]
    pub(in crate::cli) corrected: PathBuf,
    /// Every target that moved as CSV; `-` for stdout
    #[arg(long, value_name = "CSV", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) report: Option<PathBuf>,
    /// All differences as JSON; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) json: Option<PathBuf>,
    /// Page with the toolpath in 3-D and the shifts along it, complete in one file; `-` for stdout
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) html: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reading: Reading,
    /// Print nothing; only the exit code is the answer
    #[arg(long, short)]
    pub(in crate::cli) quiet: bool,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct Inspect {
    /// Programs or folders of programs; `-` for stdin
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::AnyPath)]
    pub(in crate::cli) inputs: Vec<PathBuf>,
    /// What was found as JSON; `-` or nothing for stdout
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-", value_hint = ValueHint::FilePath)]
    pub(in crate::cli) json: Option<PathBuf>,
    #[command(flatten)]
    pub(in crate::cli) reading: Reading,
    #[command(flatten)]
    pub(in crate::cli) common: Common,
}
