//! Evaluates the tool, work object and speed arguments of a motion.

use super::eval::Scope;
use super::expression::{Arguments, Expression};
use super::runner::{Cached, Mode, Runner};
use super::symbols::Upper;
use super::value::MAX_NORM_ERROR;
use super::value::{Value, predefined};
use crate::{Reason, Tool, ToolData, Wobj, WobjData};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Diagnostic, Severity, Span, decode};
use std::collections::HashMap;
use std::sync::Arc;

pub(super) const MANY_FRAMES: &str = "the program has more than 65,536 tools or work objects";

impl<'a> Runner<'a> {
    pub(super) fn tool_index(&mut self, scope: Scope, argument: &'a Expression) -> Result<u16, Reason> {
        let place = SourceSpan { source: scope.source, span: argument.span };
        if self.fresh(self.used.last_tool, place) {
            return Ok(self.used.last_tool.index);
        }
        let (name, value, declared) = self.named(scope, argument);
        let data = value.tool();
        if declared && data.is_none() {
            self.report_frame(argument.span, "tool", &name, &value);
            return Err(Reason::Tool);
        }
        if data.is_some_and(|data| !is_unit(data.tcp_quat)) {
            return Err(Reason::NotUnit);
        }
        let numbers = data.map_or(Vec::new(), |d| {
            [&d.tcp_mm[..], &d.tcp_quat, &[d.mass_kg], &d.cog_mm, &[f64::from(u8::from(d.robhold))]].concat()
        });
        let key = frame_key(&name, &numbers);
        let data = data.map(ToolData::normalised);
        if !self.is_recording {
            return Ok(0);
        }
        let index = number(&mut self.used.tools, &mut self.used.tool_numbers, key, self.mode, Tool { name, data })?;
        let Some(index) = index else {
            self.refuse(scope.source, argument.span, "rapid.frames", MANY_FRAMES, "split the program");
            return Err(Reason::TooManyFrames);
        };
        self.used.last_tool = self.cached(Some(argument), place, index);
        Ok(index)
    }

    pub(super) fn wobj_index(&mut self, scope: Scope, argument: Option<&'a Expression>) -> Result<u16, Reason> {
        // No argument: the same empty place whatever the instruction.
        let span = argument.map_or(Span::default(), |argument| argument.span);
        let place = SourceSpan { source: scope.source, span };
        if self.fresh(self.used.last_wobj, place) {
            return Ok(self.used.last_wobj.index);
        }
        let wobj0 = || ("wobj0".into(), predefined(b"WOBJ0").unwrap_or(Value::Unknown(Reason::Computed)), true);
        let (name, value, declared) = match argument {
            Some(argument) => match self.named(scope, argument) {
                (_, Value::Unknown(Reason::OptionalArgumentMissing), _) => wobj0(),
                named => named,
            },
            None => wobj0(),
        };
        let data = value.wobj();
        if let Some(argument) = argument.filter(|_| declared && data.is_none()) {
            self.report_frame(argument.span, "work object", &name, &value);
            return Err(Reason::WorkObject);
        }
        if data.as_ref().is_some_and(|data| !is_unit(data.uframe_quat) || !is_unit(data.oframe_quat)) {
            return Err(Reason::NotUnit);
        }
        let numbers = data.map_or(Vec::new(), |d| {
            let flags = [f64::from(u8::from(d.robhold)), f64::from(u8::from(d.fixed))];
            [&d.uframe_mm[..], &d.uframe_quat, &d.oframe_mm, &d.oframe_quat, &flags].concat()
        });
        let mechanical_unit: Option<Arc<str>> = value.wobj_unit().map(|unit| decode(unit).as_ref().into());
        let mut key = frame_key(&name, &numbers);
        key.extend_from_slice(mechanical_unit.as_deref().unwrap_or("").as_bytes());
        let data = data.map(WobjData::normalised);
        if !self.is_recording {
            return Ok(0);
        }
        let index = number(
            &mut self.used.wobjs,
            &mut self.used.wobj_numbers,
            key,
            self.mode,
            Wobj { name, data, unit: mechanical_unit },
        )?;
        let Some(index) = index else {
            self.refuse(scope.source, span, "rapid.frames", MANY_FRAMES, "split the program");
            return Err(Reason::TooManyFrames);
        };
        self.used.last_wobj = self.cached(argument, place, index);
        Ok(index)
    }

    /// The cached value of an argument: a plain name keeps its meaning until something is assigned or called.
    fn cached(&self, argument: Option<&Expression>, place: SourceSpan, index: u16) -> Cached {
        let is_plain = argument.is_none_or(Expression::is_name);
        Cached { place: Some(place).filter(|_| is_plain), version: self.state.version, index }
    }

    /// Warns why a frame is unknown, once for each place.
    pub(super) fn report_frame(&mut self, argument: Span, what: &str, name: &str, value: &Value) {
        let why = value.unknown().unwrap_or(Reason::NotANumberList);
        let message = format!("{what} `{name}` is known only at run time here: {why}");
        let place = (usize::from(self.scope().source), argument, "rapid.frame");
        if !self.is_real() || !self.messages.reported.insert(place) {
            return;
        }
        let note = Diagnostic::error("rapid.frame", "", message).at(&self.symbols.sources[place.0], argument);
        let note = note.severity(Severity::Note);
        // The cell states only what the program does not assign.
        let help = "give the module that declares it with --context: the program assigns it, so that its value in the cell does not count";
        self.messages.diagnostics.push(if why == Reason::NameUndeclared { note.help(help) } else { note });
    }

    /// Whether an argument reads like the last one, and nothing was assigned or called in between.
    pub(super) fn fresh(&self, cached: Cached, place: SourceSpan) -> bool {
        cached.version == self.state.version
            && cached.place.is_some_and(|last| {
                let text = |p: SourceSpan| &self.bytes(p.source as usize)[p.span.range()];
                last.source == place.source && text(last) == text(place)
            })
    }

    /// Tool or work object: its declared name, also through parameters, its value, and whether the program declares the value; if not, the cell
    /// may.
    fn named(&mut self, scope: Scope, argument: &'a Expression) -> (Arc<str>, Value, bool) {
        let text = &self.bytes(scope.source as usize)[argument.span.range()];
        if !argument.is_name() {
            return (decode(text).as_ref().into(), self.evaluate(scope, argument), true);
        }
        let key = Upper::new(text);
        if let Some(at) = self.find(scope, &key) {
            let variable = &self.symbols.variables[at];
            let (name, foreign) = (Arc::clone(&variable.name), variable.foreign);
            self.uses_frame(at);
            let assigned = foreign && self.symbols.foreign_assigned.contains(&*Upper::new(name.as_bytes()));
            return (name, self.content(at), !foreign || assigned);
        }
        let known = predefined(&key);
        let declared = known.is_some() || self.symbols.foreign_assigned.contains(&*key);
        let value = known.unwrap_or(Value::Unknown(Reason::NameUndeclared));
        (decode(text).as_ref().into(), value, declared)
    }

    /// TCP speed of a motion, mm/s, whose positional argument `speed` is its speed.
    pub(super) fn speed(&mut self, scope: Scope, arguments: &'a Arguments, speed: usize) -> Option<f64> {
        let bytes = self.bytes(scope.source as usize);
        if arguments.has(bytes, b"T") {
            return None;
        }
        let programmed = if arguments.has(bytes, b"V") {
            self.evaluate(scope, arguments.named(bytes, b"V")?).num()
        } else {
            self.speeddata(scope, arguments.positional.get(speed)?)
        };
        programmed.zip(self.state.modal.velocity).map(|(programmed, velocity)| velocity.of(programmed))
    }

    /// The TCP speed of a speeddata, mm/s.
    fn speeddata(&mut self, scope: Scope, argument: &'a Expression) -> Option<f64> {
        let place = SourceSpan { source: scope.source, span: argument.span };
        if !self.fresh(self.used.last_speed.0, place) {
            let value = self.evaluate(scope, argument);
            let speed = value.list().and_then(|items| items.first()?.num()).filter(|v| *v > 0.0);
            self.used.last_speed = (self.cached(Some(argument), place, 0), speed);
        }
        self.used.last_speed.1
    }
}

/// Whether a quaternion has unit length, except for printed digits.
pub(super) fn is_unit(quat: [f64; 4]) -> bool {
    let norm = quat.iter().map(|c| c * c).sum::<f64>();
    (norm - 1.0).abs() <= MAX_NORM_ERROR
}

/// A tool or work object as a key: its name in upper case, and its numbers.
pub(super) fn frame_key(name: &str, numbers: &[f64]) -> Vec<u8> {
    let mut key = name.to_ascii_uppercase().into_bytes();
    key.push(0);
    numbers.iter().for_each(|number| key.extend_from_slice(&number.to_bits().to_le_bytes()));
    key
}

/// The number of a frame, which gets one if it has none and there are numbers left.
pub(super) fn number<T>(
    all: &mut Vec<T>,
    numbers: &mut HashMap<Vec<u8>, u16>,
    key: Vec<u8>,
    mode: Mode,
    one: T,
) -> Result<Option<u16>, Reason> {
    if let Some(known) = numbers.get(&key) {
        return Ok(Some(*known));
    }
    if mode != Mode::Real {
        return Err(Reason::NotAFrame);
    }
    let Ok(number) = u16::try_from(all.len()) else { return Ok(None) };
    all.push(one);
    numbers.insert(key, number);
    Ok(Some(number))
}
