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
    /// The file that has the import.
    file: PathBuf,
}

/// The imports of a crate. Its own files and those of its binary name it as `crate` and as `deflex`.
fn imports(crate_folder: &Path) -> Vec<Import> {
    let mut all = Vec::new();
    sources(crate_folder, &mut all);
    let mut found = Vec::new();
    for path in all {
        let file = path.strip_prefix(crate_folder).unwrap().to_owned();
        let mut own: Vec<String> =
            file.with_extension("").iter().map(|part| part.to_str().unwrap().to_owned()).collect();
        if ["mod", "lib", "main"].contains(&&**own.last().unwrap()) {
            own.pop();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        for target in paths(&code_of(&text)).iter().filter_map(|path| target(path, &own)) {
            let shared = own.iter().zip(&target).take_while(|(own, target)| own == target).count();
            if let (Some(from), Some(to)) = (own.get(shared), target.get(shared)) {
                let (folder, file) = (own[..shared].join("::"), file.clone());
                found.push(Import { folder, from: from.clone(), to: to.clone(), file });
            }
        }
    }
    found
}

#[test]
fn no_layer_imports_from_one_after_it() {
    let layers = layers();
    assert!(layers.len() > 10, "{layers:?}");
    let mut all = Vec::new();
    sources(&root().join("src"), &mut all);
    for path in all {
        let inside = path.strip_prefix(root().join("src")).unwrap().with_extension("");
        let first = inside.iter().next().unwrap().to_str().unwrap().to_owned();
        // The library's and the binary's own files join all layers.
        let is_placed = layers.contains(&first) || ["lib", "main"].contains(&&*first);
        assert!(is_placed, "{first} is no layer of the table in ARCHITECTURE.md");
    }
    let mut wrong = BTreeSet::new();
    for Import { from, to, file, .. } in imports(&root().join("src")).iter().filter(|import| import.folder.is_empty()) {
        let place = |name: &String| layers.iter().position(|layer| layer == name);
        if place(to).is_some_and(|at| at > place(from).unwrap()) {
            wrong.insert(format!("{} imports from {to}", file.display()));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn files_of_a_folder_do_not_import_one_another_in_a_circle() {
    let mut circles = BTreeSet::new();
    for name in ["src", "crates/elastic/src", "crates/lang/src", "crates/studio/src"] {
        let imports = imports(&root().join(name));
        assert!(!imports.is_empty(), "{name}");
        let mut next: BTreeMap<(&str, &str), BTreeSet<&str>> = BTreeMap::new();
        for Import { folder, from, to, .. } in &imports {
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
