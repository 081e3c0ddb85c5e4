//! The material that a sweep removes from the lines.

use super::band::Band;
use super::lattice::{Lattice, turned};
use super::line::LEAST_CUT;
use super::solid::Solid;
use super::sweep::{Cut, Distance, Sweep};
use nalgebra::Vector3;
use std::ops::Range;

impl Band {
    /// Removes a cut from the band's lines. Returns the removed length of all lines, m.
    pub(super) fn take(&mut self, lattice: &Lattice, cut: &Cut) -> f64 {
        let own = self.rows();
        let rows = own.start.max(cut.rows.start)..own.end.min(cut.rows.end);
        match (rows.is_empty(), cut.sweep.upright) {
            (true, _) => 0.0,
            (false, true) => self.take_upright(lattice, cut, rows),
            (false, false) => self.take_any(lattice, cut, rows),
        }
    }

    /// Cuts with a cutter whose axis is parallel to the lines.
    fn take_upright(&mut self, lattice: &Lattice, cut: &Cut, rows: Range<usize>) -> f64 {
        let (sweep, columns) = (&cut.sweep, &cut.columns);
        let (solid, spacing) = (sweep.solid, lattice.spacing);
        let [u, v] = turned(sweep.start.tip.x, sweep.start.tip.y);
        let displacement = sweep.end.tip - sweep.start.tip;
        let [du, dv] = turned(displacement.x, displacement.y);
        let square = du * du + dv * dv;
        let per_square = if square > 0.0 { 1.0 / square } else { 0.0 };
        let reach = (solid.radius + spacing) * (solid.radius + spacing);
        let tip = sweep.start.tip.z - lattice.origin[2];
        let rise = sweep.end.tip.z - sweep.start.tip.z;
        // On a descending motion, the bottom cuts on both sides of the plane through the tip.
        let ahead = (cut.continues && rise >= 0.0).then_some([du, dv]);
        let blank_top = lattice.blank.bounds()[1].z - lattice.origin[2];
        let lowest = tip + rise.min(0.0);
        let mut removed = 0.0;
        for j in rows {
            let from_v = lattice.origin[1] + (j as f64 + 0.5) * spacing - v;
            for i in lattice.ahead_in_row(columns, ahead, from_v, u) {
                if self.line(i, j).is_some_and(|line| line.lies_under(lowest)) {
                    continue;
                }
                let from_u = lattice.origin[0] + (i as f64 + 0.5) * spacing - u;
                let share = (from_u * du + from_v * dv) * per_square;
                // Nearest to the start: the sweep before has removed that.
                if ahead.is_some() && share <= 0.0 {
                    continue;
                }
                let share = share.clamp(0.0, 1.0);
                let (ru, rv) = (from_u - share * du, from_v - share * dv);
                let nearest = ru * ru + rv * rv;
                if nearest >= reach {
                    continue;
                }
                let across = nearest.sqrt();
                let meets = across < solid.radius;
                // The surface is no lower than that of the lower end at the smallest distance.
                let least = if meets { tip + rise.min(0.0) + solid.height(across) } else { f64::INFINITY };
                if least > blank_top + spacing && meets {
                    continue;
                }
                let (line, history) = self.line_mut(lattice, i, j);
                let Some(top) = line.top() else { continue };
                let (share, across) = if rise == 0.0 || !meets || least >= top - LEAST_CUT {
                    (share, across)
                } else {
                    lowest_of_ramp(&solid, [from_u, from_v], [du, dv], rise, share)
                };
                let tip = tip + share * rise;
                let low = if across < solid.radius { tip + solid.height(across) } else { f64::INFINITY };
                if low < top - LEAST_CUT {
                    removed += history.cut(line, low, f64::INFINITY, cut);
                } else if tip < top + spacing && !line.is_touched() {
                    let distance = solid.distance(across, top - tip);
                    if distance < spacing {
                        history.pass(line, distance, cut);
                    }
                }
            }
        }
        removed
    }

    /// Cuts with any cutter on any motion.
    fn take_any(&mut self, lattice: &Lattice, cut: &Cut, rows: Range<usize>) -> f64 {
        let (sweep, columns) = (&cut.sweep, &cut.columns);
        let bottom = lattice.origin[2];
        let spine = sweep.spine(lattice.blank.bounds()[1].z);
        let lowest = spine.iter().fold(f64::INFINITY, |z, p| z.min(p.z)) - 1.01 * sweep.solid.radius;
        let lowest = lowest - 1e-3;
        let ahead = sweep.ahead().filter(|_| cut.continues);
        let tip = sweep.start.tip;
        // Seen from above: lines that are on the near side of the plane at every height are left out with their row, and so are lines out of
        // reach.
        let plane = ahead.map(|ahead| {
            let over = [lowest, lattice.blank.bounds()[1].z].map(|z| ahead.z * (z - tip.z));
            let displacement = turned(ahead.x, ahead.y);
            let back = over[0].max(over[1])
                / (displacement[0] * displacement[0] + displacement[1] * displacement[1]).max(f64::MIN_POSITIVE);
            let [u, v] = turned(tip.x, tip.y);
            (displacement, [u - displacement[0] * back, v - displacement[1] * back])
        });
        let centre = spine.iter().fold(Vector3::zeros(), |sum, point| sum + point / spine.len() as f64);
        let from_axis = |point: &Vector3<f64>| (point.x - centre.x).hypot(point.y - centre.y);
        let reach = spine.iter().map(from_axis).fold(0.0, f64::max) + sweep.solid.radius + lattice.spacing;
        let [centre_u, centre_v] = turned(centre.x, centre.y);
        let mut removed = 0.0;
        for j in rows {
            let v = lattice.origin[1] + (j as f64 + 0.5) * lattice.spacing;
            let half = (reach * reach - (v - centre_v).powi(2)).max(0.0).sqrt();
            let column = |u: f64| ((u - lattice.origin[0]) / lattice.spacing - 0.5).max(0.0);
            let first = columns.start.max(column(centre_u - half).floor() as usize);
            let end = columns.end.min(column(centre_u + half).ceil() as usize + 1);
            let columns = match &plane {
                Some((displacement, [plane_u, plane_v])) => {
                    lattice.ahead_in_row(&(first..end), Some(*displacement), v - plane_v, *plane_u)
                }
                None => first..end,
            };
            // The height at which the line before was entered: the next one is entered nearby.
            let mut last: Option<f64> = None;
            for i in columns {
                let [x, y] = lattice.place(i, j);
                let top = match self.line(i, j) {
                    Some(line) => line.top(),
                    None => lattice.uncut(i, j).top(),
                };
                let Some(top) = top else { continue };
                if let Some(ahead) = &ahead {
                    let side = |z: f64| ahead.dot(&(Vector3::new(x, y, z) - sweep.start.tip));
                    if side(top + bottom) < 0.0 && side(lowest) < 0.0 {
                        continue;
                    }
                }
                let at_top = sweep.distance_along_z(&Vector3::new(x, y, top + bottom));
                if at_top.value > 0.0 {
                    if at_top.value < lattice.spacing {
                        let (line, history) = self.line_mut(lattice, i, j);
                        history.pass(line, at_top.value, cut);
                    }
                    // The cutter is above the top, or next to the line.
                    if at_top.slope <= 0.0 {
                        continue;
                    }
                }
                // From the top first: most lines next to a leaning cutter do not meet it, which shows after few steps.
                let high = if at_top.value <= 0.0 {
                    f64::INFINITY
                } else {
                    match enter(sweep, [x, y], top + bottom, -1.0) {
                        Some(high) => high - bottom,
                        None => continue,
                    }
                };
                let near = last.map(|z| z - lattice.spacing).filter(|z| *z > lowest);
                let near = near.filter(|z| sweep.distance_along_z(&Vector3::new(x, y, *z)).value > 0.0);
                let Some(low) = enter(sweep, [x, y], near.unwrap_or(lowest), 1.0) else { continue };
                last = Some(low);
                let (line, history) = self.line_mut(lattice, i, j);
                removed += history.cut(line, low - bottom, high, cut);
            }
        }
        removed
    }
}

impl Lattice {
    /// The columns of a row that are ahead of a plane through a point at `u`; the sweep before has removed the others. The row is
    /// `from_v` away from the point.
    fn ahead_in_row(
        &self,
        columns: &Range<usize>,
        displacement: Option<[f64; 2]>,
        from_v: f64,
        u: f64,
    ) -> Range<usize> {
        let Some([du, dv]) = displacement else { return columns.clone() };
        if du.abs() <= 1e-6 * dv.abs() {
            return if from_v * dv < -self.spacing * dv.abs() { 0..0 } else { columns.clone() };
        }
        // from_u·du + from_v·dv = 0, and one more line for the rounding.
        let edge = (u - from_v * dv / du - self.origin[0]) / self.spacing - 0.5;
        if du > 0.0 {
            columns.start.max((edge - 1.0).max(0.0) as usize)..columns.end
        } else {
            columns.start..columns.end.min((edge + 2.0).max(0.0) as usize)
        }
    }
}

/// The share of a ramp at which an upright cutter is lowest over a point, and the distance of the axis there, m. `nearest` is the share at
/// which the axis is nearest to the point.
///
/// The height is convex along the ramp. The zero of its derivative is found by false position, with halving where that is slow.
fn lowest_of_ramp(solid: &Solid, from: [f64; 2], displacement: [f64; 2], rise: f64, nearest: f64) -> (f64, f64) {
    let across = |share: f64| (from[0] - share * displacement[0]).hypot(from[1] - share * displacement[1]);
    let flat = solid.flat();
    let slope = |share: f64| {
        let rho = across(share);
        let out = rho - flat;
        if out <= 0.0 {
            return rise;
        }
        let towards = -((from[0] - share * displacement[0]) * displacement[0]
            + (from[1] - share * displacement[1]) * displacement[1])
            / rho;
        let under = solid.corner * solid.corner - out * out;
        // On the cylinder the surface is vertical.
        if under <= 0.0 { 1e6 * towards } else { rise + out / under.sqrt() * towards }
    };
    // Downhill from the nearest point, where the cutter's own height is least.
    let mut low = nearest;
    let mut high = if rise < 0.0 { 1.0 } else { 0.0 };
    let mut at_low = slope(low) * (high - low);
    let at_high = slope(high) * (high - low);
    if at_low >= 0.0 {
        return (low, across(low));
    }
    if at_high <= 0.0 {
        return (high, across(high));
    }
    let mut at_high = at_high;
    const BRACKETINGS: usize = 12;
    for round in 0..BRACKETINGS {
        let share = if round % 2 == 1 { 0.5 } else { (at_low / (at_low - at_high)).clamp(0.01, 0.99) };
        let middle = low + (high - low) * share;
        let at = slope(middle) * (high - low);
        if at < 0.0 {
            (low, at_low) = (middle, at);
        } else {
            (high, at_high) = (middle, at);
        }
    }
    let there = 0.5 * (low + high);
    (there, across(there))
}

/// Height at which a line along z enters a sweep, from a height outside; `None` if it misses the sweep.
///
/// The distance is convex along the line. Newton's steps therefore approach the first intersection from outside and never pass it.
fn enter(sweep: &Sweep, [x, y]: [f64; 2], from: f64, upwards: f64) -> Option<f64> {
    const NEWTON_STEPS: usize = 40;
    /// A distance below this is an intersection, m.
    const THERE: f64 = 1e-9;
    let mut z = from;
    for _ in 0..NEWTON_STEPS {
        let Distance { value, slope } = sweep.distance_along_z(&Vector3::new(x, y, z));
        if value <= THERE {
            return Some(z);
        }
        // The distance no longer decreases.
        if slope * upwards >= -1e-6 {
            return None;
        }
        z -= value / slope;
    }
    None
}
