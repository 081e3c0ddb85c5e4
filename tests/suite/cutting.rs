//! The milling force against independent vectors, hand integration and a brute-force sum.

use deflex::cutting::{Coefficients, ContactPoint, Cutter, Engagement, Milling, Mode};
use nalgebra::{Rotation3, Unit, Vector3};
use serde_json::Value;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

fn rx(a: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::x_axis(), a)
}
fn ry(a: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::y_axis(), a)
}

fn cutter(diameter_mm: f64, corner_mm: f64, teeth: u32) -> Cutter {
    Cutter { diameter: diameter_mm * 1e-3, corner_radius: corner_mm * 1e-3, teeth, helix: 0.5 }
}

fn slot(depth_mm: f64, lead_deg: f64, tilt_deg: f64) -> Engagement {
    Engagement {
        mode: Mode::Slot,
        depth: depth_mm * 1e-3,
        width: 0.0,
        feed_per_tooth: 0.07e-3,
        lead: lead_deg.to_radians(),
        tilt: tilt_deg.to_radians(),
    }
}

fn coefficients(c: [f64; 3], e: [f64; 3]) -> Coefficients {
    Coefficients {
        ktc: c[0] * 1e6,
        krc: c[1] * 1e6,
        kac: c[2] * 1e6,
        kte: e[0] * 1e3,
        kre: e[1] * 1e3,
        kae: e[2] * 1e3,
    }
}

fn nominal(m: &Milling) -> Vector3<f64> {
    m.mean_force(&Vector3::zeros(), &m.axis_in_feed())
}

fn vectors() -> Value {
    serde_json::from_str(include_str!("../vectors/vectors.json")).expect("vectors are JSON")
}

fn three(v: &Value) -> [f64; 3] {
    std::array::from_fn(|i| v[i].as_f64().expect("number"))
}

#[track_caller]
fn assert_near(got: &Vector3<f64>, want: &Vector3<f64>, relative: f64) {
    let off = (got - want).norm();
    assert!(off <= relative * want.norm(), "{got:?} is not {want:?}: off by {off:e}");
}

#[test]
fn forces_equal_the_independent_vectors() {
    let v = vectors();
    for i in 1..=8 {
        let c = &v[format!("force_V{i}")];
        let n = |k: &str| c[k].as_f64().expect("number");
        let m = Milling::new(
            cutter(n("D"), n("r"), n("N") as u32),
            Engagement { feed_per_tooth: n("ft") * 1e-3, ..slot(n("depth"), n("lead"), n("tilt")) },
            coefficients(three(&c["Kc"]), three(&c["Ke"])),
        )
        .expect("valid");
        let (got, want) = (nominal(&m), Vector3::from(three(&c["F_W"])));
        assert_near(&got, &want, 1e-10);
    }
}

#[test]
fn each_coefficient_alone_gives_its_column() {
    let v = vectors();
    let want = &v["unit_force_matrix_depth1.5_N1"];
    let frame = rx(10f64.to_radians()) * ry(5f64.to_radians());
    for column in 0..6 {
        let mut k = [0.0; 6];
        k[column] = 1.0;
        let m = Milling::new(
            cutter(25.0, 5.0, 1),
            slot(1.5, 5.0, 10.0),
            coefficients([k[0], k[1], k[2]], [k[3], k[4], k[5]]),
        )
        .expect("valid");
        let want = Vector3::from_fn(|row, _| want[row][column].as_f64().expect("number"));
        let feed = nominal(&m);
        let in_cutter = frame.inverse() * feed;
        let off = (feed - want).norm().min((in_cutter - want).norm());
        assert!(off < 1e-10 * want.norm(), "column {column} is off by {off:e}");
    }
}

#[test]
fn contact_points_equal_the_vectors() {
    let v = vectors();
    let k = coefficients([1.0; 3], [0.0; 3]);
    let m = Milling::new(cutter(25.0, 5.0, 2), slot(1.5, 5.0, 10.0), k).expect("valid");
    for (lead, tilt) in [(5, 10), (5, -10), (-5, 10), (-5, -10), (0, 10), (0, -10), (10, 0), (-10, 0), (20, 20)] {
        let frame = rx(f64::from(tilt).to_radians()) * ry(f64::from(lead).to_radians());
        let axis = Unit::new_normalize(frame * Vector3::z());
        let point = match m.contact_point(&axis) {
            ContactPoint::Point(p) if lead >= 0 => p,
            ContactPoint::Heel(p) if lead < 0 => p,
            other => panic!("{lead} {tilt}: {other:?}"),
        };
        let want = Vector3::from(three(&v[format!("ccp_{lead}_{tilt}")])) * 1e-3;
        assert!((frame.inverse() * point - want).norm() < 1e-15, "{lead} {tilt}");
    }
    assert_eq!(m.contact_point(&Vector3::z_axis()), ContactPoint::FlatDisk);
}

#[test]
fn the_worked_case_gives_its_forces_at_the_deflected_pose() {
    let v = vectors();
    let case = &v["caseR"];
    let kt = 2250.0;
    let k = coefficients([kt, 0.3992 * kt, 0.35 * kt], [4.634, 64.235, 6.031]);
    let m = Milling::new(cutter(25.0, 5.0, 3), slot(1.5, 5.0, 10.0), k).expect("valid");
    let d: Vec<f64> = (0..6).map(|i| case["forward"]["D"][i].as_f64().expect("number")).collect();
    let turn = Rotation3::from_scaled_axis(Vector3::new(d[3], d[4], d[5]));
    let axis = Unit::new_normalize(turn * m.axis_in_feed().into_inner());
    let force = m.mean_force(&(Vector3::new(d[0], d[1], d[2]) * 1e-3), &axis);
    assert_near(&force, &Vector3::from(three(&case["forward"]["F"])), 1e-9);
    assert_near(&nominal(&m), &Vector3::from(three(&case["inverse"]["F"])), 1e-9);
}

/// Lead and tilt zero, depth a ≤ r: h = f·sin κ·sin φ over φ = 0..π, κ = 0..k, cos k = 1 − a/r.
#[test]
fn an_upright_slot_equals_the_integral_done_by_hand() {
    let (kt, kr, ka) = (1500e6, 600e6, 200e6);
    let (te, re, ae) = (20e3, 30e3, 5e3);
    let (r, a, f, teeth): (f64, f64, f64, f64) = (5e-3, 1.5e-3, 0.07e-3, 2.0);
    let m = Milling::new(
        cutter(25.0, 5.0, 2),
        slot(1.5, 0.0, 0.0),
        coefficients([1500.0, 600.0, 200.0], [20.0, 30.0, 5.0]),
    )
    .expect("valid");
    let k = (1.0 - a / r).acos();
    let (s, c) = k.sin_cos();
    let i_s = 1.0 - c; // ∫ sin
    let i_ss = 0.5 * (k - s * c); // ∫ sin²
    let i_sc = 0.5 * s * s; // ∫ sin cos
    let want = Vector3::new(
        -f * FRAC_PI_2 * (kr * i_ss + ka * i_sc) - 2.0 * (re * i_s + ae * s),
        f * FRAC_PI_2 * kt * i_s + 2.0 * te * k,
        f * 2.0 * (kr * i_sc - ka * i_ss) + PI * (re * s - ae * i_s),
    ) * (r * teeth / TAU);
    assert_near(&nominal(&m), &want, 1e-12);
}
