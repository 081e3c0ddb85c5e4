//! A hose or cable package that pulls on the forearm.

use super::{ANY, Effect, Kind, Load, NOT_NEGATIVE, Need, Number, Parts, Physics, State, Survey, scalar};
use deflex_lanes::{Mask, Real, Vector};
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "cable_pull",
    summary: "a hose or cable package pulls on the forearm",
    forms: &[
        "stiffness_n_per_m = 300\nrest_mm = 600\nfrom_mm = [-300, 200, 300]\nfrom_link = 0\nto_mm = [50, 100, 0]\nto_link = 3",
    ],
    parts: Parts::WEIGHTS,
    needs: &[Need::Stiffness],
    read,
    candidates,
    ..Kind::PLAIN
};

/// Below this distance of its ends, m, the spring has no direction and pulls with no force.
const NO_LENGTH: f64 = 1e-9;

/// A spring between a point on the base or the column and a point on the forearm. It pulls with stiffness · (length − rest) along its
/// own direction, and with no force where it is shorter than at rest.
///
/// The two points have to be declared: position errors at some poses cannot determine them.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CablePull {
    stiffness_n_per_m: f64,
    rest_mm: f64,
    /// Point where it is fastened, mm, in the frame of `from_link`.
    from_mm: [f64; 3],
    /// The link that carries this point: 0 (base) or 1 (column).
    from_link: usize,
    /// The other point, mm, in the frame of `to_link`.
    to_mm: [f64; 3],
    /// The link that carries this point: 3 or 4 (forearm).
    to_link: usize,
}

fn read(table: toml::Table) -> Result<Box<dyn Effect>, toml::de::Error> {
    let effect: CablePull = table.try_into()?;
    let [from, to] = [effect.from_mm, effect.to_mm];
    let finite = from.iter().chain(&to).all(|mm| mm.is_finite());
    let at_least_zero = |value: f64| value.is_finite() && value >= 0.0;
    if !finite || !at_least_zero(effect.stiffness_n_per_m) || !at_least_zero(effect.rest_mm) {
        return Err(Error::custom(
            "`stiffness_n_per_m` and `rest_mm` are finite and not negative, `from_mm` and `to_mm` are finite",
        ));
    }
    if effect.from_link > 1 || !(3..=4).contains(&effect.to_link) {
        let (from, to) = (effect.from_link, effect.to_link);
        return Err(Error::custom(format!("from link {from} to link {to}: expected from 0 or 1 to 3 or 4")));
    }
    Ok(Box::new(effect))
}

/// No candidates: the data cannot show where a cable is fastened. A declared one is fitted again.
fn candidates(_: &Survey) -> Vec<Box<dyn Effect>> {
    Vec::new()
}

fn metres<R: Real>(mm: &[f64; 3]) -> Vector<R> {
    Vector::of(&(nalgebra::Vector3::from(*mm) * 1e-3))
}

impl Physics for CablePull {
    #[inline(always)]
    fn load<R: Real>(&self, state: &State<'_, R>, load: &mut Load<R>) {
        let links = &state.chain.links;
        let from = metres(&self.from_mm);
        let from = if self.from_link == 0 { from } else { links[self.from_link - 1].point(from) };
        let to = links[self.to_link - 1].point(metres(&self.to_mm));
        let along = from - to;
        let length = along.dot(along).sqrt();
        let tension = (length - 1e-3 * self.rest_mm) * self.stiffness_n_per_m;
        let taut = R::ZERO.lt(tension) & R::of(NO_LENGTH).lt(length);
        let pull = along * taut.select(tension / length, R::ZERO);
        load.links[self.to_link - 1].add_force(pull, to);
        if self.from_link > 0 {
            load.links[self.from_link - 1].add_force(-pull, from);
        }
    }
}

impl Effect for CablePull {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        let rest_mm = self.rest_mm;
        vec![
            scalar("stiffness_n_per_m", &mut self.stiffness_n_per_m, "N/m", 300.0, 0.0, NOT_NEGATIVE),
            // At zero stiffness the rest length has no effect, so any value is neutral.
            scalar("rest_mm", &mut self.rest_mm, "mm", 100.0, rest_mm, ANY),
        ]
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    fn cable(rest_mm: f64, from: &str) -> String {
        // The origin of link 4 is the wrist centre: (1.193, 0, 1.7945) m at zero angles.
        format!("stiffness_n_per_m = 1000\nrest_mm = {rest_mm}\n{from}\nto_mm = [0, 0, 0]\nto_link = 4")
    }

    #[test]
    fn a_hose_from_the_base_pulls_the_wrist_straight_down() {
        // Fastened below the wrist, 1.7945 m long, at rest 1.5945 m: 200 N down, 0.893 m in front of axis 3.
        let (load, _) = Bench::default().run("cable_pull", &cable(1594.5, "from_mm = [1193, 0, 0]\nfrom_link = 0"));
        let (weight, _) = Bench::default().run("gravity", "mass_kg = [0, 0, 0, 20, 0, 0]");
        assert_abs_diff_eq!(load.torque, weight.torque, epsilon = 1e-9);
        assert!(load.torque[2].abs() > 100.0, "{:?}", load.torque);
    }

    #[test]
    fn a_slack_hose_does_nothing() {
        let (load, _) = Bench::default().run("cable_pull", &cable(2000.0, "from_mm = [1193, 0, 0]\nfrom_link = 0"));
        assert_abs_diff_eq!(load.torque.iter().map(|t| t.abs()).sum::<f64>(), 0.0);
    }

    #[test]
    fn what_pulls_on_the_column_leaves_axis_1_alone() {
        let aside = "from_mm = [0, 500, 0]";
        let (base, _) = Bench::default().run("cable_pull", &cable(100.0, &format!("{aside}\nfrom_link = 0")));
        let (column, _) = Bench::default().run("cable_pull", &cable(100.0, &format!("{aside}\nfrom_link = 1")));
        assert!(base.torque[0].abs() > 1.0, "{:?}", base.torque);
        assert_abs_diff_eq!(column.torque[0], 0.0, epsilon = 1e-9);
    }
}
