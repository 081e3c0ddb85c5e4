//! Roots of functions of one number.

/// Accuracy of the angles at which intervals end, rad. The error of the integral is proportional to its square.
const BREAK_WIDTH: f64 = 1e-10;

/// Root of an increasing function by false position (Illinois), with bisection as a safeguard.
pub(super) fn increasing_root(mut lo: f64, mut hi: f64, f: impl Fn(f64) -> f64) -> Option<f64> {
    let (mut f_lo, mut f_hi) = (f(lo), f(hi));
    if f_lo.is_nan() || f_hi.is_nan() || f_lo >= 0.0 || f_hi <= 0.0 {
        return None;
    }
    let (mut last, mut kept_lo, mut kept_hi) = (lo, false, false);
    for pass in 0..100 {
        // Every fifth step is a bisection, so that a jump of the function cannot stall the secant.
        let at = if pass % 5 == 4 { 0.5 * (lo + hi) } else { hi - f_hi * (hi - lo) / (f_hi - f_lo) };
        if (at - last).abs() < BREAK_WIDTH {
            return Some(at);
        }
        last = at;
        let value = f(at);
        // The function value at an end that was kept twice in succession is halved.
        if value < 0.0 {
            (lo, f_lo) = (at, value);
            f_hi *= if kept_hi { 0.5 } else { 1.0 };
            (kept_lo, kept_hi) = (false, true);
        } else {
            (hi, f_hi) = (at, value);
            f_lo *= if kept_lo { 0.5 } else { 1.0 };
            (kept_lo, kept_hi) = (true, false);
        }
    }
    Some(0.5 * (lo + hi))
}
