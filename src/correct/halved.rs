//! An interval that is divided where its values do not follow from one another.

use std::collections::BTreeMap;

/// A position in the interval. It is a whole number, so that parts can be halved exactly.
pub(super) type Tick = u32;

/// Values at ticks of an interval. A part of it is halved until the values at its ends, quarters and middle are resolved.
pub(super) struct Halved<V> {
    /// Values by tick; `None` where there is none.
    pub(super) values: BTreeMap<Tick, Option<V>>,
    /// Parts to examine.
    pub(super) open: Vec<(Tick, Tick)>,
    /// Parts that are not halved any more.
    pub(super) done: Vec<(Tick, Tick)>,
}

impl<V: Clone> Halved<V> {
    /// An interval without values, of which the whole is to be examined.
    pub(super) fn new(ticks: Tick) -> Self {
        Self { values: BTreeMap::new(), open: vec![(0, ticks)], done: Vec::new() }
    }

    /// The value at a tick.
    pub(super) fn at(&self, tick: Tick) -> Option<V> {
        self.values.get(&tick).cloned().flatten()
    }

    /// The values at the ends, the quarters and the middle of a part; `None` if one is missing.
    pub(super) fn five(&self, (from, to): (Tick, Tick)) -> Option<[V; 5]> {
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|k| self.at(from + k * ((to - from) / 4)));
        Some([a?, b?, c?, d?, e?])
    }

    /// Ticks whose values are needed next, in rising order.
    pub(super) fn wanted(&self) -> Vec<Tick> {
        let open = self.open.iter().flat_map(|(from, to)| (0..=4).map(move |k| from + k * ((to - from) / 4)));
        let ends = self.done.iter().flat_map(|(from, to)| [*from, *to]);
        let mut ticks: Vec<Tick> = open.chain(ends).filter(|tick| !self.values.contains_key(tick)).collect();
        ticks.sort_unstable();
        ticks.dedup();
        ticks
    }

    /// Halves the open parts, except for those that are resolved or lack a value.
    pub(super) fn judge(&mut self, is_resolved: impl Fn((Tick, Tick), [V; 5]) -> bool) {
        for (from, to) in std::mem::take(&mut self.open) {
            let middle = from + (to - from) / 2;
            if self.five((from, to)).is_none_or(|five| is_resolved((from, to), five)) {
                self.done.push((from, to));
            } else {
                self.open.extend([(from, middle), (middle, to)]);
            }
        }
    }
}
