//! The page of `plan`.

use super::markup::{Document, STAGE, Table, Tile, bar, escape, fixed, further_pairs, list, section, tiles};
use super::scene;
use super::trace::{Channels, MOST_STRETCHES, Sample, Trace};
use crate::Origin;
use deflex_cell::Cell;
use deflex_identify::Plan;
use nalgebra::Vector3;
use serde_json::{Value, json};

/// What the picture of a plan shows of each row: the place, the load, and the posture of the arm.
const CHANNELS: Channels = &[
    (4, &["x_mm", "y_mm", "z_mm"]),
    (0, &["time_s"]),
    (1, &["load_n"]),
    (
        3,
        &[
            "axis_1_deg", "axis_2_deg", "axis_3_deg", "axis_4_deg", "axis_5_deg", "axis_6_deg", "base_x_mm",
            "base_y_mm", "base_z_mm",
        ],
    ),
    (6, &["base_rx_deg", "base_ry_deg", "base_rz_deg"]),
];

/// The arm of a cell, ready to be drawn.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct DrawnArm(Value);

impl DrawnArm {
    /// The arm of a cell.
    #[must_use]
    pub fn of(cell: &Cell) -> Self {
        Self(scene::scene(cell))
    }
}

/// The page of a plan called `name`, made for a cell with this arm.
#[must_use]
#[doc(hidden)]
pub fn plan_page(plan: &Plan, name: &str, cell: &Origin, DrawnArm(scene): &DrawnArm) -> String {
    let percent = |share: f64| fixed(100.0 * share, 0);
    let weakest = plan.weakest.as_ref();
    let mut body = tiles(&[
        Tile {
            key: "chance_right",
            value: percent(plan.chance_right),
            unit: "%",
            label: "Named rightly",
            aside: format!("of {} simulated effects; wrongly {} %", plan.simulated, percent(plan.chance_wrong)),
        },
        Tile {
            key: "weakest",
            value: fixed(weakest.map_or(0.0, |pair| pair.d_prime), 1),
            unit: "d′",
            label: "Weakest pair",
            aside: weakest.map_or_else(String::new, |pair| format!("{} from {}", pair.a, pair.b)),
        },
        Tile {
            key: "rows",
            value: plan.rows.len().to_string(),
            unit: "rows",
            label: "To measure",
            aside: format!("{} changes of the load", plan.load_changes),
        },
        Tile {
            key: "minutes",
            value: fixed((plan.duration_s / 60.0).ceil(), 0),
            unit: "min",
            label: "Time",
            aside: "ten seconds a row, two minutes a change of the load".to_owned(),
        },
    ]);
    body += STAGE;
    body += &format!(
        "<div class=\"pair\">\n<div>{}</div>\n<div>{}</div>\n</div>\n",
        section("kinds", "Each effect alone", kinds(plan)),
        section("pairs", "Pairs, hardest to distinguish first", pairs(plan))
    );
    body += &section("rows", "The rows", rows(plan));
    body += &section("words", "What the figures are", WORDS);
    body += &list("notes", "Notes", &plan.notes);
    let mut path = postures(plan).json();
    path["title"] = json!(name);
    let data = json!({ "kind": "plan", "paths": [path], "scene": scene });
    let subtitle = format!("what to measure on cell {}", cell.path);
    Document { kicker: "plan", title: name, subtitle: &subtitle, body: &body, data: &data, origins: &[cell] }.html()
}

/// The rows in their order, with the posture of the arm at each.
fn postures(plan: &Plan) -> Trace {
    let mut trace = Trace::new(&[CHANNELS], MOST_STRETCHES);
    for row in &plan.rows {
        let load = Vector3::from(row.load_n).norm();
        let values =
            row.position_mm.into_iter().chain([row.time_s, load]).chain(row.axes_deg).chain(plan.wobj_from_base);
        trace.push(Sample {
            target: row.target,
            line: row.target,
            name: None,
            names: None,
            status: if row.held_out { "held out" } else { "ok" },
            values: values.collect(),
            peaks: [load, row.time_s],
        });
    }
    trace
}

fn kinds(plan: &Plan) -> String {
    let mut table = Table::new("chances", &[("effect", false), ("d′ from none", true), ("named rightly", true)]);
    for kind in &plan.kinds {
        table.row([
            format!("<code>{}</code>", escape(&kind.kind)),
            fixed(kind.d_prime, 1),
            bar(&format!("{} %", fixed(100.0 * kind.chance_right, 0)), kind.chance_right),
        ]);
    }
    table.html()
}

fn pairs(plan: &Plan) -> String {
    /// How many pairs are shown; the others are easier to distinguish.
    const SHOWN: usize = 10;
    let mut table = Table::new("separations", &[("effect", false), ("taken for", false), ("d′", true), ("why", false)]);
    for pair in plan.pairs.iter().take(SHOWN) {
        table.row([
            format!("<code>{}</code>", escape(&pair.a)),
            format!("<code>{}</code>", escape(&pair.b)),
            fixed(pair.d_prime, 1),
            escape(pair.why.unwrap_or_default()),
        ]);
    }
    table.html() + &further_pairs(plan.pairs.len().saturating_sub(SHOWN))
}

fn rows(plan: &Plan) -> String {
    let numbers =
        ["target", "x mm", "y mm", "z mm", "fx N", "fy N", "fz N", "time s", "q1°", "q2°", "q3°", "q4°", "q5°", "q6°"];
    let head: Vec<(&'static str, bool)> = numbers.into_iter().map(|name| (name, true)).collect();
    let mut table = Table::new("places", &head);
    for row in &plan.rows {
        let place = row.position_mm.iter().map(|v| fixed(*v, 1));
        let load = row.load_n.iter().map(|v| fixed(*v, 1));
        let axes = row.axes_deg.iter().map(|v| fixed(*v, 1));
        let first = std::iter::once(row.target.to_string());
        table.row(first.chain(place).chain(load).chain([fixed(row.time_s, 0)]).chain(axes));
    }
    table.html()
}

const WORDS: &str = "<dl>
<dt>d′</dt><dd>What is left of an effect of the wanted size, less all that the other one, the part's frame, the instrument and its drift could imitate, over the noise. Above 5 the two can be distinguished, below 3 they cannot.</dd>
<dt>Named rightly</dt><dd>The expected probability that the effect alone is named outright, from a dozen simulated measurements of these rows, with white noise and nothing else there; drift, outliers and second effects make it less.</dd>
</dl>
";
