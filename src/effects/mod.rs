//! What makes the real arm differ from the one that the controller believes in.
//!
//! One file is one physical effect. An effect adds **loads** (to the cutting force or as weights), moves the geometry whatever
//! the load (**offsets**), or turns loads into motion (**deflections**): see `Physics`, written once over any number of targets.
//! What the rest of the tool asks about it stands in its [`Kind`]: nothing outside this folder knows an effect by name.

mod backlash;
mod base_compliance;
mod bearing_compliance;
#[cfg(test)]
mod bench;
mod cable_pull;
mod clamp_compliance;
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

pub use discrepancy::{Bell, discrepancy};
pub(crate) use empirical_field::fade;
pub use gear_harmonic::gear_harmonic;
pub use joint_error_curve::{JointCurve, joint_error_curve};
pub use kind::{Kind, Part, Shape, Stage};
pub use physics::Law;
pub(crate) use physics::{Deflection, Load, Offset, Parts, Physics, Site, State};
pub(crate) use state::unit_key;
pub use state::{Cutting, ForceLaw, MOST_CLAMPS, PartAt, PartYield, Situation, ToolFrame, UnitAt};
pub use survey::Survey;

use crate::lanes::Real;
use crate::robot::Joints;
use std::fmt::Debug;
use table::{ANY, FACTOR, NOT_NEGATIVE, checked, indexed, is_sharp, scalar, table_of, take};

/// What the list of effects says of each ([`KINDS`]).
pub trait Listed {
    /// Name in the cell file.
    fn kind(&self) -> &'static str;

    /// What it does.
    fn law(&self) -> Law<'_>;
}

/// One physical effect with its parameters.
///
/// All methods are pure: the same state gives the same answer, so that rows can be solved in any order.
pub trait Effect: Listed + Debug + Send + Sync {
    /// Whether what is off depends on the **commanded** motor angles: the inverse then iterates.
    fn follows_command(&self) -> bool {
        false
    }

    /// Angle over which the friction that the effect acts by builds up after a joint turns back, rad: 0 if at once; `None` where
    /// what is off does not depend on the direction in which the joints came.
    fn presliding_rad(&self) -> Option<f64> {
        None
    }

    /// The same effect with another presliding angle, rad, where it has one.
    fn with_presliding(&self, _presliding_rad: f64) -> Box<dyn Effect> {
        self.clone_box()
    }

    /// Whether what the arm carries weighs.
    fn weighs_payload(&self) -> bool {
        false
    }

    /// What must be declared or measured for the effect to act.
    fn needs(&self) -> &'static [Need] {
        &[]
    }

    /// The mechanical unit that it is of, by its name.
    fn unit(&self) -> Option<&str> {
        None
    }

    /// How many of the part's clamps (`[[part.clamp]]`) there must be for it.
    fn clamps(&self) -> usize {
        0
    }

    /// Which of `[controller] compensates` covers it, if any.
    fn covered_by(&self) -> Option<Covered> {
        None
    }

    /// Whether the effect was seen in these circumstances (commanded motor angles, rad): a fitted curve or map holds
    /// only where its data were. Outside it acts as its own file says, and the caller says so.
    fn covers(&self, motor_commanded: &Joints, situation: &Situation) -> bool {
        let _ = (motor_commanded, situation);
        true
    }

    /// Standard deviation, rad, of what each joint may be off beyond what the effect says where it was not seen.
    fn unseen(&self, motor_commanded: &Joints) -> Joints {
        let _ = motor_commanded;
        Joints::zeros()
    }

    /// The curve of one joint's angle that the effect is, where it is nothing else.
    fn joint_curve(&self) -> Option<JointCurve> {
        None
    }

    /// Every number that may be fitted, in a fixed order. Values are in the unit named, as in the cell file.
    fn parameters(&self) -> Vec<Parameter>;

    /// The same effect with other numbers, in the order of [`Effect::parameters`].
    fn with_values(&self, values: &[f64]) -> Box<dyn Effect>;

    /// Other numbers that act much like these: where a fit by small steps may be stuck.
    fn lookalikes(&self) -> Vec<Box<dyn Effect>> {
        Vec::new()
    }

    /// A copy.
    fn clone_box(&self) -> Box<dyn Effect> {
        let values: Vec<f64> = self.parameters().iter().map(|parameter| parameter.value).collect();
        self.with_values(&values)
    }

    /// The `[[effect]]` table of the cell file, `kind` included.
    fn to_table(&self) -> toml::Table;
}

/// One number of an effect.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Parameter {
    /// As in the cell file, with its index: `half_gap_rad[0]`.
    pub name: String,
    /// Value, in `unit`.
    pub value: f64,
    /// Unit, as `docs/effects.md` writes it: `rad`, `mm/N`, `kg·m`, …
    pub unit: &'static str,
    /// Typical size on a real robot: standard deviation of the physical prior about `neutral`, in `unit`.
    pub typical: f64,
    /// The value at which the effect does nothing (0, or 1 for factors), and the prior's mean. A shape (a time constant,
    /// a width) does nothing whatever its value while its sizes are neutral.
    pub neutral: f64,
    /// Physical bounds, in `unit`: a half gap is not negative.
    pub bounds: (f64, f64),
}

/// What an effect needs beyond the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Need {
    /// `[robot.stiffness]`.
    Stiffness,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Covered {
    /// Weight of links, tool and payload.
    Gravity,
    /// Joint zeros, link lengths and twists.
    Geometry,
}

impl Covered {
    /// Both, with their words in the cell file.
    pub const WORDS: [(&'static str, Self); 2] = [("gravity", Self::Gravity), ("geometry", Self::Geometry)];

    /// The word in the cell file.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Gravity => "gravity",
            Self::Geometry => "geometry",
        }
    }
}

// The only list of effects: an effect is its file, its module above and its line here.
physics::registry! {
    joint_stiffness: JointStiffness;
    stiffness_curve: StiffnessCurve;
    gravity: Gravity;
    backlash: Backlash;
    hysteresis: Hysteresis;
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

/// Springs as declared: what a cell with `[robot.stiffness]` has without saying so.
#[must_use]
pub fn declared_springs() -> Box<dyn Effect> {
    Box::new(joint_stiffness::JointStiffness::declared())
}

/// The part as declared: what a cell with `[part.material]` has without saying so.
#[must_use]
pub fn declared_part() -> Box<dyn Effect> {
    Box::new(part_stiffness::PartStiffness::declared())
}

/// Effects of a cell file, with the declared part after them where they do not say it; whether it was added.
pub fn add_implied_part(effects: &mut Vec<Box<dyn Effect>>) -> bool {
    let missing = !effects.iter().any(|effect| kind(effect.kind()).is_some_and(|kind| kind.implied_by_part));
    if missing {
        effects.push(declared_part());
    }
    missing
}

/// Effects of a cell file, with what its `[robot.stiffness]` implies in front where they do not say it; whether it was added.
pub fn add_implied(effects: &mut Vec<Box<dyn Effect>>) -> bool {
    let implied = |name| kind(name).is_some_and(|kind| kind.implied_by_stiffness);
    let missing = !effects.iter().any(|effect| implied(effect.kind()));
    if missing {
        effects.insert(0, declared_springs());
    }
    missing
}

/// The registry's entry of a name.
#[must_use]
pub fn kind(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.name == name)
}
