//! Finds the targets of the original in a corrected program that has inserted targets between them.
//!
//! A matching keeps the order, and targets without a match are on the segment to the next match. Dynamic programming over the ends of
//! motions finds the matching of least cost; circle points belong to their ends.

use super::{Motion, Program, Role};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// The geometric relation between a target of the corrected program (first index) and one of the original (second).
#[doc(hidden)]
pub trait Fit {
    /// Whether they may be the same target.
    fn is_same(&self, corrected: usize, original: usize) -> bool;
    /// Whether the first may have been inserted on the segment to the second.
    fn is_on_way(&self, corrected: usize, original: usize) -> bool;
    /// Squared distances of pairs that may be the same.
    fn costs(&self, pairs: &[(usize, usize)]) -> Vec<f64>;
}

/// The end of a motion.
struct End {
    target: usize,
    motion: Motion,
    is_arc: bool,
    /// The parts of the instruction that a correction does not change; `None` if the original is in another language.
    written: Option<Written>,
    /// Radius of its zone, mm; 0 for a stop.
    zone_mm: f64,
    /// For the corrected program: whether its name allows that it was inserted.
    may_be_inserted: bool,
}

/// The parts of an instruction other than its numbers.
#[derive(PartialEq)]
struct Written {
    motion: Motion,
    name: Named,
}

/// How a target is named.
#[derive(PartialEq)]
enum Named {
    /// It has no name: its numbers are in the instruction, as those of inserted targets are.
    No,
    Yes,
    /// In a language whose points all have a name of their own: an inserted target has a name that the original does not have.
    Point(Arc<str>),
}

/// A target of the corrected program that may be a certain one of the original.
struct Candidate {
    end: usize,
    /// The ends before it, any of which may be the original's target before: those between may have been inserted.
    before: Range<usize>,
}

/// A candidate with the least cost of all targets up to it, and the candidate before it on that path.
#[derive(Clone, Copy)]
struct Reached {
    end: usize,
    cost: f64,
    from: usize,
}

/// For each end of the original's motions its target in the corrected program.
///
/// # Errors
/// The first target of the corrected program that is neither a target of the original nor on its path.
#[doc(hidden)]
pub fn align(original: &Program, corrected: &Program, fit: &impl Fit) -> Result<Vec<(usize, usize)>, usize> {
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
    let is_open = |j: &usize| open(&candidates[*j]);
    let pair = |j: usize, candidate: &Candidate| (given[candidate.end].target, wanted[j].target);
    let pairs: Vec<(usize, usize)> = (0..candidates.len())
        .filter(is_open)
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
    // A target after the last one of the original is on no segment.
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
    /// Whether the instruction is that of the original, except for its numbers and a smaller zone.
    fn is_written_like(&self, original: &Self) -> bool {
        let fits = self.written.is_none() || self.zone_mm <= original.zone_mm;
        fits && self.is_arc == original.is_arc && self.written == original.written
    }

    /// Whether a target may have been inserted on the segment to this one.
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
        // The ends after which all targets since then may have been inserted.
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
            // No candidate before it can be continued.
            return Err(given[(at - 1).min(given.len() - 1)].target);
        }
        debug_assert!(j == all.len());
        all.push(here);
    }
    Ok(all)
}

/// The next target of the original: the cheapest matching up to each of its candidates.
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
