//! The page of messages has every code of the code, and no other.

use crate::sources::code_without_tests;
use std::collections::BTreeSet;
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Quoted words of the sources that look like codes: keys of the cell file and names of files.
const NO_CODES: [&str; 19] = [
    "cell.unknown-", "cl.harmless", "cl.point", "cl.spin", "cl.third-vector", "cl.tools", "cl.units", "cut.force",
    "cut.frame", "plan.csv", "plan.effects", "plan.instrument", "plan.tool", "plan.wobj", "poses.csv", "report.csv",
    "robot.kinematics", "robot.model", "stock.stl",
];

fn is_code(word: &str) -> bool {
    let is_part = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_lowercase() || b == b'-');
    word.split_once('.').is_some_and(|(area, name)| is_part(area) && is_part(name))
}

/// Codes of the page, in its tables.
fn documented() -> BTreeSet<String> {
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/messages.md")).unwrap();
    let codes = page.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
    let all: Vec<String> = codes.map(str::to_owned).collect();
    let set: BTreeSet<String> = all.iter().cloned().collect();
    assert_eq!(all.len(), set.len(), "a code stands twice");
    set
}

/// Quoted words of the sources, without tests, comments and the examples in comments.
fn quoted() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (_, code) in code_without_tests() {
        let statements = code.lines().filter(|line| !line.trim_start().starts_with("//"));
        found.extend(statements.flat_map(|line| line.split('"').skip(1)).map(str::to_owned));
    }
    found
}

#[test]
fn every_code_has_its_row() {
    let (documented, quoted) = (documented(), quoted());
    for code in &documented {
        assert!(quoted.contains(code), "docs/messages.md: no message has the code `{code}`");
    }
    let areas: BTreeSet<&str> =
        documented.iter().filter_map(|code| code.split_once('.')).map(|(area, _)| area).collect();
    let is_known = |word: &&String| areas.contains(word.split('.').next().unwrap()) && is_code(word);
    let is_other = |word: &&String| !NO_CODES.contains(&&***word);
    let missing: Vec<&String> =
        quoted.iter().filter(is_known).filter(is_other).filter(|word| !documented.contains(*word)).collect();
    assert!(missing.is_empty(), "docs/messages.md has no row for {missing:?}");
}
