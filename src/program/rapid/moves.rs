//! Executed motions: their targets, tools, work objects and speeds, and what of them may be edited.

use super::calls::ABSENT;
use super::changes::{Changes, is_synchronised};
use super::eval::{RUN_TIME, Scope};
use super::literal::Literal;
use super::motion::{Call, Shape, ToolAt, Zone};
use super::predefined::Instruction;
use super::run::{Cached, Flow, MAX_NORM_ERROR, Mode, NOT_UNIT, Runner};
use super::state::{Switch, Switches, Velocity};
use super::symbols::{Upper, first_word};
use super::value::{Place, Pose, Value, predefined, unit};
use super::{Offset, Site};
use crate::program::{Editable, Goal, Motion, Predecessor, Role, Target, Tool, ToolData, Wobj, WobjData};
use crate::text::{Severity, Span, decode};
use smallvec::SmallVec;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

const BY_SYNCHRONISED: &str = "may be changed by the procedure of a synchronised motion";
const MANY_FRAMES: &str = "the program has more than 65,536 tools or work objects";
const SHIFTED: &str = "its path is shifted at run time (\\Corr)";
const CONTEXT: &str = "declared in a context module";

impl<'a> Runner<'a> {
    /// A predefined instruction that does not move to a robtarget.
    pub(super) fn instruction(&mut self, scope: Scope, call: &Call, known: Instruction, span: Span) -> Flow {
        let bytes = self.bytes(scope.source as usize);
        // What it is told of a robtarget is told of the numbers that stand there.
        for argument in call.given().filter(|argument| !argument.is_empty()).collect::<SmallVec<[Span; 4]>>() {
            let value = self.evaluate(scope, argument);
            self.pin_value(&value);
        }
        if known == Instruction::Nothing || known == Instruction::Options && call.optional().is_empty() {
            return Flow::Next;
        }
        // Speeds and loads are set in a program's head, which each of its chunks has, and units activated.
        self.events += u64::from(!matches!(known, Instruction::Velocity | Instruction::Load | Instruction::UnitOn));
        match known {
            Instruction::Nothing => {}
            Instruction::Arguments => {
                if bytes[call.name.range()].eq_ignore_ascii_case(b"GetDataVal") {
                    // Data that it reads by their name.
                    let named = match call.positional().first().map(|name| self.evaluate(scope, *name)) {
                        Some(Value::Text(name)) => self.symbols.all_named(Some(&name)),
                        _ => self.symbols.all_named(None),
                    };
                    named.into_iter().for_each(|at| self.pin_read(at));
                }
                for argument in call.given().collect::<SmallVec<[Span; 4]>>() {
                    self.forget_argument(scope, argument, RUN_TIME);
                }
            }
            Instruction::Options => {
                for (_, argument) in call.optional().iter().copied().collect::<SmallVec<[(Span, Span); 4]>>() {
                    self.forget_argument(scope, argument, RUN_TIME);
                }
            }
            Instruction::Steps => self.step_variable(scope, call, &Upper::new(&bytes[call.name.range()])),
            Instruction::DisplacementOn => {
                if bytes[call.name.range()].eq_ignore_ascii_case(b"PDispOn") && call.option(bytes, b"ExeP").is_none() {
                    self.hold_where_it_stands();
                }
                self.displaces();
                self.state.displacement = Switch::On;
                self.state.lose(self.others_switch());
            }
            Instruction::DisplacementOff => {
                self.displaces();
                self.state.displacement = Switch::Off;
                self.state.lose(self.others_switch());
            }
            Instruction::SoftOn | Instruction::SoftOff => {
                self.state.soft = if known == Instruction::SoftOn { Switch::On } else { Switch::Off };
                self.state.lose(self.others_switch());
            }
            Instruction::Load => {
                let none = call.positional().first().is_some_and(|load| self.is_no_load(scope, *load));
                self.state.load = if none { Switch::Off } else { Switch::On };
                self.state.lose(self.others_switch());
            }
            Instruction::Velocity => {
                self.state.velocity = self.velocity(scope, call);
                self.state.lose(self.others_switch());
            }
            Instruction::AxisOffsetSet
            | Instruction::AxisOffsetOn
            | Instruction::AxisOffsetOff
            | Instruction::UnitOn
            | Instruction::UnitOff => self.axes_instruction(scope, call, known),
            Instruction::MovesAxes => {
                self.axes_instruction(scope, call, known);
                self.keep_here(span, "moves external axes only, or along a recorded path");
            }
            Instruction::DataByName => {
                let named = match call.positional().first().map(|name| self.evaluate(scope, *name)) {
                    Some(Value::Text(name)) if bytes[call.name.range()].eq_ignore_ascii_case(b"SetDataVal") => {
                        self.symbols.data_named(Some(&name))
                    }
                    _ => self.symbols.data_named(None),
                };
                named.into_iter().for_each(|at| self.forget_data(at, RUN_TIME));
            }
            Instruction::Moves => {
                self.stands = None;
                self.keep_here(span, "moves external axes only, or along a recorded path");
            }
            Instruction::Ends => return Flow::Gone,
            Instruction::Raises => return self.raise(),
        }
        Flow::Next
    }

    /// Something is counted from where the robot stands: that must not move.
    pub(super) fn hold_where_it_stands(&mut self) {
        for at in std::mem::take(&mut self.standing) {
            if let Some(target) = self.targets.get_mut(at)
                && !matches!(target.editable, Editable::No(_))
            {
                target.editable = Editable::No("program displacement is counted from it");
            }
        }
    }

    /// What something else may switch at any moment.
    pub(super) fn others_switch(&self) -> Switches {
        let mut others = Switches { marks: false, ..self.symbols.known.at_any_moment.switches };
        others |= self.jumping;
        others
    }

    /// What becomes of programmed speeds behind `VelSet`; `None` where its numbers are not known, and behind `SpeedRefresh`.
    fn velocity(&mut self, scope: Scope, call: &Call) -> Option<Velocity> {
        let [percent, most] = call.positional() else { return None };
        let [percent, most_mm_s] = [percent, most].map(|argument| self.evaluate(scope, *argument).num());
        Some(Velocity { share: percent? / 100.0, most_mm_s: most_mm_s? })
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
        let Some((tool_at, &tool)) = tool_at
            .filter(|at| *at > shape.to + 1 || *at > shape.to && shape.zone == Zone::Absent)
            .and_then(|at| Some((at, arguments.get(at)?)))
        else {
            return self.keep_here(span, "motion without a tool");
        };
        let via = shape.via.and_then(|at| Some((at, *arguments.get(at)?)));
        if self.mode == Mode::Real {
            self.motions += 1;
            self.arcs += usize::from(shape.motion == Motion::Circular);
        }
        let bytes = self.bytes(scope.source as usize);
        self.other_arguments(scope, call, shape, tool_at);
        let synchronised = is_synchronised(&bytes[call.name.range()]).then(|| arguments.get(shape.to + 4).copied());
        if let Some(procedure) = synchronised {
            self.run_on_the_way(scope, procedure);
        }
        if self.mode != Mode::Real {
            self.state.axes.lose_positions();
            self.stands = None;
        }
        if self.mode == Mode::Dry {
            // Only what it calls and what it finds matters.
            self.evaluate(scope, to);
            return self.found_by_search(scope, arguments, shape);
        }
        let shifted = call.option(bytes, b"Corr").is_some();
        let frames = if shifted { Err(SHIFTED) } else { self.frames_of(scope, call, tool) };
        let frames = match frames {
            Ok(frames) => frames,
            Err(reason) => {
                self.hold(scope, via.map(|via| via.1).into_iter().chain([to]));
                self.found_by_search(scope, arguments, shape);
                return self.keep_motion(span, reason);
            }
        };
        let own_load = call.option(bytes, b"TLoad");
        let feed_mm_s = self.speed(scope, call, arguments.get(shape.to + 1).copied());
        let line = self.lines[scope.source as usize].line(span.start);
        let target = Target {
            ordinal: self.motions,
            role: Role::End,
            motion: shape.motion,
            goal: Goal::Joints { deg: [0.0; 6] },
            tool: frames.0,
            wobj: frames.1,
            feed_mm_s,
            spindle_rpm: None,
            rapid: false,
            mark: self.state.mark,
            editable: Editable::No("joint target"),
            located: true,
            extra_load: self.state.load != Switch::Off || own_load.is_some_and(|load| !self.is_no_load(scope, load)),
            external: None,
            name: None,
            source: scope.source,
            span,
            line,
            predecessor: Predecessor::Previous,
        };
        if shape.motion == Motion::AbsoluteJoint {
            let value = self.evaluate(scope, to);
            let (external, plain) = (value.joints_external(), call.option(bytes, b"NoEOffs").is_some());
            self.axes_go_to(&external, plain);
            let Some(deg) = value.joints() else {
                return self.keep_motion(span, "joint target computed at run time");
            };
            let external_axes = self.external_axes(&external, Role::End, plain);
            let located = self.axes_unknown(&external).is_none();
            let target = Target { goal: Goal::Joints { deg }, external: external_axes, located, ..target };
            return self.push(target, Site::None);
        }
        // An arc is known by both its points, or not at all.
        let circle = via.map(|(at, via)| (self.pose(scope, call, at, via), via));
        let end = self.pose(scope, call, shape.to, to);
        match (circle, end) {
            (Some((Ok(circle), via)), Ok(end)) => {
                self.point(scope, &circle, via, Target { role: Role::Via, ..target.clone() });
                self.point(scope, &end, to, target);
            }
            (None, Ok(end)) => self.point(scope, &end, to, target),
            (circle, end) => {
                let both = [circle.map(|circle| circle.0), Some(end)].into_iter().flatten();
                let mut reason = None;
                for pose in both {
                    match pose {
                        Ok(pose) => self.pin_pose(&pose),
                        Err(why) => reason = Some(why),
                    }
                }
                self.keep_motion(span, reason.unwrap_or(RUN_TIME));
            }
        }
        self.found_by_search(scope, arguments, shape);
    }

    /// A procedure runs while the robot passes here, some time while the program goes on: what it changes is not known from
    /// here on.
    fn run_on_the_way(&mut self, scope: Scope, procedure: Option<Span>) {
        self.events += 1;
        let name = procedure.map(|name| self.evaluate(scope, name));
        let id = match &name {
            Some(Value::Text(name)) => {
                let name = name.rsplit(|b| *b == b':').next().unwrap_or_default();
                self.symbols.find_routine(scope.module, name)
            }
            _ => None,
        };
        let changes = id.map(|id| self.symbols.changed_by(id).clone()).unwrap_or_else(Changes::anything);
        self.forget(&changes, BY_SYNCHRONISED);
        let everything = self.symbols.everything();
        let others = everything.iter().filter(|_| changes.anything);
        for at in changes.data.iter().chain(others) {
            self.symbols.variables[*at].volatile.get_or_insert(BY_SYNCHRONISED);
        }
        let at_any_moment = &mut self.symbols.known.at_any_moment;
        at_any_moment.switches |= changes.switches;
        self.state.lose(Switches { marks: false, ..changes.switches });
    }

    /// Tool and work object of a motion, or why they are not known.
    fn frames_of(&mut self, scope: Scope, call: &Call, tool: Span) -> Result<(u16, u16), &'static str> {
        let bytes = self.bytes(scope.source as usize);
        let tool = self.tool_index(scope, tool)?;
        Ok((tool, self.wobj_index(scope, call.option(bytes, b"WObj"))?))
    }

    /// SearchPoint, which stands before the targets, is where the search stopped.
    fn found_by_search(&mut self, scope: Scope, arguments: &[Span], shape: Shape) {
        if shape.zone == Zone::Absent
            && let Some(point) = arguments.get(shape.via.unwrap_or(shape.to).wrapping_sub(1))
        {
            self.events += 1;
            self.stands = None;
            self.forget_argument(scope, *point, RUN_TIME);
        }
    }

    /// Robtargets that are used where they cannot be edited.
    fn hold(&mut self, scope: Scope, arguments: impl Iterator<Item = Span>) {
        for argument in arguments {
            let value = self.evaluate(scope, argument);
            self.pin_value(&value);
        }
    }

    /// Arguments that do not say where to: for the functions that they call, and the robtargets that they are made of.
    fn other_arguments(&mut self, scope: Scope, call: &Call, shape: Shape, tool_at: usize) {
        let bytes = self.bytes(scope.source as usize);
        let own = |(at, _): &(usize, &Span)| *at != shape.to && Some(*at) != shape.via && *at != tool_at;
        let positional = call.positional().iter().enumerate().filter(own).map(|(_, span)| *span);
        let named = call.optional().iter().map(|(_, value)| *value);
        let made = |span: &Span| {
            let text = &bytes[span.range()];
            text.iter().any(|b| matches!(b, b'(' | b'{' | b'.')) && text.iter().any(u8::is_ascii_alphabetic)
        };
        let others = positional.chain(named).filter(made).collect::<SmallVec<[Span; 4]>>();
        self.hold(scope, others.into_iter());
    }

    /// What a robtarget of a motion is worth, or why that is not known.
    fn pose(&mut self, scope: Scope, call: &Call, at: usize, argument: Span) -> Result<Rc<Pose>, &'static str> {
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
                        self.pin_value(&value);
                        return Err(match value {
                            Value::List(..) => value.unknown().unwrap_or("not a complete robtarget"),
                            _ => value.unknown().unwrap_or("not a robtarget"),
                        });
                    }
                }
            }
        };
        if is_unit(pose.written.quat) { Ok(pose) } else { Err(NOT_UNIT) }
    }

    /// One robtarget of a motion.
    fn point(&mut self, scope: Scope, pose: &Pose, argument: Span, mut target: Target) {
        let written = &pose.written;
        if self.mode != Mode::Real {
            return self.use_aside(&target, pose);
        }
        target.goal = Goal::Pose { position_mm: written.position_mm, quat: unit(written.quat), conf: written.conf };
        let bytes = self.bytes(scope.source as usize);
        let named = !matches!(bytes.get(argument.start as usize), None | Some(b'['));
        if named && pose.steps.is_empty() {
            target.name = self.name_of(pose.root, &bytes[argument.range()]);
        }
        target.editable = self.editable(&target, pose);
        target.located = self.unlocated(&target, pose).is_none();
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
        self.axes_go_to(&written.external, false);
        target.external = self.external_axes(&written.external, target.role, false);
        self.push(target, site);
    }

    pub(super) fn push(&mut self, mut target: Target, site: Site) {
        if self.mode != Mode::Real {
            return;
        }
        self.standing.clear();
        self.standing.insert(self.targets.len());
        let jumps = self.frames.last().is_some_and(|frame| frame.jumps);
        target.predecessor = match self.stands {
            // Where the robot comes from to the first is nobody's to know.
            _ if self.last == 0 => Predecessor::Start,
            Some(0) => Predecessor::Start,
            Some(last) if last == self.last && !jumps => Predecessor::Previous,
            _ => Predecessor::Unknown,
        };
        (self.stands, self.last) = (Some(target.ordinal), target.ordinal);
        let ends = target.is_end();
        self.targets.push(target);
        self.sites.push(site);
        if ends {
            self.gather();
        }
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

    /// Why the controller does not go where the numbers say, as far as that is so.
    fn unlocated(&self, target: &Target, pose: &Pose) -> Option<&'static str> {
        let tool = self.tools[target.tool as usize].data;
        let wobj = self.wobjs[target.wobj as usize].data;
        // Either the robot holds the tool, or the part; what is not declared here is the usual way.
        let holds_part = wobj.is_some_and(|w| w.robhold);
        let misfit =
            tool.is_none_or(|t: ToolData| t.robhold) == holds_part || wobj.is_some_and(|w| w.robhold && !w.fixed);
        match self.state.displacement {
            Switch::On => Some("program displacement is active"),
            Switch::Unknown => Some("program displacement is known only at run time"),
            Switch::Off if self.state.soft == Switch::On => Some("soft servo is active: the axes yield"),
            Switch::Off if self.state.soft == Switch::Unknown => Some("soft servo is known only at run time"),
            Switch::Off if misfit => Some("tool and work object are both held by the robot, or neither is"),
            Switch::Off => self.axes_unknown(&pose.written.external),
        }
    }

    pub(super) fn editable(&self, target: &Target, pose: &Pose) -> Editable {
        let reason = if let Some(why) = self.unlocated(target, pose) {
            Some(why)
        } else if self.state.mark_unknown {
            Some("air or cut is known only at run time")
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

    pub(super) fn tool_index(&mut self, scope: Scope, argument: Span) -> Result<u16, &'static str> {
        let place = Place { source: scope.source, span: argument };
        if self.fresh(self.tool, place) {
            return Ok(self.tool.index);
        }
        let (name, value, declared) = self.named(scope, argument);
        let data = value.tool();
        if declared && data.is_none() {
            self.tell_frame(argument, "tool", &name, &value);
            return Err("tool known only at run time");
        }
        if data.is_some_and(|data| !is_unit(data.tcp_quat)) {
            return Err(NOT_UNIT);
        }
        let numbers = data.map_or(Vec::new(), |d| {
            [&d.tcp_mm[..], &d.tcp_quat, &[d.mass_kg], &d.cog_mm, &[f64::from(u8::from(d.robhold))]].concat()
        });
        let key = frame_key(&name, &numbers);
        let data = data.map(|data| ToolData { tcp_quat: unit(data.tcp_quat), ..data });
        let index = number(&mut self.tools, &mut self.tool_numbers, key, self.mode, Tool { name, data })?;
        let Some(index) = index else {
            self.refuse(scope.source, argument, "rapid.frames", MANY_FRAMES, "split the program");
            return Err("too many tools");
        };
        self.tool = self.cached(scope, place, index);
        Ok(index)
    }

    pub(super) fn wobj_index(&mut self, scope: Scope, argument: Option<Span>) -> Result<u16, &'static str> {
        let argument = argument.filter(|a| !a.is_empty());
        // No argument: the same empty place whatever the instruction.
        let place = Place { source: scope.source, span: argument.unwrap_or_default() };
        if self.fresh(self.wobj, place) {
            return Ok(self.wobj.index);
        }
        let wobj0 = || ("wobj0".into(), predefined(b"WOBJ0").unwrap_or(Value::Unknown(RUN_TIME)), true);
        let (name, value, declared) = match argument {
            Some(argument) => match self.named(scope, argument) {
                (_, Value::Unknown(ABSENT), _) => wobj0(),
                named => named,
            },
            None => wobj0(),
        };
        let data = value.wobj();
        if let Some(argument) = argument.filter(|_| declared && data.is_none()) {
            self.tell_frame(argument, "work object", &name, &value);
            return Err("work object known only at run time");
        }
        if data.as_ref().is_some_and(|data| !is_unit(data.uframe_quat) || !is_unit(data.oframe_quat)) {
            return Err(NOT_UNIT);
        }
        let numbers = data.map_or(Vec::new(), |d| {
            let flags = [f64::from(u8::from(d.robhold)), f64::from(u8::from(d.fixed))];
            [&d.uframe_mm[..], &d.uframe_quat, &d.oframe_mm, &d.oframe_quat, &flags].concat()
        });
        let mechanical_unit: Option<Arc<str>> = value.wobj_unit().map(|unit| decode(unit).as_ref().into());
        let mut key = frame_key(&name, &numbers);
        key.extend_from_slice(mechanical_unit.as_deref().unwrap_or("").as_bytes());
        let data = data.map(|data| WobjData {
            uframe_quat: unit(data.uframe_quat),
            oframe_quat: unit(data.oframe_quat),
            ..data
        });
        let index = number(
            &mut self.wobjs,
            &mut self.wobj_numbers,
            key,
            self.mode,
            Wobj { name, data, unit: mechanical_unit },
        )?;
        let Some(index) = index else {
            self.refuse(scope.source, argument.unwrap_or_default(), "rapid.frames", MANY_FRAMES, "split the program");
            return Err("too many work objects");
        };
        self.wobj = self.cached(scope, place, index);
        Ok(index)
    }

    /// What is remembered of an argument: a plain name means the same until something is assigned or called.
    fn cached(&self, scope: Scope, place: Place, index: u16) -> Cached {
        let bytes = self.bytes(scope.source as usize);
        let plain = place.span.is_empty() || first_word(bytes, place.span) == place.span;
        Cached { place: Some(place).filter(|_| plain), epoch: self.epoch, index }
    }

    /// Whether a load is `load0`: none besides that of the tool's own data.
    fn is_no_load(&self, scope: Scope, load: Span) -> bool {
        self.bytes(scope.source as usize)[load.range()].eq_ignore_ascii_case(b"load0")
    }

    /// Says why a frame is not known, once a place.
    fn tell_frame(&mut self, argument: Span, what: &str, name: &str, value: &Value) {
        let why = value.unknown().unwrap_or("not of numbers");
        let message = format!("{what} `{name}` is known only at run time here: {why}");
        self.tell(argument, "rapid.frame", &message, Severity::Note);
    }

    /// Whether an argument reads like the last one, and nothing was assigned or called in between.
    pub(super) fn fresh(&self, cached: Cached, place: Place) -> bool {
        cached.epoch == self.epoch
            && cached.place.is_some_and(|last| {
                let text = |p: Place| &self.bytes(p.source as usize)[p.span.range()];
                last.source == place.source && text(last) == text(place)
            })
    }

    /// Tool or work object: the name that it was declared with, also through parameters, its value, and whether the program
    /// says what that is: else the cell may.
    pub(super) fn named(&mut self, scope: Scope, argument: Span) -> (Arc<str>, Value, bool) {
        let bytes = self.bytes(scope.source as usize);
        let word = first_word(bytes, argument);
        if word == argument {
            let key = Upper::new(&bytes[word.range()]);
            if let Some(at) = self.find(scope, &key) {
                let variable = &self.symbols.variables[at];
                let (name, foreign) = (Arc::clone(&variable.name), variable.foreign);
                let assigned = foreign && self.symbols.foreign_assigned.contains(&*Upper::new(name.as_bytes()));
                return (name, self.content(at), !foreign || assigned);
            }
            let known = predefined(&key);
            let declared = known.is_some() || self.symbols.foreign_assigned.contains(&*key);
            let value = known.unwrap_or(Value::Unknown("name is not declared in the files given"));
            return (decode(&bytes[argument.range()]).as_ref().into(), value, declared);
        }
        (decode(&bytes[argument.range()]).as_ref().into(), self.evaluate(scope, argument), true)
    }

    /// TCP speed of a motion, mm/s.
    pub(super) fn speed(&mut self, scope: Scope, call: &Call, argument: Option<Span>) -> Option<f64> {
        let bytes = self.bytes(scope.source as usize);
        if call.option(bytes, b"T").is_some() {
            return None;
        }
        let programmed = match call.option(bytes, b"V") {
            Some(own) => self.evaluate(scope, own).num(),
            None => self.speeddata(scope, argument?),
        };
        programmed.zip(self.state.velocity).map(|(programmed, velocity)| velocity.of(programmed))
    }

    /// The TCP speed of a speeddata, mm/s.
    fn speeddata(&mut self, scope: Scope, argument: Span) -> Option<f64> {
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

    /// The same with the offsets that it was made by.
    pub(super) fn pin_pose(&mut self, pose: &Pose) {
        self.pin(pose.root);
        self.held.extend(pose.steps.iter().filter_map(|step| step.tokens).map(|tokens| tokens[0]));
    }

    pub(super) fn pin_value(&mut self, value: &Value) {
        match value {
            Value::Target(pose) => self.pin_pose(pose),
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

/// Whether a quaternion is one of an orientation, but for printing.
fn is_unit(quat: [f64; 4]) -> bool {
    let norm = quat.iter().map(|c| c * c).sum::<f64>();
    (norm - 1.0).abs() <= MAX_NORM_ERROR
}

/// A tool or work object as a key: its name, whatever the case, and its numbers.
fn frame_key(name: &str, numbers: &[f64]) -> Vec<u8> {
    let mut key = name.to_ascii_uppercase().into_bytes();
    key.push(0);
    numbers.iter().for_each(|number| key.extend_from_slice(&number.to_bits().to_le_bytes()));
    key
}

/// The number of a frame; it gets one where it has none, as long as there are any.
fn number<T>(
    all: &mut Vec<T>,
    numbers: &mut HashMap<Vec<u8>, u16>,
    key: Vec<u8>,
    mode: Mode,
    one: T,
) -> Result<Option<u16>, &'static str> {
    if let Some(known) = numbers.get(&key) {
        return Ok(Some(*known));
    }
    if mode != Mode::Real {
        return Err("not a frame of the program as it runs");
    }
    let Ok(number) = u16::try_from(all.len()) else { return Ok(None) };
    all.push(one);
    numbers.insert(key, number);
    Ok(Some(number))
}

/// Where one of a few stands; it is added where it does not.
pub(super) fn index<T>(all: &mut Vec<T>, one: T, same: impl Fn(&T, &T) -> bool) -> u16 {
    let at = all.iter().position(|known| same(known, &one)).unwrap_or_else(|| {
        all.push(one);
        all.len() - 1
    });
    u16::try_from(at).unwrap_or(u16::MAX)
}
