//! The syntax tree of a file.

use super::expression::{Arguments, Call, Expression};
use super::literal::Literal;
use crate::{Mark, Reason};
use deflex_text::Span;

/// The modules of a file, and all complete robtarget literals in text order.
#[derive(Debug, Default)]
pub(super) struct File {
    pub(super) modules: Vec<Module>,
    pub(super) literals: Vec<Literal>,
    /// Statements that are not understood, with the reason.
    pub(super) odd: Vec<(Span, Reason)>,
    /// The last mark before the first routine: in force from the start.
    pub(super) mark: Option<Mark>,
    /// Starts of the statements that are the body of a compact IF, in the order of the text.
    pub(super) after_compact_if: Vec<u32>,
    /// The file ends inside a module: its last lexeme.
    pub(super) cut: Option<Span>,
}

#[derive(Debug, Default)]
pub(super) struct Module {
    /// Its name; empty for routines and data without a module.
    pub(super) name: Span,
    pub(super) data: Vec<Data>,
    pub(super) records: Vec<Record>,
    pub(super) routines: Vec<Routine>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    Const,
    Pers,
    Var,
}

/// `[LOCAL|TASK] VAR|PERS|CONST type name[{…}] [:= value];`
#[derive(Debug)]
pub(super) struct Data {
    pub(super) storage: Storage,
    pub(super) local: bool,
    pub(super) kind: Span,
    pub(super) name: Span,
    pub(super) is_array: bool,
    pub(super) value: Option<Expression>,
    pub(super) statement: Span,
}

#[derive(Debug)]
pub(super) struct Record {
    pub(super) name: Span,
    /// Type and name of each component.
    pub(super) fields: Vec<(Span, Span)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RoutineKind {
    Proc,
    Func,
    Trap,
}

#[derive(Debug)]
pub(super) struct Routine {
    pub(super) kind: RoutineKind,
    pub(super) local: bool,
    pub(super) name: Span,
    /// From the name to the end.
    pub(super) text: Span,
    pub(super) params: Vec<Param>,
    pub(super) data: Vec<Data>,
    pub(super) body: Vec<Statement>,
    /// ERROR, UNDO and BACKWARD parts, which do not run without a fault.
    pub(super) handlers: Vec<Statement>,
    /// The range of its ERROR part; if there is one, an error goes to the caller only by RAISE.
    pub(super) error: Option<std::ops::Range<usize>>,
}

impl Routine {
    /// The statements of its ERROR part.
    pub(super) fn on_error(&self) -> &[Statement] {
        self.error.clone().and_then(|part| self.handlers.get(part)).unwrap_or_default()
    }

    /// UNDO and BACKWARD parts.
    pub(super) fn other_handlers(&self) -> [&[Statement]; 2] {
        let Some(part) = self.error.clone() else { return [&self.handlers, &[]] };
        [self.handlers.get(..part.start), self.handlers.get(part.end..)].map(Option::unwrap_or_default)
    }
}

#[derive(Debug)]
pub(super) struct Param {
    pub(super) kind: Span,
    pub(super) name: Span,
    /// VAR, PERS or INOUT: the caller's own variable.
    pub(super) by_reference: bool,
    pub(super) optional: bool,
}

/// A statement and its place, up to and with its `;`; of a branch or loop, the place of its first part.
#[derive(Debug)]
pub(super) struct Statement {
    pub(super) kind: StatementKind,
    pub(super) at: Span,
}

#[derive(Debug)]
pub(super) enum StatementKind {
    Assign(Box<Assignment>),
    Call(Box<Call>),
    If(Box<If>),
    For(Box<For>),
    While(Box<While>),
    Test(Box<Test>),
    /// With the value of the function.
    Return(Option<Box<Expression>>),
    Exit,
    /// To the error handler of this routine or of one that called it.
    Raise,
    /// In an error handler: run the failed statement again.
    Retry,
    /// In an error handler: go on after the failed statement.
    TryNext,
    Connect(Box<Connect>),
    /// With the name of the label, in upper case.
    Goto(Box<[u8]>),
    /// With its name, in upper case.
    Label(Box<[u8]>),
    Mark(Mark),
}

/// `to := value`
#[derive(Debug)]
pub(super) struct Assignment {
    pub(super) to: Expression,
    pub(super) value: Expression,
}

#[derive(Debug)]
pub(super) struct If {
    pub(super) arms: Vec<Arm>,
    pub(super) otherwise: Vec<Statement>,
}

/// A condition, and the statements that run if it is true.
#[derive(Debug)]
pub(super) struct Arm {
    pub(super) condition: Expression,
    pub(super) body: Vec<Statement>,
}

#[derive(Debug)]
pub(super) struct For {
    pub(super) variable: Span,
    pub(super) from: Expression,
    pub(super) to: Expression,
    pub(super) step: Option<Expression>,
    pub(super) body: Vec<Statement>,
}

#[derive(Debug)]
pub(super) struct While {
    pub(super) condition: Expression,
    pub(super) body: Vec<Statement>,
}

#[derive(Debug)]
pub(super) struct Test {
    pub(super) subject: Expression,
    pub(super) cases: Vec<Case>,
    pub(super) otherwise: Vec<Statement>,
}

/// The values of a CASE, and the statements that run for them.
#[derive(Debug)]
pub(super) struct Case {
    pub(super) values: Arguments,
    pub(super) body: Vec<Statement>,
}

/// `CONNECT interrupt WITH trap`
#[derive(Debug)]
pub(super) struct Connect {
    pub(super) interrupt: Expression,
    /// The name of the trap.
    pub(super) trap: Span,
}

impl Statement {
    /// The call that it is.
    pub(super) fn call(&self) -> Option<&Call> {
        if let StatementKind::Call(call) = &self.kind { Some(call) } else { None }
    }

    /// The blocks in it.
    pub(super) fn blocks(&self) -> Vec<&[Self]> {
        match &self.kind {
            StatementKind::If(of) => of.arms.iter().map(|arm| &arm.body[..]).chain([&of.otherwise[..]]).collect(),
            StatementKind::For(of) => vec![&of.body],
            StatementKind::While(of) => vec![&of.body],
            StatementKind::Test(of) => of.cases.iter().map(|case| &case.body[..]).chain([&of.otherwise[..]]).collect(),
            _ => Vec::new(),
        }
    }

    /// Calls `of` with all of its expressions, and with everything in them, but for those of the blocks in it.
    pub(super) fn each<'e, F: FnMut(&'e Expression)>(&'e self, of: &mut F) {
        match &self.kind {
            StatementKind::Assign(assignment) => {
                assignment.to.each(of);
                assignment.value.each(of);
            }
            StatementKind::Call(call) => call.each(of),
            StatementKind::If(branch) => branch.arms.iter().for_each(|arm| arm.condition.each(of)),
            StatementKind::For(round) => {
                [&round.from, &round.to].into_iter().chain(&round.step).for_each(|bound| bound.each(of));
            }
            StatementKind::While(round) => round.condition.each(of),
            StatementKind::Test(branch) => {
                branch.subject.each(of);
                branch.cases.iter().flat_map(|case| case.values.given()).for_each(|value| value.each(of));
            }
            StatementKind::Return(value) => value.iter().for_each(|value| value.each(of)),
            StatementKind::Connect(connect) => connect.interrupt.each(of),
            StatementKind::Exit
            | StatementKind::Raise
            | StatementKind::Retry
            | StatementKind::TryNext
            | StatementKind::Goto(_)
            | StatementKind::Label(_)
            | StatementKind::Mark(_) => {}
        }
    }
}

/// The statements of a block, and of the branches and loops in it, in text order.
pub(super) fn statements(block: &[Statement]) -> Vec<&Statement> {
    fn add<'s>(block: &'s [Statement], all: &mut Vec<&'s Statement>) {
        for statement in block {
            all.push(statement);
            statement.blocks().into_iter().for_each(|block| add(block, all));
        }
    }
    let mut all = Vec::new();
    add(block, &mut all);
    all
}

/// Whether a block has such a statement, in its branches and loops too.
pub(super) fn any(block: &[Statement], is: &impl Fn(&StatementKind) -> bool) -> bool {
    block.iter().any(|statement| is(&statement.kind) || statement.blocks().into_iter().any(|block| any(block, is)))
}
