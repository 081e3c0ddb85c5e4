//! The abstract run: finds what is true at each motion in every run that a controller could make.
//!
//! [`walk`](crate::walk) decides which statements run. Where paths meet, only values that are the same on all of them stay known. Each
//! motion on the paths counts once, in the order of the text.

use crate::dialect::{Arguments, Dialect};
use crate::flow::{Builder, Flow, Node};
use crate::ir::{
    Argument, Binary, Callee, Expression, ExpressionKind, FunctionId, Motion, Path, Program, Slot, SourceSpan,
    Statement, StatementKind, Switch, TokenId, Unary,
};
use crate::reason::Reason;
pub use crate::store::MotionEnd;
use crate::store::{Stands, Store, Values};
use crate::value::{Affine, Content, Number, Pose, Reads, Value, is_whole};
use crate::walk::{Machine, Meeting, Stop, walk};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The result of a run.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// println!("{} motions, {} numbers with another use", outcome.motions.len(), outcome.used.len());
/// ```
#[derive(Debug, Default)]
pub struct Outcome {
    /// Motions, in running order.
    pub motions: Vec<Moved>,
    /// Tokens that are used for more than the targets of motions.
    pub used: BTreeMap<TokenId, Reason>,
}

/// An executed motion, with the values that are known there.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// let moved = &outcome.motions[0];
/// assert_eq!((moved.speed, moved.in_thread), (Some(0.025), false));
/// assert_eq!(moved.to.pose().unwrap().pose().translation.x, 0.5);
/// ```
#[derive(Clone, Debug)]
pub struct Moved {
    /// Its statement.
    pub place: SourceSpan,
    /// The kind of its path.
    pub path: Path,
    /// The circle point, for a circle.
    pub via: Option<Value>,
    /// The target.
    pub to: Value,
    /// Speed, in the language's unit.
    pub speed: Option<f64>,
    /// Distance from the end at which the path is left, in the language's unit; `None` if it is unknown.
    pub blend: Option<f64>,
    /// The value of each [`Switch`].
    pub switches: Arc<[Value; Switch::ALL.len()]>,
    /// The start of its path.
    pub from: Predecessor,
    /// The end at which its path begins, if that is known and not the end of the motion before it in the list. Each path of a branch begins
    /// where the motion before the branch ends.
    pub begins: Option<Arc<MotionEnd>>,
    /// Whether a thread executes it.
    pub in_thread: bool,
}

impl Moved {
    /// Whether the motion ends here, with the same values.
    ///
    /// # Examples
    /// ```
    /// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
    /// use deflex_lang::run::MotionEnd;
    ///
    /// let moved = &outcome.motions[0];
    /// let end = MotionEnd { place: moved.place, to: moved.to.clone(), switches: moved.switches.clone() };
    /// assert!(moved.ends_at(&end));
    /// ```
    #[must_use]
    pub fn ends_at(&self, end: &MotionEnd) -> bool {
        self.place == end.place && self.to == end.to && self.switches == end.switches
    }
}

/// The start of the path to the end of a motion, in every run.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// assert_eq!(outcome.motions[0].from, deflex_lang::run::Predecessor::Start);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Predecessor {
    /// Where the arm was when the program began.
    Start,
    /// At the end of the motion before it.
    #[default]
    Previous,
    /// Known only at run time.
    Unknown,
}

/// The error for a program that does not end within the bounds on statements, motions or calls.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// use deflex_lang::run::{TooLong, run};
///
/// match run(&program, &deflex_lang::urscript::UrScript) {
///     Ok(outcome) => println!("{} motions", outcome.motions.len()),
///     Err(TooLong) => println!("the program is too long"),
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLong;

/// Most statements of a run with loops followed round by round: some seconds. Beyond it, loops are joined.
const MOST_STEPS: u64 = 5_000_000;
/// Most motions that loops and calls may add to those of the text: a fifth of a gigabyte.
const MOST_REPEATED: usize = 200_000;
/// Largest depth of calls; controllers allow fewer.
const DEEPEST: usize = 32;

/// Runs a program.
///
/// # Errors
/// It is too long, even with its loops joined.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// let outcome = deflex_lang::run::run(&program, &deflex_lang::urscript::UrScript).unwrap();
/// assert_eq!(outcome.motions.len(), 1);
/// ```
pub fn run(program: &Program, dialect: &dyn Dialect) -> Result<Outcome, TooLong> {
    let flow = flow(program);
    Runner::new(program, &flow, dialect, true)
        .run()
        .or_else(|TooLong| Runner::new(program, &flow, dialect, false).run())
}

/// The steps of all routines.
fn flow(program: &Program) -> Flow<&Statement, &Expression> {
    let mut flow = Flow::default();
    for function in &program.functions {
        flow.add(|builder| lay_all(builder, &function.body));
    }
    flow
}

fn lay_all<'a>(builder: &mut Builder<'a, &'a Statement, &'a Expression>, statements: &'a [Statement]) {
    statements.iter().for_each(|statement| lay(builder, statement));
}

fn lay<'a>(builder: &mut Builder<'a, &'a Statement, &'a Expression>, statement: &'a Statement) {
    match &statement.kind {
        StatementKind::If { arms, otherwise } => {
            let arms = arms.iter().map(|(condition, body)| (condition, &body[..]));
            builder.choose(arms, otherwise, lay_all);
        }
        StatementKind::Loop { condition, body } => {
            let always = |e: &&Expression| !matches!(e.kind, ExpressionKind::Truth(true));
            builder.repeat(|builder| match condition.as_ref().filter(always) {
                Some(condition) => builder.branch(condition, |builder| lay_all(builder, body), Builder::leave),
                None => lay_all(builder, body),
            });
        }
        StatementKind::Break => builder.leave(),
        StatementKind::Continue => builder.again(),
        StatementKind::Label(name) => builder.label(name.as_bytes()),
        StatementKind::Jump { to, condition: None } => builder.jump(to.as_bytes()),
        StatementKind::Jump { to, condition: Some(condition) } => builder.jump_if(condition, to.as_bytes()),
        StatementKind::Return(_) => builder.returns(statement),
        StatementKind::Halt => builder.halt(),
        StatementKind::Assign { .. }
        | StatementKind::Evaluate(_)
        | StatementKind::Move(_)
        | StatementKind::Opaque { .. } => builder.step(statement),
    }
}

struct Runner<'a> {
    program: &'a Program,
    flow: &'a Flow<&'a Statement, &'a Expression>,
    dialect: &'a dyn Dialect,
    /// Whether loops with known conditions are followed round by round.
    unrolls: bool,
    /// Whether motions are recorded. They are not while the states of a region are still being joined.
    is_recording: bool,
    in_thread: bool,
    thread_moves: bool,
    volatile: BTreeMap<Slot, Reason>,
    /// Variables that threads read.
    watched: BTreeSet<Slot>,
    calls: Vec<FunctionId>,
    /// The running chain of calls, and all chains so far.
    context: u32,
    sites: BTreeMap<(u32, usize), u32>,
    /// Site of the last recorded motion.
    last: Option<u32>,
    node: usize,
    steps: u64,
    most_motions: usize,
    /// Values of the switches at the last motion, which mostly are the same at the next one.
    switches: Arc<[Value; Switch::ALL.len()]>,
    out: Outcome,
}

impl<'a> Runner<'a> {
    fn new(
        program: &'a Program,
        flow: &'a Flow<&'a Statement, &'a Expression>,
        dialect: &'a dyn Dialect,
        unrolls: bool,
    ) -> Self {
        let moves = flow.nodes.iter().filter(|node| is_motion(node)).count();
        let mut runner = Self {
            program,
            flow,
            dialect,
            unrolls,
            is_recording: true,
            in_thread: false,
            thread_moves: false,
            volatile: program.volatile.iter().copied().collect(),
            watched: BTreeSet::new(),
            calls: Vec::new(),
            context: 0,
            sites: BTreeMap::new(),
            last: None,
            node: 0,
            steps: 0,
            most_motions: moves + MOST_REPEATED,
            switches: Arc::new(Switch::ALL.map(|_| Content::Nothing.into())),
            out: Outcome::default(),
        };
        for &thread in &program.threads {
            let effects = runner.effects(thread);
            runner.thread_moves |= effects.moves;
            runner.volatile.extend(effects.writes.into_iter().map(|slot| (slot, Reason::Thread)));
            runner.watched.extend(effects.reads);
        }
        runner
    }

    fn run(mut self) -> Result<Outcome, TooLong> {
        let globals = self.program.globals.len();
        let fresh = Store::new(globals);
        let mut store = fresh.clone();
        let is_routine = |entry: &&FunctionId| !self.program.functions[entry.0 as usize].name.is_empty();
        let several = self.program.entries.iter().filter(is_routine).count() > 1;
        let changed: BTreeSet<Slot> =
            self.program.entries.iter().flat_map(|entry| self.effects(*entry).writes).collect();
        let mut begins = fresh.clone();
        for entry in &self.program.entries {
            if self.program.variables_outlive_runs && is_routine(&entry) {
                store = begins.clone();
            } else if is_routine(&entry) && (several || !self.out.motions.is_empty()) {
                // Any routine may have run before it.
                store = fresh.clone();
                changed.iter().for_each(|slot| store.lose(*slot, Reason::Argument));
                store.set(Switch::Shift, Content::Nothing.into());
                store.set(Switch::Mark, Content::Nothing.into());
            }
            self.begin(*entry, &mut store)?;
            if !is_routine(&entry) {
                begins = store.clone();
            }
            if store.globals.len() < globals {
                store = fresh.clone();
                if !several {
                    break;
                }
            }
            if !self.out.motions.is_empty() {
                store.lose_place();
            }
        }
        self.in_thread = true;
        for &thread in &self.program.threads {
            let mut store = fresh.clone();
            (0..globals).for_each(|at| store.lose(Slot::Global(at as u32), Reason::Thread));
            store.set(Switch::Shift, Content::Nothing.into());
            store.lose_place();
            self.begin(thread, &mut store)?;
        }
        Ok(self.out)
    }

    fn begin(&mut self, function: FunctionId, store: &mut Store) -> Result<(), TooLong> {
        match self.call(function, &[], store) {
            Ok(_) | Err(Stop::Ends) => Ok(()),
            Err(Stop::TooLong) => Err(TooLong),
        }
    }

    /// Runs a routine.
    fn call(
        &mut self,
        id: FunctionId,
        arguments: &[(Option<Arc<str>>, Value)],
        store: &mut Store,
    ) -> Result<Value, Stop> {
        if self.calls.len() >= DEEPEST || self.calls.contains(&id) {
            return Ok(self.not_followed(id, arguments, store));
        }
        let function = &self.program.functions[id.0 as usize];
        // The routine may still use an argument for which it has no parameter.
        for (at, (name, value)) in arguments.iter().enumerate() {
            let is_taken = match name {
                Some(name) => function.parameters.iter().any(|parameter| parameter.name == *name),
                None => at < function.parameters.len(),
            };
            if !is_taken {
                self.use_up(&value.all_reads());
            }
        }
        // The names in a default value are those of the routine.
        let locals = Values::unset(function.locals as usize);
        let saved = (std::mem::replace(&mut store.locals, locals), store.result.take(), self.context, self.node);
        for (at, parameter) in function.parameters.iter().enumerate() {
            let value = match (Arguments(arguments).get(&parameter.name, at), &parameter.default) {
                (Some(value), _) => value.clone(),
                (None, Some(default)) => self.evaluate(default, store)?,
                (None, None) => Value::unknown(Reason::Argument),
            };
            *store.get_mut(Slot::Local(at as u32)) = value;
        }
        self.context = self.site();
        self.calls.push(id);
        let after = walk(self, self.flow, id.0 as usize, std::mem::take(store));
        self.calls.pop();
        (self.context, self.node) = (saved.2, saved.3);
        *store = after?;
        let result = std::mem::replace(&mut store.result, saved.1);
        store.locals = saved.0;
        Ok(result.unwrap_or_else(|| Content::Nothing.into()))
    }

    /// The number of the running node, in its chain of calls.
    fn site(&mut self) -> u32 {
        let next = self.sites.len() as u32 + 1;
        *self.sites.entry((self.context, self.node)).or_insert(next)
    }

    /// Counts the work at a node.
    fn count(&mut self, node: usize) -> Result<(), Stop> {
        self.steps += 1;
        self.node = node;
        if self.steps > MOST_STEPS || self.out.motions.len() > self.most_motions {
            return Err(Stop::TooLong);
        }
        Ok(())
    }

    fn statement(&mut self, statement: &Statement, store: &mut Store) -> Result<(), Stop> {
        match &statement.kind {
            StatementKind::Assign { slot, path, value } => {
                let value = self.evaluate(value, store)?;
                self.assign(*slot, path, value, store)?;
            }
            StatementKind::Evaluate(expression) => drop(self.evaluate(expression, store)?),
            StatementKind::Return(value) => {
                store.result = value.as_ref().map(|value| self.evaluate(value, store)).transpose()?;
            }
            StatementKind::Move(motion) => self.motion(motion, statement.place, store)?,
            StatementKind::Opaque { writes, reads, reason } => {
                for read in reads {
                    let value = self.evaluate(read, store)?;
                    self.use_up(&value.all_reads());
                }
                match writes {
                    Some(slots) => slots.iter().for_each(|slot| store.lose(*slot, *reason)),
                    None => {
                        self.anything(*reason, store);
                        (0..store.locals.len() as u32).for_each(|at| store.lose(Slot::Local(at), *reason));
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn assign(&mut self, slot: Slot, path: &[Expression], value: Value, store: &mut Store) -> Result<(), Stop> {
        if self.watched.contains(&slot) {
            self.use_up(&value.all_reads());
        }
        let mut indices = Vec::new();
        for index in path {
            let index = self.evaluate(index, store)?;
            self.use_up(&index.all_reads());
            indices.push(index.number().filter(|at| is_whole(*at) && *at >= 0.0).map(|at| at as usize));
        }
        let known = self.read(slot, store);
        *store.get_mut(slot) = self.put(known, &indices, value);
        Ok(())
    }

    /// The value with one item replaced.
    fn put(&self, whole: Value, indices: &[Option<usize>], value: Value) -> Value {
        let Some((index, rest)) = indices.split_first() else { return value };
        let lost = |reason| Value::unknown(reason).reading([&whole, &value]);
        match (&whole.content, *index) {
            (Content::List(items), Some(at)) if at < items.len() => {
                let mut items = items.to_vec();
                items[at] = self.put(items[at].clone(), rest, value);
                Value { content: Content::List(items.into()), reads: whole.reads.clone() }
            }
            (Content::Pose(pose), Some(at)) if rest.is_empty() => {
                let mut numbers = self.numbers_of(pose, &whole);
                if at >= numbers.len() {
                    return lost(Reason::Computed);
                }
                numbers[at] = value;
                let mut changed = self.dialect.pose_value(numbers, pose.given.clone());
                changed.reads = changed.reads.with(&whole.reads);
                changed
            }
            (Content::Unknown(reason), _) => lost(*reason),
            _ => lost(Reason::Computed),
        }
    }

    /// The numbers with which a pose is written.
    fn numbers_of(&self, pose: &Pose, whole: &Value) -> Vec<Value> {
        if pose.is_plain() {
            return pose.numbers.to_vec();
        }
        let numbers = self.dialect.numbers(&pose.pose(), &[]);
        let computed = |value: f64| {
            let number = Number { value, exact: false, affine: None };
            Value { content: Content::Number(number), reads: whole.all_reads() }
        };
        numbers.into_iter().map(computed).collect()
    }

    fn motion(&mut self, motion: &Motion, place: SourceSpan, store: &mut Store) -> Result<(), Stop> {
        let mut value = |expression: &Option<Expression>| {
            expression.as_ref().map(|expression| self.evaluate(expression, store)).transpose()
        };
        let (via, to) = (value(&motion.via)?, value(&motion.to)?);
        let (speed, blend) = (value(&motion.speed)?, value(&motion.blend)?);
        let shift = self.read(Switch::Shift.slot(), store);
        let [via, to] = [via, to].map(|point| point.map(|point| self.dialect.shifted(point, &shift)));
        for other in &motion.others {
            let value = self.evaluate(other, store)?;
            self.use_up(&value.all_reads());
        }
        let site = self.site();
        let from = match store.stands {
            _ if self.thread_moves || self.in_thread => Predecessor::Unknown,
            Stands::Start => Predecessor::Start,
            Stands::At(before) if self.last == Some(before) => Predecessor::Previous,
            Stands::At(_) | Stands::Unknown => Predecessor::Unknown,
        };
        let is_alone = !self.thread_moves && !self.in_thread;
        let begins = store.end.take().filter(|_| is_alone && from == Predecessor::Unknown);
        let switches = Switch::ALL.map(|switch| self.read(switch.slot(), store));
        if *self.switches != switches {
            self.switches = Arc::new(switches);
        }
        let switches = Arc::clone(&self.switches);
        for used in speed.iter().chain(&blend).chain(&*switches) {
            self.use_up(&used.all_reads());
        }
        let to = to.unwrap_or_else(|| Content::Nothing.into());
        match motion.path {
            Path::Unknown(_) => store.lose_place(),
            _ => {
                store.stands = Stands::At(site);
                store.end = Some(Arc::new(MotionEnd { place, to: to.clone(), switches: Arc::clone(&switches) }));
            }
        }
        if self.in_thread {
            let all = via.iter().chain([&to]);
            all.for_each(|value| self.use_up(&value.all_reads()));
        }
        if self.is_recording {
            self.last = Some(site);
            let (path, in_thread) = (motion.path, self.in_thread);
            let number = |value: &Option<Value>| value.as_ref().and_then(Value::number);
            let (speed, blend) = (number(&speed), blend.map_or(Some(0.0), |blend| blend.number()));
            self.out.motions.push(Moved { place, path, via, to, speed, blend, switches, from, begins, in_thread });
        }
        Ok(())
    }

    /// Tokens that decide something other than where a motion goes.
    fn use_up(&mut self, reads: &Reads) {
        for token in reads.tokens() {
            self.out.used.entry(*token).or_insert(Reason::Shared);
        }
    }

    fn read(&self, slot: Slot, store: &Store) -> Value {
        let value = store.get(slot);
        match self.volatile.get(&slot) {
            Some(reason) => Value { content: Content::Unknown(*reason), reads: value.all_reads() },
            None => value.clone(),
        }
    }

    /// Applies everything that a routine that is not given may do to variables and switches, except for the switches that the dialect
    /// assumes it to leave. For a line that is not understood, nothing is assumed.
    fn anything(&mut self, reason: Reason, store: &mut Store) {
        for at in 0..self.program.globals.len() as u32 {
            let slot = Slot::Global(at);
            let reads = store.get(slot).all_reads();
            self.use_up(&reads);
            let left = if reason == Reason::Foreign { self.dialect.left_by_foreign() } else { &[] };
            let is_left = [Switch::Mark, Switch::Frame].iter().chain(left).any(|switch| switch.slot() == slot);
            if !is_left {
                store.lose(slot, reason);
            }
        }
        store.lose_place();
    }

    /// A call that is not followed: everything that it could change becomes unknown, and all tokens that it names count as used.
    fn not_followed(&mut self, id: FunctionId, arguments: &[(Option<Arc<str>>, Value)], store: &mut Store) -> Value {
        let effects = self.effects(id);
        effects.tokens.into_iter().for_each(|token| self.use_up(&Reads::One(token)));
        for slot in effects.reads {
            let reads = store.get(slot).all_reads();
            self.use_up(&reads);
        }
        effects.writes.into_iter().for_each(|slot| store.lose(slot, Reason::Recursion));
        store.lose_place();
        if effects.moves && self.is_recording {
            let switches = Arc::new(Switch::ALL.map(|switch| self.read(switch.slot(), store)));
            self.out.motions.push(Moved {
                place: self.program.functions[id.0 as usize].place,
                path: Path::Unknown(Reason::Recursion),
                via: None,
                to: Value::unknown(Reason::Recursion),
                speed: None,
                blend: None,
                switches,
                from: Predecessor::Unknown,
                begins: None,
                in_thread: self.in_thread,
            });
            self.last = None;
        }
        let value = Value::unknown(Reason::Recursion).reading(arguments.iter().map(|(_, value)| value));
        self.use_up(&value.reads);
        value
    }

    /// The possible effects of a routine and of those that it calls.
    fn effects(&self, id: FunctionId) -> Effects {
        let mut effects = Effects::default();
        let all = || (0..self.program.globals.len() as u32).map(Slot::Global);
        let global = |slot: &Slot| matches!(slot, Slot::Global(_));
        for id in self.program.reached_from(id).into_iter().chain([id]) {
            let function = &self.program.functions[id.0 as usize];
            function.each_expression(&mut |expression| match &expression.kind {
                ExpressionKind::Number(_, token) => drop(effects.tokens.insert(*token)),
                ExpressionKind::Read(slot) if global(slot) => drop(effects.reads.insert(*slot)),
                ExpressionKind::Call(Callee::Builtin(builtin), _) => {
                    effects.writes.extend(self.dialect.writes(*builtin));
                }
                ExpressionKind::Call(Callee::Foreign, _) => {
                    effects.writes.extend(all());
                    effects.reads.extend(all());
                }
                _ => {}
            });
            for statement in &function.body {
                statement.each(&mut |statement| match &statement.kind {
                    StatementKind::Assign { slot, .. } if global(slot) => drop(effects.writes.insert(*slot)),
                    StatementKind::Opaque { writes: Some(slots), .. } => {
                        effects.writes.extend(slots.iter().filter(|slot| global(slot)));
                    }
                    StatementKind::Opaque { writes: None, .. } => effects.writes.extend(all()),
                    StatementKind::Move(_) => effects.moves = true,
                    _ => {}
                });
            }
        }
        effects
    }

    fn evaluate(&mut self, expression: &Expression, store: &mut Store) -> Result<Value, Stop> {
        Ok(match &expression.kind {
            ExpressionKind::Number(value, token) => Value::literal(*value, *token),
            ExpressionKind::Constant(value) => Content::Number(Number::constant(*value)).into(),
            ExpressionKind::Truth(truth) => Content::Truth(*truth).into(),
            ExpressionKind::Text(text) => Content::Text(Arc::clone(text)).into(),
            ExpressionKind::Read(slot) => self.read(*slot, store),
            ExpressionKind::List(items) => Content::List(self.all(items, store)?.into()).into(),
            ExpressionKind::Pose(items, given) => self.dialect.pose_value(self.all(items, store)?, given.clone()),
            ExpressionKind::Unknown(reason, parts) => {
                let value = Value::unknown(*reason).reading(&self.all(parts, store)?);
                self.use_up(&value.reads);
                value
            }
            ExpressionKind::Item(two) => {
                let (whole, index) = (self.evaluate(&two[0], store)?, self.evaluate(&two[1], store)?);
                self.use_up(&index.all_reads());
                self.item(&whole, &index)
            }
            ExpressionKind::Unary(operator, operand) => unary(*operator, &self.evaluate(operand, store)?),
            ExpressionKind::Binary(operator, two) => {
                let left = self.evaluate(&two[0], store)?;
                // Whether the right side runs at all is not known: what it may change is.
                let (perhaps, mut calls) = (matches!(operator, Binary::And | Binary::Or), false);
                two[1].each(&mut |part| calls |= matches!(part.kind, ExpressionKind::Call(..)));
                let before = (perhaps && calls).then(|| store.clone());
                let right = self.evaluate(&two[1], store)?;
                if let Some(before) = before {
                    store.join(&before);
                }
                binary(*operator, &left, &right)
            }
            ExpressionKind::Call(callee, arguments) => self.calls(*callee, arguments, store)?,
        })
    }

    fn all(&mut self, parts: &[Expression], store: &mut Store) -> Result<Vec<Value>, Stop> {
        parts.iter().map(|part| self.evaluate(part, store)).collect()
    }

    fn calls(&mut self, callee: Callee, arguments: &[Argument], store: &mut Store) -> Result<Value, Stop> {
        let mut values = Vec::with_capacity(arguments.len());
        for argument in arguments {
            values.push((argument.name.clone(), self.evaluate(&argument.value, store)?));
        }
        let given = || values.iter().map(|(_, value)| value);
        match callee {
            Callee::Function(id) => self.call(id, &values, store),
            Callee::Builtin(builtin) => {
                let value = self.dialect.call(builtin, &Arguments(&values), store);
                let kept = value.all_reads();
                let uses = self.dialect.uses_numbers(builtin);
                for lost in given().filter(|_| uses).flat_map(|value| value.all_reads().tokens().to_vec()) {
                    if kept.tokens().binary_search(&lost).is_err() {
                        self.use_up(&Reads::One(lost));
                    }
                }
                Ok(value)
            }
            Callee::Foreign => {
                let value = Value::unknown(Reason::Foreign).reading(given());
                self.use_up(&value.reads);
                self.anything(Reason::Foreign, store);
                Ok(value)
            }
        }
    }

    fn item(&self, whole: &Value, index: &Value) -> Value {
        let at = index.number().filter(|at| is_whole(*at) && *at >= 0.0).map(|at| at as usize);
        let item = match (&whole.content, at) {
            (Content::Unknown(reason), _) => return Value::unknown(*reason).reading([whole, index]),
            (Content::List(items), Some(at)) => items.get(at).cloned(),
            (Content::Pose(pose), Some(at)) => self.numbers_of(pose, whole).get(at).cloned(),
            _ => None,
        };
        match item {
            Some(mut item) => {
                item.reads = item.reads.with(&whole.reads).with(&index.reads);
                item
            }
            None => Value::unknown(index.reason().unwrap_or(Reason::Computed)).reading([whole, index]),
        }
    }
}

fn is_motion<T>(node: &Node<&Statement, T>) -> bool {
    matches!(node, Node::Do(Statement { kind: StatementKind::Move(_), .. }))
}

impl<'a> Machine for Runner<'a> {
    type Step = &'a Statement;
    type Test = &'a Expression;
    type State = Store;
    /// The number of motions so far, and the site of the last one.
    type Mark = (usize, Option<u32>);

    fn step(&mut self, node: usize, statement: &'a Statement, store: &mut Store) -> Result<(), Stop> {
        self.count(node)?;
        self.statement(statement, store)
    }

    fn holds(&mut self, node: usize, condition: &'a Expression, store: &mut Store) -> Result<Option<bool>, Stop> {
        self.count(node)?;
        let value = self.evaluate(condition, store)?;
        self.use_up(&value.all_reads());
        Ok(value.truth())
    }

    fn join(&mut self, known: &mut Store, other: &Store, _: Meeting) -> bool {
        let before = known.clone();
        known.join(other);
        *known != before
    }

    fn lose_place(&self, store: &mut Store) {
        store.lose_place();
    }

    fn forget_last(&mut self) {
        self.last = None;
    }

    fn is_same(&self, a: &Store, b: &Store) -> bool {
        a == b
    }

    fn is_recording(&mut self) -> &mut bool {
        &mut self.is_recording
    }

    fn mark(&mut self) -> (usize, Option<u32>) {
        (self.out.motions.len(), self.last)
    }

    fn back_to(&mut self, (motions, last): (usize, Option<u32>)) {
        self.out.motions.truncate(motions);
        self.last = last;
    }

    /// If the run exceeds a bound, the program is run again with all loops joined.
    fn is_too_much(&self, _: (usize, Option<u32>)) -> bool {
        false
    }

    fn unrolls(&self) -> bool {
        self.unrolls
    }
}

/// The possible effects of a routine.
#[derive(Default)]
struct Effects {
    writes: BTreeSet<Slot>,
    reads: BTreeSet<Slot>,
    tokens: BTreeSet<TokenId>,
    moves: bool,
}

fn unary(operator: Unary, operand: &Value) -> Value {
    let content = match (operator, &operand.content) {
        (Unary::Negate, Content::Number(number)) => {
            let exact = number.exact;
            Content::Number(Number { exact, ..steps(*number, -1.0, 0.0, -number.value) })
        }
        (Unary::Not, Content::Truth(truth)) => Content::Truth(!truth),
        _ => Content::Unknown(operand.reason().unwrap_or(Reason::Computed)),
    };
    Value { content, reads: operand.all_reads() }
}

/// A number after a step `scale · number + offset`.
fn steps(number: Number, scale: f64, offset: f64, value: f64) -> Number {
    let affine = number.affine.filter(|_| scale != 0.0);
    let affine = affine.map(|of| Affine { scale: of.scale * scale, offset: of.offset * scale + offset, ..of });
    Number { value, exact: is_whole(number.value) && is_whole(value), affine }
}

/// The result of a binary operator.
///
/// # Examples
/// ```
/// use deflex_lang::{Reason, ir::Binary, run::binary, value::{Content, Number, Value}};
///
/// let two = Value::from(Content::Number(Number { value: 2.0, exact: true, affine: None }));
/// assert_eq!(binary(Binary::Multiply, &two, &two).number(), Some(4.0));
/// assert!(binary(Binary::Multiply, &two, &Content::Unknown(Reason::Computed).into()).reason().is_some());
/// ```
#[must_use]
pub fn binary(operator: Binary, left: &Value, right: &Value) -> Value {
    let decides = |truth: bool| [left, right].iter().any(|side| side.truth() == Some(truth));
    let content = match (&left.content, &right.content) {
        _ if operator == Binary::And && decides(false) => Content::Truth(false),
        _ if operator == Binary::Or && decides(true) => Content::Truth(true),
        (Content::Number(a), Content::Number(b)) => arithmetic(operator, *a, *b),
        (Content::Truth(a), Content::Truth(b)) => match operator {
            Binary::And => Content::Truth(a & b),
            Binary::Or => Content::Truth(a | b),
            Binary::Xor | Binary::NotEqual => Content::Truth(a ^ b),
            Binary::Equal => Content::Truth(a == b),
            _ => Content::Unknown(Reason::Computed),
        },
        (Content::Text(a), Content::Text(b)) => match operator {
            Binary::Equal => Content::Truth(a == b),
            Binary::NotEqual => Content::Truth(a != b),
            _ => Content::Unknown(Reason::Computed),
        },
        _ => Content::Unknown(left.reason().into_iter().chain(right.reason()).min().unwrap_or(Reason::Computed)),
    };
    Value { content, reads: Reads::None }.reading([left, right])
}

fn arithmetic(operator: Binary, a: Number, b: Number) -> Content {
    let exact = |value: f64| a.exact && b.exact && is_whole(a.value) && is_whole(b.value) && is_whole(value);
    let number = |value: f64, affine: Option<Affine>| {
        if value.is_finite() {
            Content::Number(Number { value, exact: exact(value), affine })
        } else {
            Content::Unknown(Reason::Computed)
        }
    };
    let (x, y) = (a.value, b.value);
    let of = |own: Number, other: Number, scale: f64, offset: f64, value: f64| {
        steps(own, scale, offset, value).affine.filter(|_| other.affine.is_none())
    };
    match operator {
        Binary::Add => number(x + y, of(a, b, 1.0, y, x + y).or_else(|| of(b, a, 1.0, x, x + y))),
        Binary::Subtract => number(x - y, of(a, b, 1.0, -y, x - y).or_else(|| of(b, a, -1.0, x, x - y))),
        Binary::Multiply => number(x * y, of(a, b, y, 0.0, x * y).or_else(|| of(b, a, x, 0.0, x * y))),
        // Whether two whole numbers divide as whole numbers is the language's affair.
        Binary::Divide if exact(x / y) || x.fract() != 0.0 || y.fract() != 0.0 => {
            number(x / y, of(a, b, 1.0 / y, 0.0, x / y))
        }
        Binary::Divide => Content::Unknown(Reason::Rounding),
        // Languages differ in the sign of the remainder of a negative number.
        Binary::Remainder if exact(x % y) && x >= 0.0 && y > 0.0 => number(x % y, None),
        Binary::Quotient | Binary::Remainder => Content::Unknown(Reason::Rounding),
        Binary::And | Binary::Or | Binary::Xor => Content::Unknown(Reason::Computed),
        compare => compares(compare, a, b),
    }
}

/// A comparison; unknown if its result could differ between single and double precision.
#[allow(clippy::float_cmp, clippy::cast_possible_truncation)]
fn compares(operator: Binary, a: Number, b: Number) -> Content {
    let (x, y) = (a.value, b.value);
    if !(a.exact && b.exact) || (x == y) != (x as f32 == y as f32) {
        return Content::Unknown(Reason::Rounding);
    }
    Content::Truth(match operator {
        Binary::Equal => x == y,
        Binary::NotEqual => x != y,
        Binary::Less => x < y,
        Binary::AtMost => x <= y,
        Binary::Greater => x > y,
        _ => x >= y,
    })
}
