use super::csv::{ColumnKind, REPORT_COLUMNS};
use deflex_text::Diagnostic;

/// Columns of whole numbers that only the residuals of an identification have.
const WHOLES: [&str; 4] = ["run", "block", "held_out", "outlier"];
/// The column of text that only the report of several files has.
const FILE: &str = "file";

/// The kind of the values in the column of this name.
fn kind(name: &str) -> ColumnKind {
    match REPORT_COLUMNS.iter().find(|column| column.name == name) {
        Some(column) => column.kind,
        None if WHOLES.contains(&name) => ColumnKind::Whole,
        None if name == FILE => ColumnKind::Text,
        None => ColumnKind::Number { decimals: 0 },
    }
}

/// A column of a report: its name and its values.
///
/// # Examples
/// ```
/// let report = deflex_report::columns(b"target,error_mm\n1,0.2214\n")?;
/// assert_eq!(report[1].name, "error_mm");
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Column {
    /// Name in the header.
    pub name: String,
    /// The values, row by row.
    pub values: ColumnValues,
}

/// The values of a column.
///
/// # Examples
/// ```
/// use deflex_report::{ColumnValues, columns};
///
/// assert_eq!(columns(b"target,error_mm\n1,0.2214\n")?[0].values, ColumnValues::Whole(vec![1]));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum ColumnValues {
    /// Whole numbers: counts and lines.
    Whole(Vec<i64>),
    /// Numbers, each the one nearest to the digits in the file; NaN where a field is empty.
    Number(Vec<f64>),
    /// Text.
    Text(Vec<String>),
}

/// Reads the columns of a report of deflex, or of the residuals of an identification, with exactly the numbers in the file.
///
/// # Errors
/// The text is not a table, or a field of a column of numbers is not a number.
///
/// # Examples
/// ```
/// use deflex_report::{ColumnValues, columns};
///
/// let report = columns(b"target,error_mm\n1,0.221400\n2,0.279300\n")?;
/// assert_eq!(report[1].values, ColumnValues::Number(vec![0.2214, 0.2793]));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn columns(csv: &[u8]) -> Result<Vec<Column>, Vec<Diagnostic>> {
    let wrong = |what: String| Diagnostic::error("report.columns", "", what);
    let mut reader = csv::Reader::from_reader(csv);
    let header = reader.headers().map_err(|error| wrong(format!("not a report: {error}")))?.clone();
    let empty = |name: &str| {
        let values = match kind(name) {
            ColumnKind::Whole => ColumnValues::Whole(Vec::new()),
            ColumnKind::Text => ColumnValues::Text(Vec::new()),
            ColumnKind::Number { .. } => ColumnValues::Number(Vec::new()),
        };
        Column { name: name.to_owned(), values }
    };
    let mut columns: Vec<Column> = header.iter().map(empty).collect();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(|error| wrong(format!("not a report: {error}")))? {
        for (column, field) in columns.iter_mut().zip(&record) {
            let bad = |_| wrong(format!("`{field}` is not a figure of column {}", column.name));
            match &mut column.values {
                ColumnValues::Whole(values) => {
                    values.push(field.parse().map_err(|error: std::num::ParseIntError| bad(error.to_string()))?)
                }
                ColumnValues::Number(values) if field.is_empty() => values.push(f64::NAN),
                ColumnValues::Number(values) => {
                    values.push(field.parse().map_err(|error: std::num::ParseFloatError| bad(error.to_string()))?);
                }
                ColumnValues::Text(values) => values.push(field.to_owned()),
            }
        }
    }
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_those_of_the_file() {
        let found = columns(b"target,line,name,status,x_mm,sigma_mm\n1,7,p10,ok,0.1,\n2,8,,air,-3.25,0.5\n").unwrap();
        let names: Vec<&str> = found.iter().map(|column| &*column.name).collect();
        assert_eq!(names, ["target", "line", "name", "status", "x_mm", "sigma_mm"]);
        assert_eq!(found[1].values, ColumnValues::Whole(vec![7, 8]));
        assert_eq!(found[2].values, ColumnValues::Text(vec!["p10".to_owned(), String::new()]));
        assert_eq!(found[4].values, ColumnValues::Number(vec![0.1, -3.25]));
        let ColumnValues::Number(sigma) = &found[5].values else { panic!("sigma_mm is a number") };
        assert!(sigma[0].is_nan() && sigma[1].to_bits() == 0.5_f64.to_bits());
        assert_eq!(columns(b"line\nx\n").unwrap_err()[0].code, "report.columns");
    }
}
