//! The treatment of a run's targets: all are stored, or equal motions are stored once, or they are sent in chunks.

use super::agreed::Agreement;
use crate::chunk::StreamableChunk;
use crate::{Editable, Program, Role};
use deflex_lang::ir::SourceSpan;
use smallvec::SmallVec;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;

/// The treatment of a run's targets.
#[derive(Default)]
pub(super) enum Gathering {
    /// All are stored.
    #[default]
    All,
    /// Equal motions are stored once.
    Distinct(Distinct),
    /// All are sent chunk by chunk, with the results for equal motions.
    Chunks(Box<Emitter>),
}

/// The data of a motion's targets that equal motions share.
pub(super) type Motion = SmallVec<[Point; 2]>;

/// The properties of a target from the text, which decide whether and how it is edited.
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
    /// Its numbers, if the target may be edited by it.
    pub(super) bits: [u64; 10],
}

/// Motions, of which equal ones are stored once.
#[derive(Debug, Default)]
pub(super) struct Distinct {
    /// The first target of each motion among the stored ones.
    pub(super) known: HashMap<Motion, u32>,
    /// How often the results since a marker were discarded, by number of the marker.
    pub(super) given_up: HashMap<u64, u32>,
}

/// Sends the targets of a run in chunks.
pub(super) struct Emitter {
    pub(super) found: Arc<Distinct>,
    /// The program with one motion for all equal ones.
    pub(super) like: Arc<Program>,
    pub(super) agreement: Agreement,
    pub(super) out: SyncSender<StreamableChunk>,
    /// Targets in a chunk.
    pub(super) chunk: usize,
    pub(super) alike: Vec<u32>,
    /// A marker since which the run before discarded its results, and how often it still has to: until then, nothing is sent.
    pub(super) muted: Option<(u64, u32)>,
    pub(super) first: bool,
    /// Whether it differed from the run before.
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
    /// A marker is set.
    pub(super) fn mark(&mut self, number: u64) {
        if let Self::Chunks(emitter) = self
            && emitter.muted.is_none()
        {
            emitter.muted = emitter.found.given_up.get(&number).map(|times| (number, *times));
        }
    }

    /// Discards the motions since a marker; `targets` were stored before it.
    pub(super) fn back_to(&mut self, number: u64, targets: usize) {
        match self {
            Self::All => {}
            Self::Distinct(distinct) => {
                *distinct.given_up.entry(number).or_default() += 1;
                distinct.known.retain(|_, at| (*at as usize) < targets);
            }
            Self::Chunks(emitter) => {
                emitter.muted = emitter.muted.and_then(|(muted, times)| match muted == number {
                    true => (times > 1).then(|| (muted, times - 1)),
                    false => Some((muted, times)),
                });
            }
        }
    }
}
