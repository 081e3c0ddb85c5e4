//! Free external axes: chosen along the path with the turn, against a plain dynamic programming over `predict`.

use crate::units::{TABLE, TRACK, cell as cell_with};
use deflex::cell::Cell;
use deflex::correct::{Corrected, Options, PostOptions, Prepared, compensate, post, predict};
use deflex::program::{Language, Program, cl, krl, rapid};
use deflex::robot::{AxisName, Pose};
use deflex::text::{Severity, Source, applied};
use nalgebra::{Rotation3, Translation3, Vector3};

const TOOL: &str = "
[tools.tA]
tcp_mm = [150.0, 0.0, 260.0]
tcp_quat = [0.92387953, 0.0, 0.38268343, 0.0]
mass_kg = 18.0
cog_mm = [0.0, 0.0, 120.0]
";
const FIXED: &str = "[wobjs.wA]\nuframe_mm = [1300.0, 0.0, 900.0]\nuframe_quat = [1.0, 0.0, 0.0, 0.0]\n";
const ON_TABLE: &str = "[wobjs.wA]\nunit = \"stn1\"\noframe_mm = [-50.0, 0.0, 200.0]\n";

/// Millimetres of path a target.
const STEP_MM: f64 = 40.0;
const TARGETS: usize = 7;

fn cell(spin: &str, units: &str) -> Cell {
    let cl = format!("[cl]\ntool = \"tA\"\nwobj = \"wA\"\nunits = \"mm\"\n{spin}\n");
    cell_with([0.0; 3], &format!("{TOOL}{cl}{units}"))
}

/// A unit that is free.
fn free(unit: &str) -> String {
    let bounded = unit.replace("min = -2000.0", "min = -1000.0").replace("max = 2000.0", "max = 500.0");
    format!("{bounded}free = true\n")
}

fn place(i: usize) -> [f64; 3] {
    let along = STEP_MM * i as f64;
    [60.0 * (along / 100.0).sin(), along - 120.0, 5.0 * (along / 60.0).cos()]
}

fn path(options: &Cell) -> Program {
    let line = |i: usize| {
        let lean = 0.25 * (i as f64 / 4.0).sin();
        let [x, y, z] = place(i);
        format!("GOTO/{x:.4},{y:.4},{z:.4},{:.6},0,{:.6}\n", lean.sin(), lean.cos())
    };
    let text = format!("UNITS/MM\nMULTAX/ON\nFEDRAT/3000,MMPM\n{}END\n", (0..TARGETS).map(line).collect::<String>());
    cl::read(Source::new("m.apt", text.into_bytes()), &options.cl.as_ref().unwrap().options).unwrap()
}

fn errors(corrected: &Corrected) -> Vec<f64> {
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    corrected.rows.iter().map(deflex::correct::Row::error_norm_mm).collect()
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Least rms of all ways through constant turns and positions of `axis`, whose turn changes by 5° and whose axis runs by `rate`
/// a millimetre at most.
fn least(spin_deg: &[f64], axis: (&str, &[f64], f64), sections: &str) -> f64 {
    let (name, positions, rate) = axis;
    let mut table: Vec<(f64, f64, Vec<f64>)> = Vec::new();
    for &position in positions {
        for &turn in spin_deg {
            let spin = format!("spin = \"fixed\"\nspin_deg = {turn}\nexternal = {{ {name} = {position:?} }}\n");
            let cell = cell(&spin, sections);
            // A place that is not reached as a whole is passed over.
            if let Ok(there) = predict(&path(&cell), &cell, &Options::default(), None)
                && there.failures.is_empty()
            {
                table.push((turn, position, errors(&there)));
            }
        }
    }
    assert!(table.len() > 4, "{}", table.len());
    let mut so_far: Vec<f64> = table.iter().map(|(.., errors)| errors[0].powi(2)).collect();
    for i in 1..TARGETS {
        let step = (0..3).map(|k| (place(i)[k] - place(i - 1)[k]).powi(2)).sum::<f64>().sqrt();
        let next = |(turn, position, errors): &(f64, f64, Vec<f64>)| {
            let allowed = table.iter().zip(&so_far).filter(|((from, at, _), _)| {
                let turned = (turn - from).rem_euclid(360.0);
                turned.min(360.0 - turned) <= 5.0 * step && (position - at).abs() <= rate * step
            });
            allowed.map(|(_, so_far)| *so_far).fold(f64::INFINITY, f64::min) + errors[i].powi(2)
        };
        so_far = table.iter().map(next).collect();
    }
    (so_far.into_iter().fold(f64::INFINITY, f64::min) / TARGETS as f64).sqrt()
}

fn note(corrected: &Corrected) -> &str {
    let note = corrected.notes.iter().find(|note| note.code == "spin.chosen").unwrap();
    assert_eq!(note.severity, Severity::Note);
    &note.message
}

fn posting(language: Language) -> PostOptions {
    PostOptions { name: "m".into(), title: Vec::new(), max_targets: None, rapid_mm_s: 200.0, feed_mm_s: None, language }
}

/// External axis of each target as written.
fn written(program: &Program, axis: usize) -> Vec<f64> {
    program
        .targets
        .iter()
        .map(|target| target.external.as_ref().unwrap().position(AxisName::External(axis)).unwrap())
        .collect()
}

#[test]
fn a_track_is_sent_where_the_arm_is_stiff() {
    let turns: Vec<f64> = (0..8).map(|k| 45.0 * f64::from(k)).collect();
    let places: Vec<f64> = (0..7).map(|k| 250.0 * f64::from(k) - 1000.0).collect();
    let best = least(&turns, ("eax_a", &places, 1.0), &format!("{FIXED}{TRACK}"));
    // Where the track stands at its end: with the turn as it is, and with the stiffest one there.
    let [from, stiffest] = ["fixed", "stiffest"].map(|spin| {
        let stands = cell(&format!("spin = \"{spin}\"\nexternal = {{ eax_a = 500.0 }}\n"), &format!("{FIXED}{TRACK}"));
        rms(&errors(&predict(&path(&stands), &stands, &Options::default(), None).unwrap()))
    });

    let sections = format!("{FIXED}{}", free(TRACK));
    let cell = cell("spin = \"stiffest\"\n", &sections);
    let program = path(&cell);
    let options = Options { post: Some(Language::Rapid), ..Options::default() };
    let corrected = compensate(&program, &cell, &options).unwrap();
    let chosen = rms(&errors(&corrected));
    assert!(from > 1.05 * best && chosen < 0.99 * stiffest, "{from} {stiffest} {chosen} {best}");
    assert!(from - chosen >= 0.9 * (from - best), "{from} {chosen} {best}");
    assert!(note(&corrected).contains("unit `TRACK1` moves between"), "{}", note(&corrected));

    // What is posted: within limits and rate, and the tool stands in the part where the CL data have it.
    let file = post(&program, &cell, &corrected, &posting(Language::Rapid)).unwrap().files.remove(0).1;
    let posted = rapid::read(vec![Source::new("m.mod", file)], Vec::new()).unwrap();
    let along = written(&posted, 0);
    assert!(along.iter().all(|at| (-1000.0..=500.0).contains(at)), "{along:?}");
    for (i, pair) in along.windows(2).enumerate() {
        let step = (0..3).map(|k| (place(i + 1)[k] - place(i)[k]).powi(2)).sum::<f64>().sqrt();
        assert!((pair[1] - pair[0]).abs() <= step + 2e-3, "{i} {pair:?}");
    }
    let prepared = Prepared::new(&posted, &cell, &Options::default()).unwrap();
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), 2.0 * 0.38268343_f64.atan2(0.92387953));
    let tool = Pose::from_parts(Translation3::new(0.15, 0.0, 0.26), turn);
    for (i, point) in prepared.points.iter().enumerate() {
        let base = Vector3::new(0.0, 0.96, 0.28) * (1e-3 * along[i]);
        let world_from_tcp = Translation3::from(base) * cell.arm.robot.forward(&point.motor) * tool;
        let in_part = 1e3 * (world_from_tcp.translation.vector - Vector3::new(1.3, 0.0, 0.9));
        let wanted = Vector3::from(place(i)) + Vector3::from(corrected.rows[i].correction_mm);
        assert!((in_part - wanted).norm() < 2e-4, "{i} {in_part} {wanted}");
    }
    // And there the loaded arm lands.
    let landed = predict(&posted, &cell, &Options::default(), None).unwrap();
    for (row, meant) in landed.rows.iter().zip(&corrected.rows) {
        assert!(meant.remaining_norm_mm() < 1e-3);
        let off = Vector3::from(row.error_mm) + Vector3::from(meant.correction_mm);
        assert!(off.norm() < 1e-3, "{off}");
    }
    // In KRL each point has its own E1, and the same one.
    let file = post(&program, &cell, &corrected, &posting(Language::Krl)).unwrap().files.remove(0).1;
    let in_krl = krl::read(vec![Source::new("m.src", file)], Vec::new()).unwrap();
    let in_krl = written(&in_krl, 0);
    assert_eq!(in_krl.len(), along.len());
    assert!(in_krl.iter().zip(&along).all(|(krl, rapid)| (krl - rapid).abs() < 1e-9), "{in_krl:?} {along:?}");
    assert!(along.iter().any(|at| (at - along[0]).abs() > 1.0), "{along:?}");
    assert!(post(&program, &cell, &corrected, &posting(Language::Cl)).is_err());
    assert!(post(&program, &cell, &corrected, &posting(Language::Ls)).is_err());
}

#[test]
fn a_table_turns_the_part_to_where_the_arm_is_stiff() {
    let table = TABLE.replace("360.0", "30.0");
    let sections = format!("{ON_TABLE}{}", free(&table));
    let cell_free = cell("spin = \"stiffest\"\n", &sections);
    let chosen = rms(&errors(&predict(&path(&cell_free), &cell_free, &Options::default(), None).unwrap()));
    let turns: Vec<f64> = (0..8).map(|k| 45.0 * f64::from(k)).collect();
    let places: Vec<f64> = (0..5).map(|k| 15.0 * f64::from(k) - 30.0).collect();
    let best = least(&turns, ("eax_b", &places, 5.0), &format!("{ON_TABLE}{table}"));
    let stands = cell("spin = \"stiffest\"\nexternal = { eax_b = 30.0 }\n", &format!("{ON_TABLE}{table}"));
    let from = rms(&errors(&predict(&path(&stands), &stands, &Options::default(), None).unwrap()));
    assert!(from - chosen >= 0.9 * (from - best), "{from} {chosen} {best}");
    assert!(chosen <= from.min(best), "{from} {chosen} {best}");
}

#[test]
fn two_units_are_chosen_in_one_search() {
    // The robot on a track and the part on a table: neither alone, nor both where they stand, is as stiff.
    let track = TRACK.replace("min = -2000.0", "min = 0.0").replace("max = 2000.0", "max = 300.0");
    let table = TABLE.replace("min = -360.0", "min = -20.0").replace("max = 360.0", "max = 20.0");
    let chosen = |external: &str, units: String| {
        let cell = cell(&format!("spin = \"stiffest\"\n{external}\n"), &format!("{ON_TABLE}{units}"));
        let there = predict(&path(&cell), &cell, &Options::default(), None).unwrap();
        (rms(&errors(&there)), note(&there).to_owned())
    };
    let (both, said) = chosen("", format!("{track}free = true\n{table}free = true\n"));
    assert!(said.contains("unit `TRACK1` moves between") && said.contains("unit `STN1` moves between"), "{said}");
    let standing = |external: [f64; 2]| {
        let external = format!("external = {{ eax_a = {:?}, eax_b = {:?} }}", external[0], external[1]);
        chosen(&external, format!("{track}{table}")).0
    };
    let corners = [[0.0, -20.0], [0.0, 20.0], [300.0, -20.0], [300.0, 20.0]].map(standing);
    let least = corners.into_iter().fold(f64::INFINITY, f64::min);
    let middle = standing([150.0, 0.0]);
    assert!(both <= 1.01 * least && both < 0.95 * middle, "{both} {corners:?} {middle}");
}

const RAPID_HEAD: &str = "MODULE M\n  PERS tooldata tA:=[TRUE,[[150,0,260],[0.92387953,0,0.38268343,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n  \
     PERS wobjdata wA:=[FALSE,TRUE,\"\",[[1300,0,900],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n  PROC main()\n";

/// The path in RAPID, the track standing at 480 mm; every other line as `more` has it.
fn in_rapid(more: impl Fn(usize) -> Option<String>) -> Program {
    let lines: String = (0..TARGETS)
        .map(|i| {
            let [x, y, z] = place(i);
            let target = format!("[[{x:.3},{y:.3},{z:.3}],[0,0,1,0],[0,0,0,0],[480,9E9,9E9,9E9,9E9,9E9]]");
            more(i).unwrap_or(format!("    MoveL {target},v50,fine,tA\\WObj:=wA;\n"))
        })
        .collect();
    let text = format!("{RAPID_HEAD}{lines}  ENDPROC\nENDMODULE\n");
    rapid::read(vec![Source::new("m.mod", text.into_bytes())], Vec::new()).unwrap()
}

fn rewritten(program: &Program, corrected: &Corrected) -> Program {
    let bytes = applied(&program.sources[0].bytes, &corrected.rewritten.as_ref().unwrap().edits[0]);
    rapid::read(vec![Source::new("m.mod", bytes)], Vec::new()).unwrap()
}

#[test]
fn written_axes_of_rapid_go_only_where_chosen_and_are_free() {
    let cell = cell("spin = \"fixed\"\n", &free(TRACK));
    let program = in_rapid(|_| None);
    let as_written = compensate(&program, &cell, &Options::default()).unwrap();
    assert!(written(&rewritten(&program, &as_written), 0).iter().all(|at| (at - 480.0).abs() < 1e-9));
    let options = Options { free_spin: true, ..Options::default() };
    let corrected = compensate(&program, &cell, &options).unwrap();
    let (before, after) = (rms(&errors(&as_written)), rms(&errors(&corrected)));
    assert!(after < 0.95 * before, "{before} {after}");
    let moved = rewritten(&program, &corrected);
    let along = written(&moved, 0);
    assert!(along.iter().all(|at| (at - 480.0).abs() > 1.0 && (-1000.0..=500.0).contains(at)), "{along:?}");
    // The moved program against the original, whose part is the same.
    let judged = predict(&moved, &cell, &Options::default(), Some(&program)).unwrap();
    assert!(judged.rows.iter().all(|row| row.error_norm_mm() < 1e-3), "{:?}", judged.rows);
}

#[test]
fn axes_stay_where_a_target_is_not_free_and_others_come_back_to_them() {
    let cell = cell("spin = \"fixed\"\n", &format!("{}max_speed = 40.0\n", free(TRACK)));
    // An offset and its base have one target's axes; the way there is rate-limited to both sides.
    let program = in_rapid(|i| {
        let [x, y, z] = place(i);
        (i == 3).then(|| format!("    MoveL Offs([[{x:.3},{y:.3},{z:.3}],[0,0,1,0],[0,0,0,0],[480,9E9,9E9,9E9,9E9,9E9]],0,0,0),v50,fine,tA\\WObj:=wA;\n"))
    });
    let options = Options { free_spin: true, ..Options::default() };
    let corrected = compensate(&program, &cell, &options).unwrap();
    let along = written(&rewritten(&program, &corrected), 0);
    assert!((along[3] - 480.0).abs() < 1e-9);
    assert!(along[0] < 479.0 && along[TARGETS - 1] < 479.0, "{along:?}");
    for (i, pair) in along.windows(2).enumerate() {
        let step = (0..3).map(|k| (place(i + 1)[k] - place(i)[k]).powi(2)).sum::<f64>().sqrt();
        assert!((pair[1] - pair[0]).abs() <= step * 40.0 / 50.0 + 2e-3, "{i} {pair:?}");
    }
}

#[test]
fn what_cannot_be_free_is_refused() {
    let refused = |units: &str| {
        let text = format!("[robot]\nmodel = \"irb6660-205-1.9\"\n[cut]\nforce = \"none\"\n{units}");
        Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap_err().remove(0).message
    };
    let endless = free(TABLE).replace("min = -360.0\nmax = 360.0\n", "");
    assert!(refused(&endless).contains("free and has no limits"));
    let third = free(TABLE).replace("STN1", "STN2").replace("eax_b", "eax_c");
    assert!(refused(&format!("{}{}{third}", free(TRACK), free(TABLE))).contains("in addition to 2 others"));
    assert!(refused(&format!("{TRACK}max_speed = 0.0\n")).contains("max_speed"));
}

#[test]
fn a_gain_counts_targets_that_both_turns_reach() {
    let mut seen = [false; 3];
    for turn in (0..360).step_by(60) {
        let cell = cell(&format!("spin = \"stiffest\"\nspin_deg = {turn}\n"), FIXED);
        let corrected = compensate(&path(&cell), &cell, &Options::default()).unwrap();
        let said = note(&corrected);
        assert!(!said.contains("-0.0") && !said.contains("NaN"), "{said}");
        let unreached =
            |n: &usize| said.ends_with(&format!("; with `spin_deg` throughout, {n} targets are out of reach"));
        let unreached = (1..=TARGETS).find(unreached).unwrap_or(0);
        let reached = TARGETS - unreached;
        assert_eq!(said.contains(", "), reached > 0, "{said}");
        let on = format!("with the chosen one on the {reached} that both reach");
        assert_eq!(said.contains(&on), unreached > 0 && reached > 0, "{said}");
        seen[usize::from(unreached > 0) + usize::from(reached == 0)] = true;
    }
    assert!(seen[0] && (seen[1] || seen[2]), "{seen:?}");
}
