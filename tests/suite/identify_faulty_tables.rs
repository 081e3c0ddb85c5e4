//! Tables with a fault of each kind: each is refused, or the fault is said; none is fitted in silence.

use crate::identify::no_data;
use deflex::cell::Cell;
use deflex::identify::{Identification, Input, identify};
use deflex::measured::{MeasuredRow, Table, TargetRef};
use deflex::program::rapid;
use deflex::text::{Diagnostic, Source};
use std::path::Path;

fn source(folder: &str, name: &str) -> Source {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/blind").join(folder).join(name);
    Source::new(name, std::fs::read(path).unwrap())
}

/// A cell with what was measured on it.
struct Measured {
    cell: Cell,
    program: Source,
    table: Table,
}

impl Measured {
    fn of(folder: &str) -> Self {
        Self {
            cell: Cell::read(&source(folder, "cell.toml")).unwrap(),
            program: source(folder, "part.mod"),
            table: Table::read(&source(folder, "measured.csv")).unwrap(),
        }
    }

    fn identified(&self, table: Table) -> Result<Identification, Vec<Diagnostic>> {
        self.identified_runs(vec![table])
    }

    /// The identification from several runs of the program.
    fn identified_runs(&self, tables: Vec<Table>) -> Result<Identification, Vec<Diagnostic>> {
        let program = || rapid::read(vec![self.program.clone()], Vec::new()).unwrap();
        let runs = tables.into_iter().map(|table| (program(), table).into()).collect();
        identify(Input { runs, ..no_data(&self.cell) })
    }
}

/// Numbers between 0 and 1 that look drawn (Knuth's MMIX sequence).
struct Draw(u64);

impl Draw {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normal enough: the sum of twelve.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }

    /// An index among so many, from a share on.
    fn at(&mut self, count: usize, from: f64, to: f64) -> usize {
        (count as f64 * (from + (to - from) * self.unit())) as usize
    }

    /// A direction, of that length.
    fn away(&mut self, length: f64) -> [f64; 3] {
        let v = [self.normal(), self.normal(), self.normal()];
        let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.map(|x| length * x / norm)
    }
}

type Rows = Vec<MeasuredRow>;
type Fault = fn(&mut Rows, &mut Draw);

fn points(rows: &mut [MeasuredRow], change: impl Fn([f64; 3]) -> [f64; 3]) {
    for row in rows {
        row.position_mm = row.position_mm.map(&change);
        row.axes_mm = row.position_mm.unwrap().map(Some);
    }
}

fn forces(rows: &mut [MeasuredRow], change: impl Fn([f64; 3]) -> [f64; 3]) {
    rows.iter_mut().for_each(|row| row.force_n = row.force_n.map(&change));
}

/// A stretch somewhere in the middle.
fn stretch<'a>(rows: &'a mut Rows, draw: &mut Draw) -> &'a mut [MeasuredRow] {
    let (from, length) = (draw.at(rows.len(), 0.2, 0.5), draw.at(rows.len(), 0.25, 0.4));
    &mut rows[from..from + length]
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] + b[k])
}

fn ordinals(rows: &mut Rows, by: i64) {
    let count = rows.len() as i64;
    for row in rows.iter_mut() {
        let Some(TargetRef::Ordinal(ordinal)) = &mut row.target else { continue };
        *ordinal = u32::try_from(i64::from(*ordinal) + by).unwrap();
    }
    rows.retain(|row| matches!(row.target, Some(TargetRef::Ordinal(n)) if n > 0 && i64::from(n) <= count));
}

/// The forces of the rows before (or after); all other values stay.
fn late(rows: &mut Rows, by: isize) {
    let read: Vec<_> = rows.iter().map(|row| row.force_n).collect();
    for (i, row) in rows.iter_mut().enumerate() {
        row.force_n = i.checked_add_signed(-by).and_then(|i| read.get(i).copied()).unwrap_or(read[i]);
    }
}

/// Faults that are refused, whatever else is in the table.
const REFUSED: [(&str, Fault); 23] = [
    ("metres", |rows, _| points(rows, |p| p.map(|v| 1e-3 * v))),
    ("inches", |rows, _| points(rows, |p| p.map(|v| v / 25.4))),
    ("x and y swapped", |rows, _| points(rows, |[x, y, z]| [y, x, z])),
    ("y and z swapped", |rows, _| points(rows, |[x, y, z]| [x, z, y])),
    ("columns in the order y, z, x", |rows, _| points(rows, |[x, y, z]| [y, z, x])),
    ("x with its sign turned", |rows, _| points(rows, |[x, y, z]| [-x, y, z])),
    ("y with its sign turned", |rows, _| points(rows, |[x, y, z]| [x, -y, z])),
    ("z with its sign turned", |rows, _| points(rows, |[x, y, z]| [x, y, -z])),
    ("x and y with their signs turned", |rows, _| points(rows, |[x, y, z]| [-x, -y, z])),
    ("another frame", |rows, _| points(rows, |p| plus(p, [300.0, -120.0, 80.0]))),
    ("ordinals one too high", |rows, _| ordinals(rows, 1)),
    ("ordinals one too low", |rows, _| ordinals(rows, -1)),
    ("points one row late", |rows, _| {
        let read: Vec<_> = rows.iter().map(|row| row.position_mm).collect();
        rows.iter_mut().skip(1).zip(&read).for_each(|(row, read)| row.position_mm = *read);
        points(rows, |p| p);
    }),
    ("rows out of order", |rows, draw| {
        let targets: Vec<_> = rows.iter().map(|row| row.target.clone()).collect();
        let mut order: Vec<(f64, usize)> = (0..rows.len()).map(|i| (draw.unit(), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        rows.iter_mut().zip(order).for_each(|(row, (_, i))| row.target = targets[i].clone());
    }),
    ("a stretch in metres", |rows, draw| points(stretch(rows, draw), |p| p.map(|v| 1e-3 * v))),
    ("a stretch in inches", |rows, draw| points(stretch(rows, draw), |p| p.map(|v| v / 25.4))),
    ("a stretch with x and y swapped", |rows, draw| points(stretch(rows, draw), |[x, y, z]| [y, x, z])),
    ("the part moved by 12 mm", |rows, draw| {
        let (from, away) = (draw.at(rows.len(), 0.6, 0.8), draw.away(15.0));
        points(&mut rows[from..], |p| plus(p, away));
    }),
    ("rows doubled", |rows, draw| {
        for _ in 0..3 {
            let at = draw.at(rows.len(), 0.0, 0.99);
            rows.insert(at, rows[at].clone());
        }
    }),
    ("one reading repeated", |rows, draw| {
        let from = draw.at(rows.len(), 0.1, 0.7);
        let stuck = rows[from].position_mm.unwrap();
        points(&mut rows[from..from + 5], |_| stuck);
    }),
    ("noise of 3 mm", |rows, draw| {
        for row in rows.iter_mut() {
            row.position_mm = row.position_mm.map(|p| p.map(|v| v + 3.0 * draw.normal()));
        }
        points(rows, |p| p);
    }),
    ("forces in kilonewtons", |rows, _| forces(rows, |f| f.map(|v| 1e-3 * v))),
    ("forces missing in a stretch", |rows, draw| stretch(rows, draw).iter_mut().for_each(|row| row.force_n = None)),
];

/// Faults that are reported in addition to the fitted effects.
const SAID: [(&str, Fault); 16] = [
    ("forces in pounds", |rows, _| forces(rows, |f| f.map(|v| v / 4.448))),
    ("forces in kilograms", |rows, _| forces(rows, |f| f.map(|v| v / 9.807))),
    ("readings in steps of 0.2 mm", |rows, _| points(rows, |p| p.map(|v| (v / 0.2).round() * 0.2))),
    ("outliers", |rows, draw| {
        for row in rows.iter_mut().step_by(11) {
            let length = 0.5 + draw.unit();
            let away = draw.away(length);
            row.position_mm = row.position_mm.map(|p| plus(p, away));
        }
        points(rows, |p| p);
    }),
    ("a slip", |rows, draw| {
        let (from, away) = (draw.at(rows.len(), 0.3, 0.7), draw.away(0.2));
        points(&mut rows[from..], |p| plus(p, away));
    }),
    ("a drift", |rows, draw| {
        let (count, away) = (rows.len() as f64, draw.away(0.15));
        for (i, row) in rows.iter_mut().enumerate() {
            row.position_mm = row.position_mm.map(|p| plus(p, away.map(|v| v * i as f64 / count)));
        }
        points(rows, |p| p);
    }),
    ("fx with its sign turned", |rows, _| forces(rows, |[x, y, z]| [-x, y, z])),
    ("fy with its sign turned", |rows, _| forces(rows, |[x, y, z]| [x, -y, z])),
    ("fz with its sign turned", |rows, _| forces(rows, |[x, y, z]| [x, y, -z])),
    ("all forces with their signs turned", |rows, _| forces(rows, |f| f.map(|v| -v))),
    ("fx and fy swapped", |rows, _| forces(rows, |[x, y, z]| [y, x, z])),
    ("forces in the order z, x, y", |rows, _| forces(rows, |[x, y, z]| [z, x, y])),
    ("crosstalk of the forces", |rows, _| {
        forces(rows, |[x, y, z]| [x + 0.25 * y - 0.2 * z, y - 0.3 * x + 0.2 * z, z + 0.25 * x + 0.2 * y]);
    }),
    ("forces one row late", |rows, _| late(rows, 1)),
    ("forces one row early", |rows, _| late(rows, -1)),
    ("forces five rows late", |rows, _| late(rows, 5)),
];

/// Whether a fault went unsaid.
fn silent(found: &Identification) -> bool {
    let doubted = |advice: &String| advice.contains("steps of") || advice.contains("the forces of the table");
    !(found.unexplained.significant || !found.outliers.is_empty() || found.advice.iter().any(doubted))
}

#[test]
fn faulty_tables_of_few_rows_are_refused() {
    let measured = Measured::of("planned_white_force_scale-15");
    for (seed, (name, fault)) in REFUSED.iter().enumerate() {
        let mut table = measured.table.clone();
        fault(&mut table.rows, &mut Draw(seed as u64));
        let refused = measured.identified(table).err();
        let error = refused.unwrap_or_else(|| panic!("{name}: not refused")).swap_remove(0);
        assert!(error.help.is_some() && !error.message.is_empty(), "{name}: {error}");
    }
}

#[test]
#[ignore = "minutes: cargo test --release --test suite -- --ignored faulty_tables"]
fn faulty_tables_are_refused_or_the_fault_is_said() {
    const SEEDS: [&str; 5] = [
        "designed_wander_none-20",
        "designed_wander_gravity-22",
        "designed_wander_bearing_compliance-21",
        "designed_wander_pair-21",
        "plain_wander_backlash-20",
    ];
    let mut unsaid = Vec::new();
    for (seed, folder) in SEEDS.iter().enumerate() {
        let measured = Measured::of(folder);
        for (name, fault) in REFUSED.iter().chain(&SAID) {
            let mut table = measured.table.clone();
            fault(&mut table.rows, &mut Draw(seed as u64 + 1));
            if measured.identified(table).is_ok_and(|found| silent(&found)) {
                unsaid.push(format!("{name} in {folder}"));
            }
        }
    }
    assert!(unsaid.is_empty(), "fitted in silence: {unsaid:#?}");
}

#[test]
fn a_table_that_is_given_twice_is_refused() {
    let measured = Measured::of("planned_white_force_scale-15");
    let error = measured.identified_runs(vec![measured.table.clone(); 2]).unwrap_err().swap_remove(0);
    assert!(error.message.contains("number by number"), "{error}");
}

/// A work object that was taught 20 mm away from its place is that, and no weight of the arm.
#[test]
fn a_constant_offset_is_the_work_object_frame_however_large_it_is() {
    let measured = Measured::of("designed_wander_none-20");
    let mut table = measured.table.clone();
    points(&mut table.rows, |p| plus(p, [4.0, -7.0, 18.0]));
    let found = measured.identified(table).unwrap();
    assert_eq!(found.added.iter().map(|added| &added.kind[..]).collect::<Vec<_>>(), ["work_object_frame"]);
    assert!(found.after.rms_mm < 2.0 * found.noise_floor_rms_mm, "{:?}", found.after);
    // Its axes are those of the base, and not those of the table.
    let shift: f64 = found.added[0].parameters[..3].iter().map(|parameter| parameter.value.powi(2)).sum();
    assert!((shift.sqrt() - 389f64.sqrt()).abs() < 0.3, "{:?}", found.added);
}
