//! Writes the advice of an identification: what to measure next, and why.

use super::data::Problem;
use super::decisions::MENTIONED;
use super::outcome::{Added, Identification, Separation, SetShare, Unexplained};
use super::pattern::{CLAMP_SLIP, Pattern};
use deflex_effects::kind;

/// A rival with its d′ on these rows, if it is listed among the pairs.
fn name_with_distance(effect: &Added, rival: &str, pairs: &[Separation]) -> String {
    match pairs.iter().find(|pair| pair.of == effect.kind && pair.from == *rival) {
        Some(pair) => format!("`{rival}` (d′ {:.1}; 5 is enough)", pair.d_prime),
        None => format!("`{rival}`"),
    }
}

/// Sentences about what to measure next, from the added effects, the unexplained errors, d′ of the pairs, and the
/// noise, mm.
pub(super) fn advice(
    added: &[Added],
    unexplained: &Unexplained,
    pairs: &[Separation],
    problem: &Problem,
    noise_mm: f64,
) -> Vec<String> {
    /// Noise, as a share of the step of the readings, below which the step hides it.
    const HIDDEN: f64 = 0.5;
    let mut all = Vec::new();
    if let Some(step) = problem.steps_mm.filter(|step| noise_mm < HIDDEN * step) {
        all.push(format!(
            "the readings come in steps of {step} mm, which is more than their scatter. Let the instrument write more digits, because smaller errors cannot be found"
        ));
    }
    let drift = Pattern::Drift { settles: None }.name();
    let drifts = |effect: &&Added| effect.not_told_apart_from.iter().any(|rival| rival == drift);
    for effect in added.iter().filter(drifts) {
        all.push(format!(
            "`{}` and an instrument that drifts look the same in these rows. Measure some of the first targets again at the end of the run, or \
             give `temperature_c`",
            effect.kind
        ));
    }
    let by_posture = |effect: &&Added| effect.not_told_apart_from.iter().any(|rival| rival != drift);
    for effect in added.iter().filter(by_posture) {
        all.push(format!(
            "`{}` looks the same in these rows as {}. Measure in further postures (another area, the wrist flipped, the tool turned \
             about its axis) and under loads that reverse. More points of the same kind do not help",
            effect.kind,
            effect.not_told_apart_from.iter().map(|kind| name_with_distance(effect, kind, pairs)).collect::<Vec<_>>().join(", "),
        ));
    }
    let is_frame = |effect: &&Added| kind(&effect.kind).is_some_and(|kind| kind.like_device_frame);
    if let Some(effect) = added.iter().find(is_frame).filter(|_| problem.runs.len() == 1) {
        all.push(format!(
            "`{}` holds the place of the work object and the registration of the instrument together, because the rows of one run cannot \
             separate them. If the registration may be off, register the instrument anew, and give both runs",
            effect.kind
        ));
    }
    if unexplained.significant {
        let follows = unexplained.correlates.first().map_or(String::new(), |c| format!(" (it follows {})", c.with));
        all.push(format!("an error remains that no known effect explains{follows}: repeat the run at another time and place to see what it depends on"));
    }
    if problem.orientations > 0 {
        all.push(format!(
            "the {} measured orientations are not used: with a program, or with measured distances, only positions are fitted",
            problem.orientations
        ));
    }
    if problem.rows.iter().all(|row| !problem.runs[row.run].points[row.point].cuts()) && !problem.is_of_robot() {
        all.push("no row carries a cutting force: compliance, curve and force effects cannot be seen; measure loaded rows too".to_owned());
    }
    all
}

/// A sentence if the rows cannot decide whether a clamp of the part slipped or is compliant.
pub(super) fn slipped_or_soft(found: &Identification) -> Option<String> {
    let soft = "clamp_compliance";
    let has = |set: &SetShare, kind: &str| set.kinds.iter().any(|own| own == kind);
    let share = |one: &str, other: &str| -> f64 {
        found.sets.iter().filter(|set| has(set, one) && !has(set, other)).map(|set| set.probability).sum()
    };
    let (slipped, gives) = (share(CLAMP_SLIP, soft), share(soft, CLAMP_SLIP));
    (slipped > MENTIONED && gives > MENTIONED).then(|| {
        format!(
            "a clamp of the part that slipped ({slipped:.2}) and one that gives way ({gives:.2}) cannot be distinguished on these rows: probe the same places with and without the force, before the part is unclamped"
        )
    })
}

/// A sentence about the effects that may act but are too small to be named, if no effect is added.
pub(super) fn faint_effects(found: &Identification) -> Option<String> {
    let of = |set: &&SetShare| format!("`{}` ({:.2})", set.kinds.join("` with `"), set.probability);
    let faint: Vec<String> = found.faint().iter().map(of).collect();
    (!faint.is_empty()).then(|| {
        format!(
            "too small to be named: {} may act; twice the rows, or readings that scatter less, would decide",
            faint.join(", or ")
        )
    })
}

/// A sentence if the extended cell is worse than the declared one on the held-out rows.
pub(super) fn worse_on_held_out(found: &Identification) -> Option<String> {
    let (before, after) = (found.before.rms_mm, found.after.rms_mm);
    (!found.extended.is_empty() && after > before).then(|| {
        format!(
            "on the rows that no fit has seen, the extended cell leaves {after:.3} mm, and the declared one {before:.3} mm: keep the declared cell, and measure again"
        )
    })
}
