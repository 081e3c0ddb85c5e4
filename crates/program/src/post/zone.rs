//! Zones: as large as the path allows within the tolerance.

/// Predefined zones and their TCP radius, mm, smallest first.
const ZONES: [(&[u8], f64); 14] = [
    (b"z0", 0.3),
    (b"z1", 1.0),
    (b"z5", 5.0),
    (b"z10", 10.0),
    (b"z15", 15.0),
    (b"z20", 20.0),
    (b"z30", 30.0),
    (b"z40", 40.0),
    (b"z50", 50.0),
    (b"z60", 60.0),
    (b"z80", 80.0),
    (b"z100", 100.0),
    (b"z150", 150.0),
    (b"z200", 200.0),
];

/// A stop at the point.
pub(super) const FINE: &[u8] = b"fine";

/// Largest zone on a path that cuts, mm: with a larger one, reorientation starts far before the point.
const LARGEST_CUTTING_MM: f64 = 10.0;

/// Largest zone in rapid travel, mm.
const LARGEST_RAPID_MM: f64 = 50.0;

/// The zone at a point between its neighbours.
///
/// A corner of turning angle θ is rounded by a parabola from r before it to r after it, which passes
/// the corner at r/2·sin(θ/2); the controller limits r to half of the shorter neighbouring path.
pub(super) fn zone(
    before: [f64; 3],
    at: [f64; 3],
    after: [f64; 3],
    rapid: bool,
    corner_tolerance_mm: f64,
) -> &'static [u8] {
    let half = length(minus(at, before)).min(length(minus(after, at))) / 2.0;
    let half_sine = half_sine(before, at, after);
    let largest = if rapid { LARGEST_RAPID_MM } else { LARGEST_CUTTING_MM };
    let fits = |radius: f64| radius <= largest && radius <= half;
    // Rapid travel too: a retraction begins in the material, where the tool must not leave the programmed path.
    let near = |radius: f64| radius.min(half) * half_sine / 2.0 <= corner_tolerance_mm;
    let best = ZONES.iter().rev().find(|(_, r)| fits(*r) && near(*r));
    match best {
        Some((name, _)) => name,
        // The controller limits z0 if the points are denser than its radius.
        None if near(ZONES[0].1) => ZONES[0].0,
        None => FINE,
    }
}

/// Whether the path continues so straight at a point that a zone of 1 mm would stay within the tolerance, however near the next point is.
pub(super) fn is_nearly_straight(before: [f64; 3], at: [f64; 3], after: [f64; 3], corner_tolerance_mm: f64) -> bool {
    half_sine(before, at, after) / 2.0 <= corner_tolerance_mm
}

/// sin(θ/2) for the turning angle θ of the path at a point; 0 where a way has no length.
fn half_sine(before: [f64; 3], at: [f64; 3], after: [f64; 3]) -> f64 {
    let (a, b) = (minus(at, before), minus(after, at));
    let lengths = length(a) * length(b);
    if lengths == 0.0 {
        return 0.0;
    }
    let cos = ((a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / lengths).clamp(-1.0, 1.0);
    ((1.0 - cos) / 2.0).sqrt()
}

/// Radius of a predefined zone, mm; `None` for a stop.
pub(super) fn radius(zone: &[u8]) -> Option<f64> {
    ZONES.iter().find(|(name, _)| *name == zone).map(|(_, radius)| *radius)
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn length(a: [f64; 3]) -> f64 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_turn(deg: f64, spacing: f64, rapid: bool) -> &'static [u8] {
        let (sin, cos) = deg.to_radians().sin_cos();
        zone([-spacing, 0.0, 0.0], [0.0; 3], [spacing * cos, spacing * sin, 0.0], rapid, 0.05)
    }

    #[test]
    fn straight_paths_get_the_largest_zone_that_fits_between_the_points() {
        assert_eq!(at_turn(0.0, 1.0, false), b"z0");
        assert_eq!(at_turn(0.0, 2.1, false), b"z1");
        assert_eq!(at_turn(0.0, 500.0, false), b"z10");
        assert_eq!(at_turn(0.0, 500.0, true), b"z50");
    }

    #[test]
    fn corners_are_cut_no_deeper_than_tolerated() {
        assert_eq!(at_turn(90.0, 50.0, false), FINE); // z0: 0.3/2·sin 45° = 0.106 mm
        assert_eq!(at_turn(30.0, 50.0, false), b"z0"); // 0.039 mm
        assert_eq!(at_turn(10.0, 50.0, false), b"z1"); // 0.044 mm
        assert_eq!(at_turn(90.0, 0.2, false), b"z0"); // no more than 0.1/2·sin 45° = 0.035 mm
        assert_eq!(at_turn(90.0, 50.0, true), FINE); // a retraction may begin in a hole
        assert_eq!(at_turn(1.0, 50.0, true), b"z10"); // 10/2·sin 0.5° = 0.044 mm
    }
}
