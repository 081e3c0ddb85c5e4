//! The properties of a kind of effect that hold whatever its numbers are. Other modules decide by these properties, never by the name
//! of a kind.

use super::{Covered, Effect, Need, Parts, Survey};

/// An entry of the registry.
///
/// `Kind::PLAIN` has the values of an ordinary kind: a physical law with few numbers that is independent of all other kinds. An entry
/// states its name, its reader and its candidates, and only those properties in which it differs.
///
/// # Examples
/// ```
/// use deflex_effects::kind;
///
/// let backlash = kind("backlash").expect("a kind of effect");
/// println!("{}: {}", backlash.name, backlash.summary);
/// ```
#[non_exhaustive]
pub struct Kind {
    /// Name in the cell file.
    pub name: &'static str,
    /// What happens physically, in one line for the user.
    pub summary: &'static str,
    /// An example of each form of its `[[effect]]` table, without `kind`. Tests read all of them, so every number must have an effect.
    pub forms: &'static [&'static str],
    /// The part of the arm that it describes. A set of effects has at most one law for each part.
    pub part: Part,
    /// What its numbers can describe: a law, waves, a curve or a map.
    pub shape: Shape,
    /// The fields of loads, offsets and deflections that it changes, except joint angles.
    #[doc(hidden)]
    pub parts: Parts,
    /// What the cell must declare or the data must contain for it to act: see [`Effect::needs`].
    pub needs: &'static [Need],
    /// The entry of `[controller] compensates` with which the controller corrects it by itself; `None` if no entry does.
    pub covered_by: Option<Covered>,
    /// Whether its offsets depend on the commanded motor angles: see [`Effect::follows_command`].
    pub follows_command: bool,
    /// Whether it depends on the cutting forces at the targets before.
    pub follows_load: bool,
    /// Whether the weight of the tool or the payload acts on the arm by it.
    pub weighs_payload: bool,
    /// Whether the effect turns loads into motion, so that it does nothing while no load acts on the arm.
    pub bends_under_load: bool,
    /// Whether its numbers multiply one another. Then derivatives at a fit do not predict the residual without the effect.
    pub multiplies: bool,
    /// Kinds that contain this one as a special case: no data can distinguish it from them while no other effect acts.
    pub nested_in: &'static [&'static str],
    /// Kinds that look like this one in data in which each joint turns over a small range only.
    pub locally_like: &'static [&'static str],
    /// Whether a wrong position of the measuring device looks the same.
    pub like_device_frame: bool,
    /// Whether it adds a constant to each joint's angle. In a linear model it then represents any error of a joint.
    pub is_joint_constant: bool,
    /// The stage at which it is searched for in data over the whole robot.
    #[doc(hidden)]
    pub stage: Stage,
    /// The name of its time constant, if it has one. A fit cannot find it from a neutral start, so the search tries shares of the run.
    pub time_constant: Option<&'static str>,
    /// Names of numbers that always have the same sign as one another: all links of an arm that warms up grow.
    pub one_sign: &'static [&'static str],
    /// Whether every cell with `[robot.stiffness]` has it, also without an `[[effect]]` table.
    pub implied_by_stiffness: bool,
    /// Whether every cell with `[part.material]` has it, also without an `[[effect]]` table.
    pub implied_by_part: bool,
    /// Reads the `[[effect]]` table, from which `kind` has been removed. Unknown keys and numbers out of bounds are errors.
    pub read: fn(toml::Table) -> Result<Box<dyn Effect>, toml::de::Error>,
    /// Variants with neutral numbers, from which a fit to such data starts. Empty if the data cannot show the effect, or if a search
    /// builds the variants ([`Shape::Periodic`]).
    pub candidates: fn(&Survey) -> Vec<Box<dyn Effect>>,
}

/// The part of the arm that an effect describes.
///
/// # Examples
/// ```
/// use deflex_effects::{Part, kind};
///
/// assert!(matches!(kind("joint_stiffness").expect("an effect").part, Part::JointSpring));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// A part that no other kind describes.
    Own,
    /// The springs of the joints: a wrong stiffness and a curved characteristic are two laws for the same spring.
    JointSpring,
    /// One joint. A set can have several effects of this kind, one for each joint.
    EachJoint,
}

/// What the numbers of an effect can describe.
///
/// # Examples
/// ```
/// use deflex_effects::{Shape, kind};
///
/// assert!(matches!(kind("gear_harmonic").expect("an effect").shape, Shape::Periodic));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Shape {
    /// A physical law of few numbers.
    Law,
    /// Waves over a joint's angle. A search finds their orders in the residuals of the other effects.
    Periodic,
    /// A smooth curve over a joint's angle. It can imitate any smooth error of the joint, and is valid only where it was measured.
    Curve,
    /// A smooth map over places. It names no cause, and is valid only where it was measured.
    Map,
}

/// The order in which data over the whole robot are explained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[doc(hidden)]
pub enum Stage {
    /// The frame of the tool.
    ToolFrame,
    /// The zeros of the joints.
    JointZeros,
    /// The lengths, offsets and twists of the links.
    Links,
    /// All other effects except error curves of joints.
    Remainder,
    /// Error curves of joints: last, because they can imitate any smooth error.
    Curves,
}

impl Kind {
    /// An ordinary kind: a physical law with few numbers, independent of all other kinds. An entry replaces what differs.
    pub(super) const PLAIN: Self = Self {
        name: "",
        summary: "",
        forms: &[],
        part: Part::Own,
        shape: Shape::Law,
        parts: Parts::NONE,
        needs: &[],
        covered_by: None,
        follows_command: false,
        follows_load: false,
        weighs_payload: false,
        bends_under_load: false,
        multiplies: false,
        nested_in: &[],
        locally_like: &[],
        like_device_frame: false,
        is_joint_constant: false,
        stage: Stage::Remainder,
        time_constant: None,
        one_sign: &[],
        implied_by_stiffness: false,
        implied_by_part: false,
        read: |_| Err(serde::de::Error::custom("a kind without a reader")),
        candidates: |_| Vec::new(),
    };
}
