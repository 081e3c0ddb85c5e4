//! Statements to targets: the meaning of each word, with what holds from one to the next.

use super::dialect::Dialect;
use super::frame::Frame;
use super::lex::{Kind, Lexer, Record, RecordKind, Token};
use super::modal::Modal;
use super::motion::PendingArc;
use super::number::number;
use super::setup::unit_at_start;
use super::statement::Statement;
use super::words::{decides_motion, is_source, is_without_motion};
use super::{ClOptions, Layout};
use crate::program::{CutterInfo, Editable, Kept, Language, Mark, Program, Target, Tool, Wobj};
use crate::text::{Diagnostic, Severity, Source, Span};

/// Why a statement is kept whose word the reader does not know.
const UNKNOWN: &str = "statement not known";

/// Why an arc is kept that no position follows.
pub(super) const ARC_WITHOUT_END: &str = "arc without an end";

/// Everything that reading collects, and all that holds from one record to the next.
#[derive(Debug)]
pub(super) struct Reader {
    pub(super) options: ClOptions,
    pub(super) dialect: Dialect,
    pub(super) modal: Modal,
    pub(super) pending: Option<PendingArc>,
    pub(super) units: Option<f64>,
    /// The frame that positions are printed in now: index into the layout's.
    pub(super) frame: u16,
    /// The file's first frame, in its absolute axes.
    pub(super) base: Option<Frame>,
    /// z of the frame last named, for systems that drop it from their positions.
    pub(super) setup_axis: [f64; 3],
    /// Positions are printed in the frame last named (`TRNTYP/LOCAL`).
    pub(super) local: bool,
    pub(super) matrix: MatrixRows,
    pub(super) ordinal: u32,
    /// First target since `INDEX`, which `COPY` repeats.
    pub(super) index: usize,
    pub(super) targets: Vec<Target>,
    pub(super) kept: Vec<Kept>,
    pub(super) layout: Layout,
    pub(super) literal_targets: usize,
    pub(super) arcs: usize,
    pub(super) cutter: Option<CutterInfo>,
    /// Statements that only APT-360 source has, and the first of them.
    pub(super) source_words: usize,
    pub(super) first_source_word: Option<Span>,
    /// Statements that are CL, kept ones among them.
    pub(super) understood: usize,
    /// A position whose unit nothing tells: the file as a whole cannot be read.
    pub(super) no_unit: Option<Span>,
    /// `COPY` changes what stands before it.
    pub(super) copies: bool,
    /// Warnings, code and message, each once.
    pub(super) said: Vec<(&'static str, &'static str)>,
    /// Reasons why statements are kept, at the first of each, and how many there are.
    told: Vec<(Diagnostic, usize)>,
}

/// A CATIA matrix in comments: rows still to come.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MatrixRows {
    open: bool,
    rows: usize,
    values: [f64; 12],
}

/// Nothing, or why a statement is kept as it stands.
pub(super) type Outcome = Result<(), &'static str>;

impl Reader {
    /// A reader of the file that begins with `head`, which is all of it or more than its makers' traces are looked for in.
    pub(super) fn new(head: &[u8], options: &ClOptions) -> Self {
        let units = unit_at_start(head, options);
        let layout = Layout { frames: vec![Frame::identity(units.unwrap_or(1.0))], ..Layout::default() };
        Self {
            options: options.clone(),
            dialect: Dialect::detect(head),
            modal: Modal::default(),
            pending: None,
            units,
            frame: 0,
            base: None,
            setup_axis: [0.0, 0.0, 1.0],
            local: false,
            matrix: MatrixRows::default(),
            ordinal: 0,
            index: 0,
            targets: Vec::new(),
            kept: Vec::new(),
            layout,
            literal_targets: 0,
            arcs: 0,
            cutter: None,
            source_words: 0,
            first_source_word: None,
            understood: 0,
            no_unit: None,
            copies: false,
            said: Vec::new(),
            told: Vec::new(),
        }
    }

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
            RecordKind::Comment => self.comment(&bytes[record.span.range()]),
            RecordKind::FreeText => self.free_text(&bytes[record.span.range()]),
            RecordKind::Statement => self.record(bytes, record, tokens),
        }
    }

    /// There are no more records.
    pub(super) fn end(&mut self) {
        if let Some(arc) = self.pending.take() {
            self.keep_fault(arc.record, ARC_WITHOUT_END);
        }
    }

    /// What was read since the last time, as the program of `source`, whose bytes it was read from.
    pub(super) fn program(&mut self, source: Source) -> Program {
        self.tell_what_is_kept(&source);
        let layout = Layout { frames: self.layout.frames.clone(), cards: self.layout.cards, ..Layout::default() };
        Program {
            sources: vec![source],
            written: 1,
            language: Language::Cl,
            dialect: self.dialect.name(),
            tools: vec![Tool { name: self.options.tool.as_str().into(), data: None }],
            wobjs: vec![Wobj { name: self.options.wobj.as_str().into(), data: None }],
            targets: std::mem::take(&mut self.targets),
            kept: std::mem::take(&mut self.kept),
            literal_targets: self.literal_targets,
            arcs: self.arcs,
            cutter: self.cutter,
            diagnostics: Vec::new(),
            layout: crate::program::Layout::Cl(std::mem::replace(&mut self.layout, layout)),
        }
    }

    /// Statements that mean something to a machine tool, by reason at the first of each.
    fn tell_what_is_kept(&mut self, source: &Source) {
        for kept in self.kept.iter().filter(|kept| !kept.fault) {
            match self.told.iter_mut().find(|(first, _)| first.message == kept.reason) {
                Some((_, count)) => *count += 1,
                None => {
                    let warning = Diagnostic::error("cl.kept", &source.name, kept.reason).at(source, kept.span);
                    let help = "it has no part in the program that is written";
                    self.told.push((warning.severity(Severity::Warning).help(help), 1));
                }
            }
        }
    }

    /// What was noticed so far.
    pub(super) fn warnings(&self, name: &str) -> Vec<Diagnostic> {
        let said = |&(code, message)| Diagnostic::error(code, name, message).severity(Severity::Warning);
        let told = |(first, count): &(Diagnostic, usize)| match count {
            1 => first.clone(),
            more => Diagnostic { message: format!("{} ({more} statements)", first.message), ..first.clone() },
        };
        self.said.iter().map(said).chain(self.told.iter().map(told)).collect()
    }

    fn record(&mut self, bytes: &[u8], record: Record, tokens: &[Token]) {
        let Some(statement) = Statement::parse(bytes, tokens) else {
            return self.keep(record, "no statement");
        };
        if statement.defines {
            self.source_word(record);
            return self.keep(record, "symbolic definition");
        }
        match self.statement(record, &statement) {
            Ok(()) => self.understood += 1,
            Err(reason) => {
                self.understood += usize::from(reason != UNKNOWN);
                self.kept.push(kept(record, reason, decides_motion(statement.major)));
            }
        }
    }

    /// What a statement means; inside, why it is kept instead.
    fn statement(&mut self, record: Record, s: &Statement) -> Outcome {
        let mut upper = [0; 16];
        let len = s.major.len().min(upper.len());
        upper[..len].copy_from_slice(&s.major[..len]);
        upper.make_ascii_uppercase();
        match &upper[..len] {
            b"GOTO" => self.goto(record, s),
            b"GODLTA" => self.godlta(record, s),
            b"RAPID" => {
                self.modal.rapid = true;
                // `rapid, goto/…`: two statements in a line.
                let next = s.items.iter().position(|t| t.kind == Kind::Word);
                match next.and_then(|at| Statement::parse(s.bytes, &s.items[at..])) {
                    Some(next) if next.major.eq_ignore_ascii_case(b"GOTO") => self.goto(record, &next),
                    _ => Ok(()),
                }
            }
            b"FROM" => self.from(s),
            b"FEDRAT" | b"FEDRATE" => {
                let mm = self.mm_per_unit();
                self.modal.read_feed(s, mm)
            }
            b"SPINDL" | b"SPINDLE" => {
                self.modal.read_spindle(s);
                Ok(())
            }
            b"UNITS" | b"UNIT" => self.units(s),
            b"CIRCLE" => self.circle(record, s),
            b"MOVARC" => self.movarc(record, s),
            b"TLON" => self.tlon(record, s),
            b"AUTOPS" | b"PSIS" => Ok(()),
            b"INDIRV" => {
                self.modal.tangent = s.number_items().first();
                Ok(())
            }
            b"TLAXIS" => match s.number_items().first().and_then(super::motion::axis) {
                Some(axis) => {
                    self.modal.axis = axis;
                    Ok(())
                }
                None => Err("tool axis is not given by numbers"),
            },
            b"CUTTER" | b"TLDATA" => {
                self.read_cutter(s);
                Ok(())
            }
            b"CYCLE" => self.cycle(s),
            b"CUTCOM" => self.cutcom(s),
            b"MSYS" => self.msys(s),
            b"CSYS" => self.csys(s),
            b"ORIGIN" => self.origin(s),
            b"TRNTYP" => {
                self.local = s.has(b"LOCAL");
                Ok(())
            }
            b"ROTABL" | b"ROTATE" | b"ROTHED" => {
                let turned = self.modal.turn_table(s);
                self.modal.blocked = turned.then_some("under a turned rotary table");
                if turned { Err("rotary table: geometry turns with it") } else { Ok(()) }
            }
            b"TRANS" => self.block("shifted by TRANS", "TRANS shifts what follows"),
            b"COPY" => {
                self.copies = true;
                for target in &mut self.targets[self.index..] {
                    target.editable = Editable::No("repeated by COPY");
                }
                Err("COPY repeats what stands before")
            }
            b"INDEX" => {
                self.index = self.targets.len();
                Err("INDEX marks what COPY repeats")
            }
            b"TRACUT" => Err("TRACUT is taken as information"),
            b"GOHOME" => {
                self.modal.position = None;
                self.modal.rapid = false;
                Err("home position is the machine's")
            }
            b"NURBS" | b"KNOT" | b"CNTRL" => {
                self.modal.position = None;
                Err("NURBS curve is not read")
            }
            _ if is_source(s.major) => {
                self.source_word(record);
                Err("APT-360 source statement")
            }
            _ if is_without_motion(s.major) => Ok(()),
            _ => Err(UNKNOWN),
        }
    }

    pub(super) fn block(&mut self, reason: &'static str, kept: &'static str) -> Outcome {
        self.modal.blocked = Some(reason);
        Err(kept)
    }

    fn comment(&mut self, text: &[u8]) {
        if text.starts_with(b"$$-> CSYS") {
            let values = numbers_in(text);
            if let Some(m) = first_of::<12>(&values)
                && let Some(frame) = Frame::from_rows(m, self.mm_per_unit())
            {
                self.set_frame(frame, false);
            }
        } else if text.starts_with(b"$$-> CUTTER") {
            if let Some([diameter]) = first_of::<1>(&numbers_in(text)) {
                let diameter_mm = diameter * self.mm_per_unit();
                self.modal.cutter = Some(CutterInfo { diameter_mm, corner_radius_mm: 0.0 });
            }
        } else if text.starts_with(b"$$*CATIA0") {
            self.matrix = MatrixRows { open: true, ..MatrixRows::default() };
        } else if self.matrix.open {
            self.matrix_row(text);
        }
        self.understood += 1;
    }

    /// A row below `$$*CATIA0`: a name, then three rows of four.
    fn matrix_row(&mut self, text: &[u8]) {
        let values = numbers_in(text);
        match (first_of::<4>(&values), values.len()) {
            (Some(row), 4) => {
                self.matrix.values[4 * self.matrix.rows..][..4].copy_from_slice(&row);
                self.matrix.rows += 1;
                self.matrix.open = self.matrix.rows < 3;
                if !self.matrix.open
                    && let Some(frame) = Frame::from_rows(self.matrix.values, self.mm_per_unit())
                {
                    self.set_frame(frame, self.dialect.positions_follow_frame());
                }
            }
            _ if self.matrix.rows > 0 => self.matrix.open = false,
            _ => {}
        }
    }

    /// `PPRINT/DEFLEX AIR` and `PPRINT/DEFLEX CUT`; all other text means nothing here.
    fn free_text(&mut self, text: &[u8]) {
        if text.len() > 6 && text[..6].eq_ignore_ascii_case(b"PPRINT") {
            let said: Vec<u8> = text[6..]
                .iter()
                .copied()
                .skip_while(|b| matches!(b, b' ' | b'\t' | b'/' | b'\'' | b'"'))
                .map(|b| b.to_ascii_uppercase())
                .collect();
            let mut words = said.split(|b| matches!(b, b' ' | b'\t' | b'\'' | b'"' | b',')).filter(|w| !w.is_empty());
            match (words.next(), words.next()) {
                (Some(b"DEFLEX"), Some(b"AIR")) => self.modal.mark = Some(Mark::Air),
                (Some(b"DEFLEX"), Some(b"CUT")) => self.modal.mark = Some(Mark::Cut),
                _ => {}
            }
        }
        self.understood += 1;
    }

    fn keep(&mut self, record: Record, reason: &'static str) {
        self.kept.push(kept(record, reason, false));
    }

    /// Keeps a motion that is not what its text says.
    pub(super) fn keep_fault(&mut self, record: Record, reason: &'static str) {
        self.kept.push(kept(record, reason, true));
    }

    pub(super) fn say(&mut self, code: &'static str, message: &'static str) {
        if self.said.iter().all(|(said, _)| *said != code) {
            self.said.push((code, message));
        }
    }

    pub(super) fn source_word(&mut self, record: Record) {
        self.source_words += 1;
        self.first_source_word.get_or_insert(record.span);
    }
}

fn kept(record: Record, reason: &'static str, fault: bool) -> Kept {
    Kept { source: 0, span: record.span, line: record.line, reason, fault }
}

fn numbers_in(text: &[u8]) -> Vec<f64> {
    text.split(|b| b.is_ascii_whitespace() || matches!(b, b',' | b'/' | b'$')).filter_map(number).collect()
}

fn first_of<const N: usize>(values: &[f64]) -> Option<[f64; N]> {
    values.get(..N)?.try_into().ok()
}
