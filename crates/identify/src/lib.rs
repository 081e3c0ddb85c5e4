//! Identifies the effects that a cell lacks from measured rows, and makes the extended cell.
//!
//! ```text
//! rows → residual → columns of the candidates → whitening → evidence of sets → fit of the best set → (again)
//!      → gate: does an unlisted error remain? → errors before and after, on rows that no fit has seen
//! ```
//!
//! `identify.rs` has these steps in their order. The search is `part.rs` for the rows of programs, and `whole.rs` for
//! poses over the whole robot.

mod advice;
mod all_rows;
mod bounds;
mod cancelled;
mod candidate;
mod candidates;
mod columns;
mod contributions;
mod controller;
mod data;
mod decisions;
mod design;
mod device;
mod device_pose;
mod differences;
mod engine;
mod explain;
mod factor;
mod faults;
mod fit;
mod found;
mod gate;
mod gear;
mod identify;
mod input;
mod map;
mod moments;
mod noise;
mod outcome;
mod part;
mod pattern;
mod places;
mod plan;
mod plausibility;
mod poses;
mod presliding;
mod probing;
mod profile;
mod progress;
mod reading;
mod returns;
mod run_drift;
mod runs;
mod score;
mod search;
mod separability;
mod smooth;
mod springs;
mod statistics;
mod ties;
mod transfer;
mod triangle;
mod unseen;
mod whole;
mod whole_arm;

pub use identify::identify;
pub use input::{Input, MeasuredRun, Progress, Written};
pub use outcome::{
    Added, Advice, Correlate, Coverage, Errors, FittedParameter, Identification, InModel, Ranked, ResidualRow,
    Separation, SetShare, Unexplained,
};
pub use plan::{Ask, Plan, PlanInput, PlanProgram, PlannedKind, PlannedPair, PlannedRow, plan};
