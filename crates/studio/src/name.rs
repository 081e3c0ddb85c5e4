//! The names of files in the folder, as the browser sends them.

use serde::{Deserialize, Serialize};
use std::fmt;

/// The name of a file in the folder: a relative path with `/` between its parts. It does not lead out of the folder, and cannot
/// be read as an option of a command. The same names are accepted on every system, so that a folder can move between systems.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Name(String);

/// Longest name, bytes: Windows takes paths of 260 characters.
const LONGEST: usize = 200;
/// Largest depth of folders.
const DEEPEST: usize = 8;
/// The names of devices on Windows, which hold in every folder and with any ending.
const DEVICES: [&str; 6] = ["con", "prn", "aux", "nul", "conin$", "conout$"];

impl Name {
    /// The parts between `/`.
    pub(crate) fn parts(&self) -> impl Iterator<Item = &str> {
        self.0.split('/')
    }

    /// The file's own name without its folders and its last ending.
    pub(crate) fn stem(&self) -> &str {
        let file = self.0.rsplit('/').next().unwrap_or_default();
        file.rsplit_once('.').map_or(file, |(stem, _)| stem)
    }

    /// A file in the same folder whose name is this one's stem with `ending` after it.
    pub(crate) fn with_ending(&self, ending: &str) -> Result<Self, String> {
        let folder = self.0.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
        Self::try_from(format!("{folder}{}.{ending}", self.stem()))
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let refuse = |why: &str| Err(format!("the name {text:?} {why}"));
        if text.is_empty() || text.len() > LONGEST {
            return refuse("is empty or longer than 200 bytes: choose a shorter one");
        }
        if text.split('/').count() > DEEPEST {
            return refuse("leads through more than 7 folders: choose a place nearer to the top");
        }
        for part in text.split('/') {
            if part.is_empty() || part == "." || part == ".." {
                return refuse("is not a path inside the folder: give a name without `..` and without `/` at its ends");
            }
            if part.starts_with(['.', '-']) {
                return refuse(
                    "begins with a dot or a hyphen: hidden files and options are not taken, rename the file",
                );
            }
            if part.ends_with(['.', ' ']) || part.chars().any(is_refused) {
                return refuse("has a character that not every system takes in a name: rename the file");
            }
            let device = part.split('.').next().unwrap_or_default().trim_end().to_ascii_lowercase();
            let numbered = device.strip_prefix("com").or_else(|| device.strip_prefix("lpt"));
            let is_numbered = numbered.is_some_and(|number| number.chars().count() == 1);
            if DEVICES.contains(&device.as_str()) || is_numbered {
                return refuse("is the name of a device on Windows: rename the file");
            }
        }
        Ok(Self(text))
    }
}

/// Characters that control a terminal or the direction of a text, and those that Windows accepts in no name.
fn is_refused(c: char) -> bool {
    c.is_control()
        || "\\:*?\"<>|".contains(c)
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failure is a failed test

    use super::Name;

    #[test]
    fn names_stay_inside_the_folder_and_read_as_no_option() {
        let good = [
            "part.mod", "backup/SYSPAR/MOC.cfg", "Teil 1 (neu).src", "schräge Fläche.csv", "a..b", "company.mod",
            "comma,x.toml",
        ];
        for name in good {
            assert!(Name::try_from(name.to_owned()).is_ok(), "{name}");
        }
        let bad = [
            "", ".", "..", "../x", "a/../b", "a//b", "/etc/passwd", "a/", "C:\\x", "c:x", "a\\b", "-o", "a/-o",
            "--cell", ".hidden", ".deflex-1", "a\0b", "a\nb", "NUL", "nul.mod", "COM1.txt", "lpt9", "x.", "x ",
            "a\u{202e}b", "a?b", "a/b/c/d/e/f/g/h/i",
        ];
        for name in bad {
            assert!(Name::try_from(name.to_owned()).is_err(), "{name:?}");
        }
        assert!(Name::try_from("x".repeat(201)).is_err());
    }

    #[test]
    fn results_stand_next_to_their_program() {
        let name = |text: &str| Name::try_from(text.to_owned()).unwrap();
        assert_eq!(name("a/part.1.mod").with_ending("predict.json").unwrap(), name("a/part.1.predict.json"));
        assert_eq!(name("part").with_ending("csv").unwrap().to_string(), "part.csv");
    }
}
