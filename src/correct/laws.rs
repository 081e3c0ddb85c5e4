//! The cutting forces of a cell along a path: which moves cut, and by what law.

use crate::cell::{Cell, Cut, CutForce, ForceFrame};
use crate::cutting::{FeedTable, ForceTable, Lean, Milling};
use crate::effects::ForceLaw;
use crate::lanes::{Mask, Vector};
use crate::program::{Mark, Motion, Target};
use crate::robot::Pose;
use crate::text::Diagnostic;
use nalgebra::{Rotation3, Unit, Vector3};
use std::sync::Arc;

/// A mechanistic force law for one feed per tooth.
#[derive(Clone, Debug)]
pub(super) struct Law {
    pub(super) milling: Arc<Milling>,
    table: Arc<FeedTable>,
    /// N/m, feed frame.
    slope: Vector3<f64>,
    /// At rest: N, feed frame, and the height of the contact point over the tip, m.
    force: Vector3<f64>,
    pub(super) height: Option<f64>,
}

impl ForceLaw for Law {
    fn force(&self, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
        self.table.mean_force(shift, &Unit::new_unchecked(*axis))
    }

    fn forces(&self, wanted: Mask, shift: &Vector, axis: &Vector, force: &mut Vector) {
        self.table.mean_forces(wanted, shift, axis, force);
    }

    fn slope(&self) -> Vector3<f64> {
        self.slope
    }

    fn rest(&self) -> Option<Vector3<f64>> {
        Some(self.force)
    }
}

/// The force laws of a cell, made as feeds turn up.
pub(super) struct Laws<'a> {
    cut: Option<&'a Cut>,
    milling: Option<(Arc<Milling>, Arc<ForceTable>)>,
    lean: Lean,
    pub(super) laws: Vec<Law>,
}

/// What cuts at a target.
pub(super) enum Load {
    Air,
    /// N, work object axes.
    Constant(Vector3<f64>),
    /// Index into the laws; in the feed frame.
    Law(usize),
}

/// Code, message, help.
type Refusal = (&'static str, String, String);

impl<'a> Laws<'a> {
    pub(super) fn new(cell: &'a Cell) -> Result<Self, Vec<Diagnostic>> {
        let cut = cell.cut.as_ref();
        let milling = match cut.map(|cut| &cut.force) {
            Some(CutForce::Mechanistic { cutter, engagement, coefficients, .. }) => {
                Some(Milling::new(*cutter, *engagement, *coefficients).map_err(|error| {
                    vec![Diagnostic::error("cell.cut", "", format!("[cut] {}: {}", error.field, error.message))]
                })?)
            }
            _ => None,
        };
        let lean = milling.as_ref().map(Milling::engagement).map_or((0.0, 0.0), |e| (e.lead, e.tilt));
        let milling = milling.map(|milling| (Arc::new(milling.clone()), Arc::new(ForceTable::new(milling))));
        Ok(Self { cut, milling, lean: Lean::new(lean.0, lean.1), laws: Vec::new() })
    }

    pub(super) fn has_engagement(&self) -> bool {
        self.milling.is_some()
    }

    /// Of the tool against the surface, where a law asks for it.
    pub(super) fn lean(&self) -> &Lean {
        &self.lean
    }

    pub(super) fn load(
        &mut self,
        target: &Target,
        given: Option<Vector3<f64>>,
        frame: Option<&Rotation3<f64>>,
        wobj_from_tcp: &Pose,
        has_table: bool,
    ) -> Result<Load, Refusal> {
        if !self.may_cut(target) {
            return Ok(Load::Air);
        }
        // A table overrides [cut]: a nonzero row cuts, a zero or absent row is air.
        if has_table {
            return Ok(given.filter(|f| *f != Vector3::zeros()).map_or(Load::Air, Load::Constant));
        }
        match self.cut.map(|cut| &cut.force) {
            None => Err((
                "cell.no-cut",
                "the cell has no [cut] section, and no table of forces was given".to_owned(),
                "add [cut] to the cell (force = \"none\" for no force), or give --forces".to_owned(),
            )),
            Some(CutForce::None) => Ok(Load::Air),
            Some(CutForce::Table) => Err((
                "cell.no-forces",
                "[cut] force = \"table\" needs a table of forces".to_owned(),
                "give --forces CSV with `target` and `fx_n,fy_n,fz_n`".to_owned(),
            )),
            Some(CutForce::Constant { force, frame: axes }) => Ok(match (axes, frame) {
                (ForceFrame::Wobj, _) => Load::Constant(*force),
                (ForceFrame::Tool, _) => Load::Constant(wobj_from_tcp.rotation * force),
                (ForceFrame::Feed, Some(frame)) => Load::Constant(frame * force),
                (ForceFrame::Feed, None) => Load::Air,
            }),
            Some(CutForce::Mechanistic { feed_from_program, spindle_rpm, engagement, cutter, .. }) => {
                if frame.is_none() {
                    return Ok(Load::Air);
                }
                let feed_per_tooth = if *feed_from_program {
                    let rpm = target.spindle_rpm.or(*spindle_rpm).filter(|rpm| *rpm > 0.0);
                    let (Some(feed), Some(rpm)) = (target.feed_mm_s, rpm) else {
                        return Err((
                            "cell.no-feed-per-tooth",
                            "the feed per tooth is not known: the target has no feed, or nobody says the spindle speed"
                                .to_owned(),
                            "give feed_per_tooth_mm or spindle_rpm in [cut.engagement]".to_owned(),
                        ));
                    };
                    1e-3 * feed * 60.0 / (rpm * f64::from(cutter.teeth))
                } else {
                    engagement.feed_per_tooth
                };
                Ok(Load::Law(self.law(feed_per_tooth)))
            }
        }
    }

    /// Which moves cut: not RAPID moves, not joint moves, not above a feed limit; markers overrule.
    fn may_cut(&self, target: &Target) -> bool {
        match target.mark {
            Some(Mark::Air) => false,
            Some(Mark::Cut) => true,
            None => {
                let limit = self.cut.and_then(|cut| cut.max_cutting_feed);
                let fast = limit.is_some_and(|limit| target.feed_mm_s.is_none_or(|feed| 1e-3 * feed > limit));
                !target.rapid && !matches!(target.motion, Motion::Joint | Motion::AbsoluteJoint) && !fast
            }
        }
    }

    /// Index of the law of a feed per tooth. Programs have few feeds: a linear search.
    fn law(&mut self, feed_per_tooth: f64) -> usize {
        let same = |law: &Law| law.table.feed_per_tooth().to_bits() == feed_per_tooth.to_bits();
        if let Some(index) = self.laws.iter().position(same) {
            return index;
        }
        if let Some((milling, table)) = &self.milling {
            /// Small against a depth of cut, large against rounding, m.
            const LIFT: f64 = 1e-6;
            let table = Arc::new(table.at_feed(feed_per_tooth));
            let axis = milling.axis_in_feed();
            let force = |lift: f64| table.mean_force(&Vector3::new(0.0, 0.0, lift), &axis);
            let slope = (force(LIFT) - force(-LIFT)) / (2.0 * LIFT);
            let (force, height) = (force(0.0), milling.contact_height(&axis));
            self.laws.push(Law { milling: milling.clone(), table, slope, force, height });
        }
        self.laws.len() - 1
    }
}
