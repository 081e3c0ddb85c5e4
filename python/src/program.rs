use crate::errors::OrRaise;
use crate::work;
use deflex::session::ProgramFiles;
use pyo3::prelude::*;
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
#[pyclass(frozen, module = "deflex")]
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
