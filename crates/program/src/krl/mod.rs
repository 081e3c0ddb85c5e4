//! KUKA KRL: `.src` with its `.dat`.
//!
//! | file | from | to |
//! |---|---|---|
//! | `lex` | bytes | lines of lexemes, marks |
//! | `syntax`, `expression`, `tree` | lines | routines, data lists, statements, expressions: each read once |
//! | `value`, `eval`, `symbols`, `state` | expressions | values, known or unknown, and where their numbers stand |
//! | `steps`, `flow` | blocks | the steps of routines; `deflex_lang::walk` finds which of them run, and what holds at each |
//! | `run`, `calls`, `motion` | statements | targets |
//! | `chunks`, `like` | a long file | the same in constant memory |
//! | `changes`, `names` | statements | what they could change |
//! | `rewrite`, `insert` | corrected poses | edits on number tokens, lines between |
//!
//! A mark `; deflex air` or `; deflex cut` holds from the next statement on, in the order in which statements run.

mod bas;
mod calls;
mod changes;
mod chunks;
mod eval;
mod expression;
mod flow;
mod frames;
mod insert;
mod lex;
mod like;
mod motion;
mod names;
mod numbers;
mod rewrite;
mod run;
mod settle;
mod state;
mod steps;
mod symbols;
mod syntax;
mod system;
mod tree;
mod value;

pub use chunks::{CHUNK, Chunk, Chunks};
pub(crate) use syntax::is_type;
pub(crate) use system::{Called, changes};

use super::{Language, Program, Reason};
use deflex_text::{Diagnostic, Severity, Source, Span};
use run::{PositionTokens, Runner};
use std::collections::HashSet;
use tree::File;

/// Where the numbers of targets stand.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// One a target.
    sites: Vec<PositionTokens>,
    /// Executed motions, those whose target is not known when reading among them.
    motions: usize,
    /// Files and starts of the statements in routines that also run where the program does not follow them.
    runs_elsewhere: HashSet<(u16, u32)>,
}

/// Reads files as one program with shared names; `context` files only declare.
///
/// # Errors
/// The program as a whole is refused (no text, no KRL, cut off): every reason found.
///
/// # Examples
/// ```
/// use deflex_program::krl;
/// use deflex_text::Source;
///
/// let file = |name: &str| std::fs::read(format!("../../samples/kuka/{name}")).map(|bytes| Source::new(name, bytes));
/// let program = krl::read(vec![file("ring.src")?, file("ring.dat")?], vec![])?;
/// assert!(!program.targets.is_empty());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn read(sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    read_cut(sources, context, false)
}

/// [`read`] without the purpose to write: a file that is cut off is read to its end, and where it ends is kept.
///
/// # Errors
/// As [`read`], but for cut-off files.
#[doc(hidden)]
pub fn look(sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    read_cut(sources, context, true)
}

fn read_cut(mut sources: Vec<Source>, context: Vec<Source>, look: bool) -> Result<Program, Vec<Diagnostic>> {
    let written = sources.len();
    sources.extend(context);
    let (mut files, mut errors, mut cuts) = (Vec::new(), Vec::new(), Vec::new());
    for (index, source) in sources.iter().enumerate() {
        if let Some(error) = refuse(source) {
            errors.push(error);
            continue;
        }
        let file = match syntax::parse(source, u16::try_from(index).unwrap_or(u16::MAX)) {
            Ok(file) => file,
            Err(syntax::TooDeep(here)) => {
                let message = format!("blocks are nested deeper than {}", syntax::MAX_DEPTH);
                let error = Diagnostic::error("krl.too-deep", &source.name, message).at(source, here);
                errors.push(error.help("split the routine into several"));
                continue;
            }
        };
        if file.module.is_empty() {
            let message = "there is no DEF and no DEFDAT in the file: expected a KRL program or data list";
            let error = Diagnostic::error("krl.no-routine", &source.name, message).at(source, Span::new(0, 0));
            errors.push(error.help("give a .src with its .dat in the same folder"));
        } else if let Some(at) = file.cut {
            if look {
                cuts.push((index, at));
            } else {
                let message =
                    "what begins here is not closed: expected END, ENDDAT, ENDIF, ENDFOR, ENDWHILE, ENDLOOP, …";
                let error = Diagnostic::error("krl.truncated", &source.name, message).at(source, at);
                errors.push(error.help("the file is cut off; get it again from its source"));
            }
        }
        files.push(file);
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut runner = Runner::new(&sources, &files, written);
    runner.run();
    let runs_elsewhere = runner.statements_that_run_elsewhere();
    let Runner { tools, wobjs, targets, sites, motions, arcs, unknown, mut kept, mut diagnostics, .. } = runner;
    if diagnostics.iter().any(|d| d.severity == Severity::Error) {
        diagnostics.sort_by_key(|d| d.severity != Severity::Error);
        return Err(diagnostics);
    }
    cuts.into_iter().for_each(|(file, at)| kept.refuse(file, at, Reason::FileEndsInBlock));
    let literal_targets = files.iter().take(written).map(File::positions).sum();
    let (kept, dialect) = (kept.in_order(), dialect(&sources[..written]));
    let layout = super::Layout::Krl(Layout { sites, motions: motions as usize, runs_elsewhere });
    let files = (sources.into(), written);
    Ok(Program {
        tools,
        wobjs,
        targets,
        unknown,
        kept,
        literal_targets,
        arcs,
        diagnostics,
        ..Program::empty(Language::Krl, dialect, files, layout)
    })
}

/// Why a file as a whole is not read.
fn refuse(source: &Source) -> Option<Diagnostic> {
    let whole = |code, message: &str, at: usize| {
        Diagnostic::error(code, &source.name, message).at(source, Span::new(at, (at + 1).min(source.bytes.len())))
    };
    if u32::try_from(source.bytes.len()).is_err() {
        return Some(whole("krl.too-large", "file is larger than 4 GiB", 0).help("split it"));
    }
    let at = deflex_text::no_text(&source.bytes)?;
    Some(whole("krl.no-text", "the file is no text: expected KRL", at).help("save it from the controller as text"))
}

/// The software that wrote the program, from marks in its text.
fn dialect(sources: &[Source]) -> &'static str {
    const MAKERS: [(&[u8], &str); 8] = [
        (b"RoboDK", "robodk"),
        (b"KUKA|prc", "kuka-prc"),
        (b"SprutCAM", "sprutcam"),
        (b"Robotmaster", "robotmaster"),
        (b"PowerMill", "powermill"),
        (b"Siemens", "nx"),
        (b"CAMRob", "camrob"),
        (b"%{PE}", "inline-forms"),
    ];
    let head = |source: &Source| source.bytes[..source.bytes.len().min(8192)].to_vec();
    let heads: Vec<Vec<u8>> = sources.iter().map(head).collect();
    let made = |text: &[u8]| heads.iter().any(|head| memchr::memmem::find(head, text).is_some());
    MAKERS.iter().find(|(text, _)| made(text)).map_or("krl", |(_, maker)| maker)
}
