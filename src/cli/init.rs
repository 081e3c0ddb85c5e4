//! `init`: a cell file to start from.

use super::args::Init;
use super::output::{Outputs, print};
use super::{Answer, Outcome};
use deflex::cell::{backup_template, described, described_template, nearest, template};
use deflex::robot::BUILTIN;
use deflex::text::{Diagnostic, Source};
use std::path::{Path, PathBuf};

pub(super) fn run(args: &Init) -> Outcome {
    if args.list {
        let width = BUILTIN.iter().map(|robot| robot.model.len()).max().unwrap_or(0);
        let line = |robot: &deflex::robot::Builtin| format!("{:width$}  {}\n", robot.model, robot.source);
        print(BUILTIN.iter().map(line).collect::<String>().as_bytes())?;
        return Ok(Answer::Yes);
    }
    if let Some(path) = &args.urdf {
        let source = super::files::source(path)?;
        let described = described(&source, args.tip.as_deref())?;
        return write(args, &described_template(&described, &source.name));
    }
    if let Some(folder) = &args.backup {
        let moc = folder.join("SYSPAR/MOC.cfg");
        if moc.exists() && !moc.is_file() {
            let error =
                Diagnostic::error("init.backup", &moc.display().to_string(), "is no file, but a pipe or a device");
            return Err(error.help("give the folder of a backup, in which SYSPAR/MOC.cfg is").into());
        }
        let moc = super::files::source(&moc)?;
        let modules = modules(folder)?;
        return write(args, &backup_template(&moc, &modules, args.robot.as_deref())?);
    }
    let Some(model) = args.robot.as_deref() else {
        let models: Vec<&str> = BUILTIN.iter().map(|robot| &robot.model[..]).collect();
        let help = format!(
            "give --robot with one of {}; any other robot starts from one of them and gets its own [robot.kinematics]",
            models.join(", ")
        );
        return Err(Diagnostic::error("init.robot", "", "which robot is it?").help(help).into());
    };
    let Some(robot) = BUILTIN.iter().find(|robot| robot.model.eq_ignore_ascii_case(model)) else {
        let near = nearest(model, BUILTIN.iter().map(|robot| &robot.model[..]));
        let help = near.map_or_else(
            || "`deflex init --list` names the built-in robots; any other goes into [robot.kinematics]".to_owned(),
            |near| format!("did you mean `{near}`? `deflex init --list` names them all"),
        );
        return Err(Diagnostic::error("init.robot", "", format!("no built-in robot `{model}`")).help(help).into());
    };
    write(args, &template(robot))
}

/// The modules of a backup, task by task, by their names.
fn modules(folder: &Path) -> Result<Vec<Source>, Vec<Diagnostic>> {
    let entries = |folder: &Path| {
        let mut found: Vec<PathBuf> =
            std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path())).collect();
        found.sort();
        found
    };
    // A pipe or a device under such a name may never end.
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
                sources.push(super::files::source(path)?);
            }
        }
    }
    Ok(sources)
}

/// Writes the cell file, which is one whatever the names and numbers of the source are.
fn write(args: &Init, cell: &str) -> Outcome {
    if let Err(error) = cell.parse::<toml_edit::DocumentMut>() {
        let message = format!("no cell file comes of this: {}", error.message());
        let help =
            "look for names and numbers in the source that are none, such as nan; please report it if there are none";
        return Err(Diagnostic::error("init.toml", "", message).help(help).into());
    }
    let mut outputs = Outputs::default();
    outputs.add(args.output.as_deref().unwrap_or(Path::new("-")), cell.as_bytes())?;
    outputs.commit()?;
    Ok(Answer::Yes)
}
