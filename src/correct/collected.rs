//! Rows and failures of a run as they come, and the limits that make a failure of a correction.

use super::corrected::{Corrected, Posted};
use super::row::{Row, RowNames};
use super::{PathDeviation, Prepared, spin};
use crate::cell::Cell;
use crate::equilibrium::{EquilibriumError, PredictedPose};
use crate::program::{Change, Program, Rewritten, Role, Target, UnknownMotion};
use crate::robot::{Joints, Robot};
use crate::text::Diagnostic;
use nalgebra::Vector3;
use std::sync::Arc;

/// Rows and failures as they come.
pub(super) struct Collected<'a> {
    pub(super) program: &'a Program,
    prepared: &'a Prepared,
    pub(super) rows: Vec<Row>,
    /// Of the file, tool and work object last met.
    names: Option<((u16, u16, u16), Arc<RowNames>)>,
    /// With their points.
    failures: Vec<(usize, Diagnostic)>,
    /// Points with a failure already: one message a point.
    failed: Vec<bool>,
}

impl<'a> Collected<'a> {
    pub(super) fn new(program: &'a Program, prepared: &'a Prepared) -> Self {
        let failed = vec![false; program.targets.len()];
        let rows = Vec::with_capacity(program.targets.len());
        Self { program, prepared, rows, names: None, failures: Vec::new(), failed }
    }

    /// Names of file, tool and work object of a target.
    fn names(&mut self, target: &Target) -> Arc<RowNames> {
        let key = (target.source, target.tool, target.wobj);
        if let Some((last, names)) = &self.names
            && *last == key
        {
            return Arc::clone(names);
        }
        let program = self.program;
        let names = Arc::new(RowNames {
            file: program.sources[usize::from(target.source)].name.as_str().into(),
            tool: Arc::clone(&program.tools[usize::from(target.tool)].name),
            wobj: Arc::clone(&program.wobjs[usize::from(target.wobj)].name),
        });
        self.names = Some((key, Arc::clone(&names)));
        names
    }

    /// Whether it is not known where the controller goes.
    pub(super) fn is_unsolved(&self, i: usize) -> bool {
        self.prepared.points[i].unsolved.is_some()
    }

    /// The row of a target that is not solved.
    pub(super) fn unsolved_row(&mut self, i: usize) {
        let (target, point) = (&self.program.targets[i], &self.prepared.points[i]);
        if let Some(why) = point.unsolved.filter(|_| target.is_end()) {
            let names = Some(self.names(target));
            self.rows.push(Row { names, ..Row::unsolved(target, why) });
        }
    }

    pub(super) fn row(&mut self, i: usize, there: &PredictedPose) {
        let (target, point) = (&self.program.targets[i], &self.prepared.points[i]);
        if !target.is_end() {
            return;
        }
        let normal = point.normal_error(&self.prepared.laws, &there.shift, &there.axis);
        let names = self.names(target);
        // Filled where it stays.
        self.rows.push(Row::BLANK);
        if let Some(row) = self.rows.last_mut() {
            row.fill(target, point, there, normal);
            row.names = Some(names);
            row.spin_deg = self.prepared.turns_are_chosen.then(|| spin::turn_of(&point.wobj_from_tcp).to_degrees());
        }
    }

    /// Motor angles (rad) that the controller is sent to at point `i`, whose row is the last one.
    pub(super) fn joints(&mut self, i: usize, robot: &Robot, motor: &Joints) {
        if let Some(row) = self.rows.last_mut().filter(|_| self.program.targets[i].is_end()) {
            row.joints_deg = Some(robot.axes_deg_from_motor(motor));
        }
    }

    /// What is left on the way into every point: a row has that of all points up to its end.
    pub(super) fn paths(&mut self, paths: &[Option<PathDeviation>]) {
        let mut rows = self.rows.iter_mut().peekable();
        let mut way: Option<Option<PathDeviation>> = None;
        for (target, path) in self.program.targets.iter().zip(paths) {
            if target.role != Role::Via {
                way = Some(match way {
                    None => *path,
                    Some(before) => before.zip(*path).map(|(before, path)| before.and(path)),
                });
            }
            if target.is_end() {
                let whole = way.take().flatten();
                if let Some(row) = rows.next_if(|row| row.target == target.ordinal) {
                    row.path = whole;
                }
            }
        }
    }

    pub(super) fn fail(&mut self, i: usize, error: &EquilibriumError) {
        if self.is_unsolved(i) {
            return;
        }
        let help = match error {
            EquilibriumError::Unreachable(_) => "move the work object or the start branch, or change the program there",
            EquilibriumError::NoEquilibrium { .. } => {
                "check `[robot.stiffness]` and `[cut]`: the cut is stiffer than the arm"
            }
            EquilibriumError::NotFinite => "check the cell's numbers",
        };
        self.refuse(i, "target.unsolved", error.to_string(), help);
    }

    pub(super) fn refuse(&mut self, i: usize, code: &'static str, message: String, help: &str) {
        if std::mem::replace(&mut self.failed[i], true) {
            return;
        }
        let target = &self.program.targets[i];
        let name = target.name.as_ref().map_or_else(String::new, |name| format!(" `{name}`"));
        let source = &self.program.sources[usize::from(target.source)];
        let message = format!("target {}{name}: {message}", target.ordinal);
        let failure = Diagnostic::error(code, "", message).on_line(source, target.span, target.line).help(help);
        self.failures.push((i, failure));
    }

    /// Rows and failures in the order of the motions.
    pub(super) fn finish(
        mut self,
        notes: Vec<Diagnostic>,
        rewritten: Option<Rewritten>,
        posted: Vec<Posted>,
    ) -> Corrected {
        if !self.program.unknown.is_empty() {
            let unknown = |motion: &UnknownMotion| {
                let file = self.program.sources[usize::from(motion.source)].name.as_str().into();
                Row { names: Some(Arc::new(RowNames { file, ..RowNames::default() })), ..Row::unknown(motion) }
            };
            self.rows.extend(self.program.unknown.iter().map(unknown));
            self.rows.sort_by_key(|row| row.target);
        }
        self.failures.sort_by_key(|(i, _)| *i);
        let failures = self.failures.into_iter().map(|(_, failure)| failure).collect();
        Corrected { rows: self.rows, failures, notes, rewritten, posted, ..Corrected::default() }
    }
}

/// The point of each row: targets that failed have no row, and points on the way to an end have none either.
pub(super) fn points_of(rows: &[Row], program: &Program) -> Vec<Option<usize>> {
    let mut ends = program.targets.iter().enumerate().filter(|(_, target)| target.is_end());
    rows.iter().map(|row| ends.find(|(_, target)| target.ordinal == row.target).map(|(i, _)| i)).collect()
}

/// Corrections that would surprise the machine: too large, or too different from the neighbour's.
pub(super) fn check_limits(
    out: &mut Collected,
    cell: &Cell,
    prepared: &Prepared,
    written: &[([f64; 3], [f64; 4])],
    changes: &[Option<Change>],
    last: &mut Option<Vector3<f64>>,
) {
    let limits = &cell.limits;
    let above = |shift: &Vector3<f64>, limit: f64| shift.norm_squared() > limit * limit;
    for (i, point) in prepared.points.iter().enumerate() {
        let corrected = changes[i].is_some() || !out.program.language.is_edited();
        let shift = if corrected {
            let to = Vector3::from(written[i].0) * 1e-3;
            prepared.base_from_wobj(i).rotation * (to - point.wobj_from_tcp.translation.vector)
        } else {
            Vector3::zeros()
        };
        if above(&shift, limits.max_correction) {
            out.refuse(
                i,
                "limits.max-correction",
                format!(
                    "correction of {:.3} mm, more than max_correction_mm = {}",
                    1e3 * shift.norm(),
                    1e3 * limits.max_correction
                ),
                "check stiffness (its unit is N·m/rad) and forces of the cell; raise `[limits] max_correction_mm` if it is meant",
            );
        }
        let step = last.map_or_else(Vector3::zeros, |last| shift - last);
        if above(&step, limits.max_step) {
            out.refuse(
                i,
                "limits.max-step",
                format!(
                    "the correction steps by {:.3} mm from the target before, more than max_step_mm = {}",
                    1e3 * step.norm(),
                    1e3 * limits.max_step
                ),
                "lead in and out of the cut more gently, or raise `[limits] max_step_mm` if the step is meant",
            );
        }
        *last = Some(shift);
    }
}
