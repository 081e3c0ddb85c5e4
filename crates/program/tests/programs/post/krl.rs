//! Points written as KRL, and read back.

use super::{plan, point, written};
use deflex_program::post::{PostPlan, PostedPoint};
use deflex_program::{Goal, Language, Mark, ToolData, WobjData, krl};
use deflex_text::Source;

fn milling(max_points: Option<usize>) -> PostPlan {
    let (tcp_mm, tcp_quat, cog_mm) = ([1.0, 2.0, 310.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 80.0]);
    let tool = ToolData { tcp_mm, tcp_quat, cog_mm, mass_kg: 12.0, ..ToolData::FLANGE };
    let wobj = WobjData { uframe_mm: [1000.0, 0.0, 500.0], ..WobjData::WORLD };
    PostPlan { max_points, ..plan("tMill", tool, "BASE_DATA[4]", wobj, 5) }
}

fn points() -> Vec<PostedPoint> {
    let at = |i: u32| {
        let x = f64::from(i);
        let mut point = point([10.0 * x, 1.0, -2.0], [0.0, 0.6, 0.8, 0.0]);
        (point.speed_mm_s, point.rapid) = (20.0, i == 0);
        point.mark = Some(if i == 0 { Mark::Air } else { Mark::Cut });
        point
    };
    (0..5).map(at).collect()
}

#[test]
fn what_is_written_is_read_back() {
    let files = written(Language::Krl, milling(None), &points(), &[[1.0, -90.0, 90.0, 0.0, 45.0, 0.0]; 5], "rOff()");
    let [(name, text)] = &files[..] else { panic!("{} files", files.len()) };
    assert_eq!(name, "part.src");
    let program = krl::read(vec![Source::new("part.src", text.clone())], Vec::new()).unwrap();
    assert_eq!(program.targets.len(), 5);
    assert!(matches!(program.targets[0].goal, Goal::Joints { deg } if deg[1] < -89.0));
    for (target, point) in program.targets.iter().zip(points()).skip(1) {
        let Goal::Pose { position_mm, quat, .. } = target.goal else { panic!() };
        assert_eq!(position_mm.to_vec(), point.position_mm);
        let dot: f64 = quat.iter().zip(point.quat).map(|(a, b)| a * b).sum();
        assert!(dot.abs() > 1.0 - 1e-12, "{quat:?}");
        assert_eq!((target.feed_mm_s, target.mark), (Some(20.0), Some(Mark::Cut)));
    }
    assert_eq!(&*program.wobjs[0].name, "BASE_DATA[4]");
    let data = program.tools[0].data.unwrap();
    assert_eq!((data.tcp_mm, data.mass_kg, data.cog_mm), ([1.0, 2.0, 310.0], 12.0, [0.0, 0.0, 80.0]));
    let in_force = String::from_utf8(text.clone()).unwrap();
    assert!(
        in_force.contains("\r\nrOff()\r\nEND\r\n")
            && in_force.contains("$APO.CDIS = ")
            && in_force.matches("C_DIS").count() == 3
    );
}

#[test]
fn after_a_routine_of_a_template_all_settings_are_stated_again() {
    let mut points = points();
    points[2].lines = Some("tc(2)".into());
    points[3].lines = Some("WAIT SEC 0.5".into());
    let files = written(Language::Krl, milling(None), &points, &[[1.0, -90.0, 90.0, 0.0, 45.0, 0.0]; 5], "");
    let text = String::from_utf8(files[0].1.clone()).unwrap();
    let (before, after) = text.split_once("tc(2)\r\n").unwrap();
    for setting in ["$IPO_MODE", "$TOOL", "$LOAD", "$BASE", "$VEL.CP"] {
        assert_eq!([before, after].map(|part| part.matches(setting).count()), [1, 1], "{setting}");
    }
}

#[test]
fn parts_are_programs_of_their_own() {
    let files = written(Language::Krl, milling(Some(2)), &points(), &[[0.0; 6]; 5], "");
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["part.src", "part_1.src", "part_2.src", "part_3.src"]);
    let sources = files.iter().map(|(name, text)| Source::new(name.clone(), text.clone())).collect();
    let program = krl::read(sources, Vec::new()).unwrap();
    assert_eq!(program.targets.len(), 5);
    assert!(program.kept.is_empty(), "{:?}", program.kept);
}
