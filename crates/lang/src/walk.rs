//! The walk over a [`Flow`]: which steps run, with what holds at each, whatever the steps and what holds are.
//!
//! A test that is known is followed, loops round by round. From a test that is not known on, all ways are followed to where they meet again,
//! and what they leave is joined, until it stays the same. A loop that nothing leaves, or that such a test leaves, is run so from its
//! beginning. A loop within it whose own tests are known is still followed round by round (as in a hierarchical iteration: Bourdoncle 1993,
//! *Efficient chaotic iteration strategies with widenings*).

use crate::flow::{Flow, Node};
use std::collections::{BTreeMap, BTreeSet};

/// Why a run does not go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The program ends, or goes on forever.
    Ends,
    /// It does not end within the bounds of a run.
    TooLong,
}

/// Where two ways meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// After one of several branches.
    Branches,
    /// Where a round of a loop begins again.
    Rounds,
}

/// What runs the steps of a language, and holds what is known between them.
pub trait Machine {
    /// What a node does.
    type Step: Copy;
    /// What decides between two ways.
    type Test: Copy;
    /// What holds at one moment.
    type State: Clone;
    /// How much a run has come to so far.
    type Mark: Copy;

    /// A loop that goes round more often is run as one whose rounds are not counted.
    const MOST_ROUNDS: u64;

    /// Runs a step.
    ///
    /// # Errors
    /// The run does not go on.
    fn step(&mut self, node: usize, step: Self::Step, state: &mut Self::State) -> Result<(), Stop>;

    /// Whether a test holds; `None` where that is not known.
    ///
    /// # Errors
    /// The run does not go on.
    fn holds(&mut self, node: usize, test: Self::Test, state: &mut Self::State) -> Result<Option<bool>, Stop>;

    /// Reduces what is known to what holds in another state too; whether anything is less known than before.
    fn join(&mut self, known: &mut Self::State, other: &Self::State, meeting: Meeting) -> bool;

    /// Whether two states are the same, so that all that follows is the same.
    fn is_same(&self, a: &Self::State, b: &Self::State) -> bool;

    /// Whether what a run comes to is noted: not while states are still growing.
    fn notes(&mut self) -> &mut bool;

    /// What a run has come to so far.
    fn mark(&self) -> Self::Mark;

    /// Gives up what it has come to since then.
    fn back_to(&mut self, mark: Self::Mark);

    /// Whether loops with known tests are followed round by round.
    fn unrolls(&self) -> bool {
        true
    }

    /// Grows with what decides about steps and is no part of the states.
    fn revision(&self) -> usize {
        0
    }
}

/// Runs a routine from a state; what holds at its end.
///
/// # Errors
/// It has no end, or the run does not go on within it.
pub fn walk<M: Machine>(
    machine: &mut M,
    flow: &Flow<M::Step, M::Test>,
    routine: usize,
    state: M::State,
) -> Result<M::State, Stop> {
    let (first, exit) = flow.routines[routine];
    let mut walk = Walk { machine, flow, exit, joined: BTreeSet::new() };
    Ok(walk.follow(first, None, state)?.ok_or(Stop::Ends)?.1)
}

struct Walk<'w, M: Machine> {
    machine: &'w mut M,
    flow: &'w Flow<M::Step, M::Test>,
    exit: usize,
    /// Loops whose rounds are known not to be known: each is found out once.
    joined: BTreeSet<usize>,
}

/// Where a run came into a loop, and what held there.
struct Entered<M: Machine> {
    of: usize,
    node: usize,
    state: M::State,
    mark: M::Mark,
}

/// Where a step goes on.
enum Goes {
    To(usize),
    /// A test that is not known: here or there.
    Either(usize, usize),
}

/// A node that a run goes on at, and what holds there.
type At<M> = (usize, <M as Machine>::State);

/// The rounds of a loop, watched for one that is like another (Brent 1980, *An improved Monte Carlo factorization algorithm*).
struct Rounds<S> {
    count: u64,
    since_entered: u64,
    saved: Option<S>,
}

impl<M: Machine> Walk<'_, M> {
    /// Runs from a node to the first that is out of a loop, or to the end of the routine; `None` where it is not known how the loop is left.
    fn follow(&mut self, from: usize, within: Option<usize>, mut state: M::State) -> Result<Option<At<M>>, Stop> {
        let mut rounds: BTreeMap<usize, Rounds<M::State>> = BTreeMap::new();
        let mut entered: Vec<Entered<M>> = Vec::new();
        let (mut node, mut inner) = (from, within);
        loop {
            let is_left = within.map_or(node == self.exit, |of| !self.flow.is_within(node, of));
            if is_left {
                return Ok(Some((node, state)));
            }
            if self.flow.endless[node] {
                if within.is_none() {
                    self.region(node, None, state)?;
                }
                return if within.is_none() { Err(Stop::Ends) } else { Ok(None) };
            }
            let mut is_joined = false;
            if self.flow.inner[node] != inner {
                inner = self.flow.inner[node];
                is_joined = self.enter(node, within, &state, &mut entered);
                for new in entered.iter().filter(|new| new.node == node) {
                    let own = rounds.iter_mut().filter(|(node, _)| self.flow.is_within(**node, new.of));
                    own.for_each(|(_, rounds)| rounds.since_entered = 0);
                }
            }
            let goes = if is_joined { Goes::Either(node, node) } else { self.goes(node, &mut state)? };
            let is_round = inner.is_some() && matches!(self.flow.nodes[node], Node::Branch { .. });
            node = match goes {
                Goes::To(to) if !(is_round && self.repeats(&mut rounds, node, &state)) => to,
                _ => {
                    let (mut from, mut meets) = (node, self.flow.meets[node]);
                    let mut is_unknown = is_joined;
                    while let Some(last) = entered
                        .pop_if(|last| is_unknown || !meets.is_some_and(|meets| self.flow.is_within(meets, last.of)))
                    {
                        // Whether the loop goes on is not known: all of its rounds are one, from the first on.
                        is_unknown = false;
                        self.joined.insert(last.of);
                        (from, state) = (last.node, last.state);
                        self.machine.back_to(last.mark);
                        meets = self.flow.meets[from];
                        while let Some(within) = meets.filter(|meets| self.flow.is_within(*meets, last.of)) {
                            meets = self.flow.meets[within];
                        }
                    }
                    let is_here = |of| meets.is_some_and(|meets| self.flow.is_within(meets, of));
                    if within.is_some_and(|of| !is_here(of)) {
                        return Ok(None);
                    }
                    state = self.region(from, meets, state)?.ok_or(Stop::Ends)?;
                    inner = entered.last().map(|last| last.of).or(within);
                    meets.ok_or(Stop::Ends)?
                }
            };
        }
    }

    /// Notes which loops are entered at a node, and which are left; whether the rounds of one are known not to be known.
    fn enter(&self, node: usize, within: Option<usize>, state: &M::State, entered: &mut Vec<Entered<M>>) -> bool {
        let mut around: Vec<usize> = self.flow.loops_around(node).take_while(|of| Some(*of) != within).collect();
        around.reverse();
        let kept = entered.iter().zip(&around).take_while(|(entered, of)| entered.of == **of).count();
        entered.truncate(kept);
        for &of in &around[kept..] {
            entered.push(Entered { of, node, state: state.clone(), mark: self.machine.mark() });
            if self.joined.contains(&of) {
                return true;
            }
        }
        false
    }

    /// Counts a round; whether all that holds in it held in an earlier one, or there are too many.
    fn repeats(&self, rounds: &mut BTreeMap<usize, Rounds<M::State>>, node: usize, state: &M::State) -> bool {
        let rounds = rounds.entry(node).or_insert(Rounds { count: 0, since_entered: 0, saved: None });
        if rounds.saved.as_ref().is_some_and(|saved| self.machine.is_same(saved, state)) {
            return true;
        }
        rounds.count += 1;
        rounds.since_entered += 1;
        if rounds.count.is_power_of_two() {
            rounds.saved = Some(state.clone());
        }
        rounds.since_entered > M::MOST_ROUNDS
    }

    /// Runs a node.
    fn goes(&mut self, node: usize, state: &mut M::State) -> Result<Goes, Stop> {
        Ok(Goes::To(match self.flow.nodes[node] {
            Node::Do(step) => {
                self.machine.step(node, step, state)?;
                node + 1
            }
            Node::Return(step) => {
                self.machine.step(node, step, state)?;
                self.exit
            }
            Node::Jump(to) => to,
            Node::Halt => return Err(Stop::Ends),
            Node::Exit => self.exit,
            Node::Branch { test, yes, no } => {
                let holds = self.machine.holds(node, test, state)?;
                match holds.filter(|_| self.machine.unrolls() || self.flow.inner[node].is_none()) {
                    Some(true) => yes,
                    Some(false) => no,
                    None => return Ok(Goes::Either(yes, no)),
                }
            }
        }))
    }

    /// Follows all ways from a node to where they meet; what holds there, if any gets there.
    fn region(&mut self, from: usize, meets: Option<usize>, state: M::State) -> Result<Option<M::State>, Stop> {
        let mut region = Region { from, meets, apart: BTreeMap::new(), is_other: false };
        let mut states = BTreeMap::from([(from, state)]);
        let (mark, notes) = (self.machine.mark(), *self.machine.notes());
        loop {
            *self.machine.notes() = false;
            self.grow(&mut region, &mut states)?;
            *self.machine.notes() = notes;
            if notes {
                region.is_other = false;
                for (node, state) in &states {
                    if Some(*node) != meets {
                        self.ways(*node, &mut region, state.clone())?;
                    }
                }
            }
            if !(notes && region.is_other) {
                return Ok(meets.and_then(|meets| states.remove(&meets)));
            }
            // A loop within it is not what it was a moment ago.
            self.machine.back_to(mark);
        }
    }

    /// Joins what holds at the nodes of a region until it stays the same.
    fn grow(&mut self, region: &mut Region, states: &mut BTreeMap<usize, M::State>) -> Result<(), Stop> {
        loop {
            let revision = self.machine.revision();
            let mut work: BTreeSet<usize> = states.keys().copied().filter(|node| Some(*node) != region.meets).collect();
            while let Some(node) = work.pop_first() {
                let Some(state) = states.get(&node).cloned() else { continue };
                for (to, state) in self.ways(node, region, state)? {
                    let meeting = if to <= node { Meeting::Rounds } else { Meeting::Branches };
                    let is_less = match states.get_mut(&to) {
                        None => states.insert(to, state).is_none(),
                        Some(known) => self.machine.join(known, &state, meeting),
                    };
                    if is_less && Some(to) != region.meets {
                        work.insert(to);
                    }
                }
            }
            if self.machine.revision() == revision {
                return Ok(());
            }
        }
    }

    /// Runs from a node of a region to the next ones that others lead to as well, or through a loop; what holds there.
    fn ways(&mut self, node: usize, region: &mut Region, state: M::State) -> Result<Vec<At<M>>, Stop> {
        let is_apart = |of: &usize| {
            let outside = |node: usize| !self.flow.is_within(node, *of);
            outside(region.from) && region.meets.is_none_or(outside)
        };
        if let Some(of) = self.flow.loop_headed(node).filter(is_apart) {
            let is_followed = region.apart.entry(of).or_insert(!self.joined.contains(&of));
            if *is_followed {
                let mark = self.machine.mark();
                match self.follow(node, Some(of), state.clone()) {
                    Ok(Some(left)) => return Ok(vec![left]),
                    Err(Stop::Ends) => return Ok(Vec::new()),
                    stop => drop(stop?),
                }
                self.machine.back_to(mark);
                self.joined.insert(of);
                *is_followed = false;
                region.is_other = true;
            }
        }
        self.stretch(node, region, state)
    }

    fn stretch(&mut self, from: usize, region: &Region, mut state: M::State) -> Result<Vec<At<M>>, Stop> {
        let mut node = from;
        loop {
            let goes = match self.goes(node, &mut state) {
                Err(Stop::Ends) => return Ok(Vec::new()),
                goes => goes?,
            };
            match goes {
                Goes::To(to) if self.flow.leads[to] || Some(to) == region.meets || to == region.from => {
                    return Ok(vec![(to, state)]);
                }
                Goes::To(to) => node = to,
                Goes::Either(yes, no) => return Ok(vec![(yes, state.clone()), (no, state)]),
            }
        }
    }
}

/// Nodes between one and where all ways from it meet.
struct Region {
    from: usize,
    meets: Option<usize>,
    /// Loops within it that have been reached, and whether they are followed round by round.
    apart: BTreeMap<usize, bool>,
    /// Whether one of them has turned out to be none that is followed.
    is_other: bool,
}
