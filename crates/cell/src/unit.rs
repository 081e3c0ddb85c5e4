//! Reads `[[unit]]`: mechanical units in addition to the robot.

use super::check::{Check, Turn};
use super::{nearest, raw};
use deflex_robot::{AxisName, Carries, EXTERNAL_AXES, Unit, UnitKind, Units};
use nalgebra::Vector3;

/// Largest number of units whose positions deflex chooses together: the number of candidates is the product of the
/// positions of each.
#[doc(hidden)]
pub const MOST_FREE: usize = 2;

/// The value of `carries` for a unit that carries neither the robot nor the part.
const NOTHING: &str = "nothing";

pub(super) fn units(check: &mut Check, raw: &[raw::Unit]) -> Units {
    let mut seen: Vec<(&str, Option<AxisName>)> = Vec::with_capacity(raw.len());
    for (i, keys) in raw.iter().enumerate() {
        let key = format!("unit.{i}");
        let named = axis(check, &key, keys);
        let common = |other: Option<AxisName>| {
            other.zip(named).is_some_and(|(other, own)| other.covers(own) || own.covers(other))
        };
        if let Some((same, _)) = seen.iter().find(|(other, _)| other.eq_ignore_ascii_case(&keys.name)) {
            let message =
                format!("unit `{same}` is declared twice: names that differ in upper and lower case only are the same");
            check.error(&key, message, "remove one of them, or give each axis of the unit a name of its own");
        } else if let Some((same, _)) = seen.iter().find(|(_, other)| common(*other)) {
            let message = format!("units `{same}` and `{}` are both moved by {}", keys.name, keys.axis);
            check.error(&key, message, "each unit has an external axis of its own");
        }
        seen.push((&keys.name, named));
    }
    let carries_nothing = |i: &usize| raw[*i].carries == NOTHING;
    let idle = (0..raw.len()).filter(carries_nothing).filter_map(|i| seen[i].1).collect();
    let carrying: Vec<usize> = (0..raw.len()).filter(|i| !carries_nothing(i)).collect();
    let named = |i: &usize| seen[*i].1.unwrap_or(AxisName::External(0));
    let places = places(check, raw, &carrying.iter().map(|i| (*i, named(i))).collect::<Vec<_>>());
    let among: Vec<&raw::Unit> = carrying.iter().map(|i| &raw[*i]).collect();
    let read = |(i, axis): (&usize, usize)| {
        let place = AxisSlot { named: named(i), axis };
        // A refused unit is replaced by a plain one, because other units may stand on it.
        unit(check, &format!("unit.{i}"), (&raw[*i], place), &among).unwrap_or_else(|| Unit {
            name: raw[*i].name.clone(),
            named: place.named,
            axis,
            kind: UnitKind::Rotary,
            carries: Carries::Part,
            frame: deflex_robot::Pose::identity(),
            on: None,
            min: f64::NEG_INFINITY,
            max: f64::INFINITY,
            max_speed: None,
            free: false,
        })
    };
    let all: Vec<Unit> = carrying.iter().zip(places).map(read).collect();
    let mut free = all.iter().enumerate().filter(|(_, unit)| unit.free);
    if let Some((at, unit)) = free.nth(MOST_FREE) {
        let message = format!(
            "unit `{}` is free, in addition to {MOST_FREE} others: deflex chooses at most {MOST_FREE} positions together",
            unit.name
        );
        let help = "keep `free` for the units whose position matters least to the toolpath";
        check.error(&format!("unit.{}.free", carrying[at]), message, help);
    }
    let units = Units::new(all).unwrap_or_else(|(at, message)| {
        let help = "`on` names the unit below; one chain of units carries the robot";
        check.error(&format!("unit.{}", carrying[at]), message, help);
        Units::default()
    });
    units.and_idle(idle)
}

/// An axis as programs name it, and the index of its position in an [`External`](deflex_robot::External).
#[derive(Clone, Copy)]
struct AxisSlot {
    named: AxisName,
    axis: usize,
}

/// Indices of the units' positions. External axes have their own index; motion groups get the indices that are left.
fn places(check: &mut Check, raw: &[raw::Unit], named: &[(usize, AxisName)]) -> Vec<usize> {
    let own = |axis: AxisName| match axis {
        AxisName::External(index) => Some(index),
        _ => None,
    };
    let mut left = (0..EXTERNAL_AXES).filter(|index| named.iter().all(|(_, axis)| own(*axis) != Some(*index)));
    let place = |(i, axis): &(usize, AxisName)| {
        own(*axis).or_else(|| left.next()).unwrap_or_else(|| {
            let message = format!(
                "at most {EXTERNAL_AXES} units can carry something, and unit `{}` is one too many",
                raw[*i].name
            );
            check.error(&format!("unit.{i}"), message, "leave out those that carry neither the robot nor the part");
            0
        })
    };
    named.iter().map(place).collect()
}

/// The axis of a unit, as programs name it.
fn axis(check: &mut Check, key: &str, keys: &raw::Unit) -> Option<AxisName> {
    let named = AxisName::read(&keys.axis);
    if named.is_none() {
        let message = format!("{key}.axis = \"{}\" is not known", keys.axis);
        let help = "expected eax_a … eax_f (E1 … E6), or an axis of a FANUC motion group: gp2_j1, gp2_e1";
        check.error(&format!("{key}.axis"), message, help);
    }
    if matches!(named, Some(AxisName::Group(_))) && keys.carries != NOTHING {
        let message = format!("unit `{}` is a whole motion group, and carries something", keys.name);
        let help = "declare each axis of the group: axis = \"gp2_j1\", and axis = \"gp2_j2\" with `on`";
        check.error(&format!("{key}.axis"), message, help);
    }
    if named.is_some_and(|named| named.group().is_some()) && keys.free {
        let message = format!("unit `{}` is of a FANUC motion group, whose positions are not chosen", keys.name);
        check.error(&format!("{key}.free"), message, "remove `free`");
    }
    named
}

fn unit(check: &mut Check, key: &str, (keys, place): (&raw::Unit, AxisSlot), all: &[&raw::Unit]) -> Option<Unit> {
    let carries = [("robot", Some(Carries::Robot)), ("part", Some(Carries::Part)), (NOTHING, None)];
    let carries = check.word(&format!("{key}.carries"), &keys.carries, &carries).flatten();
    if place.named.group().is_some() && carries == Some(Carries::Robot) {
        // A motion group that carries the robot would also move the robot's user frames, which no other frame of a cell
        // does.
        let message = format!("unit `{}` is a motion group of its own, and carries the robot", keys.name);
        let help = "a track that the controller counts to the robot is an extended axis of it: axis = \"eax_a\" (E1)";
        check.error(&format!("{key}.carries"), message, help);
    }
    let kind = check.need(key, "kind", keys.kind.as_deref(), "how it moves, linear or rotary")?;
    let linear = check.word(&format!("{key}.kind"), kind, &[("linear", true), ("rotary", false)]);
    let kind = match (linear?, keys.direction) {
        (true, Some(direction)) => {
            check.finite(&format!("{key}.direction"), &direction);
            let unit = Vector3::from(direction).try_normalize(f64::MIN_POSITIVE);
            if unit.is_none() {
                check.error(
                    &format!("{key}.direction"),
                    "the direction has a length of zero",
                    "for example [0.0, 1.0, 0.0]",
                );
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
            check.error(&format!("{key}.direction"), "a rotary unit has no direction", help);
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
        named: place.named,
        axis: place.axis,
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
