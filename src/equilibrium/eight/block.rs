use super::EightArm;
use crate::effects::{ForceLaw, ToolFrame};
use crate::lanes::{Frame, Lanes, Mask, Vector, WIDTH};
use crate::robot::Pose;
use nalgebra::{Rotation3, Vector3};
use smallvec::SmallVec;

/// A tool and a work object that targets are run with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Setting {
    /// Declared work object in the base.
    pub(crate) base_from_wobj: Pose,
    /// Declared tool.
    pub(crate) tool: ToolFrame,
}

/// Where a target is, and what acts on it there: as much of a [`Situation`](crate::effects::Situation) as simple effects ask.
#[derive(Clone, Copy)]
pub(crate) struct Site<'a> {
    pub(crate) setting: &'a Setting,
    /// Where the TCP should be, m.
    pub(crate) wobj_from_tcp: &'a Pose,
    /// kg
    pub(crate) payload: f64,
    /// Length cut up to there, m.
    pub(crate) cut_length: f64,
    pub(crate) cut: Cut<'a>,
    /// Whether the tool leans against the surface as the law of the cut has it.
    pub(crate) leaned: bool,
}

/// [`Cutting`](crate::effects::Cutting) where it stands: it is copied into lanes alone.
#[derive(Clone, Copy)]
pub(crate) enum Cut<'a> {
    Air,
    /// N, work object axes.
    Constant(&'a Vector3<f64>),
    Law {
        law: &'a dyn ForceLaw,
        wobj_from_feed: &'a Rotation3<f64>,
    },
}

/// Work object and TCP of eight targets.
#[derive(Default)]
pub(super) struct Frames {
    pub(super) base_from_wobj: Frame,
    pub(super) flange_from_tcp: Frame,
}

impl Frames {
    fn set(&mut self, lane: usize, base_from_wobj: &Pose, flange_from_tcp: &Pose) {
        self.base_from_wobj.set(lane, base_from_wobj);
        self.flange_from_tcp.set(lane, flange_from_tcp);
    }
}

/// The sites of eight targets.
#[derive(Default)]
pub(super) struct Block<'a> {
    pub(super) declared: Frames,
    /// Where work object and TCP really are.
    pub(super) actual: Frames,
    /// Where the TCP should be, work object axes, m.
    pub(super) wanted: Vector,
    /// kg
    pub(super) tool_mass: Lanes,
    /// Flange frame, m.
    pub(super) tool_cog: Vector,
    /// kg
    pub(super) payload: Lanes,
    /// Of the cutting force on its law's.
    pub(super) factor: Lanes,
    /// Axes only.
    pub(super) wobj_from_feed: Frame,
    /// See [`ForceLaw::slope`].
    pub(super) slope: Vector,
    /// See [`ForceLaw::rest`]; where there is one; and where it is the force at the wanted pose.
    rest: Vector,
    has_rest: [bool; WIDTH],
    rests: [bool; WIDTH],
    /// What is in the lanes already: it seldom changes.
    settings: [Option<&'a Setting>; WIDTH],
    laws: [Option<&'a dyn ForceLaw>; WIDTH],
    /// The lanes of each law.
    lanes: SmallVec<[Mask; 2]>,
    /// Whether laws have changed since these were found.
    changed: bool,
}

impl<'a> Block<'a> {
    /// Puts another site into a lane.
    pub(super) fn set(&mut self, arm: &EightArm<'_>, lane: usize, site: &Site<'a>) {
        self.run_with(arm, lane, site.setting);
        self.factor.set(lane, arm.force_factor(site.cut_length));
        self.wanted.set(lane, &site.wobj_from_tcp.translation.vector);
        self.payload.set(lane, site.payload);
        match site.cut {
            Cut::Air => self.cut(lane, &NOWHERE, None),
            // As a law whose frame is the force's own: along its first axis.
            Cut::Constant(force) => {
                self.cut(lane, &NOWHERE, None);
                self.wobj_from_feed.x.set(lane, force);
            }
            Cut::Law { law, wobj_from_feed } => self.cut(lane, wobj_from_feed, Some(law)),
        }
        self.rests[lane] = self.has_rest[lane] && (site.leaned || self.laws[lane].is_none());
    }

    /// All lanes are set that are of interest: the first ones.
    pub(super) fn first(&mut self, count: usize) {
        if !std::mem::take(&mut self.changed) && count == WIDTH {
            return;
        }
        for lane in count..WIDTH {
            self.cut(lane, &NOWHERE, None);
            self.rests[lane] = true;
        }
        self.changed = count < WIDTH;
        self.lanes.clear();
        let mut left = Mask::of(|lane| self.laws[lane].is_some());
        while let Some(law) = left.next().and_then(|lane| self.laws[lane]) {
            let here = left & Mask::of(|lane| same(Some(law), self.laws[lane]));
            self.lanes.push(here);
            left = left & here.not();
        }
    }

    /// Puts another setting into a lane.
    pub(super) fn run_with(&mut self, arm: &EightArm<'_>, lane: usize, setting: &'a Setting) {
        if self.settings[lane].is_some_and(|here| std::ptr::eq(here, setting)) {
            return;
        }
        self.settings[lane] = Some(setting);
        let Setting { base_from_wobj, tool } = setting;
        self.declared.set(lane, base_from_wobj, &tool.flange_from_tcp);
        self.actual.set(lane, &arm.work_object.after(base_from_wobj), &arm.tcp.after(&tool.flange_from_tcp));
        self.tool_mass.set(lane, setting.tool.mass);
        self.tool_cog.set(lane, &setting.tool.cog);
    }

    fn cut(&mut self, lane: usize, wobj_from_feed: &Rotation3<f64>, law: Option<&'a dyn ForceLaw>) {
        self.wobj_from_feed.set_axes(lane, wobj_from_feed);
        if same(self.laws[lane], law) && law.is_some() {
            return;
        }
        let rest = law.map_or(Some(FORCE), ForceLaw::rest);
        self.slope.set(lane, &law.map_or_else(Vector3::zeros, ForceLaw::slope));
        self.rest.set(lane, &rest.unwrap_or(FORCE));
        self.has_rest[lane] = rest.is_some();
        self.changed |= !same(self.laws[lane], law);
        self.laws[lane] = law;
    }

    /// Cutting forces at the wanted poses, N, feed frame, where all are known.
    pub(super) fn resting(&self) -> Option<&Vector> {
        self.rests.iter().all(|rests| *rests).then_some(&self.rest)
    }

    /// Cutting forces, N, feed frame, for shifts of the tip, m, and tool axes there.
    pub(super) fn forces(&self, shift: &Vector, axis: &Vector, force: &mut Vector) {
        *force = Vector::of(&FORCE);
        for here in &self.lanes {
            if let Some(law) = here.next().and_then(|lane| self.laws[lane]) {
                law.forces(*here, shift, axis, force);
            }
        }
    }
}

/// Without a law the frame is the force's own.
const FORCE: Vector3<f64> = Vector3::new(1.0, 0.0, 0.0);

/// The axes of no frame: nothing that is turned into it is left.
const NOWHERE: Rotation3<f64> =
    Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0));

fn same(law: Option<&dyn ForceLaw>, other: Option<&dyn ForceLaw>) -> bool {
    match (law, other) {
        (Some(law), Some(other)) => std::ptr::addr_eq(law, other),
        (None, None) => true,
        _ => false,
    }
}
