//! Commands for every point: equilibria in parallel, directions of travel in order.

use super::parallelism::{Lane, Parallelism, WorkspacePool};
use super::{Correct, Prepared, frames};
use deflex_equilibrium::{
    Aimed, Arm, Batch, Command, Dragged, EquilibriumError, Given, InverseSolution, PredictedPose, Room, Setting,
    Settling, Start, WarmStart,
};
use deflex_program::{Editable, Language};
use deflex_robot::{BatchArm, Joints, Pose, Robot, Unreachable, WrittenTarget, turn_between};
use deflex_text::number;
use nalgebra::Vector3;

/// Decimals of a posted program: 4 of a millimetre, 8 of a quaternion (see `RewriteOptions`).
const POSTED_DECIMALS: (usize, usize) = (4, 8);

/// A solved command.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    /// Commanded motor angles, rad.
    pub(super) motor: Joints,
    /// The nominal forward kinematics of these angles: the corrected target.
    pub(super) wobj_from_tcp: Pose,
}

/// The pose of the controller for a target as written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reached {
    /// Motor angles, rad.
    pub(super) motor: Joints,
    /// Rotation vector from the programmed orientation, work object axes, rad.
    pub(super) turn: Vector3<f64>,
}

/// What is solved at each point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CorrectionMode {
    /// Leave the command as it is.
    Keep,
    /// The whole pose of the loaded TCP is the wanted one.
    Pose,
    /// The position of the loaded TCP is the wanted one; the command keeps its orientation.
    Position,
}

impl CorrectionMode {
    pub(super) fn of(editable: Editable, correct: Correct) -> Self {
        match (editable, correct) {
            (Editable::No(_), _) => Self::Keep,
            (Editable::Position, _) | (_, Correct::Position) => Self::Position,
            (Editable::Pose, Correct::Pose) => Self::Pose,
        }
    }
}

/// The last commanded motor angles and the direction of travel to them.
pub(super) type Last = Option<Dragged>;

/// The results for a target before the corrected directions of travel are settled.
#[derive(Clone, Debug)]
pub(super) struct First {
    aim: Result<InverseSolution, EquilibriumError>,
    /// The nominal forward kinematics of the command, if it does not depend on the travel.
    nominal: Option<Pose>,
    /// The pose where the loaded arm ends up without a correction.
    pub(super) uncorrected: Result<PredictedPose, EquilibriumError>,
}

impl First {
    /// The command.
    pub(super) fn aim(&self) -> Result<&InverseSolution, &EquilibriumError> {
        self.aim.as_ref()
    }
}

/// The result for a point whose pose is unknown.
const UNSOLVED: EquilibriumError = EquilibriumError::NotFinite;

/// Solves all points of a program or a chunk, many at once where the cell allows it.
pub(super) struct Solver<'a> {
    pub(super) arm: &'a Arm,
    many: Batch<'a>,
    pub(super) prepared: &'a Prepared,
    pub(super) parallelism: Parallelism,
    workspaces: WorkspacePool<Room<'a>>,
}

impl<'a> Solver<'a> {
    pub(super) fn new(arm: &'a Arm, prepared: &'a Prepared, parallelism: Parallelism) -> Self {
        Self { arm, many: Batch::new(arm), prepared, parallelism, workspaces: WorkspacePool::default() }
    }

    /// Commands of every point with the programmed travel, and the pose where the arm ends up without a correction.
    pub(super) fn first(&self, modes: &[CorrectionMode]) -> Vec<First> {
        let prepared = self.prepared;
        let many = |room: &mut Room<'a>, indices: &[usize]| {
            let wanted = |lane: usize| {
                let point = &prepared.points[indices[lane]];
                (prepared.site(indices[lane]), &point.motor, &point.travel)
            };
            self.many.aim(room, indices.len(), wanted);
        };
        let answer = |room: &Room<'a>, lane: Lane| {
            let Aimed { aim, nominal, uncorrected } = room.aimed(lane.number)?;
            Some(First { aim: Ok(aim), nominal, uncorrected: Ok(uncorrected) })
        };
        let one = |i: usize| {
            let point = &prepared.points[i];
            if point.unsolved.is_some() {
                return First { aim: Err(UNSOLVED), nominal: None, uncorrected: Err(UNSOLVED) };
            }
            let aim = self.one(i, modes[i], &point.travel);
            let near = aim.as_ref().map_or_else(|_| WarmStart::default(), InverseSolution::uncorrected);
            First { aim, nominal: None, uncorrected: self.land(i, point.as_programmed(), near) }
        };
        let simple = |i: usize| modes[i] == CorrectionMode::Pose && !prepared.setting(i).held;
        self.parallelism.for_each_batch(modes.len(), simple, &self.workspaces, many, answer, one)
    }

    /// Corrected commands of every point in their settled directions of travel.
    pub(super) fn commands(
        &self,
        modes: &[CorrectionMode],
        first: &[First],
        travels: &[Joints],
    ) -> Vec<Result<Solved, EquilibriumError>> {
        let (arm, prepared) = (self.arm, self.prepared);
        let follows = arm.follows_command();
        let commanded = |i: usize| first[i].aim().map_or(prepared.points[i].motor, |aim| aim.commanded(&travels[i]));
        let many = |room: &mut Room<'a>, indices: &[usize]| {
            let given = |lane: usize| (prepared.setting(indices[lane]), commanded(indices[lane]));
            self.many.nominal(room, indices.len(), given);
        };
        let answer = |room: &Room<'a>, lane: Lane| {
            let (motor, wobj_from_tcp) = room.nominal(lane.number);
            Some(Ok(Solved { motor, wobj_from_tcp }))
        };
        let one = |i: usize| {
            let (point, travel) = (&prepared.points[i], &travels[i]);
            let aim = first[i].aim().map_err(Clone::clone)?;
            if let Some(wobj_from_tcp) = first[i].nominal {
                return Ok(Solved { motor: aim.free, wobj_from_tcp });
            }
            let again = modes[i] == CorrectionMode::Position && aim.lost != Joints::zeros();
            let motor = if (follows || again) && *travel != point.travel {
                self.one(i, modes[i], travel)?.commanded(travel)
            } else {
                aim.commanded(travel)
            };
            let mut wobj_from_tcp = prepared.setting(i).wobj_from_tcp(&arm.robot.forward(&motor));
            match modes[i] {
                CorrectionMode::Keep => wobj_from_tcp = point.wobj_from_tcp,
                CorrectionMode::Position => wobj_from_tcp.rotation = point.wobj_from_tcp.rotation,
                CorrectionMode::Pose => {}
            }
            Ok(Solved { motor, wobj_from_tcp })
        };
        let again = |i: usize| follows && travels[i] != prepared.points[i].travel;
        let simple = |i: usize| {
            modes[i] == CorrectionMode::Pose
                && first[i].aim().is_ok()
                && first[i].nominal.is_none()
                && !again(i)
                && !prepared.setting(i).held
        };
        self.parallelism.for_each_batch(modes.len(), simple, &self.workspaces, many, answer, one)
    }

    fn one(&self, i: usize, mode: CorrectionMode, travel: &Joints) -> Result<InverseSolution, EquilibriumError> {
        let (arm, point, situation) = (self.arm, &self.prepared.points[i], self.prepared.situation(i));
        let command = match mode {
            CorrectionMode::Keep => Command::held(&point.motor),
            CorrectionMode::Pose => {
                arm.command_from(&situation, &situation.wobj_from_tcp, Start::At(&point.motor), travel)?
            }
            CorrectionMode::Position => {
                let commanded = match self.prepared.setting(i).held {
                    // In the mirror image of a held part: see `Point::situation`.
                    true => point.wobj_from_tcp.inverse() * point.reference,
                    false => point.wobj_from_tcp,
                };
                arm.command_position(&situation, &commanded, &point.motor, travel)?
            }
        };
        Ok(command.aim())
    }

    fn land(&self, i: usize, command: (&Joints, &Joints), near: WarmStart) -> Result<PredictedPose, EquilibriumError> {
        let there = self.arm.land(&self.prepared.situation(i), command, &near)?;
        Ok(self.prepared.points[i].seen_from_wobj(self.prepared.setting(i), there))
    }

    /// Forward equilibria of every point's command (motor angles, direction of travel), starting from known deflections.
    pub(super) fn forward<'c>(
        &self,
        command: impl Fn(usize) -> (&'c Joints, &'c Joints) + Sync,
        near: impl Fn(usize) -> WarmStart + Sync,
    ) -> Vec<Result<PredictedPose, EquilibriumError>> {
        let many = |room: &mut Room<'a>, indices: &[usize]| {
            let given = |lane: usize| {
                let i = indices[lane];
                let (motor, travel) = command(i);
                Given { site: self.prepared.site(i), motor, travel, near: near(i) }
            };
            self.many.land(room, indices.len(), given);
        };
        let answer = |room: &Room<'a>, lane: Lane| room.landed(lane.number).map(Ok);
        let known = |i: usize| self.prepared.points[i].unsolved.is_none();
        let one = |i: usize| if known(i) { self.land(i, command(i), near(i)) } else { Err(UNSOLVED) };
        let simple = |i: usize| known(i) && !self.prepared.setting(i).held;
        self.parallelism.for_each_batch(self.prepared.points.len(), simple, &self.workspaces, many, answer, one)
    }

    /// The motor angles of the controller for the written numbers, near the commands.
    pub(super) fn reached(
        &self,
        written: &[([f64; 3], [f64; 4])],
        (modes, first): (&[CorrectionMode], &[First]),
        solved: &[Result<Solved, EquilibriumError>],
        is_changed: &[bool],
    ) -> Vec<Result<Reached, EquilibriumError>> {
        let (robot, points) = (BatchArm::of(&self.arm.robot), &self.prepared.points);
        // The branch is that of the actual angles, which differ by the deflection.
        let near = |i: usize| first[i].aim().map_or(&points[i].motor, |aim| &aim.motor);
        let many = |room: &mut Room<'a>, indices: &[usize]| {
            let place = |lane: usize| {
                let i = indices[lane];
                let setting = self.prepared.setting(i);
                WrittenTarget {
                    base_from_wobj: &setting.base_from_wobj,
                    position_mm: &written[i].0,
                    quat: &written[i].1,
                    flange_from_tcp: &setting.tool.flange_from_tcp,
                    near: near(i),
                }
            };
            if let Some(robot) = &robot {
                robot.find(indices.len(), place, &mut room.found);
                room.found.turn_from(indices.len(), |lane| &points[indices[lane]].wobj_from_tcp.rotation);
            }
        };
        let answer = |room: &Room<'a>, lane: Lane| {
            let motor = room.found.nearest(lane.number, near(lane.index)).filter(|_| robot.is_some())?;
            Some(Ok(Reached { motor, turn: room.found.turn(lane.number) }))
        };
        let one = |i: usize| {
            if !is_changed[i] {
                return Ok(Reached { motor: points[i].motor, turn: Vector3::zeros() });
            }
            let rotation = frames::pose(written[i].0, written[i].1).rotation;
            let near = solved[i].as_ref().map_or(&points[i].motor, |solved| &solved.motor);
            Ok(Reached {
                motor: controller_joints(self.arm, self.prepared.setting(i), &written[i], near)?,
                turn: turn_between(&points[i].wobj_from_tcp.rotation, &rotation),
            })
        };
        let simple = |i: usize| {
            let held = self.prepared.setting(i).held;
            is_changed[i] && modes[i] == CorrectionMode::Pose && first[i].aim().is_ok() && !held
        };
        self.parallelism.for_each_batch(written.len(), simple, &self.workspaces, many, answer, one)
    }
}

/// Travel of the **corrected** motion, in order: lost motion is added in the direction of travel, and the travel follows from the commands.
/// Without lost motion it has no effect, and stays that of the programmed motion.
pub(super) fn settle_travel(arm: &Arm, prepared: &Prepared, first: &[First], last: &mut Last) -> Vec<Joints> {
    if !arm.follows_travel() {
        return prepared.points.iter().map(|point| point.travel).collect();
    }
    first
        .iter()
        .zip(&prepared.points)
        .map(|(first, point)| {
            let twist = point.twist();
            let Ok(command) = first.aim() else {
                // A target that is kept is reached by its own numbers. Before the first known target the angles are not numbers.
                let (motor, travel) = (point.motor, point.travel);
                *last = motor.iter().all(|angle| angle.is_finite()).then_some(Dragged { motor, twist, travel });
                return travel;
            };
            let travel = match *last {
                Some(from) => {
                    let (free, lost, programmed) = (&command.free, &command.lost, &point.travel);
                    arm.settled_travel(&from, Settling { free, lost, twist: &twist, programmed })
                }
                None => Joints::zeros(),
            };
            *last = Some(Dragged { motor: command.commanded(&travel), twist, travel });
            travel
        })
        .collect()
}

/// Motor angles of the controller for numbers in its precision, near known angles.
pub(super) fn controller_joints(
    arm: &Arm,
    setting: &Setting,
    written: &([f64; 3], [f64; 4]),
    near: &Joints,
) -> Result<Joints, Unreachable> {
    let pose = frames::pose(written.0, written.1);
    arm.robot.inverse_near(&setting.base_from_flange(&pose), near)
}

/// Motor angles of the controller for a pose, near known angles, without regard to axis limits; `None` if out of reach.
pub(super) fn controller_motor(robot: &Robot, setting: &Setting, pose: &Pose, near: &Joints) -> Option<Joints> {
    robot.inverse_near_unlimited(&setting.base_from_flange(pose), near).ok()
}

/// A pose as the controller of the posted program stores it: position, mm, and orientation, scalar first.
pub(super) fn as_posted(pose: &Pose, post: Option<Language>) -> ([f64; 3], [f64; 4]) {
    let (position, quat) = frames::millimetres(pose);
    if let Some(held) = post.and_then(|post| post.about().post.held) {
        return held(position, quat);
    }
    let round = |value: f64, decimals: usize| f64::from(number::printed(value, decimals) as f32);
    (position.map(|v| round(v, POSTED_DECIMALS.0)), quat.map(|v| round(v, POSTED_DECIMALS.1)))
}
