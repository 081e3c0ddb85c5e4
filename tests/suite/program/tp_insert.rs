//! `--subdivide` in FANUC TP: motions and positions between, where they are right; else the reason.

#![allow(clippy::float_cmp)] // the very numbers that were written

use super::krl_insert::CELL;
use deflex::cell::Cell;
use deflex::correct::{Options, Summary, compensate, predict};
use deflex::program::{Conf, Config, Goal, Insert, Motion, Program, Reason, RewriteOptions, Role, rapid, tp};
use deflex::report::difference;
use deflex::text::{Source, applied};
use proptest::prelude::*;
use std::fmt::Write;

fn read(text: &str) -> Program {
    tp::read(vec![Source::new("m.ls", text.as_bytes())], Vec::new()).unwrap_or_else(|errors| panic!("{errors:?}"))
}

fn position(number: usize, [x, y, z]: [f64; 3]) -> String {
    format!(
        "P[{number}]{{\n   GP1:\n\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX = {x:.1}  mm,\tY = {y:.3}  mm,\tZ = {z:.3}  mm,\n\t\
         W = 180.000 deg,\tP = .000 deg,\tR = 0.000 deg,\n\tE1=  0.000  mm\n   GP2:\n\tUF : F, UT : F,\t\n\tJ1=     0.000  mm\n}};\n"
    )
}

/// A program as a controller prints it, of these statements.
fn program(statements: &str, positions: &str) -> String {
    let count = statements.lines().count();
    let numbered: String = statements
        .lines()
        .enumerate()
        .map(|(i, line)| format!("{:4}:{} ;\n", i + 1, line.replace('|', "\n    :")))
        .collect();
    format!("/PROG  M\n/ATTR\nLINE_COUNT\t= {count};\n/MN\n{numbered}/POS\n{positions}/END\n")
}

/// The text with these inserts, and why there are none.
fn inserted(program: &Program, inserts: &[Insert]) -> (String, Vec<(usize, Reason)>) {
    let changes = vec![None; program.targets.len()];
    let rewritten = program.rewrite(&changes, inserts, &RewriteOptions::default());
    let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    assert_eq!(rewritten.inserted.len(), inserts.len());
    let refused = |before| rewritten.not_inserted.iter().any(|(i, _)| *i == before);
    for (insert, written) in inserts.iter().zip(&rewritten.inserted) {
        assert_eq!(written.is_none(), refused(insert.before));
    }
    (String::from_utf8(out).unwrap(), rewritten.not_inserted)
}

const HALF_TURN: [f64; 4] = [0.0, 1.0, 0.0, 0.0];

fn line(before: usize, position_mm: [f64; 3]) -> Insert {
    Insert::line(before, (position_mm, HALF_TURN), 3.0)
}

#[test]
fn motions_between_keep_the_layout() {
    let positions = [position(7, [0.0; 3]), position(12, [10.0, 0.0, 0.0])].concat();
    let text = program(
        "  LBL[3]\nJ P[7] 20% FINE    \n  DO[1]=ON\nL P[12:edge] 30.5mm/sec FINE ACC R[2] Wjnt    \n  JMP LBL[4]\n  !x\n  !x\n  !x\n  LBL[4]",
        &positions,
    );
    for end in ["\n", "\r\n"] {
        let text = text.replace('\n', end);
        let read = read(&text);
        let mut insert = line(1, [4.0, -0.125, 0.0004]);
        insert.conf = Some(Conf::Turns(Config { posture: 0, turns: [0, -1, 1] }));
        let (out, why) = inserted(&read, &[insert, line(1, [8.06, 0.0, 0.0])]);
        assert_eq!(why, []);
        let expected = text
            .replace("LINE_COUNT\t= 9", "LINE_COUNT\t= 11")
            .replace(
                "   4:L P[12:edge]",
                &format!(
                    "   4:L P[13] 30.5mm/sec CNT100 ACC R[2] Wjnt     ;{end}   5:L P[14] 30.5mm/sec CNT100 ACC R[2] Wjnt     ;{end}   6:L P[12:edge]"
                ),
            )
            .replace("   5:  JMP", "   7:  JMP")
            .replace("   9:  LBL[4]", "  11:  LBL[4]")
            .replace("   8:  !x", "  10:  !x")
            .replace("   7:  !x", "   9:  !x")
            .replace("   6:  !x", "   8:  !x");
        let new = position(13, [0.0; 3])
            .replace("X = 0.0 ", "X = 4.000 ")
            .replace("Y = 0.000", "Y = -0.125")
            .replace("0, 0, 0'", "0, -1, 1'")
            + &position(14, [0.0; 3]).replace("X = 0.0 ", "X = 8.060 ");
        let expected = expected.replace("/END", &format!("{}/END", new.replace('\n', end)));
        assert_eq!(out, expected);
        // What was written is what the controller will hold.
        let changes = vec![None; read.targets.len()];
        let rewritten = read.rewrite(&changes, &[line(1, [4.000_04, 0.0, 0.0])], &RewriteOptions::default());
        assert_eq!(rewritten.inserted[0].unwrap().0, [4.0, 0.0, 0.0]);
    }
}

#[test]
fn arcs_become_several() {
    let positions: String = (1..=3).map(|n| position(n, [n as f64, 0.0, 0.0])).collect();
    let text = program("J P[1] 20% FINE\nC P[2]    |  P[3] 30mm/sec CNT50", &positions);
    let read = read(&text);
    let mut arc = line(2, [2.0, 1.0, 0.0]);
    arc.via = Some(([1.5, 0.5, 0.0], HALF_TURN));
    let (out, why) = inserted(&read, &[line(2, [1.1, 0.0, 0.0]), arc]);
    assert_eq!(why, []);
    let wanted = "   2:L P[4] 30mm/sec CNT100 ;\n   3:C P[5]    \n    :  P[6] 30mm/sec CNT100 ;\n   4:C P[2]    \n    :  P[3] 30mm/sec CNT50 ;\n/POS";
    assert!(out.contains(wanted), "{out}");
    let again = self::read(&out);
    let kinds: Vec<_> = again.targets.iter().map(|target| (target.motion, target.role)).collect();
    let (line, arc) = ((Motion::Linear, Role::End), [(Motion::Circular, Role::Via), (Motion::Circular, Role::End)]);
    assert_eq!(kinds, [(Motion::Joint, Role::End), line, arc[0], arc[1], arc[0], arc[1]]);
    assert!(again.kept.is_empty());
}

#[test]
fn external_axes_go_with_the_point() {
    let positions = position(1, [0.0; 3]) + &position(2, [10.0, 0.0, 0.0]).replace("E1=  0.000", "E1=  100.0");
    let read = read(&program("J P[1] 20% FINE\nL P[2] 30mm/sec FINE", &positions));
    let mut insert = line(1, [4.0, 0.0, 0.0]);
    insert.external = Some([Some(40.25), None, None, None, None, None]);
    let (out, why) = inserted(&read, &[insert]);
    assert_eq!(why, []);
    let again = self::read(&out);
    assert_eq!(again.targets[1].external.as_ref().unwrap().written[0], Some(40.25));
}

#[test]
fn point_logic_keeps_its_own_count() {
    let statements = "   1:J P[1] 20% FINE ZEIT VOR   0.00sek,P-SPS    ;\n      1:  DO[1]=ON ;\n      2:  DO[2]=ON ;\n       ------ ;\n   2:L P[2] 30mm/sec FINE    ;\n";
    let positions = [position(1, [0.0; 3]), position(2, [10.0, 0.0, 0.0])].concat();
    let text = format!("/PROG  M\n/ATTR\nZEILEN\t= 2;\n/MN\n{statements}/POS\n{positions}/END\n");
    let (out, why) = inserted(&read(&text), &[line(1, [4.0, 0.0, 0.0])]);
    assert_eq!(why, []);
    let wanted = statements.replace("   2:L P[2]", "   2:L P[3] 30mm/sec CNT100    ;\n   3:L P[2]");
    assert!(out.contains(&wanted) && out.contains("ZEILEN\t= 3;"), "{out}");
}

#[test]
fn a_count_that_is_not_the_last_number_stays() {
    let positions = [position(1, [0.0; 3]), position(2, [10.0, 0.0, 0.0])].concat();
    let text = program("J P[1] 20% FINE\nL P[2] 30mm/sec FINE", &positions).replace("T\t= 2", "T\t= 0");
    assert!(inserted(&read(&text), &[line(1, [4.0, 0.0, 0.0])]).0.contains("LINE_COUNT\t= 0;"));
}

#[test]
fn where_a_point_between_would_be_wrong_none_is_written() {
    let positions: String = (1..=4).map(|n| position(n, [n as f64, (n * n) as f64, 0.0])).collect();
    for (statements, before, reason) in [
        ("J P[1] 20% FINE", 0, Reason::OnlyLinesAndArcs),
        ("J P[1] 20% FINE\nA P[2] 30mm/sec CNT100\nA P[3] 30mm/sec CNT100\nA P[4] 30mm/sec FINE", 3, Reason::ArcMotion),
        ("J P[1] 20% FINE\nFOR R[1]=1 TO 2\nL P[2] 30mm/sec FINE\nENDFOR", 1, Reason::RunsAgain),
        ("J P[1] 20% FINE\nL P[2] 2.5sec FINE", 1, Reason::Timed),
        ("J P[1] 20% FINE\nL P[2] R[3]sec FINE", 1, Reason::Timed),
        ("J P[1] 20% FINE\nL P[2] 30mm/sec CNT100 TB .10sec,DO[1]=ON", 1, Reason::OptionOnce),
        ("J P[1] 20% FINE\nL P[2] 30mm/sec CNT100 RT_LD10", 1, Reason::OptionOnce),
    ] {
        let text = program(statements, &positions);
        let (out, why) = inserted(&read(&text), &[line(before, [4.0, 0.0, 0.0]), line(before, [5.0, 0.0, 0.0])]);
        assert_eq!((out, why), (text, vec![(before, reason)]));
    }
}

#[test]
fn no_more_positions_than_the_controller_numbers() {
    let statements = "J P[1] 20% FINE\nL P[2] 30mm/sec FINE\nL P[1] 30mm/sec FINE\n!P[5000]";
    let positions = position(1, [0.0; 3]) + &position(2, [10.0, 0.0, 0.0]) + &position(996, [10.0, 0.0, 0.0]);
    let text = program(statements, &positions);
    let between = |before| [line(before, [4.0, 0.0, 0.0]), line(before, [5.0, 0.0, 0.0])];
    let (out, why) = inserted(&read(&text), &[between(1), between(2)].concat());
    assert_eq!(why, [(2, Reason::NoPositionNumbers)]);
    assert!(out.contains("P[998]{") && !out.contains("P[999]"));
}

/// Leading numbers of statements.
fn numbers(text: &str) -> Vec<usize> {
    let statements = text.split("/MN\n").nth(1).unwrap().split("/POS").next().unwrap();
    let number = |line: &str| line.split_once(':')?.0.trim().parse().ok();
    statements.lines().filter_map(number).collect()
}

/// Without what was added: statements and positions whose numbers are above those of before; numbers of statements blanked.
fn without(text: &str, most: usize) -> String {
    let number = |piece: &str| piece.split("P[").nth(1)?.split([']', ':']).next()?.parse::<usize>().ok();
    let (head, positions) = text.split_once("/POS\n").unwrap();
    let (head, statements) = head.split_once("/MN\n").unwrap();
    let mut out = head.split("LINE_COUNT").next().unwrap().to_owned();
    for statement in statements.split_inclusive(";\n") {
        let is_new = !statement.contains('!') && number(statement).is_some_and(|number| number > most);
        if !is_new {
            let _ = write!(out, "{:>6}:{}", "", statement.split_once(':').unwrap().1);
        }
    }
    out.push_str("/POS\n");
    for position in positions.split_inclusive("};\n") {
        if number(position).is_none_or(|number| number <= most) {
            out.push_str(position);
        }
    }
    out
}

/// A place near a target, mm.
fn nearby(program: &Program, target: usize, k: usize) -> [f64; 3] {
    let Goal::Pose { position_mm: [x, y, z], .. } = program.targets[target].goal else { panic!() };
    [x, y, z + 0.125 * k as f64]
}

proptest! {
    /// Taking the inserted statements and positions out by their numbers gives the text of before.
    #[test]
    fn inserted_points_change_nothing_but_numbers(
        kinds in prop::collection::vec(0..6_usize, 1..40),
        picks in prop::collection::vec((0..60_usize, 1..4_usize), 0..12),
    ) {
        let (mut statements, mut positions, mut count) = (String::from("J P[1] 20% FINE"), position(1, [0.0; 3]), 1);
        for kind in kinds {
            statements.push('\n');
            let mut point = |positions: &mut String| {
                count += 1;
                positions.push_str(&position(count, [count as f64, (count % 7) as f64, 0.5]));
                count
            };
            match kind {
                0 => statements.push_str("  ! L P[900] 5mm/sec FINE"),
                1 => statements.push_str("  WAIT    .10(sec)"),
                2 => { let _ = write!(statements, "J P[{}] 20% FINE", point(&mut positions)); }
                3 => {
                    let (via, end) = (point(&mut positions), point(&mut positions));
                    let _ = write!(statements, "C P[{via}]    |  P[{end}] 30mm/sec CNT100");
                }
                _ => { let _ = write!(statements, "L P[{}] 30mm/sec CNT50 ACC80", point(&mut positions)); }
            }
        }
        let text = program(&statements, &positions);
        let before = read(&text);
        let mut at: Vec<(usize, usize)> = picks.into_iter().map(|(k, n)| (k % before.targets.len(), n)).collect();
        at.sort_unstable();
        at.dedup_by_key(|(i, _)| *i);
        let inserts: Vec<Insert> =
            at.iter().flat_map(|(i, n)| (1..=*n).map(|k| line(*i, nearby(&before, *i, k)))).collect();
        let (out, why) = inserted(&before, &inserts);
        prop_assert_eq!(without(&out, count), without(&text, count));
        let new = inserts.iter().filter(|insert| !why.iter().any(|(i, _)| *i == insert.before)).count();
        let lines = statements.lines().count();
        prop_assert_eq!(numbers(&out), (1..=lines + new).collect::<Vec<_>>());
        let line_count = format!("LINE_COUNT\t= {};", lines + new);
        prop_assert!(out.contains(&line_count));
        // Read back: the same targets with the others between them.
        let after = read(&out);
        prop_assert!(after.kept.is_empty());
        let mut found = after.targets.iter();
        for (i, target) in before.targets.iter().enumerate() {
            // Those of an arc come before its circle point.
            if target.role == Role::End && target.motion == Motion::Circular {
                continue;
            }
            let end = if target.role == Role::Via { i + 1 } else { i };
            for insert in inserts.iter().filter(|insert| insert.before == end).filter(|_| why.iter().all(|(k, _)| *k != end)) {
                let Goal::Pose { position_mm, .. } = found.next().unwrap().goal else { panic!() };
                prop_assert_eq!(position_mm, insert.position_mm);
            }
            for target in &before.targets[i..=end] {
                prop_assert_eq!(&found.next().unwrap().goal, &target.goal);
            }
        }
        // A comparison tells nothing but them.
        let difference = difference(&before, &after);
        prop_assert_eq!((difference.inserted.len(), difference.moved.len(), difference.other.len()), (new, 0, 0), "{:?}", difference.other);
    }
}

fn cell(text: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", text)).unwrap()
}

/// The same long lines and the same arc as TP and as RAPID.
fn both() -> [(Program, Cell); 2] {
    let points = [[0.0, 0.0], [180.0, 0.0], [180.0, 140.0], [40.0, 140.0]];
    let (mut moves, mut statements, mut positions) = (String::new(), String::new(), String::new());
    let target = |x: f64, y: f64| format!("[[{x},{y},0],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
    let mut add = |x: f64, y: f64| {
        let number = positions.matches("GP1").count() + 1;
        positions.push_str(&position(number, [x, y, 0.0]).replace("R = 0.000", "R = 180.000"));
        number
    };
    for [x, y] in points {
        let _ = writeln!(moves, "MoveL {},v50,z0,tMill\\WObj:=wPart;", target(x, y));
        let _ = writeln!(statements, "L P[{}] 50mm/sec CNT100", add(x, y));
    }
    let _ = writeln!(moves, "MoveC {},{},v50,z0,tMill\\WObj:=wPart;", target(-30.0, 70.0), target(40.0, 0.0));
    let (via, end) = (add(-30.0, 70.0), add(40.0, 0.0));
    let _ = write!(statements, "C P[{via}]    |  P[{end}] 50mm/sec FINE");
    let module = format!("MODULE M\nPROC main()\n{moves}ENDPROC\nENDMODULE\n");
    let rapid = rapid::read(vec![Source::new("m.mod", module)], Vec::new()).unwrap();
    let rapid_cell = cell(&CELL.replace("\"TOOL_DATA[1]\"", "tMill").replace("\"BASE_DATA[1]\"", "wPart"));
    let tp_cell = cell(&CELL.replace("TOOL_DATA[1]", "UT 1").replace("BASE_DATA[1]", "UF 1"));
    [(read(&program(&statements, &positions)), tp_cell), (rapid, rapid_cell)]
}

#[test]
fn as_little_is_left_on_the_way_as_in_rapid() {
    let options = Options { subdivide: Some(5e-6), ..Options::default() };
    let both = both();
    let [own, other] = both.each_ref().map(|(program, cell)| {
        let corrected = compensate(program, cell, &options).unwrap();
        assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
        let rewritten = corrected.rewritten.as_ref().unwrap();
        assert_eq!(rewritten.not_inserted, []);
        let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
        let left = Summary::of(&corrected.rows).remaining_path_rms_mm;
        (rewritten.inserted.len(), left, String::from_utf8(out).unwrap())
    });
    assert!(own.0 > 5 && own.0 == other.0, "{} {}", own.0, other.0);
    // Three decimals against four, of angles too: half a thousandth of a degree is 2 µm at the length of the tool.
    assert!((own.1 - other.1).abs() < 3e-3 && own.1 < 0.012, "{} {}", own.1, other.1);
    let again = read(&own.2);
    let ends = again.targets.iter().filter(|target| target.role == Role::End).count();
    assert_eq!(ends, 5 + own.0);
    assert!(again.kept.is_empty() && again.targets.iter().filter(|t| t.motion == Motion::Circular).count() >= 4);
    let difference = difference(&both[0].0, &again);
    assert_eq!((difference.inserted.len(), difference.other.len()), (own.0, 0), "{:?}", difference.other);
}

/// The circle points of `A` motions are nowhere in the text: they stay half way, where no point is inserted.
#[test]
fn circle_arc_motions_stay_whole() {
    let [(program, cell), _] = both();
    let text = String::from_utf8(program.sources[0].bytes.to_vec()).unwrap();
    let text = text.replace("L P[", "A P[").replace("C P[5]    \n    :  P[6]", "A P[6]");
    let program = read(&text);
    assert_eq!(program.arcs, 4);
    let [with, without] = [Some(5e-6), None].map(|subdivide| {
        let corrected = compensate(&program, &cell, &Options { subdivide, ..Options::default() }).unwrap();
        assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
        corrected
    });
    let refused = &with.rewritten.as_ref().unwrap().not_inserted;
    let arc = |(_, why): &(usize, Reason)| *why == Reason::ArcMotion;
    assert!(!refused.is_empty() && refused.iter().all(arc), "{refused:?}");
    let [a, b] = [&with, &without].map(|corrected| Summary::of(&corrected.rows));
    // The cut of arcs is that of the path's direction then, not of the chord.
    assert!(a.remaining_path_rms_mm < b.remaining_path_rms_mm, "{a:?} {b:?}");
    assert!(a.max_remaining_mm < 5e-3, "{a:?}");
}

#[test]
fn what_is_written_is_judged_by_the_original() {
    let [(program, cell), _] = both();
    let corrected = compensate(&program, &cell, &Options { subdivide: Some(5e-6), ..Options::default() }).unwrap();
    let out = applied(&program.sources[0].bytes, &corrected.rewritten.as_ref().unwrap().edits[0]);
    let again = read(&String::from_utf8(out).unwrap());
    let judged = predict(&again, &cell, &Options::default(), Some(&program)).unwrap();
    let [reported, found] = [&corrected.rows, &judged.rows].map(|rows| Summary::of(rows).remaining_path_rms_mm);
    assert!((reported - found).abs() < 2e-4, "{reported} {found}");
}
