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

/// A number of an effect, with its place in the effect.
#[derive(Debug)]
#[doc(hidden)]
pub struct Number<'a> {
    pub(super) parameter: Parameter,
    pub(super) place: &'a mut f64,
}

/// A single number.
pub(super) fn scalar<'a>(
    name: &str,
    place: &'a mut f64,
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Number<'a> {
    let (name, owner, value) = (name.to_owned(), ParameterOwner::Effect, *place);
    Number { parameter: Parameter { name, owner, value, unit, typical, neutral, bounds }, place }
}

/// The numbers `name[0]`, `name[1]`, … of a list whose index counts neither axes nor directions.
pub(super) fn indexed<'a>(
    name: &str,
    values: &'a mut [f64],
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Vec<Number<'a>> {
    let named = values.iter_mut().enumerate().map(|(i, value)| (format!("{name}[{i}]"), value));
    named.map(|(name, value)| scalar(&name, value, unit, typical, neutral, bounds)).collect()
}

/// The numbers `name[0]` … `name[5]` of a list with one number for each axis of the arm.
pub(super) fn per_axis<'a>(
    name: &str,
    values: &'a mut [f64; 6],
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Vec<Number<'a>> {
    owned_by(indexed(name, values, unit, typical, neutral, bounds), (1..).map(ParameterOwner::Axis))
}

/// The numbers `name[0]` … `name[2]` of a vector: along, or about, x, y and z of a frame.
pub(super) fn per_direction<'a>(
    name: &str,
    values: &'a mut [f64; 3],
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Vec<Number<'a>> {
    owned_by(indexed(name, values, unit, typical, neutral, bounds), "xyz".chars().map(ParameterOwner::Direction))
}

/// The same numbers, each with what it belongs to.
fn owned_by<'a>(mut all: Vec<Number<'a>>, owners: impl Iterator<Item = ParameterOwner>) -> Vec<Number<'a>> {
    all.iter_mut().zip(owners).for_each(|(number, owner)| number.parameter.owner = owner);
    all
}
