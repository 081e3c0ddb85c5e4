//! Values of expressions, as far as deflex knows them, and the places of their numbers in the text.

use crate::Reason;
use crate::orientation::{from_zyx_deg, quaternion, zyx_deg};
use deflex_lang::ir::SourceSpan;
use nalgebra::Vector3;
use smallvec::SmallVec;
use std::collections::{BTreeMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;

/// A name in upper case, because KRL ignores case.
pub(super) type Name = SmallVec<[u8; 16]>;

pub(super) fn upper(text: &[u8]) -> Name {
    text.iter().map(u8::to_ascii_uppercase).collect()
}

/// A value. Two values are equal only if their tokens are equal too.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// Known only at run time, with the reason; it may be the value in the option.
    Unknown(Reason, Option<Rc<Value>>),
    /// A number, and the literal on which it depends, if there is one.
    Number(f64, Option<Literal>),
    Bool(bool),
    /// `#NAME`
    Constant(Arc<[u8]>),
    /// Components by name.
    Record(Rc<Vec<(Name, Value)>>),
    /// Elements by index; several indices are combined into one, see [`flat`].
    Array(Rc<BTreeMap<i64, Value>>),
    /// Data of this name that no file declares, but the controller has.
    Own(Rc<str>),
}

/// A number in the text, on which a value depends: the value is the number plus an offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Literal {
    /// Its token with the sign.
    pub(super) place: SourceSpan,
    pub(super) offset: f64,
}

impl Literal {
    /// The literal itself.
    pub(super) fn at(place: SourceSpan) -> Self {
        Self { place, offset: 0.0 }
    }
}

/// Index of the value of all elements that an array does not list; real indices are not negative.
pub(super) const REST: i64 = -1;

/// Selects a component of a record or an element of an array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Selector {
    Component(Name),
    Element(i64),
}

/// No number is NaN, so equality is reflexive. Shared records and arrays are then compared by their address.
impl Eq for Value {}

impl Value {
    pub(super) fn unknown(why: Reason) -> Self {
        Self::Unknown(why, None)
    }

    /// `#NAME`
    pub(super) fn constant(name: &[u8]) -> Self {
        Self::Constant(upper(name)[..].into())
    }

    pub(super) fn record<'n>(fields: impl IntoIterator<Item = (&'n [u8], Self)>) -> Self {
        Self::Record(Rc::new(fields.into_iter().map(|(name, value)| (Name::from_slice(name), value)).collect()))
    }

    pub(super) fn number(&self) -> Option<f64> {
        if let Self::Number(value, _) = self { Some(*value) } else { None }
    }

    /// The value of a number that depends on a literal, with a known number added; `None` for anything else.
    pub(super) fn moved(&self, to: f64) -> Option<Self> {
        let Self::Number(from, Some(literal)) = self else { return None };
        Some(Self::Number(to, Some(Literal { offset: literal.offset + (to - from), ..*literal })))
    }

    /// A number without its literal, which is not edited; any other value itself.
    pub(super) fn without_literal(&self) -> Self {
        self.number().map_or_else(|| self.clone(), |number| Self::Number(number, None))
    }

    pub(super) fn bool(&self) -> Option<bool> {
        if let Self::Bool(value) = self { Some(*value) } else { None }
    }

    /// The reason why it is unknown; `None` if it is known.
    pub(super) fn why(&self) -> Option<Reason> {
        if let Self::Unknown(why, _) = self { Some(*why) } else { None }
    }

    /// The value if it is a whole number.
    pub(super) fn index(&self) -> Option<i64> {
        #[allow(clippy::cast_possible_truncation)]
        self.number().filter(|v| v.fract() == 0.0 && v.abs() < 1e9).map(|v| v as i64)
    }

    pub(super) fn component(&self, name: &[u8]) -> Option<&Self> {
        let Self::Record(fields) = self else { return None };
        fields.iter().find(|(known, _)| known[..] == *name).map(|(_, value)| value)
    }

    /// The component of this name; unknown if there is none.
    pub(super) fn part(&self, name: &[u8]) -> Self {
        self.component(name).cloned().unwrap_or(Self::unknown(Reason::Computed))
    }

    /// The value at a path.
    pub(super) fn get(&self, path: &[Selector]) -> Self {
        let Some((first, rest)) = path.split_first() else { return self.clone() };
        match (self, first) {
            (Self::Record(_), Selector::Component(name)) => {
                self.component(name).map_or(Self::unknown(Reason::Unset), |value| value.get(rest))
            }
            (Self::Array(items), Selector::Element(at)) => {
                items.get(at).or_else(|| items.get(&REST)).map_or(Self::unknown(Reason::Unset), |value| value.get(rest))
            }
            (Self::Own(_), Selector::Component(_)) => Self::unknown(Reason::CellFrame),
            (Self::Unknown(why, None), _) => Self::unknown(*why),
            (Self::Unknown(why, Some(was)), _) => was.get(path).forgotten(*why),
            _ => Self::unknown(Reason::NotARecordOrArray),
        }
    }

    /// Sets the value at a path. If the path does not lead through known values, the whole becomes unknown, and the tokens of the new value
    /// go to `lost`.
    pub(super) fn set(&mut self, path: &[Selector], value: Self, lost: &mut HashSet<SourceSpan>) {
        let Some((first, rest)) = path.split_first() else {
            // Components that an aggregate does not name become unknown.
            if let (Self::Record(old), Self::Record(new)) = (&*self, &value) {
                let named = |name: &Name| new.iter().any(|(known, _)| known == name);
                let rest = old.iter().filter(|(name, _)| !named(name));
                let rest = rest.map(|(name, value)| (name.clone(), value.clone().forgotten(Reason::Unset)));
                *self = Self::Record(Rc::new(new.iter().cloned().chain(rest).collect()));
            } else {
                *self = value;
            }
            return;
        };
        if let Self::Unknown(why, None) = self {
            *self = match first {
                Selector::Component(name) => {
                    // Only data that were never set lack the other components of a position.
                    let open = *why != Reason::Unset && POSE.contains(&&name[..]);
                    Self::record(POSE.into_iter().filter(|_| open).map(|name| (name, Self::unknown(*why))))
                }
                Selector::Element(_) => Self::Array(Rc::new(BTreeMap::from([(REST, Self::unknown(*why))]))),
            };
        }
        let part = match (first, &mut *self) {
            (Selector::Component(name), Self::Record(fields)) => {
                let fields = Rc::make_mut(fields);
                let at = fields.iter().position(|(known, _)| known == name).unwrap_or(fields.len());
                if at == fields.len() {
                    fields.push((name.clone(), Self::unknown(Reason::Unset)));
                }
                &mut fields[at].1
            }
            (Selector::Element(at), Self::Array(items)) => {
                let before = items.get(&REST).cloned().unwrap_or(Self::unknown(Reason::Unset));
                Rc::make_mut(items).entry(*at).or_insert(before)
            }
            _ => {
                lost.extend(value.tokens());
                return self.forget(Reason::Unset);
            }
        };
        part.set(rest, value, lost);
    }

    /// All tokens in it, including those of values that it may have.
    pub(super) fn tokens(&self) -> Vec<SourceSpan> {
        match self {
            Self::Number(_, literal) => literal.iter().map(|literal| literal.place).collect(),
            Self::Record(fields) => fields.iter().flat_map(|(_, value)| value.tokens()).collect(),
            Self::Array(items) => items.values().flat_map(Self::tokens).collect(),
            Self::Unknown(_, Some(was)) => was.tokens(),
            _ => Vec::new(),
        }
    }

    /// Whether it, or a part of it, is the value that the last run has left.
    pub(super) fn has_part_of_last_run(&self) -> bool {
        match self {
            Self::Unknown(why, _) => *why == Reason::LastRun,
            Self::Record(fields) => fields.iter().any(|(_, value)| value.has_part_of_last_run()),
            Self::Array(items) => items.values().any(Self::has_part_of_last_run),
            _ => false,
        }
    }

    /// Joins two values to one that may be either, and keeps the tokens of both. If the tokens are too many to keep, they go to `lost`.
    pub(super) fn either(&self, other: &Self, why: Reason, lost: &mut HashSet<SourceSpan>) -> Self {
        /// Tokens of some hundred motions, between which a program chooses.
        const MOST_TOKENS: usize = 2048;
        if self == other {
            return self.clone();
        }
        if let Some(parts) = self.zipped(other, |a, b| a.either(b, why, lost)) {
            return parts;
        }
        let (why, mut all) = (self.why().unwrap_or(why), BTreeMap::new());
        for place in self.tokens().into_iter().chain(other.tokens()).filter(|place| !lost.contains(place)) {
            let at = i64::from(place.source) << 32 | i64::from(place.span.start);
            all.insert(at, Self::Number(0.0, Some(Literal::at(place))));
        }
        if all.len() > MOST_TOKENS {
            [self, other].iter().for_each(|value| lost.extend(value.tokens()));
            all.clear();
        }
        Self::Unknown(why, Some(Rc::new(Self::Array(Rc::new(all)))))
    }

    /// Joins the values of two paths: parts that differ become unknown. The tokens of parts that differ, or that come from different tokens,
    /// go to `lost`.
    pub(super) fn join(&self, other: &Self, reason: Reason, lost: &mut HashSet<SourceSpan>) -> Self {
        if self == other {
            return self.clone();
        }
        if let Some(parts) = self.zipped(other, |a, b| a.join(b, reason, lost)) {
            return parts;
        }
        [self, other].iter().for_each(|value| lost.extend(value.tokens()));
        if self.number().is_some() && self.number() == other.number() {
            return self.without_literal();
        }
        // A value that is set on only one of the two paths counts as set.
        let unknown = |value: &Self| value.why().filter(|why| *why != Reason::Unset);
        Self::unknown([self, other].into_iter().find_map(unknown).unwrap_or(reason))
    }

    /// Combines two records or arrays part by part; `None` if they do not have the same parts.
    fn zipped(&self, other: &Self, mut each: impl FnMut(&Self, &Self) -> Self) -> Option<Self> {
        match (self, other) {
            (Self::Record(a), Self::Record(b)) if a.iter().map(|f| &f.0).eq(b.iter().map(|f| &f.0)) => {
                let fields = a.iter().zip(&**b).map(|(a, b)| (a.0.clone(), each(&a.1, &b.1)));
                Some(Self::Record(Rc::new(fields.collect())))
            }
            (Self::Array(a), Self::Array(b)) if a.keys().eq(b.keys()) => {
                let items = a.iter().zip(&**b).map(|(a, b)| (*a.0, each(a.1, b.1)));
                Some(Self::Array(Rc::new(items.collect())))
            }
            _ => None,
        }
    }

    /// The value after something may have changed it.
    pub(super) fn forgotten(self, why: Reason) -> Self {
        match self {
            Self::Unknown(_, was) => Self::Unknown(why, was),
            known => Self::Unknown(why, Some(Rc::new(known))),
        }
    }

    pub(super) fn forget(&mut self, why: Reason) {
        *self = std::mem::replace(self, Self::Bool(false)).forgotten(why);
    }

    /// The same for an array, whose elements are known again after they are set.
    pub(super) fn forget_all(&mut self, why: Reason) {
        let Self::Array(items) = self else { return self.forget(why) };
        let own = Rc::make_mut(items);
        own.values_mut().for_each(|value| value.forget(why));
        own.insert(REST, Self::unknown(why));
    }

    /// The same for one element of an array, until it is set.
    pub(super) fn forget_element(&mut self, at: i64, why: Reason) {
        let Self::Array(items) = self else { return self.forget(why) };
        Rc::make_mut(items).entry(at).or_insert_with(|| Self::unknown(why)).forget(why);
    }

    /// The same for each number in it, so that what a further assignment leaves out stays unknown.
    pub(super) fn forget_parts(&mut self, why: Reason) {
        match self {
            Self::Array(items) => Rc::make_mut(items).values_mut().for_each(|item| item.forget_parts(why)),
            Self::Record(parts) => Rc::make_mut(parts).iter_mut().for_each(|(_, part)| part.forget_parts(why)),
            Self::Unknown(..) => {}
            known => known.forget(why),
        }
    }

    /// The same for one component of a record, or of all records in an array.
    pub(super) fn forget_component(&mut self, component: &Name, why: Reason) {
        match self {
            Self::Array(items) => {
                Rc::make_mut(items).values_mut().for_each(|item| item.forget_component(component, why));
            }
            Self::Record(parts) => match Rc::make_mut(parts).iter_mut().find(|(name, _)| name == component) {
                Some((_, value)) => value.forget(why),
                // The last run has added it.
                None => Rc::make_mut(parts).push((component.clone(), Self::unknown(why))),
            },
            _ => {}
        }
    }

    /// Numbers of components; `None` if one is missing or unknown.
    pub(super) fn numbers<const N: usize>(&self, names: [&[u8]; N]) -> Option<[f64; N]> {
        let mut out = [0.0; N];
        for (to, name) in out.iter_mut().zip(names) {
            *to = self.component(name)?.number()?;
        }
        Some(out)
    }

    /// The frame of a record with all six components, mm and a quaternion.
    pub(super) fn frame(&self) -> Option<([f64; 3], [f64; 4])> {
        let [x, y, z, a, b, c] = self.numbers(POSE)?;
        Some(([x, y, z], quaternion(&from_zyx_deg([a, b, c]))))
    }
}

/// Components of a pose: mm, and degrees about z, the turned y, the turned x.
pub(super) const POSE: [&[u8]; 6] = [b"X", b"Y", b"Z", b"A", b"B", b"C"];
/// The component of a LOAD whose X, Y, Z are moments of inertia, kg m², and not a position.
pub(super) const INERTIA: &[u8] = b"J";
/// Axis angles, degrees.
pub(super) const AXES: [&[u8]; 6] = [b"A1", b"A2", b"A3", b"A4", b"A5", b"A6"];
/// External axes, mm or degrees.
pub(super) const EXTERNAL: [&[u8]; 6] = [b"E1", b"E2", b"E3", b"E4", b"E5", b"E6"];

/// A record of six numbers that are not in the text.
pub(super) fn pose_record(numbers: [f64; 6]) -> Value {
    Value::record(POSE.into_iter().zip(numbers.map(|number| Value::Number(number, None))))
}

/// `a : b`: the pose `b` in the frame `a`. Other components of `b` stay. While the angles of `a` and the numbers of `b` stay, X, Y and Z are those
/// of `a` plus known numbers.
pub(super) fn chained(a: &Value, b: &Value) -> Option<Value> {
    let ([x, y, z, aa, ab, ac], [bx, by, bz, ba, bb, bc]) = (a.numbers(POSE)?, b.numbers(POSE)?);
    let (first, second) = (from_zyx_deg([aa, ab, ac]), from_zyx_deg([ba, bb, bc]));
    let at = Vector3::new(x, y, z) + first * Vector3::new(bx, by, bz);
    let [ra, rb, rc] = zyx_deg(&(first * second));
    let mut out = pose_record([at.x, at.y, at.z, ra, rb, rc]);
    if let (Value::Record(fields), Value::Record(more)) = (&mut out, b) {
        for (name, value) in &mut Rc::make_mut(fields)[..3] {
            if let Some(moved) = value.number().and_then(|to| a.component(name)?.moved(to)) {
                *value = moved;
            }
        }
        let rest = more.iter().filter(|(name, _)| !POSE.contains(&&name[..]));
        Rc::make_mut(fields).extend(rest.cloned());
    }
    Some(out)
}

/// Combines several indices into one; `None` if no array has such an element.
pub(super) fn flat(indices: &[i64]) -> Option<i64> {
    /// More elements than a dimension can have.
    const EACH: i64 = 1 << 20;
    /// The most dimensions of a KRL array.
    const DIMENSIONS: usize = 3;
    let fit = (1..=DIMENSIONS).contains(&indices.len()) && indices.iter().all(|index| (0..EACH).contains(index));
    fit.then(|| indices.iter().fold(0, |all, index| all * EACH + index))
}
