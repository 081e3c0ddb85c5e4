//! The mean force of a cutter as a plain sum over its envelope.

use crate::Mill;
use nalgebra::{Rotation3, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// The side of the feed on which the neighbouring pass was.
#[derive(Clone, Copy, Debug)]
pub enum Side {
    /// At +y.
    Left,
    /// At −y.
    Right,
}

/// A cut, with the feed along x and the normal of the stock along z, in SI units.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    /// The cutter.
    pub mill: Mill,
    /// None for a slot.
    pub previous_pass: Option<Side>,
    /// m
    pub depth: f64,
    /// What is left for this pass, m.
    pub width: f64,
    /// m
    pub feed_per_tooth: f64,
    /// Turn of the axis about y, rad.
    pub lead: f64,
    /// Turn of the axis about x after the lead, rad.
    pub tilt: f64,
}

/// Angles of the plain sum.
pub const ANGLES: usize = 1400;

/// How far to one side a cutter reaches at each height over its tip: its support points for normals from down to that side,
/// sampled, and the shaft above.
struct Reach {
    /// Height and reach, from the lowest up.
    points: Vec<[f64; 2]>,
    slope: f64,
}

impl Reach {
    fn new(mill: &Mill, axis: &Vector3<f64>, sign: f64) -> Self {
        const NORMALS: usize = 4000;
        let (r, flat) = (mill.corner_radius, 0.5 * mill.diameter - mill.corner_radius);
        let down = -Vector3::z();
        let side = Vector3::new(0.0, axis.z, -axis.y).normalize() * sign;
        let point = |i: usize| {
            let turn = i as f64 / NORMALS as f64;
            let normal = down.lerp(&side, turn).normalize();
            let across = normal - axis * normal.dot(axis);
            let over_flat = across.try_normalize(1e-9).map_or_else(Vector3::zeros, |out| out * flat);
            let p = (axis + normal) * r + over_flat;
            [p.z, sign * p.y]
        };
        Self { points: (1..=NORMALS).map(point).collect(), slope: sign * axis.y / axis.z }
    }

    fn at(&self, z: f64) -> f64 {
        let i = self.points.partition_point(|[height, _]| *height < z);
        match (i.checked_sub(1).map(|i| self.points[i]), self.points.get(i)) {
            (Some([low, from]), Some([high, to])) => from + (z - low) / (high - low) * (to - from),
            (Some([side, reach]), None) => reach + (z - side) * self.slope,
            (None, _) => self.points[0][1],
        }
    }
}

/// Mean force on the tool in the feed frame, N, if it is `shift` (m) away and its axis is `axis`: the midpoint sum over profile and
/// angle, every element judged on its own.
pub fn plain_sum(c: &Cut, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
    let (radius, r) = (0.5 * c.mill.diameter, c.mill.corner_radius);
    let nominal = Rotation3::from_axis_angle(&Vector3::x_axis(), c.tilt)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), c.lead)
        * Vector3::z();
    let tip_height = (radius - r) * nominal.x.hypot(nominal.y) + r * (1.0 - nominal.z);
    let tip = Vector3::new(0.0, 0.0, tip_height - c.depth + shift.z);
    let y = axis.cross(&Vector3::x()).normalize();
    let x = y.cross(axis);
    // Above this height along the axis nothing is below the stock's top.
    let top = (-tip.z + radius * axis.x.hypot(axis.y)) / axis.z;
    // The neighbouring pass has the same cutter and the same deflection: at each height it leaves a stepover of what this one reaches.
    let across = nominal.cross(&Vector3::x()).normalize();
    let along = across.cross(&nominal);
    let reach = c.previous_pass.map(|pass| {
        let sign = match pass {
            Side::Left => -1.0,
            Side::Right => 1.0,
        };
        (sign, Reach::new(&c.mill, &nominal, sign))
    });
    const STEPS: usize = 700;
    let corner_end = if top < r { (1.0 - top / r).acos() } else { FRAC_PI_2 };
    let angles: Vec<(f64, f64)> = (0..ANGLES).map(|i| ((i as f64 + 0.5) * TAU / ANGLES as f64).sin_cos()).collect();
    let mut sum = Vector3::zeros();
    let mut ring = |kappa: f64, height: f64, width: f64| {
        let (sk, ck) = kappa.sin_cos();
        let rho = radius - r + r * sk;
        for &(sp, cp) in &angles {
            // φ from +y, clockwise seen from above.
            let out = x * sp + y * cp;
            let normal = out * sk - axis * ck;
            let p = out * rho + axis * height;
            if normal.x <= 0.0 || p.z + tip.z >= 0.0 {
                continue;
            }
            let on_across = (along * sp + across * cp) * rho + nominal * height;
            if reach.as_ref().is_some_and(|(sign, reach)| sign * on_across.y < reach.at(on_across.z) - c.width) {
                continue;
            }
            let [ft, fr, fa] = c.mill.edge_force(c.feed_per_tooth * normal.x);
            sum += (x * -cp + y * sp) * (ft * width) - normal * (fr * width) - (out * ck + axis * sk) * (fa * width);
        }
    };
    for i in 0..STEPS {
        let kappa = (i as f64 + 0.5) * corner_end / STEPS as f64;
        ring(kappa, r * (1.0 - kappa.cos()), r * corner_end / STEPS as f64);
        if top > r {
            ring(FRAC_PI_2, r + (i as f64 + 0.5) * (top - r) / STEPS as f64, (top - r) / STEPS as f64);
        }
    }
    sum * f64::from(c.mill.teeth) / ANGLES as f64
}
