//! Reads and writes whole programs, in one test target: the unit tests of the crate then compile none of the readers again.

#![allow(clippy::unwrap_used)] // in helpers too, a failure is a failed test

mod krl;
mod modules;
mod own_literals;
mod post;
mod rapid;
mod rapid_chunks;
mod tp;
mod waits;
