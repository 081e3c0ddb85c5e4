//! A workpiece or fixture that yields along the surface normal: thin walls, soft clamps.

use super::{
    ANY, Deflection, Effect, Kind, Load, NOT_NEGATIVE, Need, Parameter, Parts, Physics, State, checked, indexed,
    scalar, table_of, take,
};
use crate::lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "workpiece_compliance",
    summary: "the workpiece or its fixture yields",
    forms: &["mm_per_n = 1e-4", "mm_per_n = [1e-4, 0, 0, 1e-9, 0, 1e-9]"],
    bends_under_load: true,
    read: |table| checked(table.try_into::<WorkpieceCompliance>()?),
    candidates: |survey| {
        if !survey.has_force {
            return vec![];
        }
        let alike = WorkpieceCompliance { mm_per_n: Compliance::Alike(0.0) };
        let varying = WorkpieceCompliance { mm_per_n: Compliance::Polynomial([0.0; 6]) };
        vec![Box::new(alike), Box::new(varying)]
    },
    ..Kind::PLAIN
};

/// The tool's force F pushes the part by −c (F·n) along its normal n, so that the tool stands c (F·n) too far out.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WorkpieceCompliance {
    mm_per_n: Compliance,
}

/// Compliance along the normal, mm/N.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number, or six: the coefficients of 1, x, y, x², xy, y² with x and y in mm")]
enum Compliance {
    /// The same everywhere.
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

impl Physics for WorkpieceCompliance {
    fn parts(&self) -> Parts {
        Parts::PART
    }

    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let site = state.site;
        let mm_per_n = match &self.mm_per_n {
            Compliance::Alike(compliance) => R::of(*compliance),
            Compliance::Polynomial(c) => {
                let (x, y) = (site.wanted.x * 1e3, site.wanted.y * 1e3);
                x * c[1] + y * c[2] + x * x * c[3] + x * y * c[4] + y * y * c[5] + c[0]
            }
        };
        let normal = site.base_from_wobj.turn(site.normal);
        out.part = out.part - normal * (mm_per_n * load.cut.dot(normal) * 1e-3);
    }
}

impl Effect for WorkpieceCompliance {
    fn needs(&self) -> &'static [Need] {
        &[Need::Force]
    }

    fn parameters(&self) -> Vec<Parameter> {
        match &self.mm_per_n {
            Compliance::Alike(value) => vec![scalar("mm_per_n", *value, "mm/N", 3e-4, 0.0, NOT_NEGATIVE)],
            Compliance::Polynomial(values) => {
                let mut all = indexed("mm_per_n", values, "mm/N", 0.0, 0.0, ANY);
                for (parameter, (unit, typical)) in all.iter_mut().zip(TERMS) {
                    (parameter.unit, parameter.typical) = (unit, typical);
                }
                all
            }
        }
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        let mm_per_n = match self.mm_per_n {
            Compliance::Alike(_) => {
                let [value] = take(&mut values);
                Compliance::Alike(value)
            }
            Compliance::Polynomial(_) => Compliance::Polynomial(take(&mut values)),
        };
        Box::new(Self { mm_per_n })
    }

    fn to_table(&self) -> toml::Table {
        table_of(KIND.name, self)
    }
}

#[cfg(test)]
mod tests {
    use crate::effects::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    #[test]
    fn the_part_gives_way_along_its_normal() {
        let (_, out) = Bench::pushed(10.0, 0.0, 100.0).run(
            r#"kind = "workpiece_compliance"
            mm_per_n = 1e-3"#,
        );
        assert_abs_diff_eq!(out.part, Vector3::new(0.0, 0.0, -1e-4), epsilon = 1e-18);
    }

    #[test]
    fn more_so_at_its_free_end() {
        // At x = 200 mm, y = 100 mm: 1e-4 + 200 · 1e-6 + 2e4 · 1e-8 = 5e-4 mm/N.
        let mut bench = Bench::pushed(0.0, 0.0, 100.0);
        bench.situation.wobj_from_tcp.translation.vector = Vector3::new(0.2, 0.1, 0.0);
        let (_, out) = bench.run(
            r#"kind = "workpiece_compliance"
            mm_per_n = [1e-4, 1e-6, 0, 0, 1e-8, 0]"#,
        );
        assert_abs_diff_eq!(out.part.z, -5e-5, epsilon = 1e-18);
    }
}
