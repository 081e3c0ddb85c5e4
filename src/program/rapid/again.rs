//! Motions that are run more than once: those that are alike are held once, and a program of many is run again for what each of
//! its chunks moves to.
//!
//! Alike are executed motions of the same statement, by the same numbers of the text, under the same tool and work object, that
//! may be edited to the same extent: whatever is decided of one from the text is decided of all. How many there are is bounded by the
//! text, whatever number of them is executed.

use super::Site;
use super::agreed::Again;
use super::gathering::{Gathering, Motion, OffsetBy, Point};
use super::runner::Runner;
use crate::program::chunk::StreamableChunk;
use crate::program::{Editable, Program, Role, Target, UnknownMotion};
use std::sync::Arc;

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

    /// A motion is complete, and it is not known where it goes.
    pub(super) fn miss(&mut self, motion: UnknownMotion) {
        // One of those that are alike need not be held: they are met again.
        if !matches!(self.gathering, Gathering::Distinct(_)) {
            self.unknown.push(motion);
        }
        if let Gathering::Chunks(emitter) = &self.gathering
            && emitter.muted.is_none()
            && self.unknown.len() >= emitter.chunk
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
        let Some(layout) = super::Layout::of(like) else { return };
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
            unknown: std::mem::take(&mut self.unknown),
            // Said once.
            diagnostics: if emitter.first { like.diagnostics.clone() } else { Vec::new() },
            ..Program::empty(like.language, like.dialect, (Arc::clone(&like.sources), like.written), layout)
        };
        emitter.first = false;
        let chunk = StreamableChunk { program, own: 0..0, elsewhere: Vec::new(), at: 0, last };
        if emitter.out.send(chunk).is_err() {
            // The receiver has ended.
            self.steps = usize::MAX;
        }
    }

    /// Runs the program, handing on its targets.
    pub(super) fn emit_all(mut self) {
        self.follow();
        let is_broken = matches!(&self.gathering, Gathering::Chunks(emitter) if emitter.is_broken);
        // Without a last chunk the receiver knows that the run was cut short.
        if !is_broken {
            self.emit(true);
        }
    }
}

/// Steps that a motion takes back: what goes on moving goes on.
const STEPS_PER_MOTION: usize = 64;
