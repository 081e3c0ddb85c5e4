use super::target::TargetRef;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// The entries of a force table for one target.
///
/// # Examples
/// ```
/// use deflex_measured::Table;
/// use deflex_text::Source;
///
/// let forces = Table::read(&Source::new("forces.csv", "target,fx_n,fy_n,fz_n\n1,0,0,90\n"))?.forces();
/// assert_eq!(forces.of(1, None).and_then(|row| row.force).map(|force| force.z), Some(90.0)); // N
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
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

/// A force table. Rows are found by the ordinal of the motion, or by the name of the declared robtarget. If a target
/// has several rows, the last one counts.
///
/// # Examples
/// ```
/// use deflex_measured::Table;
/// use deflex_text::Source;
///
/// let forces = Table::read(&Source::new("forces.csv", "target,fx_n,fy_n,fz_n\np10,0,0,90\n"))?.forces();
/// assert!(forces.forces_given && forces.of(3, Some("P10")).is_some()); // names in upper or lower case
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Forces {
    /// Whether the table has forces. If not, the rows only have covariates, and `[cut]` determines the force.
    pub forces_given: bool,
    by_ordinal: ByOrdinal,
    /// Keys are names in upper case.
    by_name: BTreeMap<String, ForceRow>,
}

/// Rows sorted by ordinal. There can be one for each target of a long program, so the common case is stored compactly.
#[derive(Clone, Debug, PartialEq)]
enum ByOrdinal {
    /// Every row has a force and nothing else.
    Forces(Vec<(u32, Vector3<f64>)>),
    Rows(Vec<(u32, ForceRow)>),
}

impl Default for ByOrdinal {
    fn default() -> Self {
        Self::Forces(Vec::new())
    }
}

impl ByOrdinal {
    fn push(&mut self, ordinal: u32, row: ForceRow) {
        if let Self::Forces(forces) = self {
            if let Some(force) = row.force.filter(|force| row == ForceRow::of(*force)) {
                return forces.push((ordinal, force));
            }
            *self = Self::Rows(forces.iter().map(|(ordinal, force)| (*ordinal, ForceRow::of(*force))).collect());
        }
        if let Self::Rows(rows) = self {
            rows.push((ordinal, row));
        }
    }
}

impl ForceRow {
    /// A row with a force and nothing else.
    fn of(force: Vector3<f64>) -> Self {
        Self { force: Some(force), ..Self::default() }
    }
}

/// Sorts rows by their ordinals.
fn settle<T: Clone>(rows: &mut Vec<(u32, T)>) {
    if !rows.is_sorted_by(|a, b| a.0 < b.0) {
        // After the reversal, the last of several rows with the same ordinal comes first, and is kept.
        rows.reverse();
        rows.sort_by_key(|row| row.0);
        rows.dedup_by_key(|row| row.0);
    }
    rows.shrink_to_fit();
}

fn find<T: Copy>(rows: &[(u32, T)], ordinal: u32) -> Option<T> {
    // In most tables every target has its row.
    let own = rows.get((ordinal as usize).wrapping_sub(1)).filter(|row| row.0 == ordinal);
    let any = || rows.binary_search_by_key(&ordinal, |row| row.0).ok().map(|at| &rows[at]);
    own.or_else(any).map(|row| row.1)
}

impl FromIterator<(TargetRef, ForceRow)> for Forces {
    fn from_iter<I: IntoIterator<Item = (TargetRef, ForceRow)>>(rows: I) -> Self {
        let mut forces = Self::default();
        for (target, row) in rows {
            forces.forces_given |= row.force.is_some();
            match target {
                TargetRef::Ordinal(ordinal) => forces.by_ordinal.push(ordinal, row),
                TargetRef::Name(name) => {
                    forces.by_name.insert(name.to_ascii_uppercase(), row);
                }
            }
        }
        match &mut forces.by_ordinal {
            ByOrdinal::Forces(rows) => settle(rows),
            ByOrdinal::Rows(rows) => settle(rows),
        }
        forces
    }
}

impl Forces {
    /// A table in which no force acts at any target.
    #[must_use]
    #[doc(hidden)]
    pub fn none() -> Self {
        Self { forces_given: true, ..Self::default() }
    }

    /// The row of a motion.
    #[must_use]
    pub fn of(&self, ordinal: u32, name: Option<&str>) -> Option<ForceRow> {
        let row = match &self.by_ordinal {
            ByOrdinal::Forces(rows) => find(rows, ordinal).map(ForceRow::of),
            ByOrdinal::Rows(rows) => find(rows, ordinal),
        };
        row.or_else(|| self.by_name.get(&name?.to_ascii_uppercase()).copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_last_row_of_a_target_is_found(
            rows in prop::collection::vec((1..30_u32, prop::option::weighted(0.9, 0..9), prop::option::weighted(0.1, 0..9)), 0..40),
            rising in any::<bool>(),
        ) {
            let mut rows = rows;
            if rising {
                rows.sort_by_key(|row| row.0);
                rows.dedup_by_key(|row| row.0);
            }
            let row = |force: Option<i32>, time: Option<i32>| ForceRow {
                force: force.map(|f| Vector3::new(f.into(), 0.0, 1.0)),
                time: time.map(f64::from),
                ..ForceRow::default()
            };
            let named = |ordinal: u32| match ordinal % 5 {
                0 => TargetRef::Name(format!("p{ordinal}")),
                _ => TargetRef::Ordinal(ordinal),
            };
            let forces: Forces = rows.iter().map(|(at, force, time)| (named(*at), row(*force, *time))).collect();
            for ordinal in 0..32 {
                let expected = rows.iter().rev().find(|row| row.0 == ordinal).map(|(_, force, time)| row(*force, *time));
                prop_assert_eq!(forces.of(ordinal, Some(&format!("P{ordinal}"))), expected);
            }
            prop_assert_eq!(forces.forces_given, rows.iter().any(|row| row.1.is_some()));
        }
    }
}
