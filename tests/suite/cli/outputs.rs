//! What is written, where, and that it is written whole or not at all.

use super::bench::{Bench, PROGRAM};

const RUN: &str = "compensate part.mod --cell cell.toml";

#[test]
fn stdout_carries_the_program_alone() {
    let bench = Bench::new();
    let ran = bench.run(RUN).exits(0);
    assert!(ran.stdout.starts_with("MODULE Part\n") && ran.stdout.ends_with("ENDMODULE\n"));
    assert!(ran.stderr.contains("4 targets: 3 corrected, 1 air"), "{}", ran.stderr);
    assert_eq!(bench.run(&format!("{RUN} -o -")).exits(0).stdout, ran.stdout);
    assert!(bench.run(&format!("{RUN} --quiet")).exits(0).stderr.is_empty());
    let piped = bench.run_with("compensate - --cell cell.toml", PROGRAM).exits(0);
    assert_eq!(piped.stdout, ran.stdout);
}

#[test]
fn report_and_summary_say_the_same() {
    let bench = Bench::new();
    bench.run(&format!("{RUN} -o out.mod --report out.csv --json out.json")).exits(0);
    let report = bench.read("out.csv");
    let header = report.lines().next().unwrap();
    insta::assert_snapshot!(header);
    let columns: Vec<&str> = header.split(',').collect();
    let at = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let rows: Vec<Vec<&str>> = report.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.iter().map(|row| row[at("status")]).collect::<Vec<_>>(), ["air", "ok", "ok", "ok"]);
    let worst = |name: &str| rows.iter().map(|row| row[at(name)].parse::<f64>().unwrap()).fold(0.0, f64::max);
    let json: serde_json::Value = serde_json::from_str(&bench.read("out.json")).unwrap();
    let sum = &json["files"][0];
    assert!((sum["max_error_mm"].as_f64().unwrap() - worst("error_mm")).abs() < 1e-6);
    assert!(worst("remaining_mm") < 1e-3);
    assert!(!report.contains("-0.0000,"));
}

#[test]
fn the_corrected_program_is_judged_against_the_original() {
    let bench = Bench::new();
    bench.run(&format!("{RUN} -o out.mod")).exits(0);
    bench.run("check part.mod --cell cell.toml --max-error 0.01").exits(1);
    bench.run("check out.mod --cell cell.toml --max-error 0.01").exits(1);
    bench.run("check out.mod --cell cell.toml --max-error 0.001 --against part.mod --at-targets").exits(0);
    // Between the targets the force sets in before its correction does.
    let ran = bench.run("check out.mod --cell cell.toml --max-error 0.001 --against part.mod").exits(1);
    assert!(ran.stdout.contains("[check.max-path-error]"), "{}", ran.stdout);
    bench.run("diff part.mod part.mod").exits(0);
    let ran = bench.run("diff part.mod out.mod").exits(1);
    assert!(
        ran.stdout.contains("3 of 4 targets changed") && ran.stdout.ends_with("  other differences           0\n"),
        "{}",
        ran.stdout
    );
}

#[test]
fn diff_names_what_is_no_target() {
    let bench = Bench::new();
    bench.write("speed.mod", PROGRAM.replacen("v20,z1", "v30,z5", 1));
    let ran = bench.run("diff part.mod speed.mod").exits(1);
    assert!(ran.stdout.contains("line 7: target 3: the speed is different"), "{}", ran.stdout);
    assert!(ran.stdout.contains("z5"), "{}", ran.stdout);
    bench.write("tool.mod", PROGRAM.replace("[18,[0,0,120]", "[18,[0,0,121]"));
    let ran = bench.run("diff part.mod tool.mod").exits(1);
    assert!(ran.stdout.contains("line 2: a number is different: 120 became 121"), "{}", ran.stdout);
    bench.write("flip.mod", PROGRAM.replace("[0,1,0,0]", "[0,-1,0,0]"));
    bench.run("diff part.mod flip.mod").exits(0);
}

#[test]
fn a_run_that_fails_leaves_everything_as_it_was() {
    let bench = Bench::new();
    let far = PROGRAM.replace("[[100,0,0]", "[[9000,0,0]");
    bench.write("far.mod", far).write("out.mod", "old").write("out.csv", "old");
    let before = bench.names("");
    bench.run("compensate far.mod --cell cell.toml -o out.mod --report out.csv --json out.json").exits(2);
    // The second of two fails: the first is not written either.
    bench.run("compensate part.mod far.mod --cell cell.toml --out-dir new").exits(2);
    let ran = bench.run("compensate far.mod --cell cell.toml").exits(2);
    assert!(ran.stdout.is_empty());
    assert_eq!(bench.names(""), before);
    assert_eq!((bench.read("out.mod"), bench.read("out.csv")), ("old".to_owned(), "old".to_owned()));
}

#[test]
fn an_output_that_cannot_be_written_takes_the_others_with_it() {
    let bench = Bench::new();
    let before = bench.names("");
    let ran = bench.run(&format!("{RUN} -o out.mod --report no/such/folder/out.csv")).exits(2);
    assert!(ran.stderr.contains("no/such/folder/out.csv"), "{}", ran.stderr);
    assert_eq!(bench.names(""), before);
}

#[test]
fn inputs_and_programs_are_never_written_over() {
    let bench = Bench::new();
    bench.write("other.mod", PROGRAM);
    for arguments in ["-o part.mod", "-o ./part.mod", "--report cell.toml -o out.mod", "--report other.mod -o out.mod"]
    {
        bench.run(&format!("{RUN} {arguments}")).exits(2);
    }
    bench.run(&format!("{RUN} -o out.mod --report out.mod")).exits(2);
    bench.run(&format!("{RUN} --report -")).exits(2);
    assert_eq!((bench.read("part.mod"), bench.read("other.mod")), (PROGRAM.to_owned(), PROGRAM.to_owned()));
    assert!(!bench.path("out.mod").exists());
}

#[test]
fn several_programs_go_to_a_folder_with_their_reports() {
    let bench = Bench::new();
    bench.write("two.mod", PROGRAM.replace("MODULE Part", "MODULE Two"));
    bench.run("compensate part.mod two.mod part.apt --cell cell.toml").exits(2);
    // part.mod and part.apt would both become part.mod.
    let said = bench.run("compensate part.mod part.apt --cell cell.toml --out-dir out").exits(2).stderr;
    assert!(said.contains("part.mod and part.apt have outputs of this name"), "{said}");
    assert!(!bench.path("out").exists());
    bench.run("compensate part.mod two.mod --cell cell.toml --out-dir out --report all.csv").exits(0);
    assert_eq!(bench.names("out"), ["part.mod", "part.report.csv", "two.mod", "two.report.csv"]);
    let all = bench.read("all.csv");
    assert!(all.lines().next().unwrap().ends_with(",feed_mm_s,error_part_mm,file"));
    assert_eq!(all.lines().filter(|line| line.ends_with(",two.mod")).count(), 4);
}

#[test]
fn programs_whose_names_differ_in_their_ending_have_reports_of_their_own() {
    let bench = Bench::new();
    bench.write("part.prg", PROGRAM.replace("MODULE Part", "MODULE Two"));
    bench.write("two.mod", PROGRAM.replace("MODULE Part", "MODULE Three"));
    bench.run("compensate part.mod part.prg two.mod --cell cell.toml --out-dir out").exits(0);
    let names = ["part.mod", "part.mod.report.csv", "part.prg", "part.prg.report.csv", "two.mod", "two.report.csv"];
    assert_eq!(bench.names("out"), names);
}

#[test]
fn a_folder_made_for_a_run_that_fails_goes_again() {
    let bench = Bench::new();
    let names: Vec<String> = (0..12).map(|i| format!("p{i}.mod")).collect();
    for name in &names {
        bench.write(name, PROGRAM);
    }
    bench.write("far.mod", PROGRAM.replace("[[100,0,0]", "[[9000,0,0]"));
    let before = bench.names("");
    for _ in 0..10 {
        bench.run(&format!("compensate {} far.mod --cell cell.toml --out-dir new", names.join(" "))).exits(2);
        assert_eq!(bench.names(""), before);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let bench = Bench::new();
    for jobs in [1, 7] {
        bench.run(&format!("{RUN} -o out{jobs}.mod --report out{jobs}.csv --jobs {jobs}")).exits(0);
    }
    assert_eq!(bench.read("out1.mod"), bench.read("out7.mod"));
    assert_eq!(bench.read("out1.csv"), bench.read("out7.csv"));
}

#[test]
fn no_force_changes_no_byte() {
    let bench = Bench::new();
    bench.write("cell.toml", super::bench::CELL.replace("force = \"constant\"", "force = \"none\""));
    assert_eq!(bench.run(RUN).exits(0).stdout, PROGRAM);
}

#[test]
fn position_leaves_every_orientation_alone() {
    let bench = Bench::new();
    bench.run(&format!("{RUN} --correct position -o out.mod")).exits(0);
    assert_eq!(bench.read("out.mod").matches(",[0,1,0,0],").count(), 4);
    bench.run("check out.mod --cell cell.toml --against part.mod --max-error 0.001 --at-targets").exits(0);
}

#[test]
fn versions_in_comments_are_text_and_the_same() {
    let bench = Bench::new();
    bench.write("part.mod", PROGRAM.replace("MODULE Part", "MODULE Part\n  ! posted by post 1.2.3 at 10.0.0.7"));
    bench.run("diff part.mod part.mod").exits(0);
    bench.write("other.mod", bench.read("part.mod").replace("1.2.3", "1.2.4"));
    let ran = bench.run("diff part.mod other.mod").exits(1);
    assert!(ran.stdout.contains("line 2: text is different: `! posted by post 1.2.4"), "{}", ran.stdout);
}

#[test]
fn what_an_arc_misses_between_its_points_is_said() {
    let bench = Bench::new();
    let line = PROGRAM.lines().find(|line| line.contains("[[100,0,0]")).unwrap();
    let point = |x: i32, y: i32| format!("[[{x},{y},0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
    let arc = format!("    MoveC {},{},v20,fine,tMill\\WObj:=wPart;", point(150, 100), point(50, 200));
    bench.write("arc.mod", PROGRAM.replace(line, &arc));
    let said = bench.run("compensate arc.mod --cell cell.toml -o out.mod").exits(0).stderr;
    assert!(said.contains("remains between targets") && said.contains("`--subdivide MM`"), "{said}");
    // A correction that is the same everywhere moves the circle as a whole.
    let shifted = "[[effect]]\nkind = \"work_object_frame\"\nd_mm = [0.3, -0.2, 0.1]\nd_rad = [0, 0, 0]\n";
    bench.write(
        "shifted.toml",
        super::bench::CELL.split("[cut]").next().unwrap().to_owned() + "[cut]\nforce = \"none\"\n" + shifted,
    );
    let said = bench.run("compensate arc.mod --cell shifted.toml -o out.mod").exits(0).stderr;
    assert!(said.contains("4 corrected") && !said.contains("remains between targets"), "{said}");
}

#[test]
#[cfg(unix)]
fn a_file_is_one_file_under_all_its_names() {
    let bench = Bench::new();
    bench.write("a.mod", "old").write("other.mod", PROGRAM);
    for (of, name) in [("part.mod", "h.mod"), ("cell.toml", "h.toml"), ("a.mod", "b.csv"), ("other.mod", "h.csv")] {
        std::fs::hard_link(bench.path(of), bench.path(name)).unwrap();
    }
    let said = bench.run(&format!("{RUN} -o h.mod")).exits(2).stderr;
    assert!(said.contains("it is an input of this run, part.mod"), "{said}");
    bench.run(&format!("{RUN} -o out.mod --report h.toml")).exits(2);
    // What is opened only while the run goes on is an input too.
    bench.run("check part.mod --cell cell.toml --max-error 9 --against other.mod --report h.csv").exits(2);
    let said = bench.run(&format!("{RUN} -o a.mod --report b.csv")).exits(2).stderr;
    assert!(said.contains("another output goes into the same file"), "{said}");
    assert_eq!((bench.read("part.mod"), bench.read("a.mod")), (PROGRAM.to_owned(), "old".to_owned()));
    assert!(!bench.path("out.mod").exists());
}

#[test]
#[cfg(unix)]
fn nothing_is_named_from_a_device_and_no_link_in_a_circle_is_replaced() {
    let bench = Bench::new();
    std::os::unix::fs::symlink("/dev/null", bench.path("null")).unwrap();
    let before = bench.names("");
    bench.run(&format!("{RUN} -o null")).exits(0);
    bench.run(&format!("{RUN} -o /dev/null")).exits(0);
    assert_eq!(bench.names(""), before);
    assert!(!std::path::Path::new("/dev/null.report.csv").exists());
    std::os::unix::fs::symlink("two.mod", bench.path("one.mod")).unwrap();
    std::os::unix::fs::symlink("one.mod", bench.path("two.mod")).unwrap();
    let said = bench.run(&format!("{RUN} -o one.mod")).exits(2).stderr;
    assert!(said.contains("leads back to itself"), "{said}");
    assert!(std::fs::symlink_metadata(bench.path("one.mod")).unwrap().is_symlink());
}

#[test]
#[cfg(unix)]
fn a_result_for_a_closed_stdout_is_refused_and_a_summary_is_not() {
    let bench = Bench::new();
    let closed = |arguments: &str| {
        let mut command = std::process::Command::new("sh");
        command.current_dir(bench.path("")).args(["-c", "exec \"$@\" >&-", "sh"]);
        command.arg(assert_cmd::cargo::cargo_bin!("deflex")).args(arguments.split_whitespace());
        let ran = command.output().unwrap();
        (ran.status.code(), String::from_utf8(ran.stderr).unwrap())
    };
    for lost in [RUN.to_owned(), format!("{RUN} -o -"), format!("{RUN} -o out.mod --json -")] {
        let (code, said) = closed(&lost);
        assert_eq!(code, Some(2), "{lost}: {said}");
        assert!(said.contains("standard output is closed"), "{said}");
    }
    assert!(!bench.path("out.mod").exists());
    assert_eq!(closed("init --robot irb6660-205-1.9").0, Some(2));
    assert_eq!(closed("predict part.mod --cell cell.toml").0, Some(2), "the rows of the report are a result");
    assert_eq!(closed("inspect part.mod").0, Some(0));
    assert_eq!(closed("check part.mod --cell cell.toml --max-error 0.01").0, Some(1));
    let discarded = std::process::Stdio::null();
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("deflex"));
    command.current_dir(bench.path("")).args(RUN.split_whitespace()).stdout(discarded);
    assert_eq!(command.status().unwrap().code(), Some(0));
}

/// A controller loads a program by its ending.
#[test]
fn an_ending_of_another_language_is_said() {
    let bench = Bench::new();
    let ran = bench.run("compensate part.mod --cell cell.toml -o out.ls").exits(0);
    assert!(ran.stderr.contains("usage.ending") && ran.stderr.contains("write it to out.mod"), "{}", ran.stderr);
    let ran = bench.run("compensate part.mod --cell cell.toml -o out.sys").exits(0);
    assert!(!ran.stderr.contains("usage.ending"), "{}", ran.stderr);
    // CL data that are posted under their own ending would be read as CL data.
    bench.write("p.apt", "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/100,100,50,0,0,1\nGOTO/120,100,50\nFINI\n");
    let ran = bench.run("compensate p.apt --cell cell.toml -o out.apt").exits(2);
    assert!(ran.stderr.contains("usage.ending") && !bench.path("out.apt").exists(), "{}", ran.stderr);
}

/// KRL keeps points in a `.dat` of the same name: without it, the lines that need them are named.
#[test]
fn targets_that_no_file_declares_are_named_with_their_line() {
    let bench = Bench::new();
    let tool = "$TOOL={X 0,Y 0,Z 310,A 0,B 0,C 0}\n$BASE={X 1000,Y -400,Z 700,A 0,B 0,C 0}\n$VEL.CP=0.05\n";
    bench.write("p.src", format!("DEF p()\n{tool}LIN {{X 100,Y 100,Z 50,A 0,B 0,C 180}}\nLIN XP1\nEND\n"));
    let ran = bench.run("predict p.src --cell cell.toml --report r.csv").exits(0);
    assert!(ran.stderr.contains("p.src:6:1") && ran.stderr.contains("the .dat of the same name"), "{}", ran.stderr);
    bench.write("p.dat", "DEFDAT p\nDECL E6POS XP1={X 120,Y 100,Z 50,A 0,B 0,C 180}\nENDDAT\n");
    let ran = bench.run("predict p.src --cell cell.toml --report r.csv").exits(0);
    assert!(!ran.stderr.contains("target.kept"), "{}", ran.stderr);
}
