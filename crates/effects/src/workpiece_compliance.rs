//! A workpiece or fixture that yields along the surface normal: thin walls, soft clamps.

use super::{
    ANY, Deflection, Effect, Kind, Load, NOT_NEGATIVE, Need, Number, Parts, Physics, State, checked, indexed, scalar,
};
use deflex_lanes::{Mask, Real};
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "workpiece_compliance",
    summary: "the workpiece or its fixture yields",
    forms: &[
        "mm_per_n = 1e-4",
        "mm_per_n = [1e-4, 0, 0, 1e-9, 0, 1e-9]",
        "mm_per_n = [1e-4, 0, 0, 1e-9, 0, 1e-9]\ndomain_mm = [[-100, 100], [-50, 50]]",
    ],
    bends_under_load: true,
    parts: Parts::PART,
    needs: &[Need::Force],
    read: |table| {
        let effect = table.try_into::<WorkpieceCompliance>()?;
        if let Some([low, high]) =
            effect.domain_mm.iter().flatten().find(|[low, high]| low.is_nan() || high.is_nan() || low > high)
        {
            let message = format!("`domain_mm` has [{low}, {high}], expected two numbers, the lower one first");
            return Err(toml::de::Error::custom(message));
        }
        if effect.domain_mm.is_some() && matches!(effect.mm_per_n, Compliance::Alike(_)) {
            let message =
                "`domain_mm` has no effect where `mm_per_n` is one number: remove it, or give six coefficients";
            return Err(toml::de::Error::custom(message));
        }
        checked(effect)
    },
    candidates: |survey| {
        if !survey.has_force {
            return vec![];
        }
        let alike = WorkpieceCompliance { mm_per_n: Compliance::Alike(0.0), domain_mm: None };
        let varying = WorkpieceCompliance { mm_per_n: Compliance::Polynomial([0.0; 6]), domain_mm: survey.cut_mm };
        vec![Box::new(alike), Box::new(varying)]
    },
    ..Kind::PLAIN
};

/// The force F on the tool pushes the part back by c (F·n) along its surface normal n, so that the tool is too far out by c (F·n).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WorkpieceCompliance {
    mm_per_n: Compliance,
    /// Lowest and highest x, then y, in the work object, between which the compliance was measured, mm. Outside, the value at the nearest
    /// place inside is used, because a polynomial is meaningless where it was not fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    domain_mm: Option<[[f64; 2]; 2]>,
}

/// Compliance along the normal, mm/N.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number, or six: the coefficients of 1, x, y, x², xy, y² with x and y in mm")]
enum Compliance {
    /// The same compliance everywhere.
    Alike(f64),
    /// Coefficients of 1, x, y, x², xy, y², with x and y of the work object in mm.
    Polynomial([f64; 6]),
}

/// Units of the polynomial's coefficients, and the typical size of each over a part of some 200 mm.
const TERMS: [(&str, f64); 6] = [
    ("mm/N", 3e-4),
    ("mm/(N·mm)", 1.5e-6),
    ("mm/(N·mm)", 1.5e-6),
    ("mm/(N·mm²)", 7e-9),
    ("mm/(N·mm²)", 7e-9),
    ("mm/(N·mm²)", 7e-9),
];

/// A value limited to a range.
fn within<R: Real>(value: R, [low, high]: [f64; 2]) -> R {
    let value = value.lt(low).select(R::of(low), value);
    value.ge(high).select(R::of(high), value)
}

impl Physics for WorkpieceCompliance {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let site = state.site;
        let mm_per_n = match &self.mm_per_n {
            Compliance::Alike(compliance) => R::of(*compliance),
            Compliance::Polynomial(c) => {
                let (mut x, mut y) = (site.wanted.x * 1e3, site.wanted.y * 1e3);
                if let Some(domain) = self.domain_mm {
                    (x, y) = (within(x, domain[0]), within(y, domain[1]));
                }
                x * c[1] + y * c[2] + x * x * c[3] + x * y * c[4] + y * y * c[5] + c[0]
            }
        };
        let normal = site.base_from_wobj.turn(site.normal);
        out.part = out.part - normal * (mm_per_n * load.cut.dot(normal) * 1e-3);
    }
}

impl Effect for WorkpieceCompliance {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        match &mut self.mm_per_n {
            Compliance::Alike(value) => vec![scalar("mm_per_n", value, "mm/N", 3e-4, 0.0, NOT_NEGATIVE)],
            Compliance::Polynomial(values) => {
                let mut all = indexed("mm_per_n", values, "mm/N", 0.0, 0.0, ANY);
                for (number, (unit, typical)) in all.iter_mut().zip(TERMS) {
                    (number.parameter.unit, number.parameter.typical) = (unit, typical);
                }
                all
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    #[test]
    fn the_part_gives_way_along_its_normal() {
        let (_, out) = Bench::pushed(10.0, 0.0, 100.0).run("workpiece_compliance", "mm_per_n = 1e-3");
        assert_abs_diff_eq!(out.part, Vector3::new(0.0, 0.0, -1e-4), epsilon = 1e-18);
    }

    #[test]
    fn more_so_at_its_free_end() {
        // At x = 200 mm, y = 100 mm: 1e-4 + 200 · 1e-6 + 2e4 · 1e-8 = 5e-4 mm/N.
        let mut bench = Bench::pushed(0.0, 0.0, 100.0);
        bench.situation.wobj_from_tcp.translation.vector = Vector3::new(0.2, 0.1, 0.0);
        let (_, out) = bench.run("workpiece_compliance", "mm_per_n = [1e-4, 1e-6, 0, 0, 1e-8, 0]");
        assert_abs_diff_eq!(out.part.z, -5e-5, epsilon = 1e-18);
    }

    #[test]
    fn beyond_the_places_where_it_was_seen_it_stays_as_at_the_nearest() {
        let at = |x: f64, y: f64| {
            let mut bench = Bench::pushed(0.0, 0.0, 100.0);
            bench.situation.wobj_from_tcp.translation.vector = Vector3::new(1e-3 * x, 1e-3 * y, 0.0);
            let (_, out) = bench.run(
                "workpiece_compliance",
                "mm_per_n = [1e-4, 1e-6, 0, 0, 1e-8, 0]\ndomain_mm = [[-10, 200], [0, 100]]",
            );
            out.part.z
        };
        // At x = 200 mm, y = 100 mm: 5e-4 mm/N.
        assert_abs_diff_eq!(at(200.0, 100.0), -5e-5, epsilon = 1e-18);
        assert_abs_diff_eq!(at(2000.0, 150.0), -5e-5, epsilon = 1e-18);
        // At x = -10 mm, y = 0: 0.9e-4 mm/N.
        assert_abs_diff_eq!(at(-300.0, -40.0), -9e-6, epsilon = 1e-18);
    }

    #[test]
    fn a_domain_that_is_wrong_or_has_no_effect_is_refused() {
        let read = |keys: &str| (super::KIND.read)(keys.parse().unwrap()).map(drop).map_err(|error| error.to_string());
        let polynomial = "mm_per_n = [1e-4, 0, 0, 0, 0, 0]";
        assert!(read(&format!("{polynomial}\ndomain_mm = [[0, 1], [0, 1]]")).is_ok());
        let refused = |keys: &str, why: &str| assert!(read(keys).unwrap_err().contains(why), "{keys}");
        refused(&format!("{polynomial}\ndomain_mm = [[1, 0], [0, 1]]"), "the lower one first");
        refused(&format!("{polynomial}\ndomain_mm = [[0, nan], [0, 1]]"), "the lower one first");
        refused("mm_per_n = 1e-4\ndomain_mm = [[0, 1], [0, 1]]", "no effect");
    }
}
