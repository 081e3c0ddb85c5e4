//! Every public function, method, struct, enum and trait has an example in its documentation.
//!
//! The lint `unreachable_pub` makes sure that what is written `pub` can be used from outside, so that the text shows what is public.

use crate::sources::{files_with_ending, source_folders};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Files whose public items have no name outside of the crate, or a name that the documentation hides.
const UNNAMED: [&str; 7] = [
    "crates/lang/src/store.rs",
    "crates/lang/src/tp/lex.rs",
    "crates/lang/src/walk.rs",
    "crates/program/src/any_chunks.rs",
    "crates/program/src/chunk.rs",
    "crates/program/src/rapid/chunk.rs",
    "crates/program/src/rapid/read_chunk.rs",
];

/// A public item.
struct Item {
    /// File and line.
    place: String,
    name: String,
    /// For a method, the type that has it.
    owner: Option<String>,
    /// The code of the examples in its documentation.
    example: String,
    /// Whether the documentation hides it: the crates of deflex use it, and others need not know it.
    is_hidden: bool,
}

/// The first word of a text.
fn word(text: &str) -> &str {
    text.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default()
}

/// The name of a public item, if the line declares one that needs an example.
fn declared(line: &str) -> Option<&str> {
    let rest = line.trim_start().strip_prefix("pub ")?;
    let rest = rest.strip_prefix("const ").filter(|rest| rest.starts_with("fn ")).unwrap_or(rest);
    ["fn ", "struct ", "enum ", "trait "].iter().find_map(|kind| rest.strip_prefix(kind)).map(word)
}

/// The type of `impl<T> Type<T> {`.
fn implemented(line: &str) -> Option<&str> {
    let mut rest = line.strip_prefix("impl")?;
    if rest.starts_with('<') {
        let mut depth = 0;
        let end = rest.find(|c| {
            depth += i32::from(c == '<') - i32::from(c == '>');
            depth == 0
        })?;
        rest = &rest[end + 1..];
    }
    Some(word(rest.trim_start()))
}

fn items(path: &Path) -> Vec<Item> {
    let text = std::fs::read_to_string(path).unwrap();
    let (mut out, mut example, mut inside, mut is_hidden) = (Vec::new(), String::new(), false, false);
    let mut owner = None;
    for (i, line) in text.lines().enumerate() {
        if line.starts_with("mod ") && line.ends_with('{') {
            break; // unit tests end a file
        }
        if let Some(doc) = line.trim_start().strip_prefix("///") {
            if doc.trim_start().starts_with("```") {
                inside = !inside;
            } else if inside {
                example.push_str(doc);
                example.push('\n');
            }
            continue;
        }
        if line.starts_with("impl") {
            owner = implemented(line).map(ToOwned::to_owned);
        } else if line == "}" {
            owner = None;
        }
        if let Some(name) = declared(line) {
            let place = format!("{}:{}", path.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap().display(), i + 1);
            out.push(Item {
                place,
                name: name.to_owned(),
                owner: owner.clone(),
                example: std::mem::take(&mut example),
                is_hidden: std::mem::take(&mut is_hidden),
            });
        } else if line.trim_start().starts_with("#[") {
            is_hidden |= line.trim_start() == "#[doc(hidden)]";
        } else {
            example.clear();
            is_hidden = false;
        }
    }
    out
}

#[test]
fn every_public_item_has_an_example() {
    let mut without = Vec::new();
    for folder in source_folders() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut files = files_with_ending(&folder, "rs");
        files.retain(|file| !UNNAMED.iter().any(|unnamed| file.starts_with(root.join(unnamed))));
        let items: Vec<Item> = files.iter().flat_map(|path| items(path)).collect();
        assert!(!items.is_empty(), "{} has public items", folder.display());
        // A method needs no example of its own if that of its type calls it.
        let types: BTreeMap<&str, String> =
            items.iter().filter(|item| item.owner.is_none()).fold(BTreeMap::new(), |mut types, item| {
                types.entry(item.name.as_str()).or_insert_with(String::new).push_str(&item.example);
                types
            });
        let hidden: BTreeSet<&str> =
            items.iter().filter(|item| item.owner.is_none() && item.is_hidden).map(|item| item.name.as_str()).collect();
        let is_hidden =
            |item: &Item| item.is_hidden || item.owner.as_deref().is_some_and(|owner| hidden.contains(owner));
        let shown = |item: &Item| {
            let example = item.owner.as_deref().and_then(|owner| types.get(owner));
            example.is_some_and(|example| {
                let mut calls =
                    example.match_indices(&item.name).map(|(at, name)| (&example[..at], &example[at + name.len()..]));
                calls.any(|(before, after)| before.ends_with(['.', ':']) && after.starts_with(['(', ')']))
            })
        };
        without.extend(items.iter().filter(|item| item.example.is_empty() && !is_hidden(item) && !shown(item)).map(
            |item| {
                let owner = item.owner.as_ref().map_or(String::new(), |owner| format!("{owner}::"));
                format!("{} {owner}{}", item.place, item.name)
            },
        ));
    }
    assert!(without.is_empty(), "{} public items have no example:\n{}", without.len(), without.join("\n"));
}
