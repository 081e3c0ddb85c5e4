//! `check`: is each target within tolerance, reachable and convergent?

use super::args::{Check, CheckFormat, Format};
use super::input::{self, Context, Job};
use super::output::Outputs;
use super::report::{self, Rows};
use super::run::{Originals, Setup, both, one_thing};
use super::{Answer, Outcome, message};
use deflex::correct::{Corrected, Row, Summary, compensate, predict};
use deflex::program::{Program, Role, Target};
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::report::{CheckFile, FileSummary, check_json, difference, junit, sarif};
use deflex::text::{Diagnostic, Severity};
use rayon::prelude::*;
use std::path::Path;

/// Refusals that are an answer about the program, not a failure of the run.
const ABOUT_THE_PROGRAM: [&str; 1] = ["robot.unreachable"];

pub(super) fn run(args: &Check) -> Outcome {
    let (form, kind) = formats(&args.format)?;
    let context = Context::of(&args.context)?;
    let (mut setup, jobs) =
        both(Setup::read(&args.model, context, args.correct, &args.reports), input::jobs(&args.inputs, kind))?;
    if let Some(most) = args.max_correction {
        setup.cell.cell.limits.max_correction = 1e-3 * most;
    }
    one_thing(1 + args.reports.to_stdout())?;
    let path = args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Check, jobs.len()));
    let originals = Originals::new(args.against.as_deref(), &jobs, kind)?;
    let checked: Vec<_> = jobs.into_par_iter().map(|job| one(args, &setup, &originals, path.clone(), job)).collect();
    let (mut files, mut rows, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    let mut said = setup.notes();
    for Checked { file, rows: report, path, notes } in input::all(checked)? {
        said.extend(notes.into_iter().filter(|note| !said.contains(note)).collect::<Vec<_>>());
        files.push(file);
        rows.push(report);
        paths.extend(path);
    }

    let mut outputs = Outputs::new(args.inputs.iter().chain(&args.context).chain([&args.model.cell]));
    let text = match form {
        CheckFormat::Json => report::pretty(&check_json(&files))?,
        CheckFormat::Junit => junit(&files),
        CheckFormat::Sarif => report::pretty(&sarif(&files))?,
        _ => text(&files),
    };
    outputs.add(Path::new("-"), text.as_bytes())?;
    if let Some(path) = &args.reports.json {
        outputs.add_report(path, report::pretty(&check_json(&files))?.as_bytes())?;
    }
    if let Some(path) = &args.reports.report {
        report::joined(&mut outputs, path, &rows)?;
    }
    if let Some(path) = &args.reports.html {
        let page = PathPage { kind: PathKind::Check, cell: &setup.cell.name, programs: &paths };
        outputs.add_report(path, page.html().as_bytes())?;
    }
    outputs.commit()?;
    message::print(&setup.cell.own(said), args.common.quiet);
    Ok(if files.iter().all(|file| file.findings.is_empty()) { Answer::Yes } else { Answer::No })
}

/// `--format` names the form of the answer, and the kind of the input as everywhere else.
fn formats(given: &[CheckFormat]) -> Result<(CheckFormat, Option<Format>), Vec<Diagnostic>> {
    let (mut form, mut kind) = (None, None);
    for format in given {
        let taken = match format {
            CheckFormat::Rapid => kind.replace(Format::Rapid).is_some(),
            CheckFormat::Cl => kind.replace(Format::Cl).is_some(),
            form_of => form.replace(*form_of).is_some(),
        };
        if taken {
            return Err(Diagnostic::error("usage.format", "", "--format is given twice")
                .help("give one form and one kind")
                .into());
        }
    }
    Ok((form.unwrap_or_default(), kind))
}

/// One program, judged.
struct Checked {
    file: CheckFile,
    rows: Rows,
    /// For `--html`.
    path: Option<(FileSummary, PathTrace)>,
    /// What could not be judged, and how it was understood.
    notes: Vec<Diagnostic>,
}

fn one(
    args: &Check,
    setup: &Setup,
    originals: &Originals,
    trace: Option<PathTrace>,
    job: Job,
) -> Result<Checked, Vec<Diagnostic>> {
    let path = job.name.clone();
    let original = originals.of(&job, setup)?;
    let program = setup.program(job)?;
    let targets = program.targets.iter().filter(|target| target.role == Role::End).count();
    let about_the_program = |errors: Vec<Diagnostic>| {
        let all = errors.iter().all(|error| ABOUT_THE_PROGRAM.contains(&error.code));
        if all && !errors.is_empty() { Ok(errors) } else { Err(setup.cell.own(errors)) }
    };
    let cell = &setup.cell.cell;
    let predicted = match predict(&program, cell, &setup.options, original.as_ref()) {
        Ok(predicted) => predicted,
        Err(errors) => {
            let findings = about_the_program(errors)?;
            let shown = trace.map(|nothing| (FileSummary::of(&path, &Summary::default(), &findings), nothing));
            let file = CheckFile::new(path, targets, findings);
            return Ok(Checked { file, rows: Rows::new(&program, &[]), path: shown, notes: Vec::new() });
        }
    };
    let shown = trace.map(|mut trace| {
        trace.extend(&predicted.rows);
        trace.quote(|target, _| program.line_of(target));
        (FileSummary::new(&path, &program, &predicted), trace)
    });
    let place = Places::new(&program);
    let over = predicted.rows.iter().filter(|row| row.error_norm_mm() > args.max_error);
    let mut findings: Vec<Diagnostic> = over.map(|row| place.error(row, args.max_error)).collect();
    findings.extend(predicted.failures);
    match (args.max_correction, &original) {
        (Some(most), Some(original)) => {
            let moved = difference(original, &program).moved;
            findings.extend(moved.iter().filter(|m| m.mm > most).map(|m| place.correction(m.target, m.mm, most)));
        }
        (Some(_), None) => {
            let Corrected { failures, .. } =
                compensate(&program, cell, &setup.options).map_err(|e| setup.cell.own(e))?;
            findings.extend(failures);
        }
        (None, _) => {}
    }
    findings.sort_by_key(|finding| (finding.file.clone(), finding.line, finding.column));
    findings.dedup();
    let shown = shown.map(|(summary, trace)| (summary.with_failures(&findings), trace));
    let rows = Rows::new(&program, &predicted.rows);
    let not_judged = program.unknown_targets().iter().map(|(reason, count)| {
        Diagnostic::error("check.not-judged", &path, format!("not judged: {count} {reason}"))
            .severity(Severity::Warning)
            .help("`deflex inspect` names their lines")
    });
    let notes = predicted.notes.into_iter().chain(not_judged).collect();
    Ok(Checked { file: CheckFile::new(path, targets, findings), rows, path: shown, notes })
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
        let verdict = match file.findings.len() {
            0 => "ok".to_owned(),
            n => format!("{n} findings"),
        };
        out += &format!("{}: {} targets, {verdict}\n", file.path, file.targets);
    }
    out
}
