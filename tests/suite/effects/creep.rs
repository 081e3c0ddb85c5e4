//! Gears that creep, and friction that follows the twist of the gears, along a program: by hand, and in chunks against the same program as a
//! whole.

use deflex::cell::Cell;
use deflex::correct::{Options, Sinks, compensate, compensate_chunks, predict};
use deflex::program::Program;
use deflex::program::rapid::{self, Chunks};
use deflex::report::{CSV_HEADER, csv_rows, write_csv};
use deflex::text::{Source, apply};

/// The slot of the paper at 2 mm/s: 80 mm in 40 s. The force is constant.
const CUT: &str = "[cut]\nforce = \"constant\"\nforce_n = [150.0, -90.0, 120.0]\nframe = \"wobj\"\n";

/// All joints yield by another fifth, with a time constant of 5 s.
const CREEP: &str = "\n[[effect]]\nkind = \"creep\"\nshare_5_s = [0.2, 0.2, 0.2, 0.2, 0.2, 0.2]\n\
                     share_15_s = [0, 0, 0, 0, 0, 0]\nshare_45_s = [0, 0, 0, 0, 0, 0]\nshare_135_s = [0, 0, 0, 0, 0, 0]\n";
const FRICTION: &str = "\n[[effect]]\nkind = \"backlash\"\nhalf_gap_rad = [1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4]\n\
                        presliding_rad = [1e-3, 3e-4, 2e-3, 1e-3, 3e-3, 5e-4]\n";
/// Share of the deflection by which the change of the pose in the last seconds may matter.
const CHANGE_OF_POSE: f64 = 1e-3;

const SOFTER: &str = "\n[[effect]]\nkind = \"joint_stiffness\"\nscale = [SCALE, SCALE, SCALE, SCALE, SCALE, SCALE]\n";

fn cell(more: &str) -> Cell {
    let text = std::fs::read_to_string("samples/slot/cell.toml").unwrap();
    let text = format!("{}{CUT}{more}", text.split_once("[cut]").unwrap().0);
    Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap()
}

fn text() -> String {
    std::fs::read_to_string("samples/slot/slot.mod").unwrap().replace(",v20,", ",[2,500,5000,1000],")
}

fn program() -> Program {
    rapid::read(vec![Source::new("slot.mod", text().into_bytes())], Vec::new()).unwrap()
}

/// Size of the predicted error at each target, mm.
fn errors(more: &str) -> Vec<f64> {
    let predicted = predict(&program(), &cell(more), &Options::default(), None).unwrap();
    assert!(predicted.failures.is_empty(), "{:?}", predicted.failures);
    predicted.rows.iter().map(deflex::correct::Row::error_norm_mm).collect()
}

#[test]
fn joints_yield_more_and_more_until_they_are_as_soft_as_springs_softer_by_the_share() {
    let crept = errors(CREEP);
    // 0.5 s for each millimetre; the pose of the arm hardly changes.
    for target in [1, 10, 20, 80] {
        let share = 0.2 * (1.0 - (-0.5 * target as f64 / 5.0).exp());
        let by_hand = errors(&SOFTER.replace("SCALE", &format!("{}", 1.0 / (1.0 + share))))[target];
        assert!(
            (crept[target] - by_hand).abs() < CHANGE_OF_POSE * by_hand,
            "target {target}: {} and {by_hand}",
            crept[target]
        );
    }
}

/// An arm that stands still while a force comes. Joint 1 alone is soft: 100 N at 350 mm twist it by 0.35 mrad, which is the presliding angle.
/// Friction then holds back 1 − 1/e of the half gap of 1 mrad. Without a presliding angle, only a motion turns friction.
#[test]
fn a_force_that_comes_turns_friction() {
    let error_y_mm = |presliding: &str| {
        let text = format!(
            "[robot]\nmodel = \"irb120-3-0.58\"\n[robot.stiffness]\njoint_nm_per_rad = [1e5, 1e12, 1e12, 1e12, 1e12, 1e12]\n\
             [tools.t]\ntcp_mm = [0, 0, 100]\ntcp_quat = [1, 0, 0, 0]\n[cut]\nforce = \"constant\"\nforce_n = [0, 100, 0]\n\
             frame = \"wobj\"\n[[effect]]\nkind = \"backlash\"\nhalf_gap_rad = [1e-3, 0, 0, 0, 0, 0]\n{presliding}"
        );
        let cell = Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap();
        let target = "[[350,0,300],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,t;";
        let text = format!("MODULE m\nPROC main()\nMoveJ {target}\nMoveL {target}\nENDPROC\nENDMODULE\n");
        let program = rapid::read(vec![Source::new("m.mod", text.into_bytes())], Vec::new()).unwrap();
        predict(&program, &cell, &Options::default(), None).unwrap().rows[1].error_mm[1]
    };
    let (lever_mm, twist, gap) = (350.0, 3.5e-4, 1e-3);
    approx::assert_abs_diff_eq!(error_y_mm(""), lever_mm * twist, epsilon = 1e-4);
    let held_back = gap * (1.0 - (-1.0f64).exp());
    approx::assert_abs_diff_eq!(
        error_y_mm("presliding_rad = 3.5e-4\n"),
        lever_mm * (twist - held_back),
        epsilon = 1e-4
    );
}

#[test]
fn a_program_is_corrected_the_same_in_chunks() {
    for effect in [CREEP, FRICTION] {
        corrects_the_same_in_chunks(&cell(effect));
    }
}

fn corrects_the_same_in_chunks(cell: &Cell) {
    let (text, options) = (text(), Options::default());
    let whole = compensate(&program(), cell, &options).unwrap();
    assert!(whole.rows.iter().all(|row| row.remaining_norm_mm() < 1e-4));
    let (mut expected, mut report) = (Vec::new(), Vec::new());
    apply(text.as_bytes(), &whole.rewritten.as_ref().unwrap().edits[0], &mut expected).unwrap();
    write_csv(&whole.rows, &mut report).unwrap();
    for (threads, size) in [(1, 700), (2, 2_000), (2, 1 << 20)] {
        let chunks = Chunks::sized("slot.mod", text.as_bytes(), &[], size).unwrap().unwrap();
        let (mut bytes, mut rows) = (Vec::new(), CSV_HEADER.as_bytes().to_vec());
        let mut sinks =
            Sinks { report: &mut rows, rows: &|rows| csv_rows(rows), each: &mut |_| (), progress: &|_, _| () };
        let streamed = compensate_chunks(chunks, cell, &options, threads, &mut bytes, &mut sinks).unwrap();
        assert!(streamed.failures.is_empty(), "{:?}", streamed.failures);
        assert!(bytes == expected, "chunks of {size} bytes on {threads} threads");
        let (rows, report) = (String::from_utf8_lossy(&rows), String::from_utf8_lossy(&report));
        assert_eq!(rows, report, "chunks of {size} bytes on {threads} threads");
    }
}
