//! `init`: writes a cell file to start from.

use super::args::Init;
use super::{Answer, Outcome};
use crate::session::output::{Outputs, print};
use crate::session::{CellSource, init};
use deflex::robot::Builtin;
use deflex::text::Diagnostic;
use std::fmt::Write as _;
use std::path::Path;

pub(super) fn run(args: &Init) -> Outcome {
    if let Some(filter) = &args.list {
        let listed = Builtin::listed(filter);
        if listed.is_empty() {
            let message = format!("no built-in robot has a maker or a model with `{filter}`");
            let help = "`deflex init --list` shows all built-in robots; any other goes into [robot.kinematics]";
            return Err(Diagnostic::error("init.robot", "", message).help(help).into());
        }
        print(table(&listed).as_bytes())?;
        return Ok(Answer::Yes);
    }
    let from = match (&args.urdf, &args.backup, args.robot.as_deref()) {
        (Some(file), ..) => CellSource::Urdf { file, tip: args.tip.as_deref() },
        (None, Some(folder), robot) => CellSource::Backup { folder, robot },
        (None, None, Some(model)) => CellSource::Robot(model),
        (None, None, None) => {
            let help = "give --robot MODEL, such as irb120-3-0.58 or kr240-r2900-2; `deflex init --list` shows all built-in \
                        robots, `--list kr240` those of a name; any other robot starts from one that is like it and gets its \
                        own [robot.kinematics]";
            return Err(Diagnostic::error("init.robot", "", "which robot is it?").help(help).into());
        }
    };
    let cell = init(from)?;
    let mut outputs = Outputs::default();
    outputs.add(args.output.as_deref().unwrap_or(Path::new("-")), cell.as_bytes())?;
    outputs.commit()?;
    Ok(Answer::Yes)
}

/// The robots as a table whose first column is the model.
fn table(robots: &[&Builtin]) -> String {
    let width = |column: fn(&Builtin) -> &str, title: &str| {
        robots.iter().map(|robot| column(robot).chars().count()).chain([title.len()]).max().unwrap_or(0)
    };
    let (model, maker) = (width(|robot| &robot.model, "model"), width(|robot| &robot.maker, "maker"));
    let mut text = format!("{:model$}  {:maker$}  payload kg  reach mm  source\n", "model", "maker");
    for robot in robots {
        let Builtin { payload_kg, reach_mm, source, .. } = robot;
        // Writing to a String cannot fail.
        let _ =
            writeln!(text, "{:model$}  {:maker$}  {payload_kg:>10}  {reach_mm:>8}  {source}", robot.model, robot.maker);
    }
    text
}
