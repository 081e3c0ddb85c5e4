//! `check` for CI systems.

use super::bench::{Bench, PROGRAM};

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
        serde_json::from_str(&bench.run(&format!("{CHECK} --output-format json")).exits(1).stdout).unwrap();
    assert_eq!(json["files"][0]["findings"][1]["line"], 7);
    let sarif: serde_json::Value =
        serde_json::from_str(&bench.run(&format!("{CHECK} --output-format sarif")).exits(1).stdout).unwrap();
    let place = &sarif["runs"][0]["results"][1]["locations"][0]["physicalLocation"];
    assert_eq!((&place["artifactLocation"]["uri"], &place["region"]["startLine"]), (&"part.mod".into(), &7.into()));
    let junit = bench.run(&format!("{CHECK} --output-format junit")).exits(1).stdout;
    assert!(junit.contains("failures=\"1\"") && junit.contains("part.mod:7:5"), "{junit}");
}

#[test]
fn a_program_within_tolerance_passes() {
    let bench = Bench::new();
    for form in ["text", "json", "junit", "sarif"] {
        bench.run(&format!("check part.mod part.apt --cell cell.toml --max-error 1 --output-format {form}")).exits(0);
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

/// An element of junit-10.xsd: attributes that must stand, those that may, children.
type Element = (&'static str, &'static [&'static str], &'static [&'static str], &'static [&'static str]);

/// Those that are used.
const JUNIT: [Element; 5] = [
    ("testsuites", &[], &["name", "time", "tests", "failures", "errors"], &["testsuite"]),
    (
        "testsuite",
        &["name", "tests", "failures", "errors"],
        &["group", "time", "skipped", "timestamp", "hostname", "id", "package", "file", "log", "url"],
        &["testsuite", "properties", "testcase", "system-out", "system-err"],
    ),
    (
        "testcase",
        &["name"],
        &["time", "classname", "group"],
        &["skipped", "error", "failure", "system-out", "system-err"],
    ),
    ("failure", &[], &["type", "message"], &[]),
    ("skipped", &[], &[], &[]),
];

/// Tags of an XML text, each with the names of its attributes and its parent; panics where it is not well-formed.
fn elements(xml: &str) -> Vec<(String, Vec<String>, Option<String>)> {
    let mut rest = xml.strip_prefix("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n").expect("a declaration");
    let (mut open, mut all) = (Vec::<String>::new(), Vec::new());
    let entities = |text: &str| {
        for (at, _) in text.match_indices('&') {
            assert!(["&amp;", "&lt;", "&gt;", "&quot;"].iter().any(|e| text[at..].starts_with(e)), "{text}");
        }
        assert!(!text.contains('<'), "{text}");
    };
    while let Some((text, tag)) = rest.split_once('<') {
        entities(text);
        assert!(!open.is_empty() || text.trim().is_empty(), "text outside of the root");
        let (tag, after) = tag.split_once('>').expect("a tag ends");
        rest = after;
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name));
            continue;
        }
        let (tag, closed) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
        let (name, attributes) = tag.split_once(' ').unwrap_or((tag, ""));
        let parts: Vec<&str> = attributes.split('"').collect();
        let names = parts.chunks(2).filter(|pair| pair.len() == 2).map(|pair| {
            entities(pair[1]);
            pair[0].trim().strip_suffix('=').expect("name=\"value\"").to_owned()
        });
        all.push((name.to_owned(), names.collect(), open.last().cloned()));
        if !closed {
            open.push(name.to_owned());
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    all
}

#[test]
fn junit_keeps_to_its_schema() {
    let bench = Bench::new();
    bench.write("a&b.mod", PROGRAM);
    let xml = bench
        .run("check part.mod a&b.mod part.apt --cell cell.toml --max-error 0.05 --output-format junit")
        .exits(1)
        .stdout;
    let all = elements(&xml);
    assert_eq!(all.iter().filter(|(name, ..)| name == "testcase").count(), 3);
    for (name, attributes, parent) in &all {
        let (_, must, may, _) = JUNIT.iter().find(|(known, ..)| known == name).expect("a known element");
        assert!(must.iter().all(|wanted| attributes.iter().any(|a| a == wanted)), "{name}: {attributes:?}");
        assert!(attributes.iter().all(|a| must.iter().chain(*may).any(|known| known == a)), "{name}: {attributes:?}");
        let allowed = parent.as_ref().map(|parent| JUNIT.iter().find(|(known, ..)| known == parent).unwrap().3);
        assert!(allowed.map_or(name == "testsuites", |children| children.contains(&name.as_str())), "{name}");
    }
}

/// Keys that SARIF 2.1.0 knows of the objects used (none allows others), and those that it demands.
fn keys(value: &serde_json::Value, known: &[&str], wanted: &[&str]) {
    let object = value.as_object().expect("an object");
    assert!(object.keys().all(|key| known.contains(&key.as_str())), "{value}");
    assert!(wanted.iter().all(|key| object.contains_key(*key)), "{value}");
}

#[test]
fn sarif_keeps_to_its_schema() {
    let bench = Bench::new();
    bench.write("with blank.mod", PROGRAM.replace("[[100,0,0]", "[[9000,0,0]"));
    let output = super::bench::deflex(bench.path("").as_path())
        .args([
            "check", "part.mod", "with blank.mod", "--cell", "cell.toml", "--max-error", "0.05", "--output-format",
            "sarif",
        ])
        .output()
        .unwrap();
    let log: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    keys(&log, &["$schema", "version", "runs"], &["version", "runs"]);
    assert_eq!(log["version"], "2.1.0");
    let run = &log["runs"][0];
    keys(run, &["tool", "columnKind", "results"], &["tool"]);
    assert_eq!(run["columnKind"], "unicodeCodePoints");
    keys(&run["tool"], &["driver"], &["driver"]);
    keys(&run["tool"]["driver"], &["name", "version", "rules"], &["name"]);
    let rules = run["tool"]["driver"]["rules"].as_array().unwrap();
    for rule in rules {
        keys(rule, &["id", "shortDescription", "help"], &["id"]);
        keys(&rule["shortDescription"], &["text"], &["text"]);
        keys(&rule["help"], &["text"], &["text"]);
    }
    let results = run["results"].as_array().unwrap();
    assert!(results.len() > 2);
    let mut uris = Vec::new();
    for result in results {
        keys(result, &["ruleId", "ruleIndex", "level", "message", "locations"], &["message"]);
        keys(&result["message"], &["text"], &["text"]);
        assert!(["none", "note", "warning", "error"].contains(&result["level"].as_str().unwrap()));
        assert_eq!(rules[result["ruleIndex"].as_u64().unwrap() as usize]["id"], result["ruleId"]);
        let place = &result["locations"][0]["physicalLocation"];
        keys(place, &["artifactLocation", "region"], &["artifactLocation"]);
        keys(&place["region"], &["startLine", "startColumn"], &[]);
        assert!(
            place["region"]["startLine"].as_u64().unwrap() >= 1
                && place["region"]["startColumn"].as_u64().unwrap() >= 1
        );
        uris.push(place["artifactLocation"]["uri"].as_str().unwrap());
    }
    assert!(uris.contains(&"with%20blank.mod"), "{uris:?}");
}

#[test]
fn annotations_point_at_the_instruction() {
    let bench = Bench::new();
    // Umlauts before the instruction: columns count characters.
    bench.write("part.mod", PROGRAM.replace("    MoveL [[50", "  ! Fräse\n\tMoveL [[50"));
    let found = bench.run("check part.mod --cell cell.toml --max-error 0.05 --output-format sarif").exits(1).stdout;
    let sarif: serde_json::Value = serde_json::from_str(&found).unwrap();
    let lines: Vec<String> = bench.read("part.mod").lines().map(str::to_owned).collect();
    for result in sarif["runs"][0]["results"].as_array().unwrap() {
        let region = &result["locations"][0]["physicalLocation"]["region"];
        let [line, column] = ["startLine", "startColumn"].map(|key| region[key].as_u64().unwrap() as usize);
        let at: String = lines[line - 1].chars().skip(column - 1).collect();
        assert!(at.starts_with("Move"), "{line}:{column}: {at}");
    }
}

#[test]
fn motions_that_cannot_be_judged_are_counted() {
    let bench = Bench::new();
    let known = PROGRAM.lines().find(|line| line.contains("[[50,0,0]")).unwrap();
    let unknown = "    MoveL CRobT(\\Tool:=tMill\\WObj:=wPart),v20,z1,tMill\\WObj:=wPart;";
    bench.write("part.mod", PROGRAM.replace(known, unknown));
    let ran = bench.run("check part.mod --cell cell.toml --max-error 1").exits(1);
    assert!(
        ran.stdout.contains("part.mod: 4 targets, 1 not judged (2 judged, 1 air, 1 not judged: target computed"),
        "{}",
        ran.stdout
    );
    assert!(ran.stderr.contains("not judged: target computed at run time (1)"), "{}", ran.stderr);
    bench.run("check part.mod --cell cell.toml --max-error 1 --allow-unjudged").exits(0);
}
