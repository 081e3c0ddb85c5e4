//! Pieces of straight programs, read line by line: lines that differ in nothing but the numbers of their robtarget mean the
//! same, so that one of each kind is read by [`read_as`](super::read_as) and the others by their numbers.

use super::lex;
use super::literal::Literal;
use super::moves::index;
use super::pieces::Piece;
use super::run::MAX_NORM_ERROR;
use super::value::{axes_in_use, unit};
use super::{Layout, Site};
use crate::program::{Goal, Language, Mark, Program, Target, Tool, Wobj};
use crate::text::{Source, Span};

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
}

/// Reads a piece; `None` where only the plain way tells what it means.
pub(super) fn read(piece: &Piece) -> Option<Read> {
    if !piece.plain_head {
        return None;
    }
    let bytes = &piece.source.bytes[..];
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
    let mut start = piece.stretch.start;
    for (count, line) in bytes[piece.stretch.clone()].split_inclusive(|b| *b == b'\n').enumerate() {
        let first = start + line.len() - line.trim_ascii_start().len();
        start += line.len();
        let text = line.trim_ascii();
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
            Some((literal, _)) => (&text[..open], &text[literal.span().end as usize - first..]),
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
        let Some(like) = &kinds[last].motion else { continue };
        let mut target = like.clone();
        if let Some((literal, written)) = robtarget {
            let norm = written.quat.iter().map(|c| c * c).sum::<f64>();
            let inside = &bytes[literal.span().range()];
            if (norm - 1.0).abs() > MAX_NORM_ERROR || axes_in_use(&written.external) || inside.contains(&b'\r') {
                return None;
            }
            target.goal = Goal::Pose { position_mm: written.position_mm, quat: unit(written.quat), conf: written.conf };
            read.sites.push(Site::Literal { literal: u32::try_from(read.literals.len()).ok()?, argument: None });
            read.literals.push(literal);
        } else {
            read.sites.push(Site::None);
        }
        target.ordinal = piece.motions_before + u32::try_from(read.targets.len()).ok()? + 1;
        target.mark = read.mark;
        target.span = Span::new(first, first + text.len());
        target.line = u32::try_from(piece.lines_before + count + 1).ok()?;
        read.targets.push(target);
    }
    (read.targets.len() == motions).then_some(read)
}

impl Read {
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
        Some(Kind { before, behind, motion })
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

    fn common() -> impl Strategy<Value = String> {
        let end = prop::sample::select(vec![",v50,z1,tA;", ",v200,z1,tB;", ",v50,fine,tA\\WObj:=wobj0;"]);
        ("-?[0-9]{1,4}\\.[0-9]{0,8}", end)
            .prop_map(|(x, end)| format!("MoveL [[{x},0,1],[0,1,0,0],[0,-1,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]]{end}"))
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
