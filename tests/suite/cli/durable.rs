//! What is on the disk whatever happens: a kill, a full disk, another writer, an input that changes.

use super::bench::{Bench, CELL, PROGRAM, cell_with_stock};
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

const RUN: &str = "compensate part.mod --cell cell.toml -o out.mod --report out.csv";

/// A batch: programs, their reports, all in one report, a summary and a page.
const BATCH: &[&str] = &[
    "compensate", "a.mod", "b.mod", "c.mod", "--cell", "cell.toml", "--out-dir", "out", "--report", "all.csv",
    "--json", "all.json", "--html", "all.html", "--quiet",
];
const FOLDERS: [&str; 2] = ["", "out"];

fn batch() -> Bench {
    let bench = Bench::new();
    for name in ["a", "b", "c"] {
        bench.write(&format!("{name}.mod"), PROGRAM.replace("MODULE Part", &format!("MODULE {name}")));
    }
    bench
}

/// Another force, and so other outputs.
fn turn(bench: &Bench, force: usize) {
    bench.write("cell.toml", CELL.replace("[120, ", &format!("[{}, ", 120 + 10 * force)));
}

fn start(bench: &Bench, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_deflex"))
        .args(arguments)
        .current_dir(bench.path("."))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn ended(bench: &Bench, arguments: &[&str]) -> ExitStatus {
    start(bench, arguments).wait().unwrap()
}

/// A simulation, whose points, page, mesh and figures are one set. Its page goes into a file that has another name too, whose
/// content is replaced in place.
const SIMULATION: &[&str] = &[
    "simulate", "a.mod", "--cell", "stock.toml", "--stl", "out/part.stl", "--report", "all.csv", "--json", "all.json",
    "--html", "all.html", "--quiet",
];

/// A stock that the cutter of the program goes through, coarse enough to be cut in no time, and forces of another feed each.
fn stock(force: usize) -> String {
    let cell = cell_with_stock("box_mm = [[-20, -20, -20], [120, 20, 1]]\nresolution_mm = 2.0");
    cell.replace("feed_per_tooth_mm = 0.05", &format!("feed_per_tooth_mm = 0.{}", 5 + force))
}

/// Every output of the batch with its bytes.
fn outputs(bench: &Bench) -> BTreeMap<String, Vec<u8>> {
    let name = |folder: &str, name: &str| Path::new(folder).join(name).to_string_lossy().into_owned();
    let named = |folder: &'static str| bench.names(folder).into_iter().map(move |file| name(folder, &file));
    let files = FOLDERS.into_iter().filter(|folder| bench.path(folder).is_dir()).flat_map(named);
    let output = |file: &String| file.starts_with("out/") || file.starts_with("all.");
    files.filter(output).map(|file| (file.clone(), fs::read(bench.path(&file)).unwrap())).collect()
}

fn hidden(bench: &Bench) -> Vec<String> {
    let names = FOLDERS.into_iter().filter(|folder| bench.path(folder).is_dir()).flat_map(|folder| bench.names(folder));
    names.filter(|name| name.starts_with('.')).collect()
}

fn markers(bench: &Bench) -> usize {
    let names = FOLDERS.into_iter().filter(|folder| bench.path(folder).is_dir()).flat_map(|folder| bench.names(folder));
    names.filter(|name| name.starts_with("deflex-unfinished-")).count()
}

/// What the outputs are, without what only says so or waits.
fn results(bench: &Bench) -> BTreeMap<String, Vec<u8>> {
    let mut all = outputs(bench);
    all.retain(|name, _| !name.contains("/.") && !name.contains("deflex-unfinished"));
    all
}

/// When a run is killed.
#[derive(Clone, Copy, Debug)]
enum Moment {
    After(Duration),
    /// As soon as something is staged.
    Staged,
    /// As soon as the marker is there.
    Marked,
    /// As soon as so many outputs are new.
    Placed(usize),
}

/// What the kills came to.
#[derive(Debug, Default)]
struct Counts {
    old: usize,
    new: usize,
    marked: usize,
}

/// Kills runs of the batch, and looks at what is there then and after the next run.
fn kill_at(moments: impl Iterator<Item = Moment>) -> Counts {
    let bench = batch();
    let mut sets = Vec::new();
    for force in 0..2 {
        turn(&bench, force);
        assert!(ended(&bench, BATCH).success());
        sets.push(results(&bench));
    }
    assert!(sets[0].len() == 9 && sets[0].keys().eq(sets[1].keys()), "{:?}", sets[0].keys());
    let mut counts = Counts::default();
    let mut now = 1;
    for (i, moment) in moments.enumerate() {
        let next = 1 - now;
        turn(&bench, next);
        let before: Vec<u64> = sets[0].keys().map(|name| fs::metadata(bench.path(name)).unwrap().ino()).collect();
        let placed = || {
            let inode = |name: &String| fs::metadata(bench.path(name)).map_or(0, |metadata| metadata.ino());
            sets[0].keys().map(inode).zip(&before).filter(|(now, before)| now != *before).count()
        };
        let mut run = start(&bench, BATCH);
        let start = Instant::now();
        loop {
            let met = match moment {
                Moment::After(time) => start.elapsed() >= time,
                Moment::Staged => !hidden(&bench).is_empty(),
                Moment::Marked => markers(&bench) > 0,
                Moment::Placed(count) => placed() >= count,
            };
            if met || run.try_wait().unwrap().is_some() {
                break;
            }
        }
        // It may have ended by itself.
        let _ = run.kill();
        run.wait().unwrap();
        let found = results(&bench);
        if found == sets[now] {
            counts.old += 1;
        } else if found == sets[next] {
            counts.new += 1;
        } else {
            counts.marked += 1;
            assert!(markers(&bench) == 2, "{moment:?}, run {i}: a mixed set that does not say so");
            for (name, bytes) in &found {
                assert!(*bytes == sets[0][name] || *bytes == sets[1][name], "{moment:?}, run {i}: half of {name}");
            }
        }
        // The next run of anything finishes the set, or removes what was left of it.
        let left = bench.run("compensate part.mod --cell cell.toml --out-dir out --report other.csv").exits(0);
        let finished =
            results(&bench).into_iter().filter(|(name, _)| sets[0].contains_key(name)).collect::<BTreeMap<_, _>>();
        let which: Vec<_> = finished
            .iter()
            .map(|(name, bytes)| (name, *bytes == sets[now][name], *bytes == sets[next][name]))
            .collect();
        assert!(finished == sets[now] || finished == sets[next], "{moment:?}, run {i}: {which:?} {}", left.stderr);
        assert_eq!((hidden(&bench), markers(&bench)), (Vec::new(), 0), "{moment:?}, run {i}");
        for name in ["out/part.mod", "out/part.report.csv", "other.csv"] {
            fs::remove_file(bench.path(name)).unwrap();
        }
        now = if finished == sets[now] { now } else { next };
    }
    counts
}

/// How a run is ended.
#[derive(Clone, Copy, Debug)]
enum End {
    Killed,
    HungUp,
}

/// Ends simulations at so many moments; what is there then is old, new, or marked, and whole after the next run.
fn end_simulations(count: usize, end: End) -> Counts {
    let bench = batch();
    fs::create_dir(bench.path("out")).unwrap();
    let mut sets = Vec::new();
    let (mut counts, mut whole) = (Counts::default(), Duration::ZERO);
    for force in 0..2 {
        bench.write("stock.toml", stock(force));
        let begun = Instant::now();
        assert!(ended(&bench, SIMULATION).success());
        whole = begun.elapsed();
        sets.push(results(&bench));
    }
    assert!(sets[0].len() == 4 && sets[0] != sets[1], "{:?}", sets[0].keys());
    // From here on it has two names, and is written in place.
    fs::hard_link(bench.path("all.html"), bench.path("other.html")).unwrap();
    let mut now = 1;
    for i in 0..count {
        let next = 1 - now;
        bench.write("stock.toml", stock(next));
        let mut run = start(&bench, SIMULATION);
        std::thread::sleep(whole.mul_f64(1.1 * (0.618_033_988_749_895 * i as f64).fract()));
        match end {
            End::Killed => drop(run.kill()),
            End::HungUp => {
                // It may have ended by itself.
                let _ = Command::new("kill").args(["-HUP", &run.id().to_string()]).stderr(Stdio::null()).status();
            }
        }
        run.wait().unwrap();
        let found = results(&bench);
        if found == sets[now] {
            counts.old += 1;
        } else if found == sets[next] {
            counts.new += 1;
        } else {
            counts.marked += 1;
            assert!(matches!(end, End::Killed) && markers(&bench) > 0, "run {i}: a mixed set that does not say so");
        }
        if matches!(end, End::HungUp) {
            assert_eq!((hidden(&bench), markers(&bench)), (Vec::new(), 0), "run {i}");
        }
        // A run that writes to both folders finishes the set.
        bench.run("compensate part.mod --cell cell.toml -o out/other.mod --report other.csv").exits(0);
        for name in ["out/other.mod", "other.csv"] {
            fs::remove_file(bench.path(name)).unwrap();
        }
        let finished = results(&bench);
        assert!(finished == sets[now] || finished == sets[next], "run {i}");
        assert_eq!(bench.read("all.html"), bench.read("other.html"), "run {i}");
        assert_eq!((hidden(&bench), markers(&bench)), (Vec::new(), 0), "run {i}");
        now = if finished == sets[now] { now } else { next };
    }
    counts
}

#[test]
fn simulations_are_ended_without_a_trace() {
    end_simulations(8, End::Killed);
    end_simulations(4, End::HungUp);
}

#[test]
#[ignore = "minutes: cargo test --test suite -- --ignored --nocapture cli::durable"]
fn a_thousand_simulations_are_killed_and_two_hundred_hung_up() {
    println!("killed: {:?}", end_simulations(1000, End::Killed));
    println!("hung up: {:?}", end_simulations(200, End::HungUp));
}

/// Spread over the time that a run takes, in no order.
fn random(count: usize) -> impl Iterator<Item = Moment> {
    let bench = batch();
    let start = Instant::now();
    assert!(ended(&bench, BATCH).success());
    let whole = start.elapsed();
    let golden = 0.618_033_988_749_895;
    (0..count).map(move |i| Moment::After(whole.mul_f64(1.1 * (golden * i as f64).fract())))
}

fn aimed(count: usize) -> impl Iterator<Item = Moment> {
    (0..count).map(|i| match i % 10 {
        0 => Moment::Staged,
        1 | 2 => Moment::Marked,
        at => Moment::Placed(at - 2),
    })
}

#[test]
fn a_kill_leaves_all_old_or_all_new_or_says_so() {
    kill_at(random(6).chain(aimed(10)));
}

#[test]
#[ignore = "minutes: cargo test --test suite -- --ignored --nocapture cli::durable"]
fn a_thousand_random_and_two_hundred_aimed_kills() {
    println!("random: {:?}", kill_at(random(1000)));
    println!("aimed: {:?}", kill_at(aimed(200)));
}

/// Two runs at once that write the same files.
fn two_writers(times: usize) -> [usize; 2] {
    let bench = batch();
    let cells: Vec<String> = (0..2).map(|force| format!("cell{force}.toml")).collect();
    let with = |cell: &str| {
        BATCH
            .iter()
            .map(|argument| if *argument == "cell.toml" { cell.to_owned() } else { (*argument).to_owned() })
            .collect()
    };
    let mut sets = Vec::new();
    for (force, cell) in cells.iter().enumerate() {
        turn(&bench, force);
        fs::rename(bench.path("cell.toml"), bench.path(cell)).unwrap();
        let arguments: Vec<String> = with(cell);
        assert!(ended(&bench, &arguments.iter().map(String::as_str).collect::<Vec<_>>()).success());
        sets.push(results(&bench));
    }
    let mut last = [0; 2];
    for i in 0..times {
        let mut runs: Vec<Child> = cells
            .iter()
            .map(|cell| {
                let arguments: Vec<String> = with(cell);
                start(&bench, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
            })
            .collect();
        assert!(runs.iter_mut().all(|run| run.wait().unwrap().success()));
        let found = results(&bench);
        let which = sets.iter().position(|set| *set == found);
        last[which.unwrap_or_else(|| panic!("run {i}: outputs of two runs are mixed"))] += 1;
        assert_eq!((hidden(&bench), markers(&bench)), (Vec::new(), 0));
    }
    last
}

#[test]
fn two_writers_do_not_mix() {
    two_writers(3);
}

#[test]
#[ignore = "a minute: cargo test --test suite -- --ignored --nocapture cli::durable"]
fn two_hundred_runs_of_two_writers() {
    println!("{:?}", two_writers(200));
}

/// Runs the batch where no file can be longer than so many blocks of 512 bytes, as on a disk that is full then.
fn limited(bench: &Bench, blocks: usize) -> ExitStatus {
    let command = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    Command::new("sh")
        .args(["-c", &command, env!("CARGO_BIN_EXE_deflex")])
        .args(BATCH)
        .current_dir(bench.path("."))
        .stderr(Stdio::null())
        .status()
        .unwrap()
}

/// Fills the disk at every size of file: how many runs failed.
fn full_disk(step: usize) -> usize {
    let bench = batch();
    turn(&bench, 0);
    assert!(ended(&bench, BATCH).success());
    let old = results(&bench);
    turn(&bench, 1);
    for blocks in (0..100_000).step_by(step) {
        if limited(&bench, blocks).success() {
            assert!(blocks > 0 && results(&bench) != old);
            return blocks / step;
        }
        assert!(results(&bench) == old, "{blocks} blocks");
        assert_eq!((hidden(&bench), markers(&bench)), (Vec::new(), 0), "{blocks} blocks");
    }
    panic!("it never succeeds");
}

#[test]
fn a_full_disk_leaves_all_as_it_was() {
    full_disk(60);
}

#[test]
#[ignore = "a minute: cargo test --test suite -- --ignored --nocapture cli::durable"]
fn a_full_disk_at_every_block() {
    println!("{} runs failed", full_disk(1));
}

#[test]
fn an_input_that_changes_while_it_is_read_is_noticed() {
    let bench = Bench::new();
    bench.write("context.mod", "MODULE Other\nENDMODULE\n");
    assert!(Command::new("mkfifo").arg(bench.path("forces.csv")).status().unwrap().success());
    let arguments = "compensate part.mod --cell cell.toml --context context.mod --forces forces.csv -o out.mod";
    for later in ["MODULE Other\nENDMODULE\n! more\n", "MODULE Othex\nENDMODULE\n"] {
        let run = Command::new(env!("CARGO_BIN_EXE_deflex"))
            .args(arguments.split(' '))
            .current_dir(bench.path("."))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // The context is read before the forces, which come when it has changed.
        let mut pipe = fs::OpenOptions::new().write(true).open(bench.path("forces.csv")).unwrap();
        bench.write("context.mod", later);
        std::io::Write::write_all(&mut pipe, b"target,fx_n,fy_n,fz_n\n1,0,0,0\n2,1,2,3\n3,1,2,3\n4,1,2,3\n").unwrap();
        drop(pipe);
        let output = run.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains("changed while it was read"), "{said}");
        assert!(!bench.path("out.mod").exists() && hidden(&bench).is_empty());
    }
}

#[test]
fn a_file_without_write_permission_is_not_replaced() {
    let bench = Bench::new();
    bench.write("out.mod", "old");
    fs::set_permissions(bench.path("out.mod"), PermissionsExt::from_mode(0o444)).unwrap();
    let said = bench.run(RUN).exits(2).stderr;
    assert!(said.contains("out.mod") && said.contains("read-only"), "{said}");
    assert_eq!(bench.read("out.mod"), "old");
    assert!(!bench.path("out.csv").exists());
}

#[test]
fn a_file_is_saved_as_an_editor_does() {
    let bench = Bench::new();
    fs::create_dir(bench.path("there")).unwrap();
    bench.write("there/out.mod", "old").write("out.csv", "old");
    symlink("there/out.mod", bench.path("out.mod")).unwrap();
    fs::hard_link(bench.path("out.csv"), bench.path("other.csv")).unwrap();
    fs::set_permissions(bench.path("there/out.mod"), PermissionsExt::from_mode(0o640)).unwrap();
    bench.run(RUN).exits(0);
    assert!(fs::symlink_metadata(bench.path("out.mod")).unwrap().is_symlink());
    assert_eq!(fs::metadata(bench.path("there/out.mod")).unwrap().permissions().mode() & 0o777, 0o640);
    assert!(bench.read("there/out.mod").starts_with("MODULE"));
    assert_eq!(bench.read("out.csv"), bench.read("other.csv"));
    assert!(bench.read("other.csv").starts_with("target,"));
    // A link to nothing yet.
    symlink("there/new.mod", bench.path("new.mod")).unwrap();
    bench.run("compensate part.mod --cell cell.toml -o new.mod").exits(0);
    assert_eq!(bench.read("there/new.mod"), bench.read("out.mod"));
    assert!(fs::symlink_metadata(bench.path("new.mod")).unwrap().is_symlink());
}

/// A run's ID, and what would be its files.
const ID: &str = "0123456789abcdef0123456789abcdef";

/// A marker in the form of a killed run's, for one waiting file that is what it says.
fn plant(bench: &Bench, folder: &str, waits: &str, target: &str, how: &str) {
    let state = |path: &Path| {
        fs::symlink_metadata(path).ok().map(|metadata| {
            let modified = metadata.mtime() * 1_000_000_000 + metadata.mtime_nsec();
            let own = [metadata.dev(), metadata.ino(), 0, 0];
            serde_json::json!({ "length": metadata.len(), "modified_ns": modified, "own": own })
        })
    };
    let at = |name: &str| bench.path(folder).join(name);
    let sha = Command::new("sha256sum").arg("--").arg(at(waits)).output().unwrap();
    let sha = String::from_utf8(sha.stdout).unwrap();
    let entry = serde_json::json!({
        "waits": waits, "target": target, "how": how, "sha256": sha.split(' ').next(),
        "staged": state(&at(waits)), "before": state(&at(target)),
    });
    let folders = [fs::canonicalize(bench.path(folder)).unwrap()];
    let marker = serde_json::json!({ "deflex": "", "folders": folders, "files": [entry] });
    bench.write(&format!("{folder}/deflex-unfinished-{ID}.json"), marker.to_string());
}

#[test]
fn an_input_of_an_unfinished_set_is_reported() {
    let bench = Bench::new();
    let waits = format!(".deflex-{ID}-0.tmp");
    bench.write(&waits, "new");
    plant(&bench, ".", &waits, "part.mod", "rename");
    let said = bench.run("predict part.mod --cell cell.toml").exits(0).stderr;
    assert!(said.contains("part.mod") && said.contains("unfinished"), "{said}");
}

/// A marker can be written by anyone: it moves, removes and overwrites nothing but what its run has staged.
#[test]
fn a_planted_marker_touches_no_file() {
    let bench = Bench::new();
    fs::create_dir(bench.path("out")).unwrap();
    bench.write("victim", "mine").write("out/mine.txt", "mine").write("out/other.txt", "theirs");
    let waits = format!(".deflex-{ID}-0.tmp");
    let run = "predict part.mod --cell cell.toml --report out/r.csv -q";
    let marker = format!("out/deflex-unfinished-{ID}.json");
    let unharmed = |what: &str, said: &str| {
        assert!(said.contains("does not use this marker"), "{what}: {said}");
        let files = ["victim", "out/mine.txt", "out/other.txt"].map(|name| bench.read(name));
        assert_eq!(files, ["mine", "mine", "theirs"], "{what}");
        assert!(bench.path("out/r.csv").exists());
    };
    // The marker of versions before, and one with a name that no run has.
    let victim = bench.path("victim");
    for name in ["out/deflex-unfinished-1-1.json", &marker] {
        let entry = serde_json::json!({ "waits": victim, "target": "/nowhere", "how": "rename", "before": null });
        bench.write(name, serde_json::json!({ "deflex": "", "files": [entry] }).to_string());
        unharmed(name, &bench.run(run).exits(0).stderr);
        fs::remove_file(bench.path(name)).unwrap();
    }
    // Names that lead out of the folder or are no staged files, in the form of today.
    for (name, target) in [("../victim", "new"), ("mine.txt", "new"), ("mine.txt", "other.txt")] {
        plant(&bench, "out", name, target, "rename");
        unharmed(name, &bench.run(run).exits(0).stderr);
    }
    bench.write(&format!("out/{waits}"), "planted");
    for target in ["../victim", "../new"] {
        plant(&bench, "out", &waits, target, "overwrite");
        unharmed(target, &bench.run(run).exits(0).stderr);
    }
    // A file that is not the one that was staged: another inode, a link, other bytes.
    plant(&bench, "out", &waits, "mine.txt", "rename");
    fs::copy(bench.path(&format!("out/{waits}")), bench.path("out/copy")).unwrap();
    fs::rename(bench.path("out/copy"), bench.path(&format!("out/{waits}"))).unwrap();
    unharmed("a copy", &bench.run(run).exits(0).stderr);
    fs::remove_file(bench.path(&format!("out/{waits}"))).unwrap();
    symlink("../victim", bench.path(&format!("out/{waits}"))).unwrap();
    plant(&bench, "out", &waits, "new", "rename");
    unharmed("a link", &bench.run(run).exits(0).stderr);
    assert!(!bench.path("new").exists() && !bench.path("out/new").exists());
    // A pipe where a marker or a lock would be does not hang.
    fs::remove_file(bench.path(&marker)).unwrap();
    for name in [marker.clone(), format!("out/.deflex-{ID}.lock")] {
        assert!(Command::new("mkfifo").arg(bench.path(&name)).status().unwrap().success());
    }
    unharmed("a pipe", &bench.run(run).exits(0).stderr);
    assert!(bench.path(&format!("out/{waits}")).symlink_metadata().is_ok());
}

/// Holds a lock on a folder while it lives.
fn hold(bench: &Bench, folder: &str) -> fs::File {
    let held = fs::File::open(bench.path(folder)).unwrap();
    held.lock().unwrap();
    held
}

#[test]
fn a_lock_that_is_never_given_back_ends_the_run() {
    let bench = Bench::new();
    let held = hold(&bench, ".");
    let before = bench.names("");
    let said = bench.run(&format!("{RUN} --lock-timeout 2")).exits(2).stderr;
    assert!(said.contains("waiting for at most 2 s") && said.contains("has held a lock"), "{said}");
    assert_eq!(bench.names(""), before);
    // A signal ends the wait at once.
    for signal in ["INT", "TERM", "HUP"] {
        let mut run = start(&bench, &RUN.split(' ').collect::<Vec<_>>());
        let begun = Instant::now();
        std::thread::sleep(Duration::from_millis(2500));
        let pid = run.id().to_string();
        assert!(Command::new("kill").args([&format!("-{signal}"), &pid]).status().unwrap().success());
        assert_eq!(run.wait().unwrap().code(), Some(130), "{signal}");
        assert!(begun.elapsed() < Duration::from_secs(20), "{signal}");
        assert_eq!(bench.names(""), before, "{signal}");
    }
    drop(held);
    bench.run(RUN).exits(0);
}
