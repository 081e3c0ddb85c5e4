//! Does long work on a separate thread, so that Python's other threads run, Ctrl-C stops it, and a callback receives the progress.

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

/// Interval between two looks at signals and progress, shorter than a person notices.
const TICK: Duration = Duration::from_millis(50);

/// Stack of a thread, bytes, as large as that of a main thread: the equilibria of a batch of targets are on it.
const STACK_BYTES: usize = 8 << 20;

/// Does short work on the threads of this process, without Python's global lock.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
    py.detach(|| pool().install(work))
}

/// The pool of threads of this process. A forked process has none of the threads of its parent and gets a new pool.
fn pool() -> &'static ThreadPool {
    /// The pool, with the identifier of the process that it belongs to.
    static POOL: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match *pool {
        Some((process, pool)) if process == std::process::id() => pool,
        _ => {
            let builder = || ThreadPoolBuilder::new().stack_size(STACK_BYTES);
            // If the system starts no threads, the calling thread does the work.
            let started = builder().build().or_else(|_| builder().num_threads(1).use_current_thread().build());
            // The pool is never dropped: dropping that of the parent would wait for threads that this process does not have.
            let started: &'static ThreadPool = Box::leak(Box::new(started.expect("a pool of the calling thread")));
            *pool = Some((std::process::id(), started));
            started
        }
    }
}

/// The progress of a run, and whether it has to stop.
#[derive(Default)]
pub(crate) struct Progress {
    bytes: AtomicU64,
    stopped: AtomicBool,
}

impl Progress {
    /// The function that the run calls with the bytes that it has processed; it returns whether the run goes on.
    pub(crate) fn follow(self: &Arc<Self>) -> Arc<Follow> {
        let progress = Arc::clone(self);
        Arc::new(move |_, bytes| {
            progress.bytes.store(bytes, Ordering::Relaxed);
            !progress.stopped.load(Ordering::Relaxed)
        })
    }
}

/// Does the work and calls `callback(done, total)` at intervals and at the end, with bytes or parts of the work. An exception of the
/// callback, or Ctrl-C, stops the run.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    (callback, total): (Option<&Bound<'_, PyAny>>, u64),
    work: impl FnOnce(Arc<Progress>) -> Result<T, Vec<Diagnostic>> + Send + 'static,
) -> PyResult<T> {
    let progress = Arc::new(Progress::default());
    let (send, done) = channel();
    // `detach` needs a closure that other threads could run, and a receiver alone cannot be shared between threads.
    let done = Mutex::new(done);
    let of_run = Arc::clone(&progress);
    let thread = std::thread::Builder::new().name("deflex".to_owned()).stack_size(STACK_BYTES);
    // After a stop there is no receiver, so the error of `send` has no meaning.
    thread.spawn(move || drop(send.send(pool().install(|| work(of_run)))))?;
    let report = |bytes: u64| callback.map_or(Ok(()), |callback| callback.call1((bytes, total)).map(drop));
    let mut reported = 0;
    loop {
        let result = py.detach(|| {
            let result = done.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(TICK);
            (result, progress.bytes.load(Ordering::Relaxed))
        });
        let called = match result {
            (Ok(Ok(value)), _) => return report(total).map(|()| value),
            (Ok(Err(errors)), _) => return Err(raised(py, errors)),
            (Err(RecvTimeoutError::Disconnected), _) => {
                return Err(PyRuntimeError::new_err("deflex panicked: this is a defect, stderr has its message"));
            }
            (Err(RecvTimeoutError::Timeout), bytes) if bytes > reported => {
                reported = bytes;
                report(bytes.min(total))
            }
            (Err(RecvTimeoutError::Timeout), _) => Ok(()),
        };
        if let Err(stop) = called.and_then(|()| py.check_signals()) {
            progress.stopped.store(true, Ordering::Relaxed);
            return Err(stop);
        }
    }
}
