//! Effects that the rows of a part cannot distinguish, whatever their evidence is.
//!
//! The error of a joint as a function of its angle has several names: a zero offset is constant, a curve bends, and a
//! gear's harmonic is a wave. Over a small part of a turn they are alike, and the evidence only prefers the simplest.

use super::decisions::{EVEN, IS_A_WAVE};
use super::outcome::Added;
use super::pattern::Pattern;
use deflex_cell::NewEffect;
use deflex_effects::{KINDS, Kind, Part, Shape, kind};
use nalgebra::{DMatrix, DVector};

/// Adds to each effect the names of effects and faults that describe the same error. `never_returns` says that time is
/// a function of place in every run.
pub(super) fn add(added: &mut [Added], extended: &[NewEffect], never_returns: bool) {
    let there: Vec<&Kind> = added.iter().filter_map(|effect| kind(&effect.kind)).collect();
    let of = |shape: Shape| KINDS.iter().filter(move |kind| kind.shape == shape);
    let waves: Vec<bool> = extended.iter().map(|new| new.table.get("curves").is_some_and(is_a_wave)).collect();
    let constant = |new: &NewEffect, law: &Kind| law.time_constant.is_some_and(|name| new.table.contains_key(name));
    for ((effect, new), wave) in added.iter_mut().zip(extended).zip(waves) {
        let Some(law) = kind(&effect.kind) else { continue };
        if never_returns && constant(new, law) {
            tie(effect, Pattern::Drift { settles: None }.name());
        }
        for like in there.iter().filter(|other| law.locally_like.contains(&other.name)) {
            tie(effect, like.name);
        }
        // If a law of the springs is added, an effect that is a special case of another law cannot be distinguished
        // from that law.
        let has_spring = there.iter().any(|other| other.part == Part::JointSpring);
        let whole = |whole: &&&str| kind(whole).is_some_and(|whole| whole.part == Part::JointSpring);
        if has_spring {
            law.nested_in.iter().filter(whole).for_each(|whole| tie(effect, whole));
        }
        let harmonic_there = there.iter().any(|other| other.shape == Shape::Periodic);
        let is_curve = law.shape == Shape::Curve && (wave || harmonic_there);
        // A curve that could replace the effect could also be a harmonic of low order.
        let could_be = |other: &String| kind(other).is_some_and(|other| other.shape == Shape::Curve);
        let maybe_curve = law.shape != Shape::Periodic && effect.not_told_apart_from.iter().any(could_be);
        if is_curve || maybe_curve {
            of(Shape::Periodic).for_each(|harmonic| tie(effect, harmonic.name));
        }
    }
}

/// Adds a rival to an effect, whose probability is then at most [`EVEN`].
fn tie(effect: &mut Added, other: &str) {
    if !effect.not_told_apart_from.iter().any(|known| known == other) {
        effect.posterior = effect.posterior.min(EVEN);
        effect.not_told_apart_from.push(other.to_owned());
    }
}

/// Whether a constant and one harmonic explain almost all of the variance of every curve of a table.
fn is_a_wave(curves: &toml::Value) -> bool {
    let numbers = |curve: &toml::Value, key: &str| -> Vec<f64> {
        let array = curve.get(key).and_then(toml::Value::as_array).into_iter().flatten();
        array.filter_map(|v| v.as_float().or(v.as_integer().map(|i| i as f64))).collect()
    };
    let curves = curves.as_array().map_or(&[][..], Vec::as_slice);
    !curves.is_empty()
        && curves.iter().all(|curve| wave_share(&numbers(curve, "angle_deg"), &numbers(curve, "error_rad")) > IS_A_WAVE)
}

/// Share of the variance of the knots that a constant and the best harmonic explain.
fn wave_share(angle_deg: &[f64], error_rad: &[f64]) -> f64 {
    /// Orders of the harmonics of gears that are tried, periods for each turn.
    const ORDERS: std::ops::RangeInclusive<u32> = 8..=60;
    let n = angle_deg.len().min(error_rad.len());
    // A constant, an amplitude, a phase and an order can pass through any four knots.
    if n <= 4 {
        return 1.0;
    }
    let errors = DVector::from_column_slice(&error_rad[..n]);
    let about_mean = errors.add_scalar(-errors.mean()).norm_squared();
    let left = |order: u32| {
        let design = DMatrix::from_fn(n, 3, |i, k| {
            let (sin, cos) = (f64::from(order) * angle_deg[i].to_radians()).sin_cos();
            [1.0, cos, sin][k]
        });
        let normal = design.tr_mul(&design) + DMatrix::identity(3, 3) * 1e-9;
        let Some(factor) = normal.cholesky() else { return about_mean };
        (&errors - &design * factor.solve(&design.tr_mul(&errors))).norm_squared()
    };
    1.0 - ORDERS.map(left).fold(about_mean, f64::min) / about_mean.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sampled_harmonic_is_a_wave_and_a_broken_line_is_not() {
        let angles: Vec<f64> = (0..12).map(|i| f64::from(i) * 4.0).collect();
        let wave: Vec<f64> = angles.iter().map(|a| 1e-4 * (21.0 * a.to_radians() + 0.3).sin() + 2e-5).collect();
        assert!(wave_share(&angles, &wave) > 0.999);
        let broken: Vec<f64> =
            [3.0, 1.0, -4.0, 2.0, 2.0, 5.0, -3.0, -1.0, 0.0, 4.0, -5.0, 1.0].map(|v| v * 1e-5).into();
        assert!(wave_share(&angles, &broken) < IS_A_WAVE);
    }
}
