//! What is known of one target before its equilibrium, and as whose circumstances the arm and its effects see it.

use super::laws::Law;
use crate::effects::{Cutting, Situation};
use crate::equilibrium::{Cut, Setting, Site};
use crate::robot::{Joints, Pose};
use nalgebra::{Rotation3, Unit, Vector3};

/// Everything known of one target before its equilibrium.
#[derive(Clone, Debug)]
pub struct Point {
    /// Index into the settings.
    pub(super) setting: u32,
    /// Where the program sends the TCP.
    pub wobj_from_tcp: Pose,
    /// Where errors are counted from, and what defines depth and force: the same, but for `--against`.
    pub reference: Pose,
    /// Nominal motor angles at `wobj_from_tcp`, rad.
    pub motor: Joints,
    /// Direction of travel into the target with the joints as programmed, −1, 0, 1.
    pub travel: Joints,
    /// Surface normal, out of the material, work object axes.
    pub normal: Vector3<f64>,
    /// Programmed velocity, m/s, work object axes.
    pub velocity: Vector3<f64>,
    /// Length cut up to here, m.
    pub cut_length: f64,
    /// Time since the start, s.
    pub time: f64,
    /// Temperature, °C.
    pub temperature: Option<f64>,
    /// Payload besides the tool, kg.
    pub payload: f64,
    /// The cut.
    pub(super) load: PointLoad,
}

/// The cut of a [`Point`], without borrowing.
#[derive(Clone, Copy, Debug)]
pub(super) enum PointLoad {
    Air,
    /// N, work object axes.
    Constant(Vector3<f64>),
    Law {
        /// Index into the laws.
        law: usize,
        /// The feed frame.
        wobj_from_feed: Rotation3<f64>,
        /// Whether that was found for this point's own tool axis, so that the tool leans against it as the law has it.
        leaned: bool,
    },
}

impl Point {
    fn cutting<'a>(&self, laws: &'a [Law]) -> Cutting<'a> {
        match self.load {
            PointLoad::Air => Cutting::Air,
            PointLoad::Constant(force) => Cutting::Constant(force),
            PointLoad::Law { law, wobj_from_feed, .. } => Cutting::Law { law: &laws[law], wobj_from_feed },
        }
    }

    /// Nominal motor angles and the direction of travel into them.
    pub(super) fn as_programmed(&self) -> (&Joints, &Joints) {
        (&self.motor, &self.travel)
    }

    pub(super) fn site<'a>(&'a self, setting: &'a Setting, laws: &'a [Law]) -> Site<'a> {
        let leaned = matches!(self.load, PointLoad::Law { leaned: true, .. });
        let cut = match &self.load {
            PointLoad::Air => Cut::Air,
            PointLoad::Constant(force) => Cut::Constant(force),
            PointLoad::Law { law, wobj_from_feed, .. } => Cut::Law { law: &laws[*law], wobj_from_feed },
        };
        let Self { reference: wobj_from_tcp, payload, cut_length, .. } = self;
        Site { setting, wobj_from_tcp, payload: *payload, cut_length: *cut_length, cut, leaned }
    }

    pub(super) fn situation<'a>(&self, setting: &Setting, laws: &'a [Law]) -> Situation<'a> {
        Situation {
            base_from_wobj: setting.base_from_wobj,
            wobj_from_tcp: self.reference,
            tool: setting.tool,
            cutting: self.cutting(laws),
            normal: self.normal,
            velocity: self.velocity,
            cut_length: self.cut_length,
            time: self.time,
            temperature: self.temperature,
            payload: self.payload,
        }
    }

    /// A point that was measured with its motor angles, without a program, in the base; see [`Prepared::of_points`].
    pub(crate) fn measured(base_from_tcp: Pose, motor: Joints, travel: Joints) -> Self {
        Self {
            setting: 0,
            wobj_from_tcp: base_from_tcp,
            reference: base_from_tcp,
            motor,
            travel,
            normal: tool_axis(&base_from_tcp),
            velocity: Vector3::zeros(),
            cut_length: 0.0,
            time: 0.0,
            temperature: None,
            payload: 0.0,
            load: PointLoad::Air,
        }
    }

    /// A measured force, base axes while the point is still placed there, N.
    pub(crate) fn set_force(&mut self, force: Vector3<f64>) {
        self.load = PointLoad::Constant(force);
    }

    /// Whether a cutting force acts.
    #[must_use]
    pub fn cuts(&self) -> bool {
        !matches!(self.load, PointLoad::Air)
    }

    /// Error at the contact point along the surface normal, m (Tang et al., Eq. 15), for the TCP's shift and the actual tool
    /// axis.
    pub(super) fn normal_error(&self, laws: &[Law], shift: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
        let mut error = shift.dot(&self.normal);
        if let PointLoad::Law { law, wobj_from_feed, leaned } = &self.load {
            let law = &laws[*law];
            let height = |axis: &Vector3<f64>| {
                let axis = wobj_from_feed.inverse_transform_vector(axis);
                law.milling.contact_height(&Unit::new_unchecked(axis))
            };
            let wanted = if *leaned { law.height } else { height(&tool_axis(&self.reference)) };
            if let (Some(now), Some(wanted)) = (height(axis), wanted) {
                error += now - wanted;
            }
        }
        error
    }
}

/// Tool axis, tip to spindle: −z of the TCP frame.
pub(super) fn tool_axis(pose: &Pose) -> Vector3<f64> {
    -pose.rotation.matrix().column(2)
}
