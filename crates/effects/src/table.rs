//! Functions with which the effects read their `[[effect]]` tables, write them, and list their numbers.

use super::{Effect, Parameter, ParameterOwner};
use serde::de::Error;

/// Bounds of a number that may have either sign.
pub(super) const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// Bounds of a size.
pub(super) const NOT_NEGATIVE: (f64, f64) = (0.0, f64::INFINITY);

/// Bounds of factors. Beyond a factor of twenty the declared value cannot be the quantity that its key names.
pub(super) const FACTOR: (f64, f64) = (0.05, 20.0);

/// Checks an effect that was read.
///
/// # Errors
/// A number that is not finite, or outside its physical bounds; the message names it.
pub(super) fn checked<E: Effect + 'static>(effect: E) -> Result<Box<dyn Effect>, toml::de::Error> {
    if let Some(angles) = effect.presliding().filter(|angles| !angles.is_valid()) {
        let message = format!(
            "`presliding_rad` is {angles}, expected a finite number not below 0 (unit rad), or six numbers above 0"
        );
        return Err(toml::de::Error::custom(message));
    }
    for Parameter { name, value, unit, bounds: (min, max), .. } in effect.parameters() {
        if value.is_finite() && (min..=max).contains(&value) {
            continue;
        }
        let expected = match (min.is_finite(), max.is_finite()) {
            (false, _) => "a finite number".to_owned(),
            (true, false) => format!("a finite number not below {min}"),
            (true, true) => format!("a finite number from {min} to {max}"),
        };
        return Err(toml::de::Error::custom(format!("`{name}` is {value}, expected {expected} (unit {unit})")));
    }
    Ok(Box::new(effect))
}

/// The `[[effect]]` table of an effect whose fields serialise to the keys of the table.
pub(super) fn table_of(kind: &str, keys: &impl serde::Serialize) -> toml::Table {
    let mut table = toml::Table::new();
    table.insert("kind".to_owned(), kind.into());
    // Effects are flat structs of numbers, which always serialise.
    if let Ok(rest) = toml::Table::try_from(keys) {
        table.extend(rest);
    }
    table
}

/// A parameter that is a single number.
pub(super) fn scalar(
    name: &str,
    value: f64,
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Parameter {
    Parameter { name: name.to_owned(), owner: ParameterOwner::Effect, value, unit, typical, neutral, bounds }
}

/// Parameters `name[0]`, `name[1]`, … of a list whose index counts neither axes nor directions.
pub(super) fn indexed(
    name: &str,
    values: &[f64],
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Vec<Parameter> {
    let one = |(i, &value)| scalar(&format!("{name}[{i}]"), value, unit, typical, neutral, bounds);
    values.iter().enumerate().map(one).collect()
}

/// Parameters `name[0]` … `name[5]` of a list with one number for each axis of the arm.
pub(super) fn per_axis(
    name: &str,
    values: &[f64; 6],
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Vec<Parameter> {
    owned_by(indexed(name, values, unit, typical, neutral, bounds), (1..).map(ParameterOwner::Axis))
}

/// Parameters `name[0]` … `name[2]` of a vector: along, or about, x, y and z of a frame.
pub(super) fn per_direction(
    name: &str,
    values: &[f64; 3],
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Vec<Parameter> {
    owned_by(indexed(name, values, unit, typical, neutral, bounds), "xyz".chars().map(ParameterOwner::Direction))
}

/// The same parameters, each with what it belongs to.
fn owned_by(mut all: Vec<Parameter>, owners: impl Iterator<Item = ParameterOwner>) -> Vec<Parameter> {
    all.iter_mut().zip(owners).for_each(|(parameter, owner)| parameter.owner = owner);
    all
}

/// Removes the first `N` of the values given to [`Effect::with_values`] and returns them, padded with 0 if there are fewer.
pub(super) fn take<const N: usize>(values: &mut &[f64]) -> [f64; N] {
    let (head, rest) = values.split_at(N.min(values.len()));
    *values = rest;
    std::array::from_fn(|i| head.get(i).copied().unwrap_or_default())
}
