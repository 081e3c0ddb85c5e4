//! Clamps of the part that yield more than `[[part.clamp]]` declares.

use super::physics::MOTIONS;
use super::{
    Deflection, Effect, Kind, Load, MOST_CLAMPS, NOT_NEGATIVE, Need, Number, Parts, Physics, State, checked, indexed,
};
use deflex_lanes::{Real, Vector};
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "clamp_compliance",
    summary: "clamps of the part give way",
    forms: &["clamps = [{ clamp = 1, mm_per_n = [0, 0, 0] }, { clamp = 2, mm_per_n = [0, 0, 0] }]"],
    bends_under_load: true,
    parts: Parts::PART,
    needs: &[Need::Force],
    read,
    candidates: |survey| {
        let one = |clamp| ClampCompliance { clamps: vec![SoftClamp { clamp, mm_per_n: [0.0; 3] }] };
        let each = (1..=survey.clamps).map(one);
        let all = ClampCompliance { clamps: each.clone().flat_map(|one| one.clamps).collect() };
        let all = (survey.clamps > 1).then_some(all);
        if survey.has_force {
            each.chain(all).map(|effect| Box::new(effect) as Box<dyn Effect>).collect()
        } else {
            vec![]
        }
    },
    ..Kind::PLAIN
};

/// Each clamp moves as a rigid body by its compliance c times the force with which the part presses on it. Let W be the shifts of the
/// place of the cut under unit motions of the clamps, and K the stiffness of the part against these motions. The compliance at the place
/// then grows by W (1 + c K)⁻¹ c Wᵀ, which is exact for any c. K is multiplied by the factor of the effect `part_stiffness`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClampCompliance {
    clamps: Vec<SoftClamp>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SoftClamp {
    /// Number of the `[[part.clamp]]` in the cell file, counted from 1.
    clamp: usize,
    /// Compliance along x, y and z of the stock, mm/N, in addition to that of the declared stiffness.
    mm_per_n: [f64; 3],
}

fn read(table: toml::Table) -> Result<Box<dyn Effect>, toml::de::Error> {
    let effect: ClampCompliance = table.try_into()?;
    for (i, soft) in effect.clamps.iter().enumerate() {
        if !(1..=MOST_CLAMPS).contains(&soft.clamp) {
            let message = format!("`clamps[{i}].clamp` is {}, expected 1 to {MOST_CLAMPS}", soft.clamp);
            return Err(Error::custom(message));
        }
        if effect.clamps[..i].iter().any(|other| other.clamp == soft.clamp) {
            return Err(Error::custom(format!("`clamps[{i}].clamp` is {} again", soft.clamp)));
        }
    }
    checked(effect)
}

impl ClampCompliance {
    /// The index of each motion whose compliance is not zero, and the square root of the compliance, √(m/N).
    fn motions(&self) -> impl Iterator<Item = (usize, f64)> {
        let of = |soft: &SoftClamp| [0, 1, 2].map(|k| (3 * (soft.clamp - 1) + k, (1e-3 * soft.mm_per_n[k]).sqrt()));
        self.clamps.iter().flat_map(of)
    }
}

impl Physics for ClampCompliance {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let part = &state.site.part;
        // What acts on the tool acts on the part the other way.
        let force = state.site.base_from_wobj.turn_back(load.cut);
        // With s = √c the formula is W s (1 + s K s)⁻¹ s Wᵀ. The matrix in brackets is symmetric with eigenvalues of at least 1, so
        // the elimination needs no pivots.
        let mut matrix = [[R::ZERO; MOTIONS]; MOTIONS];
        let mut right = [R::ZERO; MOTIONS];
        let mut count = 0;
        for (i, (motion, root)) in self.motions().enumerate() {
            for (j, (other, other_root)) in self.motions().enumerate() {
                matrix[i][j] = part.stiffness[motion][other] * load.part_stiffness * (root * other_root);
            }
            matrix[i][i] = matrix[i][i] + 1.0;
            right[i] = part.motions[motion].dot(force) * root;
            count = i + 1;
        }
        for i in 0..count {
            for j in i + 1..count {
                let factor = matrix[j][i] / matrix[i][i];
                for k in i..count {
                    matrix[j][k] = matrix[j][k] - factor * matrix[i][k];
                }
                right[j] = right[j] - factor * right[i];
            }
        }
        for i in (0..count).rev() {
            for k in i + 1..count {
                right[i] = right[i] - matrix[i][k] * right[k];
            }
            right[i] = right[i] / matrix[i][i];
        }
        let mut shift = Vector::ZERO;
        for (i, (motion, root)) in self.motions().enumerate() {
            shift = shift + part.motions[motion] * (right[i] * root);
        }
        out.part = out.part - state.site.base_from_wobj.turn(shift);
    }
}

impl Effect for ClampCompliance {
    fn clamps(&self) -> usize {
        self.clamps.iter().map(|soft| soft.clamp).max().unwrap_or(0)
    }

    fn numbers(&mut self) -> Vec<Number<'_>> {
        // From a vice of 50 N/µm to a toe clamp or a vacuum bed of 10 N/µm and less.
        let clamps = self.clamps.iter_mut().map(|soft| &mut soft.mm_per_n).enumerate();
        clamps
            .flat_map(|(i, soft)| indexed(&format!("clamps[{i}].mm_per_n"), soft, "mm/N", 1e-4, 0.0, NOT_NEGATIVE))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::PartYield;
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::{DMatrix, Matrix3, Vector3};

    /// A bar along x between two clamps, at a third of its length from the first; its stiffness from one clamp to the other is
    /// 3e6 N/m. The motions along y and z are left out.
    fn bar() -> PartYield {
        let mut motions = vec![Vector3::zeros(); 6];
        (motions[0], motions[3]) = (Vector3::x() * (2.0 / 3.0), Vector3::x() / 3.0);
        let mut stiffness = DMatrix::zeros(6, 6);
        for (i, j, sign) in [(0, 0, 1.0), (0, 3, -1.0), (3, 0, -1.0), (3, 3, 1.0)] {
            stiffness[(i, j)] = 3e6 * sign;
        }
        // A third and two thirds of the bar side by side: 1/(9e6 + 4.5e6).
        PartYield { compliance: Matrix3::from_diagonal(&Vector3::new(1.0 / 13.5e6, 0.0, 0.0)), motions, stiffness }
    }

    fn shift(clamps: &str) -> f64 {
        let bench = Bench { part: Some(bar()), ..Bench::pushed(900.0, 0.0, 0.0) };
        let (_, out) = bench.run("clamp_compliance", clamps);
        assert_abs_diff_eq!(out.part.yz().norm(), 0.0, epsilon = 1e-18);
        out.part.x
    }

    #[test]
    fn springs_at_both_ends_of_a_bar_are_in_series_with_its_pieces() {
        // Springs of 1e6 and 2e6 N/m in series with the pieces of 9e6 and 4.5e6 N/m: 0.9e6 + 1.3846e6 N/m side by side, less than the bar
        // itself yields. What acts on the tool acts on the part the other way.
        let soft = -900.0 * (1.0 / (0.9e6 + 1.0 / (1.0 / 2e6 + 1.0 / 4.5e6)) - 1.0 / 13.5e6);
        let found =
            shift("clamps = [{ clamp = 2, mm_per_n = [5e-4, 0, 0] }, { clamp = 1, mm_per_n = [1e-3, 1e-3, 0] }]");
        assert_abs_diff_eq!(found, soft, epsilon = 1e-12);
    }

    #[test]
    fn a_clamp_that_holds_nothing_leaves_all_to_the_other() {
        // The part hangs on the piece of 4.5e6 N/m.
        let found = shift("clamps = [{ clamp = 1, mm_per_n = [1e6, 0, 0] }]");
        assert_abs_diff_eq!(found, -900.0 * (1.0 / 4.5e6 - 1.0 / 13.5e6), epsilon = 1e-10);
    }
}
