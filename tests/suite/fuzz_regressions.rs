//! Inputs that once broke an invariant, and seeds beside them, asked again without a fuzzer.

#[path = "../../fuzz/invariants.rs"]
mod invariants;

use std::path::Path;

/// Asks `holds` of every file of a folder, and of files below it.
fn each(folder: &Path, holds: &dyn Fn(&[u8])) -> usize {
    let entries = std::fs::read_dir(folder).expect("a folder of the repository");
    let mut asked = 0;
    for entry in entries {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            asked += each(&path, holds);
        } else {
            holds(&std::fs::read(&path).expect("a file"));
            asked += 1;
        }
    }
    asked
}

/// Regressions of one target, and the fixtures that it starts from.
fn hold(target: &str, seeds: &[&str], holds: fn(&[u8])) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut asked = each(&root.join("fuzz/regressions").join(target), &holds);
    for folder in seeds {
        asked += each(&root.join(folder), &holds);
    }
    assert!(asked > 0, "no inputs for {target}");
}

#[test]
fn rapid() {
    hold("rapid", &["tests/fixtures/rapid"], invariants::rapid);
}

#[test]
fn cl() {
    hold("cl", &["tests/fixtures/cl"], invariants::cl);
}

#[test]
fn krl() {
    hold("krl", &["tests/fixtures/krl"], invariants::krl);
}

#[test]
fn tp() {
    hold("tp", &["tests/fixtures/tp"], invariants::tp);
}

#[test]
fn cell() {
    hold("cell", &["tests/fixtures/rapid/invalid"], invariants::cell);
}

#[test]
fn measured() {
    hold("measured", &["tests/fixtures/rapid/invalid"], invariants::measured);
}

#[test]
fn compensate() {
    let seeds = ["tests/fixtures/rapid", "tests/fixtures/cl", "tests/fixtures/krl", "tests/fixtures/tp"];
    hold("compensate", &seeds, invariants::compensate);
}
