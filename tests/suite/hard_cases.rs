//! The hard cases of `samples/`: what their table says, through the binary, and what each is about.

use assert_cmd::Command;
use deflex::program::cl::{ClOptions, Units, read};
use deflex::program::{Goal, Program, Role};
use deflex::text::Source;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/hard-cases")
}

/// File, motions and kept targets of each row of the table.
fn table() -> Vec<(String, usize, usize)> {
    let text = std::fs::read_to_string(folder().join("README.md")).unwrap();
    let mut rows = Vec::new();
    for line in text.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let (motions, kept) = (cells[3].parse().unwrap(), cells[4].parse().unwrap());
        for file in cells[1].split(", ") {
            rows.push((file.trim_matches('`').to_owned(), motions, kept));
        }
    }
    rows
}

fn deflex(arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("deflex"));
    let output = command.current_dir(folder()).env("NO_COLOR", "1").args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

fn json(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn every_file_stands_in_the_table() {
    let mut listed: Vec<String> = table().into_iter().map(|row| row.0).collect();
    let entries = std::fs::read_dir(folder()).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    let mut found: Vec<String> = entries.filter(|name| name != "README.md" && name != "cell.toml").collect();
    listed.sort();
    found.sort();
    assert_eq!(listed, found);
}

#[test]
fn each_is_read_as_the_table_says_and_survives_a_write() {
    for (file, motions, _) in table() {
        let (code, stdout, stderr) = deflex(&["inspect", &file, "--json"]);
        assert_eq!(code, Some(0), "{file}: {stderr}");
        let read = &json(&stdout)["files"][0];
        assert!(read["refused"].is_null(), "{file}: {read}");
        assert_eq!(read["round_trip"], true, "{file}: {read}");
        assert_eq!(read["motion_targets"], motions, "{file}: {read}");
    }
}

#[test]
fn each_is_corrected_and_what_is_kept_is_said() {
    for (file, motions, kept) in table() {
        let out = TempDir::new().unwrap();
        let summary = out.path().join("summary.json");
        let arguments =
            ["compensate", &file, "--cell", "cell.toml", "--out-dir", out.path().to_str().unwrap(), "--json"];
        let (code, _, stderr) = deflex(&[&arguments[..], &[summary.to_str().unwrap()]].concat());
        assert_eq!(code, Some(0), "{file}: {stderr}");
        let said = json(&std::fs::read_to_string(summary).unwrap());
        let said = &said["files"][0];
        let reasons = said["kept"].as_array().unwrap();
        let count: u64 = reasons.iter().map(|reason| reason["count"].as_u64().unwrap()).sum();
        assert_eq!((said["targets"].as_u64(), count), (Some(motions as u64), kept as u64), "{file}: {said}");
        assert!(said["max_remaining_mm"].as_f64().unwrap() < 1e-3, "{file}: {said}");
    }
}

#[test]
fn what_is_not_a_number_of_a_target_comes_out_as_it_went_in() {
    let out = TempDir::new().unwrap();
    let to = out.path().join("encoding.mod");
    assert_eq!(deflex(&["compensate", "encoding.mod", "--cell", "cell.toml", "-o", to.to_str().unwrap()]).0, Some(0));
    let text = |path: &Path| {
        let mut bytes = std::fs::read(path).unwrap();
        // Targets stand between the first bracket and the unused axes.
        bytes.retain(|b| !b.is_ascii_digit() && !matches!(b, b'-' | b'.'));
        bytes
    };
    assert_eq!(text(&folder().join("encoding.mod")), text(&to));
    let written = std::fs::read(&to).unwrap();
    assert!(written.starts_with(b"\xEF\xBB\xBF") && written.ends_with(b"ENDMODULE"));
    assert!(written.windows(3).any(|w| w == b"\r\r\n") && written.contains(&0) && written.contains(&0xE4));
}

#[test]
fn shared_declarations_get_clones_where_that_is_allowed() {
    let (code, kept, stderr) = deflex(&["compensate", "shared.mod", "--cell", "cell.toml"]);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(
        stderr.contains("5 targets: 2 corrected")
            && stderr.contains("2 kept: declared target used by motions whose corrections differ (2)"),
        "{stderr}"
    );
    assert_eq!(kept.matches("CONST robtarget").count(), 1);
    let (code, cloned, stderr) = deflex(&["compensate", "shared.mod", "--cell", "cell.toml", "--allow-clones"]);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(!stderr.contains("kept"), "{stderr}");
    assert!(cloned.matches("CONST robtarget").count() > 1, "{cloned}");
}

#[test]
fn subdividing_gives_posted_programs_more_points() {
    let moves = |arguments: &[&str]| {
        let common = ["compensate", "increments.apt", "--cell", "cell.toml"];
        let (code, stdout, stderr) = deflex(&[&common[..], arguments].concat());
        assert_eq!(code, Some(0), "{stderr}");
        stdout.matches("Move").count()
    };
    assert!(moves(&["--subdivide", "0.0001"]) > moves(&[]));
}

fn cl(file: &str) -> Program {
    let options = ClOptions {
        tool: Some("tMill".into()),
        wobj: "wPart".into(),
        units: Some(Units::Millimetre),
        arc_tolerance_mm: 0.01,
        ..ClOptions::default()
    };
    read(Source::new(file, std::fs::read(folder().join(file)).unwrap()), &options).unwrap()
}

fn positions(program: &Program) -> Vec<[f64; 3]> {
    let position = |goal| if let Goal::Axis { position_mm, .. } = goal { position_mm } else { panic!("an axis") };
    program.targets.iter().map(|target| position(target.goal)).collect()
}

#[test]
fn one_path_in_two_frames_agrees_to_the_printed_digit() {
    const APART_MM: [f64; 3] = [12.0625, -7.5, 0.0];
    let (a, b) = (positions(&cl("creo_a.ncl")), positions(&cl("creo_b.ncl")));
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(&b) {
        assert!((0..3).all(|i| (b[i] - a[i] - APART_MM[i]).abs() < 1e-10), "{a:?} {b:?}");
    }
}

#[test]
fn arcs_take_the_short_way_that_their_dialect_means() {
    for file in ["nx_modal.cls", "catia_cut.aptsource"] {
        let program = cl(file);
        let mut from = None;
        let mut lengths = std::collections::BTreeMap::<u32, (f64, bool)>::new();
        for (target, at) in program.targets.iter().zip(positions(&program)) {
            let step = from.map_or(0.0, |from: [f64; 3]| (at[0] - from[0]).hypot(at[1] - from[1]));
            let arc = lengths.entry(target.ordinal).or_default();
            arc.0 += step;
            arc.1 |= target.role == Role::Interpolated;
            from = Some(at);
        }
        let arcs: Vec<f64> = lengths.into_values().filter(|(_, arc)| *arc).map(|(length, _)| length).collect();
        assert_eq!(arcs.len(), program.arcs, "{file}");
        // Quarters of circles of 20 and 30 mm, never their complements.
        let quarter = if file == "nx_modal.cls" { 20.0 } else { 30.0 } * std::f64::consts::FRAC_PI_2;
        assert!(arcs.iter().all(|length| (length - quarter).abs() < 0.1), "{file}: {arcs:?}");
    }
}

#[test]
fn flipped_quaternions_are_one_orientation() {
    let (code, written, stderr) = deflex(&["compensate", "signs.mod", "--cell", "cell.toml"]);
    assert_eq!(code, Some(0), "{stderr}");
    let signs: Vec<bool> = written.lines().filter(|l| l.contains("MoveL")).map(|l| l.contains(",-0.9998")).collect();
    assert_eq!(signs, [false, true, false, true, false, true], "hemispheres are kept: {written}");
    let out = TempDir::new().unwrap();
    let to = out.path().join("signs.mod");
    std::fs::write(&to, written).unwrap();
    let (code, changed, _) = deflex(&["diff", "signs.mod", to.to_str().unwrap()]);
    assert_eq!(code, Some(1));
    assert!(!changed.contains("180."), "{changed}");
}

/// Corrected positions of the first motions of a program.
fn corrected(file: &Path) -> Vec<nalgebra::Vector3<f64>> {
    let (code, written, stderr) = deflex(&["compensate", file.to_str().unwrap(), "--cell", "cell.toml"]);
    assert_eq!(code, Some(0), "{stderr}");
    let program = deflex::program::rapid::read(vec![Source::new("corrected", written)], Vec::new()).unwrap();
    let position = |goal| if let Goal::Pose { position_mm, .. } = goal { position_mm.into() } else { panic!("a pose") };
    program.targets.iter().map(|target| position(target.goal)).collect()
}

/// A corrected arc is a circle through three corrected points. Between them it misses the correction's own bend: 9 µm of
/// 0.86 mm on this quarter of 100 mm, a hundredth of the correction and a tenth of what such a robot repeats.
#[test]
fn a_corrected_arc_passes_the_corrected_points_at_a_quarter_and_three_quarters() {
    const MISSED_MM: f64 = 0.012;
    let out = TempDir::new().unwrap();
    let file = out.path().join("points.mod");
    let mut text = "MODULE Points\nPROC main()\n".to_owned();
    for angle in [180.0_f64, 157.5, 135.0, 112.5, 90.0] {
        let (sin, cos) = angle.to_radians().sin_cos();
        text += &format!(
            "MoveL [[{:.5},{:.5},0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\\WObj:=wPart;\n",
            100.0 + 100.0 * cos,
            100.0 * sin
        );
    }
    std::fs::write(&file, text + "ENDPROC\nENDMODULE\n").unwrap();
    let points = corrected(&file);
    let arc = corrected(&folder().join("arc.mod"));
    assert!((arc[1] - points[2]).norm() < 1e-3, "the circle point is corrected like any other");
    let (u, v) = (arc[1] - arc[0], arc[2] - arc[0]);
    let normal = u.cross(&v).normalize();
    let planes = nalgebra::Matrix3::from_rows(&[u.transpose(), v.transpose(), normal.transpose()]);
    let offsets = nalgebra::Vector3::new(u.norm_squared() / 2.0, v.norm_squared() / 2.0, 0.0);
    let centre = planes.try_inverse().unwrap() * offsets;
    for point in [points[1], points[3]] {
        let from_centre = point - arc[0] - centre;
        let height = from_centre.dot(&normal);
        let missed = ((from_centre - height * normal).norm() - centre.norm()).hypot(height);
        assert!(missed < MISSED_MM, "{missed} mm off the corrected arc");
    }
}
