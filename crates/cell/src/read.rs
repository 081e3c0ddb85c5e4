//! Reads a cell file into a checked [`Cell`].

use super::check::{Check, Turn};
use super::cl::cl;
use super::cut::{cut, milling_parts};
use super::syntax::{in_words, parse};
use super::{Cell, Controller, ControllerPath, CorrectionLimits, nearest, plausible, raw, uncertainty};
use deflex_drive::PathLaw;
use deflex_effects::{Covered, Effect, MOST_CLAMPS, Need, ToolFrame};
use deflex_equilibrium::Arm;
use deflex_measured::ColumnNames;
use deflex_program::jbi::SpeedUnit;
use deflex_program::{ArcTurn, Language};
use deflex_robot::{Axes, Builtin, DhRow, Joints, Limits, Pose, Robot, Units};
use deflex_text::limits::{FRAMES, UNITS};
use deflex_text::{Diagnostic, Source, Span};
use nalgebra::{DMatrix, Vector3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Default largest correction, mm: the corrections of a plausible cell are smaller.
const MAX_CORRECTION_MM: f64 = 5.0;
/// Default largest step between the corrections of successive targets, mm.
const MAX_STEP_MM: f64 = 2.0;

/// Default largest error between targets that is not reported, mm: about the repeatability of a robot.
const MAX_PATH_ERROR_MM: f64 = 0.05;

impl Cell {
    /// Reads and checks a cell file.
    ///
    /// # Errors
    /// All errors of the file, each at its key. Messages about unknown keys and words name the most similar known one.
    pub fn read(source: &Source) -> Result<Self, Vec<Diagnostic>> {
        let text = match std::str::from_utf8(&source.bytes) {
            Ok(text) => text,
            Err(error) => {
                let at = error.valid_up_to();
                let end = (at + 1).min(source.bytes.len());
                let message = "the cell file is not UTF-8, which TOML requires";
                return Err(vec![
                    Diagnostic::error("cell.encoding", &source.name, message)
                        .at(source, Span::new(at, end))
                        .help("save the file as UTF-8"),
                ]);
            }
        };
        let (raw, errors) = parse(source, text)?;
        let mut check = Check::new(source, text);
        check.errors = errors;
        let counts =
            [("unit", UNITS, raw.unit.len()), ("tools", FRAMES, raw.tools.len()), ("wobjs", FRAMES, raw.wobjs.len())];
        for (section, bound, count) in counts {
            if let Some(over) = bound.exceeded(count as f64) {
                check.error(section, over, bound.help);
            }
        }
        if !check.errors.is_empty() && counts.iter().any(|(_, bound, count)| bound.exceeded(*count as f64).is_some()) {
            return Err(check.errors);
        }
        let robot = robot(&mut check, &raw.robot);
        let stiffness = raw.robot.stiffness.as_ref().map(|s| {
            check.positive("robot.stiffness.joint_nm_per_rad", &s.joint_nm_per_rad);
            Joints::from(s.joint_nm_per_rad)
        });
        let (mut tools, mut tool_milling) = (BTreeMap::new(), BTreeMap::new());
        for (name, tool) in &raw.tools {
            let key = format!("tools.{name}");
            tools.extend(self::tool(&mut check, &key, tool).map(|frame| (name.to_ascii_uppercase(), frame)));
            let parts = [tool.cutter.is_some(), tool.engagement.is_some(), tool.coefficients.is_some()];
            if parts.contains(&true) {
                let parts = milling_parts(
                    &mut check,
                    &key,
                    tool.cutter.as_ref(),
                    tool.engagement.as_ref(),
                    (None, tool.coefficients.as_ref()),
                );
                tool_milling.insert(name.to_ascii_uppercase(), parts);
            }
        }
        let units: Arc<Units> = super::unit::units(&mut check, &raw.unit).into();
        let (mut wobjs, mut wobj_units) = (BTreeMap::new(), BTreeMap::new());
        for (name, keys) in &raw.wobjs {
            let (frame, unit) = self::wobj(&mut check, name, keys, &units);
            wobjs.insert(name.to_ascii_uppercase(), frame);
            wobj_units.extend(unit.map(|unit| (name.to_ascii_uppercase(), unit)));
        }
        let named = raw.tools.keys().chain(raw.wobjs.keys());
        let spelled = named.map(|name| (name.to_ascii_uppercase(), name.clone())).collect();
        one_name(&mut check, "tools", raw.tools.keys());
        one_name(&mut check, "wobjs", raw.wobjs.keys());
        let limits = limits(&mut check, raw.limits.as_ref());
        let mut controller = controller(&mut check, raw.controller.as_ref());
        let cut = raw.cut.as_ref().and_then(|keys| cut(&mut check, keys, &tool_milling));
        let shared = raw.cut.as_ref().and_then(|cut| cut.cutter.as_ref()).map(|cutter| cutter.corner_radius_mm);
        let own = |(name, tool): (&String, &raw::Tool)| {
            Some((name.to_ascii_uppercase(), tool.cutter.as_ref()?.corner_radius_mm))
        };
        let own = raw.tools.iter().filter_map(own).collect();
        let cl = raw.cl.as_ref().and_then(|keys| cl(&mut check, keys, shared, own, &units));
        let stock = raw.stock.as_ref().and_then(|keys| super::stock::stock(&mut check, keys));
        let still = || wobjs.keys().filter(|name| !wobj_units.contains_key(*name));
        let plan = raw.plan.as_ref().and_then(|keys| super::plan::plan(&mut check, keys, tools.keys(), still()));
        let implied = Implied {
            axes: robot.as_ref().map(|robot| &robot.axes),
            springs: stiffness.is_some(),
            part: raw.part.as_ref().is_some_and(|part| part.material.is_some()),
            clamps: raw.part.as_ref().map_or(0, |part| part.clamp.len()),
        };
        let (effects, covariances, joint_factors) =
            effects(&mut check, (&raw.effect, &units), implied, &mut controller);
        let start = raw.robot.start_deg.map(|deg| {
            check.finite("robot.start_deg", &deg);
            robot.as_ref().map_or_else(Joints::zeros, |robot| robot.motor_from_axes_deg(&deg))
        });
        if let Some(violation) = robot.as_ref().zip(start).and_then(|(robot, start)| robot.limit_violation(&start)) {
            check.error("robot.start_deg", format!("robot.start_deg: {violation}"), "start within the axis limits");
        }
        let language = language(&raw);
        let columns = raw.measured.as_ref().and_then(|measured| columns(&mut check, &measured.columns));
        plausible::check(&mut check, &raw, robot.as_ref());
        let part = raw.part.map(|part| super::stock::part(&mut check, part, raw.stock.as_ref()));
        match robot {
            Some(robot) if check.errors.is_empty() => Ok(Self {
                arm: Arm { robot, stiffness, effects },
                covariances,
                joint_factors,
                start,
                tools,
                tool_milling,
                spelled,
                wobjs,
                wobj_units,
                limits,
                controller,
                cl,
                cut,
                notes: check.warnings,
                stock,
                language,
                columns,
                units,
                part,
                plan,
            }),
            _ => {
                check.errors.sort_by_key(|error| (error.line, error.column));
                Err(check.errors)
            }
        }
    }
}

/// Reads `[measured] columns`.
fn columns(check: &mut Check, names: &BTreeMap<String, String>) -> Option<ColumnNames> {
    match ColumnNames::of_cell(names) {
        Ok(columns) => (!names.is_empty()).then_some(columns),
        Err((name, help)) => {
            let message = format!("measured.columns: there is no column `{name}`");
            check.error(&format!("measured.columns.{name}"), message, help);
            None
        }
    }
}

/// The language of the controller, as far as the cell shows it: from the maker of the robot model, or from the way axis
/// 3 is counted and tools and work objects are named.
fn language(raw: &raw::Cell) -> Option<Language> {
    // The library of robots is read only if the cell takes its robot from it.
    let from_library = raw.robot.kinematics.is_none() || Builtin::is_listed(&raw.robot.model);
    if let Some(builtin) = from_library.then(|| Builtin::named(&raw.robot.model).ok()).flatten() {
        return builtin.language();
    }
    let names = || raw.tools.keys().chain(raw.wobjs.keys()).map(|name| name.to_ascii_uppercase());
    let begins = |with: [&str; 2]| names().any(|name| with.iter().any(|with| name.starts_with(with)));
    let coupled = raw.robot.kinematics.as_ref().is_some_and(|own| own.coupled_23);
    if coupled {
        return Some(Language::Ls);
    }
    Language::ALL.into_iter().find(|language| language.about().prefixes.is_some_and(begins))
}

fn robot(check: &mut Check, raw: &raw::Robot) -> Option<Robot> {
    let identity = [1.0, 0.0, 0.0, 0.0];
    let turn = Turn { quat: raw.base_quat, abc_deg: raw.base_abc_deg, wpr_deg: raw.base_wpr_deg };
    let base_quat = check.turn("robot", "base", turn).unwrap_or(identity);
    let base_mm = raw.base_mm.unwrap_or_default();
    let world_from_base = check.frame("robot", ["base_mm", "base_quat"], base_mm, base_quat);
    let Some(own) = &raw.kinematics else {
        return match Builtin::named(&raw.model) {
            Ok(builtin) => Some(builtin.robot().standing_at(world_from_base)),
            Err(near) => {
                let message = format!("robot.model = \"{}\" is not a built-in robot", raw.model);
                check.error("robot.model", message, Builtin::meant(&near));
                None
            }
        };
    };
    let key = "robot.kinematics";
    let why = "[robot.kinematics] replaces the built-in geometry as a whole";
    let links = check.need(key, "links", own.links.as_deref(), why);
    let links = links.and_then(|links| self::links(check, links));
    let axis_min_deg = check.need(key, "axis_min_deg", own.axis_min_deg, why);
    let axis_max_deg = check.need(key, "axis_max_deg", own.axis_max_deg, why);
    let (links, axis_min_deg, axis_max_deg) = (links?, axis_min_deg?, axis_max_deg?);
    for i in 0..6 {
        let (min, max) = (axis_min_deg[i], axis_max_deg[i]);
        if min.is_nan() || max.is_nan() || min >= max {
            check.error(
                &format!("{key}.axis_min_deg"),
                format!("axis {}: limits {min}° to {max}° leave no room", i + 1),
                "axis_min_deg must lie below axis_max_deg",
            );
        }
    }
    if !own.parallelogram && !own.coupled_23 && (own.elbow_min_deg.is_some() || own.elbow_max_deg.is_some()) {
        check.error(
            &format!("{key}.elbow_min_deg"),
            "elbow limits are those of an arm with parallelogram = true or coupled_23 = true; this one has neither",
            "remove them: axis 3 is the elbow",
        );
    }
    let elbow = match (own.elbow_min_deg, own.elbow_max_deg) {
        (Some(min), Some(max)) if min < max => Some((min.to_radians(), max.to_radians())),
        (None, None) => None,
        _ => {
            check.error(
                key,
                "elbow_min_deg and elbow_max_deg go together, the first below the second",
                "give both or none",
            );
            None
        }
    };
    let sign = own.axis_sign.unwrap_or(Axes::SERIAL.sign);
    if sign.iter().any(|sign| ![1.0, -1.0].contains(sign)) {
        check.error(
            &format!("{key}.axis_sign"),
            format!("{sign:?}: a sign is 1 or -1"),
            "1 where the axis turns as its link's z axis does, -1 where it turns the other way",
        );
    }
    let offset_deg = own.axis_offset_deg.unwrap_or_default();
    check.finite(&format!("{key}.axis_offset_deg"), &offset_deg);
    if own.parallelogram && own.coupled_23 {
        check.error(
            &format!("{key}.coupled_23"),
            "an arm has a parallelogram, or its controller counts axis 3 against the ground, not both",
            "parallelogram: motor 3 sits at axis 2; coupled_23: motor 3 sits on link 2 (FANUC)",
        );
    }
    let axes = Axes { sign, parallelogram: own.parallelogram, coupled_23: own.coupled_23 };
    let rows = std::array::from_fn(|i| {
        let [alpha_deg, a_mm, d_mm, theta_deg] = links[i];
        DhRow {
            alpha: alpha_deg.to_radians(),
            a: 1e-3 * a_mm,
            d: 1e-3 * d_mm,
            theta: (theta_deg + offset_deg[i]).to_radians(),
        }
    });
    let limits =
        Limits { min: axis_min_deg.map(f64::to_radians).into(), max: axis_max_deg.map(f64::to_radians).into(), elbow };
    if let Some(speed) = &own.axis_speed_deg_s {
        check.positive(&format!("{key}.axis_speed_deg_s"), speed);
    }
    let axis_speed = own.axis_speed_deg_s.map(|speed| speed.map(f64::to_radians).into());
    Some(Robot::new(raw.model.clone(), rows, axes, limits).with_axis_speed(axis_speed).standing_at(world_from_base))
}

/// The rows of `links`, if all are complete and finite.
fn links(check: &mut Check, raw: &[raw::Link]) -> Option<[[f64; 4]; 6]> {
    let key = "robot.kinematics.links";
    let Ok(rows) = <&[raw::Link; 6]>::try_from(raw) else {
        check.error(key, format!("{} links, expected 6", raw.len()), "give one modified-DH row for each joint");
        return None;
    };
    let mut values = [[0.0; 4]; 6];
    let mut missing = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        for (at, value) in row.values().into_iter().enumerate() {
            match value {
                Some(value) => values[i][at] = value,
                None => missing.push(format!("`{}` of row {}", raw::Link::KEYS[at], i + 1)),
            }
        }
        check.finite(key, &values[i]);
    }
    if missing.is_empty() {
        return Some(values);
    }
    let message = format!("{key}: missing {}", missing.join(", "));
    check.error(key, message, format!("each row has {}; 0.0 where there is none", raw::Link::KEYS.join(", ")));
    None
}

/// The frame of a tool; `None` if the program has to declare it.
fn tool(check: &mut Check, key: &str, raw: &raw::Tool) -> Option<ToolFrame> {
    if raw.mass_kg.is_nan() || raw.mass_kg < 0.0 {
        check.error(&format!("{key}.mass_kg"), "a mass cannot be negative", "kg");
    }
    check.finite(&format!("{key}.cog_mm"), &raw.cog_mm);
    let turn = Turn { quat: raw.tcp_quat, abc_deg: raw.tcp_abc_deg, wpr_deg: raw.tcp_wpr_deg };
    let (tcp_mm, tcp_quat) = match (raw.tcp_mm, check.turn(key, "tcp", turn)) {
        (Some(tcp_mm), Some(tcp_quat)) => (tcp_mm, tcp_quat),
        (None, None) => return None,
        (given, _) => {
            let (missing, why) = match given {
                Some(_) => ("tcp_quat", "a tool with tcp_mm needs its orientation (or tcp_abc_deg, tcp_wpr_deg)"),
                None => ("tcp_mm", "a tool with an orientation also needs a position"),
            };
            return check.need(key, missing, None, why);
        }
    };
    Some(ToolFrame {
        flange_from_tcp: check.frame(key, ["tcp_mm", "tcp_quat"], tcp_mm, tcp_quat),
        mass: raw.mass_kg,
        cog: Vector3::from(raw.cog_mm) * 1e-3,
    })
}

/// The frame of a work object in the world, or in the unit that carries it, with the index of that unit.
fn wobj(check: &mut Check, name: &str, raw: &raw::Wobj, units: &Units) -> (Pose, Option<usize>) {
    const UPRIGHT: [f64; 4] = [1.0, 0.0, 0.0, 0.0];
    let key = format!("wobjs.{name}");
    let turn = Turn { quat: raw.oframe_quat, abc_deg: raw.oframe_abc_deg, wpr_deg: raw.oframe_wpr_deg };
    let quat = check.turn(&key, "oframe", turn).unwrap_or(UPRIGHT);
    let turn = Turn { quat: raw.uframe_quat, abc_deg: raw.uframe_abc_deg, wpr_deg: raw.uframe_wpr_deg };
    let uframe_quat = check.turn(&key, "uframe", turn);
    let object = check.frame(&key, ["oframe_mm", "oframe_quat"], raw.oframe_mm.unwrap_or_default(), quat);
    let Some(unit) = &raw.unit else {
        let missing = (raw.uframe_mm.is_none(), uframe_quat.is_none());
        let why = "the user frame in the world, or `unit`, the mechanical unit that it is on";
        if missing.0 {
            check.need::<()>(&key, "uframe_mm", None, why);
        }
        if missing.1 {
            check.need::<()>(&key, "uframe_quat", None, why);
        }
        let (mm, quat) = (raw.uframe_mm.unwrap_or_default(), uframe_quat.unwrap_or(UPRIGHT));
        return (check.frame(&key, ["uframe_mm", "uframe_quat"], mm, quat) * object, None);
    };
    if raw.uframe_mm.is_some() || uframe_quat.is_some() {
        let message = format!("{key}: the user frame is that of unit `{unit}`");
        check.error(&format!("{key}.unit"), message, "remove uframe_mm and its orientation, or `unit`");
    }
    let found = units.named(unit);
    if found.is_none() {
        let near = nearest(unit, units.all().iter().map(|unit| unit.name.as_str()));
        let help = near.map_or("declare it with [[unit]]".to_owned(), |near| format!("did you mean `{near}`?"));
        check.error(&format!("{key}.unit"), format!("unit `{unit}` is not declared"), help);
    }
    (object, found)
}

/// An error for names that differ only in case, because RAPID does not distinguish them.
fn one_name<'a>(check: &mut Check, section: &str, names: impl Iterator<Item = &'a String>) {
    let mut seen = std::collections::BTreeMap::new();
    for name in names {
        if let Some(known) = seen.insert(name.to_ascii_uppercase(), name) {
            let message =
                format!("{section}.{known} and {section}.{name} are one name: RAPID ignores upper and lower case");
            check.error(&format!("{section}.{name}"), message, "remove one of them");
        }
    }
}

fn limits(check: &mut Check, raw: Option<&raw::Limits>) -> CorrectionLimits {
    let correction = raw.and_then(|l| l.max_correction_mm).unwrap_or(MAX_CORRECTION_MM);
    let step = raw.and_then(|l| l.max_step_mm).unwrap_or(MAX_STEP_MM);
    check.positive("limits.max_correction_mm", &[correction]);
    check.positive("limits.max_step_mm", &[step]);
    let path = raw.and_then(|l| l.max_path_error_mm);
    if let Some(path) = path {
        check.positive("limits.max_path_error_mm", &[path]);
    }
    CorrectionLimits {
        max_correction: 1e-3 * correction,
        max_step: 1e-3 * step,
        max_path_error: 1e-3 * path.unwrap_or(MAX_PATH_ERROR_MM),
    }
}

fn controller(check: &mut Check, raw: Option<&raw::Controller>) -> Controller {
    let compensates = raw.and_then(|controller| controller.compensates.as_ref());
    let path = raw.and_then(|controller| controller.path.as_ref()).map(|keys| controller_path(check, keys));
    let word = raw.and_then(|controller| controller.arc_turn.as_deref());
    let arc_turn = word.and_then(|word| check.word("controller.arc_turn", word, &ArcTurn::WORDS));
    let word = raw.and_then(|controller| controller.speed_unit.as_deref());
    let speed_unit = word.and_then(|word| check.word("controller.speed_unit", word, &SpeedUnit::WORDS));
    let speed_unit = speed_unit.unwrap_or_default();
    let declared = compensates.is_some();
    let mut controller = Controller { declared, path, arc_turn, speed_unit, ..Controller::default() };
    for word in compensates.into_iter().flatten() {
        match check.word("controller.compensates", word, &Covered::WORDS) {
            Some(Covered::Gravity) => controller.gravity = true,
            Some(Covered::Geometry) => controller.geometry = true,
            None => {}
        }
    }
    for name in raw.map_or(&[][..], |c| &c.harmless[..]) {
        let begins = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == '$');
        if begins && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '$') {
            controller.harmless.insert(name.to_ascii_uppercase());
        } else {
            let message = format!("controller.harmless: \"{name}\" is not the name of a routine");
            check.error(
                "controller.harmless",
                message,
                "give the name alone, without brackets: harmless = [\"MoveSettings\"]",
            );
        }
    }
    controller
}

/// Reads `[controller.path]`.
fn controller_path(check: &mut Check, keys: &raw::ControllerPath) -> ControllerPath {
    let positive = [
        ("controller.path.zone_share", &[keys.zone_share][..]),
        ("controller.path.acceleration_mm_s2", keys.acceleration_mm_s2.as_slice()),
        ("controller.path.passing_acceleration_mm_s2", keys.passing_acceleration_mm_s2.as_slice()),
        ("controller.path.corner_acceleration_mm_s2", keys.corner_acceleration_mm_s2.as_slice()),
        (
            "controller.path.axis_acceleration_deg_s2",
            keys.axis_acceleration_deg_s2.as_ref().map_or(&[], <[f64; 6]>::as_slice),
        ),
    ];
    for (key, values) in positive {
        check.positive(key, values);
    }
    let times = keys.smoothing_s.iter().flatten().chain(&keys.lag_s).chain([&keys.stop_s]);
    let lasting = keys.smoothing_s.iter().flatten().chain([&keys.stop_s]);
    if times.copied().any(|seconds| seconds.abs() > SLOWEST_S) || lasting.copied().any(|seconds| seconds < 0.0) {
        let message = format!(
            "[controller.path] smoothing_s, lag_s and stop_s are at most {SLOWEST_S} s, and smoothing_s and stop_s are not negative"
        );
        check.error("controller.path", message, "these are seconds: 58 ms are 0.058");
    }
    check.finite("controller.path.smoothing_s", keys.smoothing_s.as_ref().map_or(&[], <[f64; 2]>::as_slice));
    check.finite("controller.path.axis_lead_s2", &keys.axis_lead_s2);
    check.finite("controller.path.lag_s", &keys.lag_s);
    check.finite("controller.path.stop_s", &[keys.stop_s]);
    for (key, value) in [("controller.path.zone_mm", keys.zone_mm), ("controller.path.planning_s", keys.planning_s)] {
        check.positive(key, value.as_slice());
    }
    if !(0.0..=1.0).contains(&keys.error_share) {
        let message = "[controller.path] error_share is a share: expected 0 to 1".to_owned();
        check.error("controller.path", message, "0.1 means that the law explains 90 % of the controller's path error");
    }
    ControllerPath {
        law: PathLaw {
            zone_share: keys.zone_share,
            // Without a declared time there is no smoothing.
            smoothing: keys.smoothing_s.unwrap_or(PathLaw::AS_WRITTEN.smoothing),
            axis_lead: keys.axis_lead_s2.into(),
            acceleration: keys.acceleration_mm_s2.map_or(f64::INFINITY, |limit| 1e-3 * limit),
            passing_acceleration: keys
                .passing_acceleration_mm_s2
                .or(keys.acceleration_mm_s2)
                .map_or(f64::INFINITY, |limit| 1e-3 * limit),
            corner_acceleration: keys.corner_acceleration_mm_s2.map_or(f64::INFINITY, |limit| 1e-3 * limit),
            axis_acceleration: keys
                .axis_acceleration_deg_s2
                .map_or(PathLaw::AS_WRITTEN.axis_acceleration, |limits| limits.map(f64::to_radians).into()),
            lag: keys.lag_s.into(),
            stop: keys.stop_s,
        },
        zone: keys.zone_mm.map(|mm| 1e-3 * mm),
        error_share: keys.error_share,
        planning: keys.planning_s,
    }
}

/// Largest smoothing and lag that a cell may declare, s: ten times those of the slowest measured controllers.
const SLOWEST_S: f64 = 2.0;

type Effects = (Vec<Box<dyn deflex_effects::Effect>>, Vec<Option<DMatrix<f64>>>, Vec<Option<DMatrix<f64>>>);

/// Effects that follow from other tables of the cell, and what an effect may need of the cell.
struct Implied<'a> {
    /// How the motors drive the joints; `None` if the robot has errors.
    axes: Option<&'a Axes>,
    springs: bool,
    part: bool,
    /// Number of `[[part.clamp]]` tables.
    clamps: usize,
}

fn effects(
    check: &mut Check,
    (raw, units): (&[toml::Table], &Units),
    implied: Implied<'_>,
    controller: &mut Controller,
) -> Effects {
    let (mut effects, mut covariances, mut joint): Effects = (Vec::new(), Vec::new(), Vec::new());
    for (i, table) in raw.iter().enumerate() {
        let mut table = table.clone();
        let uncertainty = table.remove("uncertainty");
        table.remove("provenance");
        let key = format!("effect.{i}");
        let Some(toml::Value::String(name)) = table.remove("kind") else {
            check.error(&key, "[[effect]] has no `kind`", "for example kind = \"backlash\"");
            continue;
        };
        let known: Vec<(&str, usize)> =
            deflex_effects::KINDS.iter().enumerate().map(|(i, kind)| (kind.name, i)).collect();
        let Some(index) = check.word(&format!("{key}.kind"), &name, &known) else { continue };
        let effect = match (deflex_effects::KINDS[index].read)(table) {
            Ok(effect) => effect,
            Err(error) => {
                let message = in_words(error.message());
                let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
                let near = quoted.split_first().and_then(|(wrong, known)| nearest(wrong, known.iter().copied()));
                let help = near.map_or_else(
                    || format!("docs/effects.md lists the parameters of `{name}`; arrays of 6 are joints 1 to 6"),
                    |n| format!("did you mean `{n}`?"),
                );
                check.error(&key, format!("effect `{name}`: {message}"), help);
                continue;
            }
        };
        if effect.needs().contains(&Need::Stiffness) && !implied.springs {
            check.error(
                &key,
                format!("effect `{name}` needs [robot.stiffness]"),
                "add joint_nm_per_rad = [ … ] to [robot.stiffness]",
            );
            continue;
        }
        let serial = implied.axes.is_some_and(|axes| !axes.parallelogram);
        let only_parallelogram = effect.needs().iter().find_map(|need| match need {
            Need::Parallelogram(key) => Some(key),
            _ => None,
        });
        if let Some(own) = only_parallelogram.filter(|_| serial) {
            let message = format!("effect `{name}`: `{own}` is for an arm with a parallelogram");
            check.error(&key, message, format!("remove `{own}`"));
            continue;
        }
        if let Some(unit) = effect.unit().filter(|unit| units.named(unit).is_none()) {
            let near = nearest(unit, units.all().iter().map(|unit| unit.name.as_str()));
            let help = near.map_or("declare it with [[unit]]".to_owned(), |near| format!("did you mean `{near}`?"));
            check.error(&key, format!("effect `{name}`: unit `{unit}` is not declared"), help);
            continue;
        }
        if effect.clamps() > implied.clamps || (effect.clamps() > 0 && implied.clamps > MOST_CLAMPS) {
            let (wanted, there) = (effect.clamps(), implied.clamps);
            let message = if effect.clamps() > implied.clamps {
                format!("effect `{name}`: clamp {wanted} is not declared: [[part.clamp]] stands there {there} times")
            } else {
                format!(
                    "effect `{name}` is for parts with at most {MOST_CLAMPS} clamps: [[part.clamp]] stands there {there} times"
                )
            };
            check.error(&key, message, "count [[part.clamp]] from 1, in the order of the cell file");
            continue;
        }
        let other = effects.iter().filter_map(|effect| effect.presliding()).next();
        if let (Some(own), Some(other)) = (effect.presliding(), other)
            && own != other
        {
            check.error(
                &key,
                format!("effect `{name}`: `presliding_rad` is {own}, and {other} in another effect: all effects of an arm have the same"),
                "give both effects the same `presliding_rad`",
            );
            continue;
        }
        let covered = match effect.covered_by() {
            Some(Covered::Gravity) => controller.gravity,
            Some(Covered::Geometry) => controller.geometry,
            None => false,
        };
        if covered {
            controller.left_out.push(name);
            continue;
        }
        covariances.push(covariance(check, &key, uncertainty.as_ref(), &*effect));
        joint.push(uncertainty.and_then(|table| uncertainty::read_joint(&table, effect.uncertain())));
        effects.push(effect);
    }
    if let Some(axes) = implied.axes.filter(|_| implied.springs)
        && deflex_effects::add_implied(&mut effects, axes)
    {
        covariances.insert(0, None);
        joint.insert(0, None);
    }
    if implied.part && deflex_effects::add_implied_part(&mut effects) {
        covariances.push(None);
        joint.push(None);
    }
    (effects, covariances, joint)
}

/// The covariance of the effect's parameters, if the cell states one.
fn covariance(check: &mut Check, key: &str, value: Option<&toml::Value>, effect: &dyn Effect) -> Option<DMatrix<f64>> {
    let (name, size) = (effect.kind(), effect.uncertain());
    let value = value.filter(|value| uncertainty::KEYS.iter().any(|key| value.get(key).is_some()))?;
    let covariance = uncertainty::read(value, size);
    if covariance.is_none() {
        check.error(
            key,
            format!(
                "effect `{name}`: [effect.uncertainty] does not fit the {size} parameters that the effect has in this version of deflex"
            ),
            "another version of deflex wrote it: identify again from the cell as it was before; or remove this [effect.uncertainty], after which corrections stay the same and `sigma_mm` in reports lacks the share of this effect",
        );
    }
    covariance
}
