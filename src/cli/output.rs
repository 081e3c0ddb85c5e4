//! Outputs, written whole or not at all.
//!
//! A file is staged under a temporary name in its own folder and renamed when everything has succeeded; what goes to
//! stdout waits in memory. What is dropped without [`Outputs::commit`] leaves no trace.

use deflex::program::detect;
use deflex::text::Diagnostic;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Everything that one run writes.
#[derive(Debug, Default)]
pub(super) struct Outputs {
    // Dropped before `made`: a folder goes when its files are gone.
    staged: Vec<Staged>,
    stdout: Vec<u8>,
    /// Files that the run reads, which it never writes over.
    inputs: Vec<PathBuf>,
    /// Dropped last of all fields.
    made: Arc<Folders>,
}

/// Folders made for outputs, shared by all that stage into them: when the last of these is gone without a commit, so
/// are its files, and the folders go too.
#[derive(Debug, Default)]
struct Folders(Mutex<Vec<PathBuf>>);

impl Folders {
    fn list(&self) -> MutexGuard<'_, Vec<PathBuf>> {
        // A list of paths is whole even where a thread died holding it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Folders {
    fn drop(&mut self) {
        for folder in self.list().drain(..).rev() {
            // Fails where something else came to lie in it, as it should.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// A file that waits for its name.
#[derive(Debug)]
struct Staged {
    target: PathBuf,
    /// `None` once renamed, and where the target is no regular file (a pipe, `/dev/null`).
    temporary: Option<PathBuf>,
    /// Bytes for a target that cannot be renamed to.
    direct: Vec<u8>,
}

impl Drop for Staged {
    fn drop(&mut self) {
        if let Some(temporary) = &self.temporary {
            // Nothing more can be done about a temporary file that will not go.
            let _ = fs::remove_file(temporary);
        }
    }
}

/// Distinguishes the temporary files of one process.
static COUNTER: AtomicUsize = AtomicUsize::new(0);

impl Outputs {
    /// Outputs of a run that reads `inputs`.
    pub(super) fn new<'a>(inputs: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        let inputs = inputs.into_iter().filter_map(|path| fs::canonicalize(path).ok()).collect();
        Self { inputs, ..Self::default() }
    }

    /// Another one over the same inputs.
    pub(super) fn sibling(&self) -> Self {
        Self { inputs: self.inputs.clone(), made: Arc::clone(&self.made), ..Self::default() }
    }

    /// Stages bytes for a path, `-` being stdout.
    pub(super) fn add(&mut self, path: &Path, bytes: &[u8]) -> Result<(), Vec<Diagnostic>> {
        if is_stdout(path) {
            self.stdout.extend_from_slice(bytes);
            return Ok(());
        }
        self.make_folder_of(path).map_err(|error| cannot_write(path, &error))?;
        let target = resolved(path);
        if self.inputs.contains(&target) {
            return Err(refuse(
                path,
                "it is an input of this run",
                "choose another name: the original is needed again",
            ));
        }
        self.claim(&target)?;
        let staged = stage(target, bytes).map_err(|error| cannot_write(path, &error))?;
        self.staged.push(staged);
        Ok(())
    }

    /// Stages a report or a summary, which is never meant to take a program's place.
    pub(super) fn add_report(&mut self, path: &Path, bytes: &[u8]) -> Result<(), Vec<Diagnostic>> {
        let program = !is_stdout(path) && fs::read(path).is_ok_and(|old| detect("", &old).is_some());
        if program {
            return Err(refuse(path, "a program stands there", "choose another name for the report"));
        }
        self.add(path, bytes)
    }

    /// Takes over what another has staged.
    pub(super) fn append(&mut self, mut other: Self) -> Result<(), Vec<Diagnostic>> {
        for staged in std::mem::take(&mut other.staged) {
            self.claim(&staged.target)?;
            self.staged.push(staged);
        }
        self.stdout.append(&mut other.stdout);

        Ok(())
    }

    /// Gives every file its name, then prints.
    pub(super) fn commit(mut self) -> Result<(), Vec<Diagnostic>> {
        for staged in &mut self.staged {
            let done = match &staged.temporary {
                Some(temporary) => fs::rename(temporary, &staged.target),
                None => {
                    OpenOptions::new().write(true).open(&staged.target).and_then(|mut f| f.write_all(&staged.direct))
                }
            };
            done.map_err(|error| cannot_write(&staged.target, &error))?;
            staged.temporary = None;
        }
        self.made.list().clear();
        print(&self.stdout)
    }

    fn claim(&self, target: &Path) -> Result<(), Vec<Diagnostic>> {
        match self.staged.iter().find(|staged| staged.target == target && staged.temporary.is_some()) {
            Some(_) => Err(refuse(target, "two outputs have this name", "give each output a name of its own")),
            None => Ok(()),
        }
    }

    fn make_folder_of(&mut self, path: &Path) -> io::Result<()> {
        let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.exists()) else {
            return Ok(());
        };
        // Only the last part: a path that is wrong higher up is a slip, not a wish.
        match fs::create_dir(folder) {
            Ok(()) => self.made.list().push(folder.to_owned()),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
        Ok(())
    }
}

/// Writes to stdout; a reader that went away is no fault of ours.
pub(super) fn print(bytes: &[u8]) -> Result<(), Vec<Diagnostic>> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(cannot_write(Path::new("-"), &error)),
        _ => Ok(()),
    }
}

/// Whether a path stands for stdout.
pub(super) fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// The file that a path means: through symbolic links, so that the file behind one is replaced, not the link.
fn resolved(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let in_folder = || Some(fs::canonicalize(folder).ok()?.join(path.file_name()?));
    fs::canonicalize(path).ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

fn stage(target: PathBuf, bytes: &[u8]) -> io::Result<Staged> {
    let existing = fs::metadata(&target).ok();
    if existing.as_ref().is_some_and(fs::Metadata::is_dir) {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
    }
    if existing.as_ref().is_some_and(|metadata| !metadata.is_file()) {
        return Ok(Staged { target, temporary: None, direct: bytes.to_vec() });
    }
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
    let temporary = folder.join(format!(".{name}.{}-{unique}.tmp", std::process::id()));
    let file = OpenOptions::new().write(true).create_new(true).open(&temporary)?;
    // From here on, what fails removes the temporary file.
    let staged = Staged { target, temporary: Some(temporary), direct: Vec::new() };
    fill(file, bytes)?;
    if let (Some(metadata), Some(temporary)) = (existing, &staged.temporary) {
        fs::set_permissions(temporary, metadata.permissions())?;
    }
    Ok(staged)
}

fn fill(file: File, bytes: &[u8]) -> io::Result<()> {
    let mut out = BufWriter::new(file);
    out.write_all(bytes)?;
    out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

fn refuse(path: &Path, why: &str, help: &str) -> Vec<Diagnostic> {
    vec![Diagnostic::error("io.write", &path.display().to_string(), format!("is not written: {why}")).help(help)]
}

fn cannot_write(path: &Path, error: &io::Error) -> Vec<Diagnostic> {
    vec![
        Diagnostic::error("io.write", &path.display().to_string(), format!("cannot be written: {error}"))
            .help("check that the folder exists and that you may write there"),
    ]
}
