//! Long work on a thread of its own: Python's other threads run meanwhile, Ctrl-C is heard, and progress is told.

use crate::errors::raised;
use deflex::session::Follow;
use deflex::text::Diagnostic;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How long Ctrl-C may wait: less than a person notices.
const TICK: Duration = Duration::from_millis(50);

/// As much stack as a main thread has: equilibria of many targets at once stand on it.
const STACK_BYTES: usize = 8 << 20;

/// Does short work without Python's lock, on the threads of this process.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
    py.detach(|| pool().install(work))
}

/// The threads that share the work. A process that was forked has none of its parent's: it gets its own.
fn pool() -> &'static ThreadPool {
    /// By the process that has them.
    static POOL: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match *pool {
        Some((process, pool)) if process == std::process::id() => pool,
        _ => {
            let builder = || ThreadPoolBuilder::new().stack_size(STACK_BYTES);
            // One thread is the caller's own where the system gives no more.
            let started = builder().build().or_else(|_| builder().num_threads(1).use_current_thread().build());
            // Never dropped: the parent's would wait for threads that are not there.
            let started: &'static ThreadPool = Box::leak(Box::new(started.expect("a pool of the thread that asks")));
            *pool = Some((std::process::id(), started));
            started
        }
    }
}

/// Where a run is.
#[derive(Default)]
pub(crate) struct Progress {
    bytes: AtomicU64,
    stopped: AtomicBool,
}

impl Progress {
    /// For the run that it follows.
    pub(crate) fn follow(self: &Arc<Self>) -> Arc<Follow> {
        let progress = Arc::clone(self);
        Arc::new(move |_, bytes| {
            progress.bytes.store(bytes, Ordering::Relaxed);
            !progress.stopped.load(Ordering::Relaxed)
        })
    }
}

/// Does it, and calls `callback(done, total)` with bytes of the program now and then, and at the end. What it raises, and
/// Ctrl-C, calls the run off.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    (callback, total): (Option<&Bound<'_, PyAny>>, u64),
    work: impl FnOnce(Arc<Progress>) -> Result<T, Vec<Diagnostic>> + Send + 'static,
) -> PyResult<T> {
    let progress = Arc::new(Progress::default());
    let (send, done) = channel();
    // Only this thread waits; a receiver may not be seen by two.
    let done = Mutex::new(done);
    let there = Arc::clone(&progress);
    let thread = std::thread::Builder::new().name("deflex".to_owned()).stack_size(STACK_BYTES);
    // Nobody waits any more where the run was called off.
    thread.spawn(move || drop(send.send(pool().install(|| work(there)))))?;
    let tell = |bytes: u64| callback.map_or(Ok(()), |callback| callback.call1((bytes, total)).map(drop));
    let mut told = 0;
    loop {
        let result = py.detach(|| {
            let result = done.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(TICK);
            (result, progress.bytes.load(Ordering::Relaxed))
        });
        let heard = match result {
            (Ok(Ok(value)), _) => return tell(total).map(|()| value),
            (Ok(Err(errors)), _) => return Err(raised(py, errors)),
            (Err(RecvTimeoutError::Disconnected), _) => {
                return Err(PyRuntimeError::new_err("deflex panicked: this is a defect, its message stands on stderr"));
            }
            (Err(RecvTimeoutError::Timeout), bytes) if bytes > told => {
                told = bytes;
                tell(bytes.min(total))
            }
            (Err(RecvTimeoutError::Timeout), _) => Ok(()),
        };
        if let Err(stop) = heard.and_then(|()| py.check_signals()) {
            progress.stopped.store(true, Ordering::Relaxed);
            return Err(stop);
        }
    }
}
