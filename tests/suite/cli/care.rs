//! What a run takes care of for its user: a program corrected twice, one faulty program in a batch, tables that leave targets out.

use super::bench::{Bench, CELL, PROGRAM};

const RUN: &str = "compensate part.mod --cell cell.toml -o out.mod";

#[test]
fn a_corrected_program_is_not_corrected_again() {
    let bench = Bench::new();
    bench.run(RUN).exits(0);
    let said = bench.run("compensate out.mod --cell cell.toml -o more.mod").exits(2).stderr;
    assert!(said.contains("out.report.csv") && said.contains("--again"), "{said}");
    assert!(!bench.path("more.mod").exists());
    bench.run("compensate out.mod --cell cell.toml -o more.mod --again").exits(0);
    // The original in the folder of the report of its correction is corrected as usual.
    bench.run("compensate part.mod --cell cell.toml -o other.mod --report other.csv").exits(0);
    assert_eq!(bench.read("other.mod"), bench.read("out.mod"));
    // The report may have any name, and lines may end otherwise.
    std::fs::create_dir(bench.path("there")).unwrap();
    bench
        .write("there/x.mod", bench.read("other.mod").replace('\n', "\r\n"))
        .write("there/all.csv", bench.read("other.csv"));
    let said = bench.run("compensate there/x.mod --cell cell.toml").exits(2).stderr;
    assert!(said.contains("there/all.csv"), "{said}");
}

#[test]
fn a_posted_program_is_not_corrected_again() {
    let bench = Bench::new();
    bench.run("compensate part.apt --cell cell.toml -o posted.mod").exits(0);
    let said = bench.run("compensate posted.mod --cell cell.toml -o more.mod").exits(2).stderr;
    assert!(said.contains("--again"), "{said}");
    bench.run("compensate posted.mod --cell cell.toml -o more.mod --again").exits(0);
    bench.run("check posted.mod --cell cell.toml --max-error 1").exits(0);
}

#[test]
fn a_batch_goes_on_without_the_faulty_program() {
    let bench = Bench::new();
    bench.write("a.mod", PROGRAM).write("b.mod", PROGRAM.replace("MODULE Part", "MODULE B"));
    bench.write("far.mod", PROGRAM.replace("[[100,0,0]", "[[9000,0,0]")).write("none.mod", "nothing");
    let batch = "a.mod far.mod none.mod gone.mod b.mod --cell cell.toml";
    bench.run(&format!("compensate {batch} --out-dir out")).exits(2);
    assert!(!bench.path("out").exists());
    let said = bench.run(&format!("compensate {batch} --out-dir out --report all.csv --keep-going")).exits(2).stderr;
    assert!(["far.mod", "none.mod", "gone.mod"].iter().all(|name| said.contains(name)), "{said}");
    assert_eq!(bench.names("out"), ["a.mod", "a.report.csv", "b.mod", "b.report.csv"]);
    assert_eq!(bench.read("all.csv").lines().count(), 9);
    bench.run("compensate far.mod none.mod --cell cell.toml --out-dir more --keep-going").exits(2);
    assert!(!bench.path("more").exists());
    let ran = bench.run(&format!("predict {batch} --keep-going")).exits(2);
    assert_eq!(ran.stdout.lines().count(), 9);
    bench.run("compensate a.mod b.mod --cell cell.toml --out-dir out --keep-going").exits(0);
}

#[test]
fn forces_are_taken_from_any_table_that_has_them() {
    let bench = Bench::new();
    bench.run(&format!("{RUN} --report first.csv")).exits(0);
    // A report of ours says the forces that it was made with.
    bench.run("compensate part.mod --cell cell.toml --forces first.csv -o second.mod --report second.csv").exits(0);
    assert_eq!(bench.read("second.mod"), bench.read("out.mod"));
    bench.write(
        "log.csv",
        "Sample,target,fx_n,fy_n,fz_n,mx_nm\n1,2,120,-260,410,0\n2,3,120,-260,410,x\n3,4,120,-260,410,\n",
    );
    let ran = bench.run("compensate part.mod --cell cell.toml --forces log.csv -o third.mod").exits(0);
    assert_eq!(bench.read("third.mod"), bench.read("out.mod"));
    assert!(ran.stderr.contains("1 of 4 targets have no row") && ran.stderr.contains("line 5"), "{}", ran.stderr);
    for header in ["target,x_mm,y_mm,z_mm", "fx_n,fy_n,fz_n"] {
        bench.write(
            "none.csv",
            format!("{header}\n1,2,3,4\n").replace("3,4", if header.len() < 20 { "3" } else { "3,4" }),
        );
        let said = bench.run("predict part.mod --cell cell.toml --forces none.csv").exits(2).stderr;
        assert!(said.contains("expected a column `target`"), "{said}");
    }
}

#[test]
fn rows_twice_and_rows_of_no_target_are_errors() {
    let bench = Bench::new();
    for (rows, said) in [
        ("2,1,2,3\n3,1,2,3\n2,1,2,4\n", "forces.csv:4"),
        ("2,1,2,3\n,1,2,3\n", "name no target: line 3"),
        (
            "2,1,2,3\n2,1,2,3\n2,1,2,3\n3,1,2,3\n3,1,2,3\n",
            "3 rows are of targets that have one already, target 2 first: lines 3, 4, 6",
        ),
    ] {
        bench.write("forces.csv", format!("target,fx_n,fy_n,fz_n\n{rows}"));
        for command in ["predict part.mod", "compensate part.mod", "check part.mod --max-error 9"] {
            let ran = bench.run(&format!("{command} --cell cell.toml --forces forces.csv")).exits(2);
            assert!(ran.stderr.contains(said), "{}", ran.stderr);
        }
    }
}

#[test]
fn a_table_that_leaves_targets_out_is_reported() {
    let bench = Bench::new();
    bench.write("forces.csv", "target,fx_n,fy_n,fz_n\n3,120,-260,410\n");
    for command in ["predict part.mod", "compensate part.mod", "check part.mod --max-error 9"] {
        let said = bench.run(&format!("{command} --cell cell.toml --forces forces.csv")).exits(0).stderr;
        assert!(
            said.contains("warning") && said.contains("3 of 4 targets") && said.contains("lines 5, 6, 8"),
            "{said}"
        );
    }
    bench.write("forces.csv", "target,fx_n,fy_n,fz_n\n1,0,0,0\n2,0.12,-0.26,0.41\n3,0,0,0\n4,0,0,0\n");
    let said = bench.run("predict part.mod --cell cell.toml --forces forces.csv").exits(0).stderr;
    assert!(!said.contains("no row") && said.contains("it looks like kN"), "{said}");
}

#[test]
fn cl_data_are_not_posted_under_their_own_ending() {
    let bench = Bench::new();
    let said = bench.run("compensate part.apt --cell cell.toml -o out.cls").exits(2).stderr;
    assert!(said.contains("out.cls") && said.contains("out.mod"), "{said}");
    assert!(!bench.path("out.cls").exists());
}

#[test]
fn all_missing_keys_of_the_kinematics_are_named_at_once() {
    let bench = Bench::new();
    let rows = "{ alpha_deg = 0.0, d_mm = 1.0, theta_deg = 0.0 }, ".repeat(6);
    bench.write(
        "cell.toml",
        CELL.replace("[robot.stiffness]", &format!("[robot.kinematics]\nlinks = [{rows}]\n[robot.stiffness]")),
    );
    let said = bench.run("predict part.mod --cell cell.toml").exits(2).stderr;
    for key in ["axis_min_deg", "axis_max_deg", "`a_mm` of row 1", "`a_mm` of row 6"] {
        assert!(said.contains(key), "{key}: {said}");
    }
}

#[test]
fn values_in_another_unit_are_reported_with_what_is_usual() {
    let bench = Bench::new();
    let mechanistic = CELL.replace(
        "force = \"constant\"",
        "force = \"mechanistic\"\n[cut.cutter]\ndiameter_mm = 20.0\ncorner_radius_mm = 0.0\nteeth = 2\n[cut.engagement]\nmode = \"slot\"\n\
         depth_mm = 1.0\nfeed_per_tooth_mm = 0.1\nlead_deg = 0.0\ntilt_deg = 0.0\n[cut.coefficients]\nktc_n_mm2 = 1800.0\nkrc_n_mm2 = 900.0\n\
         kac_n_mm2 = 300.0\nkte_n_mm = 20.0\nkre_n_mm = 25.0\nkae_n_mm = 5.0\n#",
    );
    let mechanistic = mechanistic.split("\nforce_n").next().unwrap().to_owned();
    bench.write("cell.toml", &mechanistic);
    let said = bench.run("predict part.mod --cell cell.toml").exits(0).stderr;
    assert!(!said.contains("usually"), "{said}");
    let stiffness = "8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4";
    for (from, to, key, looks) in [
        (stiffness, "8.86e8, 5.5e8, 1.85e9, 3.3e8, 2.1e8, 8.81e7", "joint_nm_per_rad", "N·mm/rad"),
        (stiffness, "15460, 9600, 32300, 5760, 3670, 1540", "joint_nm_per_rad", "N·m/deg"),
        ("diameter_mm = 20.0", "diameter_mm = 0.02", "diameter_mm", "it looks like m"),
        ("ktc_n_mm2 = 1800.0", "ktc_n_mm2 = 1.8e9", "ktc_n_mm2", "N/m²"),
        ("tcp_quat = [1, 0, 0, 0]", "tcp_quat = [1, 0, 0, 0]\nmass_kg = 18000", "mass_kg", "it looks like g"),
        ("tcp_mm = [0, 0, 310]", "tcp_mm = [0, 0, 0.31]", "tcp_mm", "it looks like m"),
        ("uframe_mm = [1000, -400, 700]", "uframe_mm = [1.0, -0.4, 0.7]", "uframe_mm", "it looks like m"),
        ("feed_per_tooth_mm = 0.1", "width_mm = 25.0\nfeed_per_tooth_mm = 0.1", "width_mm", "wider than the cutter"),
        ("feed_per_tooth_mm = 0.1", "feed_per_tooth_mm = 100.0", "feed_per_tooth_mm", "it looks like µm"),
    ] {
        let cell = mechanistic.replace(from, to);
        assert_ne!(cell, mechanistic, "{from}");
        bench.write("cell.toml", cell);
        let said = bench.run("predict part.mod --cell cell.toml").stderr;
        assert!(said.contains(key) && said.contains(looks) && said.contains("cell.toml:"), "{key}: {said}");
    }
    bench.write("cell.toml", CELL.replace("[120, -260, 410]", "[0.12, -0.26, 0.41]"));
    let said = bench.run("predict part.mod --cell cell.toml").exits(0).stderr;
    assert!(said.contains("cut.force_n") && said.contains("it looks like kN"), "{said}");
}

#[test]
fn a_measured_number_beyond_any_robot_is_refused_by_its_line() {
    let bench = Bench::new();
    bench.write("m.csv", "target,x_mm,y_mm,z_mm\n1,0,0,100\n2,0,1e160,0\n3,50,0,0\n4,100,0,0\n");
    let said = bench.run("identify --run part.mod m.csv --cell cell.toml").exits(2).stderr;
    assert!(said.contains("m.csv:3") && said.contains("y_mm is 1e160"), "{said}");
}

#[test]
fn results_name_what_they_were_made_from() {
    let bench = Bench::new();
    let sum = |name: &str| {
        let output = std::process::Command::new("sha256sum").arg(bench.path(name)).output().unwrap();
        String::from_utf8(output.stdout).unwrap().split(' ').next().unwrap().to_owned()
    };
    let (cell, program) = (sum("cell.toml"), sum("part.mod"));
    bench.run(&format!("{RUN} --json c.json --html c.html")).exits(0);
    bench.run("predict part.mod --cell cell.toml --json p.json --html p.html").exits(0);
    bench.run("check part.mod --cell cell.toml --max-error 9 --json k.json --html k.html").exits(0);
    for name in ["c", "p", "k"] {
        let json: serde_json::Value = serde_json::from_str(&bench.read(&format!("{name}.json"))).unwrap();
        assert_eq!(json["deflex"], env!("CARGO_PKG_VERSION"), "{name}");
        assert_eq!(
            (&json["cell"]["path"], &json["cell"]["sha256"]),
            (&"cell.toml".into(), &cell.clone().into()),
            "{name}"
        );
        assert_eq!(json["files"][0]["sources"][0]["sha256"], program.clone(), "{name}");
        let page = bench.read(&format!("{name}.html"));
        assert!(page.contains(&cell) && page.contains(&program) && page.contains(env!("CARGO_PKG_VERSION")), "{name}");
    }
}

#[test]
fn an_unknown_mark_is_an_error_at_its_line() {
    let bench = Bench::new();
    bench.write("part.mod", PROGRAM.replacen("    MoveL", "    ! deflex ait\n    MoveL", 1));
    bench.write("part.apt", super::bench::CL.replace("GOTO/50", "PPRINT/DEFLEX SLOT\nGOTO/50"));
    for (file, place) in [("part.mod", "part.mod:6:5"), ("part.apt", "part.apt:6:1")] {
        for command in ["predict", "compensate", "check --max-error 9"] {
            let said = bench.run(&format!("{command} {file} --cell cell.toml")).exits(2).stderr;
            assert!(said.contains(place) && said.contains("unknown mark"), "{said}");
        }
    }
}

#[test]
fn an_orientation_that_no_controller_takes_is_a_fault() {
    let bench = Bench::new();
    let with = |quat: &str| PROGRAM.replacen("[[50,0,0],[0,1,0,0]", &format!("[[50,0,0],[{quat}]"), 1);
    for (quat, code) in
        [("0,1.0009,0,0", 0), ("0.001,0.999,0.001,0", 0), ("0,1.01,0,0", 2), ("0,0.99,0,0", 2), ("0,2,0,0", 2)]
    {
        bench.write("part.mod", with(quat));
        for command in ["predict", "compensate", "check --max-error 9"] {
            let ran = bench.run(&format!("{command} part.mod --cell cell.toml")).exits(code);
            assert_eq!(
                ran.stderr.contains("unit quaternion") && ran.stderr.contains("part.mod:7"),
                code == 2,
                "{}",
                ran.stderr
            );
        }
    }
}

#[test]
fn a_frame_that_cell_and_program_declare_differently_is_reported() {
    let bench = Bench::new();
    for command in ["predict part.mod", "compensate part.mod", "check part.mod --max-error 9"] {
        bench.write("cell.toml", CELL);
        let said = bench.run(&format!("{command} --cell cell.toml")).exits(0).stderr;
        assert!(!said.contains("the program's values are used"), "{said}");
        bench.write(
            "cell.toml",
            CELL.replace("[1000, -400, 700]", "[1000, -400, 700.2]").replace("[0, 0, 310]", "[0, 0, 312]"),
        );
        let said = bench.run(&format!("{command} --cell cell.toml")).exits(0).stderr;
        assert!(
            said.contains("[tools.tMill] of the cell is 2.000 mm")
                && said.contains("[wobjs.wPart] of the cell is 0.200 mm"),
            "{said}"
        );
    }
}
