//! ABB RAPID.
//!
//! Reading goes in steps:
//!
//! 1. `lex` splits bytes into lexemes.
//! 2. `syntax` finds blocks and reads each statement once, into the tree of `tree` and `expression`. What it does not understand stays as it
//!    is and affects no other statement.
//! 3. `steps` lays the statements out as a graph, which `deflex_lang::walk` follows; `flow` and `run` give each step its effect, with the values
//!    of `eval`.
//! 4. The run gives targets and the positions of their number tokens (`Layout`).
//! 5. `rewrite` turns corrections into edits.
//!
//! A mark `! deflex air` or `! deflex cut` is in force from the next instruction to the next mark, in the order in which
//! instructions run, through calls and loops. A mark before the first routine is in force from the start.

mod again;
mod agreed;
mod arguments;
mod axes;
mod calls;
mod changes;
mod chunk;
mod chunks;
mod clone;
mod cycle;
mod data;
mod declared;
mod dialect;
mod errors;
mod eval;
mod executed;
mod expression;
mod flow;
mod frames;
mod gathering;
mod index;
mod insert;
mod instructions;
mod kinds;
mod known;
mod lasting;
mod lex;
mod lines;
mod literal;
mod memory;
mod motion;
mod moves;
mod named;
mod outcome;
mod own;
mod parameters;
mod parser;
mod pins;
mod predefined;
mod ran;
mod read_chunk;
mod rewrite;
mod routines;
mod run;
mod runner;
mod sample;
mod shape;
mod state;
mod statement;
mod steps;
mod streamable;
mod symbols;
mod syntax;
mod tree;
mod uses;
mod value;
mod values;
mod writer;

// Types between `Chunks` and the pipeline that corrects them; not for callers.
#[doc(hidden)]
pub(crate) use changes::changes_nothing;
pub use chunk::Chunk;
pub use chunks::Chunks;
pub use declared::{Declared, Names};
pub use executed::{Executed, ExecutedChunks};
pub use frames::declared_frames;
pub use lines::CHUNK;
use rewrite::rewrite;

use super::front_end::{FrontEnd, Wanted};
use super::{Kept, Passing, Program, Reason, Rewritten};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Diagnostic, Edit, Severity, Source, Span};
use lex::{Cursor, LexemeKind};
use literal::Literal;
use std::collections::{BTreeSet, HashSet};
use std::sync::{Arc, OnceLock};
use value::OffsetStep;
pub(crate) use value::SPEEDS;

/// The positions of the number tokens of robtargets.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// In text order by source; then the robtargets that are assembled from parts.
    literals: Arc<Vec<Literal>>,
    /// One per target.
    sites: Vec<TargetInText>,
    offsets: Vec<Offset>,
    /// Those of motions that also run where the program does not follow them, and which stay in place if their base moves.
    standing: Arc<Vec<Offset>>,
    /// Literals to which joint motions go that the program does not follow: they go along with the cuts there.
    joints_elsewhere: BTreeSet<u32>,
    /// Literals that the program also shows, or to which motions go that it does not follow and that have other motions before or after them.
    bound_to_point: BTreeSet<u32>,
    /// Executed motions, with those whose target is unknown when reading.
    motions: usize,
    /// The program is one procedure of motions to inline targets, so it can be cut anywhere (see `chunks`).
    streamable: bool,
    /// As `streamable`, but targets may also be declared by name.
    plain: bool,
    /// Files and starts of the statements that are the body of a compact IF.
    after_compact_if: BTreeSet<(u16, u32)>,
    /// The same of the statements in routines that also run where the program does not follow them.
    runs_elsewhere: HashSet<(u16, u32)>,
    /// The mark in force after the last statement.
    mark_at_end: Option<super::Mark>,
    /// In a chunk of a program that is run again for each chunk: the motions that its own repeat.
    again: Option<agreed::Again>,
    /// The zones that the texts declare, once they are needed.
    zones: OnceLock<Vec<insert::DeclaredZone>>,
}

impl Layout {
    /// The layout of a RAPID program.
    pub(super) fn of(program: &Program) -> Option<&Self> {
        match &program.layout {
            super::Layout::Rapid(layout) => Some(layout),
            _ => None,
        }
    }

    /// Whether a joint motion that the program does not follow goes to the literal of a target.
    fn is_joint_elsewhere(&self, i: usize) -> bool {
        matches!(self.sites[i], TargetInText::Literal { literal, .. } if self.joints_elsewhere.contains(&literal))
    }

    /// The offset (`Offs`, `RelTool`) that makes a target.
    fn offset(&self, site: &TargetInText) -> Option<&Offset> {
        match site {
            TargetInText::Offset(at) => self.offsets.get(*at as usize),
            TargetInText::None | TargetInText::Literal { .. } => None,
        }
    }
}

impl FrontEnd for Layout {
    fn rewrite(&self, program: &Program, wanted: Wanted<'_>) -> Rewritten {
        match &self.again {
            Some(again) => again.rewrite(program, self, wanted),
            None => rewrite(program, self, wanted),
        }
    }

    fn insertions_refused(&self, program: &Program, before: &[usize]) -> Vec<Option<Reason>> {
        before.iter().map(|i| insert::refusal(program, self, *i)).collect()
    }

    fn writes_axes(&self, program: &Program) -> Vec<bool> {
        // A target made from a literal by `Offs` has the literal's axes.
        let roots: HashSet<u32> = self.offsets.iter().chain(&*self.standing).map(|offset| offset.root).collect();
        let writes = |site: &TargetInText| {
            let TargetInText::Literal { literal, .. } = site else { return false };
            let place = &self.literals[*literal as usize];
            let source = usize::from(place.source);
            source < program.written && !roots.contains(literal) && place.axes(&program.sources[source].bytes).is_some()
        };
        self.sites.iter().map(writes).collect()
    }

    fn joints_elsewhere(&self, program: &Program) -> Vec<usize> {
        (0..program.targets.len()).filter(|i| self.is_joint_elsewhere(*i)).collect()
    }

    fn bound_to_point(&self, _: &Program) -> Vec<usize> {
        let is_bound = |i: &usize| self.root(*i).is_some_and(|root| self.bound_to_point.contains(&root));
        (0..self.sites.len()).filter(|i| is_bound(i) || self.is_joint_elsewhere(*i)).collect()
    }

    fn motion_targets(&self, _: &Program) -> usize {
        self.motions
    }

    fn passing(&self, program: &Program, target: usize) -> Passing {
        insert::passing(program, target).unwrap_or(Passing::Unstated)
    }

    fn is_worded_like(&self, program: &Program, target: usize, other: usize) -> bool {
        let words = [target, other].map(|i| insert::around_literal(program, self, i));
        words[0].is_some() && words[0] == words[1]
    }

    fn passing_edits(&self, program: &Program, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
        insert::passing_edits(program, wanted)
    }

    fn inserted_passing(&self, _: &Program, _: usize) -> Passing {
        insert::CLOSE_BY
    }
}

/// The position of one target in the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TargetInText {
    /// None: joint angles, or a calculated value.
    None,
    /// A literal.
    Literal { literal: u32, given: Given },
    /// `Offs` or `RelTool`: an index into [`Layout::offsets`].
    Offset(u32),
}

impl TargetInText {
    /// The literal from which the target is made.
    fn root(&self, offsets: &[Offset]) -> Option<u32> {
        match self {
            Self::None => None,
            Self::Literal { literal, .. } => Some(*literal),
            Self::Offset(at) => Some(offsets[*at as usize].root),
        }
    }
}

/// How an instruction gives a literal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Given {
    /// It is written out.
    Inline,
    /// This argument names the declaration of the literal, or the part of it that the literal is.
    Declared(SourceSpan),
    /// By another name: a parameter, or data that take their value from the declaration.
    Otherwise,
    /// As the base of an offset that the program computes: a shift of the literal is one of the target.
    Base,
}

/// A target made from a literal by `Offs` and `RelTool`, innermost first; the outermost carries the edit.
#[derive(Clone, Debug)]
struct Offset {
    root: u32,
    steps: Box<[OffsetStep]>,
}

/// Reads modules as one program with shared names; `context` modules give declarations only.
///
/// # Errors
/// Every reason for which the program as a whole is refused (encrypted, not RAPID).
///
/// # Examples
/// ```
/// use deflex_program::rapid;
/// use deflex_text::Source;
///
/// let program = rapid::read(vec![Source::new("slot.mod", std::fs::read("../../samples/slot/slot.mod")?)], vec![])?;
/// assert_eq!(program.targets[0].feed_mm_s, Some(20.0));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn read(sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    read_as(dialect::of(&sources), sources, context)
}

/// [`read`] for callers that change nothing: a file that is cut off is read to its end, and its end is noted.
///
/// # Errors
/// As [`read`], but for cut-off files.
#[doc(hidden)]
pub fn look(sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    read_cut(dialect::of(&sources), sources, context, Cut::Looked)
}

/// [`read`] with the name of the dialect.
fn read_as(dialect: &'static str, sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    read_cut(dialect, sources, context, Cut::Refused)
}

/// The treatment of files that are cut off.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Cut {
    Refused,
    /// They are read to their end.
    Looked,
}

/// [`read_as`], with the treatment of files that are cut off.
fn read_cut(
    dialect: &'static str,
    sources: Vec<Source>,
    context: Vec<Source>,
    cut: Cut,
) -> Result<Program, Vec<Diagnostic>> {
    let parsed = parsed(dialect, sources, context, cut)?;
    parsed.program(parsed.runner().run())
}

/// The files of a program, with their syntax trees.
#[derive(Debug)]
struct Parsed {
    sources: Arc<[Source]>,
    files: Vec<tree::File>,
    /// Number of files that are the program itself; context follows them.
    written: usize,
    dialect: &'static str,
    /// The ends of the files that are cut off.
    cuts: Vec<Kept>,
}

/// Parses modules and context.
fn parsed(
    dialect: &'static str,
    mut sources: Vec<Source>,
    context: Vec<Source>,
    cut: Cut,
) -> Result<Parsed, Vec<Diagnostic>> {
    let written = sources.len();
    sources.extend(context);
    let mut errors = Vec::new();
    let (mut files, mut cuts) = (Vec::new(), Vec::new());
    for (index, source) in sources.iter().enumerate() {
        let index = u16::try_from(index).unwrap_or(u16::MAX);
        let file = match refuse(source) {
            Some(error) => Err(error),
            None => syntax::parse(source, index).map_err(|syntax::TooDeep(here)| {
                let message = format!("blocks are nested deeper than {}", syntax::MAX_DEPTH);
                Diagnostic::error("rapid.too-deep", "", message).at(source, here).help("split the routine into several")
            }),
        };
        match file {
            Ok(file) => {
                if let Some(last) = file.cut.filter(|_| cut == Cut::Looked) {
                    let line = source.line_column(last.range().start).line;
                    let reason = Reason::FileEndsInModule;
                    cuts.push(Kept { source: index.into(), span: last, line, reason, fault: true });
                } else if let Some(last) = file.cut {
                    let message = "the file ends inside a module: expected ENDMODULE";
                    let error = Diagnostic::error("rapid.truncated", &source.name, message).at(source, last);
                    errors.push(error.help("the file is cut off; get it again from its source"));
                }
                files.push(file);
            }
            Err(error) => errors.push(error),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    Ok(Parsed { sources: sources.into(), files, written, dialect, cuts })
}

impl Parsed {
    fn runner(&self) -> runner::Runner<'_> {
        runner::Runner::new(&self.sources, &self.files, self.written)
    }

    /// The program that a run found, with what is known without the run.
    fn program(&self, mut found: Program) -> Result<Program, Vec<Diagnostic>> {
        if found.diagnostics.iter().any(|d| d.severity == Severity::Error) {
            found.diagnostics.sort_by_key(|d| d.severity != Severity::Error);
            return Err(found.diagnostics);
        }
        let own = &self.files[..self.written];
        for (source, file) in self.sources.iter().zip(own) {
            found.diagnostics.extend(not_read(source, &file.odd));
        }
        found.kept.extend(self.cuts.iter().cloned());
        let literal_targets = own.iter().map(|file| file.literals.len()).sum();
        Ok(Program { sources: Arc::clone(&self.sources), dialect: self.dialect, literal_targets, ..found })
    }
}

/// Warns of statements that cannot be read and stay as they are: one warning per reason, at the first of them.
fn not_read(source: &Source, odd: &[(Span, Reason)]) -> Vec<Diagnostic> {
    let mut reasons: Vec<(Reason, Span, usize)> = Vec::new();
    for (span, reason) in odd {
        match reasons.iter_mut().find(|(known, ..)| known == reason) {
            Some((.., count)) => *count += 1,
            None => reasons.push((*reason, *span, 1)),
        }
    }
    let warning = |(reason, first, count): (Reason, Span, usize)| {
        let message = match count {
            1 => reason.to_string(),
            more => format!("{reason} ({more} statements)"),
        };
        let message = Diagnostic::error("rapid.not-read", &source.name, message).at(source, first);
        message.severity(Severity::Warning).help(
            "deflex does not see the motions in it, so it corrects none of them; a controller may refuse to load it",
        )
    };
    reasons.into_iter().map(warning).collect()
}

/// The reason for which a file as a whole is refused.
fn refuse(source: &Source) -> Option<Diagnostic> {
    let bytes = &source.bytes;
    let first = Span::new(0, bytes.len().min(1));
    let whole = |code, message: &str| Diagnostic::error(code, &source.name, message).at(source, first);
    if u32::try_from(bytes.len()).is_err() {
        return Some(whole("rapid.too-large", "file is larger than 4 GiB").help("split it into modules"));
    }
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    if text.starts_with(b"\xFF\xFE") || text.starts_with(b"\xFE\xFF") || text.starts_with(b"M\0") {
        return Some(whole("rapid.utf16", "the file is UTF-16 text").help("save it as UTF-8 or ISO 8859-1"));
    }
    if let Some(at) = deflex_text::no_text(bytes) {
        let message = "the module is encrypted, or no text at all: expected RAPID in plain text";
        return Some(
            whole("rapid.encrypted", message)
                .at(source, Span::new(at, at + 1))
                .help("save it from the controller without encryption; as a --context, leave it out: what it does is unknown then"),
        );
    }
    if text.trim_ascii_start().starts_with(b"<") {
        let message = "the file is XML, not RAPID; a program file (.pgf) only lists modules";
        return Some(whole("rapid.xml", message).help("give the modules that it lists"));
    }
    // Look for what only RAPID has: a module, a routine or data.
    let mut cursor = Cursor::new(bytes, Span::new(0, bytes.len()));
    loop {
        let lexeme = cursor.next();
        match lexeme.kind {
            LexemeKind::End => break,
            LexemeKind::Word => {
                let word = cursor.text(lexeme);
                if matches!(
                    lex::key(word),
                    Some(
                        lex::Key::Module
                            | lex::Key::Proc
                            | lex::Key::Func
                            | lex::Key::Trap
                            | lex::Key::Record
                            | lex::Key::Pers
                            | lex::Key::Const
                            | lex::Key::Var
                    )
                ) && cursor.peek().kind != LexemeKind::End
                {
                    return None;
                }
            }
            _ => {}
        }
    }
    Some(
        whole("rapid.no-module", "the file is not RAPID: there is no MODULE, no routine and no declaration in it")
            .help("give a .mod, .sys or .prg file, or force the language with --input-format"),
    )
}
