//! Faults of the measurement stand among the rivals: they are said, never named as an effect and never written to a cell.

use crate::identify::{no_data, source};
use deflex::cell::{Cell, extended};
use deflex::identify::{Identification, Input, identify};
use deflex::measured::Table;
use deflex::program::{Program, rapid};
use deflex::text::Source;
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/blind").join(name)
}

fn program(name: &str) -> Program {
    rapid::read(vec![source(&folder(name).join("part.mod"))], Vec::new()).unwrap()
}

fn table(name: &str) -> Table {
    Table::read(&source(&folder(name).join("measured.csv"))).unwrap()
}

fn found(name: &str, table: Table, cell: &Cell) -> Identification {
    let runs = vec![(program(name), table).into()];
    identify(Input { runs, ..no_data(cell) }).unwrap()
}

fn cell(name: &str) -> Cell {
    Cell::read(&source(&folder(name).join("cell.toml"))).unwrap()
}

const NONE: &str = "designed_wander_none-20";
const BACKLASH: &str = "plain_wander_backlash-20";

#[test]
fn a_force_column_with_its_sign_turned_is_said_and_nothing_is_added() {
    let mut turned = table(NONE);
    for row in &mut turned.rows {
        row.force_n = row.force_n.map(|[x, y, z]| [x, -y, z]);
    }
    let found = found(NONE, turned, &cell(NONE));
    assert!(found.added.is_empty(), "{:?}", found.added);
    assert!(found.unexplained.significant);
    let words = &found.unexplained.correlates[0].with;
    assert!(found.unexplained.correlates.iter().any(|c| c.with.contains("fy_n with its sign turned")), "{words}");
}

#[test]
fn forces_that_come_some_rows_late_are_said_with_their_number() {
    const ROWS: usize = 4;
    let mut late = table(NONE);
    let read: Vec<_> = late.rows.iter().map(|row| row.force_n).collect();
    late.rows.iter_mut().skip(ROWS).zip(read).for_each(|(row, force_n)| row.force_n = force_n);
    let found = found(NONE, late, &cell(NONE));
    assert!(found.added.is_empty(), "{:?}", found.added);
    let said: Vec<&str> = found.unexplained.correlates.iter().map(|c| &c.with[..]).collect();
    assert!(said.contains(&"the force, if each row has that of 4 rows before it"), "{said:?}");
}

#[test]
fn a_part_that_slips_is_a_jump_at_its_row_and_no_effect() {
    let mut slipped = table(NONE);
    // Line 1 is the header.
    const LINE: u64 = 170;
    for row in slipped.rows.iter_mut().filter(|row| row.line >= LINE) {
        row.position_mm = row.position_mm.map(|[x, y, z]| [x + 0.09, y, z - 0.12]);
    }
    let found = found(NONE, slipped, &cell(NONE));
    assert!(found.added.is_empty(), "{:?}", found.added);
    let said = &found.unexplained.correlates[0].with;
    let line: u64 = said.split_whitespace().find_map(|word| word.trim_end_matches(':').parse().ok()).unwrap();
    // Held-out rows hide where in their block it was.
    assert!(line.abs_diff(LINE) <= 20, "{said}");
}

#[test]
fn each_run_has_its_own_clamping_and_a_second_turn_adds_nothing() {
    let mut runs = table(BACKLASH);
    let half = runs.rows.len() / 2;
    for (i, row) in runs.rows.iter_mut().enumerate() {
        let (name, [dx, dy, dz]) = if i < half { ("a", [0.21, -0.3, 0.1]) } else { ("b", [-0.15, 0.1, 0.25]) };
        row.run = Some(name.to_owned());
        row.position_mm = row.position_mm.map(|[x, y, z]| [x + dx, y + dy, z + dz]);
    }
    let first = found(BACKLASH, runs, &cell(BACKLASH));
    assert_eq!(first.added.iter().map(|a| a.kind.as_str()).collect::<Vec<_>>(), ["backlash"]);
    assert!(first.added[0].not_told_apart_from.is_empty() && !first.unexplained.significant);
    // The clamping is in neither error.
    assert!(first.before.rms_mm < 0.2 && first.after.rms_mm < 1.2 * first.noise_floor_rms_mm, "{:?}", first.before);
    let text = String::from_utf8(source(&folder(BACKLASH).join("cell.toml")).bytes).unwrap();
    let text = extended(&text, &first.extended).unwrap();
    let second = Cell::read(&Source::new("extended", text.into_bytes())).unwrap();
    let again = found(BACKLASH, table(BACKLASH), &second);
    // What is known may be known better; nothing new is there.
    assert!(again.added.iter().all(|added| added.kind == "backlash"), "{:?}", again.added);
    assert!(again.after.rms_mm <= again.before.rms_mm);
}
