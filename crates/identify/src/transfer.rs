//! Estimates the error of another program with the extended cell.
//!
//! Rows that are left out by place, posture and load are still rows of the same program, and errors that these rows
//! cannot distinguish cancel in all of them. The measured program is therefore moved next to its place: by its own
//! length along x and by its own width along y of its work object, forwards and backwards, as it is and turned by
//! 45° to each side about z. The turns change the posture of the wrist, without which a wrong tool, a wrong frame and
//! wrong zeros are the same error. The posterior covariance of the effects, widened as the left-out rows require, gives
//! the uncertainty of the prediction there.

use super::candidate::Home;
use super::data::{Extent, Observation, Problem};
use super::engine::Engine;
use super::reading::Reading;
use deflex_correct::{Prepared, SIGMA_STEP};
use deflex_effects::moved_within;
use deflex_equilibrium::Arm;
use deflex_robot::Pose;
use nalgebra::{DVector, Rotation3, Translation3, Vector3};
use std::f64::consts::FRAC_PI_4;
use std::sync::Arc;

/// Largest number of rows of each run that are moved. The root mean square over as many places is known within a tenth.
const MOVED_ROWS: usize = 64;

impl Engine {
    /// Standard deviation for each axis of the error of the prediction of another program, mm. `wider` is the variance
    /// that left-out rows show, relative to the variance that the fit predicts. Zero if the arm reaches no such place.
    pub(super) fn transfer_sigma_mm(&self, wider: f64) -> f64 {
        let moved = self.next_to_the_program();
        let arm = self.arm();
        let known = moved.equilibria(&arm);
        let mut variance = DVector::zeros(moved.scalars);
        if let Some(factor) = self.wider_covariance(wider).cholesky().map(|factor| factor.l()) {
            for direction in factor.column_iter() {
                let arms = [SIGMA_STEP, -SIGMA_STEP].map(|step| self.arm_along(&direction.into_owned(), step));
                let ends = moved.residuals_near(&arms, &known);
                let slope = (&ends[0] - &ends[1]) / (2.0 * SIGMA_STEP);
                variance += slope.component_mul(&slope);
            }
        }
        let of_row = |row: &Observation| {
            let positions: f64 = variance.rows(row.offset, row.reading.len()).sum();
            let unseen = (0..arm.effects.len()).map(|effect| moved.runs[row.run].unseen(&arm, effect, row.point));
            Some(positions + 1e6 * unseen.sum::<f64>()).filter(|variance| variance.is_finite())
        };
        let variances: Vec<f64> = moved.rows.iter().filter_map(of_row).collect();
        (variances.iter().sum::<f64>() / (3 * variances.len().max(1)) as f64).sqrt()
    }

    /// The arm with its chosen numbers changed by `step` times a direction, which is a column of the factor of the
    /// covariance in typical sizes.
    fn arm_along(&self, direction: &DVector<f64>, step: f64) -> Arm {
        let mut first = 0;
        let moved = |&c: &usize| {
            let candidate = &self.candidates[c];
            let own = &direction.as_slice()[first..first + candidate.values.len()];
            first += own.len();
            let value =
                |k: usize| moved_within(candidate.values[k], step * own[k] * candidate.typical[k], candidate.bounds[k]);
            (&candidate.home, (0..own.len()).map(value).collect())
        };
        let values: Vec<(&Home, Vec<f64>)> = self.chosen.iter().map(moved).collect();
        let changes: Vec<(&Home, &[f64])> = values.iter().map(|(home, values)| (*home, &values[..])).collect();
        self.arm_of(&changes)
    }

    /// The rows of the measured programs, moved next to their places.
    fn next_to_the_program(&self) -> Problem {
        let mut moved = Problem { units: Arc::clone(&self.problem.units), ..Problem::empty(Extent::Part) };
        for (run, prepared) in self.problem.runs.iter().enumerate() {
            let rows: Vec<&Observation> = self.problem.rows.iter().filter(|row| row.run == run).collect();
            let rows: Vec<&Observation> =
                rows.iter().step_by(rows.len().div_ceil(MOVED_ROWS).max(1)).copied().collect();
            let points: Vec<usize> = rows.iter().map(|row| row.point).collect();
            for by in sides(prepared, &points) {
                let (there, placed) = prepared.relocated(&self.declared.robot, &points, &by);
                for (row, point) in rows.iter().zip(placed) {
                    let Some(point) = point else { continue };
                    let (motor, reading) = (there.points[point].motor, Reading::Position(Vector3::zeros()));
                    let (run, offset) = (moved.runs.len(), moved.scalars);
                    moved.rows.push(Observation { run, point, motor, reading, turned: None, offset, ..(*row).clone() });
                    moved.scalars += reading.len();
                }
                moved.runs.push(there);
                moved.devices.push(self.problem.devices[run]);
            }
        }
        moved
    }
}

/// The motions of a work object, in its own axes, that place a program on each side of its place, as it is and turned about its middle.
fn sides(prepared: &Prepared, points: &[usize]) -> Vec<Pose> {
    const TURNS: [f64; 3] = [-FRAC_PI_4, 0.0, FRAC_PI_4];
    let places = || points.iter().map(|&point| prepared.points[point].reference.translation.vector);
    let low = places().fold(Vector3::repeat(f64::INFINITY), |low, place| low.inf(&place));
    let high = places().fold(Vector3::repeat(f64::NEG_INFINITY), |high, place| high.sup(&place));
    let (size, middle) = (high - low, (high + low) / 2.0);
    let moved = |by: Vector3<f64>| Pose::from_parts(Translation3::from(by), Rotation3::identity());
    let sides = [Vector3::x() * size.x, Vector3::y() * size.y].into_iter().flat_map(|side| [side, -side]);
    let turned = |side: Vector3<f64>| {
        TURNS.map(|turn| {
            let about =
                Pose::from_parts(Translation3::identity(), Rotation3::from_axis_angle(&Vector3::z_axis(), turn));
            moved(middle + side) * about * moved(-middle)
        })
    };
    sides.flat_map(turned).collect()
}
