//! Which motions run, in which order, and what is known at each.
//!
//! A program whose every branch is decided by what stands in it is run as it runs, loops and all. Any other is not run:
//! what holds before each of its statements is what holds on all ways there (a data flow analysis: states are joined until none
//! changes), and its motions are those that can be reached, once each, in the order of the text.

use super::flow::{Flow, Next};
use super::state::ModalState;
use super::statement::StatementKind;
use std::collections::VecDeque;

/// A motion that runs, or a call of a program that counts from where the robot stands, by its statement, with what is known
/// before it.
pub(super) type Visit = (usize, ModalState);

/// Statements that are run before a program counts as one without an end: twenty times the 9,999 lines that a controller holds.
const STEPS: usize = 200_000;

/// The motions of a program.
pub(super) fn run(flow: &Flow<'_>) -> Vec<Visit> {
    decided(flow).unwrap_or_else(|| reachable(flow))
}

/// The motions in the order that they run in; `None` where that depends on the run, or there is no end.
fn decided(flow: &Flow<'_>) -> Option<Vec<Visit>> {
    let (mut visits, mut at, mut state) = (Vec::new(), 0, flow.start.clone());
    for _ in 0..STEPS {
        if at >= flow.kinds.len() {
            return Some(visits);
        }
        if is_visit(flow, at) {
            visits.push((at, state.clone()));
        }
        let mut ways = flow.step(at, state).into_iter();
        let Some((next, mut behind)) = ways.next() else { return Some(visits) };
        for (other, more) in ways {
            if other != next {
                return None;
            }
            behind.join(&more);
        }
        let Next::At(next) = next else { return None };
        (at, state) = (next, behind);
    }
    None
}

/// The motions that can be reached, in the order of the text.
fn reachable(flow: &Flow<'_>) -> Vec<Visit> {
    let count = flow.kinds.len();
    let mut before: Vec<Option<ModalState>> = vec![None; count];
    // What holds after statements that may go on anywhere.
    let mut anywhere: Option<ModalState> = None;
    let mut open: VecDeque<usize> = VecDeque::new();
    if join(before.first_mut(), &flow.start) {
        open.push_back(0);
    }
    while let Some(at) = open.pop_front() {
        let Some(state) = before[at].clone() else { continue };
        for (next, behind) in flow.step(at, state) {
            let targets = match next {
                Next::At(next) => next..next + 1,
                Next::Anywhere => {
                    if join(Some(&mut anywhere), &behind) {
                        0..count
                    } else {
                        0..0
                    }
                }
            };
            for to in targets {
                if join(before.get_mut(to), &behind) {
                    open.push_back(to);
                }
            }
        }
    }
    let visits = before.into_iter().enumerate().filter(|(at, _)| is_visit(flow, *at));
    visits.filter_map(|(at, state)| Some((at, state?))).collect()
}

fn is_visit(flow: &Flow<'_>, at: usize) -> bool {
    matches!(flow.kinds[at], StatementKind::Motion(_)) || flow.counts_on(at)
}

/// Takes in a way to a statement, if there is such a statement; whether less is known before it now.
fn join(before: Option<&mut Option<ModalState>>, state: &ModalState) -> bool {
    match before {
        Some(Some(before)) => before.join(state),
        Some(none) => {
            *none = Some(state.clone());
            true
        }
        None => false,
    }
}
