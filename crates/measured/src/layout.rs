//! Finds out how a table is laid out: its separator, its decimal sign, and the meaning of its columns.

use super::columns::{COLUMNS, FORCE_COLUMNS, PROBE_TOOL, Places, RowText};
use deflex_text::limits;
use deflex_text::nearest;
use deflex_text::{Diagnostic, Severity};
use std::cell::Cell;

/// The names that a file has for the columns.
///
/// # Examples
/// ```
/// use deflex_measured::ColumnNames;
///
/// // The file calls the columns `target` and `x_mm` by other names.
/// assert!(ColumnNames::parse("target=Point,x_mm=X actual").is_ok());
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnNames {
    /// Index of each renamed column, and its name in the file.
    renamed: Vec<(usize, String)>,
    /// Source of the names.
    given: Given,
}

/// The source of the names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Given {
    /// `--columns`, for the files of one run: all of the names must exist in the file.
    #[default]
    Call,
    /// The cell, for all files of a shop: a file that has none of the names is read with the standard names.
    Cell,
}

impl ColumnNames {
    /// Reads `target=Punkt Nr,x_mm=X Ist`.
    ///
    /// # Errors
    /// The text is not such a list, or names an unknown column.
    pub fn parse(text: &str) -> Result<Self, Vec<Diagnostic>> {
        let bad = |message: String, help: String| vec![Diagnostic::error("usage.columns", "", message).help(help)];
        let mut renamed: Vec<(usize, String)> = Vec::new();
        for pair in text.split(',') {
            let Some((ours, theirs)) = pair.split_once('=').map(|(a, b)| (a.trim(), b.trim())) else {
                let help = "expected NAME=COLUMN OF THE FILE, with commas between: target=Punkt Nr,x_mm=X Ist";
                return Err(bad(format!("--columns: `{pair}` has no `=`"), help.to_owned()));
            };
            let column = known(ours).map_err(|help| bad(format!("--columns: there is no column `{ours}`"), help))?;
            if renamed.iter().any(|(known, _)| *known == column) {
                return Err(bad(format!("--columns names `{ours}` twice"), "name one column for it".to_owned()));
            }
            renamed.push((column, theirs.to_owned()));
        }
        Ok(Self { renamed, given: Given::Call })
    }

    /// The names for all files of a cell: pairs of a standard name and the name in the files.
    ///
    /// # Errors
    /// A standard name that does not exist: the name, and the help text.
    #[doc(hidden)]
    pub fn of_cell<'a>(names: impl IntoIterator<Item = (&'a String, &'a String)>) -> Result<Self, (&'a str, String)> {
        let renamed = names.into_iter().map(|(ours, theirs)| match known(ours) {
            Ok(column) => Ok((column, theirs.trim().to_owned())),
            Err(help) => Err((&ours[..], help)),
        });
        Ok(Self { renamed: renamed.collect::<Result<_, _>>()?, given: Given::Cell })
    }

    /// The column that a name in the file means. If names were given, other columns are ignored.
    fn column(&self, name: &str, names: &[&str]) -> Option<usize> {
        let given = self.renamed.iter().find(|(_, theirs)| theirs == name).map(|(column, _)| *column);
        let free = |column: &usize| {
            let theirs = self.renamed.iter().find(|(renamed, _)| renamed == column);
            theirs.is_none_or(|(_, theirs)| self.given == Given::Cell && !names.contains(&&theirs[..]))
        };
        given.or_else(|| known(name).ok().filter(free))
    }

    /// Whether the names apply to a file with this header.
    fn count_for(&self, names: &[&str]) -> bool {
        self.given == Given::Call || self.renamed.iter().any(|(_, theirs)| names.contains(&&theirs[..]))
    }

    /// The names that the header lacks, each with the standard name.
    fn missing<'a>(&'a self, place: &'a Places) -> impl Iterator<Item = (&'static str, &'a str)> + 'a {
        let missing = self.renamed.iter().filter(|(column, _)| place[*column].is_none());
        missing.map(|(column, theirs)| (COLUMNS[*column], &theirs[..]))
    }
}

/// The column that was meant by a name: the same with its unit, or the nearest one.
fn meant<'a>(name: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> Option<&'a str> {
    let has_unit = |known: &&str| known.strip_prefix(name).is_some_and(|unit| unit.starts_with('_'));
    known.clone().into_iter().find(has_unit).filter(|_| !name.is_empty()).or_else(|| nearest(name, known))
}

/// The column with a standard name; otherwise the help text.
fn known(name: &str) -> Result<usize, String> {
    COLUMNS.iter().position(|known| *known == name && !name.is_empty()).ok_or_else(|| {
        let meant = meant(name, COLUMNS.iter().copied().filter(|name| !name.is_empty()));
        meant.map_or_else(|| "see docs/formats.md".to_owned(), |near| format!("did you mean `{near}`?"))
    })
}

/// The columns that a reader wants.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted<'a> {
    /// The set of columns.
    pub(super) what: What,
    /// The names of the columns in the file, if they were given: other columns are then ignored.
    pub(super) names: Option<&'a ColumnNames>,
}

/// A set of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum What {
    /// All columns. An unknown column is an error.
    All,
    /// Targets, forces and covariates. Other columns are ignored.
    Forces,
}

impl Wanted<'_> {
    /// Number of names of columns in a line. The header is the line with the most.
    pub(super) fn known_in(&self, line: &[u8]) -> usize {
        let line = String::from_utf8_lossy(line);
        let names = line.split(char::from(separator(line.as_bytes())));
        let plain = names.map(|name| name.trim_matches(|c: char| c.is_whitespace() || c == '"' || c == '\u{feff}'));
        let named = |name: &str| self.names.is_some_and(|given| given.renamed.iter().any(|(_, theirs)| theirs == name));
        plain.filter(|name| known(name).is_ok() || named(name)).count()
    }
}

/// The separator of a header: a tab or a semicolon if there is one outside of quotes, otherwise a comma.
pub(super) fn separator(header: &[u8]) -> u8 {
    let mut quoted = false;
    let mut bare = header.iter().copied().filter(|&byte| {
        quoted ^= byte == b'"';
        !quoted
    });
    let outside: Vec<u8> = bare.by_ref().collect();
    [b'\t', b';'].into_iter().find(|separator| outside.contains(separator)).unwrap_or(b',')
}

/// The decimal sign of a file: that of the first number with one. The other sign later is an error.
#[derive(Debug, Default)]
pub(super) struct Decimal(Cell<Option<char>>);

impl Decimal {
    /// The number in a cell; `None` if it is empty.
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

/// Position of each column in the header, which is line `line` of the file; and notes about the header.
pub(super) fn places(
    (header, line): (&RowText, u64),
    names: &[&str],
    wanted: Wanted,
) -> Result<(Places, Vec<Diagnostic>), Vec<Diagnostic>> {
    let given = wanted.names.filter(|given| given.count_for(names));
    let wrong = |cell: usize, message: String, help: String| header.wrong(line, cell, message, help);
    if let Some(over) = limits::COLUMNS.exceeded(names.len() as f64) {
        return Err(wrong(0, over, limits::COLUMNS.help.to_owned()).into());
    }
    let mut errors = Vec::new();
    let mut place: Places = [None; COLUMNS.len()];
    let mut unknown = Vec::new();
    let missing = |column: &&str| !names.contains(column);
    // A column without a name is what a separator at the end of the header makes.
    for (at, &name) in names.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
        let column = match given {
            Some(given) => given.column(name, names),
            None => known(name).ok(),
        };
        match (column, wanted.what) {
            (Some(column), _) if place[column].is_some() => {
                errors.push(wrong(at, format!("there are two columns `{name}`"), "remove one of them".into()));
            }
            (Some(column), What::Forces) if !FORCE_COLUMNS.contains(&column) && column != PROBE_TOOL => {}
            (Some(column), _) => place[column] = Some(at),
            (None, _) if given.is_some() => {}
            (None, What::Forces) => {
                let wanted = FORCE_COLUMNS.map(|column| COLUMNS[column]).into_iter().filter(missing);
                if let Some(near) = meant(name, wanted) {
                    let help = format!("did you mean `{near}`?");
                    errors.push(wrong(at, format!("unknown column `{name}`"), help));
                }
            }
            (None, What::All) => match meant(name, COLUMNS).filter(|near| !near.is_empty()) {
                Some(near) => {
                    let help = format!("did you mean `{near}`?");
                    errors.push(wrong(at, format!("unknown column `{name}`"), help));
                }
                None => unknown.push((at, format!("`{name}`"))),
            },
        }
    }
    if let Some(&(first, _)) = unknown.first() {
        let columns = if unknown.len() > 1 { "columns" } else { "column" };
        let known = COLUMNS[..COLUMNS.len() - 1].join(", ");
        let help = format!(
            "--columns \"target=…,x_mm=…\", or `[measured] columns` in the cell, names the columns that you mean; others are then ignored. Known columns: {known}"
        );
        let names: Vec<String> = unknown.into_iter().map(|(_, name)| name).collect();
        errors.push(wrong(first, format!("unknown {columns} {}", names.join(", ")), help));
    }
    let mut notes = Vec::new();
    for (given, (ours, theirs)) in given.iter().flat_map(|given| given.missing(&place).map(move |names| (given, names)))
    {
        if wanted.what == What::Forces && !FORCE_COLUMNS.iter().any(|column| COLUMNS[*column] == ours) {
            continue;
        }
        let near = nearest(theirs, names.iter().copied());
        let help = near
            .map_or_else(|| format!("the file has: {}", names.join(", ")), |near| format!("did you mean `{near}`?"));
        let missing = wrong(0, format!("there is no column `{theirs}` for {ours}"), help);
        match given.given {
            Given::Call => errors.push(missing),
            Given::Cell => notes.push(missing.severity(Severity::Note)),
        }
    }
    let none = |columns: &[usize]| columns.iter().all(|column| place[*column].is_none());
    let incomplete = none(&FORCE_COLUMNS[..1]) || none(&FORCE_COLUMNS[1..]);
    if wanted.what == What::Forces && errors.is_empty() && incomplete {
        let message =
            "expected a column `target`, and `fx_n`, `fy_n`, `fz_n` or `time_s`, `temperature_c`, `payload_kg`";
        errors.push(wrong(0, message.to_owned(), "see docs/formats.md".to_owned()));
    }
    if errors.is_empty() { Ok((place, notes)) } else { Err(errors) }
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
