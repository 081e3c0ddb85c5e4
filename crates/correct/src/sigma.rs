//! Uncertainty of the predicted error from the covariance of the effects' parameters.

use super::collected::points_of;
use super::context::Context;
use super::parallelism::Parallelism;
use super::{Prepared, Row};
use deflex_cell::Cell;
use deflex_equilibrium::Arm;
use deflex_robot::Joints;
use nalgebra::{DMatrix, DVector, Vector3};

/// Step along a direction for its derivative, in standard deviations: the model is smooth on that scale.
#[doc(hidden)]
pub const SIGMA_STEP: f64 = 0.5;

/// A common change of the parameters of some effects, by one standard deviation along one direction of their covariance.
type Direction = Vec<(usize, DVector<f64>)>;

/// Fills `sigma_mm`: for each axis √(tr(J Σ Jᵀ)/3), with J the derivative of the predicted position with respect to the parameters, and to
/// each joint where an effect was not measured. Σ is a sum of directions, each of which is evaluated once for any number of parameters.
pub(super) fn fill(rows: &mut [Row], context: Context<'_>, prepared: &Prepared) {
    let Context { program, cell, parallelism, .. } = context;
    let known: Vec<usize> = (0..cell.covariances.len()).filter(|&i| cell.covariances[i].is_some()).collect();
    if known.is_empty() {
        return;
    }
    let at = points_of(rows, program);
    let mut variance = vec![0.0; rows.len()];
    for direction in directions(cell) {
        let slopes = slopes(cell, &direction, prepared, &at, parallelism);
        variance.iter_mut().zip(slopes).for_each(|(sum, slope)| *sum += slope.norm_squared());
    }
    for effect in known {
        let more = parallelism.map(at.len(), |n| at[n].map_or(0.0, |point| prepared.unseen(&cell.arm, effect, point)));
        variance.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }
    for (row, variance) in rows.iter_mut().zip(variance) {
        row.sigma_mm = Some(1e3 * (variance.max(0.0) / 3.0).sqrt());
    }
}

/// The directions of all covariances: columns of the factor that effects share, and of the factor of each other effect.
fn directions(cell: &Cell) -> Vec<Direction> {
    let shared = |i: usize| cell.joint_factors.get(i).and_then(Option::as_ref);
    let wide = (0..cell.covariances.len()).filter_map(shared).map(DMatrix::ncols).max().unwrap_or(0);
    let column = |k: usize| {
        let of = |i: usize| Some((i, shared(i).filter(|factor| k < factor.ncols())?.column(k).into_owned()));
        (0..cell.covariances.len()).filter_map(of).filter(|(_, change)| change.amax() > 0.0).collect::<Direction>()
    };
    let mut all: Vec<Direction> = (0..wide).map(column).collect();
    for (i, covariance) in cell.covariances.iter().enumerate() {
        let Some(covariance) = covariance.as_ref().filter(|_| shared(i).is_none()) else { continue };
        let eigen = covariance.clone().symmetric_eigen();
        let spreads = eigen.eigenvalues.iter().map(|value| value.max(0.0).sqrt());
        all.extend(spreads.zip(eigen.eigenvectors.column_iter()).map(|(spread, vector)| vec![(i, vector * spread)]));
    }
    all.retain(|direction| direction.iter().any(|(_, change)| change.amax() > 0.0));
    all
}

impl Prepared {
    /// Variance of the predicted position of a point, m², all axes together, because an effect was not measured there.
    #[doc(hidden)]
    pub fn unseen(&self, arm: &Arm, effect: usize, point: usize) -> f64 {
        let (situation, point) = (self.situation(point), &self.points[point]);
        let sigma = arm.effects[effect].unseen(&point.motor);
        let shift = arm.effects[effect].unseen_shift(&situation, &point.motor);
        if sigma.amax() <= 0.0 {
            return shift;
        }
        let place = |motor: &Joints| {
            let there = arm.predict(&situation, motor, &point.travel).ok()?;
            Some(there.wobj_from_tcp.translation.vector)
        };
        let Some(there) = place(&point.motor) else { return shift };
        let of = |joint: usize| {
            let mut motor = point.motor;
            motor[joint] += sigma[joint];
            Some((place(&motor)? - there).norm_squared())
        };
        shift + (0..sigma.len()).filter(|&joint| sigma[joint] > 0.0).filter_map(of).sum::<f64>()
    }
}

/// Derivative of every predicted position along a direction, m for each standard deviation.
fn slopes(
    cell: &Cell,
    direction: &Direction,
    prepared: &Prepared,
    at: &[Option<usize>],
    parallelism: Parallelism,
) -> Vec<Vector3<f64>> {
    let at = |step: f64| {
        let with = |i: usize| {
            let effect = &cell.arm.effects[i];
            let Some((_, change)) = direction.iter().find(|(changed, _)| *changed == i) else {
                return effect.clone_box();
            };
            effect.moved((change * step).as_slice())
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
    let (up, down) = (at(SIGMA_STEP), at(-SIGMA_STEP));
    let slope = |(up, down): (Option<Vector3<f64>>, Option<Vector3<f64>>)| match (up, down) {
        (Some(up), Some(down)) => (up - down) / (2.0 * SIGMA_STEP),
        _ => Vector3::zeros(),
    };
    up.into_iter().zip(down).map(slope).collect()
}
