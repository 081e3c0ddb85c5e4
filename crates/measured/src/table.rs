use super::clock::Clock;
use super::columns::{COLUMNS, PROBE_TOOL, Places, RowText, wrong};
use super::layout::{ColumnNames, Decimal, Wanted, What, places, separator};
use super::target::TargetRef;
use super::text::LineFeeds;
use super::{ForceRow, Forces};
use deflex_text::limits::MEASURED_ROWS;
use deflex_text::{Diagnostic, Severity, Source};
use nalgebra::Vector3;
use std::io::{BufRead, BufReader, Chain, Cursor, Read};

/// One measured row, in the units of the file. Missing columns and empty cells are `None`.
///
/// # Examples
/// ```
/// use deflex_measured::Table;
/// use deflex_text::Source;
///
/// let table = Table::read(&Source::new("measured.csv", "target,x_mm,y_mm,z_mm\n1,10.02,0,-2\n"))?;
/// assert_eq!(table.rows[0].position_mm, Some([10.02, 0.0, -2.0]));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasuredRow {
    /// Line in the file, from 1.
    pub line: u64,
    /// Target.
    pub target: Option<TargetRef>,
    /// Position of the TCP, mm, if all three axes were measured.
    pub position_mm: Option<[f64; 3]>,
    /// Position of the TCP along each axis that was measured, mm.
    pub axes_mm: [Option<f64>; 3],
    /// Position on the path at which the row was taken, in the work object, mm, for rows that name no target.
    pub nominal_mm: Option<[f64; 3]>,
    /// Orientation, scalar first.
    pub quat: Option<[f64; 4]>,
    /// Error along the surface normal, mm.
    pub normal_mm: Option<f64>,
    /// Motor angles, degrees.
    pub motor_deg: Option<[f64; 6]>,
    /// Distance from the fixed point of the instrument, mm.
    pub distance_mm: Option<f64>,
    /// Force on the tool, N.
    pub force_n: Option<[f64; 3]>,
    /// Time, s.
    pub time_s: Option<f64>,
    /// Temperature, °C.
    pub temperature_c: Option<f64>,
    /// Payload, kg.
    pub payload_kg: Option<f64>,
    /// Standard deviation of the position, per axis, mm.
    pub sigma_mm: Option<f64>,
    /// Run that the row belongs to.
    pub run: Option<String>,
    /// Whether the row is only used to test the fit, not for the fit itself.
    pub holdout: Option<bool>,
    /// The tool with which the robot itself probed the row; `motor_deg` and `time_s` are then those of the touch.
    pub probe_tool: Option<String>,
}

/// A measured file.
///
/// # Examples
/// ```
/// use deflex_measured::Table;
/// use deflex_text::Source;
///
/// let table = Table::read(&Source::new("probe.csv", "target,normal_mm\n1,0.12\n2,0.14\n"))?;
/// assert_eq!(table.rows.len(), 2);
/// assert!(table.forces().of(2, None).is_some_and(|row| row.force.is_none()));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// File name, for messages.
    pub file: String,
    /// Rows in the order of the file.
    pub rows: Vec<MeasuredRow>,
    /// Largest distance from the path of a row without a target, mm; `None` means [`MATCH_MM`].
    pub match_mm: Option<f64>,
    /// Notes on the file: lines before the header, and columns that the cell names and the file does not have.
    pub notes: Vec<Diagnostic>,
}

/// Default largest distance from the path of a row without a target, mm.
pub const MATCH_MM: f64 = 5.0;

/// The largest size of a number in a column. A larger one is a mistake or in another unit, for any robot: the largest
/// robots have a reach of 5 m, stand on tracks of about 100 m, carry 2.3 t and push with less than 100 kN.
fn largest(column: usize) -> f64 {
    match column {
        1..=3 | 15 | 25..=27 => 1e6, // places, mm
        4..=7 => 10.0,               // parts of a unit quaternion
        8 | 22 => 1e3,               // errors, mm
        9..=14 => 1e5,               // angles, degrees
        16..=18 => 1e6,              // forces, N
        19 => 1e12,                  // times, s: also milliseconds since 1970
        20 => 1e4,                   // temperatures, °C
        21 => 1e5,                   // payloads, kg
        _ => f64::INFINITY,
    }
}

/// Number of wrong rows after which a file is not read further: some megabytes of messages. The command line prints equal ones once, with their
/// number.
const MESSAGES: usize = 10_000;

impl Table {
    /// Reads a measured file.
    ///
    /// # Errors
    /// Unknown columns (with the most similar known one), cells that are not finite numbers, and incomplete groups of
    /// columns.
    pub fn read(source: &Source) -> Result<Self, Vec<Diagnostic>> {
        Self::read_named(source, None)
    }

    /// Reads a measured file whose columns have other names. Columns that are not named are then ignored.
    ///
    /// # Errors
    /// Those of [`Table::read`], and named columns that the file does not have.
    #[doc(hidden)]
    pub fn read_named(source: &Source, names: Option<&ColumnNames>) -> Result<Self, Vec<Diagnostic>> {
        let mut all = Rows::new(&source.name, &source.bytes[..], names)?;
        let notes = std::mem::take(&mut all.notes);
        let (mut rows, mut errors) = (Vec::new(), Vec::new());
        for row in all {
            if let Some(over) = MEASURED_ROWS.exceeded(rows.len() as f64 + 1.0) {
                return Err(Diagnostic::error("measured.rows", &source.name, over).help(MEASURED_ROWS.help).into());
            }
            match row {
                Ok(row) => rows.push(row),
                Err(error) => errors.push(error),
            }
        }
        if rows.is_empty() && errors.is_empty() {
            let message = "the file has no rows below its header, expected one for each measured point".to_owned();
            errors.push(wrong(&source.name, 1, message, "check that the values were saved".to_owned()));
        }
        if errors.is_empty() {
            Ok(Self { file: source.name.clone(), rows, match_mm: None, notes })
        } else {
            Err(errors)
        }
    }

    /// The error for a row that does not belong to its program.
    #[doc(hidden)]
    pub fn row_error(&self, line: u64, message: String) -> Diagnostic {
        let mut diagnostic = Diagnostic::error("measured.row", &self.file, message)
            .help("`target` is the ordinal of an executed motion, or the name of a declared robtarget visited once");
        (diagnostic.line, diagnostic.column) = (usize::try_from(line).unwrap_or(0), 1);
        diagnostic
    }

    /// Forces and covariates by target, for `--forces`.
    #[must_use]
    pub fn forces(&self) -> Forces {
        self.rows.iter().filter_map(|row| Some((row.target.clone()?, row.force()))).collect()
    }
}

impl MeasuredRow {
    /// Force and covariates of the cut. If the robot itself probed the row, its time and temperature belong to the
    /// probing and are left out.
    #[must_use]
    #[doc(hidden)]
    pub fn force(&self) -> ForceRow {
        let cut = self.probe_tool.is_none();
        ForceRow {
            force: self.force_n.map(Vector3::from),
            time: self.time_s.filter(|_| cut),
            temperature: self.temperature_c.filter(|_| cut),
            payload: self.payload_kg,
        }
    }
}

/// The lines that were read to find the header, followed by the rest of the file.
type Text<R> = Chain<Cursor<Vec<u8>>, BufReader<LineFeeds<R>>>;

/// Reads the rows of a table one by one, without holding the table; returns the errors of rows, and ends after too
/// many.
#[doc(hidden)]
pub struct Rows<R> {
    file: String,
    records: csv::ByteRecordsIntoIter<Text<R>>,
    place: Places,
    separator: u8,
    /// Number of columns of the header.
    columns: usize,
    /// Number of columns up to the last one with a name.
    named: usize,
    decimal: Decimal,
    clock: Clock,
    wrong: usize,
    /// Number of lines before the header.
    before: u64,
    /// Notes on the file.
    pub notes: Vec<Diagnostic>,
}

impl<R: Read> Rows<R> {
    /// Reads the header of the table in `file`, whose columns can have other names. Columns that are not named are then
    /// ignored.
    ///
    /// # Errors
    /// Unknown columns (with the most similar known one), and named columns that the file does not have.
    pub(crate) fn new(file: &str, input: R, names: Option<&ColumnNames>) -> Result<Self, Vec<Diagnostic>> {
        Self::read_header(file, input, Wanted { what: What::All, names })
    }

    /// Reads the header of any table with targets and forces (or times, temperatures, payloads). Other columns are
    /// ignored.
    ///
    /// # Errors
    /// The table has none of these columns, or one of them is mistyped.
    pub fn of_forces(file: &str, input: R, names: Option<&ColumnNames>) -> Result<Self, Vec<Diagnostic>> {
        Self::read_header(file, input, Wanted { what: What::Forces, names })
    }

    fn read_header(file: &str, input: R, wanted: Wanted) -> Result<Self, Vec<Diagnostic>> {
        /// The header is one of this number of lines, and these are shorter than this, bytes: instruments write at most
        /// a page (job, device, units) before the header.
        const FIRST: (usize, u64) = (200, 1 << 16);
        let mut input = BufReader::new(LineFeeds::new(input));
        let mut lines: Vec<Vec<u8>> = Vec::new();
        // The byte order mark of UTF-16 and the first letter: spreadsheets call the format "Unicode text".
        let begins = input.fill_buf().map_err(|error| {
            vec![wrong(file, 1, format!("not a CSV file: {error}"), "expected a header row".into())]
        })?;
        if begins.starts_with(&[0xFF, 0xFE]) || begins.starts_with(&[0xFE, 0xFF]) {
            let message = "the file is UTF-16 (\"Unicode text\"), expected UTF-8".to_owned();
            return Err(vec![wrong(file, 1, message, "save it as CSV, UTF-8".into())]);
        }
        let mut start = input.by_ref().take(FIRST.1);
        let unread = |line: u64, reason: String| {
            vec![wrong(file, line, format!("not a CSV file: {reason}"), "expected a header row".into())]
        };
        while lines.len() < FIRST.0 {
            let mut line = Vec::new();
            match start.read_until(b'\n', &mut line).map_err(|reason| unread(1, reason.to_string()))? {
                0 => break,
                _ => lines.push(line),
            }
        }
        if lines.iter().all(|line| line.trim_ascii().is_empty()) {
            let message = "the file is empty, expected a header row with the names of the columns".to_owned();
            return Err(vec![wrong(file, 1, message, "check that the table was saved".into())]);
        }
        // The line with the most names of columns. If no line has any, the first line, about which the error is then
        // reported.
        let known = lines.iter().map(|line| wanted.known_in(line)).enumerate();
        let header = known.rev().max_by_key(|(_, known)| *known).map_or(0, |(at, _)| at);
        let separator = separator(lines.get(header).map_or(&[], |line| &line[..]));
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(separator)
            .trim(csv::Trim::Headers)
            .flexible(true)
            .from_reader(Cursor::new(lines[header.min(lines.len())..].concat()).chain(input));
        let before = header as u64;
        let names = reader.byte_headers().map_err(|reason| unread(before + 1, reason.to_string()))?;
        let names: Vec<String> = names.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
        let names: Vec<&str> = names.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
        let row = RowText::new(file, separator, names.iter().map(|name| name.as_bytes()));
        let (place, mut notes) = places((&row, before + 1), &names, wanted)?;
        if before > 0 {
            let lines = if before == 1 {
                "1 line before the header is"
            } else {
                &format!("{before} lines before the header are")
            };
            let note = wrong(file, before + 1, format!("{lines} skipped"), "the header names the columns".to_owned());
            notes.insert(0, note.severity(Severity::Note));
        }
        Ok(Self {
            file: file.to_owned(),
            records: reader.into_byte_records(),
            place,
            separator,
            columns: names.len(),
            named: names.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1),
            decimal: Decimal::default(),
            clock: Clock::default(),
            wrong: 0,
            before,
            notes,
        })
    }

    /// Whether a row has the columns of the header, except for separators at the end of the line: spreadsheets write them
    /// in the rows or in the header alone.
    fn has_columns_of_header(&self, record: &csv::ByteRecord) -> bool {
        let more = record.iter().skip(self.columns).all(|cell| cell.trim_ascii().is_empty());
        (self.named..=self.columns).contains(&record.len()) || record.len() > self.columns && more
    }

    /// The line of the file in which the record that was read last begins.
    fn line_of(&self, record: &csv::ByteRecord) -> u64 {
        let inside = record.iter().flatten().filter(|byte| **byte == b'\n').count() as u64;
        (self.before + self.records.reader().position().line()).saturating_sub(1 + inside)
    }
}

impl<R: Read> Iterator for Rows<R> {
    type Item = Result<MeasuredRow, Diagnostic>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.wrong >= MESSAGES {
            return None;
        }
        let record = match self.records.next()? {
            Ok(record) => record,
            Err(reason) => {
                // The rest of the file is ignored.
                self.wrong = MESSAGES;
                let line = (self.before + self.records.reader().position().line()).saturating_sub(1);
                let message = format!("row not read: {reason}");
                return Some(Err(wrong(&self.file, line, message, "check that the file is whole".into())));
            }
        };
        let line = self.line_of(&record);
        let row = if self.has_columns_of_header(&record) {
            Cells { record: &record, place: &self.place, decimal: &self.decimal, clock: &self.clock }.row(line)
        } else {
            let message = format!("the row has {} columns, and the header has {}", record.len(), self.columns);
            let help = "every row has the columns of the header; empty cells keep their separator";
            Err(CellError { cell: record.len().min(self.columns), message, help: help.into() })
        };
        self.wrong += usize::from(row.is_err());
        Some(row.map_err(|CellError { cell, message, help }| {
            RowText::new(&self.file, self.separator, &record).wrong(line, cell, message, help)
        }))
    }
}

/// Words for a number that is missing, as data frames, spreadsheets and the software of trackers write them.
const NO_VALUE: [&str; 6] = ["nan", "n/a", "na", "#n/a", "null", "-"];

struct Cells<'a> {
    record: &'a csv::ByteRecord,
    place: &'a Places,
    decimal: &'a Decimal,
    clock: &'a Clock,
}

/// What is wrong with a row, and what to do.
struct CellError {
    /// The cell, counted from 0 in the row.
    cell: usize,
    message: String,
    help: String,
}

impl Cells<'_> {
    /// An error of a column.
    fn error(&self, column: usize, message: String, help: impl Into<String>) -> CellError {
        CellError { cell: self.place[column].unwrap_or(0), message, help: help.into() }
    }

    fn text(&self, column: usize) -> Option<String> {
        let text = self.record.get(self.place[column]?)?.trim_ascii();
        (!text.is_empty()).then(|| String::from_utf8_lossy(text).into_owned())
    }

    /// The text of a column of numbers; `None` if it is empty, or says that there is no value.
    fn number_text(&self, column: usize) -> Option<String> {
        self.text(column).filter(|text| !NO_VALUE.iter().any(|word| text.eq_ignore_ascii_case(word)))
    }

    fn number(&self, column: usize) -> Result<Option<f64>, CellError> {
        let Some(text) = self.number_text(column) else { return Ok(None) };
        let number = self.decimal.number(&text).map_err(|message| {
            self.error(column, format!("{}: {message}", COLUMNS[column]), "write all numbers of a file alike")
        })?;
        match number {
            Some(value) if value.abs() > largest(column) => Err(self.error(
                column,
                format!("{} is {text}, far beyond any robot (at most {:e})", COLUMNS[column], largest(column)),
                "check the number and its unit",
            )),
            Some(value) => Ok(Some(value)),
            None => Err(self.error(
                column,
                format!("{} is `{text}`", COLUMNS[column]),
                "expected a number, or an empty cell",
            )),
        }
    }

    /// A time in seconds, a time of day, or a date with one.
    fn time(&self) -> Result<Option<f64>, CellError> {
        const COLUMN: usize = 19;
        let Some(text) = self.number_text(COLUMN) else { return Ok(None) };
        let clock = self.clock.time(&text);
        let seconds = match clock {
            Some(time) => time.map(Some),
            None => self.clock.seconds().map(|()| None),
        };
        let help = "write all times of a file alike: seconds, 09:05:00, or 2026-11-24T09:05:00";
        match seconds.map_err(|message| self.error(COLUMN, format!("{}: `{text}` {message}", COLUMNS[COLUMN]), help))? {
            Some(time) => Ok(Some(time)),
            None => self.number(COLUMN),
        }
    }

    /// Three columns, any of which can be empty.
    fn each(&self, first: usize) -> Result<[Option<f64>; 3], CellError> {
        Ok([self.number(first)?, self.number(first + 1)?, self.number(first + 2)?])
    }

    /// Columns that belong together: all or none must be given.
    fn group<const N: usize>(&self, first: usize) -> Result<Option<[f64; N]>, CellError> {
        let mut values = [0.0; N];
        let mut given = 0;
        for (i, value) in values.iter_mut().enumerate() {
            if let Some(number) = self.number(first + i)? {
                *value = number;
                given += 1;
            }
        }
        match given {
            0 => Ok(None),
            n if n == N => Ok(Some(values)),
            _ => Err(self.error(
                first,
                format!("{} are given in part", COLUMNS[first..first + N].join(", ")),
                "give all of them or none",
            )),
        }
    }

    /// Four numbers that form a unit quaternion, apart from rounding.
    fn quat(&self) -> Result<Option<[f64; 4]>, CellError> {
        /// Largest deviation of the norm from 1 that three decimals cause.
        const ROUNDED: f64 = 2e-3;
        let quat = self.group::<4>(4)?;
        let norm = quat.map_or(1.0, |q| q.iter().map(|v| v * v).sum::<f64>().sqrt());
        if (norm - 1.0).abs() <= ROUNDED {
            return Ok(quat);
        }
        Err(self.error(
            4,
            format!("qw, qx, qy, qz have norm {norm:.4}"),
            "expected a unit quaternion, scalar first, or four empty cells",
        ))
    }

    /// A number that must not be negative, nor zero unless `zero` is set.
    fn size(&self, column: usize, zero: bool) -> Result<Option<f64>, CellError> {
        match self.number(column)? {
            Some(value) if value < 0.0 || !zero && value == 0.0 => Err(self.error(
                column,
                format!("{} is {value}", COLUMNS[column]),
                format!("expected a number {}, or an empty cell", if zero { "not below 0" } else { "above 0" }),
            )),
            value => Ok(value),
        }
    }

    fn row(&self, line: u64) -> Result<MeasuredRow, CellError> {
        let target = match self.text(0) {
            None => None,
            Some(text) => Some(match text.parse::<f64>() {
                Ok(ordinal) if ordinal >= 1.0 && ordinal.fract() == 0.0 && ordinal <= f64::from(u32::MAX) => {
                    TargetRef::Ordinal(ordinal as u32)
                }
                Ok(_) => {
                    let message = format!("target is `{text}`");
                    return Err(self.error(
                        0,
                        message,
                        "expected the number of a motion, from 1, or the name of a target",
                    ));
                }
                Err(_) => TargetRef::Name(text),
            }),
        };
        let holdout = match self.text(24).as_deref() {
            None => None,
            Some("0") => Some(false),
            Some("1") => Some(true),
            Some(text) => return Err(self.error(24, format!("holdout is `{text}`"), "expected 0 or 1")),
        };
        let axes_mm = self.each(1)?;
        let position_mm = match axes_mm {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => None,
        };
        Ok(MeasuredRow {
            line,
            target,
            position_mm,
            axes_mm,
            nominal_mm: self.group::<3>(25)?,
            quat: self.quat()?,
            normal_mm: self.number(8)?,
            motor_deg: self.group::<6>(9)?,
            distance_mm: self.size(15, true)?,
            force_n: self.group::<3>(16)?,
            time_s: self.time()?,
            temperature_c: self.number(20)?,
            payload_kg: self.size(21, true)?,
            sigma_mm: self.size(22, false)?,
            run: self.text(23),
            holdout,
            probe_tool: self.text(PROBE_TOOL),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Table, Vec<Diagnostic>> {
        Table::read(&Source::new("m.csv", text.as_bytes()))
    }

    #[test]
    fn reads_columns_in_any_order_and_empty_cells() {
        let table = read("fx_n,target,fy_n,fz_n,time_s\n1,3,2,3,\n,p10,,,4.5\n").unwrap();
        assert_eq!(table.rows[0].target, Some(TargetRef::Ordinal(3)));
        assert_eq!(table.rows[0].force_n, Some([1.0, 2.0, 3.0]));
        assert_eq!(table.rows[1].target, Some(TargetRef::Name("p10".into())));
        assert_eq!((table.rows[1].force_n, table.rows[1].time_s), (None, Some(4.5)));
    }

    #[test]
    fn time_and_temperature_of_a_row_that_the_robot_probed_are_not_those_of_the_cut() {
        let text = "target,fx_n,fy_n,fz_n,time_s,temperature_c,probe_tool\n3,1,2,3,700,25,tProbe\n4,1,2,3,12,20,\n";
        let rows = Rows::of_forces("m.csv", text.as_bytes(), None).unwrap();
        let rows: Vec<ForceRow> = rows.map(|row| row.unwrap().force()).collect();
        assert_eq!(rows, read(text).unwrap().rows.iter().map(MeasuredRow::force).collect::<Vec<_>>());
        assert_eq!((rows[0].force, rows[0].time, rows[0].temperature), (rows[1].force, None, None));
        assert_eq!((rows[1].time, rows[1].temperature), (Some(12.0), Some(20.0)));
    }

    #[test]
    fn reads_what_instruments_write() {
        let table = read("target;x_mm;y_mm;z_mm\n1;1,5;;-2,25\n").unwrap();
        assert_eq!(table.rows[0].axes_mm, [Some(1.5), None, Some(-2.25)]);
        assert_eq!(table.rows[0].position_mm, None);
        let mixed = &read("target\tx_mm\n1\t1,5\n2\t1.5\n").unwrap_err()[0];
        assert!(mixed.line == 3 && mixed.message.contains("decimal point"), "{mixed}");
        let names = ColumnNames::parse("target=Punkt Nr,x_mm=X Ist").unwrap();
        let source = Source::new("m.csv", &b"Punkt Nr;Bediener;X Ist\n7;K. M.;0,5\n"[..]);
        let row = &Table::read_named(&source, Some(&names)).unwrap().rows[0];
        assert_eq!((&row.target, row.axes_mm[0]), (&Some(TargetRef::Ordinal(7)), Some(0.5)));
        let missing =
            &Table::read_named(&Source::new("m.csv", &b"Punkt;X Ist\n7;1\n"[..]), Some(&names)).unwrap_err()[0];
        assert!(missing.message.contains("no column `Punkt Nr` for target"), "{missing}");
        assert!(ColumnNames::parse("x=X Ist").unwrap_err()[0].message.contains("no column `x`"));
    }

    #[test]
    fn words_for_no_value_and_separators_at_the_end_of_a_line_are_no_cells() {
        let table = read("target;x_mm;y_mm;z_mm;time_s;\n1;NaN;1,5;#N/A;-\n2;1;2;3;7;\n3;1;2;3;8;;\n").unwrap();
        assert_eq!((table.rows[0].axes_mm, table.rows[0].time_s), ([None, Some(1.5), None], None));
        assert_eq!(table.rows.iter().map(|row| row.time_s).collect::<Vec<_>>(), [None, Some(7.0), Some(8.0)]);
        let more = &read("target;x_mm;\n1;2;3\n4;5;6;7\n").unwrap_err()[0];
        assert_eq!((more.line, more.message.as_str()), (3, "the row has 4 columns, and the header has 3"));
    }

    #[test]
    fn lines_are_those_of_the_file_whatever_ends_them() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["target,x_mm,y_mm,z_mm", "1,1,2,3", "", "2,1,2,3", "3,inf,2,3"].join(end);
            let rows = read(&text.replace("inf", "1")).unwrap().rows;
            assert_eq!(rows.iter().map(|row| row.line).collect::<Vec<_>>(), [2, 4, 5], "{end:?}");
            assert_eq!(read(&text).unwrap_err()[0].line, 5, "{end:?}");
            assert_eq!(read(&(text + "," + end)).unwrap_err()[0].line, 5, "{end:?}");
        }
    }

    #[test]
    fn what_stands_before_the_header_is_skipped_and_counted() {
        let text =
            "SpatialAnalyzer 2024\r\nJob;Teil 7\r\nUnits: mm\r\n\r\ntarget;x_mm;y_mm;z_mm\r\n1;1,5;2;3\r\n2;x;2;3\r\n";
        let error = &read(text).unwrap_err()[0];
        assert_eq!((error.line, error.message.as_str()), (7, "x_mm is `x`"));
        let table = read(&text.replace(";x;", ";1;")).unwrap();
        assert_eq!((table.rows.len(), table.rows[0].line), (2, 6));
        assert!(table.notes[0].message.contains("4 lines before the header are skipped"), "{:?}", table.notes);
        let names = ColumnNames::parse("target=Nr,x_mm=X").unwrap();
        let source = Source::new("m.csv", &b"CAM2 export\nNr,X,Y\n4,1.5,9\n"[..]);
        let table = Table::read_named(&source, Some(&names)).unwrap();
        assert_eq!((table.rows[0].line, table.rows[0].axes_mm[0]), (3, Some(1.5)));
        assert!(read("target,x_mm\n1,2\n").unwrap().notes.is_empty());
    }

    #[test]
    fn names_of_the_cell_count_where_a_file_has_them() {
        let names = [("target", "Nr"), ("x_mm", "X Ist"), ("fx_n", "Fx")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        let names = ColumnNames::of_cell(names.iter().map(|(a, b)| (a, b))).unwrap();
        let table = |text: &str| Table::read_named(&Source::new("m.csv", text.as_bytes()), Some(&names));
        let theirs = table("Nr;X Ist;Bediener\n7;0,5;K\n").unwrap();
        assert_eq!(theirs.rows[0].axes_mm[0], Some(0.5));
        assert!(theirs.notes[0].message.contains("no column `Fx` for fx_n"), "{:?}", theirs.notes);
        // The standard names still work, and mistyped ones are reported.
        assert_eq!(table("target,x_mm\n7,0.5\n").unwrap().rows[0].axes_mm[0], Some(0.5));
        assert!(table("target,x_m\n7,0.5\n").unwrap_err()[0].message.contains("x_m"));
        let wrong = [("x".to_owned(), "X Ist".to_owned())];
        assert_eq!(ColumnNames::of_cell(wrong.iter().map(|(a, b)| (a, b))).unwrap_err().0, "x");
    }

    #[test]
    fn times_are_seconds_or_those_of_a_clock() {
        let times = |rows: &str| read(&format!("target,time_s\n{rows}")).map(|table| table.rows[1].time_s);
        assert_eq!(times("1,12.5\n2,13\n").unwrap(), Some(13.0));
        assert_eq!(times("1,23:59:00\n2,00:01:00\n").unwrap(), Some(86_460.0));
        assert_eq!(times("1,2026-11-24T09:05:00Z\n2,2026-11-24T09:05:01.5Z\n").unwrap(), Some(1_795_511_101.5));
        let mixed = &times("1,09:05:00\n2,13\n").unwrap_err()[0];
        assert!(mixed.line == 3 && mixed.message.contains("times of day"), "{mixed}");
        assert_eq!(times("1,09:05:00\n2,later\n").unwrap_err()[0].line, 3);
    }

    #[test]
    fn names_what_is_wrong_with_its_line() {
        for (text, message) in [("", "the file is empty"), ("target,x_mm\n\n", "no rows below its header")] {
            assert!(read(text).unwrap_err()[0].message.contains(message), "{text:?}");
        }
        let unknown = &read("target,x_m\n1,2\n").unwrap_err()[0];
        assert_eq!((unknown.line, unknown.column), (1, 8));
        assert_eq!(unknown.help.as_deref(), Some("did you mean `x_mm`?"));
        let none = &read("target,x_mm,y_mm,z_mm\n1,1,2,3\n2, inf,2,3\n").unwrap_err()[0];
        assert_eq!((none.line, none.column, none.message.as_str()), (3, 3, "x_mm is `inf`"));
        assert_eq!(none.snippet, Some(("2, inf,2,3".to_owned(), 2..6)));
        let quoted = &read("run,target,x_mm\n\"a,b\",1,x\n").unwrap_err()[0];
        assert_eq!((quoted.line, quoted.column), (2, 9));
        let ragged = &read("target,x_mm\n1\n2,3\n3,4,5\n").unwrap_err();
        assert_eq!(ragged.iter().map(|error| (error.line, error.column)).collect::<Vec<_>>(), [(2, 1), (4, 5)]);
        let part = &read("target,fx_n,fy_n,fz_n\n1,1,2,\n").unwrap_err()[0];
        assert!(part.message.contains("in part"));
        let zero = &read("target,qw,qx,qy,qz\n1,1,0,0,0\n2,0,0,0,0\n").unwrap_err()[0];
        assert_eq!((zero.line, zero.message.as_str()), (3, "qw, qx, qy, qz have norm 0.0000"));
        let many = &read("target,alpha,beta\n1,2,3\n").unwrap_err();
        assert_eq!((many.len(), many[0].message.as_str()), (1, "unknown columns `alpha`, `beta`"));
        let far = &read("target,x_mm,y_mm,z_mm\n1,1,2,3\n2,1,1e160,3\n").unwrap_err()[0];
        assert!(far.line == 3 && far.message.starts_with("y_mm is 1e160, far beyond any robot"), "{far}");
        let certain = &read("target,sigma_mm\n1,0\n").unwrap_err()[0];
        assert_eq!(certain.message, "sigma_mm is 0");
    }
}
