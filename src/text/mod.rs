//! Bytes and positions: sources, spans, edits, number tokens, diagnostics.

mod diagnostic;
mod edit;
mod lines;
pub mod number;
mod source;
mod span;

pub use diagnostic::{Diagnostic, Severity, Sink};
pub use edit::{Edit, apply};
pub use lines::LineIndex;
pub(crate) use source::decode;
pub use source::{LineColumn, Source};
pub use span::Span;
