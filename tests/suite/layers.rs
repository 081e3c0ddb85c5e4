//! The crates are layers, in the order of the table in `ARCHITECTURE.md`. The files of a folder do not import one another in a circle.

use crate::sources::{files_with_ending, source_folders};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The crates in the order of the table.
fn layers() -> Vec<String> {
    let page = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let names = page
        .lines()
        .filter_map(|line| line.strip_prefix("| `crates/")?.split_once('`').map(|(name, _)| name.to_owned()));
    names.collect()
}

/// A text without its comments and its own tests.
fn code_of(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let code: Vec<&str> = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    code.join("\n")
}

/// Where a path of a `use` or an expression leads, from the module `own`; `None` if it leaves the crate.
fn target(path: &str, own: &[String]) -> Option<Vec<String>> {
    let mut at: Option<Vec<String>> = None;
    for part in path.split("::") {
        match (part, &mut at) {
            ("crate" | "deflex", None) => at = Some(Vec::new()),
            ("super", None) => at = Some(own[..own.len().checked_sub(1)?].to_vec()),
            ("super", Some(at)) => drop(at.pop()?),
            (name, Some(at)) => at.push(name.to_owned()),
            (_, None) => return None,
        }
    }
    at
}

/// The paths that begin with `crate`, `deflex` or `super` in a text without comments, with each member of a group in braces.
fn paths(code: &str) -> Vec<String> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let mut all = Vec::new();
    for (at, _) in ["crate::", "deflex::", "super::"].into_iter().flat_map(|root| code.match_indices(root)) {
        if code[..at].ends_with(is_part) {
            continue;
        }
        let length = code[at..].find(|c| !is_part(c)).unwrap_or(code.len() - at);
        let (path, rest) = code[at..].split_at(length);
        let Some(group) = path.strip_suffix("::").and(rest.strip_prefix('{')) else {
            all.push(path.to_owned());
            continue;
        };
        let (mut depth, mut member) = (0, String::new());
        for c in group.chars() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    all.push(format!("{path}{}", member.trim().trim_end_matches(":")));
                    member.clear();
                }
                c if depth == 0 => member.push(c),
                _ => {}
            }
        }
        all.push(format!("{path}{}", member.trim().trim_end_matches(":")));
    }
    all
}

/// One file or folder that imports from another one in the same folder.
struct Import {
    /// Module path of the folder; empty for the root of the crate.
    folder: String,
    from: String,
    to: String,
}

/// The imports of a crate. Its own files and those of its binary name it as `crate` and as `deflex`; the Python module names the library so.
fn imports(crate_folder: &Path) -> Vec<Import> {
    let uses_library = crate_folder.ends_with("python/src");
    let is_own = |path: &&String| !(uses_library && path.starts_with("deflex::"));
    let mut found = Vec::new();
    for path in files_with_ending(crate_folder, "rs") {
        let file = path.strip_prefix(crate_folder).unwrap();
        let mut own: Vec<String> =
            file.with_extension("").iter().map(|part| part.to_str().unwrap().to_owned()).collect();
        if ["mod", "lib", "main"].contains(&&**own.last().unwrap()) {
            own.pop();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        for target in paths(&code_of(&text)).iter().filter(is_own).filter_map(|path| target(path, &own)) {
            let shared = own.iter().zip(&target).take_while(|(own, target)| own == target).count();
            if let (Some(from), Some(to)) = (own.get(shared), target.get(shared)) {
                found.push(Import { folder: own[..shared].join("::"), from: from.clone(), to: to.clone() });
            }
        }
    }
    found
}

#[test]
fn each_crate_depends_on_crates_above_it_in_the_table() {
    let layers = layers();
    let folders = std::fs::read_dir(root().join("crates")).unwrap();
    let mut there: Vec<String> = folders.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    let mut listed = layers.clone();
    there.sort();
    listed.sort();
    assert_eq!(listed, there, "the table in ARCHITECTURE.md lists each crate once");
    for (at, name) in layers.iter().enumerate() {
        let manifest = std::fs::read_to_string(root().join("crates").join(name).join("Cargo.toml")).unwrap();
        for needed in manifest.lines().filter_map(|line| line.strip_prefix("deflex-")?.split(['.', ' ']).next()) {
            assert!(layers[..at].iter().any(|above| above == needed), "crates/{name} depends on {needed}");
        }
    }
}

/// What checks deflex shares no code with it.
#[test]
fn the_oracles_of_the_tests_depend_on_no_crate_of_deflex() {
    let manifest = std::fs::read_to_string(root().join("tests/oracles/Cargo.toml")).unwrap();
    let manifest: toml::Table = toml::from_str(&manifest).unwrap();
    let needed: Vec<&String> = manifest["dependencies"].as_table().unwrap().keys().collect();
    assert_eq!(needed, ["nalgebra", "nom"]);
    assert!(!manifest.contains_key("dev-dependencies") && !manifest.contains_key("build-dependencies"));
}

#[test]
fn files_of_a_folder_do_not_import_one_another_in_a_circle() {
    let mut circles = BTreeSet::new();
    for folder in source_folders().into_iter().chain([root().join("python/src")]) {
        let name = folder.strip_prefix(root()).unwrap().display().to_string();
        let imports = imports(&folder);
        let mut next: BTreeMap<(&str, &str), BTreeSet<&str>> = BTreeMap::new();
        for Import { folder, from, to } in &imports {
            next.entry((folder, from)).or_default().insert(to);
        }
        for &(folder, from) in next.keys() {
            let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
            while let Some(file) = open.pop() {
                open.extend(next.get(&(folder, file)).into_iter().flatten().filter(|to| reached.insert(**to)));
            }
            if reached.contains(from) {
                circles.insert(format!("{name}: {folder}::{from}"));
            }
        }
    }
    assert!(circles.is_empty(), "{circles:#?}");
}

#[test]
fn paths_are_found_in_groups() {
    let code = "use super::{a, b::{C, D}};\nuse crate::x::Y;\nlet z = super::super::k::f(my_crate::g);";
    let own = ["m", "n"].map(str::to_owned);
    let found: Vec<String> = paths(code).iter().filter_map(|path| Some(target(path, &own)?.join("::"))).collect();
    assert_eq!(found, ["x::Y", "m::a", "m::b", "k::f"]);
}
