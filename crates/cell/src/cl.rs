//! Reads `[cl]`: what CL data do not say, and a run needs to know.

use super::check::Check;
use super::{Cl, Spin, SpinRule, nearest, raw};
use deflex_program::ExternalAxes;
use deflex_program::cl::{ClOptions, Point, Units, may_be_declared_harmless};
use deflex_program::post::{TEMPLATES, Templates};
use deflex_robot::AxisName;
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Reads `[cl]`. The corner radii, mm, are those of `[cut.cutter]` and of the tools' own cutters, by tool name in upper
/// case.
pub(super) fn cl(
    check: &mut Check,
    raw: &raw::Cl,
    corner_radius_mm: Option<f64>,
    corner_radii_mm: BTreeMap<String, f64>,
    mechanical: &deflex_robot::Units,
) -> Option<Cl> {
    let units = match &raw.units {
        Some(units) => Some(check.word("cl.units", units, &[("mm", Units::Millimetre), ("inch", Units::Inch)])?),
        None => None,
    };
    let point = check.word(
        "cl.point",
        raw.point.as_deref().unwrap_or("tip"),
        &[("tip", Point::Tip), ("centre", Point::Centre)],
    )?;
    let rule = match check.word("cl.spin", &raw.spin, &[("fixed", 0), ("feed", 1), ("towards", 2), ("stiffest", 3)])? {
        0 => SpinRule::Fixed,
        1 => SpinRule::Feed,
        3 => SpinRule::Stiffest,
        _ => {
            let point = check.need("cl", "towards_mm", raw.towards_mm, "spin = \"towards\" needs a point")?;
            SpinRule::Towards(Vector3::from(point) * 1e-3)
        }
    };
    let mut used = raw.tool.iter().chain(raw.tools.values());
    let unknown = used.find(|tool| !corner_radii_mm.contains_key(&tool.to_ascii_uppercase()));
    if let Some(tool) = unknown.filter(|_| point == Point::Centre && corner_radius_mm.is_none()) {
        let message = format!("point = \"centre\" needs the corner radius of `{tool}`");
        let help = format!("add [tools.{tool}.cutter] or [cut.cutter] with corner_radius_mm");
        check.error("cl.point", message, help);
    }
    let arc_tolerance_mm = raw.arc_tolerance_mm.unwrap_or(ClOptions::default().arc_tolerance_mm);
    check.positive("cl.arc_tolerance_mm", &[arc_tolerance_mm]);
    let turn = raw.spin_deg.unwrap_or(0.0);
    check.finite("cl.spin_deg", &[turn]);
    let singular_margin = raw.singular_margin_deg.map_or(Cl::SINGULAR_MARGIN, f64::to_radians);
    if !(0.0..FRAC_PI_2).contains(&singular_margin) {
        check.error(
            "cl.singular_margin_deg",
            "the margin from a singular wrist is an angle of axis 5 from 0 to 90°",
            "10 is usual",
        );
    }
    let tool = match (&raw.tool, raw.tools.is_empty()) {
        (Some(tool), _) => Some(tool.clone()),
        (None, false) => None,
        (None, true) => Some(check.need("cl", "tool", None, "it is the tool of every position")?),
    };
    let options = ClOptions {
        tool,
        tools: tools(check, &raw.tools),
        any_tool: false,
        harmless: harmless(check, &raw.harmless),
        wobj: raw.wobj.clone(),
        units,
        point,
        corner_radius_mm,
        corner_radii_mm,
        arc_tolerance_mm,
        external: external(check, &raw.external, mechanical),
    };
    Some(Cl {
        options,
        post: templates(check, &raw.post),
        spin: Spin { rule, turn: turn.to_radians() },
        singular_margin,
    })
}

/// Reads `[cl] external`: the positions of the mechanical units during the program.
fn external(check: &mut Check, raw: &BTreeMap<String, f64>, units: &deflex_robot::Units) -> Option<Arc<ExternalAxes>> {
    let mut axes = ExternalAxes::default();
    for (name, position) in raw {
        let key = format!("cl.external.{name}");
        let unit = AxisName::read(name).and_then(|axis| units.all().iter().find(|unit| unit.named == axis));
        let Some(unit) = unit else {
            let message = format!("`{name}` moves no unit of the cell");
            check.error(&key, message, "name the axis of a [[unit]] as it does, for example eax_a");
            continue;
        };
        check.finite(&key, &[*position]);
        if !(unit.min..=unit.max).contains(position) {
            let message =
                format!("unit `{}` cannot stand at {position}: its limits are {} to {}", unit.name, unit.min, unit.max);
            check.error(&key, message, "mm of linear units, degrees of rotary ones");
        }
        axes.put(unit.named, *position);
    }
    (!raw.is_empty()).then(|| axes.into())
}

/// Reads `[cl] tools`: tool names by their numbers in CL data. `2` and `2.` are the same number.
fn tools(check: &mut Check, raw: &BTreeMap<String, String>) -> BTreeMap<String, String> {
    for (id, tool) in raw.iter().filter(|(id, tool)| id.trim().is_empty() || tool.trim().is_empty()) {
        check.error("cl.tools", format!("`{id}` = `{tool}`: a tool has a number and a name"), "\"1\" = \"tRough\"");
    }
    raw.clone()
}

/// Reads `[cl] harmless`. Words that deflex interprets cannot be declared harmless.
fn harmless(check: &mut Check, raw: &[String]) -> BTreeSet<String> {
    for word in raw.iter().filter(|word| !may_be_declared_harmless(word)) {
        let message =
            format!("`{word}` moves the tool or changes how it cuts: it is read, and cannot be declared harmless");
        check.error("cl.harmless", message, "remove it from the list");
    }
    raw.iter().map(|word| word.to_ascii_uppercase()).collect()
}

/// Reads `[cl.post]`.
fn templates(check: &mut Check, raw: &BTreeMap<String, String>) -> Templates {
    let mut templates = Templates::default();
    for (key, text) in raw {
        let path = format!("cl.post.{key}");
        let Some((known, _)) = TEMPLATES.iter().find(|(known, _)| known == key) else {
            let names = || TEMPLATES.iter().map(|(name, _)| *name);
            let meant = nearest(key, names()).map_or(String::new(), |near| format!("did you mean `{near}`? "));
            let known = names().collect::<Vec<_>>().join(", ");
            check.error(&path, format!("unknown key `{key}` in [cl.post]"), format!("{meant}known: {known}"));
            continue;
        };
        match Templates::fault(known, text) {
            Some(fault) => check.error(&path, fault, "for example tool_change = \"rToolChange {number};\""),
            None => templates.insert(known, text.clone()),
        }
    }
    templates
}
