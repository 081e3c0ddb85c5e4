//! Exit code, nothing else.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(deflex::cli::main(std::env::args_os()))
}
