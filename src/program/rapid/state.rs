//! What instructions leave in force besides data, and which of it statements may switch.

use super::value::Value;
use crate::program::Mark;
use crate::program::{EXTERNAL_AXES, External};
use std::collections::BTreeMap;
use std::ops::BitOrAssign;

/// Whether something is switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Switch {
    #[default]
    Off,
    On,
    Unknown,
}

impl Switch {
    fn join(self, other: Self) -> Self {
        if self == other { self } else { Self::Unknown }
    }
}

/// What becomes of programmed speeds (`VelSet`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Velocity {
    /// Share of the programmed speed.
    pub(super) share: f64,
    /// Highest TCP speed, mm/s.
    pub(super) most_mm_s: f64,
}

impl Velocity {
    /// As a program starts.
    const AS_PROGRAMMED: Self = Self { share: 1.0, most_mm_s: f64::INFINITY };

    /// What a programmed speed becomes, mm/s.
    pub(super) fn of(self, programmed: f64) -> f64 {
        (self.share * programmed).min(self.most_mm_s)
    }
}

/// What holds of external axes. What is not known is `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes {
    /// Added by the controller, mm or degrees.
    pub(super) offset: Option<External>,
    /// Which units are deactivated: an index into the list that the runner keeps of the sets it has met.
    pub(super) inactive: Option<u32>,
    /// Where the last motion left them, offset included.
    pub(super) positions: [Option<f64>; EXTERNAL_AXES],
}

impl Default for Axes {
    fn default() -> Self {
        Self { offset: Some([0.0; EXTERNAL_AXES]), inactive: Some(0), positions: [None; EXTERNAL_AXES] }
    }
}

impl Axes {
    /// Something may have changed any of it.
    pub(super) const UNKNOWN: Self = Self { offset: None, inactive: None, positions: [None; EXTERNAL_AXES] };

    pub(super) fn join(self, other: Self) -> Self {
        Self {
            offset: self.offset.filter(|_| self.offset == other.offset),
            inactive: self.inactive.filter(|_| self.inactive == other.inactive),
            positions: std::array::from_fn(|i| self.positions[i].filter(|_| self.positions[i] == other.positions[i])),
        }
    }

    /// They may have moved.
    pub(super) fn lose_positions(&mut self) {
        self.positions = [None; EXTERNAL_AXES];
    }
}

/// What the instructions before leave in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ModalState {
    pub(super) mark: Option<Mark>,
    /// Which mark holds is known only at run time.
    pub(super) mark_unknown: bool,
    pub(super) displacement: Switch,
    pub(super) axes: Axes,
    /// Whether axes yield (`SoftAct`).
    pub(super) soft: Switch,
    /// Whether the robot grips another load than `load0` (`GripLoad`).
    pub(super) load: Switch,
    /// `None` where it is known only at run time.
    pub(super) velocity: Option<Velocity>,
}

impl Default for ModalState {
    fn default() -> Self {
        Self {
            mark: None,
            mark_unknown: false,
            displacement: Switch::Off,
            axes: Axes::default(),
            soft: Switch::Off,
            load: Switch::Off,
            velocity: Some(Velocity::AS_PROGRAMMED),
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
        }
    }

    /// What may be switched is known no more.
    pub(super) fn lose(&mut self, switches: Switches) {
        let Switches { displacement, axes, marks, soft, load, velocity } = switches;
        if displacement {
            self.displacement = Switch::Unknown;
        }
        if axes {
            self.axes = Axes::UNKNOWN;
        }
        if soft {
            self.soft = Switch::Unknown;
        }
        if load {
            self.load = Switch::Unknown;
        }
        if velocity {
            self.velocity = None;
        }
        self.mark_unknown |= marks;
    }
}

/// What of the state some statements may switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Switches {
    /// Program displacement may be switched on.
    pub(super) displacement: bool,
    /// Offsets of external axes may be changed, or mechanical units activated.
    pub(super) axes: bool,
    /// `! deflex …` stands among them.
    pub(super) marks: bool,
    /// Axes may be made to yield.
    pub(super) soft: bool,
    /// Another load may be gripped.
    pub(super) load: bool,
    /// Programmed speeds may become others.
    pub(super) velocity: bool,
}

impl Switches {
    pub(super) const NONE: Self =
        Self { displacement: false, axes: false, marks: false, soft: false, load: false, velocity: false };
    /// What a routine may switch of which nothing is known: that it leaves speeds, servos and loads alone is assumed.
    pub(super) const FOREIGN: Self = Self { displacement: true, axes: true, ..Self::NONE };
    pub(super) const ALL: Self =
        Self { displacement: true, axes: true, marks: true, soft: true, load: true, velocity: true };
}

impl BitOrAssign for Switches {
    fn bitor_assign(&mut self, other: Self) {
        let Self { displacement, axes, marks, soft, load, velocity } = other;
        self.displacement |= displacement;
        self.axes |= axes;
        self.marks |= marks;
        self.soft |= soft;
        self.load |= load;
        self.velocity |= velocity;
    }
}

/// What `main` finds as the text declares it.
#[derive(Default)]
pub(super) struct Begun {
    /// Tools and work objects that the program assigns, but not yet in every run.
    pub(super) declared: BTreeMap<usize, Value>,
    /// Those that a motion uses before they are assigned.
    pub(super) used: Vec<(usize, Value)>,
    /// Whether a motion came before the first instruction that switches program displacement.
    pub(super) moved_before_displacement: Option<bool>,
}
