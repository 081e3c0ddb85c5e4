//! Predicts and corrects in whole cells, in one test target.

#![allow(clippy::unwrap_used)] // in helpers too, a failure is a failed test

mod krl;
mod poses;
mod rapid_air;
mod tp;
