//! The folders of `src` are layers: each imports from those before it alone, in the order of the table in `ARCHITECTURE.md`.

use std::collections::BTreeSet;
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

/// Layers that a text names, without its comments and its own tests.
fn named(text: &str) -> BTreeSet<String> {
    let code = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let code: Vec<&str> = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let code = code.join("\n");
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
