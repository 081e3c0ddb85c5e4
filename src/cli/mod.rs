//! Arguments to ready objects to one file per command: the only code that reads, writes and prints.

mod against;
mod args;
mod blocks;
mod check;
mod compensate;
mod diff;
mod forces;
mod foresee;
mod generate;
mod identify;
mod init;
mod input;
mod inspect;
mod job;
mod lines;
mod message;
mod output;
mod piped;
mod predict;
mod progress;
mod report;
mod run;
mod stream;

use args::{Cli, Command, Common};
use clap::Parser;
use deflex::text::Diagnostic;
use std::process::ExitCode;

/// What a run came to, when it could be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    /// Done; in order; the same.
    Yes,
    /// Done, and the answer is no.
    No,
}

/// An answer, or why there is none; nothing is written then.
type Outcome = Result<Answer, Vec<Diagnostic>>;

/// Runs the command line (INTERFACE: exit codes 0, 1 and 2).
pub(crate) fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are results on stdout, the rest is bad usage on stderr; a closed pipe is no fault.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    output::clean_up_when_interrupted();
    let outcome = threads(&cli.command).and_then(|()| match &cli.command {
        Command::Compensate(args) => compensate::run(args),
        Command::Predict(args) => predict::run(args),
        Command::Diff(args) => diff::run(args),
        Command::Check(args) => check::run(args),
        Command::Identify(args) => identify::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Init(args) => init::run(args),
        Command::Generate(args) => generate::run(args),
    });
    match outcome {
        Ok(Answer::Yes) => ExitCode::SUCCESS,
        Ok(Answer::No) => ExitCode::from(1),
        Err(errors) => {
            message::print(&errors, false);
            ExitCode::from(2)
        }
    }
}

/// `--jobs`.
fn threads(command: &Command) -> Result<(), Vec<Diagnostic>> {
    let common: Option<&Common> = match command {
        Command::Compensate(args) => Some(&args.common),
        Command::Predict(args) => Some(&args.common),
        Command::Check(args) => Some(&args.common),
        Command::Identify(args) => Some(&args.common),
        Command::Inspect(args) => Some(&args.common),
        Command::Diff(_) | Command::Init(_) | Command::Generate(_) => None,
    };
    let Some(jobs) = common.and_then(|common| common.jobs) else { return Ok(()) };
    rayon::ThreadPoolBuilder::new().num_threads(usize::from(jobs)).build_global().map_err(|error| {
        vec![
            Diagnostic::error("io.threads", "", format!("{jobs} threads cannot be started: {error}"))
                .help("give fewer --jobs"),
        ]
    })
}
