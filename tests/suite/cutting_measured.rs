//! The mean force against a dynamometer: slots with five feeds.
//!
//! Jianhui Li, `leekunhwee/ForceCalculation` (public repository, 2018), `General/Flat end milling`: two teeth, 6,000/min, 3 mm
//! deep, full width, one second at 10 kHz each. The rows are the means over a hundred revolutions and the standard deviation of
//! those of single ones, worked out from the recordings; signs and axes are the author's: the force on the tool, feed along x.

use deflex::cutting::{Coefficients, Cutter, Engagement, Milling, Mode};
use nalgebra::{SMatrix, SVector, Vector3};

/// Feed per tooth, mm; mean force (feed, normal, axial) and its standard deviation between revolutions, N.
const SLOTS: [(f64, [f64; 3], [f64; 3]); 5] = [
    (0.025, [-39.80, 63.02, -55.72], [0.54, 0.44, 0.91]),
    (0.050, [-60.05, 107.14, -70.91], [0.47, 0.45, 0.86]),
    (0.075, [-71.60, 137.67, -82.57], [0.64, 0.57, 1.24]),
    (0.100, [-76.75, 171.27, -85.23], [1.81, 2.11, 1.56]),
    (0.125, [-78.49, 210.74, -83.50], [2.98, 3.07, 1.83]),
];

/// Of the resultant: what a force that is linear in the feed leaves of forces whose feed and axial parts level off with it.
const LINEAR: f64 = 0.075;

fn force(feed_mm: f64, [ktc, krc, kac, kte, kre, kae]: [f64; 6]) -> Vector3<f64> {
    // The diameter drops out of the mean force of a slot.
    let cutter = Cutter { diameter: 25e-3, corner_radius: 0.0, teeth: 2, helix: 45f64.to_radians() };
    let feed_per_tooth = 1e-3 * feed_mm;
    let engagement = Engagement { mode: Mode::Slot, depth: 3e-3, width: 0.0, feed_per_tooth, lead: 0.0, tilt: 0.0 };
    let coefficients = Coefficients { ktc, krc, kac, kte, kre, kae };
    let milling = Milling::new(cutter, engagement, coefficients).expect("a cut");
    milling.mean_force(&Vector3::zeros(), &milling.axis_in_feed())
}

/// Coefficients (N/m², N/m) by least squares from all slots but one.
fn fitted_without(left_out: usize) -> [f64; 6] {
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    let mut right = SVector::<f64, 6>::zeros();
    for (_, (feed, mean, _)) in SLOTS.iter().enumerate().filter(|(i, _)| *i != left_out) {
        let columns: [Vector3<f64>; 6] = std::array::from_fn(|k| {
            let unit = if k < 3 { 1e8 } else { 1e4 };
            force(*feed, std::array::from_fn(|j| if j == k { unit } else { 0.0 }))
        });
        let design = SMatrix::<f64, 3, 6>::from_columns(&columns);
        normal += design.transpose() * design;
        right += design.transpose() * Vector3::from(*mean);
    }
    let scaled = normal.cholesky().expect("four feeds tell six coefficients").solve(&right);
    std::array::from_fn(|k| scaled[k] * if k < 3 { 1e8 } else { 1e4 })
}

#[test]
fn a_slot_between_measured_ones_has_their_force() {
    for i in 1..4 {
        let (feed, mean, _) = SLOTS[i];
        let fitted = fitted_without(i);
        assert!(fitted.iter().all(|k| *k > 0.0), "{fitted:?}");
        let off = force(feed, fitted) - Vector3::from(mean);
        let resultant = Vector3::from(mean).norm();
        assert!(off.norm() < LINEAR * resultant, "{feed} mm: off by {off:?} N of {resultant} N");
    }
}

#[test]
fn measured_forces_lie_on_the_side_that_the_model_says() {
    // A force of tangential coefficients alone pushes the tool to the left of the feed, of radial ones alone against it.
    for (feed, mean, scatter) in SLOTS {
        let tangential = force(feed, [1e9, 0.0, 0.0, 1e4, 0.0, 0.0]);
        let radial = force(feed, [0.0, 1e9, 0.0, 0.0, 1e4, 0.0]);
        assert!(tangential.y > 0.0 && tangential.x.abs() < 1e-9 && mean[1] > 10.0 * scatter[1]);
        assert!(radial.x < 0.0 && radial.y.abs() < 1e-9 && mean[0] < -10.0 * scatter[0]);
    }
}
