//! What a run says that it came to: counts that add up, and verdicts about what was judged.

use super::bench::{Bench, CELL, PROGRAM};
use serde_json::Value;

/// An external axis in use without a unit in the cell: no target of the program is solved.
fn on_a_track() -> String {
    PROGRAM.replace(",[9E9,9E9", ",[250,9E9")
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

#[test]
fn a_check_that_judged_nothing_is_not_green() {
    let bench = Bench::new();
    bench.write("track.mod", on_a_track());
    let check = "check track.mod --cell cell.toml --max-error 0.001";
    let ran = bench.run(check).exits(1);
    assert!(
        ran.stdout.contains("track.mod: 4 targets, 4 not judged (0 judged, 0 air, 4 not judged: "),
        "{}",
        ran.stdout
    );
    let found = json(&bench.run(&format!("{check} --output-format json")).exits(1).stdout);
    let file = &found["files"][0];
    assert_eq!((&found["passed"], &file["passed"], &file["judged"]), (&false.into(), &false.into(), &0.into()));
    assert_eq!(file["unjudged"][0]["count"], 4);
    assert!(file["unjudged"][0]["reason"].as_str().unwrap().contains("[[unit]]"), "{file}");
    let junit = bench.run(&format!("{check} --output-format junit")).exits(1).stdout;
    assert_eq!(junit.matches("<skipped>target ").count(), 4, "{junit}");
    assert!(junit.contains("tests=\"5\" failures=\"1\" errors=\"0\" skipped=\"4\""), "{junit}");
    let sarif = json(&bench.run(&format!("{check} --output-format sarif")).exits(1).stdout);
    let results = sarif["runs"][0]["results"].as_array().unwrap();
    let lines: Vec<u64> = results
        .iter()
        .filter(|result| result["kind"] == "notApplicable" && result["level"] == "none")
        .map(|result| result["locations"][0]["physicalLocation"]["region"]["startLine"].as_u64().unwrap())
        .collect();
    assert_eq!(lines, [5, 6, 7, 8]);
    let page = bench.run(&format!("{check} --html page.html"));
    assert!(page.code == Some(1) && bench.read("page.html").contains("data-key=\"unjudged\">4<"));
    for form in ["text", "json", "junit", "sarif"] {
        bench.run(&format!("{check} --allow-unjudged --output-format {form}")).exits(0);
    }
}

#[test]
fn a_run_that_corrected_nothing_says_so_first() {
    let bench = Bench::new();
    bench.write("track.mod", on_a_track());
    let ran = bench.run("compensate track.mod --cell cell.toml -o out.mod").exits(0);
    let first = ran.stderr.lines().next().unwrap();
    assert!(first.contains("nothing was corrected"), "{}", ran.stderr);
    assert!(
        ran.stderr.contains("nothing was corrected: 4 targets: 0 corrected, 0 air, 4 kept: external"),
        "{}",
        ran.stderr
    );
    assert!(!ran.stderr.contains("remaining"), "{}", ran.stderr);
}

#[test]
fn a_motion_that_goes_nowhere_known_has_a_row() {
    let bench = Bench::new();
    let known = PROGRAM.lines().find(|line| line.contains("[[50,0,0]")).unwrap();
    let unknown = "    MoveL CRobT(\\Tool:=tMill\\WObj:=wPart),v20,z1,tMill\\WObj:=wPart;";
    bench.write("part.mod", PROGRAM.replace(known, unknown));
    bench.run("predict part.mod --cell cell.toml --report rows.csv").exits(0);
    let report = bench.read("rows.csv");
    let rows: Vec<Vec<&str>> = report.lines().map(|line| line.split(',').collect()).collect();
    let at = |name: &str| rows[0].iter().position(|column| *column == name).unwrap();
    assert_eq!(rows.len(), 5);
    assert_eq!((rows[3][0], rows[3][1], rows[3][at("status")], rows[3][at("x_mm")]), ("3", "7", "kept", ""));
    assert_eq!(rows[3][at("reason")], "target computed at run time");
    // Others have their joints, tool, work object and feed, and no reason.
    assert_eq!((rows[4][at("tool")], rows[4][at("wobj")], rows[4][at("feed_mm_s")]), ("tMill", "wPart", "20.000"));
    assert!(rows[4][at("q6_deg")].parse::<f64>().is_ok() && rows[4][at("reason")].is_empty());
    assert!(
        rows[0]
            .join(",")
            .ends_with("reason,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,tool,wobj,feed_mm_s,error_part_mm")
    );
}

/// Ways of a raster with turns at full depth, 80 mm long.
fn raster() -> String {
    let line = PROGRAM.lines().find(|line| line.contains("[[50,0,0]")).unwrap();
    let points = [[0, 0], [80, 0], [80, 10], [0, 10], [0, 20], [80, 20]];
    let path: String = points
        .iter()
        .map(|[x, y]| line.replace("[[50,0,0]", &format!("[[{x},{y},0]")).replace("z1", "fine") + "\n")
        .collect();
    let (head, rest) = PROGRAM.split_once("    MoveL").unwrap();
    let (_, end) = rest.rsplit_once("fine,tMill\\WObj:=wPart;\n").unwrap();
    head.to_owned() + &path + end
}

#[test]
fn a_raster_passes_and_its_jumps_are_reported() {
    let bench = Bench::new();
    // The force goes with the feed, so that it turns at every corner.
    let cell = CELL.replace("frame = \"wobj\"", "frame = \"feed\"");
    bench.write("raster.mod", raster()).write("cell.toml", cell);
    bench.run("compensate raster.mod --cell cell.toml --subdivide 0.02 -o out.mod").exits(0);
    let check = "check out.mod --cell cell.toml --against raster.mod --max-error 0.02";
    let ran = bench.run(check).exits(0);
    assert!(ran.stdout.contains("jumps of the force") && ran.stdout.contains("not judged"), "{}", ran.stdout);
    let verdicts =
        json(&bench.run(&format!("{check} --output-format json")).exits(0).stdout)["files"][0]["verdicts"].clone();
    let [ways, jumps] = ["ways", "jumps"].map(|what| verdicts[what]["largest"]["mm"].as_f64().unwrap());
    assert!(ways <= 0.02 && jumps > 0.05, "{verdicts}");
    let ran = bench.run(&format!("{check} --max-jump 0.05")).exits(1);
    assert!(
        ran.stdout.contains("[check.max-jump]") && !ran.stdout.contains("[check.max-path-error]"),
        "{}",
        ran.stdout
    );
    bench.run(&format!("{check} --max-jump 2")).exits(0);
    let ran = bench.run(&format!("{check} --max-path-error 0.0001")).exits(1);
    assert!(ran.stdout.contains("[check.max-path-error]") && ran.stdout.contains("--subdivide"), "{}", ran.stdout);
    // Where no targets are inserted the entry spoils the whole way: that is none of a jump alone.
    bench.run("compensate raster.mod --cell cell.toml -o plain.mod").exits(0);
    let ran = bench.run("check plain.mod --cell cell.toml --against raster.mod --max-error 0.02").exits(1);
    assert!(ran.stdout.contains("[check.max-path-error]"), "{}", ran.stdout);
}

/// Targets that two modules move to, and one that only declares.
#[test]
fn the_report_of_several_modules_names_their_files() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("in")).unwrap();
    let (data, rest) = PROGRAM.split_once("  PROC main()").unwrap();
    let moves: Vec<&str> = rest.lines().filter(|line| line.contains("Move")).collect();
    let shared = data.replace("MODULE Part", "MODULE Base") + "ENDMODULE\n";
    let main = format!("MODULE Part\n  PROC main()\n{}\n    rCut;\n  ENDPROC\nENDMODULE\n", moves[0]);
    let cut = format!("MODULE Cut\n  PROC rCut()\n{}\n  ENDPROC\nENDMODULE\n", moves[1..].join("\n"));
    bench.write("in/base.mod", shared).write("in/cut.mod", cut).write("in/part.mod", main);
    let modules = "in/base.mod in/cut.mod in/part.mod";
    bench.run(&format!("compensate {modules} --cell cell.toml --out-dir out")).exits(0);
    // Named by the first module that moves.
    assert_eq!(bench.names("out"), ["base.mod", "cut.mod", "part.mod", "part.report.csv"]);
    let rows = bench.read("out/part.report.csv");
    assert!(rows.lines().next().unwrap().ends_with(",file"));
    assert!(
        rows.lines().nth(1).unwrap().ends_with("part.mod") && rows.lines().nth(2).unwrap().ends_with("cut.mod"),
        "{rows}"
    );
    bench.run(&format!("check {modules} --cell cell.toml --max-error 0.05 --html page.html")).exits(1);
    let page = bench.read("page.html");
    let found = page.split_once("id=\"found\"").unwrap().1.split_once("</table>").unwrap().0;
    assert!(found.contains("cut.mod</td><td class=\"number\">3</td>"), "{found}");
    // A program that was corrected is known by such a report too.
    let ran = bench.run("compensate out/base.mod out/cut.mod out/part.mod --cell cell.toml --out-dir twice").exits(2);
    assert!(ran.stderr.contains("compensate.again"), "{}", ran.stderr);
}

#[test]
fn old_spellings_go_on_with_a_note() {
    let bench = Bench::new();
    let check = "check part.mod --cell cell.toml --max-error 1";
    let (old, new) = (
        bench.run(&format!("{check} --format json --format rapid")),
        bench.run(&format!("{check} --output-format json --input-format rapid")),
    );
    assert_eq!((old.code, &old.stdout), (Some(0), &new.stdout));
    assert!(old.stderr.contains("--output-format") && new.stderr.is_empty(), "{}{}", old.stderr, new.stderr);
    let ran = bench.run("inspect part.mod --format=rapid").exits(0);
    assert!(ran.stderr.contains("write --input-format"), "{}", ran.stderr);
    assert!(!bench.run("inspect part.mod --format rapid --quiet").exits(0).stderr.contains("--input-format"));
    bench.run(&format!("{check} --format json --output-format text")).exits(2);
}

/// What a command writes to a terminal.
fn at_a_terminal(bench: &Bench, command: &str) -> String {
    let deflex = assert_cmd::cargo::cargo_bin!("deflex");
    let output = std::process::Command::new("script")
        .args(["-qec", &format!("{} {command}", deflex.display()), "/dev/null"])
        .current_dir(bench.path(""))
        .env("NO_COLOR", "1")
        .output()
        .expect("script, of bsdutils");
    String::from_utf8_lossy(&output.stdout).replace('\r', "")
}

#[test]
fn people_at_a_terminal_get_the_worst_and_pipes_get_rows() {
    let bench = Bench::new();
    let line = PROGRAM.lines().find(|line| line.contains("[[50,0,0]")).unwrap();
    let more: String = (1..30).map(|x| line.replace("[[50,0,0]", &format!("[[50,{x},0]")) + "\n").collect();
    bench.write("part.mod", PROGRAM.replace(line, &(more + line)));
    let said = at_a_terminal(&bench, "predict part.mod --cell cell.toml");
    assert!(said.contains("part.mod: 33 targets: 32 cut, 1 air\nerror: rms 0."), "{said}");
    assert!(said.contains("10 targets with the largest errors:") && !said.contains("target,line"), "{said}");
    assert!(said.lines().count() < 25, "{said}");
    assert!(bench.run("predict part.mod --cell cell.toml").exits(0).stdout.starts_with("target,line,"));
    bench.run("compensate part.mod --cell cell.toml -o out.mod").exits(0);
    let said = at_a_terminal(&bench, "diff part.mod out.mod");
    assert!(said.contains("32 of 33 targets changed\n  shift ") && said.lines().count() < 21, "{said}");
    assert!(said.contains("  other differences           0\n"), "{said}");
    assert!(bench.run("diff part.mod out.mod").exits(1).stdout.lines().count() > 32);
}

/// A random program: how it starts, what is cut and what is not, and targets that are kept or go nowhere known.
fn random(seed: u64) -> String {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut draw = |below: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 33) % below
    };
    let tail = "tMill\\WObj:=wPart;";
    let target =
        |x: u64, y: u64, axis: &str| format!("[[{x},{y},0],[0,1,0,0],[-1,0,1,0],[{axis},9E9,9E9,9E9,9E9,9E9]]");
    // On a track that all targets name, or on none.
    let axis = if draw(3) == 0 { "100" } else { "9E9" };
    let (data, _) = PROGRAM.split_once("  PROC main()").unwrap();
    let data = data.replace("MODULE Part", &format!("MODULE P{seed}"));
    let mut text = data + "  VAR num n;\n  PROC main()\n";
    text += &match draw(3) {
        0 => format!("    MoveAbsJ [[-20,10,20,0,60,0],[{axis},9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v200,fine,{tail}\n"),
        1 => format!("    MoveJ {},v200,fine,{tail}\n", target(0, 0, axis)),
        _ => String::new(),
    };
    for _ in 0..2 + draw(8) {
        let (x, y) = (draw(100), draw(60));
        text += &match draw(9) {
            0 => "    ! deflex air\n".to_owned(),
            1 => "    ! deflex cut\n".to_owned(),
            2 => format!("    MoveL CRobT(\\Tool:=tMill\\WObj:=wPart),v20,z1,{tail}\n"),
            3 => format!("    MoveL Offs({},n,0,0),v20,fine,{tail}\n", target(x, y, axis)),
            4 => format!("    MoveJ {},v200,fine,{tail}\n", target(x, y, axis)),
            _ => format!("    MoveL {},v20,fine,{tail}\n", target(x, y, axis)),
        };
    }
    text + &format!("    MoveL {},v20,fine,{tail}\n  ENDPROC\nENDMODULE\n", target(50, 30, axis))
}

#[test]
fn counts_add_up_and_nothing_unjudged_passes() {
    let bench = Bench::new();
    let track = "\n[[unit]]\nname = \"TRACK\"\naxis = \"eax_a\"\nkind = \"linear\"\ncarries = \"robot\"\ndirection = [0.0, 1.0, 0.0]\n\
                 min = -1000.0\nmax = 1000.0\n";
    bench.write("track.toml", CELL.to_owned() + track);
    let names: Vec<String> = (0..200).map(|seed| format!("p{seed}.mod")).collect();
    for (name, seed) in names.iter().zip(0..) {
        bench.write(name, random(seed));
    }
    let (mut unjudged, mut inserted, mut kept) = (0, 0, 0);
    for (i, some) in names.chunks(50).enumerate() {
        let (cell, subdivide) = (["cell.toml", "track.toml"][i % 2], ["", "--subdivide 0.02"][i / 2]);
        let inputs = some.join(" ");
        let out = format!("out{i}");
        let options = format!("--cell {cell} --out-dir {out} --json sum.json --html page.html {subdivide}");
        let ran = bench.run(&format!("compensate {inputs} {options}")).exits(0);
        let corrected = json(&bench.read("sum.json"));
        let files = corrected["files"].as_array().unwrap();
        assert_eq!(files.len(), some.len());
        let written = json(
            &bench
                .run(&format!(
                    "inspect {} --json",
                    some.iter().map(|name| format!("{out}/{name} ")).collect::<String>()
                ))
                .exits(0)
                .stdout,
        );
        for file in files {
            let path = file["path"].as_str().unwrap();
            let count = |key: &str| file[key].as_u64().unwrap();
            let of = |key: &str| {
                file[key].as_array().unwrap().iter().map(|kept| kept["count"].as_u64().unwrap()).sum::<u64>()
            };
            let parts = [count("corrected"), count("unchanged"), count("air"), count("inserted"), of("kept")];
            assert_eq!(parts.iter().sum::<u64>(), count("targets"), "{path}: {file}");
            let line = ran.stderr.lines().find(|line| line.starts_with(&format!("{path}: "))).unwrap();
            assert_eq!(sum_of_parts(line), (count("targets"), count("targets")), "{line}");
            let there = written["files"]
                .as_array()
                .unwrap()
                .iter()
                .find(|there| there["path"] == format!("{out}/{path}"))
                .unwrap();
            assert_eq!(there["motion_targets"], file["targets"], "{path}");
            (inserted, kept) = (inserted + count("inserted"), kept + of("kept"));
        }
        let page = bench.read("page.html");
        let tile = page.split_once("data-key=\"targets\">").unwrap().1;
        let (all, rest) = tile.split_once('<').unwrap();
        let aside = rest.split_once("<p class=\"aside\">").unwrap().1.split_once('<').unwrap().0;
        assert_eq!(
            sum_of_parts(&format!("{all} targets: {aside}")),
            (all.parse().unwrap(), all.parse().unwrap()),
            "{aside}"
        );
        let ran = bench.run(&format!("check {inputs} --cell {cell} --max-error 100 --output-format json"));
        for file in json(&ran.stdout)["files"].as_array().unwrap() {
            let skipped: u64 =
                file["unjudged"].as_array().unwrap().iter().map(|one| one["count"].as_u64().unwrap()).sum();
            let judged = file["judged"].as_u64().unwrap() + file["air"].as_u64().unwrap();
            assert_eq!(file["targets"].as_u64().unwrap(), judged + skipped, "{file}");
            assert_eq!(file["passed"].as_bool().unwrap(), skipped == 0, "{file}");
            unjudged += skipped;
            assert!(skipped == 0 || ran.code == Some(1));
        }
    }
    assert!(
        unjudged > 50 && inserted > 30 && kept > unjudged,
        "{unjudged} not judged, {inserted} inserted, {kept} kept"
    );
}

/// The whole and the sum of the parts of `part.mod: 1,236 targets: 1,211 corrected, 20 air, 5 kept: …`.
fn sum_of_parts(line: &str) -> (u64, u64) {
    let number = |text: &str| text.trim().split(' ').next().unwrap().replace(',', "").parse::<u64>();
    let words: Vec<&str> = line.split(": ").collect();
    let at = words.iter().position(|word| word.ends_with(" target") || word.ends_with(" targets")).unwrap();
    let parts = words[at + 1].split(';').next().unwrap().split(", ");
    (number(words[at]).unwrap(), parts.map(|part| number(part).unwrap()).sum())
}

#[test]
fn an_inserted_exit_point_is_not_the_end_of_the_cut() {
    let bench = Bench::new();
    let last = PROGRAM.lines().find(|line| line.contains("[[100,0,0]")).unwrap();
    // Zones that an inserted target keeps; the way out is faster than the cut.
    let out = last.replace("[[100,0,0]", "[[100,0,80]").replace("v20", "v200");
    let text = PROGRAM
        .replace(last, &format!("{last}\n    ! deflex air\n{out}"))
        .replace(",fine,", ",z0,")
        .replace(",z1,", ",z0,");
    bench.write("part.mod", text);
    bench.run("compensate part.mod --cell cell.toml --subdivide 0.05 -o out.mod --report rows.csv").exits(0);
    bench.run("diff part.mod out.mod --json diff.json").exits(1);
    let found = json(&bench.read("diff.json"));
    assert_eq!(found["other"], Value::Array(Vec::new()), "{found}");
    assert!(found["inserted"].as_array().unwrap().iter().any(|target| target["before"] == 5), "{found}");
    let moved =
        found["moved"].as_array().unwrap().iter().find(|moved| moved["target"] == 4).expect("the end of the cut");
    let rows = bench.read("rows.csv");
    let mut report = csv::Reader::from_reader(rows.as_bytes());
    let at = report.headers().unwrap().iter().position(|name| name == "correction_z_mm").unwrap();
    let row = report.records().map(Result::unwrap).find(|row| &row[0] == "4").unwrap();
    assert!((moved["shift_mm"][2].as_f64().unwrap() - row[at].parse::<f64>().unwrap()).abs() < 1e-3, "{moved}");
}

/// A report on stdout takes the place of the verdicts, which go to stderr.
#[test]
fn a_report_of_check_may_go_to_stdout() {
    let bench = Bench::new();
    let ran = bench.run("check part.mod --cell cell.toml --max-error 5 --json -").exits(0);
    let json: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    assert!(json["passed"].as_bool().unwrap() && ran.stderr.contains("3 judged"), "{}", ran.stderr);
    bench.run("check part.mod --cell cell.toml --max-error 5 --json - --output-format junit").exits(2);
}
