//! Number tokens of positions: where they stand, and with how many decimals they are written.

use crate::program::Program;
use deflex_lang::ir::SourceSpan;

/// Least decimals of a position, mm: half of the last digit is below what a robot repeats by two orders.
pub(super) const POSITION_DECIMALS: usize = 3;
/// Least decimals of an angle, degrees: single precision, in which the controller counts, holds no more at 180.
pub(super) const ANGLE_DECIMALS: usize = 5;

/// The text of a number.
pub(super) fn bytes(program: &Program, place: SourceSpan) -> &[u8] {
    program.sources[usize::from(place.source)].slice(place.span)
}

/// Whether nothing but its sign parts a number from the name before it.
pub(super) fn follows_a_name(program: &Program, place: SourceSpan) -> bool {
    let before = program.sources[usize::from(place.source)].bytes.get(..place.span.start as usize);
    before.and_then(<[u8]>::last).is_some_and(|byte| byte.is_ascii_alphanumeric() || *byte == b'_' || !byte.is_ascii())
}

/// Of the two triples of angles that are one rotation the one nearer to another, within half a turn either way.
pub(super) fn near([a, b, c]: [f64; 3], old: [f64; 3]) -> [f64; 3] {
    let wrap = |angle: f64| {
        let turns = (angle / 360.0).round();
        angle - 360.0 * turns
    };
    let far = |angles: [f64; 3]| angles.iter().zip(old).map(|(new, old)| wrap(new - old).abs()).sum::<f64>();
    let other = [a + 180.0, 180.0 - b, c + 180.0].map(wrap);
    let nearer = if far(other) < far([a, b, c]) { other } else { [a, b, c] };
    // Angles beyond half a turn stay there.
    std::array::from_fn(|i| {
        let nearest = old[i] + wrap(nearer[i] - old[i]);
        if nearest.abs() <= 180.0 || old[i].abs() > 180.0 { nearest } else { wrap(nearest) }
    })
}
