use super::{DhRow, Limits, Robot};

/// A robot that needs no `[robot.kinematics]`.
#[derive(Clone, Copy, Debug)]
pub struct Builtin {
    /// Name in the cell file.
    pub model: &'static str,
    /// Where the figures come from.
    pub source: &'static str,
    /// Rows as (alpha °, a mm, d mm, theta °).
    pub rows: [[f64; 4]; 6],
    /// Parallelogram arm.
    pub parallelogram: bool,
    /// Least motor angles, degrees.
    pub min_deg: [f64; 6],
    /// Largest motor angles, degrees.
    pub max_deg: [f64; 6],
    /// Parallelogram: least and largest motor 3 − motor 2, degrees.
    pub elbow_deg: Option<[f64; 2]>,
    /// Published reach at the wrist centre, mm.
    pub reach_mm: f64,
}

impl Builtin {
    /// The robot.
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
        Robot::new(self.model, rows, self.parallelogram, limits)
    }
}

/// Rows of an arm with parallel axes 2 and 3 and a spherical wrist, lengths in mm: base to axis 2 (up, forward),
/// lower arm, elbow offset, forearm, wrist to flange. Row 6 turns by 180°, so that tool0 is as on the controller.
const fn spherical(d1: f64, a1: f64, a2: f64, a3: f64, d4: f64, d6: f64) -> [[f64; 4]; 6] {
    [
        [0.0, 0.0, d1, 0.0],
        [-90.0, a1, 0.0, -90.0],
        [0.0, a2, 0.0, 0.0],
        [-90.0, a3, d4, 0.0],
        [90.0, 0.0, 0.0, 0.0],
        [-90.0, 0.0, d6, 180.0],
    ]
}

/// Every built-in robot. Axis limits are the standard ones at the motors; options of a robot may differ.
pub const BUILTIN: &[Builtin] = &[
    Builtin {
        model: "irb6660-205-1.9",
        source: "Tang et al., Table 1; ABB 3HAC030822; elbow limits as the ROS-Industrial model has them",
        rows: spherical(814.5, 300.0, 700.0, 280.0, 893.0, 200.0),
        parallelogram: true,
        min_deg: [-180.0, -42.0, -20.0, -300.0, -120.0, -360.0],
        max_deg: [180.0, 85.0, 120.0, 300.0, 120.0, 360.0],
        elbow_deg: Some([-70.0, 70.0]),
        reach_mm: 1930.0,
    },
    Builtin {
        model: "irb6700-150-3.20",
        source: "ABB product specification IRB 6700; RobotComponents preset",
        rows: spherical(780.0, 320.0, 1280.0, 200.0, 1592.5, 200.0),
        parallelogram: false,
        min_deg: [-170.0, -65.0, -180.0, -300.0, -130.0, -360.0],
        max_deg: [170.0, 85.0, 70.0, 300.0, 130.0, 360.0],
        elbow_deg: None,
        reach_mm: 3200.0,
    },
    Builtin {
        model: "irb2400-16-1.55",
        source: "ABB product specification IRB 2400; ROS-Industrial abb_irb2400_support",
        rows: spherical(615.0, 100.0, 705.0, 135.0, 755.0, 85.0),
        parallelogram: true,
        min_deg: [-180.0, -100.0, -60.0, -200.0, -120.0, -400.0],
        max_deg: [180.0, 110.0, 65.0, 200.0, 120.0, 400.0],
        elbow_deg: None,
        reach_mm: 1550.0,
    },
    Builtin {
        model: "irb4600-60-2.05",
        source: "ABB product specification IRB 4600; ROS-Industrial abb_irb4600_support",
        rows: spherical(495.0, 175.0, 900.0, 175.0, 960.0, 135.0),
        parallelogram: false,
        min_deg: [-180.0, -90.0, -180.0, -400.0, -125.0, -400.0],
        max_deg: [180.0, 150.0, 75.0, 400.0, 120.0, 400.0],
        elbow_deg: None,
        reach_mm: 2050.0,
    },
    Builtin {
        model: "irb6640-235-2.55",
        source: "ABB product specification IRB 6640; ROS-Industrial abb_irb6640_support",
        rows: spherical(780.0, 320.0, 1075.0, 200.0, 1142.5, 200.0),
        parallelogram: false,
        min_deg: [-170.0, -65.0, -180.0, -300.0, -120.0, -360.0],
        max_deg: [170.0, 85.0, 70.0, 300.0, 120.0, 360.0],
        elbow_deg: None,
        reach_mm: 2550.0,
    },
    Builtin {
        model: "irb7600-500-2.55",
        source: "ABB product specification IRB 7600; ROS-Industrial abb_irb7600_support",
        rows: spherical(780.0, 410.0, 1075.0, 165.0, 1056.0, 250.0),
        parallelogram: false,
        min_deg: [-180.0, -60.0, -180.0, -300.0, -100.0, -360.0],
        max_deg: [180.0, 85.0, 60.0, 300.0, 100.0, 360.0],
        elbow_deg: None,
        reach_mm: 2550.0,
    },
    Builtin {
        model: "irb120-3-0.58",
        source: "ABB product specification IRB 120; ROS-Industrial abb_irb120_support",
        rows: spherical(290.0, 0.0, 270.0, 70.0, 302.0, 72.0),
        parallelogram: false,
        min_deg: [-165.0, -110.0, -110.0, -160.0, -120.0, -400.0],
        max_deg: [165.0, 110.0, 70.0, 160.0, 120.0, 400.0],
        elbow_deg: None,
        reach_mm: 580.0,
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Joints;

    /// Published reaches are rounded to 10 mm, and that of the IRB 2400 is less than its links' sum by 22 mm: its
    /// parallelogram does not stretch.
    const REACH_MM: f64 = 25.0;

    #[test]
    fn links_add_up_to_the_published_reach() {
        for robot in BUILTIN {
            let [_, [_, a1, ..], [_, a2, ..], [_, a3, d4, _], ..] = robot.rows;
            let stretched = a1 + a2 + a3.hypot(d4);
            assert!((stretched - robot.reach_mm).abs() < REACH_MM, "{}: {stretched}", robot.model);
        }
    }

    #[test]
    fn tool0_at_home_is_as_on_the_controller() {
        for builtin in BUILTIN {
            let pose = builtin.robot().forward(&Joints::zeros());
            let quat = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.rotation);
            let half = std::f64::consts::FRAC_1_SQRT_2;
            let expected = nalgebra::Quaternion::new(half, 0.0, half, 0.0);
            assert!(quat.into_inner().dot(&expected).abs() > 1.0 - 1e-12, "{}: {quat}", builtin.model);
        }
    }
}
