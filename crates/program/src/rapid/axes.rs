//! External axes during the run: offsets in force, deactivated mechanical units, and positions of the axes.
//!
//! Source: ABB, *Technical reference manual: RAPID Instructions, Functions and Data types* (3HAC050917-001), the pages of
//! `ActUnit`, `DeactUnit`, `EOffsSet`, `EOffsOn`, `EOffsOff`, `MoveExtJ` and `extjoint`.

use super::eval::Scope;
use super::expression::{Arguments, Expression};
use super::lasting::LastingStates;
use super::literal::UNUSED_AXIS;
use super::predefined::Instruction;
use super::runner::{Mode, Runner};
use super::state::Axes;
use super::symbols::Upper;
use super::value::axes_in_use;
use crate::{EXTERNAL_AXES, External, ExternalAxes, InactiveUnit, Reason, Role};
use deflex_text::decode;
use std::sync::Arc;

/// External axes of a target that uses them, without offsets of the controller and with all units active.
pub(super) fn as_written(external: &External) -> Option<Arc<ExternalAxes>> {
    axes_in_use(external).then(|| Arc::new(ExternalAxes { written: written(external), ..ExternalAxes::default() }))
}

fn written(external: &External) -> [Option<f64>; EXTERNAL_AXES] {
    external.map(|v| (v < UNUSED_AXIS).then_some(v))
}

impl<'a> Runner<'a> {
    /// An instruction on external axes.
    pub(super) fn axes_instruction(&mut self, scope: Scope, arguments: &'a Arguments, known: Instruction) {
        let bytes = self.bytes(scope.source as usize);
        let first = arguments.positional.first();
        let axes = self.state.modal.axes;
        match known {
            Instruction::AxisOffsetOff => self.state.modal.axes.offset = self.only_here(Some([0.0; EXTERNAL_AXES])),
            Instruction::AxisOffsetSet => {
                let set = first.and_then(|offset| self.evaluate(scope, offset).external());
                // 9E9 is no length.
                let set = set.filter(|offset| offset.iter().all(|v| *v < UNUSED_AXIS));
                self.state.modal.axes.offset = self.only_here(set);
            }
            Instruction::AxisOffsetOn => {
                let target = |this: &mut Self, target: &'a Expression| {
                    let value = this.evaluate(scope, target);
                    Some(this.as_target(&value)?.written.external.map(|v| (v < UNUSED_AXIS).then_some(v)))
                };
                let at = if arguments.has(bytes, b"ExeP") {
                    arguments.named(bytes, b"ExeP").and_then(|at| target(self, at))
                } else {
                    Some(axes.positions)
                };
                let programmed = first.and_then(|programmed| target(self, programmed));
                // An offset on top of an offset is not followed.
                let none = axes.offset == Some([0.0; EXTERNAL_AXES]);
                let offset = at.zip(programmed).filter(|_| none).and_then(|(at, programmed)| {
                    let mut offset = [0.0; EXTERNAL_AXES];
                    for (offset, pair) in offset.iter_mut().zip(at.iter().zip(programmed)) {
                        *offset = match pair {
                            (Some(at), Some(programmed)) => at - programmed,
                            (_, None) => 0.0,
                            (None, Some(_)) => return None,
                        };
                    }
                    Some(offset)
                });
                self.state.modal.axes.offset = self.only_here(offset);
            }
            Instruction::UnitOn | Instruction::UnitOff => {
                let name = first.and_then(|name| self.unit_name(scope, name));
                let inactive = axes.inactive.zip(name).map(|(inactive, name)| {
                    let others = self.units.inactive[inactive as usize].iter();
                    let others = others.filter(|unit| !unit.name.eq_ignore_ascii_case(&name)).cloned();
                    let others: Vec<InactiveUnit> = others.collect();
                    let own = (known == Instruction::UnitOff).then(|| InactiveUnit {
                        stands: self.units.inactive[inactive as usize]
                            .iter()
                            .find(|unit| unit.name.eq_ignore_ascii_case(&name))
                            .map_or(axes.positions, |already| already.stands),
                        name: Arc::clone(&name),
                    });
                    let units: Arc<[InactiveUnit]> = others.into_iter().chain(own).collect();
                    let known = self.units.inactive.iter().position(|known| *known == units);
                    let at = known.unwrap_or_else(|| {
                        self.units.inactive.push(units);
                        self.units.inactive.len() - 1
                    });
                    u32::try_from(at).unwrap_or(u32::MAX)
                });
                self.state.modal.axes.inactive = inactive.filter(|_| self.only_here(Some(())).is_some());
                self.counters.events += u64::from(self.state.modal.axes.inactive != Axes::default().inactive);
            }
            _ => {
                let value = first.map(|to| self.evaluate(scope, to));
                let external = value.map_or([f64::NAN; EXTERNAL_AXES], |value| value.joints_external());
                let plain = arguments.has(bytes, b"NoEOffs");
                self.axes_go_to(&external, plain);
                self.units.axes_moved |= self.is_real();
            }
        }
    }

    /// The state after an instruction; unknown if something else may change it at any moment.
    fn only_here<T>(&self, left: Option<T>) -> Option<T> {
        let others = self.others_set().common(LastingStates::AXES);
        left.filter(|_| others == LastingStates::default())
    }

    /// The name of a mechanical unit: data of the system, which no module declares.
    fn unit_name(&mut self, scope: Scope, argument: &Expression) -> Option<Arc<str>> {
        let name = &self.bytes(scope.source as usize)[argument.span.range()];
        let is_undeclared = argument.is_name() && self.find(scope, &Upper::new(name)).is_none();
        is_undeclared.then(|| decode(name).as_ref().into())
    }

    /// Sets the positions of the axes after a motion: 9E9 if not in use, NaN if unknown.
    pub(super) fn axes_go_to(&mut self, external: &External, without_offset: bool) {
        // Code that runs at any other moment may move them, too.
        let alone = self.mode == Mode::Real && self.symbols.known.unfollowed.is_empty();
        let offset = if without_offset { Some([0.0; EXTERNAL_AXES]) } else { self.state.modal.axes.offset };
        for axis in 0..EXTERNAL_AXES {
            let position = &mut self.state.modal.axes.positions[axis];
            if !alone || external[axis].is_nan() {
                *position = None;
            } else if external[axis] < UNUSED_AXIS {
                *position = offset.map(|offset| external[axis] + offset[axis]);
            }
        }
    }

    /// Why the positions of external axes are unknown; `None` if they are known.
    pub(super) fn axes_unknown(&self, external: &External) -> Option<Reason> {
        let Axes { offset, inactive, .. } = self.state.modal.axes;
        let in_use = axes_in_use(external);
        if external.iter().any(|v| v.is_nan()) {
            Some(Reason::ExternalAxesComputed)
        } else if in_use && offset.is_none() {
            Some(Reason::ExternalOffsetUnknown)
        } else if in_use && inactive.is_none() {
            Some(Reason::UnitsUnknown)
        } else {
            None
        }
    }

    /// External axes of a target, if they matter.
    pub(super) fn external_axes(
        &mut self,
        external: &External,
        role: Role,
        without_offset: bool,
    ) -> Option<Arc<ExternalAxes>> {
        let Axes { offset, inactive, .. } = self.state.modal.axes;
        let inactive = &self.units.inactive[inactive.unwrap_or(0) as usize];
        let moved_alone = self.units.axes_moved;
        // The segment of an arc begins before its circle point.
        self.units.axes_moved &= role == Role::Via;
        if !axes_in_use(external) && inactive.is_empty() && !moved_alone {
            return None;
        }
        let axes = ExternalAxes {
            written: written(external),
            offset: offset.filter(|_| !without_offset).unwrap_or_default(),
            inactive: Arc::clone(inactive),
            moved_alone,
            ..ExternalAxes::default()
        };
        // Mostly they are as before.
        if self.units.external.as_deref() != Some(&axes) {
            self.units.external = Some(Arc::new(axes));
        }
        self.units.external.clone()
    }
}
