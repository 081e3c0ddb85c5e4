//! Which language a file is written in.

use super::Language;

/// Finds the language from the content, with the file's ending as a hint for what the content leaves open.
///
/// RAPID has a `MODULE` header (behind `%%%` lines or comments); CL has `GOTO/`-like major words with a slash.
#[must_use]
pub fn detect(name: &str, bytes: &[u8]) -> Option<Language> {
    // Enough to see a header and the first statements.
    const LOOK: usize = 64 * 1024;
    let head = &bytes[..bytes.len().min(LOOK)];
    let text: String = head.iter().map(|&b| (b as char).to_ascii_uppercase()).collect();
    let ending = name.rsplit_once('.').map_or(String::new(), |(_, ending)| ending.to_ascii_lowercase());
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("$$"));
    let rapid = text.trim_start_matches('\u{feff}').trim_start().starts_with("%%%")
        || text.lines().any(|line| {
            let line = line.trim_start_matches(|c: char| !c.is_ascii_alphabetic());
            line.starts_with("MODULE ") || line.starts_with("SYSMODULE ") || line.starts_with("MODULE\t")
        });
    let cl = lines.any(|line| {
        let major: String = line.chars().take_while(|c| c.is_ascii_alphabetic()).collect();
        let rest = line[major.len()..].trim_start();
        let known =
            ["GOTO", "FEDRAT", "UNITS", "LOADTL", "CUTTER", "FROM", "SPINDL", "PPRINT", "MACHIN", "TLDATA", "MSYS"];
        (known.contains(&major.as_str()) && rest.starts_with('/')) || line.starts_with("TOOL PATH/")
    });
    match (rapid, cl, ending.as_str()) {
        (true, _, _) => Some(Language::Rapid),
        (_, true, _) => Some(Language::Cl),
        (_, _, "mod" | "sys" | "prg" | "modx" | "sysx") => Some(Language::Rapid),
        (_, _, "cl" | "cls" | "apt" | "aptsource" | "ncl" | "clt" | "clsf" | "cldata") => Some(Language::Cl),
        _ if head.first().is_some_and(|&b| b >= 0xF0) => Some(Language::Rapid),
        _ => None,
    }
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
