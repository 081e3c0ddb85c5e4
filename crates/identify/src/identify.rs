//! The steps of an identification: it searches a model, judges it on rows that its fit has not seen, and makes the
//! answer.

use super::candidate::with;
use super::data::{Extent, Problem};
use super::decisions::NAMED;
use super::device_pose::{self, InstrumentPlace};
use super::engine::Engine;
use super::found::{Findings, Model};
use super::input::{Input, Progress, Written};
use super::outcome::Identification;
use super::progress::{JUDGED, reached};
use deflex_cell::Cell;
use deflex_text::Diagnostic;

/// Fewest rows that can be divided into fitted and held-out blocks.
pub(super) const LEAST_ROWS: usize = 8;

/// Finds the effects that a cell lacks.
///
/// # Errors
/// Tables that do not belong to their programs, too few rows, targets that the cell does not solve; `run.called-off`.
///
/// # Examples
/// ```no_run
/// use deflex_identify::{Input, Written, identify};
/// use deflex_cell::Cell;
/// use deflex_measured::Table;
/// use deflex_program::rapid;
/// use deflex_text::Source;
///
/// let read = |path: &str| std::fs::read(path).map(|bytes| Source::new(path, bytes));
/// let cell = Cell::read(&read("../../samples/closed-loop/cell.toml")?)?;
/// let program = rapid::read(vec![read("../../samples/closed-loop/part.mod")?], vec![])?;
/// let table = Table::read(&read("../../samples/closed-loop/measured.csv")?)?;
/// let found = identify(Input {
///     cell: &cell,
///     runs: vec![(program, table).into()],
///     poses: vec![],
///     tool: None,
///     data_hash: "",
///     written: Written::WholeModel,
///     progress: &|_| true,
/// })?;
/// println!("{:.3} mm, then {:.3} mm", found.before.rms_mm, found.after.rms_mm);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn identify(input: Input<'_>) -> Result<Identification, Vec<Diagnostic>> {
    let Input { cell, runs, poses, tool, data_hash, written, progress } = input;
    let mut problem =
        if poses.is_empty() { Problem::of_runs(cell, runs)? } else { Problem::of_poses(cell, poses, tool)? };
    let held_out = problem.rows.iter().filter(|row| row.held_out).count();
    if problem.rows.len() < LEAST_ROWS || held_out == 0 || held_out == problem.rows.len() {
        let message =
            format!("{} measured rows, {held_out} of them held out: too few to fit and to judge", problem.rows.len());
        return Err(vec![
            Diagnostic::error("identify.rows", "", message)
                .help(format!("at least {LEAST_ROWS} rows are needed, some held out and some not")),
        ]);
    }
    let declared = with(&cell.arm, &[]);
    problem.cut_stocks(&declared, cell)?;
    let before = problem.residual(&declared);
    if before.iter().any(|v| !v.is_finite()) {
        let message = "the declared cell has no equilibrium at some measured targets";
        return Err(vec![
            Diagnostic::error("identify.unsolved", "", message).help("run `deflex predict` on the program first"),
        ]);
    }
    let mut engine = Engine::new(declared, problem, &cell.covariances);
    let before = match engine.problem.extent {
        Extent::Part if engine.aside.is_empty() => before,
        Extent::Part => engine.problem.residual(&engine.declared),
        // Where the instrument stands was estimated without the deflection; now it is fitted with it.
        Extent::Robot => {
            engine.descend();
            engine.residual()
        }
    };
    engine.widen_frame(&before);
    let places = device_pose::places(&engine.problem);
    let (doubt, model) = match engine.problem.extent {
        Extent::Part => (engine.check_plausibility(&before)?, engine.model_of_part(cell, progress)?),
        Extent::Robot => (None, engine.model_of_robot(progress)?),
    };
    let findings = engine.judge(cell, model, &places, written, progress)?;
    let (before, after) = engine.residuals_of_all_rows(before);
    Ok(engine.outcome(&before, &after, findings, doubt, data_hash))
}

impl Engine {
    /// Judges the model: takes its effects back if they make left-out rows worse, adds the map of the discrepancy, and
    /// computes the errors at places that the fit has not seen. `places` are those of the instruments before the search.
    fn judge(
        &mut self,
        cell: &Cell,
        model: Model,
        places: &[InstrumentPlace],
        written: Written,
        progress: &Progress<'_>,
    ) -> Result<Findings, Vec<Diagnostic>> {
        let Model { mut posteriors, ranking } = model;
        if written == Written::NamedAlone {
            self.withdraw_unless(&mut posteriors, |_, share, _| share >= NAMED);
        }
        self.settle_cuts(cell)?;
        let whole_robot = self.problem.is_of_robot();
        // Over the whole robot every stage has already gained on the rows.
        let refused = if whole_robot || posteriors.is_empty() { None } else { self.worse_where_left_out() };
        if refused.is_some() {
            posteriors.clear();
            self.remove_all_effects();
            device_pose::restore(&mut self.problem, places);
        }
        let has_map = written == Written::WholeModel && !whole_robot && !self.forces_are_wrong();
        let map = if has_map { self.field_map(&posteriors) } else { None };
        reached(progress, JUDGED)?;
        let unexplained = self.unexplained();
        self.map = map;
        let elsewhere = self.elsewhere();
        let stages = if whole_robot { self.stage_errors() } else { Vec::new() };
        Ok(Findings { posteriors, ranking, unexplained, stages, elsewhere, refused })
    }
}
