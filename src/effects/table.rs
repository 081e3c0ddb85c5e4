//! Effects as tables of numbers: what every effect's file shares in reading, writing and listing them.

use super::{Effect, Parameter};
use serde::de::Error;

/// Bounds of what may have either sign.
pub(super) const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// Bounds of what is a size.
pub(super) const NOT_NEGATIVE: (f64, f64) = (0.0, f64::INFINITY);

/// Bounds of factors: beyond twenty-fold the declared value means something else than the key says.
pub(super) const FACTOR: (f64, f64) = (0.05, 20.0);

/// An effect as read, refused where a number is not finite or outside its physical bounds.
pub(super) fn checked<E: Effect + 'static>(effect: E) -> Result<Box<dyn Effect>, toml::de::Error> {
    if let Some(angle) = effect.presliding_rad().filter(|angle| !angle.is_finite() || *angle < 0.0) {
        let message = format!("`presliding_rad` is {angle}, expected a finite number not below 0 (unit rad)");
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

/// The `[[effect]]` table of anything that serialises to its keys.
pub(super) fn table_of(kind: &str, keys: &impl serde::Serialize) -> toml::Table {
    let mut table = toml::Table::new();
    table.insert("kind".to_owned(), kind.into());
    // Effects are flat structs of numbers, which always serialise.
    if let Ok(rest) = toml::Table::try_from(keys) {
        table.extend(rest);
    }
    table
}

/// One parameter.
pub(super) fn scalar(
    name: &str,
    value: f64,
    unit: &'static str,
    typical: f64,
    neutral: f64,
    bounds: (f64, f64),
) -> Parameter {
    Parameter { name: name.to_owned(), value, unit, typical, neutral, bounds }
}

/// Parameters `name[0]`, `name[1]`, … of one array.
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

/// Whether friction does not build up over an angle: its key is then left out.
#[allow(clippy::trivially_copy_pass_by_ref)] // the signature that serde calls
pub(super) fn is_sharp(presliding_rad: &f64) -> bool {
    *presliding_rad <= 0.0
}

/// Takes the next `N` of the values that [`Effect::with_values`] was given; what is missing reads as 0.
pub(super) fn take<const N: usize>(values: &mut &[f64]) -> [f64; N] {
    let (head, rest) = values.split_at(N.min(values.len()));
    *values = rest;
    std::array::from_fn(|i| head.get(i).copied().unwrap_or_default())
}
