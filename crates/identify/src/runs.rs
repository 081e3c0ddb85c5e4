//! Reads rows that were measured on a program: finds the target or place of each, and checks whether the table belongs
//! to the program.

use super::data::{Blocks, Extent, Problem, StockCut};
use super::device::Device;
use super::input::MeasuredRun;
use super::places::{Path, Placed, misplaced};
use super::plausibility::{MatchedRow, check_points, steps_mm};
use super::probing::Probing;
use super::reading::Reading;
use deflex_cell::Cell;
use deflex_correct::{Options, Point, Prepared};
use deflex_measured::{Forces, MeasuredRow, Table, TargetRef};
use deflex_program::{Motion, Program, Role, Target};
use deflex_text::Diagnostic;
use nalgebra::Vector3;
use std::collections::BTreeMap;

impl Problem {
    /// The problem of programs with what was measured on them. Each clamping of a table is a run of its own.
    pub(super) fn of_runs(cell: &Cell, runs: Vec<MeasuredRun>) -> Result<Self, Vec<Diagnostic>> {
        let mut problem = Self::empty(Extent::Part);
        problem.units = std::sync::Arc::clone(&cell.units);
        let twice = runs.iter().enumerate().find_map(|(i, run)| {
            let first = runs[..i].iter().find(|first| is_same_table(&first.table, &run.table))?;
            Some(run.table.row_error(1, format!("the rows are those of `{}`, number by number", first.table.file)))
        });
        if let Some(twice) = twice {
            return Err(vec![twice.help("give each measured file once")]);
        }
        let rows = || runs.iter().flat_map(|run| &run.table.rows);
        let declared = rows().all(|row| row.sigma_mm.is_some());
        problem.steps_mm = steps_mm(rows());
        problem.read_in_order = !rows().all(|row| row.normal_mm.is_some() && row.time_s.is_none());
        for MeasuredRun { program, original, table } in runs {
            let first = problem.runs.len();
            for part in clampings(table) {
                problem.take_run(cell, &program, original.as_ref(), &part)?;
            }
            let runs: Vec<usize> =
                (first..problem.runs.len()).filter(|run| problem.runs[*run].follows_stock()).collect();
            if !runs.is_empty() {
                problem.stocks.push(StockCut { program, runs });
            }
        }
        problem.scale_weights(declared);
        Ok(problem)
    }

    /// Adds the rows that were measured on a program in one clamping.
    fn take_run(
        &mut self,
        cell: &Cell,
        program: &Program,
        original: Option<&Program>,
        table: &Table,
    ) -> Result<(), Vec<Diagnostic>> {
        let has_force = table.rows.iter().any(|row| row.force_n.is_some());
        let covariates = table.rows.iter().map(MeasuredRow::force);
        let covariates = covariates.clone().any(|row| row.time.or(row.temperature).or(row.payload).is_some());
        let mut forces = table.forces();
        forces.forces_given = has_force;
        if let Some(row) = table.rows.iter().find(|row| has_force && row.force_n.is_none()) {
            let count = table.rows.iter().filter(|row| row.force_n.is_none()).count();
            let message = format!("this row has no force, and others have ({count} of {} rows)", table.rows.len());
            let help = "write 0 where no force acted, and leave out the rows whose force is not known";
            return Err(vec![table.row_error(row.line, message).help(help)]);
        }
        let options = Options { forces: (has_force || covariates).then_some(forces), ..Options::default() };
        let mut prepared = match original {
            Some(original) => Prepared::judged_by(original, program, cell, &options)?,
            None => Prepared::new(program, cell, &options)?,
        };
        prepared.follow_loads(&cell.arm);
        if let Some(forces) = options.forces.as_ref().filter(|forces| forces.forces_given) {
            self.has_cut_length &= has_all_cuts(program, &prepared, forces);
        }
        drop(options);
        let path = Path::new(program, &prepared, table);
        let run = self.runs.len();
        let mut errors = Vec::new();
        let mut taken: Vec<MatchedRow> = Vec::new();
        let mut ways: BTreeMap<usize, usize> = BTreeMap::new();
        for row in &table.rows {
            let placed = match row.nominal_mm.filter(|_| row.target.is_none()) {
                Some(nominal_mm) => path
                    .place(cell, &mut prepared, row, nominal_mm)
                    .map_err(|message| misplaced(table, row.line, message)),
                None => solved_target(program, &prepared, row)
                    .map(Placed::at_target)
                    .map_err(|message| table.row_error(row.line, message)),
            };
            match placed {
                Ok(Placed { point, way_from }) => {
                    let reading =
                        Reading::of(row).map(|reading| relative_to_path(reading, row, &prepared.points[point]));
                    ways.extend(way_from.map(|from| (point, from)));
                    taken.extend(reading.map(|reading| (point, row, reading)));
                }
                Err(error) => errors.push(error),
            }
        }
        check_points(&prepared, table, &taken, &mut errors);
        if taken.is_empty() && errors.is_empty() {
            errors.push(table.row_error(1, "no row has a measured position, normal error or distance".to_owned()));
        }
        if !errors.is_empty() {
            errors.truncate(20);
            return Err(errors);
        }
        // The noise and the drift follow the time, so that the rows are sorted by it if all have one.
        if taken.iter().all(|(_, row, _)| row.time_s.is_some()) {
            taken.sort_by(|a, b| a.1.time_s.unwrap_or(0.0).total_cmp(&b.1.time_s.unwrap_or(0.0)));
        }
        let blocks = Blocks::of(&taken.iter().map(|(_, row, _)| row.holdout).collect::<Vec<_>>());
        for (order, (point, row, reading)) in taken.into_iter().enumerate() {
            let probing =
                Probing::of(cell, &prepared, point, row).map_err(|message| table.row_error(row.line, message))?;
            let at = &prepared.points[point];
            let (motor, travel) = (at.motor, at.travel);
            self.orientations += usize::from(row.quat.is_some());
            self.push(run, point, order, row, motor, travel, reading, &blocks);
            if let Some(row) = self.rows.last_mut() {
                row.target = program.targets.get(point).map(|target| target.ordinal);
                row.way_from = ways.get(&point).copied();
                row.probing = probing;
            }
        }
        self.runs.push(prepared);
        self.devices.push(Device::Known);
        self.find_fixed_point(run, table)
    }
}

/// Whether two tables have the same measured numbers in the same order.
fn is_same_table(a: &Table, b: &Table) -> bool {
    let numbers = |table: &Table| -> Vec<_> {
        table.rows.iter().map(|row| (row.axes_mm, row.normal_mm, row.distance_mm, row.force_n)).collect()
    };
    numbers(a) == numbers(b)
}

/// Whether a table has a force for each motion that may cut: for lines and arcs that are not faster than the fastest cut.
fn has_all_cuts(program: &Program, prepared: &Prepared, forces: &Forces) -> bool {
    let cuts = program.targets.iter().zip(&prepared.points).filter(|(_, point)| point.cuts());
    let fastest = cuts.filter_map(|(target, _)| target.feed_mm_s).max_by(f64::total_cmp);
    let may_cut = |target: &&Target| {
        let is_slow = target.feed_mm_s.zip(fastest).is_none_or(|(feed, fastest)| feed <= fastest);
        let is_path = matches!(target.motion, Motion::Linear | Motion::Circular);
        is_path && !target.rapid && target.is_end() && is_slow
    };
    let row = |target: &Target| forces.of(target.ordinal, target.name.as_deref());
    program.targets.iter().filter(may_cut).all(|target| row(target).is_some_and(|row| row.force.is_some()))
}

/// The rows of a table by their column `run`, in the order in which the runs first occur. Each run has a clamping of
/// its own.
fn clampings(table: Table) -> Vec<Table> {
    if table.rows.windows(2).all(|rows| rows[0].run == rows[1].run) {
        return vec![table];
    }
    let Table { file, rows, match_mm, notes: _ } = table;
    let mut parts: Vec<Table> = Vec::new();
    for row in rows {
        let at = parts.iter().position(|part| part.rows[0].run == row.run).unwrap_or_else(|| {
            parts.push(Table { file: file.clone(), match_mm, ..Table::default() });
            parts.len() - 1
        });
        parts[at].rows.push(row);
    }
    parts
}

/// A measured position shifted by the vector from its nominal point to its place on the path, so that its error is that
/// from the nominal point, which need not lie on the path.
fn relative_to_path(reading: Reading, row: &MeasuredRow, point: &Point) -> Reading {
    match (reading, row.nominal_mm.filter(|_| row.target.is_none())) {
        (Reading::Position(measured), Some(nominal_mm)) => {
            Reading::Position(measured - Vector3::from(nominal_mm) + point.reference.translation.vector * 1e3)
        }
        (reading, _) => reading,
    }
}

/// Index of the target of a row, which must be solved.
fn solved_target(program: &Program, prepared: &Prepared, row: &MeasuredRow) -> Result<usize, String> {
    let point = target_of(program, row)?;
    match prepared.unsolved(point) {
        Some(why) => Err(format!("the target of this row is not solved: {why}")),
        None => Ok(point),
    }
}

/// Index of the target that a row names.
fn target_of(program: &Program, row: &MeasuredRow) -> Result<usize, String> {
    let ends = || program.targets.iter().enumerate().filter(|(_, t)| t.role == Role::End);
    match &row.target {
        None => Err("the row names neither a target nor nominal_x_mm, nominal_y_mm, nominal_z_mm".to_owned()),
        Some(TargetRef::Ordinal(ordinal)) => {
            // In programs without arcs the ordinal is the index plus one.
            let guess = *ordinal as usize - 1;
            if program.targets.get(guess).is_some_and(|t| t.ordinal == *ordinal && t.role == Role::End) {
                return Ok(guess);
            }
            ends().find(|(_, t)| t.ordinal == *ordinal).map(|(i, _)| i).ok_or_else(|| {
                let count = ends().count();
                format!("target {ordinal}: the program has {count} targets; this table belongs to another program")
            })
        }
        Some(TargetRef::Name(name)) => {
            let mut found = ends().filter(|(_, t)| t.name.as_deref().is_some_and(|n| n.eq_ignore_ascii_case(name)));
            match (found.next(), found.next()) {
                (Some((i, _)), None) => Ok(i),
                (None, _) => Err(format!("target `{name}` is not visited by the program")),
                (Some(_), Some(_)) => Err(format!("target `{name}` is visited more than once: give ordinals")),
            }
        }
    }
}
