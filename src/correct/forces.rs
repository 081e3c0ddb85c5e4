use nalgebra::Vector3;
use std::collections::BTreeMap;

/// What a table says of one target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceRow {
    /// Force on the tool, N, work object axes.
    pub force: Option<Vector3<f64>>,
    /// Time since the start, s.
    pub time: Option<f64>,
    /// Temperature, °C.
    pub temperature: Option<f64>,
    /// Payload, kg.
    pub payload: Option<f64>,
}

/// A force table: by ordinal of the motion, or by name of the declared robtarget (upper case).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Forces {
    /// Whether forces were measured at all; without, `[cut]` says them and the rows only carry covariates.
    pub forces_given: bool,
    /// Rows by ordinal, from 1.
    pub by_ordinal: BTreeMap<u32, ForceRow>,
    /// Rows by name, upper case.
    pub by_name: BTreeMap<String, ForceRow>,
}

impl Forces {
    /// The row of a motion.
    #[must_use]
    pub fn of(&self, ordinal: u32, name: Option<&str>) -> Option<&ForceRow> {
        self.by_ordinal.get(&ordinal).or_else(|| self.by_name.get(&name?.to_ascii_uppercase()))
    }
}
