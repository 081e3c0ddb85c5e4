//! `[stock]`: the blank that a program cuts.

use super::check::Check;
use super::raw;
use crate::stock::Blank;
use nalgebra::Vector3;

/// `[stock]`.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StockSection {
    /// Work object in whose axes it is given; without one, the first that cuts.
    pub wobj: Option<String>,
    /// The blank, m.
    pub blank: Blank,
    /// Spacing of the stock's lines, m; without it, from the smallest cutter.
    pub resolution: Option<f64>,
}

pub(super) fn stock(check: &mut Check, raw: &raw::Stock) -> Option<StockSection> {
    let corners = check.need("stock", "box_mm", raw.box_mm, "the blank's lower and upper corner")?;
    for corner in corners {
        check.finite("stock.box_mm", &corner);
    }
    let [low, high] = corners.map(|corner| Vector3::from(corner) * 1e-3);
    if (0..3).any(|k| high[k] <= low[k]) {
        check.error(
            "stock.box_mm",
            "stock.box_mm is no box: the second corner must be above the first in x, y and z",
            "give [[xmin, ymin, zmin], [xmax, ymax, zmax]]",
        );
    }
    if let Some(resolution) = raw.resolution_mm {
        check.positive("stock.resolution_mm", &[resolution]);
    }
    Some(StockSection {
        wobj: raw.wobj.clone(),
        blank: Blank::Box([low, high]),
        resolution: raw.resolution_mm.map(|resolution| 1e-3 * resolution),
    })
}
