//! Sines and arc tangents without branches, because all lanes of a processor take the same branch.

use super::real::{Mask, Real};
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI};

/// Adding this leaves the nearest whole number in the last bits: 1.5 · 2^52.
pub const ROUND: f64 = 6_755_399_441_055_744.0;

/// Sine and cosine of an angle.
///
/// # Examples
/// ```
/// use deflex_lanes::SinCos;
///
/// let (third, sixth) = (SinCos::of(1.2), SinCos::of(0.6));
/// assert!((third.sin - 1.2_f64.sin()).abs() < 1e-15);
/// assert!((third.minus(sixth).angle() - 0.6).abs() < 1e-15);
/// assert!((sixth.plus(sixth).cos - third.cos).abs() < 1e-15);
/// assert!((third.turned_by(1e-3).angle() - 1.201).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct SinCos<R> {
    /// Sine.
    pub sin: R,
    /// Cosine.
    pub cos: R,
}

impl<R: Real> SinCos<R> {
    /// Sine and cosine of an angle of up to some thousand turns, rad, with an error of about 1e-16.
    #[inline(always)]
    pub fn of(angle: R) -> Self {
        // A quarter turn in two parts, the first so short that whole multiples are exact (fdlibm, e_rem_pio2.c).
        const QUARTER: (f64, f64) = (1.570_796_326_734_125_6, 6.077_100_506_506_192e-11);
        let shifted = angle * FRAC_2_PI + ROUND;
        let quarters = shifted - ROUND;
        let r = (angle - quarters * QUARTER.0) - quarters * QUARTER.1;
        // Minimax polynomials on ±π/4 (fdlibm, k_sin.c and k_cos.c).
        let rr = r * r;
        let sin = r + r
            * rr
            * horner(
                rr,
                [
                    1.589_690_995_211_55e-10,
                    -2.505_076_025_340_686_3e-8,
                    2.755_731_370_707_006_8e-6,
                    -1.984_126_982_985_795e-4,
                    8.333_333_333_322_49e-3,
                    -1.666_666_666_666_663_2e-1,
                ],
            );
        let cos = (rr * -0.5
            + rr * rr
                * horner(
                    rr,
                    [
                        -1.135_964_755_778_819_5e-11,
                        2.087_572_321_298_175e-9,
                        -2.755_731_435_139_066_3e-7,
                        2.480_158_728_947_673e-5,
                        -1.388_888_888_887_411e-3,
                        4.166_666_666_666_66e-2,
                    ],
                ))
            + 1.0;
        // In quadrants 1 and 3, sine and cosine are swapped. The sine is negated in 2 and 3, the cosine in 1 and 2.
        let (swap, half) = (shifted.bit(0), shifted.bit(1));
        let (s, c) = (swap.select(cos, sin), swap.select(sin, cos));
        Self { sin: half.negate(s), cos: half.negate(swap.negate(c)) }
    }

    /// Sine and cosine of the angle plus a small step; exact to rounding for steps of up to 0.01 rad.
    #[inline(always)]
    pub fn turned_by(self, step: R) -> Self {
        let square = step * step;
        let sin = step * (R::of(1.0) - square * (R::of(1.0 / 6.0) - square * (1.0 / 120.0)));
        let less = square * (R::of(0.5) - square * (R::of(1.0 / 24.0) - square * (1.0 / 720.0)));
        Self { sin: self.sin + (self.cos * sin - self.sin * less), cos: self.cos - (self.sin * sin + self.cos * less) }
    }

    /// Sine and cosine of the sum with another angle.
    #[inline(always)]
    pub fn plus(self, by: Self) -> Self {
        Self { sin: self.sin * by.cos + self.cos * by.sin, cos: self.cos * by.cos - self.sin * by.sin }
    }

    /// Sine and cosine of the difference from another angle.
    #[inline(always)]
    pub fn minus(self, by: Self) -> Self {
        Self { sin: self.sin * by.cos - self.cos * by.sin, cos: self.cos * by.cos + self.sin * by.sin }
    }

    /// The angle within ±π, rad, with a relative error of about 1e-16. Sine and cosine may have any common scale.
    #[inline(always)]
    pub fn angle(self) -> R {
        /// tan(π/8). Angles beyond are counted from π/4.
        const FAR: f64 = 0.414_213_562_373_095_05;
        let (y, x) = (self.sin.abs(), self.cos.abs());
        let steep = x.lt(y);
        let (low, high) = (steep.select(x, y), steep.select(y, x));
        let far = (high * FAR).lt(low);
        let t = far.select(low - high, low) / far.select(low + high, high);
        // Rational minimax approximation (Moshier, Cephes, atan.c).
        let tt = t * t;
        let above = horner(
            tt,
            [
                -8.750_608_600_031_904e-1,
                -1.615_753_718_733_365e1,
                -7.500_855_792_314_705e1,
                -1.228_866_684_490_136_1e2,
                -6.485_021_904_942_025e1,
            ],
        );
        let below = horner(
            tt,
            [
                1.0,
                2.485_846_490_142_306_4e1,
                1.650_270_098_316_988_5e2,
                4.328_810_604_912_903e2,
                4.853_903_996_359_137e2,
                1.945_506_571_482_614e2,
            ],
        );
        let near = t + t * (tt * above / below);
        let angle = far.select(near + FRAC_PI_4, near);
        let angle = steep.select(R::of(FRAC_PI_2) - angle, angle);
        let angle = self.cos.lt(0.0).select(R::of(PI) - angle, angle);
        self.sin.lt(0.0).negate(angle)
    }
}

/// The value of a polynomial, whose coefficients begin with the highest power.
#[inline(always)]
pub(super) fn horner<R: Real, const N: usize>(x: R, coefficients: [f64; N]) -> R {
    let mut sum = R::of(coefficients[0]);
    for coefficient in &coefficients[1..] {
        sum = sum * x + *coefficient;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Lanes, WIDTH};
    use proptest::prelude::*;

    /// Two units in the last place of 1.
    const ROUNDING: f64 = 4.5e-16;

    proptest! {
        #[test]
        fn sines_are_those_of_the_library(angles in prop::array::uniform8(-700.0_f64..700.0)) {
            let turn = SinCos::of(Lanes(angles));
            for i in 0..WIDTH {
                let (sin, cos) = angles[i].sin_cos();
                prop_assert!((turn.sin.0[i] - sin).abs() < ROUNDING && (turn.cos.0[i] - cos).abs() < ROUNDING);
            }
        }

        #[test]
        fn angles_are_those_of_the_library(
            y in prop::array::uniform8(-1.0_f64..1.0),
            x in prop::array::uniform8(-1.0_f64..1.0),
            scale in prop::sample::select(vec![1.0, 1e-4, 1e-12]),
        ) {
            let y = y.map(|y| y * scale);
            let angle = (SinCos { sin: Lanes(y), cos: Lanes(x) }).angle();
            for i in 0..WIDTH {
                let want = y[i].atan2(x[i]);
                prop_assert!((angle.0[i] - want).abs() <= 2.0 * ROUNDING * want.abs(), "{} {want}", angle.0[i]);
            }
        }

        #[test]
        fn a_nudge_is_the_sum_of_angles(angle in -3.0_f64..3.0, step in -0.01_f64..0.01) {
            let turned_by = SinCos::of(Lanes::of(angle)).turned_by(Lanes::of(step));
            let (sin, cos) = (angle + step).sin_cos();
            prop_assert!((turned_by.sin.0[0] - sin).abs() < 2.0 * ROUNDING && (turned_by.cos.0[0] - cos).abs() < 2.0 * ROUNDING);
        }
    }

    #[test]
    fn quarter_turns_are_whole() {
        let angles = [0.0, FRAC_PI_2, PI, -FRAC_PI_2, -PI, 3.0 * FRAC_PI_2, 2.0 * PI, FRAC_PI_4];
        let turn = SinCos::of(Lanes(angles));
        for i in 0..WIDTH {
            let (sin, cos) = angles[i].sin_cos();
            assert!((turn.sin.0[i] - sin).abs() < ROUNDING && (turn.cos.0[i] - cos).abs() < ROUNDING, "{}", angles[i]);
        }
        let back = SinCos {
            sin: Lanes([0.0, 1.0, 0.0, -1.0, 0.0, 1e-300, 1.0, -1.0]),
            cos: Lanes([1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 1.0, -1.0]),
        };
        let angles = back.angle().0;
        for (i, want) in [0.0, FRAC_PI_2, PI, -FRAC_PI_2].into_iter().enumerate() {
            assert!((angles[i] - want).abs() < ROUNDING);
        }
        // A zero vector has no direction.
        assert!(angles[4].is_nan());
        assert!((angles[6] - FRAC_PI_4).abs() < ROUNDING && (angles[7] + 3.0 * FRAC_PI_4).abs() < 2.0 * ROUNDING);
    }
}
