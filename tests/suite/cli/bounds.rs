//! What is too large is refused before memory or time is spent on it, and what never ends is not read.

use super::bench::{Bench, CELL, cell_with_stock};
use std::fmt::Write;
use std::os::unix::fs::symlink;
use std::process::Command;
use std::time::{Duration, Instant};

/// Seconds that a refusal may take on a busy machine.
const SOON: Duration = Duration::from_secs(60);

/// The command is refused soon, with these words.
#[track_caller]
fn refused(bench: &Bench, command: &str, words: &[&str]) {
    let start = Instant::now();
    let said = bench.run(command).exits(2).stderr;
    assert!(words.iter().all(|word| said.contains(word)), "{said}");
    assert!(said.len() < 20_000 && start.elapsed() < SOON, "{} bytes after {:?}", said.len(), start.elapsed());
}

#[test]
fn a_stock_of_more_lines_than_fit_says_which_spacing_does() {
    let bench = Bench::new();
    let part = "[[-20, -20, -20], [120, 20, 1]]";
    for (keys, least) in [
        (format!("box_mm = {part}\nresolution_mm = 1e-6"), "at least"),
        ("box_mm = [[-1e9, -1e9, -1e9], [1e9, 1e9, 1]]\nresolution_mm = 1.0".to_owned(), "at least"),
        ("box_mm = [[-5e4, -5e4, -20], [5e4, 5e4, 1]]\nresolution_mm = 0.25".to_owned(), "at least"),
        ("box_mm = [[-100, -100, -20], [200, 100, 1]]\nresolution_mm = 0.01".to_owned(), "at least 0.0"),
    ] {
        bench.write("cell.toml", cell_with_stock(&keys));
        refused(&bench, "simulate part.mod --cell cell.toml", &["lines of the stock", "resolution_mm", least]);
    }
    // A cut falls between lines that are farther apart than the cutter is wide.
    bench.write("cell.toml", cell_with_stock(&format!("box_mm = {part}\nresolution_mm = 1000")));
    refused(&bench, "simulate part.mod --cell cell.toml", &["lines 1000 mm apart", "resolution_mm is at most"]);
    // What deflex chooses by itself fits.
    bench.write("cell.toml", cell_with_stock(&format!("box_mm = {part}")));
    bench.run("simulate part.mod --cell cell.toml --json out.json").exits(0);
}

#[test]
fn a_mesh_beyond_any_machine_is_refused() {
    let bench = Bench::new();
    let corners = [[0.0, 0.0, 0.0], [1e30, 0.0, 0.0], [0.0, 1e30, 0.0], [0.0, 0.0, 1e30]];
    let mut text = "solid far\n".to_owned();
    for triangle in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in triangle.map(|corner: usize| corners[corner]) {
            let _ = writeln!(text, "vertex {x:e} {y:e} {z:e}");
        }
        text += "endloop\nendfacet\n";
    }
    bench
        .write("far.stl", text + "endsolid far\n")
        .write("cell.toml", cell_with_stock("stl = \"far.stl\"\nresolution_mm = 0.5"));
    refused(&bench, "simulate part.mod --cell cell.toml", &["coordinates of an STL file", "in millimetres"]);
}

#[test]
fn a_cell_of_any_number_of_units_and_tools_is_counted_first() {
    let bench = Bench::new();
    let units = "[[unit]]\nname = \"U\"\naxis = \"eax_a\"\nkind = \"rotary\"\ncarries = \"part\"\n".repeat(100_000);
    bench.write("cell.toml", CELL.to_owned() + &units);
    refused(&bench, "predict part.mod --cell cell.toml", &["units ([[unit]]) of a cell: 100000"]);
    let mut tools = CELL.to_owned();
    for i in 0..100_000 {
        let _ = write!(tools, "[tools.t{i}]\ntcp_mm = [0, 0, 1]\ntcp_quat = [1, 0, 0, 0]\n");
    }
    bench.write("cell.toml", tools);
    refused(&bench, "predict part.mod --cell cell.toml", &["tools, or work objects, of a cell: 100001"]);
}

#[test]
fn a_table_of_any_number_of_columns_or_rows_is_counted_first() {
    let bench = Bench::new();
    let columns: String = (0..1_000_000).fold(String::new(), |mut text, i| {
        let _ = write!(text, ",c{i}");
        text
    });
    bench.write("wide.csv", format!("target,fx_n,fy_n,fz_n{columns}\n"));
    refused(&bench, "predict part.mod --cell cell.toml --forces wide.csv", &["columns of a table: 1000004"]);
    bench.write("long.csv", "target,x_mm,y_mm,z_mm\n".to_owned() + &"1,0,0,0\n".repeat(1_000_001));
    refused(
        &bench,
        "identify --run part.mod long.csv --cell cell.toml",
        &["rows of a measured file", "keep every second row"],
    );
}

#[test]
fn a_description_of_any_depth_is_read_or_refused() {
    let bench = Bench::new();
    let depth = 200_000;
    let mut chain = "<robot name=\"deep\"><link name=\"l0\"/>".to_owned();
    for i in 1..=depth {
        let _ = write!(
            chain,
            "<link name=\"l{i}\"/><joint name=\"j{i}\" type=\"fixed\"><parent link=\"l{}\"/><child link=\"l{i}\"/></joint>",
            i - 1
        );
    }
    bench.write("chain.urdf", chain + "</robot>");
    refused(&bench, "init --urdf chain.urdf", &["joints, or links, of a robot description"]);
    let nested =
        format!("<robot name=\"deep\">{}{}</robot>", "<link name=\"l\">".repeat(depth), "</link>".repeat(depth));
    bench.write("nested.urdf", nested);
    refused(&bench, "init --urdf nested.urdf", &["error"]);
}

#[test]
fn a_description_with_any_name_gives_a_cell_file() {
    let bench = Bench::new();
    let arm = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/seeds/arm.urdf")).unwrap();
    for name in ["a&quot;b\\", "\u{7f}\u{9b}", "&#9;&#10;x", "\u{2028}{u}"] {
        bench.write("arm.urdf", arm.replace("made &quot;up&quot;", name));
        let text = bench.run("init --urdf arm.urdf").exits(0).stdout;
        assert!(text.parse::<toml::Table>().is_ok(), "{name}: {text}");
    }
    for number in ["nan", "inf", "1e400"] {
        bench.write("arm.urdf", arm.replacen("0.645", number, 1));
        bench.run("init --urdf arm.urdf").exits(2);
    }
}

#[test]
fn a_backup_with_what_never_ends_is_read_without_it() {
    let bench = Bench::new();
    std::fs::create_dir_all(bench.path("backup/SYSPAR")).unwrap();
    std::fs::create_dir_all(bench.path("backup/RAPID/TASK1/PROGMOD")).unwrap();
    let cfg = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/seeds/backup.cfg")).unwrap();
    let (moc, module) = cfg.split_at(cfg.find("MODULE").unwrap());
    bench.write("backup/SYSPAR/MOC.cfg", moc).write("backup/RAPID/TASK1/PROGMOD/user.mod", module);
    let folder = bench.path("backup/RAPID/TASK1/PROGMOD");
    assert!(Command::new("mkfifo").arg(folder.join("pipe.mod")).status().unwrap().success());
    symlink("/dev/zero", folder.join("zero.mod")).unwrap();
    let text = bench.run("init --backup backup --robot irb6660-205-1.9").exits(0).stdout;
    assert!(text.contains("[tools.tMill]"), "{text}");
    std::fs::remove_file(bench.path("backup/SYSPAR/MOC.cfg")).unwrap();
    symlink("/dev/zero", bench.path("backup/SYSPAR/MOC.cfg")).unwrap();
    refused(&bench, "init --backup backup --robot irb6660-205-1.9", &["is not a file"]);
}

#[test]
fn what_xml_has_no_place_for_is_replaced_in_junit() {
    let bench = Bench::new();
    let name = "p\u{fffe}q\u{ffff}.mod";
    bench.write(name, super::bench::PROGRAM);
    let xml = bench.run(&format!("check {name} --cell cell.toml --max-error 0.001 --format junit")).exits(1).stdout;
    assert!(!xml.contains(['\u{fffe}', '\u{ffff}']) && xml.contains("p\u{fffd}q\u{fffd}.mod"), "{xml}");
}

/// Each script that a browser runs stands in the page's policy by its hash, and nothing else may run.
#[test]
fn only_the_scripts_of_the_page_may_run() {
    use base64::Engine;
    use sha2::{Digest, Sha256};
    let bench = Bench::new();
    bench.run("predict part.mod --cell cell.toml --html out.html --report out.csv").exits(0);
    let page = bench.read("out.html");
    let policy = page.split("Content-Security-Policy\" content=\"").nth(1).unwrap().split('"').next().unwrap();
    let allowed = policy.split(';').find_map(|rule| rule.trim().strip_prefix("script-src ")).unwrap();
    let scripts = page.split("<script>").skip(1).map(|rest| rest.split("</script>").next().unwrap());
    let hash = |text: &str| base64::prelude::BASE64_STANDARD.encode(Sha256::digest(text));
    let hashes: Vec<String> = scripts.map(|script| format!("'sha256-{}'", hash(script))).collect();
    assert!(hashes.len() >= 2 && allowed.split(' ').eq(hashes.iter()), "{allowed} {hashes:?}");
    assert!(!page.contains("javascript:") && !page.contains(" onclick="));
}
