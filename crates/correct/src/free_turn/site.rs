//! The data of each target that the search keeps. A million targets take half a gigabyte; their points, with the data of a correction,
//! would take four.

use crate::load::{PointLoad, Through};
use crate::mount::Moved;
use crate::point::{Milled, Point};
use crate::{KeptReason, Prepared};
use deflex_effects::PartYield;
use deflex_program::{ArcTurn, Goal, Program};
use deflex_robot::{Joints, Pose};
use deflex_text::Diagnostic;
use nalgebra::Vector3;
use std::sync::Arc;

/// A target's [`Point`] and its place in the text.
pub(super) struct Site {
    pub(super) setting: u32,
    pub(super) moved: Option<Arc<Moved>>,
    pub(super) unsolved: Option<KeptReason>,
    pub(super) wobj_from_tcp: Pose,
    pub(super) motor: Joints,
    /// Direction of travel, in single precision.
    travel: [f32; 6],
    normal: Vector3<f64>,
    velocity: Vector3<f64>,
    cut_length: f64,
    time: f64,
    load: PointLoad,
    /// Values that few points have.
    rare: Option<Box<Rare>>,
    plunges: bool,
    /// Whether it ends a motion.
    pub(super) is_end: bool,
    /// Whether the text has a surface normal.
    pub(super) has_normal: bool,
    place: TargetPlace,
}

/// Data that few points have.
struct Rare {
    temperature: Option<f64>,
    payload: f64,
    through: Option<Through>,
    milled: Option<Box<Milled>>,
    part: Option<Arc<PartYield>>,
}

/// The place of a target in the text.
struct TargetPlace {
    ordinal: u32,
    line: u32,
    column: u32,
}

impl Site {
    /// The site of target `i`. Travel needs no more than single precision, and columns are below 2³².
    pub(super) fn of(program: &Program, prepared: &Prepared, i: usize) -> Self {
        let (target, point) = (&program.targets[i], prepared.points[i].clone());
        let Point { temperature, payload, through, milled, part, .. } = point;
        let is_rare = temperature.is_some() || payload != 0.0 || through.is_some() || milled.is_some();
        let column = program.sources[usize::from(target.source)].column(target.span.start as usize);
        Self {
            setting: point.setting,
            moved: point.moved,
            unsolved: point.unsolved,
            wobj_from_tcp: point.wobj_from_tcp,
            motor: point.motor,
            travel: std::array::from_fn(|axis| point.travel[axis] as f32),
            normal: point.normal,
            velocity: point.velocity,
            cut_length: point.cut_length,
            time: point.time,
            load: point.load,
            rare: is_rare.then(|| Box::new(Rare { temperature, payload, through, milled, part })),
            plunges: point.plunges,
            is_end: target.is_end(),
            has_normal: matches!(target.goal, Goal::Axis { normal: Some(_), .. }),
            place: TargetPlace { ordinal: target.ordinal, line: target.line, column: column as u32 },
        }
    }

    /// The point. Before a choice, errors count from the programmed pose.
    pub(super) fn point(&self) -> Point {
        let rare = self.rare.as_deref();
        Point {
            setting: self.setting,
            moved: self.moved.clone(),
            unsolved: self.unsolved,
            wobj_from_tcp: self.wobj_from_tcp,
            reference: self.wobj_from_tcp,
            motor: self.motor,
            travel: Joints::from_fn(|axis, _| f64::from(self.travel[axis])),
            normal: self.normal,
            velocity: self.velocity,
            cut_length: self.cut_length,
            time: self.time,
            temperature: rare.and_then(|rare| rare.temperature),
            payload: rare.map_or(0.0, |rare| rare.payload),
            load: self.load,
            through: rare.and_then(|rare| rare.through),
            milled: rare.and_then(|rare| rare.milled.clone()),
            part: rare.and_then(|rare| rare.part.clone()),
            // Creep follows the posture that is still to be chosen.
            torque: None,
            // CL data have no arcs.
            arc_turn: ArcTurn::default(),
            turned_by_arc: false,
            plunges: self.plunges,
        }
    }

    pub(super) fn cuts(&self) -> bool {
        !matches!(self.load, PointLoad::Air)
    }

    pub(super) fn ordinal(&self) -> u32 {
        self.place.ordinal
    }

    /// A message at the place of the target in a file.
    pub(super) fn at(&self, file: &str, message: Diagnostic) -> Diagnostic {
        let TargetPlace { line, column, .. } = self.place;
        Diagnostic { file: file.to_owned(), line: line as usize, column: column as usize, ..message }
    }
}
