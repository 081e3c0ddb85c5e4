//! Motions that run more than once. Equal motions are stored once, and a program with many motions runs again to make the targets of each
//! chunk.
//!
//! Executed motions are equal if they have the same statement, the same numbers of the text, the same tool and work object, and the same
//! editable parts. Every decision from the text about one of them applies to all. Their number is bounded by the text, however many motions
//! are executed.

use super::agreed::Again;
use super::gathering::{Gathering, Motion, OffsetBy, Point};
use super::runner::Runner;
use super::{Given, TargetInText};
use crate::chunk::StreamableChunk;
use crate::{Editable, Predecessor, Program, Role, Target, UnknownMotion};
use std::sync::Arc;

impl Runner<'_> {
    /// Ends a motion, whose targets are the last ones.
    pub(super) fn gather(&mut self) {
        self.budget.give_back(STEPS_PER_MOTION);
        if matches!(self.gathering, Gathering::All) {
            return;
        }
        let end = self.found.targets.len() - 1;
        let from = if end > 0 && self.found.targets[end - 1].role == Role::Via { end - 1 } else { end };
        let motion: Motion = (from..=end).map(|i| self.alike(i)).collect();
        let first_offset = self.found.sites[from..].iter().filter_map(|site| match site {
            TargetInText::Offset(at) => Some(*at as usize),
            _ => None,
        });
        let offsets = first_offset.min().unwrap_or(self.found.offsets.len());
        #[allow(clippy::cast_possible_truncation)] // limited by the Runner
        let drops = match &mut self.gathering {
            Gathering::All => false,
            Gathering::Distinct(distinct) => match distinct.known.get(&motion) {
                Some(_) => true,
                None => {
                    distinct.known.insert(motion, from as u32);
                    false
                }
            },
            Gathering::Chunks(emitter) => {
                let known = emitter.found.known.get(&motion).filter(|_| emitter.muted.is_none());
                if let Some(known) = known {
                    let sites = &super::Layout::of(&emitter.like).map_or(&[][..], |layout| &layout.sites);
                    let own = self.found.targets[from..].iter_mut().zip(&mut self.found.sites[from..]);
                    for ((target, site), like) in own.zip(*known..) {
                        // It may be corrected by its base.
                        if let Some(TargetInText::Literal { literal, given: Given::Base }) = sites.get(like as usize) {
                            *site = TargetInText::Literal { literal: *literal, given: Given::Base };
                        }
                        let like_target = &emitter.like.targets[like as usize];
                        target.editable = like_target.editable;
                        if like_target.predecessor == Predecessor::Unknown {
                            target.predecessor = Predecessor::Unknown;
                            target.begins_mm = target.begins_mm.filter(|_| like_target.begins_mm.is_some());
                        }
                        emitter.alike.push(like);
                    }
                }
                if known.is_none() && emitter.muted.is_none() {
                    // Both runs must be the same: a motion that only this one has would be lost without a message.
                    emitter.is_broken = true;
                    self.budget.end();
                }
                known.is_none()
            }
        };
        if drops {
            self.found.targets.truncate(from);
            self.found.sites.truncate(from);
            self.found.offsets.truncate(offsets);
        } else if let Gathering::Chunks(emitter) = &self.gathering
            && self.found.targets.len() >= emitter.chunk
        {
            self.emit(false);
        }
    }

    /// Ends a motion whose target is unknown.
    pub(super) fn miss(&mut self, motion: UnknownMotion) {
        // Equal motions need not be stored here: they occur again in the second run.
        if !matches!(self.gathering, Gathering::Distinct(_)) {
            self.found.unknown.push(motion);
        }
        if let Gathering::Chunks(emitter) = &self.gathering
            && emitter.muted.is_none()
            && self.found.unknown.len() >= emitter.chunk
        {
            self.emit(false);
        }
    }

    /// The data of a target that equal targets share.
    fn alike(&self, i: usize) -> Point {
        let (target, site): (&Target, &TargetInText) = (&self.found.targets[i], &self.found.sites[i]);
        let steps = match site {
            TargetInText::Offset(at) => &self.found.offsets[*at as usize].steps[..],
            _ => &[],
        };
        let edited = target.editable == Editable::Position || Self::is_computed_shift(target, steps);
        let step = |step: &super::OffsetStep| {
            let stated = step.stated_mm.map(|stated| stated.unwrap_or(f64::NAN));
            let numbers = if edited { [&step.offset_mm[..], &step.turn, &stated].concat() } else { vec![0.0; 10] };
            OffsetBy { place: step.place(), bits: std::array::from_fn(|k| numbers[k].to_bits()) }
        };
        Point {
            source: target.source,
            statement: target.span.start,
            role: target.role,
            tool: target.tool,
            wobj: target.wobj,
            root: self.found.root(site),
            steps: steps.iter().map(step).collect(),
            editable: target.editable,
        }
    }

    /// Sends the stored targets as a chunk.
    fn emit(&mut self, last: bool) {
        let Gathering::Chunks(emitter) = &mut self.gathering else { return };
        let like = &emitter.like;
        let Some(layout) = super::Layout::of(like) else { return };
        let again = Again::new(std::mem::take(&mut emitter.alike), emitter.agreement.clone());
        let layout = crate::Layout::Rapid(super::Layout {
            literals: Arc::clone(&layout.literals),
            sites: std::mem::take(&mut self.found.sites),
            offsets: std::mem::take(&mut self.found.offsets),
            bound_to_point: layout.bound_to_point.clone(),
            again: Some(again),
            ..super::Layout::default()
        });
        let program = Program {
            tools: like.tools.clone(),
            wobjs: like.wobjs.clone(),
            targets: std::mem::take(&mut self.found.targets),
            unknown: std::mem::take(&mut self.found.unknown),
            // Only in the first chunk.
            diagnostics: if emitter.first { like.diagnostics.clone() } else { Vec::new() },
            ..Program::empty(like.language, like.dialect, (Arc::clone(&like.sources), like.written), layout)
        };
        emitter.first = false;
        let chunk = StreamableChunk { program, own: 0..0, elsewhere: Vec::new(), at: 0, last };
        if emitter.out.send(chunk).is_err() {
            // The receiver has ended.
            self.budget.end();
        }
    }

    /// Runs the program, and sends its targets.
    pub(super) fn emit_all(mut self) {
        self.follow();
        let is_broken = matches!(&self.gathering, Gathering::Chunks(emitter) if emitter.is_broken);
        // Without a last chunk the receiver knows that the run was cut short.
        if !is_broken {
            self.emit(true);
        }
    }
}

/// Number of steps that a motion gives back, so that a program that goes on moving may go on.
const STEPS_PER_MOTION: usize = 64;
