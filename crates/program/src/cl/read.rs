//! Makes targets of statements: the meaning of each word, with the state between statements.

use super::lex::{Lexer, Record, RecordKind, Token, TokenKind};
use super::reader::Reader;
use super::refusal::Outcome;
use super::statement::Statement;
use super::words::{self, Class, Meaning, Word, decides_motion, looks_like_motion};
use crate::Reason;

impl Reader {
    /// Reads all records that `lexer` has.
    pub(super) fn run(&mut self, mut lexer: Lexer) {
        let mut tokens = Vec::new();
        loop {
            if self.take_plain(&mut lexer) {
                continue;
            }
            let Some(record) = lexer.next(&mut tokens) else { break };
            self.take(lexer.bytes(), record, &tokens);
            if self.no_unit.is_some() {
                return;
            }
        }
        self.end();
    }

    /// Reads one record.
    pub(super) fn take(&mut self, bytes: &[u8], record: Record, tokens: &[Token]) {
        match record.kind {
            RecordKind::Comment => self.comment(record, &bytes[record.span.range()]),
            RecordKind::FreeText => self.free_text(record, &bytes[record.span.range()]),
            RecordKind::Statement => self.record(bytes, record, tokens),
        }
    }

    /// Ends the reading: there are no more records.
    pub(super) fn end(&mut self) {
        if let Some(arc) = self.pending.take() {
            self.refuse(arc.record, Reason::ArcWithoutEnd);
        }
        self.checked = None;
        self.machine.end(self.targets.len(), &mut self.actions);
    }

    fn record(&mut self, bytes: &[u8], record: Record, tokens: &[Token]) {
        let Some(statement) = Statement::parse(bytes, tokens) else {
            /// Fewer numbers are a sequence number, or a remnant without a meaning.
            const POSITION: usize = 3;
            let numbers = tokens.iter().filter(|t| t.kind == TokenKind::Number).count();
            return match tokens.iter().all(|t| matches!(t.kind, TokenKind::Number | TokenKind::Comma))
                && numbers >= POSITION
            {
                true => self.refuse(record, Reason::LooseNumbers),
                false => self.list(record, Reason::NoStatement),
            };
        };
        if statement.defines {
            self.source_word(record);
            return self.list(record, Reason::SymbolicDefinition);
        }
        let word = words::find(statement.major);
        let slash = tokens.iter().any(|t| t.kind == TokenKind::Slash);
        self.understood += usize::from(slash && word.is_some_and(|word| word.class != Class::Source));
        if self.options.is_harmless(statement.major) {
            return self.list(record, Reason::DeclaredHarmless);
        }
        let Some(word) = word else {
            // Three numbers alone look like a position.
            let like_position = statement.numbers().is_some_and(|numbers| numbers.count() >= 3);
            return match (looks_like_motion(statement.major), like_position) {
                (true, _) => self.refuse(record, Reason::WordMayMove),
                (false, true) => self.refuse(record, Reason::WordMayBePosition),
                (false, false) => self.list(record, Reason::UnknownStatement),
            };
        };
        if let Err(why) = self.statement(record, &statement, word) {
            match decides_motion(word.class) || word.class == Class::Cuts {
                true => self.refuse(record, why),
                false => self.list(record, why),
            }
        }
    }

    /// Applies a statement. `Err` has the reason why it is refused.
    fn statement(&mut self, record: Record, s: &Statement, word: &Word) -> Outcome {
        match word.meaning {
            Meaning::Goto => return self.goto(record, s),
            Meaning::Godlta => return self.godlta(record, s),
            Meaning::Rapid => return self.rapid(record, s),
            Meaning::From => return self.from(s),
            Meaning::GoHome if s.items.is_empty() => self.home(record),
            // A home position in numbers is a position.
            Meaning::GoHome => return self.goto(record, s),
            Meaning::Circle => return self.circle(record, s),
            Meaning::MovArc => return self.movarc(record, s),
            Meaning::Tlon => return self.tlon(record, s),
            Meaning::Indirv => self.modal.tangent = s.number_items().first(),
            Meaning::TlAxis => {
                let axis = s.number_items().first().and_then(super::motion::axis);
                self.modal.axis = axis.ok_or(Reason::ToolAxisNotNumbers)?;
            }
            Meaning::Feed => {
                let mm = self.mm_per_unit();
                return self.modal.read_feed(s, mm);
            }
            Meaning::Spindle => self.spindle(record, s),
            Meaning::Coolant => self.coolant(record, s),
            Meaning::Stop => self.machine.stop(record),
            Meaning::OptionalStop => self.machine.optional_stop(record),
            Meaning::Delay => return self.delay(record, s),
            Meaning::LoadTool => return self.load_tool(record, s),
            Meaning::Load if s.has(b"TOOL") => return self.load_tool(record, s),
            Meaning::Load => self.list(record, Reason::NoToolLoaded),
            Meaning::ToolPath => self.tool_path(record, s),
            Meaning::Cutter => self.read_cutter(record, s),
            Meaning::Cycle => return self.define_cycle(s),
            Meaning::CutCom => return cutcom(s),
            Meaning::Units => return self.units(s),
            Meaning::Msys => return self.msys(s),
            Meaning::Csys => return self.csys(s),
            Meaning::Origin => return self.origin(s),
            Meaning::TrnTyp => self.local = s.has(b"LOCAL"),
            Meaning::Rotary if self.modal.turn_table(s) => return Err(Reason::Rotary),
            Meaning::Rotary => {}
            Meaning::Transform => return transform(s),
            Meaning::Mode => return mode(s),
            Meaning::Set if s.has(b"MODE") => return mode(s),
            Meaning::Set if s.has(b"HEAD") => return head(s),
            Meaning::Set | Meaning::Select => return self.machine.select(s),
            Meaning::Head => return head(s),
            Meaning::Code => return self.code(record, s, word.name),
            Meaning::Synonym => return self.synonym(record, s),
            Meaning::Refused(why) => return Err(why),
            Meaning::Listed(reason) => self.list(record, reason),
            Meaning::Finish => self.finished = true,
            Meaning::Passes => {}
            Meaning::Source => {
                self.source_word(record);
                return Err(Reason::SourceStatement);
            }
        }
        Ok(())
    }

    /// `rapid, goto/…`: two statements in a line.
    fn rapid(&mut self, record: Record, s: &Statement) -> Outcome {
        self.modal.rapid = true;
        let Some(next) = s.after_rapid() else { return Ok(()) };
        match words::find(next.major).map(|word| word.meaning) {
            Some(Meaning::Goto) => self.goto(record, &next),
            Some(Meaning::Godlta) => self.godlta(record, &next),
            Some(Meaning::Passes | Meaning::Finish) => Ok(()),
            _ => Err(Reason::AfterRapid),
        }
    }

    /// `PREFUN/n`, `AUXFUN/n`: codes with a meaning for a numerical control.
    fn code(&mut self, record: Record, s: &Statement, name: &str) -> Outcome {
        /// G codes of ISO 6983 that change positions: polar, plane of compensation, coordinate shifts, scaling, rotation,
        /// increments.
        const CHANGING: [f64; 16] =
            [10.0, 12.0, 13.0, 16.0, 41.0, 42.0, 43.0, 44.0, 50.0, 51.0, 52.0, 68.0, 91.0, 92.0, 28.0, 30.0];
        let changes = |code: f64| CHANGING.iter().any(|g| (g - code).abs() < 0.5);
        if name == "PREFUN" && s.number_items().iter().any(|t| changes(t.value)) {
            return Err(Reason::ControlCode);
        }
        self.list(record, Reason::CodeUnwritten);
        Ok(())
    }

    /// `SYN/new,old`: harmless if it gives no word that moves the tool another name.
    fn synonym(&mut self, record: Record, s: &Statement) -> Outcome {
        let renames = |name: &[u8]| words::find(name).is_some_and(|word| decides_motion(word.class));
        if s.words().any(renames) {
            return Err(Reason::Synonym);
        }
        self.list(record, Reason::SynNames);
        Ok(())
    }
}

/// `CUTCOM/OFF` ends a compensation that never began.
fn cutcom(s: &Statement) -> Outcome {
    let ends = s.has(b"OFF") || s.has(b"NOMORE") || s.items.is_empty();
    if ends { Ok(()) } else { Err(Reason::RadiusCompensation) }
}

/// `TRACUT/NOMORE`, `TRANS/0,0,0` and the like change nothing.
fn transform(s: &Statement) -> Outcome {
    /// A matrix of three rows of four that moves nothing.
    const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let numbers: Vec<f64> = s.number_items().iter().map(|t| t.value).collect();
    let moves_nothing = match numbers.len() {
        12 => numbers == IDENTITY,
        _ => numbers.iter().all(|v| v.abs() <= 0.0),
    };
    let ends = s.has(b"NOMORE") || s.has(b"OFF") || s.items.is_empty();
    if ends || !numbers.is_empty() && moves_nothing { Ok(()) } else { Err(Reason::Transformation) }
}

/// `MODE/INCR` makes increments of positions.
fn mode(s: &Statement) -> Outcome {
    if s.has(b"INCR") || s.has(b"INC") || s.has(b"INCREM") { Err(Reason::Increments) } else { Ok(()) }
}

/// `HEAD/1` is the only head.
fn head(s: &Statement) -> Outcome {
    let first = s.number_items().iter().all(|t| (t.value - 1.0).abs() < 0.5);
    if first { Ok(()) } else { Err(Reason::SecondHead) }
}
