//! What is held, written as the command writes it.

use super::super::file_state::Identity;
use super::super::output::{AtTheEnd, Outputs, refuse};
use deflex::text::Diagnostic;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Writes files as one set, as the command does: all or none, through symbolic links, into files that have other names too, and
/// never over one of the `inputs`.
///
/// # Errors
/// One of them cannot be written, is read-only, is an input, or is another one's file; then all are as before.
pub fn write<'a>(
    files: impl IntoIterator<Item = (PathBuf, &'a [u8])>,
    inputs: impl IntoIterator<Item = impl AsRef<Path>>,
) -> Result<(), Vec<Diagnostic>> {
    /// What waits in a folder is known by the process: one set at a time.
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
