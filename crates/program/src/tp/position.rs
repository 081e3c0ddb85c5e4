//! Reads `/POS`: the positions as written, and the places of their numbers.

use crate::{AxisName, EXTERNAL_AXES, Reason};
use crate::{Config, GroupAxis};
use deflex_lang::tp::lex::{Parsed, blanks, number_token, spaced, value_of, word};
use deflex_text::Span;
use nom::Parser;
use nom::branch::alt;
use nom::bytes::complete::{tag_no_case, take, take_until, take_while1};
use nom::character::complete::{char, digit1, one_of};
use nom::combinator::{map, opt, recognize};
use nom::sequence::{delimited, preceded};

/// A position of `/POS`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Position {
    /// Its number.
    pub(super) number: u32,
    /// The whole position in the text.
    pub(super) span: Span,
    /// The place that motion group 1 states.
    pub(super) body: Body,
    /// E1 … E6 of motion group 1, mm or degrees.
    pub(super) external: [Option<f64>; EXTERNAL_AXES],
    /// Axes of other motion groups.
    pub(super) groups: Vec<GroupAxis>,
}

/// The place of a position.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Body {
    /// A pose in a user frame.
    Pose(Box<Pose>),
    /// Axes 1 to 6 as the controller counts them, degrees.
    Joints {
        /// Axes 1 to 6.
        deg: [f64; 6],
        /// User frame and tool with which it was taught.
        frames: [Number; 2],
    },
    /// It has no usable numbers, for this reason.
    None(Reason),
}

/// A pose in a user frame, with its number tokens.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pose {
    /// User frame and tool.
    pub(super) frames: [Number; 2],
    /// X, Y, Z (mm), W, P, R (degrees).
    pub(super) values: [f64; 6],
    /// Their tokens, sign included.
    pub(super) tokens: [Span; 6],
    /// Posture and turns, if they can be read.
    pub(super) config: Option<WrittenConfig>,
}

/// Number of a frame or a tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    /// As written.
    Known(u32),
    /// `F`: the frame or tool that is selected when the motion runs.
    Selected,
}

/// `CONFIG` with the places of its turn numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct WrittenConfig {
    /// The configuration.
    pub(super) config: Config,
    /// Tokens of the turn numbers.
    pub(super) tokens: [Span; 3],
}

const EXTERNAL: [&str; EXTERNAL_AXES] = ["E1", "E2", "E3", "E4", "E5", "E6"];

/// The first position in `input`, after any other text; `None` if there is none. Offsets count from the start of `base`, the whole text.
pub(super) fn next<'a>(base: &'a [u8], input: &'a [u8]) -> Option<(&'a [u8], Result<Position, Span>)> {
    let mut rest = input;
    loop {
        let start = rest.iter().position(|b| matches!(b, b'P' | b'p'))?;
        rest = &rest[start..];
        let place = Base(base);
        if let Ok((after, number)) = head(rest) {
            return Some(match groups(place, after) {
                Ok((after, groups)) => {
                    let span = place.span(rest, rest.len() - after.len());
                    (after, Ok(position(number, span, &groups)))
                }
                Err(_) => (after, Err(place.span(rest, rest.len() - after.len()))),
            });
        }
        rest = &rest[1..];
    }
}

/// The text in which tokens are located.
#[derive(Clone, Copy)]
struct Base<'a>(&'a [u8]);

impl Base<'_> {
    /// The span of `len` bytes at the beginning of `at`, which is an end of the text.
    fn span(self, at: &[u8], len: usize) -> Span {
        let start = self.0.len() - at.len();
        Span::new(start, start + len)
    }
}

/// Tokens of E1 … E6 of motion group 1.
pub(super) fn external_tokens(bytes: &[u8], position: &Position) -> [Option<Span>; EXTERNAL_AXES] {
    let base = &bytes[..position.span.end as usize];
    let items = head(&base[position.span.start as usize..]).and_then(|(after, _)| groups(Base(base), after));
    let items = items.map_or_else(|_| Vec::new(), |(_, items)| items);
    EXTERNAL.map(|key| match numbers(&items, [key]) {
        Some([Value::Number { token, .. }]) => Some(token),
        _ => None,
    })
}

/// `P[3:"pick up"]{`
pub(super) fn head(input: &[u8]) -> Parsed<'_, u32> {
    let quoted = delimited(char('"'), take_until("\""), char('"'));
    let plain = take_while1(|b: u8| !matches!(b, b']' | b'\n' | b'\r'));
    let comment = opt(preceded(spaced(char(':')), opt(alt((quoted, plain)))));
    let number = delimited(spaced(char('[')), digit1, spaced(comment));
    let (rest, digits) = delimited(tag_no_case("P"), number, (spaced(char(']')), char('{'))).parse(input)?;
    match std::str::from_utf8(digits).ok().and_then(|digits| digits.parse().ok()) {
        Some(number) => Ok((rest, number)),
        None => Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Digit))),
    }
}

/// A key with its value.
struct Item<'a> {
    group: u32,
    key: &'a [u8],
    value: Value<'a>,
    /// As written.
    unit: Option<&'a [u8]>,
}

/// The value of a key.
#[derive(Clone, Copy)]
enum Value<'a> {
    Number {
        token: Span,
        value: f64,
    },
    /// `********`
    Unset,
    Word(&'a [u8]),
    Text {
        text: &'a [u8],
        at: Span,
    },
}

/// Everything up to the closing brace.
fn groups<'a>(base: Base<'a>, input: &'a [u8]) -> Parsed<'a, Vec<Item<'a>>> {
    let (mut items, mut group, mut rest) = (Vec::new(), 1, input);
    loop {
        (rest, _) = blanks(rest)?;
        if let Ok((after, _)) = (char('}'), opt(preceded(blanks, char(';')))).parse(rest) as Parsed<'_, _> {
            return Ok((after, items));
        }
        if let Ok((after, number)) = group_head(rest) {
            (group, rest) = (number, after);
            continue;
        }
        let (after, (key, _, value)) = (word, spaced(one_of(":=")), |input| value(base, input)).parse(rest)?;
        let unit = alt((tag_no_case("mm"), tag_no_case("deg"), tag_no_case("inch"), tag_no_case("in")));
        let (after, (unit, _)) = (opt(spaced(unit)), opt(spaced(char(',')))).parse(after)?;
        items.push(Item { group, key, value, unit });
        rest = after;
    }
}

/// `GP1:`
fn group_head(input: &[u8]) -> Parsed<'_, u32> {
    let (rest, digits) = delimited(tag_no_case("GP"), digit1, spaced(char(':'))).parse(input)?;
    let number = std::str::from_utf8(digits).ok().and_then(|digits| digits.parse().ok());
    Ok((rest, number.unwrap_or(u32::MAX)))
}

fn value<'a>(base: Base<'a>, input: &'a [u8]) -> Parsed<'a, Value<'a>> {
    if let Ok((rest, token)) = number_token(input) {
        let place = base.span(input, token.len());
        return match value_of(token) {
            Some(value) => Ok((rest, Value::Number { token: place, value })),
            None => Ok((rest, Value::Unset)),
        };
    }
    if let Ok((rest, text)) = delimited(char('\''), take_until("'"), char('\'')).parse(input) as Parsed<'_, &[u8]> {
        return Ok((rest, Value::Text { text, at: base.span(&input[1..], text.len()) }));
    }
    let stars = map(take_while1(|b| b == b'*'), |_| Value::Unset);
    alt((stars, map(word, Value::Word))).parse(input)
}

fn position(number: u32, span: Span, items: &[Item<'_>]) -> Position {
    let external = |i: usize| match numbers(items, [EXTERNAL[i]]) {
        Some([Value::Number { value, .. }]) => Some(value),
        _ => None,
    };
    Position { number, span, body: body(items), external: std::array::from_fn(external), groups: others(items) }
}

/// The numbers of motion group 1 under these keys.
fn numbers<'a, const N: usize>(items: &[Item<'a>], keys: [&str; N]) -> Option<[Value<'a>; N]> {
    let find = |key: &str| {
        let mut own = items.iter().filter(|item| item.group == 1 && item.key.eq_ignore_ascii_case(key.as_bytes()));
        // The value of a key that occurs twice is unknown.
        own.next().filter(|_| own.next().is_none()).map(|item| item.value)
    };
    let found = keys.map(find);
    found.iter().all(Option::is_some).then(|| found.map(|value| value.unwrap_or(Value::Unset)))
}

/// Whether a number of motion group 1 has another unit than the one in which its key is read.
fn has_other_units(items: &[Item<'_>]) -> bool {
    let wanted = |key: &[u8]| match key {
        [b'X' | b'Y' | b'Z' | b'x' | b'y' | b'z'] => Some(&b"mm"[..]),
        [b'W' | b'P' | b'R' | b'w' | b'p' | b'r'] | [b'J' | b'j', b'1'..=b'6'] => Some(&b"deg"[..]),
        _ => None,
    };
    let inches = |unit: &[u8]| unit[0].eq_ignore_ascii_case(&b'i');
    let other = |item: &Item<'_>| {
        let Some(unit) = item.unit else { return false };
        inches(unit) || wanted(item.key).is_some_and(|wanted| !unit.eq_ignore_ascii_case(wanted))
    };
    items.iter().any(|item| item.group == 1 && other(item))
}

fn body(items: &[Item<'_>]) -> Body {
    if has_other_units(items) {
        return Body::None(Reason::PositionUnits);
    }
    if !items.is_empty() && items.iter().all(|item| item.group != 1) {
        return Body::None(Reason::PositionOfOtherGroups);
    }
    let frame = |key: &str| match numbers(items, [key]) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        Some([Value::Number { value, .. }]) if (0.0..1e6).contains(&value) && value.fract() == 0.0 => {
            Some(Number::Known(value as u32))
        }
        Some([Value::Word(word)]) if word.eq_ignore_ascii_case(b"F") => Some(Number::Selected),
        None => Some(Number::Selected),
        Some(_) => None,
    };
    let (Some(uf), Some(ut)) = (frame("UF"), frame("UT")) else {
        return Body::None(Reason::PositionFrames);
    };
    let frames = [uf, ut];
    if let Some(found) = numbers(items, ["X", "Y", "Z", "W", "P", "R"]) {
        let mut pose = Pose { frames, values: [0.0; 6], tokens: [Span::default(); 6], config: config(items) };
        for (i, value) in found.into_iter().enumerate() {
            match value {
                Value::Number { token, value } => (pose.tokens[i], pose.values[i]) = (token, value),
                _ => return Body::None(Reason::PositionUntaught),
            }
        }
        return Body::Pose(Box::new(pose));
    }
    let Some(found) = numbers(items, ["J1", "J2", "J3", "J4", "J5", "J6"]) else {
        return Body::None(Reason::PositionIncomplete);
    };
    let mut deg = [0.0; 6];
    for (deg, value) in deg.iter_mut().zip(found) {
        match value {
            Value::Number { value, .. } => *deg = value,
            _ => return Body::None(Reason::PositionUntaught),
        }
    }
    Body::Joints { deg, frames }
}

/// `'N U T, 0, 0, 0'`, under its English or its German name.
fn config(items: &[Item<'_>]) -> Option<WrittenConfig> {
    let found = numbers(items, ["CONFIG"]).or_else(|| numbers(items, ["KONFIG"]));
    let Some([Value::Text { text, at }]) = found else { return None };
    let base = Base(text);
    let mut config = Config { posture: 0, turns: [0; 3] };
    let mut tokens = [Span::default(); 3];
    let (mut rest, mut letters) = (text, 0);
    while let Ok((after, letter)) = spaced(take(1_usize)).parse(rest) as Parsed<'_, &[u8]> {
        match letter[0].to_ascii_uppercase() {
            b'N' | b'U' | b'T' => {}
            b'F' => config.posture |= 1,
            b'D' => config.posture |= 2,
            b'B' => config.posture |= 4,
            // L and R distinguish the shoulder postures of arms with a lateral offset.
            b'L' | b'R' => letters -= 1,
            b',' => break,
            _ => return None,
        }
        letters += 1;
        rest = after;
    }
    if letters != 3 {
        return None;
    }
    for i in 0..3 {
        let turn = recognize((opt(one_of("+-")), digit1));
        // The comma before the first one was read with the letters.
        let comma = |input| opt(char(',')).parse(input) as Parsed<'_, Option<char>>;
        let (after, (_, token)) = (comma, spaced(turn)).parse(rest).ok()?;
        config.turns[i] = std::str::from_utf8(token).ok()?.parse().ok()?;
        // The start of the token follows from the rest of the text and its own length.
        let end = text.len() - after.len();
        let trimmed = text[..end].trim_ascii_end().len();
        let place = base.span(&text[trimmed - token.len()..], token.len());
        tokens[i] = Span { start: at.start + place.start, end: at.start + place.end };
        rest = after;
    }
    rest.is_empty().then_some(WrittenConfig { config, tokens })
}

/// Axes of other motion groups, each once; the pose of another arm counts as its whole group.
fn others(items: &[Item<'_>]) -> Vec<GroupAxis> {
    let mut found: Vec<GroupAxis> = Vec::new();
    for item in items.iter().filter(|item| item.group != 1) {
        let group = u8::try_from(item.group).unwrap_or(u8::MAX);
        let inches = item.unit.is_some_and(|unit| unit[0].eq_ignore_ascii_case(&b'i'));
        let position = match item.value {
            Value::Number { value, .. } if !inches => Some(value),
            _ => None,
        };
        let (axis, position) = match item.key {
            [b'J' | b'j', number @ b'1'..=b'9'] => (AxisName::Joint { group, number: number - b'0' }, position),
            [b'E' | b'e', number @ b'1'..=b'9'] => (AxisName::Extended { group, number: number - b'0' }, position),
            [b'X' | b'x'] => (AxisName::Group(group), None),
            _ => continue,
        };
        match found.iter_mut().find(|known| known.axis == axis) {
            // The position of an axis that occurs twice is unknown.
            Some(known) => known.position = None,
            None => found.push(GroupAxis { axis, position, at_rest: false }),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &[u8] = b"P[2:\"a]b\"]{\r\n   GP1:\r\n\tUF : 1, UT : F,\t\tCONFIG : 'F D B, 1, -1,  0',\r\n\tX =  1111.865  mm,\tY =\
        .000 mm,\tZ =    -.500  mm,\r\n\tW =   -70.737 deg,\tP =    11.951 deg,\tR =   -35.487 deg,\r\n\tE1=  0.000  mm\r\n};\r\nP[3]{GP1: UF : 0, UT : 1, J1= 1 deg, J2= 2 deg, J3= 3 deg, J4= 4 deg, J5= 5 deg, J6= 6 deg GP2: UF : F, UT : F, J1= 7 mm};";

    #[test]
    #[allow(clippy::float_cmp)] // the very numbers that were written
    fn a_position_is_read_with_its_tokens() {
        let (rest, first) = next(TEXT, TEXT).unwrap();
        let Ok(Position { number: 2, body: Body::Pose(pose), groups, .. }) = first else { panic!("{first:?}") };
        assert!(groups.is_empty());
        assert_eq!(pose.values, [1111.865, 0.0, -0.5, -70.737, 11.951, -35.487]);
        let text = |span: Span| &TEXT[span.range()];
        assert_eq!(pose.tokens.map(text), [&b"1111.865"[..], b".000", b"-.500", b"-70.737", b"11.951", b"-35.487"]);
        assert_eq!(pose.frames, [Number::Known(1), Number::Selected]);
        let config = pose.config.unwrap();
        assert_eq!(config.config, Config { posture: 7, turns: [1, -1, 0] });
        assert_eq!(config.tokens.map(text), [&b"1"[..], b"-1", b"0"]);
        let (rest, second) = next(TEXT, rest).unwrap();
        let second = second.unwrap();
        let axis = AxisName::Joint { group: 2, number: 1 };
        assert_eq!(second.groups, [GroupAxis { axis, position: Some(7.0), at_rest: false }]);
        assert!(matches!(second.body, Body::Joints { deg: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], .. }));
        assert!(next(TEXT, rest).is_none());
    }

    #[test]
    fn what_is_not_taught_or_not_whole_is_said() {
        let none = |text: &[u8]| match next(text, text).unwrap().1.unwrap().body {
            Body::None(why) => why,
            body => panic!("{body:?}"),
        };
        assert_eq!(
            none(b"P[1]{GP1: UF:F,UT:F, X = ******** mm, Y = 0 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg};"),
            Reason::PositionUntaught
        );
        assert_eq!(none(b"P[1:]{GP1: UF:F,UT:F, X = 1 mm, Y = 0 mm};"), Reason::PositionIncomplete);
        assert_eq!(none(b"P[1]{GP2: UF:F,UT:F, J1 = 1 mm};"), Reason::PositionOfOtherGroups);
        assert!(next(b"P[1]{ GP1: UF 1 };", b"P[1]{ GP1: UF 1 };").unwrap().1.is_err());
    }
}
