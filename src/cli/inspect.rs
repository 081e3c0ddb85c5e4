//! `inspect`: shows what deflex understands of programs.

use super::args::Inspect;
use super::{Answer, Outcome, progress};
use crate::session::input::{self, Context};
use crate::session::job::{Job, belongs_to_another};
use crate::session::output::{Outputs, is_stdout};
use crate::session::read::all;
use crate::session::report::pretty;
use deflex::program::{Language, detect, round_trip};
use deflex::report::{InspectFile, InspectFiles, inspect_table};
use deflex::text::{Diagnostic, printable_line};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Ending of lists of modules, which are looked for in a folder in addition to the endings of the languages.
const LISTS: &str = "pgf";
/// Endings that other kinds of files have too, so the content of the file decides.
const SHARED: [&str; 2] = ["txt", "dat"];

pub(super) fn run(args: &Inspect) -> Outcome {
    let context = Context::of(&args.reading.context)?;
    let paths: Vec<PathBuf> = all(args.inputs.iter().map(|path| programs(path)))?.into_iter().flatten().collect();
    if paths.is_empty() {
        let folders: Vec<String> = args.inputs.iter().map(|path| path.display().to_string()).collect();
        let message = format!("there is no program in {}", folders.join(", "));
        let help = "programs are recognised by their endings; give a file with another ending by its name";
        return Err(Diagnostic::error("program.none", "", message).help(help).into());
    }
    let bar = progress::bar(paths.len(), args.common.quiet);
    let inspected: Vec<_> = paths
        .par_iter()
        .map(|path| {
            bar.set_message(printable_line(&path.display().to_string()).into_owned());
            let file = one(path, args.reading.format, &context);
            bar.inc(1);
            file
        })
        .collect();
    bar.finish_and_clear();
    let (files, refusals): (Vec<InspectFile>, Vec<Vec<Diagnostic>>) = all(inspected)?.into_iter().unzip();
    let mut outputs = Outputs::default();
    outputs.add_report(args.json.as_ref(), || pretty(&InspectFiles { files: &files }))?;
    if !args.json.as_deref().is_some_and(is_stdout) {
        outputs.add_summary(&inspect_table(&files));
    }
    outputs.commit()?;
    // deflex understood none of the files.
    if !files.is_empty() && refusals.iter().all(|refusal| !refusal.is_empty()) {
        return Err(refusals.concat());
    }
    // The table lists the refused files with their reasons.
    Ok(Answer::Yes)
}

/// The path itself if it is a file, else the programs in the folder and its subfolders, sorted by path.
fn programs(path: &Path) -> Result<Vec<PathBuf>, Vec<Diagnostic>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let failed = |error: std::io::Error| {
        Diagnostic::error("io.read", &path.display().to_string(), format!("the file cannot be read: {error}"))
    };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let (path, kind) = (entry.path(), entry.file_type().map_err(failed)?);
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        if kind.is_dir() {
            found.extend(programs(&path)?);
        } else if ending.is_some_and(|ending| is_program(&path, &ending)) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

fn is_program(path: &Path, ending: &str) -> bool {
    let own = ending == LISTS || Language::ALL.iter().any(|language| language.endings().contains(&ending));
    own || SHARED.contains(&ending) && !belongs_to_another(path) && says_so(path)
}

/// Whether the content of a text file is a program.
fn says_so(path: &Path) -> bool {
    std::fs::read(path).is_ok_and(|bytes| detect("", &bytes).is_some())
}

/// The result for one file. A refused program is a result; a file that cannot be opened is an error.
fn one(
    path: &Path,
    format: Option<Language>,
    context: &Context,
) -> Result<(InspectFile, Vec<Diagnostic>), Vec<Diagnostic>> {
    let refused = |language: Option<Language>, errors: Vec<Diagnostic>| {
        let path = path.display().to_string();
        (InspectFile::refused(&path, language, &errors), errors)
    };
    let job = match Job::of(path, format) {
        Ok(job) => job,
        Err(errors) if errors.iter().any(|error| error.code == "io.read") => return Err(errors),
        Err(errors) => return Ok(refused(None, errors)),
    };
    let (name, language) = (job.name.clone(), job.language);
    Ok(match input::program_alone(job, context) {
        Ok(program) => {
            let proof = round_trip(&program, |written, context| input::reread(language, written, context));
            (InspectFile::read(&name, &program, &proof), Vec::new())
        }
        Err(errors) => refused(Some(language), errors),
    })
}
