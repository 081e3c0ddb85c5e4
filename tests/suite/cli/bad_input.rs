//! A table of bad inputs: a clear message with file, line and column, exit 2, nothing written.

use super::bench::{Bench, CELL, CL, PROGRAM};

/// What is wrong; the file it is in; its text; what the message must say.
type Case = (&'static str, &'static str, String, &'static [&'static str]);

fn cases() -> Vec<Case> {
    let program = |from: &str, to: &str| {
        assert!(PROGRAM.contains(from), "{from}");
        PROGRAM.replacen(from, to, 1)
    };
    let cell = |from: &str, to: &str| {
        assert!(CELL.contains(from), "{from}");
        CELL.replacen(from, to, 1)
    };
    let cl = |from: &str, to: &str| {
        assert!(CL.contains(from), "{from}");
        CL.replacen(from, to, 1)
    };
    vec![
        ("truncated in a target", "part.mod", PROGRAM[..440].to_owned(), &["part.mod:7:", "ENDMODULE"]),
        (
            "truncated between lines",
            "part.mod",
            PROGRAM[..PROGRAM.find("    MoveL [[50").unwrap_or(0)].to_owned(),
            &["part.mod:", "ENDMODULE"],
        ),
        ("empty", "part.mod", String::new(), &["part.mod:1:1", "empty"]),
        ("encrypted", "part.mod", "\u{1}\u{2}\u{fffd}\u{fffd}\u{3}garbage".to_owned(), &["part.mod:1:1", "encrypted"]),
        (
            "encrypted in a module's frame",
            "part.mod",
            "MODULE Part(NOVIEW)\n\u{1c}\u{2}\u{fffd}\u{0}garbage\u{3}\nENDMODULE\n".to_owned(),
            &["part.mod:2:1", "encrypted"],
        ),
        ("not a program", "part.mod", "<html></html>".to_owned(), &["part.mod:1:1", "XML"]),
        ("no position: NaN", "part.mod", program("[[100,0,0]", "[[NaN,0,0]"), &["part.mod:8:5", "not a number"]),
        ("no position: -inf", "part.mod", program("[[100,0,0]", "[[0,-Inf,0]"), &["part.mod:8:5", "not a number"]),
        (
            "no position: too large",
            "part.mod",
            program("[[100,0,0]", "[[1E999,0,0]"),
            &["part.mod:8:5", "not a number"],
        ),
        ("no position: two points", "part.mod", program("[[100,0,0]", "[[1..5,0,0]"), &["part.mod:8:5", "aggregate"]),
        ("CL: NaN", "part.apt", cl("GOTO/100,0,0,", "GOTO/NaN,0,0,"), &["part.apt:7:1", "not given by numbers"]),
        (
            "CL: too large",
            "part.apt",
            cl("GOTO/100,0,0,", "GOTO/1E999,0,0,"),
            &["part.apt:7:1", "not given by numbers"],
        ),
        (
            "CL: two points",
            "part.apt",
            cl("GOTO/100,0,0,", "GOTO/1..5,0,0,"),
            &["part.apt:7:1", "not given by numbers"],
        ),
        ("CL: a name", "part.apt", cl("GOTO/100,0,0,0,0,1", "GOTO/P1"), &["part.apt:7:1", "APT-360"]),
        (
            "CL: a number too few",
            "part.apt",
            cl("GOTO/100,0,0,0,0,1", "GOTO/100,0"),
            &["part.apt:7:1", "three numbers"],
        ),
        (
            "CL: an axis of no length",
            "part.apt",
            cl("GOTO/100,0,0,0,0,1", "GOTO/1,0,0,0,0,0"),
            &["part.apt:7:1", "unit vector"],
        ),
        ("CL: shifted", "part.apt", cl("GOTO/100", "TRANS/1,2,3\nGOTO/100"), &["part.apt:7:1", "TRANS"]),
        ("CL: a curve", "part.apt", cl("GOTO/100", "NURBS/1,2,3\nGOTO/100"), &["part.apt:7:1", "NURBS"]),
        (
            "CL: cut off in an arc",
            "part.apt",
            format!("{CL}CIRCLE/0,0,0,0,0,1,50\n"),
            &["part.apt:9:1", "without an end"],
        ),
        ("CL: no unit", "part.apt", cl("UNITS/MM\n", ""), &["part.apt:3:1", "UNITS"]),
        (
            "unknown tool",
            "part.mod",
            program("v20,z1,tMill", "v20,z1,tMil"),
            &["part.mod:7:5", "`tMil`", "[tools.tMil]"],
        ),
        (
            "unknown work object",
            "part.mod",
            program("z1,tMill\\WObj:=wPart", "z1,tMill\\WObj:=wPrt"),
            &["part.mod:7:5", "`wPrt`"],
        ),
        ("unreachable", "part.mod", program("[[100,0,0]", "[[9000,0,0]"), &["part.mod:8:5", "target 4", "not reached"]),
        (
            "unknown key",
            "cell.toml",
            cell("joint_nm_per_rad", "joint_nm_per_rd"),
            &["cell.toml:5:1", "did you mean `joint_nm_per_rad`"],
        ),
        ("unknown section", "cell.toml", cell("[cut]", "[cuts]"), &["cell.toml:", "did you mean `cut`"]),
        (
            "unknown robot",
            "cell.toml",
            cell("irb6660-205-1.9", "irb6660-205-1.8"),
            &["cell.toml:2:9", "irb6660-205-1.9"],
        ),
        (
            "unknown word",
            "cell.toml",
            cell("\"constant\"", "\"constnt\""),
            &["cell.toml:24:9", "did you mean `constant`"],
        ),
        ("wrong unit", "cell.toml", cell("tcp_mm", "tcp_m"), &["cell.toml:11:1", "did you mean `tcp_mm`"]),
        ("wrong type", "cell.toml", cell("[0, 0, 310]", "\"310\""), &["cell.toml:11:10"]),
        ("too few", "cell.toml", cell("[0, 0, 310]", "[0, 0]"), &["cell.toml:11:10"]),
        (
            "not a number",
            "cell.toml",
            cell("[0, 0, 310]", "[0, nan, 310]"),
            &["cell.toml:11:10", "NaN, expected a finite number"],
        ),
        (
            "infinite stiffness",
            "cell.toml",
            cell("8.86e5", "inf"),
            &["cell.toml:5:20", "inf, expected a number above 0"],
        ),
        ("no unit quaternion", "cell.toml", cell("tcp_quat = [1,", "tcp_quat = [2,"), &["cell.toml:12:12", "norm"]),
        (
            "missing stiffness",
            "cell.toml",
            cell("[robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n", ""),
            &["[robot.stiffness]"],
        ),
        ("missing force", "cell.toml", cell("force_n = [120, -260, 410]\n", ""), &["cell.toml:", "force_n"]),
        ("no table", "cell.toml", cell("\"constant\"", "\"table\""), &["--forces"]),
        ("no cut", "cell.toml", CELL.split("[cut]").next().unwrap_or("").to_owned(), &["[cut]"]),
        (
            "contradiction: a name twice",
            "cell.toml",
            cell("[wobjs.wPart]", "[tools.TMILL]\ntcp_mm = [0,0,1]\ntcp_quat = [1,0,0,0]\n[wobjs.wPart]"),
            &["cell.toml:", "one name"],
        ),
        (
            "contradiction: start beyond a limit",
            "cell.toml",
            cell("[robot.stiffness]", "start_deg = [0, 200, 0, 0, 0, 0]\n[robot.stiffness]"),
            &["cell.toml:4:13", "start_deg", "beyond its limit"],
        ),
        (
            "a key twice",
            "cell.toml",
            cell("[robot.stiffness]", "model = \"x\"\n[robot.stiffness]"),
            &["cell.toml:4:1", "duplicate"],
        ),
        ("not TOML", "cell.toml", cell("[cut]", "[cut"), &["cell.toml:23:5"]),
        (
            "unknown effect",
            "cell.toml",
            format!("{CELL}[[effect]]\nkind = \"backlsh\"\nhalf_gap_rad = [0,0,0,0,0,0]\n"),
            &["cell.toml:28:8", "did you mean `backlash`"],
        ),
        (
            "unknown parameter",
            "cell.toml",
            format!("{CELL}[[effect]]\nkind = \"backlash\"\nhalf_gap = [0,0,0,0,0,0]\n"),
            &["cell.toml:27:1", "did you mean `half_gap_rad`"],
        ),
        (
            "negative gap",
            "cell.toml",
            format!("{CELL}[[effect]]\nkind = \"backlash\"\nhalf_gap_rad = [-1,0,0,0,0,0]\n"),
            &["cell.toml:27:1", "half_gap_rad[0]"],
        ),
        ("soft robot", "cell.toml", cell("8.86e5", "886"), &["part.mod:", "max_correction_mm"]),
    ]
}

#[test]
fn every_bad_input_is_reported_and_nothing_is_written() {
    let mut failed = Vec::new();
    for (what, file, text, must) in cases() {
        let bench = Bench::new();
        bench.write(file, text);
        let before = bench.names("");
        let input = if file.ends_with(".apt") { file } else { "part.mod" };
        let ran = bench.run(&format!("compensate {input} --cell cell.toml -o out.mod --report out.csv"));
        let is_reported = ran.stderr.contains("error") && must.iter().all(|part| ran.stderr.contains(part));
        let panicked = ran.stderr.contains("panicked");
        if ran.code != Some(2) || !ran.stdout.is_empty() || !is_reported || panicked || bench.names("") != before {
            failed.push(format!("== {what}: exit {:?}, must say {must:?}\n{}", ran.code, ran.stderr));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn what_a_cl_file_says_to_machine_tools_only_is_reported() {
    let bench = Bench::new();
    bench.write("part.apt", CL.replace("GOTO/100", "CYCLE/OFF\nFOOBAR/1\nFOOBAR/2\nGOTO/100"));
    let ran = bench.run("predict part.apt --cell cell.toml --tool tMill").exits(0);
    // A cycle in a form that is not read would drill elsewhere.
    bench.write("drill.apt", CL.replace("GOTO/100", "CYCLE/DRILL,5\nGOTO/100"));
    let refused = bench.run("predict drill.apt --cell cell.toml --tool tMill").exits(2).stderr;
    assert!(refused.contains("drill.apt:7:1") && refused.contains("drilling cycle"), "{refused}");
    assert!(
        ran.stderr.contains("unknown statement: deflex assumes that it moves nothing (2 statements)"),
        "{}",
        ran.stderr
    );
}

#[test]
fn many_faults_are_reported_in_one_run() {
    let bench = Bench::new();
    let text = CELL.replace("tcp_quat", "tcp_quad").replace("uframe_mm", "uframe").replace("spin =", "spinn =");
    bench.write("cell.toml", text);
    let ran = bench.run("predict part.mod --cell cell.toml").exits(2);
    assert!(ran.stderr.matches("did you mean").count() >= 1, "{}", ran.stderr);
    bench.write("cell.toml", CELL.replace("[1, 0, 0, 0]", "[1, 1, 0, 0]").replace("8.86e5", "-1"));
    let ran = bench.run("predict part.mod --cell cell.toml").exits(2);
    assert_eq!(ran.stderr.matches("error[").count(), 3, "{}", ran.stderr);
}

#[test]
fn a_missing_file_is_named() {
    let bench = Bench::new();
    let ran = bench.run("predict none.mod --cell none.toml").exits(2);
    assert!(ran.stderr.contains("none.mod") && ran.stderr.contains("none.toml"), "{}", ran.stderr);
}

#[test]
fn statements_that_cannot_be_read_are_reported_before_they_are_missed() {
    let bench = Bench::new();
    bench.write("part.mod", PROGRAM.replace("z1,tMill\\WObj:=wPart;", "z1,tMill\\WObj:=wPart"));
    for command in ["compensate part.mod --cell cell.toml -o out.mod", "predict part.mod --cell cell.toml"] {
        let said = bench.run(command).exits(0).stderr;
        assert!(said.contains("missing semicolon") && said.contains("part.mod:7:5"), "{said}");
        assert!(said.contains("4 targets: ") && said.contains("missing semicolon (1)"), "{said}");
    }
    let said = bench.run("check part.mod --cell cell.toml --max-error 1").exits(1).stderr;
    assert!(said.contains("missing semicolon"), "{said}");
}

#[test]
fn mistyped_names_get_the_nearest_declared_one() {
    let bench = Bench::new();
    for (from, to, near) in
        [("tool = \"tMill\"", "tool = \"tMil\"", "tMill"), ("wobj = \"wPart\"", "wobj = \"wPrat\"", "wPart")]
    {
        bench.write("cell.toml", CELL.replace(from, to));
        let said = bench.run("predict part.apt --cell cell.toml").exits(2).stderr;
        assert!(said.contains(&format!("did you mean `{near}`? add [")), "{said}");
    }
    bench.write("cell.toml", CELL);
    let said = bench.run("predict part.mod --cell cell.toml --tool mill").exits(2).stderr;
    assert!(said.contains("did you mean `tMill`? the cell declares tMill"), "{said}");
}

#[test]
fn files_in_each_others_place_are_recognised() {
    let bench = Bench::new();
    let said = |arguments: &str| bench.run(arguments).exits(2).stderr;
    let program = said("predict part.mod --cell part.mod");
    assert!(program.contains("this is a program, where the cell file is expected"), "{program}");
    assert!(said("predict cell.toml --cell cell.toml").contains("neither RAPID, CL/APT"));
    assert!(said("predict . --cell cell.toml").contains("of a folder of programs its files"));
    bench.write("forces.csv", "target;fx_n;fy_n;fz_n\n1;2,5;3.5;4\n");
    assert!(said("predict part.mod --cell cell.toml --forces forces.csv").contains("has a decimal point"));
    bench.write("forces.csv", "target,fx,fy,fz\n1,2,3,4\n");
    assert!(said("predict part.mod --cell cell.toml --forces forces.csv").contains("did you mean `fx_n`?"));
}

#[test]
fn options_without_an_effect_are_refused() {
    let bench = Bench::new();
    for (command, said) in [
        ("compensate part.mod --cell cell.toml -o out.mod --post krl", "--post is for CL data"),
        ("compensate part.mod --cell cell.toml -o out.mod --max-targets 5", "--max-targets is for CL data"),
        ("identify --run part.mod m.csv --cell cell.toml --tool tMill", "--tool tMill has no effect"),
    ] {
        bench.write("m.csv", "target,x_mm,y_mm,z_mm\n2,0,0,0\n");
        let refused = bench.run(command).exits(2).stderr;
        assert!(refused.contains(said), "{refused}");
    }
}

#[test]
fn a_table_in_utf_16_is_refused_with_its_name() {
    let bench = Bench::new();
    let text: Vec<u8> =
        "\u{feff}target,fx_n,fy_n,fz_n\r\n2,0,0,90\r\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    bench.write("f.csv", text);
    let refused = bench.run("predict part.mod --cell cell.toml --forces f.csv").exits(2).stderr;
    assert!(refused.contains("UTF-16") && refused.contains("save it as CSV, UTF-8"), "{refused}");
}
