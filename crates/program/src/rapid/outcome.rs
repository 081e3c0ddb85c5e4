//! The outcome of a run: the targets that may be edited after all, and whether the program can be cut anywhere.

use super::runner::Runner;
use super::state::Standing;
use super::tree::{File, RoutineKind, StatementKind};
use super::value::{Number, OffsetStep};
use super::{Given, Layout, Offset, TargetInText};
use crate::{Editable, Goal, Language, Motion, Program, Reason, Role, Target};
use deflex_lang::ir::SourceSpan;
use std::collections::HashSet;
use std::sync::{Arc, OnceLock};

impl Runner<'_> {
    /// Ends the run. The program has no sources yet, and nothing that is known without the run.
    pub(super) fn finish(mut self) -> Program {
        self.refuse_what_is_counted_from();
        let elsewhere = self.runs_elsewhere();
        self.hold_what_runs_elsewhere(&elsewhere);
        self.hold_what_is_used_otherwise();
        self.hold_other_arcs();
        self.bind_what_steps_otherwise();
        self.hold_what_is_not_always_assembled();
        let plain = self.plain();
        let streamable = plain && self.inline();
        self.refuse_what_calls_itself();
        self.hold_what_cannot_stand();
        self.correct_by_bases();
        // One refusal may lead to another.
        loop {
            let before = self.refused();
            self.refuse_halves_of_arcs();
            self.refuse_shared_offsets();
            self.refuse_shared_declarations();
            if self.refused() == before {
                break;
            }
        }
        self.keep_what_is_refused();
        self.keep_what_is_not_run();
        self.report_traps_that_move();
        self.report_routines_that_keep_targets();
        let runs_elsewhere = self.starts_in(elsewhere.unknown.iter().chain(&elsewhere.recorded));
        let layout = Layout {
            literals: Arc::new(self.numbers.literals),
            sites: self.found.sites,
            offsets: self.found.offsets,
            standing: Arc::new(self.found.standing),
            joints_elsewhere: self.found.joints_elsewhere,
            bound_to_point: self.found.bound_to_point,
            motions: self.counters.motions as usize,
            streamable,
            plain,
            after_compact_if: (0..)
                .zip(self.symbols.files)
                .flat_map(|(source, file)| file.after_compact_if.iter().map(move |start| (source, *start)))
                .collect(),
            runs_elsewhere,
            mark_at_end: self.state.modal.mark,
            again: None,
            zones: OnceLock::new(),
        };
        let sources = (Arc::default(), self.written);
        Program {
            tools: self.used.tools,
            wobjs: self.used.wobjs,
            targets: self.found.targets,
            unknown: self.found.unknown,
            kept: self.messages.kept.in_order(),
            arcs: self.counters.arcs,
            diagnostics: self.messages.diagnostics,
            ..Program::empty(Language::Rapid, "rapid", sources, crate::Layout::Rapid(layout))
        }
    }

    /// Number of targets that must not be edited.
    fn refused(&self) -> usize {
        self.found.targets.iter().filter(|target| matches!(target.editable, Editable::No(_))).count()
    }

    /// Refuses the targets from whose positions a displacement is counted.
    fn refuse_what_is_counted_from(&mut self) {
        for i in 0..self.found.targets.len() {
            let root = self.found.root(&self.found.sites[i]);
            let target = &mut self.found.targets[i];
            let standing = Standing::at(target, root);
            let is_counted = self.found.counted_from.iter().any(|from| from.is_of_same_motion(&standing));
            let is_open = !matches!(target.editable, Editable::No(why) if why != Reason::OffsetWithExpression);
            if is_counted && target.is_end() && is_open {
                target.editable = Editable::No(Reason::DisplacementCounts);
            }
        }
    }

    /// Whether a motion goes along the axes of the work object to an offset that the program computes: a shift of its base shifts it as much.
    pub(super) fn is_computed_shift(target: &Target, steps: &[OffsetStep]) -> bool {
        target.editable == Editable::No(Reason::OffsetWithExpression)
            && target.motion == Motion::Linear
            && steps.iter().all(OffsetStep::is_computed_shift)
    }

    /// Lets motions to computed offsets have their corrections by the numbers of their bases, unless other routines use these as well.
    fn correct_by_bases(&mut self) {
        let used: HashSet<u32> = self.reached.uses.iter().map(|other| other.root).collect();
        for (target, site) in self.found.targets.iter_mut().zip(&mut self.found.sites) {
            let TargetInText::Offset(at) = *site else { continue };
            let Offset { root, steps } = &self.found.offsets[at as usize];
            let is_written = usize::from(self.numbers.literals[*root as usize].source) < self.written;
            let is_held = self.numbers.held.contains(&Number::Literal(*root)) || used.contains(root);
            if is_written && !is_held && Self::is_computed_shift(target, steps) {
                target.editable = Editable::Pose;
                *site = TargetInText::Literal { literal: *root, given: Given::Base };
            }
        }
    }

    /// Refuses the other point of an arc when one is refused: moving one point alone makes another arc.
    fn refuse_halves_of_arcs(&mut self) {
        for i in 1..self.found.targets.len() {
            let [circle, end] = [i - 1, i].map(|i| self.found.targets[i].editable);
            if self.found.targets[i - 1].role == Role::Via {
                match (circle, end) {
                    (Editable::No(_), Editable::No(_)) => {}
                    (Editable::No(why), _) => self.found.targets[i].editable = Editable::No(why),
                    (_, Editable::No(why)) => self.found.targets[i - 1].editable = Editable::No(why),
                    _ => {}
                }
            }
        }
    }

    /// Refuses an offset that runs again in a state in which it cannot be edited.
    fn refuse_shared_offsets(&mut self) {
        let offsets: Vec<Option<SourceSpan>> = self.found.sites.iter().map(|site| self.found.offset(site)).collect();
        let of_kept = |(target, offset): (&Target, &Option<SourceSpan>)| {
            offset.filter(|_| matches!(target.editable, Editable::No(_)))
        };
        let held: HashSet<SourceSpan> = self.found.targets.iter().zip(&offsets).filter_map(of_kept).collect();
        let is_held = |place: &SourceSpan| held.contains(place) || self.numbers.held.contains(&Number::Offset(*place));
        // A target that was changed before this motion no longer records the offset of this statement.
        let of_changed = |(target, site): (&Target, &TargetInText)| {
            let changed = matches!((site, target.editable), (TargetInText::None, Editable::No(_)));
            changed.then_some((target.source, target.span.start))
        };
        let changed: HashSet<(u16, u32)> =
            self.found.targets.iter().zip(&self.found.sites).filter_map(of_changed).collect();
        for (target, offset) in self.found.targets.iter_mut().zip(offsets) {
            let of_statement = |place: &SourceSpan| {
                let within = target.span.start <= place.span.start && place.span.end <= target.span.end;
                within && place.source == target.source && changed.contains(&(target.source, target.span.start))
            };
            let shared = offset.is_some_and(|place| is_held(&place) || of_statement(&place));
            if shared && target.editable == Editable::Position {
                target.editable = Editable::No(Reason::OffsetUsedElsewhere);
            }
        }
    }

    /// Refuses a base when a target made from it cannot be edited, because that target would move with it. Whether a target with a computed
    /// offset may do so is known when the corrections are: it may if it cuts nothing, and is no point of an arc.
    fn refuse_shared_declarations(&mut self) {
        for i in 0..self.found.targets.len() {
            let Target { editable, motion, .. } = self.found.targets[i];
            let may_follow = |why| why == Reason::OffsetWithExpression && motion != Motion::Circular;
            if matches!(editable, Editable::No(why) if !may_follow(why)) {
                let root = self.found.root(&self.found.sites[i]);
                self.numbers.pin(root);
            }
        }
        for i in 0..self.found.targets.len() {
            let root = self.found.root(&self.found.sites[i]).map(Number::Literal);
            let pinned = root.is_some_and(|root| self.numbers.held.contains(&root));
            let target = &mut self.found.targets[i];
            if pinned && target.editable == Editable::Pose {
                target.editable = Editable::No(Reason::DeclarationUsedElsewhere);
            }
        }
    }

    fn keep_what_is_refused(&mut self) {
        for i in 0..self.found.targets.len() {
            let target = &self.found.targets[i];
            if let (Editable::No(reason), true) = (target.editable, target.motion != Motion::AbsoluteJoint) {
                let (source, span) = (target.source as usize, target.span);
                self.messages.kept.keep(source, span, reason);
            }
        }
    }

    /// Whether each statement was a motion to a literal target or has no later effect.
    fn plain(&self) -> bool {
        let Some((file, context)) = self.symbols.files.split_first().filter(|_| self.written == 1) else {
            return false;
        };
        let only_data = |file: &File| file.odd.is_empty() && file.modules.iter().all(|m| m.routines.is_empty());
        let [module] = &file.modules[..] else { return false };
        let [proc] = &module.routines[..] else { return false };
        let literal = |site: &TargetInText| matches!(site, TargetInText::Literal { .. } | TargetInText::None);
        let known = |target: &Target| match target.goal {
            Goal::Joints { .. } => true,
            _ => target.editable == Editable::Pose,
        };
        proc.kind == RoutineKind::Proc
            && context.iter().all(only_data)
            && proc.params.is_empty()
            && proc.handlers.is_empty()
            && proc.body.iter().all(|statement| {
                matches!(statement.kind, StatementKind::Assign(_) | StatementKind::Call(_) | StatementKind::Mark(_))
            })
            && file.odd.is_empty()
            && self.counters.events == 0
            && !self.numbers.held.iter().any(|number| matches!(number, Number::Literal(_)))
            && self.found.unknown.is_empty()
            && self.counters.arcs == 0
            && self.found.sites.iter().all(literal)
            && self.found.targets.iter().all(known)
    }

    /// Whether each motion of a plain program goes to an inline target.
    fn inline(&self) -> bool {
        let inline = |site: &TargetInText| {
            matches!(site, TargetInText::Literal { given: Given::Inline, .. } | TargetInText::None)
        };
        self.found.sites.iter().all(inline) && self.found.targets.iter().all(|target| target.name.is_none())
    }
}
