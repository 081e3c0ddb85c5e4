//! The blind table: identifies every cell of a folder and compares with its `truth.json`.
//!
//! `cargo run --release --example blind_table -- FOLDER [FILTER]`; the folder comes from
//! `samples/plant/generate.py` (data as a laboratory takes them) or `samples/plant/shop.py` (as shops have them). Each cell
//! is a folder with `cell.toml`, `part*.mod`, `measured*.csv`, `truth.json` and, for the transfer figure, `transfer.mod`,
//! `transfer_measured.csv` and `transfer_exact.csv`.
//!
//! Verdicts: *wrong*, if an effect is named as certain that is not there. *Right*, if every effect is named outright, or if an error that is
//! in no list (drift, slips, faulty columns, unlisted effects) is reported as unexplained. *Undecided*, if the truth is in the sets of effects
//! that cannot be distinguished. *Missed*, otherwise. *Worse*: the extended cell predicts another program worse than the declared cell.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use deflex::cell::{Cell, extended};
use deflex::correct::{Options, predict};
use deflex::identify::{Identification, Input, MeasuredRun, identify};
use deflex::measured::{Table, TargetRef};
use deflex::program::{Program, rapid};
use deflex::text::Source;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn source(path: &Path) -> Source {
    Source::new(path.display().to_string(), std::fs::read(path).unwrap())
}

fn program(path: &Path) -> Program {
    rapid::read(vec![source(path)], Vec::new()).unwrap()
}

/// The prediction of a program by a cell, compared with its measured rows.
struct Transfer {
    rms_mm: f64,
    /// (inside, all) of the axes whose noise-free error lies within 1.96 `sigma_mm` of the prediction.
    covered: (usize, usize),
}

fn transfer(folder: &Path, text: &str) -> Option<Transfer> {
    let (part, measured) = (folder.join("transfer.mod"), folder.join("transfer_measured.csv"));
    if !part.exists() {
        return None;
    }
    let cell = Cell::read(&Source::new("extended", text.as_bytes())).ok()?;
    let table = Table::read(&source(&measured)).ok()?;
    let exact = folder.join("transfer_exact.csv");
    let exact = exact.exists().then(|| Table::read(&source(&exact)).unwrap());
    let program = program(&part);
    let options = Options { forces: Some(table.forces()), ..Options::default() };
    let predicted = predict(&program, &cell, &options, None).ok()?;
    let mut sum = (0.0, 0.0);
    let mut covered = (0, 0);
    for (i, row) in table.rows.iter().enumerate() {
        let (Some(TargetRef::Ordinal(ordinal)), Some(seen)) = (&row.target, row.position_mm) else { continue };
        let there = predicted.rows.iter().find(|r| r.target == *ordinal)?;
        let off = |seen: [f64; 3], k: usize| seen[k] - there.position_mm[k] - there.error_mm[k];
        sum = (sum.0 + (0..3).map(|k| off(seen, k).powi(2)).sum::<f64>(), sum.1 + 1.0);
        let exact = exact.as_ref().and_then(|exact| exact.rows[i].position_mm);
        if let (Some(sigma), Some(exact)) = (there.sigma_mm, exact) {
            covered.1 += 3;
            covered.0 += (0..3).filter(|&k| off(exact, k).abs() <= 1.96 * sigma).count();
        }
    }
    Some(Transfer { rms_mm: f64::sqrt(sum.0 / sum.1), covered })
}

struct Case {
    group: String,
    truth: Vec<String>,
    faults: Vec<String>,
    /// `None`: the table was refused.
    found: Option<Identification>,
    verdict: &'static str,
    /// On another program: with the declared cell, with the extended one.
    transfer: (f64, f64),
    floor: f64,
    seconds: f64,
    /// (inside, all) of the true parameters' intervals.
    covered: (usize, usize),
    /// (inside, all) of the predictions' `sigma_mm`.
    sigma_covered: (usize, usize),
    /// The smallest probability of the effects that are named as certain, and whether all of them are there.
    said: Option<(f64, bool)>,
    /// The chance of a right name that the plan of these rows gave its one effect.
    planned: Option<f64>,
}

impl Case {
    /// Whether the extended cell does worse on the other program than the declared one, beyond what noise does.
    fn is_worse(&self) -> bool {
        /// Share of the declared error, and of the noise floor.
        const SLACK: (f64, f64) = (0.02, 0.02);
        self.transfer.1 > self.transfer.0 * (1.0 + SLACK.0) + SLACK.1 * self.floor
    }
}

/// Programs with their tables: `part*.mod` with `measured*.csv`.
fn runs(folder: &Path) -> Vec<MeasuredRun> {
    let mut stems: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.strip_prefix("part")?.strip_suffix(".mod").map(str::to_owned))
        .collect();
    stems.sort();
    let of = |stem: &String| {
        let table = Table::read(&source(&folder.join(format!("measured{stem}.csv")))).unwrap();
        (program(&folder.join(format!("part{stem}.mod"))), table).into()
    };
    stems.iter().map(of).collect()
}

fn strings(value: &serde_json::Value) -> Vec<String> {
    value.as_array().into_iter().flatten().filter_map(|v| v.as_str().map(str::to_owned)).collect()
}

fn verdict(found: &Identification, names: &[String], faults: &[String], tie: bool) -> &'static str {
    let listed: Vec<&String> = names.iter().filter(|name| deflex::effects::kind(name).is_some()).collect();
    let beyond = listed.len() < names.len() || !faults.is_empty();
    let sure = |a: &deflex::identify::Added| a.not_told_apart_from.is_empty();
    // An empirical map names nothing.
    let named = || found.added.iter().filter(|a| a.kind != "empirical");
    let wrong = named().any(|a| {
        // A drift in the set of possible causes is not a wrong answer.
        let there = |other: &String| names.contains(other) || faults.contains(other);
        !names.contains(&a.kind) && (sure(a) || !a.not_told_apart_from.iter().any(there))
    });
    let all_named = listed.iter().all(|n| named().any(|a| a.kind == **n));
    let in_sets = listed.iter().all(|n| found.added.iter().any(|a| a.kind == **n || a.not_told_apart_from.contains(n)));
    match () {
        () if wrong => "wrong",
        // An error that is in no list has to be reported as unexplained. Naming the listed effects in addition is not required.
        () if beyond && !found.unexplained.significant => "missed",
        () if all_named && (tie || named().all(sure)) => "right",
        () if beyond && named().next().is_none() => "right",
        () if in_sets || beyond => "undecided",
        () => "missed",
    }
}

fn case(folder: &Path, root: &Path) -> Case {
    let start = std::time::Instant::now();
    let text = std::fs::read_to_string(folder.join("cell.toml")).unwrap();
    let cell = Cell::read(&Source::new("cell.toml", text.as_bytes())).unwrap();
    let runs = runs(folder);
    let input = Input {
        cell: &cell,
        runs,
        poses: vec![],
        tool: None,
        data_hash: "blind",
        written: Default::default(),
        progress: &|_| true,
    };
    let found = identify(input);
    let seconds = start.elapsed().as_secs_f64();
    let truth: serde_json::Value = serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
    let effects = truth["effect"].as_array().cloned().unwrap_or_default();
    let names: Vec<String> = effects.iter().map(|e| e["kind"].as_str().unwrap_or("?").to_owned()).collect();
    let faults = strings(&truth["faults"]);
    let noise = |key: &str| truth[key].as_f64().unwrap_or(0.0);
    let floor = (3.0 * (noise("sigma_mm").powi(2) + noise("wander_mm").powi(2))).sqrt();
    let parent = folder.parent().filter(|parent| parent.starts_with(root) && *parent != root);
    let group = parent.and_then(|parent| parent.strip_prefix(root).ok()).unwrap_or(folder).display().to_string();
    let declared = transfer(folder, &text).map_or(f64::NAN, |t| t.rms_mm);
    let mut case = Case {
        group,
        verdict: if faults.is_empty() { "missed" } else { "right" },
        truth: names,
        faults,
        found: None,
        transfer: (declared, declared),
        floor,
        seconds,
        covered: (0, 0),
        sigma_covered: (0, 0),
        said: None,
        planned: planned(folder, &effects),
    };
    let Ok(found) = found else { return case };
    case.verdict = verdict(&found, &case.truth, &case.faults, truth["tie"].as_bool().unwrap_or(false));
    for effect in &effects {
        let Some(added) = found.added.iter().find(|a| Some(a.kind.as_str()) == effect["kind"].as_str()) else {
            continue;
        };
        for p in &added.parameters {
            let (name, index) = p.name.split_once('[').unwrap_or((&p.name, ""));
            let mut value = &effect[name];
            for part in index.split(['[', ']']).filter(|s| !s.is_empty()) {
                value = &value[part.parse::<usize>().unwrap_or(0)];
            }
            if let Some(value) = value.as_f64() {
                case.covered.1 += 1;
                case.covered.0 += usize::from(p.ci95[0] - 1e-12 <= value && value <= p.ci95[1] + 1e-12);
            }
        }
    }
    if let Some(after) = transfer(folder, &extended(&text, &found.extended).unwrap()) {
        case.transfer.1 = after.rms_mm;
        case.sigma_covered = after.covered;
    }
    let named = || found.added.iter().filter(|a| a.kind != "empirical");
    if named().next().is_some() {
        let least = named().map(|a| a.posterior).fold(1.0, f64::min);
        case.said = Some((least, named().all(|a| case.truth.contains(&a.kind))));
    }
    case.found = Some(found);
    case
}

/// The chance that `plan.json` gives the one effect that is there.
fn planned(folder: &Path, effects: &[serde_json::Value]) -> Option<f64> {
    let plan: serde_json::Value = serde_json::from_slice(&std::fs::read(folder.join("plan.json")).ok()?).unwrap();
    let [effect] = effects else { return None };
    let kinds = plan["kinds"].as_array()?;
    kinds.iter().find(|kind| kind["kind"] == effect["kind"])?["chance_right"].as_f64()
}

fn folders(root: &Path, out: &mut Vec<PathBuf>) {
    if root.join("truth.json").exists() {
        out.push(root.to_owned());
        return;
    }
    let mut inner: Vec<PathBuf> =
        std::fs::read_dir(root).into_iter().flatten().flatten().map(|e| e.path()).filter(|p| p.is_dir()).collect();
    inner.sort();
    inner.iter().for_each(|p| folders(p, out));
}

fn main() {
    let mut args = std::env::args().skip(1);
    let root = PathBuf::from(args.next().unwrap_or_else(|| "target/blind".into()));
    let filter = args.next().unwrap_or_default();
    let step: usize = args.next().and_then(|s| s.parse().ok()).unwrap_or(1);
    let mut all = Vec::new();
    folders(&root, &mut all);
    all.retain(|f| f.display().to_string().contains(&filter));
    let all: Vec<PathBuf> = all.into_iter().step_by(step).collect();
    let judged = |folder: &PathBuf| {
        let case = case(folder, &root);
        print(folder.strip_prefix(&root).unwrap_or(folder), &case);
        case
    };
    totals(&all.par_iter().map(judged).collect::<Vec<_>>());
}

fn kinds(case: &Case) -> String {
    let all: Vec<&str> = case.truth.iter().chain(&case.faults).map(String::as_str).collect();
    if all.is_empty() { "none".to_owned() } else { all.join("+") }
}

fn print(folder: &Path, case: &Case) {
    let name =
        |a: &deflex::identify::Added| format!("{}({:.2}|{})", a.kind, a.posterior, a.not_told_apart_from.join(","));
    let (added, left, errors) = case.found.as_ref().map_or_else(
        || ("refused".to_owned(), String::new(), String::new()),
        |found| {
            let added: Vec<String> = found.added.iter().map(name).collect();
            let left: Vec<&str> = found.unexplained.correlates.iter().map(|c| c.with.as_str()).collect();
            let errors = format!(
                "before {:.4} after {:.4} floor {:.4}",
                found.before.rms_mm, found.after.rms_mm, found.noise_floor_rms_mm
            );
            (added.join(" "), left.join("; "), errors)
        },
    );
    println!(
        "{:<34} {:<9} {} truth {:<28} found {added:<60} unexplained [{left}] | {errors} true {:.4} | transfer {:.4} -> {:.4} | ci {}/{} sigma {}/{} | {:.1} s",
        folder.display(),
        case.verdict,
        if case.is_worse() { "WORSE" } else { "     " },
        kinds(case),
        case.floor,
        case.transfer.0,
        case.transfer.1,
        case.covered.0,
        case.covered.1,
        case.sigma_covered.0,
        case.sigma_covered.1,
        case.seconds
    );
}

fn totals(cases: &[Case]) {
    const VERDICTS: [&str; 4] = ["right", "undecided", "missed", "wrong"];
    println!("\n{:<24} {:>5} {:>9} {:>6} {:>5} {:>5}", "group", "right", "undecided", "missed", "wrong", "worse");
    let mut groups: BTreeMap<&str, Vec<&Case>> = BTreeMap::new();
    cases.iter().for_each(|case| groups.entry(&case.group).or_default().push(case));
    let all: Vec<&Case> = cases.iter().collect();
    for (group, cases) in groups.iter().chain(std::iter::once((&"all", &all))) {
        let n: Vec<usize> = VERDICTS.iter().map(|v| cases.iter().filter(|case| case.verdict == *v).count()).collect();
        let worse = cases.iter().filter(|case| case.is_worse()).count();
        println!("{group:<24} {:>5} {:>9} {:>6} {:>5} {worse:>5}", n[0], n[1], n[2], n[3]);
    }
    let sum = |cases: &[&Case], of: &dyn Fn(&Case) -> (usize, usize)| {
        let (inside, all) = cases.iter().fold((0, 0), |a, c| (a.0 + of(c).0, a.1 + of(c).1));
        format!("{inside} of {all} ({:.1} %)", 100.0 * inside as f64 / all.max(1) as f64)
    };
    let (right, other): (Vec<&Case>, Vec<&Case>) = cases.iter().partition(|case| case.verdict == "right");
    println!("parameters within ci95: {}", sum(&all, &|case| case.covered));
    println!(
        "sigma_mm holds: right {}; other {}",
        sum(&right, &|c| c.sigma_covered),
        sum(&other, &|c| c.sigma_covered)
    );
    println!("reliability: least posterior of a cell's names, how often all of them are there");
    for (low, high) in [(0.0, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 0.97), (0.97, 0.99), (0.99, 1.01)] {
        let of: Vec<bool> =
            cases.iter().filter_map(|c| c.said).filter(|(p, _)| (low..high).contains(p)).map(|(_, t)| t).collect();
        let true_ones = of.iter().filter(|t| **t).count();
        println!("  {low:.2}-{:.2}  {true_ones:>4} of {:<4}", f64::min(high, 1.0), of.len());
    }
    let planned: Vec<(f64, bool)> = cases.iter().filter_map(|c| Some((c.planned?, c.verdict == "right"))).collect();
    if !planned.is_empty() {
        println!("plans: chance of a right name as said, mean of it, how often it was right");
    }
    for (low, high) in [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 0.9), (0.9, 1.01)] {
        let of: Vec<(f64, bool)> = planned.iter().copied().filter(|(p, _)| (low..high).contains(p)).collect();
        if !of.is_empty() {
            let mean = of.iter().map(|(p, _)| p).sum::<f64>() / of.len() as f64;
            let right = of.iter().filter(|(_, right)| *right).count();
            println!("  {low:.2}-{:.2}  {mean:.2}  {right:>4} of {:<4}", f64::min(high, 1.0), of.len());
        }
    }
    println!("{:.1} s in all", cases.iter().map(|case| case.seconds).sum::<f64>());
}
