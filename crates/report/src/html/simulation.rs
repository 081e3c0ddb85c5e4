//! The page of `simulate`.

use super::markup::{COMMON, Document, Table, Tile, fixed, mm, section, tiles};
use crate::summary::grouped;
use crate::{CutterAt, DeviationMap, MapFigures};
use serde_json::{Value, json};

const SCRIPT: &str = include_str!("assets/part.js");

/// The page of a simulated part, coloured by its deviation. All maps are of the same surface, and each has a name. `cutters` stand at the
/// worst place of each map.
#[must_use]
#[doc(hidden)]
pub fn simulation_page(
    program: &str,
    cell: &str,
    maps: &[(&str, DeviationMap)],
    figures: &[(&str, MapFigures)],
    cutters: &[Option<CutterAt>],
) -> String {
    let mut body = String::new();
    if let Some((_, last)) = figures.last() {
        let percent = |share: f64| format!("{} % of the surface", fixed(100.0 * share, 1));
        body += &tiles(&[
            Tile {
                key: "rms_mm",
                value: mm(last.rms_mm),
                unit: "mm",
                label: "Deviation, rms",
                aside: format!("at {} points of the surface", grouped(last.points)),
            },
            Tile {
                key: "max_mm",
                value: mm(last.max_mm),
                unit: "mm",
                label: "Largest",
                aside: format!("mean {} mm", mm(last.mean_mm)),
            },
            Tile {
                key: "gouge_mm",
                value: mm(last.gouge.max_mm),
                unit: "mm",
                label: "Deepest gouge",
                aside: percent(last.gouge.share),
            },
            Tile {
                key: "leftover_mm",
                value: mm(last.leftover.max_mm),
                unit: "mm",
                label: "Most left over",
                aside: percent(last.leftover.share),
            },
        ]);
    }
    body += &stage(maps);
    let mut table = Table::new(
        "figures-table",
        &[
            ("", false),
            ("rms, mm", true),
            ("mean, mm", true),
            ("mean with sign, mm", true),
            ("largest gouge, mm", true),
            ("most left over, mm", true),
        ],
    );
    for (name, f) in figures {
        table.row([
            (*name).to_owned(),
            mm(f.rms_mm),
            mm(f.mean_mm),
            mm(f.mean_signed_mm),
            mm(f.gouge.max_mm),
            mm(f.leftover.max_mm),
        ]);
    }
    body += &section("table", "Figures", table.html());
    body += &section("words", "What the figures are", WORDS);
    let data = data(maps, cutters);
    let subtitle = format!("the stock as the loaded arm will leave it, {cell}");
    Document { kicker: "simulate", title: program, subtitle: &subtitle, body: &body, data: &data, origins: &[] }
        .html_with(&[COMMON[0], COMMON[1], SCRIPT].concat())
}

/// Thousandths of a millimetre as whole numbers, tenths of a micrometre for deviations.
fn data(maps: &[(&str, DeviationMap)], cutters: &[Option<CutterAt>]) -> Value {
    let whole = |value: f64| (value * 1e6).round();
    let Some((_, first)) = maps.first() else { return json!({}) };
    let points: Vec<f64> = first.programmed.points.iter().flat_map(|p| [p.x, p.y, p.z]).map(whole).collect();
    let maps: Vec<Value> = maps
        .iter()
        .map(|(name, map)| {
            let values: Vec<Option<f64>> = map.deviations_mm.iter().map(|d| d.map(|d| (d * 1e4).round())).collect();
            json!({ "name": name, "values": values })
        })
        .collect();
    let cutter = |at: &Option<CutterAt>| {
        at.map(|CutterAt { pose, cutter }| {
            let [tip, axis] = [pose.tip.map(whole), pose.axis.into_inner()].map(<[f64; 3]>::from);
            let (radius, corner) = (whole(cutter.diameter / 2.0), whole(cutter.corner_radius));
            json!({ "tip": tip, "axis": axis, "radius": radius, "corner": corner })
        })
    };
    let cutters: Vec<Option<Value>> = cutters.iter().map(cutter).collect();
    let triangles = first.programmed.triangles.concat();
    json!({ "kind": "simulate", "points": points, "triangles": triangles, "maps": maps, "cutters": cutters })
}

/// A view of each map, side by side.
fn stage(maps: &[(&str, DeviationMap)]) -> String {
    let view = |(name, _): &(&str, DeviationMap)| {
        format!(
            "<figure><canvas class=\"part\" tabindex=\"0\" role=\"img\" aria-label=\"The part in 3-D, {name}, coloured by its \
             deviation. Drag or arrow keys turn it, the wheel zooms.\" style=\"height:32rem\"></canvas><figcaption>{name}</figcaption></figure>"
        )
    };
    let views: String = maps.iter().map(view).collect();
    let histogram = |(name, _): &(&str, DeviationMap)| {
        format!(
            "<figure><canvas class=\"bars\" role=\"img\" aria-label=\"Histogram of the deviations, {name}\" style=\"height:11rem\"></canvas>\
             <figcaption>{name}</figcaption></figure>"
        )
    };
    let bars: String = maps.iter().map(histogram).collect();
    let columns = maps.len().clamp(1, 2);
    format!(
        r#"<section class="stage" id="part-stage" style="grid-template-columns:minmax(0,1fr)"><div class="view">
<div class="toolbar" role="toolbar" aria-label="View"><span class="buttons"><label>Tolerance (full colour) ± <input id="limit" type="number" min="0.001" step="0.01" style="width:6em"> mm</label></span>
<span class="buttons"><button type="button" data-view="iso">3-D</button><button type="button" data-view="top">Top</button><button type="button" data-view="front">Front</button><button type="button" data-view="side">Side</button><button type="button" data-view="fit">Fit</button><button type="button" id="worst">Worst place</button></span></div>
<div class="views" style="grid-template-columns:repeat({columns},minmax(0,1fr))">{views}</div>
<div class="legend"><span id="low"></span><span id="ramp"></span><span id="high"></span><span id="uncut" style="width:24px;height:11px;border-radius:3px;margin-left:16px"></span><span>not cut</span></div>
<p class="hint">Grey: as programmed. Drag turns, shift-drag moves, wheel zooms, a click shows the deviation. Keys: arrows turn, + − zoom, <kbd>0</kbd> fits. The ring marks the worst place, and the tool stands as programmed where it cuts there. <span id="there" role="status"></span></p>
</div></section>
<section id="charts"><div class="heading"><h2>Share of the surface by its deviation</h2><p class="key"><span class="swatch limit">the tolerance that is set above</span></p></div>
<div class="views" style="grid-template-columns:repeat({columns},minmax(0,1fr))">{bars}</div></section>
"#
    )
}

const WORDS: &str = "<dl>
<dt>Deviation</dt><dd>The surface that the loaded arm leaves minus the programmed one, out of the material: above zero material is left over, below zero it is gouged.</dd>
<dt>Programmed surface</dt><dd>What the cutters leave of the stock on the poses of the program (of the original, with --against).</dd>
</dl>
";
