//! Exit code, broken pipe and what the allocator keeps, nothing else.

mod cli;

use std::process::ExitCode;

/// glibc's allocator keeps freed room of up to twice the largest block that was once given back (mallopt(3), dynamic
/// threshold); before, it gives every chunk's room back to the system, and page faults are a third of a long job.
const KEPT_BYTES: usize = 8 << 20;

fn main() -> ExitCode {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(KEPT_BYTES)));
    cli::main()
}
