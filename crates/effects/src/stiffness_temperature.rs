//! Joint stiffness that falls as the gears warm up.

use super::{Deflection, Effect, Kind, Load, Need, Number, Physics, State, Survey, checked, per_axis};
use deflex_lanes::{Mask, Real};
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "stiffness_temperature",
    summary: "joint stiffness falls with temperature",
    forms: &["per_k = [2e-3, 0, 1e-3, 0, 0, 0]\nreference_c = 20"],
    bends_under_load: true,
    needs: &[Need::Stiffness, Need::Temperature],
    read,
    candidates,
    ..Kind::PLAIN
};

/// Largest share of a joint's stiffness that is lost per kelvin, 1/K: no gear loses more.
const MOST_PER_K: f64 = 0.05;

/// k(T) = (1 − per_k · (T − reference)) · k, with the declared stiffness k at the reference temperature.
///
/// The declared spring stays in the cell; this effect adds the additional deflection of the warm spring.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StiffnessTemperature {
    per_k: [f64; 6],
    reference_c: f64,
}

fn read(table: toml::Table) -> Result<Box<dyn Effect>, toml::de::Error> {
    let effect: StiffnessTemperature = table.try_into()?;
    if !effect.reference_c.is_finite() {
        return Err(Error::custom(format!(
            "`reference_c` is {}, expected a finite temperature, °C",
            effect.reference_c
        )));
    }
    checked(effect)
}

fn candidates(survey: &Survey) -> Vec<Box<dyn Effect>> {
    match survey.temperature {
        Some((lowest, highest)) if highest > lowest && survey.stiffness_declared => {
            vec![Box::new(StiffnessTemperature { per_k: [0.0; 6], reference_c: lowest })]
        }
        _ => vec![],
    }
}

impl Physics for StiffnessTemperature {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let Some(stiffness) = state.stiffness else { return };
        let above = state.site.temperature - self.reference_c;
        // NaN means that the temperature was not measured: then there is no warming.
        let above = above.abs().lt(f64::INFINITY).select(above, R::ZERO);
        for i in 0..6 {
            let softer = above * self.per_k[i];
            let left = R::of(1.0) - softer;
            // Where nothing of the stiffness remains there is no equilibrium.
            let beyond = R::ZERO.lt(left).select(softer / left, R::of(f64::NAN));
            out.joints[i] = out.joints[i] + load.torque[i] * (1.0 / stiffness[i]) * beyond;
        }
    }
}

impl Effect for StiffnessTemperature {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // Grease and preload: some per cent over 20 K.
        per_axis("per_k", &mut self.per_k, "1/K", 3e-3, 0.0, (0.0, MOST_PER_K))
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    const WARM: &str = "per_k = [0.01, 0, 0, 0, 0, 0]\nreference_c = 20";

    #[test]
    fn a_fifth_softer_after_twenty_kelvin() {
        // 159.3 N·m on 0.8e6 instead of 1e6 N·m/rad: a quarter of 1.593e-4 rad more.
        let mut bench = Bench::pushed(0.0, 100.0, 0.0);
        bench.situation.temperature = Some(40.0);
        assert_abs_diff_eq!(bench.run("stiffness_temperature", WARM).1.joints[0], 0.25 * 1.593e-4, epsilon = 1e-16);
        // Not measured: as declared.
        bench.situation.temperature = None;
        assert_abs_diff_eq!(bench.run("stiffness_temperature", WARM).1.joints[0], 0.0);
    }

    #[test]
    fn a_spring_that_is_gone_gives_no_answer() {
        let mut bench = Bench::pushed(0.0, 100.0, 0.0);
        bench.situation.temperature = Some(130.0);
        assert!(bench.run("stiffness_temperature", WARM).1.joints[0].is_nan());
    }
}
