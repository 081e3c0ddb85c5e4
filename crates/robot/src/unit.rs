//! Mechanical units (tracks, positioners), and the poses of the base and the work objects that they carry.
//!
//! ```text
//! world_from_unit(e) = world_from_on(e) · Frame(base) · Rz(e)                 rotary
//! world_from_unit(e) = world_from_on(e) · Trans(direction · e) · Frame(base)  linear
//! world_from_base(e) = world_from_unit(e) · world_from_unit(0)⁻¹ · [robot] base
//! ```
//! where e is the position of the unit's own axis. The last line holds for the unit that carries the robot; for a track
//! it is Trans(direction · e) · base.

use super::{AxisName, EXTERNAL_AXES, External, Pose};
use nalgebra::{Rotation3, Translation3, Vector3};

/// How a unit moves.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_robot::UnitKind;
///
/// let track = UnitKind::Linear(Vector3::x()); // along x of the world
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UnitKind {
    /// Along a unit vector, in the frame of the unit or the world on which it stands.
    Linear(Vector3<f64>),
    /// About z of its own frame.
    Rotary,
}

/// What stands on a unit.
///
/// # Examples
/// ```
/// use deflex_robot::{Carries, Unit};
///
/// /// The units that carry the robot.
/// fn tracks(units: &[Unit]) -> impl Iterator<Item = &Unit> {
///     units.iter().filter(|unit| unit.carries == Carries::Robot)
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carries {
    /// The robot.
    Robot,
    /// The part.
    Part,
}

/// A mechanical unit: one axis in addition to the six of the arm.
///
/// # Examples
/// ```
/// use deflex_robot::{AxisName, Carries, Pose, Unit, UnitKind};
///
/// let table = Unit {
///     name: "TABLE".to_owned(),
///     named: AxisName::External(0),
///     axis: 0,
///     kind: UnitKind::Rotary,
///     carries: Carries::Part,
///     frame: Pose::translation(1.5, 0.0, 0.6),
///     on: None,
///     min: -180.0,
///     max: 180.0,
///     max_speed: Some(90.0),
///     free: false,
/// };
/// println!("{} moves from {} to {}", table.name, table.min, table.max); // mm or degrees
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Its name in the program (`ActUnit`, `ufmec`).
    pub name: String,
    /// The axis that moves it.
    pub named: AxisName,
    /// Index of its position in an [`External`]: for external axes their own index, for motion groups an index that is
    /// free.
    pub axis: usize,
    /// How it moves.
    pub kind: UnitKind,
    /// Whether it carries the robot, the part or neither.
    pub carries: Carries,
    /// Its frame at position zero, in the world or in the moved frame of the unit on which it stands, m.
    pub frame: Pose,
    /// Index of the unit on which it stands; `None` for a unit on the floor.
    pub on: Option<usize>,
    /// Smallest position, mm or degrees.
    pub min: f64,
    /// Largest position, mm or degrees.
    pub max: f64,
    /// Largest speed, mm/s or degrees/s, if it is known.
    pub max_speed: Option<f64>,
    /// Whether its position may be chosen together with the turn about the tool axis.
    pub free: bool,
}

impl Unit {
    /// Its frame relative to the unit on which it stands, at a position of its axis (mm or degrees).
    fn at(&self, position: f64) -> Pose {
        match self.kind {
            UnitKind::Linear(direction) => Translation3::from(direction * (1e-3 * position)) * self.frame,
            UnitKind::Rotary => self.frame * Rotation3::from_axis_angle(&Vector3::z_axis(), position.to_radians()),
        }
    }
}

/// The units of a cell.
///
/// # Examples
/// ```
/// use deflex_robot::{AxisName, Carries, Pose, Unit, UnitKind, Units};
///
/// # let table = Unit {
/// #     name: "TABLE".to_owned(),
/// #     named: AxisName::External(0),
/// #     axis: 0,
/// #     kind: UnitKind::Rotary,
/// #     carries: Carries::Part,
/// #     frame: Pose::translation(1.5, 0.0, 0.6),
/// #     on: None,
/// #     min: -180.0,
/// #     max: 180.0,
/// #     max_speed: Some(90.0),
/// #     free: false,
/// # };
/// let units = Units::new(vec![table]).expect("units that stand on each other");
/// let turned = units.world_from_unit(0, &[90.0, 0.0, 0.0, 0.0, 0.0, 0.0]); // mm or degrees
/// assert!((turned.rotation.angle() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
/// assert_eq!(units.world_from_base(&Pose::identity(), &[90.0; 6]), Pose::identity()); // no unit carries the robot
/// assert_eq!((units.all().len(), units.chain(None).count()), (1, 0));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Units {
    all: Vec<Unit>,
    /// The unit on which the robot stands.
    robot: Option<usize>,
    /// Axes that carry neither robot nor part: servo guns, grippers, other arms.
    idle: Vec<AxisName>,
}

impl Units {
    /// The units of a cell, each of which stands on the floor or on another unit.
    ///
    /// # Errors
    /// The index of a unit and what is wrong with it: units stand on each other in a circle, the robot stands on two
    /// chains of units, or the robot stands on the part.
    pub fn new(all: Vec<Unit>) -> Result<Self, (usize, String)> {
        for (i, unit) in all.iter().enumerate() {
            let mut below = Some(i);
            for _ in 0..all.len() {
                below = below.and_then(|at| all.get(at)?.on);
            }
            if below.is_some() {
                return Err((i, format!("unit `{}` stands on itself", unit.name)));
            }
            if unit.carries == Carries::Robot && unit.on.is_some_and(|on| all[on].carries == Carries::Part) {
                let on = unit.on.map_or("", |on| &all[on].name);
                return Err((
                    i,
                    format!("unit `{}` carries the robot, but stands on `{on}`, which carries the part", unit.name),
                ));
            }
        }
        let robot = |i: &usize| all[*i].carries == Carries::Robot;
        let last = |i: &usize| !all.iter().any(|unit| unit.carries == Carries::Robot && unit.on == Some(*i));
        let mut under_robot = (0..all.len()).filter(robot).filter(last);
        let (first, second) = (under_robot.next(), under_robot.next());
        if let (Some(first), Some(second)) = (first, second) {
            let (a, b) = (&all[first].name, &all[second].name);
            return Err((
                second,
                format!("units `{a}` and `{b}` both carry the robot, and neither stands on the other"),
            ));
        }
        Ok(Self { all, robot: first, idle: Vec::new() })
    }

    /// Adds axes that carry neither the robot nor the part.
    #[must_use]
    #[doc(hidden)]
    pub fn and_idle(self, idle: Vec<AxisName>) -> Self {
        Self { idle, ..self }
    }

    /// Whether the cell states what an axis moves.
    #[must_use]
    #[doc(hidden)]
    pub fn knows(&self, axis: AxisName) -> bool {
        self.all.iter().any(|unit| unit.named == axis) || self.idle.iter().any(|idle| idle.covers(axis))
    }

    /// All units, in the order of the cell file.
    #[must_use]
    pub fn all(&self) -> &[Unit] {
        &self.all
    }

    /// Index of the unit on which the robot stands.
    #[must_use]
    #[doc(hidden)]
    pub fn under_robot(&self) -> Option<usize> {
        self.robot
    }

    /// Index of the unit with a name, in any case.
    #[must_use]
    #[doc(hidden)]
    pub fn named(&self, name: &str) -> Option<usize> {
        self.all.iter().position(|unit| unit.name.eq_ignore_ascii_case(name))
    }

    /// The unit, the unit on which it stands, and so on.
    pub fn chain(&self, unit: Option<usize>) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(unit, |at| self.all[*at].on)
    }

    /// A unit's frame in the world, m.
    #[must_use]
    pub fn world_from_unit(&self, unit: usize, external: &External) -> Pose {
        self.chain(Some(unit)).fold(Pose::identity(), |above, at| {
            let unit = &self.all[at];
            unit.at(external[unit.axis]) * above
        })
    }

    /// Frame of a unit at position zero, in the world, for the present positions of the units on which it stands, m.
    #[must_use]
    #[doc(hidden)]
    pub fn world_from_frame(&self, unit: usize, external: &External) -> Pose {
        let below = self.all[unit].on.map_or_else(Pose::identity, |on| self.world_from_unit(on, external));
        below * self.all[unit].frame
    }

    /// Pose of the robot base in the world, m. `world_from_base` is its pose when all units are at zero.
    #[must_use]
    pub fn world_from_base(&self, world_from_base: &Pose, external: &External) -> Pose {
        match self.robot {
            None => *world_from_base,
            Some(unit) => {
                let at_zero = self.world_from_unit(unit, &[0.0; EXTERNAL_AXES]);
                self.world_from_unit(unit, external) * at_zero.inverse() * world_from_base
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn unit(name: &str, axis: usize, kind: UnitKind, carries: Carries, on: Option<usize>) -> Unit {
        Unit {
            name: name.into(),
            named: AxisName::External(axis),
            axis,
            kind,
            carries,
            frame: Pose::identity(),
            on,
            min: -1e4,
            max: 1e4,
            max_speed: None,
            free: false,
        }
    }

    #[test]
    fn a_positioner_on_a_track_by_hand() {
        let track = unit("T", 0, UnitKind::Linear(Vector3::y()), Carries::Robot, None);
        let table =
            Unit { frame: Pose::translation(1.5, 0.0, 0.6), ..unit("S", 1, UnitKind::Rotary, Carries::Part, Some(0)) };
        let units = Units::new(vec![track, table]).unwrap();
        let external = [500.0, 90.0, f64::NAN, f64::NAN, f64::NAN, f64::NAN];
        let base = Pose::translation(0.0, 0.0, 0.3);
        assert_relative_eq!(units.world_from_base(&base, &external), Pose::translation(0.0, 0.5, 0.3), epsilon = 1e-15);
        // x of the turned table points along y of the world.
        let seen = units.world_from_unit(1, &external) * nalgebra::Point3::new(0.1, 0.0, 0.0);
        assert_relative_eq!(seen.coords, Vector3::new(1.5, 0.6, 0.6), epsilon = 1e-15);
    }

    #[test]
    fn axes_are_named_as_programs_name_them() {
        for name in ["eax_a", "eax_f", "gp2_j1", "gp3_e2", "gp4"] {
            assert_eq!(AxisName::read(name).unwrap().to_string(), name);
        }
        assert_eq!(AxisName::read("E1"), Some(AxisName::External(0)));
        assert_eq!(AxisName::read("GP2_J1"), Some(AxisName::Joint { group: 2, number: 1 }));
        for other in ["", "e7", "gp1_j1", "gp2_", "gp2_j0", "gp22_j1", "gp", "eax_g", "j1"] {
            assert_eq!(AxisName::read(other), None, "{other}");
        }
        let gun = AxisName::Joint { group: 2, number: 1 };
        assert!(AxisName::Group(2).covers(gun) && !AxisName::Group(3).covers(gun) && gun.covers(gun));
    }

    #[test]
    fn units_that_cannot_stand_are_refused() {
        let rotary = |name, carries, on| unit(name, 0, UnitKind::Rotary, carries, on);
        let circle = vec![rotary("A", Carries::Part, Some(1)), rotary("B", Carries::Part, Some(0))];
        assert!(Units::new(circle).is_err());
        let two = vec![rotary("A", Carries::Robot, None), rotary("B", Carries::Robot, None)];
        assert!(Units::new(two).is_err());
        let on_part = vec![rotary("A", Carries::Part, None), rotary("B", Carries::Robot, Some(0))];
        assert!(Units::new(on_part).is_err());
    }
}
