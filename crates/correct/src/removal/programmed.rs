//! The programmed path removes the material. The engagement at a position does not depend on the forces elsewhere. A batch of motions is
//! therefore removed, and then the engagement at each of its positions is computed from the stock at that moment, both in parallel.

use super::super::Prepared;
use super::super::point::{FedForce, tool_axis};
use super::super::segment::Kind;
use super::{End, Met, Passed, Walk, ahead};
use deflex_stock::{Engaged, Moment, ToolPose};
use nalgebra::{Rotation3, Vector3};
use rayon::prelude::*;

/// Number of positions, or motions, of a batch: the history of the stock between them is some 10 MB.
const BATCH: usize = 512;

/// Number of motions of a batch if the part yields: the state of the stock is stored between batches.
const BATCH_OF_A_PART: usize = 16;

/// A position of the tool whose engagement is computed when the batch settles.
struct PendingEngagement {
    moment: Moment,
    tool: ToolPose,
    /// Displacement to it, stock's axes.
    displacement: Vector3<f64>,
    front: u32,
}

/// A segment that was cut, and whose forces are not set yet.
struct Recorded {
    passed: Passed,
    /// Number of motions that the stock has received.
    moves: usize,
    /// Shares of the positions at which engagements are computed.
    shares: Vec<f64>,
    /// Whether it begins with the engagement at the end of the segment before.
    goes_on: bool,
    wobj_from_stock: Rotation3<f64>,
}

#[derive(Default)]
struct Batch {
    pending: Vec<PendingEngagement>,
    recorded: Vec<Recorded>,
    /// Number of motions of all these.
    moves: usize,
    end: Option<End>,
    /// The last result.
    met: Met,
}

/// Cuts the stock with all points.
pub(super) fn cut(walk: &mut Walk<'_>, prepared: &mut Prepared) {
    let mut batch = Batch::default();
    if let Some(stages) = &mut walk.stages {
        stages.take_snapshot(&walk.stock);
    }
    walk.stock.keep_history();
    for i in 0..prepared.points.len() {
        if Kind::of(walk.program, i) != Kind::Point {
            batch.record(walk, prepared, i);
            let most = if walk.stages.is_some() { BATCH_OF_A_PART } else { BATCH };
            if batch.pending.len().max(batch.moves) >= most {
                batch.settle(walk, prepared);
                if !walk.goes_on(i + 1, prepared.points.len()) {
                    return;
                }
            }
        }
    }
    batch.settle(walk, prepared);
    walk.stock.drop_history();
}

impl Batch {
    /// Records the motion to a point, and the engagements to compute.
    fn record(&mut self, walk: &mut Walk<'_>, prepared: &Prepared, i: usize) {
        let end = self.end.take();
        let Some(through) = prepared.points[i].through else { return };
        let solid = walk.fronts[through.front as usize].solid();
        let feed_per_tooth = through.feed_per_tooth;
        // The compliance of a part depends on where it is cut, for every kind of force.
        let needs_engagement = feed_per_tooth.is_some() || (walk.stages.is_some() && through.cuts);
        let (places, length) = walk.places(prepared, i, needs_engagement);
        let stock_from_wobj = walk.stock_from_wobj(prepared, i).rotation;
        let mut goes_on = false;
        let mut moves = 0;
        let mut direction = None;
        let mut last: Option<ToolPose> = None;
        for (k, place) in places.iter().enumerate() {
            let tool = walk.tool(prepared, i, &place.pose.translation.vector, &tool_axis(&place.pose));
            let displacement = stock_from_wobj * walk.displacement(&places, k);
            let begins = k == 0 && places.len() > 1;
            let mut add = |tool: &ToolPose| {
                if needs_engagement {
                    self.pending.push(PendingEngagement {
                        moment: walk.stock.now(),
                        tool: *tool,
                        displacement,
                        front: through.front,
                    });
                }
            };
            if let Some(from) = last.replace(tool) {
                // The engagement at the end of a step is computed before the step removes material.
                add(&tool);
                walk.stock.defer(solid, &from, &tool);
                moves += 1;
            } else if begins && end.is_some_and(|end| end.goes_on(prepared, i, &displacement)) {
                goes_on = true;
            } else {
                let on = if begins { ahead(&displacement) } else { Vector3::zeros() };
                add(&ToolPose { tip: tool.tip + on, ..tool });
            }
            if displacement != Vector3::zeros() {
                direction = Some(displacement.normalize());
            }
        }
        self.end = feed_per_tooth.zip(direction).map(|(feed_per_tooth, direction)| End {
            target: i,
            front: through.front,
            feed_per_tooth,
            direction,
        });
        let shares = if needs_engagement { places.iter().map(|place| place.share).collect() } else { Vec::new() };
        let passed = Passed::new(i, through, length);
        self.moves += moves;
        self.recorded.push(Recorded { passed, moves, shares, goes_on, wobj_from_stock: stock_from_wobj.inverse() });
    }

    /// Removes the material, computes the engagements, and adds the results.
    fn settle(&mut self, walk: &mut Walk<'_>, prepared: &mut Prepared) {
        let mut volumes = walk.stock.settle().into_iter();
        let (stock, fronts) = (&walk.stock, &walk.fronts);
        let meets = |pending: &PendingEngagement| {
            let PendingEngagement { moment, tool, displacement, front } = pending;
            Walk::meets(&fronts[*front as usize], (stock, moment), tool, displacement)
        };
        let engagements: Vec<Engaged> = self.pending.par_iter().map(meets).collect();
        let mut engagements = engagements.into_iter().zip(&self.pending);
        for Recorded { mut passed, moves, shares, goes_on, wobj_from_stock } in self.recorded.drain(..) {
            passed.removed = volumes.by_ref().take(moves).sum();
            for (k, share) in shares.iter().enumerate() {
                let begins = k == 0 && shares.len() > 1;
                if !(begins && goes_on)
                    && let Some((engaged, pending)) = engagements.next()
                {
                    let force = |feed_per_tooth| FedForce::new(&wobj_from_stock, &engaged.force, feed_per_tooth);
                    let force = passed.through.feed_per_tooth.map_or_else(FedForce::default, force);
                    self.met = Met::new(engaged, force, &pending.tool, &pending.displacement);
                }
                passed.push(*share, &self.met);
                if let Some(feed_per_tooth) = passed.through.feed_per_tooth.filter(|_| !begins) {
                    walk.weigh(&self.met.engaged, &self.met.force.programmed, feed_per_tooth);
                }
            }
            walk.finish(prepared, passed);
        }
        self.pending.clear();
        self.moves = 0;
        if let Some(stages) = &mut walk.stages {
            stages.take_snapshot(&walk.stock);
        }
        walk.stock.keep_history();
    }
}
