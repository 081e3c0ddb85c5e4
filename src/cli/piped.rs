//! Stores a program that comes through a pipe, because a pipe can be read only once.

use crate::session::context::Context;
use crate::session::job::{self, Job, Looked};
use crate::session::output::{Temporary, is_stdout};
use crate::session::text::Text;
use deflex::program::Language;
use deflex::text::{Diagnostic, cannot_read};
use std::fs::{self, File};
use std::io;
use std::path::PathBuf;

/// The content of a pipe in a temporary file, so that it can be read twice.
pub(super) struct Piped {
    /// Path as the user typed it.
    path: PathBuf,
    spooled: Temporary,
}

impl Piped {
    /// Reads the program if it is the only input and comes through a pipe.
    pub(super) fn new(inputs: &[PathBuf]) -> Result<Option<Self>, Vec<Diagnostic>> {
        let [path] = inputs else { return Ok(None) };
        // A named pipe, or a pipe that the shell made for a process substitution.
        let pipe = fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir());
        if !is_stdout(path) && !pipe {
            return Ok(None);
        }
        let spooled = Temporary::spool().and_then(|(spooled, mut file)| {
            if is_stdout(path) {
                io::copy(&mut io::stdin().lock(), &mut file)?;
            } else {
                io::copy(&mut File::open(path)?, &mut file)?;
            }
            Ok(Self { path: path.clone(), spooled })
        });
        spooled.map(Some).map_err(|error| cannot_read(&path.display().to_string(), &error))
    }

    fn job(&self, format: Option<Language>) -> Result<Job, Vec<Diagnostic>> {
        let path = self.spooled.path().to_owned();
        Job::of_text(Text::File { name: self.path.display().to_string(), path }, &self.path, format)
    }
}

/// Groups the inputs into programs. One of them may have come through a pipe.
pub(super) fn jobs(
    piped: Option<&Piped>,
    inputs: &[PathBuf],
    format: Option<Language>,
    keep_going: bool,
    context: &Context,
) -> Result<Looked, Vec<Diagnostic>> {
    match piped {
        Some(piped) => piped.job(format).map(|job| (vec![job], Vec::new())),
        None if keep_going => job::jobs_that_can_be(inputs, format, context),
        None => job::jobs(inputs, format, context).map(|jobs| (jobs, Vec::new())),
    }
}
