use super::Number;
use deflex_effects::{Cutting, CuttingTorque, ForceLaw, PartAt, Situation, ToolFrame, UnitAt};
use deflex_lanes::{Frame, Mask, Vector, WIDTH};
use deflex_robot::Pose;
use nalgebra::{Matrix3, Rotation3, Vector3};
use smallvec::SmallVec;

/// The tool and the work object of targets, at the positions of the mechanical units there.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct Setting {
    /// Declared work object in the base, m.
    pub base_from_wobj: Pose,
    /// Gravity, base axes, m/s².
    pub gravity: Vector3<f64>,
    /// Declared tool.
    pub tool: ToolFrame,
    /// Whether the robot holds the part against a stationary tool. Then `base_from_wobj` is the frame of the stationary tool, and the frame
    /// of `tool` in the flange is the work object.
    pub held: bool,
}

/// A [`Situation`] that borrows the values which many targets share.
#[derive(Clone, Copy)]
#[doc(hidden)]
pub struct Site<'a> {
    pub setting: &'a Setting,
    /// Wanted pose of the TCP, m.
    pub wobj_from_tcp: &'a Pose,
    pub cutting: Cutting<'a>,
    /// Whether the tool leans by the angles of the cutting law, so that [`ForceLaw::rest`] is the force at the wanted pose.
    pub leaned: bool,
    /// This field and those after it have the meaning of the fields of [`Situation`] with the same name.
    pub normal: Vector3<f64>,
    pub velocity: Vector3<f64>,
    pub cut_length: f64,
    pub time: f64,
    pub temperature: Option<f64>,
    pub payload: f64,
    pub units: &'a [UnitAt],
    pub part: Option<PartAt<'a>>,
    pub torque: Option<&'a CuttingTorque>,
}

impl Setting {
    pub fn of(situation: &Situation<'_>) -> Self {
        let Situation { base_from_wobj, gravity, tool, .. } = *situation;
        Self { base_from_wobj, gravity, tool, held: false }
    }

    /// The flange pose at which the TCP has a pose in the work object.
    pub fn base_from_flange(&self, wobj_from_tcp: &Pose) -> Pose {
        let pose = if self.held { wobj_from_tcp.inverse() } else { *wobj_from_tcp };
        self.base_from_wobj * pose * self.tool.flange_from_tcp.inverse()
    }

    /// The pose of the TCP in the work object at a flange pose.
    pub fn wobj_from_tcp(&self, base_from_flange: &Pose) -> Pose {
        let pose = self.base_from_wobj.inv_mul(&(base_from_flange * self.tool.flange_from_tcp));
        if self.held { pose.inverse() } else { pose }
    }
}

impl<'a> Site<'a> {
    pub fn of(situation: &'a Situation<'a>, setting: &'a Setting) -> Self {
        Self {
            setting,
            wobj_from_tcp: &situation.wobj_from_tcp,
            cutting: situation.cutting,
            leaned: false,
            normal: situation.normal,
            velocity: situation.velocity,
            cut_length: situation.cut_length,
            time: situation.time,
            temperature: situation.temperature,
            payload: situation.payload,
            units: situation.units,
            part: situation.part,
            torque: situation.torque,
        }
    }
}

/// The inputs of targets, lane by lane.
#[derive(Default)]
pub(super) struct Block<'a, R: Number> {
    /// The inputs of the effects. The solver sets the commanded angles as it finds them.
    pub(super) site: deflex_effects::Site<R>,
    /// Wanted pose of the TCP in the declared work object.
    pub(super) wanted: Frame<R>,
    /// The declared TCP in the flange.
    pub(super) flange_from_tcp: Frame<R>,
    /// Orientation of the feed frame; its origin is not used.
    pub(super) wobj_from_feed: Frame<R>,
    /// See [`ForceLaw::slope`].
    pub(super) slope: Vector<R>,
    /// [`ForceLaw::rest`] of each lane, the lanes that have one, and the lanes in which it is the force at the wanted pose.
    rest: Vector<R>,
    has_rest: [bool; WIDTH],
    rests: [bool; WIDTH],
    /// The setting and the law that a lane has already; they seldom change from target to target.
    settings: [Option<&'a Setting>; WIDTH],
    laws: [Option<&'a dyn ForceLaw>; WIDTH],
    /// For each law, the lanes that have it.
    lanes: SmallVec<[R::Mask; 2]>,
    /// Whether laws have changed since `lanes` was computed.
    changed: bool,
    /// Whether any lane has ever had mechanical units, a part that yields, or torques of earlier forces.
    units: bool,
    part: bool,
    torque: bool,
}

impl<'a, R: Number> Block<'a, R> {
    /// Sets the site of a lane.
    pub(super) fn set(&mut self, lane: usize, site: &Site<'a>) {
        self.set_setting(lane, site.setting);
        self.wanted.set(lane, site.wobj_from_tcp);
        let own = &mut self.site;
        own.wanted.set(lane, &site.wobj_from_tcp.translation.vector);
        own.normal.set(lane, &site.normal);
        own.velocity.set(lane, &site.velocity);
        own.cut_length.set(lane, site.cut_length);
        own.time.set(lane, site.time);
        own.temperature.set(lane, site.temperature.unwrap_or(f64::NAN));
        own.payload.set(lane, site.payload);
        if !site.units.is_empty() || self.units {
            own.set_units(lane, site.units);
            self.units = true;
        }
        if site.part.is_some() || self.part {
            own.part.set(lane, site.part.as_ref());
            self.part = true;
        }
        if site.torque.is_some() || self.torque {
            own.set_torque(lane, site.torque);
            self.torque = true;
        }
        match &site.cutting {
            Cutting::Air => self.cut(lane, &NOWHERE, None),
            // A constant force is the unit force `FORCE` along x of a frame whose x axis is the force itself.
            Cutting::Constant(force) => {
                self.cut(lane, &NOWHERE, None);
                self.wobj_from_feed.x.set(lane, force);
            }
            Cutting::Law { law, wobj_from_feed } => self.cut(lane, wobj_from_feed, Some(*law)),
        }
        self.rests[lane] = self.has_rest[lane] && (site.leaned || self.laws[lane].is_none());
    }

    /// Completes a block of which the first `count` lanes are set: the others get no force.
    pub(super) fn first(&mut self, count: usize) {
        if !std::mem::take(&mut self.changed) && count == R::WIDTH {
            return;
        }
        for lane in count..R::WIDTH {
            self.cut(lane, &NOWHERE, None);
            self.rests[lane] = true;
        }
        self.changed = count < R::WIDTH;
        self.lanes.clear();
        let mut left = R::Mask::of(|lane| self.laws[lane].is_some());
        while let Some(law) = left.next().and_then(|lane| self.laws[lane]) {
            let here = left & R::Mask::of(|lane| same(Some(law), self.laws[lane]));
            self.lanes.push(here);
            left = left & here.not();
        }
    }

    /// Sets the setting of a lane.
    pub(super) fn set_setting(&mut self, lane: usize, setting: &'a Setting) {
        if self.settings[lane].is_some_and(|here| std::ptr::eq(here, setting)) {
            return;
        }
        self.settings[lane] = Some(setting);
        let Setting { base_from_wobj, gravity, tool, .. } = setting;
        self.site.base_from_wobj.set(lane, base_from_wobj);
        self.site.gravity.set(lane, gravity);
        self.flange_from_tcp.set(lane, &tool.flange_from_tcp);
        self.site.tool_mass.set(lane, tool.mass);
        self.site.tool_cog.set(lane, &tool.cog);
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

    /// Cutting forces at the wanted poses, N, feed frame; `None` unless they are known in all lanes.
    pub(super) fn resting(&self) -> Option<&Vector<R>> {
        self.rests.iter().take(R::WIDTH).all(|rests| *rests).then_some(&self.rest)
    }

    /// Computes the cutting forces, N, feed frame, for shifts of the tip, m, and directions of the tool axis, both in the feed frame.
    pub(super) fn forces(&self, shift: &Vector<R>, axis: &Vector<R>, force: &mut Vector<R>) {
        *force = Vector::of(&FORCE);
        for here in &self.lanes {
            if let Some(law) = here.next().and_then(|lane| self.laws[lane]) {
                R::force(law, *here, shift, axis, force);
            }
        }
    }
}

/// The force of lanes without a law, in a frame whose x axis is the force itself.
const FORCE: Vector3<f64> = Vector3::new(1.0, 0.0, 0.0);

/// The frame of lanes without a force: every vector that is turned by it becomes zero.
const NOWHERE: Rotation3<f64> =
    Rotation3::from_matrix_unchecked(Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0));

fn same(law: Option<&dyn ForceLaw>, other: Option<&dyn ForceLaw>) -> bool {
    match (law, other) {
        (Some(law), Some(other)) => std::ptr::addr_eq(law, other),
        (None, None) => true,
        _ => false,
    }
}
