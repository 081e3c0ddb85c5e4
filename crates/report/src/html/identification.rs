//! The page of `identify`.

use super::markup::{Document, Table, Tile, bar, escape, fixed, further_pairs, list, section, tiles};
use super::trace::{Channels, MOST_STRETCHES, Sample, Trace};
use crate::identification::{elsewhere, is_down_to_noise, named_parameter, nearby, significant};
use crate::{Origin, identify_answer};
use deflex_identify::{Identification, ResidualRow, Separation, SetShare};
use serde_json::json;
use std::fmt::Write;

const CHANNELS: Channels = &[
    (0, &["run", "block", "held_out"]),
    (4, &["x_mm", "y_mm", "z_mm"]),
    (
        6,
        &[
            "prefit_x_mm", "prefit_y_mm", "prefit_z_mm", "prefit_mm", "postfit_x_mm", "postfit_y_mm", "postfit_z_mm",
            "postfit_mm",
        ],
    ),
];

/// The page of what was found about a cell, from programs and measured files.
#[must_use]
#[doc(hidden)]
pub fn identification_page(found: &Identification, cell: &Origin, data: &[Origin]) -> String {
    let mut body = format!("<p class=\"answer\"><strong>{}</strong></p>\n", escape(&identify_answer(found)));
    body += &figures(found);
    body += CHARTS;
    let mut outcome = section("added", "Added to the cell", added(found));
    outcome += &section("left", "What is left", left(found));
    outcome += &list("advice", "What to measure next", &found.advice);
    let mut grounds = match found.is_whole_arm() {
        true => section("effects", "Every effect of the written cell", effects(found)),
        false => section("sets", "Possible sets of effects", sets(&found.sets)),
    };
    grounds += &section("ranking", "Every effect alone", ranking(found));
    if !found.separability.is_empty() {
        outcome += &section(
            "separability",
            "Effects that these rows can hardly distinguish",
            separability(&found.separability),
        );
    }
    body += &format!("<div class=\"pair\">\n<div>{outcome}</div>\n<div>{grounds}</div>\n</div>\n");
    body += &section("words", "What the figures are", WORDS);
    let mut rows = trace(&found.residuals).json();
    rows["title"] = json!("residuals");
    let page = json!({ "kind": "identify", "paths": [rows] });
    let names: Vec<&str> = data.iter().map(|origin| &*origin.path).collect();
    let (title, subtitle) = (names.join(", "), format!("measured on cell {}", cell.path));
    let origins: Vec<&Origin> = [cell].into_iter().chain(data).collect();
    Document { kicker: "identify", title: &title, subtitle: &subtitle, body: &body, data: &page, origins: &origins }
        .html()
}

fn figures(found: &Identification) -> String {
    let [low, high] = found.after_rms_ci95_mm;
    let drift = found.run_drift_rms_mm.map_or_else(String::new, |rms_mm| {
        format!("; the run's drift of {} mm rms is taken off here and before", fixed(rms_mm, 4))
    });
    let errors = |errors: &deflex_identify::Errors| {
        format!("mean {}, largest {} mm", fixed(errors.mean_mm, 4), fixed(errors.max_mm, 4))
    };
    tiles(&[
        Tile {
            key: "before.rms_mm",
            value: fixed(found.before.rms_mm, 4),
            unit: "mm rms",
            label: "Declared cell",
            aside: errors(&found.before),
        },
        Tile {
            key: "after.rms_mm",
            value: fixed(found.after.rms_mm, 4),
            unit: "mm rms",
            label: "Extended cell",
            aside: format!("{}; 95 % [{}, {}] mm{drift}", errors(&found.after), fixed(low, 4), fixed(high, 4)),
        },
        Tile {
            key: "noise_floor_rms_mm",
            value: fixed(found.noise_floor_rms_mm, 4),
            unit: "mm rms",
            label: "Noise floor",
            aside: format!(
                "scatter {} mm and slow drift {} mm per axis",
                fixed(found.noise_mm, 4),
                fixed(found.wander_mm, 4)
            ),
        },
        Tile {
            key: "held_out_rows",
            value: found.held_out_rows.to_string(),
            unit: "rows",
            label: "Held out",
            aside: format!("of {}: no fit has used them, and the errors here are measured on them", found.rows),
        },
    ])
}

fn added(found: &Identification) -> String {
    if found.added.is_empty() {
        return match found.unexplained.significant {
            _ if found.is_whole_arm() => {
                "<p>The errors have many small causes. No single effect is certain, but together they describe the arm: all are in the written cell.</p>\n"
                    .to_owned()
            }
            true => "<p>Nothing.</p>\n".to_owned(),
            false if !found.faint().is_empty() => {
                "<p>Nothing: what may act is too faint on these rows to be named.</p>\n".to_owned()
            }
            false if !is_down_to_noise(found) => {
                "<p>Nothing: the rows are too few to say why the declared cell does not explain them.</p>\n".to_owned()
            }
            false => "<p>Nothing: the declared cell explains the data down to the noise.</p>\n".to_owned(),
        };
    }
    let mut out = String::new();
    for effect in &found.added {
        let kind = escape(&effect.kind);
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<h3><code>{kind}</code></h3>\n<p>Probability {}. Error on held-out rows: {} mm rms without it, {} mm rms with it.{}</p>",
            fixed(effect.posterior, 3),
            fixed(effect.held_out_rms_before_mm, 4),
            fixed(effect.held_out_rms_after_mm, 4),
            match &effect.not_told_apart_from[..] {
                [] => String::new(),
                kinds => format!(" <strong>Cannot be distinguished from {}.</strong>", escape(&kinds.join(", "))),
            }
        );
        let head = [("parameter", false), ("value", true), ("95 % interval", true), ("unit", false)];
        let mut table = Table::new("parameters", &head);
        for p in &effect.parameters {
            let (unit, size) = workshop_unit(p.unit);
            let [value, low, high] = [p.value, p.ci95[0], p.ci95[1]].map(|number| significant(number * size));
            let (key, of) = named_parameter(p);
            let name = format!("<code>{}</code>{of}", escape(key));
            table.row([name, value, format!("[{low}, {high}]"), escape(unit)]);
        }
        // A curve has dozens of numbers, which are shown on request.
        const SHOWN: usize = 12;
        if effect.parameters.is_empty() {
            continue;
        }
        if effect.parameters.len() > SHOWN {
            let _ = writeln!(
                out,
                "<details><summary>{} parameters</summary>{}</details>",
                effect.parameters.len(),
                table.html()
            );
        } else {
            out += &table.html();
        }
    }
    out
}

/// Every effect of the model, by its part in the prediction.
fn effects(found: &Identification) -> String {
    let mut effects: Vec<_> = found.effects.iter().collect();
    effects.sort_by(|a, b| b.share_rms_mm.total_cmp(&a.share_rms_mm));
    let most = effects.first().map_or(1.0, |effect| effect.share_rms_mm.max(f64::MIN_POSITIVE));
    let mut table = Table::new("effects", &[("effect", false), ("its part, mm rms", true), ("probability", true)]);
    for effect in effects {
        table.row([
            format!("<code>{}</code>", escape(&effect.kind)),
            bar(&fixed(effect.share_rms_mm, 4), effect.share_rms_mm / most),
            fixed(effect.probability, 3),
        ]);
    }
    let nearby = nearby(found).map(|text| format!("; {text}")).unwrap_or_default();
    format!("<p>Rows {}{nearby}.</p>\n{}", elsewhere(found), table.html())
}

/// The probabilities of the sets of effects.
fn sets(sets: &[SetShare]) -> String {
    if sets.is_empty() {
        return "<p>Over the whole robot, effects are found in stages and are not compared with one another.</p>\n"
            .to_owned();
    }
    let mut table = Table::new("sets", &[("set", false), ("probability", true)]);
    for SetShare { kinds, probability, .. } in sets {
        let kinds: Vec<String> = kinds.iter().map(|kind| format!("<code>{}</code>", escape(kind))).collect();
        let kinds = if kinds.is_empty() { "nothing".to_owned() } else { kinds.join(" + ") };
        table.row([kinds, bar(&fixed(*probability, 3), *probability)]);
    }
    table.html()
}

fn ranking(found: &Identification) -> String {
    if found.ranking.is_empty() {
        return "<p>No effect could be tried with these data.</p>\n".to_owned();
    }
    let most = found.ranking.iter().map(|r| r.held_out_rms_mm).fold(found.before.rms_mm, f64::max);
    let mut table = Table::new("ranked", &[("effect", false), ("held-out rms, mm", true), ("ΔBIC", true)]);
    for ranked in &found.ranking {
        let was_added = found.added.iter().any(|added| added.kind == ranked.kind);
        let mark = if was_added { " <span class=\"mark\">added</span>" } else { "" };
        table.row([
            format!("<code>{}</code>{mark}", escape(&ranked.kind)),
            bar(&fixed(ranked.held_out_rms_mm, 4), ranked.held_out_rms_mm / most),
            fixed(ranked.delta_bic, 1),
        ]);
    }
    table.html()
}

/// How many pairs are shown; the others are easier to distinguish.
const MOST_PAIRS: usize = 10;

/// Pairs of effects that these rows can hardly distinguish, the hardest first.
fn separability(pairs: &[Separation]) -> String {
    /// Below the first d′ a pair cannot be distinguished; from the second one on it can.
    const DISTINGUISHED: [f64; 2] = [3.0, 5.0];
    let shown = &pairs[..pairs.len().min(MOST_PAIRS)];
    let most = shown.iter().map(|pair| pair.d_prime).fold(DISTINGUISHED[1], f64::max);
    let head = [("effect that is there", false), ("may be taken for", false), ("d′", true), ("distinct", false)];
    let mut table = Table::new("apart", &head);
    for Separation { of, from, d_prime, .. } in shown {
        let verdict = match d_prime {
            d if *d < DISTINGUISHED[0] => "<strong>no</strong>",
            d if *d < DISTINGUISHED[1] => "hardly",
            _ => "yes",
        };
        let [of, from] = [of, from].map(|kind| format!("<code>{}</code>", escape(kind)));
        table.row([of, from, bar(&fixed(*d_prime, 2), d_prime / most), verdict.to_owned()]);
    }
    table.html() + &further_pairs(pairs.len() - shown.len())
}

/// A unit that a workshop reads, and its size in the given one: micrometres and arc seconds in place of metres and radians.
fn workshop_unit(unit: &str) -> (&str, f64) {
    match unit {
        "rad" => ("″", 3600.0_f64.to_degrees()),
        "mm" => ("µm", 1e3),
        "m" => ("µm", 1e6),
        other => (other, 1.0),
    }
}

fn left(found: &Identification) -> String {
    let mut out = if found.unexplained.significant {
        "<p><strong>More is left than noise, and no named effect explains it.</strong></p>\n".to_owned()
    } else {
        "<p>Nothing but noise.</p>\n".to_owned()
    };
    if !found.unexplained.correlates.is_empty() {
        let mut table = Table::new("correlates", &[("follows", false), ("r", true)]);
        for correlate in &found.unexplained.correlates {
            table.row([escape(&correlate.with), bar(&fixed(correlate.r, 2), correlate.r.abs())]);
        }
        out += &table.html();
    }
    if found.coverage.rows_outside > 0 {
        let joints: Vec<String> = found.coverage.joints_outside.iter().map(ToString::to_string).collect();
        let (rows, joints) = (found.coverage.rows_outside, joints.join(", "));
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<p>{rows} held-out rows lie outside what the curves were fitted on (joints {joints}): no gain is claimed there.</p>"
        );
    }
    if !found.outliers.is_empty() {
        let lines: Vec<String> = found.outliers.iter().map(ToString::to_string).collect();
        let _ = writeln!(out, "<p>Left out as outliers: lines {}.</p>", lines.join(", "));
    }
    out
}

fn trace(rows: &[ResidualRow]) -> Trace {
    let mut trace = Trace::new(&[CHANNELS], MOST_STRETCHES);
    let norm = |v: &[f64; 3]| v.iter().filter(|v| v.is_finite()).map(|v| v * v).sum::<f64>().sqrt();
    for (i, row) in rows.iter().enumerate() {
        let (before, after) = (norm(&row.prefit_mm), norm(&row.postfit_mm));
        let place = [row.run as f64, row.block as f64, f64::from(u8::from(row.held_out))];
        trace.push(Sample {
            target: u32::try_from(i + 1).unwrap_or(u32::MAX),
            line: u32::try_from(row.line).unwrap_or(u32::MAX),
            name: None,
            names: None,
            status: match (row.outlier, row.held_out) {
                (true, _) => "outlier",
                (false, true) => "held out",
                (false, false) => "fitted",
            },
            values: place
                .into_iter()
                .chain(row.place_mm)
                .chain(row.prefit_mm)
                .chain([before])
                .chain(row.postfit_mm)
                .chain([after])
                .collect(),
            peaks: [before, after],
        });
    }
    trace
}

const CHARTS: &str = r#"<section class="view twin" id="stage">
<div class="toolbar" role="toolbar" aria-label="View">
<h2>Residuals where they were measured</h2>
<span class="buttons"><label>Rows <select id="rows"><option value="held">held out</option><option value="all">all</option></select></label> <label><input type="checkbox" id="own"> each its own scale</label></span>
<span class="buttons"><button type="button" data-view="iso">3-D</button><button type="button" data-view="top">Top</button><button type="button" data-view="front">Front</button><button type="button" data-view="side">Side</button><button type="button" data-view="fit">Fit</button></span>
</div>
<div class="views">
<figure><canvas id="before" tabindex="0" role="application" aria-label="Residuals of the declared cell in 3-D. Arrow keys turn, shift and arrow keys move, plus and minus zoom, comma and full stop step through the rows."></canvas><figcaption id="before-most"></figcaption></figure>
<figure><canvas id="after" tabindex="0" role="application" aria-label="Residuals of the extended cell in 3-D; turns with the other picture."></canvas><figcaption id="after-most"></figcaption></figure>
</div>
<div class="legend"><span id="low"></span><span id="ramp"></span><span id="high"></span><span id="what"></span></div>
<p class="hint">Drag turns both, shift-drag moves, wheel zooms, click selects. Keys: arrows turn, + − zoom, <kbd>,</kbd> <kbd>.</kbd> step through rows, <kbd>0</kbd> fits.</p>
<p class="note" id="chosen" role="status" aria-live="polite"></p>
<div id="tip" role="status" hidden></div>
</section>
<section id="charts">
<div id="plots"></div>
<p class="hint">Drag in a chart to zoom in, double-click to zoom out, click to select the row.</p>
<p class="note" id="detail"></p>
</section>
"#;

const WORDS: &str = "<dl>
<dt>Residual</dt><dd>Measured minus predicted position. Before: predicted with the declared cell, of which only the pose of the measuring device is fitted. After: predicted with the extended cell.</dd>
<dt>Held out</dt><dd>Rows that were not used to fit numbers, to choose effects or to smooth.</dd>
<dt>Written</dt><dd>Before and after are residuals of the held-out rows. For a part, the numbers that are written to the cell are then fitted again to all rows, with the held-out ones.</dd>
<dt>Sets</dt><dd>How likely the chosen set of effects and faults is after these data, and each set next to it: with one member removed, exchanged or added.</dd>
<dt>Probability</dt><dd>How likely it is, after these data, that the effect is present and not another one in its place.</dd>
<dt>d′</dt><dd>The part of an effect of 0.03 mm rms that the other effect cannot imitate, divided by the noise. From 5 on the two can be distinguished. Below 3 they cannot, even with many more points of this kind.</dd>
<dt>ΔBIC</dt><dd>Twice the logarithm of the evidence for the declared cell divided by that for the cell with this effect. If it is negative, the effect explains the rows better.</dd>
</dl>
";
