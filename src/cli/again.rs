//! Programs that a correction has been written into already: corrected again, they would be off by as much the other way.
//!
//! They are known by their own report: where most places that a report in the program's folder says were written stand in the
//! program, it is the program that was written. Their bytes are not touched, and no other file is left in their folder.

use deflex::correct::Row;
use deflex::text::Diagnostic;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Rows that are compared: the first ones distinguish two programs.
const MOST_ROWS: usize = 4096;
/// Smaller corrections are lost in the digits of a program, mm.
const TELLING_MM: f64 = 0.004;
/// Half a digit of a program with three decimals, and of the report's, mm.
const SAME_MM: f64 = 0.001;
/// Share of the places that must be found.
const SHARE: f64 = 0.8;
/// How RAPID that was made of CL data begins.
const POSTED: &str = "posted by deflex";
/// Bytes of its head.
const HEAD: usize = 4096;

/// What shows that a program was written by `compensate`.
#[derive(Debug, Default)]
pub(super) struct Again {
    reports: Vec<(PathBuf, Vec<[f64; 3]>)>,
    /// Places in the program, from its start.
    places: Vec<[f64; 3]>,
    /// A posted program's own word for it.
    posted: bool,
}

impl Again {
    /// Looks in the folder of a program's files.
    pub(super) fn beside<'a>(files: impl IntoIterator<Item = &'a Path>) -> Self {
        let mut found = Self::default();
        let mut folders = std::collections::BTreeSet::new();
        for file in files {
            found.posted |= posted(file);
            let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            folders.insert(folder.to_owned());
        }
        for folder in folders {
            let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
            let mut tables: Vec<PathBuf> = entries
                .filter(|path| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")))
                .collect();
            tables.sort();
            found.reports.extend(tables.into_iter().filter_map(|path| Some((path.clone(), written(&path)?))));
        }
        found
    }

    /// Takes in rows of the program's own report.
    pub(super) fn take(&mut self, rows: &[Row]) {
        let room = MOST_ROWS - self.places.len().min(MOST_ROWS);
        self.places.extend(rows.iter().take(room).map(|row| row.position_mm));
    }

    /// Why the program is not corrected.
    pub(super) fn refusal(&self, name: &str) -> Option<Diagnostic> {
        let help = "give the original program; --again corrects it once more all the same";
        let written = self.reports.iter().find(|(_, written)| self.holds(written));
        let why = match written {
            Some((report, _)) => format!("by {}, its correction is in it already", report.display()),
            None if self.posted => "by its first lines, deflex has posted it with its correction".to_owned(),
            None => return None,
        };
        Some(Diagnostic::error("compensate.again", name, why).help(help))
    }

    /// Whether most of the places stand in the program.
    fn holds(&self, written: &[[f64; 3]]) -> bool {
        let mut places = self.places.clone();
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let stands = |wanted: &&[f64; 3]| {
            let from = places.partition_point(|place| place[0] < wanted[0] - SAME_MM);
            let near = places[from..].iter().take_while(|place| place[0] <= wanted[0] + SAME_MM);
            near.into_iter().any(|place| (0..3).all(|i| (place[i] - wanted[i]).abs() <= SAME_MM))
        };
        let found = written.iter().filter(stands).count();
        found > 0 && found as f64 >= SHARE * written.len() as f64
    }
}

fn posted(file: &Path) -> bool {
    if !file.metadata().is_ok_and(|metadata| metadata.is_file()) {
        return false;
    }
    let mut head = Vec::new();
    let read = File::open(file)
        .and_then(|file| std::io::Read::read_to_end(&mut std::io::Read::take(file, HEAD as u64), &mut head));
    read.is_ok() && String::from_utf8_lossy(&head).contains(POSTED)
}

/// The places that a report says were written, where they differ from those programmed; `None` where a file is no report, or
/// nothing was corrected.
fn written(path: &Path) -> Option<Vec<[f64; 3]>> {
    const COLUMNS: [&str; 6] = ["x_mm", "y_mm", "z_mm", "correction_x_mm", "correction_y_mm", "correction_z_mm"];
    // A pipe by such a name would be waited for.
    if !path.metadata().is_ok_and(|metadata| metadata.is_file()) {
        return None;
    }
    let mut input = BufReader::new(File::open(path).ok()?);
    // The first bytes are enough to recognise most tables.
    if !input.fill_buf().ok()?.starts_with(b"target,line,") {
        return None;
    }
    let mut reader = csv::Reader::from_reader(input);
    let header = reader.headers().ok()?.clone();
    let at = |name: &str| header.iter().position(|column| column == name);
    let mut columns = [0; COLUMNS.len()];
    for (place, name) in columns.iter_mut().zip(COLUMNS) {
        *place = at(name)?;
    }
    let mut all = Vec::new();
    for record in reader.records().take(MOST_ROWS) {
        let record = record.ok()?;
        let mut values = [0.0_f64; COLUMNS.len()];
        for (value, column) in values.iter_mut().zip(columns) {
            // Nothing stands there where the target is not solved.
            *value = match record.get(column)? {
                "" => f64::NAN,
                figure => figure.parse().ok()?,
            };
        }
        let [x, y, z, dx, dy, dz] = values;
        if dx.hypot(dy).hypot(dz) > TELLING_MM {
            all.push([x + dx, y + dy, z + dz]);
        }
    }
    (!all.is_empty()).then_some(all)
}
