//! CL data with several tools and with actions of the machine other than motions, from file to posted program.

use super::bench::{Bench, CELL};

const PART: &str = "UNITS/MM\nLOADTL/1\nSPINDL/9000,RPM,CLW\nFEDRAT/1200,MMPM\nRAPID\nGOTO/0,0,20,0,0,1\nGOTO/10,0,0\nSTOP\n\
                    RAPID\nGOTO/10,0,20\nSPINDL/OFF\nLOADTL/2\nRAPID\nGOTO/0,0,20\nDELAY/2.5\nGOTO/10,0,0\nGOHOME\nFINI\n";

fn cell(more: &str) -> String {
    let tools = CELL.replace("[cl]\n", "[cl]\ntools = { \"1\" = \"tMill\", \"2\" = \"tFine\" }\n");
    format!("{tools}\n[tools.tFine]\ntcp_mm = [0.0, 0.0, 290.0]\ntcp_quat = [1.0, 0.0, 0.0, 0.0]\n{more}")
}

#[test]
fn two_tools_are_posted_with_the_cells_own_routines() {
    let bench = Bench::new();
    bench.write("two.apt", PART);
    let ran = bench.run("compensate two.apt --cell cell.toml -o a.mod").exits(2);
    assert!(ran.stderr.contains("two.apt:12") && ran.stderr.contains("[cl] tools"), "{}", ran.stderr);
    assert!(!bench.path("a.mod").exists());
    bench.run("compensate two.apt --cell cell.toml --tool tMill -o a.mod").exits(2);
    bench.write("two.toml", cell(""));
    let ran = bench.run("compensate two.apt --cell two.toml -o a.mod").exits(2);
    assert!(ran.stderr.contains("two.apt:12") && ran.stderr.contains("tool_change"), "{}", ran.stderr);
    bench.run("predict two.apt --cell two.toml").exits(0);
    bench.run("check two.apt --cell two.toml --max-error 5").exits(0);
    let post = "[cl.post]\ntool_change = \"rTool {number}, \\\"{tool}\\\";\"\nspindle_on = \"rSpindle {rpm};\"\n\
                spindle_off = \"rSpindleOff;\"\nstop = \"Stop;\"\n";
    bench.write("post.toml", cell(post));
    let ran = bench.run("compensate two.apt --cell post.toml -o a.mod").exits(0);
    assert!(
        ran.stderr.contains("home") && ran.stderr.contains("a delay is written as a wait"),
        "what is not a template is said: {}",
        ran.stderr
    );
    let posted = bench.read("a.mod");
    let lines: Vec<&str> = posted.lines().map(str::trim).collect();
    let at =
        |text: &str| lines.iter().position(|line| line.starts_with(text)).unwrap_or_else(|| panic!("{text}: {posted}"));
    assert!(at("rTool 1, \"tMill\";") < at("rSpindle 9000;") && at("rSpindle 9000;") < at("MoveJ"));
    assert!(at("Stop;") < at("rSpindleOff;") && at("rSpindleOff;") < at("rTool 2, \"tFine\";"));
    assert!(at("rTool 2") < at("WaitTime 2.5;"));
    let moves: Vec<&&str> = lines.iter().filter(|line| line.starts_with("Move")).collect();
    assert!(moves[..3].iter().all(|m| m.contains(",tMill\\")) && moves[3..].iter().all(|m| m.contains(",tFine\\")));
    // Instructions are run ahead of a corner path: the motion before them stops.
    assert!(lines[at("Stop;") - 1].contains(",fine,") && lines[at("rSpindleOff;") - 1].contains(",fine,"), "{posted}");
    assert!(lines[at("rTool 2") + 1].starts_with("MoveJ"), "{posted}");
}

#[test]
fn the_cells_templates_are_checked() {
    let bench = Bench::new();
    for (post, said) in [
        ("tool_chnge = \"x;\"", "tool_change"),
        ("stop = \"Stop {rpm};\"", "{rpm}"),
        ("stop = \"ENDPROC\"", "within a procedure"),
    ] {
        bench.write("bad.toml", format!("{CELL}\n[cl.post]\n{post}\n"));
        let ran = bench.run("compensate part.apt --cell bad.toml -o a.mod").exits(2);
        assert!(ran.stderr.contains(said), "{post}: {}", ran.stderr);
    }
    bench.write("bad.toml", CELL.replace("[cl]\n", "[cl]\nharmless = [\"GOTO\"]\n"));
    assert!(bench.run("compensate part.apt --cell bad.toml -o a.mod").exits(2).stderr.contains("GOTO"));
}

#[test]
fn what_is_refused_writes_nothing() {
    let bench = Bench::new();
    bench.write("part.src", "DEF part( )\nPTP HOME\nLIN {X 10.0,Y 20.0,Z 30.0,A 0.0,B 90.0,C 0.0} C_DIS\nEND\n");
    let ran = bench.run("compensate part.src --input-format cl --cell cell.toml -o a.mod").exits(2);
    assert!(ran.stderr.contains("no CL statement") && !bench.path("a.mod").exists(), "{}", ran.stderr);
    let ran = bench.run("compensate part.apt --cell cell.toml -o a.cls").exits(2);
    assert!(ran.stderr.contains(".mod") && !bench.path("a.cls").exists(), "{}", ran.stderr);
    bench.write("r.apt", "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,20,0,0,1\nRETRCT\nGOTO/10,0,20\n");
    let ran = bench.run("compensate r.apt --cell cell.toml -o a.mod").exits(2);
    assert!(ran.stderr.contains("r.apt:4") && ran.stderr.contains("harmless") && !bench.path("a.mod").exists());
    bench.write("h.toml", CELL.replace("[cl]\n", "[cl]\nharmless = [\"RETRCT\"]\n"));
    let ran = bench.run("compensate r.apt --cell h.toml -o a.mod").exits(0);
    assert!(ran.stderr.contains("declares"), "{}", ran.stderr);
}

#[test]
fn a_printed_surface_normal_turns_the_force() {
    let bench = Bench::new();
    let path = |normal: &str| {
        format!(
            "$$ CATIA APT VERSION 1.0\nUNITS/MM\nFEDRAT/1200,MMPM\nGOTO/0,0,0,0,0,1\nGOTO/10,0,0,0,0,1{normal}\nGOTO/20,0,0,0,0,1{normal}\n"
        )
    };
    bench.write("feed.toml", CELL.replace("frame = \"wobj\"", "frame = \"feed\""));
    let force = |name: &str, normal: &str| -> [f64; 3] {
        bench.write(name, path(normal));
        let report = bench.run(&format!("predict {name} --cell feed.toml")).exits(0).stdout;
        let header: Vec<&str> = report.lines().next().unwrap().split(',').collect();
        let row: Vec<&str> = report.lines().nth(2).unwrap().split(',').collect();
        ["fx_n", "fy_n", "fz_n"].map(|key| row[header.iter().position(|h| *h == key).unwrap()].parse().unwrap())
    };
    let near = |found: [f64; 3], expected: [f64; 3]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.01);
    // The cell's 120, −260, 410 N along feed, normal × feed and normal.
    assert!(near(force("a.apt", ""), [120.0, -260.0, 410.0]));
    assert!(near(force("b.apt", ",0,0,1"), [120.0, -260.0, 410.0]));
    let leaned = [120.0, -260.0 * 0.8 + 410.0 * 0.6, 260.0 * 0.6 + 410.0 * 0.8];
    assert!(near(force("c.apt", ",0,0.6,0.8"), leaned), "{:?}", force("c.apt", ",0,0.6,0.8"));
}
