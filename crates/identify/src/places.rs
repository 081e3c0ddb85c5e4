//! Finds the place on the path that belongs to a row with nominal coordinates and without a target: the nearest one, at
//! a target or between two targets.

use deflex_cell::Cell;
use deflex_correct::{Between, Point, Prepared};
use deflex_measured::{MATCH_MM, MeasuredRow, Table};
use deflex_program::{Motion, Program};
use deflex_text::Diagnostic;
use nalgebra::Vector3;

/// A place on the path, and its distance from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PathPosition {
    at: Between,
    /// Distance from the point, mm.
    off_mm: f64,
    /// Length of the path up to this place, mm.
    along_mm: f64,
}

/// The point of a row.
pub(super) struct Placed {
    /// Index of the point in the prepared program.
    pub(super) point: usize,
    /// Index of the target before it, if it lies between two targets.
    pub(super) way_from: Option<usize>,
}

impl Placed {
    /// The point of a target.
    pub(super) fn at_target(point: usize) -> Self {
        Self { point, way_from: None }
    }
}

/// The path from which errors are counted, as straight segments between targets. Arcs and joint motions consist of
/// their end points only.
pub(super) struct Path<'a> {
    program: &'a Program,
    /// Position of each target, work object axes, mm.
    ends: Vec<Vector3<f64>>,
    /// Length of the path up to each target, mm.
    along_mm: Vec<f64>,
    /// Largest distance of a point from the path, mm.
    match_mm: f64,
}

impl<'a> Path<'a> {
    /// The path of a prepared program.
    pub(super) fn new(program: &'a Program, prepared: &Prepared, table: &Table) -> Self {
        // No row belongs to a target that is not solved. Its position is NaN, which is near no point.
        let end = |(i, point): (usize, &Point)| match prepared.unsolved(i) {
            Some(_) => Vector3::repeat(f64::NAN),
            None => 1e3 * point.reference.translation.vector,
        };
        let ends: Vec<Vector3<f64>> = prepared.points.iter().enumerate().map(end).collect();
        let mut along_mm = vec![0.0; ends.len()];
        for i in 1..ends.len() {
            let way = (ends[i] - ends[i - 1]).norm();
            along_mm[i] = along_mm[i - 1] + if way.is_finite() { way } else { 0.0 };
        }
        Self { program, ends, along_mm, match_mm: table.match_mm.unwrap_or(MATCH_MM) }
    }

    /// Adds the place of a row to the points of the prepared program.
    ///
    /// # Errors
    /// A place that is far from the path, or not on one stretch of it alone; a point that cannot be added.
    pub(super) fn place(
        &self,
        cell: &Cell,
        prepared: &mut Prepared,
        row: &MeasuredRow,
        nominal_mm: [f64; 3],
    ) -> Result<Placed, String> {
        let place = self.nearest(&nominal_mm.into())?;
        let added = prepared.add_between(cell, place.at)?;
        let point = &mut prepared.points[added];
        // The force of the row replaces that of the segment.
        if let Some(force) = row.force_n {
            point.set_force(force.into());
        }
        let cut = row.force();
        point.time = cut.time.unwrap_or(point.time);
        point.temperature = cut.temperature.or(point.temperature);
        point.payload = cut.payload.unwrap_or(point.payload);
        let way_from = place.at.target.checked_sub(1).filter(|_| place.at.share < 1.0);
        Ok(Placed { point: added, way_from })
    }

    /// The place nearest to a point.
    ///
    /// # Errors
    /// The point is far from the path, or almost as near to another stretch of it.
    fn nearest(&self, nominal_mm: &Vector3<f64>) -> Result<PathPosition, String> {
        /// Difference up to which two distances are alike: mm, and as a share of the smaller distance. The larger of
        /// the two counts.
        const ALIKE: (f64, f64) = (0.1, 0.25);
        let mut near: Vec<PathPosition> = (0..self.ends.len())
            .map(|i| self.on_way(i, nominal_mm))
            .filter(|place| place.off_mm <= self.match_mm)
            .collect();
        near.sort_by(|a, b| a.off_mm.total_cmp(&b.off_mm));
        let Some(&best) = near.first() else {
            let off = (0..self.ends.len()).map(|i| self.on_way(i, nominal_mm).off_mm).fold(f64::INFINITY, f64::min);
            return Err(format!(
                "the nominal point lies {off:.2} mm from the path, and rows within {} mm are taken",
                self.match_mm
            ));
        };
        let limit = best.off_mm + ALIKE.0.max(ALIKE.1 * best.off_mm);
        let apart = |place: &&PathPosition| (place.along_mm - best.along_mm).abs() > 2.0 * self.match_mm;
        match near.iter().take_while(|place| place.off_mm <= limit).find(apart) {
            Some(other) => Err(format!(
                "the nominal point is as near to the path to target {} ({:.2} mm) as to the path to target {} ({:.2} mm): name the target",
                self.program.targets[best.at.target].ordinal,
                best.off_mm,
                self.program.targets[other.at.target].ordinal,
                other.off_mm
            )),
            None => Ok(best),
        }
    }

    /// The nearest place on the segment that ends at a target.
    fn on_way(&self, target: usize, nominal_mm: &Vector3<f64>) -> PathPosition {
        let (end, here) = (self.ends[target], &self.program.targets[target]);
        let straight =
            |before: &usize| here.motion == Motion::Linear && self.program.targets[*before].wobj == here.wobj;
        let before = target.checked_sub(1).filter(straight);
        let share = before.map_or(1.0, |before| {
            let way = end - self.ends[before];
            let square = way.norm_squared();
            if square > 0.0 { ((nominal_mm - self.ends[before]).dot(&way) / square).clamp(0.0, 1.0) } else { 1.0 }
        });
        let from = before.map_or(end, |before| self.ends[before]);
        let place = from + (end - from) * share;
        let length = (end - from).norm();
        PathPosition {
            at: Between { target, share },
            off_mm: (place - nominal_mm).norm(),
            along_mm: self.along_mm[target] - (1.0 - share) * length,
        }
    }
}

/// An error about the place of a row, and how to correct it.
pub(super) fn misplaced(table: &Table, line: u64, message: String) -> Diagnostic {
    table.row_error(line, message).help("check the work object of the points, name `target`, or give --match-mm")
}
