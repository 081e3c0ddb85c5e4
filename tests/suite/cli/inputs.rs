//! How inputs are found, recognised and put together.

use super::bench::{Bench, CELL, PROGRAM};

const MAIN: &str = "MODULE Main\n  PROC main()\n    cut;\n  ENDPROC\nENDMODULE\n";

#[test]
fn cl_becomes_rapid_that_lands_on_the_same_points() {
    let bench = Bench::new();
    bench.run("compensate part.apt --cell cell.toml -o posted.mod --report r.csv").exits(0);
    let posted = bench.read("posted.mod");
    assert!(posted.starts_with("MODULE posted\n") && posted.contains("tMill\\WObj:=wPart"));
    assert_eq!(posted.matches("Move").count(), 4);
    bench.run("check posted.mod --cell cell.toml --against part.apt --max-error 0.001 --at-targets").exits(0);
    bench.run("compensate part.apt --cell cell.toml --max-targets 2 --out-dir split").exits(0);
    assert_eq!(bench.names("split"), ["part.mod", "part.report.csv", "part_1.mod", "part_2.mod"]);
    bench.run("compensate part.apt --cell cell.toml --max-targets 2 -o split.mod").exits(2);
}

#[test]
fn modules_that_use_each_other_are_one_program() {
    let bench = Bench::new();
    let path = PROGRAM.replace("PROC main()", "PROC cut()");
    bench.write("main.mod", MAIN).write("path.mod", &path);
    bench.write("part.pgf", "<?xml?>\n<Program><Module>main.mod</Module><Module>path.mod</Module></Program>\n");
    bench.run("compensate main.mod path.mod --cell cell.toml").exits(2);
    bench.run("compensate main.mod path.mod --cell cell.toml --out-dir a").exits(0);
    bench.run("compensate part.pgf --cell cell.toml --out-dir b").exits(0);
    assert_eq!(bench.read("a/main.mod"), MAIN);
    assert_eq!(bench.read("a/path.mod"), bench.read("b/path.mod"));
    assert_ne!(bench.read("a/path.mod"), path);
    assert!(bench.path("b/part.pgf").exists());
}

#[test]
fn a_context_module_declares_and_is_not_written() {
    let bench = Bench::new();
    let (data, rest): (Vec<&str>, Vec<&str>) = PROGRAM.lines().partition(|line| line.contains("PERS"));
    bench.write("data.sys", format!("MODULE Data\n{}\nENDMODULE\n", data.join("\n")));
    bench.write("moves.mod", format!("{}\n", rest.join("\n")));
    bench.write("bare.toml", super::bench::CELL.replace("tMill", "tOther").replace("wPart", "wOther"));
    let ran = bench.run("compensate moves.mod --cell bare.toml").exits(2);
    assert!(ran.stderr.contains("tool `tMill`") && ran.stderr.contains("--context"), "{}", ran.stderr);
    let ran = bench.run("compensate moves.mod --cell bare.toml --context data.sys").exits(0);
    assert!(ran.stdout.contains("MoveL") && !ran.stdout.contains("tooldata"));
}

#[test]
fn forces_come_from_a_measured_file() {
    let bench = Bench::new();
    let forces = "target,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n,time_s\n2,0,0,0,100,0,0,1\n3,0,0,0,0,0,0,2\n";
    bench.write("m.csv", forces);
    let ran = bench.run("predict part.mod --cell cell.toml --forces m.csv").exits(0);
    let status: Vec<&str> = ran.stdout.lines().skip(1).filter_map(|line| line.split(',').nth(3)).collect();
    assert_eq!(status, ["air", "ok", "air", "air"]);
    bench.write("m.csv", "target,fx_n,fy_n,fz_n\n9,1,2,3\n");
    let ran = bench.run("predict part.mod --cell cell.toml --forces m.csv").exits(2);
    assert!(ran.stderr.contains("m.csv:2") && ran.stderr.contains("4 motion targets"), "{}", ran.stderr);
}

#[test]
fn inspect_says_what_was_understood() {
    let bench = Bench::new();
    bench.write("other.txt", "hello");
    let ran = bench.run("inspect part.mod part.apt --json").exits(0);
    let json: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    for (i, language) in ["rapid", "cl"].into_iter().enumerate() {
        let file = &json["files"][i];
        assert_eq!((file["language"].as_str(), file["round_trip"].as_bool()), (Some(language), Some(true)));
        assert_eq!((file["motion_targets"].as_u64(), file["literal_targets"].as_u64()), (Some(4), Some(4)));
        assert!(file["refused"].is_null());
    }
    bench.write("saved.txt", PROGRAM).write("lost.pgf", "<Program><Module>gone.mod</Module></Program>");
    let folder = bench.run("inspect .").exits(0).stdout;
    for found in ["part.mod", "part.apt", "saved.txt", "not in its folder: gone.mod"] {
        assert!(folder.contains(found), "{found}: {folder}");
    }
    assert!(!folder.contains("other.txt"), "{folder}");
    let other = bench.run("inspect other.txt --json").exits(2);
    let json: serde_json::Value = serde_json::from_str(&other.stdout).unwrap();
    assert!(json["files"][0]["refused"].is_string());
    bench.run("inspect none.mod").exits(2);
    bench.run("inspect part.apt --input-format rapid").exits(2);
}

/// A routine that the cell vouches for changes nothing, and what is left alone without says how to vouch for it.
#[test]
fn a_cell_vouches_for_routines_of_its_controller() {
    let bench = Bench::new();
    let text = PROGRAM.replace("PROC main()\n", "PROC main()\n    MoveSettings;\n");
    bench.write("part.mod", &text);
    let ran = bench.run("compensate part.mod --cell cell.toml -o out.mod");
    assert!(ran.stderr.contains("`MoveSettings` is not in the files"), "{}", ran.stderr);
    assert!(ran.stderr.contains("[controller] harmless"), "{}", ran.stderr);
    bench.write("cell.toml", CELL.replace("compensates = []", "compensates = []\nharmless = [\"MoveSettings\"]"));
    let ran = bench.run("compensate part.mod --cell cell.toml -o out.mod").exits(0);
    assert!(!ran.stderr.contains("MoveSettings"), "{}", ran.stderr);
    assert_ne!(bench.read("out.mod"), text);
}

#[test]
fn what_is_no_program_ends_with_2() {
    let bench = Bench::new();
    bench.write("cut.nc", "%\nO0001\nG21 G90\nG0 X0 Y0 Z10\nG1 X10 F200\nM30\n%\n");
    bench.write("empty.mod", "").write("binary.src", [0_u8, 1, 2, 255, 254, 0, 3]);
    for file in ["cut.nc", "empty.mod", "binary.src"] {
        let ran = bench.run(&format!("inspect {file}")).exits(2);
        assert!(ran.stderr.contains("error[") && ran.stdout.contains("refused"), "{file}: {}", ran.stderr);
    }
    // One that is understood is an answer.
    bench.run("inspect part.mod cut.nc").exits(0);
}

#[test]
fn inspect_shows_where_a_program_goes_file_by_file_and_together() {
    let bench = Bench::new();
    let module = |name: &str, x: f64, feed: &str| {
        let at = |x: f64, y: f64| format!("[[{x},{y},5],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
        format!(
            "MODULE {name}\nPROC main()\nMoveL {},{feed},fine,tMill\\WObj:=wPart;\nMoveL {},{feed},fine,tMill\\WObj:=wPart;\nENDPROC\nENDMODULE\n",
            at(x, 0.0),
            at(x, 60.0)
        )
    };
    std::fs::create_dir(bench.path("job")).unwrap();
    bench.write("job/a.mod", module("a", 10.0, "v20")).write("job/b.mod", module("b", -30.0, "v100"));
    let ran = bench.run("inspect job").exits(0);
    for line in [
        "a.mod: in wPart: x 10.0 to 10.0, y 0.0 to 60.0, z 5.0 to 5.0 mm",
        "together: 2 files, 4 motions",
        "together: tools tMill; work objects wPart",
        "together: in wPart: x -30.0 to 10.0, y 0.0 to 60.0, z 5.0 to 5.0 mm",
        "together: feeds 20.0 to 100.0 mm/s; about 0.1 min without joint moves and waits",
    ] {
        assert!(ran.stdout.contains(line), "{line} is missing in\n{}", ran.stdout);
    }
    let json: serde_json::Value = serde_json::from_str(&bench.run("inspect job/a.mod --json").exits(0).stdout).unwrap();
    let file = &json["files"][0];
    assert_eq!(file["extents"][0]["max_mm"], serde_json::json!([10.0, 60.0, 5.0]));
    assert!((file["run_time_s"].as_f64().unwrap() - 3.0).abs() < 1e-9, "{file:#}");
}
