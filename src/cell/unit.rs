//! `[[unit]]`: mechanical units besides the robot.

use super::check::{Check, Turn};
use super::{nearest, raw};
use crate::robot::{Carries, EXTERNAL_AXES, Unit, UnitKind, Units};
use nalgebra::Vector3;

/// External axes as RAPID names them.
pub(crate) const AXES: [&str; EXTERNAL_AXES] = ["eax_a", "eax_b", "eax_c", "eax_d", "eax_e", "eax_f"];

/// Units whose positions can be chosen together: the grid of their positions is as large as the product of both.
pub(crate) const MOST_FREE: usize = 2;

pub(super) fn units(check: &mut Check, raw: &[raw::Unit]) -> Units {
    let mut all: Vec<Unit> = Vec::with_capacity(raw.len());
    for (i, keys) in raw.iter().enumerate() {
        let key = format!("unit.{i}");
        let read = unit(check, &key, keys, raw);
        if let Some(same) = all.iter().find(|other| other.name.eq_ignore_ascii_case(&keys.name)) {
            let message = format!("unit `{}` is declared twice: RAPID does not tell case apart", same.name);
            check.error(&key, message, "remove one of them, or name the axes of one unit apart");
        } else if let Some(same) = read.as_ref().and_then(|read| all.iter().find(|other| other.axis == read.axis)) {
            let message = format!("units `{}` and `{}` are both moved by {}", same.name, keys.name, keys.axis);
            check.error(&key, message, "each unit has an external axis of its own");
        }
        // What was refused stands in for itself: others may stand on it.
        all.push(read.unwrap_or_else(|| Unit {
            name: keys.name.clone(),
            axis: 0,
            kind: UnitKind::Rotary,
            carries: Carries::Part,
            frame: crate::robot::Pose::identity(),
            on: None,
            min: f64::NEG_INFINITY,
            max: f64::INFINITY,
            max_speed: None,
            free: false,
        }));
    }
    let mut free = all.iter().enumerate().filter(|(_, unit)| unit.free);
    if let Some((i, unit)) = free.nth(MOST_FREE) {
        let message = format!("unit `{}` is free besides {MOST_FREE} others: so many are chosen together", unit.name);
        check.error(&format!("unit.{i}.free"), message, "leave `free` to those that the tool path leaves most open");
    }
    Units::new(all).unwrap_or_else(|(i, message)| {
        let help = "`on` names the unit below; one chain of units carries the robot";
        check.error(&format!("unit.{i}"), message, help);
        Units::default()
    })
}

fn unit(check: &mut Check, key: &str, keys: &raw::Unit, all: &[raw::Unit]) -> Option<Unit> {
    let known: Vec<(&str, usize)> = AXES.iter().enumerate().map(|(i, name)| (*name, i)).collect();
    let axis = check.word(&format!("{key}.axis"), &keys.axis, &known);
    let carries = [("robot", Carries::Robot), ("part", Carries::Part)];
    let carries = check.word(&format!("{key}.carries"), &keys.carries, &carries);
    let linear = check.word(&format!("{key}.kind"), &keys.kind, &[("linear", true), ("rotary", false)]);
    let kind = match (linear?, keys.direction) {
        (true, Some(direction)) => {
            check.finite(&format!("{key}.direction"), &direction);
            let unit = Vector3::from(direction).try_normalize(f64::MIN_POSITIVE);
            if unit.is_none() {
                check.error(&format!("{key}.direction"), "a direction of no length", "for example [0.0, 1.0, 0.0]");
            }
            UnitKind::Linear(unit?)
        }
        (true, None) => {
            check.error(
                key,
                format!("unit `{}` is linear and has no `direction`", keys.name),
                "add direction = [x, y, z]",
            );
            return None;
        }
        (false, None) => UnitKind::Rotary,
        (false, Some(_)) => {
            let help = "a rotary unit turns about z of its own frame: set base_quat, and remove `direction`";
            check.error(&format!("{key}.direction"), "a direction is of linear units", help);
            return None;
        }
    };
    let (min, max) = (keys.min.unwrap_or(f64::NEG_INFINITY), keys.max.unwrap_or(f64::INFINITY));
    if min.is_nan() || max.is_nan() || min >= max {
        let message = format!("unit `{}`: limits {min} to {max} leave no room", keys.name);
        check.error(
            &format!("{key}.min"),
            message,
            "`min` must lie below `max`: mm of linear units, degrees of rotary ones",
        );
    }
    if keys.free && !(min.is_finite() && max.is_finite()) {
        let message = format!("unit `{}` is free and has no limits", keys.name);
        check.error(&format!("{key}.free"), message, "add `min` and `max`: its positions are chosen between them");
    }
    if let Some(speed) = keys.max_speed {
        check.positive(&format!("{key}.max_speed"), &[speed]);
    }
    let on = match &keys.on {
        None => None,
        Some(on) => {
            let found = all.iter().position(|other| other.name.eq_ignore_ascii_case(on));
            if found.is_none() {
                let near = nearest(on, all.iter().map(|unit| unit.name.as_str()));
                let help = near.map_or("declare it with [[unit]]".to_owned(), |near| format!("did you mean `{near}`?"));
                check.error(&format!("{key}.on"), format!("unit `{on}` is not declared"), help);
            }
            found
        }
    };
    let turn = Turn { quat: keys.base_quat, abc_deg: keys.base_abc_deg, wpr_deg: keys.base_wpr_deg };
    let base_quat = check.turn(key, "base", turn).unwrap_or([1.0, 0.0, 0.0, 0.0]);
    let base_mm = keys.base_mm.unwrap_or_default();
    let frame = check.frame(key, ["base_mm", "base_quat"], base_mm, base_quat);
    Some(Unit {
        name: keys.name.clone(),
        axis: axis?,
        kind,
        carries: carries?,
        frame,
        on,
        min,
        max,
        max_speed: keys.max_speed,
        free: keys.free,
    })
}
