//! States that an instruction leaves in force up to the next one, also for the next cycle.

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
}

/// A set of such states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LastingStates(u8);

impl LastingStates {
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
