//! A mechanical unit that is not where it was declared. The robot or the part on it is displaced with it.

use super::{ANY, Effect, Kind, Number, Offset, Parts, Physics, Site, Survey, checked, per_direction, unit_key};
use deflex_lanes::{Frame, Real, Vector};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "unit_frame",
    summary: "a track or a positioner is not where it was declared",
    forms: &["unit = 'STN1'\nd_rad = [0, 0, 1e-4]", "unit = 'TRACK1'\nd_mm = [0.1, 0, 0]"],
    parts: Parts::WOBJ,
    read: |table| checked(table.try_into::<UnitFrame>()?),
    candidates,
    ..Kind::PLAIN
};

/// Candidates for units that move. A unit that stands still is displaced like a work object or a base.
fn candidates(survey: &Survey) -> Vec<Box<dyn Effect>> {
    let of = |unit: &String| -> Box<dyn Effect> {
        Box::new(UnitFrame { unit: unit.clone(), d_mm: [0.0; 3], d_rad: [0.0; 3] })
    };
    survey.moving_units.iter().map(of).collect()
}

/// Actual frame at position zero = declared frame ∘ (d), relative to what the unit stands on.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct UnitFrame {
    unit: String,
    #[serde(default)]
    d_mm: [f64; 3],
    /// Rotation vector, rad.
    #[serde(default)]
    d_rad: [f64; 3],
}

impl Physics for UnitFrame {
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        let key = unit_key(&self.unit);
        for unit in site.units.iter().filter(|unit| unit.key == key) {
            let at = &unit.wobj_from_unit;
            let shift = at.turn(Vector::of(&(Vector3::from(self.d_mm) * 1e-3)));
            let turn = at.turn(Vector::of(&Vector3::from(self.d_rad)));
            // X D X⁻¹ of the part, with X from the unit to the work object; its inverse where the unit carries the robot.
            let turned = Frame::of_rotation_vector(turn);
            let part = shift + at.origin - turned.turn(at.origin);
            let robot = at.origin - turned.turn_back(at.origin + shift);
            out.wobj.shift = out.wobj.shift + part * unit.part + robot * unit.robot;
            out.wobj.turn = out.wobj.turn + turn * (unit.part - unit.robot);
        }
    }
}

impl Effect for UnitFrame {
    fn unit(&self) -> Option<&str> {
        Some(&self.unit)
    }

    fn numbers(&mut self) -> Vec<Number<'_>> {
        let mut all = per_direction("d_mm", &mut self.d_mm, "mm", 0.5, 0.0, ANY);
        all.extend(per_direction("d_rad", &mut self.d_rad, "rad", 5e-4, 0.0, ANY));
        all
    }
}
