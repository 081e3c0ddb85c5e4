//! Uncertainty of the predicted error from the covariance of the effects' parameters.

use super::collected::points_of;
use super::parallelism::Parallelism;
use super::{Prepared, Row};
use crate::cell::Cell;
use crate::equilibrium::Arm;
use crate::program::Program;
use crate::robot::Joints;
use nalgebra::{DMatrix, Vector3};

/// Step of a parameter for its derivative, in standard deviations: the model is smooth on that scale.
const STEP: f64 = 0.5;

/// Fills `sigma_mm`: per axis, √(tr(J Σ Jᵀ)/3) with J the change of the predicted position with each parameter, and with each
/// joint where an effect was not seen.
pub(super) fn fill(rows: &mut [Row], program: &Program, cell: &Cell, prepared: &Prepared, parallelism: Parallelism) {
    let known: Vec<(usize, &DMatrix<f64>)> =
        cell.covariances.iter().enumerate().filter_map(|(i, c)| c.as_ref().map(|c| (i, c))).collect();
    if known.is_empty() {
        return;
    }
    let at = points_of(rows, program);
    let mut variance = vec![0.0; rows.len()];
    for (effect, covariance) in known {
        let base: Vec<f64> = cell.arm.effects[effect].parameters().iter().map(|p| p.value).collect();
        let columns: Vec<Option<Vec<Vector3<f64>>>> = (0..base.len())
            .map(|k| {
                let step = STEP * covariance[(k, k)].max(0.0).sqrt();
                (step > 0.0).then(|| column(cell, (effect, &base, k, step), prepared, &at, parallelism))
            })
            .collect();
        for (a, left) in columns.iter().enumerate() {
            for (b, right) in columns.iter().enumerate() {
                let (Some(left), Some(right)) = (left, right) else { continue };
                // Curves of different joints are blocks of their own.
                if covariance[(a, b)].abs() <= 0.0 {
                    continue;
                }
                for (sum, (x, y)) in variance.iter_mut().zip(left.iter().zip(right)) {
                    *sum += covariance[(a, b)] * x.dot(y);
                }
            }
        }
        let more = parallelism.map(at.len(), |n| at[n].map_or(0.0, |point| unseen(cell, effect, prepared, point)));
        variance.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }
    for (row, variance) in rows.iter_mut().zip(variance) {
        row.sigma_mm = Some(1e3 * (variance.max(0.0) / 3.0).sqrt());
    }
}

/// Variance of a predicted position, m², all axes together, for what an effect does not say of the joints there.
fn unseen(cell: &Cell, effect: usize, prepared: &Prepared, point: usize) -> f64 {
    let sigma = cell.arm.effects[effect].unseen(&prepared.points[point].motor);
    if sigma.amax() <= 0.0 {
        return 0.0;
    }
    let (situation, point) = (prepared.situation(point), &prepared.points[point]);
    let place = |motor: &Joints| {
        let there = cell.arm.predict(&situation, motor, &point.travel).ok()?;
        Some(there.wobj_from_tcp.translation.vector)
    };
    let Some(there) = place(&point.motor) else { return 0.0 };
    let of = |joint: usize| {
        let mut motor = point.motor;
        motor[joint] += sigma[joint];
        Some((place(&motor)? - there).norm_squared())
    };
    (0..sigma.len()).filter(|&joint| sigma[joint] > 0.0).filter_map(of).sum()
}

/// Change of every predicted position with one parameter, m per unit.
fn column(
    cell: &Cell,
    (effect, base, k, step): (usize, &[f64], usize, f64),
    prepared: &Prepared,
    at: &[Option<usize>],
    parallelism: Parallelism,
) -> Vec<Vector3<f64>> {
    let at = |value: f64| {
        let mut values = base.to_vec();
        values[k] = value;
        let with = |i: usize| {
            let effect_now = &cell.arm.effects[i];
            if i == effect { effect_now.with_values(&values) } else { effect_now.clone_box() }
        };
        let arm = Arm {
            robot: cell.arm.robot.clone(),
            stiffness: cell.arm.stiffness,
            effects: (0..cell.arm.effects.len()).map(with).collect(),
        };
        let place = |n: usize| {
            let point = &prepared.points[at[n]?];
            let there = arm.predict(&prepared.situation(at[n]?), &point.motor, &point.travel).ok()?;
            Some(there.wobj_from_tcp.translation.vector)
        };
        parallelism.map(at.len(), place)
    };
    let (up, down) = (at(base[k] + step), at(base[k] - step));
    let slope = |(up, down): (Option<Vector3<f64>>, Option<Vector3<f64>>)| match (up, down) {
        (Some(up), Some(down)) => (up - down) / (2.0 * step),
        _ => Vector3::zeros(),
    };
    up.into_iter().zip(down).map(slope).collect()
}
