use crate::arrays::{numbers_by_name, report};
use crate::cell::Cell;
use crate::errors::{Diagnostic, OrRaise, diagnostics};
use crate::program::Program;
use crate::work;
use deflex::correct::{Correct, PostOptions};
use deflex::identify::{Ask, PlanProgram, Written};
use deflex::measured::ColumnNames;
use deflex::program::Language;
use deflex::report::html::PathKind;
use deflex::report::{identify_text, plan_text, residual_csv, summary_line};
use deflex::session::{self, CellFile, MeasuredFile, MeasuredRunFiles, ProgramFiles, Run};
use deflex::text::Source;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// A table: the path of a file, or a name and the text of one.
#[derive(FromPyObject)]
pub(crate) enum Table {
    #[pyo3(transparent)]
    Held((String, String)),
    #[pyo3(transparent)]
    File(PathBuf),
}

impl Table {
    fn give_to(&self, run: &mut Run) -> Result<(), Vec<deflex::text::Diagnostic>> {
        match self {
            Self::File(path) => run.read_forces(path),
            Self::Held((name, text)) => run.take_forces(&Source::new(&**name, &**text)),
        }
    }

    fn measured(self, read_as: &ReadAs) -> Result<MeasuredFile, Vec<deflex::text::Diagnostic>> {
        let file = match self {
            Self::File(path) => MeasuredFile::read(&path)?,
            Self::Held((name, text)) => MeasuredFile::of(Source::new(name, text)),
        };
        Ok(file.read_as(read_as.0.clone(), read_as.1))
    }
}

/// Names of the columns of measured files, and how far from the path a row without a target may lie, mm.
struct ReadAs(Option<ColumnNames>, f64);

/// What a program came to.
#[pyclass(frozen, module = "deflex._deflex")]
pub(crate) struct Done {
    done: session::Done,
    program: Arc<ProgramFiles>,
    /// Of a prediction: the original, where there is one.
    against: Option<Option<Arc<ProgramFiles>>>,
    run: Run,
    notes: Mutex<Vec<deflex::text::Diagnostic>>,
}

#[pymethods]
impl Done {
    #[getter]
    fn files<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let files = PyDict::new(py);
        let companions = if self.done.files.is_empty() { &[][..] } else { self.program.companions() };
        for (name, bytes) in self.done.files.iter().chain(companions) {
            files.set_item(name.display().to_string(), PyBytes::new(py, bytes))?;
        }
        Ok(files)
    }

    #[getter]
    fn csv<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.done.csv)
    }

    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report(py, &self.done.csv)
    }

    /// Its numbers as they are before they are printed.
    fn unrounded<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let numbers = || match &self.against {
            Some(original) => session::predict_unrounded(&self.program, original.as_deref(), &self.run),
            None => session::compensate_unrounded(&self.program, &self.run),
        };
        numbers_by_name(py, work::detached(py, numbers).or_raise(py)?.columns())
    }

    #[getter]
    fn summary(&self) -> String {
        serde_json::to_string(&self.done.summary).unwrap_or_default()
    }

    #[getter]
    fn line(&self) -> String {
        let kind = if self.against.is_some() { PathKind::Predict } else { PathKind::Compensate };
        summary_line(&self.done.summary, kind)
    }

    #[getter]
    fn notes(&self) -> Vec<Diagnostic> {
        diagnostics(self.notes.lock().unwrap_or_else(PoisonError::into_inner).clone())
    }

    /// Writes files under these paths as one set, as the command does; `inputs` are files that none may replace, other than those that
    /// were read.
    fn write(&self, py: Python<'_>, files: Vec<(PathBuf, PyBackedBytes)>, inputs: Vec<PathBuf>) -> PyResult<()> {
        let sources: Vec<PathBuf> = self.program.sources().iter().map(|source| PathBuf::from(&source.name)).collect();
        let read: Vec<PathBuf> =
            sources.into_iter().chain(self.run.inputs().map(Path::to_owned)).chain(inputs).collect();
        work::run(py, (None, 0), move |_| {
            session::write(files.iter().map(|(path, bytes)| (path.clone(), &bytes[..])), &read)
        })
    }

    fn page(&self, py: Python<'_>) -> PyResult<String> {
        let page = || match &self.against {
            Some(original) => session::predict_page(&self.program, original.as_deref(), &self.run),
            None => session::compensate_page(&self.program, &self.run),
        };
        work::detached(py, page).or_raise(py)
    }
}

/// Options that a run has in common with the command, already in its units.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Asked {
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
}

impl Asked {
    fn run(self, cell: &Arc<CellFile>, program: &ProgramFiles) -> Run {
        let mut run = Run::new(Arc::clone(cell));
        let options = run.options();
        options.correct = if self.position { Correct::Position } else { Correct::Pose };
        options.tool = self.tool;
        options.subdivide = self.subdivide_mm.map(|mm| 1e-3 * mm);
        options.allow_clones = self.allow_clones;
        options.free_spin = self.free_spin;
        let language = Language::ALL.into_iter().find(|known| known.word() == self.post);
        options.post = language;
        run.again = self.again;
        let post = Run::posted_from(program.names().first().map_or(Path::new("program"), |name| name));
        run.post = Some(PostOptions {
            name: self.name.unwrap_or(post.name),
            max_targets: self.max_targets,
            rapid_mm_s: self.rapid_mm_s.unwrap_or(post.rapid_mm_s),
            feed_mm_s: self.feed_mm_s,
            language: language.unwrap_or(post.language),
            ..post
        });
        run
    }
}

type Held<'py> = (PyRef<'py, Program>, PyRef<'py, Cell>);

fn done(
    py: Python<'_>,
    (program, cell): Held<'_>,
    forces: Option<Table>,
    asked: Asked,
    against: Option<Option<Arc<ProgramFiles>>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Done> {
    let (files, total) = (Arc::clone(&program.files), program.bytes());
    let mut run = asked.run(&cell.file, &files);
    work::run(py, (progress, total), move |follow| {
        forces.map_or(Ok(()), |forces| forces.give_to(&mut run))?;
        run.follow = Some(follow.follow());
        let mut done = match &against {
            Some(original) => session::predict(&files, original.as_deref(), &run)?,
            None => session::compensate(&files, &run)?,
        };
        let notes = Mutex::new(std::mem::take(&mut done.notes));
        // The page is another run, whose progress is not shown.
        run.follow = None;
        Ok(Done { done, program: files, against, run, notes })
    })
}

/// Predicts.
#[pyfunction]
pub(crate) fn predict(
    py: Python<'_>,
    held: Held<'_>,
    forces: Option<Table>,
    against: Option<PyRef<'_, Program>>,
    asked: Asked,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Done> {
    let against = against.map(|program| Arc::clone(&program.files));
    done(py, held, forces, asked, Some(against), progress.as_ref())
}

/// Corrects.
#[pyfunction]
pub(crate) fn compensate(
    py: Python<'_>,
    held: Held<'_>,
    forces: Option<Table>,
    asked: Asked,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Done> {
    done(py, held, forces, asked, None, progress.as_ref())
}

/// Parts of the work that progress is told in.
const STEPS: u64 = 1000;

/// A share of the work in them.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // of a thousand
fn steps(share: f64) -> u64 {
    (share * STEPS as f64) as u64
}

/// What was identified.
#[pyclass(frozen, module = "deflex._deflex")]
pub(crate) struct Found {
    found: session::Identified,
}

#[pymethods]
impl Found {
    #[getter]
    fn json(&self, py: Python<'_>) -> PyResult<String> {
        self.found.json(None).or_raise(py)
    }

    #[getter]
    fn text(&self) -> String {
        identify_text(&self.found.found)
    }

    #[getter]
    fn csv<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, residual_csv(&self.found.found.residuals).as_bytes())
    }

    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report(py, residual_csv(&self.found.found.residuals).as_bytes())
    }

    #[pyo3(signature = (name = "cell.toml"))]
    fn cell(&self, py: Python<'_>, name: &str) -> PyResult<Cell> {
        let text = self.found.cell().or_raise(py)?;
        Cell::parse(py, &text, name)
    }

    fn page(&self, py: Python<'_>) -> String {
        work::detached(py, || self.found.page())
    }
}

/// Identifies.
#[pyfunction]
pub(crate) fn identify(
    py: Python<'_>,
    runs: Vec<(PyRef<'_, Program>, Option<PyRef<'_, Program>>, Table)>,
    poses: Vec<Table>,
    cell: PyRef<'_, Cell>,
    read_as: (Option<String>, Option<String>, Option<f64>),
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let (tool, columns, match_mm) = read_as;
    let files = |program: PyRef<'_, Program>| Arc::clone(&program.files);
    let runs: Vec<(Arc<ProgramFiles>, Option<Arc<ProgramFiles>>, Table)> =
        runs.into_iter().map(|(program, original, table)| (files(program), original.map(files), table)).collect();
    let cell = Arc::clone(&cell.file);
    let found = work::run(py, (progress.as_ref(), STEPS), move |follow| {
        let names = columns.as_deref().map(ColumnNames::parse).transpose()?;
        let read_as = ReadAs(names, match_mm.unwrap_or(deflex::measured::MATCH_MM));
        let files = |program: Arc<ProgramFiles>| program.as_ref().clone();
        let read = |(program, original, table): (Arc<ProgramFiles>, Option<Arc<ProgramFiles>>, Table)| {
            let measured = table.measured(&read_as)?;
            Ok(MeasuredRunFiles { program: files(program), original: original.map(files), measured })
        };
        let runs = runs.into_iter().map(read).collect::<Result<Vec<_>, Vec<deflex::text::Diagnostic>>>()?;
        let poses = poses.into_iter().map(|table| table.measured(&read_as)).collect::<Result<Vec<_>, _>>()?;
        let follow = follow.follow();
        session::identify(&cell, &runs, &poses, tool.as_deref(), Written::default(), &|share| follow(0, steps(share)))
    })?;
    Ok(Found { found })
}

/// What was simulated.
#[pyclass(frozen, module = "deflex._deflex")]
pub(crate) struct Simulated {
    simulated: session::Simulated,
}

#[pymethods]
impl Simulated {
    #[getter]
    fn json(&self, py: Python<'_>) -> PyResult<String> {
        self.simulated.json().or_raise(py)
    }

    #[getter]
    fn text(&self) -> String {
        self.simulated.text()
    }

    #[getter]
    fn csv<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.simulated.csv())
    }

    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        report(py, &self.simulated.csv())
    }

    #[getter]
    fn stl<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &work::detached(py, || self.simulated.stl()))
    }

    #[getter]
    fn notes(&self) -> Vec<Diagnostic> {
        diagnostics(self.simulated.notes.clone())
    }

    fn page(&self, py: Python<'_>) -> String {
        work::detached(py, || self.simulated.page())
    }
}

/// Cuts.
#[pyfunction]
pub(crate) fn simulate(
    py: Python<'_>,
    held: Held<'_>,
    forces: Option<Table>,
    against: Option<PyRef<'_, Program>>,
    asked: Asked,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Simulated> {
    let (program, cell) = held;
    let (files, against) = (Arc::clone(&program.files), against.map(|program| Arc::clone(&program.files)));
    let mut run = asked.run(&cell.file, &files);
    let simulated = work::run(py, (progress.as_ref(), STEPS), move |follow| {
        forces.map_or(Ok(()), |forces| forces.give_to(&mut run))?;
        let follow = follow.follow();
        let told: Arc<session::SimulationProgress> = Arc::new(move |share| follow(0, steps(share)));
        session::simulate(&files, against.as_deref(), &run, &told)
    })?;
    Ok(Simulated { simulated })
}

/// What was planned.
#[pyclass(frozen, module = "deflex._deflex")]
pub(crate) struct Planned {
    planned: session::Planned,
}

#[pymethods]
impl Planned {
    #[getter]
    fn json(&self, py: Python<'_>) -> PyResult<String> {
        self.planned.json().or_raise(py)
    }

    #[getter]
    fn text(&self) -> String {
        plan_text(&self.planned.found)
    }

    #[getter]
    fn program(&self) -> &str {
        &self.planned.found.program
    }

    #[getter]
    fn table(&self) -> &str {
        &self.planned.found.table
    }

    fn page(&self, py: Python<'_>) -> String {
        work::detached(py, || self.planned.page())
    }
}

/// Plans.
#[pyfunction]
pub(crate) fn plan(
    py: Python<'_>,
    cell: PyRef<'_, Cell>,
    rows: usize,
    pool: Vec<PyRef<'_, Program>>,
    after: Option<String>,
    written: (String, Option<String>, String),
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Planned> {
    let (name, post, ask) = written;
    let post = post.and_then(|post| Language::ALL.into_iter().find(|known| known.word() == post));
    let ask = match &ask[..] {
        "load" => Ask::Load,
        "target" => Ask::Target,
        _ => Ask::Never,
    };
    let pool: Vec<ProgramFiles> = pool.iter().map(|program| program.files.as_ref().clone()).collect();
    let cell = Arc::clone(&cell.file);
    let planned = work::run(py, (progress.as_ref(), STEPS), move |follow| {
        let follow = follow.follow();
        let tell = |share: f64| {
            follow(0, steps(share));
        };
        let after = after.map(|json| Source::new("<identification>", json));
        let language = post.or(cell.cell().language).unwrap_or(Language::Rapid);
        let program = PlanProgram { name: &name, language, ask };
        session::plan(&cell, rows, &pool, after.as_ref(), program, &tell)
    })?;
    Ok(Planned { planned })
}
