//! States that an instruction or a mark leaves in force up to the next one, also for the next cycle.

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
    Load,
    Mark,
}

impl Lasting {
    const ALL: [Self; 9] = [
        Self::Displacement,
        Self::AxisOffset,
        Self::Units,
        Self::Softness,
        Self::Speed,
        Self::Arcs,
        Self::Configuration,
        Self::Load,
        Self::Mark,
    ];

    /// Its name in messages about what one cycle or routine leaves to another; `None` where there are none.
    pub(super) fn what(self) -> Option<&'static str> {
        Some(match self {
            Self::Displacement => "program displacement",
            Self::AxisOffset => "the offset of external axes",
            Self::Units => "the set of active mechanical units",
            Self::Softness => "soft servo",
            Self::Speed => "`VelSet`",
            Self::Arcs => "`CirPathMode`",
            Self::Configuration => "`ConfJ`",
            Self::Load | Self::Mark => return None,
        })
    }
}

/// A set of such states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LastingStates(u16);

impl LastingStates {
    /// The state of the external axes.
    pub(super) const AXES: Self = Self(1 << Lasting::AxisOffset as u16 | 1 << Lasting::Units as u16);
    pub(super) const MARK: Self = Self(1 << Lasting::Mark as u16);
    /// Those that an unknown routine may set; it is assumed to leave speeds, soft servo, loads, turns on arcs and `ConfJ` alone.
    pub(super) const FOREIGN: Self = Self(1 << Lasting::Displacement as u16 | Self::AXES.0);

    pub(super) fn all() -> Self {
        Self::of(|_| true)
    }

    /// Those of which `holds` is true.
    pub(super) fn of(holds: impl Fn(Lasting) -> bool) -> Self {
        let mut states = Self::default();
        Lasting::ALL.into_iter().filter(|state| holds(*state)).for_each(|state| states.insert(state));
        states
    }

    pub(super) fn insert(&mut self, state: Lasting) {
        self.0 |= 1 << state as u16;
    }

    pub(super) fn remove(&mut self, state: Lasting) {
        self.0 &= !(1 << state as u16);
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
        Lasting::ALL.into_iter().filter(move |state| self.0 & (1 << *state as u16) != 0)
    }
}
