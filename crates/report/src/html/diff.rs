//! The page of `diff`.

use super::markup::{Document, STAGE, Table, Tile, escape, fixed, mm, section, tiles};
use super::trace::{Channels, MOST_STRETCHES, Sample, Trace};
use crate::summary::grouped;
use crate::{Difference, Origin};
use deflex_program::{Goal, Program, Role};
use serde_json::json;

const CHANNELS: Channels = &[
    (4, &["x_mm", "y_mm", "z_mm"]),
    (6, &["shift_x_mm", "shift_y_mm", "shift_z_mm", "shift_mm", "turn_deg", "step_mm"]),
];

/// The page of the differences between `original` and the program called `corrected`.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// let found = deflex_report::difference(&program, &program);
/// let page = deflex_report::html::diff_page(&program, "corrected.mod", &found);
/// assert!(page.starts_with("<!DOCTYPE html>"));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[must_use]
pub fn diff_page(original: &Program, corrected: &str, found: &Difference) -> String {
    let name = original.sources.first().map_or("", |source| source.name.as_str());
    let mut path = trace(original, found);
    path.quote(|target, _| original.line_of(target));
    let mut path = path.json();
    path["title"] = json!(name);
    let mut changed = format!("{} of {} targets changed", grouped(found.moved.len()), grouped(found.targets));
    if !found.inserted.is_empty() {
        changed += &format!(", {} inserted", grouped(found.inserted.len()));
    }
    let mut body = tiles(&[
        Tile {
            key: "max_mm",
            value: mm(found.max_mm),
            unit: "mm",
            label: "Largest shift",
            aside: format!("mean {} mm of those that changed", fixed(found.mean_mm, 4)),
        },
        Tile { key: "max_deg", value: mm(found.max_deg), unit: "°", label: "Largest turn", aside: changed },
        Tile {
            key: "max_step_mm",
            value: mm(found.max_step_mm),
            unit: "mm",
            label: "Largest step",
            aside: "between the shifts of neighbours".to_owned(),
        },
        Tile {
            key: "other",
            value: found.other.len().to_string(),
            unit: "",
            label: "Other differences",
            aside: "anything but a target's numbers".to_owned(),
        },
    ]);
    body += STAGE;
    if !found.other.is_empty() {
        let mut table = Table::new("others", &[("line", true), ("what", false)]);
        for other in &found.other {
            let line = if other.line > 0 { other.line.to_string() } else { String::new() };
            table.row([line, quoted(&other.what)]);
        }
        body += &section("other", "Other differences", table.html());
    }
    body += &section("words", "What the figures are", WORDS);
    let data = json!({ "kind": "diff", "paths": [path] });
    let (title, subtitle) = (format!("{name} → {corrected}"), "targets of the second program against the first");
    let sources: Vec<Origin> = original.sources.iter().map(|source| Origin::of(&source.name, &source.bytes)).collect();
    let origins: Vec<&Origin> = sources.iter().collect();
    Document { kicker: "diff", title: &title, subtitle, body: &body, data: &data, origins: &origins }.html()
}

/// Targets of the first program that have a position of their own: joint targets have none without a cell.
fn trace(original: &Program, found: &Difference) -> Trace {
    let mut trace = Trace::new(&[CHANNELS], MOST_STRETCHES);
    let mut moved = found.moved.iter().peekable();
    for (i, target) in original.targets.iter().enumerate() {
        let change = moved.next_if(|moved| moved.index == i);
        let (Role::End, Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. }) = (target.role, target.goal)
        else {
            continue;
        };
        let (shift, size, turn, step) =
            change.map_or(([0.0; 3], 0.0, 0.0, 0.0), |m| (m.shift_mm, m.mm, m.deg, m.step_mm));
        trace.push(Sample {
            target: target.ordinal,
            line: target.line,
            name: target.name.clone(),
            names: None,
            status: if change.is_some() { "changed" } else { "same" },
            values: position_mm.into_iter().chain(shift).chain([size, turn, step]).collect(),
            peaks: [size, step],
        });
    }
    trace
}

/// A difference in words, with its quotations of the program as code.
fn quoted(what: &str) -> String {
    let parts = escape(what);
    let parts = parts.split('`').enumerate();
    parts.map(|(i, part)| if i % 2 == 0 { part.to_owned() } else { format!("<code>{part}</code>") }).collect()
}

const WORDS: &str = "<dl>
<dt>Shift</dt><dd>Position in the second program minus that in the first, in the axes of the target's work object.</dd>
<dt>Turn</dt><dd>Angle between the two orientations; for cutter location data, between the two tool axes.</dd>
<dt>Step</dt><dd>Difference between the shift of a target and that of the one before.</dd>
</dl>
";
