//! `studio`: a window in the browser for people who do not use a shell. The window runs this same command.

use super::args::Studio as Arguments;
use super::{Answer, Outcome, message};
use crate::session::output::print;
use deflex::cell::template;
use deflex::cutting::materials::MATERIALS;
use deflex::measured::column_names;
use deflex::program::Language;
use deflex::report::VERSION;
use deflex::robot::{Builtin, Robot};
use deflex::text::{Diagnostic, Severity};
use deflex_studio::{Error, Options, Studio};
use nalgebra::{Point3, Vector3};
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

/// Lists that the window shows: robots, materials, languages, columns and a template of the cell.
fn facts() -> Value {
    let robots: Vec<Value> = Builtin::listed("")
        .into_iter()
        .map(|robot| {
            let Builtin { model, maker, payload_kg, reach_mm, source, .. } = robot;
            json!({
                "model": model, "maker": maker, "payload_kg": payload_kg, "reach_mm": reach_mm, "source": source,
                "parallelogram": robot.parallelogram, "side_mm": side_view(&robot.robot()),
            })
        })
        .collect();
    let languages: Vec<Value> =
        Language::ALL.map(|language| json!({ "word": language.word(), "endings": language.endings() })).into();
    let materials = MATERIALS.map(|material| material.name);
    let columns: Vec<&str> = column_names().collect();
    // The part of the template before `[limits]` describes one particular robot, so it is no use as an example.
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

/// The arm in its home position seen from the right, in mm: the points from base to flange at which the length of a
/// link and its offset meet, each as (forwards, up).
fn side_view(robot: &Robot) -> Vec<[f64; 2]> {
    let frames = robot.frames(&robot.motor_from_axes_deg(&robot.home_deg()));
    let mut corners = vec![Vector3::zeros()];
    for (i, row) in robot.links.rows().iter().enumerate() {
        if let Some(before) = i.checked_sub(1).map(|before| frames.base_from_link[before]) {
            corners.push((before * Point3::new(row.a, 0.0, 0.0)).coords);
        }
        corners.push(frames.origin(i));
    }
    let mut side: Vec<[f64; 2]> = corners.iter().map(|at| [at.x, at.z].map(|m| (1e3 * m).round() + 0.0)).collect();
    side.dedup();
    side
}

/// Starts the system's browser with an address.
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
    // Waits for the browser, because the system keeps an ended process until its parent has waited for it.
    std::thread::spawn(move || started.wait());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::side_view;
    use deflex::robot::Builtin;

    #[test]
    #[allow(clippy::unwrap_used)] // a failure is a failed test
    fn a_picture_of_an_arm_has_its_published_lengths() {
        // ABB's product specification: axis 2 is 320 mm before and 780 mm above the base, the upper arm is 1125 mm, the wrist 200 mm
        // above and 1142.5 mm before axis 3, the flange 200 mm before the wrist.
        let arm = Builtin::named("irb6700-200-2.60").unwrap().robot();
        let [first, .., last] = side_view(&arm)[..] else { panic!("no arm") };
        let flange = [320.0 + 1142.5 + 200.0, 780.0 + 1125.0 + 200.0];
        let off = [0, 1].map(|k| (last[k] - flange[k]).abs().max(first[k].abs()));
        assert!(off.iter().all(|mm| *mm <= 0.5), "{first:?} to {last:?}");
    }
}
