//! Properties of a function over a cell of the mask that follow from its values at the corners and the middle.

/// Values at the corners of a cell, from the lower one around, and at its middle: depths, m, or levels whose zero is the rim of the
/// engagement.
#[derive(Clone, Copy)]
pub(super) struct Levels {
    pub(super) corners: [f64; 4],
    pub(super) middle: f64,
}

impl Levels {
    pub(super) fn times(&self, factor: f64) -> Self {
        Self { corners: self.corners.map(|level| level * factor), middle: self.middle * factor }
    }

    pub(super) fn lowest(&self) -> f64 {
        self.corners.iter().fold(self.middle, |a, b| a.min(*b))
    }

    pub(super) fn highest(&self) -> f64 {
        self.corners.iter().fold(self.middle, |a, b| a.max(*b))
    }

    /// Height of the middle above a plane through the corners.
    pub(super) fn bulge(&self) -> f64 {
        self.middle - 0.25 * self.corners.iter().sum::<f64>()
    }

    /// If all values have one sign: how far a fold between the corners may reach beyond zero.
    pub(super) fn kink(&self) -> f64 {
        let least = self.corners.iter().fold(self.middle.abs(), |a, b| a.min(b.abs()));
        (2.0 * self.bulge().abs() - least).max(0.0)
    }

    /// The highest value in the cell of a paraboloid through the corners and the middle.
    ///
    /// These values do not distinguish its bend across from its bend along. If that matters, `level_at` is called with
    /// the middle of the highest edge, in coordinates of the unit square.
    pub(super) fn highest_between(&self, level_at: impl Fn([f64; 2]) -> f64) -> f64 {
        let [a, b, c, d] = self.corners;
        let (both, highest) = (4.0 * self.bulge(), self.highest());
        let rise = |slope: f64, bend: f64| {
            let at = if bend > 0.0 { (0.5 * slope / bend).clamp(-0.5, 0.5) } else { 0.5_f64.copysign(slope) };
            at * (slope - bend * at)
        };
        let slopes = [0.5 * (b + c - a - d), 0.5 * (c + d - a - b)];
        let top = |bends: [f64; 2]| highest.max(self.middle + rise(slopes[0], bends[0]) + rise(slopes[1], bends[1]));
        if both <= 0.0 || top([0.5 * both; 2]) <= 0.0 {
            return highest;
        }
        // Middles of the edges, sums of the values at their ends, and whether the edge goes across.
        let edges = [
            ([0.5, 0.0], a + b, true),
            ([1.0, 0.5], b + c, false),
            ([0.5, 1.0], c + d, true),
            ([0.0, 0.5], d + a, false),
        ];
        let (place, ends, across) =
            edges.into_iter().fold(edges[0], |best, edge| if edge.1 > best.1 { edge } else { best });
        let on_edge = level_at(place);
        let bend = 4.0 * on_edge - 2.0 * ends;
        on_edge.max(top(if across { [bend, both - bend] } else { [both - bend, bend] }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// For a paraboloid with its axes along those of the cell, a positive highest value is that of a fine raster.
        #[test]
        fn the_highest_of_a_paraboloid(
            slopes in [-1.0_f64..1.0, -1.0..1.0],
            bends in [-1.0_f64..1.0, -1.0..1.0],
            top in -0.5_f64..0.5,
        ) {
            let f = |[x, y]: [f64; 2]| {
                let [x, y] = [x - 0.5, y - 0.5];
                top + slopes[0] * x + slopes[1] * y - bends[0] * x * x - bends[1] * y * y
            };
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(f);
            let found = Levels { corners, middle: f([0.5, 0.5]) }.highest_between(f);
            const N: usize = 100;
            let place = |n: usize| [(n % (N + 1)) as f64 / N as f64, (n / (N + 1)) as f64 / N as f64];
            let raster = (0..(N + 1) * (N + 1)).map(place).map(f).fold(f64::NEG_INFINITY, f64::max);
            // With bends of opposite signs, or if both guesses stay negative, the edges are not tested.
            if bends[0] >= 0.0 && bends[1] >= 0.0 && found > 0.0 {
                prop_assert!((found - raster).abs() < 1e-3, "{found} {raster}");
            }
        }
    }
}
