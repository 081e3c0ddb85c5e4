//! Makes a cell from the backup of an ABB controller: from `SYSPAR/MOC.cfg`, and from the tools and work objects of its
//! modules.
//!
//! The file consists of sections `TYPE:`. A section contains instances, each of which begins with `-name "…"` and has
//! attributes `-key value` or flags `-key`. A line that ends with a backslash is continued on the next line. Lengths
//! are in m and angles in rad. An attribute that is missing has its default; a base frame without attributes therefore
//! equals the world frame. Source: ABB, *Technical reference manual: System parameters* (3HAC050948-001), topic Motion.

use super::template::{Frames, backup_cell, comment, quoted, start_line};
use deflex_program::rapid::declared_frames;
use deflex_program::{Tool, ToolData, Wobj};
use deflex_robot::{AxisName, BUILTIN, Builtin, EXTERNAL_AXES, Pose};
use deflex_text::{Diagnostic, Source, Span};
use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The attributes of an instance. The value of a flag is empty.
type Instance = BTreeMap<String, String>;

/// The instances of `MOC.cfg`, each with its type.
struct Moc(Vec<(String, Instance)>);

/// Number of the robot's own axes. The external axes of a task are counted after them.
const ROBOT_AXES: usize = 6;

/// Limits closer than this to those of the built-in robot are taken to be the same, degrees: the file has six digits.
const SAME_DEG: f64 = 0.05;

/// A unit is unbounded if a limit is at least this, rad or m: endless turntables and conveyors have limits of 10⁶.
const UNBOUNDED: f64 = 1e5;

/// The cell file for a backup. Values that the backup does not contain are marked as in [`template`](super::template).
///
/// `model` names a built-in robot to use if the type in the backup is not one of them.
///
/// # Errors
/// The file contains no robot, or the robot is not a built-in one and `model` names none.
///
/// # Examples
/// ```
/// use deflex_cell::backup_template;
/// use deflex_text::{Diagnostics, Source};
///
/// fn init(backup: &str) -> Result<String, Diagnostics> {
///     let read = |path: String| std::fs::read(&path).map(|bytes| Source::new(path, bytes));
///     let moc = read(format!("{backup}/SYSPAR/MOC.cfg"))?;
///     let frames = read(format!("{backup}/RAPID/TASK1/SYSMOD/USER.SYS"))?;
///     Ok(backup_template(&moc, &[frames], None)?)
/// }
/// ```
pub fn backup_template(moc: &Source, modules: &[Source], model: Option<&str>) -> Result<String, Vec<Diagnostic>> {
    let text = moc.text(Span::new(0, moc.bytes.len()));
    let cfg = Moc::read(&text);
    let six = |robot: &&Instance| robot.contains_key("use_joint_5") && robot.contains_key("use_robot_type");
    let mut robots = cfg.all("ROBOT").filter(six);
    let Some(robot) = robots.next() else {
        let message = "no ROBOT with six joints and a -use_robot_type";
        let help = "give the folder of a backup, in which SYSPAR/MOC.cfg is";
        return Err(vec![Diagnostic::error("init.backup", &moc.name, message).help(help)]);
    };
    let others: Vec<&str> = robots.map(name).collect();
    let kind = &robot["use_robot_type"];
    let (builtin, sure) = match model {
        Some(model) => (Builtin::named(model).ok(), true),
        None => of_type(kind),
    };
    let Some(builtin) = builtin else {
        let message = format!("robot type {kind:?} is not built in");
        let help =
            "give the model that is most like it with --robot (`deflex init --list`), and its own [robot.kinematics]";
        return Err(vec![Diagnostic::error("init.backup", &moc.name, message).help(help)]);
    };
    let mut head =
        format!("[robot]\nmodel = {}     # {}the backup says {}\n", quoted(&builtin.model), mark(!sure), comment(kind));
    if !others.is_empty() {
        let _ = writeln!(head, "# other robots of the backup: {}", others.join(", "));
    }
    head += &start_line(&builtin.robot());
    let units = cfg.units(robot);
    let under = units.iter().find(|unit| unit.carries_robot);
    let base = under.map_or_else(Pose::identity, |unit| unit.frame) * frame(robot);
    let stands_on = robot.get("base_frame_coordinated").filter(|on| under.is_none() && !on.is_empty());
    if let Some(on) = stands_on {
        // Writing to a String cannot fail.
        let _ = writeln!(
            head,
            "# << the robot stands on {}, which is not taken: add [[unit]] for each of its axes, and the base with these at zero",
            comment(on)
        );
    }
    let leans = leans_otherwise(robot, &base);
    if let Some(deg) = leans {
        let _ = writeln!(
            head,
            "# << the backup says (gravity_alpha, gravity_beta) that the robot's z axis is {deg:.1}\u{b0} from upright, and its base frame does not: gravity is taken from base_quat"
        );
    }
    head += &place("base_mm", "base_quat", &base, under.is_some() || stands_on.is_some() || leans.is_some());
    head += &cfg.limits(robot, builtin);
    for unit in &units {
        unit.write(&mut head);
    }
    let not_taken = cfg.not_taken(&units, robot);
    if !not_taken.is_empty() {
        let _ = writeln!(head, "\n# Mechanical units of the backup that are not taken: {}", not_taken.join(", "));
    }
    let (tools, wobjs) = declared_frames(modules);
    Ok(backup_cell(&head, builtin.stiffness_nm_per_rad, &frames(&tools, &wobjs)))
}

/// Angle of the robot's z axis from the vertical, degrees, as the controller uses it for gravity; `None` if the base
/// frame agrees with it. Where programs are only taught at the robot, the base frame of a robot that hangs is often
/// left equal to the world frame.
fn leans_otherwise(robot: &Instance, base: &Pose) -> Option<f64> {
    /// Difference of the angles that is explained by the installation, degrees.
    const LEVEL: f64 = 1.0;
    let angle = |key: &str| number(robot, key).unwrap_or(0.0);
    // The angles turn about x and y of the base. The cosine of the resulting angle does not depend on their order.
    let inclination = (angle("gravity_alpha").cos() * angle("gravity_beta").cos()).clamp(-1.0, 1.0).acos().to_degrees();
    let frame = base.rotation.matrix()[(2, 2)].clamp(-1.0, 1.0).acos().to_degrees();
    ((inclination - frame).abs() > LEVEL).then_some(inclination)
}

fn name(instance: &Instance) -> &str {
    instance.get("name").map_or("", String::as_str)
}

/// The start of a comment after a value that the user has to check.
fn mark(marked: bool) -> &'static str {
    if marked { "<< " } else { "" }
}

impl Moc {
    fn read(text: &str) -> Self {
        let text = text.replace("\\\r\n", " ").replace("\\\n", " ");
        let (mut all, mut section) = (Vec::new(), String::new());
        for line in text.lines().map(str::trim) {
            if line.starts_with('-') {
                all.push((section.clone(), attributes(line)));
            } else if let Some(kind) = line.strip_suffix(':').filter(|kind| !kind.contains(' ')) {
                section = kind.to_owned();
            }
        }
        Self(all)
    }

    fn all<'a>(&'a self, kind: &'a str) -> impl Iterator<Item = &'a Instance> + 'a {
        self.0.iter().filter(move |(section, _)| section == kind).map(|(_, instance)| instance)
    }

    fn named(&self, kind: &str, wanted: &str) -> Option<&Instance> {
        self.0.iter().find(|(section, instance)| section == kind && name(instance) == wanted).map(|(_, found)| found)
    }

    /// Limits of a joint, rad or m: those of the arm that the joint uses, which usually has the joint's name.
    fn bounds(&self, joint: &str) -> Option<[f64; 2]> {
        let arm = self.named("JOINT", joint).and_then(|joint| joint.get("use_arm")).map_or(joint, String::as_str);
        let arm = self.named("ARM", arm)?;
        Some([number(arm, "lower_joint_bound")?, number(arm, "upper_joint_bound")?])
    }

    /// `[robot.kinematics]`, if the controller's limits differ from those of the built-in robot; otherwise empty.
    fn limits(&self, robot: &Instance, builtin: &Builtin) -> String {
        let joint = |i: usize| self.bounds(robot.get(&format!("use_joint_{i}"))?).map(|b| b.map(f64::to_degrees));
        let found: Vec<[f64; 2]> = (0..ROBOT_AXES).filter_map(joint).collect();
        let Ok(found) = <[[f64; 2]; ROBOT_AXES]>::try_from(found) else {
            return "# The backup has no axis limits: those of the model count.\n".to_owned();
        };
        let near = |i: usize| {
            let own = [builtin.min_deg[i], builtin.max_deg[i]];
            (0..2).all(|k| (own[k] - found[i][k]).abs() < SAME_DEG)
        };
        if (0..ROBOT_AXES).all(near) {
            return String::new();
        }
        let mut text = format!(
            "\n[robot.kinematics]               # of the model, with the axis limits of the backup\nparallelogram = {}\nlinks = [\n",
            builtin.parallelogram
        );
        for [alpha, a, d, theta] in &builtin.rows {
            let _ = writeln!(text, "  {{ alpha_deg = {alpha:?}, a_mm = {a:?}, d_mm = {d:?}, theta_deg = {theta:?} }},");
        }
        let side = |k: usize| found.map(|bounds| tidy(bounds[k]));
        let _ = writeln!(text, "]\naxis_sign = {:?}", builtin.axis_sign);
        let _ = writeln!(text, "axis_min_deg = {:?}\naxis_max_deg = {:?}", side(0), side(1));
        if let Some([min, max]) = builtin.elbow_deg {
            let _ = writeln!(text, "elbow_min_deg = {min:?}\nelbow_max_deg = {max:?}");
        }
        text
    }

    /// The single axes in addition to the robot that programs can move.
    fn units(&self, robot: &Instance) -> Vec<FoundUnit> {
        let under = robot.get("base_frame_coordinated").map_or("", String::as_str);
        let mut units = Vec::new();
        for unit in self.all("MECHANICAL_UNIT") {
            let singles: Vec<&Instance> =
                (0..ROBOT_AXES).filter_map(|i| self.named("SINGLE", unit.get(&format!("use_single_{i}"))?)).collect();
            for (i, single) in singles.iter().enumerate() {
                let own =
                    if i + 1 == singles.len() { name(unit).to_owned() } else { format!("{}_{}", name(unit), i + 1) };
                units.extend(self.unit(own, single, [name(unit), name(single)].contains(&under)));
            }
        }
        // The file names the single on which a unit stands; the cell names the unit of that single.
        let names: Vec<(String, String)> = units.iter().map(|unit| (unit.single.clone(), unit.name.clone())).collect();
        for unit in &mut units {
            let on = unit.on.take();
            unit.on = on.and_then(|on| {
                names.iter().find(|(single, name)| *single == on || *name == on).map(|(_, name)| name.clone())
            });
        }
        units
    }

    fn unit(&self, own: String, single: &Instance, carries_robot: bool) -> Option<FoundUnit> {
        let joint = single.get("use_joint")?;
        let logical = self.named("JOINT", joint).and_then(|joint| number(joint, "logical_axis"))?;
        let axis = (logical as usize).checked_sub(ROBOT_AXES + 1).filter(|axis| *axis < EXTERNAL_AXES)?;
        let kind = single.get("use_single_type").and_then(|kind| self.named("SINGLE_TYPE", kind));
        let mechanics = kind.and_then(|kind| kind.get("mechanics")).cloned().unwrap_or_default();
        let bounds = self.bounds(joint);
        let on = single.get("base_frame_coordinated").filter(|on| !on.is_empty()).cloned();
        Some(FoundUnit {
            single: name(single).to_owned(),
            name: own,
            axis,
            mechanics,
            carries_robot,
            frame: frame(single),
            on,
            bounds,
        })
    }

    /// Units that are left out of the cell: other robots, and positioners that are modelled as robots.
    fn not_taken(&self, units: &[FoundUnit], robot: &Instance) -> Vec<String> {
        let taken = |unit: &Instance| {
            let own = format!("{}_", name(unit));
            units.iter().any(|found| found.name == name(unit) || found.name.starts_with(&own))
        };
        let of_robot = |unit: &Instance| unit.get("use_robot").is_some_and(|used| used == name(robot));
        self.all("MECHANICAL_UNIT")
            .filter(|unit| !taken(unit) && !of_robot(unit))
            .map(|unit| name(unit).to_owned())
            .collect()
    }
}

/// The attributes of a line, `-key value` or `-key`. Values with blanks are in quotes.
fn attributes(line: &str) -> Instance {
    let mut all = Instance::new();
    let mut rest = line;
    while let Some(from) = rest.strip_prefix('-') {
        let end = from.find(char::is_whitespace).unwrap_or(from.len());
        let (key, after_key) = from.split_at(end);
        let after_key = after_key.trim_start();
        let value_end = match after_key.strip_prefix('"') {
            Some(quoted) => quoted.find('"').map_or(after_key.len(), |end| end + 2),
            None if after_key.starts_with('-')
                && !after_key[1..].starts_with(|c: char| c.is_ascii_digit() || c == '.') =>
            {
                0
            }
            None => after_key.find(char::is_whitespace).unwrap_or(after_key.len()),
        };
        let (value, next) = after_key.split_at(value_end);
        all.insert(key.to_owned(), value.trim_matches('"').to_owned());
        rest = next.trim_start();
    }
    all
}

fn number(instance: &Instance, key: &str) -> Option<f64> {
    instance.get(key)?.parse().ok().filter(|value: &f64| value.is_finite())
}

/// The base frame of an instance.
fn frame(instance: &Instance) -> Pose {
    let of = |key: &str, default: f64| number(instance, &format!("base_frame_{key}")).unwrap_or(default);
    let quat = Quaternion::new(of("orient_u0", 1.0), of("orient_u1", 0.0), of("orient_u2", 0.0), of("orient_u3", 0.0));
    let place = Translation3::new(of("pos_x", 0.0), of("pos_y", 0.0), of("pos_z", 0.0));
    let quat = if quat.norm() > 0.5 { quat } else { Quaternion::identity() };
    Pose::from_parts(place, UnitQuaternion::new_normalize(quat).to_rotation_matrix())
}

/// Rounds to six digits, as in the file.
fn tidy(value: f64) -> f64 {
    let scaled = (value * 1e4).round() / 1e4;
    if scaled == 0.0 { 0.0 } else { scaled }
}

/// The two lines of a frame in a cell file: position in mm, and quaternion.
fn place(mm: &str, quat: &str, frame: &Pose, marked: bool) -> String {
    let position: [f64; 3] = (frame.translation.vector * 1e3).map(tidy).into();
    let q = UnitQuaternion::from_rotation_matrix(&frame.rotation);
    let q = [q.w, q.i, q.j, q.k].map(|v| if v.abs() < 1e-12 { 0.0 } else { v });
    let mark = if marked { "   # <<" } else { "" };
    format!("{mm} = {position:?}{mark}\n{quat} = {q:?}{mark}\n")
}

/// The built-in robot of a type such as `ROB1_6700_200_2.60`, and whether it is exactly that one.
fn of_type(kind: &str) -> (Option<&'static Builtin>, bool) {
    let mut parts = kind.split('_').skip(1);
    let Some(family) = parts.next() else { return (None, false) };
    let parts: Vec<&str> = parts.collect();
    let (mut payload, mut reach, mut odd) = (None, None, false);
    for part in parts {
        match (part.contains('.'), part.parse::<f64>()) {
            (true, Ok(metres)) => reach = Some(metres),
            (false, Ok(_)) => payload = Some(part),
            (_, Err(_)) => odd = true,
        }
    }
    let of_family =
        || BUILTIN.iter().filter(|robot| robot.model.starts_with(&format!("irb{}-", family.to_ascii_lowercase())));
    let (Some(payload), Some(reach)) = (payload, reach) else {
        let mut all = of_family();
        return (all.next(), false);
    };
    let wanted = format!("irb{}-{payload}-{reach:.2}", family.to_ascii_lowercase());
    let same = |robot: &&Builtin| robot.model == wanted || format!("{}0", robot.model) == wanted;
    if let Some(robot) = of_family().find(same) {
        return (Some(robot), !odd);
    }
    // No built-in robot is exactly this one: takes the one with the most similar reach, then payload.
    let size = |robot: &Builtin| {
        let mut parts = robot.model.rsplit('-').map(|part| part.parse().unwrap_or(f64::INFINITY));
        [parts.next(), parts.next()].map(|part: Option<f64>| part.unwrap_or(f64::INFINITY))
    };
    let payload: f64 = payload.parse().unwrap_or(f64::INFINITY);
    let off = |robot: &Builtin| {
        let [own_reach, own_payload] = size(robot);
        ((own_reach - reach).abs(), (own_payload - payload).abs())
    };
    let nearest = of_family().min_by(|a, b| {
        let (a, b) = (off(a), off(b));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    (nearest, false)
}

/// A single axis of the backup.
struct FoundUnit {
    single: String,
    name: String,
    axis: usize,
    mechanics: String,
    carries_robot: bool,
    frame: Pose,
    on: Option<String>,
    /// rad or m
    bounds: Option<[f64; 2]>,
}

impl FoundUnit {
    fn write(&self, out: &mut String) {
        let linear = self.mechanics.eq_ignore_ascii_case("TRACK");
        let known = linear || self.mechanics.eq_ignore_ascii_case("FREE_ROT");
        let (kind, carries) =
            (if linear { "linear" } else { "rotary" }, if self.carries_robot { "robot" } else { "part" });
        // Writing to a String cannot fail.
        let axis = AxisName::External(self.axis);
        let _ = writeln!(
            out,
            "
[[unit]]
name = {}
axis = \"{axis}\"",
            quoted(&self.name)
        );
        let comment =
            if known { String::new() } else { format!("   # << the backup says {}", comment(&self.mechanics)) };
        let _ = writeln!(out, "kind = {kind:?}{comment}\ncarries = {carries:?}");
        if linear {
            let x: [f64; 3] = (self.frame.rotation * Vector3::x()).map(tidy).into();
            let _ = writeln!(out, "direction = {x:?}   # << x of its base frame: jog it, and look");
        }
        if !linear || !self.carries_robot {
            *out += &place("base_mm", "base_quat", &self.frame, false);
        }
        if let Some(on) = &self.on {
            let _ = writeln!(out, "on = {on:?}");
        }
        if let Some(bounds) = self.bounds.filter(|bounds| bounds.iter().all(|bound| bound.abs() < UNBOUNDED)) {
            let [min, max] = bounds.map(|bound| tidy(if linear { 1e3 * bound } else { bound.to_degrees() }));
            let _ = writeln!(out, "min = {min:?}\nmax = {max:?}");
        }
    }
}

/// `[tools]` and `[wobjs]`, with comments on values that a cell does not have.
fn frames(tools: &[Tool], wobjs: &[Wobj]) -> Frames {
    let mut frames = Frames::default();
    let identifier = |name: &str| name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
    let held = |tool: &Tool| tool.data.filter(|data| data.robhold && identifier(&tool.name));
    for tool in tools {
        let Some(ToolData { tcp_mm, tcp_quat, mass_kg, cog_mm, .. }) = held(tool) else {
            let _ =
                writeln!(frames.text, "# {}: stands still; a program that uses it declares it\n", comment(&tool.name));
            continue;
        };
        // Controllers write a mass of -1 if no load was entered.
        let (mass_kg, unknown) = (mass_kg.max(0.0), mass_kg <= 0.0);
        let mark = if unknown { "   # << no load is declared" } else { "" };
        let _ = writeln!(
            frames.text,
            "[tools.{}]\ntcp_mm = {tcp_mm:?}\ntcp_quat = {tcp_quat:?}\nmass_kg = {mass_kg:?}{mark}\ncog_mm = {cog_mm:?}\n",
            tool.name
        );
        frames.tool.get_or_insert_with(|| tool.name.to_string());
    }
    for wobj in wobjs {
        let fixed = wobj.data.filter(|data| data.fixed && !data.robhold && identifier(&wobj.name));
        let Some(data) = fixed else {
            let _ = writeln!(
                frames.text,
                "# {}: moved by a unit, or held by the robot; a program that uses it declares it\n",
                comment(&wobj.name)
            );
            continue;
        };
        let _ = writeln!(
            frames.text,
            "[wobjs.{}]\nuframe_mm = {:?}\nuframe_quat = {:?}\noframe_mm = {:?}\noframe_quat = {:?}\n",
            wobj.name, data.uframe_mm, data.uframe_quat, data.oframe_mm, data.oframe_quat
        );
        frames.wobj.get_or_insert_with(|| wobj.name.to_string());
    }
    frames
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_distinguished() {
        let of = |kind| of_type(kind).0.map(|robot| (robot.model.as_str(), of_type(kind).1));
        assert_eq!(of("ROB1_6700_200_2.60"), Some(("irb6700-200-2.60", true)));
        assert_eq!(of("ROB1_1200_0.9_5_TypeB"), Some(("irb1200-5-0.90", false)));
        assert_eq!(of("ROB1_6700_LeanID_2.65_220").map(|found| found.1), Some(false));
        assert_eq!(of("ROB1_9999_1.0_5"), None);
        assert_eq!(of("ROB1_6700_2.80_205"), Some(("irb6700-205-2.80", true)));
        assert_eq!(of("ROB1_6700_2.75_220"), Some(("irb6700-205-2.80", false)));
    }
}
