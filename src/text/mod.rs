//! Bytes and positions: sources, spans, edits, tokens of numbers, and diagnostics.

mod binary;
mod diagnostic;
mod diagnostics;
mod edit;
mod lines;
mod nearest;
pub(crate) mod number;
mod patch;
mod printable;
mod source;
pub use deflex_lang::Span;

pub(crate) use binary::{ENCRYPTED, no_text};
pub use diagnostic::{Diagnostic, Severity};
pub use diagnostics::Diagnostics;
pub(crate) use diagnostics::cannot_read;
pub(crate) use edit::{Content, Token, applied, apply_within};
pub use edit::{Edit, apply};
pub(crate) use lines::{LineIndex, lines};
pub(crate) use nearest::nearest;
pub use patch::Patch;
pub(crate) use printable::printable;
pub use printable::printable_line;
pub(crate) use source::decode;
pub use source::{LineColumn, Source};
