//! RAPID in a cell: which cuts are corrected although a joint motion through air goes to the same numbers.

use deflex_cell::Cell;
use deflex_correct::{Options, Status, compensate, compensate_driven};
use deflex_program::{Reason, rapid};
use deflex_text::Source;

const CELL: &str = r#"
[robot]
model = "irb6700-150-3.20"
[robot.stiffness]
joint_nm_per_rad = [1e6, 1e6, 1e6, 4e5, 3e5, 1e5]
[controller]
compensates = []
[cut]
force = "constant"
force_n = [100.0, 150.0, -200.0]
frame = "wobj"
[tools.tMill]
tcp_mm = [0.0, 0.0, 200.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 5.0
cog_mm = [0.0, 0.0, 100.0]
"#;
/// Axis 4 is at 0 where the tool is square to the base.
const VERTICAL: &str = "[0,0.0998334,0.9950042,0],[0,0,0,0]";
const TILTED: &str = "[0.0236762,0.4068988,0.8757795,0.2586174],[0,0,0,0]";

/// Whether each motion of a program with two targets of this orientation is corrected, goes along or is kept, and its text.
fn rows(orientation: &str, main: &str, more: &str) -> (Vec<String>, String) {
    let target =
        |name: &str, at: &str| format!("CONST robtarget {name}:=[[{at}],{orientation},[9E9,9E9,9E9,9E9,9E9,9E9]];\n");
    let [p1, p2] = if orientation.starts_with("[0,0.0998334") {
        ["1500,300,800", "1600,300,800"]
    } else {
        ["2202.801,938.562,1013.716", "2112.617,1126.977,1013.716"]
    };
    let text = format!(
        "MODULE m\nCONST confdata cHome:=[0,0,0,0];\n{}{}PROC main()\n{main}ENDPROC\n{more}ENDMODULE\n",
        target("p1", p1),
        target("p2", p2)
    );
    let program = rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap();
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let done = compensate(&program, &cell, &Options::default()).unwrap();
    let said = |row: &deflex_correct::Row| match row.status {
        Status::Kept(why) => why.text().to_owned(),
        _ if row.goes_along => "along".to_owned(),
        _ => "corrected".to_owned(),
    };
    let text = program.edited(&done.rewritten.unwrap().edits).remove(0);
    (done.rows.iter().map(said).collect(), String::from_utf8(text.bytes.to_vec()).unwrap())
}

/// The correction turns axis 4 through zero: the arm does not change its posture, and the text gets the configuration that the arm has.
#[test]
fn a_joint_motion_goes_along_into_the_configuration_that_the_cut_needs() {
    let cut = "MoveL p2,v10,fine,tMill;\nMoveL p1,v10,fine,tMill;\n";
    for first in ["MoveJ p1,v500,fine,tMill;\n", "MoveJ Offs(p1,0,0,100),v500,fine,tMill;\n"] {
        let (rows, text) = rows(VERTICAL, &format!("{first}{cut}"), "");
        assert_eq!(rows, ["along", "corrected", "corrected"], "{text}");
        assert!(text.contains("],[0,-1,0,0],["), "{text}");
    }
    // There, axis 4 is on the other side of zero: by the new configuration, the arm would turn it by a whole turn.
    let turned = |rx: &str| {
        let first = format!("MoveJ RelTool(p1,0,0,-50\\Rx:={rx}),v500,fine,tMill;\n");
        rows(VERTICAL, &format!("{first}{cut}"), "").0
    };
    let said = ["5", "-5"].map(|rx| turned(rx).remove(2));
    assert!(said.contains(&Reason::AlongOtherPosture.text().to_owned()), "{said:?}");
}

#[test]
fn a_joint_motion_that_nothing_runs_goes_along() {
    let main = "MoveJ Offs(p1,0,0,100),v500,fine,tMill;\nMoveL p1,v100,fine,tMill;\nMoveL p2,v10,fine,tMill;\n";
    let path = "PROC Path_10()\nMoveJ p1,v100,fine,tMill;\nMoveJ p2,v100,fine,tMill;\nENDPROC\n";
    let said = rows(TILTED, main, path).0;
    assert_eq!(said[1..], ["corrected", "corrected"], "{said:?}");
    let (said, text) = rows(VERTICAL, main, path);
    assert_eq!(said[1..], ["corrected", "corrected"], "{said:?}");
    assert!(text.contains("],[0,-1,0,0],["), "{text}");
}

/// It goes to the text wherever the arm comes from, so that the text keeps the configuration that it needs.
#[test]
fn a_joint_motion_that_nothing_runs_holds_what_it_cannot_reach() {
    let main = "MoveL p1,v100,fine,tMill;\nMoveL p2,v10,fine,tMill;\n";
    let path = "PROC Path_10()\nMoveJ p1,v100,fine,tMill;\nENDPROC\n";
    let said = rows(VERTICAL, main, path).0;
    assert_eq!(said, ["corrected", "corrected"]);
    // The configuration has a name, which other data may use: its numbers stay.
    let orientation = VERTICAL.replace(",[0,0,0,0]", ",cHome");
    let said = rows(&orientation, main, path).0;
    assert_ne!(said[0], "corrected", "{said:?}");
}

/// Motions through air to computed offsets move with the base or hold it.
#[test]
fn the_reason_names_why_a_motion_through_air_may_not_go_along() {
    let done = |most_mm: f64, motion: &str, offset: f64| {
        let cell = CELL.replace("[cut]", &format!("[limits]\nmax_correction_mm = {most_mm}\n[cut]"));
        let cell = Cell::read(&Source::new("cell.toml", cell)).unwrap();
        let target = format!("CONST robtarget p1:=[[2202.801,938.562,1013.716],{TILTED},[9E9,9E9,9E9,9E9,9E9,9E9]];\n");
        let main = format!("MoveJ {motion},v500,fine,tMill;\nMoveL p1,v10,fine,tMill;\n");
        let text = format!("MODULE m\nCONST num n:={offset};\n{target}PROC main()\n{main}ENDPROC\nENDMODULE\n");
        let program = rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap();
        compensate(&program, &cell, &Options::default()).map(|done| done.rows)
    };
    let turned = ["RelTool(p1,n,0,0)", "RelTool(p1,-n,0,0)", "RelTool(p1,0,n,0)", "RelTool(p1,0,-n,0)"];
    let farther = turned.map(|motion| {
        let free = done(5.0, motion, 400.0).ok()?;
        let [along, cut] = [0, 1].map(|i| free[i].correction_norm_mm());
        (along > 1.02 * cut).then(|| done(0.5 * (along + cut), motion, 400.0).unwrap()[1].status)
    });
    assert!(farther.contains(&Some(Status::Kept(Reason::AlongTooFar.into()))), "{farther:?}");
    // At the edge of the reach, in the direction in which the correction leads out of it.
    let at_edge = |motion: &str| {
        let (mut inside, mut outside) = (0.0, 4000.0);
        while outside - inside > 1e-3 {
            let middle = 0.5 * (inside + outside);
            match done(5.0, motion, middle) {
                Ok(_) => inside = middle,
                Err(_) => outside = middle,
            }
        }
        done(5.0, motion, inside).unwrap()[1].status
    };
    let edges = ["Offs(p1,n,0,0)", "Offs(p1,0,n,0)", "Offs(p1,0,-n,0)", "Offs(p1,0,0,n)", "Offs(p1,0,0,-n)"];
    let said = edges.map(at_edge);
    assert!(said.contains(&Status::Kept(Reason::AlongOutOfReach.into())), "{said:?}");
}

/// A cell whose controller rounds corners.
const DRIVEN: &str = r#"
[robot]
model = "irb6660-205-1.9"
start_deg = [0, 0, 0, 0, 30, 0]
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
[controller]
compensates = []
[limits]
max_correction_mm = 5.0
max_step_mm = 5.0
[cut]
force = "constant"
force_n = [120.0, -260.0, 410.0]
frame = "wobj"
max_cutting_feed_mm_s = 100.0
[controller.path]
corner_acceleration_mm_s2 = 1000.0
acceleration_mm_s2 = 2000.0
smoothing_s = [0.3, 0.1]
zone_share = 1.0
"#;

/// A module with these declarations, and routines whose motions `L` and `C` are lines and arcs of one tool at this speed.
fn driven(declared: &str, routines: &str) -> deflex_program::Program {
    let text = format!(
        "MODULE m\nPERS tooldata t:=[TRUE,[[0,0,310],[1,0,0,0]],[10,[0,0,100],[1,0,0,0],0,0,0]];\n\
         PERS wobjdata w:=[FALSE,TRUE,\"\",[[1000,-400,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n{declared}{routines}ENDMODULE\n"
    );
    rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap()
}

fn declared(name: &str, x: f64, y: f64) -> String {
    format!("CONST robtarget {name}:=[[{x:.3},{y:.3},20],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n")
}

/// The numbers of a declaration in a text.
fn position(text: &str, name: &str) -> [f64; 3] {
    let (_, after) = text.split_once(&format!("robtarget {name}:=[[")).unwrap();
    let mut numbers = after.split([',', ']']).map(|number| number.parse().unwrap());
    std::array::from_fn(|_| numbers.next().unwrap())
}

/// A cut of a routine that nothing calls needs the correction of its point, and not the displacement for the corners of another path.
#[test]
fn a_driven_path_leaves_the_points_to_which_others_cut() {
    let cell = Cell::read(&Source::new("cell.toml", DRIVEN)).unwrap();
    let points: String = (0..25_u8)
        .map(|k| {
            let angle = f64::from(k) * std::f64::consts::PI / 18.0;
            declared(&format!("q{k}"), 200.0 + 15.0 * angle.cos(), 200.0 + 15.0 * angle.sin())
        })
        .collect();
    let motions: String =
        (0..25).map(|k| format!("MoveL q{k},v80,{},t\\WObj:=w;\n", if k % 24 == 0 { "fine" } else { "z1" })).collect();
    let at_q12 = |service: &str, tolerance: Option<f64>| {
        let program = driven(&points, &format!("PROC main()\n{motions}ENDPROC\n{service}"));
        let options = Options::default();
        let (program, rewritten) = match tolerance {
            Some(tolerance) => {
                let done = compensate_driven(&program, &cell, &options, tolerance).unwrap();
                (done.program, done.corrected.rewritten.unwrap())
            }
            None => {
                let done = compensate(&program, &cell, &options).unwrap();
                (program, done.rewritten.unwrap())
            }
        };
        let text = String::from_utf8(program.edited(&rewritten.edits).remove(0).bytes.to_vec()).unwrap();
        position(&text, "q12")
    };
    let service = "PROC service()\nMoveL q12,v20,fine,t\\WObj:=w;\nENDPROC\n";
    let plain = at_q12(service, None);
    let off = |at: [f64; 3]| (0..3).map(|k| (at[k] - plain[k]).abs()).fold(0.0, f64::max);
    assert!(off(at_q12("", Some(2e-4))) > 0.5);
    assert!(off(at_q12(service, Some(2e-4))) < 0.02);
}

/// The circle point of the last part of a divided arc is far from the point that the program shows, or to which others go.
#[test]
fn a_divided_arc_leaves_the_circle_point_that_others_use_or_see() {
    let cell = Cell::read(&Source::new("cell.toml", DRIVEN.split("[controller.path]").next().unwrap())).unwrap();
    let points = [declared("p1", 100.0, 100.0), declared("pX", 200.0, 200.0), declared("p2", 300.0, 100.0)].concat();
    let arc = "MoveL p1,v20,fine,t\\WObj:=w;\nMoveC pX,p2,v20,z1,t\\WObj:=w;\n";
    let moved = |more: &str, service: &str| {
        let program = driven(&points, &format!("PROC main()\n{arc}{more}ENDPROC\n{service}"));
        let options = Options { subdivide: Some(2e-6), ..Options::default() };
        let done = compensate(&program, &cell, &options).unwrap();
        let text = program.edited(&done.rewritten.unwrap().edits).remove(0);
        (position(std::str::from_utf8(&text.bytes).unwrap(), "pX")[0] - 200.0).abs()
    };
    assert!(moved("", "") > 10.0);
    let service = |motion: &str| format!("PROC service()\n{motion}\nENDPROC\n");
    for motion in [
        "MoveJ pX,v500,z5,t\\WObj:=w;",
        "MoveL pX,v20,fine,t\\WObj:=w;",
        "MoveL p2,v20,fine,t\\WObj:=w;\nMoveC pX,p2,v20,z1,t\\WObj:=w;",
    ] {
        assert!(moved("", &service(motion)) < 2.0, "{motion}");
    }
    assert!(moved("TPWrite \"x\"\\Num:=pX.trans.x;\n", "") < 2.0);
}
