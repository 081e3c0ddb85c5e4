//! What an identification came to, for people, and its residuals row by row.

use crate::identify::{Added, FittedParameter, Identification, ResidualRow};
use crate::text::number::write_fixed;
use std::fmt::Write;

/// The answer in one sentence: what is wrong with the data, what was found where, what it changes, what else shows.
#[must_use]
pub fn identify_answer(found: &Identification) -> String {
    let mut parts = Vec::new();
    // A doubtful table is said before anything else.
    let faults = || found.unexplained.correlates.iter().filter(|correlate| correlate.fault.is_some());
    if let Some(fault) = faults().next() {
        parts.push(format!("the measurement is doubtful: the rows follow {}", fault.with));
    } else if found.is_whole_arm() {
        parts.push(format!("everything is a little off: {} effects are fitted together", found.effects.len()));
    } else if found.unexplained.significant {
        let follows = found.unexplained.correlates.first().map(|first| format!("; it follows {}", first.with));
        parts.push(format!("more shows than this cell and noise explain{}", follows.unwrap_or_default()));
    }
    let sure: Vec<String> = found.added.iter().map(named).collect();
    if found.is_whole_arm() {
        let sure = if sure.is_empty() {
            "none of them is sure by itself".to_owned()
        } else {
            format!("sure are {}", sure.join(", "))
        };
        parts.push(sure);
        parts.push(format!("rms error {:.3} mm, before {:.3} mm", found.after.rms_mm, found.before.rms_mm));
    } else if found.added.is_empty() {
        let faint = found.faint();
        parts.push(match faint.first() {
            _ if found.unexplained.significant => "nothing is added to the cell".to_owned(),
            Some(set) => format!(
                "nothing shows for sure: {} may act ({:.2}); the declared cell explains the rows to {:.3} mm",
                set.kinds.join(" and ").replace('_', " "),
                set.probability,
                found.after.rms_mm
            ),
            None => format!("nothing shows: the declared cell explains the rows to {:.3} mm", found.after.rms_mm),
        });
    } else {
        parts.push(sure.join(" and "));
        parts.push(format!("rms error {:.3} mm, before {:.3} mm", found.after.rms_mm, found.before.rms_mm));
        if !found.unexplained.significant {
            parts.push("nothing else shows".to_owned());
        }
    }
    parts.join("; ")
}

/// An effect with the axes that it is in, and what it may be instead.
fn named(added: &Added) -> String {
    let mut text = match &added.kind[..] {
        "empirical" => "a map of what no effect explains".to_owned(),
        kind => kind.replace('_', " "),
    };
    if let Some(axes) = axes_of(added) {
        text += &match &axes[..] {
            [axis] => format!(" in axis {axis}"),
            [others @ .., last] => {
                let others: Vec<String> = others.iter().map(ToString::to_string).collect();
                format!(" in axes {} and {last}", others.join(", "))
            }
            [] => String::new(),
        };
    }
    if !added.not_told_apart_from.is_empty() {
        let spoken = |kind: &String| match &kind[..] {
            "unlisted" => "something in no list".to_owned(),
            kind => kind.replace('_', " "),
        };
        let others: Vec<String> = added.not_told_apart_from.iter().map(spoken).collect();
        text += &format!(" (or {}: these rows do not tell)", others.join(", "));
    }
    text
}

/// The axes, from 1, whose numbers are not what does nothing; `None` where numbers are not one list over the axes.
fn axes_of(added: &Added) -> Option<Vec<usize>> {
    let index = |p: &FittedParameter| p.name.split_once('[')?.1.strip_suffix(']')?.parse::<usize>().ok();
    let (first, _) = added.parameters.first()?.name.split_once('[')?;
    let same = added.parameters.iter().all(|p| p.name.split_once('[').is_some_and(|(name, _)| name == first));
    if added.parameters.len() != 6 || !same {
        return None;
    }
    let outside = |p: &&FittedParameter| p.ci95[0] > p.neutral || p.ci95[1] < p.neutral;
    added.parameters.iter().filter(outside).map(|p| index(p).map(|index| index + 1)).collect()
}

/// The summary: the answer, error before and after, what was added, what could not be distinguished, what is left, what to do
/// next.
#[must_use]
pub fn identify_text(found: &Identification) -> String {
    let mut out = identify_answer(found);
    out.push_str("\n\n");
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{} rows, {} of them held out; noise {:.4} mm per axis, floor {:.4} mm (3-D rms)",
        found.rows, found.held_out_rows, found.noise_mm, found.noise_floor_rms_mm
    );
    let _ = writeln!(out, "\nerror on held-out rows      rms       mean      max  (mm)");
    for (name, errors) in [("declared cell", &found.before), ("extended cell", &found.after)] {
        let _ = writeln!(out, "  {name:18} {:9.4} {:9.4} {:9.4}", errors.rms_mm, errors.mean_mm, errors.max_mm);
    }
    let [low, high] = found.after_rms_ci95_mm;
    let _ = writeln!(out, "  extended cell's rms lies in [{low:.4}, {high:.4}] mm (95 %, bootstrap over blocks)");
    out.push_str(
        "  both are of rows that no fit has seen; the numbers written are then fitted to all rows of a part\n",
    );

    let _ = writeln!(out, "  {}", elsewhere(found));
    if let Some(rms_mm) = found.run_drift_rms_mm {
        let _ = writeln!(
            out,
            "  the run drifts by {rms_mm:.4} mm rms, as the fitted rows about each tell: taken off both, for it is in no cell"
        );
    }
    if found.is_whole_arm() {
        out.push_str("\nevery effect of the written cell   probability   its part (mm rms)\n");
        let mut effects: Vec<_> = found.effects.iter().collect();
        effects.sort_by(|a, b| b.share_rms_mm.total_cmp(&a.share_rms_mm));
        for effect in effects {
            let _ = writeln!(out, "  {:32} {:11.3} {:15.4}", effect.kind, effect.probability, effect.share_rms_mm);
        }
    }
    if found.added.is_empty() && found.is_whole_arm() {
        out.push_str("\nNone of them is sure by itself.\n");
    } else if found.added.is_empty() {
        out.push_str(match found.unexplained.significant {
            true => "\nNothing is added to the cell.\n",
            false if !found.faint().is_empty() => {
                "\nNothing is added: what may act is too faint on these rows to be named.\n"
            }
            false => "\nNothing is added: the declared cell explains the data to the noise.\n",
        });
    } else {
        out.push_str("\nadded\n");
    }
    for added in &found.added {
        let _ = writeln!(
            out,
            "  {}: posterior {:.3}; held-out rms {:.4} mm before it, {:.4} mm with it",
            added.kind, added.posterior, added.held_out_rms_before_mm, added.held_out_rms_after_mm
        );
        write_parameters(&mut out, &added.parameters);
        if !added.not_told_apart_from.is_empty() {
            let _ = writeln!(out, "    cannot be distinguished from: {}", added.not_told_apart_from.join(", "));
        }
    }
    const SETS: usize = 5; // the whole list is in the JSON
    if found.sets.len() > 1 {
        out.push_str("\nwhat the rows leave open (posterior over sets)\n");
    }
    for set in found.sets.iter().take(if found.sets.len() > 1 { SETS } else { 0 }) {
        let kinds = if set.kinds.is_empty() { "nothing".to_owned() } else { set.kinds.join(" + ") };
        let _ = writeln!(out, "  {:.3}  {kinds}", set.probability);
    }
    const RANKED: usize = 8; // the whole list is in the JSON
    if !found.ranking.is_empty() {
        out.push_str("\nranking, each alone          held-out rms (mm)   delta BIC\n");
    }
    for ranked in found.ranking.iter().take(RANKED) {
        let _ = writeln!(out, "  {:26} {:14.4} {:14.1}", ranked.kind, ranked.held_out_rms_mm, ranked.delta_bic);
    }
    const PAIRS: usize = 6; // the whole list is in the JSON
    let close: Vec<_> = found.separability.iter().filter(|pair| pair.d_prime < 5.0).take(PAIRS).collect();
    if !close.is_empty() {
        out.push_str("\nhard to distinguish on these rows (d′ at 0.03 mm; from 5 on they can be distinguished)\n");
    }
    for pair in close {
        let _ = writeln!(out, "  {:26} taken for {:26} {:5.1}", pair.of, pair.from, pair.d_prime);
    }
    if found.coverage.rows_outside > 0 {
        let _ = writeln!(
            out,
            "\n{} held-out rows lie outside what the curves were fitted on (joints {:?}): no gain is claimed there.",
            found.coverage.rows_outside, found.coverage.joints_outside
        );
    }
    if found.unexplained.significant {
        out.push_str("\nUnexplained: more is left than noise, and no named effect explains it.\n");
        for correlate in &found.unexplained.correlates {
            let _ = writeln!(out, "  follows {} (r = {:.2})", correlate.with, correlate.r);
            for FittedParameter { name, value, unit, ci95: [low, high], .. } in &correlate.parameters {
                let _ = writeln!(out, "    {name:<28}  {value:.4} {unit}  [{low:.4}, {high:.4}]");
            }
        }
    }
    if !found.outliers.is_empty() {
        let lines: Vec<String> = found.outliers.iter().map(ToString::to_string).collect();
        let _ = writeln!(out, "\nleft out as outliers: lines {}", lines.join(", "));
    }
    for advice in &found.advice {
        let _ = writeln!(out, "\nadvice: {advice}");
    }
    out
}

/// What the rows say of places, postures and loads where nothing was measured.
pub(super) fn elsewhere(found: &Identification) -> String {
    let left_out = format!("left out by place, posture and load: {:.4} mm rms", found.after_other_places.rms_mm);
    match found.transfer_sigma_mm {
        sigma_mm if sigma_mm > 0.0 => {
            format!("{left_out}; the same program next to this place may be off by {sigma_mm:.4} mm per axis")
        }
        _ => left_out,
    }
}

/// Each parameter with its interval; of a curve's knots only how many and how large, since they are hundreds.
fn write_parameters(out: &mut String, parameters: &[FittedParameter]) {
    const MOST_PRINTED: usize = 36; // of the effects that are no curves, `link_geometry` has most
    if parameters.len() <= MOST_PRINTED {
        for p in parameters {
            let [low, high] = p.ci95;
            let _ = writeln!(out, "    {:26} {:12.4e} {}  [{low:.4e}, {high:.4e}]", p.name, p.value, p.unit);
        }
        return;
    }
    let family = |p: &FittedParameter| p.name.rsplit_once('[').map_or(p.name.len(), |(family, _)| family.len());
    for knots in parameters.chunk_by(|a, b| a.name[..family(a)] == b.name[..family(b)]) {
        let (name, values) = (&knots[0].name[..family(&knots[0])], || knots.iter().map(|p| p.value));
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let count = knots.len();
        let _ = writeln!(out, "    {name:26} {count} values from {low:.4e} to {high:.4e} {}", knots[0].unit);
    }
}

/// Residuals as CSV, one row a measured row.
#[must_use]
pub fn residual_csv(rows: &[ResidualRow]) -> String {
    let mut out = b"run,line,block,held_out,outlier,x_mm,y_mm,z_mm,prefit_x_mm,prefit_y_mm,prefit_z_mm,postfit_x_mm,postfit_y_mm,postfit_z_mm,whitened_x,whitened_y,whitened_z,target\n".to_vec();
    for row in rows {
        let head = [row.run as u64, row.line, row.block as u64, u64::from(row.held_out), u64::from(row.outlier)];
        out.extend_from_slice(head.map(|value| value.to_string()).join(",").as_bytes());
        for (values, decimals) in [(row.place_mm, 4), (row.prefit_mm, 6), (row.postfit_mm, 6), (row.whitened, 4)] {
            for value in values {
                out.push(b',');
                // Rows without a component have none here.
                if value.is_finite() {
                    write_fixed(&mut out, value, decimals);
                }
            }
        }
        // Between targets there is none.
        out.extend_from_slice(format!(",{}\n", row.target.unwrap_or(0)).as_bytes());
    }
    String::from_utf8(out).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_told_with_the_axes_that_it_is_in() {
        let gap = |(i, value): (usize, f64)| FittedParameter {
            name: format!("half_gap_rad[{i}]"),
            value,
            unit: "rad",
            ci95: [value - 1e-5, value + 1e-5],
            neutral: 0.0,
        };
        let mut backlash = Added {
            kind: "backlash".to_owned(),
            posterior: 1.0,
            held_out_rms_before_mm: 0.1,
            held_out_rms_after_mm: 0.02,
            parameters: [0.0, 6e-5, 0.0, 0.0, 1e-4, 5e-6].into_iter().enumerate().map(gap).collect(),
            not_told_apart_from: Vec::new(),
        };
        assert_eq!(named(&backlash), "backlash in axes 2 and 5");
        backlash.not_told_apart_from.push("zero_offset".to_owned());
        backlash.parameters.truncate(5);
        assert_eq!(named(&backlash), "backlash (or zero offset: these rows do not tell)");
    }

    #[test]
    fn knots_of_curves_are_counted_and_other_parameters_shown() {
        let parameter = |name: String, value| FittedParameter {
            name,
            value,
            unit: "rad",
            ci95: [value - 1.0, value + 1.0],
            neutral: 0.0,
        };
        let few: Vec<_> = (0..6).map(|i| parameter(format!("half_gap_rad[{i}]"), f64::from(i))).collect();
        let mut out = String::new();
        write_parameters(&mut out, &few);
        assert_eq!(out.lines().count(), 6);
        assert!(out.contains("half_gap_rad[5]                5.0000e0 rad  [4.0000e0, 6.0000e0]"), "{out}");
        let knots = (0..80).map(|i| parameter(format!("curves[{}].error_rad[{}]", i / 40, i % 40), f64::from(i)));
        let mut out = String::new();
        write_parameters(&mut out, &knots.collect::<Vec<_>>());
        assert_eq!(
            out,
            "    curves[0].error_rad        40 values from 0.0000e0 to 3.9000e1 rad\n    \
             curves[1].error_rad        40 values from 4.0000e1 to 7.9000e1 rad\n"
        );
    }
}
