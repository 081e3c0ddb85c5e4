//! `check`: is each target within tolerance, reachable and convergent?

use super::against::Originals;
use super::args::{Check, CheckFormat, Form};
use super::files::both;
use super::input::Context;
use super::job::Job;
use super::output::{Outputs, one_thing};
use super::piped::{Piped, jobs};
use super::predicted::{self, Batch, Predicted, Question};
use super::report::{self, Noticed, Rows};
use super::run::each;
use super::setup::Setup;
use super::{Answer, Outcome, message};
use deflex::correct::{Judged, Messages, Row, Summary, WayFault, compensate, predict};
use deflex::program::{Language, Program, Role, Target};
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::report::{CheckFile, FileSummary, Findings, check_json, junit, sarif};
use deflex::text::{Diagnostic, Severity};
use indicatif::ProgressBar;
use std::path::Path;
use std::sync::Arc;

/// Refusals that are an answer about the program, not a failure of the run.
const ABOUT_THE_PROGRAM: [&str; 1] = ["robot.unreachable"];

pub(super) fn run(args: &Check) -> Outcome {
    let (form, kind) = formats(&args.format)?;
    let context = Context::of(&args.context)?;
    let piped = Piped::new(&args.inputs)?;
    let jobs = jobs(piped.as_ref(), &args.inputs, kind, args.reports.keep_going);
    let (mut setup, (jobs, failed)) = both(Setup::read(&args.model, context, args.correct, &args.reports), jobs)?;
    // Nobody else holds the cell yet.
    if let (Some(most), Some(cell)) =
        (args.max_correction.filter(|_| args.against.is_none()), Arc::get_mut(&mut setup.cell))
    {
        cell.cell.limits.max_correction = 1e-3 * most;
    }
    one_thing(1 + args.reports.to_stdout())?;
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
    let mut said = setup.notes();
    for Checked { file, outputs: staged, rows: report, path, notes } in checked {
        // What is wrong on the way is a finding here.
        let is_new = |note: &Diagnostic| !WayFault::is_code(note.code) && !said.contains(note);
        said.extend(notes.into_iter().filter(is_new).collect::<Vec<_>>());
        outputs.append(staged)?;
        files.push(file);
        rows.extend(report);
        paths.extend(path);
    }

    let text = match form {
        Form::Json => report::pretty(&told(&setup, &files))?,
        Form::Junit => junit(&files),
        Form::Sarif => report::pretty(&sarif(&files))?,
        _ => text(&files),
    };
    outputs.add(Path::new("-"), text.as_bytes())?;
    if let Some(path) = &args.reports.json {
        outputs.add_report(path, report::pretty(&told(&setup, &files))?.as_bytes())?;
    }
    if let Some(path) = args.reports.report.as_ref().filter(|_| !rows.is_empty()) {
        report::joined(&mut outputs, path, &rows)?;
    }
    if let Some(path) = &args.reports.html {
        let cell = setup.cell.origin();
        let scene = Some(&setup.cell.cell);
        let page = PathPage { kind: PathKind::Check, cell: &cell, programs: &paths, scene };
        outputs.add_report(path, page.html().as_bytes())?;
    }
    outputs.commit()?;
    message::print(&setup.cell.own(said), args.common.quiet);
    if !failed.is_empty() {
        return Err(failed);
    }
    Ok(if files.iter().all(|file| file.findings.is_empty()) { Answer::Yes } else { Answer::No })
}

/// The answer for scripts, with what it was made from.
fn told(setup: &Setup, files: &[CheckFile]) -> serde_json::Value {
    let mut all = check_json(files);
    all["cell"] = serde_json::json!(setup.cell.origin());
    all
}

/// `--format` names the form of the answer, and the kind of the input as everywhere else.
fn formats(given: &[CheckFormat]) -> Result<(Form, Option<Language>), Vec<Diagnostic>> {
    let (mut form, mut input) = (None, None);
    for format in given {
        let taken = match format {
            CheckFormat::Input(language) => input.replace(*language).is_some(),
            CheckFormat::Form(of) => form.replace(*of).is_some(),
        };
        if taken {
            return Err(Diagnostic::error("usage.format", "", "--format is given twice")
                .help("give one form and one kind")
                .into());
        }
    }
    Ok((form.unwrap_or_default(), input))
}

/// One program, judged.
struct Checked {
    file: CheckFile,
    /// What is staged already.
    outputs: Outputs,
    /// For the report of all programs; `None` where none is wanted, or it is staged already.
    rows: Option<Rows>,
    /// For `--html`.
    path: Option<(FileSummary, PathTrace)>,
    /// What could not be judged, and how it was understood.
    notes: Vec<Diagnostic>,
}

fn one(args: &Check, batch: &Batch<'_>, job: Job, bar: &ProgressBar) -> Result<Checked, Vec<Diagnostic>> {
    let findings = |judged: Judged<'_>| findings(args, judged);
    let named = args.reports.json.is_some()
        || args.reports.html.is_some()
        || args.format.contains(&CheckFormat::Form(Form::Json));
    let origins = if named { job.origins()? } else { Vec::new() };
    job.marked()?;
    let question = Question { corrects: corrects(args), findings: &findings };
    let mut checked = match predicted::streamed(batch, &job, bar, Some(question))? {
        Some(predicted) => streamed(batch, &job.name, predicted),
        None => whole(args, batch, job, bar),
    }?;
    if let Some((summary, _)) = &mut checked.path {
        summary.sources.clone_from(&origins);
    }
    checked.file.sources = origins;
    Ok(checked)
}

/// Whether the correction that would be made is judged, there being no other.
fn corrects(args: &Check) -> bool {
    args.max_correction.is_some() && args.against.is_none()
}

/// A program that went through a chunk at a time.
fn streamed(batch: &Batch<'_>, name: &str, predicted: Predicted) -> Result<Checked, Vec<Diagnostic>> {
    let Predicted { streamed, findings, outputs, rows, path } = predicted;
    let (found, sum) = if streamed.refused.is_empty() {
        (findings.into_parts(), streamed.summary)
    } else {
        let (refused, more) = streamed.refused.into_parts();
        ((about_the_program(batch, refused)?, more), Summary::default())
    };
    let unknown: usize = streamed.unknown.iter().map(|(_, count)| count).sum();
    let file = CheckFile::new(name, (streamed.last as usize).saturating_sub(unknown), found);
    let path = path.map(|path| (FileSummary::of(name, &sum, &[]).with_findings(&file), path));
    let notes = streamed.notes.into_iter().chain(not_judged(name, &streamed.unknown)).collect();
    Ok(Checked { file, outputs, rows, path, notes })
}

/// Refusals as findings, if they are.
fn about_the_program(batch: &Batch<'_>, refused: Vec<Diagnostic>) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
    let all = refused.iter().all(|error| ABOUT_THE_PROGRAM.contains(&error.code));
    if all && !refused.is_empty() { Ok(refused) } else { Err(batch.setup.cell.own(refused)) }
}

/// A program that is held whole.
fn whole(args: &Check, batch: &Batch<'_>, job: Job, bar: &ProgressBar) -> Result<Checked, Vec<Diagnostic>> {
    let (name, setup) = (job.name.clone(), batch.setup);
    let original = batch.originals.of(&job, setup)?;
    let program = setup.program(job)?;
    let targets = program.targets.iter().filter(|target| target.role == Role::End).count();
    let cell = &setup.cell.cell;
    let outputs = batch.outputs.sibling();
    let options = setup.options_followed(batch.bar(bar));
    let mut predicted = match predict(&program, cell, &options, original.as_ref()) {
        Ok(predicted) => predicted,
        Err(refused) => {
            let mut held = Messages::with_room(Findings::MOST);
            held.add(about_the_program(batch, refused)?);
            let file = CheckFile::new(&name, targets, held.into_parts());
            let nothing = FileSummary::of(&name, &Summary::default(), &[]).with_findings(&file);
            let path = batch.path.clone().map(|path| (nothing, path));
            let rows = batch.rows(Some(Rows::new(&program, &[])))?;
            return Ok(Checked { file, outputs, rows, path, notes: Vec::new() });
        }
    };
    let mut failures = std::mem::take(&mut predicted.failures);
    if corrects(args) {
        failures.extend(compensate(&program, cell, &options).map_err(|e| setup.cell.own(e))?.failures);
    }
    let (mut found, moved_mm, on_the_way) = (Findings::default(), &predicted.moved_mm, &predicted.on_the_way);
    found.add(findings(args, Judged { program: &program, rows: &predicted.rows, failures, moved_mm, on_the_way }));
    let file = CheckFile::new(&name, targets, found.into_parts());
    let rows = Rows::new(&program, &predicted.rows);
    let path = batch.path.clone().map(|mut path| {
        rows.draw(&mut path, &predicted.rows);
        path.quote(|target, _| program.line_of(target));
        (FileSummary::new(&name, &program, &predicted).with_findings(&file), path)
    });
    let rows = batch.rows(Some(rows))?;
    let not_judged = not_judged(&name, program.unknown_targets());
    let unsolved = predicted.rows.iter().filter(|row| !row.is_solved()).count();
    let unsolved = (unsolved > 0).then(|| {
        Diagnostic::error("check.not-judged", &name, format!("not judged: {unsolved} targets that are kept, unsolved"))
            .severity(Severity::Warning)
            .help("`deflex predict --report` names them and why")
    });
    let mut noticed = Noticed::new(setup.options.forces.as_ref(), None);
    noticed.take(&predicted.rows);
    let left_out = noticed.notes(&name)?;
    let notes = predicted.notes.into_iter().chain(left_out).chain(not_judged).chain(unsolved).collect();
    Ok(Checked { file, outputs, rows, path, notes })
}

/// Motions whose target is known only at run time.
fn not_judged<'a>(name: &'a str, unknown: &'a [(&'static str, usize)]) -> impl Iterator<Item = Diagnostic> + 'a {
    unknown.iter().map(move |(reason, count)| {
        Diagnostic::error("check.not-judged", name, format!("not judged: {count} {reason}"))
            .severity(Severity::Warning)
            .help("`deflex inspect` names their lines")
    })
}

/// What is wrong with a program, or a chunk of it.
fn findings(args: &Check, judged: Judged<'_>) -> Vec<Diagnostic> {
    let Judged { program, rows, failures, moved_mm, on_the_way } = judged;
    let place = Places::new(program);
    let over = rows.iter().filter(|row| row.error_norm_mm() > args.max_error);
    let mut findings: Vec<Diagnostic> = over.map(|row| place.error(row, args.max_error)).collect();
    if !args.at_targets {
        // A target that is off itself has been found already.
        let way = |row: &&Row| {
            row.error_norm_mm() <= args.max_error && row.remaining_path_mm().is_some_and(|left| left > args.max_error)
        };
        findings.extend(rows.iter().filter(way).map(|row| place.path(row, args.max_error)));
    }
    findings.extend(failures);
    findings.extend(on_the_way.iter().map(|found| found.diagnostic(program)));
    if let Some(most) = args.max_correction {
        let moved = program.targets.iter().map(|target| target.ordinal).zip(moved_mm.iter().copied());
        findings.extend(moved.filter(|(_, mm)| *mm > most).map(|(target, mm)| place.correction(target, mm, most)));
    }
    findings
}

/// Where targets stand in the text.
struct Places<'a> {
    program: &'a Program,
    /// In running order.
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

    fn path(&self, row: &Row, most: f64) -> Diagnostic {
        let left = row.remaining_path_mm().unwrap_or_default();
        let message = format!(
            "target {}: on the way into it the tip is {left:.4} mm off the programmed path, more than the {most} mm allowed",
            row.target
        );
        let help =
            "correct the program with `deflex compensate --subdivide MM`; `--at-targets` judges the targets alone";
        self.at(row.target, "check.max-path-error", message, help)
    }

    fn correction(&self, target: u32, mm: f64, most: f64) -> Diagnostic {
        let message = format!("target {target}: correction of {mm:.4} mm, more than the {most} mm allowed");
        self.at(target, "limits.max-correction", message, "check the cell that the correction was made with")
    }

    fn at(&self, ordinal: u32, code: &'static str, message: String, help: &str) -> Diagnostic {
        let diagnostic = Diagnostic::error(code, "", message).help(help);
        match self.ends.binary_search_by_key(&ordinal, |target| target.ordinal) {
            Ok(i) => {
                let target = self.ends[i];
                diagnostic.on_line(&self.program.sources[usize::from(target.source)], target.span, target.line)
            }
            Err(_) => diagnostic,
        }
    }
}

/// One line a finding, one a program.
fn text(files: &[CheckFile]) -> String {
    let mut out = String::new();
    for file in files {
        for finding in &file.findings {
            out += &format!("{finding}\n");
        }
        out.extend(file.rest().map(|rest| rest + "\n"));
        let verdict = match file.count() {
            0 => "ok".to_owned(),
            n => format!("{n} findings"),
        };
        out += &format!("{}: {} targets, {verdict}\n", file.path, file.targets);
    }
    out
}
