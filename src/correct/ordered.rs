//! Ordered passes over the chunks of a program, whichever threads have them.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// State that goes from chunk to chunk in their order.
#[derive(Debug)]
pub(super) struct OrderedStage<T> {
    state: Mutex<State<T>>,
    passed: Condvar,
}

#[derive(Debug)]
struct State<T> {
    /// The chunk whose turn it is.
    next: usize,
    /// A chunk died before its turn: nobody waits for it.
    broken: bool,
    /// Chunks that wait: telling nobody would take a call of the system all the same.
    waiting: usize,
    value: T,
}

impl<T> OrderedStage<T> {
    pub(super) fn new(value: T) -> Self {
        Self { state: Mutex::new(State { next: 0, broken: false, waiting: 0, value }), passed: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        // Whoever dies holding it says so by `broken`.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the turn of chunk `n`, works on what the chunks before it left, and passes it on; `None` where a chunk
    /// before it died.
    pub(super) fn take<R>(&self, n: usize, work: impl FnOnce(&mut T) -> R) -> Option<R> {
        let mut state = self.lock();
        state.waiting += 1;
        let wait = |state: &mut State<T>| state.next != n && !state.broken;
        let mut state = self.passed.wait_while(state, wait).unwrap_or_else(PoisonError::into_inner);
        state.waiting -= 1;
        if state.broken {
            return None;
        }
        let done = work(&mut state.value);
        state.next = n + 1;
        let others = state.waiting > 0;
        drop(state);
        if others {
            self.passed.notify_all();
        }
        Some(done)
    }

    /// Lets nobody wait any more.
    pub(super) fn break_off(&self) {
        self.lock().broken = true;
        self.passed.notify_all();
    }

    pub(super) fn into_inner(self) -> T {
        self.state.into_inner().unwrap_or_else(PoisonError::into_inner).value
    }
}

#[cfg(test)]
mod tests {
    use super::OrderedStage;

    #[test]
    fn chunks_take_turns_in_order_whatever_thread_has_them() {
        let turns = OrderedStage::new(Vec::new());
        std::thread::scope(|scope| {
            for first in [3, 1, 0, 2] {
                let turns = &turns;
                scope.spawn(move || {
                    for round in 0..50 {
                        turns.take(4 * round + first, |seen| seen.push(4 * round + first));
                    }
                });
            }
        });
        assert_eq!(turns.into_inner(), (0..200).collect::<Vec<_>>());
    }

    #[test]
    fn nobody_waits_for_a_chunk_that_died() {
        let turns = OrderedStage::new(());
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| turns.take(1, |()| ()));
            turns.break_off();
            assert_eq!(waiting.join().ok(), Some(None));
        });
    }
}
