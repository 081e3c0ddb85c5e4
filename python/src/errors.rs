use deflex::text::{self, Severity, printable_line};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::{create_exception, intern};

create_exception!(
    deflex,
    DeflexError,
    PyException,
    "Why there is no answer; `diagnostics` has a message for each place."
);

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
    /// File; empty if the message concerns none.
    #[pyo3(get)]
    file: String,
    /// Line from 1; 0 if the message concerns the whole file.
    #[pyo3(get)]
    line: usize,
    /// Column from 1.
    #[pyo3(get)]
    column: usize,
    text: String,
}

impl From<text::Diagnostic> for Diagnostic {
    fn from(message: text::Diagnostic) -> Self {
        let mut text = message.to_string();
        if let Some(help) = &message.help {
            text += "\n  help: ";
            text += &printable_line(help);
        }
        Self {
            code: message.code.to_owned(),
            severity: match message.severity {
                Severity::Note => "note".to_owned(),
                Severity::Warning => "warning".to_owned(),
                Severity::Error => "error".to_owned(),
            },
            message: message.message,
            help: message.help,
            file: message.file,
            line: message.line,
            column: message.column,
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
pub(crate) fn diagnostics(messages: Vec<text::Diagnostic>) -> Vec<Diagnostic> {
    messages.into_iter().map(Diagnostic::from).collect()
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

/// The parts of a message, which `pickle` passes to another process: code, severity, message, help, file, text, line and column.
type MessageParts = (String, String, String, Option<String>, String, String, usize, usize);

/// The parts of a message.
#[pyfunction]
pub(crate) fn diagnostic_parts(message: &Diagnostic) -> MessageParts {
    let message = message.clone();
    (
        message.code, message.severity, message.message, message.help, message.file, message.text, message.line,
        message.column,
    )
}

/// The message with these parts.
#[pyfunction]
pub(crate) fn diagnostic_of(parts: MessageParts) -> Diagnostic {
    let (code, severity, message, help, file, text, line, column) = parts;
    Diagnostic { code, severity, message, help, file, text, line, column }
}
