//! Corrected CL data (`--post cl`): read again, they say what was posted; what is no point is as it was.

use deflex::cell::Cell;
use deflex::correct::{self, Corrected, Options, PostOptions};
use deflex::program::cl::{self, ClOptions};
use deflex::program::{Goal, Language, Program};
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
    let cell = Cell::read(&Source::new("cell.toml", CELL))?;
    let program = read(text, options);
    let run = Options { post: Some(Language::Cl), subdivide, ..Options::default() };
    let corrected = correct::compensate(&program, &cell, &run)?;
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let posted = correct::post(&program, &cell, &corrected, &post_options())?;
    let [(name, bytes)] = &posted.files[..] else { panic!("{:?}", posted.files) };
    assert_eq!(name, "part.cl");
    Ok((corrected, String::from_utf8(bytes.clone()).unwrap()))
}

/// Reads what was written, and compares with what was posted.
fn says_what_was_posted(text: &str, options: &ClOptions, subdivide: Option<f64>) -> String {
    let (corrected, written) = written(text, options, subdivide).unwrap();
    let again = read(&written, options);
    assert_eq!(again.targets.len(), corrected.posted.len(), "{written}");
    let mut moved = 0;
    for (target, posted) in again.targets.iter().zip(&corrected.posted) {
        let Goal::Axis { position_mm, axis, .. } = target.goal else { panic!("{target:?}") };
        let off = (0..3).map(|i| (position_mm[i] - posted.position_mm[i]).abs()).fold(0.0, f64::max);
        // The third column of the matrix of a quaternion, turned about: the tool axis is -z.
        let [w, x, y, z] = posted.quat;
        let wanted = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)].map(|v| -v);
        let tilt = (0..3).map(|i| (axis[i] - wanted[i]).abs()).fold(0.0, f64::max);
        // Four decimals of a millimetre, in single precision; as many of an inch that is one hundred times as fine.
        assert!(off < 1.5e-4 && tilt < 2e-7, "{off} mm {tilt}: {target:?} {posted:?}\n{written}");
        moved += 1;
    }
    assert!(moved > 0);
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
    let feeds = |program: &Program| {
        program.targets.iter().map(|t| (t.rapid, t.feed_mm_s.map(f64::to_bits))).collect::<Vec<_>>()
    };
    if subdivide.is_none() {
        assert_eq!(feeds(&read(text, options)), feeds(&again));
    }
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

#[test]
fn what_is_no_point_is_refused_with_its_line() {
    let arc = "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,0,0,0,1\nCIRCLE/20,0,0,0,0,1,20\nGOTO/40,0,0\nFINI\n";
    let step = "UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,0,0,0,1\nGODLTA/10,0,0\nFINI\n";
    for (text, line) in [(arc, 4), (step, 4)] {
        let errors = written(text, &plain(), None).unwrap_err();
        assert_eq!((errors[0].code, errors[0].line), ("post.cl", line), "{errors:?}");
        assert!(errors[0].help.is_some());
    }
}
