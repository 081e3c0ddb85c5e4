//! Completions and manual pages, held by the programs that read them. Where one is missing, its part is skipped and said.

use super::bench::Bench;
use std::process::Command;

/// Standard output of a program that must succeed in silence; `None` where this machine does not have it.
fn ask(bench: &Bench, program: &str, arguments: &[&str]) -> Option<String> {
    let started = Command::new(program).args(arguments).current_dir(bench.path("")).output();
    let Ok(output) = started else {
        eprintln!("skipped: {program} is absent");
        return None;
    };
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{program} {arguments:?}: {errors}");
    Some(String::from_utf8(output.stdout).unwrap())
}

#[test]
fn every_shell_has_its_completions() {
    let bench = Bench::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = bench.run(&format!("generate completions {shell}")).exits(0).stdout;
        for word in ["compensate", "identify", "generate", "max-error"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
        bench.write(shell, script);
    }
    ask(&bench, "bash", &["--norc", "-n", "bash"]);
    ask(&bench, "zsh", &["-f", "-n", "zsh"]);
    ask(&bench, "fish", &["--no-config", "--no-execute", "fish"]);
}

#[test]
fn bash_and_fish_complete_commands_options_and_values() {
    let bench = Bench::new();
    for shell in ["bash", "fish"] {
        bench.write(shell, bench.run(&format!("generate completions {shell}")).exits(0).stdout);
    }
    // The words of a line so far, and what must be among those offered.
    let lines = [
        (vec!["deflex", "comp"], "compensate"),
        (vec!["deflex", "check", "--max-c"], "--max-correction"),
        (vec!["deflex", "check", "--output-format", "sa"], "sarif"),
        (vec!["deflex", "identify", "--pos"], "--poses"),
    ];
    for (words, wanted) in lines {
        let (last, before) = (words[words.len() - 1], words[words.len() - 2]);
        let at = words.len() - 1;
        let typed = words.join(" ");
        let bash = format!(
            "source ./bash; COMP_WORDS=({typed}); COMP_CWORD={at}; _deflex deflex '{last}' '{before}'; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        );
        let fish = format!("source ./fish; complete -C '{typed}'");
        for (shell, arguments) in [("bash", ["--norc", "-c", &bash]), ("fish", ["--no-config", "-c", &fish])] {
            let Some(offered) = ask(&bench, shell, &arguments) else { continue };
            assert!(offered.lines().any(|line| line.split('\t').next() == Some(wanted)), "{shell}: {typed}: {offered}");
        }
    }
}

#[test]
fn manual_pages_are_whole_and_lead_to_each_other() {
    let bench = Bench::new();
    bench.run("generate man man").exits(0);
    let names = bench.names("man");
    for command in ["", "-compensate", "-identify", "-init", "-generate", "-generate-completions"] {
        assert!(names.contains(&format!("deflex{command}.1")), "{names:?}");
    }
    for name in &names {
        let page = bench.read(&format!("man/{name}"));
        for heading in [".TH DEFLEX", ".SH NAME", ".SH SYNOPSIS", ".SH DESCRIPTION"] {
            assert!(page.contains(heading), "{name}: {heading}");
        }
        // `deflex\-check(1)` of the list of commands.
        for named in page.lines().filter_map(|line| line.strip_suffix("(1)")) {
            let named = named.replace('\\', "");
            assert!(names.contains(&format!("{named}.1")), "{name} names {named}");
        }
        let path = format!("man/{name}");
        ask(&bench, "mandoc", &["-T", "lint", "-W", "error", &path]);
        let shown = ask(&bench, "mandoc", &["-T", "html", &path]);
        assert!(shown.is_none_or(|text| text.contains("SYNOPSIS")));
    }
}
