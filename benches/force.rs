//! The mean milling force: the integral, the table, and building the table.

use criterion::{Criterion, criterion_group, criterion_main};
use deflex::cutting::{Cutter, Engagement, ForceTable, Milling, Mode, materials};
use nalgebra::Vector3;
use std::hint::black_box;

fn milling(mode: Mode, lead_deg: f64, tilt_deg: f64) -> Milling {
    let cutter = Cutter { diameter: 25e-3, corner_radius: 5e-3, teeth: 3, helix: 0.5 };
    let engagement = Engagement {
        mode,
        depth: 1.5e-3,
        width: 10e-3,
        feed_per_tooth: 0.07e-3,
        lead: lead_deg.to_radians(),
        tilt: tilt_deg.to_radians(),
    };
    let material = materials::find("steel1045").expect("a preset");
    Milling::new(cutter, engagement, material.coefficients).expect("a valid cut")
}

fn force(c: &mut Criterion) {
    for (name, mode, lead, tilt) in
        [("slot 5/10", Mode::Slot, 5.0, 10.0), ("slot 0/0", Mode::Slot, 0.0, 0.0), ("down 5/10", Mode::Down, 5.0, 10.0)]
    {
        let cut = milling(mode, lead, tilt);
        let (shift, axis) = (Vector3::new(1e-5, 2e-5, 1e-4), cut.axis_in_feed());
        c.bench_function(&format!("force/reference {name}"), |b| {
            b.iter(|| cut.mean_force(black_box(&shift), black_box(&axis)));
        });
        let table = ForceTable::new(cut.clone());
        c.bench_function(&format!("force/table {name}"), |b| {
            b.iter(|| table.mean_force(black_box(&shift), black_box(&axis), black_box(7e-5)));
        });
        c.bench_function(&format!("force/build {name}"), |b| {
            b.iter(|| ForceTable::new(black_box(cut.clone())));
        });
    }
}

criterion_group!(benches, force);
criterion_main!(benches);
