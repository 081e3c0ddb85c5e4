//! Which language a file is written in.

use super::Language;
use crate::text::lines;

/// Finds the language from the content, with the file's ending as a hint for what the content leaves open.
///
/// RAPID has a `MODULE` header (behind `%%%` lines or comments); CL has `GOTO/`-like major words with a slash.
#[must_use]
pub fn detect(name: &str, bytes: &[u8]) -> Option<Language> {
    // Enough to see a header and the first statements.
    const LOOK: usize = 64 * 1024;
    let head = &bytes[..bytes.len().min(LOOK)];
    if trim(head).starts_with(b"%%%") || lines(head).any(begins_a_module) {
        return Some(Language::Rapid);
    }
    if lines(head).any(|line| is_cl(trim(line))) {
        return Some(Language::Cl);
    }
    let ending = name.rsplit_once('.').map_or(String::new(), |(_, ending)| ending.to_ascii_lowercase());
    match ending.as_str() {
        "mod" | "sys" | "prg" | "modx" | "sysx" => Some(Language::Rapid),
        "cl" | "cls" | "apt" | "aptsource" | "ncl" | "clt" | "clsf" | "cldata" => Some(Language::Cl),
        _ if head.first().is_some_and(|&b| b >= 0xF0) => Some(Language::Rapid),
        _ => None,
    }
}

fn begins_a_module(line: &[u8]) -> bool {
    let from = line.iter().position(u8::is_ascii_alphabetic).unwrap_or(line.len());
    let header = |word: &&[u8]| begins(&line[from..], word);
    [&b"MODULE "[..], b"MODULE\t", b"SYSMODULE "].iter().any(header)
}

fn is_cl(line: &[u8]) -> bool {
    const MAJOR: [&[u8]; 11] = [
        b"GOTO", b"FEDRAT", b"UNITS", b"LOADTL", b"CUTTER", b"FROM", b"SPINDL", b"PPRINT", b"MACHIN", b"TLDATA",
        b"MSYS",
    ];
    let major = line.iter().position(|b| !b.is_ascii_alphabetic()).unwrap_or(line.len());
    let (major, rest) = line.split_at(major);
    trim(rest).starts_with(b"/") && MAJOR.iter().any(|known| known.eq_ignore_ascii_case(major))
        || begins(line, b"TOOL PATH/")
}

fn begins(line: &[u8], word: &[u8]) -> bool {
    line.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word))
}

/// Without the blanks before it, those of ISO 8859-1 among them.
fn trim(text: &[u8]) -> &[u8] {
    let blank = |b: &u8| matches!(b, 9..=13 | b' ' | 0x85 | 0xA0);
    &text[text.iter().position(|b| !blank(b)).unwrap_or(text.len())..]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_decides_and_the_ending_helps() {
        assert_eq!(detect("x.txt", b"%%%\n  VERSION:1\n%%%\nMODULE A\nENDMODULE\n"), Some(Language::Rapid));
        assert_eq!(detect("x.mod", b"UNITS/MM\nGOTO / 1,2,3\n"), Some(Language::Cl));
        assert_eq!(detect("x.mod", b"! nothing yet\n"), Some(Language::Rapid));
        assert_eq!(detect("x.txt", b"hello"), None);
    }
}
