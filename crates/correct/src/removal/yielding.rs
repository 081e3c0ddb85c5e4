//! The compliance of the clamped part where it is cut, which follows the stock as material is removed.
//!
//! The state of the stock is stored from time to time along the programmed path. Each state is a stage: a solid of cells, whose compliance
//! is computed at the points that are cut between the stage before and the stage after it. At a target, the compliance is interpolated
//! between the stages before and after it, by the removed volume.

use super::super::Prepared;
use super::super::point::{Milled, tool_axis};
use super::Walk;
use deflex_cell::HeldPart;
use deflex_effects::{MOST_CLAMPS, PartYield};
use deflex_elastic::{Accuracy, Body, ClampMotions, ComplianceMap, Grid, HoldError, Solid};
use deflex_stock::Stock;
use deflex_text::{Diagnostic, Severity};
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use std::sync::Arc;

/// Number of cells over the blank without `cell_mm`: a stage takes some seconds.
const CELLS: f64 = 12_000.0;
/// Most cells over the blank: 2 GB, and minutes a stage.
const MOST_CELLS: f64 = 500_000.0;
/// Walls thinner than the first number of cells may get another thickness; a warning is given if more than the second share of the cells is
/// in such walls.
const THIN: (f64, f64) = (1.0, 0.02);
/// The state of the stock is stored when this share of the remaining volume, over the number of stages, has been removed: some three states
/// for each stage if two thirds of the blank are removed.
const GONE: f64 = 0.36;

/// The states of the stock from time to time.
pub(super) struct Stages {
    held: HeldPart,
    snapshots: Vec<Snapshot>,
}

/// The state of the stock at a moment.
struct Snapshot {
    /// Volume removed up to then, m³.
    removed: f64,
    solid: Solid,
}

/// A target at which the part is cut.
struct Cut {
    target: usize,
    /// Volume removed up to it, m³.
    removed: f64,
    /// Point where the force acts, mm, stock's axes.
    place: [f64; 3],
    /// Point of the face whose error counts, where the cutter leaves it, mm, stock's axes.
    face: [f64; 3],
}

impl Stages {
    pub(super) fn new(held: &HeldPart) -> Self {
        Self { held: held.clone(), snapshots: Vec::new() }
    }

    /// Size of the cells over a blank, mm.
    fn cell(&self, low: &Vector3<f64>, high: &Vector3<f64>) -> f64 {
        self.held.cell_mm.unwrap_or_else(|| ((high - low).product() / CELLS).cbrt())
    }

    /// Refuses too many cells.
    pub(super) fn check(&self, stock: &Stock) -> Result<(), Vec<Diagnostic>> {
        let [low, high] = stock.blank().bounds().map(|corner| corner * 1e3);
        let cells = (high - low).product() / self.cell(&low, &high).powi(3);
        if cells <= MOST_CELLS {
            return Ok(());
        }
        let least = ((high - low).product() / MOST_CELLS).cbrt();
        let message =
            format!("[part] cell_mm makes {cells:.0} cells of the blank; deflex computes with up to {MOST_CELLS:.0}");
        Err(vec![
            Diagnostic::error("stock.part-cells", "", message)
                .help(format!("give at least {least:.2} mm, or leave it out")),
        ])
    }

    /// Stores the state of the stock if enough was removed since the last one.
    pub(super) fn take_snapshot(&mut self, stock: &Stock) {
        let [low, high] = stock.blank().bounds();
        let whole = (high - low).product();
        let share = GONE / self.held.stages as f64;
        let gone = |last: &Snapshot| stock.removed() - last.removed >= share * (whole - last.removed);
        if self.snapshots.last().is_none_or(gone) {
            self.push(stock);
        }
    }

    /// Stores the last state of the stock if anything was removed since the one before.
    pub(super) fn take_last_snapshot(&mut self, stock: &Stock) {
        if self.snapshots.last().is_none_or(|last| stock.removed() > last.removed) {
            self.push(stock);
        }
    }

    fn push(&mut self, stock: &Stock) {
        let [low, high] = stock.blank().bounds().map(|corner| corner * 1e3);
        let grid = Grid::over(low.into(), high.into(), self.cell(&low, &high));
        let solid = Solid::of(grid, |point| 1e3 * stock.depth(&(Vector3::from(point) * 1e-3)));
        self.snapshots.push(Snapshot { removed: stock.removed(), solid });
    }

    /// Computes the compliance at each target that is cut. Returns notes about it.
    pub(super) fn settle(self, walk: &Walk<'_>, prepared: &mut Prepared) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
        let Self { held, snapshots } = self;
        let cuts = cuts(walk, prepared);
        let count = snapshots.len();
        // Evenly among the states, including the first and the last.
        let most = held.stages;
        let chosen: Vec<&Snapshot> = if count <= most {
            snapshots.iter().collect()
        } else {
            (0..most).map(|n| &snapshots[n * (count - 1) / (most - 1)]).collect()
        };
        // The stages of each cut: it is between two of them, or after the last.
        let after =
            |cut: &Cut| chosen.partition_point(|snapshot| snapshot.removed <= cut.removed).clamp(1, chosen.len());
        let clamps = held.clamps.len();
        let mut yields: Vec<Vec<(PartYield, f64)>> = vec![Vec::new(); cuts.len()];
        let (mut before, mut softest, mut places, mut elements, mut off) = (None, 0.0_f64, 0, 0, 0.0_f64);
        for (n, snapshot) in chosen.iter().enumerate() {
            // A cut between the stages n and n + 1 belongs to both.
            let of_stage: Vec<(usize, f64)> = cuts
                .iter()
                .enumerate()
                .filter_map(|(number, cut)| {
                    let after = after(cut);
                    let low = chosen[after - 1].removed;
                    let share = chosen.get(after).map_or(0.0, |high| (cut.removed - low) / (high.removed - low));
                    let share = match n {
                        _ if n + 1 == after => 1.0 - share,
                        _ if n == after => share,
                        _ => 0.0,
                    };
                    (share > 0.0).then_some((number, share))
                })
                .collect();
            let body =
                Body::new(&snapshot.solid, held.material, &held.clamps).map_err(|error| vec![not_held(&error, n)])?;
            elements = elements.max(body.elements());
            if of_stage.is_empty() {
                continue;
            }
            let at: Vec<[f64; 3]> = of_stage.iter().map(|(number, _)| cuts[*number].place).collect();
            let map = ComplianceMap::over(&body, &at, &Accuracy::default(), before.take());
            places += map.places();
            off = off.max(map.off());
            let motions = (clamps <= MOST_CLAMPS).then(|| ClampMotions::of(&body));
            let found = |Cut { place, face, .. }: &Cut| PartYield {
                compliance: map.between(&body, *face, *place) * 1e-3,
                motions: motions.as_ref().map_or_else(Vec::new, |motions| motions.at(&body, *place)),
                stiffness: motions.as_ref().map_or_else(|| DMatrix::zeros(0, 0), |motions| motions.stiffness() * 1e3),
            };
            let found: Vec<PartYield> = of_stage.par_iter().map(|(number, _)| found(&cuts[*number])).collect();
            for ((number, share), found) in of_stage.iter().zip(found) {
                softest = softest.max(1e3 * found.compliance.singular_values().max());
                yields[*number].push((found, *share));
            }
            before = Some(map);
        }
        for (cut, yields) in cuts.iter().zip(&yields) {
            let wobj_from_stock = walk.stock_from_wobj(prepared, cut.target).rotation.inverse();
            let mixed = PartYield::mixed(yields.iter().map(|(part, share)| (part, *share)));
            prepared.points[cut.target].part = Some(Arc::new(mixed.turned(&wobj_from_stock)));
        }
        let message = format!(
            "part: {elements} cells of {:.2} mm, {} stages of the stock, solved for at {places} places; it yields by up to {:.3} µm/N where it is cut, known to some {:.3} µm/N",
            chosen[0].solid.grid().size.iter().fold(0.0_f64, |most, size| most.max(*size)),
            chosen.len(),
            1e3 * softest,
            1e3 * off,
        );
        let mut notes = vec![Diagnostic::error("stock.part", "", message).severity(Severity::Note)];
        let thin = snapshots.last().map_or(0.0, |snapshot| snapshot.solid.thinner_than(THIN.0));
        if thin > THIN.1 {
            let message = format!(
                "part: {:.0} % of it is in walls thinner than a cell, whose stiffness is uncertain",
                (100.0 * thin).ceil()
            );
            let help = "give [part] cell_mm: half of the thinnest wall is a good choice";
            notes.push(Diagnostic::error("stock.part-thin", "", message).severity(Severity::Warning).help(help));
        }
        Ok(notes)
    }
}

/// The targets that are cut, in order.
fn cuts(walk: &Walk<'_>, prepared: &Prepared) -> Vec<Cut> {
    let mut removed = 0.0;
    let mut cuts = Vec::new();
    for (target, point) in prepared.points.iter().enumerate() {
        removed += point.milled.as_ref().map_or(0.0, |milled| milled.removed);
        let has_force = |milled: &Milled| milled.forces.iter().any(|(_, force)| force.programmed != Vector3::zeros());
        // Also without a force in the table the part may have been touched, by a gauge or a probe.
        let touches = |milled: &Milled| has_force(milled) || milled.removed > 0.0;
        if point.unsolved.is_some() || !(point.cuts() || point.milled.as_deref().is_some_and(touches)) {
            continue;
        }
        // If nothing is cut, the tip touches it.
        let tip = walk.tool(prepared, target, &point.reference.translation.vector, &tool_axis(&point.reference)).tip;
        let [cut, left] = point.milled.as_ref().map_or([Vector3::zeros(); 2], |milled| [milled.cut, milled.left]);
        cuts.push(Cut { target, removed, place: ((tip + cut) * 1e3).into(), face: ((tip + left) * 1e3).into() });
    }
    cuts
}

fn not_held(error: &HoldError, stage: usize) -> Diagnostic {
    let when = if stage == 0 { "" } else { " after material has been removed" };
    let help = match error {
        HoldError::Untouched(_) => {
            "box_mm of [[part.clamp]] is in the axes of [stock]: it has to reach into the material"
        }
        HoldError::Free { .. } => {
            "add a clamp, or make one stiff along x, y and z: together they have to hold the part against every motion"
        }
        _ => "look at [stock]",
    };
    Diagnostic::error("stock.part-clamps", "", format!("[[part.clamp]]: {error}{when}")).help(help)
}
