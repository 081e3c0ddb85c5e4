//! Long programs: streamed to the same bytes, and without a trace when interrupted.

use super::bench::{Bench, PROGRAM};
use deflex::program::rapid::CHUNK;

/// The small program's cuts over and over: there and back, some chunks long.
pub(crate) fn long(rounds: usize) -> String {
    let lines: Vec<&str> = PROGRAM.lines().collect();
    let (head, cuts, end) = (&lines[..5], &lines[5..8], &lines[8..]);
    let body: Vec<&str> = (0..rounds).flat_map(|_| cuts.iter().copied()).collect();
    [head, &body, end].concat().join("\n") + "\n"
}

/// Moves along a line and back, with an arc now and then.
pub(crate) fn long_cl(targets: usize) -> String {
    let mut text = "UNITS/MM\nFEDRAT/600,MMPM\nRAPID\nGOTO/0,0,100,0,0,1\nGOTO/0,0,0,0,0,1\n".to_owned();
    for i in 0..targets {
        let x = 0.5 * (i % 200) as f64;
        text += &match i % 500 {
            0 => "GOTO/0,0,0\nCIRCLE/0,2,0,0,0,1,2\nGOTO/0,4,0\nCIRCLE/0,2,0,0,0,1,2\nGOTO/0,0,0\n".to_owned(),
            _ => format!("GOTO/{x},{},0,0,0,1\n", 0.25 * (i % 40) as f64),
        };
    }
    text + "FINI\n"
}

#[test]
fn a_long_program_is_the_same_from_file_and_pipe_streamed_and_whole() {
    let bench = Bench::new();
    let text = long(5 * CHUNK / 400);
    bench.write("long.mod", &text);
    // What a procedure more changes is only that the program is read whole.
    bench.write("whole.mod", text.replace("ENDMODULE", "  PROC idle(num n)\n  ENDPROC\nENDMODULE"));
    bench.run("compensate long.mod --cell cell.toml -o out.mod --report out.csv --jobs 3").exits(0);
    bench.run("compensate whole.mod --cell cell.toml -o out-whole.mod --report whole.csv").exits(0);
    let whole = bench.read("out-whole.mod").replace("  PROC idle(num n)\n  ENDPROC\n", "");
    assert!(bench.read("out.mod") == whole, "the programs differ");
    assert!(bench.read("out.csv") == bench.read("whole.csv"), "the reports differ");
    let piped = bench.run_with("compensate - --cell cell.toml --jobs 2", &text).exits(0);
    assert!(piped.stdout == bench.read("out.mod"), "the piped program differs");
}

#[test]
fn long_cl_data_are_the_same_from_file_and_pipe_streamed_and_whole() {
    let bench = Bench::new();
    let text = long_cl(10 * CHUNK / 40);
    bench.write("long.apt", &text);
    // A unit that is named long after the first position is found in the whole program.
    bench.write("unread.apt", text.replace("UNITS/MM", "$$").replace("FINI", "UNITS/MM\nFINI"));
    let options = "--cell cell.toml --max-targets 5000 --html";
    bench.run(&format!("compensate long.apt --out-dir out --report out.csv --jobs 3 {options} out.html")).exits(0);
    bench.run(&format!("compensate unread.apt --out-dir unread --report unread.csv {options} unread.html")).exits(0);
    let parts = bench.names("out");
    assert!(parts.len() > 3, "{parts:?}");
    let renamed = |text: String| text.replace("unread", "long");
    for part in parts {
        let other = renamed(bench.read(&format!("unread/{}", part.replace("long", "unread"))));
        assert!(bench.read(&format!("out/{part}")) == other, "{part} differs");
    }
    assert!(bench.read("out.csv") == bench.read("unread.csv"), "the reports differ");
    let page = renamed(bench.read("unread.html")).replace(&bench.hash("unread.apt"), &bench.hash("long.apt"));
    assert!(bench.read("out.html") == page, "the pages differ");
    let options = "--cell cell.toml --max-targets 5000 --subdivide 0.0002";
    for (input, out) in [("long.apt", "more"), ("unread.apt", "more-unread")] {
        bench.run(&format!("compensate {input} --out-dir {out} {options}")).exits(0);
    }
    let moves = |folder: &str| -> usize {
        bench.names(folder).iter().map(|part| bench.read(&format!("{folder}/{part}")).matches("    Move").count()).sum()
    };
    assert!(moves("more") > moves("out"));
    for part in bench.names("more") {
        let other = renamed(bench.read(&format!("more-unread/{}", part.replace("long", "unread"))));
        assert!(bench.read(&format!("more/{part}")) == other, "{part} differs");
    }
    bench.run("compensate long.apt --cell cell.toml -o program.mod").exits(0);
    let piped = bench.run_with("compensate - --cell cell.toml --jobs 2", &text).exits(0);
    let file = bench.read("program.mod").replace("from long.apt", "from -");
    assert!(piped.stdout == file, "the piped program differs");
    let refused = bench.run("compensate long.apt --cell cell.toml -o parts.mod --max-targets 5000").exits(2);
    assert!(refused.stderr.contains("give --out-dir DIR"), "{}", refused.stderr);
}

#[test]
fn a_batch_of_long_programs_is_what_each_of_them_is_alone() {
    let bench = Bench::new();
    let named = |name: &str| long(10 * CHUNK / 400).replace("MODULE Part", &format!("MODULE {name}"));
    bench.write("a.mod", named("A")).write("b.mod", named("B")).write("c.apt", long_cl(10 * CHUNK / 40));
    // `d` calls what `e` declares: one program, held whole.
    let calls = named("D").replace("  ENDPROC", "    Finish;\n  ENDPROC");
    bench.write("d.mod", calls).write("e.mod", "MODULE E\n  PROC Finish()\n  ENDPROC\nENDMODULE\n");
    let inputs = ["a.mod", "b.mod", "c.apt", "part.mod", "d.mod e.mod"];
    let run = |inputs: &str, out: &str, jobs: u8| {
        let reports = format!("--report {out}.csv --html {out}.html --json {out}.json --jobs {jobs}");
        bench.run(&format!("compensate {inputs} --cell cell.toml --out-dir {out} {reports}")).exits(0);
        bench.read(&format!("{out}.csv"))
    };
    let (batch, again) = (run(&inputs.join(" "), "all", 3), run(&inputs.join(" "), "all1", 1));
    assert!(batch == again, "the reports of one thread and of three differ");
    let mut expected = String::new();
    for (i, input) in inputs.iter().enumerate() {
        let out = format!("one{i}");
        for line in run(input, &out, 2).lines() {
            let file = if line.starts_with("target,") { "file" } else { input.split(' ').next().unwrap() };
            // Two files make a column of their own.
            let line = line.strip_suffix(&format!(",{file}")).unwrap_or(line);
            if file != "file" || i == 0 {
                expected += &format!("{line},{file}\n");
            }
        }
        for name in bench.names(&out) {
            let (one, all) = (bench.read(&format!("{out}/{name}")), bench.read(&format!("all/{name}")));
            assert!(one == all, "{name} differs");
        }
    }
    assert!(batch == expected, "the report of the batch is not that of its programs");
}

/// The chunks of a program compute the force of its cut on the threads of the pool. Programs that occupied these would wait for ever.
#[test]
fn a_batch_of_as_many_programs_as_threads_ends() {
    let bench = Bench::new();
    let cell = "[robot]\nmodel = \"irb6660-205-1.9\"\n[robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n\
                [cut]\nforce = \"mechanistic\"\n[cut.cutter]\ndiameter_mm = 20.0\ncorner_radius_mm = 2.0\nteeth = 3\nhelix_deg = 30.0\n\
                [cut.engagement]\nmode = \"slot\"\ndepth_mm = 2.0\nwidth_mm = 20.0\nfeed_per_tooth_mm = 0.05\nlead_deg = 0.0\ntilt_deg = 0.0\n\
                [cut.coefficients]\nmaterial = \"al7075\"\n";
    bench.write("milled.toml", cell);
    for name in ["a", "b"] {
        let text = long(10 * CHUNK / 400).replace("MODULE Part", &format!("MODULE {name}"));
        bench.write(&format!("{name}.mod"), text);
    }
    for jobs in [1, 2] {
        bench.run(&format!("compensate a.mod b.mod --cell milled.toml --out-dir out{jobs} --jobs {jobs}")).exits(0);
    }
    for name in ["a.mod", "b.mod"] {
        assert!(bench.read(&format!("out1/{name}")) == bench.read(&format!("out2/{name}")), "{name} differs");
    }
}

#[test]
fn declared_targets_are_corrected_where_they_stand() {
    let bench = Bench::new();
    let (mut data, mut moves) = (String::new(), String::new());
    for i in 0..5 * CHUNK / 50 {
        let x = 0.5 * (i % 200) as f64;
        data += &format!(
            "  CONST robtarget p{i}:=[[{x},{},0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n",
            0.25 * (i % 40) as f64
        );
        moves += &format!("    MoveL p{i},v20,z1,tMill\\WObj:=wPart;\n");
    }
    let text = PROGRAM.replace("  PROC", &format!("{data}  PROC")).replace("  ENDPROC", &format!("{moves}  ENDPROC"));
    // What a procedure more changes is only that the program is read whole.
    let more = "  PROC idle(num n)\n  ENDPROC\n";
    bench.write("part.mod", &text).write("whole.mod", text.replace("ENDMODULE", &format!("{more}ENDMODULE")));
    bench.write("forces.csv", "target,fx_n,fy_n,fz_n\np7,100,0,50\nP9,0,0,90\n12,0,10,90\n");
    let options = "--cell cell.toml --forces forces.csv --html";
    bench.run(&format!("compensate part.mod {options} out.html -o out.mod --report out.csv --jobs 3")).exits(0);
    bench.run(&format!("compensate whole.mod {options} whole.html -o out-whole.mod --report whole.csv")).exits(0);
    assert!(bench.read("out.mod") == bench.read("out-whole.mod").replace(more, ""), "the programs differ");
    assert!(bench.read("out.csv") == bench.read("whole.csv"), "the reports differ");
    let piped = bench.run_with("compensate - --cell cell.toml --forces forces.csv", &text).exits(0);
    assert!(piped.stdout == bench.read("out.mod"), "the piped program differs");
    bench.write("forces.csv", "target,fx_n,fy_n,fz_n\nq7,100,0,50\n");
    let refused = bench.run(&format!("compensate part.mod {options} no.html -o no.mod")).exits(2);
    assert!(refused.stderr.contains("target `q7` is not in the program"), "{}", refused.stderr);
}

#[test]
fn a_long_program_takes_its_forces_and_tools_from_other_files() {
    let bench = Bench::new();
    let text = long(10 * CHUNK / 400);
    let (data, body): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.contains("PERS "));
    bench
        .write("long.mod", body.join("\n") + "\n")
        .write("data.mod", format!("MODULE Data\n{}\nENDMODULE\n", data.join("\n")));
    let rows = |count: usize| (1..=count).map(|i| format!("{i},0,0,{}\n", 100 + i % 7)).collect::<String>();
    let targets = text.matches("Move").count();
    bench.write("forces.csv", format!("target,fx_n,fy_n,fz_n\n{}", rows(targets)));
    // A statement that changes a variable is followed in the whole only.
    let counted = |text: &str| text.replace("  PROC main()\n", "  PROC main()\n    nParts:=1;\n");
    bench.write("whole.mod", counted(&bench.read("long.mod")).replace("MODULE Part", "MODULE Part\nVAR num nParts;"));
    let options = "--cell cell.toml --context data.mod --forces forces.csv";
    bench.run(&format!("compensate long.mod {options} -o out.mod --report out.csv")).exits(0);
    bench.run(&format!("compensate whole.mod {options} -o whole-out.mod --report whole.csv")).exits(0);
    let whole = bench.read("whole-out.mod").replace("    nParts:=1;\n", "").replace("\nVAR num nParts;", "");
    assert!(bench.read("out.mod") == whole, "the programs differ");
    let columns = |name: &str| {
        let row = |line: &str| line.split(',').enumerate().filter(|(i, _)| *i != 1).map(|c| c.1.to_owned()).collect();
        bench.read(name).lines().map(row).collect::<Vec<Vec<String>>>()
    };
    assert!(columns("out.csv") == columns("whole.csv"), "the reports differ but for their lines");
    bench.write("forces.csv", format!("target,fx_n,fy_n,fz_n\n{}", rows(targets + 1)));
    let refused = bench.run(&format!("compensate long.mod {options} -o more.mod")).exits(2);
    assert!(refused.stderr.contains(&format!("target {} is not in the program", targets + 1)), "{}", refused.stderr);
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_nothing() {
    let bench = Bench::new();
    bench.write("long.mod", long(100_000));
    interrupted(&bench, &["long.mod", "-o", "out.mod", "--report", "out.csv"], 2);
    bench.write("long.apt", long_cl(300_000));
    // Two modules at least are begun: the main one and the first part.
    interrupted(&bench, &["long.apt", "--out-dir", "out", "--report", "out.csv", "--max-targets", "10000"], 2);
}

/// Interrupts a run when so many outputs are staged.
#[cfg(unix)]
fn interrupted(bench: &Bench, arguments: &[&str], outputs: usize) {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let staged = |folder| if bench.path(folder).is_dir() { bench.names(folder) } else { Vec::new() };
    let hidden = || {
        let names = [staged("."), staged("out")].concat();
        names.iter().filter(|name| name.starts_with('.')).count()
    };
    let mut run = Command::new(env!("CARGO_BIN_EXE_deflex"))
        .args([&["compensate", "--cell", "cell.toml"], arguments].concat())
        .current_dir(bench.path("."))
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while hidden() < outputs && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(hidden() >= outputs, "the outputs are staged");
    assert!(Command::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap().success());
    assert_eq!(run.wait().unwrap().code(), Some(130));
    assert_eq!(hidden(), 0);
    assert!(!staged(".").iter().any(|name| name.starts_with("out.")), "{:?}", staged("."));
    assert!(staged("out").is_empty(), "{:?}", staged("out"));
}

#[cfg(unix)]
#[test]
fn a_program_from_a_named_pipe_is_that_of_a_file() {
    let bench = Bench::new();
    let text = long_cl(5000);
    bench.write("part.apt", &text).run("compensate part.apt --cell cell.toml -o out.mod").exits(0);
    let pipe = bench.path("pipe.apt");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let writer = std::thread::spawn(move || std::fs::write(pipe, text));
    bench.run("compensate pipe.apt --cell cell.toml -o piped.mod").exits(0);
    writer.join().unwrap().unwrap();
    let named = |text: String| text.replace("piped", "out").replace("pipe.apt", "part.apt");
    assert!(named(bench.read("piped.mod")) == bench.read("out.mod"), "the programs differ");
}
