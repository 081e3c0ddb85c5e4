//! The frame of a page, and its tables and tiles.

use crate::{Origin, VERSION};
use base64::Engine;
use base64::prelude::BASE64_STANDARD as BASE64;
pub(super) use deflex_text::number::fixed;
use deflex_text::printable;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fmt::{Display, Write};

const STYLE: &str = include_str!("assets/page.css");
/// Scripts that every page with a picture needs.
pub(super) const COMMON: [&str; 2] = [include_str!("assets/data.js"), include_str!("assets/draw.js")];
const SCRIPTS: [&str; 8] = [
    COMMON[0],
    COMMON[1],
    include_str!("assets/view.js"),
    include_str!("assets/arm.js"),
    include_str!("assets/player.js"),
    include_str!("assets/charts.js"),
    include_str!("assets/twin.js"),
    include_str!("assets/page.js"),
];
const UPLOT: &str = include_str!("vendor/uplot-1.6.32/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("vendor/uplot-1.6.32/uPlot.min.css");
const UPLOT_LICENSE: &str = include_str!("vendor/uplot-1.6.32/LICENSE");

/// A whole page.
pub(super) struct Document<'a> {
    /// The command.
    pub(super) kicker: &'a str,
    /// The name of the program or the cell.
    pub(super) title: &'a str,
    /// The line below it, which names the cell.
    pub(super) subtitle: &'a str,
    /// HTML between the heading and the footer.
    pub(super) body: &'a str,
    /// The data that the scripts draw.
    pub(super) data: &'a Value,
    /// The files from which the page was made.
    pub(super) origins: &'a [&'a Origin],
}

impl Document<'_> {
    pub(super) fn html(&self) -> String {
        self.html_with(&SCRIPTS.concat())
    }

    /// The same with scripts in addition.
    pub(super) fn html_with(&self, scripts: &str) -> String {
        let (kicker, title, subtitle) = (escape(self.kicker), escape(self.title), escape(self.subtitle));
        // A `<` in the data would end the element that contains them.
        let data = shown(self.data).to_string().replace('<', "\\u003c");
        let (version, licence, body) = (VERSION, escape(UPLOT_LICENSE), self.body);
        let made_from = made_from(self.origins);
        let charts = format!("\n{UPLOT}\n");
        let own = format!("\n\"use strict\";\n(() => {{\n{scripts}}})();\n");
        // Only these scripts run, even if the text of a program or a file name contains another one.
        let allowed =
            [&charts, &own].map(|script| format!("'sha256-{}'", BASE64.encode(Sha256::digest(script)))).join(" ");
        format!(
            r#"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; script-src {allowed}; img-src data:">
<meta name="color-scheme" content="light dark">
<meta name="generator" content="deflex {version}">
<link rel="icon" href="data:,">
<title>{title} · {kicker}</title>
<style>
{UPLOT_STYLE}
{STYLE}</style>
</head>
<body>
<header>
<p class="kicker">deflex {kicker}</p>
<h1>{title}</h1>
<p class="subtitle">{subtitle}</p>
</header>
<main>
<noscript><p class="note">The tables of this page are complete; its pictures need JavaScript.</p></noscript>
{body}</main>
<footer>
<p>Made by deflex {version}. This page is complete in itself and loads nothing.</p>
{made_from}
<details><summary>Licence of the charts: uPlot 1.6.32</summary><pre>{licence}</pre></details>
</footer>
<script type="application/json" id="data">{data}</script>
<script>{charts}</script>
<script>{own}</script>
</body>
</html>
"#
        )
    }
}

/// Files with their hashes.
fn made_from(origins: &[&Origin]) -> String {
    if origins.is_empty() {
        return String::new();
    }
    let line = |origin: &&Origin| format!("<li>{} <code>{}</code></li>\n", escape(&origin.path), origin.sha256);
    let lines: String = origins.iter().map(line).collect();
    format!("<details id=\"origins\"><summary>Made from these files (SHA-256)</summary><ul>\n{lines}</ul></details>\n")
}

/// The data, with characters that are not printable replaced in every text.
fn shown(data: &Value) -> Value {
    match data {
        Value::String(text) => printable(text).into(),
        Value::Array(all) => all.iter().map(shown).collect(),
        Value::Object(all) => all.iter().map(|(key, value)| (key.clone(), shown(value))).collect(),
        other => other.clone(),
    }
}

/// Text as HTML or XML, with characters that are not printable replaced.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in printable(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

/// One figure in large type, with its caption.
pub(super) struct Tile {
    pub(super) key: &'static str,
    pub(super) value: String,
    pub(super) unit: &'static str,
    pub(super) label: &'static str,
    /// A second figure in small type.
    pub(super) aside: String,
}

pub(super) fn tiles(tiles: &[Tile]) -> String {
    let mut out = String::from("<section class=\"tiles\">\n");
    for Tile { key, value, unit, label, aside } in tiles {
        let (value, aside) = (escape(value), escape(aside));
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<div class=\"tile\"><p class=\"label\">{label}</p><p class=\"figure\"><span data-key=\"{key}\">{value}</span> <span class=\"unit\">{unit}</span></p><p class=\"aside\">{aside}</p></div>"
        );
    }
    out + "</section>\n"
}

/// A table. Cells are HTML; the columns that are marked hold numbers.
pub(super) struct Table {
    id: &'static str,
    head: Vec<(&'static str, bool)>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Columns: heading, whether it holds numbers.
    pub(super) fn new(id: &'static str, head: &[(&'static str, bool)]) -> Self {
        Self { id, head: head.to_vec(), rows: Vec::new() }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    pub(super) fn html(&self) -> String {
        let class = |number: bool| if number { " class=\"number\"" } else { "" };
        let mut out = format!("<div class=\"scroll\" tabindex=\"0\"><table id=\"{}\"><thead><tr>", self.id);
        for (heading, number) in &self.head {
            // Writing to a String cannot fail.
            let _ = write!(out, "<th{}>{heading}</th>", class(*number));
        }
        out.push_str("</tr></thead><tbody>\n");
        for row in &self.rows {
            out.push_str("<tr>");
            for (cell, (_, number)) in row.iter().zip(&self.head) {
                let _ = write!(out, "<td{}>{cell}</td>", class(*number));
            }
            out.push_str("</tr>\n");
        }
        out + "</tbody></table></div>\n"
    }
}

pub(super) fn section(id: &str, heading: &str, body: impl Display) -> String {
    format!("<section id=\"{id}\">\n<h2>{heading}</h2>\n{body}</section>\n")
}

/// Says how many more pairs there are than a table of pairs shows.
pub(super) fn further_pairs(more: usize) -> String {
    match more {
        0 => String::new(),
        more => {
            format!("<p class=\"note\">… and {more} more, further apart: <code>--json</code> has all of them.</p>\n")
        }
    }
}

/// A section with a list of texts; nothing without texts.
pub(super) fn list(id: &str, heading: &str, texts: &[String]) -> String {
    if texts.is_empty() {
        return String::new();
    }
    let items: String = texts.iter().map(|text| format!("<li>{}</li>\n", escape(text))).collect();
    section(id, heading, format!("<ul>\n{items}</ul>\n"))
}

/// A number, followed by a bar whose length is a share of the largest one.
pub(super) fn bar(text: &str, share: f64) -> String {
    let percent = 100.0 * share.clamp(0.0, 1.0);
    format!("{text}<span class=\"bar\"><span style=\"width:{percent:.1}%\"></span></span>")
}

/// Millimetres with four decimals, as in programs, and no negative zero.
pub(super) fn mm(value: f64) -> String {
    fixed(value, 4)
}

/// The places of a page's 3-D view, its target panel and its charts: the scripts fill them.
pub(super) const STAGE: &str = r#"<section class="stage" id="stage">
<div class="view">
<div class="toolbar" role="toolbar" aria-label="View">
<span class="buttons"><label>Colour <select id="colour"></select></label> <label><input type="checkbox" id="zero"> from 0</label> <label hidden><input type="checkbox" id="held"> hold the part still</label></span>
<span class="buttons"><button type="button" data-view="iso">3-D</button><button type="button" data-view="top">Top</button><button type="button" data-view="front">Front</button><button type="button" data-view="side">Side</button><button type="button" data-view="fit">Fit</button><button type="button" data-view="arm">Arm</button></span>
</div>
<canvas id="path" tabindex="0" role="application" aria-label="Toolpath in 3-D. Arrow keys turn, shift and arrow keys move, plus and minus zoom, comma and full stop step through the targets."></canvas>
<div class="legend"><span id="low"></span><span id="ramp"></span><span id="high"></span><span id="what"></span></div>
<div class="player" id="player" role="group" aria-label="Play along the program" hidden>
<button type="button" id="play">Play</button>
<input type="range" id="along" min="0" value="0" aria-label="Place along the program">
<label>Whole program in <select id="pace"><option value="10">10 s</option><option value="30" selected>30 s</option><option value="120">2 min</option><option value="600">10 min</option></select></label>
</div>
<p class="hint">Drag turns, shift-drag moves, wheel zooms, click selects. Keys: arrows turn, + − zoom, <kbd>,</kbd> <kbd>.</kbd> step through targets, <kbd>0</kbd> fits.</p>
<div id="tip" role="status" hidden></div>
</div>
<aside class="panel" aria-live="polite">
<h2 id="chosen">Target</h2>
<div id="figures"></div>
</aside>
</section>
<p class="note" id="detail"></p>
<section id="charts">
<div id="plots"></div>
<p class="hint">Drag in a chart to zoom in, double-click to zoom out, click to select the target.</p>
</section>
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_a_name_or_the_data_is_markup() {
        let data = serde_json::json!({ "name": "</script><b>", "names": ["\u{202e}\x1b\u{9b}"] });
        let page = Document {
            kicker: "diff",
            title: "<i>\"&\u{202e}\u{9b}\x1b",
            subtitle: "",
            body: "",
            data: &data,
            origins: &[],
        }
        .html();
        assert!(!page.contains(['\u{202e}', '\u{9b}', '\x1b']) && !page.contains("\\u001b"));
        assert!(
            page.contains("<h1>&lt;i&gt;&quot;&amp;\u{fffd}\u{fffd}\u{241b}</h1>")
                && page.contains("\\u003c/script>\\u003cb>")
        );
    }
}
