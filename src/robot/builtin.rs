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

/// Every built-in robot.
pub const BUILTIN: &[Builtin] = &[Builtin {
    model: "irb6660-205-1.9",
    source: "Tang et al., Table 1; ABB 3HAC030822",
    rows: [
        [0.0, 0.0, 814.5, 0.0],
        [-90.0, 300.0, 0.0, -90.0],
        [0.0, 700.0, 0.0, 0.0],
        [-90.0, 280.0, 893.0, 0.0],
        [90.0, 0.0, 0.0, 0.0],
        [-90.0, 0.0, 200.0, 180.0],
    ],
    parallelogram: true,
    min_deg: [-180.0, -42.0, -20.0, -300.0, -120.0, -360.0],
    max_deg: [180.0, 85.0, 120.0, 300.0, 120.0, 360.0],
    elbow_deg: Some([-70.0, 70.0]),
    reach_mm: 1930.0,
}];
