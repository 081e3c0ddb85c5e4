use super::{CellFile, ProgramFiles};
use crate::cli::files::{all, both};
use crate::cli::input;
use crate::cli::report::pretty;
use deflex::cell::extended;
use deflex::identify::{self, Identification, Input, Progress};
use deflex::measured::{ColumnNames, Table};
use deflex::report::html::identification_page;
use deflex::report::{Origin, VERSION};
use deflex::text::{Diagnostic, Source};
use std::path::Path;

/// A measured file, read and not yet parsed.
#[derive(Clone, Debug)]
pub struct MeasuredFile {
    source: Source,
    names: Option<ColumnNames>,
    match_mm: Option<f64>,
}

impl MeasuredFile {
    /// Reads the file at a path, `-` being stdin.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn read(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        crate::cli::files::source(path).map(Self::of)
    }

    /// A table that is held.
    #[must_use]
    pub fn of(table: Source) -> Self {
        Self { source: table, names: None, match_mm: None }
    }

    /// The same with other names for its columns, and how far from the path a row without a target may lie, mm: `--columns`
    /// and `--match-mm`.
    #[must_use]
    pub fn read_as(self, names: Option<ColumnNames>, match_mm: f64) -> Self {
        Self { names, match_mm: Some(match_mm), ..self }
    }

    /// The table, with the names that were given for its columns, else with the cell's.
    fn table(&self, cell: &CellFile) -> Result<Table, Vec<Diagnostic>> {
        let table = Table::read_named(&self.source, self.names.as_ref().or(cell.cell.columns.as_ref()))?;
        Ok(Table { match_mm: self.match_mm, ..table })
    }
}

/// An identification with what it was made from.
#[derive(Debug)]
#[non_exhaustive]
pub struct Identified {
    /// What was found.
    pub found: Identification,
    /// What is said of the measured files.
    pub notes: Vec<Diagnostic>,
    cell: Origin,
    data: Vec<Origin>,
    cell_text: String,
    cell_name: String,
}

impl Identified {
    /// The cell file with the effects found, and the user's comments.
    ///
    /// # Errors
    /// The cell file cannot be extended.
    pub fn cell(&self) -> Result<String, Vec<Diagnostic>> {
        let text = extended(&self.cell_text, &self.found.extended);
        text.map_err(|errors| input::own(&self.cell_name, errors))
    }

    /// What `--json` writes.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn json(&self) -> Result<String, Vec<Diagnostic>> {
        #[derive(serde::Serialize)]
        struct Told<'a> {
            #[serde(flatten)]
            found: &'a Identification,
            deflex: &'static str,
            cell: &'a Origin,
            sources: &'a [Origin],
        }
        pretty(&Told { found: &self.found, deflex: VERSION, cell: &self.cell, sources: &self.data })
    }

    /// The page that `--html` writes.
    #[must_use]
    pub fn page(&self) -> String {
        identification_page(&self.found, &self.cell, &self.data)
    }
}

/// Finds the effects that a cell lacks: what `deflex identify` does. `runs` are programs with what was measured on them, or
/// `poses` rows with their own motor angles; `tool` is that of `--tool`; `progress` is told what share of the work is done, and
/// calls it off with `false`.
///
/// # Errors
/// All for which the command ends with exit code 2, and `run.called-off`.
pub fn identify(
    cell: &CellFile,
    runs: &[(ProgramFiles, MeasuredFile)],
    poses: &[MeasuredFile],
    tool: Option<&str>,
    progress: &Progress<'_>,
) -> Result<Identified, Vec<Diagnostic>> {
    let read = |(program, table): &(ProgramFiles, MeasuredFile)| both(program.parse(cell, tool), table.table(cell));
    let (programs, tables) = both(all(runs.iter().map(read)), all(poses.iter().map(|poses| poses.table(cell))))?;
    let read = programs.iter().map(|(_, table)| table).chain(&tables);
    let notes = read.flat_map(|table| table.notes.iter().cloned()).collect();
    let measured = runs.iter().flat_map(|(program, table)| program.sources().into_iter().chain([&table.source]));
    let data: Vec<&Source> = measured.chain(poses.iter().map(|table| &table.source)).collect();
    let hash = hash(data.iter().copied().chain([&cell.source]));
    let input = Input { cell: &cell.cell, runs: programs, poses: tables, tool, data_hash: &hash, progress };
    let found = identify::identify(input).map_err(|errors| cell.own(errors))?;
    Ok(Identified {
        found,
        notes,
        cell: cell.origin(),
        data: data.into_iter().map(|source| Origin::of(&source.name, &source.bytes)).collect(),
        cell_text: String::from_utf8_lossy(&cell.source.bytes).into_owned(),
        cell_name: cell.name.clone(),
    })
}

/// FNV-1a over all files that the answer depends on: tells data apart, guards against nothing.
fn hash<'a>(sources: impl Iterator<Item = &'a Source>) -> String {
    let bytes = sources.flat_map(|source| &source.bytes);
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    format!("fnv1a:{hash:016x}")
}
