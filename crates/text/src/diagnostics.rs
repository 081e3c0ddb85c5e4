//! Several messages as one error.

use super::Diagnostic;
use std::error::Error;
use std::fmt;
use std::io;
use std::ops::Deref;
use std::path::Path;

/// All errors of an input as one error. `?` converts the lists of messages that functions of this library return, and
/// the errors of reading a file, into this type.
///
/// # Examples
/// ```
/// use deflex_text::{Diagnostics, Source};
///
/// /// Reads a file. An error of the system becomes a message.
/// fn read(path: &str) -> Result<Source, Diagnostics> {
///     Ok(Source::new(path, std::fs::read(path)?))
/// }
/// assert!(read("no such file").is_err());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostics(Vec<Diagnostic>);

impl Deref for Diagnostics {
    type Target = [Diagnostic];

    fn deref(&self) -> &[Diagnostic] {
        &self.0
    }
}

/// One line for each message.
impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, diagnostic) in self.0.iter().enumerate() {
            let end = if i > 0 { "\n" } else { "" };
            write!(f, "{end}{diagnostic}")?;
        }
        Ok(())
    }
}

impl Error for Diagnostics {}

impl From<Vec<Diagnostic>> for Diagnostics {
    fn from(all: Vec<Diagnostic>) -> Self {
        Self(all)
    }
}

impl From<Diagnostic> for Diagnostics {
    fn from(one: Diagnostic) -> Self {
        Self(vec![one])
    }
}

impl From<Diagnostics> for Vec<Diagnostic> {
    fn from(all: Diagnostics) -> Self {
        all.0
    }
}

/// A file that cannot be read or written.
impl From<io::Error> for Diagnostics {
    fn from(error: io::Error) -> Self {
        Diagnostic::error("io", "", error.to_string()).into()
    }
}

impl IntoIterator for Diagnostics {
    type Item = Diagnostic;
    type IntoIter = std::vec::IntoIter<Diagnostic>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

/// The error that a file cannot be read, with the reason.
#[doc(hidden)]
pub fn cannot_read(name: &str, error: &io::Error) -> Vec<Diagnostic> {
    let folder = Path::new(name).is_dir();
    let help = if folder {
        "give a file; of a folder of programs its files, for example FOLDER/*.mod"
    } else {
        "check the path"
    };
    Diagnostic::error("io.read", name, format!("the file cannot be read: {error}")).help(help).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_files_become_one_error() {
        fn fails(list: bool) -> Result<(), Diagnostics> {
            if list {
                Err(vec![Diagnostic::error("a", "x.mod", "first"), Diagnostic::error("b", "", "second")])?;
            }
            std::fs::read("no such file")?;
            Ok(())
        }
        let error: Box<dyn Error> = fails(true).unwrap_err().into();
        assert_eq!(error.to_string(), "x.mod: error: first [a]\nerror: second [b]");
        assert_eq!(fails(false).unwrap_err()[0].code, "io");
    }
}
