//! From the file to a checked [`Cell`].

use super::check::Check;
use super::cut::cut;
use super::syntax::{in_words, parse};
use super::{Cell, Cl, Controller, CorrectionLimits, Spin, SpinRule, nearest, raw, uncertainty};
use crate::effects::{self, Covered, Need, ToolFrame};
use crate::equilibrium::Arm;
use crate::program::cl::{ClOptions, Point, Units};
use crate::robot::{BUILTIN, DhRow, Joints, Limits, Pose, Robot};
use crate::text::{Diagnostic, Source, Span};
use nalgebra::{DMatrix, Quaternion, Translation3, UnitQuaternion, Vector3};

/// Without `[limits]`: what a correction of a sane cell never reaches, mm.
const MAX_CORRECTION_MM: f64 = 5.0;
/// Without `[limits]`: the step between neighbours is not limited by default beyond this, mm.
const MAX_STEP_MM: f64 = 2.0;

impl Cell {
    /// Reads and checks a cell file.
    ///
    /// # Errors
    /// Every reason found, each at its key: unknown keys and words with the nearest known one.
    pub fn read(source: &Source) -> Result<Self, Vec<Diagnostic>> {
        let text = match std::str::from_utf8(&source.bytes) {
            Ok(text) => text,
            Err(error) => {
                let at = error.valid_up_to();
                let end = (at + 1).min(source.bytes.len());
                let message = "the cell file is not UTF-8, which TOML asks for";
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
        let robot = robot(&mut check, &raw.robot);
        let stiffness = raw.robot.stiffness.as_ref().map(|s| {
            check.positive("robot.stiffness.joint_nm_per_rad", &s.joint_nm_per_rad);
            Joints::from(s.joint_nm_per_rad)
        });
        let tools =
            raw.tools.iter().map(|(name, tool)| (name.to_ascii_uppercase(), self::tool(&mut check, name, tool)));
        let tools = tools.collect();
        let wobjs =
            raw.wobjs.iter().map(|(name, wobj)| (name.to_ascii_uppercase(), self::wobj(&mut check, name, wobj)));
        let wobjs = wobjs.collect();
        one_name(&mut check, "tools", raw.tools.keys());
        one_name(&mut check, "wobjs", raw.wobjs.keys());
        let limits = limits(&mut check, raw.limits.as_ref());
        let mut controller = controller(&mut check, raw.controller.as_ref());
        let cut = raw.cut.as_ref().and_then(|keys| cut(&mut check, keys));
        let corner = raw.cut.as_ref().and_then(|cut| cut.cutter.as_ref()).map(|cutter| cutter.corner_radius_mm);
        let cl = raw.cl.as_ref().and_then(|cl| self::cl(&mut check, cl, corner));
        let (effects, covariances) = effects(&mut check, &raw.effect, stiffness.is_some(), &mut controller);
        let start = raw.robot.start_deg.map(|deg| {
            check.finite("robot.start_deg", &deg);
            Joints::from(deg.map(f64::to_radians))
        });
        if let Some(violation) = robot.as_ref().zip(start).and_then(|(robot, start)| robot.limit_violation(&start)) {
            check.error("robot.start_deg", format!("robot.start_deg: {violation}"), "start within the axis limits");
        }
        match robot {
            Some(robot) if check.errors.is_empty() => Ok(Self {
                arm: Arm { robot, stiffness, effects },
                covariances,
                start,
                tools,
                wobjs,
                limits,
                controller,
                cl,
                cut,
            }),
            _ => {
                check.errors.sort_by_key(|error| (error.line, error.column));
                Err(check.errors)
            }
        }
    }
}

fn frame(position_mm: [f64; 3], quat: [f64; 4]) -> Pose {
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(quat[0], quat[1], quat[2], quat[3]));
    let [x, y, z] = position_mm.map(|v| 1e-3 * v);
    Pose::from_parts(Translation3::new(x, y, z), rotation.to_rotation_matrix())
}

fn checked_frame(check: &mut Check, key: &str, names: [&str; 2], position_mm: [f64; 3], quat: [f64; 4]) -> Pose {
    check.finite(&format!("{key}.{}", names[0]), &position_mm);
    check.quat(&format!("{key}.{}", names[1]), quat);
    frame(position_mm, quat)
}

fn robot(check: &mut Check, raw: &raw::Robot) -> Option<Robot> {
    let identity = [1.0, 0.0, 0.0, 0.0];
    let (base_mm, base_quat) = (raw.base_mm.unwrap_or_default(), raw.base_quat.unwrap_or(identity));
    let world_from_base = checked_frame(check, "robot", ["base_mm", "base_quat"], base_mm, base_quat);
    let Some(own) = &raw.kinematics else {
        let known: Vec<(&str, usize)> = BUILTIN.iter().enumerate().map(|(i, robot)| (robot.model, i)).collect();
        let index = check.word("robot.model", &raw.model, &known)?;
        return Some(BUILTIN[index].robot().standing_at(world_from_base));
    };
    let key = "robot.kinematics";
    if own.links.len() != 6 {
        check.error(
            &format!("{key}.links"),
            format!("{} links, expected 6", own.links.len()),
            "one modified-DH row a joint",
        );
        return None;
    }
    for link in &own.links {
        check.finite(&format!("{key}.links"), &[link.alpha_deg, link.a_mm, link.d_mm, link.theta_deg]);
    }
    for i in 0..6 {
        let (min, max) = (own.axis_min_deg[i], own.axis_max_deg[i]);
        if min.is_nan() || max.is_nan() || min >= max {
            check.error(
                &format!("{key}.axis_min_deg"),
                format!("axis {}: limits {min}° to {max}° leave no room", i + 1),
                "axis_min_deg must lie below axis_max_deg",
            );
        }
    }
    if !own.parallelogram && (own.elbow_min_deg.is_some() || own.elbow_max_deg.is_some()) {
        check.error(
            &format!("{key}.elbow_min_deg"),
            "elbow limits are those of a parallelogram, but parallelogram = false",
            "remove them, or set parallelogram = true",
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
    let rows = std::array::from_fn(|i| {
        let link = &own.links[i];
        DhRow {
            alpha: link.alpha_deg.to_radians(),
            a: 1e-3 * link.a_mm,
            d: 1e-3 * link.d_mm,
            theta: link.theta_deg.to_radians(),
        }
    });
    let limits = Limits {
        min: own.axis_min_deg.map(f64::to_radians).into(),
        max: own.axis_max_deg.map(f64::to_radians).into(),
        elbow,
    };
    Some(Robot::new(raw.model.clone(), rows, own.parallelogram, limits).standing_at(world_from_base))
}

fn tool(check: &mut Check, name: &str, raw: &raw::Tool) -> ToolFrame {
    let key = format!("tools.{name}");
    if raw.mass_kg.is_nan() || raw.mass_kg < 0.0 {
        check.error(&format!("{key}.mass_kg"), "a mass is not negative", "kg");
    }
    check.finite(&format!("{key}.cog_mm"), &raw.cog_mm);
    ToolFrame {
        flange_from_tcp: checked_frame(check, &key, ["tcp_mm", "tcp_quat"], raw.tcp_mm, raw.tcp_quat),
        mass: raw.mass_kg,
        cog: Vector3::from(raw.cog_mm) * 1e-3,
    }
}

fn wobj(check: &mut Check, name: &str, raw: &raw::Wobj) -> Pose {
    let key = format!("wobjs.{name}");
    let user = checked_frame(check, &key, ["uframe_mm", "uframe_quat"], raw.uframe_mm, raw.uframe_quat);
    let quat = raw.oframe_quat.unwrap_or([1.0, 0.0, 0.0, 0.0]);
    user * checked_frame(check, &key, ["oframe_mm", "oframe_quat"], raw.oframe_mm.unwrap_or_default(), quat)
}

/// RAPID names are case-insensitive: two that differ in case only are one.
fn one_name<'a>(check: &mut Check, section: &str, names: impl Iterator<Item = &'a String>) {
    let mut seen = std::collections::BTreeMap::new();
    for name in names {
        if let Some(known) = seen.insert(name.to_ascii_uppercase(), name) {
            let message =
                format!("{section}.{known} and {section}.{name} are one name: RAPID does not tell case apart");
            check.error(&format!("{section}.{name}"), message, "remove one of them");
        }
    }
}

fn limits(check: &mut Check, raw: Option<&raw::Limits>) -> CorrectionLimits {
    let correction = raw.and_then(|l| l.max_correction_mm).unwrap_or(MAX_CORRECTION_MM);
    let step = raw.and_then(|l| l.max_step_mm).unwrap_or(MAX_STEP_MM);
    check.positive("limits.max_correction_mm", &[correction]);
    check.positive("limits.max_step_mm", &[step]);
    CorrectionLimits { max_correction: 1e-3 * correction, max_step: 1e-3 * step }
}

fn controller(check: &mut Check, raw: Option<&raw::Controller>) -> Controller {
    let mut controller = Controller { declared: raw.is_some(), ..Controller::default() };
    for word in raw.map_or(&[][..], |c| &c.compensates[..]) {
        match check.word(
            "controller.compensates",
            word,
            &[("gravity", Covered::Gravity), ("geometry", Covered::Geometry)],
        ) {
            Some(Covered::Gravity) => controller.gravity = true,
            Some(Covered::Geometry) => controller.geometry = true,
            None => {}
        }
    }
    controller
}

fn cl(check: &mut Check, raw: &raw::Cl, corner_radius_mm: Option<f64>) -> Option<Cl> {
    let units = match &raw.units {
        Some(units) => Some(check.word("cl.units", units, &[("mm", Units::Millimetre), ("inch", Units::Inch)])?),
        None => None,
    };
    let point = check.word(
        "cl.point",
        raw.point.as_deref().unwrap_or("tip"),
        &[("tip", Point::Tip), ("centre", Point::Centre)],
    )?;
    let rule = match check.word("cl.spin", &raw.spin, &[("fixed", 0), ("feed", 1), ("towards", 2)])? {
        0 => SpinRule::Fixed,
        1 => SpinRule::Feed,
        _ => {
            let point = check.need("cl", "towards_mm", raw.towards_mm, "spin = \"towards\" needs a point")?;
            SpinRule::Towards(Vector3::from(point) * 1e-3)
        }
    };
    if point == Point::Centre && corner_radius_mm.is_none() {
        check.error("cl.point", "point = \"centre\" needs the corner radius", "add [cut.cutter] corner_radius_mm");
    }
    let arc_tolerance_mm = raw.arc_tolerance_mm.unwrap_or(ClOptions::default().arc_tolerance_mm);
    check.positive("cl.arc_tolerance_mm", &[arc_tolerance_mm]);
    let turn = raw.spin_deg.unwrap_or(0.0);
    check.finite("cl.spin_deg", &[turn]);
    let options =
        ClOptions { tool: raw.tool.clone(), wobj: raw.wobj.clone(), units, point, corner_radius_mm, arc_tolerance_mm };
    Some(Cl { options, spin: Spin { rule, turn: turn.to_radians() } })
}

type Effects = (Vec<Box<dyn effects::Effect>>, Vec<Option<DMatrix<f64>>>);

fn effects(check: &mut Check, raw: &[toml::Table], stiffness: bool, controller: &mut Controller) -> Effects {
    let (mut effects, mut covariances): Effects = (Vec::new(), Vec::new());
    for (i, table) in raw.iter().enumerate() {
        let mut table = table.clone();
        let uncertainty = table.remove("uncertainty");
        table.remove("provenance");
        let key = format!("effect.{i}");
        let Some(toml::Value::String(name)) = table.remove("kind") else {
            check.error(&key, "[[effect]] has no `kind`", "for example kind = \"backlash\"");
            continue;
        };
        let known: Vec<(&str, usize)> = effects::KINDS.iter().enumerate().map(|(i, kind)| (kind.name, i)).collect();
        let Some(index) = check.word(&format!("{key}.kind"), &name, &known) else { continue };
        let effect = match (effects::KINDS[index].read)(table) {
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
        if effect.needs().contains(&Need::Stiffness) && !stiffness {
            check.error(
                &key,
                format!("effect `{name}` needs [robot.stiffness]"),
                "add joint_nm_per_rad = [ … ] to [robot.stiffness]",
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
        covariances.push(covariance(check, &key, uncertainty, effect.parameters().len()));
        effects.push(effect);
    }
    if stiffness && !effects.iter().any(|effect| effect.kind() == "joint_stiffness") {
        effects.insert(0, effects::declared_springs());
        covariances.insert(0, None);
    }
    (effects, covariances)
}

/// The covariance over the effect's parameters, where the cell has one.
fn covariance(check: &mut Check, key: &str, value: Option<toml::Value>, size: usize) -> Option<DMatrix<f64>> {
    let value = value.filter(|value| value.get("covariance").or(value.get("factors")).is_some())?;
    let covariance = uncertainty::read(&value, size);
    if covariance.is_none() {
        check.error(
            key,
            format!("uncertainty is not a covariance of {size} parameters"),
            "remove `uncertainty`, or identify again",
        );
    }
    covariance
}
