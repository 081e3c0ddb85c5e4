//! The loop on data of other programs: the practice cells (an independent simulator) and real robots.

#![allow(clippy::unwrap_used, clippy::print_stderr)] // helpers of tests; a skipped test says so

use deflex::cell::{Cell, extended};
use deflex::correct::{Options, predict};
use deflex::identify::{Identification, Input, identify};
use deflex::measured::{Table, TargetRef};
use deflex::program::{Program, rapid};
use deflex::text::Source;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Data that is not ours to keep stands beside the repository, or where `DEFLEX_SHARED` says.
fn shared(folder: &str) -> Option<PathBuf> {
    let root = std::env::var("DEFLEX_SHARED").unwrap_or_else(|_| "../shared".into());
    let path = Path::new(&root).join(folder);
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("skipped: {} is not here", path.display());
    None
}

fn source(path: &Path) -> Source {
    Source::new(path.display().to_string(), std::fs::read(path).unwrap())
}

fn program(path: &Path) -> Program {
    rapid::read(vec![source(path)], Vec::new()).unwrap()
}

fn cell(path: &Path) -> Cell {
    Cell::read(&source(path)).unwrap()
}

fn of_folder(folder: &Path) -> Identification {
    let cell = cell(&folder.join("cell.toml"));
    let runs = [(program(&folder.join("part.mod")), Table::read(&source(&folder.join("measured.csv"))).unwrap())];
    identify(&Input { cell: &cell, runs: &runs, poses: &[], tool: None, data_hash: "test" }).unwrap()
}

/// Measured minus predicted on a program that was never fitted, mm rms.
fn transfer(folder: &Path, found: &Identification) -> f64 {
    let text = String::from_utf8(source(&folder.join("cell.toml")).bytes).unwrap();
    let cell = Cell::read(&Source::new("extended", extended(&text, &found.extended).unwrap().into_bytes())).unwrap();
    let table = Table::read(&source(&folder.join("transfer_measured.csv"))).unwrap();
    let options = Options { forces: Some(table.forces()), ..Options::default() };
    let rows = predict(&program(&folder.join("transfer.mod")), &cell, &options, None).unwrap().rows;
    let gaps: Vec<f64> = table
        .rows
        .iter()
        .filter_map(|row| {
            let Some(TargetRef::Ordinal(ordinal)) = row.target else { return None };
            let (seen, there) = (row.position_mm?, rows.iter().find(|r| r.target == ordinal)?);
            Some((0..3).map(|k| (seen[k] - there.position_mm[k] - there.error_mm[k]).powi(2)).sum())
        })
        .collect();
    (gaps.iter().sum::<f64>() / gaps.len() as f64).sqrt()
}

/// The three-dimensional floor of a truth, mm.
fn floor(truth: &Value) -> f64 {
    let part = |key: &str| truth[key].as_f64().unwrap_or(0.0);
    (3.0 * (part("sigma_mm").powi(2) + part("wander_mm").powi(2))).sqrt()
}

#[test]
fn the_practice_cells_are_named_and_transfer() {
    let Some(practice) = shared("practice") else { return };
    for name in ["none", "gravity", "backlash", "base_compliance", "thermal_and_zero"] {
        let folder = practice.join(name);
        let truth: Value = serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
        let floor = floor(&truth);
        let found = of_folder(&folder);
        let mut wanted: Vec<&str> =
            truth["effect"].as_array().unwrap().iter().map(|e| e["kind"].as_str().unwrap()).collect();
        let mut named: Vec<&str> = found.added.iter().map(|a| a.kind.as_str()).collect();
        wanted.sort_unstable();
        named.sort_unstable();
        assert_eq!(named, wanted, "{name}");
        assert!(!found.unexplained.significant, "{name}");
        let ratio = found.noise_floor_rms_mm / floor;
        assert!((0.9..1.1).contains(&ratio), "{name}: floor off by {ratio}");
        assert!(found.after.rms_mm < 1.2 * found.noise_floor_rms_mm, "{name}: {:?}", found.after);
        let transfer = transfer(&folder, &found);
        assert!(transfer < 1.5 * floor, "{name}: transfer {transfer}, floor {floor}");
    }
}

#[test]
fn intervals_of_the_practice_cells_hold_the_truth() {
    let Some(practice) = shared("practice") else { return };
    let (mut inside, mut all) = (0, 0);
    for name in ["backlash", "base_compliance", "thermal_and_zero"] {
        let folder = practice.join(name);
        let truth: Value = serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
        let found = of_folder(&folder);
        for effect in truth["effect"].as_array().unwrap() {
            let added = found.added.iter().find(|a| Some(a.kind.as_str()) == effect["kind"].as_str()).unwrap();
            for p in &added.parameters {
                let (key, index) = p.name.split_once('[').unwrap_or((&p.name, ""));
                let value = match index.trim_end_matches(']').parse::<usize>() {
                    Ok(i) => effect[key][i].as_f64(),
                    Err(_) => effect[key].as_f64(),
                };
                let Some(value) = value else { continue };
                all += 1;
                inside += usize::from((p.ci95[0]..=p.ci95[1]).contains(&value));
            }
        }
    }
    // 22 numbers at 95 %: fewer than 20 inside would be worse than one in fifty.
    assert!(all >= 20 && inside + 2 >= all, "{inside} of {all} inside");
}

#[test]
fn a_real_robot_is_explained_in_stages() {
    let Some(data) = shared("data") else { return };
    let cell = cell(&data.join("ur5.toml"));
    let poses = [Table::read(&source(&data.join("ur5_grid.csv"))).unwrap()];
    let found = identify(&Input { cell: &cell, runs: &[], poses: &poses, tool: None, data_hash: "test" }).unwrap();
    let kinds: Vec<&str> = found.added.iter().map(|a| a.kind.as_str()).collect();
    for kind in ["link_geometry", "tool_frame", "joint_error_curve"] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
    // Contiguous blocks are held out: 0.063 was measured; a random choice of rows is easier.
    assert!(found.before.rms_mm > 0.9 && found.after.rms_mm < 0.07, "{:?} {:?}", found.before, found.after);
}

/// The negative control: with a joint's angles shuffled among the rows, its curve must not gain.
#[test]
fn shuffled_joint_angles_gain_nothing() {
    let Some(data) = shared("data") else { return };
    let cell = cell(&data.join("ur5.toml"));
    let mut table = Table::read(&source(&data.join("ur5_grid.csv"))).unwrap();
    let count = table.rows.len();
    // What joint 1 to 3 leave is given to other rows: the residual no longer follows any joint.
    let registered =
        identify(&Input { cell: &cell, runs: &[], poses: std::slice::from_ref(&table), tool: None, data_hash: "test" })
            .unwrap();
    let left: Vec<[f64; 3]> = registered.residuals.iter().map(|row| row.postfit_mm).collect();
    let prefit: Vec<[f64; 3]> = registered.residuals.iter().map(|row| row.prefit_mm).collect();
    for (i, row) in table.rows.iter_mut().enumerate() {
        // A step that shares no factor with the count visits every row once.
        let other = (i * 389 + 17) % count;
        let position = row.position_mm.as_mut().unwrap();
        for k in 0..3 {
            position[k] += left[other][k] - prefit[i][k];
        }
    }
    let found = identify(&Input { cell: &cell, runs: &[], poses: &[table], tool: None, data_hash: "test" }).unwrap();
    assert!(found.added.iter().all(|a| a.kind != "joint_error_curve"), "{:?}", found.added);
    assert!(found.after.rms_mm > 0.9 * found.before.rms_mm);
}

/// Some cells of the blind table, wandering noise mostly; all of it is `examples/blind_table.rs`.
#[test]
fn blind_cells_are_never_named_wrong() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/blind");
    let mut cells = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let folder = entry.unwrap().path();
        let truth: Value = serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
        let kinds: Vec<&str> =
            truth["effect"].as_array().unwrap().iter().map(|e| e["kind"].as_str().unwrap()).collect();
        let found = of_folder(&folder);
        let place = folder.display();
        for added in found.added.iter().filter(|added| added.kind != "empirical") {
            let held = kinds.contains(&added.kind.as_str())
                || added.not_told_apart_from.iter().any(|other| kinds.contains(&other.as_str()));
            assert!(held, "{place}: {} is named, {kinds:?} is there", added.kind);
        }
        let listed = kinds.iter().all(|kind| deflex::effects::kind(kind).is_some());
        assert_eq!(found.unexplained.significant, !listed, "{place}");
        if listed {
            let named = |kind: &&str| found.added.iter().any(|added| added.kind == **kind);
            assert!(kinds.iter().all(named), "{place}: {kinds:?} is not found");
            assert!(found.after.rms_mm < 1.2 * floor(&truth), "{place}: {:?}", found.after);
        }
        cells += 1;
    }
    assert!(cells >= 8);
}
