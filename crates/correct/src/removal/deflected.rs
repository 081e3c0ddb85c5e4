//! The loaded arm removes the material: at every position, force and deflection are made to agree before the cut goes on.

use super::super::Prepared;
use super::super::point::{FedForce, tool_axis};
use super::super::segment::Kind;
use super::super::travel::CHORD;
use super::places::BEND;
use super::{End, Met, Passed, Walk, ahead};
use deflex_effects::{Cutting, Situation};
use deflex_stock::{Engaged, ToolPose};
use nalgebra::{Rotation3, Vector3};
use std::sync::Arc;

/// Accuracy of the tool's position at an equilibrium, m.
const SETTLED: f64 = 5e-7;
/// Number of points between two reports of the progress: some milliseconds.
const REPORT: usize = 64;
/// Most rounds of force and deflection at one position.
const ROUNDS: usize = 15;

/// A tool whose deflection agrees with its force.
#[derive(Clone, Copy)]
struct Settled {
    engaged: Engaged,
    /// The force, N, work object axes.
    force: Vector3<f64>,
    /// Deflection of the tip, m, work object axes, and of the orientation.
    bent: (Vector3<f64>, Rotation3<f64>),
}

/// The tool at the position before.
#[derive(Clone, Copy)]
struct Last {
    /// Index of its point.
    target: usize,
    tool: ToolPose,
    /// Deflection of the tip, m, and of the orientation, work object axes.
    bent: (Vector3<f64>, Rotation3<f64>),
    /// The end of the segment, if the force follows from the stock.
    end: Option<(End, Settled)>,
}

/// Cuts the stock with all points.
pub(super) fn cut(walk: &mut Walk<'_>, prepared: &mut Prepared) {
    let mut last = None;
    for i in 0..prepared.points.len() {
        if Kind::of(walk.program, i) != Kind::Point {
            last = step(walk, prepared, i, last);
        }
        if i % REPORT == 0 && !walk.goes_on(i, prepared.points.len()) {
            return;
        }
    }
}

/// Cuts the stock with the motion to a point.
fn step(walk: &mut Walk<'_>, prepared: &mut Prepared, i: usize, before: Option<Last>) -> Option<Last> {
    let through = prepared.points[i].through?;
    let front = Arc::clone(&walk.fronts[through.front as usize]);
    let feed_per_tooth = through.feed_per_tooth;
    let driven = walk.driven_places(prepared, i);
    let is_driven = driven.is_some();
    let (places, length) = driven.unwrap_or_else(|| walk.places(prepared, i, feed_per_tooth.is_some()));
    if places.is_empty() {
        return before;
    }
    let stock_from_wobj = walk.stock_from_wobj(prepared, i).rotation;
    let wobj_from_stock = stock_from_wobj.inverse();
    let point = &prepared.points[i];
    let mut motor = i.checked_sub(1).map_or(point.motor, |before| prepared.points[before].motor);
    let mut settled = Settled {
        engaged: Engaged::default(),
        force: Vector3::zeros(),
        bent: (Vector3::zeros(), Rotation3::identity()),
    };
    let mut passed = Passed::new(i, through, length);
    let before = before
        .filter(|before| places.len() > 1 && prepared.points[before.target].setting == prepared.points[i].setting);
    let mut from = before.map(|before| before.tool);
    let mut direction = None;
    for (k, place) in places.iter().enumerate() {
        let axis = tool_axis(&place.pose);
        let displacement = stock_from_wobj * walk.displacement(&places, k);
        let begins = k == 0 && places.len() > 1;
        let bent_tool = |walk: &Walk<'_>, bent: &(Vector3<f64>, Rotation3<f64>)| {
            walk.tool(prepared, i, &(place.pose.translation.vector + bent.0), &(bent.1 * axis))
        };
        let end = before.and_then(|before| before.end).filter(|_| begins);
        // At the start and the end of a cut, a motion that does not cut continues the rounding.
        let rounds = !through.cuts && place.driven.as_ref().is_some_and(|driven| driven.aside > BEND);
        let tool = if is_driven && begins {
            // A driven segment continues from the position to which the one before has led the tool.
            settled = end.map_or(settled, |(_, there)| there);
            settled.bent = before.map_or(settled.bent, |before| before.bent);
            bent_tool(walk, &settled.bent)
        } else if !through.cuts {
            if !rounds {
                settled.bent = (Vector3::zeros(), Rotation3::identity());
            }
            bent_tool(walk, &settled.bent)
        } else if let Some((_, there)) = end.filter(|(end, _)| end.goes_on(prepared, i, &displacement)) {
            settled = there;
            bent_tool(walk, &settled.bent)
        } else {
            let on = if begins { ahead(&displacement) } else { Vector3::zeros() };
            let moment = walk.stock.now();
            let speed = place.driven.as_ref().map_or(1.0, |driven| driven.speed);
            let met = settled.engaged;
            let meet = |tool: &ToolPose| match feed_per_tooth {
                Some(feed) => {
                    let tool = ToolPose { tip: tool.tip + on, ..*tool };
                    // At a stop, the engagement is that at the end of the motion.
                    let rests = place.driven.is_some() && displacement.norm() <= CHORD;
                    let engaged =
                        if rests { met } else { Walk::meets(&front, (&walk.stock, &moment), &tool, &displacement) };
                    (engaged, wobj_from_stock * engaged.force.at(speed * feed))
                }
                None => (Engaged::default(), Vector3::zeros()),
            };
            if let Some(driven) = &place.driven {
                motor = driven.point.motor;
            } else if k + 1 < places.len() {
                let before = i.checked_sub(1).and_then(|before| prepared.points[before].moved.as_ref());
                let moved = prepared.mount(i).between(before, prepared.points[i].moved.as_ref(), place.share);
                let setting = moved.map_or(prepared.mount(i).setting, |moved| moved.setting);
                let flange = setting.base_from_wobj * place.pose * setting.tool.flange_from_tcp.inverse();
                if let Ok(found) = walk.arm.robot.inverse_near(&flange, &motor) {
                    motor = found;
                }
            } else {
                motor = prepared.points[i].motor;
            }
            let driven = place.driven.as_ref().map(|driven| &driven.point);
            let point = driven.unwrap_or(&prepared.points[i]);
            let situation = Situation {
                wobj_from_tcp: driven.map_or(place.pose, |driven| driven.reference),
                ..point.situation(prepared.setting(i), &prepared.shared.laws)
            };
            let land = |force: &Vector3<f64>| {
                let cutting = if feed_per_tooth.is_some() { Cutting::Constant(*force) } else { situation.cutting };
                let situation = Situation { cutting, ..situation };
                let there = walk.arm.predict(&situation, &motor, &point.travel).ok()?.wobj_from_tcp;
                let shift = there.translation.vector - place.pose.translation.vector;
                Some((shift, there.rotation * place.pose.rotation.inverse()))
            };
            for round in 0..ROUNDS {
                (settled.engaged, settled.force) = meet(&bent_tool(walk, &settled.bent));
                let Some(there) = land(&settled.force) else { break };
                let step = there.0 - settled.bent.0;
                // Later rounds take half steps: a cut that comes and goes with the deflection oscillates.
                let share = if round < 5 { 1.0 } else { 0.5 };
                settled.bent = (settled.bent.0 + step * share, there.1);
                if step.norm() < SETTLED {
                    break;
                }
            }
            bent_tool(walk, &settled.bent)
        };
        if displacement != Vector3::zeros() {
            direction = Some(displacement.normalize());
        }
        if let Some(feed_per_tooth) = feed_per_tooth {
            let engaged = settled.engaged;
            let force = FedForce::new(&wobj_from_stock, &engaged.force, feed_per_tooth);
            passed.push(place.share, &Met::new(engaged, force, &tool, &displacement));
            if !begins {
                walk.weigh(&settled.engaged, &settled.force, feed_per_tooth);
            }
        }
        if begins {
            // The segment continues from the tool's position.
            from = Some(from.unwrap_or(tool));
            continue;
        }
        if let Some(from) = from.filter(|_| through.cuts || rounds) {
            let removed = walk.stock.remove(front.solid(), &from, &tool);
            // The material of the rounding is not a collision of the segment itself.
            passed.removed += if through.cuts { removed } else { 0.0 };
        }
        from = Some(tool);
    }
    walk.finish(prepared, passed);
    let end = feed_per_tooth.zip(direction).map(|(feed_per_tooth, direction)| {
        (End { target: i, front: through.front, feed_per_tooth, direction }, settled)
    });
    Some(Last { target: i, tool: from?, bent: settled.bent, end })
}
