//! RAPID text to statements: enough of the grammar for programs that are run, none of it shared with the project.

use super::tokens::{Token, tokens};
use super::tree::*;
use std::rc::Rc;

/// Words that begin no call.
const RESERVED: [&str; 20] = [
    "ENDIF", "ENDFOR", "ENDWHILE", "ENDTEST", "ENDPROC", "ENDFUNC", "ENDTRAP", "ENDMODULE", "ELSE", "ELSEIF", "CASE",
    "DEFAULT", "THEN", "DO", "PROC", "FUNC", "TRAP", "VAR", "CONST", "PERS",
];

pub fn module(text: &str) -> Result<Module, String> {
    let mut parser = Parser { tokens: tokens(text)?, at: 0 };
    parser.module().map_err(|why| format!("line {}: {why}", parser.line()))
}

/// Data by its name in a string, as `SetDataVal` takes it.
pub fn data(text: &str) -> Result<Data, String> {
    Parser { tokens: tokens(text)?, at: 0 }.data()
}

struct Parser {
    tokens: Vec<(Token, u32)>,
    at: usize,
}

type Parsed<T> = Result<T, String>;

impl Parser {
    fn line(&self) -> u32 {
        self.tokens[self.at].1
    }

    fn peek(&self) -> &Token {
        &self.tokens[self.at].0
    }

    fn after(&self, n: usize) -> &Token {
        &self.tokens[(self.at + n).min(self.tokens.len() - 1)].0
    }

    fn is(&self, text: &str) -> bool {
        match self.peek() {
            Token::Word(word) => word == text,
            Token::Sign(sign) => *sign == text,
            _ => false,
        }
    }

    fn take(&mut self, text: &str) -> bool {
        let found = self.is(text);
        if found {
            self.at += 1;
        }
        found
    }

    fn expect(&mut self, text: &str) -> Parsed<()> {
        if self.take(text) { Ok(()) } else { Err(format!("expected {text}, found {:?}", self.peek())) }
    }

    fn word(&mut self) -> Parsed<String> {
        match self.peek().clone() {
            Token::Word(word) => {
                self.at += 1;
                Ok(word)
            }
            other => Err(format!("expected a name, found {other:?}")),
        }
    }

    fn module(&mut self) -> Parsed<Module> {
        while !self.is("MODULE") {
            if *self.peek() == Token::End {
                return Err("no module".into());
            }
            self.at += 1;
        }
        self.expect("MODULE")?;
        let mut module = Module { name: self.word()?, ..Module::default() };
        if self.take("(") {
            while !self.take(")") {
                self.at += 1;
            }
        }
        while !self.take("ENDMODULE") {
            let local = self.take("LOCAL") || self.take("TASK");
            if self.take("RECORD") {
                let name = self.word()?;
                let mut components = Vec::new();
                while !self.take("ENDRECORD") {
                    let ty = self.word()?;
                    components.push((self.word()?, ty));
                    self.expect(";")?;
                }
                module.records.push((name, components));
            } else if self.is("PROC") || self.is("FUNC") || self.is("TRAP") {
                module.routines.push(Rc::new(self.routine(local)?));
            } else {
                module.data.push(self.declaration(local)?);
            }
        }
        Ok(module)
    }

    fn declaration(&mut self, local: bool) -> Parsed<Declaration> {
        let storage = match self.word()?.as_str() {
            "CONST" => Storage::Const,
            "VAR" => Storage::Var,
            "PERS" => Storage::Pers,
            other => return Err(format!("expected a declaration, found {other}")),
        };
        let (ty, name) = (self.word()?, self.word()?);
        let mut dims = Vec::new();
        if self.take("{") {
            dims = self.list("}")?;
        }
        let value = if self.take(":=") { Some(self.expr(0)?) } else { None };
        self.expect(";")?;
        Ok(Declaration { local, storage, ty, name, dims, value })
    }

    fn list(&mut self, end: &str) -> Parsed<Vec<Expr>> {
        let mut out = Vec::new();
        while !self.take(end) {
            out.push(self.expr(0)?);
            if !self.is(end) {
                self.expect(",")?;
            }
        }
        Ok(out)
    }

    fn routine(&mut self, local: bool) -> Parsed<Routine> {
        let kind = self.word()?;
        let ty = if kind == "FUNC" { Some(self.word()?) } else { None };
        let name = self.word()?;
        let mut parameters = Vec::new();
        if kind != "TRAP" {
            self.expect("(")?;
            let mut optional = false;
            while !self.take(")") {
                if self.take(",") {
                    optional = false;
                }
                if self.take("\\") {
                    optional = true;
                }
                self.take("|");
                let (mode, ty) = match self.word()?.as_str() {
                    "SWITCH" => (Mode::Switch, String::new()),
                    "VAR" | "PERS" | "INOUT" => (Mode::Reference, self.word()?),
                    ty => (Mode::In, ty.to_owned()),
                };
                let name = self.word()?;
                if self.take("{") {
                    while !self.take("}") {
                        self.at += 1;
                    }
                }
                parameters.push(Parameter { name, ty, mode, optional });
            }
        }
        let end = format!("END{kind}");
        let mut data = Vec::new();
        while self.is("VAR") || self.is("CONST") || self.is("PERS") {
            data.push(self.declaration(true)?);
        }
        let body = self.block(&[&end, "ERROR", "UNDO", "BACKWARD"])?;
        let mut handler = None;
        while !self.take(&end) {
            let part = self.word()?;
            let numbers = if part == "ERROR" && self.take("(") { self.list(")")? } else { Vec::new() };
            let block = self.block(&[&end, "ERROR", "UNDO", "BACKWARD"])?;
            if part == "ERROR" {
                handler = Some((numbers, block));
            }
        }
        Ok(Routine { name, local, ty, parameters, data, body, handler })
    }

    fn block(&mut self, ends: &[&str]) -> Parsed<Block> {
        let mut out = Vec::new();
        while !ends.iter().any(|end| self.is(end)) {
            if *self.peek() == Token::End {
                return Err(format!("expected {ends:?}"));
            }
            out.push(self.statement()?);
        }
        Ok(Rc::new(out))
    }

    fn statement(&mut self) -> Parsed<Stmt> {
        let line = self.line();
        let kind = self.kind()?;
        Ok(Stmt { line, kind })
    }

    fn ended<T>(&mut self, value: T) -> Parsed<T> {
        self.expect(";")?;
        Ok(value)
    }

    fn kind(&mut self) -> Parsed<Kind> {
        if self.take("%") {
            let name = self.expr(0)?;
            self.expect("%")?;
            let args = self.args(";")?;
            return Ok(Kind::Late(name, args));
        }
        let start = self.at;
        let word = self.word()?;
        match word.as_str() {
            "IF" => self.condition(),
            "FOR" => {
                let name = self.word()?;
                self.expect("FROM")?;
                let from = self.expr(0)?;
                self.expect("TO")?;
                let to = self.expr(0)?;
                let step = if self.take("STEP") { Some(self.expr(0)?) } else { None };
                self.expect("DO")?;
                let body = self.block(&["ENDFOR"])?;
                self.expect("ENDFOR")?;
                Ok(Kind::For { name, from, to, step, body })
            }
            "WHILE" => {
                let condition = self.expr(0)?;
                self.expect("DO")?;
                let body = self.block(&["ENDWHILE"])?;
                self.expect("ENDWHILE")?;
                Ok(Kind::While(condition, body))
            }
            "TEST" => {
                let value = self.expr(0)?;
                let (mut cases, mut default) = (Vec::new(), Block::default());
                loop {
                    if self.take("CASE") {
                        let mut values = vec![self.expr(0)?];
                        while self.take(",") {
                            values.push(self.expr(0)?);
                        }
                        self.expect(":")?;
                        cases.push((values, self.block(&["CASE", "DEFAULT", "ENDTEST"])?));
                    } else if self.take("DEFAULT") {
                        self.expect(":")?;
                        default = self.block(&["ENDTEST"])?;
                    } else {
                        self.expect("ENDTEST")?;
                        return Ok(Kind::Test(value, cases, default));
                    }
                }
            }
            "GOTO" => {
                let label = self.word()?;
                self.ended(Kind::Goto(label))
            }
            "RETURN" | "RAISE" => {
                let value = if self.is(";") { None } else { Some(self.expr(0)?) };
                self.ended(if word == "RETURN" { Kind::Return(value) } else { Kind::Raise(value) })
            }
            "RETRY" => self.ended(Kind::Retry),
            "TRYNEXT" => self.ended(Kind::TryNext),
            "EXIT" => self.ended(Kind::Exit),
            "CONNECT" => {
                let data = self.data()?;
                self.expect("WITH")?;
                let trap = self.word()?;
                self.ended(Kind::Connect(data, trap))
            }
            _ if self.is(":") => {
                self.at += 1;
                Ok(Kind::Label(word))
            }
            _ => {
                self.at = start;
                // An assignment has its target up to the sign.
                if let Ok(data) = self.data()
                    && self.take(":=")
                {
                    let value = self.expr(0)?;
                    return self.ended(Kind::Assign(data, value));
                }
                self.at = start;
                let name = self.word()?;
                if RESERVED.contains(&name.as_str()) {
                    return Err(format!("{name} out of place"));
                }
                let args = self.args(";")?;
                Ok(Kind::Call(name, args))
            }
        }
    }

    fn condition(&mut self) -> Parsed<Kind> {
        let first = self.expr(0)?;
        if !self.take("THEN") {
            // Compact: one instruction and no end.
            let only = self.statement()?;
            return Ok(Kind::If(vec![(first, Rc::new(vec![only]))], Block::default()));
        }
        let ends = ["ELSEIF", "ELSE", "ENDIF"];
        let mut branches = vec![(first, self.block(&ends)?)];
        loop {
            if self.take("ELSEIF") {
                let condition = self.expr(0)?;
                self.expect("THEN")?;
                branches.push((condition, self.block(&ends)?));
            } else if self.take("ELSE") {
                let other = self.block(&["ENDIF"])?;
                self.expect("ENDIF")?;
                return Ok(Kind::If(branches, other));
            } else {
                self.expect("ENDIF")?;
                return Ok(Kind::If(branches, Block::default()));
            }
        }
    }

    fn args(&mut self, end: &str) -> Parsed<Vec<Arg>> {
        let mut out = Vec::new();
        while !self.take(end) {
            if self.take(",") {
            } else if self.take("\\") {
                let option = Some(self.word()?);
                let (value, conditional) = if self.take(":=") {
                    (Some(self.expr(0)?), false)
                } else if self.take("?") {
                    (Some(self.expr(0)?), true)
                } else {
                    (None, false)
                };
                out.push(Arg { option, value, conditional });
            } else {
                if matches!(self.peek(), Token::Word(_)) && *self.after(1) == Token::Sign(":=") {
                    self.at += 2;
                }
                out.push(Arg { option: None, value: Some(self.expr(0)?), conditional: false });
            }
        }
        Ok(out)
    }

    fn data(&mut self) -> Parsed<Data> {
        let name = self.word()?;
        let mut steps = Vec::new();
        loop {
            if self.take("{") {
                steps.push(Part::Element(self.list("}")?));
            } else if self.take(".") {
                steps.push(Part::Component(self.word()?));
            } else {
                return Ok(Data { name, steps });
            }
        }
    }

    /// Operators by how tightly they bind, loosest first.
    const LEVELS: [&'static [&'static str]; 5] =
        [&["OR", "XOR"], &["AND"], &["=", "<>", "<=", ">=", "<", ">"], &["+", "-"], &["*", "/", "DIV", "MOD"]];

    fn expr(&mut self, level: usize) -> Parsed<Expr> {
        if level == 1 && self.take("NOT") {
            return Ok(Expr::Unary("NOT", Box::new(self.expr(2)?)));
        }
        let Some(operators) = Self::LEVELS.get(level) else { return self.unary() };
        let mut left = self.expr(level + 1)?;
        while let Some(operator) = operators.iter().find(|operator| self.is(operator)) {
            self.at += 1;
            let not = level == 1 && self.take("NOT");
            let mut right = self.expr(level + 1)?;
            if not {
                right = Expr::Unary("NOT", Box::new(right));
            }
            left = Expr::Binary(operator, Box::new(left), Box::new(right));
        }
        Ok(left)
    }

    fn unary(&mut self) -> Parsed<Expr> {
        if self.take("-") {
            return Ok(Expr::Unary("-", Box::new(self.unary()?)));
        }
        if self.take("+") {
            return self.unary();
        }
        if self.take("NOT") {
            return Ok(Expr::Unary("NOT", Box::new(self.unary()?)));
        }
        if self.take("(") {
            let inner = self.expr(0)?;
            self.expect(")")?;
            return Ok(inner);
        }
        if self.take("[") {
            return Ok(Expr::Aggregate(self.list("]")?));
        }
        match self.peek().clone() {
            Token::Num(v) => {
                self.at += 1;
                Ok(Expr::Num(v))
            }
            Token::Str(s) => {
                self.at += 1;
                Ok(Expr::Str(s))
            }
            Token::Word(word) if word == "TRUE" || word == "FALSE" => {
                self.at += 1;
                Ok(Expr::Bool(word == "TRUE"))
            }
            Token::Word(word) if *self.after(1) == Token::Sign("(") => {
                self.at += 2;
                Ok(Expr::Call(word, self.args(")")?))
            }
            _ => Ok(Expr::Data(self.data()?)),
        }
    }
}
