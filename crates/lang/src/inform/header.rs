//! Reads the head of a job: its name, its groups of axes, and its positions with the tool and frame of each.

use super::lex::{Line, lines};
use crate::Span;
use crate::cursor::text;
use crate::ir::{Expression, ExpressionKind as Is, Fault, Given, Program, SourceSpan};
use crate::reason::Reason;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Name of the frame of the robot coordinates. Base coordinates are the same frame if no base axis carries the robot.
pub const ROBOT: &str = "ROBOT";
/// Name of the frame of the base coordinates if a base axis carries the robot.
pub(super) const BASE: &str = "BASE";

/// Name of a user frame.
pub(super) fn user(number: &str) -> String {
    format!("USER {}", whole(number))
}

/// The number without leading zeros.
fn whole(number: &str) -> String {
    number.trim().parse::<u32>().map_or_else(|_| number.trim().to_owned(), |number| number.to_string())
}

/// A job with its head read.
#[derive(Default)]
pub(super) struct Job<'a> {
    pub(super) name: &'a [u8],
    pub(super) place: SourceSpan,
    /// Whether a base axis carries the robot.
    pub(super) has_base_axis: bool,
    /// Positions as they are written, from which [`Self::positions`] are built.
    written: Vec<Written<'a>>,
    /// Teaching positions by number.
    pub(super) positions: BTreeMap<u32, Expression>,
    /// Its instructions.
    pub(super) lines: Vec<Line<'a>>,
}

/// A position as it is written, with the settings that apply at its line.
#[derive(Clone, Copy, Default)]
struct Written<'a> {
    is_variable: bool,
    number: u32,
    start: usize,
    numbers: &'a [u8],
    /// The frame of the coordinates, as `POSTYPE` states it.
    kind: &'a [u8],
    tool: &'a [u8],
    user: &'a [u8],
}

#[derive(Clone, Copy, PartialEq)]
enum Section {
    Head,
    Positions,
    Instructions,
    /// After `END`.
    Over,
}

/// The jobs of a file; adds the position variables that come with them to `loaded`.
pub(super) fn jobs<'a>(
    bytes: &'a [u8],
    source: u16,
    program: &mut Program,
    loaded: &mut BTreeMap<u32, Vec<Expression>>,
) -> Result<Vec<Job<'a>>, Fault> {
    let mut all: Vec<Job<'_>> = Vec::new();
    let (mut section, mut holds) = (Section::Over, Written::default());
    let place = |start: usize, line: &[u8]| SourceSpan { source, span: Span::new(start, start + line.len()) };
    for (start, line) in lines(bytes) {
        let directive = line.iter().position(|b| *b != b'/').unwrap_or(line.len());
        let (word, rest) = split(&line[directive..]);
        if directive == 1 && word == b"JOB" {
            all.push(Job { place: place(start, line), ..Job::default() });
            (section, holds) = (Section::Head, Written::default());
            continue;
        }
        let Some(job) = all.last_mut().filter(|_| section != Section::Over) else { continue };
        if directive > 0 {
            match word {
                b"NAME" => job.name = rest,
                b"POS" => section = Section::Positions,
                b"INST" => section = Section::Instructions,
                b"ARGINFO" => section = Section::Head,
                b"TOOL" => holds.tool = rest,
                b"USER" => holds.user = rest,
                b"POSTYPE" => holds.kind = rest,
                _ if word.starts_with(b"GROUP") => {
                    job.has_base_axis |= rest.split(|b| *b == b',').any(|axes| axes.trim_ascii().starts_with(b"BS"));
                }
                _ => {}
            }
            continue;
        }
        if section == Section::Positions && !line.is_empty() {
            if let Some((is_variable, number, at)) = position(line) {
                job.written.push(Written { is_variable, number, start: start + at, numbers: &line[at..], ..holds });
                continue;
            }
            // Some write no `//INST`.
            if !line.contains(&b'=') || !line[0].is_ascii_alphabetic() || line.contains(&b' ') {
                section = Section::Instructions;
            }
        }
        if section == Section::Instructions {
            job.lines.extend(Line::read(line, start));
            if line == b"END" {
                section = Section::Over;
            }
        }
    }
    all.iter_mut().for_each(|job| job.place_positions(source, program, loaded));
    let fault = |place, message| Err(Fault { place, message });
    match all.iter().find(|job| job.name.is_empty()) {
        Some(job) => fault(job.place, "a job without a name: expected `//NAME`"),
        None if all.is_empty() => fault(place(0, b""), "no job: expected `/JOB` in the first line"),
        None => Ok(all),
    }
}

/// The first word of a line, and the text after it.
fn split(line: &[u8]) -> (&[u8], &[u8]) {
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    (&line[..end], line[end..].trim_ascii())
}

/// `C00001=` and `P012=`: whether it is a variable, its number, and the offset of its value.
fn position(line: &[u8]) -> Option<(bool, u32, usize)> {
    let equals = line.iter().position(|b| *b == b'=')?;
    let name = line[..equals].trim_ascii();
    let digits = name.get(1..)?;
    let number = std::str::from_utf8(digits).ok()?.parse().ok()?;
    match name[0] {
        b'C' => Some((false, number, equals + 1)),
        b'P' => Some((true, number, equals + 1)),
        _ => None,
    }
}

impl Job<'_> {
    /// Name of the frame of the base coordinates.
    pub(super) fn base(&self) -> &'static str {
        if self.has_base_axis { BASE } else { ROBOT }
    }

    /// Builds its positions from the written ones.
    fn place_positions(&mut self, source: u16, program: &mut Program, loaded: &mut BTreeMap<u32, Vec<Expression>>) {
        let mut names: BTreeMap<(String, String), Arc<Given>> = BTreeMap::new();
        for written in std::mem::take(&mut self.written) {
            let frame = match written.kind {
                b"ROBOT" => Ok(ROBOT.to_owned()),
                b"BASE" => Ok(self.base().to_owned()),
                b"USER" if !written.user.is_empty() => Ok(user(&text(written.user))),
                // Relative to a tool, or to a frame without a number.
                b"USER" | b"TOOL" | b"MTOOL" => Err(Reason::Frame),
                _ => Err(Reason::Pulses),
            };
            let place = SourceSpan { source, span: Span::new(written.start, written.start + written.numbers.len()) };
            let unknown = |reason| Expression::unknown(reason, Vec::new(), place);
            let expression = match frame {
                Ok(_) if written.tool.is_empty() => unknown(Reason::Tool),
                Ok(frame) => {
                    // All positions that name the same share it.
                    let given =
                        names.entry((format!("TOOL {}", whole(&text(written.tool))), frame)).or_insert_with_key(
                            |(tool, frame)| Arc::new(Given { tool: (**tool).into(), frame: (**frame).into() }),
                        );
                    match numbers(&written, source, program) {
                        Some(items) => Expression { kind: Is::Pose(items, Some(Arc::clone(given))), place },
                        None => unknown(Reason::NotUnderstood),
                    }
                }
                Err(reason) => unknown(reason),
            };
            if written.is_variable {
                loaded.entry(written.number).or_default().push(expression);
            } else if let Some(twice) = self.positions.remove(&written.number) {
                let either = Expression::unknown(Reason::NotUnderstood, vec![twice, expression], place);
                self.positions.insert(written.number, either);
            } else {
                self.positions.insert(written.number, expression);
            }
        }
    }
}

/// Six numbers with commas between them.
fn numbers(written: &Written<'_>, source: u16, program: &mut Program) -> Option<Vec<Expression>> {
    let plain = |part: &[u8]| {
        let digits = part.strip_prefix(b"-").or_else(|| part.strip_prefix(b"+")).unwrap_or(part);
        digits.iter().any(u8::is_ascii_digit) && digits.iter().all(|b| b.is_ascii_digit() || *b == b'.')
    };
    let parts: Vec<&[u8]> = written.numbers.split(|b| *b == b',').collect();
    if parts.len() != 6 || !parts.iter().all(|part| plain(part.trim_ascii())) {
        return None;
    }
    let mut at = written.start;
    let items = parts.into_iter().map(|part| {
        let start = at + part.len() - part.trim_ascii_start().len();
        at += part.len() + 1;
        let digits = part.trim_ascii();
        let place = SourceSpan { source, span: Span::new(start, start + digits.len()) };
        program.literal(digits, place, Reason::NotUnderstood)
    });
    Some(items.collect())
}
