#![no_main]

#[path = "../invariants.rs"]
mod invariants;

use libfuzzer_sys::Corpus;
use std::time::{Duration, Instant};

/// Slower inputs hold as well as others, but nothing new grows from them in the same time: long loops, mostly.
const QUICK: Duration = Duration::from_millis(20);

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| -> Corpus {
    let start = Instant::now();
    invariants::jbi(bytes);
    if start.elapsed() < QUICK { Corpus::Keep } else { Corpus::Reject }
});
