//! The arm trails the command at speed.

use super::{Effect, Kind, NOT_NEGATIVE, Need, Offset, Parameter, Parts, Physics, Site, checked, scalar, take};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "tracking_lag",
    summary: "the arm trails the command at speed",
    forms: &["time_s = 0.002"],
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
    fn parts(&self) -> Parts {
        Parts::LAG
    }

    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        out.lag = out.lag - site.base_from_wobj.turn(site.velocity) * R::of(self.time_s);
    }
}

impl Effect for TrackingLag {
    fn needs(&self) -> &'static [Need] {
        &[Need::Speed]
    }

    fn parameters(&self) -> Vec<Parameter> {
        // 1 to 5 ms: 0.02 to 0.25 mm at 20 to 50 mm/s.
        vec![scalar("time_s", self.time_s, "s", 3e-3, 0.0, NOT_NEGATIVE)]
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        let [time_s] = take(&mut values);
        Box::new(Self { time_s })
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
        let (_, out) = bench.run(
            r#"kind = "tracking_lag"
            time_s = 5e-3"#,
        );
        assert_abs_diff_eq!(out.lag, Vector3::new(-1e-4, 0.0, 0.0), epsilon = 1e-18);
    }
}
