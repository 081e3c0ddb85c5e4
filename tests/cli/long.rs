//! Long programs: streamed to the same bytes, and without a trace when interrupted.

use crate::bench::{Bench, PROGRAM};
use deflex::program::rapid::PIECE;

/// The small program's cuts over and over: there and back, some pieces long.
fn long(rounds: usize) -> String {
    let lines: Vec<&str> = PROGRAM.lines().collect();
    let (head, cuts, end) = (&lines[..5], &lines[5..8], &lines[8..]);
    let body: Vec<&str> = (0..rounds).flat_map(|_| cuts.iter().copied()).collect();
    [head, &body, end].concat().join("\n") + "\n"
}

#[test]
fn a_long_program_is_the_same_from_file_and_pipe_streamed_and_whole() {
    let bench = Bench::new();
    let text = long(5 * PIECE / 400);
    bench.write("long.mod", &text);
    // What a procedure more changes is only that the program is read whole.
    bench.write("whole.mod", text.replace("ENDMODULE", "  PROC idle()\n  ENDPROC\nENDMODULE"));
    bench.run("compensate long.mod --cell cell.toml -o out.mod --report out.csv --jobs 3").exits(0);
    bench.run("compensate whole.mod --cell cell.toml -o out-whole.mod --report whole.csv").exits(0);
    let whole = bench.read("out-whole.mod").replace("  PROC idle()\n  ENDPROC\n", "");
    assert!(bench.read("out.mod") == whole, "the programs differ");
    assert!(bench.read("out.csv") == bench.read("whole.csv"), "the reports differ");
    let piped = bench.run_with("compensate - --cell cell.toml --jobs 2", &text).exits(0);
    assert!(piped.stdout == bench.read("out.mod"), "the piped program differs");
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_nothing() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let bench = Bench::new();
    bench.write("long.mod", long(100_000));
    let hidden = || bench.names(".").iter().filter(|name| name.starts_with('.')).count();
    let mut run = Command::new(env!("CARGO_BIN_EXE_deflex"))
        .args(["compensate", "long.mod", "--cell", "cell.toml", "-o", "out.mod", "--report", "out.csv"])
        .current_dir(bench.path("."))
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while hidden() < 2 && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    assert_eq!(hidden(), 2, "both outputs are staged");
    assert!(Command::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap().success());
    assert_eq!(run.wait().unwrap().code(), Some(130));
    assert_eq!(hidden(), 0);
    assert!(!bench.names(".").iter().any(|name| name.starts_with("out")));
}
