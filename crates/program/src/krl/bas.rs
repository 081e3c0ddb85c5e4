//! KUKA's routine BAS, and the settings that `WITH` makes for one motion.

use super::calls::Argument;
use super::eval::VariablePath;
use super::expression::{Expression, Setting};
use super::names;
use super::run::Runner;
use super::state::Changes;
use super::symbols::{
    APPROXIMATION, BASE, CIRCLE_TYPE, Id, LOAD, MODAL, MODE, ORIENTATION, OVERRIDE, POSITION, SPEED, TOOL,
};
use super::value::{Selector, Value, upper};
use crate::Reason;
use deflex_text::{Diagnostic, Severity};

impl<'a> Runner<'a> {
    /// The value of a function of spline inline forms: `STOOL2(FP1)`, `SBASE(FP1.BASE_NO)`, `SVEL_CP(2.0, , LCPDAT1)`.
    pub(super) fn frame_function(&mut self, name: &[u8], first: Option<Value>) -> Value {
        let Some(value) = first else { return Value::unknown(Reason::Computed) };
        self.pin(&value);
        match name {
            b"STOOL2" | b"STOOL" => {
                self.report_frames_elsewhere(&value);
                let number = value.component(b"TOOL_NO").cloned().unwrap_or(value);
                self.table(b"TOOL_DATA", &number)
            }
            b"SBASE" => self.table(b"BASE_DATA", &value),
            b"SLOAD" => self.table(b"LOAD_DATA", &value),
            b"SORI_TYP" => value.part(b"ORI_TYP"),
            b"SCIRC_TYP" => value.part(b"CIRC_TYP"),
            b"SCIRC_M" => Value::unknown(Reason::Computed),
            b"SVEL_CP" => Value::record([(&b"CP"[..], value)]),
            _ => value,
        }
    }

    /// An element of the controller's tables; number 0 is the flange, or the world.
    pub(super) fn table(&mut self, table: &[u8], number: &Value) -> Value {
        let name = upper(table);
        let switches = match table {
            b"BASE_DATA" => &names::CORRECTIONS[0][..],
            b"TOOL_DATA" => &names::CORRECTIONS[1][..],
            _ => &[],
        };
        for switch in switches {
            let id = self.symbols.find(self.here(), &upper(switch));
            if self.is_volatile(id) || self.value(id).bool() != Some(false) {
                return Value::unknown(Reason::CorrectedFrame);
            }
        }
        let id = self.symbols.find(self.here(), &name);
        let (steps, known) = match number.index() {
            Some(0) => {
                let zero = self.symbols.find(self.here(), &upper(b"$NULLFRAME"));
                return if table == b"LOAD_DATA" { Value::unknown(Reason::Computed) } else { self.settled(zero) };
            }
            Some(at) => (vec![Selector::Element(at)], true),
            None => (Vec::new(), false),
        };
        self.read(&VariablePath { id, name: &name, steps, known })
    }

    /// The name of an element of such a table.
    pub(super) fn table_name(table: &str, number: &Value) -> Option<String> {
        match number.index()? {
            0 => Some("$NULLFRAME".to_owned()),
            at => Some(format!("{table}[{at}]")),
        }
    }

    /// Follows a call of BAS, the routine in KUKA's BAS.SRC.
    pub(super) fn bas(&mut self, arguments: &[Argument<'_>]) {
        let Some(Value::Constant(command)) = arguments.first().map(|a| a.value.clone()) else {
            return self.frames_unknown();
        };
        let number = arguments.get(1).map_or(Value::unknown(Reason::Computed), |a| a.value.clone());
        self.pin(&number);
        if !names::KEEPS_APPROXIMATION.contains(&&command[..]) {
            self.set(APPROXIMATION, b"CDIS", Value::unknown(Reason::Computed));
        }
        match &command[..] {
            b"BASE" => self.set_base(&number),
            b"TOOL" => self.set_tool(&number),
            b"VEL_CP" => self.set_speed(number),
            b"OV_PRO" => {
                self.state.values.insert(OVERRIDE, number);
            }
            b"FRAMES" | b"PTP_PARAMS" | b"PARAMS" => self.frames_of_act(),
            b"CP_PARAMS" => {
                self.frames_of_act();
                self.set_speed(number);
                self.orientation_of_act();
            }
            b"CP_DAT" => {
                let id = self.symbols.find(self.here(), &upper(b"LDAT_ACT"));
                let act = self.settled(id);
                self.set_speed(act.part(b"VEL"));
                let distance = act.part(b"APO_DIST");
                self.pin(&distance);
                self.set(APPROXIMATION, b"CDIS", distance);
                self.orientation_of_act();
            }
            b"INITMOV" => {
                for switch in names::CORRECTIONS.into_iter().flatten() {
                    let id = self.symbols.find(self.here(), &upper(switch));
                    self.state.values.insert(id, Value::Bool(false));
                }
                // Base and tool stay as they are only if the program has not set them before.
                for (id, own) in [(BASE, "$BASE"), (TOOL, "$TOOL")] {
                    if !matches!(self.value(id), Value::Own(name) if &*name == own) {
                        let value = Value::unknown(Reason::ByInitialisation);
                        self.state.values.insert(id, value);
                        self.name_frame(id, None);
                    }
                }
                self.leave_frame();
                self.set_speed(Value::unknown(Reason::Computed));
                self.state.values.insert(ORIENTATION, Value::constant(b"VAR"));
                self.state.values.insert(CIRCLE_TYPE, Value::constant(b"BASE"));
            }
            known if names::HARMLESS_COMMANDS.contains(&known) => {}
            _ => self.frames_unknown(),
        }
    }

    pub(super) fn frames_unknown(&mut self) {
        let ids = [BASE, TOOL, LOAD, SPEED, APPROXIMATION, MODE, ORIENTATION, CIRCLE_TYPE, POSITION];
        self.forget(&Changes { ids: ids.into(), ..Changes::default() }, Reason::ByBas);
    }

    pub(super) fn set_base(&mut self, number: &Value) {
        let value = self.table(b"BASE_DATA", number);
        self.state.values.insert(BASE, value);
        self.name_frame(BASE, Self::table_name("BASE_DATA", number));
    }

    pub(super) fn set_tool(&mut self, number: &Value) {
        let value = self.table(b"TOOL_DATA", number);
        let load = self.table(b"LOAD_DATA", number);
        self.state.values.insert(TOOL, value);
        self.state.values.insert(LOAD, load);
        self.name_frame(TOOL, Self::table_name("TOOL_DATA", number));
    }

    pub(super) fn set_speed(&mut self, value: Value) {
        self.set(SPEED, b"CP", value);
    }

    /// Sets a component of a record.
    fn set(&mut self, id: Id, component: &[u8], value: Value) {
        let mut record = self.value(id);
        self.put(&mut record, &[Selector::Component(upper(component))], value);
        self.state.values.insert(id, record);
    }

    /// `FDAT_ACT={TOOL_NO n,BASE_NO m,IPO_FRAME #BASE}` comes into force.
    pub(super) fn frames_of_act(&mut self) {
        let id = self.symbols.find(self.here(), &upper(b"FDAT_ACT"));
        let act = self.settled(id);
        self.report_frames_elsewhere(&act);
        self.set_tool(&act.part(b"TOOL_NO"));
        self.set_base(&act.part(b"BASE_NO"));
        self.state.values.insert(MODE, act.part(b"IPO_FRAME"));
    }

    /// Notes once that no file has the numbers of tool and base. Those of `FHOME`, for example, are in `$config.dat`.
    fn report_frames_elsewhere(&mut self, act: &Value) {
        let undeclared = matches!(act, Value::Unknown(why, None) if *why == Reason::NameUndeclared);
        if undeclared {
            let source = &self.symbols.sources[self.here()];
            let message = "the numbers of tool and base of an inline form (FDAT, mostly FHOME) are in none of the files: both are unknown until they are set again";
            let note = Diagnostic::error("krl.frames-elsewhere", &source.name, message).severity(Severity::Note);
            let help = "give $config.dat of the controller (KRC/R1/System) with --context";
            self.report(note.help(help), self.here(), None);
        }
    }

    /// `LDAT_ACT={… ORI_TYP #VAR,CIRC_TYP #BASE}` comes into force. If the program sets no `LDAT_ACT`, that of the controller has #VAR and
    /// #BASE. If the record lacks a component, BAS stops when it reads it.
    pub(super) fn orientation_of_act(&mut self) {
        let id = self.symbols.find(self.here(), &upper(b"LDAT_ACT"));
        let act = self.settled(id);
        let is_set = self.state.values.contains_key(&id) || self.is_volatile(id);
        for (to, part) in [(ORIENTATION, &b"ORI_TYP"[..]), (CIRCLE_TYPE, b"CIRC_TYP")] {
            let kind = match act {
                Value::Record(_) => act.component(part).cloned(),
                _ => is_set.then(|| Value::unknown(Reason::Computed)),
            };
            if let Some(kind) = kind {
                self.state.values.insert(to, kind);
            }
        }
    }

    /// Applies the settings of `WITH` for one motion. Returns the values before.
    pub(super) fn with(&mut self, settings: &[Setting]) -> [Value; MODAL] {
        let before = std::array::from_fn(|id| self.value(id));
        for Setting { to, value } in settings {
            let place = self.place(to);
            let name = match value {
                Expression::Call(call) if names::is_frame_function(&call.name) => {
                    let arguments = self.arguments(call);
                    arguments.first().and_then(|argument| match &call.name[..] {
                        b"SBASE" => Self::table_name("BASE_DATA", &argument.value),
                        b"STOOL2" | b"STOOL" => {
                            let number = argument.value.component(b"TOOL_NO").unwrap_or(&argument.value);
                            Self::table_name("TOOL_DATA", number)
                        }
                        _ => None,
                    })
                }
                value => self.label(value),
            };
            let value = self.expression(value);
            self.assign(&place, value, name);
        }
        before
    }

    /// Restores the settings that `WITH` has changed. The position stays that at the end of the motion.
    pub(super) fn restore(&mut self, before: &[Value; MODAL]) {
        if [BASE, TOOL].into_iter().any(|id| before[id] != self.value(id)) {
            self.leave_frame();
        }
        self.state.values.extend(before.iter().cloned().enumerate());
    }
}
