//! Plain words: the README, the documentation and the messages have no words of a private style and no sentence that is too long.

use crate::sources::code_without_tests;
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Words that stood for the exact term in older texts, with what to write.
const WORDS: [(&str, &str); 13] = [
    ("behind", "after, behind in space only by another word: on the far side of"),
    ("beside", "next to, together with, in addition to"),
    ("told", "reported, named, distinguished"),
    ("asked", "computed, called, read"),
    ("nobody", "no program, no file, no operator"),
    ("anybody", "a person, a program"),
    ("somebody", "a person, an operator"),
    ("whoever", "who"),
    ("mend", "correct, repair, solve"),
    ("mends", "corrects, repairs, solves"),
    ("mended", "corrected, repaired, solved"),
    ("heed", "follow, obey"),
    ("heeded", "followed, obeyed"),
];

/// Words of a sentence, from which on a reader has to begin again: plain-language guides name 20 to 25 on average and 35 at most.
const LONGEST: usize = 35;

/// Nouns that have a plural in texts with a count.
const COUNTED: [&str; 12] = [
    "targets", "rows", "programs", "motions", "files", "findings", "points", "lines", "changes", "effects", "axes",
    "joints",
];

/// What is wrong with a text without markup.
fn faults(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for sentence in sentences(text) {
        let words: Vec<&str> = sentence
            .split(|c: char| !(c.is_alphanumeric() || "’'°µ_./%-⁻¹²³".contains(c)))
            .map(|word| word.trim_matches(['.', '\'', '’', '-', '/']))
            .filter(|word| !word.is_empty())
            .collect();
        if words.len() > LONGEST {
            found.push(format!("{} words: {sentence}", words.len()));
        }
        for word in &words {
            if let Some((_, instead)) = WORDS.iter().find(|(private, _)| word.eq_ignore_ascii_case(private)) {
                found.push(format!("`{word}` (write: {instead}): {sentence}"));
            }
        }
        for pair in words.windows(2) {
            if pair[0] == "1" && COUNTED.contains(&pair[1]) {
                found.push(format!("`1 {}`: {sentence}", pair[1]));
            }
        }
    }
    found
}

/// Sentences of a paragraph: they end with a full stop, a question mark or an exclamation mark before a new beginning.
fn sentences(text: &str) -> Vec<String> {
    let mut all = vec![String::new()];
    let characters: Vec<char> = text.chars().collect();
    for (i, &c) in characters.iter().enumerate() {
        all.last_mut().unwrap().push(c);
        let next = characters[i + 1..].iter().find(|c| !c.is_whitespace());
        let is_apart = characters.get(i + 1).is_some_and(|c| c.is_whitespace());
        let begins = next.is_some_and(|c| c.is_uppercase() || c.is_ascii_digit() || "\"`*(…".contains(*c));
        if ".!?".contains(c) && is_apart && begins {
            all.push(String::new());
        }
    }
    all.retain(|sentence| !sentence.trim().is_empty());
    all
}

/// Paragraphs, list items and cells of a page with the lines that they begin on; code blocks and headings are left out.
fn paragraphs(page: &str) -> Vec<(usize, String)> {
    let mut found: Vec<(usize, String)> = Vec::new();
    let (mut is_open, mut is_code) = (false, false);
    for (number, line) in (1..).zip(page.lines()) {
        let text = line.trim_start();
        if text.starts_with("```") {
            (is_code, is_open) = (!is_code, false);
            continue;
        }
        if is_code || text.is_empty() || text.starts_with('#') {
            is_open = false;
            continue;
        }
        if let Some(row) = text.strip_prefix('|') {
            is_open = false;
            let cells = row.replace("\\|", "/");
            found.extend(cells.split('|').map(|cell| (number, cell.trim().to_owned())));
            continue;
        }
        let item = text.trim_start_matches(|c: char| c.is_ascii_digit()).strip_prefix(". ");
        let item = item.or(text.strip_prefix("- ")).or(text.strip_prefix("* "));
        match (is_open && item.is_none(), found.last_mut()) {
            (true, Some((_, paragraph))) => *paragraph += &format!(" {text}"),
            _ => found.push((number, item.unwrap_or(text).to_owned())),
        }
        is_open = true;
    }
    found
}

/// A paragraph as it is read: of links their text, and names of code as one word.
fn plain(paragraph: &str) -> String {
    let mut out = String::new();
    for (i, part) in paragraph.split('`').enumerate() {
        out += if i % 2 == 0 { part } else { "CODE" };
    }
    while let Some(from) = out.find("](") {
        let to = out[from..].find(')').map_or(out.len(), |at| from + at + 1);
        out.replace_range(from..to, "");
    }
    // A list of names is one word.
    for between in [", ", " and ", " or ", " to "] {
        while out.contains(&format!("CODE{between}CODE")) {
            out = out.replace(&format!("CODE{between}CODE"), "CODE");
        }
    }
    out.replace(['[', '*'], "")
}

#[test]
fn documents_are_in_plain_words() {
    let root = Path::new(ROOT);
    let mut pages: Vec<PathBuf> =
        ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "python/README.md"]
            .map(|name| root.join(name))
            .into();
    pages.extend(["ci", "closed-loop", "hard-cases"].map(|sample| root.join("samples").join(sample).join("README.md")));
    pages.extend(std::fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path()));
    pages.retain(|page| page.extension().is_some_and(|ending| ending == "md"));
    assert!(pages.len() > 30);
    let mut found = Vec::new();
    for page in pages {
        let text = std::fs::read_to_string(&page).unwrap();
        for (line, paragraph) in paragraphs(&text) {
            found.extend(faults(&plain(&paragraph)).iter().map(|fault| format!("{}:{line}: {fault}", page.display())));
        }
    }
    assert!(found.is_empty(), "{} findings:\n{}", found.len(), found.join("\n"));
}

/// Texts in quotes of a source file, without its comments.
fn literals(source: &str) -> Vec<String> {
    let bytes: Vec<char> = source.chars().collect();
    let (mut found, mut i) = (Vec::new(), 0);
    let at = |i: usize| bytes.get(i).copied().unwrap_or('\0');
    while i < bytes.len() {
        match (at(i), at(i + 1)) {
            ('/', '/') => i += bytes[i..].iter().take_while(|c| **c != '\n').count(),
            ('\'', '\\') => i += 2 + bytes[i + 2..].iter().skip(1).take_while(|c| **c != '\'').count() + 2,
            ('\'', _) if at(i + 2) == '\'' => i += 3,
            ('r', '"' | '#') if !at(i.wrapping_sub(1)).is_alphanumeric() => {
                let hashes = bytes[i + 1..].iter().take_while(|c| **c == '#').count();
                if at(i + 1 + hashes) != '"' {
                    i += 1;
                    continue;
                }
                let from = i + 2 + hashes;
                let is_end = |j: usize| at(j) == '"' && (1..=hashes).all(|k| at(j + k) == '#');
                let to = (from..bytes.len()).find(|&j| is_end(j)).unwrap_or(bytes.len());
                found.push(bytes[from..to].iter().collect());
                i = to + 1 + hashes;
            }
            ('"', _) => {
                let (from, mut to) = (i + 1, i + 1);
                while to < bytes.len() && bytes[to] != '"' {
                    to += if bytes[to] == '\\' { 2 } else { 1 };
                }
                let text: String = bytes[from..to.min(bytes.len())].iter().collect();
                let mut joined = String::new();
                let mut lines = text.split("\\\n");
                joined += lines.next().unwrap_or_default();
                lines.for_each(|line| joined += line.trim_start());
                found.push(joined);
                i = to + 1;
            }
            _ => i += 1,
        }
    }
    found
}

/// Lists of the routines of a language, which are read by the parser.
const WORD_LISTS: [&str; 2] = ["crates/lang/src/inform/words.rs", "crates/lang/src/urscript/builtins.rs"];

/// Texts of the sources that people read, by their file: those of several words.
fn messages() -> Vec<(String, String)> {
    let mut found = Vec::new();
    for (path, code) in code_without_tests() {
        let name = path.strip_prefix(ROOT).unwrap().display().to_string();
        if WORD_LISTS.contains(&&*name) {
            continue;
        }
        let read = literals(&code).into_iter().filter(|text| text.split_whitespace().count() > 3);
        found.extend(read.map(|text| (name.clone(), text)));
    }
    found.sort();
    found
}

#[test]
fn literals_are_found_between_comments_and_characters() {
    let source = "// \"no\"\nlet a = '\"'; let b = \"one \\\"two\\\"\"; let c = r#\"three \"four\"#; fn d<'a>() { \"five\\\n      six\" }";
    assert_eq!(literals(source), ["one \\\"two\\\"", "three \"four", "fivesix"]);
}

/// Lines of a text of the sources without names of variables: of a page what stands between its tags.
fn lines(text: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    let (mut is_tag, mut is_name) = (false, false);
    for c in text.replace("\\n", "\n").chars() {
        is_tag = (is_tag || c == '<') && c != '>';
        is_name = (is_name || c == '{') && c != '}';
        if c == '\n' || c == '<' {
            lines.push(String::new());
        } else if c == '{' || !is_tag && !is_name && c != '>' {
            lines.last_mut().unwrap().push(c);
        }
    }
    lines.retain(|line| line.split_whitespace().count() > 2);
    lines
}

/// Texts of the pages and of the window, by their file: quoted texts of scripts, and texts between the tags of a page.
fn page_texts() -> Vec<(String, String)> {
    let mut found = Vec::new();
    for folder in ["crates/report/src/html/assets", "crates/studio/assets"] {
        for entry in std::fs::read_dir(Path::new(ROOT).join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(ROOT).unwrap().display().to_string();
            let text = std::fs::read_to_string(&path).unwrap();
            match path.extension().and_then(|ending| ending.to_str()) {
                Some("js") => {
                    let code: Vec<&str> = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
                    let quoted = code.iter().flat_map(|line| line.split(['"', '`']).skip(1).step_by(2));
                    found.extend(quoted.map(|text| (name.clone(), text.replace("${", "{"))));
                }
                Some("html") => found.push((name, text)),
                _ => {}
            }
        }
    }
    assert!(found.len() > 500, "{} texts of pages", found.len());
    found.retain(|(_, text)| text.split_whitespace().count() > 3);
    found.sort();
    found.dedup();
    found
}

#[test]
fn messages_and_pages_are_in_plain_words() {
    let mut found: Vec<String> = Vec::new();
    for (file, text) in messages().into_iter().chain(page_texts()) {
        let is_faulty = |line: &String| !faults(&plain(line)).is_empty();
        found.extend(lines(&text).iter().filter(|line| is_faulty(line)).map(|line| format!("{file}: {}", line.trim())));
    }
    found.dedup();
    assert!(found.is_empty(), "{} messages:\n{}", found.len(), found.join("\n"));
}

/// All texts of the program in one file, so that a change of words is read as such in a review.
#[test]
fn every_text_stands_in_one_file() {
    let mut file = String::new();
    let mut all = String::new();
    for (of, text) in messages().into_iter().chain(page_texts()) {
        if of != file {
            all += &format!("\n== {of}\n");
            file = of;
        }
        for line in lines(&text) {
            all += &format!("{}\n", line.trim());
        }
    }
    insta::assert_snapshot!(all.trim_start());
}
