//! Other uses of a target's numbers: in routines that nothing runs, traps, handlers and functions. A number is edited only if all
//! its uses are known and ask for the same value.

use super::expression::{Expression, ExpressionKind};
use super::known::{Changes, RoutineId};
use super::motion;
use super::ran::{Step, Use, UsedArc, Way};
use super::runner::{Mode, Numbers, Reached, Runner};
use super::state::{ModalState, OnOff, Place, Standing, Stands};
use super::symbols::Upper;
use super::tree::{Data, RoutineKind, Statement, Storage, statements};
use super::value::{Number, OffsetStep, Pose, axes_in_use};
use super::{Offset, TargetInText};
use crate::{Editable, Goal, Mark, Motion, Predecessor, Reason, Role, Target};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Diagnostic, Severity, Span};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// The routines that also run at a moment, or from a caller, that the run of the program does not follow.
pub(super) struct RunsElsewhere {
    /// Traps, functions, handlers' and synchronised procedures and endless ones, with all that they call. They run in a state that is not known.
    pub(super) unknown: BTreeSet<RoutineId>,
    /// The others: those that an operator may start, and those that run again after an error, with all that they call. What they use is recorded.
    pub(super) recorded: BTreeSet<RoutineId>,
}

impl Way {
    fn of(target: &Target) -> Self {
        let cuts = matches!(target.motion, Motion::Linear | Motion::Circular);
        Self { tool: target.tool, wobj: target.wobj, cuts, role: target.role }
    }
}

impl<'a> Runner<'a> {
    /// Records the numbers that a motion without a target in the result uses.
    pub(super) fn record_use(&mut self, target: &Target, pose: &Pose) {
        let Some(root) = pose.root.filter(|_| self.mode == Mode::UsesAlone) else { return };
        let offset = pose.steps.last().and_then(OffsetStep::place);
        // When this motion runs, other units or axis offsets may be active.
        let on_axes = axes_in_use(&pose.written.external);
        // A target made from a base would move with it, although it stays.
        let moves_along =
            !pose.steps.is_empty() && !self.reached.ran.has(usize::from(target.source), target.span.start);
        let is_fixed = on_axes || matches!(self.editable(target, pose), Editable::No(_));
        if moves_along
            && !is_fixed
            && target.motion != Motion::Circular
            && let [step] = pose.steps[..]
        {
            return self.stand(Offset { root, steps: [step].into() });
        }
        if moves_along || is_fixed {
            self.numbers.pin(Some(root));
            self.numbers.held.extend(offset.map(Number::Offset));
            return;
        }
        let (way, statement) = (Way::of(target), (target.source, target.span.start));
        let has_conf = self.state.modal.nearest == OnOff::Off && pose.written.conf.is_some();
        let is_free = is_free(target) && has_conf;
        let by = self.running_uncalled();
        self.reached.uses.push(Use {
            statement,
            root,
            offset,
            position_mm: pose.written.position_mm,
            way,
            is_free,
            by,
        });
    }

    /// Records an arc without targets in the result.
    pub(super) fn record_used_arc(&mut self, points: [&Pose; 2]) {
        if self.is_recording && self.mode == Mode::UsesAlone {
            let (roots, by) = (points.map(|point| point.root), self.running_uncalled());
            self.reached.used_arcs.insert(UsedArc { roots, by });
        }
    }

    /// Records the step of a routine that an operator starts to its next motion, or to its end.
    pub(super) fn record_step(&mut self, next: Option<(&Target, Standing)>) {
        if !self.reached.runs_uncalled || !self.is_recording || self.mode != Mode::UsesAlone {
            return;
        }
        let to = next.map(|(_, here)| here);
        let cuts = self.state.stands != Stands::Start && next.is_some_and(|(target, _)| Way::of(target).cuts);
        let known = matches!(self.state.stands, Stands::At(_));
        if self.state.stands != Stands::Start {
            let from =
                self.state.standing.iter().map(|from| Step { from: Some(*from), to: to.filter(|_| known), cuts });
            self.reached.steps.extend(from);
        }
        if !known || self.state.standing.is_empty() {
            self.reached.steps.insert(Step { from: None, to, cuts });
        }
        if let (Some((target, here)), Some(by)) = (next, self.running_uncalled())
            && self.reached.ran.has(usize::from(target.source), target.span.start)
            && target.is_end()
            && Way::of(target).cuts
        {
            self.reached.run_by_uncalled.entry(by).or_default().insert(here);
        }
    }

    /// The routine that an operator started, while it runs.
    fn running_uncalled(&self) -> Option<RoutineId> {
        self.frames.first().map(|frame| frame.routine).filter(|_| self.reached.runs_uncalled)
    }

    /// Runs the routines that nothing in the files calls, because an operator may run them by hand, and records the data that they use.
    pub(super) fn run_uncalled(&mut self, procs: &[RoutineId]) {
        let waits = |id: &&RoutineId| !self.reached.entered.contains(*id) || self.may_be_called_late(**id);
        let waiting: Vec<RoutineId> = procs.iter().filter(waits).copied().collect();
        if waiting.is_empty() || self.budget.is_spent() {
            return;
        }
        self.reached.runs_uncalled = true;
        self.budget.steps = 0;
        let roots: HashSet<RoutineId> = self.uncalled(&waiting).into_iter().collect();
        let first = waiting.iter().filter(|id| roots.contains(*id));
        let rest = waiting.iter().filter(|id| !roots.contains(*id));
        let order: Vec<RoutineId> = first.chain(rest).copied().collect();
        let changes = self.changed_by_what_runs();
        let left = std::mem::take(&mut self.state);
        for id in order {
            if !self.may_be_called_late(id) && self.reached.entered_for_uses.contains(&id) {
                continue;
            }
            // As `main`, it does not begin with what another one left that an operator started.
            self.state = left.clone();
            self.forget_at_any_moment(&changes);
            let before = self.numbers.held();
            self.record_uses_alone(|this| {
                this.start(id);
                this.record_step(None);
            });
            let own = self.numbers.held_again(before);
            own.into_iter().for_each(|number| self.reached.hold(number, id));
        }
        self.state = left;
        self.reached.is_uncalled_cut = self.budget.is_spent();
        self.reached.runs_uncalled = false;
    }

    /// Sets the state for a routine called at an unknown moment: everything that some routine changes is unknown.
    pub(super) fn forget_what_routines_change(&mut self) {
        let changes = self.changed_by_those(|_| true);
        self.forget_at_any_moment(&changes);
    }

    /// The changes of all routines but those that nothing runs, unless an operator starts them.
    fn changed_by_what_runs(&self) -> Changes {
        let Reached { entered, endless, .. } = &self.reached;
        self.changed_by_those(|id| {
            let is_followed = entered.contains(id) || endless.contains(id);
            // Other files may run what they have.
            is_followed
                || self.symbols.known.unfollowed.contains(id)
                || self.may_be_called_late(*id)
                || id.file >= self.written
        })
    }

    /// The changes of these routines, and those that happen at any moment.
    fn changed_by_those(&self, among: impl Fn(&RoutineId) -> bool) -> Changes {
        let mut all = self.symbols.known.at_any_moment.clone();
        for id in self.symbols.all().filter(among) {
            all.call(self.symbols.changed_by(id));
        }
        all
    }

    /// Makes everything unknown that these changes name.
    fn forget_at_any_moment(&mut self, changes: &Changes) {
        for &at in &changes.data {
            if self.symbols.variables[at].storage != Storage::Const {
                self.lose_data(at, Reason::ByHand);
            }
        }
        self.state.modal = ModalState { mark: self.state.modal.mark, ..ModalState::default() };
        self.state.modal.axes.lose_positions();
        self.state.modal.lose(changes.states);
    }

    /// The routines that also run at a moment, or from a caller, that the run of the program does not follow.
    pub(super) fn runs_elsewhere(&self) -> RunsElsewhere {
        let mut unknown = self.symbols.known.unfollowed.clone();
        unknown.extend(self.reached_from(self.reached.endless.clone()));
        // What a context file has, and does not belong to the program, is not followed.
        let is_followed =
            |id: &RoutineId| self.reached.entered.contains(id) || self.reached.entered_for_uses.contains(id);
        unknown.extend(self.symbols.all().filter(|id| id.file >= self.written && !is_followed(id)));
        if self.reached.is_uncalled_cut {
            unknown.extend(self.symbols.all());
        }
        let recorded = self.reached.entered_for_uses.iter().filter(|id| !unknown.contains(*id)).copied().collect();
        RunsElsewhere { unknown, recorded }
    }

    /// Forbids edits of all numbers that are used in handlers, and in routines whose other runs are unknown.
    pub(super) fn hold_what_runs_elsewhere(&mut self, elsewhere: &RunsElsewhere) {
        let before = self.numbers.held();
        for id in self.symbols.all().collect::<Vec<_>>() {
            let routine = self.symbols.routine(id);
            let body = if elsewhere.unknown.contains(&id) { &routine.body[..] } else { &[] };
            let all: Vec<&Statement> = statements(body).into_iter().chain(statements(&routine.handlers)).collect();
            if !all.is_empty() {
                self.hold_in(id, &all);
            }
        }
        // Other routines are no longer the only cause.
        for number in self.numbers.held_again(before) {
            self.reached.held_by.remove(&number.number);
        }
    }

    /// Forbids edits of the numbers that statements of a routine use.
    fn hold_in(&mut self, id: RoutineId, all: &[&Statement]) {
        let (bytes, routine, module) = (self.bytes(id.file), self.symbols.routine(id), self.symbols.module_of(id));
        #[allow(clippy::cast_possible_truncation)] // as many files as a target's source can number
        let source = id.file as u16;
        let key = |name: Span| Box::<[u8]>::from(&*Upper::new(&bytes[name.range()]));
        let data: HashMap<Box<[u8]>, &Data> = routine.data.iter().rev().map(|data| (key(data.name), data)).collect();
        let parameters: HashSet<Box<[u8]>> = routine.params.iter().map(|param| key(param.name)).collect();
        let mut names = Vec::new();
        for statement in all {
            if statement.call().is_some_and(|call| self.only_shows(module, call, bytes)) {
                statement.each(&mut |part| {
                    let shown = Some(part).filter(|part| part.is_name()).map(|part| key(part.span));
                    let at = shown.and_then(|name| self.symbols.find_data(module, &name));
                    self.found.bound_to_point.extend(at.and_then(|at| self.declared_literal(at)));
                });
                continue;
            }
            let is_hidden = |name: &[u8]| data.contains_key(name) || parameters.contains(name);
            let standing = self.standing(id, statement, is_hidden);
            let mut stands = Span::default();
            statement.each(&mut |part| {
                if standing.is_some() && matches!(part.kind, ExpressionKind::Call(_)) {
                    stands = part.span;
                }
                if !stands.range().contains(&(part.span.start as usize)) {
                    self.numbers.pin_part(source, part);
                    names.extend(part.is_name().then_some(part.span));
                }
            });
            standing.into_iter().for_each(|offset| self.stand(offset));
        }
        let mut done = HashSet::new();
        while let Some(name) = names.pop().map(key) {
            if !done.insert(name.clone()) {
                continue;
            }
            if data.contains_key(&name) || parameters.contains(&name) {
                if let Some(value) = data.get(&name).and_then(|data| data.value.as_ref()) {
                    self.numbers.pin_text(source, value);
                    names.extend(value.names());
                }
                if let Some(given) = self.numbers.given.remove(&(id, name)) {
                    self.numbers.held.extend(given);
                }
            } else if let Some(at) = self.symbols.find_data(module, &name) {
                self.pin_read(at);
            }
        }
    }

    /// The target of a motion, if it is `Offs` or `RelTool` of a declared robtarget that nothing assigns, with numbers in the text: if the base
    /// moves, other numbers can keep the motion in place. `is_hidden` are the names of the routine's own data.
    fn standing(&self, id: RoutineId, statement: &Statement, is_hidden: impl Fn(&[u8]) -> bool) -> Option<Offset> {
        let (call, bytes, module) = (statement.call()?, self.bytes(id.file), self.symbols.module_of(id));
        let is_free = |name: &[u8]| self.symbols.find_routine(module, name).is_none();
        let shape = motion::shape(&bytes[call.name.range()]).filter(|_| self.is_motion(id, statement))?;
        let only_function = |of: &Expression| {
            let mut calls = 0;
            of.each(&mut |part: &Expression| calls += usize::from(matches!(part.kind, ExpressionKind::Call(_))));
            calls
        };
        let calls: usize = call.arguments.given().map(only_function).sum();
        let ExpressionKind::Call(function) = &call.arguments.positional.get(shape.to)?.kind else { return None };
        let name = Upper::new(&bytes[function.name.range()]);
        let [base, offset @ ..] = &function.arguments.positional[..] else { return None };
        let key = Upper::new(&bytes[base.span.range()]);
        let is_offset =
            matches!(&*name, b"OFFS" | b"RELTOOL") && is_free(&name) && function.arguments.optional.is_empty();
        if shape.motion == Motion::Circular || calls != 1 || !is_offset || !base.is_name() || is_hidden(&key) {
            return None;
        }
        let at = self.symbols.find_data(module, &key)?;
        let variable = &self.symbols.variables[at];
        let is_fixed = !variable.assigned && variable.volatile.is_none() && *variable.kind == *b"ROBTARGET";
        let root = self.declared_literal(at).filter(|_| is_fixed)?;
        let is_written = |source: usize| source < self.written;
        if !is_written(id.file) || !is_written(usize::from(variable.source)) {
            return None;
        }
        #[allow(clippy::cast_possible_truncation)] // as many files as a target's source can number
        let source = id.file as u16;
        let number = |of: &Expression| match of.kind {
            ExpressionKind::Number(Some(value)) => Some((value, SourceSpan { source, span: of.span })),
            _ => None,
        };
        let [x, y, z] = offset else { return None };
        let [x, y, z] = [number(x)?, number(y)?, number(z)?];
        let in_tool = *name == *b"RELTOOL";
        let step = OffsetStep::of([x.0, y.0, z.0], [x.1, y.1, z.1], in_tool);
        Some(Offset { root, steps: [step].into() })
    }

    /// The robtarget with which data are declared.
    fn declared_literal(&self, at: usize) -> Option<u32> {
        let variable = &self.symbols.variables[at];
        self.numbers.literal_of(variable.source, variable.declared?.value.as_ref()?)
    }

    /// Records such a target.
    fn stand(&mut self, offset: Offset) {
        let place = offset.steps.last().and_then(OffsetStep::place);
        if self.found.standing_places.insert((offset.root, place)) {
            self.found.standing.push(offset);
        }
    }

    /// Forbids edits of the base of such a target if its offset must not be edited.
    pub(super) fn hold_what_cannot_stand(&mut self) {
        let held = |offset: &&Offset| {
            let place = offset.steps.last().and_then(OffsetStep::place);
            place.is_none_or(|place| self.numbers.held.contains(&Number::Offset(place)))
        };
        let bases = self.found.standing.iter().filter(held).map(|offset| Number::Literal(offset.root));
        let bases: Vec<Number> = bases.collect();
        self.numbers.held.extend(bases);
    }

    /// Files and starts of the statements in the bodies of routines.
    pub(super) fn starts_in<'i>(&self, routines: impl IntoIterator<Item = &'i RoutineId>) -> HashSet<(u16, u32)> {
        #[allow(clippy::cast_possible_truncation)] // as above
        let starts = |id: &RoutineId| {
            let file = id.file as u16;
            statements(&self.symbols.routine(*id).body).into_iter().map(move |statement| (file, statement.at.start))
        };
        routines.into_iter().flat_map(starts).collect()
    }

    /// Refuses the targets of routines with endless recursion.
    pub(super) fn refuse_what_calls_itself(&mut self) {
        let places = self.starts_in(&self.reached_from(self.reached.endless.clone()));
        for target in &mut self.found.targets {
            let inside = places.contains(&(target.source, target.span.start));
            if inside && !matches!(target.editable, Editable::No(_)) {
                target.editable = Editable::No(Reason::RoutineCallsItself);
            }
        }
    }

    /// Forbids edits of numbers that a routine that nothing runs uses in other frames than the program, for a cut of its own, at another
    /// position, or as the end of a motion where the program has a circle point.
    pub(super) fn hold_what_is_used_otherwise(&mut self) {
        if self.reached.uses.is_empty() {
            return;
        }
        let mut ways: HashMap<u32, Vec<Way>> = HashMap::new();
        let mut arrivals: HashMap<SourceSpan, Vec<Arrival>> = HashMap::new();
        for (target, site) in self.found.targets.iter().zip(&self.found.sites) {
            let Some(root) = self.found.root(site) else { continue };
            add(ways.entry(root).or_default(), Way::of(target));
            if let (Some(place), Goal::Pose { position_mm, .. }) = (self.found.offset(site), &target.goal) {
                let is_free = is_free(target) && target.conf().is_some();
                add(arrivals.entry(place).or_default(), Arrival { at: position_mm.map(f64::to_bits), is_free });
            }
        }
        let uses = std::mem::take(&mut self.reached.uses);
        for other in &uses {
            let own = Arrival { at: other.position_mm.map(f64::to_bits), is_free: other.is_free };
            let arrivals = other.offset.and_then(|place| arrivals.get(&place));
            let differs = arrivals.is_some_and(|all| all.iter().any(|one| *one != own));
            let before = self.numbers.held();
            let ways = ways.get(&other.root).map_or(&[][..], Vec::as_slice);
            let is_alike = |way: &Way| Way { cuts: other.way.cuts, ..*way } == other.way;
            let is_cut = ways.iter().any(|way| way.cuts);
            // A motion that cuts nothing goes along with a cut, if that is judged: of the robtarget itself, or as a motion of the program that
            // arrives in the same way.
            let is_judged = match other.offset {
                None => other.is_free,
                Some(_) => arrivals.is_some() && !differs,
            };
            let is_wanted = other.way.cuts == is_cut || !other.way.cuts && is_judged;
            if !ways.iter().all(is_alike) || !ways.is_empty() && !is_wanted {
                self.numbers.pin(Some(other.root));
                self.numbers.held.extend(other.offset.map(Number::Offset));
            } else {
                self.numbers.held.extend(other.offset.filter(|_| differs).map(Number::Offset));
                let is_joint = is_cut && !other.way.cuts && other.offset.is_none();
                self.found.joints_elsewhere.extend(is_joint.then_some(other.root));
            }
            self.hold_by(before, other.by);
        }
        self.reached.uses = uses;
    }

    /// Forbids edits of the points of an arc in a routine that nothing runs, unless the program has an arc with the same points: a part of its
    /// points would move.
    pub(super) fn hold_other_arcs(&mut self) {
        let root = |i: usize| self.found.root(&self.found.sites[i]);
        let is_via = |i: &usize| self.found.targets[*i].role == Role::Via;
        let arcs: HashSet<[Option<u32>; 2]> =
            (1..self.found.targets.len()).map(|i| i - 1).filter(is_via).map(|via| [root(via), root(via + 1)]).collect();
        for arc in std::mem::take(&mut self.reached.used_arcs) {
            if !arcs.contains(&arc.roots) {
                let before = self.numbers.held();
                self.numbers.held.extend(arc.roots.into_iter().flatten().map(Number::Literal));
                self.hold_by(before, arc.by);
            }
        }
    }

    /// Adds the numbers that were held before, and records who holds the others.
    fn hold_by(&mut self, before: HashSet<Number>, by: Option<RoutineId>) {
        let own = self.numbers.held_again(before);
        if let Some(by) = by {
            own.into_iter().for_each(|number| self.reached.hold(number, by));
        }
    }

    /// Binds the numbers of motions to their own point that a routine that nothing runs also uses, unless it has the same motions before and
    /// after it: a displacement because of its neighbours would be wrong there. If it cuts there with a feed from another place, the start of
    /// the program's own segment counts as unknown: a force that depends on the feed has no single correction.
    pub(super) fn bind_what_steps_otherwise(&mut self) {
        if self.reached.steps.is_empty() {
            return;
        }
        let targets = &self.found.targets;
        let standing: Vec<Standing> = targets
            .iter()
            .zip(&self.found.sites)
            .map(|(target, site)| Standing::at(target, self.found.root(site)))
            .collect();
        let follows = |i: &usize| *i > 0 && targets[*i].predecessor == Predecessor::Previous;
        let steps: Vec<[Standing; 2]> =
            (0..targets.len()).filter(follows).map(|i| [standing[i - 1], standing[i]]).collect();
        let feeds: HashSet<[Place; 2]> = steps.iter().map(|step| step.map(|end| end.place)).collect();
        let steps: HashSet<[Standing; 2]> = steps.into_iter().collect();
        let (mut fed_otherwise, mut fed_places) = (HashSet::new(), HashSet::new());
        for Step { from, to, cuts } in std::mem::take(&mut self.reached.steps) {
            let step = from.zip(to).map(<[Standing; 2]>::from);
            if step.is_some_and(|step| steps.contains(&step)) {
                continue;
            }
            self.found.bound_to_point.extend([from, to].into_iter().flatten().filter_map(|place| place.root));
            let is_fed_alike = step.is_some_and(|step| feeds.contains(&step.map(|end| end.place)));
            let to = to.filter(|_| cuts && !is_fed_alike);
            fed_otherwise.extend(to);
            fed_places.extend(to.map(|to| (to.root, to.place)));
        }
        for ((target, site), own) in self.found.targets.iter_mut().zip(&self.found.sites).zip(standing) {
            // An offset has the numbers of its statement.
            let is_shared = match site {
                TargetInText::None => false,
                TargetInText::Literal { literal, .. } => {
                    fed_places.contains(&(own.root, own.place))
                        && !self.numbers.held.contains(&Number::Literal(*literal))
                }
                TargetInText::Offset(_) => fed_otherwise.contains(&own),
            };
            if is_shared {
                target.predecessor = Predecessor::Unknown;
                target.begins_mm = None;
            }
        }
    }

    /// Names the routines that nothing calls and because of which alone targets are kept, and what these call that is in no file.
    pub(super) fn report_routines_that_keep_targets(&mut self) {
        let mut kept: BTreeMap<RoutineId, BTreeSet<(u16, u32)>> = BTreeMap::new();
        let (targets, sites) = (&self.found.targets, &self.found.sites);
        let refused = |target: &Target, site: &TargetInText| match target.editable {
            Editable::No(Reason::DeclarationUsedElsewhere) => self.found.root(site).map(Number::Literal),
            Editable::No(Reason::OffsetUsedElsewhere) => self.found.offset(site).map(Number::Offset),
            _ => None,
        };
        // A motion of the program itself may hold them as well.
        let holds = |target: &Target| {
            use Reason::{DeclarationUsedElsewhere, OffsetUsedElsewhere, OffsetWithExpression};
            let is_held = |why| matches!(why, DeclarationUsedElsewhere | OffsetUsedElsewhere | OffsetWithExpression);
            matches!(target.editable, Editable::No(why) if !is_held(why))
        };
        let held: HashSet<Number> = targets
            .iter()
            .zip(sites)
            .filter(|(target, _)| holds(target))
            .flat_map(|(_, site)| {
                [self.found.root(site).map(Number::Literal), self.found.offset(site).map(Number::Offset)]
            })
            .flatten()
            .collect();
        for (target, site) in targets.iter().zip(sites) {
            let number = refused(target, site).filter(|number| !held.contains(number));
            let by = number.and_then(|number| self.reached.held_by.get(&number));
            for by in by.into_iter().flatten() {
                kept.entry(*by).or_default().insert((target.source, target.span.start));
            }
        }
        for (id, kept) in kept {
            let name = String::from_utf8_lossy(self.routine_name(id)).into_owned();
            let message = format!(
                "`{name}`, which nothing calls, keeps {}: it uses their targets otherwise, or in a state that is not known",
                motions(kept.len())
            );
            let help = "call it where it runs, so that deflex knows its state, or delete it if it is not used";
            let note = Diagnostic::error("rapid.uncalled", "", message)
                .at(&self.symbols.sources[id.file], self.symbols.routine(id).name);
            self.messages.diagnostics.push(note.severity(Severity::Note).help(help));
            let unknown = std::mem::take(&mut self.messages.undeclared_in_uncalled);
            let (own, others) = unknown.into_iter().partition(|(by, _)| *by == id);
            self.messages.undeclared_in_uncalled = others;
            own.into_iter().for_each(|(_, undeclared)| self.messages.report_once(undeclared));
        }
    }

    /// Reports traps that move the robot: after such a trap, the next motion begins where the trap ends.
    pub(super) fn report_traps_that_move(&mut self) {
        let is_trap = |id: &RoutineId| self.symbols.routine(*id).kind == RoutineKind::Trap;
        for id in self.symbols.all().filter(is_trap).collect::<Vec<_>>() {
            let moves = |id: RoutineId| {
                statements(&self.symbols.routine(id).body).into_iter().any(|statement| self.is_motion(id, statement))
            };
            if !self.reached_from([id].into()).into_iter().any(moves) {
                continue;
            }
            let name = String::from_utf8_lossy(self.routine_name(id)).into_owned();
            let message = format!(
                "trap `{name}` moves the robot: after an interrupt, the next motion may begin at another place than the correction assumes"
            );
            let source = &self.symbols.sources[id.file];
            let note = Diagnostic::error("rapid.trap-moves", "", message).at(source, self.symbols.routine(id).name);
            let help = "let it move back to the interrupted position (StorePath, CRobT, RestoPath) before the program continues";
            self.messages.diagnostics.push(note.severity(Severity::Note).help(help));
        }
    }

    /// These routines, those that they call, and so on.
    pub(super) fn reached_from(&self, mut reached: BTreeSet<RoutineId>) -> BTreeSet<RoutineId> {
        let mut waiting: Vec<RoutineId> = reached.iter().copied().collect();
        while let Some(caller) = waiting.pop() {
            let called = self.calls(caller, &self.symbols.routine(caller).body);
            waiting.extend(called.filter(|callee| reached.insert(*callee)));
        }
        reached
    }

    /// Whether a statement is a motion instruction, not a call of a routine with that name.
    fn is_motion(&self, id: RoutineId, statement: &Statement) -> bool {
        statement.call().is_some_and(|call| {
            let name = &self.bytes(id.file)[call.name.range()];
            motion::shape(name).is_some() && self.symbols.find_routine(self.symbols.module_of(id), name).is_none()
        })
    }

    /// Forbids edits of robtargets assembled from parts, unless every run knows the parts and can edit them.
    pub(super) fn hold_what_is_not_always_assembled(&mut self) {
        let Numbers { own, unassembled, held, .. } = &mut self.numbers;
        let not_always = own.iter().filter(|(place, _)| unassembled.contains(place));
        held.extend(not_always.map(|(_, id)| Number::Literal(*id)));
    }

    /// Names the routines that nothing calls and that run routines of the program with targets of their own.
    fn report_routines_that_run_others(&mut self) {
        let roots: HashSet<u32> = self.found.sites.iter().filter_map(|site| self.found.root(site)).collect();
        for (id, mut motions_of) in std::mem::take(&mut self.reached.run_by_uncalled) {
            motions_of.retain(|motion| motion.root.is_some_and(|root| !roots.contains(&root)));
            if id.file >= self.written || motions_of.is_empty() {
                continue;
            }
            let name = String::from_utf8_lossy(self.routine_name(id)).into_owned();
            let message = format!(
                "{} of `{name}`, in what it calls, not corrected: {}",
                motions(motions_of.len()),
                Reason::NotRun
            );
            let note = Diagnostic::error("rapid.not-run", "", message)
                .at(&self.symbols.sources[id.file], self.symbols.routine(id).name);
            self.messages.diagnostics.push(note.severity(Severity::Note));
        }
    }

    /// Keeps the targets of motions that were not run, and that do not move with the targets of the program.
    pub(super) fn keep_what_is_not_run(&mut self) {
        let (targets, sites) = (&self.found.targets, &self.found.sites);
        let open = targets.iter().zip(sites).filter(|(target, _)| target.editable == Editable::Pose);
        let open: HashSet<u32> = open.filter_map(|(_, site)| self.found.root(site)).collect();
        let moves = |other: &&Use| other.offset.is_none() && open.contains(&other.root);
        let (moving, staying): (Vec<&Use>, Vec<&Use>) = self.reached.uses.iter().partition(moves);
        let [mut moving, staying] =
            [moving, staying].map(|uses| uses.iter().map(|other| other.statement).collect::<HashSet<_>>());
        moving.retain(|statement| !staying.contains(statement));
        self.report_routines_that_run_others();
        for id in self.symbols.all().filter(|id| id.file < self.written).collect::<Vec<_>>() {
            let routine = self.symbols.routine(id);
            let entered = self.reached.entered.contains(&id);
            let body = match routine.kind {
                RoutineKind::Trap => Reason::InTrap,
                RoutineKind::Func => Reason::InFunction,
                RoutineKind::Proc if !entered => Reason::NotRun,
                RoutineKind::Proc => Reason::NotReached,
            };
            #[allow(clippy::cast_possible_truncation)] // as above
            let moves = |at: Span| moving.contains(&(id.file as u16, at.start));
            for (block, reason) in [(&routine.body, body), (&routine.handlers, Reason::InErrorHandler)] {
                let idle: Vec<Span> = statements(block)
                    .into_iter()
                    .filter(|statement| {
                        !self.reached.ran.has(id.file, statement.at.start)
                            && !moves(statement.at)
                            && self.is_motion(id, statement)
                    })
                    .map(|statement| statement.at)
                    .collect();
                let Some(first) = idle.first() else { continue };
                let name = String::from_utf8_lossy(self.routine_name(id)).into_owned();
                let message = format!("{} of `{name}` not corrected: {reason}", motions(idle.len()));
                let note = Diagnostic::error("rapid.not-run", "", message).at(&self.symbols.sources[id.file], *first);
                self.messages.diagnostics.push(note.severity(Severity::Note));
                idle.iter().for_each(|span| self.messages.kept.keep(id.file, *span, reason));
            }
        }
    }
}

fn motions(count: usize) -> String {
    if count == 1 { "1 motion".to_owned() } else { format!("{count} motions") }
}

/// Where a motion to an offset arrives.
#[derive(Clone, Copy, PartialEq)]
struct Arrival {
    at: [u64; 3],
    /// See [`Use::is_free`].
    is_free: bool,
}

/// Whether a motion cuts nothing in any cell.
fn is_free(target: &Target) -> bool {
    target.motion == Motion::Joint && target.mark != Some(Mark::Cut)
}

/// Adds a use if it is new.
fn add<T: PartialEq>(known: &mut Vec<T>, one: T) {
    if known.last() != Some(&one) && !known.contains(&one) {
        known.push(one);
    }
}
