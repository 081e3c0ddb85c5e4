//! The syntax tree of a file.

use super::expression::{Call, Expression, ExpressionPart, Setting};
use super::value::{Name, Value};
use crate::{Mark, Motion, Reason};
use deflex_text::Span;

/// One file: routines (`.src`), data (`.dat`), or both.
#[derive(Debug, Default)]
pub(super) struct File {
    /// The name after DEFDAT, or after the first DEF.
    pub(super) module: Name,
    pub(super) routines: Vec<Routine>,
    pub(super) data: Vec<Data>,
    /// Elements that a data list sets, in text order, with their places: `Points[1]={X 1,…}`.
    pub(super) values: Vec<(Setting, Span)>,
    /// Components that a STRUC declares as INT.
    pub(super) whole: Vec<Name>,
    /// Data of other files that this one imports: the module and the name there.
    pub(super) imports: Vec<(Name, Name)>,
    /// Statements that are not understood, with the reason.
    pub(super) odd: Vec<(Span, Reason)>,
    /// The last mark before the first routine, which is in force from the start.
    pub(super) mark: Option<Mark>,
    /// Place of a routine or a block within which the file ends.
    pub(super) cut: Option<Span>,
}

/// `[GLOBAL] DEF name(params)` or `DEFFCT type name(params)`.
#[derive(Debug)]
pub(super) struct Routine {
    pub(super) name: Name,
    pub(super) is_function: bool,
    pub(super) is_global: bool,
    pub(super) params: Vec<Param>,
    pub(super) data: Vec<Data>,
    pub(super) body: Vec<Statement>,
}

#[derive(Debug)]
pub(super) struct Param {
    pub(super) name: Name,
    /// `:OUT`, which is the default: the parameter is the caller's variable.
    pub(super) is_out: bool,
}

/// `[DECL] [GLOBAL] [CONST] type name[…] [= value]`
#[derive(Debug)]
pub(super) struct Data {
    pub(super) kind: Option<Type>,
    pub(super) name: Name,
    pub(super) is_global: bool,
    pub(super) is_constant: bool,
    pub(super) is_array: bool,
    pub(super) value: Option<Expression>,
}

/// Types that say what a value becomes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    Whole,
    Real,
    Frame,
    Pos,
    /// A STRUC of the program, or an ENUM.
    Structure,
    /// SIGNAL
    Signal,
}

#[derive(Debug)]
pub(super) struct Statement {
    pub(super) kind: StatementKind,
    pub(super) at: Span,
}

#[derive(Debug)]
pub(super) enum StatementKind {
    Assign(Box<Setting>),
    Call(Box<Call>),
    Move(Box<Move>),
    /// A motion that is not followed: the reason, and its arguments.
    Relative(Reason, Vec<Expression>),
    Trigger(Box<Started>),
    Interrupt(Box<Started>),
    /// A statement that changes no data and moves nothing, with the expressions that it reads.
    Harmless(Vec<Expression>),
    /// `TIME_BLOCK`, which states the time of a part of a spline in place of its speed, with the expressions that it reads.
    TimeBlock(Vec<Expression>),
    /// `WAIT FOR`: the condition, in one part if it is understood as a whole.
    WaitFor(Vec<Expression>),
    /// RESUME
    Resume,
    /// `ON_ERROR_PROCEED`
    Proceed,
    /// A statement that is not understood, with the expressions in it.
    NotUnderstood(Vec<Expression>),
    If(Box<If>),
    Loop(Box<Loop>),
    /// The start of a spline, with the settings of its WITH, which apply to all of its segments.
    SplineBegins(Vec<Setting>),
    SplineEnds,
    /// GOTO
    Jump(Name),
    /// The target of a GOTO.
    Label(Name),
    Return(Vec<Expression>),
    Exit,
    Mark(Mark),
}

/// A motion to a position.
#[derive(Debug)]
pub(super) struct Move {
    pub(super) motion: Motion,
    /// `SPL`: on a curve through this point and its neighbours.
    pub(super) is_curve: bool,
    pub(super) via: Option<Box<Expression>>,
    pub(super) end: Expression,
    /// `CA`: the angle of a circle.
    pub(super) angle: Option<Box<Expression>>,
    /// The settings of WITH.
    pub(super) with: Vec<Setting>,
    /// Whether the statement has nothing else.
    pub(super) is_whole: bool,
}

/// A statement that an interrupt or a TRIGGER starts while the program continues.
#[derive(Debug)]
pub(super) struct Started {
    /// The expressions that say when it starts.
    pub(super) when: Vec<Expression>,
    /// The statement; `None` if an interrupt is only switched on or off.
    pub(super) run: Option<Statement>,
}

#[derive(Debug)]
pub(super) struct If {
    pub(super) condition: Expression,
    pub(super) then: Vec<Statement>,
    pub(super) otherwise: Vec<Statement>,
}

/// A loop. Its condition or EXIT ends it, or nothing does.
#[derive(Debug)]
pub(super) struct Loop {
    pub(super) condition: Expression,
    /// REPEAT … UNTIL: the condition is evaluated after the body, and ends the loop if it is true.
    pub(super) is_until: bool,
    pub(super) body: Vec<Statement>,
}

impl Loop {
    /// Whether only EXIT can end it.
    pub(super) fn is_endless(&self) -> bool {
        match &self.condition {
            Expression::Known(Value::Bool(holds)) => *holds != self.is_until,
            _ => false,
        }
    }
}

impl File {
    /// Number of complete numeric positions in it: aggregates with all six of X, Y, Z, A, B, C.
    pub(super) fn positions(&self) -> usize {
        let mut count = 0;
        let mut add = |part: ExpressionPart<'_>| count += part.positions();
        let data = self.data.iter().chain(self.routines.iter().flat_map(|routine| &routine.data));
        data.filter_map(|data| data.value.as_ref()).for_each(|value| value.each(&mut add));
        self.values.iter().for_each(|(setting, _)| setting.value.each(&mut add));
        let statements = self.routines.iter().flat_map(Routine::statements);
        statements.for_each(|statement| statement.each(&mut add));
        count
    }
}

impl Routine {
    /// Names of its parameters and of its own data.
    pub(super) fn own_names(&self) -> impl Iterator<Item = &Name> {
        self.data.iter().map(|data| &data.name).chain(self.params.iter().map(|param| &param.name))
    }

    /// All of its statements, including those in nested blocks.
    pub(super) fn statements(&self) -> Vec<&Statement> {
        let mut all = Vec::new();
        walk(&self.body, &mut |statement| all.push(statement));
        all
    }
}

impl Statement {
    /// Whether it moves the robot.
    pub(super) fn is_motion(&self) -> bool {
        matches!(self.kind, StatementKind::Move(_) | StatementKind::Relative(..))
    }

    /// This statement, and the one that it makes run later (TRIGGER, INTERRUPT).
    pub(super) fn with_started(&self) -> impl Iterator<Item = &Self> {
        let started = match &self.kind {
            StatementKind::Trigger(started) | StatementKind::Interrupt(started) => started.run.as_ref(),
            _ => None,
        };
        [self].into_iter().chain(started)
    }

    /// The settings `path = value` that it makes, for itself only (WITH) or from then on.
    pub(super) fn settings(&self) -> &[Setting] {
        match &self.kind {
            StatementKind::Assign(setting) => std::slice::from_ref(setting),
            StatementKind::Move(of) => &of.with,
            StatementKind::SplineBegins(with) => with,
            _ => &[],
        }
    }

    /// The expressions of this statement, without those of nested statements.
    pub(super) fn expressions(&self) -> Vec<&Expression> {
        let mut all: Vec<&Expression> = self.settings().iter().map(|setting| &setting.value).collect();
        match &self.kind {
            StatementKind::Call(call) => all.extend(call.arguments.iter().flatten()),
            StatementKind::Move(of) => {
                all.extend(of.via.as_deref().into_iter().chain([&of.end]).chain(of.angle.as_deref()))
            }
            StatementKind::Relative(_, parts)
            | StatementKind::Harmless(parts)
            | StatementKind::TimeBlock(parts)
            | StatementKind::WaitFor(parts)
            | StatementKind::Return(parts)
            | StatementKind::NotUnderstood(parts) => all.extend(parts),
            StatementKind::Trigger(started) | StatementKind::Interrupt(started) => all.extend(&started.when),
            StatementKind::If(of) => all.push(&of.condition),
            StatementKind::Loop(of) => all.push(&of.condition),
            _ => {}
        }
        all
    }

    /// Calls `of` with all parts of the statement, including what it starts, but without the statements of its blocks.
    pub(super) fn each<'s>(&'s self, of: &mut impl FnMut(ExpressionPart<'s>)) {
        self.settings().iter().for_each(|setting| setting.to.each(of));
        self.expressions().into_iter().for_each(|part| part.each(of));
        match &self.kind {
            StatementKind::Call(call) => of(ExpressionPart::Call(call)),
            StatementKind::Trigger(started) | StatementKind::Interrupt(started) => {
                started.run.iter().for_each(|run| run.each(of));
            }
            _ => {}
        }
    }

    /// Its calls, including those in a statement that it starts.
    pub(super) fn calls(&self) -> Vec<&Call> {
        let mut calls = Vec::new();
        self.each(&mut |part| calls.extend(if let ExpressionPart::Call(call) = part { Some(call) } else { None }));
        calls
    }

    /// Names of data in it, including those in a statement that it starts.
    pub(super) fn names(&self) -> Vec<&Name> {
        let mut names = Vec::new();
        self.each(&mut |part| {
            names.extend(if let ExpressionPart::Path(path) = part { Some(&path.name) } else { None })
        });
        names
    }
}

/// Calls `each` with every statement of a block and of the blocks in it, in text order.
pub(super) fn walk<'a>(block: &'a [Statement], each: &mut impl FnMut(&'a Statement)) {
    for statement in block {
        each(statement);
        match &statement.kind {
            StatementKind::If(of) => {
                walk(&of.then, each);
                walk(&of.otherwise, each);
            }
            StatementKind::Loop(of) => walk(&of.body, each),
            _ => {}
        }
    }
}
