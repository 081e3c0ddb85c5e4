//! `plan`: what to measure, so that effects can be told apart.

use super::args::Plan as Arguments;
use super::files::{all, both, source};
use super::input::{self, CellFile, Context};
use super::job::Job;
use super::output::{Outputs, is_stdout, one_thing};
use super::report::pretty;
use super::{Answer, Outcome, message, progress};
use deflex::identify::{Plan, PlanInput, plan};
use deflex::report::html::plan_page;
use deflex::report::{Origin, VERSION, plan_text};
use deflex::text::Diagnostic;
use serde_json::Value;
use std::path::Path;

/// A set of effects below this share of the posterior does not keep a question open.
const OPEN: f64 = 0.05;

pub(super) fn run(args: &Arguments) -> Outcome {
    let written = [Some(&args.output), args.measured.as_ref(), args.json.as_ref(), args.html.as_ref()];
    let printed = written.into_iter().flatten().filter(|path| is_stdout(path)).count();
    one_thing(printed)?;
    let (cell, context) = both(CellFile::read(&args.cell), Context::read(&args.reading))?;
    let pool = all(args.pool.iter().map(|path| {
        let job = Job::of(path, args.reading.format);
        job.and_then(|job| input::program(job, &context, &cell, None))
    }))?;
    let undecided = args.after.as_deref().map(undecided).transpose()?;
    let mut notes = Vec::new();
    if undecided.as_ref().is_some_and(Vec::is_empty) {
        notes.push("the identification left nothing undecided: the plan is for every pair of effects".to_owned());
    }
    let stem = args.output.file_stem().filter(|_| !is_stdout(&args.output));
    let name = stem.map_or_else(|| "plan".into(), |stem| stem.to_string_lossy().into_owned());
    const STEPS: usize = 1000;
    let bar = progress::bar(STEPS, args.common.quiet);
    bar.set_message("planning");
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let tell = |share: f64| bar.set_position((share * STEPS as f64) as u64);
    let found = plan(&PlanInput {
        cell: &cell.cell,
        rows: usize::from(args.rows),
        pool: &pool,
        undecided: undecided.as_deref().unwrap_or_default(),
        name: &name,
        progress: &tell,
    });
    bar.finish_and_clear();
    let mut found = found.map_err(|errors| cell.own(errors))?;
    found.notes.extend(notes);

    let read = args.pool.iter().chain(&args.after).chain(&args.reading.context).chain([&args.cell]);
    let mut outputs = Outputs::new(read);
    outputs.add(&args.output, found.program.as_bytes())?;
    if let Some(path) = &args.measured {
        outputs.add(path, found.table.as_bytes())?;
    }
    let origin = cell.origin();
    if let Some(path) = &args.json {
        #[derive(serde::Serialize)]
        struct Told<'a> {
            #[serde(flatten)]
            found: &'a Plan,
            deflex: &'static str,
            cell: &'a Origin,
        }
        let told = Told { found: &found, deflex: VERSION, cell: &origin };
        outputs.add_report(path, pretty(&told)?.as_bytes())?;
    }
    if let Some(path) = &args.html {
        outputs.add_report(path, plan_page(&found, &name, &origin).as_bytes())?;
    }
    let text = plan_text(&found);
    if printed == 0 {
        outputs.add(Path::new("-"), text.as_bytes())?;
    } else if !args.common.quiet {
        message::say(&[text]);
    }
    outputs.commit()?;
    message::print(&cell.cell.notes, args.common.quiet);
    Ok(Answer::Yes)
}

/// Pairs of kinds that an identification (its JSON) left undecided.
fn undecided(path: &Path) -> Result<Vec<(String, String)>, Vec<Diagnostic>> {
    let source = source(path)?;
    let bad = |reason: String| {
        let message = format!("not the JSON of an identification: {reason}");
        vec![
            Diagnostic::error("plan.after", &source.name, message)
                .help("give what `deflex identify --json FILE` wrote"),
        ]
    };
    let value: Value = serde_json::from_slice(&source.bytes).map_err(|error| bad(error.to_string()))?;
    let added = value["added"].as_array().ok_or_else(|| bad("it has no `added`".to_owned()))?;
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let list = |value: &Value| value.as_array().into_iter().flatten().filter_map(text).collect::<Vec<_>>();
    let mut pairs: Vec<(String, String)> = Vec::new();
    let mut open = |a: &str, b: &str| {
        let pair = if a < b { (a.to_owned(), b.to_owned()) } else { (b.to_owned(), a.to_owned()) };
        let effects = [a, b].iter().all(|name| deflex::effects::kind(name).is_some());
        if a != b && effects && !pairs.contains(&pair) {
            pairs.push(pair);
        }
    };
    for effect in added {
        let kind = text(&effect["kind"]).ok_or_else(|| bad("an effect has no `kind`".to_owned()))?;
        list(&effect["not_told_apart_from"]).iter().for_each(|other| open(&kind, other));
    }
    let sets = value["sets"].as_array().into_iter().flatten();
    let sets: Vec<Vec<String>> =
        sets.filter(|set| set["probability"].as_f64().unwrap_or(0.0) >= OPEN).map(|set| list(&set["kinds"])).collect();
    for (i, one) in sets.iter().enumerate() {
        for other in &sets[i + 1..] {
            let only =
                |a: &[String], b: &[String]| a.iter().filter(|kind| !b.contains(kind)).cloned().collect::<Vec<_>>();
            for a in only(one, other) {
                only(other, one).iter().for_each(|b| open(&a, b));
            }
        }
    }
    Ok(pairs)
}
