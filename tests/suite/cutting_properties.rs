//! The closed arcs and split quadrature against a plain sum over the envelope, and the feed frame.

use deflex::cutting::{Coefficients, Cutter, Engagement, Milling, Mode, feed_frame};
use deflex_oracles::Mill;
use deflex_oracles::cut::{ANGLES, Cut, Side, plain_sum};
use nalgebra::{Rotation3, Unit, Vector3};
use proptest::prelude::*;

const STEEL: Coefficients = Coefficients { ktc: 1900e6, krc: 700e6, kac: 250e6, kte: 35e3, kre: 50e3, kae: 5e3 };

/// The same cutter for a sum that shares no code with deflex.
pub(crate) fn mill(c: &Cutter, k: &Coefficients) -> Mill {
    let (chip, edge) = ([k.ktc, k.krc, k.kac], [k.kte, k.kre, k.kae]);
    Mill { diameter: c.diameter, corner_radius: c.corner_radius, teeth: c.teeth, chip, edge }
}

/// The same cut for the plain sum.
fn plain(c: &Cutter, e: &Engagement) -> Cut {
    let previous_pass = match e.mode {
        Mode::Slot => None,
        Mode::Up => Some(Side::Right),
        Mode::Down => Some(Side::Left),
    };
    let Engagement { depth, width, feed_per_tooth, lead, tilt, .. } = *e;
    Cut { mill: mill(c, &STEEL), previous_pass, depth, width, feed_per_tooth, lead, tilt }
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
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_engagement_equals_the_plain_sum(
        (c, e) in engagements(),
        dz in -0.4..0.4,
        (ax, ay) in (-5e-3..5e-3, -5e-3..5e-3),
    ) {
        let m = Milling::new(c, e, STEEL).expect("a valid cut");
        let shift = Vector3::new(0.3, 0.2, dz * e.depth);
        let turn = Rotation3::from_scaled_axis(Vector3::new(ax, ay, 0.0));
        let axis = Unit::new_normalize(turn * m.axis_in_feed().into_inner());
        let (got, want) = (m.mean_force(&shift, &axis), plain_sum(&plain(&c, &e), &shift, &axis));
        // The scale: the whole engaged edge at the tangential edge force.
        let scale = want.norm() + STEEL.kte * f64::from(c.teeth) * 0.2 * e.depth;
        // Where hardly an edge is engaged, the plain sum's own step counts: half an angle's share of an edge that deep.
        let edge = (STEEL.kte + STEEL.ktc * e.feed_per_tooth) * f64::from(c.teeth) * e.depth;
        let step = 0.5 * edge / ANGLES as f64;
        prop_assert!((got - want).norm() < 3e-3 * scale + step, "{got:?} {want:?}");
    }

    #[test]
    fn a_stepover_as_wide_as_the_cutter_is_a_slot((c, e) in engagements(), dz in -0.4..0.4) {
        let force = |mode, width| {
            let m = Milling::new(c, Engagement { mode, width, tilt: 0.0, ..e }, STEEL).expect("a valid cut");
            m.mean_force(&Vector3::new(0.0, 0.0, dz * e.depth), &m.axis_in_feed())
        };
        let slot = force(Mode::Slot, c.diameter);
        for mode in [Mode::Up, Mode::Down] {
            let wide = force(mode, c.diameter);
            prop_assert!((wide - slot).norm() <= 1e-6 * slot.norm(), "{wide:?} {slot:?}");
        }
    }

    /// An upright flat end mill: what a pass leaves of the slot is what the pass on the other side takes.
    #[test]
    fn up_and_down_share_the_slot_of_an_upright_end_mill((c, e) in engagements(), share in 0.02..0.98) {
        let c = Cutter { corner_radius: 0.0, ..c };
        let force = |mode, width| {
            let m = Milling::new(c, Engagement { mode, width, lead: 0.0, tilt: 0.0, ..e }, STEEL).expect("a valid cut");
            m.mean_force(&Vector3::zeros(), &m.axis_in_feed())
        };
        let parts = force(Mode::Down, share * c.diameter) + force(Mode::Up, (1.0 - share) * c.diameter);
        let whole = force(Mode::Slot, c.diameter);
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

/// Stepovers below the passes' cusps and widths of the corner: a force of zero once stood where a ball or a bull nose cuts
/// next to its own pass.
#[test]
fn every_stepover_meets_material() {
    let cut = |c: Cutter, mode, depth: f64, width: f64| {
        let e = Engagement { mode, depth, width, feed_per_tooth: 7e-5, lead: 0.0, tilt: 0.0 };
        let m = Milling::new(c, e, STEEL).expect("a valid cut");
        (
            m.mean_force(&Vector3::zeros(), &m.axis_in_feed()),
            plain_sum(&plain(&c, &e), &Vector3::zeros(), &Vector3::z()),
        )
    };
    let ball = Cutter { diameter: 10e-3, corner_radius: 5e-3, teeth: 2, helix: 0.5 };
    let bull = Cutter { diameter: 25e-3, corner_radius: 5e-3, teeth: 3, helix: 0.5 };
    for mode in [Mode::Up, Mode::Down] {
        for (c, depth, width) in
            [(ball, 0.5e-3, 0.5e-3), (bull, 0.5e-3, 0.5e-3), (bull, 0.5e-3, 2e-3), (bull, 0.5e-3, 16e-3)]
        {
            let (force, plain) = cut(c, mode, depth, width);
            assert!(force.norm() > 10.0, "{force:?}");
            assert!((force - plain).norm() < 3e-3 * plain.norm(), "{mode:?} {width} {force:?} {plain:?}");
        }
    }
}
