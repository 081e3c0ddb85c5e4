//! Adds effects to the user's cell file, and keeps its comments and all other text.

use super::uncertainty::{self, Uncertainty};
use deflex_drive::FittedLaw;
use deflex_text::Diagnostic;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value};

/// An effect to add to a cell file. It replaces an effect of the same kind.
///
/// # Examples
/// ```
/// use deflex_cell::{NewEffect, extended};
///
/// let table = "kind = \"backlash\"\nhalf_gap_rad = [0.0, 0.0, 0.0, 0.0, 0.0, 1e-4]".parse().expect("a table");
/// let effect = NewEffect { table, uncertainty: None, provenance: Default::default() };
/// assert!(extended("[robot]\nmodel = \"irb6660-205-1.9\"\n", &[effect])?.contains("half_gap_rad"));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct NewEffect {
    /// The `[[effect]]` table, including `kind`.
    pub table: toml::Table,
    /// Uncertainty of the parameters.
    pub uncertainty: Option<Uncertainty>,
    /// Origin of the numbers: hash of the data, number of rows, errors before and after.
    pub provenance: toml::Table,
}

/// The text of a cell file with effects added. An effect replaces one of the same kind.
///
/// # Errors
/// The text is not TOML.
///
/// # Examples
/// ```
/// use deflex_cell::{NewEffect, extended};
/// use toml::Table;
///
/// let table: Table = "kind = \"backlash\"\nhalf_gap_rad = [6e-5, 0, 0, 0, 0, 0]".parse().expect("TOML");
/// let effect = NewEffect { table, uncertainty: None, provenance: Table::new() };
/// let text = extended("[robot]\nmodel = \"irb6660-205-1.9\"   # the mill\n", &[effect])?;
/// assert!(text.contains("# the mill") && text.contains("half_gap_rad"));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn extended(text: &str, effects: &[NewEffect]) -> Result<String, Vec<Diagnostic>> {
    let mut document = parsed(text)?;
    let list = document.entry("effect").or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
    if list.as_array_of_tables().is_none() {
        *list = Item::ArrayOfTables(ArrayOfTables::new());
    }
    let Some(list) = list.as_array_of_tables_mut() else { return Ok(document.to_string()) };
    for effect in effects {
        let mut table = new_table(effect);
        let kind = effect.table.get("kind").and_then(toml::Value::as_str);
        let same = list.iter().position(|known| known.get("kind").and_then(Item::as_str) == kind);
        match same.and_then(|index| list.get_mut(index)) {
            Some(known) => {
                *table.decor_mut() = known.decor().clone();
                *known = table;
            }
            None => list.push(table),
        }
    }
    Ok(document.to_string())
}

/// The text of a cell file that has exactly these effects, in this order. The table of an effect that the file has with the same
/// parameters stays as it is, with its comments, uncertainty and provenance.
///
/// # Errors
/// The text is not TOML.
///
/// # Examples
/// ```
/// use deflex_cell::with_effects;
///
/// let text = "[[effect]]\nkind = \"backlash\"\nhalf_gap_rad = [6e-5, 0, 0, 0, 0, 0]\n";
/// assert!(!with_effects(text, &[])?.contains("backlash"));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn with_effects(text: &str, effects: &[NewEffect]) -> Result<String, Vec<Diagnostic>> {
    let mut document = parsed(text)?;
    let known = document.remove("effect").and_then(|item| item.into_array_of_tables().ok()).unwrap_or_default();
    let mut known: Vec<Table> = known.into_iter().collect();
    let mut list = ArrayOfTables::new();
    for effect in effects {
        let same = known.iter().position(|table| parameters(table).as_ref() == Some(&effect.table));
        list.push(same.map_or_else(|| new_table(effect), |at| known.remove(at)));
    }
    document.insert("effect", Item::ArrayOfTables(list));
    Ok(document.to_string())
}

/// The parameters in an `[[effect]]` table, as deflex writes them.
fn parameters(table: &Table) -> Option<toml::Table> {
    let mut table: toml::Table = table.to_string().parse().ok()?;
    table.remove("uncertainty");
    table.remove("provenance");
    let kind = deflex_effects::kind(table.remove("kind")?.as_str()?)?;
    Some((kind.read)(table).ok()?.to_table())
}

/// The text of a cell file with another stiffness of the joints, N·m/rad.
///
/// # Errors
/// The text is not TOML.
///
/// # Examples
/// ```
/// let text = deflex_cell::with_stiffness("[robot]\nmodel = \"irb6660-205-1.9\"   # the mill\n", [1e6; 6])?;
/// assert!(text.contains("# the mill") && text.contains("joint_nm_per_rad = [1e6, "));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn with_stiffness(text: &str, joint_nm_per_rad: [f64; 6]) -> Result<String, Vec<Diagnostic>> {
    let mut document = parsed(text)?;
    let robot = document.entry("robot").or_insert(Item::Table(Table::new()));
    if let Some(robot) = robot.as_table_like_mut() {
        let stiffness = robot.entry("stiffness").or_insert(Item::Table(Table::new()));
        if let Some(stiffness) = stiffness.as_table_like_mut() {
            let numbers = joint_nm_per_rad.iter().map(|value| float(*value)).collect();
            stiffness.insert("joint_nm_per_rad", Item::Value(Value::Array(numbers)));
        }
    }
    Ok(document.to_string())
}

fn parsed(text: &str) -> Result<DocumentMut, Vec<Diagnostic>> {
    let error = |error: toml_edit::TomlError| vec![Diagnostic::error("cell.toml", "", error.message().to_owned())];
    text.parse().map_err(error)
}

/// The `[[effect]]` table of an effect.
fn new_table(effect: &NewEffect) -> Table {
    let mut table = edited(&effect.table);
    if let Some(known) = &effect.uncertainty {
        table.insert("uncertainty", Item::Table(edited(&uncertainty::table(known))));
    }
    if !effect.provenance.is_empty() {
        table.insert("provenance", Item::Table(edited(&effect.provenance)));
    }
    table
}

/// The text of a cell file in which `[controller.path]` states a law. Comments and all other text are kept, and so is the law of the cell
/// if the found one predicts logs no better than the programmed path does.
///
/// # Errors
/// The text is not TOML.
///
/// # Examples
/// ```
/// use deflex_cell::with_path_law;
/// use deflex_drive::FittedLaw;
/// use deflex_text::Diagnostics;
///
/// fn extend(path: &str, found: &FittedLaw) -> Result<(), Diagnostics> {
///     let text = with_path_law(&std::fs::read_to_string(path)?, found)?;
///     Ok(std::fs::write(path, text)?)
/// }
/// ```
pub fn with_path_law(text: &str, found: &FittedLaw) -> Result<String, Vec<Diagnostic>> {
    let law = &found.law;
    let mut document = parsed(text)?;
    let controller = document.entry("controller").or_insert(Item::Table(Table::new()));
    if let Some(table) = controller.as_table_mut() {
        // A table that only contains other tables needs no header of its own.
        table.set_implicit(table.is_empty());
    }
    let Some(controller) = controller.as_table_like_mut() else { return Ok(document.to_string()) };
    if let Some(turn) = found.arc_turn {
        controller.insert("arc_turn", Item::Value(turn.word().into()));
    }
    let Some(error_share) = found.error_share() else { return Ok(document.to_string()) };
    let path = controller.entry("path").or_insert(Item::Table(Table::new()));
    if let Some(path) = path.as_table_like_mut() {
        // Four digits are more than a log can determine.
        let rounded = |value: f64| format!("{value:.3e}").parse().unwrap_or(value);
        let numbers = |values: &[f64]| Item::Value(Value::Array(values.iter().map(|v| float(rounded(*v))).collect()));
        path.insert("zone_share", Item::Value(float(rounded(law.zone_share))));
        if let Some(radius) = found.assumed_zone {
            path.insert("zone_mm", Item::Value(float(rounded(1e3 * radius))));
        }
        path.insert("smoothing_s", numbers(&law.smoothing));
        path.insert("axis_lead_s2", numbers(law.axis_lead.as_slice()));
        path.insert("acceleration_mm_s2", Item::Value(float(rounded(1e3 * law.acceleration))));
        path.insert("passing_acceleration_mm_s2", Item::Value(float(rounded(1e3 * law.passing_acceleration))));
        path.insert("corner_acceleration_mm_s2", Item::Value(float(rounded(1e3 * law.corner_acceleration))));
        path.insert("lag_s", numbers(law.lag.as_slice()));
        path.insert("stop_s", Item::Value(float(rounded(law.stop))));
        path.insert("error_share", Item::Value(float(rounded(error_share))));
    }
    Ok(document.to_string())
}

fn edited(table: &toml::Table) -> Table {
    let mut out = Table::new();
    // `kind` comes first, in front of the keys in alphabetical order.
    let (kind, rest): (Vec<_>, Vec<_>) = table.iter().partition(|(key, _)| *key == "kind");
    for (key, value) in kind.into_iter().chain(rest) {
        out.insert(key, Item::Value(edited_value(value)));
    }
    out
}

fn edited_value(value: &toml::Value) -> Value {
    match value {
        toml::Value::String(text) => text.as_str().into(),
        toml::Value::Integer(number) => (*number).into(),
        toml::Value::Float(number) => float(*number),
        toml::Value::Boolean(flag) => (*flag).into(),
        toml::Value::Datetime(date) => date.to_string().into(),
        toml::Value::Array(values) => Value::Array(values.iter().map(edited_value).collect()),
        toml::Value::Table(table) => {
            Value::InlineTable(table.iter().map(|(key, value)| (key.as_str(), edited_value(value))).collect())
        }
    }
}

/// A number with all its digits; small and large numbers with an exponent.
fn float(number: f64) -> Value {
    let plain = number == 0.0 || (1e-3..1e6).contains(&number.abs());
    let text = if plain { String::new() } else { format!("{number:e}") };
    text.parse().unwrap_or_else(|_| number.into())
}
