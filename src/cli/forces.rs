//! The table of forces, and whether it is that of a program.

use super::input::cannot_read;
use deflex::correct::Forces;
use deflex::measured::{Rows, TargetRef};
use deflex::program::Program;
use deflex::text::Diagnostic;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Rows of a table of forces in its file: which target each names, and its line.
#[derive(Debug)]
pub(super) struct ForceFile {
    file: String,
    /// As many as the program has targets.
    ordinals: Vec<(u32, u32)>,
    names: Vec<(String, u32)>,
}

impl ForceFile {
    /// What the table says of targets, and what is needed to tell whether it is a program's own.
    pub(super) fn read(path: &Path) -> Result<(Self, Forces), Vec<Diagnostic>> {
        let file = path.display().to_string();
        let input: Box<dyn Read> = if file == "-" {
            Box::new(std::io::stdin().lock())
        } else {
            Box::new(File::open(path).map_err(|error| cannot_read(&file, &error))?)
        };
        let (mut errors, mut ordinals, mut names) = (Vec::new(), Vec::new(), Vec::new());
        let forces = Rows::new(&file, input)?.filter_map(|row| match row {
            Ok(row) => {
                let line = u32::try_from(row.line).unwrap_or(u32::MAX);
                match row.target.as_ref()? {
                    TargetRef::Ordinal(ordinal) => ordinals.push((*ordinal, line)),
                    TargetRef::Name(name) => names.push((name.clone(), line)),
                    _ => return None,
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
        if errors.is_empty() { Ok((Self { file, ordinals, names }, forces)) } else { Err(errors) }
    }

    /// Rows that belong to no target of a program: the table is another program's.
    pub(super) fn check(&self, program: &Program) -> Result<(), Vec<Diagnostic>> {
        let last = program.targets.last().map_or(0, |target| target.ordinal);
        self.check_targets(last, |name| {
            program.targets.iter().any(|t| t.name.as_ref().is_some_and(|known| known.eq_ignore_ascii_case(name)))
        })
    }

    /// The same for a program with this last target, and targets of these names.
    pub(super) fn check_targets(&self, last: u32, named: impl Fn(&str) -> bool) -> Result<(), Vec<Diagnostic>> {
        const MOST: usize = 10; // a wrong table is wrong in every row
        let wrong = |line: u32, message: String| {
            let mut diagnostic = Diagnostic::error("forces.target", &self.file, message)
                .help("targets are counted from 1 in the order they run, or named as declared");
            (diagnostic.line, diagnostic.column) = (line as usize, 1);
            diagnostic
        };
        let ordinals = self.ordinals.iter().filter(|(ordinal, _)| *ordinal > last).take(MOST).map(|(ordinal, line)| {
            wrong(*line, format!("target {ordinal} is not in the program, which has {last} motion targets"))
        });
        let names = self.names.iter().filter(|(name, _)| !named(name)).take(MOST);
        let names = names.map(|(name, line)| wrong(*line, format!("target `{name}` is not in the program")));
        let mut wrong: Vec<Diagnostic> = ordinals.chain(names).collect();
        wrong.sort_by_key(|diagnostic| diagnostic.line);
        wrong.truncate(MOST);
        if wrong.is_empty() { Ok(()) } else { Err(wrong) }
    }
}
