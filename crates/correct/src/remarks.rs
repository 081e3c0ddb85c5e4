//! Notes and warnings about a program.

use super::context::Context;
use super::contradictions::contradictions;
use super::correction::Correction;
use super::laws::Laws;
use super::messages::Repeated;
use super::{KeptReason, Prepared};
use deflex_effects::Need;
use deflex_program::{Goal, Language, Mark, Predecessor, Target, Tool};
use deflex_robot::StartedFrom;
use deflex_text::{Diagnostic, Severity, Span};

/// The notes about chunk `number` of a run. A frame may occur first in any chunk; it is reported once.
pub(super) fn notes(context: Context<'_>, prepared: &Prepared, number: usize) -> Vec<Diagnostic> {
    let mut notes = if number == 0 { notes_of_all(context, prepared) } else { Vec::new() };
    notes.extend(contradictions(context.program, context.cell));
    notes
}

/// The notes about a run, each once.
fn notes_of_all(Context { program, cell, .. }: Context<'_>, prepared: &Prepared) -> Vec<Diagnostic> {
    let mut notes = program.diagnostics.clone();
    notes.extend(prepared.notes.iter().cloned());
    if let (StartedFrom::NearestHome, Some(first)) = (prepared.started, program.targets.first()) {
        let said_by = program.language.about().start;
        let how = format!(
            "{said_by} which configuration the arm has at the first target: deflex takes the one nearest to home"
        );
        let note = program.error_at(first, "robot.start", how).severity(Severity::Note);
        notes.push(note.help("give `[robot] start_deg` in the cell"));
    }
    if !program.language.about().states_load && cell.arm.weighs_payload() {
        let is_light = |tool: &&Tool| tool.data.is_some() && !cell.tools.contains_key(&tool.name.to_ascii_uppercase());
        notes.extend(program.tools.iter().filter(is_light).map(|tool| {
            let message = format!("the program does not say the mass of `{}`: taken as 0 kg", tool.name);
            let note = Diagnostic::error("program.no-mass", "", message).severity(Severity::Note);
            note.help(format!("declare `[tools.\"{}\"]` with its mass in the cell", tool.name))
        }));
    }
    for kind in &cell.controller.left_out {
        let message = format!("effect `{kind}` is left out: the controller corrects it (`[controller] compensates`)");
        notes.push(Diagnostic::error("cell.controller", "", message).severity(Severity::Note));
    }
    notes
}

/// The warnings that many targets may share.
pub(super) fn repeated(context: Context<'_>, prepared: &Prepared) -> Repeated {
    let mut repeated = Repeated::default();
    doubtful_cuts(context, prepared, &mut repeated);
    unweighed_loads(context, &mut repeated);
    uncertain_sums(context, &mut repeated);
    unsolved(context, prepared, &mut repeated);
    repeated
}

/// Warns of motions for which neither the program nor the cell says whether they cut.
fn doubtful_cuts(Context { program, cell, options, .. }: Context<'_>, prepared: &Prepared, repeated: &mut Repeated) {
    if options.has_force_table(cell) {
        return;
    }
    for (target, point) in program.targets.iter().zip(&prepared.points).filter(|(target, _)| target.is_end()) {
        if Laws::lacks_speed(cell, target) {
            let (why, so) = match program.language {
                Language::Cl => ("no FEDRAT gives a feed here", "counts as air"),
                _ => ("the speed is known only at run time", "is kept"),
            };
            let message = format!("{why}: `max_cutting_feed_mm_s` cannot decide whether this motion cuts, and it {so}");
            let [cut, air] = [Mark::Cut, Mark::Air].map(|mark| program.language.mark(mark));
            let warning = program.error_at(target, "cut.unknown-speed", message).severity(Severity::Warning);
            repeated.add(warning.help(format!("mark the motion `{cut}` or `{air}`")));
        }
        if point.plunges {
            let message = "this motion feeds along the tool axis, whose force [cut] does not describe: the force of the \
                           previous cut is used, and no force before the first one";
            let air = program.language.mark(Mark::Air);
            let help = format!(
                "[stock] with `mode = \"stock\"` computes it from the stock; `{air}` marks a motion that cuts nothing"
            );
            repeated.add(program.error_at(target, "cut.plunge", message).severity(Severity::Note).help(help));
        }
    }
}

/// Notes loads on which gravity does not act, if the cell has an effect of gravity.
fn unweighed_loads(Context { program, cell, .. }: Context<'_>, repeated: &mut Repeated) {
    if !cell.arm.weighs_payload() {
        return;
    }
    for target in program.targets.iter().filter(|target| target.is_end() && target.extra_load) {
        let message = "a load in addition to that of the tool (`GripLoad`, `\\TLoad`) is ignored: gravity acts on the mass in \
                       the tooldata";
        let warning = program.error_at(target, "rapid.load", message).severity(Severity::Warning);
        repeated.add(warning.help("give the tool's tooldata the whole load where it holds for all of the program"));
    }
}

/// Warns that wear, creep or heat is not known where it is not known which motions come before.
fn uncertain_sums(Context { program, cell, .. }: Context<'_>, repeated: &mut Repeated) {
    let arm = &cell.arm;
    if !(arm.needs(Need::CutLength) || arm.needs(Need::Time) || arm.follows_load()) {
        return;
    }
    let is_uncertain = |target: &&Target| target.is_end() && target.predecessor == Predecessor::Unknown;
    for target in program.targets.iter().filter(is_uncertain) {
        let message = "which motions come before this one is known only at run time, and an effect of the cell grows with \
                       the length cut or with time: each motion counts once";
        let warning = program.error_at(target, "effect.uncertain-sum", message).severity(Severity::Warning);
        repeated.add(warning.help("write loops with known numbers of rounds, or leave the effect out of the cell"));
    }
}

/// Reasons why targets are not solved, if the user can remove them.
fn unsolved(Context { program, .. }: Context<'_>, prepared: &Prepared, repeated: &mut Repeated) {
    let mut warn = |reason: KeptReason, place: MotionInText| {
        let Some(help) = reason.help(program.language) else { return };
        let message = format!("{reason}: the target stays where it is and is not solved");
        let source = &program.sources[usize::from(place.source)];
        let warning = Diagnostic::error("target.kept", "", message).on_line(source, place.span, place.line);
        repeated.add(warning.severity(Severity::Warning).help(help));
    };
    for (target, point) in program.targets.iter().zip(&prepared.points).filter(|(target, _)| target.is_end()) {
        if let Some(reason) = point.unsolved {
            warn(reason, MotionInText { source: target.source, span: target.span, line: target.line });
        }
    }
    for motion in &program.unknown {
        warn(motion.reason.into(), MotionInText { source: motion.source, span: motion.span, line: motion.line });
    }
}

/// Warns of blends that overlap in the corrected program, if the controller skips such motions: "If the blend region of this move overlaps with
/// the blend radius of previous or following waypoints, this move will be skipped", URScript Manual, movel.
pub(super) fn overlapping_blends(
    Context { program, .. }: Context<'_>,
    correction: &Correction,
    repeated: &mut Repeated,
) {
    if !program.language.about().skips_overlapping_blends {
        return;
    }
    let is_located = |i: &usize| program.targets[*i].is_end() && matches!(program.targets[*i].goal, Goal::Pose { .. });
    let ends: Vec<usize> = (0..program.targets.len()).filter(is_located).collect();
    for (&before, &i) in ends.iter().zip(ends.iter().skip(1)) {
        let (from, to) = (&program.targets[before], &program.targets[i]);
        let Some(blend_mm) = program.zone_mm(before) else { continue };
        let sum_mm = blend_mm + program.zone_mm(i).unwrap_or(0.0);
        let distance_mm = (correction.written_mm(i) - correction.written_mm(before)).norm();
        if from.wobj == to.wobj && to.predecessor == Predecessor::Previous && sum_mm > distance_mm {
            let message = "the blends of this motion and of the one before overlap: the controller skips such a motion";
            let warning = program.error_at(to, "program.blends-overlap", message).severity(Severity::Warning);
            repeated.add(warning.help("make r at most half of the distance to the points before and after"));
        }
    }
}

/// A motion in the text: index into [`Program::sources`](deflex_program::Program::sources), bytes of the instruction, and its line
/// from 1.
struct MotionInText {
    source: u16,
    span: Span,
    line: u32,
}

/// Warnings about inserted targets; `before` is the zone of the target before the first one of the program, mm.
pub(super) fn insertions(
    Context { program, .. }: Context<'_>,
    correction: &Correction,
    before: Option<f64>,
    repeated: &mut Repeated,
) {
    let Some(rewritten) = &correction.rewritten else { return };
    let mut warn = |i: usize, code, message: String, help: &str| {
        repeated.add(program.error_at(&program.targets[i], code, message).severity(Severity::Warning).help(help));
    };
    for &(i, reason) in &rewritten.not_inserted {
        let message = format!("no target can be inserted here: {reason}");
        warn(
            i,
            "subdivide.not-inserted",
            message,
            "the error between the targets stays: see the column remaining_path_mm of the report",
        );
    }
    let zones = |i: usize| {
        let start = program.targets[..i].iter().rposition(Target::is_end);
        [program.zone_mm(i), start.map_or(before, |start| program.zone_mm(start))]
    };
    let inserted = correction.inserts.iter().zip(&rewritten.inserted).filter(|(_, inserted)| inserted.is_some());
    for together in inserted.map(|(insert, _)| insert).collect::<Vec<_>>().chunk_by(|a, b| a.before == b.before) {
        let i = together[0].before;
        let widest = zones(i).into_iter().flatten().fold(0.0, f64::max);
        if together.iter().any(|insert| widest > insert.room_mm) {
            let message = "the zone here, or at the target before, is wider than the distance to the inserted target";
            let help = "the controller rounds there, which is not modelled: write `fine` or a smaller zone";
            warn(i, "subdivide.zone", message.to_owned(), help);
        }
    }
}
