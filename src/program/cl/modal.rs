//! What holds from one statement to the next.

use super::statement::Statement;
use crate::program::{CutterInfo, Mark};
use crate::text::Span;

/// Millimetres in an inch.
pub(super) const INCH_MM: f64 = 25.4;
/// Millimetres in a foot: `SFM` is feet a minute.
const FOOT_MM: f64 = 304.8;
/// Millimetres in a metre: `SMM` is metres a minute.
const METRE_MM: f64 = 1000.0;

/// A programmed feed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Feed {
    Unknown,
    PerMinute(f64),
    PerRevolution(f64),
}

/// A programmed spindle speed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Spindle {
    Off,
    Rpm(f64),
    /// Speed of the edge, mm/min.
    Surface(f64),
}

/// Where the numbers of a position stand.
pub(super) type Xyz = [Span; 3];

/// The state that one statement leaves to the next.
#[derive(Clone, Debug)]
pub(super) struct Modal {
    /// Where the tool is, as printed; unknown before the first position and after what is not read.
    pub(super) position: Option<[f64; 3]>,
    /// Where `FROM` printed it and in which frame, if the tool has not moved since.
    pub(super) from: Option<(Xyz, u16)>,
    /// Tool axis in printed axes, unit length.
    pub(super) axis: [f64; 3],
    /// Tangent of the next CATIA arc.
    pub(super) tangent: Option<[f64; 3]>,
    /// The next position is reached in rapid travel.
    pub(super) rapid: bool,
    pub(super) mark: Option<Mark>,
    pub(super) cutter: Option<CutterInfo>,
    /// Within a drilling cycle.
    pub(super) cycle: bool,
    /// Under radius compensation.
    pub(super) cutcom: bool,
    /// Geometry is changed by a statement that is not modelled.
    pub(super) blocked: Option<&'static str>,
    /// Angles of the rotary tables A, B and C, radians as printed.
    rotary: [f64; 3],
    feed: Feed,
    spindle: Spindle,
    last_spindle: Spindle,
}

impl Default for Modal {
    fn default() -> Self {
        Self {
            position: None,
            from: None,
            axis: [0.0, 0.0, 1.0],
            tangent: None,
            rapid: false,
            mark: None,
            cutter: None,
            cycle: false,
            cutcom: false,
            blocked: None,
            rotary: [0.0; 3],
            feed: Feed::Unknown,
            spindle: Spindle::Off,
            last_spindle: Spindle::Off,
        }
    }
}

impl Modal {
    /// `FEDRAT/`: value and unit in either order; without a unit, a minute in the file's lengths.
    pub(super) fn read_feed(&mut self, statement: &Statement, mm_per_unit: f64) -> Result<(), &'static str> {
        let value = statement.number_items().iter().next().ok_or("feed without a number")?.value;
        self.feed = statement
            .words()
            .find_map(|word| match word.to_ascii_uppercase().as_slice() {
                b"IPM" => Some(Feed::PerMinute(value * INCH_MM)),
                b"MMPM" => Some(Feed::PerMinute(value)),
                b"PERMIN" => Some(Feed::PerMinute(value * mm_per_unit)),
                b"IPR" => Some(Feed::PerRevolution(value * INCH_MM)),
                b"MMPR" => Some(Feed::PerRevolution(value)),
                b"PERREV" => Some(Feed::PerRevolution(value * mm_per_unit)),
                _ => None,
            })
            .unwrap_or(Feed::PerMinute(value * mm_per_unit));
        if value > 0.0 {
            Ok(())
        } else {
            self.feed = Feed::Unknown;
            Err("feed is not positive")
        }
    }

    /// `SPINDL/`: speed, unit and sense in any order; `ON` brings the last speed back.
    pub(super) fn read_spindle(&mut self, statement: &Statement) {
        if statement.has(b"OFF") {
            self.spindle = Spindle::Off;
        } else if let Some(speed) = statement.number_items().iter().next() {
            self.spindle = if statement.has(b"SFM") {
                Spindle::Surface(speed.value * FOOT_MM)
            } else if statement.has(b"SMM") {
                Spindle::Surface(speed.value * METRE_MM)
            } else {
                Spindle::Rpm(speed.value)
            };
            self.last_spindle = self.spindle;
        } else {
            self.spindle = self.last_spindle;
        }
    }

    /// Spindle speed, 1/min, where known and turning.
    pub(super) fn rpm(&self) -> Option<f64> {
        let rpm = match self.spindle {
            Spindle::Off => return None,
            Spindle::Rpm(rpm) => rpm,
            Spindle::Surface(mm_min) => mm_min / (std::f64::consts::PI * self.cutter?.diameter_mm),
        };
        (rpm > 0.0 && rpm.is_finite()).then_some(rpm)
    }

    /// Feed, mm/s, where known.
    pub(super) fn feed_mm_s(&self) -> Option<f64> {
        match self.feed {
            Feed::Unknown => None,
            Feed::PerMinute(mm) => Some(mm / 60.0),
            Feed::PerRevolution(mm) => Some(mm * self.rpm()? / 60.0),
        }
    }

    /// `ROTABL/`: turns add up; true while any table stands away from zero.
    pub(super) fn turn_table(&mut self, statement: &Statement) -> bool {
        /// Radians or degrees, this is no turn.
        const NO_TURN: f64 = 1e-6;
        let Some(angle) = statement.number_items().iter().next() else { return false };
        let table = if statement.has(b"AAXIS") {
            0
        } else if statement.has(b"BAXIS") {
            1
        } else {
            2
        };
        let sense = if statement.has(b"CLW") { -1.0 } else { 1.0 };
        let absolute = statement.has(b"ATANGL") || statement.has(b"ABSOL");
        self.rotary[table] = if absolute { 0.0 } else { self.rotary[table] } + sense * angle.value;
        self.rotary.iter().any(|a| a.abs() > NO_TURN)
    }
}
