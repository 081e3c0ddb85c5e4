//! What expressions are worth on a controller.

use super::machine::{Machine, Place};
use super::syntax::Tok;
use super::value::{Step, Val, chained};
use std::collections::BTreeMap;

type Done<T> = Result<T, String>;

impl Machine<'_> {
    fn mark(&mut self, toks: &[Tok], marks: &[&str]) -> Option<String> {
        let found = match toks.get(self.at) {
            Some(Tok::Mark(m) | Tok::Word(m)) if marks.contains(&&**m) => Some(m.clone()),
            _ => None,
        };
        self.at += usize::from(found.is_some());
        found
    }

    /// Operators from the loosest on (KUKA, Operating and Programming Instructions, priority of operators).
    pub(super) fn expression(&mut self, toks: &[Tok]) -> Done<Val> {
        let mut value = self.level(toks, 0)?;
        while let Some(operator) = self.mark(toks, &["==", "<>", "<", ">", "<=", ">="]) {
            let other = self.level(toks, 0)?;
            let holds = match &*operator {
                "==" => value == other,
                "<>" => value != other,
                "<" => value.num()? < other.num()?,
                ">" => value.num()? > other.num()?,
                "<=" => value.num()? <= other.num()?,
                _ => value.num()? >= other.num()?,
            };
            value = Val::Bool(holds);
        }
        Ok(value)
    }

    fn level(&mut self, toks: &[Tok], level: usize) -> Done<Val> {
        const LEVELS: [&[&str]; 6] = [&["OR"], &["EXOR"], &["AND"], &["+", "-"], &["*", "/"], &[":"]];
        let Some(operators) = LEVELS.get(level) else { return self.unary(toks) };
        let mut value = self.level(toks, level + 1)?;
        while let Some(operator) = self.mark(toks, operators) {
            let other = self.level(toks, level + 1)?;
            value = match &*operator {
                "OR" => Val::Bool(value.bool()? | other.bool()?),
                "EXOR" => Val::Bool(value.bool()? ^ other.bool()?),
                "AND" => Val::Bool(value.bool()? & other.bool()?),
                "+" => Val::Num(value.num()? + other.num()?),
                "-" => Val::Num(value.num()? - other.num()?),
                "*" => Val::Num(value.num()? * other.num()?),
                "/" => Val::Num(value.num()? / other.num()?),
                _ => {
                    let Val::Rec(mut parts) = Val::of_six(chained(value.six()?, other.six()?)) else { unreachable!() };
                    for (name, v) in other.rec()? {
                        parts.entry(name.clone()).or_insert(v.clone());
                    }
                    Val::Rec(parts)
                }
            };
        }
        Ok(value)
    }

    fn unary(&mut self, toks: &[Tok]) -> Done<Val> {
        if self.mark(toks, &["-"]).is_some() {
            return Ok(Val::Num(-self.unary(toks)?.num()?));
        }
        if self.mark(toks, &["NOT"]).is_some() {
            return Ok(Val::Bool(!self.unary(toks)?.bool()?));
        }
        let tok = toks.get(self.at).cloned().ok_or("nothing to read")?;
        self.at += 1;
        match tok {
            Tok::Num(v) => Ok(Val::Num(v)),
            Tok::Mark(m) if m == "(" => {
                let value = self.expression(toks)?;
                self.at += 1;
                Ok(value)
            }
            Tok::Mark(m) if m == "#" => {
                self.at += 1;
                let Tok::Word(word) = &toks[self.at - 1] else { return Err("#".into()) };
                Ok(Val::Word(word.clone()))
            }
            Tok::Mark(m) if m == "{" => {
                let mut parts = BTreeMap::new();
                if toks.get(self.at + 1) == Some(&Tok::Mark(":".into())) {
                    self.at += 2;
                }
                while let Some(Tok::Word(name)) = toks.get(self.at).cloned() {
                    self.at += 1;
                    let value = self.expression(toks)?;
                    parts.insert(name, value);
                    self.mark(toks, &[","]);
                }
                self.at += 1;
                Ok(Val::Rec(parts))
            }
            Tok::Word(word) => match &*word {
                "TRUE" | "FALSE" => Ok(Val::Bool(word == "TRUE")),
                "$IN" => {
                    self.at += 3;
                    Ok(Val::Bool(self.below(2) == 0))
                }
                "$TIMER" => {
                    self.at += 3;
                    Ok(Val::Num(1.0 + self.below(3) as f64))
                }
                _ if toks.get(self.at) == Some(&Tok::Mark("(".into())) => self.function(&word, toks),
                _ => {
                    self.at -= 1;
                    let place = self.place(toks)?;
                    Ok(self.value(&place))
                }
            },
            Tok::Mark(mark) => Err(format!("{mark} in an expression")),
        }
    }

    pub(super) fn place(&mut self, toks: &[Tok]) -> Done<Place> {
        let Some(Tok::Word(name)) = toks.get(self.at).cloned() else { return Err("no name".into()) };
        self.at += 1;
        let mut place = self.find(&name)?;
        loop {
            if self.mark(toks, &["["]).is_some() {
                let at = self.expression(toks)?.num()?;
                self.at += 1;
                if !(1.0..=4.0).contains(&at) {
                    return Err("no such element".into());
                }
                place.path.push(Step::Item(at as i64));
            } else if self.mark(toks, &["."]).is_some() {
                let Some(Tok::Word(part)) = toks.get(self.at).cloned() else { return Err("no part".into()) };
                self.at += 1;
                place.path.push(Step::Part(part));
            } else {
                return Ok(place);
            }
        }
    }
}
