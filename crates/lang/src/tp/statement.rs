//! The statements of `/MN`, by their effect on where the robot goes.

use super::builtin;
use super::expression::{constant, count, expression};
use super::lex::{Parsed, brackets, index, is_letter, keyword, of_first_group, register_and_element, spaced, word};
use super::lines::Line;
use super::motion::{self, Motion};
use crate::ir::{Binary, Callee, Expression, ExpressionKind as Is, SourceSpan};
use crate::reason::Reason;
use nom::Parser;
use nom::branch::alt;
use nom::bytes::complete::{tag, tag_no_case};
use nom::combinator::{opt, recognize};

/// A statement.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{StatementKind, kind, lines};
///
/// let text = b"1:LBL[7] ;\n2:JMP LBL[7] ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// assert!(matches!(kind(&lines[0]), StatementKind::Label(b"7")));
/// assert!(matches!(kind(&lines[1]), StatementKind::Jump(b"7")));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum StatementKind<'a> {
    /// A statement without an effect on motions: outputs, waits, messages, speeds, remarks.
    Plain,
    /// `! deflex air`, `! deflex cut`
    Mark(&'static [u8]),
    /// A motion.
    Motion(Box<Motion<'a>>),
    /// `UFRAME_NUM=…`, `UTOOL_NUM=…`: frame or tool, and the value.
    Select(Frame, &'a [u8]),
    /// `UFRAME[…]=…`, `UTOOL[…]=…`: frame or tool, the index, and the index of the position register; empty if it is another value.
    Redefine(Frame, &'a [u8], &'a [u8]),
    /// `PR[…,…]=…`: the indices of position register and element, and the value.
    Element(&'a [u8], &'a [u8], &'a [u8]),
    /// `PR[…]=…`: the index, and what it becomes.
    PositionRegister(&'a [u8], Whole),
    /// `OVERRIDE=…%`: per cent of every speed; empty if another statement sets it.
    Override(&'a [u8]),
    /// `R[…]=…`: index and value.
    Register(&'a [u8], &'a [u8]),
    /// `LBL[…]`
    Label(&'a [u8]),
    /// `JMP LBL[…]`
    Jump(&'a [u8]),
    /// `IF … THEN`: the text after `IF`.
    If(&'a [u8]),
    /// `ELSE`
    Else,
    /// `ENDIF`
    EndIf,
    /// `IF …,statement`: the condition with the statement.
    When(&'a [u8]),
    /// `SELECT R[…]=value,statement`: the compared expression, and the value with the statement.
    SelectCase(&'a [u8], &'a [u8]),
    /// A further case of a `SELECT`, `=value,statement`.
    Case(&'a [u8]),
    /// The last case of a `SELECT`, `ELSE,statement`.
    ElseCase(&'a [u8]),
    /// `FOR R[…]=from TO to`: index, first value, last value, whether it counts down.
    For(&'a [u8], &'a [u8], &'a [u8], bool),
    /// `ENDFOR`
    EndFor,
    /// A call of another program, by its name; empty if the name is known only at run time.
    Call(&'a [u8]),
    /// A program runs in parallel from here on, or may run at any moment, by its name; empty if the name is known only at run time.
    Concurrent(&'a [u8]),
    /// `WAIT …`: the condition, and the label of `TIMEOUT,LBL[…]`.
    Wait(&'a [u8], Option<&'a [u8]>),
    /// Paths are shifted at run time from here on, for this reason.
    Displace(Reason),
    /// `$MNUFRAME[…]=…`: values of frames or tools by their system variables.
    RedefineAny,
    /// `END`, `ABORT`
    End,
    /// An unknown statement, which may be a macro, that is, a call.
    Macro,
    /// An unknown statement, after which the program may continue anywhere.
    Unknown,
}

/// User frame or tool.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{Frame, StatementKind, kind, lines};
///
/// let text = b"1:UTOOL_NUM=2 ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// assert!(matches!(kind(&lines[0]), StatementKind::Select(Frame::Tool, b"2")));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Frame {
    /// `UFRAME`
    User,
    /// `UTOOL`
    Tool,
}

/// What a position register as a whole becomes.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{StatementKind, Whole, kind, lines};
///
/// let text = b"1:PR[1]=LPOS ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// assert!(matches!(kind(&lines[0]), StatementKind::PositionRegister(b"1", Whole::Position)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Whole {
    /// All elements are zero (`PR[1]=LPOS-LPOS`, `PR[1]=PR[1]-PR[1]`).
    Zero,
    /// A position of the program with this number (`P[4]`, `P[4]+PR[2]`), in X, Y, Z, W, P, R or in axis angles.
    Taught(u32),
    /// The actual position (`LPOS`): X, Y, Z, W, P, R that are known only at run time.
    Position,
    /// Anything, also axis angles.
    Unknown,
}

/// First words of statements without an effect on motions, in upper case.
const PLAIN: [&str; 20] = [
    "MESSAGE", "PAUSE", "JOINT_MAX_SPEED", "LINEAR_MAX_SPEED", "PAYLOAD", "TRAGLST", "UALM", "RSR", "COL", "SKIP",
    "OFFSET", "TOOL_OFFSET", "VOFFSET", "LOCK", "UNLOCK", "ACC", "ARC", "SPOT", "PALLETIZING", "FB",
];

/// Data whose assignment has no effect on motions; an index follows the name.
const DATA: [&str; 20] = [
    "DO", "RO", "SO", "UO", "GO", "AO", "WO", "SDO", "SPO", "F", "M", "SR", "P", "PL", "AR", "DI", "A", "E", "TIMER",
    "VR",
];

/// The kind of a statement.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{StatementKind, kind, lines};
///
/// let text = b"1:DO[1]=ON ;\n";
/// assert!(matches!(kind(&lines::statements(text, 0..text.len())[0]), StatementKind::Plain));
/// ```
#[must_use]
pub fn kind<'a>(line: &'a Line<'_>) -> StatementKind<'a> {
    of(&line.text, true)
}

fn of(text: &[u8], nested: bool) -> StatementKind<'_> {
    let text = text.trim_ascii();
    if text.is_empty() || text.starts_with(b"//") || text.starts_with(b"--") {
        return StatementKind::Plain;
    }
    if let Some(remark) = text.strip_prefix(b"!") {
        return mark(remark).map_or(StatementKind::Plain, StatementKind::Mark);
    }
    if let Some(motion) = motion::motion(text) {
        return StatementKind::Motion(Box::new(motion));
    }
    if let Some(rest) = text.strip_prefix(b"=").filter(|_| nested) {
        return StatementKind::Case(rest);
    }
    let Ok((rest, name)) = alt((word, recognize((tag("$"), word)))).parse(text) else { return unknown(text) };
    let upper = name.to_ascii_uppercase();
    let trimmed = rest.trim_ascii();
    match &upper[..] {
        b"OVERRIDE" => {
            let percent = trimmed.strip_prefix(b"=").unwrap_or_default().trim_ascii();
            StatementKind::Override(percent.strip_suffix(b"%").unwrap_or(percent))
        }
        b"LBL" => labelled(rest, StatementKind::Label),
        b"JMP" => jump(trimmed),
        b"IF" | b"WENN" if nested => conditional(trimmed),
        b"ELSE" if trimmed.is_empty() => StatementKind::Else,
        b"ELSE" if trimmed.starts_with(b",") => StatementKind::ElseCase(&trimmed[1..]),
        b"ENDIF" => StatementKind::EndIf,
        b"SELECT" if nested => select(trimmed),
        b"FOR" => counted(trimmed),
        b"ENDFOR" => StatementKind::EndFor,
        b"CALL" | b"AUFRUF" => called(trimmed),
        b"RUN" | b"MONITOR" | b"ERROR_PROG" | b"RESUME_PROG" | b"WHEN" => concurrent(trimmed),
        b"END" | b"ABORT" if trimmed.is_empty() => StatementKind::End,
        b"R" => assigned(rest, StatementKind::Register),
        b"PR" => position_register(rest),
        b"UFRAME_NUM" | b"BENUTZER_NUM" => selected(Frame::User, rest),
        b"UTOOL_NUM" | b"WKZ_NUM" => selected(Frame::Tool, rest),
        b"UFRAME" => redefined(Frame::User, rest),
        b"UTOOL" => redefined(Frame::Tool, rest),
        b"WAIT" | b"WARTE" => wait(trimmed),
        b"TRACK" | b"TOUCH" | b"DPM" | b"LINE" | b"FORCE" | b"WEAVE" | b"SEARCH" | b"MP" => {
            StatementKind::Displace(Reason::Tracking)
        }
        b"SOFTFLOAT" => StatementKind::Displace(Reason::Softfloat),
        b"INDEPENDENT" | b"SIMULTANEOUS" => grouped(trimmed),
        [b'$', ..] => system_variable(&text.to_ascii_uppercase()),
        word if PLAIN.iter().any(|plain| plain.as_bytes() == word) => StatementKind::Plain,
        word if trimmed.starts_with(b"[") && DATA.iter().any(|data| data.as_bytes() == word) => StatementKind::Plain,
        _ => unknown(text),
    }
}

/// `$MNUFRAME[1,3]=PR[2]`, `$MNUFRAMENUM[1]=3`, `$FRM_CHKTYP=-2`, in upper case: the effect of the assignment; the name may be anywhere in
/// the path.
fn system_variable(upper: &[u8]) -> StatementKind<'static> {
    let has = |wanted: &[u8]| contains(upper, wanted);
    match () {
        () if has(b"FRM_CHKTYP") => StatementKind::Displace(Reason::FrameCheckUnknown),
        () if has(b"GENOVERRIDE") || has(b"PRGOVERRIDE") => StatementKind::Override(b""),
        () if has(b"FRAMENUM") || has(b"TOOLNUM") => StatementKind::Macro,
        () if has(b"FRAME") || has(b"TOOL") => StatementKind::RedefineAny,
        () => StatementKind::Plain,
    }
}

/// `GP GP1 L P[1] … GP2 J P[1] …`: several motion groups with motions of their own; the motion of group 1 counts.
fn grouped(rest: &[u8]) -> StatementKind<'_> {
    let upper = rest.to_ascii_uppercase();
    let own = memchr::memmem::find(&upper, b"GP1").and_then(|at| motion::motion(rest[at + 3..].trim_ascii_start()));
    match own {
        Some(own) => StatementKind::Motion(Box::new(Motion { moved: Some(Reason::OneGroupOfMany), ..own })),
        None => StatementKind::Unknown,
    }
}

/// A statement with brackets may jump; a macro has only a name.
fn unknown(text: &[u8]) -> StatementKind<'_> {
    if text.contains(&b'[') { StatementKind::Unknown } else { StatementKind::Macro }
}

fn contains(text: &[u8], wanted: &[u8]) -> bool {
    memchr::memmem::find(text, wanted).is_some()
}

/// `deflex air`, `deflex cut`
fn mark(remark: &[u8]) -> Option<&'static [u8]> {
    let apart = |b: &u8| b.is_ascii_whitespace() || *b == b';';
    let mut words = remark.split(apart).filter(|word| !word.is_empty());
    words.next().filter(|word| word.eq_ignore_ascii_case(b"deflex"))?;
    match words.next()?.to_ascii_lowercase().as_slice() {
        b"air" => Some(b"air"),
        b"cut" => Some(b"cut"),
        _ => None,
    }
}

/// `[3:name]`
fn labelled<'a>(rest: &'a [u8], kind: impl Fn(&'a [u8]) -> StatementKind<'a>) -> StatementKind<'a> {
    brackets(rest.trim_ascii_start()).map_or(StatementKind::Unknown, |(_, within)| kind(index(within)))
}

/// `LBL[3]`
fn jump(rest: &[u8]) -> StatementKind<'_> {
    match keyword("LBL").parse(rest) {
        Ok((rest, _)) => labelled(rest, StatementKind::Jump),
        Err(_) => StatementKind::Unknown,
    }
}

/// `[3:name]=value`
fn assigned<'a>(rest: &'a [u8], kind: impl Fn(&'a [u8], &'a [u8]) -> StatementKind<'a>) -> StatementKind<'a> {
    match (brackets, spaced(tag("="))).parse(rest) {
        Ok((value, (within, _))) => kind(index(within), value),
        Err(_) => StatementKind::Unknown,
    }
}

/// `=3`, `[GP1]=3`
fn selected(frame: Frame, rest: &[u8]) -> StatementKind<'_> {
    match (opt(brackets), spaced(tag("="))).parse(rest) {
        // The selection is that of another motion group.
        Ok((_, (Some(groups), _))) if !contains(&groups.to_ascii_uppercase(), b"GP1") => StatementKind::Plain,
        Ok((value, _)) => StatementKind::Select(frame, value),
        Err(_) => StatementKind::Unknown,
    }
}

/// `[3]=PR[1]`, `[GP1:3]=PR[1]`
fn redefined(frame: Frame, rest: &[u8]) -> StatementKind<'_> {
    match (brackets, spaced(tag("="))).parse(rest) {
        Ok((value, (within, _))) => match of_first_group(within) {
            Some(within) => {
                let register = (keyword("PR"), brackets).parse(value.trim_ascii()) as Parsed<'_, _>;
                let register = register.ok().filter(|(after, _)| after.is_empty());
                let register = register.and_then(|(_, (_, within))| of_first_group(within));
                StatementKind::Redefine(frame, index(within), register.map_or(&b""[..], index))
            }
            None => StatementKind::Plain,
        },
        Err(_) => StatementKind::Unknown,
    }
}

/// `[9,1:x]=5`, `[9:home]=LPOS`; indices that are not understood are unknown ones.
fn position_register(rest: &[u8]) -> StatementKind<'_> {
    let Ok((value, (within, _))) = (brackets, spaced(tag("="))).parse(rest) as Parsed<'_, _> else {
        return StatementKind::PositionRegister(b"", Whole::Unknown);
    };
    let Some(within) = of_first_group(within) else { return StatementKind::Plain };
    let (indices, element) = register_and_element(within);
    if let Some(element) = element {
        return StatementKind::Element(indices, element, value);
    }
    let taught = (keyword("P"), brackets).parse(value.trim_ascii()) as Parsed<'_, _>;
    // A position register that is added or subtracted is one on which the position does not depend.
    let is_moved = |after: &[u8]| {
        let added = (spaced(alt((tag("+"), tag("-")))), keyword("PR"), brackets).parse(after) as Parsed<'_, _>;
        added.is_ok_and(|(after, _)| after.trim_ascii().is_empty())
    };
    let taught = taught
        .ok()
        .filter(|(after, _)| after.is_empty() || is_moved(after))
        .and_then(|(_, (_, within))| count(index(within)));
    let value: Vec<u8> = value.iter().filter(|b| !b.is_ascii_whitespace()).map(u8::to_ascii_uppercase).collect();
    let whole = match &value[..] {
        _ if taught.is_some() => taught.map_or(Whole::Unknown, Whole::Taught),
        b"LPOS" => Whole::Position,
        b"LPOS-LPOS" => Whole::Zero,
        _ => {
            let mut sides = value.split(|b| *b == b'-');
            let itself = [sides.next(), sides.next(), sides.next()];
            let is_itself = |side: &[u8]| {
                let register = (keyword("PR"), brackets).parse(side) as Parsed<'_, _>;
                register.is_ok_and(|(after, (_, own))| after.is_empty() && index(own) == indices)
            };
            match itself {
                [Some(one), Some(other), None] if is_itself(one) && is_itself(other) => Whole::Zero,
                _ => Whole::Unknown,
            }
        }
    };
    StatementKind::PositionRegister(indices, whole)
}

/// `(…) THEN`, `…,statement`
fn conditional(rest: &[u8]) -> StatementKind<'_> {
    let upper = rest.to_ascii_uppercase();
    // Not `IF …,CALL LATHEN`.
    match upper.strip_suffix(b"THEN").filter(|before| !before.last().is_some_and(|b| is_letter(*b))) {
        Some(condition) => StatementKind::If(&rest[..condition.len()]),
        None => StatementKind::When(rest),
    }
}

/// `R[1]=2,statement`
fn select(rest: &[u8]) -> StatementKind<'_> {
    let operand = recognize((word, brackets));
    match (operand, spaced(tag("="))).parse(rest) as Parsed<'_, _> {
        Ok((case, (operand, _))) => StatementKind::SelectCase(operand, case),
        Err(_) => StatementKind::Unknown,
    }
}

/// `R[1:i]=1 TO 5`
fn counted(rest: &[u8]) -> StatementKind<'_> {
    let Ok((bounds, (_, within, _))) = (keyword("R"), brackets, spaced(tag("="))).parse(rest) as Parsed<'_, _> else {
        return StatementKind::Unknown;
    };
    let upper = bounds.to_ascii_uppercase();
    for (between, down) in [(&b" DOWNTO "[..], true), (b" TO ", false)] {
        if let Some(at) = memchr::memmem::find(&upper, between) {
            return StatementKind::For(index(within), &bounds[..at], &bounds[at + between.len()..], down);
        }
    }
    StatementKind::Unknown
}

/// `SUB(1,2)`
fn called(rest: &[u8]) -> StatementKind<'_> {
    let (name, after) = motion::program(rest);
    let ends = |text: &[u8]| text.trim_ascii().is_empty() || text.trim_ascii_end().ends_with(b")");
    match brackets(after) {
        // The text after the arguments is another statement, which is not read.
        Ok((after, _)) if !after.trim_ascii_start().starts_with(b"(") && !ends(after) => StatementKind::Unknown,
        Err(_) if !after.trim_ascii_start().starts_with(b"(") && !ends(after) => StatementKind::Unknown,
        _ => StatementKind::Call(name),
    }
}

/// ` SUB`, `=SUB`, `[1]=SUB`, ` DI[1]=ON,CALL SUB`: the program.
fn concurrent(rest: &[u8]) -> StatementKind<'_> {
    let upper = rest.to_ascii_uppercase();
    let after = match memchr::memmem::rfind(&upper, b"CALL ") {
        Some(call) => &rest[call + 5..],
        None => rest.rsplit(|b| *b == b'=').next().unwrap_or(rest),
    };
    StatementKind::Concurrent(motion::program(after.trim_ascii_start()).0)
}

/// The statement after a condition or a case.
pub(super) fn guarded_by<'a>(kind: &StatementKind<'a>) -> Option<StatementKind<'a>> {
    match kind {
        StatementKind::When(text) | StatementKind::SelectCase(_, text) | StatementKind::Case(text) => {
            Some(guarded(after_condition(text)))
        }
        StatementKind::ElseCase(text) => Some(guarded(text)),
        _ => None,
    }
}

/// Programs that a statement runs, also after a condition; an empty name is known only at run time.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{kind, lines, runs};
///
/// let text = b"1:IF DI[1]=ON,CALL OPEN ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// assert_eq!(runs(&kind(&lines[0])), [b"OPEN"]);
/// ```
#[must_use]
pub fn runs<'a>(kind: &StatementKind<'a>) -> Vec<&'a [u8]> {
    match kind {
        StatementKind::Call(name) | StatementKind::Concurrent(name) => vec![name],
        StatementKind::Motion(motion) => motion.calls.clone(),
        _ => guarded_by(kind).map_or_else(Vec::new, |guarded| runs(&guarded)),
    }
}

/// The text after a condition: from the first comma on that is outside of brackets and strings.
pub(super) fn after_condition(text: &[u8]) -> &[u8] {
    let (mut depth, mut quoted) = (0_i32, false);
    for (at, byte) in text.iter().enumerate() {
        match byte {
            b'\'' => quoted = !quoted,
            _ if quoted => {}
            b'[' | b'(' => depth += 1,
            b']' | b')' => depth -= 1,
            b',' if depth <= 0 => return &text[at..],
            _ => {}
        }
    }
    // No statement that is known.
    b",?[]"
}

/// `DI[1]=ON TIMEOUT,LBL[3]`, `.50(sec)`
fn wait(rest: &[u8]) -> StatementKind<'_> {
    let upper = rest.to_ascii_uppercase();
    let Some(at) = memchr::memmem::rfind(&upper, b"TIMEOUT") else { return StatementKind::Wait(rest, None) };
    let condition = rest[..at].trim_ascii_end();
    let condition = condition.strip_suffix(b",").unwrap_or(condition);
    match (spaced(tag(",")), tag_no_case("LBL")).parse(&rest[at + 7..]) as Parsed<'_, _> {
        Ok((rest, _)) => labelled(rest, |label| StatementKind::Wait(condition, Some(label))),
        Err(_) => StatementKind::Wait(condition, None),
    }
}

/// The text after the comma of a condition or a value.
pub(super) fn guarded<'a>(text: &'a [u8]) -> StatementKind<'a> {
    let text = text.trim_ascii_start();
    of(text.strip_prefix(b",").unwrap_or(text), false)
}

/// The value of a case, and the text after it.
pub(super) fn case(text: &[u8]) -> (&[u8], StatementKind<'_>) {
    // Quotes and brackets hold no comma: a value is a number, a constant or a register.
    let at = text.iter().position(|b| *b == b',').unwrap_or(text.len());
    (&text[..at], guarded(&text[at..]))
}

/// A position that a statement names and does not move to.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{kind, lines, positions_named};
///
/// let text = b"1:P[4]=LPOS ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// assert!(positions_named(&lines[0], &kind(&lines[0]))[0].is_assigned);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NamedPosition<'a> {
    /// Its index as written.
    pub index: &'a [u8],
    /// Whether the statement gives it, or one of its elements, a value.
    pub is_assigned: bool,
}

/// The positions that a statement names, without those to which it moves, and without the position that becomes the value of a position register
/// (`PR[1]=P[4]`): a run follows the register.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{kind, lines, positions_named};
///
/// let text = b"1:PR[1,3]=P[4,3] ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// let named = positions_named(&lines[0], &kind(&lines[0]));
/// assert_eq!((named[0].index, named[0].is_assigned), (&b"4"[..], false));
/// ```
#[must_use]
pub fn positions_named<'a>(line: &'a Line<'_>, kind: &StatementKind<'_>) -> Vec<NamedPosition<'a>> {
    let is_position = |point| matches!(point, motion::Point::Position(_));
    let skip = match kind {
        StatementKind::Motion(motion) => motion.via.into_iter().chain([motion.end]).filter(|p| is_position(*p)).count(),
        StatementKind::PositionRegister(register, Whole::Taught(_)) if count(register).is_some() => 1,
        _ => 0,
    };
    let named = |(within, rest): (&'a [u8], &'a [u8])| NamedPosition {
        index: index(within).split(|b| *b == b',').next().unwrap_or_default(),
        is_assigned: rest.trim_ascii_start().starts_with(b"="),
    };
    bracketed(&line.text, b"P[").skip(skip).map(named).collect()
}

/// The indices of the position registers on whose values something depends that a statement does; not those of the register to which it moves, and of
/// one to whose element it adds something (`PR[1,3]=PR[1,3]+50`).
pub(super) fn registers_used<'a>(line: &'a Line<'_>, kind: &StatementKind<'_>) -> Vec<&'a [u8]> {
    let skip = match kind {
        StatementKind::Motion(motion) => usize::from(motion.moves_to_register().is_some()),
        StatementKind::PositionRegister(..) => 1,
        StatementKind::Element(register, element, value) => 1 + usize::from(is_sum_with(value, register, element)),
        _ => 0,
    };
    bracketed(&line.text, b"PR[").skip(skip).map(|(within, _)| register_index(within)).collect()
}

/// The index of a position register, without its motion group and element.
fn register_index(within: &[u8]) -> &[u8] {
    // A register has the positions of all groups.
    let within = of_first_group(within).unwrap_or(within);
    let grouped = within.len() > 2 && within[..2].eq_ignore_ascii_case(b"GP");
    let own = within.iter().position(|b| *b == b':').filter(|_| grouped).map_or(within, |at| &within[at + 1..]);
    register_and_element(own).0
}

/// Whether a value is an element of a position register, plus or minus something, and names no other one before it.
fn is_sum_with(value: &[u8], register: &[u8], element: &[u8]) -> bool {
    let own = [register, element].map(count);
    own.iter().all(Option::is_some) && adds_to(&expression(value, SourceSpan::default()), own)
}

fn adds_to(sum: &Expression, own: [Option<u32>; 2]) -> bool {
    let names_none = |part: &Expression| {
        let mut is_free = true;
        part.each(&mut |part| {
            is_free &= !matches!(part.kind, Is::Call(Callee::Builtin(builtin::VALUE), _) | Is::Unknown(..));
        });
        is_free
    };
    match &sum.kind {
        Is::Call(Callee::Builtin(builtin::VALUE), of) => of.iter().map(|index| constant(&index.value)).eq(own),
        Is::Binary(Binary::Add, two) => adds_to(&two[0], own) || names_none(&two[0]) && adds_to(&two[1], own),
        Is::Binary(Binary::Subtract, two) => adds_to(&two[0], own),
        _ => false,
    }
}

/// The indices of the registers, and those of the position registers, that a condition names.
pub(super) fn registers_in(condition: &[u8]) -> [Vec<&[u8]>; 2] {
    [&b"R["[..], b"PR["].map(|name| bracketed(condition, name).map(|(within, _)| register_index(within)).collect())
}

/// The texts in the brackets after a name in a statement, each with the text after it. An index without an end may be any.
fn bracketed<'a>(text: &'a [u8], name: &'static [u8]) -> impl Iterator<Item = (&'a [u8], &'a [u8])> {
    let is_remark = [&b"!"[..], b"//", b"--"].iter().any(|sign| text.starts_with(sign));
    let upper = if is_remark { Vec::new() } else { text.to_ascii_uppercase() };
    let is_word = |at: &usize| !at.checked_sub(1).is_some_and(|b| text[b].is_ascii_alphanumeric() || text[b] == b'_');
    let found: Vec<usize> = memchr::memmem::find_iter(&upper, name).filter(is_word).collect();
    let within = move |at: usize| brackets(&text[at + name.len() - 1..]).map(|(rest, within)| (within, rest));
    found.into_iter().map(move |at| within(at).unwrap_or((b"R[0]", b"")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statements_are_what_they_do() {
        let is = |text: &'static str| of(text.as_bytes(), true);
        assert_eq!(is("! deflex air"), StatementKind::Mark(b"air"));
        assert_eq!(is("! deflexion of the arm"), StatementKind::Plain);
        assert_eq!(is("UFRAME_NUM=R[1]"), StatementKind::Select(Frame::User, b"R[1]"));
        assert_eq!(is("WKZ_NUM=1"), StatementKind::Select(Frame::Tool, b"1"));
        assert_eq!(is("UFRAME_NUM[GP2]=1"), StatementKind::Plain);
        assert_eq!(is("UFRAME[3]=PR[1]"), StatementKind::Redefine(Frame::User, b"3", b"1"));
        assert_eq!(is("UTOOL[GP1:2]=PR[1]"), StatementKind::Redefine(Frame::Tool, b"2", b"1"));
        assert_eq!(is("UFRAME[3]=UFRAME[2]"), StatementKind::Redefine(Frame::User, b"3", b""));
        assert_eq!(is("PR[R[1:n],3:a,b]=(-2.5)"), StatementKind::Element(b"R[1:n]", b"3", b"(-2.5)"));
        assert_eq!(is("PR[9:a,1]=LPOS"), StatementKind::PositionRegister(b"9", Whole::Position));
        assert_eq!(is("PR[9]=PR[9:a]-PR[9]"), StatementKind::PositionRegister(b"9", Whole::Zero));
        assert_eq!(is("PR[9]=P[1:a]"), StatementKind::PositionRegister(b"9", Whole::Taught(1)));
        assert_eq!(is("PR[9]=P[1]+PR[1:a]"), StatementKind::PositionRegister(b"9", Whole::Taught(1)));
        for anything in ["PR[9]=PR[8]-PR[9]", "PR[9]=PR[9]", "PR[9]=JPOS", "PR[9]=P[R[1]]", "PR[9]=P[1]+P[2]"] {
            assert_eq!(is(anything), StatementKind::PositionRegister(b"9", Whole::Unknown), "{anything}");
        }
        assert_eq!(is("PR[GP2:9,1]=5"), StatementKind::Plain);
        assert_eq!(is("IF (DI[1]=ON) THEN"), StatementKind::If(b"(DI[1]=ON) "));
        assert_eq!(is("IF R[1]=2,JMP LBL[3]"), StatementKind::When(b"R[1]=2,JMP LBL[3]"));
        assert_eq!(guarded(b",JMP LBL[3:end]"), StatementKind::Jump(b"3"));
        assert_eq!(is("FOR R[1:i]=1 TO R[2]"), StatementKind::For(b"1", b"1", b"R[2]", false));
        assert_eq!(is("SELECT R[1]=1,CALL A"), StatementKind::SelectCase(b"R[1]", b"1,CALL A"));
        assert_eq!(case(b"(-1),CALL SUB(1,2)"), (&b"(-1)"[..], StatementKind::Call(b"SUB")));
        assert_eq!(is("=2,CALL B"), StatementKind::Case(b"2,CALL B"));
        assert_eq!(is("ELSE,JMP LBL[1]"), StatementKind::ElseCase(b"JMP LBL[1]"));
        assert_eq!(is("WAIT DI[1]=ON TIMEOUT,LBL[4]"), StatementKind::Wait(b"DI[1]=ON", Some(b"4")));
        assert_eq!(is("IF DI[1]=ON,CALL LATHEN"), StatementKind::When(b"DI[1]=ON,CALL LATHEN"));
        assert_eq!(is("RUN SUB1"), StatementKind::Concurrent(b"SUB1"));
        assert_eq!(is("ERROR_PROG=SUB1"), StatementKind::Concurrent(b"SUB1"));
        assert_eq!(is("RESUME_PROG[1]=SUB1"), StatementKind::Concurrent(b"SUB1"));
        assert_eq!(is("WHEN DI[1]=ON,CALL SUB1"), StatementKind::Concurrent(b"SUB1"));
        assert_eq!(is("CALL SR[1]"), StatementKind::Call(b""));
        assert_eq!(is("CALL A =2,CALL B"), StatementKind::Unknown);
        for (text, name) in [
            ("IF DI[1]=ON,CALL SUB2(1,2)", &b"SUB2"[..]),
            ("IF SR[1]='a,b',CALL SUB2", b"SUB2"),
            ("SELECT R[1]=1,CALL SUB2(1,'b c')", b"SUB2"),
            ("ELSE,CALL SUB2(1,2)", b"SUB2"),
        ] {
            assert_eq!(runs(&is(text)), [name], "{text}");
        }
        assert_eq!(is("GO TO HOME POS"), StatementKind::Macro);
        assert_eq!(is("GO[1]=R[1]"), StatementKind::Plain);
        assert_eq!(is("OPEN GRIPPER"), StatementKind::Macro);
        assert_eq!(is("SPRUNG MARKE[1]"), StatementKind::Unknown);
        assert_eq!(is("$MNUFRAMENUM[1]=2"), StatementKind::Macro);
        assert_eq!(is("$GROUP[1].$UFRAME=PR[1]"), StatementKind::RedefineAny);
        assert_eq!(is("$FRM_CHKTYP=(-2)"), StatementKind::Displace(Reason::FrameCheckUnknown));
        assert_eq!(is("$MCR.$GENOVERRIDE=50"), StatementKind::Override(b""));
        assert_eq!(is("$MCR_GRP[1].$PRGOVERRIDE=50"), StatementKind::Override(b""));
        assert_eq!(is("OVERRIDE=R[3:ov]%"), StatementKind::Override(b"R[3:ov]"));
        assert_eq!(is("SOFTFLOAT[1]"), StatementKind::Displace(Reason::Softfloat));
        assert!(matches!(is("Independent GP GP1 L P[1] 5mm/sec FINE GP2 J P[1] 5% FINE"), StatementKind::Motion(_)));
    }

    #[test]
    fn positions_that_a_statement_names_are_found() {
        let named = |text: &'static str| {
            let line = Line { text: text.as_bytes().into(), span: crate::Span::default(), line: 1 };
            let kind = of(text.as_bytes(), true);
            let named = positions_named(&line, &kind);
            named.into_iter().map(|named| (named.index.to_vec(), named.is_assigned)).collect::<Vec<_>>()
        };
        let index = |text: &str, is_assigned| vec![(text.as_bytes().to_vec(), is_assigned)];
        assert_eq!(named("PR[1]=P[2:a]"), []);
        assert_eq!(named("PR[R[1]]=P[2:a]"), index("2", false));
        assert_eq!(named("PR[1]=P[2:a]+PR[3]"), []);
        assert_eq!(named("PR[1]=P[2:a]+P[3]"), [index("2", false), index("3", false)].concat());
        assert_eq!(named("IF DI[1]=ON,PR[1]=P[2]"), index("2", false));
        assert_eq!(named("P[2:a] = PR[1]"), index("2", true));
        assert_eq!(named("P[R[1],3]=5"), index("R[1]", true));
        assert_eq!(named("L P[1] 5mm/sec FINE"), []);
        assert_eq!(named("L P[1] 5mm/sec FINE TB .1sec,CALL X(P[4])"), index("4", false));
        assert_eq!(named("!P[1]"), []);
        assert_eq!(named("UP[1]=0"), []);
    }

    #[test]
    fn position_registers_on_which_something_depends_are_found() {
        for (text, used) in [
            ("PR[1]=P[2]", &[][..]),
            ("PR[1,3]=PR[1,3]+50", &[]),
            ("PR[1,3]=PR[1,3:z]-R[5]*2", &[]),
            ("PR[1,3]=(PR[1,3]+50)", &[]),
            ("PR[1,3]=50+PR[1,3]", &[]),
            ("PR[1,3]=(R[1]+(PR[1,3]-R[5]))", &[]),
            ("PR[1,3]=50-PR[1,3]", &["1"]),
            ("PR[1,3]=PR[2,3]+PR[1,3]", &["2", "1"]),
            ("PR[1,3]=PR[1,3]=50", &["1"]),
            ("PR[1]=P[2]+PR[2]", &["2"]),
            ("PR[1,3]=50", &[]),
            ("L PR[1] 5mm/sec FINE", &[]),
            ("!PR[1]", &[]),
            ("PR[1,3]=PR[1,2]+50", &["1"]),
            ("PR[1,3]=PR[1,3]*2", &["1"]),
            ("PR[1,3]=PR[1,3]+PR[2,3]", &["2"]),
            ("PR[R[1],3]=PR[R[1],3]+1", &["R[1]"]),
            ("PR[1]=PR[GP1:2]", &["2"]),
            ("PR[1]=PR[GP2:3,1]", &["3"]),
            ("L PR[1] 5mm/sec FINE Offset,PR[2:b]", &["2"]),
            ("L P[1] 5mm/sec FINE Offset,PR[2]", &["2"]),
            ("C P[1] PR[3] 5mm/sec FINE", &["3"]),
            ("A PR[3] 5mm/sec FINE", &["3"]),
            ("R[1]=PR[3,1]", &["3"]),
            ("UFRAME[1]=PR[R[2]]", &["R[2]"]),
            ("IF DI[1]=ON,PR[1]=P[2]", &["1"]),
            ("CALL SUB(PR[4])", &["4"]),
            ("P[1]=PR[4", &["R[0]"]),
        ] {
            let line = Line { text: text.as_bytes().into(), span: crate::Span::default(), line: 1 };
            let used: Vec<&[u8]> = used.iter().map(|index| index.as_bytes()).collect();
            assert_eq!(registers_used(&line, &of(text.as_bytes(), true)), used, "{text}");
        }
    }
}
