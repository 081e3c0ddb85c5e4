//! What the programs of a `compensate` have in common, and where each of their files goes.

use super::again::Again;
use super::args::Compensate;
use super::job::Job;
use super::output::{Outputs, is_file_name, is_stdout};
use super::report::Noticed;
use super::setup::Setup;
use deflex::correct::{PostOptions, RAPID_MM_S};
use deflex::program::Language;
use deflex::report::html::PathTrace;
use deflex::text::Diagnostic;
use std::path::{Path, PathBuf};

/// What all programs of a `compensate` have in common.
pub(super) struct Batch<'a> {
    pub(super) args: &'a Compensate,
    pub(super) setup: &'a Setup,
    /// What none may write over.
    pub(super) outputs: &'a Outputs,
    /// An empty path, for `--html`.
    pub(super) path: Option<PathTrace>,
    /// How many they are.
    pub(super) programs: usize,
}

impl Batch<'_> {
    /// What is watched for in the rows of a program.
    pub(super) fn noticed(&self, job: &Job) -> Noticed<'_> {
        let files = job.texts.iter().filter(|_| !self.args.again);
        let again = (!self.args.again).then(|| Again::beside(files.map(|text| Path::new(text.name()))));
        Noticed::new(self.setup.options.forces.as_ref(), again)
    }
}

/// Where a file of the program goes.
pub(super) fn place(args: &Compensate, file: &Path) -> PathBuf {
    match &args.out_dir {
        Some(dir) => dir.join(file),
        None => args.output.clone().unwrap_or_else(|| PathBuf::from("-")),
    }
}

/// Where a program's report goes that no `--report` names: into the program's folder, unless the program goes to stdout, a pipe or a device.
pub(super) fn report_beside(args: &Compensate, file: &Path) -> Option<PathBuf> {
    match (&args.out_dir, &args.output) {
        (Some(dir), _) => Some(dir.join(file.with_extension("report.csv"))),
        (None, Some(output)) if args.reports.report.is_none() && is_file_name(output) => {
            Some(output.with_extension("report.csv"))
        }
        _ => None,
    }
}

/// What the RAPID program made of CL input has that CL data do not say.
pub(super) fn post_options(args: &Compensate, file: &Path) -> PostOptions {
    let named = args.output.as_deref().filter(|path| !is_stdout(path)).unwrap_or(file);
    PostOptions {
        max_targets: args.max_targets.map(|most| most as usize),
        rapid_mm_s: args.rapid_speed,
        feed_mm_s: args.feed,
        language: args.post,
        ..posted_from(file, named)
    }
}

/// The same for a program that is called as its file is named.
pub(super) fn posted_from(file: &Path, named: &Path) -> PostOptions {
    let stem = named.file_stem().unwrap_or(named.as_os_str()).to_string_lossy().into_owned();
    PostOptions {
        name: if stem == "-" { "program".to_owned() } else { stem },
        title: vec![format!("posted by deflex {} from {}", env!("CARGO_PKG_VERSION"), file.display())],
        max_targets: None,
        rapid_mm_s: RAPID_MM_S,
        feed_mm_s: None,
        language: Language::Rapid,
    }
}

/// A program of several files needs a folder.
pub(super) fn in_one_file(args: &Compensate, files: usize) -> Result<(), Vec<Diagnostic>> {
    if args.out_dir.is_none() && files > 1 {
        let message = format!("the program is written as {files} files, which need a folder");
        return Err(vec![Diagnostic::error("usage.out-dir", "", message).help("give --out-dir DIR")]);
    }
    Ok(())
}
