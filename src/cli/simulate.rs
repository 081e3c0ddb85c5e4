//! `simulate`: computes the part before it is cut.

use super::against::Originals;
use super::args::{Corrected, Simulate};
use super::piped::{Piped, jobs};
use super::setup::setup;
use super::{Answer, Outcome, message, progress};
use crate::session::context::Context;
use crate::session::output::{Outputs, one_thing, to_stdout};
use crate::session::read::{both, source};
use crate::session::report::pretty;
use crate::session::{Simulated, SimulationProgress};
use deflex::correct::Removal;
use deflex::report::{SurfacePoint, map_csv, probe};
use deflex::text::{Diagnostic, LineColumn};
use nalgebra::Vector3;
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

pub(super) fn run(args: &Simulate) -> Outcome {
    let reports = args.reports();
    let context = Context::read(&args.reading.context)?;
    let piped = Piped::new(&args.inputs)?;
    // `simulate` leaves no input out: a file that cannot be understood stops the run.
    let jobs = jobs(piped.as_ref(), &args.inputs, args.reading.format, false, &context);
    let (setup, (jobs, _)) = both(setup(&args.model, context, Corrected::Pose, &reports), jobs)?;
    let several = jobs.len() > 1 && (args.stl.is_some() || args.html.is_some() || args.report.is_some());
    if several {
        let message = "--stl, --html and --report take one program, but there are several inputs";
        return Err(vec![Diagnostic::error("usage.several", "", message).help("give one program, or --json only")]);
    }
    let probes = args.probe.as_deref().map(probes).transpose()?;
    let printed = to_stdout([&args.report, &args.json, &args.html, &args.stl].map(Option::as_ref));
    one_thing(printed)?;
    let originals = Originals::new(args.against.as_deref(), &jobs, args.reading.format)?;
    let mut outputs = Outputs::default();
    let (mut files, mut text, mut notes) = (Vec::new(), String::new(), Vec::new());
    let count = jobs.len() as f64;
    let bar = progress::shares("cutting", args.common.quiet);
    for (i, job) in jobs.into_iter().enumerate() {
        let name = job.name.clone();
        let original = originals.of(&job, &setup)?;
        let program = setup.program(job)?;
        let shown = bar.clone();
        let reached: Arc<SimulationProgress> = Arc::new(move |share| {
            progress::reached(&shown, (i as f64 + share) / count);
            true
        });
        let simulated = Simulated::of(&name, &program, original.as_ref(), &setup, &reached)?;
        outputs.add_report(args.stl.as_ref(), || Ok(simulated.stl()))?;
        outputs.add_report(args.html.as_ref(), || Ok(simulated.page()))?;
        let probed = probes.as_ref().map(|points| probed(points, simulated.removal())).transpose()?;
        let rows = probed.unwrap_or_else(|| simulated.points());
        outputs.add_report(args.report.as_ref(), || Ok(map_csv(&rows)))?;
        if args.report.is_none() && probes.is_some() && printed == 0 {
            outputs.add(Path::new("-"), &map_csv(&rows))?;
        }
        text += &simulated.text();
        files.push(simulated.summary());
        notes.extend(simulated.notes);
    }
    bar.finish_and_clear();
    outputs.add_report(args.json.as_ref(), || pretty(&json!({ "files": files })))?;
    let silent = printed > 0 || args.common.quiet || (probes.is_some() && args.report.is_none());
    if !silent {
        outputs.add_summary(&text);
    }
    outputs.commit()?;
    if !args.common.quiet {
        message::print(&setup.notes(), true);
        message::print(&notes, args.common.quiet);
    }
    Ok(Answer::Yes)
}

/// A nominal point in m, and its unit normal if the file has one.
type Probe = (Vector3<f64>, Option<Vector3<f64>>);

/// Reads the columns `x_mm,y_mm,z_mm` and, if the file has them, `nx,ny,nz`.
fn probes(path: &Path) -> Result<Vec<Probe>, Vec<Diagnostic>> {
    let file = source(path)?;
    let fail = |LineColumn { line, column }, message: String| {
        let help = "expected a header row with x_mm, y_mm, z_mm and, for deviations along a normal, nx, ny, nz";
        let error = Diagnostic::error("probe.csv", &file.name, message).help(help);
        vec![Diagnostic { line, column, ..error }]
    };
    let header_row = LineColumn { line: 1, column: 1 };
    let mut reader = csv::Reader::from_reader(&file.bytes[..]);
    let header = reader.headers().map_err(|error| fail(header_row, error.to_string()))?.clone();
    let column = |name: &str| header.iter().position(|field| field.trim() == name);
    let three = |names: [&str; 3]| Some([column(names[0])?, column(names[1])?, column(names[2])?]);
    let position =
        three(["x_mm", "y_mm", "z_mm"]).ok_or_else(|| fail(header_row, "x_mm, y_mm or z_mm is missing".to_owned()))?;
    let names = ["nx", "ny", "nz"];
    let normal = three(names);
    if normal.is_none() && names.into_iter().any(|name| column(name).is_some()) {
        return Err(fail(header_row, "nx, ny, nz are given in part: give all of them or none".to_owned()));
    }
    let mut points = Vec::new();
    for row in reader.records() {
        let row = row.map_err(|error| fail(header_row, error.to_string()))?;
        let line = row.position().map_or(0, csv::Position::line) as usize;
        let vector = |columns: [usize; 3]| -> Result<Vector3<f64>, Vec<Diagnostic>> {
            let mut out = Vector3::zeros();
            for (k, column) in columns.into_iter().enumerate() {
                let text = row.get(column).unwrap_or_default().trim();
                let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
                let before = row.iter().take(column).map(|cell| cell.chars().count() + 1).sum::<usize>();
                let place = LineColumn { line, column: 1 + before };
                out[k] = value.ok_or_else(|| fail(place, format!("{} is `{text}`", &header[column])))?;
            }
            Ok(out)
        };
        let normal = normal.map(vector).transpose()?.and_then(|normal| normal.try_normalize(0.0));
        points.push((vector(position)? * 1e-3, normal));
    }
    Ok(points)
}

fn probed(points: &[Probe], actual: &Removal) -> Result<Vec<SurfacePoint>, Vec<Diagnostic>> {
    let row = |(i, (point, normal)): (usize, &Probe)| {
        let deviation_mm = probe(&actual.stock, point, normal.as_ref()).ok_or_else(|| {
            let message = format!("probed point {}: no surface of the part within 10 mm", i + 1);
            vec![
                Diagnostic::error("probe.far", "", message)
                    .help("points and normals are in the axes of the stock's work object, on the nominal surface"),
            ]
        })?;
        Ok(SurfacePoint { position_mm: (point * 1e3).into(), deviation_mm })
    };
    points.iter().enumerate().map(row).collect()
}
