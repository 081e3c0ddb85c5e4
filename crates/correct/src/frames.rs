//! Tools and work objects of a program, from the program itself or from the cell, in SI.

use super::{KeptReason, Options};
use deflex_cell::{Cell, nearest};
use deflex_effects::ToolFrame;
use deflex_program::{Editable, Language, Program, Target, ToolData, Wobj, WobjData};
use deflex_robot::Pose;
use deflex_text::Diagnostic;
use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};

/// Pose from millimetres and a quaternion, scalar first.
pub(super) fn pose(position_mm: [f64; 3], quat: [f64; 4]) -> Pose {
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(quat[0], quat[1], quat[2], quat[3]));
    let [x, y, z] = position_mm.map(|v| 1e-3 * v);
    Pose::from_parts(Translation3::new(x, y, z), rotation.to_rotation_matrix())
}

/// Millimetres and a quaternion, scalar first, from a pose.
pub(super) fn millimetres(pose: &Pose) -> ([f64; 3], [f64; 4]) {
    let quat = UnitQuaternion::from_rotation_matrix(&pose.rotation);
    ((pose.translation.vector * 1e3).into(), [quat.w, quat.i, quat.j, quat.k])
}

pub(super) fn tool_frame(data: &ToolData) -> ToolFrame {
    ToolFrame {
        flange_from_tcp: pose(data.tcp_mm, data.tcp_quat),
        mass: data.mass_kg,
        cog: Vector3::from(data.cog_mm) * 1e-3,
    }
}

pub(super) fn object_frame(data: &WobjData) -> Pose {
    pose(data.uframe_mm, data.uframe_quat) * pose(data.oframe_mm, data.oframe_quat)
}

/// The beginning of a help text if a declared name is similar. Names are in upper case: RAPID does not distinguish case.
fn meant(name: &str, declared: &[&str]) -> String {
    nearest(name, declared.iter().copied()).map_or_else(String::new, |near| format!("did you mean `{near}`? "))
}

/// A name as a key of TOML: in quotes if it is more than a word.
fn key(name: &str) -> String {
    let bare = name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
    if bare { name.to_owned() } else { format!("\"{name}\"") }
}

/// The end of a help text: the names that the cell declares.
#[doc(hidden)]
#[must_use]
pub fn declared_names(names: &[&str]) -> String {
    match names {
        [] => "the cell declares none".to_owned(),
        _ => format!("the cell declares {}", names.join(", ")),
    }
}

/// The tool that `--tool` names.
#[doc(hidden)]
pub fn named_tool(cell: &Cell, name: &str) -> Result<ToolFrame, Vec<Diagnostic>> {
    cell.tools.get(&name.to_ascii_uppercase()).copied().ok_or_else(|| {
        let known = cell.names_of(&cell.tools);
        Diagnostic::error("cell.unknown-tool", "", format!("--tool {name}: the cell declares no such tool"))
            .help(format!("{}{}", meant(name, &known), declared_names(&known)))
            .into()
    })
}

/// Every tool of the program by its index; a tool that no target uses may be missing.
pub(super) fn tools(
    program: &Program,
    cell: &Cell,
    options: &Options,
) -> Result<Vec<Option<ToolFrame>>, Vec<Diagnostic>> {
    let find = |name: &str| cell.tools.get(&name.to_ascii_uppercase()).copied();
    if let Some(name) = &options.tool {
        let tool = named_tool(cell, name)?;
        return Ok(vec![Some(tool); program.tools.len()]);
    }
    let mut errors = Vec::new();
    let tools = program.tools.iter().enumerate().map(|(i, tool)| {
        let own = tool.data.as_ref().map(tool_frame);
        let frame = match own.zip(find(&tool.name)) {
            Some((own, of_cell)) if !program.language.about().states_load => {
                Some(ToolFrame { flange_from_tcp: own.flange_from_tcp, ..of_cell })
            }
            _ => own.or_else(|| find(&tool.name)),
        };
        if frame.is_none() {
            let first = first_use(program, |target| usize::from(target.tool) == i);
            errors.extend(first.map(|target| {
                let near = meant(&tool.name, &cell.names_of(&cell.tools));
                undeclared(program, target, ["cell.unknown-tool", "tool", "tools"], &tool.name, &near)
            }));
        }
        frame
    });
    let tools = tools.collect();
    if errors.is_empty() { Ok(tools) } else { Err(errors) }
}

/// The object frame of a work object: in the world, or in the frame of the unit that moves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WobjFrame {
    /// Index of the unit.
    pub(super) unit: Option<usize>,
    pub(super) frame: Pose,
}

impl WobjFrame {
    /// In the world.
    pub(super) fn fixed(frame: Pose) -> Self {
        Self { unit: None, frame }
    }
}

/// A declared work object. `Err` has the reason why it is not solved: a unit moves it that the cell does not declare.
pub(super) type Declared = Result<WobjFrame, KeptReason>;

/// A work object of the cell.
pub(super) fn of_cell(cell: &Cell, name: &str) -> Option<WobjFrame> {
    let name = name.to_ascii_uppercase();
    let frame = *cell.wobjs.get(&name)?;
    Some(WobjFrame { unit: cell.wobj_units.get(&name).copied(), frame })
}

/// A work object of the program, as program or cell declare it.
fn declared(wobj: &Wobj, cell: &Cell, language: Language) -> Option<Declared> {
    let Some(data) = &wobj.data else {
        // If the controller counts from the robot's base, the cell states the pose of the base.
        let is_base = language.robot_base().is_some_and(|base| wobj.name.eq_ignore_ascii_case(base));
        let base = || is_base.then(|| WobjFrame::fixed(cell.arm.robot.world_from_base));
        return of_cell(cell, &wobj.name).or_else(base).map(Ok);
    };
    Some(match &wobj.unit {
        None => Ok(WobjFrame::fixed(object_frame(data))),
        Some(name) => match cell.units.named(name) {
            unit @ Some(_) => Ok(WobjFrame { unit, frame: pose(data.oframe_mm, data.oframe_quat) }),
            None => Err(KeptReason::WobjWithoutUnit),
        },
    })
}

/// Every work object of the program by its index.
pub(super) fn wobjs(program: &Program, cell: &Cell) -> Result<Vec<Option<Declared>>, Vec<Diagnostic>> {
    let mut errors = Vec::new();
    let wobjs = program.wobjs.iter().enumerate().map(|(i, wobj)| {
        let frame = declared(wobj, cell, program.language);
        if frame.is_none() {
            let first = first_use(program, |target| usize::from(target.wobj) == i);
            errors.extend(first.map(|target| {
                let near = meant(&wobj.name, &cell.names_of(&cell.wobjs));
                undeclared(program, target, ["cell.unknown-wobj", "work object", "wobjs"], &wobj.name, &near)
            }));
        }
        frame
    });
    let wobjs = wobjs.collect();
    if errors.is_empty() { Ok(wobjs) } else { Err(errors) }
}

/// A work object by its name.
pub(super) fn wobj(program: &Program, cell: &Cell, name: &str) -> Option<WobjFrame> {
    let of_program = program.wobjs.iter().find(|wobj| wobj.name.eq_ignore_ascii_case(name));
    let of_program = of_program.and_then(|wobj| declared(wobj, cell, program.language)?.ok());
    of_program.or_else(|| of_cell(cell, name))
}

/// The first target that uses something and could be changed.
fn first_use(program: &Program, uses: impl Fn(&Target) -> bool) -> Option<&Target> {
    program.targets.iter().find(|target| uses(target) && !matches!(target.editable, Editable::No(_)))
}

/// The error at a target whose tool or work object is not declared: its code, the word for what is missing, and its table in the cell. `near`
/// is the question whether another name is meant.
fn undeclared(
    program: &Program,
    target: &Target,
    [code, what, table]: [&'static str; 3],
    name: &str,
    near: &str,
) -> Diagnostic {
    let message = format!("{what} `{name}` is declared neither in the program nor in the cell");
    let help = format!("{near}add [{table}.{}] to the cell{}", key(name), program.language.about().or_context);
    program.error_at(target, code, message).help(help)
}
