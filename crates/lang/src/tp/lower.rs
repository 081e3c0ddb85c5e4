//! Lowers statements to the intermediate representation.

use super::code::Code;
use super::effects::{self, Calls, Effect};
use super::expression::{self, condition, expression};
use super::motion::{Motion, Point, Speed};
use super::statement::{self, Frame, StatementKind as Written, Whole};
use super::{ANY, CONCURRENT, ELEMENTS, ORIGINS, OVERRIDE, POSITIONS, STANDS, Tp, builtin};
use crate::Span;
use crate::ir::{
    self, Argument, Binary, Callee, Expression, ExpressionKind as Is, Function, FunctionId, Program, Slot, SourceSpan,
    Statement, StatementKind, Switch, TokenId, Unary,
};
use crate::reason::Reason;
use crate::run::{self, Moved};
use crate::value::{Content, Value, is_whole};
use nalgebra::Isometry3;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

/// Number of registers that are followed if the text computes their numbers: as many as a controller has by default.
const REGISTERS: u32 = 200;
/// The same for position registers.
const POSITION_REGISTERS: u32 = 100;
/// The same for user frames and for tools, including number 0.
const NUMBERED: u32 = 11;
/// Larger numbers of registers, frames and positions are not followed: no controller has them.
const MOST: u32 = 32_768;

/// The label at which a statement continues that may continue anywhere.
const ANYWHERE: &str = "anywhere";

/// Lowers a program. `positions` are the numbers of those in `/POS`, each with its place, which is the token with its index;
/// `displaced` is why the paths of the whole program are moved at run time, where they are.
///
/// The tokens that a run uses are positions that something counts from, or on which something other than a motion to a position register depends.
///
/// ```
/// use deflex_lang::tp::{Calls, Code, Held, lower, lines};
/// let text = b"1:R[1]=2 ;\n2:L P[R[1]+1] 10mm/sec FINE ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// let (program, tp) = lower(&Code::new(&lines), &[], &Calls::default(), None);
/// let outcome = deflex_lang::run::run(&program, &tp).unwrap();
/// assert_eq!(Held(&outcome.motions[0]).end(), Some(3));
/// ```
#[must_use]
pub fn lower(code: &Code<'_>, positions: &[(u32, Span)], calls: &Calls, displaced: Option<Reason>) -> (Program, Tp) {
    let tokens = positions.iter().map(|(_, span)| SourceSpan { source: 0, span: *span }).collect();
    let stands = Expression { kind: Is::Truth(false), place: SourceSpan::default() };
    Lowering::new(code, calls, positions).program(tokens, stands, displaced)
}

/// Whether a program moves relative to where the arm stands when it begins: on some path, no other motion comes first. The programs that it
/// calls are examined separately.
pub(super) fn counts_from_its_start(code: &Code<'_>) -> bool {
    let stands = Expression { kind: Is::Number(0.0, TokenId(0)), place: SourceSpan::default() };
    let (program, tp) = Lowering::new(code, &Calls::default(), &[]).program(vec![SourceSpan::default()], stands, None);
    run::run(&program, &tp).map_or(true, |outcome| !outcome.used.is_empty())
}

/// Whether a program may leave a speed override other than 100 %. The programs that it calls are examined separately.
pub(super) fn leaves_override(code: &Code<'_>) -> bool {
    !matches!(Lowering::new(code, &Calls::default(), &[]).override_left().kind, Is::Constant(_))
}

/// What defines the values of a user frame or a tool at a motion.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{Calls, Code, Defined, Frame, Held, lines, lower};
///
/// let text = b"1:PR[1]=LPOS-LPOS ;\n2:PR[1,3]=220 ;\n3:UTOOL[2]=PR[1] ;\n4:L P[3] 10mm/sec FINE ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// let (program, tp) = lower(&Code::new(&lines), &[], &Calls::default(), None);
/// let outcome = deflex_lang::run::run(&program, &tp).unwrap();
/// let Defined::InProgram(tool) = Held(&outcome.motions[0]).defined(Frame::Tool, 2) else { panic!("a known pose") };
/// assert_eq!(tool.translation.z, 220.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Defined {
    /// The cell has them.
    InCell,
    /// The program sets them to this pose; millimetres.
    InProgram(Isometry3<f64>),
    /// They are known only at run time.
    AtRunTime,
}

/// The values that are known at a motion of a lowered program.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{Calls, Code, Defined, Frame, Held, lines, lower};
///
/// let text = b"1:UTOOL_NUM=2 ;\n2:C P[1]\n P[3] 10mm/sec FINE ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// let (program, tp) = lower(&Code::new(&lines), &[], &Calls::default(), None);
/// let outcome = deflex_lang::run::run(&program, &tp).unwrap();
/// let held = Held(&outcome.motions[0]);
/// assert_eq!((held.via(), held.end(), held.selected(Frame::Tool)), (Some(1), Some(3), Some(2)));
/// assert!(held.origins().is_empty() && held.offset_mm().is_none()); // no position register
/// assert!(held.displaced().is_none() && held.defined(Frame::Tool, 2) == Defined::InCell && held.mark() == Ok(None));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Held<'a>(pub &'a Moved);

impl Held<'_> {
    /// The number of its position, if it is known.
    #[must_use]
    pub fn end(self) -> Option<u32> {
        number(item(&self.0.to, 0)?)
    }

    /// The number of the position of its circle point, if it is known.
    #[must_use]
    pub fn via(self) -> Option<u32> {
        number(item(self.0.via.as_ref()?, 0)?)
    }

    /// The positions, by their tokens, from which the position register comes to which the motion goes.
    #[must_use]
    pub fn origins(self) -> Vec<TokenId> {
        item(&self.0.to, 3).map_or_else(Vec::new, |origin| origin.all_reads().tokens().to_vec())
    }

    /// The distance by which `Offset` moves the end, mm, in the user frame, or `Tool_Offset` in the axes of the tool there; `None` if it is not
    /// known, or if the end is also turned.
    #[must_use]
    pub fn offset_mm(self) -> Option<[f64; 3]> {
        let offset = item(&self.0.to, 4)?.pose()?.pose();
        (offset.rotation == nalgebra::UnitQuaternion::identity()).then(|| offset.translation.vector.into())
    }

    /// The selected user frame or tool, if it is known.
    #[must_use]
    pub fn selected(self, frame: Frame) -> Option<u32> {
        number(self.switch([Switch::Frame, Switch::Tool][frame as usize]))
    }

    /// What defines the values of a user frame or a tool.
    #[must_use]
    pub fn defined(self, frame: Frame, number: u32) -> Defined {
        let Some(Content::List(values)) = item(&self.0.to, 1 + frame as usize).map(|value| &value.content) else {
            return Defined::AtRunTime;
        };
        let own = usize::try_from(number).ok().and_then(|number| values.get(number.checked_add(1)?));
        match own.or(values.first()).map(|value| &value.content) {
            Some(Content::Truth(false)) => Defined::InCell,
            Some(Content::Pose(pose)) => Defined::InProgram(pose.pose()),
            _ => Defined::AtRunTime,
        }
    }

    /// Why paths are shifted at run time; `None` if they are not.
    #[must_use]
    pub fn displaced(self) -> Option<Reason> {
        self.switch(Switch::Shift).reason()
    }

    /// The text of the mark in force, if there is one; `Err` if it depends on the run.
    ///
    /// # Errors
    /// It depends on the run.
    pub fn mark(&self) -> Result<Option<&[u8]>, Reason> {
        match &self.switch(Switch::Mark).content {
            Content::Text(said) => Ok(Some(said)),
            Content::Unknown(_) => Err(Reason::MarkUnknown),
            _ => Ok(None),
        }
    }

    fn switch(&self, switch: Switch) -> &Value {
        &self.0.switches[switch as usize]
    }
}

fn item(value: &Value, at: usize) -> Option<&Value> {
    match &value.content {
        Content::List(items) => items.get(at),
        _ => None,
    }
}

fn number(value: &Value) -> Option<u32> {
    value.number().and_then(expression::counted)
}

struct Lowering<'a> {
    code: &'a Code<'a>,
    calls: &'a Calls,
    /// Whether any motion may be relative to where the arm stands.
    counts: bool,
    /// Position registers that may have axis angles, whose elements are then not X, Y, Z, W, P, R; `None` for any.
    axes: BTreeSet<Option<u32>>,
    /// The token of each position, by its number.
    taught: BTreeMap<u32, TokenId>,
    /// Position registers that the program sets to positions and that no other program may read at any moment, with all of these positions.
    copies: BTreeMap<u32, BTreeSet<u32>>,
    /// Whether a statement may be a label that is not known.
    has_odd_labels: bool,
    /// Statements that are targets of jumps.
    wanted: BTreeSet<usize>,
    goes_anywhere: bool,
    /// The statement that is lowered.
    place: SourceSpan,
}

impl<'a> Lowering<'a> {
    fn new(code: &'a Code<'a>, calls: &'a Calls, positions: &[(u32, Span)]) -> Self {
        let concurs = |kind: &Written<'_>| calls.of_statement(kind).contains(&Effect::Concurrent);
        let is_read = |register: &u32| {
            calls.used_elsewhere.contains(&None)
                || calls.used_elsewhere.contains(&Some(*register))
                || code.kinds.iter().any(concurs)
        };
        let mut copies: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        for kind in &code.kinds {
            if let Some((register, position)) = copied(kind).filter(|(register, _)| !is_read(register)) {
                copies.entry(register).or_default().insert(position);
            }
        }
        let counts_on = |kind: &Written<'_>| matches!(kind, Written::Motion(motion) if motion.counts_on());
        let is_odd = |kind: &Written<'_>| match kind {
            Written::Label(number) => expression::count(number).is_none(),
            kind => *kind == Written::Unknown || statement::guarded_by(kind) == Some(Written::Unknown),
        };
        Self {
            code,
            calls,
            counts: calls.is_counted_from || calls.may_count() || code.kinds.iter().any(counts_on),
            axes: (calls.given.values().flatten().copied())
                .chain(code.kinds.iter().flat_map(effects::effects))
                .filter_map(|effect| if let Effect::Axes(register) = effect { Some(register) } else { None })
                .collect(),
            taught: positions.iter().enumerate().rev().map(|(at, (number, _))| (*number, TokenId(at as u32))).collect(),
            copies,
            has_odd_labels: code.kinds.iter().any(is_odd),
            wanted: BTreeSet::new(),
            goes_anywhere: false,
            place: SourceSpan::default(),
        }
    }

    fn program(mut self, tokens: Vec<SourceSpan>, stands: Expression, displaced: Option<Reason>) -> (Program, Tp) {
        let count = self.code.kinds.len();
        let lowered: Vec<Vec<StatementKind>> = (0..count).map(|at| self.statement(at)).collect();
        let place = |at: usize| self.code.lines.get(at).map_or(SourceSpan::default(), |line| placed(line.span));
        let mut all: Vec<Statement> = Vec::new();
        let mut put = |at, kind| all.push(Statement { kind, place: place(at) });
        for (at, kinds) in lowered.into_iter().chain([Vec::new()]).enumerate() {
            if self.goes_anywhere || self.wanted.contains(&at) {
                put(at, StatementKind::Label(name(at)));
            }
            kinds.into_iter().for_each(|kind| put(at, kind));
        }
        self.ends().into_iter().for_each(|kind| put(count, kind));
        if self.goes_anywhere {
            put(count, StatementKind::Label(ANYWHERE.into()));
            for at in 0..count {
                let condition = Some(Expression::unknown(Reason::Input, Vec::new(), place(at)));
                put(count, StatementKind::Jump { to: name(at), condition });
            }
        }
        let left = &self.calls.left_elsewhere;
        let [users, tools] = [Frame::User, Frame::Tool].map(|frame| {
            let left = left.iter().filter_map(|effect| match effect {
                Effect::Redefine(of, Some(number)) if *of == frame && *number < MOST => Some(number + 1),
                _ => None,
            });
            left.max().unwrap_or(0).max(extent(&all, &[builtin::REDEFINE[frame as usize]], NUMBERED))
        });
        let registers = extent(&all, &[builtin::REGISTER, builtin::SET], REGISTERS);
        let elements = ELEMENTS * extent(&all, &[builtin::ELEMENT], POSITION_REGISTERS);
        let frame = ORIGINS + self.copies.len() as u32;
        let [tool, register] = [frame + users, frame + users + tools];
        let element = register + registers;
        let tp = Tp {
            frames: [frame..tool, tool..register],
            registers: register..element,
            elements: element..element + elements,
        };
        // A cycle begins with the frames that the one before left, or another program.
        let set: BTreeSet<u32> = (self.code.kinds.iter())
            .flat_map(|kind| self.calls.of_statement(kind))
            .chain(left.iter().copied())
            .filter_map(|effect| match effect {
                Effect::Redefine(_, Some(MOST..)) => None,
                Effect::Redefine(frame, Some(number)) => Some(tp.frames[frame as usize].start + number),
                Effect::Redefine(frame, None) => Some(ANY[frame as usize]),
                _ => None,
            })
            .collect();
        // The values before the first statement.
        let unknown = |reason| Expression::unknown(reason, Vec::new(), SourceSpan::default());
        let truth = |holds| Expression { kind: Is::Truth(holds), place: SourceSpan::default() };
        let mut begins = vec![
            (Switch::Frame.slot(), unknown(Reason::FrameSelected)),
            (Switch::Tool.slot(), unknown(Reason::ToolSelected)),
            (Slot::Global(OVERRIDE), self.override_of(self.override_left())),
        ];
        let slots = [CONCURRENT, ANY[0], ANY[1]].into_iter().chain(frame..register);
        let is_set = |slot| {
            let of_any = |frame: usize| tp.frames[frame].contains(&slot) && set.contains(&ANY[frame]);
            set.contains(&slot) || of_any(0) || of_any(1)
        };
        begins.extend(slots.map(|slot| (Slot::Global(slot), truth(is_set(slot)))));
        begins.extend(displaced.map(|why| (Switch::Shift.slot(), unknown(why))));
        // A register has the value that the last cycle left.
        let left = self.copies.values().map(|left| left.iter().map(|position| self.taught(*position)).collect());
        let left = left.map(|left| Expression { kind: Is::List(left), place: SourceSpan::default() });
        begins.extend((ORIGINS..).map(Slot::Global).zip(left));
        if self.counts {
            begins.push((Slot::Global(POSITIONS), self.table()));
            begins.push((Slot::Global(STANDS), stands));
        }
        // A caller has moved the arm.
        let elsewhere = self.calls.is_called.then(|| self.does(builtin::ELSEWHERE, Vec::new()));
        let begins = begins.into_iter().map(|(slot, value)| assign(slot, value)).chain(elsewhere);
        let body = begins.map(|kind| Statement { kind, place: SourceSpan::default() }).chain(all).collect();
        let functions = vec![Function { name: "/MN".into(), body, ..Function::default() }];
        let globals = (0..tp.elements.end).map(|slot| name(slot as usize)).collect();
        (Program { functions, entries: vec![FunctionId(0)], tokens, globals, ..Program::default() }, tp)
    }

    /// What a statement is made of.
    fn statement(&mut self, at: usize) -> Vec<StatementKind> {
        self.place = placed(self.code.lines[at].span);
        let partner = self.code.partner.get(&at).copied();
        let mut kinds = self.uses(at);
        kinds.extend(self.does_itself(at, partner));
        kinds
    }

    /// Records the positions on which a statement depends by position registers.
    fn uses(&self, at: usize) -> Vec<StatementKind> {
        let (line, kind) = (&self.code.lines[at], &self.code.kinds[at]);
        // The bound of a loop may be read in each round.
        let start = self.code.partner.get(&at).filter(|_| *kind == Written::EndFor);
        let start = start.map(|start| (&self.code.lines[*start], &self.code.kinds[*start]));
        let used =
            [(line, kind)].into_iter().chain(start).flat_map(|(line, kind)| statement::registers_used(line, kind));
        let mut parts: Vec<Expression> = used.flat_map(|index| self.origins(expression::count(index))).collect();
        // What becomes of a register that other programs may read is not known.
        let lost = |(register, _): &(u32, u32)| !self.copies.contains_key(register);
        parts.extend(copied(kind).filter(lost).map(|(_, position)| self.taught(position)));
        (!parts.is_empty()).then(|| self.uses_up(parts)).into_iter().collect()
    }

    /// Expressions that depend on the positions from which a position register comes; from which any comes, if its number is unknown.
    fn origins(&self, register: Option<u32>) -> Vec<Expression> {
        let is_wanted = |own: &u32| register.is_none_or(|register| register == *own);
        let slots = (ORIGINS..).zip(self.copies.keys()).filter(|(_, own)| is_wanted(own));
        slots.map(|(slot, _)| self.read(slot)).collect()
    }

    /// An expression that depends on a position.
    fn taught(&self, position: u32) -> Expression {
        let kind = self.taught.get(&position).map_or(Is::Truth(false), |token| Is::Number(0.0, *token));
        Expression { kind, place: self.place }
    }

    fn does_itself(&mut self, at: usize, partner: Option<usize>) -> Vec<StatementKind> {
        match (&self.code.kinds[at], partner) {
            // Its effects come with the motion that it belongs to.
            _ if self.code.inner[at] => Vec::new(),
            (Written::If(text), Some(partner)) => {
                let holds = expression(text, self.place);
                vec![self.go(partner, Some(self.not(holds)))]
            }
            (Written::Else, Some(partner)) => vec![self.go(partner, None)],
            (Written::When(text), _) => {
                let (rest, holds) = match condition(text, self.place) {
                    (rest, holds) if rest.trim_ascii_start().starts_with(b",") => (rest, holds),
                    _ => (statement::after_condition(text), self.unknown()),
                };
                let guarded = self.plain(at, &statement::guarded(rest));
                vec![guard(holds, guarded, self.place)]
            }
            (Written::SelectCase(..) | Written::Case(_) | Written::ElseCase(_), Some(partner)) => {
                self.case(at, partner)
            }
            (Written::For(register, from, to, down), Some(end)) => {
                let enters = self.within(expression(from, self.place), expression(to, self.place), *down);
                let over = StatementKind::Jump { to: over(end), condition: Some(self.not(enters)) };
                let from = expression(from, self.place);
                vec![over, self.set(register, from)]
            }
            (Written::EndFor, Some(start)) => self.again(at, start),
            (kind, _) => self.plain(at, kind),
        }
    }

    /// A statement that is not one of several that belong together.
    fn plain(&mut self, at: usize, kind: &Written<'_>) -> Vec<StatementKind> {
        match kind {
            Written::Mark(said) => {
                let said = Expression { kind: Is::Text((*said).into()), place: self.place };
                vec![assign(Switch::Mark.slot(), said)]
            }
            Written::Motion(motion) => self.motion(at, motion),
            Written::Select(frame, value) => {
                let value = expression(value, self.place);
                vec![self.does(builtin::SELECT[*frame as usize], vec![value])]
            }
            Written::Redefine(frame, index, register) => {
                let [index, register] = [index, register].map(|text| expression(text, self.place));
                vec![self.does(builtin::REDEFINE[*frame as usize], vec![index, register])]
            }
            Written::Element(register, element, value) => {
                let value = if self.may_have_axes(register) { self.unknown() } else { expression(value, self.place) };
                let [register, element] = [register, element].map(|text| expression(text, self.place));
                vec![self.does(builtin::ELEMENT, vec![register, element, value])]
            }
            Written::PositionRegister(register, Whole::Zero) if !self.may_have_axes(register) => {
                let register = expression(register, self.place);
                let zero = |element: u32| {
                    let element = Expression::constant(f64::from(element));
                    self.does(builtin::ELEMENT, vec![register.clone(), element, Expression::constant(0.0)])
                };
                (1..=ELEMENTS).map(zero).chain(self.comes_from(kind)).collect()
            }
            Written::PositionRegister(register, _) => {
                let register = expression(register, self.place);
                let lost = self.does(builtin::ELEMENT, vec![register, self.unknown(), self.unknown()]);
                [lost].into_iter().chain(self.comes_from(kind)).collect()
            }
            Written::Override(percent) => {
                let percent = self.override_of(expression(percent, self.place));
                vec![assign(Slot::Global(OVERRIDE), percent)]
            }
            Written::Register(register, value) => {
                let value = expression(value, self.place);
                vec![self.set(register, value)]
            }
            Written::Jump(label) => {
                let lost = self.waited_for_at(at, label);
                lost.into_iter().chain(self.jump(label, None)).collect()
            }
            Written::Wait(condition, label) => self.wait(condition, *label),
            Written::Call(name) if self.calls.straight(name).is_some() => self.straight(at, name),
            Written::Call(_) | Written::Macro | Written::Displace(_) | Written::RedefineAny => {
                self.effects(self.calls.of_statement(kind))
            }
            // A program that runs in parallel does not move the arm.
            Written::Concurrent(_) => self.effects(without(self.calls.of_statement(kind), &[Effect::Moves])),
            Written::End => self.ends(),
            Written::Unknown => {
                let mut kinds = self.effects(without(self.calls.of_statement(kind), &[Effect::Moves]));
                kinds.push(self.anywhere());
                kinds
            }
            // Within a condition none of these is a statement.
            Written::If(_)
            | Written::Else
            | Written::When(_)
            | Written::SelectCase(..)
            | Written::Case(_)
            | Written::ElseCase(_) => Vec::new(),
            Written::For(..) | Written::EndFor | Written::EndIf | Written::Label(_) | Written::Plain => Vec::new(),
        }
    }

    /// The statements of a called program.
    fn straight(&mut self, at: usize, name: &[u8]) -> Vec<StatementKind> {
        let mut effects = self.calls.of(name);
        effects.retain(|effect| matches!(effect, Effect::Uses(_)));
        let mut kinds = self.effects(effects);
        for line in self.calls.straight(name).unwrap_or_default() {
            kinds.extend(self.plain(at, &statement::kind(line)));
        }
        kinds
    }

    /// Records from which positions a position register comes after it was set as a whole.
    fn comes_from(&self, kind: &Written<'_>) -> Option<StatementKind> {
        let Written::PositionRegister(register, whole) = kind else { return None };
        let own = expression::count(register)?;
        let (slot, _) = (ORIGINS..).zip(self.copies.keys()).find(|(_, register)| **register == own)?;
        let origin = match whole {
            Whole::Taught(position) => self.taught(*position),
            _ => Expression { kind: Is::Truth(false), place: self.place },
        };
        Some(assign(Slot::Global(slot), origin))
    }

    /// The speed override after it was set; unknown if a program that runs in parallel may set it too.
    fn override_of(&self, percent: Expression) -> Expression {
        let effects = || self.code.kinds.iter().flat_map(|kind| self.calls.of_statement(kind));
        let is_set = self.calls.given.values().any(|effects| effects.contains(&Effect::Override));
        if is_set && effects().any(|effect| effect == Effect::Concurrent) { self.unknown() } else { percent }
    }

    /// The speed override with which a cycle begins: 100 % in the first one, and then what the cycle before, or another program, has left.
    fn override_left(&self) -> Expression {
        if self.calls.left_elsewhere.contains(&Effect::Override) {
            return self.unknown();
        }
        let kinds = &self.code.kinds;
        let sets = |kind: &Written<'_>| self.calls.of_statement(kind).contains(&Effect::Override);
        let Some(last) = kinds.iter().rposition(sets) else { return Expression::constant(100.0) };
        // Whether each cycle executes the last of these statements.
        let is_passed = kinds[last + 1..].iter().all(|kind| !matches!(kind, Written::Label(_)))
            && kinds[..last].iter().all(|kind| match kind {
                Written::When(_) | Written::SelectCase(..) | Written::Case(_) | Written::ElseCase(_) => {
                    statement::guarded_by(kind).is_none_or(|guarded| guarded != Written::End)
                }
                Written::End | Written::Unknown => false,
                _ => true,
            })
            && self.code.partner.iter().all(|(from, to)| !(from.min(to)..from.max(to)).contains(&&last));
        match &kinds[last] {
            Written::Override(b"100") if is_passed => Expression::constant(100.0),
            _ => self.unknown(),
        }
    }

    /// Whether a position register may have axis angles.
    fn may_have_axes(&self, register: &[u8]) -> bool {
        let own = expression::count(register);
        self.axes.contains(&own) || self.axes.contains(&None) || own.is_none() && !self.axes.is_empty()
    }

    fn motion(&mut self, at: usize, motion: &Motion<'_>) -> Vec<StatementKind> {
        let index = |point: Point<'_>| match point {
            Point::Position(index) => expression(index, self.place),
            Point::Register(_) => Expression::unknown(Reason::PositionRegister, Vec::new(), self.place),
            Point::RunTime(why) => Expression::unknown(why, Vec::new(), self.place),
        };
        let position = |point| Expression::builtin(builtin::POSITION, vec![index(point)], self.place);
        let origins = motion.moves_to_register().map(|index| self.origins(expression::count(index)));
        let origins = Expression { kind: Is::List(origins.unwrap_or_default()), place: self.place };
        let mut of_end = vec![index(motion.end), origins];
        of_end.extend(motion.offset.map(|register| expression(register, self.place)));
        let end = Expression::builtin(builtin::POSITION, of_end, self.place);
        let counts = motion.counts_on().then(|| self.read(STANDS));
        let moves = ir::Motion {
            path: motion.path,
            via: motion.via.map(position),
            to: Some(end),
            speed: motion.speed.map(|speed| {
                let percent = self.read(OVERRIDE);
                let Speed::Register { text, .. } = speed else { return percent };
                let two = Box::new([expression(text, self.place), percent]);
                Expression { kind: Is::Binary(Binary::Multiply, two), place: self.place }
            }),
            blend: None,
            others: counts.into_iter().collect(),
        };
        let mut kinds = vec![StatementKind::Move(Box::new(moves))];
        if self.counts {
            let item = |point| {
                let two = Box::new([self.read(POSITIONS), index(point)]);
                Expression { kind: Is::Item(two), place: self.place }
            };
            let points = motion.via.into_iter().chain([motion.end]).map(item).collect();
            kinds.push(assign(Slot::Global(STANDS), Expression { kind: Is::List(points), place: self.place }));
        }
        let inner = (at + 1..self.code.inner.len()).take_while(|at| self.code.inner[*at]);
        let logic = inner.flat_map(|at| self.calls.of_statement(&self.code.kinds[at]));
        let on_the_way = motion.calls.iter().flat_map(|name| self.calls.of(name)).chain(logic);
        let on_the_way = on_the_way.chain(motion.runs_others.then_some(Effect::Concurrent)).collect();
        kinds.extend(self.effects(without(on_the_way, &[Effect::Moves, Effect::Counts])));
        if let Some(label) = motion.skip {
            kinds.extend(self.effects([Effect::Elements(None)].into()));
            kinds.extend(self.jump(label, Some(self.unknown())));
        }
        kinds
    }

    /// A wait: if its condition does not hold yet, something else changes the registers that it names.
    fn wait(&mut self, text: &[u8], label: Option<&[u8]>) -> Vec<StatementKind> {
        let holds = expression(text, self.place);
        let mut registers = Vec::new();
        holds.each(&mut |part| {
            if let Is::Call(Callee::Builtin(builtin::REGISTER), arguments) = &part.kind {
                registers.extend(arguments.first().map(|number| number.value.clone()));
            }
        });
        let lost = registers.into_iter().map(|number| self.does(builtin::SET, vec![number, self.waited_for()]));
        let mut lost: Vec<StatementKind> = lost.collect();
        holds.each(&mut |part| {
            if let Is::Call(Callee::Builtin(builtin::VALUE), of) = &part.kind {
                let of = of.iter().map(|part| part.value.clone()).chain([self.waited_for()]).collect();
                lost.push(self.does(builtin::ELEMENT, of));
            }
        });
        let mut kinds = Vec::new();
        if !lost.is_empty() {
            kinds.push(guard(self.not(holds), lost, self.place));
        }
        let timeout = label.map(|label| self.jump(label, Some(self.unknown())));
        kinds.into_iter().chain(timeout.into_iter().flatten()).collect()
    }

    /// A jump back over statements that change nothing waits for the registers in their conditions: something else changes them.
    fn waited_for_at(&self, at: usize, label: &[u8]) -> Vec<StatementKind> {
        let to = expression::count(label).and_then(|number| self.code.labels.get(&number));
        let body = to.and_then(|to| self.code.kinds.get(*to..=at)).unwrap_or_default();
        let is_idle = |kind: &Written<'_>| match kind {
            Written::Label(_) | Written::Plain | Written::Wait(..) | Written::Jump(_) => true,
            Written::If(_) | Written::Else | Written::EndIf => true,
            kind => matches!(statement::guarded_by(kind), Some(Written::Jump(_) | Written::Plain)),
        };
        if !body.iter().all(is_idle) {
            return Vec::new();
        }
        let conditions = body.iter().flat_map(|kind| match kind {
            Written::If(text) | Written::When(text) | Written::Case(text) => [*text, b""],
            Written::SelectCase(operand, text) => [*operand, *text],
            _ => [&b""[..]; 2],
        });
        let lost = conditions.flat_map(|text| {
            let [registers, position_registers] = statement::registers_in(text);
            let of_register = |index| self.does(builtin::SET, vec![expression(index, self.place), self.waited_for()]);
            let of_elements = |index| {
                let all = vec![expression(index, self.place), self.unknown(), self.waited_for()];
                self.does(builtin::ELEMENT, all)
            };
            let registers: Vec<StatementKind> = registers.into_iter().map(of_register).collect();
            registers.into_iter().chain(position_registers.into_iter().map(of_elements)).collect::<Vec<_>>()
        });
        lost.collect()
    }

    /// A case of a `SELECT`: its statement, and after all cases; or the next case.
    fn case(&mut self, at: usize, partner: usize) -> Vec<StatementKind> {
        let first = self.code.first_case.get(&at).map(|first| &self.code.kinds[*first]);
        let Some(Written::SelectCase(operand, first)) = first else { return vec![self.anywhere()] };
        let (value, guarded) = match &self.code.kinds[at] {
            Written::Case(text) => statement::case(text),
            Written::ElseCase(text) => (&b""[..], statement::guarded(text)),
            _ => statement::case(first),
        };
        let mut kinds = self.plain(at, &guarded);
        kinds.push(self.go(partner, None));
        if matches!(self.code.kinds[at], Written::ElseCase(_)) {
            return kinds;
        }
        let two = [*operand, value].map(|text| expression(text, self.place));
        let holds = Expression { kind: Is::Binary(Binary::Equal, Box::new(two)), place: self.place };
        vec![guard(holds, kinds, self.place)]
    }

    /// `ENDFOR`: once more, or on.
    fn again(&mut self, at: usize, start: usize) -> Vec<StatementKind> {
        let Written::For(register, _, to, down) = &self.code.kinds[start] else { return vec![self.anywhere()] };
        let counter = || Expression::builtin(builtin::REGISTER, vec![expression(register, self.place)], self.place);
        let step = if *down { Binary::Subtract } else { Binary::Add };
        let last = Some(expression(to, self.place)).filter(|last| self.is_fixed(last, register, start + 1..at));
        let last = last.unwrap_or_else(|| self.unknown());
        let enters = self.within(counter(), last, *down);
        let next = self.set(register, counter().with(step, 1.0));
        // The manuals do not say which value the counter has after the loop.
        let lost = self.set(register, self.unknown());
        vec![next, self.go(start + 1, Some(enters)), StatementKind::Label(over(at)), lost]
    }

    /// Whether the bound of a loop is the same in each round. A bound in a register is if the statements of the loop run one after
    /// the other and do not change it, and if it is not the counter: the manuals do not say when the controller reads it.
    fn is_fixed(&self, bound: &Expression, counter: &[u8], body: Range<usize>) -> bool {
        let mut registers = Vec::new();
        bound.each(&mut |part| {
            if let Is::Call(Callee::Builtin(builtin::VALUE), _) = &part.kind {
                registers.push(None);
            }
            if let Is::Call(Callee::Builtin(builtin::REGISTER), of) = &part.kind {
                registers.push(match of[..] {
                    [Argument { value: Expression { kind: Is::Constant(number), .. }, .. }] => {
                        expression::counted(number)
                    }
                    _ => None,
                });
            }
        });
        let is_other = |register: &[u8]| expression::count(register).is_some_and(|set| !registers.contains(&Some(set)));
        let keeps = |kind: &Written<'_>| match kind {
            Written::Motion(motion) => motion.skip.is_none() && motion.calls.is_empty() && !motion.runs_others,
            Written::Register(register, _) | Written::For(register, ..) => is_other(register),
            Written::If(_) | Written::Else | Written::EndIf | Written::EndFor => true,
            Written::Select(..) | Written::Redefine(..) | Written::Override(_) => true,
            Written::Mark(_) | Written::Plain => true,
            Written::Element(..) | Written::PositionRegister(..) => true,
            _ => false,
        };
        registers.is_empty()
            || !registers.contains(&None) && is_other(counter) && self.code.kinds[body].iter().all(keeps)
    }

    /// Whether a count has not passed its end.
    fn within(&self, count: Expression, end: Expression, down: bool) -> Expression {
        let compare = if down { Binary::AtLeast } else { Binary::AtMost };
        Expression { kind: Is::Binary(compare, Box::new([count, end])), place: self.place }
    }

    /// A jump to a label by its number, where a condition holds; without one always.
    fn jump(&mut self, label: &[u8], condition: Option<Expression>) -> Vec<StatementKind> {
        if let Some(number) = expression::count(label) {
            let to = self.code.labels.get(&number).copied();
            // A controller stops at a label that is not there.
            let stops = || condition.is_none().then_some(StatementKind::Halt);
            return to.map_or_else(|| stops().into_iter().collect(), |to| vec![self.go(to, condition.clone())]);
        }
        let mut kinds = Vec::new();
        for (number, at) in &self.code.labels {
            let two = [expression(label, self.place), Expression::constant(f64::from(*number))];
            let is_this = Expression { kind: Is::Binary(Binary::Equal, Box::new(two)), place: self.place };
            kinds.push(self.go(*at, Some(is_this)));
        }
        kinds.push(if self.has_odd_labels { self.anywhere() } else { StatementKind::Halt });
        match condition {
            Some(condition) => vec![guard(condition, kinds, self.place)],
            None => kinds,
        }
    }

    fn effects(&self, effects: BTreeSet<Effect>) -> Vec<StatementKind> {
        let number =
            |number: Option<u32>| number.map_or_else(|| self.unknown(), |number| Expression::constant(number.into()));
        let lower = |effect| {
            Some(match effect {
                // `axes` has these registers: their elements are never known.
                Effect::Axes(_) => return None,
                Effect::Register(register) => self.does(builtin::SET, vec![number(register), self.unknown()]),
                Effect::Select(frame) => self.does(builtin::SELECT[frame as usize], vec![self.unknown()]),
                Effect::Redefine(frame, of) => {
                    self.does(builtin::REDEFINE[frame as usize], vec![number(of), self.unknown()])
                }
                Effect::Uses(register) => self.uses_up(self.origins(register)),
                Effect::Elements(of) => self.does(builtin::ELEMENT, vec![number(of), self.unknown(), self.unknown()]),
                Effect::Override => assign(Slot::Global(OVERRIDE), self.unknown()),
                Effect::Displace(why) => assign(Switch::Shift.slot(), Expression::unknown(why, Vec::new(), self.place)),
                Effect::Concurrent => self.does(builtin::CONCURRENT, Vec::new()),
                Effect::Moves => self.does(builtin::ELSEWHERE, Vec::new()),
                Effect::Counts => self.counted_from(),
            })
        };
        effects.into_iter().filter_map(lower).collect()
    }

    /// Something counts from where the arm stands.
    fn counted_from(&self) -> StatementKind {
        self.uses_up(vec![self.read(STANDS)])
    }

    /// Something other than the end of a motion depends on values.
    fn uses_up(&self, values: Vec<Expression>) -> StatementKind {
        StatementKind::Evaluate(Expression::unknown(Reason::Input, values, self.place))
    }

    /// The end of the program.
    fn ends(&self) -> Vec<StatementKind> {
        let counted = self.calls.is_counted_from.then(|| self.counted_from());
        counted.into_iter().chain([StatementKind::Return(None)]).collect()
    }

    fn does(&self, builtin: u16, arguments: Vec<Expression>) -> StatementKind {
        StatementKind::Evaluate(Expression::builtin(builtin, arguments, self.place))
    }

    fn set(&self, register: &[u8], value: Expression) -> StatementKind {
        self.does(builtin::SET, vec![expression(register, self.place), value])
    }

    fn go(&mut self, to: usize, condition: Option<Expression>) -> StatementKind {
        self.wanted.insert(to);
        StatementKind::Jump { to: name(to), condition }
    }

    /// Goes on at any statement.
    fn anywhere(&mut self) -> StatementKind {
        self.goes_anywhere = true;
        StatementKind::Jump { to: ANYWHERE.into(), condition: None }
    }

    fn not(&self, holds: Expression) -> Expression {
        Expression { kind: Is::Unary(Unary::Not, Box::new(holds)), place: self.place }
    }

    /// All positions by their numbers, each of which depends on its token.
    fn table(&self) -> Expression {
        let most = self.taught.keys().filter(|number| **number < MOST).max();
        let items = (0..most.map_or(0, |most| most + 1)).map(|number| self.taught(number)).collect();
        Expression { kind: Is::List(items), place: SourceSpan::default() }
    }

    fn read(&self, slot: u32) -> Expression {
        Expression { kind: Is::Read(Slot::Global(slot)), place: self.place }
    }

    fn waited_for(&self) -> Expression {
        Expression::unknown(Reason::WaitedFor, Vec::new(), self.place)
    }

    fn unknown(&self) -> Expression {
        Expression::unknown(Reason::Input, Vec::new(), self.place)
    }
}

fn placed(span: Span) -> SourceSpan {
    SourceSpan { source: 0, span }
}

fn name(at: usize) -> Arc<str> {
    at.to_string().into()
}

/// The name of the place after a loop.
fn over(end: usize) -> Arc<str> {
    format!("after {end}").into()
}

fn assign(slot: Slot, value: Expression) -> StatementKind {
    StatementKind::assign(slot, value)
}

fn guard(condition: Expression, kinds: Vec<StatementKind>, place: SourceSpan) -> StatementKind {
    let body = kinds.into_iter().map(|kind| Statement { kind, place }).collect();
    StatementKind::If { arms: vec![(condition, body)], otherwise: Vec::new() }
}

fn without(mut effects: BTreeSet<Effect>, others: &[Effect]) -> BTreeSet<Effect> {
    effects.retain(|effect| !others.contains(effect));
    effects
}

/// The position register that a statement sets to a position, and the number of that position.
fn copied(kind: &Written<'_>) -> Option<(u32, u32)> {
    match kind {
        Written::PositionRegister(register, Whole::Taught(position)) => Some((expression::count(register)?, *position)),
        _ => None,
    }
}

/// How many numbers are followed of what these routines are called with first; `computed` of them where some are computed.
fn extent(all: &[Statement], routines: &[u16], computed: u32) -> u32 {
    let mut count = 0;
    let mut number = |part: &Expression| {
        let Is::Call(Callee::Builtin(routine), arguments) = &part.kind else { return };
        let Some(first) = arguments.first().filter(|_| routines.contains(routine)) else { return };
        count = count.max(match first.value.kind {
            Is::Constant(number) if is_whole(number) => {
                expression::counted(number).filter(|number| *number < MOST).map_or(0, |number| number + 1)
            }
            // An effect on every number needs no variable.
            Is::Unknown(..) => 0,
            _ => computed,
        });
    };
    for statement in all {
        statement.each(&mut |statement| {
            statement.expressions().into_iter().for_each(|part| part.each(&mut number));
        });
    }
    count
}
