use crate::program::{AxisName, EXTERNAL_AXES, External, Reason};
use crate::text::Span;
use std::sync::Arc;

/// One point that the controller is sent to, free of language and of robots.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Target {
    /// Ordinal of the executed motion, from 1; via and interpolated points carry that of their arc.
    pub ordinal: u32,
    /// Whether this is a motion's end or a point on its way.
    pub role: Role,
    /// Kind of motion into the point.
    pub motion: Motion,
    /// Where to.
    pub goal: Goal,
    /// Index into [`Program::tools`](super::Program::tools).
    pub tool: u16,
    /// Index into [`Program::wobjs`](super::Program::wobjs).
    pub wobj: u16,
    /// Programmed speed of the TCP, mm/s; `None` where the text does not say.
    pub feed_mm_s: Option<f64>,
    /// Spindle speed, 1/min, where the text says (CL).
    pub spindle_rpm: Option<f64>,
    /// CL `RAPID`: never cuts.
    pub rapid: bool,
    /// `! deflex air`, `! deflex cut` and their CL forms, in force here.
    pub mark: Option<Mark>,
    /// What a correction may change.
    pub editable: Editable,
    /// Whether the text says where the controller goes, units that move base or work object aside; else `editable` says why not.
    pub located: bool,
    /// Whether the arm carries, or may carry, a load besides that of the tool's own data (`GripLoad`, `\\TLoad`).
    pub extra_load: bool,
    /// External axes, where any is in use or a mechanical unit is deactivated.
    pub external: Option<Arc<ExternalAxes>>,
    /// Name of the declared robtarget, where there is one.
    pub name: Option<Arc<str>>,
    /// Index into [`Program::sources`](super::Program::sources).
    pub source: u16,
    /// The instruction.
    pub span: Span,
    /// Line of the instruction, from 1.
    pub line: u32,
    /// Where the way into it begins.
    pub predecessor: Predecessor,
}

/// Where the way into a point begins, in every run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Predecessor {
    /// At the point before it.
    #[default]
    Previous,
    /// Where the robot stands when somebody starts the routine.
    Start,
    /// It is known only at run time: another branch, another round of a loop, or a motion that is not known comes before.
    Unknown,
}

impl Target {
    /// Whether it ends an executed motion: one report row.
    #[must_use]
    pub fn is_end(&self) -> bool {
        self.role == Role::End
    }

    /// Its configuration as written.
    #[must_use]
    pub fn conf(&self) -> Option<Conf> {
        match self.goal {
            Goal::Pose { conf, .. } => conf,
            Goal::Axis { .. } | Goal::Joints { .. } => None,
        }
    }
}

/// External axes at a target, as far as the program says: mm or degrees.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ExternalAxes {
    /// eax_a … eax_f as written; `None` where not in use (9E9).
    pub written: [Option<f64>; EXTERNAL_AXES],
    /// What the controller adds (RAPID `EOffsSet`, `EOffsOn`).
    pub offset: External,
    /// Axes at zero in all of the program: programs of robots without any have zeros too (KRL).
    pub at_rest: [bool; EXTERNAL_AXES],
    /// Axes of other motion groups (FANUC TP).
    pub groups: Arc<[GroupAxis]>,
    /// The way into the target is one in what another motion group carries (FANUC TP `COORD`).
    pub coordinated: bool,
    /// Mechanical units that are deactivated here (RAPID `DeactUnit`).
    pub inactive: Arc<[InactiveUnit]>,
    /// Whether the axes have moved by themselves since the target before: the way into this one begins elsewhere.
    pub moved_alone: bool,
}

impl ExternalAxes {
    /// Whether no axis is anywhere else than at zero in all of the program.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        let rests = |(written, at_rest): (&Option<f64>, bool)| written.is_none() || at_rest;
        self.groups.iter().all(|axis| axis.at_rest) && self.written.iter().zip(self.at_rest).all(rests)
    }

    /// Where the controller sends an axis; `None` where it is not in use.
    #[must_use]
    pub fn position(&self, axis: AxisName) -> Option<f64> {
        match axis {
            AxisName::External(axis) => self.written[axis].map(|written| written + self.offset[axis]),
            _ => self.groups.iter().find(|own| own.axis == axis)?.position,
        }
    }

    /// Sends an axis somewhere, mm or degrees.
    pub(crate) fn put(&mut self, axis: AxisName, position: f64) {
        match axis {
            AxisName::External(axis) => self.written[axis] = Some(position),
            _ => {
                let others = self.groups.iter().copied().filter(|own| own.axis != axis);
                self.groups = others.chain([GroupAxis { axis, position: Some(position), at_rest: false }]).collect();
            }
        }
    }

    /// Axes that the target sends somewhere, those at rest aside.
    pub(crate) fn used(&self) -> impl Iterator<Item = AxisName> + '_ {
        let own = (0..EXTERNAL_AXES).filter(|axis| self.written[*axis].is_some() && !self.at_rest[*axis]);
        own.map(AxisName::External).chain(self.groups.iter().filter(|axis| !axis.at_rest).map(|axis| axis.axis))
    }
}

/// Where an axis of another motion group is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupAxis {
    /// The axis; the whole group where a pose of another arm is written.
    pub axis: AxisName,
    /// mm or degrees; `None` where the program does not say.
    pub position: Option<f64>,
    /// At zero in all of the program.
    pub at_rest: bool,
}

/// A mechanical unit that does not move, whatever targets say.
#[derive(Clone, Debug, PartialEq)]
pub struct InactiveUnit {
    /// As the program names it.
    pub name: Arc<str>,
    /// Where each axis stood when it was deactivated, as far as the program says; its own ones stay there.
    pub stands: [Option<f64>; EXTERNAL_AXES],
}

/// A motion's end, or a point on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// The end of an executed motion: one report row, one ordinal.
    End,
    /// A circle point (RAPID `MoveC` CirPoint).
    Via,
    /// A point made by linearising an arc (CL).
    Interpolated,
}

/// Kind of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Motion {
    /// Straight (`MoveL` and relatives, `GOTO`).
    Linear,
    /// Joint-interpolated to a pose (`MoveJ` and relatives): never cuts.
    Joint,
    /// On a circle (`MoveC` and relatives).
    Circular,
    /// Joint-interpolated to joint angles (`MoveAbsJ`): never cuts.
    AbsoluteJoint,
}

/// Where a target is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// A pose in the work object.
    Pose {
        /// TCP position, mm.
        position_mm: [f64; 3],
        /// Orientation, scalar first, unit norm (normalised on reading).
        quat: [f64; 4],
        /// Configuration, where written as numbers.
        conf: Option<Conf>,
    },
    /// Tool point and tool axis (tip to spindle) in the work object: the turn about the axis is free (CL).
    Axis {
        /// Tool point, mm.
        position_mm: [f64; 3],
        /// Unit vector from the tip towards the spindle.
        axis: [f64; 3],
        /// Unit normal of the surface at the contact, out of the material, where the text prints it.
        normal: Option<[f64; 3]>,
    },
    /// Motor angles, degrees.
    Joints {
        /// Axes 1 to 6.
        deg: [f64; 6],
    },
}

/// Which of the axis angles that reach a pose are meant, as the language writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Conf {
    /// RAPID.
    Quarters(Confdata),
    /// FANUC TP.
    Turns(Config),
    /// KUKA KRL.
    Status(Status),
    /// The solution that is nearest to these axis angles, ten-thousandths of a degree (URScript `qnear`).
    Near([i32; 6]),
}

impl Conf {
    /// The solution that is nearest to axis angles, degrees.
    #[must_use]
    pub fn near(deg: [f64; 6]) -> Self {
        #[allow(clippy::cast_possible_truncation)] // a cast of a float saturates
        Self::Near(deg.map(|deg| (deg * 1e4).round() as i32))
    }
}

/// KUKA `S` and `T` of a position, which joint motions go by.
///
/// `S`: bit 0, wrist centre behind axis 1; bit 1, set where it is before the lower arm, which is the usual side; bit 2, axis 5 below
/// zero. `T`: bit n − 1, axis n below zero. Bits beyond these are somebody else's and stay. Source: KUKA, Operating and
/// Programming Instructions for System Integrators, *Status and Turn*; taught points of public programs, where bit 2 of `S` is bit 4 of `T`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Status {
    /// `S`
    pub status: i32,
    /// `T`
    pub turn: i32,
}

/// FANUC `CONFIG : 'F D B, t1, t4, t6'`.
///
/// Its letters are the three signs of RAPID's cfx: F, axis 5 above zero as the controller counts it; D, the wrist centre behind
/// the lower arm; B, behind axis 1. Source: FANUC, R-30iB Operator's Manual, position data; the CONFIG that a controller
/// computes at the postures of an ABB arm (GitHub, LeroyDu56/CrossArm: validation on virtual controllers, section 14).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Config {
    /// 4·(B) + 2·(D) + (F), as [`Confdata::cfx`].
    pub posture: i32,
    /// Turn numbers of axes 1, 4, 6: 0 between −180° and 180° without these, 1 from 180° on, −1 from −180° down.
    pub turns: [i32; 3],
}

impl std::fmt::Display for Config {
    /// As `CONFIG` has it between its quotes.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let letter = |bit: i32, yes: char, no: char| if self.posture & bit == 0 { no } else { yes };
        let (flip, down, back) = (letter(1, 'F', 'N'), letter(2, 'D', 'U'), letter(4, 'B', 'T'));
        let [t1, t4, t6] = self.turns;
        write!(out, "{flip} {down} {back}, {t1}, {t4}, {t6}")
    }
}

/// RAPID confdata `[cf1, cf4, cf6, cfx]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Confdata {
    /// Quarter turn of axis 1.
    pub cf1: i32,
    /// Quarter turn of axis 4.
    pub cf4: i32,
    /// Quarter turn of axis 6.
    pub cf6: i32,
    /// 4·(wrist centre behind axis 1) + 2·(wrist centre behind the lower arm) + (axis 5 negative).
    pub cfx: i32,
}

/// A marker comment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// No cutting force on this stretch.
    Air,
    /// Cuts, whatever the other rules say.
    Cut,
}

impl Mark {
    /// What the comment of a program says that is the mark.
    pub(crate) fn comment(self) -> &'static str {
        match self {
            Self::Air => "deflex air",
            Self::Cut => "deflex cut",
        }
    }
}

/// What of a target may be edited in the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Editable {
    /// Position and orientation.
    Pose,
    /// Position only (literal `Offs` or `RelTool` arguments).
    Position,
    /// Nothing, for this reason.
    No(Reason),
}
