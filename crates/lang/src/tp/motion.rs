//! Motion instructions: `L P[3:corner] 500mm/sec CNT50 ACC80 Offset,PR[1]`.

use super::lex::{Parsed, blanks, brackets, index, number_token, of_first_group, spaced, value_of, word};
use crate::ir::Path;
use crate::reason::Reason;
use nom::Parser;
use nom::branch::alt;
use nom::bytes::complete::{tag, tag_no_case, take_while};
use nom::character::complete::one_of;
use nom::combinator::{map, opt, recognize};
use std::ops::Range;

/// A motion as it is written.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{StatementKind, kind, lines};
///
/// let text = b"1:L P[1] 10mm/sec FINE ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// let StatementKind::Motion(motion) = kind(&lines[0]) else { panic!("a motion") };
/// assert_eq!(motion.speed, Some(deflex_lang::tp::Speed::Number(10.0)));
/// assert!(motion.shifted().is_none()); // no `Offset,PR[1]`
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Motion<'a> {
    /// The kind of its path.
    pub path: Path,
    /// Circle point of `C`.
    pub via: Option<Point<'a>>,
    /// Its end.
    pub end: Point<'a>,
    /// Speed of the TCP, if it is written in such a unit.
    pub speed: Option<Speed<'a>>,
    /// Why the motion does not end at its point, or not with this robot alone.
    pub moved: Option<Reason>,
    /// The index of the position register by which the point is moved in its user frame, if nothing else moves it (`Offset,PR[1]`).
    pub(super) offset: Option<&'a [u8]>,
    /// Whether its path is a line or an arc in the frame that another motion group carries (`COORD`).
    pub coordinated: bool,
    /// Whether other statements run in parallel with it.
    pub runs_others: bool,
    /// Programs that it calls (`TB .10sec,CALL OPEN`), as written.
    pub calls: Vec<&'a [u8]>,
    /// The label at which the program continues if a condition was not met (`Skip,LBL[n]`).
    pub skip: Option<&'a [u8]>,
    /// Whether it is an `A` motion, on a circle with its neighbours.
    pub is_arc: bool,
    /// Whether a block of statements follows that run in parallel with it.
    pub point_logic: bool,
}

impl Motion<'_> {
    /// Records that the motion does not end at its point. Of several reasons, a position register that shifts the point is the last one, because such a
    /// motion still moves with its point.
    fn moves(&mut self, why: Reason) {
        self.offset = None;
        if self.moved.is_none_or(|known| is_shift(known) && !is_shift(why)) {
            self.moved = Some(why);
        }
    }

    /// Why the motion ends at a distance and turn from a position that only the controller knows; `None` for other motions.
    #[must_use]
    pub fn shifted(&self) -> Option<Reason> {
        let is_one_line = self.via.is_none() && !self.is_arc && !self.coordinated;
        let register = matches!(self.end, Point::Register(_)).then_some(Reason::PositionRegister);
        self.moved.filter(|why| is_shift(*why)).or(register.filter(|_| self.moved.is_none())).filter(|_| is_one_line)
    }

    /// The index of the position register to which the motion goes, if it is [`shifted`](Self::shifted).
    pub(super) fn moves_to_register(&self) -> Option<&[u8]> {
        match self.end {
            Point::Register(index) if self.shifted().is_some() => Some(index),
            _ => None,
        }
    }

    /// Whether it is relative to where the arm stands.
    #[must_use]
    pub(crate) fn counts_on(&self) -> bool {
        self.moved == Some(Reason::Increment)
    }
}

/// Whether a motion ends at its point, shifted by a position register.
fn is_shift(moved: Reason) -> bool {
    matches!(moved, Reason::MovedByRegister | Reason::ToolMovedByRegister)
}

/// The speed of the TCP in a motion.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{Speed, StatementKind, kind, lines};
///
/// let text = b"1:L P[1] R[4]cm/min FINE ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// let StatementKind::Motion(motion) = kind(&lines[0]) else { panic!("a motion") };
/// assert_eq!(motion.speed, Some(Speed::Register { text: b"R[4]", unit_mm_s: 10.0 / 60.0 }));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Speed<'a> {
    /// mm/s
    Number(f64),
    /// The number in a register, times the unit.
    Register {
        /// The register as written.
        text: &'a [u8],
        /// The unit, mm/s.
        unit_mm_s: f64,
    },
}

/// The end of a motion.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{Point, StatementKind, kind, lines};
///
/// let text = b"1:L P[3:corner] 10mm/sec FINE ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// let StatementKind::Motion(motion) = kind(&lines[0]) else { panic!("a motion") };
/// assert!(matches!(motion.end, Point::Position(_)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Point<'a> {
    /// `P[…]`: the index as written.
    Position(&'a [u8]),
    /// `PR[…]`: the index as written.
    Register(&'a [u8]),
    /// A place that is known only at run time, with the reason.
    RunTime(Reason),
}

/// Reads a motion; `None` for other statements.
pub(super) fn motion(text: &[u8]) -> Option<Motion<'_>> {
    let (rest, letter) = one_of::<_, _, nom::error::Error<&[u8]>>("JLCASjlcas").parse(text).ok()?;
    let (rest, first) = point(rest).ok()?;
    let (rest, second) = match letter.to_ascii_uppercase() {
        'C' => point(rest).ok().map(|(rest, point)| (rest, Some(point)))?,
        _ => (rest, None),
    };
    let (rest, speed) = speed(rest).unwrap_or((rest, None));
    let (via, end) = second.map_or((None, first), |second| (Some(first), second));
    let path = match letter.to_ascii_uppercase() {
        'J' => Path::Joint,
        'C' => Path::Circular,
        _ => Path::Linear,
    };
    let moved = match letter.to_ascii_uppercase() {
        'S' => Some(Reason::SplineOption),
        _ => None,
    };
    let is_arc = letter.eq_ignore_ascii_case(&'A');
    let mut motion = Motion {
        path,
        via,
        end,
        speed,
        moved,
        offset: None,
        coordinated: false,
        runs_others: false,
        calls: Vec::new(),
        skip: None,
        is_arc,
        point_logic: false,
    };
    modifiers(rest, &mut motion);
    Some(motion)
}

/// `P[3:corner]`, `PR[1]`, `PAL_1[A_2]`
fn point(input: &[u8]) -> Parsed<'_, Point<'_>> {
    let palletizing = recognize((tag_no_case("PAL_"), take_while(|b: u8| b.is_ascii_digit())));
    let name = alt((tag_no_case("PR"), palletizing, tag_no_case("P")));
    let (rest, (_, name, _, within)) = (blanks, name, blanks, brackets).parse(input)?;
    let point = match name.len() {
        1 => Point::Position(index(within)),
        2 => Point::Register(index(within)),
        _ => Point::RunTime(Reason::Palletizing),
    };
    Ok((rest, point))
}

/// Millimetres in an inch, and seconds in a minute.
const INCH: f64 = 25.4;
const MINUTE: f64 = 60.0;

/// `500mm/sec`, `R[1]cm/min`, `100%`, `max_speed`: the speed, if it is a path speed with a number.
fn speed(input: &[u8]) -> Parsed<'_, Option<Speed<'_>>> {
    let named = alt((tag_no_case("MAX_SPEED"), tag_no_case("WELD_SPEED")));
    alt((map(spaced(named), |_| None), counted_speed)).parse(input)
}

fn counted_speed(input: &[u8]) -> Parsed<'_, Option<Speed<'_>>> {
    let number = map(number_token, |token| value_of(token).map(Speed::Number));
    let register = map(recognize((word, brackets)), |text| Some(Speed::Register { text, unit_mm_s: 1.0 }));
    let (rest, speed) = spaced(alt((number, register))).parse(input)?;
    let mut unit = alt((
        map(alt((tag_no_case("mm/sec"), tag_no_case("mm/sek"))), |_| Some(1.0)),
        map(tag_no_case("cm/min"), |_| Some(10.0 / MINUTE)),
        map(tag_no_case("inch/min"), |_| Some(INCH / MINUTE)),
        map(
            alt((tag("%"), tag_no_case("deg/sec"), tag_no_case("msec"), tag_no_case("sec"), tag_no_case("sek"))),
            |_| None,
        ),
        map(recognize((word, opt((tag("/"), word)))), |_| None),
    ));
    let (rest, unit) = unit.parse(rest)?;
    let in_unit = |(speed, unit)| match speed {
        Speed::Number(value) => Some(Speed::Number(value * unit)).filter(|_| value > 0.0),
        Speed::Register { text, .. } => Some(Speed::Register { text, unit_mm_s: unit }),
    };
    Ok((rest, speed.zip(unit).and_then(in_unit)))
}

/// The meaning of a motion option.
enum Meaning {
    /// No effect on where the motion ends.
    Plain,
    /// The motion ends elsewhere.
    Moved(Reason),
    /// The motion may end earlier, at a condition.
    Skip,
    /// Something runs shortly before or after the point; the rest names it.
    Timed,
    /// The path is one in the frame that another motion group carries.
    Coordinated,
}

/// The meaning of a word among motion options, upper case. Source: FANUC, R-30iB Operator's Manual (Basic Operation), motion
/// instructions.
fn meaning(word: &[u8]) -> Option<Meaning> {
    Some(match word {
        b"FINE" | b"FEIN" | b"CNT" | b"CR" | b"CD" | b"ACC" | b"WJNT" | b"PTH" | b"MROT" | b"BREAK" | b"CTV"
        | b"PSPD" | b"RT_LD" | b"AP_LD" | b"MAX_SPEED" | b"WELD_SPEED" | b"ARC" | b"START" | b"END" | b"DO" | b"RO"
        | b"GO" | b"AO" | b"ON" | b"OFF" | b"HOP" => Meaning::Plain,
        b"SPOT" | b"PRESS_MOTN" | b"TB" | b"TA" | b"DB" | b"DA" | b"ZEIT" | b"CALL" | b"AUFRUF" | b"POINT_LOGIC" => {
            Meaning::Timed
        }
        b"SKIP" | b"QUICK_SKIP" | b"SKIPJUMP" => Meaning::Skip,
        b"COORD" => Meaning::Coordinated,
        b"EV" | b"IND" => Meaning::Moved(Reason::ExternalAxisSpeed),
        b"OFFSET" => Meaning::Moved(Reason::MovedByRegister),
        b"TOOL_OFFSET" => Meaning::Moved(Reason::ToolMovedByRegister),
        b"VOFFSET" | b"VR" => Meaning::Moved(Reason::MovedByVision),
        b"INC" => Meaning::Moved(Reason::Increment),
        b"RTCP" => Meaning::Moved(Reason::StationaryTool),
        b"SEARCH" => Meaning::Moved(Reason::Search),
        b"WEAVE" => Meaning::Moved(Reason::Weaving),
        b"TRACK" => Meaning::Moved(Reason::Tracking),
        _ => return None,
    })
}

/// Reads the options after the speed.
fn modifiers<'a>(text: &'a [u8], motion: &mut Motion<'a>) {
    let upper = text.to_ascii_uppercase();
    let has = |wanted: &[u8]| memchr::memmem::find(&upper, wanted).is_some();
    motion.point_logic = has(b"P-SPS") || has(b"POINT_LOGIC");
    // Wherever it stands: after a word that is not known, too.
    let others: [&[u8]; 4] = [b"CALL", b"AUFRUF", b"SPOT", b"PRESS_MOTN"];
    motion.runs_others = motion.point_logic || others.iter().any(|wanted| has(wanted));
    for word in &others[..2] {
        let after = memchr::memmem::find_iter(&upper, word).map(|at| &text[at + word.len()..]);
        motion.calls.extend(after.map(|rest| program(rest.trim_ascii_start()).0));
    }
    // A call that runs in parallel is no option of the motion. The words after it are options, as in `TB .10sec,P-SPS Offset,PR[1]`.
    let (mut rest, mut is_timed) = (text, false);
    loop {
        rest = rest.trim_ascii_start();
        if rest.is_empty() {
            return;
        }
        if let Ok((after, name)) = word(rest) {
            let (after, within) = brackets(after).map_or((after, None), |(after, within)| (after, Some(within)));
            let letters = name.iter().rposition(|b| !b.is_ascii_digit()).map_or(0, |last| last + 1);
            let upper = name[..letters].to_ascii_uppercase();
            match meaning(&upper) {
                Some(Meaning::Plain) => {}
                Some(Meaning::Moved(why)) => {
                    let is_first = motion.moved.is_none();
                    motion.moves(why);
                    let register = (spaced(tag(",")), tag_no_case("PR"), brackets).parse(after) as Parsed<'_, _>;
                    let register = register.ok().and_then(|(_, (_, _, within))| of_first_group(within)).map(index);
                    motion.offset = register.filter(|_| is_first);
                }
                Some(Meaning::Skip) => {
                    motion.moves(Reason::Skip);
                    motion.skip = label(after);
                    return;
                }
                Some(Meaning::Timed) => {
                    is_timed = true;
                    let called = matches!(&upper[..], b"CALL" | b"AUFRUF");
                    rest = if called { program(after.trim_ascii_start()).1 } else { after };
                    continue;
                }
                Some(Meaning::Coordinated) => motion.coordinated = true,
                // A register counts for the word before it: `CNT R[3]`, `Offset,PR[1]`.
                None if within.is_some() && matches!(&upper[..], b"R" | b"AR" | b"PR") => {}
                None if is_timed => {}
                None => motion.moves(Reason::MotionOption),
            }
            rest = after;
            continue;
        }
        let mark = |b: &u8| matches!(b, b',' | b'=' | b'%' | b'.' | b'(' | b')') || b.is_ascii_digit();
        if !is_timed && !mark(&rest[0]) {
            motion.moves(Reason::MotionOption);
        }
        rest = &rest[1..];
    }
}

/// The parts of a motion that a motion along a part of its path takes over.
///
/// # Examples
/// ```
/// let lasting = deflex_lang::tp::lasting(b"1:L P[1] 10mm/sec FINE ACC50").unwrap();
/// assert_eq!((lasting.letter, lasting.speed), (b'L', &b"10mm/sec"[..]));
/// ```
#[derive(Debug, PartialEq)]
pub struct Lasting<'a> {
    /// `L`, `C`, `A`, as written.
    pub letter: u8,
    /// Offset of the letter.
    pub letter_at: usize,
    /// Ranges of its points: circle point and end, or the end.
    pub points: Vec<Range<usize>>,
    /// The speed as written; empty if there is none.
    pub speed: &'a [u8],
    /// The options that apply along the whole path, as written.
    pub options: Vec<&'a [u8]>,
}

/// Options for the end of a motion, and options that apply along its whole path.
const ENDS: [&[u8]; 5] = [b"FINE", b"FEIN", b"CNT", b"CR", b"CD"];
const LASTS: [&[u8]; 4] = [b"ACC", b"WJNT", b"PTH", b"COORD"];

/// The parts of a whole statement, with its number, that a motion to an inserted point would take over.
///
/// # Errors
/// Why no point can be inserted.
///
/// # Examples
/// ```
/// let text = b"1:L P[1] 10mm/sec FINE";
/// let lasting = deflex_lang::tp::lasting(text).unwrap();
/// assert_eq!(&text[lasting.points[0].clone()], b"P[1]");
/// assert_eq!(deflex_lang::tp::lasting(b"1:L P[1] max_speed FINE").unwrap().speed, b"max_speed");
/// ```
pub fn lasting(text: &[u8]) -> Result<Lasting<'_>, Reason> {
    let place = |rest: &[u8]| text.len() - rest.len();
    let body = text[super::lines::numbers(text).unwrap_or(0)..].trim_ascii_start();
    let body = body.strip_prefix(b":").unwrap_or(body).trim_ascii_start();
    let letter = *body.first().ok_or(Reason::Motion)?;
    let (mut rest, mut points) = (&body[1..], Vec::new());
    for _ in 0..1 + usize::from(letter.eq_ignore_ascii_case(&b'C')) {
        // The colon of a continuation line.
        rest = rest.trim_ascii_start();
        rest = rest.strip_prefix(b":").unwrap_or(rest).trim_ascii_start();
        let (after, _) = point(rest).map_err(|_| Reason::Motion)?;
        points.push(place(rest)..place(after));
        rest = after;
    }
    let (after, _) = speed(rest).unwrap_or((rest, None));
    let speed = rest[..rest.len() - after.len()].trim_ascii();
    // Millimetres, degrees, inches by a time have a stroke.
    let timed = speed.to_ascii_lowercase();
    if (timed.ends_with(b"sec") || timed.ends_with(b"sek")) && !timed.contains(&b'/') {
        return Err(Reason::Timed);
    }
    let mut lasting = Lasting { letter, letter_at: place(body), points, speed, options: Vec::new() };
    let mut rest = after;
    loop {
        rest = rest.trim_ascii_start();
        if rest.is_empty() || rest == b";" {
            return Ok(lasting);
        }
        let (after, name) = word(rest).map_err(|_| Reason::OptionOnce)?;
        let letters = name.iter().rposition(|b| !b.is_ascii_digit()).map_or(0, |last| last + 1);
        let upper = name[..letters].to_ascii_uppercase();
        // `ACC R[3]`
        let register = (blanks, alt((tag_no_case("AR"), tag_no_case("R"))), brackets).parse(after);
        let after = register.map_or(after, |(after, _)| after);
        if LASTS.contains(&&upper[..]) {
            lasting.options.push(&rest[..rest.len() - after.len()]);
        } else if !ENDS.contains(&&upper[..]) {
            return Err(Reason::OptionOnce);
        }
        rest = after;
    }
}

/// The name of a called program, and the text after it; empty if a register has the name (`CALL SR[1]`).
pub(super) fn program(text: &[u8]) -> (&[u8], &[u8]) {
    let ends = |b: &u8| matches!(b, b'(' | b'[' | b',' | b';') || b.is_ascii_whitespace();
    let end = text.iter().position(ends).unwrap_or(text.len());
    if text[end..].starts_with(b"[") { (b"", &text[end..]) } else { text.split_at(end) }
}

/// `,LBL[3]`: the index.
fn label(text: &[u8]) -> Option<&[u8]> {
    let (rest, _) = (spaced(tag(",")), tag_no_case("LBL")).parse(text).ok().map(|(rest, _): (&[u8], _)| (rest, ()))?;
    brackets(rest).ok().map(|(_, within)| index(within))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Motion<'_> {
        motion(text.as_bytes()).unwrap_or_else(|| panic!("{text}"))
    }

    #[test]
    fn speeds_are_those_of_the_tcp() {
        for (text, feed) in [
            ("L P[1] 500mm/sec FINE", Some(500.0)),
            ("L P[1] 90cm/min CNT50", Some(15.0)),
            ("L P[1] 60.0inch/min CNT50", Some(25.4)),
            ("L P[1] 1500mm/sek CNT0 ACC100", Some(1500.0)),
            ("L P[1] 2.5sec FINE", None),
            ("L P[1] 300msec FINE", None),
            ("L P[1] 50deg/sec FINE", None),
            ("L P[1] max_speed FINE", None),
            ("J P[1] 100% CNT100", None),
        ] {
            let read = read(text);
            assert_eq!((read.speed, read.moved), (feed.map(Speed::Number), None), "{text}");
        }
        let register = Speed::Register { text: b"R[1:v]", unit_mm_s: 10.0 / 60.0 };
        assert_eq!(read("L P[1] R[1:v]cm/min FINE").speed, Some(register));
    }

    #[test]
    fn what_moves_the_point_is_said() {
        for (text, why) in [
            ("L P[1] 500mm/sec FINE Offset,PR[1:off]", Reason::MovedByRegister),
            ("L P[1] 500mm/sec FINE Offset", Reason::MovedByRegister),
            ("L P[1] 500mm/sec CNT R[2] Tool_Offset,PR[1]", Reason::ToolMovedByRegister),
            ("L P[1] 500mm/sec FINE INC", Reason::Increment),
            ("L P[1] 500mm/sec FINE Frobnicate", Reason::MotionOption),
            ("S P[1] 500mm/sec FINE", Reason::SplineOption),
            ("A P[1] 500mm/sec FINE INC", Reason::Increment),
        ] {
            assert_eq!(read(text).moved, Some(why), "{text}");
        }
        let skip = read("L P[2] 50mm/sec FINE Skip,LBL[2],PR[99]=LPOS");
        assert_eq!((skip.skip, skip.moved.is_some()), (Some(&b"2"[..]), true));
        assert!(read("L P[1] 5mm/sec FINE TIME AFTER 0.1sec CALL OTHER").runs_others);
        assert_eq!(read("L P[1] 5mm/sec FINE TB .10sec,CALL OPEN(1,2)").calls, [b"OPEN"]);
        assert_eq!(read("L P[1] 5mm/sec FINE DB 5.0mm,CALL SR[1]").calls, [b""]);
        let coordinated = read("L P[1] 5mm/sec CNT100 COORD[2] PTH");
        assert!(coordinated.coordinated && coordinated.moved.is_none());
        let timed = read("J P[1] 10% CNT0 ACC100 ZEIT VOR   0.00sek,P-SPS");
        assert!(timed.point_logic && timed.runs_others && timed.moved.is_none());
        let moved = read("J P[1] 10% CNT0 ACC100 TB    .10sec,P-SPS Tool_Offset,PR[2] Offset,PR[1]");
        assert_eq!(moved.moved, Some(Reason::ToolMovedByRegister));
        assert!(read("L P[1] 5mm/sec FINE TB .10sec,CALL OFFSET").moved.is_none());
        assert!(!read("L P[1] 5mm/sec CNT100 ACC80 TB .10sec,DO[1]=ON").runs_others);
    }

    #[test]
    fn points_are_distinguished() {
        let circle = read("C P[1:a] P[R[2]] 100mm/sec FINE");
        assert_eq!((circle.via, circle.end), (Some(Point::Position(b"1")), Point::Position(b"R[2]")));
        assert!(matches!(read("J PR[1] 100% FINE").end, Point::Register(b"1")));
        assert!(matches!(read("J PAL_1[A_2] 30% FINE").end, Point::RunTime(_)));
        for other in ["LBL[1]", "JMP LBL[1]", "CALL P", "Lift P", "C P[1] 100mm/sec FINE"] {
            assert_eq!(motion(other.as_bytes()), None, "{other}");
        }
    }
}
