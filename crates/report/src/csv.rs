//! The report as CSV. Its columns are declared in one table, from which the rows, the header and the documentation are made.

use deflex_correct::{Row, Status};
use deflex_text::number::{self, Digits, Fixed, SIDE};
use deflex_text::printable_line;
use std::borrow::Cow;
use std::io::{self, Write};

/// A column of the report, which has one row for each target.
///
/// # Examples
/// ```
/// let column = &deflex_report::REPORT_COLUMNS[0];
/// println!("{}: {}", column.name, column.doc);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReportColumn {
    /// Name in the header, with the unit.
    pub name: &'static str,
    /// The kind of its values.
    pub(crate) kind: ColumnKind,
    /// Its meaning, for the documentation.
    pub doc: &'static str,
}

/// The kind of the values of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub(crate) enum ColumnKind {
    /// Whole numbers: counts and lines.
    Whole,
    /// Text.
    Text,
    /// Numbers with this many decimals; the field is empty if the number is not known.
    Number {
        /// At most eight.
        decimals: usize,
    },
}

/// Numbers of decimals: lengths are printed to at least a tenth of a micrometre, forces to a millinewton.
const POSITION: usize = 4;
const ERROR: usize = 6;
const ANGLE: usize = 7;
const FORCE: usize = 3;

/// Declares the columns of the report once, and generates everything that works on each column: the table of columns,
/// the numbers of a row, their text made from digits, and a plain text that is the reference for it. The generated code
/// is straight-line code, because a call or an allocation for each column would dominate the time of a report.
///
/// `whole` and `number` have a value in every row (NaN if the target is not solved), `optional` only in some. `word` is
/// a fixed word of deflex that needs no quotes, `text` may contain any character.
macro_rules! columns {
    (|$row:ident| $($kind:ident $(<$decimals:ident>)? $name:literal $get:expr; $doc:literal)*) => {
        /// The columns of the report; later ones are only added after them.
        pub const REPORT_COLUMNS: &[ReportColumn] =
            &[$(ReportColumn { name: $name, kind: columns!(@kind $kind $($decimals)?), doc: $doc }),*];

        /// The report's header (`docs/formats.md`, Report).
        pub const CSV_HEADER: &str = columns!(@header $($name)*);

        #[inline(always)]
        fn numbers($row: &Row) -> Numbers {
            let mut numbers = [[0.0; SIDE]; BLOCKS];
            let mut at = 0;
            $(columns!(@number $kind numbers, at, $get);)*
            debug_assert_eq!(at, NUMBERS);
            numbers
        }

        impl Text {
            /// Appends the columns of a row, each followed by a comma.
            #[inline(always)]
            fn columns(&mut self, $row: &Row, digits: &[Digits; BLOCKS]) {
                let mut at = 0;
                $(columns!(@put $kind $($decimals)? self, digits, at, $get);)*
                debug_assert_eq!(at, NUMBERS);
            }
        }

        /// The columns of numbers, before they are printed; NaN where the report has nothing.
        fn each_number($row: &Row, mut take: impl FnMut(&'static str, f64)) {
            $(columns!(@each $kind take, $name, $get);)*
        }

        /// The reference for [`Text::columns`]; also prints the numbers that the fast conversion to digits does not
        /// cover.
        fn plain_columns($row: &Row, line: &mut Vec<u8>) {
            $(columns!(@plain $kind $($decimals)? line, $get);)*
        }
    };
    (@kind whole) => { ColumnKind::Whole };
    (@kind word) => { ColumnKind::Text };
    (@kind text) => { ColumnKind::Text };
    (@kind number $decimals:ident) => { ColumnKind::Number { decimals: $decimals } };
    (@kind optional $decimals:ident) => { ColumnKind::Number { decimals: $decimals } };
    (@header $first:literal $($name:literal)*) => { concat!($first, $(",", $name,)* "\n") };
    (@number word $numbers:ident, $at:ident, $get:expr) => {};
    (@number text $numbers:ident, $at:ident, $get:expr) => {};
    (@number whole $numbers:ident, $at:ident, $get:expr) => {
        $numbers.as_flattened_mut()[$at] = f64::from($get);
        $at += 1;
    };
    (@number number $numbers:ident, $at:ident, $get:expr) => {
        $numbers.as_flattened_mut()[$at] = $get;
        $at += 1;
    };
    (@number optional $numbers:ident, $at:ident, $get:expr) => {
        $numbers.as_flattened_mut()[$at] = $get.unwrap_or(0.0);
        $at += 1;
    };
    (@put word $text:ident, $digits:ident, $at:ident, $get:expr) => {
        $text.text($get.as_bytes());
        $text.text(b",");
    };
    (@put text $text:ident, $digits:ident, $at:ident, $get:expr) => { $text.field($get) };
    (@put whole $text:ident, $digits:ident, $at:ident, $get:expr) => {
        $text.number(|place| $digits[$at / SIDE].put_whole($at % SIDE, place));
        $at += 1;
    };
    (@put number $decimals:ident $text:ident, $digits:ident, $at:ident, $get:expr) => {
        $text.number(|place| $digits[$at / SIDE].put::<$decimals>($at % SIDE, place));
        $at += 1;
    };
    (@put optional $decimals:ident $text:ident, $digits:ident, $at:ident, $get:expr) => {
        match $get {
            Some(_) => $text.number(|place| $digits[$at / SIDE].put::<$decimals>($at % SIDE, place)),
            None => $text.text(b","),
        }
        $at += 1;
    };
    (@each word $take:ident, $name:literal, $get:expr) => {};
    (@each text $take:ident, $name:literal, $get:expr) => {};
    (@each whole $take:ident, $name:literal, $get:expr) => {};
    (@each number $take:ident, $name:literal, $get:expr) => { $take($name, $get) };
    (@each optional $take:ident, $name:literal, $get:expr) => { $take($name, $get.unwrap_or(f64::NAN)) };
    (@plain word $line:ident, $get:expr) => { plain_field($line, $get) };
    (@plain text $line:ident, $get:expr) => { plain_field($line, $get) };
    (@plain whole $line:ident, $get:expr) => {
        number::write_whole($line, $get);
        $line.push(b',');
    };
    (@plain number $decimals:ident $line:ident, $get:expr) => { plain_number($line, Some($get), $decimals) };
    (@plain optional $decimals:ident $line:ident, $get:expr) => { plain_number($line, $get, $decimals) };
}

columns! { |row|
    whole "target" row.target; "ordinal of the executed motion, from 1"
    whole "line" row.line; "line of the instruction"
    text "name" row.name.as_deref().unwrap_or(""); "name of the declared target, where it has one"
    word "status" status(row); "`ok`: a cutting force acts; `air`: none acts; `kept`: not to be changed, see `reason`"
    number<POSITION> "x_mm" row.position_mm[0]; "programmed position, axes of the work object"
    number<POSITION> "y_mm" row.position_mm[1]; ""
    number<POSITION> "z_mm" row.position_mm[2]; ""
    number<ERROR> "error_x_mm" row.error_mm[0]; "predicted error without a correction: actual minus programmed, axes of the work object"
    number<ERROR> "error_y_mm" row.error_mm[1]; ""
    number<ERROR> "error_z_mm" row.error_mm[2]; ""
    number<ERROR> "error_mm" row.error_norm_mm(); "its size"
    number<ANGLE> "error_rx_deg" row.error_deg[0]; "the same as a rotation vector"
    number<ANGLE> "error_ry_deg" row.error_deg[1]; ""
    number<ANGLE> "error_rz_deg" row.error_deg[2]; ""
    number<ERROR> "error_normal_mm" row.error_normal_mm; "along the surface normal at the point of contact, out of the material"
    number<ERROR> "correction_x_mm" row.correction_mm[0]; "commanded minus programmed"
    number<ERROR> "correction_y_mm" row.correction_mm[1]; ""
    number<ERROR> "correction_z_mm" row.correction_mm[2]; ""
    number<ANGLE> "correction_rx_deg" row.correction_deg[0]; "the same as a rotation vector"
    number<ANGLE> "correction_ry_deg" row.correction_deg[1]; ""
    number<ANGLE> "correction_rz_deg" row.correction_deg[2]; ""
    number<ERROR> "remaining_mm" row.remaining_norm_mm(); "error that remains, predicted by the forward model from the numbers as written"
    number<FORCE> "fx_n" row.force_n[0]; "force on the tool, axes of the work object"
    number<FORCE> "fy_n" row.force_n[1]; ""
    number<FORCE> "fz_n" row.force_n[2]; ""
    optional<ERROR> "sigma_mm" row.sigma_mm; "standard uncertainty of the predicted error, per axis"
    optional<POSITION> "depth_mm" row.depth_mm; "axial depth of the cutter in the stock, where the force follows from one"
    optional<FORCE> "engaged_deg" row.engaged_deg; "arc of engagement at half that depth"
    optional<POSITION> "removed_mm3" row.removed_mm3; "material removed on the path to the target"
    optional<ERROR> "remaining_path_mm" row.remaining_path_mm(); "largest distance of the tip from the programmed path, on the path to the target"
    optional<POSITION> "spin_deg" row.spin_deg; "turn about the tool axis, where it was chosen"
    text "reason" row.reason(); "why the target is kept, or not judged"
    optional<POSITION> "q1_deg" joint(row, 0); "motor angles that the controller is sent to, as the pendant shows them: those of the corrected numbers where the target is corrected"
    optional<POSITION> "q2_deg" joint(row, 1); ""
    optional<POSITION> "q3_deg" joint(row, 2); ""
    optional<POSITION> "q4_deg" joint(row, 3); ""
    optional<POSITION> "q5_deg" joint(row, 4); ""
    optional<POSITION> "q6_deg" joint(row, 5); ""
    text "tool" row.names.as_deref().map_or("", |names| &names.tool); "tool, as the program names it"
    text "wobj" row.names.as_deref().map_or("", |names| &names.wobj); "work object, as the program names it"
    optional<FORCE> "feed_mm_s" row.feed_mm_s; "programmed speed of the TCP; empty where the text does not say one"
    optional<ERROR> "error_part_mm" row.error_part_mm; "by how much the part yields under the force: its share of `error_mm`; empty where no effect says how it yields"
}

fn joint(row: &Row, axis: usize) -> Option<f64> {
    row.joints_deg.map(|joints| joints[axis])
}

fn status(row: &Row) -> &'static str {
    match row.status {
        Status::Ok => "ok",
        Status::Air => "air",
        Status::Kept(_) => "kept",
    }
}

/// Number of values in a row that are numbers: counts, lines and decimals.
const NUMBERS: usize = {
    let (mut count, mut i) = (0, 0);
    while i < REPORT_COLUMNS.len() {
        if !matches!(REPORT_COLUMNS[i].kind, ColumnKind::Text) {
            count += 1;
        }
        i += 1;
    }
    count
};

/// Number of blocks of eight values that hold them.
const BLOCKS: usize = NUMBERS.div_ceil(SIDE);
const ROW: number::Row<BLOCKS> = number::Row::new(&{
    let mut decimals = [1; BLOCKS * SIDE];
    let (mut at, mut i) = (0, 0);
    while i < REPORT_COLUMNS.len() {
        match REPORT_COLUMNS[i].kind {
            ColumnKind::Text => {}
            // The conversion yields decimals for whole numbers too, which are not printed.
            ColumnKind::Whole => at += 1,
            ColumnKind::Number { decimals: own } => {
                decimals[at] = own;
                at += 1;
            }
        }
        i += 1;
    }
    decimals
});

/// Writes the header and the rows of a report.
///
/// # Errors
/// Every error of writing to `out`.
///
/// # Examples
/// ```
/// use deflex_report::{CSV_HEADER, write_csv};
///
/// let mut file = Vec::new();
/// write_csv(&[], &mut file)?;
/// assert_eq!(file, CSV_HEADER.as_bytes());
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn write_csv(rows: &[Row], out: &mut impl Write) -> io::Result<()> {
    out.write_all(CSV_HEADER.as_bytes())?;
    out.write_all(&csv_rows(rows))
}

/// The rows without the header, one line for each target.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// let text = deflex_report::csv_rows(&corrected.rows);
/// assert_eq!(text.iter().filter(|byte| **byte == b'\n').count(), corrected.rows.len());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[must_use]
pub fn csv_rows(rows: &[Row]) -> Vec<u8> {
    let mut text = Text { done: Vec::with_capacity(USUAL * rows.len()), next: [0; AT_ONCE], len: 0 };
    // Works on several rows in stages: first all numbers, then all digits, then all text. No stage then waits for a
    // value that has only just been written to memory.
    let mut values = [[[0.0; SIDE]; BLOCKS]; ROWS];
    let mut digits = [[Digits::default(); BLOCKS]; ROWS];
    let mut valid = [false; ROWS];
    for rows in rows.chunks(ROWS) {
        for (row, values) in rows.iter().zip(&mut values) {
            *values = numbers(row);
        }
        for i in 0..rows.len() {
            valid[i] = ROW.read(&values[i], &mut digits[i]);
        }
        for (i, row) in rows.iter().enumerate() {
            if valid[i] {
                text.row(row, &digits[i]);
            } else {
                text.row_plain(row);
            }
        }
    }
    text.into_bytes()
}

/// The numbers of a report before they are rounded for printing.
///
/// # Examples
/// ```
/// use deflex_report::Unrounded;
///
/// assert!(Unrounded::default().columns().is_empty()); // no row has been taken
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unrounded {
    columns: Vec<(&'static str, Vec<f64>)>,
}

impl Unrounded {
    /// Adds rows, in running order.
    #[doc(hidden)]
    pub fn take(&mut self, rows: &[Row]) {
        if self.columns.is_empty() {
            let is_number = |column: &&ReportColumn| matches!(column.kind, ColumnKind::Number { .. });
            self.columns = REPORT_COLUMNS.iter().filter(is_number).map(|column| (column.name, Vec::new())).collect();
        }
        for row in rows {
            let mut columns = self.columns.iter_mut();
            each_number(row, |name, value| {
                let column = columns.next();
                debug_assert_eq!(column.as_ref().map(|column| column.0), Some(name));
                column.into_iter().for_each(|column| column.1.push(value));
            });
        }
    }

    /// Names and values of the columns; NaN where the report has an empty field.
    #[must_use]
    pub fn columns(self) -> Vec<(&'static str, Vec<f64>)> {
        self.columns
    }
}

/// Text as a field of a CSV file (RFC 4180), always on one line. If its first character would make it a formula in a spreadsheet, it gets an
/// apostrophe before it.
#[must_use]
#[doc(hidden)]
pub fn csv_field(text: &str) -> Cow<'_, str> {
    let usual = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.' | b'/' | b'{' | b'}' | b'[' | b']' | b' ');
    if text.bytes().all(usual) {
        return Cow::Borrowed(text);
    }
    let text = printable_line(text);
    // Spreadsheets for East Asian languages read the full-width forms as the usual characters.
    let formula = text.starts_with(['=', '+', '-', '@', '\u{ff1d}', '\u{ff0b}', '\u{ff0d}', '\u{ff20}']);
    if !formula && !text.contains([',', '"']) {
        return text;
    }
    let mark = if formula { "'" } else { "" };
    format!("\"{mark}{}\"", text.replace('"', "\"\"")).into()
}

/// Size of a usual row, and largest size of a row without long texts, bytes.
const USUAL: usize = 330;
const MOST_BYTES: usize = NUMBERS * Fixed::SIZE + REPORT_COLUMNS.len() * SHORT;
/// Texts up to this length, bytes, are copied into the fixed buffer; longer ones go directly to the output.
const SHORT: usize = 32;

/// Number of rows that are printed together.
const ROWS: usize = 8;

/// Size of the buffer in which rows are built, bytes: it stays in the processor's cache.
const AT_ONCE: usize = 8192;

/// The numbers of a row.
type Numbers = [[f64; SIDE]; BLOCKS];

/// Rows as text: finished text, and a small buffer for the next rows.
struct Text {
    done: Vec<u8>,
    /// Buffer for the rows that follow `done`.
    next: [u8; AT_ONCE],
    len: usize,
}

impl Text {
    /// Appends a row, with the same bytes as [`Text::row_plain`].
    fn row(&mut self, row: &Row, digits: &[Digits; BLOCKS]) {
        if self.len + MOST_BYTES > AT_ONCE {
            self.pass_on();
        }
        self.columns(row, digits);
        // Overwrites the comma after the last column.
        self.len -= 1;
        self.text(b"\n");
    }

    /// Appends a number that `put` writes into the buffer.
    #[inline]
    fn number(&mut self, put: impl FnOnce(&mut [u8; Fixed::SIZE]) -> usize) {
        let Some(place) = self.next[self.len..].first_chunk_mut() else { unreachable!("there is room for a row") };
        self.len += put(place);
    }

    #[inline]
    fn text(&mut self, text: &[u8]) {
        self.next[self.len..self.len + text.len()].copy_from_slice(text);
        self.len += text.len();
    }

    /// Appends a text from the user's files.
    #[inline]
    fn field(&mut self, text: &str) {
        if !text.is_empty() {
            let field = csv_field(text);
            if field.len() < SHORT {
                self.text(field.as_bytes());
            } else {
                self.pass_on();
                self.done.extend_from_slice(field.as_bytes());
            }
        }
        self.text(b",");
    }

    fn pass_on(&mut self) {
        self.done.extend_from_slice(&self.next[..std::mem::take(&mut self.len)]);
    }

    fn into_bytes(mut self) -> Vec<u8> {
        self.pass_on();
        self.done
    }

    /// The reference for [`Text::row`]; also prints the numbers that the fast conversion to digits does not cover.
    fn row_plain(&mut self, row: &Row) {
        self.pass_on();
        plain_columns(row, &mut self.done);
        if let Some(last) = self.done.last_mut() {
            *last = b'\n';
        }
    }
}

fn plain_field(line: &mut Vec<u8>, text: &str) {
    line.extend_from_slice(csv_field(text).as_bytes());
    line.push(b',');
}

/// The field is empty if the number is unknown, as for targets that are not solved.
fn plain_number(line: &mut Vec<u8>, value: Option<f64>, decimals: usize) {
    if let Some(value) = value.filter(|value| !value.is_nan()) {
        number::write_fixed(line, value, decimals);
    }
    line.push(b',');
}

#[cfg(test)]
mod tests {
    use super::*;
    use deflex_correct::{KeptReason, PathDeviation, RowNames};
    use proptest::prelude::*;
    use std::sync::Arc;

    fn text(rows: &[Row]) -> String {
        String::from_utf8(csv_rows(rows)).unwrap()
    }

    fn plain(row: &Row) -> String {
        let mut text = Text { done: Vec::new(), next: [0; AT_ONCE], len: 0 };
        text.row_plain(row);
        String::from_utf8(text.into_bytes()).unwrap()
    }

    fn row(values: [f64; 17], target: u32, line: u32) -> Row {
        let three = |at: usize| [values[at], values[at + 1], values[at + 2]];
        Row {
            target,
            line,
            status: Status::Ok,
            position_mm: three(0),
            error_mm: three(3),
            error_deg: three(6),
            error_normal_mm: values[15],
            correction_mm: three(9),
            correction_deg: three(12),
            remaining_mm: three(3),
            force_n: three(9),
            sigma_mm: Some(values[16]),
            depth_mm: target.is_multiple_of(2).then_some(values[2]),
            engaged_deg: target.is_multiple_of(3).then_some(values[5]),
            removed_mm3: target.is_multiple_of(2).then_some(values[8]),
            path: (!line.is_multiple_of(4)).then_some(PathDeviation { max_mm: values[7], ..PathDeviation::default() }),
            spin_deg: line.is_multiple_of(5).then_some(values[11]),
            joints_deg: (!target.is_multiple_of(5)).then(|| std::array::from_fn(|axis| values[axis])),
            feed_mm_s: (!line.is_multiple_of(3)).then_some(values[14]),
            error_part_mm: target.is_multiple_of(7).then_some(values[13]),
            ..Row::default()
        }
    }

    proptest! {
        #[test]
        fn rows_have_the_same_digits_either_way(
            values in any::<[i32; 17]>(),
            bits in prop::collection::vec(0..32, 17),
            (target, line) in any::<(u32, u32)>(),
            by in 0..32,
            name in prop::option::of("[a-z]{0,9}|[a-z]{700}|p\\{[0-9],[0-9]\\}|[=+@-].{0,9}|.{0,20}|\\PC{0,9}|[,\"\n\r\t ]{1,5}"),
            frames in (".{0,40}", "[a-zA-Z0-9_]{0,40}"),
            kind in 0..4_usize,
        ) {
            // Digits below 10^9, next to none of them close to a tie; half of them small.
            let mut sized = [0.0; 17];
            for i in 0..17 {
                sized[i] = 0.4 * f64::from(values[i] >> bits[i]) / 1e7;
            }
            let mut row = row(sized, target >> by, line >> by);
            row.name = name.map(Into::into);
            row.names = (kind != 2).then(|| {
                let [tool, wobj] = [&frames.0, &frames.1].map(|name| name.as_str().into());
                Arc::new(RowNames { file: "".into(), tool, wobj })
            });
            row.status = [Status::Ok, Status::Air, Status::Kept(KeptReason::Misfit), Status::Ok][kind];
            if kind == 3 {
                row.sigma_mm = None;
            }
            prop_assert_eq!(text(&[row.clone(), row.clone(), row.clone()]), plain(&row).repeat(3));
            // Whatever the name: as many fields as columns, and the name in its own.
            let mut csv = Vec::new();
            write_csv(&[row.clone(), row.clone()], &mut csv).unwrap();
            prop_assert_eq!(csv.iter().filter(|b| **b == b'\n').count(), 3);
            let mut reader = csv::Reader::from_reader(&csv[..]);
            for record in reader.records() {
                let record = record.unwrap();
                prop_assert_eq!(record.len(), CSV_HEADER.split(',').count());
                let (field, name) = (&record[2], row.name.as_deref().unwrap_or(""));
                prop_assert!(!field.starts_with(['=', '+', '-', '@']), "{}", field);
                prop_assert_eq!(field.strip_prefix('\'').filter(|_| !name.starts_with('\'')).unwrap_or(field), printable_line(name));
                prop_assert_eq!(&record[3], status(&row));
                prop_assert_eq!(&record[31], row.reason());
            }
        }

        #[test]
        fn numbers_that_need_a_closer_look_get_it(value in any::<f64>(), halves in -3000..3000_i32, at in 0..17_usize) {
            for value in [value, f64::from(halves) / 2e7, f64::from(halves) / 2e6, f64::NAN, 1e9, -0.0] {
                let mut values = [0.25; 17];
                values[at] = value;
                let (odd, usual) = (row(values, 1, 2), row([0.25; 17], 3, 4));
                let all = [usual.clone(), odd.clone(), odd.clone(), usual.clone()];
                prop_assert_eq!(text(&all), all.map(|row| plain(&row)).concat());
            }
        }
    }
}
