//! A second reading of RAPID: programs run on concrete inputs, before and after their correction.
//!
//! [`syntax`], [`machine`], [`expression`] and [`instruction`] are an interpreter of their own, written from the manuals;
//! [`table`] has constructs written by hand, [`compare`] decides what became of a program.
//! `cargo run --example second_reading -- table` prints the table.

// Two crates share it: the suite, and an example that prints and counts.
#![allow(unreachable_pub, dead_code)]

pub mod cl;
pub mod cl_table;
pub mod compare;
mod expression;
pub mod generate;
mod instruction;
mod known;
mod machine;
pub mod minimise;
mod oracle;
mod syntax;
pub mod table;
#[cfg(test)]
mod tests;
mod tokens;
mod tree;
mod value;
