//! `predict` and `check` on long programs: streamed, they say what they say of the whole.

use super::bench::{Bench, CELL, Ran};
use super::long::{long, long_cl};
use deflex::program::rapid::CHUNK;

/// A procedure that nothing runs: the program is read as a whole.
const MORE: &str = "  PROC idle(num n)\n  ENDPROC\nENDMODULE";

/// Every target of a line declared, and moved to.
fn declared(count: usize) -> String {
    let mut text = "MODULE Part\n".to_owned();
    for i in 0..count {
        let x = 0.25 * (i % 400) as f64;
        text += &format!("  CONST robtarget p{i}:=[[{x},0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n");
    }
    text += "  PROC main()\n";
    (0..count).for_each(|i| text += &format!("    MoveL p{i},v20,z1,tMill\\WObj:=wPart;\n"));
    text + "  ENDPROC\nENDMODULE\n"
}

fn rapid_whole(text: &str) -> String {
    text.replace("ENDMODULE", MORE)
}

/// A unit that is named long after the first position is found in the whole program.
fn cl_whole(text: &str) -> String {
    text.replace("UNITS/MM", "$$").replace("FINI", "UNITS/MM\nFINI")
}

/// The same moves in routines that `main` calls, last in the text.
fn routines(text: &str) -> String {
    let (head, rest) = text.split_once("  PROC main()\n").unwrap();
    let (body, end) = rest.split_once("  ENDPROC\n").unwrap();
    let moves: Vec<&str> = body.split_inclusive('\n').collect();
    let paths: Vec<String> = moves.chunks(700).map(|some| some.concat()).collect();
    let proc = |(i, body): (usize, &String)| format!("  PROC Path_{i}()\n{body}  ENDPROC\n");
    let calls: String = (0..paths.len()).map(|i| format!("    Path_{i};\n")).collect();
    let paths: String = paths.iter().enumerate().map(proc).collect();
    format!("{head}{paths}  PROC main()\n    ConfL\\Off;\n{calls}  ENDPROC\n{end}")
}

/// Programs of each kind, as they are streamed and as they are held whole.
fn programs(bench: &Bench) -> [(&'static str, &'static str, &'static str); 4] {
    let (inline, cl, named) = (long(6 * CHUNK / 400), long_cl(CHUNK / 8), declared(4 * CHUNK / 40));
    bench.write("inline.mod", &inline).write("inline-whole.mod", rapid_whole(&inline));
    bench.write("named.mod", &named).write("named-whole.mod", rapid_whole(&named));
    let called = routines(&inline);
    bench.write("called.mod", &called).write("called-whole.mod", rapid_whole(&called));
    bench.write("part.apt", &cl).write("whole.apt", cl_whole(&cl));
    [
        ("inline.mod", "inline-whole.mod", "mod"),
        ("called.mod", "called-whole.mod", "mod"),
        ("named.mod", "named-whole.mod", "mod"),
        ("part.apt", "whole.apt", "apt"),
    ]
}

/// Runs both ways, on one thread and on three, and compares every output.
#[track_caller]
fn alike(bench: &Bench, command: &str, streamed: &str, whole: &str, options: &str, code: i32) -> Ran {
    let run = |program: &str, out: &str, jobs: usize| {
        let reports = format!("--report {out}.csv --html {out}.html --jobs {jobs}");
        bench.run(&format!("{command} {program} --cell cell.toml {options} {reports}")).exits(code)
    };
    let expected = run(whole, "whole", 2);
    let hashes = [whole, streamed].map(|program| bench.hash(program));
    let renamed = |text: &str| text.replace(whole, streamed).replace(&hashes[0], &hashes[1]);
    for jobs in [1, 3] {
        let came = run(streamed, "out", jobs);
        let wanted = renamed(&expected.stdout);
        let other = came.stdout.lines().zip(wanted.lines()).find(|(came, expected)| came != expected);
        assert!(came.stdout == wanted, "{command} {streamed}: the answers differ: {other:?}");
        assert_eq!(came.stderr, renamed(&expected.stderr));
        for form in ["csv", "html"] {
            let (came, expected) = (bench.read(&format!("out.{form}")), bench.read(&format!("whole.{form}")));
            assert!(came == renamed(&expected), "{command} {streamed} {options}: the {form} differs");
        }
    }
    expected
}

#[test]
fn a_long_program_is_predicted_alike() {
    let bench = Bench::new();
    for (streamed, whole, _) in programs(&bench) {
        alike(&bench, "predict", streamed, whole, "", 0);
        let piped = bench.run_with("predict - --cell cell.toml --jobs 2", &bench.read(streamed)).exits(0);
        bench.run(&format!("predict {streamed} --cell cell.toml --report file.csv")).exits(0);
        assert!(piped.stdout == bench.read("file.csv"), "the report of the pipe differs");
    }
}

#[test]
fn a_long_program_is_checked_alike() {
    let bench = Bench::new();
    for ((streamed, whole, _), form) in programs(&bench).into_iter().zip(["text", "json", "junit", "sarif"]) {
        alike(&bench, "check", streamed, whole, "--max-error 1 --max-correction 1", 0);
        let options = format!("--max-error 0.84 --max-correction 0.85 --output-format {form}");
        let said = alike(&bench, "check", streamed, whole, &options, 1).stdout;
        assert!(said.contains("max-error") && said.contains("max-correction"), "{said:.1000}");
    }
}

#[test]
fn a_corrected_long_program_is_judged_alike_against_its_original() {
    let bench = Bench::new();
    for (streamed, whole, ending) in programs(&bench) {
        let corrected = format!("corrected-{ending}.mod");
        bench.run(&format!("compensate {streamed} --cell cell.toml -o {corrected} --report corrected.csv")).exits(0);
        let text = bench.read(&corrected);
        bench.write("corrected-whole.mod", rapid_whole(&text));
        for original in [streamed, whole] {
            let options = format!("--against {original}");
            alike(&bench, "predict", &corrected, "corrected-whole.mod", &options, 0);
        }
        // Where the cut begins the tip leaves the path on the way, whatever stands at the targets.
        let against = format!("--against {streamed} --max-error 0.001");
        let on_the_way = format!("{against} --max-jump 0.001");
        let said = alike(&bench, "check", &corrected, "corrected-whole.mod", &on_the_way, 1);
        assert!(said.stdout.contains("on the path to it"), "{:.1000}", said.stdout);
        let options = format!("{against} --at-targets --max-correction");
        alike(&bench, "check", &corrected, "corrected-whole.mod", &format!("{options} 1"), 0);
        let said = alike(&bench, "check", &corrected, "corrected-whole.mod", &format!("{options} 0.84"), 1);
        assert!(said.stdout.contains("correction of 0.8"), "{:.1000}", said.stdout);
        // One target less: no original of this.
        let line = text.lines().filter(|line| line.contains("MoveL")).nth(1000).unwrap();
        bench.write("less.mod", text.replacen(&format!("{line}\n"), "", 1));
        let refused = bench.run(&format!("predict less.mod --cell cell.toml --against {streamed}")).exits(2);
        assert!(refused.stderr.contains("targets, but the original has"), "{}", refused.stderr);
    }
}

#[test]
fn targets_out_of_reach_are_findings_and_leave_no_rows() {
    let bench = Bench::new();
    let far = long(10 * CHUNK / 400).replacen("[[100,0,0]", "[[9000,0,0]", 700);
    bench.write("far.mod", &far).write("whole.mod", rapid_whole(&far));
    let said = alike(&bench, "check", "far.mod", "whole.mod", "--max-error 1", 1);
    assert!(said.stdout.contains("not reached") && said.stdout.contains("700 findings"), "{:.1000}", said.stdout);
    assert_eq!(bench.read("out.csv").lines().count(), 1);
    let refused = bench.run("predict far.mod --cell cell.toml").exits(2);
    assert!(refused.stdout.is_empty() && refused.stderr.contains("not reached"), "{:.1000}", refused.stderr);
}

#[test]
fn findings_beyond_the_listed_ones_are_counted() {
    let bench = Bench::new();
    // 10,200 targets.
    let program = long(3400);
    bench.write("long.mod", &program).write("whole.mod", rapid_whole(&program));
    for form in ["text", "json", "junit", "sarif"] {
        let said =
            alike(&bench, "check", "long.mod", "whole.mod", &format!("--max-error 1e-6 --output-format {form}"), 1);
        let targets = program.matches("MoveL").count();
        let rest = match form {
            "json" => format!("\"more_findings\": {}", targets - 10_000),
            _ => format!("{} more findings", targets - 10_000),
        };
        assert!(said.stdout.contains(&rest), "{form}: {rest}");
    }
}

#[test]
fn a_batch_is_judged_as_each_of_its_programs() {
    let bench = Bench::new();
    let named = |name: &str| long(10 * CHUNK / 400).replace("MODULE Part", &format!("MODULE {name}"));
    bench.write("a.mod", named("A")).write("b.mod", rapid_whole(&named("B"))).write("c.apt", long_cl(10 * CHUNK / 40));
    let inputs = ["a.mod", "b.mod", "c.apt", "part.mod"];
    for command in ["predict", "check --max-error 0.84"] {
        let run = |inputs: &str, jobs: usize| {
            bench.run(&format!("{command} {inputs} --cell cell.toml --report all.csv --jobs {jobs}"));
            bench.read("all.csv")
        };
        let batch = run(&inputs.join(" "), 3);
        assert!(batch == run(&inputs.join(" "), 1), "the reports of one thread and of three differ");
        let mut expected = String::new();
        for (i, input) in inputs.iter().enumerate() {
            for line in run(input, 2).lines().skip(usize::from(i > 0)) {
                expected += &format!("{line},{}\n", if line.starts_with("target,") { "file" } else { input });
            }
        }
        assert!(batch == expected, "{command}: the report of the batch is not that of its programs");
    }
}

#[test]
fn what_is_wrong_between_targets_is_a_finding_with_its_figures() {
    let bench = Bench::new();
    let robot = deflex::robot::BUILTIN.iter().find(|robot| robot.model == "irb6660-205-1.9").unwrap().robot();
    // Axis 5 runs through zero between two targets that keep off it.
    let target = |a5: f64| {
        let axes = [5.0, 20.0, 15.0, 0.0, a5, 10.0];
        let pose = robot.forward(&robot.motor_from_axes_deg(&axes));
        let (at, q) = (pose.translation.vector * 1e3, nalgebra::UnitQuaternion::from_rotation_matrix(&pose.rotation));
        format!(
            "[[{:.6},{:.6},{:.6}],[{:.10},{:.10},{:.10},{:.10}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
            at.x, at.y, at.z, q.w, q.i, q.j, q.k
        )
    };
    let text = format!(
        "MODULE M\n  PROC main()\n    MoveAbsJ [[5,20,15,0,6,10],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,fine,tool0;\n    MoveL {},v20,fine,tool0;\n    MoveL {},v20,fine,tool0;\n  ENDPROC\nENDMODULE\n",
        target(8.0),
        target(-5.0)
    );
    bench.write("s.mod", text).write(
        "none.toml",
        CELL.replace("force = \"constant\"", "force = \"none\"")
            .replace("force_n", "# force_n")
            .replace("frame =", "# frame ="),
    );
    let ran = bench.run("check s.mod --cell none.toml --max-error 1 --json s.json").exits(1);
    assert!(ran.stdout.contains("target 3") && ran.stdout.contains("singular posture"), "{}", ran.stdout);
    let json: serde_json::Value = serde_json::from_str(&bench.read("s.json")).unwrap();
    let findings = json["files"][0]["findings"].as_array().unwrap();
    let singular = findings.iter().find(|finding| finding["code"] == "singular").expect("a finding");
    assert_eq!((&singular["target"], &singular["axis"], &singular["line"]), (&3.into(), &5.into(), &5.into()));
    let (share, value) = (singular["share"].as_f64().unwrap(), singular["value"].as_f64().unwrap());
    assert!((0.5..0.75).contains(&share) && value < 0.03, "{singular}");
    // A correction says so, and is written.
    let said = bench.run("compensate s.mod --cell none.toml -o out.mod").exits(0).stderr;
    assert!(said.contains("singular posture") && said.contains("target 3"), "{said}");
}
