//! A range that is divided where its values do not follow from one another.

use std::collections::BTreeMap;

/// A position in the range. It is a whole number, so that intervals can be halved exactly.
pub(super) type Tick = u32;

/// A part of the range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Interval {
    pub(super) from: Tick,
    pub(super) to: Tick,
}

impl Interval {
    /// A quarter of its length.
    pub(super) fn quarter(self) -> Tick {
        (self.to - self.from) / 4
    }

    /// Its ends, its quarters and its middle, in rising order.
    pub(super) fn ticks(self) -> [Tick; 5] {
        [self.from, self.from + self.quarter(), self.middle(), self.from + 3 * self.quarter(), self.to]
    }

    /// The tick in its middle.
    pub(super) fn middle(self) -> Tick {
        self.from + 2 * self.quarter()
    }
}

/// Values at ticks of a range. An interval is halved until the values at its ends, quarters and middle are resolved.
pub(super) struct Halved<V> {
    /// Values by tick; `None` where there is none.
    pub(super) values: BTreeMap<Tick, Option<V>>,
    /// Intervals to examine.
    pub(super) open: Vec<Interval>,
    /// Intervals that are not halved any more.
    pub(super) done: Vec<Interval>,
}

impl<V: Clone> Halved<V> {
    /// A range without values, of which the whole is to be examined. The number of ticks is a power of two.
    pub(super) fn new(ticks: Tick) -> Self {
        Self { values: BTreeMap::new(), open: vec![Interval { from: 0, to: ticks }], done: Vec::new() }
    }

    /// The value at a tick.
    pub(super) fn at(&self, tick: Tick) -> Option<V> {
        self.values.get(&tick).cloned().flatten()
    }

    /// The values at the five [`Interval::ticks`]; `None` if one is missing.
    pub(super) fn five(&self, interval: Interval) -> Option<[V; 5]> {
        let [a, b, c, d, e] = interval.ticks().map(|tick| self.at(tick));
        Some([a?, b?, c?, d?, e?])
    }

    /// Ticks whose values are needed next, in rising order.
    pub(super) fn wanted(&self) -> Vec<Tick> {
        let open = self.open.iter().flat_map(|interval| interval.ticks());
        let ends = self.done.iter().flat_map(|interval| [interval.from, interval.to]);
        let mut ticks: Vec<Tick> = open.chain(ends).filter(|tick| !self.values.contains_key(tick)).collect();
        ticks.sort_unstable();
        ticks.dedup();
        ticks
    }

    /// Halves the open intervals, except for those that are resolved or lack a value.
    pub(super) fn judge(&mut self, is_resolved: impl Fn(Interval, [V; 5]) -> bool) {
        for interval in std::mem::take(&mut self.open) {
            if self.five(interval).is_none_or(|five| is_resolved(interval, five)) {
                self.done.push(interval);
            } else {
                let (Interval { from, to }, middle) = (interval, interval.middle());
                self.open.extend([Interval { from, to: middle }, Interval { from: middle, to }]);
            }
        }
    }
}
