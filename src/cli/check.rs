//! `check`: is each target within tolerance, reachable and convergent?

use super::against::Originals;
use super::args::{Check, CheckFormat, Form};
use super::piped::{Piped, jobs};
use super::predicted::{self, Batch, Passed, Predicted, Question};
use super::report;
use super::run::each;
use super::setup::setup;
use super::{Answer, Outcome, message, progress};
use crate::session::input::Context;
use crate::session::job::Job;
use crate::session::output::{Outputs, one_thing};
use crate::session::read::both;
use crate::session::report::{Noticed, Rows, pretty};
use crate::session::setup::Setup;
use deflex::correct::{Judged, KeptCount, KeptReason, Messages, Row, Summary, WayFault, compensate, predict};
use deflex::program::{Language, Program, Role, Target};
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::report::{
    CheckFile, Digest, FileSummary, Findings, Judgement, Verdict, Verdicts, check_json, check_text, junit, kept_text,
    sarif,
};
use deflex::text::{Diagnostic, Severity};
use indicatif::ProgressBar;
use std::sync::Arc;

/// Refusals that are findings about the program, not failures of the run.
const ABOUT_THE_PROGRAM: [&str; 1] = ["robot.unreachable"];

pub(super) fn run(args: &Check) -> Outcome {
    let (form, kind) = formats(args)?;
    let context = Context::of(&args.context)?;
    let piped = Piped::new(&args.inputs)?;
    let jobs = jobs(piped.as_ref(), &args.inputs, kind, args.reports.keep_going);
    let (mut setup, (jobs, failed)) = both(setup(&args.model, context, args.correct, &args.reports), jobs)?;
    // The cell has been read for this run only, so it can still be changed.
    if let (Some(most), Some(cell)) =
        (args.max_correction.filter(|_| args.against.is_none()), Arc::get_mut(&mut setup.cell))
    {
        cell.cell.limits.max_correction = 1e-3 * most;
    }
    // The verdicts in words make room for a report on stdout.
    let has_report = args.reports.to_stdout() > 0;
    one_thing(args.reports.to_stdout() + usize::from(!has_report || form != Form::Text))?;
    let originals = Originals::new(args.against.as_deref(), &jobs, kind)?;
    let mut outputs = Outputs::default();
    let batch = Batch {
        setup: &setup,
        originals: &originals,
        outputs: &outputs,
        report: args.reports.report.as_deref(),
        path: args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Check, jobs.len())),
        programs: jobs.len(),
    };
    let (checked, failed) =
        each(jobs, (args.common.quiet, args.reports.keep_going), failed, |job, bar| one(args, &batch, job, bar))
            .map_err(|errors| setup.failed(errors))?;
    let (mut files, mut rows, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    let mut printed = setup.notes();
    for Checked { file, outputs: staged, rows: report, path, notes } in checked {
        // Faults of the path between targets become findings below, so the notes about them are left out.
        let is_new = |note: &Diagnostic| !WayFault::is_code(note.code) && !printed.contains(note);
        printed.extend(notes.into_iter().filter(is_new).collect::<Vec<_>>());
        outputs.append(staged)?;
        files.push(file);
        rows.extend(report);
        paths.extend(path);
    }

    let text = match form {
        Form::Json => pretty(&answer_json(&setup, &files))?,
        Form::Junit => junit(&files),
        Form::Sarif => pretty(&sarif(&files))?,
        Form::Text => check_text(&files),
    };
    if !has_report {
        outputs.add_summary(&text);
    }
    outputs.add_report(args.reports.json.as_ref(), || pretty(&answer_json(&setup, &files)))?;
    if let Some(path) = args.reports.report.as_ref().filter(|_| !rows.is_empty()) {
        report::joined(&mut outputs, path, &rows)?;
    }
    let (cell, scene) = (setup.cell.origin(), Some(&setup.cell.cell));
    let tolerance_mm = Some(args.max_error);
    let page = PathPage { kind: PathKind::Check, cell: &cell, programs: &paths, scene, tolerance_mm };
    outputs.add_report(args.reports.html.as_ref(), || Ok(page.html()))?;
    outputs.commit()?;
    message::print(&setup.cell.own(printed), args.common.quiet);
    if has_report && !args.common.quiet {
        message::say(&[text]);
    }
    if !failed.is_empty() {
        return Err(failed);
    }
    Ok(if files.iter().all(CheckFile::passed) { Answer::Yes } else { Answer::No })
}

/// The JSON of all findings, with the origins of the inputs.
fn answer_json(setup: &Setup, files: &[CheckFile]) -> serde_json::Value {
    let mut all = check_json(files);
    all["cell"] = serde_json::json!(setup.cell.origin());
    all
}

/// Form of the answer and language of the input. `--format` is an old option that can set either.
fn formats(args: &Check) -> Result<(Form, Option<Language>), Vec<Diagnostic>> {
    let (mut form, mut input) = (args.output_format, args.input_format);
    for format in &args.format {
        let taken = match format {
            CheckFormat::Input(language) => input.replace(*language).is_some(),
            CheckFormat::Form(of) => form.replace(*of).is_some(),
        };
        if taken {
            return Err(Diagnostic::error(
                "usage.format",
                "",
                "the form of the answer, or the kind of the input, is given twice",
            )
            .help("give --output-format once and --input-format once")
            .into());
        }
    }
    Ok((form.unwrap_or_default(), input))
}

/// Result of checking one program.
struct Checked {
    file: CheckFile,
    /// Output files that are already staged.
    outputs: Outputs,
    /// Rows for the common report; `None` if no report is wanted, or if it is staged already.
    rows: Option<Rows>,
    /// Summary and path for `--html`.
    path: Option<(FileSummary, PathTrace)>,
    /// Targets that could not be judged, and notes about how the program was read.
    notes: Vec<Diagnostic>,
}

fn one(args: &Check, batch: &Batch<'_>, job: Job, bar: &ProgressBar) -> Result<Checked, Vec<Diagnostic>> {
    let findings = |judged: Judged<'_>| findings(args, judged);
    let named = args.reports.json.is_some() || args.reports.html.is_some() || formats(args)?.0 == Form::Json;
    let origins = if named { job.origins()? } else { Vec::new() };
    job.marked()?;
    let question = Question { corrects: corrects(args), findings: &findings };
    let mut checked = match predicted::streamed(batch, &job, bar, Some(question))? {
        Some(predicted) => streamed(args, batch, &job.name, predicted),
        None => whole(args, batch, job, bar),
    }?;
    if let Some((summary, _)) = &mut checked.path {
        summary.sources.clone_from(&origins);
    }
    checked.file.sources = origins;
    Ok(checked)
}

/// Whether the program is corrected so that `--max-correction` can judge the correction. With `--against` the
/// correction is known.
fn corrects(args: &Check) -> bool {
    args.max_correction.is_some() && args.against.is_none()
}

/// Result of a program that was checked chunk by chunk.
fn streamed(args: &Check, batch: &Batch<'_>, name: &str, predicted: Predicted) -> Result<Checked, Vec<Diagnostic>> {
    let Predicted { passed: Passed { streamed, digest, outputs, rows, path }, findings, unjudged } = predicted;
    let (found, judgement, sum) = if streamed.refused.is_empty() {
        let targets = streamed.last as usize;
        let judgement = judgement(args, targets, &streamed.summary, (unjudged, digest));
        (findings.into_parts(), judgement, streamed.summary)
    } else {
        let (refused, more) = streamed.refused.into_parts();
        let judgement = refused_judgement(args, streamed.last as usize);
        ((about_the_program(batch, refused)?, more), judgement, Summary::default())
    };
    let notes = streamed.notes.into_iter().chain(not_judged(name, &judgement)).collect();
    let file = CheckFile::new(name, judgement, found);
    let path = path.map(|path| (FileSummary::of(name, &sum, &[]).with_findings(&file.findings, file.more), path));
    Ok(Checked { file, outputs, rows, path, notes })
}

/// The judgement of a program with this number of targets.
fn judgement(args: &Check, targets: usize, sum: &Summary, (unjudged, digest): (Findings, Digest)) -> Judgement {
    let (skipped, more_skipped) = unjudged.into_parts();
    let ways = Some(args.max_path_error.unwrap_or(args.max_error)).filter(|_| !args.at_targets);
    Judgement {
        targets,
        air: sum.air,
        unjudged: sum.unjudged.clone(),
        skipped,
        more_skipped,
        allows_unjudged: args.allow_unjudged,
        verdicts: Verdicts {
            targets: Verdict { limit_mm: Some(args.max_error), largest: digest.worst.into_iter().next() },
            ways: Verdict { limit_mm: ways, largest: digest.way },
            jumps: Verdict { limit_mm: args.max_jump, largest: digest.jump },
        },
    }
}

/// The judgement of a program that is refused because a target is out of reach: no target of it is judged.
fn refused_judgement(args: &Check, targets: usize) -> Judgement {
    let unjudged = vec![KeptCount { reason: KeptReason::ProgramRefused, count: targets }];
    Judgement { targets, unjudged, allows_unjudged: args.allow_unjudged, ..Judgement::default() }
}

/// Turns refusals into findings if all of them are about the program; otherwise returns them as errors.
fn about_the_program(batch: &Batch<'_>, refused: Vec<Diagnostic>) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
    let all = refused.iter().all(|error| ABOUT_THE_PROGRAM.contains(&error.code));
    if all && !refused.is_empty() { Ok(refused) } else { Err(batch.setup.cell.own(refused)) }
}

/// Checks a program that is held as a whole.
fn whole(args: &Check, batch: &Batch<'_>, job: Job, bar: &ProgressBar) -> Result<Checked, Vec<Diagnostic>> {
    let (name, setup) = (job.name.clone(), batch.setup);
    let original = batch.originals.of(&job, setup)?;
    let program = setup.program(job)?;
    let targets = program.targets.iter().filter(|target| target.role == Role::End).count() + program.unknown.len();
    let cell = &setup.cell.cell;
    let outputs = batch.outputs.sibling();
    let options = setup.options_followed(progress::of_one(bar, batch.programs).map(progress::cutting));
    let mut predicted = match predict(&program, cell, &options, original.as_ref()) {
        Ok(predicted) => predicted,
        Err(refused) => {
            let mut held = Messages::with_room(Findings::MOST);
            held.add(about_the_program(batch, refused)?);
            let judgement = refused_judgement(args, targets);
            let file = CheckFile::new(&name, judgement, held.into_parts());
            let nothing = FileSummary::of(&name, &Summary::default(), &[]).with_findings(&file.findings, file.more);
            let path = batch.path.clone().map(|path| (nothing, path));
            let rows = batch.rows(Some(Rows::new(&[])))?;
            return Ok(Checked { file, outputs, rows, path, notes: Vec::new() });
        }
    };
    let mut failures = std::mem::take(&mut predicted.failures);
    if corrects(args) {
        failures.extend(compensate(&program, cell, &options).map_err(|e| setup.cell.own(e))?.failures);
    }
    let (mut found, mut unjudged, mut digest) = (Findings::default(), Findings::default(), Digest::default());
    let (moved_mm, on_the_way) = (&predicted.moved_mm, &predicted.on_the_way);
    let judged = Judged { program: &program, rows: &predicted.rows, failures, moved_mm, on_the_way };
    let (skipped, wrong) = findings(args, judged).into_iter().partition(|found| found.severity != Severity::Error);
    found.add(wrong);
    unjudged.add(skipped);
    digest.take(&predicted.rows);
    let judgement = judgement(args, targets, &Summary::of(&predicted.rows), (unjudged, digest));
    let not_judged: Vec<Diagnostic> = not_judged(&name, &judgement).collect();
    let file = CheckFile::new(&name, judgement, found.into_parts());
    let rows = Rows::new(&predicted.rows);
    let path = batch.path.clone().map(|mut path| {
        rows.draw(&mut path, &predicted.rows);
        path.quote(|target, _| program.line_of(target));
        (FileSummary::new(&name, &predicted).with_findings(&file.findings, file.more), path)
    });
    let rows = batch.rows(Some(rows))?;
    let mut noticed = Noticed::new(setup.options.forces.as_ref(), None);
    noticed.take(&predicted.rows);
    let left_out = noticed.notes(&name)?;
    let notes = predicted.notes.into_iter().chain(left_out).chain(not_judged).collect();
    Ok(Checked { file, outputs, rows, path, notes })
}

/// One warning for each reason for which targets were not judged.
fn not_judged<'a>(name: &'a str, judgement: &'a Judgement) -> impl Iterator<Item = Diagnostic> + 'a {
    judgement.unjudged.iter().filter(|unjudged| unjudged.reason != KeptReason::ProgramRefused).map(move |unjudged| {
        let diagnostic = Diagnostic::error("check.not-judged", name, format!("not judged: {}", kept_text(unjudged)));
        diagnostic.severity(Severity::Warning).help(match judgement.allows_unjudged {
            true => "`deflex predict --report` names their lines",
            false => "declare in the cell what is missing; or let them pass unjudged with `--allow-unjudged`",
        })
    })
}

/// Findings in a program or a chunk of it: an error for each fault, and a warning for each target that is not judged.
fn findings(args: &Check, judged: Judged<'_>) -> Vec<Diagnostic> {
    let Judged { program, rows, failures, moved_mm, on_the_way } = judged;
    let place = Places::new(program);
    let mut findings = failures;
    for row in rows {
        let path = row.path.filter(|_| !args.at_targets).unwrap_or_default();
        let most = args.max_path_error.unwrap_or(args.max_error);
        if !row.is_solved() {
            findings.push(place.unjudged(row));
        } else if row.error_norm_mm() > args.max_error {
            findings.push(place.error(row, args.max_error));
        } else if path.way_mm > most {
            // The target itself has a finding already if its own error is too large.
            findings.push(place.path(row, path.way_mm, most));
        }
        if let Some(most) = args.max_jump.filter(|most| path.jump_mm > *most) {
            findings.push(place.jump(row, path.jump_mm, most));
        }
    }
    findings.extend(on_the_way.iter().map(|found| found.diagnostic(program)));
    if let Some(most) = args.max_correction {
        let moved = program.targets.iter().map(|target| target.ordinal).zip(moved_mm.iter().copied());
        findings.extend(moved.filter(|(_, mm)| *mm > most).map(|(target, mm)| place.correction(target, mm, most)));
    }
    findings
}

/// Finds the places of targets in the text, for messages.
struct Places<'a> {
    program: &'a Program,
    /// All targets, in running order.
    ends: Vec<&'a Target>,
}

impl<'a> Places<'a> {
    fn new(program: &'a Program) -> Self {
        Self { program, ends: program.targets.iter().filter(|target| target.role == Role::End).collect() }
    }

    fn error(&self, row: &Row, most: f64) -> Diagnostic {
        let message =
            format!("target {}: error of {:.4} mm, more than the {most} mm allowed", row.target, row.error_norm_mm());
        self.at(row.target, "check.max-error", message, "correct the program with `deflex compensate`")
    }

    fn path(&self, row: &Row, left: f64, most: f64) -> Diagnostic {
        let message = format!(
            "target {}: on the path to it the tip is {left:.4} mm off the programmed path, more than the {most} mm allowed",
            row.target
        );
        let help = "insert targets with `deflex compensate --subdivide MM`; `--max-path-error` is a limit for the paths alone, \
                    `--at-targets` leaves them unjudged";
        self.at(row.target, "check.max-path-error", message, help)
    }

    fn jump(&self, row: &Row, left: f64, most: f64) -> Diagnostic {
        let message = format!(
            "target {}: on the path to it the force sets in, ends or turns at once, and the tip is {left:.4} mm off the \
             programmed path there, more than the {most} mm allowed",
            row.target
        );
        let help = "lead in and out of the cut gently: no inserted target can be near enough to remove a jump";
        self.at(row.target, "check.max-jump", message, help)
    }

    fn unjudged(&self, row: &Row) -> Diagnostic {
        let message = format!("target {} is not judged: {}", row.target, row.reason());
        let help = "declare in the cell what is missing, or let it pass with `--allow-unjudged`";
        self.at(row.target, "check.not-judged", message, help).severity(Severity::Warning)
    }

    fn correction(&self, target: u32, mm: f64, most: f64) -> Diagnostic {
        let message = format!("target {target}: correction of {mm:.4} mm, more than the {most} mm allowed");
        self.at(target, "limits.max-correction", message, "check the cell that the correction was made with")
    }

    fn at(&self, ordinal: u32, code: &'static str, message: String, help: &str) -> Diagnostic {
        let diagnostic = Diagnostic::error(code, "", message).help(help);
        let end = self.ends.binary_search_by_key(&ordinal, |target| target.ordinal).ok().map(|i| self.ends[i]);
        let unknown = &self.program.unknown;
        let place = match (end, unknown.binary_search_by_key(&ordinal, |motion| motion.ordinal)) {
            (Some(target), _) => (target.source, target.span, target.line),
            (None, Ok(i)) => (unknown[i].source, unknown[i].span, unknown[i].line),
            (None, Err(_)) => return diagnostic,
        };
        diagnostic.on_line(&self.program.sources[usize::from(place.0)], place.1, place.2)
    }
}
