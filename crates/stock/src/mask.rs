//! The engaged share of a cell of the mask, from the depth in the material at its corners and its middle.

/// A corner of a triangle in the unit square of a cell, and the depth there.
type Corner = ([f64; 2], f64);

/// An engaged part of a cell: its share of the cell, its centroid, and its extent along the second side, in the unit square.
#[derive(Clone, Copy, Debug)]
pub(super) struct EngagedPart {
    pub(super) share: f64,
    pub(super) centroid: [f64; 2],
    pub(super) low: f64,
    pub(super) high: f64,
}

/// Calls `each` with every part in which a function is positive that is linear on the four triangles around the middle. Corners: (0,0), (1,0), (1,1), (0,1).
pub(super) fn engaged_parts(corners: [f64; 4], middle: f64, mut each: impl FnMut(EngagedPart)) {
    const PLACES: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for k in 0..4 {
        let next = (k + 1) % 4;
        triangle([([0.5, 0.5], middle), (PLACES[k], corners[k]), (PLACES[next], corners[next])], &mut each);
    }
}

/// The same for one triangle, a quarter of the cell.
fn triangle(corners: [Corner; 3], each: &mut impl FnMut(EngagedPart)) {
    const SHARE: f64 = 0.25;
    let [a, b, c] = corners;
    let centroid = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| [(p[0] + q[0] + r[0]) / 3.0, (p[1] + q[1] + r[1]) / 3.0];
    let inside = [a.1 > 0.0, b.1 > 0.0, c.1 > 0.0];
    let count = inside.iter().filter(|inside| **inside).count();
    if count == 0 {
        return;
    }
    let whole = centroid(a.0, b.0, c.0);
    let part = |share: f64, centroid: [f64; 2], ends: &[f64]| EngagedPart {
        share: SHARE * share,
        centroid,
        low: ends.iter().fold(f64::INFINITY, |a, b| a.min(*b)),
        high: ends.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b)),
    };
    if count == 3 {
        return each(part(1.0, whole, &[a.0[1], b.0[1], c.0[1]]));
    }
    // The corner on the other side of the rim from the two others.
    let alone = inside.iter().position(|inside| *inside == (count == 1)).unwrap_or(0);
    let (tip, p, q) = match alone {
        0 => (a, b, c),
        1 => (b, c, a),
        _ => (c, a, b),
    };
    let (to_p, to_q) = (tip.1 / (tip.1 - p.1), tip.1 / (tip.1 - q.1));
    let on = |to: [f64; 2], share: f64| [tip.0[0] + share * (to[0] - tip.0[0]), tip.0[1] + share * (to[1] - tip.0[1])];
    let (on_p, on_q) = (on(p.0, to_p), on(q.0, to_q));
    let (cut, cut_at) = (to_p * to_q, centroid(tip.0, on_p, on_q));
    if count == 1 {
        return each(part(cut, cut_at, &[tip.0[1], on_p[1], on_q[1]]));
    }
    let rest = 1.0 - cut;
    if rest > 0.0 {
        let at = [0, 1].map(|k| (whole[k] - cut * cut_at[k]) / rest);
        each(part(rest, at, &[p.0[1], q.0[1], on_p[1], on_q[1]]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// With a straight rim, share and first moment are those of a fine raster.
        #[test]
        fn a_straight_rim_is_exact(slope in -2.0_f64..2.0, across in -2.0_f64..2.0, level in -1.5_f64..1.5) {
            let f = |x: f64, y: f64| level + slope * x + across * y;
            let (mut share, mut moment) = (0.0, [0.0; 2]);
            engaged_parts([f(0.0, 0.0), f(1.0, 0.0), f(1.0, 1.0), f(0.0, 1.0)], f(0.5, 0.5), |part| {
                share += part.share;
                moment[0] += part.share * part.centroid[0];
                moment[1] += part.share * part.centroid[1];
            });
            const N: usize = 200;
            let mut raster = [0.0; 3];
            for i in 0..N {
                for j in 0..N {
                    let (x, y) = ((i as f64 + 0.5) / N as f64, (j as f64 + 0.5) / N as f64);
                    if f(x, y) > 0.0 {
                        for (sum, add) in raster.iter_mut().zip([1.0, x, y]) {
                            *sum += add / (N * N) as f64;
                        }
                    }
                }
            }
            prop_assert!((share - raster[0]).abs() < 0.01, "{share} {raster:?}");
            prop_assert!((moment[0] - raster[1]).abs() < 0.01 && (moment[1] - raster[2]).abs() < 0.01);
        }
    }
}
