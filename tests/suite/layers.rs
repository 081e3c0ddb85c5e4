//! The folders of `src` are layers: each imports from those before it alone, in the order of the table in `ARCHITECTURE.md`. The files
//! of a folder do not import one another in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Folders and files of `src` in the order of the table.
fn layers() -> Vec<String> {
    let page = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let names =
        page.lines().filter_map(|line| line.strip_prefix("| `")?.split_once('`').map(|(name, _)| name.to_owned()));
    names
        .filter(|name| {
            root().join("src").join(name).is_dir() || root().join("src").join(format!("{name}.rs")).is_file()
        })
        .collect()
}

fn sources(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, all),
            false => all.extend(path.extension().is_some_and(|kind| kind == "rs").then_some(path)),
        }
    }
}

/// A text without its comments and its own tests.
fn code_of(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let code: Vec<&str> = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    code.join("\n")
}

/// Layers that a text names.
fn named(text: &str) -> BTreeSet<String> {
    let code = code_of(text);
    let after = ["crate::", "deflex::"].into_iter().flat_map(|root| code.split(root).skip(1));
    after.map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()).collect()
}

#[test]
fn no_layer_imports_from_one_after_it() {
    let layers = layers();
    assert!(layers.len() > 10, "{layers:?}");
    let mut all = Vec::new();
    sources(&root().join("src"), &mut all);
    let mut wrong = Vec::new();
    for path in all {
        let inside = path.strip_prefix(root().join("src")).unwrap();
        let first =
            inside.components().next().unwrap().as_os_str().to_str().unwrap().trim_end_matches(".rs").to_owned();
        // The library's and the binary's own files join all layers.
        if ["lib", "main"].contains(&&*first) {
            continue;
        }
        let own = layers.iter().position(|layer| *layer == first);
        let own = own.unwrap_or_else(|| panic!("{first} is no layer of the table in ARCHITECTURE.md"));
        let later = |name: &&String| layers.iter().position(|layer| layer == *name).is_some_and(|at| at > own);
        let text = std::fs::read_to_string(&path).unwrap();
        wrong.extend(named(&text).iter().filter(later).map(|name| format!("{} imports from {name}", inside.display())));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Where a path of a `use` or an expression leads, from the module `own`; `None` if it leaves the crate.
fn target(path: &str, own: &[String]) -> Option<Vec<String>> {
    let mut at: Option<Vec<String>> = None;
    for part in path.split("::") {
        match (part, &mut at) {
            ("crate", None) => at = Some(Vec::new()),
            ("super", None) => at = Some(own[..own.len().checked_sub(1)?].to_vec()),
            ("super", Some(at)) => drop(at.pop()?),
            (name, Some(at)) => at.push(name.to_owned()),
            (_, None) => return None,
        }
    }
    at
}

/// The paths that begin with `crate` or `super` in a text without comments, with each member of a group in braces.
fn paths(code: &str) -> Vec<String> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let mut all = Vec::new();
    for (at, _) in code.match_indices("crate::").chain(code.match_indices("super::")) {
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

/// For each folder of a crate, by its module path, the files and folders in it with those that each imports.
fn imports(crate_folder: &Path) -> BTreeMap<String, BTreeMap<String, BTreeSet<String>>> {
    let mut all = Vec::new();
    sources(crate_folder, &mut all);
    let mut found: BTreeMap<String, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
    for path in all {
        let inside = path.strip_prefix(crate_folder).unwrap().with_extension("");
        let mut own: Vec<String> = inside.iter().map(|part| part.to_str().unwrap().to_owned()).collect();
        if own.contains(&"tests".to_owned()) {
            continue;
        }
        if ["mod", "lib", "main"].contains(&&**own.last().unwrap()) {
            own.pop();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        for path in paths(&code_of(&text)) {
            let Some(target) = target(&path, &own) else { continue };
            let shared = own.iter().zip(&target).take_while(|(own, target)| own == target).count();
            if let (Some(from), Some(to)) = (own.get(shared), target.get(shared)) {
                let folder = found.entry(own[..shared].join("::")).or_default();
                folder.entry(from.clone()).or_default().insert(to.clone());
            }
        }
    }
    found
}

#[test]
fn files_of_a_folder_do_not_import_one_another_in_a_circle() {
    let crates = ["src", "crates/elastic/src", "crates/lang/src", "crates/studio/src"];
    let mut circles = Vec::new();
    for folder in crates {
        let imports = imports(&root().join(folder));
        assert!(!imports.is_empty(), "{folder}");
        for (module, imports) in imports {
            for file in imports.keys() {
                let (mut reached, mut open) = (BTreeSet::new(), vec![file]);
                while let Some(next) = open.pop() {
                    open.extend(imports.get(next).into_iter().flatten().filter(|to| reached.insert((*to).clone())));
                }
                if reached.contains(file) {
                    circles.push(format!("{folder}: {module}::{file}"));
                }
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
