//! Reads whole cells, in one test target: the unit tests of the crate then do not compile the reader again.

#![allow(clippy::unwrap_used)] // in helpers too, a failure is a failed test

mod backup;
mod cut;
mod extend;
mod read;
