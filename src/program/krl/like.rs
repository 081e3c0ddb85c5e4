//! Lines that differ in nothing but the numbers of their position: one of them is read with all that stands before, the others
//! by their numbers.

use super::chunks::layout;
use super::lex;
use super::run::Site;
use super::value::Place;
use crate::program::orientation::quaternion_of_zyx_deg;
use crate::program::{Editable, Goal, Mark, Motion, Program, Role, Target, Tool, Wobj};
use crate::text::{Source, Span, number};

/// Ends a program that is not there to its end.
const END: &[u8] = b"\nEND\n";

/// First words of what may stand behind the last line: nothing that goes back, and nothing that changes what was before.
const BEHIND: [&[u8]; 8] = [b"PTP", b"LIN", b"SPTP", b"SLIN", b"HALT", b"WAIT", b"$OUT", b"$VEL"];

/// A kind of line.
#[derive(Debug)]
pub(super) struct Like {
    speed: Vec<u8>,
    mark: Option<Mark>,
    /// What stands before each number, without blanks at its ends, and which component of X Y Z A B C that is.
    before: [(Vec<u8>, usize); 6],
    /// What stands behind the last.
    behind: Vec<u8>,
    /// How much of it is the statement: the rest is a comment.
    code: usize,
    target: Target,
    tool: Tool,
    wobj: Wobj,
}

/// Reads lines behind a head.
#[derive(Debug, Default)]
pub(super) struct Reader {
    name: String,
    head: Vec<u8>,
    context: Vec<Source>,
    /// Motions and targets of the head.
    motions: usize,
    targets: usize,
}

/// `$VEL.CP=0.05`: the one assignment that may stand between the lines.
pub(super) fn is_speed(text: &[u8]) -> bool {
    const NAME: &[u8] = b"$VEL.CP";
    let Some(rest) = text.get(NAME.len()..).filter(|_| text[..NAME.len()].eq_ignore_ascii_case(NAME)) else {
        return false;
    };
    let value = rest.trim_ascii_start().strip_prefix(b"=").map(<[u8]>::trim_ascii);
    value.is_some_and(|value| value.first().is_some_and(u8::is_ascii_digit) && number::read(value).is_some())
}

impl Reader {
    /// With the targets of the head; `None` where it has more than one routine, goes back, or anything in it is not known.
    pub(super) fn new(name: &str, head: &[u8], context: &[Source]) -> Option<(Self, Program)> {
        let mut routines = 0;
        for line in lex::lines(head) {
            let code = &head[line.code.range()];
            let mut words = code.split(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_');
            let is = |word: &[u8], wanted: &str| word.eq_ignore_ascii_case(wanted.as_bytes());
            if words.clone().any(|word| is(word, "GOTO") || is(word, "RESUME") || is(word, "TRIGGER")) {
                return None;
            }
            routines += usize::from(words.any(|word| is(word, "DEF") || is(word, "DEFFCT")));
        }
        let mut reader =
            Self { name: name.to_owned(), head: head.to_vec(), context: context.to_vec(), motions: 0, targets: 0 };
        let program = reader.program(&[END]).filter(|_| routines == 1)?;
        (reader.motions, reader.targets) = (program.motion_targets(), program.targets.len());
        Some((reader, program))
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn head(&self) -> &[u8] {
        &self.head
    }

    /// The program of head and these, where all of it is known and nobody has anything to say about it.
    fn program(&self, parts: &[&[u8]]) -> Option<Program> {
        let text = [&[&self.head[..]][..], parts].concat().concat();
        let program = super::read(vec![Source::new(self.name.clone(), text)], self.context.clone()).ok()?;
        let known = program.kept.is_empty() && program.diagnostics.is_empty() && program.unknown_targets().is_empty();
        Some(program).filter(|_| known)
    }

    /// The lines that hold before another one.
    fn lead(speed: &[u8], mark: Option<Mark>) -> Vec<u8> {
        let mark: &[u8] = match mark {
            None => b"",
            Some(Mark::Air) => b"; deflex air\n",
            Some(Mark::Cut) => b"; deflex cut\n",
        };
        [speed, if speed.is_empty() { b"" } else { b"\n" }, mark].concat()
    }

    /// The kind of a line behind this speed and mark.
    pub(super) fn like(&self, speed: &[u8], mark: Option<Mark>, line: &[u8]) -> Option<Like> {
        let lead = Self::lead(speed, mark);
        let mut program = self.program(&[&lead, line, END])?;
        if program.motion_targets() != self.motions + 1 || program.targets.len() != self.targets + 1 {
            return None;
        }
        let site = *layout(&mut program)?.sites.last()?;
        let target = program.targets.pop()?;
        let plain = target.motion == Motion::Linear && target.role == Role::End && target.editable == Editable::Pose;
        let rest = target.external.as_ref().is_none_or(|external| external.is_at_rest());
        let start = self.head.len() + lead.len() + (line.len() - line.trim_ascii_start().len());
        let text = line.trim_ascii();
        // A mark behind it would hold for what follows.
        let marked = lex::lines(line).any(|line| line.mark.is_some());
        if !plain || !rest || marked || target.span.start as usize != start || target.name.is_some() {
            return None;
        }
        let mut tokens = Vec::new();
        for (component, place) in site.tokens.iter().enumerate() {
            tokens.push((place.as_ref()?.span().range(), component));
        }
        tokens.sort_by_key(|(token, _)| token.start);
        let mut at = start;
        let mut before = Vec::new();
        for (token, component) in tokens {
            before.push((text.get(at - start..token.start - start)?.trim_ascii().to_vec(), component));
            at = token.end;
        }
        let behind = text.get(at - start..)?.to_vec();
        // Status and turn stand there, external axes: numbers that are one line's own.
        let own = behind.iter().take_while(|byte| **byte != b'}');
        let mut inline = own.clone().count() < behind.len() && own.copied().all(|byte| byte.is_ascii_whitespace());
        inline &= before[0].0.ends_with(&[&[b'{'][..], &[b"XYZABC"[before[0].1]]].concat());
        let code = (target.span.end as usize).checked_sub(at)?;
        let tool = program.tools.get(usize::from(target.tool))?.clone();
        let wobj = program.wobjs.get(usize::from(target.wobj))?.clone();
        let like =
            Like { speed: speed.to_vec(), mark, before: before.try_into().ok()?, behind, code, target, tool, wobj };
        let (goal, again, end) = like.read(text, start)?;
        let same = goal == like.target.goal && again.tokens == site.tokens && end == like.target.span.end as usize;
        Some(like).filter(|_| same && inline)
    }

    /// The targets behind the last line, which is of this kind, as they are in a chunk where what stands behind it begins at
    /// this byte, behind so many lines and motions.
    pub(super) fn tail(
        &self,
        like: &Like,
        line: &[u8],
        behind: &[u8],
        (at, lines, motions): (usize, usize, u32),
    ) -> Option<Program> {
        let mut ended = false;
        for line in lex::lines(behind) {
            let code = &behind[line.code.range()];
            let name = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'$');
            let word = &code[..code.iter().position(|byte| !name(byte)).unwrap_or(code.len())];
            let known = BEHIND.iter().any(|known| word.eq_ignore_ascii_case(known));
            if ended && !code.is_empty() || !(known || code.is_empty() || code.eq_ignore_ascii_case(b"END")) {
                return None;
            }
            ended |= word.eq_ignore_ascii_case(b"END");
        }
        // What stands behind the last line of a kind begins on a line of its own.
        let begun: &[u8] = if line.ends_with(b"\n") { b"" } else { b"\n" };
        let lead = Self::lead(&like.speed, like.mark);
        let mut program = self.program(&[&lead, line, begun, behind])?;
        let from = self.head.len() + lead.len() + line.len() + begun.len();
        let before = program.sources[0].bytes[..from].iter().filter(|byte| **byte == b'\n').count();
        program.literal_targets = super::literals(behind);
        let sites = &mut layout(&mut program)?.sites;
        let mut own = sites.split_off(self.targets + 1);
        for place in own.iter_mut().flat_map(|site| &mut site.tokens).flatten() {
            *place = place.moved(from, at)?;
        }
        *sites = own;
        let mut targets = program.targets.split_off(self.targets + 1);
        let last = program.targets.pop().filter(|last| last.editable == Editable::Pose)?;
        if last.external != like.target.external {
            return None;
        }
        for target in &mut targets {
            let shifted = |offset: u32| Some((offset as usize).checked_sub(from)? + at);
            target.span = Span::new(shifted(target.span.start)?, shifted(target.span.end)?);
            target.line = u32::try_from((target.line as usize).checked_sub(before)? + lines).ok()?;
            target.ordinal = (target.ordinal as usize).checked_sub(self.motions + 1)?.try_into().ok()?;
            target.ordinal = target.ordinal.checked_add(motions)?;
        }
        program.targets = targets;
        Some(program)
    }
}

impl Like {
    /// Whether it is that of lines behind this speed and mark.
    pub(super) fn holds(&self, speed: &[u8], mark: Option<Mark>) -> bool {
        self.speed == speed && self.mark == mark
    }

    /// Whether a line, without blanks at its ends, is of this kind.
    pub(super) fn fits(&self, text: &[u8]) -> bool {
        text.ends_with(&self.behind) && self.numbers(text, |_, _, _| ()).is_some()
    }

    pub(super) fn target(&self) -> &Target {
        &self.target
    }

    /// Numbers of its tool and its base among those of a program.
    pub(super) fn frames(&self, tools: &mut Vec<Tool>, wobjs: &mut Vec<Wobj>) -> Option<[u16; 2]> {
        Some([
            intern(tools, &self.tool, |known| known.is(&self.tool))?,
            intern(wobjs, &self.wobj, |known| known.is(&self.wobj))?,
        ])
    }

    /// Position and tokens of a line of this kind, without blanks at its ends, that begins at this offset; where its statement
    /// ends.
    pub(super) fn read(&self, text: &[u8], start: usize) -> Option<(Goal, Site, usize)> {
        let (mut numbers, mut site) = ([0.0; 6], Site::default());
        let end = self.numbers(text, |component, at, number| {
            numbers[component] = number.value;
            let at = start + at;
            site.tokens[component] = Place::new(0, Span::new(at, at + number.len()));
        })?;
        let [x, y, z, a, b, c] = numbers;
        let quat = quaternion_of_zyx_deg([a, b, c]);
        Some((Goal::Pose { position_mm: [x, y, z], quat, conf: None }, site, start + end + self.code))
    }

    /// Tells the numbers of a line of this kind, each with its component and its offset; where the last one ends.
    fn numbers(&self, text: &[u8], mut each: impl FnMut(usize, usize, number::Leading)) -> Option<usize> {
        let mut at = 0;
        for (before, component) in &self.before {
            at += blanks(&text[at..]);
            let behind = text[at..].strip_prefix(&before[..])?;
            at = text.len() - behind.len() + blanks(behind);
            let number = number::read_leading(&text[at..])?;
            let end = at + number.len();
            // `1E3` and `1.5.2` are other numbers.
            if text.get(end).is_some_and(|next| next.is_ascii_alphanumeric() || matches!(next, b'.' | b'_')) {
                return None;
            }
            each(*component, at, number);
            at = end;
        }
        (text[at..] == self.behind[..]).then_some(at)
    }
}

fn blanks(text: &[u8]) -> usize {
    text.iter().take_while(|byte| byte.is_ascii_whitespace()).count()
}

fn intern<T: Clone>(known: &mut Vec<T>, wanted: &T, is: impl Fn(&T) -> bool) -> Option<u16> {
    let at = known.iter().position(is).unwrap_or_else(|| {
        known.push(wanted.clone());
        known.len() - 1
    });
    u16::try_from(at).ok()
}

/// What tools and bases of a program are in another.
pub(super) struct Indices {
    tools: Vec<u16>,
    wobjs: Vec<u16>,
}

impl Indices {
    pub(super) fn new(program: &Program, tools: &mut Vec<Tool>, wobjs: &mut Vec<Wobj>) -> Option<Self> {
        let tools = program.tools.iter().map(|own| intern(tools, own, |known| known.is(own))).collect::<Option<_>>()?;
        let wobjs = program.wobjs.iter().map(|own| intern(wobjs, own, |known| known.is(own))).collect::<Option<_>>()?;
        Some(Self { tools, wobjs })
    }

    pub(super) fn set(&self, target: &mut Target) -> Option<()> {
        target.tool = *self.tools.get(usize::from(target.tool))?;
        target.wobj = *self.wobjs.get(usize::from(target.wobj))?;
        Some(())
    }
}
