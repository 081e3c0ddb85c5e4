//! Wrong zero positions of joints: resolvers synchronised at the wrong angle.

use super::{ANY, Covered, Effect, Kind, Number, Offset, Physics, Site, checked, per_axis};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "zero_offset",
    summary: "joint zero positions are off",
    forms: &["offset_rad = [0, 3e-4, 0, 0, -5e-4, 0]"],
    nested_in: &[super::link_geometry::KIND.name],
    locally_like: &[super::joint_error_curve::KIND.name],
    is_joint_constant: true,
    stage: super::Stage::JointZeros,
    covered_by: Some(Covered::Geometry),
    read: |table| checked(table.try_into::<ZeroOffset>()?),
    candidates: |_| vec![Box::new(ZeroOffset { offset_rad: [0.0; 6] })],
    ..Kind::PLAIN
};

/// Actual = commanded + offset.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ZeroOffset {
    offset_rad: [f64; 6],
}

impl Physics for ZeroOffset {
    #[inline(always)]
    fn offset<R: Real>(&self, _: &Site<R>, out: &mut Offset<R>) {
        for i in 0..6 {
            out.joints[i] = out.joints[i] + self.offset_rad[i];
        }
    }
}

impl Effect for ZeroOffset {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        per_axis("offset_rad", &mut self.offset_rad, "rad", 3e-4, 0.0, ANY)
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn offsets_add() {
        let (_, out) = Bench::default().run("zero_offset", "offset_rad = [0, 3e-4, 0, 0, -5e-4, 0]");
        assert_abs_diff_eq!(out.joints[1], 3e-4);
        assert_abs_diff_eq!(out.joints[4], -5e-4);
    }
}
