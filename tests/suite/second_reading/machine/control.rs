//! Statements: branches, loops, jumps, errors and interrupts.

use super::super::tree::{Block, Expr, Kind, Stmt};
use super::super::value::Val;
use super::{Binding, Flow, Interrupt, Machine, Ran, Stop, Storage};

impl Machine<'_> {
    pub(super) fn block(&mut self, block: &Block) -> Ran<Flow> {
        let mut i = 0;
        while let Some(statement) = block.get(i) {
            match self.statement(statement)? {
                Flow::Next => i += 1,
                Flow::Goto(label) => {
                    let at = block.iter().position(|s| matches!(&s.kind, Kind::Label(l) if *l == label));
                    match at {
                        Some(at) => i = at,
                        None => return Ok(Flow::Goto(label)),
                    }
                }
                other => return Ok(other),
            }
        }
        Ok(Flow::Next)
    }

    /// One statement, with the routine's handler around it, and the interrupts after it.
    pub(super) fn statement(&mut self, statement: &Stmt) -> Ran<Flow> {
        loop {
            self.steps += 1;
            if self.steps > self.limit {
                // Somebody stops what has no end.
                return Err(Stop::End);
            }
            match self.bare(statement) {
                Err(Stop::Raise(n)) => match self.handle(n)? {
                    Flow::Retry => {}
                    Flow::TryNext => return Ok(Flow::Next),
                    other => return Ok(other),
                },
                Ok(flow) => {
                    self.interrupt()?;
                    return Ok(flow);
                }
                other => return other,
            }
        }
    }

    /// The routine's handler; without one, or at its end, the error goes up.
    pub(super) fn handle(&mut self, n: i32) -> Ran<Flow> {
        let Some(call) = self.calls.last_mut() else { return Err(Stop::Up(n)) };
        let Some((numbers, block)) = call.handler.clone() else { return Err(Stop::Up(n)) };
        if call.error.is_some() {
            return Err(Stop::Up(n));
        }
        if !numbers.is_empty() {
            let mut listed = false;
            for number in &numbers {
                listed |= self.eval(number, "NUM")?.num()? as i32 == n;
            }
            if !listed {
                return Err(Stop::Up(n));
            }
        }
        if let Some(call) = self.calls.last_mut() {
            call.error = Some(n);
        }
        let flow = self.block(&block);
        if let Some(call) = self.calls.last_mut() {
            call.error = None;
        }
        match flow {
            Ok(Flow::Next) => Err(Stop::Up(n)),
            Err(Stop::Raise(m)) => Err(Stop::Up(m)),
            other => other,
        }
    }

    /// The error that a handler deals with.
    pub fn error(&self) -> i32 {
        self.calls.iter().rev().find_map(|call| call.error).unwrap_or(0)
    }

    pub(super) fn interrupt(&mut self) -> Ran<()> {
        if self.in_trap {
            return Ok(());
        }
        let ordered: Vec<String> = self.interrupts.iter().filter(|i| i.ordered).map(|i| i.trap.clone()).collect();
        for trap in ordered {
            if self.oracle.one_in(3) {
                let (module, routine) = self.here(&trap).ok_or_else(|| format!("no trap {trap}"))?;
                self.in_trap = true;
                let done = self.call(module, &routine, &[]);
                self.in_trap = false;
                done?;
            }
        }
        Ok(())
    }

    pub(super) fn bare(&mut self, statement: &Stmt) -> Ran<Flow> {
        match &statement.kind {
            Kind::Assign(data, expr) => {
                let place = self.place(data)?.ok_or_else(|| format!("{} is not declared", data.name))?;
                let value = self.eval(expr, &place.ty)?;
                self.write(&place, value)?;
            }
            Kind::Call(name, args) => self.instruction(name, args, statement.line)?,
            Kind::Late(name, args) => {
                let name = self.eval(name, "STRING")?.str()?.to_uppercase();
                match self.here(&name) {
                    Some((module, routine)) => {
                        self.call(module, &routine, args)?;
                    }
                    None => self.instruction(&name, args, statement.line)?,
                }
            }
            Kind::If(branches, other) => {
                for (condition, block) in branches {
                    if self.eval(condition, "BOOL")?.bool()? {
                        return self.block(block);
                    }
                }
                return self.block(other);
            }
            Kind::For { name, from, to, step, body } => {
                return self.count(name, from, to, step.as_ref(), body);
            }
            Kind::While(condition, body) => {
                while self.eval(condition, "BOOL")?.bool()? {
                    self.steps += 1;
                    if self.steps > self.limit {
                        return Err(Stop::End);
                    }
                    match self.block(body)? {
                        Flow::Next => {}
                        other => return Ok(other),
                    }
                }
            }
            Kind::Test(value, cases, default) => {
                let value = self.eval(value, "NUM")?;
                for (options, block) in cases {
                    for option in options {
                        if self.eval(option, "NUM")? == value {
                            return self.block(block);
                        }
                    }
                }
                return self.block(default);
            }
            Kind::Label(_) => {}
            Kind::Goto(label) => return Ok(Flow::Goto(label.clone())),
            Kind::Return(value) => {
                let value = value.as_ref().map(|value| self.eval(value, "")).transpose()?;
                return Ok(Flow::Return(value));
            }
            Kind::Raise(Some(number)) => {
                let n = self.eval(number, "NUM")?.num()? as i32;
                return Err(Stop::Raise(n));
            }
            Kind::Raise(None) => return Err(Stop::Up(self.error())),
            Kind::Retry => return Ok(Flow::Retry),
            Kind::TryNext => return Ok(Flow::TryNext),
            Kind::Exit => return Err(Stop::End),
            Kind::Connect(data, trap) => {
                let number = 1.0 + self.interrupts.len() as f64;
                let place = self.place(data)?.ok_or_else(|| format!("{} is not declared", data.name))?;
                self.write(&place, Val::Num(number))?;
                self.interrupts.push(Interrupt { number, trap: trap.clone(), ordered: false });
            }
        }
        Ok(Flow::Next)
    }

    pub(super) fn count(&mut self, name: &str, from: &Expr, to: &Expr, step: Option<&Expr>, body: &Block) -> Ran<Flow> {
        let (from, to) = (self.eval(from, "NUM")?.num()?, self.eval(to, "NUM")?.num()?);
        let step = match step {
            Some(step) => self.eval(step, "NUM")?.num()?,
            None if from > to => -1.0,
            None => 1.0,
        };
        if step == 0.0 {
            return Err(Stop::Broken("step 0".into()));
        }
        let mut i = from;
        while if step > 0.0 { i <= to } else { i >= to } {
            self.steps += 1;
            let depth = self.calls.last().map_or(0, |call| call.names.len());
            let place = self.fresh(name, "NUM", 0, Storage::Const, Val::Num(i));
            self.name(name, Binding::Data(place));
            let flow = self.block(body);
            if let Some(call) = self.calls.last_mut() {
                call.names.truncate(depth);
            }
            match flow? {
                Flow::Next => {}
                other => return Ok(other),
            }
            i += step;
        }
        Ok(Flow::Next)
    }
}
