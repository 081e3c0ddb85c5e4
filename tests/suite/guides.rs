//! The guides for contributors list the files that an addition touches: the lists are those of the repository.

use crate::sources::files_below;
use std::collections::BTreeSet;
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn page(guide: &str) -> String {
    std::fs::read_to_string(Path::new(ROOT).join("docs").join(guide)).unwrap()
}

/// Paths in the first column of a guide's tables, with `NAME` replaced.
fn listed(page: &str, name: &str) -> BTreeSet<String> {
    let first = page.lines().filter_map(|line| line.strip_prefix("| ")?.split_once(" |")).map(|(first, _)| first);
    let paths = first.flat_map(|cell| cell.split('`').skip(1).step_by(2)).filter(|path| path.contains('/'));
    paths.map(|path| path.replace("NAME", name)).collect()
}

/// Files below some folders whose text contains one of some words.
fn containing(folders: &[&str], words: &[&str]) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for path in folders.iter().flat_map(|folder| files_below(Path::new(ROOT).join(folder))) {
        if let Ok(text) = std::fs::read_to_string(&path)
            && words.iter().any(|word| text.contains(word))
        {
            let within = path.strip_prefix(ROOT).unwrap().components();
            found.insert(within.map(|part| part.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/"));
        }
    }
    found
}

/// An effect that depends on nothing that others do not depend on too.
const EFFECT: &str = "cable_pull";
/// Words of what the newest effect added to the state on which effects depend: its type, its values and its module.
const NEW_FIELD: [&str; 4] = ["CuttingTorque", "torque: None,", "torque_between", "mod loads_before;"];
/// The heading of the guide from which on the files of such a field are listed.
const NEW_STATE: &str = "## If the effect depends on something new";

#[test]
fn the_guide_of_effects_lists_the_files_of_an_effect() {
    let mut found = containing(&["src", "crates", "tests", "samples", "examples", "benches", "docs"], &[EFFECT]);
    // These two speak of the effect as an example.
    for page in ["docs/add-an-effect.md", "tests/suite/guides.rs"] {
        assert!(found.remove(page), "{page}");
    }
    let guide = page("add-an-effect.md");
    let (usual, new_state) = guide.split_once(NEW_STATE).unwrap();
    assert_eq!(found, listed(usual, EFFECT));
    let mut found = containing(&["src", "crates", "tests/suite"], &NEW_FIELD);
    // The effect's own file, and this one.
    for page in ["crates/effects/src/creep.rs", "tests/suite/guides.rs"] {
        assert!(found.remove(page), "{page}");
    }
    assert_eq!(found, listed(new_state, EFFECT));
}

#[test]
fn the_guide_of_robots_lists_the_files_of_a_robot() {
    let library = std::fs::read_to_string(Path::new(ROOT).join("crates/robot/src/library.toml")).unwrap();
    let vectors = std::fs::read_to_string(Path::new(ROOT).join("tests/fixtures/robots/forward.csv")).unwrap();
    let listed = listed(&page("add-a-robot.md"), "");
    let vector = vectors.lines().last().unwrap().split(',').next().unwrap();
    assert!(library.contains(&format!("model = \"{vector}\"")), "{vector}");
    assert_eq!(listed, containing(&["src", "crates", "tests"], &[vector]));
    // Each key of an entry has its row.
    let guide = page("add-a-robot.md");
    let keys: BTreeSet<&str> = library
        .lines()
        .filter(|line| !line.starts_with(['#', '[']))
        .filter_map(|line| line.split_once(" = ").map(|(key, _)| key))
        .collect();
    for key in keys {
        assert!(guide.contains(&format!("`{key}`")), "docs/add-a-robot.md does not explain `{key}`");
    }
}

#[test]
fn the_guide_of_languages_lists_where_the_code_decides_by_language() {
    let mut found = containing(&["src", "crates"], &["Language::Krl", "Language::Ls"]);
    // A language's own reader, and the tests of crates.
    let is_own =
        |path: &str| ["crates/program/src/krl/", "crates/program/src/tp/"].iter().any(|own| path.starts_with(own));
    found.retain(|path| !is_own(path) && !path.contains("/tests/"));
    assert_eq!(found, listed(&page("add-a-language.md"), ""));
}
