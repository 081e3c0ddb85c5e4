//! The settings that the programs of one `compensate` share, and the paths of their output files.

use super::args::Compensate;
use crate::session::again::Again;
use crate::session::job::Job;
use crate::session::output::{Outputs, is_file_name, is_stdout};
use crate::session::report::Noticed;
use crate::session::setup::Setup;
use crate::session::written::posted_from;
use deflex::correct::PostOptions;
use deflex::report::html::PathTrace;
use deflex::text::Diagnostic;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The settings that all programs of one `compensate` share.
pub(super) struct Batch<'a> {
    pub(super) args: &'a Compensate,
    pub(super) setup: &'a Setup,
    /// Files that no program may be written over.
    pub(super) outputs: &'a Outputs,
    /// An empty path to fill for `--html`.
    pub(super) path: Option<PathTrace>,
    /// Number of programs.
    pub(super) programs: usize,
    /// Names of files without their endings, upper case, that several programs have.
    pub(super) shared: BTreeSet<String>,
}

impl Batch<'_> {
    /// Path of a program's report if no `--report` names one: in the folder of the corrected program. It has the ending of the program too
    /// if the names of several programs differ only in it. `None` if the program is written to stdout, a pipe or a device.
    pub(super) fn default_report(&self, file: &Path) -> Option<PathBuf> {
        let args = self.args;
        match (&args.out_dir, &args.output) {
            (Some(dir), _) if self.shared.contains(&name_alone(file)) => {
                let mut name = file.as_os_str().to_owned();
                name.push(".report.csv");
                Some(dir.join(name))
            }
            (Some(dir), _) => Some(dir.join(file.with_extension("report.csv"))),
            (None, Some(output)) if args.reports.report.is_none() && is_file_name(output) => {
                Some(output.with_extension("report.csv"))
            }
            _ => None,
        }
    }

    /// Collects what the run reports about the rows of a program.
    pub(super) fn noticed(&self, job: &Job) -> Noticed<'_> {
        let files = job.texts.iter().filter(|_| !self.args.again);
        let again = (!self.args.again).then(|| Again::in_folders_of(files.map(|text| Path::new(text.name()))));
        Noticed::new(self.setup.options.forces.as_ref(), again)
    }
}

/// The path to which a file of the program is written.
pub(super) fn place(args: &Compensate, file: &Path) -> PathBuf {
    match &args.out_dir {
        Some(dir) => dir.join(file),
        None => args.output.clone().unwrap_or_else(|| PathBuf::from("-")),
    }
}

/// Names of files without their endings that several programs have, such as those of `part.mod` and `part.prg`.
pub(super) fn shared_names(jobs: &[Job]) -> BTreeSet<String> {
    let (mut known, mut shared) = (BTreeSet::new(), BTreeSet::new());
    for job in jobs {
        let names: BTreeSet<String> = job.files.iter().map(|file| name_alone(file)).collect();
        shared.extend(names.iter().filter(|name| known.contains(*name)).cloned());
        known.extend(names);
    }
    shared
}

/// The name of a file without its ending. Upper and lower case count as the same, as in some file systems.
fn name_alone(file: &Path) -> String {
    file.file_stem().unwrap_or(file.as_os_str()).to_string_lossy().to_uppercase()
}

/// Settings that posting CL data needs, and that CL data do not contain.
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

/// An error if a program of several files has no output folder.
pub(super) fn in_one_file(args: &Compensate, files: usize) -> Result<(), Vec<Diagnostic>> {
    if args.out_dir.is_none() && files > 1 {
        let message = format!("the program is written as {files} files, which need a folder");
        return Err(vec![Diagnostic::error("usage.out-dir", "", message).help("give --out-dir DIR")]);
    }
    Ok(())
}
