//! The Python module: the library's public functions, with NumPy arrays for tables and Python's exceptions for errors. Their
//! Python signatures are in `deflex/_deflex.pyi`, and the public interface is in `deflex/*.py`.

mod arrays;
mod cell;
mod effect;
mod errors;
mod program;
mod robot;
mod run;
mod work;

use pyo3::prelude::*;

/// The compiled half of `deflex`.
#[pymodule]
mod _deflex {
    #[pymodule_export]
    use super::arrays::table_text;
    #[pymodule_export]
    use super::cell::{Cell, robot_parts};
    #[pymodule_export]
    use super::effect::Effect;
    #[pymodule_export]
    use super::errors::{DeflexError, Diagnostic, diagnostic_of, diagnostic_parts};
    #[pymodule_export]
    use super::program::{Program, program_of, program_parts};
    #[pymodule_export]
    use super::robot::{Robot, cutting_force};
    #[pymodule_export]
    use super::run::{
        columns, diff, driven_path, identify, identify_path, init, inspect, page, plan, read_table, run, simulate,
        unrounded, write,
    };
    #[pymodule_export]
    use super::{main, version};
}

/// Runs the command line in this process and returns its exit code.
#[pyfunction]
fn main(py: Python<'_>, args: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| deflex::cli::main(args))
}

/// Version of deflex.
#[pyfunction]
fn version() -> &'static str {
    deflex::report::VERSION
}
