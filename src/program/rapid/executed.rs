//! A program that runs through more motions than can be held: run once for what they have in common, and once more for each use of
//! its chunks.

use super::agreed::{Agreed, Agreement, Asked};
use super::gathering::{Distinct, Emitter, Gathering};
use super::runner::Runner;
use super::tree::File;
use super::{Cut, parsed, program_of};
use crate::program::{Next, Program, RewriteOptions, StreamableChunk};
use crate::text::{Diagnostic, Edit, Source};
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};

/// Motions up to which a program is held as a whole.
const HELD: u32 = 20_000;
/// Targets in a chunk: as many as in one of the text.
const TARGETS: usize = 512;
/// Chunks that wait.
const WAITING: usize = 2;

/// A program whose loops and calls run through more motions than are held.
#[derive(Clone, Debug)]
pub struct Executed {
    held: Arc<Held>,
    found: Arc<Distinct>,
    /// One motion of those that are alike.
    like: Arc<Program>,
    targets: usize,
}

/// The program as read.
#[derive(Debug)]
struct Held {
    sources: Arc<[Source]>,
    files: Vec<File>,
    written: usize,
}

impl Executed {
    /// Reads modules as one program; `None` where it has no loop or can be held as a whole.
    ///
    /// # Errors
    /// As [`read`](super::read).
    pub fn read(sources: Vec<Source>, context: Vec<Source>) -> Result<Option<Self>, Vec<Diagnostic>> {
        Self::sized(sources, context, HELD, TARGETS)
    }

    /// The same for programs of more than `held` motions, in chunks of so many targets.
    ///
    /// # Errors
    /// As [`read`](super::read).
    pub fn sized(
        sources: Vec<Source>,
        context: Vec<Source>,
        held: u32,
        targets: usize,
    ) -> Result<Option<Self>, Vec<Diagnostic>> {
        let dialect = super::dialect::of(&sources);
        let written = sources.len();
        if !sources.iter().any(|source| may_loop(&source.bytes)) {
            return Ok(None);
        }
        let (sources, files, _) = parsed(sources, context, Cut::Refused)?;
        let mut runner = Runner::new(&sources, &files, written);
        runner.gathering = Gathering::Distinct(Distinct::default());
        let (outcome, gathering, motions) = runner.run_gathering(&files);
        let Gathering::Distinct(found) = gathering else { return Ok(None) };
        if motions <= held {
            return Ok(None);
        }
        let like = program_of(outcome, (Arc::clone(&sources), &files, written), dialect, Vec::new())?;
        let held = Arc::new(Held { sources, files, written });
        Ok(Some(Self { held, found: Arc::new(found), like: Arc::new(like), targets }))
    }

    /// One motion of those that are alike: frames, reasons and messages are those of the program.
    #[must_use]
    pub fn distinct(&self) -> &Program {
        &self.like
    }

    /// What it moves to, nothing of it to be written.
    #[must_use]
    pub fn chunks(&self) -> ExecutedChunks {
        self.run(Agreement::None)
    }

    /// What it moves to, twice: first for what is to become of it, then, by what that came to, as it will be written.
    pub(crate) fn asked(&self) -> (ExecutedChunks, Asking<'_>) {
        let asked = Arc::new(Asked::default());
        (self.run(Agreement::Asked(Arc::clone(&asked))), Asking { program: self, asked })
    }

    fn run(&self, agreement: Agreement) -> ExecutedChunks {
        ExecutedChunks { program: self.clone(), agreement, chunks: None, ended: false }
    }

    /// Runs it on a thread of its own.
    fn start(&self, agreement: Agreement) -> io::Result<Receiver<StreamableChunk>> {
        let (out, chunks) = sync_channel(WAITING);
        let emitter = Emitter::new(Arc::clone(&self.found), Arc::clone(&self.like), agreement, out, self.targets);
        let held = Arc::clone(&self.held);
        let run = move || {
            let mut runner = Runner::new(&held.sources, &held.files, held.written);
            runner.gathering = Gathering::Chunks(Box::new(emitter));
            runner.emit_all();
        };
        std::thread::Builder::new().name("executed".into()).stack_size(STACK).spawn(run)?;
        Ok(chunks)
    }
}

/// What the main thread has: routines call one another and blocks nest as deep there.
const STACK: usize = 8 << 20;

/// The first of two runs of a program.
pub(crate) struct Asking<'a> {
    program: &'a Executed,
    asked: Arc<Asked>,
}

impl<'a> Asking<'a> {
    /// The second run.
    pub(crate) fn answered(self, options: &RewriteOptions) -> io::Result<(ExecutedChunks, Answer)> {
        let none = || io::Error::other("the program has no layout");
        let agreed = Arc::new(self.asked.agreed(&self.program.like, options).ok_or_else(none)?);
        Ok((self.program.run(Agreement::Found(Arc::clone(&agreed))), Answer(agreed)))
    }
}

/// What becomes of the text.
pub(crate) struct Answer(Arc<Agreed>);

impl Answer {
    /// Edits of each source; `None` where a motion wanted in the second run what none had in the first.
    pub(crate) fn edits(&self) -> Option<&[Vec<Edit>]> {
        self.0.holds().then_some(&self.0.edits)
    }
}

/// Targets in the order in which the program runs through them.
#[derive(Debug)]
pub struct ExecutedChunks {
    program: Executed,
    agreement: Agreement,
    /// Once it runs.
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
    /// No thread can be had; the run broke off.
    pub fn take(&mut self) -> io::Result<Next<StreamableChunk>> {
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

/// Whether there may be a loop: its word stands somewhere, maybe in a comment.
fn may_loop(text: &[u8]) -> bool {
    let mut words = text.split(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_');
    words.any(|word| word.eq_ignore_ascii_case(b"FOR") || word.eq_ignore_ascii_case(b"WHILE"))
}
