//! Modal data, which stay from one statement to the next.

use super::refusal::Outcome;
use super::statement::Statement;
use crate::{CutterInfo, Mark, Reason};
use deflex_text::Span;

/// Millimetres in an inch.
pub(super) const INCH_MM: f64 = 25.4;
/// Millimetres in a foot: `SFM` is feet a minute.
const FOOT_MM: f64 = 304.8;
/// Seconds in a minute.
const SECONDS: f64 = 60.0;
/// Millimetres in a metre: `SMM` is metres a minute.
const METRE_MM: f64 = 1000.0;

/// A programmed feed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Feed {
    #[default]
    Unknown,
    /// Feed for each minute, mm/min.
    PerMinute(f64),
    /// Feed for each revolution, mm.
    PerRevolution(f64),
}

impl Feed {
    /// The feed in mm/s, at a spindle speed in 1/min, if it is known.
    pub(super) fn mm_s(self, rpm: Option<f64>) -> Option<f64> {
        match self {
            Self::Unknown => None,
            Self::PerMinute(mm) => Some(mm / SECONDS),
            Self::PerRevolution(mm) => Some(mm * rpm? / SECONDS),
        }
    }

    pub(super) fn is_positive(self) -> bool {
        match self {
            Self::Unknown => false,
            Self::PerMinute(mm) | Self::PerRevolution(mm) => mm > 0.0 && mm.is_finite(),
        }
    }
}

/// The unit of a feed, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum FeedUnit {
    PerMinute(f64),
    PerRevolution(f64),
}

impl FeedUnit {
    pub(super) fn feed(self, value: f64) -> Feed {
        match self {
            Self::PerMinute(mm) => Feed::PerMinute(mm * value),
            Self::PerRevolution(mm) => Feed::PerRevolution(mm * value),
        }
    }

    /// The number for a feed in mm/s, at a spindle speed in 1/min if that is needed; `None` if it is unknown.
    pub(super) fn value(self, mm_s: f64, rpm: Option<f64>) -> Option<f64> {
        Some(match self {
            Self::PerMinute(mm) => mm_s * SECONDS / mm,
            Self::PerRevolution(mm) => mm_s * SECONDS / (mm * rpm?),
        })
    }
}

/// The unit that a word in upper case names; with the file's unit of length if it names none (`PERMIN`, `PERREV`).
pub(super) fn feed_unit(word: &[u8], mm_per_unit: f64) -> Option<FeedUnit> {
    Some(match word {
        b"PERMIN" | b"UPM" => FeedUnit::PerMinute(mm_per_unit),
        b"MMPM" => FeedUnit::PerMinute(1.0),
        b"IPM" => FeedUnit::PerMinute(INCH_MM),
        b"MPM" => FeedUnit::PerMinute(METRE_MM),
        b"FPM" => FeedUnit::PerMinute(FOOT_MM),
        b"PERSEC" => FeedUnit::PerMinute(SECONDS * mm_per_unit),
        b"MMPS" => FeedUnit::PerMinute(SECONDS),
        b"IPS" => FeedUnit::PerMinute(SECONDS * INCH_MM),
        b"PERREV" | b"UPR" => FeedUnit::PerRevolution(mm_per_unit),
        b"MMPR" => FeedUnit::PerRevolution(1.0),
        b"IPR" => FeedUnit::PerRevolution(INCH_MM),
        _ => return None,
    })
}

/// A programmed spindle speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Spindle {
    #[default]
    Off,
    Rpm(f64),
    /// The speed of the edge, mm/min, up to a spindle speed, 1/min.
    Surface {
        mm_min: f64,
        most_rpm: f64,
    },
}

/// Words of `SPINDL/` before which or after which the speed stands.
const SPEED_WORDS: [&[u8]; 7] = [b"RPM", b"SFM", b"SMM", b"CLW", b"CCLW", b"CCW", b"ON"];

/// The places of the numbers of a position.
pub(super) type Xyz = [Span; 3];

/// The state that one statement leaves to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct Modal {
    /// Position of the tool as printed; unknown before the first position and after a motion that is not read.
    pub(super) position: Option<[f64; 3]>,
    /// The place of its numbers in `FROM`, and the frame, if the tool has not moved since.
    pub(super) from: Option<(Xyz, u16)>,
    /// Tool axis in printed axes, unit length.
    pub(super) axis: [f64; 3],
    /// The direction of the last motion, if it was straight and with feed.
    pub(super) fed: Option<[f64; 3]>,
    /// Surface normal at the position that is being read, in printed axes.
    pub(super) normal: Option<[f64; 3]>,
    /// Tangent of the next CATIA arc.
    pub(super) tangent: Option<[f64; 3]>,
    /// Whether the next position is reached in rapid travel.
    pub(super) rapid: bool,
    pub(super) mark: Option<Mark>,
    pub(super) cutter: Option<CutterInfo>,
    /// Angles of the rotary tables A, B and C, radians as printed.
    rotary: [f64; 3],
    feed: Feed,
    /// The last unit.
    feed_unit: Option<FeedUnit>,
    spindle: Spindle,
    last_spindle: Spindle,
}

impl Modal {
    /// The state at the start of a file, in which the tool axis is z.
    pub(super) fn upright() -> Self {
        Self { axis: [0.0, 0.0, 1.0], ..Self::default() }
    }

    /// `FEDRAT/`: value and unit in either order; without a unit, that of the last feed, or for each minute in the file's unit of length.
    pub(super) fn read_feed(&mut self, statement: &Statement, mm_per_unit: f64) -> Outcome {
        self.feed = Feed::Unknown;
        let mut written = None;
        for word in statement.words().map(<[u8]>::to_ascii_uppercase) {
            let unit = feed_unit(&word, mm_per_unit);
            if matches!(word.as_slice(), b"INVERS" | b"INVERSE") {
                return Err(Reason::InverseTime);
            }
            if unit.is_none() || written.is_some() {
                return Err(Reason::FeedUnit);
            }
            written = unit;
        }
        let [value] = statement.number_items().only().ok_or(Reason::NoFeed)?;
        let default = FeedUnit::PerMinute(mm_per_unit);
        let unit = match (written, self.feed_unit) {
            (Some(unit), _) => unit,
            (None, Some(last)) if last != default => return Err(Reason::FeedUnitLost),
            (None, _) => default,
        };
        self.feed_unit = written.or(self.feed_unit);
        let feed = unit.feed(value);
        if !feed.is_positive() {
            return Err(Reason::NoFeed);
        }
        self.feed = feed;
        Ok(())
    }

    /// The feed in force, and the unit of a number without one.
    pub(super) fn feed(&self, mm_per_unit: f64) -> (Feed, FeedUnit) {
        (self.feed, self.feed_unit.unwrap_or(FeedUnit::PerMinute(mm_per_unit)))
    }

    /// `SPINDL/`: speed, unit and sense in any order; `ON` restores the last speed. A number after another word, as in `RANGE,2`, belongs to
    /// that word.
    pub(super) fn read_spindle(&mut self, statement: &Statement) {
        if statement.has(b"OFF") {
            self.spindle = Spindle::Off;
        } else if let Some(speed) = statement.number_without_word(&SPEED_WORDS) {
            let surface = |mm| {
                let most_rpm = statement.number_after(b"MAXRPM").unwrap_or(f64::INFINITY);
                Spindle::Surface { mm_min: speed * mm, most_rpm }
            };
            self.spindle = if statement.has(b"SFM") {
                surface(FOOT_MM)
            } else if statement.has(b"SMM") {
                surface(METRE_MM)
            } else {
                Spindle::Rpm(speed)
            };
            self.last_spindle = self.spindle;
        } else {
            self.spindle = self.last_spindle;
        }
    }

    /// Spindle speed, 1/min, if it is known and the spindle turns.
    pub(super) fn rpm(&self) -> Option<f64> {
        let rpm = match self.spindle {
            Spindle::Off => return None,
            Spindle::Rpm(rpm) => rpm,
            Spindle::Surface { mm_min, most_rpm } => {
                (mm_min / (std::f64::consts::PI * self.cutter?.diameter_mm)).min(most_rpm)
            }
        };
        (rpm > 0.0 && rpm.is_finite()).then_some(rpm)
    }

    /// Feed, mm/s, if it is known.
    pub(super) fn feed_mm_s(&self) -> Option<f64> {
        self.feed.mm_s(self.rpm())
    }

    /// Whether the feed is for each revolution and the spindle speed is unknown.
    pub(super) fn lacks_spindle(&self) -> bool {
        matches!(self.feed, Feed::PerRevolution(_)) && self.rpm().is_none()
    }

    /// Whether the spindle turns.
    pub(super) fn spins(&self) -> bool {
        self.spindle != Spindle::Off
    }

    /// `ROTABL/`: turns add up. Returns whether any table is away from zero.
    pub(super) fn turn_table(&mut self, statement: &Statement) -> bool {
        /// Smaller angles count as zero, in radians and in degrees.
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
