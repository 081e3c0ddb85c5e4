//! Keeps the chunks of a program in their order, whichever threads process them.
//!
//! Each stage has an [`Ordered`] value, which one chunk leaves to the next. A stage is free for a chunk when all chunks before have
//! passed it or have ended. A chunk that ends early, because it is refused, therefore holds up none of those after it. A chunk whose
//! thread panics stops the run. Neither depends on which stages there are, so there is no list of them.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{self, Thread};

/// The order of a run's chunks.
#[derive(Debug, Default)]
pub(super) struct Order(Mutex<ChunkOrder>);

#[derive(Debug, Default)]
struct ChunkOrder {
    /// Whether the run stops: no chunk waits any more.
    is_stopped: bool,
    /// Waiting chunks, and their threads.
    waiting: Vec<(usize, Thread)>,
    /// All chunks before this one have ended.
    ended: usize,
    /// Chunks after it that have ended.
    ended_early: Vec<usize>,
}

/// A value that is passed from chunk to chunk.
#[derive(Debug)]
pub(super) struct Ordered<T> {
    /// All chunks before this one have passed or have ended.
    next: AtomicUsize,
    value: Mutex<T>,
}

/// A chunk that passes the stages; it has ended when this is dropped.
#[derive(Debug)]
pub(super) struct Turn<'o> {
    order: &'o Order,
    /// Index of the chunk.
    pub(super) number: usize,
}

/// The run stops: a chunk before has panicked, or an input or an output has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stopped;

impl Order {
    fn lock(&self) -> MutexGuard<'_, ChunkOrder> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The turn of chunk `number`, which has one turn only.
    pub(super) fn turn(&self, number: usize) -> Turn<'_> {
        Turn { order: self, number }
    }

    /// Stops the run: no chunk waits any more.
    pub(super) fn stop(&self) {
        self.lock().stop();
    }
}

impl ChunkOrder {
    fn stop(&mut self) {
        self.is_stopped = true;
        self.waiting.drain(..).for_each(|(_, thread)| thread.unpark());
    }

    /// Whether all chunks from `first` up to but excluding `last` have ended.
    fn have_ended(&self, first: usize, last: usize) -> bool {
        (first.max(self.ended)..last).all(|chunk| self.ended_early.contains(&chunk))
    }

    /// Wakes the next waiting chunk after chunk `number` has passed a stage or has ended. The chunks after that one wait for it.
    fn wake_after(&mut self, number: usize) {
        let later = self.waiting.iter().enumerate().filter(|(_, (waits, _))| *waits > number);
        if let Some(at) = later.min_by_key(|(_, (waits, _))| *waits).map(|(at, _)| at) {
            self.waiting.swap_remove(at).1.unpark();
        }
    }
}

impl<T> Ordered<T> {
    pub(super) fn new(value: T) -> Self {
        Self { next: AtomicUsize::new(0), value: Mutex::new(value) }
    }

    pub(super) fn into_inner(self) -> T {
        self.value.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Turn<'_> {
    /// Waits until the chunks before have passed a stage, runs `work` on the value that they left there, and passes the value on.
    ///
    /// # Errors
    /// The run stops.
    pub(super) fn take<T, R>(&self, stage: &Ordered<T>, work: impl FnOnce(&mut T) -> R) -> Result<R, Stopped> {
        loop {
            let mut state = self.order.lock();
            if state.is_stopped {
                return Err(Stopped);
            }
            if state.have_ended(stage.next.load(Ordering::Relaxed), self.number) {
                break;
            }
            // A thread may wake by itself and still be in the list.
            state.waiting.retain(|(waits, _)| *waits != self.number);
            state.waiting.push((self.number, thread::current()));
            drop(state);
            thread::park();
        }
        let done = work(&mut stage.value.lock().unwrap_or_else(PoisonError::into_inner));
        let mut state = self.order.lock();
        // The lock of the state orders this store.
        stage.next.store(self.number + 1, Ordering::Relaxed);
        state.wake_after(self.number);
        Ok(done)
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        let mut guard = self.order.lock();
        let state = &mut *guard;
        state.ended_early.push(self.number);
        while let Some(at) = state.ended_early.iter().position(|ended| *ended == state.ended) {
            state.ended_early.swap_remove(at);
            state.ended += 1;
        }
        if thread::panicking() {
            state.stop();
        } else {
            state.wake_after(self.number);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Order, Ordered, Stopped};

    #[test]
    fn chunks_pass_in_order_whichever_thread_has_them() {
        let (order, seen) = (Order::default(), Ordered::new(Vec::new()));
        std::thread::scope(|scope| {
            for first in [3, 1, 0, 2] {
                let (order, seen) = (&order, &seen);
                scope.spawn(move || {
                    for round in 0..50 {
                        let turn = order.turn(4 * round + first);
                        assert_eq!(turn.take(seen, |seen| seen.push(turn.number)), Ok(()));
                    }
                });
            }
        });
        assert_eq!(seen.into_inner(), (0..200).collect::<Vec<_>>());
    }

    #[test]
    fn a_chunk_that_ends_before_a_stage_holds_up_none() {
        let (order, first, second) = (Order::default(), Ordered::new(Vec::new()), Ordered::new(Vec::new()));
        std::thread::scope(|scope| {
            for number in [5, 2, 4, 0, 3, 1] {
                let (order, first, second) = (&order, &first, &second);
                scope.spawn(move || {
                    let turn = order.turn(number);
                    turn.take(first, |seen| seen.push(number)).unwrap();
                    // Every second chunk is refused between the stages.
                    if number % 2 == 1 {
                        turn.take(second, |seen| seen.push(number)).unwrap();
                    }
                });
            }
        });
        assert_eq!((first.into_inner(), second.into_inner()), (vec![0, 1, 2, 3, 4, 5], vec![1, 3, 5]));
    }

    #[test]
    fn a_chunk_that_panics_and_a_run_that_stops_let_no_chunk_wait() {
        for panics in [true, false] {
            let (order, stage) = (Order::default(), Ordered::new(()));
            std::thread::scope(|scope| {
                let waiting = scope.spawn(|| order.turn(1).take(&stage, |()| ()));
                let stopped = scope.spawn(|| {
                    let _turn = order.turn(0);
                    assert!(!panics, "this chunk panics, as the test wants it");
                    order.stop();
                });
                assert_eq!(stopped.join().is_err(), panics);
                assert_eq!(waiting.join().ok(), Some(Err(Stopped)));
            });
        }
    }
}
