//! Errors of the lengths, offsets and twists of the links (modified Denavit-Hartenberg rows).

use super::{ANY, Covered, Effect, Kind, Number, Offset, Parts, Physics, Site, checked, per_axis};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "link_geometry",
    summary: "link lengths, offsets and twists differ from the drawing",
    forms: &["d_a_mm = [0, 0, 0.1, 0, 0, 0]"],
    locally_like: &[super::joint_error_curve::KIND.name],
    stage: super::Stage::Links,
    parts: Parts::ROWS,
    covered_by: Some(Covered::Geometry),
    read: |table| checked(table.try_into::<LinkGeometry>()?),
    candidates: |_| vec![Box::new(LinkGeometry::default())],
    ..Kind::PLAIN
};

/// Numbers that are added to the rows. Where two axes are parallel, some of them have the same effect, and a fit finds only their sum.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct LinkGeometry {
    d_alpha_rad: [f64; 6],
    d_a_mm: [f64; 6],
    d_d_mm: [f64; 6],
    d_theta_rad: [f64; 6],
}

impl Physics for LinkGeometry {
    #[inline(always)]
    fn offset<R: Real>(&self, _: &Site<R>, out: &mut Offset<R>) {
        for (i, row) in out.rows.iter_mut().enumerate() {
            row.alpha = row.alpha + self.d_alpha_rad[i];
            row.a = row.a + 1e-3 * self.d_a_mm[i];
            row.d = row.d + 1e-3 * self.d_d_mm[i];
            row.theta = row.theta + self.d_theta_rad[i];
        }
    }
}

impl Effect for LinkGeometry {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // 0.3 to 1 mm at the TCP of an uncalibrated arm.
        let mut all = per_axis("d_alpha_rad", &mut self.d_alpha_rad, "rad", 2e-4, 0.0, ANY);
        all.extend(per_axis("d_a_mm", &mut self.d_a_mm, "mm", 0.2, 0.0, ANY));
        all.extend(per_axis("d_d_mm", &mut self.d_d_mm, "mm", 0.2, 0.0, ANY));
        all.extend(per_axis("d_theta_rad", &mut self.d_theta_rad, "rad", 2e-4, 0.0, ANY));
        all
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn rows_differ_in_metres() {
        let (_, out) =
            Bench::default().run("link_geometry", "d_a_mm = [0, 0, 0.5, 0, 0, 0]\nd_theta_rad = [0, 0, 0, 0, 0, 1e-3]");
        assert_abs_diff_eq!(out.rows[2].a, 5e-4, epsilon = 1e-18);
        assert_abs_diff_eq!(out.rows[5].theta, 1e-3);
    }
}
