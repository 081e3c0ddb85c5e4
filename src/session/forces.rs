//! Reads the table of forces, and checks that it belongs to the program.

use super::output::watch::watch;
use deflex::correct::{Row, Status};
use deflex::measured::Forces;
use deflex::measured::{ColumnNames, Rows, TargetRef};
use deflex::program::Program;
use deflex::text::{Diagnostic, Severity, cannot_read};
use std::fs::File;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::Path;

/// The target that each row of a table of forces names, and the line of the row.
#[derive(Clone, Debug)]
pub(crate) struct ForceFile {
    file: String,
    /// Number of the target and line of each row that names its target by a number.
    ordinals: Vec<(u32, u32)>,
    names: Vec<(String, u32)>,
    /// Size of the largest force, N.
    largest: Option<f64>,
    /// Warnings and notes about the file.
    notes: Vec<Diagnostic>,
}

/// The first lines of a list, as text; `None` if the list is empty.
fn lines_of(lines: &[u32]) -> Option<String> {
    const SHOWN: usize = 5;
    let shown: Vec<String> = lines.iter().take(SHOWN).map(ToString::to_string).collect();
    let more = if lines.len() > SHOWN { ", …" } else { "" };
    match lines.len() {
        0 => None,
        1 => Some(format!("line {}", shown[0])),
        _ => Some(format!("lines {}{more}", shown.join(", "))),
    }
}

fn at_line(file: &str, line: u32, message: String) -> Diagnostic {
    let mut diagnostic = Diagnostic::error("forces.target", file, message);
    (diagnostic.line, diagnostic.column) = (line as usize, 1);
    diagnostic
}

/// An error for targets that have several rows: deflex cannot know which row is right.
fn twice<T: Ord>(file: &str, mut rows: Vec<(T, u32)>, name: impl Fn(&T) -> String) -> Option<Diagnostic> {
    rows.sort();
    let mut again: Vec<(&T, u32)> =
        rows.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| (&pair[1].0, pair[1].1)).collect();
    again.sort_by_key(|(_, line)| *line);
    let lines: Vec<u32> = again.iter().map(|(_, line)| *line).collect();
    let (first, line) = again.first()?;
    let message = match again.len() {
        1 => format!("target {} has a row already", name(first)),
        n => format!(
            "{n} rows are of targets that have one already, target {} first: {}",
            name(first),
            lines_of(&lines)?
        ),
    };
    Some(at_line(file, *line, message).help("keep one row for each target; of repeated measurements, give the mean"))
}

/// Targets of a program for which the table of forces has no row.
#[derive(Debug, Default)]
pub(crate) struct LeftOut {
    targets: usize,
    count: usize,
    /// Lines of the first of these targets in the program.
    lines: Vec<u32>,
}

impl LeftOut {
    /// Adds rows of the program's report.
    pub(crate) fn take(&mut self, forces: Option<&Forces>, rows: &[Row]) {
        const LINES: usize = 6;
        let Some(forces) = forces.filter(|forces| forces.forces_given) else { return };
        for row in rows.iter().filter(|row| !matches!(row.status, Status::Kept(_))) {
            self.targets += 1;
            if forces.of(row.target, row.name.as_deref()).is_none() {
                self.count += 1;
                if self.lines.len() < LINES && self.lines.last() != Some(&row.line) {
                    self.lines.push(row.line);
                }
            }
        }
    }

    /// The warning about these targets of the program `name`; `None` if there are none.
    pub(crate) fn note(&self, name: &str) -> Option<Diagnostic> {
        let lines = lines_of(&self.lines)?;
        let message = format!(
            "{} of {} targets have no row in the table of forces, so deflex assumes that they do not cut: {lines}",
            self.count, self.targets
        );
        Some(
            Diagnostic::error("forces.left-out", name, message)
                .severity(Severity::Warning)
                .help("give each target that cuts a row; a row of zeros marks a target that does not cut"),
        )
    }
}

impl ForceFile {
    pub(crate) fn read(path: &Path, names: Option<&ColumnNames>) -> Result<(Self, Forces), Vec<Diagnostic>> {
        let file = path.display().to_string();
        let input: Box<dyn Read> = if file == "-" {
            Box::new(std::io::stdin().lock())
        } else {
            watch(path);
            Box::new(File::open(path).map_err(|error| cannot_read(&file, &error))?)
        };
        Self::of(file, input, names)
    }

    /// Reads the forces by target, and the rows that [`ForceFile::check`] needs.
    pub(crate) fn of(
        file: String,
        input: impl Read,
        names: Option<&ColumnNames>,
    ) -> Result<(Self, Forces), Vec<Diagnostic>> {
        let mut rows = Rows::of_forces(&file, input, names)?;
        let notes = std::mem::take(&mut rows.notes);
        let (mut errors, mut ordinals, mut names) = (Vec::new(), Vec::new(), Vec::new());
        let (mut nameless, mut largest) = (Vec::new(), None);
        let forces = rows.filter_map(|row| match row {
            Ok(row) => {
                let line = u32::try_from(row.line).unwrap_or(u32::MAX);
                if row.target.is_none() {
                    nameless.push(line);
                }
                if let Some(force) = row.force_n {
                    let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
                    largest = Some(largest.map_or(size, |most: f64| most.max(size)));
                }
                match row.target.as_ref()? {
                    TargetRef::Ordinal(ordinal) => ordinals.push((*ordinal, line)),
                    TargetRef::Name(name) => names.push((name.clone(), line)),
                }
                let force = row.force();
                Some((row.target?, force))
            }
            Err(error) => {
                errors.push(error);
                None
            }
        });
        let forces: Forces = forces.collect();
        if errors.is_empty() && ordinals.is_empty() && names.is_empty() {
            let message = "no row names a target: expected a column `target` with ordinals or names";
            errors.push(Diagnostic::error("forces.target", &file, message).help("number the motion targets from 1"));
        }
        errors.extend(lines_of(&nameless).map(|lines| {
            let message = format!("{} of the rows name no target: {lines}", nameless.len());
            at_line(&file, nameless[0], message).help("a row belongs to a target: give its ordinal, or remove the row")
        }));
        errors.extend(twice(&file, ordinals.clone(), |ordinal| ordinal.to_string()));
        let upper = names.iter().map(|(name, line)| (name.to_ascii_uppercase(), *line)).collect();
        errors.extend(twice(&file, upper, |name: &String| format!("`{name}`")));
        if errors.is_empty() { Ok((Self { file, ordinals, names, largest, notes }, forces)) } else { Err(errors) }
    }

    /// Notes about lines that were skipped, and a warning if the forces look as if they were in another unit than
    /// newtons.
    pub(crate) fn doubts(&self) -> impl Iterator<Item = Diagnostic> + '_ {
        self.notes.iter().cloned().chain(self.other_unit())
    }

    fn other_unit(&self) -> Option<Diagnostic> {
        /// Mean milling forces of robots are 10 to 10,000 N (Tlusty, Altintas: a chip of 0.1 mm² of aluminium takes 80 N,
        /// of steel 250 N). Forces beyond that by a factor of five are in another unit.
        const USUAL_N: RangeInclusive<f64> = 2.0..=50_000.0;
        let largest = self.largest.filter(|most| *most > 0.0 && !USUAL_N.contains(most))?;
        let unit = if largest < *USUAL_N.start() { "kN" } else { "mN" };
        let message = format!(
            "the largest of the forces is {largest:.3} N; milling forces are usually 10 to 10,000 N (0.1 mm² of chip take 80 N in \
             aluminium, 250 N in steel): it looks like {unit}"
        );
        Some(
            Diagnostic::error("forces.unit", &self.file, message)
                .severity(Severity::Warning)
                .help("fx_n, fy_n and fz_n are newtons"),
        )
    }

    /// An error if rows belong to no target of a program: then the table was made for another program.
    pub(crate) fn check(&self, program: &Program) -> Result<(), Vec<Diagnostic>> {
        let last = program.targets.last().map_or(0, |target| target.ordinal);
        self.check_targets(last, |name| {
            program.targets.iter().any(|t| t.name.as_ref().is_some_and(|known| known.eq_ignore_ascii_case(name)))
        })
    }

    /// The same check for a program of which only the number of the last target and the names of targets are known.
    pub(crate) fn check_targets(&self, last: u32, named: impl Fn(&str) -> bool) -> Result<(), Vec<Diagnostic>> {
        const MOST_SHOWN: usize = 10; // a wrong table is wrong in every row
        let help = "targets are counted from 1 in the order they run, or named as declared";
        let wrong = |line: u32, message: String| at_line(&self.file, line, message).help(help);
        let ordinals =
            self.ordinals.iter().filter(|(ordinal, _)| *ordinal > last).take(MOST_SHOWN).map(|(ordinal, line)| {
                wrong(*line, format!("target {ordinal} is not in the program, which has {last} motion targets"))
            });
        let names = self.names.iter().filter(|(name, _)| !named(name)).take(MOST_SHOWN);
        let names = names.map(|(name, line)| wrong(*line, format!("target `{name}` is not in the program")));
        let mut wrong: Vec<Diagnostic> = ordinals.chain(names).collect();
        wrong.sort_by_key(|diagnostic| diagnostic.line);
        wrong.truncate(MOST_SHOWN);
        if wrong.is_empty() { Ok(()) } else { Err(wrong) }
    }
}

#[cfg(test)]
mod tests {
    use super::ForceFile;

    #[test]
    fn forces_in_another_unit_are_doubted() {
        let doubt = |largest: f64| {
            let none = ForceFile {
                file: "forces.csv".to_owned(),
                ordinals: Vec::new(),
                names: Vec::new(),
                largest: Some(largest),
                notes: Vec::new(),
            };
            none.doubts().next().map(|doubt| doubt.message)
        };
        assert!(doubt(0.46).is_some_and(|said| said.contains("0.460 N") && said.ends_with("it looks like kN")));
        assert!(doubt(465_000.0).is_some_and(|said| said.ends_with("it looks like mN")));
        assert_eq!([0.0, 5.0, 12_000.0].map(doubt), [None, None, None]);
    }
}
