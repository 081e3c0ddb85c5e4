//! Builds the targets of a run.

use super::position::Position;
use crate::ends::Ends;
use crate::kept::KeptStatements;
use crate::{AxisName, EXTERNAL_AXES, Reason};
use crate::{Editable, Role, Target, Tool, UnknownMotion, Wobj};
use deflex_lang::tp::{Code, Held, Motion, Point};
use deflex_text::Source;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// The position of a target, if it may be edited: an index into the positions.
pub(super) type EditablePosition = Option<u32>;

/// The targets of one arc, including its circle points; they are edited together or not at all.
pub(super) type Points = Range<usize>;

/// A circle point between two `A` motions, which is not in the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Between {
    /// Index of its target.
    pub(super) target: usize,
    /// The three targets through which its circle goes, in running order.
    pub(super) circle: [usize; 3],
    /// Whether it is on the path to the second of them, and not to the third.
    pub(super) first_half: bool,
}

/// An executed motion.
#[derive(Clone, Copy)]
pub(super) struct Visit<'a> {
    /// Its index among the executed motions.
    pub(super) run: usize,
    /// Its statement.
    pub(super) at: usize,
    pub(super) motion: &'a Motion<'a>,
    pub(super) held: Held<'a>,
}

impl Visit<'_> {
    /// The number of the position in a role; `Err` if it does not go to a position.
    pub(super) fn number(&self, role: Role) -> Result<Option<u32>, Reason> {
        let (point, number) = match (role, self.motion.via) {
            (Role::Via, Some(via)) => (via, self.held.via()),
            _ => (self.motion.end, self.held.end()),
        };
        match point {
            Point::Position(_) => Ok(number),
            Point::Register(_) => Err(Reason::PositionRegister),
            Point::RunTime(why) => Err(why),
        }
    }

    pub(super) fn roles(&self) -> &'static [Role] {
        if self.motion.via.is_some() { &[Role::Via, Role::End] } else { &[Role::End] }
    }
}

/// The results of a run.
#[derive(Debug, Default)]
pub(super) struct Built {
    pub(super) targets: Vec<Target>,
    /// One for each target.
    pub(super) sites: Vec<EditablePosition>,
    pub(super) tools: Vec<Tool>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) kept: KeptStatements,
    pub(super) motions: usize,
    pub(super) arcs: usize,
    /// Targets that end at a distance from their position in the axes of the tool (`Tool_Offset`).
    pub(super) in_tool: BTreeSet<usize>,
    /// The targets of each arc.
    pub(super) points: Vec<Points>,
    /// Circle points that are not in the text.
    pub(super) between: Vec<Between>,
    /// The statement of the first motion to a position of which the number is unknown.
    pub(super) anywhere: Option<usize>,
    /// Motions without a target.
    pub(super) unknown: Vec<UnknownMotion>,
}

/// Builds targets from executed motions.
pub(super) struct Builder<'a> {
    pub(super) code: &'a Code<'a>,
    pub(super) positions: &'a [Position],
    /// Index of the position with each number; the second one if a number occurs twice.
    pub(super) numbers: BTreeMap<u32, (usize, bool)>,
    /// Positions that must not be edited because of other uses, with the reason.
    pub(super) frozen: BTreeMap<usize, Reason>,
    /// The reason why no position may be edited.
    pub(super) all_frozen: Option<Reason>,
    /// Numbers of the positions to which the program assigns values; `None` if a number is known only at run time.
    pub(super) assigned: BTreeSet<Option<u32>>,
    /// External axes that are not zero in some position.
    pub(super) axes: [bool; EXTERNAL_AXES],
    /// Axes of other motion groups that are not zero in some position.
    pub(super) groups: BTreeSet<AxisName>,
    /// Index of the last executed motion that has a target.
    pub(super) last: Option<usize>,
    pub(super) ends: Ends<'a>,
    pub(super) built: Built,
}

impl<'a> Builder<'a> {
    pub(super) fn new(source: &Source, code: &'a Code<'a>, positions: &'a [Position]) -> Self {
        let mut numbers = BTreeMap::new();
        for (at, position) in positions.iter().enumerate() {
            numbers.entry(position.number).and_modify(|(_, twice)| *twice = true).or_insert((at, false));
        }
        Self {
            code,
            positions,
            numbers,
            frozen: BTreeMap::new(),
            all_frozen: None,
            assigned: BTreeSet::new(),
            axes: std::array::from_fn(|i| {
                positions.iter().any(|position| position.external[i].is_some_and(|value| value != 0.0))
            }),
            groups: positions
                .iter()
                .flat_map(|position| &position.groups)
                .filter(|axis| axis.position != Some(0.0))
                .map(|axis| axis.axis)
                .collect(),
            last: None,
            ends: Ends::default(),
            built: Built { kept: KeptStatements::new(std::slice::from_ref(source), 1), ..Built::default() },
        }
    }
}

pub(super) fn are_in_one_frame(points: &[(Target, EditablePosition)]) -> bool {
    points.windows(2).all(|two| (two[0].0.tool, two[0].0.wobj) == (two[1].0.tool, two[1].0.wobj))
}

pub(super) fn refuse(target: &mut Target, why: Reason) {
    if !matches!(target.editable, Editable::No(_)) {
        target.editable = Editable::No(why);
    }
}
