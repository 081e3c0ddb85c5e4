//! What becomes of a program: corrected poses, report rows, and what is to be said.

use super::along::WayFinding;
use super::messages::Repeated;
use super::row::Row;
use crate::program::{Confdata, Rewritten};
use crate::robot::EXTERNAL_AXES;
use crate::text::Diagnostic;
use serde::Serialize;

/// A corrected program.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Corrected {
    /// One row an executed motion, in running order. Targets that failed have none.
    pub rows: Vec<Row>,
    /// Targets that have no answer or pass a limit: a program with any of these is not written.
    pub failures: Vec<Diagnostic>,
    /// Notes and warnings of the run.
    pub notes: Vec<Diagnostic>,
    /// RAPID input: the edits, and what was written.
    pub rewritten: Option<Rewritten>,
    /// CL input: what to post, one a point of the program.
    pub posted: Vec<Posted>,
    /// Motions that were inserted.
    pub inserted: usize,
    /// A program that is judged by its original: how far each target is from its place there, mm.
    pub moved_mm: Vec<f64>,
    /// What is wrong on the ways into targets, as they are commanded.
    pub on_the_way: Vec<WayFinding>,
    /// How the program is driven, where that was looked at.
    pub driven: Option<DrivenSummary>,
    /// Warnings that many targets share; in `notes` when all of the program is through.
    pub(super) repeated: Repeated,
}

impl Corrected {
    /// All of the program is through.
    pub(super) fn with_repeated(mut self) -> Self {
        self.notes.extend(std::mem::take(&mut self.repeated).once());
        self
    }
}

/// A corrected point for a program that is written anew (CL to RAPID).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Posted {
    /// Index into [`targets`](crate::program::Program::targets) of the target that it is, or that it is inserted before.
    pub target: usize,
    /// Corrected position, work object axes, mm.
    pub position_mm: [f64; 3],
    /// Corrected orientation, scalar first.
    pub quat: [f64; 4],
    /// Configuration of the commanded joints.
    pub conf: Confdata,
    /// Commanded angles as the controller counts them, degrees.
    pub motor_deg: [f64; 6],
    /// Positions of the external axes, mm or degrees, where they were chosen; `None` where the cell says where they stand.
    pub external: Option<Box<[Option<f64>; EXTERNAL_AXES]>>,
}

/// How a program is driven.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DrivenFigures {
    /// Largest distance between the driven, loaded path and the programmed one, mm: on the way into cutting targets, into all where
    /// none cuts.
    pub max_mm: f64,
    /// How long the program runs, s.
    pub run_time_s: f64,
}

/// What a run says about the path that the controller drives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DrivenSummary {
    /// As the program is written.
    pub programmed: DrivenFigures,
    /// As it is corrected.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corrected: Option<DrivenFigures>,
    /// Largest distance that is allowed, mm (`--max-path-error`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance_mm: Option<f64>,
}
