//! The stiffness of the TCP at each target.

use super::Prepared;
use super::collected::points_of;
use super::context::Context;
use super::row::{Row, Stiffness};
use deflex_cell::Cell;
use deflex_effects::Cutting;
use nalgebra::{Matrix3, Vector3};

impl Stiffness {
    /// The stiffness for a compliance (m/N) and a unit normal; `None` if the TCP does not yield.
    fn of(compliance: &Matrix3<f64>, normal: &Vector3<f64>) -> Option<Self> {
        let symmetric = 0.5 * (compliance + compliance.transpose());
        let along = symmetric.symmetric_eigenvalues();
        let n_per_mm = |yields: f64| 1e-3 / yields;
        let yields = along.min() > 0.0 && along.max().is_finite();
        yields.then(|| Self {
            normal_n_per_mm: n_per_mm(normal.dot(&(symmetric * normal))),
            least_n_per_mm: n_per_mm(along.max()),
            most_n_per_mm: n_per_mm(along.min()),
        })
    }
}

/// Half the difference of the forces, N: large compared with rounding, small enough that the deflection is linear.
const STEP: f64 = 50.0;

/// Fills `stiffness` by differences of equilibria around the force that acts.
pub(super) fn fill(rows: &mut [Row], context: Context<'_>, prepared: &Prepared) {
    let Context { program, cell, parallelism, .. } = context;
    let at = points_of(rows, program);
    let of = |n: usize| at[n].and_then(|i| stiffness(cell, prepared, i, &rows[n].force_n.into()));
    let found = parallelism.map(rows.len(), of);
    for (row, found) in rows.iter_mut().zip(found) {
        row.stiffness = found;
    }
}

fn stiffness(cell: &Cell, prepared: &Prepared, i: usize, force: &Vector3<f64>) -> Option<Stiffness> {
    let point = &prepared.points[i];
    if point.unsolved.is_some() || prepared.setting(i).held {
        return None;
    }
    let mut situation = prepared.situation(i);
    let into_wobj = situation.base_from_wobj.rotation.inverse();
    let mut under = |force: Vector3<f64>| {
        situation.cutting = Cutting::Constant(force);
        let there = cell.arm.predict(&situation, &point.motor, &point.travel).ok()?;
        Some((there.wobj_from_tcp.translation.vector, into_wobj * there.load.cut))
    };
    let (mut moves, mut forces) = (Matrix3::zeros(), Matrix3::zeros());
    for axis in 0..3 {
        let step = Vector3::ith(axis, STEP);
        let (more, less) = (under(force + step)?, under(force - step)?);
        moves.set_column(axis, &(more.0 - less.0));
        // Some effects change the force: the actual one is used.
        forces.set_column(axis, &(more.1 - less.1));
    }
    Stiffness::of(&(moves * forces.try_inverse()?), &point.normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_stiffnesses_and_the_one_along_a_normal() {
        // Springs of 1000, 2000 and 4000 N/mm along x, y and z.
        let compliance = Matrix3::from_diagonal(&Vector3::new(1e-6, 0.5e-6, 0.25e-6));
        let found = Stiffness::of(&compliance, &Vector3::y()).unwrap();
        approx::assert_relative_eq!(found.normal_n_per_mm, 2000.0, max_relative = 1e-12);
        approx::assert_relative_eq!(found.least_n_per_mm, 1000.0, max_relative = 1e-12);
        approx::assert_relative_eq!(found.most_n_per_mm, 4000.0, max_relative = 1e-12);
        assert_eq!(Stiffness::of(&Matrix3::zeros(), &Vector3::y()), None);
    }
}
