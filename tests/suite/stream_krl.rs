//! Long KRL programs in chunks: the bytes, the report and the words of the whole.

use crate::streamed::{self, Came, in_chunks, words};
use deflex::cell::Cell;
use deflex::correct::{Options, compensate_chunks};
use deflex::program::krl::{self, Chunks};
use deflex::text::Source;
use proptest::prelude::*;
use std::fmt::Write;
use std::io::Cursor;

const CELL: &str = r#"
[robot]
model = "irb6660-205-1.9"
[robot.stiffness]
joint_nm_per_rad = [3.8e6, 6.6e6, 3.9e6, 5.6e5, 6.6e5, 4.7e5]
[tools."TOOL_DATA[3]"]
tcp_mm = [10.0, -20.0, 200.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 38.0
cog_mm = [90.0, 0.0, 60.0]
[wobjs."BASE_DATA[2]"]
uframe_mm = [1100.0, -150.0, 300.0]
uframe_quat = [1.0, 0.0, 0.0, 0.0]
[cut]
force = "constant"
force_n = [310.0, -120.0, 260.0]
frame = "feed"
[limits]
max_correction_mm = 5.0
max_step_mm = 5.0
[[effect]]
kind = "gravity"
mass_kg = [0, 200, 150, 60, 30, 10]
first_moment_kg_m = [[0, 0, 0], [100, 0, 0], [30, 60, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
tool = true
"#;

const HEAD: &str = "&ACCESS RVP
DEF part( )
  ;FOLD INI
  BAS(#INITMOV,0)
  ;ENDFOLD
  $BASE=BASE_DATA[2]
  $TOOL=TOOL_DATA[3]
  $VEL.CP=0.05
  PTP {A1 0,A2 0,A3 0,A4 0,A5 30,A6 0}
";

const TAIL: &str = "  $VEL.CP=0.2
  LIN {X 0,Y 0,Z 120,A 0,B 180,C 0}
  PTP {A1 0,A2 0,A3 0,A4 0,A5 30,A6 0}
END
";

fn cell() -> Cell {
    Cell::read(&Source::new("cell.toml", CELL)).unwrap()
}

/// The same with the law of its controller.
fn driven() -> Cell {
    let law = "[controller]\ncompensates = []\n[controller.path]\nzone_share = 0.9\nsmoothing_s = [0.04, 0.03]\nzone_mm = 0.4\n";
    Cell::read(&Source::new("cell.toml", [law, CELL].concat())).unwrap()
}

fn whole(text: &str, cell: &Cell, options: &Options) -> Came {
    let program = krl::read(vec![Source::new("part.src", text)], Vec::new())?;
    streamed::whole(&program, cell, options)
}

/// `None` where the program is read whole.
fn streamed(text: &str, cell: &Cell, options: &Options, chunk: usize, threads: usize) -> Option<Came> {
    let chunks = Chunks::of_file("part.src", Cursor::new(text.as_bytes()), &[], chunk).unwrap()?;
    in_chunks(|program, sinks| compensate_chunks(chunks, cell, options, threads, program, sinks))
}

#[derive(Clone, Copy, Debug)]
enum Line {
    Cut,
    Turned,
    Smooth,
    Blanks,
    Spline,
    Status,
    Binary,
    Comment,
    Empty,
    Air,
    MarkCut,
    Speed(u8),
}

fn line() -> impl Strategy<Value = Line> {
    prop_oneof![
        12 => Just(Line::Cut),
        4 => Just(Line::Turned),
        3 => Just(Line::Smooth),
        2 => Just(Line::Blanks),
        1 => Just(Line::Spline),
        2 => Just(Line::Status),
        1 => Just(Line::Binary),
        1 => Just(Line::Comment),
        1 => Just(Line::Empty),
        1 => Just(Line::Air),
        1 => Just(Line::MarkCut),
        1 => (1..4_u8).prop_map(Line::Speed),
    ]
}

fn program(lines: &[Line]) -> String {
    let mut text = HEAD.to_owned();
    for (i, line) in lines.iter().enumerate() {
        let (x, y, z) = (0.5 * i as f64, 40.0 - 0.02 * i as f64, 0.01 * (i % 7) as f64);
        match line {
            Line::Cut => writeln!(text, "  LIN {{X {x:.3},Y {y:.3},Z {z:.3},A 0.000,B 180.000,C 0.000}} C_DIS"),
            Line::Turned => {
                writeln!(text, "  LIN {{X {x:.3},Y {y:.3},Z {z:.3},A -{z:.4},B 179.{i:03},C 0.500}} C_DIS ; turned")
            }
            Line::Smooth => writeln!(text, "LIN {{X {x:.1},Y {y:.2},Z {z:.2},A 0,B 180,C 0}} C_VEL"),
            Line::Blanks => {
                writeln!(text, "  LIN {{X   {x:.3}, Y  {y:.3}, Z {z:.3}, A 0.000, B 180.000, C 0.000}} C_DIS")
            }
            Line::Spline => writeln!(text, "  SLIN {{X {x:.3},Y {y:.3},Z {z:.3},A 0.000,B 180.000,C 0.000}}"),
            Line::Status => {
                writeln!(text, "  LIN {{X {x:.3},Y {y:.3},Z {z:.3},A 0.000,B 180.000,C 0.000,S {},T {i}}} C_DIS", i % 8)
            }
            Line::Binary => {
                writeln!(text, "LIN {{X {x:.3},Y {y:.3},Z {z:.3},A 0,B 180,C 0, S 'B010', T 'B{:06b}' }} C_DIS", i % 64)
            }
            Line::Comment => writeln!(text, "  ; LIN {{X 1,Y 2}} is no motion"),
            Line::Empty => writeln!(text),
            Line::Air => writeln!(text, " ; deflex air"),
            Line::MarkCut => writeln!(text, ";deflex cut"),
            Line::Speed(tenths) => writeln!(text, "  $VEL.CP=0.0{tenths}"),
        }
        .unwrap();
    }
    text + TAIL
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn a_program_gives_the_same_in_chunks(
        mut lines in prop::collection::vec(line(), 20..120),
        crlf in any::<bool>(),
        chunk in 200..4000_usize,
        subdivide in prop::option::of(Just(5e-6)),
        is_driven in any::<bool>(),
        approximated in any::<bool>(),
    ) {
        let options = Options { subdivide, ..Options::default() };
        // The first chunk has to contain the direction out of the first target.
        lines.splice(0..0, [Line::Cut; 4]);
        let text = program(&lines);
        let text = if approximated { text.replacen("  PTP", "  $APO.CDIS=0.2\n  PTP", 1) } else { text };
        let text = if crlf { text.replace('\n', "\r\n") } else { text };
        let cell = if is_driven { driven() } else { cell() };
        let expected = whole(&text, &cell, &options);
        prop_assert!(expected.is_ok(), "{expected:?}");
        for threads in [1, 3] {
            let Some(came) = streamed(&text, &cell, &options, chunk, threads) else {
                return Err(TestCaseError::fail("the program goes in chunks"));
            };
            match (&came, &expected) {
                (Ok(came), Ok(expected)) => {
                    prop_assert!(came.program == expected.program, "the programs differ");
                    prop_assert_eq!(String::from_utf8_lossy(&came.report), String::from_utf8_lossy(&expected.report));
                    prop_assert_eq!((&came.said, &came.notes), (&expected.said, &expected.notes));
                }
                _ => prop_assert_eq!(&came, &expected),
            }
        }
    }
}

/// Along a track, with what leads there and what follows.
fn on_a_track(axis: impl Fn(usize) -> String) -> String {
    let mut text = HEAD.replace("A6 0}", &format!("A6 0{}}}", axis(0)));
    for i in 0..120 {
        let (x, y) = (0.5 * i as f64, 40.0 - 0.02 * i as f64);
        writeln!(text, "  LIN {{X {x:.3},Y {y:.3},Z 0.000,A 0.000,B 180.000,C 0.000{}}} C_DIS", axis(i)).unwrap();
    }
    text + &TAIL.replace("C 0}", &format!("C 0{}}}", axis(119)))
}

const TRACK: &str = "
[[unit]]
name = \"KL\"
axis = \"eax_a\"
kind = \"linear\"
carries = \"robot\"
direction = [0.0, 0.96, 0.28]
min = -2000.0
max = 2000.0
";

#[test]
fn units_that_move_or_stand_give_the_same_in_chunks() {
    let cell = Cell::read(&Source::new("cell.toml", [CELL, TRACK].concat())).unwrap();
    let moving = on_a_track(|i| format!(",S 2,T 35,E1 {:.2},E2 0.0", 10.0 + 0.5 * i as f64));
    let standing = on_a_track(|_| ",E1 150.000,E2 0.0".into());
    // The last lines of the head say where the axis stands, and so do these.
    let partly = standing.replace(
        "LIN {X 20.000,Y 39.200,Z 0.000,A 0.000,B 180.000,C 0.000,E1 150.000,E2 0.0}",
        "LIN {X 20.000,Y 39.200,Z 0.000,A 0.000,B 180.000,C 0.000}",
    );
    assert_ne!(partly, standing);
    let from_zero = on_a_track(|i| format!(",E1 {i}.0"));
    let second = on_a_track(|i| format!(",E1 100.0,E2 {}.0", i / 60));
    for subdivide in [None, Some(5e-6)] {
        let options = Options { subdivide, ..Options::default() };
        for (text, goes) in [(&moving, true), (&standing, true), (&partly, false), (&from_zero, true), (&second, true)]
        {
            let expected = whole(text, &cell, &options);
            for (chunk, threads) in [(600, 1), (1500, 3), (1 << 20, 1)] {
                let came = streamed(text, &cell, &options, chunk, threads);
                assert!(came.is_some() || !goes, "{text}");
                assert!(came.is_none_or(|came| came == expected), "{text}");
            }
        }
        assert!(whole(&moving, &cell, &options).is_ok_and(|came| came.program != moving.as_bytes()));
    }
    // Without the unit nothing is solved as if it stood at zero.
    let (own, options) = (self::cell(), Options::default());
    assert!(streamed(&moving, &own, &options, 600, 1).unwrap() == whole(&moving, &own, &options));
}

/// Frames as numbers in the program, as post-processors write them. No mass of the tool is stated, which one note says.
#[test]
fn a_tool_without_a_load_is_reported_once_in_chunks_too() {
    let text = program(&[Line::Cut; 200]);
    let text = text.replace("$BASE=BASE_DATA[2]", "$BASE={X 1100,Y -150,Z 300,A 0,B 0,C 0}");
    let text = text.replace("$TOOL=TOOL_DATA[3]", "$TOOL={X 10,Y -20,Z 200,A 0,B 0,C 0}");
    let expected = whole(&text, &cell(), &Options::default());
    assert_eq!(words(&expected).iter().filter(|said| said.contains("no-load")).count(), 1);
    assert!(expected.is_ok());
    for (chunk, threads) in [(600, 1), (600, 2), (1 << 20, 2)] {
        assert!(
            streamed(&text, &cell(), &Options::default(), chunk, threads).unwrap() == expected,
            "{chunk} {threads}"
        );
    }
}

/// Any text in the middle or at the end: read as a whole, or the same in chunks.
#[test]
fn what_only_the_whole_program_determines_is_read_whole() {
    let lines = [Line::Cut; 60];
    let text = program(&lines);
    let options = Options::default();
    assert!(streamed(&text, &cell(), &options, 600, 1).is_some_and(|came| came.is_ok()));
    let in_the_middle = |line: &str| {
        let at = text.match_indices("  LIN").nth(40).unwrap().0;
        format!("{}{line}\n{}", &text[..at], &text[at..])
    };
    let after_the_end = |line: &str| text.replace("END\n", &format!("{line}\nEND\n"));
    let mut held = 0;
    for other in [
        // Other statements, partial positions, named points, axes, status.
        in_the_middle("  $TOOL=TOOL_DATA[4]"),
        in_the_middle("  LIN {X 3}"),
        in_the_middle("  LIN XP1 C_DIS"),
        in_the_middle("  LIN {X 20,Y 40,Z 0,A 0,B 180,C 0,E1 10}"),
        in_the_middle("  LIN {X 20,Y 40,Z 0,A 0,B 180,C 0,S 2,T 3}"),
        in_the_middle("  CIRC {X 1,Y 2,Z 3},{X 20,Y 40,Z 0,A 0,B 180,C 0}"),
        in_the_middle("  FOR i=1 TO 3"),
        in_the_middle("  LIN {X 20,Y 40,Z 0,A 0,B 180,C 0} ; deflex air"),
        in_the_middle("  ; one\r  LIN {X 20,Y 40,Z 0,A 0,B 180,C 0}"),
        in_the_middle("END\nDEF other( )"),
        // What goes back, or takes numbers of the last line.
        after_the_end("  GOTO again"),
        text.replace("  LIN {X 0,Y 0,Z 120,A 0,B 180,C 0}", "  LIN {Z 120}"),
        text.replace("  $BASE=", "again:\n  $BASE="),
        text.replace("END\n", "END\nDEF other( )\nEND\n"),
        text.replace("  PTP {A1 0", "  PTP {E1 100,A1 0"),
    ] {
        match streamed(&other, &cell(), &options, 600, 1) {
            Some(came) => assert!(came == whole(&other, &cell(), &options), "{other}"),
            None => held += 1,
        }
    }
    assert!(held > 8, "{held}");
}
