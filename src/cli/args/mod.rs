//! The arguments of the command line.

mod cell;
mod groups;
mod measured;
mod programs;

use super::output::lock::DEFAULT_TIMEOUT_S;
use clap::{Parser, Subcommand};
use deflex::text::Diagnostic;
use std::ffi::OsString;
use std::path::Path;

pub(super) use cell::{Generate, Generated, Init, Pose, Studio};
pub(super) use groups::{Common, Corrected, Model, Reports};
pub(super) use measured::{Identify, Plan};
pub(super) use programs::{Check, CheckFormat, Compensate, Diff, Form, Inspect, Predict, Simulate};

/// Makes a robot mill where the program says, and finds out why it does not.
#[derive(Debug, Parser)]
#[command(name = "deflex", version, propagate_version = true, max_term_width = 100, after_help = EXAMPLES, disable_help_subcommand = true)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub(super) command: Command,
    /// How long to wait for a folder that another program keeps locked, s
    #[arg(long, global = true, value_name = "SECONDS", default_value_t = DEFAULT_TIMEOUT_S)]
    pub(super) lock_timeout: u64,
}

/// Refuses an argument that is both an option and the name of a file. A shell replaces `*.mod` by names of files, so a
/// file with the name `--forces=.h.mod` would set an option, and could make a check pass.
pub(super) fn name_or_option(args: &[OsString]) -> Option<Diagnostic> {
    let options = args.iter().skip(1).take_while(|arg| *arg != "--");
    let mut doubtful = options.filter(|arg| arg.len() > 1 && arg.as_encoded_bytes().starts_with(b"-"));
    let name = doubtful.find(|arg| Path::new(arg).symlink_metadata().is_ok())?.to_string_lossy();
    let message = format!("`{name}` reads as an option, but it is also the name of a file here");
    let help = format!(
        "put `--` before the names of files, or write ./{name} for the file; rename the file if you mean the option"
    );
    Some(Diagnostic::error("usage.name", "", message).help(help))
}

const EXAMPLES: &str = "\
Examples:
  deflex init --robot irb6660-205-1.9 > cell.toml          a cell file to start from
  deflex inspect part.mod                                  what is understood of a program
  deflex predict part.mod --cell cell.toml                 the error of the part without a correction
  deflex compensate part.mod --cell cell.toml -o out.mod   the corrected program
  deflex diff part.mod out.mod                             what changed
  deflex plan --cell cell.toml --rows 24 -o plan.mod --measured plan.csv
                                                           what to measure on the real robot
  deflex identify --run part.mod measured.csv --cell cell.toml -o cell2.toml
                                                           which effect the cell file lacks

Exit codes: 0 done; 1 done, and `check` or `diff` found something; 2 failed, nothing was written.";

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Correct programs so that the loaded tool goes where they say
    #[command(after_help = COMPENSATE)]
    Compensate(Compensate),
    /// Report the errors of a program as it is, without a correction
    #[command(after_help = PREDICT)]
    Predict(Predict),
    /// Cut the stock in the computer with the poses that the loaded arm takes: the part and its deviation, before you cut it
    #[command(after_help = SIMULATE)]
    Simulate(Simulate),
    /// List what changed between two programs, target by target
    #[command(after_help = "Exit code 1 if anything differs. Quaternions of opposite sign are the same orientation.")]
    Diff(Diff),
    /// Check whether each target and the path to it is within tolerance and the limits of the robot
    #[command(after_help = CHECK)]
    Check(Check),
    /// Find the effect that the cell file lacks from measured points, and write an extended cell file
    #[command(after_help = IDENTIFY)]
    Identify(Identify),
    /// Plan a measurement that can distinguish effects: a program to run, and a table to fill in
    #[command(after_help = PLAN)]
    Plan(Plan),
    /// Show what deflex understands of programs; needs no cell file
    #[command(after_help = INSPECT)]
    Inspect(Inspect),
    /// Print a commented cell file to start from
    #[command(
        after_help = "Replace each value that is marked `# <<` by that of your cell, and delete the mark. Each run warns about the marks that are left."
    )]
    Init(Init),
    /// Convert joint angles to a TCP pose and back, to compare the cell file's robot with the pendant
    #[command(after_help = POSE)]
    Pose(Pose),
    /// Open a window in the browser, to work with the cells, programs and results of a folder without a shell
    #[command(after_help = STUDIO)]
    Studio(Studio),
    /// Write completions for a shell, or manual pages
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
  deflex predict out.mod --cell cell.toml --against part.mod     errors of a corrected program";

const SIMULATE: &str = "\
Examples:
  deflex simulate part.mod --cell cell.toml --html part.html                    how far the part will be off, and where
  deflex simulate out.mod --cell cell.toml --against part.mod --html part.html  before and after a correction
  deflex simulate part.mod --cell cell.toml --probe points.csv                  a virtual CMM

The cell needs [stock], and a cutter for each tool that cuts it. Points are in the axes of the stock's work object.";

const CHECK: &str = "\
Examples:
  deflex check part.mod --cell cell.toml --max-error 0.1
  deflex check corrected/*.mod --cell cell.toml --against original --max-error 0.02 --output-format sarif > check.sarif

Exit code 1 if a target is out of tolerance, not reached, over a limit, without equilibrium or not judged.";

const IDENTIFY: &str = "\
Examples:
  deflex identify --run part.mod measured.csv --cell cell.toml -o cell2.toml
  deflex identify --run a.mod a.csv --run b.mod b.csv --cell cell.toml --json found.json
  deflex identify --poses tracker.csv --cell cell.toml           rows with their own motor angles

Errors before and after are those of held-out rows, which no fit has seen.";

const PLAN: &str = "\
Examples:
  deflex plan --cell cell.toml --rows 24 -o plan.mod --measured plan.csv      then run, measure, fill in the table, and
  deflex identify --run plan.mod plan.csv --cell cell.toml
  deflex plan --cell cell.toml --rows 12 -o part.mod --pool production.mod    only places of a production program
  deflex plan --cell cell.toml --rows 12 -o next.mod --after found.json       what an identification left undecided

The cell's [plan] says where the tool may go, which loads can be applied and which instrument measures (docs/formats.md).";

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

const STUDIO: &str = "\
Examples:
  deflex studio                                the window of this folder
  deflex studio parts/housing --no-browser     prints the address; open it yourself

Only this machine reaches the window, with the key in the address. Ctrl-C closes it.";

const GENERATE: &str = "\
Folders in which the shells and man look (create them first):
  deflex generate completions bash > ~/.local/share/bash-completion/completions/deflex
  deflex generate completions zsh > ~/.zfunc/_deflex
  deflex generate completions fish > ~/.config/fish/completions/deflex.fish
  deflex generate man ~/.local/share/man/man1

For zsh, put `fpath+=~/.zfunc` before `compinit` in ~/.zshrc. Then: man deflex-compensate";
