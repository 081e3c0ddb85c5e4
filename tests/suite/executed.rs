//! RAPID programs that are run again for each use of their chunks, against the same programs held as a whole.

use super::second_reading::compare::CELL;
use super::second_reading::generate;
use deflex::cell::Cell;
use deflex::correct::{Options, Sinks, StreamError, compensate, compensate_executed, predict, predict_chunks};
use deflex::program::AnyChunks;
use deflex::program::rapid::{self, Executed};
use deflex::report::{CSV_HEADER, csv_rows, write_csv};
use deflex::text::{Diagnostic, Source, applied};
use std::io::Cursor;

/// Corrections that depend on the way into a target, and on the start of an arc: runs of one motion may not agree.
fn cell() -> Cell {
    let text = CELL.replace("frame = \"wobj\"", "frame = \"feed\"").replace("arc_turn = \"circle_point\"\n", "");
    assert_eq!(text.len(), CELL.len() - "arc_turn = \"circle_point\"\n".len());
    Cell::read(&Source::new("cell.toml", text)).unwrap()
}

/// Programs, report and what is said, or why there is none.
type Came = Result<(Vec<String>, String, Vec<String>), Vec<String>>;

fn said(diagnostics: &[Diagnostic]) -> Vec<String> {
    let mut all: Vec<String> = diagnostics.iter().map(|d| format!("{d} {:?}", d.snippet)).collect();
    all.sort();
    all
}

fn sources(modules: &[String]) -> Vec<Source> {
    modules.iter().enumerate().map(|(i, text)| Source::new(format!("m{i}.mod"), text.as_bytes())).collect()
}

fn edited(sources: &[Source], edits: &[Vec<deflex::text::Edit>]) -> Vec<String> {
    let text = |(source, edits): (&Source, &Vec<_>)| {
        let bytes = applied(&source.bytes, edits);
        String::from_utf8(bytes).unwrap()
    };
    sources.iter().zip(edits).map(text).collect()
}

fn whole(modules: &[String], cell: &Cell) -> Came {
    let program = rapid::read(sources(modules), Vec::new()).map_err(|e| said(&e))?;
    let corrected = compensate(&program, cell, &Options::default()).map_err(|e| said(&e))?;
    if !corrected.failures.is_empty() {
        return Err(said(&corrected.failures));
    }
    let mut report = Vec::new();
    write_csv(&corrected.rows, &mut report).unwrap();
    let edits = &corrected.rewritten.as_ref().unwrap().edits;
    Ok((edited(&program.sources, edits), String::from_utf8(report).unwrap(), said(&corrected.notes)))
}

/// `None` where the program is not of this kind.
fn executed(modules: &[String], cell: &Cell, threads: usize, chunk: usize) -> Option<Came> {
    let program = match rapid::Executed::sized(sources(modules), Vec::new(), 0, chunk) {
        Ok(program) => program?,
        Err(errors) => return Some(Err(said(&errors))),
    };
    let mut report = CSV_HEADER.as_bytes().to_vec();
    let mut sinks =
        Sinks { report: &mut report, rows: &|rows| csv_rows(rows), each: &mut |_| (), progress: &|_, _| () };
    Some(match compensate_executed(&program, cell, &Options::default(), threads, &mut sinks) {
        Ok((done, edits)) if done.failures.is_empty() => {
            let texts = edited(&program.distinct().sources, &edits);
            Ok((texts, String::from_utf8(report).unwrap(), said(&done.notes)))
        }
        Ok((done, _)) => Err(said(&done.failures)),
        Err(StreamError::Refused(errors)) => Err(said(&errors)),
        Err(StreamError::NotStreamable) => return None,
        Err(error) => panic!("{error:?}"),
    })
}

/// The first line that differs.
fn first_difference(came: &Came, whole: &Came) -> String {
    let lines = |came: &Came| format!("{came:?}").replace("\\n", "\n").lines().map(str::to_owned).collect::<Vec<_>>();
    let (came, whole) = (lines(came), lines(whole));
    let differs = came.iter().zip(&whole).find(|(a, b)| a != b);
    differs.map_or_else(|| "one is longer".to_owned(), |(a, b)| format!("{a}\ninstead of\n{b}"))
}

/// A program whose loops go round some tens of times, by literals, declarations, arrays, offsets and arguments.
fn looping(rounds: usize) -> String {
    let turned = |x: f64, y: f64, q: &str| format!("[[{x:.1},{y:.1},20],[{q}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
    let pose = |x: f64, y: f64| turned(x, y, "0,1,0,0");
    format!(
        "MODULE M\nCONST robtarget pa{{3}}:=[{},{},{}];\nCONST robtarget p1:={};\nCONST robtarget p2:={};\n\
         VAR num n:=0;\nPROC side(robtarget p,num d)\n  MoveL p,v50,fine,tCell\\WObj:=wCell;\n  MoveL Offs(p,0,0,2.5),v50,fine,tCell\\WObj:=wCell;\n\
         MoveL Offs(p,0,0,d),v50,fine,tCell\\WObj:=wCell;\nENDPROC\nPROC main()\n  MoveJ p1,v50,fine,tCell\\WObj:=wCell;\n\
         FOR i FROM 1 TO {rounds} DO\n    FOR k FROM 1 TO 3 DO\n      MoveJ Offs(pa{{k}},-20-i/100,0,0),v50,fine,tCell\\WObj:=wCell;\n      MoveL pa{{k}},v50,fine,tCell\\WObj:=wCell;\n    ENDFOR\n\
         side p2,0.1*i;\n    MoveC {},{},v50,fine,tCell\\WObj:=wCell;\n  ENDFOR\n\
         WHILE n<{rounds} DO\n    MoveL p1,v50,fine,tCell\\WObj:=wCell;\n    MoveL Offs(p1,5,0,0),v50,fine,tCell\\WObj:=wCell;\n    n:=n+1;\n  ENDWHILE\n\
         ENDPROC\nENDMODULE\n",
        pose(10.0, 0.0),
        pose(20.0, 5.0),
        pose(30.0, -5.0),
        pose(0.0, 0.0),
        pose(40.0, 10.0),
        // The tool turns on the arc, and the text of the circle point says otherwise.
        turned(45.0, 15.0, "0,0.96,0,0.28"),
        turned(50.0, 10.0, "0,0.8,0.6,0"),
    )
}

#[test]
fn programs_that_are_run_again_give_what_they_give_as_a_whole() {
    const SEEDS: std::ops::Range<u64> = 0..150;
    let cell = cell();
    let mut all: Vec<(String, Vec<String>)> =
        SEEDS.map(|seed| (format!("seed {seed}"), generate::program(seed))).collect();
    all.push(("loops".to_owned(), vec![looping(23)]));
    let (mut compared, mut written) = (0, 0);
    for (name, modules) in all {
        let Some(came) = executed(&modules, &cell, 2, 5) else { continue };
        let whole = whole(&modules, &cell);
        compared += 1;
        written += usize::from(whole.is_ok());
        assert!(came == whole, "{name}: {}\n{}", first_difference(&came, &whole), modules.join("\n"));
    }
    assert!(compared > 20 && written > 10, "{compared} compared, {written} of them written");
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let (cell, modules) = (cell(), [looping(40)]);
    let one = executed(&modules, &cell, 1, 7).unwrap().unwrap();
    assert_eq!(executed(&modules, &cell, 3, 7).unwrap().unwrap(), one);
    assert_eq!(executed(&modules, &cell, 2, 64).unwrap().unwrap(), one);
    // Some runs agree, and some do not. What leads to points that agree goes along.
    assert!(one.1.contains(",ok,") && one.1.contains(",kept,"), "{}", one.1);
    let whole = compensate(&rapid::read(sources(&modules), Vec::new()).unwrap(), &cell, &Options::default()).unwrap();
    assert_eq!(whole.rows.iter().filter(|row| row.goes_along).count(), 3 * 40);
}

#[test]
fn a_run_is_predicted_as_the_whole_is() {
    let (cell, text) = (cell(), looping(2300));
    let program = rapid::read(sources(std::slice::from_ref(&text)), Vec::new()).unwrap();
    let whole = predict(&program, &cell, &Options::default(), None).unwrap();
    let mut expected = Vec::new();
    write_csv(&whole.rows, &mut expected).unwrap();
    let executed = Executed::read(sources(std::slice::from_ref(&text)), Vec::new()).unwrap();
    let executed = executed.expect("more motions than are held");
    let chunks: AnyChunks<Cursor<Vec<u8>>> = AnyChunks::Executed(executed.chunks());
    let mut report = CSV_HEADER.as_bytes().to_vec();
    let mut sinks =
        Sinks { report: &mut report, rows: &|rows| csv_rows(rows), each: &mut |_| (), progress: &|_, _| () };
    let done = predict_chunks(chunks, None, &cell, &Options::default(), 2, None, &mut sinks).unwrap();
    assert_eq!(done.summary.targets, whole.rows.len());
    assert!(report == expected, "the reports differ");
}
