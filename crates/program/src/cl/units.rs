//! The unit of a file's positions.

use super::modal::INCH_MM;
use super::{ClOptions, Units};

/// Bytes of the head in which the unit is searched for; a later one applies from there on.
const HEAD: usize = 16 * 1024;

/// The unit in the file's head, or that of the options.
pub(super) fn unit_at_start(bytes: &[u8], options: &ClOptions) -> Option<f64> {
    unit_further_down(&bytes[..bytes.len().min(HEAD)]).or(options.units.map(mm_per_unit))
}

fn mm_per_unit(units: Units) -> f64 {
    match units {
        Units::Millimetre => 1.0,
        Units::Inch => INCH_MM,
    }
}

/// The only unit that words name; `None` if they name none, or two.
pub(super) fn one_unit<'w>(words: impl Iterator<Item = &'w [u8]>) -> Option<f64> {
    let mut units = words.filter_map(unit_of);
    let first = units.next()?;
    #[allow(clippy::float_cmp)] // of one list
    units.all(|other| other == first).then_some(first)
}

fn unit_of(word: &[u8]) -> Option<f64> {
    match word.to_ascii_uppercase().as_slice() {
        b"MM" | b"MILLIMETERS" | b"MILLIMETRES" | b"METRIC" => Some(1.0),
        b"INCHES" | b"INCH" | b"IN" => Some(INCH_MM),
        b"CM" => Some(10.0),
        _ => None,
    }
}

/// The unit of the first `UNITS` statement in the rest of a file.
pub(super) fn unit_further_down(rest: &[u8]) -> Option<f64> {
    rest.split(|b| matches!(b, b'\n' | b'\r')).find_map(|line| {
        let line = line.trim_ascii_start();
        let head = line.get(..4)?;
        if !head.eq_ignore_ascii_case(b"UNIT") {
            return None;
        }
        one_unit(line.split(|b| !b.is_ascii_alphabetic()).skip(1))
    })
}
