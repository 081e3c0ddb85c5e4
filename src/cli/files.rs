//! Files as they are read and written, what is said where they cannot be, and the errors of many.

use super::watch::watch;
use deflex::limits::FILE_BYTES;
use deflex::program::Language;
use deflex::text::{Diagnostic, Severity, Source, cannot_read};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Reads one file, `-` being stdin.
pub(super) fn source(path: &Path) -> Result<Source, Vec<Diagnostic>> {
    let name = path.display().to_string();
    let read = if name == "-" {
        whole(std::io::stdin().lock())
    } else {
        watch(path);
        std::fs::File::open(path).and_then(whole)
    };
    let bytes = read.map_err(|error| cannot_read(&name, &error))?;
    match FILE_BYTES.exceeded(bytes.len() as f64) {
        None => Ok(Source::new(name, bytes)),
        Some(over) => Err(Diagnostic::error("io.read", &name, over).help(FILE_BYTES.help).into()),
    }
}

/// All bytes of a file, or one more than are taken: a device never ends.
fn whole(file: impl Read) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(FILE_BYTES.most + 1).read_to_end(&mut bytes).map(|_| bytes)
}

/// Reads every file; all that cannot be read are named.
pub(super) fn sources(paths: &[PathBuf]) -> Result<Vec<Source>, Vec<Diagnostic>> {
    all(paths.iter().map(|path| source(path)))
}

/// The other language whose ending the file of a program has, and a warning: a controller would not load it, and deflex would read
/// it as a program of that language.
pub(super) fn other_ending(path: &Path, written: Language) -> Option<(Language, Diagnostic)> {
    let ending = path.extension()?.to_string_lossy().to_ascii_lowercase();
    let is_for = |language: &Language| language.endings().contains(&&ending[..]);
    let named = Language::ALL.into_iter().find(is_for).filter(|_| !is_for(&written))?;
    let message = format!("the program is {}, but the ending .{ending} is for {}", written.name(), named.name());
    let help = format!("write it to {}", path.with_extension(written.endings()[0]).display());
    let warning = Diagnostic::error("usage.ending", &path.display().to_string(), message);
    Some((named, warning.severity(Severity::Warning).help(help)))
}

/// Every value, or every error.
pub(super) fn all<T>(results: impl IntoIterator<Item = Result<T, Vec<Diagnostic>>>) -> Result<Vec<T>, Vec<Diagnostic>> {
    let (values, errors) = parted(results);
    if errors.is_empty() { Ok(values) } else { Err(errors) }
}

/// Every value, and every error.
pub(super) fn parted<T>(results: impl IntoIterator<Item = Result<T, Vec<Diagnostic>>>) -> (Vec<T>, Vec<Diagnostic>) {
    let (mut values, mut errors) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(value) => values.push(value),
            Err(more) => errors.extend(more),
        }
    }
    (values, errors)
}

/// Both values, or the errors of both.
pub(super) fn both<A, B>(
    a: Result<A, Vec<Diagnostic>>,
    b: Result<B, Vec<Diagnostic>>,
) -> Result<(A, B), Vec<Diagnostic>> {
    match (a, b) {
        (Ok(a), Ok(b)) => Ok((a, b)),
        (a, b) => Err([a.err(), b.err()].into_iter().flatten().flatten().collect()),
    }
}

pub(super) fn cannot_write(error: &std::io::Error) -> Vec<Diagnostic> {
    Diagnostic::error("io.write", "", format!("the outputs cannot be written: {error}"))
        .help("check that there is room on the disk")
        .into()
}
