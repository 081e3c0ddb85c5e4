//! A long program in chunks that fit in memory.
//!
//! A procedure that only moves from inline target to inline target can be divided between any two statements. A chunk is the module's
//! head, a stretch of the body and an end. It is therefore a program of its own, which [`read`](super::read) reads like any other. The chunk as
//! read is checked for anything that would give it another meaning than the same lines in the whole program (an assignment, a call, a
//! declared target, an offset of external axes, …). A program with any of these is not streamable and is read as a whole.

use super::chunk::Chunk;
use super::kinds::Kinds;
use super::lex::{Cursor, LexemeKind};
use super::lines::{CHUNK, END, LONGEST_HEAD, first_word, is_motion, line_of};
use super::predefined::harmless;
use crate::{Language, Mark, Next, detect};
use deflex_text::{Source, Span, lines};
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;

/// Most bytes before the first motion and after the last.
const HEAD: usize = 1 << 20;

/// Number of motions that ends a chunk: motions to declared targets take few bytes.
const MOTIONS: u32 = 1024;

/// Bytes that a chunk may have to read further to the end of a line.
const LONGEST: usize = 4096;

/// Number of chunks that are read at once.
const AHEAD: usize = 4;

/// The first word of a body.
const FIRST: &[u8] = b"MoveL";

/// Divides a program into chunks, and reads no further than needed.
#[derive(Debug)]
#[doc(hidden)]
pub struct Chunks<R> {
    input: R,
    name: String,
    /// Bytes of the body in a chunk.
    chunk: usize,
    dialect: &'static str,
    context: Arc<[Source]>,
    kinds: Arc<Kinds>,
    /// The text up to the line of the first motion.
    head: Vec<u8>,
    head_lines: usize,
    plain_head: bool,
    /// The text that is read and, from an offset on, not yet in a chunk.
    rest: Vec<u8>,
    cut: usize,
    lines: usize,
    motions: u32,
    /// Line of the last motion.
    last_line: usize,
    mark: Option<Mark>,
    state: ReadingStage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ReadingStage {
    First,
    Further,
    Ended,
}

impl<R: Read> Chunks<R> {
    /// Reads the head; `None` if the input does not begin like a streamable program. Each chunk is read with the modules of `context`, which
    /// must therefore be short.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn new(name: &str, input: R, context: &[Source]) -> io::Result<Option<Self>> {
        Self::sized(name, input, context, CHUNK)
    }

    /// The same for a file, whose end is examined first: it shows most programs that have several routines.
    ///
    /// # Errors
    /// `file` cannot be read.
    pub(crate) fn of_file(name: &str, mut file: R, context: &[Source]) -> io::Result<Option<Self>>
    where
        R: Seek,
    {
        /// Bytes that `main` takes after all routines, or the last of many routines.
        const TAIL: u64 = 64 * 1024;
        let len = file.seek(SeekFrom::End(0))?;
        file.seek(SeekFrom::Start(len.saturating_sub(TAIL)))?;
        let mut tail = Vec::new();
        file.by_ref().take(TAIL).read_to_end(&mut tail)?;
        file.rewind()?;
        let ends = |line: &&[u8]| first_word(line.trim_ascii()).eq_ignore_ascii_case(b"ENDPROC");
        match lines(&tail).filter(ends).nth(1) {
            Some(_) => Ok(None),
            None => Self::new(name, file, context),
        }
    }

    /// The same, with chunks of about `chunk` bytes.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn sized(name: &str, input: R, context: &[Source], chunk: usize) -> io::Result<Option<Self>> {
        if context.iter().map(|source| source.bytes.len()).sum::<usize>() > LONGEST_HEAD {
            return Ok(None);
        }
        let mut chunks = Self {
            input,
            name: name.to_owned(),
            chunk,
            dialect: "rapid",
            context: context.into(),
            kinds: Arc::default(),
            head: Vec::new(),
            head_lines: 0,
            plain_head: false,
            rest: Vec::new(),
            cut: 0,
            lines: 0,
            motions: 0,
            last_line: 0,
            mark: None,
            state: ReadingStage::First,
        };
        chunks.fill(LONGEST_HEAD)?;
        let begin = &chunks.rest[..chunks.rest.len().min(LONGEST_HEAD)];
        let Some(first) = first_motion(begin) else { return Ok(None) };
        chunks.head = chunks.rest.drain(..first).collect();
        chunks.head_lines = chunks.head.iter().filter(|b| **b == b'\n').count();
        let comments = chunks.head.split(|b| *b == b'\n').filter_map(|line| line.trim_ascii().strip_prefix(b"!"));
        chunks.mark = comments.rev().find_map(Mark::of);
        chunks.lines = chunks.head_lines;
        let head = Source::new(name, [&chunks.head, END].concat());
        let rapid = detect(name, &head.bytes) == Some(Language::Rapid);
        let Some(head) = super::read(vec![head], chunks.context.to_vec()).ok().filter(|_| rapid) else {
            return Ok(None);
        };
        chunks.dialect = head.dialect;
        chunks.plain_head = head.literal_targets == 0 && chunks.context.is_empty();
        Ok((super::Layout::of(&head).is_some_and(|layout| layout.streamable) && head.targets.is_empty())
            .then_some(chunks))
    }

    /// The same for an input that begins with the first motion, after `lines` lines; `head` is the text of them that every chunk needs.
    pub(super) fn after_head(
        name: &str,
        input: R,
        context: &[Source],
        head: Vec<u8>,
        lines: usize,
        chunk: usize,
    ) -> io::Result<Option<Self>> {
        // The head comes from memory, and is no chunk's own.
        let begun = [&head, FIRST].concat();
        let Some(chunks) = Chunks::new(name, &begun[..], context)? else { return Ok(None) };
        let Chunks { name, dialect, context, kinds, head, head_lines, plain_head, mark, .. } = chunks;
        Ok(Some(Self {
            input,
            name,
            chunk,
            dialect,
            context,
            kinds,
            head,
            head_lines,
            plain_head,
            rest: Vec::new(),
            cut: 0,
            lines,
            motions: 0,
            last_line: 0,
            mark,
            state: ReadingStage::Further,
        }))
    }

    /// Reads until `wanted` bytes are waiting, or to the end.
    fn fill(&mut self, wanted: usize) -> io::Result<()> {
        if self.rest.len() - self.cut < wanted {
            self.rest.drain(..std::mem::take(&mut self.cut));
            let missing = wanted + AHEAD * self.chunk - self.rest.len();
            self.input.by_ref().take(missing as u64).read_to_end(&mut self.rest)?;
        }
        Ok(())
    }

    /// The next chunk, which ends after a statement.
    ///
    /// # Errors
    /// The input cannot be read.
    pub fn take(&mut self) -> io::Result<Next<Chunk>> {
        if self.state == ReadingStage::Ended {
            return Ok(Next::End);
        }
        let (motions_before, before_stretch, mark_before) = (self.motions, self.lines, self.mark);
        // A line at the end of a chunk is read to its end; no program has a line longer than a chunk.
        self.fill(2 * self.chunk + LONGEST)?;
        let Some(cut) = self.cut() else { return Ok(Next::NotStreamable) };
        // An inserted line has the line end of the line before.
        let mark = match mark_before {
            None => Vec::new(),
            Some(Mark::Air) => [b"! deflex air", line_end(&self.head)].concat(),
            Some(Mark::Cut) => [b"! deflex cut", line_end(&self.head)].concat(),
        };
        let mut bytes = Vec::with_capacity(self.head.len() + cut.stretch + END.len() + mark.len() + HEAD_ROOM);
        bytes.extend_from_slice(&self.head);
        let first = self.state == ReadingStage::First;
        // The first chunk's marks stand in its head.
        let before = if first { &[][..] } else { &mark };
        bytes.extend_from_slice(before);
        let from = bytes.len();
        bytes.extend_from_slice(&self.rest[self.cut..self.cut + cut.stretch]);
        let stretch = from..bytes.len();
        let mut own = if first { 0 } else { from }..bytes.len();
        self.cut += cut.stretch;
        self.lines += cut.lines;
        self.state = ReadingStage::Further;
        if cut.last {
            self.fill(HEAD + 1)?;
            let end = &self.rest[self.cut..];
            if !is_end(end) {
                return Ok(Next::NotStreamable);
            }
            bytes.extend_from_slice(end);
            own.end = bytes.len();
            self.state = ReadingStage::Ended;
        } else {
            bytes.extend_from_slice(END);
        }
        let added = self.head_lines + usize::from(!before.is_empty());
        let mut source = Source::new(self.name.clone(), bytes);
        // Below zero for no chunk: the head's own lines stand before every stretch; a mark's line may be one too many.
        let Some(lines_before) = (if first { Some(0) } else { before_stretch.checked_sub(added) }) else {
            return Ok(Next::NotStreamable);
        };
        source.lines_before = lines_before;
        Ok(Next::Chunk(Chunk {
            dialect: self.dialect,
            context: Arc::clone(&self.context),
            source,
            own,
            head: self.head.len(),
            stretch,
            lines_before: before_stretch,
            plain_head: self.plain_head,
            declared: 0..0,
            kinds: Arc::clone(&self.kinds),
            mark_before,
            elsewhere: Vec::new(),
            at: 0,
            lines: Vec::new(),
            motions_before,
            motions: self.motions - motions_before,
            last_line: self.last_line,
            mark_at_end: self.mark,
            last: cut.last,
        }))
    }

    /// The end of the stretch that begins at `rest`; its motions and marks are counted.
    fn cut(&mut self) -> Option<Cut> {
        let (mut at, mut lines, mut moves) = (0, 0, false);
        let rest = &self.rest[self.cut..];
        let whole = rest.len() < 2 * self.chunk + LONGEST;
        let most = self.motions + MOTIONS;
        // How the last motion's line begins, its word with the byte after it.
        let mut lead: &[u8] = &[];
        while at < self.chunk && self.motions < most || !moves {
            let line = line_of(&rest[at..]);
            let ended = line.last() == Some(&b'\n');
            if line.is_empty() || !ended && !whole {
                // The program ends without ENDPROC, or a line never ends.
                return None;
            }
            let text = line.trim_ascii();
            moves = !lead.is_empty() && line.starts_with(lead) && text.ends_with(b";");
            match text.first() {
                None => {}
                Some(b'!') => self.mark = Mark::of(&text[1..]).or(self.mark),
                Some(_) => {
                    if !moves {
                        let word = first_word(text);
                        if word.eq_ignore_ascii_case(b"ENDPROC") {
                            return Some(Cut { stretch: at, lines, last: true });
                        }
                        moves = is_motion(word);
                        // A statement on several lines, or a comment after one, is not examined further.
                        if !text.ends_with(b";") || !moves && !harmless(text) {
                            return None;
                        }
                        if moves {
                            lead = &line[..line.len() - line.trim_ascii_start().len() + word.len() + 1];
                        }
                    }
                    if moves {
                        self.motions += 1;
                        self.last_line = self.lines + lines + 1;
                    }
                }
            }
            at += line.len();
            lines += usize::from(ended);
        }
        Some(Cut { stretch: at, lines, last: false })
    }
}

/// Reserved bytes for the end of the last chunk.
const HEAD_ROOM: usize = 256;

struct Cut {
    /// Bytes.
    stretch: usize,
    /// Line ends in them.
    lines: usize,
    /// ENDPROC follows.
    last: bool,
}

/// How the last line ends.
fn line_end(text: &[u8]) -> &[u8] {
    let returns = text.iter().rev().skip(1).take_while(|b| **b == b'\r').count();
    &text[text.len().saturating_sub(1 + returns)..]
}

/// Offset of the line of the first motion.
fn first_motion(bytes: &[u8]) -> Option<usize> {
    let mut at = 0;
    while at < bytes.len() {
        let line = line_of(&bytes[at..]);
        if is_motion(first_word(line.trim_ascii())) {
            return Some(at);
        }
        at += line.len();
    }
    None
}

/// Whether a text has only ENDPROC, ENDMODULE and comments.
fn is_end(bytes: &[u8]) -> bool {
    if bytes.len() > HEAD {
        return false;
    }
    let mut cursor = Cursor::new(bytes, Span::new(0, bytes.len()));
    let mut words = [&b"ENDPROC"[..], b"ENDMODULE"].into_iter();
    loop {
        let lexeme = cursor.next();
        match lexeme.kind {
            LexemeKind::End => return words.next().is_none(),
            LexemeKind::Word if words.next().is_some_and(|word| word.eq_ignore_ascii_case(cursor.text(lexeme))) => {}
            _ => return false,
        }
    }
}
