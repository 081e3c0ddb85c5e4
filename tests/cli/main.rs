//! The binary as its users drive it: exit codes, messages, what is written and where.

#![allow(clippy::unwrap_used, clippy::print_stderr)] // in helpers too, a failure is a failed test

mod bad_input;
mod bench;
mod ci;
#[cfg(unix)]
mod gate;
mod help;
mod html;
mod identify;
mod init;
mod inputs;
mod judged;
mod long;
mod outputs;
mod shell;
