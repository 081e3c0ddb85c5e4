//! States that an instruction leaves in force up to the next one, also for the next cycle.

use super::state::{ModalState, Switches};

/// Such a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lasting {
    Displacement,
    AxisOffset,
    Units,
    Softness,
    Speed,
    Arcs,
    Configuration,
}

impl Lasting {
    const ALL: [Self; 7] = [
        Self::Displacement,
        Self::AxisOffset,
        Self::Units,
        Self::Softness,
        Self::Speed,
        Self::Arcs,
        Self::Configuration,
    ];

    /// Its name in messages.
    pub(super) fn what(self) -> &'static str {
        match self {
            Self::Displacement => "program displacement",
            Self::AxisOffset => "the offset of external axes",
            Self::Units => "the set of active mechanical units",
            Self::Softness => "soft servo",
            Self::Speed => "`VelSet`",
            Self::Arcs => "`CirPathMode`",
            Self::Configuration => "`ConfJ`",
        }
    }

    fn differs(self, a: &ModalState, b: &ModalState) -> bool {
        match self {
            Self::Displacement => a.displacement != b.displacement,
            Self::AxisOffset => a.axes.offset != b.axes.offset,
            Self::Units => a.axes.inactive != b.axes.inactive,
            Self::Softness => a.soft != b.soft,
            Self::Speed => a.velocity != b.velocity,
            Self::Arcs => a.arcs != b.arcs,
            Self::Configuration => a.nearest != b.nearest,
        }
    }
}

/// A set of such states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LastingStates(u8);

impl LastingStates {
    pub(super) fn all() -> Self {
        let mut all = Self::default();
        Lasting::ALL.into_iter().for_each(|state| all.insert(state));
        all
    }

    /// Those that differ between two states.
    pub(super) fn differing(a: &ModalState, b: &ModalState) -> Self {
        let mut differing = Self::default();
        Lasting::ALL.into_iter().filter(|state| state.differs(a, b)).for_each(|state| differing.insert(state));
        differing
    }

    /// Those that may be switched.
    pub(super) fn switched(switches: Switches) -> Self {
        let Switches { displacement, axes, soft, velocity, arcs, nearest, marks: _, load: _ } = switches;
        let switched = [displacement, axes, axes, soft, velocity, arcs, nearest];
        let mut states = Self::default();
        Lasting::ALL.into_iter().zip(switched).filter(|(_, is)| *is).for_each(|(state, _)| states.insert(state));
        states
    }

    fn insert(&mut self, state: Lasting) {
        self.0 |= 1 << state as u8;
    }

    pub(super) fn remove(&mut self, state: Lasting) {
        self.0 &= !(1 << state as u8);
    }

    pub(super) fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Those of this set that are not in another one.
    pub(super) fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Those that are in both sets.
    pub(super) fn common(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    pub(super) fn iter(self) -> impl Iterator<Item = Lasting> {
        Lasting::ALL.into_iter().filter(move |state| self.0 & (1 << *state as u8) != 0)
    }
}
