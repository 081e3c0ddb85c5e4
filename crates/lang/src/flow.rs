//! The steps of a program as a graph: the successors of each, the nodes where branches meet again, the nesting of loops, and the loops that
//! nothing leaves.

use std::collections::{BTreeMap, BTreeSet};

/// One node: a step of the language, which a [`Machine`](crate::walk::Machine) runs, or a decision about the next node.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Node<S, T> {
    /// A step, after which the next node follows.
    Do(S),
    /// A branch to one of two nodes.
    Branch {
        /// The test.
        test: T,
        /// The next node if the test is true.
        yes: usize,
        /// The next node if it is false.
        no: usize,
    },
    /// A jump to a node.
    Jump(usize),
    /// Leaves the routine, by its exit.
    Return(S),
    /// Ends the program.
    Halt,
    /// The end of a routine.
    Exit,
}

/// A loop: nodes from each of which all others can be reached.
#[derive(Clone, Copy, Debug)]
struct Loop {
    /// The loop that contains it.
    parent: Option<usize>,
    /// The node at which it is entered, the first one in the text.
    head: usize,
    /// Whether nothing leaves it.
    is_endless: bool,
}

/// The nodes of all routines.
///
/// # Examples
/// ```
/// let mut flow = deflex_lang::flow::Flow::<&str, &str>::default();
/// flow.add(|routine| {
///     routine.step("grip");
///     routine.branch("part is there", |then| then.step("mill"), |otherwise| otherwise.step("warn"));
/// });
/// ```
#[derive(Debug)]
pub struct Flow<S, T> {
    pub(crate) nodes: Vec<Node<S, T>>,
    /// First node and exit of each routine.
    pub(crate) routines: Vec<(usize, usize)>,
    /// Nodes that are reached from more than one node, or by a branch or a jump. The nodes between two of them run one after the other.
    pub(crate) leads: Vec<bool>,
    /// For each node, the node where all paths to the end of the routine meet again.
    pub(crate) meets: Vec<Option<usize>>,
    /// The innermost loop of each node.
    pub(crate) inner: Vec<Option<usize>>,
    loops: Vec<Loop>,
}

impl<S: Copy, T: Copy> Default for Flow<S, T> {
    fn default() -> Self {
        Self {
            nodes: Vec::new(),
            routines: Vec::new(),
            leads: Vec::new(),
            meets: Vec::new(),
            inner: Vec::new(),
            loops: Vec::new(),
        }
    }
}

impl<S: Copy, T: Copy> Flow<S, T> {
    /// Adds a routine, which gets the next number.
    pub fn add<'n>(&mut self, build: impl FnOnce(&mut Builder<'n, S, T>)) {
        let mut builder = Builder { nodes: std::mem::take(&mut self.nodes), ..Builder::default() };
        let first = builder.nodes.len();
        build(&mut builder);
        let exit = builder.nodes.len();
        builder.nodes.push(Node::Exit);
        let Builder { nodes, labels, jumps, .. } = builder;
        self.nodes = nodes;
        for (at, label) in jumps {
            // A label that is not there is an error of the program, which no controller runs.
            match (labels.get(label).copied(), &mut self.nodes[at]) {
                (Some(to), Node::Branch { yes, .. }) => *yes = to,
                (Some(to), node) => *node = Node::Jump(to),
                (None, Node::Branch { .. }) => {}
                (None, node) => *node = Node::Halt,
            }
        }
        self.routines.push((first, exit));
        let count = self.nodes.len();
        self.leads.resize(count, false);
        self.meets.resize(count, None);
        self.inner.resize(count, None);
        self.lead(first, exit);
        self.meet(first, exit);
        self.loops_of(&(first..=exit).collect::<Vec<_>>(), exit, None);
    }

    /// Whether a node belongs to a loop.
    pub(crate) fn is_within(&self, node: usize, of: usize) -> bool {
        self.loops_around(node).any(|around| around == of)
    }

    /// Whether a loop is another one or is inside it.
    pub(crate) fn is_loop_within(&self, inner: usize, of: usize) -> bool {
        std::iter::successors(Some(inner), |inner| self.loops[*inner].parent).any(|around| around == of)
    }

    /// Whether nothing leaves a loop.
    pub(crate) fn is_endless(&self, of: usize) -> bool {
        self.loops[of].is_endless
    }

    /// The node after a loop where all paths from a node in it meet.
    pub(crate) fn meet_after(&self, node: usize, of: usize) -> Option<usize> {
        std::iter::successors(self.meets[node], |meets| self.meets[*meets].filter(|next| next != meets))
            .find(|meets| !self.is_within(*meets, of))
    }

    /// The loops of a node, from the innermost to the outermost.
    pub(crate) fn loops_around(&self, node: usize) -> impl Iterator<Item = usize> + use<'_, S, T> {
        std::iter::successors(self.inner[node], |of| self.loops[*of].parent)
    }

    /// The innermost loop of a node, if the node is its entry.
    pub(crate) fn loop_headed(&self, node: usize) -> Option<usize> {
        self.inner[node].filter(|of| self.loops[*of].head == node)
    }

    /// The successors of a node.
    fn next(&self, node: usize, exit: usize) -> impl Iterator<Item = usize> + use<S, T> {
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

    /// Finds loops as strongly connected components (Tarjan 1972), then inner loops as those of each component without its head, and the
    /// loops that never end.
    fn loops_of(&mut self, nodes: &[usize], exit: usize, parent: Option<usize>) {
        const NEW: usize = usize::MAX;
        /// Most nesting levels of loops that are distinguished: more than programs have, and each level costs a pass.
        const DEEPEST: usize = 32;
        if std::iter::successors(parent, |of| self.loops[*of].parent).count() >= DEEPEST {
            return;
        }
        let count = nodes.len();
        let place = |node: usize| nodes.binary_search(&node).ok();
        let (mut number, mut low, mut on) = (vec![NEW; count], vec![NEW; count], vec![false; count]);
        let (mut path, mut next, mut found) = (Vec::new(), 0, Vec::new());
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
                let to = self.next(nodes[node], exit).nth(*at);
                *at += 1;
                match to.map(place) {
                    Some(Some(to)) if number[to] == NEW => stack.push((to, 0)),
                    Some(Some(to)) if on[to] => low[node] = low[node].min(number[to]),
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
                            found.push(members.into_iter().map(|member| nodes[member]).collect::<BTreeSet<_>>());
                        }
                    }
                }
            }
        }
        let steps = |node: &usize| self.next(*node, exit).collect::<Vec<_>>();
        found.retain(|within| within.len() > 1 || within.iter().any(|node| steps(node).contains(node)));
        for within in found {
            let of = self.loops.len();
            // Paths from elsewhere enter the loop at its head, except for jumps into the middle of it.
            let outer = nodes.iter().filter(|node| !within.contains(node));
            let entered: BTreeSet<usize> = outer.flat_map(|node| self.next(*node, exit)).collect();
            let head = within.iter().find(|node| entered.contains(node)).or(within.first()).copied().unwrap_or(exit);
            let is_endless = within.iter().flat_map(|node| self.next(*node, exit)).all(|to| within.contains(&to));
            self.loops.push(Loop { parent, head, is_endless });
            within.iter().for_each(|node| self.inner[*node] = Some(of));
            let rest: Vec<usize> = within.into_iter().filter(|node| *node != head).collect();
            self.loops_of(&rest, exit, Some(of));
        }
    }
}

/// Lays steps out one after the other.
///
/// # Examples
/// ```
/// let mut flow = deflex_lang::flow::Flow::<&str, &str>::default();
/// flow.add(|routine| {
///     routine.repeat(|round| {
///         round.step("mill");
///         round.branch("part is done", |then| then.leave(), |_| {});
///     });
///     routine.choose([("first shift", "greet"), ("night", "dim")], "wait", |path, step| path.step(step));
///     routine.branch("emergency", |then| then.halt(), |_| {});
///     routine.jump(b"away");
///     routine.label(b"away");
///     routine.returns("home");
/// });
/// ```
#[derive(Debug)]
pub struct Builder<'n, S, T> {
    nodes: Vec<Node<S, T>>,
    labels: BTreeMap<&'n [u8], usize>,
    jumps: Vec<(usize, &'n [u8])>,
    /// The start of the innermost loop, and the jumps that leave it, whose targets are set at its end.
    loops: Vec<(usize, Vec<usize>)>,
}

impl<S, T> Default for Builder<'_, S, T> {
    fn default() -> Self {
        Self { nodes: Vec::new(), labels: BTreeMap::new(), jumps: Vec::new(), loops: Vec::new() }
    }
}

impl<'n, S, T> Builder<'n, S, T> {
    /// Reserves a node that is set later.
    fn gap(&mut self) -> usize {
        self.nodes.push(Node::Halt);
        self.nodes.len() - 1
    }

    /// A step.
    pub fn step(&mut self, step: S) {
        self.nodes.push(Node::Do(step));
    }

    /// Adds a branch with two paths.
    pub fn branch(&mut self, test: T, then: impl FnOnce(&mut Self), otherwise: impl FnOnce(&mut Self)) {
        let branch = self.gap();
        then(self);
        let end_of_then = self.gap();
        self.nodes[branch] = Node::Branch { test, yes: branch + 1, no: self.nodes.len() };
        otherwise(self);
        self.nodes[end_of_then] = Node::Jump(self.nodes.len());
    }

    /// Adds a branch with a test for each path but the last one, which runs if no test is true.
    pub fn choose<P>(&mut self, paths: impl IntoIterator<Item = (T, P)>, otherwise: P, lay: impl Fn(&mut Self, P)) {
        let mut ends = Vec::new();
        for (test, path) in paths {
            let branch = self.gap();
            lay(self, path);
            ends.push(self.gap());
            self.nodes[branch] = Node::Branch { test, yes: branch + 1, no: self.nodes.len() };
        }
        lay(self, otherwise);
        let end = self.nodes.len();
        ends.into_iter().for_each(|gap| self.nodes[gap] = Node::Jump(end));
    }

    /// Adds a loop, which [`Self::leave`] leaves.
    pub fn repeat(&mut self, body: impl FnOnce(&mut Self)) {
        // A node of its own: a loop that begins with another is another loop.
        let start = self.gap();
        self.nodes[start] = Node::Jump(start + 1);
        self.loops.push((start, Vec::new()));
        body(self);
        self.nodes.push(Node::Jump(start));
        let end = self.nodes.len();
        let (_, leaves) = self.loops.pop().unwrap_or_default();
        leaves.into_iter().for_each(|gap| self.nodes[gap] = Node::Jump(end));
    }

    /// Leaves the innermost loop. Without a loop this is an error of the program, and the next node follows.
    pub fn leave(&mut self) {
        let gap = self.nodes.len();
        if let Some((_, leaves)) = self.loops.last_mut() {
            leaves.push(gap);
            self.nodes.push(Node::Halt);
        }
    }

    /// Continues with the next round of the innermost loop.
    pub(crate) fn again(&mut self) {
        let to = self.loops.last().map(|(start, _)| *start);
        self.nodes.push(to.map_or(Node::Halt, Node::Jump));
    }

    /// Adds a label, to which jumps of the same routine lead.
    pub fn label(&mut self, name: &'n [u8]) {
        let at = self.nodes.len();
        self.labels.insert(name, at);
    }

    /// Adds a jump to a label.
    pub fn jump(&mut self, to: &'n [u8]) {
        let at = self.gap();
        self.jumps.push((at, to));
    }

    /// Adds a jump to a label if a test is true.
    pub(crate) fn jump_if(&mut self, test: T, to: &'n [u8]) {
        let at = self.gap();
        self.nodes[at] = Node::Branch { test, yes: at + 1, no: at + 1 };
        self.jumps.push((at, to));
    }

    /// Leaves the routine.
    pub fn returns(&mut self, step: S) {
        self.nodes.push(Node::Return(step));
    }

    /// Ends the program.
    pub fn halt(&mut self) {
        self.nodes.push(Node::Halt);
    }
}
