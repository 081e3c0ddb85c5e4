//! Values of expressions, as far as they are known when reading, and the positions of their numbers.

use super::literal::{self, Literal, UNUSED_AXIS, Written};
use crate::{Conf, NO_TURN, Reason, ToolData, WobjData};
use deflex_lang::ir::SourceSpan;
use deflex_text::Span;
use std::rc::Rc;

/// Largest deviation of |q|² from 1 that counts as rounding of the printed text: a length of 1 ± 0.001. ABB's page on `orient`
/// requires a sum of squares of 1; with three decimals, the fewest that posts print, it stays within this.
pub(super) const MAX_NORM_ERROR: f64 = 2e-3;

#[derive(Clone, Debug)]
pub(super) enum Value {
    /// Known only at run time, with the reason.
    Unknown(Reason),
    /// A number, with its token (sign included) if it is a literal.
    Num(f64, Option<SourceSpan>),
    Bool(bool),
    Text(Rc<[u8]>),
    /// An aggregate or array, with its brackets if it is a literal.
    List(Rc<[Value]>, Option<SourceSpan>),
    Target(Rc<Pose>),
}

/// The value of a robtarget and its origin.
#[derive(Clone, Debug)]
pub(super) struct Pose {
    pub(super) written: Written,
    /// The literal that it comes from, directly or through `steps`.
    pub(super) root: Option<u32>,
    /// `Offs` and `RelTool` around it, innermost first.
    pub(super) steps: Vec<OffsetStep>,
    /// The reason, if any, for which it cannot be edited although its value is known.
    pub(super) fixed: Option<Reason>,
}

/// A number that must not be edited.
pub(super) struct HeldNumber {
    pub(super) number: Number,
    /// Whether nothing before has held it.
    pub(super) is_new: bool,
}

/// A number in the text on which the pose of a motion depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Number {
    Literal(u32),
    /// An argument of `Offs` or `RelTool`, by the first of the three.
    Offset(SourceSpan),
}

/// One `Offs` or `RelTool`, or assignments to the coordinates of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OffsetStep {
    pub(crate) offset_mm: [f64; 3],
    /// Number tokens of the offset, if all three are literals.
    pub(crate) tokens: Option<[SourceSpan; 3]>,
    /// In tool axes (`RelTool`), not work object axes (`Offs`).
    pub(crate) in_tool: bool,
    /// The rotation that `RelTool` adds.
    pub(crate) turn: [f64; 4],
    /// Coordinates that the program assigns, instead of those of the base with the offset.
    pub(crate) stated_mm: [Option<f64>; 3],
}

impl OffsetStep {
    /// A step that changes nothing.
    const NONE: Self = Self { offset_mm: [0.0; 3], tokens: None, in_tool: false, turn: NO_TURN, stated_mm: [None; 3] };

    /// A step with its numbers in the text.
    pub(super) fn of(offset_mm: [f64; 3], tokens: [SourceSpan; 3], in_tool: bool) -> Self {
        Self { offset_mm, tokens: Some(tokens), in_tool, ..Self::NONE }
    }

    /// The position of its first number, if all three are literals.
    pub(super) fn place(&self) -> Option<SourceSpan> {
        self.tokens.map(|tokens| tokens[0])
    }

    /// Whether it adds numbers that are not in the text, along the axes of the work object.
    pub(super) fn is_computed_shift(&self) -> bool {
        *self == Self { offset_mm: self.offset_mm, ..Self::NONE }
    }

    /// The pose after this step.
    pub(crate) fn apply(&self, position: [f64; 3], quat: [f64; 4]) -> ([f64; 3], [f64; 4]) {
        let d = if self.in_tool { rotate(unit(quat), self.offset_mm) } else { self.offset_mm };
        let position = std::array::from_fn(|i| self.stated_mm[i].unwrap_or(position[i] + d[i]));
        (position, multiply(quat, self.turn))
    }
}

impl Pose {
    /// The numbers in the text from which it is made.
    pub(super) fn numbers(&self) -> impl Iterator<Item = Number> {
        let steps = self.steps.iter().filter_map(OffsetStep::place);
        self.root.map(Number::Literal).into_iter().chain(steps.map(Number::Offset))
    }

    /// The pose with some coordinates of another one, at a distance from them; `None` if the other one is not made from the same numbers.
    pub(super) fn with(&self, other: &Self, by_mm: [Option<f64>; 3]) -> Option<Self> {
        let ((before, mut step), (before_other, from)) = (self.before_assigned(), other.before_assigned());
        let is_alike = before.is_empty() && before_other.is_empty() && self.root == other.root;
        if !is_alike && !self.is_at(other) {
            return None;
        }
        let mut position_mm = self.written.position_mm;
        for (axis, by) in by_mm.into_iter().enumerate() {
            let Some(by) = by else { continue };
            step.offset_mm[axis] = from.offset_mm[axis] + by;
            step.stated_mm[axis] = from.stated_mm[axis].map(|stated| stated + by);
            position_mm[axis] = other.written.position_mm[axis] + by;
        }
        Some(self.at(position_mm, step))
    }

    /// The pose with some coordinates replaced.
    pub(super) fn stated(&self, stated_mm: [Option<f64>; 3]) -> Self {
        let (mut step, mut position_mm) = (self.before_assigned().1, self.written.position_mm);
        for (axis, stated) in stated_mm.into_iter().enumerate() {
            let Some(stated) = stated else { continue };
            (step.offset_mm[axis], step.stated_mm[axis]) = (0.0, Some(stated));
            position_mm[axis] = stated;
        }
        self.at(position_mm, step)
    }

    /// The steps before the last assignments to its coordinates, and the step that these make: it has no numbers in the text.
    fn before_assigned(&self) -> (&[OffsetStep], OffsetStep) {
        match self.steps.split_last() {
            Some((last, before)) if last.tokens.is_none() && !last.in_tool => (before, *last),
            _ => (&self.steps, OffsetStep::NONE),
        }
    }

    /// The pose at another position after its last assignments.
    fn at(&self, position_mm: [f64; 3], assigned: OffsetStep) -> Self {
        let last = Some(assigned).filter(|step| *step != OffsetStep::NONE);
        let steps = self.before_assigned().0.iter().copied().chain(last).collect();
        Self { written: Written { position_mm, ..self.written }, steps, ..*self }
    }
}

/// Hamilton product, scalar first.
pub(super) fn multiply(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// `v` rotated by the unit quaternion `q`.
pub(super) fn rotate(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let conjugate = [q[0], -q[1], -q[2], -q[3]];
    let [_, x, y, z] = multiply(multiply(q, [0.0, v[0], v[1], v[2]]), conjugate);
    [x, y, z]
}

/// Largest deviation of a squared length from 1 by rounding.
const UNIT: f64 = 4.0 * f64::EPSILON;

/// `q` at length 1; zero stays zero, which readers refuse by its norm.
pub(super) fn unit(q: [f64; 4]) -> [f64; 4] {
    let square = q.iter().map(|c| c * c).sum::<f64>();
    if (square - 1.0).abs() <= UNIT || square <= 0.0 {
        return q;
    }
    let norm = square.sqrt();
    q.map(|c| c / norm)
}

impl Value {
    pub(super) fn num(&self) -> Option<f64> {
        if let Value::Num(value, _) = self { Some(*value) } else { None }
    }

    pub(super) fn bool(&self) -> Option<bool> {
        if let Value::Bool(value) = self { Some(*value) } else { None }
    }

    pub(super) fn list(&self) -> Option<&[Value]> {
        if let Value::List(items, _) = self { Some(items) } else { None }
    }

    pub(super) fn nums<const N: usize>(&self) -> Option<[f64; N]> {
        let items = self.list()?;
        if items.len() != N {
            return None;
        }
        let mut out = [0.0; N];
        for (to, item) in out.iter_mut().zip(items) {
            *to = item.num()?;
        }
        Some(out)
    }

    fn tokens<const N: usize>(&self) -> Option<[Span; N]> {
        let mut out = [Span::default(); N];
        for (to, item) in out.iter_mut().zip(self.list()?) {
            let Value::Num(_, Some(place)) = item else { return None };
            *to = place.span;
        }
        Some(out)
    }

    /// The reason for which it is unknown, if it is.
    pub(super) fn unknown(&self) -> Option<Reason> {
        match self {
            Value::Unknown(why) => Some(*why),
            Value::List(items, _) => items.iter().find_map(Value::unknown),
            _ => None,
        }
    }

    /// The value without its origin in the text, as a variable holds it.
    pub(super) fn detached(&self, why: Reason) -> Self {
        match self {
            Value::Num(value, _) => Value::Num(*value, None),
            Value::List(items, _) => Value::List(items.iter().map(|v| v.detached(why)).collect(), None),
            Value::Target(pose) => {
                Value::Target(Rc::new(Pose { written: pose.written, root: None, steps: Vec::new(), fixed: Some(why) }))
            }
            other => other.clone(),
        }
    }

    /// The value that an earlier cycle left in place of this one: unknown, except for tools and work objects, for which a
    /// note names where they differ.
    pub(super) fn left(&self, why: Reason) -> Self {
        match self {
            Value::Unknown(_) => self.clone(),
            _ if self.is_frame() => self.detached(why),
            Value::List(items, _) => Value::List(items.iter().map(|v| v.left(why)).collect(), None),
            Value::Target(pose) => parts(pose).left(why),
            Value::Num(..) | Value::Bool(_) | Value::Text(_) => Value::Unknown(why),
        }
    }

    /// Whether it is a tool or a work object.
    pub(super) fn is_frame(&self) -> bool {
        self.tool().is_some() || self.wobj().is_some()
    }

    /// The value with numbers that have no tokens, as at the use of a variable. Robtargets keep theirs.
    pub(super) fn without_tokens(&self) -> Self {
        match self {
            Value::Num(value, _) => Value::Num(*value, None),
            Value::List(items, _) => Value::List(items.iter().map(Value::without_tokens).collect(), None),
            other => other.clone(),
        }
    }

    /// A robtarget assembled from parts, with the literal of its seven pose numbers if these are literals.
    pub(super) fn assemble(&self) -> Option<(Written, Option<Literal>)> {
        let [position, quat, conf, external] = self.list()? else { return None };
        let written = Written {
            position_mm: position.nums()?,
            quat: quat.nums()?,
            conf: conf.nums().and_then(literal::conf),
            external: external.nums().unwrap_or([f64::NAN; 6]),
        };
        let literal = || {
            let Value::List(_, Some(place)) = self else { return None };
            let ([x, y, z], [q1, q2, q3, q4]) = (position.tokens()?, quat.tokens()?);
            let Value::List(_, external) = external else { return None };
            // External axes given by name have no position here, so the text after the orientation stays.
            let external = external.map_or(Span { start: place.span.end - 1, end: place.span.end - 1 }, |p| p.span);
            Literal::partial(place.source, place.span, [x, y, z, q1, q2, q3, q4], conf.tokens(), external)
        };
        Some((written, literal()))
    }

    pub(super) fn tool(&self) -> Option<ToolData> {
        let [robhold, frame, load] = self.list()? else { return None };
        let [tcp, quat] = frame.list()? else { return None };
        let [mass, cog, ..] = load.list()? else { return None };
        Some(ToolData {
            robhold: robhold.bool()?,
            tcp_mm: tcp.nums()?,
            tcp_quat: quat.nums()?,
            mass_kg: mass.num()?,
            cog_mm: cog.nums()?,
        })
    }

    pub(super) fn wobj(&self) -> Option<WobjData> {
        let [robhold, fixed, _, user, object] = self.list()? else { return None };
        let ([user_mm, user_quat], [object_mm, object_quat]) = (user.list()?, object.list()?) else { return None };
        Some(WobjData {
            robhold: robhold.bool()?,
            fixed: fixed.bool()?,
            uframe_mm: user_mm.nums()?,
            uframe_quat: user_quat.nums()?,
            oframe_mm: object_mm.nums()?,
            oframe_quat: object_quat.nums()?,
        })
    }

    /// The mechanical unit named in a wobjdata.
    pub(super) fn wobj_unit(&self) -> Option<&[u8]> {
        let [_, Value::Bool(false), Value::Text(unit), ..] = self.list()? else { return None };
        Some(unit)
    }

    /// Motor angles of a jointtarget.
    pub(super) fn joints(&self) -> Option<[f64; 6]> {
        let [robot, _] = self.list()? else { return None };
        robot.nums()
    }

    /// External axes of a jointtarget; NaN for unknown ones.
    pub(super) fn joints_external(&self) -> [f64; 6] {
        let external = self.list().and_then(|parts| parts.get(1)?.nums());
        external.unwrap_or([f64::NAN; 6])
    }

    /// An extjoint.
    pub(super) fn external(&self) -> Option<[f64; 6]> {
        self.nums()
    }
}

impl ToolData {
    /// The same with an orientation of unit length.
    pub(super) fn normalised(self) -> Self {
        Self { tcp_quat: unit(self.tcp_quat), ..self }
    }
}

impl WobjData {
    /// The same with orientations of unit length.
    pub(super) fn normalised(self) -> Self {
        Self { uframe_quat: unit(self.uframe_quat), oframe_quat: unit(self.oframe_quat), ..self }
    }
}

/// Whether external axes are in use, by their values.
pub(super) fn axes_in_use(external: &[f64; 6]) -> bool {
    external.iter().any(|&v| v < UNUSED_AXIS)
}

fn n(value: f64) -> Value {
    Value::Num(value, None)
}

fn l(items: impl IntoIterator<Item = Value>) -> Value {
    Value::List(items.into_iter().collect(), None)
}

/// Most parts of a value. RAPID data have fewer, because their arrays are declared in the text.
const MOST_PARTS: usize = 1 << 16;
/// Deepest nesting of records and arrays, more than any type of RAPID has.
const DEEPEST: usize = 12;

impl Value {
    /// Number of its parts; `None` if these are more than RAPID data have.
    pub(super) fn parts(&self) -> Option<usize> {
        fn count(value: &Value, depth: usize, left: &mut usize) -> Option<()> {
            let Value::List(items, _) = value else { return Some(()) };
            *left = left.checked_sub(items.len()).filter(|_| depth < DEEPEST)?;
            items.iter().try_for_each(|item| count(item, depth + 1, left))
        }
        let mut left = MOST_PARTS;
        count(self, 0, &mut left)?;
        Some(MOST_PARTS - left)
    }
}

/// Predefined data, by upper-case name.
pub(super) fn predefined(name: &[u8]) -> Option<Value> {
    let frame = || l([l([n(0.0), n(0.0), n(0.0)]), l([n(1.0), n(0.0), n(0.0), n(0.0)])]);
    let load = || {
        let inertia = [n(0.0), n(0.0), n(0.0)];
        l([n(0.001), l([n(0.0), n(0.0), n(0.001)]), l([n(1.0), n(0.0), n(0.0), n(0.0)])].into_iter().chain(inertia))
    };
    match name {
        b"TRUE" => return Some(Value::Bool(true)),
        b"FALSE" => return Some(Value::Bool(false)),
        b"PI" => return Some(n(std::f64::consts::PI)),
        b"TOOL0" => return Some(l([Value::Bool(true), frame(), load()])),
        b"WOBJ0" => {
            return Some(l([Value::Bool(false), Value::Bool(true), Value::Text(Rc::from(&b""[..])), frame(), frame()]));
        }
        b"LOAD0" => return Some(load()),
        _ => {}
    }
    let digits = std::str::from_utf8(name.get(1..)?).ok()?;
    if name[0] == b'V' && !digits.starts_with('0') && digits.bytes().all(|b| b.is_ascii_digit()) {
        let speed: u32 = digits.parse().ok()?;
        return SPEEDS.contains(&speed).then(|| l([n(f64::from(speed)), n(500.0), n(5000.0), n(1000.0)]));
    }
    None
}

/// TCP speeds of the predefined speeds, mm/s. RAPID reference, speeddata: v5 … v7000 are `[n, 500, 5000, 1000]`.
pub(crate) const SPEEDS: [u32; 25] = [
    5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000, 1500, 2000, 2500, 3000, 4000, 5000,
    6000, 7000,
];

/// The index of a component in a predefined record type, and its type.
pub(super) fn component(kind: &[u8], name: &[u8]) -> Option<(usize, &'static [u8])> {
    const NUM: &[u8] = b"NUM";
    const POS: &[u8] = b"POS";
    const ORIENT: &[u8] = b"ORIENT";
    const POSE: &[u8] = b"POSE";
    let fields: &[(&[u8], &'static [u8])] = match kind {
        b"ROBTARGET" => &[(b"TRANS", POS), (b"ROT", ORIENT), (b"ROBCONF", b"CONFDATA"), (b"EXTAX", b"EXTJOINT")],
        b"POSE" => &[(b"TRANS", POS), (b"ROT", ORIENT)],
        b"POS" => &[(b"X", NUM), (b"Y", NUM), (b"Z", NUM)],
        b"ORIENT" => &[(b"Q1", NUM), (b"Q2", NUM), (b"Q3", NUM), (b"Q4", NUM)],
        b"CONFDATA" => &[(b"CF1", NUM), (b"CF4", NUM), (b"CF6", NUM), (b"CFX", NUM)],
        b"EXTJOINT" => {
            &[(b"EAX_A", NUM), (b"EAX_B", NUM), (b"EAX_C", NUM), (b"EAX_D", NUM), (b"EAX_E", NUM), (b"EAX_F", NUM)]
        }
        b"JOINTTARGET" => &[(b"ROBAX", b"ROBJOINT"), (b"EXTAX", b"EXTJOINT")],
        b"ROBJOINT" => {
            &[(b"RAX_1", NUM), (b"RAX_2", NUM), (b"RAX_3", NUM), (b"RAX_4", NUM), (b"RAX_5", NUM), (b"RAX_6", NUM)]
        }
        b"TOOLDATA" => &[(b"ROBHOLD", b"BOOL"), (b"TFRAME", POSE), (b"TLOAD", b"LOADDATA")],
        b"LOADDATA" => &[(b"MASS", NUM), (b"COG", POS), (b"AOM", ORIENT), (b"IX", NUM), (b"IY", NUM), (b"IZ", NUM)],
        b"WOBJDATA" => {
            &[(b"ROBHOLD", b"BOOL"), (b"UFPROG", b"BOOL"), (b"UFMEC", b"STRING"), (b"UFRAME", POSE), (b"OFRAME", POSE)]
        }
        b"SPEEDDATA" => &[(b"V_TCP", NUM), (b"V_ORI", NUM), (b"V_LEAX", NUM), (b"V_REAX", NUM)],
        _ => return None,
    };
    fields.iter().position(|(f, _)| *f == name).map(|i| (i, fields[i].1))
}

/// The parts of a robtarget as a list, for access by component.
pub(super) fn parts(pose: &Pose) -> Value {
    let w = &pose.written;
    let conf = w.conf.and_then(quarters);
    let conf = conf.map_or(Value::Unknown(Reason::Configuration), |c| l(c.map(|v| n(f64::from(v)))));
    l([l(w.position_mm.map(n)), l(w.quat.map(n)), conf, l(w.external.map(n))])
}

/// The numbers of a robtarget's configuration; `None` for configurations of other languages.
pub(super) fn quarters(conf: Conf) -> Option<[i32; 4]> {
    let Conf::Quarters(conf) = conf else { return None };
    Some([conf.cf1, conf.cf4, conf.cf6, conf.cfx])
}
