//! What makes the real arm differ from the one that the controller believes in.
//!
//! One file is one physical effect. An effect adds **loads** (to the cutting force or as weights), or
//! turns loads into motion (**yields**), or moves the geometry whatever the load (**offsets**): the last two
//! through one [`Distortion`]. Nothing outside this folder knows an effect by name; [`KINDS`] is the only list.

mod backlash;
mod base_compliance;
mod bearing_compliance;
#[cfg(test)]
mod bench;
mod distortion;
mod empirical;
mod empirical_field;
mod force_scale;
mod gear_harmonic;
mod gravity;
mod hysteresis;
mod joint_error_curve;
mod joint_stiffness;
mod link_geometry;
mod simple;
mod spline;
mod state;
mod stiffness_curve;
mod survey;
mod table;
mod thermal_growth;
mod tool_compliance;
mod tool_frame;
mod tool_wear;
mod tracking_lag;
mod work_object_frame;
mod workpiece_compliance;
mod zero_offset;

pub(crate) use distortion::Parts;
pub use distortion::{Distortion, Twist};
pub use empirical_field::empirical_field;
pub(crate) use empirical_field::fade;
pub use gear_harmonic::gear_harmonic;
pub use joint_error_curve::{JointCurve, joint_error_curve};
pub use simple::{Simple, Weights};
pub use state::{Cutting, ForceLaw, Load, Situation, State, ToolFrame, Wrench};
pub use survey::Survey;

use crate::robot::Joints;
use std::fmt::Debug;
use table::{ANY, FACTOR, NOT_NEGATIVE, checked, indexed, scalar, table_of, take};

/// One physical effect with its parameters.
///
/// All methods are pure: the same state gives the same answer, so that rows can be solved in any order.
pub trait Effect: Debug + Send + Sync {
    /// Name in the cell file, one of [`KINDS`].
    fn kind(&self) -> &'static str;

    /// Adds to the loads. Called before [`Effect::distort`] of any effect, in the order of the cell file.
    fn load(&self, state: &State, load: &mut Load) {
        let _ = (state, load);
    }

    /// Adds what yields to `load` (all loads known, motor torques filled in) and what is off whatever the load.
    fn distort(&self, state: &State, load: &Load, out: &mut Distortion) {
        let _ = (state, load, out);
    }

    /// Whether [`Effect::distort`] depends on the **commanded** motor angles: the inverse then iterates.
    fn follows_command(&self) -> bool {
        false
    }

    /// What must be declared or measured for the effect to act.
    fn needs(&self) -> &'static [Need] {
        &[]
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

    /// The curve of one joint's angle that the effect is, where it is nothing else.
    fn joint_curve(&self) -> Option<JointCurve> {
        None
    }

    /// What the effect comes to where it is one of the simplest (declared stiffness at the motors, N·m/rad, given).
    fn simple(&self, stiffness: Option<&Joints>) -> Option<Simple> {
        let _ = stiffness;
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
    /// Unit, as INTERFACE writes it: `rad`, `mm/N`, `kg·m`, …
    pub unit: &'static str,
    /// Typical size on a real robot: standard deviation of the physical prior about `neutral`, in `unit`.
    pub typical: f64,
    /// The value at which the effect does nothing (0, or 1 for factors), and the prior's mean. A shape (a time constant,
    /// a width) does nothing whatever its value while the sizes beside it are neutral.
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

/// An entry of the registry.
#[non_exhaustive]
pub struct Kind {
    /// Name in the cell file.
    pub name: &'static str,
    /// One line for people: what happens physically.
    pub summary: &'static str,
    /// Reads the `[[effect]]` table, `kind` removed; unknown keys are errors.
    pub read: fn(toml::Table) -> Result<Box<dyn Effect>, toml::de::Error>,
    /// Variants that do nothing yet, to be fitted to data of this kind; empty where the data cannot show the effect, or
    /// where a search builds them (`gear_harmonic`).
    pub candidates: fn(&Survey) -> Vec<Box<dyn Effect>>,
}

/// Every effect that deflex knows, in the order of INTERFACE.md. Adding an effect is adding a file and a line.
pub static KINDS: &[Kind] = &[
    joint_stiffness::KIND,
    stiffness_curve::KIND,
    gravity::KIND,
    backlash::KIND,
    hysteresis::KIND,
    gear_harmonic::KIND,
    joint_error_curve::KIND,
    zero_offset::KIND,
    link_geometry::KIND,
    tool_frame::KIND,
    work_object_frame::KIND,
    base_compliance::KIND,
    bearing_compliance::KIND,
    tool_compliance::KIND,
    workpiece_compliance::KIND,
    thermal_growth::KIND,
    force_scale::KIND,
    tool_wear::KIND,
    tracking_lag::KIND,
    empirical::KIND,
];

/// Springs as declared: what a cell with `[robot.stiffness]` has without saying so.
#[must_use]
pub fn declared_springs() -> Box<dyn Effect> {
    Box::new(joint_stiffness::JointStiffness::declared())
}

/// The registry's entry of a name.
#[must_use]
pub fn kind(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.name == name)
}
