//! Programs as shops and post-processors write them, which must not be left alone; and programs that differ in one thing, which must.

use deflex::cell::Cell;
use deflex::correct::{self, Options, Row, Summary};
use deflex::program::{
    Change, Conf, Confdata, Editable, Goal, Language, Program, Reason, RewriteOptions, WobjData, jbi, krl, rapid, tp,
    ur,
};
use deflex::report;
use deflex::text::{Source, apply};

const EXT: &str = "[9E9,9E9,9E9,9E9,9E9,9E9]";

/// A target at `x`.
fn at(x: f64) -> String {
    format!("[[{x},0,0],[0,1,0,0],[-1,0,1,0],{EXT}]")
}

fn read(body: &str) -> Program {
    let text = format!(
        "MODULE M\nPERS tooldata t1:=[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];\n\
         PERS tooldata t2:=[TRUE,[[0,0,300],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];\n\
         PERS wobjdata w1:=[FALSE,TRUE,\"\",[[1200,100,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n{body}\nENDMODULE\n"
    );
    rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap_or_else(|errors| panic!("{errors:?}"))
}

/// The x of each target, and why it is not edited.
fn listed(program: &Program) -> Vec<(f64, Option<Reason>)> {
    let of = |target: &deflex::program::Target| match (target.goal, target.editable) {
        (Goal::Pose { position_mm, .. }, Editable::No(why)) => (position_mm[0], Some(why)),
        (Goal::Pose { position_mm, .. }, _) => (position_mm[0], None),
        _ => (f64::NAN, None),
    };
    program.targets.iter().map(of).collect()
}

/// Parts that an input chooses, in a loop that does not end, with one line in the second of them.
fn chosen(call: &str, line: &str) -> Vec<(f64, Option<Reason>)> {
    let body = format!(
        "VAR num n;\nVAR string s;\nPERS tooldata tM:=[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];\nPROC main()\n\
         WHILE TRUE DO\nn:=GInput(giPart);\ns:=NumToStr(n,0);\n{call}\nENDWHILE\nENDPROC\n\
         PROC rSec1()\nMoveL {},v20,z1,tM\\WObj:=w1;\nENDPROC\nPROC rSec2()\nMoveL {},v20,z1,tM\\WObj:=w1;\n{line}\nENDPROC\n\
         PROC rSecB()\nMoveL {},v20,z1,tM\\WObj:=w1;\nENDPROC",
        at(1.0),
        at(2.0),
        at(3.0)
    );
    listed(&read(&body))
}

#[test]
fn a_part_that_an_input_chooses_is_followed() {
    let all = [(1.0, None), (2.0, None), (3.0, None)];
    assert_eq!(chosen("%\"rSec\"+NumToStr(n,0)%;", ""), all);
    assert_eq!(chosen("%\"rSec\"+s%;", ""), all);
    // By number, only names that end in digits.
    assert_eq!(chosen("CallByVar \"rSec\",n;", ""), all[..2]);
    assert_eq!(chosen("%\"rSec\"+s+\"B\"%;", ""), all[2..]);
    // No part of the name is known.
    let none = |call: &str| chosen(call, "").iter().all(|target| target.1.is_some());
    assert!(none("%s%;") && none("%s+\"1\"%;"));
    // The part before may have been the second one.
    let why = |line: &str| chosen("%\"rSec\"+NumToStr(n,0)%;", line).iter().map(|target| target.1).collect::<Vec<_>>();
    assert!(chosen("%\"rSec\"+NumToStr(n,0)%;", "tM:=t2;").is_empty(), "the tool is unknown");
    assert_eq!(why("PDispSet [[1,0,0],[1,0,0,0]];"), [Some(Reason::DisplacementUnknown); 3]);
    assert_eq!(why("SetDO do1,1;"), [None; 3]);
}

fn frame_of(program: &Program, target: usize) -> WobjData {
    program.wobjs[usize::from(program.targets[target].wobj)].data.unwrap()
}

/// By hand: a turn by 90° about z takes x to y.
#[test]
fn frames_that_a_program_computes_are_known() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let body = |value: &str| {
        format!(
            "VAR wobjdata wL:=[FALSE,TRUE,\"\",[[1200,100,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n\
             CONST pose pA:=[[10,0,0],[0.70710678,0,0,0.70710678]];\nCONST pose pB:=[[5,0,0],[1,0,0,0]];\n\
             CONST robtarget d1:=[[1,2,3],[0,1,0,0],[-1,0,1,0],{EXT}];\nCONST robtarget d2:=[[1,102,3],[0,1,0,0],[-1,0,1,0],{EXT}];\n\
             CONST robtarget d3:=[[-49,12,3],[0,1,0,0],[-1,0,1,0],{EXT}];\n\
             PROC main()\nwL.oframe:={value};\nMoveL {},v20,z1,t1\\WObj:=wL;\nMoveL d1,v20,z1,t1\\WObj:=w1;\nENDPROC",
            at(1.0)
        )
    };
    let is_near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    let turned =
        |quat: [f64; 4], sign: f64| quat.iter().zip([half, 0.0, 0.0, sign * half]).all(|(a, b)| (a - b).abs() < 1e-6);
    for (value, position, sign) in [
        ("PoseMult(pA,pB)", [10.0, 5.0, 0.0], 1.0),
        ("PoseInv(pA)", [0.0, 10.0, 0.0], -1.0),
        ("[PoseVect(pA,[0,2,0]),pA.rot]", [8.0, 0.0, 0.0], 1.0),
        ("[[1,2,3],NOrient([2,0,0,2])]", [1.0, 2.0, 3.0], 1.0),
        ("DefFrame(d1,d2,d3)", [1.0, 2.0, 3.0], 1.0),
    ] {
        let program = read(&body(value));
        let frame = frame_of(&program, 0);
        assert!(is_near(frame.oframe_mm, position) && turned(frame.oframe_quat, sign), "{value}: {frame:?}");
        assert_eq!(program.targets[0].editable, Editable::Pose, "{value}");
        // A point that defines a frame is not corrected: the frame would move with it.
        let defines = value.starts_with("DefFrame");
        assert_eq!(
            program.targets[1].editable == Editable::Pose,
            !defines,
            "{value}: {:?}",
            program.targets[1].editable
        );
    }
    for unknown in
        ["PoseMult(pA,[[ReadNum(com1),0,0],[1,0,0,0]])", "DefFrame(d1,d2,d3\\Origin:=3)", "DefFrame(d1,d1,d3)"]
    {
        assert_eq!(read(&body(unknown)).targets.len(), 1, "{unknown}");
    }
}

/// ABB: after `ConfJ\Off`, a joint motion goes to the nearest configuration.
#[test]
fn confj_off_lets_the_controller_choose() {
    let conf = |first: &str| {
        let body = format!(
            "PROC main()\n{first}\nMoveJ {},v20,z1,t1\\WObj:=w1;\nMoveL {},v20,z1,t1\\WObj:=w1;\nENDPROC",
            at(1.0),
            at(2.0)
        );
        let program = read(&body);
        program.targets.iter().map(|target| (target.conf().is_some(), target.editable)).collect::<Vec<_>>()
    };
    let stated = [(true, Editable::Pose); 2];
    assert_eq!(conf(""), stated);
    assert_eq!(conf("ConfJ\\Off;\nConfJ\\On;"), stated);
    assert_eq!(conf("ConfJ\\Off;"), [(false, Editable::Pose), stated[1]]);
    assert_eq!(conf("IF di1=1 THEN\nConfJ\\Off;\nENDIF")[0].1, Editable::No(Reason::NearestUnknown));
}

fn to(x: f64) -> Option<Change> {
    Some(Change { position_mm: [x, 0.0, 0.0], quat: None, conf: None, external: None })
}

/// The text, and the kept targets. `air` has the targets that cut nothing.
fn written(program: &Program, changes: &[Option<Change>], air: &[bool]) -> (String, Vec<usize>) {
    let rewritten = program.rewrite(changes, &[], &RewriteOptions { air, ..RewriteOptions::default() });
    let mut out = Vec::new();
    apply(&program.sources[0].bytes, &rewritten.edits[0], &mut out).unwrap();
    (String::from_utf8(out).unwrap(), rewritten.kept.iter().map(|kept| kept.0).collect())
}

/// Whether a text has this x, mm.
fn has(program: &Program, text: &str, x: &str) -> bool {
    // URScript counts in metres.
    let metres = || format!("0.0{}", x.replace('.', ""));
    if program.language == Language::Ur { text.contains(&metres()) } else { text.contains(x) }
}

/// Programs in which three motions go to one position, by language.
fn three_times() -> Vec<Program> {
    let rapid = format!(
        "CONST robtarget p1:={};\nPROC main()\nMoveJ p1,v20,z1,t1\\WObj:=w1;\nMoveL p1,v20,z1,t1\\WObj:=w1;\nMoveL p1,v20,z1,t1\\WObj:=w1;\nENDPROC",
        at(10.0)
    );
    let tp = "/PROG M\n/MN\n1:J P[1] 10% FINE ;\n2:L P[1] 10mm/sec FINE ;\n3:L P[1] 10mm/sec FINE ;\n/POS\nP[1]{ GP1: UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = 10.000 mm, Y = 0.000 mm, Z = 0.000 mm, W = 0.000 deg, P = 0.000 deg, R = 0.000 deg };\n/END\n";
    let krl = "DEF M()\nDECL E6POS P\nP={X 10.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\nPTP P\nLIN P\nLIN P\nEND\n";
    let jbi = "/JOB\n//NAME M\n//POS\n///NPOS 1,0,0,0,0,0\n///TOOL 1\n///POSTYPE USER\n///USER 1\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\nC00000=10.000,0.000,0.000,0.0000,0.0000,0.0000\n//INST\n///DATE 2024/01/01 00:00\n///ATTR SC,RW,RJ\n////FRAME USER 1\n///GROUP1 RB1\nNOP\nMOVJ C00000 VJ=10.00\nMOVL C00000 V=10.0\nMOVL C00000 V=10.0\nEND\n";
    let ur = "set_tcp(p[0, 0, 0.1, 0, 0, 0])\nset_payload(2, [0, 0, 0.05])\np1 = p[0.010, 0.000, 0.000, 0, 0, 0]\nmovej(p1)\nmovel(p1, v=0.02)\nmovel(p1, v=0.02)\n";
    vec![
        read(&rapid),
        ur::read(vec![Source::new("m.script", ur)], Vec::new()).unwrap(),
        tp::read(vec![Source::new("m.ls", tp)], Vec::new()).unwrap(),
        krl::read(vec![Source::new("m.src", krl)], Vec::new()).unwrap(),
        jbi::read(vec![Source::new("m.jbi", jbi)], Vec::new()).unwrap(),
    ]
}

#[test]
fn motions_that_share_numbers_agree_where_a_difference_has_no_effect() {
    for program in three_times() {
        let name = program.language.name();
        assert_eq!(program.targets.len(), 3, "{name}");
        let (text, kept) = written(&program, &[to(10.25), to(10.250_9), to(10.250_1)], &[]);
        assert!(has(&program, &text, "10.25") && kept.is_empty(), "{name}: {kept:?}\n{text}");
        let (text, kept) = written(&program, &[to(10.25), to(10.252), to(10.25)], &[]);
        assert!(!has(&program, &text, "10.25") && kept == [0, 1, 2], "{name}: {kept:?}\n{text}");
    }
}

#[test]
fn a_motion_through_air_goes_where_the_cut_goes() {
    for program in three_times() {
        let name = program.language.name();
        // With and without a correction of its own.
        for own in [None, to(10.1)] {
            let changes = [own.clone(), to(10.25), to(10.25)];
            let air = [true, false, false];
            let (text, kept) = written(&program, &changes, &air);
            assert!(has(&program, &text, "10.25") && kept.is_empty(), "{name}: {kept:?}\n{text}");
            let there = program.rewrite(&changes, &[], &RewriteOptions { air: &air, ..RewriteOptions::default() });
            let by = there.written[0].0.iter().zip([10.25, 0.0, 0.0]).map(|(is, x)| (is - x).abs()).fold(0.0, f64::max);
            assert!(by < 1e-6 && there.along == [0], "{name}: {:?} {:?}", there.written, there.along);
            // If it cuts, the two disagree.
            let (text, kept) = written(&program, &changes, &[]);
            assert!(!has(&program, &text, "10.25") && kept.contains(&1), "{name}: {kept:?}\n{text}");
            // A cut that needs no correction stays.
            let (text, _) = written(&program, &[own, None, None], &air);
            assert!(!has(&program, &text, "10.1"), "{name}\n{text}");
            // Two cuts that differ have no number in common.
            let (text, kept) = written(&program, &[None, to(10.25), to(10.252)], &air);
            assert!(!has(&program, &text, "10.25") && kept == [1, 2], "{name}: {kept:?}\n{text}");
        }
    }
}

/// Above each hole, down, and back, with one routine for all holes.
#[test]
fn the_approach_of_a_drilling_cycle_goes_along_with_the_hole() {
    for above in ["Offs(p,0,0,nSafe)", "Offs(p,0,0,25)", "RelTool(p,0,0,-25)"] {
        let body = format!(
            "CONST num nSafe:=25;\nCONST robtarget p1:={};\nCONST robtarget p2:={};\nPROC main()\nrDrill p1;\nrDrill p2;\nENDPROC\n\
             PROC rDrill(robtarget p)\nMoveJ {above},v300,z5,t1\\WObj:=w1;\nMoveL p,v10,fine,t1\\WObj:=w1;\n\
             MoveL {above},v300,z5,t1\\WObj:=w1;\nENDPROC",
            at(10.0),
            at(20.0)
        );
        let program = read(&body);
        let changes = [None, to(10.25), None, None, to(20.5), None];
        let air = [true, false, true, true, false, true];
        let (text, kept) = written(&program, &changes, &air);
        assert!(text.contains("10.25") && text.contains("20.5") && kept.is_empty(), "{above}: {kept:?}\n{text}");
        assert!(text.contains(above), "{text}");
        let there = program.rewrite(&changes, &[], &RewriteOptions { air: &air, ..RewriteOptions::default() });
        assert_eq!((there.written[2].0, &there.along[..]), ([10.25, 0.0, 25.0], &[0, 2, 3, 5][..]), "{above}");
        // If the way back cuts, it must not move with the hole.
        let (text, kept) = written(&program, &changes, &[true, false, false, true, false, false]);
        assert!(!text.contains("10.25") && kept.contains(&1), "{above}: {kept:?}\n{text}");
    }
}

/// The configuration in the text of a hole is that of the point above it too, which the arm may reach in another one. Whether a motion through
/// air may is judged with the arm.
#[test]
fn a_joint_motion_above_a_hole_keeps_its_configuration() {
    let body = |above: &str| {
        format!(
            "CONST num nSafe:=25;\nCONST robtarget p1:={};\nPROC main()\n{above} Offs(p1,0,0,nSafe),v300,z5,t1\\WObj:=w1;\n\
             MoveL p1,v10,fine,t1\\WObj:=w1;\nENDPROC",
            at(10.0)
        )
    };
    for (above, is_air, goes) in [("MoveJ", false, false), ("MoveJ", true, true), ("MoveL", true, true)] {
        let program = read(&body(above));
        let conf = Some(Conf::Quarters(Confdata { cf1: 0, cf4: 0, cf6: 1, cfx: 0 }));
        let change = Change { conf, ..to(10.25).unwrap() };
        let (text, kept) = written(&program, &[None, Some(change)], &[is_air, false]);
        assert_eq!((text.contains("10.25"), kept.is_empty()), (goes, goes), "{above} {is_air}: {kept:?}\n{text}");
    }
}

/// KUKA: `ANIN ON` computes the value of a variable again and again.
#[test]
fn an_analog_input_changes_its_variable_alone() {
    let krl = |line: &str| {
        let text = format!(
            "DEF M()\nDECL REAL rH\nSIGNAL siH $ANIN[1]\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\nrH=5.0\n{line}\nLIN {{X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}\nLIN {{X 4.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}\nLIN {{X 2.0,Y 0.0,Z rH,A 0.0,B 0.0,C 0.0}}\nANIN OFF rH\nLIN {{X 3.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}\nEND\n"
        );
        let program = krl::read(vec![Source::new("m.src", text)], Vec::new()).unwrap();
        listed(&program).into_iter().filter(|target| target.1.is_none()).map(|target| target.0).collect::<Vec<_>>()
    };
    // The motion to X 2 has a height of its own, and takes nothing over from the motion before it.
    assert_eq!(krl("ANIN ON rH = 0.5 * siH + 2.0"), [1.0, 4.0, 3.0]);
    assert_eq!(krl("ANIN ON rH = 0.5 * $ANIN[1]"), [1.0, 4.0, 3.0]);
}

/// FANUC: `OVERRIDE` scales every speed after it.
#[test]
fn the_override_scales_the_feed() {
    let feeds = |first: &str| {
        let text = format!(
            "/PROG M\n/MN\n1:R[2]=20 ;\n2:{first} ;\n3:L P[1] 10mm/sec FINE ;\n4:L P[1] R[2]mm/sec FINE ;\n/POS\nP[1]{{ GP1: UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = 10.000 mm, Y = 0.000 mm, Z = 0.000 mm, W = 0.000 deg, P = 0.000 deg, R = 0.000 deg }};\n/END\n"
        );
        let program = tp::read(vec![Source::new("m.ls", text)], Vec::new()).unwrap();
        program.targets.iter().map(|target| target.feed_mm_s).collect::<Vec<_>>()
    };
    assert_eq!(feeds("! none"), [Some(10.0), Some(20.0)]);
    assert_eq!(feeds("OVERRIDE=50%"), [Some(5.0), Some(10.0)]);
    assert_eq!(feeds("OVERRIDE=R[2]"), [Some(2.0), Some(4.0)]);
    // A cycle begins with the override that the one before left.
    let begins = |last: &str| {
        let text = format!(
            "/PROG M\n/MN\n1:L P[1] 10mm/sec FINE ;\n2:OVERRIDE=50% ;\n3:L P[1] 10mm/sec FINE ;\n{last}/POS\nP[1]{{ GP1: UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = 10.000 mm, Y = 0.000 mm, Z = 0.000 mm, W = 0.000 deg, P = 0.000 deg, R = 0.000 deg }};\n/END\n"
        );
        tp::read(vec![Source::new("m.ls", text)], Vec::new()).unwrap().targets[0].feed_mm_s
    };
    assert_eq!(begins("4:OVERRIDE=100% ;\n"), Some(10.0));
    for changed in
        ["", "4:IF DI[1]=ON,OVERRIDE=100% ;\n", "4:IF DI[1]=ON,JMP LBL[1] ;\n5:OVERRIDE=100% ;\n6:LBL[1] ;\n"]
    {
        assert_eq!(begins(changed), None, "{changed}");
    }
    // Known only at run time.
    for unknown in ["OVERRIDE=R[3]", "IF DI[1]=ON,OVERRIDE=50%", "$MCR.$GENOVERRIDE=50"] {
        assert_eq!(feeds(unknown), [None, None], "{unknown}");
    }
}

/// Yaskawa: a parameter of the controller sets the unit of `V`.
#[test]
fn the_cell_states_the_unit_of_speeds_in_inform() {
    let text = "/JOB\n//NAME M\n//POS\n///NPOS 1,0,0,0,0,0\n///TOOL 1\n///POSTYPE USER\n///USER 1\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\nC00000=10.000,0.000,0.000,0.0000,0.0000,0.0000\n//INST\n///DATE 2024/01/01 00:00\n///ATTR SC,RW,RJ\n////FRAME USER 1\n///GROUP1 RB1\nNOP\nSET I000 300\nMOVL C00000 V=60.0\nMOVL C00000 V=I000\nEND\n";
    let feeds = |unit: jbi::SpeedUnit| {
        let mut program = jbi::read(vec![Source::new("m.jbi", text)], Vec::new()).unwrap();
        jbi::take_speeds_in(&mut program, unit);
        program.targets.iter().map(|target| target.feed_mm_s).collect::<Vec<_>>()
    };
    assert_eq!(feeds(jbi::SpeedUnit::MillimetresPerSecond), [Some(60.0), Some(30.0)]);
    assert_eq!(feeds(jbi::SpeedUnit::CentimetresPerMinute), [Some(10.0), None]);
    assert_eq!(feeds(jbi::SpeedUnit::InchesPerMinute), [Some(25.4), None]);
}

const CELL: &str = "[robot]\nmodel = \"irb6700-150-3.20\"\nstart_deg = [0, 0, 0, 0, 60, 0]\n\
    [robot.stiffness]\njoint_nm_per_rad = [6e5, 5e5, 4e5, 9e4, 8e4, 5e4]\n[controller]\ncompensates = []\n\
    [cut]\nforce = \"constant\"\nforce_n = [31.0, 19.0, 24.0]\nframe = \"wobj\"\nmax_cutting_feed_mm_s = 100.0\n";

/// The correction of a program in this cell: its rows.
fn corrected(body: &str) -> Vec<Row> {
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let corrected = correct::compensate(&read(body), &cell, &Options::default()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    corrected.rows
}

/// To the start of a cut, along it, and up from its start.
fn cut_from(y: f64, conf: [f64; 4], first: &str) -> String {
    format!(
        "CONST num nSafe:=25;\nCONST robtarget p1:=[[10,{y},0],[0,1,0,0],{conf:?},{EXT}];\nCONST robtarget p2:=[[40,60,0],[0,1,0,0],{conf:?},{EXT}];\n\
         PROC main()\n{first}\nMoveJ p1,v300,fine,t1\\WObj:=w1;\nMoveL p2,v20,fine,t1\\WObj:=w1;\nMoveL p1,v20,fine,t1\\WObj:=w1;\n\
         MoveL Offs(p1,0,0,nSafe),v300,fine,t1\\WObj:=w1;\nENDPROC"
    )
}

#[test]
fn the_report_says_which_motions_go_along_and_how_far() {
    let rows = corrected(&cut_from(50.0, [0.0; 4], ""));
    assert_eq!(rows.iter().map(|row| row.goes_along).collect::<Vec<_>>(), [true, false, false, true]);
    assert!(rows.iter().all(|row| row.reason().is_empty()), "{rows:?}");
    let [there, cut, above] = [0, 2, 3].map(|i| rows[i].correction_mm);
    assert_eq!(there.map(f64::to_bits), cut.map(f64::to_bits), "{there:?} {cut:?}");
    assert!(rows[2].correction_norm_mm() > 0.1, "{cut:?}");
    assert!(cut.iter().zip(above).all(|(a, b)| (a - b).abs() < 1e-3), "{cut:?} {above:?}");
    let sum = Summary::of(&rows);
    assert_eq!((sum.corrected, sum.air, sum.along, sum.kept.len()), (2, 2, 2, 0));
    assert!((sum.max_along_mm - rows[0].correction_norm_mm()).abs() < 1e-3, "{sum:?}");
}

/// The correction turns axis 1 through zero: the joint motion arrives in the configuration that the text then has.
#[test]
fn a_joint_motion_goes_along_into_another_configuration() {
    // The work object is 100 mm to the side: these targets are 0.01 mm on the positive side of the robot.
    let y = -99.99;
    let conf = conf_at(y);
    assert!(conf[0].abs() < f64::EPSILON, "{conf:?}");
    for first in ["", "ConfJ\\Off;"] {
        let rows = corrected(&cut_from(y, conf, first));
        assert!(rows[0].goes_along && rows[2].reason().is_empty(), "{first} {rows:?}");
    }
}

/// The configuration of the arm at the first target, by its axes.
fn conf_at(y: f64) -> [f64; 4] {
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let rows = correct::predict(&read(&cut_from(y, [0.0; 4], "")), &cell, &Options::default(), None).unwrap().rows;
    let [j1, _, _, j4, j5, j6] = rows[0].joints_deg.unwrap();
    let quarter = |deg: f64| (deg / 90.0).floor();
    [quarter(j1), quarter(j4), quarter(j6), f64::from(u8::from(j5 < 0.0))]
}

/// The rows of one program after a correction, and its text.
fn rows_and_text(body: &str) -> (Program, Vec<Row>, String) {
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let program = read(body);
    let corrected = correct::compensate(&program, &cell, &Options::default()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let text = program.edited(&corrected.rewritten.unwrap().edits).remove(0);
    (program, corrected.rows, String::from_utf8(text.bytes.to_vec()).unwrap())
}

/// `diff` names no other text than that of the targets, and `check` finds the errors of the cut alone.
#[test]
fn a_program_whose_approach_went_along_compares_with_its_original() {
    let (program, rows, text) = rows_and_text(&cut_from(50.0, [0.0; 4], ""));
    let corrected = rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap();
    let found = report::difference(&program, &corrected);
    assert!(found.other.is_empty(), "{:?}", found.other);
    assert_eq!(found.moved.len(), 4);
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let judged = correct::predict(&corrected, &cell, &Options::default(), Some(&program)).unwrap().rows;
    for (row, judged) in rows.iter().zip(&judged) {
        assert_eq!(judged.is_through_air, row.goes_along);
        assert!(row.goes_along || judged.error_norm_mm() < 1e-3, "{judged:?}");
    }
    // Farther away than a correction may be, the error of a motion through air counts.
    let far = read(&cut_from(50.0, [0.0; 4], "").replace("nSafe:=25", "nSafe:=45"));
    let judged = correct::predict(&far, &cell, &Options::default(), Some(&program)).unwrap().rows;
    assert_eq!(judged.iter().map(|row| row.is_through_air).collect::<Vec<_>>(), [true, false, false, false]);
}

/// Cuts that are corrected, and motions that go along, of the motions to `p`, `q` and an offset.
fn fates(body: &str) -> (Vec<bool>, Vec<bool>) {
    let body = format!(
        "CONST robtarget p:={};\nCONST robtarget q:=[[60,20,0],[0,1,0,0],[-1,0,1,0],{EXT}];\nCONST robtarget r:=[[80,0,0],[0,1,0,0],[-1,0,1,0],{EXT}];\n\
         VAR num n:=1;\n{}",
        at(40.0),
        body.replace('@', ",v20,fine,t1\\WObj:=w1;")
    );
    let (_, rows, _) = rows_and_text(&body);
    let (along, cut) = (rows.iter().map(|row| row.goes_along), rows.iter().map(|row| row.correction_norm_mm() > 0.0));
    assert!(rows.iter().all(|row| !row.goes_along || row.correction_norm_mm() < 1.0), "{rows:?}");
    (cut.zip(along.clone()).map(|(cut, along)| cut && !along).collect(), along.collect())
}

/// Motions whose numbers differ between runs, that share an offset only, and that begin an arc or a cut that is kept.
#[test]
fn what_goes_along_and_what_holds_the_cut() {
    let main = |body: &str| format!("PROC main()\n{body}\nENDPROC");
    // Above the point by a counter: each round is another pose, and each goes along.
    let by_counter = main("FOR i FROM 1 TO 2 DO\nMoveJ Offs(p,0,0,10*i)@\nENDFOR\nMoveL p@");
    assert_eq!(fates(&by_counter), (vec![false, false, true], vec![true, true, false]));
    // An offset that is computed from the point itself would change with it.
    assert_eq!(fates(&main("MoveJ Offs(p,0,0,20-p.trans.x)@\nMoveL p@")), (vec![false; 2], vec![false; 2]));
    // Known at run time only.
    assert_eq!(fates(&main("n:=ReadNum(dev);\nMoveL q@\nMoveJ p@\nMoveJ Offs(p,0,0,n)@\nMoveL p@")).1, [false; 4]);
    // One statement, through air for one point and in the cut for another.
    let offset =
        "PROC main()\nrTo p;\n! deflex air\nrTo q;\nENDPROC\nPROC rTo(robtarget t)\nMoveL Offs(t,0,0,5)@\nENDPROC";
    assert_eq!(fates(offset), (vec![true, false], vec![false, true]));
    // The start of an arc goes along; a point of an arc does not.
    assert_eq!(fates(&main("MoveJ p@\nMoveC q,r@\nMoveL p@")), (vec![false, true, true], vec![true, false, false]));
    let arc = "MoveL p@\nMoveL q@\n! deflex air\nMoveC p,r@";
    assert_eq!(fates(&main(arc)), (vec![false, true, false], vec![false; 3]));
    // The start of a cut that is kept.
    let kept = "MoveJ p@\nMoveL RelTool(q,0,0,n+1)@\nMoveL p@";
    assert_eq!(fates(&main(kept)), (vec![false, false, true], vec![true, false, false]));
}
