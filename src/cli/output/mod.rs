//! Outputs, written whole or not at all.
//!
//! A file is staged under a temporary name in its own folder; when everything has succeeded, all get their names as one
//! [set]. What goes to stdout waits in memory, or in a temporary file where it is long. What is dropped without
//! [`Outputs::commit`] leaves no trace, nor does a run that is interrupted; what a killed one leaves, the next removes.

pub(super) mod lock;
pub(super) mod marker;
mod old;
mod place;
mod set;
mod staging;

use super::blocks::Blocks;
use super::file_state::Identity;
use super::watch;
use deflex::program::detect;
use deflex::text::{Diagnostic, printable};
use place::{How, Move, folder_of, resolved};
use std::fs::{self, File, OpenOptions};
use std::io::{self, IsTerminal, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Everything that one run writes.
#[derive(Debug, Default)]
pub(super) struct Outputs {
    // Dropped before `made`: a folder goes when its files are gone.
    staged: Vec<Staged>,
    stdout: Vec<u8>,
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
            let _ = resolved(&folder).map(|folder| staging::leave(&folder));
            // Fails where something else came to lie in it, as it should.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// A file that waits for its name.
#[derive(Debug)]
struct Staged {
    target: PathBuf,
    /// Of the target.
    identity: Identity,
    temporary: Temporary,
    goes: Goes,
}

/// How a staged file gets where it belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goes {
    /// It becomes the target, a regular file.
    Into(How),
    /// The target is none (stdout, a pipe, `/dev/null`): it is written to.
    Poured,
}

/// A file that goes when this goes, or when the run is interrupted.
#[derive(Debug)]
pub(super) struct Temporary {
    path: PathBuf,
}

impl Temporary {
    fn create(folder: &Path) -> io::Result<(Self, File)> {
        staging::create(folder).map(|(path, file)| (Self { path }, file))
    }

    /// One in the system's folder for them.
    pub(super) fn spool() -> io::Result<(Self, File)> {
        Self::create(&std::env::temp_dir())
    }

    /// Its bytes from the start.
    pub(super) fn reopen(&self) -> io::Result<File> {
        File::open(&self.path)
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // It has another name by now, or nothing more can be done about it.
        let _ = fs::remove_file(&self.path);
        staging::forget(&self.path);
    }
}

/// Held while outputs get their names: an interruption waits for that.
static PLACING: Mutex<()> = Mutex::new(());

/// Removes temporary files when the run is interrupted, and ends it.
pub(super) fn clean_up_when_interrupted() {
    /// As a shell reports a process that SIGINT ended.
    const INTERRUPTED: i32 = 130;
    // Without a handler, an interruption leaves hidden files, but no incomplete output.
    let _ = ctrlc::set_handler(|| {
        // Kept locked: from here on no file gets its name, and none is made.
        let _placing = PLACING.lock().unwrap_or_else(PoisonError::into_inner);
        staging::leave_for_good();
        #[allow(clippy::exit)] // the other threads hold what their destructors would need
        std::process::exit(INTERRUPTED);
    });
}

/// Removes what still waits when this goes, at the end of the run.
pub(super) struct AtTheEnd;

impl Drop for AtTheEnd {
    fn drop(&mut self) {
        staging::leave_all();
    }
}

impl Outputs {
    /// Another one, which makes the same folders.
    pub(super) fn sibling(&self) -> Self {
        Self { made: Arc::clone(&self.made), ..Self::default() }
    }

    /// Stages bytes for a path, `-` being stdout.
    pub(super) fn add(&mut self, path: &Path, bytes: &[u8]) -> Result<(), Vec<Diagnostic>> {
        if is_stdout(path) {
            stdout_is_open(path)?;
            self.stdout.extend_from_slice(bytes);
            return Ok(());
        }
        self.stage(path)?.write_all(bytes).map_err(|error| cannot_write(path, &error))
    }

    /// Stages the summary for stdout. Unlike a result, it is only for a reader: where stdout is closed there is none, and nothing is lost.
    pub(super) fn add_summary(&mut self, text: &str) {
        self.stdout.extend_from_slice(text.as_bytes());
    }

    /// Stages a file, `-` being stdout, that is written as the run goes on; its writer flushes it at the end.
    pub(super) fn open(&mut self, path: &Path) -> Result<Blocks, Vec<Diagnostic>> {
        self.stage(path).map(Blocks::new)
    }

    fn stage(&mut self, path: &Path) -> Result<File, Vec<Diagnostic>> {
        if is_stdout(path) {
            stdout_is_open(path)?;
            let (temporary, file) = Temporary::spool().map_err(|error| cannot_write(path, &error))?;
            let identity = Identity::of(path);
            self.staged.push(Staged { target: path.to_owned(), identity, temporary, goes: Goes::Poured });
            return Ok(file);
        }
        self.make_folder_of(path).map_err(|error| cannot_write(path, &error))?;
        let target = resolved(path).map_err(|error| cannot_write(path, &error))?;
        let identity = Identity::of(&target);
        not_an_input(path, &identity)?;
        self.claim(path, &identity)?;
        let (staged, file) = stage(target, identity).map_err(|error| cannot_write(path, &error))?;
        self.staged.push(staged);
        Ok(file)
    }

    /// Stages a report or a summary if it has a path. It is never meant to take a program's place.
    pub(super) fn add_report<T: AsRef<[u8]>>(
        &mut self,
        path: Option<&PathBuf>,
        make: impl FnOnce() -> Result<T, Vec<Diagnostic>>,
    ) -> Result<(), Vec<Diagnostic>> {
        let Some(path) = path else { return Ok(()) };
        not_a_program(path)?;
        self.add(path, make()?.as_ref())
    }

    /// The same, written as the run goes on.
    pub(super) fn open_report(&mut self, path: &Path) -> Result<Blocks, Vec<Diagnostic>> {
        not_a_program(path)?;
        self.open(path)
    }

    /// Takes over what another has staged.
    pub(super) fn append(&mut self, mut other: Self) -> Result<(), Vec<Diagnostic>> {
        for staged in std::mem::take(&mut other.staged) {
            self.claim(&staged.target, &staged.identity)?;
            self.staged.push(staged);
        }
        self.stdout.append(&mut other.stdout);
        Ok(())
    }

    /// Prints, then gives every file its name, if the inputs are still what they were.
    pub(super) fn commit(mut self) -> Result<(), Vec<Diagnostic>> {
        // Some inputs may have been opened after an output was staged.
        self.staged.iter().try_for_each(|staged| not_an_input(&staged.target, &staged.identity))?;
        let files = || self.staged.iter().filter(|staged| staged.goes != Goes::Poured);
        for staged in files() {
            let kept = staged.temporary.reopen().and_then(|file| file.sync_all());
            kept.map_err(|error| cannot_write(&staged.target, &error))?;
        }
        watch::changed()?;
        for staged in self.staged.iter().filter(|staged| staged.goes == Goes::Poured) {
            pour(&staged.temporary, &staged.target).map_err(|error| cannot_write(&staged.target, &error))?;
        }
        print(&self.stdout)?;
        let go = |staged: &Staged| match staged.goes {
            Goes::Into(how) => Some(Move { waits: staged.temporary.path.clone(), target: staged.target.clone(), how }),
            Goes::Poured => None,
        };
        let moves: Vec<Move> = self.staged.iter().filter_map(go).collect();
        set::put_in_place(&moves).map_err(|(path, error)| cannot_write(&path, &error))?;
        self.made.list().clear();
        self.staged.clear();
        Ok(())
    }

    fn claim(&self, path: &Path, identity: &Identity) -> Result<(), Vec<Diagnostic>> {
        match self.staged.iter().find(|staged| staged.identity == *identity && staged.goes != Goes::Poured) {
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
    say(bytes).map_err(|error| cannot_write(Path::new("-"), &error))
}

/// Whether a path stands for stdout.
pub(super) fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// How many outputs go to stdout.
pub(super) fn to_stdout<'a>(paths: impl IntoIterator<Item = Option<&'a PathBuf>>) -> usize {
    paths.into_iter().flatten().filter(|path| is_stdout(path)).count()
}

/// Refuses a result that would be lost.
fn stdout_is_open(path: &Path) -> Result<(), Vec<Diagnostic>> {
    if deflex_closed_stdout::was_closed() {
        return Err(refuse(path, "standard output is closed", "name a file, or /dev/null to discard the result"));
    }
    Ok(())
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

/// Whether a path is that of a file, there or not: a report is not named after a device or a pipe.
pub(super) fn is_file_name(path: &Path) -> bool {
    !is_stdout(path) && fs::metadata(path).map_or(true, |metadata| metadata.is_file())
}

fn stage(target: PathBuf, identity: Identity) -> io::Result<(Staged, File)> {
    let existing = fs::metadata(&target).ok();
    if existing.as_ref().is_some_and(fs::Metadata::is_dir) {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
    }
    if existing.as_ref().is_some_and(|metadata| !metadata.is_file()) {
        let (temporary, file) = Temporary::spool()?;
        return Ok((Staged { target, identity, temporary, goes: Goes::Poured }, file));
    }
    if let Some(existing) = &existing {
        place::writable(&target, existing)?;
    }
    let (temporary, file) = Temporary::create(folder_of(&target))?;
    let how = existing.map_or(Ok(How::Rename), |existing| place::adopt(&file, &existing))?;
    Ok((Staged { target, identity, temporary, goes: Goes::Into(how) }, file))
}

/// Writes a temporary file's bytes to what cannot be replaced; a reader of stdout that went away is no fault of ours.
fn pour(temporary: &Temporary, target: &Path) -> io::Result<()> {
    let mut from = temporary.reopen()?;
    if !is_stdout(target) {
        return io::copy(&mut from, &mut OpenOptions::new().write(true).open(target)?).map(|_| ());
    }
    let mut stdout = io::stdout().lock();
    if stdout.is_terminal() {
        let mut bytes = Vec::new();
        from.read_to_end(&mut bytes)?;
        return say(&bytes);
    }
    match io::copy(&mut from, &mut stdout).and_then(|_| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

/// Writes to stdout; what would steer a terminal does not reach one.
fn say(bytes: &[u8]) -> io::Result<()> {
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
    /// As much as is needed to recognise a language.
    const LOOK: u64 = 64 * 1024;
    let mut start = Vec::new();
    let there = !is_stdout(path) && fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
    let read = there && File::open(path).and_then(|file| file.take(LOOK).read_to_end(&mut start)).is_ok();
    if read && detect("", &start).is_some() {
        return Err(refuse(path, "a program is in this file", "choose another name for the report"));
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

pub(super) fn refuse(path: &Path, why: &str, help: &str) -> Vec<Diagnostic> {
    vec![
        Diagnostic::error("io.write", &path.display().to_string(), format!("the file is not written: {why}"))
            .help(help),
    ]
}

pub(super) fn cannot_write(path: &Path, error: &io::Error) -> Vec<Diagnostic> {
    let help = match error.kind() {
        io::ErrorKind::TimedOut => "run again when it has ended, or wait longer with `--lock-timeout SECONDS`",
        _ => "check that the folder exists and that you may write there",
    };
    Diagnostic::error("io.write", &path.display().to_string(), format!("the file cannot be written: {error}"))
        .help(help)
        .into()
}
