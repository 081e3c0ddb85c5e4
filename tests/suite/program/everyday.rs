//! Programs as shops and post-processors write them, which must not be left alone; and programs that differ in one thing, which must.

use deflex::program::{Change, Editable, Goal, Program, Reason, RewriteOptions, WobjData, jbi, krl, rapid, tp};
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

fn written(program: &Program, changes: &[Option<Change>]) -> (String, Vec<usize>) {
    let rewritten = program.rewrite(changes, &[], &RewriteOptions::default());
    let mut out = Vec::new();
    apply(&program.sources[0].bytes, &rewritten.edits[0], &mut out).unwrap();
    (String::from_utf8(out).unwrap(), rewritten.kept.iter().map(|kept| kept.0).collect())
}

/// Programs in which three motions go to one position, by language.
fn three_times() -> Vec<Program> {
    let rapid = format!(
        "CONST robtarget p1:={};\nPROC main()\nMoveJ p1,v20,z1,t1\\WObj:=w1;\nMoveL p1,v20,z1,t1\\WObj:=w1;\nMoveL p1,v20,z1,t1\\WObj:=w1;\nENDPROC",
        at(10.0)
    );
    let tp = "/PROG M\n/MN\n1:J P[1] 10% FINE ;\n2:L P[1] 10mm/sec FINE ;\n3:L P[1] 10mm/sec FINE ;\n/POS\nP[1]{ GP1: UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = 10.000 mm, Y = 0.000 mm, Z = 0.000 mm, W = 0.000 deg, P = 0.000 deg, R = 0.000 deg };\n/END\n";
    let krl = "DEF M()\nDECL E6POS P\nP={X 10.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\nLIN P\nLIN P\nLIN P\nEND\n";
    let jbi = "/JOB\n//NAME M\n//POS\n///NPOS 1,0,0,0,0,0\n///TOOL 1\n///POSTYPE USER\n///USER 1\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\nC00000=10.000,0.000,0.000,0.0000,0.0000,0.0000\n//INST\n///DATE 2024/01/01 00:00\n///ATTR SC,RW,RJ\n////FRAME USER 1\n///GROUP1 RB1\nNOP\nMOVJ C00000 VJ=10.00\nMOVL C00000 V=10.0\nMOVL C00000 V=10.0\nEND\n";
    vec![
        read(&rapid),
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
        let (text, kept) = written(&program, &[to(10.25), to(10.250_9), to(10.250_1)]);
        assert!(text.contains("10.25") && kept.is_empty(), "{name}: {kept:?}\n{text}");
        let (text, kept) = written(&program, &[to(10.25), to(10.252), to(10.25)]);
        assert!(!text.contains("10.25") && kept == [0, 1, 2], "{name}: {kept:?}\n{text}");
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
    assert_eq!(krl("ANIN ON rH = 0.5 * siH + 2.0"), [1.0, 3.0]);
    assert_eq!(krl("ANIN ON rH = 0.5 * $ANIN[1]"), [1.0, 3.0]);
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
