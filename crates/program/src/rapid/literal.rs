//! Complete robtarget literals: `[[x,y,z],[q1,q2,q3,q4],[cf1,cf4,cf6,cfx],[eax_a … eax_f]]`.

use super::lex::{LexemeKind, lexeme, number};
use crate::{Conf, Confdata, EXTERNAL_AXES, token};
use deflex_text::Span;
use deflex_text::number::{Leading, read_leading};
use nom::Parser;

/// Where the number tokens of one robtarget stand, sign included: x y z, q1 … q4, cf1 … cfx.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Literal {
    /// Index into `Program::sources`.
    pub(crate) source: u16,
    /// The aggregate's `[`.
    start: u32,
    /// Its length, bytes.
    len: u16,
    /// Each token after `start`.
    at: [u16; TOKENS],
    /// Its length; 0 where the text has a name instead of a number (configuration only).
    size: [u8; TOKENS],
    /// The pose's decimals, [`Leading::ODD`] where a number has other looks to keep.
    decimals: [u8; POSE],
    /// Where the external axes' aggregate begins after `start`.
    external: u16,
}

/// Numbers of a pose.
pub(super) const POSE: usize = 7;

/// Numbers that may be edited.
const TOKENS: usize = 11;

/// Values of one robtarget as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Written {
    pub(crate) position_mm: [f64; 3],
    /// Scalar first, not normalised.
    pub(crate) quat: [f64; 4],
    pub(crate) conf: Option<Conf>,
    /// External axes; 9E9 where not in use, NaN where not known when reading.
    pub(crate) external: [f64; 6],
}

/// Above this an external axis is not in use (9E9, however it is spelled).
pub(crate) const UNUSED_AXIS: f64 = 8.9e9;

impl Literal {
    /// Reads the literal at `start`, if there is a complete one; values and places in one pass.
    pub(super) fn read(bytes: &[u8], source: u16, start: usize) -> Option<(Self, Written)> {
        let (literal, values) = Self::walk::<true>(bytes, source, start)?;
        let [x, y, z, q1, q2, q3, q4, cf1, cf4, cf6, cfx, a, b, c, d, e, f] = values;
        let conf = conf([cf1, cf4, cf6, cfx]);
        Some((literal, Written { position_mm: [x, y, z], quat: [q1, q2, q3, q4], conf, external: [a, b, c, d, e, f] }))
    }

    /// Finds the literal at `start`, if there is a complete one.
    pub(super) fn find(bytes: &[u8], source: u16, start: usize) -> Option<Self> {
        Self::walk::<false>(bytes, source, start).map(|found| found.0)
    }

    fn walk<const VALUES: bool>(bytes: &[u8], source: u16, start: usize) -> Option<(Self, [f64; TOKENS + 6])> {
        let mut literal = Self {
            source,
            start: u32::try_from(start).ok()?,
            len: 0,
            at: [0; TOKENS],
            size: [0; TOKENS],
            decimals: [Leading::ODD; POSE],
            external: 0,
        };
        let mut values = [0.0; TOKENS + 6];
        let mut index = 0;
        let mut at = mark(bytes, start, b'[')?;
        for (part, count) in [3, 4, 4, 6].into_iter().enumerate() {
            if part > 0 {
                at = mark(bytes, at, b',')?;
            }
            at = blank(bytes, at);
            if part == 3 {
                literal.external = u16::try_from(at - start).ok()?;
            }
            at = mark(bytes, at, b'[')?;
            for item in 0..count {
                if item > 0 {
                    at = mark(bytes, at, b',')?;
                }
                let from = blank(bytes, at);
                let decimals;
                (values[index], at, decimals) = signed::<VALUES>(bytes, from)?;
                if index < POSE {
                    literal.decimals[index] = decimals;
                }
                if index < TOKENS {
                    literal.at[index] = u16::try_from(from - start).ok()?;
                    literal.size[index] = u8::try_from(at - from).ok()?;
                }
                index += 1;
            }
            at = mark(bytes, at, b']')?;
        }
        at = mark(bytes, at, b']')?;
        literal.len = u16::try_from(at - start).ok()?;
        Some((literal, values))
    }

    /// A literal elsewhere that differs in the seven numbers of its pose alone, given where they are after its start.
    #[inline]
    pub(super) fn like(&self, start: usize, len: usize, pose: &[(usize, Leading); POSE]) -> Option<Self> {
        let mut like = *self;
        (like.start, like.len) = (u32::try_from(start).ok()?, u16::try_from(len).ok()?);
        for (i, (at, number)) in pose.iter().enumerate() {
            like.at[i] = u16::try_from(*at).ok()?;
            (like.size[i], like.decimals[i]) = (number.len, number.bare_decimals());
        }
        // The tokens after the pose have the same distance from the end of the literal.
        let after = |at: u16| (like.len + at).checked_sub(self.len);
        for i in POSE..TOKENS {
            like.at[i] = after(self.at[i])?;
        }
        like.external = after(self.external)?;
        Some(like)
    }

    /// Moves it.
    #[inline]
    pub(super) fn move_to(&mut self, start: u32) {
        self.start = start;
    }

    /// Whether two literals have all their tokens at the same places, of the same lengths and decimals.
    pub(super) fn is_laid_out_like(&self, other: &Self) -> bool {
        Self { start: other.start, ..*self } == *other
    }

    /// A literal whose configuration or external axes are names: only the seven numbers of the pose.
    pub(super) fn partial(
        source: u16,
        span: Span,
        tokens: [Span; POSE],
        conf: Option<[Span; 4]>,
        external: Span,
    ) -> Option<Self> {
        let mut literal = Self {
            source,
            start: span.start,
            len: u16::try_from(span.len()).ok()?,
            at: [0; TOKENS],
            size: [0; TOKENS],
            decimals: [Leading::ODD; POSE],
            external: u16::try_from(external.start.checked_sub(span.start)?).ok()?,
        };
        for (i, token) in tokens.into_iter().chain(conf.into_iter().flatten()).enumerate() {
            literal.at[i] = u16::try_from(token.start.checked_sub(span.start)?).ok()?;
            literal.size[i] = u8::try_from(token.len()).ok()?;
        }
        Some(literal)
    }

    /// The whole aggregate.
    pub(crate) fn span(&self) -> Span {
        Span { start: self.start, end: self.start + u32::from(self.len) }
    }

    /// Token `i`: 0–2 position, 3–6 quaternion, 7–10 configuration (empty where it is no number).
    pub(crate) fn token(&self, i: usize) -> Span {
        let start = self.start + u32::from(self.at[i]);
        Span { start, end: start + u32::from(self.size[i]) }
    }

    /// Decimals of token `i` of the pose, where it has no other looks to keep.
    pub(super) fn decimals(&self, i: usize) -> Option<usize> {
        (self.decimals[i] != Leading::ODD).then_some(self.decimals[i].into())
    }

    /// Decimals of all tokens of the pose, [`Leading::ODD`] where there are other looks to keep.
    pub(super) fn pose_decimals(&self) -> [u8; POSE] {
        self.decimals
    }

    /// The external axes' aggregate, as text.
    pub(crate) fn external(&self) -> Span {
        Span { start: self.start + u32::from(self.external), end: self.span().end - 1 }
    }

    /// Where the numbers of the external axes stand in its source; `None` where one of them is a name.
    pub(super) fn axes(&self, bytes: &[u8]) -> Option<[Span; EXTERNAL_AXES]> {
        let mut places = [Span::new(0, 0); EXTERNAL_AXES];
        let mut at = self.external().start as usize;
        for (i, place) in places.iter_mut().enumerate() {
            at = blank(bytes, mark(bytes, at, if i == 0 { b'[' } else { b',' })?);
            let end = signed::<false>(bytes, at)?.1;
            *place = Span::new(at, end);
            at = end;
        }
        Some(places)
    }
}

/// Whole numbers only.
pub(super) fn conf(values: [f64; 4]) -> Option<Conf> {
    #[allow(clippy::cast_possible_truncation, clippy::float_cmp)]
    let whole = |v: f64| (v.fract() == 0.0 && v.abs() < 1e6).then_some(v as i32);
    let [cf1, cf4, cf6, cfx] = values;
    Some(Conf::Quarters(Confdata { cf1: whole(cf1)?, cf4: whole(cf4)?, cf6: whole(cf6)?, cfx: whole(cfx)? }))
}

/// Passes blanks and comments: a literal may be wrapped over lines.
fn blank(bytes: &[u8], mut at: usize) -> usize {
    loop {
        match bytes.get(at) {
            Some(b' ') => at += 1,
            Some(b'0'..=b'9' | b'-' | b'[' | b']' | b',' | b'.') | None => return at,
            Some(_) => match lexeme(&bytes[at..]) {
                (LexemeKind::Space | LexemeKind::Comment, len) => at += len,
                _ => return at,
            },
        }
    }
}

fn mark(bytes: &[u8], at: usize, wanted: u8) -> Option<usize> {
    let at = if bytes.get(at) == Some(&wanted) { at } else { blank(bytes, at) };
    (bytes.get(at) == Some(&wanted)).then_some(at + 1)
}

/// `sign? number`: the value, where it ends, and its [`Leading::bare_decimals`]. Blanks between sign and number are legal.
fn signed<const VALUES: bool>(bytes: &[u8], at: usize) -> Option<(f64, usize, u8)> {
    // Axes that are not there, as most writers print them.
    for unused in [&b"9E9"[..], b"9E+09"] {
        let end = at + unused.len();
        if bytes.get(at..end) == Some(unused) && matches!(bytes.get(end), Some(b',' | b']')) {
            return Some((9e9, end, Leading::ODD));
        }
    }
    if let Some(short) = read_leading(&bytes[at.min(bytes.len())..])
        && matches!(bytes.get(at + short.len()), Some(b',' | b']'))
    {
        return Some((short.value, at + short.len(), short.bare_decimals()));
    }
    let negative = bytes.get(at) == Some(&b'-');
    let from = if negative || bytes.get(at) == Some(&b'+') { blank(bytes, at + 1) } else { at };
    let token = unsigned(bytes, from)?;
    let value = if VALUES { token::unsigned(token)? } else { 0.0 };
    let end = from + token.len();
    let plain = read_leading(&bytes[at..end]).filter(|plain| plain.len() == end - at);
    Some((if negative { -value } else { value }, end, plain.map_or(Leading::ODD, Leading::bare_decimals)))
}

/// The number token at `from`. Digits and a point are looked at here, anything else by the lexer.
fn unsigned(bytes: &[u8], from: usize) -> Option<&[u8]> {
    let rest = bytes.get(from..)?;
    let len = rest.iter().position(|b| !b.is_ascii_digit() && *b != b'.')?;
    if len > 0
        && matches!(rest[len], b',' | b']')
        && rest[..len].iter().filter(|b| **b == b'.').count() <= 1
        && rest[0] != b'.'
    {
        return Some(&rest[..len]);
    }
    number.parse(rest).ok().map(|(_, token)| token)
}
