//! Points written as programs of each language.

mod jbi;
mod krl;
mod rapid;
mod ur;

use deflex_program::jbi::SpeedUnit;
use deflex_program::post::{PostPlan, PostWriter, PostedPoint};
use deflex_program::{Confdata, EXTERNAL_AXES, Language, ToolData, WobjData};

/// A plan with one tool and one work object.
fn plan(tool: &str, tool_data: ToolData, wobj: &str, wobj_data: WobjData, points: usize) -> PostPlan {
    PostPlan {
        name: "part".to_owned(),
        title: vec!["from a test".to_owned()],
        tools: vec![(tool.to_owned(), tool_data)],
        wobjs: vec![(wobj.to_owned(), wobj_data)],
        units: Vec::new(),
        external: [None; EXTERNAL_AXES],
        speeds: Vec::new(),
        points,
        max_points: None,
        rapid_mm_s: 200.0,
        speed_unit: SpeedUnit::default(),
        corner_tolerance_mm: 0.05,
    }
}

/// A point of a cut at 20 mm/s.
fn point(position_mm: [f64; 3], quat: [f64; 4]) -> PostedPoint {
    let conf = Confdata { cf1: 0, cf4: -1, cf6: 0, cfx: 1 };
    let (turns, speed_mm_s, rapid, stop, joint) = ([0; 3], 20.0, false, false, false);
    let (lines, mark, tool, wobj, external) = (None, None, 0, 0, None);
    PostedPoint { position_mm, quat, conf, turns, speed_mm_s, rapid, stop, joint, lines, mark, tool, wobj, external }
}

/// The files of a language that is written as a whole, with their names.
fn written(
    language: Language,
    plan: PostPlan,
    points: &[PostedPoint],
    axes_deg: &[[f64; 6]],
    end: &str,
) -> Vec<(String, Vec<u8>)> {
    let write = language.about().post.write.expect("a language that is written as a whole");
    write(&PostWriter::new(plan), points, axes_deg, end).unwrap()
}
