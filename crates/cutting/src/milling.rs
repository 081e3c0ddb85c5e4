//! The mean milling force (Tang et al. Eq. 6, integral inside, along the profile angle).

use super::adjacent::AdjacentPass;
use super::patch::Patch;
use super::ring::{HalfSpace, Ring};
use super::{
    Coefficients, ContactPoint, Cutter, CuttingError, Engagement, Mode, contact, frame, quadrature::integrate,
};
use nalgebra::{Unit, Vector3};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Lead and tilt must be smaller than this: beyond, the shank would be in the surface.
const STEEPEST: f64 = 80.0 * std::f64::consts::PI / 180.0;

/// The cutter is a ball if its corner radius differs by less than this share from half the diameter: converted units
/// are rounded.
const BALL: f64 = 1e-9;

/// A valid cut condition: a cutter, an engagement and coefficients that fit together.
///
/// # Examples
/// ```
/// use deflex_cutting::{Cutter, Engagement, Milling, Mode, materials};
/// use nalgebra::Vector3;
///
/// let cutter = Cutter { diameter: 0.025, corner_radius: 5e-3, teeth: 3, helix: 0.5 };
/// let slot = Engagement { mode: Mode::Slot, depth: 1e-3, width: 0.025, feed_per_tooth: 7e-5, lead: 0.1, tilt: 0.0 };
/// let material = materials::find("ni-al-bronze").expect("a material");
/// let milling = Milling::new(cutter, slot, material.coefficients).expect("a possible cut");
/// assert_eq!((milling.cutter().teeth, milling.engagement().depth), (3, 1e-3)); // m
/// let axis = milling.axis_in_feed();
/// assert!(axis.x > 0.0); // the tool leans forward by 0.1 rad
/// let programmed = milling.mean_force(&Vector3::zeros(), &axis);
/// let shallower = milling.mean_force(&Vector3::new(0.0, 0.0, 1e-4), &axis); // lifted by 0.1 mm
/// assert!(shallower.norm() < programmed.norm()); // N
/// let parts = milling.force_parts(&Vector3::zeros(), &axis);
/// assert!((parts.at(slot.feed_per_tooth) - programmed).norm() < 1e-9);
/// println!("{:?}", milling.contact_point(&axis));
/// ```
#[derive(Clone, Debug)]
pub struct Milling {
    cutter: Cutter,
    engagement: Engagement,
    coefficients: Coefficients,
    axis: Unit<Vector3<f64>>,
    /// Height of the tip over the stock's top at the programmed pose, m.
    tip_z: f64,
    /// The neighbouring pass in up and down milling.
    neighbouring_pass: Option<AdjacentPass>,
}

/// Mean forces on the tool over a revolution for many engagements, N, each in its own feed frame. The cutter is at its
/// programmed pose. Uses all threads.
///
/// # Errors
/// The first engagement, by its index, that [`Milling::new`] refuses.
///
/// # Examples
/// ```
/// use deflex_cutting::{Cutter, Engagement, Mode, materials, mean_forces};
///
/// let cutter = Cutter { diameter: 0.025, corner_radius: 5e-3, teeth: 3, helix: 0.5 };
/// let deep = |depth: f64| {
///     Engagement { mode: Mode::Slot, depth, width: 0.025, feed_per_tooth: 7e-5, lead: 0.1, tilt: 0.0 }
/// };
/// let coefficients = materials::find("ni-al-bronze").expect("a material").coefficients;
/// let forces = mean_forces(cutter, &[deep(1e-3), deep(2e-3)], coefficients).expect("possible cuts");
/// assert!(forces[1].norm() > forces[0].norm());
/// ```
pub fn mean_forces(
    cutter: Cutter,
    engagements: &[Engagement],
    coefficients: Coefficients,
) -> Result<Vec<Vector3<f64>>, (usize, CuttingError)> {
    let force = |(i, engagement): (usize, &Engagement)| {
        let milling = Milling::new(cutter, *engagement, coefficients).map_err(|error| (i, error))?;
        Ok(milling.mean_force(&Vector3::zeros(), &milling.axis_in_feed()))
    };
    let found: Vec<Result<_, _>> = engagements.par_iter().enumerate().map(force).collect();
    found.into_iter().collect()
}

/// A mean force that is linear in the feed per tooth, in the feed frame.
///
/// # Examples
/// ```
/// use deflex_cutting::ForceParts;
/// use nalgebra::Vector3;
///
/// let parts = ForceParts { edge: Vector3::new(10.0, 0.0, 0.0), cutting: Vector3::new(1e6, 0.0, 0.0) };
/// assert_eq!(parts.at(5e-5).x, 60.0); // N at 0.05 mm per tooth
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceParts {
    /// Edge force, N.
    pub edge: Vector3<f64>,
    /// Cutting force over feed per tooth, N/m.
    pub cutting: Vector3<f64>,
}

impl ForceParts {
    /// The force at a feed per tooth (m), N.
    pub fn at(&self, feed_per_tooth: f64) -> Vector3<f64> {
        self.edge + self.cutting * feed_per_tooth
    }
}

impl Milling {
    /// Checks that cutter, engagement and coefficients make a cut that the model covers.
    ///
    /// # Errors
    /// The first field that is not finite, out of range or at odds with the others; a tool that
    /// leans back so far that its flat bottom would cut (heel cutting).
    pub fn new(mut cutter: Cutter, engagement: Engagement, coefficients: Coefficients) -> Result<Self, CuttingError> {
        if (cutter.corner_radius - cutter.radius()).abs() <= BALL * cutter.radius() {
            cutter.corner_radius = cutter.radius();
        }
        check_cutter(&cutter)?;
        check_coefficients(&coefficients)?;
        check_engagement(&cutter, &engagement)?;
        let axis = frame::axis(engagement.lead, engagement.tilt);
        let tip_z = contact::tip_height(&cutter, &axis) - engagement.depth;
        let flat = cutter.radius() - cutter.corner_radius;
        // Height of the lowest point of the flat's rim above the cutter's lowest point.
        let rim = cutter.corner_radius * (1.0 - axis.z);
        if axis.x < 0.0 && flat > 0.0 && engagement.depth > rim {
            return Err(error(
                "lead",
                "the tool leans back and would cut with its flat bottom, which the force model \
                 does not cover: expected a lead of zero or more, or a ball end",
            ));
        }
        let neighbouring_pass = neighbouring_pass(&cutter, &engagement, &axis, tip_z);
        let milling = Milling { cutter, engagement, coefficients, axis, tip_z, neighbouring_pass };
        if milling.mean_force(&Vector3::zeros(), &axis) == Vector3::zeros() {
            return Err(error(
                "coefficients",
                "the cutting force is zero everywhere: expected a coefficient other than zero",
            ));
        }
        Ok(milling)
    }

    /// The cutter.
    pub fn cutter(&self) -> &Cutter {
        &self.cutter
    }

    /// The programmed engagement.
    pub fn engagement(&self) -> &Engagement {
        &self.engagement
    }

    /// Tool axis, tip to spindle, in the feed frame for the programmed lead and tilt.
    pub fn axis_in_feed(&self) -> Unit<Vector3<f64>> {
        self.axis
    }

    /// Mean force on the tool over a revolution, N, in the feed frame.
    ///
    /// `shift` is the tip's displacement from the programmed one (m, feed frame; only that along z
    /// counts), `axis` the actual direction of the tool axis, tip to spindle. In up and down milling the
    /// neighbouring pass is assumed to have the same displacement. Zero out of the material.
    pub fn mean_force(&self, shift: &Vector3<f64>, axis: &Unit<Vector3<f64>>) -> Vector3<f64> {
        self.force_parts(shift, axis).at(self.engagement.feed_per_tooth)
    }

    /// [`Milling::mean_force`] split for use at any feed per tooth.
    pub fn force_parts(&self, shift: &Vector3<f64>, axis: &Unit<Vector3<f64>>) -> ForceParts {
        let feed_across = axis.y.hypot(axis.z);
        if axis.z <= 0.0 || feed_across <= 0.0 {
            return ForceParts::default();
        }
        let feed_from_cutter = frame::cutter(axis, feed_across);
        let to_cutter = |v: Vector3<f64>| feed_from_cutter.tr_mul(&v);

        let patch = Patch {
            radius: self.cutter.radius(),
            corner: self.cutter.corner_radius,
            feed_across,
            feed_along: axis.x,
            top: HalfSpace::new(to_cutter(Vector3::z()), self.tip_z + shift.z),
            neighbouring_pass: self.neighbouring_pass.as_ref(),
        };
        let parts = self.integrate(&patch);
        ForceParts { edge: feed_from_cutter * parts.edge, cutting: feed_from_cutter * parts.cutting }
    }

    /// The cutter's lowest point with its axis turned to `axis`.
    pub fn contact_point(&self, axis: &Unit<Vector3<f64>>) -> ContactPoint {
        ContactPoint::of(&self.cutter, axis)
    }

    /// Height of the [contact point](Self::contact_point) above the tip, m, not positive; `None` if the contact is not
    /// a single point.
    #[doc(hidden)]
    pub fn contact_height(&self, axis: &Unit<Vector3<f64>>) -> Option<f64> {
        contact::height(&self.cutter, axis)
    }

    /// Sums over corner and cylinder, in the cutter frame.
    fn integrate(&self, patch: &Patch) -> ForceParts {
        let mut sum = ForceParts::default();
        if patch.corner > 0.0 {
            let cuts = |kappa| patch.moments(&patch.corner_ring(kappa)).is_some();
            for interval in patch.corner_breaks().intervals_where(cuts) {
                integrate(interval, |kappa, weight| {
                    self.add(&mut sum, patch, &patch.corner_ring(kappa), weight * patch.corner);
                });
            }
        }
        if let Some(breaks) = patch.cylinder_breaks() {
            let cuts = |height| patch.moments(&patch.cylinder_ring(height)).is_some();
            for interval in breaks.intervals_where(cuts) {
                integrate(interval, |height, weight| {
                    self.add(&mut sum, patch, &patch.cylinder_ring(height), weight);
                });
            }
        }
        let teeth_per_angle = f64::from(self.cutter.teeth) / TAU;
        sum.edge *= teeth_per_angle;
        sum.cutting *= teeth_per_angle;
        sum
    }

    /// Adds one ring of the given width (m).
    #[inline]
    fn add(&self, sum: &mut ForceParts, patch: &Patch, ring: &Ring, width: f64) {
        let Some(m) = patch.moments(ring) else { return };
        let k = &self.coefficients;
        // Chip thickness over feed per tooth is a·cos − b around the ring.
        let (a, b) = (patch.feed_across * ring.sin, patch.feed_along * ring.cos);
        let chip = (a * m.cos - b * m.one, a * m.cos_cos - b * m.cos, a * m.sin_cos - b * m.sin);
        sum.edge += ring_force([k.kte, k.kre, k.kae], ring, (m.one, m.cos, m.sin)) * width;
        sum.cutting += ring_force([k.ktc, k.krc, k.kac], ring, chip) * width;
    }
}

/// Force of a ring from its load integrals (1, cos, sin): tangential against the clockwise motion,
/// radial against the outward normal, axial down the meridian.
#[inline]
fn ring_force(k: [f64; 3], ring: &Ring, (one, cos, sin): (f64, f64, f64)) -> Vector3<f64> {
    let [kt, kr, ka] = k;
    let inward = kr * ring.sin + ka * ring.cos;
    Vector3::new(-kt * sin - inward * cos, kt * cos - inward * sin, (kr * ring.cos - ka * ring.sin) * one)
}

/// The neighbouring pass at the programmed pose; `None` if it has removed nothing of this cut.
fn neighbouring_pass(
    cutter: &Cutter,
    engagement: &Engagement,
    axis: &Unit<Vector3<f64>>,
    tip_z: f64,
) -> Option<AdjacentPass> {
    let to_pass = match engagement.mode {
        Mode::Slot => return None,
        Mode::Down => Vector3::y(),
        Mode::Up => -Vector3::y(),
    };
    let feed_across = axis.y.hypot(axis.z);
    let feed_from_cutter = frame::cutter(axis, feed_across);
    let top = HalfSpace::new(feed_from_cutter.tr_mul(&Vector3::z()), tip_z);
    let to_pass = feed_from_cutter.tr_mul(&to_pass);
    AdjacentPass::new(cutter, (feed_across, axis.x), &top, (&to_pass, engagement.width))
}

fn error(field: &'static str, message: impl Into<String>) -> CuttingError {
    CuttingError { field, message: message.into() }
}

/// Checks a cutter for every mode of engagement.
///
/// # Errors
/// The first field that is not finite or out of range.
#[doc(hidden)]
pub fn check_cutter(c: &Cutter) -> Result<(), CuttingError> {
    positive("diameter", c.diameter)?;
    if !(0.0..=c.radius() * (1.0 + BALL)).contains(&c.corner_radius) {
        return Err(error("corner_radius", "expected 0 (flat) to half the diameter (ball)"));
    }
    if c.teeth == 0 {
        return Err(error("teeth", "expected at least one tooth"));
    }
    if c.helix.is_nan() || c.helix.abs() >= FRAC_PI_2 {
        return Err(error("helix", "expected an angle within ±90°"));
    }
    Ok(())
}

/// Checks a feed per tooth, m.
///
/// # Errors
/// It is not a number above zero.
#[doc(hidden)]
pub fn check_feed(feed_per_tooth: f64) -> Result<(), CuttingError> {
    positive("feed_per_tooth", feed_per_tooth)
}

/// Checks coefficients for every mode of engagement.
///
/// # Errors
/// The first field that is not finite or out of range.
#[doc(hidden)]
pub fn check_coefficients(k: &Coefficients) -> Result<(), CuttingError> {
    let coefficients = [("ktc", k.ktc), ("krc", k.krc), ("kac", k.kac), ("kte", k.kte), ("kre", k.kre), ("kae", k.kae)];
    for (field, value) in coefficients {
        if !value.is_finite() {
            return Err(error(field, format!("expected a finite number, found {value}")));
        }
    }
    for (field, value) in [("ktc", k.ktc), ("kte", k.kte)] {
        if value < 0.0 {
            return Err(error(field, "expected zero or more: a tooth does not pull itself along"));
        }
    }
    if coefficients.iter().all(|(_, value)| *value == 0.0) {
        return Err(error(
            "coefficients",
            "the cutting force is zero everywhere: expected a coefficient other than zero",
        ));
    }
    Ok(())
}

fn check_engagement(c: &Cutter, e: &Engagement) -> Result<(), CuttingError> {
    positive("depth", e.depth)?;
    check_feed(e.feed_per_tooth)?;
    if e.mode != Mode::Slot && !(e.width > 0.0 && e.width <= c.diameter) {
        return Err(error("width", "expected a stepover above zero, at most the diameter"));
    }
    for (field, angle) in [("lead", e.lead), ("tilt", e.tilt)] {
        if angle.is_nan() || angle.abs() > STEEPEST {
            return Err(error(field, "expected an angle within ±80°"));
        }
    }
    Ok(())
}

fn positive(field: &'static str, value: f64) -> Result<(), CuttingError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(error(field, "expected a number above zero"))
}
