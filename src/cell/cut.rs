//! `[cut]`: from typed keys to a force.

use super::check::Check;
use super::{Cut, CutForce, ForceFrame, raw};
use crate::cutting::{Coefficients, Cutter, Engagement, Milling, Mode, materials};

pub(super) fn cut(check: &mut Check, raw: &raw::Cut) -> Option<Cut> {
    let force =
        match check.word("cut.force", &raw.force, &[("none", 0), ("constant", 1), ("table", 2), ("mechanistic", 3)])? {
            0 => CutForce::None,
            1 => {
                let force = check.need("cut", "force_n", raw.force_n, "force = \"constant\" needs the force")?;
                check.finite("cut.force_n", &force);
                let frame = check.need(
                    "cut",
                    "frame",
                    raw.frame.as_deref(),
                    "force = \"constant\" needs the axes it is given in",
                )?;
                let frames = [("wobj", ForceFrame::Wobj), ("tool", ForceFrame::Tool), ("feed", ForceFrame::Feed)];
                CutForce::Constant { force: force.into(), frame: check.word("cut.frame", frame, &frames)? }
            }
            2 => CutForce::Table,
            _ => mechanistic(check, raw)?,
        };
    if let Some(feed) = raw.max_cutting_feed_mm_s {
        check.positive("cut.max_cutting_feed_mm_s", &[feed]);
    }
    Some(Cut { force, max_cutting_feed: raw.max_cutting_feed_mm_s.map(|feed| 1e-3 * feed) })
}

fn mechanistic(check: &mut Check, raw: &raw::Cut) -> Option<CutForce> {
    let why = "force = \"mechanistic\" needs it";
    let keys = check.need("cut", "cutter", raw.cutter.as_ref(), why);
    let engaged = check.need("cut", "engagement", raw.engagement.as_ref(), why);
    let coefficients = coefficients(check, raw);
    let (keys, engaged, coefficients) = (keys?, engaged?, coefficients?);
    let cutter = Cutter {
        diameter: 1e-3 * keys.diameter_mm,
        corner_radius: 1e-3 * keys.corner_radius_mm,
        teeth: keys.teeth,
        helix: keys.helix_deg.unwrap_or(0.0).to_radians(),
    };
    let modes = [("slot", Mode::Slot), ("up", Mode::Up), ("down", Mode::Down)];
    let mode = check.word("cut.engagement.mode", &engaged.mode, &modes)?;
    let width_mm = match (mode, engaged.width_mm) {
        (Mode::Slot, width) => width.unwrap_or(keys.diameter_mm),
        (_, width) => check.need("cut.engagement", "width_mm", width, "up and down milling need the radial width")?,
    };
    let feed_from_program = engaged.feed_per_tooth_mm.is_none();
    if let Some(rpm) = engaged.spindle_rpm {
        check.positive("cut.engagement.spindle_rpm", &[rpm]);
    }
    let engagement = Engagement {
        mode,
        depth: 1e-3 * engaged.depth_mm,
        width: 1e-3 * width_mm,
        // Any positive value: replaced per target where the program gives the feed.
        feed_per_tooth: 1e-3 * engaged.feed_per_tooth_mm.unwrap_or(0.1),
        lead: engaged.lead_deg.to_radians(),
        tilt: engaged.tilt_deg.to_radians(),
    };
    if let Err(error) = Milling::new(cutter, engagement, coefficients) {
        check.error(
            "cut",
            format!("[cut] {}: {}", error.field, error.message),
            "check [cut.cutter], [cut.engagement] and [cut.coefficients]",
        );
    }
    Some(CutForce::Mechanistic {
        cutter,
        engagement,
        feed_from_program,
        spindle_rpm: engaged.spindle_rpm,
        coefficients,
    })
}

fn coefficients(check: &mut Check, raw: &raw::Cut) -> Option<Coefficients> {
    let keys = raw.coefficients.as_ref();
    let material = raw.material.as_deref().or_else(|| keys.and_then(|k| k.material.as_deref()));
    let own = keys.is_some_and(|k| {
        [k.ktc_n_mm2, k.krc_n_mm2, k.kac_n_mm2, k.kte_n_mm, k.kre_n_mm, k.kae_n_mm].iter().any(Option::is_some)
    });
    match (material, keys) {
        (Some(_), _) if own => {
            check.error("cut.coefficients", "both a material and coefficients are given", "keep one of them");
            None
        }
        (Some(name), _) => {
            let known: Vec<(&str, usize)> = materials::MATERIALS.iter().enumerate().map(|(i, m)| (m.name, i)).collect();
            check.word("cut.coefficients.material", name, &known).map(|i| materials::MATERIALS[i].coefficients)
        }
        (None, Some(keys)) => {
            let mut get = |key: &str, value: Option<f64>, to_si: f64| {
                let value = check.need("cut.coefficients", key, value, "all six coefficients are needed")?;
                check.finite(&format!("cut.coefficients.{key}"), &[value]);
                Some(value * to_si)
            };
            let (area, edge) = (1e6, 1e3);
            Some(Coefficients {
                ktc: get("ktc_n_mm2", keys.ktc_n_mm2, area)?,
                krc: get("krc_n_mm2", keys.krc_n_mm2, area)?,
                kac: get("kac_n_mm2", keys.kac_n_mm2, area)?,
                kte: get("kte_n_mm", keys.kte_n_mm, edge)?,
                kre: get("kre_n_mm", keys.kre_n_mm, edge)?,
                kae: get("kae_n_mm", keys.kae_n_mm, edge)?,
            })
        }
        (None, None) => {
            check.error(
                "cut",
                "[cut.coefficients] is missing: force = \"mechanistic\" needs it",
                "give the six coefficients, or material = \"al7075\"",
            );
            None
        }
    }
}
