//! Documents that comments and other documents point to are in the repository.

use crate::sources::files_with_ending;
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Names of documents of the project's beginnings, which a reader of it does not have.
const ELSEWHERE: [&str; 5] = ["INTERFACE", "PHYSICS", "LANGUAGES", "KRL_LS", "CRATES"];

/// Words of a text that name a Markdown file.
fn cited(text: &str) -> impl Iterator<Item = &str> {
    let part = |c: char| !(c.is_ascii_alphanumeric() || matches!(c, '.' | '/' | '-' | '_'));
    text.split(part).map(|word| word.trim_matches('.')).filter(|word| word.len() > 3 && word.ends_with(".md"))
}

#[test]
fn every_document_that_a_comment_cites_is_there() {
    let folders = ["src", "crates", "tests", "benches", "examples"];
    let files = folders.into_iter().flat_map(|folder| files_with_ending(Path::new(ROOT).join(folder), "rs"));
    let sources: Vec<PathBuf> = files.collect();
    assert!(sources.len() > 100);
    for path in sources {
        let text = std::fs::read_to_string(&path).unwrap();
        for line in text.lines().filter_map(|line| line.split_once("//").map(|(_, comment)| comment)) {
            for document in cited(line) {
                let there =
                    [ROOT, &format!("{ROOT}/docs")].iter().any(|folder| Path::new(folder).join(document).is_file());
                assert!(there, "{} cites {document}: {line}", path.display());
            }
            if !path.ends_with("documents.rs") {
                let word = |line: &str, name: &str| {
                    line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).any(|word| word == name)
                };
                let gone = ELSEWHERE.iter().find(|name| word(line, name));
                assert!(gone.is_none(), "{} cites {}: {line}", path.display(), gone.unwrap());
            }
        }
    }
}

#[test]
fn links_between_documents_lead_somewhere() {
    let mut pages = files_with_ending(Path::new(ROOT).join("docs"), "md");
    pages.extend(
        ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md"].map(|name| Path::new(ROOT).join(name)),
    );
    for page in pages {
        let text = std::fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap();
            if file.is_empty() || file.contains(':') || file.contains(' ') {
                continue;
            }
            assert!(page.parent().unwrap().join(file).exists(), "{} links to {link}", page.display());
        }
    }
}
