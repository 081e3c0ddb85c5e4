//! Outputs, written whole or not at all.
//!
//! A file is staged under a temporary name in its own folder and renamed when everything has succeeded; what goes to
//! stdout waits in memory, or in a temporary file where it is long. What is dropped without [`Outputs::commit`] leaves no
//! trace, nor does a run that is interrupted.

use super::blocks::Blocks;
use deflex::program::detect;
use deflex::text::Diagnostic;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
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
    temporary: Temporary,
    /// The target is no regular file (stdout, a pipe, `/dev/null`): it is written to, not replaced.
    copied: bool,
}

/// A file that goes when this goes, or when the run is interrupted.
#[derive(Debug)]
pub(super) struct Temporary {
    /// Where it is; `None` once it has another name.
    path: Option<PathBuf>,
}

/// The temporary files there are.
static TEMPORARY: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn temporary() -> MutexGuard<'static, Vec<PathBuf>> {
    // A list of paths is whole even where a thread died holding it.
    TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Temporary {
    fn create(path: PathBuf) -> io::Result<(Self, File)> {
        // Listed while the lock is held: an interruption finds every file that there is.
        let mut all = temporary();
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
        all.push(path.clone());
        Ok((Self { path: Some(path) }, file))
    }

    /// A nameless one in the system's folder.
    pub(super) fn spool() -> io::Result<(Self, File)> {
        let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
        Self::create(std::env::temp_dir().join(format!("deflex.{}-{unique}.tmp", std::process::id())))
    }

    /// Its bytes from the start.
    pub(super) fn reopen(&self) -> io::Result<File> {
        self.path.as_ref().map_or_else(|| Err(io::ErrorKind::NotFound.into()), File::open)
    }

    /// Where it is.
    pub(super) fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    fn become_file(&mut self, target: &Path) -> io::Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        let mut all = temporary();
        fs::rename(path, target)?;
        all.retain(|other| other != path);
        self.path = None;
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            // Nothing more can be done about a temporary file that will not go.
            let _ = fs::remove_file(path);
            temporary().retain(|other| other != path);
        }
    }
}

/// Removes temporary files when the run is interrupted, and ends it.
pub(super) fn clean_up_when_interrupted() {
    /// As a shell reports a process that SIGINT ended.
    const INTERRUPTED: i32 = 130;
    // Without a handler an interruption leaves hidden files behind, no half outputs.
    let _ = ctrlc::set_handler(|| {
        // Kept locked: from here on no file gets its name, and none is made.
        let all = temporary();
        for path in all.iter() {
            let _ = fs::remove_file(path);
        }
        #[allow(clippy::exit)] // the other threads hold what their destructors would need
        std::process::exit(INTERRUPTED);
    });
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
        self.stage(path)?.write_all(bytes).map_err(|error| cannot_write(path, &error))
    }

    /// Stages a file, `-` being stdout, that is written as the run goes on; whoever writes it flushes it at the end.
    pub(super) fn open(&mut self, path: &Path) -> Result<Blocks, Vec<Diagnostic>> {
        self.stage(path).map(Blocks::new)
    }

    fn stage(&mut self, path: &Path) -> Result<File, Vec<Diagnostic>> {
        if is_stdout(path) {
            let (temporary, file) = Temporary::spool().map_err(|error| cannot_write(path, &error))?;
            self.staged.push(Staged { target: path.to_owned(), temporary, copied: true });
            return Ok(file);
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
        let (staged, file) = stage(target).map_err(|error| cannot_write(path, &error))?;
        self.staged.push(staged);
        Ok(file)
    }

    /// Stages a report or a summary, which is never meant to take a program's place.
    pub(super) fn add_report(&mut self, path: &Path, bytes: &[u8]) -> Result<(), Vec<Diagnostic>> {
        not_a_program(path)?;
        self.add(path, bytes)
    }

    /// The same, written as the run goes on.
    pub(super) fn open_report(&mut self, path: &Path) -> Result<Blocks, Vec<Diagnostic>> {
        not_a_program(path)?;
        self.open(path)
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
            let (target, copied) = (&staged.target, staged.copied);
            let done = if copied { copy(&staged.temporary, target) } else { staged.temporary.become_file(target) };
            done.map_err(|error| cannot_write(target, &error))?;
        }
        self.made.list().clear();
        print(&self.stdout)
    }

    fn claim(&self, target: &Path) -> Result<(), Vec<Diagnostic>> {
        match self.staged.iter().find(|staged| staged.target == target && !staged.copied) {
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

/// Stdout carries one result.
pub(super) fn one_thing(count: usize) -> Result<(), Vec<Diagnostic>> {
    if count > 1 {
        let message = "more than one result would go to stdout";
        return Err(vec![
            Diagnostic::error("usage.stdout", "", message).help("give -o, --report, --json or --html a file"),
        ]);
    }
    Ok(())
}

/// The file that a path means: through symbolic links, so that the file behind one is replaced, not the link.
fn resolved(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let in_folder = || Some(fs::canonicalize(folder).ok()?.join(path.file_name()?));
    fs::canonicalize(path).ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

fn stage(target: PathBuf) -> io::Result<(Staged, File)> {
    let existing = fs::metadata(&target).ok();
    if existing.as_ref().is_some_and(fs::Metadata::is_dir) {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
    }
    if existing.as_ref().is_some_and(|metadata| !metadata.is_file()) {
        let (temporary, file) = Temporary::spool()?;
        return Ok((Staged { target, temporary, copied: true }, file));
    }
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
    let (temporary, file) = Temporary::create(folder.join(format!(".{name}.{}-{unique}.tmp", std::process::id())))?;
    if let Some(metadata) = existing {
        file.set_permissions(metadata.permissions())?;
    }
    Ok((Staged { target, temporary, copied: false }, file))
}

/// Writes a temporary file's bytes to what cannot be replaced; a reader of stdout that went away is no fault of ours.
fn copy(temporary: &Temporary, target: &Path) -> io::Result<()> {
    let mut from = temporary.reopen()?;
    if !is_stdout(target) {
        return io::copy(&mut from, &mut OpenOptions::new().write(true).open(target)?).map(|_| ());
    }
    let mut stdout = io::stdout().lock();
    match io::copy(&mut from, &mut stdout).and_then(|_| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

fn not_a_program(path: &Path) -> Result<(), Vec<Diagnostic>> {
    /// As much as a language is told from.
    const LOOK: u64 = 64 * 1024;
    let mut start = Vec::new();
    let there = !is_stdout(path) && fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
    let read = there && File::open(path).and_then(|file| file.take(LOOK).read_to_end(&mut start)).is_ok();
    if read && detect("", &start).is_some() {
        return Err(refuse(path, "a program stands there", "choose another name for the report"));
    }
    Ok(())
}

fn refuse(path: &Path, why: &str, help: &str) -> Vec<Diagnostic> {
    vec![Diagnostic::error("io.write", &path.display().to_string(), format!("is not written: {why}")).help(help)]
}

pub(super) fn cannot_write(path: &Path, error: &io::Error) -> Vec<Diagnostic> {
    vec![
        Diagnostic::error("io.write", &path.display().to_string(), format!("cannot be written: {error}"))
            .help("check that the folder exists and that you may write there"),
    ]
}
