//! Frames of printed positions, relative to the first one of the file, which is the work object.

use super::vector::{add, cross, dot, scale, sub};

/// `object_mm = rotation · (mm_per_unit · printed) + origin_mm`
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    /// Rows of the rotation.
    pub(super) rows: [[f64; 3]; 3],
    pub(super) origin_mm: [f64; 3],
    pub(super) mm_per_unit: f64,
}

/// Largest error of the right angles and the lengths of printed axes: four printed digits, with a margin.
const SQUARE: f64 = 2e-3;

const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Frame {
    pub(super) fn identity(mm_per_unit: f64) -> Self {
        Self { rows: IDENTITY, origin_mm: [0.0; 3], mm_per_unit }
    }

    /// The frame from rows `[r r r t]`, as CATIA and CSYS print them; `None` if they are no rotation.
    pub(super) fn from_rows(m: [f64; 12], mm_per_unit: f64) -> Option<Self> {
        let rows = [[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]];
        Self::checked(rows, scale([m[3], m[7], m[11]], mm_per_unit), mm_per_unit)
    }

    /// The frame from its origin and its first two axes, as MSYS prints them; the third axis is their cross product.
    pub(super) fn from_msys(m: [f64; 9], mm_per_unit: f64) -> Option<Self> {
        let (x, y) = ([m[3], m[4], m[5]], [m[6], m[7], m[8]]);
        let z = cross(x, y);
        let rows = [0, 1, 2].map(|i| [x[i], y[i], z[i]]);
        Self::checked(rows, scale([m[0], m[1], m[2]], mm_per_unit), mm_per_unit)
    }

    fn checked(rows: [[f64; 3]; 3], origin_mm: [f64; 3], mm_per_unit: f64) -> Option<Self> {
        let square = (0..3).all(|i| (0..3).all(|j| (dot(rows[i], rows[j]) - IDENTITY[i][j]).abs() < SQUARE));
        let right_handed = dot(cross(rows[0], rows[1]), rows[2]) > 0.0;
        (square && right_handed).then(|| Self { rows: nearest_rotation(rows), origin_mm, mm_per_unit })
    }

    /// This frame relative to `base`: base⁻¹ · self.
    pub(super) fn seen_from(&self, base: &Self) -> Self {
        let column = |i: usize| [0, 1, 2].map(|k| self.rows[k][i]);
        let columns = [0, 1, 2].map(|i| base.back(column(i)));
        let rows = [0, 1, 2].map(|k| [0, 1, 2].map(|i| columns[i][k]));
        Self { rows, origin_mm: base.back(sub(self.origin_mm, base.origin_mm)), mm_per_unit: self.mm_per_unit }
    }

    /// A direction, from printed axes to the object's.
    pub(super) fn turn(&self, v: [f64; 3]) -> [f64; 3] {
        if self.rows == IDENTITY { v } else { self.rows.map(|row| dot(row, v)) }
    }

    /// A direction or an offset, from the object's axes to printed ones (the transpose).
    pub(super) fn back(&self, v: [f64; 3]) -> [f64; 3] {
        if self.rows == IDENTITY {
            return v;
        }
        let [a, b, c] = self.rows;
        add(add(scale(a, v[0]), scale(b, v[1])), scale(c, v[2]))
    }

    /// A printed position, in the object, mm.
    pub(super) fn position(&self, printed: [f64; 3]) -> [f64; 3] {
        add(self.turn(scale(printed, self.mm_per_unit)), self.origin_mm)
    }

    /// The third axis.
    pub(super) fn z_axis(&self) -> [f64; 3] {
        [self.rows[0][2], self.rows[1][2], self.rows[2][2]]
    }
}

/// The rotation nearest to printed axes, whose rounding would otherwise shear and stretch (Newton's iteration for the polar decomposition,
/// Higham 1986).
fn nearest_rotation(mut rows: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    // From an error of 2e-3 by squares: 2e-6, 2e-12, rounding.
    const POLAR_STEPS: usize = 4;
    for _ in 0..POLAR_STEPS {
        let [a, b, c] = rows;
        let inverse_transposed =
            [cross(b, c), cross(c, a), cross(a, b)].map(|row| scale(row, 1.0 / dot(cross(a, b), c)));
        rows = [0, 1, 2].map(|k| scale(add(rows[k], inverse_transposed[k]), 0.5));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::float_cmp)] // quarter turns are exact
    fn seen_from_itself_is_the_identity_and_back_undoes_turn() {
        let msys = Frame::from_msys([10.0, 20.0, 30.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0], 1.0).unwrap();
        assert_eq!(msys.seen_from(&msys), Frame::identity(1.0));
        assert_eq!(msys.turn([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        assert_eq!(msys.back(msys.turn([1.0, 2.0, 3.0])), [1.0, 2.0, 3.0]);
        assert_eq!(msys.position([1.0, 0.0, 0.0]), [10.0, 21.0, 30.0]);
    }

    #[test]
    fn printed_axes_stand_for_a_rotation() {
        let rows = [[0.6, -0.8, 0.0, 0.0], [0.8001, 0.6, 0.0, 0.0], [0.0, 0.0003, 1.0, 0.0]].concat();
        let frame = Frame::from_rows(rows.try_into().unwrap(), 1.0).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                assert!((dot(frame.rows[i], frame.rows[j]) - IDENTITY[i][j]).abs() < 1e-15, "{frame:?}");
            }
        }
        assert!((frame.rows[0][0] - 0.6).abs() < 1e-4 && (frame.rows[2][1] - 0.000_15).abs() < 1e-4);
    }

    #[test]
    fn a_mirror_or_a_skew_is_no_frame() {
        assert!(Frame::from_msys([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.0], 1.0).is_none());
        let mirror = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0];
        assert!(Frame::from_rows(mirror, 1.0).is_none());
    }
}
