//! Bytes and positions: sources, spans, edits, tokens of numbers, and diagnostics.

mod binary;
mod diagnostic;
mod diagnostics;
mod edit;
pub mod limits;
mod lines;
mod nearest;
#[doc(hidden)]
pub mod number;
mod patch;
mod printable;
mod source;
pub use deflex_lang::Span;

pub use binary::{ENCRYPTED, no_text};
pub use diagnostic::{Diagnostic, Severity};
pub use diagnostics::{Diagnostics, cannot_read};
pub use edit::{Content, Edit, Token, applied, apply, apply_within};
pub use lines::{LineIndex, lines};
pub use nearest::nearest;
pub use patch::Patch;
pub use printable::{printable, printable_line};
pub use source::{LineColumn, Source, decode};
