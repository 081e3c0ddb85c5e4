//! Reads `[plan]`: the places, loads and instrument with which a shop can measure.

use super::check::Check;
use super::raw;
use deflex_effects::KINDS;
use nalgebra::Vector3;

/// The `[plan]` table.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[doc(hidden)]
pub struct PlanSection {
    /// Work object whose frame is that of the box, the loads and the measured points.
    pub wobj: String,
    /// The tool with which is measured.
    pub tool: String,
    /// The box for the TCP: lower and upper corner in the frame of the work object, m.
    pub workspace: [Vector3<f64>; 2],
    /// Largest angle between the tool and the z axis of the work object, rad.
    pub tilt: f64,
    /// Forces that can be applied to the tool, in the frame of the work object, N.
    pub loads: Vec<Vector3<f64>>,
    /// Largest number of changes of the load.
    pub load_changes: usize,
    /// The quantity that is measured.
    pub instrument: Instrument,
    /// For [`Instrument::Distance`]: the point from which lengths are measured, in the frame of the work object, m.
    pub from: Option<Vector3<f64>>,
    /// Standard deviation per axis of the white noise of instrument and robot, mm.
    pub noise_mm: f64,
    /// Size of the effect that must be detected: root mean square at the TCP, mm.
    pub effect_mm: f64,
    /// Kinds of effects to distinguish; empty for all effects that the data could show.
    pub effects: Vec<&'static str>,
}

/// The quantity that an instrument measures for a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[doc(hidden)]
pub enum Instrument {
    /// The position of the TCP in the work object.
    Position,
    /// The error along the surface normal, which is the tool axis.
    Normal,
    /// The distance from a fixed point.
    Distance,
}

/// Reads `[plan]`. `tools` and `wobjs` are the declared names in upper case, without the work objects that a mechanical
/// unit carries.
pub(super) fn plan<'a>(
    check: &mut Check,
    raw: &raw::Plan,
    mut tools: impl Iterator<Item = &'a String>,
    mut wobjs: impl Iterator<Item = &'a String>,
) -> Option<PlanSection> {
    if !tools.any(|name| name.eq_ignore_ascii_case(&raw.tool)) {
        let message = format!("plan.tool = \"{}\": the cell declares no such tool with tcp_mm", raw.tool);
        check.error("plan.tool", message, format!("add [tools.{}] with tcp_mm and tcp_quat", raw.tool));
    }
    if !wobjs.any(|name| name.eq_ignore_ascii_case(&raw.wobj)) {
        let message = format!("plan.wobj = \"{}\": the cell declares no such work object that stands still", raw.wobj);
        check.error("plan.wobj", message, format!("add [wobjs.{}] with uframe_mm and uframe_quat", raw.wobj));
    }
    for corner in raw.box_mm {
        check.finite("plan.box_mm", &corner);
    }
    let workspace = raw.box_mm.map(|corner| Vector3::from(corner) * 1e-3);
    if (0..3).any(|k| workspace[1][k] < workspace[0][k]) {
        check.error(
            "plan.box_mm",
            "plan.box_mm is not a box: the second corner must not be below the first in x, y and z",
            "give [[xmin, ymin, zmin], [xmax, ymax, zmax]]",
        );
    }
    if !(0.0..=90.0).contains(&raw.tilt_deg) {
        check.error(
            "plan.tilt_deg",
            "plan.tilt_deg must lie between 0 and 90",
            "degrees from the work object's z axis",
        );
    }
    check.positive("plan.noise_mm", &[raw.noise_mm]);
    check.positive("plan.effect_mm", &[raw.effect_mm]);
    let loads_n = raw.loads_n.clone().unwrap_or_else(|| vec![[0.0; 3]]);
    for load in &loads_n {
        check.finite("plan.loads_n", load);
    }
    if loads_n.is_empty() {
        check.error("plan.loads_n", "plan.loads_n is empty", "without loads leave it out, or give [[0.0, 0.0, 0.0]]");
    }
    if loads_n.len() > 1 && raw.load_changes.is_none() {
        let why = "how often you are willing to change between the loads";
        check.need::<u32>("plan", "load_changes", None, why);
    }
    let words =
        [("position", Instrument::Position), ("normal", Instrument::Normal), ("distance", Instrument::Distance)];
    let instrument = check.word("plan.instrument", &raw.instrument, &words)?;
    let from = match instrument {
        Instrument::Distance => {
            Some(check.need("plan", "from_mm", raw.from_mm, "where lengths are measured from, work object axes")?)
        }
        _ => None,
    };
    let known: Vec<(&str, &'static str)> = KINDS.iter().map(|kind| (kind.name, kind.name)).collect();
    let effects = raw.effects.iter().filter_map(|name| check.word("plan.effects", name, &known)).collect();
    Some(PlanSection {
        wobj: raw.wobj.clone(),
        tool: raw.tool.clone(),
        workspace,
        tilt: raw.tilt_deg.to_radians(),
        loads: loads_n.into_iter().map(Vector3::from).collect(),
        load_changes: raw.load_changes.unwrap_or(0) as usize,
        instrument,
        from: from.map(|from| Vector3::from(from) * 1e-3),
        noise_mm: raw.noise_mm,
        effect_mm: raw.effect_mm,
        effects,
    })
}
