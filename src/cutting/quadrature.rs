//! Gauss rule for integrands whose ends behave like square roots.

/// Gauss–Legendre in u on x = sin(πu/2), the Jacobian in the weight: √(1 ± x) at the ends becomes
/// smooth. Positive half, (x, weight); the rule is symmetric.
const HALF_RULE: [(f64, f64); 8] = [
    (0.9998614090606618, 0.0007100622419553459),
    (0.9962125538623356, 0.008502770188159262),
    (0.9778081379419737, 0.03131529229790737),
    (0.9270948887883125, 0.07337860064611115),
    (0.8252008724268356, 0.1327286844866403),
    (0.6589718853990847, 0.19985877562414886),
    (0.4280570635888686, 0.2592256091579351),
    (0.1486918658904044, 0.2942802053571427),
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
