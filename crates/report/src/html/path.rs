//! The page of `compensate` and `predict`.

use super::markup::{Document, STAGE, Table, Tile, escape, fixed, mm, section, tiles};
use super::scene;
use super::trace::{Channels, MOST_STRETCHES, Sample, Trace, channels};
use crate::summary::{FailureLine, PathKind, grouped, parts_text};
use crate::{FileSummary, Origin, kept_text};
use deflex_cell::Cell;
use deflex_correct::{KeptCount, Row, Status};
use serde_json::json;
use std::collections::BTreeSet;

/// Columns of a report row, in the order of [`values`].
const COMMON: Channels = &[
    (4, &["x_mm", "y_mm", "z_mm"]),
    (6, &["error_x_mm", "error_y_mm", "error_z_mm", "error_mm"]),
    (7, &["error_rx_deg", "error_ry_deg", "error_rz_deg"]),
    (6, &["error_normal_mm"]),
    (3, &["fx_n", "fy_n", "fz_n"]),
    (6, &["sigma_mm"]),
    (1, &["stiffness_normal_n_per_mm", "stiffness_least_n_per_mm", "stiffness_most_n_per_mm"]),
    (6, &["remaining_path_mm", "error_part_mm"]),
    (4, &["spin_deg"]),
];

/// Columns of the arm's posture.
const STANCE: Channels = &[
    (
        3,
        &[
            "axis_1_deg", "axis_2_deg", "axis_3_deg", "axis_4_deg", "axis_5_deg", "axis_6_deg", "limit_margin_deg",
            "singular_margin_deg", "base_x_mm", "base_y_mm", "base_z_mm",
        ],
    ),
    (6, &["base_rx_deg", "base_ry_deg", "base_rz_deg"]),
    (3, &["eax_a", "eax_b", "eax_c", "eax_d", "eax_e", "eax_f", "table_x_mm", "table_y_mm", "table_z_mm"]),
    (6, &["table_i", "table_j", "table_k"]),
    (4, &["circle_x_mm", "circle_y_mm", "circle_z_mm"]),
];

/// Columns that only a correction has.
const CORRECTED: Channels = &[
    (6, &["correction_x_mm", "correction_y_mm", "correction_z_mm", "correction_mm"]),
    (7, &["correction_rx_deg", "correction_ry_deg", "correction_rz_deg"]),
    (6, &["remaining_x_mm", "remaining_y_mm", "remaining_z_mm", "remaining_mm"]),
];

fn values(row: &Row, kind: PathKind) -> Vec<f64> {
    let mut values = Vec::new();
    values.extend(row.position_mm);
    values.extend(row.error_mm);
    values.push(row.error_norm_mm());
    values.extend(row.error_deg);
    values.push(row.error_normal_mm);
    values.extend(row.force_n);
    values.push(row.sigma_mm.unwrap_or(f64::NAN));
    let stiffness = row.stiffness.map(|s| [s.normal_n_per_mm, s.least_n_per_mm, s.most_n_per_mm]);
    values.extend(stiffness.unwrap_or([f64::NAN; 3]));
    values.push(row.remaining_path_mm().unwrap_or(f64::NAN));
    values.push(row.error_part_mm.unwrap_or(f64::NAN));
    values.push(row.spin_deg.unwrap_or(f64::NAN));
    match &row.stance {
        Some(stance) => {
            values.extend(stance.axes_deg);
            values.extend([stance.limit_margin_deg, stance.singular_margin_deg]);
            values.extend(stance.base);
            values.extend(stance.external);
            values.extend(stance.table.unwrap_or([f64::NAN; 6]));
            values.extend(stance.circle_point.unwrap_or([f64::NAN; 3]));
        }
        None => values.extend(channels(STANCE).map(|_| f64::NAN)),
    }
    if kind == PathKind::Compensate {
        values.extend(row.correction_mm);
        values.push(row.correction_norm_mm());
        values.extend(row.correction_deg);
        values.extend(row.remaining_mm);
        values.push(row.remaining_norm_mm());
    }
    values
}

/// The path of one program. It takes rows one by one and uses bounded memory.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// use deflex_report::html::{PathKind, PathTrace};
///
/// let mut trace = PathTrace::new(PathKind::Compensate, 1);
/// trace.extend(&corrected.rows);
/// trace.quote(|_, line| Some(format!("line {line} of the program")));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct PathTrace {
    kind: PathKind,
    /// One path for each file with motions, with the name of the file. A program in a single file has one path without
    /// a name.
    parts: Vec<(Option<String>, Trace)>,
    /// Index of the path to which the next rows belong.
    at: usize,
}

impl PathTrace {
    /// An empty path, one of `programs` on a page.
    #[must_use]
    pub fn new(kind: PathKind, programs: usize) -> Self {
        let channels: &[Channels] = match kind {
            PathKind::Compensate => &[COMMON, STANCE, CORRECTED],
            PathKind::Predict | PathKind::Check => &[COMMON, STANCE],
        };
        Self { kind, parts: vec![(None, Trace::new(channels, MOST_STRETCHES / programs.max(1)))], at: 0 }
    }

    /// The next rows are motions of this file. Each file has a path of its own, because one path of many files could
    /// not be read.
    #[doc(hidden)]
    pub fn continue_in(&mut self, file: &str) {
        let named = |(name, _): &(Option<String>, Trace)| name.as_deref().is_none_or(|name| name == file);
        self.at = self.parts.iter().position(named).unwrap_or_else(|| {
            let empty = self.parts[0].1.emptied();
            self.parts.push((None, empty));
            self.parts.len() - 1
        });
        self.parts[self.at].0.get_or_insert_with(|| file.to_owned());
    }

    /// Adds rows in running order.
    pub fn extend(&mut self, rows: &[Row]) {
        for row in rows {
            self.parts[self.at].1.push(Sample {
                target: row.target,
                line: row.line,
                name: row.name.clone(),
                names: row.names.clone(),
                status: match row.status {
                    Status::Ok => "ok",
                    Status::Air => "air",
                    Status::Kept(_) => "kept",
                },
                values: values(row, self.kind),
                // Targets that are not solved have NaN, which is not a peak.
                peaks: [row.error_norm_mm().max(0.0), row.remaining_norm_mm().max(0.0)],
            });
        }
    }

    /// Quotes the line of the program at every target that the page will show. Call it after all rows have been added.
    /// `line_of` gives the text of a line from the target's ordinal and the line's number, and is called in running
    /// order.
    pub fn quote(&mut self, mut line_of: impl FnMut(u32, u32) -> Option<String>) {
        self.parts.iter_mut().for_each(|(_, trace)| trace.quote(&mut line_of));
    }
}

/// The page of a run over one or more programs.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// use deflex_correct::Summary;
/// use deflex_report::html::{PathKind, PathPage, PathTrace};
/// use deflex_report::{FileSummary, Origin};
///
/// let summary = FileSummary::of("slot.mod", &Summary::of(&corrected.rows), &[]);
/// let page = PathPage {
///     kind: PathKind::Compensate,
///     cell: &Origin::of("cell.toml", b""),
///     programs: &[(summary, PathTrace::new(PathKind::Compensate, 1))],
///     scene: None,
///     tolerance_mm: None,
/// };
/// assert!(page.html().starts_with("<!DOCTYPE html>"));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PathPage<'a> {
    /// The command.
    pub kind: PathKind,
    /// Cell file.
    pub cell: &'a Origin,
    /// Each program: its summary over all targets, and its path.
    pub programs: &'a [(FileSummary, PathTrace)],
    /// The cell, if its arm is to be drawn.
    pub scene: Option<&'a Cell>,
    /// Largest error that a check allows at a target, mm: a line in its chart.
    pub tolerance_mm: Option<f64>,
}

impl PathPage<'_> {
    /// The page.
    #[must_use]
    pub fn html(&self) -> String {
        let corrects = self.kind == PathKind::Compensate;
        let title = match self.programs {
            [(one, _)] => one.path.clone(),
            several => format!("{} programs", several.len()),
        };
        let mut body = self.tiles();
        if self.kind == PathKind::Check {
            body += &section("findings", "Findings", self.findings());
        }
        if self.programs.iter().map(|(_, path)| path.parts.len()).sum::<usize>() > 1 {
            body += "<p class=\"choice\"><label>Program <select id=\"program\"></select></label></p>\n";
        }
        body += STAGE;
        match self.programs {
            [(one, _)] if one.counts.kept.is_empty() => {}
            // Its other figures are on the cards.
            [(one, _)] => body += &section("programs", "Kept targets", kept_table(&one.counts.kept)),
            _ => body += &section("programs", "Programs", self.table()),
        }
        body += &section(
            "words",
            "What the figures are",
            if corrects { [WORDS, CORRECTION].concat() } else { WORDS.into() },
        );
        let programs: Vec<_> = self
            .programs
            .iter()
            .flat_map(|(sum, path)| {
                path.parts.iter().map(|(file, trace)| {
                    let mut path = trace.json();
                    let title = file.as_ref().unwrap_or(&sum.path);
                    path["title"] = json!(title);
                    let here =
                        |failure: &&FailureLine| failure.file.is_empty() || file.is_none() || failure.file == *title;
                    let lines: BTreeSet<usize> = sum.failures.iter().filter(here).map(|failure| failure.line).collect();
                    path["findings"] = json!(lines);
                    path
                })
            })
            .collect();
        let kicker = match self.kind {
            PathKind::Compensate => "compensate",
            PathKind::Predict => "predict",
            PathKind::Check => "check",
        };
        let scene = self.scene.map(scene::scene);
        let data = json!({ "kind": kicker, "paths": programs, "scene": scene, "tolerance_mm": self.tolerance_mm });
        let subtitle = format!("cell {}", self.cell.path);
        let sources = self.programs.iter().flat_map(|(sum, _)| &sum.sources);
        let origins: Vec<&Origin> = [self.cell].into_iter().chain(sources).collect();
        Document { kicker, title: &title, subtitle: &subtitle, body: &body, data: &data, origins: &origins }.html()
    }

    /// Number of targets with each result, over all programs.
    fn parts(&self) -> Vec<(&'static str, usize)> {
        let mut all: Vec<(&'static str, usize)> = Vec::new();
        for (sum, _) in self.programs {
            let parts = sum.parts(self.kind);
            all.resize(parts.len(), ("", 0));
            for (all, (what, count)) in all.iter_mut().zip(parts) {
                *all = (what, all.1 + count);
            }
        }
        all
    }

    /// Sums over all programs.
    fn tiles(&self) -> String {
        let sums = || self.programs.iter().map(|(sum, _)| sum);
        let most = |of: fn(&FileSummary) -> f64| sums().map(of).fold(0.0, f64::max);
        let count = |of: fn(&FileSummary) -> usize| sums().map(of).sum::<usize>();
        let rms = match self.programs {
            [(one, _)] => format!("rms {} mm over cutting targets", fixed(one.counts.rms_error_mm, 4)),
            _ => String::new(),
        };
        let mut all = vec![
            Tile {
                key: "targets",
                value: grouped(count(|sum| sum.counts.targets)),
                unit: "",
                label: "Targets",
                aside: parts_text(&self.parts()),
            },
            Tile {
                key: "max_error_mm",
                value: mm(most(|sum| sum.counts.max_error_mm)),
                unit: "mm",
                label: "Largest predicted error",
                aside: rms,
            },
        ];
        let unjudged: Vec<&KeptCount> = sums().flat_map(|sum| &sum.counts.unjudged).collect();
        if !unjudged.is_empty() {
            let reasons: Vec<String> = unjudged.iter().copied().map(kept_text).collect();
            all.push(Tile {
                key: "unjudged",
                value: grouped(unjudged.iter().map(|unjudged| unjudged.count).sum()),
                unit: "",
                label: "Not judged",
                aside: reasons.join(", "),
            });
        }
        if self.kind == PathKind::Check {
            let failed = count(|sum| usize::from(!sum.failures.is_empty()));
            all.push(Tile {
                key: "findings",
                value: grouped(count(|sum| sum.failures.len() + sum.more_failures)),
                unit: "",
                label: "Findings",
                aside: format!("in {failed} of {} programs", self.programs.len()),
            });
        }
        if self.kind == PathKind::Compensate {
            all.push(Tile {
                key: "max_correction_mm",
                value: mm(most(|sum| sum.counts.max_correction_mm)),
                unit: "mm",
                label: "Largest correction",
                aside: match mm(most(|sum| sum.counts.max_kept_mm)) {
                    none if none == mm(0.0) => String::new(),
                    most => format!("kept targets stay off by up to {most} mm"),
                },
            });
        }
        let rms = match self.programs {
            [(one, _)] => format!("rms {} mm along the path", mm(one.counts.remaining_path_rms_mm)),
            _ => "along the path".to_owned(),
        };
        let (label, aside) = match self.kind {
            PathKind::Compensate => {
                let at_targets = mm(most(|sum| sum.counts.max_remaining_mm));
                ("Largest remaining error", format!("{rms}; at the targets up to {at_targets} mm"))
            }
            PathKind::Predict | PathKind::Check => ("Largest error along the path", rms),
        };
        all.push(Tile {
            key: "remaining_path_max_mm",
            value: mm(most(|sum| sum.counts.remaining_path_max_mm)),
            unit: "mm",
            label,
            aside,
        });
        tiles(&all)
    }

    fn findings(&self) -> String {
        /// Longer lists are in the report file.
        const SHOWN: usize = 200;
        let all = || self.programs.iter().flat_map(|(sum, _)| sum.failures.iter().map(move |failure| (sum, failure)));
        let count = all().count() + self.programs.iter().map(|(sum, _)| sum.more_failures).sum::<usize>();
        if count == 0 {
            let judged = match self.programs.iter().all(|(sum, _)| sum.counts.unjudged.is_empty()) {
                true => "every target",
                false => "every target that was judged",
            };
            return format!("<p>None: {judged} is reached and within tolerance.</p>\n");
        }
        let mut table = Table::new("found", &[("file", false), ("line", true), ("what", false)]);
        for (sum, failure) in all().take(SHOWN) {
            let file = if failure.file.is_empty() { &sum.path } else { &failure.file };
            table.row([escape(file), failure.line.to_string(), escape(&failure.message)]);
        }
        let more = match count.saturating_sub(SHOWN) {
            0 => String::new(),
            more => {
                let more = grouped(more);
                format!("<p class=\"note\">… and {more} more: <code>check --report CSV</code> has every target.</p>\n")
            }
        };
        table.html() + &more
    }

    fn table(&self) -> String {
        let head = [
            ("program", false),
            ("targets", true),
            ("parts", false),
            ("kept, and why", false),
            ("largest error, mm", true),
            ("rms error, mm", true),
            ("largest correction, mm", true),
            ("largest remaining at targets, mm", true),
            ("rms between targets, mm", true),
            ("largest between targets, mm", true),
        ];
        let mut table = Table::new("sums", &head);
        for (sum, _) in self.programs {
            let mut kept: Vec<String> = sum.counts.kept.iter().map(kept_text).collect();
            if sum.counts.max_kept_mm > 0.0 {
                kept.push(format!("with up to {} mm", fixed(sum.counts.max_kept_mm, 4)));
            }
            table.row([
                escape(&sum.path),
                sum.counts.targets.to_string(),
                parts_text(&sum.parts(self.kind)),
                escape(&kept.join(", ")),
                mm(sum.counts.max_error_mm),
                mm(sum.counts.rms_error_mm),
                mm(sum.counts.max_correction_mm),
                mm(sum.counts.max_remaining_mm),
                mm(sum.counts.remaining_path_rms_mm),
                mm(sum.counts.remaining_path_max_mm),
            ]);
        }
        table.html()
    }
}

/// Why targets of the only program are kept.
fn kept_table(kept: &[KeptCount]) -> String {
    let mut table = Table::new("kept", &[("targets", true), ("why they stay as they are", false)]);
    for kept in kept {
        table.row([grouped(kept.count), escape(kept.reason.text())]);
    }
    table.html()
}

const WORDS: &str = "<dl>
<dt>Error</dt><dd>Actual minus programmed position of the loaded tool centre point (TCP), as the cell predicts it, in the axes of the target's work object. <em>Along the normal</em>: at the point of contact, out of the material.</dd>
<dt>Remaining on the path</dt><dd>Largest distance between the path that the tip takes to the target and the programmed path: the same prediction between the targets, under the force that acts there.</dd>
<dt>Force</dt><dd>What the workpiece exerts on the tool, in work object axes.</dd>
<dt>Stiffness</dt><dd>Force on the tool that moves the TCP by a millimetre, through every effect of the cell, at the force that acts there. Along the surface normal n it is 1/(nᵀCn). In the softest and the stiffest direction it is one over the largest and the smallest eigenvalue of the compliance C.</dd>
</dl>
";

const CORRECTION: &str = "<dl>
<dt>Correction</dt><dd>Commanded minus programmed.</dd>
<dt>Remaining error</dt><dd>The same prediction for the corrected program, from its numbers as they are written.</dd>
</dl>
";
