//! Opens the window with a program that is built already: `cargo run -p deflex-studio --example serve PROGRAM FOLDER [PORT]`.

#![allow(clippy::print_stdout)] // the address is the result

use deflex_studio::{Options, Studio};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let (Some(program), Some(folder)) = (args.next(), args.next()) else {
        return Err("expected PROGRAM FOLDER [PORT]".into());
    };
    let program = std::fs::canonicalize(program)?;
    let port = args.next().map_or(Ok(0), |port| port.parse())?;
    let facts = std::env::var("STUDIO_FACTS").unwrap_or_else(|_| "{}".to_owned());
    let studio = Studio::open(Options { folder: folder.into(), port, program, facts: serde_json::from_str(&facts)? })?;
    println!("{}", studio.address());
    Ok(studio.serve()?)
}
