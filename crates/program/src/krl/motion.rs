//! Executed motions: their targets, tools, bases and speeds, and which parts of them may be edited.

use super::expression::Expression;
use super::run::{PositionTokens, Runner};
use super::symbols::{
    APPROXIMATION, ASYNCHRONOUS_AXES, AT_START, BASE, CIRCLE_MODE, CIRCLE_TYPE, IGNORED_AXES, MARK, MODE, ORIENTATION,
    OVERRIDE, POSITION, SPEED, STANDS, TOOL, TURNED,
};
use super::tree::Move;
use super::value::{AXES, EXTERNAL, Literal, Name, POSE, Value};
use crate::orientation::{from_zyx_deg, halfway, quaternion, quaternion_of_zyx_deg};
use crate::{ArcTurn, Conf, Editable, Goal, Mark, Motion, Predecessor, Reason, Role, StatusAndTurn, Target};
use deflex_lang::ir::SourceSpan;
use deflex_text::Span;
use std::sync::Arc;

/// Status and turn.
const STATUS: [&[u8]; 2] = [b"S", b"T"];

/// The position to which a motion goes.
struct Position {
    numbers: [f64; 6],
    literals: [Option<Literal>; 6],
    /// External axes that this position or one before names.
    external: [Option<Value>; 6],
}

impl Position {
    fn quat(&self) -> [f64; 4] {
        let [.., a, b, c] = self.numbers;
        quaternion_of_zyx_deg([a, b, c])
    }
}

impl Runner<'_> {
    /// Records a motion that is not followed, because its start is unknown.
    pub(super) fn relative(&mut self, to: &[Expression], span: Span, reason: Reason) {
        self.motions += u32::from(self.is_recording);
        for to in to {
            let value = self.evaluate(to);
            self.use_axes_of(&value);
        }
        // It moves along with the position from which it starts.
        let end = self.value(POSITION).forgotten(reason);
        self.lose_position(reason);
        self.state.values.insert(POSITION, end);
        self.keep_motion(span, reason);
    }

    /// Marks the external axes that a motion may move to a position other than zero.
    pub(super) fn use_axes_of(&mut self, value: &Value) {
        match value {
            Value::Unknown(_, Some(was)) => self.use_axes_of(was),
            Value::Array(items) => items.values().for_each(|item| self.use_axes_of(item)),
            _ => {
                for (axis, name) in EXTERNAL.into_iter().enumerate() {
                    match value.component(name).map(Value::number) {
                        Some(Some(number)) => self.used_axes[axis] |= number != 0.0,
                        Some(None) => self.unknown_axes[axis] = true,
                        None => {}
                    }
                }
            }
        }
    }

    fn lose_position(&mut self, why: Reason) {
        for id in [POSITION, TURNED, STANDS] {
            self.state.values.insert(id, Value::unknown(why));
        }
    }

    /// Follows one executed motion.
    pub(super) fn motion(&mut self, of: &Move, span: Span) {
        let motion = of.motion;
        self.motions += u32::from(self.is_recording);
        self.arcs += usize::from(self.is_recording && motion == Motion::Circular);
        if of.is_curve {
            self.report_curve(span);
        }
        // The position may call functions, which run before WITH.
        let via = of.via.as_ref().map(|via| self.expression(via));
        let name = self.label(&of.end).map(|label| label.as_str().into());
        let end = self.expression(&of.end);
        of.angle.iter().for_each(|angle| drop(self.expression(angle)));
        let before = (!of.with.is_empty()).then(|| self.with(&of.with));
        let invalid = if via.is_some() && motion != Motion::Circular {
            Some(Reason::TwoPositions)
        } else if !of.is_whole {
            Some(Reason::AfterPosition)
        } else {
            let other = via.iter().chain([&end]).any(has_other_components);
            other.then_some(Reason::UnknownComponent)
        };
        let done = match (motion, &via) {
            (Motion::Circular, None) => Err(Reason::CircleWithoutEnd),
            (Motion::Circular, Some(_)) if of.angle.is_some() => {
                drop(self.position(&end));
                Err(Reason::CircleWithAngle)
            }
            _ => invalid.map_or_else(|| self.go(motion, via.as_ref(), &end, name, span), Err),
        };
        if let Some(reason) = invalid {
            self.refuse(span, reason);
        }
        self.use_axes_of(&end);
        if let Err(reason) = done {
            [via, Some(end)].iter().flatten().for_each(|value| self.pin(value));
            self.lose_position(Reason::PositionBefore);
            self.keep_motion(span, reason);
        }
        if let Some(before) = before {
            self.restore(&before);
        }
    }

    fn go(
        &mut self,
        motion: Motion,
        via: Option<&Value>,
        end: &Value,
        name: Option<Arc<str>>,
        span: Span,
    ) -> Result<(), Reason> {
        if let Some(joints) = axes(end)? {
            return self.go_to_joints(motion, joints, end, span);
        }
        // This comes first, because the components that it takes from the motion before must not be edited.
        let to = self.position(end);
        let (tool, wobj) = (self.tool_index()?, self.wobj_index()?);
        let mut to = to?;
        let elsewhere = self.leave_axes(&mut to);
        let on_arc = if motion == Motion::Circular { self.arc_turn() } else { Ok(None) };
        let from = match motion {
            Motion::Circular if self.orientation_before().is_none() => Err(Reason::AuxiliaryOrientation),
            // How far the path turns up to the auxiliary point depends on where it begins.
            Motion::Circular if on_arc != Ok(None) && self.predecessor() != Predecessor::Previous => {
                Err(Reason::MotionBefore)
            }
            _ => Ok(()),
        };
        let turns = match (motion, self.turns(&to)) {
            (Motion::Joint, _) => Ok(true),
            // An orientation that is constant in the path is another one at the end.
            (_, Ok(false)) => on_arc.map(|_| false),
            (_, turns) => turns,
        };
        let feed = match motion {
            Motion::Joint => None,
            _ => {
                let is_known = [SPEED, OVERRIDE].iter().all(|id| !self.is_volatile(*id));
                let speed = self.value(SPEED).component(b"CP").and_then(Value::number).filter(|_| is_known);
                let percent = self.value(OVERRIDE).number();
                speed.zip(percent).map(|(speed, percent)| 1e3 * speed * (percent / 100.0))
            }
        };
        let (conf, posture) = match [b"S", b"T"].map(|name| end.component(name)) {
            _ if motion != Motion::Joint => (None, false),
            [None, None] => (None, false),
            [Some(status), Some(turn)] => {
                let [status, turn] = [status, turn].map(|v| v.index().and_then(|v| i32::try_from(v).ok()));
                let conf = status.zip(turn).map(|(status, turn)| Conf::Status(StatusAndTurn { status, turn }));
                (conf, conf.is_none())
            }
            _ => (None, true),
        };
        let unlocated = elsewhere.or_else(|| self.unlocated(&to)).or(turns.err()).or(on_arc.err());
        let editable = match unlocated.or(from.err()) {
            Some(reason) => Editable::No(reason),
            None if !self.mark().1 => Editable::No(Reason::MarkUnknown),
            None if self.runs_at_any_moment() => Editable::No(Reason::RunsAtAnyMoment),
            None if posture => Editable::No(Reason::StatusUnknown),
            None if turns == Ok(false) => Editable::Position,
            None => Editable::Pose,
        };
        let goal = Goal::Pose { position_mm: [to.numbers[0], to.numbers[1], to.numbers[2]], quat: to.quat(), conf };
        let located = unlocated.is_none();
        let arc_turn = on_arc.unwrap_or(None);
        let here = self.target_here(goal, [tool, wobj], span);
        let begins_mm = match (motion, self.predecessor()) {
            (Motion::Linear, Predecessor::Unknown) if self.orientation_before().is_some() => {
                self.settled(POSITION).numbers([b"X", b"Y", b"Z"])
            }
            _ => None,
        };
        let target = Target { motion, feed_mm_s: feed, editable, located, name, begins_mm, arc_turn, ..here };
        if let Some(via) = via {
            self.via(via, &to, &target)?;
        }
        if turns != Ok(true) {
            // A corrected orientation of that number would turn this target too.
            to.literals[3..].iter_mut().for_each(|literal| self.pinned.extend(literal.take().map(|own| own.place)));
        }
        let numbers = to.numbers.iter().zip(to.literals).enumerate().map(|(i, (v, literal))| match turns {
            Err(why) if i >= 3 => Value::unknown(why),
            _ => Value::Number(*v, literal),
        });
        let external = to.external.each_ref().map(|axis| axis.as_ref().and_then(Value::number));
        let named = EXTERNAL.into_iter().zip(to.external.clone()).filter_map(|(name, axis)| Some((name, axis?)));
        let record = Value::record(POSE.into_iter().zip(numbers).chain(named));
        self.state.values.insert(POSITION, record);
        self.note_orientation(&to, turns.is_ok() && located);
        let approximation_mm = self.value(APPROXIMATION).component(b"CDIS").and_then(Value::number);
        self.push(target, PositionTokens { approximation_mm, ..PositionTokens::of(to.literals) }, external);
        Ok(())
    }

    /// Records the orientation at the end of a motion, with the base and the tool in which it is counted.
    fn note_orientation(&mut self, to: &Position, is_known: bool) {
        let turned = if is_known {
            let angles = POSE[3..].iter().zip(&to.numbers[3..]).map(|(name, v)| (*name, Value::Number(*v, None)));
            let frames = [(&b"BASE"[..], BASE), (b"TOOL", TOOL)];
            let frames = frames.map(|(name, id)| (name, self.value(id)));
            Value::record(angles.chain(frames))
        } else {
            Value::unknown(Reason::OrientationDisregarded)
        };
        self.state.values.insert(TURNED, turned);
    }

    /// The orientation before a motion, in the motion's base and of its tool; `None` if it is unknown.
    fn orientation_before(&self) -> Option<[f64; 4]> {
        let turned = self.settled(TURNED);
        let same = |name: &[u8], id| turned.component(name).is_some_and(|frame| *frame == self.value(id));
        let [a, b, c] = turned.numbers([b"A", b"B", b"C"])?;
        (same(b"BASE", BASE) && same(b"TOOL", TOOL)).then(|| quaternion(&from_zyx_deg([a, b, c])))
    }

    /// Adds the auxiliary point of a circle. The controller ignores its angles: the orientation turns from that before the arc to that at its
    /// end, and the path decides how far up to this point.
    fn via(&mut self, via: &Value, to: &Position, target: &Target) -> Result<(), Reason> {
        let [x, y, z] = via.numbers([b"X", b"Y", b"Z"]).ok_or_else(|| why(via))?;
        let before = self.orientation_before();
        let located = target.located && before.is_some();
        let quat = before.map_or_else(|| to.quat(), |before| halfway(before, to.quat()));
        let mut literals = [None; 6];
        for (to, name) in literals.iter_mut().zip([b"X", b"Y", b"Z"]) {
            *to = via.component(name).and_then(literal);
        }
        let goal = Goal::Pose { position_mm: [x, y, z], quat, conf: None };
        let editable = if target.editable == Editable::Pose { Editable::Position } else { target.editable };
        let external = to.external.each_ref().map(|axis| axis.as_ref().and_then(Value::number));
        self.push(
            Target { role: Role::Via, goal, editable, located, name: None, ..target.clone() },
            PositionTokens::of(literals),
            external,
        );
        Ok(())
    }

    /// The target of a motion at the running statement, with the mark that is in force.
    fn target_here(&self, goal: Goal, frames: [u16; 2], span: Span) -> Target {
        #[allow(clippy::cast_possible_truncation)]
        let place = SourceSpan { source: self.here() as u16, span };
        let line = self.kept.line(place.source, span);
        let target = Target::new(self.motions, Motion::AbsoluteJoint, goal, frames, place, line);
        Target { mark: self.mark().0, editable: Editable::No(Reason::Joints), ..target }
    }

    fn go_to_joints(&mut self, motion: Motion, deg: [f64; 6], end: &Value, span: Span) -> Result<(), Reason> {
        if motion != Motion::Joint {
            return Err(Reason::PathToAxes);
        }
        let (tool, wobj) = (self.tool_index()?, self.wobj_index()?);
        let target = self.target_here(Goal::Joints { deg }, [tool, wobj], span);
        let external = EXTERNAL.into_iter().filter_map(|name| Some((name, end.component(name)?.without_literal())));
        let record = Value::record(external);
        let at = EXTERNAL.map(|name| end.component(name).and_then(Value::number));
        self.state.values.insert(POSITION, record);
        self.state.values.insert(TURNED, Value::unknown(Reason::BeforeOnAxes));
        self.push(target, PositionTokens::default(), at);
        Ok(())
    }

    /// The numbers of a position; a component that it does not name is that of the position before.
    fn position(&mut self, value: &Value) -> Result<Position, Reason> {
        let Value::Record(_) = value else {
            if self.leaves_components_out {
                self.hold_position_before();
            }
            return Err(why(value));
        };
        let before = self.settled(POSITION);
        let mut found = Position { numbers: [0.0; 6], literals: [None; 6], external: Default::default() };
        for (i, name) in POSE.iter().enumerate() {
            let own = value.component(name);
            let component = own.or_else(|| before.component(name));
            let Some(Value::Number(number, at)) = component else {
                // A component that is unknown may be missing if the program leaves components out.
                if own.is_none() || self.leaves_components_out {
                    self.hold_position_before();
                }
                return Err(component.map_or(Reason::ComponentsMissing, why));
            };
            (found.numbers[i], found.literals[i]) = (*number, *at);
            // A correction there would move this one too. The angles of an offset are not followed.
            if own.is_none() || i >= 3 && at.is_some_and(|literal| literal.offset != 0.0) {
                self.pinned.extend(at.map(|literal| literal.place));
            }
        }
        // An axis at an unknown place stays there in other frames, too.
        let was = if let Value::Unknown(_, Some(was)) = &before { Some(was) } else { None };
        for (to, name) in found.external.iter_mut().zip(EXTERNAL) {
            let stays = || was?.component(name).filter(|axis| axis.number().is_none());
            // deflex edits no axis, so that its place is the same whichever literal gives it.
            *to = value.component(name).or_else(|| before.component(name)).or_else(stays).map(Value::without_literal);
        }
        Ok(found)
    }

    /// An unknown component may be that of any motion before.
    pub(super) fn hold_position_before(&mut self) {
        let before = self.value(POSITION);
        self.pin(&before);
    }

    /// Why it is unknown where the controller goes; `None` if it is known.
    fn unlocated(&self, to: &Position) -> Option<Reason> {
        if to.external.iter().flatten().any(|axis| axis.number().is_none()) {
            return Some(Reason::ExternalAxisUnknown);
        }
        match self.settled(MODE) {
            Value::Constant(mode) if &mode[..] == b"BASE" => None,
            Value::Constant(_) => Some(Reason::RobotHoldsPart),
            _ => Some(Reason::InterpolationUnknown),
        }
    }

    /// Whether a path motion turns to the orientation at its end (`$ORI_TYPE`). With `#CONSTANT` the controller ignores that orientation,
    /// which makes no difference if it is that of the start. KUKA System Software, *Operating and Programming Instructions for System
    /// Integrators*, orientation control of LIN and CIRC.
    fn turns(&self, to: &Position) -> Result<bool, Reason> {
        let Value::Constant(kind) = self.settled(ORIENTATION) else {
            return Err(Reason::OrientationTypeUnknown);
        };
        let before = self.settled(POSITION).numbers([b"A", b"B", b"C"]);
        match &kind[..] {
            b"VAR" | b"JOINT" => Ok(true),
            b"CONSTANT" if before.is_some_and(|before| before[..] == to.numbers[3..]) => Ok(false),
            _ => Err(Reason::OrientationType),
        }
    }

    /// Makes external axes unknown that do not go where the position says.
    ///
    /// A bit of `$EX_AX_IGNORE` lets the controller choose the axis between the points of a spline around it; one of
    /// `$ASYNC_AXIS` leaves it to `ASYPTP` and to the operator. KUKA System Software 8, *Operating and Programming Instructions
    /// for System Integrators*, and *System Variables*.
    fn leave_axes(&self, to: &mut Position) -> Option<Reason> {
        let rules = [(IGNORED_AXES, Reason::IgnoredAxis), (ASYNCHRONOUS_AXES, Reason::AsynchronousAxis)];
        let mut found = None;
        for (id, reason) in rules {
            let bits = self.settled(id).index();
            for (i, axis) in to.external.iter_mut().enumerate() {
                if axis.is_some() && bits.is_none_or(|bits| bits >> i & 1 == 1) {
                    *axis = Some(Value::unknown(reason));
                    found = Some(reason);
                }
            }
        }
        found
    }

    /// How the orientation turns on an arc: evenly, as on a line, if `$CIRC_TYPE` is #BASE, and evenly relative to the path if it is #PATH and
    /// `$ORI_TYPE` is #VAR. `$CIRC_MODE`, which refines it for SCIRC, must not be set. KUKA System Software, *Operating and Programming
    /// Instructions for System Integrators*, orientation control of CIRC and SCIRC.
    fn arc_turn(&self) -> Result<Option<ArcTurn>, Reason> {
        if !matches!(self.settled(CIRCLE_MODE), Value::Record(components) if components.is_empty()) {
            return Err(Reason::ArcModeSet);
        }
        match &[CIRCLE_TYPE, ORIENTATION].map(|id| self.settled(id)) {
            [Value::Constant(kind), _] if &kind[..] == b"BASE" => Ok(None),
            [Value::Constant(kind), Value::Constant(own)] if [&kind[..], &own[..]] == [&b"PATH"[..], b"VAR"] => {
                Ok(Some(ArcTurn::WithPath))
            }
            [Value::Constant(_), _] => Err(Reason::ArcTurns),
            _ => Err(Reason::ArcTypeUnknown),
        }
    }

    /// The mark in force, and whether it is known.
    fn mark(&self) -> (Option<Mark>, bool) {
        match self.settled(MARK) {
            Value::Bool(_) => (None, true),
            Value::Number(v, _) => (Some(if v > 0.5 { Mark::Cut } else { Mark::Air }), true),
            _ => (None, false),
        }
    }

    /// The start of the segment of the running motion.
    fn predecessor(&self) -> Predecessor {
        // The motion at whose end the robot stands, and the one before in the order of the text.
        let stands = self.value(STANDS).number().filter(|_| !self.is_volatile(POSITION));
        match stands {
            Some(_) if stands == Some(AT_START) => Predecessor::Start,
            Some(_) if stands == self.last => Predecessor::Previous,
            _ => Predecessor::Unknown,
        }
    }

    fn push(&mut self, mut target: Target, site: PositionTokens, external: [Option<f64>; 6]) {
        target.predecessor = self.predecessor();
        let here = self.site(target.span);
        self.state.values.insert(STANDS, Value::Number(here, None));
        if self.is_recording {
            self.last = Some(here);
            self.targets.push(target);
            self.sites.push(site);
            self.external.push(external);
        }
    }
}

/// Whether a position has components that are neither those of a point nor those of axes.
fn has_other_components(value: &Value) -> bool {
    let Value::Record(fields) = value else { return false };
    let known = |name: &Name| POSE.iter().chain(&AXES).chain(&EXTERNAL).chain(&STATUS).any(|known| name[..] == **known);
    fields.iter().any(|(name, _)| !known(name))
}

/// Why a value is not a position.
fn why(value: &Value) -> Reason {
    match value {
        Value::Unknown(why, _) => *why,
        Value::Own(_) => Reason::ControllerPosition,
        Value::Record(fields) => {
            fields.iter().find_map(|(_, value)| value.why()).unwrap_or(Reason::NotACompletePosition)
        }
        _ => Reason::NotAPosition,
    }
}

/// Axis angles, degrees; `None` if the value has none.
fn axes(value: &Value) -> Result<Option<[f64; 6]>, Reason> {
    if AXES.iter().all(|name| value.component(name).is_none()) {
        return Ok(None);
    }
    value.numbers(AXES).map(Some).ok_or(Reason::AxesMissing)
}

fn literal(value: &Value) -> Option<Literal> {
    if let Value::Number(_, literal) = value { *literal } else { None }
}
