//! The intermediate representation to which every front end lowers its programs.

use crate::Span;
use crate::reason::Reason;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A program: its functions, and those with which a run begins.
///
/// # Examples
/// ```
/// let text = b"def part():\n  movel(p[0.5, 0.1, 0.2, 0, 3.14, 0], v=0.025)\nend\n";
/// let program = deflex_lang::urscript::read(&[text], 1).unwrap();
/// assert!(program.not_understood.is_empty() && program.foreign.is_empty());
/// assert!(program.functions.iter().any(|function| &*function.name == "part"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Program {
    /// All functions of all sources.
    pub functions: Vec<Function>,
    /// The functions that a run begins with, one after the other. Where there are several, each may run by itself.
    pub entries: Vec<FunctionId>,
    /// The statements of [`Self::functions`] that stand in no routine say what variables hold when any entry begins, whatever ran before it.
    pub variables_outlive_runs: bool,
    /// Number literals of the text.
    pub tokens: Vec<Token>,
    /// Names of the global variables, those of [`Switch`] first.
    pub globals: Vec<Arc<str>>,
    /// Globals that something outside the program may change at any moment, with the reason.
    pub volatile: Vec<(Slot, Reason)>,
    /// Functions that run at the same time as the rest, from some moment on.
    pub threads: Vec<FunctionId>,
    /// Statements that no front end rule covers.
    pub not_understood: Vec<SourceSpan>,
    /// Names of called routines that no source has and the language does not define, each at its first call.
    pub foreign: Vec<(Arc<str>, SourceSpan)>,
}

/// Where something stands.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// let place = program.tokens[0]; // the first number of the text
/// assert_eq!((place.source, &text[place.span.range()]), (0, &b"0.5"[..]));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceSpan {
    /// Index of the source.
    pub source: u16,
    /// Its bytes.
    pub span: Span,
}

/// A number literal: index into [`Program::tokens`].
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// let x = outcome.motions[0].to.pose().unwrap().affine(0).unwrap();
/// assert_eq!(&text[program.tokens[x.token.0 as usize].span.range()], b"0.5");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TokenId(pub u32);

/// A number literal in the text; its sign belongs to it.
pub type Token = SourceSpan;

/// Index into [`Program::functions`].
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// for function in &program.entries {
///     println!("a run begins with `{}`", program.functions[function.0 as usize].name);
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FunctionId(pub u32);

/// A variable.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// use deflex_lang::ir::Slot;
///
/// /// The name of a global variable.
/// let name = |slot: Slot| match slot {
///     Slot::Global(index) => program.globals.get(index as usize).cloned(),
///     Slot::Local(_) => None,
/// };
/// assert_eq!(name(Slot::Local(0)), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Slot {
    /// Index into [`Program::globals`].
    Global(u32),
    /// Index into the variables of the function that runs.
    Local(u32),
}

/// Settings of the controller that are not variables of the program. They are the first globals of each program.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// use deflex_lang::ir::Switch;
///
/// let tool = &outcome.motions[0].switches[Switch::Tool as usize];
/// assert!(tool.pose().is_none()); // the program does not set the tool
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switch {
    /// Pose of the tool in the flange.
    Tool,
    /// Mass that the arm carries, and its centre of gravity.
    Load,
    /// The frame in which positions are counted.
    Frame,
    /// The shift of all positions; known while none is active.
    Shift,
    /// The `deflex` mark in force.
    Mark,
}

impl Switch {
    /// All of them, in the order of their globals.
    pub(crate) const ALL: [Self; 5] = [Self::Tool, Self::Load, Self::Frame, Self::Shift, Self::Mark];

    /// Its variable.
    #[must_use]
    pub(crate) const fn slot(self) -> Slot {
        Slot::Global(self as u32)
    }
}

/// A routine.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// let part = program.functions.iter().find(|function| &*function.name == "part").unwrap();
/// assert_eq!((part.parameters.len(), part.body.len()), (0, 1));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Function {
    /// The name as it is written; empty for the statements of a file that are in no routine.
    pub name: Arc<str>,
    /// Its parameters, which are its first local variables, with their default values.
    pub parameters: Vec<Parameter>,
    /// Number of its local variables.
    pub locals: u32,
    /// Its statements.
    pub body: Vec<Statement>,
    /// The place of its beginning.
    pub place: SourceSpan,
}

/// A parameter of a routine.
///
/// # Examples
/// ```
/// let text = b"def part():\n  def lift(height, fast=False):\n    movel(p[0.5, 0.1, height, 0, 3.14, 0])\n  end\n  lift(0.2)\nend\n";
/// let program = deflex_lang::urscript::read(&[text], 1).unwrap();
/// let lift = program.functions.iter().find(|function| &*function.name == "lift").unwrap();
/// assert_eq!(&*lift.parameters[0].name, "height");
/// assert!(lift.parameters[0].default.is_none() && lift.parameters[1].default.is_some());
/// ```
#[derive(Clone, Debug)]
pub struct Parameter {
    /// As it is written.
    pub name: Arc<str>,
    /// Its value if a call does not give the argument.
    pub default: Option<Expression>,
}

/// A statement with its place in the text.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// # let part = program.functions.iter().find(|function| &*function.name == "part").unwrap();
/// let mut statements = 0;
/// part.body[0].each(&mut |_| statements += 1);
/// assert_eq!((statements, part.body[0].expressions().len()), (1, 3)); // target, acceleration, speed
/// ```
#[derive(Clone, Debug)]
pub struct Statement {
    /// What it does.
    pub kind: StatementKind,
    /// Where it stands.
    pub place: SourceSpan,
}

/// What a statement does.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// # let part = program.functions.iter().find(|function| &*function.name == "part").unwrap();
/// use deflex_lang::ir::StatementKind;
///
/// assert!(matches!(part.body[0].kind, StatementKind::Move(_)));
/// ```
#[derive(Clone, Debug)]
pub enum StatementKind {
    /// Assigns a value to a variable or to an item of one.
    Assign {
        /// The variable.
        slot: Slot,
        /// Indices into it, outermost first; empty for the whole of it.
        path: Vec<Expression>,
        /// The value that is assigned.
        value: Expression,
    },
    /// Evaluates an expression whose value is not used: a call.
    Evaluate(Expression),
    /// The arm moves.
    Move(Box<Motion>),
    /// Runs the first arm whose condition is true.
    If {
        /// Conditions and what runs under each.
        arms: Vec<(Expression, Vec<Statement>)>,
        /// The statements that run if no condition is true.
        otherwise: Vec<Statement>,
    },
    /// Repeats its body while the condition is true; without a condition until it is left.
    Loop {
        /// Evaluated before each round.
        condition: Option<Expression>,
        /// A round.
        body: Vec<Statement>,
    },
    /// Leaves the innermost loop.
    Break,
    /// Continues with the next round of the innermost loop.
    Continue,
    /// A place to jump to, in the same routine.
    Label(Arc<str>),
    /// Continues at a label if the condition is true.
    Jump {
        /// The label.
        to: Arc<str>,
        /// The condition; without one it always jumps.
        condition: Option<Expression>,
    },
    /// Leaves the routine.
    Return(Option<Expression>),
    /// Ends the program.
    Halt,
    /// A statement that is not understood, and that may change these variables or every global.
    Opaque {
        /// `None`: every global.
        writes: Option<Vec<Slot>>,
        /// The expressions that it may use.
        reads: Vec<Expression>,
        /// The reason that is reported.
        reason: Reason,
    },
}

/// The kind of path to a point.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// use deflex_lang::ir::Path;
///
/// assert_eq!(outcome.motions[0].path, Path::Linear);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// On a line.
    Linear,
    /// With all axes evenly (a joint motion).
    Joint,
    /// On a circle.
    Circular,
    /// On a circle, with the tool at a fixed orientation relative to its tangent.
    Tangent,
    /// A path that only the controller knows, to a known point.
    Other(Reason),
    /// A motion to a point that the text does not state.
    Unknown(Reason),
}

/// A motion: one statement with one end.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// # let part = program.functions.iter().find(|function| &*function.name == "part").unwrap();
/// use deflex_lang::ir::{Motion, Path, StatementKind};
///
/// let StatementKind::Move(motion) = &part.body[0].kind else { panic!("a motion") };
/// let Motion { path, via, speed, .. } = &**motion;
/// assert!(*path == Path::Linear && via.is_none() && speed.is_some());
/// ```
#[derive(Clone, Debug)]
pub struct Motion {
    /// The kind of its path.
    pub path: Path,
    /// The circle point, for a circle.
    pub via: Option<Expression>,
    /// The target.
    pub to: Option<Expression>,
    /// Speed, in the language's unit.
    pub speed: Option<Expression>,
    /// Distance from the end at which the path is left, in the language's unit.
    pub blend: Option<Expression>,
    /// Other arguments, which do not change where it goes.
    pub others: Vec<Expression>,
}

/// An expression with its place in the text.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// # let part = program.functions.iter().find(|function| &*function.name == "part").unwrap();
/// use deflex_lang::ir::ExpressionKind;
///
/// let mut numbers = 0;
/// let target = part.body[0].expressions()[0];
/// target.each(&mut |part| numbers += usize::from(matches!(part.kind, ExpressionKind::Number(..))));
/// assert_eq!(numbers, 6);
/// ```
#[derive(Clone, Debug)]
pub struct Expression {
    /// Its kind, with its parts.
    pub kind: ExpressionKind,
    /// Its place in the text.
    pub place: SourceSpan,
}

/// What an expression is.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// # let part = program.functions.iter().find(|function| &*function.name == "part").unwrap();
/// use deflex_lang::ir::ExpressionKind;
///
/// let target = part.body[0].expressions()[0];
/// assert!(matches!(&target.kind, ExpressionKind::Pose(numbers, None) if numbers.len() == 6));
/// ```
#[derive(Clone, Debug)]
pub enum ExpressionKind {
    /// A number literal with its sign.
    Number(f64, TokenId),
    /// A number without a token of its own.
    Constant(f64),
    /// A truth value.
    Truth(bool),
    /// A text.
    Text(Arc<[u8]>),
    /// The value of a variable.
    Read(Slot),
    /// An item of a list or of a pose.
    Item(Box<[Expression; 2]>),
    /// A list.
    List(Vec<Expression>),
    /// A pose, by the numbers with which the dialect writes it, and its names of tool and frame.
    Pose(Vec<Expression>, Option<Arc<Given>>),
    /// A unary operator with its operand.
    Unary(Unary, Box<Expression>),
    /// A binary operator with its operands.
    Binary(Binary, Box<[Expression; 2]>),
    /// A call with its arguments, in order or by name.
    Call(Callee, Vec<Argument>),
    /// A value that is known only at run time, with the expressions that it may use.
    Unknown(Reason, Vec<Expression>),
}

/// The callee of a call.
///
/// # Examples
/// ```
/// use deflex_lang::ir::{Callee, ExpressionKind};
///
/// let text = b"def part():\n  textmsg(\"start\")\nend\n";
/// let program = deflex_lang::urscript::read(&[text], 1).unwrap();
/// let part = program.functions.iter().find(|function| &*function.name == "part").unwrap();
/// assert!(matches!(part.body[0].expressions()[0].kind, ExpressionKind::Call(Callee::Builtin(_), _)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Callee {
    /// A routine of the program.
    Function(FunctionId),
    /// A routine of the language itself, by the dialect's number.
    Builtin(u16),
    /// A routine that is not given.
    Foreign,
}

/// An argument of a call.
///
/// # Examples
/// ```
/// use deflex_lang::ir::{Argument, ExpressionKind};
///
/// let text = b"def part():\n  textmsg(\"start\")\nend\n";
/// let program = deflex_lang::urscript::read(&[text], 1).unwrap();
/// let part = program.functions.iter().find(|function| &*function.name == "part").unwrap();
/// let ExpressionKind::Call(_, arguments) = &part.body[0].expressions()[0].kind else { panic!("a call") };
/// let Argument { name, value } = &arguments[0];
/// assert!(name.is_none() && matches!(value.kind, ExpressionKind::Text(_)));
/// ```
#[derive(Clone, Debug)]
pub struct Argument {
    /// The name of the parameter; `None` for an argument by position.
    pub name: Option<Arc<str>>,
    /// Its value.
    pub value: Expression,
}

impl From<Expression> for Argument {
    /// An argument without a name.
    fn from(value: Expression) -> Self {
        Self { name: None, value }
    }
}

/// The tool and the frame that a position names, in languages in which each position has its own.
///
/// # Examples
/// ```
/// use deflex_lang::ir::Given;
///
/// let given = Given { tool: "1".into(), frame: "2".into() };
/// assert_eq!(&*given.tool, "1");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Given {
    /// Name of the tool.
    pub tool: Arc<str>,
    /// Name of the frame.
    pub frame: Arc<str>,
}

/// Operators of one operand.
///
/// # Examples
/// ```
/// use deflex_lang::ir::Unary;
///
/// /// How URScript writes an operator.
/// fn written(operator: Unary) -> &'static str {
///     match operator {
///         Unary::Negate => "-",
///         Unary::Not => "not ",
///     }
/// }
/// assert_eq!(written(Unary::Negate), "-");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unary {
    /// `-`
    Negate,
    /// `not`
    Not,
}

/// Operators of two operands.
///
/// # Examples
/// ```
/// use deflex_lang::{ir::Binary, run::binary, value::{Content, Number, Value}};
///
/// let number = |value| Value::from(Content::Number(Number { value, exact: true, affine: None }));
/// assert_eq!(binary(Binary::Subtract, &number(2.0), &number(3.0)).number(), Some(-1.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binary {
    /// `+`
    Add,
    /// `-`
    Subtract,
    /// `*`
    Multiply,
    /// `/`
    Divide,
    /// The whole part of a quotient.
    Quotient,
    /// Remainder.
    Remainder,
    /// `==`
    Equal,
    /// `!=`
    NotEqual,
    /// `<`
    Less,
    /// `<=`
    AtMost,
    /// `>`
    Greater,
    /// `>=`
    AtLeast,
    /// `and`
    And,
    /// `or`
    Or,
    /// Either and not both.
    Xor,
}

impl Program {
    /// The expression of a number literal with its sign. If the value is not finite, it is unknown for this reason.
    pub(crate) fn literal(&mut self, digits: &[u8], place: SourceSpan, unreadable: Reason) -> Expression {
        let value = std::str::from_utf8(digits).ok().and_then(|digits| digits.parse::<f64>().ok());
        let Some(value) = value.filter(|value| value.is_finite()) else {
            return Expression::unknown(unreadable, Vec::new(), place);
        };
        let id = TokenId(self.tokens.len() as u32);
        self.tokens.push(place);
        Expression { kind: ExpressionKind::Number(value, id), place }
    }

    /// The routines that are started by themselves or by an operator, of `candidates`, given those that are called: a routine that no other one
    /// calls, and the first one of several that only call each other.
    pub(crate) fn started(&self, candidates: &[FunctionId], called: &BTreeSet<FunctionId>) -> Vec<FunctionId> {
        let uncalled = candidates.iter().copied().filter(|id| !called.contains(id));
        let mut started: Vec<FunctionId> = uncalled.collect();
        let mut reached: BTreeSet<FunctionId> = started.iter().flat_map(|id| self.reached_from(*id)).collect();
        // The first function has the statements outside of all routines.
        reached.extend(self.reached_from(FunctionId(0)));
        for &id in candidates {
            let calls = self.reached_from(id);
            if calls.contains(&id) && !reached.contains(&id) {
                started.push(id);
                reached.extend(calls);
            }
        }
        started
    }

    /// The routines that a routine calls, and those that they call.
    pub(crate) fn reached_from(&self, from: FunctionId) -> BTreeSet<FunctionId> {
        let (mut reached, mut work) = (BTreeSet::new(), vec![from]);
        while let Some(id) = work.pop() {
            let mut expression = |expression: &Expression| {
                if let ExpressionKind::Call(Callee::Function(id), _) = expression.kind
                    && reached.insert(id)
                {
                    work.push(id);
                }
            };
            self.functions[id.0 as usize].each_expression(&mut expression);
        }
        reached
    }

    /// The literals on which each variable may depend after a run, given the values of some variables before it.
    pub(crate) fn left<'a>(
        &self,
        before: impl Iterator<Item = (Slot, &'a Expression)>,
    ) -> BTreeMap<Slot, BTreeSet<TokenId>> {
        let mut tokens: BTreeMap<Slot, BTreeSet<TokenId>> = BTreeMap::new();
        let mut from: BTreeMap<Slot, BTreeSet<Slot>> = BTreeMap::new();
        let mut flows = |slot: Slot, of: &Expression| {
            of.each(&mut |part| match part.kind {
                ExpressionKind::Number(_, token) => drop(tokens.entry(slot).or_default().insert(token)),
                ExpressionKind::Read(other) => drop(from.entry(slot).or_default().insert(other)),
                _ => {}
            });
        };
        before.for_each(|(slot, value)| flows(slot, value));
        for statement in self.functions.iter().flat_map(|function| &function.body) {
            statement.each(&mut |statement| {
                let slots: &[Slot] = match &statement.kind {
                    StatementKind::Assign { slot, .. } => std::slice::from_ref(slot),
                    StatementKind::Opaque { writes: Some(slots), .. } => slots,
                    _ => &[],
                };
                for slot in slots {
                    statement.expressions().into_iter().for_each(|part| flows(*slot, part));
                }
            });
        }
        loop {
            let mut changed = false;
            for (slot, others) in &from {
                let more: Vec<TokenId> =
                    others.iter().filter_map(|other| tokens.get(other)).flatten().copied().collect();
                let own = tokens.entry(*slot).or_default();
                let count = own.len();
                own.extend(more);
                changed |= own.len() > count;
            }
            if !changed {
                return tokens;
            }
        }
    }
}

impl StatementKind {
    /// An assignment to a whole variable.
    pub(crate) fn assign(slot: Slot, value: Expression) -> Self {
        Self::Assign { slot, path: Vec::new(), value }
    }
}

impl Expression {
    /// An expression that is known only at run time, with the expressions that it may use.
    pub(crate) fn unknown(reason: Reason, reads: Vec<Self>, place: SourceSpan) -> Self {
        Self { kind: ExpressionKind::Unknown(reason, reads), place }
    }

    /// A call of a routine of the language itself, by the dialect's number, with arguments without names.
    pub(crate) fn builtin(number: u16, arguments: Vec<Self>, place: SourceSpan) -> Self {
        let arguments = arguments.into_iter().map(Argument::from).collect();
        Self { kind: ExpressionKind::Call(Callee::Builtin(number), arguments), place }
    }

    /// A number without a token.
    pub(crate) fn constant(value: f64) -> Self {
        Self { kind: ExpressionKind::Constant(value), place: SourceSpan::default() }
    }

    /// This expression and a number without a token, joined by an operator.
    pub(crate) fn with(self, operator: Binary, value: f64) -> Self {
        let place = self.place;
        Self { kind: ExpressionKind::Binary(operator, Box::new([self, Self::constant(value)])), place }
    }

    /// Calls `of` with this expression and all its parts.
    pub fn each<'a>(&'a self, of: &mut impl FnMut(&'a Self)) {
        of(self);
        match &self.kind {
            ExpressionKind::Item(two) | ExpressionKind::Binary(_, two) => two.iter().for_each(|e| e.each(of)),
            ExpressionKind::List(all) | ExpressionKind::Pose(all, _) | ExpressionKind::Unknown(_, all) => {
                all.iter().for_each(|e| e.each(of));
            }
            ExpressionKind::Unary(_, one) => one.each(of),
            ExpressionKind::Call(_, arguments) => arguments.iter().for_each(|a| a.value.each(of)),
            ExpressionKind::Number(..)
            | ExpressionKind::Constant(_)
            | ExpressionKind::Truth(_)
            | ExpressionKind::Text(_)
            | ExpressionKind::Read(_) => {}
        }
    }
}

impl Function {
    /// Calls `of` with every expression of its statements and default values, and with all their parts.
    pub(crate) fn each_expression<'a>(&'a self, of: &mut impl FnMut(&'a Expression)) {
        let defaults = self.parameters.iter().filter_map(|parameter| parameter.default.as_ref());
        defaults.for_each(|default| default.each(of));
        for statement in &self.body {
            statement.each(&mut |statement| statement.expressions().into_iter().for_each(|part| part.each(of)));
        }
    }
}

impl Statement {
    /// Calls `of` with this statement and all nested statements.
    pub fn each<'a>(&'a self, of: &mut impl FnMut(&'a Self)) {
        of(self);
        match &self.kind {
            StatementKind::If { arms, otherwise } => {
                arms.iter().flat_map(|(_, body)| body).chain(otherwise).for_each(|s| s.each(of));
            }
            StatementKind::Loop { body, .. } => body.iter().for_each(|s| s.each(of)),
            _ => {}
        }
    }

    /// The expressions of this statement, without those of nested statements.
    #[must_use]
    pub fn expressions(&self) -> Vec<&Expression> {
        match &self.kind {
            StatementKind::Assign { path, value, .. } => path.iter().chain([value]).collect(),
            StatementKind::Evaluate(value) => vec![value],
            StatementKind::Move(motion) => {
                let parts = [&motion.via, &motion.to, &motion.speed, &motion.blend];
                parts.into_iter().flatten().chain(&motion.others).collect()
            }
            StatementKind::If { arms, .. } => arms.iter().map(|(condition, _)| condition).collect(),
            StatementKind::Loop { condition, .. } | StatementKind::Jump { condition, .. } => condition.iter().collect(),
            StatementKind::Return(value) => value.iter().collect(),
            StatementKind::Opaque { reads, .. } => reads.iter().collect(),
            StatementKind::Break | StatementKind::Continue | StatementKind::Label(_) | StatementKind::Halt => {
                Vec::new()
            }
        }
    }
}

/// Why a text cannot be read at all.
///
/// # Examples
/// ```
/// let fault = deflex_lang::urscript::read(&[b"def part():\n"], 1).err().unwrap();
/// println!("source {}, bytes {:?}: {}", fault.place.source, fault.place.span.range(), fault.message);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The place at which reading ended.
    pub place: SourceSpan,
    /// What was expected.
    pub message: &'static str,
}
