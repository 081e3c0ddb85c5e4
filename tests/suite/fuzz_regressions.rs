//! Inputs that once broke an invariant, and seeds of the fuzzer, run again without a fuzzer.

#[path = "../../fuzz/invariants.rs"]
mod invariants;

use crate::sources::files_below;
use std::path::Path;

/// Regressions of one target, and the fixtures that it starts from.
fn hold(target: &str, seeds: &[&str], holds: fn(&[u8])) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let own = root.join("fuzz/regressions").join(target);
    let folders = seeds.iter().map(|folder| root.join(folder)).chain([own]);
    let files: Vec<_> = folders.flat_map(files_below).collect();
    files.iter().for_each(|path| holds(&std::fs::read(path).expect("a file")));
    assert!(!files.is_empty(), "no inputs for {target}");
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
fn ur() {
    hold("ur", &["tests/fixtures/ur"], invariants::ur);
}

#[test]
fn jbi() {
    hold("jbi", &["tests/fixtures/jbi"], invariants::jbi);
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
    let seeds = ["rapid", "cl", "krl", "tp", "ur", "jbi"].map(|language| format!("tests/fixtures/{language}"));
    hold("compensate", &seeds.each_ref().map(String::as_str), invariants::compensate);
}

/// A function that must hold for any bytes, the seeds that mutations start from, and words that its files are made of.
type Target = (&'static str, fn(&[u8]), &'static [&'static str], &'static [&'static str]);

const MUTATED: [Target; 4] = [
    (
        "urdf",
        invariants::urdf,
        &["arm.urdf"],
        &["\"", "<", "/>", "&#x1;", "nan", "inf", "-1e308", "fixed", "tool0", "<joint", "\u{2028}", "xyz=\""],
    ),
    (
        "backup",
        invariants::backup,
        &["backup.cfg"],
        &["\"", "\\\n", "-name", "nan", "1e999", "ROBOT:", "\u{7}", "MODULE", "]", "PERS tooldata "],
    ),
    (
        "stl",
        invariants::stl,
        &["text.stl", "binary.stl"],
        &["solid", "vertex", "nan", "1e38", "endfacet", "\0\0", "\n"],
    ),
    (
        "marker",
        invariants::marker,
        &["marker.json"],
        &["\"", "null", "../", "/", "rename", "overwrite", "{", "mine.txt", "[", "0"],
    ),
];

/// Bytes with up to eight changes: bits, bytes, pieces taken out, doubled or moved, words.
fn mutated(seed: &[u8], words: &[&str], random: &mut impl FnMut(usize) -> usize) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=random(8) {
        let at = random(bytes.len() + 1);
        let end = (at + random(24)).min(bytes.len());
        match random(6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random(8),
            1 if at < bytes.len() => bytes[at] = random(256) as u8,
            2 => drop(bytes.drain(at..end)),
            3 => {
                let piece = bytes[at..end].to_vec();
                let to = random(bytes.len() + 1);
                bytes.splice(to..to, piece);
            }
            4 => bytes.truncate(at.max(1)),
            _ => drop(bytes.splice(at..at, words[random(words.len())].bytes())),
        }
    }
    bytes
}

/// Asks each target of so many mutations of its seeds.
fn mutations(executions: usize) {
    for (name, holds, seeds, words) in MUTATED {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
        let seeds: Vec<Vec<u8>> = seeds.iter().map(|seed| std::fs::read(folder.join(seed)).expect("a seed")).collect();
        // xorshift64 (Marsaglia): the same mutations each time.
        let mut state = 0x2545_f491_4f6c_dd1d_u64;
        let mut random = |below: usize| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 33) as usize % below.max(1)
        };
        seeds.iter().for_each(|seed| holds(seed));
        for i in 0..executions {
            holds(&mutated(&seeds[i % seeds.len()], words, &mut random));
        }
        println!("{name}: {executions} executions");
    }
}

#[test]
fn what_init_and_recovery_read_holds_for_mutations() {
    mutations(300);
}

#[test]
#[ignore = "minutes: DEFLEX_EXECUTIONS=1000000 cargo test --test suite -- --ignored --nocapture fuzz_regressions"]
fn a_million_mutations() {
    let wanted = std::env::var("DEFLEX_EXECUTIONS").ok().and_then(|count| count.parse().ok());
    mutations(wanted.unwrap_or(1_000_000));
}
