//! FANUC TP programs as text (`.ls`). Their statements are read and run by `deflex-lang`.
//!
//! | file | from | to |
//! |---|---|---|
//! | `position` | `/POS` | positions, and where their numbers stand |
//! | `targets`, `arcs` | motions that run, and positions | targets |
//! | `rewrite`, `insert`, `renumber` | wanted poses | edits on numbers of `/POS`, points between |

mod arcs;
mod builder;
mod dialect;
mod insert;
mod position;
mod renumber;
mod rewrite;
mod targets;
mod written;

use super::front_end::{FrontEnd, Wanted, stops_at};
use super::{Language, Passing, Program, Reason, Rewritten, lowered};
use deflex_lang::run::run;
use deflex_lang::tp::{Calls, Code, StatementKind, lines, lower, runs};
use deflex_text::{Diagnostic, Edit, Severity, Source, Span};
pub(super) use insert::MOST_POINTS;
use position::{Body, Position};
use std::collections::BTreeSet;

/// Places of the numbers of positions in the text.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// In the order of the text.
    positions: Vec<Position>,
    /// One for each target.
    sites: Vec<builder::EditablePosition>,
    /// Targets that end at a distance from their position in the axes of the tool (`Tool_Offset`).
    in_tool: BTreeSet<usize>,
    /// The targets of each arc.
    points: Vec<builder::Points>,
    /// Circle points that are not in the text.
    between: Vec<builder::Between>,
    motions: usize,
}

impl FrontEnd for Layout {
    fn rewrite(&self, program: &Program, wanted: Wanted<'_>) -> Rewritten {
        rewrite::rewrite(program, self, wanted)
    }

    fn passing(&self, program: &Program, target: usize) -> Passing {
        let target = &program.targets[target];
        let text = &program.sources[usize::from(target.source)].bytes[target.span.range()];
        let mut words = text.split(|byte| !byte.is_ascii_alphanumeric());
        // `CNT` states no radius: how far the corner is rounded depends on the speed.
        let stops = |word: &[u8]| word.eq_ignore_ascii_case(b"FINE") || word.eq_ignore_ascii_case(b"FEIN");
        if words.any(stops) { Passing::Stop } else { Passing::Unstated }
    }

    fn passing_edits(&self, program: &Program, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
        // Only `CNT50`, as one word: the number of `CNT R[1]` is in a register.
        let passes = |text: &[u8]| {
            let is_word = |byte: u8| byte.is_ascii_alphanumeric();
            let (at, _) = text.windows(3).enumerate().find(|(at, word)| {
                word.eq_ignore_ascii_case(b"CNT")
                    && (*at == 0 || !is_word(text[at - 1]))
                    && text.get(at + 3).is_some_and(u8::is_ascii_digit)
            })?;
            let length = text[at..].iter().take_while(|byte| is_word(**byte)).count();
            Some(at..at + length)
        };
        stops_at(program, wanted, passes, b"FINE")
    }

    fn insertions_refused(&self, program: &Program, before: &[usize]) -> Vec<Option<Reason>> {
        before.iter().map(|i| insert::refusal(program, self, *i)).collect()
    }

    fn removal(&self, program: &Program, _: usize, spans: &[Span]) -> Vec<Edit> {
        insert::removal(program, self, spans)
    }

    fn motion_targets(&self, _: &Program) -> usize {
        self.motions
    }
}

/// Reads one program. From the programs in `context` follows what a call of them may change.
///
/// # Errors
/// The program as a whole is refused (not TP, binary, truncated): every reason that was found.
///
/// # Examples
/// ```
/// use deflex_program::tp;
/// use deflex_text::Source;
///
/// let program = tp::read(vec![Source::new("contour.ls", std::fs::read("../../samples/fanuc/contour.ls")?)], vec![])?;
/// assert!(!program.targets.is_empty());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn read(mut sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    if sources.len() != 1 {
        let message = format!("{} TP files are separate programs", sources.len());
        return Err(Diagnostic::error("ls.several", "", message).help("give them one by one").into());
    }
    sources.extend(context);
    let source = &sources[0];
    if let Some(refusal) = refused(source) {
        return Err(refusal.into());
    }
    let sections = lines::sections(&source.bytes);
    let (Some(statements), Some(places)) = (sections.statements.clone(), sections.positions.clone()) else {
        return Err(without_section(source, sections.statements.is_some()).into());
    };
    let lines = lines::statements(&source.bytes, statements);
    let (positions, odd) = positions(source, places);
    if let Some(cut) = odd.last().filter(|_| !sections.ends) {
        let message = "the file ends inside a position: expected `};` and /END";
        let error = Diagnostic::error("ls.truncated", &source.name, message).at(source, *cut);
        return Err(error.help("the file is cut off; get it again from its source").into());
    }
    let (calls, code) = (Calls::new(sources.iter().map(|source| &source.bytes[..])), Code::new(&lines));
    let places: Vec<_> = positions.iter().map(|position| (position.number, position.span)).collect();
    let (lowered, tp) = lower(&code, &places, &calls, follows(&source.bytes[sections.head.clone()]));
    let Ok(outcome) = run(&lowered, &tp) else { return Err(lowered::endless(source).into()) };
    let built = builder::Builder::new(source, &code, &positions).build(&outcome);
    let mut diagnostics: Vec<Diagnostic> = not_read(source, &odd).into_iter().collect();
    diagnostics.extend(not_given(source, &code, &calls));
    diagnostics.extend(built.anywhere.map(|at| may_go_anywhere(source, code.lines[at].span)));
    let mut kept = built.kept;
    odd.iter().for_each(|span| kept.keep(0, *span, Reason::PositionUnread));
    let literal_targets = positions.iter().filter(|position| matches!(position.body, Body::Pose(_))).count();
    let dialect = dialect::of(source, sections.head);
    let layout = Layout {
        positions,
        sites: built.sites,
        in_tool: built.in_tool,
        points: built.points,
        between: built.between,
        motions: built.motions,
    };
    Ok(Program {
        tools: built.tools,
        wobjs: built.wobjs,
        targets: built.targets,
        unknown: built.unknown,
        kept: kept.in_order(),
        literal_targets,
        arcs: built.arcs,
        diagnostics,
        ..Program::empty(Language::Ls, dialect, (sources.into(), 1), super::Layout::Ls(layout))
    })
}

/// Why all motions of the program are moved at run time: its head has a line tracking schedule other than 0.
fn follows(head: &[u8]) -> Option<Reason> {
    const SCHEDULE: &[u8] = b"LINE_TRACK_SCHEDULE_NUMBER";
    let at = memchr::memmem::find(&head.to_ascii_uppercase(), SCHEDULE)? + SCHEDULE.len();
    let number = head[at..].iter().skip_while(|b| matches!(b, b' ' | b'\t' | b':')).take_while(|b| b.is_ascii_digit());
    number.copied().any(|digit| digit != b'0').then_some(Reason::LineTracking)
}

/// Positions, and the heads of those that cannot be read.
fn positions(source: &Source, section: std::ops::Range<usize>) -> (Vec<Position>, Vec<Span>) {
    let base = &source.bytes[..section.end];
    let (mut found, mut odd, mut rest) = (Vec::new(), Vec::new(), &base[section.start..]);
    while let Some((after, position)) = position::next(base, rest) {
        match position {
            Ok(position) => found.push(position),
            Err(span) => odd.push(span),
        }
        rest = after;
    }
    (found, odd)
}

/// Why a file cannot be read at all.
fn refused(source: &Source) -> Option<Diagnostic> {
    /// Number of bytes at the beginning in which at most one of `PER_CONTROL` bytes may be a control character.
    const LOOK: usize = 64 * 1024;
    const PER_CONTROL: usize = 100;
    let bytes = &source.bytes;
    let first = Span::new(0, bytes.len().min(1));
    let whole = |code, message: &str| Diagnostic::error(code, &source.name, message).at(source, first);
    if u32::try_from(bytes.len()).is_err() {
        return Some(whole("ls.too-large", "file is larger than 4 GiB").help("no controller holds such a program"));
    }
    if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
        return Some(whole("ls.utf16", "the file is UTF-16 text").help("save it as ASCII or ISO 8859-1"));
    }
    let head = &bytes[..bytes.len().min(LOOK)];
    let control = |b: &&u8| b.is_ascii_control() && !b.is_ascii_whitespace() && **b != 0x1A;
    if head.iter().filter(control).count() * PER_CONTROL > head.len() {
        let message = "the file is not text: expected a TP program in ASCII";
        return Some(whole("ls.binary", message).help("export it as .ls, not as .tp"));
    }
    None
}

fn without_section(source: &Source, has_statements: bool) -> Diagnostic {
    let first = Span::new(0, source.bytes.len().min(1));
    let (message, help) = if has_statements {
        ("no /POS section: expected the positions of a TP program", "export the program again: /POS stands before /END")
    } else {
        ("the file is not a TP program: there is no /MN section in it", "give a .ls with /PROG, /MN, /POS and /END")
    };
    Diagnostic::error("ls.no-section", &source.name, message).at(source, first).help(help)
}

/// The warning about positions that cannot be read, at the first of them.
fn not_read(source: &Source, odd: &[Span]) -> Option<Diagnostic> {
    let message = match odd.len() {
        1 => Reason::PositionUnread.to_string(),
        more => format!("{} ({more} of them)", Reason::PositionUnread),
    };
    let warning = Diagnostic::error("ls.not-read", &source.name, message).at(source, *odd.first()?);
    let help = "expected P[n]{ GP1: UF : u, UT : t, CONFIG : '…', X = … mm, … R = … deg };";
    Some(warning.severity(Severity::Warning).help(help))
}

/// The note about the first motion to a position of which the number is unknown.
fn may_go_anywhere(source: &Source, motion: Span) -> Diagnostic {
    let message = "the register in this motion is known only at run time: the positions to which it may go are kept";
    let note = Diagnostic::error("ls.any-position", &source.name, message).at(source, motion);
    note.severity(Severity::Note).help("set the register in the program after calls of programs that may change it")
}

/// The warning about called programs that are not given, at the first of them.
fn not_given(source: &Source, code: &Code<'_>, calls: &Calls) -> Option<Diagnostic> {
    let mut names: Vec<(String, Span)> = Vec::new();
    for (line, kind) in code.lines.iter().zip(&code.kinds) {
        let plain = matches!(kind, StatementKind::Macro | StatementKind::Unknown).then_some(&line.text[..]);
        for name in runs(kind).into_iter().filter(|name| !name.is_empty()).chain(plain) {
            let text = String::from_utf8_lossy(name).into_owned();
            if !calls.knows(name) && names.iter().all(|(known, _)| *known != text) {
                names.push((text, line.span));
            }
        }
    }
    /// Number of names that are listed; further ones are only counted.
    const SHOWN: usize = 8;
    let (_, first) = names.first()?;
    let mut listed: Vec<String> = names.iter().take(SHOWN).map(|(name, _)| name.clone()).collect();
    if names.len() > SHOWN {
        listed.push(format!("{} more", names.len() - SHOWN));
    }
    let message = format!(
        "these programs are not given, and deflex assumes that they change no frames or tools: {}",
        listed.join(", ")
    );
    let warning = Diagnostic::error("ls.called", &source.name, message).at(source, *first);
    Some(warning.severity(Severity::Warning).help("give the programs that it calls with --context; or name those that change neither frames nor positions in `[controller] harmless` of the cell"))
}
