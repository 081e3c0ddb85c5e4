//! The binary as its users drive it: exit codes, messages, what is written and where.

mod bad_input;
mod bench;
mod ci;
mod help;
mod inputs;
mod outputs;
