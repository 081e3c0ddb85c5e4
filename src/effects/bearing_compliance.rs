//! Links and bearings that yield across the joint axes, where the gears' springs do not count.

use super::{Distortion, Effect, Kind, Load, NOT_NEGATIVE, Parameter, State, checked, indexed, table_of, take};
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "bearing_compliance",
    summary: "links and bearings yield across the joint axes",
    read: |table| checked(table.try_into::<BearingCompliance>()?),
    candidates: |_| vec![Box::new(BearingCompliance { rad_per_nm: [[0.0; 2]; 6] })],
};

/// Turn of each link about x and y of its own frame, under what acts on it and beyond.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BearingCompliance {
    rad_per_nm: [[f64; 2]; 6],
}

impl Effect for BearingCompliance {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn distort(&self, state: &State, load: &Load, out: &mut Distortion) {
        let tcp = state.base_from_tcp.translation.vector;
        for (i, compliance) in self.rad_per_nm.iter().enumerate() {
            let link = &state.frames.base_from_link[i];
            let wrench = load.beyond(i, &tcp);
            let moment = wrench.moment - link.translation.vector.cross(&wrench.force);
            let across = link.rotation.inverse() * moment;
            out.tilt[i][0] += compliance[0] * across.x;
            out.tilt[i][1] += compliance[1] * across.y;
        }
    }

    fn parameters(&self) -> Vec<Parameter> {
        // Bearings are some five times stiffer across than the gears are along: 1e6 to 5e7 N·m/rad.
        let of = |(i, pair): (usize, &[f64; 2])| {
            indexed(&format!("rad_per_nm[{i}]"), pair, "rad/(N·m)", 6e-7, 0.0, NOT_NEGATIVE)
        };
        self.rad_per_nm.iter().enumerate().flat_map(of).collect()
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        Box::new(Self { rad_per_nm: std::array::from_fn(|_| take(&mut values)) })
    }

    fn to_table(&self) -> toml::Table {
        table_of(KIND.name, self)
    }
}
