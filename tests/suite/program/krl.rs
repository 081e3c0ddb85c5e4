//! KRL in and out: fixtures, random programs, and the same answers as RAPID for the same path.

use deflex::cell::Cell;
use deflex::correct::{self, Options};
use deflex::program::orientation::{from_zyx_deg, quaternion};
use deflex::program::{Change, Editable, Program, RewriteOptions, detect, krl, rapid, round_trip};
use deflex::text::{Diagnostic, Source};
use proptest::prelude::*;
use std::fmt::Write;
use std::path::Path;

fn folder(kind: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/krl").join(kind)
}

fn source(path: &Path) -> Source {
    Source::new(path.file_name().unwrap().to_string_lossy(), std::fs::read(path).unwrap())
}

/// A fixture with its data list.
fn fixture(name: &str) -> Vec<Source> {
    let path = folder("valid").join(name);
    vec![source(&path), source(&path.with_extension("dat"))]
}

fn survives(program: &Program) {
    let unchanged = program.rewrite(&vec![None; program.targets.len()], &[], &RewriteOptions::default());
    assert!(unchanged.edits.iter().all(Vec::is_empty));
    let proof = round_trip(program, krl::read);
    assert!(proof.holds(), "{:?}", proof.why);
}

#[test]
fn valid_fixtures_are_understood() {
    for name in ["forms.src"] {
        let program = krl::read(fixture(name), Vec::new()).unwrap_or_else(|errors| panic!("{name}: {errors:?}"));
        survives(&program);
        let mut said = String::new();
        for target in &program.targets {
            writeln!(
                said,
                "{:>3} {:?} {:?} {:?} tool {} base {} {:?} {:?} {:?}",
                target.line,
                target.motion,
                target.role,
                target.goal,
                program.tools[usize::from(target.tool)].name,
                program.wobjs[usize::from(target.wobj)].name,
                target.feed_mm_s,
                target.name,
                target.editable,
            )
            .unwrap();
        }
        for kept in &program.kept {
            writeln!(said, "kept {}:{} {}", kept.source, kept.line, kept.reason).unwrap();
        }
        writeln!(
            said,
            "{} motions, {} literals, {} arcs",
            program.motion_targets(),
            program.literal_targets,
            program.arcs
        )
        .unwrap();
        insta::with_settings!({ snapshot_suffix => name }, { insta::assert_snapshot!(said) });
    }
}

#[test]
fn loops_calls_and_chained_frames_are_run() {
    let program = krl::read(fixture("frames.src"), Vec::new()).unwrap_or_else(|errors| panic!("{errors:?}"));
    survives(&program);
    let at = |target: &deflex::program::Target| match target.goal {
        deflex::program::Goal::Pose { position_mm, .. } => position_mm.map(f64::round).to_vec(),
        _ => Vec::new(),
    };
    let found: Vec<Vec<f64>> = program.targets.iter().map(at).collect();
    // Axis angles, the four points, then the routine: 10 mm up, 25 mm along z, which looks down, and at 60 mm.
    let expected: [&[f64]; 8] = [
        &[],
        &[10.0, 0.0, 0.0],
        &[20.0, 0.0, 0.0],
        &[30.0, 0.0, 0.0],
        &[40.0, 0.0, 0.0],
        &[10.0, 0.0, 10.0],
        &[10.0, 0.0, -25.0],
        &[10.0, 0.0, 60.0],
    ];
    assert_eq!(found, expected);
    assert!(program.targets[5..].iter().all(|target| matches!(target.editable, Editable::No(_))));
    assert_eq!(program.targets[2].editable, Editable::Position);
}

#[test]
fn invalid_fixtures_are_refused_with_a_reason() {
    for (name, code) in
        [("cut.src", "krl.truncated"), ("nothing.src", "krl.no-routine"), ("endless.src", "krl.endless")]
    {
        let errors: Vec<Diagnostic> = krl::read(vec![source(&folder("invalid").join(name))], Vec::new()).unwrap_err();
        assert_eq!(errors[0].code, code, "{name}");
        assert!(errors[0].line > 0 && errors[0].help.is_some(), "{name}: {errors:?}");
    }
}

const CELL: &str = r#"
[robot]
model = "kr210-r2700-2"
[robot.stiffness]
joint_nm_per_rad = [1.9e6, 2.2e6, 1.4e6, 4.1e5, 3.6e5, 1.7e5]
[controller]
compensates = []
[tools."TOOL_DATA[1]"]
tcp_mm = [0.0, 0.0, 310.0]
tcp_quat = [0.9238795325112867, 0.0, 0.3826834323650898, 0.0]
mass_kg = 18.0
cog_mm = [0.0, 0.0, 120.0]
[tools.tMill]
tcp_mm = [0.0, 0.0, 310.0]
tcp_quat = [0.9238795325112867, 0.0, 0.3826834323650898, 0.0]
mass_kg = 18.0
cog_mm = [0.0, 0.0, 120.0]
[wobjs."BASE_DATA[2]"]
uframe_mm = [1450.0, -120.0, 800.0]
uframe_quat = [0.9659258262890683, 0.0, 0.0, 0.25881904510252074]
oframe_mm = [0.0, 0.0, 0.0]
oframe_quat = [1.0, 0.0, 0.0, 0.0]
[wobjs.wPart]
uframe_mm = [1450.0, -120.0, 800.0]
uframe_quat = [0.9659258262890683, 0.0, 0.0, 0.25881904510252074]
oframe_mm = [0.0, 0.0, 0.0]
oframe_quat = [1.0, 0.0, 0.0, 0.0]
[cut]
force = "constant"
force_n = [120.0, -260.0, 410.0]
frame = "wobj"
[[effect]]
kind = "gravity"
"#;

/// The same path under the same loads, once in each language.
#[test]
fn the_same_path_has_the_same_errors_and_corrections_as_in_rapid() {
    let cell = Cell::read(&Source::new("cell.toml", CELL.replace("[[effect]]\nkind = \"gravity\"\n", ""))).unwrap();
    let (mut krl_text, mut rapid_text) = (
        "DEF a()\r\n$TOOL=TOOL_DATA[1]\r\n$BASE=BASE_DATA[2]\r\n$VEL.CP=0.02\r\n".to_owned(),
        "MODULE a\nPROC main()\n".to_owned(),
    );
    let points: Vec<([f64; 3], [f64; 3])> = (0..12)
        .map(|i| {
            let t = f64::from(i);
            ([20.0 * t, 15.0 * t - 3.0, 5.0 * (t * 0.7).sin()], [140.0 + 2.0 * t, 1.0 + 0.5 * t, 178.0 - 0.5 * t])
        })
        .collect();
    for (at, angles) in &points {
        let [x, y, z] = at;
        let [a, b, c] = angles;
        write!(krl_text, "LIN {{X {x:.6},Y {y:.6},Z {z:.6},A {a:.6},B {b:.6},C {c:.6}}} C_DIS\r\n").unwrap();
        let [w, i, j, k] = quaternion(&from_zyx_deg(*angles));
        writeln!(
            rapid_text,
            "MoveL [[{x:.6},{y:.6},{z:.6}],[{w:.12},{i:.12},{j:.12},{k:.12}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,z1,tMill\\WObj:=wPart;"
        )
        .unwrap();
    }
    krl_text += "END\r\n";
    rapid_text += "ENDPROC\nENDMODULE\n";
    let in_krl = krl::read(vec![Source::new("a.src", krl_text)], Vec::new()).unwrap();
    let in_rapid = rapid::read(vec![Source::new("a.mod", rapid_text)], Vec::new()).unwrap();
    assert!(in_krl.targets.iter().all(|target| target.editable == Editable::Pose));
    let [one, other] =
        [&in_krl, &in_rapid].map(|program| correct::compensate(program, &cell, &Options::default()).unwrap());
    assert!(one.failures.is_empty() && one.rows.len() == points.len(), "{:?}", one.failures);
    for (a, b) in one.rows.iter().zip(&other.rows) {
        let close = |a: [f64; 3], b: [f64; 3], by: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= by);
        assert!(a.error_mm.iter().any(|e| e.abs() > 0.05), "{a:?}");
        // Orientations are printed to twelve digits of a quaternion, angles to six of a degree.
        assert!(close(a.error_mm, b.error_mm, 1e-6) && close(a.error_deg, b.error_deg, 1e-6), "{a:?} {b:?}");
        // Corrections to the printed digit: six decimals, as single precision holds them.
        assert!(
            close(a.correction_mm, b.correction_mm, 1e-4) && close(a.correction_deg, b.correction_deg, 5e-5),
            "{a:?} {b:?}"
        );
        assert!(close(a.remaining_mm, [0.0; 3], 2e-4), "{a:?}");
    }
}

/// Joint motions go to the posture that S and T name, and are corrected where it is that of the corrected arm as well.
#[test]
fn joint_motions_are_corrected_in_the_posture_that_they_name() {
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let mut text = "DEF a()\n; deflex cut\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[2]\n".to_owned();
    let all = || [2, 6].into_iter().flat_map(|s| (0..64).map(move |t| (s, t)));
    for (s, t) in all() {
        let t = if t % 2 == 0 { t.to_string() } else { format!("'B{t:06b}'") };
        writeln!(text, "PTP {{X 40.0,Y 25.0,Z 5.0,A 140.0,B 12.0,C 165.0,S {s},T {t},E1 0.0,E2 0.0}}").unwrap();
    }
    let program = krl::read(vec![Source::new("a.src", text + "END\n")], Vec::new()).unwrap();
    let corrected = correct::compensate(&program, &cell, &Options::default()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let ok: Vec<(i32, i32)> = all()
        .zip(&corrected.rows)
        .filter(|(_, row)| !matches!(row.status, correct::Status::Kept(_)))
        .map(|(at, _)| at)
        .collect();
    // Axes 4 and 6 reach each place in two turns.
    assert_eq!(ok.iter().filter(|(s, _)| *s == 2).count(), 4, "{ok:?}");
    assert_eq!(ok.iter().filter(|(s, _)| *s == 6).count(), 4, "{ok:?}");
    assert!(ok.iter().all(|(s, t)| (s >> 2 & 1) == (t >> 4 & 1)), "{ok:?}");
    let edits = corrected.rewritten.as_ref().unwrap();
    // One a position, all its numbers.
    assert_eq!((edits.kept.len(), edits.edits[0].len()), (120, 8));
}

/// Programs name external axes at zero also for robots without any. A robot with a track then stands at zero.
#[test]
fn axes_at_zero_throughout_are_there_or_not() {
    let track = "[[unit]]\nname = \"RAIL\"\naxis = \"eax_a\"\nkind = \"linear\"\ncarries = \"robot\"\ndirection = [0.0, 1.0, 0.0]\n";
    let read = |text: &str| Cell::read(&Source::new("cell.toml", text)).unwrap();
    let rows = |cell: &Cell, axis: &str| {
        let pose = |x: i32| format!("LIN {{X {x}.0,Y 25.0,Z 5.0,A 140.0,B 12.0,C 165.0{axis}}}\n");
        let text = format!("DEF a()\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[2]\n{}{}END\n", pose(40), pose(60));
        let program = krl::read(vec![Source::new("a.src", text)], Vec::new()).unwrap();
        correct::compensate(&program, cell, &Options::default()).unwrap().rows
    };
    let (plain, rail) = (read(CELL), read(&format!("{CELL}{track}")));
    let ok = |rows: &[correct::Row]| rows.iter().all(|row| row.status == correct::Status::Ok);
    let [without, at_zero] = [(&plain, ",E1 0.0,E2 0.0"), (&rail, ",E1 0.0,E2 0.0")].map(|(cell, e)| rows(cell, e));
    assert!(ok(&without) && ok(&at_zero));
    assert_eq!(without[1].correction_mm.map(f64::to_bits), at_zero[1].correction_mm.map(f64::to_bits));
    // An axis that is not at zero needs its unit, and a unit needs a stated position.
    assert!(!ok(&rows(&plain, ",E1 10.0")) && ok(&rows(&rail, ",E1 10.0")) && !ok(&rows(&rail, "")));
}

/// Statements of `grammars/krl.ebnf`, at random: whatever is read comes out as it went in, and a shift comes back.
fn statement() -> impl Strategy<Value = String> {
    let number = || {
        prop_oneof![
            (-900_000..900_000_i32).prop_map(|v| format!("{:.3}", f64::from(v) / 1e3)),
            (-900..900_i32).prop_map(|v| v.to_string()),
            Just("1.5E2".to_owned()),
            Just("-.5".to_owned()),
            Just("+7.".to_owned()),
        ]
    };
    let pose = (
        prop::array::uniform6(number()),
        prop::sample::select(vec!["", "E6POS: ", "FRAME:"]),
        prop::sample::select(vec!["", ",S 2,T 'B0010'", ",E1 0.0,E2 0.0", ", E1 12.5"]),
        prop::sample::select(vec![",", ", ", " ,\t"]),
    )
        .prop_map(|([x, y, z, a, b, c], kind, more, comma)| {
            format!("{{{kind}X {x}{comma}Y {y}{comma}Z {z}{comma}A {a}{comma}B {b}{comma}C {c}{more}}}")
        })
        .boxed();
    let name = prop::sample::select(vec!["XP1", "XP2", "gP[1]", "gP[i]", "gP[2]", "f"]);
    let word = prop::sample::select(vec!["LIN", "lin", "PTP", "SLIN", "SPTP", "SPL"]);
    let end = prop::sample::select(vec!["", " C_DIS", " C_VEL C_ORI", " ; {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}"]);
    prop_oneof![
        6 => (word.clone(), pose.clone(), end.clone()).prop_map(|(word, pose, end)| format!("{word} {pose}{end}")),
        4 => (word, name.clone(), end.clone()).prop_map(|(word, name, end)| format!("{word} {name}{end}")),
        1 => (pose.clone(), pose.clone(), end).prop_map(|(via, to, end)| format!("CIRC {via},{to}{end}")),
        1 => (name.clone(), pose.clone()).prop_map(|(name, pose)| format!("{name} = {pose}")),
        1 => (name.clone(), name.clone()).prop_map(|(a, b)| format!("{a} = {b}")),
        1 => (name.clone(), number()).prop_map(|(name, v)| format!("{name}.Z = {v}")),
        1 => (name.clone(), number()).prop_map(|(name, v)| format!("LIN {name}:{{X {v},Y 0,Z 0,A 0,B 0,C 0}}")),
        1 => (1..4_i32).prop_map(|n| format!("$BASE = BASE_DATA[{n}]")),
        1 => (0..4_i32).prop_map(|n| format!("BAS (#TOOL,{n})")),
        1 => prop::sample::select(vec![
            "$VEL.CP = 0.02", "WAIT SEC 0.5", "$OUT[1]=TRUE", "LIN_REL {Z 5}", "LIN {Z 50.0}", "i = i + 1", "sub(XP1)",
            "other()", ";FOLD", "; deflex air", "HALT", "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}", "PTP HOME", "LIN $POS_ACT",
        ]).prop_map(str::to_owned),
    ]
}

fn block() -> impl Strategy<Value = String> {
    let lines = || prop::collection::vec(statement(), 0..5).prop_map(|lines| lines.join("\r\n  "));
    prop_oneof![
        4 => lines(),
        1 => lines().prop_map(|body| format!("IF $IN[1] THEN\n{body}\nENDIF")),
        1 => (lines(), lines()).prop_map(|(a, b)| format!("IF i == 1 THEN\n{a}\nELSE\n{b}\nENDIF")),
        1 => lines().prop_map(|body| format!("FOR i = 1 TO 2\n{body}\nENDFOR")),
        1 => lines().prop_map(|body| format!("LOOP\n{body}\nIF $IN[2] THEN\nEXIT\nENDIF\nENDLOOP")),
        1 => lines().prop_map(|body| format!("WHILE i < 3\n{body}\ni = i + 1\nENDWHILE")),
        1 => lines().prop_map(|body| format!("SWITCH i\nCASE 1,2\n{body}\nDEFAULT\nRETURN\nENDSWITCH")),
        1 => lines().prop_map(|body| format!("SPLINE WITH $VEL.CP=0.5\n{body}\nENDSPLINE")),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_programs_survive_a_write(blocks in prop::collection::vec(block(), 1..6), sub in block()) {
        let text = format!(
            "&ACCESS RVP\r\nDEF a( )\r\nDECL INT i\nDECL FRAME f\ni = 1\n{}\nEND\nDEF sub(p:OUT)\n{sub}\nLIN p\nEND\n",
            blocks.join("\n"),
        );
        let data = "DEFDAT a PUBLIC\nDECL E6POS XP1={X 1.0,Y 2.0,Z 3.0,A 10.0,B 20.0,C 30.0,S 2,T 3}\n\
                    GLOBAL E6POS XP2={X 4.0,Y 5.0,Z 6.0,A 10.0,B 20.0,C 30.0}\nDECL FRAME gP[2]\n\
                    gP[1]={X 7.0,Y 8.0,Z 9.0,A 1.0,B 2.0,C 3.0}\ngP[2]={X 10.0,Y 11.0,Z 12.0,A 1.0,B 2.0,C 3.0}\nENDDAT\n";
        prop_assert_eq!(detect("a.txt", text.as_bytes()), Some(deflex::program::Language::Krl));
        let sources = vec![Source::new("a.src", text.clone()), Source::new("a.dat", data)];
        let program = krl::read(sources, Vec::new()).unwrap();
        survives(&program);
        prop_assert_eq!(program.literal_targets, counted(&text) + counted(data));
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300), at in 0..600_usize) {
        let mut text = std::fs::read(folder("valid").join("frames.src")).unwrap();
        let at = at.min(text.len());
        text.splice(at..at, bytes);
        if let Ok(program) = krl::look(vec![Source::new("a.src", text)], Vec::new()) {
            let unchanged = program.rewrite(&vec![None; program.targets.len()], &[], &RewriteOptions::default());
            prop_assert!(unchanged.edits.iter().all(Vec::is_empty));
        }
    }
}

/// Complete positions, counted by cutting the text at braces.
fn counted(text: &str) -> usize {
    let code = text.lines().map(|line| line.split(';').next().unwrap_or_default());
    let bodies =
        code.flat_map(|line| line.split('{').skip(1)).filter_map(|rest| rest.split_once('}')).map(|(body, _)| body);
    let complete = |body: &str| {
        let body = body.split_once(':').map_or(body, |(_, rest)| rest);
        let has = |key: &str| {
            body.split(',').any(|part| {
                let mut words = part.split_whitespace();
                words.next() == Some(key) && words.next().is_some_and(|v| v.parse::<f64>().is_ok())
            })
        };
        ["X", "Y", "Z", "A", "B", "C"].iter().all(|key| has(key))
    };
    bodies.filter(|body| complete(body)).count()
}

/// How near a motion with `C_DIS` passes its end is what `$APO.CDIS` is when it runs, where that is known; KUKA's own routines may set
/// it.
#[test]
fn the_distance_of_an_approximation_is_followed() {
    let zones = |body: &str| -> Vec<Option<f64>> {
        let point = "LIN {X 900.0,Y 0.0,Z 800.0,A 0.0,B 90.0,C 0.0}";
        let text = format!("DEF p()\nDECL INT I\nDECL REAL R\n{}\nEND\n", body.replace("LIN", point));
        let program = krl::read(vec![Source::new("p.src", text.into_bytes())], Vec::new()).unwrap();
        (0..program.targets.len()).map(|target| program.zone_mm(target)).collect()
    };
    assert_eq!(zones("$APO.CDIS=3\nLIN C_DIS\n$APO.CDIS=4.5\nLIN C_DIS\nLIN"), [Some(3.0), Some(4.5), None]);
    assert_eq!(zones("R=2.0\nFOR I=1 TO 2\n$APO.CDIS=R\nLIN C_DIS\nR=6.0\nENDFOR"), [Some(2.0), Some(6.0)]);
    assert_eq!(zones("$APO.CDIS=3\nIF $IN[1] THEN\n$APO.CDIS=9\nENDIF\nLIN C_DIS"), [None]);
    assert_eq!(zones("$APO.CDIS=3\nBAS(#VEL_CP,0.1)\nLIN C_DIS\nBAS(#PTP_DAT)\nLIN C_DIS"), [Some(3.0), None]);
    let act =
        "LDAT_ACT={VEL 2.0,ACC 100.0,APO_DIST 7.0,APO_FAC 50.0,ORI_TYP #VAR,CIRC_TYP #BASE}\nBAS(#CP_DAT)\nLIN C_DIS";
    assert_eq!(zones(act), [Some(7.0)]);
    // Speed and orientation have criteria of their own.
    assert_eq!(zones("$APO.CDIS=3\nLIN C_VEL\nLIN C_ORI"), [None, None]);
}

/// A number that is a distance of approximation too is not moved with the point.
#[test]
fn a_number_that_a_zone_reads_stays() {
    let edits = |zone: &str| {
        let text = format!(
            "DEF p()\nDECL REAL R\nDECL POS XP\nR=900.0\nXP={{X 0.0,Y 0.0,Z 800.0,A 0.0,B 90.0,C 0.0}}\n{zone}XP.X=R\nLIN XP C_DIS\nEND\n"
        );
        let program = krl::read(vec![Source::new("p.src", text.into_bytes())], Vec::new()).unwrap();
        let change = Change { position_mm: [901.0, 0.0, 800.0], quat: None, conf: None, external: None };
        program.rewrite(&[Some(change)], &[], &RewriteOptions::default()).edits[0].len()
    };
    assert_eq!(edits(""), 1);
    assert_eq!(edits("$APO.CDIS=R\n"), 0);
}
