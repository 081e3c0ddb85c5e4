//! The modal state: everything except data that instructions leave in force.

use super::lasting::{Lasting, LastingStates};
use super::value::Value;
use super::values::Values;
use crate::target::EndPosition;
use crate::{ArcTurn, EXTERNAL_AXES, External, Goal, Mark, Reason, Target};
use std::collections::{BTreeMap, BTreeSet};

/// Whether a mode is switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum OnOff {
    #[default]
    Off,
    On,
    Unknown,
}

impl OnOff {
    fn join(self, other: Self) -> Self {
        if self == other { self } else { Self::Unknown }
    }
}

/// The factor and limit on programmed speeds (`VelSet`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Velocity {
    /// Share of the programmed speed.
    pub(super) share: f64,
    /// Highest TCP speed, mm/s.
    pub(super) most_mm_s: f64,
}

impl Velocity {
    /// The state at the start of a program.
    const AS_PROGRAMMED: Self = Self { share: 1.0, most_mm_s: f64::INFINITY };

    /// The commanded speed for a programmed one, mm/s.
    pub(super) fn of(self, programmed: f64) -> f64 {
        (self.share * programmed).min(self.most_mm_s)
    }
}

/// How the tool turns on arcs (`CirPathMode`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ArcMode {
    /// As the controller does if no instruction states it.
    #[default]
    Unstated,
    Stated(ArcTurn),
    /// By the wrist axes: only the controller knows the orientation between the points.
    ByWrist,
    Unknown,
}

impl ArcMode {
    /// Why the orientation on arcs cannot be followed.
    pub(super) fn unfollowed(self) -> Option<Reason> {
        match self {
            Self::Unstated | Self::Stated(_) => None,
            Self::ByWrist => Some(Reason::ArcByWrist),
            Self::Unknown => Some(Reason::ArcModeUnknown),
        }
    }

    fn join(self, other: Self) -> Self {
        if self == other { self } else { Self::Unknown }
    }
}

/// The state of the external axes; `None` for unknown values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes {
    /// Added by the controller, mm or degrees.
    pub(super) offset: Option<External>,
    /// The deactivated units, as an index into the runner's list of such sets.
    pub(super) inactive: Option<u32>,
    /// Their positions after the last motion, offset included.
    pub(super) positions: [Option<f64>; EXTERNAL_AXES],
}

impl Default for Axes {
    fn default() -> Self {
        Self { offset: Some([0.0; EXTERNAL_AXES]), inactive: Some(0), positions: [None; EXTERNAL_AXES] }
    }
}

impl Axes {
    /// The state after anything may have changed it.
    pub(super) const UNKNOWN: Self = Self { offset: None, inactive: None, positions: [None; EXTERNAL_AXES] };

    pub(super) fn join(self, other: Self) -> Self {
        Self {
            offset: self.offset.filter(|_| self.offset == other.offset),
            inactive: self.inactive.filter(|_| self.inactive == other.inactive),
            positions: std::array::from_fn(|i| self.positions[i].filter(|_| self.positions[i] == other.positions[i])),
        }
    }

    /// Makes the positions unknown, because the axes may have moved.
    pub(super) fn lose_positions(&mut self) {
        self.positions = [None; EXTERNAL_AXES];
    }
}

/// A statement in a chain of calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Site {
    /// The number of the chain.
    pub(super) calls: u32,
    pub(super) source: u16,
    /// Where the statement begins.
    pub(super) start: u32,
}

/// Where the robot stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Stands {
    /// Where it was when an operator started the routine.
    #[default]
    Start,
    /// At the end of a motion.
    At(Site),
    /// Known only at run time.
    Unknown,
}

/// A target at which the robot may stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Standing {
    pub(super) source: u16,
    /// Where the statement of its motion begins.
    pub(super) start: u32,
    /// The robtarget in the text from which it is made.
    pub(super) root: Option<u32>,
    pub(super) place: Place,
}

impl Standing {
    pub(super) fn at(target: &Target, root: Option<u32>) -> Self {
        let Target { tool, wobj, source, span, ref goal, .. } = *target;
        let mut at = [0.0; JOINTS];
        match goal {
            Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => at[..3].copy_from_slice(position_mm),
            Goal::Joints { deg } => at = *deg,
        }
        Self { source, start: span.start, root, place: Place { tool, wobj, at: at.map(f64::to_bits) } }
    }

    /// Whether it is by the same statement from the same robtarget, at whatever place.
    pub(super) fn is_of_same_motion(&self, other: &Self) -> bool {
        Self { place: other.place, ..*self } == *other
    }
}

/// Where a motion ends: its frames, and the bits of its position (mm) or its joints (°).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Place {
    tool: u16,
    wobj: u16,
    at: [u64; JOINTS],
}

/// Number of the arm's joints.
const JOINTS: usize = 6;

/// The state between two steps.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    /// Values that differ from those at the beginning, by number of the variable.
    pub(super) values: Values,
    pub(super) modal: ModalState,
    pub(super) stands: Stands,
    /// The position of the robot, as far as all paths to this state agree on it.
    pub(super) position: Option<EndPosition>,
    pub(super) standing: BTreeSet<Standing>,
    /// States in which a name may have different meanings have different numbers.
    pub(super) version: u64,
}

impl State {
    /// Makes the place of the robot unknown, because it may have moved.
    pub(super) fn lose_place(&mut self) {
        self.stands = Stands::Unknown;
        self.position = None;
    }
}

/// The modal state that the previous instructions leave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ModalState {
    pub(super) mark: Option<Mark>,
    /// The mark in force is known only at run time.
    pub(super) mark_unknown: bool,
    pub(super) displacement: OnOff,
    pub(super) axes: Axes,
    /// Whether axes yield (`SoftAct`).
    pub(super) soft: OnOff,
    /// Whether the robot grips a load other than `load0` (`GripLoad`).
    pub(super) load: OnOff,
    /// `None` if known only at run time.
    pub(super) velocity: Option<Velocity>,
    pub(super) arcs: ArcMode,
    /// Whether joint motions go to the nearest configuration instead of the programmed one (`ConfJ\Off`).
    pub(super) nearest: OnOff,
    /// The states that no instruction has set since the cycle began, on some path.
    pub(super) as_begun: LastingStates,
}

impl Default for ModalState {
    fn default() -> Self {
        Self {
            mark: None,
            mark_unknown: false,
            displacement: OnOff::Off,
            axes: Axes::default(),
            soft: OnOff::Off,
            load: OnOff::Off,
            velocity: Some(Velocity::AS_PROGRAMMED),
            arcs: ArcMode::default(),
            nearest: OnOff::Off,
            as_begun: LastingStates::all(),
        }
    }
}

impl ModalState {
    pub(super) fn join(self, other: Self) -> Self {
        Self {
            mark: self.mark,
            mark_unknown: self.mark_unknown || other.mark_unknown || self.mark != other.mark,
            displacement: self.displacement.join(other.displacement),
            axes: self.axes.join(other.axes),
            soft: self.soft.join(other.soft),
            load: self.load.join(other.load),
            velocity: self.velocity.filter(|_| self.velocity == other.velocity),
            arcs: self.arcs.join(other.arcs),
            nearest: self.nearest.join(other.nearest),
            as_begun: self.as_begun.union(other.as_begun),
        }
    }

    /// The lasting states that differ from those of another state.
    pub(super) fn differing(&self, other: &Self) -> LastingStates {
        LastingStates::of(|state| match state {
            Lasting::Displacement => self.displacement != other.displacement,
            Lasting::AxisOffset => self.axes.offset != other.axes.offset,
            Lasting::Units => self.axes.inactive != other.axes.inactive,
            Lasting::Softness => self.soft != other.soft,
            Lasting::Speed => self.velocity != other.velocity,
            Lasting::Arcs => self.arcs != other.arcs,
            Lasting::Configuration => self.nearest != other.nearest,
            Lasting::Load => self.load != other.load,
            Lasting::Mark => self.mark != other.mark || self.mark_unknown,
        })
    }

    /// Makes states unknown that may be set.
    pub(super) fn lose(&mut self, states: LastingStates) {
        for state in states.iter() {
            match state {
                Lasting::Displacement => self.displacement = OnOff::Unknown,
                Lasting::AxisOffset | Lasting::Units => self.axes = Axes::UNKNOWN,
                Lasting::Softness => self.soft = OnOff::Unknown,
                Lasting::Speed => self.velocity = None,
                Lasting::Arcs => self.arcs = ArcMode::Unknown,
                Lasting::Configuration => self.nearest = OnOff::Unknown,
                Lasting::Load => self.load = OnOff::Unknown,
                Lasting::Mark => self.mark_unknown = true,
            }
        }
    }
}

/// The declared values and the states on which `main` relies, and those that it leaves.
#[derive(Default)]
pub(super) struct Begun {
    /// Tools and work objects that the program assigns.
    pub(super) declared: BTreeMap<usize, Value>,
    /// Those that a motion uses before any path assigns them.
    pub(super) used: BTreeSet<usize>,
    /// Those that a motion uses before an instruction sets them on every path.
    pub(super) expected: LastingStates,
    /// Those that are not as at the beginning where the cycle may end.
    pub(super) left: LastingStates,
    /// Tools and work objects of which the same is true.
    pub(super) left_data: BTreeSet<usize>,
}
