//! The way into a target: what a correction says of it is what the corrected program is judged to have.

use crate::dense_walk::{CELL, module, read};
use crate::units::{TABLE, TRACK, cell as cell_with};
use deflex::cell::Cell;
use deflex::correct::{Corrected, Options, Row, Status, WayFault, WayFinding, compensate, predict};
use deflex::program::{Program, krl, rapid};
use deflex::robot::LimitedAngle;
use deflex::text::{Source, applied};
use deflex_oracles::walk::{Way, followed};
use std::fmt::Write;

/// Agreement, mm.
const AGREED_MM: f64 = 1e-3;

/// SplitMix64: the same programs on every machine.
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(0x1234_5678))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn of(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }
}

/// One program of a language: its text and what cell it is for.
struct Drawn {
    text: String,
    is_krl: bool,
    units: String,
}

const WOBJ: &str = "[FALSE,TRUE,\"\",[[1300,0,900],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]";
const KRL_FRAMES: &str = "[tools.\"TOOL_DATA[1]\"]
tcp_mm = [20.0, 0.0, 210.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 18.0
cog_mm = [0.0, 0.0, 120.0]
[wobjs.\"BASE_DATA[1]\"]
uframe_mm = [1300.0, 0.0, 900.0]
uframe_quat = [1.0, 0.0, 0.0, 0.0]
";

fn place(dice: &mut Dice) -> [f64; 3] {
    [dice.within(-60.0, 90.0), dice.within(-80.0, 80.0), dice.within(-15.0, 25.0)]
}

/// Motor angles about over the part.
fn joints(dice: &mut Dice) -> String {
    let about = [0.0, 15.0, 15.0, 0.0, 55.0, 0.0];
    about.map(|about| format!("{:.3}", about + dice.within(-4.0, 4.0))).join(",")
}

fn drawn_rapid(dice: &mut Dice) -> Drawn {
    let on = dice.of(3);
    let external = |dice: &mut Dice| match on {
        0 => "9E9,9E9,9E9,9E9,9E9,9E9".to_owned(),
        1 => format!("{:.2},9E9,9E9,9E9,9E9,9E9", dice.within(-80.0, 80.0)),
        _ => format!("9E9,{:.2},9E9,9E9,9E9,9E9", dice.within(-5.0, 5.0)),
    };
    let robtarget = |dice: &mut Dice| {
        let [x, y, z] = place(dice);
        let (b, c) = (dice.within(-0.06, 0.06), dice.within(-0.06, 0.06));
        let norm = (1.0 + b * b + c * c).sqrt();
        let external = external(dice);
        format!("[[{x:.3},{y:.3},{z:.3}],[{:.8},{:.8},{:.8},0],[0,0,0,0],[{external}]]", b / norm, c / norm, 1.0 / norm)
    };
    let mut text = format!(
        "MODULE M\n  PERS tooldata tA:=[TRUE,[[20,0,210],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n  PERS wobjdata wA:={WOBJ};\n"
    );
    for name in ["pA", "pB"] {
        let _ = writeln!(text, "  CONST robtarget {name}:={};", robtarget(dice));
    }
    text += "  VAR num n;\n  PROC main()\n";
    for at in 0..4 + dice.of(5) {
        let zone = ["fine", "z0", "z1"][dice.of(3)];
        let end = format!("v{},{zone},tA\\WObj:=wA;", [20, 50, 200][dice.of(3)]);
        // Most programs begin with a joint motion, some go on with one.
        let line = match if at == 0 { dice.of(3) } else { dice.of(12) } {
            0 => format!("MoveAbsJ [[{}],[{}]]\\NoEOffs,v200,fine,tA\\WObj:=wA;", joints(dice), external(dice)),
            1 => format!("MoveJ {},{end}", robtarget(dice)),
            // Used for several motions: some of these are kept.
            2 | 3 => format!("MoveL {},{end}", ["pA", "pB"][dice.of(2)]),
            // Known at run time only.
            4 if dice.of(3) == 0 => format!("n:=DOutput(do1);\n    MoveL Offs(pA,n,0,0),{end}"),
            5 if on == 0 => format!("MoveC {},{},{end}", robtarget(dice), robtarget(dice)),
            _ => format!("MoveL {},{end}", robtarget(dice)),
        };
        let _ = writeln!(text, "    {line}");
    }
    text += "  ENDPROC\nENDMODULE\n";
    Drawn { text, is_krl: false, units: [String::new(), TRACK.to_owned(), TABLE.to_owned()][on].clone() }
}

fn drawn_krl(dice: &mut Dice) -> Drawn {
    let mut text = "&ACCESS RVP\nDEF part( )\n  $BASE=BASE_DATA[1]\n  $TOOL=TOOL_DATA[1]\n  $VEL.CP=0.05\n".to_owned();
    let pose = |dice: &mut Dice| {
        let [x, y, z] = place(dice);
        format!("X {x:.3},Y {y:.3},Z {z:.3},A {:.3},B {:.3},C 180", dice.within(-4.0, 4.0), dice.within(-4.0, 4.0))
    };
    for at in 0..4 + dice.of(5) {
        let line = match if at == 0 { dice.of(3) } else { dice.of(10) } {
            0 => {
                let axes = joints(dice);
                let axes: Vec<String> =
                    axes.split(',').enumerate().map(|(i, angle)| format!("A{} {angle}", i + 1)).collect();
                format!("PTP {{{}}}", axes.join(","))
            }
            1 => format!("PTP {{{}}}", pose(dice)),
            // Only a part of it is written.
            2 if at > 1 => format!("LIN {{X {:.3}}}", dice.within(-60.0, 90.0)),
            _ => format!("LIN {{{}}}", pose(dice)),
        };
        let _ = writeln!(text, "  {line}");
    }
    text += "END\n";
    Drawn { text, is_krl: true, units: KRL_FRAMES.to_owned() }
}

impl Drawn {
    fn read(&self, text: &[u8]) -> Program {
        let source = |name: &str| vec![Source::new(name, text)];
        let read = if self.is_krl {
            krl::read(source("part.src"), Vec::new())
        } else {
            rapid::read(source("part.mod"), Vec::new())
        };
        read.unwrap_or_else(|errors| panic!("{errors:?}\n{}", String::from_utf8_lossy(text)))
    }
}

/// Figures of all ways together: the largest distance, and the mean of its square over the length.
fn ways(rows: &[Row]) -> [f64; 2] {
    let paths = || rows.iter().filter_map(|row| row.path);
    let length: f64 = paths().map(|path| path.length_mm).sum();
    let sum: f64 = paths().map(|path| path.mean_square_mm2 * path.length_mm).sum();
    [paths().map(|path| path.max_mm).fold(0.0, f64::max), (sum / length.max(1e-9)).sqrt()]
}

fn agree(drawn: &Drawn, cell: &Cell, subdivide: Option<f64>, tally: &mut [usize; 3]) {
    let original = drawn.read(drawn.text.as_bytes());
    let options = Options { subdivide, ..Options::default() };
    let Ok(reported) = compensate(&original, cell, &options) else { return };
    let Corrected { failures, rewritten: Some(rewritten), rows, .. } = &reported else {
        panic!("RAPID and KRL are edited")
    };
    if !failures.is_empty() {
        return;
    }
    let text = applied(&original.sources[0].bytes, &rewritten.edits[0]);
    let shown = String::from_utf8_lossy(&text);
    let given = drawn.read(&text);
    let judged = match predict(&given, cell, &Options::default(), Some(&original)) {
        Ok(judged) => judged,
        Err(refused) => panic!("{refused:?}\n{}\n{shown}", drawn.text),
    };
    let close = |what: &str, reported: f64, judged: f64| {
        assert!(
            (reported - judged).abs() <= AGREED_MM,
            "{what}: {reported} reported, {judged} judged\n{}\n{shown}",
            drawn.text
        );
    };
    for ((what, reported), judged) in ["largest", "rms"].into_iter().zip(ways(rows)).zip(ways(&judged.rows)) {
        close(what, reported, judged);
    }
    tally[0] += 1;
    tally[1] += usize::from(judged.rows.len() > rows.len());
    if judged.rows.len() > rows.len() {
        return;
    }
    assert_eq!(rows.len(), judged.rows.len(), "{}", drawn.text);
    for (reported, judged) in rows.iter().zip(&judged.rows) {
        assert_eq!((reported.target, reported.is_solved()), (judged.target, judged.is_solved()), "{}", drawn.text);
        let what = format!("target {}", reported.target);
        let [own, other] = [reported, judged].map(|row| row.remaining_path_mm());
        assert_eq!(
            own.is_some(),
            other.is_some(),
            "{what}: {own:?} reported, {other:?} judged\n{}\n{shown}",
            drawn.text
        );
        if let Some((own, other)) = own.zip(other) {
            close(&format!("{what}, its way"), own, other);
        }
        if reported.is_solved() {
            close(&what, reported.remaining_norm_mm(), judged.error_norm_mm());
        }
        tally[2] += usize::from(matches!(reported.status, Status::Kept(_)));
    }
}

#[test]
fn a_correction_and_its_judgement_agree_on_every_way() {
    let (mut whole, mut subdivided) = ([0; 3], [0; 3]);
    for seed in 0..200 {
        let mut dice = Dice::new(seed);
        let drawn = if dice.of(3) == 0 { drawn_krl(&mut dice) } else { drawn_rapid(&mut dice) };
        // The cell ends with its backlash: sharp, or built up over an angle of each joint.
        let friction = if seed % 2 == 1 { "presliding_rad = [1e-3, 3e-4, 2e-3, 1e-3, 3e-3, 5e-4]\n" } else { "" };
        let cell = cell_with([0.0; 3], &format!("{friction}{}", drawn.units));
        agree(&drawn, &cell, None, &mut whole);
        agree(&drawn, &cell, Some(3e-5), &mut subdivided);
    }
    println!("judged, with inserted targets, kept targets: {whole:?} and {subdivided:?}");
    // Some programs go out of reach or past a limit.
    assert!(whole[0] > 150 && whole[2] > 100, "{whole:?}");
    assert!(subdivided[0] > 150 && subdivided[1] > 60, "{subdivided:?}");
}

/// What is found on the ways of a program, whose cell has these keys in place of wide limits; `None` of one that is refused.
fn found(
    text: &str,
    start: &[f64; 6],
    (min, max): (&[f64; 6], &[f64; 6]),
    speed: Option<[f64; 6]>,
) -> Option<Vec<WayFinding>> {
    let speed = speed.map_or_else(String::new, |speed| format!("axis_speed_deg_s = {speed:?}\n"));
    let limits = format!("axis_min_deg = {min:?}\naxis_max_deg = {max:?}\n{speed}");
    let cell = CELL
        .replace("start_deg = [0, 0, 0, 0, 60, 0]", &format!("start_deg = {start:?}"))
        .replace("axis_min_deg = [-360, -360, -360, -360, -360, -360]\n", "")
        .replace("axis_max_deg = [360, 360, 360, 360, 360, 360]\n", &limits);
    let cell = Cell::read(&Source::new("cell.toml", cell)).unwrap();
    // A circle point beyond a limit is refused as any target is.
    let predicted = predict(&read(text), &cell, &Options::default(), None).ok()?;
    assert!(predicted.failures.is_empty(), "{:?}", predicted.failures);
    Some(predicted.on_the_way)
}

/// Two motions: a line, sometimes an arc, of a length between a millimetre and a metre, at 50 mm/s.
fn drawn_way(dice: &mut Dice) -> String {
    let size = 10_f64.powf(dice.within(0.0, 3.0));
    let start = [dice.within(-200.0, 200.0), dice.within(-400.0, 100.0), dice.within(-100.0, 300.0)];
    let lean = 0.5 * (size / 300.0).min(1.0);
    let quat = |dice: &mut Dice| {
        let (b, d) = (dice.within(-lean, lean), dice.within(-lean, lean));
        let norm = (1.0 + b * b + d * d).sqrt();
        format!("[{:.9},0,{:.9},{:.9}]", b / norm, 1.0 / norm, d / norm)
    };
    let target = |dice: &mut Dice, [x, y, z]: [f64; 3]| {
        format!("[[{x:.4},{y:.4},{z:.4}],{},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]", quat(dice))
    };
    let way = [dice.within(-0.6, 0.6), dice.within(-1.0, 1.0), dice.within(-0.5, 0.5)].map(|part| part * size);
    let at = |share: f64, across: f64| {
        [
            start[0] + share * way[0] - across * way[1],
            start[1] + share * way[1] + across * way[0],
            start[2] + share * way[2],
        ]
    };
    let end = "v50,fine,tMill\\WObj:=wPart;";
    let second = if dice.of(3) == 0 {
        format!("MoveC {},{},{end}", target(dice, at(0.5, 0.3)), target(dice, at(1.0, 0.0)))
    } else {
        format!("MoveL {},{end}", target(dice, at(1.0, 0.0)))
    };
    let first = format!("    MoveL {},{end}\n", target(dice, start));
    module(&format!("{first}    {second}\n"))
}

const WIDE: [f64; 6] = [360.0; 6];

/// Of a densely followed way: the largest angle of each axis beyond that of both ends, with its share, degrees.
fn beyond_ends(way: &[[f64; 6]], axis: usize) -> (f64, f64) {
    let last = way.len() - 1;
    let ends = way[0][axis].max(way[last][axis]);
    let most = (0..=last).max_by(|a, b| way[*a][axis].total_cmp(&way[*b][axis])).unwrap();
    (way[most][axis] - ends, most as f64 / last as f64)
}

#[test]
fn a_limit_that_is_passed_between_targets_is_found_whatever_the_length() {
    const STEPS: usize = 800;
    // Enough to find the paths on which an axis turns back. Few have such a place, and the fine steps take most of the time.
    const COARSE_STEPS: usize = 100;
    let mut tally = [0; 6];
    for seed in 0..720 {
        let text = drawn_way(&mut Dice::new(7_000 + seed));
        let joints = |steps| -> Vec<[f64; 6]> {
            followed(&text, steps).joints.iter().map(|q| q.map(f64::to_degrees).into()).collect()
        };
        let coarse = joints(COARSE_STEPS);
        if (0..6).all(|axis| beyond_ends(&coarse, axis).0 < 0.04) {
            continue;
        }
        let way = joints(STEPS);
        if way.iter().any(|q| q[4] < 15.0) {
            continue;
        }
        for axis in 0..6 {
            let (beyond, share) = beyond_ends(&way, axis);
            if beyond < 0.05 {
                continue;
            }
            let most = way.iter().map(|q| q[axis]).fold(f64::NEG_INFINITY, f64::max);
            let min = WIDE.map(|wide| -wide);
            // Below the bulge, and just above it.
            let mut max = WIDE;
            max[axis] = most - 0.6 * beyond;
            let Some(faults) = found(&text, &way[0], (&min, &max), None) else { continue };
            let [fault] = &faults[..] else {
                panic!("{seed}, axis {}, {beyond} beyond at {share}: {faults:?}\n{text}", axis + 1)
            };
            assert_eq!((fault.fault, fault.angle, fault.index > 0), (WayFault::AxisLimit, self::axis(axis + 1), true));
            assert!(
                (fault.value - most).abs() < 0.012 && (fault.limit - max[axis]).abs() < 1e-9,
                "{seed}: {fault:?} {most}\n{text}"
            );
            let near = way[(fault.share * STEPS as f64).round() as usize][axis];
            assert!((near - fault.value).abs() < 0.1, "{fault:?}: {near} there, {share}");
            max[axis] = most + 0.001;
            assert_eq!(found(&text, &way[0], (&min, &max), None).unwrap(), []);
            tally[axis] += 1;
        }
    }
    println!("limits passed between targets: {tally:?}");
    assert!(tally.iter().sum::<usize>() > 45, "{tally:?}");
}

#[test]
fn the_fastest_place_of_a_way_is_found() {
    const STEPS: usize = 2000;
    let mut judged = 0;
    for seed in 0..80 {
        let text = drawn_way(&mut Dice::new(9_000 + seed));
        let Way { joints, length } = followed(&text, STEPS);
        let way: Vec<[f64; 6]> = joints.iter().map(|q| q.map(f64::to_degrees).into()).collect();
        if way.iter().any(|q| q[4] < 3.0) {
            continue;
        }
        let speeds: Vec<f64> = (0..6)
            .map(|axis| way.windows(2).map(|pair| (pair[1][axis] - pair[0][axis]).abs()).fold(0.0, f64::max))
            .collect();
        let fastest = (0..6).max_by(|a, b| speeds[*a].total_cmp(&speeds[*b])).unwrap();
        let exact = speeds[fastest];
        let mut limits = [1e4; 6];
        for (factor, is_found) in [(0.95, true), (1.05, false)] {
            let duration = length / 50.0;
            limits[fastest] = factor * exact * STEPS as f64 / duration;
            let faults = found(&text, &way[0], (&WIDE.map(|wide| -wide), &WIDE), Some(limits)).unwrap();
            assert_eq!(!faults.is_empty(), is_found, "{seed}, {factor}: {faults:?}\n{text}");
            if let Some(fault) = faults.first() {
                assert_eq!((fault.fault, fault.angle), (WayFault::AxisSpeed, axis(fastest + 1)));
                let value = exact * STEPS as f64 / duration;
                assert!((fault.value / value - 1.0).abs() < 0.03, "{seed}: {fault:?} {value}\n{text}");
            }
        }
        judged += 1;
    }
    assert!(judged > 40, "{judged}");
}

/// A cell of a library robot for targets in its base.
fn at_base(robot: &str, more: &str) -> Cell {
    let text = format!(
        "[robot]\nmodel = \"{robot}\"\n{more}[robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n\
         [controller]\ncompensates = []\n[cut]\nforce = \"none\"\n"
    );
    Cell::read(&Source::new("cell.toml", text)).unwrap()
}

/// Lines between places given by axis angles (degrees) of a library robot, tool0 in the base, at a speed.
fn between_axes(cell: &Cell, places: &[[f64; 6]], speed: &str) -> Program {
    let mut text = "MODULE M\n  PROC main()\n".to_owned();
    let axes = places[0].map(|angle| format!("{angle:.6}")).join(",");
    let _ = writeln!(text, "    MoveAbsJ [[{axes}],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,fine,tool0;");
    for place in &places[1..] {
        let robot = &cell.arm.robot;
        let pose = robot.forward(&robot.motor_from_axes_deg(place));
        let at = pose.translation.vector * 1e3;
        let q = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.rotation);
        let _ = writeln!(
            text,
            "    MoveL [[{:.6},{:.6},{:.6}],[{:.10},{:.10},{:.10},{:.10}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{speed},fine,tool0;",
            at.x, at.y, at.z, q.w, q.i, q.j, q.k
        );
    }
    text += "  ENDPROC\nENDMODULE\n";
    rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap()
}

/// The angle of an axis, from 1.
fn axis(axis: usize) -> Option<LimitedAngle> {
    Some(LimitedAngle::Axis(axis))
}

fn kinds(cell: &Cell, program: &Program) -> Vec<(WayFault, Option<LimitedAngle>)> {
    let predicted = predict(program, cell, &Options::default(), None).unwrap();
    assert!(predicted.failures.is_empty(), "{:?}", predicted.failures);
    predicted.on_the_way.iter().map(|found| (found.fault, found.angle)).collect()
}

#[test]
fn a_singular_wrist_on_the_way_is_found_and_its_speed() {
    let cell = at_base("irb6700-150-3.20", "");
    let at = |a4: f64, a5: f64| [5.0, 20.0, 15.0, a4, a5, 10.0];
    // Axis 5 runs through zero between two targets that keep off it.
    let through = between_axes(&cell, &[at(0.0, 6.0), at(0.0, -5.0)], "v20");
    assert!(kinds(&cell, &through).contains(&(WayFault::Singular, axis(5))), "{:?}", kinds(&cell, &through));
    // A target that stands in it.
    let into = between_axes(&cell, &[at(0.0, 6.0), at(0.0, 0.0)], "v20");
    assert!(kinds(&cell, &into).contains(&(WayFault::Singular, axis(5))), "{:?}", kinds(&cell, &into));
    // Past it by two degrees: axis 4 turns by half a turn, at a speed that depends on the feed.
    let past = |speed| between_axes(&cell, &[at(80.0, 2.5), at(-80.0, 2.5)], speed);
    assert!(kinds(&cell, &past("v100")).contains(&(WayFault::AxisSpeed, axis(4))), "{:?}", kinds(&cell, &past("v100")));
    let far = between_axes(&cell, &[at(0.0, 30.0), at(5.0, 35.0)], "v20");
    assert_eq!(kinds(&cell, &far), []);
}

#[test]
fn a_path_that_leads_out_of_reach_between_targets_is_found() {
    // The wrist centre goes down past axis 2, where the arm cannot fold enough: from 0.3 m over it to 0.3 m under it.
    let at = |z: f64| format!("MoveL [[-560,250,{z}],[0.70710678,0,0.70710678,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]");
    let end = "v50,fine,tMill\\WObj:=wPart;";
    let text = module(&format!("    {},{end}\n    {},{end}\n", at(460.0), at(-140.0)));
    let faults = found(&text, &[0.0, -60.0, 60.0, 0.0, 60.0, 0.0], (&WIDE.map(|wide| -wide), &WIDE), None).unwrap();
    let fault = faults.iter().find(|fault| fault.fault == WayFault::Unreachable).expect("a way out of reach");
    // 85 mm are the difference of both arms' lengths; the middle of the way is 10 mm from axis 2.
    assert!(fault.value > 20.0 && fault.value < 85.0 && (fault.share - 0.5).abs() < 0.2, "{fault:?}");
}

#[test]
fn library_robots_know_their_axis_speeds() {
    let robots = deflex::robot::BUILTIN.iter();
    let unknown: Vec<&str> =
        robots.filter(|robot| robot.axis_speed_deg_s.is_none()).map(|robot| &*robot.model).collect();
    assert!(deflex::robot::BUILTIN.len() - unknown.len() >= 116, "{unknown:?}");
}

/// Far targets over a sheet, the spindle at 45° on the flange: where the turn is free, the wrist goes anywhere between them.
fn sparse(dice: &mut Dice) -> String {
    let mut text = "UNITS/MM\nMULTAX/ON\nFEDRAT/6000,MMPM\n".to_owned();
    for _ in 0..4 {
        let [x, y, z] = [dice.within(-150.0, 250.0), dice.within(-300.0, 300.0), dice.within(-50.0, 100.0)];
        let (a, b) = (dice.within(-0.5, 0.5), dice.within(-0.5, 0.5));
        let norm = (1.0 + a * a + b * b).sqrt();
        let _ = writeln!(text, "GOTO/{x:.3},{y:.3},{z:.3},{:.6},{:.6},{:.6}", a / norm, b / norm, 1.0 / norm);
    }
    text + "FINI\n"
}

#[test]
fn a_free_turn_takes_no_way_that_the_arm_cannot_go() {
    let text = "[robot]\nmodel = \"irb6660-205-1.9\"\n[robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n\
        [controller]\ncompensates = []\n[tools.tA]\ntcp_mm = [150.0, 0.0, 260.0]\ntcp_quat = [0.92387953, 0.0, 0.38268343, 0.0]\n\
        [wobjs.wA]\nuframe_mm = [1300.0, 0.0, 900.0]\nuframe_quat = [1.0, 0.0, 0.0, 0.0]\n[cl]\ntool = \"tA\"\nwobj = \"wA\"\nunits = \"mm\"\n\
        spin = \"stiffest\"\n[cut]\nforce = \"constant\"\nforce_n = [120, -260, 410]\nframe = \"wobj\"\n";
    let cell = Cell::read(&Source::new("cell.toml", text)).unwrap();
    let (mut taken, mut refused) = (0, Vec::new());
    for seed in 0..8 {
        let text = sparse(&mut Dice::new(500 + seed));
        let source = Source::new("m.apt", text.clone().into_bytes());
        let program = deflex::program::cl::read(source, &cell.cl.as_ref().unwrap().options).unwrap();
        match predict(&program, &cell, &Options::default(), None) {
            Ok(predicted) => {
                assert_eq!(predicted.on_the_way, [], "{text}");
                taken += 1;
            }
            Err(why) => refused.push(why[0].message.clone()),
        }
    }
    println!("{taken} taken; refused: {refused:?}");
    assert!(taken >= 2, "{taken}: {refused:?}");
}
