//! The turn about the tool axis, chosen along the path: against dynamic programming over `predict` at every constant turn.

use super::bench::{Bench, CELL};
use std::f64::consts::PI;

/// Turns of the reference's grid.
const TURNS: usize = 24;

/// A wave that the tool follows leaning, 6 mm a target.
fn path() -> String {
    let mut text = "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,0,0,0,1\n".to_owned();
    for i in 1..40 {
        let s = f64::from(i) / 40.0;
        let lean = 0.35 * (2.0 * PI * s).sin();
        let (x, y, z) = (240.0 * s, 80.0 * (PI * s).sin(), 20.0 * (2.0 * PI * s).cos());
        text += &format!(
            "GOTO/{x:.4},{y:.4},{z:.4},{:.6},{:.6},{:.6}\n",
            lean.sin(),
            0.1 * lean,
            (1.0 - lean.sin().powi(2) - 0.01 * lean * lean).sqrt()
        );
    }
    text + "FINI\n"
}

/// A spindle at 45° next to the flange: the posture of the arm depends on the turn.
fn cell(spin: &str) -> String {
    let tilted = CELL.replace("tcp_mm = [0, 0, 310]", "tcp_mm = [150, 0, 260]");
    let tilted = tilted.replace("tcp_quat = [1, 0, 0, 0]", "tcp_quat = [0.92387953, 0, 0.38268343, 0]");
    assert_ne!(tilted, CELL);
    tilted.replace("spin = \"fixed\"", spin)
}

/// Report columns of each row by name.
fn column(report: &str, name: &str) -> Vec<f64> {
    let at = report.lines().next().unwrap().split(',').position(|field| field == name).unwrap();
    report.lines().skip(1).map(|row| row.split(',').nth(at).unwrap().parse().unwrap()).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Least rms of all ways through the grid whose turn changes by 5° a millimetre at most.
fn least(errors: &[Vec<f64>], step_mm: f64) -> f64 {
    let targets = errors[0].len();
    let cells = (5.0 * step_mm / (360.0 / TURNS as f64)).floor() as usize;
    let mut so_far: Vec<f64> = errors.iter().map(|errors| errors[0] * errors[0]).collect();
    for i in 1..targets {
        so_far = (0..TURNS)
            .map(|turn| {
                let near = (0..TURNS).filter(|from| {
                    let apart = turn.abs_diff(*from);
                    apart.min(TURNS - apart) <= cells
                });
                near.map(|from| so_far[from]).fold(f64::INFINITY, f64::min) + errors[turn][i] * errors[turn][i]
            })
            .collect();
    }
    (so_far.into_iter().fold(f64::INFINITY, f64::min) / targets as f64).sqrt()
}

#[test]
fn the_chosen_turn_gains_what_dynamic_programming_over_constant_turns_gains() {
    let bench = Bench::new();
    bench.write("wave.apt", path());
    let errors: Vec<Vec<f64>> = (0..TURNS)
        .map(|turn| {
            let deg = 360.0 / TURNS as f64 * turn as f64;
            bench.write("turned.toml", cell(&format!("spin = \"fixed\"\nspin_deg = {deg}")));
            let ran = bench.run("predict wave.apt --cell turned.toml --report turned.csv");
            if ran.code == Some(0) { column(&bench.read("turned.csv"), "error_mm") } else { vec![f64::INFINITY; 40] }
        })
        .collect();
    bench.write("free.toml", cell("spin = \"stiffest\""));
    let said = bench.run("predict wave.apt --cell free.toml --report free.csv").exits(0);
    assert!(said.stderr.contains("spin.chosen"), "{}", said.stderr);
    let report = bench.read("free.csv");
    let (chosen, written) = (rms(&column(&report, "error_mm")), rms(&errors[0]));
    let best = least(&errors, 6.0);
    assert!(
        best.is_finite() && written - best > 0.05 && written - chosen >= 0.95 * (written - best),
        "{written} {chosen} {best}"
    );
    let turns = column(&report, "spin_deg");
    for (from, to) in turns.iter().zip(&turns[1..]) {
        let apart = (to - from).rem_euclid(360.0);
        assert!(apart.min(360.0 - apart) <= 5.0 * 6.5, "{from} {to}");
    }
    // What is posted is what was chosen, and lands.
    bench.run("compensate wave.apt --cell free.toml -o wave.mod --report after.csv").exits(0);
    let after = bench.read("after.csv");
    assert_eq!(column(&after, "spin_deg"), turns);
    assert!(column(&after, "remaining_mm").iter().all(|left| *left < 0.001));
    bench.run("predict wave.mod --cell free.toml --report posted.csv").exits(0);
    let lands = |(wanted, posted): (f64, f64)| (wanted - posted).abs() < 5.0;
    let position = |report: &str| column(report, "x_mm");
    assert!(position(&after).into_iter().zip(position(&bench.read("posted.csv"))).all(lands));
}

#[test]
fn a_wrist_that_every_turn_makes_singular_is_refused_with_the_place() {
    let bench = Bench::new();
    bench.write("wave.apt", path());
    bench.write("free.toml", cell("spin = \"stiffest\"\nsingular_margin_deg = 89.99"));
    let refused = bench.run("predict wave.apt --cell free.toml").exits(2);
    assert!(refused.stderr.contains("wave.apt:") && refused.stderr.contains("singular wrist"), "{}", refused.stderr);
}

#[test]
fn written_turns_of_rapid_go_only_where_chosen() {
    let bench = Bench::new();
    bench.write("wave.apt", path()).write("cell.toml", cell("spin = \"fixed\""));
    bench.run("compensate wave.apt --cell cell.toml -o wave.mod").exits(0);
    let before = bench.run("predict wave.mod --cell cell.toml --report before.csv").exits(0);
    assert!(!before.stderr.contains("spin.chosen"), "{}", before.stderr);
    bench.run("compensate wave.mod --cell cell.toml --free-spin -o free.mod --report free.csv --again").exits(0);
    let report = bench.read("free.csv");
    assert!(rms(&column(&report, "error_mm")) < 0.95 * rms(&column(&bench.read("before.csv"), "error_mm")));
    assert!(column(&report, "remaining_mm").iter().all(|left| *left < 0.001), "{report}");
    // The turned program, read back: positions are those of the corrected one, and the arm stands as it was chosen to.
    let turned = bench.run("predict free.mod --cell cell.toml --report turned.csv").exits(0);
    assert!(!turned.stderr.contains("error["), "{}", turned.stderr);
}
