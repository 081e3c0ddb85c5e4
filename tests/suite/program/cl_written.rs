//! Corrected CL data (`--post cl`): read again, they say what was posted; what makes no points is as it was.

use deflex::cell::Cell;
use deflex::correct::{self, Corrected, Options, PostOptions};
use deflex::program::cl::{self, ClOptions, CorrectedPoint};
use deflex::program::{ActionKind, Goal, Language, Program, Target};
use deflex::text::{Diagnostic, Source};

const CELL: &str = r#"
[robot]
model = "kr210-r2700-2"
start_deg = [0, -90, 90, 0, 60, 0]
[robot.stiffness]
joint_nm_per_rad = [6e5, 5e5, 4e5, 9e4, 8e4, 5e4]
[limits]
max_correction_mm = 100.0
max_step_mm = 500.0
[controller]
compensates = []
[tools.t1]
tcp_mm = [0.0, 0.0, 200.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 5.0
cog_mm = [0.0, 0.0, 80.0]
[wobjs.w1]
uframe_mm = [1600.0, 100.0, 600.0]
uframe_quat = [1.0, 0.0, 0.0, 0.0]
oframe_mm = [0.0, 0.0, 0.0]
oframe_quat = [1.0, 0.0, 0.0, 0.0]
[cl]
tool = "t1"
wobj = "w1"
spin = "fixed"
spin_deg = 180.0
[cut]
force = "constant"
force_n = [310.0, -190.0, 240.0]
frame = "wobj"
"#;

fn options(cell: &Cell) -> ClOptions {
    cell.cl.as_ref().map(|cl| cl.options.clone()).unwrap()
}

fn post_options() -> PostOptions {
    PostOptions {
        name: "part".into(),
        title: vec!["posted by deflex from part.apt".into()],
        max_targets: None,
        rapid_mm_s: 200.0,
        feed_mm_s: None,
        language: Language::Cl,
    }
}

fn read(text: &str, options: &ClOptions) -> Program {
    cl::read(Source::new("part.apt", text), options).unwrap_or_else(|errors| panic!("{errors:?}\n{text}"))
}

/// The corrected program and the text written of it.
fn written(text: &str, options: &ClOptions, subdivide: Option<f64>) -> Result<(Corrected, String), Vec<Diagnostic>> {
    written_in(CELL, text, options, subdivide)
}

fn written_in(
    cell: &str,
    text: &str,
    options: &ClOptions,
    subdivide: Option<f64>,
) -> Result<(Corrected, String), Vec<Diagnostic>> {
    let cell = Cell::read(&Source::new("cell.toml", cell))?;
    let program = read(text, options);
    let run = Options { post: Some(Language::Cl), subdivide, ..Options::default() };
    let corrected = correct::compensate(&program, &cell, &run)?;
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let posted = correct::post(&program, &cell, &corrected, &post_options())?;
    let [(name, bytes)] = &posted.files[..] else { panic!("{:?}", posted.files) };
    assert_eq!(name, "part.cl");
    Ok((corrected, String::from_utf8(bytes.clone()).unwrap()))
}

/// Reads what was written, and compares with what was posted: places, axes, feeds, rapid travel and dwells.
fn posted_and_read_again(text: &str, options: &ClOptions, subdivide: Option<f64>) -> String {
    let (corrected, written) = written(text, options, subdivide).unwrap();
    let (program, again) = (read(text, options), read(&written, options));
    assert!(again.kept.iter().all(|kept| !kept.fault), "{:?}\n{written}", again.kept);
    assert_eq!(again.targets.len(), corrected.posted.len(), "{written}");
    assert!(!again.targets.is_empty());
    for (target, posted) in again.targets.iter().zip(&corrected.posted) {
        let Goal::Axis { position_mm, axis, .. } = target.goal else { panic!("{target:?}") };
        let off = (0..3).map(|i| (position_mm[i] - posted.position_mm[i]).abs()).fold(0.0, f64::max);
        // The third column of the matrix of a quaternion, turned about: the tool axis is -z.
        let [w, x, y, z] = posted.quat;
        let wanted = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)].map(|v| -v);
        let tilt = (0..3).map(|i| (axis[i] - wanted[i]).abs()).fold(0.0, f64::max);
        // Four decimals of a millimetre, in single precision; as many of an inch that is one hundred times as fine.
        assert!(off < 1.5e-4 && tilt < 2e-7, "{off} mm {tilt}: {target:?} {posted:?}\n{written}");
        same_speed(&program.targets[posted.target], target, &written);
    }
    assert_eq!(dwells(&program), dwells(&again), "{written}");
    written
}

fn same_speed(was: &Target, is: &Target, written: &str) {
    let [a, b] = [was, is].map(|target| target.feed_mm_s.unwrap_or(-1.0));
    // Six decimals of what FEDRAT counts.
    assert!(was.rapid == is.rapid && (a - b).abs() <= 1e-5 * a.abs(), "{was:?} {is:?}\n{written}");
}

fn dwells(program: &Program) -> Vec<ActionKind> {
    let kinds = program.actions.iter().map(|action| action.kind.clone());
    kinds.filter(|kind| matches!(kind, ActionKind::Dwell { .. })).collect()
}

/// All actions of the machine other than motions, and the target before which each stands.
fn actions(program: &Program) -> Vec<(usize, ActionKind)> {
    program.actions.iter().map(|action| (action.before, action.kind.clone())).collect()
}

/// The same of a file of positions alone: all its other statements are as they were.
fn says_what_was_posted(text: &str, options: &ClOptions, subdivide: Option<f64>) -> String {
    let written = posted_and_read_again(text, options, subdivide);
    let statements = |text: &str| -> Vec<String> {
        let own = |line: &&str| {
            !line.starts_with("GOTO")
                && !line.starts_with("  ")
                && !line.starts_with("$$ posted")
                && *line != "MULTAX/ON"
                && (subdivide.is_none() || *line != "RAPID")
        };
        text.lines().filter(own).map(str::to_owned).collect()
    };
    assert_eq!(statements(text), statements(&written), "{written}");
    written
}

const PATH: &str = "PARTNO PART 1\r\nUNITS/MM\r\nPPRINT AS IT STANDS, GOTO/1,2,3\r\nLOADTL/1\r\nSPINDL/9000,CLW\r\nRAPID\r\n\
    GOTO/0.0,0.0,80.0,0.0,0.0,1.0\r\nFEDRAT/600,MMPM\r\nGOTO/0.0,0.0,0.0\r\nGOTO/40.5,0.25,-1.0,0.08715574,0.0,0.99619470\r\n\
    COOLNT/ON\r\nGOTO/80.123456,1.0,$\r\n  -1.5,0.08715574,0.0,0.99619470\r\nRAPID\r\nGOTO/80.0,1.0,100.0\r\nFINI\r\n";

fn plain() -> ClOptions {
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    ClOptions { any_tool: true, ..options(&cell) }
}

#[test]
fn corrected_cl_data_say_what_is_posted() {
    let written = says_what_was_posted(PATH, &plain(), None);
    assert!(written.starts_with("$$ posted by deflex from part.apt\r\nPARTNO PART 1\r\n"), "{written}");
    // Written once, before the first point.
    assert_eq!(written.matches("MULTAX/ON\r\n").count(), 1);
    assert!(!written.contains("GOTO/40.5,0.25"), "{written}");
    let multax = PATH.replace("LOADTL", "MULTAX\r\nLOADTL");
    assert_eq!(says_what_was_posted(&multax, &plain(), None).matches("MULTAX").count(), 1);
}

#[test]
fn points_in_inches_and_of_the_corners_centre_are_written_as_they_are_read() {
    let inches = PATH
        .replace("UNITS/MM", "UNITS/INCHES")
        .replace("MMPM", "IPM")
        .replace("40.5", "1.5")
        .replace("80.123456", "3.1")
        .replace("80.0", "3.0")
        .replace("100.0", "4.0");
    says_what_was_posted(&inches, &plain(), None);
    let centre = ClOptions { point: cl::Point::Centre, corner_radius_mm: Some(6.0), ..plain() };
    says_what_was_posted(PATH, &centre, None);
}

#[test]
fn inserted_points_stand_before_their_target() {
    let written = says_what_was_posted(PATH, &plain(), Some(0.0005));
    assert!(written.matches("GOTO/").count() > PATH.matches("GOTO/").count(), "{written}");
}

/// What a program is written as when all its points move alike.
fn shifted(text: &str, options: &ClOptions, shift: [f64; 3]) -> String {
    let program = read(text, options);
    let point = |(target, at): (usize, &Target)| {
        let Goal::Axis { position_mm, axis, .. } = at.goal else { panic!("{at:?}") };
        CorrectedPoint { target, position_mm: [0, 1, 2].map(|i| position_mm[i] + shift[i]), axis }
    };
    let points: Vec<_> = program.targets.iter().enumerate().map(point).collect();
    String::from_utf8(cl::write(&program, &points, &[]).unwrap()).unwrap()
}

const SHIFT: [f64; 3] = [0.1, -0.2, 0.3];

#[test]
fn a_quarter_arc_is_written_as_the_ends_of_its_chords() {
    // Chords of 30° on a radius of 10 mm are 10·(1 − cos 15°) = 0.341 mm off; those of 45° 0.761 mm.
    let options = ClOptions { arc_tolerance_mm: 0.35, ..plain() };
    let text = "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/10,0,0,0,0,1\nCIRCLE/0,0,0,$\n  0,0,1,10\nCOOLNT/ON\nGOTO/0,10,0\nRAPID\n\
                GOTO/0,10,50\nFINI\n";
    let up = "0.00000000,0.00000000,1.00000000";
    let wanted = format!(
        "UNITS/MM\nFEDRAT/600,MMPM\nMULTAX/ON\nGOTO/10.1000,-0.2000,0.3000,0,0,1\n$$ CIRCLE/0,0,0,$\n$$   0,0,1,10\n\
         COOLNT/ON\nGOTO/8.7603,4.8000,0.3000,{up}\nGOTO/5.1000,8.4603,0.3000,{up}\nGOTO/0.1000,9.8000,0.3000,{up}\n\
         RAPID\nGOTO/0.1000,9.8000,50.3000,{up}\nFINI\n"
    );
    assert_eq!(shifted(text, &options, SHIFT), wanted);
}

#[test]
fn two_holes_are_written_as_their_moves_with_the_feed_and_the_dwell_of_the_cycle() {
    let text = "UNITS/MM\nFEDRAT/600,MMPM\nMULTAX/ON\nRAPID\nGOTO/0,0,50,0,0,1\n\
                CYCLE/DRILL,DEPTH,10,MMPM,120,CLEAR,2,RETURN,20,DWELL,0.5\nGOTO/0,0,0\nGOTO/30,0,0\nCYCLE/OFF\n\
                GOTO/30,0,40\nGOTO/30,0,41\nFINI\n";
    let up = "0.00000000,0.00000000,1.00000000";
    let wanted = format!(
        "UNITS/MM\nFEDRAT/600,MMPM\nMULTAX/ON\nRAPID\nGOTO/0.1000,-0.2000,50.3000,0,0,1\n\
         $$ CYCLE/DRILL,DEPTH,10,MMPM,120,CLEAR,2,RETURN,20,DWELL,0.5\n\
         RAPID\nGOTO/0.1000,-0.2000,2.3000,{up}\nFEDRAT/120.0,MMPM\nGOTO/0.1000,-0.2000,-9.7000,{up}\nDELAY/0.5\n\
         RAPID\nGOTO/0.1000,-0.2000,20.3000,{up}\n$$ GOTO/0,0,0\n\
         RAPID\nGOTO/30.1000,-0.2000,20.3000,{up}\nRAPID\nGOTO/30.1000,-0.2000,2.3000,{up}\n\
         GOTO/30.1000,-0.2000,-9.7000,{up}\nDELAY/0.5\nRAPID\nGOTO/30.1000,-0.2000,20.3000,{up}\n$$ GOTO/30,0,0\n\
         $$ CYCLE/OFF\nFEDRAT/600.0,MMPM\nGOTO/30.1000,-0.2000,40.3000,{up}\n\
         GOTO/30.1000,-0.2000,41.3000,{up}\nFINI\n"
    );
    assert_eq!(shifted(text, &plain(), SHIFT), wanted);
}

/// The places of `GOTO/` lines, by splitting text alone.
fn places(text: &str) -> Vec<[f64; 3]> {
    let numbers = |line: &str| -> Vec<f64> { line.split(',').map(|number| number.trim().parse().unwrap()).collect() };
    text.lines()
        .filter_map(|line| line.strip_prefix("GOTO/"))
        .map(|line| numbers(line)[..3].try_into().unwrap())
        .collect()
}

#[test]
fn an_arc_by_another_reading_is_the_arc_within_the_tolerance() {
    // Three quarters about (20, 5), clockwise, in inches: the axis points down.
    let text = "UNITS/INCHES\nFEDRAT/20,IPM\nGOTO/3,5,1,0,0,1\nCIRCLE/2,5,1,0,0,-1,1\nGOTO/2,6,1\nFINI\n";
    for tolerance in [0.005, 0.1] {
        let options = ClOptions { arc_tolerance_mm: tolerance, ..plain() };
        let written = places(&shifted(text, &options, [25.4, 0.0, 0.0]));
        let from_centre = |at: [f64; 3]| [at[0] - 3.0, at[1] - 5.0];
        let mut turned = 0.0;
        for two in written.windows(2) {
            let [a, b] = [from_centre(two[0]), from_centre(two[1])];
            let middle = f64::hypot(0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]));
            // Six decimals of an inch.
            assert!((f64::hypot(b[0], b[1]) - 1.0).abs() < 2e-6 && (two[1][2] - 1.0).abs() < 2e-6, "{two:?}");
            assert!(25.4 * (1.0 - middle) < tolerance + 1e-4, "{two:?}");
            let step = (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1]).to_degrees();
            assert!(step < 0.0, "{two:?}");
            turned += step;
        }
        assert!((turned + 270.0).abs() < 1e-3, "{turned}");
        assert!(written.len() > 20 && written.last() == Some(&[3.0, 6.0, 1.0]), "{written:?}");
    }
}

#[test]
fn arcs_holes_increments_and_lists_say_what_is_posted() {
    let start = "UNITS/MM\nSPINDL/3000,CLW\nRAPID\nGOTO/40,0,50,0,0,1\nFEDRAT/600,MMPM\nGOTO/40,0,0\n";
    let ways = [
        "CIRCLE/0,0,0,0,0,1,40\nGOTO/0,40,0,0.08715574,0,0.99619470\n",
        "RAPID\nCIRCLE/0,0,0,0,0,1,40\nFEDRAT/300,MMPM\nGOTO/0,40,0\nGOTO/0,40,9\n",
        "CIRCLE/0,0,0,0,0,1,40\nGOTO/28.284271,28.284271,0,0,40,0,-40,0,0\n",
        "CIRCLE/0,0,0,0,0,1,40\nGODLTA/-40,40,0\n",
        "MOVARC/0,0,0,0,0,1,40,ANGLE,90\nGOTO/0,40,0\n",
        // So short that it is one chord.
        "MOVARC/0,0,0,0,0,1,40,ANGLE,1\nGOTO/39.993908,0.698096,0\n",
        "INDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,0,40),ON,$\n(LINE/0,0,0,0,40,0)\n",
        "GODLTA/-40,40,0\nGODLTA/5\nRAPID,GODLTA/1,2,3\nrapid, goto/1,2,50\n",
        "CYCLE/DRILL,DEPTH,10,MMPM,120,CLEAR,2\nGOTO/40,0,-1\nFEDRAT/0.1,MMPR\nGOTO/40,30,-1\nCYCLE/OFF\nGOTO/0,0,40\n",
        "CYCLE/DEEP,DEPTH,10,STEP,4,MMPR,0.05,CLEAR,2,RETURN,9\nGOTO/40,0,-1\nCYCLE/OFF\nRAPID\nGOTO/0,0,40\nGOTO/0,0,4\n",
        "CYCLE/REAM,DEPTH,10,IPM,4,CLEAR,2,DWELL,3,REV\nRAPID\nGOTO/40,0,-1\nCYCLE/OFF\nFEDRAT/MMPM,500\nCYCLE/ON\n\
         GOTO/9,0,-1\nCYCLE/OFF\nGOTO/0,0,40\n",
    ];
    for way in ways {
        let text = format!("{start}{way}FINI\n");
        for options in [plain(), ClOptions { point: cl::Point::Centre, corner_radius_mm: Some(6.0), ..plain() }] {
            let written = posted_and_read_again(&text, &options, None);
            assert!(written.contains("$$ "), "{written}");
        }
        posted_and_read_again(&text.replace('\n', "\r\n"), &plain(), None);
        posted_and_read_again(&text, &plain(), Some(0.001));
    }
}

/// A quarter from (40, 0) about (0, 0), then one the other way about (0, 80): 2·acos(1 − 0.005 / 40) is 1.812°, so both have 50
/// chords of 1.8°.
const ARCS: &str = "PARTNO ARCS\r\nUNITS/MM\r\nMULTAX/ON\r\nFEDRAT/600,MMPM\r\nRAPID\r\nGOTO/40.0,0.0,50.0,0.0,0.0,1.0\r\n\
    GOTO/40.0,0.0,0.0\r\nN120 MOVARC/0.0,0.0,0.0,$ centre\r\n  0.0,0.0,1.0,40.0,ANGLE,90.0 $$ a quarter\r\n$$ BETWEEN\r\n\
    FEDRAT/300,MMPM\r\nGOTO/0.0,40.0,0.0\r\nCIRCLE/0.0,80.0,0.0,0.0,0.0,1.0,40.0,CLW\r\nCOOLNT/ON\r\nGOTO/-40.0,80.0,0.0\r\n\
    COOLNT/OFF\r\nRAPID\r\nGOTO/-40.0,80.0,50.0\r\nFINI\r\n";

/// Numbers of the `GOTO`s of a text after one line and before another, read without any code of deflex.
fn gone_to(text: &str, after: &str, before: &str) -> Vec<Vec<f64>> {
    let lines = text.lines().skip_while(|line| !line.starts_with(after)).take_while(|line| !line.starts_with(before));
    let numbers = |line: &str| line.split(',').map(|number| number.parse().unwrap()).collect();
    lines.filter_map(|line| line.strip_prefix("GOTO/")).map(numbers).collect()
}

/// What else than `GOTO` the lines say, line ends and all.
fn others(text: &str) -> String {
    let own = |line: &&str| !line.starts_with("GOTO/") && !line.starts_with("$$ posted");
    text.split_inclusive('\n').filter(own).collect()
}

#[test]
fn an_arc_is_gone_along_in_points_that_lie_on_it() {
    // So stiff that nothing moves.
    let rigid = CELL.replace("[6e5, 5e5, 4e5, 9e4, 8e4, 5e4]", "[6e15, 5e15, 4e15, 9e14, 8e14, 5e14]");
    let (_, written) = written_in(&rigid, ARCS, &plain(), None).unwrap();
    // Half of the last digit.
    let near =
        |point: &[f64], place: [f64; 2]| (0..2).all(|i| (point[i] - place[i]).abs() <= 0.5001e-4) && point[2] == 0.0;
    let first = gone_to(&written, "FEDRAT/300", "$$ CIRCLE");
    let second = gone_to(&written, "COOLNT/ON", "COOLNT/OFF");
    assert_eq!((first.len(), second.len()), (50, 50), "{written}");
    for (k, (first, second)) in (1_u32..).zip(first.iter().zip(&second)) {
        let (sin, cos) = (f64::from(k) * 1.8).to_radians().sin_cos();
        assert!(near(first, [40.0 * cos, 40.0 * sin]), "{k}: {first:?}");
        assert!(near(second, [-40.0 * sin, 80.0 - 40.0 * cos]), "{k}: {second:?}");
        assert!(first[3..] == [0.0, 0.0, 1.0] && second[3..] == [0.0, 0.0, 1.0]);
    }
    assert_eq!(written.matches("GOTO/").count(), ARCS.matches("GOTO/").count() + 2 * 49);
    let commented =
        ARCS.replace("N120 ", "$$ N120 ").replace("  0.0,0.0,1.0", "$$   0.0,0.0,1.0").replace("CIRCLE", "$$ CIRCLE");
    assert_eq!(others(&written), others(&commented));
    assert!(!written.replace("\r\n", "").contains(['\r', '\n']));
}

#[test]
fn corrected_arcs_say_what_is_posted() {
    let written = posted_and_read_again(ARCS, &plain(), None);
    let first = gone_to(&written, "FEDRAT/300", "$$ CIRCLE");
    assert_eq!(first.len(), 50);
    let moved = first.iter().map(|point| (point[0].hypot(point[1]) - 40.0).abs()).fold(0.0, f64::max);
    assert!(moved > 0.1, "{moved}");
    let centre = ClOptions { point: cl::Point::Centre, corner_radius_mm: Some(6.0), ..plain() };
    posted_and_read_again(ARCS, &centre, None);
    let inserted = posted_and_read_again(ARCS, &plain(), Some(0.0005));
    assert!(inserted.matches("GOTO/").count() > written.matches("GOTO/").count());
    assert_eq!(others(&inserted.replace("RAPID\r\n", "")), others(&written.replace("RAPID\r\n", "")));
    // Rapid travel on an arc is rapid to each of its points.
    let rapid = ARCS.replace("FEDRAT/300,MMPM", "RAPID");
    assert_eq!(
        posted_and_read_again(&rapid, &plain(), None).matches("RAPID\r\n").count(),
        rapid.matches("RAPID").count() + 49
    );
}

#[test]
fn a_feed_that_is_said_again_has_no_sequence_number() {
    let text = "UNITS/MM\nN10 FEDRAT/600,MMPM\nN20 RAPID\nN30 GOTO/0,0,50,0,0,1\n\
                N40 CYCLE/DRILL,DEPTH,10,MMPM,120,CLEAR,2\nN50 GOTO/0,0,0\nN60 CYCLE/OFF\nN70 GOTO/0,0,40\nFINI\n";
    let written = posted_and_read_again(text, &plain(), None);
    assert!(
        written.contains("\nFEDRAT/120.0,MMPM\n") && written.contains("\nFEDRAT/600.0,MMPM\nN70 GOTO/"),
        "{written}"
    );
    assert_eq!(written.matches("N10 ").count(), 1, "{written}");
}

#[test]
fn axes_are_announced_again_where_the_file_takes_it_back() {
    let text = ARCS.replace("FEDRAT/300,MMPM", "MULTAX/OFF");
    let written = posted_and_read_again(&text, &plain(), None);
    assert_eq!(written.matches("MULTAX/OFF\r\nMULTAX/ON\r\nGOTO/").count(), 1, "{written}");
}

#[test]
fn every_dialect_reads_the_same_again() {
    let (mut read_again, mut with_arcs) = (0, 0);
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/cl/valid");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
        let options = ClOptions { units: Some(cl::Units::Millimetre), ..plain() };
        let program = read(&text, &options);
        if program.kept.iter().any(|kept| kept.fault) {
            continue;
        }
        let point = |(target, at): (usize, &Target)| match at.goal {
            Goal::Axis { position_mm, axis, .. } => CorrectedPoint { target, position_mm, axis },
            _ => panic!("{at:?}"),
        };
        let points: Vec<_> = program.targets.iter().enumerate().map(point).collect();
        let written = match cl::write(&program, &points, &[]) {
            Ok(written) => written,
            Err(errors) => {
                assert_eq!(name, "cards.apt", "{errors:?}");
                continue;
            }
        };
        let written = String::from_utf8_lossy(&written).into_owned();
        let again = read(&written, &options);
        assert_eq!((program.targets.len(), actions(&program)), (again.targets.len(), actions(&again)), "{written}");
        for (was, is) in program.targets.iter().zip(&again.targets) {
            let (Goal::Axis { position_mm: a, axis: u, .. }, Goal::Axis { position_mm: b, axis: v, .. }) =
                (was.goal, is.goal)
            else {
                panic!("{is:?}")
            };
            let same = |i: usize| (a[i] - b[i]).abs() < 1e-4 && (u[i] - v[i]).abs() < 1e-8;
            assert!((0..3).all(same), "{name}: {was:?} {is:?}\n{written}");
            let rest = |t: &Target| (t.spindle_rpm, t.tool, t.mark);
            assert_eq!(rest(was), rest(is), "{name}: {was:?} {is:?}\n{written}");
            same_speed(was, is, &written);
        }
        read_again += 1;
        with_arcs += usize::from(program.arcs > 0);
    }
    assert!(read_again > 3 && with_arcs > 0, "{read_again} {with_arcs}");
}

#[test]
fn what_cannot_be_said_is_refused_with_its_line() {
    let hole = "UNITS/MM\nRAPID\nGOTO/0,0,50,0,0,1\nCYCLE/DRILL,DEPTH,10,MMPM,120,CLEAR,2\nGOTO/0,0,0\nCYCLE/OFF\n";
    // Without a feed of the file's own, that of the cycle would hold on.
    let text = format!("{hole}GOTO/0,0,60\nFINI\n");
    let errors = written(&text, &plain(), None).unwrap_err();
    assert_eq!((errors[0].code, errors[0].line), ("post.cl", 7), "{errors:?}");
    assert!(errors[0].help.is_some());
    // A feed a revolution needs revolutions.
    let text = format!("FEDRAT/0.1,MMPR\n{hole}RAPID\nGOTO/0,0,60\nFINI\n");
    let errors = written(&text, &plain(), None).unwrap_err();
    assert_eq!((errors[0].code, errors[0].line), ("post.cl", 6), "{errors:?}");
    let text = format!("{hole}RAPID\nGOTO/0,0,60\nFINI\n");
    assert!(posted_and_read_again(&text, &plain(), None).contains("FEDRAT/120.0,MMPM\n"));
}
