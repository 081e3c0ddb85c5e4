//! The syntax tree of a file, in spans.

use super::literal::Literal;
use crate::program::{Mark, Reason};
use crate::text::Span;

/// The modules of a file, and all complete robtarget literals in text order.
#[derive(Debug, Default)]
pub(super) struct File {
    pub(super) modules: Vec<Module>,
    pub(super) literals: Vec<Literal>,
    /// Statements that are not understood, with the reason.
    pub(super) odd: Vec<(Span, Reason)>,
    /// The last mark before the first routine: in force from the start.
    pub(super) mark: Option<Mark>,
    /// The file ends inside a module: its last lexeme.
    pub(super) cut: Option<Span>,
}

#[derive(Debug, Default)]
pub(super) struct Module {
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
#[derive(Clone, Debug)]
pub(super) struct Data {
    pub(super) storage: Storage,
    pub(super) local: bool,
    pub(super) kind: Span,
    pub(super) name: Span,
    pub(super) dims: Option<Span>,
    pub(super) value: Option<Span>,
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

#[derive(Debug)]
pub(super) enum Statement {
    /// A call or an assignment, up to and with its `;`.
    Simple(Span),
    If {
        arms: Vec<(Span, Vec<Statement>)>,
        otherwise: Vec<Statement>,
        at: Span,
    },
    For {
        variable: Span,
        from: Span,
        to: Span,
        step: Option<Span>,
        body: Vec<Statement>,
        at: Span,
    },
    While {
        condition: Span,
        body: Vec<Statement>,
        at: Span,
    },
    Test {
        subject: Span,
        cases: Vec<(Span, Vec<Statement>)>,
        otherwise: Vec<Statement>,
        at: Span,
    },
    /// With the value of the function; empty if there is none.
    Return(Span),
    Exit,
    /// To the error handler of this routine or of one that called it.
    Raise,
    /// In an error handler: run the failed statement again.
    Retry,
    /// In an error handler: go on after the failed statement.
    TryNext,
    /// `CONNECT interrupt WITH trap`, whole.
    Connect(Span),
    Goto(Span),
    Mark(Mark),
}

impl Statement {
    /// The span of the statement or of its first part, if recorded.
    pub(super) fn place(&self) -> Option<Span> {
        match self {
            Self::Simple(at) | Self::Connect(at) | Self::Goto(at) => Some(*at),
            Self::If { at, .. } | Self::For { at, .. } | Self::While { at, .. } | Self::Test { at, .. } => Some(*at),
            Self::Return(value) => (!value.is_empty()).then_some(*value),
            Self::Exit | Self::Raise | Self::Retry | Self::TryNext | Self::Mark(_) => None,
        }
    }
}

/// Whether a predicate is true of any statement in a block, its branches or its loops.
pub(super) fn any(block: &[Statement], is: &impl Fn(&Statement) -> bool) -> bool {
    block.iter().any(|statement| {
        is(statement)
            || match statement {
                Statement::If { arms, otherwise, .. } => {
                    arms.iter().any(|(_, block)| any(block, is)) || any(otherwise, is)
                }
                Statement::For { body, .. } | Statement::While { body, .. } => any(body, is),
                Statement::Test { cases, otherwise, .. } => {
                    cases.iter().any(|(_, block)| any(block, is)) || any(otherwise, is)
                }
                _ => false,
            }
    })
}

/// Calls and assignments of a block, and of the branches and loops in it, in text order.
pub(super) fn simple_statements(block: &[Statement]) -> Vec<Span> {
    let mut all = Vec::new();
    collect(block, &mut all);
    all
}

fn collect(block: &[Statement], all: &mut Vec<Span>) {
    for statement in block {
        match statement {
            Statement::Simple(span) => all.push(*span),
            Statement::If { arms, otherwise, .. } => {
                arms.iter().for_each(|(_, block)| collect(block, all));
                collect(otherwise, all);
            }
            Statement::For { body, .. } | Statement::While { body, .. } => collect(body, all),
            Statement::Test { cases, otherwise, .. } => {
                cases.iter().for_each(|(_, block)| collect(block, all));
                collect(otherwise, all);
            }
            _ => {}
        }
    }
}
