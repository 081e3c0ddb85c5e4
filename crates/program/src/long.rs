//! Long programs: chooses how their text is read a chunk at a time; no caller sees the choice.

use super::any_chunks::AnyChunks;
use super::cl::{self, ClOptions};
use super::krl;
use super::language::Language;
use super::rapid;
use deflex_text::{Diagnostic, Source, cannot_read};
use std::borrow::Cow;
use std::io::{Read, Seek};

/// The text of a program, which can be read several times.
#[doc(hidden)]
pub trait LongText {
    /// Its reader.
    type Reader: Read + Seek + Send;

    /// Its name as the user typed it.
    fn name(&self) -> &str;

    /// Whether it is long enough to be read a chunk at a time. A short text is read in chunks only if it runs through many motions.
    fn is_long(&self) -> bool;

    /// Opens it at its start.
    ///
    /// # Errors
    /// It cannot be opened.
    fn open(&self) -> Result<Self::Reader, Vec<Diagnostic>>;

    /// Reads all of it.
    ///
    /// # Errors
    /// It cannot be read.
    fn whole(&self) -> Result<Source, Vec<Diagnostic>>;
}

/// A program in one text, not yet read.
#[derive(Debug)]
#[doc(hidden)]
pub struct LongProgram<'a, T> {
    text: T,
    language: Language,
    context: Cow<'a, [Source]>,
    cl: Option<ClOptions>,
}

/// A way of reading a text in chunks.
#[derive(Clone, Copy, Debug)]
enum Reading {
    /// Line by line.
    InOrder,
    /// By an index of its declarations and routines.
    Indexed,
    /// By running it.
    Executed,
}

/// A long program with the way in which it is read.
#[derive(Debug)]
#[doc(hidden)]
pub struct InChunks<'a, T> {
    program: &'a LongProgram<'a, T>,
    reading: Reading,
}

impl<'a, T: LongText> LongProgram<'a, T> {
    /// A text in a language. `context` has declarations of other files; `cl` has the options for CL data, without which they are not read.
    pub fn new(text: T, language: Language, context: Cow<'a, [Source]>, cl: Option<ClOptions>) -> Self {
        Self { text, language, context, cl }
    }

    /// The result of `run` on the program in chunks; `None` if only the whole program can be read. If `run` returns `None`, because the
    /// chunks turn out not to be possible, it is called again with the next way of reading. All possible ways give the same result.
    ///
    /// # Errors
    /// As `run`.
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

    /// The ways of reading for this language, the cheapest first.
    fn readings(&self) -> &'static [Reading] {
        match (self.language, self.text.is_long()) {
            (Language::Rapid, true) => &[Reading::InOrder, Reading::Indexed, Reading::Executed],
            (Language::Rapid, false) => &[Reading::Executed],
            (Language::Krl | Language::Cl, true) => &[Reading::InOrder],
            // Others are held as a whole: the positions of a TP program are after all its motions, and in `deflex-lang` a motion depends
            // on everything that ran before it.
            _ => &[],
        }
    }

    fn chunks(&self, reading: Reading) -> Result<Option<AnyChunks<T::Reader>>, Vec<Diagnostic>> {
        let (name, context) = (self.text.name(), &self.context[..]);
        let open = || self.text.open();
        let unreadable = |error| cannot_read(name, &error);
        Ok(match (self.language, reading) {
            (Language::Rapid, Reading::InOrder) => {
                let chunks = rapid::Chunks::of_file(name, open()?, context).map_err(unreadable)?;
                chunks.map(|chunks| AnyChunks::Inline(Box::new(chunks)))
            }
            (Language::Rapid, Reading::Indexed) => {
                let chunks = rapid::Declared::new(name, open()?, open()?, context).map_err(unreadable)?;
                chunks.map(|chunks| AnyChunks::Indexed(Box::new(chunks)))
            }
            (Language::Rapid, Reading::Executed) => {
                let program = rapid::Executed::read(vec![self.text.whole()?], context.to_vec())?;
                program.map(|program| AnyChunks::Executed(program.chunks()))
            }
            (Language::Krl, Reading::InOrder) => {
                let chunks = krl::Chunks::of_file(name, open()?, context, krl::CHUNK).map_err(unreadable)?;
                chunks.map(|chunks| AnyChunks::Krl(Box::new(chunks)))
            }
            (Language::Cl, Reading::InOrder) => {
                let Some(options) = &self.cl else { return Ok(None) };
                let chunks = cl::Chunks::new(name, open()?, options).map_err(unreadable)?;
                chunks.map(|chunks| AnyChunks::Cl(Box::new(chunks)))
            }
            _ => None,
        })
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

    /// Its chunks, from the first; `None` if it cannot be read in this way.
    pub fn chunks(&self) -> Result<Option<AnyChunks<T::Reader>>, Vec<Diagnostic>> {
        self.program.chunks(self.reading)
    }

    /// The chunks of another program, read in the same way.
    pub fn chunks_of(&self, other: &LongProgram<'_, T>) -> Result<Option<AnyChunks<T::Reader>>, Vec<Diagnostic>> {
        other.chunks(self.reading)
    }
}
