//! The path that the controller drives: its law from logs, and the path by it.

use super::bench::Bench;
use deflex::cell::Cell;
use deflex::correct::{Course, Options, Prepared};
use deflex::drive::{PathLaw, drive};
use deflex::program::rapid;
use deflex::text::Source;
use serde_json::Value;
use std::fmt::Write;

const CELL: &str = "[robot]\nmodel = \"irb6660-205-1.9\"\n[cut]\nforce = \"none\"\n";

/// A square corner at (1200, 0, 900), 100 mm each way, straight down.
fn program(speed: &str, zone: &str) -> String {
    let to = |x: f64, y: f64, zone: &str| {
        let axes = "[9E9,9E9,9E9,9E9,9E9,9E9]";
        format!("    MoveL [[{x:.1},{y:.1},900],[0,0,1,0],[0,0,0,0],{axes}],{speed},{zone},tMill;\n")
    };
    let tool = "  PERS tooldata tMill:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n";
    let moves = to(1100.0, 0.0, "fine") + &to(1200.0, 0.0, zone) + &to(1200.0, 100.0, "fine");
    format!("MODULE m\n{tool}  PROC main()\n{moves}  ENDPROC\nENDMODULE\n")
}

/// The log of a controller with a law.
fn log(program: &str, law: &PathLaw) -> String {
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let program = rapid::read(vec![Source::new("m.mod", program)], Vec::new()).unwrap();
    let prepared = Prepared::new(&program, &cell, &Options::default()).unwrap();
    let course = Course::new(&program, &cell, &prepared).unwrap();
    let mut text = "time_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n".to_owned();
    for sample in drive(&cell.arm.robot, law, &course.waypoints).unwrap() {
        let axes = cell.arm.robot.axes_deg_from_motor(&sample.motor).map(|deg| format!("{deg:.5}")).join(",");
        writeln!(text, "{:.3},{axes}", sample.time).unwrap();
    }
    text
}

/// Least distance (mm) of a path in CSV from the corner.
fn from_corner(path: &str) -> f64 {
    let distance = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        ((cells[2] - 1200.0).powi(2) + cells[3].powi(2) + (cells[4] - 900.0).powi(2)).sqrt()
    };
    path.lines().skip(1).map(distance).fold(f64::INFINITY, f64::min)
}

#[test]
fn logs_give_the_law_and_the_law_gives_the_path() {
    let bench = Bench::new();
    bench.write("cell.toml", CELL);
    let law = PathLaw { zone_share: 0.8, smoothing: [0.07, 0.05], ..PathLaw::TYPICAL };
    let mut arguments = "identify --cell cell.toml -o found.toml --json found.json".to_owned();
    for (i, (speed, zone)) in [("v50", "z1"), ("v50", "z10"), ("v200", "z1"), ("v200", "z10")].into_iter().enumerate() {
        let text = program(speed, zone);
        bench.write(&format!("p{i}.mod"), &text);
        bench.write(&format!("l{i}.csv"), log(&text, &law));
        write!(arguments, " --log p{i}.mod l{i}.csv").unwrap();
    }
    let ran = bench.run(&arguments).exits(0);
    assert!(ran.stdout.contains("judged on 1 log that no fit has seen"), "{}", ran.stdout);
    let found: Value = serde_json::from_str(&bench.read("found.json")).unwrap();
    let rms = |when: &str| found["path"][when]["rms_mm"].as_f64().unwrap();
    assert!(rms("after") < 0.1 * rms("before"), "{found:#}");
    let time = |whose: &str| found["path"]["run_time_s"][whose].as_f64().unwrap();
    assert!((time("measured") - time("predicted")).abs() < 0.05, "{found:#}");

    // A speed and a zone that no log had, against the law that made the logs.
    bench.write("other.mod", program("v100", "z5"));
    let path = bench.run("predict other.mod --cell found.toml --path - -q").exits(0).stdout;
    assert!(path.starts_with("time_s,target,x_mm,y_mm,z_mm,qw,qx,qy,qz,feed_mm_s,fx_n,fy_n,fz_n\n"), "{path}");
    let by_the_law = "[controller.path]\nzone_share = 0.8\nsmoothing_s = [0.07, 0.05]\nacceleration_mm_s2 = 8000.0\n";
    bench.write("law.toml", format!("{CELL}{by_the_law}corner_acceleration_mm_s2 = 4000.0\n"));
    let expected = bench.run("predict other.mod --cell law.toml --path - -q").exits(0).stdout;
    let (is, should) = (from_corner(&path), from_corner(&expected));
    assert!(should > 1.0 && (is - should).abs() < 0.1 * should, "{is} for {should} mm");
}

/// The first of two logs is held out. It is of a controller that hardly leaves the programmed path, the other one is not.
#[test]
fn a_law_that_predicts_no_better_than_the_program_is_not_written() {
    let bench = Bench::new();
    bench.write("cell.toml", CELL);
    let exact = PathLaw { zone_share: 0.01, smoothing: [0.001, 0.001], ..PathLaw::TYPICAL };
    for (name, law) in [("exact", &exact), ("rounding", &PathLaw::TYPICAL)] {
        let text = program("v200", "z10");
        bench.write(&format!("{name}.mod"), &text);
        bench.write(&format!("{name}.csv"), log(&text, law));
    }
    let logs = "--log exact.mod exact.csv --log rounding.mod rounding.csv";
    let ran = bench.run(&format!("identify --cell cell.toml -o found.toml {logs}")).exits(0);
    assert!(ran.stdout.contains("the cell does not get this law"), "{}", ran.stdout);
    assert_eq!(bench.read("found.toml"), CELL);
}

/// A quarter of a circle on which the tool tilts by 0.4 rad about x. The orientation of the circle point is on no way between the two.
fn arc(speed: &str, mode: &str) -> String {
    let to = |x: f64, y: f64, q: &str| format!("[[{x:.2},{y:.2},900],[{q}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
    let [s, c, b, d] = [0.2_f64.sin(), 0.2_f64.cos(), 0.15_f64.sin(), 0.15_f64.cos()];
    let via = to(1170.71, 29.29, &format!("{:.8},0,{d:.8},0", -b));
    let end = to(1200.0, 100.0, &format!("0,0,{c:.8},{s:.8}"));
    let (start, go) = (to(1100.0, 0.0, "0,0,1,0"), format!("{speed},fine,tMill;\n"));
    let text = program(speed, "fine");
    let head = text.split("    MoveL").next().unwrap();
    format!("{head}    {mode}\n    MoveL {start},{go}    MoveC {via},{end},{go}  ENDPROC\nENDMODULE\n")
}

#[test]
fn logs_show_how_the_tool_turns_on_arcs() {
    let bench = Bench::new();
    bench.write("cell.toml", CELL);
    for (mode, word) in [("PathFrame", "path"), ("ObjectFrame", "even"), ("CirPointOri", "circle_point")] {
        for speed in ["v50", "v100"] {
            bench.write(&format!("{speed}.mod"), arc(speed, ""));
            let program = arc(speed, &format!("CirPathMode\\{mode};"));
            bench.write(&format!("{speed}.csv"), log(&program, &PathLaw::TYPICAL));
        }
        let logs = "--log v50.mod v50.csv --log v100.mod v100.csv";
        let ran = bench.run(&format!("identify --cell cell.toml -o found.toml {logs}")).exits(0);
        let found = bench.read("found.toml");
        assert!(found.contains(&format!("arc_turn = \"{word}\"")), "{mode}: {found}\n{}", ran.stdout);
    }
}

#[test]
fn without_a_law_corners_are_as_written_and_that_is_said() {
    let bench = Bench::new();
    bench.write("cell.toml", CELL);
    bench.write("p.mod", program("v50", "z10"));
    let ran = bench.run("predict p.mod --cell cell.toml --path path.csv --report r.csv").exits(0);
    // A parabola over a zone of 10 mm at a right angle: 10 √2 / 4 mm.
    assert!(ran.stderr.contains("round them by up to 3.54 mm"), "{}", ran.stderr);
    assert!(from_corner(&bench.read("path.csv")) < 0.2);
}

#[test]
fn logs_that_cannot_be_used_are_refused() {
    let bench = Bench::new();
    bench.write("cell.toml", CELL);
    let text = program("v50", "z1");
    bench.write("p.mod", &text);
    bench.write("l.csv", log(&text, &PathLaw::TYPICAL));
    bench.write("none.csv", "target,x_mm,y_mm,z_mm\n1,1,2,3\n");
    let refused = |logs: &str| bench.run(&format!("identify --cell cell.toml {logs}")).exits(2).stderr;
    assert!(refused("--log p.mod l.csv").contains("one log cannot be judged"));
    let without_time = refused("--log p.mod none.csv --log p.mod l.csv");
    assert!(without_time.contains("`time_s` is missing") && without_time.contains("none.csv"), "{without_time}");
    bench.write("far.mod", text.replace("1100.0,0.0,900", "1100.0,-300.0,900"));
    assert!(refused("--log p.mod l.csv --log p.mod l.csv").contains("this log is given twice"));
    bench.write("m.csv", log(&text, &PathLaw { acceleration: 5.0, ..PathLaw::TYPICAL }));
    assert!(refused("--log far.mod l.csv --log p.mod m.csv").contains("the axes do not pass the first"));
}

const LAW: &str = "[controller.path]\nzone_share = 0.87\nsmoothing_s = [0.058, 0.058]\nacceleration_mm_s2 = 8000.0\n\
                   corner_acceleration_mm_s2 = 4000.0\n";

/// Largest distance (mm) of a path in CSV from the two sides of the square corner.
fn from_sides(path: &str) -> f64 {
    let distance = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let (x, y, z) = (cells[2] - 1200.0, cells[3], cells[4] - 900.0);
        let to = |along: f64, across: f64| (along.max(0.0).powi(2) + across.powi(2) + z.powi(2)).sqrt();
        to(x, y).min(to(-y, x))
    };
    path.lines().skip(1).map(distance).fold(0.0, f64::max)
}

#[test]
fn the_driven_path_is_kept_within_a_tolerance_and_its_cost_is_reported() {
    let bench = Bench::new();
    bench.write("cell.toml", format!("{CELL}{LAW}"));
    let text = program("v50", "z1");
    bench.write("p.mod", &text);
    let before = bench.run("predict p.mod --cell cell.toml --path - -q").exits(0).stdout;
    assert!(from_corner(&before) > 0.5 && from_sides(&before) > 0.4);
    let run = |arguments: &str| {
        let ran =
            bench.run(&format!("compensate p.mod --cell cell.toml -o out.mod --json out.json {arguments}")).exits(0);
        let json: Value = serde_json::from_str(&bench.read("out.json")).unwrap();
        let path = bench.run("predict out.mod --cell cell.toml --path - -q").exits(0).stdout;
        (ran.stderr, json["files"][0].clone(), path, bench.read("out.mod"))
    };
    // Without targets that may be added, the arm has to stop at the corner: the zone's name is edited.
    let (said, json, path, out) = run("--max-path-error 0.05");
    assert!(from_sides(&path) < 0.05 && from_corner(&path) < 0.05);
    assert_eq!(out, text.replace(",z1,", ",fine,"));
    assert!(said.contains("comes to rest at 1 corner") && said.contains("`--subdivide MM` may add"), "{said}");
    let time = |json: &Value, which: &str| json["driven_path"][which]["run_time_s"].as_f64().unwrap();
    let stop = time(&json, "corrected") - time(&json, "programmed");
    // The axes come to rest (2 · 58 ms), and the controller no longer cuts the corner.
    assert!((0.116..0.25).contains(&stop), "{stop}");
    assert!(json["driven_path"]["programmed"]["max_mm"].as_f64().unwrap() > 0.5, "{json}");
    // With them, it takes less time.
    let (said, json, path, out) = run("--max-path-error 0.05 --subdivide 0.05");
    assert!(from_sides(&path) < 0.05 && from_corner(&path) < 0.05, "{said}");
    assert!(json["driven_path"]["corrected"]["max_mm"].as_f64().unwrap() <= 0.05, "{json}");
    let added = time(&json, "corrected") - time(&json, "programmed");
    assert!(added < stop, "{added} for {stop} s");
    assert_eq!(out.matches("MoveL").count(), 3 + usize::try_from(json["inserted"].as_u64().unwrap()).unwrap());
    assert!(out.contains(",z0,tMill;") && json["inserted"].as_u64() > Some(0), "{out}");
    // A gate judges it by the path that it is driven along, though its points lie elsewhere.
    bench.run("check out.mod --cell cell.toml --against p.mod --max-error 0.05").exits(0);
    bench.run("check out.mod --cell cell.toml --against p.mod --max-error 0.002").exits(1);
    // The report is of the program's own targets.
    let report = bench.read("out.report.csv");
    assert_eq!(report.lines().count(), 1 + 3, "{report}");
    // A tolerance that is kept already changes nothing.
    let (_, _, _, out) = run("--max-path-error 2");
    assert_eq!(out, text);
}

#[test]
fn a_tolerance_of_the_driven_path_needs_a_law_and_a_program_that_is_edited() {
    let bench = Bench::new();
    bench.write("cell.toml", CELL);
    bench.write("p.mod", program("v50", "z1"));
    let refused = bench.run("compensate p.mod --cell cell.toml -o out.mod --max-path-error 0.05").exits(2).stderr;
    assert!(refused.contains("path.no-law") && refused.contains("identify --log"), "{refused}");
    // Zonedata of the program's own may have any name: `fine` may be a zone then.
    let own = program("v50", "z1").replace("  PROC", "  CONST zonedata fine:=[FALSE,5,5,5,1,5,1];\n  PROC");
    bench.write("own.mod", own);
    bench.write("law.toml", format!("{CELL}{LAW}"));
    let ran = bench.run("compensate own.mod --cell law.toml -o out.mod --max-path-error 0.05").exits(0);
    assert!(ran.stderr.contains("path.tolerance") && ran.stderr.contains("can be kept"), "{}", ran.stderr);
    assert!(bench.read("out.mod").contains(",z0,tMill;"), "{}", bench.read("out.mod"));
}

#[test]
fn a_program_that_will_stutter_is_named_before_it_runs() {
    let bench = Bench::new();
    bench.write("cell.toml", format!("{CELL}{LAW}planning_s = 0.01\n"));
    // 0.4 mm at 50 mm/s takes 8 ms; the zone of 1 mm is larger than half of it.
    let text = program("v50", "z1");
    let corner = text.lines().find(|line| line.contains("z1")).unwrap();
    let near = corner.replace("1200.0,0.0,900", "1199.6,0.0,900");
    assert_ne!(near, corner);
    bench.write("p.mod", text.replace(corner, &format!("{near}\n{corner}")));
    let said = bench.run("predict p.mod --cell cell.toml --path path.csv --report r.csv").exits(0).stderr;
    assert!(said.contains("path.stutter") && said.contains("1 motion takes less than the 0.01 s"), "{said}");
    assert!(said.contains("the shortest takes 0.0080 s"), "{said}");
    assert!(said.contains("path.zones-overlap") && said.contains("2 zones are larger"), "{said}");
    bench.write("far.mod", &text);
    let said = bench.run("predict far.mod --cell cell.toml --path path.csv --report r.csv").exits(0).stderr;
    assert!(!said.contains("path.stutter") && !said.contains("path.zones-overlap"), "{said}");
}

/// The chip, and with it the force, is that of the speed that is driven: at a stop only the edges rub.
#[test]
fn the_force_follows_the_speed_that_is_driven() {
    let bench = Bench::new();
    let cut = "[cut]\nforce = \"mechanistic\"\n[cut.engagement]\nmode = \"slot\"\nlead_deg = 0.0\ntilt_deg = 0.0\ndepth_mm = 2.0\nfeed_per_tooth_mm = 0.1\n\
               [cut.coefficients]\nmaterial = \"al7075\"\n[tools.tMill.cutter]\ndiameter_mm = 10.0\ncorner_radius_mm = 1.0\nteeth = 2\n\
               [robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n";
    let cell = CELL.replace("[cut]\nforce = \"none\"\n", cut);
    bench.write("cell.toml", format!("{cell}{LAW}"));
    bench.write("p.mod", program("v50", "fine"));
    let path = bench.run("predict p.mod --cell cell.toml --path - -q").exits(0).stdout;
    let rows: Vec<Vec<f64>> =
        path.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    let force = |row: &Vec<f64>| row[10..13].iter().map(|f| f * f).sum::<f64>().sqrt();
    // The second side of the corner is cut: from its stop to the middle of the way.
    let side: Vec<&Vec<f64>> = rows.iter().filter(|row| row[1] >= 3.0).collect();
    let at = |feed: f64| side.iter().find(|row| (row[9] - feed).abs() < 1.5).map(|row| force(row)).unwrap();
    let [slow, half, full] = [2.0, 25.0, 50.0].map(at);
    assert!(slow < 0.5 * full, "{slow} of {full} N");
    // Between the force of the edges and the whole one, evenly.
    assert!((half - 0.5 * (slow + full)).abs() < 0.1 * full, "{slow}, {half}, {full} N");
}

#[test]
fn stops_are_written_as_the_language_writes_them() {
    let bench = Bench::new();
    bench.write("cell.toml", format!("{CELL}{LAW}zone_mm = 2.0\n"));
    let krl = |corner: &str| {
        format!(
            "DEF p()\n$BASE={{X 0,Y 0,Z 0,A 0,B 0,C 0}}\n$TOOL={{X 0,Y 0,Z 100,A 0,B 0,C 0}}\n$VEL.CP=0.05\n\
             LIN {{X 1100,Y 0,Z 900,A 0,B 180,C 0}}\nLIN {{X 1200,Y 0,Z 900,A 0,B 180,C 0}}{corner}\n\
             LIN {{X 1200,Y 100,Z 900,A 0,B 180,C 0}}\nEND\n"
        )
    };
    bench.write("p.src", krl(" C_DIS"));
    let ran = bench.run("compensate p.src --cell cell.toml -o out.src --max-path-error 0.05").exits(0);
    assert_eq!(bench.read("out.src"), krl(""), "{}", ran.stderr);
    let ur = |blend: &str| {
        format!(
            "def p():\n  set_tcp(p[0, 0, 0.1, 0, 0, 0])\n  movel(p[1.1, 0, 0.9, 0, 3.14159, 0], v=0.05)\n  \
             movel(p[1.2, 0, 0.9, 0, 3.14159, 0], v=0.05, {blend})\n  movel(p[1.2, 0.1, 0.9, 0, 3.14159, 0], v=0.05)\nend\n"
        )
    };
    bench.write("p.script", ur("r=0.002"));
    let ran = bench.run("compensate p.script --cell cell.toml -o out.script --max-path-error 0.05").exits(0);
    assert_eq!(bench.read("out.script"), ur("r=0"), "{}", ran.stderr);
    let jbi = |corner: &str| {
        format!(
            "/JOB\n//NAME P\n//POS\n///NPOS 3,0,0,0,0,0\n///TOOL 0\n///POSTYPE ROBOT\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n\
             C00000=1100.000,0.000,900.000,180.0000,0.0000,0.0000\nC00001=1200.000,0.000,900.000,180.0000,0.0000,0.0000\n\
             C00002=1200.000,100.000,900.000,180.0000,0.0000,0.0000\n//INST\n///DATE 2026/11/26 10:00\n///ATTR SC,RW\n///GROUP1 RB1\n\
             NOP\nMOVL C00000 V=50.0 PL=0\nMOVL C00001 V=50.0 {corner}\nMOVL C00002 V=50.0 PL=0\nEND\n"
        )
    };
    bench.write(
        "jbi.toml",
        format!("{CELL}{LAW}zone_mm = 2.0\n[tools.\"TOOL 0\"]\ntcp_mm = [0, 0, 100]\ntcp_quat = [1, 0, 0, 0]\n"),
    );
    for corner in ["PL=3", "CR=2.0"] {
        bench.write("p.jbi", jbi(corner));
        let ran = bench.run("compensate p.jbi --cell jbi.toml -o out.jbi --max-path-error 0.05").exits(0);
        assert_eq!(bench.read("out.jbi"), jbi("PL=0"), "{}", ran.stderr);
    }
}

#[test]
fn targets_are_inserted_where_the_text_gives_no_smaller_zone() {
    let bench = Bench::new();
    bench.write("cell.toml", format!("{CELL}{LAW}"));
    let krl = "DEF p()\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}\n$VEL.CP=0.05\n$APO.CDIS=2\n\
               LIN {X 1100,Y 0,Z 900,A 0,B 180,C 0}\nLIN {X 1200,Y 0,Z 900,A 0,B 180,C 0} C_DIS\n\
               LIN {X 1200,Y 100,Z 900,A 0,B 180,C 0}\nEND\n";
    let ur = "def p():\n  set_tcp(p[0, 0, 0.1, 0, 0, 0])\n  movel(p[1.1, 0, 0.9, 0, 3.14159, 0], v=0.05)\n  \
              movel(p[1.2, 0, 0.9, 0, 3.14159, 0], v=0.05, r=0.002)\n  movel(p[1.2, 0.1, 0.9, 0, 3.14159, 0], v=0.05, r=0.002)\n  \
              movel(p[1.2, 0.2, 0.9, 0, 3.14159, 0], v=0.05)\nend\n";
    for (name, text) in [("p.src", krl), ("p.script", ur)] {
        bench.write(name, text);
        let run = |tolerance: &str| {
            let arguments = "--cell cell.toml --subdivide 0.05 --json out.json";
            let ran = bench.run(&format!("compensate {name} {arguments} -o out_{name} --max-path-error {tolerance}"));
            let json: Value = serde_json::from_str(&bench.read("out.json")).unwrap();
            (ran.exits(0).stderr, json["files"][0].clone())
        };
        let (said, json) = run("0.2");
        assert!(json["inserted"].as_u64() > Some(0) && !said.contains("comes to rest"), "{said}");
        assert!(json["driven_path"]["programmed"]["max_mm"].as_f64() > Some(0.5), "{json}");
        // The text is read again, and its path is judged from what was read.
        let path = bench.run(&format!("predict out_{name} --cell cell.toml --path - -q")).exits(0).stdout;
        assert!(from_corner(&path) < 0.2, "{name}: {}", from_corner(&path));
        bench.run(&format!("check out_{name} --cell cell.toml --against {name} --max-error 0.2")).exits(0);
    }
}

#[test]
fn inserted_targets_leave_each_force_at_its_own_target() {
    let bench = Bench::new();
    let cell = CELL.replace("\"none\"", "\"table\"\nframe = \"wobj\"");
    let stiffness = "[robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n";
    bench.write("cell.toml", format!("{cell}{stiffness}{LAW}"));
    bench.write("p.mod", program("v50", "z1"));
    bench.write("forces.csv", "target,fx_n,fy_n,fz_n\n1,100,0,0\n2,100,0,0\n3,0,-150,-80\n");
    let run = "compensate p.mod --cell cell.toml --forces forces.csv -o out.mod --json out.json --subdivide 0.05";
    bench.run(&format!("{run} --max-path-error 0.1")).exits(0);
    let json: Value = serde_json::from_str(&bench.read("out.json")).unwrap();
    assert!(json["files"][0]["inserted"].as_u64() > Some(0), "{json}");
    let report = bench.read("out.report.csv");
    let mut rows = csv::Reader::from_reader(report.as_bytes());
    let head = rows.headers().unwrap().clone();
    let at = |name: &str| head.iter().position(|column| column == name).unwrap();
    let force = |row: &csv::StringRecord| ["fx_n", "fy_n", "fz_n"].map(|name| row[at(name)].parse::<f64>().unwrap());
    let forces: Vec<[f64; 3]> = rows.records().map(|row| force(&row.unwrap())).collect();
    assert_eq!(forces, [[100.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, -150.0, -80.0]], "{report}");
    // The corrected program is judged under the same forces.
    let largest = json["files"][0]["driven_path"]["corrected"]["max_mm"].as_f64().unwrap();
    let judge = "predict out.mod --against p.mod --cell cell.toml --forces forces.csv --report r.csv --json r.json";
    bench.run(judge).exits(0);
    let judged: Value = serde_json::from_str(&bench.read("r.json")).unwrap();
    let judged = judged["files"][0]["driven_path"]["programmed"]["max_mm"].as_f64().unwrap();
    // Where the force changes depends on which of the targets near the corner counts as the corner.
    assert!((judged - largest).abs() < 0.05, "{judged} and {largest} mm");
}

#[test]
fn a_plunge_is_not_led_aside() {
    let bench = Bench::new();
    let cut = "[cut]\nforce = \"mechanistic\"\nmax_cutting_feed_mm_s = 100.0\n[cut.cutter]\ndiameter_mm = 20.0\ncorner_radius_mm = 2.0\nteeth = 3\nhelix_deg = 30.0\n\
               [cut.engagement]\nmode = \"slot\"\ndepth_mm = 2.0\nwidth_mm = 20.0\nfeed_per_tooth_mm = 0.05\nlead_deg = 0.0\ntilt_deg = 0.0\n\
               [cut.coefficients]\nmaterial = \"al7075\"\n";
    let stiffness = "[robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n";
    bench.write("cell.toml", format!("[robot]\nmodel = \"irb6660-205-1.9\"\n{cut}{stiffness}{LAW}"));
    let to = |x: f64, z: f64, zone: &str| {
        format!("    MoveL [[{x:.1},0,{z:.1}],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,{zone},tMill;\n")
    };
    let tool = "  PERS tooldata tMill:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n";
    let moves = to(1200.0, 930.0, "fine") + &to(1200.0, 900.0, "z1") + &to(1300.0, 900.0, "fine");
    bench.write("p.mod", format!("MODULE m\n{tool}  PROC main()\n{moves}  ENDPROC\nENDMODULE\n"));
    bench.run("compensate p.mod --cell cell.toml -o out.mod --max-path-error 0.1 --subdivide 0.05").exits(0);
    let report = bench.read("out.report.csv");
    // Nothing declares the force of a plunge, and moved points do not make a cut of it.
    let plunge: Vec<&str> = report.lines().nth(2).unwrap().split(',').collect();
    assert_eq!(plunge[3], "air", "{report}");
    let path = bench.run("predict out.mod --against p.mod --cell cell.toml --path - -q").exits(0).stdout;
    let aside = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        if cells[4] > 900.5 { (cells[2] - 1200.0).hypot(cells[3]) } else { 0.0 }
    };
    let most = path.lines().skip(1).map(aside).fold(0.0, f64::max);
    assert!(most < 0.2, "{most} mm off the line of the plunge");
}

#[test]
fn reports_and_check_follow_the_driven_path() {
    let bench = Bench::new();
    bench.write("as-written.toml", CELL);
    bench.write("cell.toml", format!("{CELL}{LAW}"));
    bench.write("p.mod", program("v50", "z1"));
    // What the report says is left on the way to each target, mm.
    let left = |cell: &str| -> Vec<f64> {
        bench.run(&format!("predict p.mod --cell {cell} --report r.csv --json r.json -q")).exits(0);
        let report = bench.read("r.csv");
        let mut lines = report.lines();
        let at = lines.next().unwrap().split(',').position(|name| name == "remaining_path_mm").unwrap();
        lines.map(|line| line.split(',').nth(at).unwrap().parse().unwrap_or(0.0)).collect()
    };
    assert!(left("as-written.toml").iter().all(|mm| *mm < 1e-3));
    let driven = left("cell.toml");
    // The corner is the end of the second way; the third begins with it and is left by less, which has no corner of its own.
    assert!(driven[1] > 0.5 && driven[2] > 0.3 && driven[2] < driven[1], "{driven:?}");
    let json: Value = serde_json::from_str(&bench.read("r.json")).unwrap();
    let path = &json["files"][0]["driven_path"]["programmed"];
    assert!((path["max_mm"].as_f64().unwrap() - driven[1]).abs() < 1e-3, "{json}");
    // 200 mm at 50 mm/s, and the time to settle.
    assert!((4.0..4.4).contains(&path["run_time_s"].as_f64().unwrap()), "{json}");

    let check =
        |arguments: &str, code: i32| bench.run(&format!("check {arguments} --max-error 0.05")).exits(code).stdout;
    check("p.mod --cell as-written.toml", 0);
    assert!(check("p.mod --cell cell.toml", 1).contains("paths between targets"));
    bench.run("compensate p.mod --cell cell.toml --max-path-error 0.05 -o out.mod -q").exits(0);
    check("out.mod --against p.mod --cell cell.toml", 0);
}

/// An arc of CL data is made of lines: what the controller leaves on them belongs to the row of the arc, and the corner after it to its
/// own row. Without an arc, the rows are the same.
#[test]
fn an_arc_that_is_made_of_lines_has_one_row() {
    let bench = Bench::new();
    let cl = "[cl]\ntool = \"tMill\"\nwobj = \"wPart\"\nspin = \"fixed\"\n[tools.tMill]\ntcp_mm = [0, 0, 310]\ntcp_quat = [1, 0, 0, 0]\n\
              [wobjs.wPart]\nuframe_mm = [1000, -400, 700]\nuframe_quat = [1, 0, 0, 0]\n";
    bench.write("cell.toml", format!("{CELL}{LAW}zone_mm = 5.0\n{cl}"));
    let end = "GOTO/150,150,50\nGOTO/150,200,50\nGOTO/250,200,50\nGOTO/350,200,50\nGOTO/450,200,50\nFINI\n";
    let program = |arc: &str| format!("UNITS/MM\nFEDRAT/3000,MMPM\nGOTO/100,100,50,0,0,1\n{arc}{end}");
    bench.write("arc.apt", program("CIRCLE/100,150,50,0,0,1,50\n"));
    bench.write("line.apt", program(""));
    let left = |file: &str| -> Vec<f64> {
        bench.run(&format!("predict {file} --cell cell.toml --report r.csv -q")).exits(0);
        let report = bench.read("r.csv");
        let mut lines = report.lines();
        let at = lines.next().unwrap().split(',').position(|name| name == "remaining_path_mm").unwrap();
        lines.map(|line| line.split(',').nth(at).unwrap().parse().unwrap_or(0.0)).collect()
    };
    let (arc, line) = (left("arc.apt"), left("line.apt"));
    assert_eq!((arc.len(), line.len()), (6, 6));
    // A corner of 90 degrees ends the third motion. The last two go on in its line.
    assert!(arc[1] < 0.05 && arc[2] > 0.5 && arc[3] > 0.5 && arc[4] < 0.01 && arc[5] < 0.01, "{arc:?}");
    assert!([2, 4, 5].into_iter().all(|row| (arc[row] - line[row]).abs() < 0.02), "{arc:?} {line:?}");
}

/// Programs of most makers begin with a joint motion at a share of the axis speeds, which is no speed of the TCP.
#[test]
fn a_program_that_begins_with_a_joint_motion_is_followed() {
    let bench = Bench::new();
    let text = "UNITS/MM\nFEDRAT/3000,MMPM\nGOTO/100,100,50,0,0,1\nGOTO/150,100,50\nGOTO/150,200,50\nFINI\n";
    bench.write("p.apt", text);
    let names = [
        ("rapid", "mod", "tMill", "wPart"),
        ("krl", "src", "tMill", "wPart"),
        ("ls", "ls", "UT 1", "UF 1"),
        ("ur", "script", "tMill", "wPart"),
        ("jbi", "jbi", "TOOL 1", "USER 1"),
    ];
    for (post, ending, tool, wobj) in names {
        let cl = format!(
            "[cl]\ntool = \"{tool}\"\nwobj = \"{wobj}\"\nspin = \"fixed\"\n[tools.\"{tool}\"]\ntcp_mm = [0, 0, 310]\n\
             tcp_quat = [1, 0, 0, 0]\n[wobjs.\"{wobj}\"]\nuframe_mm = [1000, -400, 700]\nuframe_quat = [1, 0, 0, 0]\n"
        );
        bench.write("as-written.toml", format!("{CELL}{cl}"));
        bench.write("cell.toml", format!("{CELL}{LAW}zone_mm = 0.3\n{cl}"));
        bench.run(&format!("compensate p.apt --cell as-written.toml --post {post} -o p.{ending} -q")).exits(0);
        let ran = bench.run(&format!("predict p.{ending} --cell cell.toml --report r.csv --json r.json")).exits(0);
        let json: Value = serde_json::from_str(&bench.read("r.json")).unwrap();
        let time = json["files"][0]["driven_path"]["programmed"]["run_time_s"].as_f64();
        // 150 mm at 50 mm/s, and a stop at the corner.
        assert!(time.is_some_and(|time| (3.0..3.6).contains(&time)), "{post}: {time:?}\n{}", ran.stderr);
    }
}

/// CL data do not state the speed of rapid travel: the predicted run time takes that of posted programs.
#[test]
fn rapid_travel_takes_the_speed_of_posted_programs() {
    let bench = Bench::new();
    let cl = "[cl]\ntool = \"tMill\"\nwobj = \"wPart\"\nspin = \"fixed\"\n[tools.tMill]\ntcp_mm = [0, 0, 310]\ntcp_quat = [1, 0, 0, 0]\n\
              [wobjs.wPart]\nuframe_mm = [1000, -400, 700]\nuframe_quat = [1, 0, 0, 0]\n";
    bench.write("cell.toml", format!("{CELL}{LAW}zone_mm = 0.3\n{cl}"));
    let text = "UNITS/MM\nFEDRAT/300,MMPM\nGOTO/100,100,50,0,0,1\nGOTO/110,100,50\nRAPID\nGOTO/310,100,50\nGOTO/320,100,50\nFINI\n";
    bench.write("p.apt", text);
    bench.run("predict p.apt --cell cell.toml --report r.csv --json r.json -q").exits(0);
    let json: Value = serde_json::from_str(&bench.read("r.json")).unwrap();
    let time = json["files"][0]["driven_path"]["programmed"]["run_time_s"].as_f64().unwrap();
    // 20 mm at 5 mm/s, and 200 mm at 200 mm/s.
    assert!((4.9..5.5).contains(&time), "{time}");
}

/// A corner that the controller rounds is in the figures of the simulated part, and without a law that is said.
#[test]
fn a_simulated_part_has_the_corners_that_the_controller_rounds() {
    let bench = Bench::new();
    let cut = "[cut]\nforce = \"mechanistic\"\n[cut.cutter]\ndiameter_mm = 10.0\ncorner_radius_mm = 0.0\nteeth = 2\n\
               [cut.coefficients]\nmaterial = \"al7075\"\n[cut.engagement]\nmode = \"slot\"\ndepth_mm = 2.0\nlead_deg = 0.0\ntilt_deg = 0.0\nfeed_per_tooth_mm = 0.1\n\
               [stock]\nbox_mm = [[1110, -20, 880], [1230, 90, 902]]\nresolution_mm = 1.0\n";
    let cell = CELL.replace("[cut]\nforce = \"none\"\n", cut);
    bench.write("as-written.toml", &cell);
    bench.write("cell.toml", format!("{cell}{LAW}"));
    bench.write("p.mod", program("v50", "z1"));
    bench.write("none.csv", "target,fx_n,fy_n,fz_n\n1,0,0,0\n");
    let simulated = |cell: &str| {
        let ran = bench.run(&format!("simulate p.mod --cell {cell} --forces none.csv --json s.json")).exits(0);
        let json: Value = serde_json::from_str(&bench.read("s.json")).unwrap();
        (json["files"][0]["leftover"]["max_mm"].as_f64().unwrap(), ran.stderr)
    };
    let (written, said) = simulated("as-written.toml");
    assert!(written < 0.02, "{written}");
    // A parabola over a zone of 1 mm at a right angle: √2 / 4 mm.
    assert!(said.contains("path.assumed") && said.contains("up to 0.35 mm"), "{said}");
    let (driven, said) = simulated("cell.toml");
    // The path misses the corner by what `predict --path` says; so much is left on the wall outside it.
    let missed =
        from_corner(&bench.run("predict p.mod --cell cell.toml --forces none.csv --path - -q").exits(0).stdout);
    assert!(missed > 0.5 && (driven - missed).abs() < 0.15 * missed, "{driven} for {missed} mm");
    assert!(!said.contains("path.assumed"), "{said}");
}

/// With --max-path-error the corner of the text lies outside the part, and the cutter still meets what it meets at the programmed corner.
#[test]
fn moved_corners_have_the_forces_of_the_programmed_path() {
    let bench = Bench::new();
    // The box ends 3 mm after the corner: a point that is moved out meets less of it.
    let cut = "[robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n[cut]\nforce = \"mechanistic\"\n\
               [cut.cutter]\ndiameter_mm = 10.0\ncorner_radius_mm = 0.0\nteeth = 2\n[cut.coefficients]\nmaterial = \"al7075\"\n\
               [cut.engagement]\nmode = \"stock\"\nfeed_per_tooth_mm = 0.1\n\
               [stock]\nbox_mm = [[1110, -20, 880], [1203, 90, 902]]\nresolution_mm = 0.5\n";
    let cell = CELL.replace("[cut]\nforce = \"none\"\n", cut);
    bench.write("cell.toml", format!("{cell}{LAW}"));
    bench.write("p.mod", program("v50", "z1"));
    let forces = |arguments: &str| {
        bench.run(&format!("compensate p.mod --cell cell.toml -o out.mod --report r.csv -q {arguments}")).exits(0);
        let report = bench.read("r.csv");
        let mut lines = report.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let column = |name: &str| head.iter().position(|column| column == name).unwrap();
        let columns = ["fx_n", "fy_n", "fz_n", "depth_mm", "engaged_deg"].map(column);
        let rows: Vec<Vec<String>> = lines.map(|line| columns.map(|column| line[column].clone()).to_vec()).collect();
        (rows, bench.read("out.mod"))
    };
    let (straight, written) = forces("");
    let (moved, shaped) = forces("--max-path-error 0.05 --subdivide 0.05");
    assert_ne!(written, shaped);
    assert!(straight[1][1].parse::<f64>().unwrap() > 10.0, "{straight:?}");
    assert_eq!(moved, straight);
}

/// `$APO.CDIS` is the zone of a KRL corner; a parabola over all of it passes the corner r √2 / 4 away. What the cell does not say of the
/// law is said.
#[test]
fn a_krl_corner_is_rounded_by_the_distance_that_the_program_sets() {
    let bench = Bench::new();
    bench.write("cell.toml", format!("{CELL}[controller.path]\nzone_share = 1.0\n"));
    let krl = |before: &str, word: &str| {
        format!(
            "DEF p()\n$BASE={{X 0,Y 0,Z 0,A 0,B 0,C 0}}\n$TOOL={{X 0,Y 0,Z 100,A 0,B 0,C 0}}\n$VEL.CP=0.05\n{before}\
             LIN {{X 1100,Y 0,Z 900,A 0,B 180,C 0}}\nLIN {{X 1200,Y 0,Z 900,A 0,B 180,C 0}}{word}\n\
             LIN {{X 1200,Y 100,Z 900,A 0,B 180,C 0}}\nEND\n"
        )
    };
    let missed = |text: String| {
        bench.write("p.src", text);
        let ran = bench.run("predict p.src --cell cell.toml --path p.csv --report r.csv").exits(0);
        (from_corner(&bench.read("p.csv")), ran.stderr)
    };
    let (away, said) = missed(krl("$APO.CDIS=5\n", " C_DIS"));
    assert!((away - 5.0 * 2.0_f64.sqrt() / 4.0).abs() < 0.01, "{away}");
    assert!(said.contains("does not state smoothing_s, acceleration_mm_s2, corner_acceleration_mm_s2"), "{said}");
    // Half of the shorter way is the most.
    let (away, _) = missed(krl("$APO.CDIS=200\n", " C_DIS"));
    assert!((away - 50.0 * 2.0_f64.sqrt() / 4.0).abs() < 0.05, "{away}");
    // The other words have criteria of their own, and without a word the arm stops.
    for (before, word, unstated) in
        [("$APO.CDIS=5\n", " C_VEL", true), ("", " C_DIS", true), ("$APO.CDIS=5\n", "", false)]
    {
        let (away, said) = missed(krl(before, word));
        assert!(away < 0.15 && said.contains("1 point of the path is passed") == unstated, "{word}: {away}\n{said}");
    }
}

/// Along y from rest at 1.2 m from axis 1: two means of 58 ms make of a step to 0.1 m/s an acceleration that rises to v/w = 1.72 m/s²,
/// 82 °/s² of axis 1, for a moment, and is 2 % less over 4 ms.
#[test]
fn an_axis_that_would_have_to_accelerate_too_much_is_named() {
    let bench = Bench::new();
    bench.write("p.mod", program("v100", "fine"));
    let stderr_with = |limit: f64| {
        let limits = format!("axis_acceleration_deg_s2 = [{limit:.1}, 1e9, 1e9, 1e9, 1e9, 1e9]\n");
        let law = LAW.replace("acceleration_mm_s2 = 8000.0\n", "");
        bench.write("cell.toml", format!("{CELL}{law}{limits}"));
        bench.run("predict p.mod --cell cell.toml --path p.csv --report r.csv").exits(0).stderr
    };
    let stderr = stderr_with(50.0);
    let figure = stderr.split("axis 1 would have to accelerate by ").nth(1).unwrap_or_else(|| panic!("{stderr}"));
    let figure: f64 = figure.split(' ').next().unwrap().parse().unwrap();
    assert!((79.0..82.5).contains(&figure), "{stderr}");
    assert!(
        stderr.contains("path.axis-acceleration") && stderr.contains("1 of 2 paths") && stderr.contains("p.mod:6"),
        "{stderr}"
    );
    assert!(!stderr_with(90.0).contains("path.axis-acceleration"));
}

/// A controller cannot round into a motion that it does not know yet.
#[test]
fn a_corner_before_a_statement_that_waits_is_a_stop() {
    let bench = Bench::new();
    bench.write("cell.toml", format!("{CELL}{LAW}"));
    let text = program("v50", "z10");
    let corner = text.lines().find(|line| line.contains("z10")).unwrap();
    let predicted = |between: &str| {
        bench.write("p.mod", text.replace(corner, &format!("{corner}\n{between}")));
        let ran = bench.run("predict p.mod --cell cell.toml --path p.csv --report r.csv").exits(0);
        (from_corner(&bench.read("p.csv")), ran.stderr)
    };
    let (missed, said) = predicted("    WaitTime 0.5;\n");
    assert!(missed < 0.05 && said.contains("path.corner-failure") && said.contains("(WAITTIME)"), "{missed}\n{said}");
    // A comment does not wait, nor a statement that may not be run.
    for between in ["", "    ! WaitTime 0.5;\n", "    IF reg1 = 1 THEN\n      WaitTime 0.5;\n    ENDIF\n"] {
        let (missed, said) = predicted(between);
        assert!(missed > 2.0 && !said.contains("path.corner-failure"), "{between}: {missed}\n{said}");
    }
}

/// What `init` says of a maker's path is a law that the cell takes, and the page of the driven path has its source.
#[test]
fn init_prints_what_is_known_of_the_path_of_each_maker() {
    let bench = Bench::new();
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/driven-path.md")).unwrap();
    let makers = [
        ("irb6660-205-1.9", "github.com/hehonglu123/ABB_Primitive_Study", "acceleration_mm_s2 = 8000.0"),
        ("kr210-r2700-2", "KUKA System Software", "zone_mm"),
        ("m-20ia", "CNT", "zone_mm"),
        ("ur10e", "URScript Manual", "acceleration_mm_s2 = 1200.0"),
        ("gp25", "S1CxG33", "zone_mm"),
    ];
    for (model, source, key) in makers {
        let cell = bench.run(&format!("init --robot {model}")).exits(0).stdout;
        assert!(cell.contains(source) && page.contains(source), "{model}: {source}\n{cell}");
        let keys = cell.split_once("# [controller.path]\n").unwrap().1;
        let keys: Vec<&str> = keys.lines().map_while(|line| line.strip_prefix("# ")).collect();
        let path = format!("{CELL}[controller.path]\n{}\n", keys.join("\n"));
        assert!(path.contains(key) && path.contains("axis_acceleration_deg_s2"), "{model}: {path}");
        let read =
            Cell::read(&Source::new("cell.toml", path.clone())).unwrap_or_else(|error| panic!("{path}{error:?}"));
        assert!(read.controller.path.unwrap().law.zone_share > 0.5);
    }
}

/// The end of a motion that does not count has no path to keep: only the limits of the cell would hold it.
#[test]
fn the_approach_stays_and_the_limits_hold_for_the_whole_correction() {
    let bench = Bench::new();
    let cut = CELL.replace(
        "force = \"none\"",
        "force = \"constant\"\nforce_n = [0, 0, 0.001]\nframe = \"wobj\"\nmax_cutting_feed_mm_s = 60",
    );
    let cell = format!("{cut}[robot.stiffness]\njoint_nm_per_rad = [1e6, 1e6, 1e6, 1e6, 1e6, 1e6]\n{LAW}");
    bench.write("cell.toml", &cell);
    let text = program("v50", "z1");
    let approach = "    MoveJ [[1100.0,-15.0,930],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,z0,tMill;\n";
    let approached = text.replacen("    MoveL", &format!("{approach}    MoveL"), 1);
    bench.write("p.mod", &approached);
    bench.run("compensate p.mod --cell cell.toml -o out.mod --max-path-error 0.05 --subdivide 0.05").exits(0);
    assert!(bench.read("out.mod").contains("MoveJ [[1100.0,-15.0,930]"), "{}", bench.read("out.mod"));
    // The corner is moved by more than this.
    bench.write("narrow.toml", format!("[limits]\nmax_correction_mm = 0.02\n{cell}"));
    let refused = bench
        .run("compensate p.mod --cell narrow.toml -o none.mod --max-path-error 0.2 --subdivide 0.2")
        .exits(2)
        .stderr;
    assert!(refused.contains("limits.max-correction"), "{refused}");
}

/// 50 mm at 10 mm/s with 8 m/s² from rest to rest: 50 / 10 + 0.01 / 8 s, also if the line is one of 2 mm.
#[test]
fn a_motion_accelerates_as_the_law_says_however_long_its_line_is() {
    let bench = Bench::new();
    bench.write("cell.toml", format!("{CELL}[controller.path]\nzone_share = 1.0\nacceleration_mm_s2 = 8000.0\n"));
    let text =
        program("v10", "fine").replace("1200.0,100.0,900", "1200.0,50.0,900").replace("1100.0,0.0", "1150.0,0.0");
    bench.write("p.mod", text);
    bench.run("predict p.mod --cell cell.toml --json out.json --report out.csv").exits(0);
    let json: Value = serde_json::from_str(&bench.read("out.json")).unwrap();
    let seconds = json["files"][0]["driven_path"]["programmed"]["run_time_s"].as_f64().unwrap();
    assert!((seconds - 2.0 * (5.0 + 0.01 / 8.0)).abs() < 0.01, "{seconds}");
}

/// An override of the speed is no law of the controller.
#[test]
fn a_log_that_is_slower_than_any_law_allows_is_refused() {
    let bench = Bench::new();
    bench.write("cell.toml", CELL);
    let text = program("v50", "z1");
    bench.write("p.mod", &text);
    let quick = log(&text, &PathLaw::TYPICAL);
    let slow = quick.lines().map(|line| match line.split_once(',') {
        Some((time, rest)) if !time.starts_with('t') => format!("{:.3},{rest}\n", 2.0 * time.parse::<f64>().unwrap()),
        _ => format!("{line}\n"),
    });
    let slow: String = slow.collect();
    bench.write("l.csv", &slow);
    bench.write("m.csv", slow.replace("\n0.000,", "\n0.001,"));
    let refused = bench.run("identify --cell cell.toml --log p.mod l.csv --log p.mod m.csv").exits(2).stderr;
    assert!(
        refused.contains("drives at 50 % of the speed") && refused.contains("speed override at 100 %"),
        "{refused}"
    );
}
