//! Rows and failures of a run in the order of the targets, and the limits beyond which a correction is a failure.

use super::context::Context;
use super::corrected::Corrected;
use super::correction::Correction;
use super::deviation::Commanded;
use super::laws::Laws;
use super::refusal::Refusal;
use super::row::{Row, RowNames, Status};
use super::{PathDeviation, Prepared, spin};
use deflex_equilibrium::EquilibriumError;
use deflex_program::{Program, Role, Target, UnknownMotion};
use deflex_text::Diagnostic;
use nalgebra::Vector3;
use std::sync::Arc;

/// Rows and failures collected so far.
pub(super) struct Collected<'a> {
    context: Context<'a>,
    prepared: &'a Prepared,
    pub(super) rows: Vec<Row>,
    /// Names of the last file, tool and work object.
    names: Option<((u16, u16, u16), Arc<RowNames>)>,
    /// Failures with their points.
    failures: Vec<(usize, Diagnostic)>,
    /// Whether a point has a failure already: each point has one message.
    failed: Vec<bool>,
}

impl<'a> Collected<'a> {
    pub(super) fn new(context: Context<'a>, prepared: &'a Prepared) -> Self {
        let failed = vec![false; prepared.points.len()];
        let rows = Vec::with_capacity(prepared.points.len());
        Self { context, prepared, rows, names: None, failures: Vec::new(), failed }
    }

    /// Names of file, tool and work object of a target.
    fn names(&mut self, target: &Target) -> Arc<RowNames> {
        let key = (target.source, target.tool, target.wobj);
        if let Some((last, names)) = &self.names
            && *last == key
        {
            return Arc::clone(names);
        }
        let program = self.context.program;
        let names = Arc::new(RowNames {
            file: program.sources[usize::from(target.source)].name.as_str().into(),
            tool: Arc::clone(&program.tools[usize::from(target.tool)].name),
            wobj: Arc::clone(&program.wobjs[usize::from(target.wobj)].name),
        });
        self.names = Some((key, Arc::clone(&names)));
        names
    }

    /// Adds target `i`: its row, or the reason why it has no solution.
    pub(super) fn target(&mut self, i: usize, commanded: &Commanded, correction: Option<&Correction>) {
        let Context { program, cell, .. } = self.context;
        let (target, point) = (&program.targets[i], &self.prepared.points[i]);
        if let Some(why) = point.unsolved {
            if target.is_end() {
                let names = Some(self.names(target));
                self.rows.push(Row { names, ..Row::unsolved(target, why) });
            }
            return;
        }
        if let Some(error) = correction.and_then(|correction| correction.error(self.context, i)) {
            self.fail(i, &error);
        }
        let landed = &commanded.landed[i];
        if let Err(error) = landed {
            self.fail(i, error);
        }
        let Ok(uncorrected) = correction.map_or(landed, |correction| &correction.first[i].uncorrected) else { return };
        if !target.is_end() {
            return;
        }
        let names = self.names(target);
        // Filled in place.
        self.rows.push(Row::default());
        let Some(row) = self.rows.last_mut() else { return };
        let normal = point.normal_error(&self.prepared.shared.laws, &uncorrected.shift, &uncorrected.axis);
        row.fill(target, point, uncorrected, normal);
        row.names = Some(names);
        let moved = (point.wobj_from_tcp.translation.vector - point.reference.translation.vector).norm();
        row.is_through_air = Laws::is_through_air(cell, target) && moved <= cell.limits.max_correction;
        row.spin_deg = self.prepared.turns_are_chosen.then(|| spin::turn_of(&point.wobj_from_tcp).to_degrees());
        row.joints_deg = Some(cell.arm.robot.axes_deg_from_motor(&commanded.steps[i].motor));
        if let (Some(correction), Ok(landed)) = (correction, landed) {
            row.remaining_mm = (1e3 * landed.shift).into();
            match (correction.kept(program, i), &correction.reached[i]) {
                (Some(reason), _) => row.status = Status::Kept(reason),
                (None, Ok(reached)) if correction.is_changed[i] => {
                    row.correction_mm = (1e3 * correction.shift(self.prepared, i)).into();
                    row.correction_deg = reached.turn.map(f64::to_degrees).into();
                    row.goes_along = correction.goes_along(i);
                    if row.goes_along {
                        row.status = Status::Air;
                    }
                }
                (None, _) => {}
            }
        }
    }

    /// Adds the deviation on the segment to every point.
    pub(super) fn paths(&mut self, paths: &[Option<PathDeviation>]) {
        let ends = self.context.program.targets.iter().zip(paths).filter(|(target, _)| target.role != Role::Via);
        fill_paths(&mut self.rows, ends.map(|(target, path)| RowSegment::new(target, *path)));
    }

    fn fail(&mut self, i: usize, error: &EquilibriumError) {
        let help = match error {
            EquilibriumError::Unreachable(_) => "move the work object or the start branch, or change the program there",
            EquilibriumError::NoEquilibrium { .. } => {
                "check `[robot.stiffness]` and `[cut]`: the cut is stiffer than the arm"
            }
            EquilibriumError::NotFinite => "check the cell's numbers",
        };
        self.refuse(i, Refusal::new("target.unsolved", error.to_string(), help));
    }

    fn refuse(&mut self, i: usize, Refusal { code, message, help }: Refusal) {
        if std::mem::replace(&mut self.failed[i], true) {
            return;
        }
        let program = self.context.program;
        let target = &program.targets[i];
        let name = target.name.as_ref().map_or_else(String::new, |name| format!(" `{name}`"));
        let message = format!("target {}{name}: {message}", target.ordinal);
        self.failures.push((i, program.error_at(target, code, message).help(help)));
    }

    /// Refuses corrections that are too large, or too different from that of the target before. `last` is the correction at the target
    /// before, base axes, m.
    pub(super) fn check_limits(&mut self, correction: &Correction, last: &mut Option<Vector3<f64>>) {
        let limits = &self.context.cell.limits;
        let above = |shift: &Vector3<f64>, limit: f64| shift.norm_squared() > limit * limit;
        for i in 0..self.prepared.points.len() {
            let shift = if correction.is_commanded[i] {
                self.prepared.base_from_wobj(i).rotation * correction.shift(self.prepared, i)
            } else {
                Vector3::zeros()
            };
            if above(&shift, limits.max_correction) {
                self.refuse(i, too_large(shift.norm(), limits.max_correction));
            }
            let step = last.map_or_else(Vector3::zeros, |last| shift - last);
            if above(&step, limits.max_step) {
                let [step, most] = [step.norm(), limits.max_step].map(|m| 1e3 * m);
                let message = format!(
                    "the correction steps by {step:.3} mm from the target before, more than max_step_mm = {most}"
                );
                let help =
                    "lead in and out of the cut more gently, or raise `[limits] max_step_mm` if the step is meant";
                self.refuse(i, Refusal::new("limits.max-step", message, help));
            }
            *last = Some(shift);
        }
    }

    /// Rows and failures in the order of the motions.
    pub(super) fn finish(mut self) -> Corrected {
        let program = self.context.program;
        if !program.unknown.is_empty() {
            let unknown = |motion: &UnknownMotion| {
                let file = program.sources[usize::from(motion.source)].name.as_str().into();
                Row { names: Some(Arc::new(RowNames { file, ..RowNames::default() })), ..Row::unknown(motion) }
            };
            self.rows.extend(program.unknown.iter().map(unknown));
            self.rows.sort_by_key(|row| row.target);
        }
        self.failures.sort_by_key(|(i, _)| *i);
        let failures = self.failures.into_iter().map(|(_, failure)| failure).collect();
        Corrected { rows: self.rows, failures, ..Corrected::default() }
    }
}

/// The segment to a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowSegment {
    /// Ordinal of its target.
    ordinal: u32,
    /// Whether the row of that target ends with it.
    is_end: bool,
    pub(super) path: Option<PathDeviation>,
}

impl RowSegment {
    pub(super) fn new(target: &Target, path: Option<PathDeviation>) -> Self {
        Self { ordinal: target.ordinal, is_end: target.is_end(), path }
    }
}

/// Gives each row the deviation on all segments up to its end.
pub(super) fn fill_paths(rows: &mut [Row], segments: impl Iterator<Item = RowSegment>) {
    let mut rows = rows.iter_mut().peekable();
    let mut whole: Option<Option<PathDeviation>> = None;
    for RowSegment { ordinal, is_end, path } in segments {
        let path = match whole.take() {
            None => path,
            Some(before) => before.zip(path).map(|(before, path)| before.and(path)),
        };
        if !is_end {
            whole = Some(path);
            continue;
        }
        while rows.next_if(|row| row.target < ordinal).is_some() {}
        if let Some(row) = rows.next_if(|row| row.target == ordinal) {
            row.path = path;
        }
    }
}

/// The point of each row. Targets that failed have no row, and points between a start and an end have none either.
pub(super) fn points_of(rows: &[Row], program: &Program) -> Vec<Option<usize>> {
    let mut ends = program.targets.iter().enumerate().filter(|(_, target)| target.is_end());
    rows.iter().map(|row| ends.find(|(_, target)| target.ordinal == row.target).map(|(i, _)| i)).collect()
}

/// A correction that is larger than the limit, m.
pub(super) fn too_large(shift: f64, limit: f64) -> Refusal {
    let [shift, most] = [shift, limit].map(|m| 1e3 * m);
    let message = format!("correction of {shift:.3} mm, more than max_correction_mm = {most}");
    let help = "check stiffness (its unit is N·m/rad) and forces of the cell; raise `[limits] max_correction_mm` if it is meant";
    Refusal::new("limits.max-correction", message, help)
}
