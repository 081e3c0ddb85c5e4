//! A cell from `init`: what is marked is filled in by one rule, and the cell runs.

use super::bench::{Bench, PROGRAM};

/// The values of a cell in a workshop, none of them an example of `init`.
const OWN: &[(&str, &str)] = &[
    ("robot.stiffness.joint_nm_per_rad", "[7.1e5, 6.5e5, 9.0e5, 1.9e5, 1.7e5, 0.9e5]"),
    ("controller.compensates", "[\"geometry\"]"),
    ("tools.tMill.tcp_mm", "[10.0, 0.0, 250.0]"),
    ("tools.tMill.tcp_quat", "[0.70710678, 0.0, 0.0, 0.70710678]"),
    ("tools.tMill.mass_kg", "12.5"),
    ("tools.tMill.cog_mm", "[0.0, 3.0, 90.0]"),
    ("wobjs.wPart.uframe_mm", "[1050.0, -200.0, 650.0]"),
    ("wobjs.wPart.uframe_quat", "[0.70710678, 0.0, 0.0, 0.70710678]"),
    ("wobjs.wPart.oframe_mm", "[0.0, 0.0, 50.0]"),
    ("wobjs.wPart.oframe_quat", "[0.0, 0.0, 0.0, 1.0]"),
    ("cl.units", "\"inch\""),
    ("cl.point", "\"centre\""),
    ("cut.max_cutting_feed_mm_s", "80.0"),
    ("cut.cutter.diameter_mm", "16.0"),
    ("cut.cutter.corner_radius_mm", "8.0"),
    ("cut.cutter.teeth", "4"),
    ("cut.cutter.helix_deg", "35.0"),
    ("cut.engagement.mode", "\"down\""),
    ("cut.engagement.depth_mm", "0.3"),
    ("cut.engagement.width_mm", "8.0"),
    ("cut.engagement.feed_per_tooth_mm", "0.03"),
    ("cut.engagement.lead_deg", "0.0"),
    ("cut.engagement.tilt_deg", "15.0"),
    ("cut.coefficients.material", "\"al6061\""),
];

/// Assignments of a cell file: key with its section, value, whether marked. Values of a cell from `init` stand in one line.
fn assignments(cell: &str) -> Vec<(String, String, bool)> {
    let mut section = String::new();
    let mut found = Vec::new();
    for line in cell.lines() {
        let (code, comment) = line.split_once('#').unwrap_or((line, ""));
        if let Some(name) = code.trim().strip_prefix('[') {
            section = name.trim_end_matches(']').to_owned();
        } else if let Some((key, value)) = code.split_once('=') {
            let marked = comment.trim_start().starts_with("<<");
            found.push((format!("{section}.{}", key.trim()), value.trim().to_owned(), marked));
        }
    }
    found
}

/// Puts own values in and takes the marks away, except for the keys in `but`.
fn filled(cell: &str, but: &[&str]) -> String {
    let mut assigned = assignments(cell).into_iter();
    let line = |line: &str| {
        let code = line.split('#').next().unwrap_or_default();
        let Some((key, value, true)) = code.contains('=').then(|| assigned.next()).flatten() else {
            return line.to_owned();
        };
        if but.contains(&key.as_str()) {
            return line.to_owned();
        }
        let (_, own) = OWN.iter().find(|(known, _)| *known == key).unwrap_or_else(|| panic!("{key} is marked"));
        assert_ne!(*own, value, "{key} would not be filled in");
        line.replacen(&value, own, 1).replacen("# <<", "#", 1)
    };
    cell.lines().map(line).collect::<Vec<_>>().join("\n") + "\n"
}

/// The cell of a robot without a published stiffness, with a stiffness to fill in.
pub(super) fn with_stiffness(cell: &str) -> String {
    cell.replace("# [robot.stiffness]", "[robot.stiffness]")
        .replace("# joint_nm_per_rad = [ , , , , , ]", "joint_nm_per_rad = [1e6, 1e6, 1e6, 1e5, 1e5, 1e5]   # <<")
}

/// A program that leaves its tool and its work object to the cell.
fn undeclared() -> String {
    PROGRAM.lines().filter(|line| !line.contains("PERS")).map(|line| format!("{line}\n")).collect()
}

#[test]
fn every_value_of_the_cell_is_marked_and_nothing_else() {
    let cell = with_stiffness(&Bench::new().run("init --robot irb4600-60-2.05").exits(0).stdout);
    // Not the cell's own: the model was given, limits and forms are choices with the one that fits every cell.
    let chosen = [
        "robot.model",
        "limits.max_correction_mm",
        "limits.max_step_mm",
        "cl.tool",
        "cl.wobj",
        "cl.spin",
        "cl.spin_deg",
        "cut.force",
    ];
    let all = assignments(&cell);
    for (key, _, marked) in &all {
        assert_eq!(*marked, !chosen.contains(&key.as_str()), "{key}");
    }
    let marked: Vec<&str> = all.iter().filter(|(.., marked)| *marked).map(|(key, ..)| key.as_str()).collect();
    assert_eq!(marked, OWN.iter().map(|(key, _)| *key).collect::<Vec<_>>());
}

#[test]
fn a_filled_in_cell_corrects_programs_and_has_nothing_left_to_say() {
    let bench = Bench::new();
    bench.write("own.mod", undeclared());
    // inch: the same path as in millimetres
    bench.write("own.apt", "FEDRAT/20\nGOTO/0,0,4,0,0,1\nGOTO/0,0,0,0,0,1\nGOTO/2,0,0,0,0,1\nFINI\n");
    for (model, programs) in [("irb6660-205-1.9", &["own.mod", "own.apt"][..]), ("irb4600-60-2.05", &["own.mod"])] {
        let cell = with_stiffness(&bench.run(&format!("init --robot {model}")).exits(0).stdout);
        bench.write("own.toml", filled(&cell, &[]));
        for program in programs {
            let ran = bench.run(&format!("compensate {program} --cell own.toml -o out.mod --json out.json")).exits(0);
            assert!(!ran.stderr.contains("warning"), "{model}: {}", ran.stderr);
            let json: serde_json::Value = serde_json::from_str(&bench.read("out.json")).unwrap();
            assert!(json["files"][0]["max_correction_mm"].as_f64().unwrap() > 0.01, "{model}: {json}");
        }
    }
}

#[test]
fn examples_that_are_left_are_named_with_their_lines() {
    let bench = Bench::new();
    bench.write("own.mod", undeclared());
    let cell = bench.run("init --robot irb6660-205-1.9").exits(0).stdout;
    let left = ["robot.stiffness.joint_nm_per_rad", "cut.cutter.teeth"];
    bench.write("own.toml", filled(&cell, &left));
    let line = |key: &str| 1 + cell.lines().position(|line| line.starts_with(&format!("{key} ="))).unwrap();
    let (stiffness, teeth) = (line("joint_nm_per_rad"), line("teeth"));
    for command in ["compensate own.mod --cell own.toml", "check own.mod --cell own.toml --max-error 5"] {
        let said = bench.run(command).exits(0).stderr;
        assert!(
            said.contains(&format!(
                "2 values are still the examples that `deflex init` printed: lines {stiffness}, {teeth}"
            )),
            "{said}"
        );
        assert!(said.contains(&format!("own.toml:{stiffness}:1")), "{said}");
        assert!(bench.run(&format!("{command} --quiet")).exits(0).stderr.is_empty());
    }
}

#[test]
fn the_geometry_in_the_comments_is_that_of_the_model() {
    let bench = Bench::new();
    for model in ["irb6660-205-1.9", "irb4600-60-2.05"] {
        let cell = with_stiffness(&bench.run(&format!("init --robot {model}")).exits(0).stdout);
        let mut inside = false;
        let uncomment = |line: &str| {
            inside = line == "# [robot.kinematics]" || inside && !line.is_empty();
            line.strip_prefix("# ").filter(|_| inside).unwrap_or(line).to_owned() + "\n"
        };
        let own: String = cell.lines().map(uncomment).collect();
        assert!(own.contains("\n[robot.kinematics]\n") && own.contains("\nlinks = ["), "{own}");
        let pushed = |cell: &str| {
            let constant = "force = \"constant\"\nforce_n = [120.0, -260.0, 410.0]\nframe = \"wobj\"";
            filled(cell, &[]).replace("force = \"mechanistic\"", constant)
        };
        bench.write("built-in.toml", pushed(&cell));
        bench.write("own.toml", pushed(&own.replace(model, "like it")));
        let report = |cell: &str| bench.run(&format!("predict part.mod --cell {cell} --quiet")).exits(0).stdout;
        assert_eq!(report("own.toml"), report("built-in.toml"), "{model}");
    }
}

/// A new cell of a KUKA or a FANUC has its maker's names, angles and home, and reads.
#[test]
fn a_cell_speaks_the_language_of_its_controller() {
    let bench = Bench::new();
    for (model, words, not) in [
        (
            "kr240-r2900-2",
            &[
                "# start_deg = [0, -90, 90, 0, 0, 0]",
                "[tools.\"TOOL_DATA[1]\"]",
                "tcp_abc_deg",
                "LOAD_DATA[1]",
                "[wobjs.\"BASE_DATA[1]\"]",
                "wobj = \"BASE_DATA[1]\"",
            ][..],
            &["tooldata", "uframe_quat", "tMill", "rSpindle {rpm};"][..],
        ),
        (
            "m-20ia",
            &[
                "# start_deg = [0, 0, 0, 0, 0, 0]",
                "[tools.\"UT 1\"]",
                "tcp_wpr_deg",
                "PAYLOAD",
                "[wobjs.\"UF 1\"]",
                "tool = \"UT 1\"",
            ],
            &["tooldata", "uframe_quat", "tMill", "TOOL_DATA["],
        ),
        ("irb6700-150-3.20", &["[tools.tMill]", "tcp_quat", "wobjdata, oframe"], &["TOOL_DATA[", "UT 1"]),
    ] {
        let cell = bench.run(&format!("init --robot {model}")).exits(0).stdout;
        for word in words {
            assert!(cell.contains(word), "{model}: {word} is missing in\n{cell}");
        }
        for word in not {
            assert!(!cell.contains(word), "{model}: {word} stands in\n{cell}");
        }
        bench.write("new.toml", &cell);
        let joints = if model.starts_with("kr") { "0,-90,90,0,0,0" } else { "0,0,0,0,0,0" };
        bench.run(&format!("pose --cell new.toml --joints {joints}")).exits(0);
    }
}
