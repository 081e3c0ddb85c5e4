//! Long programs: how their text is read a chunk at a time is chosen here, and no caller sees it.

use super::any_chunks::AnyChunks;
use super::cl::ClOptions;
use super::language::Language;
use crate::text::{Diagnostic, Source, cannot_read};
use std::borrow::Cow;
use std::io::{Read, Seek};

/// The text of a program, as often as it is read.
pub trait LongText {
    /// What reads it.
    type Reader: Read + Seek + Send;

    /// As the user typed it.
    fn name(&self) -> &str;

    /// Whether it is worth its while to read it a chunk at a time. A short text is read so only for what it runs through.
    fn is_long(&self) -> bool;

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

/// A program in one text, not yet read.
#[derive(Debug)]
pub struct LongProgram<'a, T> {
    text: T,
    language: Language,
    context: Cow<'a, [Source]>,
    cl: Option<ClOptions>,
}

/// How a text is read in chunks.
#[derive(Clone, Copy, Debug)]
enum Reading {
    /// Line by line.
    InOrder,
    /// By an index of what it declares and of its routines.
    Indexed,
    /// By running it.
    Executed,
}

/// A long program that is read in one of the ways that there are.
#[derive(Debug)]
pub struct InChunks<'a, T> {
    program: &'a LongProgram<'a, T>,
    reading: Reading,
}

impl<'a, T: LongText> LongProgram<'a, T> {
    /// A text in a language; `context` declares what it does not, and `cl` is how CL data are read, which without are not.
    pub fn new(text: T, language: Language, context: Cow<'a, [Source]>, cl: Option<ClOptions>) -> Self {
        Self { text, language, context, cl }
    }

    /// What `run` comes to on the program in chunks; `None` where only the whole of it tells what it means. `run` gives `None` of
    /// chunks that do not hold, and is asked once more where the text can be read in another way: all that hold give the same.
    ///
    /// # Errors
    /// Those of `run`.
    pub fn by_chunks<A, E>(
        &self,
        mut run: impl FnMut(InChunks<'_, T>) -> Result<Option<A>, E>,
    ) -> Result<Option<A>, E> {
        for &reading in self.readings() {
            if let Some(answer) = run(InChunks { program: self, reading })? {
                return Ok(Some(answer));
            }
        }
        Ok(None)
    }

    /// The cheapest first.
    fn readings(&self) -> &'static [Reading] {
        match (self.language, self.text.is_long()) {
            (Language::Rapid, true) => &[Reading::InOrder, Reading::Indexed, Reading::Executed],
            (Language::Rapid, false) => &[Reading::Executed],
            (Language::Krl | Language::Cl, true) => &[Reading::InOrder],
            // Others are held as a whole: the positions of a TP program stand after all its motions, and what a motion of
            // `deflex-lang` means depends on all that ran before it.
            _ => &[],
        }
    }

    fn chunks(&self, reading: Reading) -> Result<Option<AnyChunks<T::Reader>>, Vec<Diagnostic>> {
        let (name, context) = (self.text.name(), &self.context[..]);
        let open = || self.text.open();
        let chunks = match (self.language, reading) {
            (Language::Rapid, Reading::InOrder) => AnyChunks::inline(name, open()?, context),
            (Language::Rapid, Reading::Indexed) => AnyChunks::indexed(name, open()?, open()?, context),
            (Language::Rapid, Reading::Executed) => return AnyChunks::executed(self.text.whole()?, context),
            (Language::Krl, Reading::InOrder) => AnyChunks::krl(name, open()?, context),
            (Language::Cl, Reading::InOrder) => match &self.cl {
                Some(options) => AnyChunks::cl(name, open()?, options),
                None => Ok(None),
            },
            _ => Ok(None),
        };
        chunks.map_err(|error| cannot_read(name, &error))
    }
}

impl<T: LongText> InChunks<'_, T> {
    /// Its text.
    #[must_use]
    pub fn text(&self) -> &T {
        &self.program.text
    }

    /// Its language.
    #[must_use]
    pub fn language(&self) -> Language {
        self.program.language
    }

    /// Its chunks, from the first; `None` where it cannot be read so.
    pub(crate) fn chunks(&self) -> Result<Option<AnyChunks<T::Reader>>, Vec<Diagnostic>> {
        self.program.chunks(self.reading)
    }

    /// Those of another program, read in the same way.
    pub(crate) fn chunks_of(
        &self,
        other: &LongProgram<'_, T>,
    ) -> Result<Option<AnyChunks<T::Reader>>, Vec<Diagnostic>> {
        other.chunks(self.reading)
    }
}
