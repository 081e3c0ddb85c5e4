use super::frames::{named_tool, of_cell};
use super::mount::Mount;
use super::parallelism::Parallelism;
use super::solve::Solver;
use super::{Point, Prepared};
use deflex_cell::Cell;
use deflex_effects::{Need, ToolFrame};
use deflex_equilibrium::{EquilibriumError, WarmStart};
use deflex_robot::{EXTERNAL_AXES, External, Joints, Pose, Robot};
use deflex_text::Diagnostic;
use nalgebra::{Rotation3, Translation3, Vector3};

/// A tool of the cell by its name. Without a name it is the cell's only tool, or the bare flange if the cell has none.
///
/// # Errors
/// No tool has the name; the cell has several and none is named.
///
/// # Examples
/// ```
/// use deflex_correct::tool_of;
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/blade/cell.toml")?))?;
/// assert_eq!(tool_of(&cell, None)?.mass, 18.0); // kg: it has only one tool
/// assert!(tool_of(&cell, Some("tDrill")).is_err());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn tool_of(cell: &Cell, name: Option<&str>) -> Result<ToolFrame, Vec<Diagnostic>> {
    let bare = ToolFrame { flange_from_tcp: Pose::identity(), mass: 0.0, cog: Vector3::zeros() };
    match (name, cell.tools.len()) {
        (Some(name), _) => named_tool(cell, name),
        (None, 0 | 1) => Ok(cell.tools.values().next().copied().unwrap_or(bare)),
        (None, _) => {
            let known = cell.names_of(&cell.tools).join(", ");
            Err(Diagnostic::error("cell.unknown-tool", "", "the cell declares several tools, and none is named")
                .help(format!("name one of {known}"))
                .into())
        }
    }
}

/// The axes in which poses are given, and the positions of mechanical units.
///
/// # Examples
/// ```
/// use deflex_correct::{ArmState, Standing};
///
/// // Poses in the work object `wFixture`, at 24 °C.
/// let state = ArmState { temperature_c: Some(&[24.0]), ..ArmState::default() };
/// let standing = Standing { wobj: Some("wFixture"), state, ..Standing::default() };
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Standing<'a> {
    /// A work object of the cell; `None` is the robot's base.
    pub wobj: Option<&'a str>,
    /// Positions of the external axes, one entry for each pose (mm or degrees), see [`external_of`]; empty if no unit of the cell matters.
    pub external: &'a [External],
    /// The other values on which effects depend.
    pub state: ArmState<'a>,
}

/// Travel, times and other values on which effects depend, one for each pose.
///
/// # Examples
/// ```
/// use deflex_correct::ArmState;
///
/// // Axis 2 has moved in its positive direction, and the arm is warm after an hour.
/// let state = ArmState {
///     travel: Some(&[[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]),
///     time_s: Some(&[3600.0]),
///     ..ArmState::default()
/// };
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct ArmState<'a> {
    /// Motion of each axis to the pose, as the controller counts: only signs count, 0 for an axis that has not moved yet.
    pub travel: Option<&'a [[f64; 6]]>,
    /// Velocity of the TCP, mm/s, in the axes of the poses.
    pub velocity_mm_s: Option<&'a [[f64; 3]]>,
    /// Time since the start, s.
    pub time_s: Option<&'a [f64]>,
    /// Temperature, °C.
    pub temperature_c: Option<&'a [f64]>,
    /// Length that the tool has cut so far, m.
    pub cut_m: Option<&'a [f64]>,
}

impl ArmState<'_> {
    /// Refuses missing values on which an effect of the cell depends, and values for another number of poses.
    fn check(&self, cell: &Cell, poses: usize) -> Result<(), Vec<Diagnostic>> {
        let given = [
            ("travel", self.travel.map(<[_]>::len)),
            ("velocity_mm_s", self.velocity_mm_s.map(<[_]>::len)),
            ("time_s", self.time_s.map(<[_]>::len)),
            ("temperature_c", self.temperature_c.map(<[_]>::len)),
            ("cut_m", self.cut_m.map(<[_]>::len)),
        ];
        let mut errors = Vec::new();
        for effect in &cell.arm.effects {
            let needs = [
                effect.presliding().is_some(),
                effect.needs().contains(&Need::Speed),
                effect.needs().contains(&Need::Time),
                effect.needs().contains(&Need::Temperature),
                effect.needs().contains(&Need::CutLength),
            ];
            for ((name, _), _) in given.iter().zip(needs).filter(|((_, given), needed)| given.is_none() && *needed) {
                let message = format!("effect `{}` of the cell needs `{name}`", effect.kind());
                errors.push(Diagnostic::error("poses.state", "", message).help("give it pose by pose, or one for all"));
            }
        }
        for (name, count) in given {
            if let Some(count) = count.filter(|count| *count != poses) {
                let message = format!("`{name}` has values for {count} poses, but there are {poses} poses");
                errors.push(Diagnostic::error("poses.state", "", message).help("give a value for each pose"));
            }
        }
        if errors.is_empty() { Ok(()) } else { Err(errors) }
    }

    /// Puts the values of a pose into its point.
    fn put(&self, i: usize, robot: &Robot, point: &mut Point) {
        let one = |values: Option<&[f64]>| values.map(|values| values[i]);
        if let Some(travel) = self.travel {
            let sign = |moved: f64| if moved == 0.0 { 0.0 } else { moved.signum() };
            point.travel = robot.motor_from_axes_deg(&travel[i]).map(sign);
        }
        if let Some(velocity) = self.velocity_mm_s {
            point.velocity = Vector3::from(velocity[i]) * 1e-3;
        }
        point.time = one(self.time_s).unwrap_or(0.0);
        point.temperature = one(self.temperature_c);
        point.cut_length = one(self.cut_m).unwrap_or(0.0);
    }
}

/// Positions of external axes for `count` poses, from those of units by their names (mm or degrees); NaN for all others.
///
/// # Errors
/// A unit that the cell does not have, another number of positions, a position beyond the unit's limits.
///
/// # Examples
/// ```
/// use deflex_correct::external_of;
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/units/cell.toml")?))?;
/// let unit = &cell.units.all()[0];
/// let positions = external_of(&cell, &[(&unit.name, &[unit.min, unit.max])], 2)?;
/// assert_eq!(positions[1][unit.axis], unit.max);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn external_of(cell: &Cell, positions: &[(&str, &[f64])], count: usize) -> Result<Vec<External>, Vec<Diagnostic>> {
    let mut all = vec![[f64::NAN; EXTERNAL_AXES]; count];
    let units = cell.units.all();
    let wrong = |message: String, help: String| Err(Diagnostic::error("cell.unit", "", message).help(help).into());
    for (name, positions) in positions {
        let Some(unit) = cell.units.named(name).map(|unit| &units[unit]) else {
            let known = units.iter().map(|unit| &*unit.name).collect::<Vec<_>>().join(", ");
            let help =
                if known.is_empty() { "the cell has no [[unit]]".to_owned() } else { format!("name one of {known}") };
            return wrong(format!("the cell has no unit `{name}`"), help);
        };
        if positions.len() != count {
            let message = format!("unit `{name}` has {} positions, but there are {count} poses", positions.len());
            return wrong(message, "give a position for each pose".to_owned());
        }
        for (external, &position) in all.iter_mut().zip(*positions) {
            if !(unit.min..=unit.max).contains(&position) {
                let limits = format!("its limits {} to {}", unit.min, unit.max);
                let message = format!("unit `{name}` has the position {position}, outside {limits}");
                return wrong(message, format!("stay within {limits}"));
            }
            external[unit.axis] = position;
        }
    }
    Ok(all)
}

/// The pose of the loaded TCP (m) at commanded axis angles as the controller counts them (degrees), each under its own force on the tool at
/// the TCP (N). `standing` gives the axes of poses and forces, and the positions of units.
///
/// # Errors
/// A work object that the cell does not declare; a unit that matters without a position; an effect that needs a direction of travel, a
/// speed, a time, a temperature or a cut length that is not given. A pose without an equilibrium has an error of its own.
///
/// # Examples
/// ```
/// use deflex_correct::{Standing, predict_poses, tool_of};
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/blade/cell.toml")?))?;
/// let (axes_deg, tool) = ([[0.0, 20.0, 15.0, 0.0, 40.0, 0.0]; 2], tool_of(&cell, None)?);
/// let forces_n = [[0.0; 3], [0.0, 0.0, -300.0]];
/// let poses = predict_poses(&cell, &tool, &axes_deg, &forces_n, Standing::default())?;
/// let height = |i: usize| poses[i].as_ref().expect("an equilibrium").translation.z;
/// assert!(height(1) < height(0)); // 300 N downwards lower the tip
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn predict_poses(
    cell: &Cell,
    tool: &ToolFrame,
    axes_deg: &[[f64; 6]],
    forces_n: &[[f64; 3]],
    standing: Standing<'_>,
) -> Result<Vec<Result<Pose, EquilibriumError>>, Vec<Diagnostic>> {
    let robot = &cell.arm.robot;
    standing.state.check(cell, axes_deg.len())?;
    let mounts = standing.wobj.map(|name| mount_in(cell, name, *tool)).transpose()?;
    let nowhere = [f64::NAN; EXTERNAL_AXES];
    let mut points = Vec::with_capacity(axes_deg.len());
    for (i, (deg, force)) in axes_deg.iter().zip(forces_n).enumerate() {
        let external = standing.external.get(i).unwrap_or(&nowhere);
        let moved = match &mounts {
            Some(mount) => mount.placed(*external),
            None => Mount::base(cell, *external, *tool),
        };
        let moved = moved.ok_or_else(|| unplaced(cell, i))?;
        let motor = robot.motor_from_axes_deg(deg);
        let wobj_from_tcp = moved.setting.base_from_wobj.inverse() * robot.forward(&motor) * tool.flange_from_tcp;
        let mut point = Point::measured(wobj_from_tcp, motor, Joints::zeros());
        point.moved = Some(moved);
        standing.state.put(i, robot, &mut point);
        if force.iter().any(|component| component.abs() > 0.0) {
            point.set_force(Vector3::from(*force));
        }
        points.push(point);
    }
    let mut prepared = Prepared::of_points(points, robot, *tool);
    if cell.arm.follows_load() {
        prepared.follow_loads(&cell.arm);
    }
    let solver = Solver::new(&cell.arm, &prepared, Parallelism::Threads);
    let there = solver.forward(|i| prepared.points[i].as_programmed(), |_| WarmStart::default());
    let actual = |(there, point): (Result<_, EquilibriumError>, &Point)| {
        let there: deflex_equilibrium::PredictedPose = there?;
        let nominal = &point.wobj_from_tcp;
        let position = Translation3::from(nominal.translation.vector + there.shift);
        Ok(Pose::from_parts(position, Rotation3::new(there.turn) * nominal.rotation))
    };
    Ok(there.into_iter().zip(&prepared.points).map(actual).collect())
}

/// A tool in a declared work object.
fn mount_in(cell: &Cell, name: &str, tool: ToolFrame) -> Result<Mount, Vec<Diagnostic>> {
    let frame = of_cell(cell, name).ok_or_else(|| {
        let known = cell.names_of(&cell.wobjs).join(", ");
        let message = format!("the cell has no work object `{name}`");
        vec![Diagnostic::error("cell.unknown-wobj", "", message).help(format!("name one of {known}"))]
    })?;
    Ok(Mount::new(cell, frame, tool))
}

fn unplaced(cell: &Cell, pose: usize) -> Vec<Diagnostic> {
    let names = cell.units.all().iter().map(|unit| &*unit.name).collect::<Vec<_>>().join(", ");
    let message = format!("pose {}: the positions of the mechanical units are missing", pose + 1);
    vec![Diagnostic::error("cell.unit", "", message).help(format!("give the positions of {names}, mm or degrees"))]
}
