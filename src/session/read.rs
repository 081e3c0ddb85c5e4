//! Reads and writes files, with the messages for files that cannot be read, and gathers the errors of many files.

use super::output::watch::watch;
use deflex::limits::FILE_BYTES;
use deflex::program::Language;
use deflex::text::{Diagnostic, Severity, Source, cannot_read};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Reads one file; `-` is stdin.
pub(crate) fn source(path: &Path) -> Result<Source, Vec<Diagnostic>> {
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

/// All bytes of a file up to the limit and one more, because a device may never end.
fn whole(file: impl Read) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(FILE_BYTES.most + 1).read_to_end(&mut bytes).map(|_| bytes)
}

/// Reads all files, and reports every file that cannot be read.
pub(crate) fn sources(paths: &[PathBuf]) -> Result<Vec<Source>, Vec<Diagnostic>> {
    all(paths.iter().map(|path| source(path)))
}

/// The language to which the ending of a corrected file belongs, and a warning, if this is not the language of the
/// program. A controller would not load the file, and deflex would read it as a program of the other language.
pub(crate) fn other_ending(path: &Path, written: Language) -> Option<(Language, Diagnostic)> {
    let ending = path.extension()?.to_string_lossy().to_ascii_lowercase();
    let is_for = |language: &Language| language.endings().contains(&&ending[..]);
    let named = Language::ALL.into_iter().find(is_for).filter(|_| !is_for(&written))?;
    let message = format!("the program is {}, but the ending .{ending} is for {}", written.name(), named.name());
    let help = format!("write it to {}", path.with_extension(written.endings()[0]).display());
    let warning = Diagnostic::error("usage.ending", &path.display().to_string(), message);
    Some((named, warning.severity(Severity::Warning).help(help)))
}

/// All values if every result has one, otherwise all errors.
pub(crate) fn all<T>(results: impl IntoIterator<Item = Result<T, Vec<Diagnostic>>>) -> Result<Vec<T>, Vec<Diagnostic>> {
    let (values, errors) = parted(results);
    if errors.is_empty() { Ok(values) } else { Err(errors) }
}

/// The values and the errors.
pub(crate) fn parted<T>(results: impl IntoIterator<Item = Result<T, Vec<Diagnostic>>>) -> (Vec<T>, Vec<Diagnostic>) {
    let (mut values, mut errors) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(value) => values.push(value),
            Err(more) => errors.extend(more),
        }
    }
    (values, errors)
}

/// Both values, or all errors of both.
pub(crate) fn both<A, B>(
    a: Result<A, Vec<Diagnostic>>,
    b: Result<B, Vec<Diagnostic>>,
) -> Result<(A, B), Vec<Diagnostic>> {
    match (a, b) {
        (Ok(a), Ok(b)) => Ok((a, b)),
        (a, b) => Err([a.err(), b.err()].into_iter().flatten().flatten().collect()),
    }
}

pub(crate) fn cannot_write(error: &std::io::Error) -> Vec<Diagnostic> {
    Diagnostic::error("io.write", "", format!("the outputs cannot be written: {error}"))
        .help("check that there is room on the disk")
        .into()
}
