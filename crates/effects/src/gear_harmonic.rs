//! Periodic error of a gear: a few clean harmonics of the motor angle.

use super::{ANY, Effect, Kind, Number, Offset, Physics, Site, checked, scalar};
use deflex_lanes::{Real, SinCos};
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "gear_harmonic",
    summary: "periodic transmission error, a few clean harmonics",
    forms: &[
        "terms = [{ joint = 1, order = 21, cos_rad = 0, sin_rad = 0 }, { joint = 5, order = 48.5, cos_rad = 0, sin_rad = 0 }]",
    ],
    shape: super::Shape::Periodic,
    locally_like: &[super::joint_error_curve::KIND.name],
    follows_command: true,
    read,
    // There are too many combinations of joints and orders to list. A search builds the candidates with `gear_harmonic`.
    candidates: |_| vec![],
    ..Kind::PLAIN
};

/// Actual = commanded + Σ (cos_rad · cos(order · angle) + sin_rad · sin(order · angle)). The angle is the commanded motor angle, because
/// the controller holds the motor there whatever the load.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GearHarmonic {
    terms: Vec<Term>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Term {
    /// The joint, 1 to 6.
    joint: usize,
    /// Periods per turn of the joint.
    order: f64,
    cos_rad: f64,
    sin_rad: f64,
}

fn read(table: toml::Table) -> Result<Box<dyn Effect>, toml::de::Error> {
    let effect: GearHarmonic = table.try_into()?;
    for (i, term) in effect.terms.iter().enumerate() {
        if !(1..=6).contains(&term.joint) {
            return Err(Error::custom(format!("`terms[{i}].joint` is {}, expected 1 to 6", term.joint)));
        }
        if !(term.order > 0.0 && term.order.is_finite()) {
            return Err(Error::custom(format!("`terms[{i}].order` is {}, expected a number above 0", term.order)));
        }
    }
    checked(effect)
}

/// Harmonics of these joints (1 to 6) and orders, all of size 0, to be fitted.
///
/// # Examples
/// ```
/// use deflex_effects::gear_harmonic;
///
/// let effect = gear_harmonic(&[(2, 101.0)]); // axis 2, 101 periods per turn
/// assert_eq!(effect.parameters().len(), 2); // a cosine and a sine
/// ```
#[must_use]
pub fn gear_harmonic(joints_and_orders: &[(usize, f64)]) -> Box<dyn Effect> {
    let term = |&(joint, order)| Term { joint, order, cos_rad: 0.0, sin_rad: 0.0 };
    Box::new(GearHarmonic { terms: joints_and_orders.iter().map(term).collect() })
}

impl Physics for GearHarmonic {
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        for term in &self.terms {
            let i = term.joint - 1;
            let SinCos { sin, cos } = SinCos::of(site.commanded[i] * term.order);
            out.joints[i] = out.joints[i] + (cos * term.cos_rad + sin * term.sin_rad);
        }
    }
}

impl Effect for GearHarmonic {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // 10 to 60 arc seconds peak to peak.
        let terms = self.terms.iter_mut().enumerate().flat_map(|(i, term)| {
            [("cos_rad", &mut term.cos_rad), ("sin_rad", &mut term.sin_rad)]
                .map(|(key, value)| scalar(&format!("terms[{i}].{key}"), value, "rad", 7e-5, 0.0, ANY))
        });
        terms.collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn two_periods_a_turn_at_30_degrees() {
        let mut bench = Bench::default();
        bench.motor[0] = 30f64.to_radians();
        let (_, out) = bench.run("gear_harmonic", "terms = [{ joint = 1, order = 2, cos_rad = 2e-4, sin_rad = 0 }, { joint = 1, order = 1, cos_rad = 0, sin_rad = -1e-4 }]");
        // 2e-4 cos 60° − 1e-4 sin 30°.
        assert_abs_diff_eq!(out.joints[0], 0.5e-4, epsilon = 1e-18);
    }
}
