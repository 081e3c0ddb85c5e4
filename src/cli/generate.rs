//! `generate`: completions and manual pages, from the same table as `--help`.

use super::args::{Cli, Generate, Generated};
use super::output::{Outputs, print};
use super::{Answer, Outcome};
use clap::CommandFactory;
use clap_mangen::Man;
use deflex::text::Diagnostic;

pub(super) fn run(args: &Generate) -> Outcome {
    let mut command = Cli::command();
    match &args.what {
        Generated::Completions { shell } => {
            let mut bytes = Vec::new();
            clap_complete::generate(*shell, &mut command, "deflex", &mut bytes);
            print(&bytes)?;
        }
        Generated::Man { dir } => {
            let mut outputs = Outputs::default();
            command.build();
            let page = |command: &clap::Command| {
                let mut bytes = Vec::new();
                let rendered = Man::new(command.clone()).render(&mut bytes);
                rendered.map(|()| bytes).map_err(|error| Vec::from(Diagnostic::error("io.man", "", error.to_string())))
            };
            outputs.add(&dir.join("deflex.1"), &page(&command)?)?;
            for sub in command.get_subcommands().filter(|sub| !sub.is_hide_set()) {
                let name = format!("deflex-{}", sub.get_name());
                outputs.add(&dir.join(format!("{name}.1")), &page(&sub.clone().display_name(name))?)?;
            }
            outputs.commit()?;
        }
    }
    Ok(Answer::Yes)
}
