use crate::cell::nearest;
use crate::correct::{ForceRow, Forces};
use crate::text::{Diagnostic, Source};
use nalgebra::Vector3;
use std::io::Read;

/// Which target a row belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TargetRef {
    /// 1-based ordinal among the executed motions.
    Ordinal(u32),
    /// Name of a declared robtarget visited once, as written.
    Name(String),
}

/// One measured row, in the file's units; absent columns and empty cells are `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasuredRow {
    /// Line in the file, from 1.
    pub line: u64,
    /// Target.
    pub target: Option<TargetRef>,
    /// TCP, mm.
    pub position_mm: Option<[f64; 3]>,
    /// Orientation, scalar first.
    pub quat: Option<[f64; 4]>,
    /// Error along the surface normal, mm.
    pub normal_mm: Option<f64>,
    /// Motor angles, degrees.
    pub motor_deg: Option<[f64; 6]>,
    /// Length from the device's fixed point, mm.
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
    /// Never fitted, only scored.
    pub holdout: Option<bool>,
}

/// A measured file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// File name, for messages.
    pub file: String,
    /// Rows in the order of the file.
    pub rows: Vec<MeasuredRow>,
}

/// Columns of `docs/formats.md`.
const COLUMNS: [&str; 26] = [
    "target",
    "x_mm",
    "y_mm",
    "z_mm",
    "qw",
    "qx",
    "qy",
    "qz",
    "normal_mm",
    "q1_deg",
    "q2_deg",
    "q3_deg",
    "q4_deg",
    "q5_deg",
    "q6_deg",
    "distance_mm",
    "fx_n",
    "fy_n",
    "fz_n",
    "time_s",
    "temperature_c",
    "payload_kg",
    "sigma_mm",
    "run",
    "holdout",
    "",
];

/// What `--forces` takes of a file: target, forces and covariates.
const FORCE_COLUMNS: [usize; 7] = [0, 16, 17, 18, 19, 20, 21];

/// Beyond these sizes a number is a slip or another unit, whatever robot it is of: the largest reach 5 m and stand on tracks of
/// some 100 m, carry 2.3 t and push with less than 100 kN.
const MOST: [f64; COLUMNS.len()] = {
    const PLACE_MM: f64 = 1e6;
    const ANGLE_DEG: f64 = 1e5;
    const FORCE_N: f64 = 1e6;
    const TIME_S: f64 = 1e12; // since 1970, in milliseconds too
    let (unit, error) = (10.0, 1e3);
    [
        f64::INFINITY,
        PLACE_MM,
        PLACE_MM,
        PLACE_MM,
        unit,
        unit,
        unit,
        unit,
        error,
        ANGLE_DEG,
        ANGLE_DEG,
        ANGLE_DEG,
        ANGLE_DEG,
        ANGLE_DEG,
        ANGLE_DEG,
        PLACE_MM,
        FORCE_N,
        FORCE_N,
        FORCE_N,
        TIME_S,
        1e4,
        1e5,
        error,
        f64::INFINITY,
        f64::INFINITY,
        f64::INFINITY,
    ]
};

/// Messages about one file before the rest is only counted.
const MESSAGES: usize = 20;

impl Table {
    /// Reads a measured file.
    ///
    /// # Errors
    /// Unknown columns (with the nearest known one), cells that are not finite numbers, groups given in part.
    pub fn read(source: &Source) -> Result<Self, Vec<Diagnostic>> {
        let (mut rows, mut errors) = (Vec::new(), Vec::new());
        for row in Rows::new(&source.name, &source.bytes[..])? {
            match row {
                Ok(row) => rows.push(row),
                Err(error) => errors.push(error),
            }
        }
        if errors.is_empty() { Ok(Self { file: source.name.clone(), rows }) } else { Err(errors) }
    }

    /// Forces and covariates by target, for `--forces`.
    #[must_use]
    pub fn forces(&self) -> Forces {
        self.rows.iter().filter_map(|row| Some((row.target.clone()?, row.force()))).collect()
    }
}

impl MeasuredRow {
    /// Force and covariates.
    #[must_use]
    pub fn force(&self) -> ForceRow {
        ForceRow {
            force: self.force_n.map(Vector3::from),
            time: self.time_s,
            temperature: self.temperature_c,
            payload: self.payload_kg,
        }
    }
}

/// The rows of a table that is not held, or what is wrong with them; it ends where too many are.
pub struct Rows<R> {
    file: String,
    records: csv::ByteRecordsIntoIter<R>,
    place: Places,
    wrong: usize,
}

/// Where each of [`COLUMNS`] stands.
type Places = [Option<usize>; COLUMNS.len()];

impl<R: Read> Rows<R> {
    /// Reads the header of the table in `file`.
    ///
    /// # Errors
    /// Unknown columns (with the nearest known one).
    pub fn new(file: &str, input: R) -> Result<Self, Vec<Diagnostic>> {
        Self::read_header(file, input, false)
    }

    /// Reads the header of any table with targets and forces (or times, temperatures, payloads): its other columns are not
    /// looked at.
    ///
    /// # Errors
    /// None of these columns, or one that is mistyped.
    pub fn of_forces(file: &str, input: R) -> Result<Self, Vec<Diagnostic>> {
        Self::read_header(file, input, true)
    }

    fn read_header(file: &str, input: R, forces: bool) -> Result<Self, Vec<Diagnostic>> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(false).from_reader(input);
        let header = match reader.byte_headers() {
            Ok(header) => header,
            Err(reason) => {
                let message = format!("not a CSV file: {reason}");
                return Err(vec![wrong(file, 1, message, "expected a header row".into())]);
            }
        };
        let mut errors = Vec::new();
        let mut place = [None; COLUMNS.len()];
        let mut unknown = Vec::new();
        let names: Vec<String> = header.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
        let names: Vec<&str> = names.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
        let missing = |column: &&str| !names.contains(column);
        for (at, &name) in names.iter().enumerate() {
            match COLUMNS.iter().position(|known| *known == name && !name.is_empty()) {
                Some(column) if place[column].is_some() => {
                    errors.push(wrong(file, 1, format!("column `{name}` stands twice"), "remove one of them".into()));
                }
                Some(column) if forces && !FORCE_COLUMNS.contains(&column) => {}
                Some(column) => place[column] = Some(at),
                None if forces => {
                    let wanted = FORCE_COLUMNS.map(|column| COLUMNS[column]).into_iter().filter(missing);
                    if let Some(near) = nearest(name, wanted).filter(|_| !name.is_empty()) {
                        let help = format!("did you mean `{near}`?");
                        errors.push(wrong(file, 1, format!("unknown column `{name}`"), help));
                    }
                }
                None if nearest(name, COLUMNS).is_none_or(str::is_empty) && !name.contains([';', '\t']) => {
                    unknown.push(format!("`{name}`"));
                }
                None => {
                    let help = nearest(name, COLUMNS).filter(|n| !n.is_empty()).map_or_else(
                        || match name.contains([';', '\t']) {
                            true => "columns are set apart by commas, decimals take a point".to_owned(),
                            false => format!("known columns: {}", COLUMNS[..COLUMNS.len() - 1].join(", ")),
                        },
                        |near| format!("did you mean `{near}`?"),
                    );
                    errors.push(wrong(file, 1, format!("unknown column `{name}`"), help));
                }
            }
        }
        if !unknown.is_empty() {
            let columns = if unknown.len() > 1 { "columns" } else { "column" };
            let help = format!("known columns: {}", COLUMNS[..COLUMNS.len() - 1].join(", "));
            errors.push(wrong(file, 1, format!("unknown {columns} {}", unknown.join(", ")), help));
        }
        let none = |columns: &[usize]| columns.iter().all(|column| place[*column].is_none());
        if forces && errors.is_empty() && (none(&FORCE_COLUMNS[..1]) || none(&FORCE_COLUMNS[1..])) {
            let separated = names.iter().any(|name| name.contains([';', '\t']));
            let help = if separated {
                "columns are set apart by commas, decimals take a point"
            } else {
                "see docs/formats.md"
            };
            let message =
                "expected a column `target`, and `fx_n`, `fy_n`, `fz_n` or `time_s`, `temperature_c`, `payload_kg`";
            errors.push(wrong(file, 1, message.to_owned(), help.to_owned()));
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        Ok(Self { file: file.to_owned(), records: reader.into_byte_records(), place, wrong: 0 })
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
                // What stands behind it is not looked at.
                self.wrong = MESSAGES;
                let (line, message) =
                    (reason.position().map_or(0, csv::Position::line), format!("row not read: {reason}"));
                return Some(Err(wrong(&self.file, line, message, "every row has the header's columns".into())));
            }
        };
        let line = record.position().map_or(0, csv::Position::line);
        let row = Cells { record: &record, place: &self.place }.row(line);
        self.wrong += usize::from(row.is_err());
        Some(row.map_err(|(message, help)| wrong(&self.file, line, message, help)))
    }
}

fn wrong(file: &str, line: u64, message: String, help: String) -> Diagnostic {
    let mut diagnostic = Diagnostic::error("measured.csv", file, message).help(help);
    (diagnostic.line, diagnostic.column) = (usize::try_from(line).unwrap_or(0), 1);
    diagnostic
}

struct Cells<'a> {
    record: &'a csv::ByteRecord,
    place: &'a Places,
}

type CellError = (String, String);

impl Cells<'_> {
    fn text(&self, column: usize) -> Option<String> {
        let text = self.record.get(self.place[column]?)?;
        (!text.is_empty()).then(|| String::from_utf8_lossy(text).into_owned())
    }

    fn number(&self, column: usize) -> Result<Option<f64>, CellError> {
        let Some(text) = self.text(column) else { return Ok(None) };
        match text.parse::<f64>().ok().filter(|value| value.is_finite()) {
            Some(value) if value.abs() > MOST[column] => Err((
                format!("{} is {text}, far beyond any robot (at most {:e})", COLUMNS[column], MOST[column]),
                "check the number and its unit".into(),
            )),
            Some(value) => Ok(Some(value)),
            None => Err((
                format!("{} is `{text}`", COLUMNS[column]),
                "expected a number with a decimal point, or an empty cell".into(),
            )),
        }
    }

    /// Columns that stand together: all or none.
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
            _ => Err((
                format!("{} are given in part", COLUMNS[first..first + N].join(", ")),
                "give all of them or none".into(),
            )),
        }
    }

    /// Four numbers that are a rotation, but for their digits.
    fn quat(&self) -> Result<Option<[f64; 4]>, CellError> {
        /// Three decimals leave no more.
        const ROUNDED: f64 = 2e-3;
        let quat = self.group::<4>(4)?;
        let norm = quat.map_or(1.0, |q| q.iter().map(|v| v * v).sum::<f64>().sqrt());
        if (norm - 1.0).abs() <= ROUNDED {
            return Ok(quat);
        }
        Err((
            format!("qw, qx, qy, qz have norm {norm:.4}"),
            "expected a unit quaternion, scalar first, or four empty cells".into(),
        ))
    }

    /// A number that cannot be negative, or not zero either.
    fn size(&self, column: usize, zero: bool) -> Result<Option<f64>, CellError> {
        match self.number(column)? {
            Some(value) if value < 0.0 || !zero && value == 0.0 => Err((
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
                Ok(ordinal) if ordinal >= 1.0 && ordinal.fract() == 0.0 && ordinal <= f64::from(u32::MAX) =>
                {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    TargetRef::Ordinal(ordinal as u32)
                }
                Ok(_) => return Err((format!("target is `{text}`"), "expected an ordinal from 1, or a name".into())),
                Err(_) => TargetRef::Name(text),
            }),
        };
        let holdout = match self.text(24).as_deref() {
            None => None,
            Some("0") => Some(false),
            Some("1") => Some(true),
            Some(text) => return Err((format!("holdout is `{text}`"), "expected 0 or 1".into())),
        };
        Ok(MeasuredRow {
            line,
            target,
            position_mm: self.group::<3>(1)?,
            quat: self.quat()?,
            normal_mm: self.number(8)?,
            motor_deg: self.group::<6>(9)?,
            distance_mm: self.size(15, true)?,
            force_n: self.group::<3>(16)?,
            time_s: self.number(19)?,
            temperature_c: self.number(20)?,
            payload_kg: self.size(21, true)?,
            sigma_mm: self.size(22, false)?,
            run: self.text(23),
            holdout,
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
    fn names_what_is_wrong_with_its_line() {
        let unknown = &read("target,x_m\n1,2\n").unwrap_err()[0];
        assert_eq!(unknown.help.as_deref(), Some("did you mean `x_mm`?"));
        let nan = &read("target,x_mm,y_mm,z_mm\n1,1,2,3\n2,nan,2,3\n").unwrap_err()[0];
        assert_eq!((nan.line, nan.message.as_str()), (3, "x_mm is `nan`"));
        let part = &read("target,x_mm,y_mm,z_mm\n1,1,2,\n").unwrap_err()[0];
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
