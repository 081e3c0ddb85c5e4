use crate::errors::OrRaise;
use crate::work;
use deflex::program::Language;
use deflex::session::{ProgramFiles, ProgramParts};
use deflex::text::Source;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;
use std::path::PathBuf;
use std::sync::Arc;

/// One path or several.
#[derive(FromPyObject)]
pub(crate) enum Paths {
    #[pyo3(transparent)]
    One(PathBuf),
    #[pyo3(transparent)]
    Several(Vec<PathBuf>),
}

impl From<Paths> for Vec<PathBuf> {
    fn from(paths: Paths) -> Self {
        match paths {
            Paths::One(path) => vec![path],
            Paths::Several(paths) => paths,
        }
    }
}

/// The files of one program.
#[pyclass(frozen, eq, hash, module = "deflex")]
#[derive(PartialEq, Hash)]
pub(crate) struct Program {
    pub(crate) files: Arc<ProgramFiles>,
}

impl Program {
    /// Bytes of its files.
    pub(crate) fn bytes(&self) -> u64 {
        self.files.sources().iter().map(|source| source.bytes.len() as u64).sum()
    }
}

#[pymethods]
impl Program {
    /// Reads the files of one program; `context` are files that declare names and are never written.
    #[staticmethod]
    #[pyo3(signature = (paths, *, context = None, format = None))]
    fn read(py: Python<'_>, paths: Paths, context: Option<Paths>, format: Option<&str>) -> PyResult<Self> {
        let (paths, context) = (Vec::from(paths), context.map_or_else(Vec::new, Vec::from));
        let files = work::detached(py, || ProgramFiles::read(&paths, &context, format)).or_raise(py)?;
        Ok(Self { files: Arc::new(files) })
    }

    /// The files as they were given.
    #[getter]
    fn name(&self) -> &str {
        self.files.name()
    }

    /// `rapid`, `cl`, `krl`, `ls`, `ur` or `jbi`.
    #[getter]
    fn language(&self) -> &'static str {
        self.files.language().word()
    }

    /// Its files.
    #[getter]
    fn files(&self) -> Vec<&str> {
        self.files.sources().iter().map(|source| &*source.name).collect()
    }

    /// Executed motions in running order, loops with known bounds expanded.
    #[getter]
    fn motion_targets(&self, py: Python<'_>) -> PyResult<usize> {
        let parsed = work::detached(py, || self.files.parse_alone()).or_raise(py)?;
        Ok(parsed.motion_targets())
    }

    fn __repr__(&self) -> String {
        format!("Program({:?}, {}, {} bytes)", self.files.name(), self.language(), self.bytes())
    }
}

/// A named text.
type Named = (String, PyBackedBytes);

/// The parts of a program, which `pickle` passes to another process: name, language, files under their names, files that go
/// with them, and files that declare names.
type Parts = (String, String, Vec<Named>, Vec<PathBuf>, Vec<(PathBuf, PyBackedBytes)>, Vec<Named>);

/// The parts of a program.
#[pyfunction]
#[allow(clippy::type_complexity)] // a tuple for `pickle`
pub(crate) fn program_parts<'py>(
    py: Python<'py>,
    program: &Program,
) -> (
    String,
    &'static str,
    Vec<(String, Bound<'py, PyBytes>)>,
    Vec<PathBuf>,
    Vec<(PathBuf, Bound<'py, PyBytes>)>,
    Vec<(String, Bound<'py, PyBytes>)>,
) {
    let named = |sources: &[Source]| {
        sources.iter().map(|source| (source.name.clone(), PyBytes::new(py, &source.bytes))).collect()
    };
    let ProgramParts { name, language, texts, files, companions, context } = program.files.parts();
    let companions = companions.iter().map(|(name, bytes)| (name.clone(), PyBytes::new(py, bytes))).collect();
    (name, language.word(), named(&texts), files, companions, named(&context))
}

/// The program with these parts.
#[pyfunction]
pub(crate) fn program_of(parts: Parts) -> PyResult<Program> {
    let (name, language, texts, files, companions, context) = parts;
    let sources = |texts: Vec<Named>| texts.into_iter().map(|(name, text)| Source::new(name, &text[..])).collect();
    let language = Language::ALL.into_iter().find(|known| known.word() == language);
    let parts = ProgramParts {
        name,
        language: language.ok_or_else(|| PyValueError::new_err("the program is in no known language"))?,
        texts: sources(texts),
        files,
        companions: companions.into_iter().map(|(name, bytes)| (name, bytes.to_vec())).collect(),
        context: sources(context),
    };
    Ok(Program { files: Arc::new(parts.into()) })
}
