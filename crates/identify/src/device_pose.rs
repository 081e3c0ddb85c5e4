//! The unknown poses of instruments: their numbers, the columns of these, and their changes by a fit.

use super::data::{Observation, Parts, Problem};
use super::device::Device;
use deflex_equilibrium::Settled;
use deflex_robot::Pose;
use nalgebra::{DVector, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Prior sizes of a shift, mm, and of a turn, rad: larger than any error of a registration.
const FREE: (f64, f64) = (100.0, 0.1);

/// The device of a run, with the pose of its frame in the base if it has one.
pub(super) type InstrumentPlace = (Device, Option<Pose>);

/// Number of fitted numbers of the instrument of a run.
pub(super) fn unknowns(problem: &Problem, run: usize) -> usize {
    match problem.devices[run] {
        Device::Known => 0,
        Device::Frame { .. } if problem.rows.iter().any(|row| row.run == run && row.turned.is_some()) => 9,
        Device::Frame { .. } => 6,
        Device::Point(_) => 3,
    }
}

/// The column of number `axis` of the instrument of a run, mm and mrad for each prior size. It is computed about the
/// equilibria of the arm and not about the declared poses of the TCP: with a wrong tool the turns of the frame would
/// otherwise be wrong.
pub(super) fn column(problem: &Problem, settled: &[Option<Settled>], run: usize, axis: usize) -> DVector<f64> {
    let unit = Vector3::ith(axis % 3, 1.0);
    let of = |(row, there): (&Observation, &Option<Settled>)| -> Parts {
        let declared = || problem.runs[row.run].points[row.point].wobj_from_tcp;
        let there = there.as_ref().map_or_else(declared, |there| there.wobj_from_tcp);
        let place = there.translation.vector * 1e3;
        let none = Vector3::zeros();
        // If the frame moves, the point and the probe move the other way in it.
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

/// The present pose of the instrument of every run.
pub(super) fn places(problem: &Problem) -> Vec<InstrumentPlace> {
    let frame = |run: &deflex_correct::Prepared| (!run.points.is_empty()).then(|| run.base_from_wobj(0));
    let place = |(&device, run)| (device, frame(run).filter(|_| matches!(device, Device::Frame { .. })));
    problem.devices.iter().zip(&problem.runs).map(place).collect()
}

/// Moves the instrument of every run back to a pose from [`places`].
pub(super) fn restore(problem: &mut Problem, places: &[InstrumentPlace]) {
    for (run, (device, frame)) in places.iter().enumerate() {
        problem.devices[run] = *device;
        if let Some(base_from_device) = frame {
            problem.runs[run].place_in(|_| *base_from_device);
        }
    }
}

/// Moves the instrument of a run by its fitted numbers, in prior sizes.
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
