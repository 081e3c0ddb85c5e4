//! The grammars of `grammars/` against the readers: what they derive is read, and they derive every fixture.

use deflex::program::cl::{ClOptions, Units};
use deflex::program::{Language, ReadOptions, read, round_trip};
use deflex::text::{Diagnostic, Source};
use deflex_oracles::{Deriver, Grammar, Recogniser};
use proptest::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};

/// A grammar, its first rule and the one whose derivations a reader counts.
struct Known {
    language: Language,
    grammar: Grammar,
    first: &'static str,
}

fn known(language: Language) -> Known {
    let (file, first) = match language {
        Language::Rapid => ("rapid", "parse"),
        Language::Ls => ("tp", "sections"),
        _ => (language.word(), "file"),
    };
    let text = fs::read_to_string(root().join(format!("grammars/{file}.ebnf"))).unwrap();
    Known { language, grammar: Grammar::read(&text), first }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn folder(language: Language) -> &'static str {
    if language == Language::Ls { "tp" } else { language.word() }
}

/// Files of the language in a folder, by their ending.
fn files(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|e| endings.contains(&e.to_string_lossy().as_ref())));
    files.sort();
    files
}

#[test]
fn rules_are_names_in_the_code() {
    let mut missing = Vec::new();
    for language in Language::ALL {
        let known = known(language);
        let own = root().join("crates/program/src").join(folder(language));
        let sources = match language {
            Language::Ur => vec![root().join("crates/lang/src/urscript")],
            Language::Jbi => vec![root().join("crates/lang/src/inform")],
            Language::Ls => vec![root().join("crates/lang/src/tp"), own],
            _ => vec![own],
        };
        for (name, rule) in known.grammar.rules.iter().filter(|(_, rule)| !rule.lexical) {
            let mut code = String::new();
            for (file, source) in rule.files.iter().flat_map(|file| sources.iter().map(move |source| (file, source))) {
                let within = source.join(file.trim_end_matches(".rs"));
                let parts = if within.is_dir() { files(&within, &["rs"]) } else { Vec::new() };
                for part in parts.iter().chain([&source.join(file)]).filter(|part| part.exists()) {
                    code += &fs::read_to_string(part).unwrap();
                }
            }
            let camel: String = name.split('_').map(|part| part[..1].to_uppercase() + &part[1..]).collect();
            let is_name = |word: &str| word == name || word == camel || word == name.to_uppercase();
            let found = code.split(|c: char| !c.is_alphanumeric() && c != '_').any(is_name);
            if !found {
                missing.push(format!("{language:?}: {name} in {:?}", rule.files));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn every_fixture_is_derived() {
    let mut wrong = Vec::new();
    for language in Language::ALL {
        let known = known(language);
        let endings: Vec<&str> = language.endings().iter().copied().chain(["dat"]).collect();
        let fixtures = files(&root().join("tests/fixtures").join(folder(language)).join("valid"), &endings);
        assert!(fixtures.len() > 1, "{language:?}");
        for file in fixtures {
            let bytes = fs::read(&file).unwrap();
            let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
            let text = &without_card_numbers(text);
            if let Err(stopped) = Recogniser::new(&known.grammar, text).whole(known.first) {
                let rest = String::from_utf8_lossy(&text[stopped.at..]);
                let line = 1 + text[..stopped.at].iter().filter(|byte| **byte == b'\n').count();
                wrong.push(format!("{}:{line}: {}", file.display(), rest.lines().next().unwrap_or_default()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A deck of cards without its columns 73 to 80; any other text as it is.
fn without_card_numbers(text: &[u8]) -> Vec<u8> {
    let rows = || text.split_inclusive(|byte| *byte == b'\n');
    if !rows().all(|row| row.trim_ascii_end().len() == 80) {
        return text.to_vec();
    }
    rows().flat_map(|row| [&row[..72], b"\n"].concat()).collect()
}

/// Reasons that say that a text is not understood, where one of the grammar is.
const NOT_UNDERSTOOD: [&str; 11] = [
    "jbi.syntax", "ur.syntax", "rapid.truncated", "rapid.no-module", "rapid.not-read", "krl.truncated",
    "krl.no-routine", "ls.truncated", "ls.no-section", "ls.not-read", "cl.not-cl",
];

fn reads(known: &Known, seed: u64) -> Result<(), TestCaseError> {
    let mut deriver = Deriver::new(&known.grammar, seed);
    let text = deriver.derive(known.first, 14);
    let shown = String::from_utf8_lossy(&text).into_owned();
    // A lexeme is as long as it can be: where the next one would lengthen it (a line end cut in two), the text is another one.
    prop_assume!(Recogniser::new(&known.grammar, &text).whole(known.first).is_ok());
    let options = ClOptions { units: Some(Units::Millimetre), ..ClOptions::default() };
    let options = ReadOptions { cl: &options, look: false };
    let again = |sources: Vec<Source>, context: Vec<Source>| read(known.language, sources, context, &options);
    match again(vec![Source::new("derived", text)], Vec::new()) {
        Ok(program) => {
            let proof = round_trip(&program, again);
            prop_assert!(proof.holds(), "{:?}: {shown}", proof.why);
        }
        Err(errors) => {
            let not_understood = |error: &&Diagnostic| NOT_UNDERSTOOD.contains(&error.code);
            prop_assert!(errors.iter().find(not_understood).is_none(), "{}: {shown}", errors[0]);
        }
    }
    Ok(())
}

proptest! {
    // One text in some thousands is of that kind.
    #![proptest_config(ProptestConfig { cases: 64, max_global_rejects: 3, ..ProptestConfig::default() })]

    #[test]
    fn what_the_rapid_grammar_derives_is_read(seed in any::<u64>()) {
        reads(&known(Language::Rapid), seed)?;
    }

    #[test]
    fn what_the_cl_grammar_derives_is_read(seed in any::<u64>()) {
        reads(&known(Language::Cl), seed)?;
    }

    #[test]
    fn what_the_krl_grammar_derives_is_read(seed in any::<u64>()) {
        reads(&known(Language::Krl), seed)?;
    }

    #[test]
    fn what_the_ur_grammar_derives_is_read(seed in any::<u64>()) {
        reads(&known(Language::Ur), seed)?;
    }

    #[test]
    fn what_the_jbi_grammar_derives_is_read(seed in any::<u64>()) {
        reads(&known(Language::Jbi), seed)?;
    }

    #[test]
    fn what_the_tp_grammar_derives_is_read(seed in any::<u64>()) {
        reads(&known(Language::Ls), seed)?;
    }
}
