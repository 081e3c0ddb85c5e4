//! Changes of motions that share numbers, brought into agreement where a difference has no effect.

use crate::Change;
use std::borrow::Cow;
use std::collections::HashMap;
use std::hash::Hash;

/// Changes that differ by at most this are the same, mm. A controller stores positions in single precision, which is 1.2e-4 mm at 1 m, and no
/// encoder of an arm resolves a thousandth of a millimetre at the tool. The remaining error is that of the number as written.
const SAME_MM: f64 = 1e-3;
/// Distance from the TCP at which a turn counts as a shift, mm: that of the last digit of a quaternion in
/// [`RewriteOptions`](crate::RewriteOptions).
const LEVER_MM: f64 = 300.0;

/// The changes, of which those of motions that share numbers are one if they differ by at most [`SAME_MM`]. `shared` identifies the numbers of a
/// motion.
pub(crate) fn agreed<'c, K: Eq + Hash>(
    changes: &'c [Option<Change>],
    shared: impl Fn(usize) -> Option<K>,
) -> Cow<'c, [Option<Change>]> {
    let mut groups: HashMap<K, Group> = HashMap::new();
    for i in 0..changes.len() {
        let Some(key) = shared(i) else { continue };
        let group = groups.entry(key).or_insert(Group { leader: i, agrees: true });
        group.agrees &= match (&changes[group.leader], &changes[i]) {
            (Some(a), Some(b)) => is_same(a, b),
            (a, b) => a == b,
        };
    }
    let mut all = Cow::Borrowed(changes);
    for i in 0..changes.len() {
        let Some(group) = shared(i).and_then(|key| groups.get(&key)).filter(|group| group.agrees) else { continue };
        if changes[i] != changes[group.leader] {
            all.to_mut()[i].clone_from(&changes[group.leader]);
        }
    }
    all
}

/// Motions that share numbers.
struct Group {
    /// The first of them.
    leader: usize,
    /// Whether the changes of all of them are the same.
    agrees: bool,
}

fn is_same(a: &Change, b: &Change) -> bool {
    let square = |a: &[f64], b: &[f64], sign: f64| a.iter().zip(b).map(|(a, b)| (a - sign * b).powi(2)).sum::<f64>();
    let turn = match (&a.quat, &b.quat) {
        (None, None) => 0.0,
        // Half the angle, as a quaternion and its negative are one orientation.
        (Some(a), Some(b)) => square(a, b, 1.0).min(square(a, b, -1.0)).sqrt(),
        _ => return false,
    };
    square(&a.position_mm, &b.position_mm, 1.0).sqrt() <= SAME_MM
        && 2.0 * turn * LEVER_MM <= SAME_MM
        && (a.conf, &a.external) == (b.conf, &b.external)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(x: f64, turn: f64) -> Option<Change> {
        let quat = Some([(turn / 2.0).cos(), (turn / 2.0).sin(), 0.0, 0.0]);
        Some(Change { position_mm: [x, 0.0, 0.0], quat, conf: None, external: None })
    }

    #[test]
    fn small_differences_have_no_effect() {
        let small = [change(1.0, 0.0), change(1.000_9, 0.0), change(1.0, 3.2e-6)];
        assert!(agreed(&small, |_| Some(())).iter().all(|change| *change == small[0]));
        assert_eq!(*agreed(&small, Some), small);
        // Further apart, or without a change: each keeps its own, and the text is kept.
        for other in [change(1.001_1, 0.0), change(1.0, 3.4e-6), None] {
            let changes = [change(1.0, 0.0), change(1.000_1, 0.0), other];
            assert_eq!(*agreed(&changes, |_| Some(())), changes);
        }
    }
}
