//! The physical effects that make the real arm differ from the arm of the controller's model.
//!
//! Each file is one effect. An effect adds **loads** (to the cutting force, or weights), moves the geometry independently of the
//! load (**offsets**), or turns loads into motion (**deflections**); see `Physics`, which is written once for any number of targets.
//! Everything that other modules need to know about an effect is in its [`Kind`]: no code outside this folder names an effect.

mod backlash;
mod base_compliance;
mod bearing_compliance;
#[cfg(test)]
mod bench;
mod cable_pull;
mod clamp_compliance;
mod creep;
mod discrepancy;
mod empirical;
mod empirical_field;
mod force_scale;
mod gear_harmonic;
mod gravity;
mod hysteresis;
mod joint_coupling;
mod joint_error_curve;
mod joint_stiffness;
mod kind;
mod link_geometry;
mod part_stiffness;
mod physics;
mod presliding;
mod spline;
mod state;
mod stiffness_curve;
mod stiffness_temperature;
mod survey;
mod table;
mod thermal_growth;
mod tool_compliance;
mod tool_frame;
mod tool_wear;
mod tracking_lag;
mod unit_frame;
mod work_object_frame;
mod workpiece_compliance;
mod zero_offset;

pub use discrepancy::{Bell, BellSizes, discrepancy};
pub(crate) use empirical_field::fade;
pub use gear_harmonic::gear_harmonic;
pub use joint_error_curve::{JointCurve, joint_error_curve};
pub use kind::{Kind, Part, Shape, Stage};
pub(crate) use physics::Physics;
pub use physics::{Deflection, Law, Load, Offset, Parts, Site, State};
pub use presliding::Presliding;
pub(crate) use state::{CREEP_TIMES_S, unit_key};
pub use state::{
    Carries, Cutting, CuttingTorque, ForceLaw, MOST_CLAMPS, PartAt, PartYield, Situation, ToolFrame, UnitAt,
};
pub use survey::Survey;
pub use table::Number;

use deflex_lanes::Real;
use deflex_robot::{Axes, Joints};
use std::fmt::Debug;
use table::{ANY, FACTOR, NOT_NEGATIVE, checked, indexed, per_axis, per_direction, scalar, table_of};

/// The part of [`Effect`] that the registry ([`KINDS`]) implements for every effect.
///
/// # Examples
/// ```
/// use deflex_effects::{Listed, kind};
///
/// let backlash = kind("backlash").expect("a kind of effect");
/// let effect = (backlash.read)(backlash.forms[0].parse()?)?;
/// assert_eq!(effect.to_table()["kind"].as_str(), Some(effect.kind()));
/// # Ok::<(), toml::de::Error>(())
/// ```
pub trait Listed {
    /// The entry of the effect in the registry.
    fn entry(&self) -> &'static Kind;

    /// The `kind` of the effect in the cell file.
    fn kind(&self) -> &'static str {
        self.entry().name
    }

    /// The physics of the effect, as the solver of equilibria calls it.
    fn law(&self) -> Law<'_>;

    /// The `[[effect]]` table of the cell file, `kind` included.
    fn to_table(&self) -> toml::Table;

    /// A copy.
    fn clone_box(&self) -> Box<dyn Effect>;
}

/// One physical effect with its parameters.
///
/// All methods are pure: the same state gives the same answer, so that rows can be solved in any order.
///
/// # Examples
/// ```
/// use deflex_effects::{Effect, kind};
///
/// let backlash = kind("backlash").expect("a kind of effect");
/// let effect = (backlash.read)(backlash.forms[0].parse()?)?;
/// let values: Vec<f64> = effect.parameters().iter().map(|parameter| 1.1 * parameter.value).collect();
/// let wider: Box<dyn Effect> = effect.with_values(&values);
/// assert_eq!(wider.kind(), "backlash");
/// # Ok::<(), toml::de::Error>(())
/// ```
pub trait Effect: Listed + Debug + Send + Sync {
    /// Whether its offsets depend on the **commanded** motor angles. Then the command that reaches a wanted pose has to be found by
    /// iteration.
    fn follows_command(&self) -> bool {
        self.entry().follows_command
    }

    /// Whether it depends on the cutting forces at the targets before.
    fn follows_load(&self) -> bool {
        self.entry().follows_load
    }

    /// Angles over which the friction of the effect builds up after each joint has reversed. `None` if the effect does
    /// not depend on the direction of travel.
    fn presliding(&self) -> Option<Presliding> {
        None
    }

    /// The same effect with other presliding angles; an unchanged copy if it has none.
    fn with_presliding(&self, _presliding: Presliding) -> Box<dyn Effect> {
        self.clone_box()
    }

    /// Whether the weight of the tool or the payload acts on the arm by this effect.
    fn weighs_payload(&self) -> bool {
        self.entry().weighs_payload
    }

    /// What the cell must declare or the data must contain for the effect to act.
    fn needs(&self) -> &'static [Need] {
        self.entry().needs
    }

    /// The name of the mechanical unit whose error this is; `None` for effects of the arm, the tool or the part.
    fn unit(&self) -> Option<&str> {
        None
    }

    /// How many clamps (`[[part.clamp]]`) the cell must declare for it.
    fn clamps(&self) -> usize {
        0
    }

    /// The entry of `[controller] compensates` with which the controller corrects this effect itself; `None` if no entry does.
    fn covered_by(&self) -> Option<Covered> {
        self.entry().covered_by
    }

    /// Standard deviation of each joint's remaining error where the effect was not measured, rad; zero where it was.
    fn unseen(&self, motor_commanded: &Joints) -> Joints {
        let _ = motor_commanded;
        Joints::zeros()
    }

    /// Variance of the shift of the TCP that remains where the effect was not measured, m², all axes together.
    fn unseen_shift(&self, situation: &Situation<'_>, motor_commanded: &Joints) -> f64 {
        let _ = (situation, motor_commanded);
        0.0
    }

    /// The effect as the error curve of a single joint; `None` if it is anything else.
    fn joint_curve(&self) -> Option<JointCurve> {
        None
    }

    /// Every number that may be fitted, in a fixed order, with its place.
    #[doc(hidden)]
    fn numbers(&mut self) -> Vec<Number<'_>>;

    /// Every number that may be fitted, in a fixed order. Values are in the unit named, as in the cell file.
    fn parameters(&self) -> Vec<Parameter> {
        self.clone_box().numbers().into_iter().map(|number| number.parameter).collect()
    }

    /// The same effect with other numbers, in the order of [`Effect::parameters`].
    fn with_values(&self, values: &[f64]) -> Box<dyn Effect> {
        let mut other = self.clone_box();
        other.numbers().into_iter().zip(values).for_each(|(number, value)| *number.place = *value);
        other
    }

    /// How many numbers have an uncertainty in `[effect.uncertainty]` of the cell file: those of [`Effect::parameters`],
    /// unless the effect has numbers that are not fitted one by one.
    fn uncertain(&self) -> usize {
        self.parameters().len()
    }

    /// The same effect with its uncertain numbers changed, for a derivative: see [`Parameter::moved`].
    fn moved(&self, changes: &[f64]) -> Box<dyn Effect> {
        let parameters = self.parameters();
        let values: Vec<f64> = parameters.iter().zip(changes).map(|(own, change)| own.moved(*change)).collect();
        self.with_values(&values)
    }

    /// The same effect with other numbers that act nearly alike. A fit by small steps can be stuck at one of them.
    fn lookalikes(&self) -> Vec<Box<dyn Effect>> {
        Vec::new()
    }
}

/// One number of an effect.
///
/// # Examples
/// ```
/// use deflex_effects::kind;
///
/// let backlash = kind("backlash").expect("a kind of effect");
/// for parameter in (backlash.read)(backlash.forms[0].parse()?)?.parameters() {
///     println!("{} = {} {}", parameter.name, parameter.value, parameter.unit);
///     assert!(parameter.moved(1e-6) >= parameter.bounds.0);
/// }
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Parameter {
    /// Key in the cell file, with its index: `half_gap_rad[0]`.
    pub name: String,
    /// The axis or direction to which the number belongs.
    #[doc(hidden)]
    pub owner: ParameterOwner,
    /// Value, in `unit`.
    pub value: f64,
    /// Unit, as `docs/effects.md` writes it: `rad`, `mm/N`, `kg·m`, …
    pub unit: &'static str,
    /// Typical size on a real robot: standard deviation of the physical prior about `neutral`, in `unit`.
    pub typical: f64,
    /// The value at which the effect does nothing (0, or 1 for factors); also the mean of the prior. A number that gives a shape (a time
    /// constant, a width) does nothing at any value while the sizes of the effect are neutral.
    pub neutral: f64,
    /// Physical bounds, in `unit`: a half gap is not negative.
    pub bounds: (f64, f64),
}

impl Parameter {
    /// The value after a change, for a derivative by central differences. If the value cannot change to one of both
    /// sides, because it would leave its bounds, it changes twice as far to the other side, so that the difference of
    /// both is the same. It never leaves its bounds, where many laws have no meaning.
    #[must_use]
    pub fn moved(&self, change: f64) -> f64 {
        moved_within(self.value, change, self.bounds)
    }
}

/// [`Parameter::moved`] of a value with these bounds.
#[doc(hidden)]
pub fn moved_within(value: f64, change: f64, (low, high): (f64, f64)) -> f64 {
    let is_within = |changed: f64| (low..=high).contains(&changed);
    let factor = match (is_within(value + change), is_within(value - change)) {
        (true, false) => 2.0,
        (false, true) => 0.0,
        _ => 1.0,
    };
    (value + factor * change).clamp(low, high)
}

/// What a number of an effect belongs to. The index in the number's name counts from 0; this says what the index
/// counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[doc(hidden)]
pub enum ParameterOwner {
    /// The effect as a whole, or the term of it that the name says.
    Effect,
    /// An axis of the arm, from 1 to 6.
    Axis(usize),
    /// A direction, `x`, `y` or `z`, of the frame that `docs/effects.md` names.
    Direction(char),
}

/// What an effect needs in addition to the commanded pose.
///
/// # Examples
/// ```
/// use deflex_effects::{Need, kind};
///
/// let table = "half_gap_rad = [0.0, 0.0, 0.0, 0.0, 0.0, 1e-4]".parse().expect("a table");
/// let backlash = (kind("backlash").expect("an effect").read)(table).expect("a backlash");
/// assert!(!backlash.needs().iter().any(|need| matches!(need, Need::Force)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Need {
    /// `[robot.stiffness]`.
    Stiffness,
    /// An arm with a parallelogram, because the effect has this key.
    Parallelogram(&'static str),
    /// A cutting force that is not zero everywhere.
    Force,
    /// Time, measured or from path length over feed.
    Time,
    /// Measured temperature.
    Temperature,
    /// Programmed speed.
    Speed,
    /// Length cut so far.
    CutLength,
}

/// What a controller may correct by itself (`[controller] compensates`).
///
/// # Examples
/// ```
/// use deflex_effects::{Covered, kind};
///
/// // A controller that compensates gravity makes this effect unnecessary.
/// let gravity = kind("gravity").expect("a kind of effect");
/// assert_eq!((gravity.read)(gravity.forms[0].parse()?)?.covered_by(), Some(Covered::Gravity));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Covered {
    /// Weight of links, tool and payload.
    Gravity,
    /// Joint zeros, link lengths and twists.
    Geometry,
}

impl Covered {
    /// Both, with their words in the cell file.
    #[doc(hidden)]
    pub const WORDS: [(&'static str, Self); 2] = [("gravity", Self::Gravity), ("geometry", Self::Geometry)];
}

// This is the only list of effects. An effect consists of its file, its module above, and its line here.
physics::registry! {
    joint_stiffness: JointStiffness;
    stiffness_curve: StiffnessCurve;
    gravity: Gravity;
    backlash: Backlash;
    hysteresis: Hysteresis;
    creep: Creep;
    gear_harmonic: GearHarmonic;
    joint_error_curve: JointErrorCurve;
    zero_offset: ZeroOffset;
    link_geometry: LinkGeometry;
    tool_frame: ToolFrameError;
    work_object_frame: WorkObjectFrame;
    base_compliance: BaseCompliance;
    bearing_compliance: BearingCompliance;
    tool_compliance: ToolCompliance;
    workpiece_compliance: WorkpieceCompliance;
    part_stiffness: PartStiffness;
    clamp_compliance: ClampCompliance;
    thermal_growth: ThermalGrowth;
    force_scale: ForceScale;
    tool_wear: ToolWear;
    tracking_lag: TrackingLag;
    joint_coupling: JointCoupling;
    stiffness_temperature: StiffnessTemperature;
    unit_frame: UnitFrame;
    cable_pull: CablePull;
    empirical: Empirical, EmpiricalField, Discrepancy;
}

/// The declared springs of the joints: the effect that every cell with `[robot.stiffness]` has, also without an `[[effect]]` table.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let springs = deflex_effects::declared_springs(&robot.axes);
/// assert_eq!(springs.kind(), "joint_stiffness");
/// ```
#[must_use]
pub fn declared_springs(axes: &Axes) -> Box<dyn Effect> {
    Box::new(joint_stiffness::JointStiffness::declared(axes))
}

/// The declared stiffness of the part: the effect that every cell with `[part.material]` has, also without an `[[effect]]` table.
#[must_use]
pub(crate) fn declared_part() -> Box<dyn Effect> {
    Box::new(part_stiffness::PartStiffness::declared())
}

/// Appends the declared stiffness of the part to the effects of a cell file unless one of them stands for it. Returns whether it was appended.
///
/// # Examples
/// ```
/// let mut effects = Vec::new();
/// assert!(deflex_effects::add_implied_part(&mut effects));
/// assert!(!deflex_effects::add_implied_part(&mut effects));
/// ```
pub fn add_implied_part(effects: &mut Vec<Box<dyn Effect>>) -> bool {
    let missing = !effects.iter().any(|effect| effect.entry().implied_by_part);
    if missing {
        effects.push(declared_part());
    }
    missing
}

/// Puts [`declared_springs`] before the effects of a cell file unless one of them stands for it. Returns whether it was added.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let mut effects = Vec::new();
/// assert!(deflex_effects::add_implied(&mut effects, &robot.axes)); // the springs of the joints
/// assert!(!deflex_effects::add_implied(&mut effects, &robot.axes)); // they are there already
/// ```
pub fn add_implied(effects: &mut Vec<Box<dyn Effect>>, axes: &Axes) -> bool {
    let missing = !effects.iter().any(|effect| effect.entry().implied_by_stiffness);
    if missing {
        effects.insert(0, declared_springs(axes));
    }
    missing
}

/// The registry's entry of the effect with this `kind` in the cell file; `None` for any other name.
///
/// # Examples
/// ```
/// use deflex_effects::kind;
///
/// let backlash = kind("backlash").expect("an effect");
/// assert!(!backlash.bends_under_load);
/// assert!(kind("magic").is_none());
/// ```
#[must_use]
pub fn kind(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.name == name)
}

#[cfg(test)]
mod tests {
    use super::moved_within;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_value_at_its_bound_moves_twice_as_far_inwards() {
        let difference = |value: f64, bounds| moved_within(value, 0.5, bounds) - moved_within(value, -0.5, bounds);
        for (value, bounds) in [(3.0, (0.0, 9.0)), (0.0, (0.0, 9.0)), (9.0, (0.0, 9.0)), (0.2, (0.0, 9.0))] {
            assert_abs_diff_eq!(difference(value, bounds), 1.0);
        }
        // There is no room for a difference of 1.
        assert_abs_diff_eq!(difference(0.1, (0.0, 0.2)), 0.2);
    }
}
