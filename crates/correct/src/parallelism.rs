//! How the points of a pass are spread over threads and lanes; the results do not depend on it.

use deflex_lanes::WIDTH;
use rayon::prelude::*;
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

    /// The same, eight at a time: `many` solves the indices that are `simple` in a workspace, and `answer` gives the result for each of
    /// them, if there is one. `one` computes all others.
    pub(super) fn for_each_batch<T: Send, R: Default + Send>(
        self,
        count: usize,
        simple: impl Fn(usize) -> bool + Sync,
        workspaces: &WorkspacePool<R>,
        many: impl Fn(&mut R, &[usize]) + Sync,
        answer: impl Fn(&R, Lane) -> Option<T> + Sync,
        one: impl Fn(usize) -> T + Sync,
    ) -> Vec<T> {
        let stretch = |indices: Range<usize>| {
            let mut out = Vec::with_capacity(indices.len());
            let mut room = workspaces.take();
            for first in indices.clone().step_by(WIDTH) {
                let block = first..indices.end.min(first + WIDTH);
                let (mut alike, mut count) = ([0; WIDTH], 0);
                for index in block.clone() {
                    if simple(index) {
                        alike[count] = index;
                        count += 1;
                    }
                }
                let alike = &alike[..count];
                if !alike.is_empty() {
                    many(&mut room, alike);
                }
                let mut number = 0;
                // Each result is computed in its place of the output: it is too large to be moved there.
                out.extend(block.map(|index| {
                    let lane = alike.get(number).filter(|next| **next == index).map(|_| Lane { number, index });
                    number += usize::from(lane.is_some());
                    match lane.and_then(|lane| answer(&room, lane)) {
                        Some(found) => found,
                        None => one(index),
                    }
                }));
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

/// A lane of a workspace, and the index that it has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lane {
    pub(super) number: usize,
    pub(super) index: usize,
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
