//! `samples/ci`: the script and the workflow that gate a folder of toolpaths, run as a CI system runs them.

use super::bench::{Bench, PROGRAM};
use std::os::unix::fs::symlink;
use std::process::Command;

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/ci/");

/// A repository: the script, a cell, two programs.
fn repository() -> Bench {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("programs")).unwrap();
    bench.write("programs/a.mod", PROGRAM).write("programs/b.mod", PROGRAM);
    // No copies: a script that is being written cannot be run, and other tests fork meanwhile.
    symlink(format!("{SAMPLE}gate.sh"), bench.path("gate.sh")).unwrap();
    bench
}

struct Gated {
    code: Option<i32>,
    text: String,
    errors: String,
}

fn gate(bench: &Bench, tolerance: &str) -> Gated {
    let output = Command::new("./gate.sh")
        .args(["programs", "cell.toml", "out", tolerance])
        .current_dir(bench.path(""))
        .env("DEFLEX", assert_cmd::cargo::cargo_bin!("deflex"))
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Gated { code: output.status.code(), text: text(output.stdout), errors: text(output.stderr) }
}

/// Places of the annotations.
fn annotated(bench: &Bench) -> Vec<(String, u64)> {
    let sarif: serde_json::Value = serde_json::from_str(&bench.read("out/check.sarif")).unwrap();
    let place = |result: &serde_json::Value| {
        let place = &result["locations"][0]["physicalLocation"];
        (place["artifactLocation"]["uri"].as_str().unwrap().to_owned(), place["region"]["startLine"].as_u64().unwrap())
    };
    sarif["runs"][0]["results"].as_array().unwrap().iter().map(place).collect()
}

#[test]
fn good_programs_pass_and_leave_everything_to_publish() {
    let bench = repository();
    let Gated { code, text, errors } = gate(&bench, "0.02");
    assert_eq!(code, Some(0), "{text}{errors}");
    assert!(text.contains("out/corrected/a.mod: 4 targets, ok"), "{text}");
    for name in ["report.csv", "summary.json", "report.html", "check.sarif", "check.xml", "corrected/b.mod"] {
        assert!(!bench.read(&format!("out/{name}")).is_empty(), "{name}");
    }
    assert!(annotated(&bench).is_empty());
    // A tolerance below the last printed digit.
    assert_eq!(gate(&bench, "0.0000001").code, Some(1));
    let lines = |name: &str| (6..9).map(|line| (format!("programs/{name}.mod"), line)).collect::<Vec<_>>();
    let places = annotated(&bench);
    assert!(!places.is_empty() && places.iter().all(|at| [lines("a"), lines("b")].concat().contains(at)), "{places:?}");
}

#[test]
fn a_bad_program_turns_the_gate_red_and_is_named_at_its_line() {
    let bench = repository();
    gate(&bench, "0.02");
    bench.write("programs/b.mod", PROGRAM.replace("[[50,0,0]", "[[5000,0,0]"));
    let Gated { code, text, errors } = gate(&bench, "0.02");
    assert_eq!(code, Some(1), "{text}{errors}");
    assert!(text.contains("programs/b.mod:7:5") && text.contains("programs/a.mod: 4 targets, ok"), "{text}");
    assert_eq!(annotated(&bench), [("programs/b.mod".to_owned(), 7)]);
    assert!(bench.read("out/check.xml").contains("failures=\"1\""));
    assert!(bench.names("out/corrected").is_empty(), "corrected programs of the run before are still there");
}

#[test]
fn what_cannot_be_read_is_no_answer() {
    let bench = repository();
    bench.write("programs/b.mod", "MODULE B\n  PROC main()\n    MoveL [[0,0,\n");
    let Gated { code, errors, .. } = gate(&bench, "0.02");
    assert_eq!(code, Some(2));
    assert!(errors.contains("programs/b.mod:"), "{errors}");
    assert!(!bench.path("out/check.sarif").exists());
    std::fs::remove_file(bench.path("cell.toml")).unwrap();
    assert_eq!(gate(&bench, "0.02").code, Some(2));
    // Over a limit of the cell: nothing is out of reach, and yet nothing was corrected.
    let bench = repository();
    bench.write("cell.toml", bench.read("cell.toml") + "[limits]\nmax_correction_mm = 0.01\n");
    assert_eq!(gate(&bench, "0.02").code, Some(2));
}

/// The name of a file that an argument list without `--` takes for an option: with `.h.mod` as forces nothing cuts.
const OPTION: &str = "--forces=.h.mod";

/// A program that is out of tolerance under such a name, and the table of no forces that its name speaks of.
fn disguise(bench: &Bench, folder: &str) {
    bench.write(&format!("{folder}{OPTION}"), PROGRAM);
    bench.write(".h.mod", "target,fx_n,fy_n,fz_n\n1,0,0,0\n2,0,0,0\n3,0,0,0\n4,0,0,0\n");
}

#[test]
fn a_name_is_no_option_in_the_gate() {
    let bench = repository();
    disguise(&bench, "");
    bench.write("bad.mod", PROGRAM.replace("[[50,0,0]", "[[5000,0,0]"));
    for folder in [".", "programs"] {
        disguise(&bench, &format!("{folder}/"));
        let output = Command::new("./gate.sh")
            .args([folder, "cell.toml", "out", "0.02"])
            .current_dir(bench.path(""))
            .env("DEFLEX", assert_cmd::cargo::cargo_bin!("deflex"))
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(if folder == "." { 1 } else { 0 }), "{said}");
        if folder == "programs" {
            assert!(said.contains("--forces=.h.mod: 4 targets, ok"), "{said}");
        }
    }
}

/// `release/check.sh`, which the action runs, in a folder of its own.
#[test]
fn a_name_is_no_option_in_the_action() {
    let bench = Bench::new();
    disguise(&bench, "");
    std::fs::create_dir_all(bench.path("deflex/bin")).unwrap();
    symlink(assert_cmd::cargo::cargo_bin!("deflex"), bench.path("deflex/bin/deflex")).unwrap();
    let output = Command::new("bash")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/release/check.sh"))
        .current_dir(bench.path(""))
        .env("RUNNER_TEMP", bench.path(""))
        .envs([("PROGRAMS", "*.mod"), ("CELL", "cell.toml"), ("MAX_ERROR", "0.01"), ("SARIF", "out.sarif")])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(bench.read("out.sarif").contains("\"--forces%3D.h.mod\""), "the file is not judged");
}

/// The hook as pre-commit runs it: its entry, the arguments that it says to give, the names of the files.
#[test]
fn a_name_is_no_option_in_the_hook() {
    let hook = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/.pre-commit-hooks.yaml")).unwrap();
    assert!(hook.contains("entry: deflex check\n"));
    assert!(hook.contains("args: [--cell, cell.toml, --max-error, \"0.1\", --]"));
    let bench = Bench::new();
    disguise(&bench, "");
    let run = |end: &[&str]| {
        Command::new(assert_cmd::cargo::cargo_bin!("deflex"))
            .args(["check", "--cell", "cell.toml", "--max-error", "0.01"])
            .args(end)
            .args([OPTION, "part.mod"])
            .current_dir(bench.path(""))
            .output()
            .unwrap()
    };
    assert_eq!(run(&["--"]).status.code(), Some(1));
    // If it is left out, a message says so, and the check never passes.
    let refused = run(&[]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && said.contains("`--forces=.h.mod` reads as an option"), "{said}");
}

/// Lines of a workflow as (indentation, key, value), `- ` being part of the indentation; panics on what is not of this form.
fn keys(yaml: &str) -> Vec<(usize, &str, &str)> {
    let lines = yaml.lines().filter(|line| !line.trim().is_empty() && !line.trim().starts_with('#'));
    let key = |line| {
        let text = str::trim_start_matches(line, [' ', '-']);
        let (key, value) = text.split_once(':').unwrap_or_else(|| panic!("no key: {line}"));
        assert!(!line.contains('\t') && (value.is_empty() || value.starts_with(' ')), "{line}");
        (line.len() - text.len(), key, value.trim())
    };
    lines.map(key).collect()
}

/// Every `run:` of the workflow, in a shell as GitHub's; `cargo install` from the network is acted out.
#[test]
fn the_workflow_runs() {
    let bench = repository();
    let workflow = std::fs::read_to_string(format!("{SAMPLE}.github/workflows/toolpaths.yml")).unwrap();
    let keys = keys(&workflow);
    let top: Vec<&str> = keys.iter().filter(|(depth, ..)| *depth == 0).map(|(_, key, _)| *key).collect();
    assert_eq!(top, ["name", "on", "permissions", "jobs"]);
    let steps = keys.iter().position(|(_, key, _)| *key == "steps").unwrap();
    let runs: Vec<&str> = keys[steps..].iter().filter(|(_, key, _)| *key == "run").map(|(.., value)| *value).collect();
    assert_eq!(runs.len(), 2);

    std::fs::create_dir(bench.path("bin")).unwrap();
    symlink(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/ci/cargo"), bench.path("bin/cargo")).unwrap();
    let path = format!("{}:{}", bench.path("bin").display(), std::env::var("PATH").unwrap());
    let run = |command: &str| {
        let output = Command::new("bash")
            .args(["-eo", "pipefail", "-c", command])
            .current_dir(bench.path(""))
            .env("PATH", &path)
            .env("BINARY", assert_cmd::cargo::cargo_bin!("deflex"))
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    for command in &runs {
        assert_eq!(run(command).0, Some(0), "{command}: {}", run(command).1);
    }
    // What the later steps publish is there.
    let published = keys.iter().filter(|(_, key, _)| ["sarif_file", "path"].contains(key));
    let published: Vec<&str> = published.map(|(.., value)| *value).collect();
    assert_eq!(published, ["out/check.sarif", "out"]);
    assert!(published.iter().all(|path| bench.path(path).exists()));
    // And the gate is what a bad program fails at.
    bench.write("programs/b.mod", PROGRAM.replace("[[50,0,0]", "[[5000,0,0]"));
    assert_eq!(run(runs[1]).0, Some(1));
}
