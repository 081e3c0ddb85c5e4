//! Writes results that are in memory, with the same guarantees as the command.

use super::file_state::Identity;
use super::output::{AtTheEnd, Outputs, refuse};
use deflex::text::Diagnostic;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Writes files as one set, as the command does: all of them or none. It writes through symbolic links, keeps further
/// hard links of a file, and refuses to write over one of the `inputs`.
///
/// # Errors
/// A file cannot be written, is read-only, is an input, or is named twice. All files are then as before.
///
/// # Examples
/// ```no_run
/// use deflex::session::{CellFile, ProgramFiles, Run, compensate, write};
///
/// let program = ProgramFiles::read(&["part.mod".into()], &[], None)?;
/// let done = compensate(&program, &Run::new(CellFile::read("cell.toml".as_ref())?.into()))?;
/// let files = [("corrected.mod".into(), &done.files[0].1[..]), ("corrected.csv".into(), &done.csv[..])];
/// write(files, ["part.mod", "cell.toml"])?;
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn write<'a>(
    files: impl IntoIterator<Item = (PathBuf, &'a [u8])>,
    inputs: impl IntoIterator<Item = impl AsRef<Path>>,
) -> Result<(), Vec<Diagnostic>> {
    /// The staged files in a folder carry the id of the process, so the process writes one set at a time.
    static ONE_SET: Mutex<()> = Mutex::new(());
    let _one = ONE_SET.lock().unwrap_or_else(PoisonError::into_inner);
    let _clean = AtTheEnd;
    let inputs: Vec<Identity> = inputs.into_iter().map(|input| Identity::of(input.as_ref())).collect();
    let mut outputs = Outputs::default();
    for (path, bytes) in files {
        if inputs.contains(&Identity::of(&path)) {
            let help = "choose another name: the original is needed again";
            return Err(refuse(&path, "it is an input of this run", help));
        }
        outputs.add(&path, bytes)?;
    }
    outputs.commit()
}
