//! A work object that is not where it was declared. A base that is not where it was declared looks the same.

use super::{ANY, Effect, Kind, Number, Offset, Parts, Physics, Site, checked, per_direction};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "work_object_frame",
    summary: "the work object (or the base) is not where it was declared",
    forms: &["d_rad = [0, 0, 1e-4]"],
    like_device_frame: true,
    parts: Parts::WOBJ,
    read: |table| checked(table.try_into::<WorkObjectFrame>()?),
    candidates: |_| vec![Box::new(WorkObjectFrame::default())],
    ..Kind::PLAIN
};

/// Actual work object = declared work object ∘ (d).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct WorkObjectFrame {
    d_mm: [f64; 3],
    /// Rotation vector, rad.
    d_rad: [f64; 3],
}

impl Physics for WorkObjectFrame {
    #[inline(always)]
    fn offset<R: Real>(&self, _: &Site<R>, out: &mut Offset<R>) {
        out.wobj.add_mm(self.d_mm, self.d_rad);
    }
}

impl Effect for WorkObjectFrame {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        let mut all = per_direction("d_mm", &mut self.d_mm, "mm", 0.3, 0.0, ANY);
        all.extend(per_direction("d_rad", &mut self.d_rad, "rad", 5e-4, 0.0, ANY));
        all
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn millimetres_and_radians() {
        let (_, out) = Bench::default().run("work_object_frame", "d_mm = [0.1, 0, -0.3]\nd_rad = [0, 2e-3, 0]");
        assert_abs_diff_eq!(out.wobj.shift, nalgebra::Vector3::new(1e-4, 0.0, -3e-4), epsilon = 1e-18);
        assert_abs_diff_eq!(out.wobj.turn.y, 2e-3);
    }
}
