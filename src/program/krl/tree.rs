//! What a file is made of: spans, not texts.

use crate::program::{Mark, Reason};
use crate::text::Span;

/// One file: routines (`.src`), data (`.dat`), or both.
#[derive(Debug, Default)]
pub(super) struct File {
    /// The name after DEFDAT, or after the first DEF.
    pub(super) module: Span,
    pub(super) routines: Vec<Routine>,
    pub(super) data: Vec<Data>,
    /// Elements that a data list sets, in text order: `Points[1]={X 1,…}`.
    pub(super) values: Vec<Span>,
    /// Statements that are not understood, with the reason.
    pub(super) odd: Vec<(Span, Reason)>,
    /// The last mark before the first routine: in force from the start.
    pub(super) mark: Option<Mark>,
    /// Where the file ends within a routine or a block.
    pub(super) cut: Option<Span>,
}

/// `[GLOBAL] DEF name(params)` or `DEFFCT type name(params)`.
#[derive(Debug)]
pub(super) struct Routine {
    pub(super) name: Span,
    pub(super) is_function: bool,
    pub(super) is_global: bool,
    pub(super) params: Vec<Param>,
    pub(super) data: Vec<Data>,
    pub(super) body: Vec<Statement>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Param {
    pub(super) name: Span,
    /// `:OUT`, which is the caller's own variable, and what holds where nothing is said.
    pub(super) is_out: bool,
}

/// `[DECL] [GLOBAL] [CONST] type name[…] [= value]`
#[derive(Clone, Copy, Debug)]
pub(super) struct Data {
    pub(super) kind: Span,
    pub(super) name: Span,
    pub(super) is_global: bool,
    pub(super) is_constant: bool,
    pub(super) is_array: bool,
    pub(super) value: Option<Span>,
}

#[derive(Debug)]
pub(super) enum Statement {
    /// All that fits on its line.
    Simple(Span),
    If {
        condition: Span,
        then: Vec<Statement>,
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
    /// Left by its condition, by EXIT, or never.
    Loop {
        condition: Option<Condition>,
        body: Vec<Statement>,
        at: Span,
    },
    Switch {
        subject: Span,
        cases: Vec<(Span, Vec<Statement>)>,
        otherwise: Vec<Statement>,
        at: Span,
    },
    /// What WITH says holds for all of its segments.
    Spline {
        with: Span,
        body: Vec<Statement>,
    },
    Jump,
    /// Where a GOTO goes on.
    Label,
    Return(Span),
    Exit,
    Mark(Mark),
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Condition {
    pub(super) span: Span,
    /// REPEAT … UNTIL: the body runs before it is looked at, and again where it does not hold.
    pub(super) is_behind: bool,
}

/// Calls `each` with every statement of a block and of the blocks in it, in text order.
pub(super) fn walk<'a>(block: &'a [Statement], each: &mut impl FnMut(&'a Statement)) {
    for statement in block {
        each(statement);
        match statement {
            Statement::If { then, otherwise, .. } => {
                walk(then, each);
                walk(otherwise, each);
            }
            Statement::For { body, .. } | Statement::Loop { body, .. } | Statement::Spline { body, .. } => {
                walk(body, each);
            }
            Statement::Switch { cases, otherwise, .. } => {
                cases.iter().for_each(|(_, block)| walk(block, each));
                walk(otherwise, each);
            }
            _ => {}
        }
    }
}
