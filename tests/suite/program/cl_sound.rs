//! Every construct of CL data that moves the tool, or changes what positions mean: understood or refused, never dropped.

use deflex::program::cl::{ClOptions, Units, read};
use deflex::program::{ActionKind, Goal, Program, Role};
use deflex::text::{Severity, Source};

fn options() -> ClOptions {
    ClOptions {
        tool: Some("tMill".into()),
        wobj: "wPart".into(),
        units: Some(Units::Millimetre),
        ..ClOptions::default()
    }
}

fn with(text: &str, options: &ClOptions) -> Program {
    read(Source::new("part.apt", text), options).expect("CL")
}

fn reads(text: &str) -> Program {
    with(text, &options())
}

/// Reasons why nothing is written, each with its line.
fn faults(program: &Program) -> Vec<(usize, String)> {
    program.faults().iter().map(|fault| (fault.line, fault.message.clone())).collect()
}

/// Places of all targets, rounded to a micrometre, and whether they are reached in rapid travel.
fn path(program: &Program) -> Vec<([f64; 3], bool)> {
    let rounded = |v: f64| (v * 1e3).round() / 1e3 + 0.0;
    let place = |goal| match goal {
        Goal::Axis { position_mm, .. } => position_mm.map(rounded),
        _ => panic!("CL targets have an axis"),
    };
    program.targets.iter().map(|t| (place(t.goal), t.rapid)).collect()
}

fn feed(text: &str) -> Option<f64> {
    let program = reads(&format!("{text}\nGOTO/1,2,3\n"));
    assert!(faults(&program).is_empty(), "{text}: {:?}", faults(&program));
    program.targets[0].feed_mm_s
}

/// A statement between two positions is refused at its own line, with a help.
#[test]
fn what_moves_the_tool_or_changes_positions_and_is_not_understood_is_refused_at_its_line() {
    for statement in [
        "RETRCT",
        "RETRCT/10",
        "GOCLER",
        "CALLSUB/1",
        "CALSUB/1",
        "DEFSUB/1",
        "PROBE/1,2,3",
        "MODE/INCR",
        "MODE / INCR",
        "SET/MODE,INCR",
        "CUTCOM/ON",
        "CUTCOM/LEFT",
        "CUTCOM/RIGHT,XYPLAN",
        "CUTCOM/ADJUST,1",
        "CUTCOM/NORMDS",
        "ADJUST/1",
        "HEAD/2",
        "SET/HEAD,2",
        "THREAD/AUTO,1.5",
        "COPY/1,TRANSL,10,0,0,3",
        "COPY/1,SAME,2",
        "TRACUT/1,0,0,5,0,1,0,0,0,0,1,0",
        "TRANS/10,0,0",
        "ROTABL/90,CLW",
        "ROTABL/ATANGL,45",
        "ROTHED/30,AAXIS",
        "MIRROR/1",
        "SCALE/2",
        "ZERO/1",
        "NURBS",
        "SPLINE/1",
        "ARC/1,2,3,0,0,1,5,6,7,8",
        "HELIX/1,2,3",
        "MOVETO/1,2,3",
        "GOPLUS/1,2,3",
        "FOOBAR/1,2,3",
        "CIRCULAR/1,2,3",
        "SADDLE/5",
        "OFSTNO/2",
        "PREFUN/91",
        "PREFUN/42",
        "SYN/GT,GOTO",
        "MSYS/1,2",
        "CSYS/1,2,3",
        "ORIGIN/P1",
        "UNITS/FURLONG",
        "TLAXIS/V1",
        "TLON,GOFWD/L1,PAST,L2",
        "GODLTA/P1",
        "GODLTA/1,2",
        "FROM/P1",
        "GOTO/P1",
        "GOTO/1,2",
        "GOTO/1,,2,3",
        "GOTO/1,2,3,4",
        "GOTO/1,2,3,0,0,2",
        "GOTO/1,2,3,0,0,1,5,6,7",
        "GOTO/1,2,3,0,0,1,0.5,0,0,0,0,1",
        "1.0,2.0,3.0",
    ] {
        let more = "GOTO/5,0,10\n".repeat(8); // one such word in few positions is another language
        let text = format!("UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,10\n{statement}\n{more}FINI\n");
        let program = reads(&text);
        let found = faults(&program);
        assert!(found.iter().any(|(line, _)| *line == 4), "{statement}: {found:?}");
        assert!(program.faults().iter().all(|fault| fault.help.is_some()), "{statement}");
    }
}

#[test]
fn what_changes_nothing_is_not_refused() {
    for statement in [
        "MODE/ABSOL",
        "SET/MODE,ABSOL",
        "CUTCOM/OFF",
        "HEAD/1",
        "TRACUT/NOMORE",
        "TRACUT/1,0,0,0,0,1,0,0,0,0,1,0",
        "TRANS/0,0,0",
        "ROTABL/0,CLW",
        "MULTAX/ON",
        "MULTAX/OFF",
        "LINTOL/0.05",
        "PREFUN/4",
        "AUXFUN/8",
        "INDEX/1",
        "SELECT/TOOL,4",
        "SELECT/OFSETL,1",
        "LOADTL/1,ADJUST,1,LENGTH,100",
        "RECIPE/5",
        "CSI_SET_FLUTE_LENGTH/19.",
        "PPRINT/'GOTO 1,2,3'",
        "REMARK GOHOME",
        "SOMETHING/ELSE",
        "STOCK/BLOCK,0,0,0,100,100,50",
        "VENDOR/5",
        "SYN/'TLAXIS','$$*TLAXIS'",
    ] {
        let text = format!("UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,10\n{statement}\nGOTO/5,0,10\nFINI\n");
        let program = reads(&text);
        assert!(faults(&program).is_empty(), "{statement}: {:?}", faults(&program));
        assert_eq!(path(&program), [([0.0, 0.0, 10.0], false), ([5.0, 0.0, 10.0], false)], "{statement}");
    }
}

#[test]
fn unknown_words_survive_and_are_listed_with_their_count() {
    let program = reads("UNITS/MM\nSOMETHING/ELSE\nGOTO/1,2,3\nSOMETHING/ELSE\nINSERT M8\nOPSKIP/ON\n");
    let said: Vec<&str> = program.diagnostics.iter().map(|d| d.message.as_str()).collect();
    assert!(program.diagnostics.iter().all(|d| d.severity == Severity::Warning));
    assert!(said.iter().any(|m| m.contains("unknown statement") && m.contains("(2 statements)")), "{said:?}");
    assert!(said.iter().any(|m| m.contains("INSERT")), "{said:?}");
    assert!(said.iter().any(|m| m.contains("optional skip")), "{said:?}");
}

#[test]
fn the_cell_declares_what_is_harmless_on_its_machine() {
    let harmless = ClOptions { harmless: ["RETRCT".to_owned(), "CUTCOM".to_owned()].into(), ..options() };
    let text = "UNITS/MM\nGOTO/0,0,10\nRETRCT\nCUTCOM/LEFT\nGOTO/5,0,10\n";
    let program = with(text, &harmless);
    assert!(faults(&program).is_empty());
    assert!(program.diagnostics.iter().any(|d| d.message.contains("harmless") && d.message.contains("(2 statements)")));
    assert_eq!(faults(&reads(text)).len(), 2);
}

#[test]
fn nine_numbers_are_one_position_with_its_axis_and_surface_normal() {
    let text = "$$ CATIA APT VERSION 1.0\nUNITS/MM\nGOTO/0,0,0,0,0,1\nGOTO/10,0,0,0,0,1,0,0.6,0.8\n";
    let program = reads(text);
    assert!(faults(&program).is_empty());
    assert_eq!(path(&program), [([0.0; 3], false), ([10.0, 0.0, 0.0], false)]);
    assert_eq!(program.literal_targets, 2);
    let Goal::Axis { axis, normal, .. } = program.targets[1].goal else { panic!("axis") };
    assert!((axis[2] - 1.0).abs() < 1e-12);
    let normal = normal.expect("a normal");
    assert!((normal[1] - 0.6).abs() < 1e-12 && (normal[2] - 0.8).abs() < 1e-12);
    let Goal::Axis { normal, .. } = program.targets[0].goal else { panic!("axis") };
    assert_eq!(normal, None);
}

#[test]
fn a_normal_is_turned_with_the_frame_that_it_is_printed_in() {
    let text = "TOOL PATH/A\nMSYS/0,0,0,1,0,0,0,1,0\nUNITS/MM\nGOTO/0,0,0,0,0,1\n\
                MSYS/0,0,0,0,1,0,-1,0,0\nGOTO/1,2,3,0,0,1,0.6,0,0.8\n";
    let Goal::Axis { normal, .. } = reads(text).targets[1].goal else { panic!("axis") };
    let normal = normal.expect("a normal");
    assert!((normal[1] - 0.6).abs() < 1e-12 && (normal[2] - 0.8).abs() < 1e-12, "{normal:?}");
}

#[test]
fn a_forward_direction_is_no_normal() {
    let program = reads("UNITS/MM\nGOTO/0,0,0,0,0,1\nGOTO/10,0,0,0,0,1,1,0,0\nGOTO/10,10,0,0,0,1,0,1,0\n");
    assert!(faults(&program).is_empty());
    assert_eq!(program.targets.len(), 3);
    assert!(program.targets.iter().all(|t| matches!(t.goal, Goal::Axis { normal: None, .. })));
    assert!(program.diagnostics.iter().any(|d| d.message.contains("forward direction")));
}

#[test]
fn positions_with_axes_in_a_list_have_each_its_own() {
    let text = "UNITS/MM\nGOTO/10,0,0,0,0,1\nCIRCLE/0,0,0,0,0,1,10\nGOTO/0,10,0,0,0.6,0.8,-10,0,0,0,0,1\n";
    let program = reads(text);
    assert!(faults(&program).is_empty(), "{:?}", faults(&program));
    let axis_at = |x: f64, y: f64| {
        let found = program.targets.iter().find_map(|t| match t.goal {
            Goal::Axis { position_mm: p, axis, .. } if (p[0] - x).abs() < 1e-6 && (p[1] - y).abs() < 1e-6 => Some(axis),
            _ => None,
        });
        found.expect("a target there")
    };
    assert!((axis_at(0.0, 10.0)[1] - 0.6).abs() < 1e-12);
    assert!((axis_at(-10.0, 0.0)[2] - 1.0).abs() < 1e-12);
}

#[test]
fn an_arc_may_end_in_increments() {
    for end in ["GODLTA/-10,10,0", "GOTO/0,10,0"] {
        let program = reads(&format!("UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\n{end}\nGOTO/0,20,0\n"));
        assert!(faults(&program).is_empty(), "{end}: {:?}", faults(&program));
        assert_eq!(program.arcs, 1, "{end}");
        let way: Vec<_> = program.targets.iter().filter(|t| t.role == Role::Interpolated).collect();
        assert!(!way.is_empty(), "{end}");
        for target in way {
            let Goal::Axis { position_mm: p, .. } = target.goal else { panic!("axis") };
            assert!((p[0].hypot(p[1]) - 10.0).abs() < 1e-9 && p[0] > 0.0 && p[1] > 0.0, "{end}: {p:?}");
        }
        assert_eq!(path(&program).last(), Some(&([0.0, 20.0, 0.0], false)));
    }
    assert!(!faults(&reads("UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGODLTA/5\n")).is_empty());
}

/// Largest y that is passed on the way of arcs.
fn highest(program: &Program) -> f64 {
    path(program).iter().map(|(p, _)| p[1]).fold(f64::MIN, f64::max)
}

#[test]
fn points_that_follow_say_which_way_an_arc_goes() {
    // Counter-clockwise is what most print; these points go clockwise, from (10,0) by (0,-10).
    let listed = reads("UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/7.07107,-7.07107,0,0,-10,0,-10,0,0\n");
    assert!(faults(&listed).is_empty(), "{:?}", faults(&listed));
    assert!(highest(&listed) < 1e-6, "{:?}", path(&listed));
    assert!(listed.diagnostics.iter().any(|d| d.code == "cl.arc-sense"));
    let as_said = reads("UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/7.07107,7.07107,0,0,10,0,-10,0,0\n");
    assert!(faults(&as_said).is_empty() && as_said.diagnostics.is_empty());
    assert!((highest(&as_said) - 10.0).abs() < 1e-3);
    // Neither way round within one turn.
    let neither = "UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/0,10,0,0,-10,0,-10,0,0,7.07107,7.07107,0\n";
    assert!(!faults(&reads(neither)).is_empty());
}

#[test]
fn an_arc_that_the_path_contradicts_is_refused() {
    for creo in ["", "$$-> MFGNO / X\n"] {
        let single =
            format!("{creo}UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/7.07107,-7.07107,0\nGOTO/0,-10,0\n");
        assert_eq!(faults(&reads(&single)).len(), 1, "{single}");
        assert!(faults(&reads(&single.replace(",10\nGOTO/7", ",10,CLW\nGOTO/7"))).is_empty());
        // A line that the arc would leave the way it came.
        let back = format!("{creo}UNITS/MM\nGOTO/0,0,0\nGOTO/10,0,0\nCIRCLE/10,10,0,0,0,-1,10\nGOTO/20,10,0\n");
        assert_eq!(faults(&reads(&back)).len(), 1, "{back}");
        assert!(faults(&reads(&back.replace("0,0,-1", "0,0,1"))).is_empty());
        assert!(faults(&reads(&back.replace("GOTO/10,0,0", "RAPID\nGOTO/10,0,0"))).is_empty(), "a way of its own");
    }
    // A line across the circle: an arc of an unknown system may be the other one, and one of a known system is not.
    let across = "UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/-7.07107,-7.07107,0\nGOTO/0,10,0\n";
    assert!(!faults(&reads(across)).is_empty());
    assert!(faults(&reads(&format!("$$-> MFGNO / X\n{across}"))).is_empty());
    // Back to the start is not beyond it.
    let closed = "UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/0,-10,0\nGOTO/10,0,0\n";
    assert!(faults(&reads(closed)).is_empty());
}

#[test]
fn what_follows_the_end_is_no_motion() {
    assert_eq!(
        faults(&reads("UNITS/MM\nGOTO/1,2,3\nFINI\nGOTO/9,9,9\n")),
        [(4, "motion after FINI, where the program ends".to_owned())]
    );
    assert!(faults(&reads("UNITS/MM\nGOTO/1,2,3\nFINI\nremnants of a tape\n")).is_empty());
}

#[test]
fn a_home_position_in_numbers_is_a_position() {
    let program = reads("UNITS/MM\nGOTO/1,2,3\nRAPID\nGOHOME/0,0,100\nFINI\n");
    assert!(faults(&program).is_empty());
    assert_eq!(path(&program), [([1.0, 2.0, 3.0], false), ([0.0, 0.0, 100.0], true)]);
}

#[test]
fn feeds_count_what_their_unit_says() {
    let close = |text: &str, mm_s: f64| {
        let feed = feed(text).unwrap_or(f64::NAN);
        assert!((feed - mm_s).abs() < 1e-9 * mm_s, "{text}: {feed} mm/s, expected {mm_s}");
    };
    close("UNITS/MM\nFEDRAT/600,MMPM", 10.0);
    close("UNITS/MM\nFEDRAT/MMPM,600", 10.0);
    close("UNITS/MM\nFEDRAT/600", 10.0);
    close("UNITS/MM\nFEDRAT/600,PERMIN", 10.0);
    close("UNITS/INCHES\nFEDRAT/60", 25.4);
    close("UNITS/MM\nFEDRAT/60,IPM", 25.4);
    close("UNITS/MM\nFEDRAT/1,IPS", 25.4);
    close("UNITS/MM\nFEDRAT/10,MMPS", 10.0);
    close("UNITS/MM\nFEDRAT/1,FPM", 304.8 / 60.0);
    close("UNITS/MM\nFEDRAT/0.6,MPM", 10.0);
    close("UNITS/MM\nSPINDL/600,RPM,CLW\nFEDRAT/1,MMPR", 10.0);
    close("UNITS/MM\nSPINDL/600,RPM,CLW\nFEDRAT/1,IPR", 254.0);
    close("UNITS/INCHES\nSPINDL/600,RPM,CLW\nFEDRAT/PERREV,1", 254.0);
    close("UNITS/MM\nFEDRAT/500,MMPM\nFEDRAT/600", 10.0);
}

#[test]
fn feeds_that_are_not_understood_are_refused() {
    for feed in [
        "FEDRAT/0.5,INVERS",
        "FEDRAT/INVERS,ON\nFEDRAT/2",
        "FEDRAT/100,KNOTS",
        "FEDRAT/0,MMPM",
        "FEDRAT/-5,MMPM",
        "FEDRAT/MMPM",
        "FEDRAT/0.2,MMPR",
        "FEDRAT/20,IPM\nFEDRAT/30",
        "SPINDL/600,RPM\nFEDRAT/0.2,MMPR\nFEDRAT/300",
    ] {
        let program = reads(&format!("UNITS/MM\n{feed}\nGOTO/1,2,3\n"));
        assert!(!faults(&program).is_empty(), "{feed}");
    }
    // In inches a feed in IPM is the file's own unit.
    assert!(faults(&reads("UNITS/INCHES\nFEDRAT/20,IPM\nFEDRAT/30\nGOTO/1,2,3\n")).is_empty());
}

const HOLES: &str = "FEDRAT/100,MMPM\nGOTO/0,0,50\n{CYCLE}\nGOTO/0,0,0\nGOTO/20,0,0\nCYCLE/OFF\nGOTO/20,0,50\nFINI\n";

fn holes(cycle: &str) -> Program {
    let text = format!("UNITS/MM\n{}", HOLES.replace("{CYCLE}", cycle));
    let program = reads(&text);
    assert!(faults(&program).is_empty(), "{cycle}: {:?}", faults(&program));
    assert_eq!(program.targets.last().map(|t| t.ordinal), Some(4), "{cycle}: one motion a hole");
    program
}

/// Rapid over the hole, feed to the depth, rapid out; then the next hole.
fn drilled(clear: f64, depth: f64, retract: f64) -> Vec<([f64; 3], bool)> {
    let mut path = vec![([0.0, 0.0, 50.0], false)];
    path.extend([([0.0, 0.0, clear], true), ([0.0, 0.0, -depth], false), ([0.0, 0.0, retract], true)]);
    if retract > clear {
        path.push(([20.0, 0.0, retract], true));
    }
    path.extend([([20.0, 0.0, clear], true), ([20.0, 0.0, -depth], false), ([20.0, 0.0, retract], true)]);
    path.push(([20.0, 0.0, 50.0], false));
    path
}

#[test]
fn drilling_cycles_become_their_moves() {
    for (cycle, clear, retract) in [
        ("CYCLE/DRILL,DEPTH,10,MMPM,200,CLEAR,2", 2.0, 2.0),
        ("CYCLE / DRILL, DEPTH, 10.000000, MMPM, 200.000000, CLEAR, 2.000000", 2.0, 2.0),
        ("CYCLE/DRILL,DEPTH,10,MMPM,200,CLEAR,2,RETURN,5", 2.0, 5.0),
        ("CYCLE/DRILL,RAPTO,2.0000,FEDTO,-10.0000,RTRCTO,5.0000,MMPM,200.0000", 2.0, 5.0),
        ("CYCLE/DRILL,RAPTO,2.0000,FEDTO,-10.0000,RTRCTO,AUTO,MMPM,200.0000", 2.0, 2.0),
        ("CYCLE/DRILL,RAPTO,2.0000,FEDTO,-10.0000,RTRCTO,5.0000,MANUAL,MMPM,200.0000", 2.0, 5.0),
        ("CYCLE/DRILL,FEDTO,10.,MMPM,200.,RAPTO,2.,RTRCTO,5.,DWELL,0", 2.0, 5.0),
        ("CYCLE/DRILL,10,MMPM,200,2", 2.0, 2.0),
        ("CYCLE/DRILL,10,200,MMPM,2", 2.0, 2.0),
        ("CYCLE/FACE,DEPTH,10,MMPM,200,CLEAR,2", 2.0, 2.0),
        ("CYCLE/CSINK,DEPTH,10,MMPM,200,CLEAR,2", 2.0, 2.0),
    ] {
        let program = holes(cycle);
        assert_eq!(path(&program), drilled(clear, 10.0, retract), "{cycle}");
        let bottom = program.targets.iter().filter(|t| t.role == Role::End).nth(1).expect("the first hole");
        assert!((bottom.feed_mm_s.expect("a feed") - 200.0 / 60.0).abs() < 1e-9, "{cycle}");
    }
    // Without a feed of its own the last one holds.
    let bottom = holes("CYCLE/DRILL,DEPTH,10,CLEAR,2").targets[2].feed_mm_s.expect("a feed");
    assert!((bottom - 100.0 / 60.0).abs() < 1e-9);
}

#[test]
fn deep_holes_are_pecked() {
    let heights = |cycle: &str| -> Vec<(f64, bool)> {
        path(&holes(cycle)).iter().take_while(|(p, _)| p[0] < 1.0).skip(1).map(|(p, rapid)| (p[2], *rapid)).collect()
    };
    let (rapid, feed) = (true, false);
    for cycle in ["CYCLE/DEEP,DEPTH,10,STEP,4,MMPM,200,CLEAR,2", "CYCLE/DRILL,DEEP,RAPTO,2,FEDTO,-10,STEP,4,MMPM,200"] {
        let pecks = [
            (2.0, rapid),
            (-4.0, feed),
            (2.0, rapid),
            (-3.0, rapid),
            (-8.0, feed),
            (2.0, rapid),
            (-7.0, rapid),
            (-10.0, feed),
            (2.0, rapid),
        ];
        assert_eq!(heights(cycle), pecks, "{cycle}");
    }
    let broken = [(2.0, rapid), (-6.0, feed), (-5.0, rapid), (-10.0, feed), (2.0, rapid)];
    assert_eq!(heights("CYCLE/BRKCHP,DEPTH,10,STEP,6,MMPM,200,CLEAR,2"), broken);
    assert_eq!(heights("CYCLE/BRKCHP,10,INCR,6,MMPM,200,2"), broken);
    let solidworks = "CYCLE/DEEP2,FEDTO,10.,1STPECK,6.,SUBPECK,3.,MMPM,200.,RAPTO,2.,RTRCTO,2.";
    let depths: Vec<f64> = heights(solidworks).into_iter().filter(|(_, rapid)| !rapid).map(|(z, _)| z).collect();
    assert_eq!(depths, [-6.0, -9.0, -10.0]);
    // A reamer comes out with feed.
    assert_eq!(heights("CYCLE/REAM,DEPTH,10,MMPM,200,CLEAR,2"), [(2.0, rapid), (-10.0, feed), (2.0, feed)]);
}

#[test]
fn a_dwell_at_the_bottom_is_waited_for() {
    let program = holes("CYCLE/DRILL,DEPTH,10,MMPM,200,CLEAR,2,DWELL,1.5");
    let waits: Vec<_> = program.actions.iter().map(|a| (a.before, a.kind.clone())).collect();
    assert_eq!(waits[0], (3, ActionKind::Dwell { seconds: 1.5 }), "before the retract");
    assert_eq!(waits.len(), 2);
}

#[test]
fn holes_lie_along_their_tool_axis() {
    let text = "UNITS/MM\nFEDRAT/100,MMPM\nGOTO/50,0,0,1,0,0\nCYCLE/DRILL,DEPTH,10,MMPM,200,CLEAR,2\nGOTO/0,5,0,1,0,0\nCYCLE/OFF\n";
    let program = reads(text);
    let expected = [
        ([50.0, 0.0, 0.0], false),
        ([50.0, 5.0, 0.0], true),
        ([2.0, 5.0, 0.0], true),
        ([-10.0, 5.0, 0.0], false),
        ([2.0, 5.0, 0.0], true),
    ];
    assert_eq!(path(&program), expected);
}

#[test]
fn cycles_that_are_not_understood_are_refused() {
    for cycle in [
        "CYCLE/TAP,DEPTH,10,MMPR,1.5,CLEAR,2",
        "CYCLE/TAP,10,1.5",
        "CYCLE/THRU,DEPTH,10,MMPM,200,CLEAR,2",
        "CYCLE/BORE,10,MMPM,200,2,ORIENT,0",
        "CYCLE/BORE,BACK,RAPTO,2,FEDTO,-10,MMPM,200",
        "CYCLE/DRILL",
        "CYCLE/DRILL,DEPTH,10",
        "CYCLE/DRILL,MMPM,200,CLEAR,2",
        "CYCLE/DRILL,  126.000000,   85.000000,    1.000000,MMPR",
        "CYCLE/DRILL,DEPTH,10,FURLONG,200,CLEAR,2",
        "CYCLE/DRILL,DEPTH,10,MMPM,200,CLEAR,-2",
        "CYCLE/DEEP,DEPTH,10,MMPM,200,CLEAR,2",
        "CYCLE/DEEP,DEPTH,10,STEP,0,MMPM,200,CLEAR,2",
        "CYCLE/FDRILL,DEPTH,10,MMPM,200,CLEAR,2",
        "CYCLE/DRILL,CSINK,8,RAPTO,2,FEDTO,-10,MMPM,200",
        "CYCLE/ON",
    ] {
        let program = reads(&format!("UNITS/MM\n{}", HOLES.replace("{CYCLE}", cycle)));
        assert!(faults(&program).iter().any(|(line, _)| *line == 4), "{cycle}: {:?}", faults(&program));
    }
    let in_cycle = |more: &str| {
        reads(&format!("UNITS/MM\nFEDRAT/100,MMPM\nGOTO/0,0,50\nCYCLE/DRILL,DEPTH,10,CLEAR,2\n{more}\nCYCLE/OFF\n"))
    };
    assert!(!faults(&in_cycle("GODLTA/1,2,3")).is_empty());
    assert!(!faults(&in_cycle("CIRCLE/0,0,0,0,0,1,10\nGOTO/0,10,0")).is_empty());
    assert!(faults(&in_cycle("GOTO/0,10,0\nCYCLE/OFF\nGOTO/0,0,50\nCYCLE/ON\nGOTO/5,5,0")).is_empty());
}

#[test]
fn a_second_tool_needs_a_map() {
    for second in ["LOADTL/2", "LOAD/TOOL,2", "TOOLNO/2", "TURRET/2", "LOADTL/2,ADJUST,2", "TOOL PATH/B,TOOL,OTHER"] {
        let first = if second.starts_with("TOOL PATH") { "TOOL PATH/A,TOOL,FIRST" } else { "LOADTL/1" };
        let text = format!("UNITS/MM\n{first}\nGOTO/0,0,1\n{second}\nGOTO/1,0,1\n");
        assert_eq!(faults(&reads(&text)).len(), 1, "{second}: {:?}", faults(&reads(&text)));
        assert_eq!(faults(&reads(&text))[0].0, 4, "{second}");
        let any = ClOptions { any_tool: true, ..options() };
        assert!(faults(&with(&text, &any)).is_empty(), "{second}: --tool");
        let tools = [("1", "tRough"), ("FIRST", "tRough"), ("2", "tFinish"), ("OTHER", "tFinish")];
        let tools = tools.into_iter().map(|(id, tool)| (id.to_owned(), tool.to_owned())).collect();
        let program = with(&text, &ClOptions { tools, tool: None, ..options() });
        assert!(faults(&program).is_empty(), "{second}: {:?}", faults(&program));
        let names: Vec<&str> = program.targets.iter().map(|t| &*program.tools[usize::from(t.tool)].name).collect();
        assert_eq!(names, ["tRough", "tFinish"], "{second}");
        let changes: Vec<usize> = program.actions.iter().map(|a| a.before).collect();
        assert_eq!(changes.last(), Some(&1), "{second}: {:?}", program.actions);
    }
    assert!(faults(&reads("UNITS/MM\nLOADTL/1\nGOTO/0,0,1\nLOADTL/1\nGOTO/1,0,1\nLOADTL/2\nFINI\n")).is_empty());
    assert!(faults(&reads("UNITS/MM\nGOTO/0,0,1\nLOADTL/5\nGOTO/1,0,1\n")).is_empty(), "the first number of all");
}

#[test]
fn an_unmapped_tool_is_an_error() {
    let tools = [("1".to_owned(), "tRough".to_owned())].into();
    let mapped = ClOptions { tools, ..options() };
    let program = with("UNITS/MM\nLOADTL/1\nGOTO/0,0,1\nLOADTL/3\nGOTO/1,0,1\n", &mapped);
    assert_eq!(faults(&program).len(), 1);
    assert!(faults(&program)[0].1.contains("`[cl] tools`"), "{:?}", faults(&program));
    let none = ClOptions { tool: None, ..mapped };
    assert!(!faults(&with("UNITS/MM\nGOTO/0,0,1\nLOADTL/1\nGOTO/1,0,1\n", &none)).is_empty(), "which tool is it?");
}

#[test]
fn another_cutter_without_a_tool_change_is_refused() {
    let second = |statement: &str| {
        faults(&reads(&format!("UNITS/MM\nLOADTL/1\nCUTTER/10,1\nGOTO/0,0,1\n{statement}\nGOTO/1,0,1\n")))
    };
    assert_eq!(second("CUTTER/12,1").len(), 1);
    assert_eq!(second("TLDATA/MILL,10,5,75,0,0").len(), 1);
    assert!(second("CUTTER/10.0,1.0,0,0,0,0,50").is_empty(), "the same again");
    assert!(second("$$ no cutter").is_empty());
}

#[test]
fn other_actions_of_the_machine_are_carried() {
    let text = "UNITS/MM\nLOADTL/1\nSPINDL/9000,RPM,CLW\nCOOLNT/FLOOD\nGOTO/0,0,1\nSTOP\nOPSTOP\nDELAY/2.5\nGOTO/1,0,1\n\
                COOLNT/OFF\nSPINDL/OFF\nGOHOME\nFINI\n";
    let program = reads(text);
    assert!(faults(&program).is_empty());
    let kinds: Vec<(usize, ActionKind)> = program.actions.into_iter().map(|a| (a.before, a.kind)).collect();
    let expected = [
        (0, ActionKind::ToolChange { number: "1".into() }),
        (0, ActionKind::SpindleOn { rpm: Some(9000.0), clockwise: true }),
        (0, ActionKind::CoolantOn { kind: "FLOOD".into() }),
        (1, ActionKind::Stop),
        (1, ActionKind::OptionalStop),
        (1, ActionKind::Dwell { seconds: 2.5 }),
        (2, ActionKind::CoolantOff),
        (2, ActionKind::SpindleOff),
        (2, ActionKind::Home),
    ];
    assert_eq!(kinds, expected);
}

#[test]
fn a_file_without_a_cl_statement_is_refused() {
    let krl = "&ACCESS RVP\nDEF part( )\n;FOLD INI\nBAS (#INITMOV,0 )\n;ENDFOLD\n$VEL.CP=0.05\nPTP HOME\n\
               LIN {X 10.0,Y 20.0,Z 30.0,A 0.0,B 90.0,C 0.0} C_DIS\nHALT\nEND\n";
    for text in [krl, "", "\n\n", "hello\nworld\n", "END\n", "$$ a comment\n"] {
        let refused = read(Source::new("part.src", text), &options());
        let errors = refused.err().unwrap_or_else(|| panic!("{text:?} is read"));
        assert!(errors.iter().all(|e| e.code == "cl.not-cl" && e.help.is_some()), "{errors:?}");
    }
}
