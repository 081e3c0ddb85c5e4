//! From the file to a checked [`Cell`].

use super::check::Check;
use super::{Cell, Cl, Controller, CorrectionLimits, Cut, CutForce, ForceFrame, Spin, SpinRule, nearest, raw};
use crate::cutting::{Coefficients, Cutter, Engagement, Milling, Mode, materials};
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
/// Chords of arcs, mm: a tenth of what a robot repeats.
const ARC_TOLERANCE_MM: f64 = 0.005;

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
        let cut = raw.cut.as_ref().and_then(|cut| self::cut(&mut check, cut));
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

/// Unknown keys of one file before the rest is left out.
const MESSAGES: usize = 20;

/// Reads the TOML. Unknown keys are collected and blanked, so that one run names them all.
fn parse(source: &Source, text: &str) -> Result<(raw::Cell, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut blanked = text.to_owned();
    let mut errors: Vec<Diagnostic> = Vec::new();
    loop {
        let error = match toml::from_str(&blanked) {
            Ok(raw) => return Ok((raw, errors)),
            Err(error) => error,
        };
        let diagnostic = syntax(source, &error);
        // A required key that was mistyped is one fault, not two.
        let quoted = error.message().split('`').nth(1).map(|name| format!("did you mean `{name}`?"));
        let mistyped = error.message().starts_with("missing field") && errors.iter().any(|known| known.help == quoted);
        if !mistyped {
            errors.push(diagnostic);
        }
        let unknown = error.message().starts_with("unknown field") && errors.len() < MESSAGES;
        match error.span().filter(|_| unknown).and_then(|key| without(&blanked, key.start)) {
            Some(next) => blanked = next,
            None => return Err(errors),
        }
    }
}

/// The text with the assignment `key = value` that starts at a byte blanked; `None` where it does not start its line.
fn without(text: &str, start: usize) -> Option<String> {
    let line = text[..start].rfind('\n').map_or(0, |at| at + 1);
    if !text[line..start].trim().is_empty() {
        return None;
    }
    let document = toml_edit::Document::parse(text).ok()?;
    let end = assignment_end(document.as_table(), start)?;
    let blank = text[start..end].chars().map(|c| if c == '\n' { "\n".to_owned() } else { " ".repeat(c.len_utf8()) });
    Some([&text[..start], &blank.collect::<String>(), &text[end..]].concat())
}

/// Where the value of the key that starts at a byte ends.
fn assignment_end(table: &dyn toml_edit::TableLike, start: usize) -> Option<usize> {
    for (name, item) in table.iter() {
        let key = table.key(name)?.span()?;
        if key.start == start {
            return item.as_value()?.span().map(|value| value.end);
        }
        let inner = match item {
            toml_edit::Item::ArrayOfTables(tables) => tables.iter().find_map(|table| assignment_end(table, start)),
            item => item.as_table_like().and_then(|table| assignment_end(table, start)),
        };
        if inner.is_some() {
            return inner;
        }
    }
    None
}

/// A TOML error as ours, with the nearest known key.
fn syntax(source: &Source, error: &toml::de::Error) -> Diagnostic {
    let said = error.message();
    let quoted: Vec<&str> = said.split('`').skip(1).step_by(2).collect();
    let (message, help) = match quoted.split_first() {
        Some((wrong, known)) if said.starts_with("unknown field") => {
            let near = nearest(wrong, known.iter().copied());
            let all = || format!("known keys here: {}", known.join(", "));
            (format!("unknown key `{wrong}`"), near.map_or_else(all, |near| format!("did you mean `{near}`?")))
        }
        Some((missing, _)) if said.starts_with("missing field") => {
            (format!("key `{missing}` is missing"), format!("add `{missing} = …` here"))
        }
        _ if said.starts_with("invalid type: string") && said.contains("f64") => {
            (in_words(said), "write the number without quotes".to_owned())
        }
        _ => {
            let help = "decimals take a point, text stands in quotes; `deflex init --robot MODEL` prints a whole cell";
            (in_words(said), help.to_owned())
        }
    };
    let diagnostic = Diagnostic::error("cell.syntax", &source.name, message).help(help);
    match error.span() {
        Some(range) => diagnostic.at(source, Span::new(range.start, range.end)),
        None => diagnostic,
    }
}

/// What serde says, without names of Rust's types.
fn in_words(said: &str) -> String {
    let words = [("f64", "a number"), ("u32", "a whole number"), ("floating point", "number")];
    words.iter().fold(said.to_owned(), |said, (name, word)| said.replace(name, word))
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
    let arc_tolerance_mm = raw.arc_tolerance_mm.unwrap_or(ARC_TOLERANCE_MM);
    check.positive("cl.arc_tolerance_mm", &[arc_tolerance_mm]);
    let turn = raw.spin_deg.unwrap_or(0.0);
    check.finite("cl.spin_deg", &[turn]);
    let options =
        ClOptions { tool: raw.tool.clone(), wobj: raw.wobj.clone(), units, point, corner_radius_mm, arc_tolerance_mm };
    Some(Cl { options, spin: Spin { rule, turn: turn.to_radians() } })
}

fn cut(check: &mut Check, raw: &raw::Cut) -> Option<Cut> {
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

/// `uncertainty = { covariance = [[…], …] }`, square over the effect's parameters.
fn covariance(check: &mut Check, key: &str, value: Option<toml::Value>, size: usize) -> Option<DMatrix<f64>> {
    let rows: Vec<Vec<f64>> = value?.get("covariance")?.clone().try_into().ok()?;
    if rows.len() != size || rows.iter().any(|row| row.len() != size || row.iter().any(|v| !v.is_finite())) {
        check.error(
            key,
            format!("uncertainty.covariance is not a {size} by {size} matrix"),
            "remove `uncertainty`, or identify again",
        );
        return None;
    }
    Some(DMatrix::from_fn(size, size, |i, j| rows[i][j]))
}
