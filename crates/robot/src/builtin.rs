use super::{Axes, DhRow, Limits, Robot};
use deflex_program::Language;
use serde::Deserialize;
use std::sync::LazyLock;

/// A built-in robot, for which a cell needs no `[robot.kinematics]`.
///
/// # Examples
/// ```
/// use deflex_program::Language;
/// use deflex_robot::{BUILTIN, Builtin};
///
/// assert!(BUILTIN.iter().any(|robot| robot.model == "irb6660-205-1.9"));
/// let builtin = Builtin::named("irb6660-205-1.9").expect("a built-in robot");
/// assert_eq!(builtin.language(), Some(Language::Rapid));
/// let robot = builtin.robot();
/// let tcp = robot.forward(&robot.motor_from_axes_deg(&robot.home_deg()));
/// println!("{:.1} mm above the floor", 1e3 * tcp.translation.z);
/// assert!(Builtin::named("irb6660-205").is_err_and(|similar| !similar.is_empty()));
/// ```
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Builtin {
    /// Name in the cell file.
    pub model: String,
    /// The maker.
    pub maker: String,
    /// Data sheet or publication of the figures.
    pub source: String,
    /// Modified Denavit-Hartenberg rows (alpha °, a mm, d mm, theta °) from the base to the flange frame of the maker.
    #[serde(rename = "links")]
    pub rows: [[f64; 4]; 6],
    /// +1, or −1 for an axis that the maker counts in the opposite direction.
    #[serde(default = "forward")]
    pub axis_sign: [f64; 6],
    /// Whether motor 3 drives a parallelogram.
    #[serde(default)]
    pub parallelogram: bool,
    /// Whether axis 3 is counted against the ground.
    #[serde(default)]
    pub coupled_23: bool,
    /// Smallest axis angles, degrees.
    #[serde(rename = "axis_min_deg")]
    pub min_deg: [f64; 6],
    /// Largest axis angles, degrees.
    #[serde(rename = "axis_max_deg")]
    pub max_deg: [f64; 6],
    /// Smallest and largest angle between forearm and upper arm, degrees: motor 3 − motor 2 for a parallelogram, axis 3
    /// + axis 2 if axis 3 is counted against the ground.
    pub elbow_deg: Option<[f64; 2]>,
    /// Largest axis speeds, degrees per second, if a source states them.
    pub axis_speed_deg_s: Option<[f64; 6]>,
    /// Published joint stiffness at the motors, N·m/rad, if a source states it.
    pub stiffness_nm_per_rad: Option<[f64; 6]>,
    /// Published payload, kg.
    pub payload_kg: f64,
    /// Published reach, mm.
    pub reach_mm: f64,
    /// The point of the arm to which the published reach is counted.
    #[serde(default)]
    pub reach_to: Reach,
}

/// The point of the arm to which a published reach is counted.
///
/// # Examples
/// ```
/// use deflex_robot::{Builtin, Reach};
///
/// let ur10 = Builtin::named("ur10e").expect("a built-in robot");
/// assert_eq!(ur10.reach_to, Reach::WorkingRadius);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Reach {
    /// The wrist centre, from axis 1.
    #[default]
    Wrist,
    /// The flange, from axis 1.
    Flange,
    /// The working radius of Universal Robots: the lengths of both arms and the offset to axis 6, rounded down for the
    /// smaller types.
    WorkingRadius,
}

fn forward() -> [f64; 6] {
    Axes::SERIAL.sign
}

impl Builtin {
    /// The language of its maker's controllers; `None` if deflex does not read it.
    #[must_use]
    pub fn language(&self) -> Option<Language> {
        Language::ALL.into_iter().find(|language| language.about().maker == self.maker)
    }

    /// The robot of these figures.
    #[must_use]
    pub fn robot(&self) -> Robot {
        let rows = self.rows.map(|[alpha, a, d, theta]| DhRow {
            alpha: alpha.to_radians(),
            a: 1e-3 * a,
            d: 1e-3 * d,
            theta: theta.to_radians(),
        });
        let limits = Limits {
            min: self.min_deg.map(f64::to_radians).into(),
            max: self.max_deg.map(f64::to_radians).into(),
            elbow: self.elbow_deg.map(|[min, max]| (min.to_radians(), max.to_radians())),
        };
        let axes = Axes { sign: self.axis_sign, parallelogram: self.parallelogram, coupled_23: self.coupled_23 };
        let axis_speed = self.axis_speed_deg_s.map(|speed| speed.map(f64::to_radians).into());
        Robot::new(&self.model, rows, axes, limits).with_axis_speed(axis_speed)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Library {
    robot: Vec<Builtin>,
}

/// The text of the library.
const LIBRARY: &str = include_str!("library.toml");

impl Builtin {
    /// Whether the library has a robot of exactly this name. It searches the text of the library without parsing it.
    #[doc(hidden)]
    pub fn is_listed(model: &str) -> bool {
        LIBRARY.contains(&format!("model = \"{model}\"\n"))
    }
}

/// Every built-in robot, in the order of `library.toml`. Axis limits are those of the standard version; options of a
/// robot may differ.
#[allow(clippy::expect_used)] // the file is part of the program, and a test reads it
pub static BUILTIN: LazyLock<Vec<Builtin>> = LazyLock::new(|| {
    let library: Library = toml::from_str(LIBRARY).expect("the robot library is read by a test");
    library.robot
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Joints;

    #[test]
    fn each_name_is_listed_and_no_other() {
        assert!(BUILTIN.iter().all(|robot| Builtin::is_listed(&robot.model)));
        assert!(!Builtin::is_listed("irb") && !Builtin::is_listed("my arm"));
    }

    /// Published reaches are rounded to 10 mm.
    const REACH_MM: f64 = 10.0;
    /// Models whose published reach exceeds what their links and axis 2 allow, and by how much at most, mm. ABB counts
    /// some reaches to the end position of a parallelogram or of axis 3, and rounds others to 50 mm.
    const REACH_DIFFERS: [(&str, f64); 8] = [
        ("irb1600-", 26.0),
        ("irb1660id-", 14.0),
        ("irb2400-", 23.0),
        ("irb4400-", 23.0),
        ("irb4400l-", 49.0),
        ("irb6600-", 16.0),
        ("irb6650s-200-", 40.0),
        ("irb6700-", 34.0),
    ];
    /// Number of robots for which no source states axis speeds. Their speeds are not checked.
    const WITHOUT_SPEEDS: usize = 134;
    /// Largest relative difference of a working radius from the sum of the links: the maker rounds it down for smaller
    /// arms.
    const WORKING_RADIUS: f64 = 0.09;

    #[test]
    fn links_add_up_to_the_published_reach() {
        for robot in BUILTIN.iter() {
            let [_, [_, a1, ..], [_, a2, ..], [_, a3, d4, _], [_, _, d5, _], [_, a5, d6, _]] = robot.rows;
            // The upper arm leans forward as far as axis 2 allows, and the forearm points forward.
            let lean = |axis_deg: f64| robot.axis_sign[1] * axis_deg + robot.rows[1][3] + 90.0;
            let (one, other) = (lean(robot.min_deg[1]), lean(robot.max_deg[1]));
            let wrist = a1 + a2 * 90_f64.clamp(one.min(other), one.max(other)).to_radians().sin() + (a3 + a5).hypot(d4);
            let differs = REACH_DIFFERS.iter().find(|(models, _)| robot.model.starts_with(models));
            let within = differs.map_or(REACH_MM, |&(_, by)| by);
            let (reach, within) = match robot.reach_to {
                Reach::Wrist => (wrist, within),
                Reach::Flange => ((wrist + d6).hypot(d5), within),
                Reach::WorkingRadius => (a2 + a3 + d5, WORKING_RADIUS * robot.reach_mm),
            };
            assert!((reach - robot.reach_mm).abs() < within, "{}: {reach}", robot.model);
        }
    }

    #[test]
    fn each_robot_stands_once_with_limits_that_leave_room() {
        let mut models: Vec<&str> = BUILTIN.iter().map(|robot| &robot.model[..]).collect();
        models.sort_unstable();
        assert!(models.windows(2).all(|pair| pair[0] != pair[1]), "{models:?}");
        for robot in BUILTIN.iter() {
            assert!((0..6).all(|i| robot.min_deg[i] < robot.max_deg[i]), "{}", robot.model);
            assert!(robot.axis_sign.iter().all(|sign| [1.0, -1.0].contains(sign)), "{}", robot.model);
            assert!(robot.payload_kg > 0.0 && !robot.source.is_empty(), "{}", robot.model);
            // The range from heavy palletizers to small arms.
            if let Some(speed) = robot.axis_speed_deg_s {
                assert!(speed.iter().all(|speed| (20.0..=1600.0).contains(speed)), "{}: {speed:?}", robot.model);
            }
        }
        // No source was found for these. Lower the number when one is found.
        let unknown = BUILTIN.iter().filter(|robot| robot.axis_speed_deg_s.is_none()).count();
        assert_eq!(unknown, WITHOUT_SPEEDS);
    }

    #[test]
    fn tool0_of_abb_arms_at_home_is_as_on_the_controller() {
        for builtin in BUILTIN.iter().filter(|builtin| builtin.maker == "ABB") {
            let pose = builtin.robot().forward(&Joints::zeros());
            let quat = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.rotation);
            let half = std::f64::consts::FRAC_1_SQRT_2;
            let expected = nalgebra::Quaternion::new(half, 0.0, half, 0.0);
            assert!(quat.into_inner().dot(&expected).abs() > 1.0 - 1e-12, "{}: {quat}", builtin.model);
        }
    }
}
