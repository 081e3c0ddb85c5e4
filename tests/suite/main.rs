//! All tests that use deflex from outside, in one binary: linking is most of what a test binary costs. Modules mirror `src`.

#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr)] // in helpers too, a failure is a failed test

mod cell;
mod cli;
mod cutting;
mod cutting_measured;
mod cutting_properties;
mod cutting_table;
mod dense_walk;
mod docs;
mod documents;
mod effects;
mod eight_at_once;
mod equilibrium;
mod executed;
mod free_units;
mod fuzz_regressions;
mod grammar;
mod hard_cases;
mod html;
mod identify;
mod identify_faults;
mod identify_faulty_tables;
mod identify_poses;
mod identify_rows;
mod opw;
mod paper;
mod plan;
mod program;
mod public_api;
mod robot;
mod samples;
mod scripts;
mod second_reading;
mod stationary;
mod stock;
mod stream;
mod stream_cl;
mod stream_declared;
mod stream_krl;
mod stream_units;
mod supply;
mod units;
mod units_cl;
mod units_tp;
mod way;
