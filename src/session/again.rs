//! Recognises programs that `compensate` has already corrected. A second correction of such a program would be added to
//! the first, and the part would be wrong by about as much in the opposite direction.
//!
//! A program is recognised by its report. If most of the corrected positions in a report of the program's folder are
//! positions of the program, that run wrote the program. The program therefore needs no mark, and the folder no further
//! file.

use deflex::correct::Row;
use deflex::text::Diagnostic;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Rows of a report that are compared: the first rows are enough to distinguish two programs.
const MOST_ROWS: usize = 4096;
/// Corrections up to this size are ignored, because the program's rounded numbers may not show them, mm.
const LEAST_CORRECTION_MM: f64 = 0.004;
/// Positions closer than this are the same: half a digit of a program with three decimals plus half a digit of the
/// report, mm.
const SAME_MM: f64 = 0.001;
/// Share of the corrected positions that must be positions of the program.
const LEAST_SHARE: f64 = 0.8;
/// Text in the header of the RAPID programs that deflex makes from CL data.
const POSTED: &str = "posted by deflex";
/// Length of the part of a file in which that text is looked for, bytes.
const HEAD_BYTES: usize = 4096;

/// Evidence that a program was written by `compensate`.
#[derive(Debug, Default)]
pub(crate) struct Again {
    reports: Vec<(PathBuf, Vec<[f64; 3]>)>,
    /// Positions of the program's targets, from its start, mm.
    places: Vec<[f64; 3]>,
    /// Whether the program's header contains [`POSTED`].
    posted: bool,
}

impl Again {
    /// Collects the reports in the folders of a program's files.
    pub(crate) fn in_folders_of<'a>(files: impl IntoIterator<Item = &'a Path>) -> Self {
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

    /// Adds rows of the program's own report.
    pub(crate) fn take(&mut self, rows: &[Row]) {
        let room = MOST_ROWS - self.places.len().min(MOST_ROWS);
        self.places.extend(rows.iter().take(room).map(|row| row.position_mm));
    }

    /// The error for a program that has been corrected already; `None` for any other program.
    pub(crate) fn refusal(&self, name: &str) -> Option<Diagnostic> {
        let help = "give the original program, or add --again to correct this one once more";
        let written = self.reports.iter().find(|(_, written)| self.contains_most(written));
        let why = match written {
            Some((report, _)) => format!("according to {}, the correction is in it already", report.display()),
            None if self.posted => {
                "its first lines say that deflex posted it, so the correction is in it already".to_owned()
            }
            None => return None,
        };
        Some(Diagnostic::error("compensate.again", name, why).help(help))
    }

    /// Whether most of these positions are positions of the program.
    fn contains_most(&self, written: &[[f64; 3]]) -> bool {
        let mut places = self.places.clone();
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let contained = |wanted: &&[f64; 3]| {
            let from = places.partition_point(|place| place[0] < wanted[0] - SAME_MM);
            let near = places[from..].iter().take_while(|place| place[0] <= wanted[0] + SAME_MM);
            near.into_iter().any(|place| (0..3).all(|i| (place[i] - wanted[i]).abs() <= SAME_MM))
        };
        let found = written.iter().filter(contained).count();
        found > 0 && found as f64 >= LEAST_SHARE * written.len() as f64
    }
}

fn posted(file: &Path) -> bool {
    if !file.metadata().is_ok_and(|metadata| metadata.is_file()) {
        return false;
    }
    let mut head = Vec::new();
    let read = File::open(file)
        .and_then(|file| std::io::Read::read_to_end(&mut std::io::Read::take(file, HEAD_BYTES as u64), &mut head));
    read.is_ok() && String::from_utf8_lossy(&head).contains(POSTED)
}

/// The corrected positions that a report lists, without those that the correction hardly moved; `None` if the file is
/// no report, or if nothing was corrected.
fn written(path: &Path) -> Option<Vec<[f64; 3]>> {
    const COLUMNS: [&str; 6] = ["x_mm", "y_mm", "z_mm", "correction_x_mm", "correction_y_mm", "correction_z_mm"];
    // Opening a named pipe would block until another process writes to it.
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
            // The columns are empty where the target was not solved.
            *value = match record.get(column)? {
                "" => f64::NAN,
                figure => figure.parse().ok()?,
            };
        }
        let [x, y, z, dx, dy, dz] = values;
        if dx.hypot(dy).hypot(dz) > LEAST_CORRECTION_MM {
            all.push([x + dx, y + dy, z + dz]);
        }
    }
    (!all.is_empty()).then_some(all)
}
