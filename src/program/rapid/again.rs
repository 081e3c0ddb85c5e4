//! Motions that are run more than once: those that are alike are held once, and a program of many is run again for what each of
//! its chunks moves to.
//!
//! Alike are executed motions of the same statement, by the same numbers of the text, under the same tool and work object, that
//! may be edited to the same extent: whatever is decided of one from the text is decided of all. How many there are is bounded by the
//! text, whatever number of them is executed.

use super::Site;
use super::agreed::{Again, Agreement};
use super::run::Runner;
use super::value::Place;
use crate::program::chunk::StreamableChunk;
use crate::program::{Editable, Program, Role, Target};
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
    source: u16,
    statement: u32,
    role: Role,
    tool: u16,
    wobj: u16,
    root: Option<u32>,
    steps: SmallVec<[OffsetBy; 1]>,
    editable: Editable,
}

/// One step of `Offs` or `RelTool`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct OffsetBy {
    place: Option<Place>,
    /// Its numbers, where the target may be edited by it.
    bits: [u64; 7],
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
    found: Arc<Distinct>,
    /// One of each that are alike.
    like: Arc<Program>,
    agreement: Agreement,
    out: SyncSender<StreamableChunk>,
    /// Targets in a chunk.
    chunk: usize,
    alike: Vec<u32>,
    /// The loop whose rounds are not followed.
    muted: Option<u64>,
    first: bool,
    /// It went elsewhere than the run before.
    is_broken: bool,
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

impl Runner<'_> {
    /// A motion is complete: its targets are the last.
    pub(super) fn gather(&mut self) {
        if matches!(self.gathering, Gathering::All) {
            return;
        }
        self.steps = if self.steps == usize::MAX { self.steps } else { self.steps.saturating_sub(STEPS_PER_MOTION) };
        let end = self.targets.len() - 1;
        let from = if end > 0 && self.targets[end - 1].role == Role::Via { end - 1 } else { end };
        let motion: Motion = (from..=end).map(|i| self.alike(i)).collect();
        let first_offset = self.sites[from..].iter().filter_map(|site| match site {
            Site::Offset(at) => Some(*at as usize),
            _ => None,
        });
        let offsets = first_offset.min().unwrap_or(self.offsets.len());
        #[allow(clippy::cast_possible_truncation)] // limited by the Runner
        let drops = match &mut self.gathering {
            Gathering::All => false,
            Gathering::Distinct(distinct) => match distinct.known.get(&motion) {
                Some(known) => {
                    self.standing.clear();
                    self.standing.insert(*known as usize + end - from);
                    true
                }
                None => {
                    distinct.known.insert(motion, from as u32);
                    false
                }
            },
            Gathering::Chunks(emitter) => {
                self.standing.clear();
                let known = emitter.found.known.get(&motion).filter(|_| emitter.muted.is_none());
                if let Some(known) = known {
                    for (target, like) in self.targets[from..].iter_mut().zip(*known..) {
                        target.editable = emitter.like.targets[like as usize].editable;
                        emitter.alike.push(like);
                    }
                }
                if known.is_none() && emitter.muted.is_none() {
                    // Both runs are the same: what only this one has would go missing without a word.
                    emitter.is_broken = true;
                    self.steps = usize::MAX;
                }
                known.is_none()
            }
        };
        if drops {
            self.targets.truncate(from);
            self.sites.truncate(from);
            self.offsets.truncate(offsets);
        } else if let Gathering::Chunks(emitter) = &self.gathering
            && self.targets.len() >= emitter.chunk
        {
            self.emit(false);
        }
    }

    /// What a target has in common with those that are alike.
    fn alike(&self, i: usize) -> Point {
        let (target, site): (&Target, &Site) = (&self.targets[i], &self.sites[i]);
        let steps = match site {
            Site::Offset(at) => &self.offsets[*at as usize].steps[..],
            _ => &[],
        };
        let edited = target.editable == Editable::Position;
        let step = |step: &super::Step| {
            let numbers = if edited { [&step.offset_mm[..], &step.turn].concat() } else { vec![0.0; 7] };
            OffsetBy { place: step.place(), bits: std::array::from_fn(|k| numbers[k].to_bits()) }
        };
        Point {
            source: target.source,
            statement: target.span.start,
            role: target.role,
            tool: target.tool,
            wobj: target.wobj,
            root: self.root(site),
            steps: steps.iter().map(step).collect(),
            editable: target.editable,
        }
    }

    /// Hands on what is held.
    fn emit(&mut self, last: bool) {
        let Gathering::Chunks(emitter) = &mut self.gathering else { return };
        let like = &emitter.like;
        let Some(layout) = super::chunk::layout(like) else { return };
        let again = Again::new(std::mem::take(&mut emitter.alike), emitter.agreement.clone());
        let layout = crate::program::Layout::Rapid(super::Layout {
            literals: Arc::clone(&layout.literals),
            sites: std::mem::take(&mut self.sites),
            offsets: std::mem::take(&mut self.offsets),
            again: Some(again),
            ..super::Layout::default()
        });
        let program = Program {
            tools: like.tools.clone(),
            wobjs: like.wobjs.clone(),
            targets: std::mem::take(&mut self.targets),
            // Said once.
            diagnostics: if emitter.first { like.diagnostics.clone() } else { Vec::new() },
            ..Program::empty(like.language, like.dialect, (Arc::clone(&like.sources), like.written), layout)
        };
        emitter.first = false;
        let chunk = StreamableChunk { program, own: 0..0, elsewhere: Vec::new(), at: 0, last };
        if emitter.out.send(chunk).is_err() {
            // Nobody wants more.
            self.steps = usize::MAX;
        }
    }

    /// Runs the program, handing on its targets.
    pub(super) fn emit_all(mut self) {
        self.follow();
        let is_broken = matches!(&self.gathering, Gathering::Chunks(emitter) if emitter.is_broken);
        // Without a last chunk whoever takes them knows that it broke off.
        if !is_broken {
            self.emit(true);
        }
    }
}

/// Steps that a motion takes back: what goes on moving goes on.
const STEPS_PER_MOTION: usize = 64;
