//! A smooth curve through knots that fades to zero beyond them.

use super::fade;

/// Natural cubic spline through knots. It is continuous to the second derivative, and linear in the values at the knots. Beyond the first
/// and the last knot nothing is known, so the value there fades to zero over a step as wide as the nearest one.
#[derive(Clone, Debug)]
pub(super) struct Spline {
    knots: Vec<f64>,
    values: Vec<f64>,
    /// Second derivatives at the knots.
    bends: Vec<f64>,
}

impl Spline {
    /// The spline through at least two strictly rising knots, with a value for each.
    pub(super) fn new(knots: Vec<f64>, values: Vec<f64>) -> Self {
        let last = knots.len().saturating_sub(1);
        let mut bends = vec![0.0; knots.len()];
        // Tridiagonal elimination (Thomas); the system is diagonally dominant, so no pivots are needed.
        let mut upper = vec![0.0; knots.len()];
        let step = |i: usize| knots[i + 1] - knots[i];
        let slope = |i: usize| (values[i + 1] - values[i]) / step(i);
        for i in 1..last {
            let pivot = 2.0 * (step(i - 1) + step(i)) - step(i - 1) * upper[i - 1];
            upper[i] = step(i) / pivot;
            bends[i] = (6.0 * (slope(i) - slope(i - 1)) - step(i - 1) * bends[i - 1]) / pivot;
        }
        for i in (1..last).rev() {
            bends[i] -= upper[i] * bends[i + 1];
        }
        Self { knots, values, bends }
    }

    pub(super) fn knots(&self) -> &[f64] {
        &self.knots
    }

    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// The values in place. A spline through other values has to be made anew.
    pub(super) fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Share of the nearest knot's value that remains beyond the first or the last knot; 1 between them.
    pub(super) fn held(&self, x: f64) -> f64 {
        Place::of(&self.knots, x).values.iter().sum()
    }

    /// Second derivatives at the knots.
    pub(super) fn bends(&self) -> &[f64] {
        &self.bends
    }

    pub(super) fn at(&self, x: f64) -> f64 {
        let Place { i, values: [a, b], bends: [c, d] } = Place::of(&self.knots, x);
        a * self.values[i] + b * self.values[i + 1] + c * self.bends[i] + d * self.bends[i + 1]
    }
}

/// The two knots between which a place lies, and the weights of their values and second derivatives there.
pub(super) struct Place {
    /// The lower knot.
    pub(super) i: usize,
    pub(super) values: [f64; 2],
    pub(super) bends: [f64; 2],
}

impl Place {
    pub(super) fn of(knots: &[f64], x: f64) -> Self {
        let within = x.clamp(knots[0], knots[knots.len() - 1]);
        let (beyond, x) = ((x - within).abs(), within);
        let i = knots.partition_point(|knot| *knot <= x).clamp(1, knots.len() - 1) - 1;
        let step = knots[i + 1] - knots[i];
        let (a, b) = ((knots[i + 1] - x) / step, (x - knots[i]) / step);
        let bend = |share: f64| (share.powi(3) - share) * step * step / 6.0;
        let left = fade(1.0 + beyond / step);
        Self { i, values: [left * a, left * b], bends: [bend(a), bend(b)] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn three_knots_by_hand() {
        // Knots 0, 1, 2 with values 0, 1, 0: M₁ = 6·(−2)/4 = −3, so s(½) = ½ + (⅛ − ½)·(−3)/6 = 11/16.
        let spline = Spline::new(vec![0.0, 1.0, 2.0], vec![0.0, 1.0, 0.0]);
        assert_relative_eq!(spline.at(0.5), 11.0 / 16.0, max_relative = 1e-15);
        assert_relative_eq!(spline.at(1.5), 11.0 / 16.0, max_relative = 1e-15);
        assert_relative_eq!(spline.at(1.0), 1.0);
    }

    #[test]
    fn beyond_the_knots_the_last_value_fades_over_a_step() {
        let spline = Spline::new(vec![0.0, 1.0, 3.0], vec![4.0, 1.0, 8.0]);
        // The share 3 t² − 2 t³ remains, with t the part of the step that is left: half of it here, nothing after the step.
        for (x, value) in [(0.0, 4.0), (-0.5, 2.0), (-1.0, 0.0), (-7.0, 0.0), (3.0, 8.0), (3.5, 6.75), (5.0, 0.0)] {
            assert_relative_eq!(spline.at(x), value, max_relative = 1e-15, epsilon = 1e-15);
        }
    }

    #[test]
    fn a_line_stays_a_line() {
        let spline = Spline::new(vec![0.0, 0.3, 1.0, 4.0], vec![1.0, 1.6, 3.0, 9.0]);
        for x in [0.1, 0.5, 2.0, 3.9] {
            assert_relative_eq!(spline.at(x), 1.0 + 2.0 * x, max_relative = 1e-14);
        }
    }
}
