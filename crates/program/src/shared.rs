//! Motions that share numbers: their changes are brought into agreement where a difference has no effect, and motions through air go along.

use crate::front_end::Wanted;
use crate::{Change, Editable, Motion, Program, Reason, RewriteOptions};
use smallvec::SmallVec;
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::hash::Hash;

/// Changes that differ by at most this are the same, mm. A controller stores positions in single precision, which is 1.2e-4 mm at 1 m, and no
/// encoder of an arm resolves a thousandth of a millimetre at the tool. The remaining error is that of the number as written.
const SAME_MM: f64 = 1e-3;
/// Distance from the TCP at which a turn counts as a shift, mm: that of the last digit of a quaternion in
/// [`RewriteOptions`](crate::RewriteOptions).
const LEVER_MM: f64 = 300.0;

/// The numbers in the text on which the pose of a motion depends.
pub(crate) type Numbers<K> = SmallVec<[K; 6]>;

/// The result of [`agreed`].
#[derive(Debug)]
pub(crate) struct Agreed<'c, K> {
    /// The changes, of which those of motions with the same numbers are one if they differ by at most [`SAME_MM`]; `None` for motions that go along.
    pub(crate) changes: Cow<'c, [Option<Change>]>,
    /// Whether each motion goes where its numbers lead it after the changes of others: it cuts nothing, and shares a number with one that
    /// cuts.
    pub(crate) along: Vec<bool>,
    /// The numbers of the other motions, if any motion is free to go along.
    pub(crate) owned: HashSet<K>,
}

/// Brings the changes of motions that share numbers into agreement. `numbers` are those of a motion.
pub(crate) fn agreed<'c, K: Eq + Hash>(
    program: &Program,
    Wanted { changes, options, .. }: &Wanted<'c>,
    numbers: impl Fn(usize) -> Numbers<K>,
) -> Agreed<'c, K> {
    let all = 0..changes.len();
    let free: Vec<bool> = all.clone().map(|i| is_free(program, options, i)).collect();
    let owned: HashSet<K> = match free.contains(&true) {
        true => all.clone().filter(|i| !free[*i]).flat_map(&numbers).collect(),
        false => HashSet::new(),
    };
    let along: Vec<bool> = all.map(|i| free[i] && goes_along(program, i, &numbers(i), &owned)).collect();
    let changes = same(changes, |i| Some(numbers(i)).filter(|all| !along[i] && !all.is_empty()), &along);
    Agreed { changes, along, owned }
}

/// Whether a motion that is free to go along has to: it has no numbers of its own.
pub(crate) fn goes_along<K: Eq + Hash>(program: &Program, i: usize, numbers: &Numbers<K>, owned: &HashSet<K>) -> bool {
    matches!(program.targets[i].editable, Editable::No(_)) || numbers.iter().any(|number| owned.contains(number))
}

/// Whether a motion has no numbers of its own to edit, and moves with those of others all the same.
pub(crate) fn follows(editable: Editable) -> bool {
    matches!(
        editable,
        Editable::No(
            Reason::OffsetWithExpression
                | Reason::MovedByRegister
                | Reason::ToolMovedByRegister
                | Reason::PositionRegister
        )
    )
}

/// Whether a motion may go where its numbers lead it after the changes of others: it cuts nothing, and how its pose follows from these numbers
/// is the same on every path. A point of an arc may not, because the arc would change by more than the point.
pub(crate) fn is_free(program: &Program, options: &RewriteOptions<'_>, i: usize) -> bool {
    let target = &program.targets[i];
    let is_known = matches!(target.editable, Editable::Pose | Editable::Position) || follows(target.editable);
    options.air.get(i) == Some(&true) && is_known && target.motion != Motion::Circular
}

/// The changes, of which those of motions of one group are one if they differ by at most [`SAME_MM`], and those that go along have none.
fn same<'c, K: Eq + Hash>(
    changes: &'c [Option<Change>],
    group: impl Fn(usize) -> Option<K>,
    along: &[bool],
) -> Cow<'c, [Option<Change>]> {
    let mut groups: HashMap<K, Group> = HashMap::new();
    for i in 0..changes.len() {
        let Some(key) = group(i) else { continue };
        let group = groups.entry(key).or_insert(Group { leader: i, agrees: true });
        group.agrees &= match (&changes[group.leader], &changes[i]) {
            (Some(a), Some(b)) => is_same(a, b),
            (a, b) => a == b,
        };
    }
    let mut all = Cow::Borrowed(changes);
    for i in 0..changes.len() {
        if along[i] && changes[i].is_some() {
            all.to_mut()[i] = None;
        }
        let Some(group) = group(i).and_then(|key| groups.get(&key)).filter(|group| group.agrees) else { continue };
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
        assert!(same(&small, |_| Some(()), &[false; 3]).iter().all(|change| *change == small[0]));
        assert_eq!(*same(&small, Some, &[false; 3]), small);
        // Further apart, or without a change: each keeps its own, and the text is kept.
        for other in [change(1.001_1, 0.0), change(1.0, 3.4e-6), None] {
            let changes = [change(1.0, 0.0), change(1.000_1, 0.0), other];
            assert_eq!(*same(&changes, |_| Some(()), &[false; 3]), changes);
        }
    }
}
