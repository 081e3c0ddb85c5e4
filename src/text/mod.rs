//! Bytes and positions: sources, spans, edits, number tokens, diagnostics.

mod diagnostic;
mod edit;
mod lines;
pub(crate) mod number;
mod patch;
mod source;
mod span;

pub use diagnostic::{Diagnostic, Severity};
pub(crate) use edit::{Content, Token, apply_within};
pub use edit::{Edit, apply};
pub(crate) use lines::{LineIndex, lines};
pub use patch::Patch;
pub(crate) use source::decode;
pub use source::{LineColumn, Source};
pub use span::Span;
