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

/// Calls `f(x, weight)` at the rule's points on [lo, hi].
#[inline]
pub(super) fn integrate(lo: f64, hi: f64, mut f: impl FnMut(f64, f64)) {
    let (mid, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
    for (x, weight) in HALF_RULE {
        f(mid - half * x, half * weight);
        f(mid + half * x, half * weight);
    }
}

#[cfg(test)]
mod tests {
    use super::integrate;
    use std::f64::consts::PI;

    #[test]
    fn square_root_ends_and_polynomials_come_out_exactly() {
        let sum = |f: &dyn Fn(f64) -> f64| {
            let mut sum = 0.0;
            integrate(-1.0, 1.0, |x, w| sum += w * f(x));
            sum
        };
        assert!((sum(&|x| (1.0 - x * x).sqrt()) - PI / 2.0).abs() < 1e-14);
        assert!((sum(&|x| (1.0 - x).sqrt()) - 4.0 * 2f64.sqrt() / 3.0).abs() < 1e-14);
        assert!((sum(&|x| x.acos()) - PI).abs() < 1e-14);
        assert!((sum(&|x| x.powi(4)) - 0.4).abs() < 1e-14);
    }
}
