//! Gauss rule for integrands whose ends behave like square roots.

/// Gauss–Legendre in u on x = sin(πu/2), the Jacobian in the weight: √(1 ± x) at the ends becomes
/// smooth. Positive half, (x, weight); the rule is symmetric.
const HALF_RULE: [(f64, f64); 12] = [
    (0.9999714241136359, 0.0001465514320313841),
    (0.99921220568082, 0.0017786015075653154),
    (0.9953032439430657, 0.006732956754422596),
    (0.9841256733619321, 0.016530898188076494),
    (0.960294556001908, 0.03214288518424289),
    (0.9178320837020137, 0.05374449648049318),
    (0.8510717300380624, 0.08051056606007383),
    (0.7557155516028933, 0.11052947952351369),
    (0.6298819788473622, 0.14091958905880125),
    (0.4749153892237813, 0.16819120101057886),
    (0.29571968881434424, 0.18882439885343477),
    (0.10045063033696164, 0.1999483759467657),
];

/// The same rule with half the points, for short intervals, which contribute little force.
const SHORT_HALF_RULE: [(f64, f64); 6] = [
    (0.9995805585427681, 0.002146050869604284),
    (0.9886793973997658, 0.025204290664194665),
    (0.9353899810114455, 0.08891736753100099),
    (0.7971480302878087, 0.1926883674272538),
    (0.5461726500440457, 0.30723253633833375),
    (0.19544990129661524, 0.3838113871696125),
];

/// An interval of the profile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    pub(super) lo: f64,
    pub(super) hi: f64,
    /// Whether it is short compared with the others.
    pub(super) short: bool,
}

/// Calls `f(x, weight)` at a rule's points on an interval.
#[inline]
pub(super) fn integrate(interval: Interval, mut f: impl FnMut(f64, f64)) {
    let Interval { lo, hi, short } = interval;
    let rule: &[(f64, f64)] = if short { &SHORT_HALF_RULE } else { &HALF_RULE };
    let (mid, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
    for &(x, weight) in rule {
        f(mid - half * x, half * weight);
        f(mid + half * x, half * weight);
    }
}

#[cfg(test)]
mod tests {
    use super::{Interval, integrate};
    use std::f64::consts::PI;

    #[test]
    fn square_root_ends_and_polynomials_come_out_exactly() {
        let sum = |f: &dyn Fn(f64) -> f64| {
            let mut sum = 0.0;
            integrate(Interval { lo: -1.0, hi: 1.0, short: false }, |x, w| sum += w * f(x));
            sum
        };
        assert!((sum(&|x| (1.0 - x * x).sqrt()) - PI / 2.0).abs() < 1e-14);
        assert!((sum(&|x| (1.0 - x).sqrt()) - 4.0 * 2f64.sqrt() / 3.0).abs() < 1e-14);
        assert!((sum(&|x| x.acos()) - PI).abs() < 1e-14);
        assert!((sum(&|x| x.powi(4)) - 0.4).abs() < 1e-14);
    }
}
