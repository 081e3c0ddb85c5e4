use super::configuration::{branch_index, turned_to};
use super::{Branch, Joints, Pose, Robot, Unreachable, conf_is};
use deflex_program::Conf;

/// The motor angles at the first target of a program, and how they were chosen.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let motor = robot.motor_from_axes_deg(&[10.0, 0.0, 0.0, 0.0, 30.0, 0.0]);
/// let start = robot.start(&robot.forward(&motor), None, Some(&motor)).expect("within reach");
/// assert!((start.motor - motor).amax() < 1e-9); // the solution nearest to the given angles
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Motor angles, rad.
    pub motor: Joints,
    /// How they were chosen.
    #[doc(hidden)]
    pub how: StartedFrom,
}

/// How the branch of the first target was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[doc(hidden)]
pub enum StartedFrom {
    /// By the joint target (MoveAbsJ) before it.
    JointTarget,
    /// By `[robot] start_deg` of the cell.
    StartDeg,
    /// By confdata of the first target, which fit one of the branches.
    Confdata,
    /// Together with the turn about the tool axis, which is free.
    FreeTurn,
    /// Neither the program nor the cell determines it: the branch nearest to home ([`Robot::home_deg`]).
    NearestHome,
}

impl Robot {
    /// Motor angles (rad) at the first flange pose of a program: the solution nearest to `start`, else in the branch
    /// that `conf` names, else nearest to home. Solutions within the limits are preferred.
    ///
    /// `conf` counts only if all three quarter turns fit the branch that its cfx names, because post-processors often
    /// write placeholders.
    ///
    /// # Errors
    /// The pose is out of reach, or every branch exceeds a limit.
    ///
    /// # Examples
    /// ```
    /// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    /// let motor = robot.motor_from_axes_deg(&[10.0, 0.0, 0.0, 0.0, 30.0, 0.0]);
    /// let start = robot.start(&robot.forward(&motor), None, None).expect("within reach");
    /// assert!((robot.forward(&start.motor).translation.vector - robot.forward(&motor).translation.vector).norm() < 1e-9);
    /// ```
    pub fn start(
        &self,
        base_from_flange: &Pose,
        conf: Option<Conf>,
        start: Option<&Joints>,
    ) -> Result<Start, Unreachable> {
        if let Some(start) = start {
            return Ok(Start { motor: self.inverse_near(base_from_flange, start)?, how: StartedFrom::StartDeg });
        }
        let home = self.home();
        if let Some(motor) = conf.and_then(|conf| self.branch_of_conf(base_from_flange, conf, &home)) {
            return Ok(Start { motor, how: StartedFrom::Confdata });
        }
        let ways = self.inverse_all(base_from_flange)?;
        let nearest = ways.into_iter().min_by(|a, b| (a - home).norm_squared().total_cmp(&(b - home).norm_squared()));
        let motor = nearest.ok_or(Unreachable::OutOfReach { by_mm: 0.0 })?;
        Ok(Start { motor, how: StartedFrom::NearestHome })
    }

    /// Motor angles (rad) of a joint motion to a pose with a configuration: those of the branch that it names, if it
    /// fits one, else those nearest to `near`.
    ///
    /// # Errors
    /// The pose is out of reach, or beyond an axis limit.
    #[doc(hidden)]
    pub fn inverse_conf(&self, base_from_flange: &Pose, conf: Conf, near: &Joints) -> Result<Joints, Unreachable> {
        match self.branch_of_conf(base_from_flange, conf, near) {
            Some(motor) => Ok(motor),
            None => self.inverse_near(base_from_flange, near),
        }
    }

    /// The branch that a configuration names, if its quarter turns fit the branch and it is within the limits.
    fn branch_of_conf(&self, base_from_flange: &Pose, conf: Conf, near: &Joints) -> Option<Joints> {
        if let Conf::Near(angles) = conf {
            let near = self.motor_from_axes_deg(&angles.map(|angle| 1e-4 * f64::from(angle)));
            return self.inverse_near(base_from_flange, &near).ok();
        }
        let index = branch_index(self, conf).filter(|index| *index < Branch::ALL.len())?;
        let motor = self.inverse(base_from_flange, near).ok()?[index]?;
        let turned = turned_to(&motor, conf);
        // Both are compared within a whole turn.
        let fits = conf_is(self, &turned, conf);
        (fits && self.limit_violation(&turned).is_none()).then_some(turned)
    }
}
