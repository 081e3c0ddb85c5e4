//! `--subdivide` in KRL: lines between, where they are right; else the reason.

use deflex::cell::Cell;
use deflex::correct::{Options, Summary, compensate};
use deflex::program::{Goal, Insert, Motion, Program, RewriteOptions, Role, krl, rapid};
use deflex::text::{Source, applied};
use std::fmt::Write;

fn read(text: &str) -> Program {
    krl::read(vec![Source::new("a.src", text)], Vec::new()).unwrap_or_else(|errors| panic!("{errors:?}"))
}

/// Inserts half way down before a target; the text, and why not.
fn inserted(program: &Program, before: usize) -> (String, Option<&'static str>) {
    let insert = Insert::line(before, ([5.0, 6.25, -0.5], [1.0, 0.0, 0.0, 0.0]), 3.0);
    let changes = vec![None; program.targets.len()];
    let rewritten = program.rewrite(&changes, &[insert.clone(), insert], &RewriteOptions::default());
    let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    let why = rewritten.not_inserted.first().map(|(_, why)| why.text());
    assert_eq!(rewritten.inserted.iter().all(Option::is_some), why.is_none());
    (String::from_utf8(out).unwrap(), why)
}

/// Frames, and the point at which the way to the next motion begins.
const BEGIN: &str = "$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.1\nLIN {X 0,Y 0,Z 0,A 0,B 0,C 0}\n";

#[test]
fn lines_between_keep_the_layout() {
    let new = "LIN {X 5.000,Y 6.250,Z -0.500,A 0.00000,B 0.00000,C 0.00000";
    for (statement, word) in [
        ("\tLIN {X 1,Y 2,Z 3,A 0,B 0,C 0} C_DIS C_DIS ; to the edge", "} C_DIS C_DIS"),
        ("  lin {E6POS: X 1,Y 2,Z 3,A 0,B 0,C 0}", "}"),
        ("LIN {X 1,Y 2,Z 3,A 0,B 0,C 0,E1 20.5} C_VEL", ",E1 20.500} C_VEL"),
        (";FOLD my path\nLIN {X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 3} C_DIS\n;ENDFOLD", "} C_DIS"),
    ] {
        for end in ["\n", "\r\n"] {
            let text = format!("DEF a()\n{BEGIN}{statement}\nEND\n").replace('\n', end);
            let at = text.to_ascii_uppercase().rfind("LIN {").unwrap();
            let indent = &text[text[..at].rfind('\n').unwrap() + 1..at];
            let line = format!("{new}{word}{end}{indent}");
            let (out, why) = inserted(&read(&text), 1);
            assert_eq!((out, why), (format!("{}{line}{line}{}", &text[..at], &text[at..]), None));
        }
    }
}

#[test]
fn splines_keep_their_words() {
    let text = format!("DEF a()\n{BEGIN}SLIN {{X 1,Y 2,Z 3,A 0,B 0,C 0}} WITH $VEL.CP=0.2 C_SPL\nEND\n");
    let (out, why) = inserted(&read(&text), 1);
    assert_eq!(why, None);
    assert!(
        out.contains("SLIN {X 5.000,Y 6.250,Z -0.500,A 0.00000,B 0.00000,C 0.00000} WITH $VEL.CP=0.2 C_SPL\n"),
        "{out}"
    );
}

#[test]
fn where_a_line_between_would_be_wrong_none_is_written() {
    let full = "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}";
    for (statements, before, reason) in [
        (
            format!("SPLINE\nSPL {{X 1,Y 2,Z 3,A 0,B 0,C 0}}\nS{full}\nENDSPLINE"),
            2,
            "in a spline block: a point between would make it another curve",
        ),
        (format!("{full}\nLIN {{X 4}}"), 2, "its position takes components from the motion before"),
        (
            format!("TRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[1]=TRUE\n{full}"),
            1,
            "a TRIGGER before it refers to this motion",
        ),
        // The output switches at the end of the next motion, and not of an inserted one.
        (
            format!("TRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[1]=TRUE\n$VEL.CP=0.02\n{full}"),
            1,
            "a TRIGGER before it refers to this motion",
        ),
        (format!("ON_ERROR_PROCEED\n{full}"), 1, "ON_ERROR_PROCEED before it is for this statement alone"),
        (
            format!("IF $IN[1] THEN\nLIN {{X 9,Y 2,Z 3,A 0,B 0,C 0}}\nENDIF\n{full}"),
            2,
            "the path to it begins at a point that is known only at run time",
        ),
        (format!("FOR i=1 TO 2\n{full}\nENDFOR"), 2, "the motion runs more than once, and so would an inserted point"),
        ("PTP {X 1,Y 2,Z 3,A 0,B 0,C 0}".into(), 1, "only lines and arcs can be subdivided"),
    ] {
        let text = format!("DEF a()\nDECL INT i\n{BEGIN}{statements}\nEND\n");
        let (out, why) = inserted(&read(&text), before);
        assert_eq!((out, why), (text, Some(reason)));
    }
    let form = format!(
        "DEF a()\n{BEGIN};FOLD LIN P1 CONT Vel=0.2 m/s CPDAT1;%{{PE}}%R 8.3\nLIN XP1 C_DIS C_DIS\n;ENDFOLD\nEND\n"
    );
    let data = "DEFDAT a\nDECL E6POS XP1={X 1,Y 2,Z 3,A 0,B 0,C 0}\nENDDAT\n";
    let program = krl::read(vec![Source::new("a.src", &form[..]), Source::new("a.dat", data)], Vec::new()).unwrap();
    let why = inserted(&program, 1).1;
    assert_eq!(why, Some("in an inline form, which the controller would rewrite without the inserted point"));
    // The same without the form: before the statement, not in the data list.
    let plain = form.replace(";%{PE}%R 8.3", "");
    let program = krl::read(vec![Source::new("a.src", plain), Source::new("a.dat", data)], Vec::new()).unwrap();
    let (out, why) = inserted(&program, 1);
    assert!(why.is_none() && out.contains("C 0.00000} C_DIS C_DIS\nLIN XP1 C_DIS C_DIS"), "{out}");
}

pub(super) const CELL: &str = r#"
[robot]
model = "irb6660-205-1.9"
start_deg = [0, 0, 0, 0, 30, 0]
[robot.stiffness]
joint_nm_per_rad = [1.0e6, 1.2e6, 9.0e5, 2.0e5, 2.2e5, 1.0e5]
[tools."TOOL_DATA[1]"]
tcp_mm = [10.0, -20.0, 200.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 20.0
cog_mm = [90.0, 0.0, 60.0]
[wobjs."BASE_DATA[1]"]
uframe_mm = [1100.0, -150.0, 300.0]
uframe_quat = [1.0, 0.0, 0.0, 0.0]
[cut]
force = "constant"
force_n = [310.0, -120.0, 260.0]
frame = "feed"
"#;

/// The same long lines and the same arc in both languages: as little is left on the way, and as many points are inserted.
#[test]
fn as_little_is_left_on_the_way_as_in_rapid() {
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let rapid_cell = CELL.replace("TOOL_DATA[1]", "tMill").replace("BASE_DATA[1]", "wPart");
    let rapid_cell = Cell::read(&Source::new("cell.toml", rapid_cell)).unwrap();
    let points = [[0.0, 0.0], [180.0, 0.0], [180.0, 140.0], [40.0, 140.0]];
    let (mut moves, mut lines) = (String::new(), String::new());
    let target = |x: f64, y: f64| format!("[[{x},{y},0],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
    let position = |x: f64, y: f64| format!("{{X {x},Y {y},Z 0,A 0,B 180,C 0}}");
    for [x, y] in points {
        let _ = writeln!(moves, "MoveL {},v50,z0,tMill\\WObj:=wPart;", target(x, y));
        let _ = writeln!(lines, "LIN {} C_DIS", position(x, y));
    }
    let _ = writeln!(moves, "MoveC {},{},v50,z0,tMill\\WObj:=wPart;", target(-30.0, 70.0), target(40.0, 0.0));
    let _ = writeln!(lines, "CIRC {},{} C_DIS", position(-30.0, 70.0), position(40.0, 0.0));
    let module = format!("MODULE M\nPROC main()\n{moves}ENDPROC\nENDMODULE\n");
    let rapid = rapid::read(vec![Source::new("m.mod", module)], Vec::new()).unwrap();
    let krl = read(&format!("DEF m()\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.05\n{lines}END\n"));
    let options = Options { subdivide: Some(5e-6), ..Options::default() };
    let [own, other] = [(&krl, &cell), (&rapid, &rapid_cell)].map(|(program, cell)| {
        let corrected = compensate(program, cell, &options).unwrap();
        assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
        let rewritten = corrected.rewritten.as_ref().unwrap();
        assert_eq!(rewritten.not_inserted, []);
        let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
        let left = Summary::of(&corrected.rows).remaining_path_rms_mm;
        (rewritten.inserted.len(), left, String::from_utf8(out).unwrap())
    });
    assert!(own.0 > 5 && own.0 == other.0, "{} {}", own.0, other.0);
    // Three decimals against four, and the last digit of the angles.
    assert!((own.1 - other.1).abs() < 1e-3 && own.1 < 0.012, "{} {}", own.1, other.1);
    // What is written reads as that many more points, the arc as several.
    let again = read(&own.2);
    let ends = again.targets.iter().filter(|target| target.role == Role::End).count();
    assert_eq!(ends, 5 + own.0);
    assert!(again.kept.is_empty() && again.targets.iter().filter(|t| t.motion == Motion::Circular).count() >= 4);
    assert!(again.targets.iter().all(|target| matches!(target.goal, Goal::Pose { .. })));
}
