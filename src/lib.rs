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
//! | [`effects`] | state of the arm | loads, yields and offsets, one file per physical effect |
//! | [`equilibrium`] | command | actual pose (`predict`), and back (`compensate`) |
//! | [`cell`] | cell file | robot, tools, cut and effects, and back with the user's comments |
//! | [`correct`] | a program and a cell | corrected poses and report rows |
//! | [`measured`] | measured rows | residuals |
//! | [`identify`] | residuals | the effect the cell lacks |
//! | [`report`] | results | CSV, JSON, summary, HTML, CI formats |
//! | [`numeric`] | | what no library gives soundly |
//!
//! Inside the library lengths are metres, angles radians, forces newtons; millimetres and degrees
//! live in [`program`], in the cell file and in [`report`] only, and stand in the names there.

pub mod cell;
pub mod correct;
pub mod cutting;
pub mod effects;
pub mod equilibrium;
pub mod identify;
pub mod measured;
pub mod numeric;
pub mod program;
pub mod report;
pub mod robot;
pub mod text;
