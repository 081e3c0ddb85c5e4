//! Why a target stays as the program has it.

use deflex_program::{Language, Mark, Reason};
use serde::{Serialize, Serializer};
use std::fmt;

/// Why a target is kept or cannot be judged. [`Display`](fmt::Display) prints the phrase of the report's column `reason`.
///
/// ```
/// use deflex_correct::KeptReason;
/// use deflex_program::Reason;
///
/// assert_eq!(KeptReason::Program(Reason::Joints).to_string(), "joint target");
/// assert_eq!(KeptReason::Misfit.text(), "tool and work object are both held by the robot, or neither is");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum KeptReason {
    /// The program does not say where the motion goes, or its numbers cannot be edited.
    Program(Reason),
    /// The cutting force and lost motion depend on the point where the path to the target begins, which is not known.
    PredecessorUnknown,
    /// Whether the motion cuts, or the force of its cut, depends on the speed, which is known only at run time.
    CutUnknown,
    /// An external axis moves that no `[[unit]]` of the cell declares.
    AxisWithoutUnit,
    /// An axis of this motion group (2 to 9) moves that no `[[unit]]` of the cell declares.
    GroupWithoutUnit(u8),
    /// The work object is on a unit that no `[[unit]]` of the cell declares.
    WobjWithoutUnit,
    /// FANUC: the coordinated group does not carry the user frame of the motion.
    CoordinatedElsewhere,
    /// FANUC: the group that carries the user frame moves, and the motion does not follow it.
    NotCoordinated,
    /// A unit that carries the robot or the work object has no position in the program here.
    UnitPositionMissing,
    /// RAPID: the unit is deactivated, and where it was deactivated is not known.
    UnitDeactivated,
    /// A stationary tool needs a part that the robot holds, and any other tool a part that it does not hold.
    Misfit,
    /// `check` refused the program that the target is in.
    ProgramRefused,
}

/// How many targets were kept, or not judged, for a reason.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// for kept in deflex_correct::Summary::of(&corrected.rows).kept {
///     println!("{} targets: {}", kept.count, kept.reason);
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct KeptCount {
    /// Reason.
    pub reason: KeptReason,
    /// Targets.
    pub count: usize,
}

impl KeptReason {
    /// A fixed phrase, which reports count.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Program(reason) => reason.text(),
            Self::PredecessorUnknown => "the path to it begins at a point that is known only at run time",
            Self::CutUnknown => "its cut depends on its speed, which is known only at run time",
            Self::AxisWithoutUnit => "external axis in use without a [[unit]] in the cell",
            Self::GroupWithoutUnit(group) => match group {
                2 => "motion group 2 in use without a [[unit]] in the cell (axis = \"gp2_j1\", …)",
                3 => "motion group 3 in use without a [[unit]] in the cell (axis = \"gp3_j1\", …)",
                4 => "motion group 4 in use without a [[unit]] in the cell (axis = \"gp4_j1\", …)",
                5 => "motion group 5 in use without a [[unit]] in the cell (axis = \"gp5_j1\", …)",
                6 => "motion group 6 in use without a [[unit]] in the cell (axis = \"gp6_j1\", …)",
                7 => "motion group 7 in use without a [[unit]] in the cell (axis = \"gp7_j1\", …)",
                8 => "motion group 8 in use without a [[unit]] in the cell (axis = \"gp8_j1\", …)",
                _ => "motion group 9 in use without a [[unit]] in the cell (axis = \"gp9_j1\", …)",
            },
            Self::WobjWithoutUnit => "work object on a mechanical unit without a [[unit]] in the cell",
            Self::CoordinatedElsewhere => {
                "coordinated (COORD) with a motion group that moves, and does not carry its user frame"
            }
            Self::NotCoordinated => {
                "the motion group that carries its user frame moves, and the motion is not coordinated (COORD)"
            }
            Self::UnitPositionMissing => "position of a mechanical unit is not programmed here",
            Self::UnitDeactivated => "the position of a deactivated mechanical unit is not known",
            Self::Misfit => "tool and work object are both held by the robot, or neither is",
            Self::ProgramRefused => "in a program that `check` refused because of another target",
        }
    }

    /// What the user can do about it, where the cell or one more motion would help.
    pub(super) fn help(self, language: Language) -> Option<String> {
        let help = match self {
            Self::PredecessorUnknown => {
                return Some(format!(
                    "put a motion that does not cut, to a known target, before it, or mark it `{}`",
                    language.mark(Mark::Air)
                ));
            }
            Self::CutUnknown => {
                let [cut, air] = [Mark::Cut, Mark::Air].map(|mark| language.mark(mark));
                return Some(format!(
                    "mark the motion `{air}`, or mark it `{cut}` and give feed_per_tooth_mm where the cell declares its engagement"
                ));
            }
            Self::AxisWithoutUnit => {
                "declare what the axis moves: [[unit]] with its name, axis, kind and what it carries"
            }
            Self::GroupWithoutUnit(_) => {
                "declare each axis: [[unit]] with carries = \"part\", or \"nothing\" for a gun, a gripper or another arm"
            }
            Self::WobjWithoutUnit => "declare the unit that ufmec names: [[unit]] with its axis, kind and base",
            Self::CoordinatedElsewhere => {
                "put the user frame on the unit where it moves along with it: [wobjs.\"UF 1\"] unit = …"
            }
            Self::NotCoordinated => "keep the group still during the motion, or move it with a J motion",
            Self::UnitPositionMissing => {
                "give every target the position of each unit that carries the robot or its work object"
            }
            Self::UnitDeactivated => "a deactivated unit stays at its position in the last target before DeactUnit",
            Self::Program(Reason::NameUndeclared) => {
                let companion = language.about().companion.map_or_else(String::new, |ending| {
                    format!(": the .{ending} of the same name is read with the program where it is in the same folder")
                });
                return Some(format!("give the file that declares it with the program, or with --context{companion}"));
            }
            Self::Program(_) | Self::Misfit | Self::ProgramRefused => return None,
        };
        Some(help.to_owned())
    }
}

impl From<Reason> for KeptReason {
    fn from(reason: Reason) -> Self {
        Self::Program(reason)
    }
}

impl fmt::Display for KeptReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

impl Serialize for KeptReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.text())
    }
}
