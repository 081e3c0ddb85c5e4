//! Finds the language of a file.

use super::Language;
use deflex_text::{ENCRYPTED, lines};

/// Finds the language from the content. The ending of the file is a hint if the content does not decide.
///
/// RAPID has a `MODULE` header (after `%%%` lines or comments); CL has `GOTO/`-like major words with a slash; KRL begins with
/// `&` lines or `DEF`, `DEFFCT`, `DEFDAT`; FANUC TP with `/PROG`; INFORM with `/JOB`; URScript has `def name():` or calls like `movel(`.
///
/// # Examples
/// ```
/// use deflex_program::{Language, detect};
///
/// assert_eq!(detect("part.src", b"DEF part()\nLIN {X 0, Y 0, Z 0}\nEND\n"), Some(Language::Krl));
/// assert_eq!(detect("notes.txt", b"call the toolmaker\n"), None);
/// ```
#[must_use]
pub fn detect(name: &str, bytes: &[u8]) -> Option<Language> {
    // Enough for a header and the first statements.
    const LOOK: usize = 64 * 1024;
    let head = &bytes[..bytes.len().min(LOOK)];
    if trim(head).starts_with(b"%%%") || lines(head).any(begins_a_module) {
        return Some(Language::Rapid);
    }
    // Before KRL, because `def part():` looks like one of its DEF lines.
    if lines(head).any(|line| is_ur(trim(line))) {
        return Some(Language::Ur);
    }
    if let Some(language) = first(head, |line| begins(line, b"/PROG").then_some(Language::Ls)) {
        return Some(language);
    }
    // Post-processors write comments before the first line, and some files have CR alone at the ends of lines.
    let mut rows = head.split(|b| matches!(b, b'\n' | b'\r')).map(<[u8]>::trim_ascii);
    if rows.find(|row| !row.is_empty() && !row.starts_with(b"'")).is_some_and(|row| row == b"/JOB") {
        return Some(Language::Jbi);
    }
    if lines(head).any(|line| is_krl(trim(line))) {
        return Some(Language::Krl);
    }
    if lines(head).any(|line| is_cl(trim(line))) {
        return Some(Language::Cl);
    }
    let ending = name.rsplit_once('.').map_or(String::new(), |(_, ending)| ending.to_ascii_lowercase());
    let by_ending = Language::ALL.into_iter().find(|language| language.endings().contains(&ending.as_str()));
    by_ending.or_else(|| head.first().is_some_and(|&b| b >= ENCRYPTED).then_some(Language::Rapid))
}

/// The result of `of` for the first line that is not blank.
fn first<T>(head: &[u8], of: impl Fn(&[u8]) -> Option<T>) -> Option<T> {
    of(lines(head).map(trim).find(|line| !line.is_empty())?)
}

/// `def name():`, `movel(p[…`, `set_tcp(p[…`, `global name = p[…`. URScript distinguishes upper and lower case.
fn is_ur(line: &[u8]) -> bool {
    let code = line.split(|b| *b == b'#').next().unwrap_or_default().trim_ascii_end();
    let routine = [&b"def "[..], b"thread ", b"sec "].iter().any(|word| code.starts_with(word));
    if routine && code.ends_with(b":") && code.contains(&b'(') {
        return true;
    }
    let joined: Vec<u8> = code.iter().copied().filter(|b| !b.is_ascii_whitespace()).take(256).collect();
    let motion = [&b"movej("[..], b"movel(", b"movep(", b"movec(", b"set_tcp("];
    motion.iter().any(|word| joined.starts_with(word))
        || joined.starts_with(b"global") && memchr::memmem::find(&joined, b"=p[").is_some()
}

/// `&ACCESS RVP`, `DEF name(`, `GLOBAL DEFFCT INT name(`, `DEFDAT name`.
fn is_krl(line: &[u8]) -> bool {
    const HEADS: [&[u8]; 5] = [b"&ACCESS", b"&REL", b"&PARAM", b"&COMMENT", b"&USER"];
    const ROUTINES: [&[u8]; 3] = [b"DEF", b"DEFFCT", b"DEFDAT"];
    if HEADS.iter().any(|head| begins(line, head)) {
        return true;
    }
    let line = if begins(line, b"GLOBAL ") { trim(&line[7..]) } else { line };
    let word = line.iter().position(|b| !b.is_ascii_alphabetic()).unwrap_or(line.len());
    let (word, rest) = line.split_at(word);
    let name = rest.first().is_some_and(u8::is_ascii_whitespace)
        && trim(rest).first().is_some_and(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'$'));
    name && ROUTINES.iter().any(|known| known.eq_ignore_ascii_case(word))
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

/// A text without the blanks before it, including those of ISO 8859-1.
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
        assert_eq!(detect("x", b"\r\n/PROG  A\r\n/ATTR\r\n"), Some(Language::Ls));
        assert_eq!(detect("x", b"\n&ACCESS RVP\n"), Some(Language::Krl));
        assert_eq!(detect("x", b"; made by hand\n  GLOBAL DEF a_1( )\nEND\n"), Some(Language::Krl));
        assert_eq!(detect("x.dat", b"DEFDAT A PUBLIC\nENDDAT\n"), Some(Language::Krl));
        assert_eq!(detect("x.src", b"LIN {X 1}\n"), Some(Language::Krl));
        assert_eq!(detect("x.dat", b"1 2 3\n"), None);
        assert_eq!(detect("x", b"# by hand\ndef part():\n  sleep(1)\nend\n"), Some(Language::Ur));
        assert_eq!(detect("x", b" movel(p[0.1,0,0,0,0,0])\n"), Some(Language::Ur));
        assert_eq!(detect("x", b"DEF part( )\nEND\n"), Some(Language::Krl));
        assert_eq!(detect("x", b"'by a post\r\n/JOB\r\n//NAME A\r\n"), Some(Language::Jbi));
        assert_eq!(detect("x", b"/JOB\r//NAME A\r"), Some(Language::Jbi));
        assert_eq!(detect("A.JBI", b"NOP\nEND\n"), Some(Language::Jbi));
        assert_eq!(detect("x.script", b"sleep(1)\n"), Some(Language::Ur));
    }
}
