//! A map over places of errors that no physical effect explains, used only near the places where it was measured.
//!
//! This is the second form of the effect `empirical`: a sum of Gaussian bells about measured places. It acts in full within the distance
//! at which it was tested, and fades to zero over the same distance again, so that the correction does not jump. With a single clamping
//! the data cannot show whether an error belongs to the place in the base or to the place on the part; it acts where both are near.

use super::{Effect, Number, Offset, Physics, Site};
use deflex_lanes::{Mask, Real, Vector};
use serde::{Deserialize, Serialize};

/// The kind of which this is a form.
pub(super) const NAME: &str = "empirical";

/// A shift of the TCP in base axes: a sum of bells about places.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EmpiricalField {
    /// Length scale of a bell exp(−½ d²/reach²).
    reach_mm: f64,
    /// Distance from the nearest place up to which the field acts in full.
    within_mm: f64,
    /// Places in the base frame, mm.
    at_mm: Vec<[f64; 3]>,
    /// The same places in the work object, mm; without them only the place in the base counts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    on_part_mm: Vec<[f64; 3]>,
    /// Shift of the TCP by the bell of each place, mm, base axes.
    shift_mm: Vec<[f64; 3]>,
}

impl EmpiricalField {
    pub(super) fn check(self) -> Result<Self, String> {
        let finite = |all: &[[f64; 3]]| all.iter().flatten().all(|value| value.is_finite());
        for (key, value) in [("reach_mm", self.reach_mm), ("within_mm", self.within_mm)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("`{key}` is {value}, expected more than 0"));
            }
        }
        let (places, shifts) = (self.at_mm.len(), self.shift_mm.len());
        if places != shifts || !finite(&self.at_mm) || !finite(&self.shift_mm) {
            return Err(format!("{places} `at_mm` and {shifts} `shift_mm`, expected as many of both, all finite"));
        }
        let on_part = self.on_part_mm.len();
        if on_part > 0 && on_part != places || !finite(&self.on_part_mm) {
            return Err(format!(
                "{places} `at_mm` and {on_part} `on_part_mm`, expected as many of both or none, all finite"
            ));
        }
        Ok(self)
    }
}

/// Share of a field that acts at a distance from the nearest place, in units of the distance within which it acts in full: 1 up to 1, 0
/// from 2 on, smooth between.
#[must_use]
pub(crate) fn fade(off: f64) -> f64 {
    let left = (2.0 - off).clamp(0.0, 1.0);
    left * left * (3.0 - 2.0 * left)
}

/// A bell with an exponent below this is negligible.
pub(super) const NOTHING: f64 = -40.0;

impl Physics for EmpiricalField {
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        let place = site.base_from_wobj.point(site.wanted) * R::of(1e3);
        let scale = -0.5 / (self.reach_mm * self.reach_mm);
        let (mut shift, mut nearest) = (Vector::ZERO, R::of(f64::INFINITY));
        for (i, (at, bell)) in self.at_mm.iter().zip(&self.shift_mm).enumerate() {
            let apart = place - Vector::of(&(*at).into());
            let apart = apart.dot(apart);
            let off = self.on_part_mm.get(i).map_or(apart, |on_part| {
                let off = site.wanted * R::of(1e3) - Vector::of(&(*on_part).into());
                let off = off.dot(off);
                off.lt(apart).select(apart, off)
            });
            nearest = off.lt(nearest).select(off, nearest);
            let exponent = apart * scale;
            let felt = R::of(NOTHING).lt(exponent);
            if felt.any() {
                let size = felt.select(exponent.each(f64::exp), R::ZERO);
                shift = shift + Vector::of(&(*bell).into()) * size;
            }
        }
        let fade = (nearest.sqrt() * (1.0 / self.within_mm)).each(fade);
        out.lag = out.lag + shift * (fade * 1e-3);
    }
}

impl Effect for EmpiricalField {
    /// None to fit: neighbouring bells overlap, so that single heights mean nothing.
    fn numbers(&mut self) -> Vec<Number<'_>> {
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    const FIELD: &str = r#"reach_mm = 20
        within_mm = 20
        at_mm = [[100, 0, 0], [130, 0, 0]]
        shift_mm = [[0.1, 0, 0], [0, -0.04, 0]]"#;

    #[test]
    fn another_clamping_is_not_where_it_was_seen() {
        let at = |wobj: f64, on_part: f64| {
            let mut bench = Bench::default();
            bench.situation.base_from_wobj.translation.vector = Vector3::new(wobj, 0.0, 0.0);
            bench.situation.wobj_from_tcp.translation.vector = Vector3::new(on_part, 0.0, 0.0);
            bench.run("empirical", &format!("{FIELD}\non_part_mm = [[50, 0, 0], [80, 0, 0]]")).1.lag
        };
        // As seen, with a work object 30 mm off (halfway through the fade on the part), and 40 mm off (gone).
        let first = 1e-4 * (-0.125f64).exp();
        assert_abs_diff_eq!(at(0.05, 0.060).x, first, epsilon = 1e-15);
        assert_abs_diff_eq!(at(0.09, 0.020).x, 0.5 * first, epsilon = 1e-15);
        assert_abs_diff_eq!(at(0.10, 0.010), Vector3::zeros());
    }

    #[test]
    fn bells_add_up_and_end() {
        let at = |x: f64| {
            let mut bench = Bench::default();
            bench.situation.base_from_wobj.translation.vector = Vector3::new(0.05, 0.0, 0.0);
            bench.situation.wobj_from_tcp.translation.vector = Vector3::new(x - 0.05, 0.0, 0.0);
            bench.run("empirical", FIELD).1.lag
        };
        // Half a reach from the first place, one from the second.
        let (first, second) = (1e-4 * (-0.125f64).exp(), -4e-5 * (-0.5f64).exp());
        assert_abs_diff_eq!(at(0.110), Vector3::new(first, second, 0.0), epsilon = 1e-15);
        assert_abs_diff_eq!(at(0.170), Vector3::zeros());
        // A reach and a half beyond the last place: halfway through the fade.
        assert_abs_diff_eq!(at(0.160).y, -4e-5 * (-1.125f64).exp() * 0.5, epsilon = 1e-15);
    }
}
