//! Programs in chunks against the same programs as a whole: the same bytes, the same words.

use crate::streamed::{self, Came, in_chunks, words};
use deflex::cell::Cell;
use deflex::correct::{Options, Sinks, StreamError, choose_turns, compensate_chunks, predict, predict_chunks};
use deflex::program::AnyChunks;
use deflex::program::rapid::{self, Chunks};
use deflex::report::{CSV_HEADER, csv_rows, write_csv};
use deflex::text::Source;
use proptest::prelude::*;
use std::fmt::Write;
use std::io::Cursor;

const CELL: &str = r#"
[robot]
model = "an arm with room to turn"
start_deg = [0, 0, 0, 0, 60, 0]
[robot.kinematics]
parallelogram = false
links = [
  { alpha_deg = 0.0, a_mm = 0.0, d_mm = 780.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 320.0, d_mm = 0.0, theta_deg = -90.0 },
  { alpha_deg = 0.0, a_mm = 1075.0, d_mm = 0.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 200.0, d_mm = 1142.5, theta_deg = 0.0 },
  { alpha_deg = 90.0, a_mm = 0.0, d_mm = 0.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 0.0, d_mm = 200.0, theta_deg = 180.0 },
]
axis_min_deg = [-360, -360, -360, -360, -360, -360]
axis_max_deg = [360, 360, 360, 360, 360, 360]
[robot.stiffness]
joint_nm_per_rad = [3.8e6, 6.6e6, 3.9e6, 5.6e5, 6.6e5, 4.7e5]
[limits]
max_correction_mm = 5.0
max_step_mm = 1.0
[controller]
compensates = []
[cut]
force = "mechanistic"
[cut.cutter]
diameter_mm = 20.0
corner_radius_mm = 2.0
teeth = 4
helix_deg = 30.0
[cut.engagement]
mode = "slot"
depth_mm = 2.0
width_mm = 20.0
feed_per_tooth_mm = 0.1
lead_deg = 5.0
tilt_deg = 0.0
[cut.coefficients]
ktc_n_mm2 = 800.0
krc_n_mm2 = 300.0
kac_n_mm2 = 150.0
kte_n_mm = 10.0
kre_n_mm = 10.0
kae_n_mm = 2.0
[[effect]]
kind = "backlash"
half_gap_rad = [1e-5, 2e-5, 2e-5, 3e-5, 3e-5, 5e-5]
[[effect]]
kind = "gravity"
mass_kg = [0, 200, 150, 60, 30, 10]
first_moment_kg_m = [[0, 0, 0], [100, 0, 0], [30, 60, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
tool = true
[[effect]]
kind = "tool_wear"
per_m = 0.02
[[effect]]
kind = "tracking_lag"
time_s = 0.001
"#;

const HEAD: &str = "MODULE Mill
  PERS tooldata tMill:=[TRUE,[[321.5,0,148.25],[0.70710678,0,0.70710678,0]],[38,[90,0,60],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[1600,-200,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PROC main()
    ConfL\\Off;
";

fn cell(text: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", text.as_bytes())).unwrap()
}

fn whole(text: &str, cell: &Cell, options: &Options) -> Came {
    let program = rapid::read(vec![Source::new("part.mod", text.as_bytes())], Vec::new())?;
    streamed::whole(&program, cell, options)
}

/// Bytes of a chunk in these tests: a quarter of what the command line reads at once, so that a short program has several chunks.
const CHUNK: usize = rapid::CHUNK / 4;

/// The program in chunks of [`CHUNK`] bytes; `None` where it is not straight.
fn chunks(text: &str) -> Option<Chunks<Cursor<&[u8]>>> {
    Chunks::sized("part.mod", Cursor::new(text.as_bytes()), &[], CHUNK).unwrap()
}

/// `None` where the program is not straight.
fn streamed(text: &str, cell: &Cell, options: &Options, threads: usize) -> Option<Came> {
    let turns = if options.free_spin { choose_turns(chunks(text)?, cell, options) } else { Ok(None) };
    let options = &match turns {
        Ok(turns) => Options { turns, ..options.clone() },
        Err(StreamError::Refused(refused)) => return Some(Err(refused)),
        Err(_) => return None,
    };
    let chunks = chunks(text)?;
    in_chunks(|program, sinks| compensate_chunks(chunks, cell, options, threads, program, sinks))
}

fn agree(text: &str, cell: &Cell, options: &Options) -> Result<(), TestCaseError> {
    let expected = whole(text, cell, options);
    for threads in [1, 3] {
        let Some(came) = streamed(text, cell, options, threads) else {
            // Where the driven path cannot be computed, the program is read as a whole, which says why.
            let has_no_path = |said: &str| cell.controller.path.is_some() && said.ends_with(" None");
            if expected.as_ref().is_ok_and(|whole| has_no_path(&whole.said) && !whole.notes.is_empty()) {
                return Ok(());
            }
            return Err(TestCaseError::fail("the program is straight"));
        };
        prop_assert_eq!(words(&came), words(&expected));
        prop_assert_eq!(came.is_ok(), expected.is_ok());
        if let (Ok(came), Ok(expected)) = (&came, &expected) {
            prop_assert!(came.program == expected.program, "the programs differ");
            prop_assert!(came.report == expected.report, "the reports differ");
            prop_assert_eq!(&came.said, &expected.said);
        }
    }
    Ok(())
}

/// A line of a program, as far as it matters where it is cut.
#[derive(Clone, Copy, Debug)]
enum Line {
    Cut,
    Slow,
    Joint,
    AbsoluteJoint,
    Still,
    Comment,
    Blank,
    Mark(bool),
    Harmless,
    Wait,
}

fn line() -> impl Strategy<Value = Line> {
    prop_oneof![
        40 => Just(Line::Cut),
        4 => Just(Line::Slow),
        1 => Just(Line::Joint),
        1 => Just(Line::AbsoluteJoint),
        2 => Just(Line::Still),
        2 => Just(Line::Comment),
        1 => Just(Line::Blank),
        1 => any::<bool>().prop_map(Line::Mark),
        1 => Just(Line::Harmless),
        1 => Just(Line::Wait),
    ]
}

fn program(lines: &[Line], ends: &str) -> String {
    let mut text = HEAD.to_owned();
    let mut x = 0.0_f64;
    for line in lines {
        let turn = 0.002 * (0.01 * x).sin();
        // There and back again, within reach.
        let along = 600.0 - (x % 1200.0 - 600.0).abs();
        let pose = format!(
            "[[{along:.3},{:.3},{:.2}],[{:.8},{:.8},0,0.10760048],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
            20.0 * (0.013 * x).sin(),
            40.0 + 10.0 * (0.007 * x).cos(),
            turn,
            (1.0 - turn * turn - 0.107_600_48_f64.powi(2)).sqrt(),
        );
        match line {
            Line::Cut | Line::Slow | Line::Joint => x += 0.35,
            _ => {}
        }
        let written = match line {
            Line::Cut => write!(text, "    MoveL {pose},v50,z1,tMill\\WObj:=wPart;"),
            Line::Slow => write!(text, "  MoveL {pose}, v20, fine, tMill \\WObj:=wPart;  "),
            Line::Joint => write!(text, "    MoveJ {pose},v100,z1,tMill\\WObj:=wPart;"),
            Line::Still => write!(text, "    MoveL {pose},v50,z0,tMill\\WObj:=wPart;"),
            Line::AbsoluteJoint => {
                // A marked cut would be one there too.
                write!(
                    text,
                    "    ! deflex air\n    MoveAbsJ [[0,20,10,10,40,20],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tMill;"
                )
            }
            Line::Comment => write!(text, "    ! layer; at {x}"),
            Line::Blank => Ok(()),
            Line::Mark(air) => write!(text, "    ! deflex {}", if *air { "air" } else { "cut" }),
            Line::Harmless => write!(text, "    SetDO doCoolant,1;"),
            Line::Wait => write!(text, "    WaitTime 0.2;"),
        };
        written.unwrap();
        text.push('\n');
    }
    text.push_str("  ENDPROC\nENDMODULE\n");
    text.replace('\n', ends)
}

/// Lines that fill some chunks.
const SOME_CHUNKS: std::ops::Range<usize> = 3 * CHUNK / 140..5 * CHUNK / 140;

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn any_straight_program_gives_the_same_in_chunks(
        lines in proptest::collection::vec(line(), SOME_CHUNKS),
        crlf in any::<bool>(),
        subdivide in prop::option::of(Just(5e-6)),
    ) {
        let options = Options { subdivide, ..Options::default() };
        // Lead in and out of marks and stops steps the correction: not what this is about.
        let cell = cell(&CELL.replace("max_step_mm = 1.0", "max_step_mm = 5.0"));
        let text = program(&lines, if crlf { "\r\n" } else { "\n" });
        // Targets stand closer to what is inserted than a zone is wide, and a first cut may begin anywhere: both are said.
        let said = words(&whole(&text, &cell, &options));
        let expected = |said: &String| ["subdivide.zone", "target.kept"].iter().any(|code| said.contains(code));
        prop_assert!(said.iter().all(expected), "{:?}", said);
        agree(&text, &cell, &options)?;
    }

    #[test]
    fn the_driven_path_is_the_same_in_chunks(
        lines in proptest::collection::vec(line(), SOME_CHUNKS),
        subdivide in prop::option::of(Just(5e-6)),
        acceleration in prop_oneof![Just("8000.0"), Just("20.0")],
        planning in any::<bool>(),
    ) {
        let law = law(acceleration) + if planning { "planning_s = 0.005\n" } else { "" };
        let cell = cell(&CELL.replace("max_step_mm = 1.0", "max_step_mm = 5.0").replace("compensates = []\n", &law));
        agree(&program(&lines, "\n"), &cell, &Options { subdivide, ..Options::default() })?;
    }
}

/// The law of a controller, for the acceleration along the path, mm/s².
fn law(acceleration: &str) -> String {
    format!(
        "compensates = []
[controller.path]
zone_share = 0.87
smoothing_s = [0.058, 0.04]
axis_lead_s2 = [4e-4, 2e-4, 4e-4, 1e-4, 3e-4, 1e-4]
acceleration_mm_s2 = {acceleration}
corner_acceleration_mm_s2 = 4000.0
"
    )
}

#[test]
fn a_prediction_along_the_driven_path_is_the_same_in_chunks() {
    let cell = cell(&CELL.replace("compensates = []\n", &law("8000.0")));
    let lines: Vec<Line> = (0..SOME_CHUNKS.start).map(|i| if i % 97 == 0 { Line::Slow } else { Line::Cut }).collect();
    let text = program(&lines, "\n");
    let whole = rapid::read(vec![Source::new("part.mod", text.as_bytes())], Vec::new()).unwrap();
    let expected = predict(&whole, &cell, &Options::default(), None).unwrap();
    assert!(expected.driven.is_some_and(|driven| driven.programmed.max_mm > 0.0));
    let mut rows = Vec::new();
    write_csv(&expected.rows, &mut rows).unwrap();
    for threads in [1, 3] {
        let chunks = AnyChunks::Inline(Box::new(chunks(&text).unwrap()));
        let mut report = CSV_HEADER.as_bytes().to_vec();
        let mut sinks =
            Sinks { report: &mut report, rows: &|rows| csv_rows(rows), each: &mut |_| (), progress: &|_, _| () };
        let came = predict_chunks(chunks, None, &cell, &Options::default(), threads, None, &mut sinks).unwrap();
        assert_eq!((came.driven, &came.notes), (expected.driven, &expected.notes));
        assert!(report == rows, "the reports differ");
    }
}

#[test]
fn refusals_and_failures_are_reported_alike() {
    // So many that the path ends out of reach.
    let lines = vec![Line::Cut; 4 * SOME_CHUNKS.start];
    let text = program(&lines, "\n");
    // Out of reach from somewhere on; corrections beyond the limit everywhere; a force without a stiffness.
    let far = text.replace("40.000", "2840.000").replace(",-0.0", ",1900.0");
    let stiffness = "[robot.stiffness]\njoint_nm_per_rad = [3.8e6, 6.6e6, 3.9e6, 5.6e5, 6.6e5, 4.7e5]\n";
    for (text, cell) in [
        (&far, cell(CELL)),
        (&text, cell(&CELL.replace("max_correction_mm = 5.0", "max_correction_mm = 0.3"))),
        (&text, cell(&CELL.replace(stiffness, ""))),
        (&text.replace("tMill\\WObj", "tOther\\WObj"), cell(CELL)),
    ] {
        let expected = whole(text, &cell, &Options::default());
        assert!(expected.is_err());
        let came = streamed(text, &cell, &Options::default(), 3).unwrap();
        let (came, expected) = (words(&came), words(&expected));
        // A tool that is missing is missing in every chunk; more than a thousand messages are only counted.
        assert_eq!(came.iter().take(1).collect::<Vec<_>>(), expected.iter().take(1).collect::<Vec<_>>());
        if !came[0].contains("tOther") && expected.len() <= 1000 {
            assert_eq!(came, expected);
        }
    }
}

#[test]
fn what_only_the_whole_program_determines_is_not_streamed() {
    let text = program(&[Line::Cut; SOME_CHUNKS.start], "\n");
    let cell = cell(CELL);
    assert_eq!(words(&streamed(&text, &cell, &Options::default(), 2).unwrap()), Vec::<String>::new());
    let pose = "[[0,0,40],[0,0.99419421,0,0.10760048],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
    let late = |statement: &str| text.replace("  ENDPROC", &format!("    {statement}\n  ENDPROC"));
    let early = |data: &str| text.replace("  PROC main", &format!("  {data}\n  PROC main"));
    let declared = early(&format!("CONST robtarget p1:={pose};"));
    let programs = [
        late("nParts:=nParts+1;"),
        late("Finish;"),
        late("IF diStop=1 THEN\n Stop;\n ENDIF"),
        late("PDispOn tMill;"),
        late(&format!("MoveL Offs({pose},0,0,5),v50,z1,tMill\\WObj:=wPart;")),
        late(&format!("MoveC {pose},{pose},v50,z1,tMill\\WObj:=wPart;")),
        declared.replace("  ENDPROC", "    MoveL p1,v50,z1,tMill\\WObj:=wPart;\n  ENDPROC"),
        text.replace("ENDMODULE", "  PROC more()\n  ENDPROC\nENDMODULE"),
        text.replace("ENDMODULE", "ENDMODULE\nMODULE B\nENDMODULE"),
        text.replace("    ConfL", "    WHILE TRUE DO\n    ConfL"),
    ];
    for program in &programs {
        assert!(streamed(program, &cell, &Options::default(), 2).is_none(), "{}", &program[program.len() - 300..]);
    }
}

/// An external axis that the program uses late, and the cell has no unit for.
#[test]
fn loads_that_are_not_weighed_are_reported_alike() {
    let heavy = cell(CELL);
    let text = program(&[Line::Cut; SOME_CHUNKS.start], "\n");
    let gripped = text.replacen("  PROC main()\n", "  PROC main()\n    GripLoad tMillLoad;\n", 1);
    let own = text.replace(",tMill\\WObj:=wPart", ",tMill\\WObj:=wPart\\TLoad:=tMillLoad");
    for text in [gripped, own] {
        let notes = whole(&text, &heavy, &Options::default()).unwrap().notes;
        assert_eq!(notes.iter().filter(|note| note.code == "rapid.load").count(), 1);
        assert!(streamed(&text, &heavy, &Options::default(), 2).is_some(), "it streams");
        agree(&text, &heavy, &Options::default()).unwrap();
    }
    let later = text.replacen("  ENDPROC", "    GripLoad tMillLoad;\n  ENDPROC", 1);
    assert!(streamed(&later, &heavy, &Options::default(), 2).is_none());
}

#[test]
fn an_axis_without_a_unit_is_kept_alike() {
    let text = program(&[Line::Cut; SOME_CHUNKS.start], "\n");
    let target = "[[0,0,40],[0,0.99419421,0,0.10760048],[0,-1,0,0],[9E9,9E9,9E9,9E9,100,9E9]]";
    let motion = format!("    MoveL {target},v50,z1,tMill\\WObj:=wPart;\n  ENDPROC");
    let text = text.replace("  ENDPROC", &motion);
    let cell = cell(&CELL.replace("max_step_mm = 1.0", "max_step_mm = 5.0"));
    agree(&text, &cell, &Options::default()).unwrap();
    let came = whole(&text, &cell, &Options::default());
    assert!(String::from_utf8(came.unwrap().program).unwrap().contains(target), "it stays as it is");
}

/// A wave, `count` targets 0.05 mm apart.
fn wave(count: usize) -> String {
    let mut text = HEAD.to_owned();
    for i in 0..count {
        let (x, lean) = (0.05 * i as f64, 0.2 * (0.01 * i as f64).sin());
        let (motion, zone) = if i == 0 { ("MoveJ", "fine") } else { ("MoveL", "z1") };
        writeln!(
            text,
            "    {motion} [[{x:.3},{:.3},100.000],[0,{:.8},0,{:.8}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,{zone},tMill\\WObj:=wPart;",
            3.0 * lean,
            (0.5 * (1.8 + lean)).sin(),
            (0.5 * (1.8 + lean)).cos(),
        )
        .unwrap();
    }
    text + "  ENDPROC\nENDMODULE\n"
}

#[test]
fn free_turns_are_chosen_over_all_chunks() {
    let limits = "axis_max_deg = [360, 360, 360, 180, 360, 180]\n";
    let cell = cell(&CELL.replace("axis_max_deg = [360, 360, 360, 360, 360, 360]\n", limits));
    let options = Options { free_spin: true, ..Options::default() };
    let text = wave(1_100);
    assert!(text.len() > 2 * CHUNK);
    agree(&text, &cell, &options).unwrap();
    let notes = whole(&text, &cell, &options).unwrap().notes;
    assert!(notes.iter().any(|note| note.code == "spin.chosen"));
    // Where no turn can be taken is said with its place, if without the line.
    let nowhere = text.replace("[[5.000,", "[[9000.000,");
    let refused = |came: Came| came.unwrap_err().iter().map(ToString::to_string).collect::<Vec<_>>();
    let came = refused(streamed(&nowhere, &cell, &options, 1).unwrap());
    assert!(came.len() == 1 && came[0].starts_with("part.mod:106:"), "{came:?}");
    assert_eq!(came, refused(whole(&nowhere, &cell, &options)));
    // Unless the turns are chosen already, they can only be chosen along the whole.
    let mut sinks = Sinks { report: &mut Vec::new(), rows: &|_| Vec::new(), each: &mut |_| (), progress: &|_, _| () };
    let chunks = chunks(&text).unwrap();
    let came = compensate_chunks(chunks, &cell, &options, 1, &mut Vec::new(), &mut sinks);
    assert!(matches!(came, Err(StreamError::NotStreamable)));
}
