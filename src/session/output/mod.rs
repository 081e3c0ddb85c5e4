//! Writes the outputs of a run completely, or not at all.
//!
//! Each output is first written to a hidden temporary file in its own folder. When the run has succeeded, all temporary
//! files are renamed to their targets as one [set]. Results for stdout wait in memory, or in a temporary file if they
//! are long. If [`Outputs`] are dropped without [`Outputs::commit`], or the run is interrupted, all temporary files are
//! removed. If a run is killed, it cannot remove them; the next run that writes to the folder does.

pub(crate) mod lock;
mod marker;
mod old;
mod place;
mod set;
mod staging;
pub(crate) mod watch;

use super::blocks::Blocks;
use super::file_state::Identity;
use deflex::program::detect;
use deflex::text::{Diagnostic, printable};
use place::{How, Move, folder_of, resolved};
use std::fs::{self, File, OpenOptions};
use std::io::{self, IsTerminal, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// All outputs of one run.
#[derive(Debug, Default)]
pub(crate) struct Outputs {
    // Dropped before `made`, because a folder can be removed only after the files in it.
    staged: Vec<Staged>,
    stdout: Vec<u8>,
    /// Dropped after all other fields.
    made: Arc<Folders>,
}

/// Folders that were created for outputs, shared by all [`Outputs`] that write into them. When the last of these is
/// dropped without a commit, the folders are removed after their files.
#[derive(Debug, Default)]
struct Folders(Mutex<Vec<PathBuf>>);

impl Folders {
    fn list(&self) -> MutexGuard<'_, Vec<PathBuf>> {
        // A panic cannot leave the list half-changed, so a poisoned lock is still usable.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Folders {
    fn drop(&mut self) {
        for folder in self.list().drain(..).rev() {
            let _ = resolved(&folder).map(|folder| staging::leave(&folder));
            // Fails if the folder contains other files by now, which must stay.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// An output in its temporary file.
#[derive(Debug)]
struct Staged {
    target: PathBuf,
    /// Identity of the target.
    identity: Identity,
    temporary: Temporary,
    goes: Goes,
    /// The program of a batch to which it belongs; empty if it belongs to the run.
    program: String,
}

/// The way from the temporary file to the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goes {
    /// The temporary file becomes the target, which is a regular file.
    Into(How),
    /// The content is written to the target, which is not a regular file (stdout, a pipe, `/dev/null`).
    Copied,
}

/// A temporary file, which is removed when this is dropped or when the run is interrupted.
#[derive(Debug)]
pub(crate) struct Temporary {
    path: PathBuf,
}

impl Temporary {
    fn create(folder: &Path) -> io::Result<(Self, File)> {
        staging::create(folder).map(|(path, file)| (Self { path }, file))
    }

    /// A temporary file in the system's folder for temporary files.
    pub(crate) fn spool() -> io::Result<(Self, File)> {
        Self::create(&std::env::temp_dir())
    }

    /// Opens the file at its start.
    pub(crate) fn reopen(&self) -> io::Result<File> {
        File::open(&self.path)
    }

    /// Path of the file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // Fails if the file was renamed to its target. If it cannot be removed for another reason, nothing else can be
        // done.
        let _ = fs::remove_file(&self.path);
        staging::forget(&self.path);
    }
}

/// Prints warnings about outputs on stderr; without it, each is a plain line.
static PRINT: OnceLock<fn(&[Diagnostic])> = OnceLock::new();

/// Sets how warnings about outputs are printed, once in a process. They do not wait for the end of the run.
pub(crate) fn warn_by(print: fn(&[Diagnostic])) {
    let _ = PRINT.set(print);
}

fn warn(diagnostics: &[Diagnostic]) {
    match PRINT.get() {
        Some(print) => print(diagnostics),
        None => diagnostics.iter().for_each(|diagnostic| {
            // If stderr is closed, there is no place left to report the failure.
            let _ = writeln!(io::stderr(), "{diagnostic}");
        }),
    }
}

/// Locked while outputs are renamed: an interruption waits for it.
static PLACING: Mutex<()> = Mutex::new(());

/// Removes the temporary files of a run that is interrupted. No further file is renamed while the returned lock is held, which is until the
/// process ends.
pub(crate) fn interrupted() -> MutexGuard<'static, ()> {
    let placing = PLACING.lock().unwrap_or_else(PoisonError::into_inner);
    staging::leave_for_good();
    placing
}

/// Removes the remaining temporary files when it is dropped at the end of the run.
pub(crate) struct AtTheEnd;

impl Drop for AtTheEnd {
    fn drop(&mut self) {
        staging::leave_all();
    }
}

impl Outputs {
    /// Outputs of another program of the run, which share the created folders.
    pub(crate) fn sibling(&self) -> Self {
        Self { made: Arc::clone(&self.made), ..Self::default() }
    }

    /// Stages bytes for a path; `-` is stdout.
    pub(crate) fn add(&mut self, path: &Path, bytes: &[u8]) -> Result<(), Vec<Diagnostic>> {
        if is_stdout(path) {
            stdout_is_open(path)?;
            self.stdout.extend_from_slice(bytes);
            return Ok(());
        }
        self.stage(path)?.write_all(bytes).map_err(|error| cannot_write(path, &error))
    }

    /// Adds the summary to the text for stdout. Unlike a result, a summary is lost without harm if stdout is closed.
    pub(crate) fn add_summary(&mut self, text: &str) {
        self.stdout.extend_from_slice(text.as_bytes());
    }

    /// Stages an output that is written during the run; `-` is stdout. The caller has to flush the writer at the end.
    pub(crate) fn open(&mut self, path: &Path) -> Result<Blocks, Vec<Diagnostic>> {
        self.stage(path).map(Blocks::new)
    }

    fn stage(&mut self, path: &Path) -> Result<File, Vec<Diagnostic>> {
        if is_stdout(path) {
            stdout_is_open(path)?;
            let (temporary, file) = Temporary::spool().map_err(|error| cannot_write(path, &error))?;
            let identity = Identity::of(path);
            let program = String::new();
            self.staged.push(Staged { target: path.to_owned(), identity, temporary, goes: Goes::Copied, program });
            return Ok(file);
        }
        self.make_folder_of(path).map_err(|error| cannot_write(path, &error))?;
        let target = resolved(path).map_err(|error| cannot_write(path, &error))?;
        let identity = Identity::of(&target);
        not_an_input(path, &identity)?;
        self.claim(path, &identity, "")?;
        let (staged, file) = stage(target, identity).map_err(|error| cannot_write(path, &error))?;
        self.staged.push(staged);
        Ok(file)
    }

    /// Stages a report or a summary if it has a path. It is refused if the target is a program, because reports never replace programs.
    pub(crate) fn add_report<T: AsRef<[u8]>>(
        &mut self,
        path: Option<&PathBuf>,
        make: impl FnOnce() -> Result<T, Vec<Diagnostic>>,
    ) -> Result<(), Vec<Diagnostic>> {
        let Some(path) = path else { return Ok(()) };
        not_a_program(path)?;
        self.add(path, make()?.as_ref())
    }

    /// Stages a report that is written during the run, with the same check.
    pub(crate) fn open_report(&mut self, path: &Path) -> Result<Blocks, Vec<Diagnostic>> {
        not_a_program(path)?;
        self.open(path)
    }

    /// Adds the staged outputs of a program of a batch.
    pub(crate) fn append(&mut self, mut other: Self, program: &str) -> Result<(), Vec<Diagnostic>> {
        for staged in std::mem::take(&mut other.staged) {
            self.claim(&staged.target, &staged.identity, program)?;
            self.staged.push(Staged { program: program.to_owned(), ..staged });
        }
        self.stdout.append(&mut other.stdout);
        Ok(())
    }

    /// Prints the text for stdout and then renames all files to their targets, unless an input has changed since it was
    /// opened.
    pub(crate) fn commit(mut self) -> Result<(), Vec<Diagnostic>> {
        // Some inputs may have been opened after an output was staged.
        self.staged.iter().try_for_each(|staged| not_an_input(&staged.target, &staged.identity))?;
        let files = || self.staged.iter().filter(|staged| staged.goes != Goes::Copied);
        for staged in files() {
            let kept = staged.temporary.reopen().and_then(|file| file.sync_all());
            kept.map_err(|error| cannot_write(&staged.target, &error))?;
        }
        watch::changed()?;
        for staged in self.staged.iter().filter(|staged| staged.goes == Goes::Copied) {
            copy_to_target(&staged.temporary, &staged.target).map_err(|error| cannot_write(&staged.target, &error))?;
        }
        print(&self.stdout)?;
        let go = |staged: &Staged| match staged.goes {
            Goes::Into(how) => {
                Some(Move { temporary: staged.temporary.path.clone(), target: staged.target.clone(), how })
            }
            Goes::Copied => None,
        };
        let moves: Vec<Move> = self.staged.iter().filter_map(go).collect();
        set::put_in_place(&moves).map_err(|(path, error)| cannot_write(&path, &error))?;
        self.made.list().clear();
        self.staged.clear();
        Ok(())
    }

    fn claim(&self, path: &Path, identity: &Identity, program: &str) -> Result<(), Vec<Diagnostic>> {
        match self.staged.iter().find(|staged| staged.identity == *identity && staged.goes != Goes::Copied) {
            Some(other) if other.target == path && ![&other.program, program].contains(&"") => {
                let why = format!("{} and {program} have outputs of this name", other.program);
                Err(refuse(path, &why, "correct them one by one, into a folder for each"))
            }
            Some(other) if other.target == path => {
                Err(refuse(path, "two outputs have this name", "give each output a name of its own"))
            }
            Some(other) => {
                let why = format!("another output goes into the same file, {}", other.target.display());
                Err(refuse(path, &why, "give each output a file of its own"))
            }
            None => Ok(()),
        }
    }

    fn make_folder_of(&mut self, path: &Path) -> io::Result<()> {
        let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.exists()) else {
            return Ok(());
        };
        // Creates only the last folder of the path: if a folder above it is missing, the path is probably mistyped.
        match fs::create_dir(folder) {
            Ok(()) => self.made.list().push(folder.to_owned()),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
        Ok(())
    }
}

/// Writes to stdout. It is not an error if the reader has closed the pipe.
pub(crate) fn print(bytes: &[u8]) -> Result<(), Vec<Diagnostic>> {
    write_to_stdout(bytes).map_err(|error| cannot_write(Path::new("-"), &error))
}

/// Whether a path stands for stdout.
pub(crate) fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// How many outputs go to stdout.
pub(crate) fn to_stdout<'a>(paths: impl IntoIterator<Item = Option<&'a PathBuf>>) -> usize {
    paths.into_iter().flatten().filter(|path| is_stdout(path)).count()
}

/// Refuses a result for a closed stdout, because it would be lost.
fn stdout_is_open(path: &Path) -> Result<(), Vec<Diagnostic>> {
    #[cfg(feature = "cli")]
    let was_closed = deflex_closed_stdout::was_closed();
    // That crate runs a function before `main`, which a program that uses the library may not expect.
    #[cfg(not(feature = "cli"))]
    let was_closed = false;
    if was_closed {
        return Err(refuse(path, "standard output is closed", "name a file, or /dev/null to discard the result"));
    }
    Ok(())
}

/// An error if more than one result would go to stdout.
pub(crate) fn one_thing(count: usize) -> Result<(), Vec<Diagnostic>> {
    if count > 1 {
        let message = "more than one result would go to stdout";
        return Err(vec![
            Diagnostic::error("usage.stdout", "", message).help("give -o, --report, --json or --html a file"),
        ]);
    }
    Ok(())
}

/// Whether a path names a regular file, or no file yet. Reports are not named after devices and pipes.
pub(crate) fn is_file_name(path: &Path) -> bool {
    !is_stdout(path) && fs::metadata(path).map_or(true, |metadata| metadata.is_file())
}

fn stage(target: PathBuf, identity: Identity) -> io::Result<(Staged, File)> {
    let existing = fs::metadata(&target).ok();
    if existing.as_ref().is_some_and(fs::Metadata::is_dir) {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
    }
    if existing.as_ref().is_some_and(|metadata| !metadata.is_file()) {
        let (temporary, file) = Temporary::spool()?;
        return Ok((Staged { target, identity, temporary, goes: Goes::Copied, program: String::new() }, file));
    }
    if let Some(existing) = &existing {
        place::writable(&target, existing)?;
    }
    let (temporary, file) = Temporary::create(folder_of(&target))?;
    let how = existing.map_or(Ok(How::Rename), |existing| place::adopt(&file, &existing))?;
    Ok((Staged { target, identity, temporary, goes: Goes::Into(how), program: String::new() }, file))
}

/// Copies a temporary file to a target that cannot be replaced. It is not an error if the reader of stdout has closed
/// the pipe.
fn copy_to_target(temporary: &Temporary, target: &Path) -> io::Result<()> {
    let mut from = temporary.reopen()?;
    if !is_stdout(target) {
        return io::copy(&mut from, &mut OpenOptions::new().write(true).open(target)?).map(|_| ());
    }
    let mut stdout = io::stdout().lock();
    if stdout.is_terminal() {
        let mut bytes = Vec::new();
        from.read_to_end(&mut bytes)?;
        return write_to_stdout(&bytes);
    }
    match io::copy(&mut from, &mut stdout).and_then(|_| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

/// Writes to stdout. If it is a terminal, control characters are replaced.
fn write_to_stdout(bytes: &[u8]) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    let written = if stdout.is_terminal() {
        stdout.write_all(printable(&String::from_utf8_lossy(bytes)).as_bytes())
    } else {
        stdout.write_all(bytes)
    };
    match written.and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

fn not_a_program(path: &Path) -> Result<(), Vec<Diagnostic>> {
    /// Number of bytes that are enough to recognise a language.
    const LOOK: u64 = 64 * 1024;
    let mut start = Vec::new();
    let there = !is_stdout(path) && fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
    let read = there && File::open(path).and_then(|file| file.take(LOOK).read_to_end(&mut start)).is_ok();
    if read && detect("", &start).is_some() {
        return Err(refuse(
            path,
            "the file contains a robot program, and reports never replace programs",
            "choose another name for the report",
        ));
    }
    Ok(())
}

/// Refuses an output that goes into a file which the run reads.
fn not_an_input(path: &Path, identity: &Identity) -> Result<(), Vec<Diagnostic>> {
    watch::input_that_is(identity).map_or(Ok(()), |input| {
        let why = format!("it is an input of this run, {}", input.display());
        Err(refuse(path, &why, "choose another name: the original is needed again"))
    })
}

pub(crate) fn refuse(path: &Path, why: &str, help: &str) -> Vec<Diagnostic> {
    vec![
        Diagnostic::error("io.write", &path.display().to_string(), format!("the file is not written: {why}"))
            .help(help),
    ]
}

pub(crate) fn cannot_write(path: &Path, error: &io::Error) -> Vec<Diagnostic> {
    let help = match error.kind() {
        io::ErrorKind::TimedOut => "run again when it has ended, or wait longer with `--lock-timeout SECONDS`",
        io::ErrorKind::StorageFull => "make room on the disk",
        _ => "check that the folder exists and that you may write there",
    };
    let (name, message) = match is_stdout(path) {
        true => (String::new(), format!("stdout cannot be written: {error}")),
        false => (path.display().to_string(), format!("the file cannot be written: {error}")),
    };
    Diagnostic::error("io.write", &name, message).help(help).into()
}
