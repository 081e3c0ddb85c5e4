//! Motion instructions, and circles of several of them.

use super::lex::Line;
use super::parser::Parser;
use super::words::{self, Does};
use crate::Span;
use crate::ir::{Binary, Expression, ExpressionKind as Is, Motion, Path, StatementKind};
use crate::lexeme::{Lexeme, LexemeKind};
use crate::reason::Reason;

/// Whether each circle of a job is three consecutive points, after another motion that always runs before it.
pub(super) fn has_plain_circles(lines: &[Line<'_>]) -> bool {
    // Points of the circle that is open, and whether the motion before is the one in the text.
    let (mut points, mut before) = (0, false);
    for line in lines {
        let code = line.code();
        let Some(first) = code.first() else { continue };
        match word(code) {
            Some(b"MOVC") if points > 0 || before => points += 1,
            Some(b"MOVC") => return false,
            Some(_) => {
                if !matches!(points, 0 | 3) {
                    return false;
                }
                (points, before) = (0, true);
            }
            None => {
                if matches!(points, 1 | 2) {
                    return false;
                }
                let quiet = words::find(first.text) == Some(Does::Nothing);
                before &= quiet;
                if points == 3 && !quiet {
                    points = 0;
                }
            }
        }
        // FPT ends the arc at its point: at the third one it says what follows anyway.
        if points > 3 || matches!(points, 1 | 2) && code.iter().any(|lexeme| lexeme.is("FPT")) {
            return false;
        }
    }
    matches!(points, 0 | 3)
}

/// The motion word of a line, without the sign for another robot.
fn word<'a>(code: &[Lexeme<'a>]) -> Option<&'a [u8]> {
    let word = code.iter().find(|lexeme| lexeme.kind == LexemeKind::Name)?.text;
    motion_path(word).map(|_| word)
}

/// The kind of path of a motion word; `None` for other words.
pub(super) fn motion_path(word: &[u8]) -> Option<Path> {
    Some(match word {
        b"MOVJ" => Path::Joint,
        b"MOVL" => Path::Linear,
        b"MOVC" => Path::Circular,
        b"MOVS" => Path::Other(Reason::Spline),
        b"IMOV" => Path::Unknown(Reason::Relative),
        b"SMOVL" | b"SMOVC" | b"SMOVS" | b"SYMOVL" | b"SYMOVC" | b"SYMOVJ" | b"EIMOVL" | b"EIMOVC" => {
            Path::Unknown(Reason::Follows)
        }
        _ => return None,
    })
}

impl Parser<'_, '_> {
    /// `MOVL C00001 V=100.0 PL=0`
    pub(super) fn motion(&mut self, word: &[u8], start: Span) -> Option<Vec<StatementKind>> {
        let mut path = motion_path(word)?;
        let to = self.position().unwrap_or_else(|| self.unknown(Reason::NotUnderstood, start));
        let (mut speed, mut blend, mut others, mut traps) = (None, None, Vec::new(), Vec::new());
        while let Some(tag) = self.peek() {
            self.at += 1;
            let value = if self.take("=") { self.operand() } else { None };
            match (tag.text, value) {
                (b"V", Some(value)) => {
                    // A variable counts tenths of a millimetre a second.
                    let literal = matches!(value.kind, Is::Number(..));
                    speed = Some(if literal { value } else { value.with(Binary::Multiply, 0.1) });
                }
                (b"PL", Some(value)) => {
                    // How far from its end a motion is left at a level is a parameter of the controller.
                    let stops = matches!(value.kind, Is::Number(level, _) if level == 0.0);
                    others.push(value);
                    blend = stops.then(|| Expression::constant(0.0));
                }
                (b"CR", Some(value)) => blend = Some(value),
                (
                    b"VJ" | b"VR" | b"VE" | b"VMAX" | b"ACC" | b"DEC" | b"SPDL" | b"PD" | b"MT" | b"COORD" | b"T"
                    | b"DIS",
                    Some(value),
                ) => others.push(value),
                (b"NWAIT" | b"ENWAIT" | b"CONT" | b"FPT", None) => {}
                (b"TRAP", None) if self.take("*") => traps = self.labels_named(),
                (word, value) => {
                    path = Path::Unknown(match word {
                        _ if path == Path::Unknown(Reason::Relative) => Reason::Relative,
                        b"UNTIL" | b"SRCH" | b"ASRCH" | b"HPSRCH" | b"NSRCH" => Reason::Follows,
                        word if word == b"+" || is_other_axis(word) => Reason::OtherAxes,
                        _ => Reason::NotUnderstood,
                    });
                    others.extend(value);
                    others.extend(self.named(&[]));
                }
            }
        }
        let blend = Some(blend.unwrap_or_else(|| self.unknown(Reason::Computed, start)));
        let mut motion = Motion { path, via: None, to: Some(to), speed, blend, others };
        let is_whole = self.circle(word == b"MOVC", &mut motion);
        let jumps = traps
            .into_iter()
            .map(|to| StatementKind::Jump { to: to.into(), condition: Some(self.unknown(Reason::Input, start)) });
        let moves = is_whole.then(|| StatementKind::Move(Box::new(motion)));
        Some(moves.into_iter().chain(jumps).collect())
    }

    /// Handles three consecutive points: the path to the first is a line, and the second is the circle point on the path to the third.
    fn circle(&mut self, is_point: bool, motion: &mut Motion) -> bool {
        if !is_point {
            self.own.circle = (0, None);
            return true;
        }
        if !self.own.has_plain_circles {
            if motion.path == Path::Circular {
                motion.path = Path::Other(Reason::Circles);
            }
            return true;
        }
        self.own.circle.0 = self.own.circle.0 % 3 + 1;
        let is_known = motion.path == Path::Circular;
        match (self.own.circle.0, self.own.circle.1.take()) {
            (1, _) if is_known => motion.path = Path::Linear,
            (2, _) if is_known => {
                self.own.circle.1 = motion.to.take();
                return false;
            }
            (3, Some(via)) if is_known => motion.via = Some(via),
            (_, via) => {
                motion.others.extend(via);
                if is_known {
                    motion.path = Path::Other(Reason::Circles);
                }
            }
        }
        true
    }
}

/// `BC00001`, `EC00001`, `BP001`, `EX001`, `RB1`: axes that the arm does not have.
fn is_other_axis(word: &[u8]) -> bool {
    let word = word.strip_prefix(b"L").unwrap_or(word);
    [&b"BC"[..], b"EC", b"BP", b"EX", b"RB", b"ST"]
        .iter()
        .any(|kind| word.strip_prefix(*kind).is_some_and(|rest| rest.is_empty() || rest.iter().all(u8::is_ascii_digit)))
}
