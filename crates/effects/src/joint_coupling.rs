//! A wrist whose gears couple its axes by a ratio that differs from the one that the controller compensates.

use super::{ANY, Covered, Effect, Kind, Number, Offset, Physics, Site, Survey, checked, scalar};
use deflex_lanes::Real;
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "joint_coupling",
    summary: "a joint turns with another joint's motor",
    forms: &["terms = [{ joint = 5, on = 4, ratio = 0 }, { joint = 6, on = 5, ratio = 0 }]"],
    covered_by: Some(Covered::Geometry),
    follows_command: true,
    read,
    candidates,
    ..Kind::PLAIN
};

/// Typical error of a ratio: half of the last digit of a ratio with three decimals. In the model of the whole arm a larger size lets the
/// couplings take errors that are the same at all rows of one posture, and carry them to postures where they are others.
const ROUNDED: f64 = 5e-4;

/// Actual = commanded + ratio · commanded motor angle of `on`; the controller holds the motor there whatever the load.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointCoupling {
    terms: Vec<Term>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Term {
    /// The joint that turns, 1 to 6.
    joint: usize,
    /// The joint whose motor turns it, 1 to 6, another one than `joint`.
    on: usize,
    ratio: f64,
}

fn read(table: toml::Table) -> Result<Box<dyn Effect>, toml::de::Error> {
    let effect: JointCoupling = table.try_into()?;
    for (i, Term { joint, on, .. }) in effect.terms.iter().enumerate() {
        for (key, value) in [("joint", joint), ("on", on)] {
            if !(1..=6).contains(value) {
                return Err(Error::custom(format!("`terms[{i}].{key}` is {value}, expected 1 to 6")));
            }
        }
        if joint == on {
            return Err(Error::custom(format!("`terms[{i}].on` is {on}, expected another joint than {joint}")));
        }
    }
    checked(effect)
}

/// The couplings of a hollow wrist, in which the drives of axes 5 and 6 run through the axes before them. They are candidates even if
/// these axes turn little: over a small range a coupling looks like a wrong zero, and the answer can name both only if both were tried.
fn candidates(_: &Survey) -> Vec<Box<dyn Effect>> {
    const WRIST: [(usize, usize); 3] = [(5, 4), (6, 4), (6, 5)];
    vec![Box::new(JointCoupling { terms: WRIST.map(|(joint, on)| Term { joint, on, ratio: 0.0 }).into() })]
}

impl Physics for JointCoupling {
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        for Term { joint, on, ratio } in &self.terms {
            out.joints[joint - 1] = out.joints[joint - 1] + site.commanded[on - 1] * *ratio;
        }
    }
}

impl Effect for JointCoupling {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        let ratios = self.terms.iter_mut().map(|term| &mut term.ratio).enumerate();
        ratios.map(|(i, ratio)| scalar(&format!("terms[{i}].ratio"), ratio, "1", ROUNDED, 0.0, ANY)).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_joint_goes_along_by_the_ratio() {
        let mut bench = Bench::default();
        (bench.motor[3], bench.motor[4]) = (0.5, -0.4);
        let (_, out) = bench.run(
            "joint_coupling",
            "terms = [{ joint = 5, on = 4, ratio = 1e-3 }, { joint = 6, on = 5, ratio = 2e-3 }]",
        );
        assert_abs_diff_eq!(out.joints[4], 5e-4, epsilon = 1e-18);
        assert_abs_diff_eq!(out.joints[5], -8e-4, epsilon = 1e-18);
        assert_abs_diff_eq!(out.joints[3], 0.0);
    }
}
