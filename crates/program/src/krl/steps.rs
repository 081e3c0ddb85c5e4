//! The steps of routines. `deflex_lang` finds which of them run.

use super::expression::Expression;
use super::tree::{File, Loop, Statement, StatementKind};
use deflex_lang::flow::{Builder, Flow};

/// Consecutive statements that do not decide which statement runs next.
pub(super) type Row<'a> = &'a [Statement];

/// The test that decides between two paths.
#[derive(Clone, Copy, Debug)]
pub(super) enum Test<'a> {
    If(&'a Expression),
    /// Whether there is another round.
    Round(&'a Loop),
}

type Steps<'a> = Builder<'a, Row<'a>, Test<'a>>;

/// The steps of all routines, in the order of the files.
pub(super) type Routines<'a> = Flow<Row<'a>, Test<'a>>;

pub(super) fn routines(files: &[File]) -> Routines<'_> {
    let mut flow = Flow::default();
    let all = files.iter().flat_map(|file| &file.routines);
    all.for_each(|routine| flow.add(|steps| lay(steps, &routine.body)));
    flow
}

/// Whether the next statement does not depend on this one.
fn is_plain(statement: &Statement) -> bool {
    !matches!(
        statement.kind,
        StatementKind::If(_)
            | StatementKind::Loop(_)
            | StatementKind::Jump(_)
            | StatementKind::Label(_)
            | StatementKind::Return(_)
            | StatementKind::Exit
    )
}

fn lay<'a>(steps: &mut Steps<'a>, block: &'a [Statement]) {
    for row in block.chunk_by(|a, b| is_plain(a) && is_plain(b)) {
        if is_plain(&row[0]) { steps.step(row) } else { lay_statement(steps, &row[0]) }
    }
}

fn lay_statement<'a>(steps: &mut Steps<'a>, statement: &'a Statement) {
    match &statement.kind {
        StatementKind::If(of) => {
            steps.branch(Test::If(&of.condition), |steps| lay(steps, &of.then), |steps| lay(steps, &of.otherwise));
        }
        StatementKind::Loop(of) => steps.repeat(|steps| {
            let is_tested = !of.is_endless();
            match of.is_until {
                false if is_tested => {
                    steps.branch(Test::Round(of), |steps| lay(steps, &of.body), Builder::leave);
                }
                _ => lay(steps, &of.body),
            }
            if of.is_until && is_tested {
                steps.branch(Test::Round(of), |_| (), Builder::leave);
            }
        }),
        StatementKind::Jump(to) => steps.jump(to),
        StatementKind::Label(name) => steps.label(name),
        StatementKind::Return(_) => steps.returns(std::slice::from_ref(statement)),
        StatementKind::Exit => steps.leave(),
        _ => {}
    }
}
