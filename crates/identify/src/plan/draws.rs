//! Pseudo-random numbers that are the same on every run.

/// A linear congruential generator with the constants of Knuth's MMIX.
#[derive(Clone, Debug)]
pub(super) struct Draws(u64);

impl Draws {
    /// The sequence of this seed.
    pub(super) fn of(seed: u64) -> Self {
        let mut draws = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5851_F42D_4C95_7F2D);
        for _ in 0..4 {
            draws.share();
        }
        draws
    }

    /// A uniform number from 0 to 1, without 1.
    pub(super) fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A uniform index below `count`.
    pub(super) fn index(&mut self, count: usize) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let index = (self.share() * count as f64) as usize;
        index.min(count.saturating_sub(1))
    }

    /// A standard normal number (Box and Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        let (radius, turn) = (1.0 - self.share(), self.share());
        (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * turn).cos()
    }
}

/// Number `index`, from 1, of the Halton (1960) sequence of a prime base, whose numbers fill the interval from 0 to 1
/// evenly.
pub(super) fn halton(mut index: usize, base: usize) -> f64 {
    let (mut share, mut value) = (1.0, 0.0);
    while index > 0 {
        share /= base as f64;
        value += share * (index % base) as f64;
        index /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halton_of_base_two_halves_the_gaps() {
        let first: Vec<f64> = (1..=4).map(|index| halton(index, 2)).collect();
        assert_eq!(first, [0.5, 0.25, 0.75, 0.125]);
    }

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut draws = Draws::of(1);
        let all: Vec<f64> = (0..20_000).map(|_| draws.normal()).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let variance = all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / all.len() as f64;
        // Four standard errors.
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.04, "{mean} {variance}");
    }
}
