//! What data over a part cannot tell apart by construction, whatever the evidence says.
//!
//! A joint's error by its angle has many names: a constant is a zero offset, a bend a curve, a wave a gear's harmonic.
//! Seen over a little of a turn they are one thing, and the evidence only says which of them is the simplest.

use super::outcome::Added;
use crate::cell::NewEffect;
use nalgebra::{DMatrix, DVector};

const CURVE: &str = "joint_error_curve";
const HARMONIC: &str = "gear_harmonic";
/// Geometry that a curve has in it: its mean and its slope.
const IN_A_CURVE: [&str; 2] = ["zero_offset", "link_geometry"];

/// Adds to each set the names that stand for the same thing there.
pub(super) fn add(added: &mut [Added], extended: &[NewEffect]) {
    let has = |kind: &str| added.iter().any(|effect| effect.kind == kind);
    let (curve, harmonic) = (has(CURVE), has(HARMONIC));
    let waves: Vec<bool> = extended.iter().map(|new| new.table.get("curves").is_some_and(is_a_wave)).collect();
    for (effect, wave) in added.iter_mut().zip(waves) {
        let kind = effect.kind.clone();
        if kind == CURVE && (harmonic || wave) {
            tie(effect, HARMONIC);
        }
        if kind == HARMONIC && curve {
            tie(effect, CURVE);
        }
        if IN_A_CURVE.contains(&kind.as_str()) && curve {
            tie(effect, CURVE);
        }
        // A curve that could stand here could be a low harmonic too.
        if kind != HARMONIC && effect.not_told_apart_from.iter().any(|other| other == CURVE) {
            tie(effect, HARMONIC);
        }
    }
}

fn tie(effect: &mut Added, other: &str) {
    /// Two names for one thing.
    const EVEN: f64 = 0.5;
    if !effect.not_told_apart_from.iter().any(|known| known == other) {
        effect.posterior = effect.posterior.min(EVEN);
        effect.not_told_apart_from.push(other.to_owned());
    }
}

/// Whether every curve of a table is as good as a constant and one harmonic.
fn is_a_wave(curves: &toml::Value) -> bool {
    let numbers = |curve: &toml::Value, key: &str| -> Vec<f64> {
        let array = curve.get(key).and_then(toml::Value::as_array).into_iter().flatten();
        array.filter_map(|v| v.as_float().or(v.as_integer().map(|i| i as f64))).collect()
    };
    let curves = curves.as_array().map_or(&[][..], Vec::as_slice);
    !curves.is_empty()
        && curves.iter().all(|curve| wave_share(&numbers(curve, "angle_deg"), &numbers(curve, "error_rad")) > ALIKE)
}

/// Share of a curve's variance from which a wave passes for it.
const ALIKE: f64 = 0.98;

/// Share of the knots' variance that a constant and the best harmonic of a gear's orders explain.
fn wave_share(angle_deg: &[f64], error_rad: &[f64]) -> f64 {
    /// Orders of gears, periods a turn.
    const ORDERS: std::ops::RangeInclusive<u32> = 8..=60;
    let n = angle_deg.len().min(error_rad.len());
    // Three numbers and an order pass through four knots.
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
        assert!(wave_share(&angles, &broken) < ALIKE);
    }
}
