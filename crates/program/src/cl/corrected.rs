//! Writes corrected points into the CL data that they come from, for the maker's own post-processor.
//!
//! Tip and tool axis are written, for five axes: `GOTO/x,y,z,i,j,k`. A statement that makes points other than the one it prints (arcs,
//! drilling cycles, increments, lists) is replaced by its corrected points, and stays as a comment: a corrected arc is no arc any more, and a
//! post-processor refuses an end that is not on its circle. All other statements stay as they are.

use super::feeds::{Feeds, short};
use super::frame::Frame;
use super::layout::{Layout, Slot};
use super::lex::{Lexer, Record, RecordKind, Token, chunks};
use super::statement::Statement;
use super::vector::{add, norm, scale, sub};
use super::words::{self, Meaning};
use crate::{ActionKind, Goal, Program, Reason};
use deflex_text::number::write_fixed;
use deflex_text::{Content, Diagnostic, Edit, Span, apply};
use std::ops::Range;

/// A corrected point.
///
/// # Examples
/// ```
/// use deflex_program::cl::CorrectedPoint;
///
/// let point = CorrectedPoint { target: 0, position_mm: [0.0, 0.0, 0.1], axis: [0.0, 0.0, 1.0] };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectedPoint {
    /// Index of its target, or of the target that it is inserted before.
    pub target: usize,
    /// Tip in the work object, mm.
    pub position_mm: [f64; 3],
    /// Unit vector from the tip towards the spindle, work object axes.
    pub axis: [f64; 3],
}

/// Decimals of millimetres, as in posted programs; an inch needs two more for the same step.
const MM_DECIMALS: usize = 4;
const INCH_DECIMALS: usize = 6;
/// Decimals of a tool axis: 1e-6 mm at 200 mm.
const AXIS_DECIMALS: usize = 8;
/// Distance beyond which a printed point differs from the tip's, mm.
const OFF_MM: f64 = 1e-6;

/// The file with the corrected points. The points of one target are consecutive, its own is the last. `title` comes before it as comments.
///
/// # Errors
/// Decks of cards; statements that run more than once; a cycle whose feed cannot be stated in the file's unit.
///
/// # Examples
/// ```
/// use deflex_program::{Program, cl};
/// use deflex_text::Diagnostic;
///
/// /// CL data with a corrected first point.
/// fn corrected(program: &Program) -> Result<Vec<u8>, Vec<Diagnostic>> {
///     let point = cl::CorrectedPoint { target: 0, position_mm: [0.0, 0.0, 0.1], axis: [0.0, 0.0, 1.0] };
///     cl::write(program, &[point], &["corrected".to_owned()])
/// }
/// ```
pub fn write(program: &Program, points: &[CorrectedPoint], title: &[String]) -> Result<Vec<u8>, Vec<Diagnostic>> {
    let (crate::Layout::Cl(layout), [source]) = (&program.layout, &program.sources[..]) else {
        let message = "the program is not one file of CL data";
        return Err(Diagnostic::error("post.cl", "", message).help("post it in its own language").into());
    };
    let bytes = &source.bytes[..];
    let refused = |record: Record, message: &str| {
        let error = Diagnostic::error("post.cl", &source.name, message).on_line(
            source,
            record.span,
            u32::try_from(record.line).unwrap_or(u32::MAX),
        );
        error.help(
            "have the CAM system print points (linear output), or post it in the language of your controller (--post)",
        )
    };
    if layout.cards {
        let message = "a deck of cards has no room for corrected axes";
        return Err(Diagnostic::error("post.cl", &source.name, message).help("write CL data without cards").into());
    }
    let mut writer = Writer::new(program, layout, bytes);
    let (mut lexer, mut tokens) = (Lexer::new(bytes, source.lines_before), Vec::new());
    let (mut at, mut own, mut errors) = (0, points.iter().peekable(), Vec::new());
    while let Some(record) = lexer.next(&mut tokens) {
        if record.kind != RecordKind::Statement {
            continue;
        }
        let Some(statement) = Statement::parse(bytes, &tokens) else { continue };
        let first = at;
        // The points of a list may have points of its arc between them.
        let is_own = |span: Span| span == record.span || writer.arc == Some(span);
        at += program.targets[first..].iter().take_while(|target| is_own(target.span)).count();
        let mut here = Vec::new();
        while let Some(point) = own.next_if(|point| point.target < at) {
            here.push(*point);
        }
        let written = writer.statement(record, &statement, first..at, here);
        errors.extend(written.err().map(|reason| refused(record, reason.text())));
    }
    if at != program.targets.len() && errors.is_empty() {
        let message = "statements that are run more than once are not written as points";
        errors.push(
            Diagnostic::error("post.cl", &source.name, message)
                .help("post it in the language of your controller (--post)"),
        );
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut out = Vec::with_capacity(bytes.len() + bytes.len() / 2);
    for line in title {
        out.extend_from_slice(format!("$$ {line}{}", writer.end).as_bytes());
    }
    // The edits are in the order of the bytes.
    apply(bytes, &writer.edits, &mut out).map_err(|error| {
        let message = format!("the corrected points do not fit the file: {error}");
        Vec::from(Diagnostic::error("post.cl", &source.name, message).help("this is a fault of deflex: report it"))
    })?;
    Ok(out)
}

/// The end of the first line.
fn line_end(bytes: &[u8]) -> &'static str {
    let first = bytes.iter().position(|b| *b == b'\n');
    if first.is_some_and(|at| at > 0 && bytes[at - 1] == b'\r') { "\r\n" } else { "\n" }
}

struct Writer<'a> {
    program: &'a Program,
    bytes: &'a [u8],
    layout: &'a Layout,
    edits: Vec<Edit>,
    end: &'static str,
    /// Whether the file has stated so far that axes are printed.
    multax: bool,
    /// Whether the file states that the next motion is rapid travel.
    rapid: bool,
    /// The statement of an arc whose end comes next, with its points before the end.
    arc: Option<Span>,
    on_way: Vec<CorrectedPoint>,
    /// The feed, if holes are drilled: cycles have feeds of their own.
    feeds: Option<Feeds<'a>>,
}

impl<'a> Writer<'a> {
    fn new(program: &'a Program, layout: &'a Layout, bytes: &'a [u8]) -> Self {
        let frame = layout.slots.iter().find_map(Slot::frame).map(|frame| &layout.frames[usize::from(frame)]);
        let drills = layout.groups.iter().any(|group| !group.with_start);
        let feeds = drills.then(|| Feeds::new(frame.map_or(1.0, |frame| frame.mm_per_unit)));
        let (edits, on_way, end) = (Vec::new(), Vec::new(), line_end(bytes));
        Self { program, bytes, layout, edits, end, multax: false, rapid: false, arc: None, on_way, feeds }
    }

    /// Writes one statement with its targets and the points for them.
    fn statement(
        &mut self,
        record: Record,
        statement: &Statement<'_>,
        targets: Range<usize>,
        mut points: Vec<CorrectedPoint>,
    ) -> Result<(), Reason> {
        // `RAPID, GOTO/…` is two statements in a line.
        let after_rapid = statement.after_rapid();
        let statement = after_rapid.as_ref().unwrap_or(statement);
        if statement.major.eq_ignore_ascii_case(b"MULTAX") {
            self.multax = !statement.has(b"OFF");
        }
        let meaning = words::find(statement.major).map(|word| word.meaning);
        match meaning {
            Some(Meaning::Circle | Meaning::MovArc) => {
                self.arc = Some(record.span);
                self.on_way.append(&mut points);
                self.comment_out(record, Vec::new());
                return Ok(());
            }
            Some(Meaning::Cycle) if self.feeds.is_some() => self.comment_out(record, Vec::new()),
            Some(Meaning::Indirv) => self.comment_out(record, Vec::new()),
            Some(Meaning::Rapid) => self.rapid = true,
            Some(Meaning::GoHome) if targets.is_empty() => self.rapid = false,
            Some(Meaning::Feed) => {
                if let Some(feeds) = &mut self.feeds {
                    feeds.add(self.bytes, record, statement);
                }
            }
            _ => {}
        }
        let Some(frame) = self.layout.slots[targets.clone()].iter().find_map(Slot::frame) else { return Ok(()) };
        let frame = &self.layout.frames[usize::from(frame)];
        self.arc = None;
        points.splice(..0, self.on_way.drain(..));
        let own = match (meaning, targets.len(), self.layout.slots[targets.start]) {
            (Some(Meaning::Goto | Meaning::GoHome), 1, Slot::Point { .. } | Slot::GroupEnd { .. }) => {
                Some(points.pop().ok_or(Reason::NoPoint)?)
            }
            _ => None,
        };
        let mut before = Vec::new();
        let mut says_rapid = std::mem::take(&mut self.rapid);
        // In their order: a file with many holes has as many dwells.
        let actions = &self.program.actions;
        let actions = &actions[actions.partition_point(|action| action.before < targets.start)..];
        let here = actions.iter().take_while(|action| action.before < targets.end);
        let mut dwells = here.filter(|action| action.span == record.span).peekable();
        let end = self.end;
        let line = |before: &mut Vec<u8>, text: &[u8]| {
            before.extend_from_slice(text);
            before.extend_from_slice(end.as_bytes());
        };
        if !std::mem::replace(&mut self.multax, true) {
            line(&mut before, b"MULTAX/ON");
        }
        for point in points.iter().chain(&own) {
            let target = &self.program.targets[point.target];
            while let Some(action) = dwells.next_if(|action| action.before <= point.target) {
                if let ActionKind::Dwell { seconds } = action.kind {
                    line(&mut before, format!("DELAY/{}", short(seconds)).as_bytes());
                }
            }
            if let Some(feeds) = &mut self.feeds {
                feeds.before(target)?.inspect(|feed| line(&mut before, feed));
            }
            let is_own = own == Some(*point);
            // RAPID applies to one motion.
            if target.rapid && !std::mem::take(&mut says_rapid) && !(is_own && after_rapid.is_some()) {
                line(&mut before, b"RAPID");
            }
            if !is_own {
                let (at, axis) = self.printed(point, frame);
                let place = [at.map(|v| fixed(v, decimals(frame))), axis.map(|v| fixed(v, AXIS_DECIMALS))].concat();
                line(&mut before, format!("GOTO/{}", place.join(",")).as_bytes());
            }
        }
        match own {
            None => self.comment_out(record, before),
            Some(own) => {
                self.insert(record.span.range().start, before);
                self.position(statement, frame, &own)?;
            }
        }
        Ok(())
    }

    /// A corrected point in the axes and units of the file.
    fn printed(&self, point: &CorrectedPoint, frame: &Frame) -> ([f64; 3], [f64; 3]) {
        let raised = self.layout.raised_mm[usize::from(self.program.targets[point.target].tool)];
        let object = add(point.position_mm, scale(point.axis, raised));
        let at = scale(frame.back(sub(object, frame.origin_mm)), 1.0 / frame.mm_per_unit);
        (at, frame.back(point.axis))
    }

    /// The numbers of one `GOTO`.
    fn position(&mut self, statement: &Statement<'_>, frame: &Frame, own: &CorrectedPoint) -> Result<(), Reason> {
        let numbers: Vec<&Token> = statement.numbers().map(|numbers| numbers.iter().collect()).unwrap_or_default();
        let ([x, y, z, rest @ ..], 3 | 6 | 9) = (&numbers[..], numbers.len()) else {
            return Err(Reason::FormUnwritten);
        };
        let Goal::Axis { position_mm, axis, .. } = self.program.targets[own.target].goal else {
            return Err(Reason::NoToolAxis);
        };
        let was = CorrectedPoint { position_mm, axis, ..*own };
        let off = scale(sub(self.printed(&was, frame).0, [x.value, y.value, z.value]), frame.mm_per_unit);
        if norm(off) > OFF_MM {
            return Err(Reason::PointOffAxis);
        }
        let (at, axis) = self.printed(own, frame);
        for (token, value) in [x, y, z].into_iter().zip(at) {
            self.number(token.span, token.value, value, decimals(frame));
        }
        match rest {
            [i, j, k, ..] => {
                for (token, value) in [i, j, k].into_iter().zip(axis) {
                    self.number(token.span, token.value, value, AXIS_DECIMALS);
                }
            }
            _ => {
                let text = axis.map(|v| fixed(v, AXIS_DECIMALS)).join(",");
                self.insert(z.span.range().end, format!(",{text}").into_bytes());
            }
        }
        Ok(())
    }

    /// Makes a comment of every line of a statement, and puts `before` in front of it.
    fn comment_out(&mut self, record: Record, before: Vec<u8>) {
        let range = record.span.range();
        self.insert(range.start, [&before[..], b"$$ "].concat());
        let bytes = self.bytes;
        let begins = |at: &usize| match bytes[at - 1] {
            b'\n' => true,
            b'\r' => bytes[*at] != b'\n',
            _ => false,
        };
        (range.start + 1..range.end).filter(begins).for_each(|at| self.insert(at, b"$$ ".to_vec()));
    }

    fn insert(&mut self, at: usize, content: Vec<u8>) {
        if !content.is_empty() {
            self.edits.push(Edit { span: Span::new(at, at), content: content.into() });
        }
    }

    /// Writes a number with this number of decimals if it differs from the printed one.
    fn number(&mut self, token: Span, was: f64, value: f64, decimals: usize) {
        let text = fixed(value, decimals);
        if text == fixed(was, decimals) {
            return;
        }
        // The second half of a number on two lines is removed.
        let [head, tail] = chunks(self.bytes, token);
        self.edits.push(Edit { span: head, content: text.into_bytes().into() });
        if !tail.is_empty() {
            self.edits.push(Edit { span: tail, content: Content::new() });
        }
    }
}

fn decimals(frame: &Frame) -> usize {
    if frame.mm_per_unit > 1.0 { INCH_DECIMALS } else { MM_DECIMALS }
}

fn fixed(value: f64, decimals: usize) -> String {
    let mut text = Vec::new();
    write_fixed(&mut text, value, decimals);
    String::from_utf8_lossy(&text).into_owned()
}
