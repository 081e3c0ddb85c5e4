//! Scripts of the repository where cargo builds into another folder than `target`.

#![cfg(unix)]

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// A copy of the repository's scripts, with a `cargo` that "builds" a deflex that only notes how it was called.
struct Copy {
    folder: TempDir,
}

impl Copy {
    fn new(files: &[&str]) -> Self {
        let copy = Self { folder: TempDir::new().unwrap() };
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        for file in files {
            let to = copy.path(file);
            std::fs::create_dir_all(to.parent().unwrap()).unwrap();
            std::fs::copy(root.join(file), to).unwrap();
        }
        std::fs::create_dir_all(copy.path("src")).unwrap();
        std::fs::write(copy.path("src/lib.rs"), "").unwrap();
        std::fs::write(copy.path("Cargo.toml"), "[package]\nname = \"deflex\"\nedition = \"2024\"\n").unwrap();
        let deflex = format!("#!/bin/sh\necho \"$0 $1\" >>'{}'\n", copy.path("called").display());
        let cargo = format!(
            "#!/bin/sh\n[ \"$1\" != build ] && exec '{}' \"$@\"\necho 'Compiling' >&2\n\
             case \" $* \" in *' --quiet '*) exit 9;; *' --release '*) profile=release;; *) profile=debug;; esac\n\
             mkdir -p \"$CARGO_TARGET_DIR/$profile\"\ncat >\"$CARGO_TARGET_DIR/$profile/deflex\" <<'END'\n{deflex}END\n\
             chmod +x \"$CARGO_TARGET_DIR/$profile/deflex\"\n",
            env!("CARGO")
        );
        copy.tool("cargo", &cargo);
        copy
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn tool(&self, name: &str, script: &str) {
        let path = self.path("bin").join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, script).unwrap();
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).unwrap();
    }

    /// Runs a script with a target folder of its own; how deflex was called.
    fn run(&self, script: &str) -> (Output, String) {
        let path = format!("{}:{}", self.path("bin").display(), std::env::var("PATH").unwrap());
        let output = Command::new(self.path(script))
            .env("PATH", path)
            .env("CARGO_TARGET_DIR", self.path("elsewhere"))
            .output()
            .unwrap();
        (output, std::fs::read_to_string(self.path("called")).unwrap_or_default())
    }
}

#[test]
fn the_samples_run_what_cargo_built_and_cargo_speaks() {
    let copy = Copy::new(&["samples/run.sh"]);
    let (output, called) = copy.run("samples/run.sh");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("Compiling"), "{said}");
    let from = copy.path("elsewhere/release/deflex");
    assert_eq!(called.lines().count(), 23);
    assert!(called.lines().all(|line| line.starts_with(&*from.to_string_lossy())), "{called}");
}

#[test]
fn instructions_are_counted_of_what_cargo_built() {
    let copy = Copy::new(&["benches/instructions", "benches/instructions.txt", "benches/compare.py"]);
    let count = std::fs::read_to_string(copy.path("benches/instructions.txt")).unwrap();
    let valgrind = format!("#!/bin/sh\nshift 2\n\"$@\"\necho 'Collected : {}' >&2\n", count.trim());
    copy.tool("valgrind", &valgrind);
    let (output, called) = copy.run("benches/instructions");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(called.starts_with(&format!("{} compensate", copy.path("elsewhere/debug/deflex").display())), "{called}");
}
