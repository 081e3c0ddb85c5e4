use super::configuration::{branch_index, turned_to};
use super::{Branch, Joints, Pose, Robot, Unreachable, conf_is, is_close};
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

    /// Motor angles (rad) of a joint motion to a pose: those of the solution that a configuration names, if one fits it, else those
    /// nearest to `near`.
    ///
    /// # Errors
    /// The pose is out of reach, or beyond an axis limit.
    #[doc(hidden)]
    pub fn inverse_conf(
        &self,
        base_from_flange: &Pose,
        conf: Option<Conf>,
        near: &Joints,
    ) -> Result<Joints, Unreachable> {
        match conf.and_then(|conf| self.branch_of_conf(base_from_flange, conf, near)) {
            Some(motor) => Ok(motor),
            None => self.nearest_of_all(base_from_flange, near),
        }
    }

    /// The nearest of all solutions within the limits. Newton's method from `near` may find another one, because a joint motion is long.
    fn nearest_of_all(&self, base_from_flange: &Pose, near: &Joints) -> Result<Joints, Unreachable> {
        let far = |motor: &Joints| (motor - near).norm_squared();
        let nearest = self.inverse_near(base_from_flange, near);
        if self.has_closed_form() || nearest.is_ok_and(|motor| is_close(&motor, near)) {
            return nearest;
        }
        let all = self.inverse_all(base_from_flange)?.into_iter().map(|motor| self.nearest_turns(&motor, near));
        all.chain(nearest).min_by(|a, b| far(a).total_cmp(&far(b))).ok_or(Unreachable::OutOfReach { by_mm: 0.0 })
    }

    /// The solution that a configuration names, if its turns fit the solution and it is within the limits.
    fn branch_of_conf(&self, base_from_flange: &Pose, conf: Conf, near: &Joints) -> Option<Joints> {
        if let Conf::Near(angles) = conf {
            let near = self.motor_from_axes_deg(&angles.map(|angle| 1e-4 * f64::from(angle)));
            return self.nearest_of_all(base_from_flange, &near).ok();
        }
        // Both are compared within a whole turn.
        let fits = |motor: Joints| {
            let turned = turned_to(&motor, conf);
            (conf_is(self, &turned, conf) && self.limit_violation(&turned).is_none()).then_some(turned)
        };
        if !self.has_closed_form() {
            return self.inverse_all(base_from_flange).ok()?.into_iter().find_map(fits);
        }
        let index = branch_index(self, conf).filter(|index| *index < Branch::ALL.len())?;
        fits(self.inverse(base_from_flange, near).ok()?[index]?)
    }
}
