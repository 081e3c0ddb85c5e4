//! The force table against the integral.

use deflex::cutting::{Cutter, Engagement, ForceTable, Milling, Mode, TABLE_BOUND, materials};
use nalgebra::{Unit, Vector3};
use proptest::prelude::*;
use std::sync::LazyLock;

fn table(mode: Mode, corner_mm: f64, depth_mm: f64, lead_deg: f64, tilt_deg: f64) -> ForceTable {
    let cutter = Cutter { diameter: 25e-3, corner_radius: corner_mm * 1e-3, teeth: 3, helix: 0.5 };
    let engagement = Engagement {
        mode,
        depth: depth_mm * 1e-3,
        width: 8e-3,
        feed_per_tooth: 0.07e-3,
        lead: lead_deg.to_radians(),
        tilt: tilt_deg.to_radians(),
    };
    let material = materials::find("steel1045").expect("a preset");
    ForceTable::new(Milling::new(cutter, engagement, material.coefficients).expect("a valid cut"))
}

const CUTS: [(Mode, f64, f64, f64, f64); 9] = [
    (Mode::Slot, 5.0, 1.5, 5.0, 10.0),
    (Mode::Slot, 5.0, 1.5, 0.0, 0.0),
    (Mode::Slot, 5.0, 8.0, 0.0, 0.0),
    (Mode::Slot, 12.5, 0.5, 15.0, -5.0),
    (Mode::Slot, 0.0, 2.0, 0.0, 0.0),
    (Mode::Slot, 5.0, 0.2, 5.0, 0.0),
    (Mode::Down, 5.0, 1.5, 5.0, 10.0),
    (Mode::Up, 5.0, 3.0, 0.0, 0.0),
    (Mode::Down, 0.0, 6.0, 0.0, 0.0),
];

/// Tables of the cuts, in their order.
static TABLES: LazyLock<Vec<ForceTable>> =
    LazyLock::new(|| CUTS.map(|(mode, corner, depth, lead, tilt)| table(mode, corner, depth, lead, tilt)).into());

#[test]
fn every_common_cut_gets_a_table() {
    for ((mode, corner, depth, lead, tilt), table) in CUTS.iter().zip(TABLES.iter()) {
        let error = table.measured_error().expect("a table");
        assert!(error <= 0.5 * TABLE_BOUND, "{mode:?} {corner} {depth} {lead} {tilt}: {error:e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn look_ups_keep_the_bound_and_join_the_integral(
        seeds in prop::collection::vec(prop::array::uniform5(-1.1..1.1f64), 300),
    ) {
        for ((mode, ..), table) in CUTS.iter().zip(TABLES.iter()) {
            let milling = table.milling();
            let [dz, turn] = table.ranges().expect("a table");
            for [a, b, c, d, f] in &seeds {
                let shift = Vector3::new(0.0, c * 1e-3, d * dz);
                let axis = milling.axis_in_feed();
                let axis = Unit::new_normalize(axis.into_inner() + Vector3::new(a * turn, b * turn, 0.0));
                let feed = milling.engagement().feed_per_tooth * 4f64.powf(*f);
                let want = milling.force_parts(&shift, &axis).at(feed);
                let got = table.mean_force(&shift, &axis, feed);
                prop_assert!((got - want).norm() <= TABLE_BOUND * want.norm(), "{mode:?} {got:?} {want:?}");
            }
        }
    }
}

#[test]
fn outside_its_range_the_table_is_the_integral() {
    let table = table(Mode::Slot, 5.0, 1.5, 5.0, 10.0);
    let milling = table.milling();
    let axis = milling.axis_in_feed();
    for shift in [Vector3::new(0.0, 0.0, -5e-3), Vector3::new(0.0, 0.0, 1e-3), Vector3::zeros()] {
        for (axis, feed) in [(axis, 1e-6), (Vector3::z_axis(), 7e-5)] {
            let want = milling.force_parts(&shift, &axis).at(feed);
            assert_eq!(table.mean_force(&shift, &axis, feed), want);
        }
    }
}

#[test]
fn a_step_across_the_range_ends_is_a_step_no_larger() {
    let table = table(Mode::Slot, 5.0, 1.5, 5.0, 10.0);
    let axis = table.milling().axis_in_feed();
    let [range, ..] = table.ranges().expect("a table");
    let at = |z: f64| table.mean_force(&Vector3::new(0.0, 0.0, z), &axis, 7e-5);
    for edge in [-1.0, -0.9, 0.5, 0.9, 1.0, 0.125] {
        let z = edge * range;
        assert!((at(z + 1e-12) - at(z - 1e-12)).norm() < 1e-5, "{edge}");
    }
}
