//! deflex: toolpath post-processor for robot milling.
//!
//! A **cell** is the robot that the controller believes in plus a list of **effects** that make the
//! real one differ. Everything else is a question put to the cell. The modules stand in the order
//! of the data:
//!
//! | module | from | to |
//! |---|---|---|
//! | [`text`] | bytes | positions, edits, diagnostics |
//! | [`program`] | program bytes | targets, and corrected poses back into the same bytes |
//! | [`robot`] | motor angles | poses, and back; Jacobian |
//! | [`cutting`] | engagement | mean cutting force, contact point |
//! | [`stock`] | moves of a cutter | what is left of the blank, and what of the cutter is in it |
//! | [`effects`] | state of the arm | loads, yields and offsets, one file per physical effect |
//! | [`equilibrium`] | command | actual pose (`predict`), and back (`compensate`) |
//! | [`cell`] | cell file | robot, tools, cut and effects, and back with the user's comments |
//! | [`correct`] | a program and a cell | corrected poses and report rows |
//! | [`measured`] | measured rows | residuals |
//! | [`identify`] | residuals | the effect the cell lacks |
//! | [`report`] | results | CSV, JSON, summary, HTML, CI formats |
//! | [`cli`] | arguments, files | files, exit code; and the same with the results in memory |
//!
//! Read, correct, write:
//!
//! ```
//! use deflex::cell::Cell;
//! use deflex::correct::{Options, compensate};
//! use deflex::program::rapid;
//! use deflex::text::{Diagnostics, Source, apply};
//!
//! fn main() -> Result<(), Diagnostics> {
//!     let read = |path: &str| std::fs::read(path).map(|bytes| Source::new(path, bytes));
//!     let cell = Cell::read(&read("samples/slot/cell.toml")?)?;
//!     let program = rapid::read(vec![read("samples/slot/slot.mod")?], Vec::new())?;
//!     let corrected = compensate(&program, &cell, &Options::default())?;
//!     // What the forward model makes of the numbers as they will be written.
//!     assert!(corrected.rows.iter().all(|row| row.remaining_norm_mm() < 1e-3));
//!     let mut written = Vec::new();
//!     for (source, edits) in program.sources.iter().zip(corrected.rewritten.unwrap().edits) {
//!         apply(&source.bytes, &edits, &mut written)?;
//!     }
//!     assert!(written.starts_with(b"%%%"));
//!     Ok(())
//! }
//! ```
//!
//! Which effect does the cell lack:
//!
//! ```
//! use deflex::cell::{Cell, extended};
//! use deflex::identify::{Input, Written, identify};
//! use deflex::measured::Table;
//! use deflex::program::rapid;
//! use deflex::text::{Diagnostics, Source};
//!
//! fn main() -> Result<(), Diagnostics> {
//!     let read = |name: &str| {
//!         let path = format!("samples/closed-loop/{name}");
//!         std::fs::read(&path).map(|bytes| Source::new(path, bytes))
//!     };
//!     let text = read("cell.toml")?;
//!     let cell = Cell::read(&text)?;
//!     let run = (rapid::read(vec![read("part.mod")?], Vec::new())?, Table::read(&read("measured.csv")?)?);
//!     let found = identify(Input { cell: &cell, runs: vec![run.into()], poses: vec![], tool: None, data_hash: "of the data", written: Written::WholeModel, progress: &|_| true })?;
//!     assert_eq!(found.added[0].kind, "backlash");
//!     assert!(found.after.rms_mm < 0.3 * found.before.rms_mm);
//!     let cell_file = extended(&String::from_utf8_lossy(&text.bytes), &found.extended)?;
//!     assert!(cell_file.contains("half_gap_rad"));
//!     Ok(())
//! }
//! ```
//!
//! # What stays
//!
//! Versions follow [semantic versioning](https://semver.org/); while the first number is 0, the second one counts as it.
//! - What these pages show keeps its name, its signature and its meaning. Results and enums that will grow are
//!   `#[non_exhaustive]`. Options are made with `..Options::default()`: a new field comes with a minor version.
//! - [`Diagnostic::code`](text::Diagnostic::code), the kinds and parameters of effects, keys of the cell file, columns of
//!   reports and the binary's exit codes are only added to. The words of a message are for people and may change.
//! - One version gives the same bytes for the same input, on any number of threads. The next one may correct better.
//! - Rust 1.89 is enough (`rust-version`); needing a later one is a minor version.
//!
//! # Units
//!
//! Inside the library lengths are metres, angles radians, forces newtons; millimetres and degrees
//! live in [`program`], in the cell file and in [`report`] only, and stand in the names there.

/// The versions of two crates whose types stand in signatures here.
pub use {nalgebra, toml};

// The command line speaks of the library by its name, as any other program does.
extern crate self as deflex;

pub mod cell;
pub mod cli;
pub mod correct;
pub mod cutting;
pub mod drive;
pub mod effects;
pub mod equilibrium;
pub mod identify;
mod lanes;
pub mod limits;
pub mod measured;
pub mod program;
pub mod report;
pub mod robot;
pub mod stock;
pub mod text;
