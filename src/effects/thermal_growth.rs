//! Links that grow as the robot warms up: by time from a cold start, or by measured temperature.

use super::{ANY, Effect, Kind, Need, Offset, Parameter, Parts, Physics, Site, Survey, checked, scalar, take};
use crate::lanes::{Mask, Real};
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "thermal_growth",
    summary: "links grow as the robot warms up",
    forms: &[
        "tau_s = 500\ncolumn_mm = 0\nupper_arm_mm = 0.13\nforearm_mm = 0.1",
        "reference_c = 20\ncolumn_mm_per_k = 0.01",
    ],
    time_constant: Some("tau_s"),
    one_sign: &["column_mm", "upper_arm_mm", "forearm_mm", "column_mm_per_k", "upper_arm_mm_per_k", "forearm_mm_per_k"],
    read: |table| checked(ThermalGrowth::try_from(table.try_into::<Keys>()?).map_err(toml::de::Error::custom)?),
    candidates,
    ..Kind::PLAIN
};

/// Typical time constant of an arm, s; the prior mean.
const TYPICAL_TAU: f64 = 1500.0;

/// Growth of the column (d of row 1), the upper arm (a of row 3) and the forearm (d of row 4).
#[derive(Clone, Debug, Serialize)]
#[serde(into = "Keys")]
pub(super) struct ThermalGrowth {
    /// Growth of column, upper arm and forearm: mm when fully warm, or mm/K.
    growth: [f64; 3],
    by: By,
}

#[derive(Clone, Copy, Debug)]
enum By {
    /// By time: the share 1 − exp(−t/τ) of the growth, with the time constant τ, s.
    Time { tau: f64 },
    /// By temperature: the difference from this reference, °C.
    Temperature { reference: f64 },
}

/// The keys of the cell file: those by time, or those by temperature.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    #[serde(skip_serializing_if = "Option::is_none")]
    tau_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    column_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    upper_arm_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    forearm_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference_c: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    column_mm_per_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    upper_arm_mm_per_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    forearm_mm_per_k: Option<f64>,
}

impl TryFrom<Keys> for ThermalGrowth {
    type Error = &'static str;

    fn try_from(keys: Keys) -> Result<Self, &'static str> {
        let by_time = [keys.column_mm, keys.upper_arm_mm, keys.forearm_mm];
        let by_temperature = [keys.column_mm_per_k, keys.upper_arm_mm_per_k, keys.forearm_mm_per_k];
        let given = |growth: [Option<f64>; 3]| growth.iter().any(Option::is_some);
        match (keys.tau_s, keys.reference_c) {
            (Some(tau), None) if !given(by_temperature) => {
                Ok(Self { growth: by_time.map(Option::unwrap_or_default), by: By::Time { tau } })
            }
            (None, Some(reference)) if !given(by_time) && reference.is_finite() => {
                Ok(Self { growth: by_temperature.map(Option::unwrap_or_default), by: By::Temperature { reference } })
            }
            _ => Err("expected either `tau_s` with `column_mm`, `upper_arm_mm`, `forearm_mm`, or `reference_c` (the \
                      temperature at which the declared lengths hold) with `column_mm_per_k`, `upper_arm_mm_per_k`, \
                      `forearm_mm_per_k`"),
        }
    }
}

impl From<ThermalGrowth> for Keys {
    fn from(ThermalGrowth { growth, by }: ThermalGrowth) -> Self {
        let [column, upper_arm, forearm] = growth.map(Some);
        match by {
            By::Time { tau } => Self {
                tau_s: Some(tau),
                column_mm: column,
                upper_arm_mm: upper_arm,
                forearm_mm: forearm,
                ..Self::default()
            },
            By::Temperature { reference } => Self {
                reference_c: Some(reference),
                column_mm_per_k: column,
                upper_arm_mm_per_k: upper_arm,
                forearm_mm_per_k: forearm,
                ..Self::default()
            },
        }
    }
}

fn candidates(survey: &Survey) -> Vec<Box<dyn Effect>> {
    let mut all: Vec<Box<dyn Effect>> = Vec::new();
    if let Some((first, last)) = survey.time
        && last > first
    {
        // Where the search of the time constant starts.
        let tau = (0.5 * (last - first)).max(1.0);
        all.push(Box::new(ThermalGrowth { growth: [0.0; 3], by: By::Time { tau } }));
    }
    if let Some((reference, highest)) = survey.temperature
        && highest > reference
    {
        all.push(Box::new(ThermalGrowth { growth: [0.0; 3], by: By::Temperature { reference } }));
    }
    all
}

impl Physics for ThermalGrowth {
    fn parts(&self) -> Parts {
        Parts::ROWS
    }

    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        let share = match self.by {
            By::Time { tau } => site.time.each(|time| -(-time / tau).exp_m1()),
            By::Temperature { reference } => {
                let above = site.temperature - reference;
                // NaN means that the temperature was not measured: then there is no growth.
                above.abs().lt(f64::INFINITY).select(above, R::ZERO)
            }
        };
        let [column, upper_arm, forearm] = self.growth.map(|growth| share * (1e-3 * growth));
        out.rows[0].d = out.rows[0].d + column;
        out.rows[2].a = out.rows[2].a + upper_arm;
        out.rows[3].d = out.rows[3].d + forearm;
    }
}

impl Effect for ThermalGrowth {
    fn needs(&self) -> &'static [Need] {
        match self.by {
            By::Time { .. } => &[Need::Time],
            By::Temperature { .. } => &[Need::Temperature],
        }
    }

    fn parameters(&self) -> Vec<Parameter> {
        let [column, upper_arm, forearm] = self.growth;
        match self.by {
            // 1.9 m of steel and aluminium by 10 K: 0.2 mm and more; time constants of 10 minutes to 2 hours.
            By::Time { tau } => vec![
                scalar("tau_s", tau, "s", 1000.0, TYPICAL_TAU, (1.0, 1e6)),
                scalar("column_mm", column, "mm", 0.15, 0.0, ANY),
                scalar("upper_arm_mm", upper_arm, "mm", 0.15, 0.0, ANY),
                scalar("forearm_mm", forearm, "mm", 0.15, 0.0, ANY),
            ],
            By::Temperature { .. } => vec![
                scalar("column_mm_per_k", column, "mm/K", 0.015, 0.0, ANY),
                scalar("upper_arm_mm_per_k", upper_arm, "mm/K", 0.015, 0.0, ANY),
                scalar("forearm_mm_per_k", forearm, "mm/K", 0.015, 0.0, ANY),
            ],
        }
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        let by = match self.by {
            By::Time { .. } => {
                let [tau] = take(&mut values);
                By::Time { tau }
            }
            temperature @ By::Temperature { .. } => temperature,
        };
        Box::new(Self { growth: take(&mut values), by })
    }
}

#[cfg(test)]
mod tests {
    use crate::effects::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn half_warm_after_ln_2_time_constants() {
        let mut bench = Bench::default();
        bench.situation.time = 500.0 * std::f64::consts::LN_2;
        let (_, out) = bench.run(
            r#"kind = "thermal_growth"
            tau_s = 500
            column_mm = 0.02
            upper_arm_mm = 0.13
            forearm_mm = 0.1"#,
        );
        assert_abs_diff_eq!(out.rows[0].d, 1e-5, epsilon = 1e-18);
        assert_abs_diff_eq!(out.rows[2].a, 6.5e-5, epsilon = 1e-18);
        assert_abs_diff_eq!(out.rows[3].d, 5e-5, epsilon = 1e-18);
    }

    #[test]
    fn five_kelvin_over_the_reference() {
        let mut bench = Bench::default();
        bench.situation.temperature = Some(25.0);
        let (_, out) = bench.run(
            r#"kind = "thermal_growth"
            reference_c = 20
            forearm_mm_per_k = 0.01"#,
        );
        assert_abs_diff_eq!(out.rows[3].d, 5e-5, epsilon = 1e-18);
    }
}
