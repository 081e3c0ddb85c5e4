//! URScript in and out: targets by hand, edits on number tokens only, the same corrections as from RAPID, CL data posted.

#![allow(clippy::float_cmp)] // the very numbers that were written

use super::listed::{listed, refused};
use super::writing::{to, written};
use deflex::cell::Cell;
use deflex::correct::{Options, PostOptions, compensate, post, predict};
use deflex::program::orientation::{quaternion, rotation};
use deflex::program::{
    Change, Conf, Editable, Goal, Insert, Language, Mark, Motion, Passing, Predecessor, Program, Reason, Role, rapid,
    round_trip, ur,
};
use deflex::text::{Diagnostic, Severity, Source, applied};
use std::fmt::Write;

fn try_read(text: &str) -> Result<Program, Vec<Diagnostic>> {
    ur::read(vec![Source::new("part.script", text.as_bytes())], Vec::new())
}

fn read(text: &str) -> Program {
    try_read(text).unwrap_or_else(|errors| panic!("{errors:?}"))
}

#[test]
fn valid_fixtures_read_as_they_should_and_survive_a_write() {
    insta::glob!("../../fixtures/ur/valid", "*.script", |path| {
        let source = Source::new("fixture.script", std::fs::read(path).unwrap());
        let program = ur::read(vec![source], Vec::new()).unwrap();
        let proof = round_trip(&program, ur::read);
        assert!(proof.holds(), "{}: {:?}", path.display(), proof.why);
        insta::assert_snapshot!(listed(&program));
    });
}

#[test]
fn invalid_fixtures_are_refused_with_a_reason() {
    insta::glob!("../../fixtures/ur/invalid", "*.script", |path| {
        let source = Source::new("fixture.script", std::fs::read(path).unwrap());
        let errors = ur::read(vec![source], Vec::new()).unwrap_err();
        insta::assert_snapshot!(refused(&errors));
    });
}

#[test]
fn targets_by_hand() {
    let program = read(
        "set_tcp(p[0, 0, 0.1, 0, 0, 0])\nset_payload(2, [0, 0, 0.05])\n# deflex cut\n\
         movej([0, -1.5707963267948966, 1.5707963267948966, 0, 0, 0])\n\
         movel(pose_trans(p[0.1, 0.2, 0, 0, 0, 1.5707963267948966], p[0.3, 0, 0, 0, 0, 0]), v=0.02, r=0.001)\n\
         movec(p[0, 0, 0.5, 0, 0, 0], p[0, 0.1, 0.5, 3.141592653589793, 0, 0], a=1, v=.03)\n\
         movej(get_inverse_kin(p[0.5, 0, 0, 0, 0, 0], qnear=[0, -1, 1, 0, 0, 0]))\n",
    );
    let kinds: Vec<_> = program.targets.iter().map(|t| (t.motion, t.role, t.ordinal, t.feed_mm_s)).collect();
    assert_eq!(
        kinds,
        [
            (Motion::AbsoluteJoint, Role::End, 1, None),
            (Motion::Linear, Role::End, 2, Some(20.0)),
            (Motion::Circular, Role::Via, 3, Some(30.0)),
            (Motion::Circular, Role::End, 3, Some(30.0)),
            (Motion::Joint, Role::End, 4, None),
        ]
    );
    let Goal::Joints { deg } = program.targets[0].goal else { panic!() };
    assert!((deg[1] + 90.0).abs() < 1e-12 && (deg[2] - 90.0).abs() < 1e-12);
    // A quarter turn about z takes 300 mm along x to y.
    let Goal::Pose { position_mm, quat, .. } = program.targets[1].goal else { panic!() };
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!((position_mm[0] - 100.0).abs() < 1e-9 && (position_mm[1] - 500.0).abs() < 1e-9, "{position_mm:?}");
    assert!((quat[0] - half).abs() < 1e-12 && (quat[3] - half).abs() < 1e-12, "{quat:?}");
    assert_eq!(program.passing(1), Passing::Zone(1.0));
    assert_eq!(program.passing(3), Passing::Stop);
    assert_eq!(program.targets[4].conf(), Some(Conf::near([0.0, -57.295_779_5, 57.295_779_5, 0.0, 0.0, 0.0])));
    assert!(program.targets.iter().all(|target| target.mark == Some(Mark::Cut)));
    assert_eq!(program.targets[0].predecessor, Predecessor::Start);
    assert_eq!(program.targets[0].editable, Editable::No(Reason::Joints));
    let tool = program.tools[0].data.unwrap();
    assert_eq!((tool.tcp_mm, tool.mass_kg, tool.cog_mm), ([0.0, 0.0, 100.0], 2.0, [0.0, 0.0, 50.0]));
    assert_eq!((program.arcs, program.literal_targets, program.motion_targets()), (1, 6, 4));
}

#[test]
fn numbers_keep_their_style_and_nothing_else_changes() {
    let text = "f = p[0.1,0,0,0,0,1.57]\r\nmovel( pose_trans(f, p[.500000, -0.2 ,0.300,0,3.14,0]) , 1.2, 0.1)  # x\r\n";
    let program = read(text);
    let Goal::Pose { position_mm: [x, y, z], .. } = program.targets[0].goal else { panic!() };
    // Along z of the base, which is z of the frame: one number changes.
    let (up, kept) = written(&program, &[to([x, y, z + 0.25])], &[]);
    assert!(kept.is_empty(), "{kept:?}");
    assert_eq!(up, text.replace("0.300,", "0.3002500,"));
    let (same, _) = written(&program, &[to([x, y, z])], &[]);
    assert_eq!(same, text);
    let again = read(&up);
    let Goal::Pose { position_mm: now, .. } = again.targets[0].goal else { panic!() };
    assert!((now[2] - z - 0.25).abs() < 1e-9);
}

#[test]
fn a_turn_is_written_next_to_the_vector_that_was_there() {
    let text = "movel(p[0.5, 0, 0.2, 0, 3.2, 0], v=0.1)\n";
    let program = read(text);
    let Goal::Pose { position_mm, quat, .. } = program.targets[0].goal else { panic!() };
    let more = rotation([0.999_999_5, 0.0, 0.001, 0.0]) * rotation(quat);
    let change = Change { position_mm, quat: Some(quaternion(&more)), conf: None, external: None };
    let (text, _) = written(&program, &[Some(change)], &[]);
    // 3.2 is more than half a turn: the vector stays on its side.
    assert!(text.contains("3.202"), "{text}");
}

#[test]
fn users_of_a_number_agree_or_it_stays() {
    let program = read("a = p[0.5,0,0.2,0,3.14,0]\nmovel(a)\nmovel(p[0.6,0,0.2,0,3.14,0])\nmovel(a)\n");
    let (text, kept) = written(&program, &[to([501.0, 0.0, 200.0]), None, to([501.0, 0.0, 200.0])], &[]);
    assert!(kept.is_empty() && text.contains("p[0.5010000,0"), "{text} {kept:?}");
    let (text, kept) = written(&program, &[to([501.0, 0.0, 200.0]), None, to([502.0, 0.0, 200.0])], &[]);
    assert!(text.contains("p[0.5,0"), "{text}");
    assert_eq!(kept.iter().map(|(at, _)| *at).collect::<Vec<_>>(), [0, 2]);
    let (_, kept) = written(&program, &[to([501.0, 0.0, 200.0]), None, None], &[]);
    assert_eq!(kept.len(), 1);
}

const ROBOT: &str = "[robot]\nmodel = \"ur10e\"\n[robot.stiffness]\njoint_nm_per_rad = [3e4, 4e4, 3.2e4, 1.1e4, 1.1e4, 1e4]\n\
    [limits]\nmax_correction_mm = 5.0\nmax_step_mm = 5.0\n[controller]\ncompensates = []\n\
    [cut]\nforce = \"constant\"\nforce_n = [20.0, -30.0, 40.0]\nframe = \"wobj\"\n";

/// Both branches begin where the motion before them ends, and the motion after them where either of them ends.
#[test]
fn the_beginning_of_each_branch_is_known() {
    let to = |x: &str| format!("movel(p[{x}, 0.1, 0.2, 0, 3.14, 0], a=1.2, v=0.02)\n");
    let begins = |before: &str| -> Vec<Option<f64>> {
        let [a, b, c, d] = ["0.1", "0.2", "0.3", "0.4"].map(to);
        let text = format!("def part():\n{a}if get_digital_in(1):\n{b}else:\n{before}{c}end\n{d}end\n");
        read(&text).targets.iter().map(|target| target.begins_mm.map(|at| at[0].round())).collect()
    };
    assert_eq!(begins(""), [None, None, Some(100.0), None]);
    // The arm may have moved in the meantime, or another tool counts.
    for before in ["other()\n", "set_tcp(p[0, 0, 0.1, 0, 0, 0])\n"] {
        assert!(begins(before).iter().all(Option::is_none), "{before}");
    }
}

fn cell(more: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", format!("{ROBOT}{more}"))).unwrap_or_else(|errors| panic!("{errors:?}"))
}

/// The axis angles lead the TCP that was in force when they were computed to the pose, and another one elsewhere.
#[test]
fn inverse_kinematics_holds_for_the_tcp_of_its_call() {
    let of = |change: &str| {
        let program = read(&format!(
            "def m():\n  set_tcp(p[0, 0, 0.15, 0, 0, 0])\n  q = get_inverse_kin(p[0.5, 0, 0.2, 3.14, 0, 0])\n{change}  movel(q, v=0.02)\nend\nm()\n"
        ));
        (program.targets.len(), program.kept.iter().map(|kept| kept.reason).collect::<Vec<_>>())
    };
    assert_eq!(of(""), (1, vec![]));
    assert_eq!(of("  set_tcp(p[0, 0, 0.15, 0, 0, 0])\n"), (1, vec![]));
    assert_eq!(of("  set_tcp(p[0, 0, 0.1, 0, 0, 0])\n"), (0, vec![Reason::Tool]));
}

/// A short path in a feature of the table.
const PATH: &str = "def m():\n  set_tcp(p[0, 0, 0.15, 0, 0, 0])\n  set_payload(1.5, [0, 0, 0.05])\n  f = p[0.5, -0.2, 0.1, 0, 0, 0]\n\
    \x20 movej(get_inverse_kin(p[0.5, -0.2, 0.2, 3.141593, 0, 0], qnear=[-0.05, -3.62, 1.9, 0.15, -1.57, 1.52]))\n\
    \x20 movel(pose_trans(f, p[0.00, 0.00, 0.01, 3.141593, 0, 0]), v=0.1)\n\
    \x20 movel(pose_trans(f, p[0.10, 0.00, 0.01, 3.141593, 0, 0]), v=0.02)\n\
    \x20 movel(pose_trans(f, p[0.10, 0.05, 0.01, 3.141593, 0, 0]), v=0.02)\nend\nm()\n";

#[test]
fn what_is_corrected_lands_and_is_what_rapid_gets() {
    let cell = cell("");
    let program = read(PATH);
    let corrected = compensate(&program, &cell, &Options::default()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let rewritten = corrected.rewritten.as_ref().unwrap();
    let bytes = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    let again = read(std::str::from_utf8(&bytes).unwrap());
    let after = predict(&again, &cell, &Options::default(), Some(&program)).unwrap();
    assert!(after.rows.iter().skip(1).all(|row| row.error_norm_mm() < 0.002), "{:?}", after.rows);
    assert!(corrected.rows.iter().skip(1).all(|row| row.error_norm_mm() > 0.1));
    // The same arm, tool and poses in RAPID: the same corrections.
    let mut module =
        "MODULE M\nPERS tooldata t:=[TRUE,[[0,0,150],[1,0,0,0]],[1.5,[0,0,50],[1,0,0,0],0,0,0]];\nPROC main()\n"
            .to_owned();
    let start = "MoveAbsJ [[-2.865,-207.41,108.862,8.594,-89.954,87.09],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,t;\n";
    module += start;
    for target in &program.targets {
        let Goal::Pose { position_mm: [x, y, z], quat: [a, b, c, d], .. } = target.goal else { panic!() };
        let _ = writeln!(
            module,
            "MoveL [[{x:.6},{y:.6},{z:.6}],[{a:.10},{b:.10},{c:.10},{d:.10}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,t;"
        );
    }
    module += "ENDPROC\nENDMODULE\n";
    let twin = rapid::read(vec![Source::new("m.mod", module)], Vec::new()).unwrap();
    let same = compensate(&twin, &cell, &Options::default()).unwrap();
    let corrections = |rows: &[deflex::correct::Row]| {
        let last = rows.len() - 3;
        rows[last..].iter().map(|row| row.correction_mm).collect::<Vec<_>>()
    };
    for (ours, theirs) in corrections(&corrected.rows).iter().zip(corrections(&same.rows)) {
        let off = (0..3).map(|i| (ours[i] - theirs[i]).abs()).fold(0.0, f64::max);
        assert!(off < 5e-4, "{ours:?} {theirs:?}");
    }
}

#[test]
fn poses_count_from_the_base_wherever_it_stands() {
    let moved = "base_mm = [300.0, 100.0, 800.0]\nbase_quat = [0.0, 0.0, 0.0, 1.0]\n";
    let at = |base: &str| {
        let cell = Cell::read(&Source::new(
            "cell.toml",
            ROBOT.replace("[robot.stiffness]", &format!("{base}[robot.stiffness]")),
        ))
        .unwrap();
        let corrected = compensate(&read(PATH), &cell, &Options::default()).unwrap();
        corrected.rows.iter().map(|row| row.correction_mm).collect::<Vec<_>>()
    };
    // The force is in the axes of the work object, which is the base: all is as before.
    for (a, b) in at("").iter().zip(at(moved)) {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-9), "{a:?} {b:?}");
    }
}

#[test]
fn a_point_between_is_the_statement_again() {
    let program = read(PATH);
    let Goal::Pose { quat, .. } = program.targets[2].goal else { panic!() };
    let insert = Insert::line(2, ([550.0, -200.0, 110.0], quat), 50.0);
    let changes = vec![None; program.targets.len()];
    let (text, _) = written(&program, &changes, &[insert]);
    let line = "  movel(pose_trans(f, p[0.0500000, 0.00, 0.01, 3.141593, 0, 0]), v=0.02)\n";
    assert!(text.contains(line), "{text}");
    assert_eq!(text.replace(line, ""), PATH);
    assert_eq!(read(&text).targets.len(), program.targets.len() + 1);
}

#[test]
fn routines_that_are_not_given_are_named_and_can_be_vouched_for() {
    let text = "def m():\n set_tcp(p[0,0,0.1,0,0,0])\n spindle_on(9000)\n movel(p[0.5,0,0.2,0,3.14,0])\nend\n";
    let program = read(text);
    let warning = program.diagnostics.iter().find(|d| d.severity == Severity::Warning).unwrap();
    assert!(warning.code == "program.called" && warning.message.contains("spindle_on"), "{warning:?}");
    assert_eq!((program.targets.len(), program.unknown.len()), (0, 1));
    // A cell has names in capitals.
    let vouched = Source::new("[controller] harmless", "def SPINDLE_ON():\nend\n");
    let program = ur::read(vec![Source::new("m.script", text)], vec![vouched]).unwrap();
    assert_eq!(program.targets[0].editable, Editable::Pose);
}

#[test]
fn cl_data_are_posted_as_urscript() {
    let more = "[tools.TCP]\ntcp_mm = [0.0, 0.0, 150.0]\ntcp_quat = [1.0, 0.0, 0.0, 0.0]\nmass_kg = 1.5\ncog_mm = [0.0, 0.0, 50.0]\n\
        [wobjs.plate]\nuframe_mm = [500.0, -200.0, 100.0]\nuframe_quat = [1.0, 0.0, 0.0, 0.0]\noframe_mm = [0.0, 0.0, 0.0]\noframe_quat = [1.0, 0.0, 0.0, 0.0]\n\
        [cl]\ntool = \"TCP\"\nwobj = \"plate\"\nunits = \"mm\"\npoint = \"tip\"\nspin = \"fixed\"\nspin_deg = 0.0\n";
    let text = "UNITS/MM\nFEDRAT/1200,MMPM\nRAPID\nGOTO/0,0,50,0,0,1\nGOTO/0,0,10,0,0,1\nDELAY/2\nGOTO/100,0,10,0,0,1\nGOTO/100,50,10,0,0,1\nFINI\n";
    let cell = cell(more);
    let options = cell.cl.as_ref().unwrap().options.clone();
    let program = deflex::program::cl::read(Source::new("a.cl", text), &options).unwrap();
    let posts = Options { post: Some(Language::Ur), ..Options::default() };
    let corrected = compensate(&program, &cell, &posts).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    assert!(corrected.rows.iter().all(|row| row.remaining_norm_mm() < 0.001));
    let options = PostOptions {
        name: "part".into(),
        title: vec!["a test".into()],
        max_targets: None,
        rapid_mm_s: 200.0,
        feed_mm_s: None,
        language: Language::Ur,
    };
    let files = post(&program, &cell, &corrected, &options).unwrap().files;
    let [(name, bytes)] = &files[..] else { panic!() };
    assert_eq!(name, "part.script");
    assert!(String::from_utf8_lossy(bytes).contains("\n  sleep(2)\n"));
    let again = read(std::str::from_utf8(bytes).unwrap());
    assert_eq!(again.targets.len(), 4);
    for (target, posted) in again.targets.iter().zip(&corrected.posted).skip(1) {
        let Goal::Pose { position_mm: [x, y, z], quat, .. } = target.goal else { panic!() };
        let [px, py, pz] = posted.position_mm;
        let off = (x - px - 500.0).abs().max((y - py + 200.0).abs()).max((z - pz - 100.0).abs());
        assert!(off < 2e-4, "{target:?} {posted:?}");
        assert!((quat.iter().zip(posted.quat).map(|(a, b)| a * b).sum::<f64>().abs() - 1.0).abs() < 1e-10);
        assert_eq!(target.editable, Editable::Pose);
    }
    let split = PostOptions { max_targets: Some(2), ..options };
    assert_eq!(post(&program, &cell, &corrected, &split).unwrap_err()[0].code, "post.split");
}

#[test]
fn a_point_between_is_refused_where_the_copied_statement_would_be_wrong() {
    let path = |body: &str| format!("def m():\n set_tcp(p[0,0,0.1,0,0,0])\n movel(p[0.5,0,0.2,0,3.14,0])\n{body}end\n");
    let to = "movel(p[0.5,0.3,0.2,0,3.14,0]";
    for (body, reason) in [
        (
            format!(" i = 0\n while i < 2:\n  {to})\n  movel(p[0.6,0.3,0.2,0,3.14,0])\n  i = i + 1\n end\n"),
            Reason::RunsAgain,
        ),
        (format!(" if get_digital_in(1):\n  movel(p[0.6,0,0.2,0,3.14,0])\n end\n {to})\n"), Reason::PathStartUnknown),
        (format!(" {to}, t=3)\n"), Reason::NoOwnSpeed),
        (format!(" {to}, 1.2, 0.02, 3)\n"), Reason::NoOwnSpeed),
    ] {
        let program = read(&path(&body));
        let last = program.targets.iter().rposition(|target| {
            (target.span.end - target.span.start) as usize >= to.len() && {
                program.sources[0].bytes[target.span.range()].starts_with(to.as_bytes())
            }
        });
        assert_eq!(program.insertions_refused(&[last.unwrap()]), [Some(reason)], "{body}");
    }
    assert_eq!(read(&path(&format!(" {to}, v=0.02)\n"))).insertions_refused(&[1]), [None]);
}

#[test]
fn the_length_of_a_list_does_not_depend_on_its_numbers() {
    let text = "def m():\n set_tcp(p[0,0,0.1,0,0,0])\n local all = [p[0.5,0,0.2,0,3.14,0], p[0.6,0,0.2,0,3.14,0]]\n local i = 0\n \
                while i < length(all):\n  movel(all[i])\n  i = i + 1\n end\nend\n";
    for program in [read(text), read(&text.replace("length(", "get_list_length("))] {
        assert!(program.targets.iter().all(|target| target.editable == Editable::Pose), "{:?}", program.targets);
    }
}
