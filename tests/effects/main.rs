//! What every effect must do, and what the independent plant says of each.

#![allow(clippy::unwrap_used, clippy::print_stderr)] // a failed unwrap is a failed test

mod every;
mod plant;
