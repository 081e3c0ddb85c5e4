//! Posted programs of more points than a controller loads at once: parts, and a program that calls them in turn.

use deflex::cell::Cell;
use deflex::correct::{Options, PostOptions, compensate, post};
use deflex::program::{Goal, Language, cl, krl, tp};
use deflex::text::Source;
use std::fmt::Write;

const CELL: &str = r#"
[robot]
model = "m-710ic-50"
start_deg = [0.0, 0.0, -20.0, 0.0, -70.0, 0.0]
[robot.stiffness]
joint_nm_per_rad = [1.0e6, 1.2e6, 9.0e5, 2.0e5, 2.2e5, 1.0e5]
[tools."TOOL"]
tcp_mm = [10.0, -20.0, 200.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 12.0
cog_mm = [0.0, 0.0, 90.0]
[wobjs."BASE"]
uframe_mm = [1100.0, -150.0, -250.0]
uframe_quat = [0.96592582628906831, 0.0, 0.0, 0.25881904510252074]
[cut]
force = "none"
[cl]
tool = "TOOL"
wobj = "BASE"
units = "mm"
spin = "fixed"
spin_deg = 180.0
"#;

/// Posted without a limit of one's own: file names, and the points of each as they are read back.
fn posted(language: Language, points: usize) -> Vec<(String, Vec<[f64; 3]>, String)> {
    let names = match language {
        Language::Ls => ["UT 1", "UF 1"],
        _ => ["TOOL_DATA[1]", "BASE_DATA[1]"],
    };
    let text = CELL.replace("\"TOOL\"", &format!("\"{}\"", names[0])).replace("\"BASE\"", &format!("\"{}\"", names[1]));
    let cell = Cell::read(&Source::new("cell.toml", text)).unwrap();
    let mut text = "FEDRAT/1800,MMPM\n".to_owned();
    for i in 0..points {
        let _ = writeln!(text, "GOTO/{},{},0,0,0,1", i % 100, 0.0625 * (i / 100) as f64);
    }
    let program = cl::read(Source::new("a.cl", text), &cell.cl.as_ref().unwrap().options).unwrap();
    let options = Options { post: Some(language), ..Options::default() };
    let corrected = compensate(&program, &cell, &options).unwrap();
    let options = PostOptions {
        name: "part".into(),
        title: vec!["limits".into()],
        max_targets: None,
        rapid_mm_s: 200.0,
        feed_mm_s: None,
        language,
    };
    let files = post(&program, &cell, &corrected, &options).unwrap().files;
    let read = |(name, bytes): (String, Vec<u8>)| {
        let source = vec![Source::new(name.clone(), bytes.clone())];
        let program =
            if language == Language::Ls { tp::read(source, Vec::new()) } else { krl::read(source, Vec::new()) };
        let program = program.unwrap();
        let positions = program.targets.iter().filter_map(|target| match target.goal {
            Goal::Pose { position_mm, .. } => Some(position_mm),
            _ => None,
        });
        (name, positions.collect::<Vec<_>>(), String::from_utf8_lossy(&bytes).into_owned())
    };
    files.into_iter().map(read).collect()
}

#[test]
fn parts_hold_no_more_than_a_controller_loads() {
    for (language, most, ending, call) in
        [(Language::Ls, 999, "ls", "CALL PART_"), (Language::Krl, 1400, "src", "part_")]
    {
        let points = 2 * most + 7;
        let files = posted(language, points);
        let names: Vec<String> = files.iter().map(|(name, ..)| name.to_ascii_lowercase()).collect();
        let wanted: Vec<String> =
            ["part", "part_1", "part_2", "part_3"].iter().map(|name| format!("{name}.{ending}")).collect();
        assert_eq!(names, wanted);
        let main = &files[0];
        assert!(main.1.is_empty());
        let calls: Vec<usize> = (1..=3).filter_map(|k| main.2.find(&format!("{call}{k}"))).collect();
        assert!(calls.len() == 3 && calls.is_sorted(), "{}", main.2);
        let counts: Vec<usize> = files[1..].iter().map(|(_, positions, _)| positions.len()).collect();
        // In KRL the first motion goes to axis angles, because the position of the arm before it is not known.
        assert!(
            counts.iter().sum::<usize>().abs_diff(points) <= 1 && counts.iter().all(|count| *count <= most),
            "{counts:?}"
        );
        // In order, and none twice.
        let all: Vec<[f64; 3]> = files[1..].iter().flat_map(|(_, positions, _)| positions.clone()).collect();
        for (k, [x, y, _]) in all.iter().enumerate() {
            let i = k + points - all.len();
            let (wanted_x, wanted_y) = ((i % 100) as f64, 0.0625 * (i / 100) as f64);
            assert!((x - wanted_x).abs() < 1e-2 && (y - wanted_y).abs() < 1e-2, "{i}: {x} {y}");
        }
        if language == Language::Ls {
            // Each part numbers its positions from 1, and its head counts its lines.
            for (_, positions, text) in &files[1..] {
                assert!(text.contains("P[1]{") && text.contains(&format!("P[{}]{{", positions.len())));
                assert!(!text.contains(&format!("P[{}]{{", positions.len() + 1)));
                let head = text.split("LINE_COUNT").nth(1).unwrap();
                let count: String =
                    head.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
                let lines = text.split("/MN").nth(1).unwrap().split("/POS").next().unwrap();
                assert_eq!(lines.lines().filter(|line| line.contains(':')).count().to_string(), count);
            }
        }
    }
}
