//! The CL reader on fixtures, one a dialect, and on anything.

use deflex::program::cl::{ClOptions, Point, Units, read};
use deflex::program::{Editable, Goal, Mark, Program, Role, round_trip};
use deflex::text::Source;
use proptest::prelude::*;
use std::fmt::Write;

fn options() -> ClOptions {
    ClOptions { tool: Some("tMill".into()), wobj: "wPart".into(), arc_tolerance_mm: 0.2, ..ClOptions::default() }
}

fn in_mm() -> ClOptions {
    ClOptions { units: Some(Units::Millimetre), ..options() }
}

fn reads(text: &str) -> Program {
    read(Source::new("test.cl", text), &in_mm()).expect("CL")
}

fn positions(program: &Program, role: Role) -> Vec<[f64; 3]> {
    let position = |goal| match goal {
        Goal::Axis { position_mm, .. } => position_mm,
        _ => panic!("CL targets have an axis"),
    };
    program.targets.iter().filter(|t| t.role == role).map(|t| position(t.goal)).collect()
}

/// One line a target, one a kept statement.
fn render(program: &Program) -> String {
    let mut out = String::new();
    let line = |out: &mut String, text: String| writeln!(out, "{text}").expect("string");
    line(&mut out, format!("{}: {} literal, {} arcs", program.dialect, program.literal_targets, program.arcs));
    if let Some(c) = program.cutter {
        line(&mut out, format!("cutter {} r {}", c.diameter_mm, c.corner_radius_mm));
    }
    for t in &program.targets {
        let Goal::Axis { position_mm: p, axis: a, .. } = t.goal else { panic!("CL targets have an axis") };
        let role = if t.role == Role::End { "" } else { " ." };
        let rapid = if t.rapid { " rapid" } else { "" };
        let feed = t.feed_mm_s.map_or(String::new(), |f| format!(" {f:.3} mm/s"));
        let rpm = t.spindle_rpm.map_or(String::new(), |r| format!(" {r:.1} rpm"));
        let mark = match t.mark {
            Some(Mark::Air) => " air",
            Some(Mark::Cut) => " cut",
            None => "",
        };
        let kept = match t.editable {
            Editable::No(reason) => format!(" ({reason})"),
            _ => String::new(),
        };
        let numbers = [p[0], p[1], p[2], a[0], a[1], a[2]].map(|v| format!("{:.4}", v + 0.0)).join(" ");
        line(&mut out, format!("{}{role} line {}: {numbers}{rapid}{feed}{rpm}{mark}{kept}", t.ordinal, t.line));
    }
    for kept in &program.kept {
        line(&mut out, format!("kept line {}: {}", kept.line, kept.reason));
    }
    for diagnostic in &program.diagnostics {
        line(&mut out, diagnostic.to_string());
    }
    out
}

#[test]
fn valid_fixtures_read_as_they_should_and_survive_a_write() {
    insta::glob!("../..", "fixtures/cl/valid/*", |path| {
        let bytes = std::fs::read(path).expect("fixture");
        let name = path.file_name().expect("name").to_string_lossy();
        let program = read(Source::new(name, bytes), &options()).expect("CL");
        let trip = round_trip(&program, |mut s, _| read(s.remove(0), &options()));
        assert!(trip.holds(), "{trip:?}");
        insta::assert_snapshot!(render(&program));
    });
}

#[test]
fn invalid_fixtures_are_refused_with_place_and_help() {
    insta::glob!("../..", "fixtures/cl/invalid/*", |path| {
        let bytes = std::fs::read(path).expect("fixture");
        let name = path.file_name().expect("name").to_string_lossy();
        let errors = read(Source::new(name, bytes), &options()).expect_err("no CL");
        let text: Vec<String> = errors.iter().map(|e| format!("{e}\n  help: {:?}", e.help)).collect();
        insta::assert_snapshot!(text.join("\n"));
    });
}

#[test]
fn nx_turns_clockwise_and_creo_counter_clockwise_about_the_same_axis() {
    let ends = "GOTO/0,10,0\n";
    let nx = reads(&format!("GOTO/-10,0,0\nCIRCLE/0,0,0,0,0,1,10,.06,.5,10,0\n{ends}"));
    let creo = reads(&format!("GOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\n{ends}"));
    for (program, sign) in [(nx, -1.0), (creo, 1.0)] {
        let way = positions(&program, Role::Interpolated);
        assert!(way.len() < 10, "a quarter turn, not three: {way:?}");
        assert!(way.iter().all(|p| p[0] * sign > 0.0 && p[1] > 0.0 && (p[0].hypot(p[1]) - 10.0).abs() < 1e-12));
        assert_eq!(program.arcs, 1);
        assert!(program.targets.iter().skip(1).all(|t| t.ordinal == 2));
    }
}

#[test]
fn rapid_holds_for_one_position_and_feed_comes_back() {
    let program = reads("FEDRAT/600,MMPM\nGOTO/0,0,0\nRAPID\nGOTO/1,0,0\nGOTO/2,0,0\n");
    let said: Vec<_> = program.targets.iter().map(|t| (t.rapid, t.feed_mm_s)).collect();
    assert_eq!(said, [(false, Some(10.0)), (true, None), (false, Some(10.0))]);
}

#[test]
fn centre_output_comes_down_to_the_tip_along_the_axis() {
    let options = ClOptions { point: Point::Centre, corner_radius_mm: Some(5.0), ..in_mm() };
    let program = read(Source::new("x", "GOTO/1,2,3,0.6,0,0.8\n"), &options).expect("CL");
    let [tip] = positions(&program, Role::End)[..] else { panic!("one target") };
    let off = [tip[0] - (1.0 - 3.0), tip[1] - 2.0, tip[2] - (3.0 - 4.0)];
    assert!(off.iter().all(|d| d.abs() < 1e-12), "{tip:?}");
    let missing = ClOptions { corner_radius_mm: None, ..options };
    assert_eq!(read(Source::new("x", "GOTO/1,2,3\n"), &missing).expect_err("no radius")[0].code, "cl.no-corner-radius");
}

#[test]
#[allow(clippy::float_cmp)] // quarter turns are exact
fn a_frame_named_later_is_seen_from_the_first() {
    let msys = |o: &str| format!("MSYS/{o},0,1,0,-1,0,0\n");
    let text = format!("TOOL PATH/A\nMSYS/10,0,0,1,0,0,0,1,0\nGOTO/1,2,3,0,0,1\n{}GOTO/1,2,3,1,0,0\n", msys("30,0,0"));
    let program = reads(&text);
    assert_eq!(positions(&program, Role::End), [[1.0, 2.0, 3.0], [18.0, 1.0, 3.0]]);
    let Goal::Axis { axis, .. } = program.targets[1].goal else { panic!("axis") };
    assert_eq!(axis, [0.0, 1.0, 0.0]);
}

#[test]
fn two_units_in_one_statement_are_no_unit() {
    let faults = |units: &str| reads(&format!("UNITS/{units}\nGOTO/1,2,3,0,0,1\nGOTO/2,2,3,0,0,1\n")).faults().len();
    assert_eq!([faults("INCHES,MM"), faults("MM,MM")], [1, 0]);
}

#[test]
fn edits_keep_field_widths_and_cards() {
    use deflex::program::{Change, RewriteOptions};
    let text = "UNITS/MM\nGOTO  /   20.40000,    0.00000,  -41.00000\n";
    let program = reads(text);
    let change = Change { position_mm: [120.4, 0.0, -41.25], quat: None, conf: None, external: None };
    let edits = program.rewrite(&[Some(change)], &[], &RewriteOptions::default()).edits;
    let out = deflex::text::applied(text.as_bytes(), &edits[0]);
    assert_eq!(String::from_utf8_lossy(&out), "UNITS/MM\nGOTO  /  120.40000,    0.00000,  -41.25000\n");
}

/// Chunks that real files are made of, so that random programs reach the meaning, not only the lexer.
fn statement() -> impl Strategy<Value = String> {
    let n = || (-500_i32..500).prop_map(|v| format!("{:.3}", f64::from(v) / 8.0));
    let xyz = || (n(), n(), n()).prop_map(|(x, y, z)| format!("{x},{y},{z}"));
    prop_oneof![
        4 => xyz().prop_map(|p| format!("GOTO/{p}")),
        2 => xyz().prop_map(|p| format!("GOTO/{p},0.6,0,0.8")),
        1 => xyz().prop_map(|p| format!("GODLTA/{p}")),
        1 => n().prop_map(|d| format!("GODLTA/{d}")),
        1 => (n(), n()).prop_map(|(x, r)| format!("GOTO/{x},0,0\nCIRCLE/0,0,0,0,0,1\nGOTO/0,{x},{r}")),
        1 => xyz().prop_map(|p| format!("FROM/{p}")),
        1 => xyz().prop_map(|p| format!("MSYS/{p},0,1,0,-1,0,0")),
        1 => xyz().prop_map(|p| format!("MSYS/{p},.6,.8,0,-.8,.6,0")),
        1 => Just("RAPID".to_owned()),
        1 => Just("UNITS/INCHES".to_owned()),
        1 => Just("UNITS/MM".to_owned()),
        1 => Just("FEDRAT/MMPM,500".to_owned()),
        1 => Just("GOTO/1,2,$ cut\n 3".to_owned()),
        1 => Just("CUTCOM/LEFT\nCUTCOM/OFF".to_owned()),
        1 => Just("FROB/1$$ x".to_owned()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        if let Ok(program) = read(Source::new("x", bytes), &in_mm()) {
            prop_assert_eq!(program.targets.iter().filter(|t| t.role == Role::End).count() as u32,
                program.targets.last().map_or(0, |t| t.ordinal));
        }
    }

    #[test]
    fn near_programs_are_read_or_refused(text in "[-GOTCIRLEDA/$,.() 0-9=\n\r'\"]{0,200}") {
        if let Ok(program) = read(Source::new("x", text), &in_mm()) {
            let trip = round_trip(&program, |mut s, _| read(s.remove(0), &in_mm()));
            prop_assert!(trip.identical, "{:?}", trip);
        }
    }

    #[test]
    fn every_program_survives_a_write(statements in proptest::collection::vec(statement(), 1..30)) {
        let text = format!("UNITS/MM\n{}", statements.join("\n"));
        // A shift that is the same in two frames bends the path that tells an arc's sense.
        prop_assume!(text.find("CIRCLE").is_none_or(|arc| text.rfind("MSYS").is_none_or(|frame| frame < arc)));
        let program = read(Source::new("x", text), &in_mm()).expect("CL");
        let trip = round_trip(&program, |mut s, _| read(s.remove(0), &in_mm()));
        prop_assert!(trip.holds(), "{:?}", trip);
    }
}
