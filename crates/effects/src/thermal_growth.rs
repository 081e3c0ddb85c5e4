//! Links and tool that grow as the robot warms up: by time from a cold start, or by measured temperature.
//!
//! Motors and gears warm the links in two steps: the gears take their heat in minutes, and the links follow. The share of their growth
//! after the time t is that of two masses in series with the time constants τ and δ,
//! `1 − (τ exp(−t/τ) − δ exp(−t/δ)) / (τ − δ)`, or `1 − exp(−t/τ)` if δ is zero. The spindle warms by its own losses, with a time
//! constant of its own.

use super::{ANY, Effect, Kind, Need, Number, Offset, Parts, Physics, Site, Survey, checked, scalar};
use deflex_lanes::{Mask, Real};
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "thermal_growth",
    summary: "links and tool grow as the robot warms up",
    forms: &[
        "tau_s = 500\ndelay_s = 100\ncolumn_mm = 0\nupper_arm_mm = 0.13\nforearm_mm = 0.1\ntool_mm = 0.02\ntool_tau_s = 200",
        "reference_c = 20\ncolumn_mm_per_k = 0.01\ntool_mm_per_k = 0.002",
    ],
    time_constant: Some("tau_s"),
    one_sign: &[
        "column_mm", "upper_arm_mm", "forearm_mm", "tool_mm", "column_mm_per_k", "upper_arm_mm_per_k",
        "forearm_mm_per_k", "tool_mm_per_k",
    ],
    parts: Parts::ROWS.and(Parts::TCP),
    read: |table| checked(ThermalGrowth::try_from(table.try_into::<Keys>()?).map_err(toml::de::Error::custom)?),
    candidates,
    ..Kind::PLAIN
};

/// Typical time constant of an arm, s; the prior mean.
const TYPICAL_TAU: f64 = 1500.0;

/// Typical time constant of a spindle, s; the prior mean.
const TYPICAL_TOOL_TAU: f64 = 300.0;

/// Growth of the column (d of row 1), the upper arm (a of row 3), the forearm (d of row 4) and of the tool along its axis.
#[derive(Clone, Debug, Serialize)]
#[serde(into = "Keys")]
pub(super) struct ThermalGrowth {
    /// Growth of column, upper arm, forearm and tool: mm when fully warm, or mm/K.
    growth: [f64; 4],
    by: By,
}

#[derive(Clone, Copy, Debug)]
enum By {
    /// By time since the start from cold.
    Time(TimeConstants),
    /// By temperature: the difference from this reference, °C.
    Temperature { reference: f64 },
}

/// How fast the robot warms up, s.
#[derive(Clone, Copy, Debug)]
struct TimeConstants {
    /// Time constant τ of the links.
    arm: f64,
    /// Time constant δ of the gears that warm the links; zero if the links warm at once.
    delay: f64,
    /// Time constant of the spindle.
    tool: f64,
}

impl TimeConstants {
    /// The share of the links' growth after a time, s.
    fn share_of_links(&self, time: f64) -> f64 {
        // Both orders of the masses give the same growth. With the slower one first, no exponential can overflow.
        let (slow, fast) = (self.arm.max(self.delay), self.arm.min(self.delay));
        let difference = time / fast - time / slow;
        let late = match difference {
            x if x.is_nan() || x == f64::INFINITY => 0.0,
            x if x > 0.0 => -(-x).exp_m1() / x,
            _ => 1.0,
        };
        1.0 - (-time / slow).exp() * (1.0 + time / slow * late)
    }

    /// The share of the tool's growth after a time, s.
    fn share_of_tool(&self, time: f64) -> f64 {
        -(-time / self.tool).exp_m1()
    }
}

/// The keys of the cell file: those by time, or those by temperature.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    #[serde(skip_serializing_if = "Option::is_none")]
    tau_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    delay_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    column_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    upper_arm_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    forearm_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tool_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tool_tau_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference_c: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    column_mm_per_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    upper_arm_mm_per_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    forearm_mm_per_k: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tool_mm_per_k: Option<f64>,
}

impl TryFrom<Keys> for ThermalGrowth {
    type Error = &'static str;

    fn try_from(keys: Keys) -> Result<Self, &'static str> {
        let by_time = [keys.column_mm, keys.upper_arm_mm, keys.forearm_mm, keys.tool_mm];
        let by_temperature = [keys.column_mm_per_k, keys.upper_arm_mm_per_k, keys.forearm_mm_per_k, keys.tool_mm_per_k];
        let given = |numbers: &[Option<f64>]| numbers.iter().any(Option::is_some);
        let growth = |numbers: [Option<f64>; 4]| numbers.map(Option::unwrap_or_default);
        match (keys.tau_s, keys.reference_c) {
            (Some(arm), None) if !given(&by_temperature) => {
                let delay = keys.delay_s.unwrap_or_default();
                let tool = keys.tool_tau_s.unwrap_or(TYPICAL_TOOL_TAU);
                Ok(Self { growth: growth(by_time), by: By::Time(TimeConstants { arm, delay, tool }) })
            }
            (None, Some(reference))
                if !given(&by_time) && !given(&[keys.delay_s, keys.tool_tau_s]) && reference.is_finite() =>
            {
                Ok(Self { growth: growth(by_temperature), by: By::Temperature { reference } })
            }
            _ => Err("expected either `tau_s` with `column_mm`, `upper_arm_mm`, `forearm_mm`, `tool_mm`, `delay_s`, \
                      `tool_tau_s`, or `reference_c` (the temperature at which the declared lengths hold) with \
                      `column_mm_per_k`, `upper_arm_mm_per_k`, `forearm_mm_per_k`, `tool_mm_per_k`"),
        }
    }
}

impl From<ThermalGrowth> for Keys {
    fn from(ThermalGrowth { growth, by }: ThermalGrowth) -> Self {
        let [column, upper_arm, forearm, tool] = growth.map(Some);
        match by {
            By::Time(constants) => Self {
                tau_s: Some(constants.arm),
                delay_s: Some(constants.delay),
                column_mm: column,
                upper_arm_mm: upper_arm,
                forearm_mm: forearm,
                tool_mm: tool,
                tool_tau_s: Some(constants.tool),
                ..Self::default()
            },
            By::Temperature { reference } => Self {
                reference_c: Some(reference),
                column_mm_per_k: column,
                upper_arm_mm_per_k: upper_arm,
                forearm_mm_per_k: forearm,
                tool_mm_per_k: tool,
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
        let arm = (0.5 * (last - first)).max(1.0);
        let by = By::Time(TimeConstants { arm, delay: 0.0, tool: TYPICAL_TOOL_TAU });
        all.push(Box::new(ThermalGrowth { growth: [0.0; 4], by }));
    }
    if let Some((reference, highest)) = survey.temperature
        && highest > reference
    {
        all.push(Box::new(ThermalGrowth { growth: [0.0; 4], by: By::Temperature { reference } }));
    }
    all
}

impl Physics for ThermalGrowth {
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        let [links, spindle] = match self.by {
            By::Time(constants) => [
                site.time.each(|time| constants.share_of_links(time)),
                site.time.each(|time| constants.share_of_tool(time)),
            ],
            By::Temperature { reference } => {
                let above = site.temperature - reference;
                // NaN means that the temperature was not measured: then there is no growth.
                let above = above.abs().lt(f64::INFINITY).select(above, R::ZERO);
                [above, above]
            }
        };
        let [column, upper_arm, forearm, tool] = self.growth.map(|growth| 1e-3 * growth);
        out.rows[0].d = out.rows[0].d + links * column;
        out.rows[2].a = out.rows[2].a + links * upper_arm;
        out.rows[3].d = out.rows[3].d + links * forearm;
        out.tcp.shift.z = out.tcp.shift.z + spindle * tool;
    }
}

impl Effect for ThermalGrowth {
    fn needs(&self) -> &'static [Need] {
        match self.by {
            By::Time(_) => &[Need::Time],
            By::Temperature { .. } => &[Need::Temperature],
        }
    }

    fn numbers(&mut self) -> Vec<Number<'_>> {
        let [column, upper_arm, forearm, tool] = &mut self.growth;
        match &mut self.by {
            // 1.9 m of steel and aluminium by 10 K: 0.2 mm and more; time constants of 10 minutes to 2 hours. Gears warm within
            // minutes. Spindles grow by 10 to 60 µm, also within minutes.
            By::Time(constants) => vec![
                scalar("tau_s", &mut constants.arm, "s", 1000.0, TYPICAL_TAU, (1.0, 1e6)),
                scalar("delay_s", &mut constants.delay, "s", 300.0, 0.0, (0.0, 1e6)),
                scalar("column_mm", column, "mm", 0.15, 0.0, ANY),
                scalar("upper_arm_mm", upper_arm, "mm", 0.15, 0.0, ANY),
                scalar("forearm_mm", forearm, "mm", 0.15, 0.0, ANY),
                scalar("tool_mm", tool, "mm", 0.04, 0.0, ANY),
                scalar("tool_tau_s", &mut constants.tool, "s", 150.0, TYPICAL_TOOL_TAU, (1.0, 1e6)),
            ],
            By::Temperature { .. } => vec![
                scalar("column_mm_per_k", column, "mm/K", 0.015, 0.0, ANY),
                scalar("upper_arm_mm_per_k", upper_arm, "mm/K", 0.015, 0.0, ANY),
                scalar("forearm_mm_per_k", forearm, "mm/K", 0.015, 0.0, ANY),
                scalar("tool_mm_per_k", tool, "mm/K", 0.004, 0.0, ANY),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn half_warm_after_ln_2_time_constants() {
        let mut bench = Bench::default();
        bench.situation.time = 500.0 * std::f64::consts::LN_2;
        let (_, out) =
            bench.run("thermal_growth", "tau_s = 500\ncolumn_mm = 0.02\nupper_arm_mm = 0.13\nforearm_mm = 0.1");
        assert_abs_diff_eq!(out.rows[0].d, 1e-5, epsilon = 1e-18);
        assert_abs_diff_eq!(out.rows[2].a, 6.5e-5, epsilon = 1e-18);
        assert_abs_diff_eq!(out.rows[3].d, 5e-5, epsilon = 1e-18);
    }

    #[test]
    fn two_masses_in_series_warm_late() {
        // With equal time constants, 1 − (1 + t/τ) exp(−t/τ): 1 − 2/e after one of them.
        let equal = TimeConstants { arm: 500.0, delay: 500.0, tool: 100.0 };
        assert_abs_diff_eq!(equal.share_of_links(500.0), 1.0 - 2.0 / std::f64::consts::E, epsilon = 1e-15);
        // With 600 s and 200 s after 600 s: 1 − (600/e − 200/e³)/400, in either order of the masses.
        let by_hand = 1.0 - (600.0 * (-1.0_f64).exp() - 200.0 * (-3.0_f64).exp()) / 400.0;
        for (arm, delay) in [(600.0, 200.0), (200.0, 600.0)] {
            let constants = TimeConstants { arm, delay, tool: 100.0 };
            assert_abs_diff_eq!(constants.share_of_links(600.0), by_hand, epsilon = 1e-15);
            assert_abs_diff_eq!(constants.share_of_links(0.0), 0.0, epsilon = 1e-15);
            assert_abs_diff_eq!(constants.share_of_links(1e9), 1.0, epsilon = 1e-15);
        }
    }

    #[test]
    fn the_tool_grows_along_its_axis() {
        let mut bench = Bench::default();
        bench.situation.time = 100.0 * std::f64::consts::LN_2;
        let (_, out) = bench.run("thermal_growth", "tau_s = 500\ntool_mm = 0.04\ntool_tau_s = 100");
        assert_abs_diff_eq!(out.tcp.shift.z, 2e-5, epsilon = 1e-18);
        assert_abs_diff_eq!(out.rows[0].d, 0.0);
    }

    #[test]
    fn five_kelvin_over_the_reference() {
        let mut bench = Bench::default();
        bench.situation.temperature = Some(25.0);
        let (_, out) = bench.run("thermal_growth", "reference_c = 20\nforearm_mm_per_k = 0.01");
        assert_abs_diff_eq!(out.rows[3].d, 5e-5, epsilon = 1e-18);
    }
}
