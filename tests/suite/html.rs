//! Pages of a path: their figures are those of the CSV report, and their size is bounded.

use deflex::correct::{KeptReason, PathDeviation, Row, Stance, Status, Stiffness, Summary};
use deflex::program::Reason;
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::report::{FileSummary, Origin, write_csv};
use serde_json::Value;
use std::collections::HashMap;

/// What opens quickly from a disk and passes through a mail server.
const MOST_BYTES: usize = 5_000_000;

fn row(i: usize) -> Row {
    let t = i as f64;
    // Errors and what remains peak at different targets, so that every stretch keeps as many as it can.
    let wave = |k: f64| (0.37 * k * t).sin() * (1.0 + 0.5 * (0.011 * t).cos());
    Row {
        target: i as u32 + 1,
        line: 10 + i as u32,
        name: Some(format!("pTarget_with_a_name_of_its_{i:06}").into()),
        status: [Status::Ok, Status::Air, Status::Kept(KeptReason::Program(Reason::Computed))]
            [usize::from(i.is_multiple_of(97)) + usize::from(i.is_multiple_of(194))],
        position_mm: [0.01 * t - 500.0, 80.0 * wave(0.1), -12.345_67 * wave(0.2)],
        error_mm: [0.1 * wave(1.0), -0.2 * wave(1.3), 0.05 * wave(2.0)],
        error_deg: [0.01 * wave(1.0), 0.02 * wave(1.1), -0.03 * wave(1.2)],
        error_normal_mm: 0.1 * wave(1.4),
        correction_mm: [-0.1 * wave(1.0), 0.2 * wave(1.3), -0.05 * wave(2.0)],
        correction_deg: [0.0, -0.0, 1e-9],
        goes_along: false,
        is_through_air: false,
        remaining_mm: [1e-4 * wave(3.0), 1e-5 * wave(5.0), -1e-7],
        force_n: [100.0 * wave(1.0), -55.5, 1_234.567_8],
        sigma_mm: Some(0.01 * wave(7.0).abs()),
        path: Some(PathDeviation { max_mm: 0.03 * wave(9.0).abs(), ..PathDeviation::default() }),
        depth_mm: None,
        engaged_deg: None,
        removed_mm3: None,
        spin_deg: None,
        joints_deg: None,
        feed_mm_s: None,
        error_part_mm: Some(0.02 * wave(4.0).abs()),
        names: None,
        stance: Some(stance(t)),
        stiffness: Some(Stiffness { normal_n_per_mm: 1500.0, least_n_per_mm: 300.0 + t * 1e-3, most_n_per_mm: 4000.0 }),
    }
}

/// A joint column that moves, a base that stands.
fn stance(t: f64) -> std::sync::Arc<Stance> {
    std::sync::Arc::new(Stance {
        axes_deg: std::array::from_fn(|k| 90.0 * (0.013 * t + k as f64).sin()),
        limit_margin_deg: 40.0 + (0.1 * t).sin(),
        singular_margin_deg: 30.0 + (0.2 * t).cos(),
        base: [-1000.0, 400.0, -700.0, 0.0, 0.0, 180.0],
        external: [t * 0.01, f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN],
        table: None,
        circle_point: None,
    })
}

fn page(rows: &[Row]) -> String {
    let mut path = PathTrace::new(PathKind::Compensate, 1);
    // However the rows come.
    rows.chunks(777).for_each(|chunk| path.extend(chunk));
    // As long as an instruction with its target, no two alike.
    path.quote(|target, line| Some(format!("    MoveL [[{target:0>100}],{line:0>100};")));
    let summary = FileSummary::of("part.mod", &Summary::of(rows), &[]);
    PathPage {
        kind: PathKind::Compensate,
        cell: &Origin::of("cell.toml", b""),
        programs: &[(summary, path)],
        scene: None,
        tolerance_mm: None,
    }
    .html()
}

/// What a page draws.
pub(crate) fn data(page: &str) -> Value {
    let (_, data) = page.split_once("id=\"data\">").unwrap();
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

/// A column of a page as its numbers.
fn column(path: &Value, key: &str) -> Vec<i32> {
    let letter = |b: u8| match b {
        b'A'..=b'Z' => b - b'A',
        b'a'..=b'z' => b - b'a' + 26,
        b'0'..=b'9' => b - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    // A column of one number is that number.
    if let Some(value) = path["columns"][key]["all"].as_i64() {
        return vec![value as i32; path["kept"].as_u64().unwrap() as usize];
    }
    let text = path["columns"][key]["data"].as_str().unwrap().trim_end_matches('=');
    let mut bytes = Vec::new();
    for chunk in text.as_bytes().chunks(4) {
        let word = chunk.iter().fold(0_u32, |word, &b| word << 6 | u32::from(letter(b))) << (6 * (4 - chunk.len()));
        bytes.extend(&word.to_be_bytes()[1..chunk.len()]);
    }
    bytes.chunks_exact(4).map(|b| i32::from_le_bytes(b.try_into().unwrap())).collect()
}

#[test]
fn a_hundred_thousand_targets_stay_small_and_say_what_is_left_out() {
    let rows: Vec<Row> = (0..100_000).map(row).collect();
    let page = page(&rows);
    assert!(page.len() < MOST_BYTES, "{} bytes", page.len());
    let path = &data(&page)["paths"][0];
    let targets = column(path, "target");
    assert_eq!((&path["count"], &path["kept"]), (&100_000.into(), &targets.len().into()));
    assert_eq!((targets[0], targets[targets.len() - 1]), (1, 100_000));
    assert_eq!(column(path, "axis_1_deg").len(), targets.len());
    assert_eq!(path["columns"]["base_rz_deg"]["all"], 180_000_000);
    let largest = |size: fn(&Row) -> f64| rows.iter().max_by(|a, b| size(a).total_cmp(&size(b))).unwrap().target as i32;
    assert!(targets.contains(&largest(Row::error_norm_mm)) && targets.contains(&largest(Row::remaining_norm_mm)));
}

/// Words; what is blank without a stock or a turn that was chosen; and the joints, which a page has as `axis_1_deg`, with the feed.
const NOT_DRAWN: [&str; 16] = [
    "name", "status", "depth_mm", "engaged_deg", "removed_mm3", "spin_deg", "reason", "q1_deg", "q2_deg", "q3_deg",
    "q4_deg", "q5_deg", "q6_deg", "tool", "wobj", "feed_mm_s",
];

#[test]
fn figures_are_those_of_the_csv_digit_for_digit() {
    let rows: Vec<Row> = (0..500).map(row).collect();
    let mut csv = Vec::new();
    write_csv(&rows, &mut csv).unwrap();
    let mut reader = csv::Reader::from_reader(&csv[..]);
    let head = reader.headers().unwrap().clone();
    let page = data(&page(&rows));
    let path = &page["paths"][0];
    let columns: HashMap<&str, (Vec<i32>, usize)> = head
        .iter()
        .filter(|key| !NOT_DRAWN.contains(key))
        .map(|key| (key, (column(path, key), path["columns"][key]["decimals"].as_u64().unwrap() as usize)))
        .collect();
    assert_eq!(columns.len(), head.len() - NOT_DRAWN.len(), "a column of the CSV is not on the page");
    for (i, record) in reader.records().enumerate() {
        for (key, cell) in head.iter().zip(&record.unwrap()) {
            let Some((values, decimals)) = columns.get(key) else { continue };
            assert_eq!(format!("{:.*}", decimals, f64::from(values[i]) / 10_f64.powi(*decimals as i32)), cell, "{key}");
        }
    }
}

#[test]
fn the_tables_of_a_page() {
    let rows: Vec<Row> = (0..500).map(row).collect();
    let page = page(&rows);
    let (_, main) = page.split_once("<main>").unwrap();
    let (tiles, rest) = main.split_once("<section class=\"stage\"").unwrap();
    let programs = rest.split_once("<section id=\"programs\">").unwrap().1.split_once("</section>").unwrap().0;
    insta::assert_snapshot!(format!("{tiles}{programs}"));
}
