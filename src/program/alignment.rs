//! Which targets of a corrected program are those of its original, where the correction has inserted others between them.
//!
//! A matching keeps the order, and what is not matched lies on the way into the next match. Of all matchings the one of the
//! least cost is taken, by dynamic programming over the ends of motions; circle points go with their ends.

use super::{Motion, Program, Role};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// What the geometry says of a target of the corrected program (first index) and one of the original (second).
pub(crate) trait Fit {
    /// Whether they may be the same target.
    fn is_same(&self, corrected: usize, original: usize) -> bool;
    /// Whether the one may have been inserted on the way into the other.
    fn is_on_way(&self, corrected: usize, original: usize) -> bool;
    /// How far pairs that may be the same are from that, squared.
    fn costs(&self, pairs: &[(usize, usize)]) -> Vec<f64>;
}

/// The end of a motion.
struct End {
    target: usize,
    motion: Motion,
    is_arc: bool,
    /// What a correction leaves as it is; `None` where the original is of another language.
    written: Option<Written>,
    /// How far from it the controller leaves the path, mm; 0 of a stop.
    zone_mm: f64,
    /// Of the corrected program: as far as its name tells.
    may_be_inserted: bool,
}

/// What of an instruction is not its numbers.
#[derive(PartialEq)]
struct Written {
    motion: Motion,
    name: Named,
}

/// What its name tells of a target.
#[derive(PartialEq)]
enum Named {
    /// Numbers in the instruction: as inserted ones are written.
    No,
    Yes,
    /// Of a language whose points all have a name of their own: inserted ones have one that the original has not.
    Point(Arc<str>),
}

/// A target of the corrected program that may be a certain one of the original.
struct Candidate {
    end: usize,
    /// The ends just before, any of which may be the original's target before: all between may have been inserted.
    before: Range<usize>,
}

/// A candidate with the least cost of all targets up to it, and the candidate before that it comes from.
#[derive(Clone, Copy)]
struct Reached {
    end: usize,
    cost: f64,
    from: usize,
}

/// For each end of the original's motions its target in the corrected program.
///
/// # Errors
/// The first target of the corrected program that is neither one of the original nor on its way.
pub(crate) fn align(original: &Program, corrected: &Program, fit: &impl Fit) -> Result<Vec<(usize, usize)>, usize> {
    let same_text = original.language == corrected.language;
    let (wanted, mut given) = (ends(original, same_text), ends(corrected, same_text));
    let known: BTreeSet<&str> = original.targets.iter().filter_map(|target| target.name.as_deref()).collect();
    for end in &mut given {
        end.may_be_inserted = end.written.as_ref().is_none_or(|written| match &written.name {
            Named::No => true,
            Named::Yes => false,
            Named::Point(name) => !known.contains(&**name),
        });
    }
    let candidates = candidates(&wanted, &given, fit)?;
    let open = |list: &[Candidate]| list.len() > 1;
    let asked = |j: &usize| open(&candidates[*j]);
    let pair = |j: usize, candidate: &Candidate| (given[candidate.end].target, wanted[j].target);
    let pairs: Vec<(usize, usize)> = (0..candidates.len())
        .filter(asked)
        .flat_map(|j| candidates[j].iter().map(move |candidate| (j, candidate)))
        .map(|(j, candidate)| pair(j, candidate))
        .collect();
    let mut costs = fit.costs(&pairs).into_iter();
    let mut rounds: Vec<Vec<Reached>> = Vec::with_capacity(candidates.len());
    for list in &candidates {
        let mut costs = |_: &Candidate| if open(list) { costs.next().unwrap_or(f64::INFINITY) } else { 0.0 };
        rounds.push(match rounds.last() {
            None => list.iter().map(|c| Reached { end: c.end, cost: costs(c), from: 0 }).collect(),
            Some(before) => round(list, before, costs),
        });
    }
    // What is after the last of the original is not inserted on any way.
    let last = rounds.last().and_then(|round| round.iter().position(|reached| reached.end + 1 == given.len()));
    let Some(mut at) = last else {
        let most = rounds.last().and_then(|round| round.last()).map_or(0, |reached| reached.end + 1);
        return Err(given.get(most).or(given.last()).map_or(0, |end| end.target));
    };
    let mut matched = Vec::with_capacity(wanted.len());
    for (wanted, round) in wanted.iter().zip(&rounds).rev() {
        matched.push((wanted.target, given[round[at].end].target));
        at = round[at].from;
    }
    matched.reverse();
    Ok(matched)
}

/// The ends of a program's motions.
fn ends(program: &Program, same_text: bool) -> Vec<End> {
    let is_arc = |i: usize| i.checked_sub(1).is_some_and(|via| program.targets[via].role == Role::Via);
    let end = |i: usize| {
        let target = &program.targets[i];
        let motion = target.motion;
        let name = match &target.name {
            Some(name) if program.language.about().are_points_named => Named::Point(Arc::clone(name)),
            Some(_) => Named::Yes,
            None => Named::No,
        };
        let written = same_text.then_some(Written { motion, name });
        let zone_mm = program.zone_mm(i).unwrap_or(0.0);
        End { target: i, motion, is_arc: is_arc(i), written, zone_mm, may_be_inserted: true }
    };
    let ends = (0..program.targets.len()).filter(|i| program.targets[*i].role != Role::Via);
    ends.map(end).collect()
}

impl End {
    /// Whether the instruction is one of the original but for its numbers: a correction may make its zone smaller.
    fn is_written_like(&self, original: &Self) -> bool {
        let fits = self.written.is_none() || self.zone_mm <= original.zone_mm;
        fits && self.is_arc == original.is_arc && self.written == original.written
    }

    /// Whether a target may have been inserted on the way into this one.
    fn is_split_by(&self, inserted: &Self) -> bool {
        let is_path = |end: &Self| matches!(end.motion, Motion::Linear | Motion::Circular);
        is_path(self) && is_path(inserted) && (self.is_arc || !inserted.is_arc) && inserted.may_be_inserted
    }
}

/// For each end of the original the targets that it may be, in order.
fn candidates(wanted: &[End], given: &[End], fit: &impl Fit) -> Result<Vec<Vec<Candidate>>, usize> {
    let mut all: Vec<Vec<Candidate>> = Vec::with_capacity(wanted.len());
    for (j, end) in wanted.iter().enumerate() {
        let is_same = |i: usize| given[i].is_written_like(end) && fit.is_same(given[i].target, end.target);
        let Some(before) = all.last() else {
            // Nothing is inserted before the first target.
            let first: Vec<_> = (0..given.len().min(1)).filter(|i| is_same(*i)).collect();
            all.push(first.into_iter().map(|end| Candidate { end, before: 0..0 }).collect());
            if all[0].is_empty() {
                return Err(given.first().map_or(0, |end| end.target));
            }
            continue;
        };
        let mut here = Vec::new();
        // The ends that the targets since may all have been inserted after.
        let mut known: Option<Range<usize>> = None;
        let mut waiting = before.iter().map(|candidate| candidate.end).peekable();
        let mut at = before.first().map_or(0, |candidate| candidate.end);
        loop {
            if waiting.next_if_eq(&at).is_some() {
                known = Some(known.map_or(at, |known| known.start)..at + 1);
            }
            at += 1;
            if at >= given.len() || known.is_none() && waiting.peek().is_none() {
                break;
            }
            if let Some(before) = known.clone()
                && is_same(at)
            {
                here.push(Candidate { end: at, before });
            }
            if !(end.is_split_by(&given[at]) && fit.is_on_way(given[at].target, end.target)) {
                known = None;
            }
        }
        if here.is_empty() {
            // Where no way into this one went on.
            return Err(given[(at - 1).min(given.len() - 1)].target);
        }
        debug_assert!(j == all.len());
        all.push(here);
    }
    Ok(all)
}

/// The next target of the original: the cheapest way to each of its candidates.
fn round(list: &[Candidate], before: &[Reached], mut cost: impl FnMut(&Candidate) -> f64) -> Vec<Reached> {
    let mut best: Option<usize> = None;
    let (mut from, mut next) = (0, 0);
    let mut out = Vec::with_capacity(list.len());
    for candidate in list {
        if candidate.before.start > from {
            (from, best) = (candidate.before.start, None);
        }
        while let Some(reached) = before.get(next).filter(|reached| reached.end < candidate.before.end) {
            if reached.end >= from && best.is_none_or(|best| reached.cost < before[best].cost) {
                best = Some(next);
            }
            next += 1;
        }
        let own = cost(candidate);
        if let Some(best) = best {
            out.push(Reached { end: candidate.end, cost: before[best].cost + own, from: best });
        }
    }
    out
}
