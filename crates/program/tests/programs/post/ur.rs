//! Points written as URScript, and read back.

use super::{plan, point, written};
use deflex_program::post::PostedPoint;
use deflex_program::{Editable, Goal, Language, Mark, ToolData, WobjData, ur};
use deflex_text::Source;

#[test]
fn what_is_written_is_read_back() {
    let (tcp_mm, tcp_quat, cog_mm) = ([1.0, 2.0, 310.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 80.0]);
    let tool = ToolData { tcp_mm, tcp_quat, cog_mm, mass_kg: 2.0, ..ToolData::FLANGE };
    let (uframe_mm, uframe_quat) = ([400.0, 0.0, 100.0], [0.0, 0.0, 0.0, 1.0]);
    let wobj = WobjData { uframe_mm, uframe_quat, ..WobjData::WORLD };
    let plan = plan("TCP", tool, "wPart", wobj, 4);
    let at = |i: u32| {
        let mut point = point([10.0 * f64::from(i), 1.0, -2.0], [0.0, 0.6, 0.8, 0.0]);
        (point.rapid, point.mark) = (i == 0, Some(if i == 0 { Mark::Air } else { Mark::Cut }));
        point
    };
    let points: Vec<PostedPoint> = (0..4).map(at).collect();
    let files = written(Language::Ur, plan, &points, &[[1.0, -90.0, 90.0, 0.0, 45.0, 0.0]; 4], "spindle_off()");
    let [(name, text)] = &files[..] else { panic!("{} files", files.len()) };
    assert_eq!(name, "part.script");
    let program = ur::read(vec![Source::new("part.script", text.clone())], Vec::new()).unwrap();
    assert_eq!(program.targets.len(), 4);
    assert!(matches!(program.targets[0].goal, Goal::Joints { deg } if (deg[1] + 90.0).abs() < 1e-4));
    for (target, point) in program.targets.iter().zip(&points).skip(1) {
        let Goal::Pose { position_mm: [x, y, z], quat, .. } = target.goal else { panic!() };
        // A half turn about z, then the origin of the frame.
        let [px, py, pz] = point.position_mm;
        assert!((x - (400.0 - px)).abs() + (y + py).abs() + (z - (100.0 + pz)).abs() < 1e-3, "{x} {y} {z}");
        let expected = [0.0, -0.8, 0.6, 0.0];
        let dot: f64 = quat.iter().zip(expected).map(|(a, b)| a * b).sum();
        assert!(dot.abs() > 1.0 - 1e-12, "{quat:?}");
        assert_eq!((target.feed_mm_s, target.mark), (Some(20.0), Some(Mark::Cut)));
        assert_eq!(target.editable, Editable::Pose);
    }
    let data = program.tools[0].data.unwrap();
    assert!((data.tcp_mm[2] - 310.0).abs() < 1e-9 && (data.cog_mm[2] - 80.0).abs() < 1e-9);
}
