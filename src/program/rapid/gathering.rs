//! What becomes of the targets of a run: all are held, or one motion of those that are alike, or they are handed on.

use super::agreed::Agreement;
use super::value::SourceSpan;
use crate::program::chunk::StreamableChunk;
use crate::program::{Editable, Program, Role};
use smallvec::SmallVec;
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;

/// What becomes of the targets of a run.
pub(super) enum Gathering {
    /// All are held.
    All,
    /// One motion of those that are alike.
    Distinct(Distinct),
    /// All, chunk by chunk, with what was found of those that are alike.
    Chunks(Box<Emitter>),
}

/// What the targets of one motion have in common with those that are alike.
pub(super) type Motion = SmallVec<[Point; 2]>;

/// What decides from the text what becomes of one target.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Point {
    pub(super) source: u16,
    pub(super) statement: u32,
    pub(super) role: Role,
    pub(super) tool: u16,
    pub(super) wobj: u16,
    pub(super) root: Option<u32>,
    pub(super) steps: SmallVec<[OffsetBy; 1]>,
    pub(super) editable: Editable,
}

/// One step of `Offs` or `RelTool`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct OffsetBy {
    pub(super) place: Option<SourceSpan>,
    /// Its numbers, where the target may be edited by it.
    pub(super) bits: [u64; 7],
}

/// Motions that are held once.
#[derive(Debug, Default)]
pub(super) struct Distinct {
    /// The first target of each among those held.
    pub(super) known: HashMap<Motion, u32>,
    /// Loops whose rounds turned out not to be known.
    pub(super) given_up: BTreeSet<u64>,
}

/// Hands on the targets of a run.
pub(super) struct Emitter {
    pub(super) found: Arc<Distinct>,
    /// One of each that are alike.
    pub(super) like: Arc<Program>,
    pub(super) agreement: Agreement,
    pub(super) out: SyncSender<StreamableChunk>,
    /// Targets in a chunk.
    pub(super) chunk: usize,
    pub(super) alike: Vec<u32>,
    /// The loop whose rounds are not followed.
    pub(super) muted: Option<u64>,
    pub(super) first: bool,
    /// It went elsewhere than the run before.
    pub(super) is_broken: bool,
}

impl Emitter {
    pub(super) fn new(
        found: Arc<Distinct>,
        like: Arc<Program>,
        agreement: Agreement,
        out: SyncSender<StreamableChunk>,
        chunk: usize,
    ) -> Self {
        Self { found, like, agreement, out, chunk, alike: Vec::new(), muted: None, first: true, is_broken: false }
    }
}

impl Gathering {
    /// A loop begins.
    pub(super) fn enter_loop(&mut self, number: u64) {
        if let Self::Chunks(emitter) = self
            && emitter.muted.is_none()
            && emitter.found.given_up.contains(&number)
        {
            emitter.muted = Some(number);
        }
    }

    /// The rounds of a loop are not known after all; so many targets were held before.
    pub(super) fn give_up_loop(&mut self, number: u64, targets: usize) {
        match self {
            Self::All => {}
            Self::Distinct(distinct) => {
                distinct.given_up.insert(number);
                distinct.known.retain(|_, at| (*at as usize) < targets);
            }
            Self::Chunks(emitter) => emitter.muted = emitter.muted.filter(|muted| *muted != number),
        }
    }
}
