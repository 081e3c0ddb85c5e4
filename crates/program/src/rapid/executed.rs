//! A program that runs through more motions than memory can hold. It runs once to find equal motions, and once more for each use of its
//! chunks.

use super::agreed::{Agreed, Agreement, WantedValues};
use super::gathering::{Distinct, Emitter, Gathering};
use super::{Cut, Parsed, parsed};
use crate::{Next, Program, RewriteOptions, StreamableChunk};
use deflex_text::{Diagnostic, Edit, Source};
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};

/// Most motions of a program that is held as a whole.
const HELD: u32 = 20_000;
/// Number of targets in a chunk: as many as in a chunk of the text.
const TARGETS: usize = 512;
/// Most waiting chunks.
const WAITING: usize = 2;

/// A program whose loops and calls run through more motions than memory can hold.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct Executed {
    parsed: Arc<Parsed>,
    found: Arc<Distinct>,
    /// The program with one motion for all equal ones.
    like: Arc<Program>,
    targets: usize,
}

impl Executed {
    /// Reads modules as one program; `None` if it has no loop or can be held as a whole.
    ///
    /// # Errors
    /// As [`read`](super::read).
    pub fn read(sources: Vec<Source>, context: Vec<Source>) -> Result<Option<Self>, Vec<Diagnostic>> {
        Self::sized(sources, context, HELD, TARGETS)
    }

    /// The same for programs of more than `held` motions, in chunks of `targets` targets.
    ///
    /// # Errors
    /// As [`read`](super::read).
    pub fn sized(
        sources: Vec<Source>,
        context: Vec<Source>,
        held: u32,
        targets: usize,
    ) -> Result<Option<Self>, Vec<Diagnostic>> {
        if !sources.iter().any(|source| may_loop(&source.bytes)) {
            return Ok(None);
        }
        let parsed = parsed(super::dialect::of(&sources), sources, context, Cut::Refused)?;
        let mut runner = parsed.runner();
        runner.gathering = Gathering::Distinct(Distinct::default());
        let (like, gathering) = runner.run_gathering();
        let Gathering::Distinct(found) = gathering else { return Ok(None) };
        if like.motion_targets() <= held as usize {
            return Ok(None);
        }
        let like = Arc::new(parsed.program(like)?);
        Ok(Some(Self { parsed: Arc::new(parsed), found: Arc::new(found), like, targets }))
    }

    /// The program with one motion for all equal ones; its frames, reasons and messages are those of the whole program.
    #[must_use]
    pub fn distinct(&self) -> &Program {
        &self.like
    }

    /// Its targets in chunks, if nothing will be written.
    #[must_use]
    pub fn chunks(&self) -> ExecutedChunks {
        self.run(Agreement::None)
    }

    /// Its targets in chunks for two runs: the first to compute the corrections, the second with the corrections as they will be written.
    pub fn chunks_of_two_runs(&self) -> (ExecutedChunks, FirstRun<'_>) {
        let wanted = Arc::new(WantedValues::default());
        (self.run(Agreement::Open(Arc::clone(&wanted))), FirstRun { program: self, wanted })
    }

    fn run(&self, agreement: Agreement) -> ExecutedChunks {
        ExecutedChunks { program: self.clone(), agreement, chunks: None, ended: false }
    }

    /// Runs it on a thread of its own.
    fn start(&self, agreement: Agreement) -> io::Result<Receiver<StreamableChunk>> {
        let (out, chunks) = sync_channel(WAITING);
        let emitter = Emitter::new(Arc::clone(&self.found), Arc::clone(&self.like), agreement, out, self.targets);
        let parsed = Arc::clone(&self.parsed);
        let run = move || {
            let mut runner = parsed.runner();
            runner.gathering = Gathering::Chunks(Box::new(emitter));
            runner.emit_all();
        };
        std::thread::Builder::new().name("executed".into()).stack_size(STACK).spawn(run)?;
        Ok(chunks)
    }
}

/// Bytes of the stack, as for the main thread, on which routines and blocks are nested equally deep.
const STACK: usize = 8 << 20;

/// The first of two runs of a program.
#[doc(hidden)]
pub struct FirstRun<'a> {
    program: &'a Executed,
    wanted: Arc<WantedValues>,
}

impl<'a> FirstRun<'a> {
    /// The second run.
    pub fn answered(self, options: &RewriteOptions<'_>) -> io::Result<(ExecutedChunks, Answer)> {
        let none = || io::Error::other("the program has no layout");
        let agreed = Arc::new(self.wanted.agreed(&self.program.like, options).ok_or_else(none)?);
        Ok((self.program.run(Agreement::Known(Arc::clone(&agreed))), Answer(agreed)))
    }
}

/// The edits of the text.
#[doc(hidden)]
pub struct Answer(Arc<Agreed>);

impl Answer {
    /// Edits of each source; `None` if a motion wanted a value in the second run that none had in the first.
    pub fn edits(&self) -> Option<&[Vec<Edit>]> {
        self.0.holds().then_some(&self.0.edits)
    }
}

/// Targets in the order in which the program runs through them.
#[derive(Debug)]
#[doc(hidden)]
pub struct ExecutedChunks {
    program: Executed,
    agreement: Agreement,
    /// The chunks, after the run has started.
    chunks: Option<Receiver<StreamableChunk>>,
    ended: bool,
}

impl ExecutedChunks {
    /// The program.
    #[must_use]
    pub fn program(&self) -> &Executed {
        &self.program
    }

    /// The next chunk.
    ///
    /// # Errors
    /// No thread can be started; the run ended early.
    pub(crate) fn take(&mut self) -> io::Result<Next<StreamableChunk>> {
        if self.ended {
            return Ok(Next::End);
        }
        let chunks = match &mut self.chunks {
            Some(chunks) => chunks,
            none => none.insert(self.program.start(self.agreement.clone())?),
        };
        let chunk = chunks.recv().map_err(|_| io::Error::other("the run of the program broke off"))?;
        self.ended = chunk.last;
        Ok(Next::Chunk(chunk))
    }
}

/// Whether there may be a loop: its word occurs in the text, possibly in a comment.
fn may_loop(text: &[u8]) -> bool {
    let mut words = text.split(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_');
    words.any(|word| word.eq_ignore_ascii_case(b"FOR") || word.eq_ignore_ascii_case(b"WHILE"))
}
