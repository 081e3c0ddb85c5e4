//! What the library promises, by name and signature: this compiles, or a version has broken its word.

#![allow(clippy::type_complexity)] // signatures in full are the point

use deflex::cell::{
    self, Cell, Cl, Controller, CorrectionLimits, Cut, CutForce, ForceFrame, NewEffect, Spin, SpinRule,
};
use deflex::correct::{
    self, Correct, Corrected, Options, PostOptions, Posted, Prepared, Row, Status, Stiffness, Summary,
};
use deflex::cutting::{Coefficients, Cutter, Engagement, Milling, Mode, materials};
use deflex::effects::{Covered, Effect, KINDS, Kind, Need, Parameter, Situation, ToolFrame};
use deflex::equilibrium::{Arm, Command, Equilibrium, EquilibriumError};
use deflex::identify::{
    self, Added, Correlate, Coverage, Errors, FittedParameter, Identification, Input, Ranked, ResidualRow, Separation,
    Unexplained,
};
use deflex::measured::{ForceRow, Forces, MeasuredRow, Table, TargetRef};
use deflex::program::{
    self, Change, Conf, Confdata, Config, Editable, Goal, Insert, Kept, Language, Mark, Motion, Program,
    RewriteOptions, Rewritten, Role, RoundTrip, Target, Tool, ToolData, Wobj, WobjData, cl, rapid,
};
use deflex::report::html::{self, PathKind, PathPage, PathTrace};
use deflex::report::{
    self, CheckFile, Difference, FileSummary, InsertedTarget, InspectFile, InspectFiles, MovedTarget,
};
use deflex::robot::{BUILTIN, Builtin, DhRow, Joints, Limits, Pose, Robot, Unreachable};
use deflex::session;
use deflex::text::{self, Diagnostic, Edit, Severity, Source, Span};

type Many<T> = Result<T, Vec<Diagnostic>>;

#[test]
fn functions_take_and_give_what_they_promise() {
    // Read.
    let _: fn(&Source) -> Many<Cell> = Cell::read;
    let _: fn(Vec<Source>, Vec<Source>) -> Many<Program> = rapid::read;
    let _: fn(Source, &cl::ClOptions) -> Many<Program> = cl::read;
    let _: fn(&Source) -> Many<Table> = Table::read;
    let _: fn(&str, &[u8]) -> Option<Language> = program::detect;
    // Correct.
    let _: fn(&Program, &Cell, &Options) -> Many<Corrected> = correct::compensate;
    let _: fn(&Program, &Cell, &Options, Option<&Program>) -> Many<Corrected> = correct::predict;
    let _: fn(&Program, &Cell, &Options) -> Many<Prepared> = Prepared::new;
    let _: fn(&Program, &[Option<Change>], &[Insert], &RewriteOptions) -> Rewritten = Program::rewrite;
    // Identify.
    let _: fn(Input<'_>) -> Many<Identification> = identify::identify;
    let _: fn(&str, &[NewEffect]) -> Many<String> = cell::extended;
    // The same as the command, in memory.
    let _: fn(&session::ProgramFiles, &session::Run) -> Many<session::Done> = session::compensate;
    let _: fn(&session::ProgramFiles, Option<&session::ProgramFiles>, &session::Run) -> Many<session::Done> =
        session::predict;
    let _: fn(&[u8]) -> Many<Vec<report::Column>> = report::columns;
    // Report.
    let _: fn(&Program, &Program) -> Difference = report::difference;
    let _ = |p: &Program| -> RoundTrip { program::round_trip(p, rapid::read) };
    let _: fn(&[CheckFile]) -> String = report::junit;
    let _: fn(&[CheckFile]) -> serde_json::Value = report::sarif;
    let _: fn(&[ResidualRow]) -> String = report::residual_csv;
    let _: fn(&Program, &str, &Difference) -> String = html::diff_page;
    let _ = |page: &PathPage<'_>| -> String { page.html() };
    let _: fn(&Builtin) -> String = cell::template;
    // The arm by itself.
    let _: fn(&Robot, &Joints) -> Pose = Robot::forward;
    let _: fn(&Arm, &Situation<'_>, &Joints, &Joints) -> Result<Equilibrium, EquilibriumError> = Arm::predict;
}

/// Types whose fields are read by users: named here once, so that none goes unnoticed.
#[test]
fn types_are_there_and_can_be_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    macro_rules! all { ($($type:ty),* $(,)?) => { $(shared::<$type>();)* } }
    all!(Cell, Cl, Controller, CorrectionLimits, Cut, CutForce, ForceFrame, NewEffect, Spin, SpinRule);
    all!(Correct, Corrected, ForceRow, Forces, Options, PostOptions, Posted, Prepared, Row, Status, Stiffness, Summary);
    all!(Coefficients, Cutter, Engagement, Milling, Mode, materials::Material);
    all!(Covered, Box<dyn Effect>, Kind, Need, Parameter, ToolFrame, Arm, Command, Equilibrium, EquilibriumError);
    all!(Added, Correlate, Coverage, Errors, FittedParameter, Identification, Ranked, ResidualRow, Separation);
    all!(
        Unexplained, MeasuredRow, Table, TargetRef, Change, Conf, Confdata, Config, Editable, Goal, Insert, Kept,
        Language, Mark, Motion
    );
    all!(Program, RewriteOptions, Rewritten, Role, RoundTrip, Target, Tool, ToolData, Wobj, WobjData);
    all!(
        PathKind, PathTrace, CheckFile, Difference, FileSummary, InsertedTarget, InspectFile, InspectFiles, MovedTarget
    );
    all!(Builtin, DhRow, Limits, Unreachable, Diagnostic, Edit, Severity, Source, Span);
    assert_eq!((KINDS.len(), BUILTIN.len()), (27, 382), "kinds and robots are only added to: raise this number then");
}

/// Options grow: they are made from their defaults.
#[test]
fn options_have_defaults() {
    let options = Options { correct: Correct::Position, ..Options::default() };
    assert!(options.forces.is_none() && !options.allow_clones);
    assert!(!RewriteOptions { position_decimals: 3, ..RewriteOptions::default() }.allow_clones);
    let diagnostic = Diagnostic::error("user.code", "a.mod", "said").help("mend").severity(Severity::Note);
    assert_eq!(diagnostic.to_string(), "a.mod: note: said [user.code]");
    let mut out = Vec::new();
    text::apply(b"ab", &[], &mut out).expect("a Vec is written to");
    assert_eq!(out, b"ab");
}
