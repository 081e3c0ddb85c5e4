//! Corrected programs judged by their originals, where targets have been inserted.

use super::bench::{Bench, CL};
use crate::dense_walk::{CELL, corrected, module, paths, read};
use deflex::cell::Cell;
use deflex::correct::{Corrected, Options, Summary, predict};
use deflex::program::Program;
use deflex::text::Source;

/// What the printed digits and single precision move a figure by, mm.
const PRINTED: f64 = 5e-4;

fn cell(text: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", text.as_bytes())).expect("a cell")
}

fn judged(program: &Program, original: &Program, cell: &Cell) -> Corrected {
    predict(program, cell, &Options::default(), Some(original)).expect("matched")
}

/// A corrected program compared with its original: between the targets remains what the correction has reported.
fn agree(name: &str, reported: &Corrected, judged: &Corrected) {
    assert!(judged.failures.is_empty(), "{name}: {:?}", judged.failures);
    let (reported, own) = (Summary::of(&reported.rows), Summary::of(&judged.rows));
    let figures = [
        (reported.remaining_path_max_mm, own.remaining_path_max_mm),
        (reported.remaining_path_rms_mm, own.remaining_path_rms_mm),
    ];
    for (reported, own) in figures {
        assert!((reported - own).abs() < PRINTED, "{name}: {reported} reported, {own} judged");
    }
    assert!(own.max_error_mm < PRINTED, "{name}: {}", own.max_error_mm);
    let unknown = judged.rows.iter().filter(|row| row.is_solved() && row.path.is_none());
    assert_eq!(unknown.map(|row| row.target).collect::<Vec<_>>(), [0; 0], "{name}");
}

#[test]
fn a_subdivided_program_is_judged_as_its_correction_reports() {
    let cell = cell(CELL);
    for (name, body) in paths() {
        // The zone of an inserted target is that of the original's here: only where the tool lands tells them apart.
        for text in [module(&body), module(&body).replace("fine", "z0")] {
            let original = read(&text);
            for subdivide in [3e-6, 1e-5] {
                let (reported, text) = corrected(&original, &cell, Some(subdivide));
                let program = read(&text);
                assert!(program.targets.len() > original.targets.len(), "{name}");
                let judged = judged(&program, &original, &cell);
                agree(name, &reported, &judged);
                // Row by row: the largest of the parts of a way is that of the way. Inserted targets do not stop.
                let stops: Vec<bool> = text.lines().map(|line| line.contains(",fine,")).collect();
                let mut ways = judged.rows.split_inclusive(|row| stops[row.line as usize - 1]);
                for row in reported.rows.iter().filter(|_| stops.contains(&true)) {
                    let parts = ways.next().expect("one a target").iter().map(|part| part.remaining_path_mm().unwrap());
                    let (most, reported) = (parts.fold(0.0, f64::max), row.remaining_path_mm().unwrap());
                    assert!(
                        (most - reported).abs() < PRINTED,
                        "{name}: target {}: {reported} reported, {most} judged",
                        row.target
                    );
                }
            }
        }
    }
}

#[test]
fn the_place_on_the_path_is_where_the_tool_lands() {
    // Half as stiff as the cell that the correction was made with: what is left is about the correction again, across the path.
    let (soft, stiff) =
        (
            cell(CELL),
            cell(&CELL.replace(
                "8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 0.881e5",
                "8.86e9, 5.5e9, 1.85e9, 3.3e9, 2.1e9, 0.881e9",
            )),
        );
    let (_, body) = paths().swap_remove(1);
    let original = read(&module(&body));
    let (_, text) = corrected(&original, &soft, Some(1e-5));
    let program = read(&text);
    let judged = judged(&program, &original, &stiff);
    let along = nalgebra::Vector3::new(60.0, 700.0, 40.0).normalize();
    for row in &judged.rows[1..judged.rows.len() - 1] {
        let error = nalgebra::Vector3::from(row.error_mm);
        assert!(error.norm() > 0.05, "{error:?}");
        assert!(along.dot(&error).abs() < 1e-6, "{error:?}");
    }
}

#[test]
fn what_is_not_on_the_path_is_named() {
    let cell = cell(CELL);
    let (_, body) = paths().swap_remove(0);
    let original = read(&module(&body));
    let (_, text) = corrected(&original, &cell, Some(1e-5));
    let line = text.lines().filter(|line| line.contains("MoveL")).nth(5).unwrap();
    let refused = |text: &str| {
        let refused = predict(&read(text), &cell, &Options::default(), Some(&original)).unwrap_err();
        format!("{}", refused[0])
    };
    // A target of its own, ten millimetres above.
    let (before, numbers) = line.split_once("[[").unwrap();
    let (position, rest) = numbers.split_once(']').unwrap();
    let fields: Vec<&str> = position.split(',').collect();
    let lifted = format!("{before}[[{},{},10.0]{rest}", fields[0], fields[1]);
    let said = refused(&text.replacen(line, &format!("{line}\n{lifted}"), 1));
    assert!(said.contains("against.path") && said.contains("target 7 is neither"), "{said}");
    // Turned round.
    let mut lines: Vec<&str> = text.lines().collect();
    let first = lines.iter().position(|line| line.contains("MoveL")).unwrap();
    let last = lines.iter().rposition(|line| line.contains("MoveL")).unwrap();
    lines[first..=last].reverse();
    assert!(refused(&lines.join("\n")).contains("is neither at"));
    // Fewer than the original has.
    let (at, _) = body.match_indices("    MoveL").nth(1).unwrap();
    assert!(refused(&module(&body[..at])).contains("but the original has 8"));
}

#[test]
fn the_command_checks_a_subdivided_program() {
    let bench = Bench::new();
    let (_, body) = paths().swap_remove(3);
    bench.write("walk.mod", module(&body)).write("walk.toml", CELL);
    let ran =
        bench.run("compensate walk.mod --cell walk.toml --subdivide 0.01 -o out.mod --json reported.json").exits(0);
    assert!(
        ran.stderr.contains("remains between targets") && ran.stderr.contains("lead in and out of the cut gently"),
        "{}",
        ran.stderr
    );
    let check = "check out.mod --cell walk.toml --against walk.mod --max-error 0.011 --max-correction 2";
    bench.run(check).exits(0);
    // Where the force begins, the command jumps: on a stretch that no target can shorten.
    let ran = bench.run(&format!("{check} --max-jump 0.011")).exits(1);
    assert!(ran.stdout.contains("out.mod: 11 targets, 1 finding ("), "{}", ran.stdout);
    assert!(ran.stdout.contains("target 2: on the path to it"), "{}", ran.stdout);
    let ran =
        bench.run("check out.mod --cell walk.toml --against walk.mod --max-error 0.011 --max-correction 0.1").exits(1);
    assert!(ran.stdout.contains("limits.max-correction"), "{}", ran.stdout);
    bench.run("predict out.mod --cell walk.toml --against walk.mod --report own.csv --json own.json").exits(0);
    let figures = |name: &str| {
        let json: serde_json::Value = serde_json::from_str(&bench.read(name)).unwrap();
        ["remaining_path_max_mm", "remaining_path_rms_mm"].map(|key| json["files"][0][key].as_f64().unwrap())
    };
    for (reported, own) in figures("reported.json").into_iter().zip(figures("own.json")) {
        assert!((reported - own).abs() < PRINTED, "{reported} {own}");
    }
    // Without a cell: the shift of the original's targets, and that nothing else is different.
    let ran = bench.run("diff walk.mod out.mod").exits(1);
    // Three circle points of arcs that were split have no shift.
    let ends = "\n  inserted targets            7\n  other differences           0\n";
    assert!(ran.stdout.contains("4 of 7 targets changed\n") && ran.stdout.ends_with(ends), "{}", ran.stdout);
    bench.run("diff walk.mod out.mod --json diff.json").exits(1);
    let json: serde_json::Value = serde_json::from_str(&bench.read("diff.json")).unwrap();
    let reported: serde_json::Value = serde_json::from_str(&bench.read("reported.json")).unwrap();
    let largest = |json: &serde_json::Value, key: &str| json[key].as_f64().unwrap();
    let correction = largest(&reported["files"][0], "max_correction_mm");
    assert!((largest(&json, "max_mm") - correction).abs() < PRINTED, "{json}");
    // Something else changed as well: its line is listed.
    bench.write("slower.mod", bench.read("out.mod").replacen(",v20,fine", ",v10,fine", 1));
    let ran = bench.run("diff walk.mod slower.mod").exits(1);
    assert!(ran.stdout.ends_with("\n  other differences           2\n"), "{}", ran.stdout);
}

#[test]
fn posted_programs_are_judged_by_their_cl_data() {
    let bench = Bench::new();
    bench.write("part.apt", CL.replace("GOTO/100,0,0,0,0,1", "GOTO/300,500,-50,0,0.2,0.98\nGOTO/-200,200,0,0,0,1"));
    bench.run("compensate part.apt --cell cell.toml --subdivide 0.01 -o posted.mod --json reported.json").exits(0);
    assert!(bench.read("posted.mod").matches("MoveL").count() > 6, "{}", bench.read("posted.mod"));
    bench.run("predict posted.mod --cell cell.toml --against part.apt --json own.json").exits(0);
    let figures = |name: &str| {
        let json: serde_json::Value = serde_json::from_str(&bench.read(name)).unwrap();
        ["remaining_path_max_mm", "remaining_path_rms_mm"].map(|key| json["files"][0][key].as_f64().unwrap())
    };
    for (reported, own) in figures("reported.json").into_iter().zip(figures("own.json")) {
        assert!((reported - own).abs() < PRINTED, "{reported} {own}");
    }
}
