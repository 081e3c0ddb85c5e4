//! Programs of long lines, corners and arcs, walked densely on an arm that shares no code with deflex: the tip against the
//! programmed path.

use deflex::cell::Cell;
use deflex::correct::{Corrected, Options, Summary, compensate};
use deflex::program::{Program, rapid};
use deflex::text::{Source, applied};
use deflex_oracles::walk::{TOOL_LENGTH, WOBJ, Walk};
use std::fmt::Write;

pub(crate) const CELL: &str = "[robot]
model = \"test arm\"
start_deg = [0, 0, 0, 0, 60, 0]
[robot.kinematics]
parallelogram = false
links = [
  { alpha_deg = 0.0, a_mm = 0.0, d_mm = 780.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 320.0, d_mm = 0.0, theta_deg = -90.0 },
  { alpha_deg = 0.0, a_mm = 1075.0, d_mm = 0.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 200.0, d_mm = 1142.5, theta_deg = 0.0 },
  { alpha_deg = 90.0, a_mm = 0.0, d_mm = 0.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 0.0, d_mm = 200.0, theta_deg = 180.0 },
]
axis_min_deg = [-360, -360, -360, -360, -360, -360]
axis_max_deg = [360, 360, 360, 360, 360, 360]
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 0.881e5]
[controller]
compensates = []
[cut]
force = \"constant\"
force_n = [-35.0, 95.0, 85.0]
frame = \"feed\"
";

/// The five kinds of paths, as motions: positions in mm, the tool's turn about y in degrees (0 points straight down).
pub(crate) fn paths() -> Vec<(&'static str, String)> {
    let line = |x: f64, y: f64, z: f64, lean: f64| {
        let (sin, cos) = (0.5 * lean.to_radians()).sin_cos();
        format!("[[{x},{y},{z}],[{:.8},{:.8},{:.8},{:.8}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]", 0.0, cos, 0.0, -sin)
    };
    let go = |target: String| format!("    MoveL {target},v20,fine,tMill\\WObj:=wPart;\n");
    let round = |via: String, to: String| format!("    MoveC {via},{to},v20,fine,tMill\\WObj:=wPart;\n");
    let mut zig_zag = String::new();
    for pass in 0..4 {
        let (y, ends) = (12.0 * f64::from(pass), if pass % 2 == 0 { [0.0, 240.0] } else { [240.0, 0.0] });
        ends.iter().for_each(|x| zig_zag += &go(line(*x, y, 0.0, 0.0)));
    }
    let rail = go(line(0.0, 0.0, 0.0, 0.0)) + &go(line(60.0, 700.0, 40.0, 0.0));
    let square = [(0.0, 0.0), (150.0, 0.0), (150.0, 150.0), (0.0, 150.0), (0.0, 0.0)];
    let square: String = square.iter().map(|(x, y)| go(line(*x, *y, 0.0, 0.0))).collect();
    let mut arcs = go(line(0.0, 0.0, 0.0, 0.0));
    for k in 0..3 {
        let (x, side) = (100.0 * f64::from(k), if k % 2 == 0 { 1.0 } else { -1.0 });
        arcs += &round(line(x + 50.0, 50.0 * side, 0.0, 0.0), line(x + 100.0, 0.0, 0.0, 0.0));
    }
    let turning =
        [(0.0, 0.0, 0.0, -15.0), (300.0, 40.0, 10.0, 20.0), (320.0, 240.0, 0.0, -10.0), (20.0, 300.0, 20.0, 15.0)];
    let turning: String = turning.iter().map(|(x, y, z, lean)| go(line(*x, *y, *z, *lean))).collect();
    vec![("zig-zag", zig_zag), ("rail", rail), ("square", square), ("half circles", arcs), ("turning", turning)]
}

pub(crate) fn module(body: &str) -> String {
    let mut text = "MODULE Walk\n".to_owned();
    let _ =
        writeln!(text, "  PERS tooldata tMill:=[TRUE,[[0,0,{TOOL_LENGTH}],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];");
    let [x, y, z] = WOBJ;
    let _ = writeln!(text, "  PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[{x},{y},{z}],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];");
    text + "  PROC main()\n" + body + "  ENDPROC\nENDMODULE\n"
}

pub(crate) fn read(text: &str) -> Program {
    rapid::read(vec![Source::new("walk.mod", text.as_bytes())], Vec::new()).expect("a program")
}

pub(crate) fn corrected(program: &Program, cell: &Cell, subdivide: Option<f64>) -> (Corrected, String) {
    let options = Options { subdivide, ..Options::default() };
    let corrected = compensate(program, cell, &options).expect("corrected");
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let edits = &corrected.rewritten.as_ref().expect("RAPID").edits[0];
    let text = applied(&program.sources[0].bytes, edits);
    (corrected, String::from_utf8(text).expect("text"))
}

#[test]
fn subdivided_programs_cut_true_between_their_targets() {
    let cell = Cell::read(&Source::new("cell.toml", CELL.as_bytes())).expect("a cell");
    for (name, body) in paths() {
        let text = module(&body);
        let program = read(&text);
        let (sparse, sparse_text) = corrected(&program, &cell, None);
        let (dense, dense_text) = corrected(&program, &cell, Some(1e-5));
        let [between, after] = [&sparse_text, &dense_text].map(|written| Walk::of(written, &text));
        for (corrected, walked) in [(&sparse, between.rms()), (&dense, after.rms())] {
            let reported = Summary::of(&corrected.rows).remaining_path_rms_mm;
            assert!(
                (reported - walked).abs() < 0.02 * reported + 0.003,
                "{name}: reported {reported}, walked {walked}"
            );
        }
        assert!(after.rms() <= 0.012 && after.most() <= 0.02, "{name}: {} {}", after.rms(), after.most());
    }
}
