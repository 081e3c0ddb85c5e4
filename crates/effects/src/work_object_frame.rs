//! A work object that is not where it was declared. A base that is not where it was declared looks the same.

use super::{ANY, Effect, Kind, Offset, Parameter, Parts, Physics, Site, checked, per_direction, take};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "work_object_frame",
    summary: "the work object (or the base) is not where it was declared",
    forms: &["d_rad = [0, 0, 1e-4]"],
    like_device_frame: true,
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
    fn parts(&self) -> Parts {
        Parts::WOBJ
    }

    #[inline(always)]
    fn offset<R: Real>(&self, _: &Site<R>, out: &mut Offset<R>) {
        out.wobj.add_mm(self.d_mm, self.d_rad);
    }
}

impl Effect for WorkObjectFrame {
    fn parameters(&self) -> Vec<Parameter> {
        let mut all = per_direction("d_mm", &self.d_mm, "mm", 0.3, 0.0, ANY);
        all.extend(per_direction("d_rad", &self.d_rad, "rad", 5e-4, 0.0, ANY));
        all
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        Box::new(Self { d_mm: take(&mut values), d_rad: take(&mut values) })
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn millimetres_and_radians() {
        let (_, out) = Bench::default().run(
            r#"kind = "work_object_frame"
            d_mm = [0.1, 0, -0.3]
            d_rad = [0, 2e-3, 0]"#,
        );
        assert_abs_diff_eq!(out.wobj.shift, nalgebra::Vector3::new(1e-4, 0.0, -3e-4), epsilon = 1e-18);
        assert_abs_diff_eq!(out.wobj.turn.y, 2e-3);
    }
}
