//! The clamped part yields where it is cut. Its stiffness follows from its shape, its material and its clamps (`[part.material]`,
//! `[[part.clamp]]`).

use super::{Deflection, Effect, FACTOR, Kind, Load, Need, Number, Parts, Physics, State, checked, scalar};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "part_stiffness",
    summary: "the declared stiffness of the clamped part is off by a factor",
    forms: &["scale = 1"],
    bends_under_load: true,
    implied_by_part: true,
    parts: Parts::PART,
    needs: &[Need::Force],
    read: |table| checked(table.try_into::<PartStiffness>()?),
    candidates: |survey| if survey.part_declared && survey.has_force { vec![super::declared_part()] } else { vec![] },
    ..Kind::PLAIN
};

/// A part of `scale` times the stiffness that follows from its shape, its material and its clamps.
///
/// A cell with `[part.material]` and no such effect has one with factor 1.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartStiffness {
    scale: f64,
}

impl PartStiffness {
    /// The part as declared.
    #[must_use]
    pub(super) fn declared() -> Self {
        Self { scale: 1.0 }
    }
}

impl Physics for PartStiffness {
    #[inline(always)]
    fn load<R: Real>(&self, _: &State<'_, R>, load: &mut Load<R>) {
        load.part_stiffness = load.part_stiffness * self.scale;
    }

    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        // What acts on the tool acts on the part the other way.
        let site = state.site;
        let force = site.base_from_wobj.turn_back(load.cut);
        let [x, y, z] = site.part.compliance;
        let shift = x * force.x + y * force.y + z * force.z;
        out.part = out.part - site.base_from_wobj.turn(shift) * R::of(1.0 / self.scale);
    }
}

impl Effect for PartStiffness {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // A modulus is known to 5 %; the stiffness of a clamping is known far less.
        vec![scalar("scale", &mut self.scale, "1", 0.2, 1.0, FACTOR)]
    }
}

#[cfg(test)]
mod tests {
    use crate::PartYield;
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use deflex_robot::Pose;
    use nalgebra::{Matrix3, Rotation3, Translation3, Vector3};

    #[test]
    fn the_part_goes_where_its_compliance_says() {
        // The work object is turned by 90° about z: 100 N along x of the base are −100 N along y of the work object. There the part
        // yields by 2 µm/N along y and 1 µm/N along x: under the opposite force, by +0.2 mm along y and +0.1 mm along x of the
        // work object, which are −x and +y of the base. Half as stiff, twice as much.
        let mut bench = Bench::pushed(100.0, 0.0, 0.0);
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        bench.situation.base_from_wobj = Pose::from_parts(Translation3::identity(), turned);
        bench.part = Some(PartYield::held_as_declared(Matrix3::new(4e-6, 1e-6, 0.0, 1e-6, 2e-6, 0.0, 0.0, 0.0, 3e-6)));
        let (_, out) = bench.run("part_stiffness", "scale = 0.5");
        assert_abs_diff_eq!(out.part, 2.0 * Vector3::new(-2e-4, 1e-4, 0.0), epsilon = 1e-18);
    }

    #[test]
    fn without_a_declared_part_nothing_yields() {
        let (_, out) = Bench::pushed(100.0, 0.0, 0.0).run("part_stiffness", "scale = 1.0");
        assert_eq!(out.part, Vector3::zeros());
    }
}
