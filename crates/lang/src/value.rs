//! Values: known, with the tokens from which they come, or unknown, with the reason.

use crate::ir::{Given, TokenId};
use crate::reason::Reason;
use nalgebra::Isometry3;
use std::sync::Arc;

/// The literal tokens on which a value depends, sorted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum Reads {
    /// None.
    #[default]
    None,
    /// One.
    One(TokenId),
    /// Several.
    Many(Arc<[TokenId]>),
}

impl Reads {
    /// The tokens.
    #[must_use]
    pub(crate) fn tokens(&self) -> &[TokenId] {
        match self {
            Self::None => &[],
            Self::One(token) => std::slice::from_ref(token),
            Self::Many(tokens) => tokens,
        }
    }

    /// These and others.
    #[must_use]
    pub(crate) fn with(&self, others: &Self) -> Self {
        let (a, b) = (self.tokens(), others.tokens());
        let within = |inner: &[TokenId], outer: &[TokenId]| inner.iter().all(|t| outer.binary_search(t).is_ok());
        if within(b, a) {
            return self.clone();
        }
        if within(a, b) {
            return others.clone();
        }
        let mut all: Vec<TokenId> = a.iter().chain(b).copied().collect();
        all.sort_unstable();
        all.dedup();
        Self::Many(all.into())
    }
}

/// A value, and the tokens on which it depends.
///
/// # Examples
/// ```
/// use deflex_lang::{Reason, value::{Content, Value}};
///
/// let (known, unknown) = (Value::from(Content::Truth(true)), Value::from(Content::Unknown(Reason::Computed)));
/// assert_eq!((known.reason(), unknown.reason()), (None, Some(Reason::Computed)));
/// assert!(known.number().is_none() && known.numbers().is_none() && known.pose().is_none());
/// assert!(known.join(&unknown).reason().is_some()); // two paths with different values meet
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    /// Its content, as far as it is known.
    pub content: Content,
    /// Tokens on which it depends, without those of its parts.
    pub(crate) reads: Reads,
}

/// The content of a value.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// use deflex_lang::value::Content;
///
/// assert!(matches!(outcome.motions[0].to.content, Content::Pose(_)));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// Nothing, for this reason.
    Unknown(Reason),
    /// No value.
    Nothing,
    /// A truth value.
    Truth(bool),
    /// A number.
    Number(Number),
    /// A text.
    Text(Arc<[u8]>),
    /// A list.
    List(Arc<[Value]>),
    /// A pose.
    Pose(Arc<Pose>),
    /// Axis angles that reach a pose.
    AxesOf(Arc<AxesOf>),
}

/// Axis angles that reach a pose, as inverse kinematics gives them.
///
/// # Examples
/// ```
/// use deflex_lang::value::Content;
///
/// let text = b"def part():\n  movej(get_inverse_kin(p[0.5, 0.1, 0.2, 0, 3.14, 0]))\nend\n";
/// let program = deflex_lang::urscript::read(&[text], 1).unwrap();
/// let outcome = deflex_lang::run::run(&program, &deflex_lang::urscript::UrScript).unwrap();
/// let Content::AxesOf(axes) = &outcome.motions[0].to.content else { panic!() };
/// assert!(axes.near.is_none() && axes.pose.pose().translation.x == 0.5);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AxesOf {
    /// The pose of the TCP.
    pub pose: Arc<Pose>,
    /// If angles are given, the solution is the nearest to them.
    pub near: Option<Arc<[f64]>>,
    /// The TCP that was in force when the angles were computed, in the flange; `None` if it was not known.
    pub tool: Option<Isometry3<f64>>,
}

/// A known number.
///
/// # Examples
/// ```
/// use deflex_lang::value::{Content, Number, Value};
///
/// let value = Value::from(Content::Number(Number { value: 0.25, exact: true, affine: None }));
/// assert_eq!(value.number(), Some(0.25));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    /// Its value.
    pub value: f64,
    /// Whether every arithmetic with at least single precision gives exactly this number.
    pub exact: bool,
    /// The token from which it is computed, and how.
    pub affine: Option<Affine>,
}

/// A number that is `scale · token + offset`.
///
/// # Examples
/// ```
/// let text = b"def part():\n  movel(p[2 * 0.5 - 0.1, 0.1, 0.2, 0, 3.14, 0])\nend\n";
/// let program = deflex_lang::urscript::read(&[text], 1).unwrap();
/// let outcome = deflex_lang::run::run(&program, &deflex_lang::urscript::UrScript).unwrap();
/// let y = outcome.motions[0].to.pose().unwrap().affine(1).unwrap();
/// assert_eq!((y.scale, y.offset), (1.0, 0.0)); // the number itself
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// The literal.
    pub token: TokenId,
    /// Factor; not zero.
    pub scale: f64,
    /// Summand.
    pub offset: f64,
}

/// A pose: that of the numbers in the dialect, multiplied by known poses on its left and right.
///
/// # Examples
/// ```
/// use deflex_lang::value::Pose;
/// use nalgebra::Isometry3;
///
/// let pose = Pose::constant(Isometry3::translation(0.1, 0.2, 0.3));
/// assert_eq!(pose.pose().translation.z, 0.3);
/// assert!(pose.affine(2).is_none()); // it has no number in the text
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Multiplied on the left.
    pub left: Isometry3<f64>,
    /// The numbers with which the dialect writes a pose; empty for the identity.
    pub numbers: Box<[Value]>,
    /// The pose of the numbers.
    pub own: Isometry3<f64>,
    /// Multiplied on the right.
    pub right: Isometry3<f64>,
    /// The names of tool and frame, if the position has its own.
    pub given: Option<Arc<Given>>,
}

/// Up to this number, single precision represents all whole numbers.
const WHOLE: f64 = 16_777_216.0;

impl Number {
    /// A number that depends on no token.
    #[must_use]
    pub(crate) fn constant(value: f64) -> Self {
        Self { value, exact: is_whole(value), affine: None }
    }

    /// A literal.
    #[must_use]
    pub(crate) fn literal(value: f64, token: TokenId) -> Self {
        Self { value, exact: true, affine: Some(Affine { token, scale: 1.0, offset: 0.0 }) }
    }
}

/// Whether a number is whole, and small enough that single precision represents all whole numbers around it.
#[must_use]
#[allow(clippy::float_cmp)] // just the whole numbers
pub(crate) fn is_whole(value: f64) -> bool {
    value.abs() < WHOLE && value.trunc() == value
}

impl Pose {
    /// A known pose that depends on no token.
    #[must_use]
    pub fn constant(pose: Isometry3<f64>) -> Self {
        let (identity, numbers) = (Isometry3::identity(), Box::default());
        Self { left: pose, numbers, own: identity, right: identity, given: None }
    }

    /// The pose itself.
    #[must_use]
    pub fn pose(&self) -> Isometry3<f64> {
        self.left * self.own * self.right
    }

    /// The token from which one of its numbers is computed; `None` if it is not computed from a single token.
    #[must_use]
    pub fn affine(&self, at: usize) -> Option<Affine> {
        match &self.numbers.get(at)?.content {
            Content::Number(number) => number.affine,
            _ => None,
        }
    }

    /// Whether it is not multiplied by other poses, so that its numbers are those of the pose.
    #[must_use]
    pub(crate) fn is_plain(&self) -> bool {
        !self.numbers.is_empty() && self.left == Isometry3::identity() && self.right == Isometry3::identity()
    }

    /// How many of the first numbers are computed from tokens.
    #[must_use]
    pub(crate) fn affine_numbers(&self) -> usize {
        (0..self.numbers.len()).take_while(|at| self.affine(*at).is_some()).count()
    }
}

impl Value {
    /// An unknown value.
    #[must_use]
    pub(crate) fn unknown(reason: Reason) -> Self {
        Content::Unknown(reason).into()
    }

    /// A literal.
    #[must_use]
    pub(crate) fn literal(value: f64, token: TokenId) -> Self {
        Self { content: Content::Number(Number::literal(value, token)), reads: Reads::One(token) }
    }

    /// The value, depending on other values too.
    #[must_use]
    pub(crate) fn reading<'a>(mut self, others: impl IntoIterator<Item = &'a Self>) -> Self {
        for other in others {
            self.reads = self.reads.with(&other.all_reads());
        }
        self
    }

    /// All tokens on which it depends.
    #[must_use]
    pub(crate) fn all_reads(&self) -> Reads {
        let parts: &[Self] = match &self.content {
            Content::List(items) => items,
            Content::Pose(pose) => &pose.numbers,
            Content::AxesOf(axes) => &axes.pose.numbers,
            _ => &[],
        };
        let mut all: Vec<TokenId> = Vec::new();
        for part in parts {
            match &part.content {
                Content::List(_) | Content::Pose(_) => all.extend(part.all_reads().tokens()),
                _ => all.extend(part.reads.tokens()),
            }
        }
        if all.is_empty() {
            return self.reads.clone();
        }
        all.extend(self.reads.tokens());
        all.sort_unstable();
        all.dedup();
        Reads::Many(all.into())
    }

    /// The number, if it is a known one.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match &self.content {
            Content::Number(number) => Some(number.value),
            _ => None,
        }
    }

    /// The pose, if it is a known one or axis angles that reach one.
    #[must_use]
    pub fn pose(&self) -> Option<&Pose> {
        match &self.content {
            Content::Pose(pose) => Some(pose),
            Content::AxesOf(axes) => Some(&axes.pose),
            _ => None,
        }
    }

    /// The numbers of a list of known numbers.
    #[must_use]
    pub fn numbers(&self) -> Option<Vec<f64>> {
        match &self.content {
            Content::List(items) => items.iter().map(Self::number).collect(),
            _ => None,
        }
    }

    /// The truth value, if it is known.
    #[must_use]
    pub(crate) fn truth(&self) -> Option<bool> {
        match &self.content {
            Content::Truth(truth) => Some(*truth),
            _ => None,
        }
    }

    /// The reason why it is unknown; `None` if it is known.
    #[must_use]
    pub fn reason(&self) -> Option<Reason> {
        match &self.content {
            Content::Unknown(reason) => Some(*reason),
            _ => None,
        }
    }

    /// The value where paths with two values meet: unknown if they differ.
    #[must_use]
    #[allow(clippy::float_cmp)] // just the same number
    pub fn join(&self, other: &Self) -> Self {
        if self == other {
            return self.clone();
        }
        if let (Content::Unknown(a), Content::Unknown(b)) = (&self.content, &other.content) {
            return Self { content: Content::Unknown(*a.min(b)), reads: self.reads.with(&other.reads) };
        }
        if let (Content::Number(a), Content::Number(b)) = (&self.content, &other.content)
            && a.value == b.value
        {
            // Which literal it comes from is unknown.
            let number = Number { value: a.value, exact: a.exact && b.exact, affine: None };
            return Self::from(Content::Number(number)).reading([self, other]);
        }
        let reason = self.reason().into_iter().chain(other.reason()).min();
        Self::unknown(reason.unwrap_or(Reason::Branches)).reading([self, other])
    }
}

impl From<Content> for Value {
    fn from(content: Content) -> Self {
        Self { content, reads: Reads::None }
    }
}
