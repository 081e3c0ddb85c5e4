//! A long program in chunks that fit in memory.
//!
//! Such a program is one routine whose lines differ only in the numbers of their positions. The text before the first of these lines, the
//! head, is run once for each [kind of line](Like), with one line of the kind after it, and once with the text after the last line. A
//! position that names all six numbers does not depend on the lines before it, so that all lines of a kind have the same meaning. Any other
//! program is read as a whole.

use super::like::{Axes, Before, Lead, Like, Reader, is_speed, layout, line_ends, moved_axes};
use super::{Layout, dialect, lex};
use crate::{Language, Mark, Next, Predecessor, Program, StreamableChunk, Target, detect};
use deflex_text::{Source, Span};
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::sync::Arc;

/// Bytes of lines in a chunk: some thousand targets. The chunks do not depend on the number of threads.
pub const CHUNK: usize = 64 * 1024;

/// Most bytes before the first line of a kind and after the last.
const HEAD: usize = 256 * 1024;

/// Bytes that a chunk may have to read further to the end of a line.
const LONGEST: usize = 4096;

/// Most kinds of lines: a program with more has nothing to gain.
const MOST_KINDS: usize = 64;

/// Divides a program into chunks, and reads no further than needed.
#[derive(Debug)]
#[doc(hidden)]
pub struct Chunks<R> {
    input: R,
    chunk: usize,
    reader: Arc<Reader>,
    dialect: &'static str,
    /// The targets of the head.
    head: Option<Program>,
    kinds: Vec<Arc<Like>>,
    /// The text that is read and, from an offset on, not yet in a chunk.
    rest: Vec<u8>,
    cut: usize,
    /// Line ends before it.
    lines: usize,
    motions: u32,
    lead: Lead,
    /// The last line of a kind.
    last: Option<(Arc<Like>, Vec<u8>)>,
    /// The text after it.
    tail: Option<Chunk>,
    ended: bool,
}

/// A stretch of lines, not yet read.
#[derive(Debug)]
#[doc(hidden)]
pub struct Chunk {
    reader: Arc<Reader>,
    source: Source,
    dialect: &'static str,
    /// The bytes of the source that are in the file.
    own: std::ops::Range<usize>,
    /// Number of the targets before the lines: those of the head, or of the text after all lines.
    begun: Option<Program>,
    /// Where the lines begin, and the offsets from which on they are of each kind.
    lines: usize,
    kinds: Vec<(usize, Arc<Like>)>,
    motions_before: u32,
    motions: u32,
    last: bool,
}

/// The end of a stretch.
struct Cut {
    bytes: usize,
    lines: usize,
    kinds: Vec<(usize, Arc<Like>)>,
    last: bool,
}

impl<R: Read> Chunks<R> {
    /// Reads the head of a file. The whole file is scanned for external axes that are at zero in the first lines and move later. `None` if
    /// the file does not begin like such a program. A chunk has about `chunk` bytes.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_file(name: &str, mut file: R, context: &[Source], chunk: usize) -> io::Result<Option<Self>>
    where
        R: Seek,
    {
        let begun = Chunks::knowing(name, &mut file, context, chunk, Axes::default())?
            .map(|chunks| chunks.reader.has_axes_at_rest());
        file.rewind()?;
        let moving = match begun {
            None => return Ok(None),
            Some(false) => Axes::default(),
            Some(true) => axes_that_move(BufReader::with_capacity(chunk.max(CHUNK), &mut file))?,
        };
        file.rewind()?;
        Self::knowing(name, file, context, chunk, moving)
    }

    fn knowing(name: &str, input: R, context: &[Source], chunk: usize, moving: Axes) -> io::Result<Option<Self>> {
        let mut chunks = Self {
            input,
            chunk,
            reader: Arc::default(),
            dialect: "krl",
            head: None,
            kinds: Vec::new(),
            rest: Vec::new(),
            cut: 0,
            lines: 0,
            motions: 0,
            lead: Lead::default(),
            last: None,
            tail: None,
            ended: false,
        };
        chunks.fill(HEAD)?;
        let begin = Source::new(name, &chunks.rest[..chunks.rest.len().min(HEAD)]);
        // A file without a DEF of its own is none that an operator selects.
        if detect(name, &begin.bytes) != Some(Language::Krl) || context.iter().any(|source| source.bytes.len() > CHUNK)
        {
            return Ok(None);
        }
        chunks.dialect = dialect(std::slice::from_ref(&begin));
        let (mut at, mut tried) = (0, 0);
        while let Some(line) = next_line(&begin.bytes[at..]) {
            if is_motion(line) && tried < MOST_KINDS {
                tried += 1;
                if let Some((reader, head)) = Reader::new((name, &begin.bytes[..at], context), line, moving) {
                    chunks.lines = line_ends(&begin.bytes[..at]);
                    (chunks.reader, chunks.motions) = (Arc::new(reader), head.motion_targets() as u32);
                    (chunks.head, chunks.cut) = (Some(head), at);
                    return Ok(Some(chunks));
                }
            }
            at += line.len();
        }
        Ok(None)
    }

    /// Reads until `wanted` bytes are waiting, or to the end.
    fn fill(&mut self, wanted: usize) -> io::Result<()> {
        /// Chunks that are read at once.
        const AHEAD: usize = 4;
        if self.rest.len() - self.cut < wanted {
            self.rest.drain(..std::mem::take(&mut self.cut));
            let missing = wanted + AHEAD * self.chunk - self.rest.len();
            self.input.by_ref().take(missing as u64).read_to_end(&mut self.rest)?;
        }
        Ok(())
    }

    /// The next chunk.
    ///
    /// # Errors
    /// The input cannot be read.
    pub(crate) fn take(&mut self) -> io::Result<Next<Chunk>> {
        if self.ended {
            return Ok(self.tail.take().map_or(Next::End, Next::Chunk));
        }
        let (lines_before, motions_before) = (self.lines, self.motions);
        self.fill(2 * self.chunk + LONGEST)?;
        let Some(cut) = self.cut() else { return Ok(Next::NotStreamable) };
        let begun = self.head.take();
        let mut bytes = if begun.is_some() { self.reader.head().to_vec() } else { Vec::new() };
        let lines = bytes.len();
        bytes.extend_from_slice(&self.rest[self.cut..self.cut + cut.bytes]);
        self.cut += cut.bytes;
        self.lines += cut.lines;
        if cut.last {
            self.fill(HEAD + 1)?;
            self.tail = self.tail();
            if self.tail.is_none() {
                return Ok(Next::NotStreamable);
            }
            self.ended = true;
            if bytes.is_empty() {
                return self.take();
            }
        }
        let mut source = Source::new(self.reader.name(), bytes);
        source.lines_before = if begun.is_some() { 0 } else { lines_before };
        Ok(Next::Chunk(Chunk {
            reader: Arc::clone(&self.reader),
            own: 0..source.bytes.len(),
            source,
            dialect: self.dialect,
            begun,
            lines,
            kinds: cut.kinds.into_iter().map(|(at, like)| (lines + at, like)).collect(),
            motions_before,
            motions: self.motions - motions_before,
            last: false,
        }))
    }

    /// The text after the last line of a kind.
    fn tail(&mut self) -> Option<Chunk> {
        let after = &self.rest[self.cut..];
        let (mut like, line) = self.last.take().filter(|_| after.len() <= HEAD)?;
        if !like.fits(line.trim_ascii()) {
            like = Arc::new(self.reader.like(&like.lead, &line)?);
        }
        let (program, from) =
            self.reader.tail(&like, &line, after, Before { lines: self.lines, motions: self.motions })?;
        let source = program.sources[0].clone();
        let lines = source.bytes.len();
        Some(Chunk {
            reader: Arc::clone(&self.reader),
            own: from..lines,
            source,
            dialect: self.dialect,
            begun: Some(program),
            lines,
            kinds: Vec::new(),
            motions_before: self.motions,
            motions: 0,
            last: true,
        })
    }

    /// The end of the stretch that begins at `rest`, after a line of a kind. `None` if a line does not end, or if there are too many kinds.
    fn cut(&mut self) -> Option<Cut> {
        let rest = &self.rest[self.cut..];
        let whole = rest.len() < 2 * self.chunk + LONGEST;
        let mut cut = Cut { bytes: 0, lines: 0, kinds: Vec::new(), last: false };
        let (mut at, mut lines, mut last_line) = (0, 0, None);
        let mut like: Option<Arc<Like>> = None;
        // What holds after the last line of a kind.
        let mut lead = self.lead.clone();
        while cut.bytes < self.chunk {
            let line = next_line(&rest[at..]).filter(|line| line.last() == Some(&b'\n') || whole);
            let Some(line) = line else {
                if whole {
                    break;
                }
                return None;
            };
            let text = line.trim_ascii();
            // Lines that end with a return alone are not counted here.
            let own = line.strip_suffix(b"\n").unwrap_or(line);
            let own = own.strip_suffix(b"\r").unwrap_or(own);
            match text.first() {
                _ if !is_motion(line) && own.contains(&b'\r') => return None,
                None => {}
                Some(b';') => {
                    lead.mark = Mark::of(&text[1..]).or(lead.mark);
                    like = None;
                }
                Some(_) if is_speed(text) => {
                    lead.speed = text.to_vec();
                    like = None;
                }
                Some(_) if is_motion(line) => {
                    if !like.as_ref().is_some_and(|like| like.looks_like(text)) {
                        let known = self.kinds.iter().find(|like| like.lead == lead && like.fits(text)).cloned();
                        let found = match known {
                            Some(known) => known,
                            None if self.kinds.len() < MOST_KINDS => match self.reader.like(&lead, line) {
                                Some(found) => {
                                    self.kinds.push(Arc::new(found));
                                    Arc::clone(self.kinds.last()?)
                                }
                                None => break,
                            },
                            None => return None,
                        };
                        cut.kinds.push((at, Arc::clone(&found)));
                        like = Some(found);
                    }
                    self.motions += 1;
                    last_line = Some(at..at + line.len());
                    (cut.bytes, cut.lines) = (at + line.len(), lines + 1);
                    if self.lead != lead {
                        self.lead.clone_from(&lead);
                    }
                }
                Some(_) => break,
            }
            at += line.len();
            lines += 1;
        }
        cut.last = cut.bytes < self.chunk;
        if let (Some(last), Some(like)) = (last_line, cut.kinds.last()) {
            self.last = Some((Arc::clone(&like.1), rest[last].to_vec()));
        }
        Some(cut)
    }
}

impl Chunk {
    /// Reads the chunk; `None` if its lines are not of the expected kind.
    #[must_use]
    pub fn read(self) -> Option<StreamableChunk> {
        let mut program = self.begun.unwrap_or_else(|| empty(self.dialect));
        let mut ordinal = self.motions_before;
        let (mut at, mut kinds) = (self.lines, self.kinds.iter().peekable());
        let (mut like, mut frames, mut external): (Option<&Like>, _, _) = (None, [0; 2], None);
        // Kinds of lines that only looked like theirs.
        let mut others: Vec<Like> = Vec::new();
        let bytes = &self.source.bytes;
        let mut number = self.source.lines_before + line_ends(&bytes[..at]);
        let Layout { mut sites, motions, .. } = std::mem::take(layout(&mut program)?);
        program.targets.reserve(self.motions as usize);
        sites.reserve(self.motions as usize);
        while let Some(line) = next_line(&bytes[at..]) {
            number += 1;
            if let Some((_, next)) = kinds.next_if(|(start, _)| *start <= at) {
                frames = next.frames(&mut program.tools, &mut program.wobjs)?;
                like = Some(next);
            }
            let text = line.trim_ascii();
            if is_motion(line) {
                ordinal = ordinal.checked_add(1)?;
                let start = at + (line.len() - line.trim_ascii_start().len());
                let (mut kind, mut own) = (like?, like?.read(text, start));
                if own.is_none() {
                    let fits = |other: &&Like| other.lead == kind.lead && other.fits(text);
                    kind = match others.iter().find(fits) {
                        Some(other) => other,
                        None if others.len() < MOST_KINDS => {
                            others.push(self.reader.like(&kind.lead, line)?);
                            others.last()?
                        }
                        None => return None,
                    };
                    own = kind.read(text, start);
                }
                let own = own?;
                external = kind.external(&own, &external);
                let (goal, site, [tool, wobj]) = (own.goal, own.site, frames);
                let (span, line) = (Span::new(start, own.end), u32::try_from(number).ok()?);
                let predecessor = Predecessor::Previous;
                program.targets.push(Target {
                    goal,
                    tool,
                    wobj,
                    ordinal,
                    span,
                    line,
                    predecessor,
                    external: external.clone(),
                    ..kind.target().clone()
                });
                sites.push(site);
                program.literal_targets += 1;
            } else if !text.is_empty() && text[0] != b';' && !is_speed(text) {
                return None;
            }
            at += line.len();
        }
        let motions = motions + self.motions as usize;
        program.layout = crate::Layout::Krl(Layout { sites, motions, ..Layout::default() });
        program.sources = [self.source].into();
        program.dialect = self.dialect;
        Some(StreamableChunk { program, own: self.own, elsewhere: Vec::new(), at: 0, last: self.last })
    }
}

/// An empty program.
fn empty(dialect: &'static str) -> Program {
    let layout = crate::Layout::Krl(Layout::default());
    Program::empty(Language::Krl, dialect, (Arc::new([]), 1), layout)
}

/// External axes that are not zero in a line.
fn axes_that_move(mut text: impl BufRead) -> io::Result<Axes> {
    let (mut found, mut line) = (Axes::default(), Vec::new());
    // One without an end is no line of a kind.
    while text.by_ref().take(LONGEST as u64).read_until(b'\n', &mut line)? > 0 {
        if is_motion(&line) {
            moved_axes(&line, &mut found);
        }
        line.clear();
    }
    Ok(found)
}

fn is_motion(line: &[u8]) -> bool {
    lex::is_line_of(line, b"LIN") || lex::is_line_of(line, b"SLIN")
}

/// The line at the start of `bytes`, with its end.
fn next_line(bytes: &[u8]) -> Option<&[u8]> {
    let end = memchr::memchr(b'\n', bytes).map_or(bytes.len(), |end| end + 1);
    Some(&bytes[..end]).filter(|line| !line.is_empty())
}
