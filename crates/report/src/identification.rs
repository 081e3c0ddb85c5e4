//! The summary of an identification for people, and its residuals row by row.

use deflex_effects::ParameterOwner;
use deflex_identify::{Added, FittedParameter, Identification, ResidualRow};
use deflex_text::number::{fixed, write_fixed};
use std::fmt::Write;

/// The answer in one sentence: what is wrong with the data, which effects were found in which axes, how much smaller the error is with
/// them, and whether anything else remains.
///
/// # Examples
/// ```
/// use deflex_identify::Identification;
/// use deflex_report::identify_answer;
///
/// /// Prints the answer.
/// fn show(found: &Identification) {
///     print!("{}", identify_answer(found));
/// }
/// ```
#[must_use]
pub fn identify_answer(found: &Identification) -> String {
    let mut parts = Vec::new();
    // If the table itself is doubtful, its other results mean nothing.
    let faults = || found.unexplained.correlates.iter().filter(|correlate| correlate.fault.is_some());
    if let Some(fault) = faults().next() {
        parts.push(format!("the measurement is doubtful: the rows follow {}", fault.with));
    } else if found.is_whole_arm() {
        parts.push(format!("many effects together are needed: {} are fitted at once", found.effects.len()));
    } else if found.unexplained.significant {
        let follows = found.unexplained.correlates.first().map(|first| format!("; it follows {}", first.with));
        parts.push(format!("an error remains that neither the cell nor noise explains{}", follows.unwrap_or_default()));
    }
    let sure: Vec<String> = found.added.iter().map(named).collect();
    if found.is_whole_arm() {
        let sure = if sure.is_empty() {
            "none of them is certain by itself".to_owned()
        } else {
            format!("certain are {}", sure.join(", "))
        };
        parts.push(sure);
        parts.push(format!("rms error {:.3} mm, before {:.3} mm", found.after.rms_mm, found.before.rms_mm));
    } else if found.added.is_empty() {
        let faint = found.faint();
        parts.push(match faint.first() {
            _ if found.unexplained.significant => "nothing is added to the cell".to_owned(),
            Some(set) => format!(
                "nothing certain: {} may act (probability {:.2}); the declared cell explains the rows to {:.3} mm",
                set.kinds.join(" and ").replace('_', " "),
                set.probability,
                found.after.rms_mm
            ),
            None => {
                let but = if is_down_to_noise(found) {
                    ""
                } else {
                    ", which is more than their noise: they are too few to say why"
                };
                format!("no effect found: the declared cell explains the rows to {:.3} mm{but}", found.after.rms_mm)
            }
        });
    } else {
        parts.push(sure.join(" and "));
        parts.push(format!("rms error {:.3} mm, before {:.3} mm", found.after.rms_mm, found.before.rms_mm));
        if !found.unexplained.significant {
            parts.push("nothing else found".to_owned());
        }
    }
    parts.join("; ")
}

/// Whether the cell leaves no more than noise on the held-out rows.
pub(crate) fn is_down_to_noise(found: &Identification) -> bool {
    /// Factor on the noise floor: of ten held-out rows, the rms of three normal numbers each stays within it with a probability of 98 %.
    const WITHIN: f64 = 1.3;
    found.after.rms_mm <= WITHIN * found.noise_floor_rms_mm
}

/// An effect with the axes in which it acts, and the effects from which the rows cannot distinguish it.
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
            "unlisted" => "an effect that deflex does not know".to_owned(),
            kind => kind.replace('_', " "),
        };
        let others: Vec<String> = added.not_told_apart_from.iter().map(spoken).collect();
        text += &format!(" (or {}: these rows cannot decide)", others.join(", "));
    }
    text
}

/// The axes, from 1, in which an effect acts: the 95 % interval of their number excludes the value that does nothing. `None` unless the
/// effect has exactly one number for each axis.
fn axes_of(added: &Added) -> Option<Vec<usize>> {
    let axis = |p: &FittedParameter| match p.owner {
        ParameterOwner::Axis(axis) => Some(axis),
        _ => None,
    };
    if !added.parameters.iter().map(axis).eq((1..=6).map(Some)) {
        return None;
    }
    let acts = |p: &&FittedParameter| p.ci95[0] > p.neutral || p.ci95[1] < p.neutral;
    added.parameters.iter().filter(acts).map(axis).collect()
}

/// A parameter's name in two parts: the key of the cell file, and what its index stands for: `half_gap_rad`, `, axis 2`. An index that
/// counts anything else stays in the name.
pub(super) fn named_parameter(parameter: &FittedParameter) -> (&str, String) {
    let key = parameter.name.split_once('[').map_or(&*parameter.name, |(key, _)| key);
    match parameter.owner {
        ParameterOwner::Axis(axis) => (key, format!(", axis {axis}")),
        ParameterOwner::Direction(direction) => (key, format!(", {direction}")),
        ParameterOwner::Effect => (&parameter.name, String::new()),
    }
}

/// Four significant digits; powers of ten only where a number would have more than seven digits.
pub(super) fn significant(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || !(1e-3..1e7).contains(&size) {
        return if value == 0.0 { "0".to_owned() } else { format!("{value:.3e}") };
    }
    let decimals = (3.0 - size.log10().floor()).max(0.0) as usize;
    fixed(value, decimals)
}

/// The summary: the answer in one sentence, the errors before and after, the effects that were added, those that the rows cannot
/// distinguish, what remains unexplained, and what to measure next.
///
/// # Examples
/// ```
/// use deflex_identify::Identification;
/// use deflex_report::identify_text;
///
/// /// Prints the answer.
/// fn show(found: &Identification) {
///     print!("{}", identify_text(found));
/// }
/// ```
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
    let _ = writeln!(
        out,
        "  rms of the extended cell: 95 % interval [{low:.4}, {high:.4}] mm (bootstrap over blocks of rows)"
    );
    out.push_str("  no fit has seen the held-out rows; the numbers in the extended cell are then fitted to all rows\n");

    for line in [elsewhere(found)].into_iter().chain(nearby(found)) {
        let _ = writeln!(out, "  {line}");
    }
    if let Some(rms_mm) = found.run_drift_rms_mm {
        let _ = writeln!(
            out,
            "  both errors are without the drift of the run, {rms_mm:.4} mm rms, which is estimated from neighbouring rows and is not part of the cell"
        );
    }
    if found.is_whole_arm() {
        out.push_str("\neffects of the extended cell        probability   its part (mm rms)\n");
        let mut effects: Vec<_> = found.effects.iter().collect();
        effects.sort_by(|a, b| b.share_rms_mm.total_cmp(&a.share_rms_mm));
        for effect in effects {
            let _ = writeln!(out, "  {:32} {:11.3} {:15.4}", effect.kind, effect.probability, effect.share_rms_mm);
        }
    }
    if found.added.is_empty() && found.is_whole_arm() {
        out.push_str("\nNone of them is certain by itself.\n");
    } else if found.added.is_empty() {
        out.push_str(match found.unexplained.significant {
            true => "\nNothing is added to the cell.\n",
            false if !found.faint().is_empty() => {
                "\nNothing is added: the effects that may act are too small in these rows to be named.\n"
            }
            false if !is_down_to_noise(found) => {
                "\nNothing is added: the rows are too few to say why the declared cell does not explain them.\n"
            }
            false => "\nNothing is added: the declared cell explains the data down to the noise.\n",
        });
    } else {
        out.push_str("\nadded\n");
    }
    for added in &found.added {
        let _ = writeln!(
            out,
            "  {}: probability {:.3}; held-out rms {:.4} mm without it, {:.4} mm with it",
            added.kind, added.posterior, added.held_out_rms_before_mm, added.held_out_rms_after_mm
        );
        write_parameters(&mut out, &added.parameters);
        if !added.not_told_apart_from.is_empty() {
            let _ = writeln!(out, "    cannot be distinguished from: {}", added.not_told_apart_from.join(", "));
        }
    }
    const SETS: usize = 5; // the whole list is in the JSON
    if found.sets.len() > 1 {
        out.push_str("\nprobability of each set of effects, after these rows\n");
    }
    for set in found.sets.iter().take(if found.sets.len() > 1 { SETS } else { 0 }) {
        let kinds = if set.kinds.is_empty() { "nothing".to_owned() } else { set.kinds.join(" + ") };
        let _ = writeln!(out, "  {:.3}  {kinds}", set.probability);
    }
    const RANKED: usize = 8; // the whole list is in the JSON
    if !found.ranking.is_empty() {
        out.push_str("\neach effect alone            held-out rms (mm)   delta BIC (less is better)\n");
    }
    for ranked in found.ranking.iter().take(RANKED) {
        let _ = writeln!(out, "  {:26} {:14.4} {:14.1}", ranked.kind, ranked.held_out_rms_mm, ranked.delta_bic);
    }
    const PAIRS: usize = 6; // the whole list is in the JSON
    let close: Vec<_> = found.separability.iter().filter(|pair| pair.d_prime < 5.0).take(PAIRS).collect();
    if !close.is_empty() {
        out.push_str(
            "\nhard to distinguish on these rows                  d′ (effects of 0.03 mm; from 5 on they can be distinguished)\n",
        );
    }
    for pair in close {
        let _ = writeln!(out, "  {:46} {:4.1}", format!("{} from {}", pair.of, pair.from), pair.d_prime);
    }
    if found.coverage.rows_outside > 0 {
        let _ = writeln!(
            out,
            "\n{} held-out rows lie outside the range of the fitted curves (axes {:?}): the extended cell is not judged there.",
            found.coverage.rows_outside, found.coverage.joints_outside
        );
    }
    if found.unexplained.significant {
        out.push_str("\nUnexplained: more remains than noise, and no known effect explains it.\n");
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

/// How well the extended cell predicts places, postures and loads that were not measured.
pub(super) fn elsewhere(found: &Identification) -> String {
    format!("at places, postures and loads left out of the fit: {:.4} mm rms", found.after_other_places.rms_mm)
}

/// How well the extended cell predicts the same program next to its place, if that was estimated.
pub(super) fn nearby(found: &Identification) -> Option<String> {
    let sigma_mm = found.transfer_sigma_mm;
    let text =
        || format!("for this program next to its place, also turned: standard uncertainty {sigma_mm:.4} mm per axis");
    (sigma_mm > 0.0).then(text)
}

/// Each parameter with its interval. Curves have hundreds of knots, so only their number and largest value are printed.
fn write_parameters(out: &mut String, parameters: &[FittedParameter]) {
    const MOST_PRINTED: usize = 36; // of the effects that are no curves, `link_geometry` has most
    if parameters.len() <= MOST_PRINTED {
        for p in parameters {
            let [low, high] = p.ci95;
            let ((key, of), value) = (named_parameter(p), significant(p.value));
            let _ = writeln!(
                out,
                "    {:26} {value:>10} {}  [{}, {}]",
                key.to_owned() + &of,
                p.unit,
                significant(low),
                significant(high)
            );
        }
        return;
    }
    let family = |p: &FittedParameter| p.name.rsplit_once('[').map_or(p.name.len(), |(family, _)| family.len());
    for knots in parameters.chunk_by(|a, b| a.name[..family(a)] == b.name[..family(b)]) {
        let (name, values) = (&knots[0].name[..family(&knots[0])], || knots.iter().map(|p| p.value));
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let count = knots.len();
        let (low, high) = (significant(low), significant(high));
        let _ = writeln!(out, "    {name:26} {count} values from {low} to {high} {}", knots[0].unit);
    }
}

/// Residuals as CSV, one line for each measured row.
///
/// # Examples
/// ```
/// assert!(deflex_report::residual_csv(&[]).starts_with("run,line,")); // the header
/// ```
#[must_use]
pub fn residual_csv(rows: &[ResidualRow]) -> String {
    let mut out = b"run,line,block,held_out,outlier,x_mm,y_mm,z_mm,prefit_x_mm,prefit_y_mm,prefit_z_mm,postfit_x_mm,postfit_y_mm,postfit_z_mm,whitened_x,whitened_y,whitened_z,target\n".to_vec();
    for row in rows {
        let head = [row.run as u64, row.line, row.block as u64, u64::from(row.held_out), u64::from(row.outlier)];
        out.extend_from_slice(head.map(|value| value.to_string()).join(",").as_bytes());
        for (values, decimals) in [(row.place_mm, 4), (row.prefit_mm, 6), (row.postfit_mm, 6), (row.whitened, 4)] {
            for value in values {
                out.push(b',');
                // The field is empty if the row does not measure this component.
                if value.is_finite() {
                    write_fixed(&mut out, value, decimals);
                }
            }
        }
        // 0 for rows between targets.
        out.extend_from_slice(format!(",{}\n", row.target.unwrap_or(0)).as_bytes());
    }
    String::from_utf8(out).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An angle in rad that is known to within an angle.
    fn angle(name: String, value: f64, within: f64) -> FittedParameter {
        let (ci95, owner) = ([value - within, value + within], ParameterOwner::Effect);
        FittedParameter { name, value, unit: "rad", ci95, neutral: 0.0, owner }
    }

    #[test]
    fn an_effect_is_named_with_the_axes_in_which_it_acts() {
        let gap = |(i, value): (usize, f64)| {
            let owner = ParameterOwner::Axis(i + 1);
            FittedParameter { owner, ..angle(format!("half_gap_rad[{i}]"), value, 1e-5) }
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
        assert_eq!(named(&backlash), "backlash (or zero offset: these rows cannot decide)");
    }

    #[test]
    fn an_index_is_named_by_what_it_counts() {
        let named = |kind: &str, rest: &str| -> Vec<String> {
            let effect = toml::from_str(rest).map(|table| (deflex_effects::kind(kind).unwrap().read)(table)).unwrap();
            let of = |p: deflex_effects::Parameter| {
                let (name, value, owner) = (p.name, p.value, p.owner);
                let fitted = FittedParameter { name, value, unit: p.unit, ci95: [value; 2], neutral: p.neutral, owner };
                let (key, of) = named_parameter(&fitted);
                key.to_owned() + &of
            };
            effect.unwrap().parameters().into_iter().map(of).collect()
        };
        assert_eq!(named("backlash", "half_gap_rad = [0, 0, 0, 0, 0, 0]")[1], "half_gap_rad, axis 2");
        assert_eq!(named("tool_frame", "d_mm = [0, 0, 0]\nd_rad = [0, 0, 0]")[5], "d_rad, z");
        // Six coefficients of a polynomial over the part are not six axes.
        assert_eq!(named("workpiece_compliance", "mm_per_n = [0, 0, 0, 0, 0, 0]")[1], "mm_per_n[1]");
    }

    #[test]
    fn knots_of_curves_are_counted_and_other_parameters_shown() {
        let parameter = |name: String, value| angle(name, value, 1.0);
        let few: Vec<_> = (0..6).map(|i| parameter(format!("half_gap_rad[{i}]"), f64::from(i))).collect();
        let mut out = String::new();
        write_parameters(&mut out, &few);
        assert_eq!(out.lines().count(), 6);
        assert!(out.contains("half_gap_rad[5]                 5.000 rad  [4.000, 6.000]"), "{out}");
        let knots = (0..80).map(|i| parameter(format!("curves[{}].error_rad[{}]", i / 40, i % 40), f64::from(i)));
        let mut out = String::new();
        write_parameters(&mut out, &knots.collect::<Vec<_>>());
        assert_eq!(
            out,
            "    curves[0].error_rad        40 values from 0 to 39.00 rad\n    \
             curves[1].error_rad        40 values from 40.00 to 79.00 rad\n"
        );
    }
}
