use super::{Joints, Pose, Robot, Unreachable, polish};

/// Number of starts from which all solutions of a chain without an explicit inverse are searched. For a UR arm, the
/// first 60 or fewer found all eight in each of 2,000 random poses
/// (`every_solution_of_a_chain_without_an_explicit_inverse_is_found`).
const STARTS: u32 = 240;
/// Solutions that differ by less than this in every joint are the same, rad.
const SAME: f64 = 1e-6;

impl Robot {
    /// Motor angles (rad) of every solution for a flange pose within the axis limits, with each axis turned as near to
    /// home as its range allows. They come from the explicit inverse, or else from starts that are spread over all
    /// angles.
    ///
    /// # Errors
    /// The pose is out of reach, or every solution exceeds an axis limit.
    #[doc(hidden)]
    pub fn inverse_all(&self, base_from_flange: &Pose) -> Result<Vec<Joints>, Unreachable> {
        let home = self.home();
        let reached: Vec<Joints> = if self.has_closed_form() {
            self.inverse(base_from_flange, &home)?.into_iter().flatten().collect()
        } else {
            let mut last = None;
            let mut found: Vec<Joints> = Vec::new();
            for start in 1..=STARTS {
                match polish(&self.links, base_from_flange, &spread(start)) {
                    Ok(serial) => found.push(self.motor_from_serial(&serial)),
                    Err(error) => last = Some(error),
                }
            }
            if let (true, Some(error)) = (found.is_empty(), last) {
                return Err(error);
            }
            found
        };
        let mut ways: Vec<Joints> = Vec::new();
        let mut violation = None;
        for motor in reached {
            let motor = self.nearest_turns(&motor, &home);
            match self.limit_violation(&motor) {
                Some(beyond) => violation = violation.or(Some(beyond)),
                None if ways.iter().all(|way| (way - motor).amax() > SAME) => ways.push(motor),
                None => {}
            }
        }
        match violation {
            Some(beyond) if ways.is_empty() => Err(beyond.into()),
            _ => Ok(ways),
        }
    }
}

/// Joint angles number `index` of a Halton sequence over whole turns, rad. The sequence is evenly spread and always the
/// same.
fn spread(index: u32) -> Joints {
    const BASES: [u32; 6] = [2, 3, 5, 7, 11, 13];
    Joints::from_fn(|joint, _| {
        let (mut rest, mut share, mut digit) = (index, 0.0, 1.0);
        while rest > 0 {
            digit /= f64::from(BASES[joint]);
            share += digit * f64::from(rest % BASES[joint]);
            rest /= BASES[joint];
        }
        (2.0 * share - 1.0) * std::f64::consts::PI
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BUILTIN;

    #[test]
    fn every_solution_of_a_chain_without_an_explicit_inverse_is_found() {
        let robot = BUILTIN.iter().find(|robot| robot.model == "ur10e").unwrap().robot();
        for index in 0..20 {
            let motor = spread(7 * index + 1);
            let pose = robot.forward(&motor);
            let ways = robot.inverse_all(&pose).unwrap();
            // The arm's published closed form has two shoulders, two wrists and two elbows.
            assert!(ways.len() == 8 || ways.len() == 4 || ways.len() == 2, "{}", ways.len());
            for way in &ways {
                let off = robot.forward(way).translation.vector - pose.translation.vector;
                assert!(off.norm() < 1e-9, "{off}");
            }
            let turned = |a: f64, b: f64| ((a - b) / std::f64::consts::TAU).round() * std::f64::consts::TAU + b - a;
            assert!(ways.iter().any(|way| (0..6).all(|i| turned(way[i], motor[i]).abs() < 1e-6)), "{motor}");
        }
    }
}
