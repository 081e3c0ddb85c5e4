//! The steps of routines. `deflex_lang` finds which of them run.

use super::expression::Expression;
use super::known::RoutineId;
use super::symbols::{Symbols, Upper};
use super::tree::{self, For, Statement, StatementKind, While, any};
use deflex_lang::flow::{Builder, Flow};
use deflex_text::Span;
use std::cell::RefCell;

/// What runs without a decision.
#[derive(Clone, Copy)]
pub(super) enum Action<'a> {
    /// Consecutive statements that do not decide which statement runs next.
    Statements(&'a [Statement]),
    /// The bounds of the FOR loop of this number are evaluated.
    BeginLoop(usize),
    /// The variable of the FOR loop of this number changes.
    NextRound(usize),
}

/// The test that decides between two paths.
#[derive(Clone, Copy)]
pub(super) enum Decision<'a> {
    /// Whether an IF or TEST runs. TRYNEXT in the handler of the routine skips it if its conditions fail.
    Runs(&'a Statement),
    Condition(&'a Expression),
    /// Whether the value of a TEST is among those of the CASE of this number.
    Case(&'a tree::Test, usize),
    /// Whether the FOR loop of this number has another round.
    Round(usize),
    While(&'a While),
    /// Whether the handler of the routine continues after a RAISE.
    Continues,
}

/// A step or a test, the place of its statement, and the innermost FOR loop around it, whose variable it sees.
#[derive(Clone, Copy)]
pub(super) struct Placed<T> {
    pub(super) what: T,
    pub(super) at: Span,
    pub(super) within: Option<usize>,
}

pub(super) type Step<'a> = Placed<Action<'a>>;
pub(super) type Test<'a> = Placed<Decision<'a>>;
type Steps<'a> = Builder<'a, Step<'a>, Test<'a>>;

/// A FOR loop.
pub(super) struct ForLoop<'a> {
    pub(super) of: &'a For,
    /// The name of its variable, in upper case.
    pub(super) name: Upper,
    /// The FOR loop around it.
    pub(super) outer: Option<usize>,
}

/// The steps of all routines.
#[derive(Default)]
pub(super) struct Routines<'a> {
    pub(super) flow: Flow<Step<'a>, Test<'a>>,
    pub(super) loops: Vec<ForLoop<'a>>,
    /// The routines in the order in which `flow` has them, which is ascending.
    ids: Vec<RoutineId>,
}

impl<'a> Routines<'a> {
    pub(super) fn new(symbols: &Symbols<'a>) -> Self {
        let mut routines = Self { ids: symbols.all().collect(), ..Self::default() };
        for &id in &routines.ids {
            let routine = symbols.routine(id);
            let skips = any(routine.on_error(), &|statement| matches!(statement, StatementKind::TryNext));
            let bytes = &symbols.sources[id.file].bytes;
            let layout = Layout { bytes, skips, loops: RefCell::new(std::mem::take(&mut routines.loops)) };
            routines.flow.add(|steps| layout.lay(steps, &routine.body, None));
            routines.loops = layout.loops.into_inner();
        }
        routines
    }

    /// The number of a routine in `flow`.
    pub(super) fn number(&self, id: RoutineId) -> usize {
        self.ids.partition_point(|other| *other < id)
    }
}

/// Lays out the steps of one routine.
struct Layout<'a> {
    bytes: &'a [u8],
    /// Whether its ERROR handler has TRYNEXT.
    skips: bool,
    loops: RefCell<Vec<ForLoop<'a>>>,
}

/// Whether the next statement does not depend on this one.
fn is_plain(statement: &Statement) -> bool {
    match statement.kind {
        StatementKind::Assign(_) | StatementKind::Call(_) | StatementKind::Mark(_) | StatementKind::Connect(_) => true,
        StatementKind::If(_)
        | StatementKind::For(_)
        | StatementKind::While(_)
        | StatementKind::Test(_)
        | StatementKind::Return(_)
        | StatementKind::Exit
        | StatementKind::Raise
        | StatementKind::Retry
        | StatementKind::TryNext
        | StatementKind::Goto(_)
        | StatementKind::Label(_) => false,
    }
}

impl<'a> Layout<'a> {
    fn lay(&self, steps: &mut Steps<'a>, block: &'a [Statement], within: Option<usize>) {
        for row in block.chunk_by(|a, b| is_plain(a) && is_plain(b)) {
            match is_plain(&row[0]) {
                true => steps.step(Placed { what: Action::Statements(row), at: row[0].at, within }),
                false => self.lay_decision(steps, &row[0], within),
            }
        }
    }

    fn lay_decision(&self, steps: &mut Steps<'a>, statement: &'a Statement, within: Option<usize>) {
        let at = statement.at;
        let test = |what| Placed { what, at, within };
        let lay = |steps: &mut Steps<'a>, block: &'a Vec<Statement>| self.lay(steps, block, within);
        match &statement.kind {
            StatementKind::If(of) => self.lay_skippable(steps, test(Decision::Runs(statement)), |steps| {
                let arms = of.arms.iter().map(|arm| (test(Decision::Condition(&arm.condition)), &arm.body));
                steps.choose(arms, &of.otherwise, lay);
            }),
            StatementKind::Test(of) => self.lay_skippable(steps, test(Decision::Runs(statement)), |steps| {
                let cases = of.cases.iter().enumerate().map(|(i, case)| (test(Decision::Case(of, i)), &case.body));
                steps.choose(cases, &of.otherwise, lay);
            }),
            StatementKind::While(of) => steps.repeat(|steps| {
                steps.branch(test(Decision::While(of)), |steps| lay(steps, &of.body), Builder::leave);
            }),
            StatementKind::For(of) => {
                let number = self.loops.borrow().len();
                let name = Upper::new(&self.bytes[of.variable.range()]);
                self.loops.borrow_mut().push(ForLoop { of, name, outer: within });
                steps.step(Placed { what: Action::BeginLoop(number), at, within });
                steps.repeat(|steps| {
                    let round = |steps: &mut Steps<'a>| {
                        self.lay(steps, &of.body, Some(number));
                        steps.step(Placed { what: Action::NextRound(number), at, within });
                    };
                    steps.branch(test(Decision::Round(number)), round, Builder::leave);
                });
            }
            StatementKind::Return(_) => {
                steps.returns(Placed { what: Action::Statements(std::slice::from_ref(statement)), at, within });
            }
            StatementKind::Raise => steps.branch(test(Decision::Continues), |_| (), Builder::halt),
            StatementKind::Exit => {
                steps.step(Placed { what: Action::Statements(std::slice::from_ref(statement)), at, within });
                steps.halt();
            }
            // These belong to handlers, which are not run; elsewhere they are errors.
            StatementKind::Retry | StatementKind::TryNext => steps.halt(),
            StatementKind::Goto(label) => steps.jump(label),
            StatementKind::Label(name) => steps.label(name),
            StatementKind::Assign(_) | StatementKind::Call(_) | StatementKind::Mark(_) | StatementKind::Connect(_) => {}
        }
    }

    fn lay_skippable(&self, steps: &mut Steps<'a>, test: Test<'a>, lay: impl FnOnce(&mut Steps<'a>)) {
        if self.skips { steps.branch(test, lay, |_| ()) } else { lay(steps) }
    }
}
