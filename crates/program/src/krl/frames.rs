//! Tools and bases that motions use.

use super::run::Runner;
use super::symbols::{BASE, BASE_NAME, Id, LOAD, TOOL, TOOL_NAME};
use super::value::Value;
use crate::{Reason, Tool, ToolData, Wobj, WobjData, intern};
use deflex_text::{Diagnostic, Severity};
use std::sync::Arc;

impl Runner<'_> {
    pub(super) fn name(&self, id: Id) -> Arc<str> {
        match self.value(id) {
            Value::Own(name) => (&*name).into(),
            _ => "?".into(),
        }
    }

    pub(super) fn tool_index(&mut self) -> Result<u16, Reason> {
        let value = self.value(TOOL);
        if self.is_volatile(TOOL) {
            return Err(Reason::ToolAnyMoment);
        }
        let tool = match &value {
            Value::Own(name) => Tool { name: (&**name).into(), data: None },
            Value::Record(_) => {
                let (tcp_mm, tcp_quat) = value.frame().ok_or(Reason::Tool)?;
                let load = self.value(LOAD);
                let mass = load.component(b"M").and_then(Value::number).filter(|mass| *mass >= 0.0);
                let cog = load.component(b"CM").and_then(|cm| cm.numbers([b"X", b"Y", b"Z"]));
                let data = ToolData {
                    robhold: true,
                    tcp_mm,
                    tcp_quat,
                    mass_kg: mass.unwrap_or(0.0),
                    cog_mm: cog.unwrap_or([0.0; 3]),
                };
                Tool { name: self.name(TOOL_NAME), data: Some(data) }
            }
            _ => return Err(Reason::Tool),
        };
        if !self.is_recording {
            return Ok(0);
        }
        let is_new = !self.tools.iter().any(|known| known.is(&tool));
        if is_new && tool.data.is_some_and(|data| data.mass_kg == 0.0) {
            let message = format!("the load of `{}` is in none of the files: it is taken as 0 kg", tool.name);
            let warning = Diagnostic::error("krl.no-load", &self.symbols.sources[self.here()].name, message);
            let help = "assign $LOAD, give $config.dat with --context, or name the tool by its number and declare it in the cell";
            self.diagnostics.push(warning.severity(Severity::Warning).help(help));
        }
        intern(&mut self.tools, &tool, Tool::is).ok_or(Reason::TooManyFrames)
    }

    pub(super) fn wobj_index(&mut self) -> Result<u16, Reason> {
        let value = self.value(BASE);
        if self.is_volatile(BASE) {
            return Err(Reason::BaseAnyMoment);
        }
        let wobj = match &value {
            Value::Own(name) => Wobj { name: (&**name).into(), data: None, unit: None },
            Value::Record(_) => {
                let (uframe_mm, uframe_quat) = value.frame().ok_or(Reason::Base)?;
                let data = WobjData { uframe_mm, uframe_quat, ..WobjData::WORLD };
                Wobj { name: self.name(BASE_NAME), data: Some(data), unit: None }
            }
            _ => return Err(Reason::Base),
        };
        if !self.is_recording {
            return Ok(0);
        }
        intern(&mut self.wobjs, &wobj, Wobj::is).ok_or(Reason::TooManyFrames)
    }
}
