//! The blind table: identifies every cell of a folder and compares with its `truth.json`.
//!
//! `cargo run --release --example blind_table -- FOLDER [FILTER]`; the folder comes from
//! `samples/plant/generate.py`. Each cell is a folder with `cell.toml`, `part.mod`, `measured.csv`, `truth.json` and,
//! for the transfer figure, `transfer.mod` and `transfer_measured.csv`.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use deflex::cell::{Cell, extended};
use deflex::correct::{Options, predict};
use deflex::identify::{Identification, Input, identify};
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

/// Root mean square of measured minus predicted on the transfer program, mm.
fn transfer(folder: &Path, text: &str) -> Option<f64> {
    let (part, measured) = (folder.join("transfer.mod"), folder.join("transfer_measured.csv"));
    if !part.exists() {
        return None;
    }
    let cell = Cell::read(&Source::new("extended", text.as_bytes())).ok()?;
    let table = Table::read(&source(&measured)).ok()?;
    let program = program(&part);
    let options = Options { forces: Some(table.forces()), ..Options::default() };
    let predicted = predict(&program, &cell, &options, None).ok()?;
    let mut sum = (0.0, 0.0);
    for row in &table.rows {
        let (Some(TargetRef::Ordinal(ordinal)), Some(seen)) = (&row.target, row.position_mm) else { continue };
        let there = predicted.rows.iter().find(|r| r.target == *ordinal)?;
        let gap: f64 = (0..3).map(|k| (seen[k] - there.position_mm[k] - there.error_mm[k]).powi(2)).sum();
        sum = (sum.0 + gap, sum.1 + 1.0);
    }
    Some(f64::sqrt(sum.0 / sum.1))
}

struct Case {
    group: String,
    truth: Vec<String>,
    found: Identification,
    verdict: &'static str,
    transfer: Option<f64>,
    floor: f64,
    seconds: f64,
    /// (inside, all) of the true parameters' intervals.
    covered: (usize, usize),
}

fn case(folder: &Path, root: &Path) -> Case {
    let start = std::time::Instant::now();
    let text = std::fs::read_to_string(folder.join("cell.toml")).unwrap();
    let cell = Cell::read(&Source::new("cell.toml", text.as_bytes())).unwrap();
    let runs = vec![(program(&folder.join("part.mod")), Table::read(&source(&folder.join("measured.csv"))).unwrap())];
    let input = Input { cell: &cell, runs: &runs, poses: &[], tool: None, data_hash: "blind" };
    let found = identify(&input).unwrap();
    let truth: serde_json::Value = serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
    let effects = truth["effect"].as_array().cloned().unwrap_or_default();
    let names: Vec<String> = effects.iter().map(|e| e["kind"].as_str().unwrap_or("?").to_owned()).collect();
    let listed = |name: &String| deflex::effects::kind(name).is_some();
    let unlisted = names.iter().any(|n| !listed(n));
    let named: Vec<&str> = found.added.iter().map(|a| a.kind.as_str()).collect();
    let sure = |a: &deflex::identify::Added| a.not_told_apart_from.is_empty();
    // An empirical map names nothing.
    let wrong = found.added.iter().filter(|a| a.kind != "empirical").any(|a| {
        sure(a) && !names.contains(&a.kind)
            || !sure(a) && !names.contains(&a.kind) && !a.not_told_apart_from.iter().any(|o| names.contains(o))
    });
    let all_named = names.iter().filter(|n| listed(n)).all(|n| named.contains(&n.as_str()));
    let in_sets = names
        .iter()
        .filter(|n| listed(n))
        .all(|n| found.added.iter().any(|a| a.kind == *n || a.not_told_apart_from.contains(n)));
    let verdict = if unlisted {
        if found.unexplained.significant {
            "right"
        } else if named.is_empty() {
            "missed"
        } else {
            "wrong"
        }
    } else if wrong {
        "wrong"
    } else if all_named && found.added.iter().all(sure) {
        "right"
    } else if in_sets {
        "undecided"
    } else {
        "missed"
    };
    let mut covered = (0, 0);
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
                covered.1 += 1;
                covered.0 += usize::from(p.ci95[0] - 1e-12 <= value && value <= p.ci95[1] + 1e-12);
            }
        }
    }
    let transfer = transfer(folder, &extended(&text, &found.extended).unwrap());
    let noise = |key: &str| truth[key].as_f64().unwrap_or(0.0);
    let floor = (3.0 * (noise("sigma_mm").powi(2) + noise("wander_mm").powi(2))).sqrt();
    let group = folder.parent().unwrap_or(root).strip_prefix(root).unwrap_or(folder).display().to_string();
    Case { group, truth: names, found, verdict, transfer, floor, seconds: start.elapsed().as_secs_f64(), covered }
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
    let cases: Vec<(PathBuf, Case)> = all.par_iter().map(|f| (f.clone(), case(f, &root))).collect();
    let mut table: BTreeMap<(String, String), BTreeMap<&str, usize>> = BTreeMap::new();
    for (folder, case) in &cases {
        let kind = if case.truth.is_empty() { "none".to_owned() } else { case.truth.join("+") };
        *table.entry((case.group.clone(), kind.clone())).or_default().entry(case.verdict).or_default() += 1;
        let added: Vec<String> = case
            .found
            .added
            .iter()
            .map(|a| format!("{}({:.2}|{})", a.kind, a.posterior, a.not_told_apart_from.join(",")))
            .collect();
        println!(
            "{:<40} {:<9} truth {:<28} found {:<60} unexplained {} | before {:.4} after {:.4} floor {:.4} true {:.4} | transfer {:.4} ({:.2}) | ci {}/{} | {:.1} s",
            folder.strip_prefix(&root).unwrap_or(folder).display(),
            case.verdict,
            kind,
            added.join(" "),
            case.found.unexplained.correlates.iter().map(|c| c.with.as_str()).collect::<Vec<_>>().join("; "),
            case.found.before.rms_mm,
            case.found.after.rms_mm,
            case.found.noise_floor_rms_mm,
            case.floor,
            case.transfer.unwrap_or(f64::NAN),
            case.transfer.unwrap_or(f64::NAN) / case.floor,
            case.covered.0,
            case.covered.1,
            case.seconds
        );
    }
    println!("\n{:<20} {:<34} right wrong undecided missed", "plan/noise", "truth");
    let mut sums: BTreeMap<&str, usize> = BTreeMap::new();
    for ((group, kind), counts) in &table {
        let n = |v: &str| counts.get(v).copied().unwrap_or(0);
        println!("{group:<20} {kind:<34} {:>5} {:>5} {:>9} {:>6}", n("right"), n("wrong"), n("undecided"), n("missed"));
        for (verdict, count) in counts {
            *sums.entry(verdict).or_default() += count;
        }
    }
    let covered = cases.iter().fold((0, 0), |a, (_, c)| (a.0 + c.covered.0, a.1 + c.covered.1));
    println!(
        "all {}: {sums:?}; true parameters inside their 95 % intervals: {} of {}",
        cases.len(),
        covered.0,
        covered.1
    );
}
