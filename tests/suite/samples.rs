//! The samples that the README runs: corrected, and judged on the numbers as written.

use deflex::cell::Cell;
use deflex::correct::{Options, Prepared, Status, compensate, predict};
use deflex::measured::Table;
use deflex::program::{Program, Role, cl, rapid};
use deflex::text::{Source, applied};
use nalgebra::Matrix6;
use std::path::Path;

/// What single precision and four decimals leave, mm: well below a micrometre.
const REMAINS_MM: f64 = 0.001;

fn source(path: &str) -> Source {
    Source::new(path, std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("samples").join(path)).unwrap())
}

fn cell(path: &str) -> Cell {
    Cell::read(&source(path)).unwrap()
}

fn lands(program: &Program, cell: &Cell, options: &Options) {
    let corrected = compensate(program, cell, options).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures[0]);
    for row in corrected.rows.iter().filter(|row| row.status == Status::Ok) {
        assert!(row.remaining_norm_mm() < REMAINS_MM, "target {}: {:?}", row.target, row.remaining_mm);
    }
    let Some(rewritten) = corrected.rewritten else { return };
    let bytes = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    let again = rapid::read(vec![Source::new("corrected.mod", bytes)], Vec::new()).unwrap();
    let before = predict(program, cell, options, None).unwrap();
    let after = predict(&again, cell, options, Some(program)).unwrap();
    let rms = |rows: &[deflex::correct::Row]| {
        (rows.iter().map(|r| r.error_norm_mm().powi(2)).sum::<f64>() / rows.len() as f64).sqrt()
    };
    // At most 0.2 % of the uncorrected error.
    assert!(rms(&after.rows) < 0.002 * rms(&before.rows), "{} of {}", rms(&after.rows), rms(&before.rows));
}

#[test]
fn the_slot_lands() {
    lands(
        &rapid::read(vec![source("slot/slot.mod")], Vec::new()).unwrap(),
        &cell("slot/cell.toml"),
        &Options::default(),
    );
}

/// On a turntable and along a track.
#[test]
fn the_units_land() {
    lands(
        &rapid::read(vec![source("units/units.mod")], Vec::new()).unwrap(),
        &cell("units/cell.toml"),
        &Options::default(),
    );
}

/// The practice cell whose model is complete.
#[test]
#[ignore = "needs the practice cells: DEFLEX_SHARED=folder cargo test --test suite -- --ignored samples::"]
fn a_practice_cell_lands() {
    let shared = std::env::var("DEFLEX_SHARED").unwrap_or_else(|_| "../shared".into());
    let folder = std::path::Path::new(&shared).join("practice/none");
    let read = |name: &str| Source::new(name, std::fs::read(folder.join(name)).unwrap());
    let program = rapid::read(vec![read("part.mod")], Vec::new()).unwrap();
    let forces = Table::read(&read("measured.csv")).unwrap().forces();
    lands(&program, &Cell::read(&read("cell.toml")).unwrap(), &Options { forces: Some(forces), ..Options::default() });
}

#[test]
fn the_blade_lands_as_rapid_and_as_cl() {
    let cell = cell("blade/cell.toml");
    lands(&rapid::read(vec![source("blade/blade.mod")], Vec::new()).unwrap(), &cell, &Options::default());
    let options = &cell.cl.as_ref().unwrap().options;
    let program = cl::read(source("blade/blade.aptsource"), options).unwrap();
    assert!(program.targets.len() >= 2000);
    lands(&program, &cell, &Options::default());
}

#[test]
fn threads_do_not_change_a_byte() {
    let program = rapid::read(vec![source("slot/slot.mod")], Vec::new()).unwrap();
    let cell = cell("slot/cell.toml");
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let corrected = pool.install(|| compensate(&program, &cell, &Options::default()).unwrap());
        (corrected.rows, corrected.rewritten.unwrap().edits)
    };
    assert_eq!(with(1), with(7));
}

#[test]
fn the_stiffness_of_a_joint_model_is_that_of_its_jacobian() {
    let program = rapid::read(vec![source("slot/slot.mod")], Vec::new()).unwrap();
    let cell = cell("slot/cell.toml");
    let options = Options { stiffness: true, ..Options::default() };
    let rows = predict(&program, &cell, &options, None).unwrap().rows;
    let prepared = Prepared::new(&program, &cell, &options).unwrap();
    let (robot, stiffness) = (&cell.arm.robot, cell.arm.stiffness.unwrap());
    for (i, row) in rows.iter().enumerate().filter(|(_, row)| row.status == Status::Ok) {
        let (point, base_from_wobj) = (&prepared.points[i], prepared.base_from_wobj(i));
        let found = row.stiffness.unwrap();
        let tcp = (base_from_wobj * point.wobj_from_tcp).translation.vector;
        let jacobian = robot.jacobian(&robot.frames(&point.motor), &tcp);
        let forces = jacobian.fixed_rows::<3>(0);
        // C = J K⁻¹ Jᵀ, in base axes.
        let compliance = forces * Matrix6::from_diagonal(&stiffness.map(f64::recip)) * forces.transpose();
        let normal = base_from_wobj.rotation * point.normal;
        let eigenvalues = compliance.symmetric_eigenvalues();
        // The load turns the arm a little from where the program says.
        for (found, compliance) in [
            (found.normal_n_per_mm, normal.dot(&(compliance * normal))),
            (found.least_n_per_mm, eigenvalues.max()),
            (found.most_n_per_mm, eigenvalues.min()),
        ] {
            approx::assert_relative_eq!(found, 1e-3 / compliance, max_relative = 0.01);
        }
    }
}

#[test]
fn sigma_is_reported_at_the_ends_of_arcs_too() {
    let slot = String::from_utf8(source("slot/slot.mod").bytes.to_vec()).unwrap();
    let mut moves = slot.lines().filter_map(|line| line.trim().strip_prefix("MoveL "));
    let [from, via, to, on] = std::array::from_fn(|_| moves.next().unwrap());
    let robtarget = via.split(",v20").next().unwrap().replace("[[1.0000,0.0000", "[[1.0000,0.3000");
    let head = slot.split("    MoveL").next().unwrap();
    let text = format!("{head}MoveL {from}\nMoveC {robtarget},{to}\nMoveL {on}\nENDPROC\nENDMODULE\n");
    let program = rapid::read(vec![Source::new("arc.mod", text)], Vec::new()).unwrap();

    /// rad
    const UNSURE: f64 = 1e-5;
    let zeros = "0.0, ".repeat(5);
    let rows = format!("[{:e}, {zeros}], ", UNSURE * UNSURE) + &format!("[0.0, {zeros}], ").repeat(5);
    let effect = format!(
        "\n[[effect]]\nkind = \"zero_offset\"\noffset_rad = [0.0, {zeros}]\n[effect.uncertainty]\ncovariance = [{rows}]\n"
    );
    let cell = String::from_utf8(source("slot/cell.toml").bytes.to_vec()).unwrap() + &effect;
    let cell = Cell::read(&Source::new("cell.toml", cell)).unwrap();
    let rows = predict(&program, &cell, &Options::default(), None).unwrap().rows;
    assert_eq!(rows.len(), 3);
    let prepared = Prepared::new(&program, &cell, &Options::default()).unwrap();
    let ends = program.targets.iter().zip(&prepared.points).enumerate().filter(|(_, (t, _))| t.role == Role::End);
    for (row, (i, (_, point))) in rows.iter().zip(ends) {
        let tcp = (prepared.base_from_wobj(i) * point.wobj_from_tcp).translation.vector;
        let jacobian = cell.arm.robot.jacobian(&cell.arm.robot.frames(&point.motor), &tcp);
        let moved = jacobian.fixed_view::<3, 1>(0, 0).norm() * UNSURE * 1e3;
        // A root mean over the axes. The load turns the arm a little from where the program says.
        approx::assert_relative_eq!(row.sigma_mm.unwrap(), moved / 3.0_f64.sqrt(), max_relative = 0.01);
    }
}
