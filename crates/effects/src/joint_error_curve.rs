//! The error of a single joint as a smooth curve over its angle, for errors that a few harmonics do not describe.
//!
//! The curve is valid only between its first and last knot. Beyond them it fades to zero, so that the correction does not jump, and
//! [`Effect::unseen`] says how large the error may be there.

use super::spline::{Place, Spline};
use super::{ANY, Covered, Effect, Kind, Number, Offset, Physics, Site, Survey, checked, indexed};
use deflex_lanes::Real;
use deflex_robot::Joints;
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "joint_error_curve",
    summary: "a joint's own error, a smooth curve of its angle",
    forms: &[
        "curves = [{ joint = 2, angle_deg = [0, 10, 20, 30, 40], error_rad = [0, 0, 0, 0, 0] }, { joint = 6, angle_deg = [-70, -50], error_rad = [0, 0] }]",
    ],
    part: super::Part::EachJoint,
    shape: super::Shape::Curve,
    covered_by: Some(Covered::Geometry),
    follows_command: true,
    read: |table| checked(JointErrorCurve::try_from(table.try_into::<Keys>()?).map_err(toml::de::Error::custom)?),
    candidates,
    ..Kind::PLAIN
};

/// Knot spacings among which a fit chooses, degrees. Finer curves would follow the waves of a gear; coarser ones need fewer data.
const SPACINGS_DEG: [f64; 4] = [2.5, 4.0, 8.0, 20.0];

/// No curve is fitted to a joint that moved less than this, degrees.
const LEAST_RANGE_DEG: f64 = 4.0;

/// Actual = commanded + curve(commanded), by natural cubic splines through the knots.
#[derive(Clone, Debug, Serialize)]
#[serde(into = "Keys")]
pub(super) struct JointErrorCurve {
    /// Joint (0 to 5) and error (rad) over commanded motor angle (degrees, as in the cell file).
    curves: Vec<(usize, Spline)>,
}

/// The curve as a linear function of its values at the knots.
///
/// # Examples
/// ```
/// use deflex_effects::kind;
///
/// let curves = kind("joint_error_curve").expect("a kind of effect");
/// let effect = (curves.read)(curves.forms[0].parse()?)?;
/// if let Some(curve) = effect.joint_curve() {
///     println!("the curve of joint {}", curve.joint + 1);
/// }
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Debug)]
pub struct JointCurve {
    /// Index of the joint, 0 to 5.
    pub joint: usize,
    knots_deg: Vec<f64>,
    /// Derivatives of the second derivative at each knot with respect to the value at each knot, stored knot by knot.
    bends: Vec<Vec<f64>>,
}

impl JointCurve {
    /// Commanded motor angles of the knots, degrees.
    #[must_use]
    #[doc(hidden)]
    pub fn knots_deg(&self) -> &[f64] {
        &self.knots_deg
    }

    /// The weight of each knot's value at a commanded motor angle (degrees). Within the range of the curve they add up to 1.
    #[doc(hidden)]
    pub fn weights(&self, angle_deg: f64, out: &mut [f64]) {
        let Place { i, values, bends } = Place::of(&self.knots_deg, angle_deg);
        for (out, (low, high)) in out.iter_mut().zip(self.bends[i].iter().zip(&self.bends[i + 1])) {
            *out = bends[0] * low + bends[1] * high;
        }
        out[i] += values[0];
        out[i + 1] += values[1];
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    curves: Vec<Curve>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Curve {
    /// The joint, 1 to 6.
    joint: usize,
    angle_deg: Vec<f64>,
    error_rad: Vec<f64>,
}

impl TryFrom<Keys> for JointErrorCurve {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let curve = |(i, Curve { joint, angle_deg, error_rad }): (usize, Curve)| {
            let (knots, values) = (angle_deg.len(), error_rad.len());
            if !(1..=6).contains(&joint) {
                return Err(format!("`curves[{i}].joint` is {joint}, expected 1 to 6"));
            }
            if knots < 2 || knots != values {
                return Err(format!(
                    "`curves[{i}]` has {knots} `angle_deg` and {values} `error_rad`, expected as many of both, at least 2"
                ));
            }
            if !angle_deg.iter().all(|angle| angle.is_finite()) || !angle_deg.is_sorted_by(|a, b| a < b) {
                return Err(format!("`curves[{i}].angle_deg` must be finite and rise from each to the next"));
            }
            Ok((joint - 1, Spline::new(angle_deg, error_rad)))
        };
        Ok(Self { curves: keys.curves.into_iter().enumerate().map(curve).collect::<Result<_, _>>()? })
    }
}

impl From<JointErrorCurve> for Keys {
    fn from(effect: JointErrorCurve) -> Self {
        let curve = |(joint, curve): &(usize, Spline)| Curve {
            joint: joint + 1,
            angle_deg: curve.knots().to_vec(),
            error_rad: curve.values().to_vec(),
        };
        Self { curves: effect.curves.iter().map(curve).collect() }
    }
}

/// A curve of zeros for a joint (1 to 6) over a range (degrees), with knots about `spacing_deg` apart, from which a fit starts.
#[must_use]
#[doc(hidden)]
pub fn joint_error_curve(joint: usize, from_deg: f64, to_deg: f64, spacing_deg: f64) -> Box<dyn Effect> {
    // At least three: a curve through two knots would be a scale error of the joint, which gears do not have.
    let steps = ((to_deg - from_deg) / spacing_deg).round().max(2.0);
    let knots: Vec<f64> = (0..=steps as usize).map(|i| from_deg + (to_deg - from_deg) * i as f64 / steps).collect();
    let values = vec![0.0; knots.len()];
    Box::new(JointErrorCurve { curves: vec![(joint - 1, Spline::new(knots, values))] })
}

fn candidates(survey: &Survey) -> Vec<Box<dyn Effect>> {
    let mut all = Vec::new();
    for i in 0..6 {
        let (min, max) = (survey.motor_min[i].to_degrees(), survey.motor_max[i].to_degrees());
        if max - min >= LEAST_RANGE_DEG {
            all.extend(SPACINGS_DEG.map(|spacing| joint_error_curve(i + 1, min, max, spacing)));
        }
    }
    all
}

impl Physics for JointErrorCurve {
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        for (joint, curve) in &self.curves {
            let error = site.commanded[*joint].each(|angle| curve.at(angle.to_degrees()));
            out.joints[*joint] = out.joints[*joint] + error;
        }
    }
}

impl Effect for JointErrorCurve {
    /// Beyond its end the error is assumed to be as large as within, and less and less correlated with the value at the end.
    fn unseen(&self, motor_commanded: &Joints) -> Joints {
        let mut sigma = Joints::zeros();
        for (joint, curve) in &self.curves {
            let held = curve.held(motor_commanded[*joint].to_degrees());
            let mean_square = curve.values().iter().map(|v| v * v).sum::<f64>() / curve.values().len() as f64;
            sigma[*joint] = (mean_square * (1.0 - held * held)).sqrt();
        }
        sigma
    }

    fn joint_curve(&self) -> Option<JointCurve> {
        let [(joint, curve)] = &self.curves[..] else { return None };
        let knots = curve.knots();
        let one_at = |k: usize| (0..knots.len()).map(|i| f64::from(u8::from(i == k))).collect();
        let units: Vec<Spline> = (0..knots.len()).map(|k| Spline::new(knots.to_vec(), one_at(k))).collect();
        let bends = (0..knots.len()).map(|i| units.iter().map(|unit| unit.bends()[i]).collect()).collect();
        Some(JointCurve { joint: *joint, knots_deg: knots.to_vec(), bends })
    }

    fn numbers(&mut self) -> Vec<Number<'_>> {
        let curves = self.curves.iter_mut().map(|(_, curve)| curve.values_mut()).enumerate();
        curves
            .flat_map(|(i, values)| indexed(&format!("curves[{i}].error_rad"), values, "rad", 1.5e-4, 0.0, ANY))
            .collect()
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        let with = |(joint, curve): &(usize, Spline)| {
            let (own, rest) = values.split_at(curve.knots().len());
            values = rest;
            (*joint, Spline::new(curve.knots().to_vec(), own.to_vec()))
        };
        Box::new(Self { curves: self.curves.iter().map(with).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::joint_error_curve;
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn halfway_between_knots_and_beyond_them() {
        let curve = "curves = [{ joint = 2, angle_deg = [-10, 0, 10], error_rad = [0, 1e-4, 3e-5] }]";
        // M₁ = 6·(−7e-6 − 1e-5)/40 = −2.55e-6, so s(5°) = 6.5e-5 + (⅛ − ½)·M₁·100/6.
        let mut bench = Bench::default();
        bench.motor[1] = 5f64.to_radians();
        assert_abs_diff_eq!(bench.run("joint_error_curve", curve).1.joints[1], 6.5e-5 + 1.593_75e-5, epsilon = 1e-18);
        // Halfway out of the step beyond the last knot, and out of it.
        bench.motor[1] = 15f64.to_radians();
        assert_abs_diff_eq!(bench.run("joint_error_curve", curve).1.joints[1], 1.5e-5, epsilon = 1e-18);
        bench.motor[1] = 40f64.to_radians();
        assert_abs_diff_eq!(bench.run("joint_error_curve", curve).1.joints[1], 0.0);
    }

    #[test]
    fn beyond_its_knots_a_curve_may_be_as_large_as_it_is() {
        let flat = joint_error_curve(2, -10.0, 10.0, 10.0);
        let curve = flat.with_values(&[3e-5, 0.0, -4e-5]);
        let unseen = |deg: f64| curve.unseen(&deflex_robot::Joints::from([0.0, deg.to_radians(), 0.0, 0.0, 0.0, 0.0]));
        let rms: f64 = (25e-10f64 / 3.0).sqrt();
        assert_abs_diff_eq!(unseen(7.0).norm(), 0.0);
        // Half of the end's value is held at half a step: √(1 − ¼) is not.
        assert_abs_diff_eq!(unseen(15.0)[1], rms * 0.75f64.sqrt(), epsilon = 1e-18);
        assert_abs_diff_eq!(unseen(-40.0)[1], rms, epsilon = 1e-18);
    }

    #[test]
    fn weights_are_what_each_value_adds() {
        let flat = joint_error_curve(1, -30.0, 50.0, 9.0);
        let curve = flat.joint_curve().unwrap();
        let values: Vec<f64> = (0..curve.knots_deg().len()).map(|i| ((i * i) as f64).sin()).collect();
        let raised = flat.with_values(&values);
        for angle in [-40.0, -33.0, -30.0, -3.3, 12.0, 49.9, 50.0, 60.0] {
            let mut weights = vec![0.0; values.len()];
            curve.weights(angle, &mut weights);
            let mut bench = Bench::default();
            bench.motor[0] = f64::to_radians(angle);
            let mut table = raised.to_table();
            table.remove("kind");
            let there = bench.run("joint_error_curve", &table.to_string()).1.joints[0];
            let sum: f64 = weights.iter().zip(&values).map(|(w, v)| w * v).sum();
            assert_abs_diff_eq!(there, sum, epsilon = 1e-12);
            let held = curve
                .knots_deg()
                .last()
                .zip(curve.knots_deg().first())
                .is_some_and(|(last, first)| (*first..=*last).contains(&angle));
            assert!(!held || (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
