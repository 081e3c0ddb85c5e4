//! Mean forces by brute force: points on the cutter's front, each held against every place where a cutter has been. φ is measured
//! from the y axis, clockwise.

use crate::Mill;
use nalgebra::{Unit, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// A place of a cutter.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// The lowest point on the axis of the cutter, m.
    pub tip: Vector3<f64>,
    /// From the tip to the shaft.
    pub axis: Unit<Vector3<f64>>,
}

/// A move of a cutter.
#[derive(Clone, Copy, Debug)]
pub struct Move {
    /// The cutter.
    pub mill: Mill,
    /// Where the move begins.
    pub from: Pose,
    /// Where it ends.
    pub to: Pose,
}

/// Places of a move that are looked at are so far apart, m, or turned by so much, rad.
const STEP: f64 = 0.2e-3;
const TURN: f64 = 0.005;

/// Rounding of positions, m.
const TOUCH: f64 = 1e-7;

fn cylinder_and_corner(mill: &Mill, pose: &Pose, point: &Vector3<f64>) -> bool {
    let from_tip = point - pose.tip;
    let up = from_tip.dot(&pose.axis);
    let across = (from_tip.norm_squared() - up * up).max(0.0).sqrt();
    // What the cutter touches it has taken.
    let (radius, corner) = (0.5 * mill.diameter + TOUCH, mill.corner_radius);
    if up < -TOUCH || across > radius {
        return false;
    }
    let out = across - (radius - corner);
    up >= corner || out <= 0.0 || out.hypot(corner - up) <= corner + TOUCH
}

fn between(a: &Pose, b: &Pose, share: f64) -> Pose {
    let axis = a.axis.slerp(&b.axis, share);
    Pose { tip: a.tip + (b.tip - a.tip) * share, axis }
}

/// Whether a move has taken a point away.
fn taken(step: &Move, point: &Vector3<f64>) -> bool {
    // No cutter is longer than a decimetre here.
    let reach = 0.5 * step.mill.diameter;
    let ends = [step.from, step.to].map(|pose| [pose.tip, pose.tip + pose.axis.into_inner() * 0.1]);
    let outside = |i: usize| {
        let at = ends.iter().flatten().map(|end| end[i]);
        point[i] < at.clone().fold(f64::INFINITY, f64::min) - reach
            || point[i] > at.fold(f64::NEG_INFINITY, f64::max) + reach
    };
    if outside(0) || outside(1) {
        return false;
    }
    let turn = step.from.axis.angle(&step.to.axis);
    let n = ((step.to.tip - step.from.tip).norm() / STEP).max(turn / TURN).ceil().max(1.0) as usize;
    (0..=n).any(|i| cylinder_and_corner(&step.mill, &between(&step.from, &step.to, i as f64 / n as f64), point))
}

/// Mean force on the tool at the end of a move in a block, of which the moves before took their share, in the axes of the block, N.
pub fn force([low, high]: &[Vector3<f64>; 2], before: &[Move], now: &Move, feed_per_tooth: f64) -> Vector3<f64> {
    const AROUND: usize = 144;
    const PER_MM: f64 = 10.0;
    let feed = (now.to.tip - now.from.tip).normalize();
    let pose = &now.to;
    let oz: Unit<Vector3<f64>> = pose.axis;
    let across = oz.cross(&feed);
    let yc = if across.norm() > 1e-9 { across.normalize() } else { oz.cross(&Vector3::new(0.3, 0.9, 0.1)).normalize() };
    let xc = yc.cross(&oz);
    let (fx, fy, fz) = (feed.dot(&xc), feed.dot(&yc), feed.dot(&oz));
    let (radius, corner) = (0.5 * now.mill.diameter, now.mill.corner_radius);
    let mut sum = Vector3::zeros();
    let mut add = |sin_k: f64, cos_k: f64, rho: f64, z: f64, width: f64| {
        for j in 0..AROUND {
            let phi = TAU * (j as f64 + 0.5) / AROUND as f64;
            let (s, c) = phi.sin_cos();
            let chip = fx * sin_k * s + fy * sin_k * c - fz * cos_k;
            if chip <= 0.0 {
                continue;
            }
            let point = pose.tip + (xc * s + yc * c) * rho + oz.into_inner() * z;
            if (0..3).any(|i| point[i] < low[i] || point[i] > high[i]) || before.iter().rev().any(|m| taken(m, &point))
            {
                continue;
            }
            let [ft, fr, fa] = now.mill.edge_force(feed_per_tooth * chip);
            let on_tool = xc * (-c * ft - sin_k * s * fr - cos_k * s * fa)
                + yc * (s * ft - sin_k * c * fr - cos_k * c * fa)
                + oz.into_inner() * (cos_k * fr - sin_k * fa);
            sum += on_tool * width * TAU / AROUND as f64;
        }
    };
    let rows = (FRAC_PI_2 * corner * 1e3 * PER_MM).ceil() as usize;
    for i in 0..rows {
        let (sin_k, cos_k) = (FRAC_PI_2 * (i as f64 + 0.5) / rows as f64).sin_cos();
        add(sin_k, cos_k, radius - corner + corner * sin_k, corner * (1.0 - cos_k), FRAC_PI_2 * corner / rows as f64);
    }
    let far = (high - low).norm();
    let top = ((high.z - pose.tip.z) / oz.z.max(0.2) + radius).clamp(corner, corner + far);
    let rows = ((top - corner) * 1e3 * PER_MM).ceil() as usize;
    for i in 0..rows {
        let z = corner + (top - corner) * (i as f64 + 0.5) / rows as f64;
        add(1.0, 0.0, radius, z, (top - corner) / rows as f64);
    }
    sum * f64::from(now.mill.teeth) / TAU
}
