//! A tool that grows dull: its force rises with the length cut.

use super::{Effect, Kind, Load, NOT_NEGATIVE, Need, Parameter, State, checked, scalar, table_of, take};
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "tool_wear",
    summary: "the cutting force grows with the length cut",
    read: |table| checked(table.try_into::<ToolWear>()?),
    candidates: |survey| if survey.has_force { vec![Box::new(ToolWear { per_m: 0.0 })] } else { vec![] },
};

/// Force = (1 + per_m · length cut) · given force.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ToolWear {
    per_m: f64,
}

impl Effect for ToolWear {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn load(&self, state: &State, load: &mut Load) {
        load.cut *= 1.0 + self.per_m * state.situation.cut_length;
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::Force]
    }

    fn parameters(&self) -> Vec<Parameter> {
        // 20 to 100 % over a tool's life of some 10 m.
        vec![scalar("per_m", self.per_m, "1/m", 0.1, 0.0, NOT_NEGATIVE)]
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        let [per_m] = take(&mut values);
        Box::new(Self { per_m })
    }

    fn to_table(&self) -> toml::Table {
        table_of(KIND.name, self)
    }
}
