//! Pieces of straight programs, read line by line: lines that differ in nothing but the numbers of their robtarget mean the
//! same, so that one of each kind is read by [`read_as`](super::read_as) and the others by their numbers.

use super::lex;
use super::literal::{Literal, POSE, Written};
use super::moves::index;
use super::piece::Piece;
use super::pieces::line_of;
use super::run::MAX_NORM_ERROR;
use super::value::{axes_in_use, unit};
use super::{Layout, Site};
use crate::program::{Goal, Language, Mark, Program, Target, Tool, Wobj};
use crate::text::number::{Leading, read_leading};
use crate::text::{Source, Span};
use std::ops::Range;

/// A program of more kinds of lines than this a piece has nothing to gain.
const MOST_KINDS: usize = 16;

/// What was read of a piece.
pub(super) struct Read {
    targets: Vec<Target>,
    literals: Vec<Literal>,
    sites: Vec<Site>,
    tools: Vec<Tool>,
    wobjs: Vec<Wobj>,
    mark: Option<Mark>,
}

/// Lines that are alike.
struct Kind<'a> {
    /// Before the robtarget; the whole line where there is none.
    before: &'a [u8],
    behind: &'a [u8],
    /// The motion, if it is one, with the tool and the work object of its own.
    motion: Option<Target>,
    /// Its last line.
    sample: Option<Sample<'a>>,
}

/// The line before, whose robtarget is inline: most lines differ from it in nothing but numbers of the pose.
struct Sample<'a> {
    /// What stands before the pose, from the line's start on.
    before: &'a [u8],
    pose: [Number<'a>; POSE],
    literal: Literal,
    written: Written,
    /// Bytes of the line before the literal, and behind it.
    literal_at: usize,
    behind: usize,
    /// Blanks at the line's start and its end.
    indent: usize,
    trailing: usize,
}

/// A number of a line.
#[derive(Clone, Copy)]
struct Number<'a> {
    /// With what is between it and the next one, or the next line.
    text: &'a [u8],
    is: Leading,
}

impl<'a> Sample<'a> {
    fn new(line: &'a [u8], start: usize, literal: Literal, written: Written) -> Option<Self> {
        let at = |i: usize| literal.token(i).range().start - start;
        let mut pose = [Number { text: line, is: Leading::default() }; POSE];
        for (i, number) in pose.iter_mut().enumerate() {
            number.text = &line[at(i)..if i + 1 < POSE { at(i + 1) } else { line.len() }];
            number.is = read_leading(number.text).filter(|is| is.len() == literal.token(i).len())?;
        }
        // What has no end is not all of the line.
        line.ends_with(b"\n").then(|| Self {
            before: &line[..at(0)],
            pose,
            literal,
            written,
            literal_at: literal.span().range().start - start,
            behind: start + line.len() - literal.span().range().end,
            indent: line.len() - line.trim_ascii_start().len(),
            trailing: line.len() - line.trim_ascii_end().len(),
        })
    }

    /// Reads the line at `start`, if it is like this one, and takes its place: its robtarget, and its length with its end.
    fn read(&mut self, bytes: &'a [u8], start: usize) -> Option<(Literal, Written, usize)> {
        let line = bytes.get(start..)?;
        let mut rest = line.strip_prefix(self.before)?;
        let mut places = [(0, Leading::default()); POSE];
        for (place, number) in places.iter_mut().zip(&mut self.pose) {
            let at = line.len() - rest.len() - self.literal_at;
            rest = match rest.strip_prefix(number.text) {
                Some(behind) => behind,
                None => {
                    let is = read_leading(rest)?;
                    let behind = rest[is.len()..].strip_prefix(&number.text[number.is.len()..])?;
                    *number = Number { text: &rest[..rest.len() - behind.len()], is };
                    behind
                }
            };
            *place = (at, number.is);
        }
        let [x, y, z, quat @ ..] = places.map(|(_, number)| number.value);
        let len = line.len() - rest.len();
        let literal = self.literal.like(start + self.literal_at, len - self.behind - self.literal_at, &places)?;
        Some((literal, Written { position_mm: [x, y, z], quat, ..self.written }, len))
    }
}

/// Reads a piece; `None` where only the plain way tells what it means.
pub(super) fn read(piece: &Piece) -> Option<Read> {
    if !piece.plain_head {
        return None;
    }
    let bytes = &piece.source.bytes[..piece.stretch.end];
    let motions = piece.motions as usize;
    let mut read = Read {
        targets: Vec::with_capacity(motions),
        literals: Vec::with_capacity(motions),
        sites: Vec::with_capacity(motions),
        tools: Vec::new(),
        wobjs: Vec::new(),
        mark: piece.mark_before,
    };
    let mut kinds: Vec<Kind> = Vec::new();
    let mut last = 0;
    let (mut start, mut line_number) = (piece.stretch.start, piece.lines_before);
    while start < bytes.len() {
        line_number += 1;
        if let Some(Kind { motion: Some(like), sample: Some(sample), .. }) = kinds.get_mut(last)
            && let Some((literal, written, len)) = sample.read(bytes, start)
        {
            let text = start + sample.indent..start + len - sample.trailing;
            start += len;
            read.push(piece, like, line_number, text, Some((literal, written)))?;
            continue;
        }
        let line = line_of(&bytes[start..]);
        let first = start + line.len() - line.trim_ascii_start().len();
        let text = line.trim_ascii();
        let line_start = start;
        start += line.len();
        match text.first() {
            None if line.contains(&b'\r') && !line.ends_with(b"\r\n") => return None,
            None => continue,
            Some(b'!') => {
                read.mark = lex::mark(&text[1..]).or(read.mark);
                if text.contains(&b'\r') {
                    return None;
                }
                continue;
            }
            Some(_) => {}
        }
        let open = text.iter().position(|b| *b == b'[').unwrap_or(text.len());
        let robtarget = Literal::read(bytes, 0, first + open);
        let (before, behind) = match &robtarget {
            // One over several lines is not worth a closer look.
            Some((literal, _)) => (&text[..open], text.get(literal.span().range().end - first..)?),
            None => (text, &[][..]),
        };
        let alike = |kind: &Kind| kind.behind == behind && kind.before == before;
        if !kinds.get(last).is_some_and(alike) {
            last = kinds.iter().position(alike).unwrap_or(kinds.len());
            if last == kinds.len() {
                if last == MOST_KINDS {
                    return None;
                }
                kinds.push(read.learn(piece, before, behind, text)?);
            }
        }
        let kind = &mut kinds[last];
        let Some(like) = &kind.motion else { continue };
        if let Some((literal, written)) = &robtarget {
            if axes_in_use(&written.external) || bytes[literal.span().range()].contains(&b'\r') {
                return None;
            }
            kind.sample = Sample::new(line, line_start, *literal, *written);
        }
        read.push(piece, like, line_number, first..first + text.len(), robtarget)?;
    }
    (read.targets.len() == motions).then_some(read)
}

impl Read {
    /// Takes a line's motion, which is like others, given its text's place and its robtarget as written, if it has one.
    fn push(
        &mut self,
        piece: &Piece,
        like: &Target,
        line: usize,
        text: Range<usize>,
        robtarget: Option<(Literal, Written)>,
    ) -> Option<()> {
        let mut target = like.clone();
        if let Some((literal, Written { position_mm, quat, conf, .. })) = robtarget {
            let norm = quat.iter().map(|c| c * c).sum::<f64>();
            if (norm - 1.0).abs() > MAX_NORM_ERROR {
                return None;
            }
            target.goal = Goal::Pose { position_mm, quat: unit(quat), conf };
            self.sites.push(Site::Literal { literal: u32::try_from(self.literals.len()).ok()?, argument: None });
            self.literals.push(literal);
        } else {
            self.sites.push(Site::None);
        }
        target.ordinal = piece.motions_before + u32::try_from(self.targets.len()).ok()? + 1;
        target.mark = self.mark;
        target.span = Span::new(text.start, text.end);
        target.line = u32::try_from(line).ok()?;
        self.targets.push(target);
        Some(())
    }

    /// Reads a line of a new kind, behind the program's own head.
    fn learn<'a>(&mut self, piece: &Piece, before: &'a [u8], behind: &'a [u8], text: &[u8]) -> Option<Kind<'a>> {
        let program = piece.with(text)?;
        let crate::program::Layout::Rapid(layout) = &program.layout else { return None };
        let robtargets = usize::from(before.len() < text.len());
        let whole = Span::new(piece.head().len(), piece.head().len() + text.len());
        let plain = layout.straight && program.diagnostics.is_empty() && program.kept.is_empty();
        let mut targets = program.targets;
        if !plain || layout.literals.len() != robtargets || targets.len() < robtargets || text.contains(&b'\r') {
            return None;
        }
        let motion = targets.pop();
        if !targets.is_empty() || motion.as_ref().is_some_and(|target| target.span != whole) {
            return None;
        }
        let motion = motion.map(|mut target| {
            target.tool = index(&mut self.tools, program.tools[usize::from(target.tool)].clone(), Tool::is);
            target.wobj = index(&mut self.wobjs, program.wobjs[usize::from(target.wobj)].clone(), Wobj::is);
            target
        });
        Some(Kind { before, behind, motion, sample: None })
    }

    /// The piece as a program.
    pub(super) fn into_program(self, dialect: &'static str, source: Source) -> Program {
        Program {
            sources: vec![source],
            written: 1,
            language: Language::Rapid,
            dialect,
            tools: self.tools,
            wobjs: self.wobjs,
            kept: Vec::new(),
            literal_targets: self.literals.len(),
            arcs: 0,
            cutter: None,
            diagnostics: Vec::new(),
            layout: crate::program::Layout::Rapid(Layout {
                literals: self.literals,
                sites: self.sites,
                offsets: Vec::new(),
                motions: self.targets.len(),
                unknown: Vec::new(),
                straight: true,
                plain: true,
                mark_behind: self.mark,
            }),
            targets: self.targets,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pieces::Pieces;
    use crate::program::Next;
    use proptest::prelude::*;

    const HEAD: &str = "MODULE M\n  PERS tooldata tA:=[TRUE,[[0,0,300],[1,0,0,0]],[8,[0,0,100],[1,0,0,0],0,0,0]];\n  \
                        PERS tooldata tB:=[TRUE,[[0,0,200],[1,0,0,0]],[8,[0,0,100],[1,0,0,0],0,0,0]];\n  PROC main()\n";

    /// A statement, a comment or an empty line.
    fn line() -> impl Strategy<Value = String> {
        let word = prop::sample::select(vec!["MoveL", "moveJ", "MoveL ", "  MoveL"]);
        let end = prop::sample::select(vec![
            ",v50,z1,tA;",
            ",v50,z1,tB;",
            ",v200,fine,tA\\WObj:=wobj0;",
            ",[30,500,5000,1000],z1,TA;",
            ", v50 , z1 , tA ;",
            ",v50,z1,tA;MoveL p,v50,z1,tA;",
            ",v50,z1,tC;",
            "\\ID:=3,v50,z1,tA;",
        ]);
        let number = prop_oneof![Just("0".to_owned()), Just("+1.".to_owned()), "-?[0-9]{1,4}\\.[0-9]{0,8}"];
        let quat = prop::sample::select(vec!["1,0,0,0", "0.7071,0,0.7071,0", "0,0.6,-0.8,0", "1,1,0,0", "1,0,0"]);
        let external = prop::sample::select(vec![
            "9E9,9E9,9E9,9E9,9E9,9E9",
            "9E9, 9E+09,9E9,9E9,9E9,9E9",
            "0,9E9,9E9,9E9,9E9,9E9",
        ]);
        // What stops a program from being straight is rare, else none would be.
        let motion =
            (word, number.clone(), number, quat, external, end).prop_map(|(word, x, y, quat, external, end)| {
                format!("{word} [[{x},{y},1],[{quat}],[0,0,0,0],[{external}]]{end}")
            });
        prop_oneof![
            12 => motion,
            1 => Just("  ! deflex air".to_owned()),
            1 => Just("! deflex cut".to_owned()),
            1 => Just("! a comment; MoveL".to_owned()),
            1 => Just(String::new()),
            1 => Just("  ConfL\\Off;".to_owned()),
            1 => Just("SetDO do1,1;".to_owned()),
            1 => Just("MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tA;".to_owned()),
        ]
    }

    /// Lines that differ in their pose, mostly, or in anything that a sample has to notice.
    fn common() -> impl Strategy<Value = String> {
        let often = |common: &'static str, others: &[&'static str]| prop_oneof![12 => Just(common), 1 => prop::sample::select(others.to_vec())];
        let number = prop_oneof![
            8 => "-?[0-9]{1,4}\\.[0-9]{1,8}",
            1 => prop::sample::select(vec!["0", "+1.5", "-0.0", "12.", ".5", "1.5E2", "- 3", "9E9", "1.123456789012345"])
                .prop_map(str::to_owned),
        ];
        let quat =
            prop::sample::select(vec!["0,1,0,0", "0.7071,0,0.7071,0", "0,0.60,-0.80,0", "0 , 1, 0,0", "0,0,-1.0,0"]);
        (
            often("  ", &["", "\t", "   "]),
            (number, often(",", &[", ", " ,"]), quat, often("],[", &["] ,[", "], ["])),
            often("0,-1,0,1", &["0,-1,0,0", "0,-1,0,1 ", "0,-1.0,0,1"]),
            often("9E9,9E9,9E9,9E9,9E9,9E9", &["9E+09,9E9,9E9,9E9,9E9,9E9", "0,9E9,9E9,9E9,9E9,9E9"]),
            often(
                ",v50,z1,tA;",
                &[",v200,z1,tB;", ",v50,fine,tA\\WObj:=wobj0;", ",v50,z1,tA; ", ",v50,z1,tA;\t", ",v50,z10,tA;"],
            ),
        )
            .prop_map(|(indent, (x, comma, quat, joint), conf, external, end)| {
                format!("{indent}MoveL [[{x}{comma}0,1{joint}{quat}{joint}{conf}],[{external}]]{end}")
            })
    }

    proptest! {
        #[test]
        fn a_piece_reads_like_each_of_its_statements(
            lines in prop::collection::vec(prop_oneof![20 => common(), 1 => line()], 1..400),
            end in prop::sample::select(vec!["\n", "\r\n", "\n", "\r\r\n"]),
        ) {
            let body: String = lines.iter().map(|line| format!("{line}{end}")).collect();
            let text = format!("{HEAD}{body}ENDPROC\nENDMODULE\n");
            let mut pieces = match Pieces::new("x.mod", text.as_bytes(), &[]) {
                Ok(Some(pieces)) => pieces,
                _ => return Ok(()),
            };
            while let Ok(Next::Piece(piece)) = pieces.take() {
                let fast = super::read(&piece).map(|read| read.into_program(piece.dialect(), piece.source.clone()));
                let plain = piece.read_plain();
                // Whoever is not sure leaves it to the plain way; whoever is says the same.
                if let Some(fast) = fast {
                    prop_assert_eq!(plain.map(|plain| format!("{:?}", plain.program)), Some(format!("{fast:?}")));
                }
            }
        }
    }

    #[test]
    fn a_usual_program_is_read_by_its_kinds_of_lines() {
        let line = "    MoveL [[1.5,2,3],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tA;\n";
        let text = format!("{HEAD}  ConfL\\Off;\n  ! deflex cut\n{}ENDPROC\nENDMODULE\n", line.repeat(2000));
        let mut pieces = Pieces::new("x.mod", text.as_bytes(), &[]).unwrap().unwrap();
        let mut count = 0;
        while let Ok(Next::Piece(piece)) = pieces.take() {
            count += super::read(&piece).unwrap().targets.len();
        }
        assert_eq!(count, 2000);
    }
}
