//! Corrected points back into the CL data that they come from, for a maker's own post.
//!
//! Tip and tool axis are written, five axes: `GOTO/x,y,z,i,j,k`. All other statements stay as they are.

use super::layout::{Layout, Slot};
use super::lex::{Lexer, Record, RecordKind, chunks};
use super::statement::Statement;
use super::vector::{add, dot, norm, scale, sub};
use crate::program::{Goal, Program, Target};
use crate::text::number::write_fixed;
use crate::text::{Content, Diagnostic, Edit, Span, apply};

/// Where a corrected tool goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectedPoint {
    /// Index of the target that it is, or that it is inserted before.
    pub target: usize,
    /// Tip in the work object, mm.
    pub position_mm: [f64; 3],
    /// Unit vector from the tip towards the spindle, work object axes.
    pub axis: [f64; 3],
}

/// Decimals of a millimetre, as in posted programs; an inch needs two more for the same step.
const MM_DECIMALS: usize = 4;
const INCH_DECIMALS: usize = 6;
/// Decimals of a tool axis: 1e-6 mm at 200 mm.
const AXIS_DECIMALS: usize = 8;
/// A printed point this far off the tool axis through the tip is no tip and no centre, mm.
const OFF_AXIS_MM: f64 = 1e-6;

/// The file with the corrected points, those that belong to one target in a row, its own last; `title` is put before it as
/// comments.
///
/// # Errors
/// Statements that make several points, or count on from others: arcs, holes, increments, lists; decks of cards.
pub fn write(program: &Program, points: &[CorrectedPoint], title: &[String]) -> Result<Vec<u8>, Vec<Diagnostic>> {
    let (crate::program::Layout::Cl(layout), [source]) = (&program.layout, &program.sources[..]) else {
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
        error.help("have the CAM system print points (linear output), or post with --post rapid, krl or ls")
    };
    if layout.cards {
        let message = "a deck of cards has no room for corrected axes";
        return Err(Diagnostic::error("post.cl", &source.name, message).help("write CL data without cards").into());
    }
    let mut writer = Writer { bytes, layout, edits: Vec::new(), multax: false, end: line_end(bytes) };
    let (mut lexer, mut tokens) = (Lexer::new(bytes, source.lines_before), Vec::new());
    let (mut at, mut own, mut errors) = (0, points.iter().peekable(), Vec::new());
    while let Some(record) = lexer.next(&mut tokens) {
        if record.kind != RecordKind::Statement {
            continue;
        }
        let Some(statement) = Statement::parse(bytes, &tokens) else { continue };
        writer.multax |= statement.major.eq_ignore_ascii_case(b"MULTAX");
        let first = at;
        at += program.targets[first..].iter().take_while(|target| target.span == record.span).count();
        let mut here = Vec::new();
        while let Some(point) = own.next_if(|point| point.target < at) {
            here.push(*point);
        }
        match at - first {
            0 => {}
            1 => {
                let written = writer.position(record, &statement, &program.targets[first], layout.slots[first], &here);
                errors.extend(written.err().map(|message| refused(record, message)));
            }
            _ => errors.push(refused(record, "an arc, a hole or a list of points is not written as points")),
        }
    }
    if at != program.targets.len() && errors.is_empty() {
        let message = "statements that are run more than once are not written as points";
        errors.push(Diagnostic::error("post.cl", &source.name, message).help("post with --post rapid, krl or ls"));
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut out = Vec::with_capacity(bytes.len() + bytes.len() / 2);
    for line in title {
        out.extend_from_slice(format!("$$ {line}{}", writer.end).as_bytes());
    }
    // Edits are of the bytes that they were found in, in their order.
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
    bytes: &'a [u8],
    layout: &'a Layout,
    edits: Vec<Edit>,
    /// The file says, up to here, that axes are printed.
    multax: bool,
    end: &'static str,
}

impl Writer<'_> {
    /// One `GOTO`, and what is inserted before it.
    fn position(
        &mut self,
        record: Record,
        statement: &Statement<'_>,
        target: &Target,
        slot: Slot,
        points: &[CorrectedPoint],
    ) -> Result<(), &'static str> {
        let (Slot::Point { frame, .. }, Goal::Axis { position_mm, axis, .. }) = (slot, target.goal) else {
            return Err("an arc, a hole or an increment is not written as points");
        };
        let numbers: Vec<_> = statement.numbers().map(|numbers| numbers.iter().copied().collect()).unwrap_or_default();
        let ([x, y, z, rest @ ..], 3 | 6 | 9) = (&numbers[..], numbers.len()) else {
            return Err("a position of this form is not written as a point and an axis");
        };
        let frame = &self.layout.frames[usize::from(frame)];
        // How far the printed point stands up from the tip: a corner radius, or nothing.
        let up = sub(frame.position([x.value, y.value, z.value]), position_mm);
        let radius = dot(up, axis);
        if norm(sub(up, scale(axis, radius))) > OFF_AXIS_MM {
            return Err("the printed point is neither the tip nor on the tool axis");
        }
        let printed = |point: &CorrectedPoint| {
            let object = add(point.position_mm, scale(point.axis, radius));
            let at = scale(frame.back(sub(object, frame.origin_mm)), 1.0 / frame.mm_per_unit);
            (at, frame.back(point.axis))
        };
        let decimals = if frame.mm_per_unit > 1.0 { INCH_DECIMALS } else { MM_DECIMALS };
        let Some((own, inserted)) = points.split_last() else { return Err("a target is without its point") };
        let mut before = String::new();
        if !self.multax {
            before += &format!("MULTAX/ON{}", self.end);
            self.multax = true;
        }
        for point in inserted {
            let (at, axis) = printed(point);
            let place = [at.map(|v| fixed(v, decimals)), axis.map(|v| fixed(v, AXIS_DECIMALS))].concat();
            before += &format!("GOTO/{}{}", place.join(","), self.end);
            if target.rapid {
                // RAPID holds for one move.
                before += &format!("RAPID{}", self.end);
            }
        }
        if !before.is_empty() {
            let start = record.span.range().start;
            self.edits.push(Edit { span: Span::new(start, start), content: before.into_bytes().into() });
        }
        let (at, axis) = printed(own);
        for (token, value) in [x, y, z].into_iter().zip(at) {
            self.number(token.span, token.value, value, decimals);
        }
        match rest {
            [i, j, k, ..] => {
                for (token, value) in [i, j, k].into_iter().zip(axis) {
                    self.number(token.span, token.value, value, AXIS_DECIMALS);
                }
            }
            _ => {
                let end = z.span.range().end;
                let text = axis.map(|v| fixed(v, AXIS_DECIMALS)).join(",");
                self.edits.push(Edit { span: Span::new(end, end), content: format!(",{text}").into_bytes().into() });
            }
        }
        Ok(())
    }

    /// Writes a number where it is another than what is printed, to so many decimals.
    fn number(&mut self, token: Span, was: f64, value: f64, decimals: usize) {
        let text = fixed(value, decimals);
        if text == fixed(was, decimals) {
            return;
        }
        // Of a number that goes over two lines the second half goes.
        let [head, tail] = chunks(self.bytes, token);
        self.edits.push(Edit { span: head, content: text.into_bytes().into() });
        if !tail.is_empty() {
            self.edits.push(Edit { span: tail, content: Content::new() });
        }
    }
}

fn fixed(value: f64, decimals: usize) -> String {
    let mut text = Vec::new();
    write_fixed(&mut text, value, decimals);
    String::from_utf8_lossy(&text).into_owned()
}
