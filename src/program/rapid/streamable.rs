//! Chunks of streamable programs, read line by line: lines that differ in nothing but the numbers of their robtarget, or its
//! name, mean the same, so that one of each kind is read by [`read_as`](super::read_as) and the others by what is their own.

use super::arguments::index;
use super::axes::as_written;
use super::chunk::Chunk;
use super::index::{hash, target};
use super::kinds::{Meaning, Motion, words};
use super::lex;
use super::lines::line_of;
use super::literal::Literal;
use super::named::Declarations;
use super::sample::{Found, Named, Sample};
use super::shape::pose;
use super::value::SourceSpan;
use super::{Layout, Site};
use crate::program::{ExternalAxes, Language, Mark, Predecessor, Program, Target, Tool, Wobj};
use crate::text::{Source, Span};
use std::ops::Range;
use std::sync::Arc;

/// A program of more kinds of lines than this a chunk has nothing to gain.
const MOST_KINDS: usize = 16;

/// What was read of a chunk.
pub(super) struct Read {
    targets: Vec<Target>,
    literals: Vec<Literal>,
    sites: Vec<Site>,
    tools: Vec<Tool>,
    wobjs: Vec<Wobj>,
    mark: Option<Mark>,
    /// Whether no target is declared.
    streamable: bool,
}

/// Lines that are alike.
struct AlikeLines<'a> {
    /// Before the robtarget or its name; the whole line where there is none.
    before: &'a [u8],
    behind: &'a [u8],
    /// How the robtarget is declared, where it has a name.
    way: Option<usize>,
    /// The motion, if it is one, with the tool and the work object of its own.
    motion: Option<Target>,
    /// Its last line.
    last: Last<'a>,
}

/// The last line of a kind.
enum Last<'a> {
    None,
    Inline(Box<(Sample<'a>, Option<Arc<ExternalAxes>>)>),
    Named(Named<'a>),
}

/// A line's target.
enum To<'s> {
    /// None, or one without a place.
    Nowhere,
    Inline(Found<'s>, &'s Option<Arc<ExternalAxes>>),
    /// A declared one, and where its name stands.
    Named(usize, Range<usize>),
}

/// Reads a chunk; `None` where only the plain way tells what it means.
pub(super) fn read(chunk: &Chunk) -> Option<Read> {
    if !chunk.plain_head {
        return None;
    }
    let bytes = &chunk.source.bytes[..chunk.stretch.end];
    let (mut declarations, literals) = Declarations::read(bytes, chunk.declared.clone())?;
    let motions = chunk.motions as usize;
    let mut read = Read {
        targets: Vec::with_capacity(motions),
        literals,
        sites: Vec::with_capacity(motions),
        tools: Vec::new(),
        wobjs: Vec::new(),
        mark: chunk.mark_before,
        streamable: declarations.is_empty(),
    };
    if read.streamable {
        read.literals.reserve(motions);
    }
    let mut kinds: Vec<AlikeLines> = Vec::new();
    let mut last = 0;
    let (mut start, mut line_number) = (chunk.stretch.start, chunk.lines_before);
    while start < bytes.len() {
        line_number += 1;
        if let Some(AlikeLines { way, motion: Some(like), last, .. }) = kinds.get_mut(last)
            && let Some((to, text, end)) = last.again(*way, &mut declarations, bytes, start)
        {
            start = end;
            read.push(chunk, &mut declarations, like, line_number, text, to)?;
            continue;
        }
        let line = line_of(&bytes[start..]);
        let first = start + line.len() - line.trim_ascii_start().len();
        let text = line.trim_ascii();
        let line_start = start;
        start += line.len();
        match text.first() {
            None if line.contains(&b'\r') && !line.ends_with(b"\r\n") => return None,
            None => continue,
            Some(b'!') => {
                read.mark = lex::mark(&text[1..]).or(read.mark);
                if text.contains(&b'\r') {
                    return None;
                }
                continue;
            }
            Some(_) => {}
        }
        let open = text.iter().position(|b| *b == b'[').unwrap_or(text.len());
        let robtarget = Literal::read(bytes, 0, first + open);
        let named = target(text).filter(|_| !read.streamable && robtarget.is_none());
        let named = named.and_then(|name| Some((declarations.find(&text[name.clone()])?, name)));
        let (before, behind) = match (&robtarget, &named) {
            // One over several lines is not worth a closer look.
            (Some((literal, _)), _) => (&text[..open], text.get(literal.span().range().end - first..)?),
            (None, Some((_, name))) => (&text[..name.start], &text[name.end..]),
            (None, None) => (text, &[][..]),
        };
        let way = named.as_ref().map(|(target, _)| declarations.way(*target));
        let alike = |kind: &AlikeLines| kind.way == way && kind.behind == behind && kind.before == before;
        if !kinds.get(last).is_some_and(alike) {
            last = kinds.iter().position(alike).unwrap_or(kinds.len());
            if last == kinds.len() {
                if last == MOST_KINDS {
                    return None;
                }
                kinds.push(read.kind(chunk, &declarations, before, behind, way, text)?);
            }
        }
        let kind = &mut kinds[last];
        let Some(like) = &kind.motion else { continue };
        let (at, axes);
        let to = match (&robtarget, named) {
            (Some((literal, written)), _) => {
                if bytes[literal.span().range()].contains(&b'\r') {
                    return None;
                }
                axes = as_written(&written.external);
                let sample = Sample::new(line, line_start, *literal, written);
                kind.last = sample.map_or(Last::None, |sample| Last::Inline(Box::new((sample, axes.clone()))));
                at = pose(written.position_mm, written.quat)?;
                To::Inline(Found { literal, start: literal.span().start, pose: &at, conf: &written.conf }, &axes)
            }
            (None, Some((target, name))) => {
                let name = first + name.start..first + name.end;
                let sample = Named::new(line, name.start - line_start..name.end - line_start);
                kind.last = sample.map_or(Last::None, Last::Named);
                To::Named(target, name)
            }
            (None, None) => To::Nowhere,
        };
        read.push(chunk, &mut declarations, like, line_number, first..first + text.len(), to)?;
    }
    // Names that the program has for something else.
    if !read.streamable {
        let texts = kinds.iter().flat_map(|kind| [kind.before, kind.behind]);
        let mut taken: Vec<u64> = texts.flat_map(words).collect();
        taken.extend(chunk.kinds.words_of_head(|| chunk.head_with(b"")));
        taken.sort_unstable();
        if declarations.any_of(&taken) {
            return None;
        }
    }
    (read.targets.len() == motions).then_some(read)
}

impl<'a> Last<'a> {
    /// The line at `start`, if it is like this one, declared in the same `way`: its target, its text's place and its end.
    #[inline]
    fn again(
        &mut self,
        way: Option<usize>,
        declarations: &mut Declarations,
        bytes: &'a [u8],
        start: usize,
    ) -> Option<(To<'_>, Range<usize>, usize)> {
        match self {
            Self::None => None,
            Self::Inline(last) => {
                // What stands after the pose is the same text.
                let (sample, axes) = &mut **last;
                let (indent, trailing) = (sample.indent, sample.trailing);
                let (found, len) = sample.read(bytes, start)?;
                Some((To::Inline(found, axes), start + indent..start + len - trailing, start + len))
            }
            Self::Named(named) => {
                let (name, len) = named.read(bytes, start)?;
                let target = declarations.find(&bytes[name.clone()])?;
                let text = start + named.indent..start + len - named.trailing;
                (Some(declarations.way(target)) == way).then_some((To::Named(target, name), text, start + len))
            }
        }
    }
}

impl Read {
    /// Takes a line's motion, which is like others, given its text's place and its target.
    fn push(
        &mut self,
        chunk: &Chunk,
        declarations: &mut Declarations,
        like: &Target,
        line: usize,
        text: Range<usize>,
        to: To<'_>,
    ) -> Option<()> {
        let ordinal = chunk.motions_before + u32::try_from(self.targets.len()).ok()? + 1;
        // Put together where it stays.
        self.targets.push(like.clone());
        let target = self.targets.last_mut()?;
        let site = match to {
            To::Nowhere => Site::None,
            To::Inline(found, axes) => {
                target.goal = found.goal();
                target.external.clone_from(axes);
                self.literals.push(*found.literal);
                self.literals.last_mut()?.move_to(found.start);
                Site::Literal { literal: u32::try_from(self.literals.len() - 1).ok()?, argument: None }
            }
            To::Named(declared, name) => {
                target.goal = declarations.goal(declared);
                target.external.clone_from(declarations.external(declared));
                target.name = declarations.name(declared, &chunk.source.bytes[name.clone()]);
                let argument = Some(SourceSpan { source: 0, span: Span::new(name.start, name.end) });
                Site::Literal { literal: u32::try_from(declared).ok()?, argument }
            }
        };
        self.sites.push(site);
        target.ordinal = ordinal;
        target.mark = self.mark;
        target.span = Span::new(text.start, text.end);
        target.line = u32::try_from(line).ok()?;
        Some(())
    }

    /// Takes in a kind of line that the chunk had none of.
    fn kind<'a>(
        &mut self,
        chunk: &Chunk,
        declarations: &Declarations,
        before: &'a [u8],
        behind: &'a [u8],
        way: Option<usize>,
        text: &[u8],
    ) -> Option<AlikeLines<'a>> {
        let way_of = way.map(|way| &declarations.ways()[way]);
        let inline = way.is_none() && before.len() < text.len();
        // No line has a line end in it, so that different kinds have different texts.
        let mut alike = vec![before];
        alike.extend((inline || way.is_some()).then_some(behind));
        alike.extend(way_of.into_iter().flat_map(|way| way.text()));
        let declaration = way_of.map(|way| way.line);
        let meaning = chunk.kinds.meaning(alike.join(&b'\n'), || {
            let name = text.get(before.len()..text.len() - behind.len()).filter(|_| way.is_some()).map(hash);
            let head = chunk.kinds.words_of_head(|| chunk.head_with(b""));
            // A target with the name of something else means it there: not so in other chunks.
            let taken = name.is_some_and(|name| {
                head.contains(&name) || [before, behind].into_iter().flat_map(words).any(|word| word == name)
            });
            if taken { None } else { learn(chunk, text, declaration, usize::from(before != text)) }
        })?;
        let motion = meaning.map(|Motion { like, tool, wobj }| Target {
            tool: index(&mut self.tools, tool, Tool::is),
            wobj: index(&mut self.wobjs, wobj, Wobj::is),
            // Read for itself it would be the first.
            predecessor: Predecessor::Previous,
            ..like
        });
        Some(AlikeLines { before, behind, way, motion, last: Last::None })
    }

    /// The chunk as a program.
    pub(super) fn into_program(self, dialect: &'static str, source: Source) -> Program {
        let literal_targets = self.literals.len();
        let layout = crate::program::Layout::Rapid(Layout {
            literals: Arc::new(self.literals),
            sites: self.sites,
            motions: self.targets.len(),
            streamable: self.streamable,
            plain: true,
            mark_behind: self.mark,
            ..Layout::default()
        });
        Program {
            tools: self.tools,
            wobjs: self.wobjs,
            targets: self.targets,
            literal_targets,
            ..Program::empty(Language::Rapid, dialect, ([source].into(), 1), layout)
        }
    }
}

/// Reads a line after the program's own head, with the declaration of its target, if it has one.
fn learn(chunk: &Chunk, text: &[u8], declaration: Option<&[u8]>, robtargets: usize) -> Option<Meaning> {
    let head = chunk.head_with(declaration.unwrap_or_default());
    let whole = Span::new(head.len(), head.len() + text.len());
    let mut program = chunk.program_of(head, text)?;
    let crate::program::Layout::Rapid(layout) = &program.layout else { return None };
    let plain = if declaration.is_some() { layout.plain } else { layout.streamable };
    let plain = plain && program.diagnostics.is_empty() && program.kept.is_empty();
    if !plain || layout.literals.len() != robtargets || program.targets.len() < robtargets || text.contains(&b'\r') {
        return None;
    }
    let motion = program.targets.pop();
    if !program.targets.is_empty() || motion.as_ref().is_some_and(|target| target.span != whole) {
        return None;
    }
    Some(motion.map(|like| Motion {
        tool: program.tools[usize::from(like.tool)].clone(),
        wobj: program.wobjs[usize::from(like.wobj)].clone(),
        like,
    }))
}

#[cfg(test)]
mod tests;
