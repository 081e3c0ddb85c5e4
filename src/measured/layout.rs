//! How a table is laid out: its separator, its decimal sign, and which of its columns is which.

use super::columns::{COLUMNS, FORCE_COLUMNS, Places, wrong};
use crate::cell::nearest;
use crate::limits;
use crate::text::Diagnostic;
use std::cell::Cell;

/// Names that a file has for columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnNames {
    /// Index of the column, and what the file calls it.
    renamed: Vec<(usize, String)>,
}

impl ColumnNames {
    /// Reads `target=Punkt Nr,x_mm=X Ist`.
    ///
    /// # Errors
    /// What is wrong with it, and how to mend that.
    pub fn parse(text: &str) -> Result<Self, Vec<Diagnostic>> {
        let bad = |message: String, help: String| vec![Diagnostic::error("usage.columns", "", message).help(help)];
        let mut renamed: Vec<(usize, String)> = Vec::new();
        for pair in text.split(',') {
            let Some((ours, theirs)) = pair.split_once('=').map(|(a, b)| (a.trim(), b.trim())) else {
                let help = "expected NAME=COLUMN OF THE FILE, with commas between: target=Punkt Nr,x_mm=X Ist";
                return Err(bad(format!("--columns: `{pair}` has no `=`"), help.to_owned()));
            };
            let Some(column) = COLUMNS.iter().position(|known| *known == ours && !ours.is_empty()) else {
                let meant = nearest(ours, COLUMNS.iter().copied().filter(|name| !name.is_empty()));
                let help =
                    meant.map_or_else(|| "see docs/formats.md".to_owned(), |near| format!("did you mean `{near}`?"));
                return Err(bad(format!("--columns: there is no column `{ours}`"), help));
            };
            if renamed.iter().any(|(known, _)| *known == column) {
                return Err(bad(format!("--columns: `{ours}` stands twice"), "name one column for it".to_owned()));
            }
            renamed.push((column, theirs.to_owned()));
        }
        Ok(Self { renamed })
    }

    /// Which column a name of the file is, where names were given: other columns are not looked at.
    fn column(&self, name: &str) -> Option<usize> {
        let given = self.renamed.iter().find(|(_, theirs)| theirs == name).map(|(column, _)| *column);
        let own = || COLUMNS.iter().position(|known| *known == name && !name.is_empty());
        given.or_else(|| own().filter(|column| self.renamed.iter().all(|(renamed, _)| renamed != column)))
    }
}

/// What a reader takes of a table.
#[derive(Clone, Copy, Debug)]
pub(super) enum Wanted<'a> {
    /// All of it: a column that is not known is an error.
    All,
    /// Targets, forces and covariates: other columns are not looked at.
    Forces,
    /// What these names say: other columns are not looked at.
    Named(&'a ColumnNames),
}

/// The separator of a header: tabs or semicolons where there are any outside quotes, else commas.
pub(super) fn separator(header: &[u8]) -> u8 {
    let mut quoted = false;
    let mut bare = header.iter().copied().filter(|&byte| {
        quoted ^= byte == b'"';
        !quoted
    });
    let outside: Vec<u8> = bare.by_ref().collect();
    [b'\t', b';'].into_iter().find(|separator| outside.contains(separator)).unwrap_or(b',')
}

/// The decimal sign of a file: the first that is met, and no other from there on.
#[derive(Debug, Default)]
pub(super) struct Decimal(Cell<Option<char>>);

impl Decimal {
    /// The number in a cell.
    pub(super) fn number(&self, text: &str) -> Result<Option<f64>, String> {
        let sign = if text.contains(',') { Some(',') } else { text.contains('.').then_some('.') };
        if let Some(sign) = sign {
            match self.0.get() {
                Some(known) if known != sign => {
                    return Err(format!(
                        "`{text}` has a decimal {}, and numbers before have a decimal {}",
                        word(sign),
                        word(known)
                    ));
                }
                _ => self.0.set(Some(sign)),
            }
        }
        Ok(text.replace(',', ".").parse::<f64>().ok().filter(|value| value.is_finite()))
    }
}

fn word(sign: char) -> &'static str {
    if sign == ',' { "comma" } else { "point" }
}

/// Where each column stands in a header.
pub(super) fn places(file: &str, names: &[&str], wanted: Wanted) -> Result<Places, Vec<Diagnostic>> {
    if let Some(over) = limits::COLUMNS.exceeded(names.len() as f64) {
        return Err(wrong(file, 1, over, limits::COLUMNS.help.to_owned()).into());
    }
    let mut errors = Vec::new();
    let mut place: Places = [None; COLUMNS.len()];
    let mut unknown = Vec::new();
    let missing = |column: &&str| !names.contains(column);
    for (at, &name) in names.iter().enumerate() {
        let column = match wanted {
            Wanted::Named(given) => given.column(name),
            _ => COLUMNS.iter().position(|known| *known == name && !name.is_empty()),
        };
        match (column, wanted) {
            (Some(column), _) if place[column].is_some() => {
                errors.push(wrong(file, 1, format!("column `{name}` stands twice"), "remove one of them".into()));
            }
            (Some(column), Wanted::Forces) if !FORCE_COLUMNS.contains(&column) => {}
            (Some(column), _) => place[column] = Some(at),
            (None, Wanted::Named(_)) => {}
            (None, Wanted::Forces) => {
                let wanted = FORCE_COLUMNS.map(|column| COLUMNS[column]).into_iter().filter(missing);
                if let Some(near) = nearest(name, wanted).filter(|_| !name.is_empty()) {
                    let help = format!("did you mean `{near}`?");
                    errors.push(wrong(file, 1, format!("unknown column `{name}`"), help));
                }
            }
            (None, Wanted::All) => match nearest(name, COLUMNS).filter(|near| !near.is_empty()) {
                Some(near) => {
                    let help = format!("did you mean `{near}`?");
                    errors.push(wrong(file, 1, format!("unknown column `{name}`"), help));
                }
                None => unknown.push(format!("`{name}`")),
            },
        }
    }
    if !unknown.is_empty() {
        let columns = if unknown.len() > 1 { "columns" } else { "column" };
        let known = COLUMNS[..COLUMNS.len() - 1].join(", ");
        let help =
            format!("rename with --columns \"target=…,x_mm=…\", which leaves others alone; known columns: {known}");
        errors.push(wrong(file, 1, format!("unknown {columns} {}", unknown.join(", ")), help));
    }
    if let Wanted::Named(given) = wanted {
        for (column, theirs) in given.renamed.iter().filter(|(column, _)| place[*column].is_none()) {
            let near = nearest(theirs, names.iter().copied());
            let help = near.map_or_else(
                || format!("the file has: {}", names.join(", ")),
                |near| format!("did you mean `{near}`?"),
            );
            errors.push(wrong(file, 1, format!("there is no column `{theirs}` for {}", COLUMNS[*column]), help));
        }
    }
    let none = |columns: &[usize]| columns.iter().all(|column| place[*column].is_none());
    if matches!(wanted, Wanted::Forces) && errors.is_empty() && (none(&FORCE_COLUMNS[..1]) || none(&FORCE_COLUMNS[1..]))
    {
        let message =
            "expected a column `target`, and `fx_n`, `fy_n`, `fz_n` or `time_s`, `temperature_c`, `payload_kg`";
        errors.push(wrong(file, 1, message.to_owned(), "see docs/formats.md".to_owned()));
    }
    if errors.is_empty() { Ok(place) } else { Err(errors) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_are_those_outside_quotes() {
        assert_eq!(separator(b"target,x_mm"), b',');
        assert_eq!(separator(b"target;x_mm;\"a,b\""), b';');
        assert_eq!(separator(b"Punkt Nr\tX, Ist"), b'\t');
        assert_eq!(separator(b"\"a;b\",c"), b',');
    }

    #[test]
    fn one_file_has_one_decimal_sign() {
        let decimal = Decimal::default();
        assert_eq!(decimal.number("12"), Ok(Some(12.0)));
        assert_eq!(decimal.number("-1,25"), Ok(Some(-1.25)));
        assert!(decimal.number("1.25").unwrap_err().contains("decimal point"));
        assert_eq!(decimal.number("1,2,3"), Ok(None));
    }
}
