//! What is unknown of a measuring instrument: nothing, the frame of a tracker, the fixed point of a draw-wire.

use super::data::{Observation, Parts, Problem, Seen};
use crate::equilibrium::Settled;
use crate::robot::Pose;
use nalgebra::{DVector, Matrix3, Matrix4, Rotation3, Translation3, UnitQuaternion, Vector3, Vector4};

/// The unknown part of a run's instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Device {
    /// It measures in the work object.
    Known,
    /// It measures in a frame of its own: the pose of that frame is fitted, and how its probe is mounted.
    Frame {
        /// How the probe is turned on the tool; matters where orientations are measured.
        tcp_from_probe: UnitQuaternion<f64>,
    },
    /// It measures lengths from this point, which is fitted: work object axes, mm.
    Point(Vector3<f64>),
}

/// Prior of a shift and of a turn, mm and rad: anything that a registration may be off.
const FREE: (f64, f64) = (100.0, 0.1);

/// Numbers of a run's instrument that are fitted.
pub(super) fn unknowns(problem: &Problem, run: usize) -> usize {
    match problem.devices[run] {
        Device::Known => 0,
        Device::Frame { .. } if problem.rows.iter().any(|row| row.run == run && row.turned.is_some()) => 9,
        Device::Frame { .. } => 6,
        Device::Point(_) => 3,
    }
}

/// Change of every prediction with unknown `axis` of a run's instrument, mm per prior size, about the arm as it settled:
/// a turn about where the TCP is declared would leave a wrong tool in every frame.
pub(super) fn column(problem: &Problem, settled: &[Option<Settled>], run: usize, axis: usize) -> DVector<f64> {
    let unit = Vector3::ith(axis % 3, 1.0);
    let of = |(row, there): (&Observation, &Option<Settled>)| -> Parts {
        let declared = || problem.runs[row.run].points[row.point].wobj_from_tcp;
        let there = there.as_ref().map_or_else(declared, |there| there.wobj_from_tcp);
        let place = there.translation.vector * 1e3;
        let none = Vector3::zeros();
        // The frame moves: the point and the probe move the other way in it.
        let [moved, turned] = match problem.devices[row.run] {
            _ if row.run != run => [none; 2],
            Device::Known => [none; 2],
            Device::Frame { .. } if axis < 3 => [-unit * FREE.0, none],
            Device::Frame { .. } if axis < 6 => [-unit.cross(&place) * FREE.1, -unit * FREE.1 * 1e3],
            Device::Frame { tcp_from_probe } => [none, there.rotation * (tcp_from_probe * unit) * FREE.1 * 1e3],
            Device::Point(from) => [Vector3::x() * -(place - from).normalize().dot(&unit) * FREE.0, none],
        };
        [moved.into(), turned.into()]
    };
    problem.stacked(problem.rows.iter().zip(settled).map(of))
}

/// Where every run's instrument is taken to be.
pub(super) fn places(problem: &Problem) -> Vec<(Device, Option<Pose>)> {
    let frame = |run: &crate::correct::Prepared| (!run.points.is_empty()).then(|| run.base_from_wobj(0));
    let place = |(&device, run)| (device, frame(run).filter(|_| matches!(device, Device::Frame { .. })));
    problem.devices.iter().zip(&problem.runs).map(place).collect()
}

/// Puts every run's instrument where it was.
pub(super) fn restore(problem: &mut Problem, places: &[(Device, Option<Pose>)]) {
    for (run, (device, frame)) in places.iter().enumerate() {
        problem.devices[run] = *device;
        if let Some(base_from_device) = frame {
            problem.runs[run].place_in(|_| *base_from_device);
        }
    }
}

/// Moves a run's instrument by its unknowns, in prior sizes.
pub(super) fn shift(problem: &mut Problem, run: usize, unknowns: &[f64]) {
    let three = |from: usize, size: f64| Vector3::from_fn(|k, _| unknowns[from + k] * size);
    match problem.devices[run] {
        Device::Known => {}
        Device::Frame { tcp_from_probe } => {
            let step = Pose::from_parts(
                Translation3::from(three(0, FREE.0) * 1e-3),
                Rotation3::from_scaled_axis(three(3, FREE.1)),
            );
            problem.runs[run].place_in(|base_from_device| base_from_device * step);
            if unknowns.len() > 6 {
                let turned = UnitQuaternion::from_scaled_axis(three(6, FREE.1));
                problem.devices[run] = Device::Frame { tcp_from_probe: tcp_from_probe * turned };
            }
        }
        Device::Point(from) => problem.devices[run] = Device::Point(from + three(0, FREE.0)),
    }
}

/// The point from which lengths (mm) were measured to known places (mm); `None` where too few are known.
///
/// |p − d|² is linear in d and |d|², so that a start needs no guess; over a plane the side is open, and the one that
/// fits better is taken, the upper where both do.
pub(super) fn fixed_point<'a>(rows: impl Iterator<Item = (&'a Observation, Vector3<f64>)>) -> Option<Vector3<f64>> {
    let pairs: Vec<(Vector3<f64>, f64)> = rows
        .filter_map(|(row, place)| match row.seen {
            Seen::Distance(length) if !row.held_out => Some((place, length)),
            _ => None,
        })
        .collect();
    const LEAST: usize = 4;
    if pairs.len() < LEAST {
        return None;
    }
    let n = pairs.len() as f64;
    let centre = pairs.iter().map(|pair| pair.0).sum::<Vector3<f64>>() / n;
    let scatter: Matrix3<f64> =
        pairs.iter().map(|(p, _)| (p - centre) * (p - centre).transpose()).sum::<Matrix3<f64>>() / n;
    let axes = scatter.symmetric_eigen();
    let flat = axes.eigenvalues.imin();
    let mut normal: Vector3<f64> = axes.eigenvectors.column(flat).into();
    if normal.z < 0.0 {
        normal = -normal;
    }
    // Ridge, mm²: keeps a direction without spread at the centre, from where both sides are tried.
    const RIDGE: f64 = 1.0;
    let (mut matrix, mut right) = (Matrix4::identity() * RIDGE, Vector4::zeros());
    matrix[(3, 3)] = 0.0;
    for (p, length) in &pairs {
        let q = p - centre;
        let row = Vector4::new(-2.0 * q.x, -2.0 * q.y, -2.0 * q.z, 1.0);
        matrix += row * row.transpose();
        right += row * (length * length - q.norm_squared());
    }
    let solved = matrix.lu().solve(&right)?;
    let near = Vector3::new(solved.x, solved.y, solved.z);
    let above = (solved.w - near.norm_squared()).max(0.0).sqrt();
    let misfit =
        |d: &Vector3<f64>| pairs.iter().map(|(p, length)| (length - (p - centre - d).norm()).powi(2)).sum::<f64>();
    let starts = [near + above * normal, near, near - above * normal];
    let settled = starts.map(|start| descend(&pairs, centre, start));
    settled.into_iter().min_by(|a, b| misfit(a).total_cmp(&misfit(b))).map(|d| centre + d)
}

/// Gauss-Newton on the lengths.
fn descend(pairs: &[(Vector3<f64>, f64)], centre: Vector3<f64>, mut at: Vector3<f64>) -> Vector3<f64> {
    const STEPS: usize = 50;
    /// Damping, in rows: a plane says nothing of the height above it near the plane itself.
    const DAMPING: f64 = 1e-6;
    for _ in 0..STEPS {
        let (mut matrix, mut right) = (Matrix3::identity() * DAMPING, Vector3::zeros());
        for (p, length) in pairs {
            let from = at - (p - centre);
            let unit = from.normalize();
            matrix += unit * unit.transpose();
            right += unit * (length - from.norm());
        }
        let Some(step) = matrix.cholesky().map(|factor| factor.solve(&right)) else { return at };
        at += step;
        if step.norm() < 1e-9 {
            break;
        }
    }
    at
}
