//! The physics of an effect, written once for a single target and for several at a time (lanes).

use super::{CREEP_TIMES_S, Carries, CuttingTorque, Listed, MOST_CLAMPS, PartAt, UnitAt};
use deflex_lanes::{Frame, Real, Vector, six};
use deflex_robot::kinematics::{Chain, Six};
use deflex_robot::{EXTERNAL_AXES, Joints, Robot};
use nalgebra::{Matrix3, Vector3};

/// The physics of an effect: the **loads** that it adds, the **offsets** by which it moves the geometry independently of the load, and
/// the **deflections** into which it turns loads.
///
/// All methods are pure: the same state gives the same answer, so that targets can be solved in any order. Every method adds to the
/// values of the effects before it.
pub(crate) trait Physics: Listed {
    /// The fields of [`Load`], [`Offset`] and [`Deflection`] that the effect changes, except joint angles.
    fn parts(&self) -> Parts {
        self.entry().parts
    }

    /// Adds to the loads. Called before [`Physics::deflect`] of any effect, in the order of the cell file.
    #[inline(always)]
    fn load<R: Real>(&self, state: &State<'_, R>, load: &mut Load<R>) {
        let _ = (state, load);
    }

    /// Adds the offsets, which do not depend on the load; called once for each command.
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        let _ = (site, out);
    }

    /// Adds the deflections under `load`, which has the loads of all effects and the motor torques.
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let _ = (state, load, out);
    }

    /// An estimate of the compliance of the joints at the motors, rad/(N·m), with which the solver starts. `stiffness` is the declared one,
    /// N·m/rad.
    fn compliance(&self, stiffness: Option<&Joints>) -> [f64; 6] {
        let _ = stiffness;
        [0.0; 6]
    }
}

/// A set of the fields that the effects of a cell change, except joint angles. The solver skips all other fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[doc(hidden)]
pub struct Parts(u16);

impl Parts {
    pub const NONE: Self = Self(0);
    /// [`Load::links`].
    pub(crate) const WEIGHTS: Self = Self(1);
    /// [`Load::cut`]: the effect changes the force of the cutting law.
    pub const CUT: Self = Self(1 << 1);
    /// [`Offset::rows`].
    pub const ROWS: Self = Self(1 << 2);
    /// [`Offset::tcp`].
    pub const TCP: Self = Self(1 << 3);
    /// [`Offset::wobj`].
    pub const WOBJ: Self = Self(1 << 4);
    /// [`Offset::lag`].
    pub const LAG: Self = Self(1 << 5);
    /// [`Deflection::lost`].
    pub const LOST: Self = Self(1 << 6);
    /// [`Deflection::tilt`].
    pub const TILT: Self = Self(1 << 7);
    /// [`Deflection::base`].
    pub const BASE: Self = Self(1 << 8);
    /// [`Deflection::flange`].
    pub const FLANGE: Self = Self(1 << 9);
    /// [`Deflection::tip`].
    pub const TIP: Self = Self(1 << 10);
    /// [`Deflection::part`].
    pub const PART: Self = Self(1 << 11);

    /// The union of two sets.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether the two sets have a field in common.
    #[inline(always)]
    pub const fn has(self, any: Self) -> bool {
        self.0 & any.0 != 0
    }

    /// Whether the TCP differs from the nominal forward kinematics of the actual joint angles.
    pub const fn moves_geometry(self) -> bool {
        const OFFSETS: Parts = Parts::ROWS.and(Parts::TCP).and(Parts::WOBJ).and(Parts::LAG);
        const DEFLECTIONS: Parts = Parts::TILT.and(Parts::BASE).and(Parts::FLANGE).and(Parts::TIP).and(Parts::PART);
        self.has(OFFSETS.and(DEFLECTIONS))
    }
}

/// The inputs of the equilibria that effects use, lane by lane; see [`Situation`](super::Situation).
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct Site<R> {
    /// Commanded motor angles, rad.
    pub commanded: Six<R>,
    /// Declared work object in the base, m.
    pub base_from_wobj: Frame<R>,
    /// Gravity, base axes, m/s².
    pub gravity: Vector<R>,
    /// Wanted position of the TCP, work object axes, m.
    pub wanted: Vector<R>,
    /// Surface normal, out of the material, unit, work object axes.
    pub normal: Vector<R>,
    /// Programmed velocity of the TCP, m/s, work object axes; zero where unknown.
    pub velocity: Vector<R>,
    /// Length cut so far, m.
    pub cut_length: R,
    /// Time since the start from cold, s.
    pub time: R,
    /// Temperature, °C; NaN if it was not measured.
    pub temperature: R,
    /// Payload in addition to the tool, kg.
    pub payload: R,
    /// The mechanical units of the cell; unused entries have the key 0.
    pub units: [UnitSite<R>; EXTERNAL_AXES],
    /// Mass of the declared tool, kg, and its centre of gravity in the flange frame, m.
    pub tool_mass: R,
    pub tool_cog: Vector<R>,
    /// The compliance of the clamped part where it is cut.
    pub part: PartSite<R>,
    /// See [`CuttingTorque`], N·m.
    pub(crate) delayed: [Six<R>; CREEP_TIMES_S.len()],
}

/// Number of motions of the clamps: each moves along three axes.
pub(super) const MOTIONS: usize = 3 * MOST_CLAMPS;

/// The compliance of clamped parts where they are cut, lane by lane; see [`PartYield`](super::PartYield).
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct PartSite<R> {
    /// The shift under a unit force along x, y and z, m/N, work object axes.
    pub(crate) compliance: [Vector<R>; 3],
    /// The shift of the place under motions of the clamps by 1 m, m, work object axes; zero for clamps that do not exist.
    pub(crate) motions: [Vector<R>; MOTIONS],
    /// Stiffness against these motions, N/m.
    pub(crate) stiffness: [[R; MOTIONS]; MOTIONS],
    /// Whether any lane may have a part. Most cells declare no part, and then these fields (some ten kilobytes) need no clearing.
    occupied: bool,
}

impl<R: Real> PartSite<R> {
    /// Sets or removes the part of a lane.
    pub fn set(&mut self, lane: usize, part: Option<&PartAt<'_>>) {
        if part.is_none() && !self.occupied {
            return;
        }
        self.occupied = true;
        let turned = |vector: Vector3<f64>| part.map_or_else(Vector3::zeros, |part| part.wobj_from_part * vector);
        let compliance =
            part.map_or_else(Matrix3::zeros, |part| part.yields.compliance * part.wobj_from_part.matrix().transpose());
        for (k, column) in self.compliance.iter_mut().enumerate() {
            column.set(lane, &turned(compliance.column(k).into()));
        }
        let count = part.map_or(0, |part| part.yields.motions.len()).min(MOTIONS);
        for i in 0..MOTIONS {
            let motion = part.filter(|_| i < count).map_or_else(Vector3::zeros, |part| part.yields.motions[i]);
            self.motions[i].set(lane, &turned(motion));
            for j in 0..MOTIONS {
                let stiffness = part.filter(|_| i.max(j) < count).map_or(0.0, |part| part.yields.stiffness[(i, j)]);
                self.stiffness[i][j].set(lane, stiffness);
            }
        }
    }
}

/// A mechanical unit at targets; see [`UnitAt`](super::UnitAt).
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct UnitSite<R> {
    /// Hash of its name ([`unit_key`](super::unit_key)); 0 for an unused entry.
    pub(crate) key: u64,
    pub(crate) wobj_from_unit: Frame<R>,
    /// 1 if the part (or the robot) stands on it, else 0.
    pub(crate) part: R,
    pub(crate) robot: R,
}

impl<R: Real> Site<R> {
    /// Sets the delayed torques of a lane.
    pub fn set_torque(&mut self, lane: usize, torque: Option<&CuttingTorque>) {
        let torque = torque.copied().unwrap_or_default();
        for (own, torque) in self.delayed.iter_mut().zip(&torque.delayed_nm) {
            own.iter_mut().zip(torque.iter()).for_each(|(own, torque)| own.set(lane, *torque));
        }
    }

    /// Sets the mechanical units of a lane. All lanes with units must have the same ones.
    pub fn set_units(&mut self, lane: usize, units: &[UnitAt]) {
        for (i, slot) in self.units.iter_mut().enumerate() {
            let unit = units.get(i);
            let (part, robot) = match unit.map(|unit| unit.carries) {
                Some(Carries::Part) => (1.0, 0.0),
                Some(Carries::Robot) => (0.0, 1.0),
                Some(Carries::BothOrNone) | None => (0.0, 0.0),
            };
            slot.part.set(lane, part);
            slot.robot.set(lane, robot);
            if let Some(unit) = unit {
                slot.key = unit.key;
                slot.wobj_from_unit.set(lane, &unit.wobj_from_unit);
            }
        }
    }
}

/// The state of the arm at a target, on which an effect may depend.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct State<'a, R> {
    /// Declared joint stiffness at the motors, N·m/rad; `None` if the cell declares none.
    pub stiffness: Option<&'a Joints>,
    /// Actual frames of the links in the base.
    pub chain: &'a Chain<R>,
    /// Actual TCP in the base, m.
    pub base_from_tcp: &'a Frame<R>,
    /// The inputs of the target.
    pub site: &'a Site<R>,
}

/// A force and a moment about the base origin, base axes, N and N·m.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wrench<R> {
    pub(crate) force: Vector<R>,
    pub(crate) moment: Vector<R>,
}

impl<R: Real> Wrench<R> {
    /// Adds a force (N) acting at a point (m), both in the base frame.
    #[inline(always)]
    pub(crate) fn add_force(&mut self, force: Vector<R>, point: Vector<R>) {
        self.force = self.force + force;
        self.moment = self.moment + point.cross(force);
    }
}

/// All loads on the arm at a target.
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct Load<R> {
    /// Cutting force on the tool at the TCP, base axes, N.
    pub cut: Vector<R>,
    /// Weights on links 1 to 6 (tool and payload on link 6); used only with [`Parts::WEIGHTS`].
    pub(crate) links: [Wrench<R>; 6],
    /// Sum of the weights on link i and all links after it; set together with the torques.
    beyond: [Wrench<R>; 6],
    /// Whether any effect adds weights.
    weights: bool,
    /// Torques of the cutting force and the weights at the motors, N·m, in motor coordinates (τ = Jᵀ F).
    pub torque: Six<R>,
    /// Factor on the declared stiffness of the part. Effects that use that stiffness have to apply the same factor.
    pub(crate) part_stiffness: R,
}

impl<R: Real> Load<R> {
    /// Resets the loads to a cutting force alone, N, base axes.
    #[inline(always)]
    pub fn start(&mut self, cut: Vector<R>, parts: Parts) {
        self.cut = cut;
        self.part_stiffness = R::of(1.0);
        self.weights = parts.has(Parts::WEIGHTS);
        if self.weights {
            self.links = [Wrench { force: Vector::ZERO, moment: Vector::ZERO }; 6];
        }
    }

    /// Moment of all loads on link i (0 to 5) and the links after it, about the origin of link i, base axes, N·m.
    #[inline(always)]
    pub(crate) fn moment_about(&self, i: usize, chain: &Chain<R>, tcp: Vector<R>) -> Vector<R> {
        let origin = chain.links[i].origin;
        let cut = (tcp - origin).cross(self.cut);
        if self.weights { cut + (self.beyond[i].moment - origin.cross(self.beyond[i].force)) } else { cut }
    }

    /// Sum of all loads on the arm, about the base origin.
    #[inline(always)]
    pub(crate) fn all(&self, tcp: Vector<R>) -> Wrench<R> {
        let mut all = if self.weights { self.beyond[0] } else { Wrench { force: Vector::ZERO, moment: Vector::ZERO } };
        all.add_force(self.cut, tcp);
        all
    }

    /// Computes the motor torques: each joint carries the moment of all loads after it, about its own axis.
    #[inline(always)]
    pub fn fill_torque(&mut self, robot: &Robot, chain: &Chain<R>, tcp: Vector<R>) {
        if self.weights {
            self.beyond[5] = self.links[5];
            for i in (0..5).rev() {
                let (link, after) = (self.links[i], self.beyond[i + 1]);
                self.beyond[i] = Wrench { force: after.force + link.force, moment: after.moment + link.moment };
            }
        }
        let serial = six!(i => chain.axes[i].dot(self.moment_about(i, chain, tcp)));
        self.torque = robot.by_motor(&serial);
    }
}

/// A small motion: shift, m, and rotation vector, rad.
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct Twist<R> {
    pub(crate) shift: Vector<R>,
    pub(crate) turn: Vector<R>,
}

impl<R: Real> Twist<R> {
    /// Adds a shift in mm and a rotation vector in rad, the units of cell files.
    #[inline(always)]
    pub(crate) fn add_mm(&mut self, shift_mm: [f64; 3], turn: [f64; 3]) {
        let shift = Vector3::from(shift_mm) * 1e-3;
        self.shift = self.shift + Vector::of(&shift);
        self.turn = self.turn + Vector::of(&turn.into());
    }

    /// The motion as a pose: the turn, then the shift, in the axes of the motion. Exact for any size.
    #[inline(always)]
    pub fn pose(&self) -> Frame<R> {
        Frame { origin: self.shift, ..Frame::of_rotation_vector(self.turn) }
    }

    /// The motion as a pose, by a series that is exact to rounding for turns up to 0.2 rad.
    #[inline(always)]
    pub fn small(&self) -> Frame<R> {
        Frame { origin: self.shift, ..Frame::identity().turned_by(self.turn) }
    }
}

/// Additions to the modified-DH rows, rad and m.
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct RowOffset<R> {
    pub alpha: R,
    pub a: R,
    pub d: R,
    pub theta: R,
}

/// The offsets of the real arm, which do not depend on the load. Effects add to it.
///
/// Here base, tilt, flange, tip and part are those of [`Deflection`]; joints and lost are the sums of both structs.
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct Offset<R> {
    /// Actual minus commanded motor angles, without lost motion, rad.
    pub joints: Six<R>,
    /// Lost motion: half of the angle that each joint loses when it reverses, rad, not negative.
    pub lost: Six<R>,
    /// Additions to the modified Denavit-Hartenberg rows.
    pub rows: [RowOffset<R>; 6],
    /// Actual TCP frame in the declared one.
    pub tcp: Twist<R>,
    /// Actual work object frame in the declared one.
    pub wobj: Twist<R>,
    /// Shift of the TCP, base axes, m.
    pub lag: Vector<R>,
}

/// The deflections of the real arm under its loads. Effects add to it.
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct Deflection<R> {
    /// Actual minus commanded motor angles, without lost motion, rad.
    pub joints: Six<R>,
    /// Lost motion that grows with the load, rad, not negative.
    pub lost: Six<R>,
    /// Turn of each link about x and y of its own frame, rad.
    pub tilt: [[R; 2]; 6],
    /// Motion of the base, in base axes about the base origin.
    pub base: Twist<R>,
    /// Turn at the flange, in the flange frame, rad.
    pub flange: Vector<R>,
    /// Shift of the TCP, in the axes of the declared TCP frame, m.
    pub tip: Vector<R>,
    /// Shift of the workpiece, base axes, m.
    pub part: Vector<R>,
}

impl<R: Real> Deflection<R> {
    /// Resets those fields to zero that the given parts use.
    #[inline(always)]
    pub fn clear(&mut self, parts: Parts) {
        self.joints = [R::ZERO; 6];
        self.lost = [R::ZERO; 6];
        if parts.moves_geometry() {
            *self = Self::none();
        }
    }

    /// Sets a lane to the deflection of one target.
    pub fn set(&mut self, lane: usize, one: &Deflection<f64>) {
        for i in 0..6 {
            self.joints[i].set(lane, one.joints[i]);
            self.lost[i].set(lane, one.lost[i]);
            (0..2).for_each(|k| self.tilt[i][k].set(lane, one.tilt[i][k]));
        }
        self.base.shift.set(lane, &one.base.shift.lane(0));
        self.base.turn.set(lane, &one.base.turn.lane(0));
        self.flange.set(lane, &one.flange.lane(0));
        self.tip.set(lane, &one.tip.lane(0));
        self.part.set(lane, &one.part.lane(0));
    }

    /// The deflection of one lane.
    pub fn lane(&self, lane: usize) -> Deflection<f64> {
        let vector = |v: &Vector<R>| Vector::of(&v.lane(lane));
        Deflection {
            joints: six!(i => self.joints[i].lane(lane)),
            lost: six!(i => self.lost[i].lane(lane)),
            tilt: six!(i => self.tilt[i].map(|turn| turn.lane(lane))),
            base: Twist { shift: vector(&self.base.shift), turn: vector(&self.base.turn) },
            flange: vector(&self.flange),
            tip: vector(&self.tip),
            part: vector(&self.part),
        }
    }

    #[inline(always)]
    fn none() -> Self {
        let (zero, none) = (Vector::ZERO, [R::ZERO; 6]);
        let base = Twist { shift: zero, turn: zero };
        Self { joints: none, lost: none, tilt: [[R::ZERO; 2]; 6], base, flange: zero, tip: zero, part: zero }
    }

    /// Replaces each number by `f` of it and the same numbers of `a` and `b`, in the fields that the parts use.
    #[inline(always)]
    pub fn mix(&mut self, a: &Self, b: &Self, parts: Parts, f: impl Fn(R, R, R) -> R) {
        for i in 0..6 {
            self.joints[i] = f(self.joints[i], a.joints[i], b.joints[i]);
        }
        let vector = |out: &mut Vector<R>, a: &Vector<R>, b: &Vector<R>| {
            *out = Vector::new(f(out.x, a.x, b.x), f(out.y, a.y, b.y), f(out.z, a.z, b.z));
        };
        if parts.has(Parts::LOST) {
            for i in 0..6 {
                self.lost[i] = f(self.lost[i], a.lost[i], b.lost[i]);
            }
        }
        if parts.has(Parts::TILT) {
            for i in 0..6 {
                for k in 0..2 {
                    self.tilt[i][k] = f(self.tilt[i][k], a.tilt[i][k], b.tilt[i][k]);
                }
            }
        }
        if parts.has(Parts::BASE) {
            vector(&mut self.base.shift, &a.base.shift, &b.base.shift);
            vector(&mut self.base.turn, &a.base.turn, &b.base.turn);
        }
        if parts.has(Parts::FLANGE) {
            vector(&mut self.flange, &a.flange, &b.flange);
        }
        if parts.has(Parts::TIP) {
            vector(&mut self.tip, &a.tip, &b.tip);
        }
        if parts.has(Parts::PART) {
            vector(&mut self.part, &a.part, &b.part);
        }
    }

    /// Sum of the products of all numbers. Radians and metres are added as they are, because an arm is about a metre long.
    #[inline(always)]
    pub fn dot(&self, other: &Self, parts: Parts) -> R {
        use deflex_robot::kinematics::dot;
        let mut sum = dot(&self.joints, &other.joints);
        if parts.has(Parts::LOST) {
            sum = sum + dot(&self.lost, &other.lost);
        }
        if parts.has(Parts::TILT) {
            for i in 0..6 {
                sum = sum + (self.tilt[i][0] * other.tilt[i][0] + self.tilt[i][1] * other.tilt[i][1]);
            }
        }
        if parts.has(Parts::BASE) {
            sum = sum + self.base.shift.dot(other.base.shift) + self.base.turn.dot(other.base.turn);
        }
        if parts.has(Parts::FLANGE) {
            sum = sum + self.flange.dot(other.flange);
        }
        if parts.has(Parts::TIP) {
            sum = sum + self.tip.dot(other.tip);
        }
        if parts.has(Parts::PART) {
            sum = sum + self.part.dot(other.part);
        }
        sum
    }
}

/// Makes the registry: an enum over borrowed effects, so that the physics of each is compiled for single targets and for lanes.
macro_rules! registry {
    ($($kind:ident: $($effect:ident),+;)*) => {
        /// Every effect that deflex knows, in the order of the documentation.
        pub static KINDS: &[Kind] = &[$($kind::KIND),*];

        /// An effect of any kind.
        #[derive(Clone, Copy, Debug)]
        enum AnyEffect<'a> {
            $($($effect(&'a $kind::$effect)),+),*
        }

        $($(
            impl Listed for $kind::$effect {
                fn entry(&self) -> &'static Kind {
                    &$kind::KIND
                }

                fn law(&self) -> Law<'_> {
                    Law(AnyEffect::$effect(self))
                }

                fn to_table(&self) -> toml::Table {
                    table_of($kind::KIND.name, self)
                }

                fn clone_box(&self) -> Box<dyn Effect> {
                    Box::new(self.clone())
                }
            }
        )+)*

        impl Law<'_> {
            /// [`Physics::parts`].
            #[doc(hidden)]
            pub fn parts(&self) -> Parts {
                match self.0 {
                    $($(AnyEffect::$effect(effect) => effect.parts()),+),*
                }
            }

            /// [`Physics::compliance`].
            #[doc(hidden)]
            pub fn compliance(&self, stiffness: Option<&Joints>) -> [f64; 6] {
                match self.0 {
                    $($(AnyEffect::$effect(effect) => effect.compliance(stiffness)),+),*
                }
            }

            /// [`Physics::load`].
            #[inline(always)]
            #[doc(hidden)]
            pub fn load<R: Real>(&self, state: &State<'_, R>, load: &mut Load<R>) {
                match self.0 {
                    $($(AnyEffect::$effect(effect) => effect.load(state, load)),+),*
                }
            }

            /// [`Physics::offset`].
            #[inline(always)]
            #[doc(hidden)]
            pub fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
                match self.0 {
                    $($(AnyEffect::$effect(effect) => effect.offset(site, out)),+),*
                }
            }

            /// [`Physics::deflect`].
            #[inline(always)]
            #[doc(hidden)]
            pub fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
                match self.0 {
                    $($(AnyEffect::$effect(effect) => effect.deflect(state, load, out)),+),*
                }
            }
        }
    };
}
pub(super) use registry;

/// The physics of an effect, as the solver of equilibria calls it.
///
/// # Examples
/// ```
/// use deflex_effects::{Law, kind};
///
/// // The solver of equilibria gets the physics of each effect.
/// let backlash = kind("backlash").expect("a kind of effect");
/// let effect = (backlash.read)(backlash.forms[0].parse()?)?;
/// let law: Law<'_> = effect.law();
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Law<'a>(pub(super) super::AnyEffect<'a>);
