//! Number tokens of positions: their places, and the number of decimals with which they are written.

use crate::Program;
use deflex_lang::ir::SourceSpan;

/// Least decimals of a position, mm: half of the last digit is a hundredth of a robot's repeatability.
pub(super) const POSITION_DECIMALS: usize = 3;
/// Least decimals of an angle, degrees: the controller's single precision has no more at 180°.
pub(super) const ANGLE_DECIMALS: usize = 5;

/// The text of a number.
pub(super) fn bytes(program: &Program, place: SourceSpan) -> &[u8] {
    program.sources[usize::from(place.source)].slice(place.span)
}

/// Whether only the sign of a number separates it from the name before it.
pub(super) fn follows_a_name(program: &Program, place: SourceSpan) -> bool {
    let before = program.sources[usize::from(place.source)].bytes.get(..place.span.start as usize);
    before.and_then(<[u8]>::last).is_some_and(|byte| byte.is_ascii_alphanumeric() || *byte == b'_' || !byte.is_ascii())
}

/// Of the two triples of angles for one rotation, the one that is nearer to another triple, with each angle within half a turn of it.
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
