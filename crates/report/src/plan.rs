//! The summary of a measurement plan for people.

use deflex_identify::Plan;
use std::fmt::Write;

/// Pairs of effects that are listed at most.
const LISTED: usize = 8;
/// d′ from which on two effects can be distinguished.
const APART: f64 = 5.0;

/// The summary: how much work the measurement is, how often `identify` will name the right effect, and which pairs of effects the rows
/// cannot distinguish, with the reason.
///
/// # Examples
/// ```
/// use deflex_identify::Plan;
/// use deflex_report::plan_text;
///
/// /// Prints the answer.
/// fn show(found: &Plan) {
///     print!("{}", plan_text(found));
/// }
/// ```
#[must_use]
pub fn plan_text(plan: &Plan) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{} rows, {} changes of the load, about {:.0} minutes\n\
         in {} simulated measurements `identify` names the right effect in {:.0} %, a wrong one in {:.0} %\n",
        plan.rows.len(),
        plan.load_changes,
        (plan.duration_s / 60.0).ceil(),
        plan.simulated,
        100.0 * plan.chance_right,
        100.0 * plan.chance_wrong,
    );
    let _ = writeln!(out, "effect                    d′ from noise   named rightly");
    for kind in &plan.kinds {
        let _ = writeln!(out, "  {:24} {:12.1} {:13.0} %", kind.kind, kind.d_prime, 100.0 * kind.chance_right);
    }
    let hard: Vec<_> = plan.pairs.iter().filter(|pair| pair.d_prime < APART).collect();
    if hard.is_empty() {
        let _ = writeln!(out, "\nevery pair of effects can be distinguished (d′ of {APART:.0} and more)");
    } else {
        let _ = writeln!(out, "\nhard to distinguish on these rows (d′ below {APART:.0}):");
        for pair in hard.iter().take(LISTED) {
            let why = pair.why.unwrap_or_default();
            let _ = writeln!(out, "  {} from {}: d′ {:.1}; {why}", pair.a, pair.b, pair.d_prime);
        }
        if hard.len() > LISTED {
            let _ = writeln!(out, "  and {} pairs more (--json, --html)", hard.len() - LISTED);
        }
    }
    for note in &plan.notes {
        let _ = writeln!(out, "\nnote: {note}");
    }
    out
}
