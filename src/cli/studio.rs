//! `studio`: a window for people who have no shell. Its runs are runs of this same command.

use super::args::Studio as Arguments;
use super::output::print;
use super::{Answer, Outcome, message};
use deflex::cell::template;
use deflex::cutting::materials::MATERIALS;
use deflex::measured::column_names;
use deflex::program::Language;
use deflex::report::VERSION;
use deflex::robot::Builtin;
use deflex::text::{Diagnostic, Severity};
use deflex_studio::{Error, Options, Studio};
use serde_json::{Value, json};
use std::io;
use std::process::{Command, Stdio};

pub(super) fn run(args: &Arguments) -> Outcome {
    let program = std::env::current_exe().map_err(|error| failed(&Error::System(error.to_string())))?;
    let options = Options { folder: args.folder.clone(), port: args.port.unwrap_or_default(), program, facts: facts() };
    let studio = Studio::open(options).map_err(|error| failed(&error))?;
    print(format!("{}\n", studio.address()).as_bytes())?;
    let started = if args.no_browser { Ok(()) } else { open_browser(&studio.address_once()) };
    if let Err(error) = started {
        let note = Diagnostic::error("studio.browser", "", format!("no browser was started: {error}"));
        message::print(&[note.severity(Severity::Note).help("open the address above in a browser")], false);
    }
    studio.serve().map_err(|error| failed(&error))?;
    Ok(Answer::Yes)
}

fn failed(error: &Error) -> Vec<Diagnostic> {
    let (code, help) = match error {
        Error::Folder { .. } => ("io.read", "give a folder that exists and may be read"),
        Error::Port { .. } => ("studio.port", "choose another --port, or leave it out for a free one"),
        _ => ("studio.system", "close other programs and try again"),
    };
    Diagnostic::error(code, "", error.to_string()).help(help).into()
}

/// What the window shows of this command.
fn facts() -> Value {
    let robots: Vec<Value> = Builtin::listed("")
        .into_iter()
        .map(|robot| {
            let Builtin { model, maker, payload_kg, reach_mm, source, .. } = robot;
            json!({ "model": model, "maker": maker, "payload_kg": payload_kg, "reach_mm": reach_mm, "source": source })
        })
        .collect();
    let languages: Vec<Value> =
        Language::ALL.map(|language| json!({ "word": language.word(), "endings": language.endings() })).into();
    let materials = MATERIALS.map(|material| material.name);
    let columns: Vec<&str> = column_names().collect();
    // What stands before the limits is one robot's own, and no example for another.
    let template = Builtin::listed("").first().map(|robot| template(robot));
    let template = template.as_deref().and_then(|text| text.find("\n[limits]").map(|at| &text[at + 1..]));
    json!({
        "version": VERSION,
        "robots": robots,
        "languages": languages,
        "materials": materials,
        "columns": columns,
        "template": template,
    })
}

/// Starts the browser that the system has for addresses.
fn open_browser(address: &str) -> io::Result<()> {
    let mut command = if cfg!(windows) {
        let mut command = Command::new("rundll32");
        command.arg("url.dll,FileProtocolHandler");
        command
    } else {
        Command::new(if cfg!(target_os = "macos") { "open" } else { "xdg-open" })
    };
    let quiet = command.arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut started = quiet.spawn()?;
    // Waits for it, so that no ended process is kept.
    std::thread::spawn(move || started.wait());
    Ok(())
}
