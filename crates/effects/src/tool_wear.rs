//! A tool that grows dull: its force rises with the length cut.

use super::{Effect, Kind, Load, NOT_NEGATIVE, Need, Number, Parts, Physics, State, Survey, checked, scalar};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "tool_wear",
    summary: "the cutting force grows with the length cut",
    forms: &["per_m = 0.1"],
    parts: Parts::CUT,
    needs: &[Need::Force, Need::CutLength],
    read: |table| checked(table.try_into::<ToolWear>()?),
    candidates: |survey| match survey {
        Survey { has_force: true, has_cut_length: true, .. } => vec![Box::new(ToolWear { per_m: 0.0 })],
        _ => vec![],
    },
    ..Kind::PLAIN
};

/// Force = (1 + per_m · length cut) · given force.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ToolWear {
    per_m: f64,
}

impl Physics for ToolWear {
    #[inline(always)]
    fn load<R: Real>(&self, state: &State<'_, R>, load: &mut Load<R>) {
        load.cut = load.cut * (state.site.cut_length * self.per_m + 1.0);
    }
}

impl Effect for ToolWear {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // 20 to 100 % over a tool's life of some 10 m.
        vec![scalar("per_m", &mut self.per_m, "1/m", 0.1, 0.0, NOT_NEGATIVE)]
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn half_as_much_again_after_ten_metres() {
        let mut bench = Bench::pushed(0.0, 100.0, 0.0);
        bench.situation.cut_length = 10.0;
        let (load, _) = bench.run("tool_wear", "per_m = 0.05");
        assert_abs_diff_eq!(load.cut.y, 150.0, epsilon = 1e-12);
    }
}
