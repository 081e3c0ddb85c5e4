//! Predefined instructions that are not motions: the data they change, the state they switch, the values that become unknown.

use super::eval::Scope;
use super::expression::{Arguments, Call, Expression, ExpressionKind};
use super::lasting::LastingStates;
use super::predefined::{self, Instruction};
use super::runner::Runner;
use super::state::{ArcMode, OnOff, Velocity};
use super::symbols::Upper;
use super::value::Value;
use crate::{ArcTurn, Reason};
use deflex_lang::walk::Stop;
use deflex_text::Span;

impl<'a> Runner<'a> {
    /// A predefined instruction that does not move to a robtarget.
    pub(super) fn instruction(
        &mut self,
        scope: Scope,
        call: &'a Call,
        known: Instruction,
        span: Span,
    ) -> Result<(), Stop> {
        let (bytes, arguments) = (self.bytes(scope.source as usize), &call.arguments);
        // A robtarget used here must not be edited; its numbers count as used.
        self.is_shown = self.only_shows(scope.module, call, bytes);
        for argument in arguments.given() {
            let value = self.evaluate(scope, argument);
            self.numbers.pin_value(&value);
        }
        self.is_shown = false;
        if known == Instruction::Waits
            && let Some(condition) = arguments.positional.first()
            && self.evaluate(scope, condition).bool() != Some(true)
        {
            self.wait_for(scope, condition);
        }
        let only_options = matches!(known, Instruction::Options | Instruction::Waits);
        if known == Instruction::Nothing || only_options && arguments.optional.is_empty() {
            return Ok(());
        }
        // The head of a program, which every chunk repeats, may set speeds, loads, turns on arcs and `ConfJ`, and activate units.
        let in_head = matches!(
            known,
            Instruction::Velocity
                | Instruction::Load
                | Instruction::ArcMode
                | Instruction::Configuration
                | Instruction::UnitOn
        );
        self.counters.events += u64::from(!in_head);
        known.lasting().into_iter().for_each(|state| self.state.modal.as_begun.remove(state));
        match known {
            Instruction::Nothing => {}
            Instruction::Arguments => {
                if bytes[call.name.range()].eq_ignore_ascii_case(b"GetDataVal") {
                    // The instruction reads data by their name.
                    let named = match arguments.positional.first().map(|name| self.evaluate(scope, name)) {
                        Some(Value::Text(name)) => self.symbols.all_named(Some(&name)),
                        _ => self.symbols.all_named(None),
                    };
                    named.into_iter().for_each(|at| self.pin_read(at));
                }
                for argument in arguments.given() {
                    self.forget_argument(scope, argument, Reason::Computed);
                }
            }
            Instruction::Options | Instruction::Waits => {
                for argument in arguments.optional_values() {
                    self.forget_argument(scope, argument, Reason::Computed);
                }
            }
            Instruction::Steps => self.step_variable(scope, arguments, &Upper::new(&bytes[call.name.range()])),
            Instruction::DisplacementOn => {
                if bytes[call.name.range()].eq_ignore_ascii_case(b"PDispOn") && !arguments.has(bytes, b"ExeP") {
                    self.hold_where_it_stands();
                }
                self.state.modal.displacement = OnOff::On;
                self.state.modal.lose(self.others_set());
            }
            Instruction::DisplacementOff => {
                self.state.modal.displacement = OnOff::Off;
                self.state.modal.lose(self.others_set());
            }
            Instruction::SoftOn | Instruction::SoftOff => {
                self.state.modal.soft = if known == Instruction::SoftOn { OnOff::On } else { OnOff::Off };
                self.state.modal.lose(self.others_set());
            }
            Instruction::Load => {
                let none = arguments.positional.first().is_some_and(|load| self.is_no_load(scope, load));
                self.state.modal.load = if none { OnOff::Off } else { OnOff::On };
                self.state.modal.lose(self.others_set());
            }
            Instruction::Velocity => {
                self.state.modal.velocity = self.velocity(scope, arguments);
                self.state.modal.lose(self.others_set());
            }
            Instruction::ArcMode => {
                self.state.modal.arcs = arc_mode(bytes, arguments);
                self.state.modal.lose(self.others_set());
            }
            Instruction::Configuration => {
                self.state.modal.nearest = if arguments.has(bytes, b"Off") { OnOff::On } else { OnOff::Off };
                self.state.modal.lose(self.others_set());
            }
            Instruction::AxisOffsetSet
            | Instruction::AxisOffsetOn
            | Instruction::AxisOffsetOff
            | Instruction::UnitOn
            | Instruction::UnitOff => self.axes_instruction(scope, arguments, known),
            Instruction::MovesAxes => {
                self.axes_instruction(scope, arguments, known);
                self.keep_here(span, Reason::ExternalAxesOnly);
            }
            Instruction::DataByName => {
                let named = match arguments.positional.first().map(|name| self.evaluate(scope, name)) {
                    Some(Value::Text(name)) if bytes[call.name.range()].eq_ignore_ascii_case(b"SetDataVal") => {
                        self.symbols.data_named(Some(&name))
                    }
                    _ => self.symbols.data_named(None),
                };
                named.into_iter().for_each(|at| self.forget_data(at, Reason::Computed));
            }
            Instruction::Moves => {
                self.state.lose_place();
                self.keep_here(span, Reason::ExternalAxesOnly);
            }
            Instruction::ClearsPath => self.state.lose_place(),
            Instruction::Ends => {
                self.ends_cycle();
                return Err(Stop::Ends);
            }
            Instruction::Raises if self.raise() => {}
            Instruction::Raises => return Err(Stop::Ends),
        }
        Ok(())
    }

    /// Whether a call only shows values, which no routine computes, to people.
    pub(super) fn only_shows(&self, module: usize, call: &Call, bytes: &[u8]) -> bool {
        let name = |call: &Call| &bytes[call.name.range()];
        let is_predefined = |call: &Call| self.symbols.find_routine(module, name(call)).is_none();
        let mut is_plain = true;
        call.each(&mut |part: &Expression| match &part.kind {
            ExpressionKind::Call(function) => {
                let changes_nothing =
                    predefined::function(&Upper::new(name(function))) == Some(predefined::Function::Nothing);
                is_plain &= is_predefined(function) && changes_nothing && !function.arguments.is_cut;
            }
            ExpressionKind::Unknown(..) => is_plain = false,
            _ => {}
        });
        is_plain && call.late.is_none() && is_predefined(call) && predefined::shows(name(call))
    }

    /// An instruction measures from the robot's present position, so the target there must not be edited.
    pub(super) fn hold_where_it_stands(&mut self) {
        if self.is_recording {
            self.found.counted_from.extend(&self.state.standing);
        }
        self.state.standing.clear();
    }

    /// The states that traps and handlers may change at any moment.
    pub(super) fn others_set(&self) -> LastingStates {
        self.symbols.known.at_any_moment.states.without(LastingStates::MARK)
    }

    /// The factor and limit on programmed speeds after `VelSet`; `None` if its numbers are unknown, and after `SpeedRefresh`.
    fn velocity(&mut self, scope: Scope, arguments: &'a Arguments) -> Option<Velocity> {
        let [percent, most] = &arguments.positional[..] else { return None };
        let [percent, most_mm_s] = [percent, most].map(|argument| self.evaluate(scope, argument).num());
        Some(Velocity { share: percent? / 100.0, most_mm_s: most_mm_s? })
    }

    /// Whether a load is `load0`: no load in addition to that in the tool's data.
    pub(super) fn is_no_load(&self, scope: Scope, load: &Expression) -> bool {
        self.bytes(scope.source as usize)[load.span.range()].eq_ignore_ascii_case(b"load0")
    }
}

/// How the tool turns on arcs after `CirPathMode`, which has one of these options.
fn arc_mode(bytes: &[u8], arguments: &Arguments) -> ArcMode {
    let modes: [(&[u8], ArcMode); 6] = [
        (b"PathFrame", ArcMode::Stated(ArcTurn::WithPath)),
        (b"ObjectFrame", ArcMode::Stated(ArcTurn::Even)),
        (b"CirPointOri", ArcMode::Stated(ArcTurn::ThroughCirclePoint)),
        (b"Wrist45", ArcMode::ByWrist),
        (b"Wrist46", ArcMode::ByWrist),
        (b"Wrist56", ArcMode::ByWrist),
    ];
    let stated = modes.into_iter().find(|(option, _)| arguments.has(bytes, option));
    stated.map_or(ArcMode::Unknown, |(_, mode)| mode)
}
