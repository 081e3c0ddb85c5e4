//! Reports which effects cancel in rows that the robot itself probed, because they act alike when the arm cuts and when
//! it touches.

use super::candidate::Candidate;
use super::data::Problem;
use super::differences::moved;
use super::probing::Probing;
use deflex_equilibrium::Arm;

/// A sentence about the effects that cancel in rows that the robot probed; `None` if there are no such rows.
pub(super) fn cancelled(problem: &mut Problem, declared: &Arm, candidates: &[Candidate]) -> Option<String> {
    /// Share of an effect that the rows must show for it not to be reported. Below it most of the effect remains in the
    /// part.
    const MOST: f64 = 0.5;
    let count = problem.rows.iter().filter(|row| row.probing.is_some()).count();
    if count == 0 {
        return None;
    }
    let mut kinds: Vec<(&str, Vec<Arm>)> = Vec::new();
    for candidate in candidates.iter().filter(|candidate| !candidate.is_pattern()) {
        if kinds.iter().all(|(known, _)| *known != candidate.kind) {
            let declared_numbers = Candidate { values: candidate.start.clone(), ..candidate.clone() };
            let arms = (0..candidate.values.len()).map(|k| moved(declared, &declared_numbers, k..k + 1).0);
            kinds.push((&candidate.kind, arms.collect()));
        }
    }
    let sizes = |problem: &Problem| -> Vec<f64> {
        let known = problem.equilibria(declared);
        let base = problem.residual(declared);
        let size = |(_, arms): &(&str, Vec<Arm>)| {
            let moved = problem.residuals_near(arms, &known).into_iter().map(|moved| (moved - &base).norm_squared());
            moved.filter(|square| square.is_finite()).sum::<f64>().sqrt()
        };
        kinds.iter().map(size).collect()
    };
    let seen = sizes(problem);
    let probings: Vec<Option<Probing>> = problem.rows.iter_mut().map(|row| row.probing.take()).collect();
    let cut = sizes(problem);
    problem.rows.iter_mut().zip(probings).for_each(|(row, probing)| row.probing = probing);
    let share = |((kind, _), (seen, cut)): (&(&str, Vec<Arm>), (&f64, &f64))| {
        (*seen < MOST * cut).then(|| format!("`{kind}` ({:.0} %)", 100.0 * seen / cut))
    };
    let shares: Vec<String> = kinds.iter().zip(seen.iter().zip(&cut)).filter_map(share).collect();
    let what = match &shares[..] {
        [] => "They show more than half of every effect".to_owned(),
        shares => format!(
            "They show only this share of the following effects, and the rest of the error stays in the part: {}",
            shares.join(", ")
        ),
    };
    Some(format!(
        "the robot itself probed {count} rows: `before` and `after` are errors in its own readings. An error that is the same in cutting and in probing \
         cancels there. {what}. To correct it, measure the part with another instrument"
    ))
}
