//! The binary as its users drive it: exit codes, messages, what is written and where.

mod against;
mod bad_input;
mod bench;
#[cfg(unix)]
mod bounds;
mod care;
mod ci;
mod cl_post;
mod driven;
#[cfg(unix)]
mod durable;
#[cfg(unix)]
mod free_turn;
mod gate;
mod help;
mod html;
mod identify;
mod init;
mod inputs;
mod judged;
mod long;
mod outputs;
mod plan;
mod pose;
mod shell;
mod studio;
mod urdf;
mod verdicts;
