use crate::session::read::source;
use deflex::cell::{backup_template, described, described_template, template};
use deflex::robot::Builtin;
use deflex::text::{Diagnostic, Source};
use std::path::{Path, PathBuf};

/// What a cell file to start from is made from.
///
/// # Examples
/// ```
/// use deflex::session::{CellSource, init};
///
/// let text = init(CellSource::Robot("irb6660-205-1.9"))?;
/// assert!(text.contains("[robot]") && text.contains("# <<"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub enum CellSource<'a> {
    /// A built-in robot: `--robot`.
    Robot(&'a str),
    /// A robot description: `--urdf`.
    Urdf {
        /// The file.
        file: &'a Path,
        /// The last link, if it is not the usual one: `--tip`.
        tip: Option<&'a str>,
    },
    /// The backup of an ABB controller: `--backup`.
    Backup {
        /// Its folder.
        folder: &'a Path,
        /// The built-in robot, where the backup does not state it: `--robot`.
        robot: Option<&'a str>,
    },
}

/// The text of a cell file to start from, as `deflex init` writes it.
///
/// # Errors
/// Every error for which the command ends with exit code 2.
///
/// # Examples
/// ```
/// use deflex::session::{CellSource, init};
///
/// let errors = init(CellSource::Robot("irb6660-205-1.8")).unwrap_err();
/// assert_eq!(errors[0].code, "init.robot");
/// ```
pub fn init(from: CellSource<'_>) -> Result<String, Vec<Diagnostic>> {
    let text = match from {
        CellSource::Robot(model) => template(Builtin::named(model).map_err(|near| {
            Diagnostic::error("init.robot", "", format!("no built-in robot `{model}`")).help(Builtin::meant(&near))
        })?),
        CellSource::Urdf { file, tip } => {
            let source = source(file)?;
            described_template(&described(&source, tip)?, &source.name)
        }
        CellSource::Backup { folder, robot } => {
            let moc = folder.join("SYSPAR/MOC.cfg");
            if moc.exists() && !moc.is_file() {
                let message = "is not a file, but a pipe or a device";
                let error = Diagnostic::error("init.backup", &moc.display().to_string(), message);
                return Err(error.help("give the folder of a backup, in which SYSPAR/MOC.cfg is").into());
            }
            backup_template(&source(&moc)?, &modules(folder)?, robot)?
        }
    };
    // Names and numbers of the source go into the text.
    match text.parse::<toml_edit::DocumentMut>() {
        Ok(_) => Ok(text),
        Err(error) => {
            let message = format!("no cell file can be made from this: {}", error.message());
            let help =
                "look for invalid names and numbers in the source, such as nan; if there are none, please report this";
            Err(Diagnostic::error("init.toml", "", message).help(help).into())
        }
    }
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
                sources.push(source(path)?);
            }
        }
    }
    Ok(sources)
}
