//! What all stages of the pipeline know.

use super::Options;
use super::parallelism::Parallelism;
use crate::cell::Cell;
use crate::program::Program;

/// A program, or a chunk of one, the cell that runs it, and how.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub(super) program: &'a Program,
    pub(super) cell: &'a Cell,
    pub(super) options: &'a Options,
    pub(super) parallelism: Parallelism,
    pub(super) ways: Ways,
}

/// How the ways between targets are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ways {
    /// As they are written.
    Written,
    /// As the controller drives them, when the rest of the program is known: the stages leave them open.
    Driven,
}

impl<'a> Context<'a> {
    /// A program that is held whole.
    pub(super) fn whole(program: &'a Program, cell: &'a Cell, options: &'a Options) -> Self {
        Self { program, cell, options, parallelism: Parallelism::Threads, ways: Ways::Written }
    }

    /// A chunk of a program whose other chunks are on other threads.
    pub(super) fn chunk(program: &'a Program, cell: &'a Cell, options: &'a Options) -> Self {
        Self { program, cell, options, parallelism: Parallelism::Here, ways: Ways::Written }
    }
}
