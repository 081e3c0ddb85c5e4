//! The tutorial: its commands run one after another in a fresh folder, and print what the page says.
//!
//! `UPDATE_TUTORIAL=1 cargo test --test suite tutorial` writes what they print now into the page.

#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const PAGE: &str = "docs/tutorial.md";

/// A folder with the samples, and where the reader's shell is in it.
struct Shell {
    _folder: tempfile::TempDir,
    at: PathBuf,
}

impl Shell {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let samples = folder.path().join("samples");
        for sample in ["blade", "closed-loop"] {
            let to = samples.join(sample);
            std::fs::create_dir_all(&to).unwrap();
            for entry in std::fs::read_dir(Path::new(ROOT).join("samples").join(sample)).unwrap() {
                let entry = entry.unwrap();
                std::fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
            }
        }
        Self { at: folder.path().to_owned(), _folder: folder }
    }

    /// What a command prints, errors and answers in the order in which they come.
    fn run(&mut self, command: &str) -> String {
        if let Some(folder) = command.strip_prefix("cd ") {
            self.at = self.at.join(folder).canonicalize().unwrap();
            return String::new();
        }
        let binary = Path::new(env!("CARGO_BIN_EXE_deflex")).parent().unwrap();
        let path = format!("{}:{}", binary.display(), std::env::var("PATH").unwrap());
        let done = Command::new("sh")
            .args(["-c", &format!("exec 2>&1\n{command}")])
            .current_dir(&self.at)
            .env("PATH", path)
            .env("NO_COLOR", "1")
            .output()
            .unwrap();
        String::from_utf8(done.stdout).unwrap()
    }

    /// A file as the page shows it: its first line names it.
    fn write(&self, block: &str) {
        let first = block.lines().next().unwrap();
        let name = first.strip_prefix("# ").unwrap_or_else(|| panic!("{PAGE}: `{first}` names no file"));
        let (name, before) = match name.strip_suffix(", added at the end") {
            Some(name) => (name, std::fs::read_to_string(self.at.join(name)).unwrap() + "\n"),
            None => (name, String::new()),
        };
        std::fs::write(self.at.join(name), before + block).unwrap();
    }
}

/// Lines without the blanks at their ends.
fn trimmed(text: &str) -> String {
    text.lines().map(|line| line.trim_end().to_owned() + "\n").collect::<String>().trim_end().to_owned()
}

/// The page with the output of its commands as it is now.
fn played(page: &str) -> String {
    let mut shell = Shell::new();
    let mut out = String::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        out += line;
        out += "\n";
        let block: Vec<&str> = match line {
            "```toml" | "```console" => lines.by_ref().take_while(|line| *line != "```").collect(),
            _ => continue,
        };
        if line == "```toml" {
            let text = block.join("\n") + "\n";
            shell.write(&text);
            out += &text;
        } else {
            let commands = block.join("\n").replace("\\\n", "\\\u{0}");
            for command in commands.lines().filter_map(|line| line.strip_prefix("$ ")) {
                let printed = trimmed(&shell.run(&command.replace("\\\u{0}", "")));
                out += &format!("$ {}\n", command.replace('\u{0}', "\n"));
                if !printed.is_empty() {
                    out += &(printed + "\n");
                }
            }
        }
        out += "```\n";
    }
    out
}

#[test]
fn the_tutorial_prints_what_it_says() {
    let path = Path::new(ROOT).join(PAGE);
    let page = std::fs::read_to_string(&path).unwrap();
    let now = played(&page);
    assert!(now.matches("\n$ deflex ").count() > 10, "the tutorial runs deflex");
    if std::env::var_os("UPDATE_TUTORIAL").is_some() {
        std::fs::write(path, now).unwrap();
        return;
    }
    for (line, (said, printed)) in page.lines().zip(now.lines()).enumerate() {
        let help = "UPDATE_TUTORIAL=1 cargo test --test suite tutorial takes over what is printed";
        assert_eq!(said, printed, "{PAGE}:{}: the output differs; {help}", line + 1);
    }
    assert_eq!(page.lines().count(), now.lines().count());
}
