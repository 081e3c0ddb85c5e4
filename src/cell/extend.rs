//! The user's cell file with effects added, comments and all else kept.

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value};

/// An effect to add to a cell file, or to put in place of one of the same kind.
#[derive(Clone, Debug)]
pub struct NewEffect {
    /// The `[[effect]]` table, `kind` included.
    pub table: toml::Table,
    /// Covariance of the parameters, in their order and units.
    pub covariance: Option<Vec<Vec<f64>>>,
    /// Where the numbers come from: data hash, rows, errors before and after.
    pub provenance: toml::Table,
}

/// The text of a cell file with effects added; one of a kind that the file has already is replaced.
///
/// # Errors
/// The text is not TOML.
pub fn extended(text: &str, effects: &[NewEffect]) -> Result<String, toml_edit::TomlError> {
    let mut document: DocumentMut = text.parse()?;
    let list = document.entry("effect").or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
    if list.as_array_of_tables().is_none() {
        *list = Item::ArrayOfTables(ArrayOfTables::new());
    }
    let Some(list) = list.as_array_of_tables_mut() else { return Ok(document.to_string()) };
    for effect in effects {
        let mut table = edited(&effect.table);
        if let Some(covariance) = &effect.covariance {
            let rows: toml::Value =
                covariance.iter().map(|row| toml::Value::from(row.clone())).collect::<Vec<_>>().into();
            let mut uncertainty = toml::Table::new();
            uncertainty.insert("covariance".to_owned(), rows);
            table.insert("uncertainty", Item::Table(edited(&uncertainty)));
        }
        table.insert("provenance", Item::Table(edited(&effect.provenance)));
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

fn edited(table: &toml::Table) -> Table {
    let mut out = Table::new();
    for (key, value) in table {
        out.insert(key, Item::Value(edited_value(value)));
    }
    out
}

fn edited_value(value: &toml::Value) -> Value {
    match value {
        toml::Value::String(text) => text.as_str().into(),
        toml::Value::Integer(number) => (*number).into(),
        toml::Value::Float(number) => (*number).into(),
        toml::Value::Boolean(flag) => (*flag).into(),
        toml::Value::Datetime(date) => date.to_string().into(),
        toml::Value::Array(values) => Value::Array(values.iter().map(edited_value).collect()),
        toml::Value::Table(table) => {
            Value::InlineTable(table.iter().map(|(key, value)| (key.as_str(), edited_value(value))).collect())
        }
    }
}
