//! CL files in chunks against the same files as a whole: the same targets, the same posted bytes, the same words.

use deflex::cell::Cell;
use deflex::correct::{
    Options, Outline, PostOptions, Poster, Sinks, StreamError, Streamed, choose_turns, compensate, post, post_chunks,
};
use deflex::program::cl::{self, Chunks, ClOptions};
use deflex::program::{Language, Next, Program};
use deflex::report::html::PathKind;
use deflex::report::{CSV_HEADER, FileSummary, csv_rows, summary_line, write_csv};
use deflex::text::{Diagnostic, Source, Span};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Mutex;

const CELL: &str = include_str!("../../benches/cell.toml");

/// Lines for actions of the machine other than motions.
const POST: &str = "[cl.post]\ntool_change = \"rTool {number};\"\nhome = \"rHome;\"\nspindle_off = \"rOff;\"\n";

fn cell(text: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", text.as_bytes())).unwrap()
}

fn options(cell: &Cell) -> &ClOptions {
    &cell.cl.as_ref().unwrap().options
}

/// A record, as far as it matters where it is cut; in a raster of 0.1 mm.
#[derive(Clone, Copy, Debug)]
enum Line {
    Straight,
    Tilted,
    Continued,
    CutNumber,
    List,
    Step,
    AlongAxis,
    Arc,
    ListedArc,
    OpenArc,
    TangentArc,
    Rapid,
    RapidAndMore,
    Feed(u8),
    Spindle(bool),
    Inch(bool),
    Frame(bool),
    Mark(bool),
    From,
    Axis,
    Cutter,
    Holes,
    Machine(u8),
    ReversedArc,
    Normal,
    Comment,
    Blank,
    Unknown,
}

fn line() -> impl Strategy<Value = Line> {
    prop_oneof![
        8 => Just(Line::Straight),
        8 => Just(Line::Tilted),
        2 => prop_oneof![Just(Line::Continued), Just(Line::CutNumber), Just(Line::List), Just(Line::Step), Just(Line::AlongAxis)],
        2 => prop_oneof![9 => Just(Line::Arc), 9 => Just(Line::ListedArc), 1 => Just(Line::OpenArc), 9 => Just(Line::TangentArc)],
        1 => prop_oneof![Just(Line::Rapid), Just(Line::RapidAndMore), (1..9_u8).prop_map(Line::Feed)],
        1 => prop_oneof![Just(Line::From), Just(Line::Axis), Just(Line::Cutter)],
        1 => prop_oneof![
            any::<bool>().prop_map(Line::Spindle),
            any::<bool>().prop_map(Line::Inch),
            any::<bool>().prop_map(Line::Frame),
            any::<bool>().prop_map(Line::Mark),
        ],
        1 => prop_oneof![Just(Line::Comment), Just(Line::Blank), Just(Line::Unknown)],
        2 => prop_oneof![Just(Line::Holes), (0..6_u8).prop_map(Line::Machine), Just(Line::ReversedArc), Just(Line::Normal)],
    ]
}

/// The file of these records; every line a tenth of a millimetre further.
fn file(lines: &[Line], ends: &str) -> String {
    let mut text =
        String::from("$$ made for a test\nUNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,40,0,0,1\nGOTO/1,0,40,0,0,1\n");
    for (i, line) in lines.iter().enumerate() {
        let (x, next) = (1.0 + 0.1 * i as f64, 1.1 + 0.1 * i as f64);
        let on = |on: bool| if on { "ON" } else { "OFF" };
        text += &match line {
            Line::Straight => format!("GOTO/{x:.3},{:.3},40.125", 0.01 * x),
            Line::Tilted => format!("GOTO / {x:.4}, 0.5000, 40.0000, 0.100000, 0.000000, 0.994987"),
            Line::Continued => format!("GOTO/{x:.3}, $\n  0.25, $ and so on\n 40"),
            Line::CutNumber => format!("GOTO/{x:.3},0.1$\n25,40.0"),
            Line::List => format!("GOTO/{x:.3},0,40,{:.3},0,40,{:.3},0,40", x + 0.02, x + 0.04),
            Line::Step => "GODLTA/0.05,0.02,0".to_owned(),
            Line::AlongAxis => "GODLTA/0.05".to_owned(),
            Line::Arc => {
                format!("GOTO/{x:.4},0,40\nCIRCLE/{x:.4},2,40,0,0,1,2\n$$ between\nFEDRAT/500,MMPM\nGOTO/{:.4},4,40", x)
            }
            Line::ListedArc => {
                format!("GOTO/{x:.4},0,40\nCIRCLE/{x:.4},2,40,0,0,1,2\nGOTO/{:.4},2,40,{x:.4},4,40", x + 2.0)
            }
            Line::OpenArc => "CIRCLE/0,2,40,0,0,1,2".to_owned(),
            Line::TangentArc => format!(
                "GOTO/{x:.4},0,40\nINDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/{x:.4},2,40,$\n2),ON,(LINE/{x:.4},2,40,{:.4},2,40)",
                x + 2.0
            ),
            Line::Rapid => "RAPID".to_owned(),
            Line::RapidAndMore => format!("RAPID, GOTO/{next:.3},0,41"),
            Line::Feed(feed) => format!("FEDRAT/{},MMPM", 100 * u32::from(*feed)),
            Line::Spindle(is) => format!("SPINDL/{}", on(*is)),
            Line::Inch(is) => format!("UNITS/{}", if *is { "INCHES" } else { "MM" }),
            Line::Frame(is) => format!("MSYS/0,0,{},1,0,0,0,1,0", u8::from(*is)),
            Line::Mark(cut) => format!("PPRINT/DEFLEX {}", if *cut { "CUT" } else { "AIR" }),
            Line::From => format!("FROM/{x:.3},0,41"),
            Line::Axis => "TLAXIS/0.1,0,0.994987".to_owned(),
            Line::Cutter => "CUTTER/12.0,2.0".to_owned(),
            Line::Holes => format!(
                "CYCLE/DEEP,DEPTH,0.5,STEP,0.2,CLEAR,0.1,DWELL,1\nGOTO/{x:.3},0,40\nGOTO/{next:.3},0,40\nCYCLE/OFF"
            ),
            Line::Machine(what) => ["STOP", "DELAY/2", "COOLNT/ON", "SPINDL/OFF", "LOADTL/4", "GOHOME\nRAPID"]
                [usize::from(*what)]
            .to_owned(),
            Line::ReversedArc => {
                format!("GOTO/{x:.4},0,40\nCIRCLE/{x:.4},2,40,0,0,1,2\nGOTO/{:.4},2,40,{x:.4},4,40", x - 2.0)
            }
            Line::Normal => format!("GOTO/{x:.3},0,40,0,0,1,0,0.1,0.994987"),
            Line::Comment => format!("$$ at {x}; GOTO/1,2,3"),
            Line::Blank => String::new(),
            Line::Unknown => "SOMETHING/ELSE,1".to_owned(),
        };
        text.push('\n');
    }
    text += "FINI\n";
    text.replace('\n', ends)
}

fn ends() -> impl Strategy<Value = &'static str> {
    prop_oneof![Just("\n"), Just("\r\n"), Just("\r"), Just("\r\r\n"), Just("\n\n")]
}

/// Targets without their places, and what the text says at these.
fn targets(program: Program) -> Vec<(deflex::program::Target, String)> {
    let source = &program.sources[0];
    let text = |target: &deflex::program::Target| {
        let place = source.line_column(target.span.start as usize);
        assert_eq!(place.line, target.line as usize, "the line is that of the span");
        format!("{}: {}", place.column, source.text(target.span))
    };
    let placed = program.targets.iter().map(text).collect::<Vec<_>>();
    let mut targets = program.targets;
    targets.iter_mut().for_each(|target| target.span = Span::default());
    targets.into_iter().zip(placed).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn a_file_reads_the_same_in_chunks_of_any_size(
        lines in prop::collection::vec(line(), 0..60),
        ends in ends(),
        size in 1..700_usize,
    ) {
        let (cell, text) = (cell(CELL), file(&lines, ends));
        let whole = cl::read(Source::new("part.apt", text.as_bytes()), options(&cell)).unwrap();
        let (kept, warnings) = (whole.kept.iter().map(|k| (k.line, k.reason)).collect::<Vec<_>>(), whole.diagnostics.clone());
        let mut chunks = Chunks::sized("part.apt", text.as_bytes(), options(&cell), size).unwrap().unwrap();
        let (mut came, mut came_kept, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
        while let Next::Chunk(chunk) = chunks.take().unwrap() {
            prop_assert!(!bytes.is_empty() || !chunk.program.targets.is_empty());
            bytes.extend_from_slice(&chunk.program.sources[0].bytes);
            came_kept.extend(chunk.program.kept.iter().map(|k| (k.line, k.reason)));
            came.extend(targets(chunk.program));
            prop_assert_eq!(chunk.last, bytes.len() == text.len());
        }
        prop_assert_eq!(came, targets(whole));
        prop_assert_eq!(came_kept, kept);
        prop_assert_eq!(chunks.warnings(), warnings);
        prop_assert_eq!(bytes, text.as_bytes());
    }
}

/// What a run gives: files, report, summary, what is said.
type Came = Result<(BTreeMap<String, Vec<u8>>, Vec<u8>, String, Vec<Diagnostic>), Vec<Diagnostic>>;

fn posting(max_targets: Option<usize>) -> PostOptions {
    PostOptions {
        name: "part".to_owned(),
        title: vec!["a test".to_owned()],
        max_targets,
        rapid_mm_s: 500.0,
        feed_mm_s: None,
        language: Language::Rapid,
    }
}

fn whole(text: &str, cell: &Cell, most: Option<usize>, corrects: &Options) -> Came {
    let program = cl::read(Source::new("part.apt", text.as_bytes()), options(cell))?;
    let corrected = compensate(&program, cell, corrects)?;
    if !corrected.failures.is_empty() {
        return Err(corrected.failures);
    }
    let posted = post(&program, cell, &corrected, &posting(most))?;
    let mut report = Vec::new();
    write_csv(&corrected.rows, &mut report).unwrap();
    let notes = [corrected.notes.clone(), posted.notes].concat();
    Ok((
        posted.files.into_iter().collect(),
        report,
        summary_line(&FileSummary::new("", &corrected), PathKind::Compensate),
        notes,
    ))
}

/// A file of a posted program.
struct InMemory<'a>(String, &'a Mutex<BTreeMap<String, Vec<u8>>>);

impl Write for InMemory<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.1.lock().unwrap().entry(self.0.clone()).or_default().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// `None` where the file is read whole.
fn streamed(
    text: &str,
    cell: &Cell,
    most: Option<usize>,
    corrects: &Options,
    size: usize,
    threads: usize,
) -> Option<Came> {
    let chunks = || Chunks::sized("part.apt", text.as_bytes(), options(cell), size).unwrap();
    let outline = match Outline::of_chunks(chunks()?, |_, _| ()) {
        Err(StreamError::NotStreamable) => return None,
        Err(StreamError::Refused(faults)) => return Some(Err(faults)),
        outline => outline.unwrap(),
    };
    let poster = match Poster::new(outline, cell, &posting(most)) {
        Ok(poster) => poster,
        Err(errors) => return Some(Err(errors)),
    };
    let turns = match choose_turns(chunks()?, cell, corrects) {
        Ok(turns) => turns,
        Err(StreamError::Refused(refused)) => return Some(Err(refused)),
        Err(_) => return None,
    };
    let corrects = &Options { turns, ..corrects.clone() };
    let (files, mut report) = (Mutex::default(), CSV_HEADER.as_bytes().to_vec());
    let mut sinks =
        Sinks { report: &mut report, rows: &|rows| csv_rows(rows), each: &mut |_| (), progress: &|_, _| () };
    let open = |name: &str| Ok(InMemory(name.to_owned(), &files));
    let done = post_chunks(chunks()?, cell, corrects, threads, &poster, open, &mut sinks);
    Some(match done {
        Ok(Streamed { summary, failures, notes, .. }) if failures.is_empty() => {
            let files = files.into_inner().unwrap();
            assert_eq!(files.len(), poster.files());
            Ok((files, report, summary_line(&FileSummary::of("", &summary, &[]), PathKind::Compensate), notes))
        }
        Ok(Streamed { failures, .. }) | Err(StreamError::Refused(failures)) => Err(failures),
        Err(StreamError::NotStreamable) => return None,
        Err(error) => panic!("{error:?}"),
    })
}

fn words(came: &Came) -> Vec<String> {
    let said = match came {
        Ok((.., notes)) => notes,
        Err(errors) => errors,
    };
    said.iter().map(|d| format!("{d} {:?}", d.snippet)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

    #[test]
    fn a_file_is_posted_the_same_in_chunks_of_any_size(
        lines in prop::collection::vec(line(), 10..60),
        size in 1..2000_usize,
        most in prop::option::of(1..60_usize),
        threads in 1..4_usize,
        tight in prop::bool::weighted(0.2),
        subdivide in prop::option::of(Just(5e-6)),
    ) {
        let corrects = Options { subdivide, ..Options::default() };
        // The number of parts follows from the inserted targets.
        let most = most.filter(|_| subdivide.is_none());
        // The correction steps on random paths. Limits refuse some of them, and both ways must report the same.
        let cell = CELL.replace("max_step_mm = 1.0", if tight { "max_step_mm = 0.05" } else { "max_step_mm = 5.0" });
        let text = file(&lines, "\n");
        let cell = self::cell(&format!("{}\n{POST}", cell));
        let (came, expected) = (streamed(&text, &cell, most, &corrects, size, threads), whole(&text, &cell, most, &corrects));
        let came = came.ok_or_else(|| TestCaseError::fail("the file is streamed"))?;
        prop_assert_eq!(words(&came), words(&expected));
        prop_assert_eq!(came.is_ok(), expected.is_ok());
        if let (Ok(came), Ok(expected)) = (&came, &expected) {
            prop_assert!(came.0 == expected.0, "the programs differ");
            let rows = |report: &[u8]| String::from_utf8_lossy(report).lines().map(str::to_owned).collect::<Vec<_>>();
            // What is left on the way into the first target of a chunk is known from one direction less.
            const SAME_WAY_MM: f64 = 1e-4;
            let way_column = CSV_HEADER.split(',').position(|name| name == "remaining_path_mm").unwrap();
            let apart = |row: &str| {
                let mut fields: Vec<String> = row.split(',').map(str::to_owned).collect();
                let way = std::mem::take(fields.get_mut(way_column)?);
                Some((fields.join(","), way.parse().unwrap_or(0.0)))
            };
            prop_assert_eq!(&came.2, &expected.2);
            let (came, expected) = (rows(&came.1), rows(&expected.1));
            prop_assert_eq!(came.len(), expected.len());
            for (came, expected) in came.iter().zip(&expected) {
                let ((row, way), (whole, way_whole)): ((_, f64), (_, f64)) = (apart(came).unwrap(), apart(expected).unwrap());
                prop_assert!(row == whole && (way - way_whole).abs() < SAME_WAY_MM, "the reports differ: {} {}", came, expected);
            }
        }
    }
}

#[test]
fn what_only_the_whole_program_determines_is_read_whole() {
    let cell = cell(CELL);
    let text = file(&[Line::Tilted; 40], "\n");
    assert!(streamed(&text, &cell, None, &Options::default(), 300, 2).unwrap().is_ok());
    let card = |line: &str| format!("{line:<72}{:08}\n", 1);
    let files = [
        text.replace("GOTO/0,0,40,0,0,1\n", "P1=POINT/0,0,0\n").replace("GOTO", "GOLFT/P1,PAST,P2 $$"),
        text.lines().map(card).collect(),
        "nothing of the kind\n".repeat(20),
    ];
    for file in &files {
        assert!(streamed(file, &cell, None, &Options::default(), 300, 2).is_none(), "{}", &file[..200]);
    }
}

#[test]
fn a_file_without_feed_or_unit_or_tool_is_refused_alike() {
    let text = file(&[Line::Tilted; 40], "\n");
    let without = |line: &str| text.replace(line, "");
    for (text, cell) in [
        (without("FEDRAT/600,MMPM\n"), cell(CELL)),
        (text.clone(), cell(&CELL.replace("[tools.tMill]", "[tools.tOther]"))),
        (text.replace("1.5000,", "9999.5,"), cell(CELL)),
    ] {
        let (came, expected) = (
            streamed(&text, &cell, None, &Options::default(), 300, 2).unwrap(),
            whole(&text, &cell, None, &Options::default()),
        );
        assert!(expected.is_err());
        assert_eq!(words(&came), words(&expected));
    }
    let no_unit = cell(&CELL.replace("units = \"mm\"\n", ""));
    assert!(
        streamed(&without("UNITS/MM\n"), &no_unit, None, &Options::default(), 300, 2).is_none(),
        "the reader of the whole text reports it"
    );
}

#[test]
fn free_turns_are_chosen_over_all_chunks() {
    let lines: Vec<Line> = (0..60).map(|i| if i % 7 == 0 { Line::Tilted } else { Line::Straight }).collect();
    let text = file(&lines, "\n");
    let stiffest = CELL.replace("spin = \"fixed\"", "spin = \"stiffest\"");
    assert_ne!(stiffest, CELL);
    let cell = cell(&stiffest);
    let expected = whole(&text, &cell, None, &Options::default()).unwrap();
    assert!(expected.3.iter().any(|note| note.code == "spin.chosen"));
    for (size, threads) in [(100, 1), (700, 2), (2_000, 3), (1 << 20, 1)] {
        let came = streamed(&text, &cell, None, &Options::default(), size, threads).unwrap().unwrap();
        assert!(came == expected, "chunks of {size} bytes on {threads} threads");
    }
}
