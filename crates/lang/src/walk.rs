//! The walk over a [`Flow`]: which steps run, and the state at each. It does not depend on what the steps and the states are.
//!
//! A known test is followed, and so are loops, round by round. From an unknown test on, all paths are followed to where they meet again, or
//! to the end of the round. Their states are joined until they no longer change. A loop that nothing leaves, or with an unknown number of
//! rounds, is treated like this from its beginning: all of its rounds are one. A loop within it whose own rounds are known is still
//! followed round by round (as in a hierarchical iteration: Bourdoncle 1993, *Efficient chaotic iteration strategies with widenings*).

use crate::flow::{Flow, Node};
use std::collections::{BTreeMap, BTreeSet};

/// Most rounds of a loop that are followed one by one although an unknown test may have left it in each of them. A known
/// test is to end such a loop, but it may be one that never does. Programs count a few thousand rows of a part, and so
/// many rounds take less than a second.
const MAX_UNCERTAIN_ROUNDS: u32 = 10_000;

/// Number of values that are compared and copied in about the time in which a statement runs.
pub const VALUES_PER_STEP: usize = 256;

/// Why a run stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The program ends, or continues forever.
    Ends,
    /// It does not end within the bounds of a run.
    TooLong,
}

/// A place where two paths meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// After one of several branches.
    Branches,
    /// At the beginning of a further round of a loop.
    Rounds,
}

/// The machine that runs the steps of a language. The state between steps is passed to it.
///
/// # Examples
/// ```
/// use deflex_lang::flow::Flow;
/// use deflex_lang::walk::{Machine, Meeting, Stop, walk};
///
/// /// A machine whose steps add a number.
/// struct Sum {
///     records: bool,
/// }
/// impl Machine for Sum {
///     type Step = u32;
///     type Test = bool;
///     type State = u32;
///     type Mark = ();
///     fn step(&mut self, _: usize, step: u32, state: &mut u32) -> Result<(), Stop> {
///         *state += step;
///         Ok(())
///     }
///     fn holds(&mut self, _: usize, test: bool, _: &mut u32) -> Result<Option<bool>, Stop> {
///         Ok(Some(test))
///     }
///     fn join(&mut self, _: &mut u32, _: &u32, _: Meeting) -> bool {
///         false
///     }
///     fn lose_place(&self, _: &mut u32) {}
///     fn forget_last(&mut self) {}
///     fn is_same(&self, a: &u32, b: &u32) -> bool {
///         a == b
///     }
///     fn is_recording(&mut self) -> &mut bool {
///         &mut self.records
///     }
///     fn mark(&mut self) {}
///     fn back_to(&mut self, (): ()) {}
///     fn is_too_much(&self, (): ()) -> bool {
///         false
///     }
/// }
///
/// let mut flow = Flow::default();
/// flow.add(|routine| {
///     routine.step(1);
///     routine.branch(true, |then| then.step(2), |otherwise| otherwise.step(100));
/// });
/// assert_eq!(walk(&mut Sum { records: true }, &flow, 0, 0), Ok(3));
/// ```
pub trait Machine {
    /// The work of a node.
    type Step: Copy;
    /// The test that decides between two paths.
    type Test: Copy;
    /// The state at one moment.
    type State: Clone;
    /// The size of the results so far.
    type Mark: Copy;

    /// Runs a step.
    ///
    /// # Errors
    /// The run stops.
    fn step(&mut self, node: usize, step: Self::Step, state: &mut Self::State) -> Result<(), Stop>;

    /// The result of a test; `None` if it is unknown.
    ///
    /// # Errors
    /// The run does not go on.
    fn holds(&mut self, node: usize, test: Self::Test, state: &mut Self::State) -> Result<Option<bool>, Stop>;

    /// Joins a state with another one: only what is true in both stays known. Returns whether anything is less known than before.
    fn join(&mut self, known: &mut Self::State, other: &Self::State, meeting: Meeting) -> bool;

    /// Makes the last motion of the arm unknown, because the loop continues after this state has left it and may repeat a motion.
    fn lose_place(&self, state: &mut Self::State);

    /// Forgets the last recorded motion: the next motions may run in another order than they are recorded, and one of them may be the same
    /// statement in a later round.
    fn forget_last(&mut self);

    /// Whether two states are equal, so that everything after them is equal.
    fn is_same(&self, a: &Self::State, b: &Self::State) -> bool;

    /// Whether results are recorded. They are not while states are still being joined.
    fn is_recording(&mut self) -> &mut bool;

    /// A marker for the results so far.
    fn mark(&mut self) -> Self::Mark;

    /// Discards the results since a marker.
    fn back_to(&mut self, mark: Self::Mark);

    /// Whether a loop that began at a marker has taken so many steps that its rounds are to be run as one.
    fn is_too_much(&self, since: Self::Mark) -> bool;

    /// Whether a loop may count its rounds by this test.
    fn counts_rounds(&self, _: Self::Test) -> bool {
        true
    }

    /// Whether loops with known tests are followed round by round.
    fn unrolls(&self) -> bool {
        true
    }
}

/// Runs a routine from a state, and returns the state at its end.
///
/// # Errors
/// The routine has no end, or the run stops within it.
pub fn walk<M: Machine>(
    machine: &mut M,
    flow: &Flow<M::Step, M::Test>,
    routine: usize,
    state: M::State,
) -> Result<M::State, Stop> {
    let (first, exit) = flow.routines[routine];
    let mut walk = Walk { machine, flow, exit, joined: BTreeSet::new(), counted: BTreeSet::new() };
    walk.follow(first, None, state)?.and_then(|mut ends| ends.remove(&exit)).ok_or(Stop::Ends)
}

struct Walk<'w, M: Machine> {
    machine: &'w mut M,
    flow: &'w Flow<M::Step, M::Test>,
    exit: usize,
    /// Loops whose number of rounds has turned out to be unknown.
    joined: BTreeSet<usize>,
    /// Loops that a known test has not left in this round.
    counted: BTreeSet<usize>,
}

/// Where the run continues after a step.
enum Goes {
    To(usize),
    /// After an unknown test: at one of these two nodes.
    Either(usize, usize),
}

/// A node at which the run continues, with the state there.
type At<M> = (usize, <M as Machine>::State);

/// The states at nodes.
type States<M> = BTreeMap<usize, <M as Machine>::State>;

/// Detects a round of a loop that is equal to an earlier one (Brent 1980, *An improved Monte Carlo factorization algorithm*).
struct Rounds<S> {
    count: u64,
    saved: Option<S>,
}

/// A region: nodes that are run together, because it is unknown which of them run.
struct Region {
    /// The loop that contains them.
    within: Option<usize>,
    /// The loop that they form, if its number of rounds is unknown.
    joined: Option<usize>,
    ends: Ends,
    /// Inner loops that were reached, and whether they are followed round by round.
    apart: BTreeMap<usize, bool>,
    /// Whether an inner loop has turned out not to be followed.
    is_other: bool,
    /// Whether a path leads to a node from a later one.
    jumps_back: bool,
}

/// The end of a region.
#[derive(Clone, Copy)]
enum Ends {
    /// The node where all paths meet, if they do.
    Meet(Option<usize>),
    /// The end of a round of the loop, or its exits.
    Round(usize),
}

impl<M: Machine> Walk<'_, M> {
    /// Runs from a node: in a loop to the nodes after it, otherwise to the end of the routine. `None` if the number of rounds is unknown.
    fn follow(&mut self, from: usize, within: Option<usize>, mut state: M::State) -> Result<Option<States<M>>, Stop> {
        let (mut out, mut rounds, mut node) = (BTreeMap::new(), Rounds { count: 0, saved: None }, from);
        let begun = self.machine.mark();
        // Whether a test that is not known may have left the loop in this round, and the number of such rounds.
        let (mut may_have_left, mut uncertain) = (false, 0);
        loop {
            if !self.is_in(node, within) || node == self.exit {
                self.meet(&mut out, node, state, Meeting::Branches);
                return Ok(Some(out));
            }
            if within.is_some() && self.flow.loop_headed(node) == within {
                let is_counted = within.is_some_and(|of| self.counted.remove(&of));
                let is_endless = self.repeats(&mut rounds, &state) || self.machine.is_too_much(begun);
                uncertain += u32::from(may_have_left);
                if may_have_left && !is_counted || is_endless || uncertain > MAX_UNCERTAIN_ROUNDS {
                    return Ok(None);
                }
                may_have_left = false;
                out.values_mut().for_each(|state| self.machine.lose_place(state));
            }
            let inner = self.flow.loops_around(node).take_while(|of| Some(*of) != within).last();
            let ends = if let Some(of) = inner {
                let ends = self.ends(self.flow.meet_after(node, of), within);
                may_have_left |= matches!(ends, Ends::Round(_));
                self.pass(node, of, (within, ends), state)?
            } else {
                match self.goes(node, &mut state) {
                    Err(Stop::Ends) => return Ok(Some(out)),
                    Err(stop) => return Err(stop),
                    Ok(Goes::To(to)) => {
                        node = to;
                        continue;
                    }
                    Ok(Goes::Either(..)) => {
                        let ends = self.ends(self.flow.meets[node], within);
                        may_have_left |= matches!(ends, Ends::Round(_));
                        let region = Region {
                            within,
                            joined: None,
                            ends,
                            apart: BTreeMap::new(),
                            is_other: false,
                            jumps_back: false,
                        };
                        self.region(region, BTreeMap::from([(node, state)]))?
                    }
                }
            };
            let mut next = None;
            for (node, state) in ends {
                if self.is_in(node, within) {
                    next = Some((node, state));
                } else {
                    self.meet(&mut out, node, state, Meeting::Rounds);
                }
            }
            let Some(at) = next else { return Ok(Some(out)) };
            (node, state) = at;
        }
    }

    /// Runs through a loop, which may be inside another one. Returns the states at which the outer region continues.
    fn pass(
        &mut self,
        node: usize,
        of: usize,
        (within, ends): (Option<usize>, Ends),
        state: M::State,
    ) -> Result<States<M>, Stop> {
        let mark = self.machine.mark();
        let region =
            |joined| Region { within, joined, ends, apart: BTreeMap::new(), is_other: false, jumps_back: false };
        if self.is_followed(of) {
            if let Some(mut left) = self.follow(node, Some(of), state.clone())? {
                let outside: Vec<usize> = left.keys().copied().filter(|node| !self.is_in(*node, within)).collect();
                if left.len() - outside.len() <= 1 {
                    return Ok(left);
                }
                let outside: Vec<At<M>> = outside.into_iter().filter_map(|node| left.remove_entry(&node)).collect();
                let mut ends = self.region(region(None), left)?;
                for (node, state) in outside {
                    self.meet(&mut ends, node, state, Meeting::Branches);
                }
                return Ok(ends);
            }
            self.machine.back_to(mark);
            self.joined.insert(of);
        }
        self.region(region(Some(of)), BTreeMap::from([(node, state)]))
    }

    fn is_followed(&self, of: usize) -> bool {
        self.machine.unrolls() && !self.flow.is_endless(of) && !self.joined.contains(&of)
    }

    /// The end of a region whose paths meet at a node.
    fn ends(&self, meets: Option<usize>, within: Option<usize>) -> Ends {
        match within {
            Some(of) if !meets.is_some_and(|meets| self.flow.is_within(meets, of)) => Ends::Round(of),
            _ => Ends::Meet(meets),
        }
    }

    /// Whether a node belongs to a loop; true without a loop.
    fn is_in(&self, node: usize, within: Option<usize>) -> bool {
        within.is_none_or(|of| self.flow.is_within(node, of))
    }

    /// Adds a state at a node. Returns whether less is known there than before.
    fn meet(&mut self, states: &mut States<M>, node: usize, state: M::State, meeting: Meeting) -> bool {
        match states.get_mut(&node) {
            None => states.insert(node, state).is_none(),
            Some(known) => self.machine.join(known, &state, meeting),
        }
    }

    /// Counts a round. Returns whether its state is equal to that of an earlier round.
    fn repeats(&self, rounds: &mut Rounds<M::State>, state: &M::State) -> bool {
        if rounds.saved.as_ref().is_some_and(|saved| self.machine.is_same(saved, state)) {
            return true;
        }
        rounds.count += 1;
        if rounds.count.is_power_of_two() {
            rounds.saved = Some(state.clone());
        }
        false
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
                let (holds, inner) = (self.machine.holds(node, test, state)?, self.flow.inner[node]);
                let Some(holds) = holds.filter(|_| self.machine.unrolls() || inner.is_none()) else {
                    return Ok(Goes::Either(yes, no));
                };
                let (to, other) = if holds { (yes, no) } else { (no, yes) };
                let stays = |of: &usize| self.is_in(to, Some(*of)) && !self.is_in(other, Some(*of));
                self.counted.extend(inner.filter(|of| self.machine.counts_rounds(test) && stays(of)));
                to
            }
        }))
    }

    /// Follows all paths from some nodes to the end of the region. Returns the states there.
    fn region(&mut self, mut region: Region, mut states: States<M>) -> Result<States<M>, Stop> {
        let (mark, is_recording) = (self.machine.mark(), *self.machine.is_recording());
        loop {
            *self.machine.is_recording() = false;
            self.grow(&mut region, &mut states)?;
            *self.machine.is_recording() = is_recording;
            region.is_other = false;
            if is_recording {
                // The motions are recorded in the order of the nodes.
                if region.jumps_back {
                    self.machine.forget_last();
                }
                for (node, state) in &states {
                    if !self.is_end(&region, *node) {
                        self.ways(*node, &mut region, state.clone())?;
                    }
                }
            }
            if !region.is_other {
                states.retain(|node, _| self.is_end(&region, *node));
                return Ok(states);
            }
            // A loop within it is not what it was a moment ago.
            self.machine.back_to(mark);
        }
    }

    fn is_end(&self, region: &Region, node: usize) -> bool {
        match region.ends {
            Ends::Meet(meets) => meets == Some(node),
            Ends::Round(of) => self.flow.loop_headed(node) == Some(of) || !self.flow.is_within(node, of),
        }
    }

    /// Joins the states at the nodes of a region until they no longer change.
    fn grow(&mut self, region: &mut Region, states: &mut States<M>) -> Result<(), Stop> {
        let mut work: BTreeSet<usize> = states.keys().copied().filter(|node| !self.is_end(region, *node)).collect();
        while let Some(node) = work.pop_first() {
            let Some(state) = states.get(&node).cloned() else { continue };
            for (to, state) in self.ways(node, region, state)? {
                let meeting = if to <= node { Meeting::Rounds } else { Meeting::Branches };
                region.jumps_back |= to <= node;
                if self.meet(states, to, state, meeting) && !self.is_end(region, to) {
                    work.insert(to);
                }
            }
        }
        Ok(())
    }

    /// Runs from a node of a region to the next nodes at which paths meet, or through a loop. Returns the states there.
    fn ways(&mut self, node: usize, region: &mut Region, state: M::State) -> Result<Vec<At<M>>, Stop> {
        let is_apart = |of: &usize| {
            let is_around = region.within.is_some_and(|within| self.flow.is_loop_within(within, *of));
            let has_end = matches!(region.ends, Ends::Meet(Some(meets)) if self.flow.is_within(meets, *of));
            !is_around && !has_end && region.joined != Some(*of)
        };
        if let Some(of) = self.flow.loop_headed(node).filter(is_apart) {
            let is_followed = *region.apart.entry(of).or_insert(self.is_followed(of));
            if is_followed {
                let mark = self.machine.mark();
                if let Some(left) = self.follow(node, Some(of), state.clone())? {
                    return Ok(left.into_iter().collect());
                }
                self.machine.back_to(mark);
                self.joined.insert(of);
                region.apart.insert(of, false);
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
                Goes::To(to) if self.flow.leads[to] || self.is_end(region, to) => return Ok(vec![(to, state)]),
                Goes::To(to) => node = to,
                Goes::Either(yes, no) => return Ok(vec![(yes, state.clone()), (no, state)]),
            }
        }
    }
}
