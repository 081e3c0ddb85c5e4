//! Rows as shops have them: single axes, places instead of targets, a dozen of them.

use crate::identify::{no_data, source};
use deflex::cell::Cell;
use deflex::identify::{Identification, Input, identify};
use deflex::measured::Table;
use deflex::program::{Goal, Program, rapid};
use deflex::report::residual_csv;
use deflex::text::{Diagnostic, Source};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/blind/plain_wander_backlash-20")
}

fn program() -> Program {
    rapid::read(vec![source(&folder().join("part.mod"))], Vec::new()).unwrap()
}

/// The first rows of the table.
fn table(rows: usize) -> Table {
    let mut table = Table::read(&source(&folder().join("measured.csv"))).unwrap();
    table.rows.truncate(rows);
    table
}

fn found(program: Program, table: Table) -> Result<Identification, Vec<Diagnostic>> {
    found_by(&Cell::read(&source(&folder().join("cell.toml"))).unwrap(), program, table)
}

fn found_by(cell: &Cell, program: Program, table: Table) -> Result<Identification, Vec<Diagnostic>> {
    let runs = vec![(program, table).into()];
    identify(Input { runs, ..no_data(cell) })
}

#[test]
fn progress_rises_and_calls_the_run_off() {
    let cell = Cell::read(&source(&folder().join("cell.toml"))).unwrap();
    let shares = std::sync::Mutex::new(Vec::new());
    let progress = |share: f64| {
        let mut shares = shares.lock().unwrap();
        shares.push(share);
        shares.len() < 3
    };
    let runs = vec![(program(), table(16)).into()];
    let input = Input { runs, progress: &progress, ..no_data(&cell) };
    assert_eq!(identify(input).unwrap_err()[0].code, "run.called-off");
    let shares = shares.lock().unwrap();
    assert!(
        shares.len() == 3 && shares.is_sorted() && shares.iter().all(|share| (0.01..1.0).contains(share)),
        "{shares:?}"
    );
}

/// Rows that name where they were taken instead of their targets: points so far above the path.
fn by_place(rows: usize, off_mm: f64) -> Table {
    let mut table = table(rows);
    let targets = program().targets;
    for (row, target) in table.rows.iter_mut().zip(&targets) {
        let Goal::Pose { position_mm: [x, y, z], .. } = target.goal else { panic!("no pose") };
        row.target = None;
        row.nominal_mm = Some([x, y, z + off_mm]);
        row.position_mm = row.position_mm.map(|[x, y, z]| [x, y, z + off_mm]);
    }
    table
}

#[test]
fn rows_that_name_a_place_belong_to_the_target_there() {
    const ROWS: usize = 24;
    let (named, placed) = (found(program(), table(ROWS)).unwrap(), found(program(), by_place(ROWS, 1.0)).unwrap());
    assert_eq!((named.rows, placed.rows), (ROWS, ROWS));
    // Above a path that rises, the nearest place is a little off the target.
    assert!((named.before.rms_mm / placed.before.rms_mm - 1.0).abs() < 0.05, "{:?} {:?}", named.before, placed.before);
    let far = found(program(), by_place(ROWS, 8.0)).unwrap_err();
    assert!(far[0].line == 2 && far[0].message.contains("8.00 mm from the path"), "{}", far[0]);
}

#[test]
fn a_place_between_targets_is_on_the_way_and_one_that_is_passed_twice_is_an_error() {
    let text = |last: &str| {
        let line = |mm: &str| {
            format!("MoveL [[{mm}],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\\WObj:=wPart;\n")
        };
        let head = std::fs::read_to_string(folder().join("part.mod")).unwrap();
        let head = head.split("  PROC main()").next().unwrap().to_owned();
        let body: String = ["100,200,0", "100,300,0", last].map(line).concat();
        let source = Source::new("part.mod", format!("{head}  PROC main()\n{body}  ENDPROC\nENDMODULE\n").into_bytes());
        rapid::read(vec![source], Vec::new()).unwrap()
    };
    // Twelve rows on the first way, every other one not measured in y.
    let rows = |shift: f64| {
        let head = "nominal_x_mm;nominal_y_mm;nominal_z_mm;x_mm;y_mm;z_mm\n".to_owned();
        let row = |i: usize| {
            let y = 210.0 + 7.0 * i as f64;
            let seen = if i.is_multiple_of(2) {
                format!("{:.3}", y + 0.004 * (i % 3) as f64).replace('.', ",")
            } else {
                String::new()
            };
            format!("{:.1};{y:.1};0;100,00{};{seen};0,00{}\n", 100.0 + shift, i % 5, i % 4).replace('.', ",")
        };
        let text: String = std::iter::once(head).chain((0..12).map(row)).collect();
        Table::read(&Source::new("cmm.csv", text.into_bytes())).unwrap()
    };
    let found_on = |last: &str, shift: f64| {
        let mut cell = std::fs::read_to_string(folder().join("cell.toml")).unwrap();
        cell = cell.replace("force = \"table\"", "force = \"none\"");
        let cell = Cell::read(&Source::new("cell.toml", cell.into_bytes())).unwrap();
        found_by(&cell, text(last), rows(shift))
    };
    let once = found_on("200,300,0", 0.0).unwrap();
    // Nothing is off by more than the numbers above say, and nothing is named.
    assert!(
        once.rows == 12 && once.added.is_empty() && once.before.rms_mm < 0.02,
        "{:?} {:?}",
        once.before,
        once.added
    );
    let twice = found_on("100,200,0", 0.0).unwrap_err();
    assert!(twice[0].line == 2 && twice[0].message.contains("as near to the path to target"), "{}", twice[0]);
    assert!(found_on("200,300,0", 6.0).unwrap_err()[0].message.contains("from the path"));
}

/// Twenty-four rows that `deflex plan` chose: a factor of the force is no force mixed up by halves.
#[test]
fn a_factor_of_the_force_is_named_from_planned_rows() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/blind/planned_white_force_scale-15");
    let cell = Cell::read(&source(&folder.join("cell.toml"))).unwrap();
    let program = rapid::read(vec![source(&folder.join("part.mod"))], Vec::new()).unwrap();
    let mut table = Table::read(&source(&folder.join("measured.csv"))).unwrap();
    // One gauge reading among the points: its other axes are not measured.
    let [x, ..] = table.rows[0].position_mm.take().unwrap();
    table.rows[0].axes_mm = [Some(x), None, None];
    let found = found_by(&cell, program, table).unwrap();
    let [added] = &found.added[..] else { panic!("{:?}", found.added) };
    assert_eq!(added.kind, "force_scale");
    assert!(added.posterior >= 0.9 && added.not_told_apart_from.is_empty(), "{added:?}");
    let [low, high] = added.parameters[0].ci95;
    // What the plant had.
    assert!(low < 1.195_127 && 1.195_127 < high, "{added:?}");
    let csv = residual_csv(&found.residuals);
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let (head, first) = (lines.next().unwrap(), lines.next().unwrap());
    // Prefit, postfit and whitened, each along three axes.
    let from = head.iter().position(|name| *name == "prefit_x_mm").unwrap();
    assert!(
        first[from..from + 9].chunks(3).all(|of| !of[0].is_empty() && of[1].is_empty() && of[2].is_empty()),
        "{first:?}"
    );
}
