use deflex_robot::{Axes, Joints};

/// What a set of measured data contains: it decides which effects the data can show, and over which range.
///
/// # Examples
/// ```
/// use deflex_effects::Survey;
///
/// /// Whether the rows show how temperature acts.
/// fn shows_temperature(survey: &Survey) -> bool {
///     survey.temperature.is_some_and(|(low, high)| high - low > 2.0) // °C
/// }
/// ```
#[derive(Clone, Debug)]
pub struct Survey {
    /// How the motors of the robot drive its joints.
    pub axes: Axes,
    /// Whether the cell declares a joint stiffness.
    pub stiffness_declared: bool,
    /// Whether the cell declares the material and the clamps of a part that the rows cut.
    pub part_declared: bool,
    /// How many clamps that part has; 0 if the compliance with moving clamps is not known.
    pub clamps: usize,
    /// Whether any row has a cutting force.
    pub has_force: bool,
    /// Whether the length that was cut before each row is known. It is not if only some of the cuts of a program have rows.
    pub has_cut_length: bool,
    /// Lowest and highest x, then y, of the places where rows cut, mm, work object axes; `None` if no row cuts.
    pub cut_mm: Option<[[f64; 2]; 2]>,
    /// Whether the arm carries a payload in addition to the tool in any row.
    pub has_payload: bool,
    /// Whether programmed speeds are known.
    pub has_speed: bool,
    /// First and last time, s; `None` if no row has a time.
    pub time: Option<(f64, f64)>,
    /// Lowest and highest temperature, °C; `None` if none was measured.
    pub temperature: Option<(f64, f64)>,
    /// Names of the mechanical units that move during the run.
    pub moving_units: Vec<String>,
    /// Smallest commanded motor angle of each joint, rad.
    pub motor_min: Joints,
    /// Largest commanded motor angle of each joint, rad.
    pub motor_max: Joints,
}

impl Survey {
    /// Whether the data have a load that changes and is known. Without one, a compliance cannot be found: the arm's own weight, the
    /// only load, is unknown itself.
    #[must_use]
    pub(crate) fn is_loaded(&self) -> bool {
        self.has_force || self.has_payload
    }
}
