//! KRL in a cell whose force follows the feed: cuts after a branch, and at the start of a contour.

use deflex_cell::Cell;
use deflex_correct::{Options, Row, Status, compensate};
use deflex_program::krl;
use deflex_text::Source;

const CELL: &str = r#"
[robot]
model = "kr210-r2700-2"
[robot.stiffness]
joint_nm_per_rad = [1.9e6, 2.2e6, 1.4e6, 4.1e5, 3.6e5, 1.7e5]
[limits]
max_step_mm = 10.0
[controller]
compensates = []
[cut]
force = "constant"
force_n = [140.0, -260.0, 310.0]
frame = "feed"
max_cutting_feed_mm_s = 100.0
[tools."TOOL_DATA[1]"]
tcp_mm = [0.0, 0.0, 310.0]
tcp_abc_deg = [0.0, 0.0, 0.0]
mass_kg = 18.0
cog_mm = [0.0, 0.0, 120.0]
[wobjs."BASE_DATA[1]"]
uframe_mm = [1450.0, -120.0, 800.0]
uframe_abc_deg = [0.0, 0.0, 0.0]
"#;

fn lin(x: u32, y: u32) -> String {
    format!("LIN {{X {x}.0,Y {y}.0,Z 0.0,A 0.0,B 0.0,C 180.0}}\n")
}

fn rows(body: &str) -> Vec<Row> {
    let text = format!("DEF p()\nDECL INT i\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.05\n{body}END\n");
    let points = "DEFDAT p\nDECL FRAME P1={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0}\nENDDAT\n";
    let program = krl::read(vec![Source::new("p.src", text), Source::new("p.dat", points)], Vec::new()).unwrap();
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    compensate(&program, &cell, &Options::default()).unwrap().rows
}

/// The second branch is corrected as if the program had no other. After the branches, the way has two possible starts.
#[test]
fn each_branch_has_the_force_of_its_own_way() {
    let [before, then, other, after] = [lin(0, 0), lin(50, 0), lin(0, 50), lin(50, 50)];
    let both = rows(&format!("{before}IF $IN[1] THEN\n{then}ELSE\n{other}ENDIF\n{after}"));
    let alone = rows(&format!("{before}{other}"));
    let kept: Vec<bool> = both.iter().map(|row| matches!(row.status, Status::Kept(_))).collect();
    assert_eq!(kept, [false, false, false, true]);
    let apart =
        |a: &Row, b: &Row| a.correction_mm.iter().zip(b.correction_mm).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart(&both[2], &alone[1]) < 1e-3, "{both:?} {alone:?}");
    assert!(apart(&both[2], &both[1]) > 0.1, "{both:?}");
}

/// The first round of a closed contour begins at its start, where the tool stands already. It cuts nothing, and each round ends there.
#[test]
fn the_start_of_a_contour_goes_along_with_its_end() {
    let round = format!("FOR i=1 TO 2\nLIN P1\n{}ENDFOR\nLIN P1\n", lin(50, 0));
    let rows = rows(&format!("$VEL.CP=0.3\nLIN P1\n$VEL.CP=0.05\n{round}"));
    assert!(rows.iter().all(|row| row.reason().is_empty()), "{rows:?}");
    let along: Vec<bool> = rows.iter().map(|row| row.goes_along).collect();
    assert_eq!(along, [true, true, false, false, false, false]);
    assert!(rows[3].correction_norm_mm() > 0.1, "{rows:?}");
    assert_eq!(rows[1].correction_mm.map(f64::to_bits), rows[5].correction_mm.map(f64::to_bits), "{rows:?}");
}
