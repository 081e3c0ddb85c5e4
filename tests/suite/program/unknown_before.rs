//! Targets after motions that are known only at run time: what depends on these motions is not used for a correction.

use crate::dense_walk::{CELL, module, read};
use deflex::cell::Cell;
use deflex::correct::{Options, Row, Status, compensate};
use deflex::program::{krl, tp, ur};
use deflex::text::Source;

fn cell(text: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", text)).unwrap()
}

/// A robtarget above the work object, mm.
fn at([x, y, z]: [f64; 3]) -> String {
    format!("[[{x},{y},{z}],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]")
}

const RAPID_END: &str = ",v20,fine,tMill\\WObj:=wPart;\n";
/// A motion whose target is known only at run time.
const SOMEWHERE: &str = "MoveL CRobT(\\Tool:=tMill\\WObj:=wPart),v20,fine,tMill\\WObj:=wPart;\n";

fn rows(body: &str, cell: &Cell) -> Vec<Row> {
    compensate(&read(&module(body)), cell, &Options::default()).unwrap().rows
}

fn lines(points: &[[f64; 3]]) -> String {
    points.iter().map(|point| format!("MoveL {}{RAPID_END}", at(*point))).collect()
}

fn is_kept(row: &Row) -> bool {
    matches!(row.status, Status::Kept(_))
}

/// Lost motion has the sign of the last motion of a joint: that from the kept target, not from the last corrected one.
#[test]
fn lost_motion_after_a_kept_target_has_the_sign_of_the_motion_from_there() {
    let backlash = "[[effect]]\nkind = \"backlash\"\nhalf_gap_rad = [4e-4, 0, 0, 0, 0, 0]\n";
    let cell = cell(&(CELL.replace("frame = \"feed\"", "frame = \"wobj\"") + backlash));
    let (a, b, c) = ([0.0, 200.0, 0.0], [0.0, 0.0, 0.0], [50.0, 100.0, 0.0]);
    let through = rows(&(lines(&[a]) + SOMEWHERE + &lines(&[b, c])), &cell);
    assert!(is_kept(&through[1]) && is_kept(&through[2]), "{through:?}");
    let direct = rows(&lines(&[a, b, c]), &cell);
    for i in 0..3 {
        assert!((through[3].correction_mm[i] - direct[2].correction_mm[i]).abs() < 1e-4, "{through:?} {direct:?}");
    }
    // The first joint stands still on the last segment: which side of its gap it is on is not known.
    let still = rows(&(lines(&[a]) + SOMEWHERE + &lines(&[b, [0.0, 0.0, 30.0], c])), &cell);
    assert_eq!(still.iter().map(is_kept).collect::<Vec<_>>(), [false, true, true, true, false]);
}

/// The controller moves the tip of the new tool from where that tip is, not from where the old one was.
#[test]
fn the_feed_after_a_change_of_tool_begins_at_the_tip_of_the_new_tool() {
    let cell = cell(&CELL.replace("force_n = [-35.0, 95.0, 85.0]", "force_n = [-100.0, 0.0, 0.0]"));
    // Its tip is 60 mm from the other one along x of the work object.
    let other = "PERS tooldata tOther:=[TRUE,[[60,0,260],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n  PROC main()";
    let body = lines(&[[-50.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        + &format!("MoveL {}{}", at([60.0, 80.0, 0.0]), RAPID_END.replace("tMill", "tOther"));
    let text = module(&body).replace("PROC main()", other);
    let rows = compensate(&read(&text), &cell, &Options::default()).unwrap().rows;
    let [x, y, _] = rows[2].force_n;
    assert!(x.abs() < 1e-6 && (y + 100.0).abs() < 1e-6, "{:?}", rows[2].force_n);
}

#[test]
fn an_effect_of_speed_needs_the_start_of_the_segment() {
    let lag = "[[effect]]\nkind = \"tracking_lag\"\ntime_s = 0.02\n";
    let cell = cell(&(CELL.replace("frame = \"feed\"", "frame = \"wobj\"") + lag));
    let rows = rows(&(lines(&[[0.0, 0.0, 0.0]]) + SOMEWHERE + &lines(&[[50.0, 0.0, 0.0], [50.0, 80.0, 0.0]])), &cell);
    assert_eq!(rows.iter().map(is_kept).collect::<Vec<_>>(), [false, true, true, false]);
}

/// A plunge has the force of the cut before it. That of a cut that is kept is not computed.
#[test]
fn a_plunge_after_a_kept_cut_is_kept() {
    let (arm, _) = CELL.split_once("[cut]").unwrap();
    let cut = "[cut]\nforce = \"mechanistic\"\n[cut.cutter]\ndiameter_mm = 16.0\ncorner_radius_mm = 0.0\nteeth = 3\n\
               helix_deg = 30.0\nspindle_rpm = 6000\n[cut.engagement]\nmode = \"slot\"\ndepth_mm = 3.0\nwidth_mm = 16.0\n\
               lead_deg = 0.0\ntilt_deg = 0.0\n[cut.coefficients]\nmaterial = \"al7075\"\n";
    let cell = cell(&(arm.to_owned() + cut));
    let body = lines(&[[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]]) + SOMEWHERE;
    let rows = rows(&(body + &lines(&[[50.0, 80.0, 0.0], [50.0, 80.0, -20.0], [90.0, 80.0, -20.0]])), &cell);
    assert_eq!(rows.iter().map(is_kept).collect::<Vec<_>>(), [false, false, true, true, true, false]);
}

/// The speed decides whether a motion cuts: with a speed that is known only at run time, that is not known.
#[test]
fn a_motion_that_may_cut_is_kept() {
    let cell = cell(&(CELL.to_owned() + "max_cutting_feed_mm_s = 50.0\n"));
    let body = "MoveL @,v20,fine,tMill\\WObj:=wPart;\nVelSet di1,100;\nMoveL @,v20,fine,tMill\\WObj:=wPart;\n";
    let body = body.replacen('@', &at([0.0, 0.0, 0.0]), 1).replacen('@', &at([50.0, 0.0, 0.0]), 1);
    assert_eq!(rows(&body, &cell).iter().map(is_kept).collect::<Vec<_>>(), [false, true]);
}

/// The tool turns along an arc from its orientation at the start.
#[test]
fn an_arc_with_an_unknown_start_is_kept() {
    let cell = cell(&CELL.replace("frame = \"feed\"", "frame = \"wobj\""));
    let arc = format!("MoveC {},{}{RAPID_END}", at([120.0, 180.0, 0.0]), at([180.0, 120.0, 0.0]));
    let start = |there: [f64; 3]| lines(&[there]);
    let known = rows(&(start([0.0, 80.0, 0.0]) + &arc), &cell);
    assert!(!is_kept(&known[1]));
    let branches = format!("IF di1=1 THEN\n{}ELSE\n{}ENDIF\n", start([0.0, 80.0, 0.0]), start([250.0, 20.0, 60.0]));
    let rows = rows(&(branches + &arc), &cell);
    assert!(is_kept(&rows[2]), "{rows:?}");
}

/// The known test in the loop never ends it, and the counter makes each round another state: the rounds are joined.
#[test]
fn a_loop_that_no_known_test_ends_is_read_at_once() {
    let body = format!("WHILE di1=1 DO\n{}IF bDry RETURN;\nn:=n+1;\nENDWHILE\n", lines(&[[0.0, 0.0, 0.0]]));
    let text = module(&body).replace("  PROC main()", "CONST bool bDry:=FALSE;\nVAR num n:=0;\nPROC main()");
    let begun = std::time::Instant::now();
    assert_eq!(read(&text).targets.len(), 1);
    // It took minutes when each round was followed.
    assert!(begun.elapsed().as_secs() < 30, "{:?}", begun.elapsed());
}

/// `%"Module:routine"%` means the routine of that module.
#[test]
fn late_binding_follows_the_routine_of_the_named_module() {
    let program = |called: &str| {
        let main = module(&format!("%\"{called}\"%;\n{}", lines(&[[10.0, 20.0, 0.0]])));
        let set = |z: u32| format!("LOCAL PROC cut()\n  tMill.tframe.trans.z:={z};\nENDPROC\n");
        let main = main.replace("ENDMODULE", &(set(300) + "ENDMODULE"));
        let other = format!("MODULE Other\n{}ENDMODULE\n", set(400));
        deflex::program::rapid::read(vec![Source::new("a.mod", main), Source::new("b.mod", other)], Vec::new()).unwrap()
    };
    let length = |called: &str| {
        let program = program(called);
        let target = program.targets.first().filter(|target| target.located)?;
        Some(program.tools[usize::from(target.tool)].data?.tcp_mm[2])
    };
    assert_eq!(length("cut"), Some(300.0));
    assert_eq!(length("Other:cut"), Some(400.0));
    assert_eq!(length("Missing:cut"), None);
}

/// Data lists keep the values that the cycle before gave them.
#[test]
fn krl_positions_that_the_program_changes_are_unknown_at_the_start() {
    let data = "DEFDAT p\nDECL FRAME XP1={X 10,Y 20,Z 30,A 0,B 90,C 0}\nDECL FRAME XP2={X 90,Y 20,Z 30,A 0,B 90,C 0}\nENDDAT\n";
    let text = "DEF p()\n$BASE=$NULLFRAME\n$TOOL=$NULLFRAME\n$VEL.CP=0.05\nLIN XP2\nLIN XP1\nXP1.Z=150.0\nEND\n";
    let program = krl::read(vec![Source::new("p.src", text), Source::new("p.dat", data)], Vec::new()).unwrap();
    assert_eq!((program.targets.len(), program.unknown.len()), (1, 1));
}

/// The controller keeps the values of a frame that the cycle before set.
#[test]
fn a_tp_frame_that_the_program_sets_is_unknown_at_the_start() {
    let text = "/PROG P\n/ATTR\n/MN\n1:L P[1] 50mm/sec FINE ;\n2:UFRAME[1]=PR[3] ;\n/POS\n\
                P[1]{\nGP1:\nUF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0',\nX = 1.0 mm, Y = 0.0 mm, Z = 0.0 mm,\n\
                W = 180.0 deg, P = 0.0 deg, R = 0.0 deg\n};\n/END\n";
    let known = text.replace("UFRAME[1]", "UFRAME[2]");
    let selected = |text: &str| text.replace("1:L", "1:UFRAME_NUM=1 ;\n2:UTOOL_NUM=1 ;\n3:L");
    let count = |text: String| tp::read(vec![Source::new("p.ls", text)], Vec::new()).unwrap().targets.len();
    assert_eq!((count(selected(text)), count(selected(&known))), (0, 1));
}

/// `set_payload_mass` leaves the centre of gravity as it is.
#[test]
fn a_payload_of_urscript_is_set_in_parts() {
    let text = "def p():\n  set_tcp(p[0,0,0.2,0,0,0])\n  set_payload(1.8, [0, 0, 0.07])\n  set_payload_mass(9.0)\n\
                movel(p[0.5,0.1,0.2,0,3.14,0], a=1.2, v=0.025)\nend\n";
    let program = ur::read(vec![Source::new("p.script", text)], Vec::new()).unwrap();
    let tool = program.tools[usize::from(program.targets[0].tool)].data.unwrap();
    assert_eq!((tool.mass_kg, tool.cog_mm), (9.0, [0.0, 0.0, 70.0]));
}
