//! `pose`: converts joint angles to a TCP pose, and back.

use super::args::Pose as Arguments;
use super::{Answer, Outcome, message};
use crate::session::input::CellFile;
use crate::session::output::{Outputs, is_stdout, print};
use deflex::cell::{Cell, examples_left, nearest};
use deflex::correct::declared_names;
use deflex::program::orientation::{quaternion, rotation, rotation_vector, xyz_deg, zyx_deg};
use deflex::program::{Confdata, Config, Language, StatusAndTurn};
use deflex::robot::{
    AxisName, EXTERNAL_AXES, External, Joints, Pose, Robot, Unit, UnitKind, confdata_of, config_of, status_of,
};
use deflex::text::{Diagnostic, number};
use serde_json::{Value, json};
use std::fmt::Write;

/// Largest deviation of a typed quaternion's norm from 1. Pendants show about four decimals; with a larger deviation
/// the numbers are not an orientation.
const UNIT_NORM: f64 = 1e-2;

pub(super) fn run(args: &Arguments) -> Outcome {
    let file = CellFile::read(&args.cell)?;
    let cell = &file.cell;
    let flange_from_tcp = match &args.tool {
        Some(name) => named("tool", name, (cell, &cell.tools))?.flange_from_tcp,
        None => Pose::identity(),
    };
    let external = external(cell, &args.external)?;
    let world_from_wobj = match &args.wobj {
        Some(name) => {
            let frame = named("wobj", name, (cell, &cell.wobjs))?;
            match cell.wobj_units.get(&name.to_ascii_uppercase()) {
                Some(unit) => cell.units.world_from_unit(*unit, &external) * frame,
                None => *frame,
            }
        }
        None => Pose::identity(),
    };
    let world_from_base = cell.units.world_from_base(&cell.arm.robot.world_from_base, &external);
    let base_from_wobj = world_from_base.inv_mul(&world_from_wobj);
    let frames = Frames { cell, base_from_wobj, flange_from_tcp };
    let (mut text, mut answer) = if args.joints.is_empty() {
        frames.joints(&target(&args.target, cell.language)?)?
    } else {
        frames.tcp(&args.joints)?
    };
    for unit in cell.units.all() {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "unit {} stands at {} {}", unit.name, external[unit.axis], sign(unit));
        answer["units"][&unit.name] = external[unit.axis].into();
    }
    let doubts = examples_left(&file.source).into_iter().chain(cell.notes.iter().cloned()).collect();
    message::print(&file.own(doubts), false);
    let Some(json) = &args.json else {
        print(text.as_bytes())?;
        return Ok(Answer::Yes);
    };
    if !is_stdout(json) {
        print(text.as_bytes())?;
    }
    let mut outputs = Outputs::default();
    outputs.add(json, format!("{answer:#}\n").as_bytes())?;
    outputs.commit()?;
    Ok(Answer::Yes)
}

/// Positions of the mechanical units as typed; units without a position are at zero.
fn external(cell: &Cell, typed: &[f64]) -> Result<External, Vec<Diagnostic>> {
    let mut external = [0.0; EXTERNAL_AXES];
    let mut errors = Vec::new();
    let mut bad = |message: String, help: &str| {
        errors.push(Diagnostic::error("pose.external", "", format!("--external {message}")).help(help));
    };
    if typed.len() > EXTERNAL_AXES {
        let help = "positions of eax_a, eax_b, … in mm and degrees, with commas between";
        bad(format!("has {} numbers, expected at most {EXTERNAL_AXES}", typed.len()), help);
    }
    for (axis, position) in typed.iter().enumerate().take(EXTERNAL_AXES) {
        external[axis] = *position;
        match cell.units.all().iter().find(|unit| unit.axis == axis) {
            None if *position == 0.0 => {}
            None => {
                let name = AxisName::External(axis);
                bad(format!("moves {name}, which no [[unit]] of the cell has"), "declare the unit, or leave it out")
            }
            Some(unit) if !(unit.min..=unit.max).contains(position) => {
                let Unit { name, min, max, .. } = unit;
                bad(format!("puts {name} at {position}, which goes from {min} to {max} {}", sign(unit)), "check it");
            }
            Some(_) => {}
        }
    }
    if errors.is_empty() { Ok(external) } else { Err(errors) }
}

/// Unit of measurement of the unit's positions.
fn sign(unit: &Unit) -> &'static str {
    match unit.kind {
        UnitKind::Rotary => "degrees",
        _ => "mm",
    }
}

/// The entry of the cell with the typed name.
fn named<'a, T>(
    what: &str,
    name: &str,
    (cell, all): (&Cell, &'a std::collections::BTreeMap<String, T>),
) -> Result<&'a T, Vec<Diagnostic>> {
    all.get(&name.to_ascii_uppercase()).ok_or_else(|| {
        let known = cell.names_of(all);
        let meant = nearest(name, known.iter().copied());
        let meant = meant.map_or_else(String::new, |meant| format!("did you mean `{meant}`? "));
        Diagnostic::error("pose.name", "", format!("--{what} {name}: the cell declares no such {what}"))
            .help(format!("{meant}{}", declared_names(&known)))
            .into()
    })
}

/// The TCP pose that was typed, in metres.
fn target(numbers: &[f64], language: Option<Language>) -> Result<Pose, Vec<Diagnostic>> {
    let bad = |message: String| {
        let help = "x,y,z,q1,q2,q3,q4 with the quaternion as RAPID writes it, or x,y,z,A,B,C in mm and degrees (x,y,z,W,P,R for a FANUC). A Yaskawa takes x,y,z,Rx,Ry,Rz in mm and degrees. A UR takes x,y,z,rx,ry,rz: mm, and the rotation vector in rad";
        vec![Diagnostic::error("pose.target", "", message).help(help)]
    };
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err(bad("--target: a number is not finite".to_owned()));
    }
    let turn = match *numbers {
        [_, _, _, a, b, c] => (language.unwrap_or(Language::Rapid).about().turn)([a, b, c]),
        [_, _, _, w, x, y, z] => {
            let norm = (w * w + x * x + y * y + z * z).sqrt();
            if (norm - 1.0).abs() > UNIT_NORM {
                return Err(bad(format!("--target: the quaternion's norm is {norm:.4}, expected 1")));
            }
            rotation([w, x, y, z])
        }
        _ => return Err(bad(format!("--target has {} numbers, expected 6 or 7", numbers.len()))),
    };
    Ok(Pose::from_parts(nalgebra::Translation3::new(1e-3 * numbers[0], 1e-3 * numbers[1], 1e-3 * numbers[2]), turn))
}

struct Frames<'a> {
    cell: &'a Cell,
    base_from_wobj: Pose,
    flange_from_tcp: Pose,
}

impl Frames<'_> {
    /// The TCP pose at axis angles, as text and as JSON.
    fn tcp(&self, axes_deg: &[f64]) -> Result<(String, Value), Vec<Diagnostic>> {
        let robot = &self.cell.arm.robot;
        let axes_deg: [f64; 6] =
            axes_deg.try_into().ok().filter(|deg: &[f64; 6]| deg.iter().all(|angle| angle.is_finite())).ok_or_else(
                || {
                    let message = match axes_deg.iter().find(|angle| !angle.is_finite()) {
                        Some(angle) => format!("--joints has the angle {angle}, expected a number"),
                        None => format!("--joints has {} angles, expected 6", axes_deg.len()),
                    };
                    Diagnostic::error("pose.joints", "", message)
                        .help("six axis angles in degrees, as the pendant shows them, with commas between")
                },
            )?;
        let motor = robot.motor_from_axes_deg(&axes_deg);
        let tcp = self.base_from_wobj.inv_mul(&(robot.forward(&motor) * self.flange_from_tcp));
        let mut text = String::new();
        let mm: [f64; 3] = (tcp.translation.vector * 1e3).into();
        let (quat, zyx, xyz) = (quaternion(&tcp.rotation), zyx_deg(&tcp.rotation), xyz_deg(&tcp.rotation));
        let vector: [f64; 3] = rotation_vector(&tcp.rotation).into();
        // Writing to a String cannot fail.
        let _ = writeln!(text, "position                      {}   mm", fixed(&mm, 4));
        let _ = writeln!(text, "quaternion q1…q4              {}", fixed(&quat, 8));
        let _ = writeln!(text, "ABB EulerZYX, KUKA A B C      {}   degrees, about z, y', x''", fixed(&zyx, 5));
        let [a, b, c] = zyx;
        let _ = writeln!(text, "FANUC W P R, Yaskawa Rx Ry Rz {}   degrees, about fixed x, y, z", fixed(&[c, b, a], 5));
        let _ = writeln!(text, "Stäubli Rx Ry Rz              {}   degrees, about x, y', z''", fixed(&xyz, 5));
        let _ = writeln!(text, "UR rotation vector            {}   rad", fixed(&vector, 6));
        let configuration = Configuration::of(robot, &motor);
        let (maker, words) = configuration.in_words(self.cell.language);
        let _ = writeln!(text, "{maker:32}{words}");
        let beyond = robot.limit_violation(&motor).map(|violation| violation.to_string());
        if let Some(beyond) = &beyond {
            let _ = writeln!(text, "beyond a limit: {beyond}");
        }
        let mut answer = json!({
            "joints_deg": axes_deg, "position_mm": mm, "quat": quat, "zyx_deg": zyx, "fixed_xyz_deg": [c, b, a], "xyz_deg": xyz,
            "rotation_vector_rad": vector, "beyond_limit": beyond,
        });
        configuration.add_to(&mut answer);
        Ok((text, answer))
    }

    /// The axis angles of every posture that reaches a TCP pose.
    fn joints(&self, wobj_from_tcp: &Pose) -> Result<(String, Value), Vec<Diagnostic>> {
        let robot = &self.cell.arm.robot;
        let base_from_flange = self.base_from_wobj * wobj_from_tcp * self.flange_from_tcp.inverse();
        let mut ways = robot.inverse_all(&base_from_flange).map_err(|error| {
            Diagnostic::error("pose.unreachable", "", format!("the target is not reached: {error}"))
                .help("check the work object, the tool and the robot of the cell")
        })?;
        // Sorts the postures so that the one nearest to the start of the arm is first.
        let from = self.cell.start.unwrap_or_else(|| robot.motor_from_axes_deg(&robot.home_deg()));
        ways.sort_by(|a, b| (a - from).norm_squared().total_cmp(&(b - from).norm_squared()));
        let mut text = String::new();
        let mut list = Vec::new();
        for motor in &ways {
            let (deg, configuration) = (robot.axes_deg_from_motor(motor), Configuration::of(robot, motor));
            let (maker, words) = configuration.in_words(self.cell.language);
            let _ = writeln!(text, "{}   {maker} {words}", fixed(&deg, 5));
            let mut way = json!({ "joints_deg": deg });
            configuration.add_to(&mut way);
            list.push(way);
        }
        Ok((text, json!({ "solutions": list })))
    }
}

/// The posture of the joints in the notation of each maker's controllers.
struct Configuration {
    quarters: Confdata,
    status: StatusAndTurn,
    turns: Config,
}

impl Configuration {
    fn of(robot: &Robot, motor: &Joints) -> Self {
        let quarters = confdata_of(robot, motor);
        let status = status_of(robot, motor);
        Self { quarters, status, turns: config_of(robot, motor) }
    }

    /// The notation that the cell's controller uses, with its name.
    fn in_words(&self, language: Option<Language>) -> (&'static str, String) {
        match language {
            Some(Language::Krl) => {
                let StatusAndTurn { status, turn } = self.status;
                ("KUKA S, T", format!("S {status}, T {turn}  (S 'B{status:03b}', T 'B{turn:06b}')"))
            }
            Some(Language::Ls) => ("FANUC CONFIG", format!("'{}'", self.turns)),
            Some(Language::Rapid | Language::Cl | Language::Ur | Language::Jbi) | None => {
                let Confdata { cf1, cf4, cf6, cfx } = self.quarters;
                ("ABB confdata", format!("[{cf1},{cf4},{cf6},{cfx}]"))
            }
        }
    }

    /// Adds all notations to an answer.
    fn add_to(&self, answer: &mut Value) {
        let (Confdata { cf1, cf4, cf6, cfx }, StatusAndTurn { status, turn }) = (self.quarters, self.status);
        answer["confdata"] = json!([cf1, cf4, cf6, cfx]);
        (answer["status"], answer["turn"]) = (status.into(), turn.into());
        answer["config"] = self.turns.to_string().into();
    }
}

/// Numbers in columns.
fn fixed(numbers: &[f64], decimals: usize) -> String {
    let columns: Vec<String> = numbers.iter().map(|value| format!("{:>12}", number::fixed(*value, decimals))).collect();
    columns.join(" ")
}
