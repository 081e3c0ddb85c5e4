//! INFORM in and out: targets by hand, edits on number tokens only, the same corrections as from RAPID, CL data posted.

#![allow(clippy::float_cmp)] // the very numbers that were written

use super::listed::{listed, refused};
use super::writing::{to, written};
use deflex::cell::Cell;
use deflex::correct::{Options, PostOptions, compensate, post, predict};
use deflex::program::orientation::{from_zyx_deg, quaternion};
use deflex::program::{
    Change, Editable, Goal, Insert, Language, Motion, Passing, Program, Reason, RewriteOptions, Role, jbi, rapid,
    round_trip,
};
use deflex::text::{Diagnostic, Severity, Source, applied};
use std::fmt::Write;

fn try_read(text: &str) -> Result<Program, Vec<Diagnostic>> {
    jbi::read(vec![Source::new("part.jbi", text.as_bytes())], Vec::new())
}

fn read(text: &str) -> Program {
    try_read(text).unwrap_or_else(|errors| panic!("{errors:?}"))
}

#[test]
fn valid_fixtures_read_as_they_should_and_survive_a_write() {
    insta::glob!("../../fixtures/jbi/valid", "*.jbi", |path| {
        let source = Source::new("fixture.jbi", std::fs::read(path).unwrap());
        let program = jbi::read(vec![source], Vec::new()).unwrap();
        let proof = round_trip(&program, jbi::read);
        assert!(proof.holds(), "{}: {:?}", path.display(), proof.why);
        insta::assert_snapshot!(listed(&program));
    });
}

#[test]
fn invalid_fixtures_are_refused_with_a_reason() {
    insta::glob!("../../fixtures/jbi/invalid", "*.jbi", |path| {
        let source = Source::new("fixture.jbi", std::fs::read(path).unwrap());
        let errors = jbi::read(vec![source], Vec::new()).unwrap_err();
        insta::assert_snapshot!(refused(&errors));
    });
}

/// A job in user frame 1 with these positions and instructions.
fn job(positions: &[&str], instructions: &str) -> String {
    let mut text = format!("/JOB\r\n//NAME PART\r\n//POS\r\n///NPOS {},0,0,0,0,0\r\n", positions.len());
    text.push_str("///USER 1\r\n///TOOL 1\r\n///POSTYPE USER\r\n///RECTAN\r\n///RCONF 1,0,0,0,0,0,0,0\r\n");
    for (i, position) in positions.iter().enumerate() {
        let _ = write!(text, "C{i:05}={position}\r\n");
    }
    text.push_str("//INST\r\n///DATE 2026/01/02 03:04\r\n///ATTR SC,RW\r\n///GROUP1 RB1\r\nNOP\r\n");
    instructions.lines().for_each(|line| {
        let _ = write!(text, "{line}\r\n");
    });
    text + "END\r\n"
}

#[test]
fn targets_by_hand() {
    let text = job(
        &[
            "300.000,0.000,50.000,180.0000,0.0000,0.0000",
            "310.000,0.000,0.000,180.0000,0.0000,90.0000",
            "0.000,100.000,0.000,30.0000,20.0000,10.0000",
            "-70.711,70.711,0.000,180.0000,0.0000,0.0000",
            "-100.000,0.000,0.000,180.0000,0.0000,0.0000",
        ],
        "MOVJ C00000 VJ=10.00\nMOVL C00001 V=20.0 CR=1.5\nMOVC C00002 V=30.0\nMOVC C00003 V=30.0\nMOVC C00004 V=30.0 PL=0\n",
    );
    let program = read(&text);
    let kinds: Vec<_> = program.targets.iter().map(|t| (t.motion, t.role, t.ordinal, t.feed_mm_s)).collect();
    assert_eq!(
        kinds,
        [
            (Motion::Joint, Role::End, 1, None),
            (Motion::Linear, Role::End, 2, Some(20.0)),
            (Motion::Linear, Role::End, 3, Some(30.0)),
            (Motion::Circular, Role::Via, 4, Some(30.0)),
            (Motion::Circular, Role::End, 4, Some(30.0)),
        ]
    );
    // Half a turn about x, then a quarter about z.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let quat = |at: usize| if let Goal::Pose { quat, .. } = program.targets[at].goal { quat } else { panic!() };
    let dot = |a: [f64; 4], b: [f64; 4]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().abs();
    assert!((dot(quat(1), [0.0, half, half, 0.0]) - 1.0).abs() < 1e-12, "{:?}", quat(1));
    // Rx, Ry, Rz are turns about fixed axes, x first.
    assert!((dot(quat(2), quaternion(&from_zyx_deg([10.0, 20.0, 30.0]))) - 1.0).abs() < 1e-12);
    assert_eq!([0, 1, 4].map(|at| program.passing(at)), [Passing::Unstated, Passing::Zone(1.5), Passing::Stop]);
    assert_eq!((&*program.tools[0].name, &*program.wobjs[0].name), ("TOOL 1", "USER 1"));
    assert_eq!((program.arcs, program.literal_targets, program.motion_targets()), (1, 5, 4));
}

#[test]
fn numbers_have_the_decimals_of_the_controller_and_nothing_else_changes() {
    let text = job(&["10.000,-20.5,30,180.0000,0.0000,0.0000"], "MOVL C00000 V=20.0 PL=0\n");
    let program = read(&text);
    let Goal::Pose { position_mm: [x, y, z], quat, .. } = program.targets[0].goal else { panic!() };
    let (up, kept) = written(&program, &[to([x, y - 0.12345, z + 0.25])], &[]);
    assert!(kept.is_empty(), "{kept:?}");
    assert_eq!(up, text.replace("-20.5,30,", "-20.623,30.250,"));
    assert_eq!(written(&program, &[to([x, y, z])], &[]).0, text);
    // What is written is what the controller holds.
    let rewritten = program.rewrite(&[to([x, y - 0.12345, z])], &[], &RewriteOptions::default());
    assert_eq!(rewritten.written[0].0, [10.0, -20.623, 30.0]);
    // Beyond half a turn, the angle comes from the other side.
    let more = from_zyx_deg([0.0, 0.0, 180.003]);
    let change = Change { position_mm: [x, y, z], quat: Some(quaternion(&more)), conf: None, external: None };
    let (turned, _) = written(&program, &[Some(change)], &[]);
    assert_eq!(turned, text.replace("180.0000,", "-179.9970,"), "{quat:?}");
}

#[test]
fn users_of_a_position_agree_or_it_stays() {
    let positions = ["500.000,0.000,200.000,180.0000,0.0000,0.0000", "600.000,0.000,200.000,180.0000,0.0000,0.0000"];
    let program = read(&job(&positions, "MOVL C00000 V=1.0\nMOVL C00001 V=1.0\nMOVL C00000 V=1.0\n"));
    let (text, kept) = written(&program, &[to([501.0, 0.0, 200.0]), None, to([501.0, 0.0, 200.0])], &[]);
    assert!(kept.is_empty() && text.contains("C00000=501.000,"), "{text} {kept:?}");
    let (text, kept) = written(&program, &[to([501.0, 0.0, 200.0]), None, to([502.0, 0.0, 200.0])], &[]);
    assert!(text.contains("C00000=500.000,"), "{text}");
    assert_eq!(kept.iter().map(|(at, _)| *at).collect::<Vec<_>>(), [0, 2]);
}

const ROBOT: &str = "[robot]\nmodel = \"gp25\"\nstart_deg = [0.0, 0.0, 0.0, 0.0, -90.0, 0.0]\n\
    [robot.stiffness]\njoint_nm_per_rad = [3e5, 4e5, 3e5, 6e4, 6e4, 4e4]\n\
    [limits]\nmax_correction_mm = 5.0\nmax_step_mm = 5.0\n[controller]\ncompensates = []\n\
    [tools.\"TOOL 1\"]\ntcp_mm = [0.0, 0.0, 200.0]\ntcp_quat = [1.0, 0.0, 0.0, 0.0]\nmass_kg = 5.0\ncog_mm = [0.0, 0.0, 80.0]\n\
    [wobjs.\"USER 1\"]\nuframe_mm = [850.0, -60.0, 200.0]\nuframe_quat = [1.0, 0.0, 0.0, 0.0]\noframe_mm = [0.0, 0.0, 0.0]\noframe_quat = [1.0, 0.0, 0.0, 0.0]\n\
    [cut]\nforce = \"constant\"\nforce_n = [120.0, -200.0, 150.0]\nframe = \"wobj\"\n";

fn cell(more: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", format!("{ROBOT}{more}"))).unwrap_or_else(|errors| panic!("{errors:?}"))
}

fn path() -> String {
    job(
        &[
            "0.000,0.000,50.000,180.0000,0.0000,0.0000",
            "0.000,0.000,0.000,180.0000,0.0000,0.0000",
            "100.000,0.000,0.000,180.0000,0.0000,0.0000",
            "100.000,50.000,0.000,175.0000,-3.0000,12.0000",
        ],
        "MOVJ C00000 VJ=10.00\nMOVL C00001 V=20.0 PL=0\nMOVL C00002 V=20.0 PL=0\nMOVL C00003 V=20.0 PL=0\n",
    )
}

#[test]
fn what_is_corrected_lands_and_is_what_rapid_gets() {
    let cell = cell("");
    let program = read(&path());
    let corrected = compensate(&program, &cell, &Options::default()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let rewritten = corrected.rewritten.as_ref().unwrap();
    let bytes = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    let again = read(std::str::from_utf8(&bytes).unwrap());
    let after = predict(&again, &cell, &Options::default(), Some(&program)).unwrap();
    // Half a micrometre an axis, and half of a ten-thousandth of a degree at 310 mm from the flange.
    assert!(after.rows.iter().skip(1).all(|row| row.error_norm_mm() < 0.002), "{:?}", after.rows);
    assert!(corrected.rows.iter().skip(1).all(|row| row.error_norm_mm() > 0.1));
    // The same arm, tool and poses in RAPID: the same corrections.
    let mut module = "MODULE M\nPERS tooldata t:=[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];\nPERS wobjdata w:=[FALSE,TRUE,\"\",[[850,-60,200],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nPROC main()\n".to_owned();
    for (i, target) in program.targets.iter().enumerate() {
        let Goal::Pose { position_mm: [x, y, z], quat: [a, b, c, d], .. } = target.goal else { panic!() };
        let _ = writeln!(
            module,
            "{} [[{x:.6},{y:.6},{z:.6}],[{a:.10},{b:.10},{c:.10},{d:.10}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,t\\WObj:=w;",
            if i == 0 { "MoveJ" } else { "MoveL" }
        );
    }
    module += "ENDPROC\nENDMODULE\n";
    let twin = rapid::read(vec![Source::new("m.mod", module)], Vec::new()).unwrap();
    let same = compensate(&twin, &cell, &Options::default()).unwrap();
    for (ours, theirs) in corrected.rows.iter().zip(&same.rows) {
        let off = (0..3).map(|i| (ours.correction_mm[i] - theirs.correction_mm[i]).abs()).fold(0.0, f64::max);
        assert!(off < 1.2e-3, "{:?} {:?}", ours.correction_mm, theirs.correction_mm);
    }
}

#[test]
fn points_between_are_refused_with_a_reason() {
    let program = read(&path());
    let Goal::Pose { quat, .. } = program.targets[2].goal else { panic!() };
    let insert = Insert::line(2, ([50.0, 0.0, 0.0], quat), 50.0);
    let changes = vec![None; program.targets.len()];
    let rewritten = program.rewrite(&changes, std::slice::from_ref(&insert), &RewriteOptions::default());
    let [(2, why)] = rewritten.not_inserted[..] else { panic!("{:?}", rewritten.not_inserted) };
    assert_eq!(why, Reason::NumbersElsewhere);
    let (text, _) = written(&program, &changes, &[insert]);
    assert_eq!(text, path());
}

#[test]
fn jobs_that_are_not_given_are_named_and_can_be_vouched_for() {
    let text = "/JOB\n//NAME A\n//POS\n///TOOL 1\n///POSTYPE ROBOT\nP00001=900.000,0.000,500.000,180.0000,0.0000,0.0000\n//INST\nNOP\nCALL JOB:SPINDLE\nMOVL P001 V=10.0\nEND\n";
    let program = read(text);
    let warning = program.diagnostics.iter().find(|d| d.severity == Severity::Warning).unwrap();
    assert!(warning.code == "program.called" && warning.message.contains("SPINDLE"), "{warning:?}");
    assert_eq!((program.targets.len(), program.unknown.len()), (0, 1));
    let controlled = cell(
        "[tools.\"TOOL 2\"]\ntcp_mm = [0.0, 0.0, 1.0]\ntcp_quat = [1.0, 0.0, 0.0, 0.0]\nmass_kg = 1.0\ncog_mm = [0.0, 0.0, 0.0]\n",
    );
    assert!(controlled.controller.declarations(Language::Jbi).is_empty());
    let harmless = ROBOT.replace("compensates = []", "compensates = []\nharmless = [\"SPINDLE\"]");
    let vouching = Cell::read(&Source::new("cell.toml", harmless)).unwrap();
    let vouched = vouching.controller.declarations(Language::Jbi);
    let program = jbi::read(vec![Source::new("A.JBI", text)], vouched).unwrap();
    assert_eq!(program.targets[0].editable, Editable::Pose);
}

#[test]
fn more_than_one_posture_is_said() {
    let text = path().replace("C00002=", "///RCONF 0,1,0,0,0,0,0,0\r\nC00002=");
    let program = read(&text);
    assert_eq!(program.diagnostics.iter().map(|said| said.code).collect::<Vec<_>>(), ["jbi.posture"]);
    assert!(read(&path()).diagnostics.is_empty());
}

#[test]
fn cl_data_are_posted_as_inform() {
    let more = "[cl]\ntool = \"TOOL 1\"\nwobj = \"USER 1\"\nunits = \"mm\"\npoint = \"tip\"\nspin = \"fixed\"\nspin_deg = 0.0\n";
    let text = "UNITS/MM\nFEDRAT/1200,MMPM\nRAPID\nGOTO/0,0,50,0,0,1\nGOTO/0,0,10,0,0,1\nDELAY/2\nGOTO/100,0,10,0,0,1\nGOTO/100,50,10,0,0,1\nFINI\n";
    let cell = cell(more);
    let options = cell.cl.as_ref().unwrap().options.clone();
    let program = deflex::program::cl::read(Source::new("a.cl", text), &options).unwrap();
    let posts = Options { post: Some(Language::Jbi), ..Options::default() };
    let corrected = compensate(&program, &cell, &posts).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    assert!(corrected.rows.iter().all(|row| row.remaining_norm_mm() < 0.002));
    let options = PostOptions {
        name: "part".into(),
        title: vec!["a test".into()],
        max_targets: None,
        rapid_mm_s: 200.0,
        feed_mm_s: None,
        language: Language::Jbi,
    };
    let posted = post(&program, &cell, &corrected, &options).unwrap();
    assert!(posted.notes.iter().any(|note| note.code == "post.check" && note.message.contains("RCONF")));
    let [(name, bytes)] = &posted.files[..] else { panic!() };
    assert_eq!(name, "PART.JBI");
    assert!(String::from_utf8_lossy(bytes).contains("\r\nTIMER T=2.00\r\n"));
    let again = read(std::str::from_utf8(bytes).unwrap());
    assert_eq!(again.targets.len(), 4);
    for (target, posted) in again.targets.iter().zip(&corrected.posted) {
        let Goal::Pose { position_mm, quat, .. } = target.goal else { panic!() };
        let off = (0..3).map(|i| (position_mm[i] - posted.position_mm[i]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9, "{target:?} {posted:?}");
        assert!((quat.iter().zip(posted.quat).map(|(a, b)| a * b).sum::<f64>().abs() - 1.0).abs() < 1e-10);
        assert_eq!(target.editable, Editable::Pose);
    }
    // Positions in one frame: a relative job, which names it.
    assert!(String::from_utf8_lossy(bytes).contains("\r\n///ATTR SC,RW,RJ\r\n////FRAME USER 1\r\n"));
    // A part begins where the part before ends, and the path between both is a line.
    let split = PostOptions { max_targets: Some(2), ..options.clone() };
    let parts = post(&program, &cell, &corrected, &split).unwrap().files;
    let instructions = |at: usize| String::from_utf8_lossy(&parts[at].1).into_owned();
    assert_eq!(parts.len(), 3);
    assert_eq!((instructions(1).matches("MOVJ").count(), instructions(2).matches("MOVJ").count()), (1, 0));
    assert_eq!(instructions(2).matches("MOVL").count(), 2);
    // A controller knows frames by their numbers.
    let named = ROBOT.replace("TOOL 1", "mill") + &more.replace("TOOL 1", "mill");
    let other = Cell::read(&Source::new("cell.toml", named)).unwrap();
    let program = deflex::program::cl::read(Source::new("a.cl", text), &other.cl.as_ref().unwrap().options).unwrap();
    let corrected = compensate(&program, &other, &posts).unwrap();
    assert_eq!(post(&program, &other, &corrected, &options).unwrap_err()[0].code, "post.name");
}
