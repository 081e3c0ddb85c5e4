//! The input that all stages of the pipeline share.

use super::Options;
use super::original_loads::OriginalLoads;
use super::parallelism::Parallelism;
use deflex_cell::Cell;
use deflex_program::{Program, StreamableChunk};

/// A program or a chunk of one, the cell that runs it, and the options of the run.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub(super) program: &'a Program,
    pub(super) cell: &'a Cell,
    pub(super) options: &'a Options,
    pub(super) parallelism: Parallelism,
    pub(super) judged_path: JudgedPath,
    /// The chunk that it is; `None` for a program that is held as a whole.
    pub(super) chunk: Option<&'a StreamableChunk>,
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

/// How much of a program is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// Its first part: what the last element depends on is still unknown.
    SoFar,
    Whole,
}

impl Extent {
    /// The number of elements that are final.
    pub(super) fn of(self, count: usize) -> usize {
        match self {
            Self::SoFar => count.saturating_sub(1),
            Self::Whole => count,
        }
    }
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
            chunk: None,
            loads: None,
        }
    }

    /// The context of a chunk whose other chunks are on other threads.
    pub(super) fn chunk(chunk: &'a StreamableChunk, cell: &'a Cell, options: &'a Options) -> Self {
        Self { parallelism: Parallelism::Here, chunk: Some(chunk), ..Self::whole(&chunk.program, cell, options) }
    }

    /// The same for the path that the controller of the cell drives, if the cell has its law.
    pub(super) fn driven(self) -> Self {
        let judged_path = if self.cell.controller.path.is_some() { JudgedPath::Driven } else { JudgedPath::Written };
        Self { judged_path, ..self }
    }

    /// How much of the program is known with this part of it.
    pub(super) fn extent(&self) -> Extent {
        if self.chunk.is_none_or(|chunk| chunk.last) { Extent::Whole } else { Extent::SoFar }
    }

    /// Where the part's own text begins.
    pub(super) fn own_from(&self) -> usize {
        self.chunk.map_or(0, |chunk| chunk.own.start)
    }
}
