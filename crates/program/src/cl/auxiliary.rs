//! Statements for tool, spindle, coolant, stops and dwells.

use super::lex::{Record, TokenKind};
use super::reader::Reader;
use super::refusal::Outcome;
use super::statement::Statement;
use crate::{ActionKind, CutterInfo, Reason};
use std::sync::Arc;

/// Cutters that differ by less than this are equal, mm: printed digits.
const SAME_MM: f64 = 1e-3;

impl Reader {
    /// `LOADTL/n[,…]`, `LOAD/TOOL,n[,…]`, `TOOLNO/n[,…]`, `TURRET/n`.
    pub(super) fn load_tool(&mut self, record: Record, s: &Statement) -> Outcome {
        let is_id = |kind| matches!(kind, TokenKind::Number | TokenKind::Text);
        let tool = |word: &[u8]| word.eq_ignore_ascii_case(b"TOOL");
        let first =
            s.items.iter().find(|t| is_id(t.kind) || t.kind == TokenKind::Word && !tool(&s.bytes[t.span.range()]));
        let number = first.filter(|t| is_id(t.kind)).map(|t| id(&s.bytes[t.span.range()], t.value, t.kind));
        let number: Arc<str> = number.ok_or(Reason::NoToolNumber)?.into();
        if self.machine.number.as_ref() != Some(&number) {
            self.machine.number = Some(number.clone());
            self.machine.named = Some(record);
            self.machine.wait(ActionKind::ToolChange { number }, record);
        }
        Ok(())
    }

    /// `TOOL PATH/operation,TOOL,name`: an operation names its tool.
    pub(super) fn tool_path(&mut self, record: Record, s: &Statement) {
        let tool = s
            .items
            .iter()
            .rposition(|t| t.kind == TokenKind::Word && s.bytes[t.span.range()].eq_ignore_ascii_case(b"TOOL"));
        let after = tool.map(|at| &s.items[at + 1..]).unwrap_or_default();
        let (Some(first), Some(last)) =
            (after.iter().find(|t| t.kind != TokenKind::Comma), after.iter().rfind(|t| t.kind != TokenKind::Comma))
        else {
            return;
        };
        let name = String::from_utf8_lossy(&s.bytes[first.span.start as usize..last.span.end as usize]);
        let name: Arc<str> = name.trim_matches(['\'', '"']).into();
        if self.machine.name.as_ref() != Some(&name) {
            // The number belongs to the tool before.
            self.machine.number = self.machine.number.take().filter(|_| self.machine.name.is_none());
            self.machine.name = Some(name);
            self.machine.named = Some(record);
        }
    }

    pub(super) fn set_cutter(&mut self, record: Record, cutter: CutterInfo) {
        self.modal.cutter = Some(cutter);
        self.machine.cutter_named = Some(record);
    }

    /// Applies tool, cutter and waiting actions before a target is added that needs them.
    pub(super) fn take_in_hand(&mut self, at: Record) {
        let changed = match self.machine.named.take() {
            Some(record) => self.change_tool(record).unwrap_or_else(|why| {
                self.refuse(record, why);
                true
            }),
            None => false,
        };
        let machine = &mut self.machine;
        if let Some(record) = machine.cutter_named.take() {
            let same = |a: &CutterInfo, b: &CutterInfo| {
                (a.diameter_mm - b.diameter_mm).abs() < SAME_MM
                    && (a.corner_radius_mm - b.corner_radius_mm).abs() < SAME_MM
            };
            let other = machine.used_cutter.zip(self.modal.cutter).is_some_and(|(used, now)| !same(&used, &now));
            machine.used_cutter = self.modal.cutter;
            if other && !changed && !self.options.any_tool {
                self.refuse(record, Reason::SecondCutter);
            }
        }
        self.machine.used.get_or_insert_default();
        if self.machine.index.is_none() {
            match self.options.tool.clone() {
                Some(tool) => self.hold(&tool),
                None => {
                    self.refuse(at, Reason::NoTool);
                    self.hold("tool0")
                }
            };
        }
        self.machine.end(self.targets.len(), &mut self.actions);
    }

    /// Finds the cell's tool. Returns whether it differs from that at the last position.
    fn change_tool(&mut self, record: Record) -> Result<bool, Reason> {
        let ids = [self.machine.number.clone(), self.machine.name.clone()];
        let mapped = ids.iter().flatten().find_map(|id| Some((id.clone(), self.options.tool_of(id)?.to_owned())));
        let now = ids.into_iter().flatten().next();
        let before = self.machine.used.replace(now.clone());
        let changed = before.as_ref().is_some_and(|before| *before != now);
        // The first number names the tool that was mounted from the start.
        let second = before.flatten().is_some_and(|before| Some(before) != now);
        let (id, tool) = match mapped {
            _ if self.options.any_tool => return Ok(changed),
            Some(mapped) => mapped,
            // The cell has one tool, which stands for one tool of the program.
            None if self.options.tools.is_empty() && second => return Err(Reason::SecondTool),
            None if self.options.tools.is_empty() => return Ok(false),
            None if self.machine.number.is_some() || changed => return Err(Reason::UnmappedTool),
            None => return Ok(false),
        };
        let other = self.hold(&tool);
        let changes = self.machine.waiting.iter().any(|(kind, _)| matches!(kind, ActionKind::ToolChange { .. }));
        if other && !changes {
            self.machine.wait(ActionKind::ToolChange { number: id }, record);
        }
        Ok(changed)
    }

    /// Changes to a tool of the cell. Returns whether another one was mounted.
    fn hold(&mut self, tool: &str) -> bool {
        let machine = &mut self.machine;
        let known = machine.tools.iter().position(|known| known.eq_ignore_ascii_case(tool));
        let index = known.unwrap_or_else(|| {
            machine.tools.push(tool.to_owned());
            machine.tools.len() - 1
        });
        let index = u16::try_from(index).unwrap_or(u16::MAX);
        machine.index.replace(index).is_some_and(|before| before != index)
    }

    pub(super) fn spindle(&mut self, record: Record, s: &Statement) {
        if s.has(b"LOCK") || s.has(b"ORIENT") || s.has(b"NEUTRL") {
            return self.list(record, Reason::SpindlePositionUnwritten);
        }
        self.modal.read_spindle(s);
        let clockwise = !(s.has(b"CCLW") || s.has(b"CCW"));
        let kind = match self.modal.spins() {
            true => ActionKind::SpindleOn { rpm: self.modal.rpm(), clockwise },
            false => ActionKind::SpindleOff,
        };
        self.machine.wait(kind, record);
    }

    pub(super) fn coolant(&mut self, record: Record, s: &Statement) {
        let kind = s.words().next().map_or_else(|| "ON".into(), String::from_utf8_lossy).to_ascii_uppercase();
        let kind = match kind.as_str() {
            "OFF" => ActionKind::CoolantOff,
            _ => ActionKind::CoolantOn { kind: kind.into() },
        };
        self.machine.wait(kind, record);
    }

    /// `DELAY/s`, `DELAY/s,SEC`, `DELAY/n,REV`.
    pub(super) fn delay(&mut self, record: Record, s: &Statement) -> Outcome {
        let Some(time) = s.number_items().iter().next().map(|t| t.value).filter(|t| *t >= 0.0) else {
            return Err(Reason::DelayWithoutTime);
        };
        let unit = s.words().next().map(<[u8]>::to_ascii_uppercase);
        let seconds = match unit.as_deref() {
            Some(b"REV") => 60.0 * time / self.modal.rpm().ok_or(Reason::DelayWithoutSpindle)?,
            None | Some(b"SEC" | b"SECOND" | b"SECONDS") => time,
            Some(_) => return Err(Reason::DelayUnit),
        };
        self.machine.dwell(seconds, record);
        Ok(())
    }

    /// Corner radius of the mounted tool, mm.
    pub(super) fn corner_radius_mm(&self) -> f64 {
        let tool = self.machine.tools.get(usize::from(self.machine.tool()));
        self.options.corner_radius_of(tool.map_or("", String::as_str))
    }

    /// `GOHOME` without numbers: a position that only the machine knows.
    pub(super) fn home(&mut self, record: Record) {
        self.modal.position = None;
        self.modal.rapid = false;
        self.machine.wait(ActionKind::Home, record);
    }
}

/// A tool's number or name as the cell maps it: `2` for `2`, `2.` and `2.000`.
fn id(text: &[u8], value: f64, kind: TokenKind) -> String {
    if kind == TokenKind::Number && value.fract().abs() <= 0.0 && value.abs() < 1e9 {
        return format!("{value:.0}");
    }
    String::from_utf8_lossy(text).trim_matches(['\'', '"']).trim().to_owned()
}
