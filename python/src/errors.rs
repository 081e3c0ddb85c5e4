use deflex::text::{self, Severity, printable_line};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::{create_exception, intern};

create_exception!(deflex, DeflexError, PyException, "Why there is no answer; `diagnostics` says it place by place.");

/// A message: what is wrong, where, and what to do.
#[pyclass(frozen, eq, hash, module = "deflex")]
#[derive(Clone, PartialEq, Hash)]
pub(crate) struct Diagnostic {
    /// Stable short name.
    #[pyo3(get)]
    code: String,
    /// `note`, `warning` or `error`.
    #[pyo3(get)]
    severity: String,
    /// What is wrong and what was expected.
    #[pyo3(get)]
    message: String,
    /// What to do.
    #[pyo3(get)]
    help: Option<String>,
    /// File; empty where none is concerned.
    #[pyo3(get)]
    file: String,
    /// Line from 1; 0 where the whole file is meant.
    #[pyo3(get)]
    line: usize,
    /// Column from 1.
    #[pyo3(get)]
    column: usize,
    text: String,
}

impl From<text::Diagnostic> for Diagnostic {
    fn from(said: text::Diagnostic) -> Self {
        let mut text = said.to_string();
        if let Some(help) = &said.help {
            text += "\n  help: ";
            text += &printable_line(help);
        }
        Self {
            code: said.code.to_owned(),
            severity: match said.severity {
                Severity::Note => "note".to_owned(),
                Severity::Warning => "warning".to_owned(),
                Severity::Error => "error".to_owned(),
            },
            message: said.message,
            help: said.help,
            file: said.file,
            line: said.line,
            column: said.column,
            text,
        }
    }
}

#[pymethods]
impl Diagnostic {
    fn __str__(&self) -> &str {
        &self.text
    }

    fn __repr__(&self) -> String {
        format!("<{}>", self.text.replace('\n', ";"))
    }
}

/// Messages as Python sees them.
pub(crate) fn diagnostics(said: Vec<text::Diagnostic>) -> Vec<Diagnostic> {
    said.into_iter().map(Diagnostic::from).collect()
}

/// The exception for errors.
pub(crate) fn raised(py: Python<'_>, errors: Vec<text::Diagnostic>) -> PyErr {
    let all = diagnostics(errors);
    let text: Vec<&str> = all.iter().map(|one| &*one.text).collect();
    let error = DeflexError::new_err(text.join("\n"));
    match error.value(py).setattr(intern!(py, "diagnostics"), all) {
        Ok(()) => error,
        Err(other) => other,
    }
}

/// The value, or the exception.
pub(crate) trait OrRaise<T> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> OrRaise<T> for Result<T, Vec<text::Diagnostic>> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|errors| raised(py, errors))
    }
}

/// A message in parts, from which another process makes it again: code, severity, message, help, file, text, line and column.
type MessageParts = (String, String, String, Option<String>, String, String, usize, usize);

/// The parts of a message.
#[pyfunction]
pub(crate) fn diagnostic_parts(said: &Diagnostic) -> MessageParts {
    let said = said.clone();
    (said.code, said.severity, said.message, said.help, said.file, said.text, said.line, said.column)
}

/// A message of its parts.
#[pyfunction]
pub(crate) fn diagnostic_of(parts: MessageParts) -> Diagnostic {
    let (code, severity, message, help, file, text, line, column) = parts;
    Diagnostic { code, severity, message, help, file, text, line, column }
}
