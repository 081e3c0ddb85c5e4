//! Reads `[stock]` and `[part]`: the blank that a program cuts, and the part that it is to become.

use super::check::Check;
use super::{Cell, raw};
use deflex_elastic::{Clamp, Material};
use deflex_stock::{Blank, ClosedMesh, read_stl};
use deflex_text::limits::{STL_REACH_MM, STL_TRIANGLES};
use deflex_text::{Diagnostic, Source};
use nalgebra::Vector3;
use std::sync::Arc;

/// The `[stock]` table.
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/stock/cell.toml")?))?;
/// assert!(cell.stock.expect("a [stock] table").blank.is_some());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StockSection {
    /// Work object in whose frame the blank is given; `None` takes the first one in which the program cuts.
    pub wobj: Option<String>,
    /// The blank, m; `None` for a mesh before [`Cell::take_meshes`] has read it.
    pub blank: Option<Blank>,
    /// File of the blank's mesh, relative to the cell file.
    pub stl: Option<String>,
    /// Spacing of the stock's lines, m; `None` chooses it from the smallest cutter.
    pub resolution: Option<f64>,
}

/// The `[part]` table: the nominal part, in the frame of the stock.
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/wall/cell.toml")?))?;
/// println!("mesh of the part: {:?}", cell.part.expect("a [part] table").stl);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PartSection {
    /// File of the part's mesh, relative to the cell file, if it has one.
    pub stl: Option<String>,
    /// Material and clamps of the part, from which its deflection is computed; `None` if the cell states none.
    #[doc(hidden)]
    pub held: Option<HeldPart>,
    /// The mesh, after [`Cell::take_meshes`] has read it.
    pub mesh: Option<Arc<ClosedMesh>>,
}

/// The tables `[part.material]` and `[[part.clamp]]`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[doc(hidden)]
pub struct HeldPart {
    /// Young's modulus (N/mm²) and Poisson's ratio.
    pub material: Material,
    /// Clamps in the frame of the stock, mm and N/mm.
    pub clamps: Vec<Clamp>,
    /// Size of the finite elements, mm; `None` chooses it from the blank.
    pub cell_mm: Option<f64>,
    /// Largest number of stages of the stock for which the stiffness is computed.
    pub stages: usize,
}

impl Cell {
    /// Reads the meshes that `[stock] stl` and `[part] stl` name. `read` returns a file whose name is relative to the
    /// cell file.
    ///
    /// # Errors
    /// Every error of `read`; files that are not STL, or whose mesh is not closed.
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
        if let Some(part) = &mut self.part
            && let Some(name) = &part.stl
        {
            part.mesh = Some(mesh(name)?);
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
            "stock.box_mm is not a box: the second corner must be above the first in x, y and z",
            "give [[xmin, ymin, zmin], [xmax, ymax, zmax]]",
        );
    }
    Some(section(Some(Blank::Box([low, high]))))
}

/// Default number of stages: the computation takes about ten seconds.
const STAGES: usize = 6;
/// At least one stage at the beginning and one at the end. Beyond the largest number, successive stages differ less
/// than the stock does between neighbouring places of one stage.
const STAGES_RANGE: std::ops::RangeInclusive<usize> = 2..=60;

/// Reads `[part]`. `stock` is the `[stock]` table, if the cell has one.
pub(super) fn part(check: &mut Check, raw: raw::Part, stock: Option<&raw::Stock>) -> PartSection {
    let raw::Part { stl, cell_mm, stages, material, clamp } = raw;
    if stl.is_none() && material.is_none() {
        check.error(
            "part",
            "[part] says neither what the part looks like nor what it is made of",
            "add stl = \"part.stl\", or [part.material] with e_n_mm2 and nu",
        );
    }
    if let Some(cell) = cell_mm {
        check.positive("part.cell_mm", &[cell]);
        if material.is_none() {
            check.error(
                "part.cell_mm",
                "[part] cell_mm without [part.material] has no effect",
                "add [part.material], or remove cell_mm",
            );
        }
    }
    let count = stages.unwrap_or(STAGES);
    if !STAGES_RANGE.contains(&count) {
        let (least, most) = (STAGES_RANGE.start(), STAGES_RANGE.end());
        check.error(
            "part.stages",
            format!("part.stages is {count}, expected {least} to {most}"),
            "leave it out, or give a number in that range",
        );
    } else if stages.is_some() && material.is_none() {
        check.error(
            "part.stages",
            "[part] stages without [part.material] has no effect",
            "add [part.material], or remove stages",
        );
    }
    let held = held(check, material, &clamp, stock).map(|held| HeldPart { cell_mm, stages: count, ..held });
    PartSection { stl, held, mesh: None }
}

/// Reads the material and the clamps of the part.
fn held(
    check: &mut Check,
    material: Option<raw::PartMaterial>,
    raw: &[raw::PartClamp],
    stock: Option<&raw::Stock>,
) -> Option<HeldPart> {
    let Some(material) = material else {
        if !raw.is_empty() {
            check.error(
                "part.clamp",
                "[[part.clamp]] holds a part of which [part.material] does not say what it is made of",
                "add [part.material] with e_n_mm2 (Young's modulus) and nu (Poisson's ratio)",
            );
        }
        return None;
    };
    check.positive("part.material.e_n_mm2", &[material.e_n_mm2]);
    if !(0.0..0.5).contains(&material.nu) {
        check.error(
            "part.material.nu",
            format!("part.material.nu = {} cannot be a Poisson's ratio", material.nu),
            "give a number from 0 to below 0.5: 0.3 for steel, 0.33 for aluminium",
        );
    }
    if stock.is_none() {
        check.error(
            "part.material",
            "[part.material] needs [stock]: by how much the part yields follows from what is left of the blank",
            "add [stock] with box_mm or stl",
        );
    }
    if raw.is_empty() {
        check.error(
            "part.material",
            "[part.material] without [[part.clamp]]: nothing holds the part",
            "add [[part.clamp]] with box_mm and stiffness_n_per_mm = [inf, inf, inf] where the part is held",
        );
    }
    let mut clamps = Vec::new();
    for (n, clamp) in raw.iter().enumerate() {
        let key = format!("part.clamp.{n}.box_mm");
        clamp.box_mm.iter().for_each(|corner| check.finite(&key, corner));
        let [low, high] = clamp.box_mm;
        if (0..3).any(|k| high[k] < low[k]) {
            check.error(
                &key,
                format!("[[part.clamp]] number {}: the second corner of box_mm is below the first", n + 1),
                "give [[xmin, ymin, zmin], [xmax, ymax, zmax]]; a face may have no thickness",
            );
        }
        if let Some([blank_low, blank_high]) = stock.and_then(|stock| stock.box_mm)
            && (0..3).any(|k| high[k] < blank_low[k] || low[k] > blank_high[k])
        {
            check.error(
                &key,
                format!("[[part.clamp]] number {} is outside of the blank: it holds nothing", n + 1),
                "give box_mm of the clamp in the axes of [stock], like box_mm of the blank",
            );
        }
        let key = format!("part.clamp.{n}.stiffness_n_per_mm");
        if clamp.stiffness_n_per_mm.iter().any(|k| k.is_nan() || *k < 0.0) {
            check.error(
                &key,
                format!("[[part.clamp]] number {}: a stiffness is below zero or no number", n + 1),
                "give N/mm along x, y and z: inf where it is rigid, 0 where it slides",
            );
        } else if clamp.stiffness_n_per_mm.iter().all(|k| *k <= 0.0) {
            check.error(
                &key,
                format!("[[part.clamp]] number {} holds nothing: its stiffness is zero in all directions", n + 1),
                "give N/mm along x, y and z, inf where it is rigid; or remove the clamp",
            );
        }
        clamps.push(Clamp { bounds: clamp.box_mm, stiffness: clamp.stiffness_n_per_mm });
    }
    Some(HeldPart {
        material: Material { e: material.e_n_mm2, nu: material.nu },
        clamps,
        cell_mm: None,
        stages: STAGES,
    })
}
