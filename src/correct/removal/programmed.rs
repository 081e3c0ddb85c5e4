//! The programmed path removes the material: what is met at each place does not depend on the forces at others, so that a batch
//! of moves is removed, and then what was met at each of its places is found of the stock as it was then, both in parallel.

use super::super::Prepared;
use super::super::point::{FedForce, tool_axis};
use super::super::segment::Kind;
use super::{End, Met, Passed, Walk, ahead};
use crate::stock::{Engaged, Moment, ToolPose};
use nalgebra::{Rotation3, Vector3};
use rayon::prelude::*;

/// Places, or moves, that are looked at together: the history of the stock between them is some 10 MB.
const BATCH: usize = 512;

/// So many where it is known how the part yields: the stock is looked at between batches.
const BATCH_OF_A_PART: usize = 16;

/// A place for which the engagement of the tool is computed.
struct Asked {
    moment: Moment,
    tool: ToolPose,
    /// Into it, in the stock.
    way: Vector3<f64>,
    front: u32,
}

/// A way that has been cut, and whose forces are to be set.
struct Recorded {
    passed: Passed,
    /// Moves that the stock has received.
    moves: usize,
    /// Of the places at which engagements are computed.
    shares: Vec<f64>,
    /// What is met where it begins is what the way before met at its end.
    goes_on: bool,
    wobj_from_stock: Rotation3<f64>,
}

#[derive(Default)]
struct Batch {
    asked: Vec<Asked>,
    recorded: Vec<Recorded>,
    /// Moves of all these.
    moves: usize,
    end: Option<End>,
    /// The last answer.
    met: Met,
}

/// Cuts the stock with all points.
pub(super) fn cut(walk: &mut Walk<'_>, prepared: &mut Prepared) {
    let mut batch = Batch::default();
    if let Some(stages) = &mut walk.stages {
        stages.look(&walk.stock);
    }
    walk.stock.keep_history();
    for i in 0..prepared.points.len() {
        if Kind::of(walk.program, i) != Kind::Point {
            batch.record(walk, prepared, i);
            let most = if walk.stages.is_some() { BATCH_OF_A_PART } else { BATCH };
            if batch.asked.len().max(batch.moves) >= most {
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
    /// Notes what the move into a point removes, and which engagements are to be computed.
    fn record(&mut self, walk: &mut Walk<'_>, prepared: &Prepared, i: usize) {
        let end = self.end.take();
        let Some(through) = prepared.points[i].through else { return };
        let solid = walk.fronts[through.front as usize].solid();
        let feed_per_tooth = through.feed_per_tooth;
        // How a part yields depends on where it is cut, whatever says the force.
        let asks = feed_per_tooth.is_some() || (walk.stages.is_some() && through.cuts);
        let (places, length) = walk.places(prepared, i, asks);
        let stock_from_wobj = walk.stock_from_wobj(prepared, i).rotation;
        let mut goes_on = false;
        let mut moves = 0;
        let mut direction = None;
        let mut last: Option<ToolPose> = None;
        for (k, place) in places.iter().enumerate() {
            let tool = walk.tool(prepared, i, &place.pose.translation.vector, &tool_axis(&place.pose));
            let way = stock_from_wobj * walk.way(&places, k);
            let begins = k == 0 && places.len() > 1;
            let mut ask = |tool: &ToolPose| {
                if asks {
                    self.asked.push(Asked { moment: walk.stock.now(), tool: *tool, way, front: through.front });
                }
            };
            if let Some(from) = last.replace(tool) {
                // What it meets at the end of a step is what has not been removed by the step.
                ask(&tool);
                walk.stock.defer(solid, &from, &tool);
                moves += 1;
            } else if begins && end.is_some_and(|end| end.goes_on(prepared, i, &way)) {
                goes_on = true;
            } else {
                let on = if begins { ahead(&way) } else { Vector3::zeros() };
                ask(&ToolPose { tip: tool.tip + on, ..tool });
            }
            if way != Vector3::zeros() {
                direction = Some(way.normalize());
            }
        }
        self.end = feed_per_tooth.zip(direction).map(|(feed_per_tooth, direction)| End {
            target: i,
            front: through.front,
            feed_per_tooth,
            direction,
        });
        let shares = if asks { places.iter().map(|place| place.share).collect() } else { Vec::new() };
        let passed = Passed::new(i, through, length);
        self.moves += moves;
        self.recorded.push(Recorded { passed, moves, shares, goes_on, wobj_from_stock: stock_from_wobj.inverse() });
    }

    /// Removes, finds what is met at each place, and takes it in.
    fn settle(&mut self, walk: &mut Walk<'_>, prepared: &mut Prepared) {
        let mut volumes = walk.stock.settle().into_iter();
        let (stock, fronts) = (&walk.stock, &walk.fronts);
        let meets = |asked: &Asked| {
            let Asked { moment, tool, way, front } = asked;
            Walk::meets(&fronts[*front as usize], (stock, moment), tool, way)
        };
        let answers: Vec<Engaged> = self.asked.par_iter().map(meets).collect();
        let mut answers = answers.into_iter().zip(&self.asked);
        for Recorded { mut passed, moves, shares, goes_on, wobj_from_stock } in self.recorded.drain(..) {
            passed.removed = volumes.by_ref().take(moves).sum();
            for (k, share) in shares.iter().enumerate() {
                let begins = k == 0 && shares.len() > 1;
                if !(begins && goes_on)
                    && let Some((engaged, asked)) = answers.next()
                {
                    let force = |feed_per_tooth| FedForce::new(&wobj_from_stock, &engaged.force, feed_per_tooth);
                    let force = passed.through.feed_per_tooth.map_or_else(FedForce::default, force);
                    self.met = Met::new(engaged, force, &asked.tool, &asked.way);
                }
                passed.push(*share, &self.met);
                if let Some(feed_per_tooth) = passed.through.feed_per_tooth.filter(|_| !begins) {
                    walk.weigh(&self.met.engaged, &self.met.force.programmed, feed_per_tooth);
                }
            }
            walk.finish(prepared, passed);
        }
        self.asked.clear();
        self.moves = 0;
        if let Some(stages) = &mut walk.stages {
            stages.look(&walk.stock);
        }
        walk.stock.keep_history();
    }
}
