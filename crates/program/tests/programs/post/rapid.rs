//! Points written as RAPID, in chunks and in several modules.

use super::{plan, point};
use deflex_program::post::{PostPlan, PostWriter, PostedPoint, WriterPosition};
use deflex_program::{Mark, ToolData, WobjData};
use proptest::prelude::*;

fn plan_and_points(max_points: Option<usize>) -> (PostPlan, [PostedPoint; 5]) {
    let at = |x: f64, speed_mm_s: f64, rapid: bool, mark| {
        let sample = point([x, -0.000_01, 10.0], [0.0, 1.0, 0.0, -0.0]);
        PostedPoint { speed_mm_s, rapid, mark, ..sample }
    };
    let points = [
        at(0.0, 0.0, true, None),
        at(10.0, 0.0, true, Some(Mark::Air)),
        at(12.0, 27.432, false, Some(Mark::Cut)),
        at(14.5, 50.0, false, Some(Mark::Cut)),
        at(17.0, 33.0, false, Some(Mark::Cut)),
    ];
    let (tcp_mm, cog_mm) = ([0.0, 0.0, 310.0], [0.0, 0.0, 120.0]);
    let tool = ToolData { tcp_mm, cog_mm, mass_kg: 18.0, ..ToolData::FLANGE };
    let wobj = WobjData { uframe_mm: [1000.0, -400.0, 700.0], ..WobjData::WORLD };
    let plan = PostPlan {
        name: "2 blade".into(),
        title: vec!["from 2 blade.apt".into()],
        speeds: vec![27.432, 50.0],
        max_points,
        rapid_mm_s: 500.0,
        ..plan("tMill", tool, "wPart", wobj, points.len())
    };
    (plan, points)
}

/// Files with their text, written in chunks that end before these points.
fn posted(max_points: Option<usize>, ends: &[usize]) -> Vec<(String, String)> {
    let (plan, mut points) = plan_and_points(max_points);
    points[2].lines = Some("rSpindle 9000;\nWaitTime 2;".into());
    let post = PostWriter::new(plan);
    let mut texts = vec![post.head().clone()];
    let (mut place, mut start) = (WriterPosition::default(), 0);
    for &end in ends.iter().chain([&points.len()]) {
        texts.push(post.chunk(&place, &points[start..end], (end == points.len()).then_some("rSpindleOff;")));
        place = place.after(&points[start..end]);
        start = end;
    }
    let mut files: Vec<(String, String)> = Vec::new();
    for text in texts {
        let mut at = 0;
        for (start, name) in text.files.into_iter().chain([(text.bytes.len(), String::new())]) {
            let more = str::from_utf8(&text.bytes[at..start]).unwrap();
            files.iter_mut().last().into_iter().for_each(|(_, text)| text.push_str(more));
            files.push((name, String::new()));
            at = start;
        }
        files.pop();
    }
    assert_eq!(files.len(), post.files());
    files
}

#[test]
fn one_module() {
    let files = posted(None, &[]);
    assert_eq!(files.len(), 1);
    insta::assert_snapshot!(files[0].1);
}

#[test]
fn split_into_loadable_parts() {
    let all: Vec<String> = posted(Some(2), &[]).into_iter().map(|(n, t)| format!("--- {n}\n{t}")).collect();
    insta::assert_snapshot!(all.concat());
}

proptest! {
    #[test]
    fn chunks_are_the_same_text_wherever_they_end(mut ends in prop::collection::vec(0..5_usize, 0..4), most in prop::option::of(1..6_usize)) {
        ends.sort_unstable();
        prop_assert_eq!(posted(most, &ends), posted(most, &[]));
    }
}
