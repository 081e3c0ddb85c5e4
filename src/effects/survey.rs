use crate::robot::{Joints, Robot};

/// What measured data offer: which effects they can show at all, and over which range.
#[derive(Clone, Debug)]
pub struct Survey<'a> {
    /// The nominal robot.
    pub robot: &'a Robot,
    /// Whether the cell declares a joint stiffness.
    pub stiffness_declared: bool,
    /// Whether the cell declares what a part that rows cut is made of, and how it is held.
    pub part_declared: bool,
    /// How many clamps that part has, where it is known how it yields with them.
    pub clamps: usize,
    /// Whether any row cuts.
    pub has_force: bool,
    /// Lowest and highest x, then y, of the places that rows cut at, mm in their work object.
    pub cut_mm: Option<[[f64; 2]; 2]>,
    /// Whether any row carries a payload besides its tool.
    pub has_payload: bool,
    /// Whether programmed speeds are known.
    pub has_speed: bool,
    /// First and last time, s, where rows have one.
    pub time: Option<(f64, f64)>,
    /// Lowest and highest temperature, °C, where measured.
    pub temperature: Option<(f64, f64)>,
    /// Names of mechanical units that move.
    pub moving_units: Vec<String>,
    /// Least commanded motor angles, rad.
    pub motor_min: Joints,
    /// Largest commanded motor angles, rad.
    pub motor_max: Joints,
}

impl Survey<'_> {
    /// Whether loads that change are known: what yields to loads only cannot be seen by the arm's own weight alone,
    /// which is to be found too.
    #[must_use]
    pub fn is_loaded(&self) -> bool {
        self.has_force || self.has_payload
    }
}
