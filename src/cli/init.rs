//! `init`: writes a cell file to start from.

use super::args::Init;
use super::{Answer, Outcome};
use crate::session::output::{Outputs, print};
use deflex::cell::{backup_template, described, described_template, template};
use deflex::robot::Builtin;
use deflex::text::{Diagnostic, Source};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

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
    if let Some(path) = &args.urdf {
        let source = crate::session::read::source(path)?;
        let described = described(&source, args.tip.as_deref())?;
        return write(args, &described_template(&described, &source.name));
    }
    if let Some(folder) = &args.backup {
        let moc = folder.join("SYSPAR/MOC.cfg");
        if moc.exists() && !moc.is_file() {
            let error =
                Diagnostic::error("init.backup", &moc.display().to_string(), "is not a file, but a pipe or a device");
            return Err(error.help("give the folder of a backup, in which SYSPAR/MOC.cfg is").into());
        }
        let moc = crate::session::read::source(&moc)?;
        let modules = modules(folder)?;
        return write(args, &backup_template(&moc, &modules, args.robot.as_deref())?);
    }
    let Some(model) = args.robot.as_deref() else {
        let help = "give --robot MODEL, such as irb120-3-0.58 or kr240-r2900-2; `deflex init --list` shows all built-in \
                    robots, `--list kr240` those of a name; any other robot starts from one that is like it and gets its \
                    own [robot.kinematics]";
        return Err(Diagnostic::error("init.robot", "", "which robot is it?").help(help).into());
    };
    let robot = Builtin::named(model).map_err(|near| {
        Diagnostic::error("init.robot", "", format!("no built-in robot `{model}`")).help(Builtin::meant(&near))
    })?;
    write(args, &template(robot))
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

/// The modules of a backup, ordered by task and name.
fn modules(folder: &Path) -> Result<Vec<Source>, Vec<Diagnostic>> {
    let entries = |folder: &Path| {
        let mut found: Vec<PathBuf> =
            std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path())).collect();
        found.sort();
        found
    };
    // Reading a pipe or a device with such a name might never end.
    let is_module = |path: &PathBuf| {
        if !path.is_file() {
            return false;
        }
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        ending.is_some_and(|ending| matches!(&ending[..], "mod" | "sys" | "modx" | "sysx"))
    };
    let mut sources = Vec::new();
    for task in entries(&folder.join("RAPID")) {
        for kind in ["PROGMOD", "SYSMOD"] {
            for path in entries(&task.join(kind)).iter().filter(|path| is_module(path)) {
                sources.push(crate::session::read::source(path)?);
            }
        }
    }
    Ok(sources)
}

/// Writes the cell file after checking that it is valid TOML, since names and numbers of the source go into it.
fn write(args: &Init, cell: &str) -> Outcome {
    if let Err(error) = cell.parse::<toml_edit::DocumentMut>() {
        let message = format!("no cell file can be made from this: {}", error.message());
        let help =
            "look for invalid names and numbers in the source, such as nan; if there are none, please report this";
        return Err(Diagnostic::error("init.toml", "", message).help(help).into());
    }
    let mut outputs = Outputs::default();
    outputs.add(args.output.as_deref().unwrap_or(Path::new("-")), cell.as_bytes())?;
    outputs.commit()?;
    Ok(Answer::Yes)
}
