//! `generate`: writes completions and manual pages from the same definitions as `--help`.

use super::args::{Cli, Generate, Generated};
use super::{Answer, Outcome};
use crate::session::output::{Outputs, print};
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use deflex::text::Diagnostic;
use std::io::{self, Write};
use std::path::Path;

pub(super) fn run(args: &Generate) -> Outcome {
    let mut command = Cli::command();
    match &args.what {
        Generated::Completions { shell } => {
            let mut bytes = Vec::new();
            clap_complete::generate(*shell, &mut command, "deflex", &mut bytes);
            print(&bytes)?;
        }
        Generated::Man { dir } => {
            command.build();
            let mut outputs = Outputs::default();
            pages(&command, dir, &mut outputs)?;
            outputs.commit()?;
        }
    }
    Ok(Answer::Yes)
}

/// Writes the manual page of a command, and of its subcommands.
fn pages(command: &Command, dir: &Path, outputs: &mut Outputs) -> Result<(), Vec<Diagnostic>> {
    let name = command.get_display_name().unwrap_or(command.get_name());
    let page = page(command, name).map_err(|error| Diagnostic::error("io.man", "", error.to_string()))?;
    outputs.add(&dir.join(format!("{name}.1")), &page)?;
    command.get_subcommands().try_for_each(|below| pages(below, dir, outputs))
}

fn page(command: &Command, name: &str) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let man = Man::new(command.clone());
    writeln!(out, ".TH {} 1 \"\" \"deflex {}\"", name.to_uppercase(), env!("CARGO_PKG_VERSION"))?;
    man.render_name_section(&mut out)?;
    man.render_synopsis_section(&mut out)?;
    man.render_description_section(&mut out)?;
    man.render_options_section(&mut out)?;
    if command.has_subcommands() {
        man.render_subcommands_section(&mut out)?;
    }
    if let Some(notes) = command.get_after_help() {
        // Examples keep their lines, because they are to be copied.
        writeln!(out, ".SH NOTES\n.nf")?;
        for line in notes.to_string().lines() {
            // Escapes the characters that roff would interpret. No line begins with a roff request.
            writeln!(out, "\\&{}", line.replace('\\', "\\e").replace('-', "\\-"))?;
        }
        writeln!(out, ".fi")?;
    }
    Ok(out)
}
