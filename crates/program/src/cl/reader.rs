//! The state of the reading from statement to statement, and the program that it makes.

use super::dialect::Dialect;
use super::frame::Frame;
use super::lex::Record;
use super::machine::Machine;
use super::modal::Modal;
use super::state::{Checked, Cycle, MatrixRows, PendingArc};
use super::units::unit_at_start;
use super::{ClOptions, Layout, Point};
use crate::{Action, CutterInfo, Kept, Language, Program, Reason, Target, Tool, Wobj};
use deflex_text::{Diagnostic, Severity, Source, Span};

/// The results of the reading, and the state between records.
#[derive(Debug, Default)]
pub(super) struct Reader {
    pub(super) options: ClOptions,
    pub(super) dialect: Dialect,
    pub(super) modal: Modal,
    /// Tool, spindle, coolant.
    pub(super) machine: Machine,
    /// The drilling cycle in force, and the last one.
    pub(super) cycle: Cycle,
    pub(super) pending: Option<PendingArc>,
    /// The last motion, if it is an arc whose direction was guessed: the next position may contradict it.
    pub(super) checked: Option<Checked>,
    pub(super) units: Option<f64>,
    /// The present frame of printed positions: index into the frames of the layout.
    pub(super) frame: u16,
    /// The file's first frame, in its absolute axes.
    pub(super) base: Option<Frame>,
    /// z axis of the last frame, for systems that leave it out of their positions.
    pub(super) setup_axis: [f64; 3],
    /// Whether positions are printed in the last frame (`TRNTYP/LOCAL`).
    pub(super) local: bool,
    pub(super) matrix: MatrixRows,
    pub(super) ordinal: u32,
    pub(super) targets: Vec<Target>,
    pub(super) actions: Vec<Action>,
    pub(super) kept: Vec<Kept>,
    pub(super) layout: Layout,
    pub(super) literal_targets: usize,
    pub(super) arcs: usize,
    pub(super) cutter: Option<CutterInfo>,
    /// Number of statements that only APT-360 source has, and the first of them.
    pub(super) source_words: usize,
    pub(super) first_source_word: Option<Span>,
    /// Number of statements with a known word and a slash, which only CL data have.
    pub(super) understood: usize,
    /// Whether the program has ended (`FINI`).
    pub(super) finished: bool,
    /// A position without a unit: the file cannot be read.
    pub(super) no_unit: Option<Span>,
    /// Warnings, code and message, each once.
    pub(super) warned: Vec<(&'static str, &'static str)>,
    /// Reasons why statements are kept, at the first of each, and how many there are.
    pub(super) reported: Vec<(Reason, Diagnostic, usize)>,
}

impl Reader {
    /// A reader of the file that begins with `head`, which is all of it, or has at least the bytes from which the dialect is recognised.
    pub(super) fn new(head: &[u8], options: &ClOptions) -> Self {
        let units = unit_at_start(head, options);
        let layout = Layout { frames: vec![Frame::identity(units.unwrap_or(1.0))], ..Layout::default() };
        let (options, dialect) = (options.clone(), Dialect::detect(head));
        Self {
            options,
            dialect,
            modal: Modal::upright(),
            units,
            setup_axis: [0.0, 0.0, 1.0],
            layout,
            ..Self::default()
        }
    }

    /// Everything read since the last call, as the program of `source`, from whose bytes it was read.
    pub(super) fn program(&mut self, source: Source) -> Program {
        self.report_kept(&source);
        let raised = |tool: &String| match self.options.point {
            Point::Tip => 0.0,
            Point::Centre => self.options.corner_radius_of(tool),
        };
        self.layout.raised_mm = self.machine.tools.iter().map(raised).collect();
        let layout = Layout { frames: self.layout.frames.clone(), cards: self.layout.cards, ..Layout::default() };
        let tool = |name: &String| Tool { name: name.as_str().into(), data: None };
        let layout = crate::Layout::Cl(std::mem::replace(&mut self.layout, layout));
        Program {
            tools: self.machine.tools.iter().map(tool).collect(),
            wobjs: vec![Wobj { name: self.options.wobj.as_str().into(), data: None, unit: None }],
            targets: std::mem::take(&mut self.targets),
            actions: std::mem::take(&mut self.actions),
            kept: std::mem::take(&mut self.kept),
            literal_targets: self.literal_targets,
            arcs: self.arcs,
            cutter: self.cutter,
            ..Program::empty(Language::Cl, self.dialect.name(), ([source].into(), 1), layout)
        }
    }

    /// Adds warnings for statements that have a meaning for a machine tool, one for each reason, at the first of them.
    fn report_kept(&mut self, source: &Source) {
        for kept in self.kept.iter().filter(|kept| !kept.fault) {
            match self.reported.iter_mut().find(|(reason, ..)| *reason == kept.reason) {
                Some((.., count)) => *count += 1,
                None => {
                    let warning = Diagnostic::error("cl.kept", &source.name, kept.reason.text()).at(source, kept.span);
                    let help = "the written program does not contain it";
                    self.reported.push((kept.reason, warning.severity(Severity::Warning).help(help), 1));
                }
            }
        }
    }

    /// The warnings so far.
    pub(super) fn warnings(&self, name: &str) -> Vec<Diagnostic> {
        let warning = |&(code, message)| Diagnostic::error(code, name, message).severity(Severity::Warning);
        let counted = |(_, first, count): &(Reason, Diagnostic, usize)| match count {
            1 => first.clone(),
            more => {
                let mut all = first.clone();
                all.message = format!("{} ({more} statements)", first.message);
                all
            }
        };
        self.warned.iter().map(warning).chain(self.reported.iter().map(counted)).collect()
    }

    /// Lists a statement that passes.
    pub(super) fn list(&mut self, record: Record, reason: Reason) {
        self.kept.push(kept(record, reason, false));
    }

    /// Refuses a statement: no program may be written from the file.
    pub(super) fn refuse(&mut self, record: Record, why: Reason) {
        self.kept.push(kept(record, why, true));
    }

    /// Adds a warning, unless there is one with this code.
    pub(super) fn warn(&mut self, code: &'static str, message: &'static str) {
        if self.warned.iter().all(|(known, _)| *known != code) {
            self.warned.push((code, message));
        }
    }

    pub(super) fn source_word(&mut self, record: Record) {
        self.source_words += 1;
        self.first_source_word.get_or_insert(record.span);
    }
}

fn kept(record: Record, reason: Reason, fault: bool) -> Kept {
    Kept { source: 0, span: record.span, line: record.line, reason, fault }
}
