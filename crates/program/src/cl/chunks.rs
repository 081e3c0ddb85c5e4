//! A long file in chunks that fit in memory.
//!
//! One reader reads the records in order, so that all modal data (unit, frame, feed, spindle, tool axis, marks, cycles, …) are as in the
//! whole file; a chunk has the records since the last one. Chunks end between records, and never within an arc. A file is read as a whole
//! if a statement changes earlier targets, or if something depends on all of it.

use super::cards::Cards;
use super::lex::{Lexer, RecordStart, Token, after_byte_order_mark};
use super::reader::Reader;
use super::{ClOptions, is_foreign, is_source_language, refused};
use crate::chunk::leaves_its_start;
use crate::{Next, StreamableChunk};
use deflex_text::{Diagnostic, Source};
use std::io::{self, Read};

/// Bytes of a chunk: some hundred targets, which fit into the cache of a core.
const CHUNK: usize = 32 * 1024;

/// Number of targets that ends a chunk: arcs make many targets of few bytes.
const TARGETS: usize = 1024;

/// Bytes of the head from which unit, maker and layout are recognised.
const HEAD: usize = 64 * 1024;

/// Most bytes of a chunk: a file with a longer stretch that cannot be divided is read as a whole.
const MOST_BYTES: usize = 1 << 20;

/// Divides a CL file into chunks, and reads no further than needed.
#[derive(Debug)]
#[doc(hidden)]
pub struct Chunks<R> {
    input: R,
    name: String,
    reader: Reader,
    chunk: usize,
    /// Bytes that are read and not yet in a chunk.
    rest: Vec<u8>,
    tokens: Vec<Token>,
    /// Number of lines before `rest`.
    lines_before: usize,
    /// Position at which the next record is searched for.
    place: RecordStart,
    /// Whether the input has no more bytes.
    read_up: bool,
    first: bool,
    ended: bool,
}

impl<R: Read> Chunks<R> {
    /// Reads the head; `None` if the file can only be read as a whole.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn new(name: &str, input: R, options: &ClOptions) -> io::Result<Option<Self>> {
        Self::sized(name, input, options, CHUNK)
    }

    /// The same, with chunks of about `chunk` bytes.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn sized(name: &str, input: R, options: &ClOptions, chunk: usize) -> io::Result<Option<Self>> {
        let mut chunks = Self {
            input,
            name: name.to_owned(),
            reader: Reader::new(&[], options),
            chunk,
            rest: Vec::new(),
            tokens: Vec::new(),
            lines_before: 0,
            place: RecordStart { at: 0, line: 1 },
            read_up: false,
            first: true,
            ended: false,
        };
        chunks.fill(HEAD)?;
        let lines = chunks.rest.iter().rposition(|b| matches!(b, b'\n' | b'\r')).unwrap_or(0);
        if refused(options).is_some() || !Cards::excluded(&chunks.rest[..lines]) {
            return Ok(None);
        }
        chunks.reader = Reader::new(&chunks.rest, options);
        chunks.place.at = after_byte_order_mark(&chunks.rest);
        Ok(Some(chunks))
    }

    /// Reads until `wanted` bytes are waiting, or to the end.
    fn fill(&mut self, wanted: usize) -> io::Result<()> {
        let missing = wanted.saturating_sub(self.rest.len()) as u64;
        let came = self.input.by_ref().take(missing).read_to_end(&mut self.rest)?;
        self.read_up |= (came as u64) < missing;
        Ok(())
    }

    /// The next chunk. Edits of its program have no meaning, because CL data are posted and not edited.
    ///
    /// # Errors
    /// The input cannot be read.
    pub fn take(&mut self) -> io::Result<Next<StreamableChunk>> {
        if self.ended {
            return Ok(Next::End);
        }
        let start = self.place.at;
        let mut wanted = self.chunk;
        loop {
            self.fill(wanted)?;
            self.read_on(wanted);
            if self.reader.no_unit.is_some() || wanted > MOST_BYTES {
                return Ok(Next::NotStreamable);
            }
            if self.ended {
                self.reader.end();
                let whole = is_source_language(&self.reader) || is_foreign(&self.reader);
                return Ok(if whole { Next::NotStreamable } else { Next::Chunk(self.cut()) });
            }
            if self.place.at > start && self.may_cut() {
                return Ok(Next::Chunk(self.cut()));
            }
            wanted += self.chunk;
        }
    }

    /// Reads the records that are complete in the first bytes.
    fn read_on(&mut self, wanted: usize) {
        let bytes = &self.rest[..wanted.min(self.rest.len())];
        let all = self.read_up && bytes.len() == self.rest.len();
        let mut lexer = Lexer::resume(bytes, self.place);
        loop {
            if !self.reader.take_plain(&mut lexer) {
                let Some(record) = lexer.next(&mut self.tokens) else { break };
                if lexer.is_at_end() && !all {
                    return;
                }
                self.reader.take(bytes, record, &self.tokens);
            }
            self.place = lexer.place();
            if self.reader.targets.len() >= TARGETS && self.may_cut() || self.reader.no_unit.is_some() {
                return;
            }
        }
        self.ended = all;
    }

    /// Whether the file may be divided here.
    fn may_cut(&self) -> bool {
        let settled = self.reader.pending.is_none() && self.reader.checked.is_none();
        settled && !self.reader.machine.holds_records() && (!self.first || leaves_its_start(&self.reader.targets))
    }

    fn cut(&mut self) -> StreamableChunk {
        let end = if self.ended { self.rest.len() } else { self.place.at };
        let lines_before = std::mem::replace(&mut self.lines_before, self.place.line - 1);
        let source = Source { name: self.name.clone(), bytes: self.rest.drain(..end).collect(), lines_before };
        self.place.at = 0;
        self.first = false;
        // Its numbers are in an earlier chunk, and are not edited.
        self.reader.modal.from = None;
        let own = 0..source.bytes.len();
        StreamableChunk { program: self.reader.program(source), own, elsewhere: Vec::new(), at: 0, last: self.ended }
    }

    /// Warnings about the chunks so far.
    #[must_use]
    pub fn warnings(&self) -> Vec<Diagnostic> {
        self.reader.warnings(&self.name)
    }
}
