//! The text of a file, which may be in memory or not.

use super::output::watch::watch;
use super::read::source;
use deflex::program::{LongText, ModuleNames};
use deflex::report::Origin;
use deflex::text::{Diagnostic, Source, cannot_read};
use either::Either;
use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

/// The text of a program. A long file is read only when its turn comes, so that a batch is never in memory as a whole.
#[derive(Clone, Debug)]
pub(crate) enum Text {
    Held(Source),
    File {
        /// Path as the user typed it.
        name: String,
        path: PathBuf,
    },
}

/// Files up to this size are read at once. In a longer file, this many bytes are enough to recognise the language.
const HEAD: u64 = 64 * 1024;

impl Text {
    pub(crate) fn of(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        watch(path);
        let long = |metadata: std::fs::Metadata| metadata.is_file() && metadata.len() > HEAD;
        if std::fs::metadata(path).is_ok_and(long) {
            return Ok(Self::File { name: path.display().to_string(), path: path.to_owned() });
        }
        source(path).map(Self::Held)
    }

    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Held(source) => &source.name,
            Self::File { name, .. } => name,
        }
    }

    /// Length of the text, bytes.
    pub(crate) fn bytes(&self) -> Result<u64, Vec<Diagnostic>> {
        match self {
            Self::Held(source) => Ok(source.bytes.len() as u64),
            Self::File { name, path } => {
                path.metadata().map(|metadata| metadata.len()).map_err(|error| cannot_read(name, &error))
            }
        }
    }

    pub(crate) fn read(self) -> Result<Source, Vec<Diagnostic>> {
        match self {
            Self::Held(source) => Ok(source),
            Self::File { name, path } => {
                let bytes = std::fs::read(path).map_err(|error| cannot_read(&name, &error))?;
                Ok(Source::new(name, bytes))
            }
        }
    }

    /// The text, if it is in memory.
    pub(crate) fn source(&self) -> Option<&Source> {
        match self {
            Self::Held(source) => Some(source),
            Self::File { .. } => None,
        }
    }

    pub(crate) fn origin(&self) -> Result<Origin, Vec<Diagnostic>> {
        match self {
            Self::Held(source) => Ok(Origin::of(&source.name, &source.bytes)),
            Self::File { name, path } => {
                let origin = File::open(path).and_then(|file| Origin::read(name, file));
                origin.map_err(|error| cannot_read(name, &error))
            }
        }
    }

    /// The first bytes, which are enough to recognise the language.
    pub(crate) fn head(&self) -> Result<Vec<u8>, Vec<Diagnostic>> {
        match self {
            Self::Held(source) => Ok(source.bytes.clone()),
            Self::File { name, path } => {
                let mut head = Vec::new();
                let read = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
                read.map(|_| head).map_err(|error| cannot_read(name, &error))
            }
        }
    }

    pub(crate) fn names(&self, names: &mut ModuleNames) -> Result<(), Vec<Diagnostic>> {
        let read = match self {
            Self::Held(source) => names.read(&source.bytes[..]),
            Self::File { path, .. } => File::open(path).and_then(|file| names.read(BufReader::new(file))),
        };
        read.map_err(|error| cannot_read(self.name(), &error))
    }
}

impl<'a> LongText for &'a Text {
    type Reader = Either<File, Cursor<&'a [u8]>>;

    fn name(&self) -> &str {
        Text::name(self)
    }

    fn is_long(&self) -> bool {
        match self {
            Text::Held(source) => source.bytes.len() as u64 > HEAD,
            Text::File { .. } => true,
        }
    }

    fn open(&self) -> Result<Self::Reader, Vec<Diagnostic>> {
        match self {
            Text::Held(source) => Ok(Either::Right(Cursor::new(&source.bytes))),
            Text::File { name, path } => File::open(path).map(Either::Left).map_err(|error| cannot_read(name, &error)),
        }
    }

    fn whole(&self) -> Result<Source, Vec<Diagnostic>> {
        Text::clone(self).read()
    }
}
