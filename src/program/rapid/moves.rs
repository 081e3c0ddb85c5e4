//! Executed motions: their targets, tools, work objects and speeds, and what of them may be edited.

use super::eval::{RUN_TIME, Scope};
use super::literal::{Literal, UNUSED_AXIS};
use super::motion::{Call, Shape, ToolAt, Zone};
use super::run::{Cached, MAX_NORM_ERROR, Runner};
use super::symbols::{self, Content, Upper, first_word};
use super::tree::Storage;
use super::value::{Place, Pose, Value, axes_in_use, predefined, unit};
use super::{Offset, Site};
use crate::program::{Editable, Goal, Motion, Role, Target, Tool, ToolData, Wobj};
use crate::text::{Span, decode};
use std::rc::Rc;
use std::sync::Arc;

const CONTEXT: &str = "declared in a context module";

impl<'a> Runner<'a> {
    /// An instruction that is neither a known motion nor in the files.
    pub(super) fn instruction(&mut self, scope: Scope, call: &Call, span: Span) {
        let bytes = self.bytes(scope.source as usize);
        let name = Upper::new(&bytes[call.name.range()]);
        match &*name {
            b"PDISPON" | b"PDISPSET" => self.state.program_displacement = true,
            b"PDISPOFF" => self.state.program_displacement &= self.unsure > 0,
            b"EOFFSON" | b"EOFFSSET" => self.state.axis_offset = true,
            b"EOFFSOFF" => self.state.axis_offset &= self.unsure > 0,
            b"MOVEEXTJ" => self.keep_here(span, "moves external axes only"),
            b"INCR" | b"DECR" | b"ADD" | b"CLEAR" => return self.step_variable(scope, call, &name),
            _ => {}
        }
        if symbols::harmless(&bytes[call.name.range()]) {
            return;
        }
        // A motion instruction of the user's own is known by the types of its arguments.
        let mut targets = Vec::new();
        let mut tool = None;
        for (i, argument) in call.positional().iter().enumerate() {
            match self.kind_of(scope, *argument) {
                Some(kind) if *kind == *b"ROBTARGET" => targets.push(i),
                Some(kind) if *kind == *b"TOOLDATA" => tool = Some(i),
                _ => {}
            }
        }
        match (targets.last(), tool) {
            (Some(&to), Some(tool)) if tool > to => {
                let last = name.last();
                let motion = match (last, targets.len()) {
                    (Some(b'C'), 2) => Motion::Circular,
                    (Some(b'J'), _) => Motion::Joint,
                    _ => Motion::Linear,
                };
                let via = (motion == Motion::Circular).then(|| targets[0]);
                let shape = Shape { motion, via, to, tool: ToolAt::Index(tool), zone: Zone::Absent };
                self.motion(scope, call, shape, span);
            }
            (Some(_), _) => {
                for at in targets {
                    let value = self.evaluate(scope, call.positional()[at]);
                    self.pin_value(&value);
                }
                self.keep_here(span, "robtarget given to a procedure that is not known");
            }
            _ => {}
        }
        // What it is given it may change.
        for argument in call.given() {
            let word = first_word(bytes, argument);
            if word.is_empty() {
                continue;
            }
            if let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()])) {
                let variable = &self.symbols.variables[at];
                if variable.assigned && variable.storage != Storage::Const {
                    self.symbols.variables[at].content = Content::Is(Value::Unknown(RUN_TIME));
                    self.epoch += 1;
                }
            }
        }
    }

    /// Declared type of an argument, in upper case, as far as its text shows it.
    pub(super) fn kind_of(&mut self, scope: Scope, argument: Span) -> Option<Arc<[u8]>> {
        let bytes = self.bytes(scope.source as usize);
        let robtarget = || Some(Arc::from(&b"ROBTARGET"[..]));
        if bytes.get(argument.start as usize) == Some(&b'[') {
            let value = self.evaluate(scope, argument);
            return if self.as_target(&value).is_some() { robtarget() } else { None };
        }
        let word = first_word(bytes, argument);
        let name = Upper::new(&bytes[word.range()]);
        match &*name {
            b"OFFS" | b"RELTOOL" => return robtarget(),
            b"TOOL0" => return Some(Arc::from(&b"TOOLDATA"[..])),
            _ => {}
        }
        let at = self.find(scope, &name)?;
        let component = bytes[word.end as usize..argument.end as usize].contains(&b'.');
        (!component).then(|| Arc::clone(&self.symbols.variables[at].kind))
    }

    /// One executed motion.
    pub(super) fn motion(&mut self, scope: Scope, call: &Call, shape: Shape, span: Span) {
        let arguments = call.positional();
        let Some(&to) = arguments.get(shape.to) else {
            return self.keep_here(span, "motion without a target");
        };
        let tool_at = match shape.tool {
            ToolAt::Index(at) => Some(at),
            ToolAt::Last => arguments.len().checked_sub(1),
        };
        let Some(&tool) = tool_at
            .filter(|at| *at > shape.to + 1 || *at > shape.to && shape.zone == Zone::Absent)
            .and_then(|at| arguments.get(at))
        else {
            return self.keep_here(span, "motion without a tool");
        };
        self.motions += 1;
        let bytes = self.bytes(scope.source as usize);
        let tool = self.tool_index(scope, tool);
        let wobj = self.wobj_index(scope, call.option(bytes, b"WObj"));
        let feed_mm_s = self.speed(scope, call, arguments.get(shape.to + 1).copied());
        let line = self.lines[scope.source as usize].line(span.start);
        let target = Target {
            ordinal: self.motions,
            role: Role::End,
            motion: shape.motion,
            goal: Goal::Joints { deg: [0.0; 6] },
            tool,
            wobj,
            feed_mm_s,
            spindle_rpm: None,
            rapid: false,
            mark: self.state.mark,
            editable: Editable::No("joint target"),
            name: None,
            source: scope.source,
            span,
            line,
        };
        if shape.motion == Motion::AbsoluteJoint {
            match self.evaluate(scope, to).joints() {
                Some(deg) => self.push(Target { goal: Goal::Joints { deg }, ..target }, Site::None, false),
                None => self.keep_motion(span, "joint target computed at run time"),
            }
            return;
        }
        let via = shape.via.and_then(|at| Some((at, *arguments.get(at)?)));
        if shape.motion == Motion::Circular {
            self.arcs += 1;
        }
        if let Some((at, via)) = via {
            let target = Target { role: Role::Via, ..target.clone() };
            self.point(scope, call, at, via, target);
        }
        self.point(scope, call, shape.to, to, target);
    }

    /// One robtarget of a motion.
    pub(super) fn point(&mut self, scope: Scope, call: &Call, at: usize, argument: Span, mut target: Target) {
        let pose = match call.literal(at) {
            Some((_, literal, written)) => {
                let (literal, written) = (*literal, *written);
                Rc::new(self.literal_pose(&literal, written))
            }
            None => {
                let value = self.evaluate(scope, argument);
                match self.as_target(&value) {
                    Some(pose) => pose,
                    None => {
                        let reason = match value {
                            Value::List(..) => value.unknown().unwrap_or("not a complete robtarget"),
                            _ => value.unknown().unwrap_or("not a robtarget"),
                        };
                        return self.keep_point(&target, reason);
                    }
                }
            }
        };
        let written = &pose.written;
        let norm = written.quat.iter().map(|c| c * c).sum::<f64>();
        if !norm.is_finite() || (norm - 1.0).abs() > MAX_NORM_ERROR {
            return self.keep_point(&target, "orientation is not a unit quaternion");
        }
        target.goal = Goal::Pose { position_mm: written.position_mm, quat: unit(written.quat), conf: written.conf };
        let bytes = self.bytes(scope.source as usize);
        let named = !matches!(bytes.get(argument.start as usize), None | Some(b'['));
        if named && pose.steps.is_empty() {
            target.name = self.name_of(pose.root, &bytes[argument.range()]);
        }
        (target.editable, target.motion) = (self.editable(&target, &pose), target.motion);
        let site = match pose.root {
            None => Site::None,
            Some(root) if pose.steps.is_empty() => {
                let argument = Place { source: scope.source, span: argument };
                Site::Literal { literal: root, argument: named.then_some(argument) }
            }
            Some(root) => {
                self.offsets.push(Offset { root, steps: pose.steps.clone().into() });
                #[allow(clippy::cast_possible_truncation)]
                Site::Offset((self.offsets.len() - 1) as u32)
            }
        };
        let in_use = axes_in_use(&written.external);
        let external = written.external.map(|v| if v < UNUSED_AXIS { v } else { UNUSED_AXIS });
        #[allow(clippy::float_cmp)] // as written: any difference is a motion of the axis
        if in_use {
            self.external_moves |= *self.external.get_or_insert(external) != external;
        }
        self.push(target, site, in_use);
    }

    /// Keeps a point whose target is not known; a circle point counts with its end.
    fn keep_point(&mut self, target: &Target, reason: &'static str) {
        if target.role == Role::End {
            self.keep_motion(target.span, reason);
        } else {
            self.keep_here(target.span, reason);
        }
    }

    pub(super) fn push(&mut self, target: Target, site: Site, in_use: bool) {
        self.targets.push(target);
        self.sites.push(site);
        self.on_axes.push(in_use);
    }

    /// The name of a declared target as used: `p10`, `p{3}`.
    pub(super) fn name_of(&mut self, root: Option<u32>, text: &[u8]) -> Option<Arc<str>> {
        let new = || -> Arc<str> { decode(text).as_ref().into() };
        match root {
            // Through parameters the same literal has several names: the first is its own.
            Some(root) => Some(Arc::clone(self.names.entry(root).or_insert_with(new))),
            None => Some(new()),
        }
    }

    pub(super) fn editable(&self, target: &Target, pose: &Pose) -> Editable {
        let tool = self.tools[target.tool as usize].data;
        let wobj = self.wobjs[target.wobj as usize].data;
        let stationary = tool.is_some_and(|t: ToolData| !t.robhold) || wobj.is_some_and(|w| w.robhold);
        let reason = if self.state.program_displacement {
            Some("program displacement is active")
        } else if self.state.axis_offset {
            Some("offset of external axes is active")
        } else if stationary {
            Some("stationary tool")
        } else if wobj.is_some_and(|w| !w.fixed) {
            Some("work object moved by a mechanical unit")
        } else if let Some(why) = pose.fixed {
            Some(why)
        } else if let Some(last) = pose.steps.last() {
            match last.tokens {
                None => Some("offset computed from an expression"),
                Some(tokens) if tokens.iter().any(|t| t.source as usize >= self.written) => Some(CONTEXT),
                Some(_) => return Editable::Position,
            }
        } else {
            match pose.root {
                None => Some(RUN_TIME),
                Some(root) if self.literals[root as usize].source as usize >= self.written => Some(CONTEXT),
                Some(_) => return Editable::Pose,
            }
        };
        Editable::No(reason.unwrap_or(RUN_TIME))
    }

    pub(super) fn tool_index(&mut self, scope: Scope, argument: Span) -> u16 {
        let place = Place { source: scope.source, span: argument };
        if self.fresh(self.tool, place) {
            return self.tool.index;
        }
        let (name, value) = self.named(scope, argument);
        let tool = Tool { name, data: value.tool() };
        let index = index(&mut self.tools, tool, Tool::is);
        self.tool = Cached { place: Some(place), epoch: self.epoch, index };
        index
    }

    pub(super) fn wobj_index(&mut self, scope: Scope, argument: Option<Span>) -> u16 {
        let argument = argument.filter(|a| !a.is_empty());
        // No argument: the same empty place whatever the instruction.
        let place = Place { source: scope.source, span: argument.unwrap_or_default() };
        if self.fresh(self.wobj, place) {
            return self.wobj.index;
        }
        let (name, value) = match argument {
            Some(argument) => self.named(scope, argument),
            None => ("wobj0".into(), predefined(b"WOBJ0").unwrap_or(Value::Unknown(RUN_TIME))),
        };
        let wobj = Wobj { name, data: value.wobj() };
        let index = index(&mut self.wobjs, wobj, Wobj::is);
        self.wobj = Cached { place: Some(place), epoch: self.epoch, index };
        index
    }

    /// Whether an argument reads like the last one, and nothing was assigned or called in between.
    pub(super) fn fresh(&self, cached: Cached, place: Place) -> bool {
        cached.epoch == self.epoch
            && cached.place.is_some_and(|last| {
                let text = |p: Place| &self.bytes(p.source as usize)[p.span.range()];
                last.source == place.source && text(last) == text(place)
            })
    }

    /// Tool or work object: the name that it was declared with, also through parameters, and its value.
    pub(super) fn named(&mut self, scope: Scope, argument: Span) -> (Arc<str>, Value) {
        let bytes = self.bytes(scope.source as usize);
        let word = first_word(bytes, argument);
        if word == argument
            && let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()]))
        {
            let name = Arc::clone(&self.symbols.variables[at].name);
            return (name, self.content(at));
        }
        (decode(&bytes[argument.range()]).as_ref().into(), self.evaluate(scope, argument))
    }

    /// Programmed TCP speed, mm/s.
    pub(super) fn speed(&mut self, scope: Scope, call: &Call, argument: Option<Span>) -> Option<f64> {
        let bytes = self.bytes(scope.source as usize);
        if call.option(bytes, b"T").is_some() {
            return None;
        }
        if let Some(own) = call.option(bytes, b"V") {
            return self.evaluate(scope, own).num();
        }
        let argument = argument?;
        let place = Place { source: scope.source, span: argument };
        if !self.fresh(self.speed.0, place) {
            let value = self.evaluate(scope, argument);
            let speed = value.list().and_then(|items| items.first()?.num()).filter(|v| *v > 0.0);
            self.speed = (Cached { place: Some(place), epoch: self.epoch, index: 0 }, speed);
        }
        self.speed.1
    }

    /// Which literal of the text this is; the next one almost always.
    pub(super) fn literal_id(&mut self, literal: &Literal) -> Option<u32> {
        let source = literal.source as usize;
        let at = if self.literals.get(self.next_literal) == Some(literal) {
            self.next_literal
        } else {
            let first = self.first_literal[source];
            let of_source = &self.literals[first..self.first_literal[source + 1]];
            first + of_source.binary_search_by_key(&literal.span().start, |l| l.span().start).ok()?
        };
        self.next_literal = at + 1;
        u32::try_from(at).ok()
    }

    /// A robtarget put together from parts, as a literal of its own.
    pub(super) fn own_literal(&mut self, literal: Literal) -> Option<u32> {
        let place = Place { source: literal.source, span: literal.span() };
        if let Some(id) = self.own.get(&place) {
            return Some(*id);
        }
        let id = u32::try_from(self.literals.len()).ok()?;
        self.literals.push(literal);
        self.own.insert(place, id);
        Some(id)
    }

    /// A literal that other values are made of: moving it would move them too.
    pub(super) fn pin(&mut self, root: Option<u32>) {
        self.pinned.extend(root);
    }

    pub(super) fn pin_value(&mut self, value: &Value) {
        match value {
            Value::Target(pose) => self.pin(pose.root),
            Value::List(items, _) => items.iter().for_each(|v| self.pin_value(v)),
            _ => {}
        }
    }

    pub(super) fn root(&self, site: &Site) -> Option<u32> {
        match site {
            Site::None => None,
            Site::Literal { literal, .. } => Some(*literal),
            Site::Offset(at) => Some(self.offsets[*at as usize].root),
        }
    }
}

/// Where one of a few stands; it is added where it does not.
pub(super) fn index<T>(all: &mut Vec<T>, one: T, same: impl Fn(&T, &T) -> bool) -> u16 {
    let at = all.iter().position(|known| same(known, &one)).unwrap_or_else(|| {
        all.push(one);
        all.len() - 1
    });
    u16::try_from(at).unwrap_or(u16::MAX)
}
