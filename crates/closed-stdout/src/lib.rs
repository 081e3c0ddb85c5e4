//! Whether standard output was closed when the process started, as a shell does with `>&-`.
//!
//! Rust's runtime opens `/dev/null` for each standard stream that is closed, before `main`. What is written there afterwards is lost without
//! an error. From `main` on, such a stream cannot be distinguished from one that the caller sent to `/dev/null` on purpose. So this crate
//! looks earlier: the loader runs its function before the runtime.
//!
//! ```
//! assert!(!deflex_closed_stdout::was_closed(), "the test harness has a standard output");
//! ```

use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

static CLOSED: AtomicBool = AtomicBool::new(false);

/// Whether standard output was closed when the process started. Always false on systems other than Unix, where the runtime opens nothing.
///
/// # Examples
/// ```
/// assert!(!deflex_closed_stdout::was_closed()); // a test has standard output
/// ```
pub fn was_closed() -> bool {
    CLOSED.load(Relaxed)
}

/// The loader calls the functions that this section lists before the runtime starts.
///
/// The attribute is unsafe because a wrong section or type would break the program before `main`. These are the section and the type that
/// ELF and Mach-O define, and the function needs nothing that the runtime sets up: it makes one system call and stores a flag.
#[cfg(unix)]
#[used]
#[cfg_attr(target_vendor = "apple", unsafe(link_section = "__DATA,__mod_init_func"))]
#[cfg_attr(not(target_vendor = "apple"), unsafe(link_section = ".init_array"))]
static AT_START: extern "C" fn() = {
    extern "C" fn look() {
        let closed = rustix::io::fcntl_getfd(rustix::stdio::stdout()) == Err(rustix::io::Errno::BADF);
        CLOSED.store(closed, Relaxed);
    }
    look
};
