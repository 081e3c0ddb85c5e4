//! Tool, work object and base of a target, at the positions of the mechanical units that carry them.

use super::KeptReason;
use super::frames::WobjFrame;
use deflex_cell::Cell;
use deflex_effects::{Carries, ToolFrame, UnitAt};
use deflex_equilibrium::Setting;
use deflex_program::{ExternalAxes, Motion, Predecessor, Target};
use deflex_robot::{AxisName, EXTERNAL_AXES, External, Pose, Units, gravity_at};
use std::sync::Arc;

/// A tool and a work object, with the units that move them.
#[derive(Clone, Debug)]
pub(super) struct Mount {
    /// The setting with every unit at zero; valid at all positions if no unit moves base or work object.
    pub(super) setting: Setting,
    moving: Option<Arc<Moving>>,
}

/// The moving part of a mount.
#[derive(Debug, PartialEq)]
struct Moving {
    units: Arc<Units>,
    /// The base with every unit at zero.
    world_from_base: Pose,
    wobj: WobjFrame,
}

/// The external axes of a target, and the setting at their positions.
#[derive(Clone, Debug)]
pub(super) struct Moved {
    /// Positions of the cell's units; NaN for one that is unknown and does not matter.
    pub(super) external: External,
    pub(super) setting: Setting,
    /// The units as effects see them there.
    pub(super) units: Vec<UnitAt>,
}

impl PartialEq for Mount {
    fn eq(&self, other: &Self) -> bool {
        self.setting == other.setting && self.moving == other.moving
    }
}

impl Mount {
    pub(super) fn new(cell: &Cell, wobj: WobjFrame, tool: ToolFrame) -> Self {
        let (units, world_from_base) = (&cell.units, cell.arm.robot.world_from_base);
        let moves = wobj.unit.is_some() || units.under_robot().is_some();
        let moving = Moving { units: Arc::clone(units), world_from_base, wobj };
        let setting = moving.at(&[0.0; EXTERNAL_AXES], tool, false);
        Self { setting, moving: moves.then(|| Arc::new(moving)) }
    }

    /// Origins of work object and tool, to the bit: equal mounts have equal ones.
    pub(super) fn place(&self) -> [u64; 6] {
        let origins = [self.setting.base_from_wobj.translation, self.setting.tool.flange_from_tcp.translation];
        // Zeros of either sign are equal.
        std::array::from_fn(|i| (origins[i / 3].vector[i % 3] + 0.0).to_bits())
    }

    /// A stationary tool in the world, and a part that the robot holds: `tool` is its work object in the flange, with the load there.
    pub(super) fn held(cell: &Cell, world_from_tool: Pose, tool: ToolFrame) -> Self {
        let mut mount = Self::new(cell, WobjFrame::fixed(world_from_tool), tool);
        mount.setting.held = true;
        mount
    }

    /// A mount that no unit moves.
    pub(super) fn fixed(setting: Setting) -> Self {
        Self { setting, moving: None }
    }

    /// Whether it has the same work object as another.
    pub(super) fn shares_wobj(&self, other: &Self) -> bool {
        match (&self.moving, &other.moving) {
            (Some(own), Some(other)) => own.wobj == other.wobj,
            (None, None) => self.setting.base_from_wobj == other.setting.base_from_wobj,
            _ => false,
        }
    }

    /// The setting at the positions of the units at another target; `None` if they are unknown.
    pub(super) fn at(&self, there: Option<&Arc<Moved>>) -> Option<Setting> {
        match (&self.moving, there) {
            (None, _) => Some(self.setting),
            (Some(moving), Some(there)) if moving.needed().all(|axis| !there.external[axis].is_nan()) => {
                Some(moving.at(&there.external, self.setting.tool, self.setting.held))
            }
            _ => None,
        }
    }

    /// The unit that carries the work object, in the work object.
    pub(super) fn wobj_from_unit(&self) -> Option<Pose> {
        let wobj = &self.moving.as_ref()?.wobj;
        wobj.unit.map(|_| wobj.frame.inverse())
    }

    /// Whether an external axis moves base or work object.
    pub(super) fn is_moved_by(&self, axis: usize) -> bool {
        self.moving.as_ref().is_some_and(|moving| moving.needed().any(|needed| needed == axis))
    }

    /// Why the segment to a target is not a line or an arc in its work object: a motion group moves on it that the robot does not follow, or
    /// the robot follows a group that does not carry the work object.
    fn misled(&self, cell: &Cell, motion: Motion, axes: &ExternalAxes, before: &ExternalAxes) -> Option<KeptReason> {
        if !matches!(motion, Motion::Linear | Motion::Circular) {
            return None;
        }
        let units = cell.units.all();
        let of = |axis: AxisName| units.iter().find(|unit| unit.named == axis);
        let moves = |axis: &AxisName| axes.position(*axis).is_none() || axes.position(*axis) != before.position(*axis);
        let groups = || axes.used().filter(|axis| axis.group().is_some());
        let carries = |axis: AxisName| of(axis).is_some_and(|unit| self.is_moved_by(unit.axis));
        if !axes.coordinated {
            return groups().filter(moves).any(carries).then_some(KeptReason::NotCoordinated);
        }
        // A group that carries nothing does not lead, unless there is no other.
        let leads = |axis: AxisName| of(axis).is_some() || groups().all(|axis| of(axis).is_none());
        groups().filter(moves).any(|axis| leads(axis) && !carries(axis)).then_some(KeptReason::CoordinatedElsewhere)
    }

    /// The mount with the units at these positions (mm or degrees); `None` if no unit moves it.
    pub(super) fn moved(&self, external: External) -> Option<Arc<Moved>> {
        Some(Arc::new(self.moving.as_ref()?.moved(external, &self.setting)))
    }

    /// The base itself, as the units carry it; `None` if its inclination is unknown.
    pub(super) fn base(cell: &Cell, external: External, tool: ToolFrame) -> Option<Arc<Moved>> {
        let gravity = gravity_at(&cell.units.world_from_base(&cell.arm.robot.world_from_base, &external));
        let setting = Setting { base_from_wobj: Pose::identity(), gravity, tool, held: false };
        // A unit that carries the robot does not move it against its own base.
        gravity.iter().all(|g| g.is_finite()).then(|| Arc::new(Moved { external, setting, units: Vec::new() }))
    }

    /// The mount with the units at these positions; `None` if one that matters is unknown.
    pub(super) fn placed(&self, external: External) -> Option<Arc<Moved>> {
        match &self.moving {
            None => Some(Arc::new(Moved { external, setting: self.setting, units: Vec::new() })),
            Some(moving) => {
                let known = moving.needed().all(|axis| !external[axis].is_nan());
                known.then(|| Arc::new(moving.moved(external, &self.setting)))
            }
        }
    }

    /// The mount at a share of the segment between two targets, on which external axes move evenly.
    pub(super) fn between(&self, from: Option<&Arc<Moved>>, to: Option<&Arc<Moved>>, share: f64) -> Option<Arc<Moved>> {
        let (Some(moving), Some(from), Some(to)) = (&self.moving, from, to) else { return to.cloned() };
        if Arc::ptr_eq(from, to) || share >= 1.0 {
            return Some(Arc::clone(to));
        }
        let external = std::array::from_fn(|i| from.external[i] + share * (to.external[i] - from.external[i]));
        Some(Arc::new(moving.moved(external, &self.setting)))
    }
}

impl Moving {
    fn at(&self, external: &External, tool: ToolFrame, held: bool) -> Setting {
        let world_from_base = self.units.world_from_base(&self.world_from_base, external);
        let world_from_wobj = match self.wobj.unit {
            Some(unit) => self.units.world_from_unit(unit, external) * self.wobj.frame,
            None => self.wobj.frame,
        };
        let base_from_wobj = world_from_base.inverse() * world_from_wobj;
        Setting { base_from_wobj, gravity: gravity_at(&world_from_base), tool, held }
    }

    /// A target at positions of the external axes; `zero` is its setting with every unit at zero.
    fn moved(&self, external: External, zero: &Setting) -> Moved {
        let setting = self.at(&external, zero.tool, zero.held);
        let units = &self.units;
        let world_from_base = units.world_from_base(&self.world_from_base, &external);
        let wobj_from_world = (world_from_base * setting.base_from_wobj).inverse();
        let at = |i: usize| {
            let under = |top: Option<usize>| units.chain(top).any(|below| below == i);
            let is_known = units.chain(Some(i)).all(|below| !external[units.all()[below].axis].is_nan());
            let carries = match (under(self.wobj.unit), under(units.under_robot())) {
                (true, false) if is_known => Carries::Part,
                (false, true) if is_known => Carries::Robot,
                _ => Carries::BothOrNone,
            };
            let frame = match carries {
                Carries::BothOrNone => Pose::identity(),
                Carries::Part | Carries::Robot => wobj_from_world * units.world_from_frame(i, &external),
            };
            UnitAt::new(&units.all()[i].name, frame, carries)
        };
        Moved { external, setting, units: (0..units.all().len()).map(at).collect() }
    }

    /// External axes that move base or work object.
    fn needed(&self) -> impl Iterator<Item = usize> + '_ {
        let under = [self.units.under_robot(), self.wobj.unit];
        under.into_iter().flat_map(|unit| self.units.chain(unit)).map(|unit| self.units.all()[unit].axis)
    }
}

/// Position and setting of a target on units.
#[derive(Clone, Debug, Default)]
pub(super) struct Stand {
    pub(super) moved: Option<Arc<Moved>>,
    /// Why the pose of the target is unknown.
    pub(super) unsolved: Option<KeptReason>,
    /// Whether the segment to the target does not begin at the target before.
    pub(super) apart: bool,
}

/// Whether the segment to a target does not begin at the point before it.
pub(super) fn is_entered_elsewhere(target: &Target) -> bool {
    target.predecessor != Predecessor::Previous || target.external.as_ref().is_some_and(|external| external.moved_alone)
}

impl Stand {
    /// The units of a cell at a target with this mount. `last` is the last such result, `before` has the axes at the start of the segment, and
    /// `chosen` positions replace those of the program where they are not NaN.
    ///
    /// # Errors
    /// A unit is sent beyond its limits.
    pub(super) fn of(
        cell: &Cell,
        target: &Target,
        mount: &Mount,
        last: Option<&Arc<Moved>>,
        before: Option<&ExternalAxes>,
        chosen: &External,
    ) -> Result<Self, String> {
        let apart = is_entered_elsewhere(target);
        let unsolved = |why| Ok(Self { moved: None, unsolved: Some(why), apart });
        let none = ExternalAxes::default();
        let axes = match (&target.external, &mount.moving) {
            (None, None) => return Ok(Self { apart, ..Self::default() }),
            (external, _) => external.as_deref().unwrap_or(&none),
        };
        let units = cell.units.all();
        if let Some(axis) = axes.used().find(|axis| !cell.units.knows(*axis)) {
            let group = axis.group().filter(|group| (2..=9).contains(group));
            return unsolved(group.map_or(KeptReason::AxisWithoutUnit, KeptReason::GroupWithoutUnit));
        }
        if let Some(why) = before.filter(|_| !apart).and_then(|before| mount.misled(cell, target.motion, axes, before))
        {
            return unsolved(why);
        }
        let mut external = [f64::NAN; EXTERNAL_AXES];
        let mut stands = false;
        for (i, unit) in units.iter().enumerate() {
            let chosen = chosen[unit.axis];
            let sent = if chosen.is_nan() { axes.position(unit.named) } else { Some(chosen) };
            if let Some(position) = sent.filter(|position| !(unit.min..=unit.max).contains(position)) {
                let (name, axis) = (&unit.name, unit.named);
                return Err(format!(
                    "unit `{name}` ({axis}) would have to move to {position}, outside its limits {} to {}",
                    unit.min, unit.max
                ));
            }
            // Several axes of one unit have names of their own here: the program has that of the last one.
            let above = |at: &usize| cell.units.chain(Some(*at)).any(|below| below == i);
            let inactive = (0..units.len()).filter(above).find_map(|at| {
                let named =
                    |inactive: &&deflex_program::InactiveUnit| inactive.name.eq_ignore_ascii_case(&units[at].name);
                axes.inactive.iter().find(named).map(|inactive| (at, inactive.stands[unit.axis]))
            });
            external[unit.axis] = match (inactive, sent) {
                (None, sent) => sent.unwrap_or(f64::NAN),
                (Some((at, stands)), sent) if at == i || stands == sent => stands.unwrap_or(f64::NAN),
                _ => f64::NAN,
            };
            stands |= inactive.is_some() && external[unit.axis].is_nan();
        }
        let Some(moving) = &mount.moving else {
            return Ok(Self {
                moved: Some(Arc::new(Moved { external, setting: mount.setting, units: Vec::new() })),
                unsolved: None,
                apart,
            });
        };
        if moving.needed().any(|axis| external[axis].is_nan()) {
            return unsolved(if stands { KeptReason::UnitDeactivated } else { KeptReason::UnitPositionMissing });
        }
        // Mostly the positions are those of the last target.
        let same = |last: &&Arc<Moved>| last.external.map(f64::to_bits) == external.map(f64::to_bits);
        let moved = last.filter(same).cloned();
        let moved = moved.unwrap_or_else(|| Arc::new(moving.moved(external, &mount.setting)));
        Ok(Self { moved: Some(moved), unsolved: None, apart })
    }

    /// The setting of the target.
    pub(super) fn setting<'a>(&'a self, mount: &'a Mount) -> &'a Setting {
        self.moved.as_ref().map_or(&mount.setting, |moved| &moved.setting)
    }
}
