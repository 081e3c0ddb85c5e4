//! Cuts the same path through the same block with deflex and with other open-source removal engines: a bull-nose cutter of 25 mm
//! (corner 5 mm) in steps of 2 mm, 1.5 mm deep, in a block of 600 × 400 × 40 mm. Prints the time for each step and the removed
//! volume. deflex also computes the mean force at each step, which the others do not.
//!
//! `cargo run --release --manifest-path benches/peers/Cargo.toml`

use brep_cam::model::{Bounds3, Point3, RigidTransform};
use brep_cam::multiaxis::sim::{TriDexel, TriDexelOptions};
use brep_cam::multiaxis::tilt::ClPose;
use brep_cam::stock::{ResolvedStock, StockBox};
use brep_cam::{NullSink, ProfilePoint, Runner, Tolerance, ToolPart, ToolProfile};
use deflex::cutting::{Cutter, materials};
use deflex::stock::{Blank, Front, Stock, ToolPose};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;
use std::time::Instant;

const SIZE_MM: [f64; 3] = [600.0, 400.0, 40.0];
const DIAMETER_MM: f64 = 25.0;
const CORNER_MM: f64 = 5.0;
const DEPTH_MM: f64 = 1.5;
const STEP_MM: f64 = 2.0;
/// Spacing of lines or cells, where an engine has any.
const RESOLUTION_MM: f64 = 0.5;

/// Tips of three passes of 100 steps, 10 mm apart; the first is a slot.
fn path() -> Vec<[f64; 3]> {
    let pass = |k: i32| {
        let along = move |i: i32| if k % 2 == 0 { i } else { 100 - i };
        (0..=100).map(move |i| [100.0 + STEP_MM * f64::from(along(i)), 100.0 + 10.0 * f64::from(k), -DEPTH_MM])
    };
    (0..3).flat_map(pass).collect()
}

/// What a step along the path costs, µs.
fn timed(path: &[[f64; 3]], mut step: impl FnMut([f64; 3], [f64; 3])) -> f64 {
    let start = Instant::now();
    path.windows(2).for_each(|pair| step(pair[0], pair[1]));
    start.elapsed().as_secs_f64() * 1e6 / (path.len() - 1) as f64
}

/// What a step costs (µs), and the volume that all remove (mm³).
type Measured = (f64, f64);

fn deflex(path: &[[f64; 3]]) -> Measured {
    const MM: f64 = 1e-3;
    let cutter = Cutter { diameter: DIAMETER_MM * MM, corner_radius: CORNER_MM * MM, teeth: 3, helix: 0.5 };
    let front = Front::new(&cutter, &materials::find("al7075").expect("a preset").coefficients);
    let corners = [Vector3::new(0.0, 0.0, -SIZE_MM[2]), Vector3::new(SIZE_MM[0], SIZE_MM[1], 0.0)];
    let mut stock = Stock::new(Blank::Box(corners.map(|corner| corner * MM)), RESOLUTION_MM * MM);
    let pose = |tip: [f64; 3]| ToolPose { tip: Vector3::from(tip) * MM, axis: Vector3::z_axis() };
    let micros = timed(path, |from, to| {
        let (from, to) = (pose(from), pose(to));
        std::hint::black_box(front.engaged(&stock, &to, &(to.tip - from.tip)));
        stock.remove(front.solid(), &from, &to);
    });
    (micros, stock.removed() / (MM * MM * MM))
}

fn cutrail(path: &[[f64; 3]]) -> Measured {
    use cutrail::{Engine, EngineOptions, ManifoldKernel, MotionSegment, Pose, StockShape, Tool};
    let stock = StockShape::Box { min: [0.0, 0.0, -SIZE_MM[2]], max: [SIZE_MM[0], SIZE_MM[1], 0.0] };
    let options = EngineOptions::default().with_tile_size(10.0);
    let mut engine = Engine::new(ManifoldKernel, &[stock], options).expect("a block");
    let tool = Tool::bull_nose_end_mill(DIAMETER_MM, CORNER_MM, 50.0);
    let mut volume = 0.0;
    let micros = timed(path, |from, to| {
        let segment = MotionSegment::linear(Pose::vertical(from), Pose::vertical(to));
        volume += engine.cut(&tool, &segment).expect("a cut").removed_volume;
    });
    (micros, volume)
}

fn brep_cam(path: &[[f64; 3]]) -> Measured {
    let bounds = Bounds3::new(Point3::new(0.0, 0.0, -SIZE_MM[2]), Point3::new(SIZE_MM[0], SIZE_MM[1], 0.0));
    let options = TriDexelOptions { cell: RESOLUTION_MM, ..TriDexelOptions::default() };
    let block = ResolvedStock::Box(StockBox { bounds, to_machine: RigidTransform::identity() });
    let mut stock = TriDexel::from_stock(&block, &options, None, None).expect("a block");
    let flat = 0.5 * DIAMETER_MM - CORNER_MM;
    // Chords of the corner within 0.01 mm, as the crate's own default has it.
    const CHORDS: usize = 18;
    let corner = (0..=CHORDS).map(|i| {
        let (sin, cos) = (FRAC_PI_2 * i as f64 / CHORDS as f64).sin_cos();
        (flat + CORNER_MM * sin, CORNER_MM * (1.0 - cos))
    });
    let outline = [(0.0, 0.0)].into_iter().chain(corner).chain([(0.5 * DIAMETER_MM, 50.0)]);
    let points = outline.map(|(radius, height)| ProfilePoint { radius, height, part: ToolPart::Cutting }).collect();
    let profile = ToolProfile { points };
    let (tolerance, mut sink, mut work) = (Tolerance::default(), NullSink, u64::MAX);
    let mut runner = Runner::detached(&mut sink);
    let pose = |[x, y, z]: [f64; 3]| ClPose { tip: Point3::new(x, y, z), axis: Point3::new(0.0, 0.0, 1.0) };
    let before = stock.volume();
    let micros = timed(path, |from, to| {
        let cut = stock.cut(&profile, pose(from), pose(to), &options, &tolerance, &mut work, &mut runner);
        cut.expect("a cut");
    });
    (micros, before - stock.volume())
}

fn main() {
    let path = path();
    let own = deflex(&path);
    let others = [("cutrail 0.1.1 (mesh)", cutrail(&path)), ("BREP_cam 0.1.0 (tri-dexel)", brep_cam(&path))];
    for (name, (micros, volume)) in [("deflex, with forces", own)].into_iter().chain(others) {
        println!("{name:<28}{micros:>10.1} us a step{volume:>12.1} mm3{:>8.1} times deflex's time", micros / own.0);
    }
}
