use crate::correct::{Row, Status};
use crate::text::number::{self, Digits, Fixed, SIDE};
use crate::text::printable_line;
use std::borrow::Cow;
use std::io::{self, Write};

/// The report's header (`docs/reference.md`, Report).
pub const CSV_HEADER: &str = "target,line,name,status,x_mm,y_mm,z_mm,error_x_mm,error_y_mm,error_z_mm,error_mm,\
error_rx_deg,error_ry_deg,error_rz_deg,error_normal_mm,correction_x_mm,correction_y_mm,correction_z_mm,\
correction_rx_deg,correction_ry_deg,correction_rz_deg,remaining_mm,fx_n,fy_n,fz_n,sigma_mm,\
depth_mm,engaged_deg,removed_mm3,remaining_path_mm,spin_deg\n";

/// Decimals: a tenth of a micrometre, more where only the order of magnitude is of interest.
const POSITION: usize = 4;
const ERROR: usize = 6;
const ANGLE: usize = 7;
const FORCE: usize = 3;

/// Of the numbers that every row has, their decimals.
const DECIMALS: [usize; NUMBERS] = [
    POSITION, POSITION, POSITION, ERROR, ERROR, ERROR, ERROR, ANGLE, ANGLE, ANGLE, ERROR, ERROR, ERROR, ERROR, ANGLE,
    ANGLE, ANGLE, ERROR, FORCE, FORCE, FORCE,
];
const NUMBERS: usize = 21;
/// Behind them come sigma, and the two numbers before them, which have no decimals; then what only some rows have.
const SIGMA: usize = NUMBERS;
const TARGET: usize = SIGMA + 1;
const LINE: usize = TARGET + 1;
const DEPTH: usize = LINE + 1;
const ENGAGED: usize = DEPTH + 1;
const REMOVED: usize = ENGAGED + 1;
const PATH: usize = REMOVED + 1;
const SPIN: usize = PATH + 1;

/// In rows of eight.
const BLOCKS: usize = (SPIN + 1).div_ceil(SIDE);
const ROW: number::Row<BLOCKS> = number::Row::new(&{
    let mut decimals = [1; BLOCKS * SIDE];
    let (numbers, _) = decimals.split_at_mut(NUMBERS);
    numbers.copy_from_slice(&DECIMALS);
    decimals[SIGMA] = ERROR;
    decimals[DEPTH] = POSITION;
    decimals[ENGAGED] = FORCE;
    decimals[REMOVED] = POSITION;
    decimals[PATH] = ERROR;
    decimals[SPIN] = POSITION;
    decimals
});

/// Writes report rows, one a target.
///
/// # Errors
/// What `out` reports.
pub fn write_csv(rows: &[Row], out: &mut impl Write) -> io::Result<()> {
    out.write_all(CSV_HEADER.as_bytes())?;
    out.write_all(&csv_rows(rows))
}

/// The rows alone, one line a target.
#[must_use]
pub fn csv_rows(rows: &[Row]) -> Vec<u8> {
    let mut text = Text { done: Vec::with_capacity(USUAL * rows.len()), next: [0; AT_ONCE], len: 0 };
    // Several rows' numbers, then their digits, then their text: so no row waits for what it has only just put in memory.
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
                text.row_plain(row, values[i].as_flattened());
            }
        }
    }
    text.into_bytes()
}

/// Text as a field of a CSV file (RFC 4180), on one line whatever it holds. What a spreadsheet would take for a formula, by its
/// first character, gets an apostrophe before it.
#[must_use]
pub fn csv_field(text: &str) -> Cow<'_, str> {
    let usual = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.' | b'/' | b'{' | b'}' | b'[' | b']' | b' ');
    if text.bytes().all(usual) {
        return Cow::Borrowed(text);
    }
    let text = printable_line(text);
    // The wide forms too: spreadsheets for East Asian languages take them for the narrow ones.
    let formula = text.starts_with(['=', '+', '-', '@', '\u{ff1d}', '\u{ff0b}', '\u{ff0d}', '\u{ff20}']);
    if !formula && !text.contains([',', '"']) {
        return text;
    }
    let mark = if formula { "'" } else { "" };
    format!("\"{mark}{}\"", text.replace('"', "\"\"")).into()
}

/// Bytes of a usual row, and most of any but for its name.
const USUAL: usize = 240;
const MOST: usize = 16 + (LINE + 1) * Fixed::SIZE;

/// Rows that are printed together.
const ROWS: usize = 8;

/// Bytes of rows that are put together where they stay in reach.
const AT_ONCE: usize = 8192;

/// Numbers of a row.
type Numbers = [[f64; SIDE]; BLOCKS];

fn numbers(row: &Row) -> Numbers {
    let [x, y, z] = row.position_mm;
    let [ex, ey, ez] = row.error_mm;
    let [erx, ery, erz] = row.error_deg;
    let [cx, cy, cz] = row.correction_mm;
    let [crx, cry, crz] = row.correction_deg;
    let [fx, fy, fz] = row.force_n;
    let (error, normal, remaining) = (row.error_norm_mm(), row.error_normal_mm, row.remaining_norm_mm());
    let sigma = row.sigma_mm.unwrap_or(0.0);
    let [depth, engaged, removed, path, spin] =
        [row.depth_mm, row.engaged_deg, row.removed_mm3, row.remaining_path_mm(), row.spin_deg]
            .map(|value| value.unwrap_or(0.0));
    [
        [x, y, z, ex, ey, ez, error, erx],
        [ery, erz, normal, cx, cy, cz, crx, cry],
        [crz, remaining, fx, fy, fz, sigma, row.target.into(), row.line.into()],
        [depth, engaged, removed, path, spin, 0.0, 0.0, 0.0],
    ]
}

fn status(row: &Row) -> &'static str {
    match row.status {
        Status::Ok => "ok",
        Status::Air => "air",
        Status::Kept(_) => "kept",
    }
}

/// Rows on their way.
struct Text {
    done: Vec<u8>,
    /// The rows behind them.
    next: [u8; AT_ONCE],
    len: usize,
}

impl Text {
    /// Takes a row: what [`Text::row_plain`] writes.
    fn row(&mut self, row: &Row, digits: &[Digits; BLOCKS]) {
        if self.len + MOST > AT_ONCE {
            self.pass_on();
        }
        self.number(|place| digits[TARGET / SIDE].put_whole(TARGET % SIDE, place));
        self.number(|place| digits[LINE / SIDE].put_whole(LINE % SIDE, place));
        match (row.name.as_deref(), row.status) {
            (None, Status::Ok) => self.text(b",ok,"),
            (None, Status::Air) => self.text(b",air,"),
            (name, _) => {
                self.pass_on();
                for text in [csv_field(name.unwrap_or("")), status(row).into()] {
                    self.done.extend_from_slice(text.as_bytes());
                    self.done.push(b',');
                }
            }
        }
        (0..3).for_each(|i| self.decimals::<POSITION>(digits, i));
        (3..7).for_each(|i| self.decimals::<ERROR>(digits, i));
        (7..10).for_each(|i| self.decimals::<ANGLE>(digits, i));
        (10..14).for_each(|i| self.decimals::<ERROR>(digits, i));
        (14..17).for_each(|i| self.decimals::<ANGLE>(digits, i));
        self.decimals::<ERROR>(digits, 17);
        (18..21).for_each(|i| self.decimals::<FORCE>(digits, i));
        self.optional::<ERROR>(digits, SIGMA, row.sigma_mm);
        self.optional::<POSITION>(digits, DEPTH, row.depth_mm);
        self.optional::<FORCE>(digits, ENGAGED, row.engaged_deg);
        self.optional::<POSITION>(digits, REMOVED, row.removed_mm3);
        self.optional::<ERROR>(digits, PATH, row.path.map(|path| path.max_mm));
        self.optional::<POSITION>(digits, SPIN, row.spin_deg);
        // Nothing follows.
        self.len -= 1;
        self.text(b"\n");
    }

    /// Decimals, or nothing between two commas.
    #[inline]
    fn optional<const DECIMALS: usize>(&mut self, digits: &[Digits; BLOCKS], i: usize, value: Option<f64>) {
        match value {
            Some(_) => self.decimals::<DECIMALS>(digits, i),
            None => self.text(b","),
        }
    }

    #[inline]
    fn decimals<const DECIMALS: usize>(&mut self, digits: &[Digits; BLOCKS], i: usize) {
        self.number(|place| digits[i / SIDE].put::<DECIMALS>(i % SIDE, place));
    }

    /// Takes what is put in the next place.
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

    fn pass_on(&mut self) {
        self.done.extend_from_slice(&self.next[..std::mem::take(&mut self.len)]);
    }

    fn into_bytes(mut self) -> Vec<u8> {
        self.pass_on();
        self.done
    }

    /// The reference for [`Text::row`], and for numbers that need a closer look.
    fn row_plain(&mut self, row: &Row, numbers: &[f64]) {
        self.pass_on();
        let line = &mut self.done;
        for whole in [row.target, row.line] {
            number::write_whole(line, whole);
            line.push(b',');
        }
        for text in [csv_field(row.name.as_deref().unwrap_or("")), status(row).into()] {
            line.extend_from_slice(text.as_bytes());
            line.push(b',');
        }
        for (&value, decimals) in numbers.iter().zip(DECIMALS) {
            // Of targets that are not solved nothing is known.
            if !value.is_nan() {
                number::write_fixed(line, value, decimals);
            }
            line.push(b',');
        }
        let optional = [
            (row.sigma_mm, ERROR),
            (row.depth_mm, POSITION),
            (row.engaged_deg, FORCE),
            (row.removed_mm3, POSITION),
            (row.remaining_path_mm(), ERROR),
            (row.spin_deg, POSITION),
        ];
        for (i, (value, decimals)) in optional.into_iter().enumerate() {
            if i > 0 {
                line.push(b',');
            }
            if let Some(value) = value {
                number::write_fixed(line, value, decimals);
            }
        }
        line.push(b'\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correct::PathDeviation;
    use proptest::prelude::*;

    fn text(rows: &[Row]) -> String {
        String::from_utf8(csv_rows(rows)).unwrap()
    }

    fn plain(row: &Row) -> String {
        let mut text = Text { done: Vec::new(), next: [0; AT_ONCE], len: 0 };
        text.row_plain(row, numbers(row).as_flattened());
        String::from_utf8(text.into_bytes()).unwrap()
    }

    fn row(values: [f64; 17], target: u32, line: u32) -> Row {
        let three = |at: usize| [values[at], values[at + 1], values[at + 2]];
        Row {
            target,
            line,
            name: None,
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
            stiffness: None,
            stance: None,
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
            kind in 0..4_usize,
        ) {
            // Digits below 10^9, next to none of them close to a tie; half of them small.
            let mut sized = [0.0; 17];
            for i in 0..17 {
                sized[i] = 0.4 * f64::from(values[i] >> bits[i]) / 1e7;
            }
            let mut row = row(sized, target >> by, line >> by);
            row.name = name.map(Into::into);
            row.status = [Status::Ok, Status::Air, Status::Kept("so"), Status::Ok][kind];
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
