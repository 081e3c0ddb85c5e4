//! What is built in and what releases are made with: sources, duplicates, pins and rights.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

fn read(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

/// Packages of a lock file.
fn packages(name: &str) -> Vec<toml::Table> {
    let lock: toml::Table = toml::from_str(&read(name)).unwrap();
    lock["package"].as_array().unwrap().iter().map(|package| package.as_table().unwrap().clone()).collect()
}

#[test]
fn every_crate_comes_from_the_one_registry_with_its_checksum() {
    const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";
    for lock in ["Cargo.lock", "fuzz/Cargo.lock"] {
        for package in packages(lock) {
            let name = package["name"].as_str().unwrap();
            match package.get("source").map(|source| source.as_str().unwrap()) {
                Some(source) => assert!(source == REGISTRY && package.contains_key("checksum"), "{lock}: {name}"),
                None => assert!(name.starts_with("deflex"), "{lock}: {name} has no source"),
            }
        }
    }
}

/// The list of `deny.toml` is the list of crates that are there twice, and holds no other.
#[test]
fn a_crate_that_is_there_twice_has_its_reason() {
    let mut versions: BTreeMap<String, usize> = BTreeMap::new();
    for package in packages("Cargo.lock") {
        *versions.entry(package["name"].as_str().unwrap().to_owned()).or_default() += 1;
    }
    let twice: BTreeSet<String> = versions.into_iter().filter(|(_, count)| *count > 1).map(|(name, _)| name).collect();
    let deny: toml::Table = toml::from_str(&read("deny.toml")).unwrap();
    let skipped =
        deny["bans"]["skip"].as_array().unwrap().iter().map(|skip| skip["crate"].as_str().unwrap().to_owned());
    assert_eq!(twice, skipped.collect());
}

/// An action is pinned to a commit, with its version in a comment, because a tag could be moved to another commit.
#[test]
fn actions_are_pinned_by_commit() {
    for workflow in [
        ".github/workflows/pull-request.yml",
        ".github/workflows/release.yml",
        "samples/ci/.github/workflows/toolpaths.yml",
    ] {
        let text = read(workflow);
        let uses: Vec<&str> =
            text.lines().filter_map(|line| line.split_once("uses: ").map(|(_, action)| action)).collect();
        assert!(!uses.is_empty(), "{workflow}");
        for action in uses {
            let (name, version) =
                action.split_once(" # v").unwrap_or_else(|| panic!("{workflow}: {action} names no version"));
            let commit = name.split_once('@').map_or("", |(_, commit)| commit);
            let hash = commit.len() == 40 && commit.bytes().all(|byte| byte.is_ascii_hexdigit());
            assert!(hash && version.starts_with(|c: char| c.is_ascii_digit()), "{workflow}: {action}");
        }
    }
}

/// A job of the release workflow by its name.
fn job<'a>(workflow: &'a str, name: &str) -> &'a str {
    let from = workflow.find(&format!("\n  {name}:\n")).unwrap_or_else(|| panic!("no job {name}")) + 1;
    let rest = &workflow[from..];
    let end = rest
        .match_indices("\n  ")
        .map(|(at, _)| at)
        .find(|at| rest[at + 3..].starts_with(|c: char| c.is_ascii_lowercase()));
    &rest[..end.unwrap_or(rest.len())]
}

#[test]
fn each_publishing_job_has_the_rights_of_its_place_alone() {
    let workflow = read(".github/workflows/release.yml");
    let writes = |name: &str| -> Vec<String> {
        let lines = job(&workflow, name).lines().map(str::trim);
        lines.filter_map(|line| line.strip_suffix(": write")).map(str::to_owned).collect()
    };
    let none: &[&str] = &[];
    for (name, rights) in [
        ("check", none),
        ("supply-chain", none),
        ("binaries", none),
        ("wheels", none),
        ("container", &["packages"]),
        ("attest", &["id-token", "attestations"]),
        ("release", &["contents"]),
        ("crate", none),
        ("python-index", &["id-token"]),
    ] {
        assert_eq!(writes(name), rights, "{name}");
    }
    // The secrets and the tokens of a checkout are nowhere near a build.
    assert_eq!(
        workflow.matches("CARGO_REGISTRY_TOKEN").count(),
        job(&workflow, "crate").matches("CARGO_REGISTRY_TOKEN").count()
    );
    assert_eq!(workflow.matches("actions/checkout@").count(), workflow.matches("persist-credentials: false").count());
}
