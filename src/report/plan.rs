//! What a plan came to, for people.

use crate::identify::Plan;
use std::fmt::Write;

/// Pairs of effects that are listed at most.
const LISTED: usize = 8;
/// d′ from which on two effects can be distinguished.
const APART: f64 = 5.0;

/// The summary: how often effects will be named, which pairs stay hard and why, what the rows ask of the shop.
#[must_use]
pub fn plan_text(plan: &Plan) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{} rows, {} changes of the load, about {:.0} minutes; chance that an effect is named outright {:.0} %, wrongly {:.0} % ({} simulated)\n",
        plan.rows.len(),
        plan.load_changes,
        (plan.duration_s / 60.0).ceil(),
        100.0 * plan.chance_right,
        100.0 * plan.chance_wrong,
        plan.simulated
    );
    let _ = writeln!(out, "effect                     d′ from none   named rightly");
    for kind in &plan.kinds {
        let _ = writeln!(out, "  {:24} {:12.1} {:13.0} %", kind.kind, kind.d_prime, 100.0 * kind.chance_right);
    }
    let hard: Vec<_> = plan.pairs.iter().filter(|pair| pair.d_prime < APART).collect();
    if hard.is_empty() {
        let _ = writeln!(out, "\nevery pair of effects can be distinguished (d′ of {APART:.0} and more)");
    } else {
        let _ = writeln!(out, "\nhard to tell apart on these rows (d′ below {APART:.0}):");
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
