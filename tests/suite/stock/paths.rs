//! Eight paths as shops run them: every force from the stock is compared with a sum over points of the front.

use super::{FEED_PER_TOOTH, MM, block, coefficients, cutter};
use crate::cutting_properties::mill;
use deflex::cutting::Cutter;
use deflex::stock::{Front, Stock, ToolPose};
use deflex_oracles::swept::{self, Move, Pose};
use nalgebra::{Unit, Vector3};

/// Poses of one cutter after another; the way to a cutter's first pose does not cut.
type Path = Vec<(Cutter, Vec<ToolPose>)>;

fn at(x: f64, y: f64, z: f64) -> ToolPose {
    leaning(x, y, z, 0.0, 0.0)
}

/// With its axis turned about y, then about x, degrees.
fn leaning(x: f64, y: f64, z: f64, about_y: f64, about_x: f64) -> ToolPose {
    let (sy, cy) = about_y.to_radians().sin_cos();
    let (sx, cx) = about_x.to_radians().sin_cos();
    ToolPose { tip: Vector3::new(x, y, z) * MM, axis: Unit::new_normalize(Vector3::new(sy, -sx * cy, cx * cy)) }
}

/// Poses through corners, at most a step (mm) apart.
fn through(corners: &[ToolPose], step_mm: f64) -> Vec<ToolPose> {
    let mut out = vec![corners[0]];
    for pair in corners.windows(2) {
        let n = ((pair[1].tip - pair[0].tip).norm() / (step_mm * MM)).ceil().max(1.0) as usize;
        out.extend((1..=n).map(|i| pair[0].between(&pair[1], i as f64 / n as f64)));
    }
    out
}

/// Largest and 97 % error as shares of the path's peak force.
fn errors(path: &Path, blank: [f64; 3], resolution_mm: f64, every: usize) -> (f64, f64) {
    let blank = block(blank[0], blank[1], blank[2]);
    let mut stock = Stock::new(blank.clone(), resolution_mm * MM);
    let mut before: Vec<Move> = Vec::new();
    let mut rows: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
    let mut n = 0;
    let mut volume = 0.0;
    for (cutter, poses) in path {
        let front = Front::new(cutter, &coefficients());
        for pair in poses.windows(2) {
            let [from, to] = [&pair[0], &pair[1]].map(|pose| Pose { tip: pose.tip, axis: pose.axis });
            let now = Move { mill: mill(cutter, &coefficients()), from, to };
            n += 1;
            if n % every == 0 {
                let found = front.engaged(&stock, &pair[1], &(pair[1].tip - pair[0].tip));
                let wanted = swept::force(&blank.bounds(), &before, &now, FEED_PER_TOOTH);
                rows.push((found.force.at(FEED_PER_TOOTH), wanted));
            }
            volume += stock.remove(front.solid(), &pair[0], &pair[1]);
            before.push(now);
        }
    }
    let whole = Stock::new(blank.clone(), resolution_mm * MM).volume();
    let conserved = (whole - stock.volume() - volume).abs() / volume;
    assert!(conserved < 1e-9, "{conserved}");
    let peak = rows.iter().map(|(_, wanted)| wanted.norm()).fold(0.0, f64::max);
    assert!(peak > 10.0);
    let mut errors: Vec<f64> = rows.iter().map(|(found, wanted)| (found - wanted).norm() / peak).collect();
    errors.sort_by(f64::total_cmp);
    let most = errors[((errors.len() as f64 * 0.97).ceil() as usize).max(1) - 1];
    println!(
        "{} targets, peak {peak:.1} N, 97 %: {:.3} %, most {:.3} %",
        errors.len(),
        100.0 * most,
        100.0 * errors.last().unwrap()
    );
    (*errors.last().unwrap(), most)
}

#[track_caller]
fn agrees(path: &Path, blank: [f64; 3], resolution_mm: f64, every: usize) {
    let (_, most) = errors(path, blank, resolution_mm, every);
    assert!(most <= 0.03, "{:.2} % of the peak at 97 % of the targets", 100.0 * most);
}

#[test]
fn a_slot_that_enters_and_leaves() {
    let path = vec![(cutter(16.0, 2.0), through(&[at(-12.0, 20.0, -2.0), at(72.0, 20.0, -2.0)], 1.5))];
    agrees(&path, [60.0, 40.0, 10.0], 0.4, 2);
}

#[test]
fn facing_to_and_fro() {
    let corners: Vec<ToolPose> = (0..5)
        .flat_map(|k| {
            let (y, ends) = (f64::from(k) * 11.3, if k % 2 == 0 { [-16.0, 66.0] } else { [66.0, -16.0] });
            ends.map(|x| at(x, y, -1.3))
        })
        .collect();
    agrees(&vec![(cutter(20.0, 3.0), through(&corners, 2.0))], [50.0, 45.0, 10.0], 0.5, 7);
}

#[test]
fn a_pocket_with_corners() {
    let mut corners = vec![at(30.0, 30.0, 1.0), at(30.0, 30.0, -2.0)];
    for ring in 1..4 {
        let r = 5.7 * f64::from(ring);
        for [x, y] in [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]] {
            corners.push(at(30.0 + r * x, 30.0 + r * y, -2.0));
        }
    }
    agrees(&vec![(cutter(10.0, 1.0), through(&corners, 1.0))], [60.0, 60.0, 10.0], 0.3, 23);
}

#[test]
fn a_ball_over_waves() {
    let poses: Vec<ToolPose> = (0..8)
        .flat_map(|k| {
            let y = 8.0 + 0.9 * f64::from(k);
            let along: Vec<f64> = (0..45).map(|i| -6.0 + f64::from(i)).collect();
            let along: Vec<f64> = if k % 2 == 0 { along } else { along.into_iter().rev().collect() };
            along.into_iter().map(move |x| at(x, y, -1.2 + 0.8 * (x * 0.3).sin()))
        })
        .collect();
    agrees(&vec![(cutter(8.0, 4.0), poses)], [32.0, 30.0, 8.0], 0.2, 9);
}

#[test]
fn two_tools_with_a_leaning_finisher() {
    let rough: Vec<ToolPose> = (0..3)
        .flat_map(|k| {
            let (y, ends) = (10.0 + 8.0 * f64::from(k), if k % 2 == 0 { [-14.0, 54.0] } else { [54.0, -14.0] });
            ends.map(|x| at(x, y, -2.0))
        })
        .collect();
    let finish: Vec<ToolPose> = (0..6)
        .flat_map(|k| {
            let (y, ends) = (12.0 + 1.1 * f64::from(k), if k % 2 == 0 { [-10.0, 50.0] } else { [50.0, -10.0] });
            ends.map(|x| leaning(x, y, -2.5, 8.0, 12.0))
        })
        .collect();
    let path = vec![(cutter(16.0, 1.0), through(&rough, 2.0)), (cutter(10.0, 5.0), through(&finish, 1.0))];
    agrees(&path, [40.0, 36.0, 10.0], 0.3, 13);
}

#[test]
fn ramps_and_steps() {
    let corners = [
        at(-15.0, 15.0, 0.0),
        at(10.0, 15.0, 0.0),
        at(40.0, 15.0, -2.5),
        at(55.0, 15.0, -2.5),
        at(55.0, 15.0, -1.0),
        at(55.0, 21.0, -1.0),
        at(30.0, 21.0, -1.8),
        at(10.0, 21.0, -3.0),
        at(2.0, 26.0, -3.0),
    ];
    agrees(&vec![(cutter(12.0, 2.5), through(&corners, 1.0))], [60.0, 40.0, 12.0], 0.4, 5);
}

#[test]
fn around_an_island() {
    let rings = [14.0, 9.5, 7.0];
    let poses: Vec<ToolPose> = rings
        .iter()
        .flat_map(|island| {
            (0..=80).map(move |i| {
                let (sin, cos) = (f64::from(i) * 4.5_f64.to_radians()).sin_cos();
                // A rounded square.
                let r = (island + 5.0) / (cos.powi(8) + sin.powi(8)).powf(0.125);
                at(30.0 + r * cos, 30.0 + r * sin, -2.2)
            })
        })
        .collect();
    agrees(&vec![(cutter(10.0, 0.5), poses)], [60.0, 60.0, 10.0], 0.3, 11);
}

#[test]
fn a_five_axis_fan() {
    let poses: Vec<ToolPose> = (0..3)
        .flat_map(|k| {
            let y = 12.0 + 5.0 * f64::from(k);
            let along: Vec<i32> = if k % 2 == 0 { (0..45).collect() } else { (0..45).rev().collect() };
            along.into_iter().map(move |i| {
                let x = -8.0 + 1.4 * f64::from(i);
                leaning(x, y, -2.0, -25.0 + 50.0 * (x + 8.0) / 62.0, 10.0)
            })
        })
        .collect();
    agrees(&vec![(cutter(12.0, 3.0), poses)], [45.0, 40.0, 15.0], 0.4, 7);
}

/// The error of the grid falls with its spacing.
#[test]
fn finer_lines_err_less() {
    let corners: Vec<ToolPose> = (0..4)
        .flat_map(|k| {
            let (y, ends) = (10.0 + 0.7 * f64::from(k), if k % 2 == 0 { [0.0, 30.0] } else { [30.0, 0.0] });
            ends.map(|x| at(x, y, -0.6 - 0.1 * f64::from(k)))
        })
        .collect();
    let path = vec![(cutter(6.0, 3.0), through(&corners, 1.0))];
    // From spacings that the passes 0.7 apart slip through to one that sees them all.
    let found = [3.0, 1.5, 0.5].map(|resolution| errors(&path, [40.0, 24.0, 6.0], resolution, 5).0);
    println!("{found:?}");
    assert!(found[0] > 0.06 && found[1] < 0.5 * found[0] && found[2] < 0.03, "{found:?}");
}
