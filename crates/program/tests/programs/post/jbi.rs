//! Points written as INFORM, and read back.

use super::{plan, point, written};
use deflex_program::post::{PostPlan, PostedPoint};
use deflex_program::{Editable, Goal, Language, Mark, ToolData, WobjData, jbi};
use deflex_text::Source;

fn post(max_points: Option<usize>) -> Vec<(String, Vec<u8>)> {
    let tool = ToolData { mass_kg: 2.0, ..ToolData::FLANGE };
    let plan = plan("TOOL 2", tool, "USER 3", WobjData::WORLD, 4);
    let plan = PostPlan { max_points, ..plan };
    let at = |i: u32| {
        let mut point = point([10.0 * f64::from(i), 1.0, -2.0], [0.0, 0.6, 0.8, 0.0]);
        (point.rapid, point.mark) = (i == 0, Some(if i == 0 { Mark::Air } else { Mark::Cut }));
        point
    };
    let points: Vec<PostedPoint> = (0..4).map(at).collect();
    written(Language::Jbi, plan, &points, &[[1.0, -20.0, 10.0, 190.0, -45.0, 0.0]; 4], "DOUT OT#(1) OFF")
}

#[test]
fn what_is_written_is_read_back() {
    let files = post(None);
    let [(name, text)] = &files[..] else { panic!("{} files", files.len()) };
    assert_eq!(name, "PART.JBI");
    let program = jbi::read(vec![Source::new("PART.JBI", text.clone())], Vec::new()).unwrap();
    assert_eq!(program.targets.len(), 4);
    for (i, target) in program.targets.iter().enumerate() {
        let Goal::Pose { position_mm, quat, .. } = target.goal else { panic!() };
        let off = (0..3).map(|at| (position_mm[at] - [10.0 * i as f64, 1.0, -2.0][at]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12, "{position_mm:?}");
        let dot: f64 = quat.iter().zip([0.0, 0.6, 0.8, 0.0]).map(|(a, b)| a * b).sum();
        assert!(dot.abs() > 1.0 - 1e-11, "{quat:?}");
        assert_eq!(target.mark, Some(if i == 0 { Mark::Air } else { Mark::Cut }));
        assert_eq!(target.editable, Editable::Pose);
    }
    assert_eq!((&*program.tools[0].name, &*program.wobjs[0].name), ("TOOL 2", "USER 3"));
    assert_eq!(program.targets[1].feed_mm_s, Some(20.0));
    // The sample's wrist is below zero as joints count it, and axis R is beyond half a turn.
    assert!(String::from_utf8_lossy(text).contains("///RCONF 0,0,0,1,0,0,0"), "{}", String::from_utf8_lossy(text));
}

#[test]
fn parts_are_called_in_turn() {
    let files = post(Some(3));
    let names: Vec<&str> = files.iter().map(|(name, _)| &name[..]).collect();
    assert_eq!(names, ["PART.JBI", "PART_1.JBI", "PART_2.JBI"]);
    let mut sources = files.iter().map(|(name, text)| Source::new(&name[..], text.clone()));
    let program = jbi::read(vec![sources.next().unwrap()], sources.collect()).unwrap();
    assert_eq!(program.targets.len(), 4);
    assert!(files[2].1.ends_with(b"OT#(1) OFF\r\nEND\r\n") && !files[1].1.ends_with(b"OFF\r\nEND\r\n"));
}
