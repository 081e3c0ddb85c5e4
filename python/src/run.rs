use crate::arrays::{numbers_by_name, report};
use crate::cell::Cell;
use crate::errors::{OrRaise, diagnostics};
use crate::program::Program;
use crate::work;
use deflex::cell::{examples_left, with_path_law};
use deflex::correct::{Correct, PostOptions};
use deflex::identify::{Ask, PlanProgram, Written};
use deflex::measured::ColumnNames;
use deflex::program::Language;
use deflex::report::html::PathKind;
use deflex::report::{identify_text, path_csv, path_law_text, plan_text, residual_csv, summary_line};
use deflex::session::{self, CellSource, MeasuredFile, MeasuredRunFiles, ProgramFiles, Run, Tolerances};
use deflex::text::{Diagnostic, Source};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A table: its name and its text.
type Table = (String, PyBackedBytes);

fn source((name, text): Table) -> Source {
    Source::new(name, &text[..])
}

/// Reads a table as the command does: its name and its text.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts it
pub(crate) fn read_table(py: Python<'_>, path: PathBuf) -> PyResult<(String, Bound<'_, PyBytes>)> {
    let read = work::detached(py, || session::read_file(&path)).or_raise(py)?;
    Ok((read.name, PyBytes::new(py, &read.bytes)))
}

/// The columns of a report as arrays.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts it
pub(crate) fn columns(py: Python<'_>, csv: PyBackedBytes) -> PyResult<Bound<'_, PyDict>> {
    report(py, &csv)
}

/// A run of one program, with everything that it depends on, so that it can be repeated in another process.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Call<'py> {
    command: String,
    program: PyRef<'py, Program>,
    cell: PyRef<'py, Cell>,
    forces: Option<Table>,
    against: Option<PyRef<'py, Program>>,
    position: bool,
    tool: Option<String>,
    subdivide_mm: Option<f64>,
    allow_clones: bool,
    free_spin: bool,
    again: bool,
    post: String,
    name: Option<String>,
    max_targets: Option<usize>,
    rapid_mm_s: Option<f64>,
    feed_mm_s: Option<f64>,
    max_error_mm: f64,
    max_path_error_mm: Option<f64>,
    max_jump_mm: Option<f64>,
    max_correction_mm: Option<f64>,
    at_targets: bool,
    allow_unjudged: bool,
}

/// The same without Python's objects.
struct Job {
    kind: PathKind,
    files: Arc<ProgramFiles>,
    against: Option<Arc<ProgramFiles>>,
    forces: Option<Source>,
    run: Run,
    tolerances: Tolerances,
}

impl Call<'_> {
    fn job(self) -> Job {
        let files = Arc::clone(&self.program.files);
        let mut run = Run::new(Arc::clone(&self.cell.file));
        let options = run.options();
        options.correct = if self.position { Correct::Position } else { Correct::Pose };
        options.tool = self.tool;
        options.subdivide = self.subdivide_mm.map(|mm| 1e-3 * mm);
        options.allow_clones = self.allow_clones;
        options.free_spin = self.free_spin;
        let language = Language::ALL.into_iter().find(|known| known.word() == self.post);
        options.post = language;
        run.again = self.again;
        let kind = match &self.command[..] {
            "compensate" => PathKind::Compensate,
            "check" => PathKind::Check,
            _ => PathKind::Predict,
        };
        run.max_path_error = self.max_path_error_mm.filter(|_| kind == PathKind::Compensate).map(|mm| 1e-3 * mm);
        let post = Run::posted_from(files.names().first().map_or(Path::new("program"), |name| name));
        run.post = Some(PostOptions {
            name: self.name.unwrap_or(post.name),
            max_targets: self.max_targets,
            rapid_mm_s: self.rapid_mm_s.unwrap_or(post.rapid_mm_s),
            feed_mm_s: self.feed_mm_s,
            language: language.unwrap_or(post.language),
            ..post
        });
        let tolerances = Tolerances {
            max_error: self.max_error_mm,
            max_path_error: self.max_path_error_mm,
            max_jump: self.max_jump_mm,
            max_correction: self.max_correction_mm,
            at_targets: self.at_targets,
            allow_unjudged: self.allow_unjudged,
        };
        let against = self.against.map(|program| Arc::clone(&program.files));
        Job { kind, files, against, forces: self.forces.map(source), run, tolerances }
    }
}

/// The result of a run of one program.
struct Done {
    files: Vec<(PathBuf, Vec<u8>)>,
    csv: Vec<u8>,
    json: String,
    text: String,
    /// The findings of a check in the formats that CI systems read.
    forms: Vec<(&'static str, String)>,
    notes: Vec<Diagnostic>,
}

impl Job {
    fn ready(mut self) -> Result<Self, Vec<Diagnostic>> {
        match self.forces.take() {
            Some(forces) => self.run.take_forces(&forces).map(|()| self),
            None => Ok(self),
        }
    }

    fn done(self) -> Result<Done, Vec<Diagnostic>> {
        let (files, against, run) = (&self.files, self.against.as_deref(), &self.run);
        if self.kind == PathKind::Check {
            let checked = session::check(files, against, run, &self.tolerances)?;
            let forms = vec![("sarif", checked.sarif()?), ("junit", checked.junit())];
            let (json, text) = (checked.json()?, checked.text());
            return Ok(Done { files: Vec::new(), csv: checked.csv, json, text, forms, notes: checked.notes });
        }
        let done = match self.kind {
            PathKind::Compensate => session::compensate(files, run)?,
            _ => session::predict(files, against, run)?,
        };
        let companions = if done.files.is_empty() { &[][..] } else { files.companions() };
        Ok(Done {
            files: done.files.iter().chain(companions).cloned().collect(),
            csv: done.csv,
            json: serde_json::to_string(&done.summary).unwrap_or_default(),
            text: summary_line(&done.summary, self.kind),
            forms: Vec::new(),
            notes: done.notes,
        })
    }
}

/// A result as a dictionary of Python.
fn results<'py>(
    py: Python<'py>,
    texts: impl IntoIterator<Item = (&'static str, String)>,
    bytes: impl IntoIterator<Item = (&'static str, Vec<u8>)>,
    notes: Vec<Diagnostic>,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for (name, text) in texts {
        all.set_item(name, text)?;
    }
    for (name, bytes) in bytes {
        all.set_item(name, PyBytes::new(py, &bytes))?;
    }
    all.set_item("notes", diagnostics(notes))?;
    Ok(all)
}

/// Predicts, corrects or checks.
#[pyfunction]
pub(crate) fn run<'py>(
    py: Python<'py>,
    call: Call<'py>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let total = call.program.bytes();
    let mut job = call.job();
    let done = work::run(py, (progress.as_ref(), total), move |follow| {
        job.run.follow = Some(follow.follow());
        job.ready()?.done()
    })?;
    let texts = [("json", done.json), ("text", done.text)].into_iter().chain(done.forms);
    let all = results(py, texts, [("csv", done.csv)], done.notes)?;
    let files = PyDict::new(py);
    for (name, bytes) in &done.files {
        files.set_item(name.display().to_string(), PyBytes::new(py, bytes))?;
    }
    all.set_item("files", files)?;
    Ok(all)
}

/// The page of a run.
#[pyfunction]
pub(crate) fn page(py: Python<'_>, call: Call<'_>) -> PyResult<String> {
    let job = call.job();
    let page = || {
        let job = job.ready()?;
        let (files, against, run) = (&job.files, job.against.as_deref(), &job.run);
        match job.kind {
            PathKind::Check => session::check_page(files, against, run, &job.tolerances),
            PathKind::Compensate => session::compensate_page(files, run),
            _ => session::predict_page(files, against, run),
        }
    };
    work::detached(py, page).or_raise(py)
}

/// The numbers of the report of a run with all digits.
#[pyfunction]
pub(crate) fn unrounded<'py>(py: Python<'py>, call: Call<'py>) -> PyResult<Bound<'py, PyDict>> {
    let job = call.job();
    let numbers = || {
        let job = job.ready()?;
        match job.kind {
            PathKind::Compensate => session::compensate_unrounded(&job.files, &job.run),
            _ => session::predict_unrounded(&job.files, job.against.as_deref(), &job.run),
        }
    };
    numbers_by_name(py, work::detached(py, numbers).or_raise(py)?.columns())
}

/// The path that the controller drives, as CSV.
#[pyfunction]
pub(crate) fn driven_path<'py>(py: Python<'py>, call: Call<'py>) -> PyResult<Bound<'py, PyBytes>> {
    let job = call.job();
    let path = || {
        let job = job.ready()?;
        session::driven_path(&job.files, &job.run)
    };
    let path = work::detached(py, path).or_raise(py)?;
    Ok(PyBytes::new(py, &path_csv(&path.samples)))
}

/// Writes files as one set, as the command does. None may replace a file of the program or the cell.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts them
pub(crate) fn write(
    py: Python<'_>,
    files: Vec<(PathBuf, PyBackedBytes)>,
    program: Option<PyRef<'_, Program>>,
    cell: Option<PyRef<'_, Cell>>,
) -> PyResult<()> {
    let parts = program.into_iter().map(|program| program.files.parts());
    let texts = parts.flat_map(|parts| parts.texts.into_iter().chain(parts.context)).map(|source| source.name);
    let read: Vec<String> = texts.chain(cell.map(|cell| cell.file.source().name.clone())).collect();
    work::run(py, (None, 0), move |_| {
        session::write(files.iter().map(|(path, bytes)| (path.clone(), &bytes[..])), &read)
    })
}

/// Compares two programs.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts them
pub(crate) fn diff<'py>(
    py: Python<'py>,
    original: PyRef<'py, Program>,
    corrected: PyRef<'py, Program>,
) -> PyResult<Bound<'py, PyDict>> {
    let (original, corrected) = (Arc::clone(&original.files), Arc::clone(&corrected.files));
    let compared = || {
        let compared = session::diff(&original, &corrected)?;
        Ok(([("json", compared.json()?), ("text", compared.text()), ("page", compared.page())], compared.csv()))
    };
    let (texts, csv) = work::detached(py, compared).or_raise(py)?;
    results(py, texts, [("csv", csv)], Vec::new())
}

/// Inspects files and folders.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts them
pub(crate) fn inspect<'py>(
    py: Python<'py>,
    paths: Vec<PathBuf>,
    context: Vec<PathBuf>,
    format: Option<&str>,
) -> PyResult<Bound<'py, PyDict>> {
    let format = format.map(|word| {
        let known = Language::ALL.into_iter().find(|language| language.word() == word);
        known.ok_or_else(|| PyValueError::new_err(format!("{word:?} is no language of programs")))
    });
    let format = format.transpose()?;
    let inspected = || {
        let found = session::inspect(&session::programs_in(&paths)?, &context, format, &|_, _| ())?;
        found.understood()?;
        Ok([("json", found.json()?), ("text", found.text())])
    };
    let texts = work::detached(py, inspected).or_raise(py)?;
    results(py, texts, [], Vec::new())
}

/// The text of a cell file to start from.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts them
pub(crate) fn init(
    py: Python<'_>,
    robot: Option<&str>,
    urdf: Option<PathBuf>,
    tip: Option<&str>,
    backup: Option<PathBuf>,
) -> PyResult<String> {
    let from = match (robot, &urdf, &backup) {
        (None, Some(file), None) => CellSource::Urdf { file, tip },
        (robot, None, Some(folder)) => CellSource::Backup { folder, robot },
        (Some(model), None, None) => CellSource::Robot(model),
        _ => return Err(PyValueError::new_err("give robot, urdf, or backup with or without robot")),
    };
    work::detached(py, || session::init(from)).or_raise(py)
}

/// Names of the columns of measured files, and largest distance from the path of a row without a target, mm.
struct ReadAs(Option<ColumnNames>, f64);

/// Parts of the work that progress is counted in.
const STEPS: u64 = 1000;

/// A share of the work in them.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // of a thousand
fn steps(share: f64) -> u64 {
    (share * STEPS as f64) as u64
}

/// How measured files are read: the tool, names of the columns, and largest distance from the path of a row without a target, mm.
type Reading = (Option<String>, Option<String>, Option<f64>);

fn read_as(columns: Option<&str>, match_mm: Option<f64>) -> Result<ReadAs, Vec<Diagnostic>> {
    let names = columns.map(ColumnNames::parse).transpose()?;
    Ok(ReadAs(names, match_mm.unwrap_or(deflex::measured::MATCH_MM)))
}

impl ReadAs {
    fn measured(&self, table: Table) -> MeasuredFile {
        MeasuredFile::of(source(table)).read_as(self.0.clone(), self.1)
    }
}

/// Identifies the effects that a cell lacks.
#[pyfunction]
pub(crate) fn identify<'py>(
    py: Python<'py>,
    runs: Vec<(PyRef<'py, Program>, Option<PyRef<'py, Program>>, Table)>,
    poses: Vec<Table>,
    cell: PyRef<'py, Cell>,
    reading: Reading,
    sparse: bool,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (tool, columns, match_mm) = reading;
    let files = |program: PyRef<'_, Program>| Arc::clone(&program.files);
    let runs: Vec<(Arc<ProgramFiles>, Option<Arc<ProgramFiles>>, Table)> =
        runs.into_iter().map(|(program, original, table)| (files(program), original.map(files), table)).collect();
    let cell = Arc::clone(&cell.file);
    let (texts, csv, notes) = work::run(py, (progress.as_ref(), STEPS), move |follow| {
        let read_as = read_as(columns.as_deref(), match_mm)?;
        let files = |program: Arc<ProgramFiles>| program.as_ref().clone();
        let read = |(program, original, table): (Arc<ProgramFiles>, Option<Arc<ProgramFiles>>, Table)| {
            let measured = read_as.measured(table);
            MeasuredRunFiles { program: files(program), original: original.map(files), measured }
        };
        let runs: Vec<MeasuredRunFiles> = runs.into_iter().map(read).collect();
        let poses: Vec<MeasuredFile> = poses.into_iter().map(|table| read_as.measured(table)).collect();
        let written = if sparse { Written::NamedAlone } else { Written::WholeModel };
        let follow = follow.follow();
        let progress = |share| follow(0, steps(share));
        let found = session::identify(&cell, &runs, &poses, tool.as_deref(), written, &progress)?;
        let texts = [
            ("json", found.json(None)?),
            ("text", identify_text(&found.found)),
            ("cell", found.cell()?),
            ("page", found.page()),
        ];
        let notes = examples_left(cell.source()).into_iter().chain(cell.cell().notes.clone());
        let notes = notes.chain(found.notes).collect();
        Ok((texts, residual_csv(&found.found.residuals).into_bytes(), notes))
    })?;
    results(py, texts, [("csv", csv)], notes)
}

/// Fits the law of the controller's path to logs.
#[pyfunction]
pub(crate) fn identify_path<'py>(
    py: Python<'py>,
    logs: Vec<(PyRef<'py, Program>, Table)>,
    cell: PyRef<'py, Cell>,
    reading: Reading,
) -> PyResult<Bound<'py, PyDict>> {
    let (tool, columns, match_mm) = reading;
    let logs: Vec<(ProgramFiles, Table)> =
        logs.into_iter().map(|(program, table)| (program.files.as_ref().clone(), table)).collect();
    let cell = Arc::clone(&cell.file);
    let texts = work::run(py, (None, 0), move |_| {
        let read_as = read_as(columns.as_deref(), match_mm)?;
        let logs: Vec<(ProgramFiles, MeasuredFile)> =
            logs.into_iter().map(|(program, table)| (program, read_as.measured(table))).collect();
        let law = session::identify_path(&cell, &logs, tool.as_deref())?;
        let text = String::from_utf8_lossy(&cell.source().bytes);
        let json = serde_json::to_string(&BTreeMap::from([("path", &law)])).unwrap_or_default();
        Ok([("json", json), ("text", path_law_text(&law)), ("cell", with_path_law(&text, &law)?)])
    })?;
    results(py, texts, [], Vec::new())
}

/// Simulates the cut.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    call: Call<'py>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let job = call.job();
    let (texts, bytes, notes) = work::run(py, (progress.as_ref(), STEPS), move |follow| {
        let job = job.ready()?;
        let follow = follow.follow();
        let progress: Arc<session::SimulationProgress> = Arc::new(move |share| follow(0, steps(share)));
        let simulated = session::simulate(&job.files, job.against.as_deref(), &job.run, &progress)?;
        let texts = [("json", simulated.json()?), ("text", simulated.text()), ("page", simulated.page())];
        Ok((texts, [("csv", simulated.csv()), ("stl", simulated.stl())], simulated.notes))
    })?;
    results(py, texts, bytes, notes)
}

/// Plans a measurement.
#[pyfunction]
pub(crate) fn plan<'py>(
    py: Python<'py>,
    cell: PyRef<'py, Cell>,
    rows: usize,
    pool: Vec<PyRef<'py, Program>>,
    after: Option<String>,
    written: (String, Option<String>, String),
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (name, post, ask) = written;
    let post = post.and_then(|post| Language::ALL.into_iter().find(|known| known.word() == post));
    let ask = match &ask[..] {
        "load" => Ask::Load,
        "target" => Ask::Target,
        _ => Ask::Never,
    };
    let pool: Vec<ProgramFiles> = pool.iter().map(|program| program.files.as_ref().clone()).collect();
    let cell = Arc::clone(&cell.file);
    let texts = work::run(py, (progress.as_ref(), STEPS), move |follow| {
        let follow = follow.follow();
        let progress = |share: f64| {
            follow(0, steps(share));
        };
        let after = after.map(|json| Source::new("<identification>", json));
        let language = post.or(cell.cell().language).unwrap_or(Language::Rapid);
        let program = PlanProgram { name: &name, language, ask };
        let planned = session::plan(&cell, rows, &pool, after.as_ref(), program, &progress)?;
        let (json, page, text) = (planned.json()?, planned.page(), plan_text(&planned.found));
        let found = planned.found;
        Ok([("json", json), ("page", page), ("text", text), ("program", found.program), ("table", found.table)])
    })?;
    results(py, texts, [], Vec::new())
}
