//! FANUC TP in and out: targets by hand, edits on numbers of `/POS` only, the same corrections as from RAPID.

#![allow(clippy::float_cmp)] // the very numbers that were written

use super::listed::refused;
use super::writing::to;
use deflex::cell::Cell;
use deflex::correct::{Options, PostOptions, Prepared, compensate, post};
use deflex::program::orientation::{from_zyx_deg, quaternion};
use deflex::program::{
    Change, Conf, Config, Goal, Language, Motion, Program, Reason, RewriteOptions, Role, rapid, round_trip, tp,
};
use deflex::robot::{BUILTIN, Joints, conf_like};
use deflex::text::{Diagnostic, Source, applied};
use std::fmt::Write;

fn try_read(text: &str) -> Result<Program, Vec<Diagnostic>> {
    tp::read(vec![Source::new("m.ls", text.as_bytes())], Vec::new())
}

fn read(text: &str) -> Program {
    try_read(text).unwrap_or_else(|errors| panic!("{errors:?}"))
}

/// A position in user frame 1 with tool 1.
fn position(number: u32, values: [f64; 6], config: &str) -> String {
    let [x, y, z, w, p, r] = values.map(|value| format!("{value:.3}"));
    format!(
        "P[{number}]{{\n   GP1:\n\tUF : 1, UT : 1,\t\tCONFIG : '{config}',\n\tX = {x}  mm,\tY = {y}  mm,\tZ = {z}  mm,\n\t\
         W = {w} deg,\tP = {p} deg,\tR = {r} deg\n}};\n"
    )
}

fn program(statements: &str, positions: &str) -> String {
    let numbered: String = statements.lines().enumerate().map(|(i, line)| format!("{:4}:{line} ;\n", i + 1)).collect();
    format!("/PROG  M\n/ATTR\n/MN\n{numbered}/POS\n{positions}/END\n")
}

fn written(program: &Program, changes: &[Option<Change>]) -> (String, Vec<(usize, Reason)>) {
    let rewritten = program.rewrite(changes, &[], &RewriteOptions::default());
    let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    (String::from_utf8(out).unwrap(), rewritten.kept)
}

#[test]
fn targets_by_hand() {
    let text = program(
        "  UFRAME_NUM=1\nJ P[1] 20% FINE\nL P[2] 90cm/min CNT50\nC P[3] P[1] 15.5mm/sec FINE",
        &[
            position(1, [1.0, 2.0, 3.0, 180.0, 0.0, 0.0], "N U T, 0, 0, 0"),
            position(2, [-0.5, 0.25, 0.0, 0.0, 0.0, 90.0], "F D B, 1, -1, 0"),
            position(3, [4.0, 5.0, 6.0, 90.0, 0.0, 90.0], "N U T, 0, 0, 0"),
        ]
        .concat(),
    );
    let program = read(&text);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // Half a turn about x; a quarter turn about z; first a quarter turn about x, then one about z, both fixed.
    let turns = [[0.0, 1.0, 0.0, 0.0], [half, 0.0, 0.0, half], [0.5, 0.5, 0.5, 0.5], [0.0, 1.0, 0.0, 0.0]];
    assert_eq!(program.targets.len(), 4);
    for (target, turn) in program.targets.iter().zip(turns) {
        let Goal::Pose { quat, .. } = target.goal else { panic!("{target:?}") };
        let same = quat.iter().zip(turn).map(|(a, b)| a * b).sum::<f64>();
        assert!((same - 1.0).abs() < 1e-12, "{quat:?} {turn:?}");
    }
    let motions: Vec<_> = program.targets.iter().map(|t| (t.motion, t.role, t.ordinal, t.feed_mm_s)).collect();
    assert_eq!(
        motions,
        [
            (Motion::Joint, Role::End, 1, None),
            (Motion::Linear, Role::End, 2, Some(15.0)),
            (Motion::Circular, Role::Via, 3, Some(15.5)),
            (Motion::Circular, Role::End, 3, Some(15.5)),
        ]
    );
    let Goal::Pose { conf, position_mm, .. } = program.targets[1].goal else { panic!() };
    assert_eq!(conf, Some(Conf::Turns(Config { posture: 7, turns: [1, -1, 0] })));
    assert_eq!(position_mm, [-0.5, 0.25, 0.0]);
    assert_eq!((&*program.tools[0].name, &*program.wobjs[0].name), ("UT 1", "UF 1"));
    assert_eq!((program.motion_targets(), program.literal_targets, program.arcs), (3, 3, 1));
    assert_eq!(program.targets[0].name.as_deref(), Some("P[1]"));
}

#[test]
fn only_numbers_change_and_keep_their_looks() {
    let text = program(
        "L P[1] 20mm/sec FINE",
        "P[1]{\n   GP1:\n\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX =     1.5  mm,\tY =      .250  mm,\tZ =     -.125  mm,\n\tW =   180 deg,\tP =     0.000 deg,\tR =    12.345678 deg\n};\n",
    );
    let program = read(&text);
    let (out, kept) = written(&program, &[to([1.53, 0.3, 0.0004])]);
    assert!(kept.is_empty());
    // Three decimals at least; no zero before the point where there was none.
    let expected =
        text.replace("1.5  mm", "1.530  mm").replace(".250  mm", ".300  mm").replace("-.125  mm", ".000  mm");
    assert_eq!(out, expected);
    assert_eq!(written(&program, &[None]).0, text);
    // What is written is what the controller's single precision makes of the text.
    let rewritten = program.rewrite(&[to([1.53, 0.3, 0.0004])], &[], &RewriteOptions::default());
    assert_eq!(rewritten.written[0].0, [f64::from(1.53_f32), f64::from(0.3_f32), 0.0]);
}

#[test]
fn turned_poses_and_turn_numbers_are_written() {
    let text = program("J P[1] 20% FINE", &position(1, [0.0, 0.0, 0.0, 180.0, 0.0, 0.0], "N U T, 0, 0, 0"));
    let program = read(&text);
    let wanted = quaternion(&from_zyx_deg([0.25, -0.125, -179.5]));
    let conf = |posture| Some(Conf::Turns(Config { posture, turns: [0, 0, -1] }));
    let change = |posture| Change { position_mm: [0.0; 3], quat: Some(wanted), conf: conf(posture), external: None };
    let (out, kept) = written(&program, &[Some(change(0))]);
    assert!(kept.is_empty(), "{kept:?}");
    let expected = text.replace("180.000", "-179.500").replace("P = 0.000", "P = -0.125");
    let expected = expected.replace("R = 0.000", "R = 0.250").replace("0, 0, 0'", "0, 0, -1'");
    assert_eq!(out, expected);
    // Another letter is no number.
    let (out, kept) = written(&program, &[Some(change(1))]);
    assert_eq!((out, kept.len()), (text, 1));
}

#[test]
fn a_position_used_twice_is_written_where_all_agree() {
    let positions = position(1, [1.0, 2.0, 3.0, 180.0, 0.0, 0.0], "N U T, 0, 0, 0");
    let program = read(&program("L P[1] 20mm/sec FINE\nL P[1] 30mm/sec FINE", &positions));
    let (_, kept) = written(&program, &[to([1.1, 2.0, 3.0]), to([1.2, 2.0, 3.0])]);
    assert_eq!(kept.iter().map(|kept| kept.0).collect::<Vec<_>>(), [0, 1]);
    let (out, kept) = written(&program, &[to([1.1, 2.0, 3.0]), to([1.1, 2.0, 3.0])]);
    assert!(kept.is_empty() && out.contains("X = 1.100  mm"), "{out}");
    let (_, kept) = written(&program, &[to([1.1, 2.0, 3.0]), None]);
    assert_eq!(kept, [(0, Reason::SharedNumbers)]);
}

fn listed(program: &Program) -> String {
    let mut out = format!(
        "{} motions, {} literals, {} arcs, {}\n",
        program.motion_targets(),
        program.literal_targets,
        program.arcs,
        program.dialect
    );
    for target in &program.targets {
        let goal = match target.goal {
            Goal::Pose { position_mm, conf, .. } => format!("{position_mm:?} {conf:?}"),
            Goal::Joints { deg } => format!("joints {deg:?}"),
            Goal::Axis { .. } => unreachable!(),
        };
        let (tool, wobj) = (&program.tools[target.tool as usize].name, &program.wobjs[target.wobj as usize].name);
        let _ = writeln!(
            out,
            "{} {:?} {:?} {goal} {tool} {wobj} {:?} {:?} {:?}",
            target.ordinal, target.motion, target.role, target.feed_mm_s, target.mark, target.editable
        );
    }
    for kept in &program.kept {
        let _ = writeln!(out, "kept line {}: {}", kept.line, kept.reason);
    }
    for said in &program.diagnostics {
        let _ = writeln!(out, "{said}");
    }
    out
}

#[test]
fn valid_fixtures_read_as_they_should_and_survive_a_write() {
    insta::glob!("../../fixtures/tp/valid", "*.ls", |path| {
        let source = Source::new("fixture.ls", std::fs::read(path).unwrap());
        let program = tp::read(vec![source], Vec::new()).unwrap();
        let proof = round_trip(&program, tp::read);
        assert!(proof.holds(), "{}: {:?}", path.display(), proof.why);
        insta::assert_snapshot!(listed(&program));
    });
}

#[test]
fn invalid_fixtures_are_refused_with_a_reason() {
    insta::glob!("../../fixtures/tp/invalid", "*.ls", |path| {
        let source = Source::new("fixture.ls", std::fs::read(path).unwrap());
        let errors = tp::read(vec![source], Vec::new()).unwrap_err();
        insta::assert_snapshot!(refused(&errors));
    });
}

const CELL: &str = r#"
[robot]
model = "m-710ic-50"
start_deg = [0.0, 0.0, -20.0, 0.0, -70.0, 0.0]
[robot.stiffness]
joint_nm_per_rad = [1.0e6, 1.2e6, 9.0e5, 2.0e5, 2.2e5, 1.0e5]
[tools."UT 1"]
tcp_mm = [10.0, -20.0, 200.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 12.0
cog_mm = [0.0, 0.0, 90.0]
[wobjs."UF 1"]
uframe_mm = [1100.0, -150.0, -250.0]
uframe_quat = [0.96592582628906831, 0.0, 0.0, 0.25881904510252074]
[cut]
force = "constant"
force_n = [150.0, -260.0, 410.0]
frame = "wobj"
"#;

/// The same path, tool, frame, force and arm, in both languages.
#[test]
fn corrections_are_those_of_the_same_rapid_program() {
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let points: Vec<[f64; 6]> = (0..24)
        .map(|i| {
            let t = f64::from(i);
            [7.0 * t, 40.0 - 1.5 * t, 0.25 * t, 180.0 - 0.5 * t, 0.25 * t, -30.0 + t]
        })
        .collect();
    let (mut statements, mut positions, mut moves) = (String::new(), String::new(), String::new());
    for (i, point) in points.iter().enumerate() {
        let number = u32::try_from(i + 1).unwrap();
        let _ = writeln!(statements, "L P[{number}] 30mm/sec CNT100");
        positions += &position(number, *point, "N U T, 0, 0, 0");
        let [x, y, z, w, p, r] = *point;
        let [a, b, c, d] = quaternion(&from_zyx_deg([r, p, w]));
        let _ = writeln!(
            moves,
            "MoveL [[{x},{y},{z}],[{a:.12},{b:.12},{c:.12},{d:.12}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v30,z1,tMill\\WObj:=wPart;"
        );
    }
    let ls = read(&program(&statements, &positions));
    let module = format!(
        "MODULE M\nPERS tooldata tMill:=[TRUE,[[10,-20,200],[1,0,0,0]],[12,[0,0,90],[1,0,0,0],0,0,0]];\nPERS wobjdata wPart:=\
         [FALSE,TRUE,\"\",[[1100,-150,-250],[0.96592582628906831,0,0,0.25881904510252074]],[[0,0,0],[1,0,0,0]]];\n\
         PROC main()\n{moves}ENDPROC\nENDMODULE\n"
    );
    let module = rapid::read(vec![Source::new("m.mod", module.as_bytes())], Vec::new()).unwrap();
    let [a, b] = [&ls, &module].map(|program| compensate(program, &cell, &Options::default()).unwrap());
    assert!(a.failures.is_empty() && b.failures.is_empty(), "{:?} {:?}", a.failures, b.failures);
    assert_eq!((a.rows.len(), b.rows.len()), (24, 24));
    for (a, b) in a.rows.iter().zip(&b.rows) {
        for k in 0..3 {
            // The report's digits; three decimals in TP against four; the angles' last digit is 3 µm at 300 mm.
            assert!((a.error_mm[k] - b.error_mm[k]).abs() < 1e-6, "{:?} {:?}", a.error_mm, b.error_mm);
            assert!(
                (a.correction_mm[k] - b.correction_mm[k]).abs() < 6e-4,
                "{:?} {:?}",
                a.correction_mm,
                b.correction_mm
            );
        }
        assert!(a.correction_norm_mm() > 0.05 && a.remaining_norm_mm() < 0.005, "{:?}", a.remaining_mm);
    }
}

/// Joints → flange → text → joints, through every letter and through whole turns.
#[test]
fn config_chooses_the_joints_of_a_joint_move() {
    let robot = BUILTIN.iter().find(|robot| robot.model == "m-710ic-50").unwrap().robot();
    let cell =
        Cell::read(&Source::new("cell.toml", "[robot]\nmodel = \"m-710ic-50\"\n[cut]\nforce = \"none\"\n")).unwrap();
    let mut letters = std::collections::BTreeSet::new();
    for axes in [
        [10.0, 20.0, -15.0, 30.0, -60.0, 40.0],
        [10.0, 20.0, -15.0, -150.0, 60.0, -140.0],
        [-100.0, -40.0, 10.0, 20.0, -50.0, 200.0],
        [30.0, -60.0, 100.0, 10.0, -40.0, -300.0],
        [30.0, 80.0, -120.0, 10.0, 40.0, 5.0],
    ] {
        let motor: Joints = robot.motor_from_axes_deg(&axes);
        let Conf::Turns(config) = conf_like(&robot, &motor, Conf::Turns(Config { posture: 0, turns: [0; 3] })) else {
            panic!()
        };
        let flange = robot.forward(&motor);
        let p: [f64; 3] = (flange.translation.vector * 1e3).into();
        let [c, b, a] = deflex::program::orientation::zyx_deg(&flange.rotation);
        let letter = |bit: i32, yes: char, no: char| if config.posture & bit == 0 { no } else { yes };
        let said = format!("{} {} {}", letter(1, 'F', 'N'), letter(2, 'D', 'U'), letter(4, 'B', 'T'));
        letters.insert(said.clone());
        let [t1, t4, t6] = config.turns;
        let text = program(
            "J P[1] 20% FINE",
            &format!(
                "P[1]{{ GP1: UF : 0, UT : 0, CONFIG : '{said}, {t1}, {t4}, {t6}', X = {:.6} mm, Y = {:.6} mm, Z = {:.6} mm, W = {a:.7} deg, P = {b:.7} deg, R = {c:.7} deg }};\n",
                p[0], p[1], p[2]
            ),
        );
        let prepared = Prepared::new(&read(&text), &cell, &Options::default()).unwrap();
        let found = robot.axes_deg_from_motor(&prepared.points[0].motor);
        assert!(
            axes.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-4),
            "{axes:?} {found:?} {said} {:?}",
            config.turns
        );
    }
    assert!(letters.len() > 2, "{letters:?}");
}

#[test]
fn an_unmodelled_axis_and_an_option_of_the_motion_keep_the_target() {
    let text = program(
        "L P[1] 20mm/sec FINE Offset,PR[1]\nL P[2] 20mm/sec FINE\nL PR[2] 20mm/sec FINE",
        &[
            position(1, [1.0, 2.0, 3.0, 180.0, 0.0, 0.0], "N U T, 0, 0, 0"),
            position(2, [1.0, 2.0, 3.0, 180.0, 0.0, 0.0], "N U T, 0, 0, 0").replace("\n};", ",\n\tE1= 850.000 mm\n};"),
        ]
        .concat(),
    );
    let program = read(&text);
    assert!(program.targets.len() == 2 && program.motion_targets() == 3 && !program.targets[0].located);
    assert_eq!(program.targets[1].external.as_ref().unwrap().written[0], Some(850.0));
    let reasons: Vec<_> = program.kept.iter().map(|kept| (kept.line, kept.reason.text())).collect();
    assert_eq!(reasons, [(4, "moved by a position register (Offset)"), (6, "motion to a position register (PR)")]);
}

/// Every word that the grammar knows as a motion option is one that the reader knows.
#[test]
fn options_of_the_grammar_are_known() {
    let grammar = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/grammars/tp.ebnf")).unwrap();
    let rule = grammar.split("option_word =").nth(1).unwrap().split(" ;\n").next().unwrap();
    let positions = position(1, [1.0, 2.0, 3.0, 180.0, 0.0, 0.0], "N U T, 0, 0, 0");
    let words: Vec<&str> =
        rule.split('"').skip(1).step_by(2).filter(|word| word.starts_with(char::is_alphabetic)).collect();
    assert!(words.len() > 20, "{words:?}");
    for word in words {
        let program = read(&program(&format!("L P[1] 20mm/sec FINE {word}"), &positions));
        assert!(program.kept.iter().all(|kept| kept.reason != Reason::MotionOption), "{word}");
    }
}

/// CL data posted as TP: read back they are the corrected points, split where a controller's numbering ends.
#[test]
fn posted_cl_data_are_programs_that_read_back() {
    let cell =
        format!("{CELL}[cl]\ntool = \"UT 1\"\nwobj = \"UF 1\"\nunits = \"mm\"\nspin = \"fixed\"\nspin_deg = 180.0\n");
    let cell = Cell::read(&Source::new("cell.toml", cell)).unwrap();
    let mut text = "RAPID\nGOTO/-10,0,30,0,0,1\nFEDRAT/1800,MMPM\nDELAY/2\n".to_owned();
    for i in 0..12 {
        let _ = writeln!(text, "GOTO/{i}.5,{},0,0,0,1", 2 * i);
    }
    let options = cell.cl.as_ref().unwrap().options.clone();
    let program = deflex::program::cl::read(Source::new("a.cl", text), &options).unwrap();
    let posts = Options { post: Some(Language::Ls), ..Options::default() };
    let corrected = compensate(&program, &cell, &posts).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    // What is left is what three decimals leave: of a coordinate half a micrometre, of an angle three at 300 mm.
    assert!(corrected.rows.iter().all(|row| row.remaining_norm_mm() < 0.005));
    let files = |max_targets| {
        let options = PostOptions {
            name: "part".into(),
            title: vec!["a test".into()],
            max_targets,
            rapid_mm_s: 200.0,
            feed_mm_s: None,
            language: Language::Ls,
        };
        post(&program, &cell, &corrected, &options).unwrap().files
    };
    let [(name, bytes)] = &files(None)[..] else { panic!() };
    let whole = tp::read(vec![Source::new(name, bytes.clone())], Vec::new()).unwrap();
    assert_eq!((whole.targets.len(), name.as_str()), (13, "PART.ls"));
    assert!(String::from_utf8_lossy(bytes).contains(":  WAIT 2.00(sec) ;"));
    for (target, posted) in whole.targets.iter().zip(&corrected.posted) {
        let Goal::Pose { position_mm, quat, conf } = target.goal else { panic!() };
        let near = |a: &[f64], b: &[f64], within| a.iter().zip(b).all(|(a, b): (&f64, &f64)| (a - b).abs() < within);
        assert!(near(&position_mm, &posted.position_mm, 1e-4), "{position_mm:?} {:?}", posted.position_mm);
        assert!((quat.iter().zip(posted.quat).map(|(a, b)| a * b).sum::<f64>().abs() - 1.0).abs() < 1e-10);
        assert!(matches!(conf, Some(Conf::Turns(_))));
        assert_eq!(
            (&*whole.tools[target.tool as usize].name, &*whole.wobjs[target.wobj as usize].name),
            ("UT 1", "UF 1")
        );
    }
    assert_eq!(whole.targets[5].feed_mm_s, Some(30.0));
    assert_eq!(whole.targets[0].motion, Motion::Joint);
    let parts = files(Some(5));
    let names: Vec<&str> = parts.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["PART.ls", "PART_1.ls", "PART_2.ls", "PART_3.ls"]);
    assert_eq!(String::from_utf8_lossy(&parts[0].1).matches("CALL PART_").count(), 3);
    let read_back =
        |bytes: &Vec<u8>| tp::read(vec![Source::new("p.ls", bytes.clone())], Vec::new()).unwrap().targets.len();
    assert_eq!(parts[1..].iter().map(|(_, bytes)| read_back(bytes)).collect::<Vec<_>>(), [5, 5, 3]);
}

/// A speed in a register is that of the register where it is known.
#[test]
fn a_speed_in_a_register_is_followed() {
    let pose = "GP1:\nUF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0',\nX = 1.0 mm, Y = 0.0 mm, Z = 0.0 mm,\n\
                W = 180.0 deg, P = 0.0 deg, R = 0.0 deg\n";
    let text = format!(
        "/PROG P\n/ATTR\n/MN\n1:R[1]=20 ;\n2:L P[1] R[1]mm/sec FINE ;\n3:R[1]=30 ;\n4:L P[1] R[1]cm/min FINE ;\n\
         5:R[1]=AI[1] ;\n6:L P[1] R[1]mm/sec FINE ;\n/POS\nP[1]{{\n{pose}}};\n/END\n"
    );
    let program = tp::read(vec![Source::new("p.ls", text)], Vec::new()).unwrap();
    let feeds: Vec<Option<f64>> = program.targets.iter().map(|target| target.feed_mm_s).collect();
    assert_eq!(feeds, [Some(20.0), Some(5.0), None]);
}

/// A bound in a register that the loop leaves alone is known.
#[test]
fn a_loop_to_the_number_in_a_register_is_followed() {
    let pose = |n: u32| {
        format!(
            "P[{n}]{{\nGP1:\nUF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0',\nX = {n}.0 mm, Y = 0.0 mm, Z = 0.0 mm,\n\
             W = 180.0 deg, P = 0.0 deg, R = 0.0 deg\n}};\n"
        )
    };
    let count = |body: &str| {
        let text = format!(
            "/PROG P\n/ATTR\n/MN\n1:R[2]=3 ;\n2:FOR R[1]=1 TO R[2] ;\n3:L P[R[1]] 20mm/sec FINE ;\n{body}5:ENDFOR ;\n\
             /POS\n{}{}{}/END\n",
            pose(1),
            pose(2),
            pose(3)
        );
        tp::read(vec![Source::new("p.ls", text)], Vec::new()).unwrap().targets.len()
    };
    assert_eq!((count(""), count("4:R[3]=R[2] ;\n"), count("4:R[2]=R[3] ;\n"), count("4:CALL X ;\n")), (3, 3, 0, 0));
}
