use crate::{AxisName, EXTERNAL_AXES, External};
use deflex_lang::ir::SourceSpan;
pub use deflex_lang::run::Predecessor;
pub use deflex_lang::shared::Editable;
use deflex_text::Span;
use std::sync::Arc;

/// One point of a program's path, independent of the language and of robots.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// let target = &program.targets[0];
/// println!("line {}: {:?} with {:?} mm/s", target.line, target.motion, target.feed_mm_s);
/// assert!(target.is_end() && target.conf().is_some()); // no point of an arc, and with confdata
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Target {
    /// Ordinal of the executed motion, from 1; circle points and interpolated points have that of their arc.
    pub ordinal: u32,
    /// Whether this is the end of a motion or a point on its path.
    pub role: Role,
    /// Kind of the motion to the point.
    pub motion: Motion,
    /// The pose or the joints.
    pub goal: Goal,
    /// Index into [`Program::tools`](super::Program::tools).
    pub tool: u16,
    /// Index into [`Program::wobjs`](super::Program::wobjs).
    pub wobj: u16,
    /// Programmed speed of the TCP, mm/s; `None` if the text does not state it.
    pub feed_mm_s: Option<f64>,
    /// Spindle speed, 1/min, if the text states it (CL).
    pub spindle_rpm: Option<f64>,
    /// CL `RAPID`: never cuts.
    pub rapid: bool,
    /// `! deflex air`, `! deflex cut` and their CL forms, in force here.
    pub mark: Option<Mark>,
    /// The parts that a correction may change.
    pub editable: Editable,
    /// Whether the pose is known from the text, without regard to units that move base or work object; if not, `editable` has the reason.
    pub located: bool,
    /// Whether the arm carries, or may carry, a load in addition to that of the tool's data (`GripLoad`, `\\TLoad`).
    pub extra_load: bool,
    /// External axes, if any is in use or a mechanical unit is deactivated.
    pub external: Option<Arc<ExternalAxes>>,
    /// Name of the declared robtarget, if there is one.
    pub name: Option<Arc<str>>,
    /// Index into [`Program::sources`](super::Program::sources).
    pub source: u16,
    /// The instruction.
    pub span: Span,
    /// Line of the instruction, from 1.
    pub line: u32,
    /// Where the segment to it begins.
    pub predecessor: Predecessor,
    /// The position at which the segment begins, mm, with its tool and work object, if that is known and not the target before. Each path
    /// of a branch begins where the motion before the branch ends.
    pub begins_mm: Option<[f64; 3]>,
    /// How the controller turns the tool on the arc to it; `None` if the program does not state it.
    pub arc_turn: Option<ArcTurn>,
}

/// The position at which a motion ends, with the frames in which it is counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EndPosition {
    tool: u16,
    wobj: u16,
    at_mm: [f64; 3],
}

impl EndPosition {
    /// The position of a target; `None` for joint angles, and for a target from which the controller departs.
    pub(crate) fn of(target: &Target) -> Option<Self> {
        let Goal::Pose { position_mm: at_mm, .. } = target.goal else { return None };
        target.located.then_some(Self { tool: target.tool, wobj: target.wobj, at_mm })
    }
}

impl Target {
    /// States where a line begins that does not begin at the target before, if that is counted in its own frames.
    pub(crate) fn begin_at(&mut self, end: Option<EndPosition>) {
        let is_line = self.predecessor == Predecessor::Unknown && self.motion == Motion::Linear;
        let end = end.filter(|end| is_line && (end.tool, end.wobj) == (self.tool, self.wobj));
        self.begins_mm = end.map(|end| end.at_mm);
    }

    /// The end of a motion with this tool and work object, at a statement and its line.
    pub(crate) fn new(
        ordinal: u32,
        motion: Motion,
        goal: Goal,
        [tool, wobj]: [u16; 2],
        place: SourceSpan,
        line: u32,
    ) -> Self {
        Self {
            ordinal,
            role: Role::End,
            motion,
            goal,
            tool,
            wobj,
            feed_mm_s: None,
            spindle_rpm: None,
            rapid: false,
            mark: None,
            editable: Editable::Pose,
            located: true,
            extra_load: false,
            external: None,
            name: None,
            source: place.source,
            span: place.span,
            line,
            predecessor: Predecessor::Previous,
            begins_mm: None,
            arc_turn: None,
        }
    }

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

/// External axes at a target, as the program states them: mm or degrees.
///
/// # Examples
/// ```
/// use deflex_program::{AxisName, ExternalAxes};
///
/// let none = ExternalAxes::default(); // a robot without external axes
/// assert!(none.position(AxisName::External(0)).is_none() && none.is_at_rest());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ExternalAxes {
    /// eax_a … eax_f as written; `None` where not in use (9E9).
    pub written: [Option<f64>; EXTERNAL_AXES],
    /// Offsets that the controller adds (RAPID `EOffsSet`, `EOffsOn`).
    pub offset: External,
    /// Axes that are at zero in all of the program: programs of robots without external axes have zeros too (KRL).
    pub at_rest: [bool; EXTERNAL_AXES],
    /// Axes of other motion groups (FANUC TP).
    pub(crate) groups: Arc<[GroupAxis]>,
    /// Whether the path to the target is one in the frame that another motion group carries (FANUC TP `COORD`).
    pub coordinated: bool,
    /// Mechanical units that are deactivated here (RAPID `DeactUnit`).
    pub inactive: Arc<[InactiveUnit]>,
    /// Whether external axes have moved alone since the target before: the segment to this one begins elsewhere.
    pub moved_alone: bool,
}

impl ExternalAxes {
    /// Whether all axes are at zero in all of the program.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        let rests = |(written, at_rest): (&Option<f64>, bool)| written.is_none() || at_rest;
        self.groups.iter().all(|axis| axis.at_rest) && self.written.iter().zip(self.at_rest).all(rests)
    }

    /// Position to which the controller moves an axis; `None` if the axis is not in use.
    #[must_use]
    pub fn position(&self, axis: AxisName) -> Option<f64> {
        match axis {
            AxisName::External(axis) => self.written[axis].map(|written| written + self.offset[axis]),
            _ => self.groups.iter().find(|own| own.axis == axis)?.position,
        }
    }

    /// Sets the position of an axis, mm or degrees.
    #[doc(hidden)]
    pub fn put(&mut self, axis: AxisName, position: f64) {
        match axis {
            AxisName::External(axis) => self.written[axis] = Some(position),
            _ => {
                let others = self.groups.iter().copied().filter(|own| own.axis != axis);
                self.groups = others.chain([GroupAxis { axis, position: Some(position), at_rest: false }]).collect();
            }
        }
    }

    /// Axes for which the target has a position, except those at rest.
    #[doc(hidden)]
    pub fn used(&self) -> impl Iterator<Item = AxisName> + '_ {
        let own = (0..EXTERNAL_AXES).filter(|axis| self.written[*axis].is_some() && !self.at_rest[*axis]);
        own.map(AxisName::External).chain(self.groups.iter().filter(|axis| !axis.at_rest).map(|axis| axis.axis))
    }
}

/// The position of an axis of another motion group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GroupAxis {
    /// The axis; the whole group if the text has a pose of another arm.
    pub axis: AxisName,
    /// Position, mm or degrees; `None` if the program does not state it.
    pub position: Option<f64>,
    /// Whether it is at zero in all of the program.
    pub at_rest: bool,
}

/// A mechanical unit that does not move, even if targets state positions.
///
/// # Examples
/// ```
/// use deflex_program::InactiveUnit;
///
/// // A positioner that stands at 30 degrees of axis eax_b.
/// let mut stands = [None; 6];
/// stands[1] = Some(30.0);
/// let unit = InactiveUnit { name: "STN1".into(), stands };
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct InactiveUnit {
    /// Its name in the program.
    pub name: Arc<str>,
    /// Position of each axis when the unit was deactivated, if it is known; the unit's own axes stay there.
    pub stands: [Option<f64>; EXTERNAL_AXES],
}

/// The end of a motion, or a point on its path.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// use deflex_program::Role;
///
/// let ends = program.targets.iter().filter(|target| target.role == Role::End);
/// assert_eq!(ends.count(), program.targets.len()); // there are no arcs
/// ```
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
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// use deflex_program::Motion;
///
/// assert!(program.targets.iter().any(|target| target.motion == Motion::Linear));
/// ```
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

/// How a controller turns the tool along an arc.
///
/// # Examples
/// ```
/// use deflex_program::ArcTurn;
///
/// assert!(ArcTurn::WORDS.contains(&("path", ArcTurn::WithPath))); // as `[controller] arc_turn` of the cell has it
/// assert_eq!(ArcTurn::ThroughCirclePoint.word(), "circle_point");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ArcTurn {
    /// Evenly from the orientation at the start to that at the end (RAPID `CirPathMode\ObjectFrame`).
    #[default]
    Even,
    /// Evenly relative to the direction of the path, which turns with the arc (RAPID `CirPathMode\PathFrame`).
    WithPath,
    /// Evenly to the orientation of the circle point, and evenly from there to the end (RAPID `CirPathMode\CirPointOri`).
    ThroughCirclePoint,
    /// With the path, and not relative to its direction: the orientation at the end follows from that at the start (URScript `movec` with
    /// `mode=1`).
    Fixed,
}

impl ArcTurn {
    /// Those that a cell may state, with their words in the cell file.
    pub const WORDS: [(&'static str, Self); 3] =
        [("even", Self::Even), ("path", Self::WithPath), ("circle_point", Self::ThroughCirclePoint)];

    /// Its word in the cell file; empty if only a program may state it.
    #[must_use]
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, turn)| *turn == self).map_or("", |(word, _)| word)
    }
}

/// The pose or the joints of a target.
///
/// # Examples
/// ```
/// use deflex_program::Goal;
///
/// let goal = Goal::Pose { position_mm: [10.0, 0.0, -2.0], quat: [0.0, 1.0, 0.0, 0.0], conf: None };
/// assert!(matches!(goal, Goal::Pose { position_mm: [x, _, _], .. } if x == 10.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// A pose in the work object.
    Pose {
        /// TCP position, mm.
        position_mm: [f64; 3],
        /// Orientation, scalar first, unit norm (normalised on reading).
        quat: [f64; 4],
        /// Configuration, if it is written as numbers.
        conf: Option<Conf>,
    },
    /// Tool point and tool axis (tip to spindle) in the work object; the turn about the axis is free (CL).
    Axis {
        /// Tool point, mm.
        position_mm: [f64; 3],
        /// Unit vector from the tip towards the spindle.
        axis: [f64; 3],
        /// Unit normal of the surface at the contact, out of the material, if the text has it.
        normal: Option<[f64; 3]>,
    },
    /// Motor angles, degrees.
    Joints {
        /// Axes 1 to 6.
        deg: [f64; 6],
    },
}

/// The configuration as the language writes it: which of the axis angles that reach a pose are meant.
///
/// # Examples
/// ```
/// use deflex_program::{Conf, Confdata};
///
/// let conf = Conf::Quarters(Confdata { cf1: 0, cf4: -1, cf6: 0, cfx: 1 });
/// assert!(matches!(conf, Conf::Quarters(_)));
/// assert_eq!(Conf::near([0.0, 90.0, 0.0, 0.0, 30.0, 0.0]), Conf::Near([0, 900_000, 0, 0, 300_000, 0]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Conf {
    /// RAPID.
    Quarters(Confdata),
    /// FANUC TP.
    Turns(Config),
    /// KUKA KRL.
    Status(StatusAndTurn),
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

/// KUKA `S` and `T` of a position, which decide the posture of joint motions.
///
/// `S`: bit 0, wrist centre on the rear side of axis 1; bit 1, wrist centre in front of the lower arm, which is the usual side; bit 2,
/// axis 5 below zero. `T`: bit n − 1, axis n below zero. Other bits have other meanings and are kept. Source: KUKA, Operating and
/// Programming Instructions for System Integrators, *Status and Turn*; taught points of public programs, where bit 2 of `S` is bit 4 of `T`.
///
/// # Examples
/// ```
/// use deflex_program::StatusAndTurn;
///
/// let written = StatusAndTurn { status: 2, turn: 35 }; // S 2, T 35
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct StatusAndTurn {
    /// `S`
    pub status: i32,
    /// `T`
    pub turn: i32,
}

/// FANUC `CONFIG : 'F D B, t1, t4, t6'`.
///
/// Its letters are the three signs of RAPID's cfx: F, axis 5 above zero as the controller counts it; D, wrist centre on the rear side of
/// the lower arm; B, wrist centre on the rear side of axis 1. Source: FANUC, R-30iB Operator's Manual, position data; the CONFIG that a controller
/// computes at the postures of an ABB arm (GitHub, LeroyDu56/CrossArm: validation on virtual controllers, section 14).
///
/// # Examples
/// ```
/// use deflex_program::Config;
///
/// let written = Config { posture: 1, turns: [0, 0, 0] }; // 'F U T, 0, 0, 0'
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Config {
    /// 4·(B) + 2·(D) + (F), as [`Confdata::cfx`].
    pub posture: i32,
    /// Turn numbers of axes 1, 4, 6: 0 between −180° and 180° without these, 1 from 180° on, −1 from −180° down.
    pub turns: [i32; 3],
}

impl std::fmt::Display for Config {
    /// Writes the text between the quotes of `CONFIG`.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let letter = |bit: i32, yes: char, no: char| if self.posture & bit == 0 { no } else { yes };
        let (flip, down, back) = (letter(1, 'F', 'N'), letter(2, 'D', 'U'), letter(4, 'B', 'T'));
        let [t1, t4, t6] = self.turns;
        write!(out, "{flip} {down} {back}, {t1}, {t4}, {t6}")
    }
}

/// RAPID confdata `[cf1, cf4, cf6, cfx]`.
///
/// # Examples
/// ```
/// use deflex_program::Confdata;
///
/// let written = Confdata { cf1: 0, cf4: -1, cf6: 0, cfx: 1 }; // [0,-1,0,1]
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Confdata {
    /// Quarter turn of axis 1.
    pub cf1: i32,
    /// Quarter turn of axis 4.
    pub cf4: i32,
    /// Quarter turn of axis 6.
    pub cf6: i32,
    /// 4·(wrist centre on the rear side of axis 1) + 2·(wrist centre on the rear side of the lower arm) + (axis 5 negative).
    pub cfx: i32,
}

/// A marker comment.
///
/// # Examples
/// ```
/// use deflex_program::{Mark, rapid};
/// use deflex_text::Source;
///
/// let text = String::from_utf8_lossy(&std::fs::read("../../samples/slot/slot.mod")?).replacen("MoveL", "! deflex air\nMoveL", 1);
/// let program = rapid::read(vec![Source::new("slot.mod", text)], vec![])?;
/// assert!(program.targets.iter().any(|target| target.mark == Some(Mark::Air)));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// No cutting force on this stretch.
    Air,
    /// A cut, even if the other rules say otherwise.
    Cut,
}

impl Mark {
    /// The mark that a comment is: its text without the sign that begins it.
    pub(crate) fn of(comment: &[u8]) -> Option<Self> {
        // Control characters and no-break spaces part words in real files, too.
        let mut words = comment.split(|b| *b <= b' ' || matches!(b, 0x7F | 0xA0)).filter(|word| !word.is_empty());
        words.next().filter(|word| word.eq_ignore_ascii_case(b"deflex"))?;
        let kind = words.next()?;
        [(&b"air"[..], Self::Air), (b"cut", Self::Cut)]
            .into_iter()
            .find(|(word, _)| kind.eq_ignore_ascii_case(word))
            .map(|found| found.1)
    }

    /// The text of the comment for this mark.
    pub(crate) fn comment(self) -> &'static str {
        match self {
            Self::Air => "deflex air",
            Self::Cut => "deflex cut",
        }
    }
}
