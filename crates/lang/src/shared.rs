//! Finds all uses of a number: which motions may be edited, and the texts on which all users of a number agree.

use crate::ir::{Path, Switch, TokenId};
use crate::reason::Reason;
use crate::run::{Moved, Outcome};
use crate::value::{Content, Pose, Value};
use std::collections::{BTreeMap, BTreeSet};

/// The numbers of a point that may be edited in the text.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// use deflex_lang::shared::{Editable, editable};
///
/// match editable(&outcome)[0] {
///     Editable::Pose => println!("all numbers may be edited"),
///     Editable::Position => println!("the numbers of the position may be edited"),
///     Editable::No(reason) => println!("not edited: {}", reason.text()),
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Editable {
    /// All of its numbers.
    Pose,
    /// Those of its position.
    Position,
    /// None, for this reason.
    No(Reason),
}

/// Numbers of a position.
const POSITION: usize = 3;

/// Which numbers of each motion may be edited; a circle and its circle point are edited together.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// use deflex_lang::shared::{Editable, editable};
///
/// assert_eq!(editable(&outcome), [Editable::Pose]);
/// ```
#[must_use]
pub fn editable(outcome: &Outcome) -> Vec<Editable> {
    let mut edits: Vec<Editable> = outcome.motions.iter().map(own).collect();
    let mut used = outcome.used.clone();
    // What a pose depends on apart from the tokens that are edited.
    for motion in &outcome.motions {
        for value in points(motion) {
            for token in value.reads.tokens() {
                used.entry(*token).or_insert(Reason::Shared);
            }
            if let Content::AxesOf(_) | Content::Pose(_) = value.content {
                let mut seen = BTreeSet::new();
                for number in value.pose().into_iter().flat_map(|pose| &*pose.numbers) {
                    let own = matches!(&number.content, Content::Number(n) if n.affine.is_some());
                    for token in number.reads.tokens() {
                        if !seen.insert(*token) || !own || number.reads.tokens().len() > 1 && !is_own(number, *token) {
                            used.entry(*token).or_insert(Reason::SharedNumbers);
                        }
                    }
                }
            }
        }
    }
    // Numbers that are read as different things cannot be edited for all of them.
    let mut read_as: BTreeMap<TokenId, (&Pose, usize)> = BTreeMap::new();
    for pose in outcome.motions.iter().flat_map(points).filter_map(Value::pose) {
        for at in 0..pose.numbers.len() {
            let Some(affine) = pose.affine(at) else { continue };
            let (other, place) = *read_as.entry(affine.token).or_insert((pose, at));
            if place != at || !is_same(pose, other) {
                used.entry(affine.token).or_insert(Reason::SharedNumbers);
            }
        }
    }
    let edited: Vec<Vec<TokenId>> = outcome.motions.iter().map(edited_tokens).collect();
    loop {
        let mut changed = false;
        for i in 0..edits.len() {
            let refused = |edit: &Editable| matches!(edit, Editable::No(_));
            if !refused(&edits[i])
                && let Some(why) = edited[i].iter().find_map(|token| used.get(token))
            {
                edits[i] = Editable::No(*why);
                changed = true;
            }
            if refused(&edits[i]) {
                for token in tokens(&outcome.motions[i]) {
                    changed |= used.insert(token, *used.get(&token).unwrap_or(&Reason::SharedWithKept)).is_none();
                }
            }
        }
        if !changed {
            return edits;
        }
    }
}

fn is_own(number: &Value, token: TokenId) -> bool {
    matches!(&number.content, Content::Number(n) if n.affine.is_some_and(|affine| affine.token == token))
}

fn points(motion: &Moved) -> impl Iterator<Item = &Value> {
    motion.via.iter().chain([&motion.to])
}

/// Tokens on which the points of a motion depend.
fn tokens(motion: &Moved) -> BTreeSet<TokenId> {
    points(motion).flat_map(|value| value.all_reads().tokens().to_vec()).collect()
}

/// Whether two poses are computed from the same tokens by the same steps.
fn is_same(a: &Pose, b: &Pose) -> bool {
    let affine = |pose: &Pose| (0..pose.numbers.len()).map(|at| pose.affine(at)).collect::<Vec<_>>();
    std::ptr::eq(a, b) || a.left == b.left && a.right == b.right && affine(a) == affine(b)
}

/// Tokens that a correction of the motion edits.
fn edited_tokens(motion: &Moved) -> Vec<TokenId> {
    let poses = points(motion).filter_map(Value::pose);
    poses.flat_map(|pose| (0..pose.numbers.len()).filter_map(|at| Some(pose.affine(at)?.token))).collect()
}

/// Which numbers of a motion could be edited if nothing else used them.
fn own(motion: &Moved) -> Editable {
    let switch = |switch: Switch| &motion.switches[switch as usize];
    if motion.in_thread {
        return Editable::No(Reason::InThread);
    }
    if let Path::Unknown(why) | Path::Other(why) = motion.path {
        return Editable::No(why);
    }
    // The controller does not use the orientation of a tool that is fixed to the tangent.
    let mut edit = if motion.path == Path::Tangent { Editable::Position } else { Editable::Pose };
    for value in points(motion) {
        let this = match &value.content {
            Content::Unknown(why) => Editable::No(*why),
            Content::Pose(_) | Content::AxesOf(_) => {
                match value.pose().map(|pose| [pose.affine_numbers(), pose.numbers.len()]) {
                    Some([affine, all]) if affine > POSITION && affine == all => Editable::Pose,
                    Some([affine, _]) if affine >= POSITION => Editable::Position,
                    _ => Editable::No(Reason::Computed),
                }
            }
            Content::List(_) => Editable::No(Reason::Joints),
            _ => Editable::No(Reason::Computed),
        };
        edit = match (edit, this) {
            (Editable::No(why), _) | (_, Editable::No(why)) => Editable::No(why),
            (Editable::Pose, Editable::Pose) => Editable::Pose,
            _ => Editable::Position,
        };
    }
    if let Editable::No(_) = edit {
        return edit;
    }
    for (of, why) in [(Switch::Tool, Reason::Tool), (Switch::Frame, Reason::Frame)] {
        if switch(of).reason().is_some() {
            return Editable::No(why);
        }
    }
    let rest = [Switch::Shift, Switch::Load, Switch::Mark];
    if let Some(why) = rest.into_iter().find_map(|of| switch(of).reason()) {
        return Editable::No(why);
    }
    edit
}

/// Decides which users get the wanted texts of their tokens. All users of a token have to want the same text, and a user gets all of its
/// texts or none.
///
/// The text `None` leaves a token as it is; users that change nothing want `None`.
///
/// ```
/// use deflex_lang::ir::TokenId;
/// let wants = |token: u32, text: &'static str| vec![(TokenId(token), Some(text))];
/// // The first two share a token and differ; the third has its own.
/// let agreed = deflex_lang::shared::agree(&[wants(0, "1"), wants(0, "2"), wants(1, "3")]);
/// assert_eq!(agreed, [false, false, true]);
/// ```
#[must_use]
pub fn agree<K: Copy + Ord, T: PartialEq>(wishes: &[Vec<(K, Option<T>)>]) -> Vec<bool> {
    let mut users: BTreeMap<K, Vec<usize>> = BTreeMap::new();
    let mut texts: BTreeMap<K, &Option<T>> = BTreeMap::new();
    let mut refused: BTreeSet<K> = BTreeSet::new();
    for (user, wish) in wishes.iter().enumerate() {
        for (token, text) in wish {
            users.entry(*token).or_default().push(user);
            if *texts.entry(*token).or_insert(text) != text {
                refused.insert(*token);
            }
        }
    }
    let mut agreed = vec![true; wishes.len()];
    let mut work: Vec<K> = refused.into_iter().collect();
    while let Some(token) = work.pop() {
        for user in users.remove(&token).unwrap_or_default() {
            if std::mem::replace(&mut agreed[user], false) {
                work.extend(wishes[user].iter().map(|(token, _)| *token));
            }
        }
    }
    agreed
}
