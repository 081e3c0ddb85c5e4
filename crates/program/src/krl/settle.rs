//! Decides which parts of the targets may be edited, after everything that reads their numbers is known.

use super::expression::{Expression, ExpressionPart};
use super::run::{PositionTokens, Runner};
use super::tree::{Statement, walk};
use super::value::{EXTERNAL, Value};
use crate::{Editable, ExternalAxes, Motion, Reason, Role};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Span, number};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Whether a text gives an external axis anything other than the number zero.
fn sets(text: &[u8], axis: usize) -> bool {
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'$');
    let name = EXTERNAL[axis];
    let is_name = |at: usize| {
        text[at..at + name.len()].eq_ignore_ascii_case(name)
            && !at.checked_sub(1).is_some_and(|before| is_word(&text[before]))
            && !text.get(at + name.len()).is_some_and(is_word)
    };
    let digits = memchr::memchr_iter(name[1], text).filter_map(|at| at.checked_sub(1));
    digits.filter(|at| is_name(*at)).any(|at| {
        let rest = text[at + name.len()..].trim_ascii_start();
        let value = rest.strip_prefix(b"=").unwrap_or(rest).trim_ascii_start();
        let ends = |byte: &u8| matches!(byte, b',' | b'}' | b'\n' | b'\r' | b';');
        let number = value.split(ends).next().unwrap_or_default();
        let number = number.trim_ascii();
        number::read(number.strip_prefix(b"-").unwrap_or(number)) != Some(0.0)
    })
}

impl Runner<'_> {
    /// Marks the external axes that are used by a motion that is not run: in its text, and in the start values of the data that it names.
    fn use_axes_in(&mut self, file: usize, statement: &Statement) {
        statement.each(&mut |part| match part {
            ExpressionPart::Other(Expression::Aggregate(fields)) => {
                for (name, value) in fields {
                    let zero = matches!(value, Expression::Known(Value::Number(number, _)) if *number == 0.0);
                    let axis = EXTERNAL.iter().position(|axis| name[..] == **axis).filter(|_| !zero);
                    axis.into_iter().for_each(|axis| self.used_axes[axis] = true);
                }
            }
            ExpressionPart::Path(path) => {
                let id = self.symbols.find(file, &path.name);
                let value = self.symbols.start[id].clone();
                self.use_axes_of(&value);
            }
            _ => {}
        });
    }

    /// Decides which parts of the targets may be edited. A target that must stay fixes its numbers, and these fix every other target that
    /// uses them, until nothing changes any more.
    pub(super) fn settle(&mut self) {
        self.use_axes();
        self.hold_shared_angles();
        self.pinned.extend(self.read_later.iter().filter_map(|id| self.given.get(id)).flatten());
        loop {
            let before = self.pinned.len();
            for i in 0..self.targets.len() {
                let is_arc = self.targets[i].role == Role::Via && i + 1 < self.targets.len();
                let all = i..=i + usize::from(is_arc);
                if let Some(reason) = all.clone().find_map(|at| self.fixed(at)) {
                    all.for_each(|at| {
                        self.targets[at].editable = Editable::No(reason);
                        self.pinned.extend(self.sites[at].tokens.iter().flatten());
                    });
                } else if self.sites[i].tokens[3..].iter().any(|place| self.holds(*place).is_some()) {
                    self.targets[i].editable = Editable::Position;
                    self.pinned.extend(self.sites[i].tokens[3..].iter().flatten());
                }
            }
            if self.pinned.len() == before {
                break;
            }
        }
        for i in 0..self.targets.len() {
            let target = &self.targets[i];
            match target.editable {
                Editable::No(reason) => {
                    let (source, span) = (usize::from(target.source), target.span);
                    self.sites[i] = PositionTokens::default();
                    if target.motion != Motion::AbsoluteJoint {
                        self.keep(source, span, reason);
                    }
                }
                Editable::Position => self.sites[i].tokens[3..].fill(None),
                Editable::Pose => {}
            }
        }
    }

    /// Sets the external axes of the targets. An axis that is at zero in all of the program is at rest.
    pub(super) fn use_axes(&mut self) {
        for axis in 0..EXTERNAL.len() {
            let is_in_doubt = self.unknown_axes[axis] && !self.used_axes[axis];
            // A position that the controller reads (`$POS_INT`) has the axes that the arm has: the text shows which.
            self.used_axes[axis] |= is_in_doubt && self.symbols.sources.iter().any(|source| sets(&source.bytes, axis));
        }
        let named = |axis: usize| self.external.iter().any(|external| external[axis].is_some());
        let at_rest: [bool; 6] = std::array::from_fn(|axis| !self.used_axes[axis] && named(axis));
        if self.used_axes == [false; 6] && at_rest == [false; 6] {
            return;
        }
        let mut last: Option<Arc<ExternalAxes>> = None;
        for (target, external) in self.targets.iter_mut().zip(&self.external) {
            if last.as_ref().is_none_or(|last| last.written != *external) {
                last = Some(Arc::new(ExternalAxes { written: *external, at_rest, ..ExternalAxes::default() }));
            }
            target.external.clone_from(&last);
        }
    }

    /// Fixes angles that several points share (`P[i].A=-30` in a loop), because an edit would turn all of them. Their positions can still
    /// be edited.
    pub(super) fn hold_shared_angles(&mut self) {
        let mut owners: HashMap<SourceSpan, Option<SourceSpan>> = HashMap::new();
        for site in &self.sites {
            let [x, _, _, angles @ ..] = site.tokens;
            for angle in angles.into_iter().flatten() {
                if *owners.entry(angle).or_insert(x) != x {
                    self.pinned.insert(angle);
                }
            }
        }
    }

    /// Why a number must not be edited; `None` if it may be.
    pub(super) fn holds(&self, place: Option<SourceSpan>) -> Option<Reason> {
        match place {
            None => Some(Reason::Computed),
            Some(place) if usize::from(place.source) >= self.written => Some(Reason::InContextFile),
            Some(place) if self.pinned.contains(&place) => Some(Reason::ReadByOthers),
            Some(_) => None,
        }
    }

    /// Why a target must not be edited; `None` if it may be.
    pub(super) fn fixed(&self, i: usize) -> Option<Reason> {
        if let Editable::No(reason) = self.targets[i].editable {
            return Some(reason);
        }
        let [x, y, z, ..] = self.sites[i].tokens;
        let one = (x == y || y == z || x == z).then_some(Reason::OneNumberOfSeveral);
        [x, y, z].into_iter().find_map(|place| self.holds(place)).or(one)
    }

    /// Whether the running routine may also run at another moment, in an unknown state.
    pub(super) fn runs_at_any_moment(&self) -> bool {
        self.frames.last().is_some_and(|frame| self.at_any_moment.contains(&frame.routine))
    }

    /// Keeps the motions that were not run, and fixes the data that routines name which were not run.
    pub(super) fn keep_what_is_not_run(&mut self) {
        let targets = self.targets.iter().map(|target| (target.source, target.span));
        let ran: HashSet<(u16, Span)> =
            targets.chain(self.unknown.iter().map(|motion| (motion.source, motion.span))).collect();
        for id in self.symbols.all() {
            let is_entered = self.entered.contains(&id);
            if !is_entered {
                drop(self.pin_names(id));
            }
            walk(&self.symbols.routine(id).body, &mut |statement| {
                #[allow(clippy::cast_possible_truncation)] // as a target has it
                if !statement.is_motion() || ran.contains(&(id.file as u16, statement.at)) {
                    return;
                }
                if !is_entered {
                    self.use_axes_in(id.file, statement);
                }
                let reason = match is_entered {
                    _ if self.at_any_moment.contains(&id) => Reason::RunsAtAnyMoment,
                    true => Reason::NotReached,
                    false => Reason::NotRun,
                };
                self.keep(id.file, statement.at, reason);
            });
        }
    }
}
