//! Programs whose mechanical units move or stand, in chunks against the same programs as a whole: the same bytes.

use crate::stream_declared::streamed_with;
use crate::streamed::{in_chunks, whole};
use crate::units::{TABLE, TRACK, cell};
use deflex::cell::Cell;
use deflex::correct::{Options, compensate_chunks, predict, predict_chunks};
use deflex::program::rapid::{self, Chunks};
use deflex::program::{AnyChunks, Next};
use deflex::report::write_csv;
use deflex::text::Source;
use std::io::Cursor;

/// Bytes of a chunk: some lines, and more than the program.
const SIZES: [usize; 3] = [700, 5_000, 1 << 20];

const TARGETS: usize = 150;

/// External axes of target `i`: the track goes back and forth, the table turns.
fn axes(i: usize) -> String {
    let (track, table) = (200.0 * (0.05 * i as f64).sin(), 0.25 * i as f64 - 20.0);
    match i {
        // They stand for a while.
        0..20 => "0,-20,9E9,9E9,9E9,9E9".to_owned(),
        _ => format!("{track:.2},{table:.2},9E9,9E9,9E9,9E9"),
    }
}

fn robtarget(i: usize) -> String {
    let (along, half) = (0.7 * i as f64, 0.02 * (0.1 * i as f64).sin());
    let (x, y) = (along - 50.0, 20.0 * (0.04 * along).sin());
    format!("[[{x:.3},{y:.3},205.000],[{:.8},{:.8},0,0],[0,0,0,0],[{}]]", half.sin(), half.cos(), axes(i))
}

/// A line on the table, in front of which the robot runs along its track.
fn program(declared: bool) -> String {
    let mut text = "MODULE M\n  PERS tooldata tA:=[TRUE,[[20,0,210],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n  \
         PERS wobjdata wA:=[FALSE,FALSE,\"STN1\",[[0,0,0],[1,0,0,0]],[[-50,0,0],[1,0,0,0]]];\n"
        .to_owned();
    let is_declared = |i: usize| declared && !i.is_multiple_of(5);
    for i in (0..TARGETS).filter(|i| is_declared(*i)) {
        text += &format!("  CONST robtarget p{i}:={};\n", robtarget(i));
    }
    text += "  PROC main()\n    ActUnit STN1;\n    ConfL\\Off;\n";
    for i in 0..TARGETS {
        let to = if is_declared(i) { format!("p{i}") } else { robtarget(i) };
        let motion = if i == 0 { "MoveJ" } else { "MoveL" };
        text += &format!("    {motion} {to},v50,z1,tA\\WObj:=wA;\n");
        if i == 70 {
            text += "    MoveAbsJ [[0,10,10,0,60,0],[50,10,9E9,9E9,9E9,9E9]],v200,fine,tA\\WObj:=wA;\n    ! deflex cut\n    ActUnit STN1;\n";
        }
    }
    text + "  ENDPROC\nENDMODULE\n"
}

fn read(text: &str) -> deflex::program::Program {
    rapid::read(vec![Source::new("part.mod", text.as_bytes())], Vec::new()).unwrap()
}

fn both_units() -> Cell {
    cell([0.0; 3], &format!("{TRACK}{TABLE}"))
}

#[test]
fn units_that_move_give_the_same_in_chunks() {
    let (cell, text) = (both_units(), program(false));
    for options in [Options::default(), Options { subdivide: Some(2e-6), ..Options::default() }] {
        let expected = whole(&read(&text), &cell, &options).unwrap();
        assert_ne!(expected.program, text.as_bytes());
        for (threads, size) in [1, 2, 3].into_iter().zip(SIZES).chain([(3, SIZES[0]), (2, SIZES[0])]) {
            let chunks = Chunks::sized("part.mod", text.as_bytes(), &[], size).unwrap().unwrap();
            let came = in_chunks(|program, sinks| compensate_chunks(chunks, &cell, &options, threads, program, sinks));
            let same = came.unwrap().unwrap() == expected;
            assert!(same, "chunks of {size} bytes on {threads} threads, {:?}", options.subdivide);
        }
    }
}

#[test]
fn units_that_move_are_predicted_the_same_in_chunks() {
    let (cell, text, options) = (both_units(), program(false), Options::default());
    let predicted = predict(&read(&text), &cell, &options, None).unwrap();
    assert!(predicted.failures.is_empty(), "{:?}", predicted.failures);
    let mut expected = Vec::new();
    write_csv(&predicted.rows, &mut expected).unwrap();
    for (threads, size) in [1, 2, 3].into_iter().zip(SIZES) {
        let inline = Chunks::sized("part.mod", Cursor::new(text.as_bytes()), &[], size).unwrap().unwrap();
        let chunks = AnyChunks::Inline(Box::new(inline));
        let came = in_chunks(|_, sinks| predict_chunks(chunks, None, &cell, &options, threads, None, sinks));
        assert!(came.unwrap().unwrap().report == expected, "chunks of {size} bytes on {threads} threads");
    }
}

#[test]
fn units_that_move_to_declared_targets_give_the_same_in_chunks() {
    let (cell, text, options) = (both_units(), program(true), Options::default());
    let expected = whole(&read(&text), &cell, &options).unwrap();
    for (threads, size) in [1, 2, 3].into_iter().zip(SIZES) {
        let came = streamed_with(&text, &cell, &options, threads, size).unwrap().unwrap();
        assert!(came == expected, "chunks of {size} bytes on {threads} threads");
    }
}

#[test]
fn what_changes_how_axes_are_meant_is_not_streamed() {
    // In the head, and between motions.
    for (line, instead) in [
        ("ActUnit STN1;\n    ConfL", "DeactUnit STN1;\n    ConfL"),
        ("ActUnit STN1;\n    ConfL", "ActUnit unitOf{2};\n    ConfL"),
        ("ActUnit STN1;\n    ConfL", "EOffsSet [10,0,0,0,0,0];\n    ConfL"),
        ("! deflex cut", "DeactUnit STN1;"),
        ("! deflex cut", "EOffsSet [10,0,0,0,0,0];"),
        ("! deflex cut", "MoveExtJ [[0,0,0,0,0,0],[0,0,9E9,9E9,9E9,9E9]],vrot10,fine;"),
    ] {
        let text = program(false).replace(line, instead);
        let Some(mut chunks) = Chunks::sized("part.mod", text.as_bytes(), &[], 700).unwrap() else { continue };
        let mut next = || match chunks.take().unwrap() {
            Next::Chunk(chunk) => chunk.read().is_some(),
            Next::NotStreamable => false,
            Next::End => panic!("{instead} is streamed"),
        };
        while next() {}
    }
}
