//! RAPID programs with declared targets and with routines, in chunks against the same programs as a whole.

use crate::streamed::{self, Came, in_chunks, words};
use deflex::cell::Cell;
use deflex::correct::{Options, compensate_declared};
use deflex::program::rapid::{self, CHUNK, Declared};
use deflex::text::{Patch, Source};
use proptest::prelude::*;
use std::io::Cursor;

fn cell() -> Cell {
    Cell::read(&Source::new("cell.toml", include_str!("../../benches/cell.toml").as_bytes())).unwrap()
}

fn whole(text: &str, cell: &Cell) -> Came {
    whole_with(text, cell, &Options::default())
}

fn whole_with(text: &str, cell: &Cell, options: &Options) -> Came {
    let program = rapid::read(vec![Source::new("part.mod", text.as_bytes())], Vec::new())?;
    streamed::whole(&program, cell, options)
}

/// `None` where the program is not of this kind.
fn streamed(text: &str, cell: &Cell, threads: usize) -> Option<Came> {
    streamed_with(text, cell, &Options::default(), threads, CHUNK)
}

pub(crate) fn streamed_with(text: &str, cell: &Cell, options: &Options, threads: usize, chunk: usize) -> Option<Came> {
    let input = || Cursor::new(text.as_bytes());
    let chunks = Declared::sized("part.mod", input(), input(), &[], chunk).unwrap()?;
    let mut patch = Patch::new(Cursor::new(Vec::new()));
    in_chunks(|program, sinks| {
        let streamed = compensate_declared(chunks, cell, options, threads, &mut patch, sinks)?;
        if streamed.failures.is_empty() {
            patch.apply(input(), program).unwrap();
        }
        Ok(streamed)
    })
}

/// `count` targets along a line, declared in the order that `turn` makes of theirs; every tenth is inline.
fn program(count: usize, turn: usize, ends: &str) -> String {
    let pose = |i: usize| {
        // There and back again, within reach.
        let x = 500.0 - (0.1 * i as f64 % 1000.0 - 500.0).abs();
        format!(
            "[[{x:.3},{:.2},40.000],[0,0.99419421,0,0.10760048],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
            (0.05 * x).sin()
        )
    };
    let mut text = "MODULE Mill\n  ! declared elsewhere\n".to_owned();
    for i in (0..count).map(|i| i * turn % count).filter(|i| i % 10 > 0) {
        let storage = ["CONST", "LOCAL PERS", "VAR"][i % 3];
        text += &format!("  {storage} robtarget p{i}:={};\n", pose(i));
    }
    text += "  CONST robtarget pUnused:=[[0,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n  PROC main()\n    ConfL\\Off;\n";
    for i in 0..count {
        match i % 10 {
            0 => text += &format!("    MoveL {},v50,z1,tMill\\WObj:=wPart;\n", pose(i)),
            _ => {
                text += &format!("    MoveL {}{i}, v50, z1, tMill \\WObj:=wPart;\n", if i % 2 > 0 { "p" } else { "P" })
            }
        }
    }
    (text + "    ! the end\n  ENDPROC\nENDMODULE\n").replace('\n', ends)
}

/// A body of some chunks.
const SOME: std::ops::Range<usize> = 3 * CHUNK / 50..5 * CHUNK / 50;

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    #[test]
    fn a_program_with_declared_targets_gives_the_same_in_chunks(count in SOME, order in 0..3_usize, crlf in any::<bool>()) {
        let (cell, ends) = (cell(), if crlf { "\r\n" } else { "\n" });
        // In the order of their use, the other way round, all over the place.
        let turn = [1, count - 1, (1..).map(|i| 7 * i + 1).find(|t| gcd(*t, count) == 1 && *t > 8).unwrap()][order];
        let text = program(count, turn, ends);
        let expected = whole(&text, &cell);
        prop_assert_eq!(words(&expected), Vec::<String>::new());
        for threads in [1, 3] {
            let came = streamed(&text, &cell, threads).ok_or_else(|| TestCaseError::fail("the program is streamed"))?;
            prop_assert_eq!(words(&came), Vec::<String>::new());
            let (came, expected) = (came.as_ref().unwrap(), expected.as_ref().unwrap());
            prop_assert!(came.program == expected.program, "the programs differ");
            prop_assert!(came.report == expected.report, "the reports differ");
        }
    }
}

/// What a routine holds.
#[derive(Clone, Debug)]
enum Line {
    /// To an inline target.
    Inline,
    Declared,
    Mark(bool),
    Comment,
    Blank,
    Harmless,
    /// Of a routine that moves nothing.
    Helper,
    /// Of one that no other calls, with these lines.
    Routine(Vec<Line>),
}

fn line() -> impl Strategy<Value = Line> {
    let simple = || {
        prop_oneof![
            20 => Just(Line::Inline),
            10 => Just(Line::Declared),
            1 => any::<bool>().prop_map(Line::Mark),
            1 => Just(Line::Comment),
            1 => Just(Line::Blank),
            1 => Just(Line::Harmless),
            1 => Just(Line::Helper),
        ]
    };
    let inner = move || prop::collection::vec(simple(), 0..60);
    let routine = prop::collection::vec(prop_oneof![20 => simple(), 1 => inner().prop_map(Line::Routine)], 0..60);
    prop_oneof![2 => simple(), 1 => routine.prop_map(Line::Routine)]
}

/// Writes the routines that `lines` run through, in the order in which they end.
struct Writer {
    data: String,
    routines: Vec<String>,
    motions: usize,
}

impl Writer {
    fn routine(&mut self, name: &str, lines: &[Line]) {
        let mut text = format!("  PROC {name}()\n");
        for line in lines {
            let i = self.motions;
            // There and back again, within reach, and turning so that corrections bend.
            let x = 500.0 - (0.4 * i as f64 % 1000.0 - 500.0).abs();
            let half = 0.1078 + 0.01 * (0.5 * x).sin();
            let pose = format!(
                "[[{x:.3},{:.2},40.000],[0,{:.8},0,{:.8}],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
                (0.05 * x).sin(),
                half.cos(),
                half.sin(),
            );
            self.motions += usize::from(matches!(line, Line::Inline | Line::Declared));
            text += &match line {
                // At the start of its line, where a routine's text begins.
                Line::Inline => format!("MoveL {pose},v50,z1,tMill\\WObj:=wPart;\n"),
                Line::Declared => {
                    self.data += &format!("  CONST robtarget p{i}:={pose};\n");
                    format!("    MoveL p{i},v50,z1,tMill\\WObj:=wPart;\n")
                }
                Line::Mark(air) => format!("    ! deflex {}\n", if *air { "air" } else { "cut" }),
                Line::Comment => format!("    ! Path_{i};\n"),
                Line::Blank => "\n".to_owned(),
                Line::Harmless => "    SetDO doCoolant,1;\n".to_owned(),
                Line::Helper => "    Helper;\n".to_owned(),
                Line::Routine(lines) => {
                    // Named by where it begins: two may begin at the same motion.
                    let name = format!("Path_{i}_{}", self.routines.len() + lines.len());
                    let name = format!("{name}_{}", text.len());
                    self.routine(&name, lines);
                    format!("    {};\n", name.to_uppercase())
                }
            };
        }
        self.routines.push(text + "  ENDPROC\n");
    }
}

fn with_routines(lines: &[Line], turn: usize, ends: &str) -> String {
    let mut writer = Writer { data: String::new(), routines: Vec::new(), motions: 0 };
    writer.routine("main", lines);
    let Writer { data, mut routines, .. } = writer;
    routines.push("  LOCAL PROC helper ( )\n    SetDO doHelp,1;\n  ENDPROC\n  ! of nothing\n".to_owned());
    let turn = turn % routines.len();
    routines.rotate_left(turn);
    format!("MODULE Mill\n{data}{}ENDMODULE\n", routines.concat()).replace('\n', ends)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn a_program_with_routines_gives_the_same_in_chunks(
        lines in prop::collection::vec(line(), 1..80),
        turn in 0..9_usize,
        crlf in any::<bool>(),
        chunk in 1..20_000_usize,
        subdivide in prop::option::of(Just(5e-6)),
    ) {
        let cell = cell();
        let text = with_routines(&lines, turn, if crlf { "\r\n" } else { "\n" });
        let options = Options { subdivide, ..Options::default() };
        let expected = whole_with(&text, &cell, &options);
        for threads in [1, 3] {
            // One that moves nowhere, or not away from its start within a small chunk, is not worth a chunk.
            let Some(came) = streamed_with(&text, &cell, &options, threads, chunk) else {
                prop_assert!(chunk < 2000 || text.matches("MoveL").count() < 20);
                continue;
            };
            prop_assert_eq!(words(&came), words(&expected));
            let (Ok(came), Ok(expected)) = (&came, &expected) else { continue };
            prop_assert!(came.program == expected.program, "the programs differ");
            prop_assert!(came.report == expected.report, "the reports differ");
        }
    }
}

#[test]
fn targets_of_several_uses_that_agree_are_corrected_once() {
    let cell = cell();
    let text = program(SOME.start, 1, "\n");
    let (head, body) = text.split_once("    ConfL\\Off;\n").unwrap();
    let moves = body.split_once("    ! the end").unwrap().0;
    let twice = format!("{head}{moves}{body}");
    let expected = whole(&twice, &cell);
    for threads in [1, 3] {
        let came = streamed(&twice, &cell, threads).unwrap();
        assert_eq!(words(&came), words(&expected));
        let (came, expected) = (came.as_ref().unwrap(), expected.as_ref().unwrap());
        assert!(came.program == expected.program, "the programs differ");
        assert!(came.report == expected.report, "the reports differ");
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[test]
fn a_target_out_of_reach_is_reported_alike() {
    let text = program(SOME.start, 1, "\n");
    let far = text.replace("p1001:=[[100.100", "p1001:=[[9100.100");
    assert_ne!(far, text);
    let expected = whole(&far, &cell());
    assert!(expected.is_err());
    assert_eq!(words(&streamed(&far, &cell(), 3).unwrap()), words(&expected));
}

#[test]
fn other_programs_are_not_of_this_kind() {
    let text = program(SOME.start, 1, "\n");
    let cell = cell();
    assert!(streamed(&text, &cell, 2).unwrap().is_ok());
    let late = |statement: &str| text.replace("    ! the end", &format!("    {statement}"));
    let programs = [
        late("MoveL p1,v50,z1,tMill\\WObj:=wPart;"),
        late("MoveL Offs(p1,0,0,5),v50,z1,tMill\\WObj:=wPart;"),
        late("p1.trans.x:=5;"),
        late("Finish;"),
        late("FOR i FROM 1 TO 2 DO\n ENDFOR"),
        text.replace("robtarget p1:=", "robtarget p1:=\n    "),
        text.replace("robtarget p1:=", "robtarget p2:="),
        text.replace("ENDMODULE", "  PROC more(num n)\n  ENDPROC\nENDMODULE"),
        text.replace("ENDMODULE", "  FUNC num more()\n    RETURN 1;\n  ENDFUNC\nENDMODULE"),
        text.replace("ENDMODULE", "  PROC more()\n    MoveL p1,v50,z1,tMill\\WObj:=wPart;\n  ENDPROC\nENDMODULE"),
        late("more;").replace("ENDMODULE", "  PROC more()\n  more;\n  ENDPROC\nENDMODULE"),
        late("more 5;").replace("ENDMODULE", "  PROC more()\n  ENDPROC\nENDMODULE"),
        text.replace("ENDMODULE", "  ! deflex air\nENDMODULE"),
        text.replace("ENDMODULE", "  PROC more()\n  ERROR\n    RETRY;\n  ENDPROC\nENDMODULE"),
        text.replace("ENDMODULE", "ENDMODULE\nMODULE B\nENDMODULE"),
        text.replace(
            "    ConfL",
            "    CONST robtarget p1:=[[0,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n    ConfL",
        ),
    ];
    for program in &programs {
        assert!(streamed(program, &cell, 2).is_none(), "{}", &program[program.len() - 300..]);
    }
}
