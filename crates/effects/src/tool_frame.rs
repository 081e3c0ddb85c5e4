//! A TCP that was taught or measured wrongly.

use super::{ANY, Effect, Kind, Number, Offset, Parts, Physics, Site, checked, per_direction};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "tool_frame",
    summary: "the TCP is not where tooldata says",
    forms: &["d_mm = [0.1, 0, 0]"],
    stage: super::Stage::ToolFrame,
    parts: Parts::TCP,
    read: |table| checked(table.try_into::<ToolFrameError>()?),
    candidates: |_| vec![Box::new(ToolFrameError::default())],
    ..Kind::PLAIN
};

/// Actual TCP = declared TCP ∘ (d), in the declared tool frame.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ToolFrameError {
    d_mm: [f64; 3],
    /// Rotation vector, rad.
    d_rad: [f64; 3],
}

impl Physics for ToolFrameError {
    #[inline(always)]
    fn offset<R: Real>(&self, _: &Site<R>, out: &mut Offset<R>) {
        out.tcp.add_mm(self.d_mm, self.d_rad);
    }
}

impl Effect for ToolFrameError {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        let mut all = per_direction("d_mm", &mut self.d_mm, "mm", 0.2, 0.0, ANY);
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
        let (_, out) = Bench::default().run("tool_frame", "d_mm = [0.1, 0, -0.3]\nd_rad = [0, 2e-3, 0]");
        assert_abs_diff_eq!(out.tcp.shift, nalgebra::Vector3::new(1e-4, 0.0, -3e-4), epsilon = 1e-18);
        assert_abs_diff_eq!(out.tcp.turn.y, 2e-3);
    }
}
