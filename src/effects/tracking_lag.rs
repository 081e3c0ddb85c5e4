//! The arm trails the command at speed.

use super::{Distortion, Effect, Kind, Load, NOT_NEGATIVE, Need, Parameter, State, checked, scalar, table_of, take};
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "tracking_lag",
    summary: "the arm trails the command at speed",
    read: |table| checked(table.try_into::<TrackingLag>()?),
    candidates: |survey| if survey.has_speed { vec![Box::new(TrackingLag { time_s: 0.0 })] } else { vec![] },
};

/// Actual = commanded − velocity · time.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TrackingLag {
    time_s: f64,
}

impl Effect for TrackingLag {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn distort(&self, state: &State, _: &Load, out: &mut Distortion) {
        let situation = state.situation;
        out.lag -= self.time_s * (situation.base_from_wobj.rotation * situation.velocity);
    }

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

    fn to_table(&self) -> toml::Table {
        table_of(KIND.name, self)
    }
}
