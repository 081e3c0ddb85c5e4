//! The input that all stages of the pipeline share.

use super::Options;
use super::original_loads::OriginalLoads;
use super::parallelism::Parallelism;
use crate::cell::Cell;
use crate::program::Program;

/// A program or a chunk of one, the cell that runs it, and the options of the run.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub(super) program: &'a Program,
    pub(super) cell: &'a Cell,
    pub(super) options: &'a Options,
    pub(super) parallelism: Parallelism,
    pub(super) judged_path: JudgedPath,
    /// The loads of the original, if the points of the program were moved on purpose.
    pub(super) loads: Option<OriginalLoads<'a>>,
}

/// The path between targets for which the deviation is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum JudgedPath {
    /// The path as written, with sharp corners.
    Written,
    /// The path that the controller drives. It depends on the whole program, so the stages leave the deviation of lines and arcs open.
    Driven,
}

impl<'a> Context<'a> {
    /// The context of a program that is held as a whole.
    pub(super) fn whole(program: &'a Program, cell: &'a Cell, options: &'a Options) -> Self {
        Self {
            program,
            cell,
            options,
            parallelism: Parallelism::Threads,
            judged_path: JudgedPath::Written,
            loads: None,
        }
    }

    /// The context of a chunk whose other chunks are on other threads.
    pub(super) fn chunk(program: &'a Program, cell: &'a Cell, options: &'a Options) -> Self {
        Self { parallelism: Parallelism::Here, ..Self::whole(program, cell, options) }
    }
}
