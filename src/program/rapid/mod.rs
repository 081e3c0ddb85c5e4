//! ABB RAPID.

mod expr;
mod lex;
mod module;
mod rewrite;
mod run;
mod value;

pub(super) use rewrite::rewrite;

use super::{Language, Program};
use crate::text::{Diagnostic, Severity, Source, Span};
use lex::Kind;
use module::{Module, Symbols};
use run::Run;

/// Where the number tokens of targets stand.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// One entry a target: index into `sites`, or `u32::MAX`.
    pub(super) site_of: Vec<u32>,
    /// One entry a target: the name or call that stands for it in the instruction.
    pub(super) to_arg: Vec<Option<Span>>,
    pub(super) sites: Vec<Site>,
}

/// The number tokens of one literal.
#[derive(Clone, Debug)]
pub(super) struct Site {
    kind: SiteKind,
    source: usize,
    position: [Span; 3],
    quat: Option<[Span; 4]>,
    conf: Option<[Span; 4]>,
    written_mm: [f64; 3],
    written_quat: [f64; 4],
    /// Offs, RelTool: the literal that they start from, as (source, offset of its first token).
    base: Option<(usize, u32)>,
}

/// What the three position tokens mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SiteKind {
    Robtarget,
    /// In work object axes from a base.
    Offs,
    /// In tool axes from a base.
    RelTool,
}

/// Reads modules as one program with shared names; `context` modules only declare.
///
/// # Errors
/// The program as a whole is refused (encrypted, not RAPID): every reason found.
pub fn read(sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    let written = sources.len();
    let sources: Vec<Source> = sources.into_iter().chain(context).collect();
    let mut errors: Vec<Diagnostic> = sources.iter().filter_map(refused).collect();
    let modules: Vec<Module> = sources.iter().map(Module::new).collect();
    let mut symbols = Symbols::default();
    for (i, (source, module)) in sources.iter().zip(&modules).enumerate() {
        let before = symbols.modules;
        symbols.add(i, &source.bytes, &module.tokens);
        let empty = module.tokens.iter().all(|t| t.kind == Kind::Comment);
        if symbols.modules == before && symbols.routines.values().all(|r| r.source != i) && !empty {
            errors.extend((!errors.iter().any(|e| e.file == source.name)).then(|| {
                Diagnostic::error("rapid.no-module", &source.name, "no MODULE header: this is not a RAPID module")
                    .help("expected `MODULE name` … `ENDMODULE`; use --format cl for cutter location data")
            }));
        }
        if let Some(open) = truncated(source, module) {
            errors.push(open);
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut run = Run::new(&sources, &modules, &symbols, written);
    run.program();
    let Run { targets, tools, wobjs, mut kept, layout, arcs, branches, .. } = run;
    for &(source, span) in &symbols.bad {
        let line = sources[source].line_column(span.start as usize).line;
        kept.push(super::Kept { source, span, line, reason: "declaration not understood" });
    }
    let mut diagnostics = Vec::new();
    if branches && !targets.is_empty() {
        let message = "conditions are decided at run time: all branches are read in the order of the text";
        diagnostics.push(Diagnostic::error("rapid.branches", &sources[0].name, message).severity(Severity::Note));
    }
    let literal_targets = (0..written).map(|i| literal_targets(&sources[i].bytes, &modules[i].tokens)).sum();
    let dialect = dialect(&sources[..written]);
    Ok(Program {
        written,
        language: Language::Rapid,
        dialect,
        cutter: None,
        tools,
        wobjs,
        targets,
        kept,
        literal_targets,
        arcs,
        diagnostics,
        layout: super::Layout::Rapid(layout),
        sources,
    })
}

/// Why a file is refused as a whole, if it is.
fn refused(source: &Source) -> Option<Diagnostic> {
    let head = &source.bytes[..source.bytes.len().min(512)];
    let strange = head.iter().filter(|b| (**b < 0x20 && !b.is_ascii_whitespace()) || **b >= 0x7F).count();
    let encrypted = head.first().is_some_and(|&b| b >= 0xF0) && 4 * strange > head.len();
    encrypted.then(|| {
        Diagnostic::error("rapid.encrypted", &source.name, "this module is encrypted")
            .at(source, Span::new(0, 1))
            .help("save it from the controller without encryption, or give the module that it was made from")
    })
}

/// A module that begins and does not end: a truncated file is not a program.
fn truncated(source: &Source, module: &Module) -> Option<Diagnostic> {
    let words = |wanted: &str| {
        module
            .tokens
            .iter()
            .filter(|t| t.kind == Kind::Word && source.bytes[t.span.range()].eq_ignore_ascii_case(wanted.as_bytes()))
            .count()
    };
    let last = module.tokens.iter().rev().find(|t| t.kind != Kind::Comment)?;
    let whole = words("ENDMODULE") >= words("MODULE") + words("SYSMODULE");
    (!whole).then(|| {
        Diagnostic::error("rapid.truncated", &source.name, "the file ends inside a module: expected ENDMODULE")
            .at(source, last.span)
            .help("the file is cut off; get it again from its source")
    })
}

/// Complete robtarget literals: `[[3],[4],[4],[6]]`, every leaf a number.
fn literal_targets(bytes: &[u8], tokens: &[lex::Token]) -> usize {
    let mut count = 0;
    let mut at = 0;
    while at < tokens.len() {
        match literal_robtarget(bytes, tokens, at) {
            Some(end) => (count, at) = (count + 1, end),
            None => at += 1,
        }
    }
    count
}

fn literal_robtarget(bytes: &[u8], tokens: &[lex::Token], start: usize) -> Option<usize> {
    let mut at = start;
    let mark = |at: &mut usize, wanted: u8| {
        let found = tokens.get(*at)?.kind == Kind::Mark(wanted);
        *at += 1;
        found.then_some(())
    };
    mark(&mut at, b'[')?;
    for (group, len) in [3, 4, 4, 6].into_iter().enumerate() {
        if group > 0 {
            mark(&mut at, b',')?;
        }
        mark(&mut at, b'[')?;
        for i in 0..len {
            if i > 0 {
                mark(&mut at, b',')?;
            }
            while matches!(tokens.get(at)?.kind, Kind::Mark(b'-' | b'+')) {
                at += 1;
            }
            (tokens.get(at)?.kind == Kind::Number).then_some(())?;
            at += 1;
        }
        mark(&mut at, b']')?;
    }
    mark(&mut at, b']')?;
    let _ = bytes;
    Some(at)
}

/// Who made the program, by what it says of itself in comments.
fn dialect(sources: &[Source]) -> &'static str {
    const LOOK: usize = 8192;
    const MAKERS: [(&str, &str); 9] = [
        ("ROBODK", "robodk"),
        ("ROBOTCOMPONENTS", "robotcomponents"),
        ("ROBOT COMPONENTS", "robotcomponents"),
        ("SPRUTCAM", "sprutcam"),
        ("ROBOTMASTER", "robotmaster"),
        ("POWERMILL", "powermill"),
        ("FUSION", "autodesk"),
        ("AUTODESK", "autodesk"),
        ("ROBOTSTUDIO", "robotstudio"),
    ];
    for source in sources {
        let text = expr::upper(&source.bytes[..source.bytes.len().min(LOOK)]);
        if let Some((_, dialect)) = MAKERS.iter().find(|(word, _)| text.contains(word)) {
            return dialect;
        }
    }
    "rapid"
}

/// A vector turned by a quaternion, scalar first.
fn turn(q: &[f64; 4], v: [f64; 3]) -> [f64; 3] {
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let axis = [q[1], q[2], q[3]];
    let once = cross(axis, v);
    let twice = cross(axis, once);
    std::array::from_fn(|i| v[i] + 2.0 * (q[0] * once[i] + twice[i]))
}
