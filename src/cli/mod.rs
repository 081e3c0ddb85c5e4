//! The command line: arguments to ready objects to one file per command. The only code that reads, writes and prints.
//!
//! [`main`] is the command itself. [`session`] does the same with the results in memory, for callers that are no shell.

mod again;
mod against;
mod args;
mod batch;
mod blocks;
mod check;
mod compensate;
mod diff;
mod file_state;
mod files;
mod forces;
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
mod plan;
mod pose;
mod predict;
mod predicted;
mod progress;
mod report;
mod run;
pub mod session;
mod setup;
mod simulate;
mod stream;
mod studio;
mod text;
mod watch;

use args::{Cli, Command, Common};
use clap::Parser;
use deflex::text::{Diagnostic, Severity};
use std::ffi::OsString;

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

/// glibc's allocator keeps freed room of up to twice the largest block that was once given back (mallopt(3), dynamic
/// threshold); before, it gives every chunk's room back to the system, and page faults are a third of a long job.
const KEPT_BYTES: usize = 8 << 20;

/// Runs the command line, of which the first argument is the command's own name: reads and writes what it says, and gives the
/// exit code, which is that of `docs/reference.md`. Once in a process: it sets the threads and what an interrupt does.
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
            // Help and version are results on stdout, the rest is bad usage on stderr; a closed pipe is no fault.
            let _ = error.print();
            return if error.use_stderr() { 2 } else { 0 };
        }
    };
    watch::start();
    output::lock::wait_at_most(cli.lock_timeout);
    output::clean_up_when_interrupted();
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

/// As much as the main thread has: equilibria of eight targets at once stand on the stack, in unoptimised builds several times
/// over.
const STACK_BYTES: usize = 8 << 20;

/// A note where an option has another name by now.
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
    let said = Diagnostic::error("usage.format", "", "--format is an old spelling, which goes on working");
    vec![said.severity(Severity::Note).help(help)]
}

/// Options that every run has.
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

/// `--jobs`.
fn threads(command: &Command) -> Result<(), Vec<Diagnostic>> {
    let jobs = common(command).and_then(|common| common.jobs);
    // 0 is as many as there are cores.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.map_or(0, usize::from)).stack_size(STACK_BYTES);
    pool.build_global().map_err(|error| {
        let threads = jobs.map_or_else(|| "the".to_owned(), |jobs| jobs.to_string());
        vec![
            Diagnostic::error("io.threads", "", format!("{threads} threads cannot be started: {error}"))
                .help("give fewer --jobs"),
        ]
    })
}
