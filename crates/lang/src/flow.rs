//! Statements as a graph: where each goes on, where branches meet again, which loops nothing leaves.

use crate::ir::{Expression, ExpressionKind, FunctionId, Program, Statement, StatementKind};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One step.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Node<'a> {
    /// A statement that goes on at the next node.
    Do(&'a Statement),
    /// Goes on here or there.
    Branch { condition: &'a Expression, yes: usize, no: usize },
    /// Goes on there.
    Jump(usize),
    /// Leaves the routine, by its exit.
    Return(Option<&'a Expression>),
    /// Ends the program.
    Halt,
    /// The end of a routine.
    Exit,
}

/// The steps of all routines.
#[derive(Debug, Default)]
pub(crate) struct Flow<'a> {
    pub(crate) nodes: Vec<Node<'a>>,
    /// First node and exit of each routine.
    pub(crate) routines: Vec<(usize, usize)>,
    /// Nodes that more than one node, a branch or a jump goes on at: what is run from one to the next stands in a row in the text.
    pub(crate) leads: Vec<bool>,
    /// Where all ways from a node that end the routine meet again.
    pub(crate) meets: Vec<Option<usize>>,
    /// The loop, or the loops within each other, that a node belongs to: it may run more than once in one run of its routine.
    pub(crate) cycle: Vec<Option<usize>>,
    /// Nodes of a loop that nothing leaves.
    pub(crate) endless: Vec<bool>,
}

impl<'a> Flow<'a> {
    pub(crate) fn new(program: &'a Program) -> Self {
        let mut flow = Self::default();
        for function in &program.functions {
            let mut builder = Builder { nodes: std::mem::take(&mut flow.nodes), ..Builder::default() };
            let first = builder.nodes.len();
            builder.block(&function.body);
            let exit = builder.nodes.len();
            builder.nodes.push(Node::Exit);
            let Builder { nodes, labels, jumps, .. } = builder;
            flow.nodes = nodes;
            for (at, label) in jumps {
                // A label that is not there is an error of the program, which no controller runs.
                match (labels.get(&label).copied(), &mut flow.nodes[at]) {
                    (Some(to), Node::Branch { yes, .. }) => *yes = to,
                    (Some(to), node) => *node = Node::Jump(to),
                    (None, Node::Branch { .. }) => {}
                    (None, node) => *node = Node::Halt,
                }
            }
            flow.routines.push((first, exit));
        }
        let count = flow.nodes.len();
        flow.leads = vec![false; count];
        flow.meets = vec![None; count];
        (flow.cycle, flow.endless) = (vec![None; count], vec![false; count]);
        for (first, exit) in flow.routines.clone() {
            flow.lead(first, exit);
            flow.meet(first, exit);
            flow.cycles(first, exit);
        }
        flow
    }

    pub(crate) fn routine(&self, id: FunctionId) -> (usize, usize) {
        self.routines[id.0 as usize]
    }

    /// Where a node goes on.
    fn next(&self, node: usize, exit: usize) -> impl Iterator<Item = usize> + use<> {
        let (a, b) = match self.nodes[node] {
            Node::Do(_) => (Some(node + 1), None),
            Node::Branch { yes, no, .. } => (Some(yes), Some(no)),
            Node::Jump(to) => (Some(to), None),
            Node::Return(_) => (Some(exit), None),
            Node::Halt | Node::Exit => (None, None),
        };
        a.into_iter().chain(b)
    }

    fn lead(&mut self, first: usize, exit: usize) {
        let mut seen = vec![false; exit + 1 - first];
        for node in first..=exit {
            let leaps = matches!(self.nodes[node], Node::Branch { .. } | Node::Jump(_));
            for to in self.next(node, exit) {
                self.leads[to] |= leaps || seen[to - first];
                seen[to - first] = true;
            }
        }
        // A routine may begin with a loop.
        self.leads[first] |= seen[0];
        self.leads[exit] = true;
    }

    /// Immediate post-dominators (Cooper, Harvey and Kennedy, *A Simple, Fast Dominance Algorithm*, 2001, on the reversed graph).
    fn meet(&mut self, first: usize, exit: usize) {
        let count = exit + 1 - first;
        let mut before: Vec<Vec<usize>> = vec![Vec::new(); count];
        for node in first..=exit {
            for to in self.next(node, exit) {
                before[to - first].push(node - first);
            }
        }
        // In post-order of the reversed graph, from the exit.
        let (mut order, mut number) = (Vec::new(), vec![usize::MAX; count]);
        let mut stack = vec![(exit - first, 0)];
        let mut entered = vec![false; count];
        entered[exit - first] = true;
        while let Some((node, at)) = stack.last_mut() {
            if let Some(&from) = before[*node].get(*at) {
                *at += 1;
                if !std::mem::replace(&mut entered[from], true) {
                    stack.push((from, 0));
                }
            } else {
                number[*node] = order.len();
                order.push(*node);
                stack.pop();
            }
        }
        let mut meets: Vec<Option<usize>> = vec![None; count];
        meets[exit - first] = Some(exit - first);
        let mut changed = true;
        while changed {
            changed = false;
            for &node in order.iter().rev().skip(1) {
                let mut found: Option<usize> = None;
                for to in self.next(node + first, exit).map(|to| to - first).filter(|to| meets[*to].is_some()) {
                    let mut at = to;
                    if let Some(mut other) = found {
                        while at != other {
                            while number[at] < number[other] {
                                at = meets[at].unwrap_or(at);
                            }
                            while number[other] < number[at] {
                                other = meets[other].unwrap_or(other);
                            }
                        }
                    }
                    found = Some(at);
                }
                if found.is_some() && meets[node] != found {
                    meets[node] = found;
                    changed = true;
                }
            }
        }
        for node in 0..count - 1 {
            self.meets[node + first] = meets[node].map(|at| at + first);
        }
    }

    /// Strongly connected components (Tarjan 1972): what repeats, and what never ends.
    fn cycles(&mut self, first: usize, exit: usize) {
        const NEW: usize = usize::MAX;
        let count = exit + 1 - first;
        let (mut number, mut low, mut on) = (vec![NEW; count], vec![NEW; count], vec![false; count]);
        let (mut path, mut next) = (Vec::new(), 0);
        for root in 0..count {
            if number[root] != NEW {
                continue;
            }
            let mut stack = vec![(root, 0)];
            while let Some(&mut (node, ref mut at)) = stack.last_mut() {
                if *at == 0 {
                    (number[node], low[node], on[node]) = (next, next, true);
                    next += 1;
                    path.push(node);
                }
                let to = self.next(node + first, exit).nth(*at).map(|to| to - first);
                *at += 1;
                match to {
                    Some(to) if number[to] == NEW => stack.push((to, 0)),
                    Some(to) if on[to] => low[node] = low[node].min(number[to]),
                    Some(_) => {}
                    None => {
                        stack.pop();
                        if let Some(&(parent, _)) = stack.last() {
                            low[parent] = low[parent].min(low[node]);
                        }
                        if low[node] == number[node] {
                            let from = path.iter().rposition(|other| *other == node).unwrap_or(0);
                            let members = path.split_off(from);
                            members.iter().for_each(|member| on[*member] = false);
                            self.component(&members, first, exit);
                        }
                    }
                }
            }
        }
    }

    fn component(&mut self, members: &[usize], first: usize, exit: usize) {
        let within: std::collections::BTreeSet<usize> = members.iter().map(|member| member + first).collect();
        let steps = |node: &usize| self.next(*node, exit).collect::<Vec<_>>();
        let repeats = within.len() > 1 || within.iter().any(|node| steps(node).contains(node));
        let endless = repeats && within.iter().flat_map(steps).all(|to| within.contains(&to));
        let cycle = within.first().copied().filter(|_| repeats);
        for node in within {
            (self.cycle[node], self.endless[node]) = (cycle, endless);
        }
    }
}

/// Lays statements out one after the other.
#[derive(Default)]
struct Builder<'a> {
    nodes: Vec<Node<'a>>,
    labels: BTreeMap<Arc<str>, usize>,
    jumps: Vec<(usize, Arc<str>)>,
    /// Where the innermost loop begins, and jumps out of it that wait for its end.
    loops: Vec<(usize, Vec<usize>)>,
}

impl<'a> Builder<'a> {
    /// A node that is filled in later.
    fn gap(&mut self) -> usize {
        self.nodes.push(Node::Halt);
        self.nodes.len() - 1
    }

    fn block(&mut self, statements: &'a [Statement]) {
        statements.iter().for_each(|statement| self.statement(statement));
    }

    fn statement(&mut self, statement: &'a Statement) {
        match &statement.kind {
            StatementKind::If { arms, otherwise } => {
                let mut ends = Vec::new();
                for (condition, body) in arms {
                    let branch = self.gap();
                    self.block(body);
                    ends.push(self.gap());
                    self.nodes[branch] = Node::Branch { condition, yes: branch + 1, no: self.nodes.len() };
                }
                self.block(otherwise);
                let end = self.nodes.len();
                ends.into_iter().for_each(|gap| self.nodes[gap] = Node::Jump(end));
            }
            StatementKind::Loop { condition, body } => {
                let start = self.nodes.len();
                let always = |e: &&Expression| !matches!(e.kind, ExpressionKind::Truth(true));
                let condition = condition.as_ref().filter(always);
                let branch = condition.map(|_| self.gap());
                self.loops.push((start, Vec::new()));
                self.block(body);
                self.nodes.push(Node::Jump(start));
                let end = self.nodes.len();
                let (_, breaks) = self.loops.pop().unwrap_or_default();
                breaks.into_iter().for_each(|gap| self.nodes[gap] = Node::Jump(end));
                if let (Some(condition), Some(branch)) = (condition, branch) {
                    self.nodes[branch] = Node::Branch { condition, yes: branch + 1, no: end };
                }
            }
            StatementKind::Break => {
                let gap = self.gap();
                if let Some((_, breaks)) = self.loops.last_mut() {
                    breaks.push(gap);
                }
            }
            StatementKind::Continue => {
                let to = self.loops.last().map(|(start, _)| *start);
                self.nodes.push(to.map_or(Node::Halt, Node::Jump));
            }
            StatementKind::Label(name) => {
                let at = self.nodes.len();
                self.labels.insert(Arc::clone(name), at);
            }
            StatementKind::Jump { to, condition } => {
                let at = self.gap();
                if let Some(condition) = condition {
                    self.nodes[at] = Node::Branch { condition, yes: at + 1, no: at + 1 };
                }
                self.jumps.push((at, Arc::clone(to)));
            }
            StatementKind::Return(value) => self.nodes.push(Node::Return(value.as_ref())),
            StatementKind::Halt => self.nodes.push(Node::Halt),
            StatementKind::Assign { .. }
            | StatementKind::Evaluate(_)
            | StatementKind::Move(_)
            | StatementKind::Opaque { .. } => self.nodes.push(Node::Do(statement)),
        }
    }
}
