//! Expressions and calls. Each is read once, into a tree with the places of its names and numbers.

use crate::Reason;
use deflex_lang::ir::Binary;
use deflex_text::Span;

/// An expression and its place in its file.
#[derive(Debug)]
pub(super) struct Expression {
    pub(super) kind: ExpressionKind,
    pub(super) span: Span,
}

#[derive(Debug)]
pub(super) enum ExpressionKind {
    /// A number, with its sign; `None` if its value cannot be represented.
    Number(Option<f64>),
    /// A text, with its quotation marks.
    Text,
    /// A complete robtarget: its index among those of the file.
    Literal(u32),
    /// The name of a variable, or of a value that RAPID predefines.
    Name,
    /// `[…, …]`
    Aggregate(Box<[Expression]>),
    /// A part of a variable, or of the result of a function.
    Part(Box<Part>),
    Call(Box<Call>),
    /// `(…)`, or an expression after a plus sign.
    Bracketed(Box<Expression>),
    Negated(Box<Expression>),
    Not(Box<Expression>),
    Chain(Box<Chain>),
    /// It is not understood: the reason, and the expressions in it.
    Unknown(Reason, Box<[Expression]>),
}

/// `of{…}.…`
#[derive(Debug)]
pub(super) struct Part {
    pub(super) of: Expression,
    /// One or more.
    pub(super) steps: Box<[PartStep]>,
}

#[derive(Debug)]
pub(super) enum PartStep {
    /// `{…, …}`
    Index(Box<[Expression]>),
    /// `.name`, with the place of the name.
    Component(Span),
}

/// Operands with operators of one level, which are applied from left to right. A tree of pairs would be as deep as the text is long.
#[derive(Debug)]
pub(super) struct Chain {
    pub(super) first: Expression,
    /// One or more.
    pub(super) operations: Box<[Operation]>,
}

#[derive(Debug)]
pub(super) struct Operation {
    pub(super) operator: Binary,
    pub(super) right: Expression,
}

/// A call of a routine, an instruction or a function.
#[derive(Debug)]
pub(super) struct Call {
    /// Its name, or the place of the expression in `late`.
    pub(super) name: Span,
    /// `%…%`: the expression whose value is the name.
    pub(super) late: Option<Box<Expression>>,
    pub(super) arguments: Arguments,
}

impl Call {
    /// The beginning and the end of the name of a procedure that is chosen at run time (`%"part"+NumToStr(n,0)+"a"%`, `CallByVar "part",n`), as far
    /// as the text has them; `None` if it has no beginning.
    pub(super) fn known_ends<'b>(&self, bytes: &'b [u8]) -> Option<[&'b [u8]; 2]> {
        let ends = match &self.late {
            Some(name) => {
                let ExpressionKind::Chain(chain) = &name.kind else { return None };
                let last =
                    chain.operations.last().filter(|_| chain.operations.iter().all(|o| o.operator == Binary::Add));
                [chain.first.text_literal(bytes)?, last?.right.text_literal(bytes).unwrap_or_default()]
            }
            None => {
                let is_by_number = bytes[self.name.range()].eq_ignore_ascii_case(b"CallByVar");
                [self.arguments.positional.first().filter(|_| is_by_number)?.text_literal(bytes)?, b""]
            }
        };
        // An escaped character is not itself.
        let is_plain = |text: &[u8]| !text.iter().any(|b| matches!(b, b'"' | b'\\'));
        (!ends[0].is_empty() && ends.into_iter().all(is_plain)).then_some(ends)
    }
}

#[derive(Debug, Default)]
pub(super) struct Arguments {
    pub(super) positional: Box<[Expression]>,
    pub(super) optional: Box<[OptionalArgument]>,
    /// Whether there is more text that is not understood.
    pub(super) is_cut: bool,
}

/// `\Name` or `\Name := value`
#[derive(Debug)]
pub(super) struct OptionalArgument {
    pub(super) name: Span,
    pub(super) value: Option<Expression>,
}

/// The level of precedence of an operator; operators of a higher level bind tighter. ABB, *RAPID overview*, "Priority between operators".
pub(super) fn level(operator: Binary) -> u8 {
    match operator {
        Binary::Or | Binary::Xor => 0,
        Binary::And => 1,
        Binary::Equal | Binary::NotEqual | Binary::Less | Binary::Greater | Binary::AtMost | Binary::AtLeast => NOT + 1,
        Binary::Add | Binary::Subtract => NOT + 2,
        Binary::Multiply | Binary::Divide | Binary::Quotient | Binary::Remainder => NOT + 3,
    }
}

/// The level of `NOT`.
pub(super) const NOT: u8 = 2;

impl Expression {
    /// Calls `of` with the expression and with everything in it, in the order of the text.
    pub(super) fn each<'e, F: FnMut(&'e Self)>(&'e self, of: &mut F) {
        of(self);
        match &self.kind {
            ExpressionKind::Number(_) | ExpressionKind::Text | ExpressionKind::Literal(_) | ExpressionKind::Name => {}
            ExpressionKind::Aggregate(parts) | ExpressionKind::Unknown(_, parts) => {
                parts.iter().for_each(|part| part.each(of));
            }
            ExpressionKind::Part(part) => {
                part.of.each(of);
                part.steps.iter().flat_map(PartStep::indices).for_each(|index| index.each(of));
            }
            ExpressionKind::Call(call) => call.each(of),
            ExpressionKind::Bracketed(inner) | ExpressionKind::Negated(inner) | ExpressionKind::Not(inner) => {
                inner.each(of);
            }
            ExpressionKind::Chain(chain) => {
                chain.first.each(of);
                chain.operations.iter().for_each(|operation| operation.right.each(of));
            }
        }
    }

    /// Whether it is only a name.
    pub(super) fn is_name(&self) -> bool {
        matches!(self.kind, ExpressionKind::Name)
    }

    /// The places of all names in it.
    pub(super) fn names(&self) -> Vec<Span> {
        let mut names = Vec::new();
        self.each(&mut |part: &Self| names.extend(part.is_name().then_some(part.span)));
        names
    }

    /// The name of the variable that it is, or of which it is a part: something that a called routine can change.
    pub(super) fn variable(&self) -> Option<Span> {
        match &self.kind {
            ExpressionKind::Name => Some(self.span),
            ExpressionKind::Part(part) => part.of.is_name().then_some(part.of.span),
            _ => None,
        }
    }

    /// Whether its value needs no computation: names, numbers and aggregates of them.
    pub(super) fn is_plain(&self) -> bool {
        match &self.kind {
            ExpressionKind::Number(_) | ExpressionKind::Text | ExpressionKind::Literal(_) | ExpressionKind::Name => {
                true
            }
            ExpressionKind::Aggregate(parts) => parts.iter().all(Self::is_plain),
            _ => false,
        }
    }
}

impl PartStep {
    fn indices(&self) -> &[Expression] {
        match self {
            Self::Index(all) => all,
            Self::Component(_) => &[],
        }
    }
}

impl Call {
    /// Calls `of` with everything in the name and in the arguments.
    pub(super) fn each<'e, F: FnMut(&'e Expression)>(&'e self, of: &mut F) {
        self.late.iter().for_each(|name| name.each(of));
        self.arguments.given().for_each(|argument| argument.each(of));
    }
}

impl Arguments {
    /// The values of all arguments, by position or by name.
    pub(super) fn given(&self) -> impl Iterator<Item = &Expression> {
        self.positional.iter().chain(self.optional_values())
    }

    /// The values of the arguments by name.
    pub(super) fn optional_values(&self) -> impl Iterator<Item = &Expression> {
        self.optional.iter().filter_map(|argument| argument.value.as_ref())
    }

    fn optional<'e>(&'e self, bytes: &[u8], name: &[u8]) -> Option<&'e OptionalArgument> {
        self.optional.iter().find(|argument| bytes[argument.name.range()].eq_ignore_ascii_case(name))
    }

    /// Whether an optional argument of this name is given.
    pub(super) fn has(&self, bytes: &[u8], name: &[u8]) -> bool {
        self.optional(bytes, name).is_some()
    }

    /// The value of the optional argument of this name, if both are given.
    pub(super) fn named<'e>(&'e self, bytes: &[u8], name: &[u8]) -> Option<&'e Expression> {
        self.optional(bytes, name)?.value.as_ref()
    }
}
