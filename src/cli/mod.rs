//! The command line: turns arguments into the objects of the library, with one file for each command. Only this module prints.
//!
//! [`main`] is the command itself. [`session`](crate::session) returns the results in memory, for programs and notebooks.

mod against;
mod args;
mod batch;
mod check;
mod compensate;
mod diff;
mod generate;
mod identify;
mod init;
mod inspect;
mod message;
mod piped;
mod plan;
mod pose;
mod predict;
mod predicted;
mod progress;
mod report;
mod run;
mod setup;
mod simulate;
mod stream;
mod studio;

use crate::session::output;
use args::{Cli, Command, Common};
use clap::Parser;
use deflex::text::{Diagnostic, Severity};
use std::ffi::OsString;

/// Result of a run that could be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    /// The run is done, and its answer is yes: the check passed, or the programs are equal.
    Yes,
    /// The run is done, and its answer is no.
    No,
}

/// The answer, or the errors for which there is none. In case of errors no output is written.
type Outcome = Result<Answer, Vec<Diagnostic>>;

/// Size of a block that is allocated and freed once at the start, bytes. For reuse, glibc's allocator
/// keeps up to twice the size of the largest block that was ever freed (mallopt(3), dynamic threshold). Without such a
/// block it returns the memory of each chunk to the system, and page faults take a third of the time of a long job.
const KEPT_BYTES: usize = 8 << 20;

/// Runs the command line and returns its exit code, as in `docs/reference.md`. The first argument is the name of the
/// command itself. Call it once in a process, because it sets the number of threads and the handler of interrupts.
///
/// # Examples
/// ```no_run
/// std::process::exit(deflex::cli::main(std::env::args_os()).into());
/// ```
pub fn main(args: impl IntoIterator<Item = OsString>) -> u8 {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(KEPT_BYTES)));
    let args: Vec<OsString> = args.into_iter().collect();
    if let Some(error) = args::name_or_option(&args) {
        message::print(&[error], false);
        return 2;
    }
    let cli = match Cli::try_parse_from(&args) {
        Ok(cli) => cli,
        Err(error) => {
            if error.use_stderr() && *message::FOR_A_PROGRAM {
                // The paragraphs after the first one are the usage, for people.
                let text = error.to_string();
                let first = text.trim_start_matches("error: ").lines().take_while(|line| !line.is_empty());
                let message = first.map(str::trim).collect::<Vec<_>>().join(" ");
                let said = Diagnostic::error("usage.arguments", "", message);
                message::print(&[said.help("`deflex COMMAND --help` lists the options")], false);
                return 2;
            }
            // Help and version are results and go to stdout; errors go to stderr. A closed pipe is not an error.
            let _ = error.print();
            return if error.use_stderr() { 2 } else { 0 };
        }
    };
    output::watch::start();
    output::lock::wait_at_most(cli.lock_timeout);
    output::warn_by(|warnings| message::print(warnings, false));
    clean_up_when_interrupted();
    let _clean = output::AtTheEnd;
    message::print(&old_spellings(&args, &cli.command), common(&cli.command).is_some_and(|common| common.quiet));
    let outcome = threads(&cli.command).and_then(|()| match &cli.command {
        Command::Compensate(args) => compensate::run(args),
        Command::Predict(args) => predict::run(args),
        Command::Simulate(args) => simulate::run(args),
        Command::Diff(args) => diff::run(args),
        Command::Check(args) => check::run(args),
        Command::Identify(args) => identify::run(args),
        Command::Plan(args) => plan::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Init(args) => init::run(args),
        Command::Pose(args) => pose::run(args),
        Command::Studio(args) => studio::run(args),
        Command::Generate(args) => generate::run(args),
    });
    match outcome {
        Ok(Answer::Yes) => 0,
        Ok(Answer::No) => 1,
        Err(errors) => {
            message::print(&errors, false);
            2
        }
    }
}

/// Installs a handler that removes temporary files when the run is interrupted, and then ends the process.
fn clean_up_when_interrupted() {
    /// Exit code that shells use for a process that SIGINT ended.
    const INTERRUPTED: i32 = 130;
    // If no handler can be installed, an interruption leaves temporary files, but no incomplete output.
    let _ = ctrlc::set_handler(|| {
        let _placing = output::interrupted();
        #[allow(clippy::exit)] // the other threads hold what their destructors would need
        std::process::exit(INTERRUPTED);
    });
}

/// Stack size of the threads, equal to the usual size of the main thread's stack. The equilibria of eight targets are
/// computed on the stack, and unoptimised builds hold several copies of them.
const STACK_BYTES: usize = 8 << 20;

/// A note if an option was given with its old name.
fn old_spellings(args: &[OsString], command: &Command) -> Vec<Diagnostic> {
    let is_old = |arg: &OsString| arg == "--format" || arg.to_str().is_some_and(|arg| arg.starts_with("--format="));
    if !args.iter().take_while(|arg| *arg != "--").any(is_old) {
        return Vec::new();
    }
    let help = match command {
        Command::Check(_) => {
            "write --output-format for the form of the answer, and --input-format for the kind of the input"
        }
        _ => "write --input-format",
    };
    let note = Diagnostic::error("usage.format", "", "--format is an old name of this option, and still works");
    vec![note.severity(Severity::Note).help(help)]
}

/// The options that all runs have, if the command has them.
fn common(command: &Command) -> Option<&Common> {
    match command {
        Command::Compensate(args) => Some(&args.common),
        Command::Predict(args) => Some(&args.common),
        Command::Simulate(args) => Some(&args.common),
        Command::Check(args) => Some(&args.common),
        Command::Identify(args) => Some(&args.common),
        Command::Plan(args) => Some(&args.common),
        Command::Inspect(args) => Some(&args.common),
        Command::Diff(_) | Command::Init(_) | Command::Pose(_) | Command::Studio(_) | Command::Generate(_) => None,
    }
}

/// Sets the number of threads from `--jobs`.
fn threads(command: &Command) -> Result<(), Vec<Diagnostic>> {
    let jobs = common(command).and_then(|common| common.jobs);
    // 0 means one thread for each core.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.map_or(0, usize::from)).stack_size(STACK_BYTES);
    pool.build_global().map_err(|error| {
        let threads = jobs.map_or_else(|| "the".to_owned(), |jobs| jobs.to_string());
        vec![
            Diagnostic::error("io.threads", "", format!("{threads} threads cannot be started: {error}"))
                .help("give fewer --jobs"),
        ]
    })
}
