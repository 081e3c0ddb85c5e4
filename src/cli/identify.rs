//! `identify`: finds the effect that the cell lacks, and writes the cell with it.

use super::against::Originals;
use super::args::Identify;
use super::{Answer, Outcome, message, progress};
use crate::session::context::Context;
use crate::session::input::CellFile;
use crate::session::job::Job;
use crate::session::output::{Outputs, one_thing, to_stdout};
use crate::session::read::{all, both};
use crate::session::report::pretty;
use crate::session::{self, MeasuredFile, MeasuredRunFiles, ProgramFiles};
use deflex::cell::{examples_left, with_path_law};
use deflex::drive::FittedLaw;
use deflex::identify::Written;
use deflex::measured::ColumnNames;
use deflex::report::{identify_text, path_law_text, residual_csv};
use deflex::text::Diagnostic;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(super) fn run(args: &Identify) -> Outcome {
    let printed = to_stdout([&args.output, &args.report, &args.json, &args.html].map(Option::as_ref));
    one_thing(printed)?;
    let (cell, context) = both(CellFile::read(&args.cell), Context::read(&args.reading.context))?;
    let names = args.columns.as_deref().map(ColumnNames::parse).transpose()?;
    let table = |path: &Path| Ok(MeasuredFile::read(path)?.read_as(names.clone(), args.match_mm));
    let program = |path: &Path| Job::of(path, args.reading.format);
    let programs = all(args.run.chunks_exact(2).map(|pair| program(&pair[0])));
    let tables = all(args.run.chunks_exact(2).map(|pair| table(&pair[1])));
    let (programs, tables) = both(programs, tables)?;
    let originals = Originals::new(args.against.as_deref(), &programs, args.reading.format)?;
    let files = |job: Job| ProgramFiles::of(job, context.clone());
    let run = |(job, measured): (Job, MeasuredFile)| {
        let original = originals.job(&job).and_then(|original| original.map(files).transpose());
        let (program, original) = both(files(job), original)?;
        Ok(MeasuredRunFiles { program, original, measured })
    };
    let runs = all(programs.into_iter().zip(tables).map(run));
    let log = |pair: &[PathBuf]| both(program(&pair[0]).and_then(files), table(&pair[1]));
    let logs = all(args.log.chunks_exact(2).map(log));
    let ((runs, logs), poses) = both(both(runs, logs), all(args.poses.iter().map(|path| table(path))))?;
    let path = if logs.is_empty() { None } else { Some(session::identify_path(&cell, &logs, args.tool.as_deref())?) };
    if let Some(path) = path.as_ref().filter(|_| runs.is_empty() && poses.is_empty()) {
        return path_alone(args, &cell, path);
    }

    let bar = progress::shares("identifying", args.common.quiet);
    let reached = |share: f64| {
        progress::reached(&bar, share);
        true
    };
    let written = if args.sparse { Written::NamedAlone } else { Written::WholeModel };
    let done = session::identify(&cell, &runs, &poses, args.tool.as_deref(), written, &reached);
    bar.finish_and_clear();
    let done = done?;
    let found = &done.found;

    let mut outputs = Outputs::default();
    let with_law_text = |text: String| path.as_ref().map(path_law_text).unwrap_or_default() + &text;
    if let Some(output) = &args.output {
        let extended = done.cell()?;
        let extended = path.as_ref().map_or(Ok(extended.clone()), |path| with_path_law(&extended, path))?;
        outputs.add(output, extended.as_bytes())?;
    }
    outputs.add_report(args.json.as_ref(), || done.json(path.as_ref()))?;
    outputs.add_report(args.report.as_ref(), || Ok(residual_csv(&found.residuals)))?;
    outputs.add_report(args.html.as_ref(), || Ok(done.page()))?;
    if printed == 0 {
        outputs.add_summary(&with_law_text(identify_text(found)));
    } else if !args.common.quiet {
        message::print_lines(&[with_law_text(identify_text(found))]);
    }
    outputs.commit()?;
    let notes: Vec<Diagnostic> =
        examples_left(&cell.source).into_iter().chain(cell.cell.notes.clone()).chain(done.notes.clone()).collect();
    message::print(&notes, args.common.quiet);
    Ok(Answer::Yes)
}

/// Writes the results if there are only logs: the law of the controller's path.
fn path_alone(args: &Identify, cell: &CellFile, path: &FittedLaw) -> Outcome {
    for (option, given) in [("--report", &args.report), ("--html", &args.html)] {
        if given.is_some() {
            let message = format!("{option} needs measured rows: --log alone has none");
            return Err(vec![
                Diagnostic::error("usage.identify", "", message).help("leave it out, or add --run or --poses"),
            ]);
        }
    }
    let mut outputs = Outputs::default();
    if let Some(output) = &args.output {
        let text = String::from_utf8_lossy(&cell.source.bytes);
        outputs.add(output, with_path_law(&text, path)?.as_bytes())?;
    }
    outputs.add_report(args.json.as_ref(), || pretty(&BTreeMap::from([("path", path)])))?;
    if to_stdout([&args.output, &args.json].map(Option::as_ref)) > 0 {
        if !args.common.quiet {
            message::print_lines(&[path_law_text(path)]);
        }
    } else {
        outputs.add_summary(&path_law_text(path));
    }
    outputs.commit()?;
    Ok(Answer::Yes)
}
