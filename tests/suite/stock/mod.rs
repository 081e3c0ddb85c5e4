//! Material removal and engagement against closed forms and against a brute-force sum that shares no code with it.

mod distance;
mod mesh;
mod part;
mod paths;
mod program;

use deflex::cutting::{Coefficients, Cutter, Engagement, Milling, Mode};
use deflex::stock::{Blank, Engaged, Front, Stock, ToolPose};
use nalgebra::{Unit, Vector3};
use std::f64::consts::{FRAC_PI_4, PI};

const MM: f64 = 1e-3;

fn cutter(diameter_mm: f64, corner_mm: f64) -> Cutter {
    Cutter { diameter: diameter_mm * MM, corner_radius: corner_mm * MM, teeth: 3, helix: 0.5 }
}

/// Al 7075 of the presets: all six coefficients count.
fn coefficients() -> Coefficients {
    deflex::cutting::materials::find("al7075").unwrap().coefficients
}

fn upright(x: f64, y: f64, z: f64) -> ToolPose {
    ToolPose { tip: Vector3::new(x, y, z) * MM, axis: Vector3::z_axis() }
}

fn block(x: f64, y: f64, z: f64) -> Blank {
    Blank::Box([Vector3::new(0.0, 0.0, -z) * MM, Vector3::new(x, y, 0.0) * MM])
}

/// Moves along poses; what is engaged at the end of each, and the volume that the move removes, m³.
fn run(stock: &mut Stock, front: &Front, poses: &[ToolPose]) -> Vec<(Engaged, f64)> {
    poses
        .windows(2)
        .map(|pair| {
            let engaged = front.engaged(stock, &pair[1], &(pair[1].tip - pair[0].tip));
            (engaged, stock.remove(front.solid(), &pair[0], &pair[1]))
        })
        .collect()
}

/// Evenly spaced poses from one to another.
fn line(from: ToolPose, to: ToolPose, step_mm: f64) -> Vec<ToolPose> {
    let n = ((to.tip - from.tip).norm() / (step_mm * MM)).ceil().max(1.0) as usize;
    (0..=n).map(|i| from.between(&to, i as f64 / n as f64)).collect()
}

const FEED_PER_TOOTH: f64 = 0.07e-3;

fn declared(cutter: Cutter, mode: Mode, depth_mm: f64, width_mm: f64) -> Vector3<f64> {
    let engagement = Engagement {
        mode,
        depth: depth_mm * MM,
        width: width_mm * MM,
        feed_per_tooth: FEED_PER_TOOTH,
        lead: 0.0,
        tilt: 0.0,
    };
    let milling = Milling::new(cutter, engagement, coefficients()).unwrap();
    milling.mean_force(&Vector3::zeros(), &milling.axis_in_feed())
}

fn force(engaged: &Engaged) -> Vector3<f64> {
    engaged.force.at(FEED_PER_TOOTH)
}

#[track_caller]
fn within(found: Vector3<f64>, wanted: Vector3<f64>, share: f64) {
    let error = (found - wanted).norm() / wanted.norm();
    println!("{found:?} for {wanted:?}: {:.3} %", 100.0 * error);
    assert!(error <= share, "{found:?} is {:.2} % off {wanted:?}", 100.0 * error);
}

#[test]
fn a_slot_from_the_stock_is_the_declared_slot() {
    for (cutter, depth) in
        [(cutter(25.0, 5.0), 1.5), (cutter(10.0, 5.0), 0.5), (cutter(12.0, 0.0), 2.0), (cutter(25.0, 5.0), 8.0)]
    {
        for resolution in [1.0, 0.5] {
            let mut stock = Stock::new(block(100.0, 60.0, 20.0), resolution * MM);
            let front = Front::new(&cutter, &coefficients());
            let poses = line(upright(-20.0, 30.0, -depth), upright(60.0, 30.0, -depth), 2.0);
            let done = run(&mut stock, &front, &poses);
            let (last, _) = done.last().unwrap();
            within(force(last), declared(cutter, Mode::Slot, depth, 0.0), 0.01);
            assert!((last.depth / MM - depth).abs() < 0.02, "depth {}", last.depth / MM);
            assert!((last.arc.to_degrees() - 180.0).abs() < 1.0, "{}", last.arc.to_degrees());
        }
    }
}

/// The cutter at y above 0 of the stock's edge: material on the right of a feed along x, climb (down) milling. A flat end mill
/// leaves an upright wall, so that an edge of the blank and a neighbouring pass are the same.
#[test]
fn half_immersion_up_and_down() {
    let cutter = cutter(25.0, 0.0);
    for (mode, y) in [(Mode::Down, 60.0), (Mode::Up, 0.0)] {
        let mut stock = Stock::new(block(100.0, 60.0, 20.0), 0.5 * MM);
        let front = Front::new(&cutter, &coefficients());
        let poses = line(upright(-20.0, y, -3.0), upright(60.0, y, -3.0), 2.0);
        let done = run(&mut stock, &front, &poses);
        let (last, removed) = done.last().unwrap();
        within(force(last), declared(cutter, mode, 3.0, 12.5), 0.01);
        assert!((last.arc.to_degrees() - 90.0).abs() < 1.0, "{}", last.arc.to_degrees());
        let section = last.section * (poses[1].tip - poses[0].tip).norm();
        assert!((section / removed - 1.0).abs() < 0.02, "{section} {removed}");
    }
}

/// A pass a stepover away from the same pass before it: as declared and from the stock.
#[test]
fn a_stepover_from_the_stock_is_the_declared_one() {
    // The rim is followed until it can put off 1 %; it does by a fraction of that.
    for (cutter, depth, width, lead, tilt, share) in [
        (cutter(10.0, 5.0), 0.5, 0.5, 0.0, 0.0, 0.005),
        (cutter(25.0, 5.0), 0.5, 2.0, 0.0, 0.0, 0.005),
        (cutter(25.0, 5.0), 3.0, 12.5, 0.0, 0.0, 0.01),
        (cutter(25.0, 5.0), 1.5, 8.0, 5.0, 10.0, 0.01),
        (cutter(10.0, 5.0), 0.5, 1.0, -8.0, 12.0, 0.01),
    ] {
        for (mode, away) in [(Mode::Down, width), (Mode::Up, -width)] {
            let engagement = Engagement {
                mode,
                depth: depth * MM,
                width: width * MM,
                feed_per_tooth: FEED_PER_TOOTH,
                lead: f64::to_radians(lead),
                tilt: f64::to_radians(tilt),
            };
            let milling = Milling::new(cutter, engagement, coefficients()).unwrap();
            let axis = milling.axis_in_feed();
            let flat = cutter.radius() - cutter.corner_radius;
            let lowest = flat * axis.x.hypot(axis.y) + cutter.corner_radius * (1.0 - axis.z);
            let pose = |x: f64, y: f64| ToolPose { tip: Vector3::new(x * MM, y * MM, lowest - depth * MM), axis };
            let mut stock = Stock::new(block(60.0, 80.0, 20.0), 0.25 * MM);
            let front = Front::new(&cutter, &coefficients());
            run(&mut stock, &front, &line(pose(-20.0, 40.0 + away), pose(80.0, 40.0 + away), 2.0));
            let done = run(&mut stock, &front, &line(pose(-20.0, 40.0), pose(30.0, 40.0), 2.0));
            let last = &done.last().unwrap().0;
            let (found, wanted) = (force(last), milling.mean_force(&Vector3::zeros(), &axis));
            within(found, wanted, share);
            let bound = last.bound[0] + FEED_PER_TOOTH * last.bound[1];
            assert!((found - wanted).norm() <= bound + 1e-3 * wanted.norm(), "{mode:?} {lead} {tilt}: {bound}");
        }
    }
}

/// Removed along a slot: the flat cutter's rectangle and half a disk at its end, blank's edge to tip.
#[test]
fn a_slot_removes_its_volume() {
    for angle in [0.0_f64, 0.3, FRAC_PI_4, 1.1] {
        let cutter = cutter(25.0, 0.0);
        let mut stock = Stock::new(block(200.0, 200.0, 20.0), 0.5 * MM);
        let front = Front::new(&cutter, &coefficients());
        let [dx, dy] = [angle.cos(), angle.sin()];
        let poses = line(upright(60.0, 40.0, -1.5), upright(60.0 + 90.0 * dx, 40.0 + 90.0 * dy, -1.5), 2.0);
        let removed: f64 = run(&mut stock, &front, &poses).iter().map(|(_, removed)| removed).sum();
        let wanted = (90.0 * 25.0 + PI * 12.5 * 12.5) * 1.5 * MM.powi(3);
        println!("{angle}: {:.4} %", 100.0 * (removed / wanted - 1.0));
        assert!((removed / wanted - 1.0).abs() < 5e-3, "{removed} {wanted}");
        let left = stock.volume();
        assert!(((200.0 * 200.0 * 20.0) * MM.powi(3) - left - removed).abs() / wanted < 2e-3, "{left}");
    }
}

/// What the moves say that they remove is what is missing of the blank: two cutters, one of them leaning and turning.
#[test]
fn what_is_removed_is_missing() {
    let mut stock = Stock::new(block(60.0, 40.0, 15.0), 0.4 * MM);
    let before = stock.volume();
    let (rough, finish) =
        (Front::new(&cutter(16.0, 2.0), &coefficients()), Front::new(&cutter(8.0, 4.0), &coefficients()));
    let mut removed = 0.0;
    for y in [8.0, 18.0, 28.0] {
        let passes = run(&mut stock, &rough, &line(upright(-10.0, y, -2.0), upright(70.0, y + 3.0, -4.0), 4.0));
        removed += passes.iter().map(|(_, removed)| removed).sum::<f64>();
    }
    for y in [10.0, 14.0] {
        let lean = |angle: f64| Unit::new_normalize(Vector3::new(angle.sin(), 0.2, angle.cos()));
        let ends = [(-6.0, -0.4), (66.0, 0.4)].map(|(x, angle)| ToolPose { axis: lean(angle), ..upright(x, y, -5.0) });
        let passes = run(&mut stock, &finish, &line(ends[0], ends[1], 3.0));
        removed += passes.iter().map(|(_, removed)| removed).sum::<f64>();
    }
    let missing = before - stock.volume();
    println!("{removed} {missing}");
    assert!((removed / missing - 1.0).abs() < 1e-5, "{removed} {missing}");
    assert!((stock.removed() / removed - 1.0).abs() < 1e-12);
}

/// A plunge of a ball: the mean force goes along the axis, as the integral over the whole cap by hand has it.
#[test]
fn a_plunge_pushes_along_the_axis() {
    let cutter = cutter(10.0, 5.0);
    let mut stock = Stock::new(block(40.0, 40.0, 20.0), 0.3 * MM);
    let front = Front::new(&cutter, &coefficients());
    let poses = line(upright(20.0, 20.0, 2.0), upright(20.0, 20.0, -3.0), 1.0);
    let done = run(&mut stock, &front, &poses);
    let (last, removed) = done.last().unwrap();
    // h = ft·cos κ, κ from 0 to κ0 = acos(1 − 3/5): Fz = N·r·∫ cos κ·(Kr·h + Kre) − sin κ·(Ka·h + Kae) dκ.
    let (k, r) = (coefficients(), 5.0 * MM);
    let k0 = 0.4_f64.acos();
    let (s, c) = k0.sin_cos();
    let fz =
        3.0 * r * (FEED_PER_TOOTH * (k.krc * 0.5 * (k0 + s * c) - k.kac * 0.5 * s * s) + k.kre * s - k.kae * (1.0 - c));
    let found = force(last);
    assert!((found.z / fz - 1.0).abs() < 0.01, "{} {fz}", found.z);
    assert!(found.x.hypot(found.y) < 0.01 * fz, "{found:?}");
    let slice = PI * (3.0 * 3.0 * (15.0 - 3.0) - 2.0 * 2.0 * (15.0 - 2.0)) / 3.0 * MM.powi(3);
    assert!((removed / slice - 1.0).abs() < 0.02, "{removed} {slice}");
}

/// A corner of a pocket: the arc of engagement of a cutter that runs into it grows as the wall turns towards it.
#[test]
fn the_arc_grows_in_a_corner() {
    let cutter = cutter(10.0, 0.0);
    let mut stock = Stock::new(block(80.0, 80.0, 20.0), 0.3 * MM);
    let front = Front::new(&cutter, &coefficients());
    // A clearing 40 wide, then along its lower wall 1 mm deeper, into the corner.
    for k in 0..8 {
        let y = 25.0 + 30.0 * f64::from(k) / 7.0;
        run(&mut stock, &front, &line(upright(25.0, y, -3.0), upright(55.0, y, -3.0), 2.0));
    }
    run(&mut stock, &front, &line(upright(55.0, 25.0, -3.0), upright(55.0, 55.0, -3.0), 2.0));
    let poses = line(upright(30.0, 24.0, -3.0), upright(56.0, 24.0, -3.0), 0.5);
    let done = run(&mut stock, &front, &poses);
    // Along the wall: acos(1 − ae/R).
    let along = done[20].0.arc.to_degrees();
    let wanted = (1.0_f64 - 1.0 / 5.0).acos().to_degrees();
    assert!((along - wanted).abs() < 1.0, "{along} {wanted}");
    // In the corner, 1 mm into the far wall at x = 60: from square to the feed to where 56 + 5·cos φ = 60.
    let end = done.last().unwrap().0.arc.to_degrees();
    let ahead = (1.0_f64 - 1.0 / 5.0).acos().to_degrees();
    assert!((end - (90.0 + ahead)).abs() < 1.0, "{end} {}", 90.0 + ahead);
}

/// The bound that is printed holds the error against the closed form, and both stay small.
#[test]
fn the_bound_holds() {
    for depth in [0.3, 0.7, 1.13, 2.9] {
        let cutter = cutter(25.0, 5.0);
        let mut stock = Stock::new(block(100.0, 60.0, 20.0), 0.5 * MM);
        let front = Front::new(&cutter, &coefficients());
        let done = run(&mut stock, &front, &line(upright(-20.0, 30.0, -depth), upright(60.0, 30.0, -depth), 2.0));
        let last = &done.last().unwrap().0;
        let wanted = declared(cutter, Mode::Slot, depth, 0.0);
        let bound = last.bound[0] + FEED_PER_TOOTH * last.bound[1];
        let error = (force(last) - wanted).norm();
        println!("{depth} mm: error {error:.4} N, bound {bound:.4} N of {:.1} N", wanted.norm());
        assert!(error <= bound + 1e-3 * wanted.norm(), "{error} {bound}");
        assert!(bound < 0.05 * wanted.norm(), "{bound}");
    }
}

/// The stock at an earlier moment is the same after it has been cut further.
#[test]
fn a_moment_of_the_stock_is_kept() {
    let front = Front::new(&cutter(25.0, 5.0), &coefficients());
    for (lean, dip) in [(0.0, 0.0), (0.08, 0.0), (0.0, 0.3)] {
        let axis = Unit::new_normalize(Vector3::new(lean, 0.0, 1.0));
        let mut stock = Stock::new(block(60.0, 30.0, 20.0), 0.5 * MM);
        let pass = |y: u32| {
            let along = move |k: u32| if y.is_multiple_of(2) { k } else { 30 - k };
            (0..=30).map(move |k| (f64::from(2 * along(k)), 2.3 * f64::from(y), -1.5 - dip * f64::from(k % 5)))
        };
        let poses: Vec<_> = (0..12).flat_map(pass).map(|(x, y, z)| ToolPose { axis, ..upright(x, y, z) }).collect();
        for part in poses.chunks(100) {
            stock.keep_history();
            let mut questions = Vec::new();
            for pair in part.windows(2) {
                let way = pair[1].tip - pair[0].tip;
                questions.push((stock.now(), pair[1], way, front.engaged(&stock, &pair[1], &way)));
                stock.remove(front.solid(), &pair[0], &pair[1]);
            }
            for (moment, pose, way, then) in questions {
                assert_eq!(front.engaged_at(&stock, &moment, &pose, &way), then);
            }
        }
    }
}

/// Moves that are deferred remove, and meet, what they do one by one.
#[test]
fn deferred_moves_are_those_one_by_one() {
    let front = Front::new(&cutter(16.0, 3.0), &coefficients());
    for lean in [0.0, 0.1] {
        let axis = Unit::new_normalize(Vector3::new(lean, 0.0, 1.0));
        let along = |y: i32| (0..=30).map(move |k| if y % 2 == 0 { k } else { 30 - k });
        let at = |x: i32, y: i32| upright(2.0 * f64::from(x), 3.1 * f64::from(y), -1.5 - 0.2 * f64::from((x + y) % 4));
        let poses: Vec<_> =
            (0..4).flat_map(|y| along(y).map(move |x| at(x, y))).map(|pose| ToolPose { axis, ..pose }).collect();
        let mut one = Stock::new(block(60.0, 20.0, 20.0), MM);
        let wanted = run(&mut one, &front, &poses);
        let moves: Vec<_> = poses.windows(2).collect();
        for batch in [7, 200] {
            let mut stock = Stock::new(block(60.0, 20.0, 20.0), MM);
            let mut found = Vec::new();
            for part in moves.chunks(batch) {
                stock.keep_history();
                let mut questions = Vec::new();
                for pair in part {
                    questions.push((stock.now(), pair[1], pair[1].tip - pair[0].tip));
                    stock.defer(front.solid(), &pair[0], &pair[1]);
                }
                let volumes = stock.settle();
                let answers = questions.iter().map(|(moment, pose, way)| front.engaged_at(&stock, moment, pose, way));
                found.extend(answers.zip(volumes));
            }
            assert!(found == wanted, "batches of {batch}");
            assert!((stock.removed() / one.removed() - 1.0).abs() < 1e-12);
            assert_eq!(stock.volume().to_bits(), one.volume().to_bits());
        }
    }
}
