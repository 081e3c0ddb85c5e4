//! `[stock]` and `[part]`: the blank that a program cuts, and what is to come of it.

use super::check::Check;
use super::{Cell, raw};
use crate::limits::{STL_REACH_MM, STL_TRIANGLES};
use crate::stock::{Blank, ClosedMesh, read_stl};
use crate::text::{Diagnostic, Source};
use nalgebra::Vector3;
use std::sync::Arc;

/// `[stock]`.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StockSection {
    /// Work object in whose axes it is given; without one, the first that cuts.
    pub wobj: Option<String>,
    /// The blank, m; `None` of a mesh that has not been read, see [`Cell::take_meshes`].
    pub blank: Option<Blank>,
    /// The file of the blank, beside the cell file.
    pub stl: Option<String>,
    /// Spacing of the stock's lines, m; without it, from the smallest cutter.
    pub resolution: Option<f64>,
}

/// `[part]`: the nominal part, in the stock's axes.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PartSection {
    /// Its file, beside the cell file.
    pub stl: String,
    /// The mesh, once it has been read, see [`Cell::take_meshes`].
    pub mesh: Option<Arc<ClosedMesh>>,
}

impl Cell {
    /// Reads the meshes that `[stock] stl` and `[part] stl` name; `read` gives a file beside the cell file.
    ///
    /// # Errors
    /// What `read` says; files that are no STL, or are not closed.
    pub fn take_meshes<R>(&mut self, mut read: R) -> Result<(), Vec<Diagnostic>>
    where
        R: FnMut(&str) -> Result<Source, Vec<Diagnostic>>,
    {
        let mut mesh = |name: &str| -> Result<Arc<ClosedMesh>, Vec<Diagnostic>> {
            let source = read(name)?;
            let fail = |message: String, help: &str| vec![Diagnostic::error("stl", &source.name, message).help(help)];
            let triangles = read_stl(&source.bytes)
                .map_err(|error| fail(error.to_string(), "export the mesh as STL, binary or text, in millimetres"))?;
            let most = 1e3 * triangles.iter().flatten().fold(0.0_f64, |most, corner| most.max(corner.amax()));
            for (bound, count) in [(STL_TRIANGLES, triangles.len() as f64), (STL_REACH_MM, most)] {
                bound.exceeded(count).map_or(Ok(()), |over| Err(fail(over, bound.help)))?;
            }
            let closed = ClosedMesh::new(&triangles)
                .map_err(|error| fail(error.to_string(), "repair the mesh: each edge belongs to two triangles"))?;
            Ok(Arc::new(closed))
        };
        if let Some(stock) = &mut self.stock
            && let Some(name) = &stock.stl
        {
            stock.blank = Some(Blank::Mesh(mesh(name)?));
        }
        if let Some(part) = &mut self.part {
            part.mesh = Some(mesh(&part.stl)?);
        }
        Ok(())
    }
}

pub(super) fn stock(check: &mut Check, raw: &raw::Stock) -> Option<StockSection> {
    if let Some(resolution) = raw.resolution_mm {
        check.positive("stock.resolution_mm", &[resolution]);
    }
    let section = |blank: Option<Blank>| StockSection {
        wobj: raw.wobj.clone(),
        blank,
        stl: raw.stl.clone(),
        resolution: raw.resolution_mm.map(|resolution| 1e-3 * resolution),
    };
    if raw.stl.is_some() {
        if raw.box_mm.is_some() {
            check.error("stock.stl", "[stock] has both box_mm and stl: the blank is one of them", "remove the other");
        }
        return Some(section(None));
    }
    let corners =
        check.need("stock", "box_mm", raw.box_mm, "the blank's lower and upper corner, or stl = \"blank.stl\"")?;
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
    Some(section(Some(Blank::Box([low, high]))))
}
