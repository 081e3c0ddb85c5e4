//! `check` for CI systems.

use crate::bench::{Bench, PROGRAM};

const CHECK: &str = "check part.mod --cell cell.toml --max-error 0.05";

#[test]
fn findings_stand_at_their_lines_in_every_form() {
    let bench = Bench::new();
    let text = bench.run(CHECK).exits(1).stdout;
    assert!(
        text.contains("part.mod:7:5: error: target 3: error of 0.") && text.contains("[check.max-error]"),
        "{text}"
    );
    let json: serde_json::Value =
        serde_json::from_str(&bench.run(&format!("{CHECK} --format json")).exits(1).stdout).unwrap();
    assert_eq!(json["files"][0]["findings"][1]["line"], 7);
    let sarif: serde_json::Value =
        serde_json::from_str(&bench.run(&format!("{CHECK} --format sarif")).exits(1).stdout).unwrap();
    let place = &sarif["runs"][0]["results"][1]["locations"][0]["physicalLocation"];
    assert_eq!((&place["artifactLocation"]["uri"], &place["region"]["startLine"]), (&"part.mod".into(), &7.into()));
    let junit = bench.run(&format!("{CHECK} --format junit")).exits(1).stdout;
    assert!(junit.contains("failures=\"1\"") && junit.contains("part.mod:7:5"), "{junit}");
}

#[test]
fn a_program_within_tolerance_passes() {
    let bench = Bench::new();
    for form in ["text", "json", "junit", "sarif"] {
        bench.run(&format!("check part.mod part.apt --cell cell.toml --max-error 1 --format {form}")).exits(0);
    }
}

#[test]
fn an_unreachable_target_and_a_large_correction_are_findings() {
    let bench = Bench::new();
    bench.write("far.mod", PROGRAM.replace("[[100,0,0]", "[[9000,0,0]"));
    let ran = bench.run("check far.mod --cell cell.toml --max-error 1").exits(1);
    assert!(ran.stdout.contains("far.mod:8:5") && ran.stdout.contains("not reached"), "{}", ran.stdout);
    let ran = bench.run("check part.mod --cell cell.toml --max-error 1 --max-correction 0.05").exits(1);
    assert!(ran.stdout.contains("limits.max-correction"), "{}", ran.stdout);
    bench.run("check part.mod --cell cell.toml --max-error 1 --max-correction 1").exits(0);
}
