//! The cutting forces of a cell along a path: which motions cut, and the laws of their forces.

use super::load::{Follows, PointLoad, Through};
use super::refusal::Refusal;
use deflex_cell::{Cell, CutForce, EngagementSource, ForceFrame, MillingCut};
use deflex_cutting::{FeedTable, ForceTable, Lean, Milling};
use deflex_effects::ForceLaw;
use deflex_lanes::{LaneMask, Vector};
use deflex_program::{Mark, Motion, Target};
use deflex_robot::Pose;
use deflex_stock::Front;
use nalgebra::{Rotation3, Unit, Vector3};
use std::sync::Arc;

/// A mechanistic force law for one tool at one feed per tooth.
#[derive(Clone, Debug)]
pub(super) struct Law {
    pub(super) milling: Arc<Milling>,
    table: Arc<FeedTable>,
    /// Lean of the tool against the surface.
    pub(super) lean: Lean,
    /// Change of the force with the depth, N/m, feed frame.
    slope: Vector3<f64>,
    /// Force at the programmed pose, N, feed frame, and the height of the contact point above the tip, m.
    force: Vector3<f64>,
    pub(super) height: Option<f64>,
    pub(super) mirrored: Mirrored,
}

/// The law seen from a stationary tool: the part moves, and the force on it has the opposite sign.
#[derive(Clone, Debug)]
pub(super) struct Mirrored {
    table: Arc<FeedTable>,
    /// Axis of the tool with the lean of the law, feed frame.
    axis: Vector3<f64>,
    slope: Vector3<f64>,
    force: Vector3<f64>,
}

impl Law {
    fn new(milling: Arc<Milling>, table: FeedTable, lean: Lean) -> Self {
        /// Small against a depth of cut, large against rounding, m.
        const LIFT: f64 = 1e-6;
        let table = Arc::new(table);
        let axis = milling.axis_in_feed();
        let force = |lift: f64| table.mean_force(&Vector3::new(0.0, 0.0, lift), &axis);
        let slope = (force(LIFT) - force(-LIFT)) / (2.0 * LIFT);
        let (force, height) = (force(0.0), milling.contact_height(&axis));
        let mirrored = Mirrored { table: Arc::clone(&table), axis: axis.into_inner(), slope, force };
        Self { milling, table, lean, slope, force, height, mirrored }
    }

    /// The feed per tooth of the law, m.
    pub(super) fn feed_per_tooth(&self) -> f64 {
        self.table.feed_per_tooth()
    }

    /// Whether both laws have the same cutter in the same engagement.
    pub(super) fn cuts_like(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.milling, &other.milling)
    }

    /// The law for another feed per tooth, m.
    pub(super) fn at_feed(&self, feed_per_tooth: f64) -> Self {
        Self::new(Arc::clone(&self.milling), self.table.at_feed(feed_per_tooth), self.lean)
    }
}

impl ForceLaw for Mirrored {
    fn force(&self, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
        // A turn of the part is the opposite turn of the tool in it; turns are small.
        let axis = Unit::new_normalize(2.0 * self.axis - axis);
        -self.table.mean_force(&-shift, &axis)
    }

    fn slope(&self) -> Vector3<f64> {
        self.slope
    }

    fn rest(&self) -> Option<Vector3<f64>> {
        Some(-self.force)
    }
}

impl ForceLaw for Law {
    fn force(&self, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
        self.table.mean_force(shift, &Unit::new_unchecked(*axis))
    }

    fn forces(&self, wanted: LaneMask, shift: &Vector, axis: &Vector, force: &mut Vector) {
        self.table.mean_forces(wanted, shift, axis, force);
    }

    fn slope(&self) -> Vector3<f64> {
        self.slope
    }

    fn rest(&self) -> Option<Vector3<f64>> {
        Some(self.force)
    }
}

/// The force laws of a cell, computed when a tool or a feed first occurs.
pub(super) struct Laws<'a> {
    cell: &'a Cell,
    /// The cut of each tool so far, by its name in upper case.
    tools: Vec<(String, ToolCut)>,
    pub(super) laws: Vec<Law>,
    /// Cutters that move through the stock.
    pub(super) fronts: Vec<Arc<Front>>,
}

/// How one tool cuts.
#[derive(Clone, Debug)]
struct ToolCut {
    lean: Lean,
    /// The milling cut, if its force is a milling force.
    milling: Option<MillingCut>,
    /// The table of forces for a declared engagement, computed when the tool first cuts.
    table: Option<(Arc<Milling>, Arc<ForceTable>)>,
    /// Index into the fronts, once it has moved through the stock.
    front: Option<u32>,
}

impl<'a> Laws<'a> {
    pub(super) fn new(cell: &'a Cell) -> Self {
        Self { cell, tools: Vec::new(), laws: Vec::new(), fronts: Vec::new() }
    }

    /// Index of a tool, by its name. Programs have few: a linear search.
    pub(super) fn tool(&mut self, name: &str) -> usize {
        let known = self.tools.iter().position(|(known, _)| known.eq_ignore_ascii_case(name));
        known.unwrap_or_else(|| {
            let mechanistic = self.cell.cut.as_ref().is_some_and(|cut| cut.force == CutForce::Mechanistic);
            // A missing value is reported where it is needed.
            let milling = self.cell.milling(name).ok().filter(|_| mechanistic);
            let lean = match milling.as_ref().map(|milling| milling.engagement) {
                Some(EngagementSource::Declared(engagement)) => Lean::new(engagement.lead, engagement.tilt),
                Some(EngagementSource::Stock) | None => Lean::new(0.0, 0.0),
            };
            self.tools.push((name.to_ascii_uppercase(), ToolCut { lean, milling, table: None, front: None }));
            self.tools.len() - 1
        })
    }

    /// Whether the surface that a tool cuts is known from its engagement.
    pub(super) fn has_engagement(&self, tool: usize) -> bool {
        self.tools[tool].1.milling.is_some()
    }

    /// Lean of a tool against the surface, for laws that need it.
    pub(super) fn lean(&self, tool: usize) -> &Lean {
        &self.tools[tool].1.lean
    }

    /// The load at a target: the force at the end of the segment to it.
    pub(super) fn load(
        &mut self,
        (target, tool): (&Target, usize),
        given: Option<Vector3<f64>>,
        (frame, leaned, held): (Option<&Rotation3<f64>>, bool, Option<&PointLoad>),
        wobj_from_tcp: &Pose,
        has_table: bool,
    ) -> Result<PointLoad, Refusal> {
        if !Self::cuts(self.cell, target) {
            return Ok(PointLoad::Air);
        }
        let constant = |force, follows| PointLoad::Constant { force, follows };
        // A table overrides [cut]: a nonzero row cuts, a zero or absent row is air.
        if has_table {
            let given = given.filter(|f| *f != Vector3::zeros());
            return Ok(given.map_or(PointLoad::Air, |force| constant(force, Follows::WorkObject)));
        }
        match self.cell.cut.as_ref().map(|cut| &cut.force) {
            None => Err(Refusal::new(
                "cell.no-cut",
                "the cell has no [cut] section, and no table of forces was given",
                "add [cut] to the cell (force = \"none\" for no force), or give --forces",
            )),
            Some(CutForce::None) => Ok(PointLoad::Air),
            Some(CutForce::Table) => Err(Refusal::new(
                "cell.no-forces",
                "[cut] force = \"table\" needs forces, and neither --forces nor a measured file gives them",
                "give --forces CSV with the columns `target`, `fx_n`, `fy_n` and `fz_n`; with `identify`, put these columns into the measured file",
            )),
            Some(CutForce::Constant { force, frame: axes }) => Ok(match (axes, frame) {
                (ForceFrame::Wobj, _) => constant(*force, Follows::WorkObject),
                (ForceFrame::Tool, _) => constant(wobj_from_tcp.rotation * force, Follows::Tool),
                (ForceFrame::Feed, Some(frame)) => constant(frame * force, Follows::Feed(*force)),
                (ForceFrame::Feed, None) => held.copied().unwrap_or(PointLoad::Air),
            }),
            // Computed when the stock is cut.
            Some(CutForce::Mechanistic) if self.follows_stock(tool) => {
                Ok(constant(Vector3::zeros(), Follows::WorkObject))
            }
            Some(CutForce::Mechanistic) => {
                let Some(frame) = frame else { return Ok(PointLoad::Air) };
                let feed_per_tooth = self.feed_per_tooth(target, tool)?;
                let law = self.law(tool, feed_per_tooth)?;
                Ok(PointLoad::Law { law, wobj_from_feed: *frame, leaned })
            }
        }
    }

    /// Whether a tool's force follows from the stock.
    fn follows_stock(&self, tool: usize) -> bool {
        let milling = self.tools[tool].1.milling.as_ref();
        self.cell.stock.is_some() && milling.is_some_and(|milling| milling.engagement == EngagementSource::Stock)
    }

    /// The cutter of a motion through the stock; `None` without a stock, or if the cutter is not declared.
    pub(super) fn through(
        &mut self,
        (target, tool): (&Target, usize),
        has_table: bool,
    ) -> Result<Option<Through>, Refusal> {
        if self.cell.stock.is_none() {
            return Ok(None);
        }
        let name = &self.tools[tool].0;
        let Some(cutter) = self.cell.cutter(name) else { return Ok(None) };
        let cuts = Self::cuts(self.cell, target);
        let feed_per_tooth = if cuts && !has_table && self.follows_stock(tool) {
            Some(self.feed_per_tooth(target, tool)?)
        } else {
            None
        };
        // A force that does not follow from the stock needs no coefficients.
        let coefficients = self.cell.milling(name).map(|milling| milling.coefficients).unwrap_or_default();
        let known = self.tools[tool].1.front;
        let front = known.unwrap_or_else(|| {
            self.fronts.push(Arc::new(Front::new(&cutter, &coefficients)));
            u32::try_from(self.fronts.len() - 1).unwrap_or(u32::MAX)
        });
        self.tools[tool].1.front = Some(front);
        Ok(Some(Through { front, cuts, feed_per_tooth }))
    }

    /// Feed per tooth of a motion, m: as declared, or from feed, spindle speed and teeth.
    fn feed_per_tooth(&self, target: &Target, tool: usize) -> Result<f64, Refusal> {
        let (name, cut) = &self.tools[tool];
        let Some(milling) = &cut.milling else {
            let missing = self.cell.milling(name).err().map_or_else(String::new, |missing| missing.to_string());
            return Err(Refusal::new(
                "cell.no-milling",
                format!("tool `{name}` cuts here, and {}", missing.replace(".X.", &format!(".{name}."))),
                "declare it for the tool, or for all tools in [cut]",
            ));
        };
        if let Some(feed_per_tooth) = milling.feed_per_tooth {
            return Ok(feed_per_tooth);
        }
        let rpm = target.spindle_rpm.or(milling.spindle_rpm).filter(|rpm| *rpm > 0.0);
        let (Some(feed), Some(rpm)) = (target.feed_mm_s, rpm) else {
            return Err(Refusal::new(
                "cell.no-feed-per-tooth",
                "the feed per tooth is not known: the target has no feed, or neither cell nor program states the spindle speed",
                format!(
                    "give feed_per_tooth_mm or spindle_rpm in [cut.engagement], or spindle_rpm in [tools.{name}.cutter]"
                ),
            ));
        };
        Ok(1e-3 * feed * 60.0 / (rpm * f64::from(milling.cutter.teeth)))
    }

    /// Whether a motion may cut the material through which a tool moves.
    pub(super) fn may_cut(&self, target: &Target, tool: usize) -> bool {
        Self::cuts(self.cell, target) && self.cell.cutter(&self.tools[tool].0).is_some()
    }

    /// Whether the force at a target depends on the direction of its segment.
    pub(super) fn follows_the_way(&self, target: &Target, has_table: bool) -> bool {
        let force = self.cell.cut.as_ref().map(|cut| &cut.force);
        let follows = matches!(force, Some(CutForce::Mechanistic | CutForce::Constant { frame: ForceFrame::Feed, .. }));
        follows && !has_table && Self::cuts(self.cell, target)
    }

    /// Whether the force of a motion is given in axes that depend on the feed direction.
    pub(super) fn in_feed_frame(&self, (target, tool): (&Target, usize), has_table: bool) -> bool {
        self.follows_the_way(target, has_table) && !self.follows_stock(tool)
    }

    /// Whether a motion cuts, or its force, depends on its speed, and that speed is known only at run time.
    pub(super) fn is_cut_unknown(&self, target: &Target, tool: usize) -> bool {
        let milling = self.tools[tool].1.milling.as_ref();
        let is_computed = self.cell.cut.as_ref().is_some_and(|cut| cut.force == CutForce::Mechanistic)
            && milling.is_some_and(|milling| milling.feed_per_tooth.is_none());
        is_computed && target.feed_mm_s.is_none() && Self::cuts(self.cell, target)
            || Self::lacks_speed(self.cell, target)
    }

    /// Whether the speed decides if a motion cuts, and the program does not state it.
    pub(super) fn lacks_speed(cell: &Cell, target: &Target) -> bool {
        let limited = cell.cut.as_ref().is_some_and(|cut| cut.max_cutting_feed.is_some());
        let may_cut = !target.rapid && !matches!(target.motion, Motion::Joint | Motion::AbsoluteJoint);
        limited && may_cut && target.mark.is_none() && target.feed_mm_s.is_none()
    }

    /// Whether a motion cuts nothing in a cell with a cutting force.
    pub(super) fn is_through_air(cell: &Cell, target: &Target) -> bool {
        cell.cut.as_ref().is_some_and(|cut| cut.force != CutForce::None) && !Self::cuts(cell, target)
    }

    /// Whether a motion cuts. Rapid travel, joint motions and motions above a feed limit do not, unless a mark says so.
    pub(super) fn cuts(cell: &Cell, target: &Target) -> bool {
        match target.mark {
            Some(Mark::Air) => false,
            Some(Mark::Cut) => true,
            None => {
                let limit = cell.cut.as_ref().and_then(|cut| cut.max_cutting_feed);
                let fast = limit.is_some_and(|limit| target.feed_mm_s.is_none_or(|feed| 1e-3 * feed > limit));
                !target.rapid && !matches!(target.motion, Motion::Joint | Motion::AbsoluteJoint) && !fast
            }
        }
    }

    /// Index of the law of a tool and a feed per tooth. Programs have few: a linear search.
    fn law(&mut self, tool: usize, feed_per_tooth: f64) -> Result<usize, Refusal> {
        let (milling, table) = match &self.tools[tool].1.table {
            Some(known) => known,
            None => {
                let new = self.table(tool)?;
                self.tools[tool].1.table.insert(new)
            }
        };
        let same = |law: &Law| {
            Arc::ptr_eq(&law.milling, milling) && law.table.feed_per_tooth().to_bits() == feed_per_tooth.to_bits()
        };
        if let Some(index) = self.laws.iter().position(same) {
            return Ok(index);
        }
        let law = Law::new(Arc::clone(milling), table.at_feed(feed_per_tooth), *self.lean(tool));
        self.laws.push(law);
        Ok(self.laws.len() - 1)
    }

    /// Computes the table of a tool's milling force; tools with the same parts share one.
    fn table(&self, tool: usize) -> Result<(Arc<Milling>, Arc<ForceTable>), Refusal> {
        let (name, cut) = &self.tools[tool];
        let same = |other: &ToolCut| other.milling == cut.milling;
        let shared = self.tools.iter().find_map(|(_, other)| other.table.clone().filter(|_| same(other)));
        match (shared, &cut.milling) {
            (Some(shared), _) => Ok(shared),
            (
                None,
                Some(MillingCut { cutter, engagement: EngagementSource::Declared(engagement), coefficients, .. }),
            ) => {
                let milling = Milling::new(*cutter, *engagement, *coefficients).map_err(|error| {
                    let message = format!("the cut of tool `{name}`: {}: {}", error.field, error.message);
                    Refusal::new("cell.cut", message, "check cutter, engagement and coefficients of the tool")
                })?;
                Ok((Arc::new(milling.clone()), Arc::new(ForceTable::new(milling))))
            }
            (None, _) => Err(Refusal::new(
                "cell.no-stock",
                format!("tool `{name}` cuts here with mode = \"stock\", which needs the stock"),
                "add [stock] with its box_mm, or declare mode = \"slot\", \"up\" or \"down\" with its depth",
            )),
        }
    }
}
