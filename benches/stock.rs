//! The stock: a step of 2 mm of a 25 mm bull-nose in 600 × 400 mm, lines 0.5 mm apart: asking what is engaged, then removing.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use deflex::cutting::{Cutter, materials};
use deflex::stock::{Blank, Front, Stock, ToolPose};
use nalgebra::{Unit, Vector3};
use std::hint::black_box;

const MM: f64 = 1e-3;
const STEP: f64 = 2.0 * MM;

/// Poses to and fro over the blank.
fn zigzag(stepover: f64, axis: Unit<Vector3<f64>>) -> Vec<ToolPose> {
    let passes = (400.0 * MM / stepover) as usize;
    let pass = |k: usize| {
        let along = (0..=300).map(move |i| if k.is_multiple_of(2) { i } else { 300 - i });
        along.map(move |i| Vector3::new(f64::from(i) * STEP, k as f64 * stepover, -1.5 * MM))
    };
    (0..passes).flat_map(pass).map(|tip| ToolPose { tip, axis }).collect()
}

fn blank() -> Blank {
    Blank::Box([Vector3::new(0.0, 0.0, -40.0) * MM, Vector3::new(600.0, 400.0, 0.0) * MM])
}

fn stock(c: &mut Criterion) {
    let cutter = Cutter { diameter: 25.0 * MM, corner_radius: 5.0 * MM, teeth: 3, helix: 0.5 };
    let material = materials::find("al7075").expect("a preset");
    let front = Front::new(&cutter, &material.coefficients);
    let lean = Unit::new_normalize(Vector3::new(0.08, 0.0, 1.0));
    for (name, stepover, axis) in
        [("slots", 30.0, Vector3::z_axis()), ("facing 10 mm", 10.0, Vector3::z_axis()), ("leaning 10 mm", 10.0, lean)]
    {
        let poses = zigzag(stepover * MM, axis);
        let mut left = Stock::new(blank(), 0.5 * MM);
        let half = poses.len() / 2 + 150;
        for pair in poses[..half].windows(2) {
            left.remove(front.solid(), &pair[0], &pair[1]);
        }
        let way = poses[half].tip - poses[half - 1].tip;
        c.bench_function(&format!("stock/ask {name}"), |b| {
            b.iter(|| front.engaged(black_box(&left), black_box(&poses[half]), &way));
        });
        // Two hundred targets each time, so that the lines' first touch is in it.
        c.bench_function(&format!("stock/200 targets {name}"), |b| {
            let start = || Stock::new(blank(), 0.5 * MM);
            b.iter_batched_ref(
                start,
                |stock| {
                    for pair in poses[..201].windows(2) {
                        black_box(front.engaged(stock, &pair[1], &(pair[1].tip - pair[0].tip)));
                        stock.remove(front.solid(), &pair[0], &pair[1]);
                    }
                },
                BatchSize::LargeInput,
            );
        });
    }
}

criterion_group!(benches, stock);
criterion_main!(benches);
