//! The arm trails the command at speed.

use super::{Effect, Kind, NOT_NEGATIVE, Need, Number, Offset, Parts, Physics, Site, checked, scalar};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "tracking_lag",
    summary: "the arm trails the command at speed",
    forms: &["time_s = 0.002"],
    parts: Parts::LAG,
    needs: &[Need::Speed],
    read: |table| checked(table.try_into::<TrackingLag>()?),
    candidates: |survey| if survey.has_speed { vec![Box::new(TrackingLag { time_s: 0.0 })] } else { vec![] },
    ..Kind::PLAIN
};

/// Actual = commanded − velocity · time.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TrackingLag {
    time_s: f64,
}

impl Physics for TrackingLag {
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        out.lag = out.lag - site.base_from_wobj.turn(site.velocity) * R::of(self.time_s);
    }
}

impl Effect for TrackingLag {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // 1 to 5 ms: 0.02 to 0.25 mm at 20 to 50 mm/s.
        vec![scalar("time_s", &mut self.time_s, "s", 3e-3, 0.0, NOT_NEGATIVE)]
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    #[test]
    fn five_milliseconds_at_20_mm_a_second() {
        let mut bench = Bench::default();
        bench.situation.velocity = Vector3::new(0.02, 0.0, 0.0);
        let (_, out) = bench.run("tracking_lag", "time_s = 5e-3");
        assert_abs_diff_eq!(out.lag, Vector3::new(-1e-4, 0.0, 0.0), epsilon = 1e-18);
    }
}
