//! Executed motions: their targets, tools, work objects and speeds, and which of their numbers may be edited.

use super::arguments::is_unit;
use super::changes::is_synchronised;
use super::eval::Scope;
use super::expression::{Arguments, Call, Expression, ExpressionKind};
use super::known::Changes;
use super::lasting::LastingStates;
use super::motion::{Shape, ToolAt, Zone};
use super::runner::Runner;
use super::state::{ArcMode, OnOff, Standing, Stands};
use super::symbols::{Upper, Variable};
use super::tree::Param;
use super::value::{Pose, Value, unit};
use super::{Given, Offset, TargetInText};
use crate::target::EndPosition;
use crate::{Editable, Goal, Motion, Predecessor, Reason, Role, Target, ToolData};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Span, decode};
use std::collections::BTreeSet;
use std::rc::Rc;
use std::sync::Arc;

impl<'a> Runner<'a> {
    /// Executes one motion.
    pub(super) fn motion(&mut self, scope: Scope, call: &'a Call, shape: Shape, span: Span) {
        let (given, arguments) = (&call.arguments, &call.arguments.positional);
        let Some(to) = arguments.get(shape.to) else {
            return self.unread_motion(span, Reason::MotionWithoutTarget);
        };
        let tool_at = match shape.tool {
            ToolAt::Index(at) => Some(at),
            ToolAt::Last => arguments.len().checked_sub(1),
        };
        let Some((tool_at, tool)) = tool_at
            .filter(|at| *at > shape.to + 1 || *at > shape.to && shape.zone == Zone::Absent)
            .and_then(|at| Some((at, arguments.get(at)?)))
        else {
            return self.unread_motion(span, Reason::MotionWithoutTool);
        };
        let via = shape.via.and_then(|at| arguments.get(at));
        if self.is_real() {
            self.uses_states();
            self.counters.motions += 1;
            self.counters.arcs += usize::from(shape.motion == Motion::Circular);
        }
        let bytes = self.bytes(scope.source as usize);
        self.other_arguments(scope, given, shape, tool_at);
        let synchronised = is_synchronised(&bytes[call.name.range()]).then(|| arguments.get(shape.to + 4));
        if let Some(procedure) = synchronised {
            self.run_on_the_way(scope, procedure);
        }
        let frames = if is_shifted_by_sensor(&bytes[call.name.range()], given, bytes) {
            Err(Reason::PathShifted)
        } else {
            self.frames_of(scope, given, tool)
        };
        let frames = match frames {
            Ok(frames) => frames,
            Err(reason) => {
                self.hold(scope, via.into_iter().chain([to]));
                self.found_by_search(scope, arguments, shape);
                return self.keep_motion(span, reason);
            }
        };
        let own_load = given.has(bytes, b"TLoad");
        let own_load = own_load && given.named(bytes, b"TLoad").is_none_or(|load| !self.is_no_load(scope, load));
        let feed_mm_s = self.speed(scope, given, shape.to + 1);
        let line = self.messages.kept.line(scope.source, span);
        let (joints, place) = (Goal::Joints { deg: [0.0; 6] }, SourceSpan { source: scope.source, span });
        let target = Target {
            feed_mm_s,
            mark: self.state.modal.mark,
            editable: Editable::No(Reason::Joints),
            extra_load: self.state.modal.load != OnOff::Off || own_load,
            arc_turn: match self.state.modal.arcs {
                ArcMode::Stated(turn) => Some(turn),
                ArcMode::Unstated | ArcMode::ByWrist | ArcMode::Unknown => None,
            },
            ..Target::new(self.counters.motions, shape.motion, joints, frames, place, line)
        };
        if shape.motion == Motion::AbsoluteJoint {
            let value = self.evaluate(scope, to);
            let (external, plain) = (value.joints_external(), given.has(bytes, b"NoEOffs"));
            self.axes_go_to(&external, plain);
            let Some(deg) = value.joints() else {
                return self.keep_motion(span, Reason::JointsComputed);
            };
            let target = Target { goal: Goal::Joints { deg }, ..target };
            if !self.is_real() {
                return self.arrive(&target, None);
            }
            let external_axes = self.external_axes(&external, Role::End, plain);
            let located = self.axes_unknown(&external).is_none();
            let target = Target { external: external_axes, located, ..target };
            return self.push(target, TargetInText::None);
        }
        // An arc is known only if both its points are.
        let circle = via.map(|via| (self.pose(scope, via), via));
        let end = self.pose(scope, to);
        match (circle, end) {
            (Some((Ok(circle), via)), Ok(end)) => {
                self.point(scope, &circle, via, Target { role: Role::Via, ..target.clone() });
                self.point(scope, &end, to, target);
                self.record_used_arc([&circle, &end]);
            }
            (None, Ok(end)) => self.point(scope, &end, to, target),
            (circle, end) => {
                let both = [circle.map(|circle| circle.0), Some(end)].into_iter().flatten();
                let mut reason = None;
                for pose in both {
                    match pose {
                        Ok(pose) => self.numbers.pin_pose(&pose),
                        Err(why) => reason = Some(why),
                    }
                }
                self.keep_motion(span, reason.unwrap_or(Reason::Computed));
            }
        }
        self.found_by_search(scope, arguments, shape);
    }

    /// A procedure runs when the robot passes this target, at an unknown moment of the further program: the data that it
    /// changes are unknown from here on.
    fn run_on_the_way(&mut self, scope: Scope, procedure: Option<&'a Expression>) {
        self.counters.events += 1;
        let name = procedure.map(|name| self.evaluate(scope, name));
        let id = match &name {
            Some(Value::Text(name)) => self.symbols.find_routine_in_text(scope.module, name),
            _ => None,
        };
        let changes = id.map(|id| self.symbols.changed_by(id).clone()).unwrap_or_else(Changes::anything);
        self.forget(&changes, Reason::BySynchronisedProcedure);
        let everything = self.symbols.everything();
        let others = everything.iter().filter(|_| changes.anything);
        for at in changes.data.iter().chain(others) {
            self.symbols.variables[*at].volatile.get_or_insert(Reason::BySynchronisedProcedure);
        }
        let at_any_moment = &mut self.symbols.known.at_any_moment;
        at_any_moment.states = at_any_moment.states.union(changes.states);
        at_any_moment.end_cycle |= changes.end_cycle;
        self.state.modal.lose(changes.states.without(LastingStates::MARK));
    }

    /// Tool and work object of a motion, or the reason for which they are unknown.
    fn frames_of(&mut self, scope: Scope, given: &'a Arguments, tool: &'a Expression) -> Result<[u16; 2], Reason> {
        let bytes = self.bytes(scope.source as usize);
        let tool = self.tool_index(scope, tool)?;
        Ok([tool, self.wobj_index(scope, given.named(bytes, b"WObj"))?])
    }

    /// The argument SearchPoint, before the targets, receives the position at which the search stopped.
    fn found_by_search(&mut self, scope: Scope, arguments: &'a [Expression], shape: Shape) {
        if shape.zone == Zone::Absent
            && let Some(point) = arguments.get(shape.via.unwrap_or(shape.to).wrapping_sub(1))
        {
            self.counters.events += 1;
            self.state.lose_place();
            self.forget_argument(scope, point, Reason::Computed);
        }
    }

    /// Forbids edits of robtargets that are used as these arguments.
    fn hold(&mut self, scope: Scope, arguments: impl Iterator<Item = &'a Expression>) {
        for argument in arguments {
            let value = self.evaluate(scope, argument);
            self.numbers.pin_value(&value);
        }
    }

    /// Evaluates the arguments other than the target, for the functions that they call and the robtargets that they use.
    fn other_arguments(&mut self, scope: Scope, given: &'a Arguments, shape: Shape, tool_at: usize) {
        let own = |(at, _): &(usize, &Expression)| *at != shape.to && Some(*at) != shape.via && *at != tool_at;
        let positional = given.positional.iter().enumerate().filter(own).map(|(_, argument)| argument);
        let named = given.optional_values();
        self.hold(scope, positional.chain(named).filter(|argument| !argument.is_plain()));
    }

    /// The value of a robtarget of a motion, or the reason for which it is unknown.
    fn pose(&mut self, scope: Scope, argument: &'a Expression) -> Result<Rc<Pose>, Reason> {
        let value = self.evaluate(scope, argument);
        let Some(pose) = self.as_target(&value) else {
            self.numbers.pin_value(&value);
            return Err(match value {
                Value::List(..) => value.unknown().unwrap_or(Reason::NotACompleteRobtarget),
                _ => value.unknown().unwrap_or(Reason::NotARobtarget),
            });
        };
        if is_unit(pose.written.quat) { Ok(pose) } else { Err(Reason::NotUnit) }
    }

    /// Adds one robtarget of a motion as a target.
    fn point(&mut self, scope: Scope, pose: &Pose, argument: &Expression, mut target: Target) {
        let written = &pose.written;
        // After `ConfJ\Off`, the controller ignores the configuration.
        let is_stated = target.motion != Motion::Joint || self.state.modal.nearest == OnOff::Off;
        let conf = written.conf.filter(|_| is_stated);
        target.goal = Goal::Pose { position_mm: written.position_mm, quat: unit(written.quat), conf };
        if !self.is_real() {
            if self.is_recording {
                self.record_use(&target, pose);
            }
            self.axes_go_to(&written.external, false);
            return self.arrive(&target, pose.root);
        }
        let bytes = self.bytes(scope.source as usize);
        let named = !matches!(argument.kind, ExpressionKind::Literal(_) | ExpressionKind::Aggregate(_));
        if named && pose.steps.is_empty() {
            target.name = self.name_of(pose.root, &bytes[argument.span.range()]);
        }
        target.editable = self.editable(&target, pose);
        target.located = self.unlocated(&target, pose).is_none();
        let site = match pose.root {
            None => TargetInText::None,
            Some(root) if pose.steps.is_empty() => {
                let given = if named { self.given(scope, argument, root) } else { Given::Inline };
                TargetInText::Literal { literal: root, given }
            }
            Some(root) => {
                self.found.offsets.push(Offset { root, steps: pose.steps.clone().into() });
                #[allow(clippy::cast_possible_truncation)]
                TargetInText::Offset((self.found.offsets.len() - 1) as u32)
            }
        };
        self.axes_go_to(&written.external, false);
        target.external = self.external_axes(&written.external, target.role, false);
        self.push(target, site);
    }

    /// How an argument that is a name, or a part of what it names, gives a literal.
    fn given(&self, scope: Scope, argument: &Expression, literal: u32) -> Given {
        let Some(name) = argument.variable() else { return Given::Otherwise };
        let bytes = self.bytes(scope.source as usize);
        let (key, place) = (Upper::new(&bytes[name.range()]), self.numbers.literals[literal as usize]);
        let is_key = |param: &Param| *Upper::new(&bytes[param.name.range()]) == *key;
        // A parameter by reference stands for the very variable of one caller.
        let is_parameter =
            self.frames.last().is_some_and(|frame| self.symbols.routine(frame.routine).params.iter().any(is_key));
        let is_around = |variable: &Variable<'_>| {
            variable.source == place.source
                && variable.declared.is_some_and(|data| data.statement.range().contains(&(place.span().start as usize)))
        };
        match self.find(scope, &key).filter(|_| !is_parameter) {
            Some(at) if is_around(&self.symbols.variables[at]) => {
                Given::Declared(SourceSpan { source: scope.source, span: argument.span })
            }
            _ => Given::Otherwise,
        }
    }

    /// The robot arrives at a target.
    fn arrive(&mut self, target: &Target, root: Option<u32>) {
        let here = Standing::at(target, root);
        self.record_step(Some((target, here)));
        self.state.stands = Stands::At(self.site(target.span));
        self.state.position = EndPosition::of(target);
        self.state.standing = BTreeSet::from([here]);
    }

    fn push(&mut self, mut target: Target, site: TargetInText) {
        target.predecessor = match (self.state.stands, self.found.last) {
            (Stands::Start, _) => Predecessor::Start,
            (Stands::At(site), Some(last)) if site == last => Predecessor::Previous,
            _ => Predecessor::Unknown,
        };
        target.begin_at(self.state.position);
        self.arrive(&target, self.found.root(&site));
        self.found.last = Some(self.site(target.span));
        let ends = target.is_end();
        self.found.targets.push(target);
        self.found.sites.push(site);
        if ends {
            self.gather();
        }
    }

    /// The name of a declared target as the motion spells it: `p10`, `p{3}`.
    pub(super) fn name_of(&mut self, root: Option<u32>, text: &[u8]) -> Option<Arc<str>> {
        let new = || -> Arc<str> { decode(text).as_ref().into() };
        match root {
            // Parameters give the same literal several names; the first is kept.
            Some(root) => Some(Arc::clone(self.numbers.names.entry(root).or_insert_with(new))),
            None => Some(new()),
        }
    }

    /// The reason, if any, for which the controller does not go to the pose that the numbers state.
    fn unlocated(&self, target: &Target, pose: &Pose) -> Option<Reason> {
        let tool = self.used.tools[target.tool as usize].data;
        let wobj = self.used.wobjs[target.wobj as usize].data;
        // The robot holds either the tool or the part; undeclared data mean that it holds the tool.
        let holds_part = wobj.is_some_and(|w| w.robhold);
        let misfit =
            tool.is_none_or(|t: ToolData| t.robhold) == holds_part || wobj.is_some_and(|w| w.robhold && !w.fixed);
        match self.state.modal.displacement {
            OnOff::On => Some(Reason::DisplacementActive),
            OnOff::Unknown => Some(Reason::DisplacementUnknown),
            OnOff::Off if self.state.modal.soft == OnOff::On => Some(Reason::SoftServoActive),
            OnOff::Off if self.state.modal.soft == OnOff::Unknown => Some(Reason::SoftServoUnknown),
            OnOff::Off if misfit => Some(Reason::BothHeld),
            OnOff::Off if target.motion == Motion::Joint && self.state.modal.nearest == OnOff::Unknown => {
                Some(Reason::NearestUnknown)
            }
            OnOff::Off => self.axes_unknown(&pose.written.external),
        }
    }

    pub(super) fn editable(&self, target: &Target, pose: &Pose) -> Editable {
        let reason = if let Some(why) = self.unlocated(target, pose) {
            Some(why)
        } else if self.state.modal.mark_unknown {
            Some(Reason::MarkUnknown)
        } else if let (Motion::Circular, Some(why)) = (target.motion, self.state.modal.arcs.unfollowed()) {
            Some(why)
        } else if let Some(why) = pose.fixed {
            Some(why)
        } else if let Some(last) = pose.steps.last() {
            match last.tokens {
                None => Some(Reason::OffsetWithExpression),
                Some(tokens) if tokens.iter().any(|t| t.source as usize >= self.written) => Some(Reason::InContextFile),
                Some(_) => return Editable::Position,
            }
        } else {
            match pose.root {
                None => Some(Reason::NumbersOfProgram),
                Some(root) if self.numbers.literals[root as usize].source as usize >= self.written => {
                    Some(Reason::InContextFile)
                }
                Some(_) => return Editable::Pose,
            }
        };
        Editable::No(reason.unwrap_or(Reason::NumbersOfProgram))
    }
}

/// Whether a sensor or a force control moves the path of a motion while it runs: path corrections (`\Corr`, `\Track`, externally guided motion)
/// and motions that press on the part. The position in the text is then not the one that is reached.
fn is_shifted_by_sensor(name: &[u8], given: &Arguments, bytes: &[u8]) -> bool {
    let begins = |family: &[u8]| name.len() >= family.len() && name[..family.len()].eq_ignore_ascii_case(family);
    given.has(bytes, b"Corr") || given.has(bytes, b"Track") || begins(b"EGMMove") || begins(b"FCPress")
}
