use super::{ProgramFiles, Run};
use crate::session::report::pretty;
use crate::session::setup::Setup;
use deflex::correct::{CutProgress, Cuts, Options, Removal, cut_stock};
use deflex::program::Program;
use deflex::report::html::simulation_page;
use deflex::report::{CutterAt, DeviationMap, MapFigures, SurfacePoint, map_cell, map_csv, stl};
use deflex::stock::{Blank, Stock};
use deflex::text::Diagnostic;
use deflex::text::number::fixed;
use serde_json::{Value, json};
use std::sync::Arc;

/// Receives the share of a simulation's cuts that is done; returning `false` cancels the run.
pub type SimulationProgress = dyn Fn(f64) -> bool + Send + Sync;

/// Largest number of triangles on a page, approximately: a plain canvas draws that many in a tenth of a second.
const PAGE_TRIANGLES: f64 = 40_000.0;

/// The part that the loaded arm leaves of the stock, compared with the intended part.
///
/// # Examples
/// ```
/// use deflex::session::Simulated;
/// use deflex::text::Diagnostics;
///
/// /// Writes the mesh, the page, the table of deviations and the figures of a part, and returns its deepest gouge, mm.
/// fn write(part: &Simulated) -> Result<Option<f64>, Diagnostics> {
///     std::fs::write("part.stl", part.stl())?;
///     std::fs::write("part.html", part.page())?;
///     std::fs::write("deviations.csv", part.csv())?;
///     std::fs::write("part.json", part.json()?)?;
///     print!("{}", part.text());
///     Ok(part.points().iter().map(|point| point.deviation_mm).min_by(f64::total_cmp))
/// }
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Simulated {
    name: String,
    cell: String,
    programmed: Removal,
    /// The nominal part, if the cell has one. It replaces the programmed part as the intended one.
    nominal: Option<Stock>,
    /// The part cut by the original, if one is given, and the part cut by the program; each with its name in reports.
    actual: Vec<(&'static str, Removal)>,
    maps: Vec<(&'static str, DeviationMap)>,
    figures: Vec<(&'static str, MapFigures)>,
    /// The cutter at the worst place of each map.
    cutters: Vec<Option<CutterAt>>,
    /// Warnings and notes of the command.
    pub notes: Vec<Diagnostic>,
}

/// Cuts the cell's stock with the poses that the loaded arm takes, as `deflex simulate` does. `against` is the original
/// of a corrected program. `progress` receives the share of the cuts that is done, 0 to 1, and cancels the run by
/// returning `false`.
///
/// # Errors
/// Every error for which the command ends with exit code 2, and `run.called-off` after a cancellation.
///
/// # Examples
/// ```no_run
/// use deflex::session::{CellFile, ProgramFiles, Run, SimulationProgress, simulate};
/// use std::sync::Arc;
///
/// let run = Run::new(CellFile::read("samples/stock/cell.toml".as_ref())?.into());
/// let program = ProgramFiles::read(&["samples/stock/part.mod".into()], &[], None)?;
/// let progress: Arc<SimulationProgress> = Arc::new(|_| true);
/// let part = simulate(&program, None, &run, &progress)?;
/// std::fs::write("part.stl", part.stl())?;
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn simulate(
    program: &ProgramFiles,
    against: Option<&ProgramFiles>,
    run: &Run,
    progress: &Arc<SimulationProgress>,
) -> Result<Simulated, Vec<Diagnostic>> {
    let original = against.map(|original| run.parse(original)).transpose()?;
    let parsed = run.parse(program)?;
    let simulated = Simulated::of(program.name(), &parsed, original.as_ref(), &run.setup, progress)?;
    let mut notes = run.setup.cell.own(run.setup.notes());
    notes.extend(simulated.notes);
    Ok(Simulated { notes, ..simulated })
}

impl Simulated {
    pub(crate) fn of(
        name: &str,
        program: &Program,
        original: Option<&Program>,
        setup: &Setup,
        progress: &Arc<SimulationProgress>,
    ) -> Result<Self, Vec<Diagnostic>> {
        let cuts = if original.is_some() { 3.0 } else { 2.0 };
        let cut = |done: f64, program: &Program, against: Option<&Program>, how: Cuts| {
            let progress = Arc::clone(progress);
            let cut_progress = CutProgress::new(move |share| progress((done + share) / (cuts + 1.0)));
            let options = Options { cut_progress, ..setup.options.clone() };
            cut_stock(program, &setup.cell.cell, &options, against, how).map_err(|errors| setup.cell.own(errors))
        };
        let programmed = cut(0.0, original.unwrap_or(program), None, Cuts::Programmed)?;
        let mut actual = Vec::new();
        if let Some(original) = original {
            actual.push(("before", cut(1.0, original, None, Cuts::Driven)?));
        }
        let last = if original.is_some() { "after" } else { "as it is" };
        let mut last_cut = cut(cuts - 1.0, program, original, Cuts::Driven)?;
        let notes = std::mem::take(&mut last_cut.notes);
        actual.push((last, last_cut));
        // A part is a stock that has not been cut.
        let nominal = setup.cell.cell.part.as_ref().and_then(|part| part.mesh.clone());
        let nominal = nominal.map(|mesh| Stock::new(Blank::Mesh(mesh), programmed.stock.spacing()));
        let (name, cell) = (name.to_owned(), setup.cell.name.clone());
        let (maps, figures, cutters) = (Vec::new(), Vec::new(), Vec::new());
        let mut simulated = Self { name, cell, programmed, nominal, actual, maps, figures, cutters, notes };
        simulated.maps = simulated.maps(1.0);
        simulated.figures = simulated.maps.iter().map(|(name, map)| (*name, map.figures())).collect();
        let intended = original.unwrap_or(program);
        let wobj = &simulated.programmed.wobj;
        let cutter = |(_, map): &(_, DeviationMap)| CutterAt::worst(map, intended, &setup.cell.cell, wobj);
        simulated.cutters = simulated.maps.iter().map(cutter).collect();
        Ok(simulated)
    }

    /// Deviations on a mesh whose triangles are larger than usual by a factor.
    fn maps(&self, larger: f64) -> Vec<(&'static str, DeviationMap)> {
        let intended = self.nominal.as_ref().unwrap_or(&self.programmed.stock);
        let mesh = intended.surface(map_cell(&self.programmed.stock) * larger);
        let blank = self.programmed.stock.blank();
        let map = |removal: &Removal| DeviationMap::new(mesh.clone(), intended, blank, &removal.stock);
        self.actual.iter().map(|(name, removal)| (*name, map(removal))).collect()
    }

    /// The stock that the program leaves.
    #[must_use]
    pub(crate) fn removal(&self) -> &Removal {
        // `of` always adds one.
        self.actual.last().map_or(&self.programmed, |(_, removal)| removal)
    }

    /// Points of the cut surface with their deviations, mm.
    #[must_use]
    pub fn points(&self) -> Vec<SurfacePoint> {
        self.maps.last().map(|(_, map)| map.points()).unwrap_or_default()
    }

    /// The table that `--report` writes.
    #[must_use]
    pub fn csv(&self) -> Vec<u8> {
        map_csv(&self.points())
    }

    /// The binary STL that `--stl` writes.
    #[must_use]
    pub fn stl(&self) -> Vec<u8> {
        stl(&self.removal().stock.surface(map_cell(&self.programmed.stock)))
    }

    /// The page that `--html` writes.
    #[must_use]
    pub fn page(&self) -> String {
        let triangles = self.maps.last().map_or(0, |(_, map)| map.programmed.triangles.len());
        let maps = self.maps((triangles as f64 / PAGE_TRIANGLES).sqrt().max(1.0));
        simulation_page(&self.name, &self.cell, &maps, &self.figures, &self.cutters)
    }

    /// The text that the command prints.
    #[must_use]
    pub fn text(&self) -> String {
        let row = |(which, f): &(&str, MapFigures)| {
            format!(
                "  {which:9} {:>8} {:>8} {:>8} {:>14} {:>10} % {:>15} {:>10} %\n",
                fixed(f.rms_mm, 4),
                fixed(f.mean_mm, 4),
                fixed(f.max_mm, 4),
                fixed(f.gouge.max_mm, 4),
                fixed(100.0 * f.gouge.share, 1),
                fixed(f.leftover.max_mm, 4),
                fixed(100.0 * f.leftover.share, 1)
            )
        };
        let rows: String = self.figures.iter().map(row).collect();
        format!(
            "{}: deviation of the surface, mm\n  {:9} {:>8} {:>8} {:>8} {:>14} {:>12} {:>15} {:>12}\n{rows}",
            self.name, "", "rms", "mean", "max", "deepest gouge", "of surface", "most left over", "of surface"
        )
    }

    /// The text that `--json` writes.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn json(&self) -> Result<String, Vec<Diagnostic>> {
        pretty(&self.summary())
    }

    pub(crate) fn summary(&self) -> Value {
        let figures = &self.figures;
        let of = |wanted: &str| figures.iter().find(|(name, _)| *name == wanted).map(|(_, figures)| *figures);
        let after = figures.last().map(|(_, figures)| *figures).unwrap_or_default();
        let mm3 = |volume: f64| 1e9 * volume;
        let left = &self.removal().stock;
        json!({
            "path": self.name,
            "resolution_mm": 1e3 * self.programmed.stock.spacing(),
            "removed_programmed_mm3": mm3(self.programmed.stock.removed()),
            "removed_mm3": mm3(left.removed()),
            "left_mm3": mm3(left.volume()),
            "rms_mm": after.rms_mm,
            "mean_mm": after.mean_mm,
            "mean_signed_mm": after.mean_signed_mm,
            "max_mm": after.max_mm,
            "points": after.points,
            "gouge": after.gouge,
            "leftover": after.leftover,
            "before": of("before"),
            "after": after,
        })
    }
}
