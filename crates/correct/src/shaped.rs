//! Corrects programs so that the driven path keeps a tolerance (`compensate --max-path-error`).
//!
//! The corner errors of the controller are corrected first: [`shape`] finds the command that the controller drives along the programmed
//! path, and the program is written with it. That program is then corrected for the deflection of the arm like any other. The
//! final text is judged: the driven path of the loaded arm is compared with the path of the original program.

use super::collected::too_large;
use super::context::Context;
use super::corrected::DrivenSummary;
use super::course::{Course, zone_of};
use super::driven::{DrivenSegments, Sampling, driven_segments, loaded_along, original_waypoint};
use super::line::compensate_in;
use super::original_loads::{OriginalLoads, OriginalTarget};
use super::refusal::Refusal;
use super::{Corrected, Options, Prepared, Row, frames};
use deflex_cell::{Cell, ControllerPath};
use deflex_drive::{CommandedMotion, DriveError, Freedom, ShapedCommand, Wanted, shape};
use deflex_program::cl::ClOptions;
use deflex_program::{
    Change, Editable, Goal, Insert, Language, Passing, Program, ReadOptions, Reason, RewriteOptions, Rewritten, read,
};
use deflex_text::{Diagnostic, Edit, Severity};
use nalgebra::Vector3;
use std::collections::BTreeSet;

/// Smaller displacements are not written, m: half the last digit of a position.
const NO_MOVE: f64 = 5e-8;
/// Zone that a corner may get instead of a larger one, mm: the smallest one of RAPID.
const SMALLEST_ZONE_MM: f64 = 0.3;
/// Most rounds of the search for a command that the text allows.
const MOST_ROUNDS: usize = 6;
/// Number of lines that a message names.
const NAMED: usize = 5;

/// A program that was corrected for its driven path.
///
/// # Examples
/// ```
/// use deflex_correct::DrivenCompensation;
///
/// /// Whether the program may be written.
/// fn is_good(done: &DrivenCompensation) -> bool {
///     done.corrected.failures.is_empty()
/// }
/// ```
#[derive(Debug)]
pub struct DrivenCompensation {
    /// The program before the deflection is corrected: [`Corrected::rewritten`] has edits of its sources.
    pub program: Program,
    /// The results; the rows are those of the original program.
    pub corrected: Corrected,
}

/// Corrects a program so that the path that the cell's controller drives, and the loaded arm takes, stays within a tolerance (m)
/// of the programmed one.
///
/// # Errors
/// As [`compensate`](super::compensate) and [`Course::new`]; a cell without the law of its controller; CL data, which are not edited.
///
/// # Examples
/// ```no_run
/// use deflex_correct::{Options, compensate_driven};
/// use deflex_cell::Cell;
/// use deflex_program::rapid;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("cell.toml")?))?; // with [controller.path]
/// let program = rapid::read(vec![Source::new("part.mod", std::fs::read("part.mod")?)], vec![])?;
/// let done = compensate_driven(&program, &cell, &Options::default(), 5e-5)?;
/// println!("{:?}", done.corrected.driven);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn compensate_driven(
    program: &Program,
    cell: &Cell,
    options: &Options,
    tolerance: f64,
) -> Result<DrivenCompensation, Vec<Diagnostic>> {
    let name = program.sources.first().map_or("", |source| &source.name);
    let refuse = |code, message: &str, help: &str| vec![Diagnostic::error(code, name, message.to_owned()).help(help)];
    let Some(path) = cell.controller.path else {
        let message = "the path that the controller drives is not known: the cell has no [controller.path]";
        let help = "record the axes while programs run, and find the law: deflex identify --log PROGRAM LOG.csv";
        return Err(refuse("path.no-law", message, help));
    };
    if program.language == Language::Cl {
        let message = "--max-path-error edits a program, and CL data are posted anew";
        let help = "post them with a cell that corrects nothing, then correct the posted program";
        return Err(refuse("path.cl", message, help));
    }
    let prepared = Prepared::new(program, cell, options)?;
    let course = Course::new(program, cell, &prepared)?;
    let given = Given { program, cell, options, prepared: &prepared, course: &course, path, tolerance };
    let shaped = given.shaped()?;
    // Targets that are inserted for the deflection are inserted between those of the shaped program.
    let targets = given.targets(&shaped.program, &given.origins(&shaped, &[]));
    let loads = Some(OriginalLoads { prepared: &prepared, targets: &targets });
    let mut corrected = compensate_in(Context { loads, ..Context::whole(&shaped.program, cell, options) })?;
    if !corrected.failures.is_empty() {
        return Ok(DrivenCompensation { program: shaped.program, corrected });
    }
    let before = given.judged(program, &[])?;
    let edits = corrected.rewritten.as_ref().map_or(&[][..], |rewritten| &rewritten.edits);
    let written = edited(&shaped.program, edits)?;
    let further = inserted_before(&shaped.program, corrected.rewritten.as_ref());
    let after = given.judged(&written, &given.origins(&shaped, &further))?;
    given.complete(&shaped, &mut corrected, &before, &after);
    Ok(DrivenCompensation { program: shaped.program, corrected })
}

/// The original program, and the options of the run.
struct Given<'a> {
    program: &'a Program,
    cell: &'a Cell,
    options: &'a Options,
    prepared: &'a Prepared,
    course: &'a Course,
    path: ControllerPath,
    tolerance: f64,
}

/// The program with which the controller drives the programmed path.
struct ShapedProgram {
    program: Program,
    command: ShapedCommand,
    /// Number of targets inserted before each waypoint.
    inserted: Vec<usize>,
    /// Targets whose displacement could not be written, with the reason.
    kept: Vec<(usize, Reason)>,
}

impl Given<'_> {
    /// Finds the command and writes it; repeats this without the changes that the text does not allow.
    fn shaped(&self) -> Result<ShapedProgram, Vec<Diagnostic>> {
        let Self { program, course, .. } = *self;
        let mut fixed: BTreeSet<usize> = program.bound_to_point().into_iter().collect();
        let mut kept: Vec<_> = fixed.iter().map(|i| (*i, Reason::DeclarationUsedElsewhere)).collect();
        let mut closed = BTreeSet::new();
        let mut round = 0;
        loop {
            round += 1;
            let freedom = self.freedom(&fixed, &closed);
            let robot = &self.cell.arm.robot;
            let wanted = Wanted { tolerance: self.tolerance, error_share: self.path.error_share };
            let command = shape(robot, &self.path.law, &course.waypoints, &freedom, wanted);
            let command = command.map_err(|error| self.refused(error))?;
            let (changes, inserts) = (self.changes(&command.motions), self.inserts(&command.motions));
            let allow_clones = self.options.allow_clones;
            let rewrite = RewriteOptions { allow_clones, ..RewriteOptions::default() };
            let mut rewritten = program.rewrite(&changes, &inserts, &rewrite);
            let before = fixed.len() + closed.len();
            fixed.extend(rewritten.kept.iter().map(|(i, _)| *i));
            closed.extend(rewritten.not_inserted.iter().map(|(i, _)| *i));
            kept.append(&mut rewritten.kept);
            if fixed.len() + closed.len() > before && round < MOST_ROUNDS {
                continue;
            }
            self.edit_zones(&command.motions, &mut rewritten);
            let written = edited(program, &rewritten.edits)?;
            let mut inserted = vec![0; course.waypoints.len()];
            for (insert, _) in inserts.iter().zip(&rewritten.inserted).filter(|(_, written)| written.is_some()) {
                if let Ok(waypoint) = course.targets.binary_search(&insert.before) {
                    inserted[waypoint] += 1;
                }
            }
            kept.sort_unstable();
            kept.dedup();
            return Ok(ShapedProgram { program: written, command, inserted, kept });
        }
    }

    /// The allowed changes of each motion.
    fn freedom(&self, fixed: &BTreeSet<usize>, closed: &BTreeSet<usize>) -> Vec<Freedom> {
        let Self { program, prepared, course, .. } = *self;
        let wanted = |passing: Passing| {
            let wanted: Vec<_> = course.targets.iter().map(|i| (*i, passing)).collect();
            program.passing_edits(&wanted).into_iter().map(|edit| edit.is_some())
        };
        let (stops, smaller) = (wanted(Passing::Stop), wanted(Passing::Zone(SMALLEST_ZONE_MM)));
        let refused = program.insertions_refused(&course.targets);
        let moves = |i: usize| {
            let target = &program.targets[i];
            !fixed.contains(&i)
                && matches!(target.editable, Editable::Pose | Editable::Position)
                && matches!(target.goal, Goal::Pose { .. })
        };
        course
            .targets
            .iter()
            .zip(course.counting(prepared))
            .zip(stops.zip(smaller).zip(refused))
            .map(|((&i, counts), ((stop, smaller), refused))| Freedom {
                // Nothing holds the end of a motion whose path does not count: it could go anywhere.
                end: counts && moves(i),
                via: counts && i.checked_sub(1).is_some_and(moves),
                smaller_zone: smaller.then_some(1e-3 * SMALLEST_ZONE_MM),
                stop,
                // A point on a segment that does not count could lead the tool anywhere.
                added_zone: self.added_zone(i).filter(|_| {
                    counts && self.options.subdivide.is_some() && !closed.contains(&i) && refused.is_none()
                }),
                counts,
            })
            .collect()
    }

    /// Zone (m) of a point that is inserted before a target; `None` if the arm would come to rest there, or if the zone is not known.
    fn added_zone(&self, before: usize) -> Option<f64> {
        zone_of(self.program.inserted_passing(before), self.path.zone)
    }

    fn refused(&self, error: DriveError) -> Vec<Diagnostic> {
        self.course.refused(self.program, error)
    }

    /// The changes of the program's points; `None` for those that stay.
    fn changes(&self, motions: &[CommandedMotion]) -> Vec<Option<Change>> {
        let mut changes: Vec<Option<Change>> = vec![None; self.program.targets.len()];
        for (motion, &i) in motions.iter().zip(&self.course.targets) {
            let back = self.prepared.base_from_wobj(i).rotation.inverse();
            let mut move_to = |i: usize, shift: &Vector3<f64>| {
                let Goal::Pose { position_mm, .. } = self.program.targets[i].goal else { return };
                if shift.norm() >= NO_MOVE {
                    let position_mm = (Vector3::from(position_mm) + 1e3 * (back * shift)).into();
                    changes[i] = Some(Change { position_mm, quat: None, conf: None, external: None });
                }
            };
            move_to(i, &motion.end);
            if let Some(via) = i.checked_sub(1).filter(|_| motion.via != Vector3::zeros()) {
                move_to(via, &motion.via);
            }
        }
        changes
    }

    fn inserts(&self, motions: &[CommandedMotion]) -> Vec<Insert> {
        let mut inserts = Vec::new();
        for (motion, &i) in motions.iter().zip(&self.course.targets) {
            let wobj_from_base = self.prepared.base_from_wobj(i).inverse();
            // The room for the zone with which the path was predicted, and not for a larger one.
            let room_mm = 2e3 * self.added_zone(i).unwrap_or(0.0);
            for added in &motion.added {
                let pose = frames::millimetres(&(wobj_from_base * added.base_from_tcp));
                inserts.push(Insert::line(i, pose, room_mm));
            }
        }
        inserts
    }

    /// Adds the edits of zones. A statement that runs more than once gets the smallest zone that any of its runs needs.
    fn edit_zones(&self, motions: &[CommandedMotion], rewritten: &mut Rewritten) {
        let Self { program, course, .. } = *self;
        let mut wanted = Vec::new();
        for ((motion, waypoint), &i) in motions.iter().zip(&course.waypoints).zip(&course.targets) {
            match (motion.zone, waypoint.zone) {
                (None, Some(_)) => wanted.push((i, Passing::Stop)),
                (Some(zone), Some(programmed)) if zone < programmed => {
                    wanted.push((i, Passing::Zone(1e3 * zone + 1e-9)))
                }
                _ => {}
            }
        }
        // Stops first: of two edits of one statement, the first one counts.
        wanted.sort_by_key(|(i, passing)| (*passing != Passing::Stop, *i));
        let mut edits: Vec<(usize, Edit)> = Vec::new();
        for ((i, _), edit) in wanted.iter().zip(program.passing_edits(&wanted)) {
            let source = usize::from(program.targets[*i].source);
            let Some(edit) = edit else { continue };
            if edits.iter().all(|(at, other)| (*at, other.span) != (source, edit.span)) {
                edits.push((source, edit));
            }
        }
        for (source, edit) in edits {
            rewritten.edits[source].push(edit);
        }
        for edits in &mut rewritten.edits {
            edits.sort_by_key(|edit| (edit.span.start, edit.span.end));
        }
    }

    /// For each motion of the written program, the waypoint of the original program to whose segment it belongs. `further` has the number of
    /// targets inserted before each motion of the shaped program.
    fn origins(&self, shaped: &ShapedProgram, further: &[usize]) -> Vec<usize> {
        let shaped_motions = shaped.inserted.iter().enumerate().flat_map(|(i, inserted)| vec![i; inserted + 1]);
        shaped_motions.enumerate().flat_map(|(k, i)| vec![i; further.get(k).copied().unwrap_or(0) + 1]).collect()
    }

    /// The target of the original for each target of a program whose motions belong to the waypoints in `origins`.
    fn targets(&self, program: &Program, origins: &[usize]) -> Vec<OriginalTarget> {
        OriginalLoads::targets(self.program, program, &original_waypoint(origins))
    }

    /// Compares the driven path of a program with the path of the original. Each motion belongs to the waypoint in `origins`, which is empty
    /// for the original itself.
    fn judged(&self, program: &Program, origins: &[usize]) -> Result<DrivenSegments, Vec<Diagnostic>> {
        let targets = self.targets(program, origins);
        let loads = Some(OriginalLoads { prepared: self.prepared, targets: &targets });
        let context = Context { loads, ..Context::whole(program, self.cell, self.options) };
        let mut prepared = Prepared::of(context)?;
        let course = Course::new(program, self.cell, &prepared)?;
        let path = loaded_along(&mut prepared, course, context, Sampling::Sparse)?;
        Ok(driven_segments(self.prepared, self.course, &self.cell.arm.robot, &path, &original_waypoint(origins)))
    }

    /// Completes the rows, and adds the notes and the figures.
    fn complete(
        &self,
        shaped: &ShapedProgram,
        corrected: &mut Corrected,
        before: &DrivenSegments,
        after: &DrivenSegments,
    ) {
        let Self { program, course, prepared, .. } = *self;
        // Ordinals of the original program, increased by the number of inserted targets.
        let mut ordinals: Vec<(u32, usize)> = Vec::new();
        let mut more = 0;
        for (waypoint, inserted) in shaped.inserted.iter().enumerate() {
            let target = course.targets[waypoint];
            more += *inserted as u32; // far fewer than motions
            ordinals.push((program.targets[target].ordinal + more, waypoint));
        }
        let inserted: usize = shaped.inserted.iter().sum();
        let mut more = 0;
        let mut at = 0;
        let mut rows: Vec<Row> = Vec::with_capacity(corrected.rows.len());
        for mut row in std::mem::take(&mut corrected.rows) {
            while at < ordinals.len() && ordinals[at].0 < row.target {
                at += 1;
            }
            let Some((_, waypoint)) = ordinals.get(at).filter(|(ordinal, _)| *ordinal == row.target) else {
                // A target inserted before the next waypoint, or a motion that is known only at run time.
                let next = ordinals.get(at).map(|(_, waypoint)| *waypoint);
                let is_inserted = next.is_some_and(|waypoint| {
                    let from = ordinals[at].0 - u32::try_from(shaped.inserted[waypoint]).unwrap_or(0);
                    (from..ordinals[at].0).contains(&row.target)
                });
                if !is_inserted {
                    row.target -= more;
                    rows.push(row);
                }
                continue;
            };
            let target = &program.targets[course.targets[*waypoint]];
            more = ordinals[at].0 - target.ordinal;
            if row.is_solved() {
                let programmed = 1e3 * prepared.points[course.targets[*waypoint]].wobj_from_tcp.translation.vector;
                let shift = Vector3::from(row.position_mm) - programmed;
                row.correction_mm = (Vector3::from(row.correction_mm) + shift).into();
                row.position_mm = programmed.into();
                row.path = after.segments[*waypoint].or(row.path);
            }
            (row.target, row.line) = (target.ordinal, target.line);
            rows.push(row);
        }
        let most = self.cell.limits.max_correction;
        for row in rows.iter().filter(|row| row.is_solved() && 1e-3 * row.correction_norm_mm() > most) {
            let Some(target) = program.targets.iter().find(|target| target.is_end() && target.ordinal == row.target)
            else {
                continue;
            };
            let Refusal { code, message, help } = too_large(1e-3 * row.correction_norm_mm(), most);
            let message = format!("target {}: {message}", row.target);
            corrected.failures.push(program.error_at(target, code, message).help(help));
        }
        corrected.rows = rows;
        corrected.inserted += inserted;
        corrected.driven = Some(DrivenSummary {
            programmed: before.figures,
            corrected: Some(after.figures),
            tolerance_mm: Some((1e9 * self.tolerance).round() / 1e6),
        });
        corrected.notes.extend(self.notes(shaped, before, after));
    }

    fn notes(&self, shaped: &ShapedProgram, before: &DrivenSegments, after: &DrivenSegments) -> Vec<Diagnostic> {
        let Self { program, course, .. } = *self;
        let name = program.sources.first().map_or("", |source| &source.name);
        // The millimetres of the option, without the rounding of their conversion.
        let allowed = (1e9 * self.tolerance).round() / 1e6;
        let (was, is) = (before.figures, after.figures);
        let mut notes = course.notes(program, self.cell);
        let stops = shaped.command.motions.iter().zip(&course.waypoints);
        let stops = stops.filter(|(motion, waypoint)| motion.zone.is_none() && waypoint.zone.is_some()).count();
        let added: usize = shaped.inserted.iter().sum();
        let counted = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
        let seconds = is.run_time_s - was.run_time_s;
        let share = if was.run_time_s > 0.0 { 100.0 * seconds / was.run_time_s } else { 0.0 };
        let mut message = format!(
            "the driven, loaded path was up to {:.3} mm off and is up to {:.3} mm off; the run takes {:.2} s in place of {:.2} s \
             ({share:+.1} %)",
            was.max_mm, is.max_mm, is.run_time_s, was.run_time_s
        );
        if added > 0 {
            message += &format!("; added at corners: {}", counted(added, "target"));
        }
        if stops > 0 {
            message += &format!("; the motion now comes to rest at {}", counted(stops, "corner"));
        }
        let mut note = Diagnostic::error("path.kept", name, message).severity(Severity::Note);
        if stops > 0 {
            note = note.help(match self.options.subdivide {
                None => "`--subdivide MM` may add targets at these corners, which costs less time than a stop",
                Some(_) => {
                    "a law that explains the controller better (error_share of [controller.path]) allows more corners without a stop: fit \
                     it to logs at this feed and these zones"
                }
            });
        }
        notes.push(note);
        if course.unstated > 0 {
            let message = format!(
                "--max-path-error {allowed} is kept only if the robot comes to rest where the program does not say how near it passes: at {}",
                counted(course.unstated, "point")
            );
            notes.push(
                Diagnostic::error("path.tolerance", name, message)
                    .severity(Severity::Warning)
                    .help("write a predefined zone there, or state the radius in the cell: [controller.path] zone_mm"),
            );
        }
        if is.max_mm > allowed {
            let over: Vec<usize> = (0..after.segments.len())
                .filter(|i| after.counts[*i] && after.segments[*i].is_some_and(|segment| segment.max_mm > allowed))
                .collect();
            let lines: Vec<String> =
                over.iter().take(NAMED).map(|i| program.targets[course.targets[*i]].line.to_string()).collect();
            let more = if over.len() > NAMED { ", …" } else { "" };
            let message = format!(
                "--max-path-error {allowed} is not kept on the path to {} of {} targets (lines {}{more}): {:.3} mm can be kept",
                over.len(),
                after.segments.len(),
                lines.join(", "),
                is.max_mm
            );
            let help = match shaped.kept.first() {
                Some((_, why)) => format!("some targets there cannot be moved: {why}; a lower feed there keeps the path better"),
                None if shaped.command.after.largest <= self.tolerance => {
                    "without the cutting force the path is kept: the deflection changes between the targets. `--subdivide` with fewer \
                     millimetres corrects it in more places; where the whole force sets in at once, ramp into the material"
                        .to_owned()
                }
                None => "a lower feed there keeps the path better".to_owned(),
            };
            notes.push(Diagnostic::error("path.tolerance", name, message).severity(Severity::Warning).help(help));
        }
        notes
    }
}

/// A program with edits of its sources, read again.
fn edited(program: &Program, edits: &[Vec<Edit>]) -> Result<Program, Vec<Diagnostic>> {
    let mut own = program.edited(edits);
    let context = own.split_off(program.written);
    read(program.language, own, context, &ReadOptions { cl: &ClOptions::default(), look: false })
}

/// Number of motions that a correction inserted before each motion of a program.
fn inserted_before(program: &Program, rewritten: Option<&Rewritten>) -> Vec<usize> {
    let ends: Vec<usize> = (0..program.targets.len()).filter(|i| program.targets[*i].is_end()).collect();
    let mut inserted = vec![0; ends.len()];
    let written = rewritten.into_iter().flat_map(|rewritten| rewritten.before.iter().zip(&rewritten.inserted));
    for (before, _) in written.filter(|(_, pose)| pose.is_some()) {
        if let Ok(motion) = ends.binary_search(before) {
            inserted[motion] += 1;
        }
    }
    inserted
}
