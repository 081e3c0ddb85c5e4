//! How the points of a pass are spread over threads and lanes; the results do not depend on it.

use deflex_equilibrium::EquilibriumError;
use deflex_lanes::WIDTH;
use rayon::prelude::*;
use smallvec::SmallVec;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// How the points of a pass are distributed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parallelism {
    /// Over all threads: for a program that is held as a whole.
    Threads,
    /// On the calling thread alone: for a chunk of a program whose other chunks run on other threads.
    Here,
}

impl Parallelism {
    /// The value of every index, in order.
    pub(super) fn map<T: Send>(self, count: usize, value: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        match self {
            Self::Threads => (0..count).into_par_iter().with_min_len(AT_LEAST).map(value).collect(),
            Self::Here => (0..count).map(value).collect(),
        }
    }

    /// The value of each of a few large parts, in order.
    pub(super) fn map_each<P: Sync, T: Send>(self, parts: &[P], value: impl Fn(&P) -> T + Sync + Send) -> Vec<T> {
        match self {
            Self::Threads => parts.par_iter().map(value).collect(),
            Self::Here => parts.iter().map(value).collect(),
        }
    }

    /// The same, eight at a time. `many` computes the indices that are `simple`, as far as it can, and `one` computes the others; both get a
    /// workspace.
    pub(super) fn for_each_batch<T: Answer, R: Default + Send>(
        self,
        count: usize,
        simple: impl Fn(usize) -> bool + Sync,
        workspaces: &WorkspacePool<R>,
        many: impl Fn(&mut R, &[usize], Answers<'_, T>) + Sync,
        one: impl Fn(&mut R, usize) -> T + Sync,
    ) -> Vec<T> {
        let stretch = |indices: Range<usize>| {
            let mut out = Vec::with_capacity(indices.len());
            let mut room = workspaces.take();
            for first in indices.clone().step_by(WIDTH) {
                let block = first..indices.end.min(first + WIDTH);
                let indices: SmallVec<[usize; WIDTH]> = block.clone().filter(|i| simple(*i)).collect();
                let start = out.len();
                out.extend(block.clone().map(|_| T::open()));
                if !indices.is_empty() {
                    many(&mut room, &indices, Answers { out: &mut out[start..], indices: &indices, first });
                }
                for (i, answer) in block.zip(&mut out[start..]).filter(|(_, answer)| answer.is_open()) {
                    *answer = one(&mut room, i);
                }
            }
            workspaces.give(room);
            out
        };
        match self {
            Self::Threads => {
                let stretches = (0..count.div_ceil(AT_LEAST)).into_par_iter();
                stretches.flat_map_iter(|n| stretch(n * AT_LEAST..count.min((n + 1) * AT_LEAST))).collect()
            }
            Self::Here => stretch(0..count),
        }
    }
}

/// The result for a point.
pub(super) trait Answer: Send {
    /// A result that is still missing.
    fn open() -> Self;

    /// Whether the result is still missing, so that `one` has to compute it.
    fn is_open(&self) -> bool;
}

impl<T: Send> Answer for Result<T, EquilibriumError> {
    fn open() -> Self {
        Err(EquilibriumError::NotFinite)
    }

    fn is_open(&self) -> bool {
        self.is_err()
    }
}

/// Receives the results of eight points.
pub(super) struct Answers<'a, T> {
    out: &'a mut [T],
    indices: &'a [usize],
    first: usize,
}

impl<T> Answers<'_, T> {
    /// Sets the result of the point in a lane.
    pub(super) fn put(&mut self, lane: usize, answer: T) {
        self.out[self.indices[lane] - self.first] = answer;
    }
}

/// Workspaces that are used again.
#[derive(Debug)]
pub(super) struct WorkspacePool<R>(Mutex<Vec<Box<R>>>);

impl<R> Default for WorkspacePool<R> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<R: Default> WorkspacePool<R> {
    fn take(&self) -> Box<R> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn give(&self, room: Box<R>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(room);
    }
}

/// Least number of points that a thread takes at a time: a millisecond of work.
const AT_LEAST: usize = 256;
