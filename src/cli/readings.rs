//! The ways to read a long program, in the order in which they are tried: those that hold give the same.

use super::files::{cannot_read, source};
use super::setup::Setup;
use deflex::program::{AnyChunks, Language};
use deflex::text::{Diagnostic, Source};
use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::path::Path;

/// How a long program is read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Reading {
    /// Line by line.
    InOrder,
    /// By an index of what it declares and of its routines.
    Indexed,
    /// By running it.
    Executed,
}

impl Reading {
    /// The cheapest first.
    pub(super) const ALL: [Self; 3] = [Self::InOrder, Self::Indexed, Self::Executed];
}

/// The text of a long program, as often as it is read.
pub(super) trait LongText {
    type Reader: Read + Seek + Send;

    /// As the user typed it.
    fn name(&self) -> &str;

    /// From its start.
    ///
    /// # Errors
    /// It cannot be opened.
    fn open(&self) -> Result<Self::Reader, Vec<Diagnostic>>;

    /// All of it.
    ///
    /// # Errors
    /// It cannot be read.
    fn whole(&self) -> Result<Source, Vec<Diagnostic>>;
}

/// A text in a file.
#[derive(Clone, Copy)]
pub(super) struct FileText<'a> {
    pub(super) name: &'a str,
    pub(super) path: &'a Path,
}

impl LongText for FileText<'_> {
    type Reader = File;

    fn name(&self) -> &str {
        self.name
    }

    fn open(&self) -> Result<File, Vec<Diagnostic>> {
        File::open(self.path).map_err(|error| cannot_read(self.name, &error))
    }

    fn whole(&self) -> Result<Source, Vec<Diagnostic>> {
        source(self.path)
    }
}

impl<'a> LongText for &'a Source {
    type Reader = Cursor<&'a [u8]>;

    fn name(&self) -> &str {
        &self.name
    }

    fn open(&self) -> Result<Cursor<&'a [u8]>, Vec<Diagnostic>> {
        Ok(Cursor::new(&self.bytes))
    }

    fn whole(&self) -> Result<Source, Vec<Diagnostic>> {
        Ok((*self).clone())
    }
}

/// The chunks of a program; `None` where it cannot be read so.
pub(super) fn chunks<T: LongText>(
    (setup, context): (&Setup, &[Source]),
    language: Language,
    text: &T,
    reading: Reading,
) -> Result<Option<AnyChunks<T::Reader>>, Vec<Diagnostic>> {
    let name = text.name();
    let chunks = match (language, reading) {
        (Language::Rapid, Reading::InOrder) => AnyChunks::inline(name, text.open()?, context),
        (Language::Rapid, Reading::Indexed) => AnyChunks::indexed(name, text.open()?, text.open()?, context),
        (Language::Rapid, Reading::Executed) => return AnyChunks::executed(text.whole()?, context),
        (Language::Krl, Reading::InOrder) => AnyChunks::krl(name, text.open()?, context),
        (Language::Cl, Reading::InOrder) => match setup.cell.cl_options(setup.options.tool.as_deref()) {
            Some(options) => AnyChunks::cl(name, text.open()?, &options),
            None => Ok(None),
        },
        // The positions of a TP program stand behind all its motions: it is held as a whole.
        (Language::Ls, _) | (Language::Krl | Language::Cl, Reading::Indexed | Reading::Executed) => Ok(None),
    };
    chunks.map_err(|error| cannot_read(name, &error))
}
