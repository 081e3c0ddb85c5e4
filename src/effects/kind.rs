//! What is known of an effect before it has numbers: all that the rest of the tool may ask about a kind.

use super::{Effect, Survey};

/// An entry of the registry.
///
/// A kind that says nothing about itself beyond its name, its reader and its candidates is `Kind::PLAIN`: a physical law of
/// its own, not nested in another, of few numbers.
#[non_exhaustive]
pub struct Kind {
    /// Name in the cell file.
    pub name: &'static str,
    /// One line for people: what happens physically.
    pub summary: &'static str,
    /// A `[[effect]]` table of each form that it has, `kind` left out, in which every number acts: tests run over them.
    pub forms: &'static [&'static str],
    /// What it is a law of: a set of effects has one of each part.
    pub part: Part,
    /// What its numbers can follow.
    pub shape: Shape,
    /// Whether it turns loads into motion: it does nothing where nothing acts on the arm.
    pub bends_under_load: bool,
    /// Whether its numbers multiply one another: its slopes about a fit do not tell what there would be without it.
    pub multiplies: bool,
    /// Kinds that have every effect of this kind among them, whatever the data, where nothing else acts.
    pub nested_in: &'static [&'static str],
    /// Kinds that pass for this one where each joint was seen over a little of a turn only.
    pub locally_like: &'static [&'static str],
    /// Whether a measuring device that stands elsewhere than thought looks the same.
    pub like_device_frame: bool,
    /// Whether it adds one number to each joint's angle, so that it stands for any error of a joint in a linear model.
    pub is_joint_constant: bool,
    /// The stage at which data over the whole robot are searched for it.
    pub stage: Stage,
    /// The time constant among its numbers, which is searched over shares of the run and not fitted from nothing.
    pub time_constant: Option<&'static str>,
    /// Numbers that have one sign at a time: of an arm that warms all links grow, of one that cools all shrink.
    pub one_sign: &'static [&'static str],
    /// Whether a cell with `[robot.stiffness]` has it without saying so.
    pub implied_by_stiffness: bool,
    /// Whether a cell with `[part.material]` has it without saying so.
    pub implied_by_part: bool,
    /// Reads the `[[effect]]` table, `kind` removed; unknown keys are errors.
    pub read: fn(toml::Table) -> Result<Box<dyn Effect>, toml::de::Error>,
    /// Variants that do nothing yet, to be fitted to data of this kind; empty where the data cannot show the effect, or
    /// where a search builds them ([`Shape::Periodic`]).
    pub candidates: fn(&Survey) -> Vec<Box<dyn Effect>>,
}

/// What an effect is a law of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// Of something that no other kind is a law of.
    Own,
    /// The springs of the joints: one that is off and one that is bent are two laws of one spring.
    JointSpring,
    /// One joint each: several of a kind stand side by side, one a joint.
    EachJoint,
}

/// What the numbers of an effect can follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Shape {
    /// A physical law of few numbers.
    Law,
    /// Waves of a joint's angle: their orders are searched in what others leave.
    Periodic,
    /// A smooth curve of a joint's angle: passes for anything smooth, and holds only where it was seen.
    Curve,
    /// A smooth map over the place: names no effect, and holds only where it was seen.
    Map,
}

/// The order in which data over the whole robot are explained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Where the tool is.
    ToolFrame,
    /// Where the joints are zero.
    JointZeros,
    /// How long the links are, and how they stand to one another.
    Links,
    /// What is left of that, but for the joints' own curves.
    Remainder,
    /// Curves of the joints, which pass for anything smooth.
    Curves,
}

impl Kind {
    /// A physical law of its own, with no name yet.
    pub(super) const PLAIN: Self = Self {
        name: "",
        summary: "",
        forms: &[],
        part: Part::Own,
        shape: Shape::Law,
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

    /// Whether it passes for anything smooth or periodic in a joint's angle.
    #[must_use]
    pub fn follows_angle(&self) -> bool {
        matches!(self.shape, Shape::Periodic | Shape::Curve)
    }
}
