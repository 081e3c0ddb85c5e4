//! The mean milling force on the tool, computed from cutter and engagement.
//!
//! Frames. The **feed frame** F stands at the cutter's tip: x along the feed, z along the surface
//! normal (out of the part), y = z × x. The **cutter frame** C has z along the tool axis, tip to
//! spindle, and is turned from F by `Rx(tilt) · Ry(lead)`: positive lead leans the tool into the
//! feed. The spindle turns clockwise seen from above. Lengths are metres, forces newtons, angles
//! radians, coefficients N/m² (cutting) and N/m (edge).
//!
//! Source: Tang et al., Eqs. 6, 12 and 13, with the matrix inside the sum and the integral, edge
//! forces added, and the integral taken along the profile angle κ so that the tip is regular.
//!
//! The mean over a revolution does not depend on helix, lag and runout as long as every tooth keeps cutting: helix and
//! lag only shift the angles of the teeth, and runout only moves chip thickness from one tooth to another.

mod adjacent;
mod contact;
mod feed_table;
mod frame;
pub mod materials;
mod milling;
mod patch;
mod quadrature;
mod ring;
mod root;
mod silhouette;
mod table;

pub use contact::ContactPoint;
pub use feed_table::FeedTable;
pub use frame::{Lean, feed_frame};
pub use milling::{ForceParts, Milling, check_coefficients, check_cutter, check_feed, mean_forces};
pub use table::{ForceTable, TABLE_BOUND};

/// A bull-nose cutter; ball (`corner_radius = diameter/2`) and flat (`corner_radius = 0`) included.
///
/// # Examples
/// ```
/// use deflex_cutting::Cutter;
///
/// let bull_nose = Cutter { diameter: 0.025, corner_radius: 5e-3, teeth: 3, helix: 30_f64.to_radians() };
/// assert_eq!(bull_nose.radius(), 0.0125); // m
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutter {
    /// Diameter, m.
    pub diameter: f64,
    /// Radius of the rounded corner, m.
    pub corner_radius: f64,
    /// Number of teeth.
    pub teeth: u32,
    /// Helix angle, rad. The mean force does not depend on it.
    pub helix: f64,
}

/// Which part of the cutter's width is in the material.
///
/// # Examples
/// ```
/// use deflex_cutting::{Engagement, Mode};
///
/// let climb = Engagement { mode: Mode::Down, depth: 1e-3, width: 0.012, feed_per_tooth: 7e-5, lead: 0.0, tilt: 0.0 };
/// assert_eq!(climb.mode, Mode::Down);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Material on both sides; the declared width has no effect.
    Slot,
    /// Conventional milling: material to the left of the feed, at +y; the previous pass was to the right.
    Up,
    /// Climb milling: material to the right of the feed, at −y; the previous pass was to the left.
    Down,
}

/// How the cutter meets the material at the programmed pose.
///
/// # Examples
/// ```
/// use deflex_cutting::{Engagement, Mode};
///
/// // Down milling, 1 mm deep and 12 mm wide, with the tool leaning forward by 8°.
/// let lead = 8_f64.to_radians();
/// let cut = Engagement { mode: Mode::Down, depth: 1e-3, width: 0.012, feed_per_tooth: 7e-5, lead, tilt: 0.0 };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Engagement {
    /// Slot, up or down milling.
    pub mode: Mode,
    /// Depth along the surface normal from the stock's top to the cutter's lowest point, m.
    pub depth: f64,
    /// Stepover, m: in up and down milling the same cutter has made a pass this far away, at the same
    /// depth. For an upright flat end mill it is the radial width of cut.
    pub width: f64,
    /// Feed per tooth, m.
    pub feed_per_tooth: f64,
    /// Lead, rad: positive leans the tool axis into the feed.
    pub lead: f64,
    /// Tilt, rad: positive leans the tool axis towards −y.
    pub tilt: f64,
}

/// Force per chip area (N/m²) and per edge length (N/m).
///
/// # Examples
/// ```
/// use deflex_cutting::Coefficients;
///
/// // 2250 N/mm² and 4.6 N/mm along the motion of the tooth, and so on.
/// let coefficients = Coefficients { ktc: 2.25e9, krc: 9e8, kac: 7.9e8, kte: 4600.0, kre: 6.4e4, kae: 6000.0 };
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coefficients {
    /// Cutting, tangential: against the tooth's motion.
    pub ktc: f64,
    /// Cutting, radial: along the surface normal of the envelope, into the tool.
    pub krc: f64,
    /// Cutting, axial: down along the profile's meridian, towards the tip.
    pub kac: f64,
    /// Edge, tangential.
    pub kte: f64,
    /// Edge, radial.
    pub kre: f64,
    /// Edge, axial.
    pub kae: f64,
}

/// An impossible cut, with the field that makes it impossible, named as in the cell file without its unit.
///
/// # Examples
/// ```
/// use deflex_cutting::{Cutter, Engagement, Milling, Mode, materials};
///
/// let cutter = Cutter { diameter: 0.025, corner_radius: 5e-3, teeth: 3, helix: 0.5 };
/// let none = Engagement { mode: Mode::Slot, depth: -1e-3, width: 0.025, feed_per_tooth: 7e-5, lead: 0.1, tilt: 0.0 };
/// let material = materials::find("ni-al-bronze").expect("a material");
/// let error = Milling::new(cutter, none, material.coefficients).expect_err("a negative depth");
/// assert_eq!(error.field, "depth");
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct CuttingError {
    /// Name of the offending field.
    pub field: &'static str,
    /// What is wrong and what was expected.
    pub message: String,
}

impl Cutter {
    /// Half the diameter, m.
    pub fn radius(&self) -> f64 {
        0.5 * self.diameter
    }
}
