//! Checks whether the controller already corrects an effect that the cell declares.

use super::columns::Columns;
use super::data::Problem;
use super::decisions::PRICE;
use super::moments::Moments;
use super::noise;
use super::score::score;
use deflex_effects::Covered;
use deflex_equilibrium::Arm;
use nalgebra::{DMatrix, DVector};

/// Messages about the effects that the controller seems to correct although the cell declares them as not corrected.
/// `before` is the residual of the declared cell, mm.
pub(super) fn corrected_twice(declared: &Arm, problem: &Problem, before: &DVector<f64>) -> Vec<String> {
    let found = [(Covered::Gravity, "gravity"), (Covered::Geometry, "geometry")].into_iter().filter_map(|(what, word)| {
        let kept = declared.effects.iter().filter(|effect| effect.covered_by() != Some(what));
        let effects: Vec<_> = kept.map(|effect| effect.clone_box()).collect();
        if effects.len() == declared.effects.len() {
            return None;
        }
        let without = Arm { robot: declared.robot.clone(), stiffness: declared.stiffness, effects };
        let residual = problem.residual(&without);
        // The change of the prediction by the declared effects, and the share of it that the rows show.
        let moved = &residual - before;
        let share = residual.dot(&moved) / moved.norm_squared();
        let gain = evidence(problem, &residual) - evidence(problem, before);
        (gain > PRICE).then(|| {
            format!(
                "the controller seems to correct {word} already: the data show only {:.0} % of the displacement that the cell's effects of \
                 {word} predict. The declared cell is off by {:.4} mm rms with these effects, and by {:.4} mm without them. If the \
                 controller corrects {word}, declare `[controller] compensates = [\"{word}\"]`",
                100.0 * share,
                rms(problem, before),
                rms(problem, &residual),
            )
        })
    });
    found.collect()
}

/// Log evidence of a residual that consists of noise alone, nats.
fn evidence(problem: &Problem, residual: &DVector<f64>) -> f64 {
    let stacked = DMatrix::from_columns(std::slice::from_ref(residual));
    let series = problem.series(|row| !row.held_out);
    let moments: Vec<Moments> = noise::few().into_iter().map(|shape| Moments::of(&stacked, &series, shape)).collect();
    score(&moments, &Columns::default(), None).evidence
}

/// Root mean square of a residual over the fitted rows, mm.
fn rms(problem: &Problem, residual: &DVector<f64>) -> f64 {
    let rows = problem.rows.iter().filter(|row| !row.held_out);
    let (sum, count) = rows.fold((0.0, 0usize), |(sum, count), row| {
        (sum + residual.rows(row.offset, row.reading.len()).norm_squared(), count + 1)
    });
    (sum / count.max(1) as f64).sqrt()
}
