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
}

impl<'a> Context<'a> {
    /// A program that is held whole.
    pub(super) fn whole(program: &'a Program, cell: &'a Cell, options: &'a Options) -> Self {
        Self { program, cell, options, parallelism: Parallelism::Threads }
    }

    /// A chunk of a program whose other chunks are on other threads.
    pub(super) fn chunk(program: &'a Program, cell: &'a Cell, options: &'a Options) -> Self {
        Self { program, cell, options, parallelism: Parallelism::Here }
    }
}
