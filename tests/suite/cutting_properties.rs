//! The closed arcs and split quadrature against a plain sum over the envelope, and the feed frame.

use deflex::cutting::{Coefficients, Cutter, Engagement, Milling, Mode, feed_frame};
use nalgebra::{Rotation3, Unit, Vector3};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, TAU};

const STEEL: Coefficients = Coefficients { ktc: 1900e6, krc: 700e6, kac: 250e6, kte: 35e3, kre: 50e3, kae: 5e3 };

/// Angles of the plain sum.
const ANGLES: usize = 1400;

/// Midpoint sum over profile and angle, every element judged on its own in the feed frame.
fn brute(c: &Cutter, e: &Engagement, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
    let (radius, r) = (0.5 * c.diameter, c.corner_radius);
    let nominal = Rotation3::from_axis_angle(&Vector3::x_axis(), e.tilt)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), e.lead)
        * Vector3::z();
    let tip_height = (radius - r) * nominal.x.hypot(nominal.y) + r * (1.0 - nominal.z);
    let tip = Vector3::new(0.0, shift.y, tip_height - e.depth + shift.z);
    let y = axis.cross(&Vector3::x()).normalize();
    let x = y.cross(axis);
    // Above this height along the axis nothing is below the stock's top.
    let top = (-tip.z + radius * axis.x.hypot(axis.y)) / axis.z;
    const STEPS: usize = 700;
    let corner_end = if top < r { (1.0 - top / r).acos() } else { FRAC_PI_2 };
    let angles: Vec<(f64, f64)> = (0..ANGLES).map(|i| ((i as f64 + 0.5) * TAU / ANGLES as f64).sin_cos()).collect();
    let mut sum = Vector3::zeros();
    let mut ring = |kappa: f64, height: f64, width: f64| {
        let (sk, ck) = kappa.sin_cos();
        let rho = radius - r + r * sk;
        for &(sp, cp) in &angles {
            // φ from +y, clockwise seen from above.
            let out = x * sp + y * cp;
            let normal = out * sk - axis * ck;
            let p = tip + out * rho + axis * height;
            let beside = match e.mode {
                Mode::Slot => true,
                Mode::Down => p.y < e.width - radius,
                Mode::Up => p.y > radius - e.width,
            };
            if normal.x <= 0.0 || p.z >= 0.0 || !beside {
                continue;
            }
            let h = e.feed_per_tooth * normal.x;
            let (ft, fr, fa) = (STEEL.ktc * h + STEEL.kte, STEEL.krc * h + STEEL.kre, STEEL.kac * h + STEEL.kae);
            sum += (x * -cp + y * sp) * (ft * width) - normal * (fr * width) - (out * ck + axis * sk) * (fa * width);
        }
    };
    for i in 0..STEPS {
        let kappa = (i as f64 + 0.5) * corner_end / STEPS as f64;
        ring(kappa, r * (1.0 - kappa.cos()), r * corner_end / STEPS as f64);
        if top > r {
            ring(FRAC_PI_2, r + (i as f64 + 0.5) * (top - r) / STEPS as f64, (top - r) / STEPS as f64);
        }
    }
    sum * f64::from(c.teeth) / ANGLES as f64
}

fn cutters() -> impl Strategy<Value = Cutter> {
    (6.0..40.0, prop_oneof![Just(0.0), Just(1.0), 0.02..0.98], 1u32..6).prop_map(
        |(d, share, teeth): (f64, f64, u32)| Cutter {
            diameter: d * 1e-3,
            corner_radius: 0.5e-3 * d * share,
            teeth,
            helix: 0.5,
        },
    )
}

fn engagements() -> impl Strategy<Value = (Cutter, Engagement)> {
    let angle = || prop_oneof![Just(0.0), -25.0..25.0f64];
    let mode = prop_oneof![Just(Mode::Slot), Just(Mode::Up), Just(Mode::Down)];
    (cutters(), mode, 0.01..0.4, 0.05..1.0, angle(), angle()).prop_map(|(c, mode, depth, width, lead, tilt)| {
        let e = Engagement {
            mode,
            depth: depth * c.diameter,
            width: width * c.diameter,
            feed_per_tooth: 0.08e-3,
            lead: if c.corner_radius < 0.5 * c.diameter { lead.abs() } else { lead }.to_radians(),
            tilt: tilt.to_radians(),
        };
        (c, e)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_engagement_equals_the_plain_sum(
        (c, e) in engagements(),
        (dy, dz) in (-0.2..0.2, -0.4..0.4),
        (ax, ay) in (-5e-3..5e-3, -5e-3..5e-3),
    ) {
        let m = Milling::new(c, e, STEEL).expect("a valid cut");
        let shift = Vector3::new(0.3, dy * e.width, dz * e.depth);
        let turn = Rotation3::from_scaled_axis(Vector3::new(ax, ay, 0.0));
        let axis = Unit::new_normalize(turn * m.axis_in_feed().into_inner());
        let (got, want) = (m.mean_force(&shift, &axis), brute(&c, &e, &shift, &axis));
        // The scale: the whole engaged edge at the tangential edge force.
        let scale = want.norm() + STEEL.kte * f64::from(c.teeth) * 0.2 * e.depth;
        // Where hardly an edge is engaged, the plain sum's own step counts: half an angle's share of an edge that deep.
        let edge = (STEEL.kte + STEEL.ktc * e.feed_per_tooth) * f64::from(c.teeth) * e.depth;
        let step = 0.5 * edge / ANGLES as f64;
        prop_assert!((got - want).norm() < 3e-3 * scale + step, "{got:?} {want:?}");
    }

    #[test]
    fn up_and_down_share_the_slot(
        (c, e) in engagements(),
        dz in -0.4..0.4,
    ) {
        // The quadrature's own accuracy over 20 000 random cuts: worst 4e-7, one in a hundred
        // above 1e-8. Stock left of a line plus stock right of it is the whole slot.
        let force = |mode, width| {
            let m = Milling::new(c, Engagement { mode, width, ..e }, STEEL).expect("a valid cut");
            m.mean_force(&Vector3::new(0.0, 0.0, dz * e.depth), &m.axis_in_feed())
        };
        let width = e.width.min(0.99 * c.diameter);
        let parts = force(Mode::Down, width) + force(Mode::Up, c.diameter - width);
        let whole = force(Mode::Slot, width);
        prop_assert!((parts - whole).norm() <= 1e-6 * whole.norm(), "{parts:?} {whole:?}");
    }

    #[test]
    fn the_force_stops_at_the_surface_without_a_step((c, e) in engagements()) {
        let m = Milling::new(c, e, STEEL).expect("a valid cut");
        let at = |depth: f64| {
            m.mean_force(&Vector3::new(0.0, 0.0, e.depth - depth), &m.axis_in_feed()).norm()
        };
        prop_assert!(at(-1e-9) <= 0.0);
        prop_assert!(at(-1.0) <= 0.0);
        // An upright flat corner enters all at once along its edge; elsewhere depth to the half.
        prop_assert!(at(1e-10) <= 0.01 * at(e.depth).max(1.0));
    }

    #[test]
    fn the_feed_frame_is_found_again(
        turn in prop::array::uniform3(-3.0..3.0f64),
        lead in -1.0..1.0f64,
        tilt in -1.0..1.0f64,
        climb in -0.3..0.3f64,
        length in 1e-4..1.0f64,
    ) {
        let frame = Rotation3::from_scaled_axis(Vector3::from(turn));
        let axis_in_feed = Rotation3::from_axis_angle(&Vector3::x_axis(), tilt)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), lead)
            * Vector3::z();
        let axis = Unit::new_normalize(frame * axis_in_feed);
        let chord = frame * Vector3::new(climb.cos(), 0.0, climb.sin()) * length;
        let found = feed_frame(&axis, &chord, lead, tilt).expect("no plunge");
        prop_assert!((found.matrix() - frame.matrix()).norm() < 1e-9);
    }
}

#[test]
fn a_plunge_has_no_feed_frame() {
    let axis = Vector3::z_axis();
    assert!(feed_frame(&axis, &Vector3::new(0.0, 0.0, -1.0), 0.0, 0.0).is_none());
    assert!(feed_frame(&axis, &Vector3::new(1e-3, 0.0, 1.0), 0.1, 0.2).is_none());
    assert!(feed_frame(&axis, &Vector3::zeros(), 0.0, 0.0).is_none());
    assert!(feed_frame(&axis, &Vector3::new(f64::NAN, 0.0, 0.0), 0.0, 0.0).is_none());
}

#[test]
fn impossible_cuts_are_named() {
    let c = Cutter { diameter: 25e-3, corner_radius: 5e-3, teeth: 2, helix: 0.5 };
    let e = Engagement { mode: Mode::Down, depth: 1.5e-3, width: 10e-3, feed_per_tooth: 7e-5, lead: 0.1, tilt: 0.2 };
    let field = |c: Cutter, e: Engagement, k: Coefficients| Milling::new(c, e, k).err().map(|error| error.field);
    assert_eq!(field(c, e, STEEL), None);
    assert_eq!(field(Cutter { diameter: f64::NAN, ..c }, e, STEEL), Some("diameter"));
    assert_eq!(field(Cutter { corner_radius: 13e-3, ..c }, e, STEEL), Some("corner_radius"));
    assert_eq!(field(Cutter { teeth: 0, ..c }, e, STEEL), Some("teeth"));
    assert_eq!(field(c, Engagement { depth: 0.0, ..e }, STEEL), Some("depth"));
    assert_eq!(field(c, Engagement { width: 26e-3, ..e }, STEEL), Some("width"));
    assert_eq!(field(c, Engagement { tilt: 1.5, ..e }, STEEL), Some("tilt"));
    assert_eq!(field(c, Engagement { lead: -0.1, ..e }, STEEL), Some("lead"));
    assert_eq!(field(c, e, Coefficients { ktc: -1.0, ..STEEL }), Some("ktc"));
}

/// The stock's edge grazes the silhouette, or a ball faces straight down: both parts must still
/// make up the whole.
#[test]
fn grazing_edges_lose_no_force() {
    for (mm, r_mm, teeth, depth, width, lead, tilt) in [
        (8.924609399313384, 4.462304699656692, 1, 0.665145696, 8.312772359, 0.100280179, -0.384194334),
        (19.09045862524169, 8.678314658332268, 5, 0.689190130, 12.918951768, 0.376280536, 0.009068116),
        (39.80488941827064, 19.90244470913532, 5, 0.635429135, 20.456945684, -0.290303326, 0.160352164),
        (23.391584628080837, 11.695_792_314_040_42, 3, 1.697661649, 7.852044388, 0.170494728, -0.188817373),
        (24.0, 12.0, 2, 2.9, 20.0, 0.0, 0.0),
    ] {
        let c = Cutter { diameter: mm * 1e-3, corner_radius: r_mm * 1e-3, teeth, helix: 0.5 };
        let force = |mode, width_mm: f64| {
            let e = Engagement { mode, depth: depth * 1e-3, width: width_mm * 1e-3, feed_per_tooth: 8e-5, lead, tilt };
            let m = Milling::new(c, e, STEEL).expect("a valid cut");
            m.mean_force(&Vector3::zeros(), &m.axis_in_feed())
        };
        let whole = force(Mode::Slot, width);
        let parts = force(Mode::Down, width) + force(Mode::Up, mm - width);
        assert!((parts - whole).norm() <= 1e-8 * whole.norm(), "{mm}: {parts:?} {whole:?}");
    }
}
