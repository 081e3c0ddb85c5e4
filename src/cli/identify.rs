//! `identify`: which effect the cell lacks, and the cell with it.

use super::args::Identify;
use super::input::{self, CellFile, Context, all, both};
use super::job::Job;
use super::output::{Outputs, is_stdout, one_thing};
use super::report::pretty;
use super::{Answer, Outcome, message, progress};
use deflex::cell::{examples_left, extended};
use deflex::identify::{Identification, Input, identify};
use deflex::measured::Table;
use deflex::program::Program;
use deflex::report::html::identification_page;
use deflex::report::{Origin, VERSION, identify_text, residual_csv};
use deflex::text::Diagnostic;
use std::path::{Path, PathBuf};

pub(super) fn run(args: &Identify) -> Outcome {
    let printed = [&args.output, &args.report, &args.json, &args.html]
        .into_iter()
        .flatten()
        .filter(|path| is_stdout(path))
        .count();
    one_thing(printed)?;
    let (cell, context) = both(CellFile::read(&args.cell), Context::read(&args.reading))?;
    let runs = all(args.run.chunks_exact(2).map(|pair| run_of(args, &cell, &context, &pair[0], &pair[1])));
    let poses = all(args.poses.iter().map(|path| input::table(path)));
    let (runs, poses) = both(runs, poses)?;
    let read: Vec<&PathBuf> = args.run.iter().chain(&args.poses).chain([&args.cell]).collect();
    let sources = input::sources(&read.iter().map(|path| (*path).clone()).collect::<Vec<_>>())?;
    let hash = hash(&sources);
    let mut of_data: Vec<Origin> = sources.iter().map(|source| Origin::of(&source.name, &source.bytes)).collect();
    of_data.pop();
    let of_cell = cell.origin();

    let bar = progress::bar(1, args.common.quiet);
    bar.set_message("identifying");
    let found =
        identify(&Input { cell: &cell.cell, runs: &runs, poses: &poses, tool: args.tool.as_deref(), data_hash: &hash });
    bar.finish_and_clear();
    let found = found.map_err(|errors| cell.own(errors))?;

    let mut outputs = Outputs::new(read.iter().copied().chain(&args.reading.context));
    if let Some(path) = &args.output {
        let text = String::from_utf8_lossy(&cell.source.bytes);
        let text = extended(&text, &found.extended).map_err(|errors| cell.own(errors))?;
        outputs.add(path, text.as_bytes())?;
    }
    if let Some(path) = &args.json {
        #[derive(serde::Serialize)]
        struct Told<'a> {
            #[serde(flatten)]
            found: &'a Identification,
            deflex: &'static str,
            cell: &'a Origin,
            sources: &'a [Origin],
        }
        let told = Told { found: &found, deflex: VERSION, cell: &of_cell, sources: &of_data };
        outputs.add_report(path, pretty(&told)?.as_bytes())?;
    }
    if let Some(path) = &args.report {
        outputs.add_report(path, residual_csv(&found.residuals).as_bytes())?;
    }
    if let Some(path) = &args.html {
        outputs.add_report(path, identification_page(&found, &of_cell, &of_data).as_bytes())?;
    }
    if printed == 0 {
        outputs.add(Path::new("-"), identify_text(&found).as_bytes())?;
    } else if !args.common.quiet {
        message::say(&[identify_text(&found)]);
    }
    outputs.commit()?;
    let notes: Vec<Diagnostic> = examples_left(&cell.source).into_iter().chain(cell.cell.notes.clone()).collect();
    message::print(&notes, args.common.quiet);
    Ok(Answer::Yes)
}

/// A program and what was measured on it.
fn run_of(
    args: &Identify,
    cell: &CellFile,
    context: &Context,
    program: &Path,
    measured: &Path,
) -> Result<(Program, Table), Vec<Diagnostic>> {
    let job = Job::of(program, args.reading.format);
    let program = job.and_then(|job| input::program(job, context, cell, args.tool.as_deref()));
    both(program, input::table(measured))
}

/// FNV-1a over all files that the answer depends on: tells data apart, guards against nothing.
fn hash(sources: &[deflex::text::Source]) -> String {
    let bytes = sources.iter().flat_map(|source| &source.bytes);
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    format!("fnv1a:{hash:016x}")
}
