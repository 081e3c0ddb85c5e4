//! deflex corrects robot programs for the bending of the robot, and finds from measurements the physical effect that a model of
//! the robot lacks.
//!
//! A **cell** describes the robot as its controller assumes it, and a list of **effects** by which the real robot differs from
//! that. All computations take a cell. Each module is a crate of its own, which can be used alone: [`robot`] is `deflex-robot`, and the
//! examples of its documentation name it `deflex_robot`. The modules are listed in the order of the data:
//!
//! | module | from | to |
//! |---|---|---|
//! | [`text`] | bytes | positions, edits, diagnostics |
//! | [`program`] | program bytes | targets, and corrected poses back into the same bytes |
//! | [`robot`] | motor angles | poses, and back; Jacobian |
//! | [`cutting`] | engagement | mean cutting force, contact point |
//! | [`stock`] | motions of a cutter | what is left of the blank, and the part of the cutter that is in material |
//! | [`effects`] | state of the arm | loads, deflections and offsets, one file for each physical effect |
//! | [`equilibrium`] | command | actual pose, and the command for a wanted pose |
//! | [`cell`] | cell file | robot, tools, cut and effects, and back with the user's comments |
//! | [`correct`] | a program and a cell | corrected poses and report rows |
//! | [`measured`] | measured rows | residuals |
//! | [`identify`] | residuals | the effect that the cell lacks |
//! | [`report`] | results | CSV, JSON, summary, HTML, CI formats |
//! | [`session`] | files | the results of the commands in memory |
//! | [`cli`] | arguments, files | files, exit code |
//!
//! Read a program, correct it, and write it:
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
//!     // The forward model computes the remaining error from the numbers as they will be written.
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
//! Find the effect that a cell lacks:
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
//! # Features
//!
//! `cli`, which is on by default, adds [`cli`] and the command. Without it (`default-features = false`) nothing of a command line is built:
//! no parser of arguments, no progress bar, no handler of interrupts and no server of a window.
//!
//! # Stability
//!
//! Versions follow [semantic versioning](https://semver.org/). While the first number is 0, a change of the second one can break
//! callers.
//! - Public items keep their names, signatures and meanings. Results that will grow are `#[non_exhaustive]`. Make options with
//!   `..Options::default()`: a new field, or a new variant of an enum, comes with a minor version.
//! - Items that this documentation does not show are for the crates of deflex alone, and can change in any version.
//! - Later versions add to the codes of messages ([`Diagnostic::code`](text::Diagnostic::code)), the kinds and parameters of
//!   effects, the keys of the cell file, the columns of reports and the exit codes, and remove none. The text of a message is for
//!   people and may change.
//! - One version gives the same bytes for the same input, for any number of threads. A later version may correct better.
//! - The crate needs Rust 1.89 (`rust-version`). A minor version may need a later one.
//!
//! # Units
//!
//! The library computes in metres, radians and newtons. Only [`program`], the cell file and [`report`] have millimetres and
//! degrees, which the names of their fields and columns state.

/// Two crates whose types appear in public signatures.
pub use {nalgebra, toml};

// The command line uses the library by its name, as any other program does.
extern crate self as deflex;

#[cfg(feature = "cli")]
pub mod cli;
pub mod session;

#[doc(inline)]
pub use {
    deflex_cell as cell, deflex_correct as correct, deflex_cutting as cutting, deflex_drive as drive,
    deflex_effects as effects, deflex_equilibrium as equilibrium, deflex_identify as identify,
    deflex_measured as measured, deflex_program as program, deflex_report as report, deflex_robot as robot,
    deflex_stock as stock, deflex_text as text, deflex_text::limits,
};
